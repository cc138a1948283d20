/* What `bench error` found: rows with targets, plots whose headlines are computed from them. */
#include "bench_error.h"

#include <math.h>
#include <string.h>

#define EMBREE "Embree 3, one bounce, two threads"
static const double frame_budget = 50; /* ms */
enum { SETTING_NAME_SIZE = 128, LEAST_SAMPLES = 8 };

static const bench_row table[] = {
    {"reference-room-0.05", "path tracer to relRMSE 0.05 of the room's indirect light", "s", EMBREE, BENCH_RATIO_AT_LEAST, 1 / 1.5, 2},
    {"references-agree", "blocks of 16 × 16 pixels in which both references agree to 3 standard errors", "%", NULL, BENCH_VALUE_AT_LEAST, 100, 100},
    {"indirect-50ms", "best setting within 50 ms for a whole frame, room, 1024×768; the peer's time to the same error of the indirect light", "ms",
        EMBREE ", and its 8×8 filter", BENCH_RATIO_AT_LEAST, 10, 30},
    {"error-room-50ms", "indirect light of the best setting within 50 ms, room", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"error-cornell-50ms", "the same, cornell", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"error-hall-50ms", "the same, hall", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"error-room-best", "indirect light of the most exact setting, room", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"error-cornell-best", "the same, cornell", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"error-hall-best", "the same, hall", "relRMSE", NULL, BENCH_NONE, 0, 0},
};

size_t bench_error_rows(bench_row* rows, size_t capacity)
{
    size_t count = sizeof table / sizeof table[0];
    for (size_t i = 0; i < count && i < capacity; i++) {
        rows[i] = table[i];
        rows[i].value = rows[i].peer_value = rows[i].ratio = NAN;
    }
    return count < capacity ? count : capacity;
}

/* The frame without indirect light is drawn to compare with; it is nobody's choice. */
static bool is_choice(const error_point* point) { return strcmp(point->setting->settings, "gi=none") != 0; }

const error_point* error_best_within(const error_scene* scene, double milliseconds)
{
    const error_point* best = NULL;
    for (size_t i = 0; i < scene->count; i++) {
        const error_point* point = &scene->points[i];
        if (is_choice(point) && point->milliseconds <= milliseconds && (!best || point->error.relrmse < best->error.relrmse)) best = point;
    }
    return best;
}

static const error_point* fastest(const error_scene* scene)
{
    const error_point* best = NULL;
    for (size_t i = 0; i < scene->count; i++)
        if (is_choice(&scene->points[i]) && (!best || scene->points[i].milliseconds < best->milliseconds)) best = &scene->points[i];
    return best;
}

/* "one thing changed" names a group on the plots; what was changed says it in a sentence. */
static void describe(const error_point* point, char text[SETTING_NAME_SIZE])
{
    const char *series = point->setting->series, *group = strstr(series, ", one thing changed");
    snprintf(text, SETTING_NAME_SIZE, "%.*s, %s", (int)(group ? (size_t)(group - series) : strlen(series)), series, point->setting->label);
}

/* ---- rows -------------------------------------------------------------------------------------------------------- */

static void fill_tracer_row(const error_scene* scene, bench_row* row)
{
    bool ours_extrapolated, peer_extrapolated;
    row->value = error_seconds_to(&scene->ours, 0.05, &ours_extrapolated);
    row->peer_value = error_seconds_to(&scene->embree.raw, 0.05, &peer_extrapolated);
    row->ratio = row->peer_value / row->value;
    if (scene->embree.why[0]) snprintf(row->note, sizeof row->note, "%s", scene->embree.why);
    else if (ours_extrapolated || peer_extrapolated)
        snprintf(row->note, sizeof row->note, "extrapolated from the last two doublings: %s", ours_extrapolated && peer_extrapolated ? "both" : ours_extrapolated ? "ours" : "Embree's");
}

static void fill_agreement_row(const error_scene* scene, bench_row* row)
{
    const error_agreement* a = &scene->agreement;
    if (a->blocks && a->samples < LEAST_SAMPLES) snprintf(row->note, sizeof row->note, "%u samples a pixel are too few to know their noise", (unsigned)a->samples);
    if (!a->blocks || a->samples < LEAST_SAMPLES) return;
    row->value = 100.0 * (double)a->within / (double)a->blocks;
    snprintf(row->note, sizeof row->note, "%zu of %zu blocks; the worst is %.2f standard errors off; ours has %u samples a pixel; by chance alone 99.73 %% would agree", a->within,
        a->blocks, a->worst, (unsigned)a->samples);
}

