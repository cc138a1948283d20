/* The environment's octahedral maps against sums over the image in double: no power is lost, directions are where they belong, irradiance and lobes
 * are what they are said to be, and sets of lights have all of the light (gi/environment.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/environment.h"
#include "gi/pixel_rays.h"
#include "gi/reference/scene.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/reference_runs.h"


enum { MOST = 256 };

typedef struct answers { float radiance[3][MOST], irradiance[3][MOST]; } answers;

static es_context* new_context(void)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

/* `count` directions all over the sphere. */
static void spread(uint32_t count, float d[3][MOST])
{
    for (uint32_t i = 0; i < count; i++) {
        double y = 1 - (2 * i + 1.0) / count, s = sqrt(1 - y * y), turn = i * 2.39996322972865332;
        d[0][i] = (float)(s * sin(turn));
        d[1][i] = (float)y;
        d[2][i] = (float)(s * cos(turn));
    }
}

static void ask(const es_context* context, const es_environment_map* map, float d[3][MOST], float roughness, answers* a)
{
    float rough[MOST];
    for (int i = 0; i < MOST; i++) rough[i] = roughness;
    es_environment_question q = {.x = d[0], .y = d[1], .z = d[2], .roughness = rough, .count = MOST};
    for (int k = 0; k < 3; k++) {
        q.radiance[k] = a->radiance[k];
        q.irradiance[k] = a->irradiance[k];
    }
    es_environment_ask(context, &map->lookup, &q);
}

/* ---- the image in double ------------------------------------------------------------------------------------------------ */

typedef struct place { double d[3], solid_angle; } place;

/* The middle of part (x, y) of width × height, as es_environment_desc says where it is. */
static place place_of(uint32_t x, uint32_t y, uint32_t width, uint32_t height, double rotation)
{
    double polar = pi * (y + 0.5) / height, azimuth = 2 * pi * ((x + 0.5) / width - 0.5) - rotation;
    return (place){{sin(polar) * sin(azimuth), cos(polar), -sin(polar) * cos(azimuth)}, 2 * pi / width * (cos(pi * y / height) - cos(pi * (y + 1.0) / height))};
}

/* Sum over the image of radiance × weight(cosine with n), each texel in parts × parts. */
typedef double (*weight_function)(double cosine, double alpha);
static double facing(double cosine, double alpha) { return fmax(cosine, 0); }
static double everywhere(double cosine, double alpha) { return 1; }
/* N = V = R: the density D / 4 of mirrored directions, times the cosine; to be divided by its own sum */
static double lobe(double cosine, double alpha)
{
    double half = (1 + cosine) / 2, t = half * (alpha * alpha - 1) + 1;
    return cosine > 0 ? cosine * alpha * alpha / (4 * pi * t * t) : 0;
}
static double gathered(const es_image* image, int channel, double rotation, uint32_t parts, const double n[3], weight_function weight, double alpha, double* weights)
{
    double sum = 0, all = 0;
    for (uint32_t y = 0; y < image->height * parts; y++)
        for (uint32_t x = 0; x < image->width * parts; x++) {
            place p = place_of(x, y, image->width * parts, image->height * parts, rotation);
            double w = p.solid_angle * weight(p.d[0] * n[0] + p.d[1] * n[1] + p.d[2] * n[2], alpha);
            all += w;
            sum += w * (double)image->pixels[3 * ((size_t)(y / parts) * image->width + x / parts) + (size_t)channel];
        }
    if (weights) *weights = all;
    return sum;
}

static es_image new_image(es_context* context, uint32_t width, uint32_t height)
{
    es_image image;
    assert_int_equal(es_image_create(context, width, height, 3, &image), ES_OK);
    return image;
}

/* A bright patch on a dim sky over a dark ground, and noise. */
static void fill_sky(es_image* image)
{
    for (uint32_t y = 0; y < image->height; y++)
        for (uint32_t x = 0; x < image->width; x++) {
            place p = place_of(x, y, image->width, image->height, 0);
            float* t = image->pixels + 3 * ((size_t)y * image->width + x);
            double sun = p.d[0] * 0.6 + p.d[1] * 0.48 + p.d[2] * 0.64;
            for (int k = 0; k < 3; k++)
                t[k] = (float)((p.d[1] > 0 ? 1 + 0.5 * p.d[1] * k : 0.1) * (0.75 + 0.5 * (double)es_random_float(5, (uint32_t)(3 * (y * image->width + x)) + (uint32_t)k)) + (sun > 0.995 ? 200 : 0));
        }
}

