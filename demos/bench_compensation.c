/* `bench compensation`: what bounds take from virtual point lights, found again among the pixels (Novák et al. 2011): how long a step takes, how many patches a pixel looks
 * at (fig. 4a), and how much of the energy comes back. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench_sitting.h"

/* Pairs within a twentieth of the scene's extent: what screen.radius allows by default. */
#define BOUND "400"
/* Steps are of bounces: the light that is taken is that of as many. */
#define BOUNCES "3"
#define STEP(id, work) {id, work, "ms", NULL, BENCH_VALUE_AT_MOST, 54, 27}
#define ENERGY_OF(name, text, judge, a, b, c, x, y, z) \
    {"compensation-energy-" name "-1", text ", vpl.bound " BOUND ": of the energy that the bound takes, what one step brings back", "%", NULL, judge, a, x}, \
    {"compensation-energy-" name "-2", text ": two steps", "%", NULL, judge, b, y}, \
    {"compensation-energy-" name "-3", text ": three steps", "%", NULL, judge, c, z}
#define ENERGY(scene) ENERGY_OF(scene, scene, BENCH_VALUE_AT_LEAST, 60, 70, 75, 80, 90, 95)
#define STATED(name, text) ENERGY_OF(name, text, BENCH_NONE, 0, 0, 0, 0, 0, 0)

static const bench_row table[] = {
    STEP("compensation-step-room", "room: one step, vpl.bound 400"), STEP("compensation-step-cornell", "cornell: the same"), STEP("compensation-step-hall", "hall: the same"),
    {"compensation-samples", "room, every pixel, vpl.bound 400: patches looked at per pixel, six levels", "patches", "one level", BENCH_RATIO_AT_LEAST, 20, 50},
    ENERGY("crease"), ENERGY("bunny-box"), ENERGY("room"),
    STATED("layers-crease", "crease, screen.layers 3"), STATED("layers-room", "room, screen.layers 3"),
    STATED("gallery", "gallery, glossy (to be aimed at: 80 by three)"), STATED("cornell", "cornell, with metal"),
};
enum { ROWS = sizeof table / sizeof table[0], STEPS = 3 };

size_t bench_compensation_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

/* ---- time ---------------------------------------------------------------------------------------------------------------- */

/* Without a step and with one, in turns. */
static bool measure_step(bench_sitting* bench, const char* scene, bench_row* row)
{
    enum { MOST = 32 };
    if (!row) return true;
    double frame[2][MOST], pass[MOST];
    uint64_t samples = 0;
    es_renderer* renderers[2] = {NULL, NULL};
    es_world* world = sitting_open_scene(bench, scene);
    bool works = world != NULL;
    for (int k = 0; k < 2 && works; k++) {
        char text[192];
        snprintf(text, sizeof text, "gi=ism vpl.bound=" BOUND " compensation.steps=%d", k);
        works = (renderers[k] = sitting_open_renderer(bench, text)) != NULL;
    }
    for (int i = -1; i < (int)bench->frames && works; i++)
        for (int k = 0; k < 2 && works; k++) {
            const double time = sitting_render(bench, renderers[k], world);
            works = time > 0;
            if (i < 0 || !works) continue;
            frame[k][i] = time;
            if (k) pass[i] = sitting_pass(renderers[k], "screen-space compensation", &samples);
        }
    if (works) {
        row->value = bench_median(pass, bench->frames);
        snprintf(row->note, sizeof row->note, "%.4g ms a frame, %.4g without; %.3g million patches looked at", bench_median(frame[1], bench->frames), bench_median(frame[0], bench->frames), (double)samples * 1e-6);
        fprintf(stderr, "%s: %.4g ms\n", scene, row->value);
    }
    for (int k = 0; k < 2; k++) es_renderer_destroy(renderers[k]);
    if (world) es_world_destroy(world);
    return works;
}

static bool measure_steps(bench_sitting* bench)
{
    static const char* const scenes[] = {"room", "cornell", "hall"};
    bool works = true;
    for (int i = 0; i < 3 && works; i++)
        works = measure_step(bench, scenes[i], sitting_row(bench, "compensation-step-%s", scenes[i]));
    return works;
}

/* ---- patches --------------------------------------------------------------------------------------------------------------- */

/* Pixels that show a surface; 0 after a message. */
static uint64_t seen_pixels(bench_sitting* bench, es_renderer* renderer)
{
    es_image depth;
    uint64_t seen = 0;
    if (es_renderer_image(renderer, "depth", &depth) != ES_OK) {
        demo_refuse_context(bench->context);
        return 0;
    }
    for (size_t i = 0; i < (size_t)depth.width * depth.height; i++) seen += depth.pixels[i] > 0;
    es_image_destroy(bench->context, &depth);
    return seen;
}

static bool measure_samples(bench_sitting* bench)
{
    bench_row* row = sitting_row(bench, "compensation-samples");
    if (!row) return true;
    es_world* world = sitting_open_scene(bench, "room");
    double patches[2] = {NAN, NAN};
    bool works = world != NULL;
    for (int k = 0; k < 2 && works; k++) {
        char text[192];
        uint64_t samples, pixels = 0;
        snprintf(text, sizeof text, "gi=ism vpl.count=64 vpl.bound=" BOUND " compensation.steps=1 compensation.spacing=1 compensation.levels=%d", k ? 1 : 6);
        es_renderer* renderer = sitting_open_renderer(bench, text);
        works = renderer && sitting_render(bench, renderer, world) > 0 && (pixels = seen_pixels(bench, renderer)) > 0;
        if (works) {
            sitting_pass(renderer, "screen-space compensation", &samples);
            patches[k] = (double)samples / (double)pixels;
            fprintf(stderr, "room: %.4g patches a pixel\n", patches[k]);
        }
        es_renderer_destroy(renderer);
    }
    row->value = patches[0];
    row->peer_value = patches[1];
    row->ratio = patches[1] / patches[0];
    if (world) es_world_destroy(world);
    return works;
}

