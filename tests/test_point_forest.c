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

#if defined(ES_TRAP_FP) /* what is no number stops there */
#define NO_NUMBER 0.0f
#define NO_END 1e9f
#else
#define NO_NUMBER NAN
#define NO_END INFINITY
#endif

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
    double far = 0; /* which the rounding of centres in floats grows with */
    for (int k = 0; k < 3; k++) far += fabs((double)tree->low[k]) + fabs((double)tree->low[k] + 65535 * (double)tree->step[k]);
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
            /* the stated error: of the radius no more than two steps, and what the centre moved */
            assert_true(p.radius <= b.radius + 2.1 * (double)tree->radius_step + 1.8 * (double)fmaxf(tree->step[0], fmaxf(tree->step[1], tree->step[2])) + 1e-6 * far);
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

/* ---- places ------------------------------------------------------------------------------------------------------------------------ */

/* On a square of `side`² pairs of triangles, how far points are from each other and places from points, over the distance of a hexagonal lattice's and the radius of
 * the circle of a point's area: the least distance, the mean, and the share of places that no disc covers. */
enum { SPACED = 16384 };
typedef struct spacing { double least, mean, bare, farthest; } spacing;

static spacing space_of(const float* x, const float* z, uint32_t count, float radius)
{
    enum { CELLS = 64, PLACES = 20000 };
    static uint32_t first[CELLS * CELLS], next[SPACED];
    for (int i = 0; i < CELLS * CELLS; i++) first[i] = UINT32_MAX;
    for (uint32_t i = 0; i < count; i++) {
        const int cell = (int)fminf(fmaxf((z[i] + 0.5f) * CELLS, 0), CELLS - 1) * CELLS + (int)fminf(fmaxf((x[i] + 0.5f) * CELLS, 0), CELLS - 1);
        next[i] = first[cell];
        first[cell] = i;
    }
    spacing s = {.least = 1e9};
    const double hexagonal = sqrt(2.0 / (sqrt(3.0) * count));
    for (uint32_t p = 0; p < count + PLACES; p++) {
        const float px = p < count ? x[p] : es_random_float(1, p) * 0.96f - 0.48f, pz = p < count ? z[p] : es_random_float(2, p) * 0.96f - 0.48f;
        const int cx = (int)((px + 0.5f) * CELLS), cz = (int)((pz + 0.5f) * CELLS);
        double nearest = 1e9;
        for (int dz = -1; dz <= 1; dz++)
            for (int dx = -1; dx <= 1; dx++) {
                if (cx + dx < 0 || cz + dz < 0 || cx + dx >= CELLS || cz + dz >= CELLS) continue;
                for (uint32_t i = first[(cz + dz) * CELLS + cx + dx]; i != UINT32_MAX; i = next[i])
                    if (i != p) nearest = fmin(nearest, hypot((double)(x[i] - px), (double)(z[i] - pz)));
            }
        if (p < count) {
            s.least = fmin(s.least, nearest / hexagonal);
            s.mean += nearest / hexagonal / count;
        } else {
            s.bare += nearest > (double)radius ? 1.0 / PLACES : 0.0;
            s.farthest = fmax(s.farthest, nearest * sqrt(count * 3.14159265));
        }
    }
    return s;
}

