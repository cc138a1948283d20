#include "gi/surfels.h"

#include <string.h>

#include "gi/reference/scene.h"
#include "platform/context.h"
#include "raster/pack.h"
#include "raster/solid_share.h"

typedef struct corners { uint32_t vertex[3]; float weight[3]; } corners;

static corners corners_of(const es_raster_mesh* mesh, uint32_t triangle, uint32_t barycentric)
{
    float u = (float)(barycentric & 0xffff) * (1.0f / 65535.0f), v = (float)(barycentric >> 16) * (1.0f / 65535.0f);
    corners c = {.weight = {1.0f - u - v, u, v}};
    memcpy(c.vertex, mesh->indices + 3 * (size_t)triangle, sizeof c.vertex);
    return c;
}

static void interpolate(const float* stream, const corners* c, float out[4])
{
    const float *p = stream + 4 * (size_t)c->vertex[0], *q = stream + 4 * (size_t)c->vertex[1], *r = stream + 4 * (size_t)c->vertex[2];
    for (int k = 0; k < 4; k++) out[k] = c->weight[0] * p[k] + c->weight[1] * q[k] + c->weight[2] * r[k];
}

static es_vec3 place(const es_raster_instance* instance, uint32_t vertex)
{
    const float* p = instance->mesh->positions + 4 * (size_t)vertex;
    return es_mat4_point(&instance->transform, es_v3(p[0], p[1], p[2]));
}

/* Of the front, which the winding says; a mirroring transform turns it round. */
static uint32_t normal_word(const es_raster_instance* instance, const float matrix[9], bool mirrored, const corners* c)
{
    es_vec3 a = place(instance, c->vertex[0]), b = place(instance, c->vertex[1]), d = place(instance, c->vertex[2]);
    es_vec3 normal = es_v3_normalize(es_v3_cross(es_v3_sub(b, a), es_v3_sub(d, a)), es_v3(0, 1, 0));
    if (mirrored) normal = es_v3_scale(normal, -1.0f);
    if (instance->mesh->normals) {
        float n[4];
        interpolate(instance->mesh->normals, c, n);
        normal = es_v3_normalize(es_v3(matrix[0] * n[0] + matrix[3] * n[1] + matrix[6] * n[2], matrix[1] * n[0] + matrix[4] * n[1] + matrix[7] * n[2],
            matrix[2] * n[0] + matrix[5] * n[1] + matrix[8] * n[2]), normal);
    }
    return es_pack_normal(normal);
}

es_surfel_words es_surfel_read(const es_raster_mesh* mesh, const es_material_desc* m, uint32_t triangle, uint32_t barycentric)
{
    const corners c = corners_of(mesh, triangle, barycentric);
    float color[4] = {1, 1, 1, 1}, uvs[4] = {0, 0, 0, 0}, texel[4];
    if (mesh->colors) interpolate(mesh->colors, &c, color);
    if (mesh->uvs) interpolate(mesh->uvs, &c, uvs);
    for (int k = 0; k < 4; k++) color[k] *= k < 3 ? m->base_color[k] * es_solid_share(m) : m->base_color[k];
    if (m->base_color_texture.image) {
        es_trace_sample_texture(&m->base_color_texture, uvs, texel);
        for (int k = 0; k < 4; k++) color[k] *= texel[k];
    }
    float metallic = m->metallic, roughness = m->roughness, specular = m->specular;
    if (m->metallic_roughness_texture.image) {
        es_trace_sample_texture(&m->metallic_roughness_texture, uvs, texel);
        metallic *= texel[2];
        roughness *= texel[1];
    }
    if (m->specular_texture.image) {
        es_trace_sample_texture(&m->specular_texture, uvs, texel);
        specular *= texel[3];
    }
    const bool hole = (m->alpha_mask || m->blend) && color[3] < m->alpha_cutoff;
    const uint32_t second = es_pack_unorm8(m->model == ES_SURFACE_PHONG ? m->exponent * (5.0f / 255.0f) : roughness), model = hole ? ES_SURFACE_UNLIT : (uint32_t)m->model;
    return (es_surfel_words){
        .albedo_rg = es_pack_unorm16(color[0]) | es_pack_unorm16(color[1]) << 16,
        .albedo_b = es_pack_unorm16(color[2]) | (uint32_t)m->double_sided << 16,
        .surface = es_pack_unorm8(metallic) | second << 8 | es_pack_unorm8(specular) << 16 | model << 24,
        .hole = hole,
    };
}

es_vec3 es_surfel_emission(const es_raster_mesh* mesh, const es_material_desc* m, uint32_t triangle, uint32_t barycentric)
{
    es_vec3 emission = es_v3(m->emission[0], m->emission[1], m->emission[2]);
    if (m->emission_texture.image) {
        const corners c = corners_of(mesh, triangle, barycentric);
        float uvs[4] = {0, 0, 0, 0}, texel[4];
        if (mesh->uvs) interpolate(mesh->uvs, &c, uvs);
        es_trace_sample_texture(&m->emission_texture, uvs, texel);
        emission = es_v3_mul(emission, es_v3(texel[0], texel[1], texel[2]));
    }
    return emission;
}

