/* A curtain in a doorway: drawn aside it lets the light of a strong lamp outside into a closed room, drawn to it shuts it out. All that
 * the room shows beside the bright patch on its floor is indirect light, which comes and goes with the cloth. */
#include "sim/scenes/cloth_tools.h"

#include "platform/maths.h"

enum { HOOKS = 10, KEYS = 5 };
static const float door_low = -0.65f, door_high = 0.65f, door_height = 2.1f, rod_height = 2.2f, room = 2.0f, ceiling = 2.8f, curtain_x = -1.86f;

static void add_room(es_scene_builder* builder)
{
    es_material white = es_build_lambert(builder, "plaster", 0.76f, 0.74f, 0.70f), boards = es_build_lambert(builder, "boards", 0.52f, 0.36f, 0.22f);
    es_material blue = es_build_lambert(builder, "blue wall", 0.20f, 0.34f, 0.56f), ochre = es_build_lambert(builder, "ochre wall", 0.74f, 0.52f, 0.24f);
    const float r = room, t = 0.14f, h = ceiling;
    es_build_static_box(builder, "floor", es_v3(-r - 1.5f, -t, -r - t), es_v3(r + t, 0, r + t), boards);
    es_build_static_box(builder, "ceiling", es_v3(-r - t, h, -r - t), es_v3(r + t, h + t, r + t), white);
    es_build_static_box(builder, "back wall", es_v3(-r - t, 0, -r - t), es_v3(r + t, h, -r), white);
    es_build_static_box(builder, "front wall", es_v3(-r - t, 0, r), es_v3(r + t, h, r + t), ochre);
    es_build_static_box(builder, "right wall", es_v3(r, 0, -r), es_v3(r + t, h, r), blue);
    es_build_static_box(builder, "beside the door", es_v3(-r - t, 0, -r), es_v3(-r, h, door_low), white);
    es_build_static_box(builder, "beside the door", es_v3(-r - t, 0, door_high), es_v3(-r, h, r), white);
    es_build_static_box(builder, "above the door", es_v3(-r - t, door_height, door_low), es_v3(-r, h, door_high), white);
    es_material iron = es_build_lambert(builder, "iron", 0.15f, 0.14f, 0.13f);
    es_shape rod = es_build_shape(builder);
    es_shape_box(&rod, es_v3(curtain_x - 0.012f, rod_height + 0.02f, -0.95f), es_v3(curtain_x + 0.012f, rod_height + 0.045f, 0.95f));
    es_build_object(builder, "rod", &rod, iron, es_v3(0, 0, 0));
}

static void add_toy(es_scene_builder* builder, const char* name, es_vec3 place, float size, bool ball, es_material paint)
{
    es_shape shape = es_build_shape(builder);
    es_shape_desc body = ball ? es_sphere_shape(size) : es_box_shape(es_v3(size, size, size));
    if (ball) es_shape_sphere(&shape, es_v3(0, 0, 0), size, 36, 18);
    else es_shape_box(&shape, es_v3(-size, -size, -size), es_v3(size, size, size));
    body.density = 250;
    body.rolling_resistance = ball ? 0.02f * size : 0;
    es_build_body(builder, es_build_object(builder, name, &shape, paint, place), ES_BODY_DYNAMIC, &body, NULL);
}

/* Closed, the hooks are spread over the doorway; open, they crowd at its far side. It opens and closes once in twelve seconds. */
static void add_hooks(es_scene_builder* builder, es_node hooks[HOOKS])
{
    static const float times[KEYS] = {0, 0.2f, 2.8f, 7.4f, 12};
    static const float opened[KEYS] = {0, 0, 1, 1, 0};
    float values[HOOKS][KEYS * 3];
    es_clip_channel channels[HOOKS];
    for (int i = 0; i < HOOKS; i++) {
        float share = (float)i / (HOOKS - 1), shut = -0.80f + 1.60f * share, open = -0.90f + 0.42f * share;
        hooks[i] = es_build_node(builder, "hook", es_v3(curtain_x, rod_height, shut), es_quat_identity());
        for (int k = 0; k < KEYS; k++) {
            values[i][3 * k] = curtain_x;
            values[i][3 * k + 1] = rod_height;
            values[i][3 * k + 2] = shut + (open - shut) * opened[k];
        }
        channels[i] = (es_clip_channel){.node = hooks[i], .path = ES_CLIP_TRANSLATION, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = KEYS, .times = times, .values = values[i]};
    }
    es_clip clip;
    if (builder->result == ES_OK) builder->result = es_world_add_clip(builder->world, &(es_clip_desc){"draw", HOOKS, channels}, &clip);
}

es_result es_scene_curtain(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    float scale = triangles ? es_sqrt((float)triangles / 7000.0f) : 1;
    uint32_t nu = (HOOKS - 1) * (uint32_t)es_maxf(1, 6 * scale), nv = (uint32_t)es_maxf(8, 56 * scale);
    add_room(&builder);
    add_toy(&builder, "ball", es_v3(-0.55f, 0.26f, -0.75f), 0.26f, true, es_build_lambert(&builder, "red", 0.68f, 0.12f, 0.08f));
    add_toy(&builder, "block", es_v3(0.35f, 0.3f, -0.95f), 0.3f, false, es_build_lambert(&builder, "birch", 0.76f, 0.66f, 0.48f));
    add_toy(&builder, "small block", es_v3(0.35f, 0.78f, -0.95f), 0.18f, false, es_build_lambert(&builder, "green", 0.20f, 0.46f, 0.22f));

    es_node hooks[HOOKS], node;
    add_hooks(&builder, hooks);
    es_material_desc velvet = es_default_material_desc();
    velvet.base_color[0] = 0.50f;
    velvet.base_color[1] = 0.10f;
    velvet.base_color[2] = 0.13f;
    velvet.specular = 0;
    /* more cloth than doorway, so that it falls in folds */
    es_mesh mesh = es_build_sheet(&builder, "curtain", es_v3(curtain_x, rod_height, -0.80f), es_v3(0, 0, 1.60f), es_v3(0, -2.14f, 0), nu, nv, &velvet, &node);
    es_soft_attachment held[HOOKS];
    for (uint32_t i = 0; i < HOOKS; i++) held[i] = (es_soft_attachment){.vertex = i * nu / (HOOKS - 1), .node = hooks[i]};
    es_soft_desc cloth = es_default_soft_desc();
    cloth.name = "curtain";
    cloth.mesh = mesh;
    cloth.node = node;
    cloth.mass = 1.2f;
    cloth.bend_compliance = 0.5f;
    cloth.thickness = 0.012f;
    cloth.self_collision = true;
    cloth.tearable = true;
    cloth.drag = 0.4f;
    cloth.attachments = held;
    cloth.attachment_count = HOOKS;
    es_soft soft;
    if (builder.result == ES_OK) builder.result = es_world_add_soft(world, &cloth, &soft);

    es_build_camera(&builder, es_v3(1.55f, 1.5f, 1.75f), es_v3(-0.86f, -0.16f, -0.80f), 1.02f, 0.05f);
    es_build_spot(&builder, es_v3(-5.2f, 3.3f, 0.5f), es_v3(4.6f, -2.9f, -0.75f), (const float[3]){1.0f, 0.95f, 0.86f}, 1500, 0.20f, 0.26f);
    return builder.result;
}
