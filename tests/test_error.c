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
#include "tests/races.h"

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

/* ---- FLIP --------------------------------------------------------------------------------------------------------------------------- */

/* The pictures of tests/independent_flip.py. */
static es_image picture(es_context* context, uint32_t width, uint32_t height, uint32_t seed, int high)
{
    es_image image = make(context, width, height, 3, NULL);
    uint64_t random = seed;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            for (uint32_t c = 0; c < 3; c++) {
                random = (random * 1103515245 + 12345) % (1u << 31);
                float value = (float)(random >> 16 & 63) / 256 + (float)((x * (c + 1) + y * 3) % 32) / 64 + ((x / 5 + y / 4) % 2 ? 0.25f : 0);
                value = high ? ldexpf(value, high * (int)(x + y * 2) / (int)(width + 2 * height) - 2) : value < 1 ? value : 1;
                image.pixels[3 * (y * width + x) + c] = value;
            }
    return image;
}

static es_image flat(es_context* context, uint32_t side, float r, float g, float b)
{
    es_image image = make(context, side, side, 3, NULL);
    for (uint32_t i = 0; i < side * side; i++) image.pixels[3 * i] = r, image.pixels[3 * i + 1] = g, image.pixels[3 * i + 2] = b;
    return image;
}

typedef struct flip_values { double mean, largest, first, middle, last; } flip_values;

static void check_flip(es_context* context, es_image* a, es_image* b, es_error_map kind, const es_error_desc* desc, flip_values expected)
{
    const double tolerance = 3e-6; /* of single precision */
    es_image map;
    es_error_desc full = *desc;
    full.flip = true;
    es_image_error error = compared(context, a, b, &full);
    assert_int_equal(es_image_error_map(context, a, b, kind, desc, &map), ES_OK);
    uint32_t count = map.width * map.height;
    flip_values got = {kind == ES_ERROR_MAP_FLIP ? error.flip : error.hdr_flip, 0, map.pixels[0], map.pixels[map.height / 2 * map.width + map.width / 2], map.pixels[count - 1]};
    for (uint32_t i = 0; i < count; i++) got.largest = fmax(got.largest, (double)map.pixels[i]);
    const double *p = &got.mean, *q = &expected.mean;
    for (int k = 0; k < 5; k++)
        if (!(fabs(p[k] - q[k]) < tolerance)) fail_msg("value %d of FLIP is %.9f instead of %.9f", k, p[k], q[k]);
    es_image_destroy(context, &map);
    es_image_destroy(context, a);
    es_image_destroy(context, b);
}

/* Expected values by tests/independent_flip.py. */
static void test_flip_independent(void** state)
{
    const es_error_desc shown = {.display_referred = true}, coarse = {.display_referred = true, .pixels_per_degree = 30};
    es_image a = picture(*state, 22, 17, 1, 0), b = picture(*state, 22, 17, 2, 0);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &shown, (flip_values){0.146771044, 0.375977769, 0.375977769, 0.152318654, 0.189995208});
    a = picture(*state, 22, 17, 1, 0), b = picture(*state, 22, 17, 2, 0);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &coarse, (flip_values){0.296455213, 0.619500723, 0.531141476, 0.381662991, 0.309635839});
    a = flat(*state, 9, 0.25f, 0.5f, 0.125f), b = flat(*state, 9, 0.5f, 0.5f, 0.125f);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &shown, (flip_values){0.435721519, 0.435721519, 0.435721519, 0.435721519, 0.435721519});
    a = flat(*state, 9, 0, 0, 0), b = flat(*state, 9, 1, 1, 1);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &shown, (flip_values){0.967379763, 0.967379763, 0.967379763, 0.967379763, 0.967379763});
    a = flat(*state, 9, 0, 0, 1), b = flat(*state, 9, 0, 1, 0);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &shown, (flip_values){1, 1, 1, 1, 1});
}

static void test_hdr_flip_independent(void** state)
{
    const es_error_desc forty = {.pixels_per_degree = 40};
    es_image a = picture(*state, 15, 12, 3, 10), b = picture(*state, 15, 12, 4, 10);
    check_flip(*state, &a, &b, ES_ERROR_MAP_HDR_FLIP, &forty, (flip_values){0.221319254, 0.612280399, 0.289021209, 0.559103294, 0.264794064});
    a = picture(*state, 15, 12, 3, 10), b = picture(*state, 15, 12, 4, 10);
    check_flip(*state, &a, &b, ES_ERROR_MAP_FLIP, &forty, (flip_values){0.199773502, 0.618164083, 0.380155291, 0.322352816, 0.076576104});
    a = picture(*state, 15, 11, 5, 3), b = picture(*state, 15, 11, 6, 3);
    check_flip(*state, &a, &b, ES_ERROR_MAP_HDR_FLIP, &forty, (flip_values){0.236520955, 0.816879824, 0.729705412, 0.099768506, 0.160298534});
}

