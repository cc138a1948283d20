/* `earthshine bench ledger`: how far the indirect light of the real-time method is from the truth, and which of its approximations
 * make how much of that.
 *
 * The method M is the renderer with its default settings; the truth R is one bounce of lamps' light, path-traced through the pixels'
 * centres. Its error D = M - R is split as ledger_split.h describes, along this chain of pictures, each with one more approximation
 * exact than the one above:
 *
 *     the method, after the frames before               M
 *     the same frame alone                               temporal: today only where the points of the shadow maps lie, spread by the areas of the first frame
 *     | infinitely many lights instead of vpl.count      number      \  these three act on each other: their parts are means
 *     | all lights at all pixels, no filter              interleave  |  over all 3! orders, from all 2³ pictures
 *     | rays instead of imperfect shadow maps            visibility  /
 *     no vpl.bound, vpl.spread and vpl.roughness         bound: found by rays (Kollig and Keller 2004), the same in whatever order, for it is added
 *     light G-buffers of 1024² texels                    light-view
 *     whatever is left                                   rest
 *     the reference on the rounded G-buffer
 *     the reference                                      quantisation: rounded normals, colours and roughness where the camera looks
 *
 * "Infinitely many lights" is the mean over many sets of vpl.count lights, each set with its own place in the sequence. So what a set's
 * size does to the spread, which follows the area a light stands for, stays with the bound, and number is what chance does. Even sets
 * make one half of the mean, odd ones the other; the halves of the reference have seeds of their own. The rest is M's chain less the
 * reference, measured and not assumed: it has in it what finer light G-buffers would still do, and pixels at whose centres the
 * rasterizer, on its grid of 1/256 pixel, sees another triangle than the ray does.
 *
 * The pictures are smaller than those the method is meant for, or the rays would take too long. Of the causes this touches one: the pattern
 * and the filter span 8 × 8 pixels of whatever size, so their part shrinks as pictures grow.
 *
 * Besides, for scale: the light of further bounces, which the method leaves out and R has not, and the error of direct light. */
#include "bench.h"
#include "ledger_pictures.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST_FRAMES = 3, PREDECESSORS = 2, PARTS = LEDGER_CAUSES + 1, ROWS_A_SCENE = 4 * PARTS + 8, SHOWN_WIDTH = 256, PATTERN = 8 };
static const double fps = 30, most_unexplained = 10;

typedef struct ledger_scene {
    char name[48];     /* in ids and for people */
    const char* scene; /* in the library, or a file */
    uint32_t frames[MOST_FRAMES], frame_count;
} ledger_scene;
/* None before its PREDECESSORS; of the moving Cornell box frames that are not near to each other: its motion takes 600. */
static const ledger_scene own_scenes[] = {
    {"room", "room", {2}, 1},
    {"cornell", "cornell", {2}, 1},
    {"cornell-moving", "cornell", {137, 274, 411}, 3},
    {"hall", "hall", {2}, 1},
};
enum { OWN_SCENES = sizeof own_scenes / sizeof own_scenes[0] };

typedef struct cause_name { const char *id, *name, *work; } cause_name;
static const cause_name causes[PARTS] = {
    [LEDGER_TEMPORAL] = {"temporal", "temporal lag", "what the frames before leave in a frame"},
    [LEDGER_NUMBER] = {"number", "number of lights", "vpl.count lights instead of infinitely many"},
    [LEDGER_INTERLEAVE] = {"interleave", "interleaving and filter", "a part of the lights at each pixel, smoothed over the pattern"},
    [LEDGER_VISIBILITY] = {"visibility", "imperfect shadow maps", "visibility of lights by imperfect shadow maps instead of rays"},
    [LEDGER_BOUND] = {"bound", "bounding of near lights", "vpl.bound, vpl.spread and vpl.roughness"},
    [LEDGER_LIGHT_VIEW] = {"light-view", "light G-buffer", "lights at the texels of a light G-buffer of the default size"},
    [LEDGER_QUANTISATION] = {"quantisation", "rounded G-buffer", "rounding of normals, colours and roughness in the camera's G-buffer"},
    [LEDGER_REST] = {"unexplained", "unexplained", "what no cause explains"},
};

