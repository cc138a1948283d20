/* `bench speed`: every figure that was asked for, ours and llvmpipe's taken turn by turn in one sitting.
 * `bench frame`: the whole frame's passes alone, which the inexact twin runs too.
 *
 * A round measures each of our rows (the median of several repetitions), then runs llvmpipe's program once; the table shows
 * medians over the rounds. Machines drift by tens of percent between sittings, ratios within one far less. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { REPETITIONS = 7, WARM_UP = 2, WIDTH = 1024, HEIGHT = 768, MAX_ROUNDS = 50 };

/* Passes as es_renderer_stats names them. */
static const char* const pass_ism = "imperfect shadow maps";
static const char* const pass_shading = "shading";
static const char* const pass_filter = "filter";

es_renderer_settings bench_settings(void)
{
    es_renderer_settings settings = es_default_renderer_settings();
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.method = ES_GI_ISM;
    settings.skip = false;
    settings.vpls = 1024;
    settings.ism_size = 128;
    settings.ism_points = 8192;
    settings.pull_push = true;
    settings.interleave = 8;
    settings.bounces = 1;
    return settings;
}

static es_context* make_context(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_context* context = NULL;
    return es_context_create(&desc, &context) == ES_OK ? context : NULL;
}

/* ---- drawing alone
 * -------------------------------------------------------------------------------------------------------------- */

typedef struct drawing {
    es_context* context;
    es_world* world;
    es_rasterizer* rasterizer;
    es_gbuffer gbuffer;
    float* depth;
} drawing;

static bool drawing_open(drawing* d, uint32_t threads, uint32_t triangles)
{
    *d = (drawing){.context = make_context(threads)};
    if (!d->context) return false;
    es_world_settings settings = es_default_world_settings();
    settings.triangles = triangles;
    d->depth = aligned_alloc(64, 1024 * 1024 * sizeof(float));
    return d->depth && es_world_create_scene(d->context, "room", &settings, &d->world) == ES_OK &&
           es_world_step(d->world, 0) == ES_OK && es_rasterizer_create(d->context, &d->rasterizer) == ES_OK &&
           es_gbuffer_create(d->context, WIDTH, HEIGHT, ES_GBUFFER_ALL, &d->gbuffer) == ES_OK;
}

static void drawing_close(drawing* d)
{
    if (d->gbuffer.memory) es_gbuffer_destroy(d->context, &d->gbuffer);
    if (d->rasterizer) es_rasterizer_destroy(d->rasterizer);
    if (d->world) es_world_destroy(d->world);
    if (d->context) es_context_destroy(d->context);
    free(d->depth);
    *d = (drawing){0};
}

static const float degree = 0.017453293f;

/* The camera of the peers' room, last frame's a little beside it, so that there is motion to compute. */
static es_raster_view camera_view(void)
{
    es_vec3 eye = {0, 0.1f, 1.95f}, before = {0.02f, 0.1f, 1.96f}, ahead = {0, 0, -1}, up = {0, 1, 0};
    es_raster_view view = es_perspective_view(WIDTH, HEIGHT, eye, ahead, up, 65 * degree, 0.02f);
    view.previous_view = es_perspective_view(WIDTH, HEIGHT, before, ahead, up, 65 * degree, 0.02f).view;
    return view;
}

static es_raster_view light_view(void)
{
    es_vec3 eye = {-0.9f, 1.0f, 1.8f}, direction = {0.3995f, -0.4494f, -0.7990f}, up = {0, 1, 0};
    return es_perspective_view(1024, 1024, eye, direction, up, 92 * degree, 0.05f);
}

/* Milliseconds of one call, the median of several; NaN when it fails. */
static double time_drawing(drawing* d, const es_raster_view* view, bool depth_only)
{
    double times[REPETITIONS];
    const es_draw_list* list = es_world_draw_list(d->world);
    for (int i = -WARM_UP; i < REPETITIONS; i++) {
        double start = demo_seconds();
        es_result result = depth_only ? es_draw_depth(d->rasterizer, list, view, d->depth, view->width, NULL)
                                      : es_draw_gbuffer(d->rasterizer, list, view, &d->gbuffer, NULL);
        if (result != ES_OK) return NAN;
        if (i >= 0) times[i] = (demo_seconds() - start) * 1000;
    }
    return bench_median(times, REPETITIONS);
}

