/* Leaves of a forest by their place: which of a tree's is nearest to a point of its surface. */
#ifndef EARTHSHINE_GI_MICRO_LEAF_GRID_H
#define EARTHSHINE_GI_MICRO_LEAF_GRID_H

#include "gi/micro/forest.h"
#include "platform/context.h"

/* Each tree has a grid of its own, whose cells are two leaves wide; cells are hashed: cell c's leaves are among order[start[h(c)] … start[h(c) + 1]). */
typedef struct es_leaf_grid {
    const es_point_forest* forest; /* must stay as it is */
    float* scale;                  /* cells a metre, of each tree */
    uint32_t *start, *order, mask;
} es_leaf_grid;

/* Memory is the arena's. */
es_result es_leaf_grid_make(es_arena* arena, const es_point_forest* forest, es_leaf_grid* grid);

/* The nearest leaf of the tree with a normal within 60° of `normal` (unit), if there is one in the point's cell or those around it; otherwise the nearest of
 * any there; the tree's first where in the four cells around it there is none. Of equally near ones any, but always the same. */
size_t es_leaf_grid_nearest(const es_leaf_grid* grid, uint32_t tree, es_vec3 position, es_vec3 normal);

#endif
