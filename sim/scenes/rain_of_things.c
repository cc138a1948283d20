/* Six hundred things rain into a walled yard and pile up: boxes, balls, capsules and rough stones, in two light beams that turn. */
#include "sim/scenes/body_tools.h"

#include "platform/maths.h"
#include "platform/random.h"

enum { THINGS = 600, ROUND = 30, KINDS = 4, SIZES = 3, SEED = 77 };
static const float yard = 3.2f, wall_height = 2.2f;

static float between(uint32_t counter, float low, float high) { return low + (high - low) * es_random_float(SEED, counter); }

/* A stone: a sphere's corners moved in and out. */
static es_mesh stone_mesh(es_scene_builder* builder, float radius, uint32_t variant)
{
    static const uint32_t faces[20][3] = {{0, 11, 5}, {0, 5, 1}, {0, 1, 7}, {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
        {3, 9, 4}, {3, 4, 2}, {3, 2, 6}, {3, 6, 8}, {3, 8, 9}, {4, 9, 5}, {2, 4, 11}, {6, 2, 10}, {8, 6, 7}, {9, 8, 1}};
    const float a = 0.5257311f, b = 0.8506508f;
    es_vec3 corners[12] = {{-a, b, 0}, {a, b, 0}, {-a, -b, 0}, {a, -b, 0}, {0, -a, b}, {0, a, b}, {0, -a, -b}, {0, a, -b}, {b, 0, -a}, {b, 0, a}, {-b, 0, -a}, {-b, 0, a}};
    for (uint32_t i = 0; i < 12; i++) corners[i] = es_v3_scale(corners[i], radius * between(90000 + 12 * variant + i, 0.85f, 1.15f));
    es_shape shape = es_build_shape(builder);
    for (int i = 0; i < 20; i++) {
        es_vec3 p = corners[faces[i][0]], q = corners[faces[i][1]], r = corners[faces[i][2]];
        es_shape_facet(&shape, p, q, r, es_v3_normalize(es_v3_cross(es_v3_sub(q, p), es_v3_sub(r, p)), es_v3(0, 1, 0)));
    }
    return es_build_mesh(builder, "stone", &shape);
}

typedef struct capsule { float radius, half_height; } capsule;
/* Two half spheres; the row of quadrilaterals that crosses the equator is the cylinder between them. */
static void capsule_surface(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal)
{
    const capsule* c = parameters;
    float sine, cosine, around_sine, around_cosine;
    es_sincos(ES_PI * v, &sine, &cosine);
    if (v == 1) sine = 0; /* a pole is one point */
    es_sincos(6.2831853f * u, &around_sine, &around_cosine);
    *normal = es_v3(sine * around_sine, -cosine, sine * around_cosine);
    *position = es_v3_scale(*normal, c->radius);
    position->y += v > 0.5f ? c->half_height : -c->half_height;
}

static es_mesh thing_mesh(es_scene_builder* builder, uint32_t kind, uint32_t size, es_shape_desc* body)
{
    float r = 0.10f + 0.035f * (float)size;
    es_shape shape = es_build_shape(builder);
    switch (kind) {
    case 0:
        es_shape_box(&shape, es_v3(-r, -0.8f * r, -1.2f * r), es_v3(r, 0.8f * r, 1.2f * r));
        *body = es_box_shape(es_v3(r, 0.8f * r, 1.2f * r));
        return es_build_mesh(builder, "crate", &shape);
    case 1:
        es_shape_sphere(&shape, es_v3(0, 0, 0), r, 20, 11);
        *body = es_sphere_shape(r);
        body->rolling_resistance = 0.1f * r;
        return es_build_mesh(builder, "ball", &shape);
    case 2: {
        capsule c = {0.6f * r, r};
        es_shape_patch(&shape, capsule_surface, &c, 16, 9, true, false);
        *body = es_capsule_shape(c.radius, c.half_height);
        body->rolling_resistance = 0.1f * r;
        return es_build_mesh(builder, "capsule", &shape);
    }
    default: {
        es_shape_free(&shape);
        es_mesh stone = stone_mesh(builder, 1.1f * r, size);
        *body = es_hull_shape(stone);
        return stone;
    }
    }
}

static void add_yard(es_scene_builder* builder)
{
    es_material stone = es_build_lambert(builder, "stone", 0.62f, 0.60f, 0.56f), brick = es_build_lambert(builder, "brick", 0.60f, 0.27f, 0.18f), blue = es_build_lambert(builder, "blue plaster", 0.22f, 0.34f, 0.58f);
    const float y = yard, t = 0.3f, h = wall_height;
    es_build_static_box(builder, "ground", es_v3(-y - t, -t, -y - t), es_v3(y + t, 0, y + t), stone);
    es_build_static_box(builder, "back wall", es_v3(-y - t, 0, -y - t), es_v3(y + t, 2 * h, -y), stone);
    es_build_static_box(builder, "left wall", es_v3(-y - t, 0, -y), es_v3(-y, h, y + t), brick);
    es_build_static_box(builder, "right wall", es_v3(y, 0, -y), es_v3(y + t, h, y + t), blue);
    es_build_static_box(builder, "step", es_v3(-1.0f, 0, -2.2f), es_v3(1.0f, 0.7f, -0.9f), stone);
    es_build_hidden_wall(builder, es_v3(-y - t, 0, y), es_v3(y + t, 40, y + t));
    es_build_hidden_wall(builder, es_v3(-y - t, h, -y), es_v3(-y, 40, y));
    es_build_hidden_wall(builder, es_v3(y, h, -y), es_v3(y + t, 40, y));
    es_build_hidden_wall(builder, es_v3(-y - t, 2 * h, -y - t), es_v3(y + t, 40, -y));
}

static void add_beam(es_scene_builder* builder, const char* name, float phase, const float color[3])
{
    es_node node = es_build_node(builder, name, es_v3(0, 7, 4), es_look_rotation(es_v3(0, -1, -0.5f)));
    es_light_desc spot = es_default_light_desc();
    for (int c = 0; c < 3; c++) spot.color[c] = color[c];
    spot.intensity = 420;
    spot.inner_cone = 0.30f;
    spot.outer_cone = 0.42f;
    es_build_light(builder, name, node, &spot);
    es_mover_desc orbit = es_default_mover_desc();
    orbit.node = node;
    orbit.centre = es_v3(0, 6.5f, 0.8f);
    orbit.arm = es_v3(4.2f, 0, 0);
    orbit.keep_rotation = true;
    orbit.period = 14;
    orbit.phase = phase;
    es_build_mover(builder, &orbit);
    es_build_mover(builder, &(es_mover_desc){.type = ES_MOVER_AIM, .node = node, .centre = es_v3(0, 0.3f, -0.6f)});
}

es_result es_scene_rain_of_things(es_world* world, uint32_t triangles)
{
    (void)triangles; /* the things are as they are */
    es_scene_builder builder = {world, ES_OK};
    add_yard(&builder);
    es_mesh meshes[KINDS][SIZES];
    es_shape_desc bodies[KINDS][SIZES];
    es_material paints[6];
    static const float colors[6][3] = {{0.75f, 0.30f, 0.14f}, {0.80f, 0.62f, 0.20f}, {0.25f, 0.50f, 0.30f}, {0.72f, 0.70f, 0.66f}, {0.24f, 0.38f, 0.66f}, {0.55f, 0.24f, 0.42f}};
    for (uint32_t kind = 0; kind < KINDS; kind++)
        for (uint32_t size = 0; size < SIZES; size++) meshes[kind][size] = thing_mesh(&builder, kind, size, &bodies[kind][size]);
    for (int i = 0; i < 6; i++) paints[i] = es_build_lambert(&builder, "paint", colors[i][0], colors[i][1], colors[i][2]);
    for (uint32_t i = 0; i < THINGS; i++) {
        uint32_t kind = es_random_u32(SEED, 16 * i) % KINDS, size = es_random_u32(SEED, 16 * i + 1) % SIZES;
        /* on a grid, so that none begins inside another; the lowest have not far to fall */
        uint32_t layer = i / ROUND, place = i % ROUND;
        es_vec3 start = {-2.2f + 0.88f * (float)(place % 6) + between(16 * i + 2, -0.15f, 0.15f), 1.6f + 0.85f * (float)layer + between(16 * i + 3, -0.1f, 0.1f), -1.8f + 0.9f * (float)(place / 6) + between(16 * i + 4, -0.15f, 0.15f)};
        es_vec3 axis = es_v3_normalize(es_v3(between(16 * i + 5, -1, 1), between(16 * i + 6, -1, 1), between(16 * i + 7, -1, 1)), es_v3(0, 1, 0));
        es_node node = es_build_node(&builder, "thing", start, es_quat_from_axis_angle(axis, between(16 * i + 8, 0, 6.28f)));
        es_build_instance(&builder, node, meshes[kind][size], paints[es_random_u32(SEED, 16 * i + 9) % 6]);
        es_body_desc desc = es_default_body_desc();
        desc.linear_damping = 1.6f; /* air: they fall at about 6 m/s */
        desc.angular_damping = 0.3f;
        desc.angular_velocity = es_v3_scale(axis, between(16 * i + 10, -4, 4));
        es_build_body(&builder, node, ES_BODY_DYNAMIC, &bodies[kind][size], &desc);
    }
    add_beam(&builder, "warm beam", 0.12f, (const float[3]){1.0f, 0.86f, 0.66f});
    add_beam(&builder, "cold beam", 0.45f, (const float[3]){0.62f, 0.78f, 1.0f});
    es_build_camera(&builder, es_v3(0, 3.4f, 7.4f), es_v3(0, -0.32f, -1), 0.80f, 0.1f);
    return builder.result;
}
