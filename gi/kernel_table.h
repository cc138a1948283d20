/* The light floor's kernels, one table per instruction set. */
#ifndef EARTHSHINE_GI_KERNEL_TABLE_H
#define EARTHSHINE_GI_KERNEL_TABLE_H

#include "gi/antialias.h"
#include "gi/background.h"
#include "gi/blend.h"
#include "gi/bounces.h"
#include "gi/compose.h"
#include "gi/direct.h"
#include "gi/edit/edit.h"
#include "gi/environment.h"
#include "gi/error/flip.h"
#include "gi/fft.h"
#include "gi/filter.h"
#include "gi/gi.h"
#include "gi/glare/billboards.h"
#include "gi/glare/convolution.h"
#include "gi/glare/diffraction.h"
#include "gi/half_resolution.h"
#include "gi/meter.h"
#include "gi/micro/forest_parts.h"
#include "gi/micro/gather.h"
#include "gi/micro/light.h"
#include "gi/micro/point_level.h"
#include "gi/micro/upsample.h"
#include "gi/pixel_rays.h"
#include "gi/reference/bvh.h"
#include "gi/reflections/reflecting.h"
#include "gi/screen/directional_occlusion.h"
#include "gi/screen/residual.h"
#include "gi/screen/screen_bounce.h"
#include "gi/second_order.h"
#include "gi/shade.h"
#include "gi/temporal.h"
#include "gi/view_importance.h"
#include "gi/vpl.h"

