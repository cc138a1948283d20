/* The passes of reflections: which way reflecting pixels look, the maps, and what is seen in them; and of what is seen through glass (gi/reflections/refracting.h), which
 * has a map as reflecting things do.
 *
 * A thing reflects when its material has a lobe and is no rougher than es_renderer_settings.reflection_roughness. Of maps it has one, drawn from the middle of its
 * bounds without it, of what light meets (blended surfaces as masked), lit as the picture is: direct light with its shadow maps, lamps and indirect light by the frame's
 * method, at every texel, without what screen space and rays find besides (as layers of blended surfaces, gi/blend_passes.c). It is drawn again when what its faces see, its place, or light
 * has changed. What another thing with a map reflects in it is looked up in that thing's map as it is without second reflections, and no wider than level 1: two mirrors show
 * each other once.
 *
 * At pixels that reflect, the radiance times the lobe's directional albedo takes the place of what the lobe reflects of lamps, virtual point lights and micro-buffers.
 * Highlights of spot, point and directional lights stay: these have no size and are in no map. Glowing surfaces and the environment are in the maps, and counted once. */
#ifndef EARTHSHINE_GI_REFLECTIONS_REFLECTION_PASSES_H
#define EARTHSHINE_GI_REFLECTIONS_REFLECTION_PASSES_H

#include "gi/renderer.h"

/* After visibility: chooses what has maps, and finds original directions. */
es_result es_pass_reflecting(es_renderer* renderer, const es_frame_inputs* in);
/* After the light of the picture. */
es_result es_pass_reflection_maps(es_renderer* renderer, const es_frame_inputs* in);
/* What is seen along original directions, or along edited ones. */
es_result es_pass_reflections(es_renderer* renderer, const es_frame_inputs* in);
/* Once directions are found: are they followed by rays? */
bool es_reflections_want_rays(const es_renderer* renderer);
/* The job's part of it. */
void es_reflections_compose(const es_renderer* renderer, es_compose_job* job);
void es_reflections_read(es_plan* plan);
/* Of the picture's size; all. */
void es_reflections_free_planes(es_context* context, es_reflections* reflections);
void es_reflections_free(es_context* context, es_reflections* reflections);

#endif
