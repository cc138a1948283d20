/* The pass that finds where edited reflections go (gi/edit/edit.h), for whatever evaluates lobes or looks into mirrors after it. */
#ifndef EARTHSHINE_GI_EDIT_EDIT_PASS_H
#define EARTHSHINE_GI_EDIT_EDIT_PASS_H

#include "gi/edit/field.h"
#include "gi/renderer.h"

es_result es_pass_edits(es_renderer* renderer, const es_frame_inputs* in, const es_world* world);
/* Planes of the picture's edited directions; edited[k] NULL: none is. */
void es_edited_reflections(const es_renderer* renderer, const float* edited[3]);
/* Is something to be edited where light leaves what refracts it? */
bool es_edits_refraction(const es_renderer* renderer, const es_world* world);
/* Of directions in which light leaves: rows of the G-buffer's stride, (0, 0, 0) where there are none; `edited` likewise where they stand. `original` says which they are for
 * constraints. */
es_result es_edit_refraction(es_renderer* renderer, const es_frame_inputs* in, const es_world* world, es_edit_original original, const void* user, const float* const directions[3], float* const edited[3]);
void es_edit_buffers_free(es_context* context, es_edit_buffers* buffers);

#endif
