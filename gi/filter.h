/* Geometry-aware box filter over n × n pixels (Laine et al. 2007; Knecht 2009 §3.4.1), once or several times.
 *
 * Gathers what interleaved shading spread over the n × n phases. A tap counts when it lies on what looks like the same surface:
 * |z' - z| <= depth_threshold · z and N'·N >= normal_threshold, z and N being the centre's; the centre always counts. Separable:
 * rows first, then columns, each the mean over the taps that count. The window is [x - n/2, x - n/2 + n); at the image's border
 * a tap outside is replaced by the one n pixels further in, which is of the same phase and has not been counted.
 */
#ifndef EARTHSHINE_GI_FILTER_H
#define EARTHSHINE_GI_FILTER_H

#include "gi/gi.h"
#include "platform/context.h"

enum { ES_FILTER_MAX = 16, ES_FILTER_MAX_PASSES = 4 };

typedef struct es_filter_job {
    const es_gbuffer* gbuffer;     /* depth and normal */
    uint32_t size;                 /* n, 1 … ES_FILTER_MAX */
    uint32_t passes;               /* one after another, 1 … ES_FILTER_MAX_PASSES */
    float depth_threshold, normal_threshold;
    uint32_t plane_count;          /* 1 … 6 */
    const float* source[6];        /* rows of gbuffer->stride */
    float* result[6];              /* not the sources */
    /* where planes 3 … 5 may be lit (gi/lit.h), of sources and results, the latter in and out; NULL: it is looked up, and not kept */
    const uint8_t* source_lit;
    uint8_t* result_lit;
} es_filter_job;

es_result es_filter_geometry_aware(es_context* context, es_arena* arena, const es_filter_job* job);

/* ---- between filter.c and its kernel ------------------------------------------------------------------------------------- */

enum { ES_FILTER_COLUMNS = 256, ES_FILTER_ROWS = 128,
    ES_FILTER_GROUPS = (ES_FILTER_COLUMNS + 2 * ES_FILTER_MAX_PASSES * ES_FILTER_MAX) / 8, /* of eight columns, with margins of taps */
    ES_FILTER_STRIDE = 8 * ES_FILTER_GROUPS + 16,  /* lines and planes begin at different places of a way of the cache */
    ES_FILTER_LINES = ES_FILTER_MAX_PASSES * ES_FILTER_MAX };

/* What passes keep of one block: each hands its lines to the next as soon as it has them, so that only the last windows stand, in rings. */
typedef struct es_filter_scratch {
    float in[ES_FILTER_MAX_PASSES][6][ES_FILTER_STRIDE];                /* a pass' latest line */
    float mid[ES_FILTER_MAX_PASSES][ES_FILTER_MAX][6][ES_FILTER_STRIDE]; /* its lines, filtered along rows */
    float depth[ES_FILTER_LINES][ES_FILTER_STRIDE], normal[ES_FILTER_LINES][3][ES_FILTER_STRIDE];
    /* Of eight columns of a line: do all taps of the row's windows count; and how many lines, this one the last, are each like the one above. */
    bool even[ES_FILTER_LINES][ES_FILTER_GROUPS];
    uint8_t alike[ES_FILTER_LINES][ES_FILTER_GROUPS];
} es_filter_scratch;

#endif
