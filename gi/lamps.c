#include "gi/lamps.h"

#include <string.h>

#include "gi/rest_area.h"
#include "gi/subsets.h"
#include "gi/surfels.h"
#include "platform/maths.h"
#include "platform/random.h"

/* How far above their surface lights stand, share of the extent: points of it are not to hide what lies in its own plane. */
#define LIFT_SHARE 1e-5f

/* A triangle whose radiance varies is cut into cells, CELLS_PER_LIGHT for each light that it may have, by MOST_LEVELS steps at most. */
enum { CELLS_PER_LIGHT = 4, MOST_LEVELS = 6, TAPS = 4 };

typedef struct lamp_cell {
    uint32_t instance, triangle;
    uint32_t level, index;     /* which of 4^level parts of the triangle */
    float radiance[3];
    double area, triangle_area;
    bool both_sides;
} lamp_cell;

typedef struct cell_list { lamp_cell* cells; uint32_t count; } cell_list;

static double luminance(const float c[3]) { return 0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2]; }

bool es_something_glows(const es_draw_list* list)
{
    for (uint32_t i = 0; i < list->instance_count; i++)
        if (luminance(list->materials[list->instances[i].material].emission) > 0.0) return true;
    return false;
}

/* ---- cells -------------------------------------------------------------------------------------------------------------------- */

static const float* rest_of(const es_raster_mesh* mesh) { return mesh->rest_positions ? mesh->rest_positions : mesh->positions; }

/* Corners, as barycentric coordinates, of a part of a triangle: each step of four has the middle third, then one at each corner. */
static void corners_of_part(uint32_t level, uint32_t index, float corner[3][2])
{
    static const float whole[3][2] = {{0, 0}, {1, 0}, {0, 1}};
    memcpy(corner, whole, sizeof whole);
    for (uint32_t l = level; l-- > 0;) {
        const uint32_t part = index >> (2 * l) & 3;
        float middle[3][2]; /* of the sides opposite the corners */
        for (int k = 0; k < 3; k++)
            for (int c = 0; c < 2; c++) middle[k][c] = 0.5f * (corner[(k + 1) % 3][c] + corner[(k + 2) % 3][c]);
        for (int k = 0; k < 3; k++) {
            if (part == 0) memcpy(corner[k], middle[k], sizeof middle[k]);
            else if (k != (int)part - 1) for (int c = 0; c < 2; c++) corner[k][c] = 0.5f * (corner[k][c] + corner[part - 1][c]);
        }
    }
}

/* A point of the unit square on a triangle, keeping areas (Heitz 2019). */
static void point_on(const float corner[3][2], float a, float b, float* u, float* v)
{
    if (b > a) {
        a *= 0.5f;
        b -= a;
    } else {
        b *= 0.5f;
        a -= b;
    }
    *u = corner[0][0] + a * (corner[1][0] - corner[0][0]) + b * (corner[2][0] - corner[0][0]);
    *v = corner[0][1] + a * (corner[1][1] - corner[0][1]) + b * (corner[2][1] - corner[0][1]);
}

static uint32_t packed(float u, float v) { return (uint32_t)(es_clampf(u, 0, 1) * 65535.0f + 0.5f) | (uint32_t)(es_clampf(v, 0, 1) * 65535.0f + 0.5f) << 16; }

static bool varies(const es_material_desc* m) { return m->emission_texture.image || m->alpha_mask || m->blend; }

static void measure_radiance(const es_raster_mesh* mesh, const es_material_desc* m, lamp_cell* cell)
{
    memcpy(cell->radiance, m->emission, sizeof cell->radiance);
    if (!varies(m)) return;
    float corner[3][2], u, v;
    corners_of_part(cell->level, cell->index, corner);
    es_vec3 sum = es_v3(0, 0, 0);
    for (uint32_t i = 0; i < TAPS * TAPS; i++) {
        point_on((const float(*)[2])corner, ((float)(i % TAPS) + 0.5f) / TAPS, ((float)(i / TAPS) + 0.5f) / TAPS, &u, &v);
        if ((m->alpha_mask || m->blend) && es_surfel_read(mesh, m, cell->triangle, packed(u, v)).hole) continue;
        sum = es_v3_add(sum, es_surfel_emission(mesh, m, cell->triangle, packed(u, v)));
    }
    cell->radiance[0] = sum.x * (1.0f / (TAPS * TAPS));
    cell->radiance[1] = sum.y * (1.0f / (TAPS * TAPS));
    cell->radiance[2] = sum.z * (1.0f / (TAPS * TAPS));
}

