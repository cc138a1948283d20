/* Photon maps at the points of micro-buffers (gi/micro/photon_map.h): in closed rooms whose light is known after each bounce. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/micro/leaf_grid.h"
#include "gi/micro/photon_map.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { POINTS = 1 << 12, PHOTONS = 1 << 12 };
#else
enum { POINTS = 1 << 15, PHOTONS = 1 << 16 };
#endif

static const double pi = 3.14159265358979324;
static es_lobe_albedo lobes;

typedef struct room { small_world w; es_point_forest forest; es_arena arena; es_trace_scene scene; } room;

static void bring(room* r, bool emission)
{
    assert_int_equal(es_world_step(r->w.world, 0), ES_OK);
    const es_forest_request request = {.points = POINTS, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(r->w.context, &r->forest, es_world_draw_list(r->w.world), es_world_get_revisions(r->w.world).materials, &request, &update), ES_OK);
    r->scene.context = r->w.context;
    assert_int_equal(es_trace_scene_take(&r->scene, r->w.world, emission), ES_OK);
    es_arena_init(&r->arena, r->w.context, 1 << 20);
    lobes = es_lobe_albedos;
}

static void leave(room* r)
{
    es_arena_free(&r->arena);
    es_trace_scene_free(&r->scene);
    es_forest_free(r->w.context, &r->forest);
    small_world_destroy(&r->w);
}

static es_light_desc lamp(float intensity)
{
    es_light_desc d = es_default_light_desc();
    d.type = ES_LIGHT_POINT;
    d.intensity = intensity;
    return d;
}

static es_photon_stats light(room* r, uint32_t bounces, bool emission)
{
    for (int k = 0; k < 3; k++)
        for (size_t i = 0; i < r->forest.node_count; i++) r->forest.radiance[k][i] = 0;
    const es_photon_job job = {.scene = &r->scene, .photons = PHOTONS, .bounces = bounces, .seed = 3, .emission = emission, .lobes = &lobes};
    es_photon_stats stats;
    es_arena_reset(&r->arena);
    assert_int_equal(es_points_light_photons(r->w.context, &r->arena, &r->forest, &job, &stats), ES_OK);
    return stats;
}

typedef struct leaf_figures { double mean, deviation, area; } leaf_figures;
static leaf_figures figures(const es_point_forest* f, int k)
{
    leaf_figures l = {0};
    double squares = 0;
    for (uint32_t t = 0; t < f->tree_count; t++)
        for (uint32_t i = 0; i < f->trees[t].leaf_count; i++) {
            const size_t node = f->trees[t].first + f->trees[t].leaf_count + i;
            const double value = (double)f->radiance[k][node], a = (double)f->area[node];
            l.mean += value * a;
            squares += value * value * a;
            l.area += a;
        }
    l.mean /= l.area;
    l.deviation = sqrt(fmax(squares / l.area - l.mean * l.mean, 0));
    return l;
}

/* A lamp anywhere in a sphere: what comes after the first bounce is the same everywhere, power · a^b / area. */
static void test_sphere(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const float albedo = 0.7f;
    const es_material_desc m = lambert(albedo, 0);
    add_sphere(&r.w, es_v3(0.2f, -0.1f, 0.3f), 1, 48, true, &m);
    add_light(&r.w, lamp(5), es_v3(0.6f, 0, 0.1f), es_v3(0, -1, 0));
    bring(&r, false);
    double received = 0, power = 5 * 4 * pi;
    for (uint32_t bounces = 1; bounces <= 3; bounces++) {
        const es_photon_stats stats = light(&r, bounces, false);
        power *= (double)albedo;
        received += power;
        const leaf_figures l = figures(&r.forest, 0);
        const double expected = (double)albedo / pi * received / l.area;
        printf("sphere, %u bounces: %.4f ± %.4f, expected %.4f; %llu photons\n", bounces, l.mean, l.deviation, expected, (unsigned long long)stats.stored);
        assert_int_equal(stats.emitted, PHOTONS);
        /* of as many photons as are emitted 1 - albedo end at each surface: 4 standard errors of their number */
        if (!(fabs(l.mean / expected - 1) <= 4 / sqrt((double)PHOTONS) * sqrt((1 - (double)albedo) / (double)albedo) + 0.002)) fail_msg("%u bounces: %.5f, expected %.5f", bounces, l.mean, expected);
        /* a leaf has the photons of one sample and a half at least, of which an albedo's share is of the first bounce */
        assert_true(l.deviation <= expected * sqrt(1 / (1.5 * ES_PHOTONS_PER_SAMPLE * (double)albedo)));
    }
    leave(&r);
}

