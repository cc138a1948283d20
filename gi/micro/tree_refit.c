/* Nodes of the trees, from the leaves up: blocks of leaves with what is above them, in parallel, then what is above the blocks.
 *
 * A block's nodes are made where they stay in the cache, and rounded from there. Of a tree of several blocks the frame of the rounding is known before its
 * root is: centres are within the box of the vertices, as each is between its children's, and radii are taken to be below ES_TREE_REACH times the box'
 * diagonal. A tree whose root is larger is done again. */
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/micro/forest_parts.h"
#include "platform/context.h"
#include "platform/maths.h"

#define ES_TREE_REACH 0.75f

static uint32_t block_size(const es_point_tree* tree) { return tree->leaf_count < ES_TREE_BLOCK ? tree->leaf_count : ES_TREE_BLOCK; }
static uint32_t blocks_of(const es_point_tree* tree) { return tree->leaf_count / block_size(tree); }

typedef struct refitting {
    es_point_forest* forest;
    const es_gi_kernels* kernels;
    bool rest, again;
} refitting;

static es_node_looks looks_of(const es_point_forest* forest, const es_point_tree* tree) { return (es_node_looks){forest->albedo + tree->first, forest->emission + tree->first, forest->area + tree->first}; }
static es_node_light light_of(const es_point_forest* forest, const es_point_tree* tree)
{
    const size_t at = tree->first;
    return (es_node_light){{forest->radiance[0] + at, forest->radiance[1] + at, forest->radiance[2] + at}, forest->area + at, forest->nodes + at};
}

/* ---- the frame of the quantised nodes ----------------------------------------------------------------------------------------- */

static es_node_frame frame_of(const float low[3], const float high[3], float radius)
{
    es_node_frame frame = {.low = {low[0], low[1], low[2]}};
    float square = 0.0f, farthest = 0.0f;
    for (int k = 0; k < 3; k++) {
        frame.step[k] = (high[k] - low[k]) * (1.0f / 65535.0f);
        square += frame.step[k] * frame.step[k];
        farthest += es_maxf(es_absf(low[k]), es_absf(high[k]));
    }
    frame.error = 0.501f * es_sqrt(square) + 2.5e-7f * farthest;
    frame.radius_step = (radius + frame.error) * (1.00001f / 65533.0f);
    return frame;
}

static float diagonal(const es_tree_state* state)
{
    float square = 0.0f;
    for (int k = 0; k < 3; k++) square += (state->high[k] - state->low[k]) * (state->high[k] - state->low[k]);
    return es_sqrt(square);
}

static void keep_frame(es_point_tree* tree, const es_node_frame* frame)
{
    memcpy(tree->low, frame->low, sizeof tree->low);
    memcpy(tree->step, frame->step, sizeof tree->step);
    tree->radius_step = frame->radius_step;
}

/* Of a block or of what is above, `count` nodes from `first` on, whole records or some of one, become the tree's from `node` on. */
static void store(const refitting* r, const es_point_tree* tree, const es_node_frame* frame, float* nodes, uint32_t first, uint32_t node, uint32_t count, bool leaves)
{
    es_point_forest* forest = r->forest;
    r->kernels->forest_quantise(frame, nodes, first, count, leaves, forest->nodes + tree->first + node);
    if (!forest->own->floats) return;
    for (uint32_t i = 0; i < count; i++) {
        es_point_node_float* out = &forest->float_nodes[tree->first + node + i];
        float* const to[ES_NODE_COSINE] = {&out->position[0], &out->position[1], &out->position[2], &out->radius, &out->axis[0], &out->axis[1], &out->axis[2], &out->sine, &out->slab};
        for (int k = 0; k < ES_NODE_COSINE; k++) *to[k] = *es_node_value(nodes, first + i, k);
    }
}

/* ---- blocks ---------------------------------------------------------------------------------------------------------------------------- */

