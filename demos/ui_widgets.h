/* Widgets: labels, buttons, switches, sliders, fields of text, areas that scroll. Each is named within its panel; its place is the next of
 * the row, `columns` characters wide as ui_take has it. */
#ifndef EARTHSHINE_DEMO_UI_WIDGETS_H
#define EARTHSHINE_DEMO_UI_WIDGETS_H

#include "ui.h"

void ui_label(ui* u, int columns, uint32_t colour, const char* text);
/* Broken into rows between words; returns how many. `draw` false only counts. */
int ui_paragraph(ui* u, uint32_t colour, const char* text, bool draw);
/* True when it is clicked or Enter is pressed on it. */
bool ui_button(ui* u, const char* name, int columns, const char* text);
/* A button that shows whether what it switches is on. */
bool ui_switch(ui* u, const char* name, int columns, const char* text, bool on);

/* What was done to a slider. */
typedef enum ui_slider_act {
    UI_SLIDER_NOTHING,
    UI_SLIDER_MOVED,  /* *fraction is new */
    UI_SLIDER_STEPPED, /* *steps says how far: arrow keys, ten with Shift; the wheel */
    UI_SLIDER_TYPED,  /* ui.edit holds the text */
    UI_SLIDER_RESET   /* Delete */
} ui_slider_act;
/* A bar filled up to *fraction, 0 … 1, with a text on it. Home and End move to its ends, Enter begins to type a value. */
ui_slider_act ui_slider(ui* u, const char* name, int columns, float* fraction, int* steps, const char* text, uint32_t colour);
/* True when the text has changed. A click or Enter begins to type, Enter, up, down or Escape end it. `hint` shows while it is empty. */
bool ui_field(ui* u, const char* name, int columns, char* text, size_t size, const char* hint);

typedef struct ui_scroll {
    int offset, content; /* pixels scrolled away; height of what is in it */
    canvas_rect area, former_clip;
    int right;
    size_t first_item;
    ui_id followed;      /* the focus it has shown: the wheel may leave it behind */
} ui_scroll;
/* An area of the panel `height` pixels high that shows a part of what is made until ui_scroll_end. */
void ui_scroll_begin(ui* u, ui_scroll* scroll, int height);
void ui_scroll_end(ui* u, ui_scroll* scroll, const char* name);

#endif
