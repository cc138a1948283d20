/* Where pixels are sampled, what becomes of an edge whose coverage is known, and that a picture that stands still is the mean over the places. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/antialias.h"
#include "gi/pixel_rays.h"
#include "platform/maths.h"
#include "small_worlds.h"

static void test_places(void** state)
{
    (void)state;
    float place[2];
    es_antialias_place(0, place);
    assert_true(place[0] == 0.0f && place[1] == 0.0f); /* the first is the centre */
    static const float expected[][2] = {{-0.5f, 1.0f / 3}, {0.25f, -1.0f / 3}, {-0.25f, 1.0f / 9}, {0.125f, 4.0f / 9}};
    for (uint32_t i = 0; i < 4; i++) {
        es_antialias_place(i + 1, place);
        assert_true(fabsf(place[0] - expected[i][0]) < 1e-6f && fabsf(place[1] - expected[i][1]) < 1e-6f);
    }
    /* of the first 16 every sixteenth of the width has one, of the first 27 every 27th of the height */
    uint32_t columns = 0, rows = 0;
    for (uint32_t i = 0; i < 27; i++) {
        es_antialias_place(i, place);
        assert_true(place[0] >= -0.5f && place[0] < 0.5f && place[1] >= -0.5f && place[1] < 0.5f);
        if (i < 16) columns |= 1u << (uint32_t)((place[0] + 0.5f) * 16);
        rows |= 1u << (uint32_t)((place[1] + 0.5f) * 27 + 0.01f);
    }
    assert_int_equal(columns, 0xffff);
    assert_int_equal(rows, (1u << 27) - 1);
}

/* The ray through a moved pixel's centre is the one through that place of the pixel that is not moved. */
static void test_jitter(void** state)
{
    (void)state;
    const float place[2] = {0.25f, -0.375f};
    es_raster_view views[2] = {es_perspective_view(64, 48, es_v3(1, 2, 3), es_v3(0.2f, -0.1f, -1), es_v3(0, 1, 0), 1.0f, 0.1f), es_orthographic_view(64, 48, es_v3(1, 2, 3), es_v3(0.2f, -0.1f, -1), es_v3(0, 1, 0), 4, 3, 0.1f, 10)};
    for (int v = 0; v < 2; v++) {
        es_pixel_rays plain = es_pixel_rays_of_view(&views[v]);
        es_antialias_jitter(&views[v], place);
        assert_memory_equal(&views[v].projection, &views[v].previous_projection, sizeof views[v].projection);
        es_pixel_rays moved = es_pixel_rays_of_view(&views[v]);
        for (int k = 0; k < 3; k++) {
            assert_true(fabsf(moved.base[k] - (plain.base[k] + place[0] * plain.base_dx[k] + place[1] * plain.base_dy[k])) < 1e-5f);
            assert_true(fabsf(moved.dir[k] - (plain.dir[k] + place[0] * plain.dir_dx[k] + place[1] * plain.dir_dy[k])) < 1e-5f);
        }
    }
}

enum { WIDTH = 40, HEIGHT = 30 };

