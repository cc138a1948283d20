/* The colonnade that two scenes play in, without light or camera. */
#ifndef EARTHSHINE_SIM_HALL_H
#define EARTHSHINE_SIM_HALL_H

#include "sim/scenes/scene_tools.h"

/* Triangles to aim at, 0: 108,516. */
void es_build_hall(es_scene_builder* builder, uint32_t triangles);

#endif
