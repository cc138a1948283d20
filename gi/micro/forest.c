/* Brings the hierarchy of points up to the scene.
 *
 * Points stand where the mesh's pose at rest and the transform's shape put them; a tree is first split in that pose, so what is drawn does not depend on
 * when it was first drawn. A tree that deforms is measured by the sum of the squared radii of its inner nodes over the area of its leaves, which is what
 * traversals pay for, and split anew, as it stands, when that has grown to `rebuild` times what it was after the last split. */
#include "gi/micro/forest.h"

#include <string.h>

#include "gi/micro/forest_parts.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"

/* An instance, as it was when its trees were last brought up to it. */
typedef struct es_forest_source {
    const es_raster_mesh* mesh;
    uint32_t id, triangle_count, vertex_count;
    uint64_t revision, rest_revision, rest; /* rest: hash of the pose at rest and its triangles */
    es_mat4 transform;
    es_point_pose pose;
    double area;                   /* m² / scale²: at rest, in the space of the pose's shape */
} es_forest_source;

/* ---- instances --------------------------------------------------------------------------------------------------------------- */

enum { HASH_PARTS = 16 };
typedef struct hashing { const char* bytes; size_t size; uint64_t parts[HASH_PARTS]; } hashing;

static void hash_parts(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    hashing* h = user;
    for (uint32_t i = begin; i < end; i++) {
        const size_t from = h->size * i / HASH_PARTS, to = h->size * (i + 1) / HASH_PARTS;
        h->parts[i] = es_hash_bytes(i, h->bytes + from, to - from);
    }
}

static uint64_t hash_large(es_context* context, const void* bytes, size_t size)
{
    hashing h = {.bytes = bytes, .size = size};
    es_parallel_for(context, HASH_PARTS, size < 65536 ? HASH_PARTS : 1, hash_parts, &h);
    return es_hash_bytes(size, h.parts, sizeof h.parts);
}

static es_result measure_area(es_context* context, es_forest_source* source)
{
    const es_raster_mesh* mesh = source->mesh;
    double* areas = es_allocate_array(context, (size_t)mesh->triangle_count + 1, sizeof *areas);
    if (!areas) return es_context_last_result(context);
    source->area = es_point_areas(context, mesh, source->pose.shape, areas);
    es_release(context, areas, ((size_t)mesh->triangle_count + 1) * sizeof *areas);
    return ES_OK;
}

/* `before`: as it was, or NULL. */
static es_result examine(es_context* context, es_forest_source* source, const es_forest_source* before, const es_raster_instance* instance)
{
    const es_raster_mesh* mesh = instance->mesh;
    *source = (es_forest_source){.mesh = mesh, .id = instance->id, .triangle_count = mesh->triangle_count, .vertex_count = mesh->vertex_count,
        .revision = mesh->revision, .rest_revision = mesh->rest_revision, .transform = instance->transform};
    if (before && memcmp(&before->transform, &source->transform, sizeof source->transform) == 0) source->pose = before->pose;
    else source->pose = es_point_pose_of(&instance->transform);
    const bool same = before && before->mesh == mesh && before->triangle_count == mesh->triangle_count && before->vertex_count == mesh->vertex_count;
    if (same && (before->revision == mesh->revision || (mesh->rest_revision && before->rest_revision == mesh->rest_revision))) source->rest = before->rest;
    else {
        const float* positions = mesh->rest_positions ? mesh->rest_positions : mesh->positions;
        const uint64_t parts[2] = {hash_large(context, positions, 16 * (size_t)mesh->vertex_count), hash_large(context, mesh->indices, 12 * (size_t)mesh->triangle_count)};
        source->rest = es_hash_bytes(mesh->triangle_count, parts, sizeof parts);
    }
    if (same && before->rest == source->rest && memcmp(before->pose.shape, source->pose.shape, sizeof source->pose.shape) == 0) {
        source->area = before->area;
        return ES_OK;
    }
    return source->pose.scale > 0.0f && mesh->triangle_count ? measure_area(context, source) : ES_OK;
}

