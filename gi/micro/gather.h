/* Between gather.c and its kernel: one cell of gather points at a time. */
#ifndef EARTHSHINE_GI_MICRO_GATHER_H
#define EARTHSHINE_GI_MICRO_GATHER_H

#include "gi/micro/micro.h"
#include "gi/surface.h"
#include "platform/maths.h"

enum {
    ES_MICRO_LANES = 8,
    ES_MICRO_CELL = 64,           /* points that share what is far (kernels/micro_panorama_simd.h) */
    ES_MICRO_LEVELS = 4,          /* cells of 64, 16, 4 points, and points */
    ES_MICRO_CHART = 80,          /* texels a side of a panorama's larger chart, at most: 5/2 of the largest buffer's */
    /* words of a panorama: rows with a border, of two charts and borders at the most, in eights */
    ES_MICRO_PANORAMA = (ES_MICRO_CHART + 2) * (ES_MICRO_CHART * 3 / 2 + 12),
    ES_MICRO_MAX_FAR = 49152,     /* nodes of a point's panoramas, at most; the rest of the cut is for what it draws itself */
    ES_MICRO_STAGE = 256,         /* nodes that are drawn into a panorama at once */
    ES_MICRO_MAX_ROOTS = 4096,    /* subtrees that a panorama leaves to others, at most */
    ES_MICRO_PIXELS = ES_MICRO_MAX_SIZE * ES_MICRO_MAX_SIZE,
    ES_MICRO_MARGIN = ES_MICRO_MAX_SIZE + 8, /* empty words before and behind a buffer */
    ES_MICRO_LANE = ES_MICRO_PIXELS + 2 * ES_MICRO_MARGIN, /* from one buffer to the next: not a multiple of what would put all into the same sets of a cache */
    ES_MICRO_JITTERS = 8,         /* sets of places in the pixels */
    ES_MICRO_GRID = 16,           /* cells a side of what a lobe's density is tabulated on */
    ES_MICRO_MAX_CUT = 65528      /* nodes of a cut: their places take 16 bits, the last one is the empty pixel's */
};

/* Rows of a buffer begin at multiples of eight pixels; what is past a row's end stays empty. */
static inline uint32_t es_micro_stride(uint32_t size) { return (size + 7) / 8 * 8; }

/* How a point's pixels are distributed. All points of a cell have the same. */
typedef enum es_micro_mapping { ES_MICRO_COSINE, ES_MICRO_GGX, ES_MICRO_PHONG, ES_MICRO_MAPPINGS } es_micro_mapping;

static inline es_micro_mapping es_micro_mapping_of(const es_gather_point* point, const es_micro_settings* settings)
{
    return point->kind == ES_GATHER_DIFFUSE || !settings->warp ? ES_MICRO_COSINE : point->model == ES_SURFACE_PHONG ? ES_MICRO_PHONG : ES_MICRO_GGX;
}

/* alpha² or the exponent */
static inline float es_micro_sharpness(const es_gather_point* point)
{
    const float alpha = point->roughness * point->roughness;
    return point->model == ES_SURFACE_PHONG ? point->roughness : es_maxf(alpha * alpha, ES_SURFACE_MIN_ALPHA2);
}
/* As of a view that is at the horizon when it is below. */
static inline float es_micro_view_cosine(const es_gather_point* point)
{
    return es_clampf(point->normal[0] * point->view[0] + point->normal[1] * point->view[1] + point->normal[2] * point->view[2], 1e-3f, 1.0f);
}
static inline es_vec3 es_micro_mirror(const es_gather_point* point)
{
    const es_vec3 n = es_v3(point->normal[0], point->normal[1], point->normal[2]), v = es_v3(point->view[0], point->view[1], point->view[2]);
    return es_v3_normalize(es_v3_sub(es_v3_scale(n, 2.0f * es_v3_dot(n, v)), v), n);
}

/* What all cosine-distributed buffers of a size have in common: rays, about z, through one place in each pixel. A point has one of some sets: with one alone the
 * rings of all would lie at the same heights, and what lies low show as bands. */
typedef struct es_micro_rays {
    float shift[2];                     /* of the places from the pixels' middles, pixels */
    float x[ES_MICRO_PIXELS], y[ES_MICRO_PIXELS], z[ES_MICRO_PIXELS];
    float interface[ES_MICRO_PIXELS];   /* 0.04 + 0.96 (1 - z)^5: what an interface with F90 = 1 does not let through */
} es_micro_rays;

