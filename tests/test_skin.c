/* Skins and morph targets: vertices against the definition in double, last frame's vertices, bounds, what is saved and restored, any
 * number of threads and every instruction set, refusals. */
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
#include "platform/random.h"
#include "sim/sim.h"

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(es_random_u32(7, counter++)); }
static uint32_t below(uint32_t n) { return es_random_u32(8, counter++) % n; }

enum { JOINTS = 12, TARGETS = 3, INFLUENCES = 4, VERTICES = 1003, TRIANGLES = 1500 };

/* A creature of random triangles on a tree of joints below one node, with morph targets. */
typedef struct creature {
    es_context* context;
    es_world* world;
    es_node place, joints[JOINTS];
    int parents[JOINTS];
    es_mat4 binds[JOINTS];
    es_mesh mesh;
    es_skin skin;
    es_instance instance;
    es_camera camera;
    float positions[VERTICES * 3], normals[VERTICES * 3], tangents[VERTICES * 4], moved[TARGETS][3][VERTICES * 3], weights[VERTICES * INFLUENCES], morph[TARGETS];
    uint32_t vertex_joints[VERTICES * INFLUENCES], indices[TRIANGLES * 3];
} creature;

static void quiet(void* user, es_log_level level, es_result item, const char* message) {}

static es_transform random_transform(float extent, float stretch)
{
    es_transform t = es_identity_transform();
    t.translation = es_v3(uniform(-extent, extent), uniform(-extent, extent), uniform(-extent, extent));
    t.rotation = es_quat_normalize((es_quat){uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)});
    t.scale = es_v3(uniform(1 / stretch, stretch), uniform(1 / stretch, stretch), uniform(1 / stretch, stretch));
    return t;
}

static creature* new_creature(uint32_t threads, uint32_t isa_mask, bool skinned, bool morphed)
{
    counter = 0;
    creature* c = calloc(1, sizeof *c);
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    desc.logger.log = quiet;
    assert_int_equal(es_context_create(&desc, &c->context), ES_OK);
    assert_int_equal(es_world_create(c->context, NULL, &c->world), ES_OK);
    es_world* w = c->world;
    es_node_desc place = {"place", {0}, es_identity_transform()};
    place.transform.translation = es_v3(3, 0, -2);
    assert_int_equal(es_world_add_node(w, &place, &c->place), ES_OK);
    for (int j = 0; j < JOINTS; j++) {
        c->parents[j] = j ? (int)below((uint32_t)j) : -1;
        es_node_desc node = {"joint", j ? c->joints[c->parents[j]] : c->place, random_transform(0.3f, 1.2f)};
        assert_int_equal(es_world_add_node(w, &node, &c->joints[j]), ES_OK);
        c->binds[j] = es_mat4_from_trs(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), random_transform(1, 1).rotation, es_v3(uniform(0.7f, 1.4f), 1, 1));
    }
    for (int i = 0; i < VERTICES * 3; i++) {
        c->positions[i] = uniform(-1, 1);
        c->normals[i] = uniform(-1, 1);
        for (int t = 0; t < TARGETS; t++)
            for (int s = 0; s < 3; s++) c->moved[t][s][i] = t == 1 && (i < 300 || i > 900) ? 0.0f : uniform(-0.2f, 0.2f);
    }
    for (int v = 0; v < VERTICES; v++) {
        es_vec3 n = es_v3_normalize(es_v3(c->normals[3 * v], c->normals[3 * v + 1], c->normals[3 * v + 2]), es_v3(0, 1, 0)), t, b;
        es_orthonormal_basis(n, &t, &b);
        memcpy(c->normals + 3 * v, &n, sizeof n);
        memcpy(c->tangents + 4 * v, &t, sizeof t);
        c->tangents[4 * v + 3] = v % 2 ? 1 : -1;
        float sum = 0;
        for (int i = 0; i < INFLUENCES; i++) {
            c->vertex_joints[v * INFLUENCES + i] = below(JOINTS);
            c->weights[v * INFLUENCES + i] = below(3) ? uniform(0, 1) : 0;
            sum += c->weights[v * INFLUENCES + i];
        }
        if (sum == 0 && v % 50) c->weights[v * INFLUENCES] = 1;
    }
    for (int i = 0; i < TRIANGLES * 3; i++) c->indices[i] = below(VERTICES);
    es_morph_target targets[TARGETS];
    for (int t = 0; t < TARGETS; t++) targets[t] = (es_morph_target){c->moved[t][0], c->moved[t][1], t == 2 ? NULL : c->moved[t][2]};
    c->morph[0] = 0.5f;
    es_mesh_desc mesh = {.name = "skin of teeth", .vertex_count = VERTICES, .triangle_count = TRIANGLES, .positions = c->positions, .normals = c->normals,
        .tangents = c->tangents, .indices = c->indices, .target_count = morphed ? TARGETS : 0, .targets = targets, .weights = c->morph};
    assert_int_equal(es_world_add_mesh(w, &mesh, &c->mesh), ES_OK);
    if (skinned) {
        es_skin_desc skin = {"skin", c->mesh, c->place, JOINTS, c->joints, c->binds, INFLUENCES, c->vertex_joints, c->weights};
        assert_int_equal(es_world_add_skin(w, &skin, &c->skin), ES_OK);
    }
    assert_int_equal(es_world_add_instance(w, &(es_instance_desc){.node = c->place, .mesh = c->mesh}, &c->instance), ES_OK);
    es_camera_desc camera = es_default_camera_desc();
    assert_int_equal(es_world_add_camera(w, &camera, &c->camera), ES_OK);
    return c;
}

