/* A street at night, lit as streets are: by lamps, windows, the headlights of two cars, a moon and a sky that hardly glows, in about the luminances that these have. A
 * passer-by sees one car come while the other goes away. What is lit has a few tenths of a cd/m², what lights it 10⁴ times as much and more: the eye's glare is what
 * tells how bright it is. */
#include "sim/scenes/body_tools.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"

static const float road = 3.6f, kerb = 0.14f, wall = 6.4f;         /* half widths, and the pavement's height, m */
static const float near_end = 24.0f, far_end = -84.0f, lane = 1.8f;
static const float turn_far = -62.0f, turn_near = 14.0f, splay = 5.0f; /* where cars turn, and how far they keep apart there */
enum { PERIOD = 16, KEYS = 64 };

static uint32_t steps(float scale, float count, uint32_t least)
{
    const uint32_t n = (uint32_t)(count * scale + 0.5f);
    return n < least ? least : n;
}

/* A convex profile in (z, y), counter-clockwise seen from +x, between two planes of x. */
static void add_prism(es_shape* shape, const es_vec2* profile, uint32_t count, float low, float high)
{
    for (uint32_t i = 0; i < count; i++) {
        const es_vec2 a = profile[i], b = profile[(i + 1) % count];
        const es_vec3 normal = es_v3_normalize(es_v3(0, b.x - a.x, -(b.y - a.y)), es_v3(0, 1, 0));
        es_shape_quad(shape, es_v3(low, a.y, a.x), es_v3(high, a.y, a.x), es_v3(high, b.y, b.x), es_v3(low, b.y, b.x), es_v3_scale(normal, -1));
        if (i < 1 || i + 1 >= count) continue;
        const es_vec2 c = profile[0];
        es_shape_facet(shape, es_v3(low, c.y, c.x), es_v3(low, a.y, a.x), es_v3(low, b.y, b.x), es_v3(-1, 0, 0));
        es_shape_facet(shape, es_v3(high, c.y, c.x), es_v3(high, a.y, a.x), es_v3(high, b.y, b.x), es_v3(1, 0, 0));
    }
}

static void add_ground(es_scene_builder* builder)
{
    const uint32_t along = 50;
    es_shape asphalt = es_build_shape(builder), paint = es_build_shape(builder), paving = es_build_shape(builder);
    const float length = near_end - far_end;
    es_shape_plane(&asphalt, es_v3(-road, 0, far_end), es_v3(2 * road, 0, 0), es_v3(0, 0, length), es_v3(0, 1, 0), 4, along);
    for (int side = 0; side < 2; side++) {
        const float x0 = side ? road : -wall, x1 = side ? wall : -road;
        es_shape_plane(&paving, es_v3(x0, kerb, far_end), es_v3(x1 - x0, 0, 0), es_v3(0, 0, length), es_v3(0, 1, 0), 2, along);
        const float edge = side ? road : -road;
        es_shape_plane(&paving, es_v3(edge, 0, far_end), es_v3(0, kerb, 0), es_v3(0, 0, length), es_v3(side ? -1.0f : 1.0f, 0, 0), 1, along);
    }
    for (float z = near_end - 4; z > far_end + 4; z -= 6) es_shape_quad(&paint, es_v3(-0.06f, 0.004f, z), es_v3(0.06f, 0.004f, z), es_v3(0.06f, 0.004f, z - 3), es_v3(-0.06f, 0.004f, z - 3), es_v3(0, 1, 0));
    es_build_object(builder, "road slabs", &asphalt, es_build_gloss(builder, "wet asphalt", 0.055f, 0.055f, 0.06f, 0, 0.32f), es_v3(0, 0, 0));
    es_build_object(builder, "pavement slabs", &paving, es_build_gloss(builder, "paving", 0.20f, 0.19f, 0.18f, 0, 0.5f), es_v3(0, 0, 0));
    es_build_object(builder, "strips of paint", &paint, es_build_lambert(builder, "road paint", 0.62f, 0.62f, 0.60f), es_v3(0, 0, 0));
}

enum { FACADES = 4 };
typedef struct street_parts { es_shape facade[FACADES], roofs, frames, dark, lit; } street_parts;

