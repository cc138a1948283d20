/* The cut of a cell of gather points: level by level with eight nodes at a time, once for the whole cell. A node is opened when some point of the cell would open
 * it, and left out when none can see it. Point by point the cut would be a little smaller; but then every node that is opened is looked at by every point, and
 * the way down the tree is a chain of cache misses and mispredicted branches, which took six times as long. */
#ifndef EARTHSHINE_GI_MICRO_CUT_SIMD_H
#define EARTHSHINE_GI_MICRO_CUT_SIMD_H

#include "gi/micro/gather.h"
#include "platform/maths.h"
#include "platform/simd.h"
#include "platform/simd_maths.h"

/* What is seen at less than this sine sends nothing worth having; and by it a wall does not see itself, whose nodes' axes are off by up to (3 / 62)². */
#define GRAZING 4e-3f

/* Points of a cell, in a tree's space: their sphere; the cone of their normals, sine 2 when it is too wide to say anything; how far they reach from the plane
 * across its axis. With lobes, the cone of their mirror directions, and what bounds their density. */
typedef struct cell {
    float c[3], r, axis[3], sine, slab;
    es_micro_mapping mapping;
    float mirror[3], mirror_sine, mirror_cosine; /* cosine -2: too wide to say anything */
    float least, most, view_cosine; /* alpha² of GGX, or Phong's exponent; the least cosine of the view */
} cell;

typedef struct nodes_v { vf c[3], r, axis[3], sine, slab; vi radiance; } nodes_v;

VINL nodes_v load_quantised(const es_point_tree* tree, const es_point_node* nodes, vi at)
{
    vi xy, zr, cone;
    nodes_v v;
    vi_gather4(nodes, sizeof *nodes, at, &xy, &zr, &cone, &v.radiance);
    const vi low = vi_set1(0xffff), ten = vi_set1(1023), six = vi_set1(63);
    const vf unit = vf_set1(1.0f / 511.0f), one = vf_set1(1.0f);
    const vi middle = vi_set1(512);
    v.c[0] = vf_set1(tree->low[0]) + vf_set1(tree->step[0]) * vf_from_int(xy & low);
    v.c[1] = vf_set1(tree->low[1]) + vf_set1(tree->step[1]) * vf_from_int(vi_shift_right_logical(xy, 16));
    v.c[2] = vf_set1(tree->low[2]) + vf_set1(tree->step[2]) * vf_from_int(zr & low);
    v.r = vf_set1(tree->radius_step) * vf_from_int(vi_shift_right_logical(zr, 16));
    vf x = vf_from_int((cone & ten) - middle) * unit, y = vf_from_int((vi_shift_right_logical(cone, 10) & ten) - middle) * unit;
    const vf z = one - vf_abs(x) - vf_abs(y), fold = vf_max(vf_neg(z), vf_zero());
    x = x - vf_copysign(fold, x);
    y = y - vf_copysign(fold, y);
    const vf inverse = one / vf_sqrt(x * x + y * y + z * z);
    v.axis[0] = x * inverse;
    v.axis[1] = y * inverse;
    v.axis[2] = z * inverse;
    const vi sine = vi_shift_right_logical(cone, 20) & six;
    const vf root = vf_from_int(sine) * vf_set1(1.0f / 62.0f);
    v.sine = vf_select(vi_eq(sine, six), vf_set1(2.0f), root * root);
    v.slab = v.r * vf_from_int(vi_shift_right_logical(cone, 26)) * vf_set1(1.0f / 63.0f);
    return v;
}

VINL nodes_v load_float(const es_point_node_float* nodes, const es_point_node* packed, vi at)
{
    nodes_v v;
    vf_gather4(nodes, sizeof *nodes, at, &v.c[0], &v.c[1], &v.c[2], &v.r);
    vf_gather4((const char*)nodes + offsetof(es_point_node_float, axis), sizeof *nodes, at, &v.axis[0], &v.axis[1], &v.axis[2], &v.sine);
    for (int i = 0; i < VW; i++) {
        v.slab[i] = nodes[at[i]].slab;
        v.radiance[i] = (int32_t)packed[at[i]].radiance;
    }
    return v;
}

