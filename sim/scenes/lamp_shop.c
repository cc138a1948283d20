/* A shop full of lamps: balls, discs and panels on shelves and from the ceiling, tubes, and a bent strip whose colours are a picture; no light has no size. An animal of
 * some 85 thousand triangles walks round among them: after Ritschel's thesis, figure 5.16. */
#include "sim/scenes/creature.h"

#include <string.h>

#include "platform/maths.h"

static const float half = 4.2f, height = 3.4f, ring = 1.55f, walk_period = 1.3f;

static void add_room(es_scene_builder* builder)
{
    es_shape floor = es_build_shape(builder), walls = es_build_shape(builder), ceiling = es_build_shape(builder), shelves = es_build_shape(builder);
    es_shape_plane(&floor, es_v3(-half, 0, -half), es_v3(2 * half, 0, 0), es_v3(0, 0, 2 * half), es_v3(0, 1, 0), 8, 8);
    es_shape_plane(&ceiling, es_v3(-half, height, -half), es_v3(2 * half, 0, 0), es_v3(0, 0, 2 * half), es_v3(0, -1, 0), 8, 8);
    es_shape_plane(&walls, es_v3(-half, 0, -half), es_v3(2 * half, 0, 0), es_v3(0, height, 0), es_v3(0, 0, 1), 8, 4);
    es_shape_plane(&walls, es_v3(-half, 0, half), es_v3(2 * half, 0, 0), es_v3(0, height, 0), es_v3(0, 0, -1), 8, 4);
    es_shape_plane(&walls, es_v3(-half, 0, -half), es_v3(0, 0, 2 * half), es_v3(0, height, 0), es_v3(1, 0, 0), 8, 4);
    es_shape_plane(&walls, es_v3(half, 0, -half), es_v3(0, 0, 2 * half), es_v3(0, height, 0), es_v3(-1, 0, 0), 8, 4);
    for (int i = 0; i < 3; i++) {
        const float y = 0.7f + 0.75f * (float)i;
        es_shape_box(&shelves, es_v3(-half + 0.01f, y, -half + 0.01f), es_v3(half - 1.2f, y + 0.04f, -half + 0.45f));
        es_shape_box(&shelves, es_v3(half - 0.45f, y, -2.9f), es_v3(half - 0.01f, y + 0.04f, 2.2f));
    }
    es_build_object(builder, "floor slabs", &floor, es_build_gloss(builder, "parquet", 0.38f, 0.24f, 0.14f, 0, 0.35f), es_v3(0, 0, 0));
    es_build_object(builder, "ceiling slabs", &ceiling, es_build_lambert(builder, "white", 0.76f, 0.75f, 0.72f), es_v3(0, 0, 0));
    es_build_object(builder, "wall slabs", &walls, es_build_lambert(builder, "sage", 0.52f, 0.56f, 0.48f), es_v3(0, 0, 0));
    es_build_object(builder, "shelves", &shelves, es_build_lambert(builder, "oak", 0.46f, 0.31f, 0.18f), es_v3(0, 0, 0));
}

static void add_lamp(es_scene_builder* builder, const es_area_light_desc* desc, es_vec3 at, es_vec3 towards)
{
    es_area_light light;
    es_area_light_desc d = *desc;
    d.node = es_build_node(builder, d.name, at, es_look_rotation(towards));
    if (builder->result == ES_OK) builder->result = es_world_add_area_light(builder->world, &d, &light);
}