static void test_flip_properties(void** state)
{
    const es_error_desc linear = {.flip = true, .display_referred = true};
    es_image a = noise(*state, 40, 30, 1, 0, 1), b = noise(*state, 40, 30, 2, 0, 1), grey = flat(*state, 30, 0.3f, 0.3f, 0.3f), other = flat(*state, 30, 0, 0, 0), map;
    es_image_error same = compared(*state, &a, &a, &(es_error_desc){.flip = true}), ab = compared(*state, &a, &b, &linear), ba = compared(*state, &b, &a, &linear);
    assert_true(same.flip == 0 && same.hdr_flip == 0 && ab.flip > 0 && ab.flip == ba.flip);
    assert_true(isnan(ab.hdr_flip));
    double last = 0;
    for (int k = 1; k <= 7; k++) { /* farther from grey, by lightness alone */
        for (int i = 0; i < 30 * 30 * 3; i++) other.pixels[i] = 0.3f + 0.1f * (float)k;
        double flip = compared(*state, &other, &grey, &linear).flip;
        assert_true(flip > last && flip < 1);
        last = flip;
    }
    /* a mean over what the mask leaves; the filters see everything */
    uint8_t mask[40 * 30] = {0};
    for (int i = 0; i < 40 * 30; i += 3) mask[i] = 1;
    es_error_desc masked = linear;
    masked.mask = mask;
    assert_int_equal(es_image_error_map(*state, &a, &b, ES_ERROR_MAP_FLIP, &linear, &map), ES_OK);
    double sum = 0;
    for (int i = 0; i < 40 * 30; i += 3) sum += (double)map.pixels[i];
    near(compared(*state, &a, &b, &masked).flip, sum / 400, 1e-12);
    es_image_destroy(*state, &map);
    assert_int_equal(es_image_error_map(*state, &a, &b, ES_ERROR_MAP_FLIP, &masked, &map), ES_OK);
    for (int i = 0; i < 40 * 30; i++) assert_true((map.pixels[i] > 0) == (i % 3 == 0));
    es_image_destroy(*state, &map);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
    es_image_destroy(*state, &grey);
    es_image_destroy(*state, &other);
}

/* A spot has the same map wherever it lies: nothing is seen of the tiles that the work is divided into. */
static void test_flip_has_no_seams(void** state)
{
    enum { W = 180, H = 150, REACH = 12 };
    static const uint32_t places[4][2] = {{30, 30}, {62, 63}, {128, 64}, {150, 127}};
    es_image maps[4];
    for (int p = 0; p < 4; p++) {
        es_image a = make(*state, W, H, 3, NULL), b = make(*state, W, H, 3, NULL);
        for (int i = 0; i < W * H * 3; i++) a.pixels[i] = b.pixels[i] = 0.25f;
        a.pixels[3 * (places[p][1] * W + places[p][0])] = 1;
        b.pixels[3 * (places[p][1] * W + places[p][0] + 1) + 1] = 0.5f;
        assert_int_equal(es_image_error_map(*state, &a, &b, ES_ERROR_MAP_FLIP, &(es_error_desc){.display_referred = true}, &maps[p]), ES_OK);
        es_image_destroy(*state, &a);
        es_image_destroy(*state, &b);
        for (int dy = -REACH; dy <= REACH; dy++)
            for (int dx = -REACH; dx <= REACH; dx++) {
                float here = maps[p].pixels[((int)places[p][1] + dy) * W + (int)places[p][0] + dx], first = maps[0].pixels[(30 + dy) * W + 30 + dx];
                assert_true(here == first);
                if (dx < -10 || dx > 11 || dy < -10 || dy > 10) assert_true(here == 0); /* beyond the filters */
                if (dx >= -2 && dx <= 3 && dy >= -2 && dy <= 2) assert_true(here > 0);
            }
    }
    for (int p = 0; p < 4; p++) es_image_destroy(*state, &maps[p]);
}

static void test_hdr_flip_follows_the_scale(void** state)
{
    es_image a = picture(*state, 20, 16, 8, 9), b = picture(*state, 20, 16, 9, 9);
    double expected = compared(*state, &a, &b, NULL).hdr_flip;
    for (int k = -80; k <= 80; k += 40) {
        es_image c = make(*state, 20, 16, 3, NULL), d = make(*state, 20, 16, 3, NULL);
        for (int i = 0; i < 20 * 16 * 3; i++) c.pixels[i] = ldexpf(a.pixels[i], k), d.pixels[i] = ldexpf(b.pixels[i], k);
        near(compared(*state, &c, &d, NULL).hdr_flip, expected, 1e-4);
        es_image_destroy(*state, &c);
        es_image_destroy(*state, &d);
    }
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &b);
}

