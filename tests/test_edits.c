/* Reflection edits as data of a world: handles follow surfaces, keys move them, what is stale has no effect and says why, and the list for the light counts up
 * exactly where it differs. */
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
#include "tests/races.h"

typedef struct scene { es_context* context; es_world* world; es_mesh mesh; es_node node; es_instance mirror, other; es_camera camera; es_node camera_node; } scene;

/* A mirror, the square of ±1 m in the xy plane, facing +z, of 8 × 8 cells; behind the eye at z = 5 another. */
static void fill_scene(scene* out)
{
    scene s = *out;
    assert_int_equal(es_world_create(s.context, NULL, &s.world), ES_OK);
    enum { N = 8 };
    float positions[(N + 1) * (N + 1)][3];
    uint32_t indices[2 * N * N][3];
    for (int i = 0; i <= N; i++)
        for (int k = 0; k <= N; k++) {
            float* p = positions[i * (N + 1) + k];
            p[0] = 2.0f * (float)k / N - 1;
            p[1] = 2.0f * (float)i / N - 1;
            p[2] = 0;
        }
    for (uint32_t i = 0; i < N; i++)
        for (uint32_t k = 0; k < N; k++) {
            const uint32_t a = i * (N + 1) + k, corners[6] = {a, a + 1, a + N + 1, a + 1, a + N + 2, a + N + 1};
            memcpy(indices[2 * (i * N + k)], corners, sizeof corners);
        }
    es_mesh_desc mesh = {.name = "square", .vertex_count = (N + 1) * (N + 1), .triangle_count = 2 * N * N, .positions = positions[0], .indices = indices[0]};
    assert_int_equal(es_world_add_mesh(s.world, &mesh, &s.mesh), ES_OK);
    assert_int_equal(es_world_add_node(s.world, &(es_node_desc){.name = "mirror"}, &s.node), ES_OK);
    es_node there;
    assert_int_equal(es_world_add_node(s.world, &(es_node_desc){.name = "other", .transform = {{0, 0, 9}, {0, 1, 0, 0}, {1, 1, 1}}}, &there), ES_OK);
    assert_int_equal(es_world_add_instance(s.world, &(es_instance_desc){.node = s.node, .mesh = s.mesh}, &s.mirror), ES_OK);
    assert_int_equal(es_world_add_instance(s.world, &(es_instance_desc){.node = there, .mesh = s.mesh}, &s.other), ES_OK);
    assert_int_equal(es_world_add_node(s.world, &(es_node_desc){.name = "eye", .transform = {.translation = {0, 0, 5}}}, &s.camera_node), ES_OK);
    es_camera_desc camera = es_default_camera_desc();
    camera.node = s.camera_node;
    assert_int_equal(es_world_add_camera(s.world, &camera, &s.camera), ES_OK);
    *out = s;
}

static scene open_scene(void)
{
    scene s = {0};
    es_context_desc context = es_default_context_desc();
    context.threads = 2;
    assert_int_equal(es_context_create(&context, &s.context), ES_OK);
    fill_scene(&s);
    return s;
}

static void close_scene(scene* s)
{
    es_world_destroy(s->world);
    assert_int_equal(es_context_bytes(s->context), 0);
    es_context_destroy(s->context);
}

static es_anchor anchor_at(const scene* s, es_instance instance, double x, double y, double z)
{
    es_anchor anchor;
    assert_int_equal(es_world_anchor_of_point(s->world, instance, (const double[3]){x, y, z}, &anchor), ES_OK);
    assert_int_equal(anchor.kind, ES_ANCHOR_SURFACE);
    return anchor;
}

static es_constraint_desc constraint_desc(const scene* s)
{
    es_constraint_desc d = es_default_constraint_desc();
    d.name = "face";
    d.reflecting = anchor_at(s, s->mirror, 0.3, 0.2, 0);
    d.reflected = anchor_at(s, s->other, -0.5, 0.5, 9);
    d.eye[2] = 5;
    return d;
}

static es_constraint add_constraint(const scene* s, const es_constraint_desc* d)
{
    es_constraint constraint;
    assert_int_equal(es_world_add_constraint(s->world, d, &constraint), ES_OK);
    return constraint;
}

static es_region add_region(const scene* s, es_region_type type, float radius)
{
    es_region region;
    es_region_desc d = es_default_region_desc();
    d.type = type;
    d.centre = anchor_at(s, s->mirror, 0.25, 0.25, 0);
    d.radius = radius;
    assert_int_equal(es_world_add_region(s->world, &d, &region), ES_OK);
    return region;
}

static es_constraint_state state_of(const scene* s, es_constraint constraint)
{
    es_constraint_state state;
    assert_int_equal(es_world_get_constraint_state(s->world, constraint, &state), ES_OK);
    return state;
}

static void assert_place(const double p[3], double x, double y, double z)
{
    if (!(fabs(p[0] - x) < 1e-5 && fabs(p[1] - y) < 1e-5 && fabs(p[2] - z) < 1e-5)) fail_msg("at %g %g %g, not %g %g %g", p[0], p[1], p[2], x, y, z);
}

