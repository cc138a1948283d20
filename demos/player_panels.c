/* What lies over the picture: a bar of buttons, help, the list of scenes, the time line, notices. */
#include "font.h"
#include "player.h"

#include <limits.h>
#include <string.h>

static int columns(const player* p, int count) { return count * FONT_WIDTH * p->ui.scale; }

/* ---- the bar at the top -------------------------------------------------------------------------------------------------------- */

static const char* split_name(player_split_mode mode)
{
    return mode == SPLIT_FORMER ? "Split: former" : mode == SPLIT_REFERENCE ? "Split: reference" : "Split";
}

static void top_bar(player* p)
{
    ui* u = &p->ui;
    canvas_rect rect = {0, 0, (int)p->canvas.width, u->row + 4 * u->scale};
    ui_panel_begin(u, "bar", rect, NULL);
    u->y = rect.y + 2 * u->scale;
    if (ui_switch(u, "scenes", 7, "Scenes", p->show_scenes)) {
        p->show_scenes = !p->show_scenes;
        if (p->show_scenes) ui_focus_on(u, "scenes");
    }
    if (ui_switch(u, "settings", 9, "Settings", p->show_settings)) {
        p->show_settings = !p->show_settings;
        if (p->show_settings) ui_focus_on(u, "settings");
    }
    if (ui_switch(u, "graphs", 7, "Graphs", p->show_graphs)) p->show_graphs = !p->show_graphs;
    if (ui_switch(u, "split", p->split.mode ? 17 : 6, split_name(p->split.mode), p->split.mode != SPLIT_OFF)) player_next_split(p);
    if (ui_switch(u, "lights", 7, "Lights", p->hand.show_lights)) p->hand.show_lights = !p->hand.show_lights;
    if (ui_switch(u, "reflections", 12, "Reflections", p->edits.shown)) p->edits.shown = !p->edits.shown;
    if (ui_button(u, "shot", 4, "PNG")) player_screenshot(p, false);
    if (ui_button(u, "exr", 4, "EXR")) player_screenshot(p, true);
    if (ui_switch(u, "sequence", 4, "Rec", p->capture.recording)) player_toggle_sequence(p);
    if (ui_switch(u, "help", 5, "Help", p->show_help)) p->show_help = !p->show_help;
    char line[160];
    snprintf(line, sizeof line, "%s  %s  %.0f ms", es_image_name(p->image), demo_method_name(p->session.settings.method), p->frame_milliseconds);
    int length = font_columns(line);
    if (ui_columns(u) >= length) {
        u->x = u->right - columns(p, length);
        ui_label(u, 0, UI_DIM, line);
    }
    ui_panel_end(u);
}

/* ---- help ----------------------------------------------------------------------------------------------------------------------- */

enum { HELP_KEY_COLUMNS = 17, HELP_COLUMNS = 51 };

static size_t help_rows(void)
{
    const char *key, *text;
    size_t rows = 0;
    while (player_command_text(rows, &key, &text)) rows++;
    return rows;
}

/* Rows `first` … `end` below each other. */
static void help_column(ui* u, size_t first, size_t end, int line)
{
    const char *key, *text;
    const int unit = FONT_WIDTH * u->scale;
    for (size_t i = first; i < end && player_command_text(i, &key, &text); i++, u->y += line) {
        if (!key) canvas_text(u->canvas, u->x, u->y, u->scale, UI_FOCUS, text, INT_MAX);
        else canvas_text(u->canvas, u->x + unit, u->y, u->scale, UI_TEXT, key, INT_MAX);
        if (key) canvas_text(u->canvas, u->x + HELP_KEY_COLUMNS * unit, u->y, u->scale, UI_DIM, text, INT_MAX);
    }
}

/* One column that scrolls, or two where there is room for them and one would have to scroll. */
static void help_panel(player* p, int top, int bottom)
{
    ui* u = &p->ui;
    int column = columns(p, HELP_COLUMNS), line = (FONT_HEIGHT + 1) * u->scale, frame = u->row + 8 * u->scale;
    size_t rows = help_rows(), shown = rows;
    bool two = (int)rows * line + frame > bottom - top && 2 * column + 12 * u->scale <= (int)p->canvas.width;
    if (two) { /* a group stays together */
        const char *key, *text;
        shown = rows / 2;
        while (player_command_text(shown, &key, &text) && key) shown++;
        if (shown < rows - shown) shown = rows - shown;
    }
    int height = (int)shown * line + frame, width = (two ? 2 * column : column) + 12 * u->scale;
    if (height > bottom - top) height = bottom - top;
    if (width > (int)p->canvas.width) width = (int)p->canvas.width;
    if (!ui_panel_begin(u, "help", (canvas_rect){0, top, width, height}, "Keys")) p->show_help = false;
    ui_scroll_begin(u, &p->help_scroll, top + height - u->y - 4 * u->scale);
    int start = u->y;
    help_column(u, 0, shown, line);
    int end = u->y;
    if (two) {
        u->y = start;
        u->x += column;
        help_column(u, shown, rows, line);
        u->y = end;
    }
    ui_scroll_end(u, &p->help_scroll, "bar");
    ui_panel_end(u);
}

/* ---- scenes ---------------------------------------------------------------------------------------------------------------------- */

static void scene_entry(player* p, const char* name, const char* description)
{
    ui* u = &p->ui;
    bool shown = !strcmp(name, p->scene);
    const char* slash = strrchr(name, '/');
    if (ui_switch(u, name, 0, slash ? slash + 1 : name, shown)) {
        snprintf(p->wanted_scene, sizeof p->wanted_scene, "%s", name);
        player_notice(p, "opening %s", name);
    }
    ui_next_row(u);
    u->x += 2 * u->scale;
    ui_paragraph(u, UI_DIM, description, true);
    ui_next_row(u);
    u->y -= u->row / 2;
}

