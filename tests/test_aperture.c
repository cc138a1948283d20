/* Drawing the eye's aperture: areas against analytic ones, every pixel against samples taken one by one, sizes and widths of any kind, the same bits on any number of
 * threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "gi/glare/aperture.h"
#include "platform/context.h"
#include "platform/random.h"
#include "tests/races.h"
#include "tests/same_bits.h"

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.9g, expected %.9g within %g", value, expected, tolerance);
}

static es_context* make_context(void)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

/* mm² that light passes through */
static double open_area(const es_aperture* a)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)a->size * a->size; i++) {
        assert_true(a->transmittance[i] >= 0 && a->transmittance[i] <= 1);
        sum += (double)a->transmittance[i];
    }
    const double pixel = (double)a->width * 1e3 / a->size;
    return sum * pixel * pixel;
}

static double area_of(es_context* context, const es_eye_shapes* shapes, uint32_t size, float width, uint32_t supersample)
{
    es_aperture a = {0};
    assert_int_equal(es_aperture_draw_shapes(context, shapes, size, width, supersample, &a), ES_OK);
    const double area = open_area(&a);
    es_aperture_free(context, &a);
    return area;
}

static void test_areas(void** state)
{
    (void)state;
    es_context* context = make_context();
    static es_eye_shapes s;
    static const uint32_t sizes[] = {256, 512, 1024};
    for (uint32_t i = 0; i < 3; i++)
        for (uint32_t n = 1; n <= 8; n *= 2) {
            /* a disc whose rim is P places long is right to about √P of them (Huxley: P^0.66 at the worst) */
            const double place = 9.5 / (sizes[i] * n);
            s = (es_eye_shapes){.pupil = 2.345f};
            assert_near(area_of(context, &s, sizes[i], 9.5e-3f, n), M_PI * 2.345 * 2.345, 3 * sqrt(2 * M_PI * 2.345 / place) * place * place);
            /* less a slanting line, */
            es_eye_add_line(&s, (es_vec2){-1, -0.7f}, (es_vec2){1.3f, 0.4f}, 0.1f, 0.05f);
            const double length = hypot(2.3, 1.1), with_line = M_PI * 2.345 * 2.345 - length * 0.15;
            assert_near(area_of(context, &s, sizes[i], 9.5e-3f, n), with_line, 8 * length / place * place * place * 0.5);
            /* and between two straight lids: a zone of the disc */
            s.quad_count = 0;
            s.lids = true;
            s.upper = 1;
            s.lower = -0.5f;
            const double zone = 2 * (0.5 * (1 * sqrt(2.345 * 2.345 - 1) + 2.345 * 2.345 * asin(1 / 2.345)) + 0.5 * (0.5 * sqrt(2.345 * 2.345 - 0.25) + 2.345 * 2.345 * asin(0.5 / 2.345)));
            assert_near(area_of(context, &s, sizes[i], 9.5e-3f, n), zone, 6 * 4.5 * place);
        }
    /* with lids that bend, a lens of two parabolas inside of the disc: 2 · 4/3 · h · √(h / bend) */
    s = (es_eye_shapes){.pupil = 4.4f, .lids = true, .upper = 1, .lower = -1, .upper_bend = 0.1f, .lower_bend = 0.1f};
    assert_near(area_of(context, &s, 1024, 9.5e-3f, 4), 8.0 / 3 * sqrt(10), 0.005);
    /* small discs: the mean over places they may have is theirs, and each is not far from it with 4 × 4 places */
    double sum = 0, worst = 0;
    for (uint32_t i = 0; i < 400; i++) {
        s = (es_eye_shapes){.pupil = 1};
        es_eye_add_disc(&s, 0.5f * es_random_float(1, i), 0.5f * es_random_float(2, i), 0.025f);
        const double blocked = M_PI - area_of(context, &s, 128, 2.5e-3f, 4), expected = M_PI * 0.025 * 0.025;
        sum += blocked;
        worst = fmax(worst, fabs(blocked - expected) / expected);
    }
    s = (es_eye_shapes){.pupil = 1};
    const double rim = M_PI - area_of(context, &s, 128, 2.5e-3f, 4);
    assert_near(sum / 400 - rim, M_PI * 0.025 * 0.025, 0.02 * M_PI * 0.025 * 0.025);
    assert_true(worst < 0.5);
    es_context_destroy(context);
}

/* ---- sample by sample ------------------------------------------------------------------------------------------------------------------- */

/* 1: inside, 0: outside, -1: too close to a border to say */
static int inside_disc(double x, double y, double cx, double cy, double radius, double close)
{
    const double distance = hypot(x - cx, y - cy) - radius;
    return fabs(distance) < close ? -1 : distance < 0;
}

