/* What can be named on the command line, listed: settings of world, renderer and reference, scenes, images; and settings applied. */
#include "demo.h"
#include "setting_slider.h"

#include <string.h>

static bool world_has(const char* name)
{
    for (size_t i = 0; i < es_world_setting_count(); i++)
        if (!strcmp(es_world_setting(i)->name, name)) return true;
    return false;
}

static bool renderer_has(const char* name)
{
    for (size_t i = 0; i < es_renderer_setting_count(); i++)
        if (!strcmp(es_renderer_setting(i)->name, name)) return true;
    return false;
}

static bool reference_has(const char* name)
{
    for (size_t i = 0; i < es_reference_setting_count(); i++)
        if (!strcmp(es_reference_setting(i)->name, name)) return true;
    return false;
}

static int refuse_unknown(const char* name)
{
    enum { MOST = 256 };
    const char* names[MOST];
    size_t count = 0;
    for (size_t i = 0; i < es_world_setting_count() && count < MOST; i++) names[count++] = es_world_setting(i)->name;
    for (size_t i = 0; i < es_renderer_setting_count() && count < MOST; i++) names[count++] = es_renderer_setting(i)->name;
    for (size_t i = 0; i < es_reference_setting_count() && count < MOST; i++) names[count++] = es_reference_setting(i)->name;
    const char* nearest = demo_nearest(name, names, count);
    if (nearest) return demo_refuse("--set %s: no such setting; did you mean %s?", name, nearest);
    return demo_refuse("--set %s: no such setting; `earthshine settings` lists all", name);
}

typedef struct setting_targets {
    es_context* context;
    es_world_settings* world;
    es_renderer_settings* renderer;   /* or */
    es_reference_settings* reference;
} setting_targets;

/* One key=value; `origin` begins a refusal. */
static int apply_set(const setting_targets* to, const char* origin, const char* text)
{
    char name[128];
    const char* equals = strchr(text, '=');
    snprintf(name, sizeof name, "%.*s", (int)(equals - text), text);
    es_result result;
    if (world_has(name)) {
        result = es_world_settings_set(to->context, to->world, name, equals + 1);
    } else if (renderer_has(name)) {
        if (!to->renderer) return demo_refuse("%s %s: is a setting of render and play, not of reference", origin, name);
        result = es_renderer_settings_set(to->context, to->renderer, name, equals + 1);
    } else if (reference_has(name)) {
        if (!to->reference) return demo_refuse("%s %s: is a setting of reference, not of render and play", origin, name);
        result = es_reference_settings_set(to->context, to->reference, name, equals + 1);
    } else {
        return refuse_unknown(name);
    }
    return result == ES_OK ? DEMO_OK : demo_refuse_context(to->context);
}

int demo_apply_scene_settings(es_context* context, const char* scene, es_world_settings* world, es_renderer_settings* renderer,
    es_reference_settings* reference)
{
    const setting_targets to = {context, world, renderer, reference};
    for (const char* const* text = es_scene_settings(scene); *text; text++) {
        char bounces[64];
        const char* set = *text;
        /* the truth has as many bounces as the picture it judges; how the picture is made means nothing to it */
        if (reference && !strncmp(set, "bounces=", 8)) {
            snprintf(bounces, sizeof bounces, "reference.%s", set);
            set = bounces;
        } else if (!renderer && strncmp(set, "world.", 6) != 0) {
            continue;
        }
        if (apply_set(&to, scene, set) != DEMO_OK) return DEMO_BAD_INPUT;
    }
    return DEMO_OK;
}

static int apply_sets(es_context* context, const demo_options* options, es_world_settings* world, es_renderer_settings* renderer,
    es_reference_settings* reference)
{
    const setting_targets to = {context, world, renderer, reference};
    for (size_t i = 0; i < options->set_count; i++)
        if (apply_set(&to, "--set", options->sets[i]) != DEMO_OK) return DEMO_BAD_INPUT;
    return DEMO_OK;
}

static int apply_reference_options(es_context* context, const demo_options* options, es_reference_settings* reference)
{
    const char* const texts[][2] = {{"reference.samples", options->spp}, {"reference.seconds", options->seconds},
        {"reference.error", options->error}, {"reference.bounces", options->bounces}};
    for (size_t i = 0; i < sizeof texts / sizeof texts[0]; i++)
        if (texts[i][1] && es_reference_settings_set(context, reference, texts[i][0], texts[i][1]) != ES_OK) return demo_refuse_context(context);
    return DEMO_OK;
}

/* key=value between blanks. */
static int apply_words(const setting_targets* to, const char* origin, const char* words)
{
    char word[256];
    while (*(words += strspn(words, " "))) {
        size_t length = strcspn(words, " ");
        if (length >= sizeof word || !memchr(words, '=', length)) return demo_refuse("%s: its settings are damaged", origin);
        snprintf(word, sizeof word, "%.*s", (int)length, words);
        if (apply_set(to, origin, word) != DEMO_OK) return DEMO_BAD_INPUT;
        words += length;
    }
    return DEMO_OK;
}

static void add_settings(demo_text* text, const es_setting* setting, const void* settings)
{
    char now[SETTING_TEXT_SIZE];
    double value = setting_value(setting, settings);
    if (value == setting_default(setting) || !strcmp(setting->name, "width") || !strcmp(setting->name, "height")) return;
    setting_text(setting, value, now);
    demo_text_add(text, " %s=%s", setting->name, now);
}

