/* Screen-space methods (gi/screen/): sample sets, occlusion, a bounce, layers, further cameras, repair of depth bias; by what is known of simple worlds, and bit for bit on every
 * instruction set, number of threads, and with and without skipping. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "gi/screen/sample_sets.h"
#include "tests/reference_runs.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

/* ---- sample sets -------------------------------------------------------------------------------------------------------------------- */

/* Each eighth of each coordinate holds one point of each pattern of eight, and each of 128 parts one of all. */
static void test_sets(void** state)
{
    (void)state;
    enum { SETS = 4, SAMPLES = 8, ALL = SETS * SETS * SAMPLES };
    int all[3][ALL] = {{0}};
    for (uint32_t y = 0; y < SETS; y++)
        for (uint32_t x = 0; x < SETS; x++) {
            int own[3][SAMPLES] = {{0}};
            for (uint32_t i = 0; i < SAMPLES; i++) {
                const es_screen_sample s = es_screen_sample_at(SETS, SAMPLES, x, y, i);
                assert_true(fabsf(es_v3_length(s.direction) - 1) < 1e-6f && s.direction.z >= 0 && s.length > 0 && s.length < 1);
                double turn = atan2((double)s.direction.y, (double)s.direction.x) / (2 * 3.14159265358979);
                const double c[3] = {(double)s.direction.z, turn < 0 ? turn + 1 : turn, (double)s.length * (double)s.length};
                for (int k = 0; k < 3; k++) {
                    own[k][(int)(c[k] * SAMPLES)]++;
                    all[k][(int)(c[k] * ALL)]++;
                }
                const es_screen_disc_sample d = es_screen_disc_sample_at(SETS, SAMPLES, x, y, i);
                assert_true(d.radius >= ES_SCREEN_DISC_INNER && d.radius <= 1 && fabsf(d.x * d.x + d.y * d.y - d.radius * d.radius) < 1e-6f);
            }
            for (int k = 0; k < 3; k++)
                for (int i = 0; i < SAMPLES; i++) assert_int_equal(own[k][i], 1);
        }
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < ALL; i++) assert_int_equal(all[k][i], 1);
}

/* ---- pictures ------------------------------------------------------------------------------------------------------------------------ */

enum { WIDTH = 96, HEIGHT = 72 };

static es_image picture(small_world* w, const char* settings, const char* image)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_NONE;
    char text[400], *at = text;
    snprintf(text, sizeof text, "%s", settings);
    for (char* next; at && *at; at = next) {
        next = strchr(at, ' ');
        if (next) *next++ = 0;
        char* value = strchr(at, '=');
        *value++ = 0;
        assert_int_equal(es_renderer_settings_set(w->context, &s, at, value), ES_OK);
    }
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, &s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    es_image result;
    assert_int_equal(es_renderer_image(renderer, image, &result), ES_OK);
    es_renderer_destroy(renderer);
    return result;
}

static void shine_evenly(small_world* w) { assert_int_equal(es_world_set_environment(w->world, &(es_environment_desc){.radiance = {1, 1, 1}}), ES_OK); }

static es_camera_desc eye(float fov) { return (es_camera_desc){.fov_y = fov, .near_plane = 0.0005f}; }

static void add_floor(small_world* w, float half, const es_material_desc* m) { add_rectangle(w, es_v3(-half, 0, half), es_v3(2 * half, 0, 0), es_v3(0, 0, -2 * half), m); }

/* Closed, axis-aligned, facing outside. */
static void add_block(small_world* w, es_vec3 low, es_vec3 high, const es_material_desc* m)
{
    const es_vec3 d = es_v3_sub(high, low);
    for (int k = 0; k < 3; k++) {
        es_vec3 u = es_v3(0, 0, 0), v = u, corner = low;
        (&u.x)[(k + 1) % 3] = (&d.x)[(k + 1) % 3];
        (&v.x)[(k + 2) % 3] = (&d.x)[(k + 2) % 3];
        add_rectangle(w, corner, v, u, m);
        (&corner.x)[k] = (&high.x)[k];
        add_rectangle(w, corner, u, v, m);
    }
}

