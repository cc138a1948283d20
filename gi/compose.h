/* Direct + indirect + emission -> what a display shows. */
#ifndef EARTHSHINE_GI_COMPOSE_H
#define EARTHSHINE_GI_COMPOSE_H

#include "gi/gi.h"

/* sRGB codes of linear values by the rounded square root of the value times its last index: a step is below a tenth of a code
 * everywhere, dark end included. */
enum { ES_SRGB_TABLE_SIZE = 4096 };
typedef struct es_srgb_table { uint32_t code[ES_SRGB_TABLE_SIZE]; } es_srgb_table;
void es_srgb_table_fill(es_srgb_table* table);

typedef struct es_compose_job {
    const es_gbuffer* gbuffer;
    const float* direct[3];       /* NULL: none */
    const float* irradiance[3];   /* indirect irradiance on the diffuse part, NULL: none */
    const float* specular[3];     /* indirect radiance reflected by the lobe, NULL: none */
    const uint8_t* lit;           /* where that may be lit (gi/lit.h) */
    const float* compensation[3]; /* further reflected indirect radiance, of either sign; NULL: none */
    const float* finished[3];     /* the radiance itself, in place of all of the above; NULL: it is to be made */
    float exposure_scale;         /* 2^stops */
    float white;                  /* Reinhard: the radiance that becomes 1 */
    uint32_t tone_map;            /* es_tone_map */
    uint32_t* xrgb;               /* sRGB-encoded, width words a row; NULL: not wanted */
    const es_srgb_table* srgb;    /* for xrgb */
    float* radiance[3];           /* before exposure, rows of gbuffer->stride; NULL: not wanted */
    float* indirect[3];           /* the indirect part of it; NULL: not wanted */
    float* display[3];            /* after the tone map, linear [0, 1]; NULL: not wanted */
} es_compose_job;

void es_compose(es_context* context, const es_compose_job* job);

#endif
