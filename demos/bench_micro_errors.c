/* How wrong micro-buffers are: against the path tracer's picture of the same bounce, and in the time that 1024 lights with imperfect shadow maps take. */
#include "bench_micro.h"

#include <math.h>
#include <string.h>

static const char maps[] = "gi=ism vpl.count=1024";

static void set_value(bench_row* row, const sitting_error* error)
{
    if (!row) return;
    row->value = error->all;
    snprintf(row->note, sizeof row->note, "%.4g ms a frame; %.3f where something is near", error->milliseconds, error->contact);
}

/* ---- the time of 1024 lights ---------------------------------------------------------------------------------------------------- */

/* From the least to the most that is done; the error is taken of the best that is not more than 5 % slower. */
static const struct { uint32_t spacing, size, exponent; } efforts[] = {{4, 8, 14}, {4, 8, 16}, {4, 12, 16}, {4, 12, 18}, {4, 16, 16}, {4, 16, 18}, {4, 24, 16}, {4, 24, 18}, {4, 24, 20}, {2, 8, 16}, {2, 12, 16},
    {2, 12, 18}, {2, 16, 18}, {2, 24, 18}, {2, 24, 20}, {1, 12, 18}, {1, 16, 18}, {1, 24, 18}};

static void set_ratio(bench_row* row, double ours, double theirs, const char* how, const sitting_error* a, const sitting_error* b)
{
    if (!row) return;
    row->value = ours;
    row->peer_value = theirs;
    row->ratio = how[0] ? theirs / ours : NAN;
    snprintf(row->note, sizeof row->note, "%s: %.4g ms against %.4g", how[0] ? how : "no setting is as fast; the fastest", a->milliseconds, b->milliseconds);
}

static void add_mark(plot_curves* plot, const char* name, uint32_t colour, const sitting_error* error, const char* note)
{
    plot_series* series = plot->series_count && !strcmp(plot->series[plot->series_count - 1].name, name) ? &plot->series[plot->series_count - 1] : plot_add_series(plot, colour, "%s", name);
    series->competes = true;
    plot_add_point(plot, series, error->milliseconds, error->all, "%s", note);
}

static bool measure_equal_time(bench_sitting* bench, const sitting_stage* stage, const char* scene, plot_curves* plot)
{
    bench_row *all = sitting_row(bench, "micro-equal-time-%s", scene), *contact = sitting_row(bench, "micro-equal-time-contact-%s", scene);
    if (!all && !contact) return true;
    sitting_error lights, best = {NAN, NAN, NAN, NAN}, fastest = {NAN, NAN, NAN, INFINITY};
    char how[96] = "";
    if (!sitting_measure(bench, stage, maps, &lights)) return false;
    if (plot) add_mark(plot, "1024 lights, imperfect maps", 1, &lights, maps);
    for (size_t i = 0; i < sizeof efforts / sizeof efforts[0]; i++) {
        char text[96];
        sitting_error error;
        if (bench->options->quick && i % 4) continue;
        snprintf(text, sizeof text, "gi=micro micro.spacing=%u micro.size=%u micro.points=%u", efforts[i].spacing, efforts[i].size, 1u << (bench->options->quick ? micro_exponent(bench) : efforts[i].exponent));
        if (!sitting_measure(bench, stage, text, &error)) return false;
        if (plot) add_mark(plot, "micro-buffers", 0, &error, text);
        if (error.milliseconds < fastest.milliseconds) fastest = error;
        if (error.milliseconds <= 1.05 * lights.milliseconds && !(error.all >= best.all)) {
            best = error;
            snprintf(how, sizeof how, "%s", text);
        }
        if (error.milliseconds > 6 * lights.milliseconds) break;
    }
    if (!how[0]) best = fastest; /* without a ratio: it took longer */
    set_ratio(all, best.all, lights.all, how, &best, &lights);
    set_ratio(contact, best.contact, lights.contact, how, &best, &lights);
    return true;
}

/* ---- what figures 6.15 to 6.17 compare ------------------------------------------------------------------------------------------ */

