/* Look-ups in reflection maps (gi/reflections/reflection_map.h), eight rays at a time. */
#ifndef EARTHSHINE_GI_KERNELS_REFLECTION_MAP_SIMD_H
#define EARTHSHINE_GI_KERNELS_REFLECTION_MAP_SIMD_H

#include "gi/reflections/reflection_map.h"
#include "platform/simd.h"

/* Steps of about even angle; of these, where something may be met, so many; then of false position. */
enum { ES_REFLECTION_STEPS = 12, ES_REFLECTION_FINE_STEPS = 8, ES_REFLECTION_ROOT_STEPS = 5 };

/* That close to 1, as a share of the depth, comes g where a ray meets something; farther off it jumps over it. */
#define ES_REFLECTION_JUMP 0.05f

typedef struct es_cube_place_v { vi face; vf u, v, axis; } es_cube_place_v; /* -1 … 1 over the face; the direction's component along its axis */

VINL vf es_turned_with_v(vf a, vf sign) { return vf_from_bits(vi_from_bits(a) ^ (vi_from_bits(sign) & vi_set1((int32_t)0x80000000u))); }

/* Any length of 1e-30 … 1e30; what is shorter ends on some face. */
VINL es_cube_place_v es_cube_place_of_v(vf x, vf y, vf z)
{
    const vf ax = vf_abs(x), ay = vf_abs(y), az = vf_abs(z);
    const vm by_x = vm_ge(ax, ay) & vm_ge(ax, az), by_y = ~by_x & vm_ge(ay, az);
    es_cube_place_v p;
    p.axis = vf_select(by_x, ax, vf_select(by_y, ay, az));
    const vf of = vf_select(by_x, x, vf_select(by_y, y, z));
    p.face = vi_select(by_x, vi_zero(), vi_select(by_y, vi_set1(2), vi_set1(4))) + vi_shift_right_logical(vi_from_bits(of), 31);
    const vf inverse = vf_set1(1.0f) / vf_max(p.axis, vf_set1(1e-30f));
    const vf u = vf_select(by_x, es_turned_with_v(z, x), vf_select(by_y, x, vf_neg(es_turned_with_v(x, z))));
    const vf v = vf_select(by_y, vf_neg(es_turned_with_v(z, y)), vf_neg(y));
    const vf one = vf_set1(1.0f);
    p.u = vf_clamp(u * inverse, vf_neg(one), one);
    p.v = vf_clamp(v * inverse, vf_neg(one), one);
    return p;
}

/* Between four texels of a level: first, and how much of those to the right and below. */
typedef struct es_cube_texels_v { vi at, stride; vf right, down; } es_cube_texels_v;

VINL es_cube_texels_v es_cube_texels_of_v(const es_cube_place_v* p, vi first, vf size)
{
    const vf half = vf_set1(0.5f) * size, middle = half + vf_set1(0.5f); /* 1 for the border, and texels' middles at halves */
    const vf fu = p->u * half + middle, fv = p->v * half + middle;
    const vi iu = vi_truncate(fu), iv = vi_truncate(fv), stride = vi_truncate(size) + vi_set1(2);
    return (es_cube_texels_v){first + (p->face * stride + iv) * stride + iu, stride, fu - vf_from_int(iu), fv - vf_from_int(iv)};
}

VINL void es_cube_radiance_v(const float* texels, const es_cube_texels_v* t, vf rgb[3])
{
    const vi place[4] = {t->at, t->at + vi_set1(1), t->at + t->stride, t->at + t->stride + vi_set1(1)};
    vf c[4][3], unused;
    for (int i = 0; i < 4; i++) vf_gather4(texels, 16, place[i], &c[i][0], &c[i][1], &c[i][2], &unused);
    for (int k = 0; k < 3; k++) {
        const vf above = c[0][k] + t->right * (c[1][k] - c[0][k]), below = c[2][k] + t->right * (c[3][k] - c[2][k]);
        rgb[k] = above + t->down * (below - above);
    }
}

/* 1 over the depth along the face's axis. */
VINL vf es_cube_nearness_v(const float* texels, const es_cube_texels_v* t)
{
    const vi four = (t->at << 2) + vi_set1(3), below = four + (t->stride << 2), next = vi_set1(4);
    const vf a = vf_gather(texels, four), b = vf_gather(texels, four + next), c = vf_gather(texels, below), d = vf_gather(texels, below + next);
    const vf up = a + t->right * (b - a), down = c + t->right * (d - c);
    return up + t->down * (down - up);
}

