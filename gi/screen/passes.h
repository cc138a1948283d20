/* Passes of the frame that work in screen space. */
#ifndef EARTHSHINE_GI_SCREEN_PASSES_H
#define EARTHSHINE_GI_SCREEN_PASSES_H

#include "gi/renderer.h"

/* Before visibility: what that draws is to say how deep it is. NULL: it need not. */
es_result es_screen_first_layer(es_renderer* renderer, es_depth_range* range, const es_depth_range** wanted);
/* Sets renderer->screen.stack: the camera's view, and what screen.layers and screen.cameras add to it. After visibility. */
es_result es_pass_screen_views(es_renderer* renderer, const es_frame_inputs* in);
/* Light of the environment with lamps screen and ambient. After the light of other lamps. */
es_result es_pass_screen_occlusion(es_renderer* renderer, const es_frame_inputs* in);
/* Direct light of the layers behind the camera's first, into es_screen_layer.direct: of light sources without a size. */
es_result es_screen_light_layers(es_renderer* renderer);
/* After all direct light. */
es_result es_pass_screen_bounce(es_renderer* renderer, const es_frame_inputs* in);
/* Sets the planes of lamps' light to those that hold the environment's as well, where the frame has such. */
void es_screen_compose(const es_renderer* renderer, es_compose_job* job);
void es_screen_reads(es_plan* plan);
/* 1 - the share of the environment's light that arrives, mean over channels; width floats a row; 0 where that was not asked for. */
void es_screen_occlusion_image(const es_renderer* renderer, float* pixels);
void es_screen_free_drawn(es_context* context, es_screen_buffers* buffers);
void es_screen_buffers_free(es_context* context, es_screen_buffers* buffers);

#endif
