/* Settings and options: each line of the input is an argument of `earthshine render` and `earthshine reference`, and where it holds a '='
 * also a name and a value for the three tables of settings. What a table takes it gives back as text that means the same bits, and what is
 * within every range can be rendered. */
#include <string.h>

#include "demos/demo.h"
#include "platform/settings.h"
#include "tests/fuzz/fuzz.h"

enum { CAP = 48 << 20, LINES = 48 };

/* ---- what the program says ---------------------------------------------------------------------------------------------------------- */

static FILE* terminal;
static char* said;
static size_t said_size;

static void listen(void)
{
    terminal = stderr;
    stderr = open_memstream(&said, &said_size);
}

/* One line of refusal, or nothing. */
static void hear(int code)
{
    fclose(stderr);
    stderr = terminal;
    FUZZ_CHECK(code == DEMO_OK || code == DEMO_BAD_INPUT, "code %d", code);
    FUZZ_CHECK(strlen(said) == said_size, "a refusal holds a zero");
    char* end = strchr(said, '\n');
    if (code == DEMO_OK) FUZZ_CHECK(said_size == 0, "success says '%s'", said);
    else FUZZ_CHECK(end && end == said + said_size - 1 && said_size > 14, "a refusal is one line, not '%s'", said);
    free(said);
    said = NULL;
}

static void try_pattern(const demo_options* options)
{
    char path[DEMO_PATH_SIZE];
    listen();
    int code = demo_check_pattern("--out", options->out, options->end - options->first);
    hear(code);
    if (code != DEMO_OK) return;
    const uint32_t frames[] = {options->first, options->end - 1, DEMO_MAX_FRAMES};
    for (int i = 0; i < 3; i++) {
        memset(path, 'x', sizeof path);
        demo_expand_pattern(options->out, frames[i], path);
        FUZZ_CHECK(memchr(path, 0, sizeof path) && path[0], "'%s' expands to no name", options->out);
        FUZZ_CHECK(demo_has_image_ending(path), "'%s' loses its ending: '%s'", options->out, path);
    }
}

static void try_options(fuzz_run* run, const char* command, int count, char** lines)
{
    demo_options options;
    listen();
    int code = demo_parse_options(command, count, lines, &options);
    hear(code);
    if (code != DEMO_OK) return;
    FUZZ_CHECK(options.first < options.end && options.end <= DEMO_MAX_FRAMES, "frames %u to %u", options.first, options.end);
    FUZZ_CHECK(options.fps >= 0.1 && options.fps <= 10000 && options.threads <= 64, "fps %g, threads %u", options.fps, options.threads);
    if (options.out) try_pattern(&options);
    es_world_settings world;
    es_renderer_settings renderer;
    es_reference_settings reference;
    listen();
    code = demo_apply_settings(run->context, &options, &world, options.reference ? NULL : &renderer, options.reference ? &reference : NULL);
    hear(code);
    FUZZ_CHECK(run->messages <= 1, "%u messages", run->messages);
    run->messages = 0;
}

/* ---- tables --------------------------------------------------------------------------------------------------------------------------- */

typedef es_result (*setter)(es_context* context, void* settings, const char* name, const char* value);
static es_result set_world(es_context* c, void* s, const char* n, const char* v) { return es_world_settings_set(c, s, n, v); }
static es_result set_renderer(es_context* c, void* s, const char* n, const char* v) { return es_renderer_settings_set(c, s, n, v); }
static es_result set_reference(es_context* c, void* s, const char* n, const char* v) { return es_reference_settings_set(c, s, n, v); }

/* True when it was taken. */
static bool try_setting(fuzz_run* run, setter set, const es_setting* table, size_t count, void* settings, size_t size, const char* name, const char* value)
{
    char before[512], after[512], text[128];
    FUZZ_CHECK(size <= sizeof before, "settings of %zu bytes", size);
    memcpy(before, settings, size);
    es_result result = fuzz_expect(run, set(run->context, settings, name, value));
    FUZZ_CHECK(result == ES_OK || result == ES_SETTING_UNKNOWN || result == ES_SETTING_VALUE, "%s", es_result_name(result));
    if (result != ES_OK) {
        FUZZ_CHECK(memcmp(before, settings, size) == 0, "a refused value changes the settings");
        return false;
    }
    FUZZ_CHECK(fuzz_expect(run, es_settings_check(run->context, table, count, settings)) == ES_OK, "%s=%s is taken and out of range", name, value);
    const es_setting* setting = es_settings_find(table, count, name);
    FUZZ_CHECK(setting && es_settings_get(setting, settings, text, sizeof text), "%s has no text", name);
    memcpy(after, settings, size);
    FUZZ_CHECK(fuzz_expect(run, set(run->context, settings, name, text)) == ES_OK, "%s: its own text '%s' is not taken", name, text);
    FUZZ_CHECK(memcmp(after, settings, size) == 0, "%s: its own text '%s' is another value", name, text);
    return true;
}

/* ---- use ------------------------------------------------------------------------------------------------------------------------------ */

static uint32_t at_most(uint32_t value, uint32_t limit) { return value < limit ? value : limit; }

