/* Where a pixel lies in regions of edited reflections (gi/edit/edit.h), and how far from their constraints. */
#ifndef EARTHSHINE_GI_EDIT_INFLUENCE_SIMD_H
#define EARTHSHINE_GI_EDIT_INFLUENCE_SIMD_H

#include "gi/edit/edit.h"
#include "platform/simd.h"

/* On a triangle of the mesh, in some lanes: its corners, what each counts for, and what the distance between them is short of by theirs. */
typedef struct es_edit_place_v { vm lanes; vi corner[3]; vf share[3], sag; } es_edit_place_v;

VINL vf es_edit_square_v(const vf a[3], const vf b[3])
{
    const vf x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

/* `triangle`: of the mesh, any where lanes are unset. */
VINL es_edit_place_v es_edit_place_of_v(const es_edit_mesh* mesh, vm lanes, vi triangle, const vf p[3])
{
    es_edit_place_v place = {.lanes = lanes};
    const vi at = (lanes & triangle) * vi_set1(3);
    vf v[3][3];
    const float* t = mesh->transform.m;
    for (int i = 0; i < 3; i++) {
        vf x, y, z, w;
        place.corner[i] = vi_gather(mesh->indices, at + vi_set1(i));
        vf_gather4(mesh->positions, 16, place.corner[i], &x, &y, &z, &w);
        for (int k = 0; k < 3; k++) v[i][k] = vf_set1(t[k]) * x + vf_set1(t[4 + k]) * y + vf_set1(t[8 + k]) * z + vf_set1(t[12 + k]);
    }
    vf e1[3], e2[3], q[3];
    for (int k = 0; k < 3; k++) {
        e1[k] = v[1][k] - v[0][k];
        e2[k] = v[2][k] - v[0][k];
        q[k] = p[k] - v[0][k];
    }
    const vf d11 = e1[0] * e1[0] + e1[1] * e1[1] + e1[2] * e1[2], d12 = e1[0] * e2[0] + e1[1] * e2[1] + e1[2] * e2[2], d22 = e2[0] * e2[0] + e2[1] * e2[1] + e2[2] * e2[2];
    const vf q1 = q[0] * e1[0] + q[1] * e1[1] + q[2] * e1[2], q2 = q[0] * e2[0] + q[1] * e2[1] + q[2] * e2[2];
    const vf area = d11 * d22 - d12 * d12;
    const vm some = vm_gt(area, vf_set1(1e-30f));
    const vf per = vf_and(some, vf_set1(1.0f) / vf_max(area, vf_set1(1e-30f))), zero = vf_zero(), one = vf_set1(1.0f);
    /* the pixel's centre is on the triangle but for rounding */
    const vf u = vf_clamp((d22 * q1 - d12 * q2) * per, zero, one), w = vf_min(vf_max((d11 * q2 - d12 * q1) * per, zero), one - u);
    place.share[0] = one - u - w;
    place.share[1] = u;
    place.share[2] = w;
    place.sag = place.share[0] * u * d11 + place.share[0] * w * d22 + u * w * es_edit_square_v(v[1], v[2]);
    return place;
}

/* Squared, from the distances d_i of the corners: sum of b_i d_i² - sum of b_i b_j |v_i - v_j|², which is exact on a plane and the same from both sides of an edge. Where one
 * is infinite, so is it. */
VINL vf es_edit_geodesic_square_v(const es_edit_place_v* place, const float* distances)
{
    vf sum = vf_zero();
    vm reached = vm_all_lanes();
    for (int i = 0; i < 3; i++) {
        const vf d = vf_min(vf_gather(distances, place->corner[i]), vf_set1(1e15f));
        reached = reached & vm_lt(d, vf_set1(1e15f));
        sum = sum + place->share[i] * d * d;
    }
    return vf_select(reached, vf_max(sum - place->sag, vf_zero()), vf_set1(1e30f));
}

/* 1 - smoothstep; `inside` is how far within the border's inner edge, in borders: 0 or less at the outer one, 1 or more at the inner one */
VINL vf es_edit_smooth_v(vf inside)
{
    const vf t = vf_clamp(inside, vf_zero(), vf_set1(1.0f));
    return t * t * (vf_set1(3.0f) - vf_set1(2.0f) * t);
}

VINL vf es_edit_strokes_v(const es_edit_region* region, const vf p[3])
{
    vf d = vf_set1(1e15f);
    for (uint32_t i = 0; i < region->stroke_count; i++) {
        const es_edit_stroke* s = &region->strokes[i];
        const float along[3] = {s->to[0] - s->from[0], s->to[1] - s->from[1], s->to[2] - s->from[2]};
        const float square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2], per = square > 1e-30f ? 1.0f / square : 0.0f;
        vf q[3], rest = vf_zero(), t = vf_zero();
        for (int k = 0; k < 3; k++) {
            q[k] = p[k] - vf_set1(s->from[k]);
            t = t + q[k] * vf_set1(along[k]);
        }
        t = vf_clamp(t * vf_set1(per), vf_zero(), vf_set1(1.0f));
        for (int k = 0; k < 3; k++) {
            const vf off = q[k] - t * vf_set1(along[k]);
            rest = rest + off * off;
        }
        const vf distance = vf_sqrt(rest), radius = vf_set1(s->radius);
        d = s->erases ? vf_max(d, radius - distance) : vf_min(d, distance - radius);
    }
    return d;
}

/* a, 0 … 1. place: looked at by geodesic regions. */
VINL vf es_edit_influence_v(const es_edit_region* region, vm lanes, const vf p[3], const es_edit_place_v* place)
{
    /* metres within the outer edge */
    vf inside;
    if (region->shape == ES_EDIT_STROKES) inside = vf_neg(es_edit_strokes_v(region, p));
    else {
        const vf centre[3] = {vf_set1(region->centre[0]), vf_set1(region->centre[1]), vf_set1(region->centre[2])};
        const vf square = region->shape == ES_EDIT_GEODESIC ? vf_select(place->lanes, es_edit_geodesic_square_v(place, region->distances), vf_set1(1e30f)) : es_edit_square_v(p, centre);
        inside = vf_set1(region->radius) - vf_sqrt(square);
    }
    const vf border = vf_set1(region->border > 1e-12f ? region->border : 1e-12f);
    return vf_and(lanes, es_edit_smooth_v(inside / border));
}

#endif