/* Steps of four by which a triangle with that share of the lights is cut. */
static uint32_t levels_of(double lights)
{
    uint32_t level = 0;
    for (double cells = 1.0; cells < CELLS_PER_LIGHT * lights && level < MOST_LEVELS; cells *= 4.0) level++;
    return level;
}

/* Calls for each triangle of each glowing instance, in order: counts cells, or makes them. Sums the luminance of all, as if no texture dimmed it. */
static double visit_triangles(const es_lamp_request* request, double whole, cell_list* list)
{
    double sum = 0.0;
    list->count = 0;
    for (uint32_t i = 0; i < request->list->instance_count; i++) {
        const es_raster_instance* instance = &request->list->instances[i];
        const es_material_desc* m = &request->list->materials[instance->material];
        const double strength = luminance(m->emission) * (m->double_sided ? 2.0 : 1.0);
        if (!(strength > 0.0)) continue;
        double gram[6];
        es_gram_of(&instance->transform, gram);
        for (uint32_t t = 0; t < instance->mesh->triangle_count; t++) {
            const double area = es_area_by_gram(rest_of(instance->mesh), instance->mesh->indices + 3 * (size_t)t, gram);
            if (!(area > 0.0)) continue;
            sum += area * strength;
            const uint32_t level = varies(m) && whole > 0.0 ? levels_of(area * strength / whole * request->count) : 0, parts = 1u << 2 * level;
            for (uint32_t k = 0; k < parts && list->cells; k++)
                list->cells[list->count + k] = (lamp_cell){.instance = i, .triangle = t, .level = level, .index = k, .area = area / parts, .triangle_area = area, .both_sides = m->double_sided};
            list->count += parts;
        }
    }
    return sum;
}

typedef struct measuring { const es_draw_list* list; lamp_cell* cells; } measuring;

static void measure_cells(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const measuring* job = user;
    for (uint32_t i = begin; i < end; i++) {
        const es_raster_instance* instance = &job->list->instances[job->cells[i].instance];
        measure_radiance(instance->mesh, &job->list->materials[instance->material], &job->cells[i]);
    }
}

static es_result list_cells(es_context* context, es_arena* arena, const es_lamp_request* request, cell_list* list)
{
    *list = (cell_list){0};
    const double whole = visit_triangles(request, 0.0, list);
    visit_triangles(request, whole, list);
    list->cells = es_arena_allocate(arena, ((size_t)list->count + 1) * sizeof *list->cells);
    if (!list->cells) return es_context_last_result(context);
    visit_triangles(request, whole, list);
    measuring job = {request->list, list->cells};
    es_parallel_for(context, list->count, 256, measure_cells, &job);
    return ES_OK;
}

/* ---- places ---------------------------------------------------------------------------------------------------------------------- */

static uint32_t reversed(uint32_t x)
{
    x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
    x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
    x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
    x = (x >> 8 & 0x00ff00ffu) | (x & 0x00ff00ffu) << 8;
    return x >> 16 | x << 16;
}

/* Radical inverse of base 2 with its digits scrambled, each by those before it (Owen 1995; the hash of Laine and Karras 2011, with the
 * constants of Burley 2020): aligned runs of 2^k numbers have one in each 2^k-th. */
static uint32_t scrambled_inverse(uint32_t x, uint32_t seed)
{
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reversed(x);
}

