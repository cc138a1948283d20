/* Distances over surfaces: straight lines on planes whatever their triangles, arcs on spheres, unrolled cylinders, islands, seams, edges of many triangles,
 * triangles without area; the same bits on every machine; and how they are kept. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/maths.h"
#include "platform/random.h"
#include "sim/sim.h"
#include "tests/same_bits.h"

typedef struct soup { float* positions; uint32_t* indices; uint32_t vertices, triangles; } soup;

static soup soup_of(uint32_t vertices, uint32_t triangles)
{
    return (soup){calloc((size_t)vertices * 3 + 3, sizeof(float)), calloc((size_t)triangles * 3 + 3, sizeof(uint32_t)), vertices, triangles};
}

static void soup_free(soup* s)
{
    free(s->positions);
    free(s->indices);
}

typedef struct scene { es_context* context; es_world* world; es_mesh mesh; es_node node; es_instance instance; } scene;

static scene scene_in(es_context* context, const soup* s, const es_transform* transform)
{
    scene c = {.context = context};
    assert_int_equal(es_world_create(c.context, NULL, &c.world), ES_OK);
    es_mesh_desc desc = {.vertex_count = s->vertices, .triangle_count = s->triangles, .positions = s->positions, .indices = s->indices};
    assert_int_equal(es_world_add_mesh(c.world, &desc, &c.mesh), ES_OK);
    assert_int_equal(es_world_add_node(c.world, &(es_node_desc){.transform = transform ? *transform : es_identity_transform()}, &c.node), ES_OK);
    assert_int_equal(es_world_add_instance(c.world, &(es_instance_desc){.node = c.node, .mesh = c.mesh}, &c.instance), ES_OK);
    return c;
}

static scene scene_of(const soup* s, const es_transform* transform)
{
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return scene_in(context, s, transform);
}

static void scene_close(scene* c)
{
    es_world_destroy(c->world);
    assert_int_equal(es_context_bytes(c->context), 0);
    es_context_destroy(c->context);
}

static float* field_of(const scene* c, const soup* s, uint32_t triangle, float u, float v, es_geodesic_method method, float max)
{
    float* d = malloc((s->vertices + 1) * sizeof *d);
    assert_int_equal(es_world_geodesic(c->world, c->instance, triangle, u, v, method, max, d), ES_OK);
    return d;
}

static void place_on(const soup* s, uint32_t triangle, float u, float v, double place[3])
{
    const double w[3] = {1.0 - (double)u - (double)v, u, v};
    for (int k = 0; k < 3; k++) {
        place[k] = 0;
        for (int c = 0; c < 3; c++) place[k] += w[c] * (double)s->positions[3 * (size_t)s->indices[3 * (size_t)triangle + c] + k];
    }
}

/* n × n quadrilaterals of 1 m², their inner corners moved by up to `shift` of a cell, a quarter at most: beyond, triangles would turn over. */
static soup plane(uint32_t n, float shift)
{
    soup s = soup_of((n + 1) * (n + 1), 2 * n * n);
    for (uint32_t i = 0; i <= n; i++)
        for (uint32_t k = 0; k <= n; k++) {
            float* p = s.positions + 3 * (size_t)(i * (n + 1) + k);
            bool inner = i > 0 && k > 0 && i < n && k < n;
            uint32_t id = i * (n + 1) + k;
            p[0] = ((float)k + (inner ? shift * (2 * es_random_float(1, id) - 1) : 0)) / (float)n;
            p[2] = ((float)i + (inner ? shift * (2 * es_random_float(2, id) - 1) : 0)) / (float)n;
        }
    for (uint32_t i = 0, t = 0; i < n; i++)
        for (uint32_t k = 0; k < n; k++) {
            const uint32_t a = i * (n + 1) + k, b = a + 1, c = a + n + 1, d = c + 1, turned = es_random_u32(3, t) & 1;
            const uint32_t corners[2][6] = {{a, c, b, b, c, d}, {a, c, d, a, d, b}};
            memcpy(s.indices + 3 * (size_t)t, corners[turned], sizeof corners[0]);
            t += 2;
        }
    return s;
}

