/* What the reference says of itself: images that add up, errors that are honest, limits that are kept, files that go on where they stopped. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reference_runs.h"
#include "tests/races.h"

enum { WIDTH = 12, HEIGHT = 9, VALUES = WIDTH * HEIGHT * 3 };

/* A corner with a glossy wall, a glowing plate, a spot, a point light and a sky: everything that light can come from. */
static void fill_corner(small_world* w)
{
    es_material_desc grey = lambert(0.7f, 0), glossy = lambert(0.6f, 0), glowing = lambert(0.3f, 2);
    glossy.specular = 1;
    glossy.roughness = 0.4f;
    glossy.base_color[1] = 0.2f;
    add_rectangle(w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    add_rectangle(w, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &glossy);
    add_rectangle(w, es_v3(-2, 0, 2), es_v3(0, 0, -4), es_v3(0, 3, 0), &grey);
    add_rectangle(w, es_v3(0.2f, 1.9f, -0.9f), es_v3(0.6f, 0, 0), es_v3(0, 0, 0.5f), &glowing);
    es_light_desc light = es_default_light_desc();
    light.type = ES_LIGHT_SPOT;
    light.intensity = 12;
    light.inner_cone = 0.3f;
    light.outer_cone = 0.6f;
    add_light(w, light, es_v3(1.2f, 2.6f, 1.4f), es_v3(-1.7f, -2.1f, -1.8f));
    light.type = ES_LIGHT_POINT;
    light.intensity = 0.7f;
    add_light(w, light, es_v3(-1, 0.6f, 0.5f), es_v3(0, 0, -1));
    assert_int_equal(es_world_set_environment(w->world, &(es_environment_desc){.radiance = {0.1f, 0.15f, 0.3f}}), ES_OK);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.0f;
    look(w, camera, es_v3(1.4f, 1.7f, 3.4f), es_v3(-0.6f, 0.7f, -0.6f));
}

static small_world lit_corner(void)
{
    small_world w = small_world_create();
    fill_corner(&w);
    return w;
}

static const char* bounce_name(uint32_t b)
{
    static char name[32];
    if (!b) return "direct";
    snprintf(name, sizeof name, "bounce-%u", b);
    return name;
}

/* Radiance is emission, direct light and every bounce; indirect is every bounce; to the rounding of their sums. */
static void test_images_add_up(void** state)
{
    small_world w = lit_corner();
    for (uint32_t bounces = 0; bounces <= 5; bounces++) {
        es_reference_settings s = reference_settings(WIDTH, HEIGHT, bounces);
        es_reference* reference = trace(&w, &s, 24);
        es_image radiance = traced(reference, "radiance"), indirect = traced(reference, "indirect"), emission = traced(reference, "emission");
        double sums[VALUES] = {0}, all[VALUES];
        for (uint32_t b = 0; b <= bounces; b++) {
            es_image image = traced(reference, bounce_name(b));
            double total = 0;
            for (int i = 0; i < VALUES; i++) {
                if (b) sums[i] += (double)image.pixels[i];
                all[i] = (b ? all[i] : (double)emission.pixels[i]) + (double)image.pixels[i];
                total += (double)image.pixels[i];
                assert_true(image.pixels[i] >= 0 && isfinite(image.pixels[i]));
            }
            assert_true(total > 0);
            es_image_destroy(w.context, &image);
        }
        for (int i = 0; i < VALUES; i++) {
            assert_true(fabs((double)indirect.pixels[i] - sums[i]) <= 1e-6 * sums[i]);
            assert_true(fabs((double)radiance.pixels[i] - all[i]) <= 1e-6 * all[i]);
        }
        assert_true(es_reference_has_image(bounces, bounce_name(bounces)) && !es_reference_has_image(bounces, bounce_name(bounces + 1)));
        es_image none;
        assert_int_equal(es_reference_image(reference, "bounce-77", &none), ES_IMAGE_UNKNOWN);
        es_image_destroy(w.context, &radiance);
        es_image_destroy(w.context, &indirect);
        es_image_destroy(w.context, &emission);
        es_reference_destroy(reference);
    }
    small_world_destroy(&w);
}

/* A bounce is the same light however many follow it. */
static void test_every_number_of_bounces(void** state)
{
    enum { MOST = 6 };
    small_world w = lit_corner();
    measured means[MOST + 1] = {{0, 0}};
    for (uint32_t bounces = MOST;; bounces--) {
        es_reference_settings s = reference_settings(WIDTH, HEIGHT, bounces);
        s.seed = bounces;
        es_reference* reference = trace(&w, &s, 256 / FEWER);
        for (uint32_t b = 0; b <= bounces; b++) {
            measured m = mean_of_reference(&w, reference, bounce_name(b));
            if (bounces == MOST) means[b] = m;
            /* 21 comparisons */
            if (!(fabs(m.value - means[b].value) <= 4 * hypot(m.error, means[b].error))) fail_msg("%s of %u: %g ± %g, of %d: %g ± %g", bounce_name(b), bounces, m.value, m.error, MOST, means[b].value, means[b].error);
            assert_true(b > 4 || m.error < 0.1 * sqrt(FEWER) * m.value);
        }
        es_reference_destroy(reference);
        if (!bounces) break;
    }
    small_world_destroy(&w);
}

/* The error is that of the mean of independent samples with the variance of these: the formula, sample by sample. */
static void test_error_is_of_the_samples(void** state)
{
    enum { SAMPLES = 16 };
    static const char* const names[] = {"direct", "indirect", "bounce-2", "radiance"};
    small_world w = lit_corner();
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 2);
    s.antialias = true;
    es_reference* reference = begin_reference(&w, &s);
    static double before[4][VALUES], sums[4][VALUES], squares[4][VALUES];
    memset(before, 0, sizeof before);
    memset(sums, 0, sizeof sums);
    memset(squares, 0, sizeof squares);
    for (int n = 1; n <= SAMPLES; n++) {
        assert_int_equal(es_reference_add(reference, 1), ES_OK);
        for (int k = 0; k < 4; k++) {
            es_image image = traced(reference, names[k]);
            for (int i = 0; i < VALUES; i++) {
                double x = n * (double)image.pixels[i] - before[k][i];
                before[k][i] += x;
                sums[k][i] += x;
                squares[k][i] += x * x;
            }
            es_image_destroy(w.context, &image);
        }
    }
    for (int k = 0; k < 4; k++) {
        char name[40];
        snprintf(name, sizeof name, "%s-error", names[k]);
        es_image error = traced(reference, name);
        for (int i = 0; i < VALUES; i++) {
            double mean = sums[k][i] / SAMPLES, expected2 = fmax(squares[k][i] / SAMPLES - mean * mean, 0) / (SAMPLES - 1), e = (double)error.pixels[i];
            /* the squares are summed in float, and means come out of images rounded to it: 10^-6 of the squares each */
            if (!(fabs(e * e - expected2) <= 1e-3 * expected2 + 4e-6 * squares[k][i] / SAMPLES)) fail_msg("%s, value %d: error %g, of the samples %g", names[k], i, e, sqrt(expected2));
        }
        es_image_destroy(w.context, &error);
    }
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

/* Over seeds, pixels scatter about the truth by no more than their errors say. The samples are stratified, so that they may scatter less, but an
 * error that is several times too large would stop nothing in time. */
static void test_error_is_honest(void** state)
{
    enum { SEEDS = FEWER > 1 ? 6 : 24, SAMPLES = 32 };
    static const char* const names[] = {"direct", "bounce-1", "radiance"};
    small_world w = lit_corner();
    static double truth[3][VALUES];
    running_mean z2[3] = {0};
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 1);
    s.seed = 12345;
    es_reference* reference = trace(&w, &s, 4096 / FEWER);
    for (int k = 0; k < 3; k++) {
        es_image image = traced(reference, names[k]);
        for (int i = 0; i < VALUES; i++) truth[k][i] = (double)image.pixels[i];
        es_image_destroy(w.context, &image);
    }
    es_reference_destroy(reference);
    for (uint32_t seed = 0; seed < SEEDS; seed++) {
        s.seed = seed;
        reference = trace(&w, &s, SAMPLES);
        for (int k = 0; k < 3; k++) {
            char name[40];
            snprintf(name, sizeof name, "%s-error", names[k]);
            es_image image = traced(reference, names[k]), error = traced(reference, name);
            double difference2 = 0, error2 = 0;
            for (int i = 0; i < VALUES; i++) {
                double d = (double)image.pixels[i] - truth[k][i];
                difference2 += d * d;
                error2 += (double)error.pixels[i] * (double)error.pixels[i];
            }
            mean_add(&z2[k], difference2 / error2);
            es_image_destroy(w.context, &image);
            es_image_destroy(w.context, &error);
        }
        es_reference_destroy(reference);
    }
    for (int k = 0; k < 3; k++) {
        /* the truth's own error is 1 / 128 of it */
        if (!(mean_of(&z2[k]) <= 1.01 + 4 * standard_error_of(&z2[k]) && mean_of(&z2[k]) > 0.05)) fail_msg("%s: the errors' squares are %.3f ± %.3f of what is said", names[k], mean_of(&z2[k]), standard_error_of(&z2[k]));
    }
    small_world_destroy(&w);
}

