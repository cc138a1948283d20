/* What `play` draws over the picture, on 0x00RRGGBB words, top row first. */
#ifndef EARTHSHINE_DEMO_OVERLAY_H
#define EARTHSHINE_DEMO_OVERLAY_H

#include "canvas.h"
#include "demo.h"

void demo_draw_vpls(demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth);
void demo_draw_points(
    demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth, uint32_t map);
/* Any image of the renderer as something to look at: radiance tone-mapped, depth as grey, normals and ids as colours. */
void demo_draw_image(demo_canvas* canvas, const es_image* image, const char* name, float exposure);

#endif