static void test_planes_are_exact(void** state)
{
    for (int shape = 0; shape < 3; shape++) {
        soup s = plane(60, shape == 0 ? 0 : 0.25f);
        const float wide = shape == 2 ? 12 : 2; /* angles up to nearly 180 degrees */
        es_transform turned = {{3, -2, 100}, es_quat_from_axis_angle(es_v3_normalize(es_v3(1, 2, 3), es_v3(0, 1, 0)), 1), {wide, 2, 2}};
        scene c = scene_of(&s, &turned);
        static const struct { uint32_t triangle; float u, v; } sources[] = {{3600, 0.2f, 0.3f}, {0, 0, 0}, {7199, 0.5f, 0.5f}, {2000, 1, 0}};
        for (size_t i = 0; i < sizeof sources / sizeof sources[0]; i++) {
            float* d = field_of(&c, &s, sources[i].triangle, sources[i].u, sources[i].v, ES_GEODESIC_FRONT, 0);
            double from[3], worst = 0;
            place_on(&s, sources[i].triangle, sources[i].u, sources[i].v, from);
            for (uint32_t v = 0; v < s.vertices; v++) {
                const float* p = s.positions + 3 * (size_t)v;
                double exact = hypot(wide * ((double)p[0] - from[0]), 2 * ((double)p[2] - from[2])), error = fabs((double)d[v] - exact);
                if (error > worst) worst = error;
            }
            if (worst > 2e-5 * wide) fail_msg("plane %d from %zu: off by %g m of %g", shape, i, worst, 1.4 * wide);
            free(d);
        }
        scene_close(&c);
        soup_free(&s);
    }
}

static soup sphere(uint32_t n)
{
    /* a cube's faces of n × n, projected: vertices of edges are there once per face, as seams have them */
    soup s = soup_of(6 * (n + 1) * (n + 1), 12 * n * n);
    uint32_t v = 0, t = 0;
    for (int face = 0; face < 6; face++) {
        const uint32_t first = v;
        for (uint32_t i = 0; i <= n; i++)
            for (uint32_t k = 0; k <= n; k++, v++) {
                /* tangents at the same places seen from either face, so that the bits of an edge are the same */
                double a = tan(0.25 * 3.14159265358979 * (2.0 * k / n - 1)), b = tan(0.25 * 3.14159265358979 * (2.0 * i / n - 1)), sign = face & 1 ? -1 : 1, p[3];
                if (k == 0 || k == n) a = k ? 1 : -1;
                if (i == 0 || i == n) b = i ? 1 : -1;
                p[face / 2] = sign;
                p[(face / 2 + 1) % 3] = face & 1 ? b : a;
                p[(face / 2 + 2) % 3] = face & 1 ? a : b;
                double squares[3] = {p[0] * p[0], p[1] * p[1], p[2] * p[2]}, low = fmin(squares[0], fmin(squares[1], squares[2])), high = fmax(squares[0], fmax(squares[1], squares[2]));
                double middle = fmax(fmin(squares[0], squares[1]), fmin(fmax(squares[0], squares[1]), squares[2]));
                double length = sqrt(low + middle + high);
                for (int c = 0; c < 3; c++) s.positions[3 * (size_t)v + c] = (float)(p[c] / length);
            }
        for (uint32_t i = 0; i < n; i++)
            for (uint32_t k = 0; k < n; k++, t += 2) {
                const uint32_t a = first + i * (n + 1) + k, corners[6] = {a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1};
                memcpy(s.indices + 3 * (size_t)t, corners, sizeof corners);
            }
    }
    return s;
}

