/* A hierarchy's life: world-space triangles of a draw list in, building or refitting as needed, rays through the kernels. */
#include "gi/reference/bvh_nodes.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/random.h"

es_result es_bvh_create(es_context* context, es_bvh** out)
{
    *out = NULL;
    es_bvh* bvh = es_allocate_zero(context, sizeof *bvh);
    if (!bvh) return es_context_last_result(context);
    bvh->context = context;
    es_context_count_object(context, 1);
    es_result result = es_bvh_build(bvh, &(es_draw_list){0});
    if (result) es_bvh_destroy(bvh);
    else *out = bvh;
    return result;
}

static void free_content(es_bvh* bvh)
{
    es_context* context = bvh->context;
    es_release(context, bvh->primitives, bvh->primitive_count * sizeof *bvh->primitives);
    es_release(context, bvh->vertices, bvh->vertex_count * sizeof *bvh->vertices);
    es_release(context, bvh->corners, (size_t)bvh->primitive_count * 3 * sizeof *bvh->corners);
    es_release(context, bvh->nodes, bvh->node_count * sizeof *bvh->nodes);
    es_release(context, bvh->blocks, bvh->block_count * sizeof *bvh->blocks);
    es_release(context, bvh->boxes, bvh->block_count * sizeof *bvh->boxes);
    es_release(context, bvh->first_vertex, bvh->instance_count * sizeof *bvh->first_vertex);
    es_release(context, bvh->first_primitive, ((size_t)bvh->instance_count + 1) * sizeof *bvh->first_primitive);
    es_release(context, bvh->signature, bvh->instance_count * sizeof *bvh->signature);
    es_release(context, bvh->shape, (size_t)bvh->instance_count * 2 * sizeof *bvh->shape);
    *bvh = (es_bvh){.context = context};
}

void es_bvh_destroy(es_bvh* bvh)
{
    if (!bvh) return;
    es_context* context = bvh->context;
    free_content(bvh);
    es_release(context, bvh, sizeof *bvh);
    es_context_count_object(context, -1);
}

/* ---- what the list holds ----------------------------------------------------------------------------------------------------- */

static uint64_t signature_of(const es_raster_instance* instance)
{
    uint64_t hash = es_hash_bytes(instance->mesh->revision, &instance->transform, sizeof instance->transform);
    return hash;
}

static bool same_shape(const es_bvh* bvh, const es_draw_list* list)
{
    if (list->instance_count != bvh->instance_count || !bvh->first_primitive) return false;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_mesh* mesh = list->instances[i].mesh;
        if (bvh->shape[2 * i] != mesh->vertex_count || bvh->shape[2 * i + 1] != mesh->triangle_count) return false;
    }
    return true;
}

typedef struct place_job { es_bvh* bvh; const es_draw_list* list; bool topology; } place_job;

static void place_instance(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    place_job* job = user;
    es_bvh* bvh = job->bvh;
    for (uint32_t i = begin; i < end; i++) {
        const es_raster_instance* instance = &job->list->instances[i];
        const es_raster_mesh* mesh = instance->mesh;
        uint64_t signature = signature_of(instance);
        if (job->topology || signature != bvh->signature[i]) {
            es_vec3* out = bvh->vertices + bvh->first_vertex[i];
            for (uint32_t v = 0; v < mesh->vertex_count; v++) {
                const float* p = mesh->positions + (size_t)v * 4;
                out[v] = es_mat4_point(&instance->transform, es_v3(p[0], p[1], p[2]));
            }
            bvh->signature[i] = signature;
        }
        if (!job->topology) continue;
        uint32_t first = bvh->first_primitive[i];
        for (uint32_t t = 0; t < mesh->triangle_count; t++) {
            bvh->primitives[first + t] = (es_bvh_primitive){i, t};
            for (int c = 0; c < 3; c++) bvh->corners[(size_t)(first + t) * 3 + c] = bvh->first_vertex[i] + mesh->indices[(size_t)t * 3 + c];
        }
    }
}

