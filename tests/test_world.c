/* The world floor: handles, refusals by name, the node tree, clips against hand-computed values, last frame's pose,
 * revisions, saved states, settings, built-in scenes. */
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
#include "platform/settings.h"
#include "sim/sim.h"

static const float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
static const uint32_t triangle_indices[3] = {0, 1, 2};

typedef struct fixture { es_context* context; es_world* world; int asserts; } fixture;

static void no_log(void* user, es_log_level level, es_result item, const char* message) { assert_null(strchr(message, '\n')); }
static void count_assert(void* user, es_result item, const char* message) { ++*(int*)user; }

static int set_up(void** state)
{
    fixture* f = calloc(1, sizeof *f);
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = no_log;
    desc.assert_hook = (es_assert_hook){count_assert, &f->asserts};
    assert_int_equal(es_context_create(&desc, &f->context), ES_OK);
    assert_int_equal(es_world_create(f->context, NULL, &f->world), ES_OK);
    *state = f;
    return 0;
}

static int tear_down(void** state)
{
    fixture* f = *state;
    es_world_destroy(f->world);
    assert_int_equal(es_context_bytes(f->context), 0);
    es_context_destroy(f->context);
    free(f);
    return 0;
}

static es_node add_node(es_world* world, const char* name, es_node parent, es_vec3 translation)
{
    es_node node;
    es_node_desc desc = {name, parent, es_identity_transform()};
    desc.transform.translation = translation;
    assert_int_equal(es_world_add_node(world, &desc, &node), ES_OK);
    return node;
}

static es_mesh add_triangle(es_world* world)
{
    es_mesh mesh;
    es_mesh_desc desc = {.name = "triangle", .vertex_count = 3, .triangle_count = 1, .positions = triangle, .indices = triangle_indices};
    assert_int_equal(es_world_add_mesh(world, &desc, &mesh), ES_OK);
    return mesh;
}

static es_instance add_instance(es_world* world, es_node node, es_mesh mesh)
{
    es_instance instance;
    assert_int_equal(es_world_add_instance(world, &(es_instance_desc){.node = node, .mesh = mesh}, &instance), ES_OK);
    return instance;
}

static es_vec3 position_of(es_world* world, es_node node)
{
    es_mat4 m;
    assert_int_equal(es_world_get_node_matrix(world, node, &m), ES_OK);
    return es_v3(m.m[12], m.m[13], m.m[14]);
}

static bool same_revisions(es_world_revisions a, es_world_revisions b)
{
    return a.geometry == b.geometry && a.materials == b.materials && a.lights == b.lights && a.camera == b.camera && a.moving == b.moving;
}

static void assert_near(float a, float b, float tolerance)
{
    if (!(fabsf(a - b) <= tolerance)) fail_msg("%.9g is not within %g of %.9g", (double)a, (double)tolerance, (double)b);
}

static void assert_vec3(es_vec3 a, float x, float y, float z)
{
    assert_near(a.x, x, 1e-6f);
    assert_near(a.y, y, 1e-6f);
    assert_near(a.z, z, 1e-6f);
}

/* ---- handles ---------------------------------------------------------------------------------------------------------------- */

static void handles(void** state)
{
    fixture* f = *state;
    es_world* w = f->world;
    es_node a = add_node(w, "a", (es_node){0}, es_v3(0, 0, 0)), b = add_node(w, NULL, a, es_v3(1, 0, 0));
    assert_int_not_equal(a.id, 0);
    assert_string_equal(es_world_name(w, ES_OBJECT_NODE, a.id), "a");
    assert_string_equal(es_world_name(w, ES_OBJECT_NODE, b.id), "");
    assert_int_equal(es_world_find_node(w, "a").id, a.id);
    assert_int_equal(es_world_find_node(w, "z").id, 0);

    assert_int_equal(es_world_destroy_node(w, a), ES_WRONG_STATE); /* has a child */
    assert_int_equal(es_world_destroy_node(w, b), ES_OK);
    assert_int_equal(es_world_destroy_node(w, b), ES_STALE_HANDLE);
    assert_int_equal(f->asserts, 2);
    es_node c = add_node(w, "c", a, es_v3(0, 0, 0));
    assert_int_not_equal(c.id, b.id); /* the slot again, in its next generation */
    es_transform transform;
    assert_int_equal(es_world_get_node_transform(w, b, &transform), ES_STALE_HANDLE);
    assert_null(es_world_name(w, ES_OBJECT_NODE, b.id));

    for (int i = 0; i < 10000; i++) { /* through every generation of a slot, and past its retirement */
        es_node n = add_node(w, NULL, (es_node){0}, es_v3(0, 0, 0));
        assert_int_not_equal(n.id, b.id);
        assert_int_equal(es_world_destroy_node(w, n), ES_OK);
    }
    uint32_t ids[2];
    size_t count = 0;
    assert_int_equal(es_world_enumerate(w, ES_OBJECT_NODE, NULL, &count), ES_OK);
    assert_int_equal(count, 2);
    count = 1;
    assert_int_equal(es_world_enumerate(w, ES_OBJECT_NODE, ids, &count), ES_INVALID_ARGUMENT);
    assert_int_equal(count, 2);
    assert_int_equal(es_world_enumerate(w, ES_OBJECT_NODE, ids, &count), ES_OK);
    assert_true(ids[0] == a.id && ids[1] == c.id);
}

