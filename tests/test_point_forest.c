/* The hierarchy of points (gi/micro/forest.h): what its nodes enclose, what their rounding keeps, what moving, deforming and tearing change, and that
 * neither threads nor instruction sets do. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/micro/forest.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
enum { POINTS = 2048 };
#else
enum { POINTS = 32768 };
#endif

/* ---- scenes ---------------------------------------------------------------------------------------------------------------- */

enum { SIDE = 24, VERTICES = (SIDE + 1) * (SIDE + 1), TRIANGLES = 2 * SIDE * SIDE, INSTANCES = 5 };

typedef struct scene {
    float positions[2][4 * VERTICES], rest[4 * VERTICES], normals[4 * VERTICES];
    uint32_t indices[3 * TRIANGLES + 1];
    es_raster_mesh meshes[2];          /* a sheet that can be bent, and one that is not */
    es_material_desc materials[2];     /* the second is double-sided */
    es_raster_instance instances[INSTANCES];
    es_draw_list list;
} scene;

static void bend(scene* s, float height, uint64_t revision)
{
    for (int i = 0; i < VERTICES; i++) {
        const float x = s->rest[4 * i], z = s->rest[4 * i + 2];
        s->positions[0][4 * i] = x;
        s->positions[0][4 * i + 1] = height * es_sin(6 * x) * es_cos(5 * z);
        s->positions[0][4 * i + 2] = z;
        s->positions[0][4 * i + 3] = 1;
    }
    s->meshes[0].revision = revision;
}

static es_mat4 pose(float x, float angle, es_vec3 scale)
{
    return es_mat4_from_trs(es_v3(x, 0.3f * x, -x), es_quat_from_axis_angle(es_v3_normalize(es_v3(1, 2, 0.5f), es_v3(0, 1, 0)), angle), scale);
}

static scene* new_scene(void)
{
    scene* s = calloc(1, sizeof *s);
    assert_non_null(s);
    for (int i = 0; i < VERTICES; i++) {
        const float x = (float)(i % (SIDE + 1)) / SIDE - 0.5f, z = (float)(i / (SIDE + 1)) / SIDE - 0.5f;
        const float sheet[4] = {x, 0, z, 1}, dome[4] = {x, 0.4f - x * x - z * z, z, 1}, normal[4] = {2 * x, 1, 2 * z, 0};
        memcpy(s->rest + 4 * i, sheet, sizeof sheet);
        memcpy(s->positions[1] + 4 * i, dome, sizeof dome);
        memcpy(s->normals + 4 * i, normal, sizeof normal);
    }
    for (int i = 0, t = 0; i < SIDE * SIDE; i++) {
        const uint32_t a = (uint32_t)(i / SIDE * (SIDE + 1) + i % SIDE), corners[6] = {a, a + SIDE + 1, a + 1, a + 1, a + SIDE + 1, a + SIDE + 2};
        for (int k = 0; k < 6; k++) s->indices[t++] = corners[k];
    }
    s->meshes[0] = (es_raster_mesh){.positions = s->positions[0], .rest_positions = s->rest, .indices = s->indices, .vertex_count = VERTICES, .triangle_count = TRIANGLES};
    s->meshes[1] = (es_raster_mesh){.positions = s->positions[1], .normals = s->normals, .indices = s->indices, .vertex_count = VERTICES, .triangle_count = TRIANGLES, .revision = 1};
    bend(s, 0.1f, 2);
    for (int k = 0; k < 2; k++) s->materials[k] = es_default_material_desc();
    s->materials[0].base_color[0] = 0.25f;
    s->materials[0].emission[2] = 3.0f;
    s->materials[1].double_sided = true;
    const es_mat4 poses[INSTANCES] = {pose(0, 0.3f, es_v3(1, 1, 1)), pose(2, 1.0f, es_v3(2, 2, 2)), pose(-3, 2.0f, es_v3(-1, 1, 1)), pose(5, 0.7f, es_v3(1, 3, 0.2f)), pose(1, 0.0f, es_v3(0, 0, 0))};
    for (uint32_t i = 0; i < INSTANCES; i++)
        s->instances[i] = (es_raster_instance){.mesh = &s->meshes[i != 0], .material = i == 1, .id = 10 + i, .transform = poses[i], .previous_transform = poses[i]};
    s->list = (es_draw_list){s->instances, s->materials, INSTANCES, 2};
    return s;
}

