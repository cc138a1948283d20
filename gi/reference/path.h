/* One sample of one pixel: a path from the camera, with its light sorted by the number of bounces it took. */
#ifndef EARTHSHINE_GI_REFERENCE_PATH_H
#define EARTHSHINE_GI_REFERENCE_PATH_H

#include "gi/pixel_rays.h"
#include "gi/reference/scene.h"

/* Where a path begins: found once for all samples of a pixel that are taken through its centre. */
typedef struct es_path_start {
    bool seen;
    es_vec3 wo;                  /* unit, towards the eye, lifted to the horizon */
    es_vec3 emission;            /* seen directly, or the environment's radiance */
    es_vec3 direct;              /* from spot, point and directional lights: no chance in it */
    es_trace_surface surface;
} es_path_start;

void es_path_begin(const es_trace_scene* scene, const es_pixel_rays* rays, float x, float y, bool quantised, es_path_start* start);

/* bounce[0] is direct light, bounce[b] what took b more bounces; bounces + 1 entries are written. Returns the rays traced.
 * Numbers come from scrambled Sobol' points (es_path_number) of the pixel's seed and the sample's index. */
uint32_t es_path_trace(const es_trace_scene* scene, const es_path_start* start, uint32_t bounces, uint32_t seed, uint32_t sample, es_vec3* bounce);

/* Coordinate 0 or 1 of the sample-th point of a two-dimensional Sobol' sequence, [0, 1): nested uniform scrambling by hashing (Laine and
 * Karras 2011, Burley 2020), its order and its scrambling drawn anew for every pair of dimensions. */
void es_path_numbers(uint32_t seed, uint32_t pair, uint32_t sample, float u[2]);

#endif
