/* Lobes of nodes from their children's (gi/micro/forest.h), eight parents at a time. */
#include "gi/kernel_table.h"
#include "gi/kernels/node_lobe_simd.h"

VINL es_node_lobe_v load_lobes(const es_point_lobe* lobes, vi at)
{
    vi words[4];
    vi_gather4(lobes, sizeof *lobes, at, &words[0], &words[1], &words[2], &words[3]);
    return es_node_lobe_unpack_v(words[0], words[1], words[2], words[3]);
}

/* Length of the mean of four normals below which there is an edge between them, and nothing bends. */
#define SMOOTH 0.85f

VINL vf luminance(const vf light[3]) { return vf_set1(0.2126f) * light[0] + vf_set1(0.7152f) * light[1] + vf_set1(0.0722f) * light[2]; }

/* Adds to the widths of leaves, groups [begin, end) of four, what their surface bends within a disc (gi/micro/light.h): a third of what widens the four of them together. */
void ES_KERNEL(es_gi_widen_lobes)(es_point_lobe* leaves, uint32_t begin, uint32_t end)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), tiny = vf_set1(1e-12f);
    for (uint32_t group = begin; group < end; group += VW) {
        const uint32_t n = end - group < VW ? end - group : VW;
        const vi first = vi_min(vi_iota() + vi_set1((int32_t)group), vi_set1((int32_t)end - 1)) << 2;
        es_node_lobe_v l[4];
        vf axis[3] = {zero, zero, zero}, normal[3] = {zero, zero, zero}, power = zero;
        for (int j = 0; j < 4; j++) {
            l[j] = load_lobes(leaves, first + vi_set1(j));
            const vf weight = luminance(l[j].light);
            for (int k = 0; k < 3; k++) {
                axis[k] = axis[k] + l[j].axis[k] * weight;
                normal[k] = normal[k] + l[j].normal[k] * vf_set1(0.25f);
            }
            power = power + weight;
        }
        const vm lit = vm_gt(power, tiny);
        if (!vm_any(lit)) continue;
        const vf inverse = one / vf_select(lit, power, one);
        for (int k = 0; k < 3; k++) axis[k] = axis[k] * inverse;
        const vf together = vf_min(vf_sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]), one), square = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
        const vf more = vf_and(lit & vm_gt(square, vf_set1(SMOOTH * SMOOTH)), vf_set1(0.5f / 3.0f) * (one - together) / vf_max(together, vf_set1(1e-3f)));
        for (int j = 0; j < 4; j++) {
            const vi shapes = es_node_lobe_shape_v(vf_min(l[j].width + more, one), l[j].length, l[j].phong);
            for (uint32_t k = 0; k < n; k++) leaves[4 * (size_t)(group + k) + (size_t)j].shape = (uint32_t)shapes[k];
        }
    }
}

void ES_KERNEL(es_gi_forest_pull_lobes)(const es_node_lobes* lobes, uint32_t begin, uint32_t end)
{
    const vf one = vf_set1(1.0f), half = vf_set1(0.5f), tiny = vf_set1(1e-12f);
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t n = end - i < VW ? end - i : VW;
        const vi left = vi_min(vi_iota() + vi_set1((int32_t)i), vi_set1((int32_t)end - 1)) << 1, right = left + vi_set1(1);
        const es_node_lobe_v l = load_lobes(lobes->lobes, left), r = load_lobes(lobes->lobes, right);
        const vf a = vf_gather(lobes->area, left), b = vf_gather(lobes->area, right), share = b / vf_max(a + b, vf_set1(1e-30f)), rest = one - share;
        const vf from_left = luminance(l.light) * rest, from_right = luminance(r.light) * share, power = from_left + from_right;
        const vf right_share = from_right / vf_max(power, tiny), left_share = one - right_share;
        es_node_lobe_v node;
        for (int k = 0; k < 3; k++) {
            node.light[k] = l.light[k] * rest + r.light[k] * share;
            node.axis[k] = l.axis[k] * left_share + r.axis[k] * right_share;
            node.normal[k] = l.normal[k] * (l.length * rest) + r.normal[k] * (r.length * share);
        }
        const vf together = vf_min(vf_sqrt(node.axis[0] * node.axis[0] + node.axis[1] * node.axis[1] + node.axis[2] * node.axis[2]), one);
        node.width = vf_min(l.width * left_share + r.width * right_share + half * (one - together) / vf_max(together, vf_set1(1e-3f)), one);
        node.length = vf_sqrt(node.normal[0] * node.normal[0] + node.normal[1] * node.normal[1] + node.normal[2] * node.normal[2]);
        node.phong = vi_select(vm_ge(left_share, half), l.phong, r.phong);
        vi words[4];
        es_node_lobe_pack_v(&node, words);
        for (uint32_t k = 0; k < n; k++) lobes->lobes[i + k] = (es_point_lobe){(uint32_t)words[0][k], (uint32_t)words[1][k], (uint32_t)words[2][k], (uint32_t)words[3][k]};
    }
}
