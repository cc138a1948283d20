/* Contact: stairs, a folded cloth, books, blocks and toys on a floor before a wall, close to each other and to what they stand on; a spot light from the side and a
 * dim sky. What lies within centimetres of something else is what the picture is about. */
#include "sim/scenes/scene_tools.h"

#include <string.h>

#include "platform/maths.h"

static uint32_t steps(float scale, float count, uint32_t least)
{
    const uint32_t n = (uint32_t)(count * scale + 0.5f);
    return n < least ? least : n;
}

static void add_room(es_scene_builder* builder)
{
    es_shape floor = es_build_shape(builder), wall = es_build_shape(builder);
    es_shape_plane(&floor, es_v3(-3, 0, -1.6f), es_v3(6, 0, 0), es_v3(0, 0, 4.6f), es_v3(0, 1, 0), 12, 9);
    es_shape_plane(&wall, es_v3(-3, 0, -1.6f), es_v3(6, 0, 0), es_v3(0, 2.8f, 0), es_v3(0, 0, 1), 12, 6);
    es_shape_plane(&wall, es_v3(-3, 0, -1.6f), es_v3(0, 0, 4.6f), es_v3(0, 2.8f, 0), es_v3(1, 0, 0), 9, 6);
    es_build_object(builder, "floor slabs", &floor, es_build_lambert(builder, "boards", 0.55f, 0.43f, 0.30f), es_v3(0, 0, 0));
    es_build_object(builder, "wall slabs", &wall, es_build_lambert(builder, "distemper", 0.70f, 0.70f, 0.66f), es_v3(0, 0, 0));
}

/* Five stairs up to the left wall. */
static void add_stairs(es_scene_builder* builder)
{
    es_shape shape = es_build_shape(builder);
    for (int i = 0; i < 5; i++) es_shape_box(&shape, es_v3(-2.98f, 0, -1.58f), es_v3(-1.0f - 0.30f * (float)i, 0.17f * (float)(i + 1), -0.55f));
    es_build_object(builder, "stairs", &shape, es_build_lambert(builder, "limewash", 0.74f, 0.72f, 0.68f), es_v3(0, 0, 0));
}

/* A cloth that hangs from the wall in folds and runs out over the floor. */
static void cloth_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const float *x = parameters, step = 1e-3f;
    es_vec3 p[3];
    for (int i = 0; i < 3; i++) {
        const float a = i == 1 ? u + step : u, b = i == 2 ? v + step : v;
        /* down the wall, round the corner, along the floor; folds are deeper towards the bottom and lie flat at the end */
        const float length = 2.5f * b, hang = 1.5f, round = 0.25f;
        float y, z, up, out;
        if (length < hang) y = hang + round - length, z = 0, up = 0, out = 1;
        else if (length < hang + 0.5f * ES_PI * round) {
            float s, c;
            es_sincos((length - hang) / round, &s, &c);
            y = round - round * s;
            z = round - round * c;
            up = s;
            out = c;
        } else y = 0, z = round + length - hang - 0.5f * ES_PI * round, up = 1, out = 0;
        const float depth = 0.075f * es_clampf(b * 2.2f, 0.15f, 1.0f) * es_clampf((1.0f - b) * 5.0f, 0.12f, 1.0f);
        const float fold = depth * (1.05f + es_sin(2.0f * ES_PI * (6.5f * a + 0.25f * es_sin(4.0f * b))));
        p[i] = es_v3(x[0] + x[1] * (a - 0.5f) * (1.0f + 0.25f * b), y + fold * up + 0.004f, -1.595f + z + fold * out);
    }
    *position = p[0];
    *normal = es_v3_normalize(es_v3_cross(es_v3_sub(p[2], p[0]), es_v3_sub(p[1], p[0])), es_v3(0, 0, 1));
    if (normal->z + normal->y < 0.0f) *normal = es_v3_scale(*normal, -1.0f);
}

static void add_cloth(es_scene_builder* builder, float scale)
{
    const float place[2] = {0.15f, 1.15f};
    es_material_desc desc = es_default_material_desc();
    memcpy(desc.base_color, (const float[3]){0.50f, 0.12f, 0.13f}, 3 * sizeof(float));
    desc.specular = 0;
    desc.double_sided = true;
    es_shape shape = es_build_shape(builder);
    es_shape_patch(&shape, cloth_surface, place, steps(scale, 160, 24), steps(scale, 120, 18), false, false);
    es_build_object(builder, "curtain", &shape, es_build_material(builder, "cloth", &desc), es_v3(0, 0, 0));
}