static es_context* new_context(uint32_t threads, uint32_t isa_mask)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static es_forest_update bring(es_context* context, es_point_forest* forest, const scene* s, uint32_t points)
{
    es_forest_update update;
    const es_forest_request request = {points, 1.5f};
    assert_int_equal(es_forest_bring(context, forest, &s->list, 1, &request, &update), ES_OK);
    return update;
}

/* ---- structure --------------------------------------------------------------------------------------------------------------- */

typedef struct ball { double centre[3], radius, axis[3], sine; } ball; /* sine > 1: any way */

static ball float_ball(const es_point_node_float* n)
{
    ball b = {.radius = (double)n->radius, .sine = (double)n->sine};
    for (int k = 0; k < 3; k++) {
        b.centre[k] = (double)n->position[k];
        b.axis[k] = (double)n->axis[k];
    }
    return b;
}

static ball packed_ball(const es_point_tree* tree, const es_point_node* n)
{
    ball b = {.radius = (double)tree->radius_step * n->radius, .sine = (n->cone >> 20 & 63) == 63 ? 2.0 : pow((n->cone >> 20 & 63) / 62.0, 2)};
    for (int k = 0; k < 3; k++) b.centre[k] = (double)tree->low[k] + (double)tree->step[k] * n->position[k];
    double x = ((int)(n->cone & 1023) - 512) / 511.0, y = ((int)(n->cone >> 10 & 1023) - 512) / 511.0, z = 1.0 - fabs(x) - fabs(y);
    if (z < 0) {
        const double fold = -z;
        x -= copysign(fold, x);
        y -= copysign(fold, y);
    }
    const double length = sqrt(x * x + y * y + z * z);
    b.axis[0] = x / length;
    b.axis[1] = y / length;
    b.axis[2] = z / length;
    return b;
}

