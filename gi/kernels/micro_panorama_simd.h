/* What a cell of gather points sees in common: a picture of all that is far from it, drawn from its middle once. Points of a block share a traversal in the thesis
 * as well (Ritschel §6.3.1); here they share what comes after it. What is nearer than some of the cell's radii is left to smaller cells, which are parts of it and
 * draw pictures of their own of what they were left, and in the end to each point.
 *
 * A point looks along each of its rays into the pictures. It guesses that what it sees is as far as what it saw by the ray above; where that is, seen from the
 * middle, the picture says how far what is there is, which makes a better guess (Szirmay-Kalos et al. 2005: distance impostors). What a look finds counts if it is
 * about as far as the look was: otherwise it is seen past an edge, from the middle but not from the point. Where the guess finds
 * nothing, the next look is at where what is left out ends, and others are further and further away: what is seen from infinity may be what the ray passes by.
 *
 * The picture is a map of directions (x, y, z), z along the cell's axis, in one chart or two. First the sphere is turned into itself by the conformal map that
 * multiplies tan(θ/2) by k: of a direction of length ρ
 *     x', y' = 2 k x, 2 k y     z' = (ρ + z) - k² (ρ - z)     ρ' = (ρ + z) + k² (ρ - z),     angles grow by 2 k ρ / ρ'
 * for lobes k is large, and about their mirror direction; for points that face different ways it is small, so that all that they see is in front; else 1. What is
 * in front is laid out as (x', y') / (ρ' + |z'| / 2), which is nearly of equal area and goes on, single-valued, to z' = -ρ' / 2; lobes have what is behind in a
 * second chart, of half the size. */
#ifndef EARTHSHINE_GI_MICRO_PANORAMA_SIMD_H
#define EARTHSHINE_GI_MICRO_PANORAMA_SIMD_H

#include "gi/kernels/micro_cut_simd.h"

/* Squared distances, as shares of the extent's square, within [2^-57, 2^6). */
#define DEPTH_BASE ((127 + 6 - 63) << 10)
#define NEAREST 7e-18f
#define FARTHEST 63.0f
#define EMPTY INT32_MAX

VINL vi depth_of(vf square, float inverse_square)
{
    const vf share = vf_min(vf_max(square * vf_set1(inverse_square), vf_set1(NEAREST)), vf_set1(FARTHEST));
    return (vi_shift_right_logical(vi_from_bits(share), 13) - vi_set1(DEPTH_BASE + 32768)) << 16;
}

/* The squared distance of a word, as a share; of an empty one more than any other's. */
VINL vf share_of(vi word) { return vf_from_bits(((word >> 16) + vi_set1(DEPTH_BASE + 32768)) << 13); }

/* How directions in the cell's axes are laid out: chart 0 is of what is in front, 1 of what is behind. */
typedef struct layout {
    float zoom;              /* k; 1: the conformal map is left out */
    bool zoomed;             /* there are two charts */
    float size[2];           /* texels a side, without a border of one texel */
    float scale[2];          /* texels from the charts' unit */
    float column[2], row[2]; /* of their origins, the border included */
    float left[2];           /* first columns, the border's */
} layout;

/* To the charts' units. */
VINL void chart(const layout* l, vf x, vf y, vf z, vf rho, vf* u, vf* v, vm* behind)
{
    vf front = rho + vf_set1(0.5f) * z, k = vf_set1(1.0f);
    *behind = vi_zero();
    if (l->zoomed) {
        const vf near = rho + z, far = vf_set1(l->zoom * l->zoom) * (rho - z), up = near - far;
        *behind = vm_lt(up, vf_zero());
        front = near + far + vf_set1(0.5f) * vf_abs(up);
        k = vf_set1(2.0f * l->zoom);
    }
    const vf f = k / vf_max(front, vf_set1(1e-18f));
    *u = x * f;
    *v = y * f;
}