static void test_handles_follow_their_surfaces(void** state)
{
    scene s = open_scene();
    es_constraint_desc d = constraint_desc(&s);
    es_constraint c = add_constraint(&s, &d);
    assert_place(state_of(&s, c).position, 0.3, 0.2, 0);
    assert_place(state_of(&s, c).target, -0.5, 0.5, 9);
    assert_true(fabsf(state_of(&s, c).normal.z - 1) < 1e-6f);
    es_transform t = {{1, 2, 3}, es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI / 2), {2, 2, 2}};
    assert_int_equal(es_world_set_node_transform(s.world, s.node, &t), ES_OK);
    assert_place(state_of(&s, c).position, 1, 2.4, 2.4);
    assert_true(fabsf(state_of(&s, c).normal.x - 1) < 1e-6f);
    float positions[81 * 3];
    for (int v = 0; v < 81; v++) {
        const float* p = es_world_mesh(s.world, s.mesh)->positions + 4 * v;
        positions[3 * v] = p[0];
        positions[3 * v + 1] = p[1];
        positions[3 * v + 2] = 0.5f;
    }
    assert_int_equal(es_world_deform_mesh(s.world, s.mesh, positions, NULL), ES_OK);
    assert_place(state_of(&s, c).position, 2, 2.4, 2.4);
    const es_edit_list* list = es_world_edits(s.world);
    assert_int_equal(list->constraint_count, 1);
    const es_resolved_constraint* r = &list->constraints[0];
    assert_true(r->handle.id == c.id && r->instance == (s.mirror.id & 0xfffff) && fabsf(r->position.x - 2) < 1e-5f && r->eye.z == 5 && !r->distances);
    es_vec3 to = es_v3_sub(r->target, r->position);
    assert_true(fabsf(es_v3_dot(to, r->direction) - es_v3_length(to)) < 1e-4f);
    close_scene(&s);
}

static void test_regions_have_influence_where_they_are(void** state)
{
    scene s = open_scene();
    es_constraint_desc d = constraint_desc(&s);
    d.reflecting = anchor_at(&s, s.mirror, 0.25, 0.65, 0);
    es_constraint c = add_constraint(&s, &d);
    assert_true(state_of(&s, c).influence == 0);
    es_region types[2] = {add_region(&s, ES_REGION_EUCLIDEAN, 0.5f), add_region(&s, ES_REGION_GEODESIC, 0.5f)};
    for (int i = 0; i < 2; i++) {
        /* 0.4 m from the middle, half-way through the border */
        assert_true(fabsf(es_world_region_influence(s.world, types[i], &d.reflecting) - 0.5f) < 1e-4f);
        es_anchor inside = anchor_at(&s, s.mirror, 0.3, 0.3, 0), outside = anchor_at(&s, s.mirror, -0.5, 0.3, 0), elsewhere = anchor_at(&s, s.other, 0.3, 0.3, 9);
        assert_true(es_world_region_influence(s.world, types[i], &inside) == 1);
        assert_true(es_world_region_influence(s.world, types[i], &outside) == 0);
        assert_true(es_world_region_influence(s.world, types[i], &elsewhere) == 0);
    }
    assert_true(fabsf(state_of(&s, c).influence - 0.5f) < 1e-4f);
    es_region_stroke strokes[2] = {{anchor_at(&s, s.mirror, -0.8, -0.5, 0), anchor_at(&s, s.mirror, 0.8, -0.5, 0), 0.3f, false}, {anchor_at(&s, s.mirror, 0, -0.5, 0), anchor_at(&s, s.mirror, 0.1, -0.5, 0), 0.3f, true}};
    es_region_desc free_form = {.type = ES_REGION_FREE_FORM, .border = 0.1f, .strokes = strokes, .stroke_count = 2};
    es_region drawn;
    assert_int_equal(es_world_add_region(s.world, &free_form, &drawn), ES_OK);
    es_anchor at = anchor_at(&s, s.mirror, -0.5, -0.5, 0), erased = anchor_at(&s, s.mirror, 0.05, -0.5, 0), edge = anchor_at(&s, s.mirror, -0.5, -0.25, 0);
    assert_true(es_world_region_influence(s.world, drawn, &at) == 1);
    assert_true(es_world_region_influence(s.world, drawn, &erased) == 0);
    assert_true(fabsf(es_world_region_influence(s.world, drawn, &edge) - 0.5f) < 1e-4f);
    const es_edit_list* list = es_world_edits(s.world);
    assert_int_equal(list->region_count, 3);
    assert_true(list->regions[0].instance == ES_EVERY_INSTANCE && list->regions[1].distances && list->regions[2].stroke_count == 2 && list->regions[2].strokes[1].erase);
    close_scene(&s);
}

