/* One tile of FLIP: every instruction set against scalar, bit for bit, on random pictures with the extremes of their range, with guards
 * round what is written. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "platform/random.h"

enum { GUARD = 64, WIDTH = 77, HEIGHT = 69 };
static uint32_t counter;
static float random_value(void)
{
    static const float extremes[] = {0, 1, 1e-45f, 1e-30f, 1e4f, 3.4e38f};
    uint32_t r = es_random_u32(31, counter++);
    return r % 16 < 6 ? extremes[r % 16] : es_unit_float(es_random_u32(32, counter++)) * (r % 16 == 7 ? 100.0f : 1.0f);
}

static float* random_plane(size_t count)
{
    float* plane = malloc(count * sizeof *plane);
    assert_non_null(plane);
    for (size_t i = 0; i < count; i++) plane[i] = random_value();
    return plane;
}

static es_flip_scratch new_scratch(uint32_t radius)
{
    uint32_t side = ES_FLIP_TILE + 2 * radius;
    es_flip_scratch s = {.rows = side, .stride = (side + 7) / 8 * 8 + 8};
    for (int c = 0; c < 3; c++) {
        s.row[c] = random_plane(s.stride);
        for (int picture = 0; picture < 2; picture++) s.rgb[picture][c] = random_plane((size_t)side * s.stride);
    }
    for (int k = 0; k < 7; k++)
        for (int picture = 0; picture < 2; picture++) s.filtered[picture][k] = random_plane((size_t)side * ES_FLIP_TILE);
    return s;
}

static void free_scratch(es_flip_scratch* s)
{
    for (int c = 0; c < 3; c++) {
        free(s->row[c]);
        for (int picture = 0; picture < 2; picture++) free(s->rgb[picture][c]);
    }
    for (int k = 0; k < 7; k++)
        for (int picture = 0; picture < 2; picture++) free(s->filtered[picture][k]);
}

static void random_weights(float* weights, uint32_t radius)
{
    for (uint32_t k = 0; k <= radius; k++) weights[k] = (es_unit_float(es_random_u32(33, counter++)) - 0.3f) / (float)(radius + 1);
}

static void test_tile(void** state)
{
    for (uint32_t radius = 1; radius <= ES_FLIP_MAX_RADIUS; radius += radius < 12 ? 3 : 17) {
        es_flip_filters f = {.radius = radius};
        float* weights[] = {f.achromatic, f.red_green, f.blue_yellow[0], f.blue_yellow[1], f.gauss, f.edge, f.point};
        for (int k = 0; k < 7; k++) random_weights(weights[k], radius);
        es_flip_scratch scratch = new_scratch(radius);
        static const float scales[] = {0x1p-20f, 1, 3.7f};
        for (int tone = ES_FLIP_LINEAR; tone <= ES_FLIP_ACES; tone++) {
            static uint32_t memory[ES_ISA_COUNT][WIDTH * HEIGHT + 2 * GUARD];
            for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
                if (!(es_isa_available_mask() >> isa & 1)) continue;
                for (size_t i = 0; i < WIDTH * HEIGHT + 2 * GUARD; i++) memory[isa][i] = 0xdeadbeef;
                es_flip_job job = {&f, WIDTH, HEIGHT, (es_flip_tone)tone, 4, scales, 3, (float*)(memory[isa] + GUARD)};
                for (uint32_t tile = 0; tile < 4; tile++) es_gi_kernel_table((es_isa)isa)->flip(&job, tile % 2 * ES_FLIP_TILE, tile / 2 * ES_FLIP_TILE, &scratch);
                for (size_t i = 0; i < GUARD; i++) assert_true(memory[isa][i] == 0xdeadbeef && memory[isa][GUARD + WIDTH * HEIGHT + i] == 0xdeadbeef);
                for (size_t i = 0; i < WIDTH * HEIGHT; i++) assert_true(job.errors[i] >= 0 && job.errors[i] <= 1);
                assert_memory_equal(memory[isa], memory[ES_ISA_SCALAR], sizeof memory[isa]);
            }
        }
        free_scratch(&scratch);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_tile)};
    return cmocka_run_group_tests_name("flip kernel", tests, NULL, NULL);
}
