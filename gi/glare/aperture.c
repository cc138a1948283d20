#include "gi/glare/aperture.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"

enum { BAND = 16 /* rows of pixels drawn together: their bits stay in the first cache */, WORD = 64 };

/* In units of places of samples, rows downwards. */
typedef struct disc { float x, y, radius; } disc;
typedef struct quad { float x[4], y[4], top, bottom; } quad;

typedef struct drawing {
    const es_eye_shapes* shapes;
    uint32_t size, supersample, words; /* of a row of places */
    float scale, middle;       /* places a millimetre; of the plane, in places */
    disc* discs;
    quad* quads;
    uint64_t* bits;            /* of each worker's band */
    size_t band_words;
    float* transmittance;
    float level[65];           /* transmittance of so many open places */
} drawing;

/* ---- bits ------------------------------------------------------------------------------------------------------------------------------ */

/* Places of [from, to) whose middles are at i + 0.5, as whole numbers in 0 … count. */
static uint32_t first_place(float from, uint32_t count)
{
    const float at = from - 0.5f;
    if (!(at > 0)) return 0;
    if (at >= (float)count) return count;
    const uint32_t whole = (uint32_t)at;
    return whole + ((float)whole < at);
}

static void fill(uint64_t* row, uint32_t from, uint32_t to, bool open)
{
    if (from >= to) return;
    const uint32_t first = from / WORD, last = (to - 1) / WORD;
    const uint64_t head = ~0ull << from % WORD, tail = ~0ull >> (WORD - 1 - (to - 1) % WORD);
    for (uint32_t i = first; i <= last; i++) {
        const uint64_t mask = (i == first ? head : ~0ull) & (i == last ? tail : ~0ull);
        if (open) row[i] |= mask;
        else row[i] &= ~mask;
    }
}

static void fill_between(const drawing* d, uint64_t* row, float from, float to, bool open)
{
    const uint32_t count = d->size * d->supersample;
    fill(row, first_place(from, count), first_place(to, count), open);
}

/* Rows of places [begin, end) that are drawn; of them those between `top` and `bottom`. */
static void rows_between(float top, float bottom, uint32_t* begin, uint32_t* end)
{
    const uint32_t from = first_place(top, *end), to = first_place(bottom, *end);
    if (from > *begin) *begin = from;
    *end = to;
}

static void fill_disc(const drawing* d, uint64_t* bits, uint32_t begin, uint32_t end, const disc* c, bool open)
{
    uint32_t from = begin, to = end;
    rows_between(c->y - c->radius, c->y + c->radius, &from, &to);
    for (uint32_t y = from; y < to; y++) {
        const float dy = (float)y + 0.5f - c->y, square = c->radius * c->radius - dy * dy;
        if (!(square > 0)) continue;
        const float half = es_sqrt(square);
        fill_between(d, bits + (size_t)(y - begin) * d->words, c->x - half, c->x + half, open);
    }
}

static void fill_quad(const drawing* d, uint64_t* bits, uint32_t begin, uint32_t end, const quad* q)
{
    uint32_t from = begin, to = end;
    rows_between(q->top, q->bottom, &from, &to);
    for (uint32_t y = from; y < to; y++) {
        const float at = (float)y + 0.5f;
        float low = 1e30f, high = -1e30f;
        for (uint32_t i = 0; i < 4; i++) {
            const uint32_t j = (i + 1) % 4;
            const float above = at - q->y[i], below = at - q->y[j];
            if ((above < 0) == (below < 0)) continue;
            const float x = q->x[i] + (q->x[j] - q->x[i]) * (above / (q->y[j] - q->y[i]));
            low = es_minf(low, x);
            high = es_maxf(high, x);
        }
        if (low < high) fill_between(d, bits + (size_t)(y - begin) * d->words, low, high, false);
    }
}

/* Half the width of what a lid whose edge is `bend` x² away from `apex` leaves open at a height `rise` this side of it. */
static float lid_half(float rise, float bend)
{
    if (!(rise > 0)) return -1;
    return bend > 1e-6f ? es_sqrt(rise / bend) : 1e6f;
}

