/* Constraints: what is to be seen at a place of a mirror; keys that move it. */
#include "sim/edits/edit_state.h"

#include <string.h>

#include "platform/maths.h"

es_constraint_desc es_default_constraint_desc(void) { return (es_constraint_desc){.orientation = {0, 0, 0, 1}}; }

static bool directed(es_vec3 d)
{
    return es_all_within(&d.x, 3, ES_WORLD_EXTENT) && (double)d.x * (double)d.x + (double)d.y * (double)d.y + (double)d.z * (double)d.z > 1e-20;
}

static bool on_surface(const es_anchor* a) { return es_anchor_valid(a) && a->kind != ES_ANCHOR_POINT; }

const char* es_constraint_valid(const es_constraint_desc* d, uint32_t* key)
{
    const es_anchor eye = {.kind = ES_ANCHOR_POINT, .point = {d->eye[0], d->eye[1], d->eye[2]}};
    const size_t length = d->parameter.name ? strlen(d->parameter.name) : 0;
    *key = UINT32_MAX;
    if (!on_surface(&d->reflecting)) return "its reflecting handle must be on a surface, with u and v of 0 … 1 that sum to no more";
    if (!es_anchor_valid(&d->reflected)) return "its reflected handle must be finite and within 1e9 and, on a triangle, have u and v of 0 … 1 that sum to no more";
    if (!es_all_within(&d->direction.x, 3, ES_WORLD_EXTENT) || (d->refraction && !directed(d->direction))) return "its direction must be finite, and a refraction must have one";
    if (!es_anchor_valid(&eye) || !es_all_within(&d->orientation.x, 4, ES_WORLD_EXTENT)) return "the eye and the orientation of its view must be finite and within 1e9";
    if (!es_within(d->fov_y, 0, 3.1f)) return "the fov_y of its view must lie in 0 … 3.1 radians";
    if ((uint32_t)d->parameter.kind > ES_EDIT_NAMED || d->parameter.axis > 2) return "its parameter must be of es_edit_parameter_kind, with an axis of 0 … 2";
    if (length >= ES_EDIT_NAME || (d->parameter.kind == ES_EDIT_NAMED && !length)) return "the name of its parameter must have 1 … 63 bytes";
    if (d->key_count > ES_EDIT_KEYS || (d->key_count && !d->keys)) return "it may have up to 4096 keys";
    for (uint32_t i = 0; i < d->key_count; i++) {
        const es_constraint_key* k = &d->keys[i];
        *key = i;
        if (!es_within(k->at, -ES_WORLD_EXTENT, ES_WORLD_EXTENT) || (i && k->at <= d->keys[i - 1].at)) return "must be at a number within 1e9, greater than the one before";
        if (!on_surface(&k->reflecting) || !es_anchor_valid(&k->reflected)) return "must have a reflecting handle on a surface, and places that are finite and, on a triangle, within it";
        if (!es_all_within(&k->direction.x, 3, ES_WORLD_EXTENT) || (d->refraction && !directed(k->direction))) return "must have a finite direction, and of a refraction one that is not zero";
    }
    return NULL;
}

static es_result check(es_context* context, const es_constraint_desc* d)
{
    uint32_t key;
    const char* wrong = es_constraint_valid(d, &key);
    if (!wrong) return ES_OK;
    if (key != UINT32_MAX) return es_fail(context, ES_INVALID_ARGUMENT, "constraint '%.64s': key %u %s", d->name ? d->name : "", key, wrong);
    return es_fail(context, ES_INVALID_ARGUMENT, "constraint '%.64s': %s", d->name ? d->name : "", wrong);
}

void es_constraint_object_free(es_context* context, es_constraint_object* constraint)
{
    es_release(context, (void*)constraint->desc.keys, constraint->desc.key_count * sizeof *constraint->desc.keys);
    constraint->desc.keys = NULL;
    constraint->desc.key_count = 0;
    es_geodesic_field_free(context, &constraint->field);
}