/* Sampling goes on until the estimate is below the target and no further, and the true error then is not above it. */
static void test_stops_at_an_error(void** state)
{
    small_world w = lit_corner();
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 1);
    es_reference* reference = trace(&w, &s, 8192 / FEWER);
    es_image truth = traced(reference, "radiance");
    es_reference_destroy(reference);
    static const float targets[] = {0.1f, 0.03f};
    for (int t = 0; t < 2; t++) {
        s.seed = 5;
        s.max_error = targets[t];
        reference = begin_reference(&w, &s);
        double before = INFINITY;
        es_reference_stats stats = es_reference_get_stats(reference);
        assert_true(!stats.done && isinf(stats.error));
        while (!stats.done && stats.samples < 4096) {
            before = stats.error;
            assert_int_equal(es_reference_add(reference, 1), ES_OK);
            stats = es_reference_get_stats(reference);
            assert_true(stats.done == (stats.error <= (double)s.max_error));
        }
        assert_true(stats.done && before > (double)s.max_error && stats.samples > 2 && stats.seconds_left == 0);
        es_image image = traced(reference, "radiance"), error = traced(reference, "radiance-error");
        double squares = 0, errors = 0, sum = 0, own = 0;
        for (int i = 0; i < VALUES; i++) {
            double d = (double)image.pixels[i] - (double)truth.pixels[i];
            squares += d * d / VALUES;
            errors += (double)error.pixels[i] * (double)error.pixels[i] / VALUES;
            sum += (double)truth.pixels[i] / VALUES;
            own += (double)image.pixels[i] / VALUES;
        }
        assert_true(fabs(sqrt(errors) / own - stats.error) < 1e-4 * stats.error);
        /* of 324 values that scatter as said, the mean square is off by a twelfth; brighter ones count more: a quarter */
        if (!(sqrt(squares) / sum <= 1.25 * (double)s.max_error)) fail_msg("target %g: %g after %d samples", (double)s.max_error, sqrt(squares) / sum, (int)stats.samples);
        /* nothing more is done */
        uint64_t samples = stats.samples;
        assert_int_equal(es_reference_add(reference, 8), ES_OK);
        assert_int_equal(es_reference_get_stats(reference).samples, samples);
        es_image_destroy(w.context, &image);
        es_image_destroy(w.context, &error);
        es_reference_destroy(reference);
    }
    es_image_destroy(w.context, &truth);
    small_world_destroy(&w);
}

