/* `bench reflections`: what mirrors, glossy things and glass show, by maps and by rays: how far from the reference on the pixels that reflect, and the time of whole frames with a moving eye
 * (Ritschel's thesis, §7.6.1, on a GeForce GTX 260: 29.1 and 16.8 frames a second). Errors are those of the law of reflection: edits are taken out. In them is what no method here has:
 * light that mirrors and glass throw on other things. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bench_sitting.h"

#define TIME(scene, must, aim) {"reflections-frame-" scene, scene ", 1280×960: a whole frame with edits, the eye and the scene moving, work skipped", "ms", NULL, BENCH_VALUE_AT_MOST, must, aim}
#define ERRORS(scene)                                                                                                                                   \
    {"reflections-error-" scene "-maps", scene ": reflecting pixels against the reference, by maps, relRMSE of all but the worst 2 %", "%", NULL, BENCH_NONE, 0, 0}, \
        {"reflections-error-" scene "-traced", scene ": the same by rays", "%", NULL, BENCH_NONE, 0, 0}

static const bench_row table[] = {
    TIME("rokeby", 100, 34), TIME("kitchen", 150, 60),
    {"reflections-frame-ring-face", "ring-face, likewise", "ms", NULL, BENCH_NONE, 0, 0}, {"reflections-frame-lens", "lens, likewise", "ms", NULL, BENCH_NONE, 0, 0},
    ERRORS("rokeby"), ERRORS("kitchen"), ERRORS("ring-face"), ERRORS("lens"),
};

size_t bench_reflections_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

static const char* const scenes[] = {"rokeby", "kitchen", "ring-face", "lens"};

/* The scene's own settings, and more, for sitting_open_renderer. */
static void join_settings(const char* scene, const char* more, char* text, size_t size)
{
    size_t at = 0;
    for (const char* const* s = es_scene_settings(scene); *s && at < size; s++) at += (size_t)snprintf(text + at, size - at, "%s ", *s);
    if (at < size) snprintf(text + at, size - at, "%s", more);
}

static bool measure_time(bench_sitting* bench, const char* scene)
{
    enum { MOST = 32 };
    bench_row* row = sitting_row(bench, "reflections-frame-%s", scene);
    if (!row) return true;
    es_world* world = sitting_open_scene(bench, scene);
    char text[1024];
    join_settings(scene, bench->options->quick ? "skip=true" : "skip=true width=1280 height=960", text, sizeof text);
    es_renderer* renderer = world ? sitting_open_renderer(bench, text) : NULL;
    bool works = renderer != NULL;
    double frame[MOST], maps[MOST], looks[MOST];
    uint32_t count = 0;
    for (int i = -3; i < (int)bench->frames && works && count < MOST; i++) {
        works = es_world_step(world, 1.0f / 30) == ES_OK;
        const double time = works ? sitting_render(bench, renderer, world) : NAN;
        works = time > 0;
        if (i < 0 || !works) continue;
        frame[count] = time;
        maps[count] = sitting_pass(renderer, "reflection maps", NULL);
        looks[count++] = sitting_pass(renderer, "reflections", NULL);
    }
    if (works) {
        row->value = bench_median(frame, count);
        snprintf(row->note, sizeof row->note, "%.3g ms of it to draw maps, %.3g ms to look into them", bench_median(maps, count), bench_median(looks, count));
    }
    es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    return works;
}

/* As the law has it: the reference knows of no edits. */
static bool take_edits_out(es_world* world)
{
    size_t count = 0;
    if (es_world_enumerate(world, ES_OBJECT_CONSTRAINT, NULL, &count) != ES_OK) return false;
    uint32_t* ids = calloc(count + 1, sizeof *ids);
    bool works = ids && es_world_enumerate(world, ES_OBJECT_CONSTRAINT, ids, &count) == ES_OK;
    for (size_t i = 0; i < count && works; i++) works = es_world_destroy_constraint(world, (es_constraint){ids[i]}) == ES_OK;
    free(ids);
    return works && es_world_step(world, 0) == ES_OK;
}