/* Steps along the sum, 0 … count - 1, in the order of the lights. */
static uint32_t* order_of(es_arena* arena, const es_lamp_request* request, uint32_t count)
{
    uint32_t bits = 0;
    while (bits < 31 && 1u << bits < count) bits++;
    uint32_t* number = es_arena_allocate(arena, ((size_t)1 << bits) * sizeof *number);
    uint32_t* step = number ? es_arena_allocate(arena, ((size_t)1 << bits) * sizeof *step) : NULL;
    if (!step) return NULL;
    for (uint32_t j = 0; j < 1u << bits; j++) number[bits ? scrambled_inverse(j, es_hash_u32(request->seed)) >> (32 - bits) : 0] = j;
    uint32_t rank = 0;
    for (uint32_t k = 0; k < 1u << bits; k++)
        if (number[k] < count) step[number[k]] = rank++;
    return step;
}

static es_lamp_place place_in(const lamp_cell* cell, double share, float v, double step)
{
    const double strength = luminance(cell->radiance);
    es_lamp_place place = {.instance = cell->instance, .triangle = cell->triangle, .area = step / strength, .triangle_area = cell->triangle_area};
    memcpy(place.radiance, cell->radiance, sizeof place.radiance);
    if (cell->both_sides) {
        place.back = share >= 0.5;
        share = 2.0 * share - (place.back ? 1.0 : 0.0);
    }
    float corner[3][2];
    corners_of_part(cell->level, cell->index, corner);
    point_on((const float(*)[2])corner, es_clampf((float)share, 0.0f, 1.0f), v, &place.u, &place.v);
    return place;
}

static double weight_of(const lamp_cell* cell) { return luminance(cell->radiance) * cell->area * (cell->both_sides ? 2.0 : 1.0); }

static double sky_power_of(const es_lamp_request* request)
{
    if (!request->environment || !request->environment->memory) return 0.0;
    const double* p = request->environment->power;
    const double radius = 0.5 * (double)request->extent, power = 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
    return power * radius * radius * (double)ES_PI;
}

/* Lights of the surfaces among request->count. */
static uint32_t share_of(double power, const es_lamp_request* request)
{
    enum { PARTS = 8 };
    const double sky = sky_power_of(request);
    if (!(power > 0.0)) return 0;
    if (!(sky > 0.0)) return request->count;
    const double parts = power / (power + sky) * PARTS;
    const uint32_t whole = parts < 1.0 ? 1 : parts > PARTS - 1 ? PARTS - 1 : (uint32_t)(parts + 0.5);
    return request->count * whole / PARTS;
}

static es_result place_lights(es_context* context, es_lamps* lamps, const es_lamp_request* request)
{
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    cell_list list;
    es_result result = list_cells(context, &arena, request, &list);
    lamps->glowing = 0;
    lamps->power = 0.0;
    double* sums = result ? NULL : es_arena_allocate(&arena, ((size_t)list.count + 1) * sizeof *sums); /* before each cell */
    if (!result && !sums) result = es_context_last_result(context);
    double sum = 0.0;
    for (uint32_t i = 0; i < list.count && !result; i++) {
        sums[i] = sum;
        sum += weight_of(&list.cells[i]);
    }
    if (!result && sum > 0.0 && sum < 1e30) lamps->power = sum * (double)ES_PI;
    const uint32_t count = share_of(lamps->power, request);
    uint32_t* order = result || !count ? NULL : order_of(&arena, request, count);
    if (!result && count && !order) result = es_context_last_result(context);
    if (!result && count && !es_grow(context, (void**)&lamps->places, &lamps->place_capacity, 0, count, sizeof *lamps->places)) result = es_context_last_result(context);
    const double step = count ? sum / count : 0.0;
    for (uint32_t v = 0; v < count && !result; v++) {
        const uint32_t k = order[es_place_in_sequence(v, count, request->subsets)];
        const double at = ((double)k + 0.5) * step;
        uint32_t low = 0, high = list.count;
        while (high - low > 1) {
            const uint32_t middle = low + (high - low) / 2;
            if (sums[middle] <= at) low = middle;
            else high = middle;
        }
        lamps->places[v] = place_in(&list.cells[low], (at - sums[low]) / weight_of(&list.cells[low]), (float)((k * 2654435769u) >> 8) * (1.0f / 16777216.0f), step);
    }
    if (!result) lamps->glowing = count;
    es_arena_free(&arena);
    return result;
}