static void fill_lids(const drawing* d, uint64_t* bits, uint32_t begin, uint32_t end)
{
    const es_eye_shapes* s = d->shapes;
    for (uint32_t y = begin; y < end; y++) {
        const float height = (d->middle - ((float)y + 0.5f)) / d->scale;
        const float half = es_minf(lid_half(s->upper - height, s->upper_bend), lid_half(height - s->lower, s->lower_bend)) * d->scale;
        uint64_t* row = bits + (size_t)(y - begin) * d->words;
        if (half < 0) {
            fill(row, 0, d->size * d->supersample, false);
        } else {
            fill_between(d, row, 0, d->middle - half, false);
            fill_between(d, row, d->middle + half, 1e9f, false);
        }
    }
}

/* ---- counting -------------------------------------------------------------------------------------------------------------------------- */

/* Open places of the pixels of a word, in fields of the result: of 8 bits for 8 and 4 places a row, of 4 for 2, of 1 for 1; with 4 and 2 of even pixels
 * in [0] and of odd ones in [1]. */
static inline void count_word(const uint64_t* bits, uint32_t words, uint32_t supersample, uint64_t counts[2])
{
    const uint64_t ones = 0x5555555555555555ull, twos = 0x3333333333333333ull, fours = 0x0f0f0f0f0f0f0f0full;
    counts[0] = counts[1] = 0;
    for (uint32_t i = 0; i < supersample; i++) {
        uint64_t w = bits[(size_t)i * words];
        if (supersample == 1) {
            counts[0] = w;
            continue;
        }
        w -= w >> 1 & ones;
        if (supersample == 2) {
            counts[0] += w & twos;
            counts[1] += w >> 2 & twos;
            continue;
        }
        w = (w & twos) + (w >> 2 & twos);
        if (supersample == 4) {
            counts[0] += w & fours;
            counts[1] += w >> 4 & fours;
        } else {
            counts[0] += (w + (w >> 4)) & fours;
        }
    }
}

/* Of one row of pixels; `supersample` is a constant wherever this is called. */
static inline void resolve_row(const drawing* d, const uint64_t* bits, uint32_t supersample, float* out)
{
    const uint32_t pixels = WORD / supersample, field = supersample == 1 ? 1 : supersample == 2 ? 4 : 8;
    const bool split = supersample == 2 || supersample == 4;
    const uint64_t mask = (1ull << field) - 1;
    for (uint32_t i = 0, x = 0; x < d->size; i++, x += pixels) {
        uint64_t counts[2];
        count_word(bits + i, d->words, supersample, counts);
        const uint32_t some = d->size - x < pixels ? d->size - x : pixels;
        for (uint32_t p = 0; p < some; p++) out[x + p] = d->level[(split ? counts[p & 1] >> (p >> 1) * field : counts[0] >> p * field) & mask];
    }
}

static void bands(void* user, uint32_t row_begin, uint32_t row_end, uint32_t worker)
{
    const drawing* d = user;
    const es_eye_shapes* s = d->shapes;
    const uint32_t n = d->supersample, begin = row_begin * n, end = row_end * n;
    uint64_t* bits = d->bits + worker * d->band_words;
    memset(bits, 0, (size_t)(end - begin) * d->words * sizeof *bits);
    fill_disc(d, bits, begin, end, &(disc){d->middle, d->middle, s->pupil * d->scale}, true);
    for (uint32_t i = 0; i < s->disc_count; i++) fill_disc(d, bits, begin, end, &d->discs[i], false);
    for (uint32_t i = 0; i < s->quad_count; i++) fill_quad(d, bits, begin, end, &d->quads[i]);
    if (s->lids) fill_lids(d, bits, begin, end);
    for (uint32_t y = row_begin; y < row_end; y++) {
        const uint64_t* from = bits + (size_t)(y - row_begin) * n * d->words;
        float* out = d->transmittance + (size_t)y * d->size;
        if (n == 1) resolve_row(d, from, 1, out);
        else if (n == 2) resolve_row(d, from, 2, out);
        else if (n == 4) resolve_row(d, from, 4, out);
        else resolve_row(d, from, 8, out);
    }
}