/* What was asked for by name, or as a file; by itself all of the own scenes. */
static size_t choose_scenes(const bench_options* options, ledger_scene chosen[BENCH_MAX_SCENES])
{
    size_t count = options->scene_count ? options->scene_count : OWN_SCENES;
    for (size_t i = 0; i < count; i++) {
        const char* asked = options->scene_count ? options->scenes[i] : own_scenes[i].name;
        const char* slash = strrchr(asked, '/');
        chosen[i] = (ledger_scene){.scene = asked, .frames = {PREDECESSORS}, .frame_count = 1};
        snprintf(chosen[i].name, sizeof chosen[i].name, "%.*s", (int)strcspn(slash ? slash + 1 : asked, "."), slash ? slash + 1 : asked);
        for (char* c = chosen[i].name; *c; c++)
            if (!strchr("abcdefghijklmnopqrstuvwxyz0123456789-", *c)) *c = *c >= 'A' && *c <= 'Z' ? (char)(*c - 'A' + 'a') : '-';
        for (size_t k = 0; k < OWN_SCENES; k++)
            if (!strcmp(asked, own_scenes[k].name)) chosen[i] = own_scenes[k];
    }
    return count;
}

typedef struct ledger {
    ledger_sums sums, relative; /* the second weighted: errors in proportion to how bright it is around */
    double further, direct;
    size_t costliest, costliest_alone, costliest_relative;
    bool complete;
} ledger;

static ledger_effort effort_of(const bench_options* options, const ledger_scene* scene)
{
    ledger_effort effort = {.width = 384, .height = 288, .sets = 32, .fine_sets = 2, .samples = 128, .quantised_samples = 16, .compensation_samples = 32, .bounce_samples = 4};
    if (options->quick)
        effort = (ledger_effort){.width = 160, .height = 120, .sets = 8, .fine_sets = 1, .samples = 64, .quantised_samples = 4, .compensation_samples = 16, .bounce_samples = 2};
    /* single paths carry much of the light that the metal in the Cornell box throws */
    if (!options->quick && !strcmp(scene->scene, "cornell")) {
        effort.samples *= 3;
        effort.compensation_samples *= 3;
    }
    if (options->samples) effort.samples = options->samples / 2;
    /* several frames together need less of each */
    const uint32_t n = options->quick ? 1 : scene->frame_count;
    effort.sets /= n;
    effort.samples = (effort.samples + n - 1) / n;
    effort.compensation_samples /= n;
    effort.fine_sets = (effort.fine_sets + n - 1) / n;
    effort.bounce_samples = (effort.bounce_samples + n - 1) / n;
    if (options->width) {
        effort.width = options->width;
        effort.height = options->height;
    }
    return effort;
}

/* ---- pictures for the page --------------------------------------------------------------------------------------- */

static void add_base64(demo_text* text, const unsigned char* bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t word = (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0);
        demo_text_add(text, "%c%c%c%c", digits[word >> 18], digits[word >> 12 & 63], left > 1 ? digits[word >> 6 & 63] : '=', left > 2 ? digits[word & 63] : '=');
    }
}

/* Saves the picture beside the page and puts it into the page. A build that cannot write PNG has none. */
static void add_png(demo_text* page, es_context* context, const bench_options* options, const es_image* image, const es_image_save_desc* desc, const char* scene, const char* id,
    const char* caption)
{
    char path[DEMO_PATH_SIZE + 128];
    snprintf(path, sizeof path, "%s/ledger-%s-%s.png", options->out, scene, id);
    if (es_image_save(context, image, path, desc) != ES_OK) return;
    FILE* file = fopen(path, "rb");
    if (!file) return;
    unsigned char* bytes = NULL;
    long size = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
    if (size > 0 && fseek(file, 0, SEEK_SET) == 0 && (bytes = malloc((size_t)size)) != NULL && fread(bytes, 1, (size_t)size, file) == (size_t)size) {
        demo_text_add(page, "<div style=\"width:%upx\"><img width=\"%u\" alt=\"%s\" src=\"data:image/png;base64,", SHOWN_WIDTH, SHOWN_WIDTH, caption);
        add_base64(page, bytes, (size_t)size);
        demo_text_add(page, "\"/><br/><small>%s</small></div>\n", caption);
    }
    free(bytes);
    fclose(file);
}