static void fill_budget_row(const error_scene* scene, bench_row* row)
{
    const error_point *best = error_best_within(scene, frame_budget), *least = fastest(scene);
    if (!best) {
        if (least) snprintf(row->note, sizeof row->note, "no setting is as fast; the fastest takes %.3g ms", least->milliseconds);
        return;
    }
    bool extrapolated;
    char name[SETTING_NAME_SIZE];
    double seconds = error_seconds_to(&scene->embree.filtered, best->error.relrmse, &extrapolated);
    describe(best, name);
    row->value = best->milliseconds;
    row->peer_value = (seconds + scene->embree.primary_seconds) * 1000;
    row->ratio = row->peer_value / row->value;
    snprintf(row->note, sizeof row->note, "relRMSE %.3f: %s%s%s", best->error.relrmse, name, extrapolated ? "; Embree's time is extrapolated" : "",
        scene->embree.filtered.count && best->error.relrmse >= scene->embree.filtered.points[0].error.relrmse ? "; Embree is there with its first sample" : "");
}

void error_fill_rows(const error_scene* scene, bench_row* rows, size_t count)
{
    char id[64];
    snprintf(id, sizeof id, "error-%.40s-50ms", scene->name);
    bench_row* row = bench_find_row(rows, count, id);
    const error_point *best = error_best_within(scene, frame_budget), *exact = error_best_within(scene, INFINITY);
    if (row && best) {
        row->value = best->error.relrmse;
        describe(best, row->note);
    }
    snprintf(id, sizeof id, "error-%.40s-best", scene->name);
    row = bench_find_row(rows, count, id);
    if (row && exact) {
        char name[SETTING_NAME_SIZE];
        row->value = exact->error.relrmse;
        describe(exact, name);
        snprintf(row->note, sizeof row->note, "%s, %.4g ms", name, exact->milliseconds);
    }
    if (!scene->is_room) return;
    fill_tracer_row(scene, bench_find_row(rows, count, "reference-room-0.05"));
    fill_agreement_row(scene, bench_find_row(rows, count, "references-agree"));
    if (scene->count) fill_budget_row(scene, bench_find_row(rows, count, "indirect-50ms"));
}

/* ---- plots ------------------------------------------------------------------------------------------------------- */

typedef enum measure { RELRMSE, FLIP_WHOLE, FLICKER } measure;

static double measure_of(const error_measures* error, double flicker, measure which) { return which == RELRMSE ? error->relrmse : which == FLIP_WHOLE ? error->flip_whole : flicker; }

static void add_settings(plot_curves* plot, const error_scene* scene, measure which)
{
    plot_series* series = NULL;
    for (size_t i = 0; i < scene->count; i++) {
        const error_point* p = &scene->points[i];
        if (!series || strcmp(series->name, p->setting->series) != 0) {
            series = plot_add_series(plot, p->setting->colour, "%s", p->setting->series);
            series->line = p->setting->line;
            series->competes = is_choice(p);
        }
        plot_add_point(plot, series, p->milliseconds, measure_of(&p->error, p->flicker, which), "%s; relRMSE %.3f, relMSE %.2g, FLIP %.3f of the indirect light, flicker %.3f",
            p->setting->label, p->error.relrmse, p->error.relmse, p->error.flip, p->flicker);
    }
}

static void add_curve(plot_curves* plot, const error_curve* curve, const char* name, uint32_t colour, bool dashed, double scale, double offset, measure which)
{
    if (!curve->count || which == FLICKER) return;
    plot_series* series = plot_add_series(plot, colour, "%s", name);
    series->line = true;
    series->dashed = dashed;
    series->competes = scale > 1;
    for (size_t i = 0; i < curve->count; i++)
        plot_add_point(plot, series, (curve->points[i].seconds + offset) * scale, measure_of(&curve->points[i].error, NAN, which), "%u %s a pixel; relRMSE %.3f",
            curve->points[i].samples, curve->points[i].samples == 1 ? "sample" : "samples", curve->points[i].error.relrmse);
}

