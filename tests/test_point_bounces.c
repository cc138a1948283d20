/* Further bounces at the points of micro-buffers: the inner level and what is pushed down from it, virtual point lights. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/micro/point_vpls.h"
#include "platform/random.h"
#include "raster/points.h"
#include "tests/hand_forest.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

static const double pi = 3.14159265358979324;
static es_lobe_albedo lobes;
static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_random_float(71, counter++); }

static es_context* open_context(uint32_t threads, uint32_t isa_mask)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    lobes = es_lobe_albedos;
    return context;
}

/* Leaves all over the faces of cubes, one for each tree, along the faces; of any surface. */
static es_point_forest cubes(const uint32_t* counts, uint32_t trees, bool diffuse)
{
    es_point_forest f = hand_forest(counts, trees);
    for (uint32_t t = 0; t < trees; t++)
        for (uint32_t i = 0; i < counts[t]; i++) {
            const uint32_t face = counts[t] >= 6 ? i * 6 / counts[t] : i % 6;
            const float u = uniform(-1, 1), v = uniform(-1, 1), w = face % 2 ? 1.0f : -1.0f;
            const es_vec3 p = face / 2 == 0 ? es_v3(w, u, v) : face / 2 == 1 ? es_v3(u, w, v) : es_v3(u, v, w), n = face / 2 == 0 ? es_v3(w, 0, 0) : face / 2 == 1 ? es_v3(0, w, 0) : es_v3(0, 0, w);
            const uint32_t model = diffuse ? ES_SURFACE_METALLIC_ROUGHNESS : es_random_u32(71, counter++) % 3;
            const float base = uniform(0.2f, 1), metallic = uniform(-1, 1), roughness = uniform(0, 1), specular = uniform(-1, 1);
            set_leaf(&f, f.trees[t].first_leaf + i, es_v3_add(p, es_v3(3 * (float)t, 0, 0)), n, model, base, diffuse || metallic < 0 ? 0 : metallic, diffuse ? 1 : roughness, diffuse || specular < 0 ? 0 : specular);
        }
    return f;
}

/* ---- the level and the push ---------------------------------------------------------------------------------------------------- */

