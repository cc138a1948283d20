/* `earthshine bench`: rows with a stable id, measured against a peer in the same sitting, judged by what was asked for. */
#ifndef EARTHSHINE_DEMO_BENCH_H
#define EARTHSHINE_DEMO_BENCH_H

#include "demo.h"
#include "plot.h"

typedef enum bench_judge {
    BENCH_NONE,           /* a figure without a target */
    BENCH_RATIO_AT_LEAST, /* `ratio` against the targets */
    BENCH_VALUE_AT_MOST,  /* `value` against the targets */
    BENCH_VALUE_AT_LEAST
} bench_judge;

typedef struct bench_row {
    const char* id;
    const char* work; /* what was done, for people */
    const char* unit; /* of value and peer_value */
    const char* peer; /* NULL: measured against nothing */
    bench_judge judge;
    double must, aim;
    double value, peer_value, ratio; /* NaN: not measured; ratio: how many times better than the peer */
    char note[320];                  /* why a figure is missing, or what stands behind it */
} bench_row;

enum { BENCH_MAX_SCENES = 16 };
typedef struct bench_options {
    const char* out; /* directory; NULL: none */
    uint32_t runs;
    uint32_t threads;
    bool no_peer;
    bool quick; /* fewer settings and repetitions: to see that it runs, not to quote */
    const char* only[32]; /* row ids; none: all */
    size_t only_count;
    const char* scenes[BENCH_MAX_SCENES]; /* of bench error and ledger; none: room, cornell, hall */
    size_t scene_count;
    uint32_t width, height; /* of the pictures; 0: 1024 × 768 for error and scale, which the peers' are, 384 × 288 for ledger */
    uint32_t samples;       /* of the truths of error and ledger; 0: their choice */
    const char* program; /* path of this program, for the rows that start it */
} bench_options;

bool bench_wants(const bench_options* options, const char* id);
double bench_median(double* values, size_t count); /* sorts; NaN without values */

/* bench_table.c: the rows of `bench speed` and their targets, figures still NaN */
size_t bench_speed_rows(bench_row* rows, size_t capacity);
/* The table of a benchmark, figures still NaN; how many rows there is room for. */
size_t bench_copy_rows(const bench_row* table, size_t count, bench_row* rows, size_t capacity);
bench_row* bench_find_row(bench_row* rows, size_t count, const char* id);

/* bench.c: the benchmarks that there are, in the page's order; NULL past the last */
const char* bench_name(size_t index);

/* bench_report.c: what one benchmark leaves in --out: NAME.json and NAME.csv with the rows, NAME-PLOT.svg and NAME-PLOT.csv, and a
 * section of index.html, which all benchmarks that ran into one folder share. */
enum { BENCH_MAX_PLOTS = 24 };
typedef struct bench_report {
    const char* name;                 /* of the benchmark */
    const char* title;                /* for people */
    const char* about;                /* what was done, under the title; NULL: nothing */
    char finding[PLOT_HEADLINE_SIZE]; /* all of it in a sentence; empty: the first plot's headline */
    demo_text figures;                /* HTML: plots, and what the benchmark adds between them */
    demo_text members;                /* of the JSON object, each beginning with a comma: ,"points":[…] */
    struct {
        char id[64], headline[PLOT_HEADLINE_SIZE];
        demo_text svg, csv;
    } plots[BENCH_MAX_PLOTS];
    size_t plot_count;
    bool failed; /* memory ran out */
} bench_report;
/* Add a plot with its headline and caption, and its numbers folded below it. */
void bench_report_curves(bench_report* report, const plot_curves* plot);
void bench_report_bars(bench_report* report, const plot_bars* plot);
/* Another drawing: an <svg> and a table for the page, the same numbers as CSV. Takes the texts. */
void bench_report_figure(bench_report* report, const char* id, const char* headline, const char* caption, demo_text* svg, demo_text* table, demo_text* csv);
/* Writes everything (nothing without --out) and frees the report. Rows with targets are drawn against them. */
int bench_report_write(bench_report* report, const bench_options* options, const bench_row* rows, size_t count, const es_context* context);
void bench_report_free(bench_report* report); /* of a report that is not written */
/* The rows as a table on standard output. */
void bench_print(const bench_row* rows, size_t count);
const char* bench_verdict(const bench_row* row); /* "aim", "must", "missed", "" */

/* bench_page.c: replaces the section `name` of DIR/index.html, keeps the others that are there */
int bench_write_page(const char* directory, const char* name, const demo_text* section);

/* bench_plot.c: how far each row is from its target */
void bench_add_svg(demo_text* text, const bench_row* rows, size_t count);

/* bench_child.c */
typedef struct bench_child {
    int status;
    double seconds;
    double peak_mebibytes;
    char* output;
    size_t size;
} bench_child;
/* Runs a program with its standard output captured and one environment variable set (NULL: none). status 0 is success, -1: it
 * could not be started. The caller frees output. */
bench_child bench_run_child(const char* const* arguments, const char* variable, const char* value, bool quiet);

