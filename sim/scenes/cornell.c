/* A Cornell box after Knecht 2009, §5.2: four objects, one of them of some 3,300 triangles, 3,372 triangles in all; objects
 * and spot light move. One object is a rough metal (GGX), one has a Phong lobe, so that glossy virtual lights and glossy
 * receivers are both in the picture.
 *
 * The box is 2 × 2 × 2 m, open towards the camera; its walls are 0.1 m thick, five closed boxes. The light stands in front
 * of the opening, above the camera, and sways. The whole motion repeats every 20 seconds. */
#include "sim/scenes/scene_tools.h"

#include "platform/maths.h"

static const float turn = 6.2831853f;
enum { PERIOD = 20, KEYS = 60, OWN_TRIANGLES = 3372, BOX_TRIANGLES = 12, BOXES = 8 };

/* The knot floats above the low block and turns about a slanting axis. Its extent is 0.46 m about the centre. */
static void knot_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(-0.38f + 0.06f * es_sin(turn * phase), 1.24f + 0.10f * es_sin(2 * turn * phase), -0.22f + 0.10f * es_cos(turn * phase));
    *rotation = es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), turn * phase), es_quat_from_axis_angle(es_v3(1, 0, 0), 1.0f + 0.5f * es_sin(turn * phase)));
}

/* The block below it rocks about the vertical; half its diagonal is 0.40 m. */
static void block_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(-0.42f, 0.311f, -0.38f);
    *rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), 0.3f + 0.5f * es_sin(turn * phase));
}

/* The glossy cube slides round a circle on the floor; half its diagonal is 0.33 m. */
static void cube_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(0.48f + 0.12f * es_cos(turn * phase), 0.231f, 0.10f + 0.22f * es_sin(turn * phase));
    *rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), -0.4f + 0.8f * es_sin(turn * phase));
}

/* The small cube tumbles above it; half its diagonal is 0.23 m. */
static void tumbler_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(0.50f - 0.10f * es_sin(turn * phase), 0.98f + 0.22f * es_sin(2 * turn * phase), -0.20f + 0.15f * es_cos(turn * phase));
    *rotation = es_quat_mul(es_quat_from_axis_angle(es_v3(0.6f, 0.8f, 0), turn * phase), es_quat_from_axis_angle(es_v3(0, 0.6f, 0.8f), 2 * turn * phase));
}

static void spot_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(0.55f * es_sin(turn * phase), 1.82f, 2.05f);
    es_vec3 target = es_v3(-0.35f * es_sin(turn * phase), 0.58f + 0.12f * es_cos(turn * phase), -0.75f);
    *rotation = es_look_rotation(es_v3_sub(target, *translation));
}

static void add_wall(es_scene_builder* builder, const char* name, es_vec3 low, es_vec3 high, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, low, high);
    es_build_object(builder, name, &shape, material, es_v3(0, 0, 0));
}

static es_node add_cube(es_scene_builder* builder, const char* name, es_vec3 half, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3_scale(half, -1), half);
    return es_build_object(builder, name, &shape, material, es_v3(0, 0, 0));
}

es_result es_scene_cornell(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_material white = es_build_lambert(&builder, "white", 0.73f, 0.72f, 0.69f);
    es_material red = es_build_lambert(&builder, "red", 0.63f, 0.065f, 0.05f);
    es_material green = es_build_lambert(&builder, "green", 0.14f, 0.45f, 0.09f);
    es_material ochre = es_build_lambert(&builder, "ochre", 0.72f, 0.50f, 0.20f);

    const float t = 0.1f;
    add_wall(&builder, "floor", es_v3(-1 - t, -t, -1 - t), es_v3(1 + t, 0, 1), white);
    add_wall(&builder, "ceiling", es_v3(-1 - t, 2, -1 - t), es_v3(1 + t, 2 + t, 1), white);
    add_wall(&builder, "back wall", es_v3(-1 - t, 0, -1 - t), es_v3(1 + t, 2, -1), white);
    add_wall(&builder, "left wall", es_v3(-1 - t, 0, -1), es_v3(-1, 2, 1), red);
    add_wall(&builder, "right wall", es_v3(1, 0, -1), es_v3(1 + t, 2, 1), green);

    es_material_desc bronze_desc = es_default_material_desc();
    bronze_desc.base_color[0] = 0.95f;
    bronze_desc.base_color[1] = 0.70f;
    bronze_desc.base_color[2] = 0.38f;
    bronze_desc.metallic = 1;
    bronze_desc.roughness = 0.3f;
    es_material bronze = es_build_material(&builder, "bronze", &bronze_desc);

    es_material_desc lacquer_desc = es_default_material_desc();
    lacquer_desc.model = ES_SURFACE_PHONG;
    lacquer_desc.base_color[0] = 0.10f;
    lacquer_desc.base_color[1] = 0.20f;
    lacquer_desc.base_color[2] = 0.50f;
    lacquer_desc.specular = 0.35f;
    lacquer_desc.exponent = 30;
    es_material lacquer = es_build_material(&builder, "lacquer", &lacquer_desc);

    /* 13 sides by 126 rings; other totals keep that proportion */
    uint32_t around = 13, along = 126;
    if (triangles) {
        float quads = es_maxf((float)triangles - (float)(BOXES * BOX_TRIANGLES), 18.0f) * 0.5f;
        around = (uint32_t)es_sqrt(quads * 13.0f / 126.0f);
        if (around < 3) around = 3;
        along = (uint32_t)(quads / (float)around);
        if (along < 9) along = 9;
    }
    es_shape knot = es_build_shape(&builder);
    es_shape_torus_knot(&knot, es_v3(0, 0, 0), 2, 3, 0.37f, 0.085f, along, around);
    es_motion motions[] = {
        {es_build_object(&builder, "knot", &knot, bronze, es_v3(0, 0, 0)), knot_pose},
        {add_cube(&builder, "block", es_v3(0.28f, 0.31f, 0.28f), white), block_pose},
        {add_cube(&builder, "cube", es_v3(0.23f, 0.23f, 0.23f), lacquer), cube_pose},
        {add_cube(&builder, "tumbler", es_v3(0.13f, 0.13f, 0.13f), ochre), tumbler_pose},
        {es_build_spot(&builder, es_v3(0, 1.82f, 2.05f), es_v3(0, -1, -3), (const float[3]){1.0f, 0.96f, 0.88f}, 42.0f, 0.36f, 0.54f), spot_pose},
    };
    es_build_camera(&builder, es_v3(0, 1.0f, 3.6f), es_v3(0, 0, -1), 0.74f, 0.1f);
    es_build_clip(&builder, "motion", PERIOD, KEYS, motions, sizeof motions / sizeof motions[0]);
    return builder.result;
}