/* Depth of a point, relative to the map's centre, over what the map shows there: above 1 behind it, 0 where it shows nothing. */
VINL vf es_reflection_behind_v(const es_reflection_atlas* atlas, vi first, vf x, vf y, vf z)
{
    const es_cube_place_v p = es_cube_place_of_v(x, y, z);
    const es_cube_texels_v t = es_cube_texels_of_v(&p, first, vf_set1(atlas->layout.level_size[0]));
    return p.axis * es_cube_nearness_v(atlas->texels, &t);
}

/* From low to high, where the ray is before and behind what the map shows. */
typedef struct es_reflection_span_v { vf low_t, low_g, high_t, high_g; } es_reflection_span_v;

/* False position; what an end keeps twice counts half the second time (Dowell and Jarratt 1971, the Illinois algorithm). */
VINL void es_reflection_narrow_v(const es_reflection_atlas* atlas, vi first, const vf x[3], const vf d[3], es_reflection_span_v* s)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), half = vf_set1(0.5f);
    vf low = s->low_g - one, high = s->high_g - one; /* weighted */
    vm last_below = vi_zero();
    for (int i = 0; i < ES_REFLECTION_ROOT_STEPS; i++) {
        const vf share = vf_clamp(vf_neg(low) / vf_max(high - low, vf_set1(1e-6f)), zero, one), t = s->low_t + share * (s->high_t - s->low_t);
        const vf g = es_reflection_behind_v(atlas, first, x[0] + t * d[0], x[1] + t * d[1], x[2] + t * d[2]);
        const vm below = vm_lt(g, one), again = i ? ~(below ^ last_below) : vi_zero();
        s->low_t = vf_select(below, t, s->low_t);
        s->low_g = vf_select(below, g, s->low_g);
        s->high_t = vf_select(below, s->high_t, t);
        s->high_g = vf_select(below, s->high_g, g);
        low = vf_select(below, g - one, vf_select(again, low * half, low));
        high = vf_select(below, vf_select(again, high * half, high), g - one);
        last_below = below;
    }
}

VINL vf es_reflection_root_v(const es_reflection_span_v* s)
{
    const vf one = vf_set1(1.0f), share = vf_clamp((one - s->low_g) / vf_max(s->high_g - s->low_g, vf_set1(1e-6f)), vf_zero(), one);
    return s->low_t + share * (s->high_t - s->low_t);
}

/* Is the root a surface? Between texels of very different depth there is none, but one of them may be what is met. */
VINL vm es_reflection_meets_v(const es_reflection_atlas* atlas, vi first, const vf x[3], const vf d[3], const es_reflection_span_v* s)
{
    const vf t = es_reflection_root_v(s), one = vf_set1(1.0f), little = vf_set1(ES_REFLECTION_JUMP);
    const es_cube_place_v p = es_cube_place_of_v(x[0] + t * d[0], x[1] + t * d[1], x[2] + t * d[2]);
    const es_cube_texels_v texels = es_cube_texels_of_v(&p, first, vf_set1(atlas->layout.level_size[0]));
    const vi four = (texels.at << 2) + vi_set1(3), below = four + (texels.stride << 2), next = vi_set1(4);
    const vf a = vf_gather(atlas->texels, four), b = vf_gather(atlas->texels, four + next), c = vf_gather(atlas->texels, below), e = vf_gather(atlas->texels, below + next);
    const vf near = vf_max(vf_max(a, b), vf_max(c, e)), far = vf_min(vf_min(a, b), vf_min(c, e));
    const vm smooth = vm_lt(near - far, vf_set1(0.25f) * near) & vm_lt(vf_min(one - s->low_g, s->high_g - one), little);
    const vf texels_deep = vf_set1(4.0f / atlas->layout.level_size[0]);
    return smooth | vm_lt(vf_abs(p.axis * near - one), texels_deep) | vm_lt(vf_abs(p.axis * far - one), texels_deep);
}

/* Two texels before t, as the centre sees the ray go on. */
VINL vf es_reflection_before_edge_v(const es_reflection_atlas* atlas, const vf x[3], const vf d[3], vf away, vf t)
{
    const vf along = x[0] * d[0] + x[1] * d[1] + x[2] * d[2], beside = vf_max(away * away - along * along, vf_zero()), from = along + t;
    const vf step = vf_set1(4.0f / atlas->layout.level_size[0]) * (beside + from * from) / vf_max(vf_sqrt(beside), vf_set1(1e-20f));
    return vf_max(t - vf_min(step, t), vf_zero());
}