/* The instance as it was: mostly the one after the last that was found. */
static const es_forest_source* find_before(const struct es_forest_private* own, uint32_t id, uint32_t* next)
{
    if (*next < own->source_count && own->sources[*next].id == id) return &own->sources[(*next)++];
    for (uint32_t i = 0; i < own->source_count; i++)
        if (own->sources[i].id == id) {
            *next = i + 1;
            return &own->sources[i];
        }
    return NULL;
}

/* ---- shares ---------------------------------------------------------------------------------------------------------------------- */

typedef struct share { double mass, log_mass; uint32_t leaves; } share; /* leaves: logarithm; UINT32_MAX: none */

static double mass_of(const es_forest_source* source, const es_raster_instance* instance)
{
    const double weight = instance->point_weight == 0.0f ? 1.0 : (double)instance->point_weight, scale = (double)source->pose.scale;
    const double mass = weight * source->area * scale * scale;
    return mass > 1e-30 && mass < 1e36 ? mass : 0.0;
}

/* The nearest power of two in the logarithm, at least 1. */
static uint32_t leaves_at(double log_mass, double density)
{
    const double x = log_mass + density + 0.5;
    return x < 0.0 ? 0 : x > 31.0 ? 31 : (uint32_t)x;
}

static uint64_t total_at(const share* shares, uint32_t count, double density)
{
    uint64_t total = 0;
    for (uint32_t i = 0; i < count; i++)
        if (shares[i].mass > 0.0) total += (uint64_t)1 << leaves_at(shares[i].log_mass, density);
    return total;
}

/* All trees have the largest density at which their points are no more than asked for. Where even one each is too much, the smallest have none. */
static void share_out(share* shares, uint32_t count, uint32_t points)
{
    for (uint32_t i = 0; i < count; i++) shares[i].log_mass = shares[i].mass > 0.0 ? (double)es_log2((float)shares[i].mass) : 0.0;
    double low = -256.0, high = 256.0;
    for (int step = 0; step < 48; step++) {
        const double middle = 0.5 * (low + high);
        if (total_at(shares, count, middle) <= points) low = middle;
        else high = middle;
    }
    uint64_t total = 0;
    for (uint32_t i = 0; i < count; i++) {
        shares[i].leaves = shares[i].mass > 0.0 ? leaves_at(shares[i].log_mass, low) : UINT32_MAX;
        total += shares[i].mass > 0.0;
    }
    for (; total > points; total--) {
        uint32_t least = UINT32_MAX;
        for (uint32_t i = 0; i < count; i++)
            if (shares[i].leaves != UINT32_MAX && (least == UINT32_MAX || shares[i].mass <= shares[least].mass)) least = i;
        shares[least].leaves = UINT32_MAX;
    }
}

/* ---- memory --------------------------------------------------------------------------------------------------------------------- */

static size_t padded(size_t count) { return (count + 7) / 8 * 8; }

enum { ARRAYS = 28 };
typedef struct array { void** pointer; size_t count, size; } array;