static bool find_truth(bench_sitting* bench, es_world* world, es_image* truth)
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = bench->width;
    settings.height = bench->height;
    settings.bounces = 2; /* what is reflected is itself lit by one */
    settings.antialias = false;
    settings.quantised = true;
    settings.max_samples = bench->truth_samples ? bench->truth_samples : bench->options->quick ? 4 : 256;
    es_reference* reference = NULL;
    bool works = es_reference_create(bench->context, &settings, &reference) == ES_OK && es_reference_begin(reference, world) == ES_OK;
    while (works && !es_reference_get_stats(reference).done) works = es_reference_add(reference, 4) == ES_OK;
    works = works && es_reference_image(reference, "radiance", truth) == ES_OK;
    es_reference_destroy(reference);
    return works;
}

static int by_size(const void* a, const void* b)
{
    const double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

/* relRMSE in % of all but the worst 2 % of `squares`: single samples of the reference that came upon a light through a mirror are hundreds of times as bright as all others. */
static double trimmed(double* squares, size_t count, double sum)
{
    qsort(squares, count, sizeof *squares, by_size);
    const size_t kept = count - count / 50;
    double total = 0;
    for (size_t i = 0; i < kept; i++) total += squares[i];
    return kept ? 100 * sqrt(total / (double)kept) / (sum / (double)kept) : 0;
}

static bool compare(bench_row* row, const es_renderer* renderer, const es_image* radiance, const es_image* reflections, const es_image* none, const es_image* truth)
{
    const size_t all = (size_t)radiance->width * radiance->height * 3;
    double *with = malloc((all + 1) * sizeof *with), *without = malloc((all + 1) * sizeof *without), *light = malloc((all + 1) * sizeof *light), sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < all && with && without && light; i++) {
        if (!(reflections->pixels[i] > 0)) continue;
        with[count] = pow((double)(radiance->pixels[i] - truth->pixels[i]), 2);
        without[count] = pow((double)(none->pixels[i] - truth->pixels[i]), 2);
        light[count++] = (double)truth->pixels[i];
    }
    const bool works = with && without && light;
    if (works) {
        qsort(light, count, sizeof *light, by_size);
        for (size_t i = 0; i < count - count / 50; i++) sum += light[i];
        row->value = trimmed(with, count, sum);
        snprintf(row->note, sizeof row->note, "%.3g %% of the pixels; %.3g %% with reflections=none; the pass took %.3g ms, maps %.3g", 100 * (double)count / (double)all, trimmed(without, count, sum),
            sitting_pass(renderer, "reflections", NULL), sitting_pass(renderer, "reflection maps", NULL));
    }
    free(with);
    free(without);
    free(light);
    return works;
}

static bool measure_errors(bench_sitting* bench, const char* scene)
{
    static const char* const methods[] = {"maps", "traced"};
    if (!sitting_row(bench, "reflections-error-%s-maps", scene) && !sitting_row(bench, "reflections-error-%s-traced", scene)) return true;
    es_world* world = sitting_open_scene(bench, scene);
    es_image truth = {0}, none = {0};
    bool works = world && take_edits_out(world) && find_truth(bench, world, &truth);
    for (int k = -1; k < 2 && works; k++) {
        char text[1024], more[128];
        snprintf(more, sizeof more, "antialias=none temporal=false glare=off reflections=%s", k < 0 ? "none" : methods[k]);
        join_settings(scene, more, text, sizeof text);
        es_renderer* renderer = sitting_open_renderer(bench, text);
        es_image radiance = {0}, reflections = {0};
        works = renderer && sitting_render(bench, renderer, world) > 0 && es_renderer_image(renderer, "radiance", &radiance) == ES_OK && es_renderer_image(renderer, "reflections", &reflections) == ES_OK;
        bench_row* row = k < 0 ? NULL : sitting_row(bench, "reflections-error-%s-%s", scene, methods[k]);
        if (works && row) works = compare(row, renderer, &radiance, &reflections, &none, &truth);
        es_renderer_destroy(renderer);
        es_image_destroy(bench->context, &reflections);
        if (k < 0) none = radiance;
        else es_image_destroy(bench->context, &radiance);
    }
    es_image_destroy(bench->context, &truth);
    es_image_destroy(bench->context, &none);
    if (world) es_world_destroy(world);
    return works;
}

int bench_reflections(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_reflections_rows, 240, 180);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "reflections", .title = "Reflections", .about = "Mirrors, pots, a ring and lenses: whole frames with reflection maps and edits, and how far what they show is from the reference, by maps and by rays, without edits."};
    bool works = true;
    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0] && works; i++) works = measure_time(bench, scenes[i]) && measure_errors(bench, scenes[i]);
    return sitting_close(bench, works);
}
