/* The geometry-aware box filter on one block of the image (gi/filter.h). */
#include "gi/filter.h"
#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* Column (or row) i of `count`, which may lie outside by less than n: the place n further in; -1 when that is outside as well. */
static int64_t folded(int64_t i, int64_t count, int64_t n)
{
    if (i < 0) i += n;
    else if (i >= count) i -= n;
    return i >= 0 && i < count ? i : -1;
}

/* Column x, outside the image, of a line whose taps are [begin, end) */
static void fold(const es_filter_job* job, es_filter_scratch* s, uint32_t planes, int64_t x, int64_t begin, int64_t end)
{
    const size_t at = (size_t)(x - begin);
    const int64_t from = folded(x, job->gbuffer->width, job->size);
    /* what folds to a place beyond the margin is not a tap of any pixel of the block; -1 may lie within it, and is no place */
    const bool here = from >= 0 && from >= begin && from < end;
    const size_t copy = here ? (size_t)(from - begin) : 0;
    s->depth_in[at] = here ? s->depth_in[copy] : -1e30f; /* close to no depth */
    for (int k = 0; k < 3; k++) s->normal_in[k][at] = here ? s->normal_in[k][copy] : 0.0f;
    for (uint32_t k = 0; k < planes; k++) s->in[k][at] = here ? s->in[k][copy] : 0.0f;
}

/* Taps of one line: columns [x0 - margin, x0 + ES_FILTER_COLUMNS + margin) of row y. */
static void load_line(const es_filter_job* job, uint32_t x0, uint32_t y, uint32_t planes, es_filter_scratch* s)
{
    const es_gbuffer* g = job->gbuffer;
    const size_t row = (size_t)y * g->stride;
    const int64_t begin = (int64_t)x0 - ES_FILTER_MARGIN, end = (int64_t)x0 + ES_FILTER_COLUMNS + ES_FILTER_MARGIN;
    /* strides are multiples of eight */
    for (int64_t x = begin; x < end; x += VW) {
        if (x < 0 || x >= g->stride) continue;
        size_t at = (size_t)(x - begin);
        vf nx, ny, nz;
        es_unpack_normal_v(vi_load(g->normal + row + x), &nx, &ny, &nz);
        vf_store(s->depth_in + at, vf_load(g->depth + row + x));
        vf_store(s->normal_in[0] + at, nx);
        vf_store(s->normal_in[1] + at, ny);
        vf_store(s->normal_in[2] + at, nz);
        for (uint32_t k = 0; k < planes; k++) vf_store(s->in[k] + at, vf_load(job->source[k] + row + x));
    }
    for (int64_t x = begin; x < 0; x++) fold(job, s, planes, x, begin, end);
    for (int64_t x = begin > g->width ? begin : g->width; x < end; x++) fold(job, s, planes, x, begin, end);
}

/* ---- where all taps count ------------------------------------------------------------------------------------------------
 *
 * On an even surface no tap fails, and sums need no tests: the same additions in the same order. What follows finds such windows and misses
 * some. Eight pixels are compared with their first: normals at most SPAN / 6 away, depths an eighth of the threshold; the firsts of
 * neighbouring eights lie within SPAN / 3 and a quarter; of a line and the one above within SPAN / 4 / 16. So no two normals of a window are
 * farther apart than SPAN, whose unit vectors have a dot product of 1 - SPAN² / 2, a thousandth above the threshold, and no two depths farther than
 * three quarters of what they may. */

typedef struct closeness { float flat2, beside2, above2, depth; bool any; } closeness;

static closeness closeness_of(const es_filter_job* job)
{
    const float span2 = 2.0f * (0.999f - job->normal_threshold);
    return (closeness){span2 * (1.0f / 36.0f), span2 * (1.0f / 9.0f), span2 * (1.0f / 4096.0f), job->depth_threshold, span2 > 0.0f && job->depth_threshold < 0.1f};
}

static float apart2(const float a[3], const float b[3]) { return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]); }

