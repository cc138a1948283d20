/* Edited reflections in whole frames: highlights and micro-buffers follow them, diffuse light and shadows stay, the rest of the picture is the same bits; and the frames are
 * the same with and without skipping, on every instruction set and number of threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "platform/random.h"
#include "tests/races.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

enum { WIDTH = 96, HEIGHT = 72 };

static es_material_desc glossy(float roughness)
{
    es_material_desc d = es_default_material_desc();
    d.metallic = 1.0f;
    d.roughness = roughness;
    return d;
}

/* A glossy floor with a matt rim, lit by one lamp, seen from above at a slant. */
static small_world floor_world(es_context* context, float metallic)
{
    small_world w = {0};
    if (context) {
        w.context = context;
        assert_int_equal(es_world_create(context, NULL, &w.world), ES_OK);
    } else w = small_world_create();
    es_material_desc m = glossy(0.3f), matt = lambert(0.6f, 0), glow = lambert(0.3f, 2);
    m.metallic = metallic;
    add_rectangle(&w, es_v3(-1, 0, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &m);
    add_rectangle(&w, es_v3(-3, 0, -1), es_v3(6, 0, 0), es_v3(0, 0, -2), &matt);
    add_rectangle(&w, es_v3(-1.2f, 0, -1.4f), es_v3(0.6f, 0, 0), es_v3(0, 0.7f, 0), &glow);
    es_light_desc lamp = es_default_light_desc();
    lamp.type = ES_LIGHT_POINT;
    lamp.intensity = 8;
    add_light(&w, lamp, es_v3(0, 1.5f, -1), es_v3(0, -1, 0));
    look(&w, (es_camera_desc){.fov_y = 0.8f, .near_plane = 0.01f}, es_v3(0, 1.5f, 2), es_v3(0, 0, 0));
    return w;
}

static es_instance instance_at(const small_world* w, size_t index)
{
    uint32_t ids[16];
    size_t count = 16;
    assert_int_equal(es_world_enumerate(w->world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    return (es_instance){ids[index]};
}

/* A point of the floor, by u and v of its first triangle. */
static es_anchor on_floor(const small_world* w, float u, float v)
{
    es_anchor anchor;
    assert_int_equal(es_world_anchor_of_triangle(w->world, instance_at(w, 0), 0, u, v, &anchor), ES_OK);
    return anchor;
}

static es_constraint constrain(small_world* w, es_anchor red, double x, double y, double z)
{
    es_constraint_desc desc = es_default_constraint_desc();
    es_constraint constraint;
    desc.reflecting = red;
    desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {x, y, z}};
    desc.eye[1] = 1.5;
    desc.eye[2] = 2.0;
    assert_int_equal(es_world_add_constraint(w->world, &desc, &constraint), ES_OK);
    return constraint;
}

static es_region surround(small_world* w, es_anchor centre, float radius, float border)
{
    es_region_desc desc = es_default_region_desc();
    es_region region;
    desc.centre = centre;
    desc.radius = radius;
    desc.border = border;
    assert_int_equal(es_world_add_region(w->world, &desc, &region), ES_OK);
    return region;
}

static es_renderer* renderer_of(es_context* context, const char* const* settings, bool skip)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE; /* their light is filtered, lobes and all */
    s.skip = skip;
    for (; settings && *settings; settings += 2) assert_int_equal(es_renderer_settings_set(context, &s, settings[0], settings[1]), ES_OK);
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, &s, &renderer), ES_OK);
    return renderer;
}

