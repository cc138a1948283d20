/* What `play` draws over the picture, on 0x00RRGGBB words, top row first. */
#ifndef EARTHSHINE_DEMO_OVERLAY_H
#define EARTHSHINE_DEMO_OVERLAY_H

#include "demo.h"

typedef struct demo_canvas {
    uint32_t* pixels;
    uint32_t width, height;
} demo_canvas;

/* font.c: white-space is left out, the ground under the text is darkened; (x, y) is the top left of the first letter. */
void demo_draw_text(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, const char* text);
void demo_draw_dot(demo_canvas* canvas, int x, int y, int size, uint32_t colour);

/* overlay.c */
void demo_draw_vpls(demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth);
void demo_draw_points(
    demo_canvas* canvas, es_renderer* renderer, const es_raster_view* view, const es_image* depth, uint32_t map);
void demo_draw_timings(demo_canvas* canvas, const es_renderer* renderer, double frame_milliseconds);
void demo_draw_help(demo_canvas* canvas);
/* Any image of the renderer as something to look at: radiance tone-mapped, depth as grey, normals and ids as colours. */
void demo_draw_image(demo_canvas* canvas, const es_image* image, const char* name, float exposure);

#endif
