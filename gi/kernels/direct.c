/* Direct light: per pixel the surface model times the light's irradiance times the share of the percentage-closer filter's
 * taps that the light reaches.
 */
#include "gi/kernel_table.h"
#include "gi/kernels/edited_lobe_simd.h"
#include "gi/kernels/light_strength_simd.h"
#include "gi/kernels/screen_test_simd.h"
#include "gi/kernels/shadow_map_simd.h"
#include "gi/kernels/surface_simd.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* ---- a stretch of a row -------------------------------------------------------------------------------------------------
 *
 * In several short loops: what the light could reach is listed with the light's direction and strength, then it is placed on the map, then the map
 * is looked up, then the surface reflects. In one loop the chain of roots, divisions and look-ups is longer than what a processor keeps in
 * flight. */
enum { STRETCH = 256 };

typedef struct stretch {
    uint32_t x[STRETCH / VW + 1], count; /* eights of pixels with some that the light could reach */
    /* of these, one after another */
    int32_t lanes[STRETCH];
    float towards[3][STRETCH], strength[STRETCH], cosine[STRETCH], geometric[STRETCH]; /* unit, to the light; with the shading and the triangle's normal */
    float u[STRETCH], v[STRETCH], reference[STRETCH];
} stretch;

typedef struct direct_row { const es_direct_job* job; uint32_t y; float base[3], dir[3]; } direct_row;

VINL void place(const direct_row* row, uint32_t x, vf depth, vf p[3], vf d[3])
{
    const es_pixel_rays* rays = &row->job->rays;
    if (rays->found[0]) {
        const size_t at = (size_t)row->y * rays->stride + x;
        for (int k = 0; k < 3; k++) {
            p[k] = vf_load(rays->found[k] + at);
            d[k] = vf_load(rays->along[k] + at);
        }
        return;
    }
    const vf fx = vf_set1((float)x) + vf_iota();
    for (int k = 0; k < 3; k++) {
        d[k] = vf_set1(row->dir[k]) + fx * vf_set1(rays->dir_dx[k]);
        p[k] = vf_set1(row->base[k]) + fx * vf_set1(rays->base_dx[k]) + depth * d[k];
    }
}

static void find_reached(const direct_row* row, uint32_t begin, uint32_t end, stretch* s)
{
    const es_direct_job* job = row->job;
    const es_gbuffer* g = job->gbuffer;
    const es_light_strength light = es_light_strength_of(job->view);
    const vf zero = vf_zero();
    uint32_t count = 0;
    for (uint32_t x = begin; x < end; x += VW) {
        const size_t at = (size_t)row->y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        vm lanes = vm_gt(depth, zero) & ~vi_eq(vi_shift_right_logical(vi_load(g->surface + at), 24), vi_set1(ES_SURFACE_UNLIT)) & vm_first((int32_t)(g->width - x));
        vf p[3], d[3], l[3], strength;
        place(row, x, depth, p, d);
        es_light_strength_v(&light, p, l, &strength);
        vf nx, ny, nz;
        const vi normal = vi_load(g->normal + at), geometric_normal = vi_load(g->geometric_normal + at);
        es_unpack_normal_v(normal, &nx, &ny, &nz);
        const vf cosine = nx * l[0] + ny * l[1] + nz * l[2];
        if (!vm_all(vi_eq(normal, geometric_normal))) es_unpack_normal_v(geometric_normal, &nx, &ny, &nz);
        const vf geometric = nx * l[0] + ny * l[1] + nz * l[2];
        /* the side of the triangle that faces away is in its own shadow, whatever the interpolated normal says */
        lanes = lanes & vm_gt(cosine, zero) & vm_gt(geometric, zero) & vm_gt(strength, zero);
        const uint32_t to = count * VW;
        s->x[count] = x;
        vi_store(s->lanes + to, lanes);
        vf_store(s->towards[0] + to, l[0]);
        vf_store(s->towards[1] + to, l[1]);
        vf_store(s->towards[2] + to, l[2]);
        vf_store(s->strength + to, strength);
        vf_store(s->cosine + to, cosine);
        vf_store(s->geometric + to, geometric);
        count += vm_any(lanes);
    }
    s->count = count;
}

