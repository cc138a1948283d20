/* Eyes where they should not be: inside of things, on a corner, an edge, a plane; a near plane through everything; fields of view from 1 to
 * 170 degrees. What is seen is what rays from there see, pixel by pixel. */
#include "tests/stress/stress.h"

enum { WIDTH = 80, HEIGHT = 60, PIXELS = WIDTH * HEIGHT };

typedef struct seen { size_t pixels, apart, dark, light; } seen;

/* The renderer's direct light against rays through the pixels' centres. `apart`: pixels where one sees something and the other nothing;
 * `dark`, `light`: where one is lit and the other is not by half. */
static seen against_rays(stress* s, const es_renderer_settings* settings, const char* what)
{
    seen result = {0};
    es_renderer* renderer = stress_render(s, settings);
    assert_all_finite(s, renderer, what);
    es_image direct = stress_image(renderer, "direct"), depth = stress_image(renderer, "depth"), truth, glow;
    es_reference_settings reference_settings = es_default_reference_settings();
    reference_settings.width = WIDTH;
    reference_settings.height = HEIGHT;
    reference_settings.bounces = 0;
    reference_settings.antialias = false;
    reference_settings.quantised = true;
    reference_settings.emission = false; /* seen, but lighting nothing */
    es_reference* reference;
    assert_int_equal(es_reference_create(s->context, &reference_settings, &reference), ES_OK);
    assert_int_equal(es_reference_begin(reference, s->world), ES_OK);
    /* all lights in turn: enough samples that each pixel has met every one */
    assert_int_equal(es_reference_add(reference, 16), ES_OK);
    assert_int_equal(es_reference_image(reference, "direct", &truth), ES_OK);
    assert_int_equal(es_reference_image(reference, "emission", &glow), ES_OK);
    double mean = mean_of_image(&truth);
    for (size_t i = 0; i < PIXELS; i++) {
        result.pixels += depth.pixels[i] > 0;
        result.apart += (depth.pixels[i] > 0) != (glow.pixels[3 * i] > 0);
        float a = direct.pixels[3 * i], b = truth.pixels[3 * i];
        result.dark += a < 0.5f * b && (double)b > 0.1 * mean + 1e-6;
        result.light += b < 0.5f * a && (double)a > 0.1 * mean + 1e-6;
    }
    es_image_destroy(s->context, &direct);
    es_image_destroy(s->context, &depth);
    es_image_destroy(s->context, &truth);
    es_image_destroy(s->context, &glow);
    es_reference_destroy(reference);
    es_renderer_destroy(renderer);
    return result;
}

/* A room whose surfaces glow a little, so that a ray tells that it met one. */
static stress glowing_room(void)
{
    stress s = stress_open(1, es_v3(0, 0, 0));
    es_material_desc white = matte(0.75f, 0.75f, 0.75f), red = matte(0.7f, 0.1f, 0.1f), gold = polished(0.9f, 0.7f, 0.3f, 0.4f);
    es_material_desc* const all[] = {&white, &red, &gold};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) all[i]->emission[k] = 0.001f;
    stress_box(&s, es_v3(-2, 0, -2), es_v3(2, 3, 2), true, &white);
    stress_box(&s, es_v3(0.5f, 0, -1), es_v3(1.25f, 1.5f, -0.25f), false, &red);
    stress_ball(&s, es_v3(-0.75f, 0.75f, -0.5f), 0.75f, 16, false, &gold);
    stress_rectangle(&s, es_v3(-0.5f, 0.5f, 0.5f), es_v3(1, 0, 0), es_v3(0, 1, 0), &red);
    stress_light(&s, ES_LIGHT_POINT, 10, es_v3(0.1f, 2.6f, 1.1f), es_v3(0, -1, 0));
    return s;
}

static es_renderer_settings settings_of(uint32_t method)
{
    es_renderer_settings settings = stress_settings(WIDTH, HEIGHT, method);
    settings.vpls = 32;
    settings.shadow_size = 1024;
    return settings;
}

