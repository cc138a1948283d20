/* Light from 1e-20 to 1e20, and surfaces from black to white: pictures scale with their lamps.
 *
 * A power of two changes no mantissa, so the radiance of every method and of the reference stays the same but for its exponent, bit for bit.
 * A threshold in watts anywhere would break that, and so would whatever underflows or overflows. Other factors round differently: relRMSE
 * of the radiance stays below 1e-5. What is displayed lies in 0 … 1 throughout. */
#include "tests/stress/stress.h"

enum { WIDTH = 48, HEIGHT = 36, LIGHTS_MAX = 8 };

typedef struct setting { const char* name; uint32_t method, bias; } setting;

static const setting methods[] = {{"direct only", ES_GI_NONE, 0}, {"ism", ES_GI_ISM, 0}, {"classic", ES_GI_CLASSIC, 0}, {"traced", ES_GI_VPL_TRACED, ES_TRACED_BOUNDED},
    {"unbounded", ES_GI_VPL_TRACED, ES_TRACED_UNBOUNDED}, {"compensated", ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED}};
enum { METHODS = sizeof methods / sizeof *methods, REFERENCE = METHODS };

static void multiply_lights(stress* s, double factor)
{
    uint32_t ids[LIGHTS_MAX];
    size_t count = LIGHTS_MAX;
    assert_int_equal(es_world_enumerate(s->world, ES_OBJECT_LIGHT, ids, &count), ES_OK);
    for (size_t i = 0; i < count; i++) {
        es_light_desc d;
        assert_int_equal(es_world_get_light(s->world, (es_light){ids[i]}, &d), ES_OK);
        d.intensity = (float)((double)d.intensity * factor);
        assert_int_equal(es_world_set_light(s->world, (es_light){ids[i]}, &d), ES_OK);
    }
    assert_int_equal(es_world_step(s->world, 0), ES_OK);
}

static es_renderer_settings settings_of(size_t method)
{
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, methods[method].method);
    settings.vpls = 64;
    settings.shadow_size = 256;
    settings.traced_bias = methods[method].bias;
    settings.traced_samples = 4;
    return settings;
}

static void assert_displayed(stress* s, es_renderer* renderer, const char* what)
{
    es_image image = stress_image(renderer, "display");
    for (size_t i = 0; i < values_of(&image); i++)
        if (!(image.pixels[i] >= 0 && image.pixels[i] <= 1)) fail_msg("%s: %g is displayed", what, (double)image.pixels[i]);
    es_image_destroy(s->context, &image);
}

static double reference_error; /* of light times 1 */

/* The radiance with all lamps multiplied. */
static es_image radiance_of(stress* s, size_t method, double factor)
{
    es_image image;
    multiply_lights(s, factor);
    if (method == REFERENCE) {
        es_reference_settings settings = es_default_reference_settings();
        settings.width = WIDTH / 2;
        settings.height = HEIGHT / 2;
        settings.bounces = 2;
        es_reference* reference;
        assert_int_equal(es_reference_create(s->context, &settings, &reference), ES_OK);
        assert_int_equal(es_reference_begin(reference, s->world), ES_OK);
        assert_int_equal(es_reference_add(reference, 8), ES_OK);
        assert_int_equal(es_reference_image(reference, "radiance", &image), ES_OK);
        /* the estimate of its error scales too */
        double error = es_reference_get_stats(reference).error;
        if (!(error > 0.05 && error < 20)) fail_msg("reference, light times %g: relRMSE is said to be %g", factor, error);
        if (factor == 1) reference_error = error;
        if (!(fabs(error / reference_error - 1) < 1e-4)) fail_msg("reference, light times %g: relRMSE is said to be %g, of the light itself %g", factor, error, reference_error);
        es_reference_destroy(reference);
    } else {
        es_renderer_settings settings = settings_of(method);
        es_renderer* renderer = stress_render(s, &settings);
        image = stress_image(renderer, "radiance");
        assert_all_finite(s, renderer, methods[method].name);
        for (uint32_t map = ES_TONE_MAP_REINHARD; map <= ES_TONE_MAP_LINEAR; map++)
            for (int stops = -20; stops <= 20; stops += 20) {
                settings.tone_map = map;
                settings.exposure = (float)stops;
                assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
                assert_int_equal(es_renderer_render(renderer, s->world), ES_OK);
                assert_displayed(s, renderer, methods[method].name);
            }
        es_renderer_destroy(renderer);
    }
    multiply_lights(s, 1 / factor);
    return image;
}

static void scales_with_the_lamps(void** state)
{
    (void)state;
    stress s = stress_open(1, es_v3(0, 0, 0));
    stress_room(&s);
    for (size_t method = 0; method <= REFERENCE; method++) {
        const char* name = method == REFERENCE ? "reference" : methods[method].name;
        es_image one = radiance_of(&s, method, 1);
        /* 30 W/sr times 2^61 is 7e19, 1.5 W/m² times 2^-67 is 1e-20 */
        const int exponents[] = {-67, -31, 33, 61};
        for (int i = 0; i < 4; i++) {
            double factor = ldexp(1, exponents[i]);
            es_image other = radiance_of(&s, method, factor);
            size_t different = 0;
            for (size_t k = 0; k < values_of(&one); k++) different += other.pixels[k] != (float)((double)one.pixels[k] * factor);
            if (different) fail_msg("%s, light times 2^%d: %zu of %zu values differ", name, exponents[i], different, values_of(&one));
            es_image_destroy(s.context, &other);
        }
        const double factors[] = {1e-20, 1e-10, 1e10, 3e18};
        for (int i = 0; i < 4; i++) {
            es_image other = radiance_of(&s, method, factors[i]);
            difference d = difference_of(&other, &one, factors[i]);
            printf("    %-12s light times %g: relRMSE %.1e, max %.1e\n", name, factors[i], d.relrmse, d.max);
            if (!(d.relrmse <= 1e-5)) fail_msg("%s, light times %g: the radiance does not scale", name, factors[i]);
            es_image_destroy(s.context, &other);
        }
        es_image_destroy(s.context, &one);
    }
    stress_close(&s);
}

