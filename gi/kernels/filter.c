/* The geometry-aware box filter on one block of the image (gi/filter.h).
 *
 * All passes in one sweep over the block's lines: a line is filtered along its row into a ring; a window of lines that is whole is filtered along
 * columns, which makes a line of the next pass. So what passes hand each other stays in the caches, and the tests of the geometry that all
 * of them share are made once. */
#include "gi/filter.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* One block. Columns are counted from the first one that any pass reads, `left` of the image; pass p makes those from margin · (p + 1) on. */
typedef struct sweep {
    const es_filter_job* job;
    es_filter_scratch* s;
    uint32_t planes;                          /* that are filtered */
    int64_t left;
    uint32_t margin, ring;                    /* columns that taps reach beyond the pixels, up to whole eights; lines kept of the geometry, less one */
    uint32_t x0;                              /* the block's */
    float depth_step, normal_step2;           /* what neighbours may differ by (find_even) */
    uint32_t next[ES_FILTER_MAX_PASSES], end[ES_FILTER_MAX_PASSES]; /* lines that each pass has still to make */
    /* with six planes: may any of the last three differ from zero in a pass' latest line, and in those of its ring */
    bool lit[ES_FILTER_MAX_PASSES], lit_mid[ES_FILTER_MAX_PASSES][ES_FILTER_MAX];
} sweep;

/* Column (or row) i of `count`, which may lie outside by less than n: the place n further in; -1 when that is outside as well. */
static int64_t folded(int64_t i, int64_t count, int64_t n)
{
    if (i < 0) i += n;
    else if (i >= count) i -= n;
    return i >= 0 && i < count ? i : -1;
}

/* The lines that taps of line y fall on: the window, moved into the image. */
static uint32_t first_line(const es_filter_job* job, uint32_t y)
{
    const uint32_t n = job->size, height = job->gbuffer->height, first = y > n / 2 ? y - n / 2 : 0;
    return first + n > height ? (height > n ? height - n : 0) : first;
}
static uint32_t end_line(const es_filter_job* job, uint32_t y)
{
    const uint32_t end = first_line(job, y) + job->size;
    return end < job->gbuffer->height ? end : job->gbuffer->height;
}

/* Columns [begin, end) that pass p reads, of the image or not, and those that it makes. */
static uint32_t reads_from(const sweep* w, uint32_t p) { return w->margin * p; }
static uint32_t reads_to(const sweep* w, uint32_t p) { return ES_FILTER_COLUMNS + w->margin * (2 * w->job->passes - p); }
static uint32_t makes_from(const sweep* w, uint32_t p)
{
    const uint32_t from = reads_from(w, p + 1);
    return w->left + from < 0 ? (uint32_t)-w->left : from;
}
static uint32_t makes_to(const sweep* w, uint32_t p)
{
    const uint32_t to = reads_to(w, p + 1), last = (uint32_t)((int64_t)((w->job->gbuffer->width + VW - 1) / VW * VW) - w->left);
    return to < last ? to : last;
}

/* Fills what a pass reads outside the image. What folds to a place beyond the block is not a tap of any of its pixels. */
static void fold(const sweep* w, uint32_t p, float* line, float nothing)
{
    const int64_t from = w->left + reads_from(w, p), to = w->left + reads_to(w, p), width = w->job->gbuffer->width, n = w->job->size;
    /* the left side, the right side, and beyond it, where nothing folds to the image */
    const int64_t begin[2] = {from, from > width ? from : width}, end[2] = {to < 0 ? to : 0, to < width + n ? to : width + n};
    for (int side = 0; side < 2; side++)
        for (int64_t x = begin[side]; x < end[side]; x++) {
            const int64_t place = folded(x, width, n);
            /* -1 is no place, though it may lie within the block's margin */
            line[x - w->left] = place >= 0 && place >= from && place < to ? line[place - w->left] : nothing;
        }
    for (int64_t x = from > width + n ? from : width + n; x < to; x++) line[x - w->left] = nothing;
}

