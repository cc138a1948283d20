/* `bench dynamics`: the peers' scenes of rigid bodies and cloth, simulated here and by Bullet turn by turn in one sitting.
 *
 * 60 steps a second, nothing falls asleep, friction 0.6, the same boxes to the last bit: a pyramid of 210 cubes, and 1000 boxes dropped between four
 * walls. A step is es_world_step, poses and bounds of nodes included. Bullet's world runs on one thread: it has no other in Debian's build. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BASE = 20, PYRAMID = BASE * (BASE + 1) / 2, DROPPED = 1000, EARLY_FROM = 60, EARLY_TO = 240, LATE_FROM = 900, STEPS = 1200, CLOTH_STEPS = 600, MAX_ROUNDS = 50 };
typedef enum figure { PYRAMID_TIME, PYRAMID_LATE, DROP_TIME, DROP_LATE, DRIFT, CLOTH_64, CLOTH_128, STRETCH_64, STRETCH_128, FIGURES } figure;

#define TEN "Bullet, 10 iterations"
#define TWENTY "Bullet, 20 iterations"
static const bench_row table[FIGURES] = {
    [PYRAMID_TIME] = {"pyramid-210", "pyramid of 210 cubes, a step between second 1 and 4", "ms", TEN, BENCH_RATIO_AT_LEAST, 1 / 0.6, 1 / 0.3},
    [PYRAMID_LATE] = {"pyramid-210-late", "the same between second 15 and 20", "ms", TEN, BENCH_RATIO_AT_LEAST, 1 / 0.6, 1 / 0.3},
    [DROP_TIME] = {"drop-1000", "1000 boxes dropped, a step between second 1 and 4", "ms", TEN, BENCH_RATIO_AT_LEAST, 1 / 0.6, 1 / 0.3},
    [DROP_LATE] = {"drop-1000-late", "the same between second 15 and 20", "ms", TEN, BENCH_RATIO_AT_LEAST, 1 / 0.6, 1 / 0.3},
    [DRIFT] = {"pyramid-drift", "largest movement of a cube of the pyramid between second 1 and 20", "m", TEN ", since the start", BENCH_VALUE_AT_MOST, 0.03, 0.003},
    [CLOTH_64] = {"cloth-64", "cloth of 64 by 64 points hung over a sphere, a step", "ms", TWENTY, BENCH_RATIO_AT_LEAST, 1, 2},
    [CLOTH_128] = {"cloth-128", "cloth of 128 by 128 points hung over a sphere, a step", "ms", TWENTY, BENCH_RATIO_AT_LEAST, 1, 2},
    [STRETCH_64] = {"cloth-64-stretch", "its most stretched edge, after 10 s", "x", TWENTY, BENCH_VALUE_AT_MOST, 1.1, 1.1},
    [STRETCH_128] = {"cloth-128-stretch", "its most stretched edge, after 10 s", "x", TWENTY, BENCH_VALUE_AT_MOST, 1.1, 1.1},
};

size_t bench_dynamics_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, FIGURES, rows, capacity); }

/* ---- worlds --------------------------------------------------------------------------------------------------------- */

typedef struct scene {
    es_context* context;
    es_world* world;
    es_body bodies[DROPPED];
    double start[DROPPED][3];
    uint32_t count;
} scene;

static void scene_close(scene* s)
{
    if (s->world) es_world_destroy(s->world);
    if (s->context) es_context_destroy(s->context);
    *s = (scene){0};
}

static bool scene_open(scene* s, uint32_t threads)
{
    *s = (scene){0};
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_world_settings settings = es_default_world_settings();
    settings.sleep = false;
    return es_context_create(&desc, &s->context) == ES_OK && es_world_create(s->context, &settings, &s->world) == ES_OK;
}

static bool add_box(scene* s, es_body_type type, const double position[3], es_quat rotation, es_vec3 half, es_body* body)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.half_extents = half;
    es_body_desc desc = es_default_body_desc();
    desc.type = type;
    memcpy(desc.position, position, sizeof desc.position);
    desc.rotation = rotation;
    desc.shapes = &shape;
    desc.shape_count = 1;
    es_body ignored;
    return es_world_add_body(s->world, &desc, body ? body : &ignored) == ES_OK;
}

static const es_quat upright = {0, 0, 0, 1};

static bool add_dynamic(scene* s, double x, double y, double z, es_quat rotation, es_vec3 half)
{
    double* p = s->start[s->count];
    p[0] = x;
    p[1] = y;
    p[2] = z;
    return add_box(s, ES_BODY_DYNAMIC, p, rotation, half, &s->bodies[s->count++]);
}

