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

/* Share of the filter's weight that is lit, on one face; lanes outside `lanes` are undefined. A filter of k taps per side is a box
 * of k - 1 texels slid continuously (bilinear for k = 2): weights 1 - f, 1, …, 1, f along each axis; one tap is the nearest. */
static vf lit_share(const es_direct_job* job, const es_light_face* face, vm lanes, vf px, vf py, vf pz, vf slope)
{
    const es_light_view* view = job->view;
    const float* m = face->world_to_clip.m;
    const uint32_t size = face->shadow_view.width;
    vf one = vf_set1(1.0f), half_size = vf_set1(0.5f * (float)size);
    vf cx = row_times(m, 0, px, py, pz), cy = row_times(m, 1, px, py, pz), cz = row_times(m, 2, px, py, pz), cw = row_times(m, 3, px, py, pz);
    vf texels = vf_set1(job->shadow_bias) + vf_set1(job->shadow_slope_bias * 0.5f * (float)job->shadow_filter) * slope;
    vf reference;
    if (view->orthographic) {
        /* depth falls by -m_z per metre along the axis */
        float per_metre = face->shadow_view.projection.m[10];
        reference = cz + vf_set1(per_metre * view->texel_slope) * texels;
    } else {
        vf distance = vf_max(cw, vf_set1(view->near_plane));
        vf towards = distance - texels * vf_set1(view->texel_slope) * distance;
        reference = vf_set1(view->near_plane) / vf_max(towards, vf_set1(view->near_plane));
        vf inverse = one / distance;
        cx = cx * inverse;
        cy = cy * inverse;
    }
    const int taps = (int)job->shadow_filter;
    vf u = (cx + one) * half_size - vf_set1(0.5f * (float)(taps - 1)), v = (one - cy) * half_size - vf_set1(0.5f * (float)(taps - 1));
    vf limit = vf_set1((float)size);
    u = vf_min(vf_max(u, vf_neg(limit)), limit);
    v = vf_min(vf_max(v, vf_neg(limit)), limit);
    vf fu = vf_floor(u), fv = vf_floor(v);
    vi iu = vi_truncate(fu), iv = vi_truncate(fv), last = vi_set1((int32_t)size - 1);
    fu = u - fu;
    fv = v - fv;
    vf sum = vf_zero();
    /* with t taps the box reaches from tap 0 (weight 1 - f) to tap t - 1 (weight f) */
    for (int y = 0; y < taps; y++) {
        vf wy = taps == 1 ? one : y == 0 ? one - fv : y == taps - 1 ? fv : one;
        vi row = vi_min(vi_max(iv + vi_set1(y), vi_zero()), last) * vi_set1((int32_t)size);
        for (int x = 0; x < taps; x++) {
            vf wx = taps == 1 ? one : x == 0 ? one - fu : x == taps - 1 ? fu : one;
            vi column = vi_min(vi_max(iu + vi_set1(x), vi_zero()), last);
            vf stored = vf_gather(face->shadow_depth, row + column);
            sum = sum + vf_and(vm_ge(reference, stored), wx * wy);
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

void ES_KERNEL(es_gi_direct)(const es_direct_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const es_pixel_rays* rays = &job->rays;
    const es_light_view* view = job->view;
    const es_light_state* light = &view->light;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    /* a millionth of the scene's extent: a light in a surface leaves its neighbourhood finite */
    const float nearest = view->near_plane * 1e-3f;
    const float cone_scale = 1.0f / (light->cos_inner - light->cos_outer > 1e-6f ? light->cos_inner - light->cos_outer : 1e-6f);
    for (uint32_t y = row_begin; y < row_end; y++) {
        float fy = (float)y;
        for (uint32_t x = 0; x < g->width; x += VW) {
            size_t at = (size_t)y * g->stride + x;
            vf depth = vf_load(g->depth + at);
            vi surface_word = vi_load(g->surface + at);
            vm lanes = vm_gt(depth, zero) & ~vi_eq(vi_shift_right_logical(surface_word, 24), vi_set1(ES_SURFACE_UNLIT)) & vm_first((int32_t)(g->width - x));
            vf out_r = zero, out_g = zero, out_b = zero;
            if (vm_any(lanes)) {
                vf fx = vf_set1((float)x) + vf_iota();
                vf dx = vf_set1(rays->dir[0] + fy * rays->dir_dy[0]) + fx * vf_set1(rays->dir_dx[0]);
                vf dy = vf_set1(rays->dir[1] + fy * rays->dir_dy[1]) + fx * vf_set1(rays->dir_dx[1]);
                vf dz = vf_set1(rays->dir[2] + fy * rays->dir_dy[2]) + fx * vf_set1(rays->dir_dx[2]);
                vf px = vf_set1(rays->base[0] + fy * rays->base_dy[0]) + fx * vf_set1(rays->base_dx[0]) + depth * dx;
                vf py = vf_set1(rays->base[1] + fy * rays->base_dy[1]) + fx * vf_set1(rays->base_dx[1]) + depth * dy;
                vf pz = vf_set1(rays->base[2] + fy * rays->base_dy[2]) + fx * vf_set1(rays->base_dx[2]) + depth * dz;
                vf lx, ly, lz, strength;
                if (light->type == ES_LIGHT_DIRECTIONAL) {
                    lx = vf_set1(-light->direction.x);
                    ly = vf_set1(-light->direction.y);
                    lz = vf_set1(-light->direction.z);
                    strength = one;
                } else {
                    lx = vf_set1(light->position.x) - px;
                    ly = vf_set1(light->position.y) - py;
                    lz = vf_set1(light->position.z) - pz;
                    vf d2 = vf_max(lx * lx + ly * ly + lz * lz, vf_set1(nearest * nearest));
                    vf d = vf_sqrt(d2), inverse = one / d;
                    lx = lx * inverse;
                    ly = ly * inverse;
                    lz = lz * inverse;
                    strength = inverse * inverse;
                    if (light->type == ES_LIGHT_SPOT) {
                        vf cosine = vf_neg(lx * vf_set1(light->direction.x) + ly * vf_set1(light->direction.y) + lz * vf_set1(light->direction.z));
                        vf t = vf_min(vf_max((cosine - vf_set1(light->cos_outer)) * vf_set1(cone_scale), zero), one);
                        strength = strength * t * t;
                    }
                    if (light->range > 0.0f) {
                        vf q = vf_min(d * vf_set1(1.0f / light->range), vf_set1(2.0f)), q2 = q * q;
                        strength = strength * vf_min(vf_max(one - q2 * q2, zero), one);
                    }
                }
                vf nx, ny, nz, gx, gy, gz;
                const vi normal = vi_load(g->normal + at), geometric_normal = vi_load(g->geometric_normal + at);
                es_unpack_normal_v(normal, &nx, &ny, &nz);
                gx = nx;
                gy = ny;
                gz = nz;
                if (!vm_all(vi_eq(normal, geometric_normal))) es_unpack_normal_v(geometric_normal, &gx, &gy, &gz);
                vf cosine = nx * lx + ny * ly + nz * lz;
                vf geometric = gx * lx + gy * ly + gz * lz;
                /* the side of the triangle that faces away is in its own shadow, whatever the interpolated normal says */
                lanes = lanes & vm_gt(cosine, zero) & vm_gt(geometric, zero) & vm_gt(strength, zero);
                if (vm_any(lanes)) {
                    vf slope = vf_sqrt(vf_max(one - geometric * geometric, zero)) / vf_max(geometric, vf_set1(0.02f));
                    vf share = zero;
                    if (view->face_count == 1) {
                        share = lit_share(job, &view->faces[0], lanes, px, py, pz, slope);
                    } else {
                        vi face = cube_face(vf_neg(lx), vf_neg(ly), vf_neg(lz));
                        for (int f = 0; f < 6; f++) {
                            vm here = lanes & vi_eq(face, vi_set1(f));
                            if (vm_any(here)) share = vf_select(here, lit_share(job, &view->faces[f], here, px, py, pz, slope), share);
                        }
                    }
                    strength = vf_and(lanes, strength * share);
                    if (vm_any(vm_gt(strength, zero))) {
                        const vi rg = vi_load(g->albedo_rg + at), b = vi_load(g->albedo_b + at);
                        vf fr, fg, fb;
                        if (vm_all(~lanes | es_surface_word_is_diffuse_v(surface_word))) {
                            /* what the model comes to without a lobe, wherever the eye is: the same bits */
                            const vf share = vf_set1(0.318309886f);
                            const es_surface_v s = es_surface_of_gbuffer_v(rg, b, surface_word);
                            fr = s.albedo[0] * share;
                            fg = s.albedo[1] * share;
                            fb = s.albedo[2] * share;
                        } else {
                            vf vx, vy, vz;
                            if (rays->orthographic) {
                                vx = vf_set1(-rays->dir[0]);
                                vy = vf_set1(-rays->dir[1]);
                                vz = vf_set1(-rays->dir[2]);
                            } else {
                                vf inverse = vf_set1(-1.0f) / vf_sqrt(dx * dx + dy * dy + dz * dz);
                                vx = dx * inverse;
                                vy = dy * inverse;
                                vz = dz * inverse;
                            }
                            es_lift_to_horizon_v(nx, ny, nz, &vx, &vy, &vz);
                            es_surface_reflect_gbuffer_v(rg, b, surface_word, nx, ny, nz, lx, ly, lz, vx, vy, vz, &fr, &fg, &fb);
                        }
                        /* irradiance of the light times the model; cos is in the irradiance */
                        vf e = strength * vf_max(cosine, zero);
                        out_r = vf_and(lanes, e * vf_set1(light->radiant[0]) * fr);
                        out_g = vf_and(lanes, e * vf_set1(light->radiant[1]) * fg);
                        out_b = vf_and(lanes, e * vf_set1(light->radiant[2]) * fb);
                    }
                }
            }
            if (!job->first) {
                out_r = out_r + vf_load(job->out[0] + at);
                out_g = out_g + vf_load(job->out[1] + at);
                out_b = out_b + vf_load(job->out[2] + at);
            }
            vf_store(job->out[0] + at, out_r);
            vf_store(job->out[1] + at, out_g);
            vf_store(job->out[2] + at, out_b);
        }
    }
}
