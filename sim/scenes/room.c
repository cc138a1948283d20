/* The closed room of 40 spheres and 20 tori, a common yardstick: 3.2 × 2.4 × 4 m, six tessellated walls, objects on a jittered
 * 5 × 3 × 4 grid in shuffled order (neither front to back nor back to front), everything Lambert, one hard-edged spot light
 * of 10 W/sr. Tessellation: 12 % of the triangles go to the walls in square grids, the rest in equal parts to the objects,
 * each a grid twice as fine around as along. */
#include "sim/scenes/scene_tools.h"

#include "platform/maths.h"

enum { COLUMNS = 5, ROWS = 3, LAYERS = 4, OBJECTS = COLUMNS * ROWS * LAYERS };
static const float half_x = 1.6f, half_y = 1.2f, half_z = 2.0f;

/* Marsaglia's xorshift with shifts 13, 17, 5 */
static uint32_t next_random(uint32_t* state)
{
    uint32_t x = *state;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    return *state = x;
}
static float next_unit(uint32_t* state) { return (float)(next_random(state) >> 8) * (1.0f / 16777216.0f); }

static void add_walls(es_scene_builder* builder, uint32_t n)
{
    const float x = half_x, y = half_y, z = half_z;
    const es_vec3 along_x = {2 * x, 0, 0}, along_y = {0, 2 * y, 0}, along_z = {0, 0, 2 * z};
    const struct { const char* name; es_vec3 origin, du, dv, normal; float color[3]; } walls[6] = {
        {"floor", {-x, -y, -z}, along_x, along_z, {0, 1, 0}, {0.7f, 0.7f, 0.7f}},
        {"ceiling", {-x, y, -z}, along_x, along_z, {0, -1, 0}, {0.75f, 0.75f, 0.75f}},
        {"back wall", {-x, -y, -z}, along_x, along_y, {0, 0, 1}, {0.7f, 0.7f, 0.7f}},
        {"front wall", {-x, -y, z}, along_x, along_y, {0, 0, -1}, {0.7f, 0.7f, 0.7f}},
        {"left wall", {-x, -y, -z}, along_z, along_y, {1, 0, 0}, {0.75f, 0.1f, 0.1f}},
        {"right wall", {x, -y, -z}, along_z, along_y, {-1, 0, 0}, {0.1f, 0.75f, 0.1f}},
    };
    for (int i = 0; i < 6; i++) {
        es_shape shape = es_build_shape(builder);
        es_shape_plane(&shape, walls[i].origin, walls[i].du, walls[i].dv, walls[i].normal, n, n);
        es_material material = es_build_lambert(builder, walls[i].name, walls[i].color[0], walls[i].color[1], walls[i].color[2]);
        es_build_object(builder, walls[i].name, &shape, material, es_v3(0, 0, 0));
    }
}

es_result es_scene_room(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    uint32_t target = triangles ? triangles : 70000;
    uint32_t wall = (uint32_t)es_sqrt(0.12f * (float)target / 12.0f);
    if (wall < 1) wall = 1;
    add_walls(&builder, wall);
    float per_object = es_maxf((float)target - 12.0f * (float)(wall * wall), 0.0f) / (float)OBJECTS;
    uint32_t nv = (uint32_t)es_sqrt(per_object / 4.0f), nu;
    if (nv < 3) nv = 3; /* below, a torus would be flat */
    nu = 2 * nv;

    int order[OBJECTS];
    uint32_t shuffle = 0x1234567u;
    for (int i = 0; i < OBJECTS; i++) order[i] = i;
    for (int i = OBJECTS - 1; i > 0; i--) {
        int j = (int)(next_random(&shuffle) % (uint32_t)(i + 1)), other = order[i];
        order[i] = order[j];
        order[j] = other;
    }
    for (int i = 0; i < OBJECTS; i++) {
        int k = order[i], column = k % COLUMNS, row = k / COLUMNS % ROWS, layer = k / (COLUMNS * ROWS);
        uint32_t state = 0x9E3779B9u * (uint32_t)(k + 1) | 1u;
        for (int warm = 0; warm < 4; warm++) next_random(&state);
        es_vec3 centre;
        centre.x = -1.25f + 0.625f * (float)column + 0.15f * (next_unit(&state) - 0.5f);
        centre.y = -0.80f + 0.76f * (float)row + 0.15f * (next_unit(&state) - 0.5f);
        centre.z = -1.6f + 0.72f * (float)layer + 0.2f * (next_unit(&state) - 0.5f);
        float color[3];
        for (int c = 0; c < 3; c++) color[c] = 0.25f + 0.6f * next_unit(&state);
        bool torus = k % 3 == 2;
        const char* name = torus ? "torus" : "sphere";
        es_shape shape = es_build_shape(&builder);
        shape.keep_degenerate = true; /* the triangles at the poles count */
        if (torus) es_shape_torus(&shape, es_v3(0, 0, 0), 0.26f, 0.09f, 1.2f * next_unit(&state) + 0.4f, nu, nv);
        else es_shape_sphere(&shape, es_v3(0, 0, 0), 0.22f + 0.08f * next_unit(&state), nu, nv);
        es_build_object(&builder, name, &shape, es_build_lambert(&builder, name, color[0], color[1], color[2]), centre);
    }
    es_build_camera(&builder, es_v3(0, 0.1f, 1.95f), es_v3(0, 0, -1), 65.0f * (ES_PI / 180.0f), 0.02f);
    es_build_spot(&builder, es_v3(-0.9f, 1.0f, 1.8f), es_v3(0.3995f, -0.4494f, -0.7990f), (const float[3]){1, 1, 1}, 10.0f, 0.79530f, 0.79540f);
    return builder.result;
}
