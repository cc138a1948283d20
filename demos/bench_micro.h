/* What the files of `bench micro` share. */
#ifndef EARTHSHINE_DEMO_BENCH_MICRO_H
#define EARTHSHINE_DEMO_BENCH_MICRO_H

#include "bench_sitting.h"

enum { MICRO_LEAST_EXPONENT = 14, MICRO_MOST_EXPONENT = 20, MICRO_EXPONENTS = MICRO_MOST_EXPONENT - MICRO_LEAST_EXPONENT + 1 };

/* 2^exponent points, where they are not what is varied. */
uint32_t micro_exponent(const bench_sitting* bench);

/* Medians over frames. */
typedef struct micro_times {
    double frame, update, light, gather; /* ms: whole, hierarchy, light of its points, micro-buffers without interpolation */
    uint64_t samples;         /* pixels of micro-buffers of the last frame's `gather` */
    uint64_t points;          /* that the last frame's `update` computed */
} micro_times;
/* Frames after steps of `dt` seconds, of "gi=micro" and `settings` ("key=value …"); `still`: nothing is skipped. False after a message. */
bool micro_time(bench_sitting* bench, es_world* world, const char* settings, float dt, bool still, micro_times* times);

/* bench_micro_speed.c: the first table's rows. False after a message. */
bool micro_measure_speed(bench_sitting* bench);
/* bench_micro_errors.c: the second's, and what figures 6.14 to 6.17 compare. */
bool micro_measure_errors(bench_sitting* bench);

#endif
