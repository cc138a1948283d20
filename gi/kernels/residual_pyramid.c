/* One level of the pyramid of patches: four of the finer ones each (gi/screen/residual.h). */
#include "gi/kernel_table.h"
#include "gi/kernels/residual_patch_simd.h"
#include "gi/screen/residual.h"

/* A node spans an edge where unit normals come to a mean shorter than this (a turn of about 18 degrees between them), or where a part of it is this
 * many of its widths, the root of its area, off its mean plane or from its middle: patches seen at 80 degrees are six times as long as wide and have their
 * quarters' middles 0.6 widths from theirs. */
#define COHERENCE 0.95f
#define OFF_PLANE 0.25f
#define FAR_OFF 2.0f

typedef struct part { es_patch_v patch; vf sent[3]; vm edge; } part;

VINL part part_of_pixels(const es_residual_layer* layer, float pixel_area, vf column, float row, vf depth, vi normal, vm inside, vf r, vf g, vf b)
{
    part p;
    p.patch = es_patch_of_pixel_v(&layer->rays, pixel_area, layer->back, column, vf_set1(row), depth, normal, inside & vm_gt(depth, vf_zero()));
    const vm there = vm_gt(p.patch.area, vf_zero());
    p.sent[0] = vf_and(there, r) * p.patch.area;
    p.sent[1] = vf_and(there, g) * p.patch.area;
    p.sent[2] = vf_and(there, b) * p.patch.area;
    p.edge = vi_zero();
    return p;
}

static void store_nodes(const part parts[4], uint32_t count, es_residual_node* nodes, float* sent)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf area = zero, x = zero, y = zero, z = zero, nx = zero, ny = zero, nz = zero, s[3] = {zero, zero, zero};
    vm edge = vi_zero();
    for (int i = 0; i < 4; i++) {
        const es_patch_v* p = &parts[i].patch;
        const vf a = p->area;
        area = area + a;
        x = x + a * p->x;
        y = y + a * p->y;
        z = z + a * p->z;
        nx = nx + a * p->nx;
        ny = ny + a * p->ny;
        nz = nz + a * p->nz;
        for (int k = 0; k < 3; k++) s[k] = s[k] + parts[i].sent[k];
        edge = edge | parts[i].edge;
    }
    const vm there = vm_gt(area, zero);
    const vf per_area = one / vf_select(there, area, one);
    x = x * per_area;
    y = y * per_area;
    z = z * per_area;
    nx = nx * per_area;
    ny = ny * per_area;
    nz = nz * per_area;
    const vf length2 = nx * nx + ny * ny + nz * nz, unit = one / vf_sqrt(vf_max(length2, vf_set1(1e-12f)));
    nx = nx * unit;
    ny = ny * unit;
    nz = nz * unit;
    edge = edge | vm_lt(length2, vf_set1(COHERENCE * COHERENCE));
    vf radius = zero;
    for (int i = 0; i < 4; i++) {
        const es_patch_v* p = &parts[i].patch;
        const vf dx = p->x - x, dy = p->y - y, dz = p->z - z, off = dx * nx + dy * ny + dz * nz;
        const vf away2 = dx * dx + dy * dy + dz * dz;
        edge = edge | (vm_gt(p->area, zero) & (vm_gt(off * off, area * vf_set1(OFF_PLANE * OFF_PLANE)) | vm_gt(away2, area * vf_set1(FAR_OFF * FAR_OFF))));
        radius = vf_max(radius, vf_and(vm_gt(p->area, zero), vf_sqrt(away2) + p->radius));
    }
    float geometry[8 * VW], light[4 * VW];
    vf rows[8] = {x, y, z, area, nx, ny, nz, vf_select(edge & there, vf_neg(radius), radius)};
    vf_transpose8(rows);
    for (int i = 0; i < VW; i++) vf_store(geometry + 8 * i, rows[i]);
    vf_store4(light, s[0], s[1], s[2], zero);
    memcpy(nodes, geometry, count * sizeof *nodes);
    memcpy(sent, light, count * 4 * sizeof *sent);
}