static es_image image_of(es_renderer* renderer, small_world* w, const char* name)
{
    es_image image;
    assert_int_equal(es_world_step(w->world, 0), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static es_image picture(small_world* w, const char* const* settings, const char* name)
{
    es_renderer* renderer = renderer_of(w->context, settings, true);
    es_image image = image_of(renderer, w, name);
    es_renderer_destroy(renderer);
    return image;
}

static float value(const es_image* image, uint32_t x, uint32_t y) { return image->pixels[((size_t)y * image->width + x) * image->channels]; }

/* The pixel of a place, and the brightest of an image's first channel. */
static void pixel_of(const small_world* w, es_vec3 place, float* x, float* y)
{
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w->world, w->camera, WIDTH, HEIGHT, &view), ES_OK);
    const es_mat4 clip = es_mat4_mul(view.projection, view.view);
    const es_vec4 p = es_mat4_vec4(&clip, (es_vec4){place.x, place.y, place.z, 1});
    *x = (p.x / p.w * 0.5f + 0.5f) * WIDTH;
    *y = (0.5f - p.y / p.w * 0.5f) * HEIGHT;
}
static void brightest(const es_image* image, float* x, float* y)
{
    float best = -1;
    for (uint32_t j = 0; j < image->height; j++)
        for (uint32_t i = 0; i < image->width; i++)
            if (value(image, i, j) > best) {
                best = value(image, i, j);
                *x = (float)i + 0.5f;
                *y = (float)j + 0.5f;
            }
}

/* ---- light ---------------------------------------------------------------------------------------------------------------------------- */

/* A constraint that shows the lamp at the red handle brings its highlight there. */
static void test_highlight_moves(void** state)
{
    (void)state;
    static const float places[][2] = {{0.2f, 0.4f}, {0.45f, 0.3f}, {0.3f, 0.15f}};
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        small_world w = floor_world(NULL, 1);
        const es_anchor red = on_floor(&w, places[i][0], places[i][1]);
        double at[3];
        assert_true(es_world_resolve_anchor(w.world, &red, at, NULL));
        constrain(&w, red, 0, 1.5, -1);
        surround(&w, red, 3, 0);
        es_image image = picture(&w, NULL, "direct");
        float x, y, bx = 0, by = 0;
        pixel_of(&w, es_v3((float)at[0], (float)at[1], (float)at[2]), &x, &y);
        brightest(&image, &bx, &by);
        /* the lobe's peak leans towards where the surface is nearer to lamp and eye */
        assert_true(hypotf(bx - x, by - y) < 9.0f);
        es_image_destroy(w.context, &image);
        small_world_destroy(&w);
    }
}

/* Shadows and diffuse light are the same bits; so is all that no region covers. */
static void test_the_rest_stays(void** state)
{
    (void)state;
    static const char* const micro[] = {"gi", "micro", NULL};
    for (int turn = 0; turn < 2; turn++) {
        small_world w = floor_world(NULL, 0.5f);
        es_image before = picture(&w, turn ? micro : NULL, turn ? "indirect" : "direct");
        es_image shadow_before = picture(&w, NULL, "normal");
        const es_anchor red = on_floor(&w, 0.3f, 0.3f);
        constrain(&w, red, 1, 0.5, 0.2);
        double at[3];
        assert_true(es_world_resolve_anchor(w.world, &red, at, NULL));
        surround(&w, red, 0.4f, 0.1f);
        es_image after = picture(&w, turn ? micro : NULL, turn ? "indirect" : "direct");
        es_image shadow_after = picture(&w, NULL, "normal");
        size_t changed = 0;
        double away = 0, sum = 0;
        for (uint32_t y = 0; y < HEIGHT; y++)
            for (uint32_t x = 0; x < WIDTH; x++) {
                const es_vec3 p = pixel_on_plane(&w, WIDTH, HEIGHT, x, y, es_v3(0, 0, 0), es_v3(0, 1, 0));
                const bool inside = hypotf(p.x - (float)at[0], p.z - (float)at[2]) < 0.4f, same = value(&before, x, y) == value(&after, x, y);
                changed += !same;
                if (!inside && !turn) assert_true(same);
                /* gather points in one cell share what is far from it, and those that look elsewhere are in another cell */
                if (turn && hypotf(p.x - (float)at[0], p.z - (float)at[2]) > 0.6f) {
                    away += fabs((double)value(&before, x, y) - (double)value(&after, x, y));
                    sum += (double)value(&before, x, y);
                }
            }
        assert_true(changed > 50);
        if (turn) assert_true(away < 0.01 * sum);
        assert_memory_equal(shadow_before.pixels, shadow_after.pixels, (size_t)WIDTH * HEIGHT * shadow_before.channels * sizeof(float));
        es_image_destroy(w.context, &before);
        es_image_destroy(w.context, &after);
        es_image_destroy(w.context, &shadow_before);
        es_image_destroy(w.context, &shadow_after);
        small_world_destroy(&w);
    }
}