/* Without nodes. */
static es_leaf_job leaves_of(const es_point_forest* forest, const es_point_tree* tree)
{
    const es_tree_state* state = &forest->own->states[tree - forest->trees];
    const es_leaf_shapes* shapes = &forest->own->shapes;
    const size_t leaf = tree->first_leaf;
    es_leaf_job job = {.corners = forest->own->corners + state->corner, .side = tree->back ? -1.0f : 1.0f, .barycentric = forest->barycentric + leaf,
        .shapes = {shapes->along + leaf, shapes->across + leaf, shapes->shear + leaf}, .area = forest->area + tree->first + tree->leaf_count};
    /* over the largest, as cofactors of a tiny scene would underflow */
    float largest = 0.0f, u[9];
    for (int i = 0; i < 9; i++) largest = es_maxf(largest, es_absf(state->u[i]));
    for (int i = 0; i < 9; i++) u[i] = largest > 0.0f ? state->u[i] / largest : 0.0f;
    const float cofactors[9] = {u[4] * u[8], -u[3] * u[8], u[3] * u[7] - u[4] * u[6], 0, u[0] * u[8], -u[0] * u[7], 0, 0, u[0] * u[4]};
    memcpy(job.cofactors, cofactors, sizeof cofactors);
    /* a power of two, so that nothing is rounded; a tree that is new, or of one leaf, has no extent yet, its mesh has */
    const es_vec3 mesh = es_v3_sub(state->mesh->bounds_max, state->mesh->bounds_min);
    const float extent = es_maxf(diagonal(state), largest * es_maxf(mesh.x, es_maxf(mesh.y, mesh.z)));
    job.magnify = extent > 0.0f ? es_exp2(-es_floor(es_log2(es_clampf(extent, 1e-30f, 1e30f)))) : 1.0f;
    memcpy(job.rotation, tree->rotation, sizeof job.rotation);
    memcpy(job.translation, tree->translation, sizeof job.translation);
    return job;
}

/* What a block's leaves read. */
static void read_vertices(const es_gi_kernels* kernels, const es_point_forest* forest, const es_tree_task* task, bool rest, uint32_t worker, es_leaf_job* job)
{
    const es_tree_state* state = &forest->own->states[task->tree];
    const es_raster_mesh* mesh = state->mesh;
    const uint32_t* vertices = forest->own->vertices + state->corner + 3 * (size_t)task->block * ES_TREE_BLOCK;
    float *places = forest->own->places + ES_TREE_PLACES * (size_t)worker, *normals = places + 4 * (size_t)task->vertex_count;
    kernels->forest_vertices(rest && mesh->rest_positions ? mesh->rest_positions : mesh->positions, state->u, vertices, task->vertex_count, places);
    if (mesh->normals) kernels->forest_normals(mesh->normals, vertices, task->vertex_count, normals);
    job->vertices = places;
    job->normals = mesh->normals ? normals : NULL;
}

/* `levels` from that of `level` nodes down to that of `last`, whose children are among `nodes`; part `part` of `parts` of the tree's. */
static float make_levels(const refitting* r, const es_point_tree* tree, const es_node_frame* frame, float* nodes, uint32_t part, uint32_t parts, uint32_t level, uint32_t last)
{
    float* area = r->forest->area + tree->first;
    float sum = 0.0f;
    for (; level >= last && level; level /= 2) {
        const uint32_t at = (parts + part) * level;
        float squares;
        r->kernels->forest_merge(nodes, level, 2 * at >= tree->leaf_count, area + 2 * (size_t)at, area + at, &squares);
        sum += squares;
        if (frame) store(r, tree, frame, nodes, level, at, level, false);
    }
    return sum;
}

/* A block is made in parts that stay in the first cache, each up to as many nodes as the kernels take at once. */
enum { PART = 256, PART_ROOTS = 8 };