/* Small regions in large triangles, across their edges; regions of no size. */
static void test_geodesic_regions_reach_over_edges(void** state)
{
    scene s = open_scene();
    es_region region = add_region(&s, ES_REGION_GEODESIC, 0.1f);
    es_region_desc d;
    for (uint32_t i = 0; i < 300; i++) {
        const double x = 1.8 * (double)es_random_float(1, i) - 0.9, y = 1.8 * (double)es_random_float(2, i) - 0.9, radius = 0.01 + 0.2 * (double)es_random_float(3, i);
        const double dx = 1.2 * radius * (2 * (double)es_random_float(4, i) - 1), dy = 1.2 * radius * (2 * (double)es_random_float(5, i) - 1);
        assert_int_equal(es_world_get_region(s.world, region, &d), ES_OK);
        d.centre = anchor_at(&s, s.mirror, x, y, 0);
        d.radius = (float)radius;
        d.border = 0.5f * (float)radius;
        assert_int_equal(es_world_set_region(s.world, region, &d), ES_OK);
        es_anchor at = anchor_at(&s, s.mirror, x + dx, y + dy, 0);
        if (fabs(x + dx) > 1 || fabs(y + dy) > 1) continue;
        double t = fmin(1, fmax(0, (hypot(dx, dy) - 0.5 * radius) / (0.5 * radius))), exact = 1 - t * t * (3 - 2 * t);
        if (fabs((double)es_world_region_influence(s.world, region, &at) - exact) > 2e-3) fail_msg("%u: influence %g, not %g, at %g of %g m", i, (double)es_world_region_influence(s.world, region, &at), exact, hypot(dx, dy), radius);
    }
    d.radius = 0;
    assert_int_equal(es_world_set_region(s.world, region, &d), ES_OK);
    assert_true(es_world_region_influence(s.world, region, &d.centre) == 0);
    assert_int_equal(es_world_edits(s.world)->region_count, 1); /* it covers nothing, but is there */
    d.radius = 0.5f;
    assert_int_equal(es_world_set_region(s.world, region, &d), ES_OK);
    es_transform none = {{0, 0, 0}, {0, 0, 0, 1}, {0, 0, 0}};
    assert_int_equal(es_world_set_node_transform(s.world, s.node, &none), ES_OK); /* a surface of no size */
    assert_true(es_world_region_influence(s.world, region, &d.centre) == 1);
    close_scene(&s);
}

/* A skinned mesh: asked first, before anything else has computed its vertices. */
static void test_handles_follow_skins(void** state)
{
    es_context* context;
    es_world* world;
    es_context_desc context_desc = es_default_context_desc();
    context_desc.threads = 2;
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 3000;
    assert_int_equal(es_context_create(&context_desc, &context), ES_OK);
    assert_int_equal(es_world_create_scene(context, "creature", &settings, &world), ES_OK);
    uint32_t skin, ids[256];
    size_t count = 1, instances = 256;
    es_skin_state skinned;
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_SKIN, &skin, &count), ES_OK);
    assert_int_equal(es_world_get_skin(world, (es_skin){skin}, &skinned), ES_OK);
    assert_int_equal(es_world_enumerate(world, ES_OBJECT_INSTANCE, ids, &instances), ES_OK);
    es_instance_desc desc = {{0}};
    size_t i = 0;
    while (i < instances && (es_world_get_instance(world, (es_instance){ids[i]}, &desc), desc.mesh.id != skinned.mesh.id)) i++;
    assert_true(i < instances);
    es_anchor anchor;
    es_region region;
    assert_int_equal(es_world_anchor_of_triangle(world, (es_instance){ids[i]}, 17, 0.25f, 0.5f, &anchor), ES_OK);
    assert_int_equal(es_world_add_region(world, &(es_region_desc){.type = ES_REGION_GEODESIC, .centre = anchor, .radius = 0.2f, .border = 0.1f}, &region), ES_OK);
    uint64_t before = 0;
    double moved = 0, last[3] = {0};
    for (int step = 0; step < 5; step++) {
        double place[3];
        es_mat4 m;
        assert_int_equal(es_world_step(world, 0.1f), ES_OK);
        assert_true(es_world_resolve_anchor(world, &anchor, place, NULL));
        assert_true(es_world_region_influence(world, region, &anchor) == 1);
        assert_true(es_world_get_revisions(world).edits != before);
        before = es_world_get_revisions(world).edits;
        const es_raster_mesh* mesh = es_world_mesh(world, skinned.mesh);
        assert_int_equal(es_world_get_node_matrix(world, desc.node, &m), ES_OK);
        for (int k = 0; k < 3; k++) {
            double sum = m.m[12 + k];
            for (int axis = 0; axis < 3; axis++) {
                const float w[3] = {0.25f, 0.25f, 0.5f};
                for (int c = 0; c < 3; c++) sum += (double)m.m[4 * axis + k] * (double)w[c] * (double)mesh->positions[4 * mesh->indices[3 * 17 + c] + (uint32_t)axis];
            }
            assert_true(fabs(place[k] - sum) < 1e-5);
            moved += step ? fabs(place[k] - last[k]) : 0;
            last[k] = place[k];
        }
    }
    assert_true(moved > 1e-3);
    es_world_destroy(world);
    assert_int_equal(es_context_bytes(context), 0);
    es_context_destroy(context);
}

