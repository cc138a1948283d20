/* Lights, and their state in world space as the light transport reads it. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

es_light_desc es_default_light_desc(void)
{
    return (es_light_desc){.type = ES_LIGHT_SPOT, .color = {1, 1, 1}, .intensity = 1.0f, .outer_cone = 0.25f * ES_PI};
}

static es_light_object* light_object(const es_world* world, es_light light) { return es_world_object(world, ES_OBJECT_LIGHT, light.id); }

static es_result resolve(es_world* world, const es_light_desc* desc, es_light_desc* resolved)
{
    es_light_desc d = {0};
    d.node = desc->node;
    d.type = desc->type;
    memcpy(d.color, desc->color, sizeof d.color);
    d.intensity = desc->intensity;
    d.inner_cone = desc->inner_cone;
    d.outer_cone = desc->type == ES_LIGHT_SPOT && desc->outer_cone == 0 ? 0.25f * ES_PI : desc->outer_cone;
    d.range = desc->range;
    d.off = desc->off;
    if (d.node.id && !es_world_object(world, ES_OBJECT_NODE, d.node.id)) return ES_STALE_HANDLE;
    const char* wrong = (uint32_t)d.type > ES_LIGHT_DIRECTIONAL ? "its type must be one of es_light_type"
                        : !es_within(d.color[0], 0, 1e6f) || !es_within(d.color[1], 0, 1e6f) || !es_within(d.color[2], 0, 1e6f) ? "its colour must lie in 0 … 1e6"
                        : !es_within(d.intensity, 0, 1e20f) ? "its intensity must lie in 0 … 1e20"
                        : !es_within(d.intensity * es_maxf(d.color[0], es_maxf(d.color[1], d.color[2])), 0, 1e20f) ? "its colour times its intensity must lie in 0 … 1e20"
                        : !es_within(d.range, 0, 1e12f)     ? "its range must lie in 0 … 1e12 metres"
                        : d.type == ES_LIGHT_SPOT && (!es_within(d.outer_cone, 1e-4f, 0.5f * ES_PI) || !es_within(d.inner_cone, 0, d.outer_cone))
                            ? "its cone must satisfy 0 <= inner <= outer <= pi / 2"
                            : NULL;
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "light '%.64s': %s", desc->name ? desc->name : "", wrong);
    if (!es_all_within(&d.inner_cone, 1, ES_PI)) d.inner_cone = 0;
    if (!es_all_within(&d.outer_cone, 1, ES_PI)) d.outer_cone = 0.25f * ES_PI;
    *resolved = d;
    return ES_OK;
}

bool es_light_desc_resolve(es_world* world, const es_light_desc* desc, es_light_desc* resolved) { return resolve(world, desc, resolved) == ES_OK; }

es_result es_world_add_light(es_world* world, const es_light_desc* desc, es_light* light)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !light) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_light: desc and light must not be NULL");
    *light = (es_light){0};
    es_light_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    size_t needed = world->slots[ES_OBJECT_LIGHT].slot_count + (size_t)1;
    if (!es_grow(world->context, (void**)&world->lights, &world->light_capacity, world->light_count, needed, sizeof *world->lights))
        return es_context_last_result(world->context);
    es_light_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_LIGHT], "light", desc->name);
    if (!object) return es_context_last_result(world->context);
    object->desc = resolved;
    es_world_rereference(world, ES_OBJECT_NODE, 0, resolved.node.id);
    world->lights_dirty = true;
    light->id = object->object.id;
    return ES_OK;
}

es_result es_world_set_light(es_world* world, es_light light, const es_light_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_light_object* object = light_object(world, light);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_light: desc must not be NULL");
    es_light_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    es_world_rereference(world, ES_OBJECT_NODE, object->desc.node.id, resolved.node.id);
    object->desc = resolved;
    world->lights_dirty = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_LIGHT, .id = light.id, .light = resolved});
    return ES_OK;
}

es_result es_world_get_light(const es_world* world, es_light light, es_light_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_light_object* object = light_object(world, light);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name ? object->object.name : "";
    return ES_OK;
}

es_result es_world_destroy_light(es_world* world, es_light light)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_light_object* object = light_object(world, light);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "light '%.64s' cannot be destroyed: %u things move it", object->object.name ? object->object.name : "", object->object.references);
    es_world_rereference(world, ES_OBJECT_NODE, object->desc.node.id, 0);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_LIGHT], &object->object);
    world->lights_dirty = true;
    return ES_OK;
}

/* False for a light that gives nothing or stands outside the world's extent. */
static bool state_of(const es_world* world, const es_light_object* object, es_light_state* state)
{
    const es_light_desc* desc = &object->desc;
    const float* m = es_node_world(world, desc->node)->m;
    if (desc->off || !es_all_within(m, 16, ES_WORLD_EXTENT)) return false;
    *state = (es_light_state){.handle = {object->object.id}, .type = desc->type, .range = desc->range};
    es_mat4 pose = es_relative_matrix(world, es_node_world(world, desc->node), es_node_position(world, desc->node));
    state->position = es_v3(pose.m[12], pose.m[13], pose.m[14]);
    state->direction = es_v3_normalize(es_v3(-m[8], -m[9], -m[10]), es_v3(0, 0, -1));
    float strongest = 0;
    for (int c = 0; c < 3; c++) {
        state->radiant[c] = desc->color[c] * desc->intensity * (1.0f - object->dimmed);
        strongest = es_maxf(strongest, state->radiant[c]);
    }
    if (desc->type == ES_LIGHT_SPOT) {
        /* the falloff divides by the difference: a hard edge keeps 16 ulp of it */
        state->cos_outer = es_maxf(es_cos(desc->outer_cone), 0.0f);
        state->cos_inner = es_maxf(es_cos(desc->inner_cone), state->cos_outer + 1e-6f);
    }
    return strongest > 0;
}

void es_lights_refresh(es_world* world)
{
    if (!world->lights_dirty) return;
    world->lights_dirty = false;
    const es_slots* slots = &world->slots[ES_OBJECT_LIGHT];
    size_t count = 0;
    bool differs = false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_light_object* object = es_slots_at(slots, slot);
        es_light_state state;
        if (!object || !state_of(world, object, &state)) continue;
        differs |= count >= world->light_count || memcmp(&world->lights[count], &state, sizeof state) != 0;
        world->lights[count++] = state;
    }
    if (differs || count != world->light_count) world->revisions.lights++;
    world->light_count = count;
}

const es_light_state* es_world_lights(const es_world* world, size_t* count)
{
    if (count) *count = 0;
    if (!world || !count) return NULL;
    es_world_refresh(world);
    *count = world->light_count;
    return world->lights;
}