static void scenes_panel(player* p, int top, int bottom)
{
    ui* u = &p->ui;
    int width = columns(p, 44);
    if (width > (int)p->canvas.width) width = (int)p->canvas.width;
    canvas_rect rect = {((int)p->canvas.width - width) / 2, top, width, bottom - top};
    int wanted = p->scene_scroll.content + u->row + 12 * u->scale;
    if (p->scene_scroll.content && wanted < rect.height) rect.height = wanted;
    if (!ui_panel_begin(u, "scenes", rect, "Scenes")) p->show_scenes = false;
    ui_scroll_begin(u, &p->scene_scroll, rect.y + rect.height - u->y - 4 * u->scale);
    /* the file that was given stays in the list */
    bool built_in = false;
    for (size_t i = 0; i < es_scene_count(); i++) built_in |= !strcmp(p->options.scene, es_scene_name(i));
    if (!built_in) scene_entry(p, p->options.scene, "the file given on the command line");
    for (size_t i = 0; i < es_scene_count(); i++) scene_entry(p, es_scene_name(i), es_scene_description(i));
    ui_scroll_end(u, &p->scene_scroll, "bar");
    ui_panel_end(u);
}

/* ---- time ------------------------------------------------------------------------------------------------------------------------- */

static void timeline_panel(player* p, int top)
{
    ui* u = &p->ui;
    player_history* h = &p->history;
    char text[96];
    ui_panel_begin(u, "time", (canvas_rect){0, top, (int)p->canvas.width, (int)p->canvas.height - top}, NULL);
    u->y = top + 2 * u->scale;
    if (ui_switch(u, "pause", 3, p->paused ? "▶" : "⏸", p->paused)) p->paused = !p->paused, p->steps = 0;
    if (ui_button(u, "step", 5, "Step")) p->paused = true, p->steps++;
    float speed = p->world.speed;
    snprintf(text, sizeof text, "×%.3g", (double)speed);
    if (ui_button(u, "slower", 3, "-")) speed = speed > 0 ? speed / 2 : 1;
    ui_label(u, 7, UI_TEXT, text);
    if (ui_button(u, "faster", 3, "+")) speed = speed > 0 ? speed * 2 : 1;
    if (!p->replaying && speed != p->world.speed && speed >= 1.0f / 64 && speed <= 100) {
        p->world.speed = speed;
        es_world_configure(p->session.world, &p->world);
    }
    bool behind = h->count && h->at + 1 < h->count;
    if (behind) snprintf(text, sizeof text, "%.2f s, of %.2f s", history_time(h, h->at), history_time(h, h->count - 1));
    else snprintf(text, sizeof text, "%.2f s", es_world_time(p->session.world));
    float fraction = h->count > 1 ? (float)h->at / (float)(h->count - 1) : 1;
    int steps = 0;
    switch (ui_slider(u, "past", 0, &fraction, &steps, text, UI_TEXT)) {
    case UI_SLIDER_MOVED:
        if (h->count) player_wind(p, (uint32_t)(fraction * (float)(h->count - 1) + 0.5f));
        break;
    case UI_SLIDER_STEPPED:
        player_wind(p, steps < 0 && (uint32_t)-steps > h->at ? 0 : h->at + (uint32_t)steps);
        break;
    default:
        break;
    }
    ui_panel_end(u);
}

/* ---- all ---------------------------------------------------------------------------------------------------------------------------- */

static void notice(player* p, int bottom)
{
    ui* u = &p->ui;
    char line[300] = "";
    if (demo_seconds() < p->notice_until) snprintf(line, sizeof line, "%s", p->notice);
    else if (p->replaying) snprintf(line, sizeof line, "replay, step %u of %u", p->replayed, es_recording_steps(p->session.replay));
    else if (p->session.recording && !p->capture.recording) snprintf(line, sizeof line, "recording: %s", p->options.record);
    else if (p->capture.recording) snprintf(line, sizeof line, "recording, %u frames; F12 ends", p->capture.frame);
    if (!line[0]) return;
    int width = columns(p, font_columns(line)), x = ((int)p->canvas.width - width) / 2;
    canvas_label(&p->canvas, x > 4 ? x : 4, bottom - 2 * u->row, u->scale, UI_FOCUS, line);
}

void player_build_panels(player* p)
{
    ui* u = &p->ui;
    int bar = u->row + 4 * u->scale, top = bar, bottom = (int)p->canvas.height - (p->show_timeline ? bar : 0);
    if (p->hide_all) {
        ui_drop_focus(u);
        return;
    }
    top_bar(p);
    if (p->show_timeline) timeline_panel(p, bottom);
    if (p->show_help) help_panel(p, top, bottom);
    if (p->show_graphs) {
        int width = columns(p, 60), height = (bottom - top) * 2 / 3;
        player_graphs_panel(p, (canvas_rect){0, bottom - height, width, height});
    }
    if (p->show_micro) player_micro_panel(p, bottom);
    if (p->edits.shown) {
        const int width = columns(p, 44), height = 10 * u->row + 12 * u->scale;
        player_edits_panel(p, (canvas_rect){0, bottom - height, width, height});
    }
    if (p->show_settings) {
        int width = columns(p, 48), left = (int)p->canvas.width - width;
        player_settings_panel(p, (canvas_rect){left > 0 ? left : 0, top, width, bottom - top});
    }
    if (p->show_scenes) scenes_panel(p, top, bottom);
    if (p->hint && (p->show_help || p->show_graphs || p->show_settings)) p->notice_until = 0; /* it would be drawn over them */
    notice(p, bottom);
}
