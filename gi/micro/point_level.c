#include "gi/micro/point_level.h"

#include "gi/kernel_table.h"
#include "raster/pack.h"

static uint32_t power_of_two_below(uint64_t a)
{
    uint32_t power = 1;
    while ((uint64_t)power * 2 <= a && power < 1u << 30) power *= 2;
    return power;
}

/* Leaves of each of a tree's runs: the forest's over the level, but no less than a share of the level for each tree. */
static uint32_t samples_of(const es_point_forest* f, const es_point_tree* tree, uint64_t wanted)
{
    const uint64_t by_share = (uint64_t)tree->leaf_count * wanted / (f->leaf_count ? f->leaf_count : 1), least = power_of_two_below(wanted / f->tree_count / 2);
    uint64_t samples = by_share > least ? by_share : least;
    if (samples > tree->leaf_count) samples = tree->leaf_count;
    return power_of_two_below(samples);
}

static void soften(es_point_level* level, uint32_t begin, uint32_t count)
{
    float mean[3] = {0, 0, 0}, sum = 0.0f, size = 0.0f;
    for (uint32_t i = begin; i < begin + count; i++) {
        mean[0] += level->x[i];
        mean[1] += level->y[i];
        mean[2] += level->z[i];
    }
    for (int k = 0; k < 3; k++) mean[k] /= (float)count;
    for (uint32_t i = begin; i < begin + count; i++) {
        const float dx = level->x[i] - mean[0], dy = level->y[i] - mean[1], dz = level->z[i] - mean[2];
        sum += dx * dx + dy * dy + dz * dz;
    }
    for (int k = 0; k < 3; k++) size = es_maxf(size, es_absf(mean[k]));
    /* samples in one place have the same weight */
    const float least = es_maxf(size * 1e-6f, 1e-8f);
    const float r2 = es_clampf(sum / (float)count / ES_LEVEL_GROUP, least * least, 1e36f);
    for (uint32_t i = begin; i < begin + count; i++) level->softening[i] = r2;
}

es_result es_point_level_make(es_arena* arena, const es_point_forest* f, uint32_t depth, es_point_level* level)
{
    const uint64_t wanted = (uint64_t)1 << (depth < 30 ? depth : 30);
    uint64_t count = 0;
    *level = (es_point_level){.first = es_arena_allocate(arena, ((size_t)f->tree_count + 1) * sizeof *level->first)};
    if (!level->first) return es_context_last_result(arena->context);
    for (uint32_t t = 0; t < f->tree_count; t++) {
        level->first[t] = (uint32_t)count;
        count += samples_of(f, &f->trees[t], wanted);
    }
    level->first[f->tree_count] = level->count = (uint32_t)count;
    const size_t bytes = ((size_t)count + VW) * sizeof(float);
    float** const arrays[] = {&level->x, &level->y, &level->z, &level->nx, &level->ny, &level->nz, &level->softening};
    level->leaf = es_arena_allocate(arena, ((size_t)count + VW) * sizeof *level->leaf);
    for (size_t i = 0; level->leaf && i < sizeof arrays / sizeof arrays[0]; i++)
        if (!(*arrays[i] = es_arena_allocate(arena, bytes))) break;
    if (!level->softening) return es_context_last_result(arena->context);
    for (uint32_t t = 0; t < f->tree_count; t++) {
        const es_point_tree* tree = &f->trees[t];
        const uint32_t begin = level->first[t], samples = level->first[t + 1] - begin, run = tree->leaf_count / samples;
        for (uint32_t i = 0; i < samples; i++) {
            /* of a surface that was split across and then along, the one next to where both cuts meet */
            const size_t leaf = tree->first_leaf + (size_t)i * run + run / 2 + run / 4;
            const es_vec3 n = es_unpack_normal(f->normal[leaf]);
            level->leaf[begin + i] = (uint32_t)leaf;
            level->x[begin + i] = f->x[leaf];
            level->y[begin + i] = f->y[leaf];
            level->z[begin + i] = f->z[leaf];
            level->nx[begin + i] = n.x;
            level->ny[begin + i] = n.y;
            level->nz[begin + i] = n.z;
        }
        const uint32_t group = samples < ES_LEVEL_GROUP ? samples : ES_LEVEL_GROUP;
        for (uint32_t i = 0; i < samples; i += group) soften(level, begin + i, group);
    }
    /* nobody looks at what is past the last, but it is read */
    for (uint32_t i = level->count; i < level->count + VW; i++) {
        level->x[i] = level->y[i] = level->z[i] = level->nx[i] = level->ny[i] = 0.0f;
        level->nz[i] = level->softening[i] = 1.0f;
        level->leaf[i] = 0;
    }
    return ES_OK;
}