static int inside_quad(const es_eye_quad* q, double x, double y, double close)
{
    int positive = 0, negative = 0;
    double nearest = 1e9;
    for (int i = 0; i < 4; i++) {
        const es_vec2 a = q->corner[i], b = q->corner[(i + 1) % 4];
        const double ex = (double)b.x - (double)a.x, ey = (double)b.y - (double)a.y, length = hypot(ex, ey);
        if (length == 0) continue;
        const double side = (ex * (y - (double)a.y) - ey * (x - (double)a.x)) / length;
        nearest = fmin(nearest, fabs(side));
        positive += side > 0;
        negative += side < 0;
    }
    return nearest < close ? -1 : !positive || !negative;
}

/* What is open, by the definitions alone. */
static int open_at(const es_eye_shapes* s, double x, double y, double close)
{
    int open = inside_disc(x, y, 0, 0, (double)s->pupil, close);
    if (!open) return 0;
    for (uint32_t i = 0; i < s->disc_count; i++) {
        const int in = inside_disc(x, y, (double)s->discs[i].x, (double)s->discs[i].y, (double)s->discs[i].radius, close);
        if (in == 1) return 0;
        if (in == -1) open = -1;
    }
    for (uint32_t i = 0; i < s->quad_count; i++) {
        const int in = inside_quad(&s->quads[i], x, y, close);
        if (in == 1) return 0;
        if (in == -1) open = -1;
    }
    if (s->lids) {
        const double up = (double)s->upper - (double)s->upper_bend * x * x - y, down = y - (double)s->lower - (double)s->lower_bend * x * x;
        const double slack = close * (1 + 20 * fabs(x));
        if (up < -slack || down < -slack) return 0;
        if (fabs(up) < slack || fabs(down) < slack) open = -1;
    }
    return open;
}

static void random_shapes(es_eye_shapes* s, uint32_t seed)
{
    *s = (es_eye_shapes){.pupil = 1 + 3.5f * es_random_float(seed, 0), .lids = es_random_float(seed, 1) < 0.7f, .upper = 3 * es_random_float(seed, 2) - 0.3f, .lower = -3 * es_random_float(seed, 3),
        .upper_bend = es_random_float(seed, 4) < 0.3f ? 0 : es_random_float(seed, 4), .lower_bend = 0.3f * es_random_float(seed, 5)};
    uint32_t c = 8;
    for (uint32_t i = 0; i < 40; i++, c += 3) es_eye_add_disc(s, 9 * es_random_float(seed, c) - 4.5f, 9 * es_random_float(seed, c + 1) - 4.5f, 0.5f * es_random_float(seed, c + 2) * es_random_float(seed, c + 2));
    for (uint32_t i = 0; i < 30; i++, c += 6)
        es_eye_add_line(s, (es_vec2){9 * es_random_float(seed, c) - 4.5f, 9 * es_random_float(seed, c + 1) - 4.5f}, (es_vec2){9 * es_random_float(seed, c + 2) - 4.5f, 9 * es_random_float(seed, c + 3) - 4.5f},
            0.1f * es_random_float(seed, c + 4), 0.1f * es_random_float(seed, c + 5));
}

static void test_samples(void** state)
{
    (void)state;
    static es_eye_shapes shapes;
    es_context* context = make_context();
    static const struct { uint32_t size, supersample; float width; } cases[] = {{1, 1, 9e-3f}, {1, 8, 3e-3f}, {7, 4, 9e-3f}, {64, 1, 9e-3f}, {65, 1, 9e-3f}, {33, 2, 9e-3f}, {100, 2, 12e-3f}, {129, 4, 4e-3f}, {48, 4, 9e-3f}, {50, 8, 9e-3f}, {16, 8, 30e-3f}};
    es_aperture a = {0};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (uint32_t seed = 0; seed < 3; seed++) {
            const uint32_t size = cases[i].size, n = cases[i].supersample;
            random_shapes(&shapes, 100 * (uint32_t)i + seed);
            assert_int_equal(es_aperture_draw_shapes(context, &shapes, size, cases[i].width, n, &a), ES_OK);
            assert_int_equal(a.size, size);
            assert_true(a.width == cases[i].width);
            const double place = (double)cases[i].width * 1e3 / (size * n);
            uint32_t unsure = 0;
            for (uint32_t y = 0; y < size; y++)
                for (uint32_t x = 0; x < size; x++) {
                    int least = 0, most = 0;
                    for (uint32_t k = 0; k < n * n; k++) {
                        const double sx = (x * n + k % n + 0.5 - 0.5 * size * n) * place, sy = (0.5 * size * n - y * n - k / n - 0.5) * place;
                        const int open = open_at(&shapes, sx, sy, 1e-4);
                        least += open == 1;
                        most += open != 0;
                    }
                    const double count = (double)a.transmittance[(size_t)y * size + x] * n * n;
                    if (!(count >= least - 1e-3 && count <= most + 1e-3)) fail_msg("case %zu, seed %u: %g of %u places are open at %u, %u, expected %d to %d", i, seed, count, n * n, x, y, least, most);
                    assert_near(count, round(count), 1e-4);
                    unsure += (uint32_t)(most - least);
                }
            assert_true(unsure <= size * size * n * n / 20 + 2);
        }
    es_aperture_free(context, &a);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* ---- eyes -------------------------------------------------------------------------------------------------------------------------------- */

static es_eye_subject usual(void)
{
    es_renderer_settings settings = es_default_renderer_settings();
    return es_eye_subject_of(&settings);
}

static void test_same_bits(void** state)
{
    (void)state;
    static es_eye eye;
    const es_eye_subject s = usual();
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        static const uint32_t sizes[] = {1, 63, 256, 515};
        for (int i = 0; i < 4; i++) {
            memset(&eye, 0, sizeof eye);
            es_eye_advance(&eye, &s, 7.7, i == 3 ? 5000 : 0.2f);
            es_aperture a = {0};
            assert_int_equal(es_aperture_draw(context, &eye, sizes[i], 9e-3f, i == 1 ? 2 : 4, &a), ES_OK);
            expect_same_bits(&same, a.transmittance, (size_t)a.size * a.size * sizeof *a.transmittance);
            es_aperture_free(context, &a);
        }
        es_context_destroy(context);
    }
}

