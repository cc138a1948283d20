/* Transforms of strips of eight columns, and of rows (gi/fft.h).
 *
 * The core transforms n vectors of eight complex lanes (vc). Its first pass reads them from where they are, the others work in scratch, block by
 * block, so that all but the first find theirs in the first cache; the last writes each to its place.
 *
 * Values: finite, and so small that sums over the picture stay finite. Operations of a lane depend on the length alone. */
#include "gi/fft.h"
#include "gi/kernel_table.h"
#include "platform/simd_complex.h"

enum { LINE = 2 * ES_FFT_BLOCK }; /* floats of a vc */

/* ---- butterflies ------------------------------------------------------------------------------------------------------------------------ */

VINL void butterfly2(vc x[])
{
    const vc a = x[0];
    x[0] = vc_add(a, x[1]);
    x[1] = vc_sub(a, x[1]);
}

VINL void butterfly3(vc x[])
{
    const vc sum = vc_add(x[1], x[2]), difference = vc_scale(vc_times_minus_i(vc_sub(x[1], x[2])), 0.866025404f);
    const vc middle = vc_sub(x[0], vc_scale(sum, 0.5f));
    x[0] = vc_add(x[0], sum);
    x[1] = vc_add(middle, difference);
    x[2] = vc_sub(middle, difference);
}

VINL void butterfly4(vc x[])
{
    const vc a = vc_add(x[0], x[2]), b = vc_sub(x[0], x[2]), c = vc_add(x[1], x[3]), d = vc_times_minus_i(vc_sub(x[1], x[3]));
    x[0] = vc_add(a, c);
    x[1] = vc_add(b, d);
    x[2] = vc_sub(a, c);
    x[3] = vc_sub(b, d);
}

VINL void butterfly5(vc x[])
{
    const float c1 = 0.309016994f, c2 = -0.809016994f, s1 = 0.951056516f, s2 = 0.587785252f; /* of 2 pi / 5 and 4 pi / 5 */
    const vc near_sum = vc_add(x[1], x[4]), near_difference = vc_sub(x[1], x[4]), far_sum = vc_add(x[2], x[3]), far_difference = vc_sub(x[2], x[3]);
    const vc a = vc_add(x[0], vc_add(vc_scale(near_sum, c1), vc_scale(far_sum, c2))), b = vc_add(x[0], vc_add(vc_scale(near_sum, c2), vc_scale(far_sum, c1)));
    const vc c = vc_times_minus_i(vc_add(vc_scale(near_difference, s1), vc_scale(far_difference, s2)));
    const vc d = vc_times_minus_i(vc_sub(vc_scale(near_difference, s2), vc_scale(far_difference, s1)));
    x[0] = vc_add(x[0], vc_add(near_sum, far_sum));
    x[1] = vc_add(a, c);
    x[2] = vc_add(b, d);
    x[3] = vc_sub(b, d);
    x[4] = vc_sub(a, c);
}

VINL void butterfly8(vc x[])
{
    vc even[4] = {x[0], x[2], x[4], x[6]}, odd[4] = {x[1], x[3], x[5], x[7]};
    butterfly4(even);
    butterfly4(odd);
    const float half = 0.707106781f;
    const vc turned[4] = {odd[0], vc_scale(vc_add(odd[1], vc_times_minus_i(odd[1])), half), vc_times_minus_i(odd[2]), vc_scale(vc_sub(vc_times_minus_i(odd[3]), odd[3]), half)};
    for (int k = 0; k < 4; k++) {
        x[k] = vc_add(even[k], turned[k]);
        x[k + 4] = vc_sub(even[k], turned[k]);
    }
}

VINL void butterfly(vc x[], int radix)
{
    if (radix == 8) butterfly8(x);
    else if (radix == 4) butterfly4(x);
    else if (radix == 2) butterfly2(x);
    else if (radix == 3) butterfly3(x);
    else butterfly5(x);
}

/* ---- passes ----------------------------------------------------------------------------------------------------------------------------- */

