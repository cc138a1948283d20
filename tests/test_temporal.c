/* History over whole frames: what it goes on from and what ends it, that skipping, threads and instruction sets change no bit of it, that a
 * still picture settles to what it is without history, and that light that changes is not smeared over the frames after. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/gi.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "tests/races.h"

enum { WIDTH = 72, HEIGHT = 52 };

typedef struct stage { es_context* context; es_world* world; es_renderer* renderer; es_renderer_settings settings; } stage;

static es_renderer_settings small_settings(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.temporal = true;
    s.temporal_settle = 4;
    s.shadow_size = 128;
    s.light_size = 64;
    s.vpls = 24;
    s.interleave = 2;
    s.ism_size = 32;
    s.ism_points = 256;
    s.ism_pool = 4096;
    s.classic_size = 32;
    return s;
}

static stage open_stage(uint32_t threads, uint32_t isa_mask, const es_renderer_settings* settings)
{
    stage s = {.settings = *settings};
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    if (isa_mask) desc.isa_mask = isa_mask;
    assert_int_equal(es_context_create(&desc, &s.context), ES_OK);
    assert_int_equal(es_world_create_scene(s.context, "cornell", NULL, &s.world), ES_OK);
    assert_int_equal(es_renderer_create(s.context, &s.settings, &s.renderer), ES_OK);
    return s;
}
static void close_stage(stage* s)
{
    es_renderer_destroy(s->renderer);
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}
static void render(stage* s) { assert_int_equal(es_renderer_render(s->renderer, s->world), ES_OK); }
static void step(stage* s, float dt) { assert_int_equal(es_world_step(s->world, dt), ES_OK); }
static void configure(stage* s) { assert_int_equal(es_renderer_configure(s->renderer, &s->settings), ES_OK); }

static es_image image_of(stage* s, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(s->renderer, name, &image), ES_OK);
    return image;
}
static uint64_t hash_of(stage* s, const char* name)
{
    es_image image = image_of(s, name);
    uint64_t hash = es_image_hash(&image);
    es_image_destroy(s->context, &image);
    return hash;
}
static double mean_of(stage* s, const char* name)
{
    es_image image = image_of(s, name);
    double sum = 0;
    const size_t count = (size_t)image.width * image.height * image.channels;
    for (size_t i = 0; i < count; i++) sum += (double)image.pixels[i];
    es_image_destroy(s->context, &image);
    return sum / (double)count;
}

static es_node camera_node(stage* s)
{
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(s->world, es_world_active_camera(s->world), &camera), ES_OK);
    return camera.node;
}
static void move_camera(stage* s, float x)
{
    es_transform transform;
    assert_int_equal(es_world_get_node_transform(s->world, camera_node(s), &transform), ES_OK);
    transform.translation.x += x;
    assert_int_equal(es_world_set_node_transform(s->world, camera_node(s), &transform), ES_OK);
}
static void scale_light(stage* s, float factor)
{
    uint32_t id;
    size_t count = 1;
    assert_int_equal(es_world_enumerate(s->world, ES_OBJECT_LIGHT, &id, &count), ES_OK);
    es_light_desc light;
    assert_int_equal(es_world_get_light(s->world, (es_light){id}, &light), ES_OK);
    light.intensity *= factor;
    assert_int_equal(es_world_set_light(s->world, (es_light){id}, &light), ES_OK);
}

/* ---- the same bits --------------------------------------------------------------------------------------------------- */

enum { FRAMES = 16 };

/* Movement, standing still past settling, a moved camera, changed light, other settings, half the resolution. */
static void run(uint32_t threads, uint32_t isa_mask, bool skip, uint32_t stage_of_history, uint32_t antialias, uint64_t hashes[FRAMES])
{
    es_renderer_settings settings = small_settings();
    settings.skip = skip;
    settings.temporal_stage = stage_of_history;
    settings.antialias = antialias;
    settings.antialias_samples = 4;
    stage s = open_stage(threads, isa_mask, &settings);
    for (int i = 0; i < FRAMES; i++) {
        if (i > 0) step(&s, i < 3 || i == 14 ? 1.0f / 30 : 0.0f);
        if (i == 10) move_camera(&s, 0.02f);
        if (i == 11) scale_light(&s, 1.5f);
        if (i == 12) s.settings.exposure = 0.5f;
        if (i == 13) s.settings.half_resolution = true;
        if (i >= 12) configure(&s);
        render(&s);
        hashes[i] = hash_of(&s, "display") ^ hash_of(&s, "irradiance") * 3 ^ hash_of(&s, "confidence") * 5;
    }
    close_stage(&s);
}

