/* How fast micro-buffers are: whole frames in motion, the hierarchy of a mesh that deforms, growth with the points, samples beside Embree's rays. */
#include "bench_micro.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const float dt = 1.0f / 30;

static void set_rate(bench_row* row, const micro_times* t)
{
    row->value = 1000 / t->frame;
    snprintf(row->note, sizeof row->note, "%.4g ms: %.3g of the hierarchy, %.3g of its light, %.4g of %.4g million samples in micro-buffers", t->frame, t->update, t->light, t->gather, (double)t->samples * 1e-6);
}

static bool measure_rates(bench_sitting* bench, const char* scene, const char* ending)
{
    const bool still = !strcmp(scene, "room"); /* nothing moves in it: all is done again */
    bench_row *every = sitting_row(bench, "micro-every-pixel%s", ending), *sparse = sitting_row(bench, "micro-sixteenth%s", ending);
    if (!every && !sparse) return true;
    es_world* world = sitting_open_scene(bench, scene);
    if (!world) return false;
    bool works = true;
    for (int k = 0; k < 2 && works; k++) {
        bench_row* row = k ? sparse : every;
        if (!row) continue;
        char settings[96];
        micro_times times;
        snprintf(settings, sizeof settings, "micro.points=%u micro.spacing=%d", 1u << micro_exponent(bench), k ? 4 : 1);
        works = micro_time(bench, world, settings, dt, still, &times);
        if (works) set_rate(row, &times);
        if (works) fprintf(stderr, "%s, %s: %.4g ms\n", scene, settings, times.frame);
    }
    es_world_destroy(world);
    return works;
}

/* ---- refit ------------------------------------------------------------------------------------------------------------------ */

typedef struct sheet { uint32_t side; es_mesh mesh; float *rest, *now; } sheet;

/* A wave of 2 mm to 12 cm across a square of 4 m. */
static void wave(es_world* world, void* user, double time, float step)
{
    (void)step;
    const sheet* s = user;
    for (size_t v = 0; v < (size_t)(s->side + 1) * (s->side + 1); v++) {
        const float *p = s->rest + 3 * v, phase = (float)time * 3;
        s->now[3 * v] = p[0];
        s->now[3 * v + 1] = 0.12f * sinf(2.1f * p[0] + phase) * sinf(1.7f * p[2] - 0.6f * phase) + 0.002f * sinf(31 * p[0] + 2 * phase);
        s->now[3 * v + 2] = p[2];
    }
    es_world_deform_mesh(world, s->mesh, s->now, NULL);
}

static bool add_sheet(es_world* world, sheet* s, uint32_t side)
{
    const uint32_t vertices = (side + 1) * (side + 1), triangles = 2 * side * side;
    s->side = side;
    s->rest = malloc(vertices * 3ull * sizeof(float));
    s->now = malloc(vertices * 3ull * sizeof(float));
    uint32_t *indices = malloc(triangles * 3ull * sizeof *indices), *next = indices;
    if (!s->rest || !s->now || !indices) {
        free(indices);
        return false;
    }
    for (uint32_t v = 0; v < vertices; v++) {
        s->rest[3 * v] = 4 * ((float)(v % (side + 1)) / (float)side - 0.5f);
        s->rest[3 * v + 1] = 0;
        s->rest[3 * v + 2] = 4 * ((float)(v / (side + 1)) / (float)side - 0.5f);
    }
    for (uint32_t y = 0; y < side; y++)
        for (uint32_t x = 0; x < side; x++) {
            const uint32_t a = y * (side + 1) + x, quad[6] = {a, a + side + 1, a + 1, a + 1, a + side + 1, a + side + 2};
            memcpy(next, quad, sizeof quad);
            next += 6;
        }
    const es_mesh_desc desc = {.name = "sheet", .vertex_count = vertices, .triangle_count = triangles, .positions = s->rest, .indices = indices};
    const bool works = es_world_add_mesh(world, &desc, &s->mesh) == ES_OK;
    free(indices);
    return works;
}