/* A house with its front on the pavement, from z0 towards -z; side 1: to the right. */
static void add_house(street_parts* parts, uint32_t number, float z0, float width, int storeys, float side)
{
    es_shape* facade = &parts->facade[(number * 7 + number / 3) % FACADES];
    const float storey = 3.0f, height = kerb + 0.5f + storey * (float)storeys, front = side * wall, back = side * (wall + 7.0f), z1 = z0 - width;
    es_shape_box(facade, es_v3(es_minf(front, back), 0, z1), es_v3(es_maxf(front, back), height, z0));
    /* a ridge along the street */
    const float eaves = front - side * 0.35f, ridge = side * (wall + 3.5f), top = height + 2.4f;
    es_shape_quad(&parts->roofs, es_v3(eaves, height - 0.1f, z0), es_v3(eaves, height - 0.1f, z1), es_v3(ridge, top, z1), es_v3(ridge, top, z0), es_v3_normalize(es_v3(-side * 2.5f, 3.85f, 0), es_v3(0, 1, 0)));
    es_shape_quad(&parts->roofs, es_v3(back, height, z0), es_v3(back, height, z1), es_v3(ridge, top, z1), es_v3(ridge, top, z0), es_v3_normalize(es_v3(side * 2.4f, 3.5f, 0), es_v3(0, 1, 0)));
    for (int end = 0; end < 2; end++) es_shape_facet(facade, es_v3(front, height, end ? z1 : z0), es_v3(back, height, end ? z1 : z0), es_v3(ridge, top, end ? z1 : z0), es_v3(0, 0, end ? -1.0f : 1.0f));
    const int columns = (int)(width / 2.2f);
    const float pitch = width / (float)columns, x = front - side * 0.02f;
    for (int s = 0; s < storeys; s++)
        for (int c = 0; c < columns; c++) {
            const float middle = z0 - pitch * ((float)c + 0.5f), low = kerb + 0.5f + storey * (float)s + 0.75f, half = 0.55f;
            const bool door = s == 0 && c == (int)number % columns;
            const uint32_t counter = number * 64 + (uint32_t)(s * 8 + c);
            es_shape* pane = !door && es_random_float(77, counter) < 0.17f ? &parts->lit : &parts->dark;
            const float bottom = door ? kerb : low, up = door ? kerb + 2.3f : low + 1.5f;
            es_shape_quad(pane, es_v3(x, bottom, middle + half), es_v3(x, bottom, middle - half), es_v3(x, up, middle - half), es_v3(x, up, middle + half), es_v3(-side, 0, 0));
            const float out = front - side * 0.12f;
            es_shape_box(&parts->frames, es_v3(es_minf(front, out), bottom - 0.12f, middle - half - 0.12f), es_v3(es_maxf(front, out), bottom, middle + half + 0.12f));
            if (!door) es_shape_box(&parts->frames, es_v3(es_minf(front, front - side * 0.05f), bottom, middle - 0.03f), es_v3(es_maxf(front, front - side * 0.05f), up, middle + 0.03f));
        }
}

static void add_houses(es_scene_builder* builder)
{
    street_parts parts = {.roofs = es_build_shape(builder), .frames = es_build_shape(builder), .dark = es_build_shape(builder), .lit = es_build_shape(builder)};
    for (int i = 0; i < FACADES; i++) parts.facade[i] = es_build_shape(builder);
    uint32_t number = 0;
    for (int side = 0; side < 2; side++)
        for (float z = near_end; z > far_end + 6; number++) {
            const float width = 7.5f + 4.0f * es_random_float(11, number);
            add_house(&parts, number, z, width, 2 + (int)(2.4f * es_random_float(12, number)), side ? 1.0f : -1.0f);
            z -= width + (es_random_float(13, number) < 0.25f ? 2.5f : 0.02f);
        }
    /* across the far end */
    es_shape_box(&parts.facade[1], es_v3(-16, 0, far_end - 8), es_v3(16, 9.5f, far_end));
    static const float colors[FACADES][3] = {{0.46f, 0.30f, 0.22f}, {0.52f, 0.48f, 0.40f}, {0.36f, 0.38f, 0.40f}, {0.55f, 0.40f, 0.25f}};
    static const char* const names[FACADES] = {"brick slabs", "render slabs", "slate slabs", "ochre slabs"};
    for (int i = 0; i < FACADES; i++) es_build_object(builder, names[i], &parts.facade[i], es_build_lambert(builder, names[i], colors[i][0], colors[i][1], colors[i][2]), es_v3(0, 0, 0));
    es_material_desc roof = es_default_material_desc();
    memcpy(roof.base_color, (const float[3]){0.16f, 0.10f, 0.08f}, 3 * sizeof(float));
    roof.specular = 0;
    roof.double_sided = true;
    es_build_object(builder, "roof slabs", &parts.roofs, es_build_material(builder, "tiles", &roof), es_v3(0, 0, 0));
    es_build_object(builder, "sills", &parts.frames, es_build_lambert(builder, "white wood", 0.58f, 0.56f, 0.52f), es_v3(0, 0, 0));
    es_build_object(builder, "dark window slabs", &parts.dark, es_build_gloss(builder, "window glass", 0.02f, 0.025f, 0.03f, 0, 0.3f), es_v3(0, 0, 0));
    es_material_desc glow = es_default_material_desc();
    glow.specular = 0;
    memset(glow.base_color, 0, 3 * sizeof(float));
    memcpy(glow.emission, (const float[3]){0.55f, 0.36f, 0.17f}, sizeof glow.emission);
    es_build_object(builder, "lit window slabs", &parts.lit, es_build_material(builder, "lit room", &glow), es_v3(0, 0, 0));
}

