/* Micro-rendering (Ritschel thesis §6.2.2): the cut of a cell of gather points, then each of them draws it, eight at a time, a lane each.
 *
 * The cut is found level by level with eight nodes at a time, once for the whole cell: a node is opened when some point of the cell would open it, and left
 * out when none can see it. Point by point the cut would be a little smaller; but then every node that is opened is looked at by every point, and the way down
 * the tree is a chain of cache misses and mispredicted branches, which took six times as long.
 *
 * Directions about a lane's normal are projected to the unit disc, on which areas are cosine-weighted solid angles (Nusselt), and the disc is mapped to the
 * square by Shirley and Chiu's concentric map, which keeps areas: so each of size² pixels is worth pi / size².
 *
 * A node whose sphere would cover a pixel more than the cut allows is opened; others are drawn into the pixel that their centre falls on, if they are the
 * nearest there. The measure is the sphere's angle on the disc before foreshortening, (r / d)², against cut / size²: near the horizon pixels are long and
 * narrow, and by their solid angle nodes would be drawn that are wider than the pixel, and leave holes beside it.
 *
 * A pixel's word is signed, so that the nearest is the least: depth << 16 | place, with the depth from the squared distance's own bits, six of the exponent
 * and ten of the fraction: a distance to 1/2048 of itself. */
#include "gi/kernel_table.h"
#include "gi/kernels/surface_simd.h"
#include "gi/micro/gather.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* Squared distances, as shares of the extent's square, within [2^-57, 2^6). */
#define DEPTH_BASE ((127 + 6 - 63) << 10)
#define NEAREST 7e-18f
#define FARTHEST 63.0f
#define EMPTY INT32_MAX
/* Points whose common cut has more nodes are too far from each other to share it. */
enum { LARGE_CUT = 12000 };
/* What is seen at less than this sine sends nothing worth having; and by it a wall does not see itself, whose nodes' axes are off by up to (3 / 62)². */
#define GRAZING 4e-3f

/* ---- the cut ------------------------------------------------------------------------------------------------------------------- */

/* Points of a cell, in a tree's space: their sphere; the cone of their normals, sine 2 when it is too wide to say anything; how far they reach from the plane
 * across its axis. */
typedef struct cell { float c[3], r, axis[3], sine, slab; } cell;

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

/* Which of eight nodes some point of the cell may see, and which of these it opens. */
VINL vm classify(const cell* cell, const nodes_v* v, float open, vm* opened)
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
    *opened = vm_gt(v->r * v->r, vf_set1(open) * (near * near));
    return above & vm_gt(facing, zero) & vm_gt(v->r, zero);
}

typedef struct finder {
    const es_micro_job* job;
    es_micro_scratch* s;
    cell here;
    float open;            /* cut / size² */
    bool full;
} finder;

/* To the world: small nodes from the cut's beginning on, leaves that are near from its end. */
VINL void keep(finder* f, const es_point_tree* tree, const nodes_v* v, vi slot, uint32_t bits, bool near)
{
    es_micro_cut* cut = &f->s->cut;
    if (cut->near - cut->count < VW) {
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
            cut->c[k][at] = columns[k][i];
            cut->axis[k][at] = columns[3 + k][i];
        }
        cut->slab[at] = columns[6][i];
        cut->sine[at] = columns[7][i];
        cut->r[at] = columns[8][i];
        cut->radiance[at] = (uint32_t)words[0][i];
        cut->node[at] = (uint32_t)words[1][i];
    }
}