/* A plane is not occluded by itself, however it is seen; nor is anything by what is outside the picture. */
static void test_planes(void** state)
{
    (void)state;
    static const float heights[] = {3, 0.5f, 0.05f, 0.001f};
    for (int i = 0; i < 4; i++)
        for (int ambient = 0; ambient < 2; ambient++) {
            small_world w = small_world_create();
            es_material_desc grey = lambert(0.5f, 0);
            add_floor(&w, 5, &grey);
            shine_evenly(&w);
            look(&w, eye(1), es_v3(0, heights[i], 2), es_v3(0.3f, 0, 2 - 4 * heights[i]));
            es_image occlusion = picture(&w, ambient ? "lamps=ambient screen.radius=0.1" : "lamps=screen screen.radius=0.1 screen.layers=2 screen.cameras=2", "occlusion");
            for (int p = 0; p < WIDTH * HEIGHT; p++) assert_true(occlusion.pixels[p] >= 0 && occlusion.pixels[p] < 1e-6f);
            es_image lamps = picture(&w, "lamps=screen", "lamps"), depth = picture(&w, "", "depth");
            /* all of an even light arrives */
            for (int p = 0; p < WIDTH * HEIGHT; p++)
                if (depth.pixels[p] > 0) assert_true(fabsf(lamps.pixels[3 * p] - 0.5f) < 0.01f);
            es_image_destroy(w.context, &occlusion);
            es_image_destroy(w.context, &lamps);
            es_image_destroy(w.context, &depth);
            small_world_destroy(&w);
        }
}

/* Occlusion of a floor by a wall, by how far from it: along the row in the picture that sees the floor beside the wall's middle. */
static void test_corner(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material_desc grey = lambert(0.5f, 0);
    add_floor(&w, 3, &grey);
    add_rectangle(&w, es_v3(-3, 0, 0), es_v3(6, 0, 0), es_v3(0, 3, 0), &grey); /* faces +z */
    shine_evenly(&w);
    look(&w, eye(0.7f), es_v3(0, 2.0f, 3), es_v3(0, 0, 0.6f));
    const float extent = sqrtf(36 + 36 + 9), radius = 0.8f;
    char settings[96];
    static const char* const methods[] = {"screen", "ambient"};
    for (int m = 0; m < 2; m++) {
        snprintf(settings, sizeof settings, "lamps=%s screen.radius=%.7f screen.samples=32", methods[m], (double)(radius / extent));
        es_image occlusion = picture(&w, settings, "occlusion");
        double contact = 0, last = 1;
        int beyond = 0, near = 0;
        for (int y = 0; y < HEIGHT; y++) {
            const es_vec3 p = pixel_on_plane(&w, WIDTH, HEIGHT, WIDTH / 2, y, es_v3(0, 0, 0), es_v3(0, 1, 0));
            const double o = (double)occlusion.pixels[y * WIDTH + WIDTH / 2];
            if (!(p.z > 0.05f)) continue;
            if (p.z < 0.15f) contact += o, near++;
            if (p.z > radius + 0.1f) {
                assert_true(o < 1e-6);
                beyond++;
            } else if (p.z > 0.2f) {
                assert_true(o <= last + 0.01);
            }
            last = o;
        }
        contact /= near;
        if (getenv("ES_PRINT")) printf("corner, %s: occlusion %.3f at contact\n", methods[m], contact);
        /* a wall at once beside it hides half; one a tenth of a metre away is met by directions of at least so long a sample */
        assert_true(near > 1 && beyond > 5 && contact > 0.25 && contact < 0.5);
        es_image_destroy(w.context, &occlusion);
    }
    small_world_destroy(&w);
}

