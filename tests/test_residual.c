/* Bias compensation in screen space: what it finds against sums done by hand, what it must not depend on, and what it leaves alone. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "gi/screen/residual.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "raster/pack.h"
#include "tests/races.h"
#include "tests/same_bits.h"

/* ---- a corner seen from its bisector ------------------------------------------------------------------------------------------------ */

enum { WIDTH = 72, HEIGHT = 50 };
#define PIXEL 0.02f /* m */

/* A floor (y = 0, x > 0) and a wall (x = 0, y > 0) that meet in the z axis, seen by a parallel view along (-1, -1, 0) / √2, up the z axis: columns left of the middle show
 * the floor, the others the wall. The wall glows, with radiance 1. */
typedef struct corner {
    es_context* context;
    es_gbuffer gbuffer;
    es_residual_layer layer;
    es_residual_pyramid pyramid;
    float *radiance, *found; /* three planes each */
    uint64_t samples[HEIGHT];
} corner;

static es_pixel_rays corner_rays(void)
{
    const float s = 0.707106781f, middle_x = 0.5f * (WIDTH - 1), middle_y = 0.5f * (HEIGHT - 1);
    es_pixel_rays rays = {.dir = {-s, -s, 0}, .base_dx = {-s * PIXEL, s * PIXEL, 0}, .base_dy = {0, 0, -PIXEL}, .orthographic = true, .far_depth = 1e3f};
    const float start[3] = {4 * s, 4 * s, 0};
    for (int k = 0; k < 3; k++) rays.base[k] = start[k] - middle_x * rays.base_dx[k] - middle_y * rays.base_dy[k];
    return rays;
}

static corner* new_corner(es_context* context, uint32_t levels)
{
    corner* c = calloc(1, sizeof *c);
    c->context = context;
    assert_int_equal(es_gbuffer_create(context, WIDTH, HEIGHT, ES_GBUFFER_ALL, &c->gbuffer), ES_OK);
    const es_gbuffer* g = &c->gbuffer;
    const size_t floats = (size_t)g->stride * HEIGHT;
    c->radiance = calloc(3 * floats, sizeof *c->radiance);
    c->found = calloc(3 * floats, sizeof *c->found);
    c->layer = (es_residual_layer){.gbuffer = g, .rays = corner_rays(), .pyramid = &c->pyramid};
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            const size_t at = (size_t)y * g->stride + x;
            const float across = ((float)x - 0.5f * (WIDTH - 1)) * PIXEL;
            const bool wall = across > 0;
            g->depth[at] = 4.0f - es_absf(across);
            g->normal[at] = g->geometric_normal[at] = es_pack_normal(wall ? es_v3(1, 0, 0) : es_v3(0, 1, 0));
            for (size_t k = 0; k < 3; k++) c->radiance[k * floats + at] = wall ? 1.0f : 0.0f;
        }
    for (size_t k = 0; k < 3; k++) c->layer.radiance[k] = c->radiance + k * floats;
    assert_int_equal(es_residual_reserve(context, &c->pyramid, WIDTH, HEIGHT, levels), ES_OK);
    return c;
}

static void free_corner(corner* c)
{
    es_residual_free(c->context, &c->pyramid);
    es_gbuffer_destroy(c->context, &c->gbuffer);
    free(c->radiance);
    free(c->found);
    free(c);
}

static uint64_t gather(corner* c, float bound, uint32_t spacing, const uint8_t* listed)
{
    const size_t floats = (size_t)c->gbuffer.stride * HEIGHT;
    es_residual_job job = {.layers = {c->layer}, .layer_count = 1, .bound = bound, .solid_angle = 0.08f, .discontinuity = 0.04f, .gbuffer = &c->gbuffer, .rays = c->layer.rays, .spacing = spacing, .listed = listed,
        .stride = spacing == 1 ? c->gbuffer.stride : (WIDTH / spacing + 7) / 8 * 8, .samples = c->samples};
    for (size_t k = 0; k < 3; k++) job.irradiance[k] = c->found + k * floats;
    memset(c->samples, 0, sizeof c->samples);
    es_residual_build(c->context, &c->layer);
    es_residual_gather(c->context, &job);
    uint64_t samples = 0;
    for (uint32_t y = 0; y < HEIGHT; y++) samples += c->samples[y];
    return samples;
}