/* A glowing half plane with a slanted edge, seen by an orthographic camera, one unit a pixel. */
static small_world edge_world(void)
{
    small_world w = small_world_create();
    static const float corners[] = {-100, -100, 0, 6, -100, 0, -4, 100, 0, -100, 100, 0};
    static const uint32_t quad[] = {0, 1, 2, 0, 2, 3};
    const es_mesh_desc mesh = {.name = "half", .vertex_count = 4, .triangle_count = 2, .positions = corners, .indices = quad};
    const es_material_desc glow = lambert(0, 0.25f);
    add_instance(&w, &mesh, &glow);
    es_camera_desc camera = es_default_camera_desc();
    camera.node = node_towards(&w, es_v3(0, 0, 5), es_v3(0, 0, -1));
    camera.orthographic = true;
    camera.half_height = HEIGHT / 2.0f;
    assert_int_equal(es_world_add_camera(w.world, &camera, &w.camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(w.world, w.camera), ES_OK);
    return w;
}

/* How much of pixel (x, y) lies left of the line through (6, -100) and (-4, 100). */
static double coverage(uint32_t x, uint32_t y)
{
    enum { STEPS = 64 };
    double sum = 0;
    for (int i = 0; i < STEPS; i++) {
        const double world_y = HEIGHT / 2.0 - (y + (i + 0.5) / STEPS), edge = 1 - world_y * 0.05;
        sum += fmin(fmax(edge - ((double)x - WIDTH / 2.0), 0), 1);
    }
    return sum / STEPS;
}

static void check_edge(uint32_t antialias, uint32_t samples, uint32_t frames, double largest, double mean)
{
    small_world w = edge_world();
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_NONE;
    s.antialias = antialias;
    s.antialias_samples = samples;
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
    for (uint32_t i = 0; i < frames; i++) assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
    es_image image;
    assert_int_equal(es_renderer_image(renderer, "radiance", &image), ES_OK);
    double worst = 0, sum = 0;
    uint32_t edges = 0;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            const double c = coverage(x, y), value = (double)image.pixels[(y * WIDTH + x) * 3] / 0.25, error = fabs(value - c);
            if (c == 0.0 || c == 1.0) assert_true(error < 1e-2);
            else {
                edges++;
                sum += error;
            }
            worst = fmax(worst, error);
        }
    assert_true(edges >= HEIGHT - 2);
    if (worst > largest || sum / edges > mean) fail_msg("antialias %u: coverage is wrong by up to %.3f and by %.3f in the mean", antialias, worst, sum / edges);
    es_image_destroy(w.context, &image);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

static void test_edges(void** state)
{
    (void)state;
    check_edge(ES_ANTIALIAS_NONE, 16, 1, 0.52, 0.3);
    /* blending what a display shows bends the ramp by up to 0.06 at this brightness, 16 places leave steps of as much */
    check_edge(ES_ANTIALIAS_SUPERSAMPLE, 16, 1, 0.16, 0.06);
    check_edge(ES_ANTIALIAS_SUPERSAMPLE, 64, 1, 0.1, 0.05);
    check_edge(ES_ANTIALIAS_TEMPORAL, 16, 64, 0.2, 0.08);
}

/* Lights that go on from frame to frame do so once a frame, however many pictures it has and whether work is skipped or not. */
static void test_stable_lights(void** state)
{
    (void)state;
    enum { W = 24, H = 16, FRAMES = 4 };
    uint32_t pictures[2][FRAMES][W * H];
    for (int skip = 0; skip < 2; skip++) {
        small_world w = small_world_create();
        es_world* world;
        assert_int_equal(es_world_create_scene(w.context, "stress", NULL, &world), ES_OK);
        es_renderer_settings s = es_default_renderer_settings();
        s.width = W;
        s.height = H;
        s.vpls = 64;
        s.ism_points = 256;
        s.ism_size = 32;
        s.light_size = 32;
        s.shadow_size = 64;
        s.stable_vpls = true;
        s.antialias = ES_ANTIALIAS_SUPERSAMPLE;
        s.antialias_samples = 3;
        s.skip = skip;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
        for (int i = 0; i < FRAMES; i++) {
            uint32_t width, height;
            assert_int_equal(es_world_step(world, i ? 1.0f / 15 : 0), ES_OK);
            assert_int_equal(es_renderer_render(renderer, world), ES_OK);
            memcpy(pictures[skip][i], es_renderer_display(renderer, &width, &height), sizeof pictures[skip][i]);
        }
        es_renderer_destroy(renderer);
        es_world_destroy(world);
        small_world_destroy(&w);
    }
    assert_memory_equal(pictures[0], pictures[1], sizeof pictures[0]);
    assert_true(memcmp(pictures[0][0], pictures[0][FRAMES - 1], sizeof pictures[0][0]) != 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_places), cmocka_unit_test(test_jitter), cmocka_unit_test(test_edges), cmocka_unit_test(test_stable_lights)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
