/* Micro-rendering (Ritschel thesis §6.2.2) of a cell of gather points: what is far is drawn once, from the cell's middle (micro_panorama_simd.h); what that leaves
 * goes to parts of the cell, of 16 points, of 4, of one, which do the same; and what is little enough is drawn by each point into pixels of its own, eight points
 * at a time, a lane each, from a cut that they share (micro_cut_simd.h). Then each looks up its rays in the pictures of its cells: a pixel keeps the nearest.
 *
 * Of what points draw for themselves, a node whose sphere would cover a pixel more than the cut allows is opened; others are drawn into the pixel whose ray is
 * nearest, if a disc of their area covers that, or, of lobes, is all but there (NARROW). Of cosine-distributed pixels the measure is the sphere's angle on the disc
 * before foreshortening, (r / d)², against cut / size²: near the horizon pixels are long and narrow, and by their solid angle nodes would be drawn that are wider
 * than the pixel, and leave holes beside it. Of lobes it is that angle times the density.
 *
 * Leaves that are still too large are discs, and met by rays through the pixels that they may cover (on-demand ray casting). Since a pixel keeps the nearest of
 * what comes in any order, they need not wait in a list until the rest is drawn.
 *
 * A pixel's word is signed, so that the nearest is the least: depth << 16 | place in the cut, with the depth from the squared distance's own bits, six of the
 * exponent and ten of the fraction: a distance to 1/2048 of itself. */
#include "gi/kernel_table.h"
#include "gi/kernels/micro_cut_simd.h"
#include "gi/kernels/micro_map_simd.h"
#include "gi/kernels/micro_panorama_simd.h"
#include "gi/kernels/node_lobe_simd.h"
#include "gi/kernels/surface_simd.h"
#include "raster/pack.h"

/* Radii within which a disc is taken for the surface that it lies on, when it faces the same way. */
#define OWN_SURFACE 2.0f

/* Radians from a lobe's ray within which a node may lie that does not cover it: the pixels of lobes are drawn-out, and the shorter their sides the more gaps would be
 * left. */
#define NARROW 0.05f

static int32_t* pixels_of(es_micro_scratch* s, uint32_t lane) { return s->words[lane] + ES_MICRO_MARGIN; }

/* Nodes [first, end) of the cut, into one pixel each. In three short loops: what the lanes see, where that falls, and the pixels. In one loop the chain of
 * roots and divisions is longer than what a processor keeps in flight. Lanes that do not see a node get EMPTY, which is never nearer, and so do those whose
 * pixel's ray is not within the node's area, seen as a disc: otherwise all that is seen would grow by half a pixel, and where pixels are wide, at the horizon and
 * in the tails of lobes, what is low would hide what is above it. */
VINL void draw_small_as(const es_micro_job* job, es_micro_scratch* s, const lanes* here, uint32_t first, uint32_t end, vm wanted, bool lobe)
{
    enum { RUN = 32 };
    const es_micro_table* table = job->table;
    const es_micro_cut* cut = &s->cut;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    /* lanes that are not wanted read the first one's */
    const vi lane_rays = (wanted & vi_iota()) * vi_set1((int32_t)(sizeof s->lobes[0] / sizeof(float)));
    vf across[RUN], along[RUN], up[RUN], area[RUN];
    int32_t at[RUN][VW], key[RUN][VW];
    for (uint32_t begin = first; begin < end; begin += RUN) {
        const uint32_t count = end - begin < RUN ? end - begin : RUN;
        for (uint32_t j = 0; j < count; j++) {
            const uint32_t i = begin + j;
            const vf dx = vf_set1(cut->nodes[i].c[0]) - here->p[0], dy = vf_set1(cut->nodes[i].c[1]) - here->p[1], dz = vf_set1(cut->nodes[i].c[2]) - here->p[2];
            const vf d2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(1e-30f)), d = vf_sqrt(d2), inverse = one / d;
            const vf facing = vf_set1(cut->nodes[i].slab) - (vf_set1(cut->nodes[i].axis[0]) * dx + vf_set1(cut->nodes[i].axis[1]) * dy + vf_set1(cut->nodes[i].axis[2]) * dz) + d * vf_set1(cut->nodes[i].sine);
            const vf z = here->n[0] * dx + here->n[1] * dy + here->n[2] * dz;
            const vm seen = vm_gt(z, d * vf_set1(GRAZING)) & vm_gt(facing, zero) & wanted;
            across[j] = (here->t[0] * dx + here->t[1] * dy + here->t[2] * dz) * inverse;
            along[j] = (here->b[0] * dx + here->b[1] * dy + here->b[2] * dz) * inverse;
            up[j] = (lobe ? here->a[0] * dx + here->a[1] * dy + here->a[2] * dz : z) * inverse;
            area[j] = vf_min(vf_set1(job->settings.cover * cut->nodes[i].spread) * vf_min(vf_max(facing * inverse, vf_set1(0.05f)), one) * (inverse * inverse), vf_set1(64.0f)); /* 4 covers all */
            vi_store(key[j], vi_select(seen, depth_of(d2, job->inverse_square) | vi_set1((int32_t)i), vi_set1(EMPTY)));
        }
        for (uint32_t j = 0; j < count; j++) {
            vf u, v;
            if (lobe) {
                const vi pixel = lobe_pixel(table, here, s, across[j], along[j], up[j]), ray = lane_rays + pixel;
                const vf x = vf_gather(s->lobes[0].at[0], ray) - across[j], y = vf_gather(s->lobes[0].at[1], ray) - along[j], z = vf_gather(s->lobes[0].at[2], ray) - up[j];
                vi_store(at[j], pixel);
                vi_store(key[j], vi_select(vm_le(x * x + y * y + z * z, vf_max(area[j], vf_set1(NARROW * NARROW))), vi_load(key[j]), vi_set1(EMPTY)));
                continue;
            }
            const vf rho = vf_sqrt(across[j] * across[j] + along[j] * along[j]);
            square_of(across[j], along[j], rho, &u, &v);
            vf off_across, off_along;
            vi_store(at[j], pixel_of(table, here, u, v, &off_across, &off_along));
            const vf z2 = up[j] * up[j] + vf_set1(0.25f) * area[j];
            vi_store(key[j], vi_select(vm_le(off_across + off_along * z2, area[j] * z2), vi_load(key[j]), vi_set1(EMPTY)));
        }
        for (uint32_t j = 0; j < count; j++)
            for (int k = 0; k < VW; k++) {
                int32_t* pixel = &s->words[k][ES_MICRO_MARGIN + at[j][k]];
                const int32_t was = *pixel, now = key[j][k];
                *pixel = now < was ? now : was;
            }
    }
}

