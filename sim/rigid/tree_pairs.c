/* Pairs of the dynamic tree. The sorted list of pairs of fat boxes is kept; where fat boxes are new, their pairs are taken out, found anew by
 * asking the tree, sorted and merged in. The tight boxes then decide, in one pass over the list. */
#include "sim/rigid/dynamic_tree.h"

#include <stdlib.h>
#include <string.h>

#include "sim/rigid/frame.h"

enum { STACK = 128 };

static bool touch(const es_tree_box* a, const es_tree_box* b)
{
    return (a->low.x <= b->high.x) & (a->low.y <= b->high.y) & (a->low.z <= b->high.z) & (a->high.x >= b->low.x) & (a->high.y >= b->low.y) & (a->high.z >= b->low.z);
}

static bool before(const es_tree_pair* p, const es_tree_pair* q) { return p->key_a != q->key_a ? p->key_a < q->key_a : p->key_b < q->key_b; }
static int compare(const void* p, const void* q) { return before(p, q) ? -1 : before(q, p); }

/* Everything whose fat box meets this one's; of two that are both new, the one with the smaller key reports. */
static bool find_partners(es_dynamic_tree* tree, uint32_t proxy, es_tree_wants wants, void* user)
{
    const es_tree_node* nodes = tree->nodes;
    const es_tree_node* leaf = &nodes[proxy];
    uint32_t stack[STACK], depth = 0;
    stack[depth++] = tree->root;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_tree_node* node = &nodes[at];
        if (!touch(&node->fat, &leaf->fat)) continue;
        if (node->child[0] != ES_NO_PROXY) {
            stack[depth++] = node->child[1];
            stack[depth++] = node->child[0];
            continue;
        }
        if (at == proxy || (node->moved && node->key < leaf->key)) continue;
        bool first = leaf->key < node->key;
        es_tree_pair pair = {first ? leaf->key : node->key, first ? node->key : leaf->key, first ? proxy : at, first ? at : proxy};
        if (wants && !wants(user, pair.key_a, pair.key_b)) continue;
        if (tree->fresh_count == tree->fresh_capacity &&
            !es_grow(tree->context, (void**)&tree->fresh, &tree->fresh_capacity, tree->fresh_count, tree->fresh_count + 1, sizeof *tree->fresh))
            return false;
        tree->fresh[tree->fresh_count++] = pair;
    }
    return true;
}

bool es_dynamic_tree_pairs(es_dynamic_tree* tree, es_tree_wants wants, void* user)
{
    if (tree->moved_count) {
        tree->fresh_count = 0;
        for (size_t i = 0; i < tree->moved_count; i++)
            if (!find_partners(tree, tree->moved[i], wants, user)) return false;
        if (tree->fresh_count > 1) qsort(tree->fresh, tree->fresh_count, sizeof *tree->fresh, compare);
        if (!es_grow(tree->context, (void**)&tree->merged, &tree->merged_capacity, 0, tree->wide_count + tree->fresh_count, sizeof *tree->merged)) return false;
        size_t count = 0, f = 0;
        for (size_t i = 0; i < tree->wide_count; i++) {
            const es_tree_pair* pair = &tree->wide[i];
            if (tree->nodes[pair->a].moved || tree->nodes[pair->b].moved) continue;
            while (f < tree->fresh_count && before(&tree->fresh[f], pair)) tree->merged[count++] = tree->fresh[f++];
            tree->merged[count++] = *pair;
        }
        while (f < tree->fresh_count) tree->merged[count++] = tree->fresh[f++];
        es_tree_pair* pairs = tree->wide;
        size_t capacity = tree->wide_capacity;
        tree->wide = tree->merged;
        tree->wide_capacity = tree->merged_capacity;
        tree->wide_count = count;
        tree->merged = pairs;
        tree->merged_capacity = capacity;
        for (size_t i = 0; i < tree->moved_count; i++) tree->nodes[tree->moved[i]].moved = 0;
        tree->moved_count = 0;
    }
    if (!es_grow(tree->context, (void**)&tree->pairs, &tree->pair_capacity, 0, tree->wide_count, sizeof *tree->pairs)) return false;
    size_t count = 0;
    for (size_t i = 0; i < tree->wide_count; i++) {
        tree->pairs[count] = tree->wide[i];
        count += touch(&tree->tight[tree->wide[i].a], &tree->tight[tree->wide[i].b]);
    }
    tree->pair_count = count;
    return true;
}
