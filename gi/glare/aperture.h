/* The plane of the pupil as the light meets it: how much of it each place lets through (Ritschel thesis §8.4.1).
 *
 * Shapes are drawn into one bit for each of supersample × supersample places of a pixel, by spans of words, and the bits of a pixel are counted: a
 * pixel's transmittance is a multiple of 1 / supersample². A place is inside of a shape when its middle is. */
#ifndef EARTHSHINE_GI_GLARE_APERTURE_H
#define EARTHSHINE_GI_GLARE_APERTURE_H

#include "gi/glare/eye.h"
#include "gi/glare/eye_shapes.h"

enum { ES_APERTURE_MAX_SIZE = 8192 };

/* Transmittance 0 … 1 of the plane of the pupil: size × size floats, row-major, top row first; pixel (x, y) covers [x, x + 1) × [y, y + 1) · width / size
 * metres, the plane's middle at its centre. Zero-initialised there is none; drawn again it is allocated anew where its size differs. */
typedef struct es_aperture {
    uint32_t size;             /* pixels */
    float width;               /* metres */
    float* transmittance;
} es_aperture;

/* size 1 … ES_APERTURE_MAX_SIZE, width in metres above 0 and finite, supersample 1, 2, 4 or 8: INVALID_ARGUMENT otherwise. OUT_OF_MEMORY, MEMORY_CAP: the
 * aperture is as it was, or empty. The same bits for any number of threads. */
es_result es_aperture_draw(es_context* context, const es_eye* eye, uint32_t size, float width, uint32_t supersample, es_aperture* aperture);
/* The same of any shapes. */
es_result es_aperture_draw_shapes(es_context* context, const es_eye_shapes* shapes, uint32_t size, float width, uint32_t supersample, es_aperture* aperture);
void es_aperture_free(es_context* context, es_aperture* aperture);

#endif