static void draw_small(const es_micro_job* job, es_micro_scratch* s, const lanes* here, uint32_t first, uint32_t end, vm wanted)
{
    if (here->mapping == ES_MICRO_COSINE) draw_small_as(job, s, here, first, end, wanted, false);
    else draw_small_as(job, s, here, first, end, wanted, true);
}

/* ---- leaves that are near -------------------------------------------------------------------------------------------------------------- */

/* A leaf in a lane's axes. */
typedef struct disc { vf c[3], n[3], facing, square; vi word; } disc;

VINL void cast_chunk(const disc* d, vf dx, vf dy, vf dz, float inverse_square, int32_t* pixels)
{
    const vf towards = d->n[0] * dx + d->n[1] * dy + d->n[2] * dz, t = d->facing / vf_min(towards, vf_set1(-1e-9f));
    const vf ex = t * dx - d->c[0], ey = t * dy - d->c[1], ez = t * dz - d->c[2];
    const vm hit = vm_le(ex * ex + ey * ey + ez * ez, d->square) & vm_lt(towards, vf_set1(-1e-9f)) & vm_gt(t, vf_zero());
    if (!vm_any(hit)) return;
    const vi was = vi_load(pixels), key = depth_of(t * t, inverse_square) | d->word;
    vi_store(pixels, vi_select(hit & vi_lt(key, was), key, was));
}

/* Its projection is no further from its centre's than its radius over its distance, on the disc; on the square no further than 1.63 of that (the map's steepest
 * slope: 4/pi along the circle and 1 across). */
static void cast_cosine(const es_micro_job* job, const es_micro_rays* rays, const disc* d, float r, int32_t* pixels)
{
    const es_micro_table* table = job->table;
    const uint32_t size = table->size;
    const float c[3] = {d->c[0][0], d->c[1][0], d->c[2][0]}, d2 = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
    uint32_t x0 = 0, x1 = table->stride / VW - 1, y0 = 0, y1 = size - 1;
    if (r * r < 0.25f * d2) {
        const float inverse = 1.0f / es_sqrt(d2), a = c[0] * inverse, b = c[1] * inverse, reach = 1.63f * 1.1f * r * inverse, half = 0.5f * (float)size;
        vf u, v;
        square_of(vf_set1(a), vf_set1(b), vf_set1(es_sqrt(a * a + b * b)), &u, &v);
        const float x = u[0] * half + half - 0.5f - rays->shift[0], y = v[0] * half + half - 0.5f - rays->shift[1], wide = reach * half, left = x - wide, right = x + wide, up = y - wide, down = y + wide;
        x0 = left > 0.0f ? (uint32_t)left / VW : 0;
        y0 = up > 0.0f ? (uint32_t)(up + 0.999f) : 0;
        x1 = right < (float)(size - 1) ? (uint32_t)es_maxf(right, 0.0f) / VW : x1;
        y1 = down < (float)(size - 1) ? (uint32_t)es_maxf(down, 0.0f) : y1;
    }
    for (uint32_t y = y0; y <= y1; y++)
        for (uint32_t x = x0; x <= x1; x++) {
            const uint32_t at = y * table->stride + x * VW;
            cast_chunk(d, vf_load(rays->x + at), vf_load(rays->y + at), vf_load(rays->z + at), job->inverse_square, pixels + at);
        }
}