/* ---- tests -------------------------------------------------------------------------------------------------------------- */

static void level_sum(const es_environment_map* map, const es_environment_pyramid* p, uint32_t level, double sum[4])
{
    const uint32_t size = (uint32_t)p->size[level], stride = size + 2;
    uint32_t same = 0;
    while ((uint32_t)map->means.size[same] != size) same++;
    const float *texels = p->texels + 4 * (size_t)p->first[level], *solid = map->means.texels + 4 * (size_t)map->means.first[same];
    memset(sum, 0, 4 * sizeof *sum);
    for (uint32_t y = 1; y <= size; y++)
        for (uint32_t x = 1; x <= size; x++) {
            size_t at = 4 * ((size_t)y * stride + x);
            for (int k = 0; k < 3; k++) sum[k] += (double)texels[at + (size_t)k] * (double)solid[at + 3];
            sum[3] += (double)solid[at + 3];
        }
}

static void expect_power(const es_environment_map* map, const double power[3], const char* what)
{
    for (uint32_t level = 0; level < map->means.levels + map->lookup.lobes.levels; level++) {
        double sum[4];
        if (level < map->means.levels) level_sum(map, &map->means, level, sum);
        else level_sum(map, &map->lookup.lobes, level - map->means.levels, sum);
        assert_true(fabs(sum[3] / (4 * pi) - 1) < 2e-5);
        for (int k = 0; k < 3; k++)
            if (!(fabs(sum[k] - power[k]) <= 3e-5 * power[k])) fail_msg("%s, level %u, channel %d: power %.7g, the image has %.7g", what, level, k, sum[k], power[k]);
    }
    for (uint32_t count = 1; count <= 512; count = count * 5 + 2) {
        static es_environment_light lights[512];
        uint32_t written = es_environment_sample(map, count, count, lights);
        double sum[3] = {0}, solid = 0;
        assert_true(written <= count);
        for (uint32_t i = 0; i < written; i++) {
            assert_true(fabsf(es_v3_length(lights[i].direction) - 1) < 1e-5f);
            for (int k = 0; k < 3; k++) sum[k] += (double)lights[i].irradiance[k];
            solid += (double)lights[i].solid_angle;
        }
        assert_true(solid <= 4 * pi * 1.0001);
        for (int k = 0; k < 3; k++)
            if (!(fabs(sum[k] - power[k]) <= 3e-5 * power[k])) fail_msg("%s, %u of %u lights, channel %d: power %.7g, the image has %.7g", what, written, count, k, sum[k], power[k]);
    }
}