/* A closed box: the mean is known, and neither edges nor corners are darker than what they see. */
static void test_box(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const float albedo = 0.5f;
    const es_material_desc m = lambert(albedo, 0);
    add_closed_box(&r.w, &m);
    add_light(&r.w, lamp(2), es_v3(0.2f, 0.1f, -0.3f), es_v3(0, -1, 0));
    bring(&r, false);
    light(&r, 2, false);
    const double received = 2 * 4 * pi * ((double)albedo + (double)albedo * (double)albedo);
    const leaf_figures l = figures(&r.forest, 2);
    const double expected = (double)albedo / pi * received / 24;
    assert_true(fabs(l.area - 24) < 1e-3);
    if (!(fabs(l.mean / expected - 1) <= 4 / sqrt((double)PHOTONS) + 0.002)) fail_msg("%.5f, expected %.5f", l.mean, expected);
    /* a tenth of the walls' width along the edges against the rest: in a box of equal walls light is nearly even, brighter in the middle of walls, where the
     * lamp is near; estimates that lose what is past a border would have half at edges */
    double edge[2] = {0, 0}, rest[2] = {0, 0};
    for (uint32_t t = 0; t < r.forest.tree_count; t++)
        for (uint32_t i = 0; i < r.forest.trees[t].leaf_count; i++) {
            const size_t leaf = r.forest.trees[t].first_leaf + i, node = r.forest.trees[t].first + r.forest.trees[t].leaf_count + i;
            const float a = es_absf(r.forest.x[leaf]), b = es_absf(r.forest.y[leaf]), c = es_absf(r.forest.z[leaf]), second = a + b + c - es_maxf(a, es_maxf(b, c)) - es_minf(a, es_minf(b, c));
            double* to = second > 0.95f ? edge : rest;
            to[0] += (double)r.forest.radiance[0][node] * (double)r.forest.area[node];
            to[1] += (double)r.forest.area[node];
        }
    printf("box: along edges %.4f, elsewhere %.4f, mean expected %.4f\n", edge[0] / edge[1], rest[0] / rest[1], expected);
    assert_true(edge[0] / edge[1] > 0.85 * rest[0] / rest[1]);
    leave(&r);
}

/* What glows: the first light of it is here too. In a closed box that glows evenly, e (a + a² + …) everywhere. */
static void test_glow(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const float albedo = 0.6f;
    const es_material_desc m = lambert(albedo, 2);
    add_closed_box(&r.w, &m);
    bring(&r, true);
    double expected = 0, power = 2;
    for (uint32_t bounces = 1; bounces <= 2; bounces++) {
        const es_photon_stats stats = light(&r, bounces, true);
        if (bounces == 1) power *= (double)albedo, expected += power;
        power *= (double)albedo;
        expected += power;
        const leaf_figures l = figures(&r.forest, 1);
        printf("glowing box, %u bounces: %.4f ± %.4f, expected %.4f\n", bounces, l.mean, l.deviation, expected);
        assert_int_equal(stats.emitted, PHOTONS);
        if (!(fabs(l.mean / expected - 1) <= 4 / sqrt((double)PHOTONS) + 0.002)) fail_msg("%u bounces: %.5f, expected %.5f", bounces, l.mean, expected);
        assert_true(l.deviation <= expected * sqrt(1 / (1.5 * ES_PHOTONS_PER_SAMPLE * (double)albedo)));
    }
    /* without emission nothing glows */
    assert_int_equal(light(&r, 1, false).emitted, 0);
    assert_true(figures(&r.forest, 0).mean == 0);
    leave(&r);
}

/* The nearest of all leaves that face as they should, on surfaces that bend by more than that from one triangle to the next. */
static void test_nearest_leaf(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const es_material_desc m = lambert(0.5f, 0);
    add_sphere(&r.w, es_v3(0, 0, 0), 1, 8, true, &m);
    /* a tetrahedron: past an edge normals differ by more than 60° */
    static const float corners[12] = {0.5f, 0.5f, 0.5f, 0.5f, -0.5f, -0.5f, -0.5f, 0.5f, -0.5f, -0.5f, -0.5f, 0.5f};
    static const uint32_t indices[12] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
    add_instance(&r.w, &(es_mesh_desc){.vertex_count = 4, .triangle_count = 4, .positions = corners, .indices = indices, .flat_normals = true}, &m);
    bring(&r, false);
    es_leaf_grid grid;
    assert_int_equal(es_leaf_grid_make(&r.arena, &r.forest, &grid), ES_OK);
    uint32_t others = 0;
    for (uint32_t i = 0; i < 400; i++) {
        const uint32_t tree = i % r.forest.tree_count;
        const es_point_tree* t = &r.forest.trees[tree];
        const size_t at = t->first_leaf + es_random_u32(5, 4 * i) % t->leaf_count;
        const float step = es_sqrt(r.forest.area[t->first + 1] / (float)t->leaf_count);
        es_vec3 p = es_v3(r.forest.x[at], r.forest.y[at], r.forest.z[at]);
        for (int k = 0; k < 3; k++) (&p.x)[k] += step * (es_random_float(5, 4 * i + 1 + (uint32_t)k) - 0.5f);
        const es_vec3 n = es_unpack_normal(r.forest.normal[at]);
        size_t best = 0, any = 0;
        float least = 3e38f, least_of_any = 3e38f;
        for (size_t leaf = t->first_leaf; leaf < t->first_leaf + t->leaf_count; leaf++) {
            const float dx = r.forest.x[leaf] - p.x, dy = r.forest.y[leaf] - p.y, dz = r.forest.z[leaf] - p.z, d2 = dx * dx + dy * dy + dz * dz;
            if (d2 < least_of_any) {
                least_of_any = d2;
                any = leaf;
            }
            if (!(d2 < least) || !(es_v3_dot(n, es_unpack_normal(r.forest.normal[leaf])) > 0.5f)) continue;
            least = d2;
            best = leaf;
        }
        assert_int_equal(es_leaf_grid_nearest(&grid, tree, p, n), best);
        others += best != any;
    }
    assert_true(r.forest.tree_count == 2 && others > 0);
    /* far from everything: some leaf of the tree */
    const size_t leaf = es_leaf_grid_nearest(&grid, 1, es_v3(1e6f, -1e6f, 0), es_v3(0, 1, 0));
    assert_true(leaf >= r.forest.trees[1].first_leaf && leaf < r.forest.leaf_count);
    leave(&r);
}

