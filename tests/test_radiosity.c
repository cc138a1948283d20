/* Radiosity at the points of micro-buffers (gi/micro/radiosity.h): in closed rooms whose light is known after each bounce. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/micro/radiosity.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { POINTS = 1 << 12, LEVEL = 6 };
#else
enum { POINTS = 1 << 14, LEVEL = 8 };
#endif

static es_lobe_albedo lobes;

typedef struct room { small_world w; es_point_forest forest; es_arena arena; } room;

static void bring(room* r)
{
    assert_int_equal(es_world_step(r->w.world, 0), ES_OK);
    const es_forest_request request = {.points = POINTS, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(r->w.context, &r->forest, es_world_draw_list(r->w.world), es_world_get_revisions(r->w.world).materials, &request, &update), ES_OK);
    es_arena_init(&r->arena, r->w.context, 1 << 20);
    lobes = es_lobe_albedos;
}

static void leave(room* r)
{
    es_arena_free(&r->arena);
    es_forest_free(r->w.context, &r->forest);
    small_world_destroy(&r->w);
}

static es_radiosity_job job_of(uint32_t iterations)
{
    return (es_radiosity_job){.level = LEVEL, .iterations = iterations, .micro = {.size = 16, .cut = 1, .cover = 2, .ray_cast = true, .warp = true, .quantised = true}, .seed = 5, .lobes = &lobes};
}

/* What glows, and nothing else. */
static void glow(room* r)
{
    const es_point_light_job none = {.emission = true, .lobes = &lobes};
    assert_int_equal(es_points_light_direct(r->w.context, &r->forest, &none), ES_OK);
}

typedef struct leaf_figures { double mean, least, most; } leaf_figures;
static leaf_figures figures(const es_point_forest* f, int k)
{
    leaf_figures l = {0, 1e30, -1e30};
    double area = 0;
    for (uint32_t t = 0; t < f->tree_count; t++)
        for (uint32_t i = 0; i < f->trees[t].leaf_count; i++) {
            const size_t node = f->trees[t].first + f->trees[t].leaf_count + i;
            const double value = (double)f->radiance[k][node], a = (double)f->area[node];
            l.mean += value * a;
            area += a;
            l.least = fmin(l.least, value);
            l.most = fmax(l.most, value);
        }
    l.mean /= area;
    return l;
}

/* A closed box of one albedo that glows evenly: e (1 + a + a² + … + a^n) everywhere after n iterations. */
static void test_furnace(void** state)
{
    (void)state;
    static const float albedos[] = {0, 0.5f, 0.8f, 1};
    for (int i = 0; i < 4; i++) {
        room r = {.w = small_world_create()};
        const es_material_desc m = lambert(albedos[i], 2);
        add_closed_box(&r.w, &m);
        bring(&r);
        double expected = 2, power = 2;
        for (uint32_t n = 0; n <= 3; n++) {
            glow(&r);
            const es_radiosity_job job = job_of(n);
            es_micro_stats stats;
            es_arena_reset(&r.arena);
            assert_int_equal(es_points_light_radiosity(r.w.context, &r.arena, &r.forest, &job, &stats), ES_OK);
            const leaf_figures l = figures(&r.forest, i % 3);
            /* nothing passes between points, so every direction sees 2, 2 + 2 a, …: up to rounding of packed radiance, half of 2^-9 each time */
            const double tolerance = 2e-3 * (n + 1) * expected;
            if (!(fabs(l.mean - expected) <= tolerance && l.least >= expected - 2 * tolerance && l.most <= expected + 2 * tolerance))
                fail_msg("albedo %g, %u iterations: %.4f (%.4f … %.4f), expected %.4f", (double)albedos[i], n, l.mean, l.least, l.most, expected);
            power *= (double)albedos[i];
            expected += power;
        }
        leave(&r);
    }
}

