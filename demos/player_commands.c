/* Everything that has a key: one table, from which the keys are taken and the help is written. */
#include "player.h"

#include <math.h>
#include <string.h>

static size_t image_index(const char* name)
{
    for (size_t i = 0; i < es_image_name_count(); i++)
        if (!strcmp(es_image_name(i), name)) return i;
    return 0;
}

/* ---- what the keys do ------------------------------------------------------------------------------------------------------- */

static void open_panel(player* p, bool* shown, const char* name)
{
    *shown = !*shown;
    if (*shown) ui_focus_on(&p->ui, name);
    else ui_drop_focus(&p->ui);
    if (*shown) p->hide_all = false;
}

static void do_help(player* p) { p->show_help = !p->show_help; }
static void do_scenes(player* p) { open_panel(p, &p->show_scenes, "scenes"); }
static void do_settings(player* p) { open_panel(p, &p->show_settings, "settings"); }
static void do_find(player* p)
{
    p->show_settings = true;
    p->hide_all = false;
    ui_edit_on(&p->ui, "settings");
}
static void do_graphs(player* p) { p->show_graphs = !p->show_graphs; }
static void do_micro(player* p) { p->show_micro = !p->show_micro; }
static void do_timeline(player* p) { p->show_timeline = !p->show_timeline; }
static void do_hide(player* p) { p->hide_all = !p->hide_all; }
static void do_larger(player* p) { p->ui.larger += p->ui.scale < 6; }
static void do_smaller(player* p) { p->ui.larger -= p->ui.scale > 1; }

/* The innermost first: what is held, then the panels, then the program. */
static void do_escape(player* p)
{
    bool* panels[] = {&p->show_settings, &p->show_scenes, &p->show_graphs, &p->show_micro, &p->show_help, &p->edits.shown};
    if (p->hand.what) {
        player_release(p);
        return;
    }
    if (p->edits.held) {
        p->edits.held = HANDLE_NONE;
        return;
    }
    for (size_t i = 0; i < sizeof panels / sizeof panels[0]; i++)
        if (*panels[i] && !p->hide_all) {
            *panels[i] = false;
            return;
        }
    p->quit = true;
}
static void do_quit(player* p) { p->quit = true; }

static void do_pause(player* p)
{
    p->paused = !p->paused;
    p->steps = 0;
}
static void do_step(player* p)
{
    p->paused = true;
    p->steps++;
}
static void set_speed(player* p, float speed)
{
    p->world.speed = fminf(fmaxf(speed, 1.0f / 64), 100);
    es_world_configure(p->session.world, &p->world);
    player_notice(p, "speed %.3g", (double)p->world.speed);
}
static void do_slower(player* p) { set_speed(p, p->world.speed > 0 ? p->world.speed / 2 : 1); }
static void do_faster(player* p) { set_speed(p, p->world.speed > 0 ? p->world.speed * 2 : 1); }
static void do_normal(player* p) { set_speed(p, 1); }

static void wind(player* p, int states)
{
    player_history* h = &p->history;
    int at = (int)h->at + states;
    if (!h->count || p->replaying) return;
    p->paused = true;
    p->steps = 0;
    player_release(p);
    player_keep_edits(p, false);
    if (history_go(h, p->session.world, at < 0 ? 0 : (uint32_t)at) != ES_OK) player_notice(p, "%s", es_context_message(p->session.context));
    player_release(p);
    player_keep_edits(p, true);
    fly_camera_place(&p->nodes.fly, p->session.world);
    p->world = es_world_get_settings(p->session.world);
}
static void do_back(player* p) { wind(p, -1); }
static void do_forth(player* p) { wind(p, 1); }
static void do_start(player* p) { wind(p, -HISTORY_STATES); }

