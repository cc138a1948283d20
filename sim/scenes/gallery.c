/* A museum's hall: glossy and diffuse things side by side, most of them lit by what the others send on. In the middle a dragon of half a million triangles
 * turns on its plinth with the column it is wound about; balls of falling exponent (left) and things of metal (right) stand about it, a polished ring
 * lies in a beam and throws the curve of a coffee cup's, rings of a mobile turn in each other, a silk flag waves, and a panel glows. */
#include "sim/scenes/body_tools.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/scenes/cloth_tools.h"
#include "sim/scenes/dragon.h"

static const float two_pi = 6.2831853f;
static const float low_x = -5, high_x = 5, low_z = -6.25f, high_z = 7.5f, ceiling_y = 5.2f;
static const es_vec3 dragon_at = {0, 0, -1.3f};

enum { OTHER_TRIANGLES = 55008, TURN = 48, FLAG_PERIOD = 4, PAINTING = 96, PICTURES = 6 };

typedef struct detail { float scale; } detail;

static uint32_t steps(const detail* d, float count, uint32_t least)
{
    const uint32_t n = (uint32_t)(count * d->scale + 0.5f);
    return n < least ? least : n;
}

/* ---- materials ----------------------------------------------------------------------------------------------------------- */

static es_material phong(es_scene_builder* builder, const char* name, float r, float g, float b, float specular, float exponent)
{
    es_material_desc desc = es_default_material_desc();
    desc.model = ES_SURFACE_PHONG;
    memcpy(desc.base_color, (const float[3]){r, g, b}, 3 * sizeof(float));
    desc.specular = specular;
    desc.exponent = exponent;
    return es_build_material(builder, name, &desc);
}

/* ---- the hall ------------------------------------------------------------------------------------------------------------ */

/* Walls, floor and ceiling are seen from inside alone. */
static void add_shell(es_scene_builder* builder)
{
    const es_material pale = es_build_gloss(builder, "travertine", 0.56f, 0.50f, 0.42f, 0, 0.2f), dark = es_build_gloss(builder, "slate", 0.16f, 0.16f, 0.17f, 0, 0.2f);
    es_build_slabs(builder, es_v3(low_x, 0, low_z), es_v3(high_x, 0, high_z), 8, 11, pale, dark);

    const es_vec3 size = {high_x - low_x, ceiling_y, high_z - low_z};
    es_shape ceiling = es_build_shape(builder), ends = es_build_shape(builder), left = es_build_shape(builder), right = es_build_shape(builder);
    es_shape_plane(&ceiling, es_v3(low_x, ceiling_y, low_z), es_v3(size.x, 0, 0), es_v3(0, 0, size.z), es_v3(0, -1, 0), 4, 4);
    es_shape_plane(&ends, es_v3(low_x, 0, low_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, 1), 4, 2);
    es_shape_plane(&ends, es_v3(low_x, 0, high_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, -1), 4, 2);
    es_shape_plane(&left, es_v3(low_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, size.y, 0), es_v3(1, 0, 0), 4, 2);
    es_shape_plane(&right, es_v3(high_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, size.y, 0), es_v3(-1, 0, 0), 4, 2);
    es_build_object(builder, "ceiling slabs", &ceiling, es_build_lambert(builder, "ceiling", 0.80f, 0.78f, 0.74f), es_v3(0, 0, 0));
    es_build_object(builder, "end slabs", &ends, es_build_lambert(builder, "plaster", 0.74f, 0.70f, 0.63f), es_v3(0, 0, 0));
    es_build_object(builder, "left slabs", &left, es_build_lambert(builder, "madder", 0.55f, 0.12f, 0.09f), es_v3(0, 0, 0));
    es_build_object(builder, "right slabs", &right, es_build_lambert(builder, "verdigris", 0.14f, 0.38f, 0.36f), es_v3(0, 0, 0));
}

static void add_pedestal(es_scene_builder* builder, float x, float z, float height, es_material stone)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3(x - 0.30f, 0, z - 0.30f), es_v3(x + 0.30f, 0.12f, z + 0.30f));
    es_shape_box(&shape, es_v3(x - 0.24f, 0.11f, z - 0.24f), es_v3(x + 0.24f, height - 0.06f, z + 0.24f));
    es_shape_box(&shape, es_v3(x - 0.28f, height - 0.07f, z - 0.28f), es_v3(x + 0.28f, height, z + 0.28f));
    es_build_object(builder, "pedestal", &shape, stone, es_v3(0, 0, 0));
}

