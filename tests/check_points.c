/* Splatting into parabolic maps and pull-push: every instruction set against scalar, bit for bit, on random and extreme input, with
 * guards round what is written.
 *
 * check_points --time prints milliseconds per map of every kernel and instruction set instead. */
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
#include "raster/kernel_table.h"
#include "raster/points.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(23, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

enum { GUARD = 64 };
typedef struct texels { uint16_t* memory; size_t count; } texels;

static texels new_texels(size_t count)
{
    texels t = {malloc((count + 2 * GUARD) * 2), count};
    assert_non_null(t.memory);
    for (size_t i = 0; i < count + 2 * GUARD; i++) t.memory[i] = 0xbeef;
    return t;
}
static uint16_t* at(texels t) { return t.memory + GUARD; }
static void check_guards(texels t)
{
    for (size_t i = 0; i < GUARD; i++) {
        assert_int_equal(t.memory[i], 0xbeef);
        assert_int_equal(t.memory[GUARD + t.count + i], 0xbeef);
    }
}

static float wild(float scale)
{
    static const float odd[] = {0.0f, -0.0f, 1e30f, -1e30f, 3e38f, 1e-38f, 1e-45f, INFINITY, -INFINITY, NAN};
    uint32_t r = random_bits();
    return r % 32 == 0 ? odd[r / 32 % 10] : uniform(-scale, scale);
}

static es_parabolic_map random_map(uint32_t size)
{
    es_parabolic_map map = {.far_distance = uniform(0.5f, 8.0f), .near_distance = uniform(0.0f, 0.1f), .splat_width = uniform(0.0f, 0.4f), .size = size};
    es_vec3 n = es_v3_normalize(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), es_v3(0, 1, 0)), t, b;
    es_orthonormal_basis(n, &t, &b);
    memcpy(map.normal, &n, sizeof n);
    memcpy(map.tangent, &t, sizeof t);
    memcpy(map.bitangent, &b, sizeof b);
    for (int k = 0; k < 3; k++) map.position[k] = uniform(-1, 1);
    if (random_bits() % 8 == 0) map.position[random_bits() % 3] = wild(1.0f);
    if (random_bits() % 16 == 0) map.splat_width = wild(1.0f);
    map.parallel = random_bits() % 3 == 0;
    return map;
}

static void check_splat(void** state)
{
    (void)state;
    static const uint32_t sizes[] = {4, 5, 32, 100, 128, 256, 1024}, counts[] = {0, 1, 7, 8, 9, 511, 512, 513, 4101};
    for (uint32_t trial = 0; trial < 7 * 9; trial++) {
        uint32_t size = sizes[trial % 7], count = counts[trial / 7], padded = (count + 7) / 8 * 8;
        float* xyz[3];
        for (int k = 0; k < 3; k++) {
            xyz[k] = malloc(padded * sizeof(float) + 4);
            for (uint32_t i = 0; i < padded; i++) xyz[k][i] = trial % 3 ? uniform(-3, 3) : wild(3.0f);
        }
        es_point_set points = {xyz[0], xyz[1], xyz[2], count};
        es_parabolic_map map = random_map(size);
        texels expected = new_texels(es_splat_texels(size)), result = new_texels(es_splat_texels(size)), before = new_texels(es_splat_texels(size));
        for (size_t i = 0; i < before.count; i++) at(before)[i] = random_bits() % 4 ? ES_PARABOLIC_EMPTY : (uint16_t)random_bits();
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            texels to = isa == ES_ISA_SCALAR ? expected : result;
            memcpy(at(to), at(before), before.count * 2);
            es_raster_kernels_of((es_isa)isa)->splat_parabolic_map(&map, &points, at(to));
            check_guards(to);
            assert_memory_equal(at(expected), at(to), expected.count * 2);
            /* the slack keeps what it held */
            assert_memory_equal(at(before) + (size_t)size * size, at(to) + (size_t)size * size, (before.count - (size_t)size * size) * 2);
        }
        for (int k = 0; k < 3; k++) free(xyz[k]);
        free(expected.memory);
        free(result.memory);
        free(before.memory);
    }
}

