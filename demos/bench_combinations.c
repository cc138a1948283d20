/* `bench combinations`: far light by virtual point lights with near light found in screen space, scene by scene: is a combination ever worse than its better part? */
#include <math.h>
#include <string.h>

#include "bench_sitting.h"

#define SCENE(name) {"combinations-" name, name ": indirect light of the worst combination of virtual point lights and screen space", "relRMSE", "the lights alone", BENCH_RATIO_AT_LEAST, 1, 1}
static const bench_row table[] = {SCENE("crease"), SCENE("room"), SCENE("bunny-box"), SCENE("gallery")};

size_t bench_combinations_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

enum { ALONE, NEAR, BOUNCE, COMPENSATION, BOUNCE_REPAIR, COMPENSATION_REPAIR, MICRO, WAYS };
static const struct { const char *name, *settings; } ways[WAYS] = {
    [ALONE] = {"lights", "gi=ism"},
    [NEAR] = {"bounce alone", "gi=none screen.bounce=true"},
    [BOUNCE] = {"+ bounce", "gi=ism screen.bounce=true"},
    [COMPENSATION] = {"+ compensation", "gi=ism compensation.steps=1"},
    [BOUNCE_REPAIR] = {"+ bounce, repair", "gi=ism screen.bounce=true screen.repair=4"},
    [COMPENSATION_REPAIR] = {"+ compensation, repair", "gi=ism compensation.steps=1 screen.repair=4"},
    [MICRO] = {"micro-buffers, which are combined with nothing,", "gi=micro"},
};

/* Root of the mean square over several sets of lights. */
static bool measure_way(bench_sitting* bench, const sitting_stage* stage, const char* settings, uint32_t seeds, double* error)
{
    double squares = 0;
    for (uint32_t i = 0; i < seeds; i++) {
        char text[192];
        sitting_error one;
        snprintf(text, sizeof text, "%s vpl.seed=%u", settings, 4096 * i);
        if (!sitting_measure(bench, stage, text, &one)) return false;
        squares += one.all * one.all / seeds;
    }
    *error = sqrt(squares);
    return true;
}

static bool measure_scene(bench_sitting* bench, const char* scene)
{
    bench_row* row = sitting_row(bench, "combinations-%s", scene);
    if (!row) return true;
    sitting_stage stage;
    double errors[WAYS], worst = 0;
    bool works = sitting_open_stage(bench, scene, &stage);
    for (int k = 0; k < WAYS && works; k++) works = measure_way(bench, &stage, ways[k].settings, k == NEAR || k == MICRO || bench->options->quick ? 1 : 3, &errors[k]);
    sitting_close_stage(bench, &stage);
    if (!works) return false;
    for (int k = BOUNCE; k < MICRO; k++) worst = fmax(worst, errors[k]);
    row->value = worst;
    row->peer_value = fmin(errors[ALONE], errors[NEAR]);
    row->ratio = row->peer_value / worst;
    size_t length = 0;
    for (int k = 0; k < WAYS && length < sizeof row->note; k++) length += (size_t)snprintf(row->note + length, sizeof row->note - length, "%s%s %.3f", k ? "; " : "", ways[k].name, errors[k]);
    return true;
}

int bench_combinations(const bench_options* options)
{
    static const char* const scenes[] = {"crease", "room", "bunny-box", "gallery"};
    bench_sitting* bench = sitting_open(options, bench_combinations_rows, 256, 192);
    if (!bench) return DEMO_BAD_INPUT;
    bench->frames = 1;
    bench->report = (bench_report){.name = "combinations", .title = "Combinations", .about = "Indirect light of one bounce by 1024 lights, with what screen space adds to it, beside the path tracer's: each combination beside the lights by themselves. 256 × 192."};
    bool works = true;
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0] && works; i++) works = measure_scene(bench, scenes[i]);
    return sitting_close(bench, works);
}