static void references(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    static const uint8_t grey[4] = {128, 128, 128, 255};
    es_texture texture;
    assert_int_equal(es_world_add_texture(w, &(es_texture_desc){"t", 1, 1, grey, true}, &texture), ES_OK);
    es_material_desc md = es_default_material_desc();
    md.base_color_texture.image = es_world_texture_image(w, texture);
    md.normal_texture.image = md.base_color_texture.image;
    es_material material;
    assert_int_equal(es_world_add_material(w, "m", &md, &material), ES_OK);
    es_mesh mesh = add_triangle(w);
    es_node node = add_node(w, "n", (es_node){0}, es_v3(0, 0, 0));
    es_instance instance;
    assert_int_equal(es_world_add_instance(w, &(es_instance_desc){.node = node, .mesh = mesh, .material = material}, &instance), ES_OK);
    assert_int_equal(es_world_destroy_texture(w, texture), ES_WRONG_STATE);
    assert_int_equal(es_world_destroy_material(w, material), ES_WRONG_STATE);
    assert_int_equal(es_world_destroy_mesh(w, mesh), ES_WRONG_STATE);
    assert_int_equal(es_world_destroy_node(w, node), ES_WRONG_STATE);
    const es_draw_list* list = es_world_draw_list(w);
    assert_int_equal(list->instance_count, 1);
    assert_ptr_equal(list->materials[list->instances[0].material].base_color_texture.image, es_world_texture_image(w, texture));
    assert_int_equal(es_world_destroy_instance(w, instance), ES_OK);
    assert_int_equal(es_world_draw_list(w)->instance_count, 0);
    assert_int_equal(es_world_destroy_node(w, node), ES_OK);
    assert_int_equal(es_world_destroy_mesh(w, mesh), ES_OK);
    assert_int_equal(es_world_destroy_material(w, material), ES_OK);
    assert_int_equal(es_world_destroy_texture(w, texture), ES_OK);
    assert_null(es_world_texture_image(w, texture));
    assert_int_equal(es_world_add_material(w, "m", &md, &material), ES_STALE_HANDLE); /* its image is gone */
}

/* ---- refusals ------------------------------------------------------------------------------------------------------------------ */

static void refusals(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    const float bad[] = {NAN, INFINITY, -INFINITY, 1e30f, -2e9f};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        float p[9];
        memcpy(p, triangle, sizeof p);
        p[4] = bad[i];
        es_mesh mesh;
        es_mesh_desc md = {.vertex_count = 3, .triangle_count = 1, .positions = p, .indices = triangle_indices};
        assert_int_equal(es_world_add_mesh(w, &md, &mesh), ES_INVALID_ARGUMENT);
        assert_int_equal(mesh.id, 0);
        md.positions = triangle;
        md.normals = p;
        assert_int_equal(es_world_add_mesh(w, &md, &mesh), ES_INVALID_ARGUMENT);

        es_node node;
        es_node_desc nd = {.transform = es_identity_transform()};
        nd.transform.scale.y = bad[i];
        assert_int_equal(es_world_add_node(w, &nd, &node), ES_INVALID_ARGUMENT);
        nd.transform = es_identity_transform();
        nd.transform.rotation.w = bad[i];
        assert_int_equal(es_world_add_node(w, &nd, &node), ES_INVALID_ARGUMENT);

        es_light light;
        es_light_desc ld = es_default_light_desc();
        ld.intensity = bad[i] == 1e30f ? -1 : bad[i];
        assert_int_equal(es_world_add_light(w, &ld, &light), ES_INVALID_ARGUMENT);
        es_camera camera;
        es_camera_desc cd = es_default_camera_desc();
        cd.fov_y = bad[i];
        assert_int_equal(es_world_add_camera(w, &cd, &camera), ES_INVALID_ARGUMENT);
        es_material material;
        es_material_desc matd = es_default_material_desc();
        matd.roughness = bad[i];
        assert_int_equal(es_world_add_material(w, "x", &matd, &material), ES_INVALID_ARGUMENT);
        assert_int_equal(es_world_step(w, bad[i]), ES_INVALID_ARGUMENT);
    }
    es_mesh mesh;
    static const uint32_t outside[3] = {0, 1, 3};
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.vertex_count = 3, .triangle_count = 1, .positions = triangle, .indices = outside}, &mesh), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.vertex_count = 3, .triangle_count = 1}, &mesh), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_add_instance(w, &(es_instance_desc){0}, &(es_instance){0}), ES_STALE_HANDLE);
    es_light_desc ld = es_default_light_desc();
    ld.inner_cone = 1.0f;
    ld.outer_cone = 0.5f;
    assert_int_equal(es_world_add_light(w, &ld, &(es_light){0}), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_step(w, 10.1f), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_step(w, -0.1f), ES_INVALID_ARGUMENT);
    es_raster_view view;
    es_camera camera;
    assert_int_equal(es_world_add_camera(w, &(es_camera_desc){0}, &camera), ES_OK); /* zeros are defaults */
    assert_int_equal(es_world_camera_view(w, camera, 0, 0, &view), ES_IMAGE_SIZE);
    assert_int_equal(es_world_camera_view(w, camera, 20000, 20000, &view), ES_IMAGE_SIZE);
    es_world* other;
    assert_int_equal(es_world_open(es_world_context(w), "corn", NULL, &other), ES_SCENE_UNKNOWN);
    assert_non_null(strstr(es_context_message(es_world_context(w)), "cornell"));
    assert_null(other);
#ifdef ES_WITH_TINYGLTF
    assert_int_equal(es_world_open(es_world_context(w), "./nothing-here.glb", NULL, &other), ES_FILE_NOT_FOUND);
#else
    assert_int_equal(es_world_open(es_world_context(w), "./nothing-here.glb", NULL, &other), ES_NOT_BUILT);
#endif
}

/* ---- meshes ------------------------------------------------------------------------------------------------------------------------ */

