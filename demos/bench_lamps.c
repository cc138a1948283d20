/* `bench lamps`: direct light of glowing surfaces and of the environment by sets of lights (Ritschel thesis §5.4.3): how long a frame takes, and
 * how far the sky's light is from the path tracer's. */
#include "bench_error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SKY_ERROR(id, work, must, aim) {id, "direct light of the sky in courtyard, " work, "relRMSE", NULL, BENCH_VALUE_AT_MOST, must, aim}

static const bench_row table[] = {
    {"lamps-curved-512", "creature in motion, lit by its curved area light alone: 512 lights, maps of 256² texels and 8192 points (fig. 5.16)", "ms", NULL, BENCH_VALUE_AT_MOST, 120, 59},
    {"lamps-sky-1024", "courtyard: 1024 lights of the sky, 8192 points each, nothing skipped", "ms", "as many virtual point lights", BENCH_NONE, 0, 0},
    SKY_ERROR("lamps-sky-error", "1024 lights by rays, 4 × 4", 0.08, 0.03),
    SKY_ERROR("lamps-sky-error-all", "512 lights by rays, every light at every pixel", 0, 0),
    SKY_ERROR("lamps-sky-error-maps", "imperfect maps as they are by default", 0, 0),
    SKY_ERROR("lamps-sky-error-fine", "imperfect maps of 256² texels and 16384 points", 0, 0),
};
enum { ROWS = sizeof table / sizeof table[0] };

typedef struct lamp_bench {
    const bench_options* options;
    es_context* context;
    bench_row rows[ROWS];
    uint32_t width, height, frames;
    uint32_t truth_width, truth_height, truth_samples;
    double truth_seconds;
} lamp_bench;

size_t bench_lamps_rows(bench_row* rows, size_t capacity)
{
    const size_t count = ROWS < capacity ? ROWS : capacity;
    for (size_t i = 0; i < count; i++) {
        rows[i] = table[i];
        if (!(rows[i].must > 0)) rows[i].judge = BENCH_NONE;
        rows[i].value = rows[i].peer_value = rows[i].ratio = NAN;
    }
    return count;
}

static bench_row* wanted(lamp_bench* bench, const char* id) { return bench_wants(bench->options, id) ? bench_find_row(bench->rows, ROWS, id) : NULL; }

static es_world* open_scene(lamp_bench* bench, const char* name)
{
    es_world* world = NULL;
    if (es_world_create_scene(bench->context, name, NULL, &world) == ES_OK && es_world_step(world, 0) == ES_OK) return world;
    demo_refuse_context(bench->context);
    if (world) es_world_destroy(world);
    return NULL;
}

static bool set(lamp_bench* bench, const char* text, es_renderer_settings* settings)
{
    const error_setting setting = {.settings = text};
    return error_apply(bench->context, &setting, settings);
}

/* ---- time ------------------------------------------------------------------------------------------------------------------------- */

/* Median of whole frames after steps of dt; 0: the same frame again, nothing skipped. NaN after a message. */
static double frame_time(lamp_bench* bench, es_world* world, const char* text, float dt, char* note, size_t size)
{
    enum { MOST = 16 };
    double frames[MOST], maps = 0, light = 0;
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = bench->width;
    settings.height = bench->height;
    settings.skip = dt > 0;
    es_renderer* renderer = NULL;
    bool works = set(bench, text, &settings) && es_renderer_create(bench->context, &settings, &renderer) == ES_OK;
    for (int i = -1; i < (int)bench->frames && works; i++) {
        works = es_world_step(world, dt) == ES_OK;
        const double start = demo_seconds();
        works = works && es_renderer_render(renderer, world) == ES_OK;
        if (i >= 0) frames[i] = (demo_seconds() - start) * 1000;
    }
    const es_frame_stats* stats = works ? es_renderer_stats(renderer) : NULL;
    for (size_t i = 0; works && i < stats->pass_count; i++) {
        if (stats->passes[i].skipped) continue;
        if (!strcmp(stats->passes[i].name, "shadow maps of lamps")) maps = stats->passes[i].milliseconds;
        if (!strcmp(stats->passes[i].name, "light of lamps") || !strcmp(stats->passes[i].name, "filter of lamps' light")) light += stats->passes[i].milliseconds;
    }
    if (works && note) snprintf(note, size, "%.3g ms of maps, %.3g of shading and filter, in the last frame", maps, light);
    if (!works) demo_refuse_context(bench->context);
    es_renderer_destroy(renderer);
    return works ? bench_median(frames, bench->frames) : NAN;
}