static void add_box(es_scene_builder* builder, const char* name, es_vec3 half, es_vec3 at, float turn, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3(-half.x, 0, -half.z), es_v3(half.x, 2 * half.y, half.z));
    es_mesh mesh = es_build_mesh(builder, name, &shape);
    es_build_instance(builder, es_build_node(builder, name, at, es_quat_from_axis_angle(es_v3(0, 1, 0), turn)), mesh, material);
}

static void add_toys(es_scene_builder* builder, float scale)
{
    es_material red = es_build_lambert(builder, "red", 0.68f, 0.10f, 0.07f), yellow = es_build_lambert(builder, "yellow", 0.75f, 0.56f, 0.10f), blue = es_build_lambert(builder, "blue", 0.10f, 0.22f, 0.55f),
                green = es_build_lambert(builder, "green", 0.14f, 0.42f, 0.16f), wood = es_build_lambert(builder, "beech", 0.66f, 0.50f, 0.33f), paper = es_build_lambert(builder, "paper", 0.78f, 0.76f, 0.70f);
    /* blocks, some on others */
    add_box(builder, "block", es_v3(0.10f, 0.10f, 0.10f), es_v3(1.10f, 0, -0.25f), 0.3f, red);
    add_box(builder, "block", es_v3(0.10f, 0.10f, 0.10f), es_v3(1.31f, 0, -0.36f), -0.1f, yellow);
    add_box(builder, "block", es_v3(0.10f, 0.10f, 0.10f), es_v3(1.19f, 0.2f, -0.30f), 0.8f, blue);
    add_box(builder, "block", es_v3(0.10f, 0.05f, 0.22f), es_v3(0.80f, 0, 0.05f), 1.1f, green);
    add_box(builder, "block", es_v3(0.10f, 0.10f, 0.10f), es_v3(-0.55f, 0, 0.42f), 0.5f, wood);
    /* books */
    for (int i = 0; i < 5; i++)
        add_box(builder, "book", es_v3(0.24f - 0.015f * (float)i, 0.022f + 0.004f * (float)(i % 3), 0.17f), es_v3(1.95f, 0.052f * (float)i, -0.9f), 0.2f * es_sin(2.1f * (float)i), i % 2 ? paper : i % 3 ? blue : red);
    es_shape ball = es_build_shape(builder), metal = es_build_shape(builder), ring = es_build_shape(builder), top = es_build_shape(builder), cup = es_build_shape(builder), beads = es_build_shape(builder);
    es_shape_sphere(&ball, es_v3(0.42f, 0.17f, 0.33f), 0.17f, steps(scale, 72, 10), steps(scale, 36, 5));
    es_shape_sphere(&metal, es_v3(1.58f, 0.13f, 0.10f), 0.13f, steps(scale, 72, 10), steps(scale, 36, 5));
    /* rings on a pole */
    static const float radii[] = {0.20f, 0.17f, 0.14f, 0.11f};
    float y = 0;
    for (int i = 0; i < 4; i++) {
        es_shape_torus(&ring, es_v3(-0.15f, y + 0.055f, 0.85f), radii[i], 0.055f, 0, steps(scale, 56, 8), steps(scale, 20, 5));
        y += 0.098f;
    }
    es_shape_cylinder(&ring, es_v3(-0.15f, 0, 0.85f), 0.045f, 0.56f, steps(scale, 24, 6));
    static const es_vec2 spinning[] = {{0, 0}, {0.012f, 0.01f}, {0.03f, 0.07f}, {0.15f, 0.13f}, {0.16f, 0.16f}, {0.05f, 0.20f}, {0.018f, 0.22f}, {0.018f, 0.33f}, {0, 0.33f}};
    es_shape_lathe(&top, es_v3(0.95f, 0, 0.62f), spinning, sizeof spinning / sizeof *spinning, steps(scale, 48, 8));
    static const es_vec2 beaker[] = {{0, 0}, {0.075f, 0}, {0.10f, 0.19f}, {0.092f, 0.19f}, {0.070f, 0.012f}, {0, 0.012f}};
    es_shape_lathe(&cup, es_v3(-1.45f, 0.51f, -1.05f), beaker, sizeof beaker / sizeof *beaker, steps(scale, 40, 8));
    for (int i = 0; i < 26; i++) {
        float s, c;
        es_sincos(0.28f * (float)i, &s, &c);
        es_shape_sphere(&beads, es_v3(-0.75f + (0.19f + 0.004f * (float)i) * c, 0.026f, 0.95f + (0.16f + 0.003f * (float)i) * s), 0.026f, steps(scale, 20, 6), steps(scale, 10, 3));
    }
    es_build_object(builder, "ball", &ball, es_build_lambert(builder, "rubber", 0.75f, 0.30f, 0.08f), es_v3(0, 0, 0));
    es_build_object(builder, "steel ball", &metal, es_build_gloss(builder, "steel", 0.75f, 0.75f, 0.76f, 1, 0.25f), es_v3(0, 0, 0));
    es_build_object(builder, "rings", &ring, es_build_gloss(builder, "lacquer", 0.60f, 0.14f, 0.30f, 0, 0.3f), es_v3(0, 0, 0));
    es_build_object(builder, "top", &top, es_build_gloss(builder, "tin", 0.20f, 0.48f, 0.55f, 0, 0.25f), es_v3(0, 0, 0));
    es_build_object(builder, "cup", &cup, es_build_lambert(builder, "china", 0.78f, 0.78f, 0.76f), es_v3(0, 0, 0));
    es_build_object(builder, "beads", &beads, es_build_lambert(builder, "glass beads", 0.12f, 0.40f, 0.48f), es_v3(0, 0, 0));
    /* a board that leans on the wall, a hoop that leans on the stairs */
    es_shape board = es_build_shape(builder), hoop = es_build_shape(builder);
    es_shape_box(&board, es_v3(-0.25f, 0, -0.012f), es_v3(0.25f, 1.25f, 0.012f));
    es_shape_torus(&hoop, es_v3(0, 0, 0), 0.34f, 0.018f, 0.5f * ES_PI, steps(scale, 80, 10), steps(scale, 12, 4));
    es_mesh mesh = es_build_mesh(builder, "board", &board);
    es_build_instance(builder, es_build_node(builder, "board", es_v3(2.35f, 0.004f, -1.28f), es_quat_from_axis_angle(es_v3(1, 0, 0), -0.23f)), mesh, wood);
    mesh = es_build_mesh(builder, "hoop", &hoop);
    es_build_instance(builder, es_build_node(builder, "hoop", es_v3(-1.55f, 0.345f, -0.44f), es_quat_from_axis_angle(es_v3(1, 0, 0), -0.24f)), mesh, yellow);
}

