/* The sun against published places and times, the light of sun and sky against what is measured outdoors, and the sky as a function of the world's state (sim/sky.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sim/sky.h"
#include "tests/small_worlds.h"

static const double degree = 3.14159265358979323846 / 180;

static void place_of_sun(int year, int month, int day, double hours, double latitude, double longitude, double* elevation, double* azimuth)
{
    double e[3];
    es_sun_position(es_days_since_2000(year, month, day) + hours / 24, latitude * degree, longitude * degree, e);
    assert_true(fabs(e[0] * e[0] + e[1] * e[1] + e[2] * e[2] - 1) < 1e-6);
    *elevation = asin(fmin(fmax(e[1], -1), 1)) / degree;
    *azimuth = atan2(e[0], e[2]) / degree;
    if (*azimuth < 0) *azimuth += 360;
}

static void test_sun_places(void** state)
{
    static const struct { const char* what; int year, month, day; double hours, latitude, longitude, elevation, azimuth, bound; } cases[] = {
        {"NREL SPA (Reda and Andreas 2008), appendix A.5", 2003, 10, 17, 19.508333, 39.742476, -105.1786, 39.872046, 194.340241, 0.02},
        {"equinox of March 2024, 03:06, from the pole", 2024, 3, 20, 3.1, 90, 0, 0, NAN, 0.02},
        {"solstice of June 2024, 20:51", 2024, 6, 20, 20.85, 90, 0, 23.436, NAN, 0.02},
        {"solstice of December 2024, 09:20", 2024, 12, 21, 9.333, 90, 0, -23.436, NAN, 0.02},
        {"equinox of September 2023, 06:50", 2023, 9, 23, 6.833, 90, 0, 0, NAN, 0.02},
        {"the same from the other pole", 2023, 9, 23, 6.833, -90, 0, 0, NAN, 0.02},
        {"noon of Greenwich, November 2024: the equation of time is 16 min 26 s", 2024, 11, 3, 12 - 16.433 / 60, 51.4779, 0, NAN, 180, 0.1},
        {"noon of Greenwich, February 2024: -14 min 13 s", 2024, 2, 11, 12 + 14.217 / 60, 51.4779, 0, NAN, 180, 0.1},
        {"sunrise in London, 03:43, refraction and radius -0.833", 2024, 6, 21, 3.7167, 51.5074, -0.1278, -0.833, NAN, 0.3},
        {"a day later, as hours", 2024, 6, 20, 27.7167, 51.5074, -0.1278, -0.833, NAN, 0.3},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double elevation, azimuth;
        place_of_sun(cases[i].year, cases[i].month, cases[i].day, cases[i].hours, cases[i].latitude, cases[i].longitude, &elevation, &azimuth);
        if (!isnan(cases[i].elevation) && !(fabs(elevation - cases[i].elevation) < cases[i].bound)) fail_msg("%s: elevation %.4f, not %.4f", cases[i].what, elevation, cases[i].elevation);
        if (!isnan(cases[i].azimuth) && !(fabs(azimuth - cases[i].azimuth) < cases[i].bound)) fail_msg("%s: azimuth %.4f, not %.4f", cases[i].what, azimuth, cases[i].azimuth);
    }
    assert_true(es_days_since_2000(2000, 1, 1) == -0.5 && es_days_since_2000(1970, 1, 1) == -10957.5 && es_days_since_2000(2024, 3, 1) - es_days_since_2000(2024, 2, 28) == 2);
}

static double luminance(const float* c) { return 0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2]; }

/* Illuminance on the ground, lux, of the sky alone. */
static double sky_lux(const float* pixels)
{
    double sum = 0;
    for (uint32_t y = 0; y < ES_SKY_HEIGHT / 2; y++)
        for (uint32_t x = 0; x < ES_SKY_WIDTH; x++) {
            double polar = 3.14159265358979323846 * (y + 0.5) / ES_SKY_HEIGHT;
            sum += luminance(pixels + 3 * (y * ES_SKY_WIDTH + x)) * sin(polar) * cos(polar) * pow(3.14159265358979323846, 2) * 2 / ES_SKY_WIDTH / ES_SKY_HEIGHT;
        }
    return sum * 179;
}