es_result es_point_level_values(es_arena* arena, const es_point_level* level, float* values[3])
{
    for (int k = 0; k < 3; k++) {
        values[k] = es_arena_allocate(arena, ((size_t)level->count + VW) * sizeof(float));
        if (!values[k]) return es_context_last_result(arena->context);
    }
    return ES_OK;
}

/* The samples of a leaf's group; the group's leaves end at *end. */
static void group_of(const es_point_level* level, const es_point_forest* f, uint32_t t, size_t leaf, uint32_t* sample, uint32_t* samples, size_t* end)
{
    const es_point_tree* tree = &f->trees[t];
    const uint32_t all = level->first[t + 1] - level->first[t];
    *samples = all < ES_LEVEL_GROUP ? all : ES_LEVEL_GROUP;
    const size_t leaves = (size_t)(tree->leaf_count / all) * *samples, group = (leaf - tree->first_leaf) / leaves;
    *sample = level->first[t] + (uint32_t)group * *samples;
    *end = tree->first_leaf + (group + 1) * leaves;
}

uint32_t es_point_level_owner(const es_point_level* level, const es_point_forest* f, uint32_t tree, size_t leaf)
{
    uint32_t sample, samples;
    size_t end;
    group_of(level, f, tree, leaf, &sample, &samples, &end);
    const es_vec3 n = es_unpack_normal(f->normal[leaf]);
    uint32_t best = sample;
    float most = -1.0f;
    for (uint32_t i = sample; i < sample + samples; i++) {
        const float dx = f->x[leaf] - level->x[i], dy = f->y[leaf] - level->y[i], dz = f->z[leaf] - level->z[i];
        const float c = es_maxf(n.x * level->nx[i] + n.y * level->ny[i] + n.z * level->nz[i], 0.0f), near = level->softening[i] / (dx * dx + dy * dy + dz * dz + level->softening[i]);
        const float w = (c * c * (c * c) + 1e-4f) * (near * near);
        if (!(w > most)) continue;
        most = w;
        best = i;
    }
    return best;
}

typedef struct push_loop { const es_gi_kernels* kernels; es_point_forest* forest; const es_point_push* push; } push_loop;

static void push_leaves(void* user, const es_leaf_range* range, uint32_t worker)
{
    const push_loop* loop = user;
    (void)worker;
    const size_t last = range->leaf + range->count;
    for (size_t leaf = range->leaf; leaf < last;) {
        es_push_range part = {.leaves = {leaf, range->node + (leaf - range->leaf), 0, range->tree}};
        size_t end;
        group_of(loop->push->level, loop->forest, range->tree, leaf, &part.sample, &part.samples, &end);
        if (end > last) end = last;
        part.leaves.count = (uint32_t)(end - leaf);
        loop->kernels->push_points(loop->push, loop->forest, &part);
        leaf = end;
    }
}

void es_points_push(es_context* context, es_point_forest* forest, const es_point_push* push)
{
    push_loop loop = {es_gi_kernel_table(es_context_isa(context)), forest, push};
    es_forest_each_leaf(context, forest, push_leaves, &loop);
}