/* pi times the largest density, per steradian, that a lobe of the cell has towards any point of a sphere that appears under the angle with that sine. Of GGX,
 * distributed as its visible normals are: the half vector's angle is at least half of the direction's from the mirror direction. */
VINL vf lobe_bound(const cell* cell, vf cosine, vf sphere_sine)
{
    const vf one = vf_set1(1.0f), zero = vf_zero(), sphere_cosine = vf_sqrt(vf_max(one - sphere_sine * sphere_sine, zero));
    const vf mirror_cosine = vf_set1(cell->mirror_cosine), mirror_sine = vf_set1(cell->mirror_sine);
    const vf c = sphere_cosine * mirror_cosine - sphere_sine * mirror_sine, s = sphere_sine * mirror_cosine + sphere_cosine * mirror_sine;
    const vf sine = vf_sqrt(vf_max(one - cosine * cosine, zero));
    const vf nearest = vf_select(vm_ge(cosine, c), one, vf_min(cosine * c + sine * s, one));
    if (cell->mapping == ES_MICRO_PHONG) {
        const vf x = vf_max(nearest, vf_set1(1e-6f));
        return vf_set1(0.5f * (cell->most + 1.0f)) * vf_pow(x, vf_set1(cell->least));
    }
    const vf half = vf_set1(0.5f) + vf_set1(0.5f) * nearest;
    const float nv = cell->view_cosine;
    /* alpha² / (1 - h (1 - alpha²))² is largest at alpha² = (1 - h) / h */
    const vf least = vf_set1(cell->least), alpha2 = vf_min(vf_max((one - half) / half, least), vf_set1(cell->most)), d = one - half * (one - alpha2);
    const float rest = 1.0f - cell->least;
    return alpha2 * vf_set1(0.5f / (nv + es_sqrt(cell->least + rest * nv * nv))) / (d * d);
}

/* Which of eight nodes some point of the cell may see, and which of these it opens. */
VINL vm classify(const cell* cell, const nodes_v* v, float open, vm* opened, vf* excess)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), r = vf_set1(cell->r);
    const vf dx = v->c[0] - vf_set1(cell->c[0]), dy = v->c[1] - vf_set1(cell->c[1]), dz = v->c[2] - vf_set1(cell->c[2]);
    const vf ax = vf_set1(cell->axis[0]), ay = vf_set1(cell->axis[1]), az = vf_set1(cell->axis[2]);
    const vf d = vf_sqrt(dx * dx + dy * dy + dz * dz), z = ax * dx + ay * dy + az * dz;
    const vm above = vm_gt(z + v->r + vf_set1(cell->slab) + d * vf_set1(cell->sine), zero);
    /* how far the points reach along the node's axis */
    const vf turn = ax * v->axis[0] + ay * v->axis[1] + az * v->axis[2], off = vf_sqrt(vf_max(one - turn * turn, zero));
    const vf reach = vf_min(vf_set1(cell->slab) * vf_abs(turn) + r * vf_select(vm_lt(off, vf_set1(1e-3f)), zero, off), r);
    const vf facing = v->slab + reach - (v->axis[0] * dx + v->axis[1] * dy + v->axis[2] * dz) + d * (v->sine - vf_set1(GRAZING));
    const vf near = vf_max(d - r, zero);
    const vf square = near * near;
    vf measure = v->r * v->r;
    vm inside = vi_zero();
    if (cell->mapping != ES_MICRO_COSINE) {
        const vf inverse = one / vf_max(d, vf_set1(1e-15f)), sine = (v->r + r) * inverse;
        /* however many spheres they lie in, there is an end to opening them */
        inside = vm_ge(sine, one) & vm_gt(v->r * v->r, vf_set1(open * 1e-3f) * square);
        if (cell->mirror_cosine <= -2.0f) measure = measure * lobe_bound(cell, one, zero); /* towards everything, as it is where it is largest */
        else measure = measure * lobe_bound(cell, (vf_set1(cell->mirror[0]) * dx + vf_set1(cell->mirror[1]) * dy + vf_set1(cell->mirror[2]) * dz) * inverse, vf_min(sine, one));
    }
    *opened = inside | vm_gt(measure, vf_set1(open) * square);
    *excess = vf_select(inside, vf_set1(2.0f), measure / vf_max(vf_set1(open) * square, vf_set1(1e-18f)));
    return above & vm_gt(facing, zero) & vm_gt(v->r, zero);
}

