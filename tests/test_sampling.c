/* Where virtual point lights go: hierarchical warping against its probabilities, and the Halton points that drive it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/vpl_sampling.h"
#include "platform/random.h"
#include "tests/statistics.h"

enum { SIZE = 16, LEVELS = 5, FACES = 6, TEXELS = SIZE * SIZE };

static float sums[FACES][TEXELS * 4 / 3 + 1];

/* level l holds SIZE >> l texels a side */
static es_importance importance_of(uint32_t faces, float (*value)(uint32_t face, uint32_t x, uint32_t y))
{
    es_importance importance = {.size = SIZE, .level_count = LEVELS, .face_count = faces, .face_floats = sizeof sums[0] / sizeof(float), .sums = sums[0]};
    for (uint32_t l = 1; l < LEVELS; l++) importance.level_offset[l] = importance.level_offset[l - 1] + (size_t)(SIZE >> (l - 1)) * (SIZE >> (l - 1));
    for (uint32_t f = 0; f < faces; f++) {
        for (uint32_t i = 0; i < TEXELS; i++) sums[f][i] = value(f, i % SIZE, i / SIZE);
        for (uint32_t l = 1; l < LEVELS; l++) {
            uint32_t size = SIZE >> l;
            const float* fine = sums[f] + importance.level_offset[l - 1];
            for (uint32_t i = 0; i < size * size; i++) {
                const float* p = fine + (size_t)(i / size) * 4 * size + i % size * 2;
                sums[f][importance.level_offset[l] + i] = p[0] + p[1] + p[2 * size] + p[2 * size + 1];
            }
        }
    }
    return importance;
}

static float steep(uint32_t face, uint32_t x, uint32_t y) { return (float)(face + 1) * (float)((x + 1) * (x + 1)) * (y < 3 ? 0.0f : (float)(y + 1)); }
static float scattered(uint32_t face, uint32_t x, uint32_t y) { return es_random_u32(5, (face * SIZE + y) * SIZE + x) % 4 ? 0.0f : es_random_float(6, (face * SIZE + y) * SIZE + x); }
static float level(uint32_t face, uint32_t x, uint32_t y) { return 2.0f; }
static float one_face(uint32_t face, uint32_t x, uint32_t y) { return face == 3 ? (float)(x + y) : 0.0f; }

static const struct { uint32_t faces; float (*value)(uint32_t, uint32_t, uint32_t); } cases[] = {{1, steep}, {1, scattered}, {1, level}, {6, steep}, {6, scattered}, {6, one_face}};

/* With random points chi-square tells; with Halton points the counts scatter less than random ones would. */
static void test_warp(void** state)
{
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++)
        for (int halton = 0; halton < 2; halton++) {
            enum { SAMPLES = 60000 };
            es_importance importance = importance_of(cases[k].faces, cases[k].value);
            static double cells[FACES * TEXELS][2];
            double total = 0;
            for (uint32_t f = 0; f < cases[k].faces; f++)
                for (uint32_t i = 0; i < TEXELS; i++) total += (double)sums[f][i];
            int count = (int)(cases[k].faces * TEXELS);
            for (int i = 0; i < count; i++) {
                cells[i][0] = SAMPLES * (double)sums[i / TEXELS][i % TEXELS] / total;
                cells[i][1] = 0;
            }
            for (uint32_t i = 0; i < SAMPLES; i++) {
                uint32_t face, x, y;
                float probability, u = halton ? es_halton(0, i + 1) : es_random_float(11, 2 * i), v = halton ? es_halton(1, i + 1) : es_random_float(11, 2 * i + 1);
                assert_true(es_importance_warp(&importance, u, v, &face, &x, &y, &probability));
                assert_true(face < cases[k].faces && x < SIZE && y < SIZE);
                double expected = (double)sums[face][y * SIZE + x] / total;
                assert_true(expected > 0 && fabs((double)probability - expected) < 1e-6 * expected);
                cells[face * TEXELS + y * SIZE + x][1]++;
            }
            for (int i = 0; i < count; i++) assert_true(cells[i][0] > 0 || cells[i][1] == 0);
            int degrees;
            double deviate = chi_square_deviate(cells, count, &degrees);
            /* 1 % over the twelve runs */
            if (!(deviate < 3.2)) fail_msg("case %zu, %s points: chi-square %.2f deviations too large, %d degrees of freedom", k, halton ? "Halton" : "random", deviate, degrees);
            if (halton && !(deviate < -3)) fail_msg("case %zu: Halton points scatter like random ones (%.2f, %d degrees of freedom)", k, deviate, degrees);
        }
}

/* The first b1^i b2^j points of two dimensions put exactly one into each of as many boxes. */
static void test_halton_boxes(void** state)
{
    static const uint32_t bases[] = {2, 3, 5, 7};
    for (uint32_t a = 0; a < 4; a++)
        for (uint32_t b = a + 1; b < 4; b++) {
            uint32_t m = bases[a] * bases[a] * bases[a], n = bases[b] * bases[b];
            uint8_t hit[343 * 49] = {0};
            for (uint32_t i = 0; i < m * n; i++) {
                /* radical inverses of i are multiples of 1 / m only up to rounding: take the middle of the digits that follow */
                uint32_t x = (uint32_t)(es_halton(a, i) * (float)m + 1e-4f), y = (uint32_t)(es_halton(b, i) * (float)n + 1e-4f);
                assert_true(x < m && y < n);
                assert_int_equal(hit[x * n + y]++, 0);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_warp),
        cmocka_unit_test(test_halton_boxes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
