/* `earthshine play`: a window on a moving scene. Without a display the frames go to files, and one line says where. */
#include "fly_camera.h"
#include "overlay.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct player {
    demo_session session;
    es_window* window;
    fly_camera fly;
    size_t image; /* index into the renderer's images; 0 is the displayed one */
    bool paused, single_step, show_vpls, show_points, show_timings, show_help;
    uint32_t* canvas;
    size_t canvas_pixels;
    double frame_milliseconds; /* smoothed */
} player;

static size_t image_index(const char* name)
{
    for (size_t i = 0; i < es_image_name_count(); i++)
        if (!strcmp(es_image_name(i), name)) return i;
    return 0;
}

/* L: all the light, its direct part, its indirect part. */
static size_t next_light_image(size_t image)
{
    size_t direct = image_index("direct"), indirect = image_index("indirect");
    return image == direct ? indirect : image == indirect ? 0 : direct;
}

static void take_keys(player* p, const es_window_input* input)
{
    size_t images = es_image_name_count();
    if (input->pressed[ES_KEY_SPACE]) p->paused = !p->paused;
    if (input->pressed['N']) p->paused = p->single_step = true;
    if (input->pressed['I']) p->image = (p->image + 1) % images;
    for (size_t i = 0; i < 9 && i < images; i++)
        if (input->pressed['1' + i]) p->image = i;
    if (input->pressed['L']) p->image = next_light_image(p->image);
    if (input->pressed['V']) p->show_vpls = !p->show_vpls;
    if (input->pressed['P']) p->show_points = !p->show_points;
    if (input->pressed['T']) p->show_timings = !p->show_timings;
    if (input->pressed['H'] || input->pressed[ES_KEY_F1]) p->show_help = !p->show_help;
    if (input->pressed['G']) p->session.settings.method = (p->session.settings.method + 1) % 3;
    if (input->pressed['+'] || input->pressed['='])
        p->session.settings.exposure = fminf(p->session.settings.exposure + 0.25f, 20);
    if (input->pressed['-']) p->session.settings.exposure = fmaxf(p->session.settings.exposure - 0.25f, -20);
    if (input->pressed['R']) fly_camera_reset(&p->fly, p->session.world);
}

/* The renderer's picture (or another of its images) with the overlays that are on. */
static int present(player* p)
{
    es_renderer* renderer = p->session.renderer;
    demo_canvas canvas = {NULL, 0, 0};
    const uint32_t* display = es_renderer_display(renderer, &canvas.width, &canvas.height);
    size_t pixels = (size_t)canvas.width * canvas.height;
    if (!display || !pixels) return DEMO_OK;
    if (pixels > p->canvas_pixels) {
        uint32_t* grown = realloc(p->canvas, pixels * sizeof *grown);
        if (!grown) return demo_refuse("out of memory for the window's picture");
        p->canvas = grown;
        p->canvas_pixels = pixels;
    }
    canvas.pixels = p->canvas;
    memcpy(canvas.pixels, display, pixels * sizeof *canvas.pixels);
    const char* name = es_image_name(p->image);
    if (p->image != 0) {
        es_image image = {0};
        if (es_renderer_image(renderer, name, &image) == ES_OK)
            demo_draw_image(&canvas, &image, name, p->session.settings.exposure);
        es_image_destroy(p->session.context, &image);
    }
    es_raster_view view;
    if ((p->show_vpls || p->show_points) && es_world_camera_view(p->session.world, es_world_active_camera(p->session.world),
                                                canvas.width, canvas.height, &view) == ES_OK) {
        es_image depth = {0};
        if (es_image_name_count() > 1 && image_index("depth")) es_renderer_image(renderer, "depth", &depth);
        if (p->show_points) demo_draw_points(&canvas, renderer, &view, &depth, 0);
        if (p->show_vpls) demo_draw_vpls(&canvas, renderer, &view, &depth);
        es_image_destroy(p->session.context, &depth);
    }
    if (p->show_timings) demo_draw_timings(&canvas, renderer, p->frame_milliseconds);
    if (p->show_help) demo_draw_help(&canvas);
    int scale = canvas.width >= 640 ? 2 : 1;
    char line[160];
    snprintf(line, sizeof line, "%s  %s%s  %.0f ms", name, demo_method_name(p->session.settings.method),
        p->paused ? "  paused" : "", p->frame_milliseconds);
    if (!p->show_timings) demo_draw_text(&canvas, 4 * scale, 4 * scale, scale, 0xffffff, line);
    es_window_present(p->window, canvas.pixels, canvas.width, canvas.height);
    return DEMO_OK;
}