static void judge(seen got, const char* what, size_t leaks)
{
    printf("    %-50s %4zu pixels seen, %zu apart, %zu too dark, %zu too light\n", what, got.pixels, got.apart, got.dark, got.light);
    /* snapped corners move edges by a 1/512 of a pixel, shadow maps edges of shadows by a texel */
    if (got.apart > 4) fail_msg("%s: rays see other things in %zu pixels", what, got.apart);
    if (got.dark > PIXELS / 50 || got.light > leaks) fail_msg("%s: %zu pixels are darker, %zu lighter than by rays", what, got.dark, got.light);
}

/* ---- places -------------------------------------------------------------------------------------------------------------------------- */

/* Inside of what is closed the lamp gives a ring of light where its rays graze the walls: the bias of shadow maps (tests/stress/bias.c). */
static void inside_and_upon(void** state)
{
    (void)state;
    static const struct { const char* what; es_vec3 eye, at; } places[] = {
        {"in the middle", {0, 1.5f, 1.5f}, {0, 1, -1}},
        {"inside the box", {0.9f, 0.75f, -0.6f}, {0, 0.75f, -2}},
        {"inside the ball", {-0.75f, 0.75f, -0.5f}, {1, 0.8f, 0}},
        {"in the plane of the sheet, along it", {1.5f, 1, 0.5f}, {-1, 1, 0.5f}},
        {"on the sheet, looking through", {0.1f, 1, 0.5f}, {0.1f, 1, -2}},
        {"on the sheet, looking away", {0.1f, 1, 0.5f}, {0.1f, 1, 2}},
        {"on the floor", {0, 0, 1.5f}, {0, 0.5f, 0}},
        {"on the floor, along it", {0, 0, 1.5f}, {0, 0, -1}},
        {"on an edge of the box", {0.5f, 1.5f, -0.6f}, {-0.5f, 1, 1}},
        {"on a corner of the box", {0.5f, 1.5f, -0.25f}, {-0.5f, 1, 1}},
        {"on a corner of the room", {-2, 0, 2}, {1, 1, -1}},
        {"on a corner of the ball", {-0.75f, 1.5f, -0.5f}, {1, 1.2f, 1}},
        {"outside", {0, 1.5f, 8}, {0, 1.5f, 0}},
        {"in the lamp", {0.1f, 2.6f, 1.1f}, {0, 0, -0.5f}},
    };
    for (size_t i = 0; i < sizeof places / sizeof *places; i++)
        for (uint32_t method = ES_GI_NONE; method <= ES_GI_VPL_TRACED; method++) {
            stress s = glowing_room();
            stress_look(&s, places[i].eye, places[i].at, 0.9f, 1e-4f);
            es_renderer_settings settings = settings_of(method);
            if (method == ES_GI_NONE) {
                judge(against_rays(&s, &settings, places[i].what), places[i].what, i == 1 || i == 2 ? PIXELS / 12 : PIXELS / 50);
            } else {
                es_renderer* renderer = stress_render(&s, &settings);
                assert_all_finite(&s, renderer, places[i].what);
                es_renderer_destroy(renderer);
            }
            stress_close(&s);
        }
}

/* From outside through a wall, the sheet, the box and out again: each frame is finite, moves its pixels by finite amounts and is what a fresh
 * renderer draws. */
static void through_everything(void** state)
{
    (void)state;
    stress s = glowing_room();
    stress_look(&s, es_v3(0.6f, 0.9f, 3), es_v3(0.65f, 0.9f, 0), 0.9f, 0.05f);
    es_camera_desc camera;
    es_transform t;
    assert_int_equal(es_world_get_camera(s.world, s.camera, &camera), ES_OK);
    es_renderer_settings settings = settings_of(ES_GI_ISM);
    es_renderer* renderer = stress_render(&s, &settings);
    for (int frame = 0; frame <= 48; frame++) {
        assert_int_equal(es_world_get_node_transform(s.world, camera.node, &t), ES_OK);
        t.translation.z = 3 - 0.125f * (float)frame; /* lands on the planes of the walls, the sheet and the box */
        assert_int_equal(es_world_set_node_transform(s.world, camera.node, &t), ES_OK);
        assert_int_equal(es_renderer_render(renderer, s.world), ES_OK);
        assert_all_finite(&s, renderer, "through everything");
        if (frame % 4 == 0) {
            es_renderer* fresh = stress_render(&s, &settings);
            es_image a = stress_image(renderer, "radiance"), b = stress_image(fresh, "radiance");
            assert_true(es_image_hash(&a) == es_image_hash(&b));
            es_image_destroy(s.context, &a);
            es_image_destroy(s.context, &b);
            es_renderer_destroy(fresh);
        }
        assert_int_equal(es_world_step(s.world, 0), ES_OK);
    }
    es_renderer_destroy(renderer);
    stress_close(&s);
}

