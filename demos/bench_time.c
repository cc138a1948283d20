/* `bench time`: light over frames: how much it flickers with history and without, how long a sudden change takes to arrive, what history costs, and what a
 * frame costs when nothing changes. The scene is a parameter: --scene, cornell otherwise. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const bench_row table[] = {
    {"flicker", "change of indirect light from frame to frame against a reference's, 256 lights, 120 frames: with history", "relRMSE", "without history", BENCH_RATIO_AT_LEAST, 5, 15},
    {"flicker-change", "what the reference itself changes from frame to frame", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"lag-brighter", "frames until indirect light is within 10 % after the lamp's light is multiplied by 10", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"lag-darker", "the same, after it is divided by 10", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"lag-jump", "the same, after the lamp jumps by a tenth of the scene's extent", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"temporal-cost", "the pass of temporal coherence, moving scene, 1024 × 768, 256 lights", "ms", NULL, BENCH_VALUE_AT_MOST, 4, 1.5},
    {"still-frame", "a frame once the picture has settled", "ms", "a frame of the moving scene", BENCH_RATIO_AT_LEAST, 10, 50},
};
enum { ROWS = sizeof table / sizeof table[0] };

size_t bench_time_rows(bench_row* rows, size_t capacity)
{
    for (size_t i = 0; i < ROWS && i < capacity; i++) {
        rows[i] = table[i];
        rows[i].value = rows[i].peer_value = rows[i].ratio = NAN;
    }
    return ROWS < capacity ? ROWS : capacity;
}

typedef struct bench_time_stage {
    es_context* context;
    es_world* world;
    const bench_options* options;
    es_renderer_settings with, without; /* history */
} bench_time_stage;

static bool known_setting(const char* name)
{
    for (size_t i = 0; i < es_renderer_setting_count(); i++)
        if (!strcmp(es_renderer_setting(i)->name, name)) return true;
    return false;
}

static bool open_stage(bench_time_stage* s, const bench_options* options, const char* scene)
{
    *s = (bench_time_stage){.options = options};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    if (es_context_create(&desc, &s->context) != ES_OK || es_world_create_scene(s->context, scene, NULL, &s->world) != ES_OK) return false;
    s->with = bench_settings();
    s->with.skip = true;
    s->with.vpls = 256;
    s->without = s->with;
    s->with.temporal = true;
    return !known_setting("vpl.stable") || es_renderer_settings_set(s->context, &s->with, "vpl.stable", "true") == ES_OK;
}

static void close_stage(bench_time_stage* s)
{
    if (s->world) es_world_destroy(s->world);
    if (s->context) es_context_destroy(s->context);
}

static bool draw(bench_time_stage* s, es_renderer* renderer, es_image* image)
{
    *image = (es_image){0};
    return es_renderer_render(renderer, s->world) == ES_OK && es_renderer_image(renderer, "indirect", image) == ES_OK;
}

/* ---- flicker -------------------------------------------------------------------------------------------------------- */

