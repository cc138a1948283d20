/* `bench moving`: whole frames of scenes in which everything moves, with what is kept between frames, and of one that stands still.
 *
 * As in Knecht 2009, §5.1, 32k points stand for the scene, so that each of N maps is drawn from 32k / N of them, 64 at least; the hall is
 * that of Ritschel's thesis, §5.4, with 8k points in each map.
 *
 * What stands still is timed once its picture has settled: after the first frame for which no pass had anything to do. How many frames that takes
 * and what they cost stands in the row's note. */
#include "bench.h"

#include <math.h>
#include <string.h>

enum { WARM_UP = 4, FRAMES = 16, MAX_RUNS = 50, MOST_UNSETTLED = 1000 };

typedef struct moving_work {
    const char *scene, *id, *text;
    uint32_t width, height, vpls, map_size, points, pool;
    double must, aim;
} moving_work;

static const moving_work works[] = {
    {"cornell-stack", "moving-cornell-4", "cornell-stack in motion, 1024×768, 4 lights, 32k points", 1024, 768, 4, 128, 8192, 32768, 11.8, 5.9},
    {"cornell-stack", "moving-cornell-64", "the same, 64 lights", 1024, 768, 64, 128, 512, 32768, 16.0, 8.0},
    {"cornell-stack", "moving-cornell-256", "the same, 256 lights", 1024, 768, 256, 128, 128, 32768, 30.0, 13.7},
    {"cornell-stack", "moving-cornell-1024", "the same, 1024 lights", 1024, 768, 1024, 128, 64, 65536, 74.0, 37.0},
    {"hall", "moving-hall-1024", "hall in motion, 640×480, 1024 lights, maps of 256², 8k points each", 640, 480, 1024, 256, 8192, 1048576, 89.0, 40.0},
};
enum { WORKS = sizeof works / sizeof works[0], OF_STILL = 2, ROWS = WORKS + 1 };

size_t bench_moving_rows(bench_row* rows, size_t capacity)
{
    for (size_t i = 0; i < ROWS && i < capacity; i++) {
        rows[i] = (bench_row){.unit = "ms", .judge = BENCH_VALUE_AT_MOST, .value = NAN, .peer_value = NAN, .ratio = NAN};
        if (i < WORKS) {
            rows[i].id = works[i].id;
            rows[i].work = works[i].text;
            rows[i].must = works[i].must;
            rows[i].aim = works[i].aim;
        } else {
            rows[i].id = "still-cornell-256";
            rows[i].work = "moving-cornell-256 standing still, over its time in motion";
            rows[i].unit = "x";
            rows[i].must = 0.1;
            rows[i].aim = 0.02;
        }
    }
    return ROWS < capacity ? ROWS : capacity;
}

static es_result time_frame(es_world* world, es_renderer* renderer, float dt, double* milliseconds)
{
    es_result result = es_world_step(world, dt);
    const double start = demo_seconds();
    if (!result) result = es_renderer_render(renderer, world);
    *milliseconds = (demo_seconds() - start) * 1000;
    return result;
}

static es_result time_frames(es_world* world, es_renderer* renderer, float dt, uint32_t before, double* median)
{
    double times[FRAMES], first;
    es_result result = ES_OK;
    for (uint32_t i = 0; i < before && !result; i++) result = time_frame(world, renderer, dt, &first);
    for (uint32_t i = 0; i < FRAMES && !result; i++) result = time_frame(world, renderer, dt, &times[i]);
    *median = bench_median(times, FRAMES);
    return result;
}

static bool all_skipped(const es_renderer* renderer)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!stats->passes[i].skipped) return false;
    return true;
}

typedef struct still_times { double settled, unsettled; uint32_t frames; bool done; } still_times;

/* Frames that stand still until nothing is left to do, and those after. */
static es_result time_still(es_world* world, es_renderer* renderer, still_times* still)
{
    double times[MOST_UNSETTLED];
    still->frames = 0;
    es_result result = ES_OK;
    for (; !still->done && still->frames < MOST_UNSETTLED && !result; still->done = !result && all_skipped(renderer)) result = time_frame(world, renderer, 0.0f, &times[still->frames++]);
    still->unsettled = bench_median(times, still->frames);
    return result || !still->done ? result : time_frames(world, renderer, 0.0f, 0, &still->settled);
}

/* Medians of a moving scene's frames and of the same standing still. */
static es_result measure(es_context* context, const moving_work* work, double* moving, still_times* still)
{
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = work->width;
    settings.height = work->height;
    settings.vpls = work->vpls;
    settings.ism_size = work->map_size;
    settings.ism_points = work->points;
    settings.ism_pool = work->pool;
    settings.stable_vpls = settings.temporal = true;
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    es_result result = es_world_create_scene(context, work->scene, NULL, &world);
    if (!result) result = es_renderer_create(context, &settings, &renderer);
    if (!result) result = time_frames(world, renderer, 1.0f / 30.0f, WARM_UP, moving);
    if (!result) result = time_still(world, renderer, still);
    es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    return result;
}

int bench_moving(const bench_options* options)
{
    bench_row rows[ROWS];
    bench_moving_rows(rows, ROWS);
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    es_context* context = NULL;
    if (es_context_create(&desc, &context) != ES_OK) return demo_refuse("bench moving: no context can be made");
    es_result result = ES_OK;
    for (size_t i = 0; i < WORKS && !result; i++) {
        const bool of_still = i == OF_STILL && bench_wants(options, rows[WORKS].id);
        if (!bench_wants(options, works[i].id) && !of_still) continue;
        double moving[MAX_RUNS], ratios[MAX_RUNS];
        const uint32_t runs = options->quick ? 1 : options->runs;
        bool unsettled = false;
        for (uint32_t r = 0; r < runs && !result; r++) {
            still_times still = {NAN, NAN, 0, false};
            result = measure(context, &works[i], &moving[r], &still);
            ratios[r] = still.settled / moving[r];
            unsettled |= !still.done;
            if (of_still && unsettled) snprintf(rows[WORKS].note, sizeof rows[WORKS].note, "not settled within %d frames of %.3g ms; in motion %.3g ms", MOST_UNSETTLED, still.unsettled, moving[r]);
            else if (of_still) snprintf(rows[WORKS].note, sizeof rows[WORKS].note, "%.3g ms, settled after %u frames of %.3g ms; in motion %.3g ms", still.settled, still.frames, still.unsettled, moving[r]);
        }
        if (result) break;
        rows[i].value = bench_median(moving, runs);
        if (of_still && !unsettled) rows[WORKS].value = bench_median(ratios, runs);
    }
    if (result) {
        int code = demo_refuse_context(context);
        es_context_destroy(context);
        return code;
    }
    bench_print(rows, ROWS);
    bench_report report = {.name = "moving", .title = "Frames in motion"};
    snprintf(report.finding, sizeof report.finding, "Whole frames of scenes in motion, with lights, points and maps kept between frames");
    int code = bench_report_write(&report, options, rows, ROWS, context);
    es_context_destroy(context);
    return code;
}
