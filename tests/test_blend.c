/* Blended surfaces: what they show against sums done by hand and against the reference, what light makes of them, and what they must not depend on or cost. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

#include "tests/pictures.h"
#include "tests/races.h"
#include "tests/reference_runs.h"
#include "tests/same_bits.h"

enum { WIDTH = 75, HEIGHT = 54, PIXELS = WIDTH * HEIGHT };

static es_renderer_settings settings_of(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 64;
    s.light_size = 64;
    s.shadow_size = 256;
    s.ism_size = 32;
    s.ism_points = 256;
    s.ism_pool = 4096;
    s.interleave = 2;
    s.lamp_count = 32;
    s.lamp_size = 32;
    s.lamp_interleave = 2;
    s.second_lights = 40;
    s.second_negative = 20;
    s.micro_points = 1024;
    s.micro_size = 8;
    return s;
}

static es_material_desc glowing(const float emission[3], float alpha, bool blend)
{
    es_material_desc d = lambert(0, 0);
    memcpy(d.emission, emission, sizeof d.emission);
    d.base_color[3] = alpha;
    d.blend = blend;
    return d;
}

/* ---- compositing ------------------------------------------------------------------------------------------------------------------ */

/* Sheets across the view at z = -1, -2, …, before a wall, none of them lit. */
typedef struct sheet { float emission[3], alpha; } sheet;
static const float wall[3] = {1, 2, 0.5f};
static const sheet sheets[6] = {{{0.5f, 0, 8}, 0.25f}, {{2, 1, 0}, 0.5625f}, {{0, 4, 0.25f}, 0.75f}, {{16, 0, 0}, 0.375f}, {{0, 0, 32}, 0.125f}, {{4, 4, 4}, 0.625f}};

static void add_sheet(small_world* w, float z, const es_material_desc* material) { add_rectangle(w, es_v3(-4, -4, z), es_v3(8, 0, 0), es_v3(0, 8, 0), material); }

static small_world sheets_before_wall(const uint32_t* order, uint32_t count, bool blend)
{
    small_world w = small_world_create();
    for (uint32_t i = 0; i < count; i++) {
        const es_material_desc m = glowing(sheets[order[i]].emission, sheets[order[i]].alpha, blend);
        add_sheet(&w, -1.0f - (float)order[i], &m);
    }
    const es_material_desc m = glowing(wall, 1, false);
    add_rectangle(&w, es_v3(-20, -20, -9), es_v3(40, 0, 0), es_v3(0, 40, 0), &m);
    es_camera_desc camera = es_default_camera_desc();
    look(&w, camera, es_v3(0, 0, 1), es_v3(0, 0, 0));
    return w;
}

/* Of `count` sheets the nearest `layers`; back to front, as it is written in books. */
static void expected(uint32_t count, uint32_t layers, double colour[3], double* transmittance)
{
    *transmittance = 1;
    for (int k = 0; k < 3; k++) colour[k] = (double)wall[k];
    for (uint32_t i = count < layers ? count : layers; i-- > 0;) {
        const double a = (double)sheets[i].alpha;
        for (int k = 0; k < 3; k++) colour[k] = a * (double)sheets[i].emission[k] + (1 - a) * colour[k];
        *transmittance *= 1 - a;
    }
}

static void test_compositing(void** state)
{
    (void)state;
    static const uint32_t orders[2][6] = {{0, 1, 2, 3, 4, 5}, {5, 3, 1, 0, 4, 2}};
    for (uint32_t count = 0; count <= 6; count++)
        for (uint32_t layers = 1; layers <= 4; layers++) {
            es_renderer_settings s = settings_of();
            s.method = ES_GI_NONE;
            s.lamps = ES_LAMPS_NONE;
            s.blend_layers = layers;
            small_world w = sheets_before_wall(orders[0], count, true);
            es_renderer* renderer = renderer_of(w.context, &s);
            render(renderer, w.world);
            es_image radiance = picture(renderer, "radiance"), share = picture(renderer, "opacity");
            double colour[3], transmittance;
            expected(count, layers, colour, &transmittance);
            for (size_t i = 0; i < PIXELS; i++) {
                for (size_t k = 0; k < 3; k++) assert_true(fabs((double)radiance.pixels[3 * i + k] - colour[k]) <= 1e-6 * colour[k]);
                assert_true(fabs((double)share.pixels[i] - (1 - transmittance)) <= 1e-7);
            }
            es_image_destroy(w.context, &share);
            es_renderer_destroy(renderer);
            if (count == 6) {
                /* whatever order they are drawn in, to the bit */
                small_world other = sheets_before_wall(orders[1], count, true);
                es_image again = picture_of(&other, &s, "radiance");
                assert_memory_equal(again.pixels, radiance.pixels, PIXELS * 3 * sizeof(float));
                es_image_destroy(other.context, &again);
                small_world_destroy(&other);
            }
            es_image_destroy(w.context, &radiance);
            small_world_destroy(&w);
        }
}