/* peers/rigid/world.h: make_pyramid */
static bool add_pyramid(scene* s)
{
    bool works = add_box(s, ES_BODY_STATIC, (double[3]){0, -1, 0}, upright, (es_vec3){100, 1, 100}, NULL);
    for (int row = 0; row < BASE; row++)
        for (int i = 0; i < BASE - row; i++)
            works = works && add_dynamic(s, (i - (BASE - row - 1) * 0.5) * 1.05, 0.5 + row, 0, upright, (es_vec3){0.5f, 0.5f, 0.5f});
    return works;
}

static float next_random(uint32_t* state)
{
    uint32_t x = *state;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    *state = x;
    return (float)(x >> 8) * (1.0f / 16777216.0f);
}

/* peers/rigid/world.h: make_drop; the planes are boxes whose faces lie in them */
static bool add_dropped(scene* s)
{
    bool works = add_box(s, ES_BODY_STATIC, (double[3]){0, -1, 0}, upright, (es_vec3){10, 1, 10}, NULL);
    for (int side = -1; side <= 1; side += 2) {
        works = works && add_box(s, ES_BODY_STATIC, (double[3]){side * 8.0, 20, 0}, upright, (es_vec3){1, 30, 10}, NULL);
        works = works && add_box(s, ES_BODY_STATIC, (double[3]){0, 20, side * 8.0}, upright, (es_vec3){10, 30, 1}, NULL);
    }
    uint32_t state = 4242;
    for (int y = 0; y < 10; y++)
        for (int z = 0; z < 10; z++)
            for (int x = 0; x < 10; x++) {
                double jitter[3], half[3], q[4], length = 0;
                for (int k = 0; k < 3; k++) jitter[k] = 0.2 * (next_random(&state) - 0.5);
                for (int k = 0; k < 3; k++) half[k] = 0.25 + 0.2 * next_random(&state);
                for (int k = 0; k < 4; k++) {
                    q[k] = next_random(&state) - 0.5;
                    length += q[k] * q[k];
                }
                length = sqrt(length);
                es_quat rotation = {(float)(q[0] / length), (float)(q[1] / length), (float)(q[2] / length), (float)(q[3] / length)};
                works = works && add_dynamic(s, (x - 4.5) * 1.3 + jitter[0], 1.2 + y * 1.3 + jitter[1], (z - 4.5) * 1.3 + jitter[2], rotation,
                                     (es_vec3){(float)half[0], (float)half[1], (float)half[2]});
            }
    return works;
}

typedef struct run { double early, late, drift, top; } run;

