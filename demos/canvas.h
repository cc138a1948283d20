/* A picture in memory that overlays and widgets draw into: rectangles, lines, text, all cut off at a clip rectangle. */
#ifndef EARTHSHINE_DEMO_CANVAS_H
#define EARTHSHINE_DEMO_CANVAS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct canvas_rect { int x, y, width, height; } canvas_rect;

typedef struct demo_canvas {
    uint32_t* pixels; /* 0x00RRGGBB, top row first */
    uint32_t width, height;
    canvas_rect clip;
} demo_canvas;

bool canvas_inside(canvas_rect rect, int x, int y);
canvas_rect canvas_intersect(canvas_rect a, canvas_rect b); /* width or height 0 when they do not meet */

void canvas_clip_all(demo_canvas* canvas);
/* The clip becomes what it shares with `rect`; returns the former one, to be set again. */
canvas_rect canvas_narrow_clip(demo_canvas* canvas, canvas_rect rect);

void canvas_fill(demo_canvas* canvas, canvas_rect rect, uint32_t colour);
/* share: of the colour, 0 … 256; the rest shows through. */
void canvas_blend(demo_canvas* canvas, canvas_rect rect, uint32_t colour, uint32_t share);
void canvas_frame(demo_canvas* canvas, canvas_rect rect, int thickness, uint32_t colour);
/* From column to column of a plot: a line of any slope, `size` pixels thick. */
void canvas_line(demo_canvas* canvas, int x0, int y0, int x1, int y1, int size, uint32_t colour);
/* A square of `size` pixels. */
void canvas_dot(demo_canvas* canvas, int x, int y, int size, uint32_t colour);
/* UTF-8; at most `columns` characters, the last of which is an ellipsis when there are more. */
void canvas_text(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, const char* text, int columns);
/* The same over a darkened strip: legible on every picture. */
void canvas_label(demo_canvas* canvas, int x, int y, int scale, uint32_t colour, const char* text);

#endif
