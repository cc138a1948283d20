/* The passes of micro-buffers: what ES_GI_MICRO has in place of lights, maps and shading. Their light goes to the renderer's planes, `irradiance` and
 * `specular`, at every pixel, from where the filter (diffuse light, when it is gathered at every pixel), history and
 * composition take it.
 *
 * With `temporal` each frame's buffers are turned otherwise. While nothing changes, frame k of these has turn k and the mean over all turns since is
 * what is blended with last frame's light, so that a settled picture is the mean over temporal_settle frames, whatever was before. With
 * anti-aliasing a turn goes with each place inside of the pixels. */
#ifndef EARTHSHINE_GI_MICRO_PASSES_H
#define EARTHSHINE_GI_MICRO_PASSES_H

#include "gi/renderer.h"

/* Why nothing is gathered, NULL: there is something. */
const char* es_micro_nothing(const es_frame_inputs* in, const es_renderer_settings* settings);
/* Of the virtual point lights that light the points, if they do: how many bounces they make. 0: there are none. */
uint32_t es_micro_vpl_bounces(const es_renderer_settings* settings);

/* Are points lit by photons, which are traced through the ray hierarchy? */
bool es_micro_wants_photons(const es_renderer_settings* settings);

/* After the shadow maps. Hierarchy, then light. */
es_result es_pass_points(es_renderer* renderer, const es_frame_inputs* in);
/* Gathering and interpolation. */
es_result es_pass_micro(es_renderer* renderer, const es_frame_inputs* in);
/* Gathering and interpolation for a blended layer; the points are lit. Its buffers are turned as those of a single picture are, over frames as well. */
es_result es_micro_light_layer(es_renderer* renderer, const es_lit_surfaces* surfaces, es_layer_light* light);
/* Of the last frame: how many bounces its light has, and the reflected light of the first so many, without that of frames before; the points are lit again
 * for it. With emission, what glows is seen by the first. */
uint32_t es_micro_bounces(const es_renderer* renderer);
es_result es_micro_first_bounces(es_renderer* renderer, uint32_t bounces, es_planes* indirect);
es_micro_settings es_micro_settings_of(const es_renderer_settings* settings);
/* Where the last frame gathers for a pixel, with every pixel gathered at; false where it does not. */
bool es_micro_point_of_frame(const es_renderer* renderer, uint32_t x, uint32_t y, uint32_t kind, es_gather_point* point);
void es_micro_free_planes(es_context* context, es_micro_buffers* micro);
void es_micro_free(es_context* context, es_micro_buffers* micro);

#endif
