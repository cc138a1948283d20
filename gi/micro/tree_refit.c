/* Nodes of the trees, from the leaves up: blocks of leaves with what is above them, in parallel, then what is above the blocks. */
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/micro/forest_parts.h"
#include "platform/context.h"
#include "platform/maths.h"

es_tree_nodes es_forest_nodes(const es_point_forest* forest, const es_point_tree* tree)
{
    const size_t at = tree->first;
    return (es_tree_nodes){forest->float_nodes + at, forest->nodes + at, {forest->radiance[0] + at, forest->radiance[1] + at, forest->radiance[2] + at}, forest->area + at,
        forest->albedo + at, forest->emission + at, tree->leaf_count};
}

static uint32_t block_size(const es_point_tree* tree) { return tree->leaf_count < ES_TREE_BLOCK ? tree->leaf_count : ES_TREE_BLOCK; }

typedef struct refitting {
    es_point_forest* forest;
    const es_draw_list* list;
    const es_gi_kernels* kernels;
    bool rest;
} refitting;

static void place_leaves(const refitting* r, const es_point_tree* tree, const es_tree_nodes* nodes, uint32_t begin, uint32_t end)
{
    const es_point_forest* forest = r->forest;
    const es_tree_state* state = &forest->own->states[tree - forest->trees];
    const es_leaf_shapes* shapes = &forest->own->shapes;
    es_leaf_job job = {.mesh = state->mesh, .positions = r->rest && state->mesh->rest_positions ? state->mesh->rest_positions : state->mesh->positions,
        .side = tree->back ? -1.0f : 1.0f, .triangle = forest->triangle + tree->first_leaf, .barycentric = forest->barycentric + tree->first_leaf,
        .shapes = {shapes->along + tree->first_leaf, shapes->across + tree->first_leaf, shapes->shear + tree->first_leaf}, .nodes = *nodes};
    memcpy(job.u, state->u, sizeof job.u);
    /* over the largest, as cofactors of a tiny scene would underflow */
    float largest = 0.0f, u[9];
    for (int i = 0; i < 9; i++) largest = es_maxf(largest, es_absf(job.u[i]));
    for (int i = 0; i < 9; i++) u[i] = largest > 0.0f ? job.u[i] / largest : 0.0f;
    const float cofactors[9] = {u[4] * u[8], -u[3] * u[8], u[3] * u[7] - u[4] * u[6], 0, u[0] * u[8], -u[0] * u[7], 0, 0, u[0] * u[4]};
    memcpy(job.cofactors, cofactors, sizeof cofactors);
    r->kernels->forest_leaves(&job, begin, end);
}

/* Of each level the nodes above leaves [block size · block, …), from the leaves' parents up to the block's own root. */
#define FOR_LEVELS_OF_BLOCK(tree, block, begin, end)                                                                                                                        \
    for (uint32_t size_ = block_size(tree) / 2, level_ = (tree)->leaf_count / 2, begin = level_ + (block) * size_, end = begin + size_; size_; \
         size_ /= 2, level_ /= 2, begin = level_ + (block) * size_, end = begin + size_)

static void refit_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        es_tree_task* task = &forest->own->tasks[i];
        const es_point_tree* tree = &forest->trees[task->tree];
        const uint32_t work = forest->own->states[task->tree].work;
        if (!work) continue;
        const es_tree_nodes nodes = es_forest_nodes(forest, tree);
        const uint32_t begin = task->block * block_size(tree), end = begin + block_size(tree);
        if (work & ES_TREE_NODES) {
            place_leaves(r, tree, &nodes, begin, end);
            task->sum = 0.0f;
            FOR_LEVELS_OF_BLOCK(tree, task->block, from, to)
            {
                float sum;
                r->kernels->forest_merge(&nodes, from, to, &sum);
                task->sum += sum;
            }
        }
        if (r->rest) continue;
        if (work & ES_TREE_POSE) {
            es_pose_job job = {.nodes = nodes, .x = forest->x + tree->first_leaf, .y = forest->y + tree->first_leaf, .z = forest->z + tree->first_leaf,
                .normal = forest->normal + tree->first_leaf};
            memcpy(job.rotation, tree->rotation, sizeof job.rotation);
            memcpy(job.translation, tree->translation, sizeof job.translation);
            r->kernels->forest_pose(&job, begin, end);
        }
        if (work & ES_TREE_LOOKS) FOR_LEVELS_OF_BLOCK(tree, task->block, from, to) r->kernels->forest_blend(&nodes, from, to);
    }
}

