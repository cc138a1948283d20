/* Cloth and soft bodies: lengths, periods and compliances against what can be computed by hand, contact, tearing, holding, saved states, and
 * the same bits for any number of threads and instruction set. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "sim/sim.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SIDE = 9, STEPS = 20, LONG = 120 };
#else
enum { SIDE = 24, STEPS = 90, LONG = 600 };
#endif

static void no_log(void* user, es_log_level level, es_result item, const char* message) { assert_null(strchr(message, '\n')); }

static es_context* make_context(uint32_t count, uint32_t isa_mask)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = count;
    desc.isa_mask = isa_mask;
    desc.logger.log = no_log;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static es_world* make_world(es_context* context, bool sleep)
{
    es_world* world;
    assert_int_equal(es_world_create(context, NULL, &world), ES_OK);
    es_world_settings settings = es_world_get_settings(world);
    settings.sleep = sleep;
    assert_int_equal(es_world_configure(world, &settings), ES_OK);
    return world;
}

static void end(es_world* world)
{
    es_context* context = es_world_context(world);
    es_world_destroy(world);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

/* width × height vertices, a sheet at y = 0 from (x, z) = (-w/2, 0) on */
static es_mesh sheet(es_world* world, uint32_t columns, uint32_t rows, float width, float depth)
{
    float* p = malloc(3 * sizeof(float) * columns * rows);
    uint32_t *indices = malloc(6 * sizeof(uint32_t) * columns * rows), count = 0;
    for (uint32_t j = 0; j < rows; j++)
        for (uint32_t i = 0; i < columns; i++) {
            float* v = p + 3 * (j * columns + i);
            v[0] = width * ((float)i / (float)(columns - 1) - 0.5f);
            v[1] = 0;
            v[2] = depth * (float)j / (float)(rows - 1);
            if (i + 1 == columns || j + 1 == rows) continue;
            uint32_t a = j * columns + i, b = a + 1, c = a + columns, d = c + 1;
            const uint32_t odd[6] = {a, c, d, a, d, b}, even[6] = {a, c, b, b, c, d};
            memcpy(indices + count, (i + j) & 1 ? odd : even, sizeof odd);
            count += 6;
        }
    es_mesh mesh;
    es_mesh_desc desc = {.name = "sheet", .vertex_count = columns * rows, .triangle_count = count / 3, .positions = p, .indices = indices};
    assert_int_equal(es_world_add_mesh(world, &desc, &mesh), ES_OK);
    es_instance instance;
    assert_int_equal(es_world_add_instance(world, &(es_instance_desc){.mesh = mesh}, &instance), ES_OK);
    free(p);
    free(indices);
    return mesh;
}

static es_mesh box_mesh(es_world* world, float half)
{
    static const uint32_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    float p[24];
    uint32_t indices[36];
    for (int c = 0; c < 8; c++)
        for (int k = 0; k < 3; k++) p[3 * c + k] = c >> k & 1 ? half : -half;
    for (int q = 0; q < 6; q++) {
        const uint32_t* c = quads[q];
        const uint32_t two[6] = {c[0], c[1], c[2], c[0], c[2], c[3]};
        memcpy(indices + 6 * q, two, sizeof two);
    }
    es_mesh mesh;
    assert_int_equal(es_world_add_mesh(world, &(es_mesh_desc){.name = "box", .vertex_count = 8, .triangle_count = 12, .positions = p, .indices = indices}, &mesh), ES_OK);
    return mesh;
}

static es_soft add_soft(es_world* world, const es_soft_desc* desc)
{
    es_soft soft;
    es_result result = es_world_add_soft(world, desc, &soft);
    if (result != ES_OK) fail_msg("%s", es_context_message(es_world_context(world)));
    return soft;
}

static es_body add_body(es_world* world, es_body_type type, es_shape_desc shape, double x, double y, double z)
{
    es_body_desc desc = es_default_body_desc();
    desc.type = type;
    desc.shapes = &shape;
    desc.shape_count = 1;
    desc.position[0] = x;
    desc.position[1] = y;
    desc.position[2] = z;
    es_body body;
    assert_int_equal(es_world_add_body(world, &desc, &body), ES_OK);
    return body;
}

static es_shape_desc sphere(float radius)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_SPHERE;
    shape.radius = radius;
    return shape;
}