static void meshes(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    /* two faces of unequal area meet at a right angle along the z axis: (1, 0, 0) weighs twice as much as (0, 1, 0) */
    static const float p[] = {0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 2, 0, 5, 5, 5};
    static const uint32_t i[] = {0, 1, 2, 0, 3, 1};
    es_mesh mesh;
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.vertex_count = 5, .triangle_count = 2, .positions = p, .indices = i}, &mesh), ES_OK);
    const es_raster_mesh* m = es_world_mesh(w, mesh);
    float s = sqrtf(5);
    assert_vec3(es_v3(m->normals[0], m->normals[1], m->normals[2]), 2 / s, 1 / s, 0);
    assert_vec3(es_v3(m->normals[8], m->normals[9], m->normals[10]), 0, 1, 0);
    assert_vec3(es_v3(m->normals[16], m->normals[17], m->normals[18]), 0, 1, 0); /* belongs to no triangle */
    assert_true(m->positions[3] == 1 && m->positions[19] == 1);
    assert_memory_equal(m->positions + 4 * 7, m->positions, 16); /* padding repeats vertex 0 */
    assert_int_equal(m->indices[6], 0);
    assert_vec3(m->bounds_max, 5, 5, 5);
    assert_int_equal((uintptr_t)m->positions % 16, 0);

    es_mesh flat;
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.vertex_count = 5, .triangle_count = 2, .positions = p, .indices = i, .flat_normals = true}, &flat), ES_OK);
    assert_null(es_world_mesh(w, flat)->normals);
    static const float zero_normals[15] = {0};
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.vertex_count = 5, .triangle_count = 2, .positions = p, .normals = zero_normals, .indices = i}, &flat), ES_OK);
    assert_memory_equal(es_world_mesh(w, flat)->normals, es_world_mesh(w, mesh)->normals, 5 * 16); /* normals without a direction are computed */

    es_mesh none;
    assert_int_equal(es_world_add_mesh(w, &(es_mesh_desc){.name = "empty"}, &none), ES_OK);
    add_instance(w, (es_node){0}, none);
    assert_int_equal(es_world_draw_list(w)->instance_count, 0);
    assert_false(es_world_bounds(w, NULL, NULL));
}

static void deform_step(es_world* world, void* user, double time, float dt)
{
    float p[9];
    memcpy(p, triangle, sizeof p);
    p[1] = (float)time;
    assert_int_equal(es_world_deform_mesh(world, *(es_mesh*)user, p, NULL), ES_OK);
    assert_int_equal(es_world_step(world, 0.1f), ES_WRONG_STATE);
}

