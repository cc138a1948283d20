#include "gi/blend_lists.h"

#include <string.h>

static bool blends(const es_draw_list* list, uint32_t instance) { return list->materials[list->instances[instance].material].blend; }

/* May alpha be so much anywhere? Textures only lessen it. */
static bool reaches(const es_raster_instance* instance, const es_material_desc* m, float alpha) { return m->base_color[3] >= alpha || (instance->mesh && instance->mesh->colors); }

/* Is it nowhere less? */
static bool stays_above(const es_raster_instance* instance, const es_material_desc* m, float alpha)
{
    return m->base_color[3] >= alpha && !m->base_color_texture.image && !(instance->mesh && instance->mesh->colors);
}

/* The materials with blended ones as masks of that cut-off. */
static void mask_materials(es_material_desc* to, const es_draw_list* world, float cutoff)
{
    memcpy(to, world->materials, world->material_count * sizeof *to);
    for (uint32_t i = 0; i < world->material_count; i++)
        if (to[i].blend) to[i].alpha_cutoff = cutoff;
}

es_result es_blend_lists_make(es_context* context, es_blend_lists* lists, const es_draw_list* world, bool layers)
{
    const uint32_t count = world->instance_count;
    lists->light = lists->solid = *world;
    lists->layers = (es_draw_list){0};
    uint32_t first = 0;
    while (first < count && !blends(world, first)) first++;
    if (first == count) return ES_OK;
    const size_t instances = (size_t)count * 3, materials = (size_t)world->material_count * 2;
    if (!es_grow(context, (void**)&lists->instances, &lists->instance_capacity, 0, instances, sizeof *lists->instances) ||
        !es_grow(context, (void**)&lists->materials, &lists->material_capacity, 0, materials, sizeof *lists->materials))
        return es_context_last_result(context);
    es_raster_instance *light = lists->instances, *solid = light + count, *layer = solid + count;
    es_material_desc *of_solid = lists->materials, *of_layers = of_solid + world->material_count;
    mask_materials(of_solid, world, ES_BLEND_MOST);
    mask_materials(of_layers, world, ES_BLEND_LEAST);
    uint32_t lights = 0, solids = 0, layered = 0;
    /* masks are looked up pixel by pixel: not where they have no hole */
    for (uint32_t i = 0; i < world->material_count; i++) of_layers[i].blend = false;
    for (uint32_t i = 0; i < count; i++) {
        const es_raster_instance* instance = &world->instances[i];
        const es_material_desc* m = &world->materials[instance->material];
        if (m->blend && !stays_above(instance, m, ES_BLEND_LEAST)) of_layers[instance->material].blend = true;
    }
    for (uint32_t i = 0; i < count; i++) {
        const es_raster_instance* instance = &world->instances[i];
        const es_material_desc* m = &world->materials[instance->material];
        if (!m->blend || reaches(instance, m, m->alpha_cutoff)) light[lights++] = *instance;
        if (!m->blend || reaches(instance, m, ES_BLEND_MOST)) solid[solids++] = *instance;
        if (m->blend && reaches(instance, m, ES_BLEND_LEAST) && !stays_above(instance, m, ES_BLEND_MOST)) layer[layered++] = *instance;
    }
    lists->light = lists->solid = (es_draw_list){light, world->materials, lights, world->material_count};
    if (!layers) return ES_OK;
    lists->solid = (es_draw_list){solid, of_solid, solids, world->material_count};
    lists->layers = (es_draw_list){layer, of_layers, layered, world->material_count};
    return ES_OK;
}

void es_blend_lists_free(es_context* context, es_blend_lists* lists)
{
    es_release(context, lists->instances, lists->instance_capacity * sizeof *lists->instances);
    es_release(context, lists->materials, lists->material_capacity * sizeof *lists->materials);
    *lists = (es_blend_lists){0};
}