static void make_block(const refitting* r, es_tree_task* task, const es_point_tree* tree, es_leaf_job* job, float* scratch)
{
    es_point_forest* forest = r->forest;
    const es_tree_state* state = &forest->own->states[task->tree];
    const uint32_t size = block_size(tree), blocks = blocks_of(tree), begin = task->block * size;
    /* of a tree of one block the frame is known when all else is */
    const uint32_t part = blocks > 1 ? PART : size, parts = size / part;
    es_node_frame frame;
    if (blocks > 1) frame = frame_of(state->low, state->high, r->again ? es_maxf(*es_node_value(forest->own->upper, state->upper + 1, ES_NODE_RADIUS), 0.0f) : ES_TREE_REACH * diagonal(state));
    const es_node_frame* known = blocks > 1 && !r->rest ? &frame : NULL;
    float* top = es_node_value(scratch, parts > 1 ? 2 * PART : 0, 0);
    job->nodes = scratch;
    job->first = part;
    if (known) job->packed = forest->nodes + tree->first;
    job->leaf_count = tree->leaf_count;
    task->sum = 0.0f;
    for (uint32_t i = 0; i < parts; i++) {
        const uint32_t leaf = begin + i * part, number = task->block * parts + i;
        r->kernels->forest_leaves(job, leaf, leaf + part);
        if (known) store(r, tree, known, scratch, part, tree->leaf_count + leaf, part, true);
        task->sum += make_levels(r, tree, known, scratch, number, blocks * parts, part / 2, parts > 1 ? PART_ROOTS : 1);
        if (parts > 1) memcpy(es_node_value(top, (parts + i) * PART_ROOTS, 0), es_node_value(scratch, PART_ROOTS, 0), ES_NODE_RECORD * sizeof(float));
    }
    if (parts > 1) task->sum += make_levels(r, tree, known, top, task->block, blocks, parts * PART_ROOTS / 2, 1);
    for (int k = 0; k < ES_NODE_VALUES; k++) *es_node_value(forest->own->upper, state->upper + blocks + task->block, k) = *es_node_value(top, 1, k);
    if (blocks > 1 || r->rest) return;
    frame = frame_of(state->low, state->high, es_maxf(*es_node_value(scratch, 1, ES_NODE_RADIUS), 0.0f));
    for (uint32_t level = size; level; level /= 2) store(r, tree, &frame, scratch, level, level, level, level == size);
}

static void refit_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    es_point_forest* forest = r->forest;
    float* scratch = forest->own->scratch + ES_TREE_SCRATCH * (size_t)worker;
    for (uint32_t i = first; i < last; i++) {
        es_tree_task* task = &forest->own->tasks[i];
        const es_point_tree* tree = &forest->trees[task->tree];
        const es_tree_state* state = &forest->own->states[task->tree];
        const uint32_t work = state->work, size = block_size(tree);
        if (!work || (r->again && !state->again)) continue;
        es_leaf_job job = leaves_of(forest, tree);
        if (work & (ES_TREE_NODES | ES_TREE_POSE)) read_vertices(r->kernels, forest, task, r->rest, worker, &job);
        if (!r->rest && work & ES_TREE_POSE) {
            job.x = forest->x + tree->first_leaf;
            job.y = forest->y + tree->first_leaf;
            job.z = forest->z + tree->first_leaf;
            job.normal = forest->normal + tree->first_leaf;
        }
        if (work & ES_TREE_NODES) make_block(r, task, tree, &job, scratch);
        else if (job.x) r->kernels->forest_leaves(&job, task->block * size, (task->block + 1) * size);
        if (r->rest || state->plain || !(work & ES_TREE_LOOKS)) continue;
        const es_node_looks looks = looks_of(forest, tree);
        for (uint32_t level = size / 2; level; level /= 2) {
            const uint32_t at = (blocks_of(tree) + task->block) * level;
            r->kernels->forest_blend(&looks, at, at + level);
        }
    }
}

/* ---- above the blocks ------------------------------------------------------------------------------------------------------------------- */