/* What is matt reflects nothing that could be edited. */
static void test_diffuse_stays(void** state)
{
    (void)state;
    small_world w = small_world_create();
    const es_material_desc m = lambert(0.5f, 0);
    add_rectangle(&w, es_v3(-1, 0, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &m);
    es_light_desc lamp = es_default_light_desc();
    lamp.type = ES_LIGHT_POINT;
    add_light(&w, lamp, es_v3(0, 1.5f, -1), es_v3(0, -1, 0));
    look(&w, (es_camera_desc){.fov_y = 0.8f, .near_plane = 0.01f}, es_v3(0, 1.5f, 2), es_v3(0, 0, 0));
    static const char* const vpls[] = {"gi", "ism", NULL};
    es_image before = picture(&w, vpls, "radiance");
    const es_anchor red = on_floor(&w, 0.3f, 0.3f);
    constrain(&w, red, 1, 0.5, 0.2);
    surround(&w, red, 5, 0);
    es_image after = picture(&w, vpls, "radiance");
    assert_memory_equal(before.pixels, after.pixels, (size_t)WIDTH * HEIGHT * before.channels * sizeof(float));
    es_image_destroy(w.context, &before);
    es_image_destroy(w.context, &after);
    small_world_destroy(&w);
}

/* A constraint that says what the law says changes nothing but rounding. */
static void test_lawful_constraint(void** state)
{
    (void)state;
    small_world w = floor_world(NULL, 1);
    es_image before = picture(&w, NULL, "direct");
    const es_anchor red = on_floor(&w, 0.3f, 0.3f);
    double at[3];
    assert_true(es_world_resolve_anchor(w.world, &red, at, NULL));
    /* the eye's mirror image, prolonged */
    constrain(&w, red, 2 * at[0], 1.5, 2 * at[2] - 2);
    surround(&w, red, 5, 1);
    es_image after = picture(&w, NULL, "direct");
    float most = 0;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * before.channels; i++) most = fmaxf(most, before.pixels[i]);
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT * before.channels; i++) assert_true(fabsf(before.pixels[i] - after.pixels[i]) < 1e-3f * most);
    es_image_destroy(w.context, &before);
    es_image_destroy(w.context, &after);
    small_world_destroy(&w);
}

/* ---- contracts ------------------------------------------------------------------------------------------------------------------------ */

static uint32_t counter;
static uint32_t dice(uint32_t sides) { return es_random_u32(5, counter++) % sides; }

/* One random change to what is edited. */
static void change(small_world* w, es_constraint constraints[2], es_region regions[2])
{
    es_constraint_desc c;
    es_region_desc r;
    const uint32_t which = dice(2);
    switch (dice(7)) {
    case 0:
        assert_int_equal(es_world_get_constraint(w->world, constraints[which], &c), ES_OK);
        c.reflected.point[dice(3)] += 0.3;
        assert_int_equal(es_world_set_constraint(w->world, constraints[which], &c), ES_OK);
        break;
    case 1:
        assert_int_equal(es_world_get_constraint(w->world, constraints[which], &c), ES_OK);
        c.reflecting = on_floor(w, 0.1f * (float)dice(5), 0.1f * (float)dice(5));
        assert_int_equal(es_world_set_constraint(w->world, constraints[which], &c), ES_OK);
        break;
    case 2:
        assert_int_equal(es_world_get_region(w->world, regions[which], &r), ES_OK);
        r.radius = 0.2f + 0.3f * (float)dice(5);
        r.type = dice(2) ? ES_REGION_GEODESIC : ES_REGION_EUCLIDEAN;
        assert_int_equal(es_world_set_region(w->world, regions[which], &r), ES_OK);
        break;
    case 3:
        assert_int_equal(es_world_get_region(w->world, regions[which], &r), ES_OK);
        r.off = !r.off;
        assert_int_equal(es_world_set_region(w->world, regions[which], &r), ES_OK);
        break;
    case 4:
        assert_int_equal(es_world_get_constraint(w->world, constraints[which], &c), ES_OK);
        c.off = !c.off;
        assert_int_equal(es_world_set_constraint(w->world, constraints[which], &c), ES_OK);
        break;
    case 5: {
        const double from[3] = {0.1 * (double)dice(5), 1.2, 1.5};
        assert_int_equal(es_world_freeze_reflections(w->world, dice(2) ? from : NULL), ES_OK);
        break;
    }
    default: break;
    }
}