/* The frame of the quantised nodes: the root's box. */
static void set_frame(es_point_tree* tree, const es_point_node_float* root)
{
    const float radius = es_maxf(root->radius, 0.0f);
    for (int k = 0; k < 3; k++) {
        tree->low[k] = root->position[k] - radius;
        tree->step[k] = radius * (2.0f / 65535.0f);
    }
    /* the largest radius and what the centre's rounding adds to it, twice over */
    tree->radius_step = radius * ((1.0f + 4.0f / 65535.0f) / 65533.0f);
}

static void refit_upper(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        es_point_tree* tree = &forest->trees[i];
        es_tree_state* state = &forest->own->states[i];
        const es_tree_nodes nodes = es_forest_nodes(forest, tree);
        const uint32_t blocks = tree->leaf_count / block_size(tree);
        if (state->work & ES_TREE_NODES) {
            double total = 0.0;
            for (uint32_t level = blocks / 2; level; level /= 2) {
                float sum;
                r->kernels->forest_merge(&nodes, level, 2 * level, &sum);
                total += (double)sum;
            }
            state->measure = total;
            if (!r->rest) set_frame(tree, &nodes.floats[1]);
        }
        if (!r->rest && state->work & ES_TREE_LOOKS)
            for (uint32_t level = blocks / 2; level; level /= 2) r->kernels->forest_blend(&nodes, level, 2 * level);
    }
}

static es_quantise_job quantising(const es_point_tree* tree, const es_tree_nodes* nodes)
{
    es_quantise_job job = {.radius_step = tree->radius_step, .nodes = *nodes};
    memcpy(job.low, tree->low, sizeof job.low);
    memcpy(job.step, tree->step, sizeof job.step);
    return job;
}

static void quantise_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    const es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        const es_tree_task* task = &forest->own->tasks[i];
        const es_point_tree* tree = &forest->trees[task->tree];
        if (!(forest->own->states[task->tree].work & ES_TREE_NODES)) continue;
        const es_tree_nodes nodes = es_forest_nodes(forest, tree);
        const es_quantise_job job = quantising(tree, &nodes);
        const uint32_t size = block_size(tree), begin = tree->leaf_count + task->block * size;
        r->kernels->forest_quantise(&job, begin, begin + size);
        FOR_LEVELS_OF_BLOCK(tree, task->block, from, to) r->kernels->forest_quantise(&job, from, to);
        if (task->block == 0 && tree->leaf_count > size) r->kernels->forest_quantise(&job, 1, tree->leaf_count / size);
    }
}

void es_forest_refit(es_context* context, es_point_forest* forest, const es_draw_list* list, bool rest)
{
    struct es_forest_private* own = forest->own;
    refitting r = {forest, list, es_gi_kernel_table(es_context_isa(context)), rest};
    es_parallel_for(context, (uint32_t)own->task_count, 1, refit_block, &r);
    es_parallel_for(context, forest->tree_count, 16, refit_upper, &r);
    for (size_t i = 0; i < own->task_count; i++)
        if (own->states[own->tasks[i].tree].work & ES_TREE_NODES) own->states[own->tasks[i].tree].measure += (double)own->tasks[i].sum;
    for (uint32_t i = 0; i < forest->tree_count; i++)
        if (own->states[i].work & ES_TREE_NODES) {
            const double area = (double)forest->area[forest->trees[i].first + 1];
            own->states[i].measure = area > 0.0 ? own->states[i].measure / area : 0.0;
        }
    if (!rest) es_parallel_for(context, (uint32_t)own->task_count, 1, quantise_block, &r);
}

/* ---- the tree of trees ----------------------------------------------------------------------------------------------------- */

/* Spreads the trees of a part over slots [first, first + size), halves getting halves. */
static void fill_slots(es_split_point* trees, uint32_t count, uint32_t* slots, uint32_t size)
{
    if (size == 1) {
        slots[0] = count ? trees[0].index : UINT32_MAX;
        return;
    }
    fill_slots(trees, count - count / 2, slots, size / 2);
    fill_slots(trees + (count - count / 2), count / 2, slots + size / 2, size / 2);
}

