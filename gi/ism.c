/* Imperfect shadow maps of a frame: lights are handed to the workers, each draws and fills one map at a time in its own scratch,
 * which stays in the second-level cache and mostly in the first (gi/ism.h, raster/points.h). */
#include "gi/ism.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/kernel_table.h"
#include "raster/points.h"

/* A subset's points of the objects that are still, or of the others, rank by rank. */
typedef struct gathered_points {
    float *x, *y, *z;
    uint32_t subset, end[ES_POINT_RANKS];
    bool still;
} gathered_points;

typedef struct ism_loop {
    const es_ism_job* job;
    const es_raster_kernels* kernels;
    uint16_t* maps;
    uint16_t* scratch;
    size_t scratch_texels;     /* a worker's */
    es_pull_push_parameters fill;
    uint32_t subsets;
    es_ism_kept* kept;         /* NULL: nothing is, all is drawn */
    uint64_t moved;            /* es_scene_points.time when a point last moved */
    bool layers;               /* some objects are still, others are not */
    gathered_points* gathered; /* one a worker */
} ism_loop;

es_result es_ism_maps_reserve(es_context* context, es_ism_maps* maps, uint32_t size, uint32_t count, float far_distance)
{
    size_t texels = (size_t)size * size * count;
    maps->kept.key = 0;
    if (texels > maps->capacity) {
        es_release(context, maps->texels, maps->capacity * sizeof *maps->texels);
        maps->texels = NULL;
        maps->capacity = 0;
        maps->size = maps->count = 0;
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
    es_ism_kept* kept = &maps->kept;
    es_release(context, maps->texels, maps->capacity * sizeof *maps->texels);
    es_release(context, kept->maps, kept->map_capacity * sizeof *kept->maps);
    es_release(context, kept->layers, kept->layer_capacity * sizeof *kept->layers);
    es_release(context, kept->still, kept->source_capacity);
    *maps = (es_ism_maps){0};
}

/* ---- one map ---------------------------------------------------------------------------------------------------------- */

static void gather(const ism_loop* loop, gathered_points* g, uint32_t subset, bool still)
{
    const es_scene_points* points = loop->job->points;
    if (g->subset == subset && g->still == still) return;
    g->subset = subset;
    g->still = still;
    uint32_t count = 0;
    for (uint32_t rank = 0; rank < points->rank_count; rank++) {
        const double rank_begin = rank ? points->rank_end[rank - 1] : 0.0, rank_end = points->rank_end[rank];
        for (uint32_t i = 0; i < points->source_count; i++) {
            const es_point_source* source = &points->sources[i];
            if (loop->kept->still[i] != still || !(source->begin >= rank_begin && source->begin < rank_end)) continue;
            const uint32_t first = es_scene_points_border(points, subset, source->begin), n = es_scene_points_border(points, subset, source->end) - first;
            const size_t at = (size_t)subset * points->subset_size + first;
            memcpy(g->x + count, points->x + at, n * sizeof(float));
            memcpy(g->y + count, points->y + at, n * sizeof(float));
            memcpy(g->z + count, points->z + at, n * sizeof(float));
            count += n;
        }
        g->end[rank] = count;
    }
}

static uint32_t splat_gathered(const ism_loop* loop, const gathered_points* g, es_parabolic_map* map, uint16_t* work)
{
    const es_scene_points* points = loop->job->points;
    uint32_t begin = 0;
    for (uint32_t rank = 0; rank < points->rank_count; rank++) {
        const es_point_set set = {g->x + begin, g->y + begin, g->z + begin, g->end[rank] - begin};
        map->splat_width = points->rank_width[rank];
        if (set.count) loop->kernels->splat_parabolic_map(map, &set, work);
        begin = g->end[rank];
    }
    return begin;
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

/* Points of the map into `work`, from the layer where there is one. */
static void draw_points(const ism_loop* loop, uint32_t v, es_parabolic_map* parabolic, uint16_t* work, gathered_points* gathered)
{
    const es_scene_points* points = loop->job->points;
    const size_t texels = (size_t)loop->job->size * loop->job->size;
    const uint32_t subset = v % loop->subsets;
    es_kept_map* kept = loop->kept ? &loop->kept->maps[v] : NULL;
    const bool stays = kept && kept->drawn; /* its light was there last time */
    if (!stays || !loop->layers || v >= loop->kept->layer_count) {
        memset(work, 0xff, texels * sizeof *work);
        splat(loop, subset, parabolic, work);
        if (kept) kept->splats = points->subset_size;
        return;
    }
    uint16_t* layer = loop->kept->layers + v * texels;
    kept->splats = 0;
    if (kept->layered) {
        memcpy(work, layer, texels * sizeof *work);
    } else {
        memset(work, 0xff, texels * sizeof *work);
        gather(loop, gathered, subset, true);
        kept->splats += splat_gathered(loop, gathered, parabolic, work);
        memcpy(layer, work, texels * sizeof *work);
        kept->layered = true;
    }
    gather(loop, gathered, subset, false);
    kept->splats += splat_gathered(loop, gathered, parabolic, work);
}

static void draw_map(const ism_loop* loop, uint32_t v, uint16_t* work, gathered_points* gathered)
{
    const es_ism_job* job = loop->job;
    const size_t texels = (size_t)job->size * job->size;
    uint16_t* map = loop->maps + v * texels;
    if (!loop->subsets) {
        memset(map, 0xff, texels * sizeof *map);
        return;
    }
    const es_vpl_record* vpl = &job->vpls[v];
    es_parabolic_map parabolic = {.far_distance = job->far_distance, .near_distance = job->near_distance, .size = job->size, .parallel = vpl->parallel};
    memcpy(parabolic.position, vpl->position, sizeof parabolic.position);
    memcpy(parabolic.normal, vpl->normal, sizeof parabolic.normal);
    memcpy(parabolic.tangent, vpl->tangent, sizeof parabolic.tangent);
    memcpy(parabolic.bitangent, vpl->bitangent, sizeof parabolic.bitangent);
    if (loop->kept) {
        es_kept_map* kept = &loop->kept->maps[v];
        float pose[12];
        memcpy(pose, vpl->position, 3 * sizeof(float));
        memcpy(pose + 3, vpl->normal, 3 * sizeof(float));
        memcpy(pose + 6, vpl->tangent, 3 * sizeof(float));
        memcpy(pose + 9, vpl->bitangent, 3 * sizeof(float));
        kept->splats = 0;
        if (memcmp(kept->pose, pose, sizeof pose) != 0 || kept->parallel != vpl->parallel) {
            memcpy(kept->pose, pose, sizeof pose);
            kept->parallel = vpl->parallel;
            kept->drawn = 0;
            kept->layered = false;
        }
        if (kept->drawn && kept->drawn >= loop->moved) return;
    }
    draw_points(loop, v, &parabolic, work, gathered);
    if (loop->kept) loop->kept->maps[v].drawn = job->points->time;
    if (job->pull_push) loop->kernels->pull_push(&loop->fill, work, work + (es_splat_texels(job->size) + 31) / 32 * 32, map);
    else memcpy(map, work, texels * sizeof *map);
}

/* Lights that share a subset follow each other, so its points are read from the caches: item i is light first + subset + k · subsets. */
static void draw_maps(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const ism_loop* loop = user;
    uint16_t* work = loop->scratch + worker * loop->scratch_texels;
    const uint32_t first = loop->job->first, count = loop->job->vpl_count - first, subsets = loop->subsets ? loop->subsets : 1;
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
        draw_map(loop, first + subset + k * subsets, work, &loop->gathered[worker]);
    }
}

/* ---- what is kept ------------------------------------------------------------------------------------------------------- */

static uint64_t key_of(const ism_loop* loop)
{
    const es_ism_job* job = loop->job;
    const es_scene_points* points = job->points;
    const float numbers[] = {job->far_distance, job->near_distance};
    const uint64_t words[] = {job->size, job->room, job->pull_push, loop->fill.levels, loop->fill.pull, loop->fill.push, points->subset_size, points->subset_count, points->source_count, points->layout};
    return es_hash_bytes(es_hash_bytes(1, numbers, sizeof numbers), words, sizeof words) | 1;
}

/* Which objects the layers hold: all that did not move since the last build. They are chosen anew, and layers drawn anew, when one of them
 * moves, and when a quarter of the points of others has been still for STILL_TIME updates that moved something. */
enum { STILL_TIME = 8 };

static void choose_still(es_ism_kept* kept, const es_scene_points* points, uint32_t map_count)
{
    bool moved = false, any = false;
    double others = 0.0, resting = 0.0;
    for (uint32_t i = 0; i < points->source_count; i++) {
        const double share = points->sources[i].end - points->sources[i].begin;
        any |= kept->still[i];
        moved |= kept->still[i] && points->sources[i].placed > kept->time;
        if (kept->still[i]) continue;
        others += share;
        if (points->sources[i].placed + STILL_TIME <= points->time) resting += share;
    }
    if (any && !moved && !(resting * 4.0 > others)) return;
    for (uint32_t i = 0; i < points->source_count; i++) kept->still[i] = points->sources[i].placed <= kept->time;
    for (uint32_t v = 0; v < map_count; v++) kept->maps[v].layered = false;
}

/* Which points go into layers, and when they last moved. */
static void use_kept(es_ism_kept* kept, ism_loop* loop)
{
    const es_scene_points* points = loop->job->points;
    bool still = false, others = false;
    for (uint32_t i = 0; i < points->source_count; i++) {
        still |= kept->still[i];
        others |= !kept->still[i];
        if (points->sources[i].placed > loop->moved) loop->moved = points->sources[i].placed;
    }
    loop->layers = still && others;
    loop->kept = kept;
}

static es_result prepare_kept(es_context* context, es_ism_kept* kept, uint64_t last_key, ism_loop* loop)
{
    const es_ism_job* job = loop->job;
    const es_scene_points* points = job->points;
    const size_t map_texels = (size_t)job->size * job->size;
    size_t layers = job->kept_bytes / (map_texels * sizeof(uint16_t));
    if (layers > job->room) layers = job->room;
    bool fresh = last_key != key_of(loop);
    kept->key = 0;
    if (!es_grow(context, (void**)&kept->maps, &kept->map_capacity, fresh ? 0 : job->room, job->room, sizeof *kept->maps)) return es_context_last_result(context);
    if (!es_grow(context, (void**)&kept->still, &kept->source_capacity, fresh ? 0 : points->source_count, points->source_count, 1)) return es_context_last_result(context);
    if (layers * map_texels > kept->layer_capacity || (!layers && kept->layers)) {
        es_release(context, kept->layers, kept->layer_capacity * sizeof *kept->layers);
        kept->layer_capacity = 0;
        kept->layers = layers ? es_allocate_array(context, layers * map_texels, sizeof *kept->layers) : NULL;
        if (layers && !kept->layers) return es_context_last_result(context);
        kept->layer_capacity = layers * map_texels;
        fresh = true;
    }
    kept->layer_count = (uint32_t)layers;
    if (fresh) {
        memset(kept->maps, 0, job->room * sizeof *kept->maps);
        memset(kept->still, 0, points->source_count);
        kept->time = points->time;
    } else {
        choose_still(kept, points, job->room);
    }
    use_kept(kept, loop);
    return ES_OK;
}

es_result es_ism_maps_build(es_context* context, es_ism_maps* maps, const es_ism_job* job)
{
    const uint64_t last_key = maps->kept.key;
    const uint16_t* last_texels = maps->texels;
    es_result result = job->first ? ES_OK : es_ism_maps_reserve(context, maps, job->size, job->room, job->far_distance);
    if (result) return result;
    maps->count = job->vpl_count;
    const uint32_t workers = es_context_workers(context);
    ism_loop loop = {.job = job, .kernels = es_raster_kernels_of(es_context_isa(context)), .maps = maps->texels};
    loop.subsets = job->points && job->points->subset_size ? job->points->subset_count : 0;
    loop.fill = (es_pull_push_parameters){.size = job->size, .levels = job->pull_push_levels,
        .pull = (uint32_t)(es_clampf(job->pull_threshold, 0.0f, 1.0f) * (float)ES_PARABOLIC_DEPTH_MAX),
        .push = (uint32_t)(es_clampf(job->push_threshold, 0.0f, 1.0f) * (float)ES_PARABOLIC_DEPTH_MAX)};
    if (job->keep && loop.subsets && !job->first) result = prepare_kept(context, &maps->kept, last_texels == maps->texels ? last_key : 0, &loop);
    /* later maps go by what was chosen for the first, of the same points; if those were drawn without, none stands */
    else if (job->keep && loop.subsets && last_key == key_of(&loop) && maps->kept.time == job->points->time) use_kept(&maps->kept, &loop);
    else if (job->first) maps->kept.key = 0;
    if (result) return result;
    es_arena scratch;
    es_arena_init(&scratch, context, 1 << 16);
    loop.scratch_texels = (es_splat_texels(job->size) + 31) / 32 * 32 + (es_pull_push_texels(job->size) + 31) / 32 * 32;
    loop.scratch = es_arena_allocate(&scratch, workers * loop.scratch_texels * sizeof *loop.scratch);
    loop.gathered = loop.scratch ? es_arena_allocate(&scratch, workers * sizeof *loop.gathered) : NULL;
    bool all = loop.gathered != NULL;
    for (uint32_t i = 0; i < workers && all && loop.layers; i++) {
        const size_t bytes = ((size_t)job->points->subset_size + 8) * sizeof(float);
        gathered_points* g = &loop.gathered[i];
        g->subset = UINT32_MAX;
        all = (g->x = es_arena_allocate(&scratch, bytes)) && (g->y = es_arena_allocate(&scratch, bytes)) && (g->z = es_arena_allocate(&scratch, bytes));
        /* a vector reads past the last point */
        if (all) memset(g->x, 0, bytes), memset(g->y, 0, bytes), memset(g->z, 0, bytes);
    }
    if (!all) result = es_context_last_result(context);
    if (!result) {
        es_parallel_for(context, job->vpl_count - job->first, 4, draw_maps, &loop);
        es_ism_kept* kept = &maps->kept;
        kept->splats = loop.kept ? 0 : (uint64_t)(job->vpl_count - job->first) * (loop.subsets ? job->points->subset_size : 0);
        kept->stood = 0;
        for (uint32_t v = job->first; v < job->vpl_count && loop.kept; v++) {
            kept->splats += kept->maps[v].splats;
            kept->stood += !kept->maps[v].splats;
        }
        if (loop.kept) {
            kept->key = key_of(&loop);
            kept->time = job->points->time;
        }
    }
    es_arena_free(&scratch);
    return result;
}