/* Mean of both halves over n × n pixels for each pixel that is shown, so many as come near to SHOWN_WIDTH; n at least `least`, then the
 * squares overlap. One channel: the mean of all. */
static bool shrink(es_context* context, const ledger_effort* e, const ledger_picture* picture, uint32_t channels, uint32_t least, float scale, es_image* small)
{
    const uint32_t step = (e->width + SHOWN_WIDTH / 2) / SHOWN_WIDTH > 1 ? (e->width + SHOWN_WIDTH / 2) / SHOWN_WIDTH : 1, n = step > least ? step : least;
    if (e->width < n || e->height < n || es_image_create(context, e->width / step, e->height / step, channels, small) != ES_OK) return false;
    const float weight = scale * 0.5f * (float)channels / (3.0f * (float)(n * n));
    for (uint32_t y = 0; y < small->height; y++)
        for (uint32_t x = 0; x < small->width; x++) {
            uint32_t left = x * step + n <= e->width ? x * step : e->width - n, top = y * step + n <= e->height ? y * step : e->height - n;
            for (uint32_t i = 0; i < n * n * 3; i++) {
                size_t from = ((size_t)(top + i / (3 * n)) * e->width + left) * 3 + i % (3 * n), to = ((size_t)y * small->width + x) * channels + (channels == 3 ? i % 3 : 0);
                small->pixels[to] += weight * (picture->half[0][from] + picture->half[1][from]);
            }
        }
    return true;
}

static void add_error_picture(demo_text* page, es_context* context, const bench_options* options, const ledger_effort* e, const ledger_picture* d, uint32_t least, float scale,
    const char* scene, const char* id, const char* caption)
{
    es_image values, colours;
    es_image_save_desc desc = demo_save_desc();
    desc.already_srgb = true;
    if (!shrink(context, e, d, 1, least, 1, &values)) return;
    if (es_image_false_colour(context, &values, scale, true, &colours) == ES_OK) {
        add_png(page, context, options, &colours, &desc, scene, id, caption);
        es_image_destroy(context, &colours);
    }
    es_image_destroy(context, &values);
}

static void add_light_picture(demo_text* page, es_context* context, const bench_options* options, const ledger_effort* e, const ledger_picture* light, float scale, const char* scene,
    const char* id, const char* caption)
{
    es_image small;
    es_image_save_desc desc = demo_save_desc();
    if (!shrink(context, e, light, 3, 1, scale, &small)) return;
    add_png(page, context, options, &small, &desc, scene, id, caption);
    es_image_destroy(context, &small);
}

/* Errors on one scale, so that they can be compared: what is left out light blue, what is too much yellow. */
static void add_pictures(bench_report* report, const bench_options* options, es_context* context, const ledger_scene* scene, const ledger_effort* e, const ledger_frame* frame,
    const ledger_sums* sums)
{
    demo_text* page = &report->figures;
    const double mean = sums->reference / sums->values;
    const float scale = (float)(3 * ledger_total(sums) * mean), exposure = (float)(0.25 / mean);
    float* difference[2] = {malloc(frame->floats * sizeof(float)), malloc(frame->floats * sizeof(float))};
    if (!options->out || !difference[0] || !difference[1] || !(scale > 0) || !(mean > 0)) {
        free(difference[0]);
        free(difference[1]);
        return;
    }
    ledger_picture rest = {{difference[0], difference[1]}};
    demo_text_add(page, "<figure><h3>%s: where each cause errs</h3>\n<div style=\"display:flex;flex-wrap:wrap;gap:12px\">\n", scene->name);
    add_light_picture(page, context, options, e, &frame->method, exposure, scene->name, "method", "the method");
    add_light_picture(page, context, options, e, &frame->reference, exposure, scene->name, "reference", "the reference");
    for (int h = 0; h < 2; h++)
        for (size_t k = 0; k < frame->floats; k++) difference[h][k] = frame->method.half[h][k] - frame->reference.half[h][k];
    add_error_picture(page, context, options, e, &rest, 1, scale, scene->name, "total", "total error");
    for (int i = 0; i < LEDGER_CAUSES; i++) {
        add_error_picture(page, context, options, e, &frame->parts[i], i == LEDGER_LIGHT_VIEW ? PATTERN : 1, scale, scene->name, causes[i].id, causes[i].name);
        for (int h = 0; h < 2; h++)
            for (size_t k = 0; k < frame->floats; k++) difference[h][k] -= frame->parts[i].half[h][k];
    }
    add_error_picture(page, context, options, e, &rest, PATTERN, scale, scene->name, causes[LEDGER_REST].id, causes[LEDGER_REST].name);
    demo_text_add(page, "</div>\n<figcaption>Indirect light, and errors in false colour: yellow is too much light, blue too little, black is right; full colour is three times the total "
                        "error's root mean square, and all have this scale. The parts sum to the total, pixel by pixel. Grain is the reference's, and that of the many sets of lights; the light G-buffer and what is unexplained would be hardly more than that and are shown as means over 8 × 8 pixels.</figcaption></figure>\n");
    free(difference[0]);
    free(difference[1]);
}

