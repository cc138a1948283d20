/* Measures of error: values worked out by hand, independent ones of FLIP, and what must hold for any pictures. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "gi/gi.h"
#include "platform/random.h"

static void ignore(void* user, es_log_level level, es_result item, const char* message)
{
    (void)user, (void)level, (void)item, (void)message;
}

static es_context* open_context(uint32_t threads, uint32_t isa_mask)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    desc.logger = (es_logger){ignore, NULL};
    es_context* context = NULL;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static int setup(void** state)
{
    *state = open_context(1, 0);
    return 0;
}

static int teardown(void** state)
{
    es_context* context = *state;
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
    return 0;
}

static es_image make(es_context* context, uint32_t width, uint32_t height, uint32_t channels, const float* values)
{
    es_image image;
    assert_int_equal(es_image_create(context, width, height, channels, &image), ES_OK);
    if (values) memcpy(image.pixels, values, (size_t)width * height * channels * sizeof(float));
    return image;
}

static es_image noise(es_context* context, uint32_t width, uint32_t height, uint32_t seed, float from, float to)
{
    es_image image = make(context, width, height, 3, NULL);
    for (uint32_t i = 0; i < width * height * 3; i++) image.pixels[i] = from + (to - from) * es_random_float(seed, i);
    return image;
}

static const es_error_desc plain = {0};

static es_image_error compared(es_context* context, const es_image* a, const es_image* b, const es_error_desc* desc)
{
    es_image_error error;
    assert_int_equal(es_image_compare(context, a, b, desc, &error), ES_OK);
    return error;
}

static void near(double value, double expected, double relative)
{
    if (!(fabs(value - expected) <= relative * fabs(expected))) fail_msg("%.17g instead of %.17g", value, expected);
}

/* ---- plain measures ----------------------------------------------------------------------------------------------------------------- */

/* d = 1, 0, -2, 3: squares 14, sizes 6; B = 1, 2, 3, 4: mean 2.5 */
static void test_by_hand(void** state)
{
    es_image a = make(*state, 2, 2, 1, (float[]){2, 2, 1, 7}), b = make(*state, 2, 2, 1, (float[]){1, 2, 3, 4});
    es_image_error e = compared(*state, &a, &b, &plain);
    near(e.rmse, sqrt(3.5), 1e-15);
    near(e.relrmse, sqrt(3.5) / 2.5, 1e-15);
    near(e.relmse, (1 / 1.01 + 4 / 9.01 + 9 / 16.01) / 4, 1e-15);
    near(e.rell1, 1.5 / 2.5, 1e-15);
    assert_true(e.max == 3 && e.mean == 3 && e.reference_mean == 2.5 && e.samples == 4);
    assert_true(isnan(e.flip) && isnan(e.hdr_flip));
    es_image_error half = compared(*state, &a, &b, &(es_error_desc){.mask = (uint8_t[]){1, 1, 1, 0}});
    near(half.rmse, sqrt(5.0 / 3), 1e-15);
    assert_true(half.samples == 3 && half.reference_mean == 2 && half.max == 2);
    es_image_error none = compared(*state, &a, &b, &(es_error_desc){.mask = (uint8_t[]){0, 0, 0, 0}});
    assert_true(none.samples == 0 && none.rmse == 0 && none.relrmse == 0 && none.max == 0);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
}