static void list_arrays(es_point_forest* f, array out[ARRAYS])
{
    struct es_forest_private* own = f->own;
    const size_t nodes = f->node_count, leaves = padded(f->leaf_count);
    const array all[ARRAYS] = {
        {(void**)&f->trees, f->tree_count, sizeof *f->trees}, {(void**)&own->states, f->tree_count, sizeof *own->states},
        {(void**)&own->tasks, own->task_count, sizeof *own->tasks}, {(void**)&f->top_trees, f->top.leaf_count, sizeof *f->top_trees},
        {(void**)&f->nodes, nodes, sizeof *f->nodes}, {(void**)&f->float_nodes, own->floats ? nodes : 0, sizeof *f->float_nodes}, {(void**)&f->radiance[0], nodes, sizeof(float)},
        {(void**)&f->radiance[1], nodes, sizeof(float)}, {(void**)&f->radiance[2], nodes, sizeof(float)}, {(void**)&f->area, nodes, sizeof(float)},
        {(void**)&f->lobes, f->lobes ? nodes : 0, sizeof *f->lobes}, {(void**)&f->albedo, nodes, sizeof(uint32_t)}, {(void**)&f->emission, nodes, sizeof(uint32_t)}, {(void**)&f->x, leaves, sizeof(float)},
        {(void**)&f->y, leaves, sizeof(float)}, {(void**)&f->z, leaves, sizeof(float)}, {(void**)&f->normal, leaves, sizeof(uint32_t)},
        {(void**)&f->albedo_rg, leaves, sizeof(uint32_t)}, {(void**)&f->albedo_b, leaves, sizeof(uint32_t)}, {(void**)&f->surface, leaves, sizeof(uint32_t)},
        {(void**)&f->triangle, leaves, sizeof(uint32_t)}, {(void**)&f->barycentric, leaves, sizeof(uint32_t)}, {(void**)&own->shapes.along, 3 * leaves, sizeof(float)},
        {(void**)&own->corners, own->corner_count, sizeof(uint16_t)}, {(void**)&own->vertices, own->corner_count, sizeof(uint32_t)}, {(void**)&own->places, own->place_count, sizeof(float)},
        {(void**)&own->upper, own->upper_count / 8 * ES_NODE_RECORD, sizeof(float)}, {(void**)&own->scratch, own->scratch_count, sizeof(float)}};
    memcpy(out, all, sizeof all);
}

/* The counts of nothing. */
static void forget_counts(es_point_forest* forest)
{
    struct es_forest_private* own = forest->own;
    own->shapes = (es_leaf_shapes){0};
    own->task_count = own->corner_count = own->place_count = own->upper_count = own->scratch_count = 0;
    forest->tree_count = 0;
    forest->node_count = forest->leaf_count = 0;
    forest->top = (es_point_tree){0};
    forest->radius = 0.0f;
}

static void free_arrays(es_context* context, es_point_forest* forest)
{
    array arrays[ARRAYS];
    list_arrays(forest, arrays);
    for (int k = 0; k < ARRAYS; k++) {
        es_release(context, *arrays[k].pointer, arrays[k].count * arrays[k].size);
        *arrays[k].pointer = NULL;
    }
    forget_counts(forest);
}

/* Of the counts that are set. */
static es_result allocate_arrays(es_context* context, es_point_forest* forest)
{
    array arrays[ARRAYS];
    list_arrays(forest, arrays);
    size_t bytes = 0;
    for (int k = 0; k < ARRAYS; k++) bytes += arrays[k].count * arrays[k].size;
    const size_t cap = es_context_resolved_desc(context).memory_cap, used = es_context_bytes(context);
    if (cap && (used > cap || bytes > cap - used)) {
        const size_t left = used < cap ? cap - used : 0;
        es_result result = es_fail(context, ES_MEMORY_CAP, "a hierarchy of %zu points needs %zu MiB, and the memory cap leaves %zu; about %zu points would fit", forest->leaf_count,
            (bytes >> 20) + 1, left >> 20, (size_t)((double)forest->leaf_count * ((double)left / (double)bytes)));
        forget_counts(forest);
        return result;
    }
    for (int k = 0; k < ARRAYS; k++) {
        if (!arrays[k].count) continue;
        *arrays[k].pointer = es_allocate_zero(context, arrays[k].count * arrays[k].size);
        if (!*arrays[k].pointer) {
            free_arrays(context, forest);
            return es_context_last_result(context);
        }
    }
    const size_t leaves = padded(forest->leaf_count);
    forest->own->shapes.across = forest->own->shapes.along + leaves;
    forest->own->shapes.shear = forest->own->shapes.along + 2 * leaves;
    return ES_OK;
}