/* ---- energy ---------------------------------------------------------------------------------------------------------------- */

/* The mean over pixels and channels of an image of one frame with a seed, W/(m² sr); NaN after a message. */
static double mean_of(bench_sitting* bench, es_renderer* renderer, const char* name)
{
    es_image image;
    double total = 0;
    if (es_renderer_image(renderer, name, &image) != ES_OK) {
        demo_refuse_context(bench->context);
        return NAN;
    }
    const size_t values = (size_t)image.width * image.height * image.channels;
    for (size_t i = 0; i < values; i++) total += (double)image.pixels[i];
    es_image_destroy(bench->context, &image);
    return total / (double)values;
}

static bool add_frame(bench_sitting* bench, es_world* world, const char* settings, uint32_t seed, double weight, const char* const* names, size_t count, double* totals)
{
    char text[256];
    snprintf(text, sizeof text, "lamps=none bounces=" BOUNCES " vpl.seed=%u %s", seed * 4096, settings);
    es_renderer* renderer = sitting_open_renderer(bench, text);
    bool works = renderer && sitting_render(bench, renderer, world) > 0;
    for (size_t i = 0; i < count && works; i++) {
        const double mean = mean_of(bench, renderer, names[i]);
        works = !isnan(mean);
        totals[i] += weight * mean;
    }
    es_renderer_destroy(renderer);
    return works;
}

/* What the bound takes: light of the same lights, found visible by rays, with next to no bound less that with it. The mean alone is asked for, so each pixel
 * has a share of the lights. */
static bool measure_taken(bench_sitting* bench, es_world* world, double* taken)
{
    static const char* const indirect[] = {"indirect"};
    const uint32_t seeds = bench->options->quick ? 1 : 8;
    *taken = 0;
    for (uint32_t i = 0; i < 2 * seeds; i++) {
        char text[192];
        snprintf(text, sizeof text, "gi=vpl-traced traced.interleave=true interleave=8 filter.passes=0 vpl.spread=0 vpl.bound=%s", i % 2 ? BOUND : "1000000000");
        if (!add_frame(bench, world, text, i / 2, (i % 2 ? -1.0 : 1.0) / seeds, indirect, 1, taken)) return false;
    }
    return true;
}

static bool measure_found(bench_sitting* bench, es_world* world, double taken, const char* more, bench_row* const rows[STEPS])
{
    static const char* const steps[] = {"compensation-1", "compensation-2", "compensation-3"};
    const uint32_t seeds = bench->options->quick ? 1 : 4;
    double found[STEPS] = {0}, flat = 0, share = 0;
    char text[192];
    bool works = true;
    snprintf(text, sizeof text, "gi=ism vpl.bound=" BOUND " compensation.steps=%d %s", STEPS, more);
    for (uint32_t i = 0; i < seeds && works; i++) works = add_frame(bench, world, text, i, 1.0 / seeds, steps, STEPS, found);
    snprintf(text, sizeof text, "gi=ism vpl.bound=" BOUND " compensation.steps=1 compensation.levels=1 compensation.spacing=4 %s", more);
    works = works && add_frame(bench, world, text, 0, 1, steps, 1, &flat);
    for (int k = 0; k < STEPS && works; k++) {
        share += 100 * found[k] / taken;
        if (!rows[k]) continue;
        rows[k]->value = share;
        if (k == 0) snprintf(rows[k]->note, sizeof rows[k]->note, "%.4g with one level in place of six; taken: %.4g W/(m² sr)", 100 * flat / taken, taken);
    }
    if (works) fprintf(stderr, "  %.4g %%, %.4g by one step with one level\n", share, 100 * flat / taken);
    return works;
}

static bool measure_energy(bench_sitting* bench)
{
    static const char* const scenes[] = {"crease", "bunny-box", "room", "gallery", "cornell"};
    static const struct { const char *prefix, *more; } ways[] = {{"", ""}, {"layers-", "screen.layers=3"}};
    bool works = true;
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0] && works; i++) {
        bench_row* rows[2][STEPS];
        bool any[2] = {false, false};
        for (int w = 0; w < 2; w++)
            for (int k = 0; k < STEPS; k++) any[w] |= (rows[w][k] = sitting_row(bench, "compensation-energy-%s%s-%d", ways[w].prefix, scenes[i], k + 1)) != NULL;
        if (!any[0] && !any[1]) continue;
        double taken;
        fprintf(stderr, "%s: what the bound takes, by rays\n", scenes[i]);
        es_world* world = sitting_open_scene(bench, scenes[i]);
        works = world && measure_taken(bench, world, &taken);
        for (int w = 0; w < 2 && works; w++) works = !any[w] || measure_found(bench, world, taken, ways[w].more, rows[w]);
        if (world) es_world_destroy(world);
    }
    return works;
}

int bench_compensation(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_compensation_rows, 1024, 768);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "compensation", .title = "Bias compensation", .about = "What vpl.bound takes from the light of virtual point lights, found again in screen space: time, patches that a pixel looks at, and energy beside what rays find "
        "of three bounces. 1024 × 768, two threads."};
    return sitting_close(bench, measure_steps(bench) && measure_samples(bench) && measure_energy(bench));
}
