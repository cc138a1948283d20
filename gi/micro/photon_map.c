#include "gi/micro/photon_map.h"

#include <string.h>

#include "gi/micro/leaf_grid.h"
#include "gi/reference/light_choice.h"
#include "gi/reference/light_vertices.h"
#include "gi/reference/path.h"
#include "platform/random.h"
#include "raster/pack.h"

/* ---- photons ------------------------------------------------------------------------------------------------------------------------- */

enum { GRAIN = 256, NO_TREE = 0xffffffffu };

/* One place where a photon landed. */
typedef struct photon { float position[3], power[3]; uint32_t normal, tree; } photon;

typedef struct photon_loop {
    const es_photon_job* job;
    const es_light_emissions* lights;
    const uint32_t* trees;        /* of each instance: of its front, of its back; NO_TREE: there is none */
    photon* photons;              /* `bounces` of each path, or bounces + 1 of glowing surfaces' */
    uint32_t of_lights, places;   /* paths from lights, the others are from glowing surfaces; photons of a path */
    uint64_t *rays, *stored;      /* of each chunk */
} photon_loop;

/* Pairs of dimensions: the first two of the emission, then of each vertex. */
enum { PAIR_PLACE, PAIR_DIRECTION, PAIR_FIRST_VERTEX };

typedef struct flight { es_trace_surface at; es_vec3 wo, power; } flight;

static float highest(es_vec3 a) { return es_maxf(a.x, es_maxf(a.y, a.z)); }

/* Of a photon's power what a surface with this normal is said to receive: shading normals tilt, surfaces do not. */
static float tilt(float shading, float geometric) { return es_clampf(shading / es_maxf(geometric, 1e-6f), 0.0f, 4.0f); }

static bool from_light(const photon_loop* loop, uint32_t path, flight* f, uint64_t* rays)
{
    float u[2];
    uint32_t traced = 0;
    es_light_vertex v;
    if (!loop->lights->scene) return false;
    es_path_numbers(loop->job->seed, PAIR_PLACE, path, u);
    const bool met = es_light_vertex_sample(loop->lights, u, es_random_u32(loop->job->seed, path), &v, &traced);
    *rays += traced;
    if (!met) return false;
    const es_light_state* light = &loop->job->scene->lights[v.light];
    es_vec3 towards;
    float distance, strength;
    if (!es_trace_towards_light(light, v.surface.position, &towards, &distance, &strength)) return false;
    const float density = es_light_vertex_density(loop->lights, v.light, &v.surface, v.towards_light, distance);
    const float share = v.strength * es_v3_dot(v.surface.normal, v.towards_light) / (density * (float)loop->of_lights);
    *f = (flight){v.surface, v.towards_light, es_v3(light->radiant[0] * share, light->radiant[1] * share, light->radiant[2] * share)};
    return true;
}

/* Flies on from where the flight stands: to the next surface. False when there is none, or none that reflects. */
static bool fly(const photon_loop* loop, es_vec3 direction, flight* f, uint64_t* rays)
{
    const es_vec3 o = es_offset_origin(f->at.position, f->at.geometric);
    const es_ray ray = {{o.x, o.y, o.z}, 0.0f, {direction.x, direction.y, direction.z}, 3e38f};
    es_hit hit;
    ++*rays;
    if (!es_trace_closest(loop->job->scene, ray, false, &hit)) return false;
    f->wo = es_v3_scale(direction, -1.0f);
    es_trace_surface_at(loop->job->scene, &hit, f->wo, false, &f->at);
    const float shading = es_v3_dot(f->at.normal, f->wo);
    if (!f->at.reflects || !(shading > 0.0f)) return false;
    f->power = es_v3_scale(f->power, tilt(shading, es_v3_dot(f->at.geometric, f->wo)));
    return true;
}

