/* From edits to what the light reads: made anew where something it depends on has changed, and counted up where it differs. */
#include "sim/edits/edits.h"

#include <string.h>

#include "platform/maths.h"

es_edits* es_edits_of(es_world* world)
{
    if (!world->edits) {
        world->edits = es_allocate_zero(world->context, sizeof *world->edits);
        if (world->edits) world->edits->changes = 1;
    }
    return world->edits;
}

static void resolved_free(es_context* context, es_resolved_edits* r)
{
    es_release(context, r->regions, r->region_capacity * sizeof *r->regions);
    es_release(context, r->constraints, r->constraint_capacity * sizeof *r->constraints);
    es_release(context, r->strokes, r->stroke_capacity * sizeof *r->strokes);
}

void es_edits_free(es_world* world)
{
    es_edits* edits = world->edits;
    if (!edits) return;
    es_context* context = world->context;
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_REGION].slot_count; slot++) {
        es_region_object* region = es_slots_at(&world->slots[ES_OBJECT_REGION], slot);
        if (region) es_region_object_free(context, region);
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_CONSTRAINT].slot_count; slot++) {
        es_constraint_object* constraint = es_slots_at(&world->slots[ES_OBJECT_CONSTRAINT], slot);
        if (constraint) es_constraint_object_free(context, constraint);
    }
    resolved_free(context, &edits->made);
    resolved_free(context, &edits->making);
    es_surfaces_free(context, &edits->surfaces);
    es_release(context, edits->parameters, edits->parameter_capacity * sizeof *edits->parameters);
    es_release(context, edits, sizeof *edits);
    world->edits = NULL;
}

static bool reserve(es_world* world, es_resolved_edits* r, size_t regions, size_t constraints, size_t strokes)
{
    es_context* context = world->context;
    return es_grow(context, (void**)&r->regions, &r->region_capacity, world->edits->list.region_count, regions, sizeof *r->regions) &&
           es_grow(context, (void**)&r->constraints, &r->constraint_capacity, world->edits->list.constraint_count, constraints, sizeof *r->constraints) &&
           es_grow(context, (void**)&r->strokes, &r->stroke_capacity, r->stroke_count, strokes, sizeof *r->strokes);
}

bool es_edits_reserve(es_world* world, size_t regions, size_t constraints, size_t strokes)
{
    es_edits* edits = world->edits;
    regions += world->slots[ES_OBJECT_REGION].live;
    constraints += world->slots[ES_OBJECT_CONSTRAINT].live;
    strokes += edits->strokes;
    bool good = reserve(world, &edits->made, regions, constraints, strokes) && reserve(world, &edits->making, regions, constraints, strokes);
    /* what was made may have gone elsewhere */
    edits->list.regions = edits->made.regions;
    edits->list.constraints = edits->made.constraints;
    for (uint32_t i = 0; i < edits->list.region_count; i++) edits->made.regions[i].strokes = NULL;
    edits->changes++;
    return good;
}

static es_vec3 relative(const es_world* world, const double p[3])
{
    return es_v3((float)(p[0] - world->origin[0]), (float)(p[1] - world->origin[1]), (float)(p[2] - world->origin[2]));
}

/* ---- regions ---------------------------------------------------------------------------------------------------------- */

static es_edit_effect resolve_strokes(es_world* world, es_region_object* region, es_resolved_region* out, es_resolved_edits* into)
{
    const es_region_desc* d = &region->desc;
    if (!d->stroke_count) return ES_EDIT_UNPLACED;
    es_resolved_stroke* strokes = into->strokes + into->stroke_count;
    double sum[3] = {0, 0, 0};
    for (uint32_t i = 0; i < d->stroke_count; i++) {
        double from[3], to[3];
        if (!es_anchor_resolve(world, &d->strokes[i].from, from, i ? NULL : &region->state.normal) || !es_anchor_resolve(world, &d->strokes[i].to, to, NULL)) return ES_EDIT_STALE;
        memset(&strokes[i], 0, sizeof strokes[i]);
        strokes[i].from = relative(world, from);
        strokes[i].to = relative(world, to);
        strokes[i].radius = d->strokes[i].radius;
        strokes[i].erase = d->strokes[i].erase;
        for (int k = 0; k < 3; k++) sum[k] += from[k] + to[k];
    }
    for (int k = 0; k < 3; k++) region->state.centre[k] = sum[k] / (2.0 * (double)d->stroke_count);
    into->stroke_count += d->stroke_count;
    out->stroke_count = d->stroke_count;
    out->instance = es_slot_of(d->strokes[0].from.instance.id);
    return ES_EDIT_ACTIVE;
}

