/* Gathering by micro-buffers (gi/micro/micro.h) where the answer is known, and where geometry is awkward. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/micro/light.h"
#include "gi/micro/micro.h"
#include "gi/surface.h"
#include "platform/context.h"
#include "tests/same_bits.h"
#include "tests/small_worlds.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { POINTS = 1 << 13, DIRECTIONS = 2000 };
#else
enum { POINTS = 1 << 15, DIRECTIONS = 40000 };
#endif

static es_lobe_albedo lobes;

typedef struct room { small_world w; es_point_forest forest; } room;

/* Points of everything there is, and what glows. */
static void bring(room* r, uint32_t points)
{
    assert_int_equal(es_world_step(r->w.world, 0), ES_OK);
    const es_forest_request request = {.points = points, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(r->w.context, &r->forest, es_world_draw_list(r->w.world), es_world_get_revisions(r->w.world).materials, &request, &update), ES_OK);
    const es_point_light_job glow = {.emission = true, .lobes = &lobes};
    assert_int_equal(es_points_light_direct(r->w.context, &r->forest, &glow), ES_OK);
    es_forest_pull(r->w.context, &r->forest);
}

static void leave(room* r)
{
    es_forest_free(r->w.context, &r->forest);
    small_world_destroy(&r->w);
}

/* A closed box, 2 m a side, that sends 2 W/(m² sr) from everywhere. */
static void furnace(room* r, uint32_t points)
{
    *r = (room){.w = small_world_create()};
    const es_material_desc m = lambert(0, 2);
    add_closed_box(&r->w, &m);
    bring(r, points);
}

static es_micro_settings usual(void) { return (es_micro_settings){.size = 24, .cut = 4, .cover = 1.3f, .share = 2, .ray_cast = true, .warp = true, .quantised = true}; }

static void gather(const room* r, const es_micro_settings* settings, const es_gather_point* points, size_t count, float* result)
{
    float* const planes[3] = {result, result + count, result + 2 * count};
    es_micro_stats stats;
    assert_int_equal(es_micro_gather(r->w.context, &r->forest, settings, points, count, planes, &stats), ES_OK);
    for (size_t i = 0; i < 3 * count; i++) assert_true(isfinite(result[i]) && result[i] >= 0);
}

static es_gather_point floor_point(float x, float z, uint32_t seed)
{
    return (es_gather_point){.position = {x, -1, z}, .normal = {0, 1, 0}, .view = {0, 1, 0}, .kind = ES_GATHER_DIFFUSE, .seed = seed};
}

/* The mean of the surface's own samples' weights: f cos integrated over the hemisphere. */
static es_vec3 albedo_of(const es_surface* surface, es_vec3 n, es_vec3 view)
{
    double sum[3] = {0, 0, 0};
    for (uint32_t i = 0; i < DIRECTIONS; i++) {
        const float u[3] = {0, ((float)i + 0.5f) / DIRECTIONS, (float)(i * 2654435769u >> 8) * (1.0f / 16777216.0f)};
        es_surface_sample sample;
        if (!es_surface_sample_direction(surface, n, view, u, &sample)) continue;
        sum[0] += (double)sample.weight.x;
        sum[1] += (double)sample.weight.y;
        sum[2] += (double)sample.weight.z;
    }
    return es_v3((float)(sum[0] / DIRECTIONS), (float)(sum[1] / DIRECTIONS), (float)(sum[2] / DIRECTIONS));
}

