/* Clips: every path and interpolation against doubles, blending and cross-fades with exact ends, loops, speeds and holds, lights and
 * cameras, what is saved and restored, refusals. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "sim/sim.h"

enum { KEYS = 5, TARGETS = 3 };

typedef struct stage {
    es_context* context;
    es_world* world;
    es_node node;
    es_mesh mesh;
    es_light light;
    es_camera camera;
} stage;

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(77, counter++)); }
static void quiet(void* user, es_log_level level, es_result item, const char* message) {}

static int set_up(void** state)
{
    stage* s = calloc(1, sizeof *s);
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = quiet;
    if (es_context_create(&desc, &s->context) != ES_OK || es_world_create(s->context, NULL, &s->world) != ES_OK) return -1;
    static const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, up[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const uint32_t indices[3] = {0, 1, 2};
    es_node_desc node = {"node", {0}, es_identity_transform()};
    node.transform.translation = es_v3(1, 2, 3);
    node.transform.rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), 0.3f);
    es_morph_target targets[TARGETS] = {{up, NULL, NULL}, {triangle, NULL, NULL}, {up, NULL, NULL}};
    float weights[TARGETS] = {0.25f, 0, -1};
    es_light_desc light = es_default_light_desc();
    light.type = ES_LIGHT_SPOT;
    es_camera_desc camera = es_default_camera_desc();
    assert_int_equal(es_world_add_node(s->world, &node, &s->node), ES_OK);
    assert_int_equal(es_world_add_mesh(s->world,
                         &(es_mesh_desc){.vertex_count = 3, .triangle_count = 1, .positions = triangle, .indices = indices, .target_count = TARGETS, .targets = targets, .weights = weights}, &s->mesh), ES_OK);
    assert_int_equal(es_world_add_light(s->world, &light, &s->light), ES_OK);
    assert_int_equal(es_world_add_camera(s->world, &camera, &s->camera), ES_OK);
    *state = s;
    return 0;
}

static int tear_down(void** state)
{
    stage* s = *state;
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
    free(s);
    return 0;
}

static uint32_t size_of(es_clip_path path)
{
    return path == ES_CLIP_ROTATION ? 4 : path == ES_CLIP_WEIGHTS ? TARGETS : path == ES_CLIP_TRANSLATION || path == ES_CLIP_SCALE || path == ES_CLIP_LIGHT_COLOR ? 3 : 1;
}

/* What the world has where the path leads. */
static void read(stage* s, es_clip_path path, float out[4])
{
    es_transform t;
    es_light_desc light;
    es_camera_desc camera;
    uint32_t count = TARGETS;
    assert_int_equal(es_world_get_node_transform(s->world, s->node, &t), ES_OK);
    assert_int_equal(es_world_get_light(s->world, s->light, &light), ES_OK);
    assert_int_equal(es_world_get_camera(s->world, s->camera, &camera), ES_OK);
    switch (path) {
    case ES_CLIP_TRANSLATION: memcpy(out, &t.translation, 12); break;
    case ES_CLIP_ROTATION: memcpy(out, &t.rotation, 16); break;
    case ES_CLIP_SCALE: memcpy(out, &t.scale, 12); break;
    case ES_CLIP_WEIGHTS: assert_int_equal(es_world_get_morph_weights(s->world, s->mesh, out, &count), ES_OK); break;
    case ES_CLIP_LIGHT_COLOR: memcpy(out, light.color, 12); break;
    case ES_CLIP_LIGHT_INTENSITY: out[0] = light.intensity; break;
    case ES_CLIP_LIGHT_INNER_CONE: out[0] = light.inner_cone; break;
    case ES_CLIP_LIGHT_OUTER_CONE: out[0] = light.outer_cone; break;
    case ES_CLIP_LIGHT_RANGE: out[0] = light.range; break;
    case ES_CLIP_CAMERA_FOV: out[0] = camera.fov_y; break;
    case ES_CLIP_CAMERA_HALF_HEIGHT: out[0] = camera.half_height; break;
    default: out[0] = camera.near_plane; break;
    }
}

static es_clip add_clip(stage* s, es_clip_path path, es_interpolation interpolation, uint32_t keys, const float* times, const float* values)
{
    es_clip_channel channel = {.node = s->node, .path = path, .interpolation = interpolation, .key_count = keys, .times = times, .values = values, .mesh = s->mesh, .light = s->light, .camera = s->camera};
    es_clip clip;
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"clip", 1, &channel}, &clip), ES_OK);
    return clip;
}

