/* Kernels of the hierarchy of points: every instruction set against scalar, bit for bit, on random and extreme input, with guards round what is written.
 *
 * check_forest --time [THREADS] prints milliseconds of placing, splitting, refitting and pulling a million points on half a million triangles instead. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/micro/forest_parts.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "tests/guarded_planes.h"

/* ---- checks ----------------------------------------------------------------------------------------------------------------------- */

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(29, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }
static float wild(float scale)
{
    static const float odd[] = {0.0f, -0.0f, 1e30f, -1e30f, 3e38f, 1e-38f, 1e-45f, INFINITY, -INFINITY, NAN};
    const uint32_t r = random_bits();
    return r % 32 == 0 ? odd[r / 32 % 10] : uniform(-scale, scale);
}

enum { CORNERS = 96, FACES = 60, LEAVES = 64 };

typedef struct outputs { plane vertices, tree, area, world[3], normal, nodes; float sums[2], box[6]; } outputs;

static outputs new_outputs(void)
{
    outputs o = {.vertices = new_plane(8 * CORNERS)};
    o.tree = new_plane(2 * LEAVES / 8 * ES_NODE_RECORD);
    o.area = new_plane(2 * LEAVES);
    for (int k = 0; k < 3; k++) o.world[k] = new_plane(LEAVES);
    o.normal = new_plane(LEAVES);
    o.nodes = new_plane(4 * 2 * LEAVES);
    return o;
}

static void compare_planes(plane a, plane b)
{
    check_guards(b);
    assert_memory_equal(at(a), at(b), a.count * 4);
}

static void free_outputs(outputs* o)
{
    free(o->vertices.memory);
    free(o->tree.memory);
    free(o->area.memory);
    for (int k = 0; k < 3; k++) free(o->world[k].memory);
    free(o->normal.memory);
    free(o->nodes.memory);
}

typedef struct block { const float *positions, *normals; float u[9]; uint32_t vertices[CORNERS]; } block;

/* A whole block: vertices, leaves, levels, rounding. */
static void make_nodes(const es_gi_kernels* kernels, const block* b, es_leaf_job job, uint32_t leaves, outputs* o)
{
    kernels->forest_vertices(b->positions, b->u, b->vertices, CORNERS, at(o->vertices));
    job.vertices = at(o->vertices);
    if (b->normals) {
        kernels->forest_normals(b->normals, b->vertices, CORNERS, at(o->vertices) + 4 * CORNERS);
        job.normals = at(o->vertices) + 4 * CORNERS;
    }
    job.nodes = at(o->tree);
    job.first = leaves;
    job.area = at(o->area) + leaves;
    job.x = at(o->world[0]);
    job.y = at(o->world[1]);
    job.z = at(o->world[2]);
    job.normal = (uint32_t*)at(o->normal);
    kernels->forest_box(b->positions, b->u, 0, CORNERS - 3, o->box, o->box + 3);
    kernels->forest_leaves(&job, 0, leaves);
    for (uint32_t level = leaves / 2; level; level /= 2) kernels->forest_merge(job.nodes, level, level == leaves / 2, at(o->area) + 2 * level, at(o->area) + level, &o->sums[level % 2]);
    es_node_frame frame = {.radius_step = 4.0f / 65535.0f, .error = 1e-4f};
    for (int k = 0; k < 3; k++) {
        frame.low[k] = -2.0f;
        frame.step[k] = k == 1 ? 0.0f : 4.0f / 65535.0f;
    }
    for (uint32_t level = leaves; level; level /= 2) kernels->forest_quantise(&frame, job.nodes, level, level, level == leaves, (es_point_node*)at(o->nodes) + level);
}

