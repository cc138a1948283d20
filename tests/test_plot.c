/* What the benchmarks' page computes from its figures: fronts, crossings, slopes, ticks, escaped text, and errors against a truth that
 * has noise of its own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../demos/bench_error_measure.c"
#include "../demos/bench_error_reference.c"
#include "../demos/messages.c"
#include "../demos/plot_curves.c"
#include "../demos/plot_svg.c"
#include "../demos/text.c"
#include "platform/random.h"

double demo_seconds(void) { return 0; }

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.9g, expected %.9g", value, expected);
}

static es_context* make_context(void)
{
    es_context_desc desc = es_default_context_desc();
    es_context* context;
    desc.threads = 1;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

/* ---- curves ---------------------------------------------------------------------------------------------------------------------------- */

static void test_front(void** state)
{
    static const double points[][3] = {{10, 5, 1}, {20, 3, 1}, {20, 4, 0}, {15, 6, 0}, {30, 3, 0}, {40, 1, 1}, {5, 9, 1}};
    plot_curves plot = {.id = "front"};
    plot_series* series = plot_add_series(&plot, 0, "methods");
    series->competes = true;
    for (size_t i = 0; i < sizeof points / sizeof points[0]; i++) plot_add_point(&plot, series, points[i][0], points[i][1], "%zu", i);
    plot_add_point(&plot, series, NAN, 0, "not drawn");
    plot_add_point(&plot, series, 1, INFINITY, "not drawn");
    plot_series* bystander = plot_add_series(&plot, 1, "better than all, and not asked");
    plot_add_point(&plot, bystander, 1, 0.1, "x");
    plot_mark_front(&plot);
    assert_int_equal(series->count, 7);
    for (size_t i = 0; i < 7; i++) assert_int_equal(series->points[i].front, points[i][2] > 0);
    assert_false(bystander->points[0].front);
    plot_curves_free(&plot);
}

static void test_between_points(void** state)
{
    plot_curves plot = {.id = "power"};
    plot_series* series = plot_add_series(&plot, 0, "y = 3 x^-0.5");
    for (int i = 0; i < 6; i++) plot_add_point(&plot, series, pow(4, i), 3 * pow(4, -0.5 * i), "%d", i);
    assert_near(plot_log_slope(series), -0.5, 1e-12);
    assert_near(plot_y_at(series, 7), 3 / sqrt(7), 1e-12);
    assert_near(plot_x_at(series, 0.5), 36, 1e-9);
    assert_true(isnan(plot_y_at(series, 0.5)));
    assert_true(isnan(plot_y_at(series, 5000)));
    assert_true(isnan(plot_x_at(series, 4)));
    series->count = 1;
    assert_true(isnan(plot_log_slope(series)));
    plot_curves_free(&plot);
}

static void test_axes(void** state)
{
    plot_axis axis = plot_make_axis(true, 20, 30000, 100, 900);
    bool has_hundred = false;
    for (size_t i = 0; i < axis.tick_count; i++) {
        has_hundred |= axis.ticks[i] == 100;
        assert_true(plot_position(&axis, axis.ticks[i]) >= 100 - 1e-6 && plot_position(&axis, axis.ticks[i]) <= 900 + 1e-6);
    }
    assert_true(has_hundred && axis.tick_count >= 3 && axis.tick_count < 40);
    assert_near(plot_position(&axis, sqrt(20.0 * 30000)), 500, 1e-6);
    axis = plot_make_axis(true, 1.7, 2.6, 0, 400); /* no power of ten in it */
    assert_true(axis.tick_count >= 3);
    axis = plot_make_axis(false, 0, 1.7, 0, 800);
    assert_near(plot_position(&axis, 0), 0, 1e-9);
    assert_true(axis.ticks[0] == 0 && axis.tick_count >= 3);
    for (int k = 0; k < 4; k++) { /* what cannot be drawn still has an axis */
        static const double bad[4][2] = {{INFINITY, -INFINITY}, {NAN, 1}, {0, 10}, {5, 5}};
        axis = plot_make_axis(true, bad[k][0], bad[k][1], 0, 100);
        assert_true(isfinite(plot_position(&axis, 5)) && axis.tick_count > 0 && axis.tick_count < 64);
    }
    char text[32];
    plot_format_tick(text, 4e6);
    assert_string_equal(text, "4M");
    plot_format_tick(text, 0.05);
    assert_string_equal(text, "0.05");
    plot_format_value(text, 1234.5);
    assert_string_equal(text, "1234");
    plot_format_value(text, NAN);
    assert_string_equal(text, "–");
}