/* *changed: is set when distances differ from what they were. */
static es_edit_effect resolve_region(es_world* world, es_region_object* region, es_resolved_region* out, es_resolved_edits* into, bool* changed)
{
    const es_region_desc* d = &region->desc;
    memset(out, 0, sizeof *out);
    region->state = (es_region_state){0};
    if (d->off) return ES_EDIT_OFF;
    out->handle.id = region->object.id;
    out->type = d->type;
    out->radius = d->radius;
    out->border = d->border;
    out->instance = ES_EVERY_INSTANCE;
    es_edit_effect effect = ES_EDIT_ACTIVE;
    if (d->type == ES_REGION_FREE_FORM) effect = resolve_strokes(world, region, out, into);
    else effect = es_anchor_effect(world, &d->centre);
    if (effect != ES_EDIT_ACTIVE) return effect;
    if (d->type != ES_REGION_FREE_FORM) es_anchor_resolve(world, &d->centre, region->state.centre, &region->state.normal);
    out->centre = relative(world, region->state.centre);
    if (d->type != ES_REGION_GEODESIC) return ES_EDIT_ACTIVE;
    if (d->centre.kind != ES_ANCHOR_SURFACE) return ES_EDIT_UNPLACED;
    out->instance = es_slot_of(d->centre.instance.id);
    return es_geodesic_field_refresh(world, &world->edits->surfaces, &region->field, &d->centre, d->radius > 0 ? d->radius : 1e-30f, changed) ? ES_EDIT_ACTIVE : ES_EDIT_NO_MEMORY;
}

/* ---- constraints ---------------------------------------------------------------------------------------------------------- */

static es_edit_effect resolve_constraint(es_world* world, es_constraint_object* constraint, const double active_eye[3], es_resolved_constraint* out, bool* changed)
{
    const es_constraint_desc* d = &constraint->desc;
    es_constraint_state* state = &constraint->state;
    memset(out, 0, sizeof *out);
    memset(state, 0, sizeof *state);
    es_vec3 direction;
    es_edit_effect effect = es_constraint_place(world, constraint, state, &direction);
    if (d->off) return ES_EDIT_OFF;
    if (effect != ES_EDIT_ACTIVE) return effect;
    es_anchored on;
    es_anchor_find(world, &state->reflecting, &on);
    out->handle.id = constraint->object.id;
    out->instance = es_slot_of(state->reflecting.instance.id);
    out->triangle = state->reflecting.triangle;
    out->u = state->reflecting.u;
    out->v = state->reflecting.v;
    out->position = relative(world, state->position);
    out->normal = state->normal;
    out->eye = relative(world, d->follows_view ? active_eye : d->eye);
    out->refraction = d->refraction;
    es_vec3 to = d->refraction ? es_mat4_direction(es_node_world(world, on.instance->desc.node), direction)
                               : es_v3((float)(state->target[0] - state->position[0]), (float)(state->target[1] - state->position[1]), (float)(state->target[2] - state->position[2]));
    double squared = (double)to.x * (double)to.x + (double)to.y * (double)to.y + (double)to.z * (double)to.z;
    if (!(squared > 1e-24)) return ES_EDIT_NO_DIRECTION;
    double scale = 1.0 / __builtin_sqrt(squared);
    out->direction = es_v3((float)((double)to.x * scale), (float)((double)to.y * scale), (float)((double)to.z * scale));
    out->target = d->refraction ? es_v3_add(out->position, out->direction) : relative(world, state->target);
    if (!d->geodesic) return ES_EDIT_ACTIVE;
    return es_geodesic_field_refresh(world, &world->edits->surfaces, &constraint->field, &state->reflecting, 0, changed) ? ES_EDIT_ACTIVE : ES_EDIT_NO_MEMORY;
}

