/* From gathered pixels to all of them, along surfaces (gi/micro/upsample.h). What words of the G-buffer say of gathered pixels is decoded once into lines of a
 * block of columns, and stays there for all rows that lie between two of them. */
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/kernels/surface_simd.h"
#include "gi/lit.h"
#include "gi/micro/upsample.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* Eight pixels of the whole image. */
typedef struct place {
    vm seen;                   /* and have light of the kind */
    vf x, y, z, nx, ny, nz, depth;
    vf alpha, f90, reflectance[3]; /* the last of lobes */
    vi model;
} place;

VINL place place_at(const es_micro_upsample_job* job, bool lobe, vf column, vf row, vi at)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* r = &job->rays;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    place p;
    p.depth = vf_gather(g->depth, at);
    p.seen = vm_gt(p.depth, zero);
    es_surface_v s = es_surface_of_gbuffer_v(vi_gather(g->albedo_rg, at), vi_gather(g->albedo_b, at), vi_gather(g->surface, at));
    const vm phong = vi_eq(s.model, vi_set1(ES_SURFACE_PHONG));
    const vf f0 = vf_max(s.specular[0], vf_max(s.specular[1], s.specular[2]));
    p.model = s.model;
    p.alpha = s.roughness * s.roughness;
    if (lobe) p.seen &= ~vi_eq(s.model, vi_set1(ES_SURFACE_UNLIT)) & vi_select(phong, vm_gt(f0, zero), vm_gt(f0, vf_set1(0.4f) * p.alpha * p.alpha));
    else p.seen &= vm_gt(vf_max(s.albedo[0], vf_max(s.albedo[1], s.albedo[2])), zero);
    es_unpack_normal_v(vi_gather(g->normal, at), &p.nx, &p.ny, &p.nz);
    /* the operations of es_pixel_rays_direction and es_pixel_rays_position */
    vf dx = vf_set1(r->dir[0]) + column * vf_set1(r->dir_dx[0]) + row * vf_set1(r->dir_dy[0]);
    vf dy = vf_set1(r->dir[1]) + column * vf_set1(r->dir_dx[1]) + row * vf_set1(r->dir_dy[1]);
    vf dz = vf_set1(r->dir[2]) + column * vf_set1(r->dir_dx[2]) + row * vf_set1(r->dir_dy[2]);
    p.x = (vf_set1(r->base[0]) + column * vf_set1(r->base_dx[0]) + row * vf_set1(r->base_dy[0])) + p.depth * dx;
    p.y = (vf_set1(r->base[1]) + column * vf_set1(r->base_dx[1]) + row * vf_set1(r->base_dy[1])) + p.depth * dy;
    p.z = (vf_set1(r->base[2]) + column * vf_set1(r->base_dx[2]) + row * vf_set1(r->base_dy[2])) + p.depth * dz;
    p.f90 = vf_select(phong, zero, vf_min(vf_set1(25.0f) * f0, one));
    if (lobe) {
        const vf nv = vf_clamp(vf_neg(p.nx * dx + p.ny * dy + p.nz * dz) / vf_sqrt(dx * dx + dy * dy + dz * dz), zero, one), a = one - nv, a2 = a * a;
        const vf fresnel = vf_and(~phong, a2 * a2 * a);
        for (int k = 0; k < 3; k++) p.reflectance[k] = s.specular[k] + (p.f90 - s.specular[k]) * fresnel + vf_set1(1e-3f);
        p.alpha = vf_select(phong, vf_sqrt(vf_set1(2.0f) / (s.roughness + vf_set1(2.0f))), p.alpha);
    } else {
        for (int k = 0; k < 3; k++) p.reflectance[k] = one;
    }
    return p;
}

/* How much `q` is like `p`, whose plane has the geometric normal (gx, gy, gz). */
VINL vf likeness(bool lobe, const place* p, const place* q, vf gx, vf gy, vf gz, vf per_width)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf t = (gx * (q->x - p->x) + gy * (q->y - p->y) + gz * (q->z - p->z)) * per_width;
    t = vf_min(vf_abs(t), one);
    vf depth = one - t * t;
    vf turn = one - (p->nx * q->nx + p->ny * q->ny + p->nz * q->nz), limit = vf_set1(ES_MICRO_TURN);
    if (lobe) limit = vf_clamp(vf_set1(0.5f) * p->alpha * p->alpha, vf_set1(ES_MICRO_LOBE_TURN), limit);
    vf normal = vf_clamp(vf_set1(2.0f) - turn * (vf_set1(2.0f) / limit), zero, one), material;
    if (lobe) material = vf_and(vi_eq(p->model, q->model), one - vf_set1(4.0f) * vf_abs(p->alpha - q->alpha) / vf_max(vf_max(p->alpha, q->alpha), vf_set1(1e-3f)));
    else material = one - vf_set1(4.0f) * vf_abs(p->f90 - q->f90);
    return vf_and(q->seen, depth * depth * normal * vf_max(material, zero));
}