/* What is further away than the radius occludes nothing, though it stands before the floor in the picture. */
static void test_beyond(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material_desc grey = lambert(0.5f, 0);
    add_floor(&w, 4, &grey);
    add_block(&w, es_v3(-0.3f, 1.2f, -0.3f), es_v3(0.3f, 1.8f, 0.3f), &grey);
    shine_evenly(&w);
    look(&w, eye(0.9f), es_v3(0, 3, 4), es_v3(0, 0.3f, 0));
    es_image occlusion = picture(&w, "lamps=screen screen.radius=0.05", "occlusion"), normal = picture(&w, "", "normal");
    int seen = 0;
    for (int p = 0; p < WIDTH * HEIGHT; p++)
        if (normal.pixels[3 * p + 1] > 0.99f) {
            assert_true(occlusion.pixels[p] < 1e-6f);
            seen++;
        }
    assert_true(seen > 1000);
    es_image_destroy(w.context, &occlusion);
    es_image_destroy(w.context, &normal);
    small_world_destroy(&w);
}

static double mean_where_floor(const es_image* values, const es_image* normal)
{
    double sum = 0;
    int count = 0;
    for (int p = 0; p < WIDTH * HEIGHT; p++)
        if (normal->pixels[3 * p + 1] > 0.99f) sum += (double)values->pixels[p], count++;
    return sum / count;
}

/* Figure 4.5: a thin board not far above the floor hides from one depth what is behind it; two layers know that it ends. Of three cameras another sees past it. */
static void test_layers(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material_desc grey = lambert(0.5f, 0);
    add_floor(&w, 2, &grey);
    add_block(&w, es_v3(-0.8f, 0.25f, 0.0f), es_v3(0.8f, 0.6f, 0.02f), &grey);
    shine_evenly(&w);
    look(&w, eye(0.7f), es_v3(0, 0.8f, 3), es_v3(0, 0.2f, 0));
    es_image normal = picture(&w, "", "normal");
    static const char* const settings[] = {"lamps=screen screen.radius=0.1 screen.samples=16", "lamps=screen screen.radius=0.1 screen.samples=16 screen.layers=2", "lamps=screen screen.radius=0.1 screen.samples=16 screen.layers=4",
        "lamps=screen screen.radius=0.1 screen.samples=16 screen.cameras=4"};
    double mean[4];
    for (int i = 0; i < 4; i++) {
        es_image occlusion = picture(&w, settings[i], "occlusion");
        mean[i] = mean_where_floor(&occlusion, &normal);
        es_image_destroy(w.context, &occlusion);
    }
    if (getenv("ES_PRINT")) printf("board: occlusion of the floor %.5f by one layer, %.5f two, %.5f four, %.5f with four cameras\n", mean[0], mean[1], mean[2], mean[3]);
    assert_true(mean[0] > 0.001 && mean[1] < 0.5 * mean[0] && mean[2] < 0.5 * mean[0] && mean[3] < 0.8 * mean[0]);
    es_image_destroy(w.context, &normal);
    small_world_destroy(&w);
}