/* Where vectors come from or go to: those from `count` on are zero, or are dropped. */
typedef struct places { const float* from; float* to; size_t stride; uint32_t count; bool swap; float* spare; } places;

VINL vc take(const places* p, uint32_t i)
{
    const vc a = vc_load(i < p->count ? p->from + i * p->stride : p->spare);
    return p->swap ? vc_swap(a) : a;
}

VINL void put(const places* p, uint32_t i, vc a) { vc_store(i < p->count ? p->to + i * p->stride : p->spare, p->swap ? vc_swap(a) : a); }

/* One pass over a block of `length` vectors in scratch, or from their places into it. */
VINL void pass_of(int radix, uint32_t length, const float* twiddles, const places* from, float* block)
{
    const uint32_t step = length / (uint32_t)radix;
    for (uint32_t j = 0; j < step; j++, twiddles += 2 * (radix - 1)) {
        vc x[8];
        for (int q = 0; q < radix; q++) x[q] = from ? take(from, j + (uint32_t)q * step) : vc_load(block + LINE * (size_t)(j + (uint32_t)q * step));
        butterfly(x, radix);
        vc_store(block + LINE * (size_t)j, x[0]);
        for (int q = 1; q < radix; q++) vc_store(block + LINE * (size_t)(j + (uint32_t)q * step), vc_rotate(x[q], twiddles + 2 * (q - 1)));
    }
}

VINL void last_pass_of(int radix, const es_fft_axis* axis, uint32_t first_run, uint32_t runs, const places* from, const float* block, const places* to)
{
    const uint32_t apart = axis->length / (uint32_t)radix;
    for (uint32_t run = 0; run < runs; run++, block += LINE * (size_t)radix) {
        vc x[8];
        for (int q = 0; q < radix; q++) x[q] = from ? take(from, (uint32_t)q) : vc_load(block + LINE * (size_t)q);
        butterfly(x, radix);
        const uint32_t frequency = axis->order[first_run + run];
        for (int q = 0; q < radix; q++) put(to, frequency + (uint32_t)q * apart, x[q]);
    }
}

/* A body for each radix, with loops that are unrolled. */
#define FOR_RADIX(radix, CALL) \
    switch (radix) {           \
    case 8: CALL(8); break;    \
    case 4: CALL(4); break;    \
    case 2: CALL(2); break;    \
    case 3: CALL(3); break;    \
    default: CALL(5); break;   \
    }

static void inner_pass(uint32_t radix, uint32_t length, const float* twiddles, float* block)
{
#define CALL(r) pass_of(r, length, twiddles, NULL, block)
    FOR_RADIX(radix, CALL)
#undef CALL
}
static void first_pass(uint32_t radix, uint32_t length, const float* twiddles, const places* from, float* block)
{
#define CALL(r) pass_of(r, length, twiddles, from, block)
    FOR_RADIX(radix, CALL)
#undef CALL
}
static void last_pass(uint32_t radix, const es_fft_axis* axis, uint32_t first_run, uint32_t runs, const float* block, const places* to)
{
#define CALL(r) last_pass_of(r, axis, first_run, runs, NULL, block, to)
    FOR_RADIX(radix, CALL)
#undef CALL
}
static void only_pass(uint32_t radix, const es_fft_axis* axis, const places* from, const places* to)
{
#define CALL(r) last_pass_of(r, axis, 0, 1, from, NULL, to)
    FOR_RADIX(radix, CALL)
#undef CALL
}