/* ---- whole frames
 * ---------------------------------------------------------------------------------------------------------------- */

enum { MAX_PASSES = 32 };
typedef struct frame_times {
    double total;
    size_t passes;
    const char* names[MAX_PASSES];
    double milliseconds[MAX_PASSES];
} frame_times;

typedef struct lit_frame {
    es_context* context;
    es_world* world;
    es_renderer* renderer;
} lit_frame;

static bool lit_frame_open(lit_frame* f, uint32_t threads)
{
    *f = (lit_frame){.context = make_context(threads)};
    es_renderer_settings settings = bench_settings();
    es_world_settings world_settings = es_default_world_settings();
    world_settings.triangles = 70000;
    return f->context && es_world_create_scene(f->context, "room", &world_settings, &f->world) == ES_OK &&
           es_world_step(f->world, 0) == ES_OK && es_renderer_create(f->context, &settings, &f->renderer) == ES_OK;
}

static void lit_frame_close(lit_frame* f)
{
    if (f->renderer) es_renderer_destroy(f->renderer);
    if (f->world) es_world_destroy(f->world);
    if (f->context) es_context_destroy(f->context);
    *f = (lit_frame){0};
}

/* Medians over the repetitions, pass by pass. */
static bool time_frame(lit_frame* f, frame_times* times)
{
    double totals[REPETITIONS], passes[MAX_PASSES][REPETITIONS];
    *times = (frame_times){.total = NAN};
    for (int i = -WARM_UP; i < REPETITIONS; i++) {
        double start = demo_seconds();
        if (es_renderer_render(f->renderer, f->world) != ES_OK) return false;
        if (i < 0) continue;
        totals[i] = (demo_seconds() - start) * 1000;
        const es_frame_stats* stats = es_renderer_stats(f->renderer);
        times->passes = stats->pass_count < MAX_PASSES ? stats->pass_count : MAX_PASSES;
        for (size_t k = 0; k < times->passes; k++) {
            times->names[k] = stats->passes[k].name;
            passes[k][i] = stats->passes[k].milliseconds;
        }
    }
    times->total = bench_median(totals, REPETITIONS);
    for (size_t k = 0; k < times->passes; k++) times->milliseconds[k] = bench_median(passes[k], REPETITIONS);
    return true;
}

static double pass_time(const frame_times* times, const char* name)
{
    for (size_t k = 0; k < times->passes; k++)
        if (!strcmp(times->names[k], name)) return times->milliseconds[k];
    return NAN;
}

/* One bar: the passes that took the most, the others together. rows[0] is the whole frame. */
static void add_frame_bar(bench_report* report, const bench_row* rows, size_t count, uint32_t threads)
{
    enum { SHOWN = 9 };
    plot_bars plot = {.id = "passes", .value_name = "milliseconds", .part_count = SHOWN + 1};
    plot_bar* bar = plot_add_bar(&plot, "%u threads", threads);
    if (!bar) return;
    bool taken[MAX_PASSES + 1] = {false};
    size_t slowest = 0;
    double rest = rows[0].value;
    for (size_t k = 0; k < SHOWN; k++) {
        size_t most = 0;
        for (size_t i = 1; i < count; i++)
            if (!taken[i] && (!most || rows[i].value > rows[most].value)) most = i;
        if (!k) slowest = most;
        taken[most] = true;
        plot.part_names[k] = most ? rows[most].work : "";
        bar->parts[k] = most ? rows[most].value : NAN;
        rest -= most ? rows[most].value : 0;
    }
    plot.part_names[SHOWN] = "the others and between";
    bar->parts[SHOWN] = fmax(rest, 0);
    char total[32];
    plot_format_value(total, rows[0].value);
    snprintf(plot.headline, sizeof plot.headline, "A whole frame with 1024 virtual point lights takes %s ms; the most of a pass, %.0f %%, go to %s", total,
        100 * rows[slowest].value / rows[0].value, rows[slowest].work);
    snprintf(plot.caption, sizeof plot.caption, "The room of 70,000 triangles at 1024 × 768, one bounce, nothing skipped; medians.");
    bench_report_bars(report, &plot);
    plot_bars_free(&plot);
}