/* ---- near planes ------------------------------------------------------------------------------------------------------------------------ */

/* What lies before the near plane is cut off, whatever is behind is as far as it was; beyond everything there is nothing, which is black. */
static void near_planes(void** state)
{
    (void)state;
    static const float planes[] = {1e-6f, 1e-3f, 0.1f, 0.9f, 1.0f, 2.0f, 3.0f, 3.5f, 4.2f, 1e6f};
    float first[PIXELS];
    for (size_t i = 0; i < sizeof planes / sizeof *planes; i = stress_next(i, sizeof planes / sizeof *planes))
        for (uint32_t method = ES_GI_NONE; method <= ES_GI_VPL_TRACED; method++) {
            stress s = glowing_room();
            stress_look(&s, es_v3(0.1f, 1.4f, 1.5f), es_v3(0, 1, -1), 0.9f, planes[i]);
            es_renderer_settings settings = settings_of(method);
            char what[40];
            snprintf(what, sizeof what, "near plane at %g m", (double)planes[i]);
            if (method == ES_GI_NONE) judge(against_rays(&s, &settings, what), what, PIXELS / 12);
            es_renderer* renderer = stress_render(&s, &settings);
            assert_all_finite(&s, renderer, what);
            es_image depth = stress_image(renderer, "depth"), radiance = stress_image(renderer, "radiance");
            for (size_t k = 0; k < PIXELS; k++) {
                float d = depth.pixels[k];
                if (!i) first[k] = d;
                if (d > 0 && !(d >= planes[i] * 0.999999f)) fail_msg("near plane %g: something is seen at %g", (double)planes[i], (double)d);
                if (first[k] > planes[i] * 1.00001f && !(fabsf(d / first[k] - 1) < 1e-4f)) fail_msg("near plane %g: what was at %g is at %g", (double)planes[i], (double)first[k], (double)d);
                if (planes[i] == 1e6f && !(d == 0 && radiance.pixels[3 * k] == 0)) fail_msg("before a near plane of 1e6 m something is seen");
            }
            es_image_destroy(s.context, &depth);
            es_image_destroy(s.context, &radiance);
            es_renderer_destroy(renderer);
            stress_close(&s);
        }
}

/* ---- fields of view --------------------------------------------------------------------------------------------------------------------- */

static void fields_of_view(void** state)
{
    (void)state;
    static const float degrees[] = {1, 2, 5, 20, 60, 90, 120, 150, 165, 170};
    for (size_t i = 0; i < sizeof degrees / sizeof *degrees; i = stress_next(i, sizeof degrees / sizeof *degrees))
        for (uint32_t method = ES_GI_NONE; method <= ES_GI_VPL_TRACED; method++) {
            char what[40];
            snprintf(what, sizeof what, "%g degrees high", (double)degrees[i]);
            stress s = glowing_room();
            /* at an edge of the box's shadow and of the ball */
            stress_look(&s, es_v3(0.1f, 1.4f, 1.8f), es_v3(-0.2f, 0.6f, -1), degrees[i] * ES_PI / 180, 0.01f);
            es_renderer_settings settings = settings_of(method);
            if (method == ES_GI_NONE) {
                seen got = against_rays(&s, &settings, what);
                if (degrees[i] >= 5) judge(got, what, PIXELS / 50);
                /* at 1 degree a texel of the shadow map is ten pixels wide: only what is seen is compared */
                else if (got.apart > 4 || got.pixels < PIXELS - 4) fail_msg("%s: rays see other things in %zu pixels", what, got.apart);
            } else {
                es_renderer* renderer = stress_render(&s, &settings);
                assert_all_finite(&s, renderer, what);
                es_renderer_destroy(renderer);
            }
            stress_close(&s);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(inside_and_upon),
        cmocka_unit_test(through_everything),
        cmocka_unit_test(near_planes),
        cmocka_unit_test(fields_of_view),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
