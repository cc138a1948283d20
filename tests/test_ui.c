/* The player's interface without a window: drawing stays where it may, focus and mouse do what they should, sliders map settings there and
 * back, the past can be gone back to, and a picture from elsewhere is displayed as the renderer's own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <earthshine/gi.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "demos/canvas.h"
#include "demos/font.h"
#include "demos/player_history.h"
#include "demos/setting_slider.h"
#include "demos/ui.h"
#include "demos/ui_focus.h"
#include "demos/ui_plot.h"
#include "demos/ui_widgets.h"

/* ---- drawing ----------------------------------------------------------------------------------------------------------- */

enum { WIDTH = 320, HEIGHT = 200, GUARD = 4096 };
static uint32_t memory[GUARD + WIDTH * HEIGHT + GUARD];

static demo_canvas fresh_canvas(void)
{
    for (size_t i = 0; i < sizeof memory / sizeof memory[0]; i++) memory[i] = 0x123456;
    demo_canvas canvas = {.pixels = memory + GUARD, .width = WIDTH, .height = HEIGHT};
    canvas_clip_all(&canvas);
    return canvas;
}

static void assert_guards(void)
{
    for (size_t i = 0; i < GUARD; i++) {
        assert_int_equal(memory[i], 0x123456);
        assert_int_equal(memory[GUARD + WIDTH * HEIGHT + i], 0x123456);
    }
}

static void test_drawing_stays_inside(void** state)
{
    demo_canvas canvas = fresh_canvas();
    static const int places[][2] = {{-50, -50}, {WIDTH - 3, -4}, {-4, HEIGHT - 3}, {WIDTH - 3, HEIGHT - 3}, {WIDTH + 9, HEIGHT + 9}, {10, 10}};
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        int x = places[i][0], y = places[i][1];
        canvas_rect rect = {x, y, 60, 60};
        canvas_fill(&canvas, rect, 0xffffff);
        canvas_blend(&canvas, rect, 0x00ff00, 100);
        canvas_frame(&canvas, rect, 3, 0xff0000);
        canvas_line(&canvas, x, y, x + 1000, y - 700, 3, 0xff);
        canvas_label(&canvas, x, y, 3, 0xffffff, "Earthshine – 0.5 m² …");
    }
    assert_guards();
    /* nothing past the clip either */
    canvas = fresh_canvas();
    canvas_rect former = canvas_narrow_clip(&canvas, (canvas_rect){20, 20, 30, 10});
    canvas_text(&canvas, 0, 15, 2, 0xffffff, "WWWWWWWWWWWWWWWW", 99);
    size_t drawn = 0;
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            bool changed = canvas.pixels[y * WIDTH + x] != 0x123456;
            drawn += changed;
            if (changed) assert_true(canvas_inside(canvas.clip, x, y));
        }
    assert_true(drawn > 20);
    canvas.clip = former;
}

static void test_text(void** state)
{
    assert_int_equal(font_columns("abc"), 3);
    assert_int_equal(font_columns("m² …"), 4);
    assert_int_equal(font_columns("\xff\xc2"), 2); /* damaged: a box each, and an end */
    for (char c = 33; c < 127; c++) assert_true(strcmp(font_rows((uint32_t)c), font_rows(0xfffd)) != 0);
    for (char a = 33; a < 127; a++)
        for (char b = (char)(a + 1); b < 127; b++) assert_string_not_equal(font_rows((uint32_t)a), font_rows((uint32_t)b));
    /* every character of the settings' help can be shown */
    for (size_t i = 0; i < es_renderer_setting_count() + es_world_setting_count(); i++) {
        size_t renderer = es_renderer_setting_count();
        const char* help = i < renderer ? es_renderer_setting(i)->help : es_world_setting(i - renderer)->help;
        while (*help) {
            const char* at = help;
            uint32_t character = font_next(&help);
            if (character != ' ' && !strcmp(font_rows(character), font_rows(0xfffd))) fail_msg("the font lacks U+%04X of '%s'", character, at);
        }
    }
}