/* Any pupil, and what moves little changes little: the mean over the pupil of what differs after one frame's time is far below the share that is blocked, but for blinks. */
static void test_eyes(void** state)
{
    (void)state;
    static es_eye eye;
    es_context* context = make_context();
    es_aperture a = {0}, b = {0};
    es_eye_subject s = usual();
    s.hippus = 0;
    static const float pupils[] = {0, 0.001f, 2, 9};
    for (int i = 0; i < 4; i++) {
        s.pupil = pupils[i];
        es_eye_advance(&eye, &s, 1, 1);
        assert_int_equal(es_aperture_draw(context, &eye, 256, 10e-3f, 4, &a), ES_OK);
        const double whole = M_PI * 0.25 * (double)pupils[i] * (double)pupils[i], open = open_area(&a);
        assert_true(open <= whole * 1.001 + 1e-9);
        if (i >= 2) assert_true(open > 0.6 * whole);
    }
    s = usual();
    s.blink = false;
    double most = 0;
    for (int frame = 0; frame < 120; frame++) {
        es_eye_advance(&eye, &s, 20 + frame / 60.0, 0.1f);
        es_aperture* now = frame % 2 ? &a : &b;
        assert_int_equal(es_aperture_draw(context, &eye, 512, 9.5e-3f, 4, now), ES_OK);
        if (!frame) continue;
        double difference = 0, sum = 0;
        for (size_t i = 0; i < 512 * 512; i++) {
            difference += fabs((double)a.transmittance[i] - (double)b.transmittance[i]);
            sum += (double)now->transmittance[i];
        }
        most = fmax(most, difference / sum);
    }
    assert_true(most > 0);
    assert_true(most < 0.05);
    es_aperture_free(context, &a);
    es_aperture_free(context, &b);
    es_context_destroy(context);
}

static void test_arguments(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.memory_cap = 3 << 20;
    desc.logger.log = NULL;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    static es_eye_shapes s = {.pupil = 2};
    es_aperture a = {0};
    static const struct { uint32_t size, supersample; float width; } wrong[] = {{0, 2, 1e-2f}, {8193, 2, 1e-2f}, {64, 0, 1e-2f}, {64, 3, 1e-2f}, {64, 16, 1e-2f}, {64, 2, 0}, {64, 2, -1}, {64, 2, NAN}, {64, 2, INFINITY}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) assert_int_equal(es_aperture_draw_shapes(context, &s, wrong[i].size, wrong[i].width, wrong[i].supersample, &a), ES_INVALID_ARGUMENT);
    assert_null(a.transmittance);
    assert_int_equal(es_aperture_draw_shapes(context, &s, 128, 1e-2f, 2, &a), ES_OK);
    assert_int_equal(es_aperture_draw_shapes(context, &s, 2048, 1e-2f, 2, &a), ES_MEMORY_CAP);
    assert_int_equal(es_aperture_draw_shapes(context, &s, 64, 1e-2f, 2, &a), ES_OK);
    es_aperture_free(context, &a);
    es_aperture_free(context, &a);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {unit_test_without_races(test_areas), unit_test_without_races(test_samples), cmocka_unit_test(test_same_bits), unit_test_without_races(test_eyes), unit_test_without_races(test_arguments)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
