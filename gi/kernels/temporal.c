/* Temporal coherence: tiles compared with their history, and rows of pixels blended with it (gi/temporal.h).
 *
 * What stands still has one tap, where it is. Where eight pixels moved by the same whole number of pixels plus a fraction, as they nearly
 * always do, their four taps are neighbours in memory and are loaded, not gathered. Normals of equal words are the same, their cosine 1, and
 * need not be unpacked. Values are kept above ES_TINY, or else 0: history that fades by a share each frame would end in denormals.
 */
#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "gi/temporal.h"
#include "platform/simd.h"
#include "raster/pack.h"

#define ES_TINY 1e-30f
#define ES_INVERSE_PI 0.318309886f

VINL vf luminance(const vf* c) { return vf_set1(0.2126f) * c[0] + vf_set1(0.7152f) * c[1] + vf_set1(0.0722f) * c[2]; }

/* ---- the same surface ------------------------------------------------------------------------------------------------- */

/* Of a row: where its points were expected to be seen last frame, as a depth, is line + column · per_column + depth · (line_scale + column · scale_per_column). */
typedef struct depth_line { vf line, per_column, line_scale, scale_per_column; } depth_line;

VINL depth_line depths_of_row(const es_temporal_job* job, uint32_t y)
{
    const float *a = job->depth_then[0], *b = job->depth_then[1], row = (float)y;
    return (depth_line){vf_set1(a[0] + a[2] * row), vf_set1(a[1]), vf_set1(b[0] + b[2] * row), vf_set1(b[1])};
}
VINL vf depth_expected(const depth_line* d, vf column, vf depth) { return d->line + d->per_column * column + depth * (d->line_scale + d->scale_per_column * column); }

/* Cosines of packed normals. */
typedef struct own_normal { vi word; vf x, y, z; bool unpacked; } own_normal;
VINL vf cosine(own_normal* n, vi other)
{
    const vm equal = vi_eq(n->word, other);
    if (vm_all(equal)) return vf_set1(1.0f);
    if (!n->unpacked) {
        es_unpack_normal_v(n->word, &n->x, &n->y, &n->z);
        n->unpacked = true;
    }
    vf x, y, z;
    es_unpack_normal_v(other, &x, &y, &z);
    return vf_select(equal, vf_set1(1.0f), n->x * x + n->y * y + n->z * z);
}

/* ---- tiles ----------------------------------------------------------------------------------------------------------- */

/* Eight pixels of last frame: neighbours in memory from `first` on, or anywhere. */
typedef struct place { bool together; size_t first; vi at; } place;

VINL vf value_at(const float* plane, const place* p) { return p->together ? vf_load(plane + p->first) : vf_gather(plane, p->at); }
VINL vi word_at(const uint32_t* plane, const place* p) { return p->together ? vi_load(plane + p->first) : vi_gather(plane, p->at); }

/* May a lobe reflect anything at (x, y), or have done so where that was? */
VINL bool lobes_count(const es_temporal_job* job, uint32_t x, uint32_t y, const place* from)
{
    const uint32_t stride = job->gbuffer->stride, chunks = es_lit_chunks(stride);
    if (!job->source_lit || job->source_lit[(size_t)y * chunks + x / ES_LIT_COLUMNS] & 1) return true;
    uint8_t bits = 0;
    for (uint32_t i = 0; i < VW; i++) {
        const size_t at = from->together ? from->first + i : (uint32_t)from->at[i];
        bits |= job->history_lit[at / stride * chunks + at % stride / ES_LIT_COLUMNS];
        if (from->together) i += VW - 2; /* the last one after the first: neighbours lie in two chunks at most */
    }
    return bits & 1;
}

