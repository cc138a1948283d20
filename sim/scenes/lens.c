/* A burning glass and a crystal ball on a table before a picture: both show it turned over. */
#include "sim/scenes/body_tools.h"
#include "sim/scenes/edit_tools.h"

#include <string.h>

#include "platform/maths.h"

enum { SIZE = 256 };

/* A landscape with a sun and a road of squares: top and bottom, left and right are told apart. */
static es_material picture(es_scene_builder* builder)
{
    uint8_t* rgba = builder->result == ES_OK ? es_allocate_array(es_world_context(builder->world), SIZE * SIZE, 4) : NULL;
    if (!rgba) {
        if (builder->result == ES_OK) builder->result = es_context_last_result(es_world_context(builder->world));
        return (es_material){0};
    }
    for (uint32_t i = 0; i < SIZE * SIZE; i++) {
        const float x = ((float)(i % SIZE) + 0.5f) / SIZE, y = ((float)(i / SIZE) + 0.5f) / SIZE, dx = x - 0.72f, dy = y - 0.24f;
        float c[3] = {0.55f - 0.35f * y, 0.70f - 0.25f * y, 0.92f};
        if (dx * dx + dy * dy < 0.008f) c[0] = 0.98f, c[1] = 0.85f, c[2] = 0.30f;
        const float hill = 0.52f + 0.06f * es_sin(7 * x) + 0.03f * es_sin(17 * x + 1);
        if (y > hill) {
            const bool square = ((int)(x * 10) + (int)(y * 10)) % 2;
            c[0] = square ? 0.16f : 0.34f, c[1] = square ? 0.36f : 0.52f, c[2] = 0.14f;
        }
        if (x > 0.12f && x < 0.3f && y > 0.42f && y < 0.66f) c[0] = 0.72f, c[1] = 0.16f, c[2] = 0.12f; /* a house, */
        if (y > 0.30f && y <= 0.42f && es_absf(x - 0.21f) < (y - 0.30f) * 1.1f) c[0] = 0.30f, c[1] = 0.16f, c[2] = 0.10f; /* its roof */
        for (uint32_t k = 0; k < 3; k++) rgba[4 * i + k] = (uint8_t)(255 * es_clampf(c[k], 0, 1) + 0.5f);
        rgba[4 * i + 3] = 255;
    }
    es_texture texture = {0};
    const es_texture_desc desc = {"landscape", SIZE, SIZE, rgba, true};
    builder->result = es_world_add_texture(builder->world, &desc, &texture);
    es_release(es_world_context(builder->world), rgba, (size_t)SIZE * SIZE * 4);
    es_material_desc canvas = es_default_material_desc();
    canvas.specular = 0;
    canvas.base_color_texture = (es_texture_use){.image = es_world_texture_image(builder->world, texture), .wrap_u = ES_WRAP_CLAMP, .wrap_v = ES_WRAP_CLAMP};
    return es_build_material(builder, "landscape", &canvas);
}

static void add_picture(es_scene_builder* builder, es_vec3 middle, float width, float height)
{
    es_shape box = es_build_shape(builder);
    es_shape_box(&box, es_v3(-0.5f * width, -0.5f * height, -0.03f), es_v3(0.5f * width, 0.5f * height, 0));
    float uv[2 * 24] = {0};
    for (size_t v = 0; v < box.vertex_count && v < 24; v++) {
        uv[2 * v] = box.positions[3 * v] / width + 0.5f;
        uv[2 * v + 1] = 0.5f - box.positions[3 * v + 1] / height;
    }
    es_mesh mesh = {0};
    const es_mesh_desc desc = {.name = "canvas", .vertex_count = (uint32_t)box.vertex_count, .triangle_count = (uint32_t)box.triangle_count, .positions = box.positions, .normals = box.normals, .uv0 = uv, .indices = box.indices};
    if (builder->result == ES_OK) builder->result = es_world_add_mesh(builder->world, &desc, &mesh);
    es_shape_free(&box);
    es_build_instance(builder, es_build_node(builder, "picture", middle, es_quat_identity()), mesh, picture(builder));
}

