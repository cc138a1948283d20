/* Which virtual point lights the camera's picture needs most.
 *
 * Of N lights drawn with probability p, the picture's summed squared error falls fastest when p is proportional to the root mean
 * square, over the pixels, of what a light at that place would add to them (the minimum of sum c² / p under sum p = 1). Here that
 * is estimated without visibility from a grid of pixels; places next to visible surfaces, whose light changes within
 * centimetres, get many lights, and places that light nothing in view few. Segovia et al. 2006 ("Bidirectional Instant
 * Radiosity") pursue the same end by tracing from the camera.
 */
#ifndef EARTHSHINE_GI_VIEW_IMPORTANCE_H
#define EARTHSHINE_GI_VIEW_IMPORTANCE_H

#include "gi/pixel_rays.h"

enum { ES_RECEIVER_GRID = 32, ES_RECEIVERS_MAX = ES_RECEIVER_GRID * ES_RECEIVER_GRID };

typedef struct es_receivers {
    uint32_t count;                /* a multiple of eight; what is left over has weight 0 */
    float x[ES_RECEIVERS_MAX], y[ES_RECEIVERS_MAX], z[ES_RECEIVERS_MAX];
    float nx[ES_RECEIVERS_MAX], ny[ES_RECEIVERS_MAX], nz[ES_RECEIVERS_MAX];
    float weight[ES_RECEIVERS_MAX]; /* luminance of what the surface reflects, lobe included */
    float softening;               /* m², added to d²: about the squared distance between receivers */
} es_receivers;

typedef struct es_sender { float position[3], normal[3]; } es_sender;

/* From the camera's G-buffer, in a fixed grid. */
void es_receivers_collect(es_receivers* receivers, const es_gbuffer* gbuffer, const es_pixel_rays* rays, float softening);

#endif
