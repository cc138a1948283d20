/* Queries in a body's own frame, for the other files of this folder. */
#ifndef EARTHSHINE_SIM_RIGID_SHAPE_QUERY_H
#define EARTHSHINE_SIM_RIGID_SHAPE_QUERY_H

#include "sim/rigid/collision.h"

/* es_rigid_shape_closest with everything in the body's frame. */
bool es_shape_nearest(const es_rigid_shape* shape, es_vec3 point, float max_distance, es_shape_hit* hit);
es_vec3 es_nearest_on_triangle(es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 p);

#endif
