/* Cloth falls into a glossy ring: after Ritschel's thesis, figure 5.13, whose ring has a Phong lobe of exponent 50. The light that the
 * inside of the ring throws draws the curve of a coffee cup's on floor and cloth. Fingers that are not seen hold the cloth in its middle: they
 * let it down, lift it out of the ring, and let it down again, once in eight seconds. */
#include "sim/scenes/cloth_tools.h"

#include "platform/maths.h"

static const float radius = 0.62f, thickness = 0.035f, height = 0.42f;

/* The ring stops cloth and bodies by 24 boxes in a circle. */
static void add_ring_body(es_scene_builder* builder, es_node node)
{
    enum { BOXES = 24 };
    es_shape_desc boxes[BOXES];
    for (int i = 0; i < BOXES; i++) {
        float angle = 6.2831853f * ((float)i + 0.5f) / BOXES;
        boxes[i] = es_box_shape(es_v3(0.5f * thickness, 0.5f * height, (radius + thickness) * 3.1415927f / BOXES));
        boxes[i].position = es_v3((radius + 0.5f * thickness) * es_cos(angle), 0.5f * height, -(radius + 0.5f * thickness) * es_sin(angle));
        boxes[i].rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), angle);
    }
    es_body_desc desc = es_default_body_desc();
    desc.name = "ring";
    desc.type = ES_BODY_STATIC;
    desc.node = node;
    desc.shapes = boxes;
    desc.shape_count = BOXES;
    es_body body;
    if (builder->result == ES_OK) builder->result = es_world_add_body(builder->world, &desc, &body);
}

enum { PERIOD = 8, KEYS = 64 };
static const float held_x = -0.24f, held_z = -0.06f, held_y = 1.25f, low_y = 0.02f;

static float smooth(float from, float to, float t)
{
    const float s = es_clampf((t - from) / (to - from), 0, 1);
    return s * s * (3 - 2 * s);
}

/* Down in a second and a half, slower than the cloth falls by itself; rest; up in two seconds, and aside in the air to where it began. */
static void fingers_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    const float t = phase * PERIOD, aside = 0.12f * smooth(3.5f, 5.5f, t) * (1 - smooth(6, 7.6f, t));
    const float up = 1 - smooth(0, 1.5f, t) + smooth(3.5f, 5.5f, t);
    *translation = es_v3(held_x + aside, low_y + (held_y - low_y) * up, held_z + aside);
    *rotation = es_quat_identity();
}

es_result es_scene_ring(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    float scale = triangles ? es_sqrt((float)triangles / 6900.0f) : 1;
    uint32_t around = (uint32_t)es_maxf(16, 128 * scale), weave = 2 * (uint32_t)es_maxf(4, 24 * scale);
    es_material table = es_build_lambert(&builder, "table", 0.66f, 0.62f, 0.56f), wall = es_build_lambert(&builder, "wall", 0.60f, 0.58f, 0.55f);
    es_build_static_box(&builder, "table", es_v3(-2.2f, -0.1f, -2.2f), es_v3(2.2f, 0, 2.2f), table);
    es_build_static_box(&builder, "wall", es_v3(-2.2f, 0, -2.3f), es_v3(2.2f, 2.4f, -2.2f), wall);

    es_material_desc metal = es_default_material_desc();
    metal.model = ES_SURFACE_PHONG;
    metal.base_color[0] = 0.16f;
    metal.base_color[1] = 0.12f;
    metal.base_color[2] = 0.07f;
    metal.specular = 0.72f;
    metal.exponent = 50;
    const es_vec2 profile[] = {{radius, 0}, {radius + thickness, 0}, {radius + thickness, height}, {radius, height}, {radius, 0}};
    es_shape shape = es_build_shape(&builder);
    es_shape_lathe(&shape, es_v3(0, 0, 0), profile, 5, around);
    es_node ring = es_build_object(&builder, "ring", &shape, es_build_material(&builder, "polished bronze", &metal), es_v3(0, 0, 0));
    add_ring_body(&builder, ring);

    es_material_desc silk = es_default_material_desc();
    silk.base_color[0] = 0.62f;
    silk.base_color[1] = 0.11f;
    silk.base_color[2] = 0.10f;
    silk.specular = 0;
    es_node node;
    es_mesh mesh = es_build_sheet(&builder, "silk", es_v3(held_x - 0.5f, held_y - 0.1f, held_z + 0.5f), es_v3(1.0f, 0.2f, 0), es_v3(0, 0, -1.0f), weave, weave, &silk, &node);
    es_vec3 start;
    es_quat level;
    fingers_pose(0, &start, &level);
    es_node fingers = es_build_node(&builder, "fingers", start, level);
    const es_soft_attachment held = {.vertex = weave / 2 * (weave + 1) + weave / 2, .node = fingers};
    es_build_clip(&builder, "fall and lift", PERIOD, KEYS, &(es_motion){fingers, fingers_pose}, 1);
    es_soft_desc cloth = es_default_soft_desc();
    cloth.name = "silk";
    cloth.mesh = mesh;
    cloth.node = node;
    cloth.mass = 0.35f;
    cloth.bend_compliance = 2;
    cloth.self_collision = true;
    cloth.thickness = 0.012f;
    cloth.attachments = &held;
    cloth.attachment_count = 1;
    es_soft soft;
    if (builder.result == ES_OK) builder.result = es_world_add_soft(world, &cloth, &soft);

    es_build_camera(&builder, es_v3(0.25f, 1.75f, 2.35f), es_v3(-0.10f, -0.62f, -1), 0.72f, 0.05f);
    es_node lamp = es_build_spot(&builder, es_v3(2.3f, 2.3f, 0.9f), es_v3(-2.3f, -2.1f, -0.9f), (const float[3]){1.0f, 0.93f, 0.82f}, 60, 0.30f, 0.42f);
    es_mover_desc sway = es_default_mover_desc();
    sway.type = ES_MOVER_SWING;
    sway.node = lamp;
    sway.centre = es_v3(0, 2.3f, 0);
    sway.arm = es_v3(2.3f, 0, 0.9f);
    sway.keep_rotation = true;
    sway.period = 9;
    sway.amplitude = 0.35f;
    es_build_mover(&builder, &sway);
    es_build_mover(&builder, &(es_mover_desc){.type = ES_MOVER_AIM, .node = lamp, .centre = es_v3(0, 0.2f, 0)});
    return builder.result;
}