void es_forest_free(es_context* context, es_point_forest* forest)
{
    if (forest->own) {
        free_arrays(context, forest);
        es_release(context, forest->own->sources, forest->own->source_count * sizeof *forest->own->sources);
        es_release(context, forest->own, sizeof *forest->own);
    }
    *forest = (es_point_forest){0};
}

/* ---- trees ------------------------------------------------------------------------------------------------------------------------ */

static size_t corners_of(uint32_t leaves) { return 3 * padded(leaves); }
static uint32_t tasks_of(uint32_t leaves) { return leaves < ES_TREE_BLOCK ? 1 : leaves / ES_TREE_BLOCK; }

/* Is there a tree for each share, in order? */
static bool same_trees(const es_point_forest* forest, const es_forest_source* sources, const share* shares, const es_draw_list* list, bool floats)
{
    if (forest->own->floats != floats) return false;
    uint32_t tree = 0;
    for (uint32_t i = 0; i < 2 * list->instance_count; i++) {
        if (shares[i].leaves == UINT32_MAX) continue;
        if (tree == forest->tree_count) return false;
        const es_point_tree* t = &forest->trees[tree];
        const es_tree_state* state = &forest->own->states[tree++];
        if (state->source != i / 2 || state->id != sources[i / 2].id || t->back != (i % 2 == 1) || t->leaf_count != 1u << shares[i].leaves) return false;
    }
    return tree == forest->tree_count;
}

static void copy_words(void* to, size_t to_first, const void* from, size_t from_first, size_t count, size_t size)
{
    memcpy((char*)to + to_first * size, (const char*)from + from_first * size, count * size);
}

/* A tree that is still there takes what it had. */
static void take_tree(es_point_forest* to, uint32_t new_tree, const es_point_forest* from, uint32_t old_tree)
{
    es_point_tree* tree = &to->trees[new_tree];
    const es_point_tree* old = &from->trees[old_tree];
    const size_t first = tree->first, first_leaf = tree->first_leaf, nodes = 2 * (size_t)tree->leaf_count, leaves = tree->leaf_count;
    const uint32_t instance = tree->instance, source = to->own->states[new_tree].source, blocks = tasks_of(tree->leaf_count);
    const size_t corner = to->own->states[new_tree].corner, upper = to->own->states[new_tree].upper, old_upper = from->own->states[old_tree].upper;
    *tree = *old;
    tree->instance = instance;
    tree->first = first;
    tree->first_leaf = first_leaf;
    to->own->states[new_tree] = from->own->states[old_tree];
    to->own->states[new_tree].source = source;
    to->own->states[new_tree].corner = corner;
    to->own->states[new_tree].linked = false;
    to->own->states[new_tree].upper = upper;
    copy_words(to->own->upper, upper / 8, from->own->upper, old_upper / 8, padded(2 * (size_t)blocks) / 8, ES_NODE_RECORD * sizeof(float));
    copy_words(to->nodes, first, from->nodes, old->first, nodes, sizeof *to->nodes);
    if (to->own->floats && from->own->floats) copy_words(to->float_nodes, first, from->float_nodes, old->first, nodes, sizeof *to->float_nodes);
    else if (to->own->floats) to->own->states[new_tree].revision = UINT64_MAX; /* they have to be made */
    for (int c = 0; c < 3; c++) copy_words(to->radiance[c], first, from->radiance[c], old->first, nodes, sizeof(float));
    copy_words(to->area, first, from->area, old->first, nodes, sizeof(float));
    copy_words(to->albedo, first, from->albedo, old->first, nodes, sizeof(uint32_t));
    copy_words(to->emission, first, from->emission, old->first, nodes, sizeof(uint32_t));
    void* const new_leaves[12] = {to->x, to->y, to->z, to->normal, to->albedo_rg, to->albedo_b, to->surface, to->triangle, to->barycentric, to->own->shapes.along, to->own->shapes.across,
        to->own->shapes.shear};
    void* const old_leaves[12] = {from->x, from->y, from->z, from->normal, from->albedo_rg, from->albedo_b, from->surface, from->triangle, from->barycentric, from->own->shapes.along,
        from->own->shapes.across, from->own->shapes.shear};
    for (int k = 0; k < 12; k++) copy_words(new_leaves[k], first_leaf, old_leaves[k], old->first_leaf, leaves, 4);
}