/* A block's shadow begins at the block, though the map's bias is wider than it is high; a floor alone stays as it is to the bit. */
static void test_repair(void** state)
{
    (void)state;
    static const char bias[] = "shadow.size=32 shadow.bias=4 shadow.slope-bias=0";
    for (int block = 0; block < 2; block++) {
        small_world w = small_world_create();
        es_material_desc grey = lambert(0.5f, 0);
        es_light_desc sun = es_default_light_desc();
        add_floor(&w, 3, &grey);
        if (block) add_block(&w, es_v3(-0.5f, 0, -0.1f), es_v3(0.5f, 0.25f, 0.1f), &grey);
        sun.type = ES_LIGHT_DIRECTIONAL;
        sun.intensity = 3;
        add_light(&w, sun, es_v3(0, 3, 0), es_v3(0, -1, 1)); /* shadows fall towards the camera */
        look(&w, eye(0.6f), es_v3(0, 1.5f, 3), es_v3(0, 0, 0));
        char text[160];
        snprintf(text, sizeof text, "%s screen.repair=16", bias);
        es_image without = picture(&w, bias, "direct"), with = picture(&w, text, "direct");
        if (!block) assert_memory_equal(without.pixels, with.pixels, WIDTH * HEIGHT * 3 * sizeof(float));
        int dark[2] = {0, 0}, shadowed = 0;
        for (int y = 0; y < HEIGHT && block; y++)
            for (int x = 0; x < WIDTH; x++) {
                const es_vec3 p = pixel_on_plane(&w, WIDTH, HEIGHT, x, y, es_v3(0, 0, 0), es_v3(0, 1, 0));
                const size_t at = 3 * (size_t)(y * WIDTH + x);
                if (fabsf(p.x) < 0.4f && p.z > 0.13f && p.z < 0.25f) { /* its shadow reaches to 0.35 */
                    shadowed++;
                    dark[0] += without.pixels[at] < 0.05f;
                    dark[1] += with.pixels[at] < 0.05f;
                }
                if (p.z > 0.5f && p.z < 2 && fabsf(p.x) < 2) assert_true(without.pixels[at] == with.pixels[at]);
            }
        if (block) {
            if (getenv("ES_PRINT")) printf("contact shadow: %d of %d pixels without repair, %d with it\n", dark[0], shadowed, dark[1]);
            assert_true(shadowed > 20 && dark[0] < shadowed / 2 && dark[1] > shadowed * 9 / 10);
        }
        es_image_destroy(w.context, &without);
        es_image_destroy(w.context, &with);
        small_world_destroy(&w);
    }
}

/* Light that a lit wall sends to the dark floor before it, against the path tracer: where all senders are in the picture and within the radius. */
static void test_bounce(void** state)
{
    (void)state;
    small_world w = small_world_create();
    es_material_desc white = lambert(0.8f, 0);
    es_light_desc lamp = es_default_light_desc();
    add_rectangle(&w, es_v3(-1, 0, 1), es_v3(2, 0, 0), es_v3(0, 0, -1), &white);
    add_rectangle(&w, es_v3(-1, 0, 0), es_v3(2, 0, 0), es_v3(0, 1, 0), &white);
    lamp.type = ES_LIGHT_DIRECTIONAL;
    lamp.intensity = 3;
    add_light(&w, lamp, es_v3(0, 1, 3), es_v3(0, 0.02f, -1)); /* along the floor, from just below it: that stays dark */
    look(&w, eye(0.8f), es_v3(0, 1.6f, 2.6f), es_v3(0, 0.35f, 0.3f));
    es_image found = picture(&w, "screen.bounce=true screen.radius=1 screen.samples=64 screen.sets=8", "screen-bounce"), normal = picture(&w, "", "normal");
    const es_reference_settings settings = reference_settings(WIDTH, HEIGHT, 1);
    es_reference* reference = trace(&w, &settings, 64 / FEWER);
    es_image truth = traced(reference, "indirect");
    double sums[2] = {0, 0};
    for (int p = 0; p < WIDTH * HEIGHT; p++)
        if (normal.pixels[3 * p + 1] > 0.99f) {
            sums[0] += (double)found.pixels[3 * p];
            sums[1] += (double)truth.pixels[3 * p];
        }
    if (getenv("ES_PRINT")) printf("bounce: %.4f of the truth's light on the floor\n", sums[0] / sums[1]);
    assert_true(sums[1] > 1 && sums[0] > 0.85 * sums[1] && sums[0] < 1.05 * sums[1]);
    es_image_destroy(w.context, &found);
    es_image_destroy(w.context, &normal);
    es_image_destroy(w.context, &truth);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

/* ---- bits ---------------------------------------------------------------------------------------------------------------------------- */

/* Small pictures with few lights; the second of a pair of renderers does everything again in every frame. */
static es_renderer_settings small_settings(uint32_t width, uint32_t height, int of_pair)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = width;
    s.height = height;
    s.vpls = 64;
    s.ism_pool = 16384;
    s.ism_points = 512;
    s.light_size = 64;
    s.skip = of_pair == 0;
    return s;
}