static bool measure_variants(bench_sitting* bench, const sitting_stage* stage)
{
    char text[128];
    sitting_error error, other;
    for (uint32_t size = 8; size <= 32; size += 8) {
        bench_row* row = sitting_row(bench, "micro-size-%u", size);
        if (!row) continue;
        snprintf(text, sizeof text, "gi=micro micro.points=%u micro.size=%u", 1u << micro_exponent(bench), size);
        if (!sitting_measure(bench, stage, text, &error)) return false;
        set_value(row, &error);
    }
    for (uint32_t spacing = 1; spacing <= 4; spacing *= 2) {
        bench_row* row = sitting_row(bench, "micro-spacing-%u", spacing);
        if (!row) continue;
        snprintf(text, sizeof text, "gi=micro micro.points=%u micro.spacing=%u", 1u << micro_exponent(bench), spacing);
        if (!sitting_measure(bench, stage, text, &error)) return false;
        set_value(row, &error);
    }
    bench_row *nodes = sitting_row(bench, "micro-nodes"), *time = sitting_row(bench, "micro-nodes-time");
    if (!nodes && !time) return true;
    for (int k = 0; k < 2; k++) {
        snprintf(text, sizeof text, "gi=micro micro.points=%u micro.nodes=%s", 1u << micro_exponent(bench), k ? "float" : "quantised");
        if (!sitting_measure(bench, stage, text, k ? &other : &error)) return false;
    }
    if (nodes) {
        nodes->value = error.all;
        nodes->peer_value = other.all;
        nodes->ratio = other.all / error.all;
    }
    if (time) {
        time->value = error.milliseconds;
        time->peer_value = other.milliseconds;
        time->ratio = other.milliseconds / error.milliseconds;
    }
    return true;
}

static bool measure_ray_cast(bench_sitting* bench, const sitting_stage* stage, const char* scene, const sitting_error* cast)
{
    bench_row* row = sitting_row(bench, "micro-ray-cast-off-%s", scene);
    if (!row) return true;
    char text[128];
    sitting_error drawn;
    snprintf(text, sizeof text, "gi=micro micro.points=%u micro.ray-cast=false", 1u << micro_exponent(bench));
    if (!sitting_measure(bench, stage, text, &drawn)) return false;
    row->value = drawn.all;
    row->peer_value = cast->all;
    row->ratio = cast->all / drawn.all;
    snprintf(row->note, sizeof row->note, "%.3f and %.3f where something is near; %.4g and %.4g ms", drawn.contact, cast->contact, drawn.milliseconds, cast->milliseconds);
    return true;
}

static bool measure_scene(bench_sitting* bench, const char* scene)
{
    bench_row *every = sitting_row(bench, "micro-error-%s", scene), *sparse = sitting_row(bench, "micro-error-sixteenth-%s", scene), *off = sitting_row(bench, "micro-ray-cast-off-%s", scene);
    const bool equal = sitting_row(bench, "micro-equal-time-%s", scene) || sitting_row(bench, "micro-equal-time-contact-%s", scene), hall = !strcmp(scene, "hall");
    bool variants = sitting_row(bench, "micro-nodes") || sitting_row(bench, "micro-nodes-time");
    for (uint32_t size = 8; size <= 32; size += 8) variants |= sitting_row(bench, "micro-size-%u", size) != NULL;
    for (uint32_t spacing = 1; spacing <= 4; spacing *= 2) variants |= sitting_row(bench, "micro-spacing-%u", spacing) != NULL;
    if (!every && !sparse && !off && !equal && !(hall && variants)) return true;
    sitting_stage stage;
    sitting_error error = {NAN, NAN, NAN, NAN};
    bool works = sitting_open_stage(bench, scene, &stage);
    char text[128], id[64];
    snprintf(text, sizeof text, "gi=micro micro.points=%u", 1u << micro_exponent(bench));
    if (works && (every || off)) works = sitting_measure(bench, &stage, text, &error);
    if (works && every) {
        set_value(every, &error);
        const size_t length = strlen(every->note);
        snprintf(every->note + length, sizeof every->note - length, "; the truth has %llu samples, noise of %.3f that is not counted", (unsigned long long)stage.truth.samples, stage.truth.noise_relrmse);
    }
    if (works) works = measure_ray_cast(bench, &stage, scene, &error);
    snprintf(text, sizeof text, "gi=micro micro.points=%u micro.spacing=4", 1u << micro_exponent(bench));
    if (works && sparse) {
        works = sitting_measure(bench, &stage, text, &error);
        if (works) set_value(sparse, &error);
    }
    snprintf(id, sizeof id, "equal-time-%s", scene);
    plot_curves plot = {.id = id, .x_name = "milliseconds of a frame", .y_name = "relRMSE of indirect light", .x_log = true, .y_log = true};
    works = works && measure_equal_time(bench, &stage, scene, &plot);
    if (works && plot.series_count > 1) {
        const bench_row* row = sitting_row(bench, "micro-equal-time-%s", scene);
        plot_mark_front(&plot);
        if (row && !isnan(row->ratio)) snprintf(plot.headline, sizeof plot.headline, "In the time of 1024 lights micro-buffers have %.2f of their error in %s", 1 / row->ratio, scene);
        else if (row) snprintf(plot.headline, sizeof plot.headline, "No micro-buffers are as fast as 1024 lights in %s", scene);
        snprintf(plot.caption, sizeof plot.caption, "%s, %u × %u, micro-buffers of several sizes at one pixel of 16, of 4, and at every pixel, from several numbers of points; nothing skipped.", scene, bench->width, bench->height);
        bench_report_curves(&bench->report, &plot);
    }
    plot_curves_free(&plot);
    if (works && hall) works = measure_variants(bench, &stage);
    sitting_close_stage(bench, &stage);
    return works;
}

