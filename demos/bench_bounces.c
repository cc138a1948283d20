/* `bench bounces`: what another bounce costs, by Knecht's one pass against Ritschel's reflective maps, and how much of its light arrives,
 * against the path tracer. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BOUNCES = 4, SCENES = 3, REPETITIONS = 15, SEEDS = 4, ERROR_WIDTH = 384, ERROR_HEIGHT = 288 };
static const char* const scenes[SCENES] = {"room", "cornell", "hall"};

static const bench_row table[] = {
    {"bounce-generation", "256 lights of a second bounce from 256, one pass against reflective maps", "ms", "reflective maps", BENCH_RATIO_AT_LEAST, 8, 11},
    {"bounce-generation-1024", "the same from 1024 lights", "ms", "reflective maps", BENCH_NONE, 0, 0},
    {"bounces-1536", "whole frame, 1024 + 256 + 256 lights, three bounces, 1024 x 1024 (Ritschel thesis fig. 5.12: 182 ms)", "ms", NULL, BENCH_VALUE_AT_MOST, 182, 90},
#define LIGHT(n, scene) {"bounce-" #n "-" scene, "mean light of bounce " #n " in " scene ", one pass", "of the reference", NULL, BENCH_NONE, 0, 0}
    LIGHT(1, "room"), LIGHT(2, "room"), LIGHT(3, "room"), LIGHT(4, "room"),
    LIGHT(1, "cornell"), LIGHT(2, "cornell"), LIGHT(3, "cornell"), LIGHT(4, "cornell"),
    LIGHT(1, "hall"), LIGHT(2, "hall"), LIGHT(3, "hall"), LIGHT(4, "hall"),
#undef LIGHT
};
enum { ROWS = sizeof table / sizeof table[0] };

size_t bench_bounces_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

typedef struct lit_scene {
    es_context* context;
    es_world* world;
    es_renderer* renderer;
} lit_scene;

static void close_scene(lit_scene* s)
{
    if (s->renderer) es_renderer_destroy(s->renderer);
    if (s->world) es_world_destroy(s->world);
    if (s->context) es_context_destroy(s->context);
}

static bool open_scene(const char* name, uint32_t threads, lit_scene* s)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_renderer_settings settings = bench_settings();
    *s = (lit_scene){0};
    bool works = es_context_create(&desc, &s->context) == ES_OK && es_world_create_scene(s->context, name, NULL, &s->world) == ES_OK && es_world_step(s->world, 0) == ES_OK &&
                 es_renderer_create(s->context, &settings, &s->renderer) == ES_OK;
    if (!works && s->context) demo_refuse_context(s->context);
    return works;
}

/* ---- time -------------------------------------------------------------------------------------------------------- */

/* Medians, of the whole frame and of placing the lights of the second bounce. */
static bool time_frame(lit_scene* s, const es_renderer_settings* settings, int repetitions, double* frame, double* generation)
{
    double whole[REPETITIONS], placed[REPETITIONS];
    if (es_renderer_configure(s->renderer, settings) != ES_OK) return false;
    for (int i = -2; i < repetitions; i++) {
        if (es_renderer_render(s->renderer, s->world) != ES_OK) return false;
        const es_frame_stats* stats = es_renderer_stats(s->renderer);
        if (i < 0 || stats->bounce_count < 2) continue;
        whole[i] = stats->milliseconds;
        placed[i] = stats->bounces[1].milliseconds;
    }
    *frame = bench_median(whole, (size_t)repetitions);
    *generation = bench_median(placed, (size_t)repetitions);
    return true;
}

static bool time_generation(lit_scene* s, uint32_t vpls, int repetitions, bench_row* row)
{
    es_renderer_settings settings = bench_settings();
    double frame;
    settings.vpls = vpls;
    settings.bounces = 2;
    settings.width = 64; /* shading has no part in it */
    settings.height = 64;
    settings.bounce_method = ES_BOUNCE_ONE_PASS;
    if (!time_frame(s, &settings, repetitions, &frame, &row->value)) return false;
    settings.bounce_method = ES_BOUNCE_REFLECTIVE;
    if (!time_frame(s, &settings, repetitions, &frame, &row->peer_value)) return false;
    row->ratio = row->peer_value / row->value;
    snprintf(row->note, sizeof row->note, "cornell; %u points a light against %u points and %u x %u texels", settings.bounce_points, settings.ism_points, settings.ism_size, settings.ism_size);
    return true;
}

static bool measure_times(const bench_options* options, bench_row* rows)
{
    bench_row *few = bench_find_row(rows, ROWS, "bounce-generation"), *many = bench_find_row(rows, ROWS, "bounce-generation-1024"), *whole = bench_find_row(rows, ROWS, "bounces-1536");
    if (!bench_wants(options, few->id) && !bench_wants(options, many->id) && !bench_wants(options, whole->id)) return true;
    lit_scene s;
    const int repetitions = options->quick ? 3 : REPETITIONS;
    bool works = open_scene("cornell", options->threads, &s);
    if (works && bench_wants(options, few->id)) works = time_generation(&s, 256, repetitions, few);
    if (works && bench_wants(options, many->id)) works = time_generation(&s, 1024, repetitions, many);
    if (works && bench_wants(options, whole->id)) {
        es_renderer_settings settings = bench_settings();
        double unused;
        settings.bounces = 3;
        settings.bounce_vpls = 256;
        settings.bounce_method = ES_BOUNCE_ONE_PASS;
        settings.width = settings.height = 1024;
        works = time_frame(&s, &settings, repetitions, &whole->value, &unused);
        snprintf(whole->note, sizeof whole->note, "cornell, one pass, nothing skipped");
    }
    if (!works && s.context) demo_refuse_context(s.context);
    close_scene(&s);
    return works;
}

