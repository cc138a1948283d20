/* Between the pixels of the window and the world, through the camera that it shows. */
#ifndef EARTHSHINE_DEMO_PLAYER_EYE_H
#define EARTHSHINE_DEMO_PLAYER_EYE_H

#include "player.h"

typedef struct player_eye {
    es_raster_view view;
    double origin[3];
    float width, height;
} player_eye;

/* False when there is no camera or no window. */
bool player_look(const player* p, player_eye* e);
/* In the eye's axes: x to the right, y up, z towards us. */
es_vec3 eye_of_world(const player_eye* e, const double position[3]);
void world_of_eye(const player_eye* e, es_vec3 v, double position[3]);
/* False behind the eye. */
bool eye_to_pixel(const player_eye* e, es_vec3 v, float* x, float* y);
/* Where the pixel's ray is `distance` ahead of the eye. */
es_vec3 eye_of_pixel(const player_eye* e, float x, float y, float distance);
/* The pixel's ray in the world; what is orthographic begins beside the eye. */
void eye_pixel_ray(const player_eye* e, float x, float y, double origin[3], es_vec3* direction);

#endif
