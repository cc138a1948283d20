/* Interpolation of edited directions (gi/edit/edit.h): exact at constraints, smooth between them, as it was outside of regions. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/edit/edit.h"
#include "gi/edit/turn.h"
#include "gi/kernels/edited_lobe_simd.h"
#include "gi/kernels/rotation_simd.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(77, counter++)); }
static es_vec3 direction(void)
{
    for (;;) {
        const es_vec3 d = es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
        const float length = es_v3_length(d);
        if (length > 0.1f && length < 1.0f) return es_v3_scale(d, 1.0f / length);
    }
}

/* ---- the nearest rotation ------------------------------------------------------------------------------------------------------ */

static double nearness(const double r[9], const double m[9])
{
    double sum = 0.0;
    for (int i = 0; i < 9; i++) sum += r[i] * m[i];
    return sum;
}

/* The largest eigenvalue of Horn's 4 × 4 matrix in double, by Jacobi's rotations: what tr(Rᵀ M) is at most. */
static double most(const double m[9])
{
    double n[4][4] = {{m[0] + m[4] + m[8], m[7] - m[5], m[2] - m[6], m[3] - m[1]}, {0, m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6]}, {0, 0, m[4] - m[0] - m[8], m[5] + m[7]}, {0, 0, 0, m[8] - m[0] - m[4]}};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < i; k++) n[i][k] = n[k][i];
    for (int sweep = 0; sweep < 30; sweep++)
        for (int p = 0; p < 4; p++)
            for (int q = p + 1; q < 4; q++) {
                if (fabs(n[p][q]) < 1e-300) continue;
                const double theta = (n[q][q] - n[p][p]) / (2.0 * n[p][q]), t = (theta < 0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0)), c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                for (int k = 0; k < 4; k++) {
                    const double a = n[k][p], b = n[k][q];
                    n[k][p] = c * a - s * b;
                    n[k][q] = s * a + c * b;
                }
                for (int k = 0; k < 4; k++) {
                    const double a = n[p][k], b = n[q][k];
                    n[p][k] = c * a - s * b;
                    n[q][k] = s * a + c * b;
                }
            }
    double largest = n[0][0];
    for (int i = 1; i < 4; i++) largest = n[i][i] > largest ? n[i][i] : largest;
    return largest;
}

static void nearest(const float m[9], double r[9])
{
    es_matrix3_v of;
    for (int i = 0; i < 9; i++) of.at[i] = vf_set1(m[i]);
    const es_matrix3_v rotation = es_nearest_rotation_v(&of);
    for (int i = 0; i < 9; i++) r[i] = (double)rotation.at[i][0];
}

static void expect_rotation(const double r[9])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const double dot = r[3 * i] * r[3 * k] + r[3 * i + 1] * r[3 * k + 1] + r[3 * i + 2] * r[3 * k + 2];
            assert_true(fabs(dot - (i == k)) < 2e-6);
        }
    const double det = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) + r[2] * (r[3] * r[7] - r[4] * r[6]);
    assert_true(fabs(det - 1.0) < 1e-5);
}

static void test_nearest_rotation(void** state)
{
    (void)state;
    for (int i = 0; i < 20000; i++) {
        float m[9];
        double in_double[9], r[9];
        const float scale = es_exp2(uniform(-30, 30));
        for (int k = 0; k < 9; k++) in_double[k] = (double)(m[k] = scale * uniform(-1, 1));
        nearest(m, r);
        expect_rotation(r);
        double norm = 0.0;
        for (int k = 0; k < 9; k++) norm += in_double[k] * in_double[k];
        /* the loss is of second order in the rotation's error */
        assert_true(nearness(r, in_double) > most(in_double) - 3e-6 * sqrt(norm));
    }
}

static void test_rotation_is_its_own_nearest(void** state)
{
    (void)state;
    for (int i = 0; i < 2000; i++) {
        const es_vec3 a = direction(), b = es_v3_normalize(es_v3_cross(a, direction()), es_v3(0, 1, 0)), c = es_v3_cross(a, b);
        const float m[9] = {a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z};
        double r[9];
        nearest(m, r);
        for (int k = 0; k < 9; k++) assert_true(fabs(r[k] - (double)m[k]) < 2e-6);
    }
}