static void check_nodes(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 200; trial++) {
        float positions[4 * CORNERS], normals[4 * CORNERS], shapes[3][LEAVES];
        uint32_t barycentric[LEAVES];
        uint16_t corners[3 * LEAVES];
        for (int i = 0; i < 4 * CORNERS; i++) {
            positions[i] = trial % 2 ? uniform(-1, 1) : wild(2);
            normals[i] = trial % 3 ? uniform(-1, 1) : wild(2);
        }
        block b = {.positions = positions, .normals = trial % 4 < 2 ? normals : NULL, .u = {1, 0, 0, uniform(-1, 1), 2, 0, uniform(-1, 1), 0, uniform(0, 1)}};
        for (int i = 0; i < CORNERS; i++) b.vertices[i] = random_bits() % CORNERS;
        for (int i = 0; i < 3 * LEAVES; i++) corners[i] = (uint16_t)(2 * (random_bits() % CORNERS));
        for (int i = 0; i < LEAVES; i++) {
            const float u = uniform(0, 1), v = uniform(0, 1 - u);
            barycentric[i] = (uint32_t)(u * 65535) | (uint32_t)(v * 65535) << 16;
            for (int k = 0; k < 3; k++) shapes[k][i] = trial % 5 ? uniform(0, 0.2f) : uniform(-1, 1) * (k ? 1e6f : 1.0f);
        }
        es_leaf_job job = {.corners = corners, .magnify = 0.5f, .side = trial % 2 ? 1.0f : -1.0f, .barycentric = barycentric, .shapes = {shapes[0], shapes[1], shapes[2]}};
        for (int i = 0; i < 9; i++) {
            job.cofactors[i] = uniform(-1, 1);
            job.rotation[i] = uniform(-1, 1);
        }
        const uint32_t leaves = 1u << trial % 7;
        outputs expected = new_outputs();
        make_nodes(es_gi_kernel_table(ES_ISA_SCALAR), &b, job, leaves, &expected);
        for (uint32_t i = leaves; i < 2 * leaves; i++)
            for (int k = 0; k < ES_NODE_VALUES; k++) assert_true(isfinite(*es_node_value(at(expected.tree), i, k)));
        for (uint32_t isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() & 1u << isa)) continue;
            outputs o = new_outputs();
            make_nodes(es_gi_kernel_table((es_isa)isa), &b, job, leaves, &o);
            compare_planes(expected.vertices, o.vertices);
            compare_planes(expected.tree, o.tree);
            for (int k = 0; k < 3; k++) compare_planes(expected.world[k], o.world[k]);
            compare_planes(expected.area, o.area);
            compare_planes(expected.normal, o.normal);
            compare_planes(expected.nodes, o.nodes);
            assert_memory_equal(expected.sums, o.sums, sizeof o.sums);
            assert_memory_equal(expected.box, o.box, sizeof o.box);
            free_outputs(&o);
        }
        free_outputs(&expected);
    }
}

static void check_light(void** state)
{
    (void)state;
    enum { NODES = 128 };
    for (uint32_t trial = 0; trial < 50; trial++) {
        plane inputs[4], looks[2];
        for (int k = 0; k < 4; k++) {
            inputs[k] = new_plane(NODES);
            for (int i = 0; i < NODES; i++) at(inputs[k])[i] = k == 3 ? (random_bits() % 4 ? uniform(0, 2) : 0.0f) : (random_bits() % 8 ? uniform(0, 10) : uniform(0, 1e5f));
        }
        for (int k = 0; k < 2; k++) {
            looks[k] = new_plane(NODES);
            for (int i = 0; i < NODES; i++) looks[k].memory[GUARD + i] = random_bits();
        }
        plane expected[6];
        const uint32_t level = 1u << trial % 6, begin = level + trial % level, end = 2 * level;
        for (uint32_t isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() & 1u << isa)) continue;
            const es_gi_kernels* kernels = es_gi_kernel_table((es_isa)isa);
            plane o[6];
            for (int k = 0; k < 6; k++) {
                o[k] = new_plane(k < 5 ? NODES : 4 * NODES);
                if (k < 5) memcpy(at(o[k]), at(k < 3 ? inputs[k] : looks[k - 3]), NODES * 4);
            }
            const es_node_light light = {{at(o[0]), at(o[1]), at(o[2])}, at(inputs[3]), (es_point_node*)at(o[5])};
            const es_node_looks words = {(uint32_t*)at(o[3]), (uint32_t*)at(o[4]), at(inputs[3])};
            kernels->forest_pull(&light, begin, end);
            kernels->forest_pack(&light, begin, end);
            kernels->forest_blend(&words, begin, end);
            for (int k = 0; k < 6; k++) {
                if (isa == ES_ISA_SCALAR) expected[k] = o[k];
                else compare_planes(expected[k], o[k]);
                if (isa != ES_ISA_SCALAR) free(o[k].memory);
            }
            /* the mean by area lies between */
            for (uint32_t i = begin; i < end && isa == ES_ISA_SCALAR; i++)
                for (int c = 0; c < 3; c++) {
                    const float a = at(inputs[c])[2 * i], b = at(inputs[c])[2 * i + 1], mean = at(o[c])[i], s = at(inputs[3])[2 * i], t = at(inputs[3])[2 * i + 1];
                    if (2 * i < end) continue; /* a parent's child that was itself pulled */
                    assert_true(fabs((double)mean - (s + t > 0 ? ((double)a * s + (double)b * t) / ((double)s + t) : (double)a)) <= 1e-6 * fmax(a, b));
                }
        }
        for (int k = 0; k < 6; k++) free(expected[k].memory);
        for (int k = 0; k < 4; k++) free(inputs[k].memory);
        for (int k = 0; k < 2; k++) free(looks[k].memory);
    }
}

