/* Points drawn into parabolic maps: the imperfect shadow maps of Ritschel's thesis, §5.2.
 *
 * A parabolic map (Brabec, Annen and Seidel 2002) holds the distances seen from a point over the hemisphere about its normal:
 * with q = (d·t, d·b, d·n), d from the map's position to the seen point and r = |d|,
 *
 *     (u, v) = (q.x, q.y) / (r + q.z)        in the unit disc, |(u, v)| = tan(theta / 2)
 *     texel  = ((u, v) + 1) / 2 · size       rows of `size` texels, v downwards
 *     depth  = round(r / far · ES_PARABOLIC_DEPTH_MAX), ES_PARABOLIC_EMPTY where nothing was drawn; the smaller wins
 *
 * A parallel map is what a light at infinity sees along the normal of a square about the position, far × far:
 *
 *     (u, v) = (q.x, q.y) · 2 / far,   depth = round(q.z / far · ES_PARABOLIC_DEPTH_MAX)
 *
 * The largest depth leaves a gap of a quarter of the range below EMPTY: no threshold (at most a third of far) bridges it, so
 * "close to" never holds between a depth and EMPTY and the filters need no separate test for holes. 49151 steps over a scene
 * of 50 m are 1 mm each.
 */
#ifndef EARTHSHINE_RASTER_POINTS_H
#define EARTHSHINE_RASTER_POINTS_H

#include "platform/platform.h"

enum {
    ES_PARABOLIC_EMPTY = 65535,
    ES_PARABOLIC_DEPTH_MAX = 49151,
    ES_PARABOLIC_THRESHOLD_MAX = 16383, /* = EMPTY - DEPTH_MAX - 1; three times it fits 16 bits, which the average needs */
    ES_PARABOLIC_MAX_SIZE = 1024,       /* size² fits the 20 bits of a queued splat */
    ES_PULL_PUSH_MAX_LEVELS = 4,
    ES_PULL_PUSH_GRANULE = 32           /* sizes that can be pulled are multiples of it */
};

/* Points as three arrays. Readable up to the next multiple of eight; each stands for the same area. */
typedef struct es_point_set {
    const float *x, *y, *z;
    uint32_t count;
} es_point_set;

typedef struct es_parabolic_map {
    float position[3];
    float tangent[3], bitangent[3], normal[3]; /* orthonormal */
    float far_distance;    /* depth that becomes ES_PARABOLIC_DEPTH_MAX; points farther away are not drawn */
    float near_distance;   /* points closer are not drawn */
    float splat_width;     /* metres: the side of the square a point stands for */
    uint32_t size;         /* texels of a side, 4 … ES_PARABOLIC_MAX_SIZE */
    bool parallel;         /* of a light that is infinitely far away, see below; near_distance is not used */
} es_parabolic_map;

/* Draws the points of `points` into work[0 … size²), which the caller has filled with EMPTY or with other points: a box of
 * 1 … 4 texels each, as wide as the point's square appears: under the projection dtheta becomes (1 + u² + v²) / 2 · dtheta,
 * which is r / (r + q.z) · dtheta, so a width w at distance r covers w / (r + q.z) · size / 2 texels; of a parallel map w / far · size. Boxes are moved inside
 * the map at its border. Texels after size² are written with what they held: es_splat_texels(size) must be there. */
static inline size_t es_splat_texels(uint32_t size) { return (size_t)size * size + 3 * (size_t)size + 16; }

/* Pull and push (thesis §5.2.2; Marroquim, Kraus and Cavalcanti 2007), depths being 16-bit integers throughout.
 *
 * Pull, level l to l + 1, m being the nearest of four texels: the average of those within pull · 2^l of m,
 *     coarse = m + floor(sum of (x - m) · floor-or-half-up(65536 / count) / 65536)
 * Push, level l + 1 to l: f is interpolated from the coarse texels (weights 9 3 3 1, as two rounds of (c + (c + x + 1) / 2 + 1)
 * / 2, first vertically, then horizontally); a neighbour not within pull · 2^(l + 1) of the nearer texel c counts as c, so depth
 * edges stay. A fine texel that is empty or more than push · 2^l behind f becomes f. Without neighbours in reach of the pulled
 * levels a hole stays. */
typedef struct es_pull_push_parameters {
    uint32_t size;             /* a multiple of ES_PULL_PUSH_GRANULE, at most ES_PARABOLIC_MAX_SIZE */
    uint32_t levels;           /* 1 … ES_PULL_PUSH_MAX_LEVELS */
    uint32_t pull, push;       /* thresholds in depth units at level 0; scaled ones are cut off at ES_PARABOLIC_THRESHOLD_MAX */
} es_pull_push_parameters;

/* Coarse levels have a margin of EMPTY texels: a row above and below, VHW on both sides of a row (whose width is rounded up to
 * VHW). One more row holds what was interpolated vertically. */
static inline uint32_t es_pull_push_stride(uint32_t size, uint32_t level) { return ((size >> level) + 15) / 16 * 16 + 32; }
static inline size_t es_pull_push_texels(uint32_t size)
{
    size_t texels = es_pull_push_stride(size, 1);
    for (uint32_t l = 1; l <= ES_PULL_PUSH_MAX_LEVELS; l++) texels += (size_t)es_pull_push_stride(size, l) * ((size >> l) + 2);
    return texels;
}

#endif