/* The texel of a direction of length rho, in memory's order; the border's where it lies outside. */
VINL vi texel_of(const layout* l, uint32_t stride, vf x, vf y, vf z, vf rho)
{
    vf u, v;
    vm behind;
    chart(l, x, y, z, rho, &u, &v, &behind);
    vf scale = vf_set1(l->scale[0]), c = vf_set1(l->column[0]), r = vf_set1(l->row[0]), left = vf_zero(), last = vf_set1(l->size[0] + 1.0f);
    if (l->zoomed) {
        scale = vf_select(behind, vf_set1(l->scale[1]), scale);
        c = vf_select(behind, vf_set1(l->column[1]), c);
        r = vf_select(behind, vf_set1(l->row[1]), r);
        left = vf_select(behind, vf_set1(l->left[1]), left);
        last = vf_select(behind, vf_set1(l->size[1] + 1.0f), last);
    }
    const vf column = vf_min(vf_max(u * scale + c, left), left + last), row = vf_min(vf_max(v * scale + r, vf_zero()), last);
    return vi_truncate(vf_floor(row) * vf_set1((float)stride) + column);
}

/* ---- drawing ------------------------------------------------------------------------------------------------------------------------- */

/* How radii and circles about a chart's origin grow, in units of the chart over radians. */
VINL void growth(const layout* l, vf z, vf* across, vf* along)
{
    const vf one = vf_set1(1.0f), half = vf_set1(0.5f);
    vf m = one;
    if (l->zoomed) {
        const vf near = one + z, far = vf_set1(l->zoom * l->zoom) * (one - z), inverse = one / (near + far);
        m = vf_set1(2.0f * l->zoom) * inverse;
        z = vf_abs(near - far) * inverse;
    }
    const vf f = one / (one + half * z);
    *across = m * f;
    *along = m * vf_max(f * f * (z + half), vf_set1(0.2f));
}

/* Eight nodes at a time, a lane each, into those of the four texels around each whose rays a disc of the node's area covers. */
VINL void draw_far(const es_micro_job* job, es_micro_canvas* p, uint32_t stride, const layout* l, uint32_t from, vi slot, vm lanes)
{
    const vf one = vf_set1(1.0f), zero = vf_zero();
    /* other lanes may hold anything, signalling NaNs too */
    const vf dx = vf_and(lanes, vf_load(p->stage[0] + from)), dy = vf_and(lanes, vf_load(p->stage[1] + from)), dz = vf_and(lanes, vf_load(p->stage[2] + from)), size = vf_and(lanes, vf_load(p->stage[3] + from));
    const vf d2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(1e-30f)), inverse = one / vf_sqrt(d2), x = dx * inverse, y = dy * inverse, z = dz * inverse;
    vf u, v, across, along, scale = vf_set1(l->scale[0]), c = vf_set1(l->column[0]), r = vf_set1(l->row[0]), left = zero, last = vf_set1(l->size[0]);
    vm behind;
    chart(l, x, y, z, one, &u, &v, &behind);
    growth(l, z, &across, &along);
    if (l->zoomed) {
        scale = vf_select(behind, vf_set1(l->scale[1]), scale);
        c = vf_select(behind, vf_set1(l->column[1]), c);
        r = vf_select(behind, vf_set1(l->row[1]), r);
        left = vf_select(behind, vf_set1(l->left[1]), left);
        last = vf_select(behind, vf_set1(l->size[1]), last);
    }
    const vf length = vf_max(vf_sqrt(u * u + v * v), vf_set1(1e-12f)), ux = u / length, uy = v / length;
    const vf column = u * scale + c - vf_set1(0.5f), row = v * scale + r - vf_set1(0.5f); /* from texels' middles */
    const vf c0 = vf_floor(column), r0 = vf_floor(row);
    const vm inside = lanes & vm_ge(c0, left) & vm_le(c0, left + last) & vm_ge(r0, zero) & vm_le(r0, last);
    const vf limit = size * (inverse * inverse) * (scale * scale), across2 = one / (across * across), more = one / (along * along) - across2;
    const vi at = vi_truncate(vf_min(vf_max(r0, zero), last) * vf_set1((float)stride) + vf_min(vf_max(c0, left), left + last));
    const vi key = depth_of(d2, job->inverse_square) | slot;
    const vf fx = c0 - column, fy = r0 - row;
    int32_t ats[VW], keys[VW];
    vi_store(ats, at);
    vi_store(keys, key);
    for (uint32_t k = 0; k < 4; k++) {
        const vf ox = k & 1 ? fx + one : fx, oy = k & 2 ? fy + one : fy, radial = ox * ux + oy * uy;
        const vm covered = inside & vm_le((ox * ox + oy * oy) * across2 + radial * radial * more, limit);
        const uint32_t offset = (k & 1) + (k & 2 ? stride : 0);
        for (uint32_t bits = vm_bits(covered); bits; bits &= bits - 1) {
            const uint32_t i = (uint32_t)__builtin_ctz(bits);
            int32_t* word = p->words + stride + (uint32_t)ats[i] + offset;
            *word = keys[i] < *word ? keys[i] : *word;
        }
    }
}