/* Irradiance that a floor's point at distance h from the wall gets of max(0, G - b), by a fine sum over the wall: at height v and w along it G = h v / (h² + v² + w²)². */
static double by_hand(double h, double bound)
{
    const double reach = 1.0 / sqrt(bound), step = reach / 600;
    double sum = 0;
    for (double v = 0.5 * step; v < reach; v += step)
        for (double w = 0.5 * step; w < reach; w += step) {
            const double d2 = h * h + v * v + w * w, g = h * v / (d2 * d2);
            if (g > bound) sum += 2 * (g - bound) * step * step;
        }
    return sum;
}

static void test_corner(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    const float bound = 30.0f; /* 1 / (18 cm)²: a dozen pixels */
    for (uint32_t levels = 1; levels <= 6; levels += 5) {
        corner* c = new_corner(context, levels);
        gather(c, bound, 1, NULL);
        double worst = 0, found = 0, truth = 0;
        const uint32_t y = HEIGHT / 2, middle = WIDTH / 2;
        for (uint32_t x = middle - 12; x < middle; x++) {
            /* the floor is seen at 45 degrees */
            const double h = (0.5 * (WIDTH - 1) - x) * (double)PIXEL * 1.41421356, e = (double)c->found[(size_t)y * c->gbuffer.stride + x], expected = by_hand(h, (double)bound);
            worst = fmax(worst, fabs(e - expected) / by_hand(0.014, (double)bound));
            found += e;
            truth += expected;
        }
        /* the bound reaches nine pixels: patches are not small beside that, and pixels are a tenth of one off their surface */
        assert_true(worst < 0.12);
        assert_true(fabs(found / truth - 1) < 0.15);
        /* the wall sees the dark floor, and nothing reaches further than the bound */
        for (uint32_t x = 0; x < WIDTH; x++)
            if (x >= middle || x + 14 < middle) assert_true(c->found[(size_t)y * c->gbuffer.stride + x] == 0.0f);
        free_corner(c);
    }
    es_context_destroy(context);
}

/* The pyramid is what makes it cheap (fig. 4a). */
static void test_samples(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    corner *flat = new_corner(context, 1), *deep = new_corner(context, 6);
    const uint64_t all = gather(flat, 8.0f, 1, NULL), few = gather(deep, 8.0f, 1, NULL);
    assert_true(few * 5 < all);
    free_corner(flat);
    free_corner(deep);
    es_context_destroy(context);
}

/* A pixel's light is its own, whichever others are gathered with it. */
static void test_each_for_itself(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    corner* c = new_corner(context, 5);
    const uint32_t stride = c->gbuffer.stride;
    const size_t bytes = (size_t)stride * HEIGHT * sizeof(float);
    float* whole = malloc(bytes);
    gather(c, 30.0f, 1, NULL);
    memcpy(whole, c->found, bytes);
    uint8_t listed[(WIDTH + 7) / 8 * HEIGHT];
    for (size_t i = 0; i < sizeof listed; i++) listed[i] = (uint8_t)(37 * i * i);
    for (size_t i = 0; i < (size_t)stride * HEIGHT; i++) c->found[i] = -1.0f;
    gather(c, 30.0f, 1, listed);
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            const float expected = listed[y * ((WIDTH + 7) / 8) + x / 8] >> x % 8 & 1 ? whole[(size_t)y * stride + x] : -1.0f;
            assert_memory_equal(&c->found[(size_t)y * stride + x], &expected, sizeof expected);
        }
    gather(c, 30.0f, 2, NULL);
    const uint32_t sparse = (WIDTH / 2 + 7) / 8 * 8;
    for (uint32_t y = 0; y < HEIGHT / 2; y++)
        for (uint32_t x = 0; x < WIDTH / 2; x++) assert_memory_equal(&c->found[(size_t)y * sparse + x], &whole[(size_t)(2 * y) * stride + 2 * x], sizeof(float));
    free(whole);
    free_corner(c);
    es_context_destroy(context);
}