/* ---- time ----------------------------------------------------------------------------------------------------------------------- */

enum { SIDE = 512, POINTS = 1 << 20 };

/* A ring whose thickness swells along it. */
static void shape_ring(float* positions, float turn)
{
    for (int i = 0; i < (SIDE + 1) * (SIDE + 1); i++) {
        const float u = (float)(i % (SIDE + 1)) * (2.0f * ES_PI / SIDE), v = (float)(i / (SIDE + 1)) * (2.0f * ES_PI / SIDE), r = 0.4f + 0.1f * es_sin(3.0f * u + turn);
        const float p[4] = {(1.0f + r * es_cos(v)) * es_cos(u), r * es_sin(v), (1.0f + r * es_cos(v)) * es_sin(u), 1.0f};
        memcpy(positions + 4 * (size_t)i, p, sizeof p);
    }
}

static double milliseconds(es_context* context, es_point_forest* forest, const es_draw_list* list, bool floats, es_forest_update* update)
{
    const es_forest_request request = {POINTS, 1.5f, !floats};
    const double begin = es_seconds();
    if (es_forest_bring(context, forest, list, 1, &request, update)) exit(1);
    return (es_seconds() - begin) * 1e3;
}

static void time_all(uint32_t threads, bool floats)
{
    const size_t vertices = (SIDE + 1) * (SIDE + 1), triangles = 2 * SIDE * SIDE;
    float *positions = aligned_alloc(64, (vertices * 16 + 63) / 64 * 64), *rest = aligned_alloc(64, (vertices * 16 + 63) / 64 * 64);
    uint32_t* indices = malloc(triangles * 12 + 4);
    size_t t = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        const uint32_t a = i / SIDE * (SIDE + 1) + i % SIDE, corners[6] = {a, a + SIDE + 1, a + 1, a + 1, a + SIDE + 1, a + SIDE + 2};
        for (int k = 0; k < 6; k++) indices[t++] = corners[k];
    }
    shape_ring(rest, 0.0f);
    es_raster_mesh mesh = {.positions = positions, .rest_positions = rest, .indices = indices, .vertex_count = (uint32_t)vertices, .triangle_count = (uint32_t)triangles};
    es_material_desc material = es_default_material_desc();
    es_raster_instance instance = {.mesh = &mesh, .id = 1, .transform = es_mat4_identity(), .previous_transform = es_mat4_identity()};
    const es_draw_list list = {&instance, &material, 1, 1};
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context;
    if (es_context_create(&desc, &context)) exit(1);
    es_point_forest forest = {0};
    es_forest_update update;
    double built = 0, refitted = 1e9, moved = 1e9, pulled = 1e9, same = 1e9;
    for (uint32_t frame = 0; frame < 12; frame++) {
        shape_ring(positions, 0.02f * (float)(frame + 1));
        mesh.revision = frame + 1;
        mesh.rest_revision = 1;
        double ms = milliseconds(context, &forest, &list, floats, &update);
        if (frame == 0) built = ms;
        else if (!update.refit || update.built) printf("not refitted alone\n");
        else refitted = fmin(refitted, ms);
        instance.transform = es_mat4_from_trs(es_v3(1, 2, 3), es_quat_from_axis_angle(es_v3(0, 1, 0), (float)frame), es_v3(1, 1, 1));
        ms = milliseconds(context, &forest, &list, floats, &update);
        if (update.moved) moved = fmin(moved, ms);
        same = fmin(same, milliseconds(context, &forest, &list, floats, &update));
        const double begin = es_seconds();
        es_forest_pull(context, &forest);
        pulled = fmin(pulled, (es_seconds() - begin) * 1e3);
    }
    printf("%u threads, %zu points on %zu triangles, %zu MiB: built %.1f ms, refitted %.2f ms, moved %.2f ms, unchanged %.3f ms, pulled %.2f ms\n", threads, forest.leaf_count, triangles,
        es_context_bytes(context) >> 20, built, refitted, moved, same, pulled);
    es_forest_free(context, &forest);
    es_context_destroy(context);
    free(positions);
    free(rest);
    free(indices);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all(argc > 2 ? (uint32_t)atoi(argv[2]) : 2, false);
        if (argc > 3) time_all((uint32_t)atoi(argv[2]), true);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_nodes),
        cmocka_unit_test(check_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
