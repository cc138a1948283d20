/* `earthshine render`: frames without a window, to files, hashes and statistics. Refusals come before the first frame. */
#include "demo.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

/* One frame of --stats: {"frame":0,"ms":…,"passes":[{"name":…,"ms":…,"skipped":null|"why","count":…,"unit":…}],
 *  "bounces":[{"bounce":1,"vpls":…,"power":[R,G,B],"ms":…,"map_ms":…}],"raster":{…}} */
static void add_frame_stats(demo_text* text, uint32_t frame, const es_frame_stats* stats)
{
    demo_text_add(text, "\n{\"frame\":%u,\"ms\":%.6g,\"passes\":[", frame, stats->milliseconds);
    for (size_t i = 0; i < stats->pass_count; i++) {
        const es_pass_stats* pass = &stats->passes[i];
        demo_text_add(text, "%s\n {\"name\":", i ? "," : "");
        demo_text_add_json_string(text, pass->name);
        demo_text_add(text, ",\"ms\":%.6g,\"skipped\":", pass->milliseconds);
        if (pass->skipped)
            demo_text_add_json_string(text, pass->skipped);
        else
            demo_text_add(text, "null");
        demo_text_add(text, ",\"count\":%" PRIu64 ",\"unit\":", pass->count);
        demo_text_add_json_string(text, pass->unit ? pass->unit : "");
        demo_text_add(text, "}");
    }
    demo_text_add(text, "],\n \"bounces\":[");
    for (size_t i = 0; i < stats->bounce_count; i++) {
        const es_bounce_stats* b = &stats->bounces[i];
        demo_text_add(text, "%s{\"bounce\":%zu,\"vpls\":%u,\"power\":[%.6g,%.6g,%.6g],\"ms\":%.6g,\"map_ms\":%.6g}", i ? "," : "", i + 1, b->vpls, b->power[0], b->power[1], b->power[2],
            b->milliseconds, b->map_milliseconds);
    }
    const es_raster_stats* raster = &stats->raster;
    demo_text_add(text,
        "],\n \"raster\":{\"instances\":%" PRIu64 ",\"instances_culled\":%" PRIu64 ",\"triangles\":%" PRIu64
        ",\"triangles_culled\":%" PRIu64 ",\"triangles_clipped\":%" PRIu64 ",\"tile_triangles\":%" PRIu64
        ",\"tile_triangles_hidden\":%" PRIu64 ",\"pixels\":%" PRIu64 "}}",
        raster->instances, raster->instances_culled, raster->triangles, raster->triangles_culled, raster->triangles_clipped,
        raster->tile_triangles, raster->tile_triangles_hidden, raster->pixels);
}

static int write_frame(const demo_options* options, demo_session* session, uint32_t frame)
{
    for (size_t i = 0; i < options->image_count; i++) {
        es_image image = {0};
        if (es_renderer_image(session->renderer, options->images[i], &image) != ES_OK)
            return demo_refuse_context(session->context);
        int code = DEMO_OK;
        if (options->hash) printf("frame %u %s %016" PRIx64 "\n", frame, options->images[i], es_image_hash(&image));
        if (options->out) {
            char path[DEMO_PATH_SIZE];
            demo_expand_pattern(options->out, frame, path);
            es_image_save_desc desc = demo_save_desc();
            if (es_image_save(session->context, &image, path, &desc) != ES_OK) code = demo_refuse_context(session->context);
        }
        es_image_destroy(session->context, &image);
        if (code != DEMO_OK) return code;
    }
    return DEMO_OK;
}

/* A recording has as many frames as steps: all of them, or those that were asked for. */
static int fit_replay(demo_options* options, uint32_t steps)
{
    if (!options->frames_given) options->end = steps;
    if (options->end > steps) return demo_refuse("--replay %s: there are %u frames, --frames asks for %u", options->replay, steps, options->end);
    return options->out ? demo_check_pattern("--out", options->out, options->end - options->first) : DEMO_OK;
}

int demo_render_frames(const demo_options* given, bool show_progress)
{
    demo_options options = *given;
    if (!options.image_count) options.images[options.image_count++] = es_image_name(0);
    if (options.out) {
        char path[DEMO_PATH_SIZE];
        if (options.image_count > 1)
            return demo_refuse("--out takes one image; %zu were named with --image", options.image_count);
        if (demo_check_pattern("--out", options.out, options.end - options.first) != DEMO_OK) return DEMO_BAD_INPUT;
        demo_expand_pattern(options.out, options.first, path);
        if (demo_check_writable(path) != DEMO_OK) return DEMO_BAD_INPUT;
    }
    if (options.stats && demo_check_writable(options.stats) != DEMO_OK) return DEMO_BAD_INPUT;
    if (options.record && demo_check_writable(options.record) != DEMO_OK) return DEMO_BAD_INPUT;

    demo_session session;
    int code = demo_session_open(&options, &session);
    if (code != DEMO_OK) return code;
    if (session.replay && fit_replay(&options, es_recording_steps(session.replay)) != DEMO_OK) {
        demo_session_close(&session);
        return DEMO_BAD_INPUT;
    }
    const bool shows = options.out || options.hash || options.stats;
    demo_text stats = {0};
    demo_text_add(&stats, "{\"machine\":");
    demo_text_add_machine(&stats, session.context);
    demo_text_add(&stats, ",\n\"frames\":[");
    bool terminal = show_progress && isatty(STDERR_FILENO);
    for (uint32_t frame = 0; frame < options.end && code == DEMO_OK; frame++) {
        code = demo_session_step(&session, frame, options.fps);
        if (code != DEMO_OK || frame < options.first || !shows) continue;
        if (es_renderer_render(session.renderer, session.world) != ES_OK) {
            code = demo_refuse_context(session.context);
            break;
        }
        if (options.stats) {
            if (frame != options.first) demo_text_add(&stats, ",");
            add_frame_stats(&stats, frame, es_renderer_stats(session.renderer));
        }
        code = write_frame(&options, &session, frame);
        if (terminal) fprintf(stderr, "\rframe %u of %u", frame - options.first + 1, options.end - options.first);
    }
    if (terminal) fputs("\r\033[K", stderr);
    if (code == DEMO_OK && options.stats) {
        demo_text_add(&stats, "],\n\"peak_bytes\":%zu}\n", es_context_peak_bytes(session.context));
        code = stats.failed ? demo_refuse("%s: out of memory", options.stats)
                            : demo_write_text(options.stats, stats.bytes, stats.size);
    }
    demo_text_free(&stats);
    if (code == DEMO_OK && options.record) code = demo_record_end(&session, options.record);
    if (code == DEMO_OK && session.replay) fprintf(stderr, "earthshine: %u steps replayed as they were recorded\n", options.end);
    demo_session_close(&session);
    if (code == DEMO_OK && fflush(stdout) != 0) code = demo_refuse("standard output cannot be written");
    return code;
}

int demo_render(int count, char** arguments)
{
    demo_options options;
    if (demo_parse_options("render", count, arguments, &options) != DEMO_OK) return DEMO_BAD_INPUT;
    if (!options.scene && !options.replay) return demo_refuse("render: a scene or a glTF file is expected; `earthshine scenes` lists the scenes");
    if (!options.out && !options.hash && !options.stats && !options.record && !options.replay)
        return demo_refuse("render: nothing would come of it; give --out FILE, --hash, --stats FILE, --record FILE or --replay FILE");
    return demo_render_frames(&options, options.end - options.first > 1);
}