/* Leaves a glowing surface by its cosine, and flies to the first that reflects it. */
static bool from_glow(const photon_loop* loop, uint32_t path, uint32_t paths, flight* f, uint64_t* rays)
{
    const es_trace_scene* scene = loop->job->scene;
    float place[2], direction[2], choice = es_unit_float(es_random_u32(loop->job->seed ^ 0x7feb352du, path));
    es_path_numbers(loop->job->seed ^ 0x846ca68bu, PAIR_PLACE, path, place);
    es_path_numbers(loop->job->seed ^ 0x846ca68bu, PAIR_DIRECTION, path, direction);
    /* evenly over the running sums, so that each triangle has its share of photons; the number that is left over is as good as a fresh one */
    choice = (choice + (float)path) / (float)paths;
    uint32_t low = 0, high = scene->emitter_count - 1;
    while (low < high) {
        const uint32_t middle = (low + high) / 2;
        if (choice < scene->emitter_sums[middle]) high = middle;
        else low = middle + 1;
    }
    const uint32_t primitive = scene->emitters[low];
    const es_material_desc* m = &scene->materials[scene->instances[es_bvh_primitives(scene->bvh)[primitive].instance].material];
    const float mean = 0.2126f * m->emission[0] + 0.7152f * m->emission[1] + 0.0722f * m->emission[2], root = es_sqrt(place[0]);
    const es_hit hit = {0.0f, root * (1.0f - place[1]), root * place[1], primitive};
    if (scene->has_masks && es_trace_is_hole(scene, &hit)) return false;
    es_vec3 c[3], t, b;
    es_bvh_triangle(scene->bvh, primitive, c);
    es_vec3 n = es_v3_normalize(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])), es_v3(0, 1, 0));
    float sides = 1.0f;
    if (m->double_sided) {
        if (direction[0] < 0.5f) n = es_v3_scale(n, -1.0f);
        direction[0] = 2.0f * (direction[0] < 0.5f ? direction[0] : direction[0] - 0.5f);
        sides = 2.0f;
    } else if (es_mat4_determinant3(&scene->instances[es_bvh_primitives(scene->bvh)[primitive].instance].transform) < 0.0f) {
        n = es_v3_scale(n, -1.0f);
    }
    es_trace_surface_at(scene, &hit, n, false, &f->at);
    es_orthonormal_basis(f->at.geometric, &t, &b);
    float sine, cosine, r = es_sqrt(direction[0]), z = es_sqrt(1.0f - direction[0]);
    es_sincos(2.0f * ES_PI * direction[1], &sine, &cosine);
    if (!(z > 1e-6f)) return false;
    f->power = es_v3_scale(f->at.emission, ES_PI * sides * (float)scene->emitter_total / (mean * (float)paths));
    return highest(f->power) > 0.0f && fly(loop, es_v3_normalize(es_v3_add(es_v3_add(es_v3_scale(t, r * cosine), es_v3_scale(b, r * sine)), es_v3_scale(f->at.geometric, z)), f->at.geometric), f, rays);
}

static void put_down(const photon_loop* loop, const flight* f, photon* p, uint64_t* stored)
{
    const es_trace_scene* scene = loop->job->scene;
    const es_bvh_primitive* primitive = &es_bvh_primitives(scene->bvh)[f->at.primitive];
    es_vec3 c[3];
    es_bvh_triangle(scene->bvh, f->at.primitive, c);
    const bool winding = es_v3_dot(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])), f->at.geometric) >= 0.0f;
    const bool front = winding == !(es_mat4_determinant3(&scene->instances[primitive->instance].transform) < 0.0f);
    *p = (photon){{f->at.position.x, f->at.position.y, f->at.position.z}, {f->power.x, f->power.y, f->power.z}, es_pack_normal(f->at.normal), loop->trees[2 * (size_t)primitive->instance + !front]};
    *stored += p->tree != NO_TREE;
}