static void add_area_light(es_scene_builder* builder, const es_area_light_desc* desc, es_node node)
{
    es_area_light light;
    es_area_light_desc d = *desc;
    d.node = node;
    if (builder->result == ES_OK) builder->result = es_world_add_area_light(builder->world, &d, &light);
}

static void add_lamps(es_scene_builder* builder, float scale)
{
    static const es_vec2 post[] = {{0, 0}, {0.16f, 0}, {0.16f, 0.35f}, {0.07f, 0.5f}, {0.055f, 4.7f}, {0.12f, 4.8f}, {0.10f, 4.86f}, {0, 4.86f}};
    static const es_vec2 hat[] = {{0, 0}, {0.17f, 0}, {0.05f, 0.09f}, {0, 0.14f}};
    es_shape posts = es_build_shape(builder);
    es_area_light_desc lamp = es_default_area_light_desc();
    lamp.name = "street lamp";
    lamp.shape = ES_AREA_SPHERE;
    lamp.size[0] = lamp.size[1] = 0.24f;
    memcpy(lamp.color, (const float[3]){1, 0.74f, 0.42f}, sizeof lamp.color);
    lamp.radiance = 60;
    for (int i = 0; i < 7; i++) {
        const es_vec3 foot = es_v3(i % 2 ? -road - 0.45f : road + 0.45f, kerb, -1.0f - 11.5f * (float)i);
        es_shape_lathe(&posts, foot, post, sizeof post / sizeof *post, steps(scale, 12, 5));
        es_shape_lathe(&posts, es_v3_add(foot, es_v3(0, 5.12f, 0)), hat, sizeof hat / sizeof *hat, steps(scale, 12, 5));
        add_area_light(builder, &lamp, es_build_node(builder, "street lamp", es_v3_add(foot, es_v3(0, 4.99f, 0)), es_quat_identity()));
    }
    es_build_object(builder, "posts", &posts, es_build_gloss(builder, "cast iron", 0.05f, 0.06f, 0.05f, 0, 0.4f), es_v3(0, 0, 0));
    /* Half a degree of sky. A tenth of its luminance, or it would take most of the lights that stand for all lamps. */
    lamp.name = "moon";
    lamp.size[0] = lamp.size[1] = 1.05f;
    memcpy(lamp.color, (const float[3]){1, 0.96f, 0.86f}, sizeof lamp.color);
    lamp.radiance = 3;
    add_area_light(builder, &lamp, es_build_node(builder, "moon", es_v3(-7, 29, -92), es_quat_identity()));
}

