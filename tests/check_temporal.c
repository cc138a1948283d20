/* Temporal coherence: every instruction set against scalar, bit for bit, on random G-buffers of odd sizes, with guards round what is written; and
 * scalar against the equations in double, term by term (gi/temporal.h, Knecht 2009 eq. 3.1 to 3.6). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "gi/temporal.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "tests/guarded_planes.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(31, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

typedef enum movement { STILL, PANNED, SCATTERED } movement;

static es_gbuffer new_gbuffer(uint32_t width, uint32_t height, movement movement)
{
    es_gbuffer g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8};
    size_t count = (size_t)g.stride * height;
    g.depth = malloc(count * 4);
    g.normal = malloc(count * 4);
    g.motion_x = malloc(count * 4);
    g.motion_y = malloc(count * 4);
    const float pan_x = uniform(-3, 3), pan_y = uniform(-3, 3);
    for (size_t i = 0; i < count; i++) {
        uint32_t r = random_bits();
        g.depth[i] = r % 8 == 0 ? 0.0f : r % 8 == 1 ? uniform(0.1f, 100) : 2.0f + 0.01f * (float)(r / 16 % 16);
        es_vec3 n = r % 3 ? es_v3(0.1f * uniform(-1, 1), 1, 0.1f * uniform(-1, 1)) : es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
        g.normal[i] = es_pack_normal(n);
        g.motion_x[i] = movement == STILL ? 0.0f : movement == PANNED ? pan_x : random_bits() % 9 ? uniform(-4, 4) : 65536.0f;
        g.motion_y[i] = movement == STILL ? 0.0f : movement == PANNED ? pan_y : random_bits() % 9 ? uniform(-4, 4) : -65536.0f;
    }
    return g;
}
static void free_gbuffer(es_gbuffer* g)
{
    free(g->depth);
    free(g->normal);
    free(g->motion_x);
    free(g->motion_y);
}

typedef struct setup { es_gbuffer now, then; plane source[6], history[6], reset; es_temporal_job job; } setup;

static void set_up(setup* s, uint32_t trial)
{
    const uint32_t width = trial % 4 ? 1 + random_bits() % 90 : 1 + random_bits() % 200, height = 1 + random_bits() % 70;
    const movement movement = (enum movement)(trial % 3);
    *s = (setup){.now = new_gbuffer(width, height, movement), .then = new_gbuffer(width, height, STILL)};
    const size_t count = (size_t)s->now.stride * height;
    for (size_t i = 0; i < count; i++) /* mostly the same surface as before */
        if (random_bits() % 4) {
            s->then.depth[i] = s->now.depth[i] > 0.0f ? 2.05f : 0.0f;
            s->then.normal[i] = es_pack_normal(es_v3(0, 1, 0.05f));
        }
    s->job = (es_temporal_job){.gbuffer = &s->now, .previous = &s->then, .moving = movement != STILL, .plane_count = trial % 2 ? 3 : 6, .base = uniform(0, 0.999f), .position = uniform(0, 3), .normal = uniform(0, 3),
        .illumination = uniform(0, 2), .lobe_turn = trial % 3 ? uniform(0, 20) : 0.0f, .extent = uniform(1, 10), .exposure_scale = uniform(0.1f, 4), .depth_threshold = 0.1f, .normal_threshold = 0.8f, .clamp = trial % 5 == 0 ? 0.25f : 0.0f, .reset_low = 0.1f, .reset_high = 0.5f,
        .depth_then = {{uniform(-0.01f, 0.01f), uniform(0, 1e-4f), uniform(0, 1e-4f)}, {1, uniform(0, 1e-4f), uniform(0, 1e-4f)}}};
    s->job.history_count = trial % 7 == 3 ? 0 : s->job.plane_count == 6 && trial % 4 ? 6 : 3;
    s->job.tile_columns = es_temporal_tiles(width);
    s->job.tile_rows = es_temporal_tiles(height);
    for (int k = 0; k < 6; k++) {
        s->source[k] = new_plane(count);
        s->history[k] = new_plane(count);
        for (size_t i = 0; i < count; i++) {
            at(s->source[k])[i] = random_bits() % 100 ? uniform(0, 3) : uniform(0, 1e30f);
            at(s->history[k])[i] = random_bits() % 100 ? uniform(0, 3) : 0.0f;
        }
        s->job.source[k] = at(s->source[k]);
        s->job.history[k] = at(s->history[k]);
    }
    s->reset = new_plane((size_t)s->job.tile_columns * s->job.tile_rows);
    for (size_t i = 0; i < s->reset.count; i++) at(s->reset)[i] = random_bits() % 2 ? uniform(0, 1) : 0.0f;
    s->job.reset = trial % 3 ? at(s->reset) : NULL;
}
static void tear_down(setup* s)
{
    for (int k = 0; k < 6; k++) {
        free(s->source[k].memory);
        free(s->history[k].memory);
    }
    free(s->reset.memory);
    free_gbuffer(&s->now);
    free_gbuffer(&s->then);
}

