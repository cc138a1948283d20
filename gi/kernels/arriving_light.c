/* Light of the environment that arrives at pixels, by the share of it that occlusion leaves (gi/screen/directional_occlusion.h). */
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/kernels/environment_simd.h"
#include "gi/kernels/lobe_albedo_simd.h"
#include "gi/lit.h"
#include "gi/screen/directional_occlusion.h"

/* What the lobe reflects of light from about its mirror direction, and in *pass what the diffuse part receives of light from everywhere. */
VINL void reflect_lobe(const es_arriving_job* job, size_t at, uint32_t x, uint32_t y, const vf n[3], vi word, vf* pass, vf lobe[3])
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const vf one = vf_set1(1.0f), fx = vf_set1((float)x) + vf_iota();
    vf v[3], length2 = vf_zero(), cosine = vf_zero(), r[3], radiance[3], albedo[3];
    for (int k = 0; k < 3; k++) {
        v[k] = vf_neg(vf_set1(rays->dir[k]) + fx * vf_set1(rays->dir_dx[k]) + vf_set1((float)y * rays->dir_dy[k]));
        length2 = length2 + v[k] * v[k];
    }
    const vf inverse = one / vf_sqrt(length2);
    for (int k = 0; k < 3; k++) {
        v[k] = v[k] * inverse;
        cosine = cosine + v[k] * n[k];
    }
    cosine = vf_clamp(cosine, vf_set1(1e-3f), one);
    for (int k = 0; k < 3; k++) r[k] = (cosine + cosine) * n[k] - v[k];
    const es_surface_v surface = es_surface_of_gbuffer_v(vi_load(g->albedo_rg + at), vi_load(g->albedo_b + at), word);
    const vm phong = vi_eq(surface.model, vi_set1(ES_SURFACE_PHONG));
    /* Phong's exponent e is as wide as alpha² = 2 / (e + 2) */
    const vf alpha = vf_select(phong, vf_sqrt(vf_set1(2.0f) / (vf_abs(surface.roughness) + vf_set1(2.0f))), surface.roughness * surface.roughness);
    es_environment_radiance_v(job->environment, r[0], r[1], r[2], es_environment_level_of_alpha_v(alpha), radiance);
    es_lobe_albedo_v(job->lobes, &surface, cosine, albedo);
    for (int k = 0; k < 3; k++) lobe[k] = radiance[k] * albedo[k];
    const vf f90 = vf_min(vf_set1(25.0f) * vf_max(surface.specular[0], vf_max(surface.specular[1], surface.specular[2])), one), a = one - cosine, a2 = a * a;
    *pass = vf_select(phong, one, (one - f90 * vf_set1(0.04f + 0.96f / 21.0f)) * (one - f90 * (vf_set1(0.04f) + vf_set1(0.96f) * (a2 * a2 * a))));
}

void ES_KERNEL(es_gi_arriving_light)(const es_arriving_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = row_begin; y < row_end; y++) {
        if (job->reflected[0]) memset(job->lit + (size_t)y * chunks, 0, chunks);
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            const vi word = vi_load(g->surface + at);
            const vm seen = vm_gt(vf_load(g->depth + at), vf_zero()) & ~vi_eq(vi_shift_right_logical(word, 24), vi_set1(ES_SURFACE_UNLIT)) & vm_first((int32_t)(g->width - x));
            const bool lobes = job->reflected[0] && !vm_all(~seen | es_surface_word_is_diffuse_v(word));
            vf n[3], e[3] = {vf_zero(), vf_zero(), vf_zero()}, share[3], lobe[3] = {vf_zero(), vf_zero(), vf_zero()}, pass = vf_set1(1.0f);
            for (int k = 0; k < 3; k++) share[k] = vf_and(seen, vf_load(job->share[k] + at));
            if (vm_any(seen)) {
                es_unpack_normal_v(vi_load(g->normal + at), &n[0], &n[1], &n[2]);
                es_environment_irradiance_v(job->environment, n[0], n[1], n[2], e);
                if (lobes) reflect_lobe(job, at, x, y, n, word, &pass, lobe);
            }
            for (int k = 0; k < 3; k++) {
                vf arriving = vf_and(seen, e[k] * share[k] * pass);
                if (job->irradiance[0]) arriving = arriving + vf_load(job->irradiance[k] + at);
                vf_store(job->arriving[k] + at, arriving);
            }
            if (!job->reflected[0]) continue;
            vm lit = vi_zero();
            for (int k = 0; k < 3; k++) {
                vf reflected = vf_and(seen, lobe[k] * share[k]);
                if (job->specular[0]) reflected = reflected + vf_load(job->specular[k] + at);
                lit = lit | ~vi_eq(vi_from_bits(reflected), vi_zero());
                vf_store(job->reflected[k] + at, reflected);
            }
            if (vm_any(lit)) job->lit[(size_t)y * chunks + x / ES_LIT_COLUMNS] = 1;
        }
    }
}