static void do_camera(player* p) { fly_camera_reset(&p->nodes.fly, p->session.world); }
/* All the light, its direct part, its indirect part. */
static void do_light_part(player* p)
{
    size_t direct = image_index("direct"), indirect = image_index("indirect");
    p->image = p->image == direct ? indirect : p->image == indirect ? 0 : direct;
}
static void do_image(player* p) { p->image = (p->image + 1) % es_image_name_count(); }
static void do_vpls(player* p) { p->show_vpls = !p->show_vpls; }
static void do_points(player* p) { p->show_points = !p->show_points; }
static void do_coarser(player* p)
{
    p->divisor = p->divisor % 4 + 1;
    player_notice(p, "a rendered pixel for %u of the window's", p->divisor * p->divisor);
}

static void set_exposure(player* p, float stops)
{
    es_renderer_settings settings = p->session.settings;
    settings.exposure = fminf(fmaxf(stops, -20), 20);
    player_configure(p, &settings);
}
static void do_brighter(player* p) { set_exposure(p, p->session.settings.exposure + 0.25f); }
static void do_darker(player* p) { set_exposure(p, p->session.settings.exposure - 0.25f); }
static void do_method(player* p)
{
    es_renderer_settings settings = p->session.settings;
    settings.method = settings.method < ES_GI_CLASSIC ? settings.method + 1 : settings.method == ES_GI_SECOND_ORDER ? ES_GI_NONE : settings.method == ES_GI_MICRO ? ES_GI_SECOND_ORDER : ES_GI_MICRO;
    player_configure(p, &settings);
}

static void do_split(player* p) { player_next_split(p); }
static void do_pin(player* p)
{
    p->split.former = p->session.settings;
    p->split.pinned = true;
    player_notice(p, "the other side of the split keeps these settings");
}
static void do_divider_left(player* p) { p->split.divider = fmaxf(p->split.divider - 0.05f, 0.02f); }
static void do_divider_right(player* p) { p->split.divider = fminf(p->split.divider + 0.05f, 0.98f); }

static void do_grab(player* p) { player_grab(p); }
static void do_throw(player* p) { player_throw(p); }
static void do_tear(player* p) { player_tear(p); }
static void do_unhook(player* p) { player_unhook(p); }
static void do_hold_light(player* p) { player_hold_next_light(p); }
static void do_lights_home(player* p) { player_lights_home(p); }
static void do_show_lights(player* p) { p->hand.show_lights = !p->hand.show_lights; }

static void do_reflections(player* p)
{
    p->edits.shown = !p->edits.shown;
    if (p->edits.shown) p->hide_all = false;
}
static void do_add_constraint(player* p) { player_add_constraint(p); }
static void do_add_region(player* p) { player_add_region(p); }
static void do_next_handle(player* p) { player_hold_next_handle(p); }
static void do_delete_edit(player* p) { player_delete_edit(p); }
static void do_freeze(player* p) { player_freeze(p); }
static void do_return_to_view(player* p) { player_return_to_view(p); }
static void do_undo(player* p) { player_undo_edit(p); }
static void do_redo(player* p) { player_redo_edit(p); }
static void do_save_edits(player* p) { player_save_edits(p); }
static void do_load_edits(player* p) { player_load_edits(p); }

static void do_png(player* p) { player_screenshot(p, false); }
static void do_exr(player* p) { player_screenshot(p, true); }
static void do_sequence(player* p) { player_toggle_sequence(p); }
static void do_print(player* p)
{
    player_print_settings(p);
    player_notice(p, "the settings are on standard output");
}

/* ---- the table ------------------------------------------------------------------------------------------------------------- */

typedef enum modifier { PLAIN, CONTROL } modifier;
typedef struct command {
    int key;         /* 0: the text tells of something that is done elsewhere; a group's name without shown key */
    modifier with;
    bool repeats;
    void (*run)(player* p);
    const char *shown, *text;
} command;