static void check_blend(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 90; trial++) {
        setup s;
        set_up(&s, trial);
        const size_t count = (size_t)s.now.stride * s.now.height;
        plane expected[7], result[7];
        for (int k = 0; k < 7; k++) {
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 6; k++) s.job.result[k] = at(to[k]);
            s.job.confidence = at(to[6]);
            es_gi_kernel_table((es_isa)isa)->temporal_blend(&s.job, 0, s.now.height);
            for (uint32_t k = 0; k < 7; k++) {
                check_guards(to[k]);
                if (k < 6 && k >= s.job.plane_count) continue;
                for (uint32_t y = 0; y < s.now.height; y++)
                    for (uint32_t x = 0; x < s.now.width; x++) {
                        const size_t i = (size_t)y * s.now.stride + x;
                        if (memcmp(&at(expected[k])[i], &at(to[k])[i], 4)) fail_msg("trial %u plane %u at (%u, %u): scalar %.9g, here %.9g", trial, k, x, y, (double)at(expected[k])[i], (double)at(to[k])[i]);
                    }
            }
        }
        for (int k = 0; k < 7; k++) {
            free(expected[k].memory);
            free(result[k].memory);
        }
        tear_down(&s);
    }
}

/* Where lobes are known to be dark, their planes are left alone: results are those of reading them, what is not written is zero there, and a
 * first frame, which has nothing to blend with, knows no more to be lit than its source. */
