/* Embree's path tracer, run beside ours: hands over the reference, reads back the curve of time against error. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <unistd.h>

enum { WIDTH = 1024, HEIGHT = 768 };

static bool write_reference(const char* path, const es_image* image)
{
    if (!image->pixels || image->width != WIDTH || image->height != HEIGHT || image->channels < 3) return false;
    FILE* file = fopen(path, "wb");
    if (!file) return false;
    bool works = true;
    for (size_t i = 0; i < (size_t)WIDTH * HEIGHT && works; i++) works = fwrite(image->pixels + i * image->channels, sizeof(float), 3, file) == 3;
    return (fclose(file) == 0) && works;
}

bool bench_embree_paths(bench_peer* peer, const es_image* reference, uint32_t threads, double limit)
{
    char path[DEMO_PATH_SIZE + 32], thread_text[16], limit_text[32];
    if (!peer->build[0]) return false;
    snprintf(path, sizeof path, "%s/reference.raw", peer->build);
    snprintf(thread_text, sizeof thread_text, "%u", threads < 16 ? threads : 16);
    snprintf(limit_text, sizeof limit_text, "%.3f", limit);
    const char* arguments[] = {path, thread_text, limit_text, NULL};
    bool works = write_reference(path, reference);
    if (works)
        works = bench_peer_run_program(peer, 0, arguments, thread_text);
    else
        snprintf(peer->why, sizeof peer->why, "no reference of 1024 x 768 for Embree's path tracer");
    unlink(path);
    return works;
}

static double value_of(bench_peer* peer, uint32_t samples, const char* what)
{
    char name[64];
    snprintf(name, sizeof name, "%u%s", samples, what);
    return bench_peer_value(peer, name);
}

size_t bench_embree_path_points(bench_peer* peer, bench_path_point* points, size_t capacity, double* primary_seconds)
{
    size_t count = 0;
    *primary_seconds = bench_peer_value(peer, "primary time");
    for (uint32_t samples = 1; count < capacity && !isnan(value_of(peer, samples, " time")); samples *= 2)
        points[count++] = (bench_path_point){samples, value_of(peer, samples, " time"), value_of(peer, samples, " relrmse"), value_of(peer, samples, " rell1"),
            value_of(peer, samples, " box time"), value_of(peer, samples, " box relrmse"), value_of(peer, samples, " box rell1")};
    return count;
}
