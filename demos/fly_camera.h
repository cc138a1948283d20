/* A camera that flies: it follows the scene's own camera until it is moved. */
#ifndef EARTHSHINE_DEMO_FLY_CAMERA_H
#define EARTHSHINE_DEMO_FLY_CAMERA_H

#include "demo.h"

typedef struct fly_camera {
    es_camera own, scenes; /* ours, and the one the scene came with */
    es_node node;
    es_vec3 position;
    float yaw, pitch; /* radians; yaw 0 looks along -z, positive to the left */
    float speed;      /* metres per second */
    bool flying;
} fly_camera;

int fly_camera_init(fly_camera* fly, es_world* world);
/* Moves with what is held down; the first move leaves the scene's camera where it is and takes over from its pose. */
int fly_camera_update(fly_camera* fly, es_world* world, const es_window_input* input, float seconds);
/* Puts the world's camera where this one is: after the world was wound back. */
int fly_camera_place(fly_camera* fly, es_world* world);
/* Takes over from wherever the world's camera is, ours or the scene's: after a replay. */
void fly_camera_adopt(fly_camera* fly, es_world* world);
/* To a place, looking along a direction; fov_y 0: as it is. */
int fly_camera_go(fly_camera* fly, es_world* world, const double position[3], es_vec3 direction, float fov_y);
int fly_camera_reset(fly_camera* fly, es_world* world);

#endif
