/* A maze under one roof, lit by a torch that is carried round it: most of what the camera sees, in a chamber in its middle, has come round two
 * or three corners, so there is next to nothing to see with one bounce. The carrier goes round the northern corridors, past the chamber's door,
 * and back through the chamber; once round takes 40 seconds.
 *
 * The plan is of cells of 1.5 m, north above; walls are 2.4 m high and closed boxes, as are floor and roof. */
#include "sim/scenes/body_tools.h"

#include <string.h>

#include "platform/maths.h"

#define CELL 1.5f
#define HEIGHT 2.4f
enum { COLUMNS = 17, ROWS = 11, PERIOD = 40, KEYS = 64, BOX_TRIANGLES = 12, BOXES = 64 };

static const char plan[ROWS][COLUMNS + 1] = {
    "#################",
    "#...#.......#...#",
    "#.#.#.##.##.#.#.#",
    "#.#...#...#...#.#",
    "#.#####...#####.#",
    "#...............#",
    "#.#####...#####.#",
    "#.#...#...#...#.#",
    "#.#.#.##.##.#.#.#",
    "#...#.......#...#",
    "#################",
};

/* Corners of the torch's way, by column and row. */
static const float way[][2] = {{7, 1}, {11, 1}, {11, 3}, {13, 3}, {13, 1}, {15, 1}, {15, 5}, {8, 5}, {1, 5}, {1, 1}, {3, 1}, {3, 3}, {5, 3}, {5, 1}};
enum { CORNERS = sizeof way / sizeof way[0] };

static es_vec3 cell(float column, float row, float y) { return es_v3((column - 8.0f) * CELL, y, (row - 5.0f) * CELL); }

static float leg(uint32_t i) { return es_absf(way[(i + 1) % CORNERS][0] - way[i][0]) + es_absf(way[(i + 1) % CORNERS][1] - way[i][1]); }

/* At an even pace, corners cut by averaging over a cell and a half of the way; the hand goes up and down with the steps. */
static es_vec3 on_the_way(float distance)
{
    uint32_t i = 0;
    for (; distance >= leg(i) && i + 1 < CORNERS; i++) distance -= leg(i);
    float t = es_minf(distance / leg(i), 1.0f);
    const float *a = way[i], *b = way[(i + 1) % CORNERS];
    return cell(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), 0);
}

static void torch_pose(float phase, es_vec3* translation, es_quat* rotation)
{
    enum { SAMPLES = 9 };
    float length = 0.0f;
    for (uint32_t i = 0; i < CORNERS; i++) length += leg(i);
    es_vec3 sum = es_v3(0, 0, 0);
    for (int k = 0; k < SAMPLES; k++) {
        float at = phase * length + ((float)k - 0.5f * (SAMPLES - 1)) * (1.5f / SAMPLES);
        at -= length * es_floor(at / length);
        sum = es_v3_add(sum, on_the_way(at));
    }
    *translation = es_v3_scale(sum, 1.0f / SAMPLES);
    translation->y = 1.55f + 0.05f * es_sin(phase * 6.2831853f * 11.0f);
    *rotation = es_quat_identity();
}

static void add_box(es_scene_builder* builder, const char* name, es_vec3 low, es_vec3 high, es_material material)
{
    es_shape shape = es_build_shape(builder);
    es_shape_box(&shape, low, high);
    es_build_object(builder, name, &shape, material, es_v3(0, 0, 0));
}

/* One box for each run of wall cells in a row that no wall of the row above has taken along. */
static void add_walls(es_scene_builder* builder, es_material plaster, es_material brick, es_material blue)
{
    bool taken[ROWS][COLUMNS];
    memset(taken, 0, sizeof taken);
    for (uint32_t row = 0; row < ROWS; row++)
        for (uint32_t column = 0; column < COLUMNS; column++) {
            if (plan[row][column] != '#' || taken[row][column]) continue;
            uint32_t right = column, down = row;
            while (right + 1 < COLUMNS && plan[row][right + 1] == '#' && !taken[row][right + 1]) right++;
            if (right == column)
                while (down + 1 < ROWS && plan[down + 1][column] == '#' && !taken[down + 1][column]) down++;
            for (uint32_t r = row; r <= down; r++)
                for (uint32_t c = column; c <= right; c++) taken[r][c] = true;
            es_vec3 low = cell((float)column - 0.5f, (float)row - 0.5f, 0), high = cell((float)right + 0.5f, (float)down + 0.5f, HEIGHT);
            add_box(builder, "wall", low, high, column == 0 || (column == 1 && right == COLUMNS - 2) ? brick : column >= 13 ? blue : plaster);
        }
}