bool es_constraint_put(es_context* context, es_constraint_object* constraint, const es_constraint_desc* desc)
{
    es_constraint_key* keys = NULL;
    if (desc->key_count) {
        keys = es_allocate_array(context, desc->key_count, sizeof *keys);
        if (!keys) return false;
        memcpy(keys, desc->keys, desc->key_count * sizeof *keys);
    }
    char name[ES_EDIT_NAME] = {0}; /* desc's may be the object's own */
    if (desc->parameter.name) strncpy(name, desc->parameter.name, sizeof name - 1);
    es_release(context, (void*)constraint->desc.keys, constraint->desc.key_count * sizeof *constraint->desc.keys);
    constraint->desc = *desc;
    constraint->desc.name = NULL;
    constraint->desc.keys = keys;
    memcpy(constraint->parameter_name, name, sizeof name);
    constraint->desc.parameter.name = name[0] ? constraint->parameter_name : NULL;
    return true;
}

static es_constraint_object* constraint_object(const es_world* world, es_constraint constraint) { return es_world_object(world, ES_OBJECT_CONSTRAINT, constraint.id); }

es_result es_world_add_constraint(es_world* world, const es_constraint_desc* desc, es_constraint* constraint)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    if (!desc || !constraint) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_add_constraint: desc and constraint must not be NULL");
    *constraint = (es_constraint){0};
    es_result result = check(context, desc);
    if (result != ES_OK) return result;
    es_edits* edits = es_edits_of(world);
    if (!edits || !es_edits_reserve(world, 0, 1, 0)) return es_context_last_result(context);
    es_constraint_object* object = es_slots_add(context, &world->slots[ES_OBJECT_CONSTRAINT], "constraint", desc->name);
    if (!object) return es_context_last_result(context);
    if (!es_constraint_put(context, object, desc)) {
        es_slots_remove(context, &world->slots[ES_OBJECT_CONSTRAINT], &object->object);
        return es_context_last_result(context);
    }
    edits->changes++;
    constraint->id = object->object.id;
    es_edits_note(world, ES_OBJECT_CONSTRAINT, constraint->id);
    return ES_OK;
}

es_result es_world_set_constraint(es_world* world, es_constraint constraint, const es_constraint_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_constraint_object* object = constraint_object(world, constraint);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_constraint: desc must not be NULL");
    es_result result = check(world->context, desc);
    if (result != ES_OK) return result;
    if (!es_constraint_put(world->context, object, desc)) return es_context_last_result(world->context);
    world->edits->changes++;
    es_edits_note(world, ES_OBJECT_CONSTRAINT, constraint.id);
    return ES_OK;
}

es_result es_world_get_constraint(const es_world* world, es_constraint constraint, es_constraint_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    const es_constraint_object* object = constraint_object(world, constraint);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name ? object->object.name : "";
    return ES_OK;
}

es_result es_world_destroy_constraint(es_world* world, es_constraint constraint)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_constraint_object* object = constraint_object(world, constraint);
    if (!object) return ES_STALE_HANDLE;
    world->edits->changes++;
    es_constraint_object_free(world->context, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_CONSTRAINT], &object->object);
    es_edits_note(world, ES_OBJECT_CONSTRAINT, constraint.id);
    return ES_OK;
}

es_result es_world_get_constraint_state(const es_world* world, es_constraint constraint, es_constraint_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_constraint_object* object = constraint_object(world, constraint);
    if (!object) return ES_STALE_HANDLE;
    es_edits_refresh((es_world*)world);
    *state = object->state;
    return ES_OK;
}

/* ---- keys -------------------------------------------------------------------------------------------------------------------- */

