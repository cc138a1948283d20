#include "gi/fft.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/random.h"

/* ---- sizes ------------------------------------------------------------------------------------------------------------------------------ */

static bool is_good(uint32_t n)
{
    if (n == 0) return false;
    while (n % 2 == 0) n /= 2;
    while (n % 3 == 0) n /= 3;
    while (n % 5 == 0) n /= 5;
    return n == 1;
}

uint32_t es_fft_good_height(uint32_t at_least)
{
    uint32_t n = at_least ? at_least : 1;
    while (n <= ES_FFT_MAX_LENGTH && !is_good(n)) n++;
    return n <= ES_FFT_MAX_LENGTH ? n : 0;
}

uint32_t es_fft_good_width(uint32_t at_least)
{
    const uint32_t n = es_fft_good_height(at_least / 64 + (at_least % 64 != 0)); /* is_good of a multiple of 64 is that of its 64th */
    return n <= ES_FFT_MAX_LENGTH / 64 ? 64 * n : 0;
}

/* ---- tables ----------------------------------------------------------------------------------------------------------------------------- */

/* By Taylor's series for up to an eighth of a turn, where twelve terms are below the last bit of a double, and by symmetry for the rest. */
void es_fft_root(uint64_t part, uint64_t whole, double* cosine, double* sine)
{
    const uint64_t eighths = 8 * part / whole;
    uint64_t rest = 8 * part - eighths * whole; /* of an eighth, whole parts */
    if (eighths % 2) rest = whole - rest;
    const double x = 0.78539816339744830962 * ((double)rest / (double)whole), square = x * x;
    double c = 0, s = 0;
    for (int i = 20; i > 0; i -= 2) {
        c = (1.0 + c) * (-square / (double)(i * (i - 1)));
        s = (1.0 + s) * (-square / (double)(i * (i + 1)));
    }
    c = 1.0 + c;
    s = x * (1.0 + s);
    const bool swapped = (eighths + 1) / 2 % 2;
    const double major = swapped ? s : c, minor = swapped ? c : s;
    *cosine = eighths >= 2 && eighths < 6 ? -major : major;
    *sine = eighths >= 4 ? -minor : minor;
}

static void put_root(float* to, uint64_t part, uint64_t whole)
{
    double c, s;
    es_fft_root(part % whole, whole, &c, &s);
    to[0] = (float)c;
    to[1] = (float)-s;
}

/* As few passes as there can be: 8 as often as it goes, and of the rest 4 twice rather than 2 and 8. */
static void choose_passes(es_fft_axis* axis, uint32_t length)
{
    uint32_t twos = 0, rest = length;
    axis->length = length;
    for (; rest % 2 == 0; rest /= 2) twos++;
    for (; rest % 5 == 0; rest /= 5) axis->radix[axis->pass_count++] = 5;
    for (; rest % 3 == 0; rest /= 3) axis->radix[axis->pass_count++] = 3;
    const uint32_t fours = twos % 3 == 2 ? 1 : twos % 3 == 1 && twos >= 4 ? 2 : 0, two = twos == 1;
    for (uint32_t i = 0; i < (twos - 2 * fours - two) / 3; i++) axis->radix[axis->pass_count++] = 8;
    for (uint32_t i = 0; i < fours; i++) axis->radix[axis->pass_count++] = 4;
    if (two) axis->radix[axis->pass_count++] = 2;
}

static size_t twiddle_floats(const es_fft_axis* axis)
{
    size_t floats = 0;
    uint32_t length = axis->length;
    for (uint32_t pass = 0; pass + 1 < axis->pass_count; length /= axis->radix[pass++]) floats += 2 * (size_t)(length / axis->radix[pass]) * (axis->radix[pass] - 1);
    return (floats + 15) / 16 * 16;
}
static size_t order_count(const es_fft_axis* axis) { return axis->pass_count ? (axis->length / axis->radix[axis->pass_count - 1] + 15) / 16 * 16 : 0; }

static float* fill_axis(es_fft_axis* axis, float* to)
{
    float* begin = to;
    uint32_t length = axis->length;
    for (uint32_t pass = 0; pass + 1 < axis->pass_count; length /= axis->radix[pass++]) {
        const uint32_t radix = axis->radix[pass];
        axis->twiddles[pass] = to;
        for (uint32_t j = 0; j < length / radix; j++)
            for (uint32_t q = 1; q < radix; q++, to += 2) put_root(to, (uint64_t)j * q, length);
    }
    to = begin + twiddle_floats(axis);
    uint32_t* order = (uint32_t*)(void*)to;
    axis->order = order;
    /* the digits of a place, the first pass's being the highest, are those of its frequency, the first pass's being the lowest */
    for (uint32_t run = 0; axis->pass_count && run < axis->length / axis->radix[axis->pass_count - 1]; run++) {
        uint32_t frequency = 0, weight = 1, span = axis->length / axis->radix[axis->pass_count - 1];
        for (uint32_t pass = 0, rest = run; pass + 1 < axis->pass_count; pass++) {
            span /= axis->radix[pass];
            frequency += rest / span * weight;
            rest %= span;
            weight *= axis->radix[pass];
        }
        order[run] = frequency;
    }
    return to + order_count(axis);
}

