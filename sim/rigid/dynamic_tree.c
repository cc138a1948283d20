/* The dynamic tree's structure, and what is asked of it; pairs are in tree_pairs.c. */
#include "sim/rigid/dynamic_tree.h"

#include <string.h>

#include "sim/rigid/frame.h"

/* Heights of siblings differ by one at most, so 2^32 leaves make a height below 47. */
enum { STACK = 128 };

static es_tree_box join(const es_tree_box* a, const es_tree_box* b)
{
    return (es_tree_box){es_v3_min(a->low, b->low), es_v3_max(a->high, b->high)};
}
static float half_area(const es_tree_box* b)
{
    es_vec3 d = es_v3_sub(b->high, b->low);
    return d.x * d.y + d.y * d.z + d.z * d.x;
}
static bool holds(const es_tree_box* a, const es_tree_box* b)
{
    return a->low.x <= b->low.x && a->low.y <= b->low.y && a->low.z <= b->low.z && a->high.x >= b->high.x && a->high.y >= b->high.y && a->high.z >= b->high.z;
}
static bool touch(const es_tree_box* a, const es_tree_box* b)
{
    return a->low.x <= b->high.x && a->low.y <= b->high.y && a->low.z <= b->high.z && a->high.x >= b->low.x && a->high.y >= b->low.y && a->high.z >= b->low.z;
}
static bool is_leaf(const es_tree_node* node) { return node->child[0] == ES_NO_PROXY; }

void es_dynamic_tree_init(es_dynamic_tree* tree, es_context* context)
{
    *tree = (es_dynamic_tree){.context = context, .root = ES_NO_PROXY, .free_node = ES_NO_PROXY};
}

void es_dynamic_tree_free(es_dynamic_tree* tree)
{
    es_context* context = tree->context;
    es_release(context, tree->nodes, tree->node_capacity * sizeof *tree->nodes);
    es_release(context, tree->tight, tree->tight_capacity * sizeof *tree->tight);
    es_release(context, tree->moved, tree->moved_capacity * sizeof *tree->moved);
    es_release(context, tree->wide, tree->wide_capacity * sizeof *tree->wide);
    es_release(context, tree->merged, tree->merged_capacity * sizeof *tree->merged);
    es_release(context, tree->fresh, tree->fresh_capacity * sizeof *tree->fresh);
    es_release(context, tree->pairs, tree->pair_capacity * sizeof *tree->pairs);
    es_dynamic_tree_init(tree, context);
}

void es_dynamic_tree_clear(es_dynamic_tree* tree)
{
    tree->root = tree->free_node = ES_NO_PROXY;
    tree->node_count = tree->proxy_count = 0;
    tree->moved_count = tree->wide_count = tree->fresh_count = tree->pair_count = 0;
}

/* ---- structure --------------------------------------------------------------------------------------------------------- */

/* Room for a leaf and the inner node above it, so that what follows cannot fail. */
static bool reserve(es_dynamic_tree* tree)
{
    size_t needed = (size_t)tree->node_count + 2;
    return es_grow(tree->context, (void**)&tree->nodes, &tree->node_capacity, tree->node_count, needed, sizeof *tree->nodes) &&
           es_grow(tree->context, (void**)&tree->tight, &tree->tight_capacity, tree->node_count, needed, sizeof *tree->tight) &&
           es_grow(tree->context, (void**)&tree->moved, &tree->moved_capacity, tree->moved_count, needed, sizeof *tree->moved);
}

static uint32_t take_node(es_dynamic_tree* tree)
{
    uint32_t node = tree->free_node;
    if (node != ES_NO_PROXY)
        tree->free_node = tree->nodes[node].parent;
    else
        node = tree->node_count++;
    tree->nodes[node] = (es_tree_node){.parent = ES_NO_PROXY, .child = {ES_NO_PROXY, ES_NO_PROXY}};
    return node;
}

static void give_node(es_dynamic_tree* tree, uint32_t node)
{
    tree->nodes[node].parent = tree->free_node;
    tree->nodes[node].child[0] = ES_NO_PROXY;
    tree->free_node = node;
}

static void update(es_tree_node* nodes, uint32_t at)
{
    es_tree_node *node = &nodes[at], *a = &nodes[node->child[0]], *b = &nodes[node->child[1]];
    node->fat = join(&a->fat, &b->fat);
    node->category = a->category | b->category;
    node->height = (uint8_t)(1 + (a->height > b->height ? a->height : b->height));
}

static void replace_child(es_dynamic_tree* tree, uint32_t parent, uint32_t old, uint32_t new)
{
    if (parent == ES_NO_PROXY)
        tree->root = new;
    else
        tree->nodes[parent].child[tree->nodes[parent].child[1] == old] = new;
    tree->nodes[new].parent = parent;
}

