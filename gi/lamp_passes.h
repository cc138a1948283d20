/* The passes of lamps: glowing surfaces and the environment as a set of lights (gi/lamps.h), their imperfect shadow maps, and their direct light in
 * planes of its own, shaded and filtered as indirect light is, at every pixel. */
#ifndef EARTHSHINE_GI_LAMP_PASSES_H
#define EARTHSHINE_GI_LAMP_PASSES_H

#include "gi/renderer.h"

/* Before the scene's points and the ray hierarchy, which the next two are asked for. */
es_result es_pass_lamps(es_renderer* renderer, const es_frame_inputs* in);
bool es_lamps_want_maps(const es_renderer* renderer);
bool es_lamps_want_rays(const es_renderer* renderer);
bool es_lamps_are_there(const es_renderer* renderer);
es_result es_pass_lamp_maps(es_renderer* renderer, const es_frame_inputs* in);
/* Shading and filter. */
es_result es_pass_lamp_light(es_renderer* renderer, const es_frame_inputs* in);
/* For es_shade_at_points, without pixels: of the frame that is being, or was last, rendered. */
es_shade_job es_lamps_at_points(const es_renderer* renderer);
/* The same light on a blended layer; the lights' set and maps are there. */
es_result es_lamps_light_layer(es_renderer* renderer, const es_lit_surfaces* surfaces, es_layer_light* light);
/* May something of the list reflect lamps' light otherwise than evenly? */
bool es_lamps_anything_specular(const es_draw_list* list);
/* Sets the planes of lamps' light. */
void es_lamps_compose(const es_renderer* renderer, es_compose_job* job);
void es_lamps_free_planes(es_context* context, es_lamp_light* lamps);
void es_lamp_light_free(es_context* context, es_lamp_light* lamps);

#endif