/* ---- measuring ------------------------------------------------------------------------------------------------------- */

/* Renders the frame as a renderer does that rendered those before it. */
static bool reach(es_world* world, es_renderer* renderer, uint32_t* at, uint32_t frame, es_image* picture)
{
    for (; *at <= frame; ++*at) {
        if (es_world_step(world, *at ? (float)(1 / fps) : 0.0f) != ES_OK) return false;
        if (*at + PREDECESSORS >= frame && es_renderer_render(renderer, world) != ES_OK) return false;
    }
    return es_renderer_image(renderer, "indirect", picture) == ES_OK;
}

static int measure_scene(es_context* context, const bench_options* options, const ledger_scene* scene, bench_report* report, ledger* ledger)
{
    const ledger_effort effort = effort_of(options, scene);
    const es_renderer_settings settings = ledger_method(&effort);
    es_world* world = NULL;
    es_renderer* renderer = NULL;
    uint32_t at = 0;
    bool works = es_world_open(context, scene->scene, NULL, &world) == ES_OK && es_renderer_create(context, &settings, &renderer) == ES_OK;
    int code = works ? DEMO_OK : demo_refuse_context(context);
    for (uint32_t i = 0; i < scene->frame_count && code == DEMO_OK; i++) {
        if (isatty(STDERR_FILENO)) fprintf(stderr, "\r\033[K%s, frame %u\n", scene->name, scene->frames[i]);
        es_image method;
        ledger_frame frame;
        if (!reach(world, renderer, &at, scene->frames[i], &method)) {
            code = demo_refuse_context(context);
            break;
        }
        code = ledger_frame_measure(world, &effort, &method, &frame);
        if (code == DEMO_OK) {
            float* weights = malloc(frame.floats * sizeof *weights);
            if (!weights) code = demo_refuse("bench ledger: out of memory");
            if (weights) ledger_relative_weights(&frame.reference, effort.width, effort.height, 3, weights);
            ledger_add(&ledger->sums, &frame.method, &frame.reference, frame.parts, frame.lost, LEDGER_CAUSES, NULL, frame.floats);
            ledger_add(&ledger->relative, &frame.method, &frame.reference, frame.parts, frame.lost, LEDGER_CAUSES, weights, frame.floats);
            free(weights);
            ledger->further += frame.further;
            ledger->direct += frame.direct;
            if (i == 0) add_pictures(report, options, context, scene, &effort, &frame, &ledger->sums);
        }
        ledger_frame_free(&frame);
        es_image_destroy(context, &method);
    }
    if (renderer) es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    if (code != DEMO_OK) return code;
    ledger->costliest = ledger_costliest(&ledger->sums);
    ledger->costliest_relative = ledger_costliest(&ledger->relative);
    ledger->costliest_alone = 0;
    for (size_t i = 1; i < LEDGER_CAUSES; i++)
        if (ledger_gain(&ledger->sums, i) > ledger_gain(&ledger->sums, ledger->costliest_alone)) ledger->costliest_alone = i;
    ledger->complete = true;
    return DEMO_OK;
}

/* ---- rows -------------------------------------------------------------------------------------------------------------- */

typedef struct ledger_rows {
    bench_row rows[BENCH_MAX_SCENES * ROWS_A_SCENE];
    char ids[BENCH_MAX_SCENES * ROWS_A_SCENE][96];
    size_t count;
} ledger_rows;