/* The share of each listed light that arrives, in its strength. */
static void shadow(const direct_row* row, stretch* s)
{
    const es_direct_job* job = row->job;
    const es_gbuffer* g = job->gbuffer;
    const es_light_view* view = job->view;
    const es_light_face* face = view->faces;
    const float* depths = g->depth + (size_t)row->y * g->stride;
    const int taps = (int)job->shadow_filter;
    const es_shadow_lookup lookup = {view, taps, job->shadow_bias, job->shadow_slope_bias};
    vf p[3], d[3];
    if (view->face_count > 1) {
        for (uint32_t i = 0; i < s->count; i++) {
            const uint32_t at = i * VW;
            const vm lanes = vi_load(s->lanes + at);
            place(row, s->x[i], vf_load(depths + s->x[i]), p, d);
            const vf towards[3] = {vf_load(s->towards[0] + at), vf_load(s->towards[1] + at), vf_load(s->towards[2] + at)};
            const vf share = es_shadow_share_v(&lookup, lanes, p, towards, vf_load(s->geometric + at));
            vf_store(s->strength + at, vf_and(lanes, vf_load(s->strength + at) * share));
        }
        return;
    }
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t at = i * VW;
        place(row, s->x[i], vf_load(depths + s->x[i]), p, d);
        const es_shadow_receiver r = es_shadow_receiver_v(&lookup, face, p[0], p[1], p[2], es_shadow_slope_v(vf_load(s->geometric + at)));
        vf_store(s->u + at, r.u);
        vf_store(s->v + at, r.v);
        vf_store(s->reference + at, r.reference);
    }
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t at = i * VW;
        const es_shadow_receiver r = {vf_load(s->u + at), vf_load(s->v + at), vf_load(s->reference + at)};
        const vf share = taps == 2 ? es_lit_share_v(face, &r, 2) : es_lit_share_v(face, &r, taps);
        vf_store(s->strength + at, vf_and(vi_load(s->lanes + at), vf_load(s->strength + at) * share));
    }
}

/* Takes away what screen space shows to be hidden within the depth bias: of the light's axis, texels · width; along the ray to the light as much more as that is oblique,
 * which for a perspective map makes it texels · slope times the distance. */
static void repair(const direct_row* row, stretch* s)
{
    const es_direct_job* job = row->job;
    const es_gbuffer* g = job->gbuffer;
    const es_light_view* view = job->view;
    const vf zero = vf_zero(), texels = vf_set1(job->shadow_bias), slope_texels = vf_set1(job->shadow_slope_bias * 0.5f * (float)job->shadow_filter);
    const vf least = vf_set1(job->repair_least > 1e-6f ? job->repair_least : 1e-6f);
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t at = i * VW, x = s->x[i];
        const size_t pixel = (size_t)row->y * g->stride + x;
        const vf strength = vf_load(s->strength + at);
        const vm lit = vi_load(s->lanes + at) & vm_gt(strength, zero);
        if (!vm_any(lit)) continue;
        const vf towards[3] = {vf_load(s->towards[0] + at), vf_load(s->towards[1] + at), vf_load(s->towards[2] + at)};
        const vf depth = vf_select(lit, vf_load(g->depth + pixel), vf_set1(1.0f));
        vf p[3], d[3], n[3], away = vf_set1(1.0f);
        place(row, x, depth, p, d);
        if (!view->orthographic) {
            const vf lx = vf_set1(view->light.position.x) - p[0], ly = vf_set1(view->light.position.y) - p[1], lz = vf_set1(view->light.position.z) - p[2];
            away = vf_sqrt(lx * lx + ly * ly + lz * lz);
        }
        es_unpack_normal_v(vi_load(g->geometric_normal + pixel), &n[0], &n[1], &n[2]);
        const vf bias = (texels + slope_texels * es_shadow_slope_v(vf_load(s->geometric + at))) * vf_set1(view->texel_slope) * away;
        vf length = vf_max(bias, least);
        if (!view->orthographic) length = vf_max(vf_min(length, away * vf_set1(0.5f)), vf_set1(1e-6f)); /* not beyond the light */
        const es_screen_pixel_v at_pixel = es_screen_pixel_of_v(job->repair, vf_set1((float)x) + vf_iota(), vf_set1((float)row->y), depth, n);
        const vf share = es_screen_segment_share_v(job->repair, &at_pixel, towards, length, job->repair_samples);
        vf_store(s->strength + at, vf_and(lit, strength * share));
    }
}

