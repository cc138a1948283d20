/* The passes of glare in frames of a small world: what they keep, skip, refuse and leave alone (gi/glare/glare_pass.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "gi/gi.h"
#include "platform/context.h"
#include "tests/races.h"

static void drop_message(void* user, es_log_level level, es_result item, const char* message) { (void)user, (void)level, (void)item, (void)message; }

static es_context* context_of(uint32_t threads, size_t cap)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.memory_cap = cap;
    desc.logger.log = drop_message;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

typedef struct shown { es_context* context; es_world* world; es_renderer* renderer; es_material lamp; } shown;

/* A small lamp before a dim sky. */
static es_world* make_world(es_context* context, es_material* lamp)
{
    es_world* world;
    assert_int_equal(es_world_create(context, NULL, &world), ES_OK);
    es_node_desc node = {.transform = es_identity_transform()};
    es_camera_desc camera_desc = es_default_camera_desc();
    es_camera camera;
    assert_int_equal(es_world_add_node(world, &node, &camera_desc.node), ES_OK);
    assert_int_equal(es_world_add_camera(world, &camera_desc, &camera), ES_OK);
    assert_int_equal(es_world_set_active_camera(world, camera), ES_OK);
    es_material_desc glow = es_default_material_desc();
    glow.emission[0] = 90;
    glow.emission[1] = 60;
    glow.emission[2] = 30;
    assert_int_equal(es_world_add_material(world, "lamp", &glow, lamp), ES_OK);
    static const float corners[] = {-0.2f, -0.1f, -3, 0.1f, -0.1f, -3, 0.1f, 0.2f, -3, -0.2f, 0.2f, -3};
    static const uint32_t quad[] = {0, 1, 2, 0, 2, 3};
    const es_mesh_desc mesh_desc = {.name = "lamp", .vertex_count = 4, .triangle_count = 2, .positions = corners, .indices = quad};
    es_mesh mesh;
    es_instance_desc instance_desc = {.material = *lamp};
    es_instance instance;
    assert_int_equal(es_world_add_mesh(world, &mesh_desc, &mesh), ES_OK);
    assert_int_equal(es_world_add_node(world, &node, &instance_desc.node), ES_OK);
    instance_desc.mesh = mesh;
    assert_int_equal(es_world_add_instance(world, &instance_desc, &instance), ES_OK);
    const es_environment_desc sky = {.radiance = {0.1f, 0.2f, 0.4f}};
    assert_int_equal(es_world_set_environment(world, &sky), ES_OK);
    assert_int_equal(es_world_step(world, 0), ES_OK);
    return world;
}

static es_renderer_settings settings_of(uint32_t glare)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = 61;
    s.height = 43;
    s.method = ES_GI_NONE;
    s.lamps = ES_LAMPS_NONE;
    s.glare = glare;
    s.glare_size = 256;
    s.glare_field = 2;
    s.glare_threshold = 1;
    return s;
}

static shown show(uint32_t threads, const es_renderer_settings* settings)
{
    shown s = {.context = context_of(threads, 0)};
    s.world = make_world(s.context, &s.lamp);
    assert_int_equal(es_renderer_create(s.context, settings, &s.renderer), ES_OK);
    return s;
}

static void end(shown* s)
{
    es_renderer_destroy(s->renderer);
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}

static void frame(shown* s, float dt)
{
    if (es_world_step(s->world, dt) || es_renderer_render(s->renderer, s->world)) fail_msg("%s", es_context_message(s->context));
}

static es_image picture(shown* s, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(s->renderer, name, &image), ES_OK);
    return image;
}

static uint64_t hash_of(shown* s, const char* name)
{
    es_image image = picture(s, name);
    const uint64_t hash = es_image_hash(&image);
    es_image_destroy(s->context, &image);
    return hash;
}

