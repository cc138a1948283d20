/* The scene as a hierarchy of points (Ritschel thesis §6.2.1): what micro-buffers are drawn from.
 *
 * Each instance of the draw list has a tree of its own, in its local space: the world transform is M = Q U, Q orthogonal with the translation and U
 * upper triangular (stretches and shears). Points stand in the space after U, lengths are metres there as in the world, and an instance that
 * moves rigidly changes its Q and nothing else. Double-sided materials have two trees, one for each side; of single-sided surfaces only the front
 * is there.
 *
 * A tree is complete and binary, of a power of two of leaves, split at the median of the longest axis. Its nodes stand in the forest's arrays from
 * `first` on, as in a heap: node 1 is the root, node i has children 2i and 2i + 1, and the leaves are nodes leaf_count … 2 leaf_count - 1 (slot 0
 * is not used). A leaf is a disc; an inner node is the sphere about its children's, the cone of their normals and their mean light.
 *
 * Above the trees is a tree of trees, complete too, in world space: its leaves are the trees' roots, padded with nodes of negative radius. */
#ifndef EARTHSHINE_GI_MICRO_FOREST_H
#define EARTHSHINE_GI_MICRO_FOREST_H

#include "gi/gi.h"

/* 128 bits (§6.3.1). Decoded: centre = low + step · position, radius = radius_step · radius, never less than what it was made from together with
 * the centre's rounding; 0: nothing is there (float_nodes: below 0), which is so of padding and of what a mask cuts out. */
typedef struct es_point_node {
    uint16_t position[3], radius;
    uint32_t cone;             /* bits 0 … 9 and 10 … 19: axis of the cone of normals, octahedral, each n as (n - 512) / 511, so that what is along an axis is
                                * exactly so; bits 20 … 25: s, the sine of its half angle is at most (s / 62)², the axis' own error included, 63: wider than 90°,
                                * may face any way; bits 26 … 31: f, the slab's half thickness is at most f / 63 of the float node's radius: 0 is flat, to 1 / 4096
                                * of it, as the parts of a wall are; the slab is that of the float node's axis and position */
    uint32_t radiance;         /* W/(m² sr) sent by its front, RGB9E5 (raster/pack.h) */
} es_point_node;

/* The same in floats, to compare with. */
typedef struct es_point_node_float {
    float position[3], radius;
    float axis[3], sine;       /* sine 2: may face any way */
    float slab;                /* all leaves' centres are within this of the plane through `position` across the axis, metres; of a node with leaves all
                                * around it the radius. By it a wall is known to be invisible from its own plane, whole */
} es_point_node_float;

/* What a node sends besides its radiance, in one direction more than in others (gi/micro/lobe_shape.h has the distribution p): towards w
 *     light · p(axis · w) / F,  0 from behind,
 * F being the mean of the cosine at which the node's area is seen from there. With m = length · (normal · w) and s, the sine of the half angle that normals are
 * spread by if they are so evenly over a cap,
 *     F = m or, where m < s, (m + s)² / (4 s), at least ES_LOBE_HORIZON;  s = 2 √(length (1 - length)) or, where length < 1/2, 1; at least 0.02
 * which of a leaf is n · w, and of a whole sphere 1/4. */
typedef struct es_point_lobe {
    uint32_t light;            /* W/m² of the node's area, RGB9E5; 0: there is no lobe */
    uint32_t axis;             /* world, as the G-buffer has normals: mean direction, by power */
    uint32_t normal;           /* world, likewise: mean normal, by area */
    uint32_t shape;            /* bits 0 … 15: √a as unorm; 16 … 30: length of the mean of the unit normals, of 32767; 31: distributed as Phong's lobes are */
} es_point_lobe;

typedef struct es_point_tree {
    uint32_t instance;         /* of the draw list */
    bool back;                 /* of a double-sided instance's back */
    bool glossy;               /* some leaf has a lobe worth a direction (es_surface_has_lobe) */
    uint32_t leaf_count;       /* a power of two */
    size_t first;              /* of its nodes in the forest's */
    size_t first_leaf;         /* of its leaves in the forest's: leaf k is node leaf_count + k */
    float rotation[9];         /* Q: columns are the local axes in the world; may mirror */
    float translation[3];
    float low[3], step[3], radius_step; /* of the quantised nodes */
} es_point_tree;

typedef struct es_point_forest {
    es_point_tree* trees;
    uint32_t tree_count;
    es_point_tree top;         /* the tree of trees: identity transform; `first` in the same arrays, no leaves of the leaves' arrays */
    uint32_t* top_trees;       /* of each of its leaves: which tree; UINT32_MAX: padding */
    size_t node_count, leaf_count;
    /* of nodes */
    es_point_node* nodes;
    es_point_node_float* float_nodes; /* tree's local space; what the others are rounded from; NULL with es_forest_request.packed_only */
    float* radiance[3];        /* W/(m² sr), the mean over the node's area */
    es_point_lobe* lobes;      /* of glossy trees and the tree of trees, 0 of others; of what was lit last, as it stood then. NULL: all light is in radiance */
    float* area;               /* m² */
    uint32_t* albedo;          /* RGB9E5: share of the irradiance that is reflected, lobe included, the mean over the area */
    uint32_t* emission;        /* RGB9E5, W/(m² sr), likewise */
    /* of leaves, in the trees' order; arrays are readable up to the next multiple of eight past leaf_count */
    float *x, *y, *z;          /* world */
    uint32_t* normal;          /* world, octahedral 2 × 16 bits as the G-buffer has it, of the side that the leaf is */
    uint32_t *albedo_rg, *albedo_b, *surface; /* G-buffer words */
    uint32_t *triangle, *barycentric;  /* as es_scene_points has them */
    float radius;              /* m: of the root of the tree of trees */
    uint64_t version;          /* differs whenever anything above but light differs */
    struct es_forest_private* own; /* what updates need (gi/micro/forest.c) */
} es_point_forest;

typedef struct es_forest_request {
    uint32_t points;           /* of all trees together: at most; each tree has a power of two, by its area and the instance's point_weight */
    float rebuild;             /* a deforming tree is split anew when the measure of gi/micro/forest.c passes this multiple of what it was after the split */
    uint32_t packed_only;      /* not 0: float nodes are not kept: their memory, and the time to write it, is spared */
} es_forest_request;

typedef struct es_forest_update {
    uint32_t built, refit, moved; /* trees split anew, of other vertices, of another transform */
    uint64_t points;           /* leaves computed anew */
} es_forest_update;

/* Brings the forest up to the draw list and to the materials of that revision; what has not changed is left alone. Light is kept where the tree is, 0 where it
 * is new, and no lobes are kept when there are other trees than before, or other trees are glossy: light all again when the version differs. From all zero, or
 * again. A list without area gives no trees. */
es_result es_forest_bring(es_context* context, es_point_forest* forest, const es_draw_list* list, uint64_t materials, const es_forest_request* request, es_forest_update* update);
void es_forest_free(es_context* context, es_point_forest* forest);

/* Room for lobes, all 0, where there is none; and none. */
es_result es_forest_keep_lobes(es_context* context, es_point_forest* forest);
void es_forest_drop_lobes(es_context* context, es_point_forest* forest);

/* Mean light of all inner nodes and of the tree of trees from the leaves' radiance, by area; packs it into the quantised nodes. (§6.4.3's pull) With lobes, theirs:
 * light by area, axes by its luminance, and a grows by half the variance of what they are spread by, as of microfacets whose normals a map bends (Toksvig 2005;
 * Han et al. 2007). */
void es_forest_pull(es_context* context, es_point_forest* forest);

#endif