static void test_rotation_of_odd_matrices(void** state)
{
    (void)state;
    const float of[][9] = {{0}, {1e-25f}, {-1, 0, 0, 0, -1, 0, 0, 0, -1}, {1, 0, 0}, {0, 0, 0, 0, -1}, {1, 1, 1, 1, 1, 1, 1, 1, 1}, {1e15f, 0, 0, 0, 1e-15f}, {0, -1, 0, 1}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        double r[9];
        nearest(of[i], r);
        expect_rotation(r);
    }
    double r[9];
    nearest(of[0], r);
    for (int k = 0; k < 9; k++) assert_true(r[k] == (k % 4 == 0 ? 1.0 : 0.0));
}

/* Alone and on eight lanes: `from` becomes `to`, also where they are opposite, and lengths stay. Within 1e-3 of opposite the arc has no axis to speak of. */
static void test_turning(void** state)
{
    (void)state;
    for (int i = 0; i < 2000; i++) {
        const es_vec3 from = direction(), to = i % 4 ? direction() : es_v3_scale(from, -1.0f), v = direction(), turned = es_turned(v, from, to);
        const es_vec3 end = es_turned(from, from, to);
        assert_true(fabsf(es_v3_length(turned) - 1.0f) < 1e-5f);
        if (i % 4 == 0 || es_v3_dot(from, to) > -0.999f) assert_true(es_v3_length(es_v3_sub(end, to)) < 1e-4f);
        const vf a[3] = {vf_set1(from.x), vf_set1(from.y), vf_set1(from.z)}, b[3] = {vf_set1(to.x), vf_set1(to.y), vf_set1(to.z)};
        vf x[3] = {vf_set1(v.x), vf_set1(v.y), vf_set1(v.z)};
        es_turn_v(a, b, x);
        assert_true(es_v3_length(es_v3_sub(turned, es_v3(x[0][0], x[1][0], x[2][0]))) < 1e-3f);
    }
}

/* ---- the field ------------------------------------------------------------------------------------------------------------------- */

enum { SIZE = 96 };

/* A wall at z = 0, 2 m × 2 m, each point a pixel seen along -z, with directions r of its own. */
typedef struct wall {
    es_context* context;
    es_gbuffer gbuffer;
    float* planes[6];
    es_edit_job job;
} wall;

static wall new_wall(void)
{
    wall w = {0};
    const es_context_desc desc = {.threads = 2};
    assert_int_equal(es_context_create(&desc, &w.context), ES_OK);
    assert_int_equal(es_gbuffer_create(w.context, SIZE, SIZE, ES_GBUFFER_ALL, &w.gbuffer), ES_OK);
    for (int k = 0; k < 6; k++) w.planes[k] = calloc((size_t)w.gbuffer.stride * SIZE, sizeof(float));
    const es_raster_view view = es_orthographic_view(SIZE, SIZE, es_v3(0, 0, 1), es_v3(0, 0, -1), es_v3(0, 1, 0), 1, 1, 0.1f, 10);
    w.job = (es_edit_job){.rays = es_pixel_rays_of_view(&view)};
    for (uint32_t i = 0; i < w.gbuffer.stride * SIZE; i++) {
        w.gbuffer.depth[i] = 1.0f;
        w.gbuffer.instance[i] = 1;
        w.gbuffer.triangle[i] = 1;
        w.gbuffer.normal[i] = es_pack_normal(es_v3(0, 0, 1));
    }
    for (int k = 0; k < 3; k++) w.job.edited[k] = w.planes[k];
    return w;
}

static void free_wall(wall* w)
{
    for (int k = 0; k < 6; k++) free(w->planes[k]);
    es_gbuffer_destroy(w->context, &w->gbuffer);
    es_context_destroy(w->context);
}

