/* `bench error`: every setting of the table on every scene: milliseconds of a whole frame against the error of its light, and how much
 * that error changes from frame to frame. On the peers' room Embree's path tracer and ours run in the same sitting. */
#include "bench_error.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* How much is done; a quick run shows that all works, and roughly what comes out. */
typedef struct effort {
    uint32_t repetitions;
    double repetition_seconds; /* enough after this */
    uint32_t truth_samples, flicker_frames, flicker_samples, tracer_samples, agreement_samples;
    double truth_seconds, flicker_seconds, tracer_seconds, embree_seconds;
} effort;
static const effort full = {7, 2.0, 64, 4, 96, 1024, 32, 75, 6, 75, 45};
static const effort quick = {3, 0.6, 8, 3, 24, 64, 16, 9, 1.5, 9, 6};

enum { MAX_FRAMES = 4, FLICKER_PART = 4 /* of the width and height */ };

typedef struct run {
    const bench_options* options;
    effort effort;
    es_context* context;
    es_world* world;
    void* states[MAX_FRAMES]; /* of the world, frame by frame */
    size_t state_size;
    error_truth flicker_truths[MAX_FRAMES];
    uint32_t width, height;
} run;

/* ---- the scene and its truths ------------------------------------------------------------------------------------ */

/* A quarter of a degree, so that there is something to flicker where the world itself stands still. */
static void turn_camera(es_world* world)
{
    es_camera_desc camera;
    es_transform transform;
    const float half = 0.00218166f;
    if (es_world_get_camera(world, es_world_active_camera(world), &camera) != ES_OK || es_world_get_node_transform(world, camera.node, &transform) != ES_OK) return;
    es_quat q = transform.rotation, turn = {0, half, 0, sqrtf(1 - half * half)};
    transform.rotation = (es_quat){q.w * turn.x + q.x * turn.w + q.y * turn.z - q.z * turn.y, q.w * turn.y - q.x * turn.z + q.y * turn.w + q.z * turn.x,
        q.w * turn.z + q.x * turn.y - q.y * turn.x + q.z * turn.w, q.w * turn.w - q.x * turn.x - q.y * turn.y - q.z * turn.z};
    es_world_set_node_transform(world, camera.node, &transform);
}

static bool save_state(run* r, uint32_t frame)
{
    size_t size = 0;
    if (es_world_save(r->world, NULL, &size) != ES_OK) return false;
    r->states[frame] = malloc(size);
    r->state_size = size;
    return r->states[frame] && es_world_save(r->world, r->states[frame], &size) == ES_OK;
}

static const char* cache_path(const run* r, const error_scene* scene, uint32_t frame, char path[DEMO_PATH_SIZE])
{
    if (!r->options->out) return NULL;
    char name[128];
    const char* slash = strrchr(scene->name, '/');
    snprintf(name, sizeof name, "%.100s", slash ? slash + 1 : scene->name);
    snprintf(path, DEMO_PATH_SIZE, "%s/references", r->options->out);
    if (mkdir(path, 0777) != 0 && errno != EEXIST) return NULL;
    if (frame == UINT32_MAX) snprintf(path, DEMO_PATH_SIZE, "%s/references/%s-%ux%u", r->options->out, name, r->width, r->height);
    else snprintf(path, DEMO_PATH_SIZE, "%s/references/%s-%ux%u-frame-%u", r->options->out, name, r->width / FLICKER_PART, r->height / FLICKER_PART, frame);
    return path;
}

/* The frames' truths, each with noise of its own. */
static bool trace_frames(run* r, error_scene* scene)
{
    char path[DEMO_PATH_SIZE];
    for (uint32_t frame = 0; frame < r->effort.flicker_frames; frame++) {
        fprintf(stderr, "%s: the truth of moving frame %u of %u\n", scene->name, frame + 1, r->effort.flicker_frames);
        if (frame) turn_camera(r->world);
        if (es_world_step(r->world, frame ? 1.0f / 30 : 0) != ES_OK || !save_state(r, frame)) return false;
        error_effort effort = {.width = r->width / FLICKER_PART, .height = r->height / FLICKER_PART, .samples = r->effort.flicker_samples, .seed = 2 + 2 * frame,
            .seconds = r->effort.flicker_seconds};
        if (!effort.width || !effort.height) continue;
        effort.cache = cache_path(r, scene, frame, path);
        if (!error_trace_truth(r->context, r->world, &effort, &r->flicker_truths[frame])) return false;
    }
    return es_world_restore(r->world, r->states[0], r->state_size) == ES_OK;
}