/* Other trees than there were. */
static es_result lay_out(es_context* context, es_point_forest* forest, const es_forest_source* sources, const share* shares, const es_draw_list* list, bool floats)
{
    struct es_forest_private own = {.floats = floats};
    es_point_forest next = {.own = &own};
    for (uint32_t i = 0; i < 2 * list->instance_count; i++) {
        if (shares[i].leaves == UINT32_MAX) continue;
        next.tree_count++;
        next.leaf_count += (size_t)1 << shares[i].leaves;
        own.task_count += tasks_of(1u << shares[i].leaves);
        own.corner_count += corners_of(1u << shares[i].leaves);
        own.top_upper += padded(2 * (size_t)tasks_of(1u << shares[i].leaves));
    }
    next.top.leaf_count = next.tree_count ? 1 : 0;
    while (next.top.leaf_count < next.tree_count) next.top.leaf_count *= 2;
    next.node_count = 2 * (next.leaf_count + next.top.leaf_count);
    next.top.first = 2 * next.leaf_count;
    next.top.first_leaf = next.leaf_count;
    next.top.instance = UINT32_MAX;
    next.top.rotation[0] = next.top.rotation[4] = next.top.rotation[8] = 1.0f;
    own.upper_count = own.top_upper + padded(2 * (size_t)next.top.leaf_count);
    own.place_count = ES_TREE_PLACES * (size_t)es_context_workers(context);
    own.scratch_count = ES_TREE_SCRATCH * (size_t)es_context_workers(context);
    if (!next.tree_count) {
        free_arrays(context, forest);
        forest->own->floats = floats;
        return ES_OK;
    }
    es_result result = allocate_arrays(context, &next);
    if (result) return result;
    uint32_t tree = 0, task = 0, old = 0;
    size_t leaf = 0, corner = 0, upper = 0;
    for (uint32_t i = 0; i < 2 * list->instance_count; i++) {
        if (shares[i].leaves == UINT32_MAX) continue;
        const uint32_t leaves = 1u << shares[i].leaves, id = sources[i / 2].id;
        const bool back = i % 2 == 1;
        next.trees[tree] = (es_point_tree){.instance = i / 2, .back = back, .leaf_count = leaves, .first = 2 * leaf, .first_leaf = leaf};
        own.states[tree] = (es_tree_state){.id = id, .source = i / 2, .corner = corner, .upper = upper};
        for (uint32_t turn = 0; turn < forest->tree_count; turn++, old++) {
            if (old >= forest->tree_count) old = 0;
            if (forest->own->states[old].id != id || forest->trees[old].back != back || forest->trees[old].leaf_count != leaves) continue;
            take_tree(&next, tree, forest, old++);
            break;
        }
        for (uint32_t k = 0; k < tasks_of(leaves); k++) own.tasks[task++] = (es_tree_task){.tree = tree, .block = k};
        tree++;
        leaf += leaves;
        corner += corners_of(leaves);
        upper += padded(2 * (size_t)tasks_of(leaves));
    }
    free_arrays(context, forest);
    struct es_forest_private* kept = forest->own;
    own.sources = kept->sources;
    own.source_count = kept->source_count;
    own.materials = kept->materials;
    *kept = own;
    next.own = kept;
    next.version = forest->version;
    *forest = next;
    return ES_OK;
}

/* ---- building ----------------------------------------------------------------------------------------------------------------------- */

typedef struct ordering { const es_split_point* points; const uint32_t* from; uint32_t* to; size_t words; } ordering;

static void order_some(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const ordering* o = user;
    for (uint32_t i = begin; i < end; i++)
        for (size_t k = 0; k < o->words; k++) o->to[i * o->words + k] = o->from[o->points[i].index * o->words + k];
}