static es_vec3 at(const wall* w, uint32_t x, uint32_t y)
{
    const size_t i = (size_t)y * w->gbuffer.stride + x;
    return es_v3(w->planes[0][i], w->planes[1][i], w->planes[2][i]);
}
static es_vec3 place(uint32_t x, uint32_t y) { return es_v3(((float)x + 0.5f) * 2.0f / SIZE - 1.0f, 1.0f - ((float)y + 0.5f) * 2.0f / SIZE, 0); }

static es_edit_constraint constraint(es_vec3 p, es_vec3 r, es_vec3 e)
{
    es_edit_constraint c = {.position = {p.x, p.y, p.z}};
    es_edit_constraint_matrix(r, e, c.matrix);
    return c;
}
static es_edit_region ball(float x, float y, float radius, float border, const es_edit_constraint* constraints, uint32_t count)
{
    return (es_edit_region){.shape = ES_EDIT_BALL, .centre = {x, y, 0}, .radius = radius, .border = border, .ball = {x, y, 0, radius * radius}, .constraints = constraints, .constraint_count = count};
}
static float angle_between(es_vec3 a, es_vec3 b) { return (float)atan2((double)es_v3_length(es_v3_cross(a, b)), (double)es_v3_dot(a, b)); }

static void run(wall* w, const es_edit_region* regions, uint32_t count)
{
    w->job.gbuffer = &w->gbuffer;
    w->job.regions = regions;
    w->job.region_count = count;
    es_edit_directions(w->context, &w->job);
}

static const es_vec3 towards = {0, 0, 1};

/* Whatever the number of constraints, at the pixel under each the direction is its own. */
static void test_exact_at_constraints(void** state)
{
    (void)state;
    wall w = new_wall();
    for (uint32_t count = 1; count <= 32; count++) {
        es_edit_constraint constraints[32];
        es_vec3 edited[32];
        uint32_t x[32], y[32];
        for (uint32_t i = 0; i < count; i++) {
            x[i] = 8 + (i * 37) % 80;
            y[i] = 8 + (i * 53) % 80;
            edited[i] = direction();
            constraints[i] = constraint(place(x[i], y[i]), towards, edited[i]);
        }
        const es_edit_region region = ball(0, 0, 3, 1, constraints, count);
        run(&w, &region, 1);
        for (uint32_t i = 0; i < count; i++) assert_true(angle_between(at(&w, x[i], y[i]), edited[i]) < 2e-5f);
    }
    free_wall(&w);
}

static void test_one_constraint_turns_alike(void** state)
{
    (void)state;
    wall w = new_wall();
    for (int n = 0; n < 20; n++) {
        const es_vec3 e = n == 0 ? es_v3(0, 0, -1) : n == 1 ? towards : n == 2 ? es_v3_normalize(es_v3(1e-4f, 0, -1), towards) : direction();
        const es_edit_constraint one = constraint(es_v3(0.3f, 0.1f, 0), towards, e);
        const es_edit_region region = ball(0, 0, 3, 0, &one, 1);
        run(&w, &region, 1);
        for (uint32_t y = 0; y < SIZE; y += 7)
            for (uint32_t x = 0; x < SIZE; x += 7) assert_true(angle_between(at(&w, x, y), e) < 2e-5f);
    }
    free_wall(&w);
}

/* Outside of regions nothing is edited; within their borders the direction goes from r to R r, and no step between pixels is larger than a few times the
 * whole turn over the pixels that it takes. */