/* ---- lamps that differ by as much ----------------------------------------------------------------------------------------------------- */

/* Beside a lamp of 1e20 another of 1e-20 changes nothing, and alone it still lights. */
static void strong_beside_weak(void** state)
{
    (void)state;
    for (size_t method = 1; method < METHODS; method++) {
        double mean[3];
        for (int which = 0; which < 3; which++) {
            stress s = stress_open(1, es_v3(0, 0, 0));
            const es_material_desc white = matte(0.8f, 0.8f, 0.8f), gold = polished(0.9f, 0.7f, 0.3f, 0.3f);
            stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &white);
            stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &gold);
            if (which != 1) stress_light(&s, ES_LIGHT_POINT, 1e20f, es_v3(0.5f, 1.5f, 0), es_v3(0, -1, 0));
            if (which != 2) stress_light(&s, ES_LIGHT_POINT, 1e-20f, es_v3(-0.5f, 1.5f, 0), es_v3(0, -1, 0));
            stress_look(&s, es_v3(0, 1.2f, 4), es_v3(0, 0.8f, 0), 0.9f, 0.05f);
            es_renderer_settings settings = settings_of(method);
            es_renderer* renderer = stress_render(&s, &settings);
            assert_all_finite(&s, renderer, methods[method].name);
            assert_displayed(&s, renderer, methods[method].name);
            es_image image = stress_image(renderer, "radiance");
            mean[which] = mean_of_image(&image);
            es_image_destroy(s.context, &image);
            es_renderer_destroy(renderer);
            stress_close(&s);
        }
        assert_true(mean[0] > 1e18 && fabs(mean[0] / mean[2] - 1) < 0.05);
        assert_true(mean[1] > 1e-22 && mean[1] < 1e-20);
    }
}

/* ---- surfaces ------------------------------------------------------------------------------------------------------------------------- */

static double mean_in_room_of(const es_material_desc* floor, const es_material_desc* rest, size_t method, const char* image_name)
{
    stress s = stress_open(1, es_v3(0, 0, 0));
    stress_rectangle(&s, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), floor);
    stress_rectangle(&s, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), rest);
    stress_ball(&s, es_v3(0, 0.7f, -0.6f), 0.7f, 12, false, rest);
    stress_light(&s, ES_LIGHT_SPOT, 30, es_v3(0.3f, 2.8f, 0.9f), es_v3(-0.2f, -1, -0.5f));
    stress_light(&s, ES_LIGHT_POINT, 2, es_v3(-1.4f, 2.1f, 1.1f), es_v3(0, -1, 0));
    stress_look(&s, es_v3(0.1f, 1.5f, 4.4f), es_v3(0, 1.2f, 0), 0.9f, 0.05f);
    es_renderer_settings settings = settings_of(method);
    es_renderer* renderer = stress_render(&s, &settings);
    assert_all_finite(&s, renderer, methods[method].name);
    assert_displayed(&s, renderer, methods[method].name);
    es_image image = stress_image(renderer, image_name);
    double mean = mean_of_image(&image);
    es_image_destroy(s.context, &image);
    es_renderer_destroy(renderer);
    stress_close(&s);
    return mean;
}

static void black_and_white(void** state)
{
    (void)state;
    es_material_desc black = matte(0, 0, 0), white = matte(1, 1, 1), black_mirror = polished(0, 0, 0, 0), mirror = polished(1, 1, 1, 0), glow = matte(0, 0, 0);
    glow.emission[0] = glow.emission[1] = glow.emission[2] = 1e9f;
    es_material_desc phong = es_default_material_desc();
    phong.model = ES_SURFACE_PHONG;
    phong.exponent = 50;
    for (size_t method = 1; method < METHODS; method++) {
        assert_true(mean_in_room_of(&black, &black, method, "radiance") == 0);
        assert_true(mean_in_room_of(&black, &white, method, "direct") > 0.01);
        /* a black floor reflects nothing to a white wall, but the wall and the ball light each other; with a black rest nothing is lit twice */
        assert_true(mean_in_room_of(&white, &black, method, "indirect") == 0);
        assert_true(mean_in_room_of(&white, &white, method, "indirect") > mean_in_room_of(&black, &white, method, "indirect"));
        const es_material_desc* odd[] = {&black_mirror, &mirror, &glow, &phong};
        for (int i = 0; i < 4; i++) {
            double mean = mean_in_room_of(odd[i], &white, method, "radiance");
            assert_true(mean > 0 && mean < 1e5);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scales_with_the_lamps),
        cmocka_unit_test(strong_beside_weak),
        cmocka_unit_test(black_and_white),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
