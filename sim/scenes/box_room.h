/* The Cornell box that several scenes play in: 2 × 2 × 2 m, open towards the camera, walls 0.1 m thick at the back; and a lamp that sways in front of it. */
#ifndef EARTHSHINE_SIM_BOX_ROOM_H
#define EARTHSHINE_SIM_BOX_ROOM_H

#include "sim/scenes/body_tools.h"

/* Five walls, which bodies rest on and bounce off; a sixth, unseen, closes the box where it is open. 60 triangles. */
void es_build_box_room(es_scene_builder* builder);
/* From outside, so that the whole opening is in the picture. */
void es_build_box_camera(es_scene_builder* builder);
/* A spot of `intensity` W/sr above and in front of the opening, which swings by `amplitude` radians from left to right. */
void es_build_swaying_spot(es_scene_builder* builder, float intensity, float amplitude, float period);

#endif