static void deforming(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    es_mesh mesh = add_triangle(w);
    add_instance(w, (es_node){0}, mesh);
    uint64_t rest = es_world_hash(w);
    size_t size = 0;
    assert_int_equal(es_world_save(w, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_int_equal(es_world_save(w, saved, &size), ES_OK);
    es_world_set_step_function(w, deform_step, &mesh);
    es_world_revisions before = es_world_get_revisions(w);
    assert_int_equal(es_world_step(w, 0.5f), ES_OK);
    assert_int_equal(es_world_step(w, 0.25f), ES_OK);
    const es_raster_mesh* m = es_world_mesh(w, mesh);
    assert_true(m->positions[1] == 0.75f && m->previous_positions && m->previous_positions[1] == 0.5f);
    es_world_revisions after = es_world_get_revisions(w);
    assert_true(after.geometry > before.geometry && after.moving && after.lights == before.lights && after.materials == before.materials);
    assert_int_equal(es_world_step(w, 0), ES_OK);
    assert_null(es_world_mesh(w, mesh)->previous_positions);
    assert_false(es_world_get_revisions(w).moving);
    assert_true(es_world_get_revisions(w).geometry == after.geometry);
    assert_int_equal(es_world_deform_mesh(w, mesh, (const float[]){NAN, 0, 0, 0, 0, 0, 0, 0, 0}, NULL), ES_INVALID_ARGUMENT);
    assert_int_equal(es_world_restore(w, saved, size), ES_OK); /* back to vertices that the state does not hold */
    assert_true(es_world_mesh(w, mesh)->positions[1] == 0 && es_world_hash(w) == rest);
    free(saved);
}

/* ---- nodes ------------------------------------------------------------------------------------------------------------------------- */

static void tree(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    es_node gone = add_node(w, NULL, (es_node){0}, es_v3(0, 0, 0));
    es_node root = add_node(w, "root", (es_node){0}, es_v3(1, 0, 0));
    assert_int_equal(es_world_destroy_node(w, gone), ES_OK);
    es_node child = add_node(w, "child", root, es_v3(0, 2, 0)); /* takes the slot before its parent's */
    es_transform t = {{1, 0, 0}, {0, 0, 0, 0}, {0, 0, 0}};      /* only a translation given: rotation and scale are the identity's */
    assert_int_equal(es_world_set_node_transform(w, root, &t), ES_OK);
    assert_vec3(position_of(w, child), 1, 2, 0);
    t = (es_transform){{1, 0, 0}, es_quat_from_axis_angle(es_v3(0, 0, 1), 0.5f * ES_PI), {1, 2, -1}};
    assert_int_equal(es_world_set_node_transform(w, root, &t), ES_OK);
    assert_vec3(position_of(w, child), -3, 0, 0);
    es_transform back;
    assert_int_equal(es_world_get_node_transform(w, root, &back), ES_OK);
    uint64_t geometry = es_world_get_revisions(w).geometry;
    assert_int_equal(es_world_set_node_transform(w, root, &back), ES_OK); /* what was got can be set without a change */
    assert_true(es_world_get_revisions(w).geometry == geometry);

    es_mesh mesh = add_triangle(w);
    add_instance(w, child, mesh);
    t.scale = es_v3(0, 0, 0);
    t.rotation = es_quat_identity();
    assert_int_equal(es_world_set_node_transform(w, root, &t), ES_OK);
    assert_int_equal(es_world_draw_list(w)->instance_count, 1); /* zero scale survives */
    t.scale = es_v3(1e9f, 1e9f, 1e9f);
    assert_int_equal(es_world_set_node_transform(w, root, &t), ES_OK);
    assert_int_equal(es_world_draw_list(w)->instance_count, 0); /* beyond the world's extent: left out */
    t.scale = es_v3(1, 1, 1);
    assert_int_equal(es_world_set_node_transform(w, root, &t), ES_OK);
    assert_int_equal(es_world_draw_list(w)->instance_count, 1);

    es_node deep = root; /* a long chain orders itself by depth */
    for (int i = 0; i < 3000; i++) deep = add_node(w, NULL, deep, es_v3(0, 1, 0));
    assert_vec3(position_of(w, deep), 1, 3000, 0);
}

static void previous_pose(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    es_node node = add_node(w, "n", (es_node){0}, es_v3(0, 0, 0));
    es_mesh mesh = add_triangle(w);
    add_instance(w, node, mesh);
    es_camera camera;
    assert_int_equal(es_world_add_camera(w, &(es_camera_desc){.node = node}, &camera), ES_OK);
    assert_int_equal(es_world_active_camera(w).id, camera.id);
    es_transform t = es_identity_transform();
    t.translation.x = 3;
    es_world_set_node_transform(w, node, &t);
    assert_false(es_world_get_revisions(w).moving); /* before the first step there is no last frame */
    assert_int_equal(es_world_step(w, 0.1f), ES_OK);
    es_world_revisions still = es_world_get_revisions(w);
    t.translation.x = 5;
    es_world_set_node_transform(w, node, &t);
    const es_raster_instance* drawn = es_world_draw_list(w)->instances;
    assert_true(drawn->transform.m[12] == 5 && drawn->previous_transform.m[12] == 3);
    es_raster_view view;
    assert_int_equal(es_world_camera_view(w, camera, 64, 48, &view), ES_OK);
    assert_true(view.view.m[12] == -5 && view.previous_view.m[12] == -3);
    es_world_revisions moved = es_world_get_revisions(w);
    assert_true(moved.moving && moved.geometry > still.geometry && moved.camera > still.camera && moved.lights == still.lights);
    assert_int_equal(es_world_step(w, 0.1f), ES_OK);
    drawn = es_world_draw_list(w)->instances;
    assert_true(drawn->previous_transform.m[12] == 5);
    es_world_revisions after = es_world_get_revisions(w);
    assert_true(!after.moving && after.geometry == moved.geometry && after.camera == moved.camera);
    for (int i = 0; i < 3; i++) es_world_step(w, 0.1f); /* a static world keeps its numbers */
    assert_true(same_revisions(es_world_get_revisions(w), after));
}

static void lights(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    es_transform t = es_identity_transform();
    t.rotation = es_quat_from_axis_angle(es_v3(1, 0, 0), -0.5f * ES_PI);
    t.scale = es_v3(2, -3, 0.5f);
    es_node node;
    assert_int_equal(es_world_add_node(w, &(es_node_desc){"n", {0}, t}, &node), ES_OK);
    es_light_desc desc = es_default_light_desc();
    desc.node = node;
    desc.intensity = 5;
    desc.color[1] = 0.5f;
    desc.inner_cone = desc.outer_cone = 0.7f;
    es_light light, black;
    assert_int_equal(es_world_add_light(w, &(es_light_desc){0}, &black), ES_OK);
    assert_int_equal(es_world_add_light(w, &desc, &light), ES_OK);
    size_t count;
    const es_light_state* states = es_world_lights(w, &count);
    assert_int_equal(count, 1);
    assert_int_equal(states[0].handle.id, light.id);
    assert_vec3(states[0].direction, 0, -1, 0);
    assert_vec3(es_v3(states[0].radiant[0], states[0].radiant[1], states[0].radiant[2]), 5, 2.5f, 5);
    assert_true(states[0].cos_inner > states[0].cos_outer);
    uint64_t revision = es_world_get_revisions(w).lights;
    assert_int_equal(es_world_set_light(w, light, &desc), ES_OK);
    assert_true(es_world_get_revisions(w).lights == revision);
    desc.off = true;
    assert_int_equal(es_world_set_light(w, light, &desc), ES_OK);
    assert_true(es_world_get_revisions(w).lights > revision);
    es_world_lights(w, &count);
    assert_int_equal(count, 0);
}

/* ---- clips ------------------------------------------------------------------------------------------------------------------------- */

static es_clip play(es_world* w, es_clip_channel channel)
{
    es_clip clip;
    assert_int_equal(es_world_add_clip(w, &(es_clip_desc){"clip", 1, &channel}, &clip), ES_OK);
    assert_int_equal(es_world_play_clip(w, clip, true), ES_OK);
    return clip;
}

static es_transform at_time(es_world* w, es_node node, double time)
{
    es_transform t;
    while (es_world_time(w) < time - 1e-9) assert_int_equal(es_world_step(w, (float)fmin(time - es_world_time(w), 10)), ES_OK);
    assert_int_equal(es_world_get_node_transform(w, node, &t), ES_OK);
    return t;
}

static void clips(void** state)
{
    es_world* w = ((fixture*)*state)->world;
    es_node step = add_node(w, "step", (es_node){0}, es_v3(0, 0, 0)), linear = add_node(w, "linear", (es_node){0}, es_v3(0, 0, 0));
    es_node cubic = add_node(w, "cubic", (es_node){0}, es_v3(0, 0, 0)), turned = add_node(w, "turned", (es_node){0}, es_v3(0, 0, 0));
    static const float times[3] = {0.5f, 1, 2}, values[9] = {1, 0, 0, 2, 4, 0, 6, 0, 8};
    play(w, (es_clip_channel){step, ES_CLIP_TRANSLATION, ES_INTERPOLATE_STEP, 3, times, values});
    es_clip looping = play(w, (es_clip_channel){linear, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 3, times, values});
    /* in-tangent, value, out-tangent; between 1 and 2 with td = 1 and u = 1/4:
     * wa = 27/32, wb = 5/32, ta = 9/64, tb = -3/64; x: 27/32·2 + 9/64·8 + 5/32·6 - 3/64·16 = 3 */
    static const float spline[27] = {0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 2, 4, 0, 8, 0, 0, 16, 0, 0, 6, 0, 8, 0, 0, 0};
    play(w, (es_clip_channel){cubic, ES_CLIP_SCALE, ES_INTERPOLATE_CUBIC_SPLINE, 3, times, spline});
    /* 100° about z and its far twin 100° + 360° - 160°: the shorter arc runs from 100° to -60° the other way round */
    float a = 100 * ES_PI / 180, b = -100 * ES_PI / 180;
    float turns[8] = {0, 0, sinf(a / 2), cosf(a / 2), 0, 0, sinf(b / 2), cosf(b / 2)};
    static const float turn_times[2] = {0, 2};
    play(w, (es_clip_channel){turned, ES_CLIP_ROTATION, ES_INTERPOLATE_LINEAR, 2, turn_times, turns});

    assert_vec3(at_time(w, linear, 0.25).translation, 1, 0, 0); /* before the first key: its value */
    assert_vec3(at_time(w, step, 0.75).translation, 1, 0, 0);
    assert_vec3(at_time(w, linear, 0.75).translation, 1.5f, 2, 0);
    assert_vec3(at_time(w, step, 1).translation, 2, 4, 0);
    assert_vec3(at_time(w, linear, 1.25).translation, 3, 3, 2);
    assert_vec3(at_time(w, cubic, 1.25).scale, 3, 27.0f / 8, 5.0f / 4);
    /* half way between 100° and -100° the short way is 180° */
    es_quat half = es_quat_slerp((es_quat){0, 0, turns[2], turns[3]}, (es_quat){0, 0, turns[6], turns[7]}, 0.625f);
    es_quat q = at_time(w, turned, 1.25).rotation;
    assert_near(fabsf(q.z * half.z + q.w * half.w), 1, 1e-6f);
    assert_true(fabsf(q.z) > 0.9f); /* within 20° of the half turn, not near the identity */
    assert_vec3(at_time(w, linear, 2.75).translation, 1.5f, 2, 0); /* looped */

    assert_int_equal(es_world_play_clip(w, looping, false), ES_OK);
    assert_vec3(at_time(w, linear, 3.1).translation, 1.5f, 2, 0);
    assert_int_equal(es_world_destroy_node(w, linear), ES_WRONG_STATE); /* the clip moves it */
    assert_int_equal(es_world_destroy_clip(w, looping), ES_OK);
    assert_int_equal(es_world_destroy_node(w, linear), ES_OK);

    static const float same_times[2] = {1, 1}, nan_values[6] = {0, 0, 0, 0, 0, NAN};
    es_clip clip;
    es_clip_channel channel = {step, ES_CLIP_TRANSLATION, ES_INTERPOLATE_LINEAR, 2, same_times, values};
    assert_int_equal(es_world_add_clip(w, &(es_clip_desc){"bad", 1, &channel}, &clip), ES_INVALID_ARGUMENT);
    channel.times = times;
    channel.values = nan_values;
    assert_int_equal(es_world_add_clip(w, &(es_clip_desc){"bad", 1, &channel}, &clip), ES_INVALID_ARGUMENT);
    channel.key_count = 0;
    assert_int_equal(es_world_add_clip(w, &(es_clip_desc){"bad", 1, &channel}, &clip), ES_INVALID_ARGUMENT);
}

/* ---- settings ------------------------------------------------------------------------------------------------------------------------ */

static void settings(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    es_world_settings s = es_default_world_settings();
    assert_true(s.triangles == 0 && s.speed == 1 && s.camera == 0 && s.clip == 0 && s.default_light);
    assert_int_equal(es_world_settings_set(c, &s, "world.triangels", "5"), ES_SETTING_UNKNOWN);
    assert_non_null(strstr(es_context_message(c), "'world.triangles'"));
    assert_int_equal(es_world_settings_set(c, &s, "world.speed", "1.5e-1"), ES_OK);
    assert_true(s.speed == 0.15f);
    const char* wrong[] = {"", "nan", "inf", "1e999", "100.5", "-1", "0,5", "1x", "0x10", "1e", "."};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) assert_int_equal(es_world_settings_set(c, &s, "world.speed", wrong[i]), ES_SETTING_VALUE);
    assert_true(s.speed == 0.15f);
    assert_int_equal(es_world_settings_set(c, &s, "world.triangles", "1e6"), ES_OK);
    assert_int_equal(s.triangles, 1000000);
    assert_int_equal(es_world_settings_set(c, &s, "world.triangles", "1.5"), ES_SETTING_VALUE);
    assert_int_equal(es_world_settings_set(c, &s, "world.default-light", "off"), ES_OK);
    assert_false(s.default_light);
    assert_int_equal(es_world_settings_set(c, &s, "world.default-light", "maybe"), ES_SETTING_VALUE);
    for (size_t i = 0; i < es_world_setting_count(); i++) { /* every value's text reads back as the same value */
        char text[64], again[64];
        const es_setting* setting = es_world_setting(i);
        assert_true(es_settings_get(setting, &s, text, sizeof text));
        assert_int_equal(es_world_settings_set(c, &s, setting->name, text), ES_OK);
        assert_true(es_settings_get(setting, &s, again, sizeof again));
        assert_string_equal(text, again);
    }
    assert_null(es_world_setting(es_world_setting_count()));
    es_world* w;
    s.speed = NAN;
    assert_int_equal(es_world_create(c, &s, &w), ES_SETTING_VALUE);
    s = es_default_world_settings();
    s.camera = 7;
    assert_int_equal(es_world_create_scene(c, "cornell", &s, &w), ES_SETTING_VALUE);
    s.camera = 0;
    s.clip = 9;
    assert_int_equal(es_world_create_scene(c, "cornell", &s, &w), ES_SETTING_VALUE);
}

/* ---- environment ------------------------------------------------------------------------------------------------------------------------- */

static void environment(void** state)
{
    fixture* f = *state;
    es_world* w = f->world;
    es_environment_desc got;
    assert_false(es_world_get_environment(w, &got));
    uint64_t lights = es_world_get_revisions(w).lights;
    assert_int_equal(es_world_set_environment(w, NULL), ES_OK);
    assert_true(es_world_get_revisions(w).lights == lights); /* none it was, none it is */

    es_image image;
    assert_int_equal(es_image_create(f->context, 4, 2, 4, &image), ES_OK);
    for (int i = 0; i < 32; i++) image.pixels[i] = (float)i;
    es_environment_desc desc = {.image = &image, .radiance = {1, 2, 3}, .rotation = 0.5f};
    assert_int_equal(es_world_set_environment(w, &desc), ES_OK);
    assert_true(es_world_get_revisions(w).lights > lights);
    image.pixels[5] = 100; /* the world has its own */
    assert_true(es_world_get_environment(w, &got));
    assert_true(got.radiance[1] == 2 && got.rotation == 0.5f && got.image->width == 4 && got.image->height == 2 && got.image->channels == 3);
    assert_true(got.image->pixels[4] == 5 && got.image->pixels[23] == 30);

    /* channels as a file with its own order names them */
    for (int c = 0; c < 4; c++) image.channel_names[c][0] = "ABGR"[c];
    assert_int_equal(es_world_set_environment(w, &desc), ES_OK);
    assert_true(es_world_get_environment(w, &got) && got.image->pixels[0] == 3 && got.image->pixels[2] == 1);

    lights = es_world_get_revisions(w).lights;
    uint64_t hash = es_world_hash(w);
    struct { float radiance, rotation; } wrong[] = {{-1, 0}, {NAN, 0}, {INFINITY, 0}, {1, NAN}, {1, 1e9f}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        es_environment_desc bad = {.image = &image, .radiance = {1, 1, wrong[i].radiance}, .rotation = wrong[i].rotation};
        assert_int_equal(es_world_set_environment(w, &bad), ES_INVALID_ARGUMENT);
    }
    image.channels = 2;
    assert_int_equal(es_world_set_environment(w, &desc), ES_INVALID_ARGUMENT);
    image.channels = 4;
    assert_true(es_world_get_revisions(w).lights == lights && es_world_hash(w) == hash); /* a refused one changes nothing */

    /* its factor and rotation are state, its image is not */
    size_t size = 0;
    assert_int_equal(es_world_save(w, NULL, &size), ES_OK);
    void* saved = malloc(size);
    assert_int_equal(es_world_save(w, saved, &size), ES_OK);
    assert_true(es_world_get_environment(w, &got));
    got.radiance[0] = 7;
    got.rotation = -1;
    assert_int_equal(es_world_set_environment(w, &got), ES_OK); /* the world's own image may be given back */
    assert_true(got.image->pixels[0] == 3 && es_world_hash(w) != hash);
    assert_int_equal(es_world_restore(w, saved, size), ES_OK);
    assert_true(es_world_hash(w) == hash && es_world_get_environment(w, &got) && got.radiance[0] == 1 && got.rotation == 0.5f && got.image);
    desc.image = NULL;
    assert_int_equal(es_world_set_environment(w, &desc), ES_OK);
    assert_true(es_world_get_environment(w, &got) && !got.image);
    assert_int_equal(es_world_restore(w, saved, size), ES_WRONG_STATE);
    assert_int_equal(es_world_set_environment(w, NULL), ES_OK);
    assert_false(es_world_get_environment(w, &got));
    free(saved);
    es_image_destroy(f->context, &image);
}

/* Values that are no light become 0, which is said once; a picture larger than the world keeps becomes smaller and loses no power. */
static void count_warnings(void* user, es_log_level level, es_result item, const char* message)
{
    int* count = user;
    if (level == ES_LOG_WARNING && strstr(message, "3 values") && strstr(message, "(2, 1)")) ++*count;
}
static void odd_environments(void** state)
{
    int warnings = 0;
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger = (es_logger){count_warnings, &warnings};
    es_context* c;
    assert_int_equal(es_context_create(&desc, &c), ES_OK);
    es_world* w;
    assert_int_equal(es_world_create(c, NULL, &w), ES_OK);
    es_image image;
    es_environment_desc got, environment = {.image = &image, .radiance = {1, 1, 1}};
    assert_int_equal(es_image_create(c, 4, 3, 3, &image), ES_OK);
    for (int i = 0; i < 36; i++) image.pixels[i] = 2;
    image.pixels[3 * 6 + 1] = NAN;
    image.pixels[3 * 7] = -1;
    image.pixels[3 * 11 + 2] = INFINITY;
    assert_int_equal(es_world_set_environment(w, &environment), ES_OK);
    assert_int_equal(warnings, 1);
    assert_true(es_world_get_environment(w, &got));
    for (int i = 0; i < 36; i++) assert_true(got.image->pixels[i] == (i == 19 || i == 21 || i == 35 ? 0.0f : 2.0f));
    es_image_destroy(c, &image);

    /* twice as wide, not a whole number of times as high, and the other way round */
    static const uint32_t sizes[][2] = {{2 * ES_ENVIRONMENT_MAX_WIDTH, 3}, {3, ES_ENVIRONMENT_MAX_HEIGHT + 513}, {ES_ENVIRONMENT_MAX_WIDTH + 37, 2}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const uint32_t width = sizes[s][0], height = sizes[s][1];
        assert_int_equal(es_image_create(c, width, height, 3, &image), ES_OK);
        for (size_t i = 0; i < (size_t)width * height * 3; i++) image.pixels[i] = 1e-3f;
        image.pixels[3 * ((size_t)width * (height / 3) + width / 5) + 1] = 1e3f;
        assert_int_equal(es_world_set_environment(w, &environment), ES_OK);
        assert_true(es_world_get_environment(w, &got) && got.image->width <= ES_ENVIRONMENT_MAX_WIDTH && got.image->height <= ES_ENVIRONMENT_MAX_HEIGHT);
        double power[2] = {0, 0};
        const es_image* of[2] = {&image, got.image};
        for (int which = 0; which < 2; which++)
            for (uint32_t y = 0; y < of[which]->height; y++)
                for (uint32_t x = 0; x < of[which]->width; x++) {
                    const double h = of[which]->height, pi = 3.14159265358979323846;
                    power[which] += (double)of[which]->pixels[3 * ((size_t)y * of[which]->width + x) + 1] * (cos(pi * y / h) - cos(pi * (y + 1) / h)) / of[which]->width;
                }
        if (!(fabs(power[1] / power[0] - 1) < 1e-5)) fail_msg("%u × %u: power %.8g became %.8g", width, height, power[0], power[1]);
        es_image_destroy(c, &image);
    }
    es_world_destroy(w);
    assert_int_equal(es_context_bytes(c), 0);
    es_context_destroy(c);
}

/* ---- saved states ---------------------------------------------------------------------------------------------------------------------- */

static void saving(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    es_world *w, *room;
    assert_int_equal(es_world_open(c, "cornell", NULL, &w), ES_OK);
    for (int i = 0; i < 7; i++) assert_int_equal(es_world_step(w, 1.0f / 30), ES_OK);
    size_t size = 0;
    assert_int_equal(es_world_save(w, NULL, &size), ES_OK);
    char *saved = malloc(size), *again = malloc(size);
    assert_int_equal(es_world_save(w, saved, &size), ES_OK);
    size_t small = size - 1;
    assert_int_equal(es_world_save(w, again, &small), ES_INVALID_ARGUMENT);
    uint64_t here = es_world_hash(w), path[5];
    es_mat4 last = es_world_draw_list(w)->instances[5].previous_transform;
    for (int i = 0; i < 5; i++) {
        es_world_step(w, 1.0f / 30);
        path[i] = es_world_hash(w);
    }
    for (int round = 0; round < 2; round++) {
        assert_int_equal(es_world_restore(w, saved, size), ES_OK);
        assert_true(es_world_hash(w) == here);
        assert_memory_equal(&es_world_draw_list(w)->instances[5].previous_transform, &last, sizeof last);
        assert_int_equal(es_world_save(w, again, &size), ES_OK);
        assert_memory_equal(saved, again, size);
        for (int i = 0; i < 5; i++) {
            es_world_step(w, 1.0f / 30);
            assert_true(es_world_hash(w) == path[i]);
        }
    }
    uint64_t before = es_world_hash(w);
    assert_int_equal(es_world_restore(w, saved, size - 4), ES_FILE_DAMAGED);
    assert_int_equal(es_world_restore(w, saved, 3), ES_FILE_TYPE);
    saved[size / 2] ^= 1;
    assert_int_equal(es_world_restore(w, saved, size), ES_FILE_DAMAGED);
    saved[size / 2] ^= 1;
    assert_int_equal(es_world_open(c, "room", NULL, &room), ES_OK);
    assert_int_equal(es_world_restore(room, saved, size), ES_WRONG_STATE);
    assert_true(es_world_hash(w) == before); /* a refused state changes nothing */
    free(saved);
    free(again);
    es_world_destroy(room);
    es_world_destroy(w);
}

/* ---- scenes -------------------------------------------------------------------------------------------------------------------------------- */

typedef struct edge { float a[3], b[3]; int direction; } edge;

static int compare_edges(const void* x, const void* y) { return memcmp(x, y, 6 * sizeof(float)); }

/* Every edge, by the positions of its ends, is used as often in one direction as in the other; zero-area triangles (at poles)
 * have no say. -0 and +0 are one position. */
static bool closed(const es_raster_mesh* mesh)
{
    edge* edges = calloc((size_t)mesh->triangle_count * 3, sizeof *edges);
    size_t count = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        float p[3][3];
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++) p[k][axis] = mesh->positions[4 * (size_t)mesh->indices[3 * t + k] + axis] + 0.0f;
        if (!memcmp(p[0], p[1], 12) || !memcmp(p[1], p[2], 12) || !memcmp(p[2], p[0], 12)) continue;
        for (int k = 0; k < 3; k++) {
            const float *from = p[k], *to = p[(k + 1) % 3];
            bool forward = memcmp(from, to, 12) < 0;
            memcpy(edges[count].a, forward ? from : to, 12);
            memcpy(edges[count].b, forward ? to : from, 12);
            edges[count++].direction = forward ? 1 : -1;
        }
    }
    qsort(edges, count, sizeof *edges, compare_edges);
    bool good = true;
    for (size_t i = 0; i < count && good;) {
        int sum = 0;
        size_t first = i;
        for (; i < count && compare_edges(&edges[first], &edges[i]) == 0; i++) sum += edges[i].direction;
        good = sum == 0;
    }
    free(edges);
    return good;
}

