/* `earthshine play`: a window on a moving scene, and everything that can be done to it there. Without a display the frames go to files. */
#include "overlay.h"
#include "player.h"

#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void player_notice(player* p, const char* format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(p->notice, sizeof p->notice, format, arguments);
    va_end(arguments);
    p->notice_until = demo_seconds() + 4;
    p->hint = false;
}

/* ---- the picture ------------------------------------------------------------------------------------------------------------ */

static int fit_canvas(player* p)
{
    size_t pixels = (size_t)p->input.width * p->input.height;
    if (pixels > p->canvas_pixels) {
        uint32_t* grown = realloc(p->canvas.pixels, pixels * sizeof *grown);
        if (!grown) return demo_refuse("out of memory for the window's picture");
        p->canvas.pixels = grown;
        p->canvas_pixels = pixels;
    }
    p->canvas.width = p->input.width;
    p->canvas.height = p->input.height;
    canvas_clip_all(&p->canvas);
    return DEMO_OK;
}

/* Each pixel as many of the canvas as fit: what is rendered coarser stays sharp-edged rather than blurred. */
static void draw_picture(demo_canvas* canvas, const uint32_t* pixels, uint32_t width, uint32_t height)
{
    for (uint32_t y = 0; y < canvas->height; y++) {
        const uint32_t* from = pixels + (size_t)((uint64_t)y * height / canvas->height) * width;
        uint32_t* to = canvas->pixels + (size_t)y * canvas->width;
        if (width == canvas->width) memcpy(to, from, width * sizeof *to);
        else
            for (uint32_t x = 0; x < canvas->width; x++) to[x] = from[(uint64_t)x * width / canvas->width];
    }
}

static void draw_markers(player* p)
{
    es_raster_view view;
    if (!p->show_vpls && !p->show_points) return;
    if (es_world_camera_view(p->session.world, es_world_active_camera(p->session.world), p->canvas.width, p->canvas.height, &view) != ES_OK) return;
    es_image depth = {0};
    es_renderer_image(p->session.renderer, "depth", &depth);
    if (p->show_points) demo_draw_points(&p->canvas, p->session.renderer, &view, &depth, 0);
    if (p->show_vpls) demo_draw_vpls(&p->canvas, p->session.renderer, &view, &depth);
    es_image_destroy(p->session.context, &depth);
}

static int draw(player* p)
{
    es_renderer* renderer = p->session.renderer;
    uint32_t width, height;
    const uint32_t* display = es_renderer_display(renderer, &width, &height);
    if (!p->input.width || !p->input.height || !display) return DEMO_OK; /* minimised */
    if (fit_canvas(p) != DEMO_OK) return DEMO_BAD_INPUT;
    draw_picture(&p->canvas, display, width, height);
    const char* name = es_image_name(p->image);
    if (p->image != 0) {
        es_image image = {0};
        if (es_renderer_image(renderer, name, &image) == ES_OK) demo_draw_image(&p->canvas, &image, name, p->session.settings.exposure);
        es_image_destroy(p->session.context, &image);
    }
    player_split_draw(p);
    draw_markers(p);
    player_capture_frame(p);
    double start = demo_seconds();
    ui_draw_on(&p->ui, &p->canvas);
    player_hand_draw(p);
    player_edits_draw(p);
    player_build_panels(p);
    ui_end(&p->ui);
    p->interface_milliseconds += ((demo_seconds() - start) * 1000 - p->interface_milliseconds) * 0.1;
    es_window_present(p->window, p->canvas.pixels, p->canvas.width, p->canvas.height);
    return DEMO_OK;
}

/* ---- the loop --------------------------------------------------------------------------------------------------------------- */

/* Seconds that the world advances by; its own speed comes on top. */
static float next_step(player* p, float elapsed)
{
    float captured = player_capture_step(p), step = captured > 0 ? captured : elapsed;
    if (!p->paused) return step;
    if (!p->steps) return 0;
    p->steps--;
    return p->world.step;
}