static void refit_upper(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        es_point_tree* tree = &forest->trees[i];
        es_tree_state* state = &forest->own->states[i];
        const uint32_t blocks = blocks_of(tree);
        if (!r->rest && !state->plain && state->work & ES_TREE_LOOKS) {
            const es_node_looks looks = looks_of(forest, tree);
            for (uint32_t level = blocks / 2; level; level /= 2) r->kernels->forest_blend(&looks, level, 2 * level);
        }
        if (!(state->work & ES_TREE_NODES) || (r->again && !state->again)) continue;
        float* upper = es_node_value(forest->own->upper, state->upper, 0);
        float* area = forest->area + tree->first;
        double total = 0.0;
        for (uint32_t level = blocks / 2; level; level /= 2) {
            float sum;
            r->kernels->forest_merge(upper, level, false, area + 2 * (size_t)level, area + level, &sum);
            total += (double)sum;
        }
        state->measure = total;
        if (r->rest) continue;
        const float radius = es_maxf(*es_node_value(upper, 1, ES_NODE_RADIUS), 0.0f), guess = ES_TREE_REACH * diagonal(state);
        state->again = blocks > 1 && radius > guess && !r->again;
        const es_node_frame frame = frame_of(state->low, state->high, blocks == 1 || r->again ? radius : guess);
        keep_frame(tree, &frame);
        for (uint32_t level = blocks / 2; level; level /= 2) store(r, tree, &frame, upper, level, level, level, false);
    }
}

typedef struct boxing { const es_gi_kernels* kernels; const float *positions, *u; float (*boxes)[6]; uint32_t count; } boxing;
enum { BOX_VERTICES = 16384, BOX_PARTS = 256 };

static void box_some(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const boxing* b = user;
    float* box = b->boxes[begin / BOX_VERTICES % BOX_PARTS];
    float low[3], high[3];
    b->kernels->forest_box(b->positions, b->u, begin, end, low, high);
    for (int k = 0; k < 3; k++) {
        box[k] = low[k];
        box[3 + k] = high[k];
    }
}

static void find_box(es_context* context, const refitting* r, es_tree_state* state)
{
    const es_raster_mesh* mesh = state->mesh;
    float boxes[BOX_PARTS][6];
    for (int k = 0; k < 3; k++) {
        state->low[k] = ES_POINT_FARTHEST;
        state->high[k] = -ES_POINT_FARTHEST;
    }
    for (uint32_t first = 0; first < mesh->vertex_count; first += BOX_PARTS * BOX_VERTICES) {
        const uint32_t left = mesh->vertex_count - first, count = left < BOX_PARTS * BOX_VERTICES ? left : BOX_PARTS * BOX_VERTICES;
        boxing b = {r->kernels, mesh->positions + 4 * (size_t)first, state->u, boxes, count};
        es_parallel_for(context, count, BOX_VERTICES, box_some, &b);
        for (uint32_t part = 0; part < (count + BOX_VERTICES - 1) / BOX_VERTICES; part++)
            for (int k = 0; k < 3; k++) {
                state->low[k] = es_minf(state->low[k], boxes[part][k]);
                state->high[k] = es_maxf(state->high[k], boxes[part][3 + k]);
            }
    }
}

void es_forest_refit(es_context* context, es_point_forest* forest, bool rest)
{
    struct es_forest_private* own = forest->own;
    refitting r = {forest, es_gi_kernel_table(es_context_isa(context)), rest, false};
    es_forest_link(context, forest);
    if (!rest)
        for (uint32_t i = 0; i < forest->tree_count; i++)
            if (own->states[i].work & ES_TREE_NODES) find_box(context, &r, &own->states[i]);
    es_parallel_for(context, (uint32_t)own->task_count, 1, refit_block, &r);
    es_parallel_for(context, forest->tree_count, 16, refit_upper, &r);
    for (uint32_t i = 0; i < forest->tree_count; i++) r.again = r.again || (!rest && own->states[i].work & ES_TREE_NODES && own->states[i].again);
    if (r.again) { /* discs reach far beyond their triangles */
        es_parallel_for(context, (uint32_t)own->task_count, 1, refit_block, &r);
        es_parallel_for(context, forest->tree_count, 16, refit_upper, &r);
    }
    for (size_t i = 0; i < own->task_count; i++)
        if (own->states[own->tasks[i].tree].work & ES_TREE_NODES) own->states[own->tasks[i].tree].measure += (double)own->tasks[i].sum;
    for (uint32_t i = 0; i < forest->tree_count; i++)
        if (own->states[i].work & ES_TREE_NODES) {
            const double area = (double)forest->area[forest->trees[i].first + 1];
            own->states[i].measure = area > 0.0 ? own->states[i].measure / area : 0.0;
        }
}

