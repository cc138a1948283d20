/* Reflections by rays: from each reflecting pixel one ray, or where the lobe is wide several by the lobe's visible normals (Heitz 2018), to what they meet, which is lit as the
 * picture is (gi/reflections/found_light.h). What mirrors in them show is found by one more ray each; mirrors in those show lights alone. Of several rays a pixel shows the mean by
 * weight, times the lobe's directional albedo: evenly bright surroundings are without noise. Their places are the same in each frame. */
#ifndef EARTHSHINE_GI_REFLECTIONS_TRACED_H
#define EARTHSHINE_GI_REFLECTIONS_TRACED_H

#include "gi/renderer.h"

/* Where rays begin. */
typedef struct es_traced_source {
    const es_gbuffer* gbuffer;      /* depth, normals, albedo, surface */
    es_pixel_rays rays;
    const es_reflecting_planes* planes;
    const float* edited[3];         /* as es_reflected_job.edited: the lobe turns with its middle */
    es_layer_rectangle rectangle;   /* outside of it nothing reflects */
    uint32_t level;                 /* 0: the picture; 1: what its rays have met */
    uint32_t rays_per_pixel;        /* where lobes are wide */
} es_traced_source;

/* out: reflected radiance, rows of the source's G-buffer, in the rectangle. Adds the rays traced but for shadows. */
es_result es_trace_reflections(es_renderer* renderer, const es_frame_inputs* in, const es_traced_source* source, float* const out[3], uint64_t* rays);
void es_traced_level_free(es_context* context, es_traced_level* level);
/* Of what reflects in a G-buffer of that size: columns and rows in steps of 32; none: all zero. */
es_layer_rectangle es_reflecting_rectangle(const es_gbuffer* gbuffer, const es_reflecting_planes* planes);

#endif
