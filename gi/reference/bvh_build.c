/* Building: binned surface area heuristic (Wald 2007) to a binary tree whose leaves hold at most eight triangles, then the child of the
 * largest surface is opened until a node has eight children.
 *
 * Everything is decided by bounds and counts, whose merging does not depend on order, and subtrees write to places fixed by the range
 * of triangles they hold: the tree is the same for any number of threads. */
#include "gi/reference/bvh_nodes.h"

#include <string.h>

#include "platform/context.h"

enum { BINS = 16, LEAF = ES_BVH_WIDTH, MAX_DEPTH = 64, CHUNKS = 16 };

typedef struct item { float min[4], max[4]; } item; /* [3]: the bits of the primitive; nothing */

static uint32_t primitive_of(const item* i)
{
    uint32_t p;
    memcpy(&p, &i->min[3], sizeof p);
    return p;
}

/* A binary node of `count` triangles from `first`; count 0: inner, its left child comes next and `first` is the right one. */
typedef struct split_node { es_bvh_box box; uint32_t first, count; } split_node;

typedef struct task { uint32_t node, begin, end, depth; } task;

typedef struct builder {
    es_bvh* bvh;
    item* items;
    split_node* tree;
    task* tasks;
} builder;

static es_bvh_box no_box(void) { return (es_bvh_box){{1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f}}; }
static void grow(es_bvh_box* box, const float* low, const float* high)
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = es_minf(box->min[k], low[k]);
        box->max[k] = es_maxf(box->max[k], high[k]);
    }
}
/* half the surface; 0 for an empty box */
static float half_area(const es_bvh_box* b)
{
    float x = b->max[0] - b->min[0], y = b->max[1] - b->min[1], z = b->max[2] - b->min[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}
static float middle(const item* i, int axis) { return 0.5f * i->min[axis] + 0.5f * i->max[axis]; }

/* ---- bounds and bins of a range --------------------------------------------------------------------------------------------- */

typedef struct extent { es_bvh_box box, middles; } extent;
/* Four numbers at a time, of which the last, an item's primitive, is along for the ride: whole vectors instead of three scalars. */
typedef float four __attribute__((vector_size(16)));
typedef int32_t four_bits __attribute__((vector_size(16)));
typedef struct wide_box { four min, max; } wide_box;
typedef struct bins { wide_box box[3][BINS]; uint32_t count[3][BINS]; } bins;

static wide_box no_wide_box(void) { return (wide_box){{1e30f, 1e30f, 1e30f, 1e30f}, {-1e30f, -1e30f, -1e30f, -1e30f}}; }
static inline four choose(four_bits m, four yes, four no) { return (four)((m & (four_bits)yes) | (~m & (four_bits)no)); }
static inline void grow_wide(wide_box* box, four low, four high)
{
    box->min = choose(low < box->min, low, box->min);
    box->max = choose(high > box->max, high, box->max);
}
static float half_wide_area(const wide_box* b)
{
    float x = b->max[0] - b->min[0], y = b->max[1] - b->min[1], z = b->max[2] - b->min[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

static void measure(const item* items, uint32_t begin, uint32_t end, extent* e)
{
    e->box = e->middles = no_box();
    for (uint32_t i = begin; i < end; i++) {
        float m[3] = {middle(&items[i], 0), middle(&items[i], 1), middle(&items[i], 2)};
        grow(&e->box, items[i].min, items[i].max);
        grow(&e->middles, m, m);
    }
}

/* Few triangles need few bins: as many are kept clean and searched as are worth it. */
typedef struct axis_scale { float low[3], scale[3]; int bins; } axis_scale;

static axis_scale scale_of(const extent* e, uint32_t count)
{
    axis_scale s = {.bins = count > 64 ? BINS : BINS / 2};
    for (int k = 0; k < 3; k++) {
        float width = e->middles.max[k] - e->middles.min[k];
        s.low[k] = e->middles.min[k];
        s.scale[k] = width > 1e-30f ? ((float)s.bins * 0.99999f) / width : 0.0f;
    }
    return s;
}

static uint32_t bin_of(const item* i, const axis_scale* s, int axis) { return (uint32_t)((middle(i, axis) - s->low[axis]) * s->scale[axis]); }

static void fill_bins(const item* items, uint32_t begin, uint32_t end, const axis_scale* s, bins* b)
{
    memset(b->count, 0, sizeof b->count);
    for (int k = 0; k < 3; k++)
        for (int n = 0; n < s->bins; n++) b->box[k][n] = no_wide_box();
    for (uint32_t i = begin; i < end; i++) {
        four low, high;
        memcpy(&low, items[i].min, sizeof low);
        memcpy(&high, items[i].max, sizeof high);
        for (int k = 0; k < 3; k++) {
            uint32_t n = bin_of(&items[i], s, k);
            grow_wide(&b->box[k][n], low, high);
            b->count[k][n]++;
        }
    }
}

typedef struct chunk_job { const builder* b; uint32_t begin, end; const axis_scale* scale; extent* extents; bins* all; } chunk_job;

static uint32_t chunk_edge(const chunk_job* job, uint32_t chunk) { return job->begin + (uint32_t)((uint64_t)(job->end - job->begin) * chunk / CHUNKS); }

static void measure_chunks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    chunk_job* job = user;
    for (uint32_t c = begin; c < end; c++) measure(job->b->items, chunk_edge(job, c), chunk_edge(job, c + 1), &job->extents[c]);
}

static void bin_chunks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    chunk_job* job = user;
    for (uint32_t c = begin; c < end; c++) fill_bins(job->b->items, chunk_edge(job, c), chunk_edge(job, c + 1), job->scale, &job->all[c]);
}

static void measure_wide(builder* b, uint32_t begin, uint32_t end, extent* e)
{
    extent parts[CHUNKS];
    chunk_job job = {.b = b, .begin = begin, .end = end, .extents = parts};
    es_parallel_for(b->bvh->context, CHUNKS, 1, measure_chunks, &job);
    *e = parts[0];
    for (int c = 1; c < CHUNKS; c++) {
        grow(&e->box, parts[c].box.min, parts[c].box.max);
        grow(&e->middles, parts[c].middles.min, parts[c].middles.max);
    }
}

static void fill_bins_wide(builder* b, uint32_t begin, uint32_t end, const axis_scale* s, bins* out, bins* parts)
{
    chunk_job job = {.b = b, .begin = begin, .end = end, .scale = s, .all = parts};
    es_parallel_for(b->bvh->context, CHUNKS, 1, bin_chunks, &job);
    *out = parts[0];
    for (int c = 1; c < CHUNKS; c++)
        for (int k = 0; k < 3; k++)
            for (int n = 0; n < s->bins; n++) {
                grow_wide(&out->box[k][n], parts[c].box[k][n].min, parts[c].box[k][n].max);
                out->count[k][n] += parts[c].count[k][n];
            }
}

/* ---- splitting ----------------------------------------------------------------------------------------------------------------- */

/* The cheapest plane by area × count; false when all middles coincide. */
static bool best_plane(const bins* b, int used, int* best_axis, uint32_t* best_bin, float* best_cost)
{
    *best_cost = 3e38f;
    bool found = false;
    for (int k = 0; k < 3; k++) {
        float right_cost[BINS];
        wide_box box = no_wide_box();
        uint32_t count = 0;
        for (int n = used - 1; n > 0; n--) {
            grow_wide(&box, b->box[k][n].min, b->box[k][n].max);
            count += b->count[k][n];
            right_cost[n] = count ? half_wide_area(&box) * (float)count : -1.0f;
        }
        box = no_wide_box();
        count = 0;
        for (int n = 1; n < used; n++) {
            grow_wide(&box, b->box[k][n - 1].min, b->box[k][n - 1].max);
            count += b->count[k][n - 1];
            if (!count || right_cost[n] < 0.0f) continue;
            float cost = half_wide_area(&box) * (float)count + right_cost[n];
            if (cost < *best_cost) {
                *best_cost = cost;
                *best_axis = k;
                *best_bin = (uint32_t)n;
                found = true;
            }
        }
    }
    return found;
}

static uint32_t partition(item* items, uint32_t begin, uint32_t end, const axis_scale* s, int axis, uint32_t plane)
{
    uint32_t i = begin, j = end;
    while (i < j) {
        if (bin_of(&items[i], s, axis) < plane) {
            i++;
            continue;
        }
        j--;
        item swap = items[i];
        items[i] = items[j];
        items[j] = swap;
    }
    return i;
}

/* A subtree of n triangles has at most 2 n - 1 nodes: its root, then its left subtree's places, then its right one's. */
static uint32_t right_place(const task* t, uint32_t cut) { return t->node + 2 * (cut - t->begin); }

/* Makes `t` a leaf (false) or splits its range; left and right are the tasks of the children. */
static bool split(builder* b, const task* t, bins* scratch, bool wide, task* left, task* right)
{
    split_node* node = &b->tree[t->node];
    extent e;
    if (wide)
        measure_wide(b, t->begin, t->end, &e);
    else
        measure(b->items, t->begin, t->end, &e);
    node->box = e.box;
    uint32_t count = t->end - t->begin;
    node->first = t->begin;
    node->count = count;
    if (count <= 2) return false;
    axis_scale s = scale_of(&e, count);
    int axis = 0;
    uint32_t plane = 0;
    float cost = 0.0f;
    if (wide)
        fill_bins_wide(b, t->begin, t->end, &s, &scratch[0], scratch + 1);
    else
        fill_bins(b->items, t->begin, t->end, &s, &scratch[0]);
    bool found = t->depth < MAX_DEPTH && best_plane(&scratch[0], s.bins, &axis, &plane, &cost);
    /* A block of eight is tested at once: splitting one pays only when the halves are much smaller than the whole. */
    if (count <= LEAF && (!found || cost >= 0.42f * half_area(&e.box) * (float)count)) return false;
    uint32_t cut = found ? partition(b->items, t->begin, t->end, &s, axis, plane) : t->begin + count / 2;
    node->count = 0;
    node->first = right_place(t, cut);
    *left = (task){t->node + 1, t->begin, cut, t->depth + 1};
    *right = (task){node->first, cut, t->end, t->depth + 1};
    return true;
}

static void build_subtree(builder* b, task t, bins* scratch)
{
    task left, right;
    /* the depth is bounded: MAX_DEPTH levels by area, then halves */
    while (split(b, &t, scratch, false, &left, &right)) {
        build_subtree(b, left, scratch);
        t = right;
    }
}

static void build_subtrees(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    builder* b = user;
    bins scratch;
    for (uint32_t i = begin; i < end; i++) build_subtree(b, b->tasks[i], &scratch);
}

typedef struct item_job { es_bvh* bvh; item* items; } item_job;
static void make_items(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    item_job* job = user;
    for (uint32_t p = begin; p < end; p++) {
        es_vec3 c[3];
        es_bvh_triangle(job->bvh, p, c);
        es_bvh_box box = no_box();
        for (int k = 0; k < 3; k++) {
            float v[3] = {c[k].x, c[k].y, c[k].z};
            grow(&box, v, v);
        }
        item* i = &job->items[p];
        memcpy(i->min, box.min, sizeof box.min);
        memcpy(i->max, box.max, sizeof box.max);
        memcpy(&i->min[3], &p, sizeof p);
        i->max[3] = 0.0f;
    }
}

/* ---- eight children a node ------------------------------------------------------------------------------------------------------ */

typedef struct wide_counts { uint32_t nodes, blocks; } wide_counts;

/* The up to eight descendants that become a wide node's children: the one of largest surface is opened as long as there is room. */
static uint32_t collect(const split_node* tree, uint32_t root, uint32_t children[ES_BVH_WIDTH])
{
    uint32_t count = 1;
    children[0] = root;
    while (count < ES_BVH_WIDTH) {
        int best = -1;
        float largest = -1.0f;
        for (uint32_t i = 0; i < count; i++) {
            const split_node* n = &tree[children[i]];
            if (n->count) continue;
            float area = half_area(&n->box);
            if (area > largest) {
                largest = area;
                best = (int)i;
            }
        }
        if (best < 0) break;
        uint32_t open = children[best];
        children[best] = open + 1;
        children[count++] = tree[open].first;
    }
    return count;
}

static wide_counts count_wide(const split_node* tree, uint32_t root)
{
    uint32_t children[ES_BVH_WIDTH], n = collect(tree, root, children);
    wide_counts sum = {1, 0};
    for (uint32_t i = 0; i < n; i++) {
        if (tree[children[i]].count) {
            sum.blocks++;
            continue;
        }
        wide_counts below = count_wide(tree, children[i]);
        sum.nodes += below.nodes;
        sum.blocks += below.blocks;
    }
    return sum;
}

static uint32_t emit(es_bvh* bvh, const builder* b, uint32_t root, wide_counts* used)
{
    uint32_t at = used->nodes++, children[ES_BVH_WIDTH], n = collect(b->tree, root, children);
    for (uint32_t i = 0; i < ES_BVH_WIDTH; i++) bvh->nodes[at].child[i] = ES_BVH_EMPTY;
    for (uint32_t i = 0; i < n; i++) {
        const split_node* child = &b->tree[children[i]];
        if (!child->count) {
            bvh->nodes[at].child[i] = emit(bvh, b, children[i], used);
            continue;
        }
        es_bvh_block* block = &bvh->blocks[used->blocks];
        for (uint32_t k = 0; k < ES_BVH_WIDTH; k++) block->primitive[k] = k < child->count ? primitive_of(&b->items[child->first + k]) : ES_NO_PRIMITIVE;
        bvh->nodes[at].child[i] = ES_BVH_BLOCK | used->blocks++;
    }
    return at;
}

es_result es_bvh_build_nodes(es_bvh* bvh)
{
    es_context* context = bvh->context;
    uint32_t n = bvh->primitive_count, node_places = n ? 2 * n - 1 : 0;
    if (!n) {
        bvh->nodes = es_allocate_array(context, 1, sizeof *bvh->nodes);
        if (!bvh->nodes) return es_context_last_result(context);
        bvh->node_count = 1;
        for (int i = 0; i < ES_BVH_WIDTH; i++) bvh->nodes[0].child[i] = ES_BVH_EMPTY;
        return ES_OK; /* es_bvh_fit turns the boxes inside out */
    }
    /* large ranges are split one after another, each with all threads; ranges below the limit are built side by side */
    const uint32_t limit = n / 32 > 4096 ? n / 32 : 4096;
    const uint32_t task_places = 2 * (n / (limit / 2 ? limit / 2 : 1)) + 256;
    builder b = {.bvh = bvh};
    size_t task_capacity = task_places;
    bins* scratch = NULL;
    bool all = (b.items = es_allocate_array(context, n, sizeof *b.items)) && (b.tree = es_allocate_array(context, node_places, sizeof *b.tree)) &&
        (b.tasks = es_allocate_array(context, task_capacity, sizeof *b.tasks)) && (scratch = es_allocate_array(context, CHUNKS + 1, sizeof *scratch));
    es_result result = all ? ES_OK : es_context_last_result(context);
    if (!result) {
        item_job items = {bvh, b.items};
        es_parallel_for(context, n, 4096, make_items, &items);
        task waiting[MAX_DEPTH * 2 + 64]; /* depth first, so at most one right sibling per level waits */
        uint32_t waiting_count = 1, task_count = 0;
        waiting[0] = (task){0, 0, n, 0};
        while (waiting_count && !result) {
            task t = waiting[--waiting_count], left, right;
            if (t.end - t.begin <= limit) {
                if (!es_grow(context, (void**)&b.tasks, &task_capacity, task_count, (size_t)task_count + 1, sizeof *b.tasks)) result = es_context_last_result(context);
                if (!result) b.tasks[task_count++] = t;
            } else if (split(&b, &t, scratch, true, &left, &right)) {
                waiting[waiting_count++] = right;
                waiting[waiting_count++] = left;
            }
        }
        if (!result) es_parallel_for(context, task_count, 1, build_subtrees, &b);
    }
    if (!result) {
        wide_counts total = count_wide(b.tree, 0);
        bvh->node_count = total.nodes;
        bvh->block_count = total.blocks;
        all = (bvh->nodes = es_allocate_array(context, total.nodes, sizeof *bvh->nodes)) &&
            (bvh->blocks = es_allocate_array(context, total.blocks, sizeof *bvh->blocks)) &&
            (bvh->boxes = es_allocate_array(context, total.blocks, sizeof *bvh->boxes));
        if (all) {
            wide_counts used = {0, 0};
            emit(bvh, &b, 0, &used);
        } else {
            result = es_context_last_result(context);
        }
    }
    es_release(context, b.items, n * sizeof *b.items);
    es_release(context, b.tree, node_places * sizeof *b.tree);
    es_release(context, b.tasks, task_capacity * sizeof *b.tasks);
    es_release(context, scratch, (CHUNKS + 1) * sizeof *scratch);
    return result;
}

/* ---- boxes bottom-up --------------------------------------------------------------------------------------------------------------- */

static void fit_blocks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    es_bvh* bvh = user;
    for (uint32_t i = begin; i < end; i++) {
        es_bvh_block* block = &bvh->blocks[i];
        es_bvh_box box = no_box();
        for (int lane = 0; lane < ES_BVH_WIDTH; lane++) {
            es_vec3 c[3] = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
            bool used = block->primitive[lane] != ES_NO_PRIMITIVE;
            if (used) es_bvh_triangle(bvh, block->primitive[lane], c);
            for (int k = 0; k < 3; k++) {
                float v[3] = {c[k].x, c[k].y, c[k].z};
                for (int axis = 0; axis < 3; axis++) block->corner[k][axis][lane] = v[axis];
                if (used) grow(&box, v, v);
            }
        }
        bvh->boxes[i] = box;
    }
}