/* Eight rays are left out when their cone and the disc's sphere do not meet. */
static void cast_lobe(const es_micro_job* job, const es_micro_lobe_rays* rays, const disc* d, float r, int32_t* pixels)
{
    const es_micro_table* table = job->table;
    const vf one = vf_set1(1.0f), zero = vf_zero();
    const float d2 = d->c[0][0] * d->c[0][0] + d->c[1][0] * d->c[1][0] + d->c[2][0] * d->c[2][0], inverse = 1.0f / es_sqrt(es_maxf(d2, 1e-30f));
    const float sine = es_minf(r * inverse, 1.0f), cosine = es_sqrt(1.0f - sine * sine);
    const uint32_t chunks = table->stride / VW * table->size;
    for (uint32_t first = 0; first < chunks; first += VW) {
        const vf cone = vf_load(rays->cosine + first), cone_sine = vf_sqrt(vf_max(one - cone * cone, zero));
        const vf between = (vf_load(rays->axis[0] + first) * d->c[0] + vf_load(rays->axis[1] + first) * d->c[1] + vf_load(rays->axis[2] + first) * d->c[2]) * vf_set1(inverse);
        const vf limit = cone * vf_set1(cosine) - cone_sine * vf_set1(sine);
        uint32_t bits = r * inverse >= 1.0f ? 0xffu : vm_bits(vm_ge(between, limit - vf_set1(1e-5f)));
        if (chunks - first < VW) bits &= (1u << (chunks - first)) - 1;
        for (; bits; bits &= bits - 1) {
            const uint32_t at = (first + (uint32_t)__builtin_ctz(bits)) * VW;
            cast_chunk(d, vf_load(rays->at[0] + at), vf_load(rays->at[1] + at), vf_load(rays->at[2] + at), job->inverse_square, pixels + at);
        }
    }
}

static disc disc_in_axes(const es_micro_cut* cut, const lanes* here, uint32_t lane, uint32_t i)
{
    float d[3], c[3] = {0, 0, 0}, n[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) d[k] = cut->nodes[i].c[k] - here->p[k][lane];
    for (int k = 0; k < 3; k++) {
        c[0] += here->t[k][lane] * d[k];
        c[1] += here->b[k][lane] * d[k];
        c[2] += here->a[k][lane] * d[k];
        n[0] += here->t[k][lane] * cut->nodes[i].axis[k];
        n[1] += here->b[k][lane] * cut->nodes[i].axis[k];
        n[2] += here->a[k][lane] * cut->nodes[i].axis[k];
    }
    disc disc = {.facing = vf_set1(n[0] * c[0] + n[1] * c[1] + n[2] * c[2]), .square = vf_set1(cut->nodes[i].r * cut->nodes[i].r), .word = vi_set1((int32_t)i)};
    for (int k = 0; k < 3; k++) {
        disc.c[k] = vf_set1(c[k]);
        disc.n[k] = vf_set1(n[k]);
    }
    return disc;
}