/* Along a shelf from `from` to `to`, feet and shades by turns. */
static void fill_shelf(es_scene_builder* builder, es_vec3 from, es_vec3 to, es_vec3 out, int count, int first, es_shape* stands, uint32_t n)
{
    static const float colors[6][3] = {{1, 0.72f, 0.40f}, {1, 0.86f, 0.66f}, {0.55f, 0.75f, 1}, {1, 0.45f, 0.28f}, {0.60f, 1, 0.62f}, {0.95f, 0.55f, 0.95f}};
    for (int i = 0; i < count; i++) {
        const float share = ((float)i + 0.5f) / (float)count;
        const es_vec3 foot = es_v3_add(from, es_v3_scale(es_v3_sub(to, from), share));
        const int kind = (i + first) % 3;
        es_area_light_desc lamp = es_default_area_light_desc();
        memcpy(lamp.color, colors[(2 * i + first) % 6], sizeof lamp.color);
        lamp.radiance = 0;
        static const es_vec2 stand[] = {{0, 0}, {0.085f, 0}, {0.085f, 0.02f}, {0.018f, 0.035f}, {0.018f, 0.16f}, {0, 0.16f}};
        es_shape_lathe(stands, foot, stand, sizeof stand / sizeof *stand, n);
        if (kind == 0) {
            lamp.name = "globe";
            lamp.shape = ES_AREA_SPHERE;
            lamp.size[0] = lamp.size[1] = 0.20f;
            lamp.flux = 2.6f;
            add_lamp(builder, &lamp, es_v3_add(foot, es_v3(0, 0.26f, 0)), out);
        } else {
            lamp.name = kind == 1 ? "flat lamp, round" : "flat lamp, square";
            lamp.shape = kind == 1 ? ES_AREA_DISC : ES_AREA_RECTANGLE;
            lamp.size[0] = kind == 1 ? 0.30f : 0.36f;
            lamp.size[1] = kind == 1 ? 0.30f : 0.24f;
            lamp.flux = 2.0f;
            lamp.two_sided = true;
            add_lamp(builder, &lamp, es_v3_add(foot, es_v3(0, 0.31f, 0)), es_v3_add(out, es_v3(0.3f * es_sin(3.0f * (float)i), -0.15f, 0.3f * es_cos(3.0f * (float)i))));
        }
    }
}

static void add_tube(es_scene_builder* builder, es_vec3 middle, float length, float turn, const float color[3], uint32_t n)
{
    es_material_desc glow = es_default_material_desc();
    glow.specular = 0;
    for (int c = 0; c < 3; c++) {
        glow.base_color[c] = 0;
        glow.emission[c] = 9.0f * color[c];
    }
    es_shape shape = es_build_shape(builder);
    es_shape_cylinder(&shape, es_v3(0, -0.5f * length, 0), 0.022f, length, n);
    es_mesh mesh = es_build_mesh(builder, "tube", &shape);
    es_node node = es_build_node(builder, "tube", middle, es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), turn), es_quat_from_axis_angle(es_v3(0, 0, 1), 0.5f * ES_PI)));
    es_build_instance(builder, node, mesh, es_build_material(builder, "glowing gas", &glow));
}

/* The strip bends round the left back corner; its light is a picture of warm and cold bands. */
static void add_strip(es_scene_builder* builder, uint32_t along)
{
    enum { WIDTH = 128, HEIGHT = 8, MOST = 128, ROWS = 3 };
    if (builder->result != ES_OK) return;
    uint8_t rgba[WIDTH * HEIGHT * 4];
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        const float x = ((float)(i % WIDTH) + 0.5f) / WIDTH, band = 0.75f + 0.25f * es_sin(40.0f * x);
        const float rgb[3] = {band * (1.0f - 0.85f * x), band * (0.42f + 0.30f * es_sin(3.1415927f * x)), band * (0.08f + 0.92f * x)};
        for (int c = 0; c < 3; c++) rgba[4 * i + (uint32_t)c] = (uint8_t)(255.0f * es_clampf(rgb[c], 0, 1) + 0.5f);
        rgba[4 * i + 3] = 255;
    }
    es_texture texture;
    builder->result = es_world_add_texture(builder->world, &(es_texture_desc){"bands", WIDTH, HEIGHT, rgba, false}, &texture);
    if (builder->result != ES_OK) return;
    if (along > MOST) along = MOST;
    float positions[(MOST + 1) * (ROWS + 1) * 3], normals[(MOST + 1) * (ROWS + 1) * 3], uvs[(MOST + 1) * (ROWS + 1) * 2];
    uint32_t indices[MOST * ROWS * 6];
    uint32_t vertex = 0, index = 0;
    for (uint32_t i = 0; i <= along; i++)
        for (uint32_t j = 0; j <= ROWS; j++, vertex++) {
            const float u = (float)i / (float)along, v = (float)j / ROWS;
            float s, c;
            es_sincos(0.15f + 2.5f * u, &s, &c);
            const es_vec3 out = es_v3(-s, 0, -c); /* from the middle of the bend */
            const es_vec3 at = es_v3(3.1f * out.x - 0.5f, 1.45f + 0.55f * es_sin(6.0f * u) + 0.42f * (v - 0.5f), 3.1f * out.z - 0.2f);
            memcpy(positions + 3 * vertex, &at, sizeof at);
            memcpy(normals + 3 * vertex, &(es_vec3){-out.x, 0, -out.z}, sizeof at);
            uvs[2 * vertex] = u;
            uvs[2 * vertex + 1] = v;
        }
    for (uint32_t i = 0; i < along; i++)
        for (uint32_t j = 0; j < ROWS; j++) {
            const uint32_t a = i * (ROWS + 1) + j, b = a + ROWS + 1;
            const uint32_t corners[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(indices + index, corners, sizeof corners);
            index += 6;
        }
    es_mesh mesh;
    builder->result = es_world_add_mesh(builder->world,
        &(es_mesh_desc){.name = "strip", .vertex_count = vertex, .triangle_count = index / 3, .positions = positions, .normals = normals, .uv0 = uvs, .indices = indices}, &mesh);
    es_material_desc glow = es_default_material_desc();
    glow.specular = 0;
    glow.double_sided = true;
    for (int k = 0; k < 3; k++) {
        glow.base_color[k] = 0;
        glow.emission[k] = 2.6f;
    }
    if (builder->result == ES_OK) glow.emission_texture.image = es_world_texture_image(builder->world, texture);
    es_build_instance(builder, es_build_node(builder, "strip", es_v3(0, 0, 0), es_quat_identity()), mesh, es_build_material(builder, "bands", &glow));
}