/* Adds the light of eight pixels now, and then of the ones nearest to where they were, where these show the same. */
VINL void compare_pixels(const es_temporal_job* job, const depth_line* depths, uint32_t x, uint32_t y, vf* sum_now, vf* sum_then)
{
    const es_gbuffer *g = job->gbuffer, *then = job->previous;
    const size_t at = (size_t)y * g->stride + x;
    const vf zero = vf_zero(), depth = vf_load(g->depth + at), column = vf_set1((float)x) + vf_iota();
    vm valid = vm_gt(depth, zero) & vm_first((int32_t)(g->width - x));
    if (!vm_any(valid)) return;
    place from = {.together = true, .first = at};
    const vf mx = job->moving ? vf_load(g->motion_x + at) : zero, my = job->moving ? vf_load(g->motion_y + at) : zero;
    if (vm_any(vm_ne(mx, zero) | vm_ne(my, zero))) {
        const vf px = vf_floor(column - mx + vf_set1(0.5f)), py = vf_floor(vf_set1((float)y) - my + vf_set1(0.5f));
        valid &= vm_ge(px, zero) & vm_ge(py, zero) & vm_lt(px, vf_set1((float)g->width)) & vm_lt(py, vf_set1((float)g->height));
        const vi ix = vi_min(vi_max(vi_truncate(px), vi_zero()), vi_set1((int32_t)g->width - 1)), iy = vi_min(vi_max(vi_truncate(py), vi_zero()), vi_set1((int32_t)g->height - 1));
        from.at = iy * vi_set1((int32_t)g->stride) + ix;
        from.first = (uint32_t)from.at[0];
        from.together = vm_all(vi_eq(from.at, vi_set1(from.at[0]) + vi_iota()));
    }
    const vf expected = depth_expected(depths, column, depth), seen = value_at(then->depth, &from);
    own_normal normal = {.word = vi_load(g->normal + at)};
    valid &= vm_gt(seen, zero) & vm_le(vf_abs(seen - expected), expected * vf_set1(job->depth_threshold)) & vm_ge(cosine(&normal, word_at(then->normal, &from)), vf_set1(job->normal_threshold));
    vf now[3], before[3];
    for (int k = 0; k < 3; k++) {
        now[k] = vf_load(job->source[k] + at) * vf_set1(ES_INVERSE_PI);
        before[k] = value_at(job->history[k], &from) * vf_set1(ES_INVERSE_PI);
    }
    if (job->history_count == 6 && lobes_count(job, x, y, &from))
        for (int k = 0; k < 3; k++) {
            now[k] = now[k] + vf_load(job->source[3 + k] + at);
            before[k] = before[k] + value_at(job->history[3 + k], &from);
        }
    *sum_now = *sum_now + vf_and(valid, luminance(now));
    *sum_then = *sum_then + vf_and(valid, luminance(before));
}

