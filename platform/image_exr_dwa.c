/* Decoder of OpenEXR's DWAA and DWAB chunks, versions 0 to 2 of the format, after the layout of the reference codec
 * (OpenEXR, contributed by DreamWorks Animation).
 *
 * A chunk holds four streams: channels of unknown kind, deflated; AC coefficients, Huffman coded or deflated; DC
 * coefficients, deflated with a byte predictor; and channels kept without loss (alpha), run-length coded, then deflated.
 * Colour channels are 8 × 8 DCT blocks of halves on a perceptual scale, red, green and blue of one layer turned to luma and
 * chroma first. Decoding: un-run-length the AC values in zig-zag order, inverse DCT, back to RGB, to half, to linear.
 *
 * The reference picks its DCT by processor; here one order of operations serves all, so that results are the same
 * everywhere. They differ from the reference by at most rounding in the last half bit.
 */
#include "platform/image_exr_dwa.h"

#if ES_WITH_OPENEXR

#include "platform/image_files.h"

#include <string.h>
#include <zlib.h>

enum { SCHEME_UNKNOWN, SCHEME_LOSSY_DCT, SCHEME_RLE, SCHEME_COUNT };
enum {
    VERSION, UNKNOWN_RAW_SIZE, UNKNOWN_PACKED_SIZE, AC_PACKED_SIZE, DC_PACKED_SIZE, RLE_PACKED_SIZE, RLE_CODED_SIZE, RLE_RAW_SIZE,
    AC_COUNT, DC_COUNT, AC_COMPRESSION, SIZE_COUNT
};
enum { HUFFMAN_SYMBOLS = 65537, HUFFMAN_LENGTHS = 59 };

typedef struct channel_state {
    uint32_t width, height, bytes;  /* samples per row, rows, bytes per sample */
    int scheme;
    bool done;
} channel_state;

typedef struct colour_set {
    const char* prefix;
    size_t prefix_length;
    int channel[3];
} colour_set;

typedef struct chunk_state {
    const es_dwa_channel* channels;
    channel_state state[ES_IMAGE_MAX_CHANNELS];
    uint32_t count, width, height;
    int32_t first_row;
    colour_set sets[ES_IMAGE_MAX_CHANNELS];
    uint32_t set_count;
    size_t* row_offset;  /* [channel × height + row of the channel] in `out` */
    uint8_t* out;
    const uint16_t *ac, *ac_end, *dc, *dc_end;
    const uint16_t* to_linear;
    uint16_t* row_blocks;  /* three rows of blocks */
} chunk_state;

static uint64_t read_u64(const uint8_t* p)
{
    uint64_t value = 0;
    for (int i = 7; i >= 0; i--) value = value << 8 | p[i];
    return value;
}

static uint32_t read_u32(const uint8_t* p) { return p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24; }

/* ---- which channel is coded how --------------------------------------------------------------------------------------- */

static void apply_rule(chunk_state* chunk, const char* suffix, size_t length, int scheme, int type, int set_index, bool any_case)
{
    for (uint32_t c = 0; c < chunk->count; c++) {
        const char* name = chunk->channels[c].name;
        const char* dot = strrchr(name, '.');
        const char* own = dot ? dot + 1 : name;
        size_t prefix_length = dot ? (size_t)(dot - name) : 0;
        if ((int)chunk->channels[c].type != type || strlen(own) != length) continue;
        bool equal = true;
        for (size_t i = 0; i < length && equal; i++) {
            char a = own[i];
            if (any_case && a >= 'A' && a <= 'Z') a = (char)(a - 'A' + 'a');
            equal = a == suffix[i];
        }
        if (!equal) continue;
        chunk->state[c].scheme = scheme;
        if (set_index < 0) continue;
        colour_set* set = NULL;
        for (uint32_t s = 0; s < chunk->set_count && !set; s++) {
            if (chunk->sets[s].prefix_length == prefix_length && memcmp(chunk->sets[s].prefix, name, prefix_length) == 0) {
                set = &chunk->sets[s];
            }
        }
        if (!set) {  /* one per prefix, so at most as many as channels */
            set = &chunk->sets[chunk->set_count++];
            *set = (colour_set){name, prefix_length, {-1, -1, -1}};
        }
        set->channel[set_index] = (int)c;
    }
}

