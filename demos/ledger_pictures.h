/* The pictures of one frame that its ledger is made from (bench_ledger.c says which and why). */
#ifndef EARTHSHINE_DEMO_LEDGER_PICTURES_H
#define EARTHSHINE_DEMO_LEDGER_PICTURES_H

#include "demo.h"
#include "ledger_split.h"

typedef enum ledger_cause {
    LEDGER_TEMPORAL,
    LEDGER_NUMBER,
    LEDGER_INTERLEAVE,
    LEDGER_VISIBILITY,
    LEDGER_BOUND,
    LEDGER_LIGHT_VIEW,
    LEDGER_QUANTISATION,
    LEDGER_CAUSES,
    LEDGER_REST = LEDGER_CAUSES /* of the parts: what no cause explains */
} ledger_cause;

/* How much is rendered: what is not noted as a half's is rendered once. */
typedef struct ledger_effort {
    uint32_t width, height;
    uint32_t sets;                 /* of lights, of a half, in place of infinitely many */
    uint32_t fine_sets;            /* of these, that are also taken from fine light G-buffers; as many at most */
    uint32_t samples;              /* per pixel, of a half of the reference */
    uint32_t quantised_samples;    /* of these, that are also taken on the rounded G-buffer; as many at most */
    uint32_t compensation_samples; /* per pixel, of a half */
    uint32_t bounce_samples;       /* per pixel, of a half: paths of several bounces */
} ledger_effort;

enum { LEDGER_BOUNCES = 4, LEDGER_FINE_LIGHT_SIZE = 1024 };

typedef struct ledger_frame {
    size_t floats;
    ledger_picture method, reference, parts[LEDGER_CAUSES], lost[LEDGER_CAUSES]; /* as ledger_add takes them */
    double further;                /* sum of squares of the light of bounces two to LEDGER_BOUNCES, noise taken out */
    double direct;                 /* of the error of direct light */
    float* planes[96];             /* that the pictures lie in */
    size_t plane_count;
} ledger_frame;

/* The settings whose error is split: the defaults, at the effort's size. */
es_renderer_settings ledger_method(const ledger_effort* effort);
/* Of the world as it is now. `method` is the renderer's picture "indirect" after the frames before. What was taken is freed by
 * ledger_frame_free, after a failure too. DEMO_BAD_INPUT after a line that says why. */
int ledger_frame_measure(es_world* world, const ledger_effort* effort, const es_image* method, ledger_frame* frame);
void ledger_frame_free(ledger_frame* frame);

#endif
