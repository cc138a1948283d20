/* The light meter and exposure that gets used to the picture: means of known pictures, the approach in time however it is cut into frames, still pictures that
 * come to rest and are skipped. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "gi/exposure.h"
#include "gi/gi.h"
#include "gi/meter.h"
#include "platform/random.h"
#include "tests/races.h"
#include "tests/same_bits.h"

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.9g, expected %.9g within %g", value, expected, tolerance);
}

/* ---- the meter ----------------------------------------------------------------------------------------------------------------------- */

enum { WIDTH = 37, HEIGHT = 21, STRIDE = 40 };
typedef struct planes { float at[3][STRIDE * HEIGHT]; } planes;

static es_meter metered(es_context* context, const planes* p)
{
    es_meter meter;
    const float* const radiance[3] = {p->at[0], p->at[1], p->at[2]};
    assert_int_equal(es_meter_read(context, radiance, WIDTH, HEIGHT, STRIDE, &meter), ES_OK);
    return meter;
}

static void test_meter(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        static planes p;
        double sum = 0, log_sum = 0;
        for (uint32_t i = 0; i < STRIDE * HEIGHT; i++) {
            for (uint32_t k = 0; k < 3; k++) p.at[k][i] = i % STRIDE < WIDTH ? exp2f(20 * es_random_float(k, i) - 10) : 1e30f; /* what lies past a row's end is not the picture's */
            const double l = 0.2126 * (double)p.at[0][i] + 0.7152 * (double)p.at[1][i] + 0.0722 * (double)p.at[2][i];
            if (i % STRIDE >= WIDTH) continue;
            sum += l;
            log_sum += log2(l);
        }
        es_meter meter = metered(context, &p);
        assert_near((double)meter.luminance, 179 * sum / (WIDTH * HEIGHT), 1e-5 * 179 * sum / (WIDTH * HEIGHT));
        assert_near((double)meter.log_average, exp2(log_sum / (WIDTH * HEIGHT)), 1e-5 * exp2(log_sum / (WIDTH * HEIGHT)));
        expect_same_bits(&same, &meter, sizeof meter);

        /* no picture makes a meter of no number */
        for (uint32_t i = 0; i < STRIDE * HEIGHT; i++)
            for (uint32_t k = 0; k < 3; k++) p.at[k][i] = 0;
        meter = metered(context, &p);
        assert_true(meter.luminance == 0.0f);
        assert_near((double)meter.log_average, (double)ES_METER_LEAST, 1e-9);
        p.at[0][3] = NAN;
        p.at[1][3] = -5;
        p.at[2][3] = -INFINITY;
        assert_true(metered(context, &p).luminance == 0.0f);
        p.at[0][3] = 0;
        p.at[2][STRIDE + 9] = INFINITY;
        p.at[1][STRIDE + 5] = 1e30f;
        meter = metered(context, &p);
        assert_near((double)meter.luminance, 179 * 0.7152 * (double)ES_METER_MOST / (WIDTH * HEIGHT), 1e5);
        expect_same_bits(&same, &meter, sizeof meter);
        es_context_destroy(context);
    }
}

/* ---- getting used to -------------------------------------------------------------------------------------------------------------------- */

static void test_approach(void** state)
{
    (void)state;
    /* the first picture is what it is used to; then 1 - 1/e of the way, in stops, in the time constant, and four times as long towards darker */
    es_exposure e = {0};
    es_exposure_advance(&e, 0.5f, 3, 1);
    assert_near((double)es_exposure_scale(&e, 0.18f), 0.18, 1e-6);
    es_exposure_advance(&e, 0.5f, 3.5, 1024);
    assert_near(e.adaptation.level, 10 * (1 - exp(-1)), 0.01);
    e = (es_exposure){0};
    es_exposure_advance(&e, 0.5f, 3, 1024);
    es_exposure_advance(&e, 0.5f, 5, 1);
    assert_near(e.adaptation.level, 10 * exp(-1), 0.01);

    /* it arrives, and then stays to the bit */
    for (int i = 0; i < 60; i++) es_exposure_advance(&e, 0.5f, 5 + i, 1);
    const double level = e.adaptation.level;
    assert_true(level == es_adaptation_level(1));
    es_exposure_advance(&e, 0.5f, 66, 1);
    assert_true(e.adaptation.level == level);

    /* however time is cut into frames */
    es_exposure a = {0}, b = {0};
    es_exposure_advance(&a, 1, 0, 1);
    es_exposure_advance(&b, 1, 0, 1);
    es_exposure_advance(&a, 1, 2, 50);
    double time = 0;
    for (uint32_t i = 0; time < 2; i++) {
        time = fmin(time + (double)es_random_float(9, i) * 0.1, 2);
        es_exposure_advance(&b, 1, time, 50);
    }
    assert_memory_equal(&a.adaptation.level, &b.adaptation.level, sizeof(double));

    /* time that stands, goes back, leaps, or is none; pictures of no brightness, and of all */
    es_exposure_advance(&a, 1, 2, 3);
    assert_true(a.adaptation.level == b.adaptation.level);
    es_exposure_advance(&a, 1, 1, 3);
    assert_near(exp2(a.adaptation.level), 3, 1e-5);
    es_exposure_advance(&a, 1, 86401, 70);
    assert_near(exp2(a.adaptation.level), 70, 1e-4);
    static const double times[] = {NAN, INFINITY, -INFINITY, 1e300, 0, -5};
    static const float levels[] = {0, NAN, INFINITY, -1, 1e-30f, 1e30f};
    for (uint32_t i = 0; i < 36; i++) {
        es_exposure_advance(&a, 1, times[i / 6], levels[i % 6]);
        const float scale = es_exposure_scale(&a, 0.18f);
        assert_true(scale > 0 && scale < 1e6f);
    }
}

