/* A kitchen with pots that reflect it, after figure 7.7 of Ritschel's thesis: a large polished pot, a kettle, a bowl and pans on a table, a sink, a window with a sky and a
 * sun outside. The large pot turns on a lazy Susan with a smaller one beside it, pans swing from a rail. */
#include "sim/scenes/body_tools.h"
#include "sim/scenes/edit_tools.h"

#include <string.h>

#include "platform/maths.h"

static const float low_x = -2.4f, high_x = 2.4f, low_z = -2.2f, high_z = 2.6f, height = 2.7f, table_y = 0.86f;

typedef struct detail { float scale; } detail;

static uint32_t steps(const detail* d, float count, uint32_t least)
{
    const uint32_t n = (uint32_t)(count * d->scale + 0.5f);
    return n < least ? least : n;
}

/* ---- the room -------------------------------------------------------------------------------------------------------------------- */

static void add_shell(es_scene_builder* builder)
{
    const es_material pale = es_build_lambert(builder, "cream", 0.66f, 0.61f, 0.52f), dark = es_build_lambert(builder, "brick", 0.42f, 0.17f, 0.11f);
    es_build_slabs(builder, es_v3(low_x, 0, low_z), es_v3(high_x, 0, high_z), 8, 8, pale, dark);
    const es_vec3 size = {high_x - low_x, height, high_z - low_z};
    es_shape white = es_build_shape(builder), blue = es_build_shape(builder), green = es_build_shape(builder);
    es_shape_plane(&white, es_v3(low_x, height, low_z), es_v3(size.x, 0, 0), es_v3(0, 0, size.z), es_v3(0, -1, 0), 4, 4);
    es_shape_plane(&white, es_v3(low_x, 0, low_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, 1), 4, 3);
    es_shape_plane(&blue, es_v3(low_x, 0, high_z), es_v3(size.x, 0, 0), es_v3(0, size.y, 0), es_v3(0, 0, -1), 4, 3);
    es_shape_plane(&green, es_v3(high_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, size.y, 0), es_v3(-1, 0, 0), 4, 3);
    /* the wall of the window has a hole */
    const float low_w = -0.9f, high_w = 0.7f, sill = 1.05f, lintel = 2.15f;
    es_shape_plane(&white, es_v3(low_x, 0, low_z), es_v3(0, 0, size.z), es_v3(0, sill, 0), es_v3(1, 0, 0), 4, 2);
    es_shape_plane(&white, es_v3(low_x, lintel, low_z), es_v3(0, 0, size.z), es_v3(0, height - lintel, 0), es_v3(1, 0, 0), 4, 1);
    es_shape_plane(&white, es_v3(low_x, sill, low_z), es_v3(0, 0, low_w - low_z), es_v3(0, lintel - sill, 0), es_v3(1, 0, 0), 2, 2);
    es_shape_plane(&white, es_v3(low_x, sill, high_w), es_v3(0, 0, high_z - high_w), es_v3(0, lintel - sill, 0), es_v3(1, 0, 0), 2, 2);
    es_build_object(builder, "white slabs", &white, es_build_lambert(builder, "limewash", 0.76f, 0.74f, 0.68f), es_v3(0, 0, 0));
    es_build_object(builder, "blue slabs", &blue, es_build_lambert(builder, "delft", 0.20f, 0.32f, 0.52f), es_v3(0, 0, 0));
    es_build_object(builder, "green slabs", &green, es_build_lambert(builder, "pistachio", 0.44f, 0.56f, 0.34f), es_v3(0, 0, 0));
    es_shape bars = es_build_shape(builder);
    const float x = low_x - 0.05f, w = 0.03f, middle = 0.5f * (low_w + high_w);
    es_shape_box(&bars, es_v3(x, sill, low_w), es_v3(x + 0.1f, lintel, low_w + w));
    es_shape_box(&bars, es_v3(x, sill, high_w - w), es_v3(x + 0.1f, lintel, high_w));
    es_shape_box(&bars, es_v3(x, sill, middle - w), es_v3(x + 0.1f, lintel, middle + w));
    es_shape_box(&bars, es_v3(x, sill - w, low_w - 0.06f), es_v3(x + 0.2f, sill, high_w + 0.06f));
    es_shape_box(&bars, es_v3(x, lintel - w, low_w), es_v3(x + 0.1f, lintel, high_w));
    es_build_object(builder, "window frame", &bars, es_build_lambert(builder, "white paint", 0.82f, 0.82f, 0.80f), es_v3(0, 0, 0));
    /* what is outside: a sky that glows */
    es_area_light_desc sky = es_default_area_light_desc();
    sky.name = "sky, a flat lamp";
    sky.size[0] = 2.0f;
    sky.size[1] = 1.4f;
    memcpy(sky.color, (const float[3]){0.55f, 0.78f, 1.0f}, sizeof sky.color);
    sky.radiance = 3.2f;
    sky.node = es_build_node(builder, "sky", es_v3(low_x - 0.16f, 0.5f * (sill + lintel), middle), es_look_rotation(es_v3(1, 0, 0)));
    es_area_light light;
    if (builder->result == ES_OK) builder->result = es_world_add_area_light(builder->world, &sky, &light);
}

