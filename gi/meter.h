/* A light meter: how bright a picture is, for the eye that looks at it and the exposure it is shown with. */
#ifndef EARTHSHINE_GI_METER_H
#define EARTHSHINE_GI_METER_H

#include "platform/platform.h"

/* Luminance of one W/(m² sr) of visible light, cd/m²: the luminous efficacy of Radiance (Ward Larson and Shakespeare 1998), lm/W. */
#define ES_LUMINOUS_EFFICACY 179.0f
/* Radiance below which pixels of a logarithmic mean are all the same, W/(m² sr); above which, of any mean. */
#define ES_METER_LEAST 1e-4f
#define ES_METER_MOST 1e9f

/* Of one row: sums over its pixels of 0.2126 R + 0.7152 G + 0.0722 B, and of its log2. */
typedef struct es_meter_row { float sum, log_sum; } es_meter_row;

typedef struct es_meter_job {
    const float* radiance[3];  /* W/(m² sr); pixels that are no number, infinite or negative count as black, others as ES_METER_MOST at the most */
    uint32_t width, height, stride; /* floats of a row; readable up to the next multiple of eight after width */
    es_meter_row* rows;        /* height of them */
} es_meter_job;

typedef struct es_meter {
    float luminance;           /* mean, cd/m² */
    float log_average;         /* exp2 of the mean of log2, W/(m² sr), not below ES_METER_LEAST */
} es_meter;

/* The same bits for any number of threads. */
es_result es_meter_read(es_context* context, const float* const radiance[3], uint32_t width, uint32_t height, uint32_t stride, es_meter* meter);

#endif