static double between(const double a[3], const double b[3])
{
    const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
    return atan2(sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

/* `slack`: metres and radians by which what is inside may stand out, for the rounding of this test's own sums. */
static void assert_encloses(const ball* outer, const ball* inner, double slack)
{
    if (inner->radius < 0) return;
    double square = 0;
    for (int k = 0; k < 3; k++) square += (outer->centre[k] - inner->centre[k]) * (outer->centre[k] - inner->centre[k]);
    assert_true(sqrt(square) + inner->radius <= outer->radius + slack);
    if (outer->sine > 1) return;
    assert_true(inner->sine <= 1);
    assert_true(between(outer->axis, inner->axis) + asin(inner->sine) <= asin(fmin(outer->sine, 1)) + slack);
}

static void check_tree(const es_point_forest* forest, const es_point_tree* tree)
{
    const es_point_node_float* nodes = forest->float_nodes + tree->first;
    const es_point_node* packed = forest->nodes + tree->first;
    const float* area = forest->area + tree->first;
    assert_int_equal(tree->leaf_count & (tree->leaf_count - 1), 0);
    const double extent = fabs((double)nodes[1].radius) + fabs((double)nodes[1].position[0]) + fabs((double)nodes[1].position[1]) + fabs((double)nodes[1].position[2]);
    for (uint32_t i = 1; i < 2 * tree->leaf_count; i++) {
        assert_true(isfinite(nodes[i].radius) && isfinite(nodes[i].sine) && isfinite(area[i]));
        const ball b = float_ball(&nodes[i]), p = packed_ball(tree, &packed[i]);
        if (nodes[i].radius < 0) {
            assert_int_equal(packed[i].radius, 0);
            assert_true(area[i] == 0);
        } else {
            assert_true(packed[i].radius > 0);
            assert_encloses(&p, &b, 1e-7 * extent);
            /* the stated error: of the radius no more than two steps and what the centre moved */
            assert_true(p.radius <= b.radius + 2.1 * (double)tree->radius_step + 1.8 * (double)fmaxf(tree->step[0], fmaxf(tree->step[1], tree->step[2])));
            const double slab = (double)nodes[i].slab / fmax((double)nodes[i].radius, 1e-30), thickness = (packed[i].cone >> 26) / 63.0;
            assert_true(slab <= 1.0 && (slab <= thickness + 1e-6 || (slab <= 1.0 / 4096 && thickness == 0)) && thickness <= slab + 1.0 / 63 + 1e-6);
            assert_true(p.sine > 1 || sqrt(p.sine) <= sqrt(b.sine + 5e-3) + 1.0 / 62 + 1e-6);
        }
        if (i < tree->leaf_count) assert_true(fabsf(area[2 * i] + area[2 * i + 1] - area[i]) <= 1e-6f * area[i]);
        /* of a leaf, all above it; of others, their parents, from which that follows but for rounding */
        for (uint32_t a = i / 2; a; a = i >= tree->leaf_count ? a / 2 : 0) {
            const ball above = float_ball(&nodes[a]);
            assert_encloses(&above, &b, 1e-7 * extent + 1e-7);
            if (i < tree->leaf_count || nodes[i].radius < 0) continue;
            double height = 0;
            for (int k = 0; k < 3; k++) height += (b.centre[k] - above.centre[k]) * above.axis[k];
            assert_true(fabs(height) <= (double)nodes[a].slab + 1e-6 * extent + 1e-7);
        }
    }
}

static void check_forest(const es_point_forest* forest)
{
    size_t nodes = 0, leaves = 0;
    for (uint32_t t = 0; t < forest->tree_count; t++) {
        const es_point_tree* tree = &forest->trees[t];
        assert_int_equal(tree->first, nodes);
        assert_int_equal(tree->first_leaf, leaves);
        nodes += 2 * (size_t)tree->leaf_count;
        leaves += tree->leaf_count;
        check_tree(forest, tree);
    }
    assert_int_equal(leaves, forest->leaf_count);
    if (!forest->tree_count) return;
    assert_int_equal(forest->top.first, nodes);
    check_tree(forest, &forest->top);
    uint32_t seen = 0;
    for (uint32_t i = 0; i < forest->top.leaf_count; i++) {
        const uint32_t t = forest->top_trees[i];
        const es_point_node_float* top = &forest->float_nodes[forest->top.first + forest->top.leaf_count + i];
        if (t == UINT32_MAX) {
            assert_true(top->radius < 0);
            continue;
        }
        seen++;
        /* each leaf, where it is in the world */
        const es_point_tree* tree = &forest->trees[t];
        for (uint32_t k = 0; k < tree->leaf_count; k++) {
            const size_t leaf = tree->first_leaf + k;
            const float dx = forest->x[leaf] - top->position[0], dy = forest->y[leaf] - top->position[1], dz = forest->z[leaf] - top->position[2];
            const float radius = forest->float_nodes[tree->first + tree->leaf_count + k].radius;
            assert_true(radius < 0 || sqrtf(dx * dx + dy * dy + dz * dz) + radius <= top->radius * 1.00001f + 1e-6f);
        }
    }
    assert_int_equal(seen, forest->tree_count);
}

static void test_structure(void** state)
{
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    es_point_forest forest = {0};
    const es_forest_update update = bring(context, &forest, s, POINTS);
    assert_true(forest.leaf_count <= POINTS && forest.leaf_count > POINTS / 3);
    assert_int_equal(forest.tree_count, 5); /* four, one of them with a back, and one of no size */
    assert_int_equal(update.built, 5);
    check_forest(&forest);
    /* points are on their surfaces, which the dome's equation says */
    const es_point_tree* tree = &forest.trees[1];
    assert_int_equal(tree->instance, 1);
    es_mat4 inverse;
    assert_true(es_mat4_inverse(&s->instances[1].transform, &inverse));
    for (uint32_t k = 0; k < tree->leaf_count; k++) {
        const es_vec3 p = es_mat4_point(&inverse, es_v3(forest.x[tree->first_leaf + k], forest.y[tree->first_leaf + k], forest.z[tree->first_leaf + k]));
        assert_true(fabsf(p.y - (0.4f - p.x * p.x - p.z * p.z)) < 1e-3f && fabsf(p.x) < 0.5001f && fabsf(p.z) < 0.5001f);
        const es_vec3 n = es_unpack_normal(forest.normal[tree->first_leaf + k]), up = es_mat4_direction(&s->instances[1].transform, es_v3(2 * p.x, 1, 2 * p.z));
        assert_true(es_v3_dot(n, es_v3_normalize(up, n)) > 0.999f);
    }
    es_forest_free(context, &forest);
    free(s);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* ---- equal bits ---------------------------------------------------------------------------------------------------------------- */

static uint64_t hash_forest(const es_point_forest* f)
{
    uint64_t h = es_hash_bytes(f->node_count, f->trees, 0);
    for (uint32_t t = 0; t <= f->tree_count; t++) {
        const es_point_tree* tree = t == f->tree_count ? &f->top : &f->trees[t];
        const size_t first = tree->first + 1, count = 2 * (size_t)tree->leaf_count - 1;
        h = es_hash_bytes(h, f->nodes + first, count * sizeof *f->nodes);
        h = es_hash_bytes(h, f->float_nodes + first, count * sizeof *f->float_nodes);
        h = es_hash_bytes(h, f->area + first, count * 4);
        h = es_hash_bytes(h, f->albedo + first, count * 4);
        h = es_hash_bytes(h, f->emission + first, count * 4);
        for (int c = 0; c < 3; c++) h = es_hash_bytes(h, f->radiance[c] + first, count * 4);
    }
    const void* leaves[] = {f->x, f->y, f->z, f->normal, f->albedo_rg, f->albedo_b, f->surface, f->triangle, f->barycentric};
    for (int k = 0; k < 9; k++) h = es_hash_bytes(h, leaves[k], 4 * f->leaf_count);
    return h;
}

static void light(es_point_forest* forest)
{
    uint32_t number = 0;
    for (uint32_t t = 0; t < forest->tree_count; t++)
        for (uint32_t k = 0; k < forest->trees[t].leaf_count; k++)
            for (int c = 0; c < 3; c++) forest->radiance[c][forest->trees[t].first + forest->trees[t].leaf_count + k] = 10 * es_random_float(5, number++);
}

static void run(es_context* context, uint64_t hashes[3])
{
    scene* s = new_scene();
    es_point_forest forest = {0};
    bring(context, &forest, s, POINTS);
    light(&forest);
    es_forest_pull(context, &forest);
    hashes[0] = hash_forest(&forest);
    bend(s, 0.25f, 3);
    s->instances[2].transform = pose(-2, 2.2f, es_v3(-1, 1, 1));
    bring(context, &forest, s, POINTS);
    hashes[1] = hash_forest(&forest);
    bend(s, 3.0f, 4);
    bring(context, &forest, s, POINTS);
    es_forest_pull(context, &forest);
    hashes[2] = hash_forest(&forest);
    es_forest_free(context, &forest);
    free(s);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_threads_and_isas(void** state)
{
    uint64_t scalar[3], other[3];
    run(new_context(1, 1u << ES_ISA_SCALAR), scalar);
    assert_true(scalar[0] != scalar[1] && scalar[1] != scalar[2]);
    for (uint32_t isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() & 1u << isa)) continue;
        run(new_context(3, 1u << isa), other);
        assert_memory_equal(scalar, other, sizeof scalar);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_threads_and_isas),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