/* to[i] = from[the split's i-th], of so many words each */
static void put_in_order(es_context* context, const es_split_point* points, const void* from, void* to, uint32_t count, size_t words)
{
    ordering o = {points, from, to, words};
    es_parallel_for(context, count, 16384, order_some, &o);
}

/* Candidates for each point. Where triangles have many points each, candidates are a lattice, which no choice makes more even; a tree of more points than MOST_CHOSEN
 * takes them as they are, too: memory and time would be many times the tree's own. */
enum { CHOICE = 4, MOST_CHOSEN = 1 << 20, LATTICE = 8 };

/* Places a tree's points and splits them. */
static es_result build(es_context* context, es_point_forest* forest, uint32_t index, const es_forest_source* source)
{
    const es_point_tree* tree = &forest->trees[index];
    const es_leaf_shapes* shapes = &forest->own->shapes;
    const uint32_t count = tree->leaf_count, choice = count > MOST_CHOSEN || count / LATTICE >= source->mesh->triangle_count ? 1 : CHOICE;
    const size_t leaf = tree->first_leaf, before_bytes = ((size_t)source->mesh->triangle_count + 1) * sizeof(double), candidates = (size_t)count * choice;
    double* before = es_allocate(context, before_bytes);
    es_split_point* points = before ? es_allocate_array(context, candidates, sizeof *points) : NULL;
    if (points) {
        es_point_areas(context, source->mesh, source->pose.shape, before);
        const es_placing placing = {source->mesh, source->pose.shape, before, count, choice, forest->triangle + leaf, forest->barycentric + leaf, {shapes->along + leaf, shapes->across + leaf, shapes->shear + leaf}};
        es_point_candidates(context, &placing, points);
        es_tree_split(context, points, count * choice, choice);
        es_point_choose(context, &placing, points);
    }
    es_release(context, points, candidates * sizeof *points);
    es_release(context, before, before_bytes);
    return points ? ES_OK : es_context_last_result(context);
}

/* A back's points are its front's, the tree before. */
static void copy_front(es_point_forest* forest, uint32_t index)
{
    const es_leaf_shapes* shapes = &forest->own->shapes;
    void* const arrays[5] = {forest->triangle, forest->barycentric, shapes->along, shapes->across, shapes->shear};
    for (int k = 0; k < 5; k++) copy_words(arrays[k], forest->trees[index].first_leaf, arrays[k], forest->trees[index - 1].first_leaf, forest->trees[index].leaf_count, 4);
}

/* Splits a tree as its leaves stand now; what they have goes with them. */
static es_result rebuild(es_context* context, es_point_forest* forest, uint32_t index)
{
    const es_point_tree* tree = &forest->trees[index];
    const uint32_t count = tree->leaf_count;
    const bool lobes = forest->lobes && tree->glossy;
    const size_t lobe_words = sizeof *forest->lobes / sizeof(uint32_t), scratch_size = (lobes ? lobe_words : 1) * sizeof(uint32_t);
    es_split_point* points = es_allocate_array(context, count, sizeof *points);
    uint32_t* scratch = points ? es_allocate_array(context, count, scratch_size) : NULL;
    if (scratch) {
        const size_t node = tree->first + count, leaf = tree->first_leaf;
        es_forest_stand(context, forest, index, points);
        es_tree_split(context, points, count, 1);
        const es_leaf_shapes* shapes = &forest->own->shapes;
        void* const arrays[13] = {forest->albedo_rg + leaf, forest->albedo_b + leaf, forest->surface + leaf, forest->triangle + leaf, forest->barycentric + leaf, shapes->along + leaf,
            shapes->across + leaf, shapes->shear + leaf, forest->albedo + node, forest->emission + node, forest->radiance[0] + node, forest->radiance[1] + node, forest->radiance[2] + node};
        for (int k = 0; k < 13; k++) {
            memcpy(scratch, arrays[k], count * sizeof *scratch);
            put_in_order(context, points, scratch, arrays[k], count, 1);
        }
        if (lobes) {
            memcpy(scratch, forest->lobes + node, count * sizeof *forest->lobes);
            put_in_order(context, points, scratch, forest->lobes + node, count, lobe_words);
        }
    }
    es_release(context, scratch, count * scratch_size);
    es_release(context, points, count * sizeof *points);
    return scratch ? ES_OK : es_context_last_result(context);
}