/* A sheet, a lamp above it, a camera beside the lamp. */
static es_world* open_sheet(bench_sitting* bench, sheet* s, uint32_t side)
{
    es_world* world = NULL;
    es_node node, camera_node;
    es_instance instance;
    es_light light;
    es_camera camera;
    const es_transform above = {{0, 5, 0}, {-0.70710678f, 0, 0, 0.70710678f}, {1, 1, 1}};
    if (es_world_create(bench->context, NULL, &world) != ES_OK) return NULL;
    es_light_desc lamp = es_default_light_desc();
    es_camera_desc eye = es_default_camera_desc();
    lamp.intensity = 100;
    bool works = add_sheet(world, s, side) && es_world_add_node(world, &(es_node_desc){.name = "lamp", .transform = above}, &node) == ES_OK &&
                 es_world_add_node(world, &(es_node_desc){.name = "eye", .transform = above}, &camera_node) == ES_OK;
    lamp.node = node;
    eye.node = camera_node;
    works = works && es_world_add_instance(world, &(es_instance_desc){.mesh = s->mesh}, &instance) == ES_OK && es_world_add_light(world, &lamp, &light) == ES_OK &&
            es_world_add_camera(world, &eye, &camera) == ES_OK;
    es_world_set_step_function(world, wave, s);
    if (works) return world;
    es_world_destroy(world);
    return NULL;
}

static bool measure_refit(bench_sitting* bench)
{
    bench_row* row = sitting_row(bench, "micro-refit");
    if (!row) return true;
    sheet s = {0};
    es_world* world = open_sheet(bench, &s, bench->options->quick ? 64 : 512);
    bench_sitting small = *bench;
    small.width = small.height = 64; /* the picture has no part in it */
    small.frames = bench->options->quick ? 2 : 15;
    char settings[64];
    micro_times times;
    snprintf(settings, sizeof settings, "micro.points=%u micro.spacing=4 micro.size=8", 1u << micro_exponent(bench));
    const bool works = world && micro_time(&small, world, settings, dt, false, &times);
    if (works) {
        row->value = times.update;
        snprintf(row->note, sizeof row->note, "%.4g million points; lighting them takes %.3g ms", (double)times.points * 1e-6, times.light);
    } else if (!world) {
        demo_refuse_context(bench->context);
    }
    if (world) es_world_destroy(world);
    free(s.rest);
    free(s.now);
    return works;
}

/* ---- growth ------------------------------------------------------------------------------------------------------------------- */

