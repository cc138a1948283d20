/* The interface's core: who has keyboard and mouse, panels, where widgets go. */
#include "ui.h"
#include "font.h"

#include <string.h>

static uint64_t hash_name(uint64_t hash, const char* name)
{
    for (; *name; name++) hash = (hash ^ (unsigned char)*name) * 0x100000001b3u;
    return hash ? hash : 1;
}

ui_id ui_make_id(const ui* u, const char* name) { return hash_name(u->panel ^ 0xcbf29ce484222325u, name); }
static ui_id panel_id(const char* name) { return hash_name(0xcbf29ce484222325u, name); }

void ui_begin(ui* u, const es_window_input* input)
{
    u->input = input;
    u->escaped = false;
    u->closing = 0;
    u->hover_panel = 0;
    int x = (int)input->mouse_x, y = (int)input->mouse_y;
    if (input->mouse_pressed[0]) x = (int)input->press_x[0], y = (int)input->press_y[0];
    for (size_t i = 0; i < u->panel_count; i++)
        if (canvas_inside(u->panels[i].rect, x, y)) u->hover_panel = u->panels[i].id;
    if (input->mouse_pressed[0] && !u->hover_panel) ui_drop_focus(u); /* into the picture */
    if (!input->mouse_down[0] && !input->mouse_pressed[0]) u->active = 0;
    if (!input->pressed[ES_KEY_ESCAPE] || !u->focus) return;
    u->escaped = true;
    if (u->editing) u->editing = 0;
    else u->closing = ui_focus_panel(u->items, u->item_count, u->focus);
}

void ui_draw_on(ui* u, demo_canvas* canvas)
{
    u->canvas = canvas;
    canvas_clip_all(canvas);
    int fitting = canvas->height >= 1400 ? 3 : canvas->height >= 600 && canvas->width >= 900 ? 2 : 1;
    u->scale = fitting + u->larger;
    if (u->scale < 1) u->scale = 1;
    u->row = (FONT_HEIGHT + 4) * u->scale;
    u->item_count = u->panel_count = 0;
    u->hover = 0;
    u->holds_arrows = false;
}

static void navigate(ui* u)
{
    const bool* pressed = u->input->repeated;
    bool shift = u->input->down[ES_KEY_SHIFT] || u->input->pressed[ES_KEY_SHIFT];
    if (pressed[ES_KEY_TAB]) {
        u->editing = 0;
        u->focus = ui_focus_move(u->items, u->item_count, u->focus, shift ? UI_MOVE_PREVIOUS_PANEL : UI_MOVE_NEXT_PANEL);
    }
    if (!u->focus || u->editing) return;
    ui_id start = u->focus;
    if (pressed[ES_KEY_UP]) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_UP);
    if (pressed[ES_KEY_DOWN]) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_DOWN);
    if (pressed[ES_KEY_LEFT] && !u->holds_arrows) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_LEFT);
    if (pressed[ES_KEY_RIGHT] && !u->holds_arrows) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_RIGHT);
    for (int i = 0; i < 10 && pressed[ES_KEY_PAGE_UP]; i++) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_UP);
    for (int i = 0; i < 10 && pressed[ES_KEY_PAGE_DOWN]; i++) u->focus = ui_focus_move(u->items, u->item_count, u->focus, UI_MOVE_DOWN);
    if (u->focus != start) u->editing = 0;
}

void ui_end(ui* u)
{
    if (u->focus_panel) {
        ui_id first = ui_focus_first(u->items, u->item_count, u->focus_panel);
        if (first) {
            u->focus = first;
            u->editing = u->edit_panel ? first : 0;
            u->focus_panel = 0;
        }
    } else {
        navigate(u);
    }
    if (u->focus && !ui_focus_panel(u->items, u->item_count, u->focus)) ui_drop_focus(u); /* its panel is gone */
    canvas_clip_all(u->canvas);
}

bool ui_types(const ui* u) { return u->editing != 0; }

void ui_focus_on(ui* u, const char* panel)
{
    u->editing = 0;
    u->edit_panel = false;
    u->focus_panel = panel_id(panel);
}

void ui_edit_on(ui* u, const char* panel)
{
    ui_focus_on(u, panel);
    u->edit_panel = true;
}

void ui_drop_focus(ui* u) { u->focus = u->editing = u->focus_panel = 0; }