/* Light of a lamp and of the sky. */
static void light_up(small_world* w)
{
    es_light_desc lamp = es_default_light_desc();
    lamp.intensity = 30;
    add_light(w, lamp, es_v3(1, 2, 1.5f), es_v3(-1, -2, -1.5f));
    assert_int_equal(es_world_set_environment(w->world, &(es_environment_desc){.radiance = {0.5f, 0.7f, 1}}), ES_OK);
}

/* All of it at once, in worlds that have nothing, one pixel, little or much. */
static void test_bits(void** state)
{
    (void)state;
    enum { W = 50, H = 37, WORLDS = 4 };
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    enum { FIRST = 1, STEP = 2 };
#else
    enum { FIRST = 0, STEP = 1 };
#endif
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        for (int kind = FIRST; kind < WORLDS; kind += STEP) {
            small_world w = {.context = context};
            assert_int_equal(es_world_create(context, NULL, &w.world), ES_OK);
            es_material_desc grey = lambert(0.6f, 0), metal = es_default_material_desc();
            metal.metallic = 1;
            metal.roughness = 0.3f;
            if (kind == 1) add_block(&w, es_v3(0, 0, 0), es_v3(0.004f, 0.004f, 0.004f), &metal);
            if (kind >= 2) {
                add_floor(&w, 2, &grey);
                add_block(&w, es_v3(-0.5f, 0, -0.5f), es_v3(0.1f, 0.7f, 0.4f), &grey);
                add_sphere(&w, es_v3(0.6f, 0.3f, 0.2f), 0.3f, 8, false, &metal);
            }
            light_up(&w);
            look(&w, eye(0.8f), kind == 3 ? es_v3(0.3f, 0.001f, 1) : es_v3(0.4f, 1, 3), es_v3(0, 0.001f, 0));
            es_renderer* renderers[2];
            for (int i = 0; i < 2; i++) {
                es_renderer_settings s = small_settings(W, H, i);
                s.lamps = ES_LAMPS_SCREEN;
                s.screen_layers = kind == 3 ? 4 : 2;
                s.screen_cameras = 2;
                s.screen_bounce = true;
                s.screen_repair = 2;
                assert_int_equal(es_renderer_create(context, &s, &renderers[i]), ES_OK);
            }
            for (int frame = 0; frame < 3; frame++) {
                if (frame == 2)
                    for (int i = 0; i < 2; i++) {
                        es_renderer_settings s = es_renderer_get_settings(renderers[i]);
                        s.lamps = ES_LAMPS_AMBIENT;
                        s.screen_layers = 1;
                        s.screen_cameras = 0;
                        assert_int_equal(es_renderer_configure(renderers[i], &s), ES_OK);
                    }
                es_image kept, done;
                assert_int_equal(es_renderer_render(renderers[0], w.world), ES_OK);
                assert_int_equal(es_renderer_render(renderers[1], w.world), ES_OK);
                assert_int_equal(es_renderer_image(renderers[0], "radiance", &kept), ES_OK);
                assert_int_equal(es_renderer_image(renderers[1], "radiance", &done), ES_OK);
                assert_memory_equal(kept.pixels, done.pixels, W * H * 3 * sizeof(float));
                for (int p = 0; p < W * H * 3; p++) assert_true(kept.pixels[p] >= 0 && kept.pixels[p] < 1e6f);
                expect_same_bits(&same, kept.pixels, W * H * 3 * sizeof(float));
                es_image_destroy(context, &kept);
                es_image_destroy(context, &done);
            }
            for (int i = 0; i < 2; i++) es_renderer_destroy(renderers[i]);
            es_world_destroy(w.world);
        }
        es_context_destroy(context);
    }
}