static void check_lit(void** state)
{
    (void)state;
    uint64_t dark = 0;
    for (uint32_t trial = 0; trial < 60; trial++) {
        setup s;
        set_up(&s, trial);
        s.job.plane_count = 6;
        s.job.history_count = trial % 5 ? 6 : 0;
        const uint32_t chunks = es_lit_chunks(s.now.stride), height = s.now.height;
        const size_t count = (size_t)s.now.stride * height, bytes = (size_t)chunks * height;
        uint8_t *lit = malloc(3 * bytes), *lit_then = lit + bytes, *lit_result = lit + 2 * bytes;
        for (size_t i = 0; i < bytes; i++) {
            lit[i] = random_bits() % 8 == 0;
            lit_then[i] = random_bits() % 64 == 0;
            lit_result[i] = random_bits() % 2;
        }
        plane expected[6], result[6];
        for (int k = 0; k < 6; k++) {
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
            for (size_t i = 0; i < count; i++) {
                const size_t chunk = i / s.now.stride * chunks + i % s.now.stride / ES_LIT_COLUMNS;
                if (k >= 3 && !lit[chunk]) at(s.source[k])[i] = 0.0f;
                if (k >= 3 && !lit_then[chunk]) at(s.history[k])[i] = 0.0f;
                at(result[k])[i] = k >= 3 && !lit_result[chunk] ? 0.0f : 1.0f;
            }
            s.job.result[k] = at(expected[k]);
        }
        es_gi_kernel_table(ES_ISA_SCALAR)->temporal_blend(&s.job, 0, height);
        for (int k = 0; k < 6; k++) s.job.result[k] = at(result[k]);
        s.job.source_lit = lit;
        s.job.history_lit = lit_then;
        s.job.result_lit = lit_result;
        es_gi_kernel_table(ES_ISA_SCALAR)->temporal_blend(&s.job, 0, height);
        for (uint32_t k = 0; k < 6; k++) {
            check_guards(result[k]);
            for (uint32_t y = 0; y < height; y++) {
                for (uint32_t x = 0; x < s.now.width; x++) {
                    const size_t i = (size_t)y * s.now.stride + x;
                    const bool known_dark = k >= 3 && !(lit_result[(size_t)y * chunks + x / ES_LIT_COLUMNS] & 1);
                    dark += known_dark;
                    if (at(expected[k])[i] != at(result[k])[i]) fail_msg("trial %u plane %u at (%u, %u): %.9g, with lit chunks %.9g", trial, k, x, y, (double)at(expected[k])[i], (double)at(result[k])[i]);
                    if (known_dark) assert_true(at(result[k])[i] == 0.0f);
                }
            }
        }
        if (!s.job.history_count) assert_memory_equal(lit, lit_result, bytes);
        for (int k = 0; k < 6; k++) {
            free(expected[k].memory);
            free(result[k].memory);
        }
        free(lit);
        tear_down(&s);
    }
    assert_true(dark > 10000);
}

static void check_compare(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 90; trial++) {
        setup s;
        set_up(&s, trial);
        if (!s.job.history_count) s.job.history_count = 3;
        plane expected = new_plane(s.job.tile_columns), result = new_plane(s.job.tile_columns);
        for (uint32_t row = 0; row < s.job.tile_rows; row++)
            for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
                if (!(es_isa_available_mask() >> isa & 1)) continue;
                plane to = isa == ES_ISA_SCALAR ? expected : result;
                es_gi_kernel_table((es_isa)isa)->temporal_compare(&s.job, row, at(to));
                check_guards(to);
                assert_memory_equal(at(expected), at(to), s.job.tile_columns * sizeof(float));
                for (uint32_t i = 0; i < s.job.tile_columns; i++) assert_true(at(to)[i] >= 0.0f && at(to)[i] <= 1.0f);
            }
        free(expected.memory);
        free(result.memory);
        tear_down(&s);
    }
}

/* ---- the equations, in double ---------------------------------------------------------------------------------------- */

typedef struct outcome { double confidence, value[6]; bool marginal; } outcome;

