/* The new picture blended with the one before it, row by row (gi/antialias.h). Loads where the taps of eight pixels are neighbours in memory,
 * gathers elsewhere, as gi/kernels/temporal.c does. */
#include "gi/antialias.h"
#include "gi/kernel_table.h"
#include "platform/simd.h"

#define ES_TINY 1e-30f

typedef struct rgb { vf at[3]; } rgb;

VINL rgb load(const float* const planes[3], size_t at) { return (rgb){{vf_load(planes[0] + at), vf_load(planes[1] + at), vf_load(planes[2] + at)}}; }
VINL rgb gather(const float* const planes[3], vi at) { return (rgb){{vf_gather(planes[0], at), vf_gather(planes[1], at), vf_gather(planes[2], at)}}; }
VINL vf luminance(rgb c) { return vf_set1(0.2126f) * c.at[0] + vf_set1(0.7152f) * c.at[1] + vf_set1(0.0722f) * c.at[2]; }
VINL vf range(vf a) { return vf_min(vf_max(a, vf_zero()), vf_set1(1e18f)); } /* so that products stay finite; negative light is bias compensation's */

/* As a display shows it, and back: c / (1 + Y) and c / (1 - Y'), Y' below 1. */
VINL rgb shown(rgb c, vf exposure)
{
    for (int k = 0; k < 3; k++) c.at[k] = range(c.at[k]);
    vf share = vf_set1(1.0f) / (vf_set1(1.0f) + luminance(c) * exposure);
    return (rgb){{c.at[0] * share, c.at[1] * share, c.at[2] * share}};
}
VINL rgb unshown(rgb c, vf exposure)
{
    vf share = vf_set1(1.0f) / vf_max(vf_set1(1.0f) - luminance(c) * exposure, vf_set1(1e-7f));
    return (rgb){{c.at[0] * share, c.at[1] * share, c.at[2] * share}};
}

/* The nearest pixel inside stands in for what is outside. */
VINL rgb history_at(const es_antialias_job* job, uint32_t x, uint32_t y, vf exposure, vm* known)
{
    const es_gbuffer* g = job->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf mx = zero, my = zero;
    if (job->moving) {
        mx = vf_load(g->motion_x + at);
        my = vf_load(g->motion_y + at);
    }
    *known = vm_all_lanes();
    if (!vm_any(vm_ne(mx, zero) | vm_ne(my, zero))) return shown(load(job->history, at), exposure);
    const vf limit = vf_set1(16384.0f), width = vf_set1((float)(g->width - 1)), height = vf_set1((float)(g->height - 1));
    const vf px = vf_min(vf_max(vf_set1((float)x) + vf_iota() - mx, vf_neg(limit)), limit), py = vf_min(vf_max(vf_set1((float)y) - my, vf_neg(limit)), limit);
    *known = vm_gt(px, vf_set1(-0.5f)) & vm_lt(px, width + vf_set1(0.5f)) & vm_gt(py, vf_set1(-0.5f)) & vm_lt(py, height + vf_set1(0.5f));
    const vf fx = vf_floor(px), fy = vf_floor(py), right = px - fx, down = py - fy;
    const vi ix = vi_truncate(fx), iy = vi_truncate(fy), last_x = vi_set1((int32_t)g->width - 1), last_y = vi_set1((int32_t)g->height - 1);
    const int32_t x0 = ix[0], y0 = iy[0];
    const bool together = x0 >= 0 && y0 >= 0 && (uint32_t)x0 + VW < g->width && (uint32_t)y0 + 1 < g->height && vm_all(vi_eq(ix, vi_set1(x0) + vi_iota()) & vi_eq(iy, vi_set1(y0)));
    rgb sum = {{zero, zero, zero}};
    for (int i = 0; i < 4; i++) {
        const vi column = vi_min(vi_max(ix + vi_set1(i & 1), vi_zero()), last_x), row = vi_min(vi_max(iy + vi_set1(i >> 1), vi_zero()), last_y);
        rgb tap = together ? load(job->history, (size_t)((uint32_t)y0 + (uint32_t)(i >> 1)) * g->stride + (uint32_t)x0 + (uint32_t)(i & 1)) : gather(job->history, row * vi_set1((int32_t)g->stride) + column);
        const vf weight = (i & 1 ? right : one - right) * (i >> 1 ? down : one - down);
        tap = shown(tap, exposure);
        for (int k = 0; k < 3; k++) sum.at[k] = sum.at[k] + weight * tap.at[k];
    }
    return sum;
}

void ES_KERNEL(es_gi_antialias)(const es_antialias_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    const vf exposure = vf_set1(job->exposure_scale), blend = vf_set1(job->blend);
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint32_t rows[3] = {y ? y - 1 : y, y, y + 1 < g->height ? y + 1 : y};
        for (uint32_t x = 0; x < g->width; x += VW) {
            const size_t at = (size_t)y * g->stride + x;
            const rgb fresh = load(job->source, at);
            if (!job->history[0]) {
                for (int k = 0; k < 3; k++) vf_store(job->result[k] + at, fresh.at[k]);
                continue;
            }
            const rgb here = shown(fresh, exposure);
            vm known;
            rgb old = history_at(job, x, y, exposure, &known);
            if (job->clamp) {
                const bool inner = x && x + VW < g->width;
                rgb low = here, high = here;
                for (int j = 0; j < 3; j++)
                    for (int i = 0; i < 3; i++) {
                        if (i == 1 && j == 1) continue;
                        const size_t row = (size_t)rows[j] * g->stride;
                        const vi column = vi_min(vi_max(vi_set1((int32_t)x + i - 1) + vi_iota(), vi_zero()), vi_set1((int32_t)g->width - 1));
                        rgb tap = shown(inner ? load(job->source, row + x + (uint32_t)i - 1) : gather(job->source, vi_set1((int32_t)row) + column), exposure);
                        for (int k = 0; k < 3; k++) {
                            low.at[k] = vf_min(low.at[k], tap.at[k]);
                            high.at[k] = vf_max(high.at[k], tap.at[k]);
                        }
                    }
                for (int k = 0; k < 3; k++) old.at[k] = vf_min(vf_max(old.at[k], low.at[k]), high.at[k]);
            }
            const vf share = vf_select(known, blend, vf_set1(1.0f));
            rgb mixed;
            for (int k = 0; k < 3; k++) mixed.at[k] = old.at[k] + share * (here.at[k] - old.at[k]);
            mixed = unshown(mixed, exposure);
            for (int k = 0; k < 3; k++) vf_store(job->result[k] + at, vf_and(vm_gt(mixed.at[k], vf_set1(ES_TINY)), mixed.at[k]));
        }
    }
}
