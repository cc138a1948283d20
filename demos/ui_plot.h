/* Values of the last frames, and their curve. */
#ifndef EARTHSHINE_DEMO_UI_PLOT_H
#define EARTHSHINE_DEMO_UI_PLOT_H

#include "canvas.h"

#include <stddef.h>

enum { UI_PLOT_LENGTH = 240 };

typedef struct ui_series {
    float values[UI_PLOT_LENGTH]; /* a ring */
    uint32_t next, count;
} ui_series;

void ui_series_add(ui_series* series, float value);
/* age 0 is the newest; 0 where there is none. */
float ui_series_at(const ui_series* series, uint32_t age);
/* The newest by a format of one double; "-" where there is none or it is not finite: not measured yet. */
void ui_series_text(const ui_series* series, const char* format, char* text, size_t size);
float ui_series_largest(const ui_series* series);
float ui_series_mean(const ui_series* series);
/* The newest at the right edge; `top` is the value at the upper edge. What is not finite is left out. */
void ui_plot(demo_canvas* canvas, canvas_rect rect, const ui_series* series, float top, int thickness, uint32_t colour);
/* The smallest 1, 2 or 5 times a power of ten that is not below the value: a plot's upper edge that rests. */
float ui_plot_top(float value);

#endif