static void free_creature(creature* c)
{
    es_world_destroy(c->world);
    assert_int_equal(es_context_bytes(c->context), 0);
    es_context_destroy(c->context);
    free(c);
}

/* Moves everything as a function of the step's number. */
static void move(creature* c, int step)
{
    for (int j = 0; j < JOINTS; j++) {
        es_transform t;
        assert_int_equal(es_world_get_node_transform(c->world, c->joints[j], &t), ES_OK);
        t.rotation = es_quat_mul(t.rotation, es_quat_from_axis_angle(es_v3(0, 0, 1), 0.05f + 0.01f * (float)((j * 7 + step * 3) % 11)));
        t.scale.y = 1 + 0.1f * es_sin((float)(step + j));
        assert_int_equal(es_world_set_node_transform(c->world, c->joints[j], &t), ES_OK);
    }
    uint32_t count = 0;
    assert_int_equal(es_world_get_morph_weights(c->world, c->mesh, NULL, &count), ES_OK);
    if (!count) return;
    for (int t = 0; t < TARGETS; t++) c->morph[t] = (step + t) % 3 ? es_cos((float)(step * (t + 1))) : 0;
    assert_int_equal(es_world_set_morph_weights(c->world, c->mesh, c->morph, TARGETS), ES_OK);
}

/* ---- in double --------------------------------------------------------------------------------------------------------------------- */

typedef struct affine { double m[3][4]; } affine;

static affine times(affine a, affine b)
{
    affine c;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 4; k++) c.m[r][k] = a.m[r][0] * b.m[0][k] + a.m[r][1] * b.m[1][k] + a.m[r][2] * b.m[2][k] + (k == 3 ? a.m[r][3] : 0);
    return c;
}

static affine of_transform(es_transform t)
{
    double x = t.rotation.x, y = t.rotation.y, z = t.rotation.z, w = t.rotation.w, s[3] = {t.scale.x, t.scale.y, t.scale.z};
    affine a = {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), t.translation.x},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), t.translation.y}, {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), t.translation.z}}};
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++) a.m[r][k] *= s[k];
    return a;
}

static affine of_matrix(const es_mat4* m)
{
    affine a;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 4; k++) a.m[r][k] = m->m[4 * k + r];
    return a;
}

static void unit(double v[3])
{
    double l = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int k = 0; k < 3; k++) v[k] /= l;
}

