/* `bench micro`: final gathering by micro-buffers as Ritschel's thesis measures it (§6.5): 512 × 512 pixels, 24 × 24 micro-buffers, a million points, one
 * bounce; its speed beside Embree's rays, its error beside the path tracer's pictures and the lights of imperfect shadow maps. */
#include "bench_micro.h"

#include <math.h>

#define HZ(id, work, must, aim) {id, work, "Hz", NULL, BENCH_VALUE_AT_LEAST, must, aim}
#define RATE(scene, remark) \
    {"micro-every-pixel-" scene, "every pixel in " scene remark, "Hz", NULL, BENCH_NONE, 0, 0}, {"micro-sixteenth-" scene, "one pixel of 16 in " scene remark, "Hz", NULL, BENCH_NONE, 0, 0}
#define POINTS(n) {"micro-points-" #n, "cornell in motion, every pixel, 2^" #n " points", "ms", NULL, BENCH_NONE, 0, 0}
#define ERRORS(scene) \
    {"micro-error-" scene, "indirect light of " scene ", every pixel", "relRMSE", NULL, BENCH_VALUE_AT_MOST, 0.05, 0.02}, \
    {"micro-error-sixteenth-" scene, "the same at one pixel of 16, interpolated", "relRMSE", NULL, BENCH_VALUE_AT_MOST, 0.08, 0.04}
#define MAPS "1024 lights, imperfect maps"
#define EQUAL(scene) {"micro-equal-time-" scene, "indirect light of " scene " in the time of 1024 lights (to be aimed at: above 1)", "relRMSE", MAPS, BENCH_NONE, 0, 0}
#define EQUAL_MUST(scene, text) {"micro-equal-time-" scene, text " in the time of 1024 lights", "relRMSE", MAPS, BENCH_RATIO_AT_LEAST, 1, 1}
#define RING(surface, text, judge, must, aim) {"micro-ring-" surface, "indirect light of the ring's scene, every pixel, its ring of " text, "relRMSE", MAPS, judge, must, aim}
#define CAST(scene) {"micro-ray-cast-off-" scene, "large points drawn into one pixel, not met by rays, in " scene, "relRMSE", "met by rays", BENCH_NONE, 0, 0}
#define SIZE(n) {"micro-size-" #n, "hall, every pixel, micro-buffers of " #n " × " #n, "relRMSE", NULL, BENCH_NONE, 0, 0}
#define SPACING(n, text) {"micro-spacing-" #n, "hall, gathered at " text, "relRMSE", NULL, BENCH_NONE, 0, 0}

static const bench_row table[] = {
    HZ("micro-every-pixel", "cornell in motion, light gathered at every pixel, hierarchy included", 0.5, 2),
    HZ("micro-sixteenth", "the same at one pixel of 16, interpolated", 6, 25),
    RATE("room", ", where nothing moves and all is done again"), RATE("hall", ""), RATE("gallery", ""),
    {"micro-refit", "the hierarchy of a mesh of 2^19 triangles that deforms", "ms", NULL, BENCH_VALUE_AT_MOST, 20, 8},
    {"micro-growth", "cornell in motion, every pixel: a frame of the most points over one of the fewest", "x", NULL, BENCH_VALUE_AT_MOST, 2.5, 1.8},
    POINTS(14), POINTS(15), POINTS(16), POINTS(17), POINTS(18), POINTS(19), POINTS(20),
    {"micro-samples", "gather samples a second, room of 70k triangles, every pixel", "M/s", "Embree, 2 threads: hemisphere rays, closest hit", BENCH_RATIO_AT_LEAST, 8, 30},
    ERRORS("cornell"), ERRORS("room"), ERRORS("hall"),
    EQUAL("cornell"), EQUAL("room"), EQUAL("hall"),
    EQUAL_MUST("gallery", "glossy: indirect light of gallery"), EQUAL_MUST("ring", "glossy: indirect light of the ring's scene, exponent 20"),
    EQUAL_MUST("contact-cornell", "contact shadows: indirect light of cornell where something is near"), EQUAL_MUST("contact-room", "contact shadows: the same of room"),
    EQUAL_MUST("contact-hall", "contact shadows: the same of hall"),
    RING("phong-5", "a lobe of exponent 5", BENCH_NONE, 0, 0), RING("phong-20", "exponent 20", BENCH_NONE, 0, 0), RING("phong-50", "exponent 50", BENCH_NONE, 0, 0),
    /* to be stated is all they must */
    RING("ggx-0.5", "metal of roughness 0.5", BENCH_VALUE_AT_MOST, 1, 0.05), RING("ggx-0.2", "roughness 0.2", BENCH_VALUE_AT_MOST, 1, 0.05), RING("ggx-0.1", "roughness 0.1", BENCH_NONE, 0, 0),
    CAST("cornell"), CAST("room"), CAST("hall"),
    SIZE(8), SIZE(16), SIZE(24), SIZE(32),
    SPACING(1, "every pixel"), SPACING(2, "one pixel of 4"), SPACING(4, "one pixel of 16"),
    {"micro-nodes", "hall, every pixel, nodes of 128 bits", "relRMSE", "nodes of floats", BENCH_NONE, 0, 0},
    {"micro-nodes-time", "the same", "ms", "nodes of floats", BENCH_NONE, 0, 0},
};
enum { ROWS = sizeof table / sizeof table[0] };