/* ---- furniture --------------------------------------------------------------------------------------------------------------------- */

static void add_table(es_scene_builder* builder)
{
    es_shape top = es_build_shape(builder);
    es_shape_box(&top, es_v3(-1.1f, table_y - 0.05f, -0.6f), es_v3(1.2f, table_y, 0.7f));
    for (int i = 0; i < 4; i++) {
        const float x = i & 1 ? 1.05f : -1.03f, z = i & 2 ? 0.58f : -0.52f;
        es_shape_box(&top, es_v3(x - 0.05f, 0, z - 0.05f), es_v3(x + 0.05f, table_y - 0.05f, z + 0.05f));
    }
    es_build_object(builder, "table", &top, es_build_lambert(builder, "beech", 0.56f, 0.37f, 0.20f), es_v3(0, 0, 0));
}

/* Along the wall behind the table, a basin in it, a tap over it. */
static void add_sink(es_scene_builder* builder, const detail* d)
{
    const float y = 0.9f, front = low_z + 0.6f, left = 0.35f, right = 1.15f, near = low_z + 0.52f, far = low_z + 0.12f, deep = 0.7f;
    es_shape counter = es_build_shape(builder), basin = es_build_shape(builder), tap = es_build_shape(builder);
    es_shape_box(&counter, es_v3(low_x + 0.2f, 0, low_z + 0.01f), es_v3(left, y, front));
    es_shape_box(&counter, es_v3(right, 0, low_z + 0.01f), es_v3(high_x - 0.2f, y, front));
    es_shape_box(&counter, es_v3(left, 0, near), es_v3(right, y, front));
    es_shape_box(&counter, es_v3(left, 0, low_z + 0.01f), es_v3(right, y, far));
    es_build_object(builder, "counter", &counter, es_build_lambert(builder, "oak", 0.40f, 0.28f, 0.17f), es_v3(0, 0, 0));
    es_shape_plane(&basin, es_v3(left, deep, far), es_v3(right - left, 0, 0), es_v3(0, 0, near - far), es_v3(0, 1, 0), 2, 2);
    es_shape_plane(&basin, es_v3(left, deep, far), es_v3(right - left, 0, 0), es_v3(0, y + 0.01f - deep, 0), es_v3(0, 0, 1), 2, 1);
    es_shape_plane(&basin, es_v3(left, deep, near), es_v3(right - left, 0, 0), es_v3(0, y + 0.01f - deep, 0), es_v3(0, 0, -1), 2, 1);
    es_shape_plane(&basin, es_v3(left, deep, far), es_v3(0, 0, near - far), es_v3(0, y + 0.01f - deep, 0), es_v3(1, 0, 0), 2, 1);
    es_shape_plane(&basin, es_v3(right, deep, far), es_v3(0, 0, near - far), es_v3(0, y + 0.01f - deep, 0), es_v3(-1, 0, 0), 2, 1);
    es_build_object(builder, "slabs of the sink", &basin, es_build_lambert(builder, "enamel", 0.84f, 0.84f, 0.82f), es_v3(0, 0, 0));
    static const es_vec2 pipe[] = {{0, 0}, {0.035f, 0}, {0.035f, 0.02f}, {0.016f, 0.04f}, {0.016f, 0.26f}, {0, 0.28f}};
    es_shape_lathe(&tap, es_v3(0.75f, y, low_z + 0.07f), pipe, sizeof pipe / sizeof pipe[0], steps(d, 24, 6));
    es_shape_box(&tap, es_v3(0.735f, y + 0.23f, low_z + 0.07f), es_v3(0.765f, y + 0.255f, low_z + 0.30f));
    es_build_object(builder, "tap", &tap, es_build_lambert(builder, "pewter", 0.45f, 0.45f, 0.46f), es_v3(0, 0, 0));
    /* fruit and jars: colours for the pots to reflect */
    static const float fruit[5][3] = {{0.70f, 0.10f, 0.06f}, {0.78f, 0.50f, 0.05f}, {0.30f, 0.50f, 0.08f}, {0.72f, 0.12f, 0.10f}, {0.80f, 0.66f, 0.10f}};
    for (int i = 0; i < 5; i++) {
        es_shape ball = es_build_shape(builder);
        es_shape_sphere(&ball, es_v3(0, 0, 0), 0.045f, steps(d, 48, 10), steps(d, 32, 6));
        es_build_object(builder, "fruit", &ball, es_build_lambert(builder, "fruit", fruit[i][0], fruit[i][1], fruit[i][2]), es_v3(0.15f + 0.11f * (float)i, table_y + 0.045f, 0.52f - 0.03f * (float)(i % 2)));
    }
    for (int i = 0; i < 4; i++) {
        es_shape jar = es_build_shape(builder);
        es_shape_cylinder(&jar, es_v3(0, 0, 0), 0.07f, 0.2f + 0.05f * (float)(i % 2), steps(d, 48, 8));
        es_build_object(builder, "jar", &jar, es_build_lambert(builder, "glaze", fruit[i][2] + 0.1f, fruit[i][0] * 0.7f, fruit[i][1] + 0.1f), es_v3(-1.6f + 0.3f * (float)i, 0.9f, low_z + 0.3f));
    }
}

