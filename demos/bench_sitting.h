/* One run of a benchmark of rows: the context it measures in, how much it does, what it leaves; and worlds with the truth of their pictures. */
#ifndef EARTHSHINE_DEMO_BENCH_SITTING_H
#define EARTHSHINE_DEMO_BENCH_SITTING_H

#include "bench_error.h"

enum { SITTING_MAX_ROWS = 96 };

typedef struct bench_sitting {
    const bench_options* options;
    es_context* context;
    bench_row rows[SITTING_MAX_ROWS];
    size_t count;
    bench_report report;
    /* how much is done; --size, --spp and --quick come before what the benchmark sets */
    uint32_t width, height;   /* of all pictures */
    uint32_t frames;          /* timed, after one that is not */
    double seconds;           /* after which no more frames are timed, once one has been */
    float contact_reach;      /* metres within which any surface is near (sitting_stage); 0: as there */
    uint32_t truth_samples;
    double truth_seconds;
} bench_sitting;

/* ---- the run (bench_sitting.c) ------------------------------------------------------------------------------------------------- */

/* From the heap, with `rows` of the benchmark; NULL after a message. The caller fills `report` in. Pictures of width × height, or of 64 × 48 with --quick. */
bench_sitting* sitting_open(const bench_options* options, size_t (*rows)(bench_row* rows, size_t capacity), uint32_t width, uint32_t height);
/* Prints and writes the rows that are wanted where all of it works, and frees the sitting; the code to leave with. */
int sitting_close(bench_sitting* sitting, bool works);
/* NULL when no row has the id, or it is not wanted. */
bench_row* sitting_row(bench_sitting* sitting, const char* format, ...) ES_PRINTF(2, 3);
/* As it opens, before the first step; NULL after a message. */
es_world* sitting_open_scene(bench_sitting* sitting, const char* name);
/* One renderer with pictures of the sitting's size that skips nothing, and "key=value …" on top; NULL after a message. */
es_renderer* sitting_open_renderer(bench_sitting* sitting, const char* settings);
/* Milliseconds of a whole frame of the world as it is; NaN after a message. */
double sitting_render(bench_sitting* sitting, es_renderer* renderer, es_world* world);
/* Of the renderer's last frame: milliseconds of a pass and, where `count` is not NULL, what it counted; 0 where it was skipped, NaN where there is none. */
double sitting_pass(const es_renderer* renderer, const char* name, uint64_t* count);

/* ---- a world and the truth of its picture (bench_stage.c) ----------------------------------------------------------------------- */

typedef struct sitting_stage {
    es_world* world;
    error_truth truth;
    uint8_t* contact;         /* per pixel: something is near above it (1), it shows a surface with a lobe (2) */
} sitting_stage;
/* A built-in scene as it opens; "ring-phong-N" and "ring-ggx-R" are the scene `ring` without its silk, the ring with that exponent or roughness. */
bool sitting_open_stage(bench_sitting* sitting, const char* name, sitting_stage* stage);
void sitting_close_stage(bench_sitting* sitting, sitting_stage* stage);

typedef struct sitting_error {
    double all, contact, glossy; /* relRMSE of the indirect light, of all pixels and of those of a kind (the truth's mean is that of these); NaN: no such pixels */
    double milliseconds;      /* of a frame, nothing skipped */
} sitting_error;
bool sitting_measure(bench_sitting* sitting, const sitting_stage* stage, const char* settings, sitting_error* error);

#endif