typedef struct standing { const es_gi_kernels* kernels; const es_point_forest* forest; const es_point_tree* tree; const es_tree_task* tasks; es_split_point* points; } standing;

static void stand_some(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const standing* s = user;
    float* scratch = s->forest->own->scratch + ES_TREE_SCRATCH * (size_t)worker;
    es_leaf_job job = leaves_of(s->forest, s->tree);
    job.nodes = scratch;
    /* `begin` is that of a block */
    read_vertices(s->kernels, s->forest, &s->tasks[begin / ES_TREE_BLOCK], false, worker, &job);
    s->kernels->forest_leaves(&job, begin, end);
    for (uint32_t i = begin; i < end; i++) {
        for (int k = 0; k < 3; k++) s->points[i].position[k] = *es_node_value(scratch, i - begin, k);
        s->points[i].index = i;
    }
}

void es_forest_stand(es_context* context, const es_point_forest* forest, uint32_t tree, es_split_point* points)
{
    const es_tree_task* tasks = forest->own->tasks;
    while (tasks->tree != tree) tasks++;
    standing s = {es_gi_kernel_table(es_context_isa(context)), forest, &forest->trees[tree], tasks, points};
    es_parallel_for(context, s.tree->leaf_count, ES_TREE_BLOCK, stand_some, &s);
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

/* A tree's root in the world. */
static void root_of(const es_point_forest* forest, uint32_t index, float out[ES_NODE_VALUES])
{
    const es_point_tree* tree = &forest->trees[index];
    const float* m = tree->rotation;
    float root[ES_NODE_VALUES], reach = 0.0f;
    for (int k = 0; k < ES_NODE_VALUES; k++) root[k] = *es_node_value(forest->own->upper, forest->own->states[index].upper + 1, k);
    for (int k = 0; k < 3; k++) {
        out[ES_NODE_X + k] = m[k] * root[ES_NODE_X] + m[3 + k] * root[ES_NODE_Y] + m[6 + k] * root[ES_NODE_Z] + tree->translation[k];
        out[ES_NODE_AXIS_X + k] = m[k] * root[ES_NODE_AXIS_X] + m[3 + k] * root[ES_NODE_AXIS_Y] + m[6 + k] * root[ES_NODE_AXIS_Z];
        reach += es_absf(root[ES_NODE_X + k]) + es_absf(out[ES_NODE_X + k]);
    }
    /* what the rounding of the pose may have moved it */
    out[ES_NODE_RADIUS] = root[ES_NODE_RADIUS] < 0.0f ? -1.0f : root[ES_NODE_RADIUS] * (1.0f + 1e-6f) + reach * 5e-7f;
    out[ES_NODE_SINE] = root[ES_NODE_SINE] > 1.0f ? 2.0f : es_minf(root[ES_NODE_SINE] + 2e-6f, 1.0f);
    out[ES_NODE_COSINE] = es_sqrt(es_maxf(1.0f - out[ES_NODE_SINE] * out[ES_NODE_SINE], 0.0f));
    out[ES_NODE_SLAB] = es_minf(root[ES_NODE_SLAB] + reach * 5e-7f, es_maxf(out[ES_NODE_RADIUS], 0.0f));
}

static void top_leaf(const es_point_forest* forest, float* nodes, uint32_t slot)
{
    const es_point_tree* top = &forest->top;
    const uint32_t node = top->leaf_count + slot, index = forest->top_trees[slot];
    float values[ES_NODE_VALUES] = {[ES_NODE_RADIUS] = -1.0f, [ES_NODE_AXIS_Y] = 1.0f, [ES_NODE_COSINE] = 1.0f};
    const size_t root = index == UINT32_MAX ? 0 : forest->trees[index].first + 1;
    if (index != UINT32_MAX) root_of(forest, index, values);
    for (int k = 0; k < ES_NODE_VALUES; k++) *es_node_value(nodes, node, k) = values[k];
    forest->area[top->first + node] = root ? forest->area[root] : 0.0f;
    forest->albedo[top->first + node] = root ? forest->albedo[root] : 0;
    forest->emission[top->first + node] = root ? forest->emission[root] : 0;
}

void es_forest_refit_top(es_context* context, es_point_forest* forest, es_split_point* order)
{
    refitting r = {.forest = forest, .kernels = es_gi_kernel_table(es_context_isa(context))};
    es_point_tree* top = &forest->top;
    forest->radius = 0.0f;
    if (!top->leaf_count) return;
    float* nodes = es_node_value(forest->own->upper, forest->own->top_upper, 0);
    float low[3], high[3];
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        float root[ES_NODE_VALUES];
        root_of(forest, i, root);
        order[i].index = i;
        for (int k = 0; k < 3; k++) {
            order[i].position[k] = root[k];
            low[k] = i ? es_minf(low[k], root[k]) : root[k];
            high[k] = i ? es_maxf(high[k], root[k]) : root[k];
        }
    }
    es_tree_split_any(order, forest->tree_count);
    fill_slots(order, forest->tree_count, forest->top_trees, top->leaf_count);
    for (uint32_t i = 0; i < top->leaf_count; i++) top_leaf(forest, nodes, i);
    const es_node_looks looks = looks_of(forest, top);
    float* area = forest->area + top->first;
    for (uint32_t level = top->leaf_count / 2; level; level /= 2) {
        float sum;
        r.kernels->forest_merge(nodes, level, false, area + 2 * (size_t)level, area + level, &sum);
        r.kernels->forest_blend(&looks, level, 2 * level);
    }
    forest->radius = es_maxf(*es_node_value(nodes, 1, ES_NODE_RADIUS), 0.0f);
    const es_node_frame frame = frame_of(low, high, forest->radius);
    keep_frame(top, &frame);
    for (uint32_t level = 1; level <= top->leaf_count; level *= 2) store(&r, top, &frame, nodes, level, level, level, false);
}

