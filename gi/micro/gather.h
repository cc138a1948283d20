/* Between gather.c and its kernel: one cell of gather points at a time. */
#ifndef EARTHSHINE_GI_MICRO_GATHER_H
#define EARTHSHINE_GI_MICRO_GATHER_H

#include "gi/micro/micro.h"

enum {
    ES_MICRO_LANES = 8,
    ES_MICRO_CELL = 64,           /* points that share a cut */
    ES_MICRO_PIXELS = ES_MICRO_MAX_SIZE * ES_MICRO_MAX_SIZE,
    ES_MICRO_LANE = ES_MICRO_PIXELS + 48, /* words from one buffer to the next: not a multiple of what would put them all into the same sets of the cache */
    ES_MICRO_MAX_CUT = 65528      /* nodes of a cut: their places take 16 bits, the last one is the empty pixel's */
};

/* Rows of a buffer begin at multiples of eight pixels; what is past a row's end stays empty. */
static inline uint32_t es_micro_stride(uint32_t size) { return (size + 7) / 8 * 8; }

/* What all cosine-distributed buffers of a size have in common: the pixels' middles, about z. */
typedef struct es_micro_table {
    uint32_t size, stride;
    float x[ES_MICRO_PIXELS], y[ES_MICRO_PIXELS], z[ES_MICRO_PIXELS];
    float interface[ES_MICRO_PIXELS];   /* 0.04 + 0.96 (1 - z)^5: what an interface with F90 = 1 does not let through */
} es_micro_table;

typedef struct es_micro_job {
    const es_point_forest* forest;
    es_micro_settings settings;
    const es_micro_table* table;
    const es_gather_point* points;
    const uint32_t* order;        /* cells are runs of it */
    float inverse_square;         /* 1/m²: squared distances are compared as shares of the forest's extent */
    float* result[3];
} es_micro_job;

/* Nodes in world space, one after another. */
typedef struct es_micro_cut {
    float c[3][ES_MICRO_MAX_CUT + 8], axis[3][ES_MICRO_MAX_CUT + 8];
    float slab[ES_MICRO_MAX_CUT + 8];      /* metres */
    float sine[ES_MICRO_MAX_CUT + 8];      /* of the cone's half angle, less what is too grazing to matter */
    float r[ES_MICRO_MAX_CUT + 8];
    uint32_t radiance[ES_MICRO_MAX_CUT + 8]; /* RGB9E5; [65535] is 0 */
    uint32_t node[ES_MICRO_MAX_CUT + 8];   /* place in the forest's nodes */
    uint32_t count;                        /* nodes that no point of the cell opens: [0, count) */
    uint32_t near;                         /* leaves that some would: [near, ES_MICRO_MAX_CUT) */
} es_micro_cut;

/* A worker's. */
typedef struct es_micro_scratch {
    int32_t pixels[ES_MICRO_LANES][ES_MICRO_LANE]; /* depth << 16 | place in the cut (kernels/micro.c) */
    es_micro_cut cut;
    uint32_t wave[2][2 * ES_MICRO_MAX_CUT]; /* nodes of a tree's level that are looked at */
    uint32_t* trees;                       /* that the cell opens; as many as the forest has */
    es_micro_stats stats;
} es_micro_scratch;

#endif
