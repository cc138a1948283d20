/* Indirect light at half the resolution (Sloan et al. 2007): one pixel of 2 × 2 is shaded and filtered, the others are interpolated from their
 * neighbours on the same surface.
 *
 * Pixel (X, Y) of the smaller image is pixel (2X, 2Y) of the whole one and has its depth and normal. A pixel of the whole image takes the
 * mean of the up to four smaller ones around it, (x/2 rounded down and up, y/2 likewise), that lie on what looks like its surface by the measures
 * of gi/filter.h; where none does, the one that comes nearest to it in depth and normal, each over its threshold. */
#ifndef EARTHSHINE_GI_HALF_RESOLUTION_H
#define EARTHSHINE_GI_HALF_RESOLUTION_H

#include "gi/gi.h"
#include "gi/pixel_rays.h"

/* Depth, both normals, albedo, surface and motion, in its own pixels, of every second pixel of every second row; `half` is reallocated when its size changes. */
es_result es_gbuffer_halve(es_context* context, const es_gbuffer* whole, es_gbuffer* half);
es_pixel_rays es_pixel_rays_halve(const es_pixel_rays* whole);

typedef struct es_upsample_job {
    const es_gbuffer* gbuffer;     /* depth and normal */
    const es_gbuffer* half;
    float depth_threshold, normal_threshold;
    uint32_t plane_count;          /* 1 … 6 */
    const float* source[6];        /* rows of half->stride */
    float* result[6];              /* rows of gbuffer->stride; 0 where nothing is seen */
} es_upsample_job;

void es_upsample(es_context* context, const es_upsample_job* job);

#endif