/* What is not finite is as wrong as can be, unless both pictures have it. */
static void test_not_finite(void** state)
{
    static const struct { float a, b; bool same; } pairs[] = {{NAN, NAN, true}, {-NAN, NAN, true}, {INFINITY, INFINITY, true}, {-INFINITY, -INFINITY, true},
        {NAN, 1, false}, {1, NAN, false}, {INFINITY, 1, false}, {1, INFINITY, false}, {INFINITY, -INFINITY, false}, {NAN, INFINITY, false}};
    for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; i++) {
        es_image a = make(*state, 2, 1, 1, (float[]){pairs[i].a, 3}), b = make(*state, 2, 1, 1, (float[]){pairs[i].b, 2}), map;
        es_image_error e = compared(*state, &a, &b, &plain);
        assert_true(pairs[i].same ? e.max == 1 && e.rmse == sqrt(0.5) : isinf(e.max) && isinf(e.rmse) && isinf(e.relmse) && isinf(e.rell1) && isinf(e.relrmse));
        assert_true(isfinite(e.mean) && isfinite(e.reference_mean));
        for (int m = ES_ERROR_MAP_ABSOLUTE; m <= ES_ERROR_MAP_SIGNED; m++) {
            assert_int_equal(es_image_error_map(*state, &a, &b, (es_error_map)m, NULL, &map), ES_OK);
            assert_true(pairs[i].same ? map.pixels[0] == 0 : isinf(map.pixels[0]));
            assert_true(isfinite(map.pixels[1]));
            es_image_destroy(*state, &map);
        }
        es_image_destroy(*state, &a);
        es_image_destroy(*state, &b);
    }
}

/* The error of a sum of 3e5 terms must not be seen: each row adds ten million and a small rest. */
static void test_sums_lose_nothing(void** state)
{
    es_image a = make(*state, 1000, 100, 1, NULL), b = make(*state, 1000, 100, 1, NULL);
    for (int i = 0; i < 100000; i++) a.pixels[i] = i % 1000 == 0 ? 0x1p30f : 0x1p-10f;
    es_image_error e = compared(*state, &a, &b, &plain);
    assert_true(e.rmse == sqrt((0x1p60 * 100 + 0x1p-20 * 99900) / 100000));
    assert_true(e.mean == (0x1p30 * 100 + 0x1p-10 * 99900) / 100000);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
}

static void test_properties(void** state)
{
    es_image a = noise(*state, 33, 17, 1, 0, 4), b = noise(*state, 33, 17, 2, 0, 4), c = make(*state, 33, 17, 3, NULL);
    es_image_error same = compared(*state, &a, &a, &plain), ab = compared(*state, &a, &b, &plain), ba = compared(*state, &b, &a, &plain);
    assert_true(same.rmse == 0 && same.relrmse == 0 && same.relmse == 0 && same.rell1 == 0 && same.max == 0);
    assert_true(ab.rmse == ba.rmse && ab.max == ba.max && ab.mean == ba.reference_mean);
    near(ab.rell1 * ab.reference_mean, ba.rell1 * ba.reference_mean, 1e-15);
    double last = 0;
    for (int k = 1; k <= 8; k++) { /* from b towards a */
        for (int i = 0; i < 33 * 17 * 3; i++) c.pixels[i] = b.pixels[i] + (a.pixels[i] - b.pixels[i]) * (float)k * 0.125f;
        es_image_error e = compared(*state, &c, &b, &plain);
        near(e.rmse, ab.rmse * k / 8, 1e-6);
        near(e.relmse, ab.relmse * k * k / 64, 1e-6);
        near(e.rell1, ab.rell1 * k / 8, 1e-6);
        assert_true(e.rmse > last);
        last = e.rmse;
    }
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
    es_image_destroy(*state, &c);
}

/* ---- which channels ----------------------------------------------------------------------------------------------------------------- */

static void test_channels(void** state)
{
    es_image a = make(*state, 1, 1, 4, (float[]){1, 2, 3, 9}), b = make(*state, 1, 1, 3, (float[]){5, 2, 1});
    strcpy(b.channel_names[0], "B");
    strcpy(b.channel_names[2], "R");
    es_image_error e = compared(*state, &a, &b, &plain);
    assert_true(e.samples == 3 && e.max == 2 && e.rmse == sqrt(4.0 / 3)); /* by name, alpha left out */
    for (int k = 0; k < 3; k++) sprintf(b.channel_names[k], "x%d", k);
    es_image_error error;
    assert_int_equal(es_image_compare(*state, &a, &b, &plain, &error), ES_INVALID_ARGUMENT);
    es_image c = make(*state, 1, 1, 3, (float[]){5, 2, 2});
    assert_true(compared(*state, &c, &b, &plain).max == 1); /* by position */
    strcpy(b.channel_names[1], "A");
    es_image_error alpha = compared(*state, &a, &b, &plain);
    assert_true(alpha.samples == 1 && alpha.max == 7); /* there is nothing else */
    es_image wide = make(*state, 2, 1, 4, NULL);
    assert_int_equal(es_image_compare(*state, &wide, &a, &plain, &error), ES_INVALID_ARGUMENT);
    assert_non_null(strstr(es_context_message(*state), "2 x 1"));
    assert_int_equal(es_image_compare(*state, &a, &(es_image){0}, &plain, &error), ES_INVALID_ARGUMENT);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
    es_image_destroy(*state, &c);
    es_image_destroy(*state, &wide);
}

