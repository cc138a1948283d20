/* Direct light: per pixel the surface model times the light's irradiance times the share of the percentage-closer filter's
 * taps that the light reaches.
 *
 * A shadow-map texel of width s stores one depth; on a surface tilted by the angle a the depth inside a texel varies by s tan a,
 * and a filter k taps wide reaches k/2 texels out. So the receiver is moved towards the light by
 * (constant + slope k/2 tan a) · s, in metres along the view axis, before the comparison.
 */
#include "gi/kernel_table.h"
#include "gi/kernels/surface_simd.h"
#include "platform/simd.h"
#include "raster/pack.h"

static inline vf row_times(const float* m, int row, vf x, vf y, vf z)
{
    return vf_set1(m[row]) * x + vf_set1(m[4 + row]) * y + vf_set1(m[8 + row]) * z + vf_set1(m[12 + row]);
}

/* Where eight points fall on a face's map, in texels from its upper left one's middle, moved to the first tap; and the depth they are compared by. */
typedef struct receiver { vf u, v, reference; } receiver;

VINL receiver receiver_on(const es_direct_job* job, const es_light_face* face, vf px, vf py, vf pz, vf slope)
{
    const es_light_view* view = job->view;
    const float* m = face->world_to_clip.m;
    const uint32_t size = face->shadow_view.width;
    vf one = vf_set1(1.0f), half_size = vf_set1(0.5f * (float)size);
    vf cx = row_times(m, 0, px, py, pz), cy = row_times(m, 1, px, py, pz), cz = row_times(m, 2, px, py, pz), cw = row_times(m, 3, px, py, pz);
    vf texels = vf_set1(job->shadow_bias) + vf_set1(job->shadow_slope_bias * 0.5f * (float)job->shadow_filter) * slope;
    receiver r;
    if (view->orthographic) {
        /* depth falls by -m_z per metre along the axis */
        float per_metre = face->shadow_view.projection.m[10];
        r.reference = cz + vf_set1(per_metre * view->texel_slope) * texels;
    } else {
        vf distance = vf_max(cw, vf_set1(view->near_plane));
        vf towards = distance - texels * vf_set1(view->texel_slope) * distance;
        r.reference = vf_set1(view->near_plane) / vf_max(towards, vf_set1(view->near_plane));
        vf inverse = one / distance;
        cx = cx * inverse;
        cy = cy * inverse;
    }
    const vf first_tap = vf_set1(0.5f * (float)((int)job->shadow_filter - 1)), limit = vf_set1((float)size);
    r.u = vf_min(vf_max((cx + one) * half_size - first_tap, vf_neg(limit)), limit);
    r.v = vf_min(vf_max((one - cy) * half_size - first_tap, vf_neg(limit)), limit);
    return r;
}

/* Share of the filter's weight that is lit. A filter of k taps per side is a box of k - 1 texels slid continuously (bilinear for k = 2):
 * weights 1 - f, 1, …, 1, f along each axis; one tap is the nearest. */
VINL vf lit_share(const es_light_face* face, const receiver* r, int taps)
{
    const uint32_t size = face->shadow_view.width;
    const vf one = vf_set1(1.0f);
    vf fu = vf_floor(r->u), fv = vf_floor(r->v);
    vi iu = vi_truncate(fu), iv = vi_truncate(fv), last = vi_set1((int32_t)size - 1);
    fu = r->u - fu;
    fv = r->v - fv;
    vf sum = vf_zero();
    /* with t taps the box reaches from tap 0 (weight 1 - f) to tap t - 1 (weight f) */
    for (int y = 0; y < taps; y++) {
        vf wy = taps == 1 ? one : y == 0 ? one - fv : y == taps - 1 ? fv : one;
        vi row = vi_min(vi_max(iv + vi_set1(y), vi_zero()), last) * vi_set1((int32_t)size);
        for (int x = 0; x < taps; x++) {
            vf wx = taps == 1 ? one : x == 0 ? one - fu : x == taps - 1 ? fu : one;
            vi column = vi_min(vi_max(iu + vi_set1(x), vi_zero()), last);
            vf stored = vf_gather(face->shadow_depth, row + column);
            sum = sum + vf_and(vm_ge(r->reference, stored), wx * wy);
        }
    }
    float box = taps == 1 ? 1.0f : (float)(taps - 1);
    return sum * vf_set1(1.0f / (box * box));
}