/* 1 over the distance of the nearest thing in a direction's cell and those around it. */
VINL vf es_reflection_bound_v(const es_reflection_atlas* atlas, vi first, vf x, vf y, vf z)
{
    const es_cube_place_v p = es_cube_place_of_v(x, y, z);
    const vf half = vf_set1(0.5f * ES_REFLECTION_CELLS);
    const vi last = vi_set1(ES_REFLECTION_CELLS - 1), column = vi_min(vi_truncate(p.u * half + half), last), row = vi_min(vi_truncate(p.v * half + half), last);
    const vi cells = vi_set1(ES_REFLECTION_CELLS);
    return vf_gather(atlas->texels, ((first + vi_set1(atlas->layout.bounds_first)) << 2) + (p.face * cells + row) * cells + column);
}

typedef struct es_reflection_search_v {
    es_reflection_span_v met;
    vm found, passes;          /* met: where found; it went behind something, first at pass_t */
    vf pass_t, last_t, last_g;
} es_reflection_search_v;

/* From last_t, where it is before what the map shows, or behind, to t, in lanes `wanted`. */
VINL void es_reflection_look_v(const es_reflection_atlas* atlas, vi first, const vf x[3], const vf d[3], vm wanted, vf t, es_reflection_search_v* s)
{
    const vf one = vf_set1(1.0f), begin = s->last_t;
    for (int i = 1; i <= ES_REFLECTION_FINE_STEPS; i++) {
        const vf here_t = begin + (t - begin) * vf_set1((float)i / ES_REFLECTION_FINE_STEPS);
        const vf g = es_reflection_behind_v(atlas, first, x[0] + here_t * d[0], x[1] + here_t * d[1], x[2] + here_t * d[2]);
        const vm crossed = wanted & ~s->found & vm_lt(s->last_g, one) & ~vm_lt(g, one);
        if (vm_any(crossed)) {
            es_reflection_span_v here = {s->last_t, s->last_g, here_t, g};
            es_reflection_narrow_v(atlas, first, x, d, &here);
            /* where g jumps the ray goes behind the edge of something: on to where it comes out */
            const vm meets = crossed & es_reflection_meets_v(atlas, first, x, d, &here), first_pass = crossed & ~meets & ~s->passes;
            s->met.low_t = vf_select(meets, here.low_t, s->met.low_t);
            s->met.low_g = vf_select(meets, here.low_g, s->met.low_g);
            s->met.high_t = vf_select(meets, here.high_t, s->met.high_t);
            s->met.high_g = vf_select(meets, here.high_g, s->met.high_g);
            s->found = s->found | meets;
            s->pass_t = vf_select(first_pass, here.low_t, s->pass_t);
            s->passes = s->passes | first_pass;
            if (vm_all(s->found | ~wanted)) break;
        }
        s->last_t = here_t;
        s->last_g = g;
    }
}

/* Where the ray x + t d, relative to the map's centre, d unit, meets what the map shows: the point, or d where that is infinitely far; *spread: by how much a cone about
 * the ray is wider as the centre sees it. `first`: texels before the map's. */