static bench_row* add_row(ledger_rows* all, const ledger_scene* scene, const char* cause, const char* ending, const char* work, const char* unit, double value)
{
    size_t k = all->count++;
    snprintf(all->ids[k], sizeof all->ids[k], "ledger-%.47s-%s%s", scene->name, cause, ending);
    all->rows[k] = (bench_row){.id = all->ids[k], .work = work, .unit = unit, .value = value, .peer_value = NAN, .ratio = NAN};
    return &all->rows[k];
}

static void add_rows(ledger_rows* all, const ledger_scene* scene, const ledger* ledger)
{
    const ledger_sums* s = &ledger->sums;
    const double mean = s->reference / s->values;
    add_row(all, scene, "total", "", "error of the method's indirect light", "relRMSE", ledger_total(s));
    for (size_t i = 0; i < PARTS; i++) {
        double share = ledger_share(s, i);
        /* the rest has a target, which is for its size */
        bench_row* row = add_row(all, scene, causes[i].id, "", causes[i].work, "% of the squared error", i == LEDGER_REST ? fabs(share) : share);
        snprintf(row->note, sizeof row->note, "±%.2g by noise%s", ledger_share_noise(s, i), i == LEDGER_REST && share < 0 ? "; its sign is negative" : "");
        if (i != LEDGER_REST) continue;
        row->judge = BENCH_VALUE_AT_MOST;
        row->must = row->aim = most_unexplained;
    }
    for (size_t i = 0; i < PARTS; i++) add_row(all, scene, causes[i].id, "-own", causes[i].work, "relRMSE of its part", ledger_own(s, i));
    for (size_t i = 0; i < LEDGER_CAUSES; i++)
        add_row(all, scene, causes[i].id, "-alone", "squared error that goes away when this alone is made exact", "% of the squared error", ledger_gain(s, i));
    add_row(all, scene, "interplay", "", "squared error that goes away only when several causes do", "% of the squared error", ledger_gains_missing(s));
    bench_row* row = add_row(all, scene, "costliest", "", "share of the approximation that costs most", "% of the squared error", ledger_share(s, ledger->costliest));
    snprintf(row->note, sizeof row->note, "%s", causes[ledger->costliest].name);
    add_row(all, scene, "relative-total", "", "the error with each pixel's in proportion to how bright it is around it", "weighted relRMSE", ledger_total(&ledger->relative));
    for (size_t i = 0; i < PARTS; i++) {
        row = add_row(all, scene, causes[i].id, "-relative", causes[i].work, "% of the weighted squared error", ledger_share(&ledger->relative, i));
        snprintf(row->note, sizeof row->note, "±%.2g by noise", ledger_share_noise(&ledger->relative, i));
    }
    row = add_row(all, scene, "costliest-relative", "", "share of the approximation that costs most in proportion to brightness", "% of the weighted squared error",
        ledger_share(&ledger->relative, ledger->costliest_relative));
    snprintf(row->note, sizeof row->note, "%s", causes[ledger->costliest_relative].name);
    add_row(all, scene, "noise", "", "noise of the reference, taken out of the above", "relRMSE", ledger_noise(s));
    add_row(all, scene, "further-bounces", "", "light of bounces two to four, which the method has not and the total leaves out", "of the mean of one bounce",
        sqrt(fmax(ledger->further, 0) / s->values) / mean);
    add_row(all, scene, "direct", "", "error of direct light, which the total leaves out", "of the mean of one bounce", sqrt(ledger->direct / s->values) / mean);
}

/* ---- report ------------------------------------------------------------------------------------------------------------ */

static void add_percent(demo_text* text, double value)
{
    if (fabs(value) < 0.05) value = 0; /* not -0.0 */
    demo_text_add(text, fabs(value) < 9.95 ? "<td class=\"n\">%.1f\u00a0%%</td>" : "<td class=\"n\">%.0f\u00a0%%</td>", value);
}

