/* `bench scale`: what a frame and each of its passes cost as the room has more triangles, lights, points, pixels, and as there are more
 * threads: one thing at a time, from the same middle. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_VALUES = 12, MAX_PASSES = 32, REPETITIONS = 5, SHOWN_PASSES = 6 };

typedef struct scene_size {
    uint32_t triangles, vpls, points, width, height, threads;
} scene_size;
static const scene_size middle = {70000, 1024, 8192, 1024, 768, 2};

typedef enum axis_id { TRIANGLES, VPLS, POINTS, PIXELS, THREADS, AXES } axis_id;
typedef struct scale_axis {
    const char *id, *thing, *x_name;
    uint32_t values[MAX_VALUES]; /* of PIXELS: the width */
    uint32_t quick_values[MAX_VALUES];
} scale_axis;
static const scale_axis axes[AXES] = {
    [TRIANGLES] = {"triangles", "triangles", "triangles of the scene", {10000, 30000, 70000, 200000, 500000, 1000000, 2000000, 4000000}, {10000, 70000, 500000}},
    [VPLS] = {"vpls", "virtual point lights", "virtual point lights", {64, 128, 256, 512, 1024, 2048, 4096, 8192}, {64, 256, 1024}},
    [POINTS] = {"points", "points of each map", "points drawn into each imperfect shadow map", {1024, 2048, 4096, 8192, 16384, 32768}, {1024, 8192, 16384}},
    [PIXELS] = {"pixels", "pixels", "pixels", {160, 320, 640, 1024, 1600, 2560}, {160, 640, 1024}},
    [THREADS] = {"threads", "threads", "threads", {0}, {0}}, /* 1, 2, 4 … all */
};

static const bench_row table[] = {
    {"scale-triangles", "growth of a frame's time with the triangles", "exponent", NULL, BENCH_NONE, 0, 0},
    {"scale-vpls", "the same, virtual point lights", "exponent", NULL, BENCH_NONE, 0, 0},
    {"scale-points", "the same, points of each imperfect shadow map", "exponent", NULL, BENCH_NONE, 0, 0},
    {"scale-pixels", "the same, pixels", "exponent", NULL, BENCH_NONE, 0, 0},
    {"scale-threads", "all threads against one", "x", "one thread", BENCH_NONE, 0, 0},
    {"scale-triangles-4m", "whole frame at the most triangles that were tried", "ms", NULL, BENCH_NONE, 0, 0},
};

size_t bench_scale_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

/* ---- one frame --------------------------------------------------------------------------------------------------- */

typedef struct frame_cost {
    double total;
    size_t passes;
    const char* names[MAX_PASSES];
    double milliseconds[MAX_PASSES];
} frame_cost;

static bool time_passes(es_renderer* renderer, es_world* world, bool brief, frame_cost* cost)
{
    double totals[REPETITIONS], passes[MAX_PASSES][REPETITIONS], begun = demo_seconds();
    size_t count = 0;
    for (int i = -1; i < REPETITIONS && (!count || demo_seconds() - begun < (brief ? 0.4 : 2)); i++) {
        double start = demo_seconds();
        if (es_renderer_render(renderer, world) != ES_OK) return false;
        if (i < 0) continue;
        totals[count] = (demo_seconds() - start) * 1000;
        const es_frame_stats* stats = es_renderer_stats(renderer);
        cost->passes = stats->pass_count < MAX_PASSES ? stats->pass_count : MAX_PASSES;
        for (size_t k = 0; k < cost->passes; k++) {
            cost->names[k] = stats->passes[k].name;
            passes[k][count] = stats->passes[k].milliseconds;
        }
        count++;
    }
    cost->total = bench_median(totals, count);
    for (size_t k = 0; k < cost->passes; k++) cost->milliseconds[k] = bench_median(passes[k], count);
    return true;
}

static bool measure(const scene_size* size, bool brief, frame_cost* cost)
{
    *cost = (frame_cost){.total = NAN};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = size->threads;
    es_context* context = NULL;
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    if (es_context_create(&desc, &context) != ES_OK) return false;
    es_renderer_settings settings = bench_settings();
    es_world_settings world_settings = es_default_world_settings();
    world_settings.triangles = size->triangles;
    settings.vpls = size->vpls;
    settings.ism_points = size->points;
    settings.width = size->width;
    settings.height = size->height;
    bool works = es_world_create_scene(context, "room", &world_settings, &world) == ES_OK && es_world_step(world, 0) == ES_OK &&
                 es_renderer_create(context, &settings, &renderer) == ES_OK && time_passes(renderer, world, brief, cost);
    if (!works) demo_refuse_context(context);
    if (renderer) es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    es_context_destroy(context);
    return works;
}