static void test_borders(void** state)
{
    (void)state;
    wall w = new_wall();
    const es_vec3 e = es_v3_normalize(es_v3(1, 0.3f, 0.4f), towards);
    const es_edit_constraint one = constraint(es_v3(0, 0, 0), towards, e);
    const es_edit_region region = ball(0, 0, 0.8f, 0.4f, &one, 1);
    run(&w, &region, 1);
    const float whole = angle_between(towards, e), pixels = 0.4f / (2.0f / SIZE);
    for (uint32_t y = 0; y < SIZE; y++) {
        es_vec3 last = towards;
        for (uint32_t x = 0; x < SIZE; x++) {
            const es_vec3 p = place(x, y), d = at(&w, x, y);
            const float distance = es_v3_length(p);
            if (distance >= 0.8f) assert_true(d.x == 0.0f && d.y == 0.0f && d.z == 0.0f);
            if (distance < 0.4f) assert_true(angle_between(d, e) < 2e-5f);
            const es_vec3 now = es_v3_dot(d, d) > 0.0f ? d : towards;
            assert_true(fabsf(es_v3_length(now) - 1.0f) < 1e-5f);
            assert_true(angle_between(last, now) < 4.0f * whole / pixels);
            assert_true(angle_between(towards, now) < whole + 1e-4f);
            last = now;
        }
    }
    free_wall(&w);
}

/* Between two constraints the direction turns evenly: never more than a few times the whole difference over the pixels between. */
static void test_smooth_between(void** state)
{
    (void)state;
    wall w = new_wall();
    const es_vec3 a = es_v3_normalize(es_v3(0.6f, 0, 1), towards), b = es_v3_normalize(es_v3(-0.2f, 0.7f, 1), towards);
    const es_edit_constraint two[2] = {constraint(place(20, 48), towards, a), constraint(place(75, 48), towards, b)};
    const es_edit_region region = ball(0, 0, 3, 0, two, 2);
    run(&w, &region, 1);
    const float whole = angle_between(a, b);
    for (uint32_t x = 0; x + 1 < SIZE; x++) assert_true(angle_between(at(&w, x, 48), at(&w, x + 1, 48)) < 3.0f * whole / 55.0f);
    assert_true(angle_between(at(&w, 47, 48), at(&w, 48, 48)) > 0.0f);
    free_wall(&w);
}

/* Constraints that coincide, contradict or lie behind the surface. */
static void test_contradictions(void** state)
{
    (void)state;
    wall w = new_wall();
    const es_vec3 p = place(48, 48), a = es_v3_normalize(es_v3(1, 0, 1), towards), b = es_v3_normalize(es_v3(-1, 0, 1), towards);
    const es_edit_constraint cases[][3] = {
        {constraint(p, towards, a), constraint(p, towards, a), constraint(p, towards, a)},
        {constraint(p, towards, a), constraint(p, towards, b), constraint(p, towards, towards)},
        {constraint(p, towards, a), constraint(place(10, 10), towards, es_v3_scale(a, -1.0f)), constraint(place(90, 10), towards, es_v3(0, 0, -1))},
        {constraint(p, towards, es_v3(0, 0, -1)), constraint(p, towards, es_v3(0, 0, -1)), constraint(p, towards, towards)},
        {constraint(es_v3(p.x, p.y, -0.5f), towards, a), constraint(es_v3(p.x, p.y, 0.5f), towards, b), constraint(es_v3(1e6f, 0, 0), towards, a)},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const es_edit_region region = ball(0, 0, 3, 1, cases[i], 3);
        run(&w, &region, 1);
        for (uint32_t y = 0; y < SIZE; y++)
            for (uint32_t x = 0; x < SIZE; x++) assert_true(fabsf(es_v3_length(at(&w, x, y)) - 1.0f) < 1e-5f);
        if (i == 0) assert_true(angle_between(at(&w, 48, 48), a) < 2e-5f);
        /* those that contradict each other symmetrically come to their middle */
        if (i == 1) assert_true(angle_between(at(&w, 48, 48), towards) < 1e-3f);
    }
    free_wall(&w);
}

