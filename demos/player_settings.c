/* Sliders for every setting of the renderer and of the world, made from their tables. */
#include "font.h"
#include "player.h"
#include "setting_slider.h"

#include <ctype.h>
#include <string.h>

bool player_configure(player* p, const es_renderer_settings* settings)
{
    es_renderer_settings now = p->session.settings;
    if (es_renderer_configure(p->session.renderer, settings) != ES_OK) {
        player_notice(p, "%s", es_context_message(p->session.context));
        return false;
    }
    if (!p->split.pinned) p->split.former = now;
    p->session.settings = *settings;
    return true;
}

/* What only opening a scene reads: it is opened again. */
static bool needs_opening(const char* name)
{
    static const char* const names[] = {"world.triangles", "world.camera", "world.clip", "world.default-light"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (!strcmp(name, names[i])) return true;
    return false;
}

typedef struct trial {
    player* p;
    const es_setting* setting;
    bool world;
} trial;

/* Tries a value on the renderer or the world themselves, who know what goes together. */
static bool accepts(void* user, double value)
{
    trial* t = user;
    if (t->world && t->p->replaying) return false;
    if (t->world) {
        es_world_settings settings = t->p->world;
        setting_store(t->setting, &settings, value);
        return es_world_configure(t->p->session.world, &settings) == ES_OK;
    }
    es_renderer_settings settings = t->p->session.settings;
    setting_store(t->setting, &settings, value);
    return es_renderer_configure(t->p->session.renderer, &settings) == ES_OK;
}

static void change(player* p, const es_setting* setting, bool world, double wanted)
{
    trial t = {p, setting, world};
    double now = setting_value(setting, world ? (const void*)&p->world : &p->session.settings);
    double value = setting_accepted(setting, now, wanted, accepts, &t);
    if (value == now || (world && p->replaying)) return;
    if (!world) {
        es_renderer_settings settings = p->session.settings;
        setting_store(setting, &settings, value);
        player_configure(p, &settings);
        return;
    }
    setting_store(setting, &p->world, value);
    if (needs_opening(setting->name)) snprintf(p->wanted_scene, sizeof p->wanted_scene, "%s", p->scene);
}

/* Letters alike whether large or small; every word of the search must be in the name or the help. */
static bool contains(const char* text, const char* word, size_t length)
{
    for (; *text; text++) {
        size_t i = 0;
        while (i < length && text[i] && tolower((unsigned char)text[i]) == tolower((unsigned char)word[i])) i++;
        if (i == length) return true;
    }
    return false;
}

static bool matches(const es_setting* setting, const char* search)
{
    while (*search) {
        size_t length = strcspn(search, " ");
        if (length && !contains(setting->name, search, length) && !contains(setting->help, search, length)) return false;
        search += length;
        while (*search == ' ') search++;
    }
    return true;
}

enum { NAME_COLUMNS = 22 };

/* Returns whether the keyboard or the mouse is on it. */
static bool setting_row(player* p, const es_setting* setting, bool world)
{
    ui* u = &p->ui;
    double value = setting_value(setting, world ? (const void*)&p->world : &p->session.settings), wanted = value;
    bool changed = value != setting_default(setting);
    char text[SETTING_TEXT_SIZE];
    setting_text(setting, value, text);
    ui_label(u, NAME_COLUMNS, changed ? UI_CHANGED : UI_TEXT, setting->name);
    float fraction = setting_fraction(setting, value);
    int steps = 0, cross = changed ? 3 : 0;
    int place = -cross - (cross > 0);
    if (setting->type == ES_SETTING_BOOL) {
        if (ui_switch(u, setting->name, place ? place : 0, text, value != 0)) wanted = value == 0;
    } else {
        switch (ui_slider(u, setting->name, place ? place : 0, &fraction, &steps, text, UI_TEXT)) {
        case UI_SLIDER_NOTHING:
            break;
        case UI_SLIDER_MOVED:
            wanted = setting_at_fraction(setting, fraction);
            break;
        case UI_SLIDER_STEPPED:
            wanted = setting_stepped(setting, value, steps);
            break;
        case UI_SLIDER_TYPED:
            if (!setting_parse(setting, u->edit, &wanted)) player_notice(p, "%s: %s is outside its range", setting->name, u->edit);
            break;
        case UI_SLIDER_RESET:
            wanted = setting_default(setting);
            break;
        }
    }
    ui_id id = ui_make_id(u, setting->name);
    bool looked_at = u->focus == id || u->hover == id;
    char reset[96];
    snprintf(reset, sizeof reset, "reset %s", setting->name);
    if (cross && ui_button(u, reset, cross, "×")) wanted = setting_default(setting);
    if (wanted != value) change(p, setting, world, wanted);
    ui_next_row(u);
    return looked_at;
}

static bool follows_window(const es_setting* setting) { return !strcmp(setting->name, "width") || !strcmp(setting->name, "height"); }

static const es_setting* setting_at(size_t index, bool* world)
{
    size_t renderer = es_renderer_setting_count();
    *world = index >= renderer;
    return *world ? es_world_setting(index - renderer) : es_renderer_setting(index);
}

static bool is_changed(const player* p, const es_setting* setting, bool world)
{
    return setting_value(setting, world ? (const void*)&p->world : &p->session.settings) != setting_default(setting);
}

static void reset_all(player* p)
{
    bool world;
    const es_setting* setting;
    for (size_t i = 0; (setting = setting_at(i, &world)) != NULL; i++)
        if (!follows_window(setting) && is_changed(p, setting, world)) change(p, setting, world, setting_default(setting));
}

static void describe(player* p, const es_setting* setting)
{
    char line[160], low[SETTING_TEXT_SIZE], high[SETTING_TEXT_SIZE];
    ui* u = &p->ui;
    if (setting->type == ES_SETTING_INT || setting->type == ES_SETTING_FLOAT) {
        snprintf(low, sizeof low, "%.6g", setting->minimum);
        snprintf(high, sizeof high, "%.6g", setting->maximum);
        snprintf(line, sizeof line, "%s: %s … %s, usually %s", setting->name, low, high, setting->default_text);
    } else {
        snprintf(line, sizeof line, "%s: %s, usually %s", setting->name, setting->type == ES_SETTING_BOOL ? "true|false" : setting->choices, setting->default_text);
    }
    ui_paragraph(u, UI_TEXT, line, true);
    ui_paragraph(u, UI_DIM, setting->help, true);
}

void player_settings_panel(player* p, canvas_rect rect)
{
    ui* u = &p->ui;
    const int foot = 5 * (FONT_HEIGHT + 2) * u->scale;
    if (!ui_panel_begin(u, "settings", rect, "Settings")) p->show_settings = false;
    if (ui_field(u, "search", -21, p->search, sizeof p->search, "search")) p->settings_scroll.offset = 0;
    if (ui_switch(u, "changed", 9, "changed", p->only_changed)) p->only_changed = !p->only_changed;
    if (ui_button(u, "reset", 0, "reset all")) reset_all(p);
    ui_next_row(u);
    int list = rect.y + rect.height - foot - u->y - 4 * u->scale;
    ui_scroll_begin(u, &p->settings_scroll, list > u->row ? list : u->row);
    const es_setting *setting, *looked_at = NULL;
    bool world;
    size_t shown = 0;
    for (size_t i = 0; (setting = setting_at(i, &world)) != NULL; i++) {
        if (follows_window(setting) || !matches(setting, p->search) || (p->only_changed && !is_changed(p, setting, world))) continue;
        if (setting_row(p, setting, world)) looked_at = setting;
        shown++;
    }
    if (!shown) ui_label(u, 0, UI_DIM, p->only_changed ? "all as usual" : "nothing of that name");
    ui_scroll_end(u, &p->settings_scroll, "bar");
    u->y = rect.y + rect.height - foot;
    if (looked_at) describe(p, looked_at);
    ui_panel_end(u);
}

void player_print_settings(const player* p)
{
    bool world;
    const es_setting* setting;
    printf("%s", p->scene);
    for (size_t i = 0; (setting = setting_at(i, &world)) != NULL; i++) {
        char text[SETTING_TEXT_SIZE];
        if (!is_changed(p, setting, world) && !follows_window(setting)) continue;
        setting_text(setting, setting_value(setting, world ? (const void*)&p->world : &p->session.settings), text);
        printf(" --set %s=%s", setting->name, text);
    }
    printf("\n");
    fflush(stdout);
}
