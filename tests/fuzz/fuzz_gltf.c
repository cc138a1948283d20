/* glTF: the input is a .gltf or .glb file, beside which lie data.bin (floats, then indices) and image.png. No file outside of its folder
 * may be opened. A world that is imported can be saved and restored, stepped, and rendered, twice with the same bits. */
#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#include <earthshine/gi.h>

#include "tests/fuzz/fuzz.h"

enum { CAP = 32 << 20 };

/* Linked in the place of fopen for the library's calls (--wrap): whatever the input says, only these are opened while it is read. */
static bool importing;
FILE* __real_fopen(const char* path, const char* mode);
FILE* __wrap_fopen(const char* path, const char* mode);
FILE* __wrap_fopen(const char* path, const char* mode)
{
    if (importing) {
        const char* model = fuzz_path("model.gltf");
        size_t folder = (size_t)(strrchr(model, '/') - model) + 1;
        int depth = 0;
        FUZZ_CHECK(strncmp(path, model, folder) == 0, "%s is opened", path);
        for (const char* c = path + folder; *c; c += strcspn(c, "/"), c += *c == '/') {
            depth += !strncmp(c, "..", 2) && (c[2] == '/' || !c[2]) ? -1 : *c == '/' || (*c == '.' && (c[1] == '/' || !c[1])) ? 0 : 1;
            FUZZ_CHECK(depth >= 0, "%s is opened", path);
        }
    }
    return __real_fopen(path, mode);
}

static void write_companions(void)
{
    static bool written;
    if (written) return;
    written = true;
    struct { float numbers[256]; uint16_t indices[64]; } data;
    for (int i = 0; i < 256; i++) data.numbers[i] = (float)((i * 37) % 17) * 0.25f - 2.0f;
    for (int i = 0; i < 64; i++) data.indices[i] = (uint16_t)((i * 5) % 24);
    fuzz_write("data.bin", &data, sizeof data);
    es_image image;
    es_context* context;
    FUZZ_CHECK(es_context_create(&(es_context_desc){.threads = 1}, &context) == ES_OK, "no context");
    FUZZ_CHECK(es_image_create(context, 4, 4, 4, &image) == ES_OK, "no image");
    for (int i = 0; i < 64; i++) image.pixels[i] = (float)(i % 7) / 6.0f;
    es_result result = es_image_save(context, &image, fuzz_path("image.png"), NULL);
    FUZZ_CHECK(result == ES_OK || result == ES_NOT_BUILT, "%s", es_context_message(context));
    es_image_destroy(context, &image);
    es_context_destroy(context);
}

static es_renderer_settings small_settings(void)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = s.height = 16;
    s.shadow_size = 32;
    s.light_size = 16;
    s.vpls = 16;
    s.ism_size = 32;
    s.ism_points = 64;
    s.ism_pool = 1024;
    s.interleave = 2;
    return s;
}

/* The displayed image's hash; 0 when the cap stands against it. */
static uint64_t rendered(fuzz_run* run, es_world* world)
{
    es_renderer_settings settings = small_settings();
    es_renderer* renderer;
    es_image image;
    uint64_t hash = 0;
    es_result result = fuzz_expect(run, es_renderer_create(run->context, &settings, &renderer));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    if (result != ES_OK) return 0;
    result = fuzz_expect(run, es_renderer_render(renderer, world));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    if (result == ES_OK) result = fuzz_expect(run, es_renderer_image(renderer, es_image_name(0), &image));
    if (result == ES_OK) {
        hash = es_image_hash(&image);
        es_image_destroy(run->context, &image);
    }
    es_renderer_destroy(renderer);
    return hash;
}

static void use(fuzz_run* run, es_world* world)
{
    size_t size = 0;
    uint64_t hash = es_world_hash(world);
    FUZZ_CHECK(fuzz_expect(run, es_world_save(world, NULL, &size)) == ES_OK, "the size of the state");
    void* state = malloc(size);
    FUZZ_CHECK(fuzz_expect(run, es_world_save(world, state, &size)) == ES_OK, "the state");
    FUZZ_CHECK(fuzz_expect(run, es_world_step(world, 0.25f)) == ES_OK, "%s", es_context_message(run->context));
    es_result restored = fuzz_expect(run, es_world_restore(world, state, size));
    FUZZ_CHECK(restored == ES_OK || restored == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    FUZZ_CHECK(restored != ES_OK || es_world_hash(world) == hash, "the state is not what was saved");
    free(state);
    FUZZ_CHECK(fuzz_expect(run, es_world_step(world, 0.25f)) == ES_OK, "%s", es_context_message(run->context));
    uint64_t first = rendered(run, world), second = rendered(run, world);
    FUZZ_CHECK(!first || !second || first == second, "the same frame has other bits");
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    write_companions();
    fuzz_write("model.gltf", bytes, size);
    fuzz_run run;
    fuzz_start(&run, CAP);
    es_world *world = NULL, *again;
    importing = true;
    es_result result = fuzz_expect(&run, es_world_import_gltf(run.context, fuzz_path("model.gltf"), NULL, &world));
    FUZZ_CHECK((result == ES_OK) == (world != NULL), "%s with a world or without", es_result_name(result));
    if (result == ES_OK) {
        result = fuzz_expect(&run, es_world_import_gltf(run.context, fuzz_path("model.gltf"), NULL, &again));
        FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "the second time it is refused: %s", es_context_message(run.context));
        FUZZ_CHECK(result != ES_OK || es_world_hash(world) == es_world_hash(again), "the second time it is another world");
        es_world_destroy(again);
    }
    importing = false;
    if (world) use(&run, world);
    es_world_destroy(world);
    fuzz_end(&run);
    return 0;
}
