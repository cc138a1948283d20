/* The raster floor's kernels: one table per instruction set, all with equal results bit for bit. */
#ifndef EARTHSHINE_RASTER_KERNEL_TABLE_H
#define EARTHSHINE_RASTER_KERNEL_TABLE_H

#include "platform/kernel.h"
#include "raster/points.h"
#include "raster/stages.h"

/* return type, name, parameters */
#define ES_RASTER_KERNELS(X)                                                                                                         \
    X(void, transform_vertices, (const float* positions, uint32_t count, const es_window_matrix* matrix, float half_width, float half_height, \
        es_snapped_vertex* snapped, es_window_vertex* window))                                                                       \
    X(void, transform_deltas, (const float* positions, const float* previous_positions, uint32_t count, const es_window_matrix* matrix, \
        const es_window_matrix* previous_matrix, es_window_vertex* deltas))                                                          \
    X(void, bin_triangles, (es_bin_job * job))                                                                                       \
    X(void, draw_large, (es_tile * tile, const es_segment* segment))                                                                 \
    X(void, draw_small, (es_tile * tile, const es_segment* segment))                                                                 \
    X(void, draw_masked, (es_tile * tile, const es_segment* segment))                                                                \
    X(void, resolve_tile, (es_resolve_job * job, const es_tile* tile))                                                              \
    /* points.h: work holds es_splat_texels(size) texels */                                                                         \
    X(void, splat_parabolic_map, (const es_parabolic_map* map, const es_point_set* points, uint16_t* work))                         \
    /* work: size² texels, kept; scratch: es_pull_push_texels(size); out: size² */                                                  \
    X(void, pull_push, (const es_pull_push_parameters* parameters, uint16_t* work, uint16_t* scratch, uint16_t* out))

typedef struct es_raster_kernels {
#define ES_RASTER_KERNEL_MEMBER(type, name, parameters) type(*name) parameters;
    ES_RASTER_KERNELS(ES_RASTER_KERNEL_MEMBER)
#undef ES_RASTER_KERNEL_MEMBER
} es_raster_kernels;

/* The table of an instruction set this library was built with, NULL when it was not; es_context_isa gives the one to use. */
const es_raster_kernels* es_raster_kernels_of(es_isa isa);

#endif