/* ---- pictures ------------------------------------------------------------------------------------------------------------ */

static uint8_t sample(float x) { return (uint8_t)(255 * es_clampf(x, 0, 1) + 0.5f); }

/* Of three kinds: a sun over water, squares, waves; x to the right and y down, 0 … 1. */
static void paint(uint32_t kind, float variant, float x, float y, float rgb[3])
{
    if (kind == 0) {
        const float dx = x - 0.35f - 0.3f * variant, dy = y - 0.40f, sun = es_clampf(1.6f - 22 * (dx * dx + dy * dy) * 4, 0, 1), glow = es_clampf(1 - 2 * es_absf(dy), 0, 1);
        const float ripple = y > 0.58f ? 0.5f + 0.5f * es_sin(90 * y * y + 3 * es_sin(14 * x + 5 * variant)) : 0;
        rgb[0] = 0.25f + 0.55f * glow + 0.6f * sun - (y > 0.58f ? 0.25f - 0.3f * ripple * es_clampf(1 - 3 * es_absf(dx), 0, 1) : 0);
        rgb[1] = 0.22f + 0.25f * glow + 0.5f * sun - (y > 0.58f ? 0.10f - 0.15f * ripple : 0);
        rgb[2] = 0.40f - 0.10f * glow + 0.2f * sun + 0.10f * ripple;
    } else if (kind == 1) {
        const float column = es_floor(5 * x), row = es_floor(6 * y), t = column * 1.7f + row * 2.9f + 3 * variant;
        for (int c = 0; c < 3; c++) rgb[c] = 0.5f + 0.38f * es_sin(t + 2.1f * (float)c);
    } else {
        const float t = es_sin(9 * x + 4 * es_sin(5 * y + 2 * variant)) * 0.5f + 0.5f;
        rgb[0] = 0.12f + 0.75f * t * t;
        rgb[1] = 0.22f + 0.40f * t;
        rgb[2] = 0.55f - 0.25f * t;
    }
}

static es_material painting(es_scene_builder* builder, uint32_t kind, float variant)
{
    uint8_t rgba[PAINTING * PAINTING * 4];
    for (uint32_t i = 0; i < PAINTING * PAINTING; i++) {
        float rgb[3];
        paint(kind, variant, ((float)(i % PAINTING) + 0.5f) / PAINTING, ((float)(i / PAINTING) + 0.5f) / PAINTING, rgb);
        for (int c = 0; c < 3; c++) rgba[4 * i + (uint32_t)c] = sample(rgb[c]);
        rgba[4 * i + 3] = 255;
    }
    es_texture texture = {0};
    const es_texture_desc desc = {"painting", PAINTING, PAINTING, rgba, true};
    if (builder->result == ES_OK) builder->result = es_world_add_texture(builder->world, &desc, &texture);
    es_material_desc canvas = es_default_material_desc();
    canvas.specular = 0;
    canvas.base_color_texture = (es_texture_use){.image = es_world_texture_image(builder->world, texture), .wrap_u = ES_WRAP_CLAMP, .wrap_v = ES_WRAP_CLAMP};
    return es_build_material(builder, "painting", &canvas);
}

/* A box whose front, towards +z, shows the whole painting. */
static void add_canvas(es_scene_builder* builder, es_node node, float width, float height, es_material material)
{
    es_shape box = es_build_shape(builder);
    es_shape_box(&box, es_v3(-0.5f * width, -0.5f * height, 0.01f), es_v3(0.5f * width, 0.5f * height, 0.05f));
    float uv[2 * 24] = {0};
    for (size_t v = 0; v < box.vertex_count && v < 24; v++) {
        uv[2 * v] = box.positions[3 * v] / width + 0.5f;
        uv[2 * v + 1] = 0.5f - box.positions[3 * v + 1] / height;
    }
    es_mesh mesh = {0};
    const es_mesh_desc desc = {.name = "canvas", .vertex_count = (uint32_t)box.vertex_count, .triangle_count = (uint32_t)box.triangle_count, .positions = box.positions, .normals = box.normals, .uv0 = uv, .indices = box.indices};
    if (builder->result == ES_OK) builder->result = es_world_add_mesh(builder->world, &desc, &mesh);
    es_shape_free(&box);
    es_build_instance(builder, node, mesh, material);
}