/* When one child is higher by two, it goes up and its own lower child comes down beside the other. Returns who is at `at`'s place. */
static uint32_t balance(es_dynamic_tree* tree, uint32_t at)
{
    es_tree_node* nodes = tree->nodes;
    es_tree_node* node = &nodes[at];
    if (is_leaf(node)) return at;
    int difference = nodes[node->child[1]].height - nodes[node->child[0]].height;
    if (difference >= -1 && difference <= 1) return at;
    int side = difference > 0;
    uint32_t up = node->child[side], high = nodes[up].child[0], low = nodes[up].child[1];
    if (nodes[low].height > nodes[high].height) {
        uint32_t swap = high;
        high = low;
        low = swap;
    }
    replace_child(tree, node->parent, at, up);
    nodes[up].child[0] = at;
    nodes[up].child[1] = high;
    node->parent = up;
    node->child[side] = low;
    nodes[low].parent = at;
    update(nodes, at);
    update(nodes, up);
    return up;
}

static void fix_upwards(es_dynamic_tree* tree, uint32_t at)
{
    while (at != ES_NO_PROXY) {
        at = balance(tree, at);
        update(tree->nodes, at);
        at = tree->nodes[at].parent;
    }
}

/* Goes down to a leaf, where the area grows least. (To stop above would sometimes be a little cheaper, but puts a leaf beside a high subtree, and
 * one rotation on the way up would not make up for it.) */
static void insert(es_dynamic_tree* tree, uint32_t leaf)
{
    es_tree_node* nodes = tree->nodes;
    if (tree->root == ES_NO_PROXY) {
        tree->root = leaf;
        nodes[leaf].parent = ES_NO_PROXY;
        return;
    }
    const es_tree_box box = nodes[leaf].fat;
    uint32_t sibling = tree->root;
    while (!is_leaf(&nodes[sibling])) {
        float cost[2];
        for (int k = 0; k < 2; k++) {
            const es_tree_node* child = &nodes[nodes[sibling].child[k]];
            es_tree_box with = join(&child->fat, &box);
            cost[k] = half_area(&with) - (is_leaf(child) ? 0 : half_area(&child->fat));
        }
        sibling = nodes[sibling].child[cost[1] < cost[0]];
    }
    uint32_t old_parent = nodes[sibling].parent, parent = take_node(tree);
    replace_child(tree, old_parent, sibling, parent);
    nodes[parent].child[0] = sibling;
    nodes[parent].child[1] = leaf;
    nodes[sibling].parent = nodes[leaf].parent = parent;
    update(nodes, parent);
    fix_upwards(tree, parent);
}

static void take_out(es_dynamic_tree* tree, uint32_t leaf)
{
    es_tree_node* nodes = tree->nodes;
    uint32_t parent = nodes[leaf].parent;
    if (parent == ES_NO_PROXY) {
        tree->root = ES_NO_PROXY;
        return;
    }
    uint32_t sibling = nodes[parent].child[nodes[parent].child[0] == leaf], above = nodes[parent].parent;
    replace_child(tree, above, parent, sibling);
    give_node(tree, parent);
    fix_upwards(tree, above);
}

static void mark_moved(es_dynamic_tree* tree, uint32_t proxy)
{
    if (tree->nodes[proxy].moved) return;
    tree->nodes[proxy].moved = 1;
    tree->moved[tree->moved_count++] = proxy; /* room for every node was made when it was added */
}

static es_tree_box fatten(const es_tree_box* tight, float fat, es_vec3 ahead)
{
    es_vec3 zero = {0, 0, 0}, around = {fat, fat, fat};
    return (es_tree_box){es_v3_add(es_v3_sub(tight->low, around), es_v3_min(ahead, zero)), es_v3_add(es_v3_add(tight->high, around), es_v3_max(ahead, zero))};
}

uint32_t es_dynamic_tree_add(es_dynamic_tree* tree, uint32_t key, uint32_t category, es_tree_box tight, float fat)
{
    if (!reserve(tree)) return ES_NO_PROXY;
    uint32_t leaf = take_node(tree);
    tree->nodes[leaf].fat = fatten(&tight, fat, es_v3(0, 0, 0));
    tree->nodes[leaf].key = key;
    tree->nodes[leaf].category = category;
    tree->tight[leaf] = tight;
    insert(tree, leaf);
    mark_moved(tree, leaf);
    tree->proxy_count++;
    return leaf;
}

void es_dynamic_tree_remove(es_dynamic_tree* tree, uint32_t proxy)
{
    take_out(tree, proxy);
    if (tree->nodes[proxy].moved)
        for (size_t i = 0; i < tree->moved_count; i++)
            if (tree->moved[i] == proxy) {
                tree->moved[i] = tree->moved[--tree->moved_count];
                break;
            }
    /* its pairs go now: the number may be taken by another before they are looked at again */
    size_t kept = 0;
    for (size_t i = 0; i < tree->wide_count; i++)
        if (tree->wide[i].a != proxy && tree->wide[i].b != proxy) tree->wide[kept++] = tree->wide[i];
    tree->wide_count = kept;
    give_node(tree, proxy);
    tree->proxy_count--;
}