/* Lobes are rare: where planes 3 … 5 of a line's taps are all zero, so are their means. */
static bool lobes_are_lit(const sweep* w, uint32_t y)
{
    const es_filter_job* job = w->job;
    const es_gbuffer* g = job->gbuffer;
    const int64_t right = w->left + reads_to(w, 0);
    const uint32_t begin = w->left > 0 ? (uint32_t)w->left : 0, stop = right < g->stride ? (uint32_t)right : g->stride;
    if (job->source_lit) return es_lit_within(job->source_lit, es_lit_chunks(g->stride), begin, stop, y, y + 1);
    const size_t row = (size_t)y * g->stride;
    vi bits = vi_zero();
    for (uint32_t k = 3; k < 6; k++)
        for (uint32_t x = begin; x < stop; x += VW) bits |= vi_load(job->source[k] + row + x);
    return vm_any(~vi_eq(bits & vi_set1(0x7fffffff), vi_zero()));
}

static void load_line(sweep* w, uint32_t y)
{
    const es_gbuffer* g = w->job->gbuffer;
    es_filter_scratch* s = w->s;
    const size_t row = (size_t)y * g->stride;
    const uint32_t line = y & w->ring, to = reads_to(w, 0);
    w->lit[0] = w->planes == 6 && lobes_are_lit(w, y);
    const uint32_t planes = w->planes == 6 && !w->lit[0] ? 3 : w->planes;
    /* strides are multiples of eight */
    for (uint32_t at = 0; at < to; at += VW) {
        const int64_t x = w->left + at;
        if (x < 0 || x >= g->stride) continue;
        vf nx, ny, nz;
        es_unpack_normal_v(vi_load(g->normal + row + x), &nx, &ny, &nz);
        vf_store(s->depth[line] + at, vf_load(g->depth + row + x));
        vf_store(s->normal[line][0] + at, nx);
        vf_store(s->normal[line][1] + at, ny);
        vf_store(s->normal[line][2] + at, nz);
        for (uint32_t k = 0; k < planes; k++) vf_store(s->in[0][k] + at, vf_load(w->job->source[k] + row + x));
    }
    fold(w, 0, s->depth[line], -1e30f); /* close to no depth */
    for (int k = 0; k < 3; k++) fold(w, 0, s->normal[line][k], 0.0f);
    for (uint32_t k = 0; k < planes; k++) fold(w, 0, s->in[0][k], 0.0f);
    s->depth[line][to] = s->normal[line][0][to] = s->normal[line][1][to] = s->normal[line][2][to] = 0.0f; /* a neighbour of the last, for vectors */
}

/* ---- where all taps count ------------------------------------------------------------------------------------------------
 *
 * On an even surface no tap fails, and sums need no tests: the same additions in the same order. What follows finds such windows and misses
 * some, by neighbours: a tap is at most h = n / 2 steps from its centre. If none of them changes the depth by more than the share
 * (t - t²/2) / h of the nearer one's, all h change it by less than exp(t - t²/2) <= 1 + t. If none moves the normal's end by more than SPAN / h, unit
 * vectors h steps apart have a dot product of 1 - SPAN² / 2 at least, a thousandth above the threshold. */

static void set_steps(sweep* w)
{
    const float t = w->job->depth_threshold, steps = w->job->size > 3 ? (float)(w->job->size / 2) : 1.0f, span2 = 2.0f * (0.999f - w->job->normal_threshold);
    w->depth_step = t <= 1.0f ? 0.999f * (t - 0.5f * t * t) / steps : 0.0f;
    w->normal_step2 = span2 > 0.0f ? span2 / (steps * steps) : -1.0f;
}

/* Which of eight pixels are like those of other places. */
VINL vm alike(const sweep* w, uint32_t line, uint32_t at, uint32_t line2, uint32_t at2)
{
    const es_filter_scratch* s = w->s;
    const vf x = vf_load(s->normal[line2][0] + at2) - vf_load(s->normal[line][0] + at), y = vf_load(s->normal[line2][1] + at2) - vf_load(s->normal[line][1] + at),
             z = vf_load(s->normal[line2][2] + at2) - vf_load(s->normal[line][2] + at);
    const vf a = vf_load(s->depth[line] + at), b = vf_load(s->depth[line2] + at2);
    return vm_le(x * x + y * y + z * z, vf_set1(w->normal_step2)) & vm_le(vf_abs(b - a), vf_min(a, b) * vf_set1(w->depth_step));
}