/* Nothing there, one pixel there, and every kernel the same bits. */
static void test_kernels(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        corner* c = new_corner(context, 4);
        const size_t bytes = 3 * (size_t)c->gbuffer.stride * HEIGHT * sizeof(float);
        for (int k = 0; k < 40; k++) c->gbuffer.depth[(size_t)(k * 997 % HEIGHT) * c->gbuffer.stride + (size_t)k * 31 % WIDTH] = k % 3 ? 0.0f : 1.0f + (float)k;
        gather(c, 30.0f, 1, NULL);
        expect_same_bits(&same, c->found, bytes);
        gather(c, 0.01f, 1, NULL); /* reaches beyond the picture */
        expect_same_bits(&same, c->found, bytes);
        memset(c->gbuffer.depth, 0, (size_t)c->gbuffer.stride * HEIGHT * sizeof(float));
        gather(c, 30.0f, 1, NULL);
        for (size_t i = 0; i < bytes / sizeof(float); i++) assert_true(c->found[i] == 0.0f);
        c->gbuffer.depth[20 * c->gbuffer.stride + 40] = 0.001f;
        gather(c, 30.0f, 1, NULL);
        for (size_t i = 0; i < bytes / sizeof(float); i++) assert_true(c->found[i] == 0.0f);
        free_corner(c);
        es_context_destroy(context);
    }
}

/* ---- in the frame --------------------------------------------------------------------------------------------------------------------------- */

static es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static double mean(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channels; i++) sum += (double)image->pixels[i];
    return sum / ((double)image->width * image->height * image->channels);
}

/* A coarse Cornell box, and settings that bound its light well within it. */
typedef struct bounded_box { es_context* context; es_world* world; es_renderer_settings settings; } bounded_box;

static bounded_box open_box(uint32_t steps)
{
    bounded_box b = {.settings = es_default_renderer_settings()};
    es_world_settings coarse = es_default_world_settings();
    coarse.triangles = 2000;
    assert_int_equal(es_context_create(NULL, &b.context), ES_OK);
    assert_int_equal(es_world_create_scene(b.context, "cornell", &coarse, &b.world), ES_OK);
    b.settings.width = 96;
    b.settings.height = 72;
    b.settings.vpls = 64;
    b.settings.ism_points = 256;
    b.settings.geometry_bound = 200;
    b.settings.compensation_steps = steps;
    return b;
}

static void close_box(const bounded_box* b)
{
    es_world_destroy(b->world);
    es_context_destroy(b->context);
}