static const command commands[] = {
    {0, PLAIN, false, NULL, NULL, "Panels"},
    {'H', PLAIN, false, do_help, "H F1", "these keys"},
    {'M', PLAIN, false, do_scenes, "M F2", "scenes"},
    {'O', PLAIN, false, do_settings, "O F3", "settings"},
    {'/', PLAIN, false, do_find, "/", "find a setting"},
    {'T', PLAIN, false, do_graphs, "T F4", "graphs: time, flicker, motion"},
    {'Y', PLAIN, false, do_timeline, "Y", "time line"},
    {'M', CONTROL, false, do_micro, "Ctrl M", "micro-buffers under the mouse"},
    {'U', PLAIN, false, do_hide, "U", "hide everything, show it again"},
    {0, PLAIN, false, NULL, "Tab ↑ ↓ ← →", "between panels, within one"},
    {0, PLAIN, false, NULL, "Enter Delete", "do or type a value, reset it"},
    {'=', CONTROL, true, do_larger, "Ctrl + -", "larger, smaller text"},
    {ES_KEY_ESCAPE, PLAIN, false, do_escape, "Esc", "let go, close, quit"},
    {0, PLAIN, false, NULL, NULL, "Time"},
    {' ', PLAIN, false, do_pause, "Space", "pause, go on"},
    {'N', PLAIN, true, do_step, "N", "one step"},
    {'[', PLAIN, true, do_back, "[ Backspace", "wind back"},
    {']', PLAIN, true, do_forth, "]", "wind forth"},
    {'\\', PLAIN, false, do_start, "\\", "to the beginning"},
    {'Z', PLAIN, false, do_slower, "Z X", "slower, faster"},
    {'C', PLAIN, false, do_normal, "C", "normal speed"},
    {0, PLAIN, false, NULL, NULL, "Camera"},
    {0, PLAIN, false, NULL, "W A S D Q E", "fly, down, up (Shift: faster)"},
    {0, PLAIN, false, NULL, "drag ↑ ↓ ← →", "look around (right: always)"},
    {'R', PLAIN, false, do_camera, "R", "the scene's own camera"},
    {0, PLAIN, false, NULL, NULL, "Hand"},
    {0, PLAIN, false, NULL, "drag", "grab bodies and cloth, throw them"},
    {'F', PLAIN, false, do_grab, "F", "grab in the middle, let go"},
    {ES_KEY_ENTER, PLAIN, false, do_throw, "Enter", "throw what is held"},
    {'X', CONTROL, false, do_tear, "middle, Ctrl X", "tear cloth"},
    {'D', CONTROL, false, do_unhook, "Ctrl D", "take cloth off its hooks"},
    {'K', PLAIN, false, do_hold_light, "K", "hold the next light"},
    {0, PLAIN, false, NULL, "↑ ↓ ← →", "move what is held"},
    {0, PLAIN, false, NULL, "wheel PgUp PgDn", "nearer, farther"},
    {'J', PLAIN, false, do_show_lights, "J", "show the lights, to drag them"},
    {'J', CONTROL, false, do_lights_home, "Ctrl J", "lights back to their places"},
    {0, PLAIN, false, NULL, NULL, "Reflections"},
    {'E', CONTROL, false, do_reflections, "Ctrl E", "edit them: panel and handles"},
    {0, PLAIN, false, NULL, "drag", "red: where; green: what; blue: region"},
    {'N', CONTROL, false, do_add_constraint, "Ctrl N", "a constraint in the middle"},
    {'G', CONTROL, false, do_add_region, "Ctrl G", "a region in the middle"},
    {'H', CONTROL, false, do_next_handle, "Ctrl H", "hold the next handle"},
    {'K', CONTROL, false, do_delete_edit, "Ctrl K", "delete what is chosen"},
    {'F', CONTROL, false, do_freeze, "Ctrl F", "freeze, as seen from here"},
    {'V', CONTROL, false, do_return_to_view, "Ctrl V", "return to a constraint's view"},
    {'Z', CONTROL, true, do_undo, "Ctrl Z Y", "undo, redo"},
    {'W', CONTROL, false, do_save_edits, "Ctrl W L", "save, load"},
    {0, PLAIN, false, NULL, NULL, "Picture"},
    {'L', PLAIN, false, do_light_part, "L", "light: all, direct, indirect"},
    {'I', PLAIN, false, do_image, "I 1 … 9", "next image, by number"},
    {'V', PLAIN, false, do_vpls, "V P", "virtual lights, shadow points"},
    {'G', PLAIN, false, do_method, "G", "indirect: none, ism, classic, micro"},
    {'=', PLAIN, true, do_brighter, "+ -", "exposure"},
    {'R', CONTROL, false, do_coarser, "Ctrl R", "coarser pixels"},
    {0, PLAIN, false, NULL, NULL, "Compare"},
    {'B', PLAIN, false, do_split, "B F5", "split: former settings, reference"},
    {'B', CONTROL, false, do_pin, "Ctrl B", "keep these for the other side"},
    {',', PLAIN, true, do_divider_left, ", .", "move the divider"},
    {0, PLAIN, false, NULL, NULL, "Keep"},
    {ES_KEY_F1 + 8, PLAIN, false, do_png, "F9", "screenshot, PNG"},
    {ES_KEY_F1 + 9, PLAIN, false, do_exr, "F10", "screenshot, EXR"},
    {ES_KEY_F1 + 11, PLAIN, false, do_sequence, "F12", "record an image sequence"},
    {'S', CONTROL, false, do_print, "Ctrl S", "print the settings"},
    {'Q', CONTROL, false, do_quit, "Ctrl Q", "quit"},
    /* other keys of what stands above */
    {ES_KEY_F1, PLAIN, false, do_help, "", NULL},
    {ES_KEY_F1 + 1, PLAIN, false, do_scenes, "", NULL},
    {ES_KEY_F1 + 2, PLAIN, false, do_settings, "", NULL},
    {ES_KEY_F1 + 3, PLAIN, false, do_graphs, "", NULL},
    {ES_KEY_F1 + 4, PLAIN, false, do_split, "", NULL},
    {'+', CONTROL, true, do_larger, "", NULL},
    {'-', CONTROL, true, do_smaller, "", NULL},
    {ES_KEY_BACKSPACE, PLAIN, true, do_back, "", NULL},
    {'X', PLAIN, false, do_faster, "", NULL},
    {'Y', CONTROL, true, do_redo, "", NULL},
    {'L', CONTROL, false, do_load_edits, "", NULL},
    {'P', PLAIN, false, do_points, "", NULL},
    {'+', PLAIN, true, do_brighter, "", NULL},
    {'-', PLAIN, true, do_darker, "", NULL},
    {'.', PLAIN, true, do_divider_right, "", NULL},
};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

