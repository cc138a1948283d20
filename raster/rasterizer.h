/* The rasterizer's scratch memory and the stages that run outside kernels. */
#ifndef EARTHSHINE_RASTER_RASTERIZER_H
#define EARTHSHINE_RASTER_RASTERIZER_H

#include "platform/context.h"
#include "raster/kernel_table.h"

/* Memory of one worker during a draw. Records and lists stay in the arena until the view is finished. */
typedef struct es_raster_worker {
    es_arena arena;
    es_large_triangle* large;       /* of the chunk being binned */
    es_tile_rect *large_rects, *small_rects;
    uint32_t* key_count;            /* per (tile, kind), zero between chunks */
    uint32_t* touched;              /* keys whose count is not zero */
    size_t key_capacity;
    float *tile_depth, *tile_ceiling;
    uint32_t* tile_number;
    es_visible_triangle* visible;
    uint32_t *slot_number, *slot_pixel;
    uint32_t *triangle_ids, *slot;  /* by number in a tile; slot is zero between tiles */
    size_t number_capacity;
    float block_minimum[64];
    bool failed;
    uint64_t culled, clipped, hidden, pixels;
} es_raster_worker;

typedef struct es_vertex_block { uint32_t instance, first, count; } es_vertex_block;

struct es_rasterizer {
    es_context* context;
    const es_raster_kernels* kernels;
    es_raster_worker* workers;
    uint32_t worker_count;

    es_prepared_material* materials;
    es_prepared_instance* instances;
    uint32_t* chunk_instance;
    es_chunk* chunks;
    es_vertex_block* vertex_blocks;
    es_snapped_vertex* snapped;
    es_window_vertex *window, *deltas;
    es_segment* segments;
    uint32_t* key_first;            /* per (tile, kind) and one more: its segments */
    size_t material_capacity, instance_capacity, chunk_capacity, chunk_instance_capacity, vertex_block_capacity, snapped_capacity, window_capacity,
        delta_capacity, segment_capacity, key_first_capacity;
    uint32_t instance_count, chunk_count, vertex_block_count, tiles_x, tiles_y;
    size_t vertex_count, delta_count;
    uint64_t instances_culled, triangle_count, segment_pairs;
    uint32_t tile_records_max;
};

/* Double-precision matrices of a view, row-major. */
typedef struct es_view_matrices { double window[16], previous_window[16]; bool orthographic, still; } es_view_matrices;
es_view_matrices es_view_matrices_of(const es_raster_view* view);

/* materials.c */
bool es_prepare_materials(es_rasterizer* rasterizer, const es_draw_list* list);
/* instances.c: what is in view, its chunks and vertex blocks. `planes` says whether motion is wanted. */
bool es_prepare_instances(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, const es_view_matrices* matrices, uint32_t planes);
/* bins.c: one chunk's lists, then all chunks' segments by tile */
bool es_list_chunk(es_rasterizer* rasterizer, es_raster_worker* worker, const es_bin_job* job, bool masked, es_chunk* chunk);
bool es_order_segments(es_rasterizer* rasterizer);

#endif
