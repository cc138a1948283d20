/* The environment where nothing is seen (gi/background.h). The texel is found as the reference finds it, but for angles in float: error 3e-7 radians,
 * which is seen only in pixels that close to a texel's edge. */
#include "gi/background.h"
#include "gi/kernel_table.h"
#include "platform/maths.h"
#include "platform/simd.h"
#include "raster/stages.h"

/* Cephes' atanf (Moshier 1992), over the whole circle; (0, 0) gives some angle. */
VINL vf angle_of(vf y, vf x)
{
    const vf ax = vf_abs(x), ay = vf_abs(y), zero = vf_zero(), one = vf_set1(1.0f);
    const vf t = vf_min(ax, ay) / vf_max(vf_max(ax, ay), vf_set1(1e-30f));
    const vm wide = vm_gt(t, vf_set1(0.414213562f));
    const vf r = vf_select(wide, (t - one) / (t + one), t), z = r * r;
    vf a = (((vf_set1(8.05374449538e-2f) * z - vf_set1(1.38776856032e-1f)) * z + vf_set1(1.99777106478e-1f)) * z - vf_set1(3.33329491539e-1f)) * z * r + r;
    a = a + vf_and(wide, vf_set1(0.785398163f));
    a = vf_select(vm_gt(ay, ax), vf_set1(1.57079633f) - a, a);
    a = vf_select(vm_lt(x, zero), vf_set1(ES_PI) - a, a);
    return vf_copysign(a, y);
}

/* Where (x, y, z), of any length, is in the image: the index of its texel. */
VINL vi texel_of(const es_environment_desc* e, vf x, vf y, vf z)
{
    const es_image* image = e->image;
    vf u = (angle_of(x, vf_neg(z)) + vf_set1(e->rotation)) * vf_set1(0.5f / ES_PI) + vf_set1(0.5f);
    const vf v = angle_of(vf_sqrt(x * x + z * z), y) * vf_set1(1.0f / ES_PI);
    u = u - vf_floor(u);
    const vi column = vi_min(vi_truncate(u * vf_set1((float)image->width)), vi_set1((int32_t)image->width - 1));
    const vi row = vi_min(vi_truncate(v * vf_set1((float)image->height)), vi_set1((int32_t)image->height - 1));
    return row * vi_set1((int32_t)image->width) + column;
}

VINL void put_motion(const es_background_job* job, vm empty, const vf d[3], uint32_t x, uint32_t y)
{
    const es_gbuffer* g = job->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    vf last[3];
    for (int i = 0; i < 3; i++) last[i] = d[0] * vf_set1(job->last_pixel[i][0]) + d[1] * vf_set1(job->last_pixel[i][1]) + d[2] * vf_set1(job->last_pixel[i][2]);
    const vm before = vm_gt(last[2], vf_set1(1e-6f));
    const vf inverse = vf_set1(1.0f) / vf_select(before, last[2], vf_set1(1.0f)), away = vf_set1(ES_MOTION_BEHIND);
    const vf mx = vf_set1((float)x) + vf_iota() - last[0] * inverse, my = vf_set1((float)y) - last[1] * inverse;
    vf_store(g->motion_x + at, vf_select(empty, vf_select(before, vf_clamp(mx, vf_neg(away), away), away), vf_load(g->motion_x + at)));
    vf_store(g->motion_y + at, vf_select(empty, vf_select(before, vf_clamp(my, vf_neg(away), away), away), vf_load(g->motion_y + at)));
}

void ES_KERNEL(es_gi_background)(const es_background_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const es_environment_desc* e = job->environment;
    const es_pixel_rays* r = &job->rays;
    for (uint32_t y = row_begin; y < row_end; y++) {
        const float fy = (float)y;
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            const vm empty = ~vm_gt(vf_load(g->depth + at), vf_zero());
            vf light[3] = {vf_zero(), vf_zero(), vf_zero()};
            if (vm_any(empty)) {
                vf d[3];
                for (int k = 0; k < 3; k++) d[k] = vf_set1(r->dir[k] + fy * r->dir_dy[k]) + (vf_set1((float)x) + vf_iota()) * vf_set1(r->dir_dx[k]);
                vi texel = vi_zero();
                if (e->image) texel = texel_of(e, d[0], d[1], d[2]) * vi_set1((int32_t)e->image->channels);
                for (int k = 0; k < 3; k++) {
                    const vf factor = vf_set1(e->radiance[k]);
                    light[k] = vf_and(empty, e->image ? vf_gather(e->image->pixels, texel + vi_set1(k)) * factor : factor);
                }
                if (job->moving) put_motion(job, empty, d, x, y);
            }
            for (int k = 0; k < 3; k++) vf_store(job->out[k] + at, light[k]);
        }
    }
}