/* ---- light ------------------------------------------------------------------------------------------------------------------------ */

static void pull_block(void* user, uint32_t first, uint32_t last, uint32_t worker)
{
    const refitting* r = user;
    const es_point_forest* forest = r->forest;
    for (uint32_t i = first; i < last; i++) {
        const es_tree_task* task = &forest->own->tasks[i];
        const es_point_tree* tree = &forest->trees[task->tree];
        const es_node_light light = light_of(forest, tree);
        const uint32_t size = block_size(tree);
        for (uint32_t level = size; level; level /= 2) {
            const uint32_t at = (blocks_of(tree) + task->block) * level;
            if (level < size) r->kernels->forest_pull(&light, at, at + level);
            r->kernels->forest_pack(&light, at, at + level);
        }
    }
}

static void pull_upper(const es_gi_kernels* kernels, const es_node_light* light, uint32_t level)
{
    for (; level; level /= 2) {
        kernels->forest_pull(light, level, 2 * level);
        kernels->forest_pack(light, level, 2 * level);
    }
}

void es_forest_pull(es_context* context, es_point_forest* forest)
{
    if (!forest->tree_count) return;
    refitting r = {.forest = forest, .kernels = es_gi_kernel_table(es_context_isa(context))};
    es_parallel_for(context, (uint32_t)forest->own->task_count, 1, pull_block, &r);
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        const es_node_light light = light_of(forest, &forest->trees[i]);
        pull_upper(r.kernels, &light, blocks_of(&forest->trees[i]) / 2);
    }
    const es_node_light top = light_of(forest, &forest->top);
    const uint32_t leaves = forest->top.leaf_count;
    for (uint32_t i = 0; i < leaves; i++)
        for (int c = 0; c < 3; c++) {
            const uint32_t tree = forest->top_trees[i];
            top.radiance[c][leaves + i] = tree == UINT32_MAX ? 0.0f : forest->radiance[c][forest->trees[tree].first + 1];
        }
    r.kernels->forest_pack(&top, leaves, 2 * leaves);
    pull_upper(r.kernels, &top, leaves / 2);
    if (forest->lobes) es_forest_pull_lobes(context, forest);
}