static void test_stale_edits_have_no_effect_and_say_why(void** state)
{
    scene s = open_scene();
    es_constraint_desc d = constraint_desc(&s);
    es_constraint c = add_constraint(&s, &d);
    es_region region = add_region(&s, ES_REGION_GEODESIC, 0.5f);
    assert_int_equal(es_world_destroy_instance(s.world, s.other), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_STALE);
    assert_int_equal(es_world_edits(s.world)->constraint_count, 0);
    d.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {0, 1, 2}};
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_ACTIVE);
    assert_int_equal(es_world_destroy_instance(s.world, s.mirror), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_STALE);
    es_region_state r;
    assert_int_equal(es_world_get_region_state(s.world, region, &r), ES_OK);
    assert_int_equal(r.effect, ES_EDIT_STALE);
    assert_int_equal(es_world_edits(s.world)->region_count, 0);
    close_scene(&s);
}

static void test_bad_numbers_are_refused(void** state)
{
    scene s = open_scene();
    es_constraint_desc good = constraint_desc(&s), d;
    es_constraint c;
    es_constraint_key keys[2] = {{1, good.reflecting, good.reflected, {0}}, {1, good.reflecting, good.reflected, {0}}};
#define REFUSED(change) (d = good, change, assert_int_equal(es_world_add_constraint(s.world, &d, &c), ES_INVALID_ARGUMENT))
    REFUSED(d.reflecting.u = NAN);
    REFUSED(d.reflecting.v = -0.1f);
    REFUSED(d.reflecting.kind = ES_ANCHOR_POINT);
    REFUSED(d.reflected = ((es_anchor){.kind = ES_ANCHOR_POINT, .point = {0, INFINITY, 0}}));
    REFUSED(d.eye[1] = (double)NAN);
    REFUSED(d.orientation.w = NAN);
    REFUSED(d.fov_y = 4);
    REFUSED(d.refraction = true); /* without a direction */
    REFUSED((d.keys = keys, d.key_count = 2));
    REFUSED((d.parameter.kind = ES_EDIT_NAMED));
    REFUSED((d.key_count = 3));
    es_region_desc region = es_default_region_desc();
    es_region r;
    region.radius = NAN;
    assert_int_equal(es_world_add_region(s.world, &region, &r), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_set_parameter(s.world, "x", NAN), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_set_parameter(s.world, "", 1), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_freeze_reflections(s.world, (const double[3]){0, (double)NAN, 0}), ES_INVALID_ARGUMENT);
    size_t count = 0;
    assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_CONSTRAINT, NULL, &count), ES_OK);
    assert_int_equal(count, 0);
    close_scene(&s);
}

static uint64_t revision(const scene* s) { return es_world_get_revisions(s->world).edits; }

static void test_the_list_counts_what_differs(void** state)
{
    scene s = open_scene();
    uint64_t r = revision(&s);
    es_constraint_desc d = constraint_desc(&s);
    es_constraint c = add_constraint(&s, &d);
    assert_true(revision(&s) == r + 1);
    assert_true(revision(&s) == r + 1);
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK); /* the same */
    assert_true(revision(&s) == r + 1);
    es_transform eye = {.translation = {1, 0, 5}};
    assert_int_equal(es_world_set_node_transform(s.world, s.camera_node, &eye), ES_OK);
    assert_true(revision(&s) == r + 1); /* it holds for its own view */
    d.follows_view = true;
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_true(revision(&s) == r + 2);
    eye.translation.y = 1;
    assert_int_equal(es_world_set_node_transform(s.world, s.camera_node, &eye), ES_OK);
    assert_true(revision(&s) == r + 3);
    assert_true(es_world_edits(s.world)->constraints[0].eye.y == 1);
    assert_int_equal(es_world_freeze_reflections(s.world, (const double[3]){1, 2, 3}), ES_OK);
    assert_true(revision(&s) == r + 4 && es_world_edits(s.world)->frozen && es_world_edits(s.world)->eye.z == 3);
    assert_int_equal(es_world_freeze_reflections(s.world, NULL), ES_OK);
    assert_true(revision(&s) == r + 5 && !es_world_frozen_reflections(s.world, NULL));
    assert_int_equal(es_world_destroy_constraint(s.world, c), ES_OK);
    assert_true(revision(&s) == r + 6);
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_STALE_HANDLE);
    close_scene(&s);
}