static void from_pixels(const es_residual_layer* layer, uint32_t y)
{
    const es_residual_pyramid* p = layer->pyramid;
    const es_gbuffer* g = layer->gbuffer;
    const float pixel_area = es_pixel_area(&layer->rays);
    const vf zero = vf_zero();
    for (uint32_t x = 0; x < p->width[1]; x += VW) {
        part parts[4];
        for (uint32_t j = 0; j < 2; j++) {
            const uint32_t row = 2 * y + j, column = 2 * x;
            const bool inside_rows = row < g->height, both = column + VW < g->stride;
            const size_t at = (size_t)(inside_rows ? row : 0) * g->stride + column;
            vf planes[5][2];
            const float* const from[5] = {g->depth, (const float*)(const void*)g->normal, layer->radiance[0], layer->radiance[1], layer->radiance[2]};
            for (int k = 0; k < 5; k++) vf_deinterleave(vf_load(from[k] + at), both ? vf_load(from[k] + at + VW) : zero, &planes[k][0], &planes[k][1]);
            for (uint32_t i = 0; i < 2; i++) {
                const vi columns = vi_set1((int32_t)(column + i)) + (vi_iota() << 1);
                const vm inside = inside_rows ? vi_lt(columns, vi_set1((int32_t)g->width)) : vi_zero();
                parts[2 * j + i] = part_of_pixels(layer, pixel_area, vf_from_int(columns), (float)row, planes[0][i], vi_from_bits(planes[1][i]), inside, planes[2][i], planes[3][i], planes[4][i]);
            }
        }
        const size_t at = (size_t)y * p->width[1] + x;
        const uint32_t rest = p->width[1] - x;
        store_nodes(parts, rest < VW ? rest : VW, p->nodes[1] + at, p->sent[1] + 4 * at);
    }
}

static void from_nodes(const es_residual_layer* layer, uint32_t level, uint32_t y)
{
    const es_residual_pyramid* p = layer->pyramid;
    const uint32_t width = p->width[level - 1], height = p->height[level - 1];
    for (uint32_t x = 0; x < p->width[level]; x += VW) {
        part parts[4];
        for (uint32_t i = 0; i < 4; i++) {
            const uint32_t row = 2 * y + i / 2;
            const vi column = vi_set1((int32_t)(2 * x + i % 2)) + (vi_iota() << 1);
            const vm inside = row < height ? vi_lt(column, vi_set1((int32_t)width)) : vi_zero();
            const vi at = vi_set1((int32_t)((row < height ? row : 0) * width)) + (inside & column);
            part* q = &parts[i];
            vf radius, unused;
            vf_gather4(p->nodes[level - 1], sizeof(es_residual_node), at, &q->patch.x, &q->patch.y, &q->patch.z, &q->patch.area);
            vf_gather4((const char*)p->nodes[level - 1] + 16, sizeof(es_residual_node), at, &q->patch.nx, &q->patch.ny, &q->patch.nz, &radius);
            vf_gather4(p->sent[level - 1], 16, at, &q->sent[0], &q->sent[1], &q->sent[2], &unused);
            q->patch.area = vf_and(inside, q->patch.area);
            q->patch.radius = vf_abs(radius);
            q->edge = inside & vm_lt(radius, vf_zero());
            for (int k = 0; k < 3; k++) q->sent[k] = vf_and(inside, q->sent[k]);
        }
        const size_t at = (size_t)y * p->width[level] + x;
        const uint32_t rest = p->width[level] - x;
        store_nodes(parts, rest < VW ? rest : VW, p->nodes[level] + at, p->sent[level] + 4 * at);
    }
}

void ES_KERNEL(es_gi_residual_level)(const es_residual_layer* layer, uint32_t level, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++) {
        if (level == 1) from_pixels(layer, y);
        else from_nodes(layer, level, y);
    }
}