/* ---- pots ------------------------------------------------------------------------------------------------------------------------------ */

/* pots: the large one, the kettle, the bowl */
static void add_pots(es_scene_builder* builder, const detail* d, es_instance pots[3])
{
    static const es_vec2 pot[] = {{0, 0}, {0.20f, 0}, {0.235f, 0.02f}, {0.25f, 0.08f}, {0.255f, 0.18f}, {0.25f, 0.29f}, {0.255f, 0.31f}, {0.262f, 0.32f}, {0.255f, 0.335f}, {0.20f, 0.365f}, {0.10f, 0.39f}, {0.03f, 0.40f}, {0.02f, 0.42f}, {0.035f, 0.445f}, {0, 0.46f}};
    static const es_vec2 kettle[] = {{0, 0}, {0.10f, 0}, {0.15f, 0.03f}, {0.17f, 0.10f}, {0.155f, 0.17f}, {0.10f, 0.22f}, {0.05f, 0.235f}, {0.03f, 0.25f}, {0.035f, 0.27f}, {0, 0.28f}};
    static const es_vec2 bowl[] = {{0, 0}, {0.06f, 0}, {0.07f, 0.015f}, {0.12f, 0.05f}, {0.16f, 0.10f}, {0.175f, 0.14f}, {0.17f, 0.142f}, {0.15f, 0.10f}, {0.10f, 0.05f}, {0, 0.025f}};
    static const es_vec2 pan[] = {{0, 0}, {0.14f, 0}, {0.16f, 0.01f}, {0.18f, 0.05f}, {0.176f, 0.05f}, {0.15f, 0.015f}, {0, 0.008f}};
    const uint32_t round = steps(d, 288, 16), fine = steps(d, 14, 3);
    es_material chrome = es_build_gloss(builder, "chrome", 0.88f, 0.88f, 0.89f, 1, 0), steel = es_build_gloss(builder, "brushed steel", 0.78f, 0.76f, 0.73f, 1, 0.2f),
        copper = es_build_gloss(builder, "copper", 0.95f, 0.60f, 0.46f, 1, 0.1f), brass = es_build_gloss(builder, "brass", 0.92f, 0.76f, 0.40f, 1, 0);
    /* on a tray that turns about its middle */
    es_node tray = es_build_node(builder, "lazy Susan", es_v3(0.02f, table_y, -0.08f), es_quat_identity());
    es_shape disc = es_build_shape(builder);
    es_shape_cylinder(&disc, es_v3(0, 0, 0), 0.52f, 0.02f, steps(d, 96, 12));
    es_build_instance(builder, tray, es_build_mesh(builder, "tray", &disc), es_build_lambert(builder, "walnut", 0.30f, 0.17f, 0.09f));
    es_build_mover(builder, &(es_mover_desc){.name = "turn", .node = tray, .centre = es_v3(0.02f, table_y, -0.08f), .period = 40});
    static const struct { float x, z; } places[3] = {{-0.16f, 0.02f}, {0.29f, 0.06f}, {0.12f, -0.34f}};
    const es_vec2* const profiles[3] = {pot, kettle, bowl};
    static const uint32_t counts[3] = {sizeof pot / sizeof pot[0], sizeof kettle / sizeof kettle[0], sizeof bowl / sizeof bowl[0]};
    const es_material materials[3] = {chrome, copper, brass};
    static const char* const names[3] = {"large pot", "kettle", "bowl"};
    for (int i = 0; i < 3; i++) {
        es_node node = es_build_child(builder, names[i], tray, es_v3(places[i].x, 0.021f, places[i].z), es_quat_identity());
        es_shape shape = es_build_shape(builder);
        es_shape_smooth_lathe(&shape, es_v3(0, 0, 0), profiles[i], counts[i], fine, round);
        pots[i] = es_build_instance(builder, node, es_build_mesh(builder, names[i], &shape), materials[i]);
    }
    /* pans from a rail */
    es_shape rail = es_build_shape(builder);
    es_shape_box(&rail, es_v3(-1.2f, 2.05f, -1.25f), es_v3(1.1f, 2.07f, -1.23f));
    es_build_object(builder, "rail", &rail, es_build_lambert(builder, "iron", 0.12f, 0.12f, 0.13f), es_v3(0, 0, 0));
    for (int i = 0; i < 2; i++) {
        es_node hook = es_build_node(builder, "pan", es_v3(-0.8f + 1.2f * (float)i, 2.05f, -1.24f), es_quat_identity());
        es_build_mover(builder, &(es_mover_desc){.name = "swing", .type = ES_MOVER_SWING, .node = hook, .centre = es_v3(-0.8f + 1.2f * (float)i, 2.05f, -1.24f), .axis = es_v3(0, 0, 1), .period = 1.6f + 0.3f * (float)i, .amplitude = 0.22f});
        es_node hung = es_build_child(builder, "pan", hook, es_v3(0, -0.52f, 0.02f), es_quat_from_axis_angle(es_v3(1, 0, 0), 0.5f * ES_PI));
        es_shape shape = es_build_shape(builder);
        es_shape_smooth_lathe(&shape, es_v3(0, 0, 0), pan, sizeof pan / sizeof pan[0], fine, round / 2);
        es_shape_box(&shape, es_v3(-0.012f, 0.02f, -0.52f), es_v3(0.012f, 0.03f, -0.16f));
        es_build_instance(builder, hung, es_build_mesh(builder, "pan", &shape), i ? copper : steel);
    }
}

