/* `bench second-order`: illumination by lights that nothing shadows and negative ones (Cochran and Steele 2007): the frame that their table 1 times, and the error of finding
 * most pixels' light at half the resolution, as in their table 2. */
#include <math.h>
#include <string.h>

#include "bench_sitting.h"

#define SHARE 87.5 /* % */

static const bench_row table[] = {
    {"second-order-bunny-box", "bunny-box, 640×480: a frame with 300 lights and 150 negative ones, nothing skipped (table 1)", "ms", NULL, BENCH_VALUE_AT_MOST, 45, 25},
    {"second-order-low-share", "bunny-box, 640×480: the displayed picture with 87.5 % of its pixels at half the resolution, RMS of its difference from all at their own (table 2)", "%", NULL, BENCH_VALUE_AT_MOST, 0.3, 0.17},
};

size_t bench_second_order_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

static const char lights[] = "gi=second-order second.lights=300 second.negative=150";

static bool measure_time(bench_sitting* bench, es_world* world)
{
    enum { MOST = 32 };
    bench_row* row = sitting_row(bench, "second-order-bunny-box");
    if (!row) return true;
    double frame[MOST], pass[MOST];
    uint64_t whole = 0;
    es_renderer* renderer = sitting_open_renderer(bench, lights);
    bool works = renderer != NULL;
    for (int i = -1; i < (int)bench->frames && works; i++) {
        const double time = sitting_render(bench, renderer, world);
        works = time > 0;
        if (i < 0 || !works) continue;
        frame[i] = time;
        pass[i] = sitting_pass(renderer, "second-order light", &whole);
    }
    if (works) {
        row->value = bench_median(frame, bench->frames);
        snprintf(row->note, sizeof row->note, "%.4g ms of it for the lights' light; %.3g %% of the pixels at half the resolution", bench_median(pass, bench->frames), 100 - 100 * (double)whole / ((double)bench->width * bench->height));
    }
    es_renderer_destroy(renderer);
    return works;
}

/* ---- half the resolution ------------------------------------------------------------------------------------------------- */

/* A picture with a threshold: the share of pixels at half the resolution in %, negative after a message; the images where they are asked for. */
static double render_share(bench_sitting* bench, es_world* world, double threshold, es_image* display, es_image* indirect)
{
    char text[128];
    snprintf(text, sizeof text, "%s second.threshold=%.9g", lights, threshold);
    es_renderer* renderer = sitting_open_renderer(bench, text);
    uint64_t whole = 0;
    double share = -1;
    if (renderer && sitting_render(bench, renderer, world) > 0) {
        sitting_pass(renderer, "second-order light", &whole);
        share = 100 - 100 * (double)whole / ((double)bench->width * bench->height);
        if (display && (es_renderer_image(renderer, "display", display) != ES_OK || es_renderer_image(renderer, "indirect", indirect) != ES_OK)) {
            demo_refuse_context(bench->context);
            share = -1;
        }
    }
    es_renderer_destroy(renderer);
    return share;
}

static double encoded(double linear) { return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055; }

/* Of what the display is sent, 0 … 1; or of light, over the mean of b. */
static double rms(const es_image* a, const es_image* b, bool display)
{
    double squares = 0, light = 0;
    const size_t values = (size_t)a->width * a->height * a->channels;
    for (size_t i = 0; i < values; i++) {
        const double p = (double)a->pixels[i], q = (double)b->pixels[i], d = display ? encoded(p) - encoded(q) : p - q;
        squares += d * d;
        light += q;
    }
    return sqrt(squares / (double)values) / (display ? 1 : light / (double)values);
}

static bool measure_share(bench_sitting* bench, es_world* world)
{
    bench_row* row = sitting_row(bench, "second-order-low-share");
    if (!row) return true;
    double low = 1e-7, high = 10;
    bool works = true;
    /* the share rises with the threshold */
    for (int i = 0; i < 24 && works; i++) {
        const double middle = sqrt(low * high), share = render_share(bench, world, middle, NULL, NULL);
        works = share >= 0;
        if (share < SHARE) low = middle;
        else high = middle;
    }
    es_image displays[3] = {{0}}, indirects[3] = {{0}};
    const double thresholds[3] = {0, high, es_default_renderer_settings().second_threshold};
    double shares[3] = {0};
    for (int k = 0; k < 3 && works; k++) works = (shares[k] = render_share(bench, world, thresholds[k], &displays[k], &indirects[k])) >= 0;
    if (works) {
        row->value = 100 * rms(&displays[1], &displays[0], true);
        snprintf(row->note, sizeof row->note, "%.4g %% of the pixels, second.threshold %.3g: of linear indirect light %.3g %% relRMSE; with the default threshold %.4g %% of the pixels, RMS %.3g %%, relRMSE %.3g %%", shares[1], high, 100 * rms(&indirects[1], &indirects[0], false),
            shares[2], 100 * rms(&displays[2], &displays[0], true), 100 * rms(&indirects[2], &indirects[0], false));
    }
    for (int k = 0; k < 3; k++) {
        es_image_destroy(bench->context, &displays[k]);
        es_image_destroy(bench->context, &indirects[k]);
    }
    return works;
}

int bench_second_order(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_second_order_rows, 640, 480);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "second-order", .title = "Second-order light", .about = "Lights that nothing shadows and negative ones, in the scene after Cochran and Steele's: a frame's time, and the error of finding light at half the resolution where surfaces are smooth."};
    es_world* world = sitting_open_scene(bench, "bunny-box");
    const bool works = world && measure_time(bench, world) && measure_share(bench, world);
    if (world) es_world_destroy(world);
    return sitting_close(bench, works);
}
