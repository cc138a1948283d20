/* Truths: the peers' pictures of their room, or our own path tracer's, kept beside the report and gone on from; and our path tracer
 * itself, timed against the peers'. */
#include "bench_error.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* share 0: the default */
static es_reference* begin(es_context* context, es_world* world, uint32_t width, uint32_t height, uint32_t seed, uint32_t share)
{
    es_reference_settings settings = es_default_reference_settings();
    settings.width = width;
    settings.height = height;
    settings.seed = seed;
    settings.bounces = 1;
    settings.antialias = false;
    if (share) settings.share = share;
    settings.emission = false; /* the real-time methods have no light from glowing surfaces either */
    es_reference* reference = NULL;
    if (es_reference_create(context, &settings, &reference) == ES_OK && es_reference_begin(reference, world) == ES_OK) return reference;
    demo_refuse_context(context);
    es_reference_destroy(reference);
    return NULL;
}

static bool take_images(es_context* context, es_reference* reference, int half, error_truth* truth)
{
    es_image whole = {0};
    bool works = es_reference_image(reference, "indirect", &truth->halves[half]) == ES_OK && es_reference_image(reference, "radiance", &whole) == ES_OK;
    if (!works) demo_refuse_context(context);
    for (size_t i = 0; works && half && i < (size_t)whole.width * whole.height * 3; i++) whole.pixels[i] = (whole.pixels[i] + truth->whole.pixels[i]) / 2;
    es_image_destroy(context, &truth->whole);
    truth->whole = whole;
    return works;
}

static bool trace_half(es_context* context, es_world* world, const error_effort* effort, int half, error_truth* truth)
{
    es_reference* reference = begin(context, world, effort->width, effort->height, effort->seed + (uint32_t)half, 0);
    char path[DEMO_PATH_SIZE] = "";
    if (!reference) return false;
    if (effort->cache) snprintf(path, sizeof path, "%.4000s-%d.exr", effort->cache, half);
    if (effort->cache && access(path, R_OK) == 0 && es_reference_resume(reference, path) != ES_OK)
        fprintf(stderr, "%s: does not fit, begun again: %s\n", path, es_context_message(context));
    uint64_t found = es_reference_get_stats(reference).samples, samples = found;
    uint32_t wanted = (effort->samples + 1) / 2;
    bool works = true;
    for (double start = demo_seconds(); works && samples < wanted && (samples < 1 || demo_seconds() - start < effort->seconds / 2);) {
        uint32_t step = samples < 16 ? 1 : 4, left = wanted - (uint32_t)samples;
        works = es_reference_add(reference, step < left ? step : left) == ES_OK;
        samples = es_reference_get_stats(reference).samples;
    }
    if (!works) demo_refuse_context(context);
    if (works && effort->cache && samples > found && es_reference_save(reference, path) != ES_OK) demo_refuse_context(context); /* the pictures are there all the same */
    works = works && take_images(context, reference, half, truth);
    truth->samples += samples;
    es_reference_destroy(reference);
    return works;
}

bool error_trace_truth(es_context* context, es_world* world, const error_effort* effort, error_truth* truth)
{
    *truth = (error_truth){.noise_relrmse = NAN};
    for (int half = 0; half < 2; half++)
        if (!trace_half(context, world, effort, half, truth)) return false;
    snprintf(truth->source, sizeof truth->source, "our path tracer, %" PRIu64 " samples a pixel", truth->samples);
    return error_join_halves(context, truth);
}

static bool load(es_context* context, const char* peers, const char* name, es_image* image)
{
    char path[DEMO_PATH_SIZE + 64];
    snprintf(path, sizeof path, "%s/%s", peers, name);
    if (access(path, R_OK) != 0) return false;
    if (es_image_load(context, path, image) == ES_OK && image->channels == 3) return true;
    demo_refuse_context(context);
    return false;
}

bool error_load_truth(es_context* context, const char* peers, error_truth* truth)
{
    *truth = (error_truth){.noise_relrmse = NAN, .samples = 4096};
    if (!peers[0] || !load(context, peers, "room_indirect_reference.exr", &truth->indirect)) return false;
    if (!load(context, peers, "room_direct_reference.exr", &truth->whole) || truth->whole.width != truth->indirect.width || truth->whole.height != truth->indirect.height) {
        error_truth_free(context, truth);
        return false;
    }
    for (size_t i = 0; i < (size_t)truth->whole.width * truth->whole.height * 3; i++) truth->whole.pixels[i] += truth->indirect.pixels[i];
    snprintf(truth->source, sizeof truth->source, "Embree's path tracer, 4096 samples a pixel, which shares no code with ours");
    return true;
}

/* ---- our path tracer against it ---------------------------------------------------------------------------------- */

static int rising(const void* a, const void* b)
{
    double x = *(const double*)a, y = *(const double*)b;
    return (x > y) - (x < y);
}

/* Of a block: how many standard errors the two means are apart. Both pictures' noise counts; the truth's is ours, by the ratio of the
 * samples, since both sum the same light. The channels of a path rise and fall together, so their errors are added up as they are. */