static void step_to(stage* s, double time)
{
    while (es_world_time(s->world) < time - 1e-9) {
        double left = time - es_world_time(s->world);
        assert_int_equal(es_world_step(s->world, left > 10 ? 10.0f : (float)left), ES_OK);
    }
}

/* ---- interpolations in double (glTF 2.0 appendix C) -------------------------------------------------------------------------------- */

static void expect(es_clip_path path, es_interpolation interpolation, const float* times, const float* values, double t, double* out)
{
    uint32_t n = size_of(path), k = 0;
    while (k + 1 < KEYS && times[k + 1] <= t) k++;
    uint32_t stride = interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? 3 * n : n, middle = interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? n : 0;
    const float *a = values + k * stride + middle, *b = a + stride;
    double u = k + 1 < KEYS ? (t - times[k]) / ((double)times[k + 1] - times[k]) : 0, td = k + 1 < KEYS ? (double)times[k + 1] - times[k] : 0;
    if (k + 1 == KEYS || t <= times[0] || interpolation == ES_INTERPOLATE_STEP) {
        for (uint32_t c = 0; c < n; c++) out[c] = a[c];
    } else if (interpolation == ES_INTERPOLATE_CUBIC_SPLINE) {
        for (uint32_t c = 0; c < n; c++)
            out[c] = (2 * u * u * u - 3 * u * u + 1) * a[c] + td * (u * u * u - 2 * u * u + u) * a[n + c] + (3 * u * u - 2 * u * u * u) * b[c] + td * (u * u * u - u * u) * (b - n)[c];
    } else if (path == ES_CLIP_ROTATION) {
        double d = 0;
        for (int c = 0; c < 4; c++) d += (double)a[c] * b[c];
        double angle = acos(fmin(fabs(d), 1)), wa = 1 - u, wb = u;
        if (angle > 1e-4) wa = sin(wa * angle) / sin(angle), wb = sin(wb * angle) / sin(angle);
        for (int c = 0; c < 4; c++) out[c] = wa * a[c] + (d < 0 ? -wb : wb) * b[c];
    } else {
        for (uint32_t c = 0; c < n; c++) out[c] = (1 - u) * a[c] + u * b[c];
    }
    if (path != ES_CLIP_ROTATION) return;
    double length = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] + out[3] * out[3]);
    for (int c = 0; c < 4; c++) out[c] /= length;
}

static void interpolations(void** state)
{
    stage* s = *state;
    static const float times[KEYS] = {0.5f, 1, 1.25f, 3, 4};
    for (int path = 0; path < ES_CLIP_PATHS; path++)
        for (int interpolation = 0; interpolation < 3; interpolation++) {
            uint32_t n = size_of((es_clip_path)path), stride = interpolation == ES_INTERPOLATE_CUBIC_SPLINE ? 3 * n : n;
            float values[KEYS * 12];
            for (uint32_t k = 0; k < KEYS; k++) {
                for (uint32_t c = 0; c < stride; c++) values[k * stride + c] = uniform(-0.1f, 0.1f);
                float* v = values + k * stride + (stride == n ? 0 : n);
                for (uint32_t c = 0; c < n; c++) v[c] = path >= ES_CLIP_LIGHT_INTENSITY ? uniform(0.3f, 0.6f) : path == ES_CLIP_LIGHT_COLOR ? uniform(0.2f, 0.9f) : uniform(-1, 1);
                if (path == ES_CLIP_ROTATION) {
                    es_quat q = es_quat_normalize((es_quat){v[0], v[1], v[2], v[3]});
                    memcpy(v, &q, sizeof q);
                }
            }
            double begin = es_world_time(s->world);
            es_clip clip = add_clip(s, (es_clip_path)path, (es_interpolation)interpolation, KEYS, times, values);
            assert_int_equal(es_world_play_clip(s->world, clip, true), ES_OK);
            for (double t = 0.25; t < 6; t += 0.25) {
                step_to(s, begin + t);
                double phase = t < 4 ? t : t - 4, expected[4];
                expect((es_clip_path)path, (es_interpolation)interpolation, times, values, phase, expected);
                float got[4];
                read(s, (es_clip_path)path, got);
                for (uint32_t c = 0; c < n; c++)
                    if (fabs(got[c] - expected[c]) > 2e-6) fail_msg("path %d, interpolation %d at %g: %g, expected %g", path, interpolation, t, (double)got[c], expected[c]);
            }
            es_clip_state playing;
            assert_int_equal(es_world_get_clip(s->world, clip, &playing), ES_OK);
            assert_true(playing.playing && playing.duration == 4 && playing.channel_count == 1 && playing.weight == 1);
            assert_int_equal(es_world_play_clip(s->world, clip, false), ES_OK);
            assert_int_equal(es_world_destroy_clip(s->world, clip), ES_OK);
        }
}

