/* Temporal coherence: tiles compared with their history, and rows of pixels blended with it (gi/temporal.h).
 *
 * Where all eight pixels moved by the same whole number of pixels plus one common row's fraction, as they nearly always do, their taps are
 * neighbours in memory and are loaded, not gathered. What stands still has one tap. Values are kept above ES_TINY, or else 0: history
 * that fades by a share each frame would end in denormals.
 */
#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "gi/temporal.h"
#include "platform/simd.h"
#include "raster/pack.h"

#define ES_TINY 1e-30f
#define ES_INVERSE_PI 0.318309886f

VINL vf luminance(const vf* c) { return vf_set1(0.2126f) * c[0] + vf_set1(0.7152f) * c[1] + vf_set1(0.0722f) * c[2]; }

/* Where the point at (x, y) was expected to be seen last frame, as a depth. */
VINL vf depth_expected(const es_temporal_job* job, vf x, vf y, vf depth)
{
    const float *a = job->depth_then[0], *b = job->depth_then[1];
    vf per_depth = vf_set1(b[0]) + vf_set1(b[1]) * x + vf_set1(b[2]) * y;
    return vf_set1(a[0]) + vf_set1(a[1]) * x + vf_set1(a[2]) * y + depth * per_depth;
}

/* ---- tiles ----------------------------------------------------------------------------------------------------------- */

/* May a lobe reflect anything at a row of a tile's samples, or have done so where they were? */
static bool lobes_count(const es_temporal_job* job, uint32_t tile, uint32_t row, vi from)
{
    const uint32_t stride = job->gbuffer->stride, chunks = es_lit_chunks(stride), x0 = tile * ES_TEMPORAL_TILE;
    if (es_lit_within(job->source_lit, chunks, x0, x0 + ES_TEMPORAL_TILE, row, row + 1)) return true;
    uint8_t bits = 0;
    for (int i = 0; i < VW; i++) bits |= job->history_lit[(uint32_t)from[i] / stride * chunks + (uint32_t)from[i] % stride / ES_LIT_COLUMNS];
    return bits & 1;
}

/* The share of the reset of each tile of a row: 0 … 1. */
void ES_KERNEL(es_gi_temporal_compare)(const es_temporal_job* job, uint32_t tile_row, float* shares)
{
    const es_gbuffer *g = job->gbuffer, *then = job->previous;
    const vf zero = vf_zero(), pi = vf_set1(ES_INVERSE_PI), half = vf_set1(0.5f);
    const vi last_x = vi_set1((int32_t)g->width - 1), last_y = vi_set1((int32_t)g->height - 1), stride = vi_set1((int32_t)g->stride);
    const vf limit_x = vf_set1((float)g->width), limit_y = vf_set1((float)g->height);
    for (uint32_t tile = 0; tile < job->tile_columns; tile++) {
        const vi column = vi_set1((int32_t)(tile * ES_TEMPORAL_TILE + ES_TEMPORAL_SAMPLE / 2)) + vi_iota() * vi_set1(ES_TEMPORAL_SAMPLE);
        const vm inside = vi_lt(column, vi_set1((int32_t)g->width));
        vf sum_now = zero, sum_then = zero;
        for (uint32_t j = ES_TEMPORAL_SAMPLE / 2; j < ES_TEMPORAL_TILE; j += ES_TEMPORAL_SAMPLE) {
            const uint32_t row = tile_row * ES_TEMPORAL_TILE + j;
            if (row >= g->height) break;
            vi at = vi_set1((int32_t)row) * stride + vi_min(column, last_x);
            vf depth = vf_gather(g->depth, at), x = vf_from_int(column), y = vf_set1((float)row);
            vm valid = inside & vm_gt(depth, zero);
            if (!vm_any(valid)) continue;
            vi from = at;
            if (job->moving) {
                vf px = vf_floor(x - vf_gather(g->motion_x, at) + half), py = vf_floor(y - vf_gather(g->motion_y, at) + half);
                valid &= vm_ge(px, zero) & vm_ge(py, zero) & vm_lt(px, limit_x) & vm_lt(py, limit_y);
                from = vi_min(vi_max(vi_truncate(py), vi_zero()), last_y) * stride + vi_min(vi_max(vi_truncate(px), vi_zero()), last_x);
            }
            vf nx, ny, nz, tx, ty, tz, expected = depth_expected(job, x, y, depth), seen = vf_gather(then->depth, from);
            es_unpack_normal_v(vi_gather(g->normal, at), &nx, &ny, &nz);
            es_unpack_normal_v(vi_gather(then->normal, from), &tx, &ty, &tz);
            valid &= vm_gt(seen, zero) & vm_le(vf_abs(seen - expected), expected * vf_set1(job->depth_threshold)) & vm_ge(nx * tx + ny * ty + nz * tz, vf_set1(job->normal_threshold));
            vf now[3], before[3];
            for (int k = 0; k < 3; k++) {
                now[k] = vf_gather(job->source[k], at) * pi;
                before[k] = vf_gather(job->history[k], from) * pi;
            }
            if (job->history_count == 6 && lobes_count(job, tile, row, from))
                for (int k = 0; k < 3; k++) {
                    now[k] = now[k] + vf_gather(job->source[3 + k], at);
                    before[k] = before[k] + vf_gather(job->history[3 + k], from);
                }
            sum_now = sum_now + vf_and(valid, luminance(now));
            sum_then = sum_then + vf_and(valid, luminance(before));
        }
        const float a = vf_sum(sum_now), b = vf_sum(sum_then), larger = a > b ? a : b, difference = a > b ? a - b : b - a;
        float share = 0.0f;
        if (larger > ES_TINY) {
            const float over = difference / larger - job->reset_low, range = job->reset_high - job->reset_low;
            share = over <= 0.0f ? 0.0f : over >= range ? 1.0f : over / range;
        }
        shares[tile] = share;
    }
}