/* Constant light all around: irradiance is pi times it; a lobe reflects its albedo times it, channel by channel, though nothing but the sum of the pixels is taken. */
static void test_constant_light(void** state)
{
    (void)state;
    room r;
    furnace(&r, POINTS);
    enum { COUNT = 24 };
    es_gather_point points[COUNT];
    float result[3 * COUNT];
    for (uint32_t i = 0; i < COUNT; i++) points[i] = floor_point(0.05f * (float)i - 0.6f, 0.03f * (float)i - 0.3f, i);
    es_micro_settings s = usual();
    for (int nodes = 0; nodes < 2; nodes++) {
        s.quantised = nodes == 0;
        gather(&r, &s, points, COUNT, result);
        for (uint32_t i = 0; i < 3 * COUNT; i++)
            if (!(fabs((double)result[i] - 2 * 3.14159265) < 0.02 * 2 * 3.14159265)) fail_msg("irradiance %g of %g", (double)result[i], 2 * 3.14159265);
    }
    static const struct { uint32_t model; float roughness; double tolerance; } surfaces[] = {{ES_SURFACE_METALLIC_ROUGHNESS, 0.1f, 0.03}, {ES_SURFACE_METALLIC_ROUGHNESS, 0.3f, 0.03}, {ES_SURFACE_METALLIC_ROUGHNESS, 0.5f, 0.03},
        {ES_SURFACE_METALLIC_ROUGHNESS, 1, 0.03}, {ES_SURFACE_PHONG, 5, 0.03}, {ES_SURFACE_PHONG, 20, 0.03}, {ES_SURFACE_PHONG, 50, 0.03}};
    static const float angles[] = {0.1f, 0.7f, 1.2f};
    for (size_t k = 0; k < sizeof surfaces / sizeof surfaces[0]; k++)
        for (size_t a = 0; a < 3; a++) {
            const es_vec3 f0 = es_v3(0.9f, 0.5f, 0.2f), n = es_v3(0, 1, 0), view = es_v3(es_sin(angles[a]), es_cos(angles[a]), 0);
            const es_surface surface = {.specular = f0, .roughness = surfaces[k].roughness, .model = surfaces[k].model};
            const es_vec3 albedo = albedo_of(&surface, n, view);
            const float expected[3] = {2 * albedo.x, 2 * albedo.y, 2 * albedo.z};
            for (uint32_t i = 0; i < COUNT; i++) {
                points[i].kind = ES_GATHER_LOBE;
                points[i].model = surfaces[k].model;
                points[i].roughness = surfaces[k].roughness;
                for (int c = 0; c < 3; c++) {
                    points[i].f0[c] = (&f0.x)[c];
                    points[i].view[c] = (&view.x)[c];
                }
            }
            s.quantised = true;
            gather(&r, &s, points, COUNT, result);
            for (int c = 0; c < 3; c++) {
                double mean = 0;
                for (uint32_t i = 0; i < COUNT; i++) mean += (double)result[(size_t)c * COUNT + i] / COUNT;
                if (!(fabs(mean - (double)expected[c]) < surfaces[k].tolerance * (double)expected[c]))
                    fail_msg("model %u of %g seen at %g: %g instead of %g", surfaces[k].model, (double)surfaces[k].roughness, (double)angles[a], mean, (double)expected[c]);
            }
        }
    leave(&r);
}

/* A disc of radius R at height h over the point sends pi L R² / (R² + h²). */
static void test_disc_overhead(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const es_material_desc glowing = lambert(0, 3);
    const float half = 0.4f, height = 0.5f;
    add_rectangle(&r.w, es_v3(-half, height, -half), es_v3(2 * half, 0, 0), es_v3(0, 0, 2 * half), &glowing); /* faces down */
    bring(&r, POINTS);
    enum { COUNT = 32 };
    es_gather_point points[COUNT];
    float result[3 * COUNT];
    for (uint32_t i = 0; i < COUNT; i++) {
        points[i] = floor_point(0, 0, i);
        points[i].position[1] = 0;
    }
    const es_micro_settings s = usual();
    gather(&r, &s, points, COUNT, result);
    /* of a quarter a × b seen from below its corner, a over the height: 1/2 (a/√(1 + a²) atan(b/√(1 + a²)) + the same the other way round) */
    const double a = (double)(half / height), w = sqrt(1 + a * a), expected = 3 * 4 * (a / w * atan(a / w));
    double mean = 0;
    for (uint32_t i = 0; i < COUNT; i++) mean += (double)result[i] / COUNT;
    if (!(fabs(mean - expected) < 0.06 * expected)) fail_msg("%g instead of %g", mean, expected);
    /* from above, nothing: only fronts send */
    for (uint32_t i = 0; i < COUNT; i++) {
        points[i].position[1] = 2 * height;
        points[i].normal[1] = points[i].view[1] = -1;
    }
    gather(&r, &s, points, COUNT, result);
    for (uint32_t i = 0; i < 3 * COUNT; i++) assert_true(result[i] == 0);
    leave(&r);
}