/* The rays through the texels. Of the chart's unit r² = x² + y², z' = (√(4 - 3 r²) - r²) / (2 + r² / 2). */
static void find_rays(es_micro_canvas* p, const layout* l, uint32_t rows, uint32_t stride)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), half = vf_set1(0.5f);
    for (uint32_t row = 0; row < rows; row++)
        for (uint32_t column = 0; column < stride; column += VW) {
            const vf at = vf_iota() + vf_set1((float)column), edge = vf_set1(l->zoomed ? l->left[1] : l->size[0] + 2.0f);
            const vm behind = vm_ge(at, edge) & (l->zoomed ? vm_all_lanes() : vi_zero());
            const vf inverse = vf_select(behind, vf_set1(1.0f / l->scale[1]), vf_set1(1.0f / l->scale[0]));
            const vf u = (at + half - vf_select(behind, vf_set1(l->column[1]), vf_set1(l->column[0]))) * inverse;
            const vf v = (vf_set1((float)row + 0.5f) - vf_select(behind, vf_set1(l->row[1]), vf_set1(l->row[0]))) * inverse;
            const vf r2 = u * u + v * v, root = vf_set1(4.0f) - vf_set1(3.0f) * r2;
            vm there = vm_gt(root, zero);
            vf z = (vf_sqrt(vf_max(root, zero)) - r2) / (vf_set1(2.0f) + half * r2), f = one + half * z;
            if (l->zoomed) { /* back through the conformal map, by 1 / k */
                there = there & vm_ge(z, vf_set1(-0.2f)); /* beyond is in the other chart */
                z = vf_select(behind, vf_neg(z), z);
                const float k2 = l->zoom * l->zoom;
                const vf near = vf_set1(k2) * (one + z), far = one - z, scale = one / (near + far);
                f = f * vf_set1(2.0f * l->zoom) * scale;
                z = (near - far) * scale;
            }
            const uint32_t i = row * stride + column;
            vf_store(p->rays[0] + i, vf_and(there, u * f));
            vf_store(p->rays[1] + i, vf_and(there, v * f));
            vf_store(p->rays[2] + i, vf_and(there, z));
        }
}

/* A leaf that covers more texels, as a disc that the rays meet; in the cell's axes. */
static void cast_far(const es_micro_job* job, es_micro_canvas* p, const layout* l, uint32_t rows, uint32_t stride, const float c[3], const float n[3], float radius, uint32_t slot)
{
    if (!p->has_rays) find_rays(p, l, rows, stride);
    p->has_rays = true;
    const float d2 = es_maxf(c[0] * c[0] + c[1] * c[1] + c[2] * c[2], 1e-30f), inverse = 1.0f / es_sqrt(d2), facing = n[0] * c[0] + n[1] * c[1] + n[2] * c[2];
    const vf limit = vf_set1(-1e-9f), zero = vf_zero();
    if (!(facing < 0.0f)) return;
    uint32_t x0 = 0, x1 = stride / VW - 1, y0 = 0, y1 = rows - 1;
    /* where it is within one chart, and angles grow nearly as at its middle, a window */
    if (radius * inverse * (l->zoomed ? es_maxf(l->zoom, 1.0f) : 1.0f) < 0.4f) {
        vf u, v, across, along;
        vm behind;
        chart(l, vf_set1(c[0] * inverse), vf_set1(c[1] * inverse), vf_set1(c[2] * inverse), vf_set1(1.0f), &u, &v, &behind);
        growth(l, vf_set1(c[2] * inverse), &across, &along);
        const int back = l->zoomed && behind[0];
        const float reach = 1.3f * radius * inverse * across[0], length = es_sqrt(u[0] * u[0] + v[0] * v[0]);
        if (!l->zoomed || length + reach < 0.95f) {
            const float x = u[0] * l->scale[back] + l->column[back], y = v[0] * l->scale[back] + l->row[back], wide = reach * l->scale[back] + 1.0f;
            const float left = x - wide, right = x + wide, up = y - wide, down = y + wide;
            if (right < 0.0f || down < 0.0f) return;
            x0 = left > 0.0f ? (uint32_t)left / VW : 0;
            y0 = up > 0.0f ? (uint32_t)up : 0;
            x1 = right < (float)stride ? (uint32_t)right / VW : x1;
            y1 = down < (float)y1 ? (uint32_t)down : y1;
        }
    }
    const vf nx = vf_set1(n[0]), ny = vf_set1(n[1]), nz = vf_set1(n[2]), cx = vf_set1(c[0]), cy = vf_set1(c[1]), cz = vf_set1(c[2]), square = vf_set1(radius * radius);
    for (uint32_t y = y0; y <= y1; y++)
        for (uint32_t x = x0; x <= x1; x++) {
            const uint32_t at = y * stride + x * VW;
            const vf dx = vf_load(p->rays[0] + at), dy = vf_load(p->rays[1] + at), dz = vf_load(p->rays[2] + at);
            const vf towards = nx * dx + ny * dy + nz * dz, t = vf_set1(facing) / vf_min(towards, limit);
            const vf ex = t * dx - cx, ey = t * dy - cy, ez = t * dz - cz;
            const vm hit = vm_le(ex * ex + ey * ey + ez * ez, square) & vm_lt(towards, limit) & vm_gt(t, zero);
            if (!vm_any(hit)) continue;
            int32_t* words = p->words + stride + at;
            const vi was = vi_load(words), key = depth_of(t * t, job->inverse_square) | vi_set1((int32_t)slot);
            vi_store(words, vi_select(hit & vi_lt(key, was), key, was));
        }
}