/* As many recorded steps as the time that has passed holds; a paused replay makes one when asked to. */
static int advance_replay(player* p, float elapsed)
{
    uint32_t end = es_recording_steps(p->session.replay), wanted = p->paused ? p->steps : UINT32_MAX;
    p->steps = 0;
    p->replay_time = fminf(p->replay_time + (p->paused ? 0 : elapsed), 0.2f);
    while (wanted-- && p->replayed < end) {
        float dt = es_recording_dt(p->session.replay, p->replayed);
        if (!p->paused && dt > p->replay_time) break;
        int code = demo_replay_step(&p->session, p->replayed);
        if (code == DEMO_BAD_INPUT) return code;
        p->replay_time -= p->paused ? 0 : dt;
        p->replayed++;
        history_add(&p->history, p->session.world);
        if (code != DEMO_EXCEEDED) continue;
        p->differed = true;
        player_end_replay(p, p->session.difference);
        return DEMO_OK;
    }
    if (p->replayed == end) player_end_replay(p, "ended as it was recorded");
    return DEMO_OK;
}

static int advance_live(player* p, float elapsed)
{
    float dt = next_step(p, elapsed);
    if (player_hand_pull(p) != DEMO_OK || es_world_step(p->session.world, dt) != ES_OK || player_hand_apply(p) != DEMO_OK)
        return demo_refuse_context(p->session.context);
    if (dt > 0) history_add(&p->history, p->session.world);
    return DEMO_OK;
}

static int advance(player* p, float elapsed)
{
    es_world* world = p->session.world;
    if ((p->replaying ? advance_replay(p, elapsed) : advance_live(p, elapsed)) != DEMO_OK) return DEMO_BAD_INPUT;
    if (p->input.width && p->input.height && p->input.width <= ES_RASTER_MAX_SIZE && p->input.height <= ES_RASTER_MAX_SIZE) {
        p->session.settings.width = (p->input.width + p->divisor - 1) / p->divisor;
        p->session.settings.height = (p->input.height + p->divisor - 1) / p->divisor;
    }
    if (es_renderer_configure(p->session.renderer, &p->session.settings) != ES_OK || es_renderer_render(p->session.renderer, world) != ES_OK)
        return demo_refuse_context(p->session.context);
    player_graphs_add(p);
    return player_split_update(p);
}

/* A key that went down with Control is a command until it comes up again, also when Control is let go first. */
static void leave_commands(player* p, es_window_input* input)
{
    bool control = player_with_control(&p->input);
    for (int key = 0; key < ES_KEY_ESCAPE; key++) {
        p->commanded[key] = p->input.down[key] && (p->commanded[key] || control);
        if (p->commanded[key]) input->down[key] = false;
    }
}

/* Keys and clicks that wait behind the first since the last frame, each with an interface of its own, which is drawn but not shown: a frame
 * that takes long loses none of them. */
static void take_waiting(player* p)
{
    while (p->input.more && p->canvas.pixels && !p->quit && !p->wanted_scene[0]) {
        es_window_input input = ui_game_input(&p->ui);
        player_take_keys(p, &input);
        leave_commands(p, &input);
        const bool clicked = input.mouse_pressed[0] || input.mouse_pressed[2] || input.mouse_released[0];
        if (clicked && !player_split_drag(p, &input) && !p->replaying && !player_edits_update(p, &input)) player_hand_update(p, &input);
        ui_draw_on(&p->ui, &p->canvas);
        player_build_panels(p);
        ui_end(&p->ui);
        es_window_poll(p->window, &p->input);
        ui_begin(&p->ui, &p->input);
    }
}

static int play_frame(player* p, float elapsed)
{
    take_waiting(p);
    es_window_input input = ui_game_input(&p->ui);
    player_take_keys(p, &input);
    leave_commands(p, &input);
    bool mouse_taken = player_split_drag(p, &input) || (!p->replaying && (player_edits_update(p, &input) || player_hand_update(p, &input)));
    if (mouse_taken) memset(input.mouse_down, 0, sizeof input.mouse_down);
    if ((p->hand.what && p->hand.by_keyboard) || (p->edits.held && p->edits.by_keyboard)) input.down[ES_KEY_LEFT] = input.down[ES_KEY_RIGHT] = input.down[ES_KEY_UP] = input.down[ES_KEY_DOWN] = false;
    if (!p->replaying && fly_camera_update(&p->nodes.fly, p->session.world, &input, elapsed) != DEMO_OK) return demo_refuse_context(p->session.context);
    if (advance(p, elapsed) != DEMO_OK || draw(p) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!p->wanted_scene[0]) return DEMO_OK;
    char scene[DEMO_PATH_SIZE];
    snprintf(scene, sizeof scene, "%s", p->wanted_scene);
    p->wanted_scene[0] = 0;
    if (player_open_scene(p, scene, !strcmp(scene, p->scene)) != DEMO_OK) player_notice(p, "%s cannot be opened: %s", scene, es_context_message(p->session.context));
    return DEMO_OK;
}