static void test_power(void** state)
{
    static const struct { const char* what; uint32_t width, height, bright; float rotation; } cases[] = {
        {"one texel of 4 × 2", 4, 2, 5, 0.3f}, {"64 × 32", 64, 32, 100, -2}, {"a texel at the pole", 64, 32, 3, 0}, {"37 × 19", 37, 19, 350, 999}, {"a texel below", 100, 50, 4990, 0.1f},
#ifndef __SANITIZE_ADDRESS__
        {"1024 × 512", 1024, 512, 200000, 1}, {"a column", 3, 1000, 1, 2},
#endif
    };
    es_context* context = new_context();
    es_environment_map map = {0};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        es_image image = new_image(context, cases[i].width, cases[i].height);
        for (size_t t = 0; t < (size_t)image.width * image.height * 3; t++) image.pixels[t] = 1e-6f * (float)(1 + t % 3);
        for (uint32_t k = 0; k < 3; k++) image.pixels[3 * cases[i].bright + k] = (float)(3 - k);
        es_environment_desc desc = {.image = &image, .radiance = {1, 2, 0.5f}, .rotation = cases[i].rotation};
        assert_int_equal(es_environment_map_build(context, &desc, &map), ES_OK);
        double power[3], any[3] = {0};
        for (int k = 0; k < 3; k++) power[k] = (double)desc.radiance[k] * gathered(&image, k, (double)desc.rotation, 1, any, everywhere, 0, NULL);
        expect_power(&map, power, cases[i].what);
        es_image_destroy(context, &image);
    }
    es_environment_map_free(context, &map);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_constant(void** state)
{
    es_context* context = new_context();
    es_environment_map map = {0};
    float d[3][MOST];
    answers a;
    spread(MOST, d);
    for (int pass = 0; pass < 2; pass++) {
        es_image image = new_image(context, 32, 16);
        for (int i = 0; i < 32 * 16 * 3; i++) image.pixels[i] = 2;
        assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = pass ? &image : NULL, .radiance = {1, 0.5f, 0}}, &map), ES_OK);
        const double value = pass ? 2 : 1;
        for (int r = 0; r <= 10; r++) {
            ask(context, &map, d, (float)r * 0.1f, &a);
            for (int i = 0; i < MOST; i++) {
                assert_true(fabs((double)a.radiance[0][i] - value) < 1e-5 * value && fabs((double)a.radiance[1][i] - value / 2) < 1e-5 * value && a.radiance[2][i] == 0);
                assert_true(fabs((double)a.irradiance[0][i] / (pi * value) - 1) < 2e-3);
            }
        }
        double power[3] = {4 * pi * value, 2 * pi * value, 0};
        expect_power(&map, power, "constant");
        es_image_destroy(context, &image);
    }
    assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.radiance = {0, 0, 0}}, &map), ES_OK);
    es_environment_light light;
    assert_int_equal(es_environment_sample(&map, 1, 0, &light), 0);
    es_environment_map_free(context, &map);
    assert_int_equal(es_environment_sample(&map, 1, 0, &light), 0);
    es_context_destroy(context);
}

/* Irradiance and lobes of a sky with a sun in it against sums over the image; texels' middles show the texels. */
static void test_against_sums(void** state)
{
    es_context* context = new_context();
    es_environment_map map = {0};
    float d[3][MOST];
    answers a;
    spread(MOST, d);
    es_image image = new_image(context, 64, 32);
    fill_sky(&image);
    const float rotation = 0.4f;
    assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}, .rotation = rotation}, &map), ES_OK);
    double most = 0, worst = 0;
    ask(context, &map, d, 0, &a);
    for (int i = 0; i < MOST; i += 3) {
        double n[3] = {(double)d[0][i], (double)d[1][i], (double)d[2][i]}, e = gathered(&image, 1, (double)rotation, 2, n, facing, 0, NULL);
        most = fmax(most, e);
        worst = fmax(worst, fabs(e - (double)a.irradiance[1][i]));
    }
    if (!(worst < 0.01 * most)) fail_msg("irradiance is off by %.5f, the largest is %.5f", worst, most);
    static const struct { float roughness; double bound; } cases[] = {{0.25f, 0.09}, {0.35355339f, 0.06}, {0.5f, 0.06}, {0.70710678f, 0.06}, {1, 0.06}, {0.6f, 0.14}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const double alpha = (double)cases[c].roughness * (double)cases[c].roughness;
        double squares = 0, sum = 0;
        ask(context, &map, d, cases[c].roughness, &a);
        int count = 0;
        for (int i = 0; i < MOST; i += 3, count++) {
            double n[3] = {(double)d[0][i], (double)d[1][i], (double)d[2][i]}, weights, l = gathered(&image, 1, (double)rotation, alpha < 0.2 ? 4 : 2, n, lobe, alpha, &weights) / weights;
            squares += pow(l - (double)a.radiance[1][i], 2);
            sum += l;
        }
        double error = sqrt(squares / count) / (sum / count);
        if (getenv("ES_PRINT")) printf("roughness %.3f: relRMSE %.4f\n", (double)cases[c].roughness, error);
        if (!(error < cases[c].bound)) fail_msg("roughness %.3f: relRMSE %.4f", (double)cases[c].roughness, error);
    }
    if (getenv("ES_PRINT")) printf("irradiance: %.5f of the largest\n", worst / most);
    es_image_destroy(context, &image);
    es_environment_map_free(context, &map);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* Which way it is turned: middles of texels that are larger than the map's show the texel. */
