/* Vertices to the window: eight at a time, one matrix for transform, projection and viewport.
 *
 * Each gives a snapped record (24.8 fixed point, depth, outcodes), which decides visibility, and a homogeneous record, from which
 * attributes are interpolated. es_clip_triangle repeats this arithmetic in the same order: a vertex shared by a clipped and an
 * unclipped triangle has the same bits in both.
 */
#include "raster/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_transform_vertices)(const float* positions, uint32_t count, const es_window_matrix* matrix, float half_width, float half_height,
    es_snapped_vertex* snapped, es_window_vertex* window)
{
    const float* m = matrix->m;
    vf hw = vf_set1(half_width), hh = vf_set1(half_height), guard = vf_set1(ES_GUARD_BAND), zero = vf_zero(), one = vf_set1(1.0f);
    vf huge = vf_set1(ES_HOMOGENEOUS_MAX), subpixels = vf_set1(ES_SUBPIXELS);
    for (uint32_t i = 0; i < count; i += VW) {
        vf x, y, z, unused;
        vf_load4(positions + 4 * (size_t)i, &x, &y, &z, &unused);
        vf xw = ((vf_set1(m[0]) * x + vf_set1(m[1]) * y) + vf_set1(m[2]) * z) + vf_set1(m[3]);
        vf yw = ((vf_set1(m[4]) * x + vf_set1(m[5]) * y) + vf_set1(m[6]) * z) + vf_set1(m[7]);
        vf zw = ((vf_set1(m[8]) * x + vf_set1(m[9]) * y) + vf_set1(m[10]) * z) + vf_set1(m[11]);
        vf w = ((vf_set1(m[12]) * x + vf_set1(m[13]) * y) + vf_set1(m[14]) * z) + vf_set1(m[15]);
        if (window) vf_store4(&window[i].xw, xw, yw, zw, w);
        vf right = hw * w, bottom = hh * w;
        vm front = vm_le(zw, w) & vm_gt(w, zero);
        /* a NaN or an infinity in any makes a comparison false */
        vm fine = vm_le(vf_abs(xw), huge) & vm_le(vf_abs(yw), huge) & vm_le(vf_abs(zw), huge) & vm_le(vf_abs(w), huge);
        vi flags = (vm_lt(xw, vf_neg(right)) & vi_set1(ES_OUT_LEFT)) | (vm_gt(xw, right) & vi_set1(ES_OUT_RIGHT)) |
                   (vm_lt(yw, vf_neg(bottom)) & vi_set1(ES_OUT_TOP)) | (vm_gt(yw, bottom) & vi_set1(ES_OUT_BOTTOM)) |
                   (vm_lt(zw, zero) & vi_set1(ES_OUT_FAR)) | (~front & vi_set1(ES_OUT_NEAR)) | (~fine & vi_set1(ES_OUT_BAD));
        vf inverse_w = one / vf_select(front, w, one);
        vf px = xw * inverse_w, py = yw * inverse_w;
        vm inside = vm_le(vf_abs(px), guard) & vm_le(vf_abs(py), guard);
        flags |= ~inside & vi_set1(ES_OUT_GUARD);
        vi fx = vi_round(vf_and(inside, px) * subpixels), fy = vi_round(vf_and(inside, py) * subpixels);
        vf depth = vf_min(zw * inverse_w, one);
        vf_store4((float*)&snapped[i], vf_from_bits(fx), vf_from_bits(fy), depth, vf_from_bits(flags));
    }
}

void ES_KERNEL(es_transform_deltas)(const float* positions, const float* previous_positions, uint32_t count, const es_window_matrix* matrix,
    const es_window_matrix* previous_matrix, es_window_vertex* deltas)
{
    for (uint32_t i = 0; i < count; i += VW) {
        vf x, y, z, px, py, pz, unused, d[4];
        vf_load4(positions + 4 * (size_t)i, &x, &y, &z, &unused);
        vf_load4(previous_positions + 4 * (size_t)i, &px, &py, &pz, &unused);
        for (int r = 0; r < 4; r++) {
            const float *m = matrix->m + 4 * r, *p = previous_matrix->m + 4 * r;
            vf now = ((vf_set1(m[0]) * x + vf_set1(m[1]) * y) + vf_set1(m[2]) * z) + vf_set1(m[3]);
            vf then = ((vf_set1(p[0]) * px + vf_set1(p[1]) * py) + vf_set1(p[2]) * pz) + vf_set1(p[3]);
            d[r] = then - now;
        }
        vf_store4(&deltas[i].xw, d[0], d[1], d[2], d[3]);
    }
}