static uint64_t rendered(fuzz_run* run, es_world* world, const es_renderer_settings* settings)
{
    es_renderer* renderer;
    es_image image;
    uint64_t hash = 0;
    es_result result = fuzz_expect(run, es_renderer_create(run->context, settings, &renderer));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP || result == ES_SETTING_VALUE, "%s", es_context_message(run->context));
    if (result != ES_OK) return 0;
    result = fuzz_expect(run, es_renderer_render(renderer, world));
    FUZZ_CHECK(result == ES_OK || result == ES_MEMORY_CAP, "%s", es_context_message(run->context));
    if (result == ES_OK) result = fuzz_expect(run, es_renderer_image(renderer, "display", &image));
    if (result == ES_OK) {
        for (uint32_t i = 0; i < image.width * image.height * image.channels; i++)
            FUZZ_CHECK(image.pixels[i] >= 0 && image.pixels[i] <= 1, "sample %u of the displayed image is %g", i, (double)image.pixels[i]);
        hash = es_image_hash(&image);
        es_image_destroy(run->context, &image);
    }
    es_renderer_destroy(renderer);
    return hash;
}

static void use(fuzz_run* run, es_world_settings world_settings, es_renderer_settings renderer_settings, es_reference_settings reference_settings)
{
    es_world* world;
    world_settings.triangles = 100 + at_most(world_settings.triangles, 1000);
    es_result result = fuzz_expect(run, es_world_create_scene(run->context, "cornell", &world_settings, &world));
    FUZZ_CHECK(result == ES_OK || result == ES_SETTING_VALUE, "%s", es_context_message(run->context));
    if (result != ES_OK) return;
    FUZZ_CHECK(fuzz_expect(run, es_world_step(world, 0.1f)) == ES_OK, "%s", es_context_message(run->context));

    es_renderer_settings* r = &renderer_settings;
    r->width = at_most(r->width, 16);
    r->height = at_most(r->height, 16);
    r->shadow_size = at_most(r->shadow_size, 256);
    r->light_size = at_most(r->light_size, 32);
    r->vpls = at_most(r->vpls, 32);
    r->ism_points = at_most(r->ism_points, 256);
    r->ism_pool = at_most(r->ism_pool, 4096);
    r->classic_size = at_most(r->classic_size, 64);
    r->traced_samples = at_most(r->traced_samples, 2);
    uint64_t first = rendered(run, world, r), second = rendered(run, world, r);
    FUZZ_CHECK(first == second, "the same frame has other bits");

    es_reference_settings* s = &reference_settings;
    es_reference* reference;
    s->width = at_most(s->width, 8);
    s->height = at_most(s->height, 8);
    s->bounces = at_most(s->bounces, 6);
    FUZZ_CHECK(fuzz_expect(run, es_reference_create(run->context, s, &reference)) == ES_OK, "%s", es_context_message(run->context));
    FUZZ_CHECK(fuzz_expect(run, es_reference_begin(reference, world)) == ES_OK, "%s", es_context_message(run->context));
    for (int i = 0; i < 2; i++) FUZZ_CHECK(fuzz_expect(run, es_reference_add(reference, 1)) == ES_OK, "%s", es_context_message(run->context));
    es_reference_destroy(reference);
    es_world_destroy(world);
}

int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size)
{
    fuzz_run run;
    fuzz_start(&run, CAP);
    char* text = malloc(size + 1);
    if (size) memcpy(text, bytes, size);
    text[size] = 0;
    char* lines[LINES];
    int count = 0;
    for (char* line = text; count < LINES; line += strlen(line) + 1) {
        char* end = strchr(line, '\n');
        lines[count++] = line;
        if (!end) break;
        *end = 0;
    }
    try_options(&run, "render", count, lines);
    try_options(&run, "reference", count, lines);
    for (int i = 0; i < count; i++) {
        uint32_t number = 7;
        double real = 7;
        FUZZ_CHECK(!demo_parse_uint(lines[i], 3, 900000000, &number) || (number >= 3 && number <= 900000000), "'%s' is %u", lines[i], number);
        FUZZ_CHECK(!demo_parse_double(lines[i], -2, 1e9, &real) || (real >= -2 && real <= 1e9), "'%s' is %g", lines[i], real);
    }

    es_world_settings world = es_default_world_settings();
    es_renderer_settings renderer = es_default_renderer_settings();
    es_reference_settings reference = es_default_reference_settings();
    bool taken = false;
    for (int i = 0; i < count; i++) {
        char* value = strchr(lines[i], '=');
        if (!value) continue;
        *value++ = 0;
        taken |= try_setting(&run, set_world, es_world_setting(0), es_world_setting_count(), &world, sizeof world, lines[i], value);
        taken |= try_setting(&run, set_renderer, es_renderer_setting(0), es_renderer_setting_count(), &renderer, sizeof renderer, lines[i], value);
        taken |= try_setting(&run, set_reference, es_reference_setting(0), es_reference_setting_count(), &reference, sizeof reference, lines[i], value);
    }
    if (taken) use(&run, world, renderer, reference);
    free(text);
    fuzz_end(&run);
    return 0;
}