/* A row of gathered pixels: what place_at says of them, and their light. Those after the last of the image repeat it. */
enum { BLOCK_COLUMNS = 256, LINE = BLOCK_COLUMNS / 2 + 2 * VW, NO_ROW = -1 };
typedef struct line {
    int64_t row;
    float x[LINE], y[LINE], z[LINE], nx[LINE], ny[LINE], nz[LINE], alpha[LINE], f90[LINE], reflectance[3][LINE], model[LINE], seen[LINE], source[3][LINE];
} line;

VINL void decode_line(const es_micro_upsample_job* job, bool lobe, uint32_t first, uint32_t row, line* l)
{
    const int shift = job->spacing == 4 ? 2 : 1;
    const vi last = vi_set1((int32_t)job->sparse_width - 1);
    const uint32_t whole_y = row << shift, count = (BLOCK_COLUMNS >> shift) + VW;
    for (uint32_t i = 0; i < count && first + i < job->sparse_width + VW; i += VW) {
        const vi column = vi_min(vi_set1((int32_t)(first + i)) + vi_iota(), last), whole_x = column << shift;
        const place p = place_at(job, lobe, vf_from_int(whole_x), vf_set1((float)whole_y), vi_set1((int32_t)(whole_y * job->gbuffer->stride)) + whole_x);
        vf_store(l->x + i, p.x);
        vf_store(l->y + i, p.y);
        vf_store(l->z + i, p.z);
        vf_store(l->nx + i, p.nx);
        vf_store(l->ny + i, p.ny);
        vf_store(l->nz + i, p.nz);
        vf_store(l->f90 + i, p.f90);
        vf_store(l->seen + i, vf_from_bits(p.seen));
        const vi at = vi_set1((int32_t)(row * job->sparse_stride)) + column;
        for (int k = 0; k < 3; k++) vf_store(l->source[k] + i, vf_gather(job->source[k], at));
        if (!lobe) continue;
        vf_store(l->alpha + i, p.alpha);
        vf_store(l->model + i, vf_from_bits(p.model));
        for (int k = 0; k < 3; k++) vf_store(l->reflectance[k] + i, p.reflectance[k]);
    }
    l->row = row;
}

VINL place neighbours(const line* l, bool lobe, uint32_t at, uint32_t shift)
{
    place q = {.seen = vi_from_bits(vf_repeat(l->seen + at, shift)), .x = vf_repeat(l->x + at, shift), .y = vf_repeat(l->y + at, shift), .z = vf_repeat(l->z + at, shift), .nx = vf_repeat(l->nx + at, shift),
        .ny = vf_repeat(l->ny + at, shift), .nz = vf_repeat(l->nz + at, shift), .f90 = vf_repeat(l->f90 + at, shift)};
    if (lobe) {
        q.alpha = vf_repeat(l->alpha + at, shift);
        q.model = vi_from_bits(vf_repeat(l->model + at, shift));
        for (int k = 0; k < 3; k++) q.reflectance[k] = vf_repeat(l->reflectance[k] + at, shift);
    }
    return q;
}