/* A sphere that is lit anywhere and anyhow: what arrives a bounce later is the mean of what is sent, everywhere. */
static void test_sphere(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const float albedo = 0.6f;
    const es_material_desc m = lambert(albedo, 0);
    add_sphere(&r.w, es_v3(0.2f, -0.1f, 0.3f), 1, 64, true, &m);
    bring(&r);
    double direct = 0;
    for (uint32_t n = 0; n <= 2; n++) {
        /* a spot of the sphere sends light, of one colour */
        for (uint32_t t = 0; t < r.forest.tree_count; t++)
            for (uint32_t i = 0; i < r.forest.trees[t].leaf_count; i++) {
                const size_t node = r.forest.trees[t].first + r.forest.trees[t].leaf_count + i;
                r.forest.radiance[0][node] = r.forest.x[r.forest.trees[t].first_leaf + i] > 0.7f ? 5 : 0;
                r.forest.radiance[1][node] = r.forest.radiance[2][node] = 0;
            }
        if (!n) direct = figures(&r.forest, 0).mean;
        es_radiosity_job job = job_of(n);
        job.micro.size = 32; /* the spot's edge crosses pixels, each of which shows it or does not */
        es_arena_reset(&r.arena);
        assert_int_equal(es_points_light_radiosity(r.w.context, &r.arena, &r.forest, &job, NULL), ES_OK);
        const double a = (double)albedo, expected = direct * (1 + (n > 0 ? a : 0) + (n > 1 ? a * a : 0));
        const leaf_figures l = figures(&r.forest, 0);
        double squares = 0, dark = 0;
        for (uint32_t t = 0; t < r.forest.tree_count; t++)
            for (uint32_t i = 0; i < r.forest.trees[t].leaf_count; i++) {
                if (r.forest.x[r.forest.trees[t].first_leaf + i] > 0.7f) continue;
                const double d = (double)r.forest.radiance[0][r.forest.trees[t].first + r.forest.trees[t].leaf_count + i] - (expected - direct);
                squares += d * d;
                dark++;
            }
        const double rms = sqrt(squares / dark);
        printf("sphere, %u iterations: mean %.4f, expected %.4f; in the dark off by %.4f of %.4f\n", n, l.mean, expected, rms, expected - direct);
        if (!(fabs(l.mean - expected) <= 0.02 * expected)) fail_msg("%u iterations: %.4f, expected %.4f", n, l.mean, expected);
        assert_true(rms <= 0.08 * (expected - direct));
        assert_true(figures(&r.forest, 1).most == 0);
    }
    leave(&r);
}

/* It is a function of what the leaves sent before, on any instruction set and any number of threads. */
static void test_same_bits(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        room r = {.w.context = context};
        assert_int_equal(es_world_create(context, NULL, &r.w.world), ES_OK);
        es_material_desc m = lambert(0.7f, 1);
        m.specular = 1;
        m.roughness = 0.3f;
        add_closed_box(&r.w, &m);
        m.emission[0] = 9;
        add_sphere(&r.w, es_v3(0.2f, -0.3f, 0), 0.4f, 8, false, &m);
        const es_forest_request request = {.points = 2048, .rebuild = 1.5f};
        es_forest_update update;
        assert_int_equal(es_world_step(r.w.world, 0), ES_OK);
        assert_int_equal(es_forest_bring(context, &r.forest, es_world_draw_list(r.w.world), 1, &request, &update), ES_OK);
        es_arena_init(&r.arena, context, 1 << 20);
        lobes = es_lobe_albedos;
        glow(&r);
        es_radiosity_job job = job_of(2);
        job.level = 6;
        job.micro.size = 8;
        assert_int_equal(es_points_light_radiosity(context, &r.arena, &r.forest, &job, NULL), ES_OK);
        es_forest_pull(context, &r.forest);
        for (uint32_t t = 0; t < r.forest.tree_count; t++)
            for (int k = 0; k < 3; k++) expect_same_bits(&same, r.forest.radiance[k] + r.forest.trees[t].first + 1, (2 * r.forest.trees[t].leaf_count - 1) * sizeof(float));
        leave(&r);
    }
}

static void test_little(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    bring(&r);
    const es_radiosity_job job = job_of(2);
    assert_int_equal(es_points_light_radiosity(r.w.context, &r.arena, &r.forest, &job, NULL), ES_OK);
    leave(&r);
    /* alone in the dark, and nothing glows */
    r = (room){.w = small_world_create()};
    const es_material_desc m = lambert(0.5f, 0);
    add_rectangle(&r.w, es_v3(0, 0, 0), es_v3(1, 0, 0), es_v3(0, 1, 0), &m);
    bring(&r);
    glow(&r);
    assert_int_equal(es_points_light_radiosity(r.w.context, &r.arena, &r.forest, &job, NULL), ES_OK);
    assert_true(figures(&r.forest, 0).most == 0);
    leave(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