/* bench_peer.c: programs from the folder of peers, built into a temporary folder, that print rows of figures */
typedef enum bench_peer_kind {
    BENCH_LLVMPIPE,    /* its programs for drawing, shading and starting */
    BENCH_EMBREE_RAYS, /* building and tracing rays: rows as "primary intersect1 70k" */
    BENCH_EMBREE_PATHS, /* one diffuse bounce by path tracing, demos/bench_embree_paths.c */
    BENCH_BULLET,       /* rigid bodies; cloth */
    BENCH_FFT           /* FFTW and KissFFT: takes the threads alone */
} bench_peer_kind;
typedef struct bench_peer {
    bench_peer_kind kind;
    char folder[DEMO_PATH_SIZE]; /* of the peers' sources; "" when there are none */
    char build[DEMO_PATH_SIZE];  /* temporary; "" when nothing is built */
    char why[200];               /* why there is no peer */
    struct {
        char name[96];
        double values[64];
        size_t count;
    } rows[128];
    size_t row_count;
} bench_peer;
/* False with `why` when the peers are absent or cannot be built. Large: from the heap. Closing is due in either case. */
bool bench_peer_open(bench_peer* peer, bench_peer_kind kind, bool build);
/* Once more; `threads` is what the peer may use. False with `why` when it fails. */
bool bench_peer_run(bench_peer* peer, uint32_t threads);
void bench_peer_close(bench_peer* peer);
double bench_peer_value(bench_peer* peer, const char* name); /* median over the runs; NaN */
/* One program of the kind, with its arguments (NULL at their end, at most six); `threads` for a kind that takes them by the environment. */
bool bench_peer_run_program(bench_peer* peer, size_t program, const char* const* arguments, const char* threads);

/* bench_rays.c */
int bench_rays(const bench_options* options);
size_t bench_rays_rows(bench_row* rows, size_t capacity);

/* bench_geodesic.c */
int bench_geodesic(const bench_options* options);
size_t bench_geodesic_rows(bench_row* rows, size_t capacity);

/* bench_glare.c */
int bench_glare(const bench_options* options);
size_t bench_glare_rows(bench_row* rows, size_t capacity);
/* bench_fft.c */
int bench_fft(const bench_options* options);
size_t bench_fft_rows(bench_row* rows, size_t capacity);

/* bench_speed.c, bench_speed_errors.c */
int bench_speed(const bench_options* options);
int bench_frame(const bench_options* options);
int bench_moving(const bench_options* options);
size_t bench_moving_rows(bench_row* rows, size_t capacity);
/* bench_error.c, bench_error_report.c */
int bench_error(const bench_options* options);
size_t bench_error_rows(bench_row* rows, size_t capacity);
/* bench_scale.c */
int bench_scale(const bench_options* options);
size_t bench_scale_rows(bench_row* rows, size_t capacity);
/* bench_dynamics.c, bench_cloth.c */
int bench_dynamics(const bench_options* options);
size_t bench_dynamics_rows(bench_row* rows, size_t capacity);
/* bench_scenes.c */
int bench_scenes(const bench_options* options);
size_t bench_scenes_rows(bench_row* rows, size_t capacity);
/* bench_time.c */
int bench_time(const bench_options* options);
size_t bench_time_rows(bench_row* rows, size_t capacity);
/* n × n points, so many steps: the median step, the most stretched edge and the deepest place in the sphere (m, negative: none) at the end. */
bool bench_cloth(uint32_t n, uint32_t threads, uint32_t steps, double* milliseconds, double* stretch, double* deepest);
/* bench_bounces.c */
int bench_bounces(const bench_options* options);
size_t bench_bounces_rows(bench_row* rows, size_t capacity);
/* bench_screen.c */
int bench_screen(const bench_options* options);
size_t bench_screen_rows(bench_row* rows, size_t capacity);
/* bench_compensation.c */
int bench_compensation(const bench_options* options);
size_t bench_compensation_rows(bench_row* rows, size_t capacity);
/* bench_edits.c */
int bench_edits(const bench_options* options);
size_t bench_edits_rows(bench_row* rows, size_t capacity);
/* bench_reflections.c */
int bench_reflections(const bench_options* options);
size_t bench_reflections_rows(bench_row* rows, size_t capacity);
/* bench_second_order.c */
int bench_second_order(const bench_options* options);
size_t bench_second_order_rows(bench_row* rows, size_t capacity);
/* bench_combinations.c */
int bench_combinations(const bench_options* options);
size_t bench_combinations_rows(bench_row* rows, size_t capacity);
/* bench_micro.c */
int bench_micro(const bench_options* options);
size_t bench_micro_rows(bench_row* rows, size_t capacity);
/* bench_lamps.c */
int bench_lamps(const bench_options* options);
size_t bench_lamps_rows(bench_row* rows, size_t capacity);
/* bench_ledger.c */
int bench_ledger(const bench_options* options);
/* The figures' common ground: 1024 × 768, 1024 lights of 128² texels and 8192 points, 8 × 8, nothing skipped. */
es_renderer_settings bench_settings(void);
void bench_measure_errors(const bench_options* options, const bench_peer* peer, bench_row* rows, size_t count);

#endif