int bench_frame(const bench_options* options)
{
    lit_frame frame;
    frame_times times[MAX_ROUNDS];
    bool works = lit_frame_open(&frame, options->threads);
    for (uint32_t r = 0; r < options->runs && works; r++) works = time_frame(&frame, &times[r]);
    if (!works) {
        int code = demo_refuse_context(frame.context);
        lit_frame_close(&frame);
        return code;
    }
    bench_row rows[MAX_PASSES + 1];
    char ids[MAX_PASSES][64];
    size_t count = times[0].passes + 1;
    for (size_t k = 0; k < count; k++) {
        double values[MAX_ROUNDS];
        for (uint32_t r = 0; r < options->runs; r++) values[r] = k ? times[r].milliseconds[k - 1] : times[r].total;
        rows[k] = (bench_row){.id = "frame-total", .work = "whole frame", .unit = "ms", .peer_value = NAN, .ratio = NAN};
        rows[k].value = bench_median(values, options->runs);
        if (!k) continue;
        snprintf(ids[k - 1], sizeof ids[k - 1], "frame-%s", times[0].names[k - 1]);
        for (char* c = ids[k - 1]; *c; c++)
            if (*c == ' ') *c = '-';
        rows[k].id = ids[k - 1];
        rows[k].work = times[0].names[k - 1];
    }
    bench_print(rows, count);
    bench_report report = {.name = "frame", .title = "Where the time of a frame goes"};
    add_frame_bar(&report, rows, count, options->threads);
    int code = bench_report_write(&report, options, rows, count, frame.context);
    lit_frame_close(&frame);
    return code;
}

/* ---- rows that start programs
 * ------------------------------------------------------------------------------------------------------- */

/* Milliseconds of the whole frame in a fresh process of `program`; NaN when it fails. */
static double frame_in_process(const char* program, uint32_t threads)
{
    char thread_text[16];
    snprintf(thread_text, sizeof thread_text, "%u", threads);
    const char* arguments[] = {program, "bench", "frame", "--runs", "1", "--threads", thread_text, NULL};
    bench_child child = bench_run_child(arguments, NULL, NULL, true);
    const char* line = child.status == 0 && child.output ? strstr(child.output, "frame-total") : NULL;
    double value = line ? strtod(line + strlen("frame-total"), NULL) : NAN;
    free(child.output);
    return value;
}

static void twin_path(const bench_options* options, char path[DEMO_PATH_SIZE])
{
    snprintf(path, DEMO_PATH_SIZE, "%s", options->program);
    char* slash = strrchr(path, '/');
    size_t folder = slash ? (size_t)(slash - path) + 1 : 0;
    snprintf(path + folder, DEMO_PATH_SIZE - folder, "earthshine-inexact");
}

static bench_child render_in_process(const bench_options* options, const char* scene)
{
    char thread_text[16];
    snprintf(thread_text, sizeof thread_text, "%u", options->threads);
    const char* arguments[] = {options->program, "render", scene, "--size", "1024x768", "--threads", thread_text, "--set",
        "vpl.count=1024", "--set", "ism.size=128", "--hash", NULL};
    bench_child child = bench_run_child(arguments, NULL, NULL, true);
    free(child.output);
    child.output = NULL;
    return child;
}

/* ---- all of it
 * -------------------------------------------------------------------------------------------------------------------------- */

/* What the rounds gather: a list of values per figure. */
enum { GBUFFER_70K, GBUFFER_1M, DEPTH_1M, ISM, SHADE, FILTER, FRAME, FRAME_ONE_THREAD, EXACT, INEXACT, MEMORY, START, FIGURES };
typedef struct gathered {
    double values[FIGURES][MAX_ROUNDS];
    size_t counts[FIGURES];
} gathered;