es_result es_fft_create(es_context* context, uint32_t width, uint32_t height, es_fft* fft)
{
    *fft = (es_fft){.context = context, .width = width, .height = height};
    if (width > ES_FFT_MAX_LENGTH || width % 64 || !is_good(width) || height > ES_FFT_MAX_LENGTH || !is_good(height))
        return es_misuse(context, ES_INVALID_ARGUMENT, "a Fourier transform of %u × %u: products of 2, 3 and 5 up to %d are accepted, of the width multiples of 64", width, height, ES_FFT_MAX_LENGTH);
    choose_passes(&fft->column, height);
    choose_passes(&fft->row, width / 8);
    const size_t tables = twiddle_floats(&fft->column) + order_count(&fft->column) + twiddle_floats(&fft->row) + order_count(&fft->row) + 2 * (size_t)width;
    const size_t columns = es_fft_column_scratch(&fft->column), rows = es_fft_row_scratch(&fft->row), most = columns > rows ? columns : rows;
    fft->scratch_floats = (most + 15) / 16 * 16 + 16;
    fft->bytes = (tables + fft->scratch_floats * es_context_workers(context)) * sizeof(float);
    fft->memory = es_allocate(context, fft->bytes);
    if (!fft->memory) {
        *fft = (es_fft){0};
        return es_context_last_result(context);
    }
    float* at = fill_axis(&fft->column, fft->memory);
    at = fill_axis(&fft->row, at);
    fft->row.across = at;
    for (uint32_t k = 0; k < width / 8; k++, at += 16)
        for (uint32_t lane = 0; lane < 8; lane++) {
            float root[2];
            put_root(root, (uint64_t)k * lane, width);
            at[lane] = root[0];
            at[8 + lane] = root[1];
        }
    fft->scratch = at;
    return ES_OK;
}

void es_fft_free(es_fft* fft)
{
    if (fft->memory) es_release(fft->context, fft->memory, fft->bytes);
    *fft = (es_fft){0};
}

/* ---- loops ------------------------------------------------------------------------------------------------------------------------------ */

typedef struct fft_loop { const es_fft* fft; const es_gi_kernels* kernels; const es_fft_columns_job* columns; const es_fft_rows_job* rows; } fft_loop;

static void some_columns(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const fft_loop* loop = user;
    loop->kernels->fft_columns(loop->columns, begin, end, loop->fft->scratch + worker * loop->fft->scratch_floats);
}

static void some_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const fft_loop* loop = user;
    loop->kernels->fft_rows(loop->rows, begin, end, loop->fft->scratch + worker * loop->fft->scratch_floats);
}

static void run_columns(const es_fft* fft, const es_fft_columns_job* job, uint32_t strips)
{
    fft_loop loop = {.fft = fft, .kernels = es_gi_kernel_table(es_context_isa(fft->context)), .columns = job};
    es_parallel_for(fft->context, strips, 2, some_columns, &loop);
}

static void run_rows(const es_fft* fft, const es_fft_rows_job* job, uint32_t rows)
{
    fft_loop loop = {.fft = fft, .kernels = es_gi_kernel_table(es_context_isa(fft->context)), .rows = job};
    es_parallel_for(fft->context, rows, 8, some_rows, &loop);
}

void es_fft_complex(es_fft* fft, bool inverse, const float* from, float* to)
{
    const size_t stride = es_fft_stride(fft->width);
    const es_fft_columns_job columns = {.axis = &fft->column, .inverse = inverse, .from = from, .from_stride = stride, .from_rows = fft->height, .to = to, .to_stride = stride, .to_rows = fft->height};
    run_columns(fft, &columns, fft->width / 8);
    const es_fft_rows_job rows = {.axis = &fft->row, .inverse = inverse, .from = to, .to = to, .stride = stride};
    run_rows(fft, &rows, fft->height);
}

static void real_columns(es_fft* fft, const float* from, size_t from_stride, uint32_t rows, const uint8_t* dark, float* half)
{
    const es_fft_columns_job columns = {.axis = &fft->column, .kind = ES_FFT_REAL, .from = from, .from_stride = from_stride, .from_rows = rows, .dark = dark, .to = half, .to_stride = es_fft_stride(fft->width), .to_rows = fft->height / 2 + 1};
    run_columns(fft, &columns, fft->width / 16);
}