static void find_even(const sweep* w, uint32_t y, bool first)
{
    es_filter_scratch* s = w->s;
    /* the first line has none above it; compilers may subtract before they ask whether it has, and fresh memory may hold anything */
    const uint32_t line = y & w->ring, above = first ? line : (y - 1) & w->ring, groups = reads_to(w, 0) / VW, n = w->job->size;
    /* window of eight pixels: n + 7 columns, of which the first is n / 2 before theirs */
    const uint32_t pairs = ((1u << (n + 6)) - 1u) << (8 - n / 2);
    uint32_t bits[ES_FILTER_GROUPS + 2] = {0}; /* neighbours to the right that pass */
    for (uint32_t v = 0; v < groups; v++) {
        const uint32_t at = v * VW;
        bits[v + 1] = vm_bits(alike(w, line, at, line, at + 1));
        const bool follows = !first && vm_all(alike(w, line, at, above, at));
        s->alike[line][v] = !follows ? 1 : s->alike[above][v] < ES_FILTER_MAX ? (uint8_t)(s->alike[above][v] + 1) : ES_FILTER_MAX;
    }
    bits[groups] &= 0x7f; /* the last column has no neighbour */
    for (uint32_t v = 0; v < groups; v++) s->even[line][v] = ((bits[v] | bits[v + 1] << 8 | bits[v + 2] << 16) & pairs) == pairs;
}

/* ---- a pass ------------------------------------------------------------------------------------------------------------------ */

/* `planes` and n, the window's side, are constants at most calls of what follows. */

/* Sums of n taps, all of which count, at column c. */
VINL void add_even(const float* const taps[], uint32_t n, uint32_t c, vf sum[6], uint32_t planes)
{
    for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
#pragma GCC unroll 16
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_load(taps[i] + k * ES_FILTER_STRIDE + c);
}

VINL void filter_row(const sweep* w, uint32_t p, uint32_t y, uint32_t planes, uint32_t n)
{
    es_filter_scratch* s = w->s;
    const vf depth_threshold = vf_set1(w->job->depth_threshold), normal_threshold = vf_set1(w->job->normal_threshold), one = vf_set1(1.0f), even_share = one / vf_set1((float)n);
    const uint32_t line = y & w->ring, to = makes_to(w, p);
    const float* depths = s->depth[line];
    float(*normals)[ES_FILTER_STRIDE] = s->normal[line], (*mid)[ES_FILTER_STRIDE] = s->mid[p][y % ES_FILTER_MAX], (*in)[ES_FILTER_STRIDE] = s->in[p];
    const float* taps[ES_FILTER_MAX];
    for (uint32_t i = 0; i < n; i++) taps[i] = in[0] + i;
    for (uint32_t c = makes_from(w, p); c < to; c += VW) {
        vf sum[6], share = even_share;
        if (s->even[line][c / VW]) {
            add_even(taps, n, c - n / 2, sum, planes);
        } else {
            const vf depth = vf_load(depths + c), limit = depth * depth_threshold, nx = vf_load(normals[0] + c), ny = vf_load(normals[1] + c), nz = vf_load(normals[2] + c);
            vf count = vf_zero();
            for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
            for (uint32_t i = 0; i < n; i++) {
                const uint32_t t = c - n / 2 + i;
                vf dot = nx * vf_load(normals[0] + t) + ny * vf_load(normals[1] + t) + nz * vf_load(normals[2] + t);
                vm counts = vm_ge(dot, normal_threshold) & vm_le(vf_abs(vf_load(depths + t) - depth), limit);
                if (i == n / 2) counts = vm_all_lanes();
                count = count + vf_and(counts, one);
                for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_and(counts, vf_load(in[k] + t));
            }
            share = one / count;
        }
        for (uint32_t k = 0; k < planes; k++) vf_store(mid[k] + c, sum[k] * share);
    }
}