/* The largest radius of a node that is drawn, over its distance: of a wider one too much that lies below a point's horizon would be drawn above it where texels are
 * wide, as those that are far from a lobe's direction are. */
#define WIDEST_NODE 0.25f

typedef struct far_finder {
    const es_micro_job* job;
    es_micro_scratch* s;
    layout layout;
    cell here;              /* in the tree's space */
    float axes[3][3];       /* of the layout, in the tree's space */
    float open;             /* square of a node's largest radius in the map's units */
    float near;             /* metres */
    float front, behind;    /* by the charts: 1 / 2 k, over what their texels are larger by */
    uint32_t staged, rows, stride;
    uint32_t root_count, root_end; /* in the scratch's roots */
    bool full;
} far_finder;

static void flush_far(far_finder* f)
{
    es_micro_cut* cut = &f->s->cut;
    const uint32_t first = cut->count - f->staged; /* what is staged has the last places */
    for (uint32_t i = 0; i < f->staged; i += VW)
        draw_far(f->job, &f->s->canvas, f->stride, &f->layout, i, vi_iota() + vi_set1((int32_t)(first + i)), vm_first((int32_t)(f->staged - i)));
    f->staged = 0;
}

/* World middles of nodes that come next in the cut, which their lobes are seen from. */
static void put_middles(const es_point_tree* tree, const vf local[3], uint32_t bits, es_micro_cut* cut)
{
    float c[3][VW];
    for (int k = 0; k < 3; k++)
        vf_store(c[k], vf_set1(tree->rotation[k]) * local[0] + vf_set1(tree->rotation[3 + k]) * local[1] + vf_set1(tree->rotation[6 + k]) * local[2] + vf_set1(tree->translation[k]));
    for (uint32_t at = cut->count; bits; bits &= bits - 1, at++)
        for (int k = 0; k < 3; k++) cut->nodes[at].c[k] = c[k][__builtin_ctz(bits)];
}

