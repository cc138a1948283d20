/* Forests of leaves that a test places itself: each tree's leaves where and as it says, nodes without bounds. For what looks at leaves alone. */
#ifndef EARTHSHINE_TESTS_HAND_FOREST_H
#define EARTHSHINE_TESTS_HAND_FOREST_H

#include <stdlib.h>

#include "gi/micro/forest.h"
#include "platform/maths.h"
#include "raster/pack.h"
#include "tests/guarded_planes.h"

/* Trees of these many leaves, powers of two; everything 0. */
static inline es_point_forest hand_forest(const uint32_t* leaf_counts, uint32_t tree_count)
{
    es_point_forest f = {.trees = calloc(tree_count + 1, sizeof *f.trees), .tree_count = tree_count, .version = 1};
    for (uint32_t t = 0; t < tree_count; t++) {
        f.trees[t] = (es_point_tree){.instance = t, .leaf_count = leaf_counts[t], .first = f.node_count, .first_leaf = f.leaf_count};
        f.node_count += 2 * (size_t)leaf_counts[t];
        f.leaf_count += leaf_counts[t];
    }
    const size_t nodes = f.node_count + 1, leaves = (f.leaf_count + 15) / 8 * 8;
    for (int k = 0; k < 3; k++) f.radiance[k] = calloc(nodes, sizeof(float));
    f.area = calloc(nodes, sizeof *f.area);
    f.albedo = calloc(nodes, sizeof *f.albedo);
    f.emission = calloc(nodes, sizeof *f.emission);
    f.x = calloc(leaves, sizeof *f.x);
    f.y = calloc(leaves, sizeof *f.y);
    f.z = calloc(leaves, sizeof *f.z);
    f.normal = calloc(leaves, sizeof *f.normal);
    f.albedo_rg = calloc(leaves, sizeof *f.albedo_rg);
    f.albedo_b = calloc(leaves, sizeof *f.albedo_b);
    f.surface = calloc(leaves, sizeof *f.surface);
    return f;
}

static inline void hand_forest_free(es_point_forest* f)
{
    for (int k = 0; k < 3; k++) free(f->radiance[k]);
    free(f->area);
    free(f->albedo);
    free(f->emission);
    free(f->x);
    free(f->y);
    free(f->z);
    free(f->normal);
    free(f->albedo_rg);
    free(f->albedo_b);
    free(f->surface);
    free(f->trees);
}

/* The node that leaf is. */
static inline size_t node_of_leaf(const es_point_forest* f, size_t leaf)
{
    uint32_t t = 0;
    while (leaf >= f->trees[t].first_leaf + f->trees[t].leaf_count) t++;
    return f->trees[t].first + f->trees[t].leaf_count + (leaf - f->trees[t].first_leaf);
}

/* parameter: roughness in [0, 1], or Phong's exponent */
static inline void set_leaf(es_point_forest* f, size_t leaf, es_vec3 position, es_vec3 normal, uint32_t model, float base, float metallic, float parameter, float specular)
{
    const uint32_t u16 = es_pack_unorm16(base), second = model == ES_SURFACE_PHONG ? (uint32_t)(parameter * 5.0f + 0.5f) : es_pack_unorm8(parameter);
    f->x[leaf] = position.x;
    f->y[leaf] = position.y;
    f->z[leaf] = position.z;
    f->normal[leaf] = es_pack_normal(normal);
    f->albedo_rg[leaf] = u16 | u16 << 16;
    f->albedo_b[leaf] = u16;
    f->surface[leaf] = es_pack_unorm8(metallic) | second << 8 | es_pack_unorm8(specular) << 16 | model << 24;
}

static inline float leaf_radiance(const es_point_forest* f, size_t leaf, int k) { return f->radiance[k][node_of_leaf(f, leaf)]; }

/* Other memory for what the nodes send, between guards. */
typedef struct guarded_radiance { plane planes[3]; float* kept[3]; } guarded_radiance;

static inline guarded_radiance guard_radiance(es_point_forest* f, float everywhere)
{
    guarded_radiance g;
    for (int k = 0; k < 3; k++) {
        g.planes[k] = new_plane(f->node_count);
        g.kept[k] = f->radiance[k];
        f->radiance[k] = at(g.planes[k]);
        for (size_t i = 0; i < f->node_count; i++) f->radiance[k][i] = everywhere;
    }
    return g;
}

/* The forest has its own again. */
static inline void check_radiance_guards(es_point_forest* f, const guarded_radiance* g)
{
    for (int k = 0; k < 3; k++) {
        check_guards(g->planes[k]);
        f->radiance[k] = g->kept[k];
        free(g->planes[k].memory);
    }
}

#endif
