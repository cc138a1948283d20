/* A dragon before a mirror, after Velázquez's Venus of Rokeby and figure 7.6 of Ritschel's thesis: it looks into the mirror and its back is turned to us. By the law of
 * reflection the mirror would show its tail and its coils; one constraint makes it show the face, which one looks for there. */
#include "sim/scenes/body_tools.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/scenes/dragon.h"
#include "sim/scenes/edit_tools.h"

static const float low_x = -2.8f, high_x = 3.0f, low_z = -2.9f, high_z = 4.2f, height = 3.0f;

static void add_shell(es_scene_builder* builder)
{
    const es_material pale = es_build_lambert(builder, "limestone", 0.58f, 0.52f, 0.44f), dark = es_build_lambert(builder, "basalt", 0.16f, 0.14f, 0.14f);
    es_build_slabs(builder, es_v3(low_x, 0, low_z), es_v3(high_x, 0, high_z), 8, 10, pale, dark);
    const es_vec3 size = {high_x - low_x, height, high_z - low_z};
    es_shape ceiling = es_build_shape(builder), ends = es_build_shape(builder), left = es_build_shape(builder), right = es_build_shape(builder);
    es_shape_plane(&ceiling, es_v3(low_x, height, low_z), es_v3(size.x, 0, 0), es_v3(0, 0, size.z), es_v3(0, -1, 0), 4, 4);
    es_shape_plane(&ends, es_v3(low_x, 0, low_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, 1), 4, 2);
    es_shape_plane(&ends, es_v3(low_x, 0, high_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, -1), 4, 2);
    es_shape_plane(&left, es_v3(low_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, size.y, 0), es_v3(1, 0, 0), 4, 2);
    es_shape_plane(&right, es_v3(high_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, size.y, 0), es_v3(-1, 0, 0), 4, 2);
    es_build_object(builder, "ceiling slabs", &ceiling, es_build_lambert(builder, "ceiling", 0.74f, 0.70f, 0.62f), es_v3(0, 0, 0));
    es_build_object(builder, "end slabs", &ends, es_build_lambert(builder, "umber", 0.46f, 0.38f, 0.30f), es_v3(0, 0, 0));
    es_build_object(builder, "left slabs", &left, es_build_lambert(builder, "madder", 0.55f, 0.13f, 0.10f), es_v3(0, 0, 0));
    es_build_object(builder, "right slabs", &right, es_build_lambert(builder, "sage", 0.30f, 0.40f, 0.28f), es_v3(0, 0, 0));
}

static const es_vec3 mirror_at = {0.30f, 1.02f, -2.89f};

/* On the wall behind the dragon: its middle at the node. */
static es_instance add_mirror(es_scene_builder* builder)
{
    const float x = 0.80f, y = 0.66f, w = 0.10f, depth = 0.07f;
    es_node node = es_build_node(builder, "mirror", mirror_at, es_quat_identity());
    es_shape glass = es_build_shape(builder), frame = es_build_shape(builder);
    es_shape_plane(&glass, es_v3(-x, -y, 0.02f), es_v3(2 * x, 0, 0), es_v3(0, 2 * y, 0), es_v3(0, 0, 1), 12, 10);
    const es_instance mirror = es_build_instance(builder, node, es_build_mesh(builder, "mirror", &glass), es_build_gloss(builder, "silvered glass", 0.93f, 0.93f, 0.92f, 1, 0));
    es_shape_box(&frame, es_v3(-x - w, -y - w, 0), es_v3(x + w, -y, depth));
    es_shape_box(&frame, es_v3(-x - w, y, 0), es_v3(x + w, y + w, depth));
    es_shape_box(&frame, es_v3(-x - w, -y, 0), es_v3(-x, y, depth));
    es_shape_box(&frame, es_v3(x, -y, 0), es_v3(x + w, y, depth));
    es_build_instance(builder, node, es_build_mesh(builder, "frame", &frame), es_build_lambert(builder, "ebony", 0.10f, 0.07f, 0.05f));
    return mirror;
}

