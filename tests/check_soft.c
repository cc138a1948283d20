/* The kernels of cloth and soft bodies: every instruction set against scalar, bit for bit, on random and extreme input, with guards round
 * what is written; and what they compute against doubles. */
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
#include "platform/random.h"
#include "sim/kernel_table.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(77, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

enum { SLOTS = 64, BATCHES = 12, GUARD = 16, FLOATS = 4 * SLOTS + 2 * GUARD };

/* what the kernels of one run write and read */
typedef struct scene {
    float x[FLOATS], previous[FLOATS], velocity[FLOATS], acceleration[FLOATS], ratio[8 * BATCHES + 2 * GUARD];
    es_soft_links links[BATCHES];
    es_soft_volumes volumes[BATCHES];
    uint32_t anchor[2][SLOTS];
    float reach[2][SLOTS], start[16], end[16], push[6], fastest;
} scene;

/* places: now and then one at zero, at another's, or far away */
static scene random_scene(int trial)
{
    scene s;
    memset(&s, 0xa5, sizeof s);
    const float size = trial % 4 == 3 ? 1e5f : 1;
    for (int i = 0; i < SLOTS; i++)
        for (int k = 0; k < 4; k++) {
            const int at = GUARD + 4 * i + k;
            s.x[at] = k < 3 ? random_bits() % 8 ? uniform(-size, size) : 0 : random_bits() % 6 ? uniform(0.1f, 100) : 0;
            s.previous[at] = k < 3 ? s.x[at] + uniform(-0.01f, 0.01f) : 0;
            s.velocity[at] = k < 3 ? uniform(-3, 3) * size : 0;
            s.acceleration[at] = k < 3 ? uniform(-10, 10) * size : 0;
        }
    for (int b = 0; b < BATCHES; b++) {
        uint32_t order[SLOTS]; /* no particle twice in a batch */
        for (uint32_t i = 0; i < SLOTS; i++) order[i] = i;
        for (uint32_t i = SLOTS - 1; i > 0; i--) {
            uint32_t j = random_bits() % (i + 1), o = order[i];
            order[i] = order[j];
            order[j] = o;
        }
        const uint32_t count = b % 3 ? 8 : 1 + random_bits() % 8;
        s.links[b].count = s.volumes[b].count = count;
        for (uint32_t lane = 0; lane < 8; lane++) {
            const uint32_t from = lane < count ? lane : 0;
            s.links[b].a[lane] = order[2 * from];
            s.links[b].b[lane] = order[2 * from + 1];
            s.links[b].rest[lane] = b % 5 ? uniform(0, 1) : 0;
            s.links[b].compliance[lane] = b % 2 ? 0 : uniform(0, 1);
            for (int i = 0; i < 4; i++) s.volumes[b].corner[i][lane] = order[16 + 4 * from + i];
            s.volumes[b].rest[lane] = uniform(-0.1f, 0.1f);
            s.volumes[b].floor[lane] = b % 5 ? uniform(0, 0.1f) : 0;
        }
    }
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < SLOTS; i++) {
            s.anchor[k][i] = random_bits() % 4;
            s.reach[k][i] = random_bits() % 4 ? uniform(0, 1) : random_bits() % 2 ? 0 : 1e15f;
        }
    for (int i = 0; i < 16; i++) {
        s.start[i] = uniform(-1, 1);
        s.end[i] = s.start[i] + uniform(-0.1f, 0.1f);
    }
    memset(s.push, 0, sizeof s.push);
    s.fastest = 0;
    return s;
}

static es_soft_surface surface_of(int trial)
{
    es_soft_surface surface = {.a = {0.1f, -0.2f, 0}, .radius = 0.7f, .friction = 0.3f, .centre = {0.1f, 0, 0}, .moved = {0.01f, 0, 0}, .turned = {0, 0.02f, 0}};
    if (trial % 2) {
        surface.along = (es_vec3){0.3f, 0.4f, 0};
        surface.inverse_length2 = 4;
    }
    return surface;
}

static void run_all(const es_sim_kernels* kernels, scene* s, int trial)
{
    es_soft_motion motion = {s->x + GUARD, s->previous + GUARD, s->velocity + GUARD, trial % 3 ? s->acceleration + GUARD : NULL, {0, -9.81f, 0.5f}, 1e-3f, 1e3f, 0.999f, 1000, trial % 2};
    const es_soft_reach reach = {{s->anchor[0], s->anchor[1]}, {s->reach[0], s->reach[1]}, s->start, s->end, 0.25f};
    const es_soft_surface surface = surface_of(trial);
    kernels->soft_move(&motion, 0, SLOTS);
    kernels->soft_reach(s->x + GUARD, &reach, 8, SLOTS);
    kernels->soft_links(s->x + GUARD, s->links, BATCHES, 1e2f);
    kernels->soft_volumes(s->x + GUARD, s->volumes, BATCHES, trial % 2 ? 0 : 0.1f);
    kernels->soft_contact(s->x + GUARD, s->previous + GUARD, &surface, 0, SLOTS - 8, s->push);
    kernels->soft_stretch(s->x + GUARD, s->links, BATCHES, s->ratio + GUARD);
    kernels->soft_settle(&motion, 0, SLOTS, &s->fastest);
}