static void check_pull_push(void** state)
{
    (void)state;
    static const uint32_t sizes[] = {32, 64, 96, 128, 256};
    for (uint32_t trial = 0; trial < 80; trial++) {
        es_pull_push_parameters p = {.size = sizes[trial % 5], .levels = 1 + trial / 5 % 4, .pull = random_bits() % 6000, .push = random_bits() % 6000};
        if (trial % 7 == 0) p.pull = random_bits();
        if (trial % 11 == 0) p.push = 0;
        const size_t count = (size_t)p.size * p.size;
        texels work = new_texels(count), expected = new_texels(count), result = new_texels(count), scratch = new_texels(es_pull_push_texels(p.size)), before = new_texels(count);
        const uint32_t holes = 1 + trial % 9, spread = trial % 2 ? 3000 : 49152;
        for (size_t i = 0; i < count; i++) at(before)[i] = random_bits() % 10 < holes ? ES_PARABOLIC_EMPTY : (uint16_t)(random_bits() % spread);
        /* words that are no depths may come out as anything, but as the same everywhere */
        if (trial % 13 == 12)
            for (size_t i = 0; i < count; i++) at(before)[i] = (uint16_t)random_bits();
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            texels to = isa == ES_ISA_SCALAR ? expected : result;
            memcpy(at(work), at(before), count * 2);
            es_raster_kernels_of((es_isa)isa)->pull_push(&p, at(work), at(scratch), at(to));
            check_guards(to);
            check_guards(scratch);
            assert_memory_equal(at(work), at(before), count * 2);
            assert_memory_equal(at(expected), at(to), count * 2);
        }
        free(work.memory);
        free(expected.memory);
        free(result.memory);
        free(scratch.memory);
        free(before.memory);
    }
}

static void time_all(void)
{
    enum { COUNT = 8192, REPEAT = 200, SIZE = 128 };
    float* xyz[3];
    for (int k = 0; k < 3; k++) {
        xyz[k] = malloc(COUNT * sizeof(float));
        for (int i = 0; i < COUNT; i++) xyz[k][i] = uniform(-2, 2);
    }
    es_point_set points = {xyz[0], xyz[1], xyz[2], COUNT};
    es_parabolic_map map = {.position = {0, -2, 0}, .tangent = {1, 0, 0}, .bitangent = {0, 0, -1}, .normal = {0, 1, 0}, .far_distance = 7, .near_distance = 0.01f, .splat_width = 0.1f, .size = SIZE};
    es_pull_push_parameters fill = {SIZE, 2, 2457, 2457};
    uint16_t *work = malloc(es_splat_texels(SIZE) * 2), *scratch = malloc(es_pull_push_texels(SIZE) * 2), *out = malloc(SIZE * SIZE * 2);
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        const es_raster_kernels* kernels = es_raster_kernels_of((es_isa)isa);
        memset(work, 0xff, es_splat_texels(SIZE) * 2);
        double begin = es_seconds();
        for (int i = 0; i < REPEAT; i++) kernels->splat_parabolic_map(&map, &points, work);
        double middle = es_seconds();
        for (int i = 0; i < REPEAT; i++) kernels->pull_push(&fill, work, scratch, out);
        double end = es_seconds();
        printf("%-7s splat of %d points %7.4f ms   pull-push of %d x %d %7.4f ms\n", es_isa_name((es_isa)isa), COUNT, (middle - begin) / REPEAT * 1e3, SIZE, SIZE, (end - middle) / REPEAT * 1e3);
    }
    for (int k = 0; k < 3; k++) free(xyz[k]);
    free(work);
    free(scratch);
    free(out);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_splat),
        cmocka_unit_test(check_pull_push),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