/* Positions, normals and tangents of all vertices by the definition, in the axes of the creature's place. */
static void expect(creature* c, bool skinned, bool morphed, double (*out)[3][3])
{
    affine joints[JOINTS];
    for (int j = 0; j < JOINTS; j++) {
        es_transform t;
        assert_int_equal(es_world_get_node_transform(c->world, c->joints[j], &t), ES_OK);
        joints[j] = j ? times(joints[c->parents[j]], of_transform(t)) : of_transform(t);
    }
    for (int v = 0; v < VERTICES; v++) {
        double from[3][3], to[3][3];
        for (int k = 0; k < 3; k++) {
            from[0][k] = c->positions[3 * v + k];
            from[1][k] = c->normals[3 * v + k];
            from[2][k] = c->tangents[4 * v + k];
            for (int t = 0; morphed && t < TARGETS; t++)
                for (int s = 0; s < (t == 2 ? 2 : 3); s++) from[s][k] += (double)c->morph[t] * c->moved[t][s][3 * v + k];
        }
        affine blend = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
        double sum = 0;
        for (int i = 0; i < INFLUENCES; i++) sum += c->weights[v * INFLUENCES + i];
        if (skinned && sum > 0) {
            memset(&blend, 0, sizeof blend);
            for (int i = 0; i < INFLUENCES; i++) {
                uint32_t j = c->vertex_joints[v * INFLUENCES + i];
                affine m = times(joints[j], of_matrix(&c->binds[j]));
                for (int e = 0; e < 12; e++) (&blend.m[0][0])[e] += c->weights[v * INFLUENCES + i] / sum * (&m.m[0][0])[e];
            }
        }
        double cofactors[3][3];
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 3; k++)
                cofactors[r][k] = blend.m[(r + 1) % 3][(k + 1) % 3] * blend.m[(r + 2) % 3][(k + 2) % 3] - blend.m[(r + 1) % 3][(k + 2) % 3] * blend.m[(r + 2) % 3][(k + 1) % 3];
        for (int r = 0; r < 3; r++) {
            to[0][r] = to[1][r] = to[2][r] = 0;
            for (int k = 0; k < 3; k++) {
                to[0][r] += blend.m[r][k] * from[0][k];
                to[1][r] += cofactors[r][k] * from[1][k];
                to[2][r] += blend.m[r][k] * from[2][k];
            }
            to[0][r] += blend.m[r][3];
        }
        unit(to[1]);
        unit(to[2]);
        memcpy(out[v], to, sizeof to);
    }
}

static void assert_as_expected(creature* c, bool skinned, bool morphed)
{
    static double expected[VERTICES][3][3];
    expect(c, skinned, morphed, expected);
    const es_raster_mesh* mesh = es_world_mesh(c->world, c->mesh);
    const float* streams[3] = {mesh->positions, mesh->normals, mesh->tangents};
    double worst[3] = {0, 0, 0};
    for (int v = 0; v < VERTICES; v++) {
        for (int s = 0; s < 3; s++)
            for (int k = 0; k < 3; k++) worst[s] = fmax(worst[s], fabs(streams[s][4 * v + k] - expected[v][s][k]));
        assert_true(mesh->tangents[4 * v + 3] == (v % 2 ? 1 : -1));
        for (int k = 0; k < 3; k++)
            assert_true(mesh->positions[4 * v + k] >= (&mesh->bounds_min.x)[k] && mesh->positions[4 * v + k] <= (&mesh->bounds_max.x)[k]);
    }
    /* joints nest up to a dozen deep: a few dozen roundings of numbers below 8. Blends of opposite joints shrink what directions are made of. */
    if (worst[0] > 1e-5 || worst[1] > 2e-3 || worst[2] > 2e-3) fail_msg("positions differ by %g, normals by %g, tangents by %g", worst[0], worst[1], worst[2]);
}

static void vertices(void** state)
{
    for (int kind = 1; kind < 4; kind++) {
        bool skinned = kind & 1, morphed = kind & 2;
        creature* c = new_creature(2, 0, skinned, morphed);
        assert_as_expected(c, skinned, morphed);
        for (int step = 0; step < 5; step++) {
            float before[VERTICES * 4];
            memcpy(before, es_world_mesh(c->world, c->mesh)->positions, sizeof before);
            uint64_t revision = es_world_mesh(c->world, c->mesh)->revision;
            assert_int_equal(es_world_step(c->world, 0.1f), ES_OK);
            assert_null(es_world_mesh(c->world, c->mesh)->previous_positions); /* nothing moved yet */
            move(c, step);
            assert_as_expected(c, skinned, morphed);
            move(c, step + 100); /* a second time in the same step: last frame stays last frame */
            assert_as_expected(c, skinned, morphed);
            const es_raster_mesh* mesh = es_world_mesh(c->world, c->mesh);
            assert_non_null(mesh->previous_positions);
            assert_memory_equal(mesh->previous_positions, before, sizeof before);
            for (int v = 0; v < VERTICES; v++)
                for (int k = 0; k < 3; k++) assert_true(before[4 * v + k] >= (&mesh->bounds_min.x)[k] && before[4 * v + k] <= (&mesh->bounds_max.x)[k]);
            assert_true(mesh->revision != revision);
            assert_true(es_world_get_revisions(c->world).moving);
        }
        assert_int_equal(es_world_step(c->world, 0), ES_OK);
        assert_null(es_world_mesh(c->world, c->mesh)->previous_positions);
        assert_false(es_world_get_revisions(c->world).moving);
        free_creature(c);
    }
}

