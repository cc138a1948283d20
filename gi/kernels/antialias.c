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

/* What a polished surface shows does not move as the surface does: of moving metal, a fourth at least, the new picture has ES_METAL_SHARE. */
#define ES_METAL_SHARE 0.4f
VINL vm is_metal(const es_gbuffer* g, size_t at) { return vi_gt(vi_load(g->surface + at) & vi_set1(0xff), vi_set1(63)); }

/* `share` of the new picture goes with it. The nearest pixel inside stands in for what is outside. */
VINL rgb history_at(const es_antialias_job* job, uint32_t x, uint32_t y, vf exposure, vf* share)
{
    const es_gbuffer* g = job->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf mx = zero, my = zero;
    if (job->moving) {
        mx = vf_load(g->motion_x + at);
        my = vf_load(g->motion_y + at);
    }
    *share = vf_set1(job->blend);
    const vm moved = vm_ne(mx, zero) | vm_ne(my, zero);
    if (!vm_any(moved)) return shown(load(job->history, at), exposure);
    const vf limit = vf_set1(16384.0f), width = vf_set1((float)(g->width - 1)), height = vf_set1((float)(g->height - 1));
    const vf px = vf_min(vf_max(vf_set1((float)x) + vf_iota() - mx, vf_neg(limit)), limit), py = vf_min(vf_max(vf_set1((float)y) - my, vf_neg(limit)), limit);
    const vm known = vm_gt(px, vf_set1(-0.5f)) & vm_lt(px, width + vf_set1(0.5f)) & vm_gt(py, vf_set1(-0.5f)) & vm_lt(py, height + vf_set1(0.5f));
    *share = vf_select(known, vf_select(moved & is_metal(g, at), vf_max(vf_set1(ES_METAL_SHARE), *share), *share), one);
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

/* ---- the range of what is new ------------------------------------------------------------------------------------------- */

/* Columns of a strip, a vector more on either side. Its rows are made once and pass through here: three of them as a display shows them, and
 * of the row in their middle the range over the three, of which a pixel's is that of three columns. */
enum { STRIP = 128, STRIP_FLOATS = STRIP + 2 * VW };
typedef struct strip {
    uint32_t first, end;       /* columns that are made, whole vectors */
    uint32_t x0;               /* the column at index VW */
    float rows[3][3][STRIP_FLOATS], low[3][STRIP_FLOATS], high[3][STRIP_FLOATS];
} strip;

static void start_strip(strip* s, const es_gbuffer* g, uint32_t x0)
{
    s->x0 = x0;
    s->first = x0 ? x0 - VW : 0;
    s->end = x0 + STRIP + VW < g->stride ? x0 + STRIP + VW : g->stride;
}

/* Row y, to the place of row y mod 3. */
static void make_row(const es_antialias_job* job, strip* s, uint32_t y)
{
    const es_gbuffer* g = job->gbuffer;
    const vf exposure = vf_set1(job->exposure_scale);
    for (uint32_t x = s->first; x < s->end; x += VW) {
        const rgb c = shown(load(job->source, (size_t)y * g->stride + x), exposure);
        for (int k = 0; k < 3; k++) vf_store(s->rows[y % 3][k] + x + VW - s->x0, c.at[k]);
    }
    for (int k = 0; k < 3; k++) { /* beside the picture's border its nearest pixel stands in */
        float* row = s->rows[y % 3][k] + VW;
        if (!s->x0) row[-1] = row[0];
        if (g->width <= s->x0 + STRIP) row[g->width - s->x0] = row[g->width - s->x0 - 1];
    }
}

static void make_range(const es_gbuffer* g, strip* s, uint32_t y)
{
    const uint32_t above = (y ? y - 1 : y) % 3, here = y % 3, below = (y + 1 < g->height ? y + 1 : y) % 3;
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < STRIP_FLOATS; i += VW) {
            const vf a = vf_load(s->rows[above][k] + i), b = vf_load(s->rows[here][k] + i), c = vf_load(s->rows[below][k] + i);
            vf_store(s->low[k] + i, vf_min(vf_min(a, b), c));
            vf_store(s->high[k] + i, vf_max(vf_max(a, b), c));
        }
}

/* ---- rows -------------------------------------------------------------------------------------------------------------- */

/* Eight pixels; `new` is what there is of them now, as shown. */
VINL void resolve(const es_antialias_job* job, uint32_t x, uint32_t y, rgb new, const strip* range)
{
    const size_t at = (size_t)y * job->gbuffer->stride + x;
    const vf exposure = vf_set1(job->exposure_scale);
    vf share;
    rgb old = history_at(job, x, y, exposure, &share);
    for (int k = 0; k < 3 && range; k++) {
        const float *low = range->low[k] + (x + VW - range->x0), *high = range->high[k] + (x + VW - range->x0);
        const vf least = vf_min(vf_min(vf_load(low - 1), vf_load(low)), vf_load(low + 1)), most = vf_max(vf_max(vf_load(high - 1), vf_load(high)), vf_load(high + 1));
        old.at[k] = vf_min(vf_max(old.at[k], least), most);
    }
    rgb mixed;
    for (int k = 0; k < 3; k++) mixed.at[k] = old.at[k] + share * (new.at[k] - old.at[k]);
    mixed = unshown(mixed, exposure);
    for (int k = 0; k < 3; k++) vf_store(job->result[k] + at, vf_and(vm_gt(mixed.at[k], vf_set1(ES_TINY)), mixed.at[k]));
}

void ES_KERNEL(es_gi_antialias)(const es_antialias_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    if (!job->history[0]) {
        const size_t first = (size_t)row_begin * g->stride, bytes = (size_t)(row_end - row_begin) * g->stride * sizeof(float);
        for (int k = 0; k < 3; k++) memcpy(job->result[k] + first, job->source[k] + first, bytes);
        return;
    }
    if (!job->clamp) {
        for (uint32_t y = row_begin; y < row_end; y++)
            for (uint32_t x = 0; x < g->width; x += VW) resolve(job, x, y, shown(load(job->source, (size_t)y * g->stride + x), vf_set1(job->exposure_scale)), NULL);
        return;
    }
    strip s = {0};
    for (uint32_t x0 = 0; x0 < g->width; x0 += STRIP) {
        start_strip(&s, g, x0);
        const uint32_t x1 = x0 + STRIP < g->width ? x0 + STRIP : g->width;
        if (row_begin) make_row(job, &s, row_begin - 1);
        make_row(job, &s, row_begin);
        for (uint32_t y = row_begin; y < row_end; y++) {
            if (y + 1 < g->height) make_row(job, &s, y + 1);
            make_range(g, &s, y);
            for (uint32_t x = x0; x < x1; x += VW) {
                const size_t i = x + VW - x0;
                resolve(job, x, y, (rgb){{vf_load(s.rows[y % 3][0] + i), vf_load(s.rows[y % 3][1] + i), vf_load(s.rows[y % 3][2] + i)}}, &s);
            }
        }
    }
}
