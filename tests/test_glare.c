/* What glare makes of pictures: convolution and billboards (gi/glare/convolution.h, gi/glare/billboards.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/glare/billboards.h"
#include "gi/glare/convolution.h"
#include "platform/context.h"
#include "platform/random.h"

static uint32_t counter;
static float uniform(void) { return es_unit_float(es_random_u32(41, counter++)); }

static es_context* context_of(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

/* Any numbers that sum to `sum` in each channel, most of it in the middle. */
static es_glare_spectrum spectrum_of(es_context* context, uint32_t reach_x, uint32_t reach_y, bool symmetric, double sum)
{
    const uint32_t columns = 2 * reach_x + 1, rows = 2 * reach_y + 1;
    es_glare_spectrum s = {.reach_x = reach_x, .reach_y = reach_y, .stride = (columns + 15) / 16 * 16};
    const size_t plane = s.stride * ((rows + 7) / 8 * 8);
    s.bytes = 3 * plane * sizeof(float);
    s.memory = es_allocate_zero(context, s.bytes);
    for (int k = 0; k < 3; k++) {
        s.at[k] = (float*)s.memory + k * plane;
        double total = 0;
        for (uint32_t y = 0; y < rows; y++)
            for (uint32_t x = 0; x < columns; x++) {
                float* p = &s.at[k][y * s.stride + x];
                const bool second = y > reach_y || (y == reach_y && x > reach_x);
                *p = symmetric && second ? s.at[k][(rows - 1 - y) * s.stride + columns - 1 - x] : uniform();
                if (x == reach_x && y == reach_y) *p = (float)(columns * rows);
                total += (double)*p;
            }
        for (size_t i = 0; i < plane; i++) s.at[k][i] = (float)((double)s.at[k][i] * sum / total);
    }
    return s;
}

typedef struct picture { uint32_t width, height, stride; float* at[3]; } picture;

static picture picture_of(uint32_t width, uint32_t height)
{
    picture p = {width, height, (width + 7) / 8 * 8, {NULL}};
    for (int k = 0; k < 3; k++) {
        p.at[k] = malloc((size_t)p.stride * height * sizeof(float));
        for (size_t i = 0; i < (size_t)p.stride * height; i++) p.at[k][i] = i % p.stride < width ? 0.0f : NAN; /* padding is no one's business */
    }
    return p;
}
static void drop(picture* p) { for (int k = 0; k < 3; k++) free(p->at[k]); }
static float* pixel(const picture* p, int k, uint32_t x, uint32_t y) { return &p->at[k][(size_t)y * p->stride + x]; }
static double sum_of(const picture* p, int k)
{
    double sum = 0;
    for (uint32_t y = 0; y < p->height; y++)
        for (uint32_t x = 0; x < p->width; x++) sum += (double)*pixel(p, k, x, y);
    return sum;
}

static void convolve(es_context* context, const es_glare_spectrum* s, const picture* from, const picture* to)
{
    es_glare_convolution c = {0};
    assert_int_equal(es_glare_convolution_take(context, s, from->width, from->height, &c), ES_OK);
    const float* const in[3] = {from->at[0], from->at[1], from->at[2]};
    es_glare_convolve(context, &c, in, to->at, from->stride);
    es_glare_convolution_free(context, &c);
}