static void add_scene_table(demo_text* page, const ledger_scene* scene, const ledger* ledger)
{
    const ledger_sums* s = &ledger->sums;
    demo_text_add(page, "<table><thead><tr><th>%s</th><th class=\"n\">share</th><th class=\"n\">± noise</th><th class=\"n\">relative share</th><th class=\"n\">± noise</th><th class=\"n\">its own size</th><th class=\"n\">made exact alone</th></tr></thead><tbody>\n",
        scene->name);
    for (size_t i = 0; i < PARTS; i++) {
        const char* mark = i == ledger->costliest ? "b" : "span";
        demo_text_add(page, "<tr><td><%s>%s</%s><br/><small>%s</small></td>", mark, causes[i].name, mark, causes[i].work);
        add_percent(page, ledger_share(s, i));
        add_percent(page, ledger_share_noise(s, i));
        add_percent(page, ledger_share(&ledger->relative, i));
        add_percent(page, ledger_share_noise(&ledger->relative, i));
        demo_text_add(page, "<td class=\"n\">%.4f</td>", ledger_own(s, i));
        if (i == LEDGER_REST) demo_text_add(page, "<td></td>");
        else add_percent(page, ledger_gain(s, i));
        demo_text_add(page, "</tr>\n");
    }
    demo_text_add(page, "<tr><td>all together</td><td class=\"n\">100 %%</td><td></td><td class=\"n\">100 %%</td><td></td><td class=\"n\">%.4f</td>", ledger_total(s));
    add_percent(page, 100 - ledger_gains_missing(s));
    demo_text_add(page, "</tr></tbody></table>\n");
}

static void describe(const ledger_scene* scene, const ledger* ledger, char* text, size_t size)
{
    const ledger_sums* s = &ledger->sums;
    double rest = ledger_share(s, LEDGER_REST);
    int length = snprintf(text, size, "%s: the %s cost%s most, %.0f %% of the squared error", scene->name, causes[ledger->costliest].name,
        ledger->costliest == LEDGER_VISIBILITY || ledger->costliest == LEDGER_INTERLEAVE ? "" : "s", ledger_share(s, ledger->costliest));
    if (ledger->costliest_relative != ledger->costliest && length > 0 && (size_t)length < size)
        length += snprintf(text + length, size - (size_t)length, "; in proportion to brightness the %s, %.0f %%", causes[ledger->costliest_relative].name,
            ledger_share(&ledger->relative, ledger->costliest_relative));
    if (ledger->costliest_alone != ledger->costliest && length > 0 && (size_t)length < size)
        length += snprintf(text + length, size - (size_t)length, "; of a single change the most goes away with the %s", causes[ledger->costliest_alone].name);
    if (length > 0 && (size_t)length < size)
        snprintf(text + length, size - (size_t)length, "; %.1f %% %s unexplained%s", rest, fabs(rest) <= most_unexplained ? "is" : "is left", fabs(rest) <= most_unexplained ? "" : ", more than the 10 % allowed");
}

