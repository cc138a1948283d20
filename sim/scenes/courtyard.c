/* An inner court with arcades on three sides, a fountain with a polished ball, pots, a bench and a blind arch; lit by sun and sky alone, over a day that takes
 * forty seconds. What lies under the arcades is lit by the sky that the arches leave, and by what the court's floor and walls send on. */
#include "sim/scenes/scene_tools.h"

#include "platform/maths.h"

static const float half_width = 5.0f, half_depth = 6.0f;          /* of the open court */
static const float gallery = 2.6f, column_height = 2.5f, wall_height = 6.4f, span = 2.0f, thick = 0.42f;

static uint32_t steps(float scale, float count, uint32_t least)
{
    const uint32_t n = (uint32_t)(count * scale + 0.5f);
    return n < least ? least : n;
}

/* A wall with a round arch in it, from `origin` along `along` (unit) for one span, `out` (unit) being the side that faces the court. The arch stands on the
 * height of the columns. */
static void add_arch(es_shape* shape, es_vec3 origin, es_vec3 along, es_vec3 out, uint32_t n)
{
    const float radius = 0.5f * span - 0.16f, middle = 0.5f * span;
    for (int side = 0; side < 2; side++) {
        const es_vec3 face = es_v3_scale(out, side ? 0.5f * thick : -0.5f * thick), normal = side ? out : es_v3_scale(out, -1.0f);
        for (uint32_t i = 0; i < n; i++) {
            float x[2], y[2];
            for (uint32_t k = 0; k < 2; k++) {
                float sine, cosine;
                es_sincos(ES_PI * (float)(i + k) / (float)n, &sine, &cosine);
                x[k] = middle - radius * cosine;
                y[k] = column_height + radius * sine;
            }
            if (i == 0) x[0] = middle - radius;
            const float top = wall_height;
            es_vec3 corner[4];
            const float px[4] = {x[0], x[1], x[1], x[0]}, py[4] = {y[0], y[1], top, top};
            for (int k = 0; k < 4; k++) corner[k] = es_v3_add(es_v3_add(origin, face), es_v3_add(es_v3_scale(along, px[k]), es_v3(0, py[k], 0)));
            es_shape_quad(shape, corner[0], corner[1], corner[2], corner[3], normal);
            if (side) continue;
            /* the arch from below */
            const es_vec3 in = es_v3_scale(out, -0.5f * thick), far = es_v3_scale(out, 0.5f * thick);
            const es_vec3 a = es_v3_add(origin, es_v3_add(es_v3_scale(along, x[0]), es_v3(0, y[0], 0))), b = es_v3_add(origin, es_v3_add(es_v3_scale(along, x[1]), es_v3(0, y[1], 0)));
            const float cx = middle - 0.5f * (x[0] + x[1]), cy = column_height - 0.5f * (y[0] + y[1]);
            es_shape_quad(shape, es_v3_add(a, in), es_v3_add(b, in), es_v3_add(b, far), es_v3_add(a, far),
                es_v3_normalize(es_v3_add(es_v3_scale(along, cx), es_v3(0, cy, 0)), es_v3(0, -1, 0)));
        }
        /* beside the arch, above the columns */
        for (int end = 0; end < 2; end++) {
            const float x0 = end ? middle + radius : 0, x1 = end ? span : middle - radius;
            es_vec3 corner[4];
            const float px[4] = {x0, x1, x1, x0}, py[4] = {column_height, column_height, wall_height, wall_height};
            for (int k = 0; k < 4; k++) corner[k] = es_v3_add(es_v3_add(origin, face), es_v3_add(es_v3_scale(along, px[k]), es_v3(0, py[k], 0)));
            es_shape_quad(shape, corner[0], corner[1], corner[2], corner[3], normal);
            if (side) continue;
            const es_vec3 in = es_v3_scale(out, -0.5f * thick), far = es_v3_scale(out, 0.5f * thick), a = es_v3_add(origin, es_v3_add(es_v3_scale(along, x0), es_v3(0, column_height, 0))),
                          b = es_v3_add(origin, es_v3_add(es_v3_scale(along, x1), es_v3(0, column_height, 0)));
            es_shape_quad(shape, es_v3_add(a, in), es_v3_add(b, in), es_v3_add(b, far), es_v3_add(a, far), es_v3(0, -1, 0));
        }
    }
    /* the top */
    const es_vec3 in = es_v3_scale(out, -0.5f * thick), far = es_v3_scale(out, 0.5f * thick), a = es_v3_add(origin, es_v3(0, wall_height, 0)), b = es_v3_add(a, es_v3_scale(along, span));
    es_shape_quad(shape, es_v3_add(a, in), es_v3_add(b, in), es_v3_add(b, far), es_v3_add(a, far), es_v3(0, 1, 0));
}