static void test_same_bits(void** state)
{
    (void)state;
    for (uint32_t variant = 0; variant < 3; variant++) {
        const uint32_t before = variant == 1 ? ES_TEMPORAL_BEFORE_FILTER : ES_TEMPORAL_AFTER_FILTER, antialias = variant == 2 ? ES_ANTIALIAS_TEMPORAL : ES_ANTIALIAS_NONE;
        uint64_t expected[FRAMES], other[FRAMES];
        run(1, 0, true, before, antialias, expected);
        run(2, 0, false, before, antialias, other);
        for (int i = 0; i < FRAMES; i++)
            if (expected[i] != other[i]) fail_msg("variant %u: frame %d differs without skipping and on two threads", variant, i);
        run(1, 1u << ES_ISA_SCALAR, true, before, antialias, other);
        for (int i = 0; i < FRAMES; i++)
            if (expected[i] != other[i]) fail_msg("variant %u: frame %d differs with the scalar kernels", variant, i);
        for (int i = 1; i < 3; i++) assert_true(expected[i] != expected[i - 1]);
    }
}

/* ---- standing still --------------------------------------------------------------------------------------------------- */

static void test_settles(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings();
    stage s = open_stage(1, 0, &settings);
    render(&s);
    for (int i = 0; i < 3; i++) {
        step(&s, 1.0f / 30);
        render(&s);
    }
    step(&s, 0);
    render(&s);
    const uint64_t blended = hash_of(&s, "irradiance");
    for (uint32_t i = 0; i < settings.temporal_settle + 2; i++) render(&s);
    const es_frame_stats* stats = es_renderer_stats(s.renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!stats->passes[i].skipped) fail_msg("%s runs though the picture has settled", stats->passes[i].name);
    assert_true(mean_of(&s, "confidence") == 0.0);
    const uint64_t settled = hash_of(&s, "irradiance"), shown = hash_of(&s, "display");
    assert_true(settled != blended);
    s.settings.temporal = false;
    configure(&s);
    render(&s);
    assert_true(hash_of(&s, "irradiance") == settled && hash_of(&s, "display") == shown);
    close_stage(&s);
}

/* ---- what ends a history ------------------------------------------------------------------------------------------------ */

static bool goes_on(stage* s)
{
    render(s);
    return mean_of(s, "confidence") > 0.2;
}