/* ---- the update ---------------------------------------------------------------------------------------------------------------------- */

static es_result examine_all(es_context* context, const es_point_forest* forest, es_forest_source* sources, const es_draw_list* list)
{
    uint32_t next = 0;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_forest_source* before = find_before(forest->own, list->instances[i].id, &next);
        es_result result = examine(context, &sources[i], before, &list->instances[i]);
        if (result) return result;
    }
    return ES_OK;
}

/* Of points that were not there before. */
static void darken(es_point_forest* forest, const es_point_tree* tree)
{
    const size_t nodes = 2 * (size_t)tree->leaf_count;
    for (int c = 0; c < 3; c++) memset(forest->radiance[c] + tree->first, 0, nodes * sizeof(float));
    for (size_t k = 0; k < nodes; k++) forest->nodes[tree->first + k].radiance = 0;
    if (forest->lobes) memset(forest->lobes + tree->first, 0, nodes * sizeof *forest->lobes);
}

/* What a tree's state asks for against its instance; true: its points have to be placed. */
static bool compare(es_point_tree* tree, es_tree_state* state, const es_forest_source* source, const es_raster_instance* instance, bool materials, bool* read)
{
    const uint64_t rest = es_hash_bytes(source->rest, source->pose.shape, sizeof source->pose.shape);
    const bool placed = state->mesh && state->rest == rest;
    state->work = 0;
    if (!placed) state->work = ES_TREE_NODES | ES_TREE_POSE | ES_TREE_LOOKS;
    if (state->revision != source->revision || state->mesh != source->mesh || memcmp(state->u, source->pose.u, sizeof state->u) != 0) state->work |= ES_TREE_NODES | ES_TREE_POSE | ES_TREE_LOOKS;
    if (memcmp(tree->rotation, source->pose.rotation, sizeof tree->rotation) != 0 || memcmp(tree->translation, source->pose.translation, sizeof tree->translation) != 0)
        state->work |= ES_TREE_POSE;
    *read = !placed || materials || state->material != instance->material;
    if (*read) state->work |= ES_TREE_NODES | ES_TREE_POSE | ES_TREE_LOOKS; /* what was a hole may be none */
    tree->instance = state->source;
    memcpy(tree->rotation, source->pose.rotation, sizeof tree->rotation);
    memcpy(tree->translation, source->pose.translation, sizeof tree->translation);
    memcpy(state->u, source->pose.u, sizeof state->u);
    state->mesh = source->mesh;
    state->revision = source->revision;
    state->material = instance->material;
    state->rest = rest;
    return !placed;
}