size_t bench_micro_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

uint32_t micro_exponent(const bench_sitting* bench) { return bench->options->quick ? 13 : 20; }

/* ---- time ---------------------------------------------------------------------------------------------------------------- */

bool micro_time(bench_sitting* bench, es_world* world, const char* text, float dt, bool still, micro_times* times)
{
    enum { MOST = 32 };
    double frame[MOST], update[MOST], light[MOST], gather[MOST];
    uint32_t frames = bench->frames < MOST ? bench->frames : MOST;
    es_renderer_settings settings = es_default_renderer_settings();
    const error_setting both[] = {{.settings = "gi=micro"}, {.settings = text}};
    es_renderer* renderer = NULL;
    settings.width = bench->width;
    settings.height = bench->height;
    settings.skip = !still;
    *times = (micro_times){NAN, NAN, NAN, NAN, 0, 0};
    if (!error_apply(bench->context, &both[0], &settings) || !error_apply(bench->context, &both[1], &settings)) return false;
    bool works = es_renderer_create(bench->context, &settings, &renderer) == ES_OK;
    const double begun = demo_seconds();
    for (int i = -1; i < (int)frames && works; i++) {
        if (i > 0 && demo_seconds() - begun > bench->seconds) frames = (uint32_t)i; /* enough */
        if (i == (int)frames) break;
        works = es_world_step(world, dt) == ES_OK;
        const double start = demo_seconds();
        works = works && es_renderer_render(renderer, world) == ES_OK;
        if (i < 0 || !works) continue;
        frame[i] = (demo_seconds() - start) * 1000;
        update[i] = sitting_pass(renderer, "point hierarchy", &times->points);
        light[i] = sitting_pass(renderer, "point light", NULL);
        gather[i] = sitting_pass(renderer, "micro-buffers", &times->samples);
    }
    if (works) *times = (micro_times){bench_median(frame, frames), bench_median(update, frames), bench_median(light, frames), bench_median(gather, frames), times->samples, times->points};
    else demo_refuse_context(bench->context);
    es_renderer_destroy(renderer);
    return works;
}

/* ---- all of it ----------------------------------------------------------------------------------------------------------- */

int bench_micro(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_micro_rows, 512, 512);
    if (!bench) return DEMO_BAD_INPUT;
    bench->frames = options->quick ? 2 : 5;
    bench->report = (bench_report){.name = "micro", .title = "Micro-buffers",
        .about = "Light gathered at every pixel, or one of 16, from a hierarchy of a million points; 512 × 512 pixels, 24 × 24 micro-buffers, one bounce, unless a row says otherwise."};
    return sitting_close(bench, micro_measure_speed(bench) && micro_measure_errors(bench));
}
