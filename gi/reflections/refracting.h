/* Where light leaves glass that the picture shows: a ray for each pixel, through the thing and out (gi/reference/refraction.h). */
#ifndef EARTHSHINE_GI_REFLECTIONS_REFRACTING_H
#define EARTHSHINE_GI_REFLECTIONS_REFRACTING_H

#include "gi/renderer.h"

/* Does the list have a thing that lets light through? */
bool es_has_glass(const es_draw_list* list);
/* After the hierarchy. Fills es_reflections.on_glass, glass_position and, where constraints edit it, glass_edited. */
es_result es_pass_refracting(es_renderer* renderer, const es_frame_inputs* in, es_world* world);
/* What is seen where light leaves, added to es_reflections.light. Adds the rays traced. */
es_result es_add_refractions(es_renderer* renderer, const es_frame_inputs* in, const es_reflection_atlas* atlas, uint64_t* rays);

#endif