void es_dynamic_tree_move(es_dynamic_tree* tree, uint32_t proxy, es_tree_box tight, float fat, es_vec3 ahead)
{
    tree->tight[proxy] = tight;
    es_tree_node* node = &tree->nodes[proxy];
    if (holds(&node->fat, &tight)) {
        /* too large: after a fast flight it would meet too many */
        es_tree_box largest = fatten(&tight, 4 * fat, es_v3_scale(ahead, 4));
        if (holds(&largest, &node->fat)) return;
    }
    take_out(tree, proxy);
    node->fat = fatten(&tight, fat, ahead);
    insert(tree, proxy);
    mark_moved(tree, proxy);
}

void es_dynamic_tree_touch(es_dynamic_tree* tree, uint32_t proxy) { mark_moved(tree, proxy); }

/* ---- asking ------------------------------------------------------------------------------------------------------------- */

void es_dynamic_tree_query(const es_dynamic_tree* tree, es_tree_box box, uint32_t mask, es_tree_found found, void* user)
{
    uint32_t stack[STACK], depth = 0;
    if (tree->root != ES_NO_PROXY) stack[depth++] = tree->root;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_tree_node* node = &tree->nodes[at];
        if (!(node->category & mask) || !touch(&node->fat, &box)) continue;
        if (!is_leaf(node)) {
            stack[depth++] = node->child[1];
            stack[depth++] = node->child[0];
        } else if (touch(&tree->tight[at], &box) && !found(user, node->key))
            return;
    }
}

/* Where the ray enters the box, or 3e38 when it misses within [0, max]. */
static float entry(const es_tree_box* box, const float origin[3], const float inverse[3], float max)
{
    const float *low = &box->low.x, *high = &box->high.x;
    float near_t = 0, far_t = max;
    for (int k = 0; k < 3; k++) {
        float a = (low[k] - origin[k]) * inverse[k], b = (high[k] - origin[k]) * inverse[k];
        if (inverse[k] < 0) {
            float swap = a;
            a = b;
            b = swap;
        }
        b *= 1.0000004f; /* three roundings */
        if (a > near_t) near_t = a;
        if (b < far_t) far_t = b;
    }
    return near_t <= far_t ? near_t : 3e38f;
}

typedef struct pending { uint32_t node; float at; } pending;

void es_dynamic_tree_ray(const es_dynamic_tree* tree, es_vec3 o, es_vec3 d, float max, uint32_t mask, es_tree_ray_found found, void* user)
{
    const float origin[3] = {o.x, o.y, o.z};
    /* never an infinity, not even times a distance: a tiny direction stands for none */
    const float inverse[3] = {1 / (es_absf(d.x) > 1e-20f ? d.x : 1e-20f), 1 / (es_absf(d.y) > 1e-20f ? d.y : 1e-20f), 1 / (es_absf(d.z) > 1e-20f ? d.z : 1e-20f)};
    pending stack[STACK];
    uint32_t depth = 0;
    if (tree->root != ES_NO_PROXY) stack[depth++] = (pending){tree->root, entry(&tree->nodes[tree->root].fat, origin, inverse, max)};
    while (depth) {
        pending top = stack[--depth];
        const es_tree_node* node = &tree->nodes[top.node];
        if (!(top.at <= max) || !(node->category & mask)) continue;
        if (is_leaf(node)) {
            if (entry(&tree->tight[top.node], origin, inverse, max) <= max) max = found(user, node->key, max);
            if (max < 0) return;
            continue;
        }
        pending child[2];
        for (int k = 0; k < 2; k++) child[k] = (pending){node->child[k], entry(&tree->nodes[node->child[k]].fat, origin, inverse, max)};
        int near_one = child[1].at < child[0].at;
        stack[depth++] = child[!near_one];
        stack[depth++] = child[near_one];
    }
}

static float distance_to(const es_tree_box* box, es_vec3 p)
{
    es_vec3 zero = {0, 0, 0}, d = es_v3_max(es_v3_max(es_v3_sub(box->low, p), es_v3_sub(p, box->high)), zero);
    return es_v3_length(d) * 0.9999995f;
}

void es_dynamic_tree_near(const es_dynamic_tree* tree, es_vec3 point, float max, uint32_t mask, es_tree_ray_found found, void* user)
{
    pending stack[STACK];
    uint32_t depth = 0;
    if (tree->root != ES_NO_PROXY) stack[depth++] = (pending){tree->root, distance_to(&tree->nodes[tree->root].fat, point)};
    while (depth) {
        pending top = stack[--depth];
        const es_tree_node* node = &tree->nodes[top.node];
        if (!(top.at <= max) || !(node->category & mask)) continue;
        if (is_leaf(node)) {
            if (distance_to(&tree->tight[top.node], point) <= max) max = found(user, node->key, max);
            if (max < 0) return;
            continue;
        }
        pending child[2];
        for (int k = 0; k < 2; k++) child[k] = (pending){node->child[k], distance_to(&tree->nodes[node->child[k]].fat, point)};
        int near_one = child[1].at < child[0].at;
        stack[depth++] = child[!near_one];
        stack[depth++] = child[near_one];
    }
}