static es_soft_state state_of(es_world* world, es_soft soft)
{
    es_soft_state state;
    assert_int_equal(es_world_get_soft_state(world, soft, &state), ES_OK);
    return state;
}

static void run(es_world* world, int steps)
{
    for (int i = 0; i < steps; i++) {
        es_result result = es_world_step(world, 1.0f / 60);
        if (result != ES_OK) fail_msg("step %d: %s", i, es_context_message(es_world_context(world)));
    }
}

/* ---- against what can be computed by hand ------------------------------------------------------------------------------------ */

/* Hung by its whole upper edge and asked to stretch by a compliance of its columns: a column of n links with m each stretches by
 * compliance × g × m × n (n + 1) / 2 at its free end. Without, it keeps its length. */
static void hanging(void** state)
{
    for (int stiff = 0; stiff < 2; stiff++) {
        es_world* world = make_world(make_context(1, 0), false);
        enum { ROWS = 11 };
        /* one column of edges between two: triangles need a width; a wide strip would share the load with its diagonals */
        es_soft_desc desc = es_default_soft_desc();
        desc.mesh = sheet(world, 2, ROWS, 0.1f, 1.0f);
        desc.mass = 0.5f;
        desc.drag = 0;
        desc.damping = 2;
        desc.bend_compliance = -1;
        desc.stretch_compliance = stiff ? 0 : 1e-3f;
        desc.shear_compliance = stiff ? 0 : 1e5f;
        desc.substeps = 64; /* one sweep per substep leaves an error that goes with its square */
        const es_soft_attachment held[2] = {{.vertex = 0, .in_place = true}, {.vertex = 1, .in_place = true}};
        desc.attachments = held;
        desc.attachment_count = 2;
        es_soft soft = add_soft(world, &desc);
        double from[3];
        run(world, LONG < 300 ? 300 : LONG);
        double low = 0;
        for (uint32_t v = 0; v < 2; v++) {
            assert_int_equal(es_world_get_soft_vertex(world, soft, 2 * (ROWS - 1) + v, from, NULL), ES_OK);
            low += from[1] / 2;
        }
        if (stiff) {
            assert_true(low > -1.02 && low < -0.97);
            assert_true(state_of(world, soft).largest_stretch < 1.02f);
        } else { /* mass per row, 0.05 kg inside and half of that at the ends, on two columns */
            double expected = 0;
            for (int link = 1; link < ROWS; link++) expected += 1e-3 * 9.81 * ((ROWS - 1 - link) * 0.05 + 0.025) / 2;
            if (!(fabs(-low - 1 - expected) < 0.05 * expected + 2e-4)) fail_msg("stretched by %g m, expected %g", -low - 1, expected);
        }
        end(world);
    }
}

/* A strip that is short beside its string of links is no point, so the pendulum is a light strip with most of its mass at the end: a
 * rigid body hung from it. Its period is 2 π √(l / g (1 + θ²/16)). Counted: zero crossings of x. */
static void pendulum(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, 2, 2, 0.02f, 1.0f);
    desc.mass = 1;
    desc.drag = desc.damping = 0;
    desc.bend_compliance = -1;
    const es_soft_attachment held[2] = {{.vertex = 0, .local = {-0.01f, 0, 0}}, {.vertex = 1, .local = {0.01f, 0, 0}}};
    desc.attachments = held;
    desc.attachment_count = 2;
    es_soft soft = add_soft(world, &desc);
    /* from horizontal, θ = π/2: the period is 1.18034 × 2 π √(l / g), by the complete elliptic integral */
    double expected = 1.18034 * 2 * 3.14159265 * sqrt(1.0 / 9.81), p[3], last = 1;
    double crossings[8];
    int count = 0;
    for (int i = 0; i < 300 && count < 3; i++) {
        run(world, 1);
        assert_int_equal(es_world_get_soft_vertex(world, soft, 2, p, NULL), ES_OK);
        if ((p[2] > 0) != (last > 0)) crossings[count++] = es_world_time(world);
        last = p[2];
        assert_true(fabs(sqrt(p[1] * p[1] + p[2] * p[2]) - 1) < 0.01);
    }
    assert_int_equal(count, 3);
    if (!(fabs(crossings[2] - crossings[0] - expected) < 0.03 * expected)) fail_msg("period %g s, expected %g", crossings[2] - crossings[0], expected);
    end(world);
}