static void test_blue_noise(void** state)
{
    enum { COUNT = SPACED };
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    bend(s, 0, 2);
    s->list.instance_count = 1;
    s->instances[0].transform = pose(0, 0, es_v3(1, 1, 1));
    static float random_x[COUNT], random_z[COUNT];
    for (uint32_t i = 0; i < COUNT; i++) {
        random_x[i] = es_random_float(3, i) - 0.5f;
        random_z[i] = es_random_float(4, i) - 0.5f;
    }
    const spacing random = space_of(random_x, random_z, COUNT, 0);
    /* one pair of triangles, and many: a point on about two of them */
    for (int many = 0; many < 2; many++) {
        const float square[16] = {-0.5f, 0, -0.5f, 1, -0.5f, 0, 0.5f, 1, 0.5f, 0, -0.5f, 1, 0.5f, 0, 0.5f, 1};
        const uint32_t corners[7] = {0, 1, 2, 2, 1, 3, 0};
        const es_raster_mesh two = {.positions = square, .indices = corners, .vertex_count = 4, .triangle_count = 2, .revision = 77};
        s->instances[0].mesh = many ? &s->meshes[0] : &two;
        es_point_forest forest = {0};
        bring(context, &forest, s, many ? COUNT / 4 : COUNT);
        assert_int_equal(forest.leaf_count, many ? COUNT / 4 : COUNT);
        const spacing points = space_of(forest.x, forest.z, (uint32_t)forest.leaf_count, forest.float_nodes[forest.trees[0].first + forest.trees[0].leaf_count].radius);
        if (getenv("ES_PRINT")) print_message("%s: least %.3f (random %.3f), mean %.3f (%.3f), bare %.5f, farthest %.3f radii\n", many ? "many" : "two", points.least, random.least, points.mean, random.mean, points.bare, points.farthest);
        assert_true(points.least > 0.15 && random.least < 0.05);
        assert_true(points.mean > 0.65 && random.mean < 0.5);
        assert_true(points.bare < 0.0015 && points.farthest < 2.1);
        es_forest_free(context, &forest);
    }
    free(s);
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

/* ---- what changes ------------------------------------------------------------------------------------------------------------------ */

static void assert_same_nodes(const es_point_forest* a, const es_point_forest* b, uint32_t tree, bool floats)
{
    const es_point_tree *s = &a->trees[tree], *t = &b->trees[tree];
    assert_int_equal(s->leaf_count, t->leaf_count);
    const size_t count = 2 * (size_t)s->leaf_count - 1;
    assert_memory_equal(a->nodes + s->first + 1, b->nodes + t->first + 1, count * sizeof *a->nodes);
    if (floats) assert_memory_equal(a->float_nodes + s->first + 1, b->float_nodes + t->first + 1, count * sizeof *a->float_nodes);
    assert_memory_equal(a->area + s->first + 1, b->area + t->first + 1, count * sizeof(float));
    assert_memory_equal(a->albedo + s->first + 1, b->albedo + t->first + 1, count * sizeof(uint32_t));
}

/* Light is of course another. */
static void assert_same_nodes_but_light(const es_point_forest* a, const es_point_forest* b, uint32_t tree)
{
    const es_point_tree *s = &a->trees[tree], *t = &b->trees[tree];
    assert_int_equal(s->leaf_count, t->leaf_count);
    for (uint32_t i = 1; i < 2 * s->leaf_count; i++) {
        assert_memory_equal(a->nodes + s->first + i, b->nodes + t->first + i, offsetof(es_point_node, radiance));
        assert_memory_equal(a->float_nodes + s->first + i, b->float_nodes + t->first + i, sizeof *a->float_nodes);
    }
}

static void test_motion(void** state)
{
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    es_point_forest moved = {0}, fresh = {0}, packed = {0};
    bring(context, &moved, s, POINTS / 4);
    /* nothing */
    uint64_t version = moved.version;
    es_forest_update update = bring(context, &moved, s, POINTS / 4);
    assert_true(update.built + update.refit + update.moved == 0 && update.points == 0 && moved.version == version);
    /* rigid: nodes stay, but for a flip of the rounding of U, which turning by right angles does not have */
    bring(context, &fresh, s, POINTS / 4);
    s->instances[3].transform = es_mat4_mul(es_mat4_from_trs(es_v3(3, 1, 2), es_quat_from_axis_angle(es_v3(0, 1, 0), 1.1f), es_v3(1, 1, 1)), s->instances[3].transform);
    update = bring(context, &moved, s, POINTS / 4);
    assert_true(update.moved + update.refit == 1 && update.built == 0 && moved.version != version);
    assert_int_equal(moved.trees[4].instance, 3);
    if (update.moved) assert_same_nodes(&moved, &fresh, 4, true);
    assert_same_nodes(&moved, &fresh, 0, true);
    check_forest(&moved);
    /* refitted as built: where the split is the same, so is all else; with float nodes and without */
    bend(s, 0.12f, 5);
    update = bring(context, &moved, s, POINTS / 4);
    assert_true(update.refit == 1 && update.built == 0);
    es_forest_free(context, &fresh);
    bring(context, &fresh, s, POINTS / 4);
    const es_forest_request request = {POINTS / 4, 1.5f, 1};
    assert_int_equal(es_forest_bring(context, &packed, &s->list, 1, &request, &update), ES_OK);
    assert_null(packed.float_nodes);
    for (uint32_t i = 0; i < moved.tree_count; i++) {
        assert_same_nodes(&moved, &fresh, i, true);
        assert_same_nodes(&moved, &packed, i, false);
    }
    /* and with them again */
    bring(context, &packed, s, POINTS / 4);
    for (uint32_t i = 0; i < moved.tree_count; i++) assert_same_nodes(&packed, &fresh, i, true);
    /* an instance that goes, and comes back; light is kept where trees are */
    light(&moved);
    es_forest_pull(context, &moved);
    const float bright = moved.radiance[1][moved.trees[3].first + 5];
    const uint32_t leaves = moved.trees[3].leaf_count;
    s->list.instance_count = 3;
    bring(context, &moved, s, POINTS / 4);
    check_forest(&moved);
    assert_int_equal(moved.tree_count, 4);
    if (moved.trees[3].leaf_count == leaves) assert_true(moved.radiance[1][moved.trees[3].first + 5] == bright);
    s->list.instance_count = INSTANCES;
    bring(context, &moved, s, POINTS / 4);
    check_forest(&moved);
    for (uint32_t i = 0; i < moved.tree_count; i++) assert_same_nodes_but_light(&moved, &fresh, i);
    /* none at all */
    s->list.instance_count = 0;
    bring(context, &moved, s, POINTS / 4);
    assert_true(moved.tree_count == 0 && moved.leaf_count == 0 && moved.top.leaf_count == 0);
    es_forest_pull(context, &moved);
    es_forest_free(context, &moved);
    es_forest_free(context, &fresh);
    es_forest_free(context, &packed);
    free(s);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* What leaves send, by which points they are: the same for as long as these are. */
static uint32_t mark_of(const es_point_forest* f, size_t leaf) { return es_hash_u32(f->triangle[leaf]) ^ f->barycentric[leaf]; }
static es_point_lobe lobe_of_mark(uint32_t mark) { return (es_point_lobe){es_pack_rgb9e5(es_v3(1 + (float)(mark & 255), 1, 1)), mark, es_hash_u32(mark), mark & 0x7fffffff}; }

/* Light goes where its leaf goes when a tree is split anew, lobes as well, and goes out where points are placed anew; above leaves it is always theirs. */
static void test_light_follows(void** state)
{
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    s->materials[0].metallic = 1;
    s->materials[0].roughness = 0.3f;
    es_point_forest f = {0};
    bring(context, &f, s, POINTS / 8);
    assert_true(f.trees[0].glossy && f.tree_count > 1);
    assert_int_equal(es_forest_keep_lobes(context, &f), ES_OK);
    for (uint32_t t = 0; t < f.tree_count; t++)
        for (uint32_t k = 0; k < f.trees[t].leaf_count; k++) {
            const size_t node = f.trees[t].first + f.trees[t].leaf_count + k, leaf = f.trees[t].first_leaf + k;
            f.radiance[0][node] = (float)(mark_of(&f, leaf) & 65535);
            if (f.trees[t].glossy) f.lobes[node] = lobe_of_mark(mark_of(&f, leaf));
        }
    es_forest_pull(context, &f);
    const es_point_tree tree = f.trees[0];
    uint32_t* before = malloc(tree.leaf_count * sizeof *before);
    memcpy(before, f.triangle + tree.first_leaf, tree.leaf_count * sizeof *before);
    for (int turn = 0; turn < 2; turn++) {
        if (turn) /* at rest it is another */
            for (int i = 0; i < VERTICES; i++) s->rest[4 * i] *= 1.01f;
        bend(s, turn ? 0.1f : 3.0f, 4 + (uint64_t)turn);
        const es_forest_update update = bring(context, &f, s, POINTS / 8);
        assert_int_equal(update.built, 1);
        assert_int_equal(f.trees[0].leaf_count, tree.leaf_count);
        if (!turn) assert_true(memcmp(before, f.triangle + tree.first_leaf, tree.leaf_count * sizeof *before) != 0); /* they have changed places */
        assert_non_null(f.lobes);
        for (uint32_t k = 0; k < tree.leaf_count; k++) {
            const size_t node = tree.first + tree.leaf_count + k;
            const es_point_lobe lobe = turn ? (es_point_lobe){0} : lobe_of_mark(mark_of(&f, tree.first_leaf + k));
            assert_memory_equal(&f.lobes[node], &lobe, sizeof lobe);
            assert_true(f.radiance[0][node] == (turn ? 0.0f : (float)(mark_of(&f, tree.first_leaf + k) & 65535)));
        }
        const uint64_t light = es_hash_bytes(hash_forest(&f), f.lobes + tree.first + 1, (2 * (size_t)tree.leaf_count - 1) * sizeof *f.lobes);
        const es_point_lobe top = f.lobes[f.top.first + 1];
        es_forest_pull(context, &f);
        assert_true(es_hash_bytes(hash_forest(&f), f.lobes + tree.first + 1, (2 * (size_t)tree.leaf_count - 1) * sizeof *f.lobes) == light);
        assert_memory_equal(&f.lobes[f.top.first + 1], &top, sizeof top);
    }
    free(before);
    es_forest_free(context, &f);
    free(s);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_materials(void** state)
{
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    es_point_forest forest = {0};
    bring(context, &forest, s, POINTS / 8);
    s->materials[0].base_color[0] = 1.0f;
    s->materials[1].alpha_mask = true;
    s->materials[1].base_color[3] = 0.2f;
    es_forest_update update;
    const es_forest_request request = {POINTS / 8, 1.5f, 0};
    assert_int_equal(es_forest_bring(context, &forest, &s->list, 2, &request, &update), ES_OK);
    assert_int_equal(update.built, 0);
    check_forest(&forest);
    /* what a mask cuts out is not there, and its tree is empty */
    for (uint32_t t = 0; t < forest.tree_count; t++) {
        const bool hole = forest.trees[t].instance == 1;
        assert_true((forest.float_nodes[forest.trees[t].first + 1].radius < 0) == hole && (forest.nodes[forest.trees[t].first + 1].radius == 0) == hole);
        assert_true((es_unpack_rgb9e5(forest.albedo[forest.trees[t].first + 1]).x > 0.9f) == !hole);
    }
    s->materials[1].alpha_mask = false;
    assert_int_equal(es_forest_bring(context, &forest, &s->list, 3, &request, &update), ES_OK);
    check_forest(&forest);
    for (uint32_t t = 0; t < forest.tree_count; t++) assert_true(forest.float_nodes[forest.trees[t].first + 1].radius > 0);
    es_forest_free(context, &forest);
    free(s);
    es_context_destroy(context);
}

/* ---- out of the ordinary -------------------------------------------------------------------------------------------------------------- */

static void test_stress(void** state)
{
    es_context* context = new_context(1, 0);
    scene* s = new_scene();
    s->list.instance_count = 1;
    es_point_forest forest = {0};
    /* one point; fewer than trees */
    bring(context, &forest, s, 1);
    assert_int_equal(forest.leaf_count, 1);
    check_forest(&forest);
    s->list.instance_count = 4;
    bring(context, &forest, s, 3);
    assert_true(forest.leaf_count == 3 && forest.tree_count == 3);
    check_forest(&forest);
    s->list.instance_count = 1;
    bring(context, &forest, s, POINTS / 4);
    /* torn apart: every other column of vertices leaves */
    for (int i = 0; i < VERTICES; i++)
        if (i % 2) s->positions[0][4 * i + 1] += 200.0f;
    s->meshes[0].revision = 6;
    es_forest_update update = bring(context, &forest, s, POINTS / 4);
    assert_true(update.built + update.refit >= 1);
    check_forest(&forest);
    /* all in one place, in a line, and far out or not a number */
    for (int kind = 0; kind < 4; kind++) {
        for (int i = 0; i < VERTICES; i++)
            for (int k = 0; k < 3; k++) {
                const float odd[4] = {0.5f, k == 1 ? (float)i : 0.0f, k == 2 ? 1e8f * (float)(i % 7) : 1e-7f * (float)i, i % 9 == k ? (i % 2 ? NO_NUMBER : NO_END) : (float)(i % 5)};
                s->positions[0][4 * i + k] = odd[kind];
            }
        s->meshes[0].revision = 10 + (uint64_t)kind;
        bring(context, &forest, s, POINTS / 4);
        check_forest(&forest);
        assert_true(isfinite(forest.x[0]) && isfinite(forest.y[0]) && isfinite(forest.z[0]));
    }
    /* of no area at rest: no tree */
    memset(s->rest, 0, sizeof s->rest);
    s->meshes[0].revision = 20;
    bring(context, &forest, s, POINTS / 4);
    assert_int_equal(forest.tree_count, 0);
    /* tiny and huge discs together, sheared and mirrored */
    es_forest_free(context, &forest);
    free(s);
    s = new_scene();
    s->instances[0].transform = pose(0, 1, es_v3(1e-4f, 1e-4f, 1e-4f));
    s->instances[0].point_weight = 1e8f;
    s->instances[1].transform = pose(500, 1, es_v3(1000, 1000, 1000));
    const float sheared[16] = {1, 0, 0, 0, 3, -1, 0.5f, 0, -2, 1, 1, 0, 4, 5, 6, 1};
    memcpy(s->instances[2].transform.m, sheared, sizeof sheared);
    s->instances[3].transform = pose(5, 1, es_v3(1, 0, 1)); /* flattened */
    bring(context, &forest, s, POINTS / 2);
    check_forest(&forest);
    /* normals of the sheared dome are its surface's */
    for (uint32_t t = 0; t < forest.tree_count; t++) {
        const es_point_tree* tree = &forest.trees[t];
        if (tree->instance != 2) continue;
        es_mat4 inverse;
        float matrix[9];
        assert_true(es_mat4_inverse(&s->instances[2].transform, &inverse));
        es_mat4_normal_matrix(&s->instances[2].transform, matrix);
        const float sign = es_mat4_determinant3(&s->instances[2].transform) < 0 ? -1.0f : 1.0f;
        for (uint32_t k = 0; k < tree->leaf_count; k++) {
            const size_t leaf = tree->first_leaf + k;
            const es_vec3 p = es_mat4_point(&inverse, es_v3(forest.x[leaf], forest.y[leaf], forest.z[leaf])), up = es_v3(2 * p.x, 1, 2 * p.z);
            const es_vec3 n = es_v3(matrix[0] * up.x + matrix[3] * up.y + matrix[6] * up.z, matrix[1] * up.x + matrix[4] * up.y + matrix[7] * up.z, matrix[2] * up.x + matrix[5] * up.y + matrix[8] * up.z);
            assert_true(fabsf(p.y - (0.4f - p.x * p.x - p.z * p.z)) < 2e-3f);
            assert_true(sign * es_v3_dot(es_v3_normalize(n, up), es_unpack_normal(forest.normal[leaf])) > 0.998f);
        }
    }
    es_forest_free(context, &forest);
    free(s);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* ---- scarce memory ----------------------------------------------------------------------------------------------------------------------- */

static struct { long left; int messages; size_t live; } memory;
static void* scarce(void* user, size_t size, size_t alignment)
{
    void* pointer;
    if (memory.left == 0 || posix_memalign(&pointer, alignment, size)) return NULL;
    if (memory.left > 0) memory.left--;
    memory.live += size;
    return pointer;
}
static void give_back(void* user, void* pointer, size_t size)
{
    memory.live -= size;
    free(pointer);
}
static void count_message(void* user, es_log_level level, es_result item, const char* message) { memory.messages += level == ES_LOG_ERROR; }

static void test_scarcity(void** state)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.allocator = (es_allocator){scarce, give_back, NULL};
    desc.logger.log = count_message;
    memory.left = -1;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    scene* s = new_scene();
    es_point_forest forest = {0}, whole = {0};
    es_forest_update update;
    const es_forest_request request = {1024, 1.5f, 0};
    bring(context, &whole, s, 1024);
    const size_t before = es_context_bytes(context);
    int failures = 0;
    for (long left = 0;; left++) {
        memory.left = left;
        memory.messages = 0;
        es_result result = es_forest_bring(context, &forest, &s->list, 1, &request, &update);
        if (!result) break;
        failures++;
        assert_int_equal(result, ES_OUT_OF_MEMORY);
        assert_int_equal(memory.messages, 1);
        assert_int_equal(es_context_bytes(context), before);
        assert_null(forest.nodes);
    }
    assert_true(failures > 20);
    assert_true(hash_forest(&forest) == hash_forest(&whole));
    /* and when it changes */
    for (long left = 0; left < 200; left++) {
        memory.left = left;
        es_point_forest other = {0};
        s->list.instance_count = 2;
        bend(s, 0.1f, 2);
        memory.left = -1;
        bring(context, &other, s, 1024);
        s->list.instance_count = INSTANCES;
        bend(s, 4.0f, 100 + (uint64_t)left);
        memory.left = left;
        es_result result = es_forest_bring(context, &other, &s->list, 1, &request, &update);
        memory.left = -1;
        if (result) assert_null(other.nodes);
        es_forest_free(context, &other);
        if (!result) break;
    }
    es_forest_free(context, &forest);
    es_forest_free(context, &whole);
    es_context_destroy(context);
    assert_int_equal(memory.live, 0);

    /* a cap: one message that says what, how much, and what would do */
    desc.allocator = (es_allocator){0};
    desc.memory_cap = 64 << 20;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    memory.messages = 0;
    const es_forest_request large = {1 << 23, 1.5f, 1};
    assert_int_equal(es_forest_bring(context, &forest, &s->list, 1, &large, &update), ES_MEMORY_CAP);
    assert_int_equal(memory.messages, 1);
    assert_non_null(strstr(es_context_message(context), "points would fit"));
    assert_int_equal(es_context_bytes(context), 0);
    free(s);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_structure),
        cmocka_unit_test(test_blue_noise),
        cmocka_unit_test(test_motion),
        cmocka_unit_test(test_light_follows),
        cmocka_unit_test(test_materials),
        cmocka_unit_test(test_stress),
        cmocka_unit_test(test_scarcity),
        cmocka_unit_test(test_threads_and_isas),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