/* Files before version 2 carry no rules; these were built in. */
static void apply_legacy_rules(chunk_state* chunk)
{
    static const struct { const char* suffix; int scheme, set_index; } rules[] = {{"r", SCHEME_LOSSY_DCT, 0}, {"red", SCHEME_LOSSY_DCT, 0},
        {"g", SCHEME_LOSSY_DCT, 1}, {"grn", SCHEME_LOSSY_DCT, 1}, {"green", SCHEME_LOSSY_DCT, 1}, {"b", SCHEME_LOSSY_DCT, 2},
        {"blu", SCHEME_LOSSY_DCT, 2}, {"blue", SCHEME_LOSSY_DCT, 2}, {"y", SCHEME_LOSSY_DCT, -1}, {"by", SCHEME_LOSSY_DCT, -1},
        {"ry", SCHEME_LOSSY_DCT, -1}, {"a", SCHEME_RLE, -1}};
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++) {
        for (int type = ES_DWA_UINT; type <= ES_DWA_FLOAT; type++) {
            if (type == ES_DWA_UINT && rules[i].scheme == SCHEME_LOSSY_DCT) continue;
            apply_rule(chunk, rules[i].suffix, strlen(rules[i].suffix), rules[i].scheme, type, rules[i].set_index, true);
        }
    }
}

/* Rules: suffix, zero, (colour index + 1) 16 + scheme 4 + any case, sample type. */
static bool apply_rules(chunk_state* chunk, const uint8_t* rules, size_t size)
{
    while (size > 0) {
        const uint8_t* end = memchr(rules, 0, size);
        if (!end) return false;
        size_t length = (size_t)(end - rules);
        if (size < length + 3) return false;
        int value = end[1], type = end[2], scheme = value >> 2 & 3, set_index = (value >> 4) - 1;
        if (scheme >= SCHEME_COUNT || set_index > 2 || type > ES_DWA_FLOAT) return false;
        if (scheme == SCHEME_LOSSY_DCT && type == ES_DWA_UINT) return false;
        apply_rule(chunk, (const char*)rules, length, scheme, type, set_index, value & 1);
        rules += length + 3;
        size -= length + 3;
    }
    return true;
}

static int compare_prefix(const colour_set* a, const colour_set* b)
{
    size_t shorter = a->prefix_length < b->prefix_length ? a->prefix_length : b->prefix_length;
    int order = memcmp(a->prefix, b->prefix, shorter);
    return order ? order : (a->prefix_length > b->prefix_length) - (a->prefix_length < b->prefix_length);
}

/* Sets are coded in the order of their prefixes; those without three channels of one sampling are not sets. */
static bool finish_sets(chunk_state* chunk)
{
    uint32_t kept = 0;
    for (uint32_t s = 0; s < chunk->set_count; s++) {
        colour_set set = chunk->sets[s];
        const int* k = set.channel;
        if (k[0] < 0 || k[1] < 0 || k[2] < 0) continue;
        const es_dwa_channel *r = chunk->channels + k[0], *g = chunk->channels + k[1], *b = chunk->channels + k[2];
        if (r->x_sampling != g->x_sampling || r->x_sampling != b->x_sampling || r->y_sampling != g->y_sampling ||
            r->y_sampling != b->y_sampling) {
            continue;
        }
        for (int i = 0; i < 3; i++) {
            if (chunk->state[k[i]].scheme != SCHEME_LOSSY_DCT) return false;
        }
        uint32_t place = kept++;
        for (; place > 0 && compare_prefix(&set, &chunk->sets[place - 1]) < 0; place--) chunk->sets[place] = chunk->sets[place - 1];
        chunk->sets[place] = set;
    }
    chunk->set_count = kept;
    return true;
}

