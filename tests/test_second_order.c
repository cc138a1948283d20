/* Second-order illumination: its sums against sums done by hand, its parts, and what it must not depend on. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "gi/pixel_rays.h"
#include "platform/context.h"
#include "tests/races.h"
#include "tests/same_bits.h"

enum { WIDTH = 90, HEIGHT = 62, LIGHTS = 60 };

static es_renderer_settings settings_of(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_SECOND_ORDER;
    s.second_lights = LIGHTS;
    s.second_negative = 30;
    s.light_size = 64;
    s.shadow_size = 64;
    return s;
}

static es_world* world_of(es_context* context, const char* scene)
{
    es_world_settings coarse = es_default_world_settings();
    coarse.triangles = 2000;
    es_world* world;
    assert_int_equal(es_world_create_scene(context, scene, &coarse, &world), ES_OK);
    return world;
}

static es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static uint64_t count_of(const es_renderer* renderer, const char* pass)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!strcmp(stats->passes[i].name, pass)) return stats->passes[i].skipped ? UINT64_MAX : stats->passes[i].count;
    fail_msg("there is no pass %s", pass);
    return 0;
}

/* At every pixel by itself: the irradiance is the sum over the lights, none of them shadowed. */
static void test_sum(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    es_world* world = world_of(context, "room");
    es_renderer_settings s = settings_of();
    s.second_threshold = 0;
    s.spread = 0;
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    /* all but those of the half resolution, which are lit at their own anyway */
    assert_true(count_of(renderer, "second-order light") == WIDTH * HEIGHT * 3 / 4);
    static es_vpl lights[LIGHTS];
    const size_t count = es_renderer_vpls(renderer, lights, LIGHTS);
    assert_true(count > LIGHTS / 2 && count <= LIGHTS);
    es_image irradiance = picture(renderer, "irradiance"), depth = picture(renderer, "depth"), normal = picture(renderer, "normal");
    es_raster_view view;
    assert_int_equal(es_world_camera_view(world, es_world_active_camera(world), WIDTH, HEIGHT, &view), ES_OK);
    const es_pixel_rays rays = es_pixel_rays_of_view(&view);
    es_vec3 low, high;
    assert_true(es_world_bounds(world, &low, &high));
    const double extent2 = pow((double)(high.x - low.x), 2) + pow((double)(high.y - low.y), 2) + pow((double)(high.z - low.z), 2), bound = (double)s.geometry_bound / extent2;
    for (uint32_t y = 3; y < HEIGHT; y += 11)
        for (uint32_t x = 5; x < WIDTH; x += 13) {
            const size_t at = (size_t)y * WIDTH + x;
            if (!(depth.pixels[at] > 0)) continue;
            const es_vec3 p = es_pixel_rays_position(&rays, (float)x, (float)y, depth.pixels[at]);
            const float* n = normal.pixels + 3 * at;
            double sum = 0;
            for (size_t i = 0; i < count; i++) {
                const es_vpl* l = &lights[i];
                const double d[3] = {(double)(p.x - l->position.x), (double)(p.y - l->position.y), (double)(p.z - l->position.z)}, d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                const double sent = d[0] * (double)l->normal.x + d[1] * (double)l->normal.y + d[2] * (double)l->normal.z, received = -(d[0] * (double)n[0] + d[1] * (double)n[1] + d[2] * (double)n[2]);
                if (sent > 0 && received > 0) sum += (double)l->flux[1] / 3.14159265358979 * fmin(sent * received / (d2 * d2), bound);
            }
            assert_true(fabs((double)irradiance.pixels[3 * at + 1] - sum) <= 1e-2 * sum);
        }
    es_image_destroy(context, &irradiance);
    es_image_destroy(context, &depth);
    es_image_destroy(context, &normal);
    es_renderer_destroy(renderer);
    es_world_destroy(world);
    es_context_destroy(context);
}

