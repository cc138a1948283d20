/* The interface's widgets. */
#include "ui_widgets.h"
#include "font.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>

static int fitting(const ui* u, canvas_rect rect) { return (rect.width - 2 * u->scale) / (FONT_WIDTH * u->scale); }

static void text_in(ui* u, canvas_rect rect, uint32_t colour, const char* text)
{
    canvas_text(u->canvas, rect.x + 3 * u->scale, rect.y + (rect.height - 7 * u->scale) / 2, u->scale, colour, text, fitting(u, rect));
}

void ui_label(ui* u, int columns, uint32_t colour, const char* text)
{
    canvas_rect rect = ui_take(u, columns);
    if (ui_visible(u, rect)) canvas_text(u->canvas, rect.x, rect.y + (rect.height - 7 * u->scale) / 2, u->scale, colour, text, rect.width / (FONT_WIDTH * u->scale));
}

/* Bytes of `text` that fit into a row, without the blank they end at. */
static size_t row_bytes(const char* text, int columns)
{
    const char *c = text, *blank = NULL;
    for (int i = 0; *c && i < columns; i++) {
        if (*c == ' ' && c > text) blank = c;
        font_next(&c);
    }
    if (!*c || *c == ' ') return (size_t)(c - text);
    return (size_t)((blank ? blank : c) - text);
}

int ui_paragraph(ui* u, uint32_t colour, const char* text, bool draw)
{
    int rows = 0, columns = ui_columns(u);
    while (*text && columns > 0) {
        char row[512];
        size_t bytes = row_bytes(text, columns);
        snprintf(row, sizeof row, "%.*s", (int)(bytes < sizeof row ? bytes : sizeof row - 1), text);
        if (draw) {
            canvas_text(u->canvas, u->x, u->y + u->scale, u->scale, colour, row, INT_MAX);
            u->y += (FONT_HEIGHT + 2) * u->scale;
        }
        text += bytes;
        while (*text == ' ') text++;
        rows++;
    }
    return rows;
}

static void focus_frame(ui* u, ui_id id, canvas_rect rect)
{
    if (u->focus == id) canvas_frame(u->canvas, rect, u->scale, UI_FOCUS);
}

bool ui_switch(ui* u, const char* name, int columns, const char* text, bool on)
{
    canvas_rect rect = ui_take(u, columns);
    ui_id id = ui_make_id(u, name);
    ui_add_item(u, id, rect);
    bool pressed = ui_pressed(u, id, rect), over = ui_points(u, id, rect);
    if (pressed) u->focus = id, u->editing = 0;
    if (ui_visible(u, rect)) {
        canvas_fill(u->canvas, rect, on ? UI_ACCENT : over ? UI_HOVER : UI_WIDGET);
        text_in(u, rect, UI_TEXT, text);
        focus_frame(u, id, rect);
    }
    return pressed || (u->focus == id && u->input->pressed[ES_KEY_ENTER]);
}

bool ui_button(ui* u, const char* name, int columns, const char* text) { return ui_switch(u, name, columns, text, false); }

/* ---- typing ----------------------------------------------------------------------------------------------------------- */

static void append(char* text, size_t size, uint32_t character)
{
    size_t length = strlen(text);
    if (character == ' ' && !length) return;
    if (character >= 32 && character < 127 && length + 1 < size) text[length] = (char)character, text[length + 1] = 0;
}

/* True when the text is another one. */
static bool type_into(ui* u, char* text, size_t size)
{
    char before[UI_EDIT_SIZE];
    snprintf(before, sizeof before, "%s", text);
    for (uint32_t i = 0; i < u->input->text_count; i++) append(text, size, u->input->text[i]);
    if (u->input->repeated[ES_KEY_BACKSPACE] && text[0]) text[strlen(text) - 1] = 0;
    if (u->input->pressed[ES_KEY_DELETE]) text[0] = 0;
    return strcmp(before, text) != 0;
}

static void draw_field(ui* u, canvas_rect rect, const char* text, bool typing)
{
    char shown[UI_EDIT_SIZE + 2];
    snprintf(shown, sizeof shown, "%s%s", text, typing ? "_" : "");
    canvas_fill(u->canvas, rect, 0x000000);
    canvas_frame(u->canvas, rect, u->scale, UI_WIDGET);
    text_in(u, rect, UI_TEXT, shown);
}

bool ui_field(ui* u, const char* name, int columns, char* text, size_t size, const char* hint)
{
    canvas_rect rect = ui_take(u, columns);
    ui_id id = ui_make_id(u, name);
    ui_add_item(u, id, rect);
    bool changed = false, begun = false;
    if (ui_pressed(u, id, rect)) u->focus = u->editing = id, begun = true;
    ui_points(u, id, rect);
    if (u->focus == id && u->editing != id && u->input->pressed[ES_KEY_ENTER]) u->editing = id, begun = true;
    if (u->editing == id) {
        changed = type_into(u, text, size);
        bool leaves = u->input->pressed[ES_KEY_DOWN] || u->input->pressed[ES_KEY_UP] || (u->input->pressed[ES_KEY_ENTER] && !begun);
        if (leaves || u->focus != id) u->editing = 0;
    }
    if (ui_visible(u, rect)) {
        draw_field(u, rect, text[0] || u->editing == id ? text : hint, u->editing == id);
        focus_frame(u, id, rect);
    }
    return changed;
}

/* ---- sliders ------------------------------------------------------------------------------------------------------------ */

static float fraction_at(canvas_rect rect, float x)
{
    float fraction = (x - (float)rect.x) / (float)(rect.width > 1 ? rect.width : 1);
    return fraction < 0 ? 0 : fraction > 1 ? 1 : fraction;
}

