/* The faces of a reflection map: drawn, lit, and put into it (gi/reflections/reflection_passes.h). */
#ifndef EARTHSHINE_GI_REFLECTIONS_MAP_FACES_H
#define EARTHSHINE_GI_REFLECTIONS_MAP_FACES_H

#include "gi/renderer.h"

/* Hash of what the map's faces would show of things, without their light. Makes es_reflections.others. 0 after a failure. */
uint64_t es_reflection_content(es_renderer* renderer, const es_frame_inputs* in, const es_reflection_map* map);
/* Draws and lights the map's faces into level 0, and lists its second reflections. Makes es_reflections.others. Adds to the triangles drawn. */
es_result es_reflection_draw(es_renderer* renderer, const es_frame_inputs* in, uint32_t map, uint64_t* triangles);

/* Of all maps: what they show of each other, and their other levels. */
es_result es_reflection_finish_all(es_renderer* renderer);

es_result es_reflecting_buffers_resize(es_context* context, es_reflecting_buffers* buffers, const es_gbuffer* gbuffer);
void es_reflecting_buffers_free(es_context* context, es_reflecting_buffers* buffers);
void es_second_reflections_free(es_context* context, es_second_reflections* second);

#endif
