/* Moves of the keyboard's focus over the widgets of a frame. */
#include "ui_focus.h"

#include <stdlib.h>

static const ui_item* find(const ui_item* items, size_t count, ui_id id)
{
    for (size_t i = 0; i < count; i++)
        if (items[i].id == id) return &items[i];
    return NULL;
}

ui_id ui_focus_panel(const ui_item* items, size_t count, ui_id id)
{
    const ui_item* item = id ? find(items, count, id) : NULL;
    return item ? item->panel : 0;
}

ui_id ui_focus_first(const ui_item* items, size_t count, ui_id panel)
{
    for (size_t i = 0; i < count; i++)
        if (items[i].panel == panel) return items[i].id;
    return 0;
}

static bool same_row(const ui_item* a, const ui_item* b) { return a->panel == b->panel && abs(a->rect.y - b->rect.y) < a->rect.height / 2 + 1; }
static int aside(const ui_item* a, const ui_item* b) { return abs(2 * a->rect.x + a->rect.width - 2 * b->rect.x - b->rect.width); }

/* The next item that way in the order of making, which is row by row: what is scrolled away lies anywhere, also over the others. */
static const ui_item* neighbour(const ui_item* items, size_t count, const ui_item* from, int way)
{
    for (const ui_item* item = from + way; item >= items && item < items + count; item += way)
        if (item->panel == from->panel) return item;
    return NULL;
}

static ui_id move_within(const ui_item* items, size_t count, const ui_item* from, ui_move move)
{
    int way = move == UI_MOVE_DOWN || move == UI_MOVE_RIGHT ? 1 : -1;
    const ui_item* next = neighbour(items, count, from, way);
    if (move == UI_MOVE_LEFT || move == UI_MOVE_RIGHT) return next && same_row(from, next) ? next->id : from->id;
    while (next && same_row(from, next)) next = neighbour(items, count, next, way);
    if (!next) return from->id;
    const ui_item* best = next;
    for (const ui_item* item = next; item && same_row(next, item); item = neighbour(items, count, item, way))
        if (aside(item, from) < aside(best, from)) best = item;
    return best->id;
}

/* The panel made after, or before, in a ring. */
static ui_id neighbour_panel(const ui_item* items, size_t count, ui_id panel, bool next)
{
    ui_id first = 0, last = 0, before = 0, after = 0;
    bool passed = false;
    for (size_t i = 0; i < count; i++) {
        if (items[i].panel == last) continue;
        if (!first) first = items[i].panel;
        if (items[i].panel == panel) before = last, passed = true;
        else if (passed && !after) after = items[i].panel;
        last = items[i].panel;
    }
    if (next) return after ? after : first;
    return before ? before : last;
}

ui_id ui_focus_move(const ui_item* items, size_t count, ui_id from, ui_move move)
{
    if (!count) return 0;
    const ui_item* item = from ? find(items, count, from) : NULL;
    if (!item) return items[0].id;
    if (move == UI_MOVE_NEXT_PANEL || move == UI_MOVE_PREVIOUS_PANEL)
        return ui_focus_first(items, count, neighbour_panel(items, count, item->panel, move == UI_MOVE_NEXT_PANEL));
    return move_within(items, count, item, move);
}