/* ---- blending ------------------------------------------------------------------------------------------------------------------------ */

static const float two_times[2] = {0, 2};

static void cross_fades(void** state)
{
    stage* s = *state;
    static const float a_moves[6] = {0, 0, 0, 4, 0, 0}, b_moves[6] = {0, 1, 0, 0, 5, 0};
    float a_turns[8] = {0, 0, 0, 1, 0, 0.6f, 0, 0.8f}, b_turns[8] = {0.6f, 0, 0, 0.8f, 0, 0, 0, 1};
    es_clip_channel a_channels[2] = {{.node = s->node, .path = ES_CLIP_TRANSLATION, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = 2, .times = two_times, .values = a_moves},
        {.node = s->node, .path = ES_CLIP_ROTATION, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = 2, .times = two_times, .values = a_turns}};
    es_clip_channel b_channels[2] = {a_channels[0], a_channels[1]};
    b_channels[0].values = b_moves, b_channels[1].values = b_turns;
    es_clip a, b;
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"a", 2, a_channels}, &a), ES_OK);
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"b", 2, b_channels}, &b), ES_OK);
    /* what each gives alone at 1.5 s */
    float alone[2][2][4];
    for (int i = 0; i < 2; i++) {
        es_clip clip = i ? b : a;
        double begin = es_world_time(s->world);
        assert_int_equal(es_world_play_clip(s->world, clip, true), ES_OK);
        step_to(s, begin + 1.5);
        read(s, ES_CLIP_TRANSLATION, alone[i][0]);
        read(s, ES_CLIP_ROTATION, alone[i][1]);
        assert_int_equal(es_world_play_clip(s->world, clip, false), ES_OK);
    }
    /* the fade: b comes over one second from 0.25 s on, a goes; both are paused at 1.5 s so that only weights change */
    es_clip_play how = es_default_clip_play();
    how.start = 1.5f;
    how.speed = 0;
    double begin = es_world_time(s->world);
    assert_int_equal(es_world_play_clip_with(s->world, a, &how), ES_OK);
    step_to(s, begin + 0.25);
    float got[4];
    read(s, ES_CLIP_TRANSLATION, got);
    assert_memory_equal(got, alone[0][0], 12);
    read(s, ES_CLIP_ROTATION, got);
    assert_memory_equal(got, alone[0][1], 16);
    how.fade = 1;
    assert_int_equal(es_world_play_clip_with(s->world, b, &how), ES_OK);
    assert_int_equal(es_world_stop_clip(s->world, a, 1), ES_OK);
    for (int i = 1; i < 8; i++) {
        step_to(s, begin + 0.25 + i / 8.0);
        es_clip_state states[2];
        assert_int_equal(es_world_get_clip(s->world, a, &states[0]), ES_OK);
        assert_int_equal(es_world_get_clip(s->world, b, &states[1]), ES_OK);
        assert_true(fabs(states[0].weight - (1 - i / 8.0)) < 1e-6 && fabs(states[1].weight - i / 8.0) < 1e-6 && states[0].target_weight == 0 && states[1].target_weight == 1);
        read(s, ES_CLIP_TRANSLATION, got);
        for (int c = 0; c < 3; c++) assert_true(fabs(got[c] - ((1 - i / 8.0) * alone[0][0][c] + i / 8.0 * alone[1][0][c])) < 1e-5);
        read(s, ES_CLIP_ROTATION, got);
        double d = 0, u = i / 8.0;
        for (int c = 0; c < 4; c++) d += (double)alone[0][1][c] * alone[1][1][c];
        double angle = acos(fabs(d));
        for (int c = 0; c < 4; c++)
            assert_true(fabs(got[c] - (sin((1 - u) * angle) * alone[0][1][c] + (d < 0 ? -1 : 1) * sin(u * angle) * alone[1][1][c]) / sin(angle)) < 1e-5);
    }
    step_to(s, begin + 1.25);
    read(s, ES_CLIP_TRANSLATION, got);
    assert_memory_equal(got, alone[1][0], 12);
    read(s, ES_CLIP_ROTATION, got);
    assert_memory_equal(got, alone[1][1], 16);
    es_clip_state ended;
    assert_int_equal(es_world_get_clip(s->world, a, &ended), ES_OK);
    assert_false(ended.playing);

    /* fading out alone: back to what was before clips, exactly, and free again */
    assert_int_equal(es_world_stop_clip(s->world, b, 0.5f), ES_OK);
    step_to(s, begin + 1.5);
    read(s, ES_CLIP_TRANSLATION, got);
    for (int c = 0; c < 3; c++) assert_true(fabs(got[c] - (0.5 * (1 + c) + 0.5 * alone[1][0][c])) < 1e-5);
    step_to(s, begin + 2);
    read(s, ES_CLIP_TRANSLATION, got);
    assert_true(got[0] == 1 && got[1] == 2 && got[2] == 3);
    es_transform mine = es_identity_transform();
    mine.translation.x = 7;
    assert_int_equal(es_world_set_node_transform(s->world, s->node, &mine), ES_OK);
    step_to(s, begin + 3);
    read(s, ES_CLIP_TRANSLATION, got);
    assert_true(got[0] == 7);
}

