/* `bench compensation`: what bounds take from virtual point lights, found again among the pixels (Novák et al. 2011): how long a step takes, how many patches a pixel looks
 * at (fig. 4a), and how much of the energy comes back. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench_sitting.h"

/* Pairs within a twentieth of the scene's extent. */
#define BOUND "400"
#define STEP(id, work) {id, work, "ms", NULL, BENCH_VALUE_AT_MOST, 54, 27}
#define ENERGY_OF(name, text, judge, a, b, c, x, y, z) \
    {"compensation-energy-" name "-1", text ", vpl.bound " BOUND ": of the energy that the bound takes, what one step brings back", "%", NULL, judge, a, x}, \
    {"compensation-energy-" name "-2", text ": two steps", "%", NULL, judge, b, y}, \
    {"compensation-energy-" name "-3", text ": three steps", "%", NULL, judge, c, z}
#define ENERGY(scene) ENERGY_OF(scene, scene, BENCH_VALUE_AT_LEAST, 60, 70, 75, 80, 90, 95)
#define STATED(name, text) ENERGY_OF(name, text, BENCH_NONE, 0, 0, 0, 0, 0, 0)

static const bench_row table[] = {
    STEP("compensation-step-room", "room: one step, vpl.bound 400"), STEP("compensation-step-cornell", "cornell: the same"), STEP("compensation-step-hall", "hall: the same"),
    STEP("compensation-step-default-room", "room: one step, the default bound"), STEP("compensation-step-default-cornell", "cornell: the same"), STEP("compensation-step-default-hall", "hall: the same"),
    {"compensation-samples", "room, every pixel, vpl.bound 400: patches looked at per pixel, six levels", "patches", "one level", BENCH_RATIO_AT_LEAST, 20, 50},
    ENERGY("crease"), ENERGY("bunny-box"), ENERGY("room"),
    STATED("layers-crease", "crease, screen.layers 3"), STATED("layers-room", "room, screen.layers 3"),
    STATED("gallery", "gallery, glossy (to be aimed at: 80 by three)"), STATED("cornell", "cornell, with metal"),
};
enum { ROWS = sizeof table / sizeof table[0], STEPS = 3 };

size_t bench_compensation_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

/* ---- time ---------------------------------------------------------------------------------------------------------------- */

/* Without a step and with one, in turns. */
static bool measure_step(bench_sitting* bench, const char* scene, const char* bound, bench_row* row)
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
        snprintf(text, sizeof text, "gi=ism compensation.steps=%d%s", k, bound);
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
        fprintf(stderr, "%s%s: %.4g ms\n", scene, bound, row->value);
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
        works = measure_step(bench, scenes[i], " vpl.bound=" BOUND, sitting_row(bench, "compensation-step-%s", scenes[i])) && measure_step(bench, scenes[i], "", sitting_row(bench, "compensation-step-default-%s", scenes[i]));
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


/* The mean of an image of the renderer's last frame, which is added to `sum` (may be NULL); both times the weight. NaN after a message. */
static double add_image(bench_sitting* bench, es_renderer* renderer, const char* name, double weight, double* sum)
{
    es_image image;
    double total = 0;
    if (es_renderer_image(renderer, name, &image) != ES_OK) {
        demo_refuse_context(bench->context);
        return NAN;
    }
    const size_t values = (size_t)image.width * image.height * image.channels;
    for (size_t i = 0; i < values; i++) {
        if (sum) sum[i] += weight * (double)image.pixels[i];
        total += (double)image.pixels[i];
    }
    es_image_destroy(bench->context, &image);
    return weight * total / (double)values;
}

/* One frame with a seed: the images' means are added to `totals`, the images to `sum`. */
static bool add_frame(bench_sitting* bench, es_world* world, const char* settings, uint32_t seed, double weight, const char* const* names, size_t count, double* sum, double* totals)
{
    char text[256];
    snprintf(text, sizeof text, "gi=ism lamps=none vpl.seed=%u %s", seed * 4096, settings);
    es_renderer* renderer = sitting_open_renderer(bench, text);
    bool works = renderer && sitting_render(bench, renderer, world) > 0;
    for (size_t i = 0; i < count && works; i++) {
        const double mean = add_image(bench, renderer, names[i], weight, sum);
        works = !isnan(mean);
        totals[i] += mean;
    }
    es_renderer_destroy(renderer);
    return works;
}

/* What the bound takes, one bounce: what rays find (Kollig and Keller 2004) with the bound less what the same rays find with next to none. The latter is not the bound's doing:
 * interpolated normals are not the triangles', and lobes are widened. */