static void draw_near(const es_micro_job* job, es_micro_scratch* s, const lanes* here, const uint32_t jitters[VW], float open, vm wanted)
{
    const es_micro_cut* cut = &s->cut;
    const bool lobe = here->mapping != ES_MICRO_COSINE;
    uint32_t any = 0;
    for (uint32_t i = cut->near; i < ES_MICRO_MAX_CUT; i++) {
        const vf dx = vf_set1(cut->nodes[i].c[0]) - here->p[0], dy = vf_set1(cut->nodes[i].c[1]) - here->p[1], dz = vf_set1(cut->nodes[i].c[2]) - here->p[2], r = vf_set1(cut->nodes[i].r);
        const vf d2 = vf_max(dx * dx + dy * dy + dz * dz, vf_set1(1e-30f)), z = here->n[0] * dx + here->n[1] * dy + here->n[2] * dz;
        const vf facing = vf_neg(vf_set1(cut->nodes[i].axis[0]) * dx + vf_set1(cut->nodes[i].axis[1]) * dy + vf_set1(cut->nodes[i].axis[2]) * dz) - vf_sqrt(d2) * vf_set1(GRAZING);
        /* a disc that the point all but lies on, and that faces as it does, stands for the point's own surface, which bends less than the disc is wide */
        const vf alike = vf_max(here->n[0] * vf_set1(cut->nodes[i].axis[0]) + here->n[1] * vf_set1(cut->nodes[i].axis[1]) + here->n[2] * vf_set1(cut->nodes[i].axis[2]), vf_zero()), own = vf_set1(OWN_SURFACE) * alike * r;
        const vm seen = vm_gt(z + r, vf_zero()) & vm_gt(facing, vf_zero()) & vm_ge(d2, own * own) & wanted;
        vf measure = r * r;
        if (lobe) {
            const vf inverse = vf_set1(1.0f) / vf_sqrt(d2), x = (here->t[0] * dx + here->t[1] * dy + here->t[2] * dz) * inverse, up = (here->a[0] * dx + here->a[1] * dy + here->a[2] * dz) * inverse;
            measure = measure * lane_bound(here, x, up, vf_min(r * inverse, vf_set1(1.0f)));
        }
        const vm large = vm_gt(measure, vf_set1(open) * d2) | vm_gt(r * r, d2);
        const vm met = job->settings.ray_cast ? seen & large : vi_zero();
        const uint32_t cast = vm_bits(met);
        if (vm_any(seen & ~met)) draw_small(job, s, here, i, i + 1, seen & ~met);
        s->cast[i] = (uint8_t)cast;
        any |= cast;
        s->stats.cast += (uint32_t)__builtin_popcount(cast);
    }
    for (; any; any &= any - 1) {
        const uint32_t lane = (uint32_t)__builtin_ctz(any);
        for (uint32_t i = cut->near; i < ES_MICRO_MAX_CUT; i++) {
            if (!(s->cast[i] >> lane & 1)) continue;
            const disc disc = disc_in_axes(cut, here, lane, i);
            if (lobe) cast_lobe(job, &s->lobes[lane], &disc, cut->nodes[i].r, pixels_of(s, lane));
            else cast_cosine(job, &job->table->rays[jitters[lane]], &disc, cut->nodes[i].r, pixels_of(s, lane));
        }
    }
}

/* ---- sums --------------------------------------------------------------------------------------------------------------------------------- */

/* A pixel that nothing fell on, between two that something fell on, is a gap between nodes: it shows what the one of these shows that is further away, as that is
 * seldom in front of anything. Beyond the border is what is within. */
VINL vi without_gaps(const es_micro_table* table, const int32_t* pixels, uint32_t column, uint32_t row)
{
    const uint32_t stride = table->stride, last = table->size - 1;
    pixels += (size_t)row * stride + column;
    const vi own = vi_load(pixels), empty = vi_set1(EMPTY), x = vi_iota() + vi_set1((int32_t)column);
    const vm gap = vi_eq(own, empty);
    if (!vm_any(gap)) return own;
    vi left = vi_load(pixels - 1), right = vi_load(pixels + 1), up = vi_load(row ? pixels - stride : pixels + stride), down = vi_load(row < last ? pixels + stride : pixels - stride);
    left = vi_select(vi_eq(x, vi_zero()), right, left);
    right = vi_select(vi_eq(x, vi_set1((int32_t)last)), left, right);
    const vi across = vi_max(left, right), along = vi_max(up, down);
    return vi_select(gap & ~vi_gt(x, vi_set1((int32_t)last)), vi_min(across, along), own);
}

/* Weights of pixels, in place of the sum's own where a lobe's are not distributed as it is. */
typedef struct unwarped { bool is; es_surface_v surface; vf view[3]; } unwarped;

/* Adds what nodes of the cut send besides, from their middles to a lane's point. */
VINL void add_lobes(const es_micro_job* job, const es_micro_cut* cut, const lanes* here, uint32_t lane, vi place, vf light[3])
{
    const vi node = vi_gather(cut->node, place);
    if (vm_all(vi_eq(vi_gather(job->forest->lobes, node * vi_set1(4)), vi_zero()))) return; /* so it is of most */
    vf c[3], rest;
    vf_gather4(cut->nodes, sizeof *cut->nodes, place, &c[0], &c[1], &c[2], &rest);
    vf d[3], square = vf_set1(1e-30f);
    for (int k = 0; k < 3; k++) {
        d[k] = vf_set1(here->p[k][lane]) - c[k];
        square = square + d[k] * d[k];
    }
    const vf inverse = vf_set1(1.0f) / vf_sqrt(square);
    for (int k = 0; k < 3; k++) d[k] = d[k] * inverse;
    es_node_lobe_add_v(job->forest->lobes, node, d, light);
}