static const char* skipped(const shown* s, const char* pass)
{
    const es_frame_stats* stats = es_renderer_stats(s->renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (strcmp(stats->passes[i].name, pass) == 0) return stats->passes[i].skipped;
    fail_msg("no pass %s", pass);
    return NULL;
}

static double sum_of(const es_image* image, uint32_t channel)
{
    double sum = 0;
    for (size_t i = channel; i < (size_t)image->width * image->height * image->channels; i += image->channels) sum += (double)image->pixels[i];
    return sum;
}

/* Without it nothing is different; with it the radiance is still that, and what is seen has the same sum in every channel and reaches where there was none. */
static void test_light(void** state)
{
    (void)state;
    es_renderer_settings settings = settings_of(ES_GLARE_OFF);
    shown s = show(2, &settings);
    frame(&s, 0);
    assert_string_equal(skipped(&s, "glare"), "glare is off");
    assert_string_equal(skipped(&s, "aperture of the eye"), "glare is off");
    const uint64_t radiance = hash_of(&s, "radiance"), display = hash_of(&s, "display");
    assert_true(hash_of(&s, "glare") == radiance);
    es_image none = picture(&s, "aperture");
    assert_true(none.channels == 1 && sum_of(&none, 0) == 0);
    es_image_destroy(s.context, &none);
    for (uint32_t glare = ES_GLARE_CONVOLUTION; glare <= ES_GLARE_BILLBOARDS; glare++)
        for (uint32_t antialias = ES_ANTIALIAS_NONE; antialias <= ES_ANTIALIAS_SUPERSAMPLE; antialias++) {
            settings.glare = glare;
            settings.antialias = antialias;
            settings.antialias_samples = 3;
            assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
            frame(&s, 0);
            assert_null(skipped(&s, "glare"));
            if (!antialias) assert_true(hash_of(&s, "radiance") == radiance);
            assert_true(hash_of(&s, "display") != display);
            es_image before = picture(&s, "radiance"), after = picture(&s, "glare"), spectrum = picture(&s, "glare-spectrum"), aperture = picture(&s, "aperture");
            for (uint32_t k = 0; k < 3; k++) {
                assert_true(fabs(sum_of(&after, k) / sum_of(&before, k) - 1) < 1e-5);
                assert_true(fabs(sum_of(&spectrum, k) - 1) < 1e-4);
            }
            assert_int_equal(aperture.width, 256);
            assert_true(sum_of(&aperture, 0) > 100);
            uint32_t brighter = 0;
            for (uint32_t i = 0; i < settings.width * settings.height; i++) brighter += fabsf(before.pixels[3 * i] - 0.1f) < 1e-6f && after.pixels[3 * i] > 0.101f;
            if (brighter < 200) fail_msg("glare %u, anti-aliasing %u: brighter %u; %g became %g", glare, antialias, brighter, (double)before.pixels[0], (double)after.pixels[0]);
            es_image_destroy(s.context, &before);
            es_image_destroy(s.context, &after);
            es_image_destroy(s.context, &spectrum);
            es_image_destroy(s.context, &aperture);
        }
    settings.glare = ES_GLARE_OFF;
    settings.antialias = ES_ANTIALIAS_NONE;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
    frame(&s, 0);
    assert_true(hash_of(&s, "display") == display);
    end(&s);
}

static void quieten(es_renderer_settings* s)
{
    s->glare_hippus = s->glare_accommodation = s->glare_saccades = 0;
    s->glare_blink = false;
}

/* A held frame is not made again: neither while time stands, nor while it goes on and nothing in the eye moves. What did change is made again, and is what it would be without
 * skipping. */
static void test_skipping(void** state)
{
    (void)state;
    for (uint32_t cycle = 0; cycle <= 3; cycle += 3)
        for (uint32_t glare = ES_GLARE_CONVOLUTION; glare <= ES_GLARE_BILLBOARDS; glare++) {
            es_renderer_settings settings = settings_of(glare);
            settings.glare_cycle = cycle;
            settings.skip = true;
            shown a = show(2, &settings);
            settings.skip = false;
            shown b = show(1, &settings);
            static const float steps[] = {0, 1.0f / 60, 1.0f / 60, 0, 1.0f / 30, 0.1f, 0, 0.5f};
            for (int i = 0; i < 16; i++) {
                if (i == 9) { /* another light */
                    es_material_desc glow;
                    for (int k = 0; k < 2; k++) {
                        shown* s = k ? &b : &a;
                        assert_int_equal(es_world_get_material(s->world, s->lamp, &glow), ES_OK);
                        glow.emission[1] = 5;
                        assert_int_equal(es_world_set_material(s->world, s->lamp, &glow), ES_OK);
                    }
                }
                if (i == 12) { /* an eye that nothing moves */
                    for (int k = 0; k < 2; k++) {
                        settings = es_renderer_get_settings((k ? &b : &a)->renderer);
                        quieten(&settings);
                        assert_int_equal(es_renderer_configure((k ? &b : &a)->renderer, &settings), ES_OK);
                    }
                }
                frame(&a, steps[i % 8]);
                frame(&b, steps[i % 8]);
                static const char* const names[] = {"display", "glare", "glare-spectrum", "aperture"};
                for (int k = 0; k < 4; k++)
                    if (hash_of(&a, names[k]) != hash_of(&b, names[k])) fail_msg("frame %d, cycle %u, glare %u: %s", i, cycle, glare, names[k]);
                assert_null(skipped(&b, "glare"));
                if (i % 8 == 3 || i % 8 == 6) { /* time stands */
                    assert_string_equal(skipped(&a, "spectrum of glare"), "inputs unchanged");
                    assert_string_equal(skipped(&a, "glare"), "inputs unchanged");
                    assert_string_equal(skipped(&a, "compose"), "inputs unchanged");
                }
            }
            /* the pupil comes to rest, and then time may go on */
            int held = 0;
            for (int i = 0; i < 600 && held < 20; i++) {
                frame(&a, 1.0f / 60);
                held = cycle || skipped(&a, "glare") ? held + 1 : 0;
            }
            assert_int_equal(held, 20);
            end(&a);
            end(&b);
        }
}

/* A cycle's spectra are made once, there and back, and are those of their moments. */
static void test_cycle(void** state)
{
    (void)state;
    es_renderer_settings settings = settings_of(ES_GLARE_CONVOLUTION);
    settings.glare_cycle = 4;
    shown s = show(2, &settings);
    uint64_t hashes[13];
    for (int i = 0; i < 13; i++) {
        frame(&s, i ? 1.0f / 30 : 0);
        hashes[i] = hash_of(&s, "glare-spectrum");
        assert_string_equal(skipped(&s, "aperture of the eye"), "of the cycle");
    }
    for (int i = 0; i < 7; i++) assert_true(hashes[i] == hashes[i + 6]);
    for (int i = 1; i < 3; i++) {
        assert_true(hashes[i] != hashes[i - 1]);
        assert_true(hashes[3 + i] == hashes[3 - i]);
    }
    settings.glare_cycle = 1;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
    frame(&s, 1.0f / 30);
    frame(&s, 1.0f / 30);
    assert_string_equal(skipped(&s, "glare"), "inputs unchanged");
    end(&s);
}

/* A cycle of another length has no spectra yet, be it at a moment that both have; what comes after finds one. */
static void test_other_cycle(void** state)
{
    (void)state;
    for (uint32_t glare = ES_GLARE_CONVOLUTION; glare <= ES_GLARE_BILLBOARDS; glare++) {
        es_renderer_settings settings = settings_of(glare);
        settings.glare_cycle = 2;
        shown s = show(1, &settings);
        frame(&s, 0);
        settings.glare_cycle = 8;
        assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
        frame(&s, 0);
        assert_null(skipped(&s, "spectrum of glare"));
        settings.glare_threshold = 2;
        settings.glare_billboards = 7;
        assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
        frame(&s, 0);
        assert_null(skipped(&s, "glare"));
        end(&s);
    }
}

static void test_sizes(void** state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {2, 37}, {640, 1}, {129, 77}};
    es_renderer_settings settings = settings_of(ES_GLARE_CONVOLUTION);
    shown s = show(2, &settings);
    for (uint32_t i = 0; i < 8; i++) {
        settings.width = sizes[i % 4][0];
        settings.height = sizes[i % 4][1];
        settings.glare_size = i < 4 ? 64 : 256;
        settings.glare_field = i < 4 ? 0.1f : 170;
        settings.glare = i % 2 ? ES_GLARE_BILLBOARDS : ES_GLARE_CONVOLUTION;
        settings.glare_wavelengths = i < 4 ? 1 : 64;
        settings.glare_defocus = i % 3 ? 0 : -3;
        settings.glare_pupil = i % 4 == 0 ? 0 : i % 4 == 1 ? 9 : -1;
        assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_OK);
        frame(&s, i % 2 ? 10 : 0);
        es_image before = picture(&s, "radiance"), after = picture(&s, "glare");
        for (uint32_t k = 0; k < 3; k++) assert_true(fabs(sum_of(&after, k) / sum_of(&before, k) - 1) < 1e-4);
        es_image_destroy(s.context, &before);
        es_image_destroy(s.context, &after);
    }
    end(&s);
}