/* ---- entropy coding --------------------------------------------------------------------------------------------------- */

typedef struct bit_reader {
    const uint8_t* bytes;
    uint64_t position, count;  /* in bits */
} bit_reader;

static bool next_bits(bit_reader* in, uint32_t n, uint64_t* value)
{
    if (in->count - in->position < n) return false;
    uint64_t bits = 0;
    for (uint32_t i = 0; i < n; i++, in->position++) bits = bits << 1 | (in->bytes[in->position >> 3] >> (7 - (in->position & 7)) & 1u);
    *value = bits;
    return true;
}

typedef struct huffman {
    uint64_t first[HUFFMAN_LENGTHS];           /* lowest code of each length */
    uint32_t begin[HUFFMAN_LENGTHS + 1];       /* its symbols in `symbols` */
    uint32_t symbols[HUFFMAN_SYMBOLS];         /* by length, then by value */
    uint8_t lengths[HUFFMAN_SYMBOLS];
} huffman;

/* Code lengths of 6 bits; 59 … 62 stand for 2 … 5 unused symbols, 63 for 6 and the next 8 bits more. */
static bool read_code_lengths(huffman* code, bit_reader* in, uint32_t first, uint32_t last)
{
    memset(code->lengths, 0, sizeof code->lengths);
    for (uint32_t symbol = first; symbol <= last;) {
        uint64_t length, more = 0;
        if (!next_bits(in, 6, &length)) return false;
        if (length < 59) {
            code->lengths[symbol++] = (uint8_t)length;
            continue;
        }
        if (length == 63 && !next_bits(in, 8, &more)) return false;
        uint32_t run = length == 63 ? (uint32_t)more + 6 : (uint32_t)length - 57;
        if (run > last + 1 - symbol) return false;
        symbol += run;
    }
    return true;
}

/* Canonical codes: within a length they grow with the symbol, and a longer code is numerically below the start of a
 * shorter one. */
static void build_codes(huffman* code)
{
    uint32_t count[HUFFMAN_LENGTHS] = {0}, next[HUFFMAN_LENGTHS];
    for (uint32_t s = 0; s < HUFFMAN_SYMBOLS; s++) count[code->lengths[s]]++;
    uint64_t low = 0;
    for (int length = HUFFMAN_LENGTHS - 1; length > 0; length--) {
        code->first[length] = low;
        low = (low + count[length]) >> 1;
    }
    code->begin[0] = code->begin[1] = 0;
    for (int length = 1; length < HUFFMAN_LENGTHS; length++) code->begin[length + 1] = code->begin[length] + count[length];
    memcpy(next, code->begin, sizeof next);
    for (uint32_t s = 0; s < HUFFMAN_SYMBOLS; s++) {
        if (code->lengths[s]) code->symbols[next[code->lengths[s]]++] = s;
    }
}

static bool huffman_decode(huffman* code, const uint8_t* in, size_t size, uint16_t* out, size_t count)
{
    if (size < 20) return count == 0;
    uint32_t first = read_u32(in), last = read_u32(in + 4), bits = read_u32(in + 12);
    if (first >= HUFFMAN_SYMBOLS || last >= HUFFMAN_SYMBOLS || first > last) return false;
    bit_reader reader = {in + 20, 0, (uint64_t)(size - 20) * 8};
    if (!read_code_lengths(code, &reader, first, last)) return false;
    reader.position = (reader.position + 7) & ~(uint64_t)7;
    if (bits > reader.count - reader.position) return false;
    reader.count = reader.position + bits;
    build_codes(code);
    for (size_t n = 0; n < count;) {
        uint64_t value = 0, bit;
        uint32_t length = 0, symbol = 0;
        for (;;) {
            if (++length == HUFFMAN_LENGTHS || !next_bits(&reader, 1, &bit)) return false;
            value = value << 1 | bit;
            uint64_t index = value - code->first[length];
            if (value >= code->first[length] && index < code->begin[length + 1] - code->begin[length]) {
                symbol = code->symbols[code->begin[length] + index];
                break;
            }
        }
        if (symbol != last) {
            out[n++] = (uint16_t)symbol;
            continue;
        }
        /* The last symbol repeats the value before it. */
        uint64_t run;
        if (n == 0 || !next_bits(&reader, 8, &run) || run > count - n) return false;
        for (; run; run--, n++) out[n] = out[n - 1];
    }
    return true;
}

