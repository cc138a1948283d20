/* `bench time`: light over frames: how much it flickers with history and without, how long a sudden change takes to arrive, what history costs, and what a
 * frame costs when nothing changes. The scene is a parameter: --scene, cornell-stack otherwise. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const bench_row table[] = {
    {"flicker", "change of the indirect light of points from frame to frame against a reference's, 256 lights, 120 frames: with history and steady lights", "relRMSE", "with neither", BENCH_RATIO_AT_LEAST, 5, 15},
    {"flicker-matte", "the same of points without a lobe: what a polished ball reflects does not turn with the points that show it", "relRMSE", "with neither", BENCH_RATIO_AT_LEAST, 5, 15},
    {"flicker-change", "what the reference itself changes from frame to frame", "relRMSE", NULL, BENCH_NONE, 0, 0},
    {"flicker-pixels", "the same of pixels, whatever they show", "relRMSE", "with neither", BENCH_NONE, 0, 0},
    {"lag-brighter", "frames until indirect light is within 10 % after the lamp's light is multiplied by 10", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"lag-darker", "the same, after it is divided by 10", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"lag-jump", "the same, after the lamp jumps by a tenth of the scene's extent", "frames", NULL, BENCH_VALUE_AT_MOST, 8, 3},
    {"temporal-cost", "the pass of temporal coherence, moving scene, 1024 × 768, 256 lights", "ms", NULL, BENCH_VALUE_AT_MOST, 4, 1.5},
    {"still-frame", "a frame once the picture has settled", "ms", "a frame of the moving scene", BENCH_RATIO_AT_LEAST, 10, 50},
};
enum { ROWS = sizeof table / sizeof table[0] };

size_t bench_time_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, ROWS, rows, capacity); }

typedef struct bench_time_stage {
    es_context* context;
    es_world* world;
    const bench_options* options;
    es_renderer_settings with, without; /* history and steady lights */
} bench_time_stage;

static bool open_stage(bench_time_stage* s, const bench_options* options, const char* scene)
{
    *s = (bench_time_stage){.options = options};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    if (es_context_create(&desc, &s->context) != ES_OK || es_world_create_scene(s->context, scene, NULL, &s->world) != ES_OK) return false;
    s->with = bench_settings();
    s->with.skip = true;
    s->with.vpls = 256;
    s->without = s->with;
    s->with.temporal = true;
    s->with.stable_vpls = true;
    return true;
}

static void close_stage(bench_time_stage* s)
{
    if (s->world) es_world_destroy(s->world);
    if (s->context) es_context_destroy(s->context);
}

static bool draw(bench_time_stage* s, es_renderer* renderer, es_image* image)
{
    *image = (es_image){0};
    return es_renderer_render(renderer, s->world) == ES_OK && es_renderer_image(renderer, "indirect", image) == ES_OK;
}

/* ---- flicker --------------------------------------------------------------------------------------------------------
 *
 * Of points on surfaces, not of pixels: a pixel that shows another surface than a frame ago has changed by whatever the picture is wrong about
 * between the two, which is error, not flicker. So last frame's picture is read where each pixel's point was seen then (its four pixels by
 * bilinear weights, all of the same instance and of a normal within 26 degrees; other points have no last frame and do not count), the
 * picture's and the reference's alike:
 *     flicker = sqrt(mean(((A(t) - A(t-1)) - (B(t) - B(t-1)))²)) / mean(B),   change = sqrt(mean((B(t) - B(t-1))²)) / mean(B). */

enum { WITH, WITHOUT, REFERENCE, PICTURES };
typedef enum bench_guide { MOTION, INSTANCE, NORMAL, SPECULAR, GUIDES } bench_guide;
static const char* const guide_names[GUIDES] = {"motion", "instance", "normal", "specular"};

/* Sums over values of points that were followed: squared errors of the two pictures, squared changes of the reference, the reference. */
typedef struct bench_sums { double error[2], change, reference; uint64_t values; } bench_sums;

typedef struct bench_follower {
    es_image pictures[2][PICTURES], guides[2][GUIDES]; /* [0] last frame's */
    bench_sums all, matte;     /* of every point, and of those without a lobe */
    uint64_t followed, seen;
} bench_follower;

static const float* pixel_of(const es_image* image, uint32_t x, uint32_t y) { return image->pixels + ((size_t)y * image->width + x) * image->channels; }