static void test_orientation(void** state)
{
    enum { WIDTH = 32, HEIGHT = 16 };
    es_context* context = new_context();
    es_environment_map map = {0};
    es_image image = new_image(context, WIDTH, HEIGHT);
    for (uint32_t i = 0; i < WIDTH * HEIGHT * 3; i++) image.pixels[i] = es_random_float(6, i);
    const float rotation = 0.4f;
    assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}, .rotation = rotation}, &map), ES_OK);
    for (uint32_t y = 2; y < HEIGHT - 2; y++) {
        float d[3][MOST];
        answers a;
        for (uint32_t i = 0; i < MOST; i++) {
            place m = place_of(i % WIDTH, y, WIDTH, HEIGHT, (double)rotation);
            for (int k = 0; k < 3; k++) d[k][i] = (float)m.d[k] * 7; /* need not be unit */
        }
        ask(context, &map, d, 0, &a);
        for (uint32_t x = 0; x < WIDTH; x++)
            for (uint32_t k = 0; k < 3; k++) {
                const float value = image.pixels[3 * (y * WIDTH + x) + k];
                if (!(fabsf(a.radiance[k][x] - value) < 1e-5f)) fail_msg("texel (%u, %u): %.5f, not %.5f", x, y, (double)a.radiance[k][x], (double)value);
            }
    }
    es_image_destroy(context, &image);
    es_environment_map_free(context, &map);
    es_context_destroy(context);
}

/* A set of lights lights a surface as the sky does; seeds move it, and a small sun keeps its place. */
static void test_lights(void** state)
{
    es_context* context = new_context();
    es_environment_map map = {0};
    es_image image = new_image(context, 64, 32);
    fill_sky(&image);
    assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}}, &map), ES_OK);
    static es_environment_light lights[512], others[512];
    float d[3][MOST];
    spread(MOST, d);
    uint32_t count = es_environment_sample(&map, 512, 1, lights);
    assert_true(count > 480);
    assert_true(es_environment_sample(&map, 512, 2, others) > 480 && memcmp(lights, others, sizeof lights) != 0);
    double most = 0, worst = 0;
    for (int i = 0; i < MOST; i += 3) {
        double n[3] = {(double)d[0][i], (double)d[1][i], (double)d[2][i]}, e = gathered(&image, 2, 0, 2, n, facing, 0, NULL), sum = 0;
        for (uint32_t k = 0; k < count; k++)
            sum += (double)lights[k].irradiance[2] * fmax(0, n[0] * (double)lights[k].direction.x + n[1] * (double)lights[k].direction.y + n[2] * (double)lights[k].direction.z);
        most = fmax(most, e);
        worst = fmax(worst, fabs(sum - e));
    }
    if (!(worst < 0.01 * most)) fail_msg("512 lights: irradiance is off by %.5f, the largest is %.5f", worst, most);
    /* one texel in the whole sky */
    for (int i = 0; i < 64 * 32 * 3; i++) image.pixels[i] = 0;
    place at = place_of(11, 9, 64, 32, 0);
    for (int k = 0; k < 3; k++) image.pixels[3 * (9 * 64 + 11) + k] = 5;
    assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}}, &map), ES_OK);
    count = es_environment_sample(&map, 16, 9, lights);
    assert_true(count >= 1 && count <= 16);
    for (uint32_t k = 0; k < count; k++) {
        double cosine = at.d[0] * (double)lights[k].direction.x + at.d[1] * (double)lights[k].direction.y + at.d[2] * (double)lights[k].direction.z;
        assert_true(cosine > cos(0.08));
    }
    es_image_destroy(context, &image);
    es_environment_map_free(context, &map);
    es_context_destroy(context);
}

static void test_same_bits(void** state)
{
    static float pixels[64 * 32 * 3];
    es_image image = {.width = 64, .height = 32, .channels = 3, .pixels = pixels};
    fill_sky(&image);
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        es_environment_map map = {0};
        assert_int_equal(es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 2, 3}, .rotation = 2}, &map), ES_OK);
        expect_same_bits(&same, map.memory, map.bytes);
        float d[3][MOST];
        answers a;
        spread(MOST, d);
        ask(context, &map, d, 0.3f, &a);
        expect_same_bits(&same, &a, sizeof a);
        es_environment_map_free(context, &map);
        es_context_destroy(context);
    }
}

