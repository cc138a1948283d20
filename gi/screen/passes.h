/* Passes of the frame that work in screen space. */
#ifndef EARTHSHINE_GI_SCREEN_PASSES_H
#define EARTHSHINE_GI_SCREEN_PASSES_H

#include "gi/renderer.h"

/* Sets renderer->screen.stack: the camera's view, and what screen.layers and screen.cameras add to it. After visibility. */
es_result es_pass_screen_views(es_renderer* renderer, const es_frame_inputs* in);
/* After all direct light. */
es_result es_pass_screen_bounce(es_renderer* renderer, const es_frame_inputs* in);
void es_screen_buffers_free(es_context* context, es_screen_buffers* buffers);

#endif
