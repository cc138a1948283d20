/* Fourier transforms of pictures (gi/fft.h) against sums in double precision, and by what they must keep. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/fft.h"
#include "platform/context.h"
#include "platform/random.h"

#define PI 3.14159265358979323846

static uint32_t counter;
static float uniform(void) { return es_unit_float(es_random_u32(31, counter++)) - 0.5f; }

static es_context* context_of(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

typedef struct complex_picture { uint32_t width, height; size_t stride; float* at; size_t bytes; es_context* context; } complex_picture;

static complex_picture make(es_context* context, uint32_t width, uint32_t height)
{
    complex_picture p = {width, height, es_fft_stride(width), NULL, es_fft_stride(width) * height * sizeof(float), context};
    p.at = es_allocate_zero(context, p.bytes);
    assert_non_null(p.at);
    return p;
}
static void drop(complex_picture* p) { es_release(p->context, p->at, p->bytes); }
static float* part(const complex_picture* p, uint32_t x, uint32_t y) { return p->at + y * p->stride + es_fft_at(x); }
static double re(const complex_picture* p, uint32_t x, uint32_t y) { return (double)part(p, x, y)[0]; }
static double im(const complex_picture* p, uint32_t x, uint32_t y) { return (double)part(p, x, y)[ES_FFT_BLOCK]; }

static void fill(complex_picture* p)
{
    for (uint32_t y = 0; y < p->height; y++)
        for (uint32_t x = 0; x < p->width; x++) {
            part(p, x, y)[0] = uniform();
            part(p, x, y)[ES_FFT_BLOCK] = uniform();
        }
}

/* cos and sin of sign 2 pi k / n */
static double* circle(uint32_t n, int sign)
{
    double* table = malloc(2 * (size_t)n * sizeof *table);
    for (uint32_t k = 0; k < n; k++) {
        const double a = sign * 2 * PI * (double)k / n;
        table[2 * k] = cos(a);
        table[2 * k + 1] = sin(a);
    }
    return table;
}

/* by sums over rows, then columns, in double */
static double* slow_transform(const complex_picture* p, int sign)
{
    const uint32_t w = p->width, h = p->height;
    double* middle = malloc((size_t)w * h * 2 * sizeof *middle);
    double* result = malloc((size_t)w * h * 2 * sizeof *result);
    double *along = circle(w, sign), *down = circle(h, sign);
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t k = 0; k < w; k++) {
            double sum_re = 0, sum_im = 0;
            for (uint32_t x = 0, at = 0; x < w; x++, at = at + k >= w ? at + k - w : at + k) {
                const double c = along[2 * at], s = along[2 * at + 1];
                sum_re += re(p, x, y) * c - im(p, x, y) * s;
                sum_im += re(p, x, y) * s + im(p, x, y) * c;
            }
            middle[2 * ((size_t)y * w + k)] = sum_re;
            middle[2 * ((size_t)y * w + k) + 1] = sum_im;
        }
    for (uint32_t k = 0; k < h; k++)
        for (uint32_t x = 0; x < w; x++) {
            double sum_re = 0, sum_im = 0;
            for (uint32_t y = 0, at = 0; y < h; y++, at = at + k >= h ? at + k - h : at + k) {
                const double c = down[2 * at], s = down[2 * at + 1];
                const double* m = middle + 2 * ((size_t)y * w + x);
                sum_re += m[0] * c - m[1] * s;
                sum_im += m[0] * s + m[1] * c;
            }
            result[2 * ((size_t)k * w + x)] = sum_re;
            result[2 * ((size_t)k * w + x) + 1] = sum_im;
        }
    free(middle);
    free(along);
    free(down);
    return result;
}

/* relative, root of the mean square; `rows` of them */
static double error_of(const complex_picture* got, const double* expected, uint32_t rows)
{
    double error = 0, size = 0;
    for (uint32_t y = 0; y < rows; y++)
        for (uint32_t x = 0; x < got->width; x++) {
            const double* e = expected + 2 * ((size_t)y * got->width + x);
            const double a = re(got, x, y) - e[0], b = im(got, x, y) - e[1];
            error += a * a + b * b;
            size += e[0] * e[0] + e[1] * e[1];
        }
    return sqrt(error / size);
}