/* `trees`: NULL, or where the opened leaves of the tree of trees go. */
VINL void find_in_tree(finder* f, const es_point_tree* tree, bool quantised, uint32_t* trees, uint32_t* tree_count)
{
    const es_point_forest* forest = f->job->forest;
    const es_point_node* packed = forest->nodes + tree->first;
    const es_point_node_float* floats = forest->float_nodes + tree->first;
    uint32_t *wave = f->s->wave[0], *next = f->s->wave[1], count = 1;
    wave[0] = 1;
    while (count && !f->full) {
        uint32_t opened_count = 0;
        for (uint32_t i = count; i < (count + 7) / 8 * 8; i++) wave[i] = 1;
        const bool leaves = wave[0] >= tree->leaf_count; /* all of a level are of one kind */
        for (uint32_t i = 0; i < count; i += VW) {
            const vi at = vi_load(wave + i);
            const nodes_v v = quantised ? load_quantised(tree, packed, at) : load_float(floats, packed, at);
            vm opened;
            const vm seen = classify(&f->here, &v, f->open, &opened) & vm_first((int32_t)(count - i));
            const uint32_t kept = vm_bits(seen & ~opened);
            uint32_t down = vm_bits(seen & opened);
            if (kept) keep(f, tree, &v, at + vi_set1((int32_t)tree->first), kept, false);
            if (!leaves) {
                if (opened_count + 2 * VW > 2 * ES_MICRO_MAX_CUT - VW) {
                    f->full = true;
                    break;
                }
                for (; down; down &= down - 1) {
                    const uint32_t node = wave[i + (uint32_t)__builtin_ctz(down)];
                    next[opened_count++] = 2 * node;
                    next[opened_count++] = 2 * node + 1;
                }
            } else if (trees) {
                for (; down; down &= down - 1) {
                    const uint32_t index = forest->top_trees[wave[i + (uint32_t)__builtin_ctz(down)] - tree->leaf_count];
                    if (index != UINT32_MAX) trees[(*tree_count)++] = index;
                }
            } else if (down) {
                keep(f, tree, &v, at + vi_set1((int32_t)tree->first), down, true);
            }
        }
        uint32_t* swapped = wave;
        wave = next;
        next = swapped;
        count = opened_count;
    }
}

/* The points' sphere, cone and slab. */
static cell bound(const es_micro_job* job, uint32_t first, uint32_t count)
{
    cell cell = {.sine = 2.0f};
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
    }
    return here;
}

/* False: there is no room for it. */
static bool find_cut(const es_micro_job* job, const cell* world, float open, es_micro_scratch* s)
{
    const es_point_forest* forest = job->forest;
    finder f = {.job = job, .s = s, .here = *world, .open = open};
    uint32_t trees = 0;
    s->cut.count = 0;
    s->cut.near = ES_MICRO_MAX_CUT;
    if (job->settings.quantised) find_in_tree(&f, &forest->top, true, s->trees, &trees);
    else find_in_tree(&f, &forest->top, false, s->trees, &trees);
    for (uint32_t i = 0; i < trees && !f.full; i++) {
        const es_point_tree* tree = &forest->trees[s->trees[i]];
        f.here = turned(tree, world);
        if (job->settings.quantised) find_in_tree(&f, tree, true, NULL, NULL);
        else find_in_tree(&f, tree, false, NULL, NULL);
    }
    return !f.full;
}

/* ---- the buffers ----------------------------------------------------------------------------------------------------------------- */

typedef struct lanes { vf p[3], t[3], b[3], n[3]; } lanes;

VINL vi depth_of(vf square, float inverse_square)
{
    const vf share = vf_min(vf_max(square * vf_set1(inverse_square), vf_set1(NEAREST)), vf_set1(FARTHEST));
    return (vi_shift_right_logical(vi_from_bits(share), 13) - vi_set1(DEPTH_BASE + 32768)) << 16;
}

/* Disc to square, both about 0 and of half side 1; rho is the length of (a, b). */
VINL void square_of(vf a, vf b, vf rho, vf* u, vf* v)
{
    const vf x = vf_abs(a), y = vf_abs(b), q = vf_min(x, y) / vf_max(vf_max(x, y), vf_set1(1e-30f)), q2 = q * q;
    /* 4 / pi atan q, 7·10^-5 off at most */
    const vf less = rho * vf_min(q * (vf_set1(1.27224016f) + q2 * (vf_set1(-0.40894144f) + q2 * (vf_set1(0.18624514f) + q2 * vf_set1(-0.04964730f)))), vf_set1(1.0f));
    const vm wide = vm_ge(x, y);
    *u = vf_copysign(vf_select(wide, rho, less), a);
    *v = vf_copysign(vf_select(wide, less, rho), b);
}

/* In the order of memory. |u|, |v| may be 1 and a rounding more, which the scale takes back. */
VINL vi pixel_at(const es_micro_table* table, vf u, vf v)
{
    const vf half = vf_set1(0.5f * (float)table->size), scale = vf_set1(0.4999998f * (float)table->size);
    return vi_truncate(vf_floor(v * scale + half) * vf_set1((float)table->stride) + (u * scale + half));
}