/* Whatever is changed between frames, a picture whose passes were kept is what doing all of them again gives. */
static void test_changes(void** state)
{
    (void)state;
    static const char* const changes[][5] = {
        {"screen.layers=2", "lamps=screen", "screen.bounce=true"}, {"screen.layers=4"}, {"screen.layers=3"}, {"screen.layers=2", "screen.repair=8", "screen.repair-least=0.2"}, {"screen.layers=4"}, {"lamps=maps"},
        {"screen.layers=2"}, {"compensation.steps=1", "vpl.bound=50"}, {"screen.layers=4"}, {"lamps=traced", "traced.bias=compensated", "traced.samples=2"}, {"gi=none"}, {"gi=second-order"}, {"gi=ism", "bounces=0"}, {"bounces=1"}};
    enum { W = 50, H = 37 };
    static const char* const images[] = {"direct", "lamps", "indirect", "occlusion", "compensation", "radiance"};
    small_world w = small_world_create();
    const es_material_desc grey = lambert(0.6f, 0);
    add_floor(&w, 2, &grey);
    for (int i = 0; i < 4; i++) add_block(&w, es_v3(-0.5f + 0.25f * (float)i, 0, -0.5f + 0.2f * (float)i), es_v3(0.05f, 0.3f, 0.05f), &grey);
    light_up(&w);
    look(&w, eye(0.8f), es_v3(0.2f, 0.5f, 1.5f), es_v3(0, 0.1f, 0));
    es_renderer* renderers[2];
    for (int i = 0; i < 2; i++) {
        es_renderer_settings s = small_settings(W, H, i);
        assert_int_equal(es_renderer_create(w.context, &s, &renderers[i]), ES_OK);
    }
    for (size_t c = 0; c < sizeof changes / sizeof changes[0]; c++) {
        for (int i = 0; i < 2; i++) {
            es_renderer_settings s = es_renderer_get_settings(renderers[i]);
            for (int k = 0; k < 5 && changes[c][k]; k++) {
                char name[64];
                const char* equals = strchr(changes[c][k], '=');
                snprintf(name, sizeof name, "%.*s", (int)(equals - changes[c][k]), changes[c][k]);
                assert_int_equal(es_renderer_settings_set(w.context, &s, name, equals + 1), ES_OK);
            }
            assert_int_equal(es_renderer_configure(renderers[i], &s), ES_OK);
            assert_int_equal(es_renderer_render(renderers[i], w.world), ES_OK);
        }
        for (size_t k = 0; k < sizeof images / sizeof images[0]; k++) {
            es_image kept, done;
            assert_int_equal(es_renderer_image(renderers[0], images[k], &kept), ES_OK);
            assert_int_equal(es_renderer_image(renderers[1], images[k], &done), ES_OK);
            if (memcmp(kept.pixels, done.pixels, (size_t)W * H * kept.channels * sizeof(float)) != 0) fail_msg("%s differs after %s", images[k], changes[c][0]);
            /* without virtual point lights nothing is found of what their bound takes */
            if (!strcmp(images[k], "compensation") && (!strncmp(changes[c][0], "gi=", 3) || (changes[c][1] && !strcmp(changes[c][1], "bounces=0"))))
                for (int p = 0; p < W * H * 3; p++) assert_true(done.pixels[p] == 0);
            es_image_destroy(w.context, &kept);
            es_image_destroy(w.context, &done);
        }
    }
    for (int i = 0; i < 2; i++) es_renderer_destroy(renderers[i]);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {unit_test_without_races(test_sets), unit_test_without_races(test_planes), unit_test_without_races(test_corner), unit_test_without_races(test_beyond), unit_test_without_races(test_layers), unit_test_without_races(test_repair),
        unit_test_without_races(test_bounce), cmocka_unit_test(test_bits),
        unit_test_without_races(test_changes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