static bool inflate_exactly(const uint8_t* in, size_t in_size, uint8_t* out, size_t out_size)
{
    uLongf size = (uLongf)out_size;
    return uncompress(out, &size, in, (uLong)in_size) == Z_OK && size == out_size;
}

/* Bytes are differences of neighbours, the first half of the result's even bytes, then its odd ones. */
static bool inflate_predicted(const uint8_t* in, size_t in_size, uint8_t* temporary, uint8_t* out, size_t out_size)
{
    if (!inflate_exactly(in, in_size, temporary, out_size)) return false;
    for (size_t i = 1; i < out_size; i++) temporary[i] = (uint8_t)(temporary[i - 1] + temporary[i] - 128);
    size_t half = (out_size + 1) / 2;
    for (size_t i = 0; i < out_size; i++) out[i] = temporary[(i & 1 ? half : 0) + i / 2];
    return true;
}

/* Negative count: that many literal bytes; else the next byte count + 1 times. */
static bool undo_runs(const uint8_t* in, size_t in_size, uint8_t* out, size_t out_size)
{
    size_t n = 0;
    for (size_t i = 0; i < in_size;) {
        int count = (int8_t)in[i++];
        if (count < 0) {
            size_t literals = (size_t)-count;
            if (literals > in_size - i || literals > out_size - n) return false;
            memcpy(out + n, in + i, literals);
            i += literals;
            n += literals;
        } else {
            size_t run = (size_t)count + 1;
            if (i >= in_size || run > out_size - n) return false;
            memset(out + n, in[i++], run);
            n += run;
        }
    }
    return n == out_size;
}

/* ---- blocks ----------------------------------------------------------------------------------------------------------- */

/* e^x for |x| <= 16, error below 1e-13: 2^k times the Taylor series on |r| <= ln(2) / 2. */
static double exponential(double x)
{
    int k = (int)(x * 1.4426950408889634 + (x < 0 ? -0.5 : 0.5));
    double r = x - k * 0.69314718055994531, term = 1, sum = 1;
    for (int i = 1; i <= 14; i++) {
        term = term * r / i;
        sum += term;
    }
    for (; k > 0; k--) sum *= 2;
    for (; k < 0; k++) sum *= 0.5;
    return sum;
}

/* The perceptual scale: x^2.2 up to one, e^(2.2 (x - 1)) above, with the reference's float base of 9.025013. */
static void build_to_linear(uint16_t* table)
{
    for (uint32_t i = 0; i < 32768; i++) {
        double x = es_half_to_float((uint16_t)i), y;
        if ((i & 0x7c00u) == 0x7c00u || i == 0) {
            table[i] = table[i | 0x8000u] = 0;
            continue;
        }
        if (x <= 1) {
            double t = 1;  /* fifth root by Newton's method; far from the root a step only takes a fifth off, hence 40 */
            for (int step = 0; step < 40; step++) {
                double t2 = t * t;
                t = (4 * t + x / (t2 * t2)) / 5;
            }
            y = x * x * t;
        } else {
            y = x < 8 ? exponential(2.1999999413337794 * (x - 1)) : 1e9;
        }
        table[i] = es_float_to_half((float)y);
        table[i | 0x8000u] = (uint16_t)(table[i] | 0x8000u);
    }
}