/* Nodes [first, end) of the cut, into one pixel each. In three short loops: what the lanes see, where that falls, and the pixels. In one loop the chain of
 * roots and divisions is longer than what a processor keeps in flight. Lanes that do not see a node get EMPTY, which is never nearer. */
static void draw_small(const es_micro_job* job, es_micro_scratch* s, const lanes* here, uint32_t first, uint32_t end)
{
    enum { RUN = 32 };
    const es_micro_table* table = job->table;
    const es_micro_cut* cut = &s->cut;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf across[RUN], along[RUN];
    int32_t at[RUN][VW], key[RUN][VW];
    for (uint32_t begin = first; begin < end; begin += RUN) {
        const uint32_t count = end - begin < RUN ? end - begin : RUN;
        for (uint32_t j = 0; j < count; j++) {
            const uint32_t i = begin + j;
            const vf dx = vf_set1(cut->c[0][i]) - here->p[0], dy = vf_set1(cut->c[1][i]) - here->p[1], dz = vf_set1(cut->c[2][i]) - here->p[2];
            const vf d2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(1e-30f)), d = vf_sqrt(d2), inverse = one / d;
            const vf facing = vf_set1(cut->slab[i]) - (vf_set1(cut->axis[0][i]) * dx + vf_set1(cut->axis[1][i]) * dy + vf_set1(cut->axis[2][i]) * dz) + d * vf_set1(cut->sine[i]);
            const vm seen = vm_gt(here->n[0] * dx + here->n[1] * dy + here->n[2] * dz, d * vf_set1(GRAZING)) & vm_gt(facing, zero);
            across[j] = (here->t[0] * dx + here->t[1] * dy + here->t[2] * dz) * inverse;
            along[j] = (here->b[0] * dx + here->b[1] * dy + here->b[2] * dz) * inverse;
            vi_store(key[j], vi_select(seen, depth_of(d2, job->inverse_square) | vi_set1((int32_t)i), vi_set1(EMPTY)));
        }
        for (uint32_t j = 0; j < count; j++) {
            vf u, v;
            square_of(across[j], along[j], vf_sqrt(across[j] * across[j] + along[j] * along[j]), &u, &v);
            vi_store(at[j], pixel_at(table, u, v));
        }
        for (uint32_t j = 0; j < count; j++)
            for (int k = 0; k < VW; k++) {
                int32_t* pixel = &s->pixels[k][at[j][k]];
                const int32_t was = *pixel, now = key[j][k];
                *pixel = now < was ? now : was;
            }
    }
}

/* The leaf as a disc, met by the rays through the pixels that it may cover: c and n in the lane's own frame. Its projection is no further from its centre's than
 * its radius over its distance, on the disc; on the square no further than 1.63 of that (the map's steepest slope: 4/pi along the circle and 1 across). */