/* A node's square halves from level to level: how many levels down it is what is allowed, 1 to 3. Looking at the levels between would take longer than what they
 * leave out. */
VINL vi levels_down(vf square, vf most)
{
    const vi exponents = vi_shift_right_logical(vi_from_bits(square), 23) - vi_shift_right_logical(vi_from_bits(most), 23);
    return vi_min(vi_max(exponents + vi_set1(1), vi_set1(1)), vi_set1(3));
}

/* A tree's nodes, as the traversals read them. */
typedef struct tree_nodes { const es_point_node* packed; const es_point_node_float* floats; const float* areas; uint32_t leaf_count; } tree_nodes;

VINL tree_nodes nodes_of(const es_point_forest* forest, const es_point_tree* tree, bool quantised)
{
    return (tree_nodes){forest->nodes + tree->first, quantised ? NULL : forest->float_nodes + tree->first, forest->area + tree->first, tree->leaf_count};
}

/* Puts a node's descendants, so many levels down, on the next wave, and asks for them, as they are read only when this wave is through. Writes 8 words; how many of
 * them are wanted. */
VINL uint32_t descend(const tree_nodes* nodes, uint32_t node, int32_t levels, uint32_t* to)
{
    while (levels > 1 && node << levels >= 2 * nodes->leaf_count) levels--;
    vi_store(to, vi_set1((int32_t)(node << levels)) + vi_iota());
    const uint32_t count = 1u << levels;
    const size_t first = node << levels, last = first + count - 1;
    if (nodes->floats) __builtin_prefetch(nodes->floats + last);
    else __builtin_prefetch(nodes->packed + first), __builtin_prefetch(nodes->packed + last);
    __builtin_prefetch(nodes->areas + last);
    return count;
}

typedef struct finder {
    const es_micro_job* job;
    es_micro_scratch* s;
    cell here;
    float open;            /* cut / size² */
    uint32_t most, most_near; /* nodes beyond which the cell had better be divided */
    bool full;
} finder;

/* To the world: small nodes from the cut's beginning on, leaves that are near from its end. */
VINL void keep(finder* f, const es_point_tree* tree, const nodes_v* v, vi slot, uint32_t bits, bool near)
{
    es_micro_cut* cut = &f->s->cut;
    if (cut->near - cut->count < VW || cut->count > f->most || ES_MICRO_MAX_CUT - cut->near > f->most_near) {
        f->full = true;
        return;
    }
    float columns[9][VW];
    int32_t words[2][VW];
    for (int k = 0; k < 3; k++) {
        vf_store(columns[k], vf_set1(tree->rotation[k]) * v->c[0] + vf_set1(tree->rotation[3 + k]) * v->c[1] + vf_set1(tree->rotation[6 + k]) * v->c[2] + vf_set1(tree->translation[k]));
        vf_store(columns[3 + k], vf_set1(tree->rotation[k]) * v->axis[0] + vf_set1(tree->rotation[3 + k]) * v->axis[1] + vf_set1(tree->rotation[6 + k]) * v->axis[2]);
    }
    vf_store(columns[6], v->slab);
    vf_store(columns[7], v->sine - vf_set1(GRAZING));
    vf_store(columns[8], v->r);
    vi_store(words[0], v->radiance);
    vi_store(words[1], slot);
    for (; bits; bits &= bits - 1) {
        const uint32_t i = (uint32_t)__builtin_ctz(bits), at = near ? --cut->near : cut->count++;
        for (int k = 0; k < 3; k++) {
            cut->nodes[at].c[k] = columns[k][i];
            cut->nodes[at].axis[k] = columns[3 + k][i];
        }
        cut->nodes[at].slab = columns[6][i];
        cut->nodes[at].sine = columns[7][i];
        cut->nodes[at].r = columns[8][i];
        cut->nodes[at].spread = f->job->forest->area[(uint32_t)words[1][i]] * 0.318309886f;
        cut->radiance[at] = (uint32_t)words[0][i];
        cut->node[at] = (uint32_t)words[1][i];
    }
}