static void add_trees(es_scene_builder* builder, float scale)
{
    static const float places[][2] = {{-5.2f, -5}, {5.3f, -18.5f}, {-5.3f, -29}, {5.2f, -41}};
    es_shape trunks = es_build_shape(builder), leaves = es_build_shape(builder);
    static const es_vec2 trunk[] = {{0, 0}, {0.16f, 0}, {0.10f, 0.6f}, {0.08f, 2.6f}, {0, 2.6f}};
    for (uint32_t i = 0; i < sizeof places / sizeof *places; i++) {
        es_shape_lathe(&trunks, es_v3(places[i][0], kerb, places[i][1]), trunk, sizeof trunk / sizeof *trunk, steps(scale, 10, 5));
        for (uint32_t k = 0; k < 9; k++) {
            float s, c;
            es_sincos(2.4f * (float)k + (float)i, &s, &c);
            const float out = k ? 0.55f : 0.0f;
            es_shape_sphere(&leaves, es_v3(places[i][0] + out * c, 2.75f + 0.16f * (float)k, places[i][1] + out * s), 0.42f + 0.1f * es_random_float(5, 9 * i + k), steps(scale, 18, 5), steps(scale, 9, 3));
        }
    }
    es_build_object(builder, "trunks", &trunks, es_build_lambert(builder, "bark", 0.16f, 0.12f, 0.09f), es_v3(0, 0, 0));
    es_build_object(builder, "crowns", &leaves, es_build_lambert(builder, "night leaves", 0.10f, 0.19f, 0.06f), es_v3(0, 0, 0));
}

/* ---- cars ------------------------------------------------------------------------------------------------------------------------------- */

/* Place and heading after a share of the round: towards the camera on the left, round behind it, away on the right, and round at the far end. */
static void drive(float phase, es_vec3* at, es_vec3* heading)
{
    const float straight = turn_near - turn_far, at_camera = ES_PI * lane, at_far = ES_PI * splay, whole = 2 * straight + at_camera + at_far;
    float s = (phase - es_floor(phase)) * whole, sine, cosine;
    const bool returns = s > straight + at_camera;
    if (s < straight || (returns && s < 2 * straight + at_camera)) {
        const float z = returns ? turn_near - (s - straight - at_camera) : turn_far + s, t = es_clampf((turn_far + 14.0f - z) / 14.0f, 0, 1), apart = lane + (splay - lane) * t * t * (3 - 2 * t);
        const float slope = (splay - lane) * 6 * t * (1 - t) / 14.0f;
        *at = es_v3(returns ? apart : -apart, 0, z);
        *heading = returns ? es_v3(slope, 0, -1) : es_v3(slope, 0, 1);
    } else if (!returns) {
        /* behind the camera nobody sees that it turns round the other way than it goes: so the round has no whole turn in it, and closes */
        es_sincos((s - straight) / lane, &sine, &cosine);
        *at = es_v3(-lane * cosine, 0, turn_near + lane * sine);
        *heading = es_v3(-sine, 0, cosine);
    } else {
        es_sincos((s - 2 * straight - at_camera) / splay, &sine, &cosine);
        *at = es_v3(splay * cosine, 0, turn_far - splay * sine);
        *heading = es_v3(-sine, 0, -cosine);
    }
}

static void car_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    es_vec3 heading;
    drive(phase, translation, &heading);
    *rotation = es_look_rotation(heading);
}
static void first_pose(float phase, es_vec3* translation, es_quat* rotation) { car_pose(phase + 0.155f, translation, rotation); }
static void second_pose(float phase, es_vec3* translation, es_quat* rotation) { car_pose(phase + 0.655f, translation, rotation); }

