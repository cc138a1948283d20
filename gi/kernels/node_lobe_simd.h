/* Lobes of nodes (gi/micro/forest.h, gi/micro/lobe_shape.h), eight at a time: in and out of their records, and what they send. */
#ifndef EARTHSHINE_GI_NODE_LOBE_SIMD_H
#define EARTHSHINE_GI_NODE_LOBE_SIMD_H

#include "gi/micro/forest.h"
#include "gi/micro/lobe_shape.h"
#include "platform/simd.h"
#include "raster/pack.h"

typedef struct es_node_lobe_v {
    vf light[3], axis[3], normal[3], width, length; /* width: a; length: of the mean normal, `normal` being unit */
    vm phong;
} es_node_lobe_v;

VINL es_node_lobe_v es_node_lobe_unpack_v(vi light, vi axis, vi normal, vi shape)
{
    es_node_lobe_v l;
    es_unpack_rgb9e5_v(light, &l.light[0], &l.light[1], &l.light[2]);
    es_unpack_normal_v(axis, &l.axis[0], &l.axis[1], &l.axis[2]);
    es_unpack_normal_v(normal, &l.normal[0], &l.normal[1], &l.normal[2]);
    const vf root = es_unpack_unorm16_v(shape);
    l.width = vf_max(root * root, vf_set1(ES_LOBE_LEAST_WIDTH));
    l.length = vf_from_int(vi_shift_right_logical(shape, 16) & vi_set1(0x7fff)) * vf_set1(1.0f / 32767.0f);
    l.phong = vi_lt(shape, vi_zero());
    return l;
}

VINL vi es_node_lobe_shape_v(vf width, vf length, vm phong)
{
    const vi bits = vi_round(vf_clamp(length, vf_zero(), vf_set1(1.0f)) * vf_set1(32767.0f));
    return es_pack_unorm16_v(vf_sqrt(width)) | bits << 16 | (phong & vi_set1((int32_t)0x80000000u));
}

VINL void es_node_lobe_pack_v(const es_node_lobe_v* l, vi words[4])
{
    words[0] = es_pack_rgb9e5_v(l->light[0], l->light[1], l->light[2]);
    words[1] = es_pack_normal_v(l->axis[0], l->axis[1], l->axis[2]);
    words[2] = es_pack_normal_v(l->normal[0], l->normal[1], l->normal[2]);
    words[3] = es_node_lobe_shape_v(l->width, l->length, l->phong);
}

/* Adds to `light`, W/(m² sr), what the nodes send in the unit directions w. */
VINL void es_node_lobe_add_v(const es_point_lobe* lobes, vi node, const vf w[3], vf light[3])
{
    const vm any = ~vi_eq(vi_gather(lobes, node * vi_set1(4)), vi_zero());
    if (!vm_any(any)) return;
    vi words[4];
    vi_gather4(lobes, sizeof *lobes, node, &words[0], &words[1], &words[2], &words[3]);
    const es_node_lobe_v l = es_node_lobe_unpack_v(words[0], words[1], words[2], words[3]);
    const vf one = vf_set1(1.0f), two = vf_set1(2.0f), zero = vf_zero(), half = vf_set1(0.5f);
    /* 1 - axis · w of sharp lobes needs the difference */
    const vf dx = w[0] - l.axis[0], dy = w[1] - l.axis[1], dz = w[2] - l.axis[2], x = half * (dx * dx + dy * dy + dz * dz);
    const vf inverse = one / l.width, t = one + (half * inverse - half) * x;
    vf p = vf_set1(0.0795774715f) * inverse / (t * t);
    if (vm_any(l.phong & any)) {
        const vf b = vf_set1(1.0f / 14.0f) * inverse, u = one + b * x, u2 = u * u, u4 = u2 * u2, s = one / (one + two * b), s2 = s * s;
        p = vf_select(l.phong, vf_set1(1.11408460f) * b / ((one - s2 * s2 * s2 * s) * (u4 * u4)), p);
    }
    const vf spread = vf_select(vm_gt(l.length, half), two * vf_sqrt(vf_max(l.length * (one - l.length), zero)), one), s = vf_max(spread, vf_set1(0.02f));
    const vf m = l.length * (l.normal[0] * w[0] + l.normal[1] * w[1] + l.normal[2] * w[2]), sum = vf_max(m + s, zero);
    const vf seen = vf_max(vf_select(vm_gt(m, s), m, sum * sum * (vf_set1(0.25f) / s)), vf_set1(ES_LOBE_HORIZON));
    const vf radiance = vf_and(vm_gt(sum, zero), p / seen);
    for (int k = 0; k < 3; k++) light[k] = light[k] + l.light[k] * radiance;
}

#endif