/* ---- maps and colours --------------------------------------------------------------------------------------------------------------- */

/* A map's mean is the measure. */
static void test_maps(void** state)
{
    es_image a = noise(*state, 21, 13, 3, 0, 2), b = noise(*state, 21, 13, 4, 0, 2), map;
    es_image_error e = compared(*state, &a, &b, &plain);
    double expected[3] = {e.rell1 * e.reference_mean, e.relmse, e.mean - e.reference_mean};
    for (int m = 0; m < 3; m++) {
        assert_int_equal(es_image_error_map(*state, &a, &b, (es_error_map)m, NULL, &map), ES_OK);
        assert_true(map.width == 21 && map.height == 13 && map.channels == 1);
        double sum = 0;
        for (int i = 0; i < 21 * 13; i++) sum += (double)map.pixels[i];
        near(sum / (21 * 13), expected[m], 1e-5);
        es_image_destroy(*state, &map);
    }
    uint8_t mask[21 * 13] = {[5] = 1};
    assert_int_equal(es_image_error_map(*state, &a, &b, ES_ERROR_MAP_ABSOLUTE, &(es_error_desc){.mask = mask}, &map), ES_OK);
    for (int i = 0; i < 21 * 13; i++) assert_true((map.pixels[i] > 0) == (i == 5));
    es_image_destroy(*state, &map);
    assert_int_equal(es_image_error_map(*state, &a, &b, (es_error_map)99, NULL, &map), ES_INVALID_ARGUMENT);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
}

static double lightness(const float* srgb)
{
    double linear[3];
    for (int c = 0; c < 3; c++) linear[c] = srgb[c] <= 0.04045f ? (double)srgb[c] / 12.92 : pow(((double)srgb[c] + 0.055) / 1.055, 2.4);
    double y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
    return y > 216.0 / 24389 ? 116 * cbrt(y) - 16 : y * 24389 / 27;
}

static void test_false_colour(void** state)
{
    enum { N = 201 };
    es_image values = make(*state, N, 1, 1, NULL), rgb, other;
    for (int i = 0; i < N; i++) values.pixels[i] = (float)(i - 100) * 0.05f; /* -5 … 5 */
    assert_int_equal(es_image_false_colour(*state, &values, 4, false, &rgb), ES_OK);
    assert_int_equal(rgb.channels, 3);
    for (int i = 1; i < N; i++) { /* flat outside of 0 … 4, rising in between, evenly */
        double step = lightness(rgb.pixels + 3 * i) - lightness(rgb.pixels + 3 * i - 3);
        bool inside = i > 100 && i <= 180;
        assert_true(inside ? step > 0.3 && step < 2.5 : fabs(step) < 1e-4);
    }
    assert_true(lightness(rgb.pixels) < 1 && lightness(rgb.pixels + 3 * (N - 1)) > 95);
    es_image_destroy(*state, &rgb);
    assert_int_equal(es_image_false_colour(*state, &values, 4, true, &rgb), ES_OK);
    for (int i = 0; i < 100; i++) { /* below is as light as above, blue and not red */
        const float *below = rgb.pixels + 3 * i, *above = rgb.pixels + 3 * (N - 1 - i);
        assert_true(fabs(lightness(below) - lightness(above)) < 2.5);
        assert_true(below[2] > below[0] && above[0] > above[2]);
    }
    es_image_destroy(*state, &rgb);
    values.pixels[0] = NAN;
    values.pixels[1] = INFINITY;
    values.pixels[2] = -INFINITY;
    assert_int_equal(es_image_false_colour(*state, &values, 4, false, &rgb), ES_OK);
    assert_true(rgb.pixels[0] == 0 && rgb.pixels[1] == 1 && rgb.pixels[2] == 0);
    assert_memory_equal(rgb.pixels + 3, rgb.pixels + 3 * (N - 1), 3 * sizeof(float));
    assert_true(lightness(rgb.pixels + 6) < 1);
    assert_int_equal(es_image_false_colour(*state, &values, 0, false, &other), ES_INVALID_ARGUMENT);
    assert_int_equal(es_image_false_colour(*state, &values, NAN, false, &other), ES_INVALID_ARGUMENT);
    assert_int_equal(es_image_false_colour(*state, &rgb, 1, false, &other), ES_INVALID_ARGUMENT);
    es_image_destroy(*state, &rgb);
    es_image_destroy(*state, &values);
}