/* ---- pixels -------------------------------------------------------------------------------------------------------------- */

/* The four taps of eight pixels: neighbours in memory from `first` on, or anywhere. */
typedef struct taps { bool together; size_t first[4]; vi at[4]; } taps;

VINL vf tap(const float* plane, const taps* t, int i) { return t->together ? vf_load(plane + t->first[i]) : vf_gather(plane, t->at[i]); }
VINL vi tap_word(const uint32_t* plane, const taps* t, int i) { return t->together ? vi_load(plane + t->first[i]) : vi_gather(plane, t->at[i]); }

/* Rows of the reset, interpolated down to row y: one number a tile, of which the pixels of a tile take the two nearest. */
static void reset_row(const es_temporal_job* job, uint32_t y, float* row)
{
    const float at = ((float)y + 0.5f) / ES_TEMPORAL_TILE - 0.5f;
    const uint32_t upper = at > 0.0f ? (uint32_t)at : 0, lower = upper + 1 < job->tile_rows && at > 0.0f ? upper + 1 : upper;
    const float share = at > 0.0f ? at - (float)upper : 0.0f;
    for (uint32_t i = 0; i < job->tile_columns; i++) {
        const float a = job->reset[(size_t)upper * job->tile_columns + i], b = job->reset[(size_t)lower * job->tile_columns + i];
        row[i] = a + (b - a) * share;
    }
}

/* Of eight pixels from x on: x is a multiple of eight, so that they lie between the same two tiles' centres. */
VINL vf reset_of(const es_temporal_job* job, const float* row, uint32_t x)
{
    const uint32_t middle = x + ES_TEMPORAL_TILE / 2;
    const uint32_t right = middle / ES_TEMPORAL_TILE < job->tile_columns ? middle / ES_TEMPORAL_TILE : job->tile_columns - 1;
    const uint32_t left = middle >= ES_TEMPORAL_TILE ? middle / ES_TEMPORAL_TILE - 1 : 0;
    vf share = (vf_from_int(vi_set1((int32_t)(middle % ES_TEMPORAL_TILE)) + vi_iota()) + vf_set1(0.5f)) * vf_set1(1.0f / ES_TEMPORAL_TILE);
    return vf_set1(row[left]) + (vf_set1(row[right]) - vf_set1(row[left])) * share;
}