static bool measure_growth(bench_sitting* bench)
{
    bench_row *ratio = sitting_row(bench, "micro-growth"), *rows[MICRO_EXPONENTS];
    bool any = ratio != NULL;
    for (int k = 0; k < MICRO_EXPONENTS; k++) any |= (rows[k] = sitting_row(bench, "micro-points-%d", MICRO_LEAST_EXPONENT + k)) != NULL;
    if (!any) return true;
    plot_curves plot = {.id = "growth", .x_name = "points", .y_name = "milliseconds", .x_log = true, .y_log = true};
    plot_series *whole = plot_add_series(&plot, 0, "whole frame"), *update = plot_add_series(&plot, 1, "hierarchy and its light");
    whole->line = update->line = true;
    double first = NAN, last = NAN;
    bool works = true;
    for (int k = 0; k < MICRO_EXPONENTS && works; k++) {
        const bool end = k == 0 || k == MICRO_EXPONENTS - 1;
        if (!rows[k] && !(end && ratio)) continue;
        if (bench->options->quick && !end) continue;
        char settings[64];
        micro_times t;
        snprintf(settings, sizeof settings, "micro.points=%u", 1u << (MICRO_LEAST_EXPONENT + k));
        es_world* world = sitting_open_scene(bench, "cornell"); /* each from the beginning, so that all see the same frames */
        works = world && micro_time(bench, world, settings, dt, false, &t);
        if (world) es_world_destroy(world);
        if (!works) break;
        fprintf(stderr, "2^%d points: %.4g ms\n", MICRO_LEAST_EXPONENT + k, t.frame);
        if (k == 0) first = t.frame;
        last = t.frame;
        if (rows[k]) {
            rows[k]->value = t.frame;
            snprintf(rows[k]->note, sizeof rows[k]->note, "%.3g ms of the hierarchy, %.3g of its light, %.4g in micro-buffers", t.update, t.light, t.gather);
        }
        plot_add_point(&plot, whole, exp2(MICRO_LEAST_EXPONENT + k), t.frame, "%.4g ms in micro-buffers", t.gather);
        plot_add_point(&plot, update, exp2(MICRO_LEAST_EXPONENT + k), t.update + t.light, "%.3g ms of it light", t.light);
    }
    if (works && ratio) {
        ratio->value = last / first;
        snprintf(ratio->note, sizeof ratio->note, "%.4g ms and %.4g ms", first, last);
    }
    if (works && whole->count > 1) {
        snprintf(plot.headline, sizeof plot.headline, "%.3g times the points take %.2f times as long", whole->points[whole->count - 1].x / whole->points[0].x, last / first);
        snprintf(plot.caption, sizeof plot.caption, "cornell in motion, %u × %u, 24 × 24 micro-buffers at every pixel. Ritschel's thesis, figure 6.18.", bench->width, bench->height);
        bench_report_curves(&bench->report, &plot);
    }
    plot_curves_free(&plot);
    return works;
}

/* ---- samples beside rays ---------------------------------------------------------------------------------------------------------- */

static bool measure_samples(bench_sitting* bench)
{
    enum { MOST_ROUNDS = 50 };
    bench_row* row = sitting_row(bench, "micro-samples");
    if (!row) return true;
    bench_peer* peer = calloc(1, sizeof *peer);
    es_world* world = peer ? sitting_open_scene(bench, "room") : NULL;
    double rates[MOST_ROUNDS];
    const uint32_t rounds = bench->options->quick ? 1 : bench->options->runs < 3 ? bench->options->runs : 3;
    bool works = world != NULL, with_peer = peer && bench_peer_open(peer, BENCH_EMBREE_RAYS, !bench->options->no_peer && !bench->options->quick);
    char settings[64];
    snprintf(settings, sizeof settings, "micro.points=%u", 1u << micro_exponent(bench));
    for (uint32_t round = 0; round < rounds && works; round++) {
        micro_times t;
        works = micro_time(bench, world, settings, 0, true, &t);
        if (!works) break;
        rates[round] = (double)t.samples / t.gather * 1e-3;
        snprintf(row->note, sizeof row->note, "%.4g million samples in %.4g ms; ", (double)t.samples * 1e-6, t.gather);
        if (with_peer && !bench_peer_run(peer, bench->options->threads)) fprintf(stderr, "earthshine: %s\n", peer->why);
    }
    if (works) {
        row->value = bench_median(rates, rounds);
        row->peer_value = with_peer ? bench_peer_value(peer, "hemi intersect1 tfar=inf 70k") : NAN;
        row->ratio = row->value / row->peer_value;
        const size_t length = strlen(row->note);
        snprintf(row->note + length, sizeof row->note - length, "%s", with_peer ? "the peer traces the same room, one ray a pixel of 1024 × 768" : peer->why);
    }
    if (world) es_world_destroy(world);
    if (peer) bench_peer_close(peer);
    free(peer);
    return works;
}

bool micro_measure_speed(bench_sitting* bench)
{
    return measure_rates(bench, "cornell", "") && measure_rates(bench, "room", "-room") && measure_rates(bench, "hall", "-hall") && measure_rates(bench, "gallery", "-gallery") && measure_refit(bench) &&
           measure_growth(bench) && measure_samples(bench);
}