static void push(float phase, es_vec3* translation, es_quat* rotation)
{
    const float x = 0.10f * es_sin(2.0f * ES_PI * phase);
    *translation = es_v3(-0.42f + x, 0.085f, 1.45f);
    *rotation = es_quat_from_axis_angle(es_v3(0, 0, 1), -x / 0.085f);
}

es_result es_scene_crease(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 68000.0f), 0.1f, 8.0f) : 1.0f;
    add_room(&builder);
    add_stairs(&builder);
    add_cloth(&builder, scale);
    add_toys(&builder, scale);
    /* a marble that rolls to and fro */
    es_vec3 place;
    es_quat turn;
    push(0, &place, &turn);
    es_shape marble = es_build_shape(&builder);
    es_shape_sphere(&marble, es_v3(0, 0, 0), 0.085f, steps(scale, 48, 8), steps(scale, 24, 4));
    es_mesh mesh = es_build_mesh(&builder, "marble", &marble);
    es_node node = es_build_node(&builder, "marble", place, turn);
    es_build_instance(&builder, node, mesh, es_build_lambert(&builder, "agate", 0.20f, 0.45f, 0.30f));
    const es_motion motion = {node, push};
    es_build_clip(&builder, "push", 5, 16, &motion, 1);
    es_build_camera(&builder, es_v3(0.75f, 1.35f, 3.05f), es_v3(-0.16f, -0.36f, -1), 50.0f * (ES_PI / 180.0f), 0.03f);
    es_build_spot(&builder, es_v3(2.5f, 2.6f, 1.6f), es_v3(-0.80f, -0.80f, -0.62f), (const float[3]){1, 0.93f, 0.82f}, 34.0f, 0.30f, 0.62f);
    const es_environment_desc sky = {.radiance = {0.08f, 0.105f, 0.14f}};
    if (builder.result == ES_OK) builder.result = es_world_set_environment(world, &sky);
    return builder.result;
}
