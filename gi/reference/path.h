/* Paths from the camera, with their light sorted by the number of bounces it took. */
#ifndef EARTHSHINE_GI_REFERENCE_PATH_H
#define EARTHSHINE_GI_REFERENCE_PATH_H

#include "gi/pixel_rays.h"
#include "gi/reference/light_vertices.h"

/* Where a path begins: found once for all samples of a pixel that are taken through its centre. */
typedef struct es_path_start {
    bool seen;
    es_vec3 wo;                  /* unit, towards the eye, lifted to the horizon */
    es_vec3 emission;            /* seen directly, or the environment's radiance */
    es_vec3 weight;              /* of what the sample finds: of a ray that went through glass, or was one of those that did not. Not applied by paths: to whoever adds them up */
    es_trace_surface surface;
} es_path_start;

es_ray es_path_ray(const es_pixel_rays* rays, float x, float y);
/* The surface of a hit of es_trace_closest by that ray for a camera; hit primitive ES_NO_PRIMITIVE: the environment. */
void es_path_begin(const es_trace_scene* scene, const es_ray* ray, const es_hit* hit, bool quantised, es_path_start* start);
/* From spot, point and directional lights, there: no chance in it. Adds to the rays traced. */
es_vec3 es_path_direct(const es_trace_scene* scene, const es_path_start* start, uint32_t* rays);

/* Which points paths take for their first bounce; each alone finds all of it, if noisily. */
typedef enum es_path_techniques {
    ES_PATH_COMBINED,            /* both, by multiple importance sampling */
    ES_PATH_SURFACES,            /* what directions of the first surfaces meet */
    ES_PATH_LIGHT_VERTICES       /* light vertices; only for one bounce of light from spot, point and directional lights */
} es_path_techniques;

typedef struct es_path_job {
    const es_trace_scene* scene;
    const es_light_emissions* emissions;
    uint32_t bounces;
    es_path_techniques techniques;
} es_path_job;

/* Paths of a group of pixels share what they find: after "Accelerating Path Tracing by Re-Using Paths" (Bekaert, Sbert and Halton 2002). Each
 * pixel's path meets a point; each point that sends light, and some light vertices beside them, is connected to all pixels of the group,
 * weighted by the balance heuristic over all ways in which the group could have found it. What the paths bring is right on average for
 * each pixel, whatever the group, and independent from sample to sample; but the noise of pixels of one group is alike. */
enum { ES_PATH_GROUP = 64, ES_PATH_MAX_BOUNCES = 64 };

typedef struct es_path_group {
    uint32_t count;                             /* of pixels, at most ES_PATH_GROUP; neighbours follow each other */
    uint32_t seed;
    uint32_t light_vertices;                    /* to be drawn */
    const es_path_start* starts[ES_PATH_GROUP];
    uint32_t seeds[ES_PATH_GROUP];              /* of the pixels */
    es_vec3* bounce;                            /* [pixel][bounces + 1]: bounce[0] is direct light of glowing surfaces and the environment */
} es_path_group;

/* One sample of each pixel of the group. Returns the rays traced. Numbers come from scrambled Sobol' points (es_path_numbers) of the seeds and the
 * sample's index. */
uint32_t es_path_trace(const es_path_job* job, const es_path_group* group, uint32_t sample);

/* Coordinate 0 or 1 of the sample-th point of a two-dimensional Sobol' sequence, [0, 1): nested uniform scrambling by hashing (Laine and
 * Karras 2011, Burley 2020), its order and its scrambling drawn anew for every pair of dimensions. */
void es_path_numbers(uint32_t seed, uint32_t pair, uint32_t sample, float u[2]);

#endif