static void test_keys_go_by_their_parameter(void** state)
{
    scene s = open_scene();
    es_constraint_desc d = constraint_desc(&s);
    es_constraint_key keys[3] = {{1, anchor_at(&s, s.mirror, -0.6, 0, 0), {.kind = ES_ANCHOR_POINT, .point = {0, 0, 4}}, {0}},
        {3, anchor_at(&s, s.mirror, 0.6, 0.4, 0), {.kind = ES_ANCHOR_POINT, .point = {2, 0, 4}}, {0}},
        {4, anchor_at(&s, s.other, 0, 0, 9), {.kind = ES_ANCHOR_POINT, .point = {2, 0, 4}}, {0}}};
    d.keys = keys;
    d.key_count = 3;
    d.parameter = (es_edit_parameter){.kind = ES_EDIT_NAMED, .name = "turn"};
    es_constraint c = add_constraint(&s, &d);
    static const struct { float at; double red[3], green; } expected[] = {{0, {-0.6, 0, 0}, 0}, {1, {-0.6, 0, 0}, 0}, {2, {0, 0.2, 0}, 1}, {2.5f, {0.3, 0.3, 0}, 1.5}, {3, {0.6, 0.4, 0}, 2}, {3.5f, {0.6, 0.4, 0}, 2}, {4, {0, 0, 9}, 2}, {99, {0, 0, 9}, 2}};
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        assert_int_equal(es_world_set_parameter(s.world, "turn", expected[i].at), ES_OK);
        es_constraint_state now = state_of(&s, c);
        assert_int_equal(now.effect, ES_EDIT_ACTIVE);
        assert_place(now.position, expected[i].red[0], expected[i].red[1], expected[i].red[2]);
        assert_place(now.target, expected[i].green, 0, 4);
    }
    d.parameter = (es_edit_parameter){.kind = ES_EDIT_CAMERA, .axis = 2};
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_true(state_of(&s, c).parameter == 5);
    d.parameter = (es_edit_parameter){.kind = ES_EDIT_NODE, .node = {77}};
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_NO_PARAMETER);
    d.parameter = (es_edit_parameter){.kind = ES_EDIT_TIME};
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_int_equal(es_world_step(s.world, 2), ES_OK);
    assert_place(state_of(&s, c).position, 0, 0.2, 0);
    close_scene(&s);
}

static void test_picking_finds_the_first_surface(void** state)
{
    scene s = open_scene();
    es_anchor anchor;
    double place[3];
    es_vec3 normal;
    assert_int_equal(es_world_anchor_of_ray(s.world, (const double[3]){0.1, 0.3, 5}, es_v3(0, 0, -3), 100, &anchor), ES_OK);
    assert_true(anchor.kind == ES_ANCHOR_SURFACE && anchor.instance.id == s.mirror.id && es_world_resolve_anchor(s.world, &anchor, place, &normal));
    assert_place(place, 0.1, 0.3, 0);
    assert_int_equal(es_world_anchor_of_ray(s.world, (const double[3]){0.1, 0.3, 5}, es_v3(0, 0, 3), 100, &anchor), ES_OK);
    assert_true(anchor.instance.id == s.other.id);
    assert_int_equal(es_world_anchor_of_ray(s.world, (const double[3]){0.1, 0.3, 5}, es_v3(0, 0, -3), 4.9f, &anchor), ES_OK);
    assert_int_equal(anchor.kind, ES_ANCHOR_NONE);
    assert_int_equal(es_world_anchor_of_triangle(s.world, s.mirror, 128, 0, 0, &anchor), ES_INVALID_ARGUMENT);
    /* the nearest place, against looking at them all */
    for (uint32_t i = 0; i < 50; i++) {
        const double p[3] = {3.0 * (double)es_random_float(1, i) - 1.5, 3.0 * (double)es_random_float(2, i) - 1.5, 0.7};
        es_anchor near = anchor_at(&s, s.mirror, p[0], p[1], p[2]);
        assert_true(es_world_resolve_anchor(s.world, &near, place, NULL));
        assert_place(place, fmax(-1, fmin(1, p[0])), fmax(-1, fmin(1, p[1])), 0);
    }
    close_scene(&s);
}

static void* save(const scene* s, size_t* size)
{
    assert_int_equal(es_world_save(s->world, NULL, size), ES_OK);
    void* bytes = malloc(*size);
    assert_int_equal(es_world_save(s->world, bytes, size), ES_OK);
    return bytes;
}

/* Keys, strokes, a parameter, frozen: something of everything. */
static void add_everything(const scene* s, es_constraint* c, es_region* r)
{
    es_constraint_desc d = constraint_desc(s);
    es_constraint_key keys[2] = {{1, anchor_at(s, s->mirror, -0.6, 0, 0), {.kind = ES_ANCHOR_POINT, .point = {0, 0, 4}}, {1, 2, 3}}, {3, anchor_at(s, s->mirror, 0.6, 0.4, 0), anchor_at(s, s->other, 0, 0, 9), {0}}};
    d.keys = keys;
    d.key_count = 2;
    d.parameter = (es_edit_parameter){.kind = ES_EDIT_NAMED, .name = "turn"};
    d.geodesic = true;
    *c = add_constraint(s, &d);
    es_region_stroke stroke = {anchor_at(s, s->mirror, -0.8, -0.5, 0), anchor_at(s, s->mirror, 0.8, -0.5, 0), 0.3f, false};
    assert_int_equal(es_world_add_region(s->world, &(es_region_desc){.name = "brushed", .type = ES_REGION_FREE_FORM, .border = 0.1f, .strokes = &stroke, .stroke_count = 1}, r), ES_OK);
    assert_int_equal(es_world_set_parameter(s->world, "turn", 2), ES_OK);
    assert_int_equal(es_world_freeze_reflections(s->world, (const double[3]){1, 2, 3}), ES_OK);
}