/* §7.6.1: four constraints in three regions. They follow the pots as the tray turns. */
static void edit_pots(es_scene_builder* builder, const es_instance pots[3], es_vec3 eye)
{
    const es_vec3 pot = {-0.14f, table_y + 0.021f, -0.06f}, kettle = {0.31f, table_y + 0.021f, -0.02f}, bowl = {0.14f, table_y + 0.021f, -0.42f};
    es_build_region(builder, "large pot", ES_REGION_GEODESIC, pots[0], es_v3(pot.x + 0.09f, pot.y + 0.16f, pot.z + 0.24f), 0.24f, 0.10f);
    es_build_constraint(builder, "the sink", pots[0], es_v3(pot.x + 0.06f, pot.y + 0.20f, pot.z + 0.25f), es_v3(0.75f, 0.98f, low_z + 0.2f), eye);
    es_build_constraint(builder, "the jars", pots[0], es_v3(pot.x + 0.16f, pot.y + 0.20f, pot.z + 0.20f), es_v3(-1.15f, 1.0f, low_z + 0.3f), eye);
    es_build_region(builder, "kettle", ES_REGION_GEODESIC, pots[1], es_v3(kettle.x + 0.01f, kettle.y + 0.12f, kettle.z + 0.17f), 0.14f, 0.06f);
    es_build_constraint(builder, "the fruit", pots[1], es_v3(kettle.x + 0.01f, kettle.y + 0.13f, kettle.z + 0.16f), es_v3(0.37f, table_y + 0.045f, 0.52f), eye);
    es_build_region(builder, "bowl", ES_REGION_EUCLIDEAN, pots[2], es_v3(bowl.x, bowl.y + 0.1f, bowl.z + 0.15f), 0.09f, 0.05f);
    es_build_constraint(builder, "the window", pots[2], es_v3(bowl.x, bowl.y + 0.1f, bowl.z + 0.15f), es_v3(low_x, 1.5f, 0.0f), eye);
}