typedef struct es_micro_table {
    uint32_t size, stride;
    es_micro_rays rays[ES_MICRO_JITTERS];
    /* On the disc, of the cells of the grid that a lobe's density is tabulated on: column i, row j at 16 i + j. The middle; at the border, where the density falls to
     * 0 as a root does, the middles of the quarters. */
    struct { float x[4], y[4]; uint32_t count; } grid[ES_MICRO_GRID * ES_MICRO_GRID];
} es_micro_table;

static inline uint32_t es_micro_jitter(const es_gather_point* point) { return (point->seed * 2654435769u >> 5) % ES_MICRO_JITTERS; }

typedef struct es_micro_job {
    const es_point_forest* forest;
    es_micro_settings settings;
    const es_micro_table* table;
    const es_gather_point* points;
    const uint32_t* order;        /* cells are runs of it */
    float inverse_square;         /* 1/m²: squared distances are compared as shares of the forest's extent */
    float* result[3];
    es_micro_pixel* picture;      /* of the last point gathered, rows of `size`; NULL: not wanted */
} es_micro_job;

/* A node in world space, as it is drawn. */
typedef struct es_micro_node {
    float c[3], axis[3];
    float slab;                            /* metres */
    float sine;                            /* of the cone's half angle, less what is too grazing to matter */
    float r;                               /* metres */
    float spread;                          /* square of the radius of a disc of the node's area, m² */
} es_micro_node;

/* A record each, which is read from end to end: as columns they would come from the same sets of the cache. */
typedef struct es_micro_cut {
    es_micro_node nodes[ES_MICRO_MAX_CUT + 8];
    uint32_t radiance[ES_MICRO_MAX_CUT + 8]; /* RGB9E5; [65535] is 0 */
    uint32_t node[ES_MICRO_MAX_CUT + 8];   /* place in the forest's nodes */
    uint32_t count;                        /* nodes that no point of the cell opens: [0, count) */
    uint32_t near;                         /* leaves that some would: [near, ES_MICRO_MAX_CUT) */
} es_micro_cut;

/* What a cell's points see in common. */
typedef struct es_micro_panorama {
    uint32_t rows, stride;                 /* with a border of one texel */
    int32_t words[ES_MICRO_PANORAMA];
} es_micro_panorama;

/* While a panorama is drawn. */
typedef struct es_micro_canvas {
    float stage[4][ES_MICRO_STAGE + 8];    /* nodes that wait to be drawn: where they are in the cell's axes, the square of the radius that they are drawn with */
    int32_t words[ES_MICRO_PANORAMA + 2 * (ES_MICRO_CHART * 3 / 2 + 12)]; /* with an empty row before and behind */
    bool has_rays;
    float rays[3][ES_MICRO_PANORAMA];      /* through the texels, in the cell's axes; 0 where there is none */
} es_micro_canvas;

/* The rays through a lobe's pixels, in its point's axes, and cones about each eight of them. */
typedef struct es_micro_lobe_rays { float at[3][ES_MICRO_PIXELS], axis[3][ES_MICRO_PIXELS / 8], cosine[ES_MICRO_PIXELS / 8]; } es_micro_lobe_rays;

/* A worker's. */
typedef struct es_micro_scratch {
    int32_t words[ES_MICRO_LANES][ES_MICRO_LANE]; /* depth << 16 | place in the cut (kernels/micro.c); pixels begin after the margin */
    es_micro_cut cut;
    es_micro_canvas canvas;
    es_micro_panorama panoramas[ES_MICRO_LEVELS];
    struct { uint32_t tree, node; } roots[ES_MICRO_LEVELS * ES_MICRO_MAX_ROOTS]; /* subtrees that are near, of each level behind those of the level above, in the order of trees */
    uint32_t wave[2][2 * ES_MICRO_MAX_CUT]; /* nodes of a tree's level that are looked at */
    uint32_t* trees;                       /* that the cell opens; as many as the forest has */
    uint8_t cast[ES_MICRO_MAX_CUT];        /* lanes in which a leaf is met by rays */
    /* of lobes: running sums of the density over columns, and over rows of each column, a lane each */
    float marginal[ES_MICRO_GRID + 1][ES_MICRO_LANES], conditional[ES_MICRO_GRID][ES_MICRO_GRID + 1][ES_MICRO_LANES];
    es_micro_lobe_rays lobes[ES_MICRO_LANES];
    es_micro_stats stats;
} es_micro_scratch;

#endif
