/* A stack of ten cubes in the Cornell box, a heavy ball that brings it down, and a lamp that sways: after Knecht 2009, figure 5.2, with the
 * 3,372 triangles of its section 5.2. */
#include "sim/scenes/box_room.h"

#include "platform/maths.h"

static const float half = 0.12f;

static void add_cube(es_scene_builder* builder, es_vec3 centre, float turned, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3(-half, -half, -half), es_v3(half, half, half));
    es_mesh mesh = es_build_mesh(builder, "cube", &shape);
    es_node node = es_build_node(builder, "cube", centre, es_quat_from_axis_angle(es_v3(0, 1, 0), turned));
    es_build_instance(builder, node, mesh, material);
    es_shape_desc box = es_box_shape(es_v3(half, half, half));
    box.density = 300;
    es_build_body(builder, node, ES_BODY_DYNAMIC, &box, NULL);
}

/* 38 × 42 rings' quadrilaterals are 3,192 triangles, 180 less than all; other totals keep the proportion. */
static es_mesh ball_mesh(es_scene_builder* builder, float radius, uint32_t triangles)
{
    uint32_t nu = 38, nv = 43;
    if (triangles) {
        float quads = es_maxf((float)triangles - 180.0f, 24.0f) * 0.5f;
        nu = (uint32_t)es_sqrt(quads * 38.0f / 42.0f);
        if (nu < 4) nu = 4;
        nv = (uint32_t)(quads / (float)nu) + 1;
        if (nv < 3) nv = 3;
    }
    es_shape shape = es_build_shape(builder);
    es_shape_sphere(&shape, es_v3(0, 0, 0), radius, nu, nv);
    return es_build_mesh(builder, "ball", &shape);
}

es_result es_scene_cornell_stack(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_build_box_room(&builder);
    const float colors[4][3] = {{0.72f, 0.50f, 0.20f}, {0.75f, 0.74f, 0.70f}, {0.20f, 0.35f, 0.62f}, {0.70f, 0.28f, 0.16f}};
    es_material paints[4];
    for (int i = 0; i < 4; i++) paints[i] = es_build_lambert(&builder, "paint", colors[i][0], colors[i][1], colors[i][2]);
    for (int row = 0, n = 0; row < 4; row++)
        for (int i = 0; i < 4 - row; i++, n++)
            add_cube(&builder, es_v3(-0.2f + 0.27f * ((float)i - 0.5f * (float)(3 - row)), half + 2 * half * (float)row, -0.35f + 0.01f * (float)(row % 2)), 0.03f * (float)(n % 3 - 1), paints[(i + row) % 4]);

    es_material_desc steel = es_default_material_desc();
    steel.base_color[0] = 0.80f;
    steel.base_color[1] = 0.78f;
    steel.base_color[2] = 0.74f;
    steel.metallic = 1;
    steel.roughness = 0.35f;
    es_node ball = es_build_node(&builder, "ball", es_v3(0.72f, 1.5f, 0.55f), es_quat_identity());
    es_build_instance(&builder, ball, ball_mesh(&builder, 0.2f, triangles), es_build_material(&builder, "steel", &steel));
    es_shape_desc sphere = es_sphere_shape(0.2f);
    sphere.density = 900;
    sphere.restitution = 0.3f;
    es_body_desc thrown = es_default_body_desc();
    thrown.velocity = es_v3(-1.9f, 0.5f, -1.75f);
    es_build_body(&builder, ball, ES_BODY_DYNAMIC, &sphere, &thrown);

    es_build_box_camera(&builder);
    es_build_swaying_spot(&builder, 42, 0.24f, 4);
    return builder.result;
}