/* Textbook daylight: 100 klx of sun at a high sun, 10 … 20 klx of clear sky, of which this model makes up to twice as much, a few hundred lux at sunset, a few at the end of civil twilight. */
static void test_daylight(void** state)
{
    small_world w = small_world_create();
    float* pixels = malloc(sizeof(float) * 3 * ES_SKY_WIDTH * ES_SKY_HEIGHT);
    static const struct { double elevation, least, most; } skies[] = {{60, 8e3, 35e3}, {30, 6e3, 28e3}, {5, 1.5e3, 12e3}, {0, 300, 1.5e3}, {-6, 1, 20}, {-12, 0.002, 0.1}, {-40, 1e-4, 1e-2}};
    for (size_t i = 0; i < sizeof skies / sizeof *skies; i++) {
        es_sky_picture p = {(float)(skies[i].elevation * degree), 3, {0.2f, 0.2f, 0.2f}};
        es_sky_draw(w.context, &p, pixels);
        double lux = sky_lux(pixels);
        if (getenv("ES_PRINT")) printf("sun at %g: %.4g lux of sky\n", skies[i].elevation, lux);
        if (!(lux > skies[i].least && lux < skies[i].most)) fail_msg("sun at %g degrees: %.4g lux of sky", skies[i].elevation, lux);
        for (int t = 0; t < 3 * ES_SKY_WIDTH * ES_SKY_HEIGHT; t++) assert_true(pixels[t] >= 0 && pixels[t] < 1e4f);
    }
    float high[3], low[3], set[3];
    es_sun_irradiance(60 * degree, 3, high);
    es_sun_irradiance(3 * degree, 3, low);
    es_sun_irradiance(-1 * degree, 3, set);
    assert_true(luminance(high) * 179 > 70e3 && luminance(high) * 179 < 125e3);
    assert_true(luminance(low) < 0.3 * luminance(high) && low[0] / low[2] > 2 * high[0] / high[2]); /* redder */
    assert_true(set[0] == 0 && set[1] == 0 && set[2] == 0);
    /* a clear sky is blue at the zenith, and brightest around the sun, which is in the middle column */
    es_sky_picture p = {(float)(40 * degree), 2.5f, {0.2f, 0.2f, 0.2f}};
    es_sky_draw(w.context, &p, pixels);
    const float* zenith = pixels + 3 * (2 * ES_SKY_WIDTH);
    assert_true(zenith[2] > 1.3f * zenith[0]);
    uint32_t brightest = 0;
    for (uint32_t i = 0; i < ES_SKY_WIDTH * ES_SKY_HEIGHT; i++)
        if (pixels[3 * i + 1] > pixels[3 * brightest + 1]) brightest = i;
    assert_true(abs((int)(brightest % ES_SKY_WIDTH) - ES_SKY_WIDTH / 2) <= 1 && abs((int)(brightest / ES_SKY_WIDTH) - ES_SKY_HEIGHT * 50 / 180) <= 2);
    free(pixels);
    small_world_destroy(&w);
}