/* From `count` nodes in wave[0] on. `trees`: NULL, or where the opened leaves of the tree of trees go. */
VINL void find_in_tree(finder* f, const es_point_tree* tree, bool quantised, uint32_t count, uint32_t* trees, uint32_t* tree_count)
{
    const es_point_forest* forest = f->job->forest;
    const tree_nodes nodes = nodes_of(forest, tree, quantised);
    uint32_t *wave = f->s->wave[0], *next = f->s->wave[1];
    while (count && !f->full) {
        uint32_t opened_count = 0;
        for (uint32_t i = count; i < (count + 7) / 8 * 8; i++) wave[i] = 1;
        for (uint32_t i = 0; i < count; i += VW) {
            const vi at = vi_load(wave + i);
            const nodes_v v = quantised ? load_quantised(tree, nodes.packed, at) : load_float(nodes.floats, nodes.packed, at);
            vm opened;
            vf excess;
            const vm seen = classify(&f->here, &v, f->open, &opened, &excess) & vm_first((int32_t)(count - i));
            const uint32_t kept = vm_bits(seen & ~opened), leaves = ~vm_bits(vi_gt(vi_set1((int32_t)tree->leaf_count), at));
            const uint32_t open = vm_bits(seen & opened);
            if (kept) keep(f, tree, &v, at + vi_set1((int32_t)tree->first), kept, false);
            uint32_t down = open & ~leaves, left = open & leaves;
            int32_t levels[VW];
            vi_store(levels, levels_down(excess, vf_set1(1.0f)));
            if (opened_count + 8 * VW > 2 * ES_MICRO_MAX_CUT - VW) {
                f->full = true;
                break;
            }
            for (; down; down &= down - 1) {
                const uint32_t k = (uint32_t)__builtin_ctz(down);
                opened_count += descend(&nodes, wave[i + k], levels[k], next + opened_count);
            }
            if (!left) continue;
            if (!trees) keep(f, tree, &v, at + vi_set1((int32_t)tree->first), left, true);
            for (; trees && left; left &= left - 1) {
                const uint32_t index = forest->top_trees[wave[i + (uint32_t)__builtin_ctz(left)] - tree->leaf_count];
                if (index != UINT32_MAX) trees[(*tree_count)++] = index;
            }
        }
        uint32_t* swapped = wave;
        wave = next;
        next = swapped;
        count = opened_count;
    }
}

static void bound_lobes(const es_micro_job* job, uint32_t first, uint32_t count, cell* cell)
{
    es_vec3 sum = es_v3(0, 0, 0);
    cell->least = 3e38f;
    cell->view_cosine = 1.0f;
    for (uint32_t i = 0; i < count; i++) {
        const es_gather_point* point = &job->points[job->order[first + i]];
        const float sharpness = es_micro_sharpness(point), nv = es_micro_view_cosine(point);
        sum = es_v3_add(sum, es_micro_mirror(point));
        cell->least = es_minf(cell->least, sharpness);
        cell->most = es_maxf(cell->most, sharpness);
        cell->view_cosine = es_minf(cell->view_cosine, nv);
    }
    const es_vec3 axis = es_v3_normalize(sum, es_v3(0, 0, 1));
    float cosine = 1.0f;
    for (uint32_t i = 0; i < count; i++) cosine = es_minf(cosine, es_v3_dot(axis, es_micro_mirror(&job->points[job->order[first + i]])));
    cell->mirror[0] = axis.x, cell->mirror[1] = axis.y, cell->mirror[2] = axis.z;
    cell->mirror_cosine = cosine > 0.5f ? cosine : -2.0f;
    cell->mirror_sine = es_sqrt(es_maxf(1.0f - cosine * cosine, 0.0f));
}

