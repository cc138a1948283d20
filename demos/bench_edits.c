/* `bench edits`: reflection editing (Ritschel thesis §7.6.2): directions interpolated per second, and whole frames of scenes whose reflections are edited. */
#include <math.h>

#include "bench_sitting.h"

static const bench_row table[] = {
    {"edits-1", "1280×960, one constraint in a region over the whole picture: directions edited", "Mpixel/s", NULL, BENCH_VALUE_AT_LEAST, 12, 24.5},
    {"edits-32", "the same with 32 constraints", "Mpixel/s", NULL, BENCH_VALUE_AT_LEAST, 9, 18.5},
    {"edits-rokeby", "rokeby, 1280×960: a frame as the camera moves, reflections edited", "ms", NULL, BENCH_VALUE_AT_MOST, 100, 34},
    {"edits-kitchen", "kitchen, 1280×960: a frame as things and the camera move, reflections edited", "ms", NULL, BENCH_VALUE_AT_MOST, 150, 60},
    {"edits-rokeby-drag", "rokeby, 1280×960: a frame as a green handle is dragged and nothing else moves", "ms", NULL, BENCH_VALUE_AT_MOST, 100, 34},
};

size_t bench_edits_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, sizeof table / sizeof table[0], rows, capacity); }

/* ---- directions ------------------------------------------------------------------------------------------------------------------- */

static bool remove_edits(es_world* world)
{
    static const es_object_kind kinds[] = {ES_OBJECT_CONSTRAINT, ES_OBJECT_REGION};
    for (int k = 0; k < 2; k++) {
        uint32_t ids[256];
        size_t count = 256;
        if (es_world_enumerate(world, kinds[k], ids, &count) != ES_OK) return false;
        for (size_t i = 0; i < count; i++)
            if ((k ? es_world_destroy_region(world, (es_region){ids[i]}) : es_world_destroy_constraint(world, (es_constraint){ids[i]})) != ES_OK) return false;
    }
    return true;
}

/* Constraints all over a sphere of lines of sight from the scene's middle. */
static bool add_edits(es_world* world, uint32_t count)
{
    es_vec3 low, high;
    es_region_desc region = es_default_region_desc();
    es_region added;
    if (!es_world_bounds(world, &low, &high)) return false;
    region.centre.kind = ES_ANCHOR_POINT;
    region.radius = 1e3f;
    if (es_world_add_region(world, &region, &added) != ES_OK) return false;
    const double middle[3] = {0.5 * (double)(low.x + high.x), 0.5 * (double)(low.y + high.y), 0.5 * (double)(low.z + high.z)};
    for (uint32_t i = 0; i < count; i++) {
        const float z = 1 - 2 * ((float)i + 0.5f) / (float)count, r = sqrtf(1 - z * z), a = 2.3999632f * (float)i;
        es_constraint_desc desc = es_default_constraint_desc();
        es_constraint constraint;
        if (es_world_anchor_of_ray(world, middle, (es_vec3){r * cosf(a), z, r * sinf(a)}, 1e6f, &desc.reflecting) != ES_OK) return false;
        if (desc.reflecting.kind != ES_ANCHOR_SURFACE) continue;
        desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {middle[0] + 0.3 * cos((double)i), middle[1] + 0.3, middle[2] + 0.3 * sin((double)i)}};
        for (int k = 0; k < 3; k++) desc.eye[k] = middle[k];
        if (es_world_add_constraint(world, &desc, &constraint) != ES_OK) return false;
    }
    return true;
}

static bool measure_directions(bench_sitting* bench, es_world* world, uint32_t constraints)
{
    enum { MOST = 32 };
    bench_row* row = sitting_row(bench, "edits-%u", constraints);
    if (!row) return true;
    double rates[MOST];
    es_renderer* renderer = sitting_open_renderer(bench, "gi=none");
    bool works = renderer && remove_edits(world) && add_edits(world, constraints) && es_world_step(world, 0) == ES_OK;
    for (int i = -1; i < (int)bench->frames && works; i++) {
        uint64_t pixels = 0;
        works = sitting_render(bench, renderer, world) > 0;
        const double time = works ? sitting_pass(renderer, "reflection edits", &pixels) : 0;
        if (i >= 0 && works) rates[i] = (double)pixels / time * 1e-3;
    }
    if (works) row->value = bench_median(rates, bench->frames);
    es_renderer_destroy(renderer);
    return works;
}