static size_t triangles_of(const es_world* world)
{
    const es_draw_list* list = es_world_draw_list(world);
    size_t count = 0;
    for (uint32_t i = 0; i < list->instance_count; i++) count += list->instances[i].mesh->triangle_count;
    return count;
}

static void scenes(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    static const struct { const char* name; uint32_t triangles; size_t least, most; } cases[] = {
        {"cornell", 0, 3372, 3372}, {"cornell", 1, 100, 300}, {"cornell", 20000, 19500, 20500},
        {"room", 0, 69552, 69552}, {"room", 70000, 69552, 69552}, {"room", 1000000, 984000, 984000}, {"room", 1, 1, 3000},
        {"hall", 0, 70000, 120000}, {"hall", 1, 5000, 30000}, {"hall", 500000, 480000, 520000},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        es_world_settings s = es_default_world_settings();
        s.triangles = cases[i].triangles;
        es_world* w;
        assert_int_equal(es_world_create_scene(c, cases[i].name, &s, &w), ES_OK);
        size_t triangles = triangles_of(w);
        if (triangles < cases[i].least || triangles > cases[i].most) fail_msg("%s at %u has %zu triangles", cases[i].name, cases[i].triangles, triangles);
        assert_int_not_equal(es_world_active_camera(w).id, 0);
        size_t lights;
        es_world_lights(w, &lights);
        assert_int_equal(lights, 1);
        assert_false(es_world_get_revisions(w).moving);
        es_world_destroy(w);
    }
    assert_null(es_scene_name(es_scene_count()));
}