/* The range of a plane over 3 × 3 pixels; beside the picture's border its nearest pixel stands in. */
VINL void neighbourhood(const float* plane, const es_gbuffer* g, uint32_t x, uint32_t y, vf* low, vf* high)
{
    const uint32_t rows[3] = {y ? y - 1 : y, y, y + 1 < g->height ? y + 1 : y};
    const bool inner = x && x + VW < g->width;
    vi columns[3];
    for (int i = 0; i < 3; i++) columns[i] = vi_min(vi_max(vi_set1((int32_t)x + i - 1) + vi_iota(), vi_zero()), vi_set1((int32_t)g->width - 1));
    for (int j = 0; j < 3; j++) {
        const float* row = plane + (size_t)rows[j] * g->stride;
        for (int i = 0; i < 3; i++) {
            vf a = inner ? vf_load(row + x + (uint32_t)i - 1) : vf_gather(row, columns[i]);
            *low = i + j ? vf_min(*low, a) : a;
            *high = i + j ? vf_max(*high, a) : a;
        }
    }
}

/* `planes`, `with_history` are constants at every call */
VINL void blend_row(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y, const float* resets, uint32_t planes, uint32_t with_history)
{
    const es_gbuffer *g = job->gbuffer, *then = job->previous;
    const vf zero = vf_zero(), one = vf_set1(1.0f), row = vf_set1((float)y);
    const vf per_width = vf_set1(1.0f / (float)g->width), per_height = vf_set1(1.0f / (float)g->height), per_extent = vf_set1(1.0f / job->extent);
    for (uint32_t x = x0; x < x1; x += VW) {
        const size_t at = (size_t)y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        const vm seen = vm_gt(depth, zero);
        vf fresh[6], confidence = zero, old[6];
        for (uint32_t k = 0; k < planes; k++) fresh[k] = vf_load(job->source[k] + at);
        if (vm_any(seen)) {
            const vf column = vf_set1((float)x) + vf_iota();
            vf mx = zero, my = zero, weight[4] = {one, zero, zero, zero};
            taps t = {.together = true, .first = {at, at, at, at}};
            int count = 1;
            if (job->moving) {
                mx = vf_load(g->motion_x + at);
                my = vf_load(g->motion_y + at);
            }
            if (vm_any(vm_ne(mx, zero) | vm_ne(my, zero))) {
                count = 4;
                /* far outside is outside: kept where truncation has a meaning */
                const vf limit = vf_set1(16384.0f);
                const vf px = vf_min(vf_max(column - mx, vf_neg(limit)), limit), py = vf_min(vf_max(row - my, vf_neg(limit)), limit);
                const vf fx = vf_floor(px), fy = vf_floor(py), right = px - fx, down = py - fy;
                const vi ix = vi_truncate(fx), iy = vi_truncate(fy);
                const vi last_x = vi_set1((int32_t)g->width - 1), last_y = vi_set1((int32_t)g->height - 1);
                const vm in_x[2] = {vm_ge(fx, zero) & ~vi_gt(ix, last_x), vm_ge(fx, vf_set1(-1.0f)) & vi_lt(ix, last_x)};
                const vm in_y[2] = {vm_ge(fy, zero) & ~vi_gt(iy, last_y), vm_ge(fy, vf_set1(-1.0f)) & vi_lt(iy, last_y)};
                const vf wx[2] = {one - right, right}, wy[2] = {one - down, down};
                for (int i = 0; i < 4; i++) weight[i] = vf_and(in_x[i & 1] & in_y[i >> 1], wx[i & 1] * wy[i >> 1]);
                const int32_t x0 = ix[0], y0 = iy[0];
                t.together = x0 >= 0 && y0 >= 0 && (uint32_t)x0 + VW < g->width && (uint32_t)y0 + 1 < g->height && vm_all(vi_eq(ix, vi_set1(x0) + vi_iota()) & vi_eq(iy, vi_set1(y0)));
                for (int i = 0; i < 4; i++) {
                    if (t.together) t.first[i] = (size_t)((uint32_t)y0 + (uint32_t)(i >> 1)) * g->stride + (uint32_t)x0 + (uint32_t)(i & 1);
                    else t.at[i] = vi_min(vi_max(iy + vi_set1(i >> 1), vi_zero()), last_y) * vi_set1((int32_t)g->stride) + vi_min(vi_max(ix + vi_set1(i & 1), vi_zero()), last_x);
                }
            }
            const vf expected = depth_expected(job, column, row, depth), tolerance = expected * vf_set1(job->depth_threshold);
            vf nx, ny, nz, total = zero, depth_sum = zero, dot_sum = zero;
            es_unpack_normal_v(vi_load(g->normal + at), &nx, &ny, &nz);
            for (uint32_t k = 0; k < with_history; k++) old[k] = zero;
            for (int i = 0; i < count; i++) {
                vf tx, ty, tz, there = tap(then->depth, &t, i);
                es_unpack_normal_v(tap_word(then->normal, &t, i), &tx, &ty, &tz);
                const vf dot = nx * tx + ny * ty + nz * tz;
                const vm same = seen & vm_gt(there, zero) & vm_le(vf_abs(there - expected), tolerance) & vm_ge(dot, vf_set1(job->normal_threshold));
                weight[i] = vf_and(same, weight[i]);
                total = total + weight[i];
                depth_sum = depth_sum + weight[i] * there;
                dot_sum = dot_sum + weight[i] * dot;
                for (uint32_t k = 0; k < with_history; k++) old[k] = old[k] + weight[i] * tap(job->history[k], &t, i);
            }
            /* a thousandth of a pixel is no history */
            const vm known = vm_gt(total, vf_set1(1e-3f));
            const vf share = one / vf_select(known, total, one);
            for (uint32_t k = 0; k < with_history; k++) old[k] = old[k] * share;
            const vf dx = mx * per_width, dy = my * per_height, dz = (depth - depth_sum * share) * per_extent;
            const vf moved = vf_sqrt(dx * dx + dy * dy + dz * dz) * vf_set1(job->position);
            const vf turned = (one - dot_sum * share) * vf_set1(job->normal);
            vf squares = zero;
            for (uint32_t k = 0; k < 3; k++) {
                vf d = (fresh[k] - old[k]) * vf_set1(ES_INVERSE_PI);
                if (with_history == 6) d = d + (fresh[3 + k] - old[3 + k]);
                d = vf_min(vf_abs(d) * vf_set1(job->exposure_scale), one); /* more saturates as well */
                squares = squares + d * d;
            }
            const vf lit = vf_min(squares * vf_sqrt(squares), one) * vf_set1(job->illumination);
            confidence = vf_set1(job->base) * vf_min(vf_max(one - vf_max(vf_max(moved, turned), lit), zero), one);
            if (resets) confidence = confidence * (one - reset_of(job, resets, x));
            confidence = vf_and(known, confidence);
            if (job->clamp > 0.0f)
                for (uint32_t k = 0; k < with_history; k++) {
                    vf low, high;
                    neighbourhood(job->source[k], g, x, y, &low, &high);
                    old[k] = vf_min(vf_max(old[k], low * vf_set1(1.0f - job->clamp)), high * vf_set1(1.0f + job->clamp));
                }
        }
        if (job->confidence) vf_store(job->confidence + at, confidence);
        if (!job->result[0]) continue;
        for (uint32_t k = 0; k < planes; k++) {
            vf value = fresh[k];
            if (k < with_history && vm_any(vm_gt(confidence, zero))) {
                /* as a step from the new value: where both are equal, it stays exactly */
                value = value + vf_and(vm_gt(confidence, zero), confidence * (old[k] - value));
                value = vf_and(vm_gt(vf_abs(value), vf_set1(ES_TINY)), value);
            }
            vf_store(job->result[k] + at, value);
        }
    }
}

