/* From the samples of a level down to the leaves (gi/micro/point_level.h), eight leaves at a time. */
#include "gi/kernel_table.h"
#include "gi/kernels/lobe_albedo_simd.h"
#include "gi/kernels/surface_simd.h"
#include "raster/pack.h"

/* Lanes past the end are 0. */
VINL vi load_lanes(const void* from, uint32_t lanes)
{
    vi a = vi_zero();
    if (lanes == VW) return vi_load(from);
    memcpy(&a, from, lanes * sizeof(int32_t));
    return a;
}

void ES_KERNEL(es_gi_push_points)(const es_point_push* push, const es_point_forest* f, const es_push_range* range)
{
    const es_point_level* level = push->level;
    const size_t leaf = range->leaves.leaf, node = range->leaves.node;
    const uint32_t begin = range->sample, end = range->sample + range->samples;
    const vf zero = vf_zero(), softening = vf_set1(level->softening[begin]), any = vf_set1(1e-4f);
    for (uint32_t i = 0; i < range->leaves.count; i += VW) {
        const uint32_t lanes = range->leaves.count - i < VW ? range->leaves.count - i : VW;
        const vi word = load_lanes(f->surface + leaf + i, lanes);
        const vm lit = ~vi_eq(vi_shift_right_logical(word, 24), vi_set1(ES_SURFACE_UNLIT));
        if (!vm_any(lit)) continue;
        const vf x = (vf)load_lanes(f->x + leaf + i, lanes), y = (vf)load_lanes(f->y + leaf + i, lanes), z = (vf)load_lanes(f->z + leaf + i, lanes);
        vf nx, ny, nz, sums[3] = {zero, zero, zero}, weights = zero;
        es_unpack_normal_v(load_lanes(f->normal + leaf + i, lanes), &nx, &ny, &nz);
        for (uint32_t s = begin; s < end; s++) {
            const vf dx = x - vf_set1(level->x[s]), dy = y - vf_set1(level->y[s]), dz = z - vf_set1(level->z[s]);
            vf c = vf_max(nx * vf_set1(level->nx[s]) + ny * vf_set1(level->ny[s]) + nz * vf_set1(level->nz[s]), zero);
            /* relative to r², so that scenes of any size have weights that are normal numbers */
            const vf near = softening / (dx * dx + dy * dy + dz * dz + softening);
            c = c * c;
            const vf w = (c * c + any) * (near * near);
            for (int k = 0; k < 3; k++) sums[k] = sums[k] + w * vf_set1(push->values[k][s]);
            weights = weights + (push->areas ? w * vf_set1(push->areas[s]) : w);
        }
        const vf share = vf_and(vm_gt(weights, zero) & lit, vf_set1(0.318309886f) / vf_max(weights, vf_set1(1e-30f)));
        const es_surface_v surface = es_surface_of_gbuffer_v(load_lanes(f->albedo_rg + leaf + i, lanes), load_lanes(f->albedo_b + leaf + i, lanes), word);
        vf albedo[3] = {surface.albedo[0], surface.albedo[1], surface.albedo[2]};
        if (!vm_all(es_surface_word_is_diffuse_v(word))) es_surface_albedo_v(push->lobes, &surface, albedo);
        for (int k = 0; k < 3; k++) {
            vf sent = (vf)load_lanes(f->radiance[k] + node + i, lanes);
            sent = sent + albedo[k] * (sums[k] * share);
            memcpy(f->radiance[k] + node + i, &sent, lanes * sizeof(float));
        }
    }
}
