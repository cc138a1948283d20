/* The inside of a hierarchy, for its builder (gi/reference/bvh.c, bvh_build.c) and the traversal kernels (gi/kernels/trace.c). */
#ifndef EARTHSHINE_GI_REFERENCE_BVH_NODES_H
#define EARTHSHINE_GI_REFERENCE_BVH_NODES_H

#include "gi/reference/bvh.h"

/* The binary tree that is collapsed is at most 64 + 31 levels deep (bvh_build.c); each level of a path leaves at most seven children waiting. */
enum { ES_BVH_WIDTH = 8, ES_BVH_STACK = 95 * 7 + 8 };

/* Planes of an empty child's box: beyond any world (ES_WORLD_EXTENT), and finite after division by the smallest direction component. */
#define ES_BVH_NOWHERE 4e9f

/* A child is a node's index, or a block's with the top bit set, or ES_BVH_EMPTY, whose box is inside out. Children come after their
 * parent in the array. The planes lie as the traversal reads them: low x y z, high x y z, eight children each. */
#define ES_BVH_BLOCK 0x80000000u
#define ES_BVH_EMPTY 0xffffffffu
typedef struct es_bvh_node {
    float plane[6][ES_BVH_WIDTH];
    uint32_t child[ES_BVH_WIDTH];
} es_bvh_node;

/* Up to eight triangles: corner[c][axis][lane]. Unused lanes have primitive ES_NO_PRIMITIVE and all corners 0. */
typedef struct es_bvh_block {
    float corner[3][3][ES_BVH_WIDTH];
    uint32_t primitive[ES_BVH_WIDTH];
} es_bvh_block;

typedef struct es_bvh_box { float min[3], max[3]; } es_bvh_box;

struct es_bvh {
    es_context* context;
    uint32_t primitive_count, instance_count, vertex_count, node_count, block_count;
    es_bvh_primitive* primitives;
    es_vec3* vertices;             /* world space, instance by instance */
    uint32_t* corners;             /* three vertices per primitive */
    es_bvh_node* nodes;            /* [0] is the root */
    es_bvh_block* blocks;
    es_bvh_box* boxes;             /* of the blocks */
    uint32_t* first_vertex;        /* per instance */
    uint32_t* first_primitive;     /* per instance and one more */
    uint64_t* signature;           /* per instance: of its mesh's vertices and its transform at the last build or refit */
    uint32_t* shape;               /* per instance: vertex count, triangle count */
    es_bvh_box bounds;
    float cost, built_cost;
};

/* Fills nodes and blocks for the primitives; gi/reference/bvh_build.c. */
es_result es_bvh_build_nodes(es_bvh* bvh);
/* Corners and boxes of the blocks, then the boxes of the nodes bottom-up, the bounds and the cost. */
void es_bvh_fit(es_bvh* bvh);

#endif