static void test_restoring_brings_back_what_there_was(void** state)
{
    scene s = open_scene();
    size_t size[2];
    uint64_t hash[2] = {es_world_hash(s.world)};
    void* saved[2] = {save(&s, &size[0])};
    es_constraint c;
    es_region r;
    add_everything(&s, &c, &r);
    hash[1] = es_world_hash(s.world);
    saved[1] = save(&s, &size[1]);
    assert_true(hash[0] != hash[1]);
    const uint64_t object_hash = es_world_object_hash(s.world, ES_OBJECT_CONSTRAINT, c.id);
    const es_constraint_state before = state_of(&s, c);
    for (int turn = 0; turn < 3; turn++) {
        assert_int_equal(es_world_restore(s.world, saved[0], size[0]), ES_OK);
        assert_true(es_world_hash(s.world) == hash[0]);
        assert_int_equal(es_world_edits(s.world)->constraint_count + es_world_edits(s.world)->region_count, 0);
        assert_false(es_world_frozen_reflections(s.world, NULL));
        es_constraint_desc d;
        assert_int_equal(es_world_get_constraint(s.world, c, &d), ES_STALE_HANDLE);
        es_constraint_desc other = constraint_desc(&s);
        es_constraint another = add_constraint(&s, &other);
        assert_true(another.id != c.id);
        assert_int_equal(es_world_restore(s.world, saved[1], size[1]), ES_OK);
        assert_true(es_world_hash(s.world) == hash[1] && es_world_object_hash(s.world, ES_OBJECT_CONSTRAINT, c.id) == object_hash);
        assert_int_equal(es_world_get_constraint(s.world, another, &d), ES_STALE_HANDLE);
        assert_int_equal(es_world_get_constraint(s.world, c, &d), ES_OK);
        assert_true(d.key_count == 2 && d.keys[0].direction.y == 2 && strcmp(d.parameter.name, "turn") == 0 && strcmp(d.name, "face") == 0);
        assert_string_equal(es_world_name(s.world, ES_OBJECT_REGION, r.id), "brushed");
        es_constraint_state now = state_of(&s, c);
        assert_memory_equal(&now, &before, sizeof now);
        assert_int_equal(es_world_edits(s.world)->region_count, 1);
    }
    /* cut short or changed, it is refused, with the world as it was */
    ((char*)saved[1])[size[1] - 30] ^= 1;
    assert_int_equal(es_world_restore(s.world, saved[1], size[1]), ES_FILE_DAMAGED);
    assert_int_equal(es_world_restore(s.world, saved[1], size[1] - 9), ES_FILE_DAMAGED);
    assert_true(es_world_hash(s.world) == hash[1]);
    free(saved[0]);
    free(saved[1]);
    close_scene(&s);
}

static void test_recordings_note_edits(void** state)
{
    scene s = open_scene(), other = open_scene();
    es_recording* recording;
    es_constraint c;
    es_region r;
    es_edit_history* history;
    assert_int_equal(es_edit_history_create(s.world, 0, &history), ES_OK);
    assert_int_equal(es_recording_begin(s.world, NULL, NULL, &recording), ES_OK);
    assert_int_equal(es_world_step(s.world, 0.1f), ES_OK);
    add_everything(&s, &c, &r);
    assert_int_equal(es_edit_history_commit(history, "all"), ES_OK);
    assert_int_equal(es_world_step(s.world, 0.1f), ES_OK);
    es_constraint_desc d;
    assert_int_equal(es_world_get_constraint(s.world, c, &d), ES_OK);
    d.key_count = 0;
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    assert_int_equal(es_world_destroy_region(s.world, r), ES_OK);
    assert_int_equal(es_world_set_parameter(s.world, "turn", 2.5f), ES_OK);
    assert_int_equal(es_world_step(s.world, 0.1f), ES_OK);
    assert_int_equal(es_edit_history_undo(history), ES_OK);
    assert_int_equal(es_world_freeze_reflections(s.world, NULL), ES_OK);
    assert_int_equal(es_world_step(s.world, 0.1f), ES_OK);
    es_recording_end(recording);
    assert_int_equal(es_recording_rewind(recording, other.world), ES_OK);
    for (uint32_t step = 0; step < es_recording_steps(recording); step++) {
        es_divergence divergence;
        assert_int_equal(es_recording_replay(recording, step, other.world, &divergence), ES_OK);
        assert_false(divergence.differs);
    }
    assert_true(es_world_hash(s.world) == es_world_hash(other.world));
    assert_string_equal(es_world_name(other.world, ES_OBJECT_REGION, r.id), "brushed");
    es_recording_destroy(recording);
    es_edit_history_destroy(history);
    close_scene(&s);
    close_scene(&other);
}

