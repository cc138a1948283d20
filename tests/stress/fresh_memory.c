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

enum { METHODS = 11, IMAGES_MAX = 64 };

static void hashes_with(uint32_t word, uint64_t hashes[METHODS][IMAGES_MAX])
{
    filling with = {word};
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    desc.allocator = (es_allocator){allocate, release, &with};
    stress s = stress_open_in(&desc, 1, es_v3(0, 0, 0));
    stress_room(&s);
    /* odd sizes leave padding in rows, and phases and blocks that are not full */
    for (uint32_t i = 0; i < METHODS; i++) {
        es_renderer_settings settings = stress_settings(i == 8 ? 1 : 53, i == 8 ? 3 : 37, i < 4 ? i : i < 6 ? ES_GI_VPL_TRACED : i == 6 ? ES_GI_VPL_SAMPLED : i > 8 ? ES_GI_MICRO : ES_GI_ISM);
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