/* A sheet in the air keeps its momentum under no gravity, never has more energy than it was given, and none when it was given none. */
static void conserved(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, 8, 8, 1, 1);
    desc.gravity_scale = desc.drag = desc.damping = 0;
    es_soft soft = add_soft(world, &desc);
    run(world, 30);
    assert_true(state_of(world, soft).kinetic_energy < 1e-9f);
    assert_int_equal(es_world_soft_impulse(world, soft, ES_SOFT_ALL, es_v3(2, 0, 0)), ES_OK);
    assert_int_equal(es_world_soft_impulse(world, soft, 5, es_v3(0, 0.5f, 0)), ES_OK);
    es_soft_state before = state_of(world, soft), after;
    float energy = before.kinetic_energy;
    for (int i = 0; i < 60; i++) {
        run(world, 1);
        after = state_of(world, soft);
        assert_true(after.kinetic_energy <= energy * 1.001f);
    }
    assert_true(fabs(after.centre[0] - before.centre[0] - 2) < 2e-3);
    assert_true(fabs(after.centre[1] - before.centre[1] - 0.5) < 2e-3);
    end(world);
}

/* ---- solids ---------------------------------------------------------------------------------------------------------------------------- */

static void solid(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_shape_desc floor = es_default_shape_desc();
    floor.type = ES_SHAPE_BOX;
    floor.half_extents = es_v3(5, 0.5f, 5);
    add_body(world, ES_BODY_STATIC, floor, 0, -1.0, 0);
    es_mesh mesh = box_mesh(world, 0.25f);
    es_soft_solid fill;
    assert_int_equal(es_soft_fill(world, mesh, 0.1f, &fill), ES_OK);
    assert_true(fill.tetrahedron_count >= 5 * 125 && fill.tetrahedron_count <= 5 * 216);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = mesh;
    desc.solid = &fill;
    desc.mass = 20;
    desc.stretch_compliance = 1e-5f;
    es_soft soft = add_soft(world, &desc);
    es_soft_solid_free(world, &fill);
    assert_null(fill.particles);
    for (int i = 0; i < (LONG < 200 ? 60 : 200); i++) {
        run(world, 1);
        es_soft_state now = state_of(world, soft);
        if (!(fabsf(now.volume / now.rest_volume - 1) < 0.05f)) fail_msg("step %d: volume %g of %g", i, (double)now.volume, (double)now.rest_volume);
        assert_true(now.centre[1] > -0.5);
    }
    const es_raster_mesh* shown = es_world_mesh(world, mesh);
    assert_true(shown->bounds_min.y > -0.53f && shown->bounds_max.y < 0.2f && shown->bounds_max.y > -0.1f);
    end(world);
}

/* ---- contact ---------------------------------------------------------------------------------------------------------------------------- */

static void over_sphere(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    add_body(world, ES_BODY_STATIC, sphere(0.5f), 0, -0.8, 1.2);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, SIDE, SIDE, 2, 2);
    const es_soft_attachment held[2] = {{.vertex = 0, .in_place = true}, {.vertex = SIDE - 1, .in_place = true}};
    desc.attachments = held;
    desc.attachment_count = 2;
    es_soft soft = add_soft(world, &desc);
    for (int i = 0; i < 2 * STEPS; i++) {
        run(world, 1);
        for (uint32_t v = 0; v < SIDE * SIDE; v++) {
            double p[3];
            assert_int_equal(es_world_get_soft_vertex(world, soft, v, p, NULL), ES_OK);
            assert_true(sqrt(p[0] * p[0] + (p[1] + 0.8) * (p[1] + 0.8) + (p[2] - 1.2) * (p[2] - 1.2)) > 0.52 - 1e-4);
        }
    }
    assert_true(state_of(world, soft).largest_stretch < 1.1f);
    end(world);
}