/* `lines` are those that the taps fall on, of which the first `taps` are in the image; `shift`: the column that out[] begins with. */
VINL void filter_column(const sweep* w, uint32_t p, uint32_t y, const uint32_t* lines, uint32_t taps, float* const out[6], uint32_t shift, uint32_t planes)
{
    const es_filter_scratch* s = w->s;
    const vf depth_threshold = vf_set1(w->job->depth_threshold), normal_threshold = vf_set1(w->job->normal_threshold), one = vf_set1(1.0f), even_share = one / vf_set1((float)taps);
    const bool in_turn = lines[taps - 1] == lines[0] + taps - 1;
    const uint32_t last = lines[taps - 1] & w->ring, centre = y & w->ring, to = makes_to(w, p);
    const float* mid[ES_FILTER_MAX];
    for (uint32_t i = 0; i < taps; i++) mid[i] = s->mid[p][lines[i] % ES_FILTER_MAX][0];
    for (uint32_t c = makes_from(w, p); c < to; c += VW) {
        vf sum[6], share = even_share;
        if (in_turn && s->alike[last][c / VW] >= taps) {
            add_even(mid, taps, c, sum, planes);
        } else {
            const vf depth = vf_load(s->depth[centre] + c), limit = depth * depth_threshold;
            const vf nx = vf_load(s->normal[centre][0] + c), ny = vf_load(s->normal[centre][1] + c), nz = vf_load(s->normal[centre][2] + c);
            vf count = vf_zero();
            for (uint32_t k = 0; k < planes; k++) sum[k] = vf_zero();
            for (uint32_t i = 0; i < taps; i++) {
                const uint32_t t = lines[i] & w->ring;
                vf dot = nx * vf_load(s->normal[t][0] + c) + ny * vf_load(s->normal[t][1] + c) + nz * vf_load(s->normal[t][2] + c);
                vm counts = vm_ge(dot, normal_threshold) & vm_le(vf_abs(vf_load(s->depth[t] + c) - depth), limit);
                if (t == centre) counts = vm_all_lanes();
                count = count + vf_and(counts, one);
                for (uint32_t k = 0; k < planes; k++) sum[k] = sum[k] + vf_and(counts, vf_load(mid[i] + k * ES_FILTER_STRIDE + c));
            }
            share = one / count;
        }
        for (uint32_t k = 0; k < planes; k++) vf_store(out[k] + (c - shift), sum[k] * share);
    }
}

/* A dark line of planes 3 … 5 among lit ones. */
static void darken_line(const sweep* w, uint32_t p, uint32_t y)
{
    const uint32_t from = makes_from(w, p), to = makes_to(w, p);
    for (uint32_t k = 3; k < 6; k++) memset(w->s->mid[p][y % ES_FILTER_MAX][k] + from, 0, (to - from) * sizeof(float));
}

/* Says what a row of the block will be, and returns whether it may have been lit. */
static bool set_lit(const es_filter_job* job, uint32_t x0, uint32_t y, uint8_t now)
{
    if (!job->result_lit) return true;
    const uint32_t chunks = es_lit_chunks(job->gbuffer->stride), first = x0 / ES_LIT_COLUMNS;
    uint8_t* lit = job->result_lit + (size_t)y * chunks;
    bool was = false;
    for (uint32_t c = first; c < chunks && c < first + ES_FILTER_COLUMNS / ES_LIT_COLUMNS; c++) {
        was |= lit[c] & 1;
        lit[c] = now;
    }
    return was;
}
_Static_assert((int)ES_FILTER_COLUMNS % (int)ES_LIT_COLUMNS == 0, "blocks share no chunk");

/* Line y of the last pass' planes 3 … 5 is zero. */
static void darken_result(const sweep* w, uint32_t y)
{
    const es_filter_job* job = w->job;
    if (!set_lit(job, w->x0, y, 0)) return;
    const uint32_t columns = makes_to(w, job->passes - 1) - makes_from(w, job->passes - 1);
    for (uint32_t k = 3; k < 6; k++) memset(job->result[k] + (size_t)y * job->gbuffer->stride + w->x0, 0, columns * sizeof(float));
}