static void same_bits(void** state)
{
    for (int trial = 0; trial < 200; trial++) {
        const scene original = random_scene(trial);
        scene expected = original;
        run_all(es_sim_kernel_table(ES_ISA_SCALAR), &expected, trial);
        for (int i = 0; i < FLOATS; i++) assert_true(isfinite(expected.x[i]) || (i < GUARD || i >= FLOATS - GUARD));
        assert_memory_equal(expected.x, original.x, GUARD * sizeof(float));
        assert_memory_equal(expected.x + FLOATS - GUARD, original.x + FLOATS - GUARD, GUARD * sizeof(float));
        assert_memory_equal(expected.ratio + 8 * BATCHES + GUARD, original.ratio + 8 * BATCHES + GUARD, GUARD * sizeof(float));
        for (int isa = 1; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            scene s = original;
            run_all(es_sim_kernel_table((es_isa)isa), &s, trial);
            if (memcmp(&s, &expected, sizeof s) != 0) fail_msg("%s, trial %d", es_isa_name((es_isa)isa), trial);
        }
    }
}

static double length_of(const scene* s, uint32_t a, uint32_t b)
{
    double squared = 0;
    for (int k = 0; k < 3; k++) squared += ((double)s->x[GUARD + 4 * a + k] - (double)s->x[GUARD + 4 * b + k]) * ((double)s->x[GUARD + 4 * a + k] - (double)s->x[GUARD + 4 * b + k]);
    return sqrt(squared);
}

/* One batch: a link without compliance has its rest length afterwards, and the centre of mass of its ends stays; with, XPBD's eq. 18. */
static void links(void** state)
{
    for (int trial = 0; trial < 50; trial++) {
        scene s = random_scene(0);
        const scene before = s;
        es_sim_kernel_table(ES_ISA_SCALAR)->soft_links(s.x + GUARD, s.links, 1, 100);
        for (uint32_t lane = 0; lane < before.links[0].count; lane++) {
            const uint32_t a = before.links[0].a[lane], b = before.links[0].b[lane];
            const double wa = (double)before.x[GUARD + 4 * a + 3], wb = (double)before.x[GUARD + 4 * b + 3], was = length_of(&before, a, b), rest = (double)before.links[0].rest[lane];
            if (wa + wb == 0 || was < 1e-3) continue;
            const double expected = was - (was - rest) * (wa + wb) / (wa + wb + (double)before.links[0].compliance[lane] * 100);
            if (!(fabs(length_of(&s, a, b) - fabs(expected)) < 6e-6)) fail_msg("was %g, wanted %g, is %g, weights %g %g, compliance %g", was, expected, length_of(&s, a, b), wa, wb, (double)before.links[0].compliance[lane]);
            for (int k = 0; k < 3 && wa > 0 && wb > 0; k++) {
                double shift = ((double)s.x[GUARD + 4 * a + k] - (double)before.x[GUARD + 4 * a + k]) / wa + ((double)s.x[GUARD + 4 * b + k] - (double)before.x[GUARD + 4 * b + k]) / wb;
                assert_true(fabs(shift) < 6e-6 / (wa < wb ? wa : wb));
            }
        }
    }
}

/* Sweeps over a tetrahedron bring its volume to what it should be, also from flat and from inside out. */
static void volumes(void** state)
{
    static const float heights[3] = {1, 0.02f, -0.5f};
    for (int trial = 0; trial < 3; trial++) {
        float x[64] = {0, 0, 0, 1, 1, 0, 0, 1, 0, 0, 1, 2, 0, heights[trial], 0, 1};
        es_soft_volumes batch = {.count = 1};
        for (int lane = 0; lane < 8; lane++) {
            for (uint32_t i = 0; i < 4; i++) batch.corner[i][lane] = (uint32_t[4]){0, 2, 1, 3}[i];
            batch.rest[lane] = 1.0f / 6;
            batch.floor[lane] = 0.01f;
        }
        for (int sweep = 0; sweep < 200; sweep++) es_sim_kernel_table(ES_ISA_SCALAR)->soft_volumes(x, &batch, 1, 0);
        double e[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) e[i][k] = (double)x[4 * (int[3]){2, 1, 3}[i] + k] - (double)x[k];
        double v = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) + e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
        if (!(fabs(v - 1) < 1e-4)) fail_msg("trial %d: six times the volume is %g", trial, v);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_bits), cmocka_unit_test(links), cmocka_unit_test(volumes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