static void sphere_error(uint32_t n, es_geodesic_method method, double* mean, double* most)
{
    soup s = sphere(n);
    scene c = scene_of(&s, NULL);
    float* d = field_of(&c, &s, n * n / 2, 0.3f, 0.3f, method, 0);
    double from[3], sum = 0, length;
    place_on(&s, n * n / 2, 0.3f, 0.3f, from);
    length = sqrt(from[0] * from[0] + from[1] * from[1] + from[2] * from[2]);
    *most = 0;
    for (uint32_t v = 0; v < s.vertices; v++) {
        const float* p = s.positions + 3 * (size_t)v;
        double exact = 2 * asin(fmin(1, 0.5 * sqrt(pow(p[0] - from[0] / length, 2) + pow(p[1] - from[1] / length, 2) + pow(p[2] - from[2] / length, 2))));
        double error = fabs((double)d[v] - exact);
        assert_true(isfinite(d[v]));
        sum += error;
        *most = fmax(*most, error);
    }
    *mean = sum / s.vertices;
    free(d);
    scene_close(&c);
    soup_free(&s);
}

/* Error falls with the edges; the mesh itself is inside of the sphere and by so much shorter, about h² / 24 of its way. */
static void test_spheres_come_near(void** state)
{
    double mean[3], most[3], edges_mean, edges_most;
    for (int i = 0; i < 3; i++) sphere_error(8u << i, ES_GEODESIC_FRONT, &mean[i], &most[i]);
    sphere_error(32, ES_GEODESIC_EDGES, &edges_mean, &edges_most);
    print_message("radius 1: mean and largest error %.4f %.4f (768 triangles), %.4f %.4f (3072), %.4f %.4f (12288); along edges %.4f %.4f (12288)\n", mean[0], most[0], mean[1], most[1], mean[2], most[2], edges_mean, edges_most);
    assert_true(mean[2] < 0.01 && most[2] < 0.05 && mean[2] < mean[1] && mean[1] < mean[0]);
    assert_true(mean[2] < 0.1 * edges_mean);
}

/* A cylinder unrolls: the way round is the shorter of two straight lines. */
static void test_cylinders_unroll(void** state)
{
    const uint32_t around = 96, along = 60;
    soup s = soup_of(around * (along + 1), 2 * around * along);
    const double step = 2 * sin(3.14159265358979 / around); /* an edge round it, of radius 1 */
    for (uint32_t i = 0; i <= along; i++)
        for (uint32_t k = 0; k < around; k++) {
            float* p = s.positions + 3 * (size_t)(i * around + k);
            double angle = 2 * 3.14159265358979 * k / around;
            p[0] = (float)cos(angle);
            p[1] = (float)(i * step);
            p[2] = (float)sin(angle);
        }
    for (uint32_t i = 0, t = 0; i < along; i++)
        for (uint32_t k = 0; k < around; k++, t += 2) {
            const uint32_t a = i * around + k, b = i * around + (k + 1) % around, corners[6] = {a, a + around, b, b, a + around, b + around};
            memcpy(s.indices + 3 * (size_t)t, corners, sizeof corners);
        }
    scene c = scene_of(&s, NULL);
    float* d = field_of(&c, &s, 0, 0, 0, ES_GEODESIC_FRONT, 0); /* vertex 0 */
    double worst = 0;
    for (uint32_t v = 0; v < s.vertices; v++) {
        uint32_t k = v % around, i = v / around, across = k < around - k ? k : around - k;
        double exact = hypot(across * step, i * step);
        worst = fmax(worst, fabs((double)d[v] - exact));
    }
    /* exact but near the line opposite, where the fronts from both sides meet */
    print_message("cylinder of radius 1 and 3.9 m: largest error %.6f m\n", worst);
    assert_true(worst < 1e-3);
    free(d);
    scene_close(&c);
    soup_free(&s);
}

