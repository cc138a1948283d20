/* The file a reference is resumed from. The first byte of the input: 0, the rest is the file; otherwise a file that was just saved is
 * changed as the rest says, because no mutation finds the world's fingerprint.
 *
 * What is refused changes nothing. What is taken has numbers in all images, and can go on, be saved and be resumed once more. */
#include <string.h>

#include <earthshine/gi.h>

#include "tests/fuzz/fuzz.h"

enum { CAP = 32 << 20, SIDE = 3 };

static es_world* small_world(fuzz_run* run)
{
    static const float positions[] = {-2, 0, -2, 2, 0, -2, 2, 0, 2, -2, 0, 2, -1, 0, -1, 1, 0, -1, 0, 2, -1};
    static const uint32_t indices[] = {0, 2, 1, 0, 3, 2, 4, 5, 6};
    es_world* world;
    es_mesh mesh;
    es_instance instance;
    es_light light;
    es_camera camera;
    es_camera_desc lens = es_default_camera_desc();
    es_light_desc lamp = es_default_light_desc();
    es_node_desc place = {.transform = {.translation = {0, 0.7f, 3}}}, above = {.transform = {.translation = {1, 2, 2}}};
    lamp.type = ES_LIGHT_POINT;
    lamp.intensity = 5;
    bool made = es_world_create(run->context, NULL, &world) == ES_OK &&
        es_world_add_mesh(world, &(es_mesh_desc){.vertex_count = 7, .triangle_count = 3, .positions = positions, .indices = indices, .flat_normals = true}, &mesh) == ES_OK &&
        es_world_add_instance(world, &(es_instance_desc){.mesh = mesh}, &instance) == ES_OK && es_world_add_node(world, &place, &lens.node) == ES_OK &&
        es_world_add_camera(world, &lens, &camera) == ES_OK && es_world_add_node(world, &above, &lamp.node) == ES_OK &&
        es_world_add_light(world, &lamp, &light) == ES_OK && es_world_step(world, 0) == ES_OK;
    FUZZ_CHECK(made, "%s", es_context_message(run->context));
    return world;
}

static uint64_t hash_of(fuzz_run* run, es_reference* reference, const char* name, bool* numbers)
{
    es_image image;
    FUZZ_CHECK(fuzz_expect(run, es_reference_image(reference, name, &image)) == ES_OK, "%s", es_context_message(run->context));
    uint64_t hash = es_image_hash(&image);
    for (uint32_t i = 0; i < SIDE * SIDE * 3; i++) *numbers &= image.pixels[i] == image.pixels[i];
    es_image_destroy(run->context, &image);
    return hash;
}

static void change(fuzz_bytes* in, es_image* image)
{
    while (in->left) {
        uint32_t what = fuzz_take(in, 1), channel = fuzz_take(in, 1) % image->channels;
        char* name = image->channel_names[channel];
        switch (what % 5) {
        case 0: {
            uint32_t pixel = fuzz_take(in, 1) % (image->width * image->height), bits = fuzz_take(in, 4);
            memcpy(&image->pixels[pixel * image->channels + channel], &bits, 4);
            break;
        }
        case 1: {
            uint32_t at = fuzz_take(in, 1) % (ES_CHANNEL_NAME_SIZE - 1);
            name[at] = (char)fuzz_take(in, 1);
            break;
        }
        case 2: {
            char* other = image->channel_names[fuzz_take(in, 1) % image->channels];
            char kept[ES_CHANNEL_NAME_SIZE];
            memcpy(kept, name, sizeof kept);
            memcpy(name, other, sizeof kept);
            memcpy(other, kept, sizeof kept);
            break;
        }
        case 3: { /* another number of samples: state-FINGERPRINT-SAMPLES-… */
            uint32_t samples = fuzz_take(in, 1 + what / 5 % 4);
            for (uint32_t c = 0; c < image->channels; c++) {
                char* each = image->channel_names[c];
                if (strncmp(each, "state-", 6) || strlen(each) < 24) continue;
                char* rest = strchr(each + 23, '-');
                char renamed[2 * ES_CHANNEL_NAME_SIZE];
                if (!rest) continue;
                snprintf(renamed, sizeof renamed, "%.23s%u%s", each, samples, rest);
                renamed[ES_CHANNEL_NAME_SIZE - 1] = 0;
                memcpy(each, renamed, ES_CHANNEL_NAME_SIZE);
            }
            break;
        }
        default: snprintf(name, ES_CHANNEL_NAME_SIZE, "gone%u", channel); break;
        }
    }
}