static void add_dragon(es_scene_builder* builder, float scale)
{
    es_node node = {0};
    const es_node_desc desc = {.name = "dragon", .transform = {es_v3(-0.62f, 0, -0.95f), es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI), {0.62f, 0.62f, 0.62f}}};
    if (builder->result == ES_OK) builder->result = es_world_add_node(builder->world, &desc, &node);
    es_shape column = es_build_shape(builder);
    es_shape_cylinder(&column, es_v3(0, 0, 0), 0.36f, 2.45f, 48);
    es_build_instance(builder, node, es_build_mesh(builder, "column", &column), es_build_lambert(builder, "porphyry", 0.52f, 0.42f, 0.36f));
    const es_dragon_materials materials = {es_build_gloss(builder, "scales", 0.10f, 0.42f, 0.24f, 0, 0.45f), es_build_lambert(builder, "ivory", 0.82f, 0.74f, 0.58f), es_build_lambert(builder, "amber", 0.92f, 0.42f, 0.05f)};
    es_build_dragon(builder, node, &materials, scale);
}

/* Something for the mirror to see beyond the dragon. */
static void add_things(es_scene_builder* builder)
{
    static const float paints[4][3] = {{0.62f, 0.16f, 0.12f}, {0.14f, 0.26f, 0.56f}, {0.72f, 0.56f, 0.14f}, {0.18f, 0.48f, 0.30f}};
    for (int i = 0; i < 4; i++) {
        es_shape box = es_build_shape(builder);
        const float x = -2.3f + 1.45f * (float)i;
        es_shape_box(&box, es_v3(x, 0.8f, high_z - 0.06f), es_v3(x + 0.95f, 2.1f, high_z - 0.005f));
        es_build_object(builder, "hanging", &box, es_build_lambert(builder, "tapestry", paints[i][0], paints[i][1], paints[i][2]), es_v3(0, 0, 0));
    }
}

es_result es_scene_rokeby(es_world* world, uint32_t triangles)
{
    enum { OTHERS = 1000, TRIANGLES = 72000 };
    es_scene_builder builder = {world, ES_OK};
    const float scale = es_sqrt((float)((triangles ? triangles > 2 * OTHERS ? triangles : 2 * OTHERS : TRIANGLES) - OTHERS) / (float)ES_DRAGON_TRIANGLES);
    add_shell(&builder);
    const es_instance mirror = add_mirror(&builder);
    add_dragon(&builder, scale);
    add_things(&builder);
    es_build_spot(&builder, es_v3(2.5f, 2.75f, 1.6f), es_v3(-2.9f, -1.75f, -2.9f), (const float[3]){1.0f, 0.90f, 0.76f}, 60, 0.36f, 0.72f);
    es_build_spot(&builder, es_v3(-2.4f, 2.7f, -2.3f), es_v3(1.75f, -1.15f, 1.35f), (const float[3]){0.72f, 0.82f, 1.0f}, 12, 0.4f, 0.85f);
    /* the eye goes to and fro about what it looks at */
    const es_vec3 eye = {1.35f, 1.55f, 2.5f}, target = {-0.16f, 1.0f, -1.8f}, direction = es_v3_sub(target, eye);
    const es_node node = es_build_node(&builder, "camera", eye, es_look_rotation(direction));
    es_camera_desc camera = es_default_camera_desc();
    camera.name = "camera";
    camera.node = node;
    camera.fov_y = 0.70f;
    camera.near_plane = 0.05f;
    es_camera unused;
    if (builder.result == ES_OK) builder.result = es_world_add_camera(world, &camera, &unused);
    es_build_mover(&builder, &(es_mover_desc){.name = "to and fro", .type = ES_MOVER_SWING, .node = node, .centre = target, .arm = es_v3_sub(eye, target), .rotation = es_look_rotation(direction), .period = 16, .amplitude = 0.16f});
    /* §7.6.1: the mirror should show the face */
    es_build_region(&builder, "mirror", ES_REGION_GEODESIC, mirror, mirror_at, 1.3f, 0.1f);
    es_build_constraint(&builder, "the face", mirror, es_v3(mirror_at.x - 0.2f, mirror_at.y + 0.1f, mirror_at.z), es_v3(-0.62f, 1.95f, -1.72f), eye);
    return builder.result;
}