/* ---- one axis ---------------------------------------------------------------------------------------------------- */

typedef struct axis_costs {
    double x[MAX_VALUES];
    frame_cost costs[MAX_VALUES];
    size_t count;
} axis_costs;

static size_t list_values(axis_id id, const bench_options* options, uint32_t values[MAX_VALUES])
{
    size_t count = 0;
    if (id == THREADS) {
        long online = sysconf(_SC_NPROCESSORS_ONLN);
        uint32_t most = online < 1 ? 1 : online > 64 ? 64 : (uint32_t)online;
        for (uint32_t n = 1; count < MAX_VALUES; n = n * 2 < most ? n * 2 : most) {
            values[count++] = n;
            if (n == most) break;
        }
        return count;
    }
    const uint32_t* from = options->quick ? axes[id].quick_values : axes[id].values;
    while (count < MAX_VALUES && from[count]) {
        values[count] = from[count];
        count++;
    }
    return count;
}

static bool measure_axis(axis_id id, const bench_options* options, axis_costs* costs)
{
    uint32_t values[MAX_VALUES];
    size_t count = list_values(id, options, values);
    for (size_t i = 0; i < count; i++) {
        scene_size size = middle;
        size.threads = options->threads;
        if (options->width) size.width = options->width, size.height = options->height;
        if (id == TRIANGLES) size.triangles = values[i];
        if (id == VPLS) size.vpls = values[i];
        if (id == POINTS) size.points = values[i];
        if (id == PIXELS) size.width = values[i], size.height = values[i] * 3 / 4;
        if (id == THREADS) size.threads = values[i];
        frame_cost* cost = &costs->costs[costs->count];
        if (!measure(&size, options->quick, cost)) return false;
        costs->x[costs->count++] = id == PIXELS ? (double)size.width * size.height : (double)values[i];
        fprintf(stderr, "%u %s%s: %.4g ms\n", values[i], axes[id].thing, id == PIXELS ? " a row" : "", cost->total);
    }
    return count > 0;
}

/* The passes that take the most anywhere, the slowest first; how many. */
static size_t choose_passes(const axis_costs* costs, size_t chosen[SHOWN_PASSES])
{
    bool taken[MAX_PASSES] = {false};
    size_t count = 0, passes = costs->costs[0].passes;
    while (count < SHOWN_PASSES) {
        size_t best = passes;
        double most = 0.02; /* ms; less is noise */
        for (size_t k = 0; k < passes; k++) {
            double largest = 0;
            for (size_t i = 0; i < costs->count; i++) largest = fmax(largest, costs->costs[i].milliseconds[k]);
            if (!taken[k] && largest > most) best = k, most = largest;
        }
        if (best == passes) break;
        taken[best] = true;
        chosen[count++] = best;
    }
    return count;
}

static void headline(axis_id id, const axis_costs* costs, const plot_curves* plot, char text[PLOT_HEADLINE_SIZE])
{
    const plot_series* total = &plot->series[0];
    size_t last = costs->count - 1;
    if (id == THREADS) {
        if (last) snprintf(text, PLOT_HEADLINE_SIZE, "%.0f threads light a frame %.2f times as fast as one", costs->x[last], costs->costs[0].total / costs->costs[last].total);
        else snprintf(text, PLOT_HEADLINE_SIZE, "This machine has one thread, on which a frame takes %.3g ms", costs->costs[0].total);
        return;
    }
    const plot_series* steepest = NULL;
    for (size_t s = 1; s < plot->series_count; s++) {
        /* of those that matter: a tenth of the frame at the end */
        if (plot->series[s].count != costs->count || plot->series[s].points[last].y < costs->costs[last].total / 10) continue;
        if (!steepest || plot_log_slope(&plot->series[s]) > plot_log_slope(steepest)) steepest = &plot->series[s];
    }
    char from[32], to[32], cheap[32], dear[32];
    plot_format_value(from, costs->x[0]);
    plot_format_value(to, costs->x[last]);
    plot_format_value(cheap, costs->costs[0].total);
    plot_format_value(dear, costs->costs[last].total);
    int length = snprintf(text, PLOT_HEADLINE_SIZE, "From %s to %s %s a frame goes from %s to %s ms: it grows as their number to the power of %.2f", from, to, axes[id].thing, cheap, dear,
        plot_log_slope(total));
    if (steepest) snprintf(text + length, PLOT_HEADLINE_SIZE - (size_t)length, ", steepest %s with %.2f", steepest->name, plot_log_slope(steepest));
}

