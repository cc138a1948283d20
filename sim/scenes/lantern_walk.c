/* A lantern carried through the dark colonnade of the hall: the hand follows a path between the columns, the lantern swings from it by a
 * joint, its flame flickers, the bars of its cage and the columns throw long shadows that wander. */
#include "sim/scenes/body_tools.h"
#include "sim/scenes/hall.h"

#include "platform/maths.h"

enum { PERIOD = 32, KEYS = 64 };
static const float turn = 6.2831853f;
static const float hang = 0.42f; /* from hand to flame */

/* Along the nave and back, weaving; sixteen steps' bobbing to a loop. */
static void hand_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(1.45f * es_sin(2 * turn * phase), 1.95f + 0.03f * es_sin(16 * turn * phase), 1.5f + 7.0f * es_cos(turn * phase));
    *rotation = es_quat_identity();
}

static es_mesh cage(es_scene_builder* builder)
{
    es_shape shape = es_build_shape(builder);
    const float r = 0.10f, bar = 0.009f;
    es_shape_cylinder(&shape, es_v3(0, -0.16f, 0), r + 0.015f, 0.02f, 12);
    static const es_vec2 roof[] = {{0.13f, 0.15f}, {0.13f, 0.165f}, {0.03f, 0.25f}, {0.0f, 0.25f}};
    es_shape_lathe(&shape, es_v3(0, 0, 0), roof, 4, 12);
    static const es_vec2 lid[] = {{0.0f, 0.15f}, {0.13f, 0.15f}};
    es_shape_lathe(&shape, es_v3(0, 0, 0), lid, 2, 12);
    for (int i = 0; i < 6; i++) {
        float x = r * es_cos(turn * (float)i / 6), z = r * es_sin(turn * (float)i / 6);
        es_shape_box(&shape, es_v3(x - bar, -0.15f, z - bar), es_v3(x + bar, 0.155f, z + bar));
    }
    return es_build_mesh(builder, "cage", &shape);
}

es_result es_scene_lantern_walk(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_build_hall(&builder, triangles);

    es_vec3 start;
    es_quat none;
    hand_pose(0, &start, &none);
    es_node hand = es_build_node(&builder, "hand", start, none);
    es_shape_desc grip = es_sphere_shape(0.03f);
    grip.mask = grip.category = 0x80000000u; /* meets nothing */
    es_body carrier = es_build_body(&builder, hand, ES_BODY_KINEMATIC, &grip, NULL);

    es_material iron = es_build_lambert(&builder, "iron", 0.10f, 0.09f, 0.08f);
    es_node lantern = es_build_node(&builder, "lantern", es_v3(start.x, start.y - hang, start.z), none);
    es_build_instance(&builder, lantern, cage(&builder), iron);
    es_material_desc glow = es_default_material_desc();
    glow.base_color[0] = glow.base_color[1] = glow.base_color[2] = 0;
    glow.specular = 0;
    glow.emission[0] = 60;
    glow.emission[1] = 34;
    glow.emission[2] = 12;
    es_shape candle = es_build_shape(&builder);
    es_shape_sphere(&candle, es_v3(0, -0.10f, 0), 0.03f, 10, 7);
    es_build_instance(&builder, lantern, es_build_mesh(&builder, "candle", &candle), es_build_material(&builder, "flame", &glow));
    es_shape_desc weight = es_capsule_shape(0.1f, 0.08f);
    weight.density = 400;
    es_body_desc swinging = es_default_body_desc();
    swinging.angular_damping = 0.35f;
    es_body body = es_build_body(&builder, lantern, ES_BODY_DYNAMIC, &weight, &swinging);
    es_joint_desc chain = es_default_joint_desc();
    chain.a = carrier;
    chain.b = body;
    chain.position_b = es_v3(0, hang, 0);
    es_joint joint;
    if (builder.result == ES_OK) builder.result = es_world_add_joint(world, &chain, &joint);

    es_light_desc flame = es_default_light_desc();
    flame.type = ES_LIGHT_POINT;
    flame.color[1] = 0.66f;
    flame.color[2] = 0.33f;
    flame.intensity = 34;
    es_light light = es_build_light(&builder, "flame", es_build_child(&builder, "wick", lantern, es_v3(0, 0.0f, 0), none), &flame);
    es_build_mover(&builder, &(es_mover_desc){.name = "flicker", .type = ES_MOVER_FLICKER, .light = light, .period = 0.35f, .amplitude = 0.35f, .seed = 11});
    es_build_clip(&builder, "walk", PERIOD, KEYS, &(es_motion){hand, hand_pose}, 1);
    es_build_camera(&builder, es_v3(0.55f, 1.75f, 11.6f), es_v3(-0.09f, 0.06f, -1), 1.02f, 0.1f);
    return builder.result;
}
