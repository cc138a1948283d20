/* Textures and materials. */
#include "sim/world.h"

#include <string.h>

static const char* label(const char* name) { return name ? name : ""; }

/* ---- textures -------------------------------------------------------------------------------------------------------- */

es_result es_world_add_texture(es_world* world, const es_texture_desc* desc, es_texture* texture)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !texture || !desc->rgba) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_texture: desc, its rgba and texture must not be NULL");
    *texture = (es_texture){0};
    es_texture_image image = {0};
    es_result result = es_texture_image_create(world->context, desc->width, desc->height, desc->rgba, desc->srgb, &image);
    if (result != ES_OK) return result;
    es_texture_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_TEXTURE], "texture", desc->name);
    if (!object) {
        es_texture_image_destroy(world->context, &image);
        return es_context_last_result(world->context);
    }
    object->image = image;
    texture->id = object->object.id;
    return ES_OK;
}

es_result es_world_destroy_texture(es_world* world, es_texture texture)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_texture_object* object = es_world_object(world, ES_OBJECT_TEXTURE, texture.id);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "texture '%.64s' cannot be destroyed: materials use it %u times", label(object->object.name), object->object.references);
    es_texture_image_destroy(world->context, &object->image);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_TEXTURE], &object->object);
    return ES_OK;
}

const es_texture_image* es_world_texture_image(const es_world* world, es_texture texture)
{
    es_texture_object* object = world ? es_world_object(world, ES_OBJECT_TEXTURE, texture.id) : NULL;
    return object ? &object->image : NULL;
}

/* ---- materials --------------------------------------------------------------------------------------------------------- */

enum { USES = 5 };

static const es_texture_use* use_of(const es_material_desc* desc, int i)
{
    const es_texture_use* const uses[USES] = {&desc->base_color_texture, &desc->metallic_roughness_texture, &desc->normal_texture, &desc->emission_texture, &desc->specular_texture};
    return uses[i];
}

static es_texture_object* texture_of_image(const es_world* world, const es_texture_image* image)
{
    const es_slots* slots = &world->slots[ES_OBJECT_TEXTURE];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_texture_object* object = es_slots_at(slots, slot);
        if (object && &object->image == image) return object;
    }
    return NULL;
}

static void count_uses(es_world* world, const es_material_desc* desc, int change)
{
    for (int i = 0; i < USES; i++) {
        const es_texture_use* use = use_of(desc, i);
        es_texture_object* texture = use->image ? texture_of_image(world, use->image) : NULL;
        if (texture) texture->object.references += (uint32_t)change;
    }
}

static bool all_in(const float* values, int count, float low, float high)
{
    bool good = true;
    for (int i = 0; i < count; i++) good &= es_within(values[i], low, high);
    return good;
}

