/* Memory that the allocator returns holds anything. Filled with signalling NaNs, every picture is what it is on memory of zeros; built with
 * EARTHSHINE_TRAP_FP, whatever reads it before it is written raises SIGFPE, in the padding of rows too. */
#include "tests/stress/stress.h"
#include "tests/races.h"

typedef struct filling { uint32_t word; } filling;

static void* allocate(void* user, size_t size, size_t alignment)
{
    const filling* with = user;
    size_t bytes = (size + alignment - 1) / alignment * alignment;
    uint32_t* memory = aligned_alloc(alignment, bytes);
    for (size_t i = 0; memory && i < bytes / sizeof *memory; i++) memory[i] = with->word;
    return memory;
}

static void release(void* user, void* pointer, size_t size) { free(pointer); }

enum { METHODS = 20, FIRST_OF_SCREEN = 14, IMAGES_MAX = 64 };

static void hashes_with(uint32_t word, uint64_t hashes[METHODS][IMAGES_MAX])
{
    filling with = {word};
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    desc.allocator = (es_allocator){allocate, release, &with};
    stress s = stress_open_in(&desc, 1, es_v3(0, 0, 0));
    stress_room(&s);
    es_area_light_desc panel = es_default_area_light_desc();
    es_area_light light;
    es_image sky;
    assert_int_equal(es_image_create(s.context, 5, 3, 3, &sky), ES_OK);
    for (uint32_t i = 0; i < 5 * 3 * 3; i++) sky.pixels[i] = i == 4 ? 40.0f : 0.5f;
    assert_int_equal(es_world_add_area_light(s.world, &panel, &light), ES_OK);
    assert_int_equal(es_world_set_environment(s.world, &(es_environment_desc){.image = &sky, .radiance = {1, 1, 1}}), ES_OK);
    es_image_destroy(s.context, &sky);
    assert_int_equal(es_world_step(s.world, 0), ES_OK);
    /* odd sizes leave padding in rows, and phases and blocks that are not full */
    for (uint32_t i = 0; i < METHODS; i++) {
        es_renderer_settings settings = stress_settings(i == 8 ? 1 : 53, i == 8 ? 3 : 37, i < 4 ? i : i < 6 ? ES_GI_VPL_TRACED : i == 6 ? ES_GI_VPL_SAMPLED : i == 9 || i == 10 || i == 13 ? ES_GI_MICRO : i == 15 ? ES_GI_SECOND_ORDER : i == 16 ? ES_GI_NONE : ES_GI_ISM);
        settings.vpls = 70;
        settings.interleave = 3;
        settings.traced_bias = i == 4 ? ES_TRACED_UNBOUNDED : i == 5 ? ES_TRACED_COMPENSATED : ES_TRACED_BOUNDED;
        settings.traced_samples = 2;
        settings.half_resolution = i >= 6;
        settings.micro_spacing = i == 10 ? 4 : 1;
        settings.micro_points = 1000;
        settings.micro_size = i == 10 ? 20 : 12;
        settings.micro_nodes = i == 10 ? ES_MICRO_FLOAT : ES_MICRO_QUANTISED;
        settings.near_distance = i == 6 ? 0.1f : 0.0f;
        /* in half of them the set is of lamps and sky, by maps or rays */
        settings.lamps = i % 2 || i > 10 ? i == 12 ? ES_LAMPS_TRACED : ES_LAMPS_MAPS : ES_LAMPS_NONE;
        if (i >= FIRST_OF_SCREEN) {
            settings.lamps = i == 16 ? ES_LAMPS_SCREEN : i == 17 ? ES_LAMPS_AMBIENT : ES_LAMPS_MAPS;
            settings.half_resolution = i == 17;
            settings.compensation_steps = i == 14 ? 2 : i == 19 ? 1 : 0;
            settings.compensation_spacing = i == 14 ? 2 : 1;
            settings.compensation_levels = i == 14 ? 6 : 3;
            settings.geometry_bound = 300.0f;
            settings.screen_bounce = i == 16 || i == 17;
            settings.screen_layers = i == 16 ? 4 : i == 18 ? 2 : 1;
            settings.screen_cameras = i == 17 ? 4 : 0;
            settings.screen_repair = i == 18 ? 4 : 0;
            settings.second_lights = 30;
            settings.second_negative = 11;
        }
        settings.lamp_count = 37;
        settings.lamp_size = 32;
        settings.lamp_interleave = i == 11 ? 5 : 3;
        settings.lamp_vpls = 9;
        settings.bounces = i == 11 ? 2 : settings.bounces;
        es_renderer* renderer = stress_render(&s, &settings);
        assert_all_finite(&s, renderer, "fresh memory");
        for (size_t k = 0; k < es_image_name_count() && k < IMAGES_MAX; k++) {
            es_image image;
            hashes[i][k] = 0;
            if (es_renderer_image(renderer, es_image_name(k), &image) != ES_OK) continue;
            hashes[i][k] = es_image_hash(&image);
            es_image_destroy(s.context, &image);
        }
        es_renderer_destroy(renderer);
    }
    stress_close(&s);
}

static void anything_in_fresh_memory(void** state)
{
    (void)state;
    static uint64_t zeros[METHODS][IMAGES_MAX], nans[METHODS][IMAGES_MAX];
    hashes_with(0, zeros);
    hashes_with(0x7fa00001u, nans);
    for (uint32_t i = 0; i < METHODS; i++)
        for (size_t k = 0; k < es_image_name_count(); k++)
            if (zeros[i][k] != nans[i][k]) fail_msg("setting %u: %s depends on what fresh memory held", i, es_image_name(k));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(anything_in_fresh_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