static bool open_scene(run* r, error_scene* scene, const char* peers)
{
    if (es_world_open(r->context, scene->file, NULL, &r->world) != ES_OK) {
        demo_refuse_context(r->context);
        return false;
    }
    if (!trace_frames(r, scene)) return false;
    if (scene->is_room && error_load_truth(r->context, peers, &scene->truth)) {
        if (scene->truth.indirect.width == r->width && scene->truth.indirect.height == r->height) return true;
        error_truth_free(r->context, &scene->truth);
    }
    scene->is_room = false;
    fprintf(stderr, "%s: the truth, %u samples or %.0f s\n", scene->name, r->effort.truth_samples, r->effort.truth_seconds);
    char path[DEMO_PATH_SIZE];
    error_effort effort = {.width = r->width, .height = r->height, .samples = r->effort.truth_samples, .seconds = r->effort.truth_seconds};
    effort.cache = cache_path(r, scene, UINT32_MAX, path);
    return error_trace_truth(r->context, r->world, &effort, &scene->truth);
}

static void close_scene(run* r)
{
    if (r->world) es_world_destroy(r->world);
    r->world = NULL;
    for (int i = 0; i < MAX_FRAMES; i++) {
        free(r->states[i]);
        r->states[i] = NULL;
        error_truth_free(r->context, &r->flicker_truths[i]);
    }
}

/* ---- one setting ------------------------------------------------------------------------------------------------- */

static double time_frames(run* r, es_renderer* renderer)
{
    double times[16], begun = demo_seconds();
    uint32_t count = 0;
    for (int i = -1; i < (int)r->effort.repetitions && count < 16; i++) {
        double start = demo_seconds();
        if (es_renderer_render(renderer, r->world) != ES_OK) return NAN;
        double now = demo_seconds();
        bool slow = i < 0 && now - start > r->effort.repetition_seconds; /* then the first is all there will be */
        if (i >= 0 || slow) times[count++] = (now - start) * 1000;
        if (slow || (count && now - begun > r->effort.repetition_seconds)) break;
    }
    return bench_median(times, count);
}

static double measure_flicker(run* r, es_renderer* renderer)
{
    es_image frames[MAX_FRAMES] = {0};
    uint32_t count = r->effort.flicker_frames;
    bool works = true;
    for (uint32_t frame = 0; works && frame < count; frame++)
        works = es_world_restore(r->world, r->states[frame], r->state_size) == ES_OK && es_renderer_render(renderer, r->world) == ES_OK &&
                es_renderer_image(renderer, "indirect", &frames[frame]) == ES_OK;
    double flicker = works && count > 1 ? error_flicker(frames, r->flicker_truths, count) : NAN;
    for (uint32_t frame = 0; frame < count; frame++) es_image_destroy(r->context, &frames[frame]);
    es_world_restore(r->world, r->states[0], r->state_size);
    return flicker;
}

static void try_setting(run* r, error_scene* scene, const error_setting* setting)
{
    error_point* point = &scene->points[scene->count];
    *point = (error_point){.setting = setting, .milliseconds = NAN, .flicker = NAN};
    es_renderer_settings settings = es_default_renderer_settings();
    es_renderer* renderer = NULL;
    es_image indirect = {0}, whole = {0};
    settings.width = r->width;
    settings.height = r->height;
    settings.skip = false;
    bool works = error_apply(r->context, setting, &settings) && es_renderer_create(r->context, &settings, &renderer) == ES_OK;
    if (works) point->milliseconds = time_frames(r, renderer);
    works = works && es_renderer_image(renderer, "indirect", &indirect) == ES_OK && es_renderer_image(renderer, "radiance", &whole) == ES_OK;
    if (works) point->error = error_measure(r->context, &indirect, &whole, &scene->truth);
    settings.width /= FLICKER_PART;
    settings.height /= FLICKER_PART;
    if (works && settings.width && settings.height && es_renderer_configure(renderer, &settings) == ES_OK) point->flicker = measure_flicker(r, renderer);
    if (!works) demo_refuse_context(r->context);
    if (works) {
        fprintf(stderr, "%s: %s, %s: %.4g ms, relRMSE %.3f, flicker %.3f\n", scene->name, setting->series, setting->label, point->milliseconds, point->error.relrmse, point->flicker);
        scene->count++;
    }
    es_image_destroy(r->context, &indirect);
    es_image_destroy(r->context, &whole);
    if (renderer) es_renderer_destroy(renderer);
}

/* ---- all --------------------------------------------------------------------------------------------------------- */

static bool measure_scene(run* r, error_scene* scene, bench_peer* peer)
{
    bool only_tracers = r->options->only_count > 0;
    for (size_t i = 0; i < r->options->only_count; i++) only_tracers &= !strcmp(r->options->only[i], "reference-room-0.05") || !strcmp(r->options->only[i], "references-agree");
    if (only_tracers) r->effort.flicker_frames = 1, r->effort.flicker_samples = 2;
    if (!open_scene(r, scene, peer->folder)) return false;
    if (scene->is_room) {
        error_run_embree(r->context, r->options, peer, &scene->truth, r->effort.tracer_samples, r->effort.embree_seconds, &scene->embree);
        scene->truth.noise_relrmse = error_at_samples(&scene->embree.raw, (double)scene->truth.samples);
        if (scene->embree.why[0]) fprintf(stderr, "earthshine: %s\n", scene->embree.why);
        if (!error_trace_curve(r->context, r->world, &scene->truth, r->effort.tracer_samples, r->effort.tracer_seconds, &scene->ours)) return false;
        if (!error_trace_agreement(r->context, r->world, &scene->truth, r->effort.agreement_samples, r->effort.tracer_seconds, &scene->agreement)) return false;
    }
    const error_setting* setting;
    for (size_t i = 0; !only_tracers && (setting = error_setting_at(i)) != NULL && scene->count < ERROR_MAX_SETTINGS; i++)
        if (setting->quick || !r->options->quick) try_setting(r, scene, setting);
    return only_tracers || scene->count > 0;
}

