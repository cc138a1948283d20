/* Compositing of layers (Porter and Duff 1984, `over`), nearest first: of n layers with alpha a_i each image is
 *     C = sum of T_i a_i C_i + T_n C_behind,   T_0 = 1,   T_(i+1) = T_i (1 - a_i),
 * which is C = a C_layer + (1 - a) C_behind from the last to the first. Every image of the light is composited by itself with the same weights, so that sums of
 * images stay sums. */
#ifndef EARTHSHINE_GI_BLEND_H
#define EARTHSHINE_GI_BLEND_H

#include "platform/context.h"

/* A rectangle of the planes: its first pixel is what the pointers point at, all with rows of `stride`; columns a multiple of eight. */
typedef struct es_blend_job {
    const float* alpha;            /* 0 where the layer is not */
    float* transmittance;          /* T_i; in and out with `through` */
    const float* layer[3];         /* an image of the layer; NULL: none is added */
    float* sum[3];                 /* premultiplied, in and out */
    bool through;                  /* afterwards go on to what is behind: T_(i+1) */
    uint32_t columns, rows, stride;
} es_blend_job;

void es_blend(es_context* context, const es_blend_job* job);

#endif
