/* Between nodes and bodies: poses without scale, positions in double. */
#ifndef EARTHSHINE_SIM_RIGID_NODE_POSE_H
#define EARTHSHINE_SIM_RIGID_NODE_POSE_H

#include "sim/world.h"

/* Where the node is (null: the world's own axes) and how it is turned, scale left out. */
void es_node_get_pose(const es_world* world, es_node node, double position[3], es_quat* rotation);
/* Keeps the node's scale. The node must not be below a scaled one, and its parent's matrix must be up to date. */
void es_node_set_pose(es_world* world, es_node node, const double position[3], es_quat rotation);
bool es_node_is_below_scale(const es_world* world, es_node node);

#endif