static es_result update(es_context* context, es_point_forest* forest, const es_draw_list* list, uint64_t materials, const es_forest_request* request, es_forest_source* sources, share* shares,
    es_forest_update* count)
{
    struct es_forest_private* own = forest->own;
    es_result result = examine_all(context, forest, sources, list);
    if (result) return result;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        shares[2 * i] = (share){.mass = mass_of(&sources[i], &list->instances[i])};
        shares[2 * i + 1] = (share){.mass = list->materials[list->instances[i].material].double_sided ? shares[2 * i].mass : 0.0};
    }
    share_out(shares, 2 * list->instance_count, request->points);
    bool changed = false, light = false;
    if (!same_trees(forest, sources, shares, list, !request->packed_only)) {
        changed = light = true;
        result = lay_out(context, forest, sources, shares, list, !request->packed_only);
        if (result) return result;
    }
    bool nodes = false;
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        es_point_tree* tree = &forest->trees[i];
        es_tree_state* state = &own->states[i];
        const es_forest_source* source = &sources[state->source];
        bool read;
        const bool place = compare(tree, state, source, &list->instances[state->source], own->materials != materials, &read);
        if (place) {
            const bool front = tree->back && i && forest->trees[i - 1].instance == tree->instance && forest->trees[i - 1].leaf_count == tree->leaf_count && own->states[i - 1].base < 0.0;
            if (front) copy_front(forest, i);
            else result = build(context, forest, i, source);
            if (result) return result;
            state->base = -1.0;
            state->linked = false;
            darken(forest, tree);
            light = true;
        }
        if (read) es_forest_read_looks(context, forest, list, i);
        if (!state->work) continue;
        changed = true;
        nodes = nodes || state->work & ES_TREE_NODES;
        if (place) count->built++;
        else if (state->work & ES_TREE_NODES) count->refit++;
        else count->moved++;
        count->points += tree->leaf_count;
    }
    own->materials = materials;
    if (!changed) return ES_OK;

    /* new trees are measured at rest first */
    bool resting_trees = false;
    for (uint32_t i = 0; i < forest->tree_count; i++) resting_trees = resting_trees || (own->states[i].base < 0.0 && own->states[i].mesh->rest_positions);
    if (resting_trees) {
        es_forest_refit(context, forest, true);
        for (uint32_t i = 0; i < forest->tree_count; i++)
            if (own->states[i].base < 0.0) own->states[i].base = own->states[i].measure;
    }
    es_forest_refit(context, forest, false);
    bool again = false;
    for (uint32_t i = 0; i < forest->tree_count; i++) {
        es_tree_state* state = &own->states[i];
        const bool worn = state->work & ES_TREE_NODES && state->base >= 0.0 && request->rebuild > 0.0f && state->measure > state->base * (double)request->rebuild;
        if (!worn) state->work = 0;
        if (state->base < 0.0) state->base = state->measure;
        if (!worn) continue;
        result = rebuild(context, forest, i);
        if (result) return result;
        state->base = -1.0;
        state->linked = false;
        again = light = true;
        count->built++;
    }
    if (again) {
        es_forest_refit(context, forest, false);
        for (uint32_t i = 0; i < forest->tree_count; i++)
            if (own->states[i].base < 0.0) own->states[i].base = own->states[i].measure;
    }
    es_split_point* order = es_allocate_array(context, (size_t)forest->tree_count + 1, sizeof *order);
    if (!order) return es_context_last_result(context);
    es_forest_refit_top(context, forest, order);
    es_release(context, order, ((size_t)forest->tree_count + 1) * sizeof *order);
    if (light) es_forest_pull(context, forest); /* what was kept, where it is now */
    forest->version = es_context_next_serial(context);
    return ES_OK;
}

es_result es_forest_bring(es_context* context, es_point_forest* forest, const es_draw_list* list, uint64_t materials, const es_forest_request* request, es_forest_update* count)
{
    *count = (es_forest_update){0};
    if (!forest->own) {
        forest->own = es_allocate_zero(context, sizeof *forest->own);
        if (!forest->own) return es_context_last_result(context);
    }
    es_forest_source* sources = es_allocate_array(context, (size_t)list->instance_count, sizeof *sources);
    share* shares = sources ? es_allocate_array(context, 2 * (size_t)list->instance_count, sizeof *shares) : NULL;
    es_result result = shares ? update(context, forest, list, materials, request, sources, shares, count) : es_context_last_result(context);
    es_release(context, shares, 2 * (size_t)list->instance_count * sizeof *shares);
    if (result) {
        es_release(context, sources, list->instance_count * sizeof *sources);
        es_forest_free(context, forest);
        return result;
    }
    struct es_forest_private* own = forest->own;
    es_release(context, own->sources, own->source_count * sizeof *own->sources);
    own->sources = sources;
    own->source_count = list->instance_count;
    return ES_OK;
}