/* Where light of (x, y) goes: by the spectrum, and what would leave stays. */
static void test_against_sums(void** state)
{
    (void)state;
    static const uint32_t sizes[][4] = {{1, 1, 0, 0}, {2, 1, 1, 0}, {1, 9, 0, 8}, {7, 5, 3, 4}, {37, 23, 5, 11}, {61, 17, 60, 16}, {100, 40, 2, 1}};
    es_context* context = context_of(2);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const uint32_t w = sizes[i][0], h = sizes[i][1], rx = sizes[i][2], ry = sizes[i][3];
        es_glare_spectrum s = spectrum_of(context, rx, ry, false, i % 2 ? 0.8 : 1);
        picture from = picture_of(w, h), to = picture_of(w, h);
        double* expected = calloc((size_t)w * h, sizeof *expected);
        for (int k = 0; k < 3; k++)
            for (uint32_t y = 0; y < h; y++)
                for (uint32_t x = 0; x < w; x++) *pixel(&from, k, x, y) = uniform() < 0.3f ? 0.0f : uniform();
        convolve(context, &s, &from, &to);
        for (int k = 0; k < 3; k++) {
            memset(expected, 0, (size_t)w * h * sizeof *expected);
            for (uint32_t y = 0; y < h; y++)
                for (uint32_t x = 0; x < w; x++) {
                    const double light = (double)*pixel(&from, k, x, y);
                    double left = light;
                    for (uint32_t v = 0; v < h; v++)
                        for (uint32_t u = 0; u < w; u++) {
                            const int64_t dx = (int64_t)u - x + rx, dy = (int64_t)v - y + ry;
                            if (dx < 0 || dy < 0 || dx > 2 * (int64_t)rx || dy > 2 * (int64_t)ry) continue;
                            const double part = light * (double)s.at[k][(size_t)dy * s.stride + (size_t)dx];
                            expected[v * w + u] += part;
                            left -= part;
                        }
                    expected[y * w + x] += left;
                }
            for (uint32_t y = 0; y < h; y++)
                for (uint32_t x = 0; x < w; x++)
                    if (!(fabs((double)*pixel(&to, k, x, y) - expected[y * w + x]) < 3e-6)) fail_msg("%u × %u, reach %u × %u, (%u, %u): %g instead of %g", w, h, rx, ry, x, y, (double)*pixel(&to, k, x, y), expected[y * w + x]);
            assert_true(fabs(sum_of(&to, k) / fmax(sum_of(&from, k), 1e-9) - 1) < 1e-6 || sum_of(&from, k) == 0);
        }
        free(expected);
        drop(&from);
        drop(&to);
        es_glare_spectrum_free(context, &s);
    }
    es_context_destroy(context);
}

/* Without light there is none; where all is bright all stays as it is; one pixel of 1e6 becomes the spectrum, and elsewhere next to nothing. */
static void test_extremes(void** state)
{
    (void)state;
    enum { W = 211, H = 150, R = 40 };
    es_context* context = context_of(2);
    es_glare_spectrum s = spectrum_of(context, R, R, true, 1);
    picture from = picture_of(W, H), to = picture_of(W, H);
    convolve(context, &s, &from, &to);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) assert_true(*pixel(&to, k, i % W, i / W) == 0.0f);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) *pixel(&from, k, i % W, i / W) = 1000;
    convolve(context, &s, &from, &to);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) assert_true(fabsf(*pixel(&to, k, i % W, i / W) - 1000) < 0.01f);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) *pixel(&from, k, i % W, i / W) = i == 70 * W + 100 ? 1e6f : 0;
    convolve(context, &s, &from, &to);
    double most = 0;
    for (int k = 0; k < 3; k++) {
        for (uint32_t i = 0; i < W * H; i++) {
            const int64_t dx = (int64_t)(i % W) - 100 + R, dy = (int64_t)(i / W) - 70 + R;
            const double expected = dx < 0 || dy < 0 || dx > 2 * R || dy > 2 * R ? 0 : 1e6 * (double)s.at[k][(size_t)dy * s.stride + (size_t)dx];
            most = fmax(most, fmax(0, fabs((double)*pixel(&to, k, i % W, i / W) - expected) - expected * 1e-6));
        }
        assert_true(fabs(sum_of(&to, k) / 1e6 - 1) < 1e-4); /* what rounding made negative is missing */
    }
    if (!(most < 1e-3)) fail_msg("a pixel of 1e6: off by %g", most);
    drop(&from);
    drop(&to);
    es_glare_spectrum_free(context, &s);
    es_context_destroy(context);
}