/* gcc would make copies of it for the first eight passes, of which there are two or three: ten times the code, and the time to compile it. */
#if defined(__GNUC__) && !defined(__clang__)
#define ES_ONE_BODY __attribute__((noclone, noinline))
#else
#define ES_ONE_BODY
#endif

/* Line y of what pass p reads has come: makes the lines whose windows it completes. */
static ES_ONE_BODY void pass_line(sweep* w, uint32_t p, uint32_t y)
{
    const es_filter_job* job = w->job;
    const bool lobes = w->planes == 6;
    w->lit_mid[p][y % ES_FILTER_MAX] = w->lit[p];
    if (w->planes == 3 || (lobes && !w->lit[p])) {
        if (job->size == 8) filter_row(w, p, y, 3, 8);
        else filter_row(w, p, y, 3, job->size);
        if (lobes) darken_line(w, p, y);
    } else if (lobes) filter_row(w, p, y, 6, job->size);
    else filter_row(w, p, y, w->planes, job->size);
    while (w->next[p] < w->end[p] && end_line(job, w->next[p]) <= y + 1) {
        const uint32_t made = w->next[p]++;
        const bool final = p + 1 == job->passes || p + 1 == ES_FILTER_MAX_PASSES;
        const uint32_t shift = final ? w->margin * job->passes : 0;
        float* out[6];
        for (uint32_t k = 0; k < w->planes; k++) out[k] = final ? job->result[k] + ((size_t)made * job->gbuffer->stride + w->x0) : w->s->in[p + 1][k];
        uint32_t lines[ES_FILTER_MAX], taps = 0;
        bool lit = false;
        for (uint32_t i = 0; i < job->size; i++) {
            const int64_t from = folded((int64_t)made - job->size / 2 + i, job->gbuffer->height, job->size);
            if (from < 0) continue;
            lit |= w->lit_mid[p][from % ES_FILTER_MAX];
            lines[taps++] = (uint32_t)from;
        }
        if (w->planes == 3 || (lobes && !lit)) {
            if (taps == 8) filter_column(w, p, made, lines, 8, out, shift, 3);
            else filter_column(w, p, made, lines, taps, out, shift, 3);
        } else if (lobes) filter_column(w, p, made, lines, taps, out, shift, 6);
        else filter_column(w, p, made, lines, taps, out, shift, w->planes);
        if (final) {
            if (lobes && lit) set_lit(job, w->x0, made, 1);
            else if (lobes) darken_result(w, made);
            continue;
        }
        w->lit[p + 1] = lit;
        for (uint32_t k = 0; k < (lobes && !lit ? 3 : w->planes); k++) fold(w, p + 1, w->s->in[p + 1][k], 0.0f);
        pass_line(w, p + 1, made);
    }
}

/* ---- a block ------------------------------------------------------------------------------------------------------------------ */

void ES_KERNEL(es_gi_filter)(const es_filter_job* job, uint32_t x0, uint32_t y0, es_filter_scratch* s)
{
    const es_gbuffer* g = job->gbuffer;
    const uint32_t y1 = g->height - y0 < ES_FILTER_ROWS ? g->height : y0 + ES_FILTER_ROWS;
    sweep w = {.job = job, .s = s, .planes = job->plane_count, .x0 = x0, .margin = (job->size + VW - 2) / VW * VW};
    w.left = (int64_t)x0 - w.margin * job->passes;
    w.ring = 1;
    while (w.ring < job->size * job->passes) w.ring *= 2;
    w.ring--;
    set_steps(&w);
    /* what the last pass is to make, what it needs for that, and so on */
    uint32_t first = y0, end = y1;
    for (uint32_t p = job->passes; p-- > 0;) {
        w.next[p] = first;
        w.end[p] = end;
        first = first_line(job, first);
        end = end_line(job, end - 1);
    }
    for (uint32_t y = first; y < end; y++) {
        load_line(&w, y);
        find_even(&w, y, y == first);
        pass_line(&w, 0, y);
    }
}
