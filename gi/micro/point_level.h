/* An inner level of a forest: a few leaves, spread evenly, at which light is found that would cost too much at all of them, and from which it is
 * pushed down (Ritschel thesis §6.4.3; Cohen, Wallace and Hanrahan 1993).
 *
 * A tree of n samples has one in the middle of each of n runs of leaves, which are its nodes n … 2n - 1. A leaf takes the light of the samples of its
 * group, the ES_LEVEL_GROUP runs about it that are one node of the tree further up, each with the weight
 *     w = (max(n · n_s, 0)^4 + 1e-4) · (r² / (|x - x_s|² + r²))²,
 * n and x being normals and places, r the root mean square distance of the group's samples from their mean, over √ES_LEVEL_GROUP: light is continuous
 * within a group, and of surfaces that face elsewhere only where there are no others. */
#ifndef EARTHSHINE_GI_MICRO_POINT_LEVEL_H
#define EARTHSHINE_GI_MICRO_POINT_LEVEL_H

#include "gi/micro/light.h"

enum { ES_LEVEL_GROUP = 16 };

typedef struct es_point_level {
    uint32_t count;                /* samples; arrays are readable up to eight past it */
    uint32_t* first;               /* of each tree, and the count after the last; a tree has a power of two */
    uint32_t* leaf;                /* of each sample */
    float *x, *y, *z, *nx, *ny, *nz; /* world, unit */
    float* softening;              /* r² of each sample's group, m² */
} es_point_level;

/* About 2^level samples, at most twice as many or one a tree; small trees have more than their share of leaves gives them, so that what they stand
 * for has all its sides. Memory is the arena's. */
es_result es_point_level_make(es_arena* arena, const es_point_forest* forest, uint32_t level, es_point_level* made);

/* Room for three numbers of each sample, the arena's. */
es_result es_point_level_values(es_arena* arena, const es_point_level* level, float* values[3]);

/* Of the group that leaf belongs to, the sample with the largest weight. */
uint32_t es_point_level_owner(const es_point_level* level, const es_point_forest* forest, uint32_t tree, size_t leaf);

/* To the radiance of every leaf adds albedo / pi times the mean of `values` over its group, by weight times `areas`:
 *     sum of w · value / sum of w · area
 * Irradiances have areas NULL, which counts as 1; W have the m² that they fell on. The albedo is the surface's for light from everywhere, lobe
 * included (es_surface_albedo). Unlit surfaces get nothing. */
typedef struct es_point_push {
    const es_point_level* level;
    float* values[3];
    const float* areas;
    const es_lobe_albedo* lobes;   /* filled */
} es_point_push;

void es_points_push(es_context* context, es_point_forest* forest, const es_point_push* push);

/* ---- between point_level.c and its kernel ------------------------------------------------------------------------------------------ */

/* Leaves of one group, whose samples are [sample, sample + samples). */
typedef struct es_push_range { es_leaf_range leaves; uint32_t sample, samples; } es_push_range;

#endif
