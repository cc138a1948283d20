/* What the files of `bench micro` share. */
#ifndef EARTHSHINE_DEMO_BENCH_MICRO_H
#define EARTHSHINE_DEMO_BENCH_MICRO_H

#include "bench_error.h"

enum { MICRO_LEAST_EXPONENT = 14, MICRO_MOST_EXPONENT = 20, MICRO_EXPONENTS = MICRO_MOST_EXPONENT - MICRO_LEAST_EXPONENT + 1, MICRO_MAX_ROWS = 96 };

typedef struct micro_bench {
    const bench_options* options;
    es_context* context;
    bench_row rows[MICRO_MAX_ROWS];
    size_t count;
    bench_report report;
    /* how much is done */
    uint32_t width, height;   /* of all pictures */
    uint32_t exponent;        /* 2^exponent points, where they are not what is varied */
    uint32_t frames;          /* timed, after one that is not */
    double seconds;           /* after which no more frames are timed, once one has been */
    float contact_reach;      /* metres within which any surface is near (micro_stage); 0: as there */
    uint32_t truth_samples;
    double truth_seconds;
} micro_bench;

/* NULL when no row has the id, or it is not wanted. */
bench_row* micro_row(micro_bench* bench, const char* format, ...) ES_PRINTF(2, 3);

/* Medians over frames. */
typedef struct micro_times {
    double frame, update, light, gather; /* ms: whole, hierarchy, light of its points, micro-buffers without interpolation */
    uint64_t samples;         /* pixels of micro-buffers of the last frame's `gather` */
    uint64_t points;          /* that the last frame's `update` computed */
} micro_times;
/* Frames after steps of `dt` seconds, of "gi=micro" and `settings` ("key=value …"); `still`: nothing is skipped. False after a message. */
bool micro_time(micro_bench* bench, es_world* world, const char* settings, float dt, bool still, micro_times* times);

/* bench_micro_speed.c: the first table's rows. False after a message. */
bool micro_measure_speed(micro_bench* bench);
/* bench_micro_errors.c: the second's, and what figures 6.14 to 6.17 compare. */
bool micro_measure_errors(micro_bench* bench);

/* bench_micro_stage.c: a world and the truth of its picture */
typedef struct micro_stage {
    es_world* world;
    error_truth truth;
    uint8_t* contact;         /* per pixel: something is near above it (1), it shows a surface with a lobe (2) */
} micro_stage;
/* A built-in scene as it opens; "ring-phong-N" and "ring-ggx-R" are the scene `ring` without its silk, the ring with that exponent or roughness. */
bool micro_open_stage(micro_bench* bench, const char* name, micro_stage* stage);
void micro_close_stage(micro_bench* bench, micro_stage* stage);

typedef struct micro_error {
    double all, contact, glossy; /* relRMSE of the indirect light, of all pixels and of those of a kind (the truth's mean is that of these); NaN: no such pixels */
    double milliseconds;      /* of a frame, nothing skipped */
} micro_error;
bool micro_measure(micro_bench* bench, const micro_stage* stage, const char* settings, micro_error* error);

#endif