/* Without the memory for it there is no map, no message is missing, and nothing is left behind. */
static void no_log(void* user, es_log_level level, es_result item, const char* message) {}
static void test_little_memory(void** state)
{
    static float pixels[64 * 32 * 3];
    es_image image = {.width = 64, .height = 32, .channels = 3, .pixels = pixels};
    fill_sky(&image);
    int refused = 0;
    bool built = false;
    for (size_t cap = 20000; !built && cap < 1u << 26; cap += cap / 8 + 3000) {
        es_context_desc desc = es_default_context_desc();
        desc.threads = 1;
        desc.memory_cap = cap;
        desc.logger.log = no_log;
        es_context* context;
        if (es_context_create(&desc, &context) != ES_OK) continue;
        const size_t before = es_context_bytes(context);
        es_environment_map map = {0};
        es_result result = es_environment_map_build(context, &(es_environment_desc){.image = &image, .radiance = {1, 1, 1}}, &map);
        built = result == ES_OK;
        if (!built) {
            assert_int_equal(result, ES_MEMORY_CAP);
            assert_true(!map.memory && !map.lookup.lobes.levels && *es_context_message(context));
            refused++;
        }
        es_environment_map_free(context, &map);
        assert_int_equal(es_context_bytes(context), before);
        es_context_destroy(context);
    }
    assert_true(built && refused > 5);
}

/* ---- the background ---------------------------------------------------------------------------------------------------------------------- */

static void look_along(small_world* w, es_vec3 direction)
{
    es_camera_desc desc = es_default_camera_desc();
    desc.node = node_towards(w, es_v3(0, 0, 0), direction);
    desc.fov_y = 1;
    desc.near_plane = 0.1f;
    es_camera camera;
    assert_int_equal(es_world_add_camera(w->world, &desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(w->world, camera), ES_OK);
}

/* Pixels without a surface show the texel that the reference sees, the others nothing; the sum of the images is the picture. */
static void test_background(void** state)
{
    enum { SIZE = 72 };
    small_world w = small_world_create();
    static float pixels[48 * 24 * 3];
    es_image image = {.width = 48, .height = 24, .channels = 3, .pixels = pixels};
    fill_sky(&image);
    assert_int_equal(es_world_set_environment(w.world, &(es_environment_desc){.image = &image, .radiance = {1, 2, 3}, .rotation = -5}), ES_OK);
    es_material_desc grey = lambert(0.5f, 0);
    add_rectangle(&w, es_v3(-1, -1, -3), es_v3(1.5f, 0, 0), es_v3(0, 1.5f, 0), &grey);
    look_along(&w, es_v3(0.3f, 0.2f, -1));
    es_renderer_settings s = es_default_renderer_settings();
    s.width = SIZE;
    s.height = SIZE;
    for (int method = ES_GI_NONE; method <= ES_GI_MICRO; method++) {
        s.method = (es_gi_method)method;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
        assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
        es_image background, depth, emission;
        assert_int_equal(es_renderer_image(renderer, "background", &background), ES_OK);
        assert_int_equal(es_renderer_image(renderer, "depth", &depth), ES_OK);
        assert_int_equal(es_renderer_image(renderer, "emission", &emission), ES_OK);
        es_raster_view view;
        assert_int_equal(es_world_camera_view(w.world, es_world_active_camera(w.world), SIZE, SIZE, &view), ES_OK);
        es_pixel_rays rays = es_pixel_rays_of_view(&view);
        es_trace_scene scene = {0};
        assert_int_equal(es_trace_scene_take(&scene, w.world, true), ES_OK);
        int seen = 0, empty = 0, beside = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                const float *b = background.pixels + 3 * (y * SIZE + x), *e = emission.pixels + 3 * (y * SIZE + x);
                assert_true(e[0] == b[0] && e[1] == b[1] && e[2] == b[2]);
                if (depth.pixels[y * SIZE + x] > 0) {
                    assert_true(b[0] == 0 && b[1] == 0 && b[2] == 0);
                    seen++;
                    continue;
                }
                es_vec3 expected = es_trace_environment(&scene, es_v3_normalize(es_pixel_rays_direction(&rays, (float)x, (float)y), es_v3(0, 1, 0)));
                empty++;
                beside += b[0] != expected.x || b[1] != expected.y || b[2] != expected.z;
            }
        assert_true(seen > 300 && empty > 2000);
        if (beside > 2) fail_msg("method %d: %d of %d pixels show another texel", method, beside, empty); /* angles in float, at a texel's very edge */
        es_trace_scene_free(&scene);
        es_image_destroy(w.context, &background);
        es_image_destroy(w.context, &depth);
        es_image_destroy(w.context, &emission);
        es_renderer_destroy(renderer);
    }
    small_world_destroy(&w);
}