static void add_column(es_shape* shape, es_vec3 foot, float scale)
{
    static const es_vec2 profile[] = {{0, 0}, {0.30f, 0}, {0.30f, 0.14f}, {0.24f, 0.16f}, {0.22f, 0.24f}, {0.175f, 0.28f}, {0.18f, 1.2f}, {0.155f, 2.10f}, {0.19f, 2.14f}, {0.17f, 2.18f}, {0.25f, 2.34f}, {0, 2.34f}};
    es_shape_lathe(shape, foot, profile, sizeof profile / sizeof *profile, steps(scale, 24, 6));
    es_shape_box(shape, es_v3(foot.x - 0.30f, foot.y + 2.34f, foot.z - 0.30f), es_v3(foot.x + 0.30f, foot.y + column_height, foot.z + 0.30f));
}

/* Arches around the court, on three sides; the fourth is a wall. */
static void add_arcades(es_scene_builder* builder, float scale)
{
    es_shape walls = es_build_shape(builder), columns = es_build_shape(builder), roof = es_build_shape(builder);
    const uint32_t n = steps(scale, 20, 4);
    const int across = (int)(2 * half_width / span + 0.5f), along = (int)(2 * half_depth / span + 0.5f);
    for (int i = 0; i < across; i++) add_arch(&walls, es_v3(-half_width + span * (float)i, 0, -half_depth), es_v3(1, 0, 0), es_v3(0, 0, 1), n);
    for (int side = 0; side < 2; side++)
        for (int i = 0; i < along; i++) {
            const float x = side ? half_width : -half_width;
            add_arch(&walls, es_v3(x, 0, -half_depth + span * (float)i), es_v3(0, 0, 1), es_v3(side ? -1.0f : 1.0f, 0, 0), n);
        }
    for (int i = 0; i <= across; i++) add_column(&columns, es_v3(-half_width + span * (float)i, 0, -half_depth), scale);
    for (int side = 0; side < 2; side++)
        for (int i = 1; i <= along; i++) add_column(&columns, es_v3(side ? half_width : -half_width, 0, -half_depth + span * (float)i), scale);
    /* the galleries' outer walls, ceilings and roofs */
    const float out_x = half_width + gallery, out_z = half_depth + gallery, ceiling = column_height + 1.25f, front = half_depth + 0.5f;
    es_shape_box(&walls, es_v3(-out_x - thick, 0, -out_z - thick), es_v3(out_x + thick, wall_height, -out_z));
    es_shape_box(&walls, es_v3(-out_x - thick, 0, -out_z), es_v3(-out_x, wall_height, front));
    es_shape_box(&walls, es_v3(out_x, 0, -out_z), es_v3(out_x + thick, wall_height, front));
    es_shape_box(&walls, es_v3(-out_x - thick, 0, front), es_v3(out_x + thick, wall_height, front + thick));
    es_shape_box(&roof, es_v3(-out_x, ceiling, -out_z), es_v3(out_x, ceiling + 0.2f, -half_depth - 0.5f * thick));
    es_shape_box(&roof, es_v3(-out_x, ceiling, -half_depth - 0.5f * thick), es_v3(-half_width - 0.5f * thick, ceiling + 0.2f, front));
    es_shape_box(&roof, es_v3(half_width + 0.5f * thick, ceiling, -half_depth - 0.5f * thick), es_v3(out_x, ceiling + 0.2f, front));
    es_build_object(builder, "wall slabs", &walls, es_build_lambert(builder, "ochre plaster", 0.72f, 0.56f, 0.37f), es_v3(0, 0, 0));
    es_build_object(builder, "columns", &columns, es_build_lambert(builder, "limestone", 0.74f, 0.71f, 0.64f), es_v3(0, 0, 0));
    es_build_object(builder, "ceilings", &roof, es_build_lambert(builder, "timber", 0.34f, 0.21f, 0.12f), es_v3(0, 0, 0));
}