static void top_leaf(const es_point_forest* forest, uint32_t slot)
{
    const es_tree_nodes top = es_forest_nodes(forest, &forest->top);
    const uint32_t node = forest->top.leaf_count + slot, index = forest->top_trees[slot];
    es_point_node_float* out = &top.floats[node];
    *out = (es_point_node_float){.radius = -1.0f, .axis = {0, 1, 0}};
    top.area[node] = 0.0f;
    top.albedo[node] = top.emission[node] = 0;
    if (index == UINT32_MAX) return;
    const es_point_tree* tree = &forest->trees[index];
    const es_tree_nodes nodes = es_forest_nodes(forest, tree);
    const es_point_node_float* root = &nodes.floats[1];
    const float* m = tree->rotation;
    float reach = 0.0f;
    for (int k = 0; k < 3; k++) {
        out->position[k] = m[k] * root->position[0] + m[3 + k] * root->position[1] + m[6 + k] * root->position[2] + tree->translation[k];
        out->axis[k] = m[k] * root->axis[0] + m[3 + k] * root->axis[1] + m[6 + k] * root->axis[2];
        reach += es_absf(root->position[k]) + es_absf(out->position[k]);
    }
    /* what the rounding of the pose may have moved it */
    out->radius = root->radius < 0.0f ? root->radius : root->radius * (1.0f + 1e-6f) + reach * 5e-7f;
    out->sine = root->sine > 1.0f ? 2.0f : es_minf(root->sine + 2e-6f, 1.0f);
    out->slab = es_minf(root->slab + reach * 5e-7f, es_maxf(out->radius, 0.0f));
    top.area[node] = nodes.area[1];
    top.albedo[node] = nodes.albedo[1];
    top.emission[node] = nodes.emission[1];
}

void es_forest_refit_top(es_context* context, es_point_forest* forest, es_split_point* order)
{
    const es_gi_kernels* kernels = es_gi_kernel_table(es_context_isa(context));
    es_point_tree* top = &forest->top;
    if (!top->leaf_count) return;
    const es_tree_nodes nodes = es_forest_nodes(forest, top);
    /* leaves in the trees' order first, for their places */
    for (uint32_t i = 0; i < top->leaf_count; i++) forest->top_trees[i] = i < forest->tree_count ? i : UINT32_MAX;
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        top_leaf(forest, i);
        memcpy(order[i].position, nodes.floats[top->leaf_count + i].position, sizeof order[i].position);
        order[i].index = i;
    }
    es_tree_split_any(order, forest->tree_count);
    fill_slots(order, forest->tree_count, forest->top_trees, top->leaf_count);
    for (uint32_t i = 0; i < top->leaf_count; i++) top_leaf(forest, i);
    for (uint32_t level = top->leaf_count / 2; level; level /= 2) {
        float sum;
        kernels->forest_merge(&nodes, level, 2 * level, &sum);
        kernels->forest_blend(&nodes, level, 2 * level);
    }
    set_frame(top, &nodes.floats[1]);
    const es_quantise_job job = quantising(top, &nodes);
    kernels->forest_quantise(&job, 1, 2 * top->leaf_count);
}

/* ---- light ------------------------------------------------------------------------------------------------------------------------ */

static void pull_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    const es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        const es_tree_task* task = &forest->own->tasks[i];
        const es_point_tree* tree = &forest->trees[task->tree];
        const es_tree_nodes nodes = es_forest_nodes(forest, tree);
        const uint32_t size = block_size(tree), begin = tree->leaf_count + task->block * size;
        r->kernels->forest_pack(&nodes, begin, begin + size);
        FOR_LEVELS_OF_BLOCK(tree, task->block, from, to)
        {
            r->kernels->forest_pull(&nodes, from, to);
            r->kernels->forest_pack(&nodes, from, to);
        }
    }
}

static void pull_upper(const es_gi_kernels* kernels, const es_tree_nodes* nodes, uint32_t level)
{
    for (; level; level /= 2) {
        kernels->forest_pull(nodes, level, 2 * level);
        kernels->forest_pack(nodes, level, 2 * level);
    }
}

void es_forest_pull(es_context* context, es_point_forest* forest)
{
    if (!forest->tree_count) return;
    refitting r = {.forest = forest, .kernels = es_gi_kernel_table(es_context_isa(context))};
    es_parallel_for(context, (uint32_t)forest->own->task_count, 1, pull_block, &r);
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        const es_tree_nodes nodes = es_forest_nodes(forest, &forest->trees[i]);
        pull_upper(r.kernels, &nodes, nodes.leaf_count / block_size(&forest->trees[i]) / 2);
    }
    const es_tree_nodes top = es_forest_nodes(forest, &forest->top);
    for (uint32_t i = 0; i < top.leaf_count; i++)
        for (int c = 0; c < 3; c++) {
            const uint32_t tree = forest->top_trees[i];
            top.radiance[c][top.leaf_count + i] = tree == UINT32_MAX ? 0.0f : forest->radiance[c][forest->trees[tree].first + 1];
        }
    r.kernels->forest_pack(&top, top.leaf_count, 2 * top.leaf_count);
    pull_upper(r.kernels, &top, top.leaf_count / 2);
}
