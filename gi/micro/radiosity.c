#include "gi/micro/radiosity.h"

#include <string.h>

#include "platform/random.h"

/* The leaves' first radiance, by leaf, and back. */
typedef struct copy_loop { es_point_forest* forest; float* of[3]; bool back; } copy_loop;

static void copy_leaves(void* user, const es_leaf_range* range, uint32_t worker)
{
    const copy_loop* loop = user;
    (void)worker;
    for (int k = 0; k < 3; k++) {
        float *leaves = loop->of[k] + range->leaf, *nodes = loop->forest->radiance[k] + range->node;
        memcpy(loop->back ? nodes : leaves, loop->back ? leaves : nodes, range->count * sizeof(float));
    }
}

static es_gather_point gather_at(const es_point_level* level, uint32_t i, uint32_t seed)
{
    /* without F0 nothing is kept back by an interface: the albedo of light from everywhere has that in it */
    return (es_gather_point){.position = {level->x[i], level->y[i], level->z[i]}, .normal = {level->nx[i], level->ny[i], level->nz[i]}, .view = {level->nx[i], level->ny[i], level->nz[i]},
        .roughness = 1.0f, .model = ES_SURFACE_METALLIC_ROUGHNESS, .kind = ES_GATHER_DIFFUSE, .seed = es_random_u32(seed, i)};
}

es_result es_points_light_radiosity(es_context* context, es_arena* arena, es_point_forest* forest, const es_radiosity_job* job, es_micro_stats* stats)
{
    if (stats) *stats = (es_micro_stats){0};
    if (!forest->leaf_count || !job->iterations) return ES_OK;
    es_point_level level;
    es_result result = es_point_level_make(arena, forest, job->level, &level);
    es_point_push push = {.level = &level, .lobes = job->lobes};
    if (!result) result = es_point_level_values(arena, &level, push.values);
    copy_loop first = {.forest = forest};
    for (int k = 0; k < 3 && !result; k++)
        if (!(first.of[k] = es_arena_allocate(arena, forest->leaf_count * sizeof(float)))) result = es_context_last_result(context);
    es_gather_point* points = result ? NULL : es_arena_allocate(arena, ((size_t)level.count + 1) * sizeof *points);
    if (!points) return result ? result : es_context_last_result(context);
    es_forest_each_leaf(context, forest, copy_leaves, &first);
    first.back = true;
    for (uint32_t i = 0; i < job->iterations && !result; i++) {
        es_forest_pull(context, forest);
        for (uint32_t s = 0; s < level.count; s++) points[s] = gather_at(&level, s, es_random_u32(job->seed, i));
        es_micro_stats one = {0};
        result = es_micro_gather(context, forest, &job->micro, points, level.count, push.values, &one);
        if (result) break;
        if (i) es_forest_each_leaf(context, forest, copy_leaves, &first);
        es_points_push(context, forest, &push);
        if (!stats) continue;
        stats->samples += one.samples;
        stats->drawn += one.drawn;
        stats->cast += one.cast;
    }
    return result;
}