static void columns_to_real(es_fft* fft, const float* half, float* to, size_t to_stride, uint32_t rows)
{
    const es_fft_columns_job columns = {.axis = &fft->column, .kind = ES_FFT_REAL, .inverse = true, .from = half, .from_stride = es_fft_stride(fft->width), .from_rows = fft->height / 2 + 1, .to = to, .to_stride = to_stride, .to_rows = rows};
    run_columns(fft, &columns, fft->width / 16);
}

void es_fft_forward_real(es_fft* fft, const float* from, size_t stride, uint32_t rows, const uint8_t* dark, float* half)
{
    real_columns(fft, from, stride, rows, dark, half);
    const es_fft_rows_job job = {.axis = &fft->row, .from = half, .to = half, .stride = es_fft_stride(fft->width)};
    run_rows(fft, &job, fft->height / 2 + 1);
}

void es_fft_inverse_real(es_fft* fft, float* half, float* to, size_t stride, uint32_t rows)
{
    const es_fft_rows_job job = {.axis = &fft->row, .inverse = true, .from = half, .to = half, .stride = es_fft_stride(fft->width)};
    run_rows(fft, &job, fft->height / 2 + 1);
    columns_to_real(fft, half, to, stride, rows);
}

void es_fft_convolve(es_fft* fft, const float* from, size_t stride, uint32_t rows, const uint8_t* dark, const float* kernel, float* half, float* to, size_t to_stride, uint32_t to_rows)
{
    real_columns(fft, from, stride, rows, dark, half);
    const es_fft_rows_job job = {.axis = &fft->row, .kind = ES_FFT_PRODUCT, .from = half, .to = half, .stride = es_fft_stride(fft->width), .product = kernel};
    run_rows(fft, &job, fft->height / 2 + 1);
    columns_to_real(fft, half, to, to_stride, to_rows);
}

void es_fft_power(es_fft* fft, const float* from, size_t from_stride, const float* across, const float* down, float* room, float* power, size_t stride)
{
    es_fft_rows_job job = {.axis = &fft->row, .from = room, .stride = es_fft_stride(fft->width), .power = power, .power_stride = stride, .height = fft->height};
    if (!across) {
        real_columns(fft, from, from_stride, fft->height, NULL, room);
        job.mirrored = true;
        run_rows(fft, &job, fft->height / 2 + 1);
        return;
    }
    const es_fft_columns_job columns = {.axis = &fft->column, .kind = ES_FFT_FACTORS, .from = from, .from_stride = from_stride, .from_rows = fft->height, .factors = down, .to = room, .to_stride = es_fft_stride(fft->width), .to_rows = fft->height};
    run_columns(fft, &columns, fft->width / 8);
    job.kind = ES_FFT_FACTORS;
    job.factors = across;
    run_rows(fft, &job, fft->height);
}

/* ---- how long ---------------------------------------------------------------------------------------------------------------------------- */

es_result es_fft_measure(es_context* context, uint32_t width, uint32_t height, bool real, uint32_t times, double* milliseconds)
{
    enum { MOST = 64 };
    double sorted[MOST];
    if (times < 1 || times > MOST) return es_misuse(context, ES_INVALID_ARGUMENT, "a transform is to be measured %u times; 1 … %d are accepted", times, MOST);
    es_fft fft;
    const es_result result = es_fft_create(context, width, height, &fft);
    if (result) return result;
    const size_t floats = es_fft_stride(width) * height;
    float* from = es_allocate_array(context, floats, 2 * sizeof *from);
    if (!from) {
        es_fft_free(&fft);
        return es_context_last_result(context);
    }
    const es_fp_environment environment = es_fp_enter();
    for (size_t i = 0; i < floats; i++) from[i] = es_unit_float(es_random_u32(1, (uint32_t)i)) - 0.5f;
    for (uint32_t i = 0; i <= times; i++) { /* the first finds memory that nothing has touched */
        const double start = es_seconds();
        if (real) es_fft_forward_real(&fft, from, width, height, NULL, from + floats);
        else es_fft_complex(&fft, false, from, from + floats);
        const double time = (es_seconds() - start) * 1e3;
        uint32_t at = i ? i - 1 : 0;
        for (; at > 0 && sorted[at - 1] > time; at--) sorted[at] = sorted[at - 1];
        sorted[at] = time;
    }
    *milliseconds = times % 2 ? sorted[times / 2] : (sorted[times / 2 - 1] + sorted[times / 2]) / 2;
    es_fp_leave(environment);
    es_release(context, from, floats * 2 * sizeof *from);
    es_fft_free(&fft);
    return ES_OK;
}