static void test_stops_at_samples_and_seconds(void** state)
{
    small_world w = lit_corner();
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 1);
    s.max_samples = 11;
    es_reference* reference = begin_reference(&w, &s);
    for (int i = 0; i < 4; i++) assert_int_equal(es_reference_add(reference, 4), ES_OK);
    es_reference_stats stats = es_reference_get_stats(reference);
    assert_true(stats.done && stats.samples == 11 && stats.rays >= 11ull * WIDTH * HEIGHT);
    es_reference_destroy(reference);
    s.max_samples = 0;
    s.max_seconds = 1e-6f;
    reference = begin_reference(&w, &s);
    assert_int_equal(es_reference_add(reference, 1), ES_OK);
    assert_true(es_reference_get_stats(reference).done);
    assert_int_equal(es_reference_add(reference, 1), ES_OK);
    assert_int_equal(es_reference_get_stats(reference).samples, 1);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

/* ---- what lets rays through ---------------------------------------------------------------------------------------------------------------------- */

/* Surfaces modelled twice, back to back in one plane: the camera sees the front, whichever of the two comes first. */
static void test_back_to_back(void** state)
{
    for (int first = 0; first < 2; first++) {
        small_world w = small_world_create();
        es_material_desc glowing = lambert(0.5f, 1.0f);
        const es_vec3 corner = es_v3(-3.1f, -2.9f, -1.3f), u = es_v3(6.3f, 0.7f, 0.9f), v = es_v3(-0.4f, 6.1f, 1.1f);
        for (int i = 0; i < 2; i++) {
            if (i == first) add_rectangle(&w, corner, u, v, &glowing);
            else add_rectangle(&w, corner, v, u, &glowing);
        }
        look_straight(&w, es_v3(0, 0, 0), es_v3(0, 0, 1), 5, 1);
        es_reference_settings s = reference_settings(WIDTH, HEIGHT, 0);
        es_reference* reference = trace(&w, &s, 1);
        es_image image = traced(reference, "emission");
        for (size_t i = 0; i < (size_t)3 * WIDTH * HEIGHT; i++) assert_true(image.pixels[i] == 1.0f);
        es_image_destroy(w.context, &image);
        es_reference_destroy(reference);
        small_world_destroy(&w);
    }
}