static void error_headline(const error_scene* scene, char text[PLOT_HEADLINE_SIZE])
{
    const error_point *best = error_best_within(scene, frame_budget), *exact = error_best_within(scene, INFINITY);
    char name[SETTING_NAME_SIZE], exact_name[SETTING_NAME_SIZE], time[32];
    if (!exact) return;
    describe(exact, exact_name);
    plot_format_value(time, exact->milliseconds);
    if (!best) {
        const error_point* least = fastest(scene);
        describe(least, name);
        snprintf(text, PLOT_HEADLINE_SIZE, "%.80s: no setting takes 50 ms or less; %s takes %.3g ms and errs by %.0f %%, the most exact, %s, by %.0f %% in %s ms", scene->name, name,
            least->milliseconds, 100 * least->error.relrmse, exact_name, 100 * exact->error.relrmse, time);
        return;
    }
    describe(best, name);
    bool extrapolated;
    double seconds = error_seconds_to(&scene->embree.filtered, best->error.relrmse, &extrapolated) + scene->embree.primary_seconds;
    if (isfinite(seconds))
        snprintf(text, PLOT_HEADLINE_SIZE, "%.80s: %.0f ms with %s leave an error of %.0f %%; Embree's path tracer and its filter take %.0f ms for the same, %.1f times as long", scene->name,
            best->milliseconds, name, 100 * best->error.relrmse, seconds * 1000, seconds * 1000 / best->milliseconds);
    else
        snprintf(text, PLOT_HEADLINE_SIZE, "%.80s: the best within 50 ms, %s, errs by %.0f %%; the most exact, %s, by %.0f %% in %s ms", scene->name, name, 100 * best->error.relrmse,
            exact_name, 100 * exact->error.relrmse, time);
}

static void least_headline(const error_scene* scene, measure which, char text[PLOT_HEADLINE_SIZE])
{
    const error_point *fast = NULL, *least = NULL;
    char name[SETTING_NAME_SIZE], fast_name[SETTING_NAME_SIZE], time[32];
    for (size_t i = 0; i < scene->count; i++) {
        const error_point* p = &scene->points[i];
        double value = measure_of(&p->error, p->flicker, which);
        if (isnan(value) || !is_choice(p)) continue;
        if (!least || value < measure_of(&least->error, least->flicker, which)) least = p;
        if (p->milliseconds <= frame_budget && (!fast || value < measure_of(&fast->error, fast->flicker, which))) fast = p;
    }
    if (!least) return;
    describe(least, name);
    plot_format_value(time, least->milliseconds);
    const char *what = which == FLICKER ? "the steadiest setting" : "the setting that looks most like the truth", *unit = which == FLICKER ? "flicker" : "FLIP";
    if (fast && fast != least) {
        describe(fast, fast_name);
        snprintf(text, PLOT_HEADLINE_SIZE, "%.80s: within 50 ms %s is %s, %s %.3f; without that limit %s, %.3f in %s ms", scene->name, what, fast_name, unit,
            measure_of(&fast->error, fast->flicker, which), name, measure_of(&least->error, least->flicker, which), time);
    } else {
        snprintf(text, PLOT_HEADLINE_SIZE, "%.80s: %s is %s, %s %.3f in %s ms", scene->name, what, name, unit, measure_of(&least->error, least->flicker, which), time);
    }
}

