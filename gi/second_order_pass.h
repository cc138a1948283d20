/* The pass of second-order illumination (gi/second_order.h). */
#ifndef EARTHSHINE_GI_SECOND_ORDER_PASS_H
#define EARTHSHINE_GI_SECOND_ORDER_PASS_H

#include "gi/renderer.h"

es_result es_pass_second_order(es_renderer* renderer, const es_frame_inputs* in);
/* The lights of the frame on a blended layer, at every pixel of it: what negative ones take is taken from what the others send. */
es_result es_second_order_light_layer(es_renderer* renderer, const es_lit_surfaces* surfaces, es_layer_light* light);
void es_second_order_free(es_context* context, es_second_order_buffers* buffers);

#endif