static void sum_up(const es_micro_job* job, es_micro_scratch* s, const es_micro_rays* rays, const lanes* here, uint32_t lane, float f90, const unwarped* lobe, float sums[3])
{
    const es_micro_table* table = job->table;
    const int32_t* pixels = pixels_of(s, lane);
    vf sum[3] = {vf_zero(), vf_zero(), vf_zero()};
    for (uint32_t at = 0; at < table->stride * table->size; at += VW) {
        const vi place = without_gaps(table, pixels, at % table->stride, at / table->stride) & vi_set1(0xffff), word = vi_gather(s->cut.radiance, place);
        vf light[3];
        es_unpack_rgb9e5_v(word, &light[0], &light[1], &light[2]);
        if (job->forest->lobes) add_lobes(job, &s->cut, here, lane, place, light);
        if (lobe->is) {
            vf pass, weight[3];
            const vf zero = vf_zero();
            es_surface_parts_v(&lobe->surface, zero, zero, vf_set1(1.0f), vf_load(rays->x + at), vf_load(rays->y + at), vf_load(rays->z + at), lobe->view[0], lobe->view[1], lobe->view[2], &pass, weight);
            for (int k = 0; k < 3; k++) sum[k] = sum[k] + light[k] * weight[k];
        } else {
            const vf share = vf_set1(1.0f) - vf_set1(f90) * vf_load(rays->interface + at);
            for (int k = 0; k < 3; k++) sum[k] = sum[k] + light[k] * share;
        }
    }
    for (int k = 0; k < 3; k++) sums[k] = vf_sum(sum[k]);
}

static void keep_picture(const es_micro_job* job, es_micro_scratch* s, const es_micro_rays* rays, const lanes* here, uint32_t lane)
{
    const es_micro_table* table = job->table;
    const bool lobe = here->mapping != ES_MICRO_COSINE;
    for (uint32_t y = 0; y < table->size; y++)
        for (uint32_t x = 0; x < table->size; x++) {
            const int32_t word = pixels_of(s, lane)[y * table->stride + x];
            es_micro_pixel* pixel = &job->picture[y * table->size + x];
            *pixel = (es_micro_pixel){.node = UINT32_MAX};
            const uint32_t at = y * table->stride + x;
            const float dx = lobe ? s->lobes[lane].at[0][at] : rays->x[at], dy = lobe ? s->lobes[lane].at[1][at] : rays->y[at], dz = lobe ? s->lobes[lane].at[2][at] : rays->z[at];
            for (int k = 0; k < 3; k++) pixel->direction[k] = here->t[k][lane] * dx + here->b[k][lane] * dy + here->a[k][lane] * dz;
            if (word == EMPTY) continue;
            const vi bits = vi_set1(((word >> 16) + DEPTH_BASE + 32768) << 13);
            vf light[3];
            es_unpack_rgb9e5_v(vi_set1((int32_t)s->cut.radiance[word & 0xffff]), &light[0], &light[1], &light[2]);
            if (job->forest->lobes) add_lobes(job, &s->cut, here, lane, vi_set1(word & 0xffff), light);
            pixel->node = s->cut.node[word & 0xffff];
            pixel->distance = es_sqrt(vf_from_bits(bits)[0] / job->inverse_square);
            for (int k = 0; k < 3; k++) pixel->radiance[k] = light[k][0];
        }
}

/* ---- eight points --------------------------------------------------------------------------------------------------------------------------- */