/* Where an alpha mask is open nothing glows. */
static void test_open_mask_gives_no_light(void** state)
{
    small_world w = small_world_create();
    es_material_desc floor = lambert(0.5f, 0), hole = lambert(0.5f, 10);
    hole.alpha_mask = hole.double_sided = true;
    hole.alpha_cutoff = 0.5f;
    hole.base_color[3] = 0;
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &floor);
    add_rectangle(&w, es_v3(-1, 1, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &hole);
    look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 0.5f, 0.3f);
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 1);
    es_reference* reference = trace(&w, &s, 4);
    es_image image = traced(reference, "radiance");
    for (size_t i = 0; i < (size_t)3 * WIDTH * HEIGHT; i++) assert_true(image.pixels[i] == 0.0f);
    es_image_destroy(w.context, &image);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

/* ---- the same bits ---------------------------------------------------------------------------------------------------------------------------- */

static uint64_t hash_of(small_world* w, es_reference* reference)
{
    static const char* const names[] = {"radiance", "radiance-error", "emission", "direct", "direct-error", "indirect", "indirect-error", "bounce-1", "bounce-2", "bounce-2-error"};
    uint64_t hash = 0;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        es_image image = traced(reference, names[i]);
        uint64_t one = es_image_hash(&image);
        hash = hash * 31 + one;
        es_image_destroy(w->context, &image);
    }
    return hash;
}

/* However samples are divided among calls and threads. */
static void test_determinism(void** state)
{
    uint64_t expected = 0;
    for (uint32_t threads = 1; threads <= 3; threads++) {
        small_world w = {0};
        es_context_desc desc = es_default_context_desc();
        desc.threads = threads;
        assert_int_equal(es_context_create(&desc, &w.context), ES_OK);
        assert_int_equal(es_world_create(w.context, NULL, &w.world), ES_OK);
        fill_corner(&w);
        es_reference_settings s = reference_settings(WIDTH, HEIGHT, 2);
        s.antialias = threads == 2; /* compared with itself only */
        for (uint32_t step = 1; step <= 16; step *= 4) {
            es_reference* reference = begin_reference(&w, &s);
            for (uint32_t done = 0; done < 16; done += step) assert_int_equal(es_reference_add(reference, step), ES_OK);
            uint64_t hash = hash_of(&w, reference);
            if (threads == 2 ? step == 1 : !expected) expected = hash;
            assert_int_equal(hash, expected);
            es_reference_destroy(reference);
        }
        if (threads == 2) expected = 0;
        small_world_destroy(&w);
    }
}