static void add_frame(es_scene_builder* builder, es_node node, float width, float height, es_material gilt)
{
    const float x = 0.5f * width, y = 0.5f * height, w = 0.09f, depth = 0.09f;
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3(-x - w, -y - w, 0), es_v3(x + w, -y, depth));
    es_shape_box(&shape, es_v3(-x - w, y, 0), es_v3(x + w, y + w, depth));
    es_shape_box(&shape, es_v3(-x - w, -y, 0), es_v3(-x, y, depth));
    es_shape_box(&shape, es_v3(x, -y, 0), es_v3(x + w, y, depth));
    es_build_instance(builder, node, es_build_mesh(builder, "frame", &shape), gilt);
}

static void add_pictures(es_scene_builder* builder, es_material gilt)
{
    static const struct { float z, width, height; uint32_t kind; } pictures[PICTURES] = {
        {2.6f, 1.3f, 1.0f, 0}, {-0.4f, 1.0f, 1.3f, 1}, {-3.4f, 1.5f, 1.1f, 2}, {2.6f, 1.1f, 1.4f, 1}, {-0.4f, 1.5f, 1.1f, 0}, {-3.4f, 1.2f, 1.2f, 2}};
    for (uint32_t i = 0; i < PICTURES; i++) {
        const bool is_left = i < PICTURES / 2;
        const es_quat facing = es_quat_from_axis_angle(es_v3(0, 1, 0), is_left ? 0.5f * ES_PI : -0.5f * ES_PI);
        es_node node = es_build_node(builder, "picture", es_v3(is_left ? low_x : high_x, 2.1f, pictures[i].z), facing);
        add_canvas(builder, node, pictures[i].width, pictures[i].height, painting(builder, pictures[i].kind, (float)i * 0.37f));
        add_frame(builder, node, pictures[i].width, pictures[i].height, gilt);
    }
    /* on the far wall: a large one, and beside it a panel that glows */
    es_node far_picture = es_build_node(builder, "picture", es_v3(-2.1f, 2.4f, low_z), es_quat_identity());
    add_canvas(builder, far_picture, 2.4f, 1.7f, painting(builder, 0, 0.9f));
    add_frame(builder, far_picture, 2.4f, 1.7f, gilt);
    es_material_desc glow = es_default_material_desc();
    glow.specular = 0;
    for (int c = 0; c < 3; c++) {
        glow.base_color[c] = 0.05f;
        glow.emission[c] = (const float[3]){1.2f, 3.4f, 5.0f}[c];
    }
    es_node panel = es_build_node(builder, "panel", es_v3(2.6f, 2.4f, low_z), es_quat_identity());
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, es_v3(-0.75f, -0.85f, 0.01f), es_v3(0.75f, 0.85f, 0.05f));
    es_build_instance(builder, panel, es_build_mesh(builder, "panel", &shape), es_build_material(builder, "glow", &glow));
    add_frame(builder, panel, 1.5f, 1.7f, gilt);
}

/* ---- what is shown --------------------------------------------------------------------------------------------------------- */

static void add_balls(es_scene_builder* builder, const detail* d, es_material stone)
{
    static const float exponents[3] = {50, 20, 5}, paints[3][3] = {{0.10f, 0.16f, 0.42f}, {0.42f, 0.11f, 0.08f}, {0.40f, 0.30f, 0.07f}};
    for (int i = 0; i < 3; i++) {
        const float x = -2.75f, z = 1.9f - 2.3f * (float)i, height = 0.95f;
        add_pedestal(builder, x, z, height, stone);
        es_shape ball = es_build_shape(builder);
        es_shape_sphere(&ball, es_v3(0, 0, 0), 0.34f, steps(d, 64, 12), steps(d, 40, 8));
        es_build_object(builder, "ball", &ball, phong(builder, "enamel", paints[i][0], paints[i][1], paints[i][2], 0.5f, exponents[i]), es_v3(x, height + 0.34f, z));
    }
}

