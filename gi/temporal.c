/* Hands tiles and rows of temporal coherence to the workers (gi/temporal.h; the work is in kernels/temporal.c). */
#include "gi/temporal.h"

#include "gi/kernel_table.h"
#include "gi/pixel_rays.h"
#include "platform/maths.h"

void es_temporal_depth_then(const es_raster_view* now, const es_raster_view* then, uint32_t step, float depth_then[2][3])
{
    const es_pixel_rays rays = es_pixel_rays_of_view(now);
    const float* v = then->view.m;
    const es_vec3 back = es_v3(v[2], v[6], v[10]);
    const float* lines[2][3] = {{rays.base, rays.base_dx, rays.base_dy}, {rays.dir, rays.dir_dx, rays.dir_dy}};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            const float* p = lines[i][k];
            depth_then[i][k] = -(back.x * p[0] + back.y * p[1] + back.z * p[2]) * (k ? (float)step : 1.0f);
        }
    depth_then[0][0] -= v[14];
}

typedef struct temporal_loop {
    const es_gi_kernels* kernels;
    const es_temporal_job* job;
    float* tiles;
} temporal_loop;

static void compare_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    temporal_loop* loop = user;
    for (uint32_t row = begin; row < end; row++) loop->kernels->temporal_compare(loop->job, row, loop->tiles + (size_t)row * loop->job->tile_columns);
}

static void blend_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    temporal_loop* loop = user;
    loop->kernels->temporal_blend(loop->job, begin, end);
}

es_result es_temporal_compare(es_context* context, es_arena* arena, es_temporal_job* job)
{
    job->reset = NULL;
    if (!job->history_count || !(job->reset_high > 0.0f)) return ES_OK;
    job->tile_columns = es_temporal_tiles(job->gbuffer->width);
    job->tile_rows = es_temporal_tiles(job->gbuffer->height);
    const size_t count = (size_t)job->tile_columns * job->tile_rows;
    float* tiles = es_arena_allocate(arena, 2 * count * sizeof *tiles);
    if (!tiles) return es_context_last_result(context);
    temporal_loop loop = {es_gi_kernel_table(es_context_isa(context)), job, tiles};
    es_parallel_for(context, job->tile_rows, 1, compare_rows, &loop);
    job->reset = tiles + count;
    for (uint32_t y = 0; y < job->tile_rows; y++)
        for (uint32_t x = 0; x < job->tile_columns; x++) {
            float most = 0.0f;
            for (uint32_t j = y ? y - 1 : 0; j <= y + 1 && j < job->tile_rows; j++)
                for (uint32_t i = x ? x - 1 : 0; i <= x + 1 && i < job->tile_columns; i++) most = es_maxf(most, tiles[(size_t)j * job->tile_columns + i]);
            job->reset[(size_t)y * job->tile_columns + x] = most;
        }
    return ES_OK;
}

void es_temporal_blend(es_context* context, const es_temporal_job* job)
{
    temporal_loop loop = {.kernels = es_gi_kernel_table(es_context_isa(context)), .job = job};
    es_parallel_for(context, job->gbuffer->height, 8, blend_rows, &loop);
}