static bool simulate(bool dropped, uint32_t threads, uint32_t steps, run* result)
{
    scene s;
    static double second[DROPPED][3];
    bool works = scene_open(&s, threads) && (dropped ? add_dropped(&s) : add_pyramid(&s));
    double early = 0, late = 0;
    *result = (run){NAN, NAN, 0, -1e9};
    for (uint32_t i = 0; i < steps && works; i++) {
        double begin = demo_seconds();
        works = es_world_step(s.world, 1.0f / 60) == ES_OK;
        double milliseconds = (demo_seconds() - begin) * 1000;
        if (i >= EARLY_FROM && i < EARLY_TO) early += milliseconds / (EARLY_TO - EARLY_FROM);
        if (i >= LATE_FROM) late += milliseconds / (STEPS - LATE_FROM);
        for (uint32_t k = 0; k < s.count && works && (i + 1 == EARLY_FROM || i + 1 == steps); k++) {
            es_body_state state;
            works = es_world_get_body(s.world, s.bodies[k], &state) == ES_OK;
            if (i + 1 == EARLY_FROM) memcpy(second[k], state.position, sizeof second[k]);
            double d[3] = {state.position[0] - second[k][0], state.position[1] - second[k][1], state.position[2] - second[k][2]};
            result->drift = fmax(result->drift, sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            result->top = fmax(i + 1 == steps && k == 0 ? -1e9 : result->top, state.position[1]);
        }
    }
    if (steps >= EARLY_TO) result->early = early;
    if (steps >= STEPS) result->late = late;
    if (!works && s.context) fprintf(stderr, "earthshine: %s\n", es_context_message(s.context));
    scene_close(&s);
    return works;
}

/* ---- all of it ------------------------------------------------------------------------------------------------------ */

static bool wants_any(const bench_options* options, figure from, figure to)
{
    for (int f = from; f <= (int)to; f++)
        if (bench_wants(options, table[f].id)) return true;
    return false;
}

int bench_dynamics(const bench_options* options)
{
    static double values[FIGURES][MAX_ROUNDS];
    bench_row rows[FIGURES], shown[FIGURES];
    bench_dynamics_rows(rows, FIGURES);
    const bool pyramid = wants_any(options, PYRAMID_TIME, PYRAMID_LATE) || bench_wants(options, table[DRIFT].id), drop = wants_any(options, DROP_TIME, DROP_LATE);
    const uint32_t steps = options->quick ? EARLY_TO : STEPS;
    bench_peer* peer = calloc(1, sizeof *peer);
    if (!peer) return demo_refuse("out of memory");
    bool with_peer = bench_peer_open(peer, BENCH_BULLET, !options->no_peer), works = true;
    if (!with_peer) fprintf(stderr, "earthshine: %s\n", peer->why);
    for (uint32_t round = 0; round < options->runs && works; round++) {
        fprintf(stderr, "round %u of %u\n", round + 1, options->runs);
        run r = {NAN, NAN, NAN, NAN};
        if (pyramid) works = simulate(false, options->threads, steps, &r);
        values[PYRAMID_TIME][round] = r.early;
        values[PYRAMID_LATE][round] = r.late;
        values[DRIFT][round] = r.drift;
        snprintf(rows[PYRAMID_TIME].note, sizeof rows[0].note, "highest cube at the end %.3f m (19.5 at the start)", r.top);
        r = (run){NAN, NAN, NAN, NAN};
        if (drop && works) works = simulate(true, options->threads, steps, &r);
        values[DROP_TIME][round] = r.early;
        values[DROP_LATE][round] = r.late;
        snprintf(rows[DROP_TIME].note, sizeof rows[0].note, "highest box at the end %.2f m", r.top);
        for (int k = 0; k < 2 && works; k++) {
            double stretch = NAN, deepest = NAN;
            values[CLOTH_64 + k][round] = values[STRETCH_64 + k][round] = NAN;
            if (!bench_wants(options, table[CLOTH_64 + k].id) && !bench_wants(options, table[STRETCH_64 + k].id)) continue;
            works = bench_cloth(k ? 128 : 64, options->threads, options->quick ? 60 : CLOTH_STEPS, &values[CLOTH_64 + k][round], &stretch, &deepest);
            values[STRETCH_64 + k][round] = stretch;
            snprintf(rows[CLOTH_64 + k].note, sizeof rows[0].note, "most stretched edge %.3f; a vertex is %.4f m inside of the sphere at most", stretch, fmax(deepest, 0));
        }
        bool rigid_peer = pyramid || drop, cloth_peer = wants_any(options, CLOTH_64, STRETCH_128);
        const char* none[] = {NULL};
        if (with_peer && works && rigid_peer && !bench_peer_run_program(peer, 0, none, NULL)) fprintf(stderr, "earthshine: %s\n", peer->why);
        if (with_peer && works && cloth_peer && !bench_peer_run_program(peer, 1, none, NULL)) fprintf(stderr, "earthshine: %s\n", peer->why);
    }
    static const char* const peer_row[FIGURES][2] = {
        [PYRAMID_TIME] = {"pyramid iters10 steps 60-240", ""},
        [PYRAMID_LATE] = {"pyramid iters10 steps 900-1200", ""},
        [DROP_TIME] = {"drop1000 iters10 steps 60-240", ""},
        [DROP_LATE] = {"drop1000 iters10 steps 900-1200", ""},
        [DRIFT] = {"pyramid iters10 max displacement after 20 s", ""},
        [CLOTH_64] = {"cloth 64x64 ", "20 iterations"}, /* the number of links stands between */
        [CLOTH_128] = {"cloth 128x128 ", "20 iterations"},
        [STRETCH_64] = {"cloth 64x64 ", "20 iterations max stretch"},
        [STRETCH_128] = {"cloth 128x128 ", "20 iterations max stretch"},
    };
    int code = DEMO_OK;
    size_t count = 0;
    for (int f = 0; f < FIGURES && works; f++) {
        if (!bench_wants(options, rows[f].id)) continue;
        size_t begin = strlen(peer_row[f][0]), end = strlen(peer_row[f][1]);
        for (size_t i = 0; i < peer->row_count; i++) {
            const char* name = peer->rows[i].name;
            size_t length = strlen(name);
            if (length >= begin + end && !strncmp(name, peer_row[f][0], begin) && !strcmp(name + length - end, peer_row[f][1])) {
                if (end == 0 && length != begin) continue;
                rows[f].peer_value = bench_peer_value(peer, name);
            }
        }
        rows[f].value = bench_median(values[f], options->runs);
        rows[f].ratio = rows[f].peer_value / rows[f].value;
        if (isnan(rows[f].value)) snprintf(rows[f].note, sizeof rows[f].note, "not reached with --quick");
        if (isnan(rows[f].peer_value) && !rows[f].note[0]) snprintf(rows[f].note, sizeof rows[f].note, "%s", peer->why);
        shown[count++] = rows[f];
    }
    es_context* context = NULL;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    if (!works || es_context_create(&desc, &context) != ES_OK)
        code = demo_refuse("bench dynamics: a scene could not be simulated");
    else {
        bench_print(shown, count);
        bench_report report = {.name = "dynamics", .title = "Bodies and cloth beside Bullet", .about = "Ours and Bullet's, turn by turn in one sitting; medians over the rounds."};
        code = bench_report_write(&report, options, shown, count, context);
    }
    if (context) es_context_destroy(context);
    bench_peer_close(peer);
    free(peer);
    return code;
}
