/* Where virtual point lights go: hierarchical warping against its probabilities, and the Halton points that drive it; and where the points
 * of imperfect shadow maps lie: evenly over the world's area. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/scene_points.h"
#include "gi/vpl_sampling.h"
#include "platform/random.h"
#include "tests/small_worlds.h"
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

/* ---- points of the scene -------------------------------------------------------------------------------------------------------------- */

static double area_of(const es_raster_instance* instance, uint32_t triangle, double corner[3][3])
{
    for (int c = 0; c < 3; c++) {
        const float* p = instance->mesh->positions + 4 * (size_t)instance->mesh->indices[3 * triangle + (uint32_t)c];
        const float* m = instance->transform.m;
        for (int k = 0; k < 3; k++) corner[c][k] = (double)m[k] * (double)p[0] + (double)m[4 + k] * (double)p[1] + (double)m[8 + k] * (double)p[2] + (double)m[12 + k];
    }
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = corner[1][k] - corner[0][k];
        v[k] = corner[2][k] - corner[0][k];
    }
    return 0.5 * sqrt(pow(u[1] * v[2] - u[2] * v[1], 2) + pow(u[2] * v[0] - u[0] * v[2], 2) + pow(u[0] * v[1] - u[1] * v[0], 2));
}

/* Triangles of many sizes, an instance that is stretched, one that is mirrored. Every subset's points are one in each of as many equal shares
 * of the whole area, in the order of the triangles: a triangle's number differs from its share by less than two. Over sixteen equal parts of
 * triangles they are spread more evenly than random ones: by chi-square. */
static void test_scene_points(void** state)
{
    enum { POINTS = 256, SUBSETS = 128, PARTS = 4, MOST = 400 };
    small_world w = small_world_create();
    es_material_desc grey = lambert(0.5f, 0);
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    add_sphere(&w, es_v3(0, 1, 0), 0.8f, 6, false, &grey);
    uint32_t ids[8];
    size_t count = 8;
    assert_int_equal(es_world_enumerate(w.world, ES_OBJECT_INSTANCE, ids, &count), ES_OK);
    es_instance_desc ball;
    assert_int_equal(es_world_get_instance(w.world, (es_instance){ids[1]}, &ball), ES_OK);
    for (int i = 0; i < 2; i++) {
        es_instance added;
        es_node_desc node = {.transform = {es_v3((float)i, 2, 0), es_quat_from_axis_angle(es_v3(1, 0, 0), 0.7f), i ? es_v3(-0.5f, 0.5f, 0.5f) : es_v3(3, 0.5f, 1)}};
        assert_int_equal(es_world_add_node(w.world, &node, &ball.node), ES_OK);
        assert_int_equal(es_world_add_instance(w.world, &ball, &added), ES_OK);
    }
    assert_int_equal(es_world_step(w.world, 0), ES_OK);
    const es_draw_list* list = es_world_draw_list(w.world);
    es_scene_points points = {0};
    uint64_t moved;
    assert_int_equal(es_scene_points_update(w.context, &points, list, &(es_point_request){POINTS, SUBSETS, 0}, &moved), ES_OK);
    assert_int_equal(moved, POINTS * SUBSETS);

    double total = 0, corner[3][3];
    static double cells[MOST][2], parts[2 * PARTS * PARTS][2];
    static uint32_t counts[SUBSETS][MOST], instance_of[POINTS * SUBSETS];
    uint32_t triangles = 0, first[8] = {0};
    for (uint32_t i = 0; i < list->instance_count; i++) {
        first[i] = triangles;
        for (uint32_t t = 0; t < list->instances[i].mesh->triangle_count; t++) total += cells[triangles++][0] = area_of(&list->instances[i], t, corner);
    }
    assert_true(triangles < MOST && fabs((double)points.area / total - 1) < 0.01 /* scales are rounded */);
    for (uint32_t i = 0; i < list->instance_count; i++)
        for (uint32_t s = 0; s < SUBSETS; s++)
            for (uint32_t k = es_scene_points_border(&points, s, points.sources[i].begin); k < es_scene_points_border(&points, s, points.sources[i].end); k++) instance_of[s * POINTS + k] = i;
    for (uint32_t i = 0; i < POINTS * SUBSETS; i++) {
        const es_raster_instance* instance = &list->instances[instance_of[i]];
        double u = (points.barycentric[i] & 0xffff) / 65535.0, v = (points.barycentric[i] >> 16) / 65535.0;
        area_of(instance, points.triangle[i], corner);
        const double place[3] = {(double)points.x[i], (double)points.y[i], (double)points.z[i]};
        for (int k = 0; k < 3; k++) assert_true(fabs(place[k] - ((1 - u - v) * corner[0][k] + u * corner[1][k] + v * corner[2][k])) < 1e-5);
        counts[i / POINTS][first[instance_of[i]] + points.triangle[i]]++;
        cells[first[instance_of[i]] + points.triangle[i]][1]++;
        int a = (int)fmin(u * PARTS, PARTS - 1), b = (int)fmin(v * PARTS, PARTS - 1), part = 2 * (a * PARTS + b) + (u * PARTS - a + v * PARTS - b > 1);
        parts[part][1]++;
    }
    for (uint32_t s = 0; s < SUBSETS; s++)
        for (uint32_t t = 0; t < triangles; t++)
            if (!(fabs(counts[s][t] - POINTS * cells[t][0] / total) < 2)) fail_msg("subset %u: %u points on triangle %u, its share are %.2f", s, counts[s][t], t, POINTS * cells[t][0] / total);
    for (uint32_t t = 0; t < triangles; t++) cells[t][0] *= POINTS * SUBSETS / total;
    for (int a = 0; a < PARTS; a++)
        for (int b = 0; b < PARTS; b++)
            for (int upper = 0; upper < 2; upper++) parts[2 * (a * PARTS + b) + upper][0] = a + b + upper < PARTS ? POINTS * SUBSETS / (double)(PARTS * PARTS) : 0;
    double on_triangles = chi_square_deviate(cells, (int)triangles, NULL), within = chi_square_deviate(parts, 2 * PARTS * PARTS, NULL);
    /* stratified points and lattices scatter much less than random ones */
    if (!(on_triangles < -3)) fail_msg("numbers per triangle: chi-square %.2f deviations", on_triangles);
    if (!(within < -3)) fail_msg("places in triangles: chi-square %.2f deviations", within);
    es_scene_points_free(w.context, &points);
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_warp),
        cmocka_unit_test(test_halton_boxes),
        cmocka_unit_test(test_scene_points),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