static bool measure_flicker(bench_time_stage* s, bench_row* flicker, bench_row* change)
{
    enum { WITH, WITHOUT, REFERENCE, COUNT };
    const uint32_t frames = s->options->quick ? 12 : 120;
    es_renderer_settings settings[COUNT] = {s->with, s->without, s->without};
    for (int i = 0; i < COUNT; i++) {
        settings[i].width = s->options->width ? s->options->width : s->options->quick ? 128 : 256;
        settings[i].height = s->options->height ? s->options->height : s->options->quick ? 96 : 192;
    }
    settings[REFERENCE].vpls = 16384;
    settings[REFERENCE].interleave = 2;
    es_renderer* renderers[COUNT] = {NULL};
    es_flicker* flickers[2] = {NULL};
    bool works = true;
    for (int i = 0; i < COUNT && works; i++) works = es_renderer_create(s->context, &settings[i], &renderers[i]) == ES_OK;
    for (int i = 0; i < 2 && works; i++) works = es_flicker_create(s->context, &flickers[i]) == ES_OK;
    for (uint32_t frame = 0; frame < frames && works; frame++) {
        es_image images[COUNT] = {0};
        works = es_world_step(s->world, frame ? 1.0f / 60 : 0.0f) == ES_OK;
        for (int i = 0; i < COUNT && works; i++) works = draw(s, renderers[i], &images[i]);
        for (int i = 0; i < 2 && works; i++) works = es_flicker_add(flickers[i], &images[i], &images[REFERENCE]) == ES_OK;
        for (int i = 0; i < COUNT; i++) es_image_destroy(s->context, &images[i]);
    }
    if (works) {
        es_flicker_error with = es_flicker_result(flickers[WITH]), without = es_flicker_result(flickers[WITHOUT]);
        flicker->value = with.flicker;
        flicker->peer_value = without.flicker;
        flicker->ratio = without.flicker / with.flicker;
        change->value = with.change;
        snprintf(flicker->note, sizeof flicker->note, "%u × %u, %u frames, against 16384 lights; the worst pair of frames: %.3g and %.3g", settings[0].width, settings[0].height, frames, with.worst, without.worst);
    }
    for (int i = 0; i < COUNT; i++)
        if (renderers[i]) es_renderer_destroy(renderers[i]);
    for (int i = 0; i < 2; i++)
        if (flickers[i]) es_flicker_destroy(flickers[i]);
    return works;
}

/* ---- lag -------------------------------------------------------------------------------------------------------------- */

static bool change_lamp(bench_time_stage* s, float factor, float shift)
{
    size_t count;
    const es_light_state* lights = es_world_lights(s->world, &count);
    es_light_desc lamp;
    if (!count || es_world_get_light(s->world, lights[0].handle, &lamp) != ES_OK) return false;
    const es_light handle = lights[0].handle;
    lamp.intensity *= factor;
    if (es_world_set_light(s->world, handle, &lamp) != ES_OK) return false;
    if (shift == 0.0f) return true;
    es_vec3 low, high;
    es_transform transform;
    if (!es_world_bounds(s->world, &low, &high) || es_world_get_node_transform(s->world, lamp.node, &transform) != ES_OK) return false;
    transform.translation.x += shift * sqrtf((high.x - low.x) * (high.x - low.x) + (high.y - low.y) * (high.y - low.y) + (high.z - low.z) * (high.z - low.z));
    return es_world_set_node_transform(s->world, lamp.node, &transform) == ES_OK;
}

static bool measure_lag(bench_time_stage* s, float factor, float shift, bench_row* row)
{
    enum { BEFORE = 12, MOST = 120 };
    es_renderer_settings with = s->with, without = s->without;
    with.width = without.width = 256;
    with.height = without.height = 192;
    without = with; /* the truth is what the same lights send without history */
    without.temporal = false;
    es_renderer *renderer = NULL, *plain = NULL;
    es_image truth = {0}, image = {0};
    bool works = es_renderer_create(s->context, &with, &renderer) == ES_OK && es_renderer_create(s->context, &without, &plain) == ES_OK;
    for (int i = 0; i < BEFORE && works; i++) {
        works = es_world_step(s->world, 0) == ES_OK && draw(s, renderer, &image);
        es_image_destroy(s->context, &image);
    }
    works = works && change_lamp(s, factor, shift);
    uint32_t frames = 0;
    double error = 1, first = 1;
    while (works && error > 0.1 && frames < MOST) {
        es_image_error measured = {0};
        works = es_world_step(s->world, 0) == ES_OK && draw(s, renderer, &image) && draw(s, plain, &truth) && es_image_compare(s->context, &image, &truth, NULL, &measured) == ES_OK;
        error = measured.relrmse;
        if (!frames++) first = error;
        es_image_destroy(s->context, &image);
        es_image_destroy(s->context, &truth);
    }
    row->value = frames;
    snprintf(row->note, sizeof row->note, "in the first frame relRMSE is %.3g, in the last of them %.3g", first, error);
    works = works && change_lamp(s, 1 / factor, -shift);
    if (renderer) es_renderer_destroy(renderer);
    if (plain) es_renderer_destroy(plain);
    return works;
}