static void choose_scenes(const bench_options* options, const char* peers, error_scene* scenes, size_t* count)
{
    static const char* const usual[] = {"room", "cornell", "hall"};
    char room[DEMO_PATH_SIZE + 64];
    snprintf(room, sizeof room, "%s/room_70k.glb", peers);
    FILE* file = peers[0] ? fopen(room, "rb") : NULL;
    if (file) fclose(file);
    size_t wanted = options->scene_count ? options->scene_count : sizeof usual / sizeof usual[0];
    for (size_t i = 0; i < wanted; i++) {
        error_scene* scene = &scenes[(*count)++];
        scene->name = options->scene_count ? options->scenes[i] : usual[i];
        scene->is_room = !strcmp(scene->name, "room") && file;
        snprintf(scene->file, sizeof scene->file, "%s", scene->is_room ? room : scene->name);
    }
}

static bool wants_room(const bench_options* options)
{
    for (size_t i = 0; i < options->scene_count; i++)
        if (!strcmp(options->scenes[i], "room")) return true;
    return !options->scene_count;
}

/* Why a target was not measured. */
static void say_why(const run* r, const char* no_peers, char* note, size_t size)
{
    if (no_peers[0]) snprintf(note, size, "%s", no_peers);
    else if (!wants_room(r->options)) snprintf(note, size, "the room was not among the scenes");
    else snprintf(note, size, "%s", r->options->no_peer ? "--no-peer" : "the peers have no truth of the room in this size");
}

static int write_report(const run* r, error_scene* scenes, size_t count, const char* no_peers)
{
    bench_report report = {.name = "error", .title = "How wrong each method is, for the time it takes",
        .about = "Whole frames, nothing skipped, against path-traced truth with one indirect bounce. Times are medians, taken in one sitting on the machine below."};
    bench_row all[64], rows[64];
    size_t all_count = bench_error_rows(all, 64), row_count = 0;
    demo_text_add(&report.members, ",\n\"points\":[");
    for (size_t i = 0; i < count; i++) {
        error_fill_rows(&scenes[i], all, all_count);
        error_add_points(&report.members, &scenes[i], i == 0);
        error_add_plots(&report, &scenes[i], r->width, r->height);
    }
    demo_text_add(&report.members, "\n]");
    for (size_t i = 0; i < all_count; i++)
        if (all[i].judge != BENCH_NONE && isnan(all[i].judge == BENCH_VALUE_AT_LEAST ? all[i].value : all[i].ratio) && !all[i].note[0])
            say_why(r, no_peers, all[i].note, sizeof all[i].note);
    for (size_t i = 0; i < all_count; i++)
        if (bench_wants(r->options, all[i].id) && (all[i].judge != BENCH_NONE || !isnan(all[i].value))) rows[row_count++] = all[i];
    bench_print(rows, row_count);
    return bench_report_write(&report, r->options, rows, row_count, r->context);
}

int bench_error(const bench_options* options)
{
    run r = {.options = options, .effort = options->quick ? quick : full, .width = options->width ? options->width : 1024, .height = options->height ? options->height : 768};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    if (options->samples) r.effort.truth_samples = r.effort.flicker_samples = options->samples;
    if (es_context_create(&desc, &r.context) != ES_OK) return demo_refuse("no context could be created");
    bench_peer* peer = calloc(1, sizeof *peer);
    error_scene* scenes = calloc(BENCH_MAX_SCENES + 3, sizeof *scenes);
    size_t count = 0;
    int code = peer && scenes ? DEMO_OK : demo_refuse("out of memory");
    if (code == DEMO_OK) {
        bench_peer_open(peer, BENCH_EMBREE_PATHS, !options->no_peer && wants_room(options));
        choose_scenes(options, peer->folder, scenes, &count);
    }
    for (size_t i = 0; i < count && code == DEMO_OK; i++) {
        double start = demo_seconds();
        if (!measure_scene(&r, &scenes[i], peer)) code = DEMO_BAD_INPUT;
        close_scene(&r);
        if (code == DEMO_OK) fprintf(stderr, "%s: %.0f s\n", scenes[i].name, demo_seconds() - start);
    }
    if (code == DEMO_OK) code = write_report(&r, scenes, count, wants_room(options) ? peer->why : "");
    for (size_t i = 0; i < count; i++) {
        error_truth_free(r.context, &scenes[i].truth);
        free(scenes[i].agreement.deviations);
    }
    free(scenes);
    if (peer) bench_peer_close(peer);
    free(peer);
    es_context_destroy(r.context);
    return code;
}