es_result es_scene_lamp_shop(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 105000.0f), 0.1f, 6.0f) : 1.0f;
    const uint32_t n = (uint32_t)es_maxf(24 * scale, 6);
    add_room(&builder);
    es_shape stands = es_build_shape(&builder);
    for (int i = 0; i < 3; i++) {
        const float y = 0.74f + 0.75f * (float)i;
        fill_shelf(&builder, es_v3(-half + 0.3f, y, -half + 0.23f), es_v3(half - 1.3f, y, -half + 0.23f), es_v3(0, 0, 1), 7, i, &stands, n);
        fill_shelf(&builder, es_v3(half - 0.23f, y, -2.8f), es_v3(half - 0.23f, y, 2.1f), es_v3(-1, 0, 0), 5, i + 1, &stands, n);
    }
    es_build_object(&builder, "stands", &stands, es_build_gloss(&builder, "brass", 0.90f, 0.76f, 0.42f, 1, 0.3f), es_v3(0, 0, 0));
    /* from the ceiling: a panel that is most of the room's white light, balls, tubes */
    es_area_light_desc lamp = es_default_area_light_desc();
    lamp.name = "flat lamp of the ceiling";
    lamp.size[0] = 1.3f;
    lamp.size[1] = 0.5f;
    lamp.radiance = 7;
    add_lamp(&builder, &lamp, es_v3(0.4f, height - 0.02f, 0.6f), es_v3(0, -1, 0.001f));
    lamp = es_default_area_light_desc();
    lamp.shape = ES_AREA_SPHERE;
    lamp.name = "moon";
    lamp.size[0] = lamp.size[1] = 0.5f;
    lamp.radiance = 4;
    memcpy(lamp.color, (const float[3]){1, 0.9f, 0.74f}, sizeof lamp.color);
    add_lamp(&builder, &lamp, es_v3(-1.9f, 2.5f, -1.8f), es_v3(0, 0, 1));
    add_tube(&builder, es_v3(1.7f, 2.75f, -2.3f), 1.3f, 0.4f, (const float[3]){0.35f, 0.75f, 1}, n);
    add_tube(&builder, es_v3(1.9f, 2.55f, -2.5f), 1.3f, 0.7f, (const float[3]){1, 0.25f, 0.55f}, n);
    add_tube(&builder, es_v3(-3.9f, 2.9f, 1.2f), 1.6f, 0.5f * ES_PI, (const float[3]){1, 0.8f, 0.5f}, n);
    add_strip(&builder, (uint32_t)es_clampf(96 * scale, 12, 128));

    es_material_desc hide = es_default_material_desc();
    hide.model = ES_SURFACE_PHONG;
    memcpy(hide.base_color, (const float[3]){0.46f, 0.43f, 0.41f}, 3 * sizeof(float));
    hide.specular = 0.25f;
    hide.exponent = 20;
    es_node root = es_build_node(&builder, "creature", es_v3(ring, 0, 0), es_quat_identity());
    es_build_creature(&builder, root, es_build_material(&builder, "hide", &hide), 2.66f * scale, walk_period);
    es_mover_desc walk = es_default_mover_desc();
    walk.name = "walk";
    walk.node = root;
    walk.arm = es_v3(ring, 0, 0);
    walk.period = 6.2831853f * ring / es_creature_speed(walk_period);
    walk.phase = 0.1f;
    es_build_mover(&builder, &walk);
    es_build_camera(&builder, es_v3(1.3f, 1.75f, 3.9f), es_v3(-0.36f, -0.10f, -1), 66.0f * (ES_PI / 180.0f), 0.05f);
    return builder.result;
}
