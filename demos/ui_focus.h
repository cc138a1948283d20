/* Where the keyboard's focus goes: a function of where the widgets are. */
#ifndef EARTHSHINE_DEMO_UI_FOCUS_H
#define EARTHSHINE_DEMO_UI_FOCUS_H

#include "canvas.h"

#include <stddef.h>

typedef uint64_t ui_id; /* 0: none */

/* A widget that takes the keyboard. They stand in the order they were made: panel by panel, row by row. */
typedef struct ui_item {
    ui_id id, panel;
    canvas_rect rect;
} ui_item;

typedef enum ui_move { UI_MOVE_UP, UI_MOVE_DOWN, UI_MOVE_LEFT, UI_MOVE_RIGHT, UI_MOVE_NEXT_PANEL, UI_MOVE_PREVIOUS_PANEL } ui_move;

/* Up and down: the row before or after, and of it the widget most above or below this one; left and right: along the row; all within the
 * panel. The panels follow one another in a ring, each entered at its first widget. The widget itself where there is none that way, the
 * first of all when `from` is none or gone, 0 without any. */
ui_id ui_focus_move(const ui_item* items, size_t count, ui_id from, ui_move move);
/* 0 when the panel has none. */
ui_id ui_focus_first(const ui_item* items, size_t count, ui_id panel);
/* Its panel; 0 when there is no such widget. */
ui_id ui_focus_panel(const ui_item* items, size_t count, ui_id id);

#endif