static void test_undo_takes_back_and_redo_does_again(void** state)
{
    scene s = open_scene();
    es_edit_history* history;
    assert_int_equal(es_edit_history_create(s.world, 0, &history), ES_OK);
    assert_null(es_edit_history_undo_label(history));
    uint64_t hashes[6] = {es_world_hash(s.world)};
    es_constraint_desc d = constraint_desc(&s);
    es_constraint c = add_constraint(&s, &d);
    hashes[1] = es_world_hash(s.world);
    assert_int_equal(es_edit_history_commit(history, "add a constraint"), ES_OK);
    assert_int_equal(es_edit_history_commit(history, "nothing"), ES_OK);
    d.reflected.point[0] = 7;
    d.reflected.kind = ES_ANCHOR_POINT;
    d.reflected.instance.id = 0;
    assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
    hashes[2] = es_world_hash(s.world);
    assert_int_equal(es_edit_history_commit(history, "move its green handle"), ES_OK);
    es_region r = add_region(&s, ES_REGION_GEODESIC, 0.5f);
    hashes[3] = es_world_hash(s.world);
    assert_int_equal(es_edit_history_commit(history, "add a region"), ES_OK);
    assert_int_equal(es_world_destroy_constraint(s.world, c), ES_OK);
    hashes[4] = es_world_hash(s.world); /* not committed */
    for (int turn = 0; turn < 3; turn++) {
        for (int i = 3; i >= 0; i--) {
            assert_int_equal(es_edit_history_undo(history), ES_OK);
            assert_true(es_world_hash(s.world) == hashes[i]);
        }
        assert_int_equal(es_edit_history_undo(history), ES_OK);
        assert_true(es_world_hash(s.world) == hashes[0] && !es_edit_history_undo_label(history));
        assert_string_equal(es_edit_history_redo_label(history), "add a constraint");
        for (int i = 1; i < 5; i++) {
            assert_int_equal(es_edit_history_redo(history), ES_OK);
            assert_true(es_world_hash(s.world) == hashes[i]);
        }
        assert_int_equal(es_edit_history_redo(history), ES_OK);
        assert_true(es_world_hash(s.world) == hashes[4]);
    }
    assert_int_equal(es_edit_history_undo(history), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_ACTIVE); /* under its handle */
    /* what it is on goes while it is undone: it comes back without effect */
    assert_int_equal(es_world_destroy_constraint(s.world, c), ES_OK);
    assert_int_equal(es_world_destroy_instance(s.world, s.mirror), ES_OK);
    assert_int_equal(es_edit_history_undo(history), ES_OK);
    assert_int_equal(state_of(&s, c).effect, ES_EDIT_STALE);
    es_region_state region;
    assert_int_equal(es_world_get_region_state(s.world, r, &region), ES_OK);
    assert_int_equal(region.effect, ES_EDIT_STALE);
    /* another way from here */
    assert_int_equal(es_world_destroy_region(s.world, r), ES_OK);
    assert_int_equal(es_edit_history_commit(history, "destroy the region"), ES_OK);
    assert_null(es_edit_history_redo_label(history));
    es_edit_history_destroy(history);
    close_scene(&s);
}

static void test_history_keeps_within_its_memory(void** state)
{
    scene s = open_scene();
    es_edit_history* history;
    assert_int_equal(es_edit_history_create(s.world, 8192, &history), ES_OK);
    es_constraint_desc d = constraint_desc(&s);
    es_constraint c = add_constraint(&s, &d);
    const size_t before = es_context_bytes(s.context);
    for (int i = 0; i < 2000; i++) {
        d.eye[0] = i;
        assert_int_equal(es_world_set_constraint(s.world, c, &d), ES_OK);
        assert_int_equal(es_edit_history_commit(history, "look from elsewhere"), ES_OK);
    }
    assert_true(es_context_bytes(s.context) < before + 32768);
    int back = 0;
    for (; es_edit_history_undo_label(history); back++) assert_int_equal(es_edit_history_undo(history), ES_OK);
    assert_true(back > 5 && back < 200);
    assert_int_equal(es_world_get_constraint(s.world, c, &d), ES_OK);
    assert_true(d.eye[0] == 1999 - back);
    es_edit_history_destroy(history);
    close_scene(&s);
}

static void test_a_thousand_constraints(void** state)
{
    scene s = open_scene();
    es_constraint_desc d = constraint_desc(&s);
    for (uint32_t i = 0; i < 1000; i++) {
        d.reflecting.triangle = i % 128;
        d.reflecting.u = 0.3f * es_random_float(1, i / 10);
        d.reflecting.v = 0.1f; /* several at one place */
        add_constraint(&s, &d);
    }
    for (uint32_t i = 0; i < 20; i++) add_region(&s, i & 1 ? ES_REGION_GEODESIC : ES_REGION_EUCLIDEAN, 0.1f * (float)i);
    assert_int_equal(es_world_edits(s.world)->constraint_count, 1000);
    size_t size;
    void* saved = save(&s, &size);
    const uint64_t hash = es_world_hash(s.world);
    uint32_t ids[1000];
    size_t count = 1000;
    assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_CONSTRAINT, ids, &count), ES_OK);
    for (uint32_t i = 0; i < 1000; i += 3) assert_int_equal(es_world_destroy_constraint(s.world, (es_constraint){ids[i]}), ES_OK);
    assert_int_equal(es_world_edits(s.world)->constraint_count, 666);
    assert_int_equal(es_world_restore(s.world, saved, size), ES_OK);
    assert_true(es_world_hash(s.world) == hash && es_world_edits(s.world)->constraint_count == 1000);
    free(saved);
    close_scene(&s);
}