static void trace(const photon_loop* loop, uint32_t path, photon* photons, uint64_t* rays, uint64_t* stored)
{
    const es_photon_job* job = loop->job;
    const bool glows = path >= loop->of_lights;
    const uint32_t number = glows ? path - loop->of_lights : path, seed = glows ? job->seed ^ 0x846ca68bu : job->seed;
    flight f;
    for (uint32_t i = 0; i < loop->places; i++) photons[i].tree = NO_TREE;
    if (!(glows ? from_glow(loop, number, job->photons, &f, rays) : from_light(loop, number, &f, rays))) return;
    /* of glowing surfaces the first light counts too, for nothing else brings it */
    if (glows) put_down(loop, &f, photons++, stored);
    for (uint32_t b = 0; b < job->bounces; b++) {
        float u[2], choice[2];
        es_surface_sample next;
        es_path_numbers(seed, PAIR_FIRST_VERTEX + 2 * b, number, u);
        es_path_numbers(seed, PAIR_FIRST_VERTEX + 2 * b + 1, number, choice);
        const float three[3] = {choice[0], u[0], u[1]};
        if (!es_surface_sample_direction(&f.at.surface, f.at.normal, f.wo, three, &next)) return;
        const float above = es_v3_dot(f.at.geometric, next.wi);
        if (!(above > 0.0f)) return;
        const es_vec3 weight = es_v3_scale(next.weight, tilt(above, es_v3_dot(f.at.normal, next.wi)));
        /* what is left of the power is left of the chance to go on: photons stay alike */
        const float keep = es_minf(highest(weight), 1.0f);
        if (!(choice[1] < keep)) return;
        f.power = es_v3_scale(es_v3_mul(f.power, weight), 1.0f / keep);
        if (!fly(loop, next.wi, &f, rays)) return;
        put_down(loop, &f, photons++, stored);
    }
}

static void trace_chunk(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const photon_loop* loop = user;
    (void)worker;
    uint64_t rays = 0, stored = 0;
    for (uint32_t i = begin; i < end; i++) trace(loop, i, loop->photons + (size_t)i * loop->places, &rays, &stored);
    loop->rays[begin / GRAIN] = rays;
    loop->stored[begin / GRAIN] = stored;
}

/* ---- from photons to leaves ------------------------------------------------------------------------------------------------------------ */

typedef struct owner_loop { const es_point_forest* forest; const es_point_level* level; uint32_t* owner; } owner_loop;

static void find_owners(void* user, const es_leaf_range* range, uint32_t worker)
{
    const owner_loop* loop = user;
    (void)worker;
    for (uint32_t i = 0; i < range->count; i++) loop->owner[range->leaf + i] = es_point_level_owner(loop->level, loop->forest, range->tree, range->leaf + i);
}

typedef struct landing_loop { const es_leaf_grid* grid; const photon* photons; const uint32_t* owner; uint32_t* samples; uint32_t places; } landing_loop;

static size_t landed_on(const es_leaf_grid* grid, const photon* p)
{
    return es_leaf_grid_nearest(grid, p->tree, es_v3(p->position[0], p->position[1], p->position[2]), es_unpack_normal(p->normal));
}

static void find_samples(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const landing_loop* loop = user;
    (void)worker;
    for (size_t i = (size_t)begin * loop->places; i < (size_t)end * loop->places; i++)
        if (loop->photons[i].tree != NO_TREE) loop->samples[i] = loop->owner[landed_on(loop->grid, &loop->photons[i])];
}