static es_result check(es_world* world, const char* name, const es_material_desc* desc)
{
    es_context* context = world->context;
    const char* wrong = (uint32_t)desc->model > ES_SURFACE_UNLIT ? "its model must be one of es_surface_model"
                        : !all_in(desc->base_color, 4, 0, 1)   ? "its base colour must lie in 0 … 1"
                        : !es_within(desc->metallic, 0, 1)     ? "metallic must lie in 0 … 1"
                        : !es_within(desc->roughness, 0, 1)    ? "roughness must lie in 0 … 1"
                        : !es_within(desc->specular, 0, 1)     ? "specular must lie in 0 … 1"
                        : !es_within(desc->transmission, 0, 1) ? "transmission must lie in 0 … 1"
                        : desc->ior != 0 && !es_within(desc->ior, 1, 5) ? "its index of refraction must lie in 1 … 5, or be 0 for 1.5"
                        : desc->model == ES_SURFACE_PHONG && !es_within(desc->exponent, 1, 50) ? "the Phong exponent must lie in 1 … 50"
                        : !all_in(desc->emission, 3, 0, ES_WORLD_EXTENT)    ? "its emission must lie in 0 … 1e9"
                        : !es_within(desc->normal_scale, -1000, 1000)      ? "its normal scale must lie in -1000 … 1000"
                        : !es_within(desc->alpha_cutoff, 0, ES_WORLD_EXTENT) ? "its alpha cut-off must be 0 or more"
                                                                           : NULL;
    if (wrong) return es_fail(context, ES_INVALID_ARGUMENT, "material '%.64s': %s", label(name), wrong);
    for (int i = 0; i < USES; i++) {
        const es_texture_use* use = use_of(desc, i);
        if (!use->image) continue;
        if (!texture_of_image(world, use->image))
            return es_misuse(context, ES_STALE_HANDLE, "material '%.64s': texture use %d names an image that is not of this world", label(name), i);
        if ((uint32_t)use->wrap_u > ES_WRAP_MIRROR || (uint32_t)use->wrap_v > ES_WRAP_MIRROR || (uint32_t)use->magnify > ES_FILTER_NEAREST ||
            (uint32_t)use->minify > ES_FILTER_NEAREST || (uint32_t)use->mip > ES_MIP_NONE || use->uv_set > 1 ||
            !all_in(use->matrix, 4, -ES_WORLD_EXTENT, ES_WORLD_EXTENT) || !all_in(use->offset, 2, -ES_WORLD_EXTENT, ES_WORLD_EXTENT))
            return es_fail(context, ES_INVALID_ARGUMENT, "material '%.64s': texture use %d has a wrap, filter, uv set or matrix out of range", label(name), i);
    }
    return ES_OK;
}

es_result es_world_add_material(es_world* world, const char* name, const es_material_desc* desc, es_material* material)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !material) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_material: desc and material must not be NULL");
    *material = (es_material){0};
    es_result result = check(world, name, desc);
    if (result != ES_OK) return result;
    size_t used = world->slots[ES_OBJECT_MATERIAL].slot_count + (size_t)1;
    if (!es_grow(world->context, (void**)&world->materials, &world->material_capacity, used, used + 1, sizeof *world->materials))
        return es_context_last_result(world->context);
    world->list.materials = world->materials;
    es_material_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_MATERIAL], "material", name);
    if (!object) return es_context_last_result(world->context);
    object->desc = *desc;
    world->materials[es_slot_of(object->object.id) + 1] = *desc;
    world->list.material_count = world->slots[ES_OBJECT_MATERIAL].slot_count + 1;
    count_uses(world, desc, +1);
    world->revisions.materials++;
    material->id = object->object.id;
    return ES_OK;
}

es_result es_world_set_material(es_world* world, es_material material, const es_material_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_material_object* object = es_world_object(world, ES_OBJECT_MATERIAL, material.id);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_material: desc must not be NULL");
    es_result result = check(world, object->object.name, desc);
    if (result != ES_OK) return result;
    /* padding may differ where the content does not; then the revision goes up needlessly, which is allowed */
    if (memcmp(&object->desc, desc, sizeof *desc) == 0) return ES_OK;
    count_uses(world, &object->desc, -1);
    count_uses(world, desc, +1);
    object->desc = *desc;
    world->materials[es_slot_of(material.id) + 1] = *desc;
    world->revisions.materials++;
    return ES_OK;
}

es_result es_world_get_material(const es_world* world, es_material material, es_material_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_material_object* object = es_world_object(world, ES_OBJECT_MATERIAL, material.id);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    return ES_OK;
}

es_result es_world_destroy_material(es_world* world, es_material material)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_material_object* object = es_world_object(world, ES_OBJECT_MATERIAL, material.id);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "material '%.64s' cannot be destroyed: %u instances use it", label(object->object.name), object->object.references);
    count_uses(world, &object->desc, -1);
    world->materials[es_slot_of(material.id) + 1] = world->materials[0];
    es_slots_remove(world->context, &world->slots[ES_OBJECT_MATERIAL], &object->object);
    world->revisions.materials++;
    return ES_OK;
}