/* Its front is at -z. */
static es_node add_car(es_scene_builder* builder, const float color[3], es_mesh body, es_mesh cabin, es_mesh wheels, es_vec3 at, es_quat rotation)
{
    es_node car = es_build_node(builder, "car", at, rotation);
    es_build_instance(builder, car, body, es_build_gloss(builder, "car paint", color[0], color[1], color[2], 0, 0.3f));
    es_build_instance(builder, car, cabin, es_build_gloss(builder, "car glass", 0.015f, 0.017f, 0.02f, 0, 0.3f));
    es_build_instance(builder, car, wheels, es_build_lambert(builder, "tyre", 0.03f, 0.03f, 0.03f));
    es_area_light_desc lamp = es_default_area_light_desc();
    lamp.shape = ES_AREA_DISC;
    for (int side = 0; side < 2; side++) {
        const float x = side ? 0.60f : -0.60f;
        lamp.name = "headlight, a flat lamp";
        lamp.size[0] = lamp.size[1] = 0.16f;
        memcpy(lamp.color, (const float[3]){1, 0.93f, 0.82f}, sizeof lamp.color);
        lamp.radiance = 260;
        add_area_light(builder, &lamp, es_build_child(builder, "headlight", car, es_v3(x, 0.66f, -2.12f), es_quat_identity()));
        lamp.name = "tail light, a flat lamp";
        lamp.size[0] = lamp.size[1] = 0.13f;
        memcpy(lamp.color, (const float[3]){1, 0.02f, 0.01f}, sizeof lamp.color);
        lamp.radiance = 0.9f;
        add_area_light(builder, &lamp, es_build_child(builder, "tail light", car, es_v3(x, 0.80f, 2.12f), es_quat_from_axis_angle(es_v3(0, 1, 0), ES_PI)));
    }
    /* what the reflectors behind the discs make of their light */
    es_light_desc beam = es_default_light_desc();
    beam.color[1] = 0.93f;
    beam.color[2] = 0.82f;
    beam.intensity = 45;
    beam.inner_cone = 0.08f;
    beam.outer_cone = 0.42f;
    es_build_light(builder, "beam", es_build_child(builder, "beam", car, es_v3(0, 0.66f, -2.2f), es_quat_from_axis_angle(es_v3(1, 0, 0), -0.055f)), &beam);
    return car;
}

static void add_cars(es_scene_builder* builder, float scale)
{
    static const es_vec2 body[] = {{-2.1f, 0.32f}, {2.1f, 0.32f}, {2.1f, 0.86f}, {1.95f, 0.95f}, {-1.0f, 0.92f}, {-2.0f, 0.78f}, {-2.1f, 0.70f}};
    static const es_vec2 cabin[] = {{-0.95f, 0.92f}, {1.8f, 0.94f}, {1.25f, 1.38f}, {-0.15f, 1.40f}};
    es_shape shapes[3] = {es_build_shape(builder), es_build_shape(builder), es_build_shape(builder)};
    add_prism(&shapes[0], body, sizeof body / sizeof *body, -0.85f, 0.85f);
    add_prism(&shapes[1], cabin, sizeof cabin / sizeof *cabin, -0.70f, 0.70f);
    enum { MOST = 32 };
    const uint32_t n = steps(es_minf(scale, 2), 16, 6);
    es_vec2 wheel[MOST];
    for (int i = 0; i < 4; i++) {
        for (uint32_t k = 0; k < n; k++) {
            float s, c;
            es_sincos(2 * ES_PI * (float)k / (float)n, &s, &c);
            wheel[k] = (es_vec2){(i / 2 ? 1.3f : -1.3f) + 0.32f * c, 0.32f + 0.32f * s};
        }
        add_prism(&shapes[2], wheel, n, i % 2 ? 0.66f : -0.87f, i % 2 ? 0.87f : -0.66f);
    }
    es_mesh meshes[3];
    static const char* const names[3] = {"car body", "car windows", "car wheels"};
    for (int i = 0; i < 3; i++) meshes[i] = es_build_mesh(builder, names[i], &shapes[i]);
    static const float colors[2][3] = {{0.05f, 0.09f, 0.22f}, {0.30f, 0.03f, 0.03f}};
    es_motion motions[2] = {{.pose = first_pose}, {.pose = second_pose}};
    for (int i = 0; i < 2; i++) {
        es_vec3 at;
        es_quat rotation;
        motions[i].pose(0, &at, &rotation);
        motions[i].node = add_car(builder, colors[i], meshes[0], meshes[1], meshes[2], at, rotation);
    }
    es_build_clip(builder, "traffic", PERIOD, KEYS, motions, 2);
}

es_result es_scene_night_street(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 20000.0f), 0.1f, 6.0f) : 1.0f;
    add_ground(&builder);
    add_houses(&builder);
    add_lamps(&builder, scale);
    add_trees(&builder, scale);
    add_cars(&builder, scale);
    if (builder.result == ES_OK) builder.result = es_world_set_environment(world, &(es_environment_desc){.radiance = {0.0003f, 0.0004f, 0.0008f}});
    es_build_camera(&builder, es_v3(4.75f, 1.65f, 10.5f), es_v3(-0.17f, 0.055f, -1), 50.0f * (ES_PI / 180.0f), 0.1f);
    return builder.result;
}