/* ---- without memory ---------------------------------------------------------------------------------------------------------- */

static long until_none = -1; /* allocations that still succeed; negative: all */

static void* scarce_allocate(void* user, size_t size, size_t alignment)
{
    void* memory = NULL;
    if (until_none == 0) return NULL;
    until_none -= until_none > 0;
    return posix_memalign(&memory, alignment < sizeof(void*) ? sizeof(void*) : alignment, size ? size : 1) == 0 ? memory : NULL;
}

static void scarce_release(void* user, void* pointer, size_t size) { free(pointer); }
static void say_nothing(void* user, es_log_level level, es_result item, const char* message) {}

/* Each operation with every one of its allocations failing in turn: it says so and has changed nothing, or it has done what it should. */
static void test_without_memory_nothing_is_half_done(void** state)
{
    scene s = {0};
    es_context_desc context = es_default_context_desc();
    context.threads = 1;
    context.allocator = (es_allocator){scarce_allocate, scarce_release, NULL};
    context.logger.log = say_nothing;
    const char* path = "edits-scarcity.gltf";
    for (int operation = 0; operation < 8; operation++)
        for (long allocations = 0, done = 0; !done; allocations++) {
            until_none = -1;
            assert_int_equal(es_context_create(&context, &s.context), ES_OK);
            fill_scene(&s);
            es_constraint_desc d = constraint_desc(&s);
            d.geodesic = true;
            es_constraint c = add_constraint(&s, &d), another;
            es_region r = add_region(&s, ES_REGION_GEODESIC, 0.5f), other;
            es_edit_history* history;
            assert_int_equal(es_edit_history_create(s.world, 0, &history), ES_OK);
            assert_int_equal(es_world_save_edits(s.world, NULL, path), ES_OK);
            size_t size;
            void* saved = save(&s, &size);
            es_region_stroke stroke = {d.reflecting, d.reflecting, 1, false};
            es_region_desc free_form = {.name = "drawn", .type = ES_REGION_FREE_FORM, .strokes = &stroke, .stroke_count = 1};
            es_constraint_key keys[2] = {{0, d.reflecting, d.reflected, {0}}, {1, anchor_at(&s, s.mirror, -0.5, 0, 0), d.reflected, {0}}};
            d.keys = keys;
            d.key_count = 2;
            if (operation >= 3) assert_int_equal(es_world_destroy_region(s.world, r), ES_OK);
            const uint64_t before = es_world_hash(s.world);
            until_none = allocations;
            es_result result = ES_OK;
            switch (operation) {
            case 0: result = es_world_add_constraint(s.world, &d, &another); break;
            case 1: result = es_world_set_constraint(s.world, c, &d); break;
            case 2: result = es_world_add_region(s.world, &free_form, &other); break;
            case 3: result = es_edit_history_undo(history); break;
            case 4: result = es_world_load_edits(s.world, path); break;
            case 5: result = es_world_restore(s.world, saved, size); break;
            case 6: result = es_world_set_parameter(s.world, "turn", 1); break;
            default: /* distances and trees: what finds no memory has no effect, and says so */
                es_world_edits(s.world);
                result = state_of(&s, c).effect == ES_EDIT_NO_MEMORY ? ES_OUT_OF_MEMORY : ES_OK;
            }
            until_none = -1;
            assert_true(result == ES_OK || result == ES_OUT_OF_MEMORY);
            if (result != ES_OK) assert_true(es_world_hash(s.world) == before);
            if (operation == 7) assert_int_equal(state_of(&s, c).effect, ES_EDIT_ACTIVE); /* with memory again */
            done = result == ES_OK;
            if (operation >= 3 && operation <= 5 && done) {
                es_region_state there;
                size_t regions = 0;
                assert_int_equal(es_world_enumerate(s.world, ES_OBJECT_REGION, NULL, &regions), ES_OK);
                assert_int_equal(regions, 1);
                if (operation != 4) assert_int_equal(es_world_get_region_state(s.world, r, &there), ES_OK);
            }
            assert_true(allocations < 100);
            free(saved);
            es_edit_history_destroy(history);
            close_scene(&s);
        }
    remove(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_handles_follow_their_surfaces),
        cmocka_unit_test(test_regions_have_influence_where_they_are),
        cmocka_unit_test(test_geodesic_regions_reach_over_edges),
        cmocka_unit_test(test_handles_follow_skins),
        cmocka_unit_test(test_stale_edits_have_no_effect_and_say_why),
        cmocka_unit_test(test_bad_numbers_are_refused),
        cmocka_unit_test(test_the_list_counts_what_differs),
        cmocka_unit_test(test_keys_go_by_their_parameter),
        cmocka_unit_test(test_picking_finds_the_first_surface),
        cmocka_unit_test(test_restoring_brings_back_what_there_was),
        cmocka_unit_test(test_recordings_note_edits),
        cmocka_unit_test(test_undo_takes_back_and_redo_does_again),
        cmocka_unit_test(test_history_keeps_within_its_memory),
        cmocka_unit_test(test_a_thousand_constraints),
        unit_test_without_races(test_without_memory_nothing_is_half_done),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