static void add_setting_plot(bench_report* report, const error_scene* scene, measure which, uint32_t width, uint32_t height)
{
    static const char* const ids[] = {"error", "flip", "flicker"};
    static const char* const names[] = {"error of the indirect light, relRMSE", "FLIP of all light", "flicker of the indirect light"};
    char id[80];
    snprintf(id, sizeof id, "%.60s-%s", strrchr(scene->name, '/') ? strrchr(scene->name, '/') + 1 : scene->name, ids[which]);
    for (char* c = id; *c; c++)
        if (!strchr("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-", *c)) *c = '-';
    plot_curves plot = {.id = id, .x_name = "milliseconds for a whole frame", .y_name = names[which], .x_log = true, .y_log = true};
    add_settings(&plot, scene, which);
    if (scene->is_room) {
        add_curve(&plot, &scene->embree.raw, "Embree's path tracer", 1, true, 1000, scene->embree.primary_seconds, which);
        add_curve(&plot, &scene->embree.filtered, "Embree's, and an 8×8 filter", 1, true, 1000, scene->embree.primary_seconds, which);
        add_curve(&plot, &scene->ours, "our path tracer", 7, false, 1000, 0, which);
    }
    plot_add_rule(&plot, true, frame_budget, "50 ms");
    plot_mark_front(&plot);
    if (which == RELRMSE) error_headline(scene, plot.headline);
    else least_headline(scene, which, plot.headline);
    char noise[80] = "which is not known";
    if (isfinite(scene->truth.noise_relrmse)) snprintf(noise, sizeof noise, "about %.3f, as Embree's curve goes on to its samples", scene->truth.noise_relrmse);
    int length = snprintf(plot.caption, sizeof plot.caption, "%u × %u pixels. Left and down is better; the yellow band joins the settings that nothing beats in both.%s ", width, height,
        which == RELRMSE ? " relRMSE: the root of the mean squared error, as a share of the mean of the truth." : which == FLIP_WHOLE ? " FLIP: the difference an eye sees, 0 none, 1 all." : "");
    if (which == FLICKER)
        snprintf(plot.caption + length, sizeof plot.caption - (size_t)length,
            "Flicker is the error of the change between moving frames, as a share of the mean, at %u × %u pixels, while the camera turns by a quarter of a degree a frame; the truth's "
            "own noise is taken out.",
            width / 4, height / 4);
    else if (scene->truth.halves[0].pixels)
        snprintf(plot.caption + length, sizeof plot.caption - (size_t)length, "Truth: %s; its noise, %.3f of the mean, is %s.", scene->truth.source, scene->truth.noise_relrmse,
            which == RELRMSE ? "taken out by comparing with two independent halves" : "part of what is shown");
    else
        snprintf(plot.caption + length, sizeof plot.caption - (size_t)length, "Truth: %s; errors include its own noise, %s. Times of path tracers leave out building their hierarchies.",
            scene->truth.source, noise);
    bench_report_curves(report, &plot);
    plot_curves_free(&plot);
}

static void add_tracer_plot(bench_report* report, const error_scene* scene)
{
    plot_curves plot = {.id = "path-tracers", .x_name = "seconds", .y_name = "error of the indirect light, relRMSE", .x_log = true, .y_log = true};
    bool ours_extrapolated, peer_extrapolated;
    double ours = error_seconds_to(&scene->ours, 0.05, &ours_extrapolated), peer = error_seconds_to(&scene->embree.raw, 0.05, &peer_extrapolated);
    add_curve(&plot, &scene->ours, "ours", 0, false, 1, 0, RELRMSE);
    add_curve(&plot, &scene->embree.raw, "Embree's", 1, true, 1, 0, RELRMSE);
    plot_add_rule(&plot, false, 0.05, "0.05");
    if (isfinite(ours) && isfinite(peer))
        snprintf(plot.headline, sizeof plot.headline, "Our path tracer takes %.3g s to an error of 5 %% of the room's indirect light%s, Embree's %.3g s%s: ours is %.2g times %s", ours,
            ours_extrapolated ? " (extrapolated)" : "", peer, peer_extrapolated ? " (extrapolated)" : "", ours < peer ? peer / ours : ours / peer,
            ours < peer ? "as fast" : "slower");
    else snprintf(plot.headline, sizeof plot.headline, "Our path tracer takes %.3g s to an error of 5 %% of the room's indirect light%s", ours, ours_extrapolated ? " (extrapolated)" : "");
    snprintf(plot.caption, sizeof plot.caption, "Samples double from mark to mark. Truth: %s. Building the hierarchies is left out, and so are Embree's first hits, %.0f ms.", scene->truth.source,
        scene->embree.primary_seconds * 1000);
    if (!isfinite(scene->embree.primary_seconds)) snprintf(plot.caption, sizeof plot.caption, "Samples double from mark to mark. Truth: %s.", scene->truth.source);
    bench_report_curves(report, &plot);
    plot_curves_free(&plot);
}