es_window_input ui_game_input(const ui* u)
{
    static const int keys[] = {ES_KEY_LEFT, ES_KEY_RIGHT, ES_KEY_UP, ES_KEY_DOWN, ES_KEY_PAGE_UP, ES_KEY_PAGE_DOWN, ES_KEY_HOME, ES_KEY_END,
        ES_KEY_ENTER, ES_KEY_DELETE, ES_KEY_BACKSPACE};
    es_window_input input = *u->input;
    if (ui_types(u)) {
        bool modifiers[3] = {input.down[ES_KEY_SHIFT], input.down[ES_KEY_CONTROL], input.down[ES_KEY_ALT]};
        memset(input.down, 0, sizeof input.down);
        memset(input.pressed, 0, ES_KEY_ESCAPE * sizeof input.pressed[0]);
        memset(input.repeated, 0, ES_KEY_ESCAPE * sizeof input.repeated[0]);
        input.down[ES_KEY_SHIFT] = modifiers[0], input.down[ES_KEY_CONTROL] = modifiers[1], input.down[ES_KEY_ALT] = modifiers[2];
    }
    for (size_t i = 0; u->focus && i < sizeof keys / sizeof keys[0]; i++)
        input.down[keys[i]] = input.pressed[keys[i]] = input.repeated[keys[i]] = false;
    input.pressed[ES_KEY_TAB] = input.repeated[ES_KEY_TAB] = input.down[ES_KEY_TAB] = false;
    if (u->escaped) input.pressed[ES_KEY_ESCAPE] = input.repeated[ES_KEY_ESCAPE] = false;
    if (u->hover_panel || u->active) {
        input.scroll = 0;
        memset(input.mouse_pressed, 0, sizeof input.mouse_pressed);
    }
    if (u->active) memset(input.mouse_down, 0, sizeof input.mouse_down);
    return input;
}

bool ui_panel_begin(ui* u, const char* name, canvas_rect rect, const char* title)
{
    u->panel = panel_id(name);
    if (u->panel_count < UI_MAX_PANELS) u->panels[u->panel_count++] = (ui_panel){u->panel, rect};
    canvas_clip_all(u->canvas);
    canvas_blend(u->canvas, rect, UI_GROUND, 232);
    canvas_frame(u->canvas, rect, 1, UI_WIDGET);
    canvas_narrow_clip(u->canvas, rect);
    int s = u->scale, pad = 4 * s;
    u->left = u->x = rect.x + pad;
    u->right = rect.x + rect.width - pad;
    u->y = rect.y + (title ? 2 * s : pad);
    bool open = u->closing != u->panel;
    if (!title) return open;
    canvas_fill(u->canvas, (canvas_rect){rect.x, rect.y, rect.width, u->row}, UI_WIDGET);
    canvas_text(u->canvas, u->x, u->y + 2 * s, s, UI_TEXT, title, (u->right - u->x) / (FONT_WIDTH * s) - 3);
    canvas_rect cross = {rect.x + rect.width - u->row, rect.y, u->row, u->row};
    ui_id id = ui_make_id(u, "close");
    bool over = ui_points(u, id, cross);
    if (over) canvas_fill(u->canvas, cross, UI_HOVER);
    canvas_text(u->canvas, cross.x + (u->row - 5 * s) / 2, u->y + 2 * s, s, UI_TEXT, "×", 1);
    if (ui_pressed(u, id, cross)) open = false;
    u->y = rect.y + u->row + 3 * s;
    return open;
}

void ui_panel_end(ui* u)
{
    canvas_clip_all(u->canvas);
    u->panel = 0;
}

canvas_rect ui_take(ui* u, int columns)
{
    int unit = FONT_WIDTH * u->scale, width = columns > 0 ? columns * unit : u->right - u->x + columns * unit;
    if (width > u->right - u->x) width = u->right - u->x;
    if (width < 0) width = 0;
    canvas_rect rect = {u->x, u->y, width, u->row - u->scale};
    u->x += width + 2 * u->scale;
    return rect;
}

void ui_next_row(ui* u)
{
    u->x = u->left;
    u->y += u->row;
}

int ui_columns(const ui* u) { return u->right > u->x ? (u->right - u->x) / (FONT_WIDTH * u->scale) : 0; }

void ui_add_item(ui* u, ui_id id, canvas_rect rect)
{
    if (u->item_count < UI_MAX_ITEMS) u->items[u->item_count++] = (ui_item){id, u->panel, rect};
}

bool ui_visible(const ui* u, canvas_rect rect)
{
    canvas_rect seen = canvas_intersect(u->canvas->clip, rect);
    return seen.width > 0 && seen.height > 0;
}

bool ui_points(ui* u, ui_id id, canvas_rect rect)
{
    if (u->active ? u->active != id : u->hover_panel != u->panel) return false;
    if (!canvas_inside(canvas_intersect(u->canvas->clip, rect), (int)u->input->mouse_x, (int)u->input->mouse_y)) return false;
    u->hover = id;
    return true;
}

bool ui_pressed(ui* u, ui_id id, canvas_rect rect)
{
    if (!u->input->mouse_pressed[0] || u->active || u->hover_panel != u->panel) return false;
    if (!canvas_inside(canvas_intersect(u->canvas->clip, rect), (int)u->input->press_x[0], (int)u->input->press_y[0])) return false;
    u->active = id;
    return true;
}

bool ui_key(const ui* u, ui_id id, int key) { return u->focus == id && u->input->repeated[key]; }
