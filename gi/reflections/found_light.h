/* Light of surfaces that are not the picture's: faces of reflection maps, and what rays have met. */
#ifndef EARTHSHINE_GI_REFLECTIONS_FOUND_LIGHT_H
#define EARTHSHINE_GI_REFLECTIONS_FOUND_LIGHT_H

#include "gi/renderer.h"

typedef struct es_found_surfaces {
    const es_gbuffer* gbuffer;      /* all that lights want of it: depth, normals, albedo, surface, emission */
    es_pixel_rays rays;
    const uint32_t* mirrors;        /* not 0: the surface's lobe shows neither lamps nor indirect light; NULL: all do */
    const float* background[3];     /* radiance where depth is 0; NULL: none */
    float* radiance[3];             /* out, W/(m² sr) towards where they are seen from */
} es_found_surfaces;

/* Direct light with the frame's shadow maps, its lamps, indirect light by its method, emission; without what screen space and rays find besides. */
es_result es_light_found(es_renderer* renderer, const es_frame_inputs* in, const es_found_surfaces* surfaces, es_found_light* light);
void es_found_light_free(es_context* context, es_found_light* light);

#endif