/* While the camera turns, anti-aliasing over frames finds the sky where it was: edges are about as far from the mean over many places in the pixel as in a picture
 * of one place, and not 3.6 times as far, as where the sky stood still to it. And it is the same with skipping and without, also where the environment goes and comes. */
static void test_turning(void** state)
{
    enum { SIZE = 64, FRAMES = 12 };
    small_world w = small_world_create();
    static float pixels[256 * 128 * 3];
    es_image image = {.width = 256, .height = 128, .channels = 3, .pixels = pixels};
    for (uint32_t i = 0; i < 256 * 128; i++) pixels[3 * i] = pixels[3 * i + 1] = pixels[3 * i + 2] = 0.2f + (float)((i / 8 + i / 2048) % 2);
    es_environment_desc environment = {.image = &image, .radiance = {1, 1, 1}};
    assert_int_equal(es_world_set_environment(w.world, &environment), ES_OK);
    look_along(&w, es_v3(0, 0.1f, -1));
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(w.world, es_world_active_camera(w.world), &camera), ES_OK);
    es_renderer* renderers[4];
    for (int i = 0; i < 4; i++) {
        es_renderer_settings s = es_default_renderer_settings();
        s.width = s.height = SIZE;
        s.method = ES_GI_NONE;
        s.skip = i != 1;
        s.antialias = i < 2 ? ES_ANTIALIAS_TEMPORAL : i == 2 ? ES_ANTIALIAS_NONE : ES_ANTIALIAS_SUPERSAMPLE;
        if (i == 3) s.antialias_samples = 64;
        assert_int_equal(es_renderer_create(w.context, &s, &renderers[i]), ES_OK);
    }
    double error[4] = {0};
    for (int f = 0; f < FRAMES; f++) {
        assert_int_equal(es_world_step(w.world, 0.01f), ES_OK);
        es_transform t;
        assert_int_equal(es_world_get_node_transform(w.world, camera.node, &t), ES_OK);
        t.rotation = es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), 0.011f), t.rotation);
        if (f != 5) assert_int_equal(es_world_set_node_transform(w.world, camera.node, &t), ES_OK);
        es_image picture[4];
        for (int i = 0; i < (f == FRAMES - 1 ? 4 : 3); i++) {
            assert_int_equal(es_renderer_render(renderers[i], w.world), ES_OK);
            assert_int_equal(es_renderer_image(renderers[i], "radiance", &picture[i]), ES_OK);
        }
        assert_true(es_image_hash(&picture[0]) == es_image_hash(&picture[1]));
        for (int i = 0; i < 3; i++) {
            for (int p = 0; p < SIZE * SIZE * 3 && f == FRAMES - 1; p++) error[i] += pow((double)picture[i].pixels[p] - (double)picture[3].pixels[p], 2);
            es_image_destroy(w.context, &picture[i]);
        }
        if (f == FRAMES - 1) es_image_destroy(w.context, &picture[3]);
        if (f == 2) assert_int_equal(es_world_set_environment(w.world, NULL), ES_OK);
        if (f == 3) assert_int_equal(es_world_set_environment(w.world, &environment), ES_OK);
    }
    if (getenv("ES_PRINT")) printf("turning: squared error %.4f with anti-aliasing, %.4f without\n", error[0], error[2]);
    assert_true(error[0] < 1.3 * error[2]);
    for (int i = 0; i < 4; i++) es_renderer_destroy(renderers[i]);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_power),
        unit_test_without_races(test_constant),
        unit_test_without_races(test_against_sums),
        unit_test_without_races(test_orientation),
        unit_test_without_races(test_lights),
        cmocka_unit_test(test_same_bits),
        unit_test_without_races(test_little_memory),
        unit_test_without_races(test_background),
        unit_test_without_races(test_turning),
    };
    return cmocka_run_group_tests_name("environment map", tests, NULL, NULL);
}