/* Power and area of each sample of the level, both by the same nearest leaf. */
static es_result gather_power(es_context* context, es_arena* arena, const es_point_forest* f, const es_point_level* level, const photon* photons, uint32_t paths, uint32_t places, float* power[3], float* areas)
{
    es_leaf_grid grid;
    es_result result = es_leaf_grid_make(arena, f, &grid);
    uint32_t* owner = result ? NULL : es_arena_allocate(arena, (f->leaf_count + 1) * sizeof *owner);
    uint32_t* samples = owner ? es_arena_allocate(arena, ((size_t)paths * places + 1) * sizeof *samples) : NULL;
    if (!samples) return result ? result : es_context_last_result(context);
    owner_loop owners = {f, level, owner};
    es_forest_each_leaf(context, f, find_owners, &owners);
    landing_loop landings = {&grid, photons, owner, samples, places};
    es_parallel_for(context, paths, GRAIN, find_samples, &landings);
    /* in the order of leaves and photons, whatever the threads */
    memset(areas, 0, level->count * sizeof *areas);
    for (int k = 0; k < 3; k++) memset(power[k], 0, level->count * sizeof *power[k]);
    for (uint32_t t = 0; t < f->tree_count; t++) {
        const es_point_tree* tree = &f->trees[t];
        for (uint32_t i = 0; i < tree->leaf_count; i++) areas[owner[tree->first_leaf + i]] += f->area[tree->first + tree->leaf_count + i];
    }
    for (size_t i = 0; i < (size_t)paths * places; i++)
        if (photons[i].tree != NO_TREE)
            for (int k = 0; k < 3; k++) power[k][samples[i]] += photons[i].power[k];
    return ES_OK;
}

static uint32_t level_of(uint32_t photons)
{
    uint32_t depth = 0;
    while (((uint64_t)ES_PHOTONS_PER_SAMPLE << (depth + 1)) <= photons) depth++;
    return depth;
}

static uint32_t* trees_of_instances(es_arena* arena, const es_point_forest* f, uint32_t instances)
{
    uint32_t* trees = es_arena_allocate(arena, (2 * (size_t)instances + 1) * sizeof *trees);
    if (!trees) return NULL;
    for (size_t i = 0; i < 2 * (size_t)instances; i++) trees[i] = NO_TREE;
    for (uint32_t t = 0; t < f->tree_count; t++)
        if (f->trees[t].instance < instances) trees[2 * (size_t)f->trees[t].instance + f->trees[t].back] = t;
    return trees;
}

es_result es_points_light_photons(es_context* context, es_arena* arena, es_point_forest* forest, const es_photon_job* job, es_photon_stats* stats)
{
    const es_trace_scene* scene = job->scene;
    const bool lights = scene->light_count > 0, glows = job->emission && scene->emitter_count > 0;
    if (stats) *stats = (es_photon_stats){0};
    if (!forest->leaf_count || !job->photons || !job->bounces || (!lights && !glows)) return ES_OK;
    es_light_emissions emissions;
    es_result result = es_light_emissions_create(&emissions, scene);
    if (result) return result;
    const uint32_t of_lights = lights ? job->photons : 0, paths = of_lights + (glows ? job->photons : 0), chunks = (paths + GRAIN - 1) / GRAIN;
    photon_loop loop = {.job = job, .lights = &emissions, .trees = trees_of_instances(arena, forest, scene->instance_count), .of_lights = of_lights, .places = job->bounces + glows};
    loop.photons = loop.trees ? es_arena_allocate(arena, (size_t)paths * loop.places * sizeof *loop.photons) : NULL;
    loop.rays = loop.photons ? es_arena_allocate(arena, 2 * (size_t)chunks * sizeof *loop.rays) : NULL;
    es_point_level level;
    es_point_push push = {.level = &level, .lobes = job->lobes};
    float* areas = NULL;
    result = loop.rays ? es_point_level_make(arena, forest, level_of(job->photons), &level) : es_context_last_result(context);
    if (!result) result = es_point_level_values(arena, &level, push.values);
    if (!result && !(areas = es_arena_allocate(arena, (level.count + 1) * sizeof *areas))) result = es_context_last_result(context);
    if (!result) {
        loop.stored = loop.rays + chunks;
        es_parallel_for(context, paths, GRAIN, trace_chunk, &loop);
        for (uint32_t i = 0; i < chunks && stats; i++) {
            stats->rays += loop.rays[i];
            stats->stored += loop.stored[i];
        }
        if (stats) stats->emitted = paths;
        result = gather_power(context, arena, forest, &level, loop.photons, paths, loop.places, push.values, areas);
    }
    push.areas = areas;
    if (!result) es_points_push(context, forest, &push);
    es_light_emissions_free(&emissions);
    return result;
}
