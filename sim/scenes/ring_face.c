/* A head beside a ring of brushed metal that stands on edge before it and turns: what the ring shows of the face is small and at its rim, after figure 7.8 of Ritschel's thesis. */
#include "sim/scenes/body_tools.h"
#include "sim/scenes/edit_tools.h"

#include <string.h>

#include "platform/maths.h"

typedef struct ellipsoid { es_vec3 centre, radii; } ellipsoid;

static void ellipsoid_at(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const ellipsoid* e = parameters;
    float su, cu, sv, cv;
    es_sincos(2.0f * ES_PI * u, &su, &cu);
    es_sincos(ES_PI * v, &sv, &cv);
    if (v == 0.0f || v == 1.0f) sv = 0.0f;
    const es_vec3 d = es_v3(sv * cu, cv, -sv * su);
    *position = es_v3(e->centre.x + e->radii.x * d.x, e->centre.y + e->radii.y * d.y, e->centre.z + e->radii.z * d.z);
    *normal = es_v3_normalize(es_v3(d.x / e->radii.x, d.y / e->radii.y, d.z / e->radii.z), d);
}

static void add_ellipsoid(es_shape* shape, es_vec3 centre, es_vec3 radii, uint32_t n)
{
    const ellipsoid e = {centre, radii};
    es_shape_patch(shape, ellipsoid_at, &e, 2 * n, n, true, false);
}

/* It looks along +z; the chin is 0.15 m below the origin. */
static void add_head(es_scene_builder* builder, es_node node, uint32_t n)
{
    es_shape skin = es_build_shape(builder), white = es_build_shape(builder), iris = es_build_shape(builder), lips = es_build_shape(builder), hair = es_build_shape(builder);
    add_ellipsoid(&skin, es_v3(0, 0.02f, 0), es_v3(0.095f, 0.135f, 0.11f), n);
    add_ellipsoid(&skin, es_v3(0, -0.07f, 0.025f), es_v3(0.068f, 0.078f, 0.075f), n);
    add_ellipsoid(&skin, es_v3(0, -0.015f, 0.112f), es_v3(0.015f, 0.032f, 0.024f), n / 2 + 4);
    add_ellipsoid(&skin, es_v3(0, -0.20f, -0.01f), es_v3(0.052f, 0.12f, 0.055f), n / 2 + 4);
    add_ellipsoid(&hair, es_v3(0, 0.06f, -0.022f), es_v3(0.105f, 0.122f, 0.108f), n);
    for (int side = -1; side <= 1; side += 2) {
        const float s = (float)side;
        add_ellipsoid(&skin, es_v3(0.096f * s, 0.0f, -0.005f), es_v3(0.014f, 0.034f, 0.022f), n / 2 + 4);
        add_ellipsoid(&white, es_v3(0.037f * s, 0.028f, 0.090f), es_v3(0.019f, 0.013f, 0.014f), n / 2 + 4);
        add_ellipsoid(&iris, es_v3(0.037f * s, 0.028f, 0.100f), es_v3(0.008f, 0.009f, 0.0065f), n / 2 + 4);
        add_ellipsoid(&hair, es_v3(0.037f * s, 0.053f, 0.096f), es_v3(0.022f, 0.005f, 0.008f), n / 2 + 4);
    }
    add_ellipsoid(&lips, es_v3(0, -0.073f, 0.096f), es_v3(0.028f, 0.010f, 0.010f), n / 2 + 4);
    const struct { es_shape* shape; const char* name; float color[3]; } parts[] = {{&skin, "skin", {0.74f, 0.50f, 0.38f}}, {&white, "white of the eyes", {0.88f, 0.87f, 0.84f}}, {&iris, "irises", {0.08f, 0.16f, 0.30f}}, {&lips, "lips", {0.58f, 0.16f, 0.14f}}, {&hair, "hair", {0.16f, 0.08f, 0.04f}}};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
        es_build_instance(builder, node, es_build_mesh(builder, parts[i].name, parts[i].shape), es_build_lambert(builder, parts[i].name, parts[i].color[0], parts[i].color[1], parts[i].color[2]));
}