static void test_same_bits(void** state)
{
    (void)state;
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        room r = {.w.context = context};
        assert_int_equal(es_world_create(context, NULL, &r.w.world), ES_OK);
        es_material_desc m = lambert(0.7f, 0);
        m.specular = 1;
        m.roughness = 0.3f;
        add_closed_box(&r.w, &m);
        m.metallic = 1;
        m.double_sided = true;
        m.emission[0] = 2;
        add_sphere(&r.w, es_v3(0.2f, -0.3f, 0), 0.4f, 8, false, &m);
        add_light(&r.w, lamp(5), es_v3(-0.6f, 0.5f, 0.1f), es_v3(0, -1, 0));
        bring(&r, true);
        for (int k = 0; k < 3; k++) memset(r.forest.radiance[k], 0, r.forest.node_count * sizeof(float));
        const es_photon_job job = {.scene = &r.scene, .photons = 3000, .bounces = 3, .seed = 3, .emission = true, .lobes = &lobes};
        assert_int_equal(es_points_light_photons(context, &r.arena, &r.forest, &job, NULL), ES_OK);
        assert_true(figures(&r.forest, 0).mean > 0);
        for (int k = 0; k < 3; k++) expect_same_bits(&same, r.forest.radiance[k], r.forest.node_count * sizeof(float));
        leave(&r);
    }
}

static void test_little(void** state)
{
    (void)state;
    /* nothing at all; a lamp and no surface; a surface and no lamp; black ones */
    for (int what = 0; what < 4; what++) {
        room r = {.w = small_world_create()};
        const es_material_desc m = lambert(what == 3 ? 0 : 0.5f, 0);
        if (what >= 2) add_closed_box(&r.w, &m);
        if (what & 1) add_light(&r.w, lamp(5), es_v3(0, 0, 0), es_v3(0, -1, 0));
        bring(&r, true);
        const es_photon_stats stats = light(&r, 2, true);
        assert_int_equal(stats.stored, 0);
        for (int k = 0; k < 3; k++)
            for (size_t i = 0; i < r.forest.node_count; i++) assert_true(r.forest.radiance[k][i] == 0);
        leave(&r);
    }
}

/* test_photon_map --time: a million points, 2^17 photons of three bounces. */
static void time_all(void)
{
    room r = {.w = small_world_create()};
    const es_material_desc m = lambert(0.7f, 0);
    add_closed_box(&r.w, &m);
    add_sphere(&r.w, es_v3(0.2f, -0.3f, 0), 0.4f, 64, false, &m);
    add_light(&r.w, lamp(5), es_v3(-0.6f, 0.5f, 0.1f), es_v3(0, -1, 0));
    bring(&r, false);
    const es_forest_request request = {.points = 1 << 20, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(r.w.context, &r.forest, es_world_draw_list(r.w.world), 1, &request, &update), ES_OK);
    const es_photon_job job = {.scene = &r.scene, .photons = 1 << 17, .bounces = 3, .seed = 3, .lobes = &lobes};
    for (int i = 0; i < 3; i++) {
        es_photon_stats stats;
        es_arena_reset(&r.arena);
        const double begin = es_seconds();
        assert_int_equal(es_points_light_photons(r.w.context, &r.arena, &r.forest, &job, &stats), ES_OK);
        printf("%zu points, 2^17 paths: %8.2f ms, %llu photons, %llu rays, two threads\n", r.forest.leaf_count, (es_seconds() - begin) * 1e3, (unsigned long long)stats.stored, (unsigned long long)stats.rays);
    }
    leave(&r);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_box),
        cmocka_unit_test(test_glow),
        cmocka_unit_test(test_nearest_leaf),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