/* Two caps of spheres, the axis along y; both from one circle of that radius, `thick` in the middle. */
static void add_lens(es_shape* shape, float radius, float thick, uint32_t n)
{
    const float half = 0.5f * thick, curve = 0.5f * (radius * radius + half * half) / half;
    enum { RINGS = 24 };
    for (int side = 0; side < 2; side++) {
        const uint32_t first = (uint32_t)shape->vertex_count;
        for (uint32_t i = 0; i <= RINGS; i++) {
            const float r = radius * (float)i / RINGS, y = i == RINGS ? 0.0f : es_sqrt(curve * curve - r * r) - (curve - half), sign = side ? -1.0f : 1.0f;
            for (uint32_t k = 0; k <= n; k++) {
                float sine, cosine;
                es_sincos(2.0f * ES_PI * (float)(k % n) / (float)n, &sine, &cosine);
                es_shape_vertex(shape, es_v3(r * cosine, sign * y, r * sine), es_v3(r / curve * cosine, sign * (y + curve - half) / curve, r / curve * sine));
            }
        }
        for (uint32_t i = 0; i < RINGS; i++)
            for (uint32_t k = 0; k < n; k++) {
                const uint32_t a = first + i * (n + 1) + k, b = a + n + 1;
                if (i) es_shape_triangle(shape, a, b, a + 1);
                es_shape_triangle(shape, a + 1, b, b + 1);
            }
    }
}

