/* `earthshine reference`: pictures by path tracing, with progress, limits, and files that can be resumed. */
#include "demo.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <string.h>
#include <unistd.h>

enum { INTERRUPTED = 130 }; /* as shells report it */

static volatile sig_atomic_t interrupted;
static void interrupt(int signal_number)
{
    (void)signal_number;
    interrupted = 1;
}

static void show_time(char* text, size_t size, double seconds)
{
    if (!isfinite(seconds)) snprintf(text, size, "no limit");
    else if (seconds < 120) snprintf(text, size, "%.0f s left", seconds);
    else if (seconds < 7200) snprintf(text, size, "%.0f min left", seconds / 60);
    else snprintf(text, size, "%.1f h left", seconds / 3600);
}

/* The size of a step depends on the samples alone, so that a limit of the error is met at the same sample on every machine. */
static uint32_t next_step(const es_reference_stats* stats)
{
    uint64_t step = stats->samples / 8;
    return step < 1 ? 1 : step > 8 ? 8 : (uint32_t)step;
}

static int add_samples(es_context* context, es_reference* reference, uint32_t frame, bool terminal)
{
    for (;;) {
        es_reference_stats stats = es_reference_get_stats(reference);
        if (stats.done || (interrupted && stats.samples)) break;
        if (es_reference_add(reference, next_step(&stats)) != ES_OK) return demo_refuse_context(context);
        if (!terminal) continue;
        stats = es_reference_get_stats(reference);
        char left[64];
        show_time(left, sizeof left, stats.seconds_left);
        fprintf(stderr, "\r\033[Kframe %u: %" PRIu64 " samples a pixel, error %.3g, %.1f s, %s", frame, stats.samples, stats.error, stats.seconds, left);
    }
    if (terminal) fputs("\r\033[K", stderr);
    return DEMO_OK;
}

static bool ends_with(const char* path, const char* ending)
{
    size_t length = strlen(path);
    return length > strlen(ending) && !strcmp(path + length - strlen(ending), ending);
}

/* The file that can be resumed holds all images; a named one is written alone. */
static bool can_be_resumed(const demo_options* options, const char* path) { return ends_with(path, ".exr") && !options->image_count; }

/* A PNG is to be looked at: light is exposed as the scene is shown with. What is not light, the errors, is as it is. */
static int expose(const demo_options* options, es_context* context, const char* name, es_image* image)
{
    es_world_settings world = es_default_world_settings();
    es_renderer_settings shown = es_default_renderer_settings();
    const size_t length = strlen(name);
    if (length > 6 && !strcmp(name + length - 6, "-error")) return DEMO_OK;
    if (demo_apply_scene_settings(context, options->scene, &world, &shown, NULL) != DEMO_OK) return DEMO_BAD_INPUT;
    const float scale = exp2f(shown.exposure);
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channels; i++) image->pixels[i] *= scale;
    return DEMO_OK;
}

static int write_image(const demo_options* options, es_context* context, es_reference* reference, uint32_t frame, const char* name)
{
    char path[DEMO_PATH_SIZE] = "";
    if (options->out) demo_expand_pattern(options->out, frame, path);
    bool all = can_be_resumed(options, path);
    if (all && es_reference_save(reference, path) != ES_OK) return demo_refuse_context(context);
    if (all && !options->hash) return DEMO_OK;
    es_image image;
    if (es_reference_image(reference, name, &image) != ES_OK) return demo_refuse_context(context);
    int code = DEMO_OK;
    if (options->hash) printf("frame %u %s %016" PRIx64 "\n", frame, name, es_image_hash(&image));
    es_image_save_desc desc = demo_save_desc();
    if (options->out && ends_with(path, ".png")) code = expose(options, context, name, &image);
    if (code == DEMO_OK && options->out && !all && es_image_save(context, &image, path, &desc) != ES_OK) code = demo_refuse_context(context);
    es_image_destroy(context, &image);
    return code;
}

static void add_stats(demo_text* text, uint32_t frame, const es_reference_stats* stats)
{
    demo_text_add(text, "%s\n{\"frame\":%u,\"samples\":%" PRIu64 ",\"rays\":%" PRIu64 ",\"seconds\":%.6g,\"build_seconds\":%.6g,\"error\":",
        frame ? "," : "", frame, stats->samples, stats->rays, stats->seconds, stats->build_seconds);
    if (isfinite(stats->error)) demo_text_add(text, "%.6g}", stats->error);
    else demo_text_add(text, "null}");
}

/* Who stops a run wants what it has; it has failed only where frames are missing. */
static int report_interrupt(const demo_options* options, uint32_t frame)
{
    char path[DEMO_PATH_SIZE] = "";
    if (options->out) demo_expand_pattern(options->out, frame, path);
    bool resumable = can_be_resumed(options, path);
    fprintf(stderr, "earthshine: interrupted%s%s%s", resumable ? "; --resume " : "", resumable ? path : "", resumable ? " goes on from here" : "");
    if (frame + 1 < options->end) fprintf(stderr, "; missing are the frames from %u on", frame + 1);
    fputs("\n", stderr);
    return frame + 1 < options->end ? INTERRUPTED : DEMO_OK;
}

