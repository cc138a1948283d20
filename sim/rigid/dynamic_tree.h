/* A tree of boxes that move: broad phase of the rigid bodies, and what rays and boxes are asked against.
 *
 * Each proxy has a tight box (as given) and a fat one around it, so that small moves leave the tree as it is. Leaves are put where
 * the surface area grows least, and rotations keep heights balanced. What is reported is decided by tight boxes alone and sorted
 * by the proxies' keys: it depends neither on the tree's structure nor on its history, and a tree built anew from the same tight boxes
 * reports the same.
 *
 * Boxes are relative to an origin of the caller's choice; when that moves, es_dynamic_tree_clear and add again. One thread changes the
 * tree; any number may query it while none does.
 * Source: Catto, "Dynamic Bounding Volume Hierarchies", GDC 2019. */
#ifndef EARTHSHINE_SIM_RIGID_DYNAMIC_TREE_H
#define EARTHSHINE_SIM_RIGID_DYNAMIC_TREE_H

#include "platform/context.h"

#define ES_NO_PROXY UINT32_MAX

typedef struct es_tree_box { es_vec3 low, high; } es_tree_box;

typedef struct es_tree_node {
    es_tree_box fat;
    uint32_t parent;         /* ES_NO_PROXY at the root; free nodes: the next free one */
    uint32_t child[2];       /* child[0] ES_NO_PROXY at leaves */
    uint32_t key;            /* leaves */
    uint32_t category;       /* leaves: theirs; inner nodes: all of their leaves' */
    uint8_t height;          /* 0 at leaves */
    uint8_t moved;           /* leaves: its fat box is new since the last es_dynamic_tree_pairs */
} es_tree_node;

typedef struct es_tree_pair { uint32_t key_a, key_b; /* a's is the smaller */ uint32_t a, b; /* their proxies */ } es_tree_pair;

typedef struct es_dynamic_tree {
    es_context* context;
    es_tree_node* nodes;
    es_tree_box* tight;      /* per leaf */
    size_t node_capacity, tight_capacity;
    uint32_t node_count;     /* used ever: free ones included */
    uint32_t root, free_node, proxy_count;
    uint32_t* moved;         /* leaves with `moved` */
    size_t moved_count, moved_capacity;
    es_tree_pair *wide, *merged, *fresh; /* pairs of fat boxes, sorted by their keys; the others are where they are made */
    size_t wide_count, wide_capacity, merged_capacity, fresh_count, fresh_capacity;
    es_tree_pair* pairs;     /* those of them whose tight boxes touch */
    size_t pair_count, pair_capacity;
} es_dynamic_tree;

void es_dynamic_tree_init(es_dynamic_tree* tree, es_context* context);
void es_dynamic_tree_free(es_dynamic_tree* tree);
void es_dynamic_tree_clear(es_dynamic_tree* tree);  /* no proxies; memory is kept */

/* The proxy's number, or ES_NO_PROXY after es_fail. Keys are the caller's and different for every proxy; pairs are ordered by them.
 * `fat` >= 0 is what the fat box adds on all sides. */
uint32_t es_dynamic_tree_add(es_dynamic_tree* tree, uint32_t key, uint32_t category, es_tree_box tight, float fat);
void es_dynamic_tree_remove(es_dynamic_tree* tree, uint32_t proxy);
/* `ahead`: how the box is expected to move; the fat box reaches out there when it is made anew, which is when the tight one has
 * left it or it has become much too large. */
void es_dynamic_tree_move(es_dynamic_tree* tree, uint32_t proxy, es_tree_box tight, float fat, es_vec3 ahead);
/* Asks `wants` anew for the proxy's pairs (its body became another type, its filter changed). */
void es_dynamic_tree_touch(es_dynamic_tree* tree, uint32_t proxy);

/* Brings tree->pairs up to date: all pairs of proxies whose tight boxes touch and that `wants` (NULL: all), in the order of
 * (key of a, key of b). `wants` is asked when two proxies' fat boxes meet and must depend on nothing that changes without es_dynamic_tree_touch.
 * False when memory ran out. */
typedef bool (*es_tree_wants)(void* user, uint32_t key_a, uint32_t key_b);
bool es_dynamic_tree_pairs(es_dynamic_tree* tree, es_tree_wants wants, void* user);

/* Calls for every proxy whose tight box touches, in no particular order, with category & mask; stops when the callback says false. */
typedef bool (*es_tree_found)(void* user, uint32_t key);
void es_dynamic_tree_query(const es_dynamic_tree* tree, es_tree_box box, uint32_t mask, es_tree_found found, void* user);
/* The same along a ray origin + t direction, t in [0, max], nearer boxes roughly first. The callback returns the new max (below 0 stops). To
 * be independent of the order, it should take the nearest hit and at equal distances the lower key. */
typedef float (*es_tree_ray_found)(void* user, uint32_t key, float max);
void es_dynamic_tree_ray(const es_dynamic_tree* tree, es_vec3 origin, es_vec3 direction, float max, uint32_t mask, es_tree_ray_found found,
    void* user);
/* The same for proxies whose tight boxes are within max of a point. */
void es_dynamic_tree_near(const es_dynamic_tree* tree, es_vec3 point, float max, uint32_t mask, es_tree_ray_found found, void* user);

static inline uint32_t es_dynamic_tree_key(const es_dynamic_tree* tree, uint32_t proxy) { return tree->nodes[proxy].key; }

#endif