static void gather(gathered* g, int figure, double value)
{
    if (!isnan(value)) g->values[figure][g->counts[figure]++] = value;
}

static void drawing_round(const bench_options* options, gathered* g)
{
    drawing d;
    if (bench_wants(options, "gbuffer-70k")) {
        es_raster_view view = camera_view();
        gather(g, GBUFFER_70K, drawing_open(&d, options->threads, 70000) ? time_drawing(&d, &view, false) : NAN);
        drawing_close(&d);
    }
    if (bench_wants(options, "gbuffer-1m") || bench_wants(options, "depth-1m")) {
        es_raster_view camera = camera_view(), light = light_view();
        bool open = drawing_open(&d, options->threads, 1000000);
        gather(g, GBUFFER_1M, open ? time_drawing(&d, &camera, false) : NAN);
        gather(g, DEPTH_1M, open ? time_drawing(&d, &light, true) : NAN);
        drawing_close(&d);
    }
}

static void frame_round(const bench_options* options, gathered* g)
{
    static const char* const ids[] = {"ism-1024", "shade-1024", "filter-8x8", "frame-1024", "threads-2"};
    bool wanted = false;
    for (size_t i = 0; i < sizeof ids / sizeof ids[0]; i++) wanted |= bench_wants(options, ids[i]);
    lit_frame f;
    frame_times times;
    if (wanted && lit_frame_open(&f, options->threads) && time_frame(&f, &times)) {
        gather(g, ISM, pass_time(&times, pass_ism));
        gather(g, SHADE, pass_time(&times, pass_shading));
        /* the pass applies the filter several times over; the row is one application */
        gather(g, FILTER, pass_time(&times, pass_filter) / bench_settings().filter_passes);
        gather(g, FRAME, times.total);
    }
    if (wanted) lit_frame_close(&f);
    if (!bench_wants(options, "threads-2")) return;
    if (lit_frame_open(&f, 1) && time_frame(&f, &times)) gather(g, FRAME_ONE_THREAD, times.total);
    lit_frame_close(&f);
}

static void process_round(const bench_options* options, gathered* g)
{
    char twin[DEMO_PATH_SIZE];
    twin_path(options, twin);
    if (bench_wants(options, "exact-cost") && access(twin, X_OK) == 0) {
        gather(g, EXACT, frame_in_process(options->program, options->threads));
        gather(g, INEXACT, frame_in_process(twin, options->threads));
    }
    if (bench_wants(options, "memory-1024")) {
        bench_child child = render_in_process(options, "room");
        gather(g, MEMORY, child.status == 0 ? child.peak_mebibytes : NAN);
    }
    if (bench_wants(options, "start-cornell")) {
        bench_child child = render_in_process(options, "cornell");
        gather(g, START, child.status == 0 ? child.seconds * 1000 : NAN);
    }
}

static double median_of(gathered* g, int figure) { return bench_median(g->values[figure], g->counts[figure]); }

static void fill(bench_row* rows, size_t count, const char* id, double value, double peer_value)
{
    bench_row* row = bench_find_row(rows, count, id);
    row->value = value;
    row->peer_value = peer_value;
    row->ratio = peer_value / value;
}

