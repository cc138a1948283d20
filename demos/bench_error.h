/* What the files of `bench error` share: settings to try, the truth they are held against, what came of it. */
#ifndef EARTHSHINE_DEMO_BENCH_ERROR_H
#define EARTHSHINE_DEMO_BENCH_ERROR_H

#include "bench.h"

/* ---- the table of what is tried (bench_error_table.c) ------------------------------------------------------------ */

typedef struct error_setting {
    const char* series;   /* what one curve joins */
    uint32_t colour;      /* of the curve */
    bool line;
    const char* label;    /* within the series */
    const char* settings; /* "key=value key=value …" on top of the defaults */
    bool quick;           /* tried with --quick too */
} error_setting;
/* NULL past the last. */
const error_setting* error_setting_at(size_t index);
/* Applies the text; false after a line on stderr. */
bool error_apply(es_context* context, const error_setting* setting, es_renderer_settings* settings);
enum { ERROR_MAX_SETTINGS = 96 };

/* ---- measures (bench_error_measure.c) ---------------------------------------------------------------------------- */

typedef struct error_measures {
    double relrmse, relmse, rell1, flip; /* of the indirect light */
    double flip_whole;                   /* of all light */
} error_measures;

/* The truth of one picture. */
typedef struct error_truth {
    es_image indirect, whole;
    es_image halves[2];       /* two independent pictures of the indirect light, whose mean is `indirect`; no pixels: there is one */
    double noise_relrmse;     /* of `indirect`; NaN: not known */
    uint64_t samples;         /* per pixel */
    char source[160];         /* who made it, how */
} error_truth;
void error_truth_free(es_context* context, error_truth* truth);
/* NaN everywhere when a picture is missing. `whole` may be NULL: the truth's own with its indirect part replaced. With two halves relrmse
 * and relmse are right on average however noisy these are: (A - half 0)(A - half 1) has the mean (A - truth)². */
error_measures error_measure(es_context* context, const es_image* indirect, const es_image* whole, const error_truth* truth);
/* Flicker of frames against truths with two halves each, in the same way; NaN when there is less than can be told from noise. */
double error_flicker(const es_image* frames, const error_truth* truths, uint32_t count);
/* Fills `indirect` and `noise_relrmse` from the halves. */
bool error_join_halves(es_context* context, error_truth* truth);

/* ---- truths (bench_error_reference.c) ---------------------------------------------------------------------------- */

/* Limits of one reference of ours. */
typedef struct error_effort {
    uint32_t width, height;
    uint32_t samples;  /* both halves together */
    uint32_t seed;     /* and the next for the other half */
    double seconds;
    const char* cache; /* files to go on from and to keep: this and "-0.exr" or "-1.exr"; NULL: none */
} error_effort;
/* What our path tracer gives for the world as it is now: one bounce, through the pixels' centres, as the real-time methods. */
bool error_trace_truth(es_context* context, es_world* world, const error_effort* effort, error_truth* truth);
/* The peers' pictures of their room; false when there are none. */
bool error_load_truth(es_context* context, const char* peers, error_truth* truth);

/* A path tracer's error after 1, 2, 4 … samples. */
enum { ERROR_MAX_POINTS = 24 };
typedef struct error_curve {
    struct {
        uint32_t samples;
        double seconds;
        error_measures error;
    } points[ERROR_MAX_POINTS];
    size_t count;
} error_curve;
/* Seconds to an error: between points in the logarithms of both, beyond the last by the slope of the last two doublings, then
 * *extrapolated is set. NaN without points. */
double error_seconds_to(const error_curve* curve, double relrmse, bool* extrapolated);
/* relRMSE that the last two doublings lead to after so many samples; NaN when they do not. */
double error_at_samples(const error_curve* curve, double samples);

/* Our path tracer against the truth, until `seconds`. */
bool error_trace_curve(es_context* context, es_world* world, const error_truth* truth, uint32_t samples, double seconds, error_curve* curve);

/* Share of square blocks whose means differ by no more than three standard errors. */
typedef struct error_agreement {
    uint32_t side;            /* pixels */
    size_t blocks, within;
    double worst;             /* standard errors */
    double* deviations;       /* of each block, in standard errors, rising; freed by the caller */
    uint64_t samples;         /* of ours */
} error_agreement;
bool error_trace_agreement(es_context* context, es_world* world, const error_truth* truth, uint32_t samples, double seconds, error_agreement* agreement);

/* ---- Embree's path tracer (bench_error_embree.c) ----------------------------------------------------------------- */

typedef struct error_embree {
    error_curve raw, filtered; /* seconds without the primary hits */
    double primary_seconds;
    char why[200]; /* it is missing */
} error_embree;
/* With a peer of BENCH_EMBREE_PATHS; `why` says what is missing. */
bool error_run_embree(es_context* context, const bench_options* options, bench_peer* peer, const error_truth* truth, uint32_t samples, double seconds, error_embree* embree);

/* ---- results (bench_error_report.c) ------------------------------------------------------------------------------ */

typedef struct error_point {
    const error_setting* setting;
    double milliseconds; /* of a whole frame, the median; NaN: it failed */
    error_measures error;
    double flicker;      /* NaN: not measured */
} error_point;

typedef struct error_scene {
    const char* name;
    char file[DEMO_PATH_SIZE + 64];
    bool is_room;        /* the peers': Embree traces it too */
    error_truth truth;
    error_point points[ERROR_MAX_SETTINGS];
    size_t count;
    double flicker_change; /* of the truth, by its own estimate */
    error_embree embree;
    error_curve ours;
    error_agreement agreement;
} error_scene;
/* The best of ours within a time of a frame; NULL: none is as fast. */
const error_point* error_best_within(const error_scene* scene, double milliseconds);
void error_fill_rows(const error_scene* scene, bench_row* rows, size_t count);
void error_add_plots(bench_report* report, const error_scene* scene, uint32_t width, uint32_t height);
void error_add_points(demo_text* members, const error_scene* scene, bool first);

#endif