es_result es_scene_maze(es_world* world, uint32_t triangles)
{
    es_scene_builder builder = {world, ES_OK};
    es_material plaster = es_build_lambert(&builder, "plaster", 0.80f, 0.76f, 0.68f);
    es_material brick = es_build_lambert(&builder, "brick", 0.70f, 0.30f, 0.18f);
    es_material blue = es_build_lambert(&builder, "blue wash", 0.30f, 0.48f, 0.72f);
    es_material flags = es_build_lambert(&builder, "flags", 0.52f, 0.50f, 0.46f);
    es_material wood = es_build_lambert(&builder, "wood", 0.35f, 0.22f, 0.12f);
    es_material_desc gold_desc = es_default_material_desc();
    gold_desc.base_color[0] = 0.95f;
    gold_desc.base_color[1] = 0.76f;
    gold_desc.base_color[2] = 0.38f;
    gold_desc.metallic = 1;
    gold_desc.roughness = 0.4f;
    es_material gold = es_build_material(&builder, "gold", &gold_desc);
    es_material_desc flame_desc = es_default_material_desc();
    memset(flame_desc.base_color, 0, 3 * sizeof *flame_desc.base_color);
    flame_desc.emission[0] = 30;
    flame_desc.emission[1] = 14;
    flame_desc.emission[2] = 4;
    es_material flame = es_build_material(&builder, "flame", &flame_desc);

    const float t = 0.2f;
    es_vec3 low = cell(-0.5f, -0.5f, 0), high = cell((float)COLUMNS - 0.5f, (float)ROWS - 0.5f, HEIGHT);
    add_box(&builder, "floor", es_v3(low.x, -t, low.z), es_v3(high.x, 0, high.z), flags);
    add_box(&builder, "roof", es_v3(low.x, HEIGHT, low.z), es_v3(high.x, HEIGHT + t, high.z), plaster);
    add_walls(&builder, plaster, brick, blue);

    /* a knot on a plinth in the chamber, and balls where corridors end: what is left of the triangles, most of it the knot's */
    uint32_t rest = triangles ? triangles : 20000;
    rest = rest > BOXES * BOX_TRIANGLES + 800 ? rest - BOXES * BOX_TRIANGLES : 800;
    uint32_t around = (uint32_t)es_sqrt((float)rest * 0.6f * 0.5f / 12.0f), segments = (uint32_t)es_sqrt((float)rest * 0.4f / 8.0f * 0.25f);
    if (around < 4) around = 4;
    if (segments < 4) segments = 4;
    add_box(&builder, "plinth", es_v3(-0.35f, 0, -1.95f), es_v3(0.35f, 0.7f, -1.25f), plaster);
    es_shape knot = es_build_shape(&builder);
    es_shape_torus_knot(&knot, es_v3(0, 1.16f, -1.6f), 2, 3, 0.28f, 0.075f, around * 12, around);
    es_build_object(&builder, "knot", &knot, gold, es_v3(0, 0, 0));
    static const float balls[8][2] = {{1, 9}, {3, 7}, {13, 7}, {15, 9}, {5, 9}, {11, 9}, {7, 7.1f}, {9, 7.1f}};
    for (int i = 0; i < 8; i++) {
        es_shape ball = es_build_shape(&builder);
        es_shape_sphere(&ball, cell(balls[i][0], balls[i][1], 0.36f), 0.36f, segments * 2, segments);
        es_build_object(&builder, "ball", &ball, i % 2 ? blue : brick, es_v3(0, 0, 0));
    }

    es_vec3 start;
    es_quat level;
    torch_pose(0, &start, &level);
    es_node node = es_build_node(&builder, "torch", start, level);
    es_light_desc desc = es_default_light_desc();
    desc.type = ES_LIGHT_POINT;
    memcpy(desc.color, (const float[3]){1.0f, 0.62f, 0.28f}, sizeof desc.color);
    desc.intensity = 30;
    es_light light = es_build_light(&builder, "torch", node, &desc);
    es_build_mover(&builder, &(es_mover_desc){.name = "flicker", .type = ES_MOVER_FLICKER, .light = light, .period = 0.4f, .amplitude = 0.3f, .seed = 5});
    es_shape stick = es_build_shape(&builder), fire = es_build_shape(&builder);
    es_shape_cylinder(&stick, es_v3(0, -0.6f, 0), 0.03f, 0.5f, 12);
    es_build_instance(&builder, node, es_build_mesh(&builder, "stick", &stick), wood);
    es_shape_sphere(&fire, es_v3(0, 0.12f, 0), 0.05f, 12, 8);
    es_build_instance(&builder, node, es_build_mesh(&builder, "fire", &fire), flame);

    es_build_camera(&builder, cell(8, 8.2f, 1.5f), es_v3(0, -0.06f, -1), 1.15f, 0.05f);
    es_motion motions[] = {{node, torch_pose}};
    es_build_clip(&builder, "round", PERIOD, KEYS, motions, 1);
    return builder.result;
}