/* Values that no renderer should write: every error stays in [0, 1], and what is not finite has all of it. */
static void test_flip_of_extremes(void** state)
{
    static const float values[] = {0, -1, -1e38f, 1e38f, 3.4e38f, 1e-40f, 1e-45f, 1e-20f, 1e20f, 1, NAN, INFINITY, -INFINITY};
    enum { N = sizeof values / sizeof values[0] };
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            es_image a = flat(*state, 4, 0.5f, 0.5f, 0.5f), b = flat(*state, 4, 0.5f, 0.5f, 0.5f), map;
            a.pixels[21] = values[i];
            b.pixels[21] = values[j];
            b.pixels[32] = values[j] * 0.5f;
            bool wrong = (!isfinite(values[i]) || !isfinite(values[j])) && !(values[i] == values[j] || (isnan(values[i]) && isnan(values[j])));
            for (int m = ES_ERROR_MAP_FLIP; m <= ES_ERROR_MAP_HDR_FLIP; m++) {
                assert_int_equal(es_image_error_map(*state, &a, &b, (es_error_map)m, NULL, &map), ES_OK);
                for (int k = 0; k < 16; k++) assert_true(map.pixels[k] >= 0 && map.pixels[k] <= 1);
                if (wrong) assert_true(map.pixels[7] == 1);
                es_image_destroy(*state, &map);
            }
            es_image_destroy(*state, &a);
            es_image_destroy(*state, &b);
        }
    es_image black = flat(*state, 4, 0, 0, 0), lit = flat(*state, 4, 0, 0, 0);
    lit.pixels[10] = 2;
    assert_true(compared(*state, &black, &black, NULL).hdr_flip == 0);
    assert_true(compared(*state, &lit, &black, NULL).hdr_flip > 0);
    assert_true(compared(*state, &black, &lit, NULL).hdr_flip > 0); /* more than half is black */
    es_image_destroy(*state, &black);
    es_image_destroy(*state, &lit);
}

static void test_flip_refusals(void** state)
{
    es_image a = flat(*state, 4, 0.5f, 0.5f, 0.5f), single = make(*state, 4, 4, 1, NULL), map;
    es_image_error error;
    static const float densities[] = {-1, 1, 451, 1e30f, NAN, INFINITY};
    for (size_t i = 0; i < sizeof densities / sizeof densities[0]; i++) {
        es_error_desc desc = {.flip = true, .pixels_per_degree = densities[i]};
        assert_int_equal(es_image_compare(*state, &a, &a, &desc, &error), ES_INVALID_ARGUMENT);
        assert_int_equal(es_image_error_map(*state, &a, &a, ES_ERROR_MAP_FLIP, &desc, &map), ES_INVALID_ARGUMENT);
        assert_null(map.pixels);
    }
    for (float density = 10; density <= 450; density += 44)
        assert_int_equal(es_image_compare(*state, &a, &a, &(es_error_desc){.flip = true, .pixels_per_degree = density}, &error), ES_OK);
    assert_int_equal(es_image_compare(*state, &single, &single, NULL, &error), ES_OK);
    assert_true(isnan(error.flip) && isnan(error.hdr_flip));
    assert_int_equal(es_image_error_map(*state, &single, &single, ES_ERROR_MAP_FLIP, NULL, &map), ES_INVALID_ARGUMENT);
    assert_int_equal(es_image_error_map(*state, &a, &a, ES_ERROR_MAP_HDR_FLIP, &(es_error_desc){.display_referred = true}, &map), ES_INVALID_ARGUMENT);
    es_image_destroy(*state, &a);
    es_image_destroy(*state, &single);
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
    es_image a = noise(context, 77, 67, 5, 0, 3), b = noise(context, 77, 67, 6, 0, 3), map; /* four tiles */
    es_flicker* flicker;
    size_t at = 0;
    es_image_error error = compared(context, &a, &b, NULL);
    memcpy(bytes, &error, sizeof error);
    at += sizeof error;
    for (int m = ES_ERROR_MAP_ABSOLUTE; m <= ES_ERROR_MAP_HDR_FLIP; m++) {
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
        unit_test_without_races_setup_teardown(test_by_hand, setup, teardown),
        unit_test_without_races_setup_teardown(test_not_finite, setup, teardown),
        unit_test_without_races_setup_teardown(test_sums_lose_nothing, setup, teardown),
        unit_test_without_races_setup_teardown(test_properties, setup, teardown),
        unit_test_without_races_setup_teardown(test_channels, setup, teardown),
        unit_test_without_races_setup_teardown(test_maps, setup, teardown),
        unit_test_without_races_setup_teardown(test_false_colour, setup, teardown),
        unit_test_without_races_setup_teardown(test_flip_independent, setup, teardown),
        unit_test_without_races_setup_teardown(test_hdr_flip_independent, setup, teardown),
        unit_test_without_races_setup_teardown(test_flip_properties, setup, teardown),
        unit_test_without_races_setup_teardown(test_flip_has_no_seams, setup, teardown),
        unit_test_without_races_setup_teardown(test_hdr_flip_follows_the_scale, setup, teardown),
        unit_test_without_races_setup_teardown(test_flip_of_extremes, setup, teardown),
        unit_test_without_races_setup_teardown(test_flip_refusals, setup, teardown),
        unit_test_without_races_setup_teardown(test_flicker_by_hand, setup, teardown),
        unit_test_without_races_setup_teardown(test_flicker_of_noise, setup, teardown),
        unit_test_without_races_setup_teardown(test_flicker_not_finite, setup, teardown),
        cmocka_unit_test_setup_teardown(test_same_bits, setup, teardown),
    };
    return cmocka_run_group_tests_name("error", tests, NULL, NULL);
}