/* The share of the reset of each tile of a row: 0 … 1. */
void ES_KERNEL(es_gi_temporal_compare)(const es_temporal_job* job, uint32_t tile_row, float* shares)
{
    const es_gbuffer* g = job->gbuffer;
    for (uint32_t tile = 0; tile < job->tile_columns; tile++) {
        const uint32_t x0 = tile * ES_TEMPORAL_TILE, x1 = x0 + ES_TEMPORAL_TILE < g->width ? x0 + ES_TEMPORAL_TILE : g->width;
        vf sum_now = vf_zero(), sum_then = vf_zero();
        for (uint32_t j = ES_TEMPORAL_SAMPLE / 2; j < ES_TEMPORAL_TILE; j += ES_TEMPORAL_SAMPLE) {
            const uint32_t y = tile_row * ES_TEMPORAL_TILE + j;
            if (y >= g->height) break;
            const depth_line depths = depths_of_row(job, y);
            for (uint32_t x = x0; x < x1; x += VW) compare_pixels(job, &depths, x, y, &sum_now, &sum_then);
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

/* The reset of tiles, interpolated down to row y: one number a tile, of which the pixels of a tile take the two nearest. False: all are 0. */
static bool reset_row(const es_temporal_job* job, uint32_t y, float* row)
{
    const float at = ((float)y + 0.5f) / ES_TEMPORAL_TILE - 0.5f;
    const uint32_t upper = at > 0.0f ? (uint32_t)at : 0, lower = upper + 1 < job->tile_rows && at > 0.0f ? upper + 1 : upper;
    const float share = at > 0.0f ? at - (float)upper : 0.0f;
    bool any = false;
    for (uint32_t i = 0; i < job->tile_columns; i++) {
        const float a = job->reset[(size_t)upper * job->tile_columns + i], b = job->reset[(size_t)lower * job->tile_columns + i];
        row[i] = a + (b - a) * share;
        any |= row[i] > 0.0f;
    }
    return any;
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

/* What last frame shows of eight points: light; depth and cosine of normals, of unit weight; where it shows any. */
typedef struct history { vm known; vf depth, dot, light[6]; } history;

VINL void history_here(const es_temporal_job* job, size_t at, vm seen, vf expected, uint32_t planes, history* h)
{
    const es_gbuffer* then = job->previous;
    own_normal normal = {.word = vi_load(job->gbuffer->normal + at)};
    const vf there = vf_load(then->depth + at), dot = cosine(&normal, vi_load(then->normal + at));
    h->known = seen & vm_gt(there, vf_zero()) & vm_le(vf_abs(there - expected), expected * vf_set1(job->depth_threshold)) & vm_ge(dot, vf_set1(job->normal_threshold));
    h->depth = vf_and(h->known, there);
    h->dot = vf_and(h->known, dot);
    for (uint32_t k = 0; k < planes; k++) h->light[k] = vf_and(h->known, vf_load(job->history[k] + at));
}

/* One of four taps: what it shows is added by its weight. */
VINL vf add_tap(const es_temporal_job* job, const place* p, vf weight, vm seen, vf expected, vf tolerance, own_normal* normal, uint32_t planes, history* h)
{
    const vf there = value_at(job->previous->depth, p), dot = cosine(normal, word_at(job->previous->normal, p));
    weight = vf_and(seen & vm_gt(there, vf_zero()) & vm_le(vf_abs(there - expected), tolerance) & vm_ge(dot, vf_set1(job->normal_threshold)), weight);
    h->depth = h->depth + weight * there;
    h->dot = h->dot + weight * dot;
    for (uint32_t k = 0; k < planes; k++) h->light[k] = h->light[k] + weight * value_at(job->history[k], p);
    return weight;
}

VINL void history_there(const es_temporal_job* job, size_t at, vf column, vf row, vf mx, vf my, vm seen, vf expected, uint32_t planes, history* h)
{
    const es_gbuffer* g = job->gbuffer;
    const vf zero = vf_zero(), one = vf_set1(1.0f), limit = vf_set1(16384.0f); /* far outside is outside: kept where truncation has a meaning */
    const vf px = vf_min(vf_max(column - mx, vf_neg(limit)), limit), py = vf_min(vf_max(row - my, vf_neg(limit)), limit);
    const vf fx = vf_floor(px), fy = vf_floor(py), right = px - fx, down = py - fy, left = one - right, up = one - down;
    const vi ix = vi_truncate(fx), iy = vi_truncate(fy);
    vf weight[4] = {left * up, right * up, left * down, right * down};
    const int32_t x0 = ix[0], y0 = iy[0];
    const vf tolerance = expected * vf_set1(job->depth_threshold);
    own_normal normal = {.word = vi_load(g->normal + at)};
    *h = (history){.depth = zero, .dot = zero};
    for (uint32_t k = 0; k < planes; k++) h->light[k] = zero;
    vf total = zero;
    if (x0 >= 0 && y0 >= 0 && (uint32_t)x0 + VW < g->width && (uint32_t)y0 + 1 < g->height && vm_all(vi_eq(ix, vi_set1(x0) + vi_iota()) & vi_eq(iy, vi_set1(y0)))) {
        const size_t first = (size_t)(uint32_t)y0 * g->stride + (uint32_t)x0;
        const size_t firsts[4] = {first, first + 1, first + g->stride, first + g->stride + 1};
        for (int i = 0; i < 4; i++) total = total + add_tap(job, &(place){.together = true, .first = firsts[i]}, weight[i], seen, expected, tolerance, &normal, planes, h);
    } else {
        const vi last_x = vi_set1((int32_t)g->width - 1), last_y = vi_set1((int32_t)g->height - 1), stride = vi_set1((int32_t)g->stride);
        const vm in_x[2] = {vm_ge(fx, zero) & ~vi_gt(ix, last_x), vm_ge(fx, vf_set1(-1.0f)) & vi_lt(ix, last_x)};
        const vm in_y[2] = {vm_ge(fy, zero) & ~vi_gt(iy, last_y), vm_ge(fy, vf_set1(-1.0f)) & vi_lt(iy, last_y)};
        for (int i = 0; i < 4; i++) {
            const vi tap_x = vi_min(vi_max(ix + vi_set1(i & 1), vi_zero()), last_x), tap_y = vi_min(vi_max(iy + vi_set1(i >> 1), vi_zero()), last_y);
            total = total + add_tap(job, &(place){.at = tap_y * stride + tap_x}, vf_and(in_x[i & 1] & in_y[i >> 1], weight[i]), seen, expected, tolerance, &normal, planes, h);
        }
    }
    h->known = vm_gt(total, vf_set1(1e-3f)); /* a thousandth of a pixel is no history */
    const vf share = vf_and(h->known, one / vf_select(h->known, total, one));
    h->depth = h->depth * share;
    h->dot = h->dot * share;
    for (uint32_t k = 0; k < planes; k++) h->light[k] = h->light[k] * share;
}

/* Of pixels [x0, x1) of row y; all of one chunk. `planes`, `with_history` and `still` (none of them has moved) are constants at every call. Returns
 * whether a lobe reflects anything. */
VINL bool blend_pixels(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y, const float* resets, uint32_t planes, uint32_t with_history, bool still)
{
    const es_gbuffer* g = job->gbuffer;
    const vf zero = vf_zero(), one = vf_set1(1.0f), row = vf_set1((float)y);
    const vf per_width = vf_set1(1.0f / (float)g->width), per_height = vf_set1(1.0f / (float)g->height), per_extent = vf_set1(1.0f / job->extent);
    const vf base = vf_set1(job->base), position = vf_set1(job->position), turning = vf_set1(job->normal), illumination = vf_set1(job->illumination);
    const vf exposure = vf_set1(job->exposure_scale);
    const depth_line depths = depths_of_row(job, y);
    const bool confidence_only = !job->result[0];
    vm lobes = vi_zero();
    vf column = vf_set1((float)x0) + vf_iota();
    for (uint32_t x = x0; x < x1; x += VW, column = column + vf_set1((float)VW)) {
        const size_t at = (size_t)y * g->stride + x;
        const vf depth = vf_load(g->depth + at);
        const vm seen = vm_gt(depth, zero);
        vf fresh[6], confidence = zero;
        for (uint32_t k = 0; k < planes; k++) fresh[k] = vf_load(job->source[k] + at);
        history old;
        if (vm_any(seen)) {
            const vf expected = depth_expected(&depths, column, depth);
            const vf mx = still ? zero : vf_load(g->motion_x + at), my = still ? zero : vf_load(g->motion_y + at);
            if (still || !vm_any(vm_ne(mx, zero) | vm_ne(my, zero))) history_here(job, at, seen, expected, with_history, &old);
            else history_there(job, at, column, row, mx, my, seen, expected, with_history, &old);
            const vf dx = mx * per_width, dy = my * per_height, dz = (depth - old.depth) * per_extent;
            const vf moved = vf_sqrt(dx * dx + dy * dy + dz * dz) * position, turned = (one - old.dot) * turning;
            vf squares = zero;
            for (uint32_t k = 0; k < 3; k++) {
                vf d = (fresh[k] - old.light[k]) * vf_set1(ES_INVERSE_PI);
                if (with_history == 6) d = d + (fresh[3 + k] - old.light[3 + k]);
                d = vf_min(vf_abs(d) * exposure, one); /* more saturates as well */
                squares = squares + d * d;
            }
            const vf lit = vf_min(squares * vf_sqrt(squares), one) * illumination;
            confidence = base * vf_max(one - vf_max(vf_max(moved, turned), lit), zero);
            if (resets) confidence = confidence * (one - reset_of(job, resets, x));
            confidence = vf_and(old.known, confidence);
            if (job->clamp > 0.0f)
                for (uint32_t k = 0; k < with_history; k++) {
                    vf low, high;
                    neighbourhood(job->source[k], g, x, y, &low, &high);
                    old.light[k] = vf_min(vf_max(old.light[k], low * vf_set1(1.0f - job->clamp)), high * vf_set1(1.0f + job->clamp));
                }
            /* as a step from the new value: where both are equal, it stays exactly */
            const vf in_lobe = with_history == 6 ? confidence * vf_max(one - (one - old.dot) * vf_set1(job->lobe_turn), zero) : confidence;
            for (uint32_t k = 0; k < with_history; k++) {
                fresh[k] = fresh[k] + (k < 3 ? confidence : in_lobe) * (old.light[k] - fresh[k]);
                fresh[k] = vf_and(vm_gt(vf_abs(fresh[k]), vf_set1(ES_TINY)), fresh[k]);
            }
        }
        if (job->confidence) vf_store(job->confidence + at, confidence);
        for (uint32_t k = 0; k < planes && !confidence_only; k++) vf_store(job->result[k] + at, fresh[k]);
        for (uint32_t k = 3; k < planes; k++) lobes |= vm_ne(fresh[k], zero);
    }
    return vm_any(lobes);
}

/* How far the pixels [x0, x1) of row y have moved: whole pixels that their taps lie to the left, right, above and below. False: too far to tell. */
typedef struct reach { uint32_t left, right, up, down; bool still; } reach;

static bool reach_of(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y, reach* result)
{
    *result = (reach){.still = true};
    if (!job->moving) return true;
    const es_gbuffer* g = job->gbuffer;
    const size_t row = (size_t)y * g->stride;
    vf left = vf_zero(), right = left, up = left, down = left;
    vm moved = vi_zero();
    for (uint32_t x = x0; x < x1; x += VW) {
        const vf mx = vf_load(g->motion_x + row + x), my = vf_load(g->motion_y + row + x);
        moved |= vm_ne(mx, vf_zero()) | vm_ne(my, vf_zero());
        left = vf_max(left, mx);
        right = vf_min(right, mx);
        up = vf_max(up, my);
        down = vf_min(down, my);
    }
    if (!vm_any(moved)) return true;
    result->still = false;
    float most[4] = {left[0], -right[0], up[0], -down[0]};
    for (int i = 1; i < VW; i++) {
        most[0] = most[0] < left[i] ? left[i] : most[0];
        most[1] = most[1] < -right[i] ? -right[i] : most[1];
        most[2] = most[2] < up[i] ? up[i] : most[2];
        most[3] = most[3] < -down[i] ? -down[i] : most[3];
    }
    uint32_t pixels[4];
    for (int i = 0; i < 4; i++) {
        if (!(most[i] < 64.0f)) return false;
        pixels[i] = most[i] > 0.0f ? (uint32_t)most[i] + 2 : 1; /* a tap beyond, and rounding */
    }
    result->left = pixels[0];
    result->right = pixels[1];
    result->up = pixels[2];
    result->down = pixels[3];
    return true;
}

/* Flags are spread by the filter, by blocks that are far wider than its reach: where they are set, a look at the planes is worth its while. */
static bool source_is_dark(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y)
{
    const uint32_t stride = job->gbuffer->stride;
    if (!es_lit_within(job->source_lit, es_lit_chunks(stride), x0, x1, y, y + 1)) return true;
    vi bits = vi_zero();
    for (uint32_t k = 3; k < 6; k++)
        for (uint32_t x = x0; x < x1; x += VW) bits |= vi_load(job->source[k] + (size_t)y * stride + x);
    return !vm_any(~vi_eq(bits, vi_zero()));
}

/* Does what lobes reflect there, and all of the history that their movement leads to, hold zeros alone? */
static bool lobes_are_dark(const es_temporal_job* job, uint32_t x0, uint32_t x1, uint32_t y, const reach* r)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t chunks = es_lit_chunks(g->stride);
    if (!source_is_dark(job, x0, x1, y)) return false;
    if (job->history_count < 6) return true;
    if (r->still) return !es_lit_within(job->history_lit, chunks, x0, x1, y, y + 1);
    return !es_lit_within(job->history_lit, chunks, x0 > r->left ? x0 - r->left : 0, x1 + r->right, y > r->up ? y - r->up : 0, y + r->down + 1 < g->height ? y + r->down + 1 : g->height);
}

/* A chunk at a time: three planes where lobes are dark, and zeros for the others unless they are there. */
static void blend_row(const es_temporal_job* job, uint32_t y, const float* resets)
{
    const es_gbuffer* g = job->gbuffer;
    uint8_t* lit = job->result_lit ? job->result_lit + (size_t)y * es_lit_chunks(g->stride) : NULL;
    for (uint32_t x0 = 0; x0 < g->width; x0 += ES_LIT_COLUMNS) {
        const uint32_t x1 = x0 + ES_LIT_COLUMNS < g->width ? x0 + ES_LIT_COLUMNS : g->width;
        reach r;
        const bool near = reach_of(job, x0, x1, y, &r), dark = lit && near && lobes_are_dark(job, x0, x1, y, &r);
        bool lobes = false;
        if (job->plane_count == 3 || dark) {
            if (r.still) blend_pixels(job, x0, x1, y, resets, 3, 3, true);
            else blend_pixels(job, x0, x1, y, resets, 3, 3, false);
        } else if (job->history_count == 6) lobes = r.still ? blend_pixels(job, x0, x1, y, resets, 6, 6, true) : blend_pixels(job, x0, x1, y, resets, 6, 6, false);
        else lobes = r.still ? blend_pixels(job, x0, x1, y, resets, 6, 3, true) : blend_pixels(job, x0, x1, y, resets, 6, 3, false);
        if (!lit || !job->result[0]) continue;
        for (uint32_t k = 3; k < 6 && dark && lit[x0 / ES_LIT_COLUMNS] & 1; k++)
            for (uint32_t x = x0; x < x1; x += VW) vf_store(job->result[k] + (size_t)y * g->stride + x, vf_zero());
        lit[x0 / ES_LIT_COLUMNS] = lobes;
    }
}

void ES_KERNEL(es_gi_temporal_blend)(const es_temporal_job* job, uint32_t row_begin, uint32_t row_end)
{
    const es_gbuffer* g = job->gbuffer;
    if (!job->history_count) { /* nothing to blend with */
        const size_t first = (size_t)row_begin * g->stride, bytes = (size_t)(row_end - row_begin) * g->stride * sizeof(float);
        for (uint32_t k = 0; k < job->plane_count && job->result[0]; k++) memcpy(job->result[k] + first, job->source[k] + first, bytes);
        const size_t first_chunk = (size_t)row_begin * es_lit_chunks(g->stride), chunks = (size_t)(row_end - row_begin) * es_lit_chunks(g->stride);
        for (size_t i = first_chunk; i < first_chunk + chunks && job->result_lit && job->result[0]; i++) job->result_lit[i] = job->source_lit[i] & 1;
        if (job->confidence) memset(job->confidence + first, 0, bytes);
        return;
    }
    float resets[ES_RASTER_MAX_SIZE / ES_TEMPORAL_TILE];
    for (uint32_t y = row_begin; y < row_end; y++) blend_row(job, y, job->reset && reset_row(job, y, resets) ? resets : NULL);
}