static void inverse_dct_8(float* v, size_t step)
{
    static const float a = 3.535536e-01f, b = 4.903927e-01f, c = 4.619398e-01f, d = 4.157349e-01f, e = 2.777855e-01f, f = 1.913422e-01f,
                       g = 9.754573e-02f;
    float v0 = v[0], v1 = v[step], v2 = v[2 * step], v3 = v[3 * step], v4 = v[4 * step], v5 = v[5 * step], v6 = v[6 * step],
          v7 = v[7 * step];
    float beta0 = b * v1 + d * v3 + e * v5 + g * v7, beta1 = d * v1 - g * v3 - b * v5 - e * v7;
    float beta2 = e * v1 - b * v3 + g * v5 + d * v7, beta3 = g * v1 - e * v3 + d * v5 - b * v7;
    float theta0 = a * (v0 + v4), theta3 = a * (v0 - v4), theta1 = c * v2 + f * v6, theta2 = f * v2 - c * v6;
    float gamma0 = theta0 + theta1, gamma1 = theta3 + theta2, gamma2 = theta3 - theta2, gamma3 = theta0 - theta1;
    v[0] = gamma0 + beta0, v[step] = gamma1 + beta1, v[2 * step] = gamma2 + beta2, v[3 * step] = gamma3 + beta3;
    v[4 * step] = gamma3 - beta3, v[5 * step] = gamma2 - beta2, v[6 * step] = gamma1 - beta1, v[7 * step] = gamma0 - beta0;
}

/* One block's coefficients into `data`; `flat` tells that there is no AC. */
static bool read_block(chunk_state* chunk, uint16_t dc, float data[64], bool* flat)
{
    static const uint8_t zig_zag[64] = {0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7,
        14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};
    memset(data, 0, 64 * sizeof *data);
    data[0] = es_half_to_float(dc);
    *flat = true;
    for (uint32_t k = 1; k < 64;) {
        if (chunk->ac == chunk->ac_end) return false;
        uint16_t value = *chunk->ac++;
        if (value == 0xff00) break;  /* end of the block */
        if (value >> 8 == 0xff) {    /* zeros; halves of this form are NaNs, which no coefficient is */
            k += value & 0xffu;
            continue;
        }
        data[zig_zag[k++]] = es_half_to_float(value);
        *flat = false;
    }
    return true;
}

static void to_samples(float data[3][64], uint32_t components, const bool flat[3])
{
    bool all_flat = true;
    for (uint32_t i = 0; i < components; i++) all_flat = all_flat && flat[i];
    for (uint32_t i = 0; i < components; i++) {
        if (flat[i]) {
            float value = data[i][0] * 3.535536e-01f * 3.535536e-01f;
            for (int k = 0; k < 64; k++) data[i][k] = value;
            continue;
        }
        for (int row = 0; row < 8; row++) inverse_dct_8(data[i] + 8 * row, 1);
        for (int column = 0; column < 8; column++) inverse_dct_8(data[i] + column, 8);
    }
    for (int k = 0; k < 64 && components == 3; k++) {
        float y = data[0][k], cb = data[1][k], cr = data[2][k];
        data[0][k] = y + 1.5747f * cr;
        data[1][k] = y - 0.1873f * cb - 0.4682f * cr;
        data[2][k] = y + 1.8556f * cb;
    }
}

static void write_sample(uint8_t* out, es_dwa_type type, uint16_t half)
{
    if (type == ES_DWA_HALF) {
        out[0] = (uint8_t)half, out[1] = (uint8_t)(half >> 8);
        return;
    }
    float value = es_half_to_float(half);
    uint32_t bits;
    memcpy(&bits, &value, 4);
    for (int i = 0; i < 4; i++) out[i] = (uint8_t)(bits >> 8 * i);
}