/* ---- sequences ---------------------------------------------------------------------------------------------------------------------- */

/* B: 1, 2, 4 everywhere. A: 2, 3, 7: changes by 1 and 4 where B's are 1 and 2. Mean of B 7/3. */
static void test_flicker_by_hand(void** state)
{
    es_flicker* flicker;
    assert_int_equal(es_flicker_create(*state, &flicker), ES_OK);
    static const float frames[3][2] = {{2, 1}, {3, 2}, {7, 4}};
    for (int t = 0; t < 3; t++) {
        es_image a = make(*state, 4, 3, 1, NULL), b = make(*state, 4, 3, 1, NULL);
        for (int i = 0; i < 12; i++) a.pixels[i] = frames[t][0], b.pixels[i] = frames[t][1];
        if (t < 2) assert_true(t == 0 || isnan(es_flicker_result(flicker).flicker));
        assert_int_equal(es_flicker_add(flicker, &a, &b), ES_OK);
        es_image_destroy(*state, &a);
        es_image_destroy(*state, &b);
    }
    es_flicker_error e = es_flicker_result(flicker);
    near(e.flicker, sqrt((0.0 + 4) / 2) / (7.0 / 3), 1e-15);
    near(e.worst, 2 / (7.0 / 3), 1e-15);
    near(e.change, sqrt((1.0 + 4) / 2) / (7.0 / 3), 1e-15);
    assert_true(e.worst_frame == 2 && e.frames == 3);
    es_image other = make(*state, 3, 4, 1, NULL);
    assert_int_equal(es_flicker_add(flicker, &other, &other), ES_INVALID_ARGUMENT);
    es_image_destroy(*state, &other);
    assert_true(es_flicker_result(flicker).frames == 3);
    es_flicker_destroy(flicker);
}

/* What is wrong in the same way in every frame does not flicker; noise of deviation s that is new in every frame does by s sqrt 2. */
static void test_flicker_of_noise(void** state)
{
    enum { W = 64, H = 48, FRAMES = 5 };
    es_flicker *still, *noisy;
    assert_int_equal(es_flicker_create(*state, &still), ES_OK);
    assert_int_equal(es_flicker_create(*state, &noisy), ES_OK);
    es_image wrong = noise(*state, W, H, 7, 0, 1);
    for (uint32_t t = 0; t < FRAMES; t++) {
        es_image b = make(*state, W, H, 3, NULL), a = noise(*state, W, H, 100 + t, 0, 1);
        for (int i = 0; i < W * H * 3; i++) b.pixels[i] = (float)(t + 1);
        es_image c = make(*state, W, H, 3, wrong.pixels);
        for (int i = 0; i < W * H * 3; i++) a.pixels[i] += b.pixels[i], c.pixels[i] = b.pixels[i] + (float)((int)(c.pixels[i] * 64)) / 64;
        assert_int_equal(es_flicker_add(still, &c, &b), ES_OK);
        assert_int_equal(es_flicker_add(noisy, &a, &b), ES_OK);
        es_image_destroy(*state, &a);
        es_image_destroy(*state, &b);
        es_image_destroy(*state, &c);
    }
    es_flicker_error e = es_flicker_result(noisy);
    assert_true(es_flicker_result(still).flicker == 0);
    near(e.change, 1.0 / 3, 1e-12);
    near(e.flicker, sqrt(2.0 / 12) / 3, 0.02);
    assert_true(e.worst >= e.flicker && e.worst_frame >= 1 && e.worst_frame < FRAMES);
    es_image_destroy(*state, &wrong);
    es_flicker_destroy(still);
    es_flicker_destroy(noisy);
}