static void test_refusals(void** state)
{
    (void)state;
    es_renderer_settings settings = settings_of(ES_GLARE_CONVOLUTION);
    shown s = show(1, &settings);
    settings.glare_size = 100;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_SETTING_VALUE);
    assert_non_null(strstr(es_context_message(s.context), "glare.size"));
    settings.glare_size = 32;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_SETTING_VALUE);
    settings.glare_size = 8192;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_SETTING_VALUE);
    settings.glare_size = 64;
    settings.glare_supersample = 3;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_SETTING_VALUE);
    settings.glare_supersample = 4;
    settings.glare_field = 0;
    assert_int_equal(es_renderer_configure(s.renderer, &settings), ES_SETTING_VALUE);
    end(&s);
}

/* Where memory ends with glare a frame fails, and one without it is drawn after that. */
static void test_memory(void** state)
{
    (void)state;
    es_renderer_settings settings = settings_of(ES_GLARE_OFF);
    settings.width = 640;
    settings.height = 360;
    shown free_one = show(2, &settings);
    frame(&free_one, 0);
    const size_t without = es_context_peak_bytes(free_one.context);
    settings.glare = ES_GLARE_CONVOLUTION;
    assert_int_equal(es_renderer_configure(free_one.renderer, &settings), ES_OK);
    frame(&free_one, 0);
    const size_t with = es_context_peak_bytes(free_one.context);
    end(&free_one);
    assert_true(with > without + (2 << 20));
    for (uint32_t i = 1; i < 12; i++) {
        shown s = {.context = context_of(2, without + (with - without) * i / 12)};
        s.world = make_world(s.context, &s.lamp);
        assert_int_equal(es_renderer_create(s.context, &settings, &s.renderer), ES_OK);
        assert_int_equal(es_renderer_render(s.renderer, s.world), ES_MEMORY_CAP);
        es_image image;
        assert_int_not_equal(es_renderer_image(s.renderer, "glare", &image), ES_OK);
        es_renderer_settings off = settings;
        off.glare = ES_GLARE_OFF;
        assert_int_equal(es_renderer_configure(s.renderer, &off), ES_OK);
        assert_int_equal(es_renderer_render(s.renderer, s.world), ES_OK);
        end(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_light), unit_test_without_races(test_skipping), unit_test_without_races(test_cycle), unit_test_without_races(test_other_cycle), unit_test_without_races(test_sizes), unit_test_without_races(test_refusals), unit_test_without_races(test_memory)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