static void edit_lobe(const es_direct_job* job, size_t at, const es_surface_v* surface, const vf n[3], const vf l[3], const vf v[3], vf lobe[3])
{
    const vf e[3] = {vf_load(job->edited[0] + at), vf_load(job->edited[1] + at), vf_load(job->edited[2] + at)};
    if (vm_any(vm_gt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2], vf_zero()))) es_edited_lobe_v(surface, n, l, v, e, lobe);
}

static void reflect(const direct_row* row, const stretch* s)
{
    const es_direct_job* job = row->job;
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const float* radiant = job->view->light.radiant;
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t from = i * VW, x = s->x[i];
        const size_t at = (size_t)row->y * g->stride + x;
        const vf strength = vf_load(s->strength + from);
        if (!vm_any(vm_gt(strength, vf_zero()))) continue;
        const vm lanes = vi_load(s->lanes + from);
        const vi rg = vi_load(g->albedo_rg + at), b = vi_load(g->albedo_b + at), word = vi_load(g->surface + at);
        vf f[3];
        if (vm_all(~lanes | es_surface_word_is_diffuse_v(word))) {
            /* what the model comes to without a lobe, wherever the eye is: the same bits */
            const es_surface_v surface = es_surface_of_gbuffer_v(rg, b, word);
            for (int k = 0; k < 3; k++) f[k] = surface.albedo[k] * vf_set1(0.318309886f);
        } else {
            vf p[3], d[3], v[3], nx, ny, nz;
            place(row, x, vf_load(g->depth + at), p, d);
            vf inverse = vf_set1(-1.0f) / vf_sqrt(vf_max(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], vf_set1(1e-30f))) /* rays that found nothing have no direction */;
            for (int k = 0; k < 3; k++) v[k] = rays->orthographic ? vf_set1(-rays->dir[k]) : d[k] * inverse;
            es_unpack_normal_v(vi_load(g->normal + at), &nx, &ny, &nz);
            es_lift_to_horizon_v(nx, ny, nz, &v[0], &v[1], &v[2]);
            const vf towards[3] = {vf_load(s->towards[0] + from), vf_load(s->towards[1] + from), vf_load(s->towards[2] + from)};
            const es_surface_v surface = es_surface_of_gbuffer_v(rg, b, word);
            vf pass, lobe[3];
            es_surface_parts_v(&surface, nx, ny, nz, towards[0], towards[1], towards[2], v[0], v[1], v[2], &pass, lobe);
            if (job->edited[0]) edit_lobe(job, at, &surface, (const vf[3]){nx, ny, nz}, towards, v, lobe);
            pass = pass * vf_set1(0.318309886f);
            for (int k = 0; k < 3; k++) f[k] = surface.albedo[k] * pass + lobe[k];
        }
        /* irradiance of the light times the model; cos is in the irradiance */
        const vf e = strength * vf_max(vf_load(s->cosine + from), vf_zero());
        for (int k = 0; k < 3; k++) vf_store(job->out[k] + at, vf_load(job->out[k] + at) + vf_and(lanes, e * vf_set1(radiant[k]) * f[k]));
    }
}

void ES_KERNEL(es_gi_direct)(const es_direct_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    stretch s;
    for (uint32_t y = row_begin; y < row_end; y++) {
        direct_row row = {.job = job, .y = y};
        for (int k = 0; k < 3; k++) {
            row.base[k] = rays->base[k] + (float)y * rays->base_dy[k];
            row.dir[k] = rays->dir[k] + (float)y * rays->dir_dy[k];
        }
        for (uint32_t x = 0; x < g->width; x += STRETCH) {
            const uint32_t end = g->width - x < STRETCH ? g->width : x + STRETCH;
            for (int k = 0; k < 3 && job->first; k++)
                for (uint32_t i = x; i < end; i += VW) vf_store(job->out[k] + (size_t)y * g->stride + i, vf_zero());
            find_reached(&row, x, end, &s);
            shadow(&row, &s);
            if (job->repair) repair(&row, &s);
            reflect(&row, &s);
        }
    }
}