static lanes lanes_of(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_mapping mapping)
{
    lanes l = {.mapping = mapping};
    for (uint32_t i = 0; i < VW; i++) {
        const es_gather_point* point = &job->points[job->order[first + (i < count ? i : 0)]];
        const es_vec3 n = es_v3(point->normal[0], point->normal[1], point->normal[2]), a = mapping == ES_MICRO_PHONG ? es_micro_mirror(point) : n;
        const float nv = es_micro_view_cosine(point);
        es_vec3 t, b;
        float sine, cosine;
        es_orthonormal_basis(a, &t, &b);
        es_sincos((float)(point->seed * 2654435769u >> 8) * (6.28318531f / 16777216.0f), &sine, &cosine);
        if (mapping == ES_MICRO_COSINE) {
            const es_vec3 across = es_v3_add(es_v3_scale(t, cosine), es_v3_scale(b, sine));
            b = es_v3_sub(es_v3_scale(b, cosine), es_v3_scale(t, sine));
            t = across;
        } else if (mapping == ES_MICRO_GGX) {
            const es_vec3 v = es_v3(point->view[0], point->view[1], point->view[2]);
            t = es_v3_normalize(es_v3_sub(v, es_v3_scale(n, es_v3_dot(n, v))), t);
            b = es_v3_cross(n, t);
        }
        l.turn_cosine[i] = cosine;
        l.turn_sine[i] = sine;
        const float axes[5][3] = {{point->position[0], point->position[1], point->position[2]}, {n.x, n.y, n.z}, {t.x, t.y, t.z}, {b.x, b.y, b.z}, {a.x, a.y, a.z}};
        for (int k = 0; k < 3; k++) {
            l.p[k][i] = axes[0][k];
            l.n[k][i] = axes[1][k];
            l.t[k][i] = axes[2][k];
            l.b[k][i] = axes[3][k];
            l.a[k][i] = axes[4][k];
            l.f0[k][i] = point->f0[k];
        }
        l.normal_t[i] = es_v3_dot(n, t);
        l.normal_b[i] = es_v3_dot(n, b);
        l.normal_a[i] = es_v3_dot(n, a);
        l.f90[i] = point->model == ES_SURFACE_PHONG ? 0.0f : es_minf(25.0f * es_maxf(point->f0[0], es_maxf(point->f0[1], point->f0[2])), 1.0f);
        l.exponent[i] = l.alpha[i] = l.alpha2[i] = 1.0f;
        if (mapping == ES_MICRO_PHONG) l.exponent[i] = es_micro_sharpness(point);
        else l.alpha2[i] = es_micro_sharpness(point);
        l.view_z[i] = nv;
    }
    l.alpha = vf_sqrt(l.alpha2);
    l.view_x = vf_sqrt(vf_max(vf_set1(1.0f) - l.view_z * l.view_z, vf_zero()));
    const vf x = l.alpha * l.view_x, scale = vf_set1(1.0f) / vf_sqrt(x * x + l.view_z * l.view_z);
    l.bent_x = x * scale;
    l.bent_z = l.view_z * scale;
    const vf one = vf_set1(1.0f), side = (one + l.view_x) * (one + l.view_x);
    l.bound = (one - l.alpha2) * side / (side + l.alpha2 * l.view_z * l.view_z);
    l.cap = one + l.bound * l.bent_z;
    return l;
}

/* Of a lobe gathered by cosine-distributed pixels. */
static unwarped unwarped_of(const es_gather_point* point, const lanes* l, uint32_t lane)
{
    unwarped lobe = {.is = point->kind == ES_GATHER_LOBE};
    const es_vec3 v = es_v3(point->view[0], point->view[1], point->view[2]);
    for (int k = 0; k < 3; k++) lobe.surface.specular[k] = vf_set1(point->f0[k]);
    lobe.surface.roughness = vf_set1(point->roughness);
    lobe.surface.model = vi_set1((int32_t)point->model);
    lobe.view[0] = vf_set1(l->t[0][lane] * v.x + l->t[1][lane] * v.y + l->t[2][lane] * v.z);
    lobe.view[1] = vf_set1(l->b[0][lane] * v.x + l->b[1][lane] * v.y + l->b[2][lane] * v.z);
    lobe.view[2] = vf_set1(es_micro_view_cosine(point));
    return lobe;
}

static void look_up(const es_micro_job* job, es_micro_scratch* s, const common* common, const lanes* here, uint32_t lane, const es_micro_rays* rays)
{
    const bool lobe = here->mapping != ES_MICRO_COSINE;
    for (; common; common = common->outer) {
        if (common->end == common->first) continue;
        onlooker o = {.near = common->near, .far = common->outer ? LEFT_WITHIN * common->outer->near : 1.0f / es_sqrt(job->inverse_square)};
        float square = 0.0f;
        for (int i = 0; i < 3; i++) {
            const float* axis = common->axes[i];
            o.offset[i] = o.turn[i][0] = o.turn[i][1] = o.turn[i][2] = 0.0f;
            for (int k = 0; k < 3; k++) {
                o.offset[i] += axis[k] * (here->p[k][lane] - common->middle[k]);
                o.turn[i][0] += axis[k] * here->t[k][lane];
                o.turn[i][1] += axis[k] * here->b[k][lane];
                o.turn[i][2] += axis[k] * here->a[k][lane];
            }
            square += o.offset[i] * o.offset[i];
        }
        o.looks = looks_of(es_sqrt(square), o.near, !common->outer);
        const float* const towards[3] = {lobe ? s->lobes[lane].at[0] : rays->x, lobe ? s->lobes[lane].at[1] : rays->y, lobe ? s->lobes[lane].at[2] : rays->z};
        if (common->layout.zoomed) look_at_far(job, &s->panoramas[common->level], &common->layout, &o, towards, pixels_of(s, lane));
        else {
            layout plain = common->layout;
            plain.zoomed = false;
            look_at_far(job, &s->panoramas[common->level], &plain, &o, towards, pixels_of(s, lane));
        }
    }
}