typedef struct reading {
    es_surfels* surfels;
    const es_scene_points* points;
    const es_draw_list* list;
    bool all;
} reading;

static void read_instance(const reading* r, uint32_t index)
{
    const es_scene_points* points = r->points;
    const es_point_source* source = &points->sources[index];
    const es_raster_instance* instance = &r->list->instances[index];
    const es_material_desc* material = &r->list->materials[instance->material];
    /* scaled to about one first: cofactors of a tiny scene would underflow */
    es_mat4 m = instance->transform;
    float largest = 0.0f, matrix[9];
    for (int i = 0; i < 12; i++) largest = i % 4 < 3 ? es_maxf(largest, es_absf(m.m[i])) : largest;
    for (int i = 0; i < 12; i++) m.m[i] = largest > 0.0f ? m.m[i] / largest : 0.0f;
    es_mat4_normal_matrix(&m, matrix);
    const bool mirrored = es_mat4_determinant3(&m) < 0.0f;
    for (int i = 0; i < 9 && mirrored; i++) matrix[i] = -matrix[i];
    const float area = (float)(source->rest_area / (source->end - source->begin));
    for (uint32_t s = 0; s < points->subset_count; s++) {
        const uint32_t first = es_scene_points_border(points, s, source->begin), last = es_scene_points_border(points, s, source->end);
        for (uint32_t k = first; k < last; k++) {
            const size_t i = (size_t)s * points->subset_size + k;
            corners c = corners_of(instance->mesh, points->triangle[i], points->barycentric[i]);
            r->surfels->normal[i] = normal_word(instance, matrix, mirrored, &c);
            r->surfels->area[i] = area;
            const es_surfel_words words = es_surfel_read(instance->mesh, material, points->triangle[i], points->barycentric[i]);
            r->surfels->albedo_rg[i] = words.albedo_rg;
            r->surfels->albedo_b[i] = words.albedo_b;
            r->surfels->surface[i] = words.surface;
        }
    }
}

static void read_instances(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const reading* r = user;
    for (uint32_t i = begin; i < end; i++)
        if (r->points->sources[i].end > r->points->sources[i].begin && (r->all || r->points->sources[i].placed > r->surfels->time)) read_instance(r, i);
}

enum { ARRAYS = 5 };

static void free_arrays(es_context* context, es_surfels* surfels)
{
    void** const arrays[ARRAYS] = {(void**)&surfels->normal, (void**)&surfels->albedo_rg, (void**)&surfels->albedo_b, (void**)&surfels->surface, (void**)&surfels->area};
    for (int k = 0; k < ARRAYS; k++) {
        es_release(context, *arrays[k], surfels->count * sizeof(uint32_t));
        *arrays[k] = NULL;
    }
    surfels->count = 0;
    surfels->of = NULL;
}

static es_result reserve_arrays(es_context* context, es_surfels* surfels, size_t count)
{
    if (surfels->count == count && surfels->area) return ES_OK;
    free_arrays(context, surfels);
    surfels->count = count;
    void** const arrays[ARRAYS] = {(void**)&surfels->normal, (void**)&surfels->albedo_rg, (void**)&surfels->albedo_b, (void**)&surfels->surface, (void**)&surfels->area};
    for (int k = 0; k < ARRAYS; k++) {
        *arrays[k] = es_allocate_zero(context, count * sizeof(uint32_t));
        if (!*arrays[k]) {
            free_arrays(context, surfels);
            return es_context_last_result(context);
        }
    }
    return ES_OK;
}

es_result es_surfels_update(es_context* context, es_surfels* surfels, const es_scene_points* points, const es_draw_list* list, uint64_t materials)
{
    const size_t count = ((size_t)points->subset_size * points->subset_count + 7) / 8 * 8;
    const bool all = surfels->of != points || surfels->count != count || surfels->materials != materials || points->layout > surfels->time;
    es_result result = reserve_arrays(context, surfels, count);
    if (result) return result;
    if (all || points->time != surfels->time) {
        reading r = {surfels, points, list, all};
        es_parallel_for(context, points->source_count, 1, read_instances, &r);
    }
    surfels->of = points;
    surfels->time = points->time;
    surfels->materials = materials;
    return ES_OK;
}

void es_surfels_free(es_context* context, es_surfels* surfels)
{
    free_arrays(context, surfels);
    *surfels = (es_surfels){0};
}

es_surfel_set es_surfels_subset(const es_surfels* s, const es_scene_points* p, uint32_t subset)
{
    size_t first = (size_t)subset * p->subset_size;
    return (es_surfel_set){p->x + first, p->y + first, p->z + first, s->normal + first, s->albedo_rg + first, s->albedo_b + first, s->surface + first, s->area + first, p->subset_size};
}
