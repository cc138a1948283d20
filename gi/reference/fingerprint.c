/* What the samples of a reference depend on, as one number. */
#include <string.h>

#include "gi/reference/reference.h"
#include "platform/random.h"
#include "raster/solid_share.h"

/* Goes up when the same world would give other samples. */
enum { SAMPLES_VERSION = 2 };

static uint64_t texture_hash(uint64_t hash, const es_texture_use* use)
{
    const es_texture_image* image = use->image;
    if (!image) return es_hash_bytes(hash, "", 1);
    const uint32_t words[] = {image->width, image->height, use->wrap_u, use->wrap_v, use->magnify, use->uv_set};
    hash = es_hash_bytes(hash, words, sizeof words);
    hash = es_hash_bytes(hash, use->matrix, sizeof use->matrix);
    hash = es_hash_bytes(hash, use->offset, sizeof use->offset);
    return es_hash_bytes(hash, image->texels, (size_t)image->width * image->height * 4 * sizeof *image->texels);
}

/* Field by field: structures have padding. */
static uint64_t material_hash(uint64_t hash, const es_material_desc* m)
{
    const float numbers[] = {(float)m->model, m->base_color[0], m->base_color[1], m->base_color[2], m->base_color[3], m->metallic, m->roughness, m->specular, m->exponent,
        m->emission[0], m->emission[1], m->emission[2], m->normal_scale, m->alpha_mask + 2.0f * m->blend, m->alpha_cutoff, m->double_sided, es_transmitted_share(m), es_ior_of(m)};
    hash = es_hash_bytes(hash, numbers, sizeof numbers);
    const es_texture_use* textures[] = {&m->base_color_texture, &m->metallic_roughness_texture, &m->normal_texture, &m->emission_texture, &m->specular_texture};
    for (size_t i = 0; i < sizeof textures / sizeof textures[0]; i++) hash = texture_hash(hash, textures[i]);
    return hash;
}

static uint64_t mesh_hash(uint64_t hash, const es_raster_mesh* mesh)
{
    size_t record = (size_t)mesh->vertex_count * 4 * sizeof(float);
    const float* streams[] = {mesh->positions, mesh->normals, mesh->tangents, mesh->uvs, mesh->colors};
    for (size_t i = 0; i < sizeof streams / sizeof streams[0]; i++)
        hash = streams[i] ? es_hash_bytes(hash, streams[i], record) : es_hash_bytes(hash, "", 1);
    return es_hash_bytes(hash, mesh->indices, (size_t)mesh->triangle_count * 3 * sizeof *mesh->indices);
}

static uint64_t light_hash(uint64_t hash, const es_light_state* light)
{
    const float numbers[] = {(float)light->type, light->position.x, light->position.y, light->position.z, light->direction.x, light->direction.y, light->direction.z,
        light->radiant[0], light->radiant[1], light->radiant[2], light->cos_inner, light->cos_outer, light->range};
    return es_hash_bytes(hash, numbers, sizeof numbers);
}

uint64_t es_reference_fingerprint(const es_reference* r)
{
    const es_reference_settings* s = &r->settings;
    const es_trace_scene* scene = &r->scene;
    const uint32_t words[] = {SAMPLES_VERSION, s->width, s->height, s->bounces, s->seed, s->antialias, s->emission, s->quantised, s->share, scene->instance_count, scene->material_count,
        scene->light_count, scene->has_environment};
    uint64_t hash = es_hash_bytes(0, words, sizeof words);
    hash = es_hash_bytes(hash, &r->view.view, sizeof r->view.view);
    hash = es_hash_bytes(hash, &r->view.projection, sizeof r->view.projection);
    for (uint32_t i = 0; i < scene->instance_count; i++) {
        const es_raster_instance* instance = &scene->instances[i];
        hash = es_hash_bytes(hash, &instance->transform, sizeof instance->transform);
        hash = es_hash_bytes(hash, &instance->material, sizeof instance->material);
        hash = mesh_hash(hash, instance->mesh);
    }
    for (uint32_t i = 0; i < scene->material_count; i++) hash = material_hash(hash, &scene->materials[i]);
    for (uint32_t i = 0; i < scene->light_count; i++) hash = light_hash(hash, &scene->lights[i]);
    if (!scene->has_environment) return hash;
    const es_environment_desc* e = &scene->environment;
    hash = es_hash_bytes(hash, e->radiance, sizeof e->radiance);
    hash = es_hash_bytes(hash, &e->rotation, sizeof e->rotation);
    if (!e->image) return hash;
    const uint32_t size[] = {e->image->width, e->image->height, e->image->channels};
    hash = es_hash_bytes(hash, size, sizeof size);
    return es_hash_bytes(hash, e->image->pixels, (size_t)size[0] * size[1] * size[2] * sizeof(float));
}