static void fill_rows(gathered* g, bench_peer* peer, bench_row* rows, size_t count)
{
    double gbuffer = bench_peer_value(peer, "gbuf 4RT 70k"), splat = bench_peer_value(peer, "ISM splat 8.4M points size 1..4");
    double shade = bench_peer_value(peer, "VPL shade split N=1024"),
           box = bench_peer_value(peer, "box filter separable 8+8 split");
    double shadow = bench_peer_value(peer, "shadow map 1024^2 70k");
    fill(rows, count, "gbuffer-70k", median_of(g, GBUFFER_70K), gbuffer);
    fill(rows, count, "gbuffer-1m", median_of(g, GBUFFER_1M), bench_peer_value(peer, "gbuf 4RT 1M"));
    fill(rows, count, "depth-1m", median_of(g, DEPTH_1M), bench_peer_value(peer, "shadow map 1024^2 1M"));
    fill(rows, count, "ism-1024", median_of(g, ISM), splat);
    fill(rows, count, "shade-1024", median_of(g, SHADE), shade);
    fill(rows, count, "filter-8x8", median_of(g, FILTER), box);
    fill(rows, count, "frame-1024", median_of(g, FRAME), gbuffer + shadow + splat + shade + box);
    fill(rows, count, "start-cornell", median_of(g, START), bench_peer_value(peer, "start to first frame"));

    bench_row* row = bench_find_row(rows, count, "threads-2");
    row->ratio = row->value = median_of(g, FRAME_ONE_THREAD) / median_of(g, FRAME);
    row->peer_value = isnan(row->ratio) ? NAN : 1;
    if (!isnan(row->ratio))
        snprintf(row->note, sizeof row->note, "%.4g ms against %.4g ms", median_of(g, FRAME), median_of(g, FRAME_ONE_THREAD));

    row = bench_find_row(rows, count, "exact-cost");
    double exact = median_of(g, EXACT), inexact = median_of(g, INEXACT);
    row->value = (exact / inexact - 1) * 100;
    row->ratio = inexact / exact;
    row->peer_value = isnan(row->ratio) ? NAN : 0;
    if (!isnan(row->ratio))
        snprintf(row->note, sizeof row->note, "%.4g ms against %.4g ms", exact, inexact);
    else
        snprintf(
            row->note, sizeof row->note, "no earthshine-inexact beside the program: configure with -DEARTHSHINE_INEXACT_TWIN=ON");

    row = bench_find_row(rows, count, "memory-1024");
    row->value = median_of(g, MEMORY);
}

int bench_speed(const bench_options* options)
{
    bench_row all[64], rows[64];
    size_t all_count = bench_speed_rows(all, 64), count = 0;
    static const char* const without_peer[] = {
        "indirect-room", "ism-vs-classic", "direct-room", "threads-2", "exact-cost", "memory-1024"};
    bool peer_wanted = options->only_count == 0;
    for (size_t i = 0; i < options->only_count; i++) {
        bool alone = false;
        for (size_t k = 0; k < sizeof without_peer / sizeof without_peer[0]; k++)
            alone |= !strcmp(without_peer[k], options->only[i]);
        peer_wanted |= !alone;
    }
    es_context* context = make_context(options->threads);
    gathered* g = calloc(1, sizeof *g);
    bench_peer* peer = calloc(1, sizeof *peer);
    if (!context || !g || !peer) {
        free(g);
        free(peer);
        if (context) es_context_destroy(context);
        return demo_refuse("out of memory");
    }
    bool with_peer = bench_peer_open(peer, BENCH_LLVMPIPE, peer_wanted && !options->no_peer);
    if (!with_peer && peer_wanted) fprintf(stderr, "earthshine: %s\n", peer->why);
    for (uint32_t round = 0; round < options->runs; round++) {
        fprintf(stderr, "round %u of %u\n", round + 1, options->runs);
        drawing_round(options, g);
        frame_round(options, g);
        process_round(options, g);
        if (with_peer) bench_peer_run(peer, 2);
    }
    fill_rows(g, peer, all, all_count);
    bench_measure_errors(options, peer, all, all_count);
    for (size_t i = 0; i < all_count; i++) {
        if (!bench_wants(options, all[i].id)) continue;
        rows[count] = all[i];
        if (!with_peer && rows[count].judge == BENCH_RATIO_AT_LEAST && isnan(rows[count].ratio) && !rows[count].note[0])
            snprintf(rows[count].note, sizeof rows[count].note, "%s", peer->why);
        count++;
    }
    bench_print(rows, count);
    bench_report report = {.name = "speed", .title = "How fast each pass is", .about = "Ours and llvmpipe's passes, turn by turn in one sitting; medians over the rounds."};
    int code = bench_report_write(&report, options, rows, count, context);
    bench_peer_close(peer);
    es_context_destroy(context);
    free(peer);
    free(g);
    return code;
}