/* A day in five seconds: sun and environment go on with the world, come back with a state, and are the same however time was cut. */
static void test_world_of_sky(void** state)
{
    small_world w = small_world_create();
    es_light_desc light = es_default_light_desc();
    light.type = ES_LIGHT_DIRECTIONAL;
    light.node = node_towards(&w, es_v3(0, 3, 0), es_v3(0, -1, 0));
    es_light sun;
    assert_int_equal(es_world_add_light(w.world, &light, &sun), ES_OK);
    es_sky_desc sky = es_default_sky_desc(), got;
    assert_false(es_world_get_sky(w.world, &got));
    assert_int_equal(es_world_set_sky(w.world, NULL), ES_OK);
    sky.sun = sun;
    sky.latitude = 0.8f;
    sky.speed = 86400 / 5.0f;
    sky.seconds = 12 * 3600;
    es_sky_desc bad = sky;
    bad.month = 13;
    assert_int_equal(es_world_set_sky(w.world, &bad), ES_INVALID_ARGUMENT);
    bad = sky;
    bad.day = 32;
    assert_int_equal(es_world_set_sky(w.world, &bad), ES_INVALID_ARGUMENT);
    bad = sky;
    bad.turbidity = NAN;
    assert_int_equal(es_world_set_sky(w.world, &bad), ES_INVALID_ARGUMENT);
    bad = sky;
    bad.sun.id = 12345;
    assert_int_equal(es_world_set_sky(w.world, &bad), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_set_sky(w.world, &sky), ES_OK);
    es_environment_desc environment;
    assert_true(es_world_get_environment(w.world, &environment) && environment.image && environment.image->width == ES_SKY_WIDTH);

    size_t size = 0;
    assert_int_equal(es_world_save(w.world, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_int_equal(es_world_save(w.world, saved, &size), ES_OK);
    const uint64_t at_noon = es_image_hash(environment.image);
    uint64_t picture[2];
    es_sun suns[2];
    for (int pass = 0; pass < 2; pass++) {
        const int steps = pass ? 64 : 16;
        for (int i = 0; i < steps; i++) assert_int_equal(es_world_step(w.world, 1.0f / (float)steps), ES_OK);
        es_sun s = es_world_sun(w.world);
        /* the light shines from where the sun is */
        size_t count;
        const es_light_state* lights = es_world_lights(w.world, &count);
        assert_int_equal(count, 1);
        assert_true(fabsf(es_v3_dot(lights[0].direction, s.direction) + 1) < 1e-5f && fabsf(lights[0].radiant[1] - s.irradiance[1]) < 1e-3f * s.irradiance[1]);
        /* 16:48 at 0 degrees of longitude: west, which is -x; and the brightest of the picture is there, too */
        assert_true(s.direction.x < -0.5f && s.direction.y > 0.1f);
        assert_true(es_world_get_environment(w.world, &environment));
        uint32_t brightest = 0;
        for (uint32_t i = 0; i < ES_SKY_WIDTH * ES_SKY_HEIGHT; i++)
            if (environment.image->pixels[3 * i] > environment.image->pixels[3 * brightest]) brightest = i;
        double azimuth = 2 * 3.14159265358979323846 * ((brightest % ES_SKY_WIDTH + 0.5) / ES_SKY_WIDTH - 0.5) - (double)environment.rotation;
        assert_true(fabs(sin(azimuth - atan2((double)s.direction.x, -(double)s.direction.z))) < 0.03 && cos(azimuth - atan2((double)s.direction.x, -(double)s.direction.z)) > 0);
        suns[pass] = s;
        picture[pass] = es_image_hash(environment.image);
        if (!pass) {
            assert_int_equal(es_world_restore(w.world, saved, size), ES_OK);
            assert_true(es_world_get_environment(w.world, &environment) && es_image_hash(environment.image) == at_noon);
        }
    }
    assert_true(memcmp(&suns[0], &suns[1], sizeof suns[0]) == 0 && picture[0] == picture[1] && picture[0] != at_noon);
    assert_true(es_world_get_sky(w.world, &got) && fabs(got.seconds - (12 * 3600 + 86400 / 5)) < 1);
    /* at night there is no sun */
    for (int i = 0; i < 10; i++) assert_int_equal(es_world_step(w.world, 0.15f), ES_OK);
    size_t count;
    es_world_lights(w.world, &count);
    assert_int_equal(count, 0);
    assert_true(es_world_sun(w.world).elevation < 0);
    assert_int_equal(es_world_set_environment(w.world, NULL), ES_OK);
    assert_false(es_world_get_sky(w.world, &got));
    assert_int_equal(es_world_restore(w.world, saved, size), ES_WRONG_STATE);
    free(saved);

    /* wherever north is, the state is one that can be restored */
    sky.north = 1000;
    sky.seconds = 18 * 3600;
    assert_int_equal(es_world_set_sky(w.world, &sky), ES_OK);
    assert_int_equal(es_world_save(w.world, NULL, &size), ES_OK);
    saved = malloc(size);
    assert_int_equal(es_world_save(w.world, saved, &size), ES_OK);
    assert_int_equal(es_world_restore(w.world, saved, size), ES_OK);
    free(saved);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sun_places),
        cmocka_unit_test(test_daylight),
        cmocka_unit_test(test_world_of_sky),
    };
    return cmocka_run_group_tests_name("sky", tests, NULL, NULL);
}
