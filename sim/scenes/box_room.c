/* The Cornell box that several scenes play in: see box_room.h. */
#include "sim/scenes/box_room.h"

#include "platform/maths.h"

/* One of the four walls about the opening, which is turned towards +z: its inner face is the quadrilateral of `edge` (two corners at the opening)
 * and the same moved back by 2 m. It is 0.1 m thick at the back and has an edge at the opening, so that its end is no bright frame round the
 * picture; walls meet in edges and mitres, so that none reaches into another, where pixels of both could be seen. The inner face is
 * two quadrilaterals: with them the wall has a box's 12 triangles. */
static void add_wall(es_scene_builder* builder, const char* name, es_vec3 a, es_vec3 b, es_vec3 outwards, es_material material, es_vec3 low, es_vec3 high)
{
    enum { STRIPS = 2 };
    const float t = 0.1f;
    const es_vec3 back = {0, 0, -2}, along = es_v3_normalize(es_v3_sub(b, a), es_v3(1, 0, 0)), inwards = es_v3_scale(outwards, -1);
    /* the back's outer corners, where the neighbours' and the back wall's are too */
    const es_vec3 away = es_v3_add(es_v3_scale(outwards, t), es_v3(0, 0, -t));
    const es_vec3 c = es_v3_add(es_v3_add(a, back), es_v3_sub(away, es_v3_scale(along, t))), d = es_v3_add(es_v3_add(b, back), es_v3_add(away, es_v3_scale(along, t)));
    const es_vec3 p = es_v3_add(a, back), q = es_v3_add(b, back);
    es_shape shape = es_build_shape(builder);
    for (int i = 0; i < STRIPS; i++) {
        const es_vec3 from = es_v3_scale(back, (float)i / STRIPS), to = es_v3_scale(back, (float)(i + 1) / STRIPS);
        es_shape_quad(&shape, es_v3_add(a, from), es_v3_add(b, from), es_v3_add(b, to), es_v3_add(a, to), inwards);
        es_shape_facet(&shape, es_v3_add(a, from), es_v3_add(a, to), c, es_v3_scale(along, -1));
        es_shape_facet(&shape, es_v3_add(b, from), es_v3_add(b, to), d, along);
    }
    const es_vec3 outer = es_v3_normalize(es_v3_cross(es_v3_sub(b, a), es_v3_sub(c, a)), outwards), mitre = es_v3_normalize(es_v3_cross(es_v3_sub(q, p), es_v3_sub(c, p)), es_v3(0, 0, -1));
    es_shape_quad(&shape, a, b, d, c, es_v3_dot(outer, outwards) > 0 ? outer : es_v3_scale(outer, -1));
    es_shape_quad(&shape, p, q, d, c, mitre.z < 0 ? mitre : es_v3_scale(mitre, -1));
    es_node node = es_build_object(builder, name, &shape, material, es_v3(0, 0, 0));
    es_shape_desc body = es_box_shape(es_v3_scale(es_v3_sub(high, low), 0.5f));
    body.position = es_v3_scale(es_v3_add(low, high), 0.5f);
    es_build_body(builder, node, ES_BODY_STATIC, &body, NULL);
}

void es_build_box_room(es_scene_builder* builder)
{
    es_material white = es_build_lambert(builder, "white", 0.73f, 0.72f, 0.69f);
    es_material red = es_build_lambert(builder, "red", 0.63f, 0.065f, 0.05f);
    es_material green = es_build_lambert(builder, "green", 0.14f, 0.45f, 0.09f);
    const float t = 0.1f;
    add_wall(builder, "floor", es_v3(-1, 0, 1), es_v3(1, 0, 1), es_v3(0, -1, 0), white, es_v3(-1 - t, -t, -1 - t), es_v3(1 + t, 0, 1));
    add_wall(builder, "ceiling", es_v3(-1, 2, 1), es_v3(1, 2, 1), es_v3(0, 1, 0), white, es_v3(-1 - t, 2, -1 - t), es_v3(1 + t, 2 + t, 1));
    es_build_static_box(builder, "back wall", es_v3(-1, 0, -1 - t), es_v3(1, 2, -1), white);
    add_wall(builder, "left wall", es_v3(-1, 0, 1), es_v3(-1, 2, 1), es_v3(-1, 0, 0), red, es_v3(-1 - t, 0, -1 - t), es_v3(-1, 2, 1));
    add_wall(builder, "right wall", es_v3(1, 0, 1), es_v3(1, 2, 1), es_v3(1, 0, 0), green, es_v3(1, 0, -1 - t), es_v3(1 + t, 2, 1));
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
