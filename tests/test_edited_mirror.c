/* What a mirror shows under an artist's constraint: the reflected point lies under the red handle, within a pixel, by maps and by rays; elsewhere mirrors show what they did. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "platform/random.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

enum { WIDTH = 160, HEIGHT = 120 };
static const es_vec3 eye = {0.6f, 1.4f, 4.0f};

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(9, counter++)); }

/* A mirror at z = 0 in a dark room, and a bright ball before it. */
static small_world mirror_world(es_context* context, es_vec3 ball)
{
    small_world w = {0};
    if (context) {
        w.context = context;
        assert_int_equal(es_world_create(context, NULL, &w.world), ES_OK);
    } else w = small_world_create();
    es_material_desc mirror = es_default_material_desc(), dark = lambert(0.1f, 0.01f), dim = lambert(0.1f, 0.03f), glow = lambert(0, 5);
    mirror.metallic = 1;
    mirror.roughness = 0;
    add_rectangle(&w, es_v3(-2, 0, 0), es_v3(4, 0, 0), es_v3(0, 3, 0), &mirror);
    add_rectangle(&w, es_v3(-4, 0, 6), es_v3(8, 0, 0), es_v3(0, 0, -6.5f), &dark);
    add_rectangle(&w, es_v3(4, 0, 6), es_v3(-8, 0, 0), es_v3(0, 5, 0), &dim);
    add_sphere(&w, ball, 0.05f, 12, false, &glow);
    look(&w, (es_camera_desc){.fov_y = 0.8f, .near_plane = 0.01f}, eye, es_v3(0, 1.4f, 0));
    return w;
}

static es_anchor on_mirror(const small_world* w, float u, float v)
{
    uint32_t ids[8];
    size_t count = 8;
    es_anchor anchor;
    assert_int_equal(es_world_enumerate(w->world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    assert_int_equal(es_world_anchor_of_triangle(w->world, (es_instance){ids[0]}, 0, u, v, &anchor), ES_OK);
    return anchor;
}

static es_vec3 constrain(small_world* w, es_anchor red, es_vec3 green)
{
    es_constraint_desc desc = es_default_constraint_desc();
    es_constraint constraint;
    double at[3];
    desc.reflecting = red;
    desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {(double)green.x, (double)green.y, (double)green.z}};
    desc.eye[0] = (double)eye.x;
    desc.eye[1] = (double)eye.y;
    desc.eye[2] = (double)eye.z;
    assert_int_equal(es_world_add_constraint(w->world, &desc, &constraint), ES_OK);
    assert_true(es_world_resolve_anchor(w->world, &red, at, NULL));
    return es_v3((float)at[0], (float)at[1], (float)at[2]);
}

static void surround(small_world* w, es_anchor centre, float radius, float border)
{
    es_region_desc desc = es_default_region_desc();
    es_region region;
    desc.centre = centre;
    desc.radius = radius;
    desc.border = border;
    assert_int_equal(es_world_add_region(w->world, &desc, &region), ES_OK);
}

static es_image reflections(small_world* w, const char* how)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE; /* where rays end their light is smoothed with that of other ends */
    s.reflection_size = 512;
    assert_int_equal(es_renderer_settings_set(w->context, &s, "reflections", how), ES_OK);
    es_renderer* renderer;
    es_image image;
    assert_int_equal(es_renderer_create(w->context, &s, &renderer), ES_OK);
    assert_int_equal(es_world_step(w->world, 0), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    assert_int_equal(es_renderer_image(renderer, "reflections", &image), ES_OK);
    es_renderer_destroy(renderer);
    return image;
}

static void pixel_of(const small_world* w, es_vec3 place, double* x, double* y)
{
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w->world, w->camera, WIDTH, HEIGHT, &view), ES_OK);
    const es_mat4 clip = es_mat4_mul(view.projection, view.view);
    const es_vec4 p = es_mat4_vec4(&clip, (es_vec4){place.x, place.y, place.z, 1});
    *x = (double)(p.x / p.w * 0.5f + 0.5f) * WIDTH;
    *y = (double)(0.5f - p.y / p.w * 0.5f) * HEIGHT;
}

/* Where the ball is seen: the middle of what is brighter than anything else is. */
static bool middle(const es_image* image, double* x, double* y)
{
    double sum = 0, sx = 0, sy = 0;
    for (uint32_t j = 0; j < image->height; j++)
        for (uint32_t i = 0; i < image->width; i++) {
            const float value = image->pixels[((size_t)j * image->width + i) * image->channels];
            if (!(value > 1.0f)) continue;
            sum += (double)value;
            sx += (double)value * (i + 0.5);
            sy += (double)value * (j + 0.5);
        }
    if (!(sum > 0)) return false;
    *x = sx / sum;
    *y = sy / sum;
    return true;
}

/* Pixels, across or down, from a place to the nearest that shows the ball. */
static double nearest(const es_image* image, double x, double y)
{
    double least = INFINITY;
    for (uint32_t j = 0; j < image->height; j++)
        for (uint32_t i = 0; i < image->width; i++)
            if (image->pixels[((size_t)j * image->width + i) * image->channels] > 1.0f) least = fmin(least, fmax(fabs(i + 0.5 - x), fabs(j + 0.5 - y)));
    return least;
}

