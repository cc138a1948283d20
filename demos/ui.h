/* A small immediate-mode user interface over a picture: panels are built anew in every frame, in the order in which they lie over each
 * other, and tell at once what was done to them. What lasts from frame to frame is who has the keyboard and who holds the mouse.
 *
 *     ui_begin(&ui, &input);                      // what the keyboard and the mouse do belongs to the interface or, by ui_game_input, to the rest
 *     ui_draw_on(&ui, &canvas);
 *     if (ui_panel_begin(&ui, "lights", rect, "Lights")) {
 *         if (ui_button(&ui, "off", 0, "Off")) …
 *         ui_next_row(&ui);
 *     }
 *     ui_panel_end(&ui);
 *     ui_end(&ui);
 *
 * Arrow keys move within a panel, Tab to the next one, Enter does what a click does, Escape leaves. */
#ifndef EARTHSHINE_DEMO_UI_H
#define EARTHSHINE_DEMO_UI_H

#include "canvas.h"
#include "ui_focus.h"

#include <earthshine/platform.h>

enum { UI_MAX_ITEMS = 1024, UI_MAX_PANELS = 16, UI_EDIT_SIZE = 64 };

/* Colours, light on dark over any picture. */
enum { UI_TEXT = 0xe8ecf0, UI_DIM = 0x98a2ae, UI_GROUND = 0x0e1217, UI_WIDGET = 0x2a323c, UI_HOVER = 0x3a4654, UI_ACCENT = 0x2f7fd0, UI_FOCUS = 0xffc04a, UI_CHANGED = 0xffd98a };

typedef struct ui_panel {
    ui_id id;
    canvas_rect rect;
} ui_panel;

typedef struct ui {
    demo_canvas* canvas;
    const es_window_input* input;
    int scale;            /* pixels of the canvas per pixel of the font */
    int larger;           /* what the user adds to it */
    ui_id focus, active, editing; /* keyboard; mouse; whose text is `edit` */
    ui_id hover_panel;    /* under the pointer */
    ui_id hover;          /* the widget there */
    bool holds_arrows;    /* the widget with the keyboard wants left and right for itself */
    bool escaped;         /* Escape ended something in this frame: it is nobody else's */
    char edit[UI_EDIT_SIZE];
    /* this frame's */
    ui_item items[UI_MAX_ITEMS];
    size_t item_count;
    ui_panel panels[UI_MAX_PANELS];
    size_t panel_count;
    ui_id panel, focus_panel, closing;
    bool edit_panel;            /* its first widget is a field to be typed into */
    int x, y, left, right, row; /* where the next widget goes; height of a row */
} ui;

/* Takes the frame's input. */
void ui_begin(ui* u, const es_window_input* input);
/* Chooses a scale that can be read at the canvas's size. */
void ui_draw_on(ui* u, demo_canvas* canvas);
void ui_end(ui* u);

/* The input without what belongs to the interface. */
es_window_input ui_game_input(const ui* u);
/* Whether the keyboard types into a field. */
bool ui_types(const ui* u);
/* Gives the keyboard to the first widget of the panel of that name when it is built next. */
void ui_focus_on(ui* u, const char* panel);
/* The same, and begins to type into it: it is a field. */
void ui_edit_on(ui* u, const char* panel);
void ui_drop_focus(ui* u);

/* False when the user closes it: Escape while it has the keyboard, or the cross of its title. It is to be ended all the same. title NULL: no
 * title and no cross. */
bool ui_panel_begin(ui* u, const char* name, canvas_rect rect, const char* title);
void ui_panel_end(ui* u);

/* ---- layout: widgets from left to right, row below row; sizes in characters ---- */

/* The next `columns` characters of the row; 0: all that is left; negative: all but that many. */
canvas_rect ui_take(ui* u, int columns);
void ui_next_row(ui* u);
int ui_columns(const ui* u); /* left in the row */

/* ---- for widgets ---- */
ui_id ui_make_id(const ui* u, const char* name);
/* Registers a widget that takes the keyboard. */
void ui_add_item(ui* u, ui_id id, canvas_rect rect);
bool ui_visible(const ui* u, canvas_rect rect);
/* The pointer is over it, or a press hit it in this frame. */
bool ui_points(ui* u, ui_id id, canvas_rect rect);
bool ui_pressed(ui* u, ui_id id, canvas_rect rect);
/* A key, while the widget has the keyboard; repeats count. */
bool ui_key(const ui* u, ui_id id, int key);

#endif