/* ---- the ring ----------------------------------------------------------------------------------------------------------------------- */

static bool measure_rings(bench_sitting* bench)
{
    static const char* const surfaces[] = {"phong-5", "phong-20", "phong-50", "ggx-0.5", "ggx-0.2", "ggx-0.1"};
    plot_curves plot = {.id = "ring", .x_name = "surface", .y_name = "relRMSE of indirect light", .y_log = true};
    plot_series *ours = plot_add_series(&plot, 0, "micro-buffers"), *theirs = plot_add_series(&plot, 1, "1024 lights, imperfect maps");
    bool works = true;
    ours->line = theirs->line = true;
    for (size_t i = 0; i < sizeof surfaces / sizeof surfaces[0] && works; i++) {
        bench_row* row = sitting_row(bench, "micro-ring-%s", surfaces[i]);
        const bool equal = !strcmp(surfaces[i], "phong-20") && sitting_row(bench, "micro-equal-time-ring");
        if (!row && !equal) continue;
        char name[64], text[64];
        sitting_stage stage;
        sitting_error error, lights;
        snprintf(name, sizeof name, "ring-%s", surfaces[i]);
        snprintf(text, sizeof text, "gi=micro micro.points=%u", 1u << micro_exponent(bench));
        works = sitting_open_stage(bench, name, &stage);
        if (works && row) works = sitting_measure(bench, &stage, text, &error) && sitting_measure(bench, &stage, maps, &lights);
        if (works && row) {
            row->value = error.all;
            row->peer_value = lights.all;
            row->ratio = lights.all / error.all;
            snprintf(row->note, sizeof row->note, "%.3f on the ring itself (the lights: %.3f); %.4g ms (the lights: %.4g)", error.glossy, lights.glossy, error.milliseconds, lights.milliseconds);
            plot_add_point(&plot, ours, (double)i + 1, error.all, "%s, %.3f on the ring itself", surfaces[i], error.glossy);
            plot_add_point(&plot, theirs, (double)i + 1, lights.all, "%s, %.3f on the ring itself", surfaces[i], lights.glossy);
        }
        if (works && equal) works = measure_equal_time(bench, &stage, "ring", NULL);
        sitting_close_stage(bench, &stage);
    }
    if (works && ours->count) {
        snprintf(plot.headline, sizeof plot.headline, "Around a glossy ring the error of indirect light goes from %.3f to %.3f", ours->points[0].y, ours->points[ours->count - 1].y);
        snprintf(plot.caption, sizeof plot.caption, "The scene ring without its silk, every pixel; 1, 2, 3: Phong lobes of exponent 5, 20, 50; 4, 5, 6: metal of roughness 0.5, 0.2, 0.1.");
        bench_report_curves(&bench->report, &plot);
    }
    plot_curves_free(&plot);
    return works;
}

bool micro_measure_errors(bench_sitting* bench)
{
    static const char* const scenes[] = {"cornell", "room", "hall", "gallery"};
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++)
        if (!measure_scene(bench, scenes[i])) return false;
    return measure_rings(bench);
}