/* The places and weights of the pixels in which last frame showed the point that is seen at (x, y); 0: it did not. */
static int taps_of(const bench_follower* f, uint32_t x, uint32_t y, uint32_t taps[4][2], double weights[4])
{
    const float *motion = pixel_of(&f->guides[1][MOTION], x, y), *normal = pixel_of(&f->guides[1][NORMAL], x, y);
    const double px = (double)x - (double)motion[0], py = (double)y - (double)motion[1], fx = floor(px), fy = floor(py);
    int count = 0;
    for (int i = 0; i < 4; i++) {
        const double tx = fx + (i & 1), ty = fy + (i >> 1), weight = (i & 1 ? px - fx : 1 - (px - fx)) * (i >> 1 ? py - fy : 1 - (py - fy));
        if (weight <= 1e-3) continue; /* also what did not move at all: it has one */
        if (!(tx >= 0 && ty >= 0 && tx < f->guides[0][NORMAL].width && ty < f->guides[0][NORMAL].height)) return 0;
        taps[count][0] = (uint32_t)tx;
        taps[count][1] = (uint32_t)ty;
        const float* then = pixel_of(&f->guides[0][NORMAL], taps[count][0], taps[count][1]);
        const bool same = *pixel_of(&f->guides[0][INSTANCE], taps[count][0], taps[count][1]) == *pixel_of(&f->guides[1][INSTANCE], x, y);
        if (!same || normal[0] * then[0] + normal[1] * then[1] + normal[2] * then[2] < 0.9f) return 0;
        weights[count++] = weight;
    }
    return count;
}

static void add_changes(bench_sums* sums, const double change[PICTURES], double reference)
{
    for (int p = 0; p < REFERENCE; p++) sums->error[p] += (change[p] - change[REFERENCE]) * (change[p] - change[REFERENCE]);
    sums->change += change[REFERENCE] * change[REFERENCE];
    sums->reference += reference;
    sums->values++;
}

static void set_ratio(bench_row* row, const bench_sums* sums)
{
    const double values = (double)sums->values, mean = sums->reference / values;
    row->value = sqrt(sums->error[WITH] / values) / mean;
    row->peer_value = sqrt(sums->error[WITHOUT] / values) / mean;
    row->ratio = row->peer_value / row->value;
}

static void follow(bench_follower* f)
{
    const es_image* any = &f->pictures[1][REFERENCE];
    for (uint32_t y = 0; y < any->height; y++)
        for (uint32_t x = 0; x < any->width; x++) {
            if (*pixel_of(&f->guides[1][INSTANCE], x, y) == 0.0f) continue;
            f->seen++;
            uint32_t taps[4][2];
            double weights[4], total = 0;
            const int count = taps_of(f, x, y, taps, weights);
            if (!count) continue;
            f->followed++;
            for (int i = 0; i < count; i++) total += weights[i];
            for (uint32_t k = 0; k < 3; k++) {
                double change[PICTURES];
                for (int p = 0; p < PICTURES; p++) {
                    double then = 0;
                    for (int i = 0; i < count; i++) then += weights[i] / total * (double)pixel_of(&f->pictures[0][p], taps[i][0], taps[i][1])[k];
                    change[p] = (double)pixel_of(&f->pictures[1][p], x, y)[k] - then;
                }
                add_changes(&f->all, change, (double)pixel_of(any, x, y)[k]);
                if (*pixel_of(&f->guides[1][SPECULAR], x, y) == 0.0f) add_changes(&f->matte, change, (double)pixel_of(any, x, y)[k]);
            }
        }
}

