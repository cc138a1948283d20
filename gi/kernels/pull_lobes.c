/* Lobes of nodes from their children's (gi/micro/forest.h), eight parents at a time. */
#include "gi/kernel_table.h"
#include "gi/kernels/node_lobe_simd.h"

VINL es_node_lobe_v load_lobes(const es_point_lobe* lobes, vi at)
{
    vi words[4];
    vi_gather4(lobes, sizeof *lobes, at, &words[0], &words[1], &words[2], &words[3]);
    return es_node_lobe_unpack_v(words[0], words[1], words[2], words[3]);
}

VINL vf luminance(const vf light[3]) { return vf_set1(0.2126f) * light[0] + vf_set1(0.7152f) * light[1] + vf_set1(0.0722f) * light[2]; }

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