/* Transforms axis->length vectors by way of as many in scratch. Blocks that fit the first cache are finished one after another. */
static void transform(const es_fft_axis* axis, const places* from, float* scratch, const places* to)
{
    const uint32_t n = axis->length, passes = axis->pass_count;
    if (passes == 0) {
        put(to, 0, take(from, 0));
        return;
    }
    if (passes == 1) {
        only_pass(axis->radix[0], axis, from, to);
        return;
    }
    first_pass(axis->radix[0], n, axis->twiddles[0], from, scratch);
    const uint32_t part = n / axis->radix[0], last = axis->radix[passes - 1];
    for (uint32_t begin = 0; begin < n; begin += part) {
        uint32_t length = part;
        for (uint32_t pass = 1; pass + 1 < passes; length /= axis->radix[pass], pass++)
            for (uint32_t block = begin; block < begin + part; block += length) inner_pass(axis->radix[pass], length, axis->twiddles[pass], scratch + LINE * (size_t)block);
        last_pass(last, axis, begin / last, part / last, scratch + LINE * (size_t)begin, to);
    }
}

/* ---- columns ---------------------------------------------------------------------------------------------------------------------------- */

static void dark_strip(const es_fft_columns_job* job, size_t at, uint32_t floats)
{
    for (uint32_t y = 0; y < job->to_rows; y++) memset(job->to + y * job->to_stride + at, 0, floats * sizeof(float));
}

/* The transform of columns that are real and imaginary parts, into those of each: both are symmetric. */
static void separate(const es_fft_columns_job* job, const float* z, size_t at)
{
    const uint32_t n = job->axis->length;
    for (uint32_t k = 0; k <= n / 2; k++) {
        const vc a = vc_load(z + LINE * (size_t)k), b = vc_conjugate(vc_load(z + LINE * (size_t)(k ? n - k : 0)));
        float* to = job->to + k * job->to_stride + at;
        vc_store(to, vc_scale(vc_add(a, b), 0.5f));
        vc_store(to + LINE, vc_scale(vc_times_minus_i(vc_sub(a, b)), 0.5f));
    }
}

/* The reverse. */
static void unite(const es_fft_columns_job* job, size_t at, float* z)
{
    const uint32_t n = job->axis->length;
    for (uint32_t k = 0; k <= n / 2; k++) {
        const float* from = job->from + k * job->from_stride + at;
        const vc a = vc_load(from), b = vc_times_minus_i(vc_load(from + LINE));
        vc_store(z + LINE * (size_t)k, vc_sub(a, b));
        if (k && 2 * k != n) vc_store(z + LINE * (size_t)(n - k), vc_conjugate(vc_add(a, b)));
    }
}

static void times_factors(const es_fft_columns_job* job, size_t at, float* z)
{
    for (uint32_t y = 0; y < job->axis->length; y++) {
        const vf a = y < job->from_rows ? vf_load(job->from + y * job->from_stride + at) : vf_zero();
        vc_store(z + LINE * (size_t)y, vc_of(a * vf_set1(job->factors[2 * y]), a * vf_set1(job->factors[2 * y + 1])));
    }
}

void ES_KERNEL(es_gi_fft_columns)(const es_fft_columns_job* job, uint32_t begin, uint32_t end, float* scratch)
{
    const uint32_t n = job->axis->length;
    float *nothing = scratch + 32 * (size_t)n, *dropped = nothing + LINE, *second = scratch + LINE * (size_t)n;
    memset(nothing, 0, LINE * sizeof(float));
    for (uint32_t strip = begin; strip < end; strip++) {
        const bool real = job->kind == ES_FFT_REAL, one = job->kind == ES_FFT_FACTORS;
        const size_t from_at = strip * (size_t)(one ? ES_FFT_BLOCK : real && job->inverse ? 2 * LINE : LINE), to_at = strip * (size_t)(real && !job->inverse ? 2 * LINE : LINE);
        if (job->dark && job->dark[strip]) {
            dark_strip(job, to_at, real && !job->inverse ? 2 * LINE : LINE);
            continue;
        }
        places from = {.from = job->from + from_at, .stride = job->from_stride, .count = job->from_rows, .swap = job->inverse, .spare = nothing};
        places to = {.to = job->to + to_at, .stride = job->to_stride, .count = job->to_rows, .swap = job->inverse, .spare = dropped};
        if (one || (real && job->inverse)) {
            if (one) times_factors(job, from_at, second);
            else unite(job, from_at, second);
            from.from = second;
            from.stride = LINE;
            from.count = n;
        }
        if (real && !job->inverse) {
            to.to = second;
            to.stride = LINE;
            to.count = n;
        }
        transform(job->axis, &from, scratch, &to);
        if (real && !job->inverse) separate(job, second, to_at);
    }
}