static void weights_of_clips(void** state)
{
    stage* s = *state;
    static const float one[6] = {1, 0, 0, 1, 0, 0}, two[6] = {0, 2, 0, 0, 2, 0}, three[6] = {0, 0, 3, 0, 0, 3}; /* morph weights */
    es_clip clips[3] = {add_clip(s, ES_CLIP_WEIGHTS, ES_INTERPOLATE_LINEAR, 2, two_times, one), add_clip(s, ES_CLIP_WEIGHTS, ES_INTERPOLATE_LINEAR, 2, two_times, two),
        add_clip(s, ES_CLIP_WEIGHTS, ES_INTERPOLATE_LINEAR, 2, two_times, three)};
    static const float weights[][3] = {{1, 1, 2}, {0.25f, 0.25f, 0.25f}, {0, 3, 0}, {0.5f, 0, 0}};
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 3; k++) {
            es_clip_play how = es_default_clip_play();
            how.weight = weights[i][k];
            assert_int_equal(es_world_play_clip_with(s->world, clips[k], &how), ES_OK);
        }
        assert_int_equal(es_world_step(s->world, 0.125f), ES_OK);
        float got[4];
        read(s, ES_CLIP_WEIGHTS, got);
        double sum = weights[i][0] + weights[i][1] + weights[i][2], rest[3] = {0.25, 0, -1};
        for (int k = 0; k < 3; k++) {
            double expected = weights[i][k] * (k + 1) / fmax(sum, 1) + fmax(1 - sum, 0) * rest[k];
            if (fabs(got[k] - expected) > 1e-6) fail_msg("case %d: %g, expected %g", i, (double)got[k], expected);
        }
    }
}

static void speeds_and_ends(void** state)
{
    stage* s = *state;
    static const float moves[6] = {0, 0, 0, 4, 0, 0};
    es_clip clip = add_clip(s, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 2, two_times, moves);
    struct { float speed, start; bool once; float at, x; } cases[] = {{2, -1, false, 0.5f, 2}, {2, -1, false, 1.25f, 1}, {-1, -1, false, 0.5f, 3}, {-1, -1, true, 3, 0}, {1, 1, true, 0.5f, 3}, {1, -1, true, 5, 4},
        {0.5f, 1.5f, false, 2, 1}, {0, 1, false, 3, 2}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        assert_int_equal(es_world_play_clip(s->world, clip, false), ES_OK);
        double begin = es_world_time(s->world);
        es_clip_play how = es_default_clip_play();
        how.speed = cases[i].speed, how.start = cases[i].start, how.once = cases[i].once;
        assert_int_equal(es_world_play_clip_with(s->world, clip, &how), ES_OK);
        step_to(s, begin + (double)cases[i].at);
        float got[4];
        read(s, ES_CLIP_TRANSLATION, got);
        if (fabsf(got[0] - cases[i].x) > 1e-5f) fail_msg("case %zu: %g", i, (double)got[0]);
    }
    /* another speed goes on from where it is */
    es_clip_play how = es_default_clip_play();
    how.start = 0;
    double begin = es_world_time(s->world);
    assert_int_equal(es_world_play_clip_with(s->world, clip, &how), ES_OK);
    step_to(s, begin + 1);
    how.start = -1, how.speed = 0.25f;
    assert_int_equal(es_world_play_clip_with(s->world, clip, &how), ES_OK);
    step_to(s, begin + 3);
    es_clip_state playing;
    assert_int_equal(es_world_get_clip(s->world, clip, &playing), ES_OK);
    assert_true(fabs(playing.time - 1.5) < 1e-6 && playing.speed == 0.25f);
}