static bool measure_flicker(bench_time_stage* s, bench_row* flicker, bench_row* matte, bench_row* change, bench_row* pixels)
{
    const uint32_t frames = s->options->quick ? 12 : 120;
    es_renderer_settings settings[PICTURES] = {s->with, s->without, s->without};
    for (int i = 0; i < PICTURES; i++) {
        settings[i].width = s->options->width ? s->options->width : s->options->quick ? 128 : 256;
        settings[i].height = s->options->height ? s->options->height : s->options->quick ? 96 : 192;
    }
    /* Many lights, each of them steady: 4096 that are drawn anew for each frame flicker by more than the light changes. Nothing is filtered. */
    settings[REFERENCE].vpls = 8192;
    settings[REFERENCE].interleave = 1;
    settings[REFERENCE].stable_vpls = true;
    es_renderer* renderers[PICTURES] = {NULL};
    es_flicker* flickers[2] = {NULL};
    bench_follower f = {.seen = 0};
    bool works = true;
    for (int i = 0; i < PICTURES && works; i++) works = es_renderer_create(s->context, &settings[i], &renderers[i]) == ES_OK;
    for (int i = 0; i < 2 && works; i++) works = es_flicker_create(s->context, &flickers[i]) == ES_OK;
    for (uint32_t frame = 0; frame < frames && works; frame++) {
        works = es_world_step(s->world, frame ? 1.0f / 60 : 0.0f) == ES_OK;
        for (int i = 0; i < PICTURES && works; i++) works = draw(s, renderers[i], &f.pictures[1][i]);
        for (int i = 0; i < GUIDES && works; i++) works = es_renderer_image(renderers[WITH], guide_names[i], &f.guides[1][i]) == ES_OK;
        for (int i = 0; i < 2 && works; i++) works = es_flicker_add(flickers[i], &f.pictures[1][i], &f.pictures[1][REFERENCE]) == ES_OK;
        if (works && frame) follow(&f);
        for (int i = 0; i < PICTURES; i++) es_image_destroy(s->context, &f.pictures[0][i]);
        for (int i = 0; i < GUIDES; i++) es_image_destroy(s->context, &f.guides[0][i]);
        memcpy(f.pictures[0], f.pictures[1], sizeof f.pictures[0]);
        memcpy(f.guides[0], f.guides[1], sizeof f.guides[0]);
        memset(f.pictures[1], 0, sizeof f.pictures[1]);
        memset(f.guides[1], 0, sizeof f.guides[1]);
    }
    if (works && f.followed) {
        set_ratio(flicker, &f.all);
        if (f.matte.values) set_ratio(matte, &f.matte);
        change->value = sqrt(f.all.change / (double)f.all.values) / (f.all.reference / (double)f.all.values);
        pixels->value = es_flicker_result(flickers[WITH]).flicker;
        pixels->peer_value = es_flicker_result(flickers[WITHOUT]).flicker;
        pixels->ratio = pixels->peer_value / pixels->value;
        snprintf(flicker->note, sizeof flicker->note, "%u × %u, %u frames, against %u lights at every pixel; %.3g %% of the points were seen a frame before", settings[0].width, settings[0].height, frames, settings[REFERENCE].vpls,
            100 * (double)f.followed / (double)f.seen);
        snprintf(pixels->note, sizeof pixels->note, "edges that move count by how far the picture is off between what is before and behind; the reference changes by %.3g", es_flicker_result(flickers[WITH]).change);
    }
    for (int i = 0; i < PICTURES; i++) {
        es_image_destroy(s->context, &f.pictures[0][i]);
        es_image_destroy(s->context, &f.pictures[1][i]);
        if (renderers[i]) es_renderer_destroy(renderers[i]);
    }
    for (int i = 0; i < GUIDES; i++) {
        es_image_destroy(s->context, &f.guides[0][i]);
        es_image_destroy(s->context, &f.guides[1][i]);
    }
    for (int i = 0; i < 2; i++)
        if (flickers[i]) es_flicker_destroy(flickers[i]);
    return works;
}

/* ---- lag -------------------------------------------------------------------------------------------------------------- */

static bool change_lamp(bench_time_stage* s, float factor, float shift)
{
    size_t count;
    const es_light_state* lights = es_world_lights(s->world, &count);
    es_light_desc lamp;
    if (!count || es_world_get_light(s->world, lights[0].handle, &lamp) != ES_OK) return false;
    const es_light handle = lights[0].handle;
    lamp.intensity *= factor;
    if (es_world_set_light(s->world, handle, &lamp) != ES_OK) return false;
    if (shift == 0.0f) return true;
    es_vec3 low, high;
    es_transform transform;
    if (!es_world_bounds(s->world, &low, &high) || es_world_get_node_transform(s->world, lamp.node, &transform) != ES_OK) return false;
    transform.translation.x += shift * sqrtf((high.x - low.x) * (high.x - low.x) + (high.y - low.y) * (high.y - low.y) + (high.z - low.z) * (high.z - low.z));
    return es_world_set_node_transform(s->world, lamp.node, &transform) == ES_OK;
}

/* Until the picture stays within a tenth of the one that it settles at, after more frames than history lasts: what history glows on with counts,
 * and what lights that are still on their way to other places leave out. */