static void test_ends(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings();
    settings.temporal_reset_high = 0;
    settings.temporal_illumination = 0;
    stage s = open_stage(1, 0, &settings);
    const float dt = 1.0f / 60;
    assert_false(goes_on(&s)); /* the first frame */
    step(&s, dt);
    assert_true(goes_on(&s));
    assert_true(goes_on(&s)); /* without a step */
    step(&s, dt);
    step(&s, dt);
    assert_false(goes_on(&s)); /* a frame was left out */
    step(&s, dt);
    assert_true(goes_on(&s));
    size_t size = 0;
    assert_int_equal(es_world_save(s.world, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_non_null(saved);
    assert_int_equal(es_world_save(s.world, saved, &size), ES_OK);
    step(&s, dt);
    assert_true(goes_on(&s));
    assert_int_equal(es_world_restore(s.world, saved, size), ES_OK);
    assert_false(goes_on(&s));
    step(&s, dt);
    assert_true(goes_on(&s));
    assert_int_equal(es_world_restore(s.world, saved, size), ES_OK);
    step(&s, dt);
    assert_false(goes_on(&s)); /* rewound, and stepped before the next frame */
    free(saved);

    step(&s, dt);
    s.settings.exposure = 1; /* the display's */
    configure(&s);
    assert_true(goes_on(&s));
    s.settings.width = WIDTH + 5;
    configure(&s);
    step(&s, dt);
    assert_false(goes_on(&s));
    step(&s, dt);
    assert_true(goes_on(&s));
    for (uint32_t method = ES_GI_ISM; method <= ES_GI_VPL_SAMPLED; method++) {
        s.settings.method = method;
        s.settings.half_resolution = method == ES_GI_CLASSIC;
        configure(&s);
        step(&s, dt);
        assert_int_equal(goes_on(&s), method == ES_GI_ISM); /* which it was */
        step(&s, dt);
        assert_true(goes_on(&s));
    }
    s.settings.method = ES_GI_NONE;
    configure(&s);
    step(&s, dt);
    assert_false(goes_on(&s));
    s.settings.method = ES_GI_ISM;
    configure(&s);
    render(&s);
    step(&s, dt);
    assert_true(goes_on(&s));
    scale_light(&s, 0); /* a frame without indirect light has nothing to go on from */
    step(&s, dt);
    assert_false(goes_on(&s));

    es_world *other, *first = s.world;
    assert_int_equal(es_world_create_scene(s.context, "cornell", NULL, &other), ES_OK);
    s.world = other;
    assert_false(goes_on(&s));
    step(&s, dt);
    assert_true(goes_on(&s));
    es_camera second;
    es_camera_desc camera;
    assert_int_equal(es_world_get_camera(other, es_world_active_camera(other), &camera), ES_OK);
    camera.name = "second";
    assert_int_equal(es_world_add_camera(other, &camera, &second), ES_OK);
    step(&s, dt);
    assert_true(goes_on(&s));
    assert_int_equal(es_world_set_active_camera(other, second), ES_OK);
    step(&s, dt);
    assert_false(goes_on(&s));
    es_world_destroy(first);
    close_stage(&s);
}

/* ---- where things were ---------------------------------------------------------------------------------------------------- */

/* The eye moves sideways: what was seen keeps its confidence though the camera is set before the world is stepped, as a player does; what comes in
 * at the border does not. */
static void test_moved_camera(void** state)
{
    (void)state;
    es_renderer_settings settings = small_settings();
    settings.temporal_position = settings.temporal_normal = settings.temporal_illumination = settings.temporal_reset_high = 0;
    stage s = open_stage(1, 0, &settings);
    step(&s, 0);
    render(&s);
    for (int i = 0; i < 2; i++) {
        move_camera(&s, 0.1f);
        step(&s, 0);
        render(&s);
    }
    es_image confidence = image_of(&s, "confidence"), depth = image_of(&s, "depth");
    uint32_t seen = 0, known = 0;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++) {
            const float c = confidence.pixels[y * WIDTH + x];
            assert_true(c == 0.0f || fabsf(c - settings.temporal_base) < 1e-6f);
            if (!(depth.pixels[y * WIDTH + x] > 0.0f)) assert_true(c == 0.0f);
            else {
                seen++;
                known += c > 0.0f;
            }
        }
    assert_true(known > 0.85 * seen && known < seen);
    es_image_destroy(s.context, &confidence);
    es_image_destroy(s.context, &depth);
    close_stage(&s);
}

/* ---- light that changes ------------------------------------------------------------------------------------------------------ */

static double difference(stage* s, const es_image* truth)
{
    es_image image = image_of(s, "indirect");
    es_image_error error;
    assert_int_equal(es_image_compare(s->context, &image, truth, NULL, &error), ES_OK);
    es_image_destroy(s->context, &image);
    return error.relrmse;
}

static uint32_t frames_until_near(float factor, float reset_high)
{
    es_renderer_settings settings = small_settings();
    settings.temporal_settle = 100;
    settings.temporal_reset_high = reset_high;
    stage s = open_stage(1, 0, &settings);
    for (int i = 0; i < 4; i++) {
        step(&s, 0);
        render(&s);
    }
    scale_light(&s, factor);
    es_renderer* plain;
    settings.temporal = false;
    assert_int_equal(es_renderer_create(s.context, &settings, &plain), ES_OK);
    assert_int_equal(es_renderer_render(plain, s.world), ES_OK);
    es_image truth;
    assert_int_equal(es_renderer_image(plain, "indirect", &truth), ES_OK);
    es_renderer_destroy(plain);
    uint32_t frames = 0;
    do {
        step(&s, 0);
        render(&s);
        frames++;
    } while (difference(&s, &truth) > 0.1 && frames < 60);
    es_image_destroy(s.context, &truth);
    close_stage(&s);
    return frames;
}

static void test_light_changes(void** state)
{
    (void)state;
    assert_int_equal(frames_until_near(10, 0.5f), 1);
    assert_int_equal(frames_until_near(0.1f, 0.5f), 1);
    assert_true(frames_until_near(1.5f, 0.5f) <= 8);
    /* by the base confidence of 0.9 alone it takes log 0.1 / 0.9 and log 0.01 / 0.9 to base 0.9 */
    assert_true(frames_until_near(10, 0) >= 20);
    assert_true(frames_until_near(0.1f, 0) >= 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),
        unit_test_without_races(test_settles),
        unit_test_without_races(test_ends),
        unit_test_without_races(test_moved_camera),
        unit_test_without_races(test_light_changes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