static void test_flicker_not_finite(void** state)
{
    es_flicker *same, *wrong;
    assert_int_equal(es_flicker_create(*state, &same), ES_OK);
    assert_int_equal(es_flicker_create(*state, &wrong), ES_OK);
    es_image a = make(*state, 2, 1, 1, (float[]){NAN, 1}), b = make(*state, 2, 1, 1, (float[]){2, 1});
    for (int t = 0; t < 2; t++) {
        assert_int_equal(es_flicker_add(same, &a, &a), ES_OK);
        assert_int_equal(es_flicker_add(wrong, &a, &b), ES_OK);
    }
    assert_true(es_flicker_result(same).flicker == 0);
    assert_true(isinf(es_flicker_result(wrong).flicker) && es_flicker_result(wrong).change == 0);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
    es_flicker_destroy(same);
    es_flicker_destroy(wrong);
}

/* ---- the same bits for any number of threads and any instruction set ----------------------------------------------------------------- */

static void everything(es_context* context, uint8_t* bytes, size_t size)
{
    es_image a = noise(context, 45, 37, 5, 0, 3), b = noise(context, 45, 37, 6, 0, 3), map;
    es_flicker* flicker;
    size_t at = 0;
    es_image_error error = compared(context, &a, &b, NULL);
    memcpy(bytes, &error, sizeof error);
    at += sizeof error;
    for (int m = ES_ERROR_MAP_ABSOLUTE; m <= ES_ERROR_MAP_SIGNED; m++) {
        assert_int_equal(es_image_error_map(context, &a, &b, (es_error_map)m, NULL, &map), ES_OK);
        uint64_t hash = es_image_hash(&map);
        memcpy(bytes + at, &hash, sizeof hash);
        at += sizeof hash;
        es_image_destroy(context, &map);
    }
    assert_int_equal(es_flicker_create(context, &flicker), ES_OK);
    assert_int_equal(es_flicker_add(flicker, &a, &b), ES_OK);
    assert_int_equal(es_flicker_add(flicker, &b, &a), ES_OK);
    es_flicker_error flickering = es_flicker_result(flicker);
    memcpy(bytes + at, &flickering, sizeof flickering);
    assert_true(at + sizeof flickering <= size);
    es_flicker_destroy(flicker);
    es_image_destroy(context, &a);
    es_image_destroy(context, &b);
}

static void test_same_bits(void** state)
{
    static uint8_t expected[512], got[512];
    everything(*state, expected, sizeof expected);
    for (uint32_t threads = 1; threads <= 5; threads += 2)
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            es_context* context = open_context(threads, 1u << isa);
            everything(context, got, sizeof got);
            assert_memory_equal(got, expected, sizeof expected);
            es_context_destroy(context);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_by_hand, setup, teardown),
        cmocka_unit_test_setup_teardown(test_not_finite, setup, teardown),
        cmocka_unit_test_setup_teardown(test_sums_lose_nothing, setup, teardown),
        cmocka_unit_test_setup_teardown(test_properties, setup, teardown),
        cmocka_unit_test_setup_teardown(test_channels, setup, teardown),
        cmocka_unit_test_setup_teardown(test_maps, setup, teardown),
        cmocka_unit_test_setup_teardown(test_false_colour, setup, teardown),
        cmocka_unit_test_setup_teardown(test_flicker_by_hand, setup, teardown),
        cmocka_unit_test_setup_teardown(test_flicker_of_noise, setup, teardown),
        cmocka_unit_test_setup_teardown(test_flicker_not_finite, setup, teardown),
        cmocka_unit_test_setup_teardown(test_same_bits, setup, teardown),
    };
    return cmocka_run_group_tests_name("error", tests, NULL, NULL);
}