static void add_metals(es_scene_builder* builder, const detail* d, es_material stone)
{
    static const float metals[3][4] = {{0.95f, 0.64f, 0.54f, 0.3f}, {1.0f, 0.78f, 0.34f, 0.2f}, {0.72f, 0.71f, 0.70f, 0.1f}};
    static const es_vec2 vase[] = {{0, 0}, {0.16f, 0}, {0.16f, 0.03f}, {0.08f, 0.08f}, {0.07f, 0.13f}, {0.14f, 0.20f}, {0.24f, 0.30f}, {0.30f, 0.42f}, {0.31f, 0.52f}, {0.27f, 0.64f}, {0.18f, 0.73f}, {0.12f, 0.80f},
        {0.12f, 0.86f}, {0.18f, 0.92f}, {0.16f, 0.92f}, {0.09f, 0.84f}, {0, 0.80f}};
    for (int i = 0; i < 3; i++) {
        const float x = 2.75f, z = 1.9f - 2.3f * (float)i, height = 0.95f;
        add_pedestal(builder, x, z, height, stone);
        es_shape shape = es_build_shape(builder);
        if (i == 0) es_shape_torus_knot(&shape, es_v3(0, 0.34f, 0), 2, 3, 0.30f, 0.085f, steps(d, 220, 24), steps(d, 22, 6));
        if (i == 1) es_shape_lathe(&shape, es_v3(0, 0, 0), vase, sizeof vase / sizeof vase[0], steps(d, 72, 10));
        if (i == 2) es_shape_sphere(&shape, es_v3(0, 0.34f, 0), 0.34f, steps(d, 64, 12), steps(d, 40, 8));
        es_build_object(builder, "metal", &shape, es_build_gloss(builder, "metal", metals[i][0], metals[i][1], metals[i][2], 1, metals[i][3]), es_v3(x, height, z));
    }
}

static void add_floor_ring(es_scene_builder* builder, const detail* d)
{
    const float radius = 0.55f, thickness = 0.03f, height = 0.22f;
    const es_vec2 profile[] = {{radius, 0}, {radius + thickness, 0}, {radius + thickness, height}, {radius, height}, {radius, 0}};
    es_shape disc = es_build_shape(builder), ring = es_build_shape(builder);
    const es_vec3 place = {1.05f, 0, 2.75f};
    es_shape_cylinder(&disc, es_v3(0, 0, 0), 0.85f, 0.03f, steps(d, 96, 16));
    es_build_object(builder, "disc", &disc, es_build_lambert(builder, "linen", 0.72f, 0.70f, 0.66f), place);
    es_shape_lathe(&ring, es_v3(0, 0.03f, 0), profile, 5, steps(d, 160, 20));
    es_build_object(builder, "ring", &ring, phong(builder, "polished bronze", 0.16f, 0.12f, 0.07f, 0.72f, 50), place);
}

/* Rings within rings, each turning about an axis of the one around it. */
static void add_mobile(es_scene_builder* builder, const detail* d)
{
    static const float radii[4] = {0.62f, 0.47f, 0.33f, 0.20f}, periods[4] = {17, 11, 7, 5}, roughness[4] = {0.3f, 0.2f, 0.1f, 0.1f};
    static const es_vec3 axes[4] = {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}, {1, 0, 0}};
    es_node parent = es_build_node(builder, "mobile", es_v3(-2.1f, 3.45f, 0.9f), es_quat_identity());
    for (int i = 0; i < 4; i++) {
        parent = es_build_child(builder, "ring of the mobile", parent, es_v3(0, 0, 0), es_quat_identity());
        es_shape ring = es_build_shape(builder);
        es_shape_torus(&ring, es_v3(0, 0, 0), radii[i], 0.035f, 0.5f * ES_PI, steps(d, 96, 12), steps(d, 20, 5));
        es_build_instance(builder, parent, es_build_mesh(builder, "ring of the mobile", &ring), es_build_gloss(builder, "steel", 0.86f - 0.1f * (float)i, 0.80f, 0.66f + 0.07f * (float)i, 1, roughness[i]));
        es_build_mover(builder, &(es_mover_desc){.name = "turn", .node = parent, .axis = axes[i], .period = periods[i]});
    }
    es_shape wire = es_build_shape(builder);
    es_shape_cylinder(&wire, es_v3(-2.1f, 4.08f, 0.9f), 0.006f, ceiling_y - 4.08f, 6);
    es_build_object(builder, "wire", &wire, es_build_lambert(builder, "wire", 0.2f, 0.2f, 0.2f), es_v3(0, 0, 0));
}