VINL void es_reflection_meet_v(const es_reflection_atlas* atlas, vi first, const vf x[3], const vf d[3], vf met[3], vf* spread)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), away = vf_sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    es_reflection_search_v s = {.met = {zero, zero, zero, one}, .found = vi_zero(), .passes = vi_zero(), .pass_t = zero, .last_t = zero};
    vf t = zero, bound = es_reflection_bound_v(atlas, first, x[0], x[1], x[2]), distance = away;
    bool current = false; /* s.last_g is that of s.last_t */
    for (int i = 1; i < ES_REFLECTION_STEPS; i++) {
        const vf next = away * vf_set1((float)i / (float)(ES_REFLECTION_STEPS - i)), p[3] = {x[0] + next * d[0], x[1] + next * d[1], x[2] + next * d[2]};
        const vf next_bound = es_reflection_bound_v(atlas, first, p[0], p[1], p[2]), next_distance = vf_sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        const vm may_meet = ~s.found & ~vm_lt(vf_max(bound, next_bound) * vf_max(distance, next_distance), one);
        if (vm_any(may_meet)) {
            if (!current) {
                s.last_t = t;
                s.last_g = es_reflection_behind_v(atlas, first, x[0] + t * d[0], x[1] + t * d[1], x[2] + t * d[2]);
            }
            es_reflection_look_v(atlas, first, x, d, may_meet, next, &s);
            if (vm_all(s.found)) break;
        }
        /* a look that ended early left off before `next`; those that had something to look for are found */
        current = vm_any(may_meet & ~s.found);
        t = next;
        bound = next_bound;
        distance = next_distance;
    }
    if (!vm_all(s.found)) {
        if (!current) {
            s.last_t = t;
            s.last_g = es_reflection_behind_v(atlas, first, x[0] + t * d[0], x[1] + t * d[1], x[2] + t * d[2]);
        }
        /* beyond the last step: as far as a plane would be, and as much again */
        const es_cube_place_v place = es_cube_place_of_v(d[0], d[1], d[2]);
        const es_cube_texels_v texels = es_cube_texels_of_v(&place, first, vf_set1(atlas->layout.level_size[0]));
        const vf slope = place.axis * es_cube_nearness_v(atlas->texels, &texels);
        const vm endless = ~vm_gt(slope, vf_set1(1e-20f));
        const vf last = t + vf_set1(2.0f) * vf_max(one - s.last_g, vf_set1(0.01f)) / vf_max(slope, vf_set1(1e-20f));
        const vm some = ~s.found & ~endless;
        if (vm_any(some)) es_reflection_look_v(atlas, first, x, d, some, last, &s);
        /* it has met nothing: what it went behind, where it never came out again, or the end of the world, or what lies there in its direction */
        const vm never = ~s.found & s.passes & ~endless & ~vm_lt(s.last_g, one), far = ~s.found & ~never;
        const vf before = es_reflection_before_edge_v(atlas, x, d, away, s.pass_t);
        s.met.low_t = vf_select(never, before, vf_select(far, last, s.met.low_t));
        s.met.high_t = vf_select(never, before, vf_select(far, last, s.met.high_t));
        s.found = s.found | ~(far & endless);
    }
    t = es_reflection_root_v(&s.met);
    for (int k = 0; k < 3; k++) met[k] = vf_select(s.found, x[k] + t * d[k], d[k]);
    distance = vf_sqrt(met[0] * met[0] + met[1] * met[1] + met[2] * met[2]);
    *spread = vf_select(s.found, vf_and(s.found, t) / vf_max(distance, vf_set1(1e-20f)), one);
}

/* es_reflection_level_of_alpha, between powers of two straight in alpha */
VINL vf es_reflection_level_of_alpha_v(vf alpha)
{
    const vf x = vf_set1(64.0f) * vf_clamp(alpha, vf_zero(), vf_set1(1.0f));
    const vf steps = vf_from_int(vi_from_bits(x) - vi_set1(0x3f800000)) * vf_set1(0x1p-23f);
    return vf_select(vm_lt(x, vf_set1(1.0f)), x, vf_set1(1.0f) + steps);
}

VINL void es_reflection_level_v(const es_reflection_atlas* atlas, vi first, const es_cube_place_v* place, vi level, vf rgb[3])
{
    const es_cube_texels_v t = es_cube_texels_of_v(place, first + vi_gather(atlas->layout.level_first, level), vf_gather(atlas->layout.level_size, level));
    es_cube_radiance_v(atlas->texels, &t, rgb);
}

/* Radiance from a direction as the map's centre sees it, through a lobe of that alpha. */
VINL void es_reflection_radiance_v(const es_reflection_atlas* atlas, vi first, const vf d[3], vf alpha, vf last_level, vf rgb[3])
{
    const es_cube_place_v place = es_cube_place_of_v(d[0], d[1], d[2]);
    const vf level = vf_min(es_reflection_level_of_alpha_v(alpha), last_level);
    const vi low = vi_truncate(level);
    const vf share = level - vf_from_int(low);
    es_reflection_level_v(atlas, first, &place, low, rgb);
    if (!vm_any(vm_gt(share, vf_zero()))) return;
    vf above[3];
    es_reflection_level_v(atlas, first, &place, vi_min(low + vi_set1(1), vi_set1(ES_REFLECTION_LEVELS - 1)), above);
    for (int k = 0; k < 3; k++) rgb[k] = vf_select(vm_gt(share, vf_zero()), rgb[k] + share * (above[k] - rgb[k]), rgb[k]);
}

/* What a point p, relative to the world's origin, sees along d, unit, through a lobe of that alpha; `map`: 0 …, whatever in lanes that are not used. */
VINL void es_reflection_seen_v(const es_reflection_atlas* atlas, vi map, const vf p[3], const vf d[3], vf alpha, vf met[3], vf rgb[3])
{
    const vi first = map * vi_set1(atlas->layout.texels);
    vf x[3], spread;
    for (int k = 0; k < 3; k++) x[k] = p[k] - vf_gather(atlas->centre[k], map);
    es_reflection_meet_v(atlas, first, x, d, met, &spread);
    es_reflection_radiance_v(atlas, first, met, alpha * spread, vf_gather(atlas->last_level, map), rgb);
}

#endif