static void find_even(const closeness* c, es_filter_scratch* s, uint32_t columns, uint32_t line)
{
    bool flat[ES_FILTER_STRIDE / VW], normals[ES_FILTER_STRIDE / VW], linked[ES_FILTER_STRIDE / VW];
    float first[ES_FILTER_STRIDE / VW][4];
    const uint32_t begin = ES_FILTER_MARGIN / VW - 1, end = begin + columns / VW + 2;
    for (uint32_t v = begin; v < end && c->any; v++) {
        const uint32_t at = v * VW;
        const float d = first[v][3] = s->depth_in[at];
        for (int k = 0; k < 3; k++) first[v][k] = s->normal_in[k][at];
        vf x = vf_load(s->normal_in[0] + at) - vf_set1(first[v][0]), y = vf_load(s->normal_in[1] + at) - vf_set1(first[v][1]), z = vf_load(s->normal_in[2] + at) - vf_set1(first[v][2]);
        normals[v] = d > 0.0f && !vm_any(~vm_le(x * x + y * y + z * z, vf_set1(c->flat2)));
        flat[v] = normals[v] && !vm_any(~vm_le(vf_abs(vf_load(s->depth_in + at) - vf_set1(d)), vf_set1(d * c->depth * 0.125f)));
        if (v == begin) continue;
        const float low = d < first[v - 1][3] ? d : first[v - 1][3];
        linked[v] = flat[v] && flat[v - 1] && __builtin_fabsf(d - first[v - 1][3]) <= low * c->depth * 0.25f && apart2(first[v], first[v - 1]) <= c->beside2;
    }
    for (uint32_t v = begin + 1; v + 1 < end; v++) {
        s->even[v] = c->any && linked[v] && linked[v + 1];
        const uint32_t k = v - begin - 1;
        uint8_t like = c->any && normals[v];
        if (like && line) {
            const float above[3] = {s->normal[0][line - 1][k * VW], s->normal[1][line - 1][k * VW], s->normal[2][line - 1][k * VW]};
            if (s->like[line - 1][k] && apart2(first[v], above) <= c->above2) like = (uint8_t)(s->like[line - 1][k] + 1);
        }
        s->like[line][k] = like;
    }
}

/* `planes` is a constant at every call */
VINL void filter_even_row(const es_filter_job* job, const es_filter_scratch* s, uint32_t x, uint32_t line, es_filter_scratch* out, uint32_t planes)
{
    const int32_t n = (int32_t)job->size;
    const uint32_t c = x + ES_FILTER_MARGIN;
    vf sum[6];
    for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
    for (int32_t i = -(n / 2); i < n - n / 2; i++)
        for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_load(s->in[k] + (uint32_t)((int32_t)c + i));
    const vf share = vf_set1(1.0f) / vf_set1((float)n);
    vf_store(out->depth[line] + x, vf_load(s->depth_in + c));
    for (int k = 0; k < 3; k++) vf_store(out->normal[k][line] + x, vf_load(s->normal_in[k] + c));
    for (uint32_t k = 0; k < planes; k++) vf_store(out->mid[k][line] + x, sum[k] * share);
}

/* Lines [first, first + taps), all of whose normals are alike: false when a depth fails, with nothing written. */
VINL bool filter_even_column(const es_filter_job* job, const es_filter_scratch* s, uint32_t first, uint32_t taps, uint32_t x, size_t out, uint32_t planes)
{
    vf low = vf_load(s->depth[first] + x), high = low;
    for (uint32_t i = 1; i < taps; i++) {
        const vf d = vf_load(s->depth[first + i] + x);
        low = vf_min(low, d);
        high = vf_max(high, d);
    }
    if (vm_any(~vm_le(high - low, low * vf_set1(job->depth_threshold)))) return false;
    vf sum[6];
    for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
    for (uint32_t i = 0; i < taps; i++)
        for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_load(s->mid[k][first + i] + x);
    const vf share = vf_set1(1.0f) / vf_set1((float)taps);
    for (uint32_t k = 0; k < planes; k++) vf_store(job->result[k] + out + x, sum[k] * share);
    return true;
}