/* One channel, or three of a set. DC values stand plane after plane, AC values block after block. */
static bool decode_lossy(chunk_state* chunk, const int* which, uint32_t components)
{
    const channel_state* state = &chunk->state[which[0]];
    uint32_t blocks_x = (state->width + 7) / 8, blocks_y = (state->height + 7) / 8;
    size_t blocks = (size_t)blocks_x * blocks_y;
    if ((size_t)(chunk->dc_end - chunk->dc) < blocks * components) return false;
    const uint16_t* dc = chunk->dc;
    chunk->dc += blocks * components;
    for (uint32_t by = 0; by < blocks_y; by++) {
        for (uint32_t bx = 0; bx < blocks_x; bx++) {
            float data[3][64];
            bool flat[3];
            for (uint32_t i = 0; i < components; i++) {
                if (!read_block(chunk, dc[blocks * i + (size_t)by * blocks_x + bx], data[i], &flat[i])) return false;
            }
            to_samples(data, components, flat);
            for (uint32_t i = 0; i < components; i++) {
                const es_dwa_channel* channel = &chunk->channels[which[i]];
                const size_t* rows = chunk->row_offset + (size_t)which[i] * chunk->height;
                uint32_t bytes = chunk->state[which[i]].bytes;
                for (uint32_t y = 0; y < 8 && 8 * by + y < state->height; y++) {
                    uint8_t* out = chunk->out + rows[8 * by + y];
                    for (uint32_t x = 0; x < 8 && 8 * bx + x < state->width; x++) {
                        uint16_t half = es_float_to_half(data[i][8 * y + x]);
                        if (components == 3 || !channel->linear) half = chunk->to_linear[half];
                        write_sample(out + (size_t)(8 * bx + x) * bytes, channel->type, half);
                    }
                }
            }
        }
    }
    for (uint32_t i = 0; i < components; i++) chunk->state[which[i]].done = true;
    return true;
}

/* Bytes of a lossless channel: all first bytes, then all second ones … */
static void scatter_planes(const chunk_state* chunk, uint32_t c, const uint8_t* in)
{
    const channel_state* state = &chunk->state[c];
    size_t plane = (size_t)state->width * state->height;
    for (uint32_t y = 0; y < state->height; y++) {
        uint8_t* out = chunk->out + chunk->row_offset[(size_t)c * chunk->height + y];
        for (uint32_t x = 0; x < state->width; x++) {
            for (uint32_t k = 0; k < state->bytes; k++) *out++ = in[plane * k + (size_t)y * state->width + x];
        }
    }
}

static void copy_rows(const chunk_state* chunk, uint32_t c, const uint8_t* in)
{
    size_t row = (size_t)chunk->state[c].width * chunk->state[c].bytes;
    for (uint32_t y = 0; y < chunk->state[c].height; y++, in += row) {
        memcpy(chunk->out + chunk->row_offset[(size_t)c * chunk->height + y], in, row);
    }
}

/* ---- chunk ------------------------------------------------------------------------------------------------------------ */

static bool grow(es_dwa_scratch* scratch, size_t size)
{
    if (!scratch->to_linear) {
        scratch->to_linear = es_allocate(scratch->context, 65536 * sizeof *scratch->to_linear);
        if (!scratch->to_linear) return false;
        build_to_linear(scratch->to_linear);
    }
    if (size <= scratch->size) return true;
    es_release(scratch->context, scratch->memory, scratch->size);
    scratch->size = 0;
    scratch->memory = es_allocate(scratch->context, size);
    if (scratch->memory) scratch->size = size;
    return scratch->memory != NULL;
}

void es_dwa_scratch_free(es_dwa_scratch* scratch)
{
    es_release(scratch->context, scratch->memory, scratch->size);
    es_release(scratch->context, scratch->to_linear, scratch->to_linear ? 65536 * sizeof *scratch->to_linear : 0);
    *scratch = (es_dwa_scratch){.context = scratch->context};
}

static uint8_t* take(uint8_t** memory, size_t size)
{
    uint8_t* block = *memory;
    *memory += (size + 63) & ~(size_t)63;
    return block;
}

typedef struct stream_sizes { size_t raw[SCHEME_COUNT], blocks, rows; } stream_sizes;