static es_reference* begun(fuzz_run* run, es_world* world)
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = settings.height = SIDE;
    es_reference* reference;
    FUZZ_CHECK(es_reference_create(run->context, &settings, &reference) == ES_OK, "%s", es_context_message(run->context));
    FUZZ_CHECK(es_reference_begin(reference, world) == ES_OK, "%s", es_context_message(run->context));
    FUZZ_CHECK(es_reference_add(reference, 2) == ES_OK, "%s", es_context_message(run->context));
    return reference;
}

static void goes_on(fuzz_run* run, es_world* world, es_reference* reference)
{
    const char* path = fuzz_path("again.exr");
    static const char* const names[] = {"radiance", "direct", "indirect", "radiance-error", "indirect-error"};
    es_reference_stats stats = es_reference_get_stats(reference);
    bool numbers = true;
    for (int i = 0; i < 5; i++) hash_of(run, reference, names[i], &numbers);
    FUZZ_CHECK(numbers && stats.error >= 0 && stats.seconds_left >= 0 && stats.samples > 0, "what was resumed are no numbers: error %g after %llu samples",
        stats.error, (unsigned long long)stats.samples);
    es_result result = fuzz_expect(run, es_reference_add(reference, 1));
    FUZZ_CHECK(result == ES_OK || (result == ES_WRONG_STATE && stats.samples >= 1u << 26), "%s", es_context_message(run->context));
    FUZZ_CHECK(fuzz_expect(run, es_reference_save(reference, path)) == ES_OK, "%s", es_context_message(run->context));
    es_reference* other = begun(run, world);
    result = fuzz_expect(run, es_reference_resume(other, path));
    /* one more sample may pass the largest float */
    if (result == ES_OK)
        for (int i = 0; i < 5; i++) FUZZ_CHECK(hash_of(run, other, names[i], &numbers) == hash_of(run, reference, names[i], &numbers), "%s is another image", names[i]);
    else FUZZ_CHECK(result == ES_FILE_DAMAGED, "%s", es_context_message(run->context));
    es_reference_destroy(other);
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    fuzz_run run;
    fuzz_start(&run, CAP);
    es_world* world = small_world(&run);
    es_reference* reference = begun(&run, world);
    const char* path = fuzz_path("resume.exr");
    bool numbers = true, written = true;
    if (size == 0 || bytes[0] == 0) {
        fuzz_write("resume.exr", bytes + (size > 0), size - (size > 0));
    } else {
        es_image image;
        fuzz_bytes in = {bytes + 1, size - 1};
        FUZZ_CHECK(fuzz_expect(&run, es_reference_save(reference, path)) == ES_OK, "%s", es_context_message(run.context));
        FUZZ_CHECK(fuzz_expect(&run, es_image_load(run.context, path, &image)) == ES_OK, "%s", es_context_message(run.context));
        change(&in, &image);
        /* names that are no names are for fuzz_exr */
        es_result saved = fuzz_expect(&run, es_image_save(run.context, &image, path, &(es_image_save_desc){.sample_type = ES_SAMPLE_FLOAT}));
        FUZZ_CHECK(saved == ES_OK || saved == ES_INVALID_ARGUMENT, "%s", es_context_message(run.context));
        written = saved == ES_OK;
        es_image_destroy(run.context, &image);
    }
    uint64_t before = hash_of(&run, reference, "radiance", &numbers), before_error = hash_of(&run, reference, "radiance-error", &numbers);
    es_result result = written ? fuzz_expect(&run, es_reference_resume(reference, path)) : ES_FILE_DAMAGED;
    if (result == ES_OK) {
        goes_on(&run, world, reference);
    } else {
        FUZZ_CHECK(es_reference_get_stats(reference).samples == 2 && hash_of(&run, reference, "radiance", &numbers) == before &&
                hash_of(&run, reference, "radiance-error", &numbers) == before_error, "a refused file changes the reference: %s", es_context_message(run.context));
    }
    es_reference_destroy(reference);
    es_world_destroy(world);
    fuzz_end(&run);
    return 0;
}
