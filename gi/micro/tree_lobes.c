/* Lobes of a forest's nodes (gi/micro/forest.h): where they are kept, and from the leaves up. */
#include "gi/kernel_table.h"
#include "gi/micro/forest_parts.h"
#include "platform/context.h"

es_result es_forest_keep_lobes(es_context* context, es_point_forest* forest)
{
    if (forest->lobes) return ES_OK;
    forest->lobes = es_allocate_zero(context, forest->node_count * sizeof *forest->lobes);
    return forest->lobes ? ES_OK : es_context_last_result(context);
}

void es_forest_drop_lobes(es_context* context, es_point_forest* forest)
{
    if (forest->lobes) es_release(context, forest->lobes, forest->node_count * sizeof *forest->lobes);
    forest->lobes = NULL;
}

static es_node_lobes lobes_of(const es_point_forest* forest, const es_point_tree* tree) { return (es_node_lobes){forest->lobes + tree->first, forest->area + tree->first}; }
static uint32_t blocks_of(const es_point_tree* tree) { return tree->leaf_count < ES_TREE_BLOCK ? 1 : tree->leaf_count / ES_TREE_BLOCK; }

typedef struct pulling { const es_point_forest* forest; const es_gi_kernels* kernels; } pulling;

static void pull_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const pulling* p = user;
    (void)worker;
    for (uint32_t i = first; i < last; i++) {
        const es_tree_task* task = &p->forest->own->tasks[i];
        const es_point_tree* tree = &p->forest->trees[task->tree];
        if (!tree->glossy) continue;
        const es_node_lobes lobes = lobes_of(p->forest, tree);
        for (uint32_t level = tree->leaf_count / blocks_of(tree) / 2; level; level /= 2) {
            const uint32_t at = (blocks_of(tree) + task->block) * level;
            p->kernels->forest_pull_lobes(&lobes, at, at + level);
        }
    }
}

static void pull_upper(const es_gi_kernels* kernels, const es_node_lobes* lobes, uint32_t level)
{
    for (; level; level /= 2) kernels->forest_pull_lobes(lobes, level, 2 * level);
}

void es_forest_pull_lobes(es_context* context, es_point_forest* forest)
{
    pulling p = {forest, es_gi_kernel_table(es_context_isa(context))};
    es_parallel_for(context, (uint32_t)forest->own->task_count, 1, pull_block, &p);
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        if (!forest->trees[i].glossy) continue;
        const es_node_lobes lobes = lobes_of(forest, &forest->trees[i]);
        pull_upper(p.kernels, &lobes, blocks_of(&forest->trees[i]) / 2);
    }
    const es_node_lobes top = lobes_of(forest, &forest->top);
    const uint32_t leaves = forest->top.leaf_count;
    for (uint32_t i = 0; i < leaves; i++) {
        const uint32_t tree = forest->top_trees[i];
        top.lobes[leaves + i] = tree == UINT32_MAX ? (es_point_lobe){0} : forest->lobes[forest->trees[tree].first + 1];
    }
    pull_upper(p.kernels, &top, leaves / 2);
}