static float largest_influence(const es_world* world, const es_edit_list* list, const es_anchor* anchor, es_vec3 place, es_region only)
{
    es_anchored on = {0};
    const uint32_t none[3] = {0, 0, 0}, *corners = none;
    uint32_t instance = ES_EVERY_INSTANCE - 1;
    float edges[3] = {0, 0, 0}, most = 0;
    if (anchor->kind == ES_ANCHOR_SURFACE) {
        if (!es_anchor_find(world, anchor, &on)) return 0;
        instance = es_slot_of(anchor->instance.id);
        corners = on.mesh->raster.indices + 3 * (size_t)anchor->triangle;
        es_anchor_edges(world, &on, anchor->triangle, edges);
    }
    for (uint32_t i = 0; i < list->region_count; i++)
        if (!only.id || list->regions[i].handle.id == only.id) most = es_maxf(most, es_region_influence(&list->regions[i], instance, corners, edges, anchor->u, anchor->v, place));
    return most;
}

/* ---- the list ---------------------------------------------------------------------------------------------------------------- */

static void link_arrays(es_world* world, es_resolved_edits* made, uint32_t region_count, uint32_t constraint_count)
{
    size_t strokes = 0;
    for (uint32_t i = 0; i < region_count; i++) {
        es_resolved_region* r = &made->regions[i];
        const es_region_object* region = es_slots_get(&world->slots[ES_OBJECT_REGION], r->handle.id);
        r->strokes = r->stroke_count ? made->strokes + strokes : NULL;
        r->distances = r->type == ES_REGION_GEODESIC ? region->field.distances : NULL;
        strokes += r->stroke_count;
    }
    for (uint32_t i = 0; i < constraint_count; i++) {
        es_resolved_constraint* c = &made->constraints[i];
        const es_constraint_object* constraint = es_slots_get(&world->slots[ES_OBJECT_CONSTRAINT], c->handle.id);
        c->distances = constraint->desc.geodesic ? constraint->field.distances : NULL;
    }
}

static void unlink_arrays(es_resolved_edits* made, uint32_t region_count, uint32_t constraint_count)
{
    for (uint32_t i = 0; i < region_count; i++) made->regions[i].strokes = NULL, made->regions[i].distances = NULL;
    for (uint32_t i = 0; i < constraint_count; i++) made->constraints[i].distances = NULL;
}

/* Something whose changes no revision tells of, so that the list is to be made each time it is asked for. */
static bool always(const es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_CONSTRAINT];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_constraint_object* c = es_slots_at(slots, slot);
        if (c && c->desc.key_count && (c->desc.parameter.kind == ES_EDIT_LIGHT || (c->desc.parameter.kind == ES_EDIT_CAMERA && c->desc.parameter.camera.id))) return true;
    }
    return false;
}

