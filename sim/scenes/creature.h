/* A four-legged animal with a trunk: one skinned mesh on eighteen joints, and the clip by which it walks. */
#ifndef EARTHSHINE_SIM_CREATURE_H
#define EARTHSHINE_SIM_CREATURE_H

#include "sim/scenes/body_tools.h"

/* On `root`, standing on its xz plane and looking along -z; 1.5 m high. `scale` multiplies how finely it is cut, 1: 12,016 triangles.
 * Its lower legs are kinematic bodies.
 * The clip takes `period` seconds and two steps of each leg; whoever moves the root should do so at es_creature_speed. */
void es_build_creature(es_scene_builder* builder, es_node root, es_material hide, float scale, float period);
/* m/s at which its feet stand still on the ground. */
float es_creature_speed(float period);

#endif
