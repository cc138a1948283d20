/* Reflection maps: their faces, their lobes, and look-ups for who is no kernel (gi/reflections/reflection_map.h). */
#include "gi/kernel_table.h"
#include "gi/kernels/reflection_map_simd.h"

/* Below, look-ups times weights would be denormal. */
VINL vf without_dust(vf a) { return vf_and(vm_gt(a, vf_set1(1e-30f)), a); }

void ES_KERNEL(es_gi_reflection_face)(const es_reflection_face_job* job, uint32_t row_begin, uint32_t row_end)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < job->size; x += VW) {
            const size_t at = (size_t)y * job->stride + x;
            const vf depth = vf_load(job->depth + at);
            const vm seen = vm_gt(depth, zero);
            vf c[3];
            for (int k = 0; k < 3; k++) c[k] = without_dust(vf_load(job->radiance[k] + at));
            vf_store4(job->out + 4 * ((size_t)(y + 1) * (job->size + 2) + x + 1), c[0], c[1], c[2], vf_and(seen, one / vf_select(seen, depth, one)));
        }
}

/* Between two levels of means. */
VINL void mean_v(const es_reflection_lobe_job* job, const vf d[3], float level, vf rgb[3])
{
    const es_reflection_layout* l = job->layout;
    const es_cube_place_v place = es_cube_place_of_v(d[0], d[1], d[2]);
    const uint32_t low = (uint32_t)level;
    es_cube_texels_v t = es_cube_texels_of_v(&place, vi_set1(l->mean_first[low]), vf_set1(l->mean_size[low]));
    es_cube_radiance_v(job->texels, &t, rgb);
    if (low + 1 >= l->means) return;
    const vf share = vf_set1(level - (float)low);
    vf above[3];
    t = es_cube_texels_of_v(&place, vi_set1(l->mean_first[low + 1]), vf_set1(l->mean_size[low + 1]));
    es_cube_radiance_v(job->texels, &t, above);
    for (int k = 0; k < 3; k++) rgb[k] = rgb[k] + share * (above[k] - rgb[k]);
}

/* Rows of all six faces, one after another. */
void ES_KERNEL(es_gi_reflection_lobe)(const es_reflection_lobe_job* job, uint32_t row_begin, uint32_t row_end)
{
    static const float axes[6][3][3] = {
        {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}, {{-1, 0, 0}, {0, 0, -1}, {0, -1, 0}}, {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
        {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}}, {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}},  {{0, 0, -1}, {1, 0, 0}, {0, -1, 0}}};
    const uint32_t size = (uint32_t)job->layout->level_size[job->level];
    const vf one = vf_set1(1.0f);
    const float step = 2.0f / (float)size;
    for (uint32_t row = row_begin; row < row_end; row++) {
        const uint32_t f = row / size, y = row % size;
        const float v = ((float)y + 0.5f) * step - 1.0f;
        for (uint32_t x = 0; x < size; x += VW) {
            const vf u = (vf_set1((float)x + 0.5f) + vf_iota()) * vf_set1(step) - one, scale = one / vf_sqrt(one + u * u + vf_set1(v * v));
            vf n[3], t[3], b[3], sum[3] = {vf_zero(), vf_zero(), vf_zero()};
            for (int k = 0; k < 3; k++) n[k] = (vf_set1(axes[f][0][k] + v * axes[f][2][k]) + u * vf_set1(axes[f][1][k])) * scale;
            /* Duff et al. 2017 */
            const vf sign = vf_copysign(one, n[2]), a = vf_set1(-1.0f) / (sign + n[2]), c = n[0] * n[1] * a;
            t[0] = one + sign * n[0] * n[0] * a, t[1] = sign * c, t[2] = vf_neg(sign * n[0]);
            b[0] = c, b[1] = sign + n[1] * n[1] * a, b[2] = vf_neg(n[1]);
            for (uint32_t i = 0; i < job->tap_count; i++) {
                const es_reflection_tap* tap = &job->taps[i];
                vf d[3], rgb[3];
                for (int k = 0; k < 3; k++) d[k] = t[k] * vf_set1(tap->direction[0]) + b[k] * vf_set1(tap->direction[1]) + n[k] * vf_set1(tap->direction[2]);
                mean_v(job, d, tap->level, rgb);
                for (int k = 0; k < 3; k++) sum[k] = sum[k] + rgb[k] * vf_set1(tap->weight);
            }
            const size_t at = ((size_t)f * (size + 2) + y + 1) * (size + 2) + x + 1;
            vf_store4(job->out + 4 * at, without_dust(sum[0]), without_dust(sum[1]), without_dust(sum[2]), vf_zero());
        }
    }
}

void ES_KERNEL(es_gi_reflection_ask)(const es_reflection_atlas* atlas, const es_reflection_question* q)
{
    for (uint32_t i = 0; i < q->count; i += VW) {
        const vi map = vi_load(q->map + i);
        const vm any = ~(map < vi_zero());
        vf p[3], d[3], met[3], rgb[3];
        for (int k = 0; k < 3; k++) {
            p[k] = vf_load(q->position[k] + i);
            d[k] = vf_load(q->direction[k] + i);
        }
        es_reflection_seen_v(atlas, vi_max(map, vi_zero()), p, d, vf_load(q->alpha + i), met, rgb);
        for (int k = 0; k < 3; k++) {
            vf_store(q->radiance[k] + i, vf_and(any, rgb[k]));
            if (q->met[k]) vf_store(q->met[k] + i, vf_and(any, met[k]));
        }
    }
}
