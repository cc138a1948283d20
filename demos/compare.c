/* `earthshine compare A B`: the error of A against the reference B, limits for tests, and a picture of where it lies. */
#include "metrics.h"

#include <math.h>
#include <string.h>

enum { RMSE, RELRMSE, RELMSE, MAX, METRICS };
static const char* const metric_names[METRICS] = {"rmse", "relrmse", "relmse", "max"};

/* Black, blue, red, yellow, white at 0, 1/4, 1/2, 3/4, 1: lightness rises all the way, so it reads in grey too. */
static void heat_colour(float t, float rgb[3])
{
    static const float stops[5][3] = {{0, 0, 0}, {0.15f, 0.1f, 0.55f}, {0.8f, 0.15f, 0.25f}, {0.98f, 0.75f, 0.15f}, {1, 1, 1}};
    float x = fminf(fmaxf(t, 0), 1) * 4;
    int k = x < 3 ? (int)x : 3;
    for (int c = 0; c < 3; c++) rgb[c] = stops[k][c] + (x - (float)k) * (stops[k + 1][c] - stops[k][c]);
}

/* |A - B| per pixel (the largest over the channels), on a scale from none to four times the RMSE: single outliers would
 * leave a picture scaled to the maximum black. */
static int write_difference(
    es_context* context, const es_image* a, const es_image* b, const demo_channels* channels, double rmse, const char* path)
{
    es_image difference = {0};
    if (es_image_create(context, a->width, a->height, 3, &difference) != ES_OK) return demo_refuse_context(context);
    double scale = rmse > 0 && isfinite(rmse) ? 4 * rmse : 1;
    for (size_t i = 0; i < (size_t)a->width * a->height; i++) {
        float largest = 0;
        for (uint32_t k = 0; k < channels->count; k++) {
            float x = a->pixels[i * a->channels + channels->a[k]], y = b->pixels[i * b->channels + channels->b[k]];
            float d = x == y || (isnan(x) && isnan(y)) ? 0 : isfinite(x - y) ? fabsf(x - y) : INFINITY;
            largest = fmaxf(largest, d);
        }
        heat_colour((float)(largest / scale), difference.pixels + 3 * i);
    }
    es_image_save_desc desc = {.already_srgb = true};
    int code = es_image_save(context, &difference, path, &desc) == ES_OK ? DEMO_OK : demo_refuse_context(context);
    es_image_destroy(context, &difference);
    if (code == DEMO_OK) fprintf(stderr, "%s: black is no difference, white %.6g and more\n", path, scale);
    return code;
}

typedef struct comparison {
    const char *a, *b, *diff;
    double limits[METRICS];
} comparison;

static int parse(int count, char** arguments, comparison* what)
{
    *what = (comparison){.limits = {INFINITY, INFINITY, INFINITY, INFINITY}};
    for (int i = 0; i < count; i++) {
        const char* argument = arguments[i];
        if (strncmp(argument, "--", 2) != 0) {
            if (what->b) return demo_refuse("compare: two images are expected, %s is a third", argument);
            *(what->a ? &what->b : &what->a) = argument;
            continue;
        }
        int metric = METRICS;
        if (!strncmp(argument, "--max-", 6))
            for (metric = 0; metric < METRICS && strcmp(argument + 6, metric_names[metric]) != 0;) metric++;
        if (metric == METRICS && strcmp(argument, "--diff") != 0)
            return demo_refuse(
                "compare: unknown option %s; --diff, --max-rmse, --max-relrmse, --max-relmse and --max-max are known", argument);
        if (++i == count) return demo_refuse("%s: a value must follow", argument);
        if (metric == METRICS)
            what->diff = arguments[i];
        else if (!demo_parse_double(arguments[i], 0, 1e30, &what->limits[metric]))
            return demo_refuse("%s %s: a number from 0 is expected", argument, arguments[i]);
    }
    if (!what->b) return demo_refuse("compare: two images are expected: the one in question, then the reference");
    if (what->diff && !demo_has_image_ending(what->diff))
        return demo_refuse("--diff %s: the name must end in .exr, .png or .hdr", what->diff);
    if (what->diff && demo_check_writable(what->diff) != DEMO_OK) return DEMO_BAD_INPUT;
    return DEMO_OK;
}

static int compare(es_context* context, const comparison* what, const es_image* a, const es_image* b)
{
    demo_channels channels;
    if (a->width != b->width || a->height != b->height)
        return demo_refuse("compare: %s is %ux%u, %s is %ux%u; equal sizes are expected", what->a, a->width, a->height, what->b,
            b->width, b->height);
    if (!demo_match_channels(a, b, &channels))
        return demo_refuse(
            "compare: %s has %u channels, %s has %u, and no name is shared", what->a, a->channels, what->b, b->channels);
    demo_metrics m = demo_measure(a, b, &channels, NULL);
    double values[METRICS] = {m.rmse, m.relrmse, m.relmse, m.max};
    int code = DEMO_OK;
    for (int i = 0; i < METRICS; i++) printf("%s %.9g\n", metric_names[i], values[i]);
    for (int i = 0; i < METRICS; i++)
        if (!(values[i] <= what->limits[i])) {
            fprintf(stderr, "earthshine: %s is %.6g, above the limit of %.6g\n", metric_names[i], values[i], what->limits[i]);
            code = DEMO_EXCEEDED;
        }
    if (what->diff && write_difference(context, a, b, &channels, m.rmse, what->diff) != DEMO_OK) return DEMO_BAD_INPUT;
    return code;
}

int demo_compare(int count, char** arguments)
{
    comparison what;
    if (parse(count, arguments, &what) != DEMO_OK) return DEMO_BAD_INPUT;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = 1;
    es_context* context = NULL;
    es_result result = es_context_create(&desc, &context);
    if (result != ES_OK) return demo_refuse("%s", es_result_text(result));
    es_image a = {0}, b = {0};
    int code;
    if (es_image_load(context, what.a, &a) != ES_OK || es_image_load(context, what.b, &b) != ES_OK)
        code = demo_refuse_context(context);
    else
        code = compare(context, &what, &a, &b);
    es_image_destroy(context, &a);
    es_image_destroy(context, &b);
    es_context_destroy(context);
    return code;
}
