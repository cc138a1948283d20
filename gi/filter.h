/* Geometry-aware box filter over n × n pixels (Laine et al. 2007; Knecht 2009 §3.4.1).
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

typedef struct es_filter_job {
    const es_gbuffer* gbuffer;     /* depth and normal */
    uint32_t size;                 /* n, 1 … 16 */
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

enum { ES_FILTER_COLUMNS = 128, ES_FILTER_ROWS = 48, ES_FILTER_MAX = 16,
    ES_FILTER_MARGIN = ES_FILTER_MAX, /* a folded tap lies up to n - 1 columns away */
    ES_FILTER_STRIDE = ES_FILTER_COLUMNS + 2 * ES_FILTER_MARGIN };

/* One block's input rows, with a margin of taps on both sides, and the rows filtered horizontally. */
typedef struct es_filter_scratch {
    float in[6][ES_FILTER_STRIDE], depth_in[ES_FILTER_STRIDE], normal_in[3][ES_FILTER_STRIDE];
    float depth[ES_FILTER_ROWS + ES_FILTER_MAX][ES_FILTER_COLUMNS];
    float normal[3][ES_FILTER_ROWS + ES_FILTER_MAX][ES_FILTER_COLUMNS];
    float mid[6][ES_FILTER_ROWS + ES_FILTER_MAX][ES_FILTER_COLUMNS];
    /* per eight columns: does every pair of taps that a window of this line takes from it pass both tests; and how many lines, this one the
     * last, have normals that pass with each other's */
    bool even[ES_FILTER_STRIDE / 8];
    uint8_t like[ES_FILTER_ROWS + ES_FILTER_MAX][ES_FILTER_COLUMNS / 8];
} es_filter_scratch;

#endif