static void test_roots(void** state)
{
    (void)state;
    for (uint64_t whole = 1; whole < 3000; whole += 1 + whole / 7)
        for (uint64_t k = 0; k < whole; k++) {
            double c, s;
            es_fft_root(k, whole, &c, &s);
            assert_true(fabs(c - (double)cosl(6.283185307179586476925L * (long double)k / (long double)whole)) < 1e-15);
            assert_true(fabs(s - (double)sinl(6.283185307179586476925L * (long double)k / (long double)whole)) < 1e-15);
        }
}

static void test_good_sizes(void** state)
{
    (void)state;
    assert_int_equal(es_fft_good_height(0), 1);
    assert_int_equal(es_fft_good_height(1), 1);
    assert_int_equal(es_fft_good_height(7), 8);
    assert_int_equal(es_fft_good_height(883), 900);
    assert_int_equal(es_fft_good_height(16384), 16384);
    assert_int_equal(es_fft_good_height(16385), 0);
    assert_int_equal(es_fft_good_width(0), 64);
    assert_int_equal(es_fft_good_width(64), 64);
    assert_int_equal(es_fft_good_width(65), 128);
    assert_int_equal(es_fft_good_width(1140), 1152);
    assert_int_equal(es_fft_good_width(16385), 0);
    assert_int_equal(es_fft_good_width(UINT32_MAX), 0);
    es_context* context = context_of(1);
    es_fft fft;
    assert_int_equal(es_fft_create(context, 128, 1, &fft), ES_OK);
    es_fft_free(&fft);
    es_fft_free(&fft);
    es_context_destroy(context);
}

/* Every radix, alone and with others, in both dimensions and both directions. */
static void test_against_sums(void** state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{64, 1}, {64, 2}, {64, 3}, {64, 4}, {64, 5}, {64, 6}, {64, 8}, {128, 9}, {64, 10}, {192, 16}, {320, 25}, {256, 32}, {64, 27}, {384, 30}, {128, 64}, {64, 125}, {576, 60}, {640, 36}, {960, 90}, {1024, 45}};
    es_context* context = context_of(2);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        es_fft fft;
        assert_int_equal(es_fft_create(context, sizes[i][0], sizes[i][1], &fft), ES_OK);
        complex_picture from = make(context, sizes[i][0], sizes[i][1]), to = make(context, sizes[i][0], sizes[i][1]);
        fill(&from);
        for (int inverse = 0; inverse < 2; inverse++) {
            double* expected = slow_transform(&from, inverse ? 1 : -1);
            es_fft_complex(&fft, inverse, from.at, to.at);
            const double error = error_of(&to, expected, to.height);
            if (!(error < 2e-7)) fail_msg("%u × %u, inverse %d: error %g", sizes[i][0], sizes[i][1], inverse, error);
            free(expected);
        }
        memcpy(to.at, from.at, from.bytes); /* in place */
        es_fft_complex(&fft, false, to.at, to.at);
        es_fft_complex(&fft, true, to.at, to.at);
        double most = 0;
        for (uint32_t y = 0; y < from.height; y++)
            for (uint32_t x = 0; x < from.width; x++) {
                const double n = (double)from.width * from.height;
                most = fmax(most, fabs(re(&to, x, y) / n - re(&from, x, y)));
                most = fmax(most, fabs(im(&to, x, y) / n - im(&from, x, y)));
            }
        assert_true(most < 1e-6);
        drop(&from);
        drop(&to);
        es_fft_free(&fft);
    }
    es_context_destroy(context);
}