/* From the `count` nodes of the first wave on. `trees`: NULL, or where the opened leaves of the tree of trees go. */
VINL void far_in_tree(far_finder* f, const es_point_tree* tree, uint32_t index, bool quantised, uint32_t count, uint32_t* trees, uint32_t* tree_count)
{
    const es_point_forest* forest = f->job->forest;
    const tree_nodes nodes = nodes_of(forest, tree, quantised);
    es_micro_cut* cut = &f->s->cut;
    es_micro_canvas* p = &f->s->canvas;
    const cell* cell = &f->here;
    const vf zero = vf_zero(), one = vf_set1(1.0f), r = vf_set1(cell->r);
    uint32_t *wave = f->s->wave[0], *next = f->s->wave[1];
    while (count && !f->full) {
        uint32_t opened_count = 0;
        for (uint32_t i = count; i < (count + 7) / 8 * 8; i++) wave[i] = 1;
        for (uint32_t i = 0; i < count; i += VW) {
            const vi at = vi_load(wave + i);
            const nodes_v v = quantised ? load_quantised(tree, nodes.packed, at) : load_float(nodes.floats, nodes.packed, at);
            /* as classify() has it */
            const vf dx = v.c[0] - vf_set1(cell->c[0]), dy = v.c[1] - vf_set1(cell->c[1]), dz = v.c[2] - vf_set1(cell->c[2]);
            const vf ax = vf_set1(cell->axis[0]), ay = vf_set1(cell->axis[1]), az = vf_set1(cell->axis[2]);
            const vf d = vf_sqrt(dx * dx + dy * dy + dz * dz), height = ax * dx + ay * dy + az * dz;
            const vm above = vm_gt(height + v.r + vf_set1(cell->slab) + d * vf_set1(cell->sine), zero);
            const vf turn = ax * v.axis[0] + ay * v.axis[1] + az * v.axis[2], off = vf_sqrt(vf_max(one - turn * turn, zero));
            const vf reach = vf_min(vf_set1(cell->slab) * vf_abs(turn) + r * vf_select(vm_lt(off, vf_set1(1e-3f)), zero, off), r);
            const vf facing = v.slab - (v.axis[0] * dx + v.axis[1] * dy + v.axis[2] * dz) + d * (v.sine - vf_set1(GRAZING));
            const vm seen = above & vm_gt(facing + reach, zero) & vm_gt(v.r, zero) & vm_first((int32_t)(count - i));
            if (!vm_any(seen)) continue;
            const vf z = vf_set1(f->axes[2][0]) * dx + vf_set1(f->axes[2][1]) * dy + vf_set1(f->axes[2][2]) * dz;
            /* leaves that some point may lie on are for the points to tell from their own surface */
            const vm leaf = ~vi_gt(vi_set1((int32_t)tree->leaf_count), at), close = vm_lt(d - v.r, vf_set1(f->near)) | (leaf & vm_lt(d, vf_set1(2.0f) * v.r + r));
            /* radius / d times growth(), across */
            vf wide = vf_max(d + vf_set1(0.5f) * z, vf_set1(0.5f) * d);
            if (f->layout.zoomed) {
                vf finest = z;
                /* where it grows most of all that the sphere may cover: the middle of a wide node may be far from where the map is fine. With k² < 3 that is the front
                 * chart's rim, from where it falls to both sides */
                if (f->layout.zoom > 1.0f) {
                    const float k2 = f->layout.zoom * f->layout.zoom, rim = k2 < 3.0f ? (k2 - 1.0f) / (k2 + 1.0f) : 1.0f;
                    const vf inverse = one / vf_max(d, vf_set1(1e-30f)), sphere = vf_min(vf_max(v.r, zero), d) * inverse, sphere_cosine = vf_sqrt(vf_max(one - sphere * sphere, zero));
                    const vf cosine = z * inverse, sine = vf_sqrt(vf_max(one - cosine * cosine, zero));
                    const vf towards = vf_select(vm_ge(cosine, sphere_cosine), one, vf_min(cosine * sphere_cosine + sine * sphere, one));
                    finest = vf_max(z, d * vf_min(towards, vf_set1(rim)));
                }
                const vf near = d + finest, far = vf_set1(f->layout.zoom * f->layout.zoom) * (d - finest), up = near - far;
                wide = near + far + vf_set1(0.5f) * vf_abs(up);
                wide = wide * vf_select(vm_lt(up, zero), vf_set1(f->behind), vf_set1(f->front));
            }
            const vf most = vf_min(vf_set1(f->open) * (wide * wide), vf_set1(WIDEST_NODE * WIDEST_NODE) * d * d), square = v.r * v.r;
            const vm opened = vm_gt(square, most);
            const uint32_t leaves = vm_bits(leaf);
            uint32_t kept = vm_bits(seen & ~opened & ~close), down = vm_bits(seen & (opened | close)), large = trees ? 0 : down & leaves & ~vm_bits(close);
            down &= ~large;
            if (!f->job->settings.ray_cast) kept |= large, large = 0;
            if (kept) {
                if (cut->count + VW > ES_MICRO_MAX_FAR) {
                    f->full = true;
                    break;
                }
                const v_packing packing = v_packing_of(kept);
                const vf inverse = one / vf_max(d, vf_set1(1e-30f));
                vf_store_packed(p->stage[0] + f->staged, vf_set1(f->axes[0][0]) * dx + vf_set1(f->axes[0][1]) * dy + vf_set1(f->axes[0][2]) * dz, packing);
                vf_store_packed(p->stage[1] + f->staged, vf_set1(f->axes[1][0]) * dx + vf_set1(f->axes[1][1]) * dy + vf_set1(f->axes[1][2]) * dz, packing);
                vf_store_packed(p->stage[2] + f->staged, z, packing);
                vf_store_packed(p->stage[3] + f->staged, vf_set1(f->job->settings.cover * 0.318309886f) * vf_gather(nodes.areas, at) * vf_min(vf_max(facing * inverse, vf_set1(0.05f)), one), packing);
                if (forest->lobes) put_middles(tree, v.c, kept, cut);
                vi_store_packed(cut->radiance + cut->count, v.radiance, packing);
                vi_store_packed(cut->node + cut->count, at + vi_set1((int32_t)tree->first), packing);
                f->staged += (uint32_t)__builtin_popcount(kept);
                cut->count += (uint32_t)__builtin_popcount(kept);
                if (f->staged > ES_MICRO_STAGE - VW) flush_far(f);
            }
            if (large && cut->count + VW > ES_MICRO_MAX_FAR) {
                f->full = true;
                break;
            }
            for (; large; large &= large - 1) {
                const uint32_t k = (uint32_t)__builtin_ctz(large), slot = cut->count;
                flush_far(f);
                if (forest->lobes) put_middles(tree, v.c, 1u << k, cut);
                cut->count++;
                float c[3], n[3];
                for (int j = 0; j < 3; j++) {
                    c[j] = f->axes[j][0] * dx[k] + f->axes[j][1] * dy[k] + f->axes[j][2] * dz[k];
                    n[j] = f->axes[j][0] * v.axis[0][k] + f->axes[j][1] * v.axis[1][k] + f->axes[j][2] * v.axis[2][k];
                }
                cut->radiance[slot] = (uint32_t)v.radiance[k];
                cut->node[slot] = tree->first + wave[i + k];
                cast_far(f->job, p, &f->layout, f->rows, f->stride, c, n, v.r[k], slot);
            }
            uint32_t left = down & leaves;
            if (trees) {
                down &= ~leaves;
                for (; left; left &= left - 1) {
                    const uint32_t to = forest->top_trees[wave[i + (uint32_t)__builtin_ctz(left)] - tree->leaf_count];
                    if (to != UINT32_MAX) trees[(*tree_count)++] = to;
                }
            } else { /* to the points themselves: leaves, and what is near as a whole, or small */
                left |= vm_bits(close & (vm_lt(d + v.r, vf_set1(f->near)) | vm_lt(v.r, vf_set1(0.25f * f->near)))) & down;
                down &= ~left;
                for (; left; left &= left - 1) {
                    if (f->root_count >= f->root_end) {
                        f->full = true;
                        return;
                    }
                    f->s->roots[f->root_count].tree = index;
                    f->s->roots[f->root_count++].node = wave[i + (uint32_t)__builtin_ctz(left)];
                }
            }
            if (opened_count + 8 * VW > 2 * ES_MICRO_MAX_CUT - VW) {
                f->full = true;
                break;
            }
            if (!down) continue;
            int32_t levels[VW];
            vi_store(levels, levels_down(square, most));
            for (; down; down &= down - 1) {
                const uint32_t k = (uint32_t)__builtin_ctz(down);
                opened_count += descend(&nodes, wave[i + k], levels[k], next + opened_count);
            }
        }
        uint32_t* swapped = wave;
        wave = next;
        next = swapped;
        count = opened_count;
    }
}