/* Columns from `begin`, a multiple of BLOCK_COLUMNS, of a row between two lines. */
VINL void upsample_row(const es_micro_upsample_job* job, bool lobe, uint32_t begin, uint32_t y, const line* upper, const line* lower)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* r = &job->rays;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const uint32_t shift = job->spacing == 4 ? 2 : 1, end = g->width - begin < BLOCK_COLUMNS ? g->width : begin + BLOCK_COLUMNS;
    const line* const lines[2] = {upper, lower};
    const float share = (float)(y & (job->spacing - 1)) / (float)job->spacing;
    /* beyond the last row there is nothing */
    const float row_weight[2] = {1.0f - share, lower != upper ? share : 0.0f};
    const vi last = vi_set1((int32_t)job->sparse_width - 1);
    const float step = es_sqrt(r->dir_dx[0] * r->dir_dx[0] + r->dir_dx[1] * r->dir_dx[1] + r->dir_dx[2] * r->dir_dx[2]);
    const float base_step = es_sqrt(r->base_dx[0] * r->base_dx[0] + r->base_dx[1] * r->base_dx[1] + r->base_dx[2] * r->base_dx[2]);
    uint8_t* lit = job->lit ? job->lit + (size_t)y * es_lit_chunks(g->stride) : NULL;
    for (uint32_t x = begin; x < end; x += VW) {
        const size_t row = (size_t)y * g->stride;
        const vi column = vi_iota() + vi_set1((int32_t)x);
        vf sum[3] = {zero, zero, zero}, weights = zero;
        uint32_t missing = 0;
        const place p = place_at(job, lobe, vf_from_int(column), vf_set1((float)y), vi_set1((int32_t)row) + column);
        const vm wanted = p.seen & vi_lt(column, vi_set1((int32_t)g->width));
        if (vm_any(wanted)) {
            vf gx, gy, gz;
            es_unpack_normal_v(vi_load(g->geometric_normal + row + x), &gx, &gy, &gz);
            const vf width = vf_set1(ES_MICRO_PLANE * (float)job->spacing) * (vf_set1(base_step) + p.depth * vf_set1(step)), per_width = one / vf_max(width, vf_set1(1e-12f));
            const vi left = vi_shift_right_logical(column, (int)shift), offset = column & vi_set1((int32_t)job->spacing - 1);
            const vf column_share = vf_from_int(offset) * vf_set1(1.0f / (float)job->spacing);
            const vf column_weight[2] = {one - column_share, vf_and(vi_lt(left, last), column_share)};
            for (int j = 0; j < 2; j++)
                for (uint32_t i = 0; i < 2; i++) {
                    if (row_weight[j] == 0.0f) continue;
                    const vf bilinear = column_weight[i] * vf_set1(row_weight[j]);
                    const uint32_t at = ((x - begin) >> shift) + i;
                    const place q = neighbours(lines[j], lobe, at, shift);
                    const vf weight = bilinear * likeness(lobe, &p, &q, gx, gy, gz, per_width);
                    weights = weights + weight;
                    for (int k = 0; k < 3; k++) {
                        vf value = vf_repeat(lines[j]->source[k] + at, shift);
                        if (lobe) value = value * (p.reflectance[k] / q.reflectance[k]);
                        sum[k] = sum[k] + weight * value;
                    }
                }
            const vm enough = vm_ge(weights, vf_set1(lobe ? ES_MICRO_LOBE_WEIGHT : ES_MICRO_WEIGHT));
            missing = vm_bits(wanted & ~enough);
            for (int k = 0; k < 3; k++) sum[k] = vf_and(wanted & enough, sum[k] / vf_select(enough, weights, one));
            if (lit) lit[x / ES_LIT_COLUMNS] = 1;
        }
        for (int k = 0; k < 3; k++) vf_store(job->result[k] + row + x, sum[k]);
        job->listed[(size_t)y * ((g->width + 7) / 8) + x / 8] = (uint8_t)missing;
    }
}

VINL void upsample_block(const es_micro_upsample_job* job, bool lobe, uint32_t begin, uint32_t row_begin, uint32_t row_end)
{
    const uint32_t shift = job->spacing == 4 ? 2 : 1, last = job->sparse_height - 1;
    line lines[2];
    lines[0].row = lines[1].row = NO_ROW;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint32_t upper = y >> shift, lower = upper < last ? upper + 1 : last;
        if (lines[upper % 2].row != upper) decode_line(job, lobe, begin >> shift, upper, &lines[upper % 2]);
        /* a row of gathered pixels needs no other */
        if (y & (job->spacing - 1) && lines[lower % 2].row != lower) decode_line(job, lobe, begin >> shift, lower, &lines[lower % 2]);
        upsample_row(job, lobe, begin, y, &lines[upper % 2], &lines[lower % 2]);
    }
}

void ES_KERNEL(es_gi_micro_upsample)(const es_micro_upsample_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    if (job->lit) memset(job->lit + (size_t)row_begin * es_lit_chunks(g->stride), 0, (size_t)(row_end - row_begin) * es_lit_chunks(g->stride));
    for (uint32_t x = 0; x < g->width; x += BLOCK_COLUMNS) {
        if (job->kind == ES_GATHER_LOBE) upsample_block(job, true, x, row_begin, row_end);
        else upsample_block(job, false, x, row_begin, row_end);
    }
}