/* Moving the creature as a whole moves its instance, not its vertices; and where it stands does not matter to them. */
static void places(void** state)
{
    creature* c = new_creature(1, 0, true, false);
    move(c, 1);
    uint64_t revision = es_world_mesh(c->world, c->mesh)->revision;
    float before[VERTICES * 4];
    memcpy(before, es_world_mesh(c->world, c->mesh)->positions, sizeof before);
    es_transform far = es_identity_transform();
    far.translation = es_v3(7e6f, 1e5f, -3e6f);
    far.rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), 1);
    assert_int_equal(es_world_set_node_transform(c->world, c->place, &far), ES_OK);
    assert_true(es_world_mesh(c->world, c->mesh)->revision == revision);
    assert_memory_equal(es_world_mesh(c->world, c->mesh)->positions, before, sizeof before);
    free_creature(c);

    /* a skin's node that is no ancestor of its joints: through the world's axes, wherever that node stands */
    c = new_creature(1, 0, false, false);
    es_node elsewhere;
    es_node_desc desc = {"elsewhere", {0}, random_transform(2, 1.5f)};
    assert_int_equal(es_world_add_node(c->world, &desc, &elsewhere), ES_OK);
    es_skin_desc skin = {"skin", c->mesh, elsewhere, JOINTS, c->joints, c->binds, INFLUENCES, c->vertex_joints, c->weights};
    assert_int_equal(es_world_add_skin(c->world, &skin, &c->skin), ES_OK);
    static double expected[VERTICES][3][3];
    expect(c, true, false, expected);
    es_mat4 to_world;
    assert_int_equal(es_world_get_node_matrix(c->world, elsewhere, &to_world), ES_OK);
    affine axes = of_matrix(&to_world);
    es_transform place;
    assert_int_equal(es_world_get_node_transform(c->world, c->place, &place), ES_OK);
    const float* p = es_world_mesh(c->world, c->mesh)->positions;
    for (int v = 0; v < VERTICES; v++)
        for (int r = 0; r < 3; r++) {
            double x = axes.m[r][0] * p[4 * v] + axes.m[r][1] * p[4 * v + 1] + axes.m[r][2] * p[4 * v + 2] + axes.m[r][3];
            double held = 0;
            for (int i = 0; i < INFLUENCES; i++) held += c->weights[v * INFLUENCES + i];
            if (held > 0 && fabs(x - (expected[v][0][r] + (&place.translation.x)[r])) > 1e-5) fail_msg("vertex %d: %g", v, x);
        }
    /* axes without an inverse: the bind pose */
    es_transform flat = es_identity_transform();
    flat.scale.y = 0;
    assert_int_equal(es_world_set_node_transform(c->world, elsewhere, &flat), ES_OK);
    p = es_world_mesh(c->world, c->mesh)->positions;
    for (int v = 0; v < VERTICES; v++)
        for (int k = 0; k < 3; k++) assert_true(fabsf(p[4 * v + k] - c->positions[3 * v + k]) < 1e-6f);
    free_creature(c);
}