/* By the planes that are blended and those of them that have history; once each, as both callers below need them. */
#define ES_BLEND_(name, planes, with_history)                                                                                              \
    static __attribute__((noinline)) void name(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y, const float* resets)       \
    {                                                                                                                                      \
        blend_row(job, x0, x1, y, resets, planes, with_history);                                                                           \
    }
ES_BLEND_(blend_diffuse, 3, 3)
ES_BLEND_(blend_both, 6, 6)
ES_BLEND_(blend_new_lobes, 6, 3)
#undef ES_BLEND_

/* Of pixels [x0, x1) of row y: do what lobes reflect there, and all of its history that their movement leads to, hold zeros alone? */
static bool lobes_are_dark(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t chunks = es_lit_chunks(g->stride);
    if (es_lit_within(job->source_lit, chunks, x0, x1, y, y + 1)) return false;
    if (job->history_count < 6) return true;
    if (!job->moving) return !es_lit_within(job->history_lit, chunks, x0, x1, y, y + 1);
    const size_t row = (size_t)y * g->stride;
    vf left = vf_zero(), right = left, up = left, down = left;
    for (uint32_t x = x0; x < x1; x += VW) {
        const vf mx = vf_load(g->motion_x + row + x), my = vf_load(g->motion_y + row + x);
        left = vf_max(left, mx);
        right = vf_min(right, mx);
        up = vf_max(up, my);
        down = vf_min(down, my);
    }
    float reach[4] = {left[0], -right[0], up[0], -down[0]};
    for (int i = 1; i < VW; i++) {
        reach[0] = reach[0] < left[i] ? left[i] : reach[0];
        reach[1] = reach[1] < -right[i] ? -right[i] : reach[1];
        reach[2] = reach[2] < up[i] ? up[i] : reach[2];
        reach[3] = reach[3] < -down[i] ? -down[i] : reach[3];
    }
    uint32_t r[4];
    for (int i = 0; i < 4; i++) {
        if (!(reach[i] < 64.0f)) return false;
        r[i] = reach[i] > 0.0f ? (uint32_t)reach[i] + 2 : 1; /* a tap beyond, and rounding */
    }
    return !es_lit_within(job->history_lit, chunks, x0 > r[0] ? x0 - r[0] : 0, x1 + r[1], y > r[2] ? y - r[2] : 0, y + r[3] + 1 < g->height ? y + r[3] + 1 : g->height);
}

