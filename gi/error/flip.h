/* ꟻLIP: how much two pictures differ to an eye that sees them alternate (Andersson et al. 2020; for radiance, 2021). */
#ifndef EARTHSHINE_GI_FLIP_H
#define EARTHSHINE_GI_FLIP_H

#include "gi/error/error.h"

enum { ES_FLIP_TILE = 64, ES_FLIP_MAX_RADIUS = 61 }; /* the radius at 450 pixels per degree */

typedef enum es_flip_tone { ES_FLIP_LINEAR, ES_FLIP_REINHARD, ES_FLIP_ACES } es_flip_tone;

/* The filters, each as products of two of one dimension. Index 0 is the middle; all but `edge` are even, `edge` is odd: its weight at k
 * belongs to the left or upper pixel, the negative one to the other. Those of features are 0 beyond their own, smaller radius; the
 * weight in the middle of `point` is what makes the sum 0, and not used. */
typedef struct es_flip_filters {
    uint32_t radius;
    float achromatic[ES_FLIP_MAX_RADIUS + 1], red_green[ES_FLIP_MAX_RADIUS + 1];
    float blue_yellow[2][ES_FLIP_MAX_RADIUS + 1]; /* a sum of two Gaussians */
    float gauss[ES_FLIP_MAX_RADIUS + 1], edge[ES_FLIP_MAX_RADIUS + 1], point[ES_FLIP_MAX_RADIUS + 1];
} es_flip_filters;

typedef struct es_flip_job {
    const es_flip_filters* filters;
    uint32_t width, height;
    es_flip_tone tone;
    float white;           /* REINHARD: radiance times exposure that is shown as white */
    const float* scales;   /* exposures, as factors; the largest error of all is the pixel's */
    uint32_t scale_count;
    float* errors;         /* width × height */
} es_flip_job;

/* What one tile needs. `rgb`: of each picture three planes of `rows` rows of `stride` floats, the tile with a border of the filters'
 * radius; finite and not negative. `filtered`: of each picture seven planes of `rows` rows of ES_FLIP_TILE floats. */
typedef struct es_flip_scratch {
    uint32_t rows, stride;
    float* rgb[2][3];
    float* row[3];         /* `stride` floats each */
    float* filtered[2][7];
} es_flip_scratch;

/* The error of each pixel, width × height: of radiance over several exposures when `hdr`, else of the pictures as the display shows them.
 * Negative values and what is not finite are black to the filters; a pixel that is not finite in one picture and not the same in the other
 * has error 1. INVALID_ARGUMENT for a number of pixels per degree that is not supported. `pairs` must have colour. */
es_result es_flip(es_context* context, const es_image* a, const es_image* b, const es_channel_pairs* pairs, bool hdr, const es_error_desc* desc, float* errors);

#endif