static void same_mesh(const es_raster_mesh* a, const es_raster_mesh* b)
{
    size_t bytes = ((size_t)VERTICES + 7) / 8 * 8 * 16;
    assert_memory_equal(a->positions, b->positions, bytes);
    assert_memory_equal(a->normals, b->normals, bytes);
    assert_memory_equal(a->tangents, b->tangents, bytes);
    assert_true(!a->previous_positions == !b->previous_positions);
    if (a->previous_positions) assert_memory_equal(a->previous_positions, b->previous_positions, bytes);
    assert_memory_equal(&a->bounds_min, &b->bounds_min, sizeof a->bounds_min);
    assert_memory_equal(&a->bounds_max, &b->bounds_max, sizeof a->bounds_max);
}

static void same_everywhere(void** state)
{
    creature* scalar = new_creature(1, 1u << ES_ISA_SCALAR, true, true);
    for (int step = 0; step < 3; step++) {
        assert_int_equal(es_world_step(scalar->world, 0.1f), ES_OK);
        move(scalar, step);
    }
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        for (uint32_t threads = 1; threads <= 3; threads++) {
            creature* c = new_creature(threads, 1u << ES_ISA_SCALAR | 1u << isa, true, true);
            for (int step = 0; step < 3; step++) {
                assert_int_equal(es_world_step(c->world, 0.1f), ES_OK);
                move(c, step);
            }
            same_mesh(es_world_mesh(scalar->world, scalar->mesh), es_world_mesh(c->world, c->mesh));
            assert_true(es_world_hash(scalar->world) == es_world_hash(c->world));
            free_creature(c);
        }
    }
    free_creature(scalar);
}

static void saving(void** state)
{
    creature *c = new_creature(1, 0, true, true), *other = new_creature(2, 0, true, true);
    for (int step = 0; step < 4; step++) {
        assert_int_equal(es_world_step(c->world, 0.1f), ES_OK);
        if (step != 3) move(c, step); /* saved both while it moves and, at last, at rest */
        size_t size = 0;
        assert_int_equal(es_world_save(c->world, NULL, &size), ES_OK);
        assert_true(size < sizeof c->positions); /* the vertices are not in it */
        char* saved = malloc(size);
        assert_int_equal(es_world_save(c->world, saved, &size), ES_OK);
        uint64_t hash = es_world_hash(c->world);
        /* a world that has gone another way */
        assert_int_equal(es_world_step(other->world, 0.2f), ES_OK);
        move(other, 50 + step);
        assert_true(es_world_hash(other->world) != hash);
        assert_int_equal(es_world_restore(other->world, saved, size), ES_OK);
        assert_true(es_world_hash(other->world) == hash);
        same_mesh(es_world_mesh(c->world, c->mesh), es_world_mesh(other->world, other->mesh));
        /* and both go on alike */
        for (int i = 0; i < 2; i++) {
            es_world* w = i ? other->world : c->world;
            assert_int_equal(es_world_step(w, 0.1f), ES_OK);
            move(i ? other : c, 70 + step);
        }
        same_mesh(es_world_mesh(c->world, c->mesh), es_world_mesh(other->world, other->mesh));
        assert_true(es_world_hash(other->world) == es_world_hash(c->world));
        /* a damaged one is refused, and nothing is touched */
        uint64_t before = es_world_hash(other->world);
        for (size_t at = size / 3; at < size; at += size / 5 + 1) {
            saved[at] ^= 0x40;
            assert_int_not_equal(es_world_restore(other->world, saved, size), ES_OK);
            saved[at] ^= 0x40;
        }
        assert_true(es_world_hash(other->world) == before);
        free(saved);
    }
    /* a world without the skin has other content */
    size_t size = 0;
    assert_int_equal(es_world_save(c->world, NULL, &size), ES_OK);
    char* saved = malloc(size);
    assert_int_equal(es_world_save(c->world, saved, &size), ES_OK);
    assert_int_equal(es_world_destroy_skin(c->world, c->skin), ES_OK);
    assert_int_equal(es_world_restore(c->world, saved, size), ES_WRONG_STATE);
    free(saved);
    free_creature(c);
    free_creature(other);
}