static void test_skipping(void** state)
{
    (void)state;
    static const char* const settings[][11] = {{NULL}, {"gi", "ism", "vpl.count", "64", NULL}, {"gi", "micro", NULL}, {"gi", "ism", "vpl.count", "64", "half-resolution", "on", NULL}, {"lamps", "maps", "temporal", "on", NULL}};
    for (size_t k = 0; k < sizeof settings / sizeof *settings; k++) {
        small_world w = floor_world(NULL, 0.8f);
        const es_anchor a = on_floor(&w, 0.3f, 0.3f), b = on_floor(&w, 0.4f, 0.1f);
        es_constraint constraints[2] = {constrain(&w, a, 0.5, 1, -1), constrain(&w, b, -0.5, 1, -1)};
        es_region regions[2] = {surround(&w, a, 0.5f, 0.2f), surround(&w, b, 0.5f, 0.2f)};
        es_renderer *skipping = renderer_of(w.context, settings[k], true), *plain = renderer_of(w.context, settings[k], false);
        for (int frame = 0; frame < 8; frame++) {
            change(&w, constraints, regions);
            assert_int_equal(es_world_step(w.world, 0), ES_OK);
            es_image images[2];
            es_renderer* both[2] = {skipping, plain};
            for (int i = 0; i < 2; i++) {
                assert_int_equal(es_renderer_render(both[i], w.world), ES_OK);
                assert_int_equal(es_renderer_image(both[i], "radiance", &images[i]), ES_OK);
            }
            assert_memory_equal(images[0].pixels, images[1].pixels, (size_t)WIDTH * HEIGHT * images[0].channels * sizeof(float));
            for (int i = 0; i < 2; i++) es_image_destroy(w.context, &images[i]);
        }
        es_renderer_destroy(skipping);
        es_renderer_destroy(plain);
        small_world_destroy(&w);
    }
}

static void test_same_everywhere(void** state)
{
    (void)state;
    static const char* const settings[] = {"gi", "ism", "vpl.count", "64", NULL};
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        small_world w = floor_world(context, 0.8f);
        const es_anchor a = on_floor(&w, 0.3f, 0.3f);
        constrain(&w, a, 0.5, 1, -1);
        surround(&w, a, 0.7f, 0.3f);
        es_image image = picture(&w, settings, "radiance");
        expect_same_bits(&same, image.pixels, (size_t)WIDTH * HEIGHT * image.channels * sizeof(float));
        es_image_destroy(context, &image);
        es_world_destroy(w.world);
        es_context_destroy(context);
    }
}

/* Instances that go away take their edits' effect with them. */
static void test_gone(void** state)
{
    (void)state;
    small_world w = floor_world(NULL, 1);
    const es_anchor red = on_floor(&w, 0.3f, 0.3f);
    constrain(&w, red, 0.5, 1, -1);
    surround(&w, red, 1, 0.2f);
    es_image image = picture(&w, NULL, "direct");
    es_image_destroy(w.context, &image);
    assert_int_equal(es_world_destroy_instance(w.world, instance_at(&w, 0)), ES_OK);
    es_renderer* renderer = renderer_of(w.context, NULL, true);
    image = image_of(renderer, &w, "direct");
    const es_frame_stats* stats = es_renderer_stats(renderer);
    bool found = false;
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!strcmp(stats->passes[i].name, "reflection edits")) {
            found = true;
            assert_non_null(stats->passes[i].skipped);
        }
    assert_true(found);
    es_renderer_destroy(renderer);
    es_image_destroy(w.context, &image);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_highlight_moves),
        unit_test_without_races(test_the_rest_stays),
        unit_test_without_races(test_diffuse_stays),
        unit_test_without_races(test_lawful_constraint),
        unit_test_without_races(test_skipping),
        cmocka_unit_test(test_same_everywhere),
        unit_test_without_races(test_gone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
