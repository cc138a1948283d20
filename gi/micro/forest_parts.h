/* Between the files of the hierarchy of points: forest.c brings it up to the scene, points.c places, tree_build.c splits, tree_looks.c reads materials, tree_link.c finds the leaves' vertices,
 * tree_refit.c computes nodes, gi/kernels/forest.c does so eight at a time. */
#ifndef EARTHSHINE_GI_MICRO_FOREST_PARTS_H
#define EARTHSHINE_GI_MICRO_FOREST_PARTS_H

#include "gi/micro/forest.h"

/* ---- for the kernels ------------------------------------------------------------------------------------------------------------------ */

/* Nodes of a complete tree as in a heap: node 1 is the root, node i has children 2i and 2i + 1. Eight nodes that follow each other are a record: their x, their y … */
enum { ES_NODE_X, ES_NODE_Y, ES_NODE_Z, ES_NODE_RADIUS, ES_NODE_AXIS_X, ES_NODE_AXIS_Y, ES_NODE_AXIS_Z, ES_NODE_SINE, ES_NODE_SLAB, ES_NODE_COSINE, ES_NODE_VALUES };
enum { ES_NODE_RECORD = 8 * ES_NODE_VALUES }; /* floats */
static inline float* es_node_value(float* nodes, size_t node, int value) { return nodes + node / 8 * ES_NODE_RECORD + 8 * value + node % 8; }

/* A disc's shape follows its triangle. With u = b - a, v = c - a of the triangle as it is now, its axes are
 *     t1 = along · u,   t2 = across · (v - shear · u),
 * chosen so that in the pose in which points were placed they are orthogonal and as long as the disc's radius. Now |t1 × t2| is the square of the radius of the
 * circle of the same area, and the square root of the larger eigenvalue of the gram of t1, t2 is the radius of the disc that covers the stretched one. */
typedef struct es_leaf_shapes { float *along, *across, *shear; } es_leaf_shapes; /* along < 0: a hole in the surface, which has no disc */

/* Arrays begin at the tree's first leaf. */
typedef struct es_leaf_job {
    const float *vertices, *normals;   /* of the block's vertices, records of four floats: places after u; normals NULL: the triangles' are taken */
    const uint16_t* corners;           /* where in these, times two: eight leaves' first corners, their second, their third, then the next eight's */
    float cofactors[9];                /* of u over its largest element, for normals */
    float magnify;                     /* edges times this are about 1 or less, and squares of areas no denormals */
    float side;                        /* 1: front, -1: back */
    const uint32_t* barycentric;
    es_leaf_shapes shapes;
    float* nodes;                      /* leaf `begin` is node `first`; NULL: places in the world only */
    uint32_t first;
    float* area;                       /* of leaf 0; with nodes */
    const es_point_node* packed;       /* the tree's, which are asked for ahead of what writes them; NULL: none */
    uint32_t leaf_count;               /* the tree's; with packed */
    float rotation[9], translation[3];
    float *x, *y, *z;                  /* NULL: nodes only */
    uint32_t* normal;
} es_leaf_job;

/* How nodes are rounded. */
typedef struct es_node_frame {
    float low[3], step[3], radius_step;
    float error;                       /* m: of a decoded centre */
} es_node_frame;

/* What light there is at a tree's nodes; arrays begin at the tree's own. */
typedef struct es_node_light {
    float* radiance[3];
    const float* area;
    es_point_node* packed;
} es_node_light;

/* Lobes of a tree's nodes, likewise. */
typedef struct es_node_lobes {
    es_point_lobe* lobes;
    const float* area;
} es_node_lobes;

/* What a tree's nodes reflect and emit, likewise. */
typedef struct es_node_looks {
    uint32_t *albedo, *emission;
    const float* area;
} es_node_looks;

/* A disc's radius over that of the circle of the area it stands for. On triangles with many points discs leave nothing bare, on smaller ones a thousandth of
 * the surface at most (tests/test_point_forest.c). */
#define ES_POINT_OVERLAP 1.6f
/* How much longer than wide a stretched disc may count: beyond, what is stretched leaves holes instead of growing out of its surface. */
#define ES_POINT_STRETCH 4.0f
/* Share of a node's radius that is no thickness. */
#define ES_POINT_FLAT (1.0f / 4096.0f)
/* Coordinates beyond are taken to it: squares of areas stay finite. */
#define ES_POINT_FARTHEST 1e9f

/* ---- where an instance is -------------------------------------------------------------------------------------------------------------- */

/* transform = Q U. U is rounded to 16 bits, so that turning a thing leaves it as it is. */
typedef struct es_point_pose {
    float u[9], rotation[9], translation[3];
    float shape[9];                    /* U over `scale`, coarsely rounded: points are placed in this space, and again when it changes */
    float scale;                       /* 0: the transform leaves no area */
} es_point_pose;

es_point_pose es_point_pose_of(const es_mat4* transform);

/* ---- places ---------------------------------------------------------------------------------------------------------------------------------- */

typedef struct es_split_point { float position[3]; uint32_t index; } es_split_point;

typedef struct es_placing {
    const es_raster_mesh* mesh;
    const float* shape;
    const double* before;              /* area before each triangle, at rest, in the space of shape; one more entry: all */
    uint32_t count, choice;            /* points; candidates for each */
    uint32_t *triangle, *barycentric;
    es_leaf_shapes shapes;
} es_placing;

