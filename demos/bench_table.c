/* What `bench speed` has to show: a row per figure that was asked for, with the least that will do and what is aimed at. */
#include "bench.h"

#include <math.h>
#include <string.h>

#define LLVMPIPE "llvmpipe, 2 threads"

static const bench_row table[] = {
    {"gbuffer-70k", "G-buffer, all attributes, 1024×768, 70k triangles", "ms", LLVMPIPE ": 4 targets", BENCH_RATIO_AT_LEAST, 3,
        6},
    {"gbuffer-1m", "G-buffer, all attributes, 1024×768, 1M triangles", "ms", LLVMPIPE ": 4 targets", BENCH_RATIO_AT_LEAST, 2, 4},
    {"depth-1m", "depth only, 1024², 1M triangles", "ms", LLVMPIPE ": shadow map", BENCH_RATIO_AT_LEAST, 3, 6},
    {"ism-1024", "1024 imperfect shadow maps of 128², 8192 points each, pull-push", "ms", LLVMPIPE ": points, no pull-push",
        BENCH_RATIO_AT_LEAST, 20, 40},
    {"shade-1024", "interleaved shading, 1024 lights, 8×8", "ms", LLVMPIPE ": split pass", BENCH_RATIO_AT_LEAST, 4, 8},
    {"filter-8x8", "geometry-aware filter, 8×8", "ms", LLVMPIPE ": separable pass", BENCH_RATIO_AT_LEAST, 6, 12},
    {"frame-1024", "whole frame, 1024 lights, one bounce", "ms", LLVMPIPE ": sum of its passes", BENCH_RATIO_AT_LEAST, 12, 20},
    {"threads-2", "whole frame, two threads against one", "x", "one thread", BENCH_RATIO_AT_LEAST, 1.8, 1.93},
    {"exact-cost", "whole frame, what bit-exactness costs", "%", "fast-math and FMA", BENCH_VALUE_AT_MOST, 15, 5},
    {"indirect-room", "error of indirect light, room, 1024 lights", "relRMSE", NULL, BENCH_VALUE_AT_MOST, 0.20, 0.10},
    {"ism-vs-classic", "imperfect against accurate shadow maps, indirect light", "relRMSE", NULL, BENCH_VALUE_AT_MOST, 0.10,
        0.05},
    {"direct-room", "error of direct light, room, more than 2 px from a shadow edge", "relRMSE", NULL, BENCH_VALUE_AT_MOST, 0.01,
        0.003},
    {"memory-1024", "memory of the whole process, 1024×768, 1024 lights of 128²", "MiB", NULL, BENCH_VALUE_AT_MOST, 350, 350},
    {"start-cornell", "start of the program to the first frame of cornell", "ms", LLVMPIPE ": context and first frame",
        BENCH_RATIO_AT_LEAST, 10, 10},
};

size_t bench_copy_rows(const bench_row* from, size_t count, bench_row* rows, size_t capacity)
{
    if (count > capacity) count = capacity;
    for (size_t i = 0; i < count; i++) {
        rows[i] = from[i];
        rows[i].value = rows[i].peer_value = rows[i].ratio = NAN;
    }
    return count;
}

size_t bench_speed_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

bench_row* bench_find_row(bench_row* rows, size_t count, const char* id)
{
    for (size_t i = 0; i < count; i++)
        if (!strcmp(rows[i].id, id)) return &rows[i];
    return NULL;
}