static void test_real(void** state)
{
    (void)state;
    static const uint32_t sizes[][3] = {{64, 1, 1}, {64, 2, 1}, {64, 5, 5}, {128, 9, 7}, {192, 16, 16}, {320, 25, 3}, {256, 60, 41}};
    es_context* context = context_of(2);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const uint32_t w = sizes[i][0], h = sizes[i][1], rows = sizes[i][2];
        es_fft fft;
        assert_int_equal(es_fft_create(context, w, h, &fft), ES_OK);
        complex_picture whole = make(context, w, h), half = make(context, w, h / 2 + 1);
        float* plane = calloc((size_t)w * rows, sizeof *plane);
        float* back = calloc((size_t)w * rows, sizeof *back);
        uint8_t* dark = calloc(w / 16, 1);
        for (uint32_t strip = 0; strip < w / 16; strip++) dark[strip] = strip % 3 == 1;
        for (uint32_t y = 0; y < rows; y++)
            for (uint32_t x = 0; x < w; x++)
                if (!dark[x / 16]) part(&whole, x, y)[0] = plane[(size_t)y * w + x] = uniform();
        double* expected = slow_transform(&whole, -1);
        for (int skip = 0; skip < 2; skip++) {
            memset(half.at, 0xff, half.bytes);
            es_fft_forward_real(&fft, plane, w, rows, skip ? dark : NULL, half.at);
            const double error = error_of(&half, expected, h / 2 + 1);
            if (!(error < 2e-7)) fail_msg("%u × %u, %u rows: error %g", w, h, rows, error);
        }
        es_fft_inverse_real(&fft, half.at, back, w, rows);
        for (size_t k = 0; k < (size_t)w * rows; k++) assert_true(fabs((double)back[k] / ((double)w * h) - (double)plane[k]) < 1e-6);

        /* its power, whole from half of it, and by factors of one */
        if (rows == h) {
            float* power[2] = {malloc((size_t)w * h * sizeof(float)), malloc((size_t)w * h * sizeof(float))};
            float* across = malloc((size_t)w * 2 * sizeof *across);
            float* down = malloc((size_t)h * 2 * sizeof *down);
            for (uint32_t k = 0; k < w; k++) across[es_fft_at(k)] = 1, across[es_fft_at(k) + ES_FFT_BLOCK] = 0;
            for (uint32_t k = 0; k < h; k++) down[2 * k] = 0, down[2 * k + 1] = 1;
            es_fft_power(&fft, plane, w, NULL, NULL, half.at, power[0], w);
            es_fft_power(&fft, plane, w, across, down, whole.at, power[1], w);
            double energy = 0, sum = 0;
            for (uint32_t y = 0; y < h; y++)
                for (uint32_t x = 0; x < w; x++) {
                    const double* e = expected + 2 * ((size_t)((y + h - h / 2) % h) * w + (x + w / 2) % w);
                    const double p = e[0] * e[0] + e[1] * e[1];
                    sum += p;
                    for (int k = 0; k < 2; k++) assert_true(fabs((double)power[k][(size_t)y * w + x] - p) < 1e-6 * w * h);
                }
            for (size_t k = 0; k < (size_t)w * rows; k++) energy += (double)plane[k] * (double)plane[k];
            assert_true(fabs(sum / (energy * w * h) - 1) < 1e-12); /* the sums in double are sound, and so is Parseval of them */
            double own = 0;
            for (size_t k = 0; k < (size_t)w * h; k++) own += (double)power[0][k];
            assert_true(fabs(own / (energy * w * h) - 1) < 1e-6);
            free(power[0]);
            free(power[1]);
            free(across);
            free(down);
        }
        free(expected);
        free(plane);
        free(back);
        free(dark);
        drop(&whole);
        drop(&half);
        es_fft_free(&fft);
    }
    es_context_destroy(context);
}

/* A convolution is what it says, around the borders too. */
static void test_convolution(void** state)
{
    (void)state;
    enum { W = 64, H = 18, ROWS = 11 };
    es_context* context = context_of(2);
    es_fft fft;
    assert_int_equal(es_fft_create(context, W, H, &fft), ES_OK);
    complex_picture kernel = make(context, W, H / 2 + 1), half = make(context, W, H / 2 + 1);
    static float plane[ROWS][W], other[H][W], got[H][W];
    for (uint32_t i = 0; i < ROWS * W; i++) plane[i / W][i % W] = uniform();
    for (uint32_t i = 0; i < H * W; i++) other[i / W][i % W] = uniform();
    es_fft_forward_real(&fft, other[0], W, H, NULL, kernel.at);
    es_fft_convolve(&fft, plane[0], W, ROWS, NULL, kernel.at, half.at, got[0], W, H);
    for (uint32_t y = 0; y < H; y++)
        for (uint32_t x = 0; x < W; x++) {
            double sum = 0;
            for (uint32_t v = 0; v < ROWS; v++)
                for (uint32_t u = 0; u < W; u++) sum += (double)plane[v][u] * (double)other[(y + H - v) % H][(x + W - u) % W];
            assert_true(fabs((double)got[y][x] / (W * H) - sum) < 1e-5);
        }
    drop(&kernel);
    drop(&half);
    es_fft_free(&fft);
    es_context_destroy(context);
}