static int play_loop(player* p)
{
    double last = demo_seconds();
    for (;;) {
        es_window_input input;
        es_window_poll(p->window, &input);
        if (input.close || input.pressed[ES_KEY_ESCAPE]) return DEMO_OK;
        double now = demo_seconds();
        float elapsed = (float)fmin(now - last, 0.1); /* a stall is not made up for by one long step */
        p->frame_milliseconds += ((now - last) * 1000 - p->frame_milliseconds) * (p->frame_milliseconds > 0 ? 0.1 : 1);
        last = now;
        take_keys(p, &input);
        if (input.width && input.height && input.width <= ES_RASTER_MAX_SIZE && input.height <= ES_RASTER_MAX_SIZE) {
            p->session.settings.width = input.width;
            p->session.settings.height = input.height;
        }
        float dt = !p->paused ? elapsed : p->single_step ? 1.0f / 30 : 0;
        p->single_step = false;
        if (fly_camera_update(&p->fly, p->session.world, &input, elapsed) != DEMO_OK ||
            es_world_step(p->session.world, dt) != ES_OK ||
            es_renderer_configure(p->session.renderer, &p->session.settings) != ES_OK ||
            es_renderer_render(p->session.renderer, p->session.world) != ES_OK)
            return demo_refuse_context(p->session.context);
        if (present(p) != DEMO_OK) return DEMO_BAD_INPUT;
        double spent = demo_seconds() - now;
        if (spent < 1.0 / 120)
            usleep((useconds_t)((1.0 / 120 - spent) * 1e6)); /* a paused scene costs nothing; nor should this loop */
    }
}

/* ---- without a window
 * -------------------------------------------------------------------------------------------------------------- */

/* A scene's name or a file's stem, with letters that suit every file system. */
static void frame_stem(const char* scene, char stem[64])
{
    const char* slash = strrchr(scene, '/');
    snprintf(stem, 64, "%s", slash ? slash + 1 : scene);
    char* dot = strrchr(stem, '.');
    if (dot && dot != stem) *dot = 0;
    for (char* c = stem; *c; c++)
        if (!strchr("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-", *c)) *c = '_';
}

static bool can_write_in(const char* directory)
{
    char probe[DEMO_PATH_SIZE + 32];
    snprintf(probe, sizeof probe, "%s/.earthshine-XXXXXX", directory);
    int file = mkstemp(probe);
    if (file < 0) return false;
    close(file);
    unlink(probe);
    return true;
}

/* ./frames where that can be written, otherwise a new directory for temporary files. */
static int choose_frames_directory(char directory[DEMO_PATH_SIZE])
{
    snprintf(directory, DEMO_PATH_SIZE, "./frames");
    if ((mkdir(directory, 0777) == 0 || errno == EEXIST) && can_write_in(directory)) return DEMO_OK;
    const char* temporary = getenv("TMPDIR");
    snprintf(directory, DEMO_PATH_SIZE, "%s/earthshine-XXXXXX", temporary && temporary[0] ? temporary : "/tmp");
    if (mkdtemp(directory)) return DEMO_OK;
    return demo_refuse("neither ./frames nor %s can be written: %s", directory, strerror(errno));
}

static int play_to_files(const demo_options* given, const char* why)
{
    demo_options options = *given;
    char directory[DEMO_PATH_SIZE], pattern[DEMO_PATH_SIZE + 128], stem[64], first[DEMO_PATH_SIZE], last[DEMO_PATH_SIZE];
    if (!options.frames_given) options.end = 60;
    if (!options.size_given) {
        options.width = 640; /* sixty frames within a minute on a small machine */
        options.height = 480;
        options.size_given = true;
    }
    if (!options.out) {
        if (choose_frames_directory(directory) != DEMO_OK) return DEMO_BAD_INPUT;
        frame_stem(options.scene, stem);
        snprintf(pattern, sizeof pattern, "%s/%s-%%04d.png", directory, stem);
        for (char* c = pattern; c < pattern + strlen(directory); c++)
            if (*c == '%') return demo_refuse("%s: a directory with a percent sign cannot take frames", directory);
        options.out = pattern;
    }
    int code = demo_render_frames(&options, true);
    if (code != DEMO_OK) {
        if (!given->out) rmdir(directory); /* stays when it holds anything */
        return code;
    }
    demo_expand_pattern(options.out, options.first, first);
    demo_expand_pattern(options.out, options.end - 1, last);
    char* path = realpath(first, NULL);
    printf("%s%u frame%s of %s rendered: %s%s%s\n", why, options.end - options.first, options.end - options.first > 1 ? "s" : "",
        options.scene, path ? path : first, options.end - options.first > 1 ? " to " : "",
        options.end - options.first > 1 ? (strrchr(last, '/') ? strrchr(last, '/') + 1 : last) : "");
    free(path);
    return DEMO_OK;
}

int demo_play(int count, char** arguments)
{
    demo_options options;
    if (demo_parse_options("play", count, arguments, &options) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!options.scene) options.scene = "cornell";
    if (options.out || options.frames_given || options.hash || options.stats) return play_to_files(&options, "");

    player p = {.show_help = true};
    int code = demo_session_open(&options, &p.session);
    if (code != DEMO_OK) return code;
    char title[256];
    snprintf(title, sizeof title, "Earthshine: %s", options.scene);
    es_window_desc desc = {title, p.session.settings.width, p.session.settings.height};
    es_result opened = es_window_create(p.session.context, &desc, &p.window);
    if (opened == ES_NO_DISPLAY || opened == ES_NOT_BUILT) {
        demo_session_close(&p.session);
        return play_to_files(&options, opened == ES_NO_DISPLAY ? "No display here: " : "Built without a window: ");
    }
    if (options.image_count) p.image = image_index(options.images[0]);
    if (opened != ES_OK || fly_camera_init(&p.fly, p.session.world) != DEMO_OK)
        code = demo_refuse_context(p.session.context);
    else
        code = play_loop(&p);
    if (p.window) es_window_destroy(p.window);
    free(p.canvas);
    demo_session_close(&p.session);
    return code;
}