/* Which cube face a direction belongs to, in the order of es_cube_views. */
static inline vi cube_face(vf x, vf y, vf z)
{
    vf ax = vf_abs(x), ay = vf_abs(y), az = vf_abs(z);
    vm is_x = vm_ge(ax, ay) & vm_ge(ax, az), is_y = vm_ge(ay, az);
    vf major = vf_select(is_x, x, vf_select(is_y, y, z));
    vi base = vi_select(is_x, vi_zero(), vi_select(is_y, vi_set1(2), vi_set1(4)));
    return base + (vm_lt(major, vf_zero()) & vi_set1(1));
}

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
    const es_light_state* light = &job->view->light;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    /* a millionth of the scene's extent: a light in a surface leaves its neighbourhood finite */
    const float nearest = job->view->near_plane * 1e-3f;
    const float cone_scale = 1.0f / (light->cos_inner - light->cos_outer > 1e-6f ? light->cos_inner - light->cos_outer : 1e-6f);
    const vf sx = vf_set1(light->position.x), sy = vf_set1(light->position.y), sz = vf_set1(light->position.z);
    const vf ax = vf_set1(light->direction.x), ay = vf_set1(light->direction.y), az = vf_set1(light->direction.z);
    uint32_t count = 0;
    for (uint32_t x = begin; x < end; x += VW) {
        const size_t at = (size_t)row->y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        vm lanes = vm_gt(depth, zero) & ~vi_eq(vi_shift_right_logical(vi_load(g->surface + at), 24), vi_set1(ES_SURFACE_UNLIT)) & vm_first((int32_t)(g->width - x));
        vf p[3], d[3], lx, ly, lz, strength;
        place(row, x, depth, p, d);
        if (light->type == ES_LIGHT_DIRECTIONAL) {
            lx = vf_neg(ax);
            ly = vf_neg(ay);
            lz = vf_neg(az);
            strength = one;
        } else {
            lx = sx - p[0];
            ly = sy - p[1];
            lz = sz - p[2];
            vf d2 = vf_max(lx * lx + ly * ly + lz * lz, vf_set1(nearest * nearest));
            vf distance = vf_sqrt(d2), inverse = one / distance;
            lx = lx * inverse;
            ly = ly * inverse;
            lz = lz * inverse;
            strength = inverse * inverse;
            if (light->type == ES_LIGHT_SPOT) {
                vf cosine = vf_neg(lx * ax + ly * ay + lz * az);
                vf t = vf_min(vf_max((cosine - vf_set1(light->cos_outer)) * vf_set1(cone_scale), zero), one);
                strength = strength * t * t;
            }
            if (light->range > 0.0f) {
                vf q = vf_min(distance * vf_set1(1.0f / light->range), vf_set1(2.0f)), q2 = q * q;
                strength = strength * vf_min(vf_max(one - q2 * q2, zero), one);
            }
        }
        vf nx, ny, nz;
        const vi normal = vi_load(g->normal + at), geometric_normal = vi_load(g->geometric_normal + at);
        es_unpack_normal_v(normal, &nx, &ny, &nz);
        const vf cosine = nx * lx + ny * ly + nz * lz;
        if (!vm_all(vi_eq(normal, geometric_normal))) es_unpack_normal_v(geometric_normal, &nx, &ny, &nz);
        const vf geometric = nx * lx + ny * ly + nz * lz;
        /* the side of the triangle that faces away is in its own shadow, whatever the interpolated normal says */
        lanes = lanes & vm_gt(cosine, zero) & vm_gt(geometric, zero) & vm_gt(strength, zero);
        const uint32_t to = count * VW;
        s->x[count] = x;
        vi_store(s->lanes + to, lanes);
        vf_store(s->towards[0] + to, lx);
        vf_store(s->towards[1] + to, ly);
        vf_store(s->towards[2] + to, lz);
        vf_store(s->strength + to, strength);
        vf_store(s->cosine + to, cosine);
        vf_store(s->geometric + to, geometric);
        count += vm_any(lanes);
    }
    s->count = count;
}