/* `planes` is a constant at every call */
VINL void filter_row(const es_filter_job* job, const es_filter_scratch* s, uint32_t columns, uint32_t line, es_filter_scratch* out, uint32_t planes)
{
    const int32_t n = (int32_t)job->size;
    const vf depth_threshold = vf_set1(job->depth_threshold), normal_threshold = vf_set1(job->normal_threshold), one = vf_set1(1.0f);
    for (uint32_t x = 0; x < columns; x += VW) {
        const uint32_t c = x + ES_FILTER_MARGIN;
        if (s->even[c / VW]) {
            filter_even_row(job, s, x, line, out, planes);
            continue;
        }
        vf depth = vf_load(s->depth_in + c), limit = depth * depth_threshold;
        vf nx = vf_load(s->normal_in[0] + c), ny = vf_load(s->normal_in[1] + c), nz = vf_load(s->normal_in[2] + c);
        vf sum[6], count = vf_zero();
        for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
        for (int32_t i = -(n / 2); i < n - n / 2; i++) {
            const uint32_t t = (uint32_t)((int32_t)c + i);
            vf dot = nx * vf_load(s->normal_in[0] + t) + ny * vf_load(s->normal_in[1] + t) + nz * vf_load(s->normal_in[2] + t);
            vm counts = vm_ge(dot, normal_threshold) & vm_le(vf_abs(vf_load(s->depth_in + t) - depth), limit);
            if (i == 0) counts = vm_all_lanes();
            count = count + vf_and(counts, one);
            for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_and(counts, vf_load(s->in[k] + t));
        }
        vf share = one / count;
        vf_store(out->depth[line] + x, depth);
        vf_store(out->normal[0][line] + x, nx);
        vf_store(out->normal[1][line] + x, ny);
        vf_store(out->normal[2][line] + x, nz);
        for (uint32_t k = 0; k < planes; k++) vf_store(out->mid[k][line] + x, sum[k] * share);
    }
}

/* lines[0 … taps): those of the window, `centre` is the pixel's own */
VINL void filter_column(const es_filter_job* job, const es_filter_scratch* s, const uint32_t* lines, uint32_t taps, uint32_t centre, uint32_t columns, size_t out, uint32_t planes)
{
    const vf depth_threshold = vf_set1(job->depth_threshold), normal_threshold = vf_set1(job->normal_threshold), one = vf_set1(1.0f);
    const bool in_turn = lines[taps - 1] == lines[0] + taps - 1;
    for (uint32_t x = 0; x < columns; x += VW) {
        if (in_turn && s->like[lines[taps - 1]][x / VW] >= taps && filter_even_column(job, s, lines[0], taps, x, out, planes)) continue;
        vf depth = vf_load(s->depth[centre] + x), limit = depth * depth_threshold;
        vf nx = vf_load(s->normal[0][centre] + x), ny = vf_load(s->normal[1][centre] + x), nz = vf_load(s->normal[2][centre] + x);
        vf sum[6], count = vf_zero();
        for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
        for (uint32_t i = 0; i < taps; i++) {
            const uint32_t t = lines[i];
            vf dot = nx * vf_load(s->normal[0][t] + x) + ny * vf_load(s->normal[1][t] + x) + nz * vf_load(s->normal[2][t] + x);
            vm counts = vm_ge(dot, normal_threshold) & vm_le(vf_abs(vf_load(s->depth[t] + x) - depth), limit);
            if (t == centre) counts = vm_all_lanes();
            count = count + vf_and(counts, one);
            for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_and(counts, vf_load(s->mid[k][t] + x));
        }
        vf share = one / count;
        for (uint32_t k = 0; k < planes; k++) vf_store(job->result[k] + out + x, sum[k] * share);
    }
}