es_result es_scene_lens(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 12000.0f), 0.1f, 8.0f) : 1.0f;
    const uint32_t n = (uint32_t)es_maxf(64 * scale, 8);
    es_shape floor = es_build_shape(&builder), walls = es_build_shape(&builder), table = es_build_shape(&builder), ball = es_build_shape(&builder), lens = es_build_shape(&builder), stand = es_build_shape(&builder);
    es_shape_plane(&floor, es_v3(-2, 0, -1.5f), es_v3(4, 0, 0), es_v3(0, 0, 4), es_v3(0, 1, 0), 4, 4);
    es_shape_plane(&walls, es_v3(-2, 0, -1.5f), es_v3(4, 0, 0), es_v3(0, 2.6f, 0), es_v3(0, 0, 1), 4, 4);
    es_shape_plane(&walls, es_v3(-2, 0, 2.5f), es_v3(4, 0, 0), es_v3(0, 2.6f, 0), es_v3(0, 0, -1), 4, 4);
    es_shape_plane(&walls, es_v3(-2, 0, -1.5f), es_v3(0, 0, 4), es_v3(0, 2.6f, 0), es_v3(1, 0, 0), 4, 4);
    es_shape_plane(&walls, es_v3(2, 0, -1.5f), es_v3(0, 0, 4), es_v3(0, 2.6f, 0), es_v3(-1, 0, 0), 4, 4);
    es_shape_plane(&walls, es_v3(-2, 2.6f, -1.5f), es_v3(4, 0, 0), es_v3(0, 0, 4), es_v3(0, -1, 0), 4, 4);
    es_build_object(&builder, "floor slabs", &floor, es_build_lambert(&builder, "oak", 0.42f, 0.30f, 0.20f), es_v3(0, 0, 0));
    es_build_object(&builder, "wall slabs", &walls, es_build_lambert(&builder, "plaster", 0.66f, 0.62f, 0.56f), es_v3(0, 0, 0));
    es_shape_box(&table, es_v3(-1.1f, 0.70f, -0.45f), es_v3(1.1f, 0.75f, 0.55f));
    es_shape_box(&table, es_v3(-1.0f, 0, -0.35f), es_v3(-0.92f, 0.70f, 0.45f));
    es_shape_box(&table, es_v3(0.92f, 0, -0.35f), es_v3(1.0f, 0.70f, 0.45f));
    es_build_object(&builder, "table", &table, es_build_lambert(&builder, "walnut", 0.34f, 0.20f, 0.11f), es_v3(0, 0, 0));
    add_picture(&builder, es_v3(0, 1.25f, -1.44f), 2.1f, 1.3f);
    es_material_desc glass = es_default_material_desc();
    glass.roughness = 0;
    glass.transmission = 1;
    glass.ior = 1.5f;
    memcpy(glass.base_color, (const float[3]){0.97f, 0.985f, 0.98f}, 3 * sizeof(float));
    const es_material crystal = es_build_material(&builder, "crystal", &glass), brass = es_build_lambert(&builder, "brass", 0.50f, 0.38f, 0.16f);
    es_shape_sphere(&ball, es_v3(0, 0, 0), 0.21f, 2 * n, n);
    const es_vec3 ball_at = {-0.36f, 1.0f, 0.05f}, eye = {0.1f, 1.25f, 1.75f};
    const es_node ball_node = es_build_node(&builder, "crystal ball", ball_at, es_quat_identity());
    const es_instance crystal_ball = es_build_instance(&builder, ball_node, es_build_mesh(&builder, "crystal ball", &ball), crystal);
    es_shape_torus(&stand, es_v3(-0.36f, 0.775f, 0.05f), 0.11f, 0.025f, 0, n, n / 4 + 3);
    /* the burning glass turns about its foot */
    es_shape_cylinder(&stand, es_v3(0.42f, 0.75f, 0.05f), 0.1f, 0.02f, n);
    es_shape_cylinder(&stand, es_v3(0.42f, 0.76f, 0.05f), 0.012f, 0.05f, n / 4 + 3);
    es_build_object(&builder, "stands", &stand, brass, es_v3(0, 0, 0));
    es_node foot = es_build_node(&builder, "burning glass", es_v3(0.42f, 1.04f, 0.05f), es_quat_identity());
    es_build_mover(&builder, &(es_mover_desc){.name = "turn", .type = ES_MOVER_SWING, .node = foot, .centre = es_v3(0.42f, 1.04f, 0.05f), .period = 9, .amplitude = 0.5f});
    es_node upright = es_build_child(&builder, "burning glass", foot, es_v3(0, 0, 0), es_quat_from_axis_angle(es_v3(1, 0, 0), 0.5f * ES_PI));
    add_lens(&lens, 0.23f, 0.11f, n);
    es_build_instance(&builder, upright, es_build_mesh(&builder, "burning glass", &lens), crystal);
    es_shape rim = es_build_shape(&builder);
    es_shape_torus(&rim, es_v3(0, 0, 0), 0.238f, 0.012f, 0, n, 12);
    es_build_instance(&builder, upright, es_build_mesh(&builder, "rim", &rim), brass);
    es_build_spot(&builder, es_v3(1.2f, 2.5f, 1.4f), es_v3(-0.9f, -1.2f, -2.2f), (const float[3]){1.0f, 0.94f, 0.84f}, 26, 0.5f, 0.9f);
    es_build_camera(&builder, eye, es_v3(-0.03f, -0.09f, -1), 0.75f, 0.05f);
    /* §7.6.1: the ball shows the sun of the picture in its middle */
    const es_vec3 front = es_v3_add(ball_at, es_v3_scale(es_v3_normalize(es_v3_sub(eye, ball_at), es_v3(0, 0, 1)), 0.21f)), sun = {0.46f, 1.68f, -1.44f};
    es_build_region(&builder, "crystal ball", ES_REGION_GEODESIC, crystal_ball, front, 0.30f, 0.10f);
    es_build_refraction(&builder, "the sun", crystal_ball, front, es_v3_sub(sun, ball_at), eye);
    return builder.result;
}