/* Sizes of the channels and of their streams; false when they do not make up the chunk. */
static bool measure(chunk_state* chunk, size_t out_size, stream_sizes* sizes)
{
    size_t total = 0;
    *sizes = (stream_sizes){.rows = (size_t)chunk->count * chunk->height};
    for (uint32_t c = 0; c < chunk->count; c++) {
        channel_state* state = &chunk->state[c];
        state->bytes = chunk->channels[c].type == ES_DWA_HALF ? 2 : 4;
        state->width = chunk->width / chunk->channels[c].x_sampling;
        state->height = 0;
        for (uint32_t y = 0; y < chunk->height; y++) state->height += (chunk->first_row + (int64_t)y) % chunk->channels[c].y_sampling == 0;
        size_t bytes = (size_t)state->width * state->height * state->bytes;
        total += bytes;
        if (state->scheme == SCHEME_LOSSY_DCT) sizes->blocks += (size_t)((state->width + 7) / 8) * ((state->height + 7) / 8);
        else sizes->raw[state->scheme] += bytes;
    }
    return total <= out_size;
}

static void locate_rows(chunk_state* chunk)
{
    size_t offset = 0;
    uint32_t row[ES_IMAGE_MAX_CHANNELS] = {0};
    for (uint32_t y = 0; y < chunk->height; y++) {
        for (uint32_t c = 0; c < chunk->count; c++) {
            if ((chunk->first_row + (int64_t)y) % chunk->channels[c].y_sampling) continue;
            chunk->row_offset[(size_t)c * chunk->height + row[c]++] = offset;
            offset += (size_t)chunk->state[c].width * chunk->state[c].bytes;
        }
    }
}