typedef struct taken_light {
    es_world* world;
    double* halves[2];             /* two pictures, independent of each other */
    double mean;                   /* W/(m² sr), over pixels and channels */
} taken_light;

static bool open_taken(bench_sitting* bench, const char* scene, taken_light* taken)
{
    static const char* const by_rays[] = {"compensation"};
    *taken = (taken_light){.world = sitting_open_scene(bench, scene)};
    bool works = taken->world != NULL;
    for (uint32_t i = 0; i < 4 && works; i++) {
        const uint32_t half = i / 2;
        double total = 0;
        char text[192];
        if (!taken->halves[half]) taken->halves[half] = calloc((size_t)bench->width * bench->height * 3, sizeof(double));
        snprintf(text, sizeof text, "vpl.count=64 ism.points=64 vpl.spread=0 traced.bias=compensated traced.samples=%u vpl.bound=%s", bench->truth_samples, i % 2 ? "1000000000" : BOUND);
        works = taken->halves[half] && add_frame(bench, taken->world, text, half, i % 2 ? -1 : 1, by_rays, 1, taken->halves[half], &total);
        taken->mean += 0.5 * total;
    }
    return works;
}

static void close_taken(taken_light* taken)
{
    for (int k = 0; k < 2; k++) free(taken->halves[k]);
    if (taken->world) es_world_destroy(taken->world);
}

static bool measure_found(bench_sitting* bench, const taken_light* taken, const char* more, bench_row* const rows[STEPS])
{
    static const char* const steps[] = {"compensation-1", "compensation-2", "compensation-3"};
    const uint32_t seeds = bench->options->quick ? 1 : 4;
    const size_t values = (size_t)bench->width * bench->height * 3;
    double *sum = calloc(values, sizeof *sum), found[STEPS] = {0}, flat = 0, left = 0, all = 0, share = 0;
    char text[192];
    bool works = sum != NULL;
    snprintf(text, sizeof text, "vpl.bound=" BOUND " compensation.steps=%d %s", STEPS, more);
    for (uint32_t i = 0; i < seeds && works; i++) works = add_frame(bench, taken->world, text, i, 1.0 / seeds, steps, STEPS, sum, found);
    snprintf(text, sizeof text, "vpl.bound=" BOUND " compensation.steps=1 compensation.levels=1 compensation.spacing=4 %s", more);
    works = works && add_frame(bench, taken->world, text, 0, 1, steps, 1, NULL, &flat);
    for (size_t i = 0; i < values && works; i++) {
        left += (sum[i] - taken->halves[0][i]) * (sum[i] - taken->halves[1][i]);
        all += taken->halves[0][i] * taken->halves[1][i];
    }
    for (int k = 0; k < STEPS && works; k++) {
        share += 100 * found[k] / taken->mean;
        if (!rows[k]) continue;
        rows[k]->value = share;
        if (k == 0) snprintf(rows[k]->note, sizeof rows[k]->note, "%.4g with one level in place of six; taken: %.4g W/(m² sr)", 100 * flat / taken->mean, taken->mean);
        if (k == STEPS - 1) snprintf(rows[k]->note, sizeof rows[k]->note, "the difference, pixel by pixel, has %.3g of the RMS of what is taken", sqrt(left / all));
    }
    if (works) fprintf(stderr, "  %.4g %%, %.4g with one level, %.3g of the RMS left\n", share, 100 * flat / taken->mean, sqrt(left / all));
    free(sum);
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
        taken_light taken;
        fprintf(stderr, "%s: what the bound takes, by rays\n", scenes[i]);
        works = open_taken(bench, scenes[i], &taken);
        for (int w = 0; w < 2 && works; w++) works = !any[w] || measure_found(bench, &taken, ways[w].more, rows[w]);
        close_taken(&taken);
    }
    return works;
}

int bench_compensation(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_compensation_rows, 1024, 768);
    if (!bench) return DEMO_BAD_INPUT;
    bench->truth_samples = options->samples ? options->samples : options->quick ? 4 : 16;
    bench->report = (bench_report){.name = "compensation", .title = "Bias compensation", .about = "What vpl.bound takes from the light of virtual point lights, found again in screen space: time, patches that a pixel looks at, and energy beside what rays find "
        "of one bounce. Steps gather bounded indirect light too, which is a part of the second bounce, so that shares may pass 100 %. 1024 × 768, two threads."};
    return sitting_close(bench, measure_steps(bench) && measure_samples(bench) && measure_energy(bench));
}