bool player_command_text(size_t index, const char** key, const char** text)
{
    if (index >= COMMAND_COUNT || !commands[index].text) return false;
    *key = commands[index].shown;
    *text = commands[index].text;
    return true;
}

/* A replay is what was recorded and nothing else. */
static bool changes_world(const command* c)
{
    void (*const all[])(player*) = {do_slower, do_faster, do_normal, do_back, do_forth, do_start, do_camera, do_grab, do_throw, do_tear, do_unhook, do_hold_light, do_lights_home, do_add_constraint, do_add_region, do_next_handle, do_delete_edit, do_freeze, do_return_to_view, do_undo, do_redo, do_load_edits};
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        if (c->run == all[i]) return true;
    return false;
}

bool player_with_control(const es_window_input* input) { return input->down[ES_KEY_CONTROL] || input->pressed[ES_KEY_CONTROL]; }

void player_take_keys(player* p, const es_window_input* input)
{
    bool control = player_with_control(input);
    for (size_t i = 0; i < COMMAND_COUNT && !p->quit; i++) {
        const command* c = &commands[i];
        if (p->replaying && changes_world(c)) continue;
        if (c->key && control == (c->with == CONTROL) && (c->repeats ? input->repeated : input->pressed)[c->key]) c->run(p);
    }
    for (size_t i = 0; i < 9 && i < es_image_name_count() && !control; i++)
        if (input->pressed['1' + i]) p->image = i;
}

void player_wind(player* p, uint32_t at) { wind(p, (int)at - (int)p->history.at); }