es_dwa_result es_dwa_decode(es_dwa_scratch* scratch, const uint8_t* packed, size_t packed_size, const es_dwa_channel* channels,
    uint32_t channel_count, uint32_t width, uint32_t height, int32_t first_row, uint8_t* out, size_t out_size)
{
    chunk_state chunk = {.channels = channels, .count = channel_count, .width = width, .height = height, .first_row = first_row, .out = out};
    uint64_t sizes[SIZE_COUNT];
    if (channel_count > ES_IMAGE_MAX_CHANNELS || packed_size < sizeof sizes) return ES_DWA_DAMAGED;
    for (int i = 0; i < SIZE_COUNT; i++) sizes[i] = read_u64(packed + 8 * i);
    const uint8_t* in = packed + sizeof sizes;
    size_t left = packed_size - sizeof sizes;
    if (sizes[VERSION] > 2) return ES_DWA_DAMAGED;
    if (sizes[VERSION] == 2) {
        size_t rules = left < 2 ? 0 : (size_t)(in[0] | in[1] << 8);
        if (rules < 2 || rules > left || !apply_rules(&chunk, in + 2, rules - 2)) return ES_DWA_DAMAGED;
        in += rules;
        left -= rules;
    } else {
        apply_legacy_rules(&chunk);
    }
    const uint8_t* stream[4];
    for (int i = 0; i < 4; i++) {
        uint64_t size = sizes[UNKNOWN_PACKED_SIZE + i];
        if (size > left) return ES_DWA_DAMAGED;
        stream[i] = in;
        in += size;
        left -= (size_t)size;
    }

    stream_sizes need;
    if (!finish_sets(&chunk) || !measure(&chunk, out_size, &need)) return ES_DWA_DAMAGED;
    /* A block has at most 63 AC values or runs. A run-length code is at most twice what it stands for. */
    if (sizes[AC_COUNT] > need.blocks * 64 || sizes[DC_COUNT] > need.blocks || sizes[UNKNOWN_RAW_SIZE] > need.raw[SCHEME_UNKNOWN] ||
        sizes[RLE_RAW_SIZE] > need.raw[SCHEME_RLE] || sizes[RLE_CODED_SIZE] > need.raw[SCHEME_RLE] * 2 + 16) {
        return ES_DWA_DAMAGED;
    }
    size_t ac_size = (size_t)sizes[AC_COUNT] * 2, dc_size = (size_t)sizes[DC_COUNT] * 2;
    size_t unknown_size = need.raw[SCHEME_UNKNOWN], rle_size = need.raw[SCHEME_RLE], coded_size = (size_t)sizes[RLE_CODED_SIZE];
    size_t rows_size = need.rows * sizeof(size_t);
    if (!grow(scratch, sizeof(huffman) + ac_size + 2 * dc_size + unknown_size + rle_size + coded_size + rows_size + 64 * 9)) {
        return ES_DWA_NO_MEMORY;
    }
    uint8_t* memory = scratch->memory;
    huffman* code = (huffman*)take(&memory, sizeof(huffman));
    uint16_t* ac = (uint16_t*)take(&memory, ac_size);
    uint16_t* dc = (uint16_t*)take(&memory, dc_size);
    uint8_t* temporary = take(&memory, dc_size);
    uint8_t* unknown = take(&memory, unknown_size);
    uint8_t* rle = take(&memory, rle_size);
    uint8_t* coded = take(&memory, coded_size);
    chunk.row_offset = (size_t*)take(&memory, rows_size);
    chunk.to_linear = scratch->to_linear;

    if (unknown_size && (sizes[UNKNOWN_RAW_SIZE] != unknown_size ||
                            !inflate_exactly(stream[0], (size_t)sizes[UNKNOWN_PACKED_SIZE], unknown, unknown_size))) {
        return ES_DWA_DAMAGED;
    }
    if (ac_size) {
        bool good = sizes[AC_COMPRESSION] == 0
            ? huffman_decode(code, stream[1], (size_t)sizes[AC_PACKED_SIZE], ac, (size_t)sizes[AC_COUNT])
            : sizes[AC_COMPRESSION] == 1 && inflate_exactly(stream[1], (size_t)sizes[AC_PACKED_SIZE], (uint8_t*)ac, ac_size);
        if (!good) return ES_DWA_DAMAGED;
        const uint8_t* bytes = (const uint8_t*)ac;
        for (size_t i = 0; i < (size_t)sizes[AC_COUNT] && sizes[AC_COMPRESSION] == 1; i++) ac[i] = (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
    }
    if (dc_size) {
        if (!inflate_predicted(stream[2], (size_t)sizes[DC_PACKED_SIZE], temporary, (uint8_t*)dc, dc_size)) return ES_DWA_DAMAGED;
        const uint8_t* bytes = (const uint8_t*)dc;
        for (size_t i = 0; i < (size_t)sizes[DC_COUNT]; i++) dc[i] = (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
    }
    if (rle_size && (sizes[RLE_RAW_SIZE] != rle_size || !inflate_exactly(stream[3], (size_t)sizes[RLE_PACKED_SIZE], coded, coded_size) ||
                        !undo_runs(coded, coded_size, rle, rle_size))) {
        return ES_DWA_DAMAGED;
    }

    locate_rows(&chunk);
    chunk.ac = ac, chunk.ac_end = ac + sizes[AC_COUNT];
    chunk.dc = dc, chunk.dc_end = dc + sizes[DC_COUNT];
    for (uint32_t s = 0; s < chunk.set_count; s++) {
        if (!decode_lossy(&chunk, chunk.sets[s].channel, 3)) return ES_DWA_DAMAGED;
    }
    for (uint32_t c = 0; c < channel_count; c++) {
        size_t bytes = (size_t)chunk.state[c].width * chunk.state[c].height * chunk.state[c].bytes;
        int which = (int)c;
        if (chunk.state[c].done) continue;
        if (chunk.state[c].scheme == SCHEME_LOSSY_DCT) {
            if (!decode_lossy(&chunk, &which, 1)) return ES_DWA_DAMAGED;
        } else if (chunk.state[c].scheme == SCHEME_RLE) {
            scatter_planes(&chunk, c, rle);
            rle += bytes;
        } else {
            copy_rows(&chunk, c, unknown);
            unknown += bytes;
        }
    }
    return ES_DWA_OK;
}

#endif