/* What is no number stays, and harms nothing else. */
static void test_no_numbers(void** state)
{
    (void)state;
    enum { W = 50, H = 30, R = 9 };
    es_context* context = context_of(2);
    es_glare_spectrum s = spectrum_of(context, R, R, false, 1);
    picture good = picture_of(W, H), bad = picture_of(W, H), expected = picture_of(W, H), to = picture_of(W, H), cheap = picture_of(W, H), cheap_expected = picture_of(W, H);
    static const float values[] = {0, INFINITY, -INFINITY, -5, -0.0f};
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) {
            *pixel(&good, k, i % W, i / W) = *pixel(&bad, k, i % W, i / W) = uniform();
            if (i % 97) continue;
            *pixel(&good, k, i % W, i / W) = 0;
            *pixel(&bad, k, i % W, i / W) = i / 97 % 6 == 5 ? NAN : values[i / 97 % 6];
        }
    convolve(context, &s, &good, &expected);
    convolve(context, &s, &bad, &to);
    es_glare_billboards b = {0};
    const float* const good_in[3] = {good.at[0], good.at[1], good.at[2]};
    const float* const bad_in[3] = {bad.at[0], bad.at[1], bad.at[2]};
    assert_int_equal(es_glare_add_billboards(context, &s, 0.1f, 3, good_in, cheap_expected.at, W, H, good.stride, &b), ES_OK);
    assert_int_equal(es_glare_add_billboards(context, &s, 0.1f, 3, bad_in, cheap.at, W, H, good.stride, &b), ES_OK);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) {
            const float was = *pixel(&bad, k, i % W, i / W), is = *pixel(&to, k, i % W, i / W), by_cheap = *pixel(&cheap, k, i % W, i / W);
            if (isnan(was)) assert_true(isnan(is) && isnan(by_cheap));
            else if (isinf(was)) assert_true(is == was && by_cheap == was);
            else {
                assert_true(is == *pixel(&expected, k, i % W, i / W));
                assert_true(by_cheap == *pixel(&cheap_expected, k, i % W, i / W));
            }
        }
    es_glare_billboards_free(context, &b);
    picture* all[] = {&good, &bad, &expected, &to, &cheap, &cheap_expected};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++) drop(all[i]);
    es_glare_spectrum_free(context, &s);
    es_context_destroy(context);
}

/* One bright pixel is one billboard, which is what convolution makes of it, near borders as well; of many every channel keeps its sum. */
static void test_billboards(void** state)
{
    (void)state;
    enum { W = 90, H = 70, R = 21 };
    es_context* context = context_of(2);
    es_glare_spectrum s = spectrum_of(context, R, R, false, 0.9);
    picture from = picture_of(W, H), to = picture_of(W, H), expected = picture_of(W, H);
    const float* const in[3] = {from.at[0], from.at[1], from.at[2]};
    es_glare_billboards b = {0};
    static const uint32_t places[][2] = {{45, 35}, {0, 0}, {89, 3}, {17, 69}};
    for (size_t i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k++) *pixel(&from, k, places[i][0], places[i][1]) = 10.0f + (float)k;
        convolve(context, &s, &from, &expected);
        assert_int_equal(es_glare_add_billboards(context, &s, 0, 5, in, to.at, W, H, from.stride, &b), ES_OK);
        assert_int_equal(b.count, 1);
        for (int k = 0; k < 3; k++) {
            for (uint32_t p = 0; p < W * H; p++) assert_true(fabsf(*pixel(&to, k, p % W, p / W) - *pixel(&expected, k, p % W, p / W)) < 2e-5f);
            *pixel(&from, k, places[i][0], places[i][1]) = 0;
        }
    }
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < W * H; i++) *pixel(&from, k, i % W, i / W) = uniform() + (es_random_u32(5, i) % 50 ? 0.0f : 100.0f);
    for (uint32_t most = 0; most < 40; most = most * 2 + 1) {
        assert_int_equal(es_glare_add_billboards(context, &s, 2, most, in, to.at, W, H, from.stride, &b), ES_OK);
        assert_int_equal(b.count, most < 30 ? most : 30); /* every tile has a bright one */
        for (int k = 0; k < 3; k++) assert_true(fabs(sum_of(&to, k) / sum_of(&from, k) - 1) < 1e-5);
        for (int k = 0; k < 3 && most == 0; k++) assert_true(memcmp(to.at[k], from.at[k], 8 * sizeof(float)) == 0);
    }
    /* a threshold that nothing reaches */
    assert_int_equal(es_glare_add_billboards(context, &s, 1e6f, 40, in, to.at, W, H, from.stride, &b), ES_OK);
    assert_int_equal(b.count, 0);
    es_glare_billboards_free(context, &b);
    drop(&from);
    drop(&to);
    drop(&expected);
    es_glare_spectrum_free(context, &s);
    es_context_destroy(context);
}