static void add_floor(es_scene_builder* builder)
{
    const float out_x = half_width + gallery, front = half_depth + 0.5f, back = -half_depth - gallery;
    const uint32_t columns = 14, rows = 14;
    es_shape slabs[2] = {es_build_shape(builder), es_build_shape(builder)};
    const float w = 2 * out_x / (float)columns, d = (front - back) / (float)rows;
    for (uint32_t i = 0; i < rows * columns; i++) {
        const float x = -out_x + w * (float)(i % columns), z = back + d * (float)(i / columns);
        es_shape_quad(&slabs[(i % columns + i / columns) % 2], es_v3(x, 0, z), es_v3(x + w, 0, z), es_v3(x + w, 0, z + d), es_v3(x, 0, z + d), es_v3(0, 1, 0));
    }
    es_build_object(builder, "pale slabs", &slabs[0], es_build_gloss(builder, "travertine", 0.56f, 0.52f, 0.45f, 0, 0.35f), es_v3(0, 0, 0));
    es_build_object(builder, "red slabs", &slabs[1], es_build_gloss(builder, "terracotta", 0.45f, 0.20f, 0.13f, 0, 0.45f), es_v3(0, 0, 0));
}

static void add_things(es_scene_builder* builder, float scale)
{
    /* a fountain: three steps, a basin of water, a ball of polished copper on a stem */
    static const es_vec2 basin[] = {{0, 0}, {1.75f, 0}, {1.75f, 0.12f}, {1.45f, 0.12f}, {1.45f, 0.24f}, {1.2f, 0.24f}, {1.28f, 0.70f}, {1.30f, 0.76f}, {1.12f, 0.76f}, {1.06f, 0.62f}, {0, 0.62f}};
    static const es_vec2 stem[] = {{0, 0.5f}, {0.24f, 0.5f}, {0.20f, 0.7f}, {0.09f, 0.9f}, {0.12f, 1.25f}, {0.22f, 1.36f}, {0.10f, 1.40f}, {0, 1.40f}};
    const es_vec3 at = {0, 0, -1.2f};
    es_shape stone = es_build_shape(builder), water = es_build_shape(builder), ball = es_build_shape(builder);
    es_shape_lathe(&stone, at, basin, sizeof basin / sizeof *basin, steps(scale, 64, 8));
    es_shape_lathe(&stone, at, stem, sizeof stem / sizeof *stem, steps(scale, 32, 6));
    es_shape_cylinder(&water, es_v3(at.x, 0.4f, at.z), 1.1f, 0.27f, steps(scale, 64, 8));
    es_shape_sphere(&ball, es_v3(at.x, 1.78f, at.z), 0.40f, steps(scale, 96, 12), steps(scale, 48, 6));
    es_build_object(builder, "fountain", &stone, es_build_lambert(builder, "marble", 0.78f, 0.77f, 0.74f), es_v3(0, 0, 0));
    es_build_object(builder, "water", &water, es_build_gloss(builder, "water", 0.03f, 0.10f, 0.11f, 0, 0.12f), es_v3(0, 0, 0));
    es_build_object(builder, "copper ball", &ball, es_build_gloss(builder, "copper", 0.95f, 0.64f, 0.54f, 1, 0.15f), es_v3(0, 0, 0));

    /* pots with round shrubs */
    static const es_vec2 pot[] = {{0, 0}, {0.20f, 0}, {0.30f, 0.40f}, {0.34f, 0.42f}, {0.34f, 0.48f}, {0.28f, 0.48f}, {0.27f, 0.42f}, {0, 0.42f}};
    es_shape pots = es_build_shape(builder), leaves = es_build_shape(builder);
    static const float places[][2] = {{-3.4f, -4.3f}, {3.4f, -4.3f}, {-3.4f, 1.6f}, {3.4f, 1.6f}};
    for (int i = 0; i < 4; i++) {
        const es_vec3 foot = {places[i][0], 0, places[i][1]};
        es_shape_lathe(&pots, foot, pot, sizeof pot / sizeof *pot, steps(scale, 32, 6));
        for (int k = 0; k < 7; k++) {
            float s, c;
            es_sincos(2.4f * (float)k + (float)i, &s, &c);
            const float out = k ? 0.17f : 0.0f, up = 0.80f + (k % 2 ? 0.14f : -0.06f);
            es_shape_sphere(&leaves, es_v3(foot.x + out * c, up, foot.z + out * s), 0.22f + 0.02f * (float)(k % 3), steps(scale, 32, 6), steps(scale, 16, 3));
        }
    }
    es_build_object(builder, "pots", &pots, es_build_lambert(builder, "clay", 0.62f, 0.28f, 0.16f), es_v3(0, 0, 0));
    es_build_object(builder, "shrubs", &leaves, es_build_lambert(builder, "leaves", 0.12f, 0.27f, 0.07f), es_v3(0, 0, 0));

    /* a bench in the shade, a blue door at the end, a jar of brass, a knot of glazed clay on a plinth */
    es_shape bench = es_build_shape(builder), door = es_build_shape(builder), jar = es_build_shape(builder), plinth = es_build_shape(builder), knot = es_build_shape(builder);
    const float out_x = half_width + gallery, out_z = half_depth + gallery;
    es_shape_box(&bench, es_v3(-out_x + 0.15f, 0.40f, -3.2f), es_v3(-out_x + 0.65f, 0.48f, -0.8f));
    es_shape_box(&bench, es_v3(-out_x + 0.2f, 0, -3.0f), es_v3(-out_x + 0.6f, 0.40f, -2.8f));
    es_shape_box(&bench, es_v3(-out_x + 0.2f, 0, -1.2f), es_v3(-out_x + 0.6f, 0.40f, -1.0f));
    es_shape_box(&door, es_v3(-0.75f, 0, -out_z), es_v3(0.75f, 2.3f, -out_z + 0.08f));
    static const es_vec2 body[] = {{0, 0}, {0.16f, 0}, {0.30f, 0.20f}, {0.34f, 0.40f}, {0.26f, 0.62f}, {0.12f, 0.72f}, {0.12f, 0.80f}, {0.19f, 0.86f}, {0.15f, 0.86f}, {0.09f, 0.78f}, {0, 0.78f}};
    es_shape_lathe(&jar, es_v3(2.3f, 0, 0.6f), body, sizeof body / sizeof *body, steps(scale, 48, 6));
    es_shape_box(&plinth, es_v3(-2.55f, 0, 0.25f), es_v3(-1.95f, 0.8f, 0.85f));
    es_shape_torus_knot(&knot, es_v3(-2.25f, 1.22f, 0.55f), 2, 3, 0.36f, 0.075f, steps(scale, 160, 16), steps(scale, 16, 4));
    es_build_object(builder, "bench", &bench, es_build_lambert(builder, "oak", 0.40f, 0.27f, 0.15f), es_v3(0, 0, 0));
    es_build_object(builder, "door", &door, es_build_lambert(builder, "blue paint", 0.07f, 0.19f, 0.42f), es_v3(0, 0, 0));
    es_build_object(builder, "jar", &jar, es_build_gloss(builder, "brass", 0.91f, 0.78f, 0.42f, 1, 0.3f), es_v3(0, 0, 0));
    es_build_object(builder, "plinth", &plinth, es_build_lambert(builder, "tuff", 0.50f, 0.47f, 0.42f), es_v3(0, 0, 0));
    es_build_object(builder, "knot", &knot, es_build_gloss(builder, "green glaze", 0.05f, 0.30f, 0.20f, 0, 0.2f), es_v3(0, 0, 0));
}

