/* Direct light of one light source on the camera's G-buffer, with its shadow map (slope-scaled bias, percentage-closer filter). */
#ifndef EARTHSHINE_GI_DIRECT_H
#define EARTHSHINE_GI_DIRECT_H

#include "gi/light_view.h"
#include "gi/screen/view_stack.h"

typedef struct es_direct_job {
    const es_gbuffer* gbuffer;
    es_pixel_rays rays;
    const es_light_view* view;
    uint32_t shadow_filter;        /* taps per side */
    float shadow_bias, shadow_slope_bias;
    /* what the depth bias leaves out of shadows, found in screen space (Ritschel thesis §4.5.1) */
    const es_screen_view* repair;  /* of that G-buffer; NULL: nothing is */
    uint32_t repair_samples;       /* of a segment towards the light as long as the bias, or, where that is longer, repair_least, metres */
    float repair_least;
    const float* edited[3];        /* where lobes reflect, rows of gbuffer->stride, (0, 0, 0) where they do as the law says (gi/edit/edit.h); NULL: everywhere */
    bool first;                    /* overwrite instead of adding */
    float* out[3];                 /* reflected radiance, rows of gbuffer->stride */
} es_direct_job;

void es_direct_light(es_context* context, const es_direct_job* job);

#endif