/* ---- the whole ------------------------------------------------------------------------------------------------------------------------- */

static void place_shapes(drawing* d)
{
    const es_eye_shapes* s = d->shapes;
    for (uint32_t i = 0; i < s->disc_count; i++) d->discs[i] = (disc){d->middle + s->discs[i].x * d->scale, d->middle - s->discs[i].y * d->scale, s->discs[i].radius * d->scale};
    for (uint32_t i = 0; i < s->quad_count; i++) {
        quad* q = &d->quads[i];
        q->top = 1e30f;
        q->bottom = -1e30f;
        for (uint32_t k = 0; k < 4; k++) {
            q->x[k] = d->middle + s->quads[i].corner[k].x * d->scale;
            q->y[k] = d->middle - s->quads[i].corner[k].y * d->scale;
            q->top = es_minf(q->top, q->y[k]);
            q->bottom = es_maxf(q->bottom, q->y[k]);
        }
    }
}

static es_result reserve(es_context* context, uint32_t size, es_aperture* aperture)
{
    if (aperture->transmittance && aperture->size == size) return ES_OK;
    es_aperture_free(context, aperture);
    float* transmittance = es_allocate_array(context, (size_t)size * size, sizeof *transmittance);
    if (!transmittance) return es_context_last_result(context);
    *aperture = (es_aperture){size, 0, transmittance};
    return ES_OK;
}

es_result es_aperture_draw_shapes(es_context* context, const es_eye_shapes* shapes, uint32_t size, float width, uint32_t supersample, es_aperture* aperture)
{
    if (!size || size > ES_APERTURE_MAX_SIZE || !(width > 1e-9f) || !(width < 1e9f) || !(supersample == 1 || supersample == 2 || supersample == 4 || supersample == 8))
        return es_fail(context, ES_INVALID_ARGUMENT, "an aperture of %u pixels, %g m and %u samples: 1 to %d pixels, more than 0 m and 1, 2, 4 or 8 samples are accepted", size, (double)width, supersample, ES_APERTURE_MAX_SIZE);
    es_result result = reserve(context, size, aperture);
    if (result) return result;
    drawing d = {.shapes = shapes, .size = size, .supersample = supersample, .words = (size * supersample + WORD - 1) / WORD, .transmittance = aperture->transmittance};
    d.middle = 0.5f * (float)(size * supersample);
    d.scale = (float)(size * supersample) / (width * 1e3f);
    for (uint32_t i = 0; i <= supersample * supersample; i++) d.level[i] = (float)i / (float)(supersample * supersample);
    d.band_words = (size_t)d.words * BAND * supersample;
    const size_t bit_bytes = es_context_workers(context) * d.band_words * sizeof *d.bits, disc_bytes = (shapes->disc_count + 1) * sizeof *d.discs, quad_bytes = (shapes->quad_count + 1) * sizeof *d.quads;
    const size_t bytes = bit_bytes + disc_bytes + quad_bytes;
    char* memory = es_allocate(context, bytes);
    if (!memory) return es_context_last_result(context);
    d.bits = (uint64_t*)(void*)memory;
    d.discs = (disc*)(void*)(memory + bit_bytes);
    d.quads = (quad*)(void*)(memory + bit_bytes + disc_bytes);
    place_shapes(&d);
    es_parallel_for(context, size, BAND, bands, &d);
    es_release(context, memory, bytes);
    aperture->width = width;
    return ES_OK;
}

es_result es_aperture_draw(es_context* context, const es_eye* eye, uint32_t size, float width, uint32_t supersample, es_aperture* aperture)
{
    es_eye_shapes* shapes = es_allocate(context, sizeof *shapes);
    if (!shapes) return es_context_last_result(context);
    es_eye_get_shapes(eye, shapes);
    es_result result = es_aperture_draw_shapes(context, shapes, size, width, supersample, aperture);
    es_release(context, shapes, sizeof *shapes);
    return result;
}

void es_aperture_free(es_context* context, es_aperture* aperture)
{
    es_release(context, aperture->transmittance, (size_t)aperture->size * aperture->size * sizeof *aperture->transmittance);
    *aperture = (es_aperture){0};
}
