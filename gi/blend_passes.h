/* The passes of blended surfaces: layers peeled from the camera's view (Everitt 2001) in front of the solid picture, nearest first; each lit as that is, by the same
 * kernels with the frame's lights and maps, within a rectangle around what they cover; every image composited by itself (gi/blend.h).
 *
 * A layer's normal is turned to the eye: a blended surface is thin, and the side that is seen is the one that is lit. */
#ifndef EARTHSHINE_GI_BLEND_PASSES_H
#define EARTHSHINE_GI_BLEND_PASSES_H

#include "gi/renderer.h"

/* Where the solid picture is to leave its depth: the range to draw it with. */
es_result es_blend_behind(es_renderer* renderer, es_depth_range* range, const es_depth_range** wanted);
es_result es_pass_blend_layers(es_renderer* renderer, const es_frame_inputs* in);
/* After all passes that make lights, maps and points. */
es_result es_pass_blend_light(es_renderer* renderer, const es_frame_inputs* in);
/* Sets what the layers of the frame add; nothing where there are none. */
void es_blend_compose(const es_renderer* renderer, es_compose_job* job);
/* Of the last frame: the layers' bounded indirect light of the first `lights` virtual point lights, or of micro-buffers as the points are lit now, composited, planes
 * for es_compose_layers.bounded. Untouched where there are no layers. */
es_result es_blend_bounded(es_renderer* renderer, uint32_t lights, es_planes* bounded);
void es_blend_layers_free(es_context* context, es_blend_layers* layers);

#endif
