/* From virtual point lights to the picture's indirect light: shading, filter, and interpolation where only one pixel of four was shaded. Each
 * is a pass of the frame, and a function that can be had again for some of the lights (the images of single bounces). */
#ifndef EARTHSHINE_GI_INDIRECT_H
#define EARTHSHINE_GI_INDIRECT_H

#include "gi/renderer.h"

/* Irradiance of the diffuse part and radiance of the lobe; the latter is used when the frame has lobes. */
typedef struct es_indirect_planes { es_planes irradiance, specular; } es_indirect_planes;
void es_indirect_planes_free(es_context* context, es_indirect_planes* planes);

/* All with the settings of the frame that is being, or was last, rendered. Lights from `lights` on send nothing; the others are shaded as if
 * they did, so that the light of the first n is what any frame adds up before it comes to the rest. */
es_result es_indirect_shade(es_renderer* renderer, uint32_t lights, es_planes* irradiance, es_planes* specular);
/* es_renderer.filter_passes times, one at least; of micro-buffers' light the irradiance alone. */
es_result es_indirect_filter(es_renderer* renderer, const es_planes* irradiance, const es_planes* specular, es_planes* filtered_irradiance, es_planes* filtered_specular);
es_result es_indirect_upsample(es_renderer* renderer, const es_planes* irradiance, const es_planes* specular, es_planes* whole_irradiance, es_planes* whole_specular);

/* Shading and filter of a blended layer, at every pixel of it; lights as above. */
es_result es_indirect_shade_layer(es_renderer* renderer, const es_lit_surfaces* surfaces, uint32_t lights, es_layer_light* light);
es_result es_indirect_filter_layer(es_renderer* renderer, const es_lit_surfaces* surfaces, es_layer_light* light);

/* What that light is shaded, filtered and blended with last frame's on. */
const es_gbuffer* es_indirect_gbuffer(const es_renderer* renderer);
/* What last frame's light is to be blended with. */
void es_indirect_unblended(const es_renderer* renderer, const es_planes** irradiance, const es_planes** specular);
/* What the frame shows, after filter and interpolation. */
const es_planes* es_indirect_irradiance(const es_renderer* renderer);
const es_planes* es_indirect_specular(const es_renderer* renderer);

/* Has any pass left light in the renderer's planes? And what later passes read of those that may. */
bool es_indirect_is_there(const es_renderer* renderer);
void es_indirect_reads(es_plan* plan);
/* Why there is none; NULL: there is some. Once the lights are placed. */
const char* es_indirect_nothing(const es_renderer* renderer, const es_frame_inputs* in);
/* es_renderer_settings.spread, 0 where what is near is found in screen space: by bounds alone light is taken that pixels can find again, of what spread takes, which depends
 * on the light, they know nothing. */
float es_vpl_spread(const es_renderer_settings* settings);
/* At half the resolution? */
bool es_indirect_is_halved(const es_renderer_settings* settings);
/* May a surface of the frame have a lobe worth evaluating? Or a virtual point light? */
bool es_surfaces_have_lobes(const es_draw_list* list);
bool es_frame_has_lobes(const es_renderer* renderer, const es_draw_list* list);

es_result es_pass_shading(es_renderer* renderer, const es_frame_inputs* in);
es_result es_pass_filter(es_renderer* renderer, const es_frame_inputs* in);
es_result es_pass_upsample(es_renderer* renderer, const es_frame_inputs* in);

#endif
