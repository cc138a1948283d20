#include "gi/micro/light.h"

#include "gi/kernel_table.h"

/* Leaves that a worker takes at once: enough to be worth it, few enough to share them evenly. */
enum { GRAIN = 4096 };

typedef struct leaf_loop { const es_point_forest* forest; es_leaf_body body; void* user; } leaf_loop;

/* The tree that leaf belongs to: the last that begins at or before it. */
static uint32_t tree_of(const es_point_forest* forest, size_t leaf)
{
    uint32_t low = 0, high = forest->tree_count;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (forest->trees[middle].first_leaf <= leaf) low = middle;
        else high = middle;
    }
    return low;
}

static void chunks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const leaf_loop* loop = user;
    const es_point_forest* f = loop->forest;
    size_t leaf = (size_t)begin * GRAIN;
    const size_t last = (size_t)end * GRAIN < f->leaf_count ? (size_t)end * GRAIN : f->leaf_count;
    for (uint32_t t = tree_of(f, leaf); leaf < last; t++) {
        const es_point_tree* tree = &f->trees[t];
        const size_t tree_end = tree->first_leaf + tree->leaf_count, to = tree_end < last ? tree_end : last;
        const es_leaf_range range = {leaf, tree->first + tree->leaf_count + (leaf - tree->first_leaf), (uint32_t)(to - leaf), t};
        loop->body(loop->user, &range, worker);
        leaf = to;
    }
}

void es_forest_each_leaf(es_context* context, const es_point_forest* forest, es_leaf_body body, void* user)
{
    if (!forest->leaf_count) return;
    leaf_loop loop = {forest, body, user};
    es_parallel_for(context, (uint32_t)((forest->leaf_count + GRAIN - 1) / GRAIN), 1, chunks, &loop);
}

typedef struct widening { const es_gi_kernels* kernels; es_point_lobe* leaves; } widening;

static void widen(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const widening* w = user;
    (void)worker;
    w->kernels->widen_lobes(w->leaves, begin, end);
}

typedef struct direct_loop { const es_gi_kernels* kernels; const es_point_light_job* job; const es_point_forest* forest; } direct_loop;

static void direct(void* user, const es_leaf_range* range, uint32_t worker)
{
    const direct_loop* loop = user;
    (void)worker;
    loop->kernels->light_points(loop->job, loop->forest, range);
}

es_result es_points_light_direct(es_context* context, es_point_forest* forest, const es_point_light_job* job)
{
    bool glossy = false;
    for (uint32_t i = 0; i < forest->tree_count && job->shapes && job->view_count; i++) glossy = glossy || forest->trees[i].glossy;
    if (!glossy) es_forest_drop_lobes(context, forest);
    es_result result = glossy ? es_forest_keep_lobes(context, forest) : ES_OK;
    if (result) return result;
    direct_loop loop = {es_gi_kernel_table(es_context_isa(context)), job, forest};
    es_forest_each_leaf(context, forest, direct, &loop);
    for (uint32_t i = 0; i < forest->tree_count && glossy; i++) {
        const es_point_tree* tree = &forest->trees[i];
        widening w = {loop.kernels, forest->lobes + tree->first + tree->leaf_count};
        if (tree->glossy && tree->leaf_count >= 4) es_parallel_for(context, tree->leaf_count / 4, GRAIN / 4, widen, &w);
    }
    return ES_OK;
}
