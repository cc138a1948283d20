/* Steps of the frame that more than one file takes. */
#ifndef EARTHSHINE_GI_PASSES_H
#define EARTHSHINE_GI_PASSES_H

#include "gi/renderer.h"

/* What is closer to a light than this is its own surface: the position comes from a texel's centre and the normal is interpolated, so
 * neighbouring triangles may rise a little above its horizon. Metres. */
float es_near_distance(const es_frame_inputs* in);
/* Room for so many; those that stood are gone where there was less. */
es_result es_reserve_vpls(es_renderer* renderer, uint32_t count);
/* Have virtual point lights imperfect shadow maps? Of micro-buffers, those that light the points. */
bool es_draws_imperfect_maps(const es_renderer_settings* settings);
/* Shadow maps of the lights [first, end). Of imperfect ones the frame's first have `first` 0 and reserve `room` for all bounces; classic ones
 * need es_renderer.maps to have it. */
es_result es_draw_imperfect_maps(es_renderer* renderer, const es_frame_inputs* in, uint32_t first, uint32_t end, uint32_t room);
es_result es_draw_classic_maps(es_renderer* renderer, const es_frame_inputs* in, uint32_t first, uint32_t end);

#endif