static size_t count_of(const char* text, const char* part)
{
    size_t count = 0;
    for (const char* at = text; (at = strstr(at, part)) != NULL; at += strlen(part)) count++;
    return count;
}

static void test_drawing(void** state)
{
    plot_curves plot = {.id = "drawing", .x_name = "a < b & \"c\"", .y_name = "y", .x_log = true, .y_log = true};
    snprintf(plot.headline, sizeof plot.headline, "<script>");
    demo_text text = {0};
    plot_curves_add_svg(&text, &plot); /* nothing to draw is no reason to fail */
    assert_non_null(strstr(text.bytes, "</svg>"));
    demo_text_free(&text);
    plot_series* series = plot_add_series(&plot, 3, "<&>");
    series->line = true;
    for (int i = -1; i < 4; i++) plot_add_point(&plot, series, i, 2, "note %d", i);
    plot_curves_add_svg(&text, &plot);
    assert_null(strstr(text.bytes, "<script>"));
    assert_non_null(strstr(text.bytes, "a &lt; b &amp; &quot;c&quot;"));
    assert_int_equal(count_of(text.bytes, "note "), 3); /* -1 and 0 have no logarithm */
    assert_null(strstr(text.bytes, "nan"));
    assert_null(strstr(text.bytes, "inf"));
    demo_text_free(&text);
    plot_curves_add_csv(&text, &plot);
    assert_int_equal(count_of(text.bytes, "\n"), 6);
    assert_non_null(strstr(text.bytes, "\"a < b & \"\"c\"\"\""));
    demo_text_free(&text);
    for (int i = 0; i < PLOT_MAX_SERIES + 5; i++) assert_non_null(plot_add_series(&plot, (uint32_t)i, "series %d", i));
    assert_int_equal(plot.series_count, PLOT_MAX_SERIES);
    plot_curves_free(&plot);
}

/* ---- errors ---------------------------------------------------------------------------------------------------------------------------- */

enum { SIDE = 96, VALUES = SIDE * SIDE * 3 };

static float noise(uint32_t stream, uint32_t i) { return es_unit_float(es_hash_u32(i * 0x9e3779b9u ^ es_hash_u32(stream))) - 0.5f; }

/* Light 1, an image off by 0.1 everywhere, two halves of the truth with far more noise than that. */
static void make_noisy(es_context* context, uint32_t frame, float offset, es_image* image, error_truth* truth)
{
    *truth = (error_truth){0};
    assert_int_equal(es_image_create(context, SIDE, SIDE, 3, image), ES_OK);
    assert_int_equal(es_image_create(context, SIDE, SIDE, 3, &truth->whole), ES_OK);
    for (int h = 0; h < 2; h++) assert_int_equal(es_image_create(context, SIDE, SIDE, 3, &truth->halves[h]), ES_OK);
    for (uint32_t i = 0; i < VALUES; i++) {
        image->pixels[i] = 1 + offset;
        truth->whole.pixels[i] = 1;
        for (uint32_t h = 0; h < 2; h++) truth->halves[h].pixels[i] = 1 + noise(2 * frame + h, i);
    }
    assert_true(error_join_halves(context, truth));
}