static bool parameter_value(const es_world* world, const es_edit_parameter* p, float* value)
{
    *value = 0;
    switch (p->kind) {
    case ES_EDIT_TIME: *value = (float)world->time; return true;
    case ES_EDIT_NAMED: *value = es_world_get_parameter(world, p->name); return true;
    case ES_EDIT_LIGHT: {
        const es_light_object* light = es_slots_get(&world->slots[ES_OBJECT_LIGHT], p->light.id);
        if (light) *value = light->desc.off ? 0 : light->desc.intensity;
        return light != NULL;
    }
    case ES_EDIT_CAMERA: {
        const es_camera_object* camera = es_slots_get(&world->slots[ES_OBJECT_CAMERA], p->camera.id ? p->camera.id : world->active_camera.id);
        if (camera) *value = (float)es_node_position(world, camera->desc.node)[p->axis];
        return camera != NULL;
    }
    default:
        if (!es_slots_get(&world->slots[ES_OBJECT_NODE], p->node.id)) return false;
        *value = (float)es_node_position(world, p->node)[p->axis];
        return true;
    }
}

/* From a to b on the surface they are on: straight between their places in the mesh's axes, then to the nearest of the surface. */
static bool between(es_world* world, const es_anchor* a, const es_anchor* b, float t, es_anchor* now)
{
    es_anchored from, to;
    *now = *a;
    if (a->kind != ES_ANCHOR_SURFACE || a->instance.id != b->instance.id || t <= 0) return true;
    if (b->kind != ES_ANCHOR_SURFACE || !es_anchor_find(world, a, &from) || !es_anchor_find(world, b, &to)) return true;
    if (a->triangle == b->triangle) {
        now->u = a->u + t * (b->u - a->u);
        now->v = a->v + t * (b->v - a->v);
        return true;
    }
    float p[3], q[3];
    es_anchor_local(&from, a, p);
    es_anchor_local(&to, b, q);
    for (int k = 0; k < 3; k++) p[k] += t * (q[k] - p[k]);
    const es_surface* surface = es_surface_of(world, &world->edits->surfaces, from.mesh, ES_SURFACE_TREE);
    return surface && es_surface_closest(surface, p, &now->triangle, &now->u, &now->v);
}

es_edit_effect es_constraint_place(es_world* world, const es_constraint_object* constraint, es_constraint_state* state, es_vec3* direction)
{
    const es_constraint_desc* d = &constraint->desc;
    const es_anchor *reflected = &d->reflected, *reflected_next = &d->reflected;
    float t = 0;
    state->reflecting = d->reflecting;
    *direction = d->direction;
    if (d->key_count) {
        float value;
        if (!parameter_value(world, &d->parameter, &value)) return ES_EDIT_NO_PARAMETER;
        state->parameter = value;
        uint32_t low = 0, high = d->key_count; /* the last key that is not after value, or the first */
        while (high - low > 1) {
            uint32_t middle = (low + high) / 2;
            if (d->keys[middle].at <= value) low = middle;
            else high = middle;
        }
        const es_constraint_key *a = &d->keys[low], *b = &d->keys[low + 1 < d->key_count ? low + 1 : low];
        if (value > a->at && b != a) t = (float)(((double)value - (double)a->at) / ((double)b->at - (double)a->at));
        reflected = &a->reflected;
        reflected_next = &b->reflected;
        *direction = es_v3_add(a->direction, es_v3_scale(es_v3_sub(b->direction, a->direction), t));
        if (!between(world, &a->reflecting, &b->reflecting, t, &state->reflecting)) return ES_EDIT_NO_MEMORY;
    }
    es_edit_effect effect = state->reflecting.kind == ES_ANCHOR_SURFACE ? es_anchor_effect(world, &state->reflecting) : ES_EDIT_UNPLACED;
    if (effect != ES_EDIT_ACTIVE) return effect;
    es_anchor_resolve(world, &state->reflecting, state->position, &state->normal);
    memcpy(state->target, state->position, sizeof state->target);
    if (d->refraction) return ES_EDIT_ACTIVE;
    double p[3], q[3];
    if (!es_anchor_resolve(world, reflected, p, NULL)) return es_anchor_effect(world, reflected);
    if (t > 0) {
        if (!es_anchor_resolve(world, reflected_next, q, NULL)) return es_anchor_effect(world, reflected_next);
        for (int k = 0; k < 3; k++) p[k] += (double)t * (q[k] - p[k]);
    }
    memcpy(state->target, p, sizeof p);
    return ES_EDIT_ACTIVE;
}
