/* Levels of the environment's maps, row by row, and lookups for those who are no kernels (gi/environment.h). */
#include "gi/kernel_table.h"
#include "gi/kernels/environment_simd.h"

/* Eight texels from (x, y) on: the directions of their middles. */
VINL void directions_of(uint32_t size, uint32_t x, uint32_t y, vf d[3])
{
    const vf texel = vf_set1(1.0f / (float)size);
    es_octahedral_direction_v((vf_set1((float)x + 0.5f) + vf_iota()) * texel, vf_set1(((float)y + 0.5f) * (1.0f / (float)size)), &d[0], &d[1], &d[2]);
}

/* Radiance below is none: lookups multiply it by weights. */
VINL vf without_dust(vf a) { return vf_and(vm_gt(a, vf_set1(1e-30f)), a); }

void ES_KERNEL(es_gi_environment_lobes)(const es_environment_lobe_job* job, uint32_t row_begin, uint32_t row_end)
{
    const vf one = vf_set1(1.0f);
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < job->size; x += VW) {
            vf n[3], t[3], b[3], sum[3] = {vf_zero(), vf_zero(), vf_zero()};
            directions_of(job->size, x, y, n);
            /* Duff et al. 2017 */
            const vf sign = vf_copysign(one, n[2]), a = vf_set1(-1.0f) / (sign + n[2]), c = n[0] * n[1] * a;
            t[0] = one + sign * n[0] * n[0] * a, t[1] = sign * c, t[2] = vf_neg(sign * n[0]);
            b[0] = c, b[1] = sign + n[1] * n[1] * a, b[2] = vf_neg(n[1]);
            for (uint32_t i = 0; i < job->tap_count; i++) {
                const es_environment_tap* tap = &job->taps[i];
                vf d[3], radiance[4];
                for (int k = 0; k < 3; k++) d[k] = t[k] * vf_set1(tap->direction[0]) + b[k] * vf_set1(tap->direction[1]) + n[k] * vf_set1(tap->direction[2]);
                es_environment_pyramid_v(job->means, d[0], d[1], d[2], vf_set1(tap->level), radiance);
                for (int k = 0; k < 3; k++) sum[k] = sum[k] + radiance[k] * vf_set1(tap->weight);
            }
            vf_store4(job->texels + 4 * ((size_t)(y + 1) * (job->size + 2) + x + 1), without_dust(sum[0]), without_dust(sum[1]), without_dust(sum[2]), vf_zero());
        }
}

void ES_KERNEL(es_gi_environment_irradiance)(const es_environment_irradiance_job* job, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < job->size; x += VW) {
            vf n[3], sum[3] = {vf_zero(), vf_zero(), vf_zero()};
            directions_of(job->size, x, y, n);
            for (uint32_t i = 0; i < job->source_count; i++)
                for (int k = 0; k < 3; k++) {
                    const float* m = job->sources[i].moment[k];
                    sum[k] = sum[k] + vf_max(n[0] * vf_set1(m[0]) + n[1] * vf_set1(m[1]) + n[2] * vf_set1(m[2]), vf_zero());
                }
            vf_store4(job->texels + 4 * ((size_t)(y + 1) * (job->size + 2) + x + 1), without_dust(sum[0]), without_dust(sum[1]), without_dust(sum[2]), vf_zero());
        }
}

void ES_KERNEL(es_gi_environment_ask)(const es_environment_lookup* lookup, const es_environment_question* question)
{
    for (uint32_t i = 0; i < question->count; i += VW) {
        const vf x = vf_load(question->x + i), y = vf_load(question->y + i), z = vf_load(question->z + i), roughness = vf_load(question->roughness + i);
        vf radiance[3], irradiance[3];
        es_environment_radiance_v(lookup, x, y, z, es_environment_level_of_alpha_v(roughness * roughness), radiance);
        es_environment_irradiance_v(lookup, x, y, z, irradiance);
        for (int k = 0; k < 3; k++) {
            vf_store(question->radiance[k] + i, radiance[k]);
            vf_store(question->irradiance[k] + i, irradiance[k]);
        }
    }
}