/* Negative light takes some away, never more than there is; with the lights' it adds up to the picture, to the bit; and half the resolution does for most pixels. */
static void test_parts(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    es_world* world = world_of(context, "room");
    es_renderer_settings s = settings_of();
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    const uint64_t whole = count_of(renderer, "second-order light");
    assert_true(whole > 0 && whole < WIDTH * HEIGHT * 3 / 4);
    es_image indirect = picture(renderer, "indirect"), bounded = picture(renderer, "indirect-bounded"), negative = picture(renderer, "negative"), bounce = picture(renderer, "indirect-1");
    double taken = 0, there = 0;
    for (size_t i = 0; i < WIDTH * HEIGHT * 3; i++) {
        const float sum = bounded.pixels[i] + negative.pixels[i];
        assert_memory_equal(&sum, &indirect.pixels[i], sizeof sum);
        assert_true(negative.pixels[i] <= 0.0f && sum >= 0.0f);
        assert_true(bounce.pixels[i] == sum);
        taken -= (double)negative.pixels[i];
        there += (double)bounded.pixels[i];
    }
    assert_true(taken > 0.02 * there && taken < 0.7 * there);
    es_image* const images[] = {&indirect, &bounded, &negative, &bounce};
    for (int i = 0; i < 4; i++) es_image_destroy(context, images[i]);

    /* nothing moved: nothing is done; at most one bounce, whatever is asked for */
    s.bounces = 3;
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    assert_true(count_of(renderer, "second-order light") == UINT64_MAX);
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    assert_int_equal(es_renderer_stats(renderer)->bounce_count, 1);
    s.second_negative = 0;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    assert_int_equal(es_renderer_render(renderer, world), ES_OK);
    negative = picture(renderer, "negative");
    for (size_t i = 0; i < WIDTH * HEIGHT * 3; i++) assert_true(negative.pixels[i] == 0.0f);
    es_image_destroy(context, &negative);
    es_renderer_destroy(renderer);
    es_world_destroy(world);
    es_context_destroy(context);
}

/* The same bits on every instruction set and any number of threads, skipped or not, of spot, point and directional lights. */
static void test_bits(void** state)
{
    (void)state;
    static const char* const scenes[] = {"room", "cornell"};
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        for (int i = 0; i < 2; i++) {
            es_world* world = world_of(context, scenes[i]);
            es_renderer_settings s = settings_of();
            s.compensation_steps = i ? 1 : 0;
            es_renderer* renderer;
            assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
            es_light_desc sun = es_default_light_desc();
            es_light light;
            sun.type = i ? ES_LIGHT_DIRECTIONAL : ES_LIGHT_POINT;
            sun.intensity = 3;
            assert_int_equal(es_world_add_light(world, &sun, &light), ES_OK);
            for (int frame = 0; frame < 2; frame++) {
                assert_int_equal(es_world_step(world, frame ? 0.1f : 0), ES_OK);
                assert_int_equal(es_renderer_render(renderer, world), ES_OK);
                es_image radiance = picture(renderer, "radiance"), negative = picture(renderer, "negative");
                expect_same_bits(&same, radiance.pixels, WIDTH * HEIGHT * 3 * sizeof(float));
                expect_same_bits(&same, negative.pixels, WIDTH * HEIGHT * 3 * sizeof(float));
                if (frame) {
                    s.skip = false;
                    es_renderer* again;
                    assert_int_equal(es_renderer_create(context, &s, &again), ES_OK);
                    assert_int_equal(es_renderer_render(again, world), ES_OK);
                    es_image other = picture(again, "radiance");
                    assert_memory_equal(other.pixels, radiance.pixels, WIDTH * HEIGHT * 3 * sizeof(float));
                    es_image_destroy(context, &other);
                    es_renderer_destroy(again);
                }
                es_image_destroy(context, &radiance);
                es_image_destroy(context, &negative);
            }
            es_renderer_destroy(renderer);
            es_world_destroy(world);
        }
        es_context_destroy(context);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {unit_test_without_races(test_sum), unit_test_without_races(test_parts), cmocka_unit_test(test_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
