/* What is behind everything: the environment in the pixels where nothing is seen, as the reference sees it (es_trace_environment), texel by texel. */
#ifndef EARTHSHINE_GI_BACKGROUND_H
#define EARTHSHINE_GI_BACKGROUND_H

#include "gi/pixel_rays.h"
#include "platform/context.h"
#include "sim/sim.h"

typedef struct es_background_job {
    const es_gbuffer* gbuffer;            /* depth; its motion is written where nothing is seen and `moving` */
    es_pixel_rays rays;
    const es_environment_desc* environment;
    bool moving;                          /* the view turned since last frame */
    float last_pixel[3][3];               /* a direction's pixel then: rows x w, y w, w */
    float* out[3];                        /* radiance, rows of the G-buffer's stride; 0 where something is seen */
} es_background_job;

void es_background_fill(es_context* context, const es_background_job* job);
/* Sets `moving` and `last_pixel`. */
void es_background_motion(const es_raster_view* view, es_background_job* job);

#endif