static void cast(const es_micro_job* job, int32_t* pixels, const float c[3], const float n[3], float r, uint32_t place)
{
    const es_micro_table* table = job->table;
    const uint32_t size = table->size;
    const float d2 = c[0] * c[0] + c[1] * c[1] + c[2] * c[2], facing = n[0] * c[0] + n[1] * c[1] + n[2] * c[2], r2 = r * r;
    uint32_t x0 = 0, x1 = table->stride / VW - 1, y0 = 0, y1 = size - 1;
    if (r2 < 0.25f * d2) {
        const float inverse = 1.0f / es_sqrt(d2), a = c[0] * inverse, b = c[1] * inverse, reach = 1.63f * 1.1f * r * inverse;
        vf u, v;
        square_of(vf_set1(a), vf_set1(b), vf_set1(es_sqrt(a * a + b * b)), &u, &v);
        const float half = 0.5f * (float)size;
        const float left = (u[0] - reach + 1.0f) * half - 0.5f, right = (u[0] + reach + 1.0f) * half - 0.5f, up = (v[0] - reach + 1.0f) * half - 0.5f, down = (v[0] + reach + 1.0f) * half - 0.5f;
        x0 = left > 0.0f ? (uint32_t)left / VW : 0;
        y0 = up > 0.0f ? (uint32_t)(up + 0.999f) : 0;
        x1 = right < (float)(size - 1) ? (uint32_t)es_maxf(right, 0.0f) / VW : x1;
        y1 = down < (float)(size - 1) ? (uint32_t)es_maxf(down, 0.0f) : y1;
    }
    const vf nx = vf_set1(n[0]), ny = vf_set1(n[1]), nz = vf_set1(n[2]), cx = vf_set1(c[0]), cy = vf_set1(c[1]), cz = vf_set1(c[2]);
    for (uint32_t y = y0; y <= y1; y++)
        for (uint32_t x = x0; x <= x1; x++) {
            const uint32_t at = y * table->stride + x * VW;
            const vf dx = vf_load(table->x + at), dy = vf_load(table->y + at), dz = vf_load(table->z + at);
            const vf towards = nx * dx + ny * dy + nz * dz, t = vf_set1(facing) / vf_min(towards, vf_set1(-1e-9f));
            const vf ex = t * dx - cx, ey = t * dy - cy, ez = t * dz - cz;
            const vm hit = vm_le(ex * ex + ey * ey + ez * ez, vf_set1(r2)) & vm_lt(towards, vf_set1(-1e-9f)) & vm_gt(t, vf_zero());
            if (!vm_any(hit)) continue;
            const vi was = vi_load(pixels + at), key = depth_of(t * t, job->inverse_square) | vi_set1((int32_t)place);
            vi_store(pixels + at, vi_select(hit & vi_lt(key, was), key, was));
        }
}

/* Leaves that may be too large: point by point. */
static void draw_near(const es_micro_job* job, es_micro_scratch* s, const lanes* here, float open, uint32_t bits)
{
    const es_micro_cut* cut = &s->cut;
    for (uint32_t i = cut->near; i < ES_MICRO_MAX_CUT; i++) {
        const vf dx = vf_set1(cut->c[0][i]) - here->p[0], dy = vf_set1(cut->c[1][i]) - here->p[1], dz = vf_set1(cut->c[2][i]) - here->p[2], r = vf_set1(cut->r[i]);
        const vf ax = vf_set1(cut->axis[0][i]), ay = vf_set1(cut->axis[1][i]), az = vf_set1(cut->axis[2][i]);
        const vf d2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(1e-30f)), z = here->n[0] * dx + here->n[1] * dy + here->n[2] * dz;
        const vf facing = vf_neg(ax * dx + ay * dy + az * dz) - vf_sqrt(d2) * vf_set1(GRAZING);
        const vm seen = vm_gt(z + r, vf_zero()) & vm_gt(facing, vf_zero()), large = vm_gt(r * r, vf_set1(open) * d2);
        uint32_t draw = vm_bits(seen & large) & bits;
        if (vm_any(seen & ~large) || (draw && !job->settings.ray_cast)) draw_small(job, s, here, i, i + 1);
        if (!draw || !job->settings.ray_cast) continue;
        float c[3][VW], n[3][VW];
        vf_store(c[0], here->t[0] * dx + here->t[1] * dy + here->t[2] * dz);
        vf_store(c[1], here->b[0] * dx + here->b[1] * dy + here->b[2] * dz);
        vf_store(c[2], z);
        vf_store(n[0], here->t[0] * ax + here->t[1] * ay + here->t[2] * az);
        vf_store(n[1], here->b[0] * ax + here->b[1] * ay + here->b[2] * az);
        vf_store(n[2], here->n[0] * ax + here->n[1] * ay + here->n[2] * az);
        s->stats.cast += (uint32_t)__builtin_popcount(draw);
        for (; draw; draw &= draw - 1) {
            const uint32_t k = (uint32_t)__builtin_ctz(draw);
            const float centre[3] = {c[0][k], c[1][k], c[2][k]}, normal[3] = {n[0][k], n[1][k], n[2][k]};
            cast(job, s->pixels[k], centre, normal, cut->r[i], i);
        }
    }
}