/* Without layers they are masked: what has alpha of a half or more hides what is behind, the rest is not there. */
static void test_masked_without_layers(void** state)
{
    (void)state;
    static const uint32_t order[3] = {0, 1, 2};
    small_world w = sheets_before_wall(order, 3, true);
    es_renderer_settings s = settings_of();
    s.blend_layers = 0;
    es_renderer* renderer = renderer_of(w.context, &s);
    render(renderer, w.world);
    assert_string_equal(pass_of(renderer, "blended layers")->skipped, "blend.layers is 0");
    es_image radiance = picture(renderer, "radiance");
    for (size_t i = 0; i < PIXELS; i++) assert_memory_equal(radiance.pixels + 3 * i, sheets[1].emission, sizeof sheets[1].emission);
    es_image_destroy(w.context, &radiance);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* ---- a lit world ------------------------------------------------------------------------------------------------------------------- */

typedef struct scene_parts { float alpha; bool blend, present, lamp; } scene_parts;

/* A box that is open towards the camera, a lamp in it, and across it two panes at a slant, one of which is textured in stripes. */
static small_world box_with_panes_in(es_context* context, scene_parts p)
{
    small_world w = {.context = context};
    assert_int_equal(es_world_create(w.context, NULL, &w.world), ES_OK);
    es_material_desc grey = lambert(0.7f, 0), red = grey, green = grey;
    red.base_color[1] = red.base_color[2] = 0.1f;
    green.base_color[0] = green.base_color[2] = 0.15f;
    add_rectangle(&w, es_v3(-1, -1, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &grey);
    add_rectangle(&w, es_v3(-1, 1, -1), es_v3(2, 0, 0), es_v3(0, 0, 2), &grey);
    add_rectangle(&w, es_v3(-1, -1, -1), es_v3(2, 0, 0), es_v3(0, 2, 0), &grey);
    add_rectangle(&w, es_v3(-1, -1, 1), es_v3(0, 0, -2), es_v3(0, 2, 0), &red);
    add_rectangle(&w, es_v3(1, -1, -1), es_v3(0, 0, 2), es_v3(0, 2, 0), &green);
    if (p.present) {
        es_material_desc pane = lambert(0.8f, 0);
        pane.specular = 1;
        pane.roughness = 0.4f;
        pane.base_color[0] = 0.3f;
        pane.base_color[3] = p.alpha;
        pane.blend = p.blend;
        pane.double_sided = true;
        add_rectangle(&w, es_v3(-0.8f, -0.9f, 0.3f), es_v3(1.2f, 0, -0.4f), es_v3(0, 1.3f, 0.1f), &pane);
        pane.base_color[0] = 0.9f;
        pane.base_color[1] = 0.4f;
        pane.emission[2] = p.lamp ? 0.5f : 0;
        add_rectangle(&w, es_v3(-0.2f, -0.7f, -0.2f), es_v3(0.9f, 0, 0.3f), es_v3(0, 1.2f, -0.2f), &pane);
    }
    if (p.lamp) {
        es_material_desc lamp = lambert(0, 6);
        add_rectangle(&w, es_v3(-0.3f, 0.98f, -0.3f), es_v3(0.6f, 0, 0), es_v3(0, 0, 0.6f), &lamp);
    }
    es_light_desc spot = es_default_light_desc();
    spot.type = ES_LIGHT_POINT;
    spot.intensity = 2;
    add_light(&w, spot, es_v3(0.3f, 0.6f, 0.7f), es_v3(0, -1, 0));
    es_camera_desc camera = es_default_camera_desc();
    look(&w, camera, es_v3(0.1f, 0.1f, 3), es_v3(0, 0, 0));
    return w;
}

static small_world box_with_panes_on(uint32_t threads, scene_parts p)
{
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return box_with_panes_in(context, p);
}

static small_world box_with_panes(scene_parts p) { return box_with_panes_on(2, p); }

typedef struct variant { es_gi_method method; uint32_t lamps, steps, bounces; bool screen, temporal, half; es_antialias antialias; } variant;
static const variant variants[] = {
    {.method = ES_GI_NONE, .lamps = ES_LAMPS_SCREEN},
    {.method = ES_GI_ISM, .lamps = ES_LAMPS_MAPS, .steps = 2, .bounces = 2},
    {.method = ES_GI_ISM, .lamps = ES_LAMPS_AMBIENT, .bounces = 1, .screen = true, .half = true},
    {.method = ES_GI_CLASSIC, .lamps = ES_LAMPS_NONE, .bounces = 1, .temporal = true},
    {.method = ES_GI_VPL_TRACED, .lamps = ES_LAMPS_TRACED, .bounces = 2},
    {.method = ES_GI_VPL_SAMPLED, .lamps = ES_LAMPS_NONE, .bounces = 1},
    {.method = ES_GI_MICRO, .lamps = ES_LAMPS_MAPS, .bounces = 2, .temporal = true},
    {.method = ES_GI_SECOND_ORDER, .lamps = ES_LAMPS_NONE, .bounces = 1},
};
enum { VARIANTS = sizeof variants / sizeof variants[0] };

static es_renderer_settings settings_of_variant(const variant* v)
{
    es_renderer_settings s = settings_of();
    s.method = v->method;
    s.lamps = v->lamps;
    s.bounces = v->bounces;
    s.bounce_vpls = 32;
    s.compensation_steps = v->steps;
    s.screen_bounce = v->screen;
    s.screen_layers = v->screen ? 2 : 1;
    s.temporal = v->temporal;
    s.half_resolution = v->half;
    s.antialias = v->antialias;
    s.geometry_bound = 20;
    s.micro_light = ES_MICRO_LIGHT_RADIOSITY;
    s.micro_iterations = 1;
    return s;
}

static float add(float a, float b) { return a + b; }

static void expect_sum(const es_image* whole, const es_image* parts, int count)
{
    for (size_t i = 0; i < PIXELS * 3; i++) {
        float sum = parts[0].pixels[i];
        for (int p = 1; p < count; p++) sum = add(sum, parts[p].pixels[i]);
        if (!(sum == whole->pixels[i])) fail_msg("value %zu: the parts are %.9g, the whole %.9g", i, (double)sum, (double)whole->pixels[i]);
    }
}

/* Every image adds up as it does without blended surfaces, to the bit. */
static void test_accounting(void** state)
{
    (void)state;
    for (size_t i = 0; i < VARIANTS; i++) {
        small_world w = box_with_panes((scene_parts){.alpha = 0.6f, .blend = true, .present = true, .lamp = true});
        const es_environment_desc sky = {.radiance = {0.3f, 0.4f, 0.6f}};
        assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
        es_renderer_settings s = settings_of_variant(&variants[i]);
        es_renderer* renderer = renderer_of(w.context, &s);
        render(renderer, w.world);
        assert_null(pass_of(renderer, "light of blended layers")->skipped);
        static const char* const names[] = {"radiance", "emission", "direct", "indirect", "indirect-bounded", "compensation", "negative", "compensation-1", "compensation-2", "compensation-3", "compensation-4", "screen-bounce"};
        enum { NAMES = sizeof names / sizeof names[0] };
        es_image images[NAMES];
        for (int n = 0; n < NAMES; n++) images[n] = picture(renderer, names[n]);
        expect_sum(&images[0], images + 1, 3);
        expect_sum(&images[3], images + 4, NAMES - 4);
        if (!variants[i].steps && !variants[i].screen && s.method != ES_GI_NONE) {
            es_image bounces[3] = {picture(renderer, "indirect-1"), picture(renderer, "indirect-2"), picture(renderer, "indirect-3")};
            expect_sum(&images[3], bounces, 3);
            for (int n = 0; n < 3; n++) es_image_destroy(w.context, &bounces[n]);
        }
        for (int n = 0; n < NAMES; n++) es_image_destroy(w.context, &images[n]);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}

/* What blends everywhere by nothing is not there, and by all of it is solid: not one bit of any image is another. */
static void test_ends(void** state)
{
    (void)state;
    for (int end = 0; end < 2; end++)
        for (size_t i = 0; i < VARIANTS; i++) {
            const es_renderer_settings s = settings_of_variant(&variants[i]);
            small_world blended = box_with_panes((scene_parts){.alpha = (float)end, .blend = true, .present = true});
            small_world plain = box_with_panes((scene_parts){.alpha = 1, .present = end == 1});
            es_renderer *a = renderer_of(blended.context, &s), *b = renderer_of(plain.context, &s);
            render(a, blended.world);
            render(b, plain.world);
            assert_string_equal(pass_of(a, "blended layers")->skipped, "nothing blends");
            static const char* const names[] = {"radiance", "direct", "indirect", "depth", "normal", "motion", "opacity"};
            for (size_t n = 0; n < sizeof names / sizeof names[0]; n++) {
                es_image first = picture(a, names[n]), second = picture(b, names[n]);
                assert_true(es_image_hash(&first) == es_image_hash(&second));
                es_image_destroy(blended.context, &first);
                es_image_destroy(plain.context, &second);
            }
            es_renderer_destroy(a);
            es_renderer_destroy(b);
            small_world_destroy(&blended);
            small_world_destroy(&plain);
        }
}

/* Where nothing blends, the setting says nothing and nothing is done. */
static void test_costs_nothing(void** state)
{
    (void)state;
    small_world w = box_with_panes_on(1, (scene_parts){.alpha = 0.5f, .present = true}); /* what several threads take depends on who does what */
    es_renderer_settings s = settings_of();
    uint64_t hashes[2];
    size_t bytes[2];
    for (int i = 0; i < 2; i++) {
        s.blend_layers = i ? 4 : 0;
        es_renderer* renderer = renderer_of(w.context, &s);
        render(renderer, w.world);
        bytes[i] = es_context_bytes(w.context);
        const es_pass_stats *layers = pass_of(renderer, "blended layers"), *light = pass_of(renderer, "light of blended layers");
        assert_string_equal(layers->skipped, i ? "nothing blends" : "blend.layers is 0");
        assert_string_equal(light->skipped, layers->skipped);
        assert_true(layers->milliseconds == 0 && light->milliseconds == 0 && !layers->count && !light->count);
        es_image image = picture(renderer, "radiance");
        hashes[i] = es_image_hash(&image);
        es_image_destroy(w.context, &image);
        es_renderer_destroy(renderer);
    }
    assert_true(hashes[0] == hashes[1] && bytes[0] == bytes[1]);
    small_world_destroy(&w);
}

/* The same bits on every instruction set and any number of threads, skipped or not, with anti-aliasing as well. */
static void test_bits(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        for (size_t i = 0; i < VARIANTS + 2; i++) {
            variant v = variants[i < VARIANTS ? i : 1];
            if (i >= VARIANTS) v.antialias = i == VARIANTS ? ES_ANTIALIAS_TEMPORAL : ES_ANTIALIAS_SUPERSAMPLE;
            small_world w = box_with_panes_in(context, (scene_parts){.alpha = 0.6f, .blend = true, .present = true, .lamp = true});
            es_renderer_settings s = settings_of_variant(&v), always = s;
            s.antialias_samples = always.antialias_samples = 2;
            always.skip = false;
            es_renderer *renderer = renderer_of(context, &s), *other = renderer_of(context, &always);
            for (int frame = 0; frame < 3; frame++) {
                /* nothing moves, then there is another sky */
                if (frame == 2) {
                    es_environment_desc sky = {.radiance = {0.2f, 0.1f, 0.3f}};
                    assert_int_equal(es_world_set_environment(w.world, &sky), ES_OK);
                }
                if (frame) assert_int_equal(es_world_step(w.world, 0.05f), ES_OK);
                render(renderer, w.world);
                render(other, w.world);
                es_image radiance = picture(renderer, "radiance"), again = picture(other, "radiance");
                assert_memory_equal(radiance.pixels, again.pixels, PIXELS * 3 * sizeof(float));
                expect_same_bits(&same, radiance.pixels, PIXELS * 3 * sizeof(float));
                es_image_destroy(context, &radiance);
                es_image_destroy(context, &again);
                if (frame == 1 && !v.temporal && v.antialias == ES_ANTIALIAS_NONE) {
                    assert_string_equal(pass_of(renderer, "blended layers")->skipped, "inputs unchanged");
                    assert_string_equal(pass_of(renderer, "light of blended layers")->skipped, "inputs unchanged");
                }
            }
            es_renderer_destroy(renderer);
            es_renderer_destroy(other);
            es_world_destroy(w.world);
        }
        es_context_destroy(context);
    }
}

/* ---- light -------------------------------------------------------------------------------------------------------------------------- */

/* A floor under a sheet under the sun. Mean of the floor's direct light under the sheet, which is solid from alpha of a half on and not there below. */
static double under_sheet(float alpha, const char* name, bool reference)
{
    small_world w = small_world_create();
    es_material_desc floor = lambert(0.5f, 0), sheet = lambert(0.5f, 0);
    sheet.blend = sheet.double_sided = true;
    sheet.base_color[3] = alpha;
    add_rectangle(&w, es_v3(-5, 0, 5), es_v3(10, 0, 0), es_v3(0, 0, -10), &floor);
    add_rectangle(&w, es_v3(-2, 1, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &sheet);
    es_light_desc sun = es_default_light_desc();
    sun.type = ES_LIGHT_DIRECTIONAL;
    sun.intensity = 2;
    add_light(&w, sun, es_v3(0, 4, 0), es_v3(0, -1, 0));
    es_camera_desc camera = es_default_camera_desc();
    look(&w, camera, es_v3(0, 0.6f, 1.5f), es_v3(0, 0, 0)); /* below the sheet */
    double mean = 0;
    if (reference) {
        es_reference_settings r = reference_settings(WIDTH, HEIGHT, 0);
        es_reference* run = trace(&w, &r, 4);
        es_image image = traced(run, name);
        mean = (double)image.pixels[3 * (size_t)((HEIGHT - 6) * WIDTH + WIDTH / 2)];
        es_image_destroy(w.context, &image);
        es_reference_destroy(run);
    } else {
        es_renderer_settings s = settings_of();
        s.method = ES_GI_NONE;
        es_image image = picture_of(&w, &s, name);
        mean = (double)image.pixels[3 * (size_t)((HEIGHT - 6) * WIDTH + WIDTH / 2)];
        es_image_destroy(w.context, &image);
    }
    small_world_destroy(&w);
    return mean;
}

static void test_shadows(void** state)
{
    (void)state;
    const double lit = 2 * 0.5 / 3.14159265358979;
    for (int reference = 0; reference < 2; reference++) {
        assert_true(fabs(under_sheet(0.45f, "direct", reference) - lit) < 1e-3 * lit);
        assert_true(under_sheet(0.55f, "direct", reference) == 0);
    }
}

/* Whichever side is turned to the eye is the one that is lit, by what is on that side. */
static void test_both_sides(void** state)
{
    (void)state;
    for (int side = -1; side <= 1; side += 2)
        for (int light_side = -1; light_side <= 1; light_side += 2) {
            small_world w = small_world_create();
            es_material_desc sheet = lambert(0.5f, 0);
            sheet.blend = sheet.double_sided = true;
            sheet.base_color[3] = 0.25f;
            add_rectangle(&w, es_v3(-2, -2, 0), es_v3(4, 0, 0), es_v3(0, 4, 0), &sheet);
            es_light_desc sun = es_default_light_desc();
            sun.type = ES_LIGHT_DIRECTIONAL;
            sun.intensity = 2;
            add_light(&w, sun, es_v3(0, 0, 3 * (float)light_side), es_v3(0, 0, -(float)light_side));
            es_camera_desc camera = es_default_camera_desc();
            look(&w, camera, es_v3(0, 0, 3 * (float)side), es_v3(0, 0, 0));
            es_renderer_settings s = settings_of();
            es_image image = picture_of(&w, &s, "direct");
            const double got = (double)image.pixels[3 * (size_t)(HEIGHT / 2 * WIDTH + WIDTH / 2)], lit = side == light_side ? 0.25 * 2 * 0.5 / 3.14159265358979 : 0;
            assert_true(fabs(got - lit) <= 1e-3 * lit);
            es_image_destroy(w.context, &image);
            small_world_destroy(&w);
        }
}

/* The box against the path tracer, whose camera rays stop at a pane with probability alpha. */
static void test_against_reference(void** state)
{
    (void)state;
    for (int lamp = 0; lamp < 2; lamp++) {
        small_world w = box_with_panes((scene_parts){.alpha = 0.6f, .blend = true, .present = true, .lamp = lamp});
        es_reference_settings r = reference_settings(WIDTH, HEIGHT, 1);
        r.share = 8;
        r.emission = lamp;
        es_reference* run = trace(&w, &r, 192 / FEWER);
        es_renderer_settings s = settings_of();
        s.method = ES_GI_CLASSIC;
        s.vpls = 512;
        s.lamps = lamp ? ES_LAMPS_TRACED : ES_LAMPS_NONE;
        s.lamp_count = 256;
        es_renderer* renderer = renderer_of(w.context, &s);
        render(renderer, w.world);
        static const char* const names[] = {"emission", "direct", "indirect"};
        static const double bounds[] = {0.05, 0.1, 0.2};
        for (int i = 0; i < 3; i++) {
            es_image truth = traced(run, names[i]), image = picture(renderer, names[i]);
            /* means over blocks: noise of the reference's choices is spread over pixels */
            double error = 0, power = 0;
            for (uint32_t y = 0; y + 6 <= HEIGHT; y += 6)
                for (uint32_t x = 0; x + 5 <= WIDTH; x += 5) {
                    const double a = mean_of_block(&image, NULL, x, y, 5, 6).value, b = mean_of_block(&truth, NULL, x, y, 5, 6).value;
                    error += (a - b) * (a - b);
                    power += b * b;
                }
            print_message("lamp %d: %s differs by %.4f\n", lamp, names[i], power > 0 ? sqrt(error / power) : 0);
            assert_true(sqrt(error) <= bounds[i] * sqrt(power));
            es_image_destroy(w.context, &truth);
            es_image_destroy(w.context, &image);
        }
        es_renderer_destroy(renderer);
        es_reference_destroy(run);
        small_world_destroy(&w);
    }
}

/* The reference against sums done by hand, any number of layers. */
static void test_reference_compositing(void** state)
{
    (void)state;
    static const uint32_t order[6] = {5, 3, 1, 0, 4, 2};
    small_world w = sheets_before_wall(order, 6, true);
    es_reference_settings r = reference_settings(16, 16, 0);
    es_reference* run = trace(&w, &r, 256);
    es_image image = traced(run, "emission");
    double colour[3], transmittance;
    expected(6, 6, colour, &transmittance);
    for (size_t k = 0; k < 3; k++) {
        double mean = 0;
        for (size_t i = 0; i < 256; i++) mean += (double)image.pixels[3 * i + k] / 256;
        assert_true(fabs(mean - colour[k]) <= 2e-3 * colour[k]);
    }
    es_image_destroy(w.context, &image);
    es_reference_destroy(run);
    small_world_destroy(&w);
}

/* ---- odd things ---------------------------------------------------------------------------------------------------------------------- */

/* Alpha of textures of one texel and of odd sizes, from 0 to 1. */
static void test_odd_textures(void** state)
{
    (void)state;
    static const uint32_t sizes[3][2] = {{1, 1}, {3, 5}, {7, 1}};
    for (int i = 0; i < 3; i++) {
        small_world w = small_world_create();
        uint8_t rgba[15 * 4];
        for (uint32_t t = 0; t < sizes[i][0] * sizes[i][1] * 4; t++) rgba[t] = t % 4 < 3 ? 255 : (uint8_t)(t * 37);
        es_texture texture;
        const es_texture_desc of = {.name = "odd", .width = sizes[i][0], .height = sizes[i][1], .rgba = rgba};
        assert_int_equal(es_world_add_texture(w.world, &of, &texture), ES_OK);
        es_material_desc sheet = lambert(0.5f, 0.25f);
        sheet.blend = true;
        sheet.base_color_texture.image = es_world_texture_image(w.world, texture);
        static const float uvs[8] = {-1, -1, 2, -1, 2, 2, -1, 2}, corners[12] = {-4, -4, -1, 4, -4, -1, 4, 4, -1, -4, 4, -1};
        static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
        add_instance(&w, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 2, .positions = corners, .uv0 = uvs, .indices = indices}, &sheet);
        sheet.base_color[3] = 0.5f;
        add_sheet(&w, -2, &sheet);
        es_camera_desc camera = es_default_camera_desc();
        es_light_desc sun = es_default_light_desc();
        add_light(&w, sun, es_v3(0, 0, 3), es_v3(0, 0, -1));
        look(&w, camera, es_v3(0, 0, 1), es_v3(0, 0, 0));
        es_renderer_settings s = settings_of();
        es_image radiance = picture_of(&w, &s, "radiance"), share = picture_of(&w, &s, "opacity");
        float most = 0;
        for (size_t p = 0; p < PIXELS * 3; p++) assert_true(isfinite(radiance.pixels[p]) && radiance.pixels[p] >= 0);
        for (size_t p = 0; p < PIXELS; p++) {
            assert_true(share.pixels[p] >= 0 && share.pixels[p] <= 1);
            most = fmaxf(most, share.pixels[p]);
        }
        assert_true(i == 0 || most > 0.6f);
        es_image_destroy(w.context, &radiance);
        es_image_destroy(w.context, &share);
        small_world_destroy(&w);
    }
}

/* The rasterizer's own word: 0 … 1 of whatever colours say, and 0 of what is no number; 0 where nothing is. Worlds refuse such a material. */
static void test_alpha_plane(void** state)
{
    (void)state;
    small_world w = small_world_create();
    static const float alphas[][2] = {{0.25f, 0.25f}, {3, 1}, {-2, 0},
#if !defined(ES_TRAP_FP) /* what is no number stops there */
        {NAN, 0}, {INFINITY, 1}, {-INFINITY, 0}
#endif
    };
    for (size_t i = 0; i < sizeof alphas / sizeof alphas[0]; i++) {
        float positions[4 * 8] = {-1, -1, -2, 1, 1, -1, -2, 1, 0, 1, -2, 1}, colors[4 * 8] = {0};
        for (int v = 0; v < 3; v++) colors[4 * v + 3] = alphas[i][0];
        static const uint32_t indices[4] = {0, 1, 2, 0};
        const es_raster_mesh mesh = {.positions = positions, .colors = colors, .indices = indices, .vertex_count = 3, .triangle_count = 1, .bounds_min = {-1, -1, -2}, .bounds_max = {1, 1, -2}, .revision = 1};
        es_material_desc material = es_default_material_desc();
        material.blend = true;
        material.alpha_cutoff = -3e38f; /* all of it */
        const es_raster_instance instance = {.mesh = &mesh, .transform = es_mat4_identity(), .previous_transform = es_mat4_identity()};
        const es_draw_list list = {&instance, &material, 1, 1};
        const es_raster_view view = es_perspective_view(16, 16, es_v3(0, 0, 0), es_v3(0, 0, -1), es_v3(0, 1, 0), 1.5f, 0.1f);
        es_rasterizer* rasterizer;
        es_gbuffer g;
        assert_int_equal(es_rasterizer_create(w.context, &rasterizer), ES_OK);
        assert_int_equal(es_gbuffer_create(w.context, 16, 16, ES_GBUFFER_DEPTH | ES_GBUFFER_ALPHA, &g), ES_OK);
        assert_int_equal(es_draw_gbuffer(rasterizer, &list, &view, &g, NULL), ES_OK);
        uint32_t seen = 0;
        for (uint32_t p = 0; p < 256; p++) {
            seen += g.depth[p] > 0;
            if (g.depth[p] > 0) assert_true(fabsf(g.alpha[p] - alphas[i][1]) < 1e-6f);
            else assert_true(g.alpha[p] == 0);
        }
        assert_true(seen > 20 || alphas[i][0] == -INFINITY);
        es_gbuffer_destroy(w.context, &g);
        es_rasterizer_destroy(rasterizer);
    }
    es_material refused;
    es_material_desc material = es_default_material_desc();
    material.blend = true;
    material.base_color[3] = NAN;
    assert_int_equal(es_world_add_material(w.world, "no number", &material, &refused), ES_INVALID_ARGUMENT);
    small_world_destroy(&w);
}

/* What light does not meet at all: there is nothing in the scene for points, maps and rays, with every method. */
static void test_nothing_but_glass(void** state)
{
    (void)state;
    for (size_t i = 0; i < VARIANTS; i++) {
        small_world w = small_world_create();
        const es_material_desc glass = glowing(sheets[0].emission, sheets[0].alpha, true);
        add_sheet(&w, -1, &glass);
        es_camera_desc camera = es_default_camera_desc();
        es_light_desc sun = es_default_light_desc();
        add_light(&w, sun, es_v3(0, 0, 3), es_v3(0, 0, -1));
        look(&w, camera, es_v3(0, 0, 1), es_v3(0, 0, 0));
        const es_renderer_settings s = settings_of_variant(&variants[i]);
        es_image emission = picture_of(&w, &s, "emission"), radiance = picture_of(&w, &s, "radiance");
        for (size_t p = 0; p < PIXELS * 3; p++) {
            assert_true(fabs((double)emission.pixels[p] - (double)(sheets[0].alpha * sheets[0].emission[p % 3])) <= 1e-6 * (double)emission.pixels[p]);
            assert_true(isfinite(radiance.pixels[p]));
        }
        es_image_destroy(w.context, &emission);
        es_image_destroy(w.context, &radiance);
        small_world_destroy(&w);
    }
}

/* Behind something solid there is nothing to light. */
static void test_hidden(void** state)
{
    (void)state;
    small_world w = small_world_create();
    const es_material_desc glass = glowing(sheets[0].emission, sheets[0].alpha, true), solid = glowing(wall, 1, false);
    add_sheet(&w, -2, &glass);
    add_sheet(&w, -1, &solid);
    es_camera_desc camera = es_default_camera_desc();
    look(&w, camera, es_v3(0, 0, 1), es_v3(0, 0, 0));
    es_renderer_settings s = settings_of();
    es_renderer* renderer = renderer_of(w.context, &s);
    render(renderer, w.world);
    assert_null(pass_of(renderer, "blended layers")->skipped);
    assert_string_equal(pass_of(renderer, "light of blended layers")->skipped, "no blended surface is in front of the picture");
    es_image radiance = picture(renderer, "radiance");
    for (size_t i = 0; i < PIXELS; i++) assert_memory_equal(radiance.pixels + 3 * i, wall, sizeof wall);
    es_image_destroy(w.context, &radiance);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_compositing),
        unit_test_without_races(test_masked_without_layers),
        unit_test_without_races(test_accounting),
        unit_test_without_races(test_ends),
        unit_test_without_races(test_costs_nothing),
        cmocka_unit_test(test_bits),
        unit_test_without_races(test_shadows),
        unit_test_without_races(test_both_sides),
        unit_test_without_races(test_against_reference),
        unit_test_without_races(test_reference_compositing),
        unit_test_without_races(test_odd_textures),
        unit_test_without_races(test_alpha_plane),
        unit_test_without_races(test_nothing_but_glass),
        unit_test_without_races(test_hidden),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