/* Areas of the children of some nodes: of nodes, and of blocks times their triangles. */
typedef struct areas { double nodes, leaves; } areas;

/* The boxes of nodes [begin, end), from the last: children come after their parents, and those outside the range are fit already. */
static areas fit_nodes(es_bvh* bvh, uint32_t begin, uint32_t end)
{
    areas sum = {0.0, 0.0};
    for (uint32_t i = end; i-- > begin;) {
        es_bvh_node* node = &bvh->nodes[i];
        for (int c = 0; c < ES_BVH_WIDTH; c++) {
            es_bvh_box box = no_box();
            uint32_t child = node->child[c], triangles = 0;
            if (child != ES_BVH_EMPTY && child & ES_BVH_BLOCK) {
                box = bvh->boxes[child & ~ES_BVH_BLOCK];
                for (int k = 0; k < ES_BVH_WIDTH; k++) triangles += bvh->blocks[child & ~ES_BVH_BLOCK].primitive[k] != ES_NO_PRIMITIVE;
            } else if (child != ES_BVH_EMPTY) {
                const es_bvh_node* below = &bvh->nodes[child];
                for (int k = 0; k < ES_BVH_WIDTH; k++)
                    for (int axis = 0; axis < 3; axis++) {
                        box.min[axis] = es_minf(box.min[axis], below->plane[axis][k]);
                        box.max[axis] = es_maxf(box.max[axis], below->plane[3 + axis][k]);
                    }
            }
            for (int axis = 0; axis < 3; axis++) {
                node->plane[axis][c] = es_minf(box.min[axis], ES_BVH_NOWHERE);
                node->plane[3 + axis][c] = es_maxf(box.max[axis], -ES_BVH_NOWHERE);
            }
            double area = half_area(&box);
            if (triangles)
                sum.leaves += area * triangles;
            else
                sum.nodes += area;
        }
    }
    return sum;
}