/* X(name, arguments) */
#define ES_GI_KERNELS(X)                                                                                         \
    X(place_points, (const es_raster_mesh* mesh, const es_mat4* transform, const uint32_t* triangle,             \
                     const uint32_t* barycentric, uint32_t count, float* x, float* y, float* z))                 \
    X(view_importance, (const es_receivers* receivers, const es_sender* senders, uint32_t count, float* result)) \
    /* rows [row_begin, row_end) */                                                                              \
    X(direct, (const es_direct_job* job, uint32_t row_begin, uint32_t row_end))                                  \
    /* gi/edit/edit.h: rows */                                                                                   \
    X(edit_directions, (const es_edit_job* job, uint32_t row_begin, uint32_t row_end))                          \
    /* gi/screen/residual.h: rows of the level, of the result */                                                 \
    X(residual_level, (const es_residual_layer* layer, uint32_t level, uint32_t row_begin, uint32_t row_end))    \
    X(residual_gather, (const es_residual_job* job, uint32_t row_begin, uint32_t row_end))                       \
    /* gi/second_order.h: rows */                                                                                \
    X(open_shade, (const es_open_job* job, uint32_t row_begin, uint32_t row_end))                                \
    X(open_upsample, (const es_open_upsample_job* job, uint32_t row_begin, uint32_t row_end))                    \
    X(compose, (const es_compose_job* job, uint32_t row_begin, uint32_t row_end))                                  \
    X(meter, (const es_meter_job* job, uint32_t row_begin, uint32_t row_end))                                      \
    X(blend, (const es_blend_job* job, uint32_t row_begin, uint32_t row_end))                                    \
    X(light_points, (const es_point_light_job* job, const es_point_forest* forest, const es_leaf_range* range))  \
    X(push_points, (const es_point_push* push, const es_point_forest* forest, const es_push_range* range)) \
    /* all lights [begin, end) at the points of a batch, whose lanes without a normal get nothing */                \
    X(shade_points, (const es_shade_job* job, const es_shade_light* lights, uint32_t begin, uint32_t end, es_shade_batch* batch, uint32_t lanes)) \
    /* a smaller image to the whole one's rows [row_begin, row_end) */                                         \
    X(upsample, (const es_upsample_job* job, uint32_t row_begin, uint32_t row_end))                            \
    X(micro_upsample, (const es_micro_upsample_job* job, uint32_t row_begin, uint32_t row_end))                \
    X(shade, (const es_shade_job* job, const es_shade_light* lights, const es_shade_block* block, es_shade_batch* batch)) \
    /* gi/bounces.h */                                                                                           \
    X(bounce_weights, (const es_bounce_sender* sender, const es_surfel_set* points, float* weights, float* sums)) \
    X(reflective_splat, (const es_bounce_sender* sender, const es_surfel_set* points, const es_reflective_map* map)) \
    X(reflective_fill, (const es_reflective_map* map))                                                           \
    X(reflective_weights, (const es_bounce_sender* sender, const es_surfel_set* points, const es_reflective_map* map, float* weights, float* sums)) \
    /* the block whose first pixel is (x, y) */                                                                  \
    X(filter, (const es_filter_job* job, uint32_t x, uint32_t y, es_filter_scratch* scratch))                    \
    X(screen_occlusion, (const es_occlusion_job* job, const es_screen_block* block))                             \
    X(arriving_light, (const es_arriving_job* job, uint32_t row_begin, uint32_t row_end))                        \
    X(turn_normals, (const es_gbuffer* gbuffer, uint32_t row_begin, uint32_t row_end))                           \
    X(screen_bounce, (const es_screen_bounce_job* job, const es_screen_block* block))                            \
    X(screen_light, (const es_screen_light_job* job, uint32_t row_begin, uint32_t row_end))                      \
    X(screen_reflect, (const es_screen_reflect_job* job, uint32_t row_begin, uint32_t row_end))                  \
    X(antialias, (const es_antialias_job* job, uint32_t row_begin, uint32_t row_end))                            \
    /* a row of tiles */                                                                                          \
    X(temporal_compare, (const es_temporal_job* job, uint32_t tile_row, float* shares))                          \
    X(temporal_blend, (const es_temporal_job* job, uint32_t row_begin, uint32_t row_end))                        \
    /* the tile whose first pixel is (x, y), once it is loaded */                                                \
    X(flip, (const es_flip_job* job, uint32_t x, uint32_t y, const es_flip_scratch* scratch))                    \
    /* gi/fft.h: strips of columns, rows; scratch of es_fft_column_scratch or es_fft_row_scratch floats, 64-byte aligned */ \
    X(fft_columns, (const es_fft_columns_job* job, uint32_t begin, uint32_t end, float* scratch))                \
    X(fft_rows, (const es_fft_rows_job* job, uint32_t begin, uint32_t end, float* scratch))                      \
    /* gi/glare/diffraction.h: groups of eight rows of the spectrum; scratch of es_chromatic_scratch floats */     \
    X(fade, (const es_fade_job* job, uint32_t row_begin, uint32_t row_end))                                      \
    X(chromatic, (const es_chromatic_job* job, uint32_t begin, uint32_t end, float* scratch))                    \
    /* gi/glare/convolution.h: rows, and whether each strip of their columns is dark; rows */                    \
    X(glare_load, (const es_glare_load_job* job, uint32_t row_begin, uint32_t row_end, uint8_t* dark))           \
    X(glare_finish, (const es_glare_finish_job* job, uint32_t row_begin, uint32_t row_end))                      \
    /* gi/glare/billboards.h: rows of tiles; rows */                                                             \
    X(billboard_tiles, (const es_glare_billboard_job* job, uint32_t begin, uint32_t end))                        \
    X(billboard_rows, (const es_glare_billboard_job* job, uint32_t row_begin, uint32_t row_end))                 \
    X(trace_closest, (const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, es_hit* hits))       \
    X(trace_any, (const es_bvh* bvh, bool coherent, const es_ray* rays, uint32_t count, uint8_t* blocked))       \
    X(trace_beyond, (const es_bvh* bvh, const es_ray* ray, const es_hit* passed, es_hit* hit))                   \
    /* gi/micro/forest_parts.h */                                                                                \
    X(forest_box, (const float* positions, const float u[9], uint32_t begin, uint32_t end, float low[3], float high[3])) \
    /* count: a multiple of eight; to: records of four floats, the first three of the positions' after u, or of `from` as they are */ \
    X(forest_vertices, (const float* positions, const float u[9], const uint32_t* vertices, uint32_t count, float* to)) \
    X(forest_normals, (const float* from, const uint32_t* vertices, uint32_t count, float* to))                  \
    X(forest_leaves, (const es_leaf_job* job, uint32_t begin, uint32_t end))                                     \
    X(forest_merge, (float* nodes, uint32_t level, bool leaves, const float* child_area, float* area, float* sum)) \
    X(forest_quantise, (const es_node_frame* frame, float* nodes, uint32_t first, uint32_t count, bool leaves, es_point_node* to)) \
    X(forest_pull, (const es_node_light* light, uint32_t begin, uint32_t end))                                   \
    X(forest_pack, (const es_node_light* light, uint32_t begin, uint32_t end))                                   \
    X(forest_pull_lobes, (const es_node_lobes* lobes, uint32_t begin, uint32_t end))                             \
    X(widen_lobes, (es_point_lobe* leaves, uint32_t begin, uint32_t end))                                        \
    X(forest_blend, (const es_node_looks* looks, uint32_t begin, uint32_t end))                                  \
    /* points order[first … first + count), 1 … ES_MICRO_CELL of them */                                         \
    X(micro_gather, (const es_micro_job* job, uint32_t first, uint32_t count, es_micro_scratch* scratch))         \
    /* rows [row_begin, row_end) of a level */                                                                    \
    X(environment_lobes, (const es_environment_lobe_job* job, uint32_t row_begin, uint32_t row_end))              \
    X(environment_irradiance, (const es_environment_irradiance_job* job, uint32_t row_begin, uint32_t row_end))   \
    /* gi/reflections/reflection_map.h: rows of the face, of all six faces of the level, one after another */      \
    X(reflection_face, (const es_reflection_face_job* job, uint32_t row_begin, uint32_t row_end))                  \
    X(reflection_lobe, (const es_reflection_lobe_job* job, uint32_t row_begin, uint32_t row_end))                  \
    X(reflection_ask, (const es_reflection_atlas* atlas, const es_reflection_question* question))                  \
    X(reflecting, (const es_reflecting_job* job, uint32_t row_begin, uint32_t row_end))                            \
    X(reflected, (const es_reflected_job* job, uint32_t row_begin, uint32_t row_end))                              \
    X(background, (const es_background_job* job, uint32_t row_begin, uint32_t row_end))                            \
    X(environment_ask, (const es_environment_lookup* lookup, const es_environment_question* question))

struct es_gi_kernels {
#define ES_GI_KERNEL_FIELD(name, arguments) void (*name) arguments;
    ES_GI_KERNELS(ES_GI_KERNEL_FIELD)
#undef ES_GI_KERNEL_FIELD
};
typedef struct es_gi_kernels es_gi_kernels;

/* NULL when the ISA was not built; whether it runs here is es_isa_available_mask()'s to say */
const struct es_gi_kernels* es_gi_kernel_table(es_isa isa);

#endif