/* A wave runs down the flag: two displacements, a quarter of a wave apart, by weights that go round. */
static void add_flag(es_scene_builder* builder, const detail* d)
{
    enum { KEYS = 16, MOST = 96 };
    const uint32_t nu = steps(d, 24, 6) < MOST ? steps(d, 24, 6) : MOST, nv = steps(d, 48, 8) < MOST ? steps(d, 48, 8) : MOST;
    es_shape sheet = es_build_shape(builder);
    es_shape_plane(&sheet, es_v3(-0.6f, -2.2f, 0), es_v3(1.2f, 0, 0), es_v3(0, 2.2f, 0), es_v3(0, 0, 1), nu, nv);
    es_context* context = es_world_context(builder->world);
    const size_t floats = 3 * (size_t)(nu + 1) * (nv + 1);
    float* moved = builder->result == ES_OK ? es_allocate_array(context, 4 * floats, sizeof *moved) : NULL;
    if (builder->result == ES_OK && !moved) builder->result = es_context_last_result(context);
    es_mesh mesh = {0};
    if (moved) {
        memset(moved, 0, 4 * floats * sizeof *moved);
        for (size_t v = 0; v < sheet.vertex_count; v++) {
            const float x = sheet.positions[3 * v], fall = -sheet.positions[3 * v + 1], size = 0.10f * fall, place = 4.5f * fall + 1.5f * x;
            moved[3 * v + 2] = size * es_cos(place);
            moved[floats + 3 * v + 2] = size * es_sin(place);
            /* of the normal (-dz/dx, -dz/dy, 1), with y = -fall */
            moved[2 * floats + 3 * v] = 1.5f * size * es_sin(place);
            moved[2 * floats + 3 * v + 1] = 0.10f * es_cos(place) - 4.5f * size * es_sin(place);
            moved[3 * floats + 3 * v] = -1.5f * size * es_cos(place);
            moved[3 * floats + 3 * v + 1] = 0.10f * es_sin(place) + 4.5f * size * es_cos(place);
        }
        const es_morph_target targets[2] = {{moved, moved + 2 * floats, NULL}, {moved + floats, moved + 3 * floats, NULL}};
        const float weights[2] = {1, 0};
        const es_mesh_desc desc = {.name = "silk", .vertex_count = (uint32_t)sheet.vertex_count, .triangle_count = (uint32_t)sheet.triangle_count, .positions = sheet.positions, .normals = sheet.normals, .indices = sheet.indices,
            .target_count = 2, .targets = targets, .weights = weights};
        if (builder->result == ES_OK) builder->result = es_world_add_mesh(builder->world, &desc, &mesh);
    }
    es_release(context, moved, 4 * floats * sizeof *moved);
    es_shape_free(&sheet);
    es_material_desc silk = es_default_material_desc();
    memcpy(silk.base_color, (const float[3]){0.72f, 0.50f, 0.10f}, 3 * sizeof(float));
    silk.specular = 0;
    silk.double_sided = true;
    es_node node = es_build_node(builder, "flag", es_v3(-3.7f, 4.6f, -4.3f), es_quat_from_axis_angle(es_v3(0, 1, 0), 0.5f));
    es_build_instance(builder, node, mesh, es_build_material(builder, "silk", &silk));
    float times[KEYS + 1], weights[2 * (KEYS + 1)];
    for (int k = 0; k <= KEYS; k++) {
        const float angle = two_pi * (float)(k % KEYS) / KEYS;
        times[k] = (float)FLAG_PERIOD * (float)k / KEYS;
        weights[2 * k] = es_cos(angle);
        weights[2 * k + 1] = es_sin(angle);
    }
    const es_clip_channel channel = {.path = ES_CLIP_WEIGHTS, .interpolation = ES_INTERPOLATE_LINEAR, .key_count = KEYS + 1, .times = times, .values = weights, .mesh = mesh};
    es_clip clip;
    if (builder->result == ES_OK) builder->result = es_world_add_clip(builder->world, &(es_clip_desc){"wave", 1, &channel}, &clip);
}