/* ---- records ----------------------------------------------------------------------------------------------------------------------- */

static es_vpl_record record_of(const es_lamp_place* place, const es_lamp_request* request)
{
    const es_raster_instance* instance = &request->list->instances[place->instance];
    const uint32_t* index = instance->mesh->indices + 3 * (size_t)place->triangle;
    es_vec3 c[3];
    for (int k = 0; k < 3; k++) {
        const float* p = instance->mesh->positions + 4 * (size_t)index[k];
        c[k] = es_mat4_point(&instance->transform, es_v3(p[0], p[1], p[2]));
    }
    const es_vec3 ab = es_v3_sub(c[1], c[0]), ac = es_v3_sub(c[2], c[0]), across = es_v3_cross(ab, ac);
    es_vec3 normal = es_v3_normalize(across, es_v3(0, 1, 0)), tangent, bitangent;
    if ((es_mat4_determinant3(&instance->transform) < 0.0f) != place->back) normal = es_v3_scale(normal, -1.0f);
    es_orthonormal_basis(normal, &tangent, &bitangent);
    const es_vec3 position = es_v3_add(es_v3_add(c[0], es_v3_add(es_v3_scale(ab, place->u), es_v3_scale(ac, place->v))), es_v3_scale(normal, LIFT_SHARE * request->extent));
    const double area = place->area * (0.5 * (double)es_v3_length(across) / place->triangle_area);
    const float exitance = (float)((double)ES_PI * (area < 1e30 ? area : 1e30));
    return (es_vpl_record){
        .position = {position.x, position.y, position.z},
        .normal = {normal.x, normal.y, normal.z},
        .tangent = {tangent.x, tangent.y, tangent.z},
        .bitangent = {bitangent.x, bitangent.y, bitangent.z},
        .flux = {place->radiance[0] * exitance, place->radiance[1] * exitance, place->radiance[2] * exitance},
        .incident = {normal.x, normal.y, normal.z}, /* rays end on the side that glows */
        .area = (float)area,
        .roughness = 1.0f,
        .model = ES_SURFACE_METALLIC_ROUGHNESS,
    };
}

/* Into how many a light is split that the pattern is to spread over its subsets; all lights together into no more than twice their number. */
static uint32_t parts_of(const es_environment_light* light, double mean, const es_lamp_request* request)
{
    const double parts = luminance(light->irradiance) / mean;
    return request->subsets == 1 || !(parts > 1.0001) ? 1 : (uint32_t)parts + 1;
}

static es_vpl_record record_of_sky(const es_environment_light* light, const es_lamp_request* request)
{
    const es_vec3 normal = es_v3_scale(light->direction, -1.0f), position = es_v3_add(request->centre, es_v3_scale(light->direction, 0.5f * request->extent));
    es_vec3 tangent, bitangent;
    es_orthonormal_basis(normal, &tangent, &bitangent);
    return (es_vpl_record){
        .position = {position.x, position.y, position.z},
        .normal = {normal.x, normal.y, normal.z},
        .tangent = {tangent.x, tangent.y, tangent.z},
        .bitangent = {bitangent.x, bitangent.y, bitangent.z},
        .flux = {ES_PI * light->irradiance[0], ES_PI * light->irradiance[1], ES_PI * light->irradiance[2]},
        .incident = {normal.x, normal.y, normal.z},
        .roughness = 1.0f,
        .model = ES_SURFACE_METALLIC_ROUGHNESS,
        .parallel = true,
    };
}