/* The world without its other lights. */
static bool switch_off(es_world* world)
{
    size_t count;
    const es_light_state* states = es_world_lights(world, &count);
    es_light* lights = malloc((count + 1) * sizeof *lights);
    if (!lights) return false;
    for (size_t i = 0; i < count; i++) lights[i] = states[i].handle;
    bool works = true;
    for (size_t i = 0; i < count && works; i++) {
        es_light_desc desc;
        works = es_world_get_light(world, lights[i], &desc) == ES_OK;
        desc.off = true;
        works = works && es_world_set_light(world, lights[i], &desc) == ES_OK;
    }
    free(lights);
    return works && es_world_step(world, 0) == ES_OK;
}

static bool measure_curved(lamp_bench* bench)
{
    bench_row* row = wanted(bench, "lamps-curved-512");
    if (!row) return true;
    es_world* world = open_scene(bench, "creature");
    if (!world) return false;
    if (switch_off(world)) row->value = frame_time(bench, world, "gi=none lamps=maps lamps.count=512 lamps.size=256 ism.points=8192", 1.0f / 30, row->note, sizeof row->note);
    es_world_destroy(world);
    return row->value > 0;
}

static bool measure_sky_time(lamp_bench* bench)
{
    bench_row* row = wanted(bench, "lamps-sky-1024");
    if (!row) return true;
    es_world* world = open_scene(bench, "courtyard");
    if (!world) return false;
    row->peer_value = frame_time(bench, world, "gi=ism lamps=none vpl.count=1024", 0, NULL, 0);
    bool works = switch_off(world);
    row->value = works ? frame_time(bench, world, "gi=none lamps=maps lamps.count=1024", 0, row->note, sizeof row->note) : NAN;
    row->ratio = row->peer_value / row->value;
    es_world_destroy(world);
    return row->value > 0 && row->peer_value > 0;
}

/* ---- error ---------------------------------------------------------------------------------------------------------------------------- */

/* Two independent references of the direct light. */
static bool trace_halves(lamp_bench* bench, es_world* world, es_image halves[2])
{
    for (uint32_t k = 0; k < 2; k++) {
        es_reference_settings settings = es_default_reference_settings();
        es_reference* reference = NULL;
        settings.width = bench->truth_width;
        settings.height = bench->truth_height;
        settings.bounces = 0;
        settings.antialias = false;
        settings.emission = true;
        settings.seed = k;
        settings.max_samples = bench->truth_samples;
        settings.max_seconds = (float)bench->truth_seconds;
        bool works = es_reference_create(bench->context, &settings, &reference) == ES_OK && es_reference_begin(reference, world) == ES_OK;
        while (works && !es_reference_get_stats(reference).done) works = es_reference_add(reference, 4) == ES_OK;
        works = works && es_reference_image(reference, "direct", &halves[k]) == ES_OK;
        if (works) fprintf(stderr, "courtyard: half of the truth, %llu samples a pixel\n", (unsigned long long)es_reference_get_stats(reference).samples);
        es_reference_destroy(reference);
        if (!works) return false;
    }
    return true;
}

/* By both halves, whose noise cancels on average. */
static double relrmse(const es_image* image, const es_image halves[2])
{
    double squares = 0, light = 0;
    const size_t values = (size_t)image->width * image->height * 3;
    for (size_t i = 0; i < values; i++) {
        const double a = (double)image->pixels[i], b = (double)halves[0].pixels[i], c = (double)halves[1].pixels[i];
        squares += (a - b) * (a - c);
        light += 0.5 * (b + c);
    }
    return squares > 0 ? sqrt(squares / (double)values) / (light / (double)values) : NAN;
}