static void gather_eight(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_mapping mapping, float open, const common* common, es_micro_scratch* s)
{
    const es_micro_table* table = job->table;
    const uint32_t words = table->stride * table->size + 2 * ES_MICRO_MARGIN;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < words; k += VW) vi_store(s->words[i] + k, vi_set1(EMPTY));
    lanes here = lanes_of(job, first, count, mapping);
    uint32_t jitters[VW];
    for (uint32_t i = 0; i < VW; i++) {
        jitters[i] = es_micro_jitter(&job->points[job->order[first + (i < count ? i : 0)]]);
        for (int k = 0; k < 2; k++) here.shift[k][i] = table->rays[jitters[i]].shift[k];
    }
    const uint32_t begin = common ? common->end : 0;
    if (mapping != ES_MICRO_COSINE) {
        tabulate_lobe(table, &here, s);
        for (uint32_t i = 0; i < count; i++) find_lobe_rays(table, &here, i, s);
    }
    if (s->cut.count > begin) draw_small(job, s, &here, begin, s->cut.count, vm_first((int32_t)count));
    if (s->cut.near < ES_MICRO_MAX_CUT) draw_near(job, s, &here, jitters, open, vm_first((int32_t)count));
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t index = job->order[first + i];
        const es_gather_point* point = &job->points[index];
        const unwarped lobe = mapping == ES_MICRO_COSINE ? unwarped_of(point, &here, i) : (unwarped){.is = false};
        const float f90 = point->kind == ES_GATHER_LOBE ? 0.0f : here.f90[i], nv = es_micro_view_cosine(point), b = 1.0f - nv, b2 = b * b, share = 1.0f / (float)(table->size * table->size);
        float sums[3];
        if (common) look_up(job, s, common, &here, i, &table->rays[jitters[i]]);
        sum_up(job, s, &table->rays[jitters[i]], &here, i, f90, &lobe, sums);
        for (int k = 0; k < 3; k++) job->result[k][index] = sums[k] * share * (mapping != ES_MICRO_COSINE ? here.total[k][i] : 3.14159265f * (1.0f - f90 * (0.04f + 0.96f * (b2 * b2 * b))));
    }
    if (job->picture) keep_picture(job, s, &table->rays[jitters[count - 1]], &here, count - 1);
    s->stats.samples += (uint64_t)count * table->size * table->size;
}

/* The zoom with which a panorama's texels in the middle of the sharpest lobe are half as dense a side as that lobe's pixels: size² k² / 4 of them a steradian where
 * there are 2 size texels a side, as to size² times the density, which is `bound` / pi at its largest (lane_bound). With as many, tails would have texels of a
 * third of a radian, in which what lies at the horizon is smeared. */
static float zoom_of(const es_micro_job* job, uint32_t first, uint32_t count)
{
    float most = 1.0f;
    for (uint32_t i = 0; i < count; i++) {
        const es_gather_point* point = &job->points[job->order[first + i]];
        const float sharpness = es_micro_sharpness(point), nv = es_micro_view_cosine(point);
        const float bound = point->model == ES_SURFACE_PHONG ? 0.5f * (sharpness + 1.0f) : 0.5f / ((nv + es_sqrt(sharpness + (1.0f - sharpness) * nv * nv)) * sharpness);
        most = es_maxf(most, 0.5f * es_sqrt(bound * (4.0f / 3.14159265f)));
    }
    return most;
}

/* Cells are divided into parts of PART points, these of FEW_POINTS, these into points. */
enum { PART = 16, FEW_POINTS = 4 };

/* False: the points look too different ways for one panorama. */
static bool lay_out(const es_micro_job* job, uint32_t first, uint32_t count, const cell* world, es_micro_mapping mapping, common* c)
{
    /* few points are not worth many texels; with more of them, more is noise that all have in common */
    const float size = (float)(job->table->size * (count > FEW_POINTS ? 5 : 3) / 2), back = 0.5f * size, half = 0.5f * size;
    const bool lobes = mapping != ES_MICRO_COSINE;
    layout* l = &c->layout;
    *l = (layout){.zoom = 1.0f, .zoomed = lobes || world->sine > 0.5f, .size = {size, back}, .scale = {half, 0.5f * back}, .column = {half + 1.0f, size + 3.0f + 0.5f * back}, .row = {half + 1.0f, 0.5f * back + 1.0f},
        .left = {0.0f, size + 2.0f}};
    if (!l->zoomed) l->scale[0] = half * (1.0f - 0.5f * world->sine) / es_sqrt(1.0f - world->sine * world->sine); /* down to the lowest horizon */
    else if (!lobes) l->zoom = 0.5f; /* what is in front: to 127 degrees */
    if (lobes) {
        const float zoom = zoom_of(job, first, count), cosine = world->mirror_cosine;
        if (cosine < -1.0f) return false;
        /* with k = 1 / tan(β / 2) the density at the border of the mirror directions' cone is highest */
        const float k = es_minf(zoom, es_sqrt((1.0f + cosine) / es_maxf(1.0f - cosine, 1e-6f)));
        if (2.0f * k / ((1.0f + cosine) + k * k * (1.0f - cosine)) < 0.6f * zoom && count > 1) return false;
        l->zoom = k;
    }
    const float* axis = lobes ? world->mirror : world->axis;
    es_vec3 t, b;
    es_orthonormal_basis(es_v3(axis[0], axis[1], axis[2]), &t, &b);
    const float axes[3][3] = {{t.x, t.y, t.z}, {b.x, b.y, b.z}, {axis[0], axis[1], axis[2]}};
    memcpy(c->axes, axes, sizeof axes);
    memcpy(c->middle, world->c, sizeof c->middle);
    return true;
}