static void test_noise_of_the_truth(void** state)
{
    es_context* context = make_context();
    es_image images[2];
    error_truth truths[2];
    make_noisy(context, 0, 0.1f, &images[0], &truths[0]);
    make_noisy(context, 1, 0.3f, &images[1], &truths[1]);
    /* uniform noise of width 1 has the variance 1/12, the mean of two half of it */
    assert_near(truths[0].noise_relrmse, sqrt(1.0 / 24), 0.005);
    error_measures measures = error_measure(context, &images[0], NULL, &truths[0]);
    assert_near(measures.relrmse, 0.1, 0.01); /* four standard errors of the mean product are 0.002 of its 0.01 */
    assert_true(measures.flip >= 0 && measures.flip <= 1 && measures.flip_whole >= 0);
    assert_near(error_flicker(images, truths, 2), 0.2, 0.02);
    for (int h = 0; h < 2; h++) es_image_destroy(context, &truths[0].halves[h]);
    measures = error_measure(context, &images[0], NULL, &truths[0]); /* one picture: its noise counts */
    assert_near(measures.relrmse, sqrt(0.01 + 1.0 / 24), 0.005);
    assert_true(isnan(error_flicker(images, truths, 2)));
    for (int i = 0; i < 2; i++) {
        error_truth_free(context, &truths[i]);
        es_image_destroy(context, &images[i]);
    }
    es_context_destroy(context);
}

static void test_time_to_an_error(void** state)
{
    error_curve curve = {.count = 6};
    bool extrapolated;
    for (uint32_t i = 0; i < 6; i++) {
        curve.points[i].samples = 1u << i;
        curve.points[i].seconds = 0.5 * (1 << i);
        curve.points[i].error.relrmse = 2 / sqrt(1 << i);
    }
    assert_near(error_seconds_to(&curve, 1, &extrapolated), 2, 1e-9);
    assert_false(extrapolated);
    assert_near(error_seconds_to(&curve, 0.8, &extrapolated), 0.5 * 6.25, 1e-9);
    assert_near(error_seconds_to(&curve, 0.1, &extrapolated), 200, 1e-9);
    assert_true(extrapolated);
    assert_near(error_seconds_to(&curve, 3, &extrapolated), 0.5, 0); /* its first sample is better */
    assert_near(error_at_samples(&curve, 400), 0.1, 1e-9);
    curve.count = 0;
    assert_true(isnan(error_seconds_to(&curve, 1, &extrapolated)));
}

static void test_agreement(void** state)
{
    es_context* context = make_context();
    es_image ours = {0}, error = {0};
    error_truth truth = {.samples = 100};
    assert_int_equal(es_image_create(context, SIDE, SIDE, 3, &ours), ES_OK);
    assert_int_equal(es_image_create(context, SIDE, SIDE, 3, &error), ES_OK);
    assert_int_equal(es_image_create(context, SIDE, SIDE, 3, &truth.indirect), ES_OK);
    const double deviation = sqrt(1.0 / 12);
    for (uint32_t p = 0; p < SIDE * SIDE; p++)
        for (uint32_t k = 0; k < 3; k++) { /* the channels have the same noise, as those of a path have */
            ours.pixels[3 * p + k] = 1 + noise(7, p);
            truth.indirect.pixels[3 * p + k] = 1 + noise(8, p);
            error.pixels[3 * p + k] = (float)deviation;
        }
    error_agreement agreement;
    agree(&ours, &error, 100, &truth, &agreement); /* as many samples, as much noise */
    assert_int_equal(agreement.blocks, 36);
    assert_int_equal(agreement.within, 36);
    assert_true(agreement.worst > 1.2); /* 36 blocks of honest noise reach this but once in 10^4 */
    assert_true(agreement.deviations[0] <= agreement.deviations[35]);
    free(agreement.deviations);
    for (uint32_t i = 0; i < 16 * 3; i++) ours.pixels[i] += 16 * 0.2f; /* one row of one block: its mean is off by 0.2, eight standard errors */
    agree(&ours, &error, 100, &truth, &agreement);
    assert_int_equal(agreement.within, 35);
    assert_true(agreement.worst > 4);
    free(agreement.deviations);
    es_image_destroy(context, &ours);
    es_image_destroy(context, &error);
    error_truth_free(context, &truth);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_front),
        cmocka_unit_test(test_between_points),
        cmocka_unit_test(test_axes),
        cmocka_unit_test(test_drawing),
        cmocka_unit_test(test_noise_of_the_truth),
        cmocka_unit_test(test_time_to_an_error),
        cmocka_unit_test(test_agreement),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