static void add_agreement_plot(bench_report* report, const error_scene* scene)
{
    const error_agreement* a = &scene->agreement;
    if (!a->blocks || !a->deviations || a->samples < LEAST_SAMPLES) return;
    plot_curves plot = {.id = "agreement", .x_name = "standard errors between the two references' means of a block", .y_name = "share of blocks further apart, %", .y_log = true};
    plot_series* measured = plot_add_series(&plot, 0, "measured");
    measured->line = true;
    for (size_t i = 0; i < a->blocks; i += 1 + a->blocks / 40)
        plot_add_point(&plot, measured, a->deviations[i], 100.0 * (double)(a->blocks - i) / (double)a->blocks, "%zu blocks", a->blocks - i);
    plot_add_point(&plot, measured, a->worst, 100.0 / (double)a->blocks, "the worst block");
    plot_series* chance = plot_add_series(&plot, 6, "noise alone");
    chance->line = chance->dashed = true;
    for (double z = 0; z <= fmin(fmax(a->worst, 3), 5) + 1e-9; z += 0.25) plot_add_point(&plot, chance, z, 100 * erfc(z / sqrt(2)), "normal distribution");
    plot_add_rule(&plot, true, 3, "3 standard errors");
    snprintf(plot.headline, sizeof plot.headline, "Our reference and Embree's agree to 3 standard errors in %zu of %zu blocks of %u × %u pixels; the worst is %.1f off", a->within, a->blocks,
        a->side, a->side, a->worst);
    snprintf(plot.caption, sizeof plot.caption,
        "If nothing but noise told them apart, the measured curve would lie on or below the dashed one (below, because samples that are spread evenly have less noise than the estimate, "
        "which takes them for random). Ours has %u samples a pixel, Embree's %u.",
        (unsigned)a->samples, (unsigned)scene->truth.samples);
    bench_report_curves(report, &plot);
    plot_curves_free(&plot);
}

void error_add_plots(bench_report* report, const error_scene* scene, uint32_t width, uint32_t height)
{
    if (scene->count) {
        add_setting_plot(report, scene, RELRMSE, width, height);
        add_setting_plot(report, scene, FLIP_WHOLE, width, height);
        add_setting_plot(report, scene, FLICKER, width, height);
    }
    if (!scene->is_room) return;
    add_tracer_plot(report, scene);
    add_agreement_plot(report, scene);
}

/* ---- JSON -------------------------------------------------------------------------------------------------------- */

static void add_number(demo_text* text, const char* key, double value)
{
    if (isfinite(value)) demo_text_add(text, ",\"%s\":%.6g", key, value);
    else demo_text_add(text, ",\"%s\":null", key);
}

static void add_measures(demo_text* text, double milliseconds, const error_measures* error, double flicker)
{
    add_number(text, "ms", milliseconds);
    add_number(text, "relrmse", error->relrmse);
    add_number(text, "relmse", error->relmse);
    add_number(text, "rell1", error->rell1);
    add_number(text, "flip", error->flip);
    add_number(text, "flip_whole", error->flip_whole);
    add_number(text, "flicker", flicker);
    demo_text_add(text, "}");
}

static void add_curve_points(demo_text* text, const error_scene* scene, const error_curve* curve, const char* name, double offset)
{
    for (size_t i = 0; i < curve->count; i++) {
        demo_text_add(text, ",\n{\"scene\":");
        demo_text_add_json_string(text, scene->name);
        demo_text_add(text, ",\"series\":\"%s\",\"label\":\"%u samples\",\"settings\":null", name, curve->points[i].samples);
        add_measures(text, (curve->points[i].seconds + offset) * 1000, &curve->points[i].error, NAN);
    }
}

void error_add_points(demo_text* members, const error_scene* scene, bool first)
{
    for (size_t i = 0; i < scene->count; i++) {
        const error_point* p = &scene->points[i];
        demo_text_add(members, "%s\n{\"scene\":", first && !i ? "" : ",");
        demo_text_add_json_string(members, scene->name);
        demo_text_add(members, ",\"series\":\"%s\",\"label\":\"%s\",\"settings\":\"%s\"", p->setting->series, p->setting->label, p->setting->settings);
        add_measures(members, p->milliseconds, &p->error, p->flicker);
    }
    if (!scene->count) return;
    add_curve_points(members, scene, &scene->embree.raw, "Embree", scene->embree.primary_seconds);
    add_curve_points(members, scene, &scene->embree.filtered, "Embree, 8x8 filter", scene->embree.primary_seconds);
    add_curve_points(members, scene, &scene->ours, "our path tracer", 0);
}