VINL vf slope_of(vf geometric) { return vf_sqrt(vf_max(vf_set1(1.0f) - geometric * geometric, vf_zero())) / vf_max(geometric, vf_set1(0.02f)); }

/* The share of each listed light that arrives, in its strength. */
static void shadow(const direct_row* row, stretch* s)
{
    const es_direct_job* job = row->job;
    const es_gbuffer* g = job->gbuffer;
    const es_light_view* view = job->view;
    const es_light_face* face = view->faces;
    const float* depths = g->depth + (size_t)row->y * g->stride;
    const int taps = (int)job->shadow_filter;
    vf p[3], d[3];
    if (view->face_count > 1) {
        for (uint32_t i = 0; i < s->count; i++) {
            const uint32_t at = i * VW;
            const vm lanes = vi_load(s->lanes + at);
            place(row, s->x[i], vf_load(depths + s->x[i]), p, d);
            const vf slope = slope_of(vf_load(s->geometric + at));
            const vi which = cube_face(vf_neg(vf_load(s->towards[0] + at)), vf_neg(vf_load(s->towards[1] + at)), vf_neg(vf_load(s->towards[2] + at)));
            vf share = vf_zero();
            for (int f = 0; f < 6; f++) {
                const vm here = lanes & vi_eq(which, vi_set1(f));
                if (!vm_any(here)) continue;
                const receiver r = receiver_on(job, &face[f], p[0], p[1], p[2], slope);
                share = vf_select(here, lit_share(&face[f], &r, taps), share);
            }
            vf_store(s->strength + at, vf_and(lanes, vf_load(s->strength + at) * share));
        }
        return;
    }
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t at = i * VW;
        place(row, s->x[i], vf_load(depths + s->x[i]), p, d);
        const receiver r = receiver_on(job, face, p[0], p[1], p[2], slope_of(vf_load(s->geometric + at)));
        vf_store(s->u + at, r.u);
        vf_store(s->v + at, r.v);
        vf_store(s->reference + at, r.reference);
    }
    for (uint32_t i = 0; i < s->count; i++) {
        const uint32_t at = i * VW;
        const receiver r = {vf_load(s->u + at), vf_load(s->v + at), vf_load(s->reference + at)};
        const vf share = taps == 2 ? lit_share(face, &r, 2) : lit_share(face, &r, taps);
        vf_store(s->strength + at, vf_and(vi_load(s->lanes + at), vf_load(s->strength + at) * share));
    }
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
            vf inverse = vf_set1(-1.0f) / vf_sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            for (int k = 0; k < 3; k++) v[k] = rays->orthographic ? vf_set1(-rays->dir[k]) : d[k] * inverse;
            es_unpack_normal_v(vi_load(g->normal + at), &nx, &ny, &nz);
            es_lift_to_horizon_v(nx, ny, nz, &v[0], &v[1], &v[2]);
            es_surface_reflect_gbuffer_v(rg, b, word, nx, ny, nz, vf_load(s->towards[0] + from), vf_load(s->towards[1] + from), vf_load(s->towards[2] + from), v[0], v[1], v[2], &f[0], &f[1], &f[2]);
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
            reflect(&row, &s);
        }
    }
}