/* Momentum that the cloth gets the body loses: a ball thrown into a free sheet. */
static void pushes_bodies(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_world_settings settings = es_world_get_settings(world);
    settings.gravity = es_v3(0, 0, 0);
    assert_int_equal(es_world_configure(world, &settings), ES_OK);
    es_shape_desc shape = sphere(0.2f);
    es_body body = add_body(world, ES_BODY_DYNAMIC, shape, 0, -0.5, 0.5);
    es_body_state ball;
    assert_int_equal(es_world_get_body(world, body, &ball), ES_OK);
    assert_int_equal(es_world_set_body_velocity(world, body, es_v3(0, 2, 0), es_v3(0, 0, 0)), ES_OK);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, 12, 12, 1, 1);
    desc.mass = 10;
    desc.drag = desc.damping = 0;
    es_soft soft = add_soft(world, &desc);
    es_soft_state before = state_of(world, soft), after;
    run(world, 60);
    after = state_of(world, soft);
    double from = after.centre[1];
    es_body_state then;
    assert_int_equal(es_world_get_body(world, body, &then), ES_OK);
    run(world, 30);
    after = state_of(world, soft);
    double speed = (after.centre[1] - from) / 0.5, momentum = 10 * speed + (double)(then.mass * then.velocity.y);
    assert_true(speed > 0.1 && then.velocity.y < 1.9f);
    if (!(fabs(momentum - 2 * (double)ball.mass) < 0.1 * 2 * (double)ball.mass)) fail_msg("momentum %g N s, at first %g", momentum, 2 * (double)ball.mass);
    (void)before;
    end(world);
}

/* A sheet folded over by a rod lies on itself: no two of its vertices that are far apart on it come nearer than its thickness. */
static void folded(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_shape_desc floor = es_default_shape_desc();
    floor.type = ES_SHAPE_BOX;
    floor.half_extents = es_v3(5, 0.5f, 5);
    add_body(world, ES_BODY_STATIC, floor, 0, -0.9, 0);
    es_soft_desc desc = es_default_soft_desc();
    enum { N = SIDE < 16 ? 9 : 16 };
    desc.mesh = sheet(world, N, N, 0.6f, 0.6f);
    desc.self_collision = true;
    desc.thickness = 0.03f;
    desc.bend_compliance = 10;
    es_soft_attachment hold = {.vertex = (N - 1) / 2, .in_place = true}; /* hung by the middle of an edge, then dropped on the floor */
    desc.attachments = &hold;
    desc.attachment_count = 1;
    es_soft soft = add_soft(world, &desc);
    run(world, STEPS);
    assert_int_equal(es_world_soft_detach(world, soft, ES_SOFT_ALL), ES_OK);
    run(world, 2 * STEPS);
    static double p[N * N][3];
    for (uint32_t v = 0; v < N * N; v++) assert_int_equal(es_world_get_soft_vertex(world, soft, v, p[v], NULL), ES_OK);
    double nearest = 1;
    for (uint32_t a = 0; a < N * N; a++)
        for (uint32_t b = a + 1; b < N * N; b++) {
            int dx = abs((int)(a % N) - (int)(b % N)), dy = abs((int)(a / N) - (int)(b / N));
            if (dx * dx + dy * dy < 9) continue;
            double d = sqrt((p[a][0] - p[b][0]) * (p[a][0] - p[b][0]) + (p[a][1] - p[b][1]) * (p[a][1] - p[b][1]) + (p[a][2] - p[b][2]) * (p[a][2] - p[b][2]));
            nearest = d < nearest ? d : nearest;
        }
    if (!(nearest > 0.8 * 0.03)) fail_msg("two parts are %g m apart", nearest);
    end(world);
}

/* ---- holding and tearing -------------------------------------------------------------------------------------------------------------- */

