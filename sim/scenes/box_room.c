/* The Cornell box that several scenes play in: see box_room.h. */
#include "sim/scenes/box_room.h"

#include "platform/maths.h"

void es_build_box_room(es_scene_builder* builder)
{
    es_material white = es_build_lambert(builder, "white", 0.73f, 0.72f, 0.69f);
    es_material red = es_build_lambert(builder, "red", 0.63f, 0.065f, 0.05f);
    es_material green = es_build_lambert(builder, "green", 0.14f, 0.45f, 0.09f);
    const float t = 0.1f;
    es_build_static_box(builder, "floor", es_v3(-1 - t, -t, -1 - t), es_v3(1 + t, 0, 1), white);
    es_build_static_box(builder, "ceiling", es_v3(-1 - t, 2, -1 - t), es_v3(1 + t, 2 + t, 1), white);
    es_build_static_box(builder, "back wall", es_v3(-1 - t, 0, -1 - t), es_v3(1 + t, 2, -1), white);
    es_build_static_box(builder, "left wall", es_v3(-1 - t, 0, -1), es_v3(-1, 2, 1), red);
    es_build_static_box(builder, "right wall", es_v3(1, 0, -1), es_v3(1 + t, 2, 1), green);
    es_build_hidden_wall(builder, es_v3(-1, 0, 1), es_v3(1, 2, 1 + t));
}

void es_build_box_camera(es_scene_builder* builder) { es_build_camera(builder, es_v3(0, 1.0f, 3.6f), es_v3(0, 0, -1), 0.74f, 0.1f); }

void es_build_swaying_spot(es_scene_builder* builder, float intensity, float amplitude, float period)
{
    const es_vec3 pivot = {0, 3.4f, 2.05f}, arm = {0, -1.58f, 0};
    es_quat down = es_look_rotation(es_v3(0, -1.2f, -2.8f));
    es_node node = es_build_node(builder, "lamp", es_v3_add(pivot, arm), down);
    es_light_desc spot = es_default_light_desc();
    spot.color[1] = 0.96f;
    spot.color[2] = 0.88f;
    spot.intensity = intensity;
    spot.inner_cone = 0.36f;
    spot.outer_cone = 0.54f;
    es_build_light(builder, "lamp", node, &spot);
    es_mover_desc swing = es_default_mover_desc();
    swing.name = "sway";
    swing.type = ES_MOVER_SWING;
    swing.node = node;
    swing.centre = pivot;
    swing.arm = arm;
    swing.axis = es_v3(0, 0, 1);
    swing.rotation = down;
    swing.amplitude = amplitude;
    swing.period = period;
    es_build_mover(builder, &swing);
}
