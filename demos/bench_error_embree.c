/* Embree's path tracer of the peers' room: run once, its pictures measured as ours are. */
#include "bench_error.h"

#include <math.h>
#include <unistd.h>

static bool read_picture(es_context* context, const char* folder, const char* kind, uint32_t samples, const error_truth* truth, es_image* image)
{
    char path[DEMO_PATH_SIZE + 64];
    snprintf(path, sizeof path, "%s/%s-%u", folder, kind, samples);
    FILE* file = fopen(path, "rb");
    size_t values = (size_t)truth->indirect.width * truth->indirect.height * 3;
    bool works = file && es_image_create(context, truth->indirect.width, truth->indirect.height, 3, image) == ES_OK && fread(image->pixels, sizeof(float), values, file) == values;
    if (file) fclose(file);
    unlink(path);
    return works;
}

static void take_point(es_context* context, const char* folder, const char* kind, uint32_t samples, double seconds, const error_truth* truth, error_curve* curve)
{
    es_image image = {0};
    if (read_picture(context, folder, kind, samples, truth, &image) && curve->count < ERROR_MAX_POINTS && isfinite(seconds)) {
        curve->points[curve->count].samples = samples;
        curve->points[curve->count].seconds = seconds;
        curve->points[curve->count].error = error_measure(context, &image, NULL, truth);
        fprintf(stderr, "  Embree, %s: %u samples, %.2f s, relRMSE %.3f\n", kind, samples, seconds, curve->points[curve->count].error.relrmse);
        curve->count++;
    }
    es_image_destroy(context, &image);
}

bool error_run_embree(es_context* context, const bench_options* options, bench_peer* peer, const error_truth* truth, uint32_t samples, double seconds, error_embree* embree)
{
    *embree = (error_embree){.primary_seconds = NAN};
    char samples_text[16], seconds_text[32], threads_text[16], name[64];
    snprintf(samples_text, sizeof samples_text, "%u", samples);
    snprintf(seconds_text, sizeof seconds_text, "%g", seconds);
    snprintf(threads_text, sizeof threads_text, "%u", options->threads < 16 ? options->threads : 16);
    const char* arguments[] = {peer->build, samples_text, seconds_text, threads_text, NULL};
    if (peer->build[0]) bench_peer_run_program(peer, 0, arguments, threads_text);
    snprintf(embree->why, sizeof embree->why, "%s", peer->why);
    embree->primary_seconds = bench_peer_value(peer, "primary time");
    for (uint32_t n = 1; peer->build[0] && n && n <= samples; n *= 2) {
        snprintf(name, sizeof name, "%u time", n);
        take_point(context, peer->build, "raw", n, bench_peer_value(peer, name), truth, &embree->raw);
        snprintf(name, sizeof name, "%u box time", n);
        take_point(context, peer->build, "box", n, bench_peer_value(peer, name), truth, &embree->filtered);
    }
    return embree->raw.count > 0;
}