static void closed_meshes(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    for (size_t s = 0; s < es_scene_count(); s++)
        for (uint32_t triangles = 0; triangles <= 30000; triangles += 30000) {
            es_world_settings settings = es_default_world_settings();
            settings.triangles = triangles;
            es_world* w;
            assert_int_equal(es_world_create_scene(c, es_scene_name(s), &settings, &w), ES_OK);
            size_t count = 0;
            assert_int_equal(es_world_enumerate(w, ES_OBJECT_MESH, NULL, &count), ES_OK);
            uint32_t* ids = malloc(count * sizeof *ids);
            assert_int_equal(es_world_enumerate(w, ES_OBJECT_MESH, ids, &count), ES_OK);
            for (size_t i = 0; i < count; i++) {
                const char* name = es_world_name(w, ES_OBJECT_MESH, ids[i]);
                bool sheet = strstr(name, "slabs") || strstr(name, "strip") || strstr(name, "silk") || strstr(name, "mirror") || strstr(name, "curtain") || strstr(name, "flat lamp") || (strcmp(es_scene_name(s), "room") == 0 && (strstr(name, "wall") || strstr(name, "floor") || strstr(name, "ceiling")));
                if (!sheet && !closed(es_world_mesh(w, (es_mesh){ids[i]}))) fail_msg("%s: mesh %s is not closed", es_scene_name(s), name);
            }
            free(ids);
            es_world_destroy(w);
        }
}