es_result es_scene_kitchen(es_world* world, uint32_t triangles)
{
    enum { TRIANGLES = 300000 };
    es_scene_builder builder = {world, ES_OK};
    const detail d = {triangles ? es_clampf(es_sqrt((float)triangles / (float)TRIANGLES), 0.02f, 4.0f) : 1};
    add_shell(&builder);
    add_table(&builder);
    add_sink(&builder, &d);
    es_instance pots[3] = {{0}};
    add_pots(&builder, &d, pots);
    es_build_spot(&builder, es_v3(0.9f, 2.65f, 1.5f), es_v3(-0.7f, -1.6f, -1.9f), (const float[3]){1.0f, 0.88f, 0.70f}, 26, 0.5f, 0.95f);
    const es_vec3 eye = {0.35f, 1.62f, 1.75f}, target = {0.05f, 1.02f, -0.3f}, direction = es_v3_sub(target, eye);
    const es_node node = es_build_node(&builder, "camera", eye, es_look_rotation(direction));
    es_camera_desc camera = es_default_camera_desc();
    camera.name = "camera";
    camera.node = node;
    camera.fov_y = 0.80f;
    camera.near_plane = 0.05f;
    es_camera unused;
    if (builder.result == ES_OK) builder.result = es_world_add_camera(world, &camera, &unused);
    es_build_mover(&builder, &(es_mover_desc){.name = "to and fro", .type = ES_MOVER_SWING, .node = node, .centre = target, .arm = es_v3_sub(eye, target), .rotation = es_look_rotation(direction), .period = 18, .amplitude = 0.14f});
    edit_pots(&builder, pots, eye);
    return builder.result;
}
