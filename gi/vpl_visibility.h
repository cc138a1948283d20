/* Exact visibility between pixels and virtual point lights: a ray for each pair that face each other. What shadow maps of any kind are
 * judged by. */
#ifndef EARTHSHINE_GI_VPL_VISIBILITY_H
#define EARTHSHINE_GI_VPL_VISIBILITY_H

#include "gi/reference/scene.h"
#include "gi/shade.h"

/* How far off a pixel's or a light's triangle rays begin and end, share of the world's extent: positions in a G-buffer come from a depth and
 * are off their triangle by some 1e-6 of the distance to the eye. */
#define ES_RAY_OFFSET_SHARE 1e-5f

typedef struct es_vpl_visibility {
    es_shade_visibility shade;         /* for es_shade_job.visibility; first, so that a pointer to it is one to this */
    const es_trace_scene* scene;
    const es_vpl_record* vpls;
    es_vec3* ends;                     /* of the rays, per light: off its triangle on the side the light came from */
} es_vpl_visibility;

/* `extent` is the diagonal of the world. Valid as long as the scene, the records and what was allocated from the arena. */
es_result es_vpl_visibility_prepare(es_arena* arena, const es_trace_scene* scene, const es_vpl_record* vpls, uint32_t count, float extent, es_vpl_visibility* visibility);

#endif