static void refusals(void** state)
{
    creature* c = new_creature(1, 0, true, true);
    es_world* w = c->world;
    assert_int_equal(es_world_deform_mesh(w, c->mesh, c->positions, NULL), ES_WRONG_STATE);
    assert_int_equal(es_world_recompute_normals(w, c->mesh), ES_WRONG_STATE);
    assert_int_equal(es_world_destroy_mesh(w, c->mesh), ES_WRONG_STATE);
    assert_int_equal(es_world_destroy_node(w, c->joints[JOINTS - 1]), ES_WRONG_STATE);
    float weights[TARGETS] = {0, NAN, 0};
    assert_int_equal(es_world_set_morph_weights(w, c->mesh, weights, TARGETS), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_set_morph_weights(w, c->mesh, c->morph, TARGETS - 1), ES_INVALID_ARGUMENT);
    uint32_t count = 1;
    assert_int_equal(es_world_get_morph_weights(w, c->mesh, weights, &count), ES_INVALID_ARGUMENT);
    assert_int_equal(count, TARGETS);
    es_skin_state skin;
    assert_int_equal(es_world_get_skin(w, c->skin, &skin), ES_OK);
    assert_true(skin.joint_count == JOINTS && skin.mesh.id == c->mesh.id && skin.node.id == c->place.id && memcmp(skin.joints, c->joints, sizeof c->joints) == 0);
    es_skin_desc desc = {"second", c->mesh, c->place, JOINTS, c->joints, c->binds, INFLUENCES, c->vertex_joints, c->weights};
    es_skin second;
    assert_int_equal(es_world_add_skin(w, &desc, &second), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_destroy_skin(w, c->skin), ES_OK);
    assert_int_equal(es_world_destroy_skin(w, c->skin), ES_STALE_HANDLE);
    c->skin.id = 0;
    assert_as_expected(c, false, true);
    size_t bytes = es_context_bytes(c->context);
    struct { es_skin_desc desc; es_result result; } bad[9];
    for (int i = 0; i < 9; i++) bad[i].desc = desc, bad[i].result = ES_INVALID_ARGUMENT;
    bad[0].desc.joint_count = 0;
    bad[1].desc.joint_count = 70000;
    bad[2].desc.influences = 0;
    bad[3].desc.influences = 17;
    bad[4].desc.joint_count = 3; /* vertices name more */
    float* damaged = malloc(sizeof c->weights);
    memcpy(damaged, c->weights, sizeof c->weights);
    damaged[77] = -0.5f;
    bad[5].desc.vertex_weights = damaged;
    es_mat4 binds[JOINTS];
    memcpy(binds, c->binds, sizeof binds);
    binds[5].m[3] = INFINITY;
    bad[6].desc.inverse_binds = binds;
    bad[7].desc.mesh.id = 0, bad[7].result = ES_STALE_HANDLE;
    bad[8].desc.node.id = 0xfffff, bad[8].result = ES_STALE_HANDLE;
    for (int i = 0; i < 9; i++) assert_int_equal(es_world_add_skin(w, &bad[i].desc, &second), bad[i].result);
    assert_int_equal(es_context_bytes(c->context), bytes);
    free(damaged);
    free_creature(c);
}

/* Normals of a mesh that is deformed by hand. */
static void recomputed_normals(void** state)
{
    creature* c = new_creature(2, 0, false, false);
    float* positions = malloc(sizeof c->positions);
    for (int i = 0; i < VERTICES * 3; i++) positions[i] = c->positions[i] * (i % 3 == 0 ? 2 : 1);
    assert_int_equal(es_world_deform_mesh(c->world, c->mesh, positions, NULL), ES_OK);
    assert_int_equal(es_world_recompute_normals(c->world, c->mesh), ES_OK);
    /* the same as of a mesh that is made with these positions, up to rounding */
    es_mesh made;
    es_mesh_desc desc = {.vertex_count = VERTICES, .triangle_count = TRIANGLES, .positions = positions, .indices = c->indices};
    assert_int_equal(es_world_add_mesh(c->world, &desc, &made), ES_OK);
    const es_raster_mesh *a = es_world_mesh(c->world, c->mesh), *b = es_world_mesh(c->world, made);
    for (int v = 0; v < VERTICES; v++)
        for (int k = 0; k < 3; k++) assert_true(fabsf(a->normals[4 * v + k] - b->normals[4 * v + k]) < 1e-4f);
    free(positions);
    free_creature(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(vertices), cmocka_unit_test(places), cmocka_unit_test(same_everywhere), cmocka_unit_test(saving), cmocka_unit_test(refusals),
        cmocka_unit_test(recomputed_normals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
