/* Eight points looked up in a light's shadow maps (gi/light_view.h).
 *
 * A shadow-map texel of width s stores one depth; on a surface tilted by the angle a the depth inside a texel varies by s tan a,
 * and a filter k taps wide reaches k/2 texels out. So the receiver is moved towards the light by
 * (constant + slope k/2 tan a) · s, in metres along the view axis, before the comparison.
 */
#ifndef EARTHSHINE_GI_SHADOW_MAP_SIMD_H
#define EARTHSHINE_GI_SHADOW_MAP_SIMD_H

#include "gi/light_view.h"
#include "platform/simd.h"

typedef struct es_shadow_lookup {
    const es_light_view* view;
    int taps;                      /* per side */
    float bias, slope_bias;        /* texels; shares of the filter's half width */
} es_shadow_lookup;

VINL vf es_row_times_v(const float* m, int row, vf x, vf y, vf z)
{
    return vf_set1(m[row]) * x + vf_set1(m[4 + row]) * y + vf_set1(m[8 + row]) * z + vf_set1(m[12 + row]);
}

/* tan a of the cosine between the triangle's normal and the light */
VINL vf es_shadow_slope_v(vf cosine) { return vf_sqrt(vf_max(vf_set1(1.0f) - cosine * cosine, vf_zero())) / vf_max(cosine, vf_set1(0.02f)); }

/* Where eight points fall on a face's map, in texels from its upper left one's middle, moved to the first tap; and the depth they are compared by. */
typedef struct es_shadow_receiver { vf u, v, reference; } es_shadow_receiver;

VINL es_shadow_receiver es_shadow_receiver_v(const es_shadow_lookup* lookup, const es_light_face* face, vf px, vf py, vf pz, vf slope)
{
    const es_light_view* view = lookup->view;
    const float* m = face->world_to_clip.m;
    const uint32_t size = face->shadow_view.width;
    vf one = vf_set1(1.0f), half_size = vf_set1(0.5f * (float)size);
    vf cx = es_row_times_v(m, 0, px, py, pz), cy = es_row_times_v(m, 1, px, py, pz), cz = es_row_times_v(m, 2, px, py, pz), cw = es_row_times_v(m, 3, px, py, pz);
    vf texels = vf_set1(lookup->bias) + vf_set1(lookup->slope_bias * 0.5f * (float)lookup->taps) * slope;
    es_shadow_receiver r;
    if (view->orthographic) {
        /* depth falls by -m_z per metre along the axis */
        float per_metre = face->shadow_view.projection.m[10];
        r.reference = cz + vf_set1(per_metre * view->texel_slope) * texels;
    } else {
        vf distance = vf_max(cw, vf_set1(view->near_plane));
        vf towards = distance - texels * vf_set1(view->texel_slope) * distance;
        r.reference = vf_set1(view->near_plane) / vf_max(towards, vf_set1(view->near_plane));
        vf inverse = one / distance;
        cx = cx * inverse;
        cy = cy * inverse;
    }
    const vf first_tap = vf_set1(0.5f * (float)(lookup->taps - 1)), limit = vf_set1((float)size);
    r.u = vf_min(vf_max((cx + one) * half_size - first_tap, vf_neg(limit)), limit);
    r.v = vf_min(vf_max((one - cy) * half_size - first_tap, vf_neg(limit)), limit);
    return r;
}

/* Share of the filter's weight that is lit. A filter of k taps per side is a box of k - 1 texels slid continuously (bilinear for k = 2):
 * weights 1 - f, 1, …, 1, f along each axis; one tap is the nearest. */
VINL vf es_lit_share_v(const es_light_face* face, const es_shadow_receiver* r, int taps)
{
    const uint32_t size = face->shadow_view.width;
    const vf one = vf_set1(1.0f);
    vf fu = vf_floor(r->u), fv = vf_floor(r->v);
    vi iu = vi_truncate(fu), iv = vi_truncate(fv), last = vi_set1((int32_t)size - 1);
    fu = r->u - fu;
    fv = r->v - fv;
    vf sum = vf_zero();
    /* with t taps the box reaches from tap 0 (weight 1 - f) to tap t - 1 (weight f) */
    for (int y = 0; y < taps; y++) {
        vf wy = taps == 1 ? one : y == 0 ? one - fv : y == taps - 1 ? fv : one;
        vi row = vi_min(vi_max(iv + vi_set1(y), vi_zero()), last) * vi_set1((int32_t)size);
        for (int x = 0; x < taps; x++) {
            vf wx = taps == 1 ? one : x == 0 ? one - fu : x == taps - 1 ? fu : one;
            vi column = vi_min(vi_max(iu + vi_set1(x), vi_zero()), last);
            vf stored = vf_gather(face->shadow_depth, row + column);
            sum = sum + vf_and(vm_ge(r->reference, stored), wx * wy);
        }
    }
    float box = taps == 1 ? 1.0f : (float)(taps - 1);
    return sum * vf_set1(1.0f / (box * box));
}

/* Which cube face a direction belongs to, in the order of es_cube_views. */
VINL vi es_cube_face_v(vf x, vf y, vf z)
{
    vf ax = vf_abs(x), ay = vf_abs(y), az = vf_abs(z);
    vm is_x = vm_ge(ax, ay) & vm_ge(ax, az), is_y = vm_ge(ay, az);
    vf major = vf_select(is_x, x, vf_select(is_y, y, z));
    vi base = vi_select(is_x, vi_zero(), vi_select(is_y, vi_set1(2), vi_set1(4)));
    return base + (vm_lt(major, vf_zero()) & vi_set1(1));
}

/* The share of the light that arrives at points p, whose normal has that cosine with the unit vectors `towards` the light; of lanes without `lanes`
 * nothing is said. */
VINL vf es_shadow_share_v(const es_shadow_lookup* lookup, vm lanes, const vf p[3], const vf towards[3], vf cosine)
{
    const es_light_face* face = lookup->view->faces;
    const int taps = lookup->taps;
    const vf slope = es_shadow_slope_v(cosine);
    if (lookup->view->face_count == 1) {
        const es_shadow_receiver r = es_shadow_receiver_v(lookup, face, p[0], p[1], p[2], slope);
        return taps == 2 ? es_lit_share_v(face, &r, 2) : es_lit_share_v(face, &r, taps);
    }
    const vi which = es_cube_face_v(vf_neg(towards[0]), vf_neg(towards[1]), vf_neg(towards[2]));
    vf share = vf_zero();
    for (int f = 0; f < 6; f++) {
        const vm here = lanes & vi_eq(which, vi_set1(f));
        if (!vm_any(here)) continue;
        const es_shadow_receiver r = es_shadow_receiver_v(lookup, &face[f], p[0], p[1], p[2], slope);
        share = vf_select(here, es_lit_share_v(&face[f], &r, taps), share);
    }
    return share;
}

#endif