/* Without rays, a point close to a wall of few points loses what these do not cover. */
static void test_rays_close_holes(void** state)
{
    (void)state;
    room r;
    furnace(&r, 1 << 9);
    enum { COUNT = 64 };
    es_gather_point points[COUNT];
    float cast[3 * COUNT], drawn[3 * COUNT];
    for (uint32_t i = 0; i < COUNT; i++) points[i] = floor_point(0.9f, 0.02f * (float)i - 0.6f, i);
    es_micro_settings s = usual();
    gather(&r, &s, points, COUNT, cast);
    s.ray_cast = false;
    gather(&r, &s, points, COUNT, drawn);
    double with = 0, without = 0;
    for (uint32_t i = 0; i < COUNT; i++) {
        with += (double)cast[i] / COUNT / (2 * 3.14159265);
        without += (double)drawn[i] / COUNT / (2 * 3.14159265);
    }
    if (!(with > 0.9 && with < 1.001 && without < 0.8 * with)) fail_msg("with rays %g, without %g of the light", with, without);
    leave(&r);
}

/* Where geometry is awkward the light is finite, and no more than there is. */
static void test_awkward_places(void** state)
{
    (void)state;
    room r;
    furnace(&r, POINTS);
    const float places[][3] = {{-1, -1, -1}, {-1, -1, 0}, {-0.9999f, -0.9999f, -0.9999f}, {0, -1, 0}, {0, 0, 0}, {5, 5, 5}, {0, -1.5f, 0}, {1e6f, 0, 0}, {r.forest.x[0], r.forest.y[0], r.forest.z[0]}};
    enum { PLACES = 9, NORMALS = 3, COUNT = PLACES * NORMALS * 2 };
    static const float normals[NORMALS][3] = {{0, 1, 0}, {1, 0, 0}, {0.57735027f, 0.57735027f, 0.57735027f}};
    es_gather_point points[COUNT];
    float result[3 * COUNT];
    for (uint32_t i = 0; i < COUNT; i++) {
        points[i] = (es_gather_point){.f0 = {0.9f, 0.9f, 0.9f}, .roughness = 0, .kind = i % 2 ? ES_GATHER_LOBE : ES_GATHER_DIFFUSE, .seed = i};
        memcpy(points[i].position, places[i / 2 % PLACES], sizeof points[i].position);
        memcpy(points[i].normal, normals[i / (2 * PLACES)], sizeof points[i].normal);
        /* some look along the surface, or from behind it */
        memcpy(points[i].view, normals[(i / (2 * PLACES) + i / 2) % NORMALS], sizeof points[i].view);
    }
    const es_micro_settings s = usual();
    gather(&r, &s, points, COUNT, result);
    for (uint32_t i = 0; i < 3 * COUNT; i++) assert_true(result[i] <= 1.01f * 2 * 3.1415927f);
    leave(&r);

    /* one point, and none */
    for (uint32_t count = 0; count < 2; count++) {
        room few = {.w = small_world_create()};
        const es_material_desc m = lambert(0, 1);
        if (count) add_rectangle(&few.w, es_v3(-1, 1, -1), es_v3(2, 0, 0), es_v3(0, 0, 2), &m);
        bring(&few, 1);
        es_gather_point point = floor_point(0, 0, 1);
        float light[3];
        gather(&few, &s, &point, 1, light);
        assert_true(count ? light[0] > 0 : light[0] == 0);
        leave(&few);
    }

    /* all in one place, and a huge one beside tiny ones */
    room tiny = {.w = small_world_create()};
    const es_material_desc m = lambert(0, 1);
    for (int i = 0; i < 20; i++) add_rectangle(&tiny.w, es_v3(0.1f, 0.5f, 0.1f), es_v3(1e-4f, 0, 0), es_v3(0, 0, 1e-4f), &m);
    add_rectangle(&tiny.w, es_v3(-500, 100, -500), es_v3(1000, 0, 0), es_v3(0, 0, 1000), &m);
    bring(&tiny, 1 << 10);
    es_gather_point point = floor_point(0, 0, 1);
    float light[3];
    gather(&tiny, &s, &point, 1, light);
    assert_true(light[0] > 0.5f && light[0] < 3.2f);
    leave(&tiny);
}