/* Nodes that points draw for themselves: more are cheaper drawn by a smaller cell. From so many subtrees on it is not even tried. Without sharing, cells whose
 * points have so many are wide, and had better be divided. */
enum { FEW_NODES = 300, FEW_LEAVES = 300, MANY_ROOTS = 200, LARGE_CUT = 12000, LARGE_NEAR = 1500 };
/* Of a node's sphere that is drawn into a panorama, the largest radius, in texels; above it four texels have holes between them. */
#define LARGEST_NODE 2.0f

/* Is what `outer` left little enough to be drawn by each point? Then it is in the cut. */
static bool is_little(const es_micro_job* job, const cell* world, float open, uint32_t count, const common* outer, es_micro_scratch* s)
{
    s->cut.count = outer->end;
    s->cut.near = ES_MICRO_MAX_CUT;
    const uint32_t roots = outer->roots.end - outer->roots.begin;
    if (roots == 0) return true;
    return count <= PART && roots < MANY_ROOTS && find_cut(job, world, open, FEW_NODES, FEW_LEAVES, &outer->roots, outer->end, s);
}

/* A run of the curve that jumps is not one cell. */
static bool is_compact(const es_micro_job* job, uint32_t first, uint32_t count, const cell* world, es_micro_mapping mapping)
{
    if (count <= FEW_POINTS) return true;
    const cell left = bound(job, first, count / 2, mapping), right = bound(job, first + count / 2, count - count / 2, mapping);
    return left.r + right.r >= 0.9f * world->r;
}

static void gather_cell(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_mapping mapping, const common* outer, uint32_t level, es_micro_scratch* s)
{
    float open = job->settings.cut / (float)(job->table->size * job->table->size);
    const bool shares = job->settings.share > 0.0f;
    const cell world = bound(job, first, count, mapping);
    common own = {.outer = outer, .level = level};
    bool direct = outer && is_little(job, &world, open, count, outer, s);
    if (!direct && shares && level < ES_MICRO_LEVELS && is_compact(job, first, count, &world, mapping) && lay_out(job, first, count, &world, mapping, &own)) {
        const float texel = es_minf(es_sqrt(job->settings.cut), LARGEST_NODE) / own.layout.scale[0];
        if (draw_panorama(job, &world, &own, texel * texel, s)) {
            outer = &own;
            s->stats.drawn += own.end - own.first;
            direct = is_little(job, &world, open, count, outer, s);
        }
    }
    if (!direct && !outer && count <= PART) direct = find_cut(job, &world, open, shares ? FEW_NODES : LARGE_CUT, LARGE_NEAR, NULL, 0, s);
    if (!direct && count > 1) {
        const uint32_t part = count > PART ? PART : count > FEW_POINTS && shares ? FEW_POINTS : count > VW ? VW : 1;
        for (uint32_t i = 0; i < count; i += part) gather_cell(job, first + i, count - i < part ? count - i : part, mapping, outer, level + (outer == &own), s);
        return;
    }
    const uint32_t from = outer ? outer->end : 0;
    if (!direct)
        while (!find_cut(job, &world, open, ES_MICRO_MAX_CUT, ES_MICRO_MAX_CUT, outer ? &outer->roots : NULL, from, s)) open *= 4.0f;
    s->cut.radiance[EMPTY & 0xffff] = 0;
    s->cut.node[EMPTY & 0xffff] = 0; /* where nothing is, which has no lobe */
    s->cut.nodes[EMPTY & 0xffff] = (es_micro_node){{0}};
    s->stats.drawn += (uint64_t)(s->cut.count - from + ES_MICRO_MAX_CUT - s->cut.near) * count;
    for (uint32_t i = 0; i < count; i += VW) gather_eight(job, first + i, count - i < VW ? count - i : VW, mapping, open, outer, s);
}

void ES_KERNEL(es_gi_micro_gather)(const es_micro_job* job, uint32_t first, uint32_t count, es_micro_scratch* s)
{
    const es_micro_mapping mapping = es_micro_mapping_of(&job->points[job->order[first]], &job->settings);
    gather_cell(job, first, count, mapping, NULL, 0, s);
}