static void turn_axes(const es_point_tree* tree, const float world[3][3], float axes[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) axes[i][k] = tree->rotation[3 * k] * world[i][0] + tree->rotation[3 * k + 1] * world[i][1] + tree->rotation[3 * k + 2] * world[i][2];
}

/* Gaps of one texel are closed as a point's are (without_gaps in kernels/micro.c): by the further of two that lie opposite. */
static void close_gaps(const es_micro_canvas* canvas, es_micro_panorama* p)
{
    const vi empty = vi_set1(EMPTY);
    for (uint32_t at = 0; at < p->rows * p->stride; at += VW) {
        const int32_t* words = canvas->words + p->stride + at;
        vi own = vi_load(words);
        const vm gap = vi_eq(own, empty);
        if (vm_any(gap)) {
            const vi across = vi_max(vi_load(words - 1), vi_load(words + 1)), along = vi_max(vi_load(words - p->stride), vi_load(words + p->stride));
            own = vi_select(gap, vi_min(across, along), own);
        }
        vi_store(p->words + at, own);
    }
}

/* What a cell sees in common. */
typedef struct common {
    const struct common* outer;    /* of the cell that this one is part of; NULL: none */
    uint32_t level;
    layout layout;
    float axes[3][3], middle[3];   /* of the layout, world */
    float near;                    /* metres: what is nearer is left out */
    uint32_t first, end;           /* its nodes in the cut */
    beginnings roots;              /* what is left */
} common;

