/* Are points near eight pixels' surfaces below another surface that a view shows? (Ritschel thesis §4.2.1, gi/screen/view_stack.h.)
 *
 * A point at the depth h falls on a pixel that shows a surface at depth d, at the place q of that pixel's middle. It is below that surface if d < h, and the
 * surface then stands between it and the eye, above the tangent plane of the pixel's own surface if the point is. As q is not exactly where the point falls,
 * this is asked for by itself:
 *     n · (q - p) > ES_SCREEN_RISE |q - p|,
 * p and n being the pixel's place and its triangle's normal. On a plane, however oblique, q - p is at right angles to n whatever pixel it is: no bias in
 * depth is needed, and none could do for all slopes. What rises by less is not seen to occlude.
 *
 * With q - p = (d - D) v + s (x b_x + y b_y), v being the ray of p's pixel, D its depth, x and y whole columns and rows from there, b a step of the rays and
 * s the depth d (perspective) or 1 (orthographic), both sides are polynomials of d - D, s x and s y whose coefficients hold for all points of the pixel. */
#ifndef EARTHSHINE_GI_SCREEN_TEST_SIMD_H
#define EARTHSHINE_GI_SCREEN_TEST_SIMD_H

#include "gi/screen/view_stack.h"
#include "platform/simd.h"

#define ES_SCREEN_RISE 0.02f
/* Of the radius, beyond which an occluder begins to fade: shares squared. */
#define ES_SCREEN_FADE2 0.81f

/* Eight pixels' surfaces as a view sees them, or would. */
typedef struct es_screen_pixel_v {
    vf x, y, depth;
    vf nv, nx, ny;       /* n · v, n · b_x, n · b_y */
    vf vv, vx, vy;       /* v · v, 2 v · b_x, 2 v · b_y */
} es_screen_pixel_v;

VINL vf es_screen_row_times_v(const float row[4], const vf p[3]) { return vf_set1(row[0]) * p[0] + vf_set1(row[1]) * p[1] + vf_set1(row[2]) * p[2]; }

/* At column x and row y, whole or not, at a depth above 0. */
VINL es_screen_pixel_v es_screen_pixel_of_v(const es_screen_view* view, vf x, vf y, vf depth, const vf n[3])
{
    const es_pixel_rays* r = &view->rays;
    const float *bx = r->orthographic ? r->base_dx : r->dir_dx, *by = r->orthographic ? r->base_dy : r->dir_dy;
    es_screen_pixel_v s = {.x = x, .y = y, .depth = depth, .nv = vf_zero(), .nx = vf_zero(), .ny = vf_zero(), .vv = vf_zero(), .vx = vf_zero(), .vy = vf_zero()};
    for (int k = 0; k < 3; k++) {
        const vf v = vf_set1(r->dir[k]) + x * vf_set1(r->dir_dx[k]) + y * vf_set1(r->dir_dy[k]), two_v = v + v;
        s.nv = s.nv + n[k] * v;
        s.nx = s.nx + n[k] * vf_set1(bx[k]);
        s.ny = s.ny + n[k] * vf_set1(by[k]);
        s.vv = s.vv + v * v;
        s.vx = s.vx + two_v * vf_set1(bx[k]);
        s.vy = s.vy + two_v * vf_set1(by[k]);
    }
    return s;
}

/* The pixel that a point falls on, which is `offset` from the surface: (columns, rows, depth) by the view's to_x, to_y and to_depth without their fourth numbers. */
typedef struct es_screen_place_v { vm inside; vi at; vf x, y, depth; } es_screen_place_v; /* x, y: from the pixel's own */
VINL es_screen_place_v es_screen_place_of_v(const es_screen_view* view, const es_screen_pixel_v* p, const vf offset[3])
{
    const vf least = vf_set1(1e-20f), half = vf_set1(0.5f), last_x = vf_set1((float)view->width - 0.5f), last_y = vf_set1((float)view->height - 0.5f);
    es_screen_place_v s;
    s.depth = p->depth + offset[2];
    vf x = offset[0], y = offset[1];
    if (!view->rays.orthographic) {
        const vf inverse = vf_set1(1.0f) / vf_max(s.depth, least);
        x = (x - p->x * offset[2]) * inverse;
        y = (y - p->y * offset[2]) * inverse;
    }
    x = x + p->x;
    y = y + p->y;
    s.inside = vm_gt(s.depth, least) & vm_gt(x, vf_neg(half)) & vm_lt(x, last_x) & vm_gt(y, vf_neg(half)) & vm_lt(y, last_y);
    const vi column = vi_truncate(vf_and(s.inside, x + half)), row = vi_truncate(vf_and(s.inside, y + half));
    s.at = row * vi_set1((int32_t)view->stride) + column;
    s.x = vf_from_int(column) - p->x;
    s.y = vf_from_int(row) - p->y;
    return s;
}

/* How far (squared) the surface at depth d of that pixel is from the own one, and how far above its tangent plane; d is the depth of the point at the most. */
VINL vf es_screen_distance2_v(const es_screen_view* view, const es_screen_pixel_v* p, const es_screen_place_v* at, vf d, vf* rise)
{
    const vf step = d - p->depth;
    vf x = at->x, y = at->y;
    if (!view->rays.orthographic) {
        x = x * d;
        y = y * d;
    }
    *rise = step * p->nv + (x * p->nx + y * p->ny);
    return step * step * p->vv + step * (x * p->vx + y * p->vy) + (x * x * vf_set1(view->xx) + y * y * vf_set1(view->yy));
}