void demo_text_add_settings(demo_text* text, const es_world_settings* world, const es_renderer_settings* renderer)
{
    for (size_t i = 0; i < es_world_setting_count(); i++) add_settings(text, es_world_setting(i), world);
    for (size_t i = 0; i < es_renderer_setting_count(); i++) add_settings(text, es_renderer_setting(i), renderer);
}

int demo_apply_settings(es_context* context, const demo_options* options, es_world_settings* world, es_renderer_settings* renderer,
    es_reference_settings* reference)
{
    *world = es_default_world_settings();
    if (options->environment) world->default_light = false; /* there is light */
    if (renderer) *renderer = es_default_renderer_settings();
    if (reference) *reference = es_default_reference_settings();
    const setting_targets to = {context, world, renderer, reference};
    if (options->recorded_settings && apply_words(&to, options->replay, options->recorded_settings) != DEMO_OK) return DEMO_BAD_INPUT;
    if (options->scene && !options->recorded_settings && demo_apply_scene_settings(context, options->scene, world, renderer, reference) != DEMO_OK) return DEMO_BAD_INPUT;
    if (renderer) {
        if (options->method >= 0) renderer->method = (uint32_t)options->method;
        if (options->no_skip) renderer->skip = false;
    }
    if (reference && apply_reference_options(context, options, reference) != DEMO_OK) return DEMO_BAD_INPUT;
    uint32_t *width = renderer ? &renderer->width : &reference->width, *height = renderer ? &renderer->height : &reference->height;
    if (options->size_given) *width = options->width, *height = options->height;
    if (apply_sets(context, options, world, renderer, reference) != DEMO_OK) return DEMO_BAD_INPUT;
    if (*width < 1 || *height < 1 || *width > ES_RASTER_MAX_SIZE || *height > ES_RASTER_MAX_SIZE)
        return demo_refuse("an image of %ux%u: from 1x1 to %dx%d is accepted", *width, *height, ES_RASTER_MAX_SIZE, ES_RASTER_MAX_SIZE);
    return DEMO_OK;
}

static int expect_nothing(const char* command, int count, char** arguments)
{
    return count ? demo_refuse("%s: takes no arguments, there is %s", command, arguments[0]) : DEMO_OK;
}

static void print_setting(const es_setting* setting)
{
    char range[512];
    switch (setting->type) {
    case ES_SETTING_BOOL:
        snprintf(range, sizeof range, "true|false");
        break;
    case ES_SETTING_CHOICE:
        snprintf(range, sizeof range, "%s", setting->choices);
        break;
    default:
        snprintf(range, sizeof range, "%.9g … %.9g", setting->minimum, setting->maximum);
        break;
    }
    /* Padded by hand: printf counts the bytes of the ellipsis, not its one column. */
    int columns = (int)strlen(range) - (strstr(range, "…") ? 2 : 0);
    printf("%-22s %-10s %s%*s %s\n", setting->name, setting->default_text, range, columns < 26 ? 26 - columns : 0, "",
        setting->help);
}

int demo_settings(int count, char** arguments)
{
    if (expect_nothing("settings", count, arguments) != DEMO_OK) return DEMO_BAD_INPUT;
    for (size_t i = 0; i < es_world_setting_count(); i++) print_setting(es_world_setting(i));
    for (size_t i = 0; i < es_renderer_setting_count(); i++) print_setting(es_renderer_setting(i));
    for (size_t i = 0; i < es_reference_setting_count(); i++) print_setting(es_reference_setting(i));
    return DEMO_OK;
}

int demo_scenes(int count, char** arguments)
{
    bool settings = count > 0 && (!strcmp(arguments[0], "-v") || !strcmp(arguments[0], "--settings"));
    if (count > settings) return demo_refuse("scenes: takes no arguments but --settings, there is %s", arguments[settings]);
    for (size_t i = 0; i < es_scene_count(); i++) {
        const char* name = es_scene_name(i);
        printf("%-15s %s\n", name, es_scene_description(i));
        if (!settings) continue;
        for (const char* const* text = es_scene_settings(name); *text; text++) printf("%-15s --set %s\n", "", *text);
    }
    return DEMO_OK;
}

int demo_images(int count, char** arguments)
{
    if (expect_nothing("images", count, arguments) != DEMO_OK) return DEMO_BAD_INPUT;
    for (size_t i = 0; i < es_image_name_count(); i++) printf("%-20s %s\n", es_image_name(i), es_image_description(i));
    return DEMO_OK;
}

int demo_find_image(const char* name)
{
    enum { MOST = 128 };
    const char* names[MOST];
    size_t count = 0;
    /* one stands in the list for all of a kind */
    int bounce = 0, step = 0, end = 0;
    if (sscanf(name, "indirect-%d%n", &bounce, &end) == 1 && !name[end] && bounce >= 1 && bounce <= ES_MAX_BOUNCES) name = "indirect-1";
    if (sscanf(name, "compensation-%d%n", &step, &end) == 1 && !name[end] && step >= 1 && step <= ES_MAX_COMPENSATION_STEPS) name = "compensation-1";
    for (size_t i = 0; i < es_image_name_count() && i < MOST; i++) {
        if (!strcmp(es_image_name(i), name)) return (int)i;
        names[count++] = es_image_name(i);
    }
    const char* nearest = demo_nearest(name, names, count);
    if (nearest)
        demo_refuse("--image %s: no such image; did you mean %s?", name, nearest);
    else
        demo_refuse("--image %s: no such image; `earthshine images` lists all", name);
    return -1;
}