static void held_and_let_go(void** state)
{
    es_world* world = make_world(make_context(1, 0), true);
    es_node node;
    es_node_desc node_desc = {"hook", {0}, es_identity_transform()};
    node_desc.transform.translation = es_v3(-0.5f, 0, 0);
    assert_int_equal(es_world_add_node(world, &node_desc, &node), ES_OK);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, 6, 6, 1, 1);
    es_soft soft = add_soft(world, &desc);
    assert_int_equal(es_world_soft_attach(world, soft, &(es_soft_attachment){.vertex = 0, .node = node}), ES_OK);
    assert_int_equal(es_world_soft_attach(world, soft, &(es_soft_attachment){.vertex = 5, .in_place = true}), ES_OK);
    assert_int_equal(es_world_soft_attach(world, soft, &(es_soft_attachment){.vertex = 36, .in_place = true}), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_destroy_node(world, node), ES_WRONG_STATE);
    assert_int_equal(state_of(world, soft).attachments, 2);
    es_transform transform = node_desc.transform;
    for (int i = 0; i < 30; i++) {
        transform.translation.x = -0.5f + 0.01f * (float)i;
        assert_int_equal(es_world_set_node_transform(world, node, &transform), ES_OK);
        run(world, 1);
        double p[3];
        assert_int_equal(es_world_get_soft_vertex(world, soft, 0, p, NULL), ES_OK);
        assert_true(fabs(p[0] - (double)transform.translation.x) < 1e-5 && fabs(p[1]) < 1e-5);
    }
    /* at rest it sleeps, and nothing changes any more */
    int steps = 0;
    for (; steps < 4000 && !state_of(world, soft).asleep; steps++) run(world, 1);
    assert_true(steps < 4000);
    run(world, 2);
    es_world_revisions a = es_world_get_revisions(world);
    run(world, 3);
    es_world_revisions b = es_world_get_revisions(world);
    assert_true(a.geometry == b.geometry && !b.moving);
    assert_int_equal(es_world_soft_detach(world, soft, 5), ES_OK);
    assert_int_equal(es_world_soft_detach(world, soft, ES_SOFT_ALL), ES_OK);
    double before = state_of(world, soft).centre[1];
    run(world, 30);
    assert_true(before - state_of(world, soft).centre[1] > 0.8);
    assert_int_equal(es_world_destroy_node(world, node), ES_OK);
    /* a hand */
    assert_int_equal(es_world_grab_soft(world, 1, soft, 7, (double[3]){0, 0, 0}), ES_OK);
    assert_int_equal(es_world_grab_soft(world, ES_HANDS, soft, 7, (double[3]){0, 0, 0}), ES_INVALID_ARGUMENT);
    run(world, 60);
    double p[3];
    assert_int_equal(es_world_get_soft_vertex(world, soft, 7, p, NULL), ES_OK);
    assert_true(fabs(p[0]) + fabs(p[1]) + fabs(p[2]) < 1e-4);
    es_soft_contact contact;
    assert_int_equal(es_world_soft_pick(world, (double[3]){1e-3, 5, 2e-3}, es_v3(0, -1, 0), 100, &contact), ES_OK);
    assert_int_equal(contact.soft.id, soft.id);
    assert_true(contact.distance > 4.5f && contact.distance < 5.5f);
    assert_int_equal(es_world_destroy_soft(world, soft), ES_OK);
    assert_int_equal(es_world_destroy_soft(world, soft), ES_STALE_HANDLE);
    end(world);
}

static uint32_t shown_triangles(es_world* world, es_mesh mesh)
{
    const es_raster_mesh* shown = es_world_mesh(world, mesh);
    uint32_t count = 0;
    for (uint32_t t = 0; t < shown->triangle_count; t++) {
        const uint32_t* v = shown->indices + 3 * (size_t)t;
        assert_true(v[0] < shown->vertex_count && v[1] < shown->vertex_count && v[2] < shown->vertex_count);
        count += v[0] != v[1] && v[1] != v[2];
    }
    return count;
}

