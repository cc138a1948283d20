/* A rabbit floats in a box open to the eye, under one spot light: after the scene of Cochran and Steele 2007, whose bunny has 69 thousand triangles. It is made of
 * rounded parts that go into each other, each with a coat of fine waves. */
#include "sim/scenes/body_tools.h"

#include <string.h>

#include "platform/maths.h"

/* A ball stretched by `radius`, bent along y (ears), narrower towards +y by `taper`, with waves of `coat` times its size. */
typedef struct part { es_vec3 centre, radius; float taper, bend, coat, waves, turn, lean; } part;

static es_vec3 part_point(const part* p, float u, float v)
{
    float sine, cosine, s, c;
    es_sincos(ES_PI * v, &sine, &cosine);
    es_sincos(2.0f * ES_PI * u, &s, &c);
    if (v == 0.0f || v == 1.0f) sine = 0.0f; /* the poles are one point */
    const float wave = 1.0f + p->coat * sine * sine * (es_sin(p->waves * 2.0f * ES_PI * u) * es_sin(p->waves * ES_PI * v) + 0.5f * es_sin(3.0f * p->waves * ES_PI * v + 2.0f * ES_PI * 2.0f * u));
    const float narrow = 1.0f - p->taper * cosine;
    es_vec3 q = es_v3(p->radius.x * sine * c * wave * narrow, p->radius.y * cosine, p->radius.z * sine * s * wave * narrow);
    q.z += p->bend * cosine * cosine * p->radius.y;
    /* leans to the side, then turns about y */
    es_sincos(p->lean, &s, &c);
    q = es_v3(q.x * c - q.y * s, q.x * s + q.y * c, q.z);
    es_sincos(p->turn, &s, &c);
    q = es_v3(q.x * c + q.z * s, q.y, q.z * c - q.x * s);
    return es_v3_add(p->centre, q);
}

static void part_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const part* p = parameters;
    const float step = 1e-3f;
    *position = part_point(p, u, v);
    const float inner = es_clampf(v, 2.0f * step, 1.0f - 2.0f * step);
    const es_vec3 du = es_v3_sub(part_point(p, u + step, inner), part_point(p, u - step, inner)), dv = es_v3_sub(part_point(p, u, inner + step), part_point(p, u, inner - step));
    *normal = es_v3_normalize(es_v3_cross(du, dv), es_v3(0, 1, 0));
    if (es_v3_dot(*normal, es_v3_sub(part_point(p, u, inner), p->centre)) < 0.0f) *normal = es_v3_scale(*normal, -1.0f);
}

static void add_part(es_shape* shape, const part* p, float scale, float nu, float nv)
{
    const uint32_t u = (uint32_t)es_maxf(nu * scale, 6.0f), v = (uint32_t)es_maxf(nv * scale, 4.0f);
    es_shape_patch(shape, part_surface, p, u, v, true, false);
}