/* The same bits on every instruction set, for any number of threads, in place and not. */
static void test_bits(void** state)
{
    (void)state;
    enum { W = 133, H = 77, R = 30 };
    uint64_t expected[2] = {0};
    for (int i = 0; i < 2 * ES_ISA_COUNT; i++) {
        if (!(es_isa_available_mask() >> i / 2 & 1)) continue;
        es_context_desc desc = es_default_context_desc();
        desc.threads = i % 2 ? 3 : 1;
        desc.isa_mask = 1u << i / 2;
        es_context* context;
        assert_int_equal(es_context_create(&desc, &context), ES_OK);
        counter = 7;
        es_glare_spectrum s = spectrum_of(context, R, R / 2, false, 1);
        picture from = picture_of(W, H), to = picture_of(W, H);
        for (int k = 0; k < 3; k++)
            for (uint32_t p = 0; p < W * H; p++) *pixel(&from, k, p % W, p / W) = uniform() * (es_random_u32(5, p) % 50 ? 0.5f : 100.0f);
        const float* const in[3] = {from.at[0], from.at[1], from.at[2]};
        uint64_t hashes[2] = {0};
        es_glare_billboards b = {0};
        assert_int_equal(es_glare_add_billboards(context, &s, 1, 10, in, to.at, W, H, from.stride, &b), ES_OK);
        for (int k = 0; k < 3; k++)
            for (uint32_t y = 0; y < H; y++) hashes[0] = es_hash_bytes(hashes[0], pixel(&to, k, 0, y), W * sizeof(float));
        convolve(context, &s, &from, i % 2 ? &from : &to);
        for (int k = 0; k < 3; k++)
            for (uint32_t y = 0; y < H; y++) hashes[1] = es_hash_bytes(hashes[1], pixel(i % 2 ? &from : &to, k, 0, y), W * sizeof(float));
        if (i == 0) memcpy(expected, hashes, sizeof expected);
        assert_memory_equal(hashes, expected, sizeof expected);
        es_glare_billboards_free(context, &b);
        drop(&from);
        drop(&to);
        es_glare_spectrum_free(context, &s);
        es_context_destroy(context);
    }
}

static void drop_message(void* user, es_log_level level, es_result item, const char* message) { (void)user, (void)level, (void)item, (void)message; }

/* What does not fit fails and leaves nothing behind. */
static void test_refusals(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.memory_cap = (size_t)8 << 20;
    desc.logger.log = drop_message;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    es_glare_spectrum s = spectrum_of(context, 100, 100, false, 1);
    const size_t bytes = es_context_bytes(context);
    es_glare_convolution c = {0};
    assert_int_equal(es_glare_convolution_take(context, &s, 7680, 4320, &c), ES_MEMORY_CAP);
    assert_int_equal(es_context_bytes(context), bytes);
    assert_int_equal(es_glare_convolution_take(context, &s, 16300, 200, &c), ES_INVALID_ARGUMENT);
    assert_int_equal(es_glare_convolution_take(context, &s, 100, 200, &c), ES_INVALID_ARGUMENT); /* reaches further than the picture */
    assert_int_equal(es_context_bytes(context), bytes);
    es_glare_convolution_free(context, &c);
    es_glare_spectrum_free(context, &s);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_sums), cmocka_unit_test(test_extremes), cmocka_unit_test(test_no_numbers), cmocka_unit_test(test_billboards), cmocka_unit_test(test_bits), cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