/* At sizes of real pictures: Parseval, linearity, and that a shift turns phases alone. */
static void test_laws(void** state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{256, 256}, {1024, 1024}, {1152, 900}};
    es_context* context = context_of(2);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const uint32_t w = sizes[i][0], h = sizes[i][1];
        es_fft fft;
        assert_int_equal(es_fft_create(context, w, h, &fft), ES_OK);
        complex_picture a = make(context, w, h), b = make(context, w, h), c = make(context, w, h);
        fill(&a);
        fill(&b);
        for (uint32_t y = 0; y < h; y++)
            for (uint32_t x = 0; x < w; x++)
                for (uint32_t k = 0; k < 2; k++) part(&c, x, y)[ES_FFT_BLOCK * k] = part(&a, x, y)[ES_FFT_BLOCK * k] - 2 * part(&b, (x + w - 5) % w, (y + h - 3) % h)[ES_FFT_BLOCK * k];
        double energy = 0, sum = 0, error = 0, size = 0;
        for (uint32_t y = 0; y < h; y++)
            for (uint32_t x = 0; x < w; x++) energy += re(&a, x, y) * re(&a, x, y) + im(&a, x, y) * im(&a, x, y);
        es_fft_complex(&fft, false, a.at, a.at);
        es_fft_complex(&fft, false, b.at, b.at);
        es_fft_complex(&fft, false, c.at, c.at);
        for (uint32_t y = 0; y < h; y++)
            for (uint32_t x = 0; x < w; x++) {
                sum += re(&a, x, y) * re(&a, x, y) + im(&a, x, y) * im(&a, x, y);
                const double angle = -2 * PI * (5.0 * x / w + 3.0 * y / h), co = cos(angle), si = sin(angle);
                const double p = re(&a, x, y) - 2 * (re(&b, x, y) * co - im(&b, x, y) * si), q = im(&a, x, y) - 2 * (re(&b, x, y) * si + im(&b, x, y) * co);
                error += (re(&c, x, y) - p) * (re(&c, x, y) - p) + (im(&c, x, y) - q) * (im(&c, x, y) - q);
                size += p * p + q * q;
            }
        if (!(fabs(sum / (energy * w * h) - 1) < 1e-6)) fail_msg("%u × %u: Parseval %g", w, h, sum / (energy * w * h) - 1);
        if (!(sqrt(error / size) < 4e-7)) fail_msg("%u × %u: linearity and shift %g", w, h, sqrt(error / size));
        drop(&a);
        drop(&b);
        drop(&c);
        es_fft_free(&fft);
    }
    es_context_destroy(context);
}

static void test_threads(void** state)
{
    (void)state;
    enum { W = 576, H = 150 };
    complex_picture pictures[2];
    es_context* contexts[2];
    for (uint32_t i = 0; i < 2; i++) {
        contexts[i] = context_of(i ? 3 : 1);
        es_fft fft;
        assert_int_equal(es_fft_create(contexts[i], W, H, &fft), ES_OK);
        pictures[i] = make(contexts[i], W, H);
        counter = 0;
        fill(&pictures[i]);
        es_fft_complex(&fft, false, pictures[i].at, pictures[i].at);
        es_fft_free(&fft);
    }
    assert_memory_equal(pictures[0].at, pictures[1].at, pictures[0].bytes);
    for (int i = 0; i < 2; i++) {
        drop(&pictures[i]);
        es_context_destroy(contexts[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_roots), cmocka_unit_test(test_good_sizes), cmocka_unit_test(test_against_sums), cmocka_unit_test(test_real), cmocka_unit_test(test_convolution), cmocka_unit_test(test_laws), cmocka_unit_test(test_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