void es_edits_refresh(es_world* world)
{
    es_world_refresh(world);
    es_edits* edits = world->edits;
    if (!edits) return;
    es_edit_inputs inputs;
    memset(&inputs, 0, sizeof inputs);
    inputs = (es_edit_inputs){.edits = edits->changes, .geometry = world->revisions.geometry, .poses = world->pose_changes, .camera = world->revisions.camera, .time = world->time};
    memcpy(inputs.origin, world->origin, sizeof inputs.origin);
    if (memcmp(&inputs, &edits->inputs, sizeof inputs) == 0 && !always(world)) return;
    edits->inputs = inputs;
    es_fp_environment environment = es_fp_enter();
    double eye[3] = {0, 0, 0};
    const es_camera_object* camera = es_slots_get(&world->slots[ES_OBJECT_CAMERA], world->active_camera.id);
    if (camera) memcpy(eye, es_node_position(world, camera->desc.node), sizeof eye);
    es_resolved_edits *made = &edits->made, *making = &edits->making;
    const es_edit_list before = edits->list;
    const size_t strokes_before = made->stroke_count;
    bool changed = false, short_of_memory = false;
    uint32_t regions = 0, constraints = 0;
    making->stroke_count = 0;
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_REGION].slot_count; slot++) {
        es_region_object* region = es_slots_at(&world->slots[ES_OBJECT_REGION], slot);
        if (!region) continue;
        region->state.effect = resolve_region(world, region, &making->regions[regions], making, &changed);
        short_of_memory |= region->state.effect == ES_EDIT_NO_MEMORY;
        if (region->state.effect == ES_EDIT_ACTIVE) regions++;
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_CONSTRAINT].slot_count; slot++) {
        es_constraint_object* constraint = es_slots_at(&world->slots[ES_OBJECT_CONSTRAINT], slot);
        if (!constraint) continue;
        constraint->state.effect = resolve_constraint(world, constraint, eye, &making->constraints[constraints], &changed);
        short_of_memory |= constraint->state.effect == ES_EDIT_NO_MEMORY;
        if (constraint->state.effect == ES_EDIT_ACTIVE) constraints++;
    }
    if (short_of_memory) edits->inputs.edits = 0; /* there may be some the next time */
    edits->list = (es_edit_list){making->regions, making->constraints, regions, constraints, edits->frozen, edits->frozen ? relative(world, edits->eye) : es_v3(0, 0, 0)};
    unlink_arrays(made, before.region_count, before.constraint_count);
    changed |= before.region_count != regions || before.constraint_count != constraints || before.frozen != edits->list.frozen || memcmp(&before.eye, &edits->list.eye, sizeof before.eye) != 0 ||
               strokes_before != making->stroke_count;
    changed = changed || (regions && memcmp(made->regions, making->regions, regions * sizeof *made->regions) != 0) ||
              (constraints && memcmp(made->constraints, making->constraints, constraints * sizeof *made->constraints) != 0) ||
              (making->stroke_count && memcmp(made->strokes, making->strokes, making->stroke_count * sizeof *made->strokes) != 0);
    if (changed) world->revisions.edits++;
    link_arrays(world, making, regions, constraints);
    es_resolved_edits swap = *made;
    *made = *making;
    *making = swap;
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_CONSTRAINT].slot_count; slot++) {
        es_constraint_object* constraint = es_slots_at(&world->slots[ES_OBJECT_CONSTRAINT], slot);
        if (constraint && constraint->state.effect == ES_EDIT_ACTIVE)
            constraint->state.influence = largest_influence(world, &edits->list, &constraint->state.reflecting, relative(world, constraint->state.position), (es_region){0});
    }
    es_fp_leave(environment);
}

const es_edit_list* es_world_edits(const es_world* world)
{
    static const es_edit_list none = {0};
    if (!world) return NULL;
    es_edits_refresh((es_world*)world);
    return world->edits ? &world->edits->list : &none;
}

float es_world_region_influence(const es_world* world, es_region region, const es_anchor* anchor)
{
    if (!world || !anchor || !es_anchor_valid(anchor) || !es_world_object(world, ES_OBJECT_REGION, region.id)) return 0;
    es_edits_refresh((es_world*)world);
    double position[3];
    es_fp_environment environment = es_fp_enter();
    float influence = 0;
    if (es_anchor_resolve(world, anchor, position, NULL)) influence = largest_influence(world, &world->edits->list, anchor, relative(world, position), region);
    es_fp_leave(environment);
    return influence;
}

const char* es_edit_effect_text(es_edit_effect effect)
{
    static const char* const texts[] = {[ES_EDIT_ACTIVE] = "in effect", [ES_EDIT_OFF] = "it is off", [ES_EDIT_UNPLACED] = "a handle of it has no place", [ES_EDIT_STALE] = "what it is on is gone",
        [ES_EDIT_NO_PARAMETER] = "what its keys go by is gone", [ES_EDIT_NO_DIRECTION] = "its two handles are at the same place", [ES_EDIT_NO_MEMORY] = "there was no memory for its distances"};
    return (uint32_t)effect < sizeof texts / sizeof texts[0] ? texts[effect] : "?";
}
