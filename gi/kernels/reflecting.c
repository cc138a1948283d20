/* Reflected directions of pixels, and what maps show along them (gi/reflections/reflecting.h). */
#include "gi/reflections/reflecting.h"

#include "gi/kernel_table.h"
#include "gi/kernels/lobe_albedo_simd.h"
#include "gi/kernels/reflection_map_simd.h"
#include "gi/lit.h"

VINL void ray_v(const es_pixel_rays* r, uint32_t x, uint32_t y, vf base[3], vf d[3])
{
    const vf fx = vf_set1((float)x) + vf_iota();
    for (int k = 0; k < 3; k++) {
        base[k] = vf_set1(r->base[k] + (float)y * r->base_dy[k]) + fx * vf_set1(r->base_dx[k]);
        d[k] = vf_set1(r->dir[k] + (float)y * r->dir_dy[k]) + fx * vf_set1(r->dir_dx[k]);
    }
}

/* Positions as well, and the directions from the eye that they are seen in, of any length. */
VINL void place_v(const es_pixel_rays* r, uint32_t x, uint32_t y, vf depth, vf p[3], vf d[3])
{
    if (r->found[0]) {
        const size_t at = (size_t)y * r->stride + x;
        for (int k = 0; k < 3; k++) {
            p[k] = vf_load(r->found[k] + at);
            d[k] = vf_load(r->along[k] + at);
        }
        return;
    }
    ray_v(r, x, y, p, d);
    for (int k = 0; k < 3; k++) p[k] = p[k] + depth * d[k];
}

/* Eight pixels; those that reflect. */
static vm reflecting_v(const es_reflecting_job* job, uint32_t x, uint32_t y, vi map)
{
    const es_gbuffer* g = job->gbuffer;
    const es_reflecting_planes* out = &job->out;
    const size_t at = (size_t)y * g->stride + x;
    const es_surface_v surface = es_surface_of_gbuffer_v(vi_load(g->albedo_rg + at), vi_load(g->albedo_b + at), vi_load(g->surface + at));
    const vm phong = vi_eq(surface.model, vi_set1(ES_SURFACE_PHONG)), unlit = vi_eq(surface.model, vi_set1(ES_SURFACE_UNLIT));
    /* a power cosine is as wide as the GGX whose alpha² is 2 / (exponent + 2) */
    const vf two = vf_set1(2.0f), alpha = vf_select(phong, vf_sqrt(two / (surface.roughness + two)), surface.roughness * surface.roughness);
    const vf f0 = vf_max(surface.specular[0], vf_max(surface.specular[1], surface.specular[2]));
    const vm lanes = ~vi_eq(map, vi_zero()) & ~unlit & vm_gt(f0, vf_zero()) & vm_le(alpha, vf_set1(job->roughness * job->roughness));
    vi_store(out->map + at, map & lanes);
    if (!vm_any(lanes)) return lanes;
    vf base[3], d[3], n[3], v[3], albedo[3];
    place_v(&job->rays, x, y, vf_zero(), base, d);
    for (int k = 0; k < 3; k++) d[k] = vf_select(lanes, d[k], vf_set1(k == 2 ? 1.0f : 0.0f));
    const vf inverse = vf_set1(-1.0f) / vf_sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int k = 0; k < 3; k++) v[k] = d[k] * inverse;
    es_unpack_normal_v(vi_load(g->normal + at), &n[0], &n[1], &n[2]);
    es_lift_to_horizon_v(n[0], n[1], n[2], &v[0], &v[1], &v[2]);
    const vf cosine = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
    for (int k = 0; k < 3; k++) d[k] = two * cosine * n[k] - v[k];
    const vf unit = vf_set1(1.0f) / vf_sqrt(vf_max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], vf_set1(1e-20f)));
    es_lobe_albedo_v(job->lobes, &surface, cosine, albedo);
    for (int k = 0; k < 3; k++) {
        vf_store(out->direction[k] + at, d[k] * unit);
        vf_store(out->albedo[k] + at, albedo[k]);
    }
    vf_store(out->alpha + at, alpha);
    return lanes;
}

void ES_KERNEL(es_gi_reflecting)(const es_reflecting_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t c = 0; c < chunks; c++) {
            const uint32_t end = (c + 1) * ES_LIT_COLUMNS < g->width ? (c + 1) * ES_LIT_COLUMNS : g->width;
            uint8_t any = 0;
            for (uint32_t x = c * ES_LIT_COLUMNS; x < end; x += VW) {
                const size_t at = (size_t)y * g->stride + x;
                const vm inside = vm_first((int32_t)(g->width - x));
                const vi map = inside & vi_gather(job->map_of, vi_load(g->instance + at) & inside);
                if (vm_any(~vi_eq(map, vi_zero()))) any |= vm_any(reflecting_v(job, x, y, map)) ? 1 : 0;
                else vi_store(job->out.map + at, vi_zero());
            }
            job->out.any[(size_t)y * chunks + c] = any;
        }
}

static void reflected_v(const es_reflected_job* job, uint32_t x, uint32_t y, vi map)
{
    const es_gbuffer* g = job->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    const vm lanes = ~vi_eq(map, vi_zero());
    const vf depth = vf_and(lanes, vf_load(g->depth + at));
    vf p[3], along[3], d[3], met[3], rgb[3];
    place_v(&job->rays, x, y, depth, p, along);
    for (int k = 0; k < 3; k++) {
        p[k] = vf_and(lanes, p[k]);
        d[k] = vf_and(lanes, vf_load(job->planes.direction[k] + at));
    }
    if (job->edited[0]) {
        vf e[3];
        for (int k = 0; k < 3; k++) e[k] = vf_and(lanes, vf_load(job->edited[k] + at));
        const vm edited = vm_ne(e[0], vf_zero()) | vm_ne(e[1], vf_zero()) | vm_ne(e[2], vf_zero());
        for (int k = 0; k < 3; k++) d[k] = vf_select(edited, e[k], d[k]);
    }
    es_reflection_seen_v(job->atlas, vi_max(map - vi_set1(1), vi_zero()), p, d, vf_and(lanes, vf_load(job->planes.alpha + at)), met, rgb);
    for (int k = 0; k < 3; k++) vf_store(job->out[k] + at, vf_and(lanes, rgb[k] * vf_and(lanes, vf_load(job->planes.albedo[k] + at))));
}

void ES_KERNEL(es_gi_reflected)(const es_reflected_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t c = 0; c < chunks; c++) {
            const size_t chunk = (size_t)y * chunks + c;
            const uint8_t any = job->planes.any[chunk] & 1;
            if (!any && !(job->lit[chunk] & 1)) continue;
            const uint32_t end = (c + 1) * ES_LIT_COLUMNS < g->width ? (c + 1) * ES_LIT_COLUMNS : g->width;
            for (uint32_t x = c * ES_LIT_COLUMNS; x < end; x += VW) {
                const size_t at = (size_t)y * g->stride + x;
                const vi map = any ? vi_load(job->planes.map + at) & vm_first((int32_t)(g->width - x)) : vi_zero();
                if (vm_any(~vi_eq(map, vi_zero()))) reflected_v(job, x, y, map);
                else
                    for (int k = 0; k < 3; k++) vf_store(job->out[k] + at, vf_zero());
            }
            job->lit[chunk] = any;
        }
}