static void add_rabbit(es_scene_builder* builder, es_node node, float scale)
{
    static const part body = {{0, 0, 0.02f}, {0.30f, 0.27f, 0.38f}, 0.10f, 0, 0.004f, 16, 0, 0}, chest = {{0, 0.05f, -0.24f}, {0.21f, 0.25f, 0.20f}, 0.05f, 0, 0.004f, 14, 0, 0},
                      head = {{0, 0.33f, -0.36f}, {0.155f, 0.15f, 0.205f}, 0, 0, 0.003f, 14, 0, 0}, tail = {{0, -0.02f, 0.42f}, {0.09f, 0.09f, 0.09f}, 0, 0, 0.03f, 6, 0, 0};
    static const part limbs[] = {
        {{-0.075f, 0.60f, -0.27f}, {0.062f, 0.235f, 0.034f}, 0.25f, 0.16f, 0.004f, 6, 0.25f, 0.16f}, {{0.075f, 0.60f, -0.27f}, {0.062f, 0.235f, 0.034f}, 0.25f, 0.16f, 0.004f, 6, -0.25f, -0.16f},
        {{-0.21f, -0.16f, 0.12f}, {0.12f, 0.17f, 0.20f}, 0, 0, 0.006f, 9, 0.1f, 0}, {{0.21f, -0.16f, 0.12f}, {0.12f, 0.17f, 0.20f}, 0, 0, 0.006f, 9, -0.1f, 0},
        {{-0.20f, -0.27f, -0.02f}, {0.070f, 0.055f, 0.19f}, 0, 0, 0.006f, 8, 0.12f, 0}, {{0.20f, -0.27f, -0.02f}, {0.070f, 0.055f, 0.19f}, 0, 0, 0.006f, 8, -0.12f, 0},
        {{-0.10f, -0.17f, -0.36f}, {0.058f, 0.17f, 0.070f}, 0, -0.1f, 0.006f, 8, 0.05f, 0}, {{0.10f, -0.17f, -0.36f}, {0.058f, 0.17f, 0.070f}, 0, -0.1f, 0.006f, 8, -0.05f, 0}};
    es_shape coat = es_build_shape(builder), eyes = es_build_shape(builder);
    add_part(&coat, &body, scale, 144, 72);
    add_part(&coat, &chest, scale, 96, 48);
    add_part(&coat, &head, scale, 112, 56);
    add_part(&coat, &tail, scale, 48, 24);
    for (int i = 0; i < 8; i++) add_part(&coat, &limbs[i], scale, i < 2 ? 64 : 44, i < 2 ? 56 : 26);
    for (int side = 0; side < 2; side++) {
        es_shape_sphere(&eyes, es_v3(side ? 0.125f : -0.125f, 0.36f, -0.44f), 0.026f, (uint32_t)es_maxf(16 * scale, 5), (uint32_t)es_maxf(8 * scale, 3));
        es_shape_sphere(&eyes, es_v3(side ? 0.02f : -0.02f, 0.315f, -0.555f), 0.020f, (uint32_t)es_maxf(12 * scale, 5), (uint32_t)es_maxf(6 * scale, 3));
    }
    es_build_instance(builder, node, es_build_mesh(builder, "rabbit", &coat), es_build_lambert(builder, "fur", 0.74f, 0.70f, 0.64f));
    es_build_instance(builder, node, es_build_mesh(builder, "eyes", &eyes), es_build_lambert(builder, "dark", 0.06f, 0.04f, 0.04f));
}

static void float_about(float phase, es_vec3* translation, es_quat* rotation)
{
    *translation = es_v3(0.05f * es_sin(2.0f * ES_PI * phase), 0.95f + 0.06f * es_sin(4.0f * ES_PI * phase), 0);
    *rotation = es_quat_from_axis_angle(es_v3(0, 1, 0), 2.0f * ES_PI * phase + 2.6f);
}

es_result es_scene_bunny_box(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 69000.0f), 0.08f, 8.0f) : 1.0f;
    const struct { const char* name; es_vec3 origin, du, dv, normal; float color[3]; } walls[] = {
        {"floor slabs", {-1, 0, -1}, {2, 0, 0}, {0, 0, 2}, {0, 1, 0}, {0.70f, 0.69f, 0.66f}}, {"ceiling slabs", {-1, 2, -1}, {2, 0, 0}, {0, 0, 2}, {0, -1, 0}, {0.74f, 0.73f, 0.70f}},
        {"back slabs", {-1, 0, -1}, {2, 0, 0}, {0, 2, 0}, {0, 0, 1}, {0.72f, 0.71f, 0.68f}}, {"left slabs", {-1, 0, -1}, {0, 0, 2}, {0, 2, 0}, {1, 0, 0}, {0.66f, 0.10f, 0.07f}},
        {"right slabs", {1, 0, -1}, {0, 0, 2}, {0, 2, 0}, {-1, 0, 0}, {0.10f, 0.24f, 0.62f}}};
    for (int i = 0; i < 5; i++) {
        es_shape shape = es_build_shape(&builder);
        es_shape_plane(&shape, walls[i].origin, walls[i].du, walls[i].dv, walls[i].normal, 4, 4);
        es_build_object(&builder, walls[i].name, &shape, es_build_lambert(&builder, walls[i].name, walls[i].color[0], walls[i].color[1], walls[i].color[2]), es_v3(0, 0, 0));
    }
    es_vec3 place;
    es_quat turn;
    float_about(0, &place, &turn);
    es_node rabbit = es_build_node(&builder, "rabbit", place, turn);
    add_rabbit(&builder, rabbit, scale);
    const es_motion motion = {rabbit, float_about};
    es_build_clip(&builder, "float", 12, 24, &motion, 1);
    es_build_camera(&builder, es_v3(0, 1, 3.35f), es_v3(0, 0, -1), 40.0f * (ES_PI / 180.0f), 0.05f);
    es_build_spot(&builder, es_v3(-0.62f, 1.9f, 1.25f), es_v3(0.55f, -0.80f, -1.15f), (const float[3]){1, 0.96f, 0.90f}, 16.0f, 0.35f, 0.62f);
    return builder.result;
}