/* A file in the middle changes nothing; one of another world, camera or settings is refused, and what is summed stays. */
static void test_resuming(void** state)
{
#ifdef ES_WITH_OPENEXR
    static const char path[] = "test_reference_resume.exr";
    small_world w = lit_corner();
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 2);
    for (int antialias = 0; antialias < 2; antialias++) {
        s.antialias = antialias;
        es_reference* whole = trace(&w, &s, 16);
        uint64_t expected = hash_of(&w, whole);
        es_reference_stats stats = es_reference_get_stats(whole);
        es_reference_destroy(whole);
        static const uint32_t stops[] = {1, 7, 15};
        for (int i = 0; i < 3; i++) {
            es_reference* first = trace(&w, &s, stops[i]);
            assert_int_equal(es_reference_save(first, path), ES_OK);
            uint64_t saved = hash_of(&w, first);
            es_reference_destroy(first);
            es_reference* second = begin_reference(&w, &s);
            assert_int_equal(es_reference_resume(second, path), ES_OK);
            assert_int_equal(es_reference_get_stats(second).samples, stops[i]);
            assert_int_equal(hash_of(&w, second), saved);
            assert_int_equal(es_reference_add(second, 16 - stops[i]), ES_OK);
            assert_int_equal(hash_of(&w, second), expected);
            es_reference_stats resumed = es_reference_get_stats(second);
            assert_true(resumed.samples == 16 && resumed.error == stats.error);
            es_reference_destroy(second);
        }
    }
    s.seed = 1;
    es_reference* other = trace(&w, &s, 2);
    uint64_t before = hash_of(&w, other);
    assert_int_equal(es_reference_resume(other, path), ES_FILE_UNSUPPORTED);
    assert_int_equal(hash_of(&w, other), before);
    es_reference_destroy(other);
    remove(path);
    small_world_destroy(&w);
#else
    skip();
#endif
}

/* ---- which light is sampled -------------------------------------------------------------------------------------------------------------------- */

/* Beyond the first surface one of the lights is chosen for each vertex. Inside a sphere the first bounce knows only their flux:
 * albedo² Φ / 4 pi² R², and each further one is albedo times that (test_integrating_sphere.c). */
static void test_light_choice(void** state)
{
    enum { SEGMENTS = 32 };
    const double albedo = 0.6;
    small_world w = small_world_create();
    es_material_desc wall = lambert((float)albedo, 0);
    add_sphere(&w, es_v3(0, 0, 0), 1, SEGMENTS, true, &wall);
    es_light_desc light = es_default_light_desc();
    light.type = ES_LIGHT_POINT;
    light.intensity = 0.1f;
    add_light(&w, light, es_v3(0.3f, 0, 0), es_v3(0, 0, -1));
    light.intensity = 8;
    add_light(&w, light, es_v3(-0.5f, 0.2f, 0.3f), es_v3(0, 0, -1));
    light.type = ES_LIGHT_SPOT;
    light.intensity = 5;
    light.inner_cone = 0.4f;
    light.outer_cone = 0.8f;
    add_light(&w, light, es_v3(0, -0.3f, 0.2f), es_v3(1, 0.5f, 0.2f));
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.6f;
    look(&w, camera, es_v3(0, 0.1f, 0.6f), es_v3(0, 0, -1));
    es_reference_settings s = reference_settings(WIDTH, HEIGHT, 3);
    es_reference* reference = trace(&w, &s, 512 / FEWER);
    double flux = 4 * pi * 8.1 + 5 * 2 * pi * (1 - cos(0.4) + (cos(0.4) - cos(0.8)) / 3), expected = albedo * flux / (4 * pi * pi);
    /* facets lie h² / 6 inside on average, so that all is that much nearer to each other (h² / 3), and their normals are off by h / 2 at most */
    const double h = pi / SEGMENTS;
    for (uint32_t b = 1; b <= 3; b++) {
        expected *= albedo;
        measured m = mean_of_reference(&w, reference, bounce_name(b));
        if (!(fabs(m.value - expected) <= 4 * m.error + b * 0.5 * h * h * expected)) fail_msg("%s: %.5f ± %.5f, expected %.5f", bounce_name(b), m.value, m.error, expected);
        assert_true(m.error < 0.02 * sqrt(FEWER) * expected);
    }
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_images_add_up),
        unit_test_without_races(test_every_number_of_bounces),
        unit_test_without_races(test_error_is_of_the_samples),
        unit_test_without_races(test_error_is_honest),
        unit_test_without_races(test_stops_at_an_error),
        unit_test_without_races(test_stops_at_samples_and_seconds),
        unit_test_without_races(test_back_to_back),
        unit_test_without_races(test_open_mask_gives_no_light),
        cmocka_unit_test(test_determinism),
        cmocka_unit_test(test_resuming),
        unit_test_without_races(test_light_choice),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