/* Two regions that overlap are weighed by their influence; far from the other one each is by itself. */
static void test_regions_merge(void** state)
{
    (void)state;
    wall w = new_wall();
    const es_vec3 a = es_v3_normalize(es_v3(0.5f, 0, 1), towards), b = es_v3_normalize(es_v3(-0.5f, 0, 1), towards);
    const es_edit_constraint of_a = constraint(es_v3(-0.4f, 0, 0), towards, a), of_b = constraint(es_v3(0.4f, 0, 0), towards, b);
    const es_edit_region regions[2] = {ball(-0.4f, 0, 0.6f, 0.3f, &of_a, 1), ball(0.4f, 0, 0.6f, 0.3f, &of_b, 1)};
    run(&w, regions, 2);
    assert_true(angle_between(at(&w, 29, 48), a) < 2e-5f);
    assert_true(angle_between(at(&w, 66, 48), b) < 2e-5f);
    const es_vec3 left = at(&w, 47, 48), right = at(&w, 48, 48);
    assert_true(fabsf(left.x + right.x) < 1e-4f && fabsf(left.z - right.z) < 1e-4f);
    for (uint32_t x = 0; x + 1 < SIZE; x++) {
        const es_vec3 here = at(&w, x, 48), next = at(&w, x + 1, 48);
        if (es_v3_dot(here, here) > 0.0f && es_v3_dot(next, next) > 0.0f) assert_true(angle_between(here, next) < 0.2f);
    }
    free_wall(&w);
}

static void test_strokes(void** state)
{
    (void)state;
    wall w = new_wall();
    const es_vec3 e = es_v3_normalize(es_v3(0.5f, 0.5f, 1), towards);
    const es_edit_constraint one = constraint(es_v3(0, 0, 0), towards, e);
    const es_edit_stroke strokes[2] = {{{-0.7f, 0, 0}, {0.7f, 0, 0}, 0.2f, false}, {{0, 0, 0}, {0, 0, 0}, 0.1f, true}};
    es_edit_region region = {.shape = ES_EDIT_STROKES, .border = 0.05f, .radius = 1, .ball = {0, 0, 0, 1}, .strokes = strokes, .stroke_count = 2, .constraints = &one, .constraint_count = 1};
    for (int turn = 0; turn < 2; turn++) {
        region.instance = turn ? 2 : 1;
        run(&w, &region, 1);
        for (uint32_t y = 0; y < SIZE; y++)
            for (uint32_t x = 0; x < SIZE; x++) {
                const es_vec3 p = place(x, y), d = at(&w, x, y);
                const float along = es_maxf(fabsf(p.x) - 0.7f, 0.0f), signed_distance = es_maxf(sqrtf(along * along + p.y * p.y) - 0.2f, 0.1f - es_v3_length(p));
                if (turn || signed_distance > 1e-4f) assert_true(es_v3_dot(d, d) == 0.0f);
                else if (signed_distance < -0.0501f) assert_true(angle_between(d, e) < 2e-5f);
            }
    }
    assert_true(es_edit_influence(&region, es_v3(0.5f, 0, 0), 2, 0) == 1.0f);
    assert_true(es_edit_influence(&region, es_v3(0, 0.05f, 0), 2, 0) == 0.0f);
    assert_true(es_edit_influence(&region, es_v3(0.5f, 0.175f, 0), 2, 0) > 0.4f);
    free_wall(&w);
}