es_result es_scene_ring_face(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 40000.0f), 0.1f, 8.0f) : 1.0f;
    const uint32_t n = (uint32_t)es_maxf(32 * scale, 6);
    es_shape floor = es_build_shape(&builder), walls = es_build_shape(&builder), side = es_build_shape(&builder), block = es_build_shape(&builder);
    es_shape_plane(&floor, es_v3(-1.5f, 0, -1.2f), es_v3(3, 0, 0), es_v3(0, 0, 3), es_v3(0, 1, 0), 4, 4);
    es_shape_plane(&walls, es_v3(-1.5f, 0, -1.2f), es_v3(3, 0, 0), es_v3(0, 2, 0), es_v3(0, 0, 1), 4, 4);
    es_shape_plane(&walls, es_v3(-1.5f, 0, 1.8f), es_v3(3, 0, 0), es_v3(0, 2, 0), es_v3(0, 0, -1), 4, 4);
    es_shape_plane(&walls, es_v3(-1.5f, 2, -1.2f), es_v3(3, 0, 0), es_v3(0, 0, 3), es_v3(0, -1, 0), 4, 4);
    es_shape_plane(&side, es_v3(-1.5f, 0, -1.2f), es_v3(0, 0, 3), es_v3(0, 2, 0), es_v3(1, 0, 0), 4, 4);
    es_shape_plane(&side, es_v3(1.5f, 0, -1.2f), es_v3(0, 0, 3), es_v3(0, 2, 0), es_v3(-1, 0, 0), 4, 4);
    es_build_object(&builder, "floor slabs", &floor, es_build_lambert(&builder, "slate", 0.26f, 0.27f, 0.30f), es_v3(0, 0, 0));
    es_build_object(&builder, "wall slabs", &walls, es_build_lambert(&builder, "stone", 0.52f, 0.48f, 0.42f), es_v3(0, 0, 0));
    es_build_object(&builder, "side slabs", &side, es_build_lambert(&builder, "terracotta", 0.50f, 0.26f, 0.17f), es_v3(0, 0, 0));
    es_shape_box(&block, es_v3(-0.55f, 0, -0.3f), es_v3(0.55f, 0.5f, 0.42f));
    es_build_object(&builder, "block", &block, es_build_lambert(&builder, "granite", 0.36f, 0.34f, 0.33f), es_v3(0, 0, 0));
    /* the head stands behind and to the left, turned to the ring */
    add_head(&builder, es_build_node(&builder, "head", es_v3(-0.30f, 0.80f, 0.10f), es_quat_from_axis_angle(es_v3(0, 1, 0), 1.15f)), n);
    /* a wide band: outside slightly barrelled, inside hollow */
    static const es_vec2 band[] = {{0.148f, 0}, {0.150f, -0.060f}, {0.153f, -0.074f}, {0.161f, -0.076f}, {0.167f, -0.064f}, {0.1725f, -0.030f}, {0.1740f, 0}, {0.1725f, 0.030f}, {0.167f, 0.064f}, {0.161f, 0.076f}, {0.153f, 0.074f}, {0.150f, 0.060f}, {0.148f, 0}};
    es_shape ring = es_build_shape(&builder);
    es_shape_smooth_lathe(&ring, es_v3(0, 0, 0), band, sizeof band / sizeof band[0], 8, 4 * n);
    es_node at = es_build_node(&builder, "ring", es_v3(0.20f, 0.68f, 0.08f), es_quat_identity());
    es_build_mover(&builder, &(es_mover_desc){.name = "turn", .type = ES_MOVER_SWING, .node = at, .centre = es_v3(0.20f, 0.68f, 0.08f), .period = 14, .amplitude = 0.25f});
    es_node upright = es_build_child(&builder, "ring", at, es_v3(0, 0, 0), es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), 1.0f), es_quat_from_axis_angle(es_v3(1, 0, 0), 0.5f * ES_PI)));
    const es_instance gold = es_build_instance(&builder, upright, es_build_mesh(&builder, "ring", &ring), es_build_gloss(&builder, "gold", 1.0f, 0.78f, 0.42f, 1, 0.12f));
    es_build_spot(&builder, es_v3(0.7f, 1.85f, 1.2f), es_v3(-0.75f, -1.05f, -1.1f), (const float[3]){1.0f, 0.93f, 0.82f}, 12, 0.45f, 0.9f);
    es_build_spot(&builder, es_v3(1.2f, 1.2f, -0.6f), es_v3(-1.4f, -0.4f, 0.7f), (const float[3]){0.75f, 0.85f, 1.0f}, 4, 0.5f, 0.9f);
    const es_vec3 eye = {0.28f, 0.92f, 1.05f};
    es_build_camera(&builder, eye, es_v3(-0.24f, -0.16f, -1), 0.72f, 0.03f);
    /* §7.6.1: two constraints make the face more visible in the ring */
    es_build_region(&builder, "ring", ES_REGION_GEODESIC, gold, es_v3(0.10f, 0.70f, 0.23f), 0.20f, 0.08f);
    es_build_constraint(&builder, "the eyes", gold, es_v3(0.09f, 0.735f, 0.235f), es_v3(-0.20f, 0.83f, 0.15f), eye);
    es_build_constraint(&builder, "the chin", gold, es_v3(0.09f, 0.655f, 0.235f), es_v3(-0.20f, 0.70f, 0.15f), eye);
    return builder.result;
}
