/* Sampled lights against the sums they stand for, and indirect light at half the resolution. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/small_worlds.h"
#include "tests/statistics.h"

enum { WIDTH = 48, HEIGHT = 36, FRAMES = 24 };

/* A corner of two colours, a plate and, where asked for, glossy surfaces. */
static small_world corner(bool glossy)
{
    small_world w = small_world_create();
    es_material_desc floor = lambert(0.7f, 0), red = lambert(0.6f, 0), plate = lambert(0.5f, 0);
    red.base_color[1] = 0.1f;
    if (glossy) {
        floor.specular = plate.specular = 1;
        floor.roughness = plate.roughness = 0.4f;
        plate.metallic = 1;
    }
    add_rectangle(&w, es_v3(-2, 0, -2), es_v3(0, 0, 4), es_v3(4, 0, 0), &floor);
    add_rectangle(&w, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 3, 0), &red);
    add_rectangle(&w, es_v3(-0.5f, 0.05f, -0.9f), es_v3(0, 0.8f, 0.3f), es_v3(1.1f, 0, 0.3f), &plate);
    es_light_desc light = es_default_light_desc();
    light.intensity = 10;
    add_light(&w, light, es_v3(-0.4f, 1.8f, 0.6f), es_v3(0, -1, 0));
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.0f;
    look(&w, camera, es_v3(1.2f, 1.5f, 3.2f), es_v3(-0.4f, -0.2f, -1));
    return w;
}

static es_renderer_settings settings_of(uint32_t method)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.method = method;
    s.traced_interleave = true;
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 256;
    s.light_size = 64;
    s.shadow_size = 64;
    s.interleave = 4;
    s.view_importance = false;
    return s;
}

static es_image picture_of(es_renderer* renderer, small_world* w, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

/* The mean over sets of lights, of a picture divided into blocks of 12 × 12 pixels. */
enum { BLOCK = 12, BLOCKS = WIDTH / BLOCK * (HEIGHT / BLOCK) };

static void block_means(small_world* w, es_renderer_settings s, double means[BLOCKS])
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, &s, &renderer), ES_OK);
    for (int b = 0; b < BLOCKS; b++) means[b] = 0;
    for (uint32_t frame = 0; frame < FRAMES; frame++) {
        s.seed = frame * s.vpls;
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        es_image image = picture_of(renderer, w, "indirect");
        for (uint32_t y = 0; y < HEIGHT; y++)
            for (uint32_t x = 0; x < WIDTH; x++)
                for (int k = 0; k < 3; k++) means[y / BLOCK * (WIDTH / BLOCK) + x / BLOCK] += (double)image.pixels[((size_t)y * WIDTH + x) * 3 + k] / (BLOCK * BLOCK * 3 * FRAMES);
        es_image_destroy(w->context, &image);
    }
    es_renderer_destroy(renderer);
}

static void compare(bool glossy, es_renderer_settings sampled, es_renderer_settings summed, double bound)
{
    small_world w = corner(glossy);
    double a[BLOCKS], b[BLOCKS], mean = 0, worst = 0;
    block_means(&w, sampled, a);
    block_means(&w, summed, b);
    for (int i = 0; i < BLOCKS; i++) mean += b[i] / BLOCKS;
    for (int i = 0; i < BLOCKS; i++) worst = fmax(worst, fabs(a[i] - b[i]) / mean);
    assert_true(mean > 0);
    if (!(worst < bound)) fail_msg("a block is off by %.4f of the picture's mean", worst);
    small_world_destroy(&w);
}

/* 144 pixels × 24 frames: standard errors of about 1 %. */
static void test_mean(void** state)
{
    es_renderer_settings sampled = settings_of(ES_GI_VPL_SAMPLED), summed = settings_of(ES_GI_VPL_TRACED);
    sampled.near_distance = 0;
    compare(false, sampled, summed, 0.04);
    compare(true, sampled, summed, 0.06);
}

/* With near light found by rays nothing is left out: the mean is that of lights without a bound, of which more are needed for it. */
static void test_near(void** state)
{
    es_renderer_settings sampled = settings_of(ES_GI_VPL_SAMPLED), summed = settings_of(ES_GI_VPL_TRACED);
    sampled.near_distance = 0.1f;
    summed.traced_bias = ES_TRACED_COMPENSATED;
    summed.traced_samples = 4;
    summed.geometry_bound = 25;
    summed.spread = 0;
    summed.filter_passes = sampled.filter_passes = 0;
    compare(false, sampled, summed, 0.06);
}

/* ---- half the resolution ------------------------------------------------------------------------------------------------- */

/* Pixels of even column and row are those of the smaller picture; every pixel has the light of one next to it, or a mean. */
static void test_half(void** state)
{
    small_world w = corner(false);
    es_renderer_settings s = settings_of(ES_GI_VPL_TRACED);
    s.traced_interleave = false;
    s.filter_normal = 0.99f;
    es_renderer *whole, *half;
    assert_int_equal(es_renderer_create(w.context, &s, &whole), ES_OK);
    s.half_resolution = true;
    assert_int_equal(es_renderer_create(w.context, &s, &half), ES_OK);
    es_image a = picture_of(whole, &w, "irradiance"), b = picture_of(half, &w, "irradiance");
    uint32_t exact = 0;
    double difference = 0, sum = 0;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            double p = (double)a.pixels[((size_t)y * WIDTH + x) * 3], q = (double)b.pixels[((size_t)y * WIDTH + x) * 3];
            difference += fabs(p - q);
            sum += p;
            if (x % 2 || y % 2) continue;
            exact += fabs(p - q) <= 1e-4 * fabs(p);
        }
    /* rays of the smaller image are rounded differently: a few go the other side of an edge */
    assert_true(exact * 100 >= 98u * (WIDTH / 2) * (HEIGHT / 2));
    assert_true(difference < 0.05 * sum);
    es_image_destroy(w.context, &a);
    es_image_destroy(w.context, &b);
    es_renderer_destroy(whole);
    es_renderer_destroy(half);
    small_world_destroy(&w);
}

/* Odd and tiny sizes, lobes and all methods; and a picture of one pixel is that of the whole resolution. */
static void test_sizes(void** state)
{
    small_world w = corner(true);
    static const uint32_t sizes[][2] = {{1, 1}, {2, 1}, {1, 3}, {17, 5}, {33, 31}};
    for (uint32_t method = ES_GI_ISM; method <= ES_GI_VPL_SAMPLED; method++)
        for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
            es_renderer_settings s = settings_of(method);
            s.width = sizes[i][0];
            s.height = sizes[i][1];
            s.vpls = 20;
            s.ism_pool = s.ism_points = 256;
            s.classic_size = 32;
            s.half_resolution = true;
            es_renderer* renderer;
            assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
            es_image image = picture_of(renderer, &w, "indirect"), raw = {0};
            assert_int_equal(es_renderer_image(renderer, "indirect-unfiltered", &raw), ES_OK);
            for (size_t p = 0; p < (size_t)image.width * image.height * 3; p++) assert_true(image.pixels[p] >= 0 && raw.pixels[p] >= 0 && image.pixels[p] < 1e6f);
            if (i == 0) {
                s.half_resolution = false;
                assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
                es_image one = picture_of(renderer, &w, "indirect");
                assert_memory_equal(one.pixels, image.pixels, 3 * sizeof(float));
                es_image_destroy(w.context, &one);
            }
            es_image_destroy(w.context, &image);
            es_image_destroy(w.context, &raw);
            es_renderer_destroy(renderer);
        }
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mean),
        cmocka_unit_test(test_near),
        cmocka_unit_test(test_half),
        cmocka_unit_test(test_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
