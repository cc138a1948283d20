/* What stands in the light's way in the plane of the pupil: plain shapes, whatever part of the eye they are of.
 *
 * Millimetres, x to the subject's left as who looks out sees it to the right, y up, (0, 0) the pupil's middle. */
#ifndef EARTHSHINE_GI_GLARE_EYE_SHAPES_H
#define EARTHSHINE_GI_GLARE_EYE_SHAPES_H

#include "platform/platform.h"

enum { ES_EYE_MOST_DISCS = 2048, ES_EYE_MOST_QUADS = 2048 };

typedef struct es_eye_disc { float x, y, radius; } es_eye_disc;
/* Convex, corners in order, either way round; a corner may be there twice. */
typedef struct es_eye_quad { es_vec2 corner[4]; } es_eye_quad;

typedef struct es_eye_shapes {
    float pupil;               /* radius of the disc that lets light through; all others take from it */
    bool lids;
    float upper, lower;        /* y of their edges at x = 0 */
    float upper_bend, lower_bend; /* 1/mm: light passes where lower + lower_bend x² < y < upper - upper_bend x²; not below 0 */
    uint32_t disc_count, quad_count;
    es_eye_disc discs[ES_EYE_MOST_DISCS];
    es_eye_quad quads[ES_EYE_MOST_QUADS];
} es_eye_shapes;

/* Without effect where there is no room. */
static inline void es_eye_add_disc(es_eye_shapes* shapes, float x, float y, float radius)
{
    if (shapes->disc_count < ES_EYE_MOST_DISCS) shapes->discs[shapes->disc_count++] = (es_eye_disc){x, y, radius};
}

/* A thick line from `a` to `b`, cut off square, as wide as twice `from` and `to` at its ends. */
void es_eye_add_line(es_eye_shapes* shapes, es_vec2 a, es_vec2 b, float from, float to);

#endif