/* ---- frames ------------------------------------------------------------------------------------------------------------------------ */

/* The scene's own settings; work is skipped where it may be. */
static es_renderer* open_renderer(bench_sitting* bench, const char* scene)
{
    es_renderer_settings settings = es_default_renderer_settings();
    es_renderer* renderer = NULL;
    for (const char* const* text = es_scene_settings(scene); text && *text; text++)
        if (!error_apply(bench->context, &(error_setting){.settings = *text}, &settings)) return NULL;
    settings.width = bench->width;
    settings.height = bench->height;
    if (es_renderer_create(bench->context, &settings, &renderer) == ES_OK) return renderer;
    demo_refuse_context(bench->context);
    return NULL;
}

/* A little from side to side, about where it is. */
static bool move_camera(es_world* world, const es_transform* from, es_node node, int frame)
{
    es_transform to = *from;
    to.translation.x += 0.02f * sinf(0.7f * (float)frame);
    to.translation.y += 0.01f * sinf(0.4f * (float)frame);
    return es_world_set_node_transform(world, node, &to) == ES_OK;
}

static bool drag(es_world* world, int frame)
{
    uint32_t id;
    size_t count = 1;
    es_constraint_desc desc;
    if (es_world_enumerate(world, ES_OBJECT_CONSTRAINT, &id, &count) != ES_OK || !count || es_world_get_constraint(world, (es_constraint){id}, &desc) != ES_OK) return false;
    double at[3];
    if (!es_world_resolve_anchor(world, &desc.reflected, at, NULL)) return false;
    desc.reflected = (es_anchor){.kind = ES_ANCHOR_POINT, .point = {at[0] + 0.01 * (frame % 2 ? 1 : -1), at[1], at[2]}};
    return es_world_set_constraint(world, (es_constraint){id}, &desc) == ES_OK;
}

static bool measure_frames(bench_sitting* bench, const char* scene, bool dragged)
{
    enum { MOST = 32 };
    bench_row* row = sitting_row(bench, "edits-%s%s", scene, dragged ? "-drag" : "");
    if (!row) return true;
    es_world* world = sitting_open_scene(bench, scene);
    es_renderer* renderer = world ? open_renderer(bench, scene) : NULL;
    es_camera_desc camera;
    es_transform pose;
    bool works = renderer && es_world_get_camera(world, es_world_active_camera(world), &camera) == ES_OK && es_world_get_node_transform(world, camera.node, &pose) == ES_OK;
    double frames[MOST], edits[MOST];
    for (int i = -2; i < (int)bench->frames && works; i++) {
        works = (dragged ? drag(world, i + 2) : move_camera(world, &pose, camera.node, i)) && es_world_step(world, dragged ? 0 : 1.0f / 30) == ES_OK;
        const double time = works ? sitting_render(bench, renderer, world) : NAN;
        works = works && time > 0;
        if (i < 0 || !works) continue;
        frames[i] = time;
        edits[i] = sitting_pass(renderer, "reflection edits", NULL);
    }
    if (works) {
        row->value = bench_median(frames, bench->frames);
        snprintf(row->note, sizeof row->note, "%.3g ms of it to find the directions", bench_median(edits, bench->frames));
    } else if (renderer) demo_refuse_context(bench->context);
    es_renderer_destroy(renderer);
    if (world) es_world_destroy(world);
    return works;
}

int bench_edits(const bench_options* options)
{
    bench_sitting* bench = sitting_open(options, bench_edits_rows, 1280, 960);
    if (!bench) return DEMO_BAD_INPUT;
    bench->report = (bench_report){.name = "edits", .title = "Edited reflections", .about = "Directions interpolated between an artist's constraints by moving least squares, and frames of scenes whose reflections are edited."};
    es_world* world = sitting_open_scene(bench, "cornell");
    bool works = world && measure_directions(bench, world, 1) && measure_directions(bench, world, 32);
    if (world) es_world_destroy(world);
    works = works && measure_frames(bench, "rokeby", false) && measure_frames(bench, "kitchen", false) && measure_frames(bench, "rokeby", true);
    return sitting_close(bench, works);
}