/* On a mesh of two triangles with exact distances at its four corners, a geodesic region is the ball that lies in its plane. */
static void test_geodesic(void** state)
{
    (void)state;
    wall w = new_wall();
    const float positions[4 * 4] = {-2, -2, 0, 1, 2, -2, 0, 1, 2, 2, 0, 1, -2, 2, 0, 1};
    const uint32_t indices[8] = {0, 1, 2, 0, 2, 3};
    float distances[4], of_constraint[4];
    const es_vec3 centre = es_v3(0.25f, -0.1f, 0), p = place(60, 40), e = es_v3_normalize(es_v3(0.5f, 0.5f, 1), towards), other = es_v3_normalize(es_v3(-0.5f, 0.5f, 1), towards);
    for (int i = 0; i < 4; i++) {
        const es_vec3 corner = es_v3(0.5f * positions[4 * i], 0.5f * positions[4 * i + 1], 0);
        distances[i] = es_v3_length(es_v3_sub(corner, centre));
        of_constraint[i] = es_v3_length(es_v3_sub(corner, p));
    }
    es_mat4 half = {{0}};
    half.m[0] = half.m[5] = half.m[10] = 0.5f;
    half.m[15] = 1.0f;
    for (uint32_t y = 0; y < SIZE; y++)
        for (uint32_t x = 0; x < SIZE; x++) w.gbuffer.triangle[(size_t)y * w.gbuffer.stride + x] = place(x, y).y <= place(x, y).x ? 1 : 2;
    es_edit_constraint constraints[2] = {constraint(p, towards, e), constraint(es_v3(0, -0.3f, 0), towards, other)}, in_space[2];
    memcpy(in_space, constraints, sizeof in_space);
    constraints[0].distances = of_constraint;
    es_edit_region region = ball(centre.x, centre.y, 0.6f, 0.2f, constraints, 2);
    const es_edit_region flat = ball(centre.x, centre.y, 0.6f, 0.2f, in_space, 2);
    run(&w, &flat, 1);
    float* flat_planes[3];
    const size_t bytes = (size_t)w.gbuffer.stride * SIZE * sizeof(float);
    for (int k = 0; k < 3; k++) flat_planes[k] = memcpy(malloc(bytes), w.planes[k], bytes);
    region.shape = ES_EDIT_GEODESIC;
    region.distances = distances;
    region.mesh = (es_edit_mesh){1, positions, indices, half};
    run(&w, &region, 1);
    for (uint32_t y = 0; y < SIZE; y++)
        for (uint32_t x = 0; x < SIZE; x++)
            for (int k = 0; k < 3; k++) {
                const size_t i = (size_t)y * w.gbuffer.stride + x;
                assert_true(fabsf(w.planes[k][i] - flat_planes[k][i]) < 2e-3f);
            }
    assert_true(angle_between(at(&w, 60, 40), e) < 1e-3f);
    for (int k = 0; k < 3; k++) free(flat_planes[k]);
    free_wall(&w);
}

static void test_frozen_and_given_directions(void** state)
{
    (void)state;
    wall w = new_wall();
    w.job.frozen = true;
    w.job.eye[0] = 0.5f;
    w.job.eye[2] = 2.0f;
    run(&w, NULL, 0);
    for (uint32_t x = 0; x < SIZE; x += 5) {
        const es_vec3 i = es_v3_normalize(es_v3_sub(place(x, 30), es_v3(0.5f, 0, 2)), towards);
        assert_true(angle_between(at(&w, x, 30), es_v3(i.x, i.y, -i.z)) < 1e-5f);
    }
    w.job.frozen = false;
    const es_vec3 r = es_v3_normalize(es_v3(0.2f, 0.1f, -1), towards), e = es_v3_normalize(es_v3(-0.4f, 0, -1), towards);
    for (int k = 0; k < 3; k++) w.job.original[k] = w.planes[3 + k];
    for (uint32_t i = 0; i < w.gbuffer.stride * SIZE; i++) {
        const bool there = i % w.gbuffer.stride < 48;
        w.planes[3][i] = there ? r.x : 0.0f;
        w.planes[4][i] = there ? r.y : 0.0f;
        w.planes[5][i] = there ? r.z : 0.0f;
    }
    const es_edit_constraint one = constraint(es_v3(0, 0, 0), r, e);
    const es_edit_region region = ball(0, 0, 3, 0, &one, 1);
    run(&w, &region, 1);
    assert_true(angle_between(at(&w, 10, 10), e) < 2e-5f);
    assert_true(es_v3_dot(at(&w, 60, 10), at(&w, 60, 10)) == 0.0f);
    free_wall(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nearest_rotation),
        cmocka_unit_test(test_rotation_is_its_own_nearest),
        cmocka_unit_test(test_rotation_of_odd_matrices),
        cmocka_unit_test(test_turning),
        cmocka_unit_test(test_exact_at_constraints),
        cmocka_unit_test(test_one_constraint_turns_alike),
        cmocka_unit_test(test_borders),
        cmocka_unit_test(test_smooth_between),
        cmocka_unit_test(test_contradictions),
        cmocka_unit_test(test_regions_merge),
        cmocka_unit_test(test_strokes),
        cmocka_unit_test(test_geodesic),
        cmocka_unit_test(test_frozen_and_given_directions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