static void test_reflected_point(void** state)
{
    (void)state;
    static const char* const ways[] = {"maps", "traced"};
    for (int way = 0; way < 2; way++)
        for (int trial = 0; trial < 12; trial++) {
            const es_vec3 ball = es_v3(uniform(-1.5f, 1.5f), uniform(0.3f, 2.2f), uniform(0.7f, 2.5f));
            small_world w = mirror_world(NULL, ball);
            const es_anchor red = on_mirror(&w, uniform(0.25f, 0.5f), uniform(0.3f, 0.45f));
            const es_vec3 at = constrain(&w, red, ball);
            surround(&w, red, 3, 1);
            es_image image = reflections(&w, ways[way]);
            double x, y;
            pixel_of(&w, at, &x, &y);
            const double away = nearest(&image, x, y);
            if (!(away < 1.0)) fail_msg("%s, trial %d: the point is %.2f pixels from the handle", ways[way], trial, away);
            es_image_destroy(w.context, &image);
            small_world_destroy(&w);
        }
}

/* What lies behind the mirror is shown as well: it is not in its own way. */
static void test_behind(void** state)
{
    (void)state;
    static const char* const ways[] = {"maps", "traced"};
    for (int way = 0; way < 2; way++) {
        const es_vec3 ball = es_v3(0.3f, 1.3f, -1.5f);
        small_world w = mirror_world(NULL, ball);
        const es_anchor red = on_mirror(&w, 0.35f, 0.4f);
        const es_vec3 at = constrain(&w, red, ball);
        surround(&w, red, 3, 1);
        es_image image = reflections(&w, ways[way]);
        double x, y;
        pixel_of(&w, at, &x, &y);
        assert_true(nearest(&image, x, y) < 1.0);
        es_image_destroy(w.context, &image);
        small_world_destroy(&w);
    }
}

/* The law first: the mirror image of the ball is where it is by construction. */
static void test_without_edits(void** state)
{
    (void)state;
    const es_vec3 ball = es_v3(-0.4f, 1.1f, 1.5f);
    small_world w = mirror_world(NULL, ball);
    static const char* const ways[] = {"maps", "traced"};
    for (int way = 0; way < 2; way++) {
        es_image image = reflections(&w, ways[way]);
        double x, y, bx, by;
        pixel_of(&w, es_v3(ball.x, ball.y, -ball.z), &x, &y);
        assert_true(middle(&image, &bx, &by));
        assert_true(hypot(bx - x, by - y) < 1.0);
        es_image_destroy(w.context, &image);
    }
    small_world_destroy(&w);
}

/* Outside of the region every pixel has the bits it had. */
static void test_outside(void** state)
{
    (void)state;
    static const char* const ways[] = {"maps", "traced"};
    for (int way = 0; way < 2; way++) {
        const es_vec3 ball = es_v3(0.5f, 1.1f, 1.5f);
        small_world w = mirror_world(NULL, ball);
        es_image before = reflections(&w, ways[way]);
        const es_anchor red = on_mirror(&w, 0.4f, 0.4f);
        const es_vec3 at = constrain(&w, red, ball);
        surround(&w, red, 0.5f, 0.2f);
        es_image after = reflections(&w, ways[way]);
        size_t changed = 0;
        for (uint32_t y = 0; y < HEIGHT; y++)
            for (uint32_t x = 0; x < WIDTH; x++) {
                const es_vec3 p = pixel_on_plane(&w, WIDTH, HEIGHT, x, y, es_v3(0, 0, 0), es_v3(0, 0, 1));
                const size_t i = ((size_t)y * WIDTH + x) * before.channels;
                const bool same = memcmp(before.pixels + i, after.pixels + i, before.channels * sizeof(float)) == 0;
                changed += !same;
                if (hypotf(p.x - at.x, p.y - at.y) > 0.501f) assert_true(same);
            }
        assert_true(changed > 0);
        es_image_destroy(w.context, &before);
        es_image_destroy(w.context, &after);
        small_world_destroy(&w);
    }
}

static void test_same_everywhere(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        const es_vec3 ball = es_v3(0.5f, 1.1f, 1.5f);
        small_world w = mirror_world(context, ball);
        const es_anchor red = on_mirror(&w, 0.4f, 0.4f);
        constrain(&w, red, ball);
        surround(&w, red, 0.8f, 0.2f);
        es_image image = reflections(&w, "maps");
        expect_same_bits(&same, image.pixels, (size_t)WIDTH * HEIGHT * image.channels * sizeof(float));
        es_image_destroy(context, &image);
        es_world_destroy(w.world);
        es_context_destroy(context);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_without_edits),
        unit_test_without_races(test_reflected_point),
        unit_test_without_races(test_behind),
        unit_test_without_races(test_outside),
        cmocka_unit_test(test_same_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