/* ---- rows ------------------------------------------------------------------------------------------------------------------------------- */

/* Where a row's blocks go. */
VINL void row_out(const es_fft_rows_job* job, uint32_t row, bool swap, uint32_t block, vc a, float* line)
{
    if (!job->power) {
        vc_store(line + LINE * (size_t)block, swap ? vc_swap(a) : a);
        return;
    }
    const uint32_t blocks = job->axis->length, moved = block < blocks / 2 ? block + blocks / 2 : block - blocks / 2;
    const vf power = vc_re(a) * vc_re(a) + vc_im(a) * vc_im(a);
    vf_store(job->power + ((row + job->height / 2) % job->height) * job->power_stride + ES_FFT_BLOCK * (size_t)moved, power);
}

/* The eight interleaved rows, transformed, become the transform of the whole. */
VINL void bring_together(const es_fft_rows_job* job, uint32_t row, bool swap, const float* z, float* line)
{
    const uint32_t m = job->axis->length;
    for (uint32_t k = 0; k < m; k += 8) {
        vc x[8];
        for (uint32_t i = 0; i < 8; i++) x[i] = vc_mul(vc_load(z + LINE * (size_t)(k + i)), job->axis->across + LINE * (size_t)(k + i));
        vc_transpose8(x);
        butterfly8(x);
        for (uint32_t q = 0; q < 8; q++) row_out(job, row, swap, (k + m * q) / 8, x[q], line);
    }
}

static void transform_row(const es_fft_rows_job* job, uint32_t row, bool inverse, const float* from, float* scratch, float* to)
{
    const uint32_t m = job->axis->length;
    float* z = scratch + LINE * (size_t)m;
    const places in = {.from = from, .stride = LINE, .count = m, .swap = inverse}, out = {.to = z, .stride = LINE, .count = m};
    transform(job->axis, &in, scratch, &out);
    bring_together(job, row, inverse, z, to);
}

/* Frequency (x, y) of a real picture is as strong as (-x, -y). */
static void mirror_row(const es_fft_rows_job* job, uint32_t row)
{
    const uint32_t height = job->height, width = job->axis->length * 8;
    if (row == 0 || 2 * row == height) return;
    const float* from = job->power + ((row + height / 2) % height) * job->power_stride;
    float* to = job->power + ((height - row + height / 2) % height) * job->power_stride;
    to[0] = from[0];
    for (uint32_t x = 1; x < width; x++) to[x] = from[width - x];
}

void ES_KERNEL(es_gi_fft_rows)(const es_fft_rows_job* job, uint32_t begin, uint32_t end, float* scratch)
{
    const uint32_t m = job->axis->length;
    float* line = scratch + 2 * LINE * (size_t)m;
    for (uint32_t row = begin; row < end; row++) {
        const float* from = job->from + row * job->stride;
        float* to = job->to ? job->to + row * job->stride : line;
        if (job->kind == ES_FFT_FACTORS) {
            for (uint32_t block = 0; block < m; block++) vc_store(line + LINE * (size_t)block, vc_mul(vc_load(from + LINE * (size_t)block), job->factors + LINE * (size_t)block));
            from = line;
        }
        if (job->kind != ES_FFT_PRODUCT) {
            transform_row(job, row, job->inverse, from, scratch, to);
            if (job->mirrored) mirror_row(job, row);
            continue;
        }
        transform_row(job, row, false, from, scratch, line);
        const float* product = job->product + row * job->stride;
        for (uint32_t block = 0; block < m; block++) vc_store(line + LINE * (size_t)block, vc_mul(vc_load(line + LINE * (size_t)block), product + LINE * (size_t)block));
        transform_row(job, row, true, line, scratch, to);
    }
}