/* A chunk at a time: three planes where lobes are dark, and zeros for the others unless they are there. */
static void blend_chunks(const es_temporal_job* job, uint32_t y, const float* resets)
{
    const es_gbuffer* g = job->gbuffer;
    uint8_t* lit = job->result_lit + (size_t)y * es_lit_chunks(g->stride);
    for (uint32_t x0 = 0; x0 < g->width; x0 += ES_LIT_COLUMNS) {
        const uint32_t x1 = x0 + ES_LIT_COLUMNS < g->width ? x0 + ES_LIT_COLUMNS : g->width;
        const bool dark = lobes_are_dark(job, x0, x1, y);
        if (dark) blend_diffuse(job, x0, x1, y, resets);
        else if (job->history_count == 6) blend_both(job, x0, x1, y, resets);
        else blend_new_lobes(job, x0, x1, y, resets);
        if (!job->result[0]) continue;
        for (uint32_t k = 3; k < 6 && dark && lit[x0 / ES_LIT_COLUMNS] & 1; k++)
            for (uint32_t x = x0; x < x1; x += VW) vf_store(job->result[k] + (size_t)y * g->stride + x, vf_zero());
        lit[x0 / ES_LIT_COLUMNS] = !dark;
    }
}

void ES_KERNEL(es_gi_temporal_blend)(const es_temporal_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    if (!job->history_count) { /* nothing to blend with */
        const size_t first = (size_t)row_begin * g->stride, bytes = (size_t)(row_end - row_begin) * g->stride * sizeof(float);
        for (uint32_t k = 0; k < job->plane_count && job->result[0]; k++) memcpy(job->result[k] + first, job->source[k] + first, bytes);
        if (job->result_lit && job->result[0]) memset(job->result_lit + (size_t)row_begin * es_lit_chunks(g->stride), 1, (size_t)(row_end - row_begin) * es_lit_chunks(g->stride));
        if (job->confidence) memset(job->confidence + first, 0, bytes);
        return;
    }
    float resets[ES_RASTER_MAX_SIZE / ES_TEMPORAL_TILE];
    for (uint32_t y = row_begin; y < row_end; y++) {
        if (job->reset) reset_row(job, y, resets);
        const float* row = job->reset ? resets : NULL;
        if (job->plane_count == 3) blend_diffuse(job, 0, g->width, y, row);
        else if (job->result_lit) blend_chunks(job, y, row);
        else if (job->history_count == 6) blend_both(job, 0, g->width, y, row);
        else blend_new_lobes(job, 0, g->width, y, row);
    }
}