static void saving(void** state)
{
    stage* s = *state;
    static const float moves[6] = {0, 0, 0, 4, 0, 0}, cones[2] = {0.1f, 0.4f}, open[6] = {0, 0, 0, 1, 2, 3};
    es_clip clips[3] = {add_clip(s, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 2, two_times, moves), add_clip(s, ES_CLIP_LIGHT_INNER_CONE, ES_INTERPOLATE_LINEAR, 2, two_times, cones),
        add_clip(s, ES_CLIP_WEIGHTS, ES_INTERPOLATE_LINEAR, 2, two_times, open)};
    es_clip_play how = es_default_clip_play();
    how.fade = 1, how.speed = 0.7f;
    for (int i = 0; i < 3; i++) assert_int_equal(es_world_play_clip_with(s->world, clips[i], &how), ES_OK);
    for (int i = 0; i < 4; i++) assert_int_equal(es_world_step(s->world, 0.1f), ES_OK);
    assert_int_equal(es_world_stop_clip(s->world, clips[0], 0.6f), ES_OK);
    size_t size = 0;
    assert_int_equal(es_world_save(s->world, NULL, &size), ES_OK);
    char* saved = malloc(size);
    assert_int_equal(es_world_save(s->world, saved, &size), ES_OK);
    uint64_t hashes[12];
    for (int i = 0; i < 12; i++) {
        assert_int_equal(es_world_step(s->world, 0.1f), ES_OK);
        hashes[i] = es_world_hash(s->world);
    }
    assert_int_equal(es_world_play_clip(s->world, clips[1], false), ES_OK);
    assert_int_equal(es_world_restore(s->world, saved, size), ES_OK);
    for (int i = 0; i < 12; i++) {
        assert_int_equal(es_world_step(s->world, 0.1f), ES_OK);
        assert_true(es_world_hash(s->world) == hashes[i]);
    }
    free(saved);
}

static void refusals(void** state)
{
    stage* s = *state;
    static const float moves[6] = {0, 0, 0, 4, 0, 0};
    es_clip clip = add_clip(s, ES_CLIP_LIGHT_COLOR, ES_INTERPOLATE_LINEAR, 2, two_times, moves);
    es_clip_play how[6];
    for (int i = 0; i < 6; i++) how[i] = es_default_clip_play();
    how[0].weight = -1, how[1].weight = NAN, how[2].speed = 1000, how[3].fade = -1, how[4].fade = INFINITY, how[5].start = NAN;
    for (int i = 0; i < 6; i++) assert_int_equal(es_world_play_clip_with(s->world, clip, &how[i]), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_stop_clip(s->world, clip, -1), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_stop_clip(s->world, (es_clip){0}, 1), ES_STALE_HANDLE);
    assert_int_equal(es_world_destroy_light(s->world, s->light), ES_WRONG_STATE); /* the clip moves it */
    static const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const uint32_t indices[3] = {0, 1, 2};
    es_mesh plain;
    assert_int_equal(es_world_add_mesh(s->world, &(es_mesh_desc){.vertex_count = 3, .triangle_count = 1, .positions = triangle, .indices = indices}, &plain), ES_OK);
    es_clip_channel channel = {.path = ES_CLIP_WEIGHTS, .key_count = 2, .times = two_times, .values = moves, .mesh = plain};
    es_clip bad;
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"bad", 1, &channel}, &bad), ES_INVALID_ARGUMENT);
    channel = (es_clip_channel){.path = ES_CLIP_CAMERA_FOV, .key_count = 2, .times = two_times, .values = moves};
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"bad", 1, &channel}, &bad), ES_STALE_HANDLE);
    channel.path = ES_CLIP_PATHS;
    assert_int_equal(es_world_add_clip(s->world, &(es_clip_desc){"bad", 1, &channel}, &bad), ES_INVALID_ARGUMENT);
    /* a spline that swings out of range is held there */
    static const float wild[6] = {0, 0.5f, 9000, -9000, 0.5f, 0};
    es_clip fov = add_clip(s, ES_CLIP_CAMERA_FOV, ES_INTERPOLATE_CUBIC_SPLINE, 2, two_times, wild);
    assert_int_equal(es_world_play_clip(s->world, fov, true), ES_OK);
    assert_int_equal(es_world_step(s->world, 1), ES_OK);
    float got[4];
    read(s, ES_CLIP_CAMERA_FOV, got);
    assert_true(got[0] == 3.115f);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {TEST(interpolations), TEST(cross_fades), TEST(weights_of_clips), TEST(speeds_and_ends), TEST(saving), TEST(refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