static void add_dragon(es_scene_builder* builder, const detail* d, float scale, es_material stone)
{
    static const es_vec2 plinth[] = {{0, 0}, {1.60f, 0}, {1.60f, 0.14f}, {1.48f, 0.20f}, {1.44f, 0.20f}, {1.44f, 0.46f}, {1.50f, 0.50f}, {1.50f, 0.58f}, {0, 0.58f}};
    static const es_vec2 column[] = {{0, -0.02f}, {0.50f, -0.02f}, {0.50f, 0.06f}, {0.40f, 0.13f}, {0.36f, 0.16f}, {0.36f, 2.36f}, {0.40f, 2.40f}, {0.46f, 2.44f}, {0.46f, 2.50f}, {0, 2.50f}};
    const uint32_t around = steps(d, 96, 16);
    es_shape base = es_build_shape(builder), shaft = es_build_shape(builder);
    es_shape_lathe(&base, es_v3(0, 0, 0), plinth, sizeof plinth / sizeof plinth[0], around);
    es_build_object(builder, "plinth", &base, stone, dragon_at);
    es_node node = es_build_node(builder, "dragon", es_v3(dragon_at.x, 0.58f, dragon_at.z), es_quat_identity());
    es_shape_lathe(&shaft, es_v3(0, 0, 0), column, sizeof column / sizeof column[0], around);
    es_build_instance(builder, node, es_build_mesh(builder, "column", &shaft), es_build_gloss(builder, "porphyry", 0.30f, 0.10f, 0.09f, 0, 0.3f));
    const es_dragon_materials materials = {es_build_gloss(builder, "jade", 0.06f, 0.27f, 0.15f, 0, 0.2f), es_build_gloss(builder, "ivory", 0.80f, 0.72f, 0.56f, 0, 0.4f), es_build_gloss(builder, "amber", 0.90f, 0.45f, 0.06f, 0, 0.1f)};
    es_build_dragon(builder, node, &materials, scale);
    es_build_mover(builder, &(es_mover_desc){.name = "turn", .node = node, .centre = es_v3(dragon_at.x, 0.58f, dragon_at.z), .period = TURN, .phase = -0.02f});
}

/* ---- light ----------------------------------------------------------------------------------------------------------------- */

static void add_spot(es_scene_builder* builder, const char* name, es_vec3 place, es_vec3 target, const float color[3], float intensity, float cone, float period)
{
    es_node node = es_build_node(builder, name, place, es_look_rotation(es_v3_sub(target, place)));
    es_light_desc spot = es_default_light_desc();
    memcpy(spot.color, color, sizeof spot.color);
    spot.intensity = intensity;
    spot.inner_cone = 0.75f * cone;
    spot.outer_cone = cone;
    es_build_light(builder, name, node, &spot);
    es_build_mover(builder, &(es_mover_desc){.name = "sway", .type = ES_MOVER_SWING, .node = node, .centre = es_v3(target.x, place.y, target.z), .arm = es_v3(place.x - target.x, 0, place.z - target.z), .keep_rotation = true, .period = period, .amplitude = 0.22f});
    es_build_mover(builder, &(es_mover_desc){.name = "aim", .type = ES_MOVER_AIM, .node = node, .centre = target});
}

static void add_lights(es_scene_builder* builder)
{
    add_spot(builder, "beam", es_v3(2.6f, 4.9f, 3.6f), es_v3(0, 1.9f, -1.2f), (const float[3]){1.0f, 0.92f, 0.80f}, 260, 0.46f, 23);
    add_spot(builder, "ring's beam", es_v3(3.6f, 2.3f, 2.0f), es_v3(1.05f, 0.1f, 2.75f), (const float[3]){1.0f, 0.90f, 0.74f}, 130, 0.26f, 13);
    es_node lantern = es_build_node(builder, "lantern", es_v3(0, 4.3f, 2), es_quat_identity());
    es_light_desc point = es_default_light_desc();
    point.type = ES_LIGHT_POINT;
    memcpy(point.color, (const float[3]){1.0f, 0.80f, 0.58f}, sizeof point.color);
    point.intensity = 18;
    es_build_light(builder, "lantern", lantern, &point);
    es_build_mover(builder, &(es_mover_desc){.name = "carried", .node = lantern, .centre = es_v3(0, 4.3f, -0.6f), .arm = es_v3(2.3f, 0, 0), .period = 29, .phase = 0.6f});
}

es_result es_scene_gallery(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_sqrt((float)triangles / (float)(ES_DRAGON_TRIANGLES + OTHER_TRIANGLES)) : 1;
    const detail d = {scale < 1 ? es_sqrt(scale) : scale}; /* the simple things keep their shape longer */
    es_material stone = es_build_gloss(&builder, "marble", 0.66f, 0.65f, 0.62f, 0, 0.35f), gilt = es_build_gloss(&builder, "gilt", 1.0f, 0.76f, 0.36f, 1, 0.3f);
    add_shell(&builder);
    add_pictures(&builder, gilt);
    add_balls(&builder, &d, stone);
    add_metals(&builder, &d, stone);
    add_floor_ring(&builder, &d);
    add_mobile(&builder, &d);
    add_flag(&builder, &d);
    add_dragon(&builder, &d, scale, stone);
    add_lights(&builder);
    es_build_camera(&builder, es_v3(0.85f, 2.0f, 7.1f), es_v3(-0.115f, -0.05f, -1), 0.86f, 0.1f);
    return builder.result;
}