es_result es_bvh_build(es_bvh* bvh, const es_draw_list* list)
{
    es_context* context = bvh->context;
    free_content(bvh);
    uint64_t vertices = 0, triangles = 0;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        vertices += list->instances[i].mesh->vertex_count;
        triangles += list->instances[i].mesh->triangle_count;
    }
    /* a child's top bit marks blocks, a block holds at least one triangle */
    if (vertices > 0x7fffffffu || triangles > 0x7ffffffeu)
        return es_fail(context, ES_INVALID_ARGUMENT, "ray tracing takes up to 2^31 - 2 triangles and vertices; the scene has %llu and %llu", (unsigned long long)triangles, (unsigned long long)vertices);
    bvh->instance_count = list->instance_count;
    bvh->vertex_count = (uint32_t)vertices;
    bvh->primitive_count = (uint32_t)triangles;
    bool all = (bvh->first_vertex = es_allocate_array(context, list->instance_count, sizeof *bvh->first_vertex)) &&
        (bvh->first_primitive = es_allocate_array(context, (size_t)list->instance_count + 1, sizeof *bvh->first_primitive)) &&
        (bvh->signature = es_allocate_array(context, list->instance_count, sizeof *bvh->signature)) &&
        (bvh->shape = es_allocate_array(context, (size_t)list->instance_count * 2, sizeof *bvh->shape)) &&
        (bvh->vertices = es_allocate_array(context, vertices, sizeof *bvh->vertices)) &&
        (bvh->corners = es_allocate_array(context, triangles * 3, sizeof *bvh->corners)) &&
        (bvh->primitives = es_allocate_array(context, triangles, sizeof *bvh->primitives));
    es_result result = all ? ES_OK : es_context_last_result(context);
    if (!result) {
        uint32_t vertex = 0, primitive = 0;
        for (uint32_t i = 0; i < list->instance_count; i++) {
            const es_raster_mesh* mesh = list->instances[i].mesh;
            bvh->first_vertex[i] = vertex;
            bvh->first_primitive[i] = primitive;
            bvh->shape[2 * i] = mesh->vertex_count;
            bvh->shape[2 * i + 1] = mesh->triangle_count;
            vertex += mesh->vertex_count;
            primitive += mesh->triangle_count;
        }
        bvh->first_primitive[list->instance_count] = primitive;
        place_job job = {bvh, list, true};
        es_parallel_for(context, list->instance_count, 1, place_instance, &job);
        result = es_bvh_build_nodes(bvh);
    }
    if (result) {
        free_content(bvh);
        return result;
    }
    es_bvh_fit(bvh);
    bvh->built_cost = bvh->cost;
    return ES_OK;
}

es_result es_bvh_refit(es_bvh* bvh, const es_draw_list* list)
{
    if (!same_shape(bvh, list)) return es_misuse(bvh->context, ES_WRONG_STATE, "a hierarchy is refit to the instances and triangles it was built from; these are others");
    place_job job = {bvh, list, false};
    es_parallel_for(bvh->context, list->instance_count, 1, place_instance, &job);
    es_bvh_fit(bvh);
    return ES_OK;
}

es_result es_bvh_update(es_bvh* bvh, const es_draw_list* list)
{
    if (!same_shape(bvh, list)) return es_bvh_build(bvh, list);
    bool moved = false;
    for (uint32_t i = 0; i < list->instance_count && !moved; i++) moved = signature_of(&list->instances[i]) != bvh->signature[i];
    if (!moved) return ES_OK;
    /* which triangles a mesh's corners form is not in its signature: another mesh of the same size may have come in its place */
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_mesh* mesh = list->instances[i].mesh;
        const uint32_t* corners = bvh->corners + (size_t)bvh->first_primitive[i] * 3;
        for (size_t k = 0; k < (size_t)mesh->triangle_count * 3; k++)
            if (corners[k] - bvh->first_vertex[i] != mesh->indices[k]) return es_bvh_build(bvh, list);
    }
    es_result result = es_bvh_refit(bvh, list);
    if (result || !(bvh->cost > 1.5f * bvh->built_cost)) return result;
    return es_bvh_build(bvh, list);
}

uint32_t es_bvh_primitive_count(const es_bvh* bvh) { return bvh->primitive_count; }
const es_bvh_primitive* es_bvh_primitives(const es_bvh* bvh) { return bvh->primitives; }

void es_bvh_triangle(const es_bvh* bvh, uint32_t primitive, es_vec3 corners[3])
{
    for (int c = 0; c < 3; c++) corners[c] = bvh->vertices[bvh->corners[(size_t)primitive * 3 + c]];
}

float es_bvh_cost(const es_bvh* bvh) { return bvh->cost; }

void es_bvh_bounds(const es_bvh* bvh, es_vec3* minimum, es_vec3* maximum)
{
    *minimum = es_v3(bvh->bounds.min[0], bvh->bounds.min[1], bvh->bounds.min[2]);
    *maximum = es_v3(bvh->bounds.max[0], bvh->bounds.max[1], bvh->bounds.max[2]);
}

void es_bvh_closest(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, es_hit* hits)
{
    es_gi_kernel_table(es_context_isa(bvh->context))->trace_closest(bvh, kind == ES_RAYS_COHERENT, rays, count, hits);
}

void es_bvh_any(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, uint8_t* blocked)
{
    es_gi_kernel_table(es_context_isa(bvh->context))->trace_any(bvh, kind == ES_RAYS_COHERENT, rays, count, blocked);
}

void es_bvh_beyond(const es_bvh* bvh, const es_ray* ray, const es_hit* passed, es_hit* hit)
{
    es_gi_kernel_table(es_context_isa(bvh->context))->trace_beyond(bvh, ray, passed, hit);
}

es_vec3 es_offset_origin(es_vec3 p, es_vec3 n)
{
    /* The point comes from barycentrics in float: off by some units in the last place of the largest coordinate, 2^-23 of it each. 64 of
     * them also cover triangles seen at a slant; the tiny absolute part keeps points at the origin off their plane. */
    float largest = es_maxf(es_absf(p.x), es_maxf(es_absf(p.y), es_absf(p.z)));
    float step = largest * 7.6293945e-6f + 1e-30f;
    return es_v3(p.x + step * n.x, p.y + step * n.y, p.z + step * n.z);
}