/* Sum of the buffer's radiance, each pixel less what the interface keeps. */
static void sum_up(const es_micro_job* job, const es_micro_scratch* s, uint32_t lane, float f90, float sums[3])
{
    const es_micro_table* table = job->table;
    vf sum[3] = {vf_zero(), vf_zero(), vf_zero()};
    for (uint32_t at = 0; at < table->stride * table->size; at += VW) {
        const vi word = vi_gather(s->cut.radiance, vi_load(s->pixels[lane] + at) & vi_set1(0xffff));
        vf r, g, b;
        es_unpack_rgb9e5_v(word, &r, &g, &b);
        const vf share = vf_set1(1.0f) - vf_set1(f90) * vf_load(table->interface + at);
        sum[0] = sum[0] + r * share;
        sum[1] = sum[1] + g * share;
        sum[2] = sum[2] + b * share;
    }
    for (int k = 0; k < 3; k++) sums[k] = vf_sum(sum[k]);
}

static lanes frames_of(const es_micro_job* job, uint32_t first, uint32_t count)
{
    lanes here;
    for (uint32_t i = 0; i < VW; i++) {
        const es_gather_point* point = &job->points[job->order[first + (i < count ? i : 0)]];
        const es_vec3 n = es_v3(point->normal[0], point->normal[1], point->normal[2]);
        es_vec3 t, b;
        float sine, cosine;
        es_orthonormal_basis(n, &t, &b);
        es_sincos((float)(point->seed * 2654435769u >> 8) * (6.28318531f / 16777216.0f), &sine, &cosine);
        const es_vec3 across = es_v3_add(es_v3_scale(t, cosine), es_v3_scale(b, sine));
        b = es_v3_sub(es_v3_scale(b, cosine), es_v3_scale(t, sine));
        here.t[0][i] = across.x, here.t[1][i] = across.y, here.t[2][i] = across.z;
        here.b[0][i] = b.x, here.b[1][i] = b.y, here.b[2][i] = b.z;
        for (int k = 0; k < 3; k++) here.p[k][i] = point->position[k], here.n[k][i] = point->normal[k];
    }
    return here;
}

static void gather_eight(const es_micro_job* job, uint32_t first, uint32_t count, float open, es_micro_scratch* s)
{
    const es_micro_table* table = job->table;
    const uint32_t words = table->stride * table->size;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < words; k += VW) vi_store(s->pixels[i] + k, vi_set1(EMPTY));
    const lanes here = frames_of(job, first, count);
    draw_small(job, s, &here, 0, s->cut.count);
    draw_near(job, s, &here, open, count < VW ? (1u << count) - 1 : 0xffu);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t index = job->order[first + i];
        const es_gather_point* point = &job->points[index];
        const float f90 = point->model == ES_SURFACE_PHONG ? 0.0f : es_minf(25.0f * es_maxf(point->f0[0], es_maxf(point->f0[1], point->f0[2])), 1.0f);
        const float nv = es_clampf(point->normal[0] * point->view[0] + point->normal[1] * point->view[1] + point->normal[2] * point->view[2], 0.0f, 1.0f), b = 1.0f - nv, b2 = b * b;
        const float scale = 3.14159265f / (float)(table->size * table->size) * (1.0f - f90 * (0.04f + 0.96f * (b2 * b2 * b)));
        float sums[3];
        sum_up(job, s, i, f90, sums);
        for (int k = 0; k < 3; k++) job->result[k][index] = sums[k] * scale;
    }
    s->stats.samples += (uint64_t)count * table->size * table->size;
}

void ES_KERNEL(es_gi_micro_gather)(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_scratch* s)
{
    float open = job->settings.cut / (float)(job->table->size * job->table->size);
    cell world = bound(job, first, count);
    while (!find_cut(job, &world, open, s) || (s->cut.count > LARGE_CUT && count > VW)) {
        if (count > 1) {
            const uint32_t half = count > VW ? (count / 2 + VW - 1) / VW * VW : count / 2;
            ES_KERNEL(es_gi_micro_gather)(job, first, half, s);
            ES_KERNEL(es_gi_micro_gather)(job, first + half, count - half, s);
            return;
        }
        open *= 4.0f;
    }
    s->cut.radiance[EMPTY & 0xffff] = 0;
    s->stats.drawn += (uint64_t)(s->cut.count + ES_MICRO_MAX_CUT - s->cut.near) * count;
    for (uint32_t i = 0; i < count; i += VW) gather_eight(job, first + i, count - i < VW ? count - i : VW, open, s);
}