static bool measure_lag(bench_time_stage* s, float factor, float shift, bench_row* row)
{
    enum { BEFORE = 12 };
    es_renderer_settings with = s->with;
    with.width = 256;
    with.height = 192;
    const uint32_t frames = with.temporal_settle + 8;
    es_image* images = calloc(frames, sizeof *images);
    es_image image = {0};
    es_renderer* renderer = NULL;
    bool works = images && es_renderer_create(s->context, &with, &renderer) == ES_OK;
    for (int i = 0; i < BEFORE && works; i++) {
        works = es_world_step(s->world, 0) == ES_OK && draw(s, renderer, &image);
        es_image_destroy(s->context, &image);
    }
    works = works && change_lamp(s, factor, shift);
    for (uint32_t i = 0; i < frames && works; i++) works = es_world_step(s->world, 0) == ES_OK && draw(s, renderer, &images[i]);
    uint32_t lag = 1;
    double first = 0, last = 0;
    for (uint32_t i = 0; i < frames && works; i++) {
        es_image_error measured = {0};
        works = es_image_compare(s->context, &images[i], &images[frames - 1], NULL, &measured) == ES_OK;
        if (!i) first = measured.relrmse;
        if (measured.relrmse > 0.1) lag = i + 2;
        if (i + 1 == lag) last = measured.relrmse;
    }
    row->value = lag;
    snprintf(row->note, sizeof row->note, "against the picture that it settles at; in the first frame relRMSE is %.3g, in the last of them %.3g", first, last);
    works = works && change_lamp(s, 1 / factor, -shift);
    for (uint32_t i = 0; i < frames && images; i++) es_image_destroy(s->context, &images[i]);
    free(images);
    if (renderer) es_renderer_destroy(renderer);
    return works;
}

/* ---- cost -------------------------------------------------------------------------------------------------------------- */

static bool measure_cost(bench_time_stage* s, bench_row* cost, bench_row* still)
{
    enum { MOST = 60 };
    const uint32_t frames = s->options->quick ? 8 : MOST;
    double pass[MOST], moving[MOST], resting[MOST];
    es_renderer* renderer = NULL;
    bool works = es_renderer_create(s->context, &s->with, &renderer) == ES_OK;
    for (uint32_t i = 0; i < frames + 2 && works; i++) {
        works = es_world_step(s->world, 1.0f / 60) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
        if (!works || i < 2) continue; /* memory is new */
        const es_frame_stats* stats = es_renderer_stats(renderer);
        moving[i - 2] = stats->milliseconds;
        for (size_t k = 0; k < stats->pass_count; k++)
            if (!strcmp(stats->passes[k].name, "temporal coherence")) pass[i - 2] = stats->passes[k].milliseconds;
    }
    for (uint32_t i = 0; i < s->with.temporal_settle + 4 && works; i++) works = es_world_step(s->world, 0) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
    for (uint32_t i = 0; i < frames && works; i++) {
        works = es_world_step(s->world, 0) == ES_OK && es_renderer_render(renderer, s->world) == ES_OK;
        if (works) resting[i] = es_renderer_stats(renderer)->milliseconds;
    }
    if (works) {
        cost->value = bench_median(pass, frames);
        still->value = bench_median(resting, frames);
        still->peer_value = bench_median(moving, frames);
        still->ratio = still->peer_value / still->value;
        snprintf(cost->note, sizeof cost->note, "of %.4g ms a frame", still->peer_value);
    }
    if (renderer) es_renderer_destroy(renderer);
    return works;
}

int bench_time(const bench_options* options)
{
    bench_row all[ROWS], rows[ROWS];
    size_t count = 0;
    bench_time_rows(all, ROWS);
    const char* scene = options->scene_count ? options->scenes[0] : "cornell-stack";
    bench_report report = {.name = "time", .title = "Light over frames", .about = "Flicker, lag and cost of history."};
    bench_time_stage stage;
    bool works = open_stage(&stage, options, scene);
    if (works && (bench_wants(options, "flicker") || bench_wants(options, "flicker-matte") || bench_wants(options, "flicker-change") || bench_wants(options, "flicker-pixels")))
        works = measure_flicker(&stage, bench_find_row(all, ROWS, "flicker"), bench_find_row(all, ROWS, "flicker-matte"), bench_find_row(all, ROWS, "flicker-change"), bench_find_row(all, ROWS, "flicker-pixels"));
    static const struct { const char* id; float factor, shift; } changes[] = {{"lag-brighter", 10, 0}, {"lag-darker", 0.1f, 0}, {"lag-jump", 1, 0.1f}};
    for (size_t i = 0; i < sizeof changes / sizeof *changes && works; i++)
        if (bench_wants(options, changes[i].id)) works = measure_lag(&stage, changes[i].factor, changes[i].shift, bench_find_row(all, ROWS, changes[i].id));
    if (works && (bench_wants(options, "temporal-cost") || bench_wants(options, "still-frame"))) works = measure_cost(&stage, bench_find_row(all, ROWS, "temporal-cost"), bench_find_row(all, ROWS, "still-frame"));
    for (size_t i = 0; i < ROWS; i++)
        if (bench_wants(options, all[i].id)) rows[count++] = all[i];
    if (!works) {
        int code = stage.context ? demo_refuse_context(stage.context) : demo_refuse("bench time: no memory");
        close_stage(&stage);
        bench_report_free(&report);
        return code;
    }
    bench_print(rows, count);
    int code = bench_report_write(&report, options, rows, count, stage.context);
    close_stage(&stage);
    return code;
}