/* ---- in a frame --------------------------------------------------------------------------------------------------------------------------- */

static const char* skipped(const es_renderer* renderer, const char* pass)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (strcmp(stats->passes[i].name, pass) == 0) return stats->passes[i].skipped;
    fail_msg("no pass %s", pass);
    return NULL;
}

typedef struct shown { es_world* world; es_renderer* renderer; } shown;

static shown show(es_context* context, bool skip, uint32_t antialias)
{
    shown s;
    assert_int_equal(es_world_create(context, NULL, &s.world), ES_OK);
    es_node_desc node = {.transform = es_identity_transform()};
    es_camera_desc camera_desc = es_default_camera_desc();
    es_camera camera;
    assert_int_equal(es_world_add_node(s.world, &node, &camera_desc.node), ES_OK);
    assert_int_equal(es_world_add_camera(s.world, &camera_desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(s.world, camera), ES_OK);
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = 33;
    settings.height = 20;
    settings.skip = skip;
    settings.antialias = antialias;
    settings.temporal_settle = 4;
    settings.antialias_samples = 4;
    settings.exposure_adapt = 0.25f;
    settings.tone_map = ES_TONE_MAP_LINEAR;
    assert_int_equal(es_renderer_create(context, &settings, &s.renderer), ES_OK);
    return s;
}

static float frame(shown* s, float radiance, float dt)
{
    const es_environment_desc sky = {.radiance = {radiance, radiance, radiance}};
    es_environment_desc is;
    if (!es_world_get_environment(s->world, &is) || is.radiance[0] != radiance) assert_int_equal(es_world_set_environment(s->world, &sky), ES_OK);
    assert_int_equal(es_world_step(s->world, dt), ES_OK);
    assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK);
    es_image image;
    assert_int_equal(es_renderer_image(s->renderer, "display", &image), ES_OK);
    const float value = image.pixels[0];
    es_image_destroy(es_world_context(s->world), &image);
    return value;
}

static void end(shown* s)
{
    es_renderer_destroy(s->renderer);
    es_world_destroy(s->world);
}

static void test_frames(void** state)
{
    (void)state;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    for (uint32_t antialias = ES_ANTIALIAS_NONE; antialias <= ES_ANTIALIAS_SUPERSAMPLE; antialias++) {
        shown a = show(context, true, antialias), b = show(context, false, antialias);
        /* of the first frame the mean is shown as the key */
        assert_near((double)frame(&a, 0.02f, 0), 0.18, 1e-4);
        frame(&b, 0.02f, 0);
        /* one in which it has become four times as bright is shown as that, and then less and less so until it is as the first */
        float last = frame(&a, 0.08f, 0);
        assert_near((double)last, 0.72, 0.001);
        frame(&b, 0.08f, 0);
        bool rested = false;
        for (int i = 0; i < 240; i++) {
            const float now = frame(&a, 0.08f, 1.0f / 60), without = frame(&b, 0.08f, 1.0f / 60);
            assert_memory_equal(&now, &without, sizeof now);
            assert_true(now <= last);
            if (rested) assert_non_null(skipped(a.renderer, "compose"));
            rested = rested || skipped(a.renderer, "compose");
            last = now;
        }
        assert_true(rested);
        assert_near((double)last, 0.18, 1e-3);
        assert_null(skipped(b.renderer, "compose"));
        /* without it the exposure is what the setting says, and is so at once */
        es_renderer_settings settings = es_renderer_get_settings(a.renderer);
        settings.exposure_adapt = 0;
        assert_int_equal(es_renderer_configure(a.renderer, &settings), ES_OK);
        assert_near((double)frame(&a, 0.08f, 1.0f / 60), 0.08, 1e-3);
        assert_string_equal(skipped(a.renderer, "light meter"), "nothing reads it");
        end(&a);
        end(&b);
    }
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_meter), unit_test_without_races(test_approach), unit_test_without_races(test_frames)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