/* ---- light ------------------------------------------------------------------------------------------------------- */

static double mean_of(const es_image* image)
{
    double sum = 0;
    size_t count = (size_t)image->width * image->height * image->channels;
    for (size_t i = 0; i < count; i++) sum += (double)image->pixels[i];
    return sum / (double)count;
}

static bool reference_means(lit_scene* s, uint32_t width, uint32_t height, uint32_t samples, double means[BOUNCES])
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = width;
    settings.height = height;
    settings.bounces = BOUNCES;
    settings.antialias = settings.emission = false;
    es_reference* reference = NULL;
    bool works = es_reference_create(s->context, &settings, &reference) == ES_OK && es_reference_begin(reference, s->world) == ES_OK && es_reference_add(reference, samples) == ES_OK;
    for (int b = 0; b < BOUNCES && works; b++) {
        char name[32];
        es_image image = {0};
        snprintf(name, sizeof name, "bounce-%d", b + 1);
        works = es_reference_image(reference, name, &image) == ES_OK;
        if (works) means[b] = mean_of(&image);
        es_image_destroy(s->context, &image);
    }
    es_reference_destroy(reference);
    return works;
}

static bool rendered_means(lit_scene* s, uint32_t width, uint32_t height, int seeds, uint32_t method, double means[BOUNCES])
{
    for (int b = 0; b < BOUNCES; b++) means[b] = 0;
    for (int seed = 0; seed < seeds; seed++) {
        es_renderer_settings settings = bench_settings();
        settings.width = width;
        settings.height = height;
        settings.bounces = BOUNCES;
        settings.bounce_method = method;
        settings.seed = (uint32_t)seed * 10007;
        if (es_renderer_configure(s->renderer, &settings) != ES_OK || es_renderer_render(s->renderer, s->world) != ES_OK) return false;
        for (int b = 0; b < BOUNCES; b++) {
            char name[32];
            es_image image = {0};
            snprintf(name, sizeof name, "indirect-%d", b + 1);
            if (es_renderer_image(s->renderer, name, &image) != ES_OK) return false;
            means[b] += mean_of(&image) / seeds;
            es_image_destroy(s->context, &image);
        }
    }
    return true;
}

static bool wants_light(const bench_options* options, const char* scene)
{
    char id[64];
    bool wanted = false;
    for (int b = 0; b < BOUNCES; b++) {
        snprintf(id, sizeof id, "bounce-%d-%s", b + 1, scene);
        wanted |= bench_wants(options, id);
    }
    bool named = !options->scene_count;
    for (size_t i = 0; i < options->scene_count; i++) named |= !strcmp(options->scenes[i], scene);
    return wanted && named;
}

static bool measure_light(const bench_options* options, const char* scene, bench_row* rows)
{
    lit_scene s;
    double truth[BOUNCES], one_pass[BOUNCES], reflective[BOUNCES];
    const uint32_t width = options->width ? options->width : ERROR_WIDTH, height = options->height ? options->height : ERROR_HEIGHT, samples = options->samples ? options->samples : options->quick ? 2 : 16;
    const int seeds = options->quick ? 1 : SEEDS;
    bool works = open_scene(scene, options->threads, &s) && reference_means(&s, width, height, samples, truth) && rendered_means(&s, width, height, seeds, ES_BOUNCE_ONE_PASS, one_pass) &&
                 rendered_means(&s, width, height, seeds, ES_BOUNCE_REFLECTIVE, reflective);
    if (!works && s.context) demo_refuse_context(s.context);
    for (int b = 0; b < BOUNCES && works; b++) {
        char id[64];
        snprintf(id, sizeof id, "bounce-%d-%s", b + 1, scene);
        bench_row* row = bench_find_row(rows, ROWS, id);
        row->value = one_pass[b] / truth[b];
        snprintf(row->note, sizeof row->note, "reflective maps %.3f; mean radiance of the reference %.4g, %.2f of its first bounce; %u samples a pixel", reflective[b] / truth[b], truth[b], truth[b] / truth[0],
            samples);
    }
    close_scene(&s);
    return works;
}

int bench_bounces(const bench_options* options)
{
    bench_row all[ROWS], rows[ROWS];
    size_t all_count = bench_bounces_rows(all, ROWS), count = 0;
    bench_report report = {.name = "bounces", .title = "Further bounces", .about = "Placing the lights of another bounce, whole frames with three, and the light of each bounce against the path tracer's."};
    bool works = measure_times(options, all);
    for (int i = 0; i < SCENES && works; i++)
        if (wants_light(options, scenes[i])) works = measure_light(options, scenes[i], all);
    for (size_t i = 0; i < all_count; i++)
        if (bench_wants(options, all[i].id)) rows[count++] = all[i];
    es_context_desc desc = es_default_context_desc();
    desc.threads = options->threads;
    es_context* context = NULL; /* says what machine this is */
    works = works && es_context_create(&desc, &context) == ES_OK;
    if (!works) {
        bench_report_free(&report);
        return DEMO_BAD_INPUT;
    }
    bench_print(rows, count);
    int code = bench_report_write(&report, options, rows, count, context);
    es_context_destroy(context);
    return code;
}