static ui_slider_act slider_keys(ui* u, ui_id id, float* fraction, int* steps)
{
    const es_window_input* in = u->input;
    int reach = in->down[ES_KEY_SHIFT] || in->pressed[ES_KEY_SHIFT] ? 10 : 1;
    if (in->pressed[ES_KEY_ENTER]) {
        u->editing = id;
        u->edit[0] = 0;
        return UI_SLIDER_NOTHING;
    }
    if (in->pressed[ES_KEY_DELETE]) return UI_SLIDER_RESET;
    if (in->pressed[ES_KEY_HOME] || in->pressed[ES_KEY_END]) {
        *fraction = in->pressed[ES_KEY_END] ? 1.0f : 0.0f;
        return UI_SLIDER_MOVED;
    }
    *steps = ((int)in->repeated[ES_KEY_RIGHT] - (int)in->repeated[ES_KEY_LEFT]) * reach;
    return *steps ? UI_SLIDER_STEPPED : UI_SLIDER_NOTHING;
}

static ui_slider_act slider_typing(ui* u)
{
    type_into(u, u->edit, sizeof u->edit);
    if (!u->input->pressed[ES_KEY_ENTER]) return UI_SLIDER_NOTHING;
    u->editing = 0;
    return u->edit[0] ? UI_SLIDER_TYPED : UI_SLIDER_NOTHING;
}

ui_slider_act ui_slider(ui* u, const char* name, int columns, float* fraction, int* steps, const char* text, uint32_t colour)
{
    canvas_rect rect = ui_take(u, columns);
    ui_id id = ui_make_id(u, name);
    ui_add_item(u, id, rect);
    ui_slider_act act = UI_SLIDER_NOTHING;
    if (ui_pressed(u, id, rect)) {
        u->focus = id;
        u->editing = 0;
        *fraction = fraction_at(rect, u->input->press_x[0]);
        act = UI_SLIDER_MOVED;
    }
    bool over = ui_points(u, id, rect);
    if (u->active == id && (u->input->mouse_dx != 0 || act == UI_SLIDER_MOVED)) {
        *fraction = fraction_at(rect, u->input->mouse_x);
        act = UI_SLIDER_MOVED;
    }
    if (u->editing == id) act = slider_typing(u);
    else if (u->focus == id && act == UI_SLIDER_NOTHING) act = slider_keys(u, id, fraction, steps);
    if (u->focus == id) u->holds_arrows = true;
    if (!ui_visible(u, rect)) return act;
    if (u->editing == id) {
        draw_field(u, rect, u->edit, true);
    } else {
        canvas_fill(u->canvas, rect, over ? UI_HOVER : UI_WIDGET);
        canvas_rect filled = rect;
        filled.width = (int)((float)rect.width * *fraction + 0.5f);
        canvas_fill(u->canvas, filled, UI_ACCENT);
        text_in(u, rect, colour, text);
    }
    focus_frame(u, id, rect);
    return act;
}

/* ---- scrolling ------------------------------------------------------------------------------------------------------------ */

static int limited(int offset, int content, int height)
{
    if (offset > content - height) offset = content - height;
    return offset < 0 ? 0 : offset;
}

void ui_scroll_begin(ui* u, ui_scroll* scroll, int height)
{
    scroll->area = (canvas_rect){u->left, u->y, u->right - u->left, height};
    scroll->right = u->right;
    u->right -= 6 * u->scale; /* the bar */
    scroll->offset = limited(scroll->offset, scroll->content, height);
    scroll->former_clip = canvas_narrow_clip(u->canvas, scroll->area);
    scroll->first_item = u->item_count;
    u->y -= scroll->offset;
}

/* Scrolls to the widget that has got the keyboard. */
static void follow_focus(ui* u, ui_scroll* scroll)
{
    if (u->focus == scroll->followed) return;
    scroll->followed = u->focus;
    for (size_t i = scroll->first_item; i < u->item_count; i++) {
        canvas_rect rect = u->items[i].rect;
        if (u->items[i].id != u->focus) continue;
        if (rect.y < scroll->area.y) scroll->offset -= scroll->area.y - rect.y;
        int below = rect.y + rect.height - (scroll->area.y + scroll->area.height);
        if (below > 0) scroll->offset += below;
    }
}

void ui_scroll_end(ui* u, ui_scroll* scroll, const char* name)
{
    canvas_rect area = scroll->area;
    scroll->content = u->y + scroll->offset - area.y;
    u->canvas->clip = scroll->former_clip;
    u->right = scroll->right;
    u->y = area.y + area.height;
    u->x = u->left;
    follow_focus(u, scroll);
    if (u->hover_panel == u->panel && canvas_inside(area, (int)u->input->mouse_x, (int)u->input->mouse_y))
        scroll->offset -= (int)(u->input->scroll * (float)(3 * u->row));
    if (scroll->content > area.height) {
        ui_id id = ui_make_id(u, name);
        canvas_rect bar = {area.x + area.width - 4 * u->scale, area.y, 4 * u->scale, area.height}, thumb = bar;
        thumb.height = area.height * area.height / scroll->content;
        if (thumb.height < u->row) thumb.height = u->row;
        ui_pressed(u, id, bar);
        int way = area.height - thumb.height;
        if (u->active == id && way > 0)
            scroll->offset = (int)((u->input->mouse_y - (float)(area.y + thumb.height / 2)) / (float)way * (float)(scroll->content - area.height));
        scroll->offset = limited(scroll->offset, scroll->content, area.height);
        thumb.y += way * scroll->offset / (scroll->content - area.height);
        canvas_fill(u->canvas, bar, UI_WIDGET);
        canvas_fill(u->canvas, thumb, u->active == id ? UI_ACCENT : UI_DIM);
    }
    scroll->offset = limited(scroll->offset, scroll->content, area.height);
}