/* Every part of the light is an image, and they add up to the picture in the order that gi/compose.h says, to the bit. */
static void test_parts_add_up(void** state)
{
    (void)state;
    const bounded_box box = open_box(3);
    es_context* context = box.context;
    es_world* world = box.world;
    es_renderer* renderer;
    es_renderer_settings settings = box.settings;
    assert_int_equal(es_renderer_create(context, &settings, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    static const char* const names[] = {"radiance", "emission", "direct", "indirect", "indirect-bounded", "compensation-1", "compensation-2", "compensation-3", "compensation-4"};
    enum { RADIANCE, EMISSION, DIRECT, INDIRECT, BOUNDED, STEP, PARTS = sizeof names / sizeof names[0] };
    es_image images[PARTS];
    for (int i = 0; i < PARTS; i++) images[i] = picture(renderer, names[i]);
    for (size_t i = 0; i < (size_t)settings.width * settings.height * 3; i++) {
        float indirect = images[BOUNDED].pixels[i];
        for (int s = 0; s < 3; s++) indirect += images[STEP + s].pixels[i];
        const float radiance = (images[EMISSION].pixels[i] + images[DIRECT].pixels[i]) + indirect;
        assert_memory_equal(&indirect, &images[INDIRECT].pixels[i], sizeof indirect);
        assert_memory_equal(&radiance, &images[RADIANCE].pixels[i], sizeof radiance);
    }
    /* each step brings less than the one before; a fourth was not asked for */
    assert_true(mean(&images[STEP]) > 0 && mean(&images[STEP + 1]) > 0);
    assert_true(mean(&images[STEP + 1]) < 0.5 * mean(&images[STEP]) && mean(&images[STEP + 2]) < 0.5 * mean(&images[STEP + 1]));
    assert_true(mean(&images[STEP + 3]) == 0);

    /* skipped while nothing changes, to the same bits as done again */
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    settings.skip = false;
    es_renderer* again;
    assert_int_equal(es_renderer_create(context, &settings, &again), ES_OK);
    for (int i = 0; i < 2; i++) assert_int_equal(es_renderer_render(again, world), ES_OK);
    es_image skipped = picture(renderer, "radiance"), done = picture(again, "radiance");
    assert_memory_equal(skipped.pixels, done.pixels, (size_t)settings.width * settings.height * 3 * sizeof(float));
    es_image_destroy(context, &skipped);
    es_image_destroy(context, &done);
    for (int i = 0; i < PARTS; i++) es_image_destroy(context, &images[i]);

    /* where nothing is bounded, or something else finds it, there is nothing to be found */
    const struct { es_gi_method method; float near_distance; uint32_t bias; } others[] = {{ES_GI_NONE, 0, ES_TRACED_BOUNDED}, {ES_GI_ISM, 0.1f, ES_TRACED_BOUNDED}, {ES_GI_ISM, 0, ES_TRACED_UNBOUNDED}};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; i++) {
        settings.method = others[i].method;
        settings.near_distance = others[i].near_distance;
        settings.traced_bias = others[i].bias;
        assert_int_equal(es_renderer_configure(again, &settings), ES_OK);
        assert_int_equal(es_renderer_render(again, world), ES_OK);
        es_image none = picture(again, "compensation-1");
        assert_true(mean(&none) == 0);
        es_image_destroy(context, &none);
    }
    es_renderer_destroy(again);
    es_renderer_destroy(renderer);
    close_box(&box);
}

/* With one bounce, what is found is of it alone: direct light is sent, whose every patch is known, and other virtual point lights change nothing. With two,
 * bounded light of the first bounce is sent as well, and what is found grows. */
static void test_of_one_bounce(void** state)
{
    (void)state;
    const bounded_box box = open_box(1);
    es_context* context = box.context;
    es_renderer* renderer;
    es_renderer_settings settings = box.settings;
    es_image found[3];
    for (uint32_t i = 0; i < 3; i++) {
        settings.vpls = i == 1 ? 96 : 64;
        settings.bounces = i == 2 ? 2 : 1;
        if (i) assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
        else assert_int_equal(es_renderer_create(context, &settings, &renderer), ES_OK);
        assert_int_equal(es_renderer_render(renderer, box.world), ES_OK);
        found[i] = picture(renderer, "compensation-1");
    }
    assert_memory_equal(found[0].pixels, found[1].pixels, (size_t)settings.width * settings.height * 3 * sizeof(float));
    assert_true(mean(&found[0]) > 0 && mean(&found[2]) > 1.02 * mean(&found[0]));
    for (uint32_t i = 0; i < 3; i++) es_image_destroy(context, &found[i]);
    es_renderer_destroy(renderer);
    close_box(&box);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_corner), unit_test_without_races(test_samples), unit_test_without_races(test_each_for_itself), cmocka_unit_test(test_kernels), unit_test_without_races(test_parts_add_up),
        unit_test_without_races(test_of_one_bounce),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