/* The objects of the Cornell box stay in it all through the loop and come back to where they began. */
static void cornell_stays_inside(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    es_world* w;
    assert_int_equal(es_world_open(c, "cornell", NULL, &w), ES_OK);
    es_vec3 first = {0}, a, b;
    for (int i = 0; i <= 200; i++) {
        const es_draw_list* list = es_world_draw_list(w);
        for (uint32_t k = 0; k < list->instance_count; k++) {
            const es_raster_instance* instance = &list->instances[k];
            if (strstr("floor ceiling back wall left wall right wall", es_world_name(w, ES_OBJECT_MESH, 1u << 20 | k))) continue;
            for (uint32_t v = 0; v < instance->mesh->vertex_count; v++) {
                const float* p = instance->mesh->positions + 4 * (size_t)v;
                es_vec3 q = es_mat4_point(&instance->transform, es_v3(p[0], p[1], p[2]));
                assert_true(q.x > -1 && q.x < 1 && q.y >= 0 && q.y < 2 && q.z > -1 && q.z < 1);
            }
        }
        assert_true(es_world_bounds(w, &a, &b));
        es_vec3 knot = position_of(w, es_world_find_node(w, "knot"));
        if (i == 0) first = knot;
        if (i == 200) assert_near(es_v3_length(es_v3_sub(knot, first)), 0, 1e-4f); /* the loop closes */
        assert_int_equal(es_world_step(w, 0.1f), ES_OK);
    }
    es_world_destroy(w);
}