static void test_odd_meshes_end_without_harm(void** state)
{
    /* two islands; three triangles on one edge; triangles of a line, of a point and with two equal corners; a vertex of no triangle; needles */
    static const float positions[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5f, 0.5f, 1}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}, {2, 0, 0}, {9, 9, 9}, {0, 0, 0}, {1e-7f, 1, 0}, {0.5f, 1e-6f, 0}};
    static const uint32_t indices[] = {0, 1, 2, 1, 3, 2, 1, 2, 4, 5, 6, 7, 0, 1, 8, 1, 1, 3, 4, 4, 4, 10, 1, 2, 2, 11, 3, 0, 12, 1, 10, 11, 2, 0};
    soup s = soup_of(13, 11);
    memcpy(s.positions, positions, sizeof positions);
    memcpy(s.indices, indices, sizeof indices);
    scene c = scene_of(&s, NULL);
    for (int method = 0; method < 2; method++)
        for (uint32_t t = 0; t < s.triangles; t++) {
            float* d = field_of(&c, &s, t, 0.25f, 0.5f, (es_geodesic_method)method, 0);
            for (uint32_t v = 0; v < s.vertices; v++) assert_true(!isnan(d[v]) && d[v] >= 0);
            assert_true(isinf(d[9]));
            if (t == 3) assert_true(isinf(d[0]) && isinf(d[4]) && d[5] <= 1 && d[6] < 1.5f);
            if (t == 0) {
                if (!(d[3] <= 2 && d[4] < 3 && d[8] < 3)) fail_msg("method %d: %g %g %g, %g %g", method, (double)d[3], (double)d[4], (double)d[8], (double)d[5], (double)d[7]);
                assert_true(isinf(d[5]) && isinf(d[7]) && d[3] <= 2 && d[4] < 3 && d[8] < 3);
                assert_true(d[0] == d[10]); /* at one place */
            }
            free(d);
        }
    scene_close(&c);
    soup_free(&s);
}

static void test_bounded_fields_are_those_of_all(void** state)
{
    soup s = plane(50, 0.25f);
    scene c = scene_of(&s, NULL);
    for (int method = 0; method < 2; method++) {
        float *all = field_of(&c, &s, 2500, 0.1f, 0.1f, (es_geodesic_method)method, 0), *near = field_of(&c, &s, 2500, 0.1f, 0.1f, (es_geodesic_method)method, 0.2f);
        for (uint32_t v = 0; v < s.vertices; v++) {
            if (all[v] <= 0.2f) assert_true(near[v] == all[v]);
            else if (all[v] > 0.2001f) assert_true(isinf(near[v]));
        }
        free(all);
        free(near);
    }
    scene_close(&c);
    soup_free(&s);
}

static void test_between_is_exact_on_a_triangle(void** state)
{
    const double a[2] = {0, 0}, b[2] = {3, 0}, c[2] = {1, 2}, source[2] = {-4, 7};
    const float d[3] = {(float)hypot(source[0] - a[0], source[1] - a[1]), (float)hypot(source[0] - b[0], source[1] - b[1]), (float)hypot(source[0] - c[0], source[1] - c[1])};
    const float edges[3] = {9, 8, 5};
    for (uint32_t i = 0; i < 200; i++) {
        float u = es_random_float(7, i), v = es_random_float(8, i) * (1 - u);
        double x = u * b[0] + v * c[0], y = v * c[1];
        assert_true(fabs((double)es_geodesic_between(d, edges, u, v) - hypot(source[0] - x, source[1] - y)) < 1e-5);
    }
    const float far[3] = {1, 2, INFINITY};
    assert_true(isinf(es_geodesic_between(far, edges, 0.2f, 0.2f)));
}

static void test_scale_counts(void** state)
{
    soup s = plane(20, 0.2f);
    es_transform stretched = {{0, 0, 0}, {0, 0, 0, 1}, {3, 5, 0.5f}};
    scene c = scene_of(&s, &stretched);
    float* d = field_of(&c, &s, 400, 0.3f, 0.3f, ES_GEODESIC_FRONT, 0);
    double from[3];
    place_on(&s, 400, 0.3f, 0.3f, from);
    for (uint32_t v = 0; v < s.vertices; v++) {
        const float* p = s.positions + 3 * (size_t)v;
        double exact = hypot(3 * ((double)p[0] - from[0]), 0.5 * ((double)p[2] - from[2]));
        assert_true(fabs((double)d[v] - exact) < 1e-4);
    }
    free(d);
    /* a flattened mesh, and one of no size */
    for (int flat = 0; flat < 2; flat++) {
        es_transform t = {{0, 0, 0}, {0, 0, 0, 1}, flat ? es_v3(0, 0, 0) : es_v3(1, 1, 0)};
        assert_int_equal(es_world_set_node_transform(c.world, c.node, &t), ES_OK);
        d = field_of(&c, &s, 400, 0.3f, 0.3f, ES_GEODESIC_FRONT, 0);
        for (uint32_t v = 0; v < s.vertices; v++) assert_true(d[v] >= 0 && d[v] <= 2);
        free(d);
    }
    scene_close(&c);
    soup_free(&s);
}