static bool measure_error(lamp_bench* bench, es_world* world, const es_image halves[2], const char* id, const char* text)
{
    bench_row* row = wanted(bench, id);
    if (!row) return true;
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = bench->truth_width;
    settings.height = bench->truth_height;
    settings.method = ES_GI_NONE;
    settings.skip = false;
    es_renderer* renderer = NULL;
    es_image direct = {0};
    bool works = set(bench, text, &settings) && es_renderer_create(bench->context, &settings, &renderer) == ES_OK && es_renderer_render(renderer, world) == ES_OK;
    const double start = demo_seconds();
    works = works && es_renderer_render(renderer, world) == ES_OK && es_renderer_image(renderer, "direct", &direct) == ES_OK;
    if (works) {
        row->value = relrmse(&direct, halves);
        snprintf(row->note, sizeof row->note, "%s: %.4g ms at %u × %u", text, (demo_seconds() - start) * 1000, bench->truth_width, bench->truth_height);
        fprintf(stderr, "  %s: relRMSE %.4f\n", text, row->value);
    } else {
        demo_refuse_context(bench->context);
    }
    es_image_destroy(bench->context, &direct);
    es_renderer_destroy(renderer);
    return works;
}

static bool measure_errors(lamp_bench* bench)
{
    static const char* const ways[][2] = {
        {"lamps-sky-error", "lamps=traced lamps.count=1024 lamps.interleave=4 filter.passes=1"},
        {"lamps-sky-error-all", "lamps=traced lamps.count=512 lamps.interleave=1"},
        {"lamps-sky-error-maps", "lamps=maps"},
        {"lamps-sky-error-fine", "lamps=maps lamps.size=256 ism.points=16384 lamps.slope-bias=0.008"},
    };
    bool any = false;
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) any = any || wanted(bench, ways[i][0]);
    if (!any) return true;
    es_world* world = open_scene(bench, "courtyard");
    es_image halves[2] = {{0}, {0}};
    bool works = world && switch_off(world) && trace_halves(bench, world, halves);
    if (world && !works) demo_refuse_context(bench->context);
    for (size_t i = 0; i < sizeof ways / sizeof ways[0] && works; i++) works = measure_error(bench, world, halves, ways[i][0], ways[i][1]);
    for (int k = 0; k < 2; k++) es_image_destroy(bench->context, &halves[k]);
    if (world) es_world_destroy(world);
    return works;
}

/* ---- all of it ---------------------------------------------------------------------------------------------------------------------- */

int bench_lamps(const bench_options* options)
{
    lamp_bench bench = {.options = options};
    bench_lamps_rows(bench.rows, ROWS);
    bench.width = options->width ? options->width : options->quick ? 64 : 1024;
    bench.height = options->height ? options->height : options->quick ? 48 : 768;
    bench.frames = options->quick ? 2 : 9;
    bench.truth_width = options->width ? options->width : options->quick ? 32 : 1024;
    bench.truth_height = options->height ? options->height : options->quick ? 24 : 768;
    bench.truth_samples = options->samples ? options->samples : options->quick ? 4 : 512;
    bench.truth_seconds = options->quick ? 2 : 100;
    bench_report report = {.name = "lamps", .title = "Lamps and sky", .about = "Direct light of a curved area light and of the sky, by sets of lights with imperfect shadow maps or rays; 1024 × 768, two threads, unless a row says otherwise."};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    bool works = es_context_create(&desc, &bench.context) == ES_OK;
    if (!works) demo_refuse("bench lamps: no context can be made");
    works = works && measure_curved(&bench) && measure_sky_time(&bench) && measure_errors(&bench);
    int code = DEMO_BAD_INPUT;
    if (works) {
        bench_row shown[ROWS];
        size_t count = 0;
        for (size_t i = 0; i < ROWS; i++)
            if (bench_wants(options, bench.rows[i].id)) shown[count++] = bench.rows[i];
        bench_print(shown, count);
        code = bench_report_write(&report, options, shown, count, bench.context);
    } else {
        bench_report_free(&report);
    }
    es_context_destroy(bench.context);
    return code;
}
