/* Direct + indirect + emission -> what a display shows. */
#ifndef EARTHSHINE_GI_COMPOSE_H
#define EARTHSHINE_GI_COMPOSE_H

#include "gi/gi.h"
#include "gi/screen/residual.h"

/* sRGB codes of linear values by the rounded square root of the value times its last index: a step is below a tenth of a code
 * everywhere, dark end included. */
enum { ES_SRGB_TABLE_SIZE = 4096 };
typedef struct es_srgb_table { uint32_t code[ES_SRGB_TABLE_SIZE]; } es_srgb_table;
void es_srgb_table_fill(es_srgb_table* table);

/* Indirect light besides what virtual point lights or micro-buffers send, in the order in which it is added to theirs. */
typedef enum es_further_light {
    ES_FURTHER_RAYS,              /* what bounding left out, found by rays (gi/bias_compensation.h) */
    ES_FURTHER_NEGATIVE,          /* of negative lights (gi/second_order.h) */
    ES_FURTHER_RESIDUAL,          /* what bounding left out, found in screen space: a step each (gi/screen/residual.h) */
    ES_FURTHER_BOUNCE = ES_FURTHER_RESIDUAL + ES_RESIDUAL_STEPS, /* of one bounce in screen space */
    ES_FURTHER_LIGHTS
} es_further_light;

/* radiance = (emitted + direct) + indirect, the background being emitted,
 * direct = that of light sources without a size + that of lamps,
 * indirect = (((bounded + further[0]) + further[1]) + …) + mirrored, bounded = diffuse + lobe; what is NULL is left out.
 * The sums are what stands here, in this order, so that the parts' images add up to the whole's to the bit. Where there are blended layers each of the summands (emitted,
 * direct light of either kind, bounded, every further one) is first composited by itself with those layers: summand · transmittance + the layers'. */
/* What blended layers leave of the picture behind them, and what they add, weighted (gi/blend.h): planes of the whole picture, of which a rectangle counts. */
typedef struct es_compose_layers {
    const float* transmittance;   /* NULL: there are no layers */
    const float *emitted[3], *direct[3], *lamps[3], *bounded[3]; /* NULL: none */
    uint32_t column_begin, column_end, row_begin, row_end; /* columns are multiples of eight */
} es_compose_layers;

typedef struct es_compose_job {
    const es_gbuffer* gbuffer;
    const float* background[3];   /* radiance where nothing is seen, 0 elsewhere; NULL: none */
    const float* direct[3];       /* reflected radiance; NULL: none */
    const float* lamp_irradiance[3]; /* direct irradiance of lamps on the diffuse part, NULL: none */
    const float* lamp_specular[3];   /* their radiance reflected by the lobe, NULL: none */
    const uint8_t* lamp_lit;         /* where that may be lit (gi/lit.h) */
    const float* irradiance[3];   /* indirect irradiance on the diffuse part, NULL: none */
    const float* specular[3];     /* indirect radiance reflected by the lobe, NULL: none */
    const uint8_t* lit;           /* where that may be lit (gi/lit.h) */
    const float* further[ES_FURTHER_LIGHTS][3]; /* reflected radiance, of either sign; NULL: none */
    /* what reflecting pixels see (gi/reflections/reflecting.h), added to the indirect light last; it takes the place of what lobes reflect of lamps and indirect light there */
    const uint32_t* mirrors;      /* not 0: the pixel reflects; NULL: none does */
    const uint8_t* mirrors_any;   /* where that may be so, or `mirrored` lit, as `lit`; NULL: anywhere */
    const float* mirrored[3];     /* reflected radiance; NULL: none */
    es_compose_layers layers;     /* composited with all but `reflected` */
    const float* finished[3];     /* the radiance itself, in place of all of the above; NULL: it is to be made */
    float exposure_scale;         /* 2^stops */
    float white;                  /* Reinhard: the radiance that becomes 1 */
    uint32_t tone_map;            /* es_tone_map */
    uint32_t* xrgb;               /* sRGB-encoded, width words a row; NULL: not wanted */
    const es_srgb_table* srgb;    /* for xrgb */
    float* radiance[3];           /* before exposure, rows of gbuffer->stride; NULL: not wanted */
    float* emitted[3];            /* its parts; NULL: not wanted */
    float* whole_direct[3];
    float* bounded[3];
    float* indirect[3];
    float* reflected[3];          /* direct + bounded, of the surfaces of the G-buffer */
    float* display[3];            /* after the tone map, linear [0, 1]; NULL: not wanted */
} es_compose_job;

void es_compose(es_context* context, const es_compose_job* job);

#endif