static int reference_frames(const demo_options* options, demo_session* session, es_reference* reference, demo_text* stats_text)
{
    static const char* const radiance[] = {"radiance"};
    const char* const* names = options->image_count ? options->images : radiance;
    size_t name_count = options->image_count ? options->image_count : 1;
    bool terminal = isatty(STDERR_FILENO);
    for (uint32_t frame = 0; frame < options->end; frame++) {
        if (demo_session_step(session, frame, options->fps) != DEMO_OK) return DEMO_BAD_INPUT;
        if (frame < options->first) continue;
        if (es_reference_begin(reference, session->world) != ES_OK) return demo_refuse_context(session->context);
        if (options->resume && es_reference_resume(reference, options->resume) != ES_OK) return demo_refuse_context(session->context);
        if (add_samples(session->context, reference, frame, terminal) != DEMO_OK) return DEMO_BAD_INPUT;
        es_reference_stats stats = es_reference_get_stats(reference);
        fprintf(stderr, "frame %u: %" PRIu64 " samples a pixel, error %.3g by its own estimate, %.1f s\n", frame, stats.samples, stats.error, stats.seconds);
        add_stats(stats_text, frame - options->first, &stats);
        for (size_t i = 0; i < name_count; i++)
            if (write_image(options, session->context, reference, frame, names[i]) != DEMO_OK) return DEMO_BAD_INPUT;
        if (interrupted) return report_interrupt(options, frame);
    }
    return DEMO_OK;
}

static int check_out(const demo_options* options)
{
    char path[DEMO_PATH_SIZE];
    if (!options->out) return DEMO_OK;
    if (options->image_count > 1) return demo_refuse("--out takes one image; %zu were named with --image", options->image_count);
    if (demo_check_pattern("--out", options->out, options->end - options->first) != DEMO_OK) return DEMO_BAD_INPUT;
    demo_expand_pattern(options->out, options->first, path);
    return demo_check_writable(path);
}

/* Names depend on the number of bounces, so the library is asked, before there is anything to show. */
static int check_images(const demo_options* options, uint32_t bounces)
{
    for (size_t i = 0; i < options->image_count; i++)
        if (!es_reference_has_image(bounces, options->images[i])) {
            char names[64] = "direct and indirect";
            if (bounces == 1) snprintf(names, sizeof names, "direct, indirect and bounce-1");
            if (bounces > 1) snprintf(names, sizeof names, "direct, indirect and bounce-1 … bounce-%u", bounces);
            return demo_refuse("--image %s: radiance, emission, %s are known, all but emission also with -error", options->images[i], names);
        }
    return DEMO_OK;
}

int demo_reference(int count, char** arguments)
{
    demo_options options;
    if (demo_parse_options("reference", count, arguments, &options) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!options.scene) return demo_refuse("reference: a scene or a glTF file is expected; `earthshine scenes` lists the scenes");
    if (!options.out && !options.hash && !options.stats)
        return demo_refuse("reference: nothing would come of it; give --out FILE, --hash or --stats FILE");
    if (options.resume && options.end - options.first > 1) return demo_refuse("--resume %s: one frame is expected, not %u", options.resume, options.end - options.first);
    if (check_out(&options) != DEMO_OK) return DEMO_BAD_INPUT;
    if (options.stats && demo_check_writable(options.stats) != DEMO_OK) return DEMO_BAD_INPUT;

    demo_session session;
    es_world_settings world_settings;
    es_reference_settings settings;
    es_reference* reference = NULL;
    demo_text stats = {0};
    int code = demo_session_open_context(&options, &session);
    if (code != DEMO_OK) return code;
    code = demo_apply_settings(session.context, &options, &world_settings, NULL, &settings);
    if (code == DEMO_OK) {
        if (!settings.max_samples && !(settings.max_seconds > 0) && !(settings.max_error > 0)) settings.max_samples = 256;
        code = check_images(&options, settings.bounces);
    }
    if (code == DEMO_OK && demo_open_world(session.context, &options, options.scene, &world_settings, &session.world) != ES_OK) code = demo_refuse_context(session.context);
    if (code == DEMO_OK && es_reference_create(session.context, &settings, &reference) != ES_OK) code = demo_refuse_context(session.context);
    if (code == DEMO_OK) {
        struct sigaction action = {.sa_handler = interrupt, .sa_flags = (int)SA_RESETHAND};
        sigaction(SIGINT, &action, NULL);
        sigaction(SIGTERM, &action, NULL);
        demo_text_add(&stats, "{\"machine\":");
        demo_text_add_machine(&stats, session.context);
        demo_text_add(&stats, ",\n\"frames\":[");
        code = reference_frames(&options, &session, reference, &stats);
    }
    if ((code == DEMO_OK || code == INTERRUPTED) && options.stats) {
        demo_text_add(&stats, "],\n\"peak_bytes\":%zu}\n", es_context_peak_bytes(session.context));
        int written = stats.failed ? demo_refuse("%s: out of memory", options.stats) : demo_write_text(options.stats, stats.bytes, stats.size);
        if (written != DEMO_OK) code = written;
    }
    demo_text_free(&stats);
    es_reference_destroy(reference);
    demo_session_close(&session);
    if (code == DEMO_OK && fflush(stdout) != 0) code = demo_refuse("standard output cannot be written");
    return code;
}