/* Subtrees lie one after another (emit): those of the root's grandchildren are fit side by side, then the few nodes above them. */
enum { TOP_NODES = 1 + ES_BVH_WIDTH, SUBTREES = ES_BVH_WIDTH * ES_BVH_WIDTH };
typedef struct fit_job {
    es_bvh* bvh;
    uint32_t begin[SUBTREES], end[SUBTREES];
    areas sums[SUBTREES];
} fit_job;

static void fit_subtrees(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    fit_job* job = user;
    for (uint32_t i = begin; i < end; i++) job->sums[i] = fit_nodes(job->bvh, job->begin[i], job->end[i]);
}

void es_bvh_fit(es_bvh* bvh)
{
    es_parallel_for(bvh->context, bvh->block_count, 512, fit_blocks, bvh);
    fit_job job = {.bvh = bvh};
    uint32_t top[TOP_NODES], top_count = 0, count = 0, last = ES_NO_PRIMITIVE;
    top[top_count++] = 0;
    for (int c = 0; c < ES_BVH_WIDTH; c++) {
        uint32_t child = bvh->nodes[0].child[c];
        if (child & ES_BVH_BLOCK) continue;
        if (last != ES_NO_PRIMITIVE) job.end[last] = child;
        last = ES_NO_PRIMITIVE;
        top[top_count++] = child;
        for (int g = 0; g < ES_BVH_WIDTH; g++) {
            uint32_t grandchild = bvh->nodes[child].child[g];
            if (grandchild & ES_BVH_BLOCK) continue;
            if (last != ES_NO_PRIMITIVE) job.end[last] = grandchild;
            last = count++;
            job.begin[last] = grandchild;
        }
    }
    if (last != ES_NO_PRIMITIVE) job.end[last] = bvh->node_count;
    es_parallel_for(bvh->context, count, 1, fit_subtrees, &job);
    areas sum = {0.0, 0.0};
    for (uint32_t i = 0; i < count; i++) sum = (areas){sum.nodes + job.sums[i].nodes, sum.leaves + job.sums[i].leaves};
    while (top_count--) {
        areas part = fit_nodes(bvh, top[top_count], top[top_count] + 1);
        sum = (areas){sum.nodes + part.nodes, sum.leaves + part.leaves};
    }
    bvh->bounds = no_box();
    for (int c = 0; c < ES_BVH_WIDTH; c++) {
        const es_bvh_node* root = &bvh->nodes[0];
        float low[3] = {root->plane[0][c], root->plane[1][c], root->plane[2][c]}, high[3] = {root->plane[3][c], root->plane[4][c], root->plane[5][c]};
        grow(&bvh->bounds, low, high);
    }
    double whole = half_area(&bvh->bounds);
    bvh->cost = whole > 0.0 ? (float)((whole + sum.nodes + sum.leaves) / whole) : 0.0f;
}