static void test_level(void** state)
{
    (void)state;
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    static const uint32_t counts[] = {1, 256, 2, 4096, 4, 64, 1, 1024};
    es_point_forest f = cubes(counts, 8, false);
    for (uint32_t depth = 0; depth <= 14; depth++) {
        es_point_level level;
        es_arena_reset(&arena);
        assert_int_equal(es_point_level_make(&arena, &f, depth, &level), ES_OK);
        assert_true(level.count <= (2u << depth) + f.tree_count);
        assert_true(level.count >= (depth < 12 ? (1u << depth) / 2 : f.leaf_count / 4));
        assert_int_equal(level.first[0], 0);
        assert_int_equal(level.first[f.tree_count], level.count);
        for (uint32_t t = 0; t < f.tree_count; t++) {
            const uint32_t n = level.first[t + 1] - level.first[t], run = f.trees[t].leaf_count / n;
            assert_true(n && !(n & (n - 1)) && n <= f.trees[t].leaf_count);
            for (uint32_t i = 0; i < n; i++) {
                const uint32_t s = level.first[t] + i, leaf = level.leaf[s];
                assert_true(leaf >= f.trees[t].first_leaf + i * run && leaf < f.trees[t].first_leaf + (i + 1) * run);
                assert_true(level.x[s] == f.x[leaf] && level.y[s] == f.y[leaf] && level.z[s] == f.z[leaf] && level.softening[s] > 0);
                /* a sample's leaf is its own; others belong to one of their group */
                const uint32_t owner = es_point_level_owner(&level, &f, t, leaf);
                assert_true(owner / 16 == s / 16 || n < ES_LEVEL_GROUP);
                assert_true(level.x[owner] == level.x[s] || n > 1);
            }
        }
    }
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* What is the same everywhere stays so; what differs stays between its group's least and most; areas cancel. */
static void test_push(void** state)
{
    (void)state;
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    static const uint32_t counts[] = {1, 256, 2, 4096, 4, 64, 1, 1024};
    es_point_forest f = cubes(counts, 8, false);
    es_point_level level;
    assert_int_equal(es_point_level_make(&arena, &f, 9, &level), ES_OK);
    es_point_push push = {.level = &level, .lobes = &lobes};
    assert_int_equal(es_point_level_values(&arena, &level, push.values), ES_OK);
    float* areas = es_arena_allocate(&arena, ((size_t)level.count + 8) * sizeof(float));
    for (int with_areas = 0; with_areas < 2; with_areas++) {
        for (uint32_t s = 0; s < level.count; s++) {
            areas[s] = with_areas ? uniform(0.01f, 3) : 1;
            for (int k = 0; k < 3; k++) push.values[k][s] = (float)(k + 1) * areas[s];
        }
        push.areas = with_areas ? areas : NULL;
        for (size_t i = 0; i < f.node_count; i++)
            for (int k = 0; k < 3; k++) f.radiance[k][i] = (float)k;
        es_points_push(context, &f, &push);
        for (size_t i = 0; i < f.leaf_count; i++) {
            const es_surface s = es_surface_of_gbuffer(f.albedo_rg[i], f.albedo_b[i], f.surface[i]);
            const es_vec3 albedo = es_surface_albedo(&lobes, &s);
            for (int k = 0; k < 3; k++) {
                const double expected = k + (k + 1) * (double)(&albedo.x)[k] / pi;
                if (!(fabs((double)leaf_radiance(&f, i, k) - expected) <= 3e-6 * expected)) fail_msg("leaf %zu: %.7g, expected %.7g", i, (double)leaf_radiance(&f, i, k), expected);
            }
        }
    }
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* Six faces, each of which has another value: leaves have their own face's, although their groups reach over edges. */
static void test_push_respects_normals(void** state)
{
    (void)state;
    es_context* context = open_context(1, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    es_point_forest f = cubes(&(uint32_t){1024}, 1, true);
    es_point_level level;
    assert_int_equal(es_point_level_make(&arena, &f, 6, &level), ES_OK);
    assert_int_equal(level.count, 64);
    es_point_push push = {.level = &level, .lobes = &lobes};
    assert_int_equal(es_point_level_values(&arena, &level, push.values), ES_OK);
    for (uint32_t s = 0; s < level.count; s++)
        for (int k = 0; k < 3; k++) push.values[k][s] = (k == 0 ? level.nx[s] : k == 1 ? level.ny[s] : level.nz[s]) > 0.5f ? 1 : 0;
    es_points_push(context, &f, &push);
    for (size_t i = 0; i < f.leaf_count; i++) {
        const es_vec3 n = es_unpack_normal(f.normal[i]);
        const float albedo = es_unpack_unorm16(f.albedo_b[i]);
        for (int k = 0; k < 3; k++) {
            const double expected = (&n.x)[k] > 0.5f ? (double)albedo / pi : 0;
            if (!(fabs((double)leaf_radiance(&f, i, k) - expected) < 0.02 * (double)albedo / pi)) fail_msg("leaf %zu: %g, expected %g", i, (double)leaf_radiance(&f, i, k), expected);
        }
    }
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* ---- virtual point lights --------------------------------------------------------------------------------------------------------- */

static es_vpl_record vpl_at(es_vec3 position, es_vec3 normal, float flux)
{
    es_vpl_record v = {.area = 0.5f, .roughness = 1, .model = ES_SURFACE_METALLIC_ROUGHNESS};
    es_vec3 n = es_v3_normalize(normal, normal), t, b;
    es_orthonormal_basis(n, &t, &b);
    memcpy(v.position, &position, sizeof v.position);
    memcpy(v.normal, &n, sizeof v.normal);
    memcpy(v.tangent, &t, sizeof v.tangent);
    memcpy(v.bitangent, &b, sizeof v.bitangent);
    memcpy(v.incident, &n, sizeof v.incident);
    for (int k = 0; k < 3; k++) v.flux[k] = v.power[k] = flux * (float)(k + 1);
    return v;
}

/* Trees of one leaf each are lit at the leaf itself: flux / pi cos cos / (r² + spread A / pi), bounded, unless the light's map has something nearer. */
static void test_vpls(void** state)
{
    (void)state;
    enum { TREES = 300, VPLS = 9, SIZE = 32 };
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    uint32_t ones[TREES];
    for (int i = 0; i < TREES; i++) ones[i] = 1;
    es_point_forest f = cubes(ones, TREES, true);
    for (size_t i = 0; i < TREES; i++) f.x[i] = 0.01f * (float)i - 1.5f;
    es_vpl_record vpls[VPLS];
    for (int v = 0; v < VPLS; v++) vpls[v] = vpl_at(es_v3(uniform(-3, 3), uniform(1.5f, 3), uniform(-3, 3)), es_v3(uniform(-1, 1), uniform(-2, 0.2f), uniform(-1, 1)), uniform(0.1f, 2));
    uint16_t* maps = calloc((size_t)VPLS * SIZE * SIZE + 2, sizeof *maps);
    /* the last light but one is walled in, and the very last is dark; everything is seen by the others */
    for (size_t i = 0; i < (size_t)VPLS * SIZE * SIZE; i++) maps[i] = i / (SIZE * SIZE) == VPLS - 2 ? 100 : ES_PARABOLIC_EMPTY;
    for (int shadowed = 0; shadowed < 2; shadowed++) {
        const float spread = shadowed ? 0.7f : 0, bound = shadowed ? 1e6f : 0.05f;
        es_shade_job job = {.vpls = vpls, .vpl_count = VPLS, .dark_count = 1, .maps = shadowed ? maps : NULL, .map_size = SIZE, .far_distance = 20, .bias = 0.01f, .spread = spread, .geometry_bound = bound};
        for (size_t i = 0; i < f.node_count; i++)
            for (int k = 0; k < 3; k++) f.radiance[k][i] = 0.25f;
        es_arena_reset(&arena);
        assert_int_equal(es_points_light_vpls(context, &arena, &f, &job, 4, &lobes), ES_OK);
        bool bounded = false;
        for (size_t i = 0; i < TREES; i++) {
            double e = 0;
            const es_vec3 n = es_unpack_normal(f.normal[i]);
            for (int v = 0; v < VPLS - 1 - shadowed; v++) {
                const es_vec3 d = es_v3_sub(es_v3(f.x[i], f.y[i], f.z[i]), es_v3(vpls[v].position[0], vpls[v].position[1], vpls[v].position[2])), m = es_v3(vpls[v].normal[0], vpls[v].normal[1], vpls[v].normal[2]);
                const double sent = (double)es_v3_dot(d, m), received = -(double)es_v3_dot(d, n), r2 = (double)es_v3_dot(d, d), g = sent * received / (r2 * (r2 + (double)spread * 0.5 / pi));
                if (sent > 0 && received > 0) {
                    e += (double)vpls[v].flux[0] / pi * fmin(g, (double)bound);
                    bounded |= g > (double)bound;
                }
            }
            for (int k = 0; k < 3; k++) {
                const double expected = 0.25 + e * (k + 1) * (double)es_unpack_unorm16(f.albedo_b[i]) / pi;
                if (!(fabs((double)leaf_radiance(&f, i, k) - expected) <= 1e-5 * expected)) fail_msg("leaf %zu: %.7g, expected %.7g", i, (double)leaf_radiance(&f, i, k), expected);
            }
        }
        assert_true(bounded == !shadowed);
    }
    free(maps);
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* Found at one leaf of 64: a floor under a light is lit as smoothly as it should be. */
static void test_vpls_between_samples(void** state)
{
    (void)state;
    enum { BITS = 7, LEAVES = 1 << 2 * BITS };
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    es_point_forest f = hand_forest(&(uint32_t){LEAVES}, 1);
    for (uint32_t i = 0; i < LEAVES; i++) {
        uint32_t x = 0, z = 0;
        for (uint32_t b = 0; b < BITS; b++) x |= (i >> 2 * b & 1) << b, z |= (i >> (2 * b + 1) & 1) << b;
        set_leaf(&f, i, es_v3(-2 + 4 * (float)x / (1 << BITS), 0, -2 + 4 * (float)z / (1 << BITS)), es_v3(0, 1, 0), ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 1, 0);
    }
    const es_vpl_record vpl = vpl_at(es_v3(0.3f, 1.5f, 0.2f), es_v3(0, -1, 0), 10);
    es_shade_job job = {.vpls = &vpl, .vpl_count = 1, .geometry_bound = 1e6f};
    assert_int_equal(es_points_light_vpls(context, &arena, &f, &job, 2 * BITS - 6, &lobes), ES_OK);
    double squares = 0, mean = 0, worst = 0, sums[2] = {0, 0};
    for (uint32_t i = 0; i < LEAVES; i++) {
        const double dx = (double)f.x[i] - 0.3, dz = (double)f.z[i] - 0.2, r2 = dx * dx + dz * dz + 2.25, expected = 10 / pi / pi * 2.25 / (r2 * r2), found = (double)leaf_radiance(&f, i, 0);
        squares += (found - expected) * (found - expected) / LEAVES;
        mean += expected / LEAVES;
        worst = fmax(worst, fabs(found - expected));
        sums[0] += found;
        sums[1] += expected;
    }
    printf("interpolated: relRMSE %.4f, largest error %.4f of the mean\n", sqrt(squares) / mean, worst / mean);
    /* the light's slope is at most 1.04 of its peak for each 1.5 m; a leaf is 0.18 m or less from the sample of its run, and those 0.25 m further away weigh
     * a tenth or so together */
    assert_true(worst < 1.04 * (0.18 + 0.1 * 0.25) / 1.5 * (10 / pi / pi / 2.25));
    assert_true(sqrt(squares) < 0.08 * mean);
    assert_true(fabs(sums[0] / sums[1] - 1) < 0.02);
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* ---- the same bits ------------------------------------------------------------------------------------------------------------------ */

static void test_same_bits(void** state)
{
    (void)state;
    enum { VPLS = 40, SIZE = 32 };
    static const uint32_t counts[] = {1, 512, 2, 4096, 4, 8, 1, 16, 64};
    es_point_forest f = cubes(counts, 9, false);
    es_vpl_record vpls[VPLS];
    uint16_t* maps = calloc((size_t)VPLS * SIZE * SIZE + 2, sizeof *maps);
    for (int v = 0; v < VPLS; v++) {
        vpls[v] = vpl_at(es_v3(uniform(-3, 20), uniform(-3, 3), uniform(-3, 3)), es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), uniform(0.1f, 2));
        vpls[v].glossy = v % 3 == 0;
        vpls[v].roughness = uniform(0, 1);
        for (int k = 0; k < 3; k++) vpls[v].specular_color[k] = uniform(0, 1);
    }
    for (size_t i = 0; i < (size_t)VPLS * SIZE * SIZE; i++) maps[i] = es_random_u32(71, counter++) % 2 ? ES_PARABOLIC_EMPTY : (uint16_t)(es_random_u32(71, counter++) % ES_PARABOLIC_DEPTH_MAX);
    const es_shade_job job = {.vpls = vpls, .vpl_count = VPLS, .maps = maps, .map_size = SIZE, .far_distance = 20, .bias = 0.01f, .slope_bias = 0.01f, .spread = 1, .geometry_bound = 10};
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        es_arena arena;
        es_arena_init(&arena, context, 1 << 16);
        const guarded_radiance guarded = guard_radiance(&f, 0.5f);
        assert_int_equal(es_points_light_vpls(context, &arena, &f, &job, 8, &lobes), ES_OK);
        for (int k = 0; k < 3; k++) expect_same_bits(&same, f.radiance[k], f.node_count * sizeof(float));
        check_radiance_guards(&f, &guarded);
        es_arena_free(&arena);
        es_context_destroy(context);
    }
    free(maps);
    hand_forest_free(&f);
}

/* No points, no lights, all points in one place, a light on a point. */
static void test_little(void** state)
{
    (void)state;
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    es_vpl_record vpl = vpl_at(es_v3(0, 0, 0), es_v3(0, 1, 0), 1);
    es_shade_job job = {.vpls = &vpl, .vpl_count = 1, .geometry_bound = 10};
    es_point_forest none = hand_forest(NULL, 0);
    assert_int_equal(es_points_light_vpls(context, &arena, &none, &job, 12, &lobes), ES_OK);
    hand_forest_free(&none);
    es_point_forest f = hand_forest(&(uint32_t){128}, 1);
    for (size_t i = 0; i < 128; i++) set_leaf(&f, i, es_v3(0, 0, 0), es_v3(0, -1, 0), ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 1, 0);
    for (int lights = 0; lights < 2; lights++) {
        job.vpl_count = (uint32_t)lights;
        for (uint32_t depth = 0; depth < 32; depth += 4) {
            assert_int_equal(es_points_light_vpls(context, &arena, &f, &job, depth, &lobes), ES_OK);
            for (size_t i = 0; i < 128; i++) assert_true(leaf_radiance(&f, i, 0) == 0);
        }
    }
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

/* test_point_bounces --time: 1024 lights, a million leaves. */
static void time_all(void)
{
    enum { COUNT = 1 << 20, VPLS = 1024, SIZE = 128 };
    es_context* context = open_context(2, 0);
    es_arena arena;
    es_arena_init(&arena, context, 1 << 20);
    es_point_forest f = cubes(&(uint32_t){COUNT}, 1, true);
    es_vpl_record* vpls = malloc(VPLS * sizeof *vpls);
    uint16_t* maps = malloc((size_t)VPLS * SIZE * SIZE * sizeof *maps);
    for (int v = 0; v < VPLS; v++) vpls[v] = vpl_at(es_v3(uniform(-3, 3), uniform(-3, 3), uniform(-3, 3)), es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), uniform(0.1f, 2));
    for (size_t i = 0; i < (size_t)VPLS * SIZE * SIZE; i++) maps[i] = (uint16_t)(es_random_u32(71, (uint32_t)i) % 49152);
    const es_shade_job job = {.vpls = vpls, .vpl_count = VPLS, .maps = maps, .map_size = SIZE, .far_distance = 20, .bias = 0.01f, .slope_bias = 0.01f, .spread = 1, .geometry_bound = 10};
    for (uint32_t depth = 12; depth <= 16; depth += 2) {
        double best = 1e9, pushed = 1e9;
        uint32_t count = 0;
        for (int i = 0; i < 4; i++) {
            es_arena_reset(&arena);
            double begin = es_seconds();
            es_points_light_vpls(context, &arena, &f, &job, depth, &lobes);
            best = fmin(best, es_seconds() - begin);
            es_arena_reset(&arena);
            es_point_level level;
            es_point_level_make(&arena, &f, depth, &level);
            es_point_push push = {.level = &level, .lobes = &lobes};
            es_point_level_values(&arena, &level, push.values);
            for (int k = 0; k < 3; k++) memset(push.values[k], 0, level.count * sizeof(float));
            begin = es_seconds();
            es_points_push(context, &f, &push);
            pushed = fmin(pushed, es_seconds() - begin);
            count = level.count;
        }
        printf("level %2u: %5u samples, 1024 lights: %7.2f ms, of which the push to 2^20 leaves %6.2f ms, two threads\n", depth, count, best * 1e3, pushed * 1e3);
    }
    free(vpls);
    free(maps);
    hand_forest_free(&f);
    es_arena_free(&arena);
    es_context_destroy(context);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_level),
        cmocka_unit_test(test_push),
        cmocka_unit_test(test_push_respects_normals),
        cmocka_unit_test(test_vpls),
        cmocka_unit_test(test_vpls_between_samples),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