static void test_blending(void** state)
{
    demo_canvas canvas = fresh_canvas();
    canvas.pixels[0] = 0xff8000;
    canvas_blend(&canvas, (canvas_rect){0, 0, 1, 1}, 0x0080ff, 256);
    assert_int_equal(canvas.pixels[0], 0x0080ff);
    canvas.pixels[0] = 0xff8000;
    canvas_blend(&canvas, (canvas_rect){0, 0, 1, 1}, 0x0080ff, 0);
    assert_int_equal(canvas.pixels[0], 0xff8000);
    canvas_blend(&canvas, (canvas_rect){0, 0, 1, 1}, 0x0080ff, 128);
    assert_int_equal(canvas.pixels[0], 0x7f807f);
}

/* ---- focus --------------------------------------------------------------------------------------------------------------- */

static void test_focus_moves(void** state)
{
    /* panel 1: two rows, 11 12 13 / 14; panel 2: 21, and 22 scrolled out of sight below */
    const ui_item items[] = {{11, 1, {0, 0, 20, 10}}, {12, 1, {30, 0, 20, 10}}, {13, 1, {60, 0, 20, 10}}, {14, 1, {0, 12, 80, 10}}, {21, 2, {200, 0, 20, 10}}, {22, 2, {200, 900, 20, 10}}};
    const size_t n = sizeof items / sizeof items[0];
    const struct { ui_id from; ui_move move; ui_id to; } cases[] = {
        {0, UI_MOVE_DOWN, 11}, {99, UI_MOVE_DOWN, 11}, {11, UI_MOVE_RIGHT, 12}, {12, UI_MOVE_RIGHT, 13}, {13, UI_MOVE_RIGHT, 13},
        {13, UI_MOVE_LEFT, 12}, {12, UI_MOVE_DOWN, 14}, {14, UI_MOVE_UP, 12}, {14, UI_MOVE_DOWN, 14}, {11, UI_MOVE_UP, 11},
        {12, UI_MOVE_NEXT_PANEL, 21}, {21, UI_MOVE_DOWN, 22}, {22, UI_MOVE_NEXT_PANEL, 11}, {11, UI_MOVE_PREVIOUS_PANEL, 21}, {14, UI_MOVE_RIGHT, 14}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        if (ui_focus_move(items, n, cases[i].from, cases[i].move) != cases[i].to) fail_msg("case %zu leads elsewhere", i);
    assert_int_equal(ui_focus_move(items, 0, 11, UI_MOVE_DOWN), 0);
    assert_int_equal(ui_focus_panel(items, n, 22), 2);
    assert_int_equal(ui_focus_panel(items, n, 23), 0);
}

/* A small interface: a button and a switch, a slider, a field, and a list that scrolls. */
typedef struct fixture {
    ui u;
    demo_canvas canvas;
    es_window_input input;
    int clicks;
    bool on, open;
    float fraction;
    int steps;
    char text[32], typed[UI_EDIT_SIZE];
    ui_scroll scroll;
    int chosen;
    canvas_rect button, slider, field;
} fixture;

static void frame(fixture* f)
{
    ui* u = &f->u;
    ui_begin(u, &f->input);
    f->canvas = fresh_canvas();
    ui_draw_on(u, &f->canvas);
    if (f->open) {
        f->open = ui_panel_begin(u, "panel", (canvas_rect){10, 10, 300, 180}, "Panel");
        f->button = (canvas_rect){u->x, u->y, 40, 10};
        if (ui_button(u, "button", 8, "Button")) f->clicks++;
        if (ui_switch(u, "switch", 8, "Switch", f->on)) f->on = !f->on;
        ui_next_row(u);
        f->slider = (canvas_rect){u->x, u->y, u->right - u->x, 10};
        int steps = 0;
        ui_slider_act act = ui_slider(u, "slider", 0, &f->fraction, &steps, "value", UI_TEXT);
        if (act == UI_SLIDER_STEPPED) f->steps += steps;
        if (act == UI_SLIDER_TYPED) snprintf(f->typed, sizeof f->typed, "%s", u->edit);
        ui_next_row(u);
        f->field = (canvas_rect){u->x, u->y, 40, 10};
        ui_field(u, "field", 0, f->text, sizeof f->text, "hint");
        ui_next_row(u);
        ui_scroll_begin(u, &f->scroll, 60);
        for (int i = 0; i < 30; i++) {
            char name[16];
            snprintf(name, sizeof name, "entry %d", i);
            if (ui_button(u, name, 0, name)) f->chosen = i;
            ui_next_row(u);
        }
        ui_scroll_end(u, &f->scroll, "bar");
        ui_panel_end(u);
    }
    ui_end(u);
    assert_guards();
    es_window_input none = {.mouse_x = f->input.mouse_x, .mouse_y = f->input.mouse_y};
    none.mouse_down[0] = f->input.mouse_down[0];
    f->input = none;
}

static void press(fixture* f, int key)
{
    f->input.pressed[key] = f->input.repeated[key] = true;
    frame(f);
}

static void mouse_to(fixture* f, float x, float y)
{
    f->input.mouse_dx = x - f->input.mouse_x;
    f->input.mouse_dy = y - f->input.mouse_y;
    f->input.mouse_x = x;
    f->input.mouse_y = y;
}

static void mouse_press(fixture* f, float x, float y)
{
    mouse_to(f, x, y);
    f->input.mouse_pressed[0] = f->input.mouse_down[0] = true;
    f->input.press_x[0] = x;
    f->input.press_y[0] = y;
    frame(f);
}

static void mouse_release(fixture* f)
{
    f->input.mouse_down[0] = false;
    f->input.mouse_released[0] = true;
    frame(f);
}

static fixture* open_fixture(void)
{
    fixture* f = calloc(1, sizeof *f);
    assert_non_null(f);
    f->open = true;
    f->chosen = -1;
    frame(f);
    return f;
}

static void test_mouse(void** state)
{
    fixture* f = open_fixture();
    mouse_press(f, (float)f->button.x + 5, (float)f->button.y + 5);
    assert_int_equal(f->clicks, 1);
    frame(f); /* held: not clicked again */
    mouse_release(f);
    assert_int_equal(f->clicks, 1);
    /* a press and a release between two polls, the pointer gone on since */
    mouse_to(f, 5, 5);
    f->input.mouse_pressed[0] = f->input.mouse_released[0] = true;
    f->input.press_x[0] = (float)f->button.x + 5;
    f->input.press_y[0] = (float)f->button.y + 5;
    frame(f);
    assert_int_equal(f->clicks, 2);
    frame(f);
    /* dragging a slider goes on outside of it, and the picture behind gets nothing of it */
    mouse_press(f, (float)f->slider.x + (float)f->slider.width * 0.25f, (float)f->slider.y + 5);
    assert_true(fabsf(f->fraction - 0.25f) < 0.01f);
    mouse_to(f, (float)f->slider.x + (float)f->slider.width * 0.75f, 0);
    ui_begin(&f->u, &f->input);
    es_window_input game = ui_game_input(&f->u);
    assert_false(game.mouse_down[0]);
    frame(f);
    assert_true(fabsf(f->fraction - 0.75f) < 0.01f);
    mouse_release(f);
    mouse_to(f, (float)f->slider.x, (float)f->slider.y);
    frame(f);
    assert_true(fabsf(f->fraction - 0.75f) < 0.01f);
    /* beside the panel the press is the picture's */
    mouse_to(f, 2, 2);
    f->input.mouse_pressed[0] = f->input.mouse_down[0] = true;
    f->input.press_x[0] = f->input.press_y[0] = 2;
    ui_begin(&f->u, &f->input);
    game = ui_game_input(&f->u);
    assert_true(game.mouse_pressed[0] && game.mouse_down[0]);
    free(f);
}

static void test_keyboard(void** state)
{
    fixture* f = open_fixture();
    press(f, ES_KEY_TAB);
    press(f, ES_KEY_ENTER);
    assert_int_equal(f->clicks, 1);
    press(f, ES_KEY_RIGHT);
    press(f, ES_KEY_ENTER);
    assert_true(f->on);
    press(f, ES_KEY_DOWN); /* the slider: its arrows change it */
    press(f, ES_KEY_RIGHT);
    press(f, ES_KEY_RIGHT);
    press(f, ES_KEY_LEFT);
    assert_int_equal(f->steps, 1);
    f->input.down[ES_KEY_SHIFT] = true;
    press(f, ES_KEY_LEFT);
    assert_int_equal(f->steps, -9);
    press(f, ES_KEY_END);
    assert_true(f->fraction == 1);
    press(f, ES_KEY_ENTER);
    for (const char* c = "0.5x"; *c; c++) f->input.text[f->input.text_count++] = (uint32_t)*c;
    frame(f);
    press(f, ES_KEY_BACKSPACE);
    press(f, ES_KEY_ENTER);
    assert_string_equal(f->typed, "0.5");
    press(f, ES_KEY_DOWN); /* the field: once it is typed into, letters are its, not the camera's */
    press(f, ES_KEY_ENTER);
    f->input.text[0] = 'w';
    f->input.text_count = 1;
    f->input.down['W'] = f->input.pressed['W'] = true;
    ui_begin(&f->u, &f->input);
    es_window_input game = ui_game_input(&f->u);
    assert_false(game.down['W'] || game.pressed['W']);
    frame(f);
    assert_string_equal(f->text, "w");
    /* down the list: it scrolls after the focus, and back */
    for (int i = 0; i < 21; i++) press(f, ES_KEY_DOWN);
    press(f, ES_KEY_ENTER);
    assert_int_equal(f->chosen, 20);
    assert_true(f->scroll.offset > 0);
    press(f, ES_KEY_PAGE_UP);
    press(f, ES_KEY_ENTER);
    assert_int_equal(f->chosen, 10);
    for (int i = 0; i < 30; i++) press(f, ES_KEY_UP);
    press(f, ES_KEY_LEFT);
    assert_int_equal(f->u.focus, f->u.items[0].id);
    /* Escape closes what has the keyboard, and is nobody else's */
    f->input.pressed[ES_KEY_ESCAPE] = true;
    ui_begin(&f->u, &f->input);
    game = ui_game_input(&f->u);
    assert_false(game.pressed[ES_KEY_ESCAPE]);
    frame(f);
    assert_false(f->open);
    frame(f);
    assert_int_equal(f->u.focus, 0);
    f->input.pressed[ES_KEY_ESCAPE] = true;
    ui_begin(&f->u, &f->input);
    game = ui_game_input(&f->u);
    assert_true(game.pressed[ES_KEY_ESCAPE]);
    free(f);
}

/* ---- sliders --------------------------------------------------------------------------------------------------------------- */

static void check_setting(const es_setting* s)
{
    char text[SETTING_TEXT_SIZE];
    double usual = setting_default(s), parsed;
    setting_text(s, usual, text);
    if (!setting_parse(s, text, &parsed) || parsed != usual) fail_msg("%s: %s is not %s", s->name, text, s->default_text);
    float before = -1;
    for (int i = 0; i <= 400; i++) { /* rising, within the range, and back to where the hand is */
        float fraction = (float)i / 400;
        double value = setting_at_fraction(s, fraction);
        setting_text(s, value, text);
        if (!setting_parse(s, text, &parsed)) fail_msg("%s: %s at %g is refused", s->name, text, (double)fraction);
        float back = setting_fraction(s, value);
        if (back < before) fail_msg("%s: %s is further left than the value before", s->name, text);
        if (s->type == ES_SETTING_FLOAT && fabsf(back - fraction) > 0.02f) fail_msg("%s: %s at %g comes back at %g", s->name, text, (double)fraction, (double)back);
        before = back;
    }
    if (setting_fraction(s, setting_at_fraction(s, 0)) != 0 || setting_fraction(s, setting_at_fraction(s, 1)) != 1) fail_msg("%s: its ends are not the bar's", s->name);
    double up = setting_stepped(s, usual, 1), down = setting_stepped(s, usual, -1);
    if (setting_fraction(s, usual) < 1 && !(up > usual)) fail_msg("%s: no step up from %s", s->name, s->default_text);
    if (setting_fraction(s, usual) > 0 && !(down < usual)) fail_msg("%s: no step down from %s", s->name, s->default_text);
    setting_text(s, up, text);
    if (!setting_parse(s, text, &parsed)) fail_msg("%s: the step up to %s is refused", s->name, text);
}

static void test_sliders_of_every_setting(void** state)
{
    for (size_t i = 0; i < es_renderer_setting_count(); i++) check_setting(es_renderer_setting(i));
    for (size_t i = 0; i < es_world_setting_count(); i++) check_setting(es_world_setting(i));
    /* what is small beside its range can still be aimed at: the middle half of the bar holds the default's neighbourhood */
    const es_setting small = {"small", ES_SETTING_FLOAT, "0.026", 0, 1, NULL, "", 0}, large = {"large", ES_SETTING_FLOAT, "16000", 0.01, 1e9, NULL, "", 0};
    assert_true(setting_fraction(&small, 0.052) - setting_fraction(&small, 0.013) > 0.1f);
    assert_true(setting_fraction(&large, 32000) - setting_fraction(&large, 8000) > 0.05f);
    assert_true(fabs(setting_stepped(&small, 0.026, 1) - 0.027) < 1e-9);
    assert_true(setting_stepped(&large, 16000, -1) == 15000);
}

static void test_values_in_and_out(void** state)
{
    es_renderer_settings settings = es_default_renderer_settings();
    double value;
    for (size_t i = 0; i < es_renderer_setting_count(); i++) {
        const es_setting* s = es_renderer_setting(i);
        if (setting_value(s, &settings) != setting_default(s)) fail_msg("%s is not its default", s->name);
        setting_store(s, &settings, setting_at_fraction(s, 0.3f));
        if ((float)setting_value(s, &settings) != (float)setting_at_fraction(s, 0.3f)) fail_msg("%s does not come back", s->name);
        assert_false(setting_parse(s, "nonsense", &value));
        assert_false(setting_parse(s, "", &value));
    }
}

static bool accepts_powers(void* user, double value)
{
    ++*(int*)user;
    return fmod(log2(value), 1) == 0;
}
static bool accepts_64(void* user, double value)
{
    ++*(int*)user;
    return fmod(value, 64) == 0;
}

static void test_picky_settings(void** state)
{
    const es_setting s = {"size", ES_SETTING_INT, "128", 32, 4096, NULL, "", 0};
    int asked = 0;
    assert_true(setting_accepted(&s, 128, 129, accepts_powers, &asked) == 256);
    assert_true(setting_accepted(&s, 128, 127, accepts_powers, &asked) == 64);
    assert_true(setting_accepted(&s, 128, 1000, accepts_powers, &asked) == 1024);
    assert_true(setting_accepted(&s, 32, 31, accepts_powers, &asked) == 32);
    assert_true(setting_accepted(&s, 192, 193, accepts_64, &asked) == 256);
    assert_true(setting_accepted(&s, 192, 191, accepts_64, &asked) == 128);
    asked = 0;
    assert_true(setting_accepted(&s, 128, 128, accepts_64, &asked) == 128);
    assert_int_equal(asked, 0);
}

static void test_plots(void** state)
{
    ui_series series = {0};
    for (int i = 0; i < 1000; i++) ui_series_add(&series, (float)i);
    assert_int_equal(series.count, UI_PLOT_LENGTH);
    assert_true(ui_series_at(&series, 0) == 999 && ui_series_at(&series, UI_PLOT_LENGTH - 1) == 999 - UI_PLOT_LENGTH + 1 && ui_series_at(&series, UI_PLOT_LENGTH) == 0);
    char text[32];
    ui_series_text(&series, "%.1f ms", text, sizeof text);
    assert_string_equal(text, "999.0 ms");
    ui_series_text(&(ui_series){0}, "%.1f ms", text, sizeof text);
    assert_string_equal(text, "-");
    ui_series_add(&series, NAN);
    ui_series_text(&series, "%.1f ms", text, sizeof text);
    assert_string_equal(text, "-");
    assert_true(ui_series_largest(&series) == 999 && isfinite(ui_series_mean(&series)));
    assert_true(ui_plot_top(0.3f) == 0.5f && ui_plot_top(1) == 1 && ui_plot_top(1200) == 2000 && ui_plot_top(0) == 1 && ui_plot_top(NAN) == 1);
    demo_canvas canvas = fresh_canvas();
    ui_plot(&canvas, (canvas_rect){-20, -20, 400, 400}, &series, 100, 2, 0xffffff);
    assert_guards();
}

/* ---- the past ----------------------------------------------------------------------------------------------------------------- */

static void test_winding_back(void** state)
{
    es_context* context;
    es_world* world;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    assert_int_equal(es_world_create_scene(context, "cornell", NULL, &world), ES_OK);
    player_history* history = calloc(1, sizeof *history);
    assert_non_null(history);
    uint64_t hashes[20];
    for (int i = 0; i < 20; i++) {
        assert_int_equal(es_world_step(world, i ? 1.0f / 32 : 0), ES_OK);
        history_add(history, world);
        history_add(history, world); /* the same time: once */
        hashes[i] = es_world_hash(world);
    }
    assert_int_equal(history->count, 20);
    assert_int_equal(history_go(history, world, 7), ES_OK);
    assert_true(es_world_hash(world) == hashes[7]);
    assert_int_equal(history_go(history, world, 999), ES_OK);
    assert_true(es_world_hash(world) == hashes[19] && history->at == 19);
    /* going on from the past: the same steps again, and what came after is another future */
    assert_int_equal(history_go(history, world, 7), ES_OK);
    for (int i = 8; i < 12; i++) {
        assert_int_equal(es_world_step(world, 1.0f / 32), ES_OK);
        history_add(history, world);
        assert_true(es_world_hash(world) == hashes[i]);
    }
    assert_int_equal(history->count, 12);
    /* the oldest give way to a bound */
    history->limit = history->bytes;
    for (int i = 0; i < 5; i++) {
        assert_int_equal(es_world_step(world, 1.0f / 32), ES_OK);
        history_add(history, world);
        assert_true(history->bytes <= history->limit);
    }
    assert_int_equal(history->count, 12);
    assert_int_equal(history_go(history, world, 0), ES_OK);
    assert_true(es_world_hash(world) == hashes[5]);
    history_clear(history);
    assert_int_equal(history->bytes, 0);
    assert_int_equal(history_go(history, world, 0), ES_WRONG_STATE);
    free(history);
    es_world_destroy(world);
    es_context_destroy(context);
}

/* ---- the display of other pictures --------------------------------------------------------------------------------------------- */

static void test_tone_map(void** state)
{
    es_context* context;
    es_world* world;
    es_renderer* renderer;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    assert_int_equal(es_world_create_scene(context, "cornell", NULL, &world), ES_OK);
    assert_int_equal(es_world_step(world, 0), ES_OK);
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = 53; /* no vector's width */
    settings.height = 29;
    settings.method = ES_GI_NONE;
    settings.exposure = 1.25f;
    assert_int_equal(es_renderer_create(context, &settings, &renderer), ES_OK);
    uint32_t pixels[53 * 29];
    for (uint32_t map = 0; map < 3; map++) {
        es_image radiance;
        uint32_t width, height;
        settings.tone_map = map;
        assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
        assert_int_equal(es_renderer_render(renderer, world), ES_OK);
        assert_int_equal(es_renderer_image(renderer, "radiance", &radiance), ES_OK);
        assert_int_equal(es_tone_map_image(context, &settings, &radiance, pixels), ES_OK);
        const uint32_t* display = es_renderer_display(renderer, &width, &height);
        assert_memory_equal(pixels, display, sizeof pixels);
        es_image_destroy(context, &radiance);
    }
    es_image grey;
    assert_int_equal(es_image_create(context, 4, 4, 1, &grey), ES_OK);
    assert_int_equal(es_tone_map_image(context, &settings, &grey, pixels), ES_INVALID_ARGUMENT);
    es_image_destroy(context, &grey);
    es_renderer_destroy(renderer);
    es_world_destroy(world);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_drawing_stays_inside),
        cmocka_unit_test(test_text),
        cmocka_unit_test(test_blending),
        cmocka_unit_test(test_focus_moves),
        cmocka_unit_test(test_mouse),
        cmocka_unit_test(test_keyboard),
        cmocka_unit_test(test_sliders_of_every_setting),
        cmocka_unit_test(test_values_in_and_out),
        cmocka_unit_test(test_picky_settings),
        cmocka_unit_test(test_plots),
        cmocka_unit_test(test_winding_back),
        cmocka_unit_test(test_tone_map),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