/* ---- cost -------------------------------------------------------------------------------------------------------------- */

static bool measure_cost(bench_time_stage* s, bench_row* cost, bench_row* still)
{
    enum { MOST = 60 };
    const uint32_t frames = s->options->quick ? 8 : MOST;
    double pass[MOST], moving[MOST], resting[MOST];
    es_renderer* renderer = NULL;
    bool works = es_renderer_create(s->context, &s->with, &renderer) == ES_OK;
    for (uint32_t i = 0; i < frames + 2 && works; i++) {
        works = es_world_step(s->world, 1.0f / 60) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
        if (!works || i < 2) continue; /* memory is new */
        const es_frame_stats* stats = es_renderer_stats(renderer);
        moving[i - 2] = stats->milliseconds;
        for (size_t k = 0; k < stats->pass_count; k++)
            if (!strcmp(stats->passes[k].name, "temporal coherence")) pass[i - 2] = stats->passes[k].milliseconds;
    }
    for (uint32_t i = 0; i < s->with.temporal_settle + 4 && works; i++) works = es_world_step(s->world, 0) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
    for (uint32_t i = 0; i < frames && works; i++) {
        works = es_world_step(s->world, 0) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
        if (works) resting[i] = es_renderer_stats(renderer)->milliseconds;
    }
    if (works) {
        cost->value = bench_median(pass, frames);
        still->value = bench_median(resting, frames);
        still->peer_value = bench_median(moving, frames);
        still->ratio = still->peer_value / still->value;
        snprintf(cost->note, sizeof cost->note, "of %.4g ms a frame", still->peer_value);
    }
    if (renderer) es_renderer_destroy(renderer);
    return works;
}

int bench_time(const bench_options* options)
{
    bench_row all[ROWS], rows[ROWS];
    size_t count = 0;
    bench_time_rows(all, ROWS);
    const char* scene = options->scene_count ? options->scenes[0] : "cornell";
    bench_report report = {.name = "time", .title = "Light over frames", .about = "Flicker, lag and cost of history."};
    bench_time_stage stage;
    bool works = open_stage(&stage, options, scene);
    if (works && (bench_wants(options, "flicker") || bench_wants(options, "flicker-change"))) works = measure_flicker(&stage, bench_find_row(all, ROWS, "flicker"), bench_find_row(all, ROWS, "flicker-change"));
    static const struct { const char* id; float factor, shift; } changes[] = {{"lag-brighter", 10, 0}, {"lag-darker", 0.1f, 0}, {"lag-jump", 1, 0.1f}};
    for (size_t i = 0; i < sizeof changes / sizeof *changes && works; i++)
        if (bench_wants(options, changes[i].id)) works = measure_lag(&stage, changes[i].factor, changes[i].shift, bench_find_row(all, ROWS, changes[i].id));
    if (works && (bench_wants(options, "temporal-cost") || bench_wants(options, "still-frame"))) works = measure_cost(&stage, bench_find_row(all, ROWS, "temporal-cost"), bench_find_row(all, ROWS, "still-frame"));
    for (size_t i = 0; i < ROWS; i++)
        if (bench_wants(options, all[i].id)) rows[count++] = all[i];
    if (!works) {
        int code = stage.context ? demo_refuse_context(stage.context) : demo_refuse("bench time: no memory");
        close_stage(&stage);
        bench_report_free(&report);
        return code;
    }
    bench_print(rows, count);
    int code = bench_report_write(&report, options, rows, count, stage.context);
    close_stage(&stage);
    return code;
}