/* As records, for maps, in the order of the curve; and for the pattern, in parts of no more than the mean, in an order like that of the surfaces' lights. */
static es_result add_sky(es_context* context, es_lamps* lamps, const es_lamp_request* request)
{
    const uint32_t first = lamps->glowing, wanted = sky_power_of(request) > 0.0 ? request->count - first : 0;
    es_arena arena;
    es_arena_init(&arena, context, 1 << 16);
    es_environment_light* lights = es_arena_allocate(&arena, ((size_t)wanted + 1) * sizeof *lights);
    const uint32_t count = lights && wanted ? es_environment_sample(request->environment, wanted, request->seed, lights) : 0;
    uint32_t* parts = lights ? es_arena_allocate(&arena, ((size_t)2 * count + 1) * sizeof *parts) : NULL; /* lights of parts */
    double mean = 0.0;
    for (uint32_t v = 0; v < count; v++) mean += luminance(lights[v].irradiance) / count;
    uint32_t part_count = 0;
    for (uint32_t v = 0; v < count && parts; v++) {
        lamps->records[first + v] = record_of_sky(&lights[v], request);
        for (uint32_t k = parts_of(&lights[v], mean, request); k && part_count < 2 * count; k--) parts[part_count++] = v;
    }
    const uint32_t* order = part_count ? order_of(&arena, request, part_count) : NULL;
    es_result result = !parts || (part_count && !order) ? es_context_last_result(context) : ES_OK;
    const size_t shaded = (size_t)first + part_count;
    if (!result && !es_grow(context, (void**)&lamps->shaded, &lamps->shaded_capacity, 0, shaded, sizeof *lamps->shaded)) result = es_context_last_result(context);
    if (!result && !es_grow(context, (void**)&lamps->map_of, &lamps->map_capacity, 0, shaded, sizeof *lamps->map_of)) result = es_context_last_result(context);
    lamps->count = first + (result ? 0 : count);
    lamps->shaded_count = result ? 0 : (uint32_t)shaded;
    for (uint32_t v = 0; v < lamps->shaded_count; v++) {
        const uint32_t light = v < first ? 0 : parts[order[es_place_in_sequence(v - first, part_count, request->subsets)]];
        lamps->map_of[v] = v < first ? v : first + light;
        lamps->shaded[v] = lamps->records[lamps->map_of[v]];
        const float share = v < first ? 1.0f : 1.0f / (float)parts_of(&lights[light], mean, request);
        for (int k = 0; k < 3; k++) lamps->shaded[v].flux[k] *= share;
    }
    es_arena_free(&arena);
    return result;
}

/* ---- both ----------------------------------------------------------------------------------------------------------------------------- */

static uint64_t key_of(const es_lamp_request* request)
{
    const uint64_t words[] = {request->count, request->subsets, request->seed, request->materials, request->list->instance_count};
    uint64_t key = es_hash_bytes(1, words, sizeof words);
    for (uint32_t i = 0; i < request->list->instance_count; i++) {
        const es_raster_instance* instance = &request->list->instances[i];
        if (!(luminance(request->list->materials[instance->material].emission) > 0.0)) continue;
        const es_raster_mesh* mesh = instance->mesh;
        double gram[6];
        es_gram_of(&instance->transform, gram);
        const uint64_t of_mesh[] = {i, instance->material, mesh->triangle_count, mesh->rest_revision ? mesh->rest_revision : mesh->revision};
        key = es_hash_bytes(es_hash_bytes(key, of_mesh, sizeof of_mesh), gram, sizeof gram);
    }
    return key | 1;
}

es_result es_lamps_update(es_context* context, es_lamps* lamps, const es_lamp_request* request)
{
    const uint64_t key = key_of(request);
    if (key != lamps->key || share_of(lamps->power, request) != lamps->glowing) {
        lamps->key = 0;
        es_result result = place_lights(context, lamps, request);
        if (result) return result;
        lamps->key = key;
    }
    lamps->count = lamps->glowing;
    if (!es_grow(context, (void**)&lamps->records, &lamps->record_capacity, 0, request->count, sizeof *lamps->records)) return es_context_last_result(context);
    for (uint32_t v = 0; v < lamps->glowing; v++) lamps->records[v] = record_of(&lamps->places[v], request);
    return add_sky(context, lamps, request);
}

void es_lamps_free(es_context* context, es_lamps* lamps)
{
    es_release(context, lamps->records, lamps->record_capacity * sizeof *lamps->records);
    es_release(context, lamps->places, lamps->place_capacity * sizeof *lamps->places);
    es_release(context, lamps->shaded, lamps->shaded_capacity * sizeof *lamps->shaded);
    es_release(context, lamps->map_of, lamps->map_capacity * sizeof *lamps->map_of);
    *lamps = (es_lamps){0};
}