static double add_axis_plot(bench_report* report, axis_id id, const axis_costs* costs, const bench_options* options)
{
    static const uint32_t colours[SHOWN_PASSES] = {0, 1, 2, 3, 4, 5};
    plot_curves plot = {.id = axes[id].id, .x_name = axes[id].x_name, .y_name = "milliseconds", .x_log = true, .y_log = true};
    plot_series* total = plot_add_series(&plot, 7, "whole frame");
    total->line = true;
    for (size_t i = 0; i < costs->count; i++) plot_add_point(&plot, total, costs->x[i], costs->costs[i].total, "whole frame");
    size_t chosen[SHOWN_PASSES], count = choose_passes(costs, chosen);
    for (size_t s = 0; s < count; s++) {
        plot_series* series = plot_add_series(&plot, colours[s], "%s", costs->costs[0].names[chosen[s]]);
        series->line = true;
        for (size_t i = 0; i < costs->count; i++)
            if (costs->costs[i].milliseconds[chosen[s]] > 0)
                plot_add_point(&plot, series, costs->x[i], costs->costs[i].milliseconds[chosen[s]], "%.0f %% of the frame",
                    100 * costs->costs[i].milliseconds[chosen[s]] / costs->costs[i].total);
    }
    headline(id, costs, &plot, plot.headline);
    int length = snprintf(plot.caption, sizeof plot.caption, "The room, nothing skipped; what does not change: %u triangles, %u lights, %u points a map, %u × %u pixels, %u threads. ", middle.triangles,
        middle.vpls, middle.points, options->width ? options->width : middle.width, options->height ? options->height : middle.height, options->threads);
    snprintf(plot.caption + length, sizeof plot.caption - (size_t)length, "Both axes are logarithmic: a straight line is a power, and the %zu slowest passes are shown.", count);
    bench_report_curves(report, &plot);
    double slope = plot_log_slope(total);
    plot_curves_free(&plot);
    return slope;
}

static void add_axis_points(demo_text* members, axis_id id, const axis_costs* costs, bool* first)
{
    for (size_t i = 0; i < costs->count; i++) {
        demo_text_add(members, "%s\n{\"axis\":\"%s\",\"value\":%.9g,\"ms\":%.6g,\"passes\":{", *first ? "" : ",", axes[id].id, costs->x[i], costs->costs[i].total);
        for (size_t k = 0; k < costs->costs[i].passes; k++) demo_text_add(members, "%s\"%s\":%.6g", k ? "," : "", costs->costs[i].names[k], costs->costs[i].milliseconds[k]);
        demo_text_add(members, "}}");
        *first = false;
    }
}

int bench_scale(const bench_options* options)
{
    static const char* const row_ids[AXES] = {"scale-triangles", "scale-vpls", "scale-points", "scale-pixels", "scale-threads"};
    bench_row all[16], rows[16];
    size_t all_count = bench_scale_rows(all, 16), count = 0;
    bench_report report = {.name = "scale", .title = "What a frame costs as everything grows", .about = "One thing grows at a time; medians of whole frames with imperfect shadow maps."};
    bool works = true, first = true;
    demo_text_add(&report.members, ",\n\"points\":[");
    for (axis_id id = 0; id < AXES && works; id++) {
        bool wanted = bench_wants(options, row_ids[id]) || (id == TRIANGLES && bench_wants(options, "scale-triangles-4m"));
        axis_costs* costs = wanted ? calloc(1, sizeof *costs) : NULL;
        if (!costs) continue;
        works = measure_axis(id, options, costs);
        if (works) {
            bench_row* row = bench_find_row(all, all_count, row_ids[id]);
            size_t last = costs->count - 1;
            row->value = add_axis_plot(&report, id, costs, options);
            snprintf(row->note, sizeof row->note, "%.4g ms at %.9g, %.4g ms at %.9g", costs->costs[0].total, costs->x[0], costs->costs[last].total, costs->x[last]);
            if (id == THREADS) row->value = row->ratio = costs->costs[0].total / costs->costs[last].total, row->peer_value = 1;
            if (id == TRIANGLES) {
                row = bench_find_row(all, all_count, "scale-triangles-4m");
                row->value = costs->costs[last].total;
                snprintf(row->note, sizeof row->note, "%.9g triangles", costs->x[last]);
            }
            add_axis_points(&report.members, id, costs, &first);
        }
        free(costs);
    }
    demo_text_add(&report.members, "\n]");
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