/* before[triangle_count + 1]; returns the whole */
double es_point_areas(es_context* context, const es_raster_mesh* mesh, const float shape[9], double* before);
/* count · choice places in the space of shape, spread by area; these are split until each part has `choice`, and one of each part becomes a point: the nearest to their
 * mean. As parts have equal areas and are compact, points keep their distances (tests/test_point_forest.c). */
void es_point_candidates(es_context* context, const es_placing* placing, es_split_point* candidates);
void es_point_choose(es_context* context, const es_placing* placing, const es_split_point* candidates);

/* ---- splitting ------------------------------------------------------------------------------------------------------------------------------- */

/* Orders `count` points, `part` times a power of two, so that halves, quarters … down to parts of the array are the tree's subtrees: each is split at the median of its
 * longest axis, equal coordinates by their index. */
void es_tree_split(es_context* context, es_split_point* points, uint32_t count, uint32_t part);
/* The same for any number; the first half has one more when it is odd. */
void es_tree_split_any(es_split_point* points, uint32_t count);

/* ---- nodes ------------------------------------------------------------------------------------------------------------------------------------- */

enum { ES_TREE_BLOCK = 2048 };  /* leaves that one task takes with all nodes above them; a power of two */
enum { ES_TREE_SCRATCH = 2 * ES_TREE_BLOCK / 8 * ES_NODE_RECORD };

enum { ES_TREE_PLACES = 2 * 4 * 3 * ES_TREE_BLOCK };

/* The block-th ES_TREE_BLOCK leaves of a tree, or all, if it has fewer. */
typedef struct es_tree_task {
    uint32_t tree, block;
    uint32_t vertex_count;      /* a multiple of eight: the last one may be there several times */
    float sum;                  /* of the squared radii of its inner nodes */
} es_tree_task;

/* What of a tree is to be computed. */
typedef enum es_tree_work {
    ES_TREE_NODES = 1,          /* leaves from their triangles, and all above */
    ES_TREE_POSE = 2,           /* leaves' places and normals in the world */
    ES_TREE_LOOKS = 4           /* what inner nodes reflect and emit */
} es_tree_work;

/* What the forest knows of a tree besides what it shows. */
typedef struct es_tree_state {
    const es_raster_mesh* mesh;
    uint32_t id, source;        /* es_raster_instance.id; index of the instance */
    float u[9];
    uint32_t material;
    uint64_t rest;              /* hash of the pose at rest and of `shape`: where the points are */
    uint64_t revision;
    double measure, base;       /* of the tree as it is, and after it was split: squared radii of all inner nodes over the leaves' area */
    uint32_t work;              /* es_tree_work */
    size_t corner;              /* its first in es_forest_private.corners and .vertices: three for each leaf, a multiple of 24 */
    bool linked;                /* these are what its leaves need */
    size_t upper;               /* its first in es_forest_private.upper: whole records of twice as many nodes as it has blocks, whose roots are the leaves there */
    float low[3], high[3];      /* box of the mesh's vertices in the tree's space */
    bool again;                 /* its root is larger than its frame was made for */
    bool plain;                 /* all leaves have the same looks, and so have all nodes */
} es_tree_state;

struct es_forest_private {
    struct es_forest_source* sources; /* of the list's instances (forest.c) */
    uint32_t source_count;
    es_tree_state* states;      /* of the trees */
    es_leaf_shapes shapes;      /* of the leaves */
    es_tree_task* tasks;
    size_t task_count;
    uint16_t* corners;          /* es_leaf_job.corners */
    uint32_t* vertices;         /* of the mesh, for each block as many as it has corners at most */
    size_t corner_count;
    float* places;              /* of a block's vertices, and their normals, for each worker: ES_TREE_PLACES */
    size_t place_count;
    float* upper;               /* nodes above blocks, of all trees, and those of the tree of trees */
    size_t upper_count, top_upper; /* nodes; the first of the tree of trees */
    float* scratch;             /* nodes of a block for each worker: ES_TREE_SCRATCH */
    size_t scratch_count;
    bool floats;                /* float nodes are kept */
    uint64_t materials;
};

/* Reads the material at a tree's leaves; what inner nodes have is made from it with the nodes (ES_TREE_LOOKS), where it is not the same for all. */
void es_forest_read_looks(es_context* context, es_point_forest* forest, const es_draw_list* list, uint32_t tree);
/* es_forest_pull's part of lobes. */
void es_forest_pull_lobes(es_context* context, es_point_forest* forest);
/* Finds the vertices of blocks of trees that have work and are not linked (tree_link.c). */
void es_forest_link(es_context* context, es_point_forest* forest);
/* Does the states' work; with `rest`, measures trees in their pose at rest and nothing else. */
void es_forest_refit(es_context* context, es_point_forest* forest, bool rest);
/* Where a tree's leaves are in its own space; points[k].index = k. */
void es_forest_stand(es_context* context, const es_point_forest* forest, uint32_t tree, es_split_point* points);
/* The tree of trees; `order` holds an es_split_point for each tree. */
void es_forest_refit_top(es_context* context, es_point_forest* forest, es_split_point* order);

#endif