es_result es_scene_courtyard(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    const float scale = triangles ? es_clampf(es_sqrt((float)triangles / 47000.0f), 0.1f, 8.0f) : 1.0f;
    add_floor(&builder);
    add_arcades(&builder, scale);
    add_things(&builder, scale);
    es_build_camera(&builder, es_v3(2.9f, 1.7f, 5.6f), es_v3(-0.42f, -0.06f, -1), 62.0f * (ES_PI / 180.0f), 0.05f);

    es_node node = es_build_node(&builder, "sun", es_v3(0, 12, 0), es_quat_identity());
    es_light_desc light = es_default_light_desc();
    light.name = "sun";
    light.node = node;
    light.type = ES_LIGHT_DIRECTIONAL;
    es_sky_desc sky = es_default_sky_desc();
    if (builder.result == ES_OK) builder.result = es_world_add_light(world, &light, &sky.sun);
    /* Seville, a day of May: forty seconds of it make the day's twenty-four hours, beginning in the morning */
    sky.year = 2024;
    sky.month = 5;
    sky.day = 12;
    sky.seconds = 9.0 * 3600;
    sky.speed = 86400.0f / 40.0f;
    sky.latitude = 37.39f * (ES_PI / 180.0f);
    sky.longitude = -5.99f * (ES_PI / 180.0f);
    sky.north = 0.5f;
    sky.turbidity = 2.8f;
    if (builder.result == ES_OK) builder.result = es_world_set_sky(world, &sky);
    return builder.result;
}