/* Of what the outer cell left, or of all there is. False: too much is left, or there is too much. */
static bool draw_panorama(const es_micro_job* job, const cell* world, common* c, float open, es_micro_scratch* s)
{
    const es_point_forest* forest = job->forest;
    es_micro_panorama* p = &s->panoramas[c->level];
    const beginnings* outer = c->outer ? &c->outer->roots : NULL;
    const uint32_t begin = outer ? outer->end : 0;
    const bool quantised = job->settings.quantised;
    const layout* l = &c->layout;
    p->rows = (uint32_t)l->size[0] + 2;
    p->stride = (p->rows + (l->zoomed ? (uint32_t)l->size[1] + 2 : 0) + 7) / 8 * 8;
    s->canvas.has_rays = false;
    far_finder f = {.job = job, .s = s, .layout = c->layout, .here = *world, .open = open, .near = es_maxf(job->settings.share, 1.0f) * world->r, .front = 0.5f / l->zoom, .behind = 0.5f / l->zoom * l->scale[0] / l->scale[1], .rows = p->rows, .stride = p->stride, .root_count = begin, .root_end = begin + ES_MICRO_MAX_ROOTS};
    memcpy(f.axes, c->axes, sizeof f.axes);
    uint32_t trees = 0;
    c->near = f.near;
    c->first = s->cut.count = c->outer ? c->outer->end : 0;
    for (uint32_t at = 0; at < p->stride * (p->rows + 2); at += VW) vi_store(s->canvas.words + at, vi_set1(EMPTY));
    s->wave[0][0] = 1;
    if (!outer && quantised) far_in_tree(&f, &forest->top, 0, true, 1, s->trees, &trees);
    else if (!outer) far_in_tree(&f, &forest->top, 0, false, 1, s->trees, &trees);
    for (uint32_t i = outer ? outer->begin : 0; i < (outer ? outer->end : trees) && !f.full;) {
        uint32_t index, count = 1;
        if (outer) count = roots_of_tree(s, outer, &i, &index);
        else index = s->trees[i++], s->wave[0][0] = 1;
        const es_point_tree* tree = &forest->trees[index];
        f.here = turned(tree, world);
        turn_axes(tree, c->axes, f.axes);
        if (quantised) far_in_tree(&f, tree, index, true, count, NULL, NULL);
        else far_in_tree(&f, tree, index, false, count, NULL, NULL);
    }
    if (f.full) return false;
    flush_far(&f);
    c->end = s->cut.count;
    c->roots = (beginnings){begin, f.root_count};
    if (c->end > c->first) close_gaps(&s->canvas, p);
    return true;
}

/* ---- looking ---------------------------------------------------------------------------------------------------------------------------- */

/* From one look that has found nothing to the next, and within which what is found is as far as the look was. */
#define FURTHER 1.5f
#define AS_FAR 1.3f
/* What a cell leaves to its parts ends within so many times its `near`, seen from anywhere in it: of a node that is left the radius is a quarter of that at the most,
 * so that it ends at 3/2, and of the cell no more than that. */
#define LEFT_WITHIN 2.5f

/* The further a point is from the middle, the further apart are the places where a ray may meet something, seen from there: at an eighth of `near`, a few texels.
 * The picture of all there is goes furthest. */
static int looks_of(float offset, float near, bool outermost) { return 2 + (int)es_minf(8.0f * offset / es_maxf(near, 1e-18f) + 0.999f, outermost ? 3.0f : 2.0f); }

/* A point in the cell's axes, from its middle; columns of `turn` are the point's axes there. Looks go from `near` to `far`, metres, `looks` at the most. */
typedef struct onlooker { float offset[3], turn[3][3], near, far; int looks; } onlooker;