/* What is seen from the middle of a cell is nearly what its points see, and the nearer the less of it they share; also beside what is near, and where there is nothing. */
static void test_shared_view(void** state)
{
    (void)state;
    room r = {.w = small_world_create()};
    const es_material_desc floor = lambert(0.5f, 1), red = lambert(0.5f, 6), dark = lambert(0, 0);
    add_rectangle(&r.w, es_v3(-1, -1, 1), es_v3(2, 0, 0), es_v3(0, 0, -2), &floor); /* faces up */
    add_sphere(&r.w, es_v3(0.2f, -0.7f, 0.1f), 0.29f, 24, false, &red);
    add_rectangle(&r.w, es_v3(-0.3f, -1, -0.3f), es_v3(0, 0.5f, 0), es_v3(0, 0, 0.6f), &dark);
    bring(&r, POINTS);
    enum { SIDE = 24, COUNT = SIDE * SIDE };
    static es_gather_point points[COUNT];
    static float own[3 * COUNT], shared[3 * COUNT];
    es_micro_settings s = usual();
    for (int lobes_too = 0; lobes_too < 2; lobes_too++) {
        for (uint32_t i = 0; i < COUNT; i++) {
            points[i] = floor_point(0.04f * (float)(i % SIDE) - 0.6f, 0.04f * (float)(i / SIDE) - 0.5f, i);
            if (!lobes_too) continue;
            points[i].kind = ES_GATHER_LOBE;
            points[i].model = ES_SURFACE_METALLIC_ROUGHNESS;
            points[i].roughness = 0.4f;
            points[i].view[0] = 0.6f, points[i].view[1] = 0.8f;
            for (int k = 0; k < 3; k++) points[i].f0[k] = 0.8f;
        }
        s.share = 0;
        gather(&r, &s, points, COUNT, own);
        static const float shares[] = {1, 4, 64};
        double off[3];
        for (int k = 0; k < 3; k++) {
            s.share = shares[k];
            gather(&r, &s, points, COUNT, shared);
            double sum = 0;
            off[k] = 0;
            for (uint32_t i = 0; i < COUNT; i++) {
                off[k] += fabs((double)shared[i] - (double)own[i]);
                sum += (double)own[i];
            }
            off[k] /= sum;
        }
        print_message("%s: shared beyond 1, 4, 64 radii off by %.4f, %.4f, %.4f\n", lobes_too ? "lobes" : "diffuse", off[0], off[1], off[2]);
        assert_true(off[0] < 0.24 && off[1] < 0.09 && off[2] < 0.06 && off[1] < off[0]); /* what is left is that texels are not pixels */
    }
    leave(&r);
}

/* The same bits on every instruction set and number of threads. */
static void test_same_bits(void** state)
{
    (void)state;
    enum { COUNT = 200 };
    static float result[3 * COUNT];
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        room r = {.w.context = context};
        assert_int_equal(es_world_create(context, NULL, &r.w.world), ES_OK);
        const es_material_desc one = lambert(0, 1), two = lambert(0, 5);
        add_rectangle(&r.w, es_v3(-1, 1, -1), es_v3(2, 0, 0), es_v3(0, 0, 2), &one);
        add_sphere(&r.w, es_v3(0.3f, 0, 0.2f), 0.3f, 12, false, &two);
        bring(&r, 1 << 12);
        es_gather_point points[COUNT];
        for (uint32_t i = 0; i < COUNT; i++) {
            points[i] = floor_point(0.01f * (float)i - 1, 0.004f * (float)(i % 37), i);
            points[i].kind = i % 3 ? ES_GATHER_DIFFUSE : ES_GATHER_LOBE;
            points[i].model = i % 2 ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS;
            points[i].roughness = i % 2 ? 20 : 0.3f;
            for (int k = 0; k < 3; k++) points[i].f0[k] = 0.5f;
        }
        es_micro_settings s = usual();
        s.size = 12;
        gather(&r, &s, points, COUNT, result);
        expect_same_bits(&same, result, sizeof result);
        leave(&r);
    }
}

int main(void)
{
    lobes = es_lobe_albedos;
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_constant_light), cmocka_unit_test(test_disc_overhead), cmocka_unit_test(test_rays_close_holes), cmocka_unit_test(test_awkward_places), cmocka_unit_test(test_shared_view), cmocka_unit_test(test_same_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