static double saturate(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

static double reset_at(const es_temporal_job* job, uint32_t x, uint32_t y)
{
    if (!job->reset) return 0;
    double u = (x + 0.5) / ES_TEMPORAL_TILE - 0.5, v = (y + 0.5) / ES_TEMPORAL_TILE - 0.5, sum = 0;
    for (int j = 0; j < 2; j++)
        for (int i = 0; i < 2; i++) {
            double c = floor(u) + i, r = floor(v) + j, w = (1 - fabs(u - c)) * (1 - fabs(v - r));
            c = c < 0 ? 0 : c > job->tile_columns - 1 ? job->tile_columns - 1 : c;
            r = r < 0 ? 0 : r > job->tile_rows - 1 ? job->tile_rows - 1 : r;
            sum += w * (double)job->reset[(size_t)r * job->tile_columns + (size_t)c];
        }
    return sum;
}

static outcome by_equations(const es_temporal_job* job, uint32_t x, uint32_t y)
{
    const es_gbuffer *g = job->gbuffer, *p = job->previous;
    const size_t i = (size_t)y * g->stride + x;
    outcome o = {0};
    for (uint32_t k = 0; k < job->plane_count; k++) o.value[k] = (double)job->source[k][i];
    const double d = (double)g->depth[i];
    if (!(d > 0) || !job->history_count) return o;
    const double mx = job->moving ? (double)g->motion_x[i] : 0, my = job->moving ? (double)g->motion_y[i] : 0, px = x - mx, py = y - my;
    const float *a = job->depth_then[0], *b = job->depth_then[1];
    const double expected = (double)a[0] + (double)a[1] * x + (double)a[2] * y + d * ((double)b[0] + (double)b[1] * x + (double)b[2] * y);
    const es_vec3 n = es_unpack_normal(g->normal[i]);
    double total = 0, depth = 0, dot = 0, old[6] = {0};
    for (int t = 0; t < 4; t++) {
        const double tx = floor(px) + (t & 1), ty = floor(py) + (t >> 1), w = (1 - fabs(px - tx)) * (1 - fabs(py - ty));
        if (tx < 0 || ty < 0 || tx >= g->width || ty >= g->height || w == 0) continue;
        const size_t from = (size_t)ty * g->stride + (size_t)tx;
        const es_vec3 m = es_unpack_normal(p->normal[from]);
        const double there = (double)p->depth[from], c = (double)n.x * (double)m.x + (double)n.y * (double)m.y + (double)n.z * (double)m.z;
        const double off = fabs(there - expected) - expected * (double)job->depth_threshold, turn = c - (double)job->normal_threshold;
        o.marginal |= fabs(off) < 1e-4 * d || fabs(turn) < 1e-5;
        if (!(there > 0) || off > 0 || turn < 0) continue;
        total += w;
        depth += w * there;
        dot += w * c;
        for (uint32_t k = 0; k < job->history_count; k++) old[k] += w * (double)job->history[k][from];
    }
    o.marginal |= fabs(total - 1e-3) < 1e-4;
    if (total <= 1e-3) return o;
    for (uint32_t k = 0; k < job->history_count; k++) old[k] /= total;
    const double dx = mx / g->width, dy = my / g->height, dz = (d - depth / total) / (double)job->extent;
    const double position = sqrt(dx * dx + dy * dy + dz * dz) * (double)job->position, normal = (1 - dot / total) * (double)job->normal;
    double squares = 0;
    for (uint32_t k = 0; k < 3; k++) {
        double e = ((double)job->source[k][i] - old[k]) * 0.318309886 + (job->history_count == 6 ? (double)job->source[k + 3][i] - old[k + 3] : 0);
        squares += pow(e * (double)job->exposure_scale, 2);
    }
    const double illumination = saturate(pow(squares, 1.5)) * (double)job->illumination;
    o.confidence = (double)job->base * saturate(1 - fmax(fmax(position, normal), illumination)) * (1 - reset_at(job, x, y));
    for (uint32_t k = 0; k < job->history_count; k++) {
        if (job->clamp > 0) {
            double low = 1e300, high = 0;
            for (int v = -1; v <= 1; v++)
                for (int u = -1; u <= 1; u++) {
                    int cx = (int)x + u, cy = (int)y + v;
                    cx = cx < 0 ? 0 : cx >= (int)g->width ? (int)g->width - 1 : cx;
                    cy = cy < 0 ? 0 : cy >= (int)g->height ? (int)g->height - 1 : cy;
                    low = fmin(low, (double)job->source[k][(size_t)cy * g->stride + (size_t)cx]);
                    high = fmax(high, (double)job->source[k][(size_t)cy * g->stride + (size_t)cx]);
                }
            old[k] = fmax(low * (1 - (double)job->clamp), fmin(high * (1 + (double)job->clamp), old[k]));
        }
        const double share = o.confidence * (k < 3 ? 1 : fmax(1 - (1 - dot / total) * (double)job->lobe_turn, 0));
        o.value[k] = old[k] * share + o.value[k] * (1 - share);
    }
    return o;
}

static void check_equations(void** state)
{
    (void)state;
    uint64_t compared = 0, blended = 0;
    for (uint32_t trial = 0; trial < 40; trial++) {
        setup s;
        set_up(&s, trial);
        const size_t count = (size_t)s.now.stride * s.now.height;
        plane result[7];
        for (int k = 0; k < 7; k++) {
            result[k] = new_plane(count);
            if (k < 6) s.job.result[k] = at(result[k]);
        }
        s.job.confidence = at(result[6]);
        es_gi_kernel_table(ES_ISA_SCALAR)->temporal_blend(&s.job, 0, s.now.height);
        for (uint32_t y = 0; y < s.now.height; y++)
            for (uint32_t x = 0; x < s.now.width; x++) {
                const size_t i = (size_t)y * s.now.stride + x;
                outcome o = by_equations(&s.job, x, y);
                if (o.marginal) continue;
                compared++;
                blended += o.confidence > 0.1;
                if (fabs((double)at(result[6])[i] - o.confidence) > 2e-4) fail_msg("trial %u confidence at (%u, %u): %.9g, by the equations %.9g", trial, x, y, (double)at(result[6])[i], o.confidence);
                for (uint32_t k = 0; k < s.job.plane_count; k++) {
                    const double value = (double)at(result[k])[i];
                    if (fabs(value - o.value[k]) > 1e-3 * (fabs(o.value[k]) + 1) + 2e-4 * fabs((double)s.job.source[k][i]))
                        fail_msg("trial %u plane %u at (%u, %u): %.9g, by the equations %.9g", trial, k, x, y, value, o.value[k]);
                }
            }
        for (int k = 0; k < 7; k++) free(result[k].memory);
        tear_down(&s);
    }
    assert_true(compared > 10000 && blended > 3000);
}

/* A tile whose light is as it was keeps its history; one whose light was switched does not; the share between is linear. */
static void check_reset(void** state)
{
    (void)state;
    enum { SIDE = 64 };
    setup s;
    set_up(&s, 0);
    es_gbuffer now = new_gbuffer(SIDE, SIDE, STILL);
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        now.depth[i] = 2;
        now.normal[i] = es_pack_normal(es_v3(0, 0, 1));
    }
    plane light = new_plane(SIDE * SIDE), was = new_plane(SIDE * SIDE);
    es_temporal_job job = {.gbuffer = &now, .previous = &now, .depth_then = {{0}, {1}}, .plane_count = 3, .history_count = 3, .depth_threshold = 0.1f, .normal_threshold = 0.8f, .reset_low = 0.2f, .reset_high = 0.6f, .tile_columns = 2, .tile_rows = 2};
    for (int k = 0; k < 3; k++) {
        job.source[k] = at(light);
        job.history[k] = at(was);
    }
    static const struct { float was, is, share; } cases[] = {{1, 1, 0}, {1, 0.85f, 0}, {1, 0.6f, 0.5f}, {0.6f, 1, 0.5f}, {1, 0, 1}, {0, 1, 1}, {0, 0, 0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        for (size_t i = 0; i < SIDE * SIDE; i++) {
            const bool left = i % SIDE < SIDE / 2;
            at(was)[i] = left ? cases[c].was : 1;
            at(light)[i] = left ? cases[c].is : 1;
        }
        float shares[2];
        es_gi_kernel_table(ES_ISA_SCALAR)->temporal_compare(&job, 1, shares);
        assert_true(fabsf(shares[0] - cases[c].share) < 1e-4f && shares[1] == 0.0f);
    }
    free(light.memory);
    free(was.memory);
    free_gbuffer(&now);
    tear_down(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_blend),
        cmocka_unit_test(check_lit),
        cmocka_unit_test(check_compare),
        cmocka_unit_test(check_equations),
        cmocka_unit_test(check_reset),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