/* In rows of 8 n pixels. A row's eights go side by side: the way from a guess to a texel's word and on is one long chain of latencies. */
VINL void look_at_rows(const es_micro_job* job, const es_micro_panorama* p, const layout* l, const onlooker* o, const float* const rays[3], uint32_t n, int32_t* pixels)
{
    const vf zero = vf_zero(), extent = vf_set1(1.0f / es_sqrt(job->inverse_square));
    const vi empty = vi_set1(EMPTY);
    const uint32_t size = job->table->size;
    vf t[4], x[4], y[4], z[4], rho[4];
    vi at[4], word[4];
    vm done[4];
    for (uint32_t i = 0; i < n; i++) t[i] = extent; /* as far as was seen one row above */
    for (uint32_t row = 0; row < size; row++) {
        for (uint32_t i = 0; i < n; i++) {
            const uint32_t k = (row * n + i) * VW;
            const vf a = vf_load(rays[0] + k), b = vf_load(rays[1] + k), c = vf_load(rays[2] + k);
            x[i] = vf_set1(o->turn[0][0]) * a + vf_set1(o->turn[0][1]) * b + vf_set1(o->turn[0][2]) * c;
            y[i] = vf_set1(o->turn[1][0]) * a + vf_set1(o->turn[1][1]) * b + vf_set1(o->turn[1][2]) * c;
            z[i] = vf_set1(o->turn[2][0]) * a + vf_set1(o->turn[2][1]) * b + vf_set1(o->turn[2][2]) * c;
        }
        for (uint32_t i = 0; i < n; i++) {
            word[i] = empty;
            done[i] = ~vm_first((int32_t)size - (int32_t)(i * VW)); /* beyond the row's end */
        }
        float next = o->near;
        for (int look = 0; look < o->looks && (look < 2 || next < o->far * FURTHER); look++, next *= FURTHER) {
            vm all = vm_all_lanes();
            for (uint32_t i = 0; i < n; i++) all = all & done[i];
            if (vm_all(all)) break;
            for (uint32_t i = 0; i < n; i++) {
                if (vm_all(done[i])) continue;
                const vf qx = vf_set1(o->offset[0]) + t[i] * x[i], qy = vf_set1(o->offset[1]) + t[i] * y[i], qz = vf_set1(o->offset[2]) + t[i] * z[i];
                rho[i] = vf_sqrt(qx * qx + qy * qy + qz * qz);
                at[i] = texel_of(l, p->stride, qx, qy, qz, rho[i]);
            }
            for (uint32_t i = 0; i < n; i++) {
                if (vm_all(done[i])) continue;
                const vi found = vi_gather(p->words, at[i]);
                const vf distance = vf_sqrt(share_of(found)) * extent;
                const vm is = ~vi_eq(found, empty), counts = is & vm_lt(distance, vf_set1(AS_FAR) * rho[i]) & vm_gt(distance, vf_set1(1.0f / AS_FAR) * rho[i]);
                const vm better = look ? counts : is; /* the first is but a guess */
                word[i] = vi_select(counts & ~done[i], found, word[i]);
                t[i] = vf_select(done[i], t[i], vf_select(better, vf_max(t[i] + distance - rho[i], zero), vf_set1(next)));
                done[i] = done[i] | counts;
            }
        }
        for (uint32_t i = 0; i < n; i++) {
            int32_t* to = pixels + (row * n + i) * VW;
            t[i] = vf_select(vi_eq(word[i], empty), extent, t[i]);
            const vi key = depth_of(t[i] * t[i], job->inverse_square) | (word[i] & vi_set1(0xffff));
            vi_store(to, vi_min(vi_load(to), vi_select(vi_eq(word[i], empty), empty, key)));
        }
    }
}

VINL void look_at_far(const es_micro_job* job, const es_micro_panorama* p, const layout* l, const onlooker* o, const float* const rays[3], int32_t* pixels)
{
    switch (job->table->stride / VW) {
    case 1: look_at_rows(job, p, l, o, rays, 1, pixels); break;
    case 2: look_at_rows(job, p, l, o, rays, 2, pixels); break;
    case 3: look_at_rows(job, p, l, o, rays, 3, pixels); break;
    default: look_at_rows(job, p, l, o, rays, 4, pixels);
    }
}

#endif
