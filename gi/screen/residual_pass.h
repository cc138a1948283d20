/* The pass of bias compensation in screen space. */
#ifndef EARTHSHINE_GI_SCREEN_RESIDUAL_PASS_H
#define EARTHSHINE_GI_SCREEN_RESIDUAL_PASS_H

#include "gi/renderer.h"

/* Why what bounds take is not found in screen space; NULL: it is. Then they take it as Novák has it: by vpl.bound alone, without vpl.spread. */
const char* es_residual_nothing(const es_renderer_settings* settings);
es_result es_pass_residual(es_renderer* renderer, const es_frame_inputs* in);
/* Steps that the frame has, 0 … ES_RESIDUAL_STEPS. */
uint32_t es_residual_steps(const es_renderer* renderer);
void es_residual_buffers_free(es_context* context, es_residual_buffers* buffers);

#endif
