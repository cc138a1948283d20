/* The resolve of anti-aliasing: every instruction set against scalar, bit for bit, on random pictures of odd sizes, any split into rows, with guards
 * round what is written; and scalar against the definition in double, pixel by pixel (gi/antialias.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "platform/random.h"
#include "tests/guarded_planes.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(47, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

typedef struct setup { es_gbuffer g; plane motion_x, motion_y, surface, source[3], history[3]; es_antialias_job job; } setup;

static void set_up(setup* out, uint32_t trial)
{
    const uint32_t width = trial % 3 ? 1 + random_bits() % 60 : 100 + random_bits() % 200, height = 1 + random_bits() % 40;
    setup s = {.g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8}};
    const size_t count = (size_t)s.g.stride * height;
    s.motion_x = new_plane(count);
    s.motion_y = new_plane(count);
    s.surface = new_plane(count);
    s.g.motion_x = at(s.motion_x);
    s.g.motion_y = at(s.motion_y);
    s.g.surface = s.surface.memory + GUARD;
    const float pan_x = uniform(-3, 3), pan_y = uniform(-3, 3);
    for (size_t i = 0; i < count; i++) {
        const bool rests = random_bits() % 4 == 0 && trial % 2;
        s.g.motion_x[i] = rests ? 0.0f : trial % 2 ? uniform(-4, 4) : pan_x;
        s.g.motion_y[i] = rests ? 0.0f : trial % 2 ? uniform(-4, 4) : pan_y;
        s.g.surface[i] = random_bits() % 3 ? 200 : 10;
    }
    s.job = (es_antialias_job){.moving = trial % 4 != 0, .clamp = trial % 5 != 0, .blend = uniform(0.05f, 0.5f), .exposure_scale = uniform(0.2f, 4)};
    for (int k = 0; k < 3; k++) {
        s.source[k] = new_plane(count);
        s.history[k] = new_plane(count);
        for (size_t i = 0; i < count; i++) {
            at(s.source[k])[i] = random_bits() % 50 ? uniform(0, 3) : random_bits() % 2 ? -1.0f : 1e4f;
            at(s.history[k])[i] = uniform(0, 3);
        }
        s.job.source[k] = at(s.source[k]);
        s.job.history[k] = at(s.history[k]);
    }
    *out = s;
    out->job.gbuffer = &out->g;
}
static void tear_down(setup* s)
{
    free(s->motion_x.memory);
    free(s->motion_y.memory);
    free(s->surface.memory);
    for (int k = 0; k < 3; k++) {
        free(s->source[k].memory);
        free(s->history[k].memory);
    }
}

static void resolve(setup* s, es_isa isa, uint32_t rows, plane result[3])
{
    for (int k = 0; k < 3; k++) {
        result[k] = new_plane(s->source[k].count);
        s->job.result[k] = at(result[k]);
    }
    for (uint32_t y = 0; y < s->g.height; y += rows) es_gi_kernel_table(isa)->antialias(&s->job, y, y + rows < s->g.height ? y + rows : s->g.height);
    for (int k = 0; k < 3; k++) check_guards(result[k]);
}
static void free_planes(plane planes[3])
{
    for (int k = 0; k < 3; k++) free(planes[k].memory);
}

static void check_bits(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 60; trial++) {
        setup s;
        set_up(&s, trial);
        plane expected[3], result[3];
        resolve(&s, ES_ISA_SCALAR, s.g.height, expected);
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            resolve(&s, (es_isa)isa, 1 + random_bits() % 9, result);
            for (int k = 0; k < 3; k++)
                for (uint32_t y = 0; y < s.g.height; y++) assert_memory_equal(at(expected[k]) + (size_t)y * s.g.stride, at(result[k]) + (size_t)y * s.g.stride, s.g.width * sizeof(float));
            free_planes(result);
        }
        free_planes(expected);
        tear_down(&s);
    }
}

static double luminance(const double* c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }
static uint32_t inside(double x, uint32_t count) { return x < 0 ? 0 : x > count - 1 ? count - 1 : (uint32_t)x; }

static void shown_at(const es_antialias_job* job, const float* const planes[3], double x, double y, double c[3])
{
    const es_gbuffer* g = job->gbuffer;
    const size_t i = (size_t)inside(y, g->height) * g->stride + inside(x, g->width);
    for (int k = 0; k < 3; k++) c[k] = fmax((double)planes[k][i], 0);
    const double share = 1 / (1 + luminance(c) * (double)job->exposure_scale);
    for (int k = 0; k < 3; k++) c[k] *= share;
}

static void by_definition(const es_antialias_job* job, uint32_t x, uint32_t y, double result[3])
{
    const es_gbuffer* g = job->gbuffer;
    const size_t i = (size_t)y * g->stride + x;
    double here[3], old[3] = {0}, low[3], high[3], mixed[3], share = (double)job->blend;
    shown_at(job, job->source, x, y, here);
    const double mx = job->moving ? (double)g->motion_x[i] : 0, my = job->moving ? (double)g->motion_y[i] : 0, px = x - mx, py = y - my;
    for (int t = 0; t < 4; t++) {
        const double tx = floor(px) + (t & 1), ty = floor(py) + (t >> 1), weight = (1 - fabs(px - tx)) * (1 - fabs(py - ty));
        double tap[3];
        shown_at(job, job->history, tx, ty, tap);
        for (int k = 0; k < 3; k++) old[k] += weight * tap[k];
    }
    if ((mx != 0 || my != 0) && (g->surface[i] & 0xff) > 63) share = fmax(share, 0.4);
    if (px <= -0.5 || py <= -0.5 || px >= g->width - 0.5 || py >= g->height - 0.5) share = 1;
    memcpy(low, here, sizeof low);
    memcpy(high, here, sizeof high);
    for (int v = -1; v <= 1; v++)
        for (int u = -1; u <= 1; u++) {
            double c[3];
            shown_at(job, job->source, (double)x + u, (double)y + v, c);
            for (int k = 0; k < 3; k++) {
                low[k] = fmin(low[k], c[k]);
                high[k] = fmax(high[k], c[k]);
            }
        }
    for (int k = 0; k < 3; k++) {
        if (job->clamp) old[k] = fmin(fmax(old[k], low[k]), high[k]);
        mixed[k] = old[k] + share * (here[k] - old[k]);
    }
    const double brightness = 1 / (1 - luminance(mixed) * (double)job->exposure_scale);
    for (int k = 0; k < 3; k++) result[k] = mixed[k] * brightness;
}

static void check_definition(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 40; trial++) {
        setup s;
        set_up(&s, trial);
        plane result[3];
        resolve(&s, ES_ISA_SCALAR, s.g.height, result);
        for (uint32_t y = 0; y < s.g.height; y++)
            for (uint32_t x = 0; x < s.g.width; x++) {
                double expected[3];
                by_definition(&s.job, x, y, expected);
                /* places 200 pixels from the left are good to 1.5e-5 of a pixel; what a display shows of 1e4 is so close to its most that little of a float's precision is left of it */
                const double bright = 1 + luminance(expected) * (double)s.job.exposure_scale;
                for (int k = 0; k < 3; k++) {
                    const double value = (double)at(result[k])[(size_t)y * s.g.stride + x];
                    if (fabs(value - expected[k]) > 3e-5 * bright * (1 + expected[k])) fail_msg("trial %u at (%u, %u): %.9g, by the definition %.9g", trial, x, y, value, expected[k]);
                }
            }
        free_planes(result);
        tear_down(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_bits), cmocka_unit_test(check_definition)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