static double block_deviation(const es_image* ours, const es_image* noise, const error_truth* truth, double noise_factor, uint32_t x0, uint32_t y0, uint32_t side)
{
    double difference = 0, variance = 0;
    for (uint32_t y = y0; y < y0 + side && y < ours->height; y++)
        for (uint32_t x = x0; x < x0 + side && x < ours->width; x++) {
            size_t at = ((size_t)y * ours->width + x) * 3;
            double error = 0;
            for (int k = 0; k < 3; k++) {
                difference += (double)ours->pixels[at + k] - (double)truth->indirect.pixels[at + k];
                error += (double)noise->pixels[at + k];
            }
            variance += error * error * noise_factor;
        }
    return difference == 0 ? 0 : fabs(difference) / sqrt(variance);
}

static void agree(const es_image* ours, const es_image* noise, uint64_t samples, const error_truth* truth, error_agreement* agreement)
{
    enum { SIDE = 16 };
    size_t columns = (ours->width + SIDE - 1) / SIDE, rows = (ours->height + SIDE - 1) / SIDE;
    *agreement = (error_agreement){.side = SIDE, .samples = samples, .deviations = malloc(columns * rows * sizeof(double))};
    for (size_t i = 0; agreement->deviations && i < columns * rows; i++) {
        double deviation = block_deviation(ours, noise, truth, 1 + (double)samples / (double)truth->samples, (uint32_t)(i % columns) * SIDE, (uint32_t)(i / columns) * SIDE, SIDE);
        agreement->deviations[agreement->blocks++] = deviation;
        agreement->within += deviation <= 3;
        agreement->worst = fmax(agreement->worst, deviation);
    }
    if (agreement->deviations) qsort(agreement->deviations, agreement->blocks, sizeof(double), rising);
}

bool error_trace_curve(es_context* context, es_world* world, const error_truth* truth, uint32_t samples, double seconds, error_curve* curve)
{
    *curve = (error_curve){0};
    es_reference* reference = begin(context, world, truth->indirect.width, truth->indirect.height, 0, 0);
    bool works = reference != NULL;
    es_image indirect = {0};
    for (uint32_t wanted = 1; works && wanted <= samples && curve->count < ERROR_MAX_POINTS; wanted *= 2) {
        es_reference_stats stats = es_reference_get_stats(reference);
        if (stats.seconds >= seconds && wanted > 4) break; /* three points say where the curve leads */
        works = es_reference_add(reference, wanted - (uint32_t)stats.samples) == ES_OK;
        es_image_destroy(context, &indirect);
        works = works && es_reference_image(reference, "indirect", &indirect) == ES_OK;
        if (!works) break;
        stats = es_reference_get_stats(reference);
        curve->points[curve->count].samples = wanted;
        curve->points[curve->count].seconds = stats.seconds;
        curve->points[curve->count].error = error_measure(context, &indirect, NULL, truth);
        fprintf(stderr, "  our path tracer: %u samples, %.2f s, relRMSE %.3f\n", wanted, stats.seconds, curve->points[curve->count].error.relrmse);
        curve->count++;
    }
    if (!works) demo_refuse_context(context);
    es_image_destroy(context, &indirect);
    es_reference_destroy(reference);
    return works;
}

/* Pixels that share paths err together, and a block's error does not follow from theirs: here none do. */
bool error_trace_agreement(es_context* context, es_world* world, const error_truth* truth, uint32_t samples, double seconds, error_agreement* agreement)
{
    *agreement = (error_agreement){0};
    es_reference* reference = begin(context, world, truth->indirect.width, truth->indirect.height, 0, 1);
    bool works = reference != NULL;
    es_image indirect = {0}, noise = {0};
    while (works) {
        es_reference_stats stats = es_reference_get_stats(reference);
        if (stats.samples >= samples || (stats.samples && stats.seconds >= seconds)) break;
        works = es_reference_add(reference, 1) == ES_OK;
    }
    works = works && es_reference_image(reference, "indirect", &indirect) == ES_OK && es_reference_image(reference, "indirect-error", &noise) == ES_OK;
    if (works) agree(&indirect, &noise, es_reference_get_stats(reference).samples, truth, agreement);
    else demo_refuse_context(context);
    es_image_destroy(context, &indirect);
    es_image_destroy(context, &noise);
    es_reference_destroy(reference);
    return works;
}

double error_seconds_to(const error_curve* curve, double relrmse, bool* extrapolated)
{
    *extrapolated = false;
    if (!curve->count) return NAN;
    for (size_t i = 0; i < curve->count; i++) {
        double error = curve->points[i].error.relrmse, time = curve->points[i].seconds;
        if (error > relrmse) continue;
        if (!i) return time; /* better from the start: no less can be asked of it */
        double before = curve->points[i - 1].error.relrmse, t = log(relrmse / before) / log(error / before);
        return exp(log(curve->points[i - 1].seconds) + t * log(time / curve->points[i - 1].seconds));
    }
    if (curve->count < 3) return NAN;
    *extrapolated = true;
    size_t last = curve->count - 1, first = last - 2;
    double slope = log(curve->points[last].error.relrmse / curve->points[first].error.relrmse) / log(curve->points[last].seconds / curve->points[first].seconds);
    return slope < 0 ? curve->points[last].seconds * exp(log(relrmse / curve->points[last].error.relrmse) / slope) : INFINITY;
}

double error_at_samples(const error_curve* curve, double samples)
{
    if (curve->count < 3) return NAN;
    size_t last = curve->count - 1, first = last - 2;
    double before = curve->points[first].error.relrmse, after = curve->points[last].error.relrmse;
    double slope = log(after / before) / log((double)curve->points[last].samples / curve->points[first].samples);
    return after * exp(slope * log(samples / curve->points[last].samples));
}
