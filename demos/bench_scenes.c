/* `bench scenes`: every built-in scene with what it recommends, 640 × 480, in motion: what a player sees.
 *
 * A row for the picture and a row for the world's step of each; there is nothing to reach but a rate that plays. */
#include "bench.h"

#include <math.h>
#include <string.h>

enum { WARM_UP = 30, FRAMES = 40, MOST = 64 };

/* Rows keep their texts as long as the program runs. */
static char ids[MOST][32], texts[MOST][96];

size_t bench_scenes_rows(bench_row* rows, size_t capacity)
{
    size_t count = 0;
    for (size_t i = 0; i < es_scene_count() && count + 2 <= capacity && count + 2 <= MOST; i++)
        for (int step = 0; step < 2; step++, count++) {
            snprintf(ids[count], sizeof ids[count], "scene-%s%s", es_scene_name(i), step ? "-step" : "");
            snprintf(texts[count], sizeof texts[count], "%s: %s", es_scene_name(i), step ? "the world's step of 1/30 s" : "a frame of 640×480 with what it recommends");
            rows[count] = (bench_row){.id = ids[count], .work = texts[count], .unit = "ms", .judge = BENCH_NONE, .must = NAN, .aim = NAN, .value = NAN, .peer_value = NAN, .ratio = NAN};
        }
    return count;
}

static es_result measure(es_context* context, const char* scene, uint32_t frames, double* frame, double* step)
{
    es_world_settings world_settings = es_default_world_settings();
    es_renderer_settings settings = es_default_renderer_settings();
    if (demo_apply_scene_settings(context, scene, &world_settings, &settings, NULL) != DEMO_OK) return es_context_last_result(context);
    settings.width = 640;
    settings.height = 480;
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    double drawing[FRAMES], stepping[FRAMES];
    es_result result = es_world_create_scene(context, scene, &world_settings, &world);
    if (!result) result = es_renderer_create(context, &settings, &renderer);
    for (uint32_t i = 0; i < WARM_UP + frames && !result; i++) {
        const double start = demo_seconds();
        result = es_world_step(world, 1.0f / 30);
        const double stepped = demo_seconds();
        if (!result) result = es_renderer_render(renderer, world);
        if (i < WARM_UP) continue;
        stepping[i - WARM_UP] = (stepped - start) * 1000;
        drawing[i - WARM_UP] = (demo_seconds() - stepped) * 1000;
    }
    es_renderer_destroy(renderer);
    es_world_destroy(world);
    *frame = bench_median(drawing, frames);
    *step = bench_median(stepping, frames);
    return result;
}

int bench_scenes(const bench_options* options)
{
    bench_row rows[MOST];
    size_t count = bench_scenes_rows(rows, MOST);
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    es_context* context = NULL;
    if (es_context_create(&desc, &context) != ES_OK) return demo_refuse("bench scenes: no context can be made");
    for (size_t i = 0; i < count; i += 2) {
        if (!bench_wants(options, rows[i].id) && !bench_wants(options, rows[i + 1].id)) continue;
        if (measure(context, es_scene_name(i / 2), options->quick ? 4 : FRAMES, &rows[i].value, &rows[i + 1].value)) {
            int code = demo_refuse_context(context);
            es_context_destroy(context);
            return code;
        }
    }
    bench_print(rows, count);
    bench_report report = {.name = "scenes", .title = "Scenes", .about = "Every built-in scene in motion, 640×480, with what it recommends (`earthshine scenes --settings`)."};
    snprintf(report.finding, sizeof report.finding, "What a frame and a step of each built-in scene take");
    int code = bench_report_write(&report, options, rows, count, context);
    es_context_destroy(context);
    return code;
}
