/* What surrounds a reflecting thing, as a cube seen from its middle: radiance, and how far away it is.
 *
 * The six faces are those of es_cube_views, level 0 of `size`² texels of four floats: r, g, b, W/(m² sr), and 1 over the depth along the face's axis, 1/m, 0 where
 * nothing is. On a plane that is linear over a face, so that bilinear look-ups of it are exact there. Every level has a border of one texel, its neighbour's
 * next texel, and in the corners the mean of the three that meet there: a look-up between four texels has no seam.
 *
 * Further levels are for lobes, about the mirrored direction (N = V = R, weighted by the cosine: Karis 2013, "Real Shading in Unreal Engine 4"; Heidrich and
 * Seidel 1999 for the idea): level 1 the mean over a texel of 1/64 of a face, which takes the place of GGX with alpha 1/64; levels 2 … 7 GGX with alpha 1/32 … 1 by filtered
 * importance sampling (Křivánek and Colbert 2008). Weights of each add up to 1: evenly bright surroundings stay so. Means are over texels, not weighted by solid angle.
 *
 * A look-up (gi/kernels/reflection_map_simd.h) begins at a point of the thing, not in its middle. The point that a ray from there meets is found along its image in the
 * map, a great circle: by steps of about even angle, finer ones where cells have anything near enough, up to the first place behind what the map shows, then by false position (after Szirmay-Kalos et al. 2005, "Approximate Ray-Tracing on
 * the GPU with Distance Impostors"). With g = depth of the ray's point over the map's there, g is linear along the ray where the map shows a plane, and the root g = 1 is
 * found at once. Where g jumps from below 1 to above it, the ray goes behind the edge of something as the middle sees it. What is there is not in the map: nothing is taken to
 * be, the ray goes on until it comes out, and sees what is beside that edge when it does not. */
#ifndef EARTHSHINE_GI_REFLECTIONS_REFLECTION_MAP_H
#define EARTHSHINE_GI_REFLECTIONS_REFLECTION_MAP_H

#include "platform/context.h"
#include "raster/raster.h"

enum {
    ES_REFLECTION_LEVELS = 8,   /* 0 a mirror, 1 … 7: GGX's alpha 1/64 … 1 */
    ES_REFLECTION_MEANS = 5,    /* at most: levels of means that lobes are made from, the first is level 1 */
    ES_REFLECTION_CELLS = 16,   /* along a face's side: each knows how near anything in it or around it is */
    ES_REFLECTION_TAPS = 32,
    ES_REFLECTION_MOST_MAPS = 64
};

/* Where the levels of a map are: in texels from its begin, face after face, each (size + 2)². */
typedef struct es_reflection_layout {
    uint32_t size;
    float level_size[ES_REFLECTION_LEVELS];
    int32_t level_first[ES_REFLECTION_LEVELS];
    float mean_size[ES_REFLECTION_MEANS];
    int32_t mean_first[ES_REFLECTION_MEANS];
    uint32_t means;
    int32_t bounds_first;       /* in texels, of a float for each cell of each face: 1 over the least distance there, 1/m */
    int32_t texels;             /* of a whole map */
} es_reflection_layout;

/* size: a power of two, 16 … 1024 */
es_reflection_layout es_reflection_layout_of(uint32_t size);

/* The level for GGX's alpha, and the last one that a look-up of that alpha or less may need. */
float es_reflection_level_of_alpha(float alpha);

/* All maps, one after another, for kernels. */
typedef struct es_reflection_atlas {
    const float* texels;
    es_reflection_layout layout;
    const float* centre[3];     /* of each map, relative to the world's origin; */
    const float* last_level;    /* of those that are there */
} es_reflection_atlas;

/* A lobe around +z by directions with a weight each, which add up to 1, and the level of means whose texels are as large as what a direction stands for. */
typedef struct es_reflection_tap { float direction[3], level, weight; } es_reflection_tap;

typedef struct es_reflection_lobe_job {
    const float* texels;        /* of the map */
    const es_reflection_layout* layout;
    const es_reflection_tap* taps;
    uint32_t tap_count;
    uint32_t level;
    float* out;                 /* the level's first texel, border included */
} es_reflection_lobe_job;

/* Radiance and depth of a face, planes of rows of `stride`, to level 0 of a map. */
typedef struct es_reflection_face_job {
    const float* radiance[3];
    const float* depth;
    uint32_t size, stride;
    float* out;                 /* the face's first texel, border included */
} es_reflection_face_job;

void es_reflection_face(es_context* context, const es_reflection_face_job* job);
/* Borders of level 0, once all six faces are there, then levels 1 … last_level. */
es_result es_reflection_map_finish(es_context* context, const es_reflection_layout* layout, float* texels, uint32_t last_level);

/* What points see along directions, for whoever is no kernel: `count`, a multiple of 8. */
typedef struct es_reflection_question {
    const int32_t* map;         /* -1: nothing, black */
    const float *position[3], *direction[3]; /* unit */
    const float* alpha;         /* of GGX, 0 … 1 */
    float* radiance[3];
    float* met[3];              /* where the ray ends, relative to the map's centre, or its direction where that is infinitely far; NULL: not wanted */
    uint32_t count;
} es_reflection_question;
void es_reflection_ask(const es_context* context, const es_reflection_atlas* atlas, const es_reflection_question* question);

#endif
