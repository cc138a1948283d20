/* An accurate shadow map for a virtual point light: what imperfect ones are judged by (Ritschel thesis §5.4). */
#ifndef EARTHSHINE_GI_CLASSIC_H
#define EARTHSHINE_GI_CLASSIC_H

#include "gi/gi.h"
#include "gi/vpl.h"

/* Rasterizes the triangles into the five faces of a half cube about the light's normal, each of 2·size² texels so that no
 * direction is coarser than in the parabolic map, and resamples them into map[size²] (raster/points.h says how depths are
 * stored). `scratch` holds es_classic_scratch_floats(size) floats. */
es_result es_classic_map_draw(es_rasterizer* rasterizer, const es_draw_list* list, const es_vpl_record* vpl, uint32_t size, float near_distance, float far_distance, float* scratch, uint16_t* map);
size_t es_classic_scratch_floats(uint32_t size);

#endif