/* A cut from one edge nearly to the other: the way from side to side leads round its end. */
static void test_torn_cloth_is_gone_round(void** state)
{
    soup s = plane(20, 0);
    scene c = scene_of(&s, NULL);
    es_soft_desc desc = es_default_soft_desc();
    es_soft soft;
    es_soft_attachment held[441];
    for (uint32_t i = 0; i < 441; i++) held[i] = (es_soft_attachment){.vertex = i, .in_place = true};
    desc.mesh = c.mesh;
    desc.node = c.node;
    desc.tearable = true;
    desc.attachments = held;
    desc.attachment_count = 441;
    assert_int_equal(es_world_add_soft(c.world, &desc, &soft), ES_OK);
    const uint32_t count = es_world_mesh(c.world, c.mesh)->vertex_count; /* with those in reserve */
    float* d = malloc(count * sizeof *d);
    const uint32_t left = 9, right = 10; /* vertices of the first edge beside the cut, at x = 0.45 and 0.55; the cut is at 0.5 */
    for (int torn = 0; torn < 2; torn++) {
        uint32_t triangle = 0;
        const es_raster_mesh* mesh = es_world_mesh(c.world, c.mesh);
        while (mesh->indices[3 * triangle] != left && mesh->indices[3 * triangle + 1] != left && mesh->indices[3 * triangle + 2] != left) triangle++;
        const float u = mesh->indices[3 * triangle + 1] == left, v = mesh->indices[3 * triangle + 2] == left;
        assert_int_equal(es_world_geodesic(c.world, c.instance, triangle, u, v, ES_GEODESIC_FRONT, 0, d), ES_OK);
        const float across = d[right + 1];
        if (!torn) {
            assert_true(fabsf(across - 0.1f) < 1e-5f);
            for (int i = 0; i < 17; i++) assert_int_equal(es_world_soft_tear(c.world, soft, (const double[3]){0.5, 0, 0.05 * i}, 0.01f), ES_OK);
            assert_int_equal(es_world_step(c.world, 1.0f / 60), ES_OK);
        } else if (across < 1.5f || across > 2.5f) {
            fail_msg("across the tear it is %g m", (double)across);
        }
    }
    free(d);
    scene_close(&c);
    soup_free(&s);
}

static void test_bits_are_the_same_everywhere(void** state)
{
    soup s = sphere(24);
    same_bits same = {.most_threads = 3};
    for (es_context* context; (context = next_context(&same));) {
        scene c = scene_in(context, &s, NULL);
        for (int method = 0; method < 2; method++) {
            float* d = field_of(&c, &s, 1000, 0.3f, 0.2f, (es_geodesic_method)method, 0);
            expect_same_bits(&same, d, s.vertices * sizeof *d);
            free(d);
        }
        es_world_destroy(c.world);
        es_context_destroy(context);
    }
    soup_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_planes_are_exact),
        cmocka_unit_test(test_spheres_come_near),
        cmocka_unit_test(test_cylinders_unroll),
        cmocka_unit_test(test_odd_meshes_end_without_harm),
        cmocka_unit_test(test_bounded_fields_are_those_of_all),
        cmocka_unit_test(test_between_is_exact_on_a_triangle),
        cmocka_unit_test(test_scale_counts),
        cmocka_unit_test(test_torn_cloth_is_gone_round),
        cmocka_unit_test(test_bits_are_the_same_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
