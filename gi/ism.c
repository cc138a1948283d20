/* Imperfect shadow maps of a frame: lights are handed to the workers, each draws and fills one map at a time in its own scratch,
 * which stays in the second-level cache and mostly in the first (gi/ism.h, raster/points.h). */
#include "gi/ism.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "raster/kernel_table.h"
#include "raster/points.h"

typedef struct ism_loop {
    const es_ism_job* job;
    const es_raster_kernels* kernels;
    uint16_t* maps;
    uint16_t* scratch;
    size_t scratch_texels;     /* a worker's */
    es_pull_push_parameters fill;
    uint32_t subsets;
} ism_loop;

es_result es_ism_maps_reserve(es_context* context, es_ism_maps* maps, uint32_t size, uint32_t count, float far_distance)
{
    size_t texels = (size_t)size * size * count;
    if (texels > maps->capacity) {
        es_release(context, maps->texels, maps->capacity * sizeof *maps->texels);
        *maps = (es_ism_maps){0};
        maps->texels = es_allocate_array(context, texels, sizeof *maps->texels);
        if (!maps->texels) return es_context_last_result(context);
        maps->capacity = texels;
    }
    maps->size = size;
    maps->count = count;
    maps->far_distance = far_distance;
    return ES_OK;
}

void es_ism_maps_free(es_context* context, es_ism_maps* maps)
{
    es_release(context, maps->texels, maps->capacity * sizeof *maps->texels);
    *maps = (es_ism_maps){0};
}

/* The points of each density with squares of their own width. */
static void splat(const ism_loop* loop, uint32_t subset, es_parabolic_map* map, uint16_t* work)
{
    const es_scene_points* points = loop->job->points;
    uint32_t begin = 0;
    for (uint32_t rank = 0; rank < points->rank_count; rank++) {
        const uint32_t end = es_scene_points_border(points, subset, points->rank_end[rank]);
        const size_t first = (size_t)subset * points->subset_size + begin;
        const es_point_set set = {points->x + first, points->y + first, points->z + first, end - begin};
        map->splat_width = points->rank_width[rank];
        if (end > begin) loop->kernels->splat_parabolic_map(map, &set, work);
        begin = end;
    }
}

static void draw_map(const ism_loop* loop, uint32_t v, uint16_t* work)
{
    const es_ism_job* job = loop->job;
    const size_t texels = (size_t)job->size * job->size;
    uint16_t* map = loop->maps + v * texels;
    memset(work, 0xff, texels * sizeof *work);
    if (loop->subsets) {
        const es_vpl_record* vpl = &job->vpls[v];
        es_parabolic_map parabolic = {.far_distance = job->far_distance, .near_distance = job->near_distance, .size = job->size};
        memcpy(parabolic.position, vpl->position, sizeof parabolic.position);
        memcpy(parabolic.normal, vpl->normal, sizeof parabolic.normal);
        memcpy(parabolic.tangent, vpl->tangent, sizeof parabolic.tangent);
        memcpy(parabolic.bitangent, vpl->bitangent, sizeof parabolic.bitangent);
        splat(loop, v % loop->subsets, &parabolic, work);
        if (job->pull_push) {
            loop->kernels->pull_push(&loop->fill, work, work + (es_splat_texels(job->size) + 31) / 32 * 32, map);
            return;
        }
    }
    memcpy(map, work, texels * sizeof *map);
}

/* Lights that share a subset follow each other, so its points are read from the caches: item i is light subset + k · subsets. */
static void draw_maps(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const ism_loop* loop = user;
    uint16_t* work = loop->scratch + worker * loop->scratch_texels;
    const uint32_t count = loop->job->vpl_count, subsets = loop->subsets ? loop->subsets : 1;
    const uint32_t low = count / subsets, larger = count % subsets; /* the first `larger` subsets have low + 1 lights */
    for (uint32_t i = begin; i < end; i++) {
        uint32_t border = larger * (low + 1), subset, k;
        if (i < border) {
            subset = i / (low + 1);
            k = i % (low + 1);
        } else {
            subset = larger + (i - border) / low;
            k = (i - border) % low;
        }
        draw_map(loop, subset + k * subsets, work);
    }
}

es_result es_ism_maps_build(es_context* context, es_ism_maps* maps, const es_ism_job* job)
{
    es_result result = es_ism_maps_reserve(context, maps, job->size, job->vpl_count, job->far_distance);
    if (result) return result;
    const uint32_t workers = es_context_workers(context);
    ism_loop loop = {.job = job, .kernels = es_raster_kernels_of(es_context_isa(context)), .maps = maps->texels};
    loop.subsets = job->points && job->points->subset_size ? job->points->subset_count : 0;
    loop.scratch_texels = (es_splat_texels(job->size) + 31) / 32 * 32 + (es_pull_push_texels(job->size) + 31) / 32 * 32;
    loop.scratch = es_allocate_array(context, workers, loop.scratch_texels * sizeof *loop.scratch);
    if (!loop.scratch) return es_context_last_result(context);
    loop.fill = (es_pull_push_parameters){.size = job->size, .levels = job->pull_push_levels,
        .pull = (uint32_t)(es_clampf(job->pull_threshold, 0.0f, 1.0f) * (float)ES_PARABOLIC_DEPTH_MAX),
        .push = (uint32_t)(es_clampf(job->push_threshold, 0.0f, 1.0f) * (float)ES_PARABOLIC_DEPTH_MAX)};
    es_parallel_for(context, job->vpl_count, 4, draw_maps, &loop);
    es_release(context, loop.scratch, workers * loop.scratch_texels * sizeof *loop.scratch);
    return ES_OK;
}