/* A recording is kept also when the program is told to end. */
static volatile sig_atomic_t interrupted;
static void interrupt(int signal_number)
{
    (void)signal_number;
    interrupted = 1;
}

static int play_loop(player* p)
{
    double last = demo_seconds();
    for (;;) {
        es_window_poll(p->window, &p->input);
        ui_begin(&p->ui, &p->input);
        double now = demo_seconds();
        p->seconds = (float)fmin(now - last, 0.1); /* a stall is not made up for by one long step */
        p->frame_milliseconds += ((now - last) * 1000 - p->frame_milliseconds) * (p->frame_milliseconds > 0 ? 0.1 : 1);
        last = now;
        p->quit |= interrupted != 0;
        if (p->input.close || p->quit) return DEMO_OK;
        if (play_frame(p, p->seconds) != DEMO_OK) return DEMO_BAD_INPUT;
        double spent = demo_seconds() - now;
        if (spent < 1.0 / 120) usleep((useconds_t)((1.0 / 120 - spent) * 1e6)); /* a paused scene costs nothing; nor should this loop */
    }
}

static int play_in_window(player* p)
{
    player_open_title(p);
    p->show_timeline = true;
    player_notice(p, "H: all keys   M: scenes   O: settings   Tab: by keyboard");
    p->notice_until += 6;
    p->hint = true;
    struct sigaction action = {.sa_handler = interrupt, .sa_flags = (int)SA_RESETHAND};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    p->divisor = 1;
    p->split.divider = 0.5f;
    for (size_t i = 0; p->options.image_count && i < es_image_name_count(); i++)
        if (!strcmp(es_image_name(i), p->options.images[0])) p->image = i;
    int code = play_loop(p);
    player_split_close(p);
    return code;
}

int demo_play(int count, char** arguments)
{
    demo_options options;
    if (demo_parse_options("play", count, arguments, &options) != DEMO_OK) return DEMO_BAD_INPUT;
    bool chosen = options.scene || options.replay;
    const demo_options given = options;
    if (!chosen) options.scene = "cornell";
    if (options.record && demo_check_writable(options.record) != DEMO_OK) return DEMO_BAD_INPUT;
    if (options.out || options.frames_given || options.hash || options.stats) return play_to_files(&options, "");

    player* p = calloc(1, sizeof *p);
    if (!p) return demo_refuse("out of memory");
    p->options = options;
    p->show_scenes = !chosen; /* the first scene plays, the others are at hand */
    if (p->show_scenes) ui_focus_on(&p->ui, "scenes");
    es_result opened = ES_OK;
    int code = demo_session_open_context(&options, &p->session);
    if (code == DEMO_OK && options.replay) code = demo_replay_load(&p->session, &p->options);
    if (code == DEMO_OK) code = player_open_scene(p, p->options.scene, false);
    if (code == DEMO_OK) {
        es_window_desc desc = {"Earthshine", p->session.settings.width, p->session.settings.height};
        opened = es_window_create(p->session.context, &desc, &p->window);
        bool without = opened == ES_NO_DISPLAY || opened == ES_NOT_BUILT;
        if (opened == ES_OK) code = play_in_window(p);
        else if (!without) code = demo_refuse_context(p->session.context);
    }
    if (p->window) es_window_destroy(p->window);
    if (p->session.recording && !p->window) es_recording_destroy(p->session.recording), p->session.recording = NULL;
    player_close_scene(p);
    es_recording_destroy(p->session.replay);
    if (code == DEMO_OK && p->failed) code = DEMO_BAD_INPUT;
    if (code == DEMO_OK && p->differed) code = DEMO_EXCEEDED;
    if (p->session.context) es_context_destroy(p->session.context);
    free(p->graphs.luminance);
    free(p->canvas.pixels);
    free(p);
    if (opened == ES_NO_DISPLAY || opened == ES_NOT_BUILT) {
        options = given;
        if (!chosen) options.scene = "cornell";
        return play_to_files(&options, opened == ES_NO_DISPLAY ? "No display here: " : "Built without a window: ");
    }
    return code;
}
