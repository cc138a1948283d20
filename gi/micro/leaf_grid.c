#include "gi/micro/leaf_grid.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

enum { REACH = 4 };

static uint32_t cell_hash(const es_leaf_grid* g, uint32_t tree, const int32_t cell[3])
{
    return es_hash_u32((uint32_t)cell[0] * 0x8da6b343u ^ (uint32_t)cell[1] * 0xd8163841u ^ (uint32_t)cell[2] * 0xcb1ab31fu ^ tree * 0x9e3779b9u) & g->mask;
}

static int32_t cell_of(float x, float scale) { return (int32_t)es_clampf(es_floor(x * scale), -1e9f, 1e9f); }

static uint32_t leaf_hash(const es_leaf_grid* g, uint32_t tree, size_t leaf)
{
    const es_point_forest* f = g->forest;
    const int32_t cell[3] = {cell_of(f->x[leaf], g->scale[tree]), cell_of(f->y[leaf], g->scale[tree]), cell_of(f->z[leaf], g->scale[tree])};
    return cell_hash(g, tree, cell);
}

es_result es_leaf_grid_make(es_arena* arena, const es_point_forest* f, es_leaf_grid* g)
{
    uint32_t buckets = 1024;
    while (buckets < f->leaf_count / 2 && buckets < 1u << 30) buckets *= 2;
    *g = (es_leaf_grid){.forest = f, .mask = buckets - 1};
    g->scale = es_arena_allocate(arena, ((size_t)f->tree_count + 1) * sizeof *g->scale);
    g->start = g->scale ? es_arena_allocate(arena, ((size_t)buckets + 2) * sizeof *g->start) : NULL;
    g->order = g->start ? es_arena_allocate(arena, (f->leaf_count + 1) * sizeof *g->order) : NULL;
    if (!g->order) return es_context_last_result(arena->context);
    memset(g->start, 0, ((size_t)buckets + 2) * sizeof *g->start);
    for (uint32_t t = 0; t < f->tree_count; t++) {
        const es_point_tree* tree = &f->trees[t];
        g->scale[t] = 0.5f / es_sqrt(es_clampf(f->area[tree->first + 1] / (float)tree->leaf_count, 1e-30f, 1e30f));
        for (size_t i = tree->first_leaf; i < tree->first_leaf + tree->leaf_count; i++) g->start[leaf_hash(g, t, i) + 2]++;
    }
    /* counts two places on: once they are sums, and leaves are put where start[h + 1] says, which moves on, start[h] is h's first */
    for (uint32_t b = 2; b < buckets + 2; b++) g->start[b] += g->start[b - 1];
    for (uint32_t t = 0; t < f->tree_count; t++)
        for (size_t i = f->trees[t].first_leaf; i < f->trees[t].first_leaf + f->trees[t].leaf_count; i++) g->order[g->start[leaf_hash(g, t, i) + 1]++] = (uint32_t)i;
    return ES_OK;
}

typedef struct nearest { uint32_t tree; es_vec3 position, normal; size_t leaf; float facing, any; } nearest; /* m², to leaves that face as they should, to any */

static void look_in_cell(const es_leaf_grid* g, const int32_t cell[3], nearest* n)
{
    const es_point_forest* f = g->forest;
    const es_point_tree* tree = &f->trees[n->tree];
    const uint32_t h = cell_hash(g, n->tree, cell);
    for (uint32_t i = g->start[h]; i < g->start[h + 1]; i++) {
        const size_t leaf = g->order[i];
        if (leaf < tree->first_leaf || leaf >= tree->first_leaf + tree->leaf_count) continue;
        const float dx = f->x[leaf] - n->position.x, dy = f->y[leaf] - n->position.y, dz = f->z[leaf] - n->position.z, d2 = dx * dx + dy * dy + dz * dz;
        if (!(d2 < n->facing)) continue;
        if (es_v3_dot(n->normal, es_unpack_normal(f->normal[leaf])) > 0.5f) {
            n->facing = d2;
            n->leaf = leaf;
        } else if (n->facing > 1e38f && d2 < n->any) {
            n->any = d2;
            n->leaf = leaf;
        }
    }
}

/* Those whose largest step is `reach`, but what is further than what was found. */
static void look_around(const es_leaf_grid* g, const int32_t cell[3], const float within[3], int32_t reach, nearest* n)
{
    const float scale = g->scale[n->tree];
    const int32_t side = 2 * reach + 1;
    for (int32_t i = 0; i < side * side * side; i++) {
        const int32_t step[3] = {i % side - reach, i / side % side - reach, i / side / side - reach};
        float far = 0.0f; /* cells, squared */
        bool inner = true;
        for (int k = 0; k < 3; k++) {
            const float to = step[k] > 0 ? (float)step[k] - within[k] : step[k] < 0 ? within[k] - (float)step[k] - 1.0f : 0.0f;
            far += to * to;
            inner = inner && step[k] > -reach && step[k] < reach;
        }
        /* a hundredth for the rounding of places in cells */
        if (inner || !(far * 0.99f / (scale * scale) < n->facing)) continue;
        look_in_cell(g, (const int32_t[3]){cell[0] + step[0], cell[1] + step[1], cell[2] + step[2]}, n);
    }
}

size_t es_leaf_grid_nearest(const es_leaf_grid* g, uint32_t tree, es_vec3 position, es_vec3 normal)
{
    const float* p = &position.x;
    nearest n = {tree, position, normal, g->forest->trees[tree].first_leaf, 3e38f, 3e38f};
    int32_t cell[3];
    float within[3];
    for (int k = 0; k < 3; k++) {
        cell[k] = cell_of(p[k], g->scale[tree]);
        within[k] = p[k] * g->scale[tree] - (float)cell[k];
    }
    look_in_cell(g, cell, &n);
    look_around(g, cell, within, 1, &n);
    for (int32_t reach = 2; reach <= REACH && n.facing > 1e38f && n.any > 1e38f; reach++) look_around(g, cell, within, reach, &n);
    return n.leaf;
}