static void torn(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_soft_desc desc = es_default_soft_desc();
    enum { N = 10 };
    desc.mesh = sheet(world, N, N, 1, 1);
    desc.tearable = true;
    es_soft_attachment held[N];
    for (uint32_t i = 0; i < N; i++) held[i] = (es_soft_attachment){.vertex = i, .in_place = true};
    desc.attachments = held;
    desc.attachment_count = N;
    es_soft soft = add_soft(world, &desc);
    run(world, 10);
    /* cut along a row: the lower part falls */
    for (int i = 0; i <= 20; i++) {
        double p[3], q[3];
        assert_int_equal(es_world_get_soft_vertex(world, soft, 5 * N, p, NULL), ES_OK);
        assert_int_equal(es_world_get_soft_vertex(world, soft, 5 * N + N - 1, q, NULL), ES_OK);
        for (int k = 0; k < 3; k++) p[k] += (q[k] - p[k]) * i / 20;
        assert_int_equal(es_world_soft_tear(world, soft, p, 0.03f), ES_OK);
    }
    es_soft_state now = state_of(world, soft);
    assert_true(now.torn > 0 && now.particles > N * N);
    assert_true(shown_triangles(world, desc.mesh) <= now.triangles);
    size_t size = 0;
    assert_int_equal(es_world_save(world, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_int_equal(es_world_save(world, saved, &size), ES_OK);
    run(world, 60);
    double top[3], bottom[3];
    assert_int_equal(es_world_get_soft_vertex(world, soft, 2 * N, top, NULL), ES_OK);
    assert_int_equal(es_world_get_soft_vertex(world, soft, 9 * N + 4, bottom, NULL), ES_OK);
    if (!(top[1] > -1 && bottom[1] < -3)) fail_msg("top %g bottom %g torn %u of %u", top[1], bottom[1], now.torn, now.particles);
    /* by stretch: a hard pull, then everything to pieces; and back */
    es_soft_desc weak;
    assert_int_equal(es_world_get_soft(world, soft, &weak), ES_OK);
    weak.tear_stretch = 1.05f;
    assert_int_equal(es_world_set_soft(world, soft, &weak), ES_OK);
    for (int i = 0; i < 30; i++) {
        for (uint32_t v = 0; v < N * N; v++) assert_int_equal(es_world_soft_impulse(world, soft, v, es_v3(v & 1 ? 5.0f : -5.0f, 0, v & 2 ? 5.0f : -5.0f)), ES_OK);
        run(world, 1);
        es_soft_state shreds = state_of(world, soft);
        assert_true(isfinite(shreds.kinetic_energy) && isfinite(shreds.largest_stretch));
    }
    assert_true(state_of(world, soft).torn > now.torn);
    shown_triangles(world, desc.mesh);
    uint64_t hash = es_world_hash(world);
    assert_int_equal(es_world_restore(world, saved, size), ES_OK);
    assert_int_not_equal(es_world_hash(world), hash);
    assert_int_equal(state_of(world, soft).torn, now.torn);
    run(world, 60);
    double again[3];
    assert_int_equal(es_world_get_soft_vertex(world, soft, 9 * N + 4, again, NULL), ES_OK);
    assert_memory_equal(again, bottom, sizeof again);
    free(saved);
    end(world);
}

/* ---- the same bits ---------------------------------------------------------------------------------------------------------------------- */

static uint64_t scene_hash(es_world* world, es_soft* cloth, int steps)
{
    es_shape_desc box = es_default_shape_desc();
    box.type = ES_SHAPE_BOX;
    box.half_extents = es_v3(0.2f, 0.2f, 0.2f);
    add_body(world, ES_BODY_STATIC, sphere(0.5f), 0, -0.8, 1.2);
    add_body(world, ES_BODY_DYNAMIC, box, 0.1, 0.6, 1.0);
    es_soft_desc desc = es_default_soft_desc();
    desc.mesh = sheet(world, SIDE, SIDE, 2, 2);
    desc.self_collision = true;
    desc.tear_stretch = 1.8f;
    desc.wind = es_v3(1, 0, 2);
    const es_soft_attachment held[2] = {{.vertex = 0, .in_place = true}, {.vertex = SIDE - 1, .in_place = true}};
    desc.attachments = held;
    desc.attachment_count = 2;
    *cloth = add_soft(world, &desc);
    es_soft_desc ball = es_default_soft_desc();
    es_soft_solid fill;
    ball.mesh = box_mesh(world, 0.2f);
    assert_int_equal(es_soft_fill(world, ball.mesh, 0.1f, &fill), ES_OK);
    ball.solid = &fill;
    add_soft(world, &ball);
    es_soft_solid_free(world, &fill);
    run(world, steps);
    return es_world_hash(world);
}

static void same_bits(void** state)
{
    es_soft cloth;
    uint64_t expected = 0;
    uint32_t available = es_isa_available_mask();
    for (uint32_t isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(available >> isa & 1)) continue;
        for (uint32_t count = 1; count <= 3; count += 2) {
            es_world* world = make_world(make_context(count, 1u << isa), true);
            uint64_t hash = scene_hash(world, &cloth, STEPS / 2);
            if (expected == 0) expected = hash;
            if (hash != expected) fail_msg("%s, %u threads", es_isa_name((es_isa)isa), count);
            end(world);
        }
    }
}

static void saved(void** state)
{
    es_world* world = make_world(make_context(2, 0), true);
    es_soft cloth;
    uint64_t at_first = scene_hash(world, &cloth, STEPS / 4), hashes[20];
    size_t size = 0;
    assert_int_equal(es_world_save(world, NULL, &size), ES_OK);
    char* buffer = malloc(size);
    assert_int_equal(es_world_save(world, buffer, &size), ES_OK);
    for (int i = 0; i < 20; i++) {
        if (i == 5) assert_int_equal(es_world_soft_detach(world, cloth, 0), ES_OK);
        assert_int_equal(es_world_step(world, 0.011f), ES_OK); /* not the fixed step: what is shown lies between two */
        hashes[i] = es_world_hash(world);
    }
    assert_int_equal(es_world_restore(world, buffer, size), ES_OK);
    assert_int_equal(es_world_hash(world), at_first);
    for (int i = 0; i < 20; i++) {
        if (i == 5) assert_int_equal(es_world_soft_detach(world, cloth, 0), ES_OK);
        assert_int_equal(es_world_step(world, 0.011f), ES_OK);
        if (es_world_hash(world) != hashes[i]) fail_msg("step %d after restoring", i);
    }
    uint64_t before = es_world_hash(world);
    for (size_t at = 24; at < size; at += size / 37 + 1) { /* damaged: refused, nothing touched */
        buffer[at] = (char)(buffer[at] ^ 0x40);
        assert_int_not_equal(es_world_restore(world, buffer, size), ES_OK);
        buffer[at] = (char)(buffer[at] ^ 0x40);
    }
    assert_int_equal(es_world_hash(world), before);
    free(buffer);
    end(world);
}

/* ---- what is hard -------------------------------------------------------------------------------------------------------------------------- */

static void assert_sane(es_world* world, es_soft soft, uint32_t count)
{
    for (uint32_t v = 0; v < count; v++) {
        double p[3];
        es_vec3 velocity;
        assert_int_equal(es_world_get_soft_vertex(world, soft, v, p, &velocity), ES_OK);
        for (int k = 0; k < 3; k++) assert_true(fabs(p[k]) < 1e6);
        assert_true(fabsf(velocity.x) <= 1001 && fabsf(velocity.y) <= 1001 && fabsf(velocity.z) <= 1001);
    }
}

static void odd(void** state)
{
    static const float p[33] = {0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 1, 0, 0, 0 /* at vertex 0 */, 0.5f, 0, 0 /* on an edge */, 0.5f, 1, 0.5f, 0.5f, -1, 0.5f, 2, 0, 0, 3, 0, 0, 9, 9, 9 /* in no triangle */};
    /* two that share a diagonal, one without area, a third and fourth at the same edge, a doubled one, one that names a vertex twice */
    static const uint32_t indices[24] = {0, 1, 2, 1, 3, 2, 0, 5, 1, 4, 3, 6, 4, 3, 7, 0, 1, 2, 1, 8, 9, 2, 2, 3};
    for (int variant = 0; variant < 6; variant++) {
        es_world* world = make_world(make_context(1, 0), variant & 1);
        es_mesh mesh;
        assert_int_equal(es_world_add_mesh(world, &(es_mesh_desc){.vertex_count = 11, .triangle_count = 8, .positions = p, .indices = indices}, &mesh), ES_OK);
        es_soft_desc desc = es_default_soft_desc();
        desc.mesh = mesh;
        desc.tear_stretch = variant == 1 ? 1.01f : 0;
        desc.mass = variant == 2 ? 1e-6f : 1e6f;
        desc.pressure = variant == 3 ? 1e6f : 0;
        desc.self_collision = variant == 4;
        desc.drag = 1e3f;
        desc.wind = es_v3(1e3f, -1e3f, 1e3f);
        desc.substeps = variant == 5 ? 1 : 0;
        es_soft_attachment held[8];
        for (uint32_t i = 0; i < 8; i++) held[i] = (es_soft_attachment){.vertex = i, .in_place = true};
        desc.attachments = held;
        desc.attachment_count = variant == 0 ? 8 : 1;
        es_soft soft = add_soft(world, &desc);
        es_soft other;
        assert_int_equal(es_world_add_soft(world, &desc, &other), ES_WRONG_STATE);
        for (int i = 0; i < 20; i++) {
            if (i == 10) assert_int_equal(es_world_soft_impulse(world, soft, 3, es_v3(1e12f, 1e12f, -1e12f)), ES_OK);
            assert_int_equal(es_world_step(world, i == 4 ? 0 : i == 5 ? 1e-6f : i == 6 ? 0.5f : 1.0f / 60), ES_OK);
            assert_sane(world, soft, 10);
        }
        end(world);
    }
}

static void refused(void** state)
{
    es_world* world = make_world(make_context(1, 0), false);
    es_soft_desc good = es_default_soft_desc(), desc;
    good.mesh = sheet(world, 3, 3, 1, 1);
    es_soft soft;
#define REFUSED(change, result)                                        \
    do {                                                               \
        desc = good;                                                   \
        change;                                                        \
        assert_int_equal(es_world_add_soft(world, &desc, &soft), result); \
        assert_int_equal(soft.id, 0);                                  \
    } while (0)
    REFUSED(desc.mass = 0, ES_INVALID_ARGUMENT);
    REFUSED(desc.mass = NAN, ES_INVALID_ARGUMENT);
    REFUSED(desc.stretch_compliance = -1, ES_INVALID_ARGUMENT);
    REFUSED(desc.thickness = INFINITY, ES_INVALID_ARGUMENT);
    REFUSED(desc.tear_stretch = 0.5f, ES_INVALID_ARGUMENT);
    REFUSED(desc.substeps = 5000, ES_INVALID_ARGUMENT);
    REFUSED(desc.mesh.id = 0, ES_STALE_HANDLE);
    REFUSED(desc.node.id = 99, ES_STALE_HANDLE);
    REFUSED(desc.attachment_count = 1, ES_INVALID_ARGUMENT);
    const es_soft_attachment beyond = {.vertex = 9, .in_place = true};
    REFUSED((desc.attachments = &beyond, desc.attachment_count = 1), ES_INVALID_ARGUMENT);
    es_soft_solid fill;
    assert_int_equal(es_soft_fill(world, good.mesh, 1e-5f, &fill), ES_INVALID_ARGUMENT);
    assert_int_equal(es_soft_fill(world, good.mesh, NAN, &fill), ES_INVALID_ARGUMENT);
    float points[12] = {0};
    uint32_t corners[4] = {0, 1, 2, 4};
    es_soft_solid solid = {4, 1, points, corners};
    REFUSED(desc.solid = &solid, ES_INVALID_ARGUMENT);
    corners[3] = 3; /* a solid without any volume is survived */
    desc = good;
    desc.solid = &solid;
    soft = add_soft(world, &desc);
    run(world, 5);
    assert_sane(world, soft, 4);
    end(world);
}

/* Memory that runs out while a cloth is made, stepped or torn is an error, and everything can still be let go of. */
static void scarce(void** state)
{
    bool whole = false;
    for (size_t cap = 20000; !whole && cap < 40000000; cap += cap / 6) {
        es_context_desc context_desc = es_default_context_desc();
        context_desc.threads = 1;
        context_desc.memory_cap = cap;
        context_desc.logger.log = no_log;
        es_context* context;
        if (es_context_create(&context_desc, &context) != ES_OK) continue;
        es_world* world;
        if (es_world_create(context, NULL, &world) == ES_OK) {
            float p[300];
            uint32_t indices[486];
            for (int i = 0; i < 100; i++) {
                p[3 * i] = (float)(i % 10) * 0.1f;
                p[3 * i + 1] = 0;
                p[3 * i + 2] = (float)(i / 10) * 0.1f;
            }
            for (uint32_t i = 0; i < 81; i++) {
                uint32_t a = i / 9 * 10 + i % 9;
                const uint32_t six[6] = {a, a + 10, a + 1, a + 1, a + 10, a + 11};
                memcpy(indices + 6 * i, six, sizeof six);
            }
            es_soft_desc desc = es_default_soft_desc();
            desc.tear_stretch = 1.02f;
            desc.self_collision = true;
            es_soft soft;
            bool good = es_world_add_mesh(world, &(es_mesh_desc){.vertex_count = 100, .triangle_count = 162, .positions = p, .indices = indices}, &desc.mesh) == ES_OK;
            good = good && es_world_add_soft(world, &desc, &soft) == ES_OK;
            for (int i = 0; i < 5 && good; i++) {
                es_world_soft_impulse(world, soft, (uint32_t)(17 * i), es_v3(0, 3, 0));
                good = es_world_step(world, 1.0f / 60) == ES_OK;
            }
            whole = good;
            es_world_destroy(world);
        }
        assert_int_equal(es_context_bytes(context), 0);
        es_context_destroy(context);
    }
    assert_true(whole);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hanging), cmocka_unit_test(pendulum), cmocka_unit_test(conserved), cmocka_unit_test(solid), cmocka_unit_test(over_sphere), cmocka_unit_test(pushes_bodies),
        cmocka_unit_test(folded), cmocka_unit_test(held_and_let_go), cmocka_unit_test(torn), cmocka_unit_test(same_bits), cmocka_unit_test(saved), cmocka_unit_test(odd),
        cmocka_unit_test(refused), cmocka_unit_test(scarce),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