static int write_report(bench_report* report, const bench_options* options, const ledger_scene* scenes, const ledger* ledgers, size_t count, const ledger_rows* rows,
    const es_context* context)
{
    demo_text pictures = report->figures;
    report->figures = (demo_text){0};
    plot_bars plot = {.id = "shares", .value_name = "% of the squared error", .part_count = PARTS};
    for (size_t i = 0; i < PARTS; i++) plot.part_names[i] = causes[i].name;
    for (size_t k = 0; k < count; k++) {
        char text[PLOT_HEADLINE_SIZE];
        plot_bar* bar = plot_add_bar(&plot, "%s", scenes[k].name);
        if (!bar) break;
        for (size_t i = 0; i < PARTS; i++) bar->parts[i] = ledger_share(&ledgers[k].sums, i);
        describe(&scenes[k], &ledgers[k], text, sizeof text);
        snprintf(bar->note, sizeof bar->note, "relRMSE %.3f", ledger_total(&ledgers[k].sums));
        demo_text_add(&report->figures, "<p>");
        plot_add_escaped(&report->figures, text);
        demo_text_add(&report->figures, ".</p>\n");
        size_t length = strlen(report->finding);
        snprintf(report->finding + length, sizeof report->finding - length, "%s%.47s: the %s, %.0f %%", length ? "; " : "What costs most: ", scenes[k].name, causes[ledgers[k].costliest].name,
            ledger_share(&ledgers[k].sums, ledgers[k].costliest));
    }
    snprintf(plot.headline, sizeof plot.headline, "%s", report->finding);
    snprintf(plot.caption, sizeof plot.caption,
        "Each cause's part of the squared error, by its projection on the total error: the parts sum to 100 %%. To the left of zero stand causes that hide some of what others do wrong. "
        "Indirect light of one bounce, default settings, %u × %u: on larger pictures (--size) the interleaved pattern covers less of the scene and costs less.",
        effort_of(options, &scenes[0]).width, effort_of(options, &scenes[0]).height);
    bench_report_bars(report, &plot);
    for (size_t k = 0; k < plot.bar_count; k++)
        for (size_t i = 0; i < PARTS; i++) plot.bars[k].parts[i] = ledger_share(&ledgers[k].relative, i);
    plot.id = "relative-shares";
    plot.value_name = "% of the weighted squared error";
    plot.headline[0] = 0;
    for (size_t k = 0; k < count; k++) {
        size_t length = strlen(plot.headline);
        snprintf(plot.headline + length, sizeof plot.headline - length, "%s%.47s: the %s, %.0f %%", length ? "; " : "What costs most in proportion to brightness: ", scenes[k].name,
            causes[ledgers[k].costliest_relative].name, ledger_share(&ledgers[k].relative, ledgers[k].costliest_relative));
    }
    snprintf(plot.caption, sizeof plot.caption,
        "The same with each pixel's error in proportion to how bright the reference is in the 5 × 5 pixels around it: closer to what an eye sees, and no bright spot decides alone.");
    bench_report_bars(report, &plot);
    plot_bars_free(&plot);

    demo_text* page = &report->figures;
    demo_text_add(page,
        "<figure id=\"ledger-tables\"><h3>Cause by cause</h3>\n<p>The share is what a cause adds to the squared error, be it on its own or together with others; shares sum to 100 %%. "
        "The relative share is the same with each pixel's error in proportion to how bright it is around that pixel, so that a few bright spots do not decide alone. "
        "Its own size is the root mean square of what it does to the picture, over the reference's mean, whatever the others do. Made exact alone is how much of the squared error goes "
        "away when this approximation is made exact and no other: less than its share where the others hide it, and below zero where it hid what others do wrong.</p>\n");
    for (size_t k = 0; k < count; k++) {
        const ledger_sums* s = &ledgers[k].sums;
        const double mean = s->reference / s->values;
        add_scene_table(page, &scenes[k], &ledgers[k]);
        demo_text_add(page,
            "<p><small>Single changes together take away %.0f %%; the other %.0f %% is error that goes away only when several approximations do (below zero: error that they share is counted "
            "more than once). The reference's own noise, %.4f, is taken out. For scale, in the same unit: bounces two to four would add %.3f, and direct light errs by "
            "%.3f.</small></p>\n",
            100 - ledger_gains_missing(s), ledger_gains_missing(s), ledger_noise(s), sqrt(fmax(ledgers[k].further, 0) / s->values) / mean,
            sqrt(ledgers[k].direct / s->values) / mean);
    }
    demo_text_add(page, "</figure>\n%s", pictures.bytes ? pictures.bytes : "");
    report->failed |= pictures.failed;
    demo_text_free(&pictures);
    return bench_report_write(report, options, rows->rows, rows->count, context);
}

int bench_ledger(const bench_options* options)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    es_context* context = NULL;
    es_result result = es_context_create(&desc, &context);
    if (result != ES_OK) return demo_refuse("%s", es_result_text(result));
    bench_report report = {.name = "ledger",
        .title = "What the error is made of",
        .about = "The error of the real-time method's indirect light, split into its causes by making one approximation after another exact, averaged over the orders in which that can be done."};
    static ledger_rows rows;
    static ledger ledgers[BENCH_MAX_SCENES];
    ledger_scene scenes[BENCH_MAX_SCENES];
    const size_t count = choose_scenes(options, scenes);
    int code = DEMO_OK;
    rows.count = 0;
    memset(ledgers, 0, sizeof ledgers);
    for (size_t k = 0; k < count && code == DEMO_OK; k++) {
        code = measure_scene(context, options, &scenes[k], &report, &ledgers[k]);
        if (code == DEMO_OK) add_rows(&rows, &scenes[k], &ledgers[k]);
    }
    if (code == DEMO_OK) {
        bench_print(rows.rows, rows.count);
        for (size_t k = 0; k < count; k++) {
            char text[400];
            describe(&scenes[k], &ledgers[k], text, sizeof text);
            printf("%s\n", text);
        }
        code = write_report(&report, options, scenes, ledgers, count, &rows, context);
    }
    es_context_destroy(context);
    return code;
}