static void determinism(void** state)
{
    es_context* c = ((fixture*)*state)->context;
    for (size_t s = 0; s < es_scene_count(); s++) {
        uint64_t hash[2];
        for (int run = 0; run < 2; run++) {
            es_world* w;
            assert_int_equal(es_world_open(c, es_scene_name(s), NULL, &w), ES_OK);
            es_world_revisions before = es_world_get_revisions(w);
            for (int i = 0; i < 50; i++) assert_int_equal(es_world_step(w, 1.0f / 60), ES_OK);
            hash[run] = es_world_hash(w);
            es_world_revisions after = es_world_get_revisions(w);
            if (strcmp(es_scene_name(s), "room") == 0) assert_true(same_revisions(before, after)); /* static */
            else if (strcmp(es_scene_name(s), "rokeby") == 0) assert_true(after.camera > before.camera && after.geometry == before.geometry && after.lights == before.lights); /* the eye alone */
            else assert_true(after.lights > before.lights || after.geometry > before.geometry);
            es_world_destroy(w);
        }
        assert_true(hash[0] == hash[1]);
        printf("%s after 50 steps: %016llx\n", es_scene_name(s), (unsigned long long)hash[0]);
    }
}

/* Every allocation of opening a scene fails in turn: a result, nothing leaked, nothing left behind. */
static void little_memory(void** state)
{
    for (size_t cap = 1024; cap < 400 * 1024; cap = cap * 5 / 4) {
        es_context_desc desc = es_default_context_desc();
        desc.threads = 1;
        desc.logger.log = no_log;
        desc.memory_cap = cap;
        es_context* c;
        if (es_context_create(&desc, &c) != ES_OK) continue;
        size_t before = es_context_bytes(c);
        es_world* w;
        es_result result = es_world_open(c, "cornell", NULL, &w);
        assert_true(result == ES_OK ? w != NULL : result == ES_MEMORY_CAP && w == NULL);
        es_world_destroy(w);
        assert_int_equal(es_context_bytes(c), before);
        es_context_destroy(c);
    }
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(handles), TEST(references), TEST(refusals), TEST(meshes), TEST(deforming), TEST(tree), TEST(previous_pose), TEST(lights), TEST(clips),
        TEST(settings), TEST(environment), TEST(odd_environments), TEST(saving), TEST(scenes), TEST(closed_meshes), TEST(cornell_stays_inside), TEST(determinism), TEST(little_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