/* The points' sphere, cone and slab. */
static cell bound(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_mapping mapping)
{
    cell cell = {.sine = 2.0f, .mapping = mapping};
    float low[3], high[3], sum[3] = {0, 0, 0};
    for (uint32_t i = 0; i < count; i++) {
        const es_gather_point* point = &job->points[job->order[first + i]];
        for (int k = 0; k < 3; k++) {
            low[k] = i ? es_minf(low[k], point->position[k]) : point->position[k];
            high[k] = i ? es_maxf(high[k], point->position[k]) : point->position[k];
            sum[k] += point->normal[k];
        }
    }
    for (int k = 0; k < 3; k++) cell.c[k] = 0.5f * low[k] + 0.5f * high[k];
    const es_vec3 axis = es_v3_normalize(es_v3(sum[0], sum[1], sum[2]), es_v3(0, 0, 1));
    float cosine = 1.0f, square = 0.0f;
    for (uint32_t i = 0; i < count; i++) {
        const es_gather_point* point = &job->points[job->order[first + i]];
        const es_vec3 d = es_v3(point->position[0] - cell.c[0], point->position[1] - cell.c[1], point->position[2] - cell.c[2]);
        square = es_maxf(square, es_v3_dot(d, d));
        cell.slab = es_maxf(cell.slab, es_absf(es_v3_dot(d, axis)));
        cosine = es_minf(cosine, es_v3_dot(axis, es_v3(point->normal[0], point->normal[1], point->normal[2])));
    }
    cell.r = es_sqrt(square);
    if (mapping != ES_MICRO_COSINE) bound_lobes(job, first, count, &cell);
    cell.axis[0] = axis.x, cell.axis[1] = axis.y, cell.axis[2] = axis.z;
    if (cosine > 0.5f) cell.sine = cosine < 1.0f ? es_sqrt(1.0f - cosine * cosine) : 0.0f;
    return cell;
}

static cell turned(const es_point_tree* tree, const cell* world)
{
    cell here = *world;
    for (int k = 0; k < 3; k++) {
        const float* column = tree->rotation + 3 * k;
        here.c[k] = column[0] * (world->c[0] - tree->translation[0]) + column[1] * (world->c[1] - tree->translation[1]) + column[2] * (world->c[2] - tree->translation[2]);
        here.axis[k] = column[0] * world->axis[0] + column[1] * world->axis[1] + column[2] * world->axis[2];
        here.mirror[k] = column[0] * world->mirror[0] + column[1] * world->mirror[1] + column[2] * world->mirror[2];
    }
    return here;
}

/* Nodes to begin with: a run of the scratch's roots. */
typedef struct beginnings { uint32_t begin, end; } beginnings;

/* The next tree of a run and its roots, to the first wave. */
static uint32_t roots_of_tree(es_micro_scratch* s, const beginnings* roots, uint32_t* at, uint32_t* tree)
{
    uint32_t count = 0;
    *tree = s->roots[*at].tree;
    for (; *at < roots->end && s->roots[*at].tree == *tree; (*at)++) s->wave[0][count++] = s->roots[*at].node;
    return count;
}

/* Behind the `first` nodes that the cut holds, from `roots` on, or of all there is when NULL. False: there are more than `most` beyond these, or most_near. */
static bool find_cut(const es_micro_job* job, const cell* world, float open, uint32_t most, uint32_t most_near, const beginnings* roots, uint32_t first, es_micro_scratch* s)
{
    const es_point_forest* forest = job->forest;
    const bool quantised = job->settings.quantised;
    finder f = {.job = job, .s = s, .here = *world, .open = open, .most = first + most, .most_near = most_near};
    uint32_t trees = 0;
    s->cut.count = first;
    s->cut.near = ES_MICRO_MAX_CUT;
    s->wave[0][0] = 1;
    if (!roots && quantised) find_in_tree(&f, &forest->top, true, 1, s->trees, &trees);
    else if (!roots) find_in_tree(&f, &forest->top, false, 1, s->trees, &trees);
    for (uint32_t i = roots ? roots->begin : 0; i < (roots ? roots->end : trees) && !f.full;) {
        uint32_t index, count = 1;
        if (roots) count = roots_of_tree(s, roots, &i, &index);
        else index = s->trees[i++], s->wave[0][0] = 1;
        const es_point_tree* tree = &forest->trees[index];
        f.here = turned(tree, world);
        if (quantised) find_in_tree(&f, tree, true, count, NULL, NULL);
        else find_in_tree(&f, tree, false, count, NULL, NULL);
    }
    return !f.full;
}

#endif