/* Lobes are rare: where a block's taps of planes 3 … 5 are all zero, so are their means. */
static bool lobes_are_dark(const es_filter_job* job, uint32_t x0, uint32_t first, uint32_t end)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t begin = x0 > ES_FILTER_MARGIN ? x0 - ES_FILTER_MARGIN : 0, stop = x0 + ES_FILTER_COLUMNS + ES_FILTER_MARGIN < g->stride ? x0 + ES_FILTER_COLUMNS + ES_FILTER_MARGIN : g->stride;
    if (job->source_lit) return !es_lit_within(job->source_lit, es_lit_chunks(g->stride), begin, stop, first, end);
    for (uint32_t y = first; y < end; y++) {
        const size_t row = (size_t)y * g->stride;
        vi bits = vi_zero();
        for (uint32_t k = 3; k < 6; k++)
            for (uint32_t x = begin; x < stop; x += VW) bits |= vi_load(job->source[k] + row + x);
        if (vm_any(~vi_eq(bits & vi_set1(0x7fffffff), vi_zero()))) return false;
    }
    return true;
}

/* Says what a row of the block will be, and returns whether it may have been lit. */
static bool set_lit(const es_filter_job* job, uint32_t x0, uint32_t y, uint8_t now)
{
    if (!job->result_lit) return true;
    uint8_t* lit = job->result_lit + (size_t)y * es_lit_chunks(job->gbuffer->stride) + x0 / ES_LIT_COLUMNS;
    const bool was = *lit & 1;
    *lit = now;
    return was;
}
_Static_assert((int)ES_FILTER_COLUMNS == (int)ES_LIT_COLUMNS, "blocks share no chunk");

void ES_KERNEL(es_gi_filter)(const es_filter_job* job, uint32_t x0, uint32_t y0, es_filter_scratch* s)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t n = job->size;
    const uint32_t y1 = g->height - y0 < ES_FILTER_ROWS ? g->height : y0 + ES_FILTER_ROWS;
    const uint32_t columns = g->width - x0 < ES_FILTER_COLUMNS ? (g->width - x0 + VW - 1) / VW * VW : ES_FILTER_COLUMNS;
    /* rows that taps of this block fall on, folded ones included */
    const uint32_t inner = n - n / 2 - 1;
    uint32_t first = y0 > n / 2 ? y0 - n / 2 : 0, end = y1 + inner;
    if (end > g->height) {
        end = g->height;
        if (first > (end > n ? end - n : 0)) first = end > n ? end - n : 0;
    }
    if (end < n) end = n < g->height ? n : g->height;

    const closeness close = closeness_of(job);
    uint32_t planes = job->plane_count;
    if (planes == 6 && lobes_are_dark(job, x0, first, end)) {
        planes = 3;
        for (uint32_t y = y0; y < y1; y++) {
            if (!set_lit(job, x0, y, 0)) continue;
            for (uint32_t k = 3; k < 6; k++)
                for (uint32_t x = 0; x < columns; x += VW) vf_store(job->result[k] + (size_t)y * g->stride + x0 + x, vf_zero());
        }
    }
    for (uint32_t y = y0; y < y1 && planes == 6; y++) set_lit(job, x0, y, 1);

    for (uint32_t y = first; y < end; y++) {
        load_line(job, x0, y, planes, s);
        find_even(&close, s, columns, y - first);
        if (planes == 3) filter_row(job, s, columns, y - first, s, 3);
        else if (planes == 6) filter_row(job, s, columns, y - first, s, 6);
        else filter_row(job, s, columns, y - first, s, planes);
    }
    for (uint32_t y = y0; y < y1; y++) {
        uint32_t lines[ES_FILTER_MAX], taps = 0;
        for (uint32_t i = 0; i < n; i++) {
            int64_t from = folded((int64_t)y - n / 2 + i, g->height, n);
            if (from >= 0) lines[taps++] = (uint32_t)from - first;
        }
        size_t out = (size_t)y * g->stride + x0;
        if (planes == 3) filter_column(job, s, lines, taps, y - first, columns, out, 3);
        else if (planes == 6) filter_column(job, s, lines, taps, y - first, columns, out, 6);
        else filter_column(job, s, lines, taps, y - first, columns, out, planes);
    }
}