VINL vm es_screen_rises_v(vf rise, vf distance2) { return vm_gt(rise, vf_zero()) & vm_gt(rise * rise, distance2 * vf_set1(ES_SCREEN_RISE * ES_SCREEN_RISE)); }

/* 1 near the pixel, 0 from the radius on, smooth between. */
VINL vf es_screen_fade_v(vf distance2, vf inverse_radius2)
{
    const vf one = vf_set1(1.0f), t = vf_clamp((distance2 * inverse_radius2 - vf_set1(ES_SCREEN_FADE2)) * vf_set1(1.0f / (1.0f - ES_SCREEN_FADE2)), vf_zero(), one);
    return one - t * t * (vf_set1(3.0f) - (t + t));
}

/* To which share (0 … 1, by the fade) a point that far from the surface is inside of what the view shows. `free`: the view shows that it is not. `first`: by the first
 * layer alone. */
VINL vf es_screen_blocked_v(const es_screen_view* view, const es_screen_pixel_v* p, const vf offset[3], vf inverse_radius2, bool first, vm* free)
{
    const es_screen_place_v at = es_screen_place_of_v(view, p, offset);
    const vf zero = vf_zero();
    vf blocked = zero;
    vm behind = at.inside, hidden = vi_zero();
    for (uint32_t layer = 0; layer < (first ? 1 : view->layer_count); layer += 2) {
        const vf d = vf_gather(view->layers[layer]->depth, at.at);
        behind = behind & vm_gt(d, zero) & vm_lt(d, at.depth);
        if (!vm_any(behind)) break; /* most points are in the open */
        vf rise, distance2 = es_screen_distance2_v(view, p, &at, vf_min(d, at.depth), &rise);
        const vm rises = es_screen_rises_v(rise, distance2);
        vm within = behind;
        if (!first && layer + 1 < view->layer_count) {
            /* of the sides by which the line of sight enters and leaves, the nearer counts; one that is nowhere is far away */
            const vf end = vf_gather(view->layers[layer + 1]->depth, at.at);
            const vm ends = vm_gt(end, zero), passed = ends & vm_le(end, at.depth);
            within = behind & ~passed;
            behind = behind & passed;
            if (vm_any(within & rises & ends)) {
                const vf other = es_screen_distance2_v(view, p, &at, vf_min(end, at.depth + at.depth), &rise);
                distance2 = vf_select(ends, vf_min(distance2, other), distance2);
            }
        }
        hidden = hidden | within;
        if (!first && !vm_any(within & rises)) continue;
        blocked = vf_max(blocked, vf_and(within & rises, es_screen_fade_v(distance2, inverse_radius2)));
    }
    *free = at.inside & ~hidden;
    return blocked;
}

/* Eight places of surfaces in the world, and their triangles' normals, as a view would show them. */
VINL es_screen_pixel_v es_screen_pixel_at_v(const es_screen_view* view, const vf p[3], const vf n[3])
{
    /* far outside the picture and behind the eye: nothing near them comes in from there */
    const vf away = vf_set1(1e6f), depth = vf_max(es_screen_row_times_v(view->to_depth, p) + vf_set1(view->to_depth[3]), vf_set1(1e-6f));
    vf x = es_screen_row_times_v(view->to_x, p) + vf_set1(view->to_x[3]), y = es_screen_row_times_v(view->to_y, p) + vf_set1(view->to_y[3]);
    if (!view->rays.orthographic) {
        x = x / depth;
        y = y / depth;
    }
    return es_screen_pixel_of_v(view, vf_clamp(x, vf_neg(away), away), vf_clamp(y, vf_neg(away), away), depth, n);
}

/* ---- shadows along a segment (thesis §4.5.1) ----------------------------------------------------------------------------------- */

/* How much further than the depth bias the segment goes: there the fade begins. */
#define ES_SCREEN_SEGMENT 1.1111112f /* 1 / √ES_SCREEN_FADE2 */

/* The share of light that is left at eight pixels when `samples` places of a segment of that length (metres, more than 0) towards it are tested. */
VINL vf es_screen_segment_share_v(const es_screen_view* view, const es_screen_pixel_v* pixel, const vf towards[3], vf length, uint32_t samples)
{
    const vf reach = length * vf_set1(ES_SCREEN_SEGMENT), inverse2 = vf_set1(1.0f) / (reach * reach), step = reach * vf_set1(1.0f / ((float)samples + 0.5f));
    const vf along[3] = {es_screen_row_times_v(view->to_x, towards), es_screen_row_times_v(view->to_y, towards), es_screen_row_times_v(view->to_depth, towards)};
    vf most = vf_zero();
    for (uint32_t i = 0; i < samples; i++) {
        const vf t = step * vf_set1((float)i + 0.75f);
        const vf offset[3] = {along[0] * t, along[1] * t, along[2] * t};
        vm unused;
        most = vf_max(most, es_screen_blocked_v(view, pixel, offset, inverse2, view->layer_count == 1, &unused));
    }
    return vf_set1(1.0f) - most;
}

#endif
