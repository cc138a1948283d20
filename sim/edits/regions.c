/* Regions: where edits may change anything. */
#include "sim/edits/edit_state.h"

#include <string.h>

#include "platform/maths.h"

es_region_desc es_default_region_desc(void) { return (es_region_desc){.radius = 0.5f, .border = 0.2f}; }

const char* es_region_valid(const es_region_desc* d, uint32_t* stroke)
{
    *stroke = UINT32_MAX;
    if ((uint32_t)d->type > ES_REGION_FREE_FORM) return "its type must be one of es_region_type";
    if (!es_within(d->radius, 0, ES_WORLD_EXTENT) || !es_within(d->border, 0, ES_WORLD_EXTENT)) return "its radius and border must lie in 0 … 1e9 m";
    if (!es_anchor_valid(&d->centre)) return "its centre must be finite and within 1e9 and, on a triangle, have u and v of 0 … 1 that sum to no more";
    if (d->stroke_count > ES_EDIT_STROKES || (d->stroke_count && !d->strokes)) return "it may have up to 4096 strokes";
    for (uint32_t i = 0; i < d->stroke_count; i++) {
        const es_region_stroke* s = &d->strokes[i];
        *stroke = i;
        if (s->from.kind != ES_ANCHOR_SURFACE || s->to.kind != ES_ANCHOR_SURFACE || !es_anchor_valid(&s->from) || !es_anchor_valid(&s->to)) return "must lead from one place of a surface to another";
        if (!es_within(s->radius, 0, ES_WORLD_EXTENT)) return "must have a radius of 0 … 1e9 m";
        if (s->from.instance.id != d->strokes[0].from.instance.id || s->to.instance.id != s->from.instance.id) return "must be on the instance that the first one is on";
    }
    return NULL;
}

static es_result check(es_context* context, const es_region_desc* d)
{
    uint32_t stroke;
    const char* wrong = es_region_valid(d, &stroke);
    if (!wrong) return ES_OK;
    if (stroke != UINT32_MAX) return es_fail(context, ES_INVALID_ARGUMENT, "region '%.64s': stroke %u %s", d->name ? d->name : "", stroke, wrong);
    return es_fail(context, ES_INVALID_ARGUMENT, "region '%.64s': %s", d->name ? d->name : "", wrong);
}

void es_region_object_free(es_context* context, es_region_object* region)
{
    es_release(context, (void*)region->desc.strokes, region->desc.stroke_count * sizeof *region->desc.strokes);
    region->desc.strokes = NULL;
    region->desc.stroke_count = 0;
    es_geodesic_field_free(context, &region->field);
}

bool es_region_put(es_context* context, es_region_object* region, const es_region_desc* desc)
{
    es_region_stroke* strokes = NULL;
    if (desc->stroke_count) {
        strokes = es_allocate_array(context, desc->stroke_count, sizeof *strokes);
        if (!strokes) return false;
        memcpy(strokes, desc->strokes, desc->stroke_count * sizeof *strokes);
    }
    es_release(context, (void*)region->desc.strokes, region->desc.stroke_count * sizeof *region->desc.strokes);
    region->desc = *desc;
    region->desc.name = NULL;
    region->desc.strokes = strokes;
    return true;
}

static es_region_object* region_object(const es_world* world, es_region region) { return es_world_object(world, ES_OBJECT_REGION, region.id); }

es_result es_world_add_region(es_world* world, const es_region_desc* desc, es_region* region)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    if (!desc || !region) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_add_region: desc and region must not be NULL");
    *region = (es_region){0};
    es_result result = check(context, desc);
    if (result != ES_OK) return result;
    es_edits* edits = es_edits_of(world);
    if (!edits || !es_edits_reserve(world, 1, 0, desc->stroke_count)) return es_context_last_result(context);
    es_region_object* object = es_slots_add(context, &world->slots[ES_OBJECT_REGION], "region", desc->name);
    if (!object) return es_context_last_result(context);
    if (!es_region_put(context, object, desc)) {
        es_slots_remove(context, &world->slots[ES_OBJECT_REGION], &object->object);
        return es_context_last_result(context);
    }
    edits->strokes += desc->stroke_count;
    edits->changes++;
    region->id = object->object.id;
    es_edits_note(world, ES_OBJECT_REGION, region->id);
    return ES_OK;
}

es_result es_world_set_region(es_world* world, es_region region, const es_region_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    es_region_object* object = region_object(world, region);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(context, ES_INVALID_ARGUMENT, "es_world_set_region: desc must not be NULL");
    es_result result = check(context, desc);
    if (result != ES_OK) return result;
    const uint32_t before = object->desc.stroke_count;
    if (!es_edits_reserve(world, 0, 0, desc->stroke_count) || !es_region_put(context, object, desc)) return es_context_last_result(context);
    world->edits->strokes = world->edits->strokes - before + desc->stroke_count;
    world->edits->changes++;
    es_edits_note(world, ES_OBJECT_REGION, region.id);
    return ES_OK;
}

es_result es_world_get_region(const es_world* world, es_region region, es_region_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    const es_region_object* object = region_object(world, region);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name ? object->object.name : "";
    return ES_OK;
}

es_result es_world_destroy_region(es_world* world, es_region region)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_region_object* object = region_object(world, region);
    if (!object) return ES_STALE_HANDLE;
    world->edits->strokes -= object->desc.stroke_count;
    world->edits->changes++;
    es_region_object_free(world->context, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_REGION], &object->object);
    es_edits_note(world, ES_OBJECT_REGION, region.id);
    return ES_OK;
}

es_result es_world_get_region_state(const es_world* world, es_region region, es_region_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_region_object* object = region_object(world, region);
    if (!object) return ES_STALE_HANDLE;
    es_edits_refresh((es_world*)world);
    *state = object->state;
    return ES_OK;
}

/* ---- influence ---------------------------------------------------------------------------------------------------------- */

/* 1 up to `from`, 0 from `to` on. */
static float falls(float from, float to, float x)
{
    if (x >= to) return 0;
    if (x <= from) return 1;
    float t = (x - from) / (to - from);
    return 1 - t * t * (3 - 2 * t);
}

static float distance_to_line(es_vec3 p, es_vec3 a, es_vec3 b)
{
    es_vec3 along = es_v3_sub(b, a), to = es_v3_sub(p, a);
    float squared = es_v3_dot(along, along), t = squared > 0 ? es_clampf(es_v3_dot(to, along) / squared, 0, 1) : 0;
    return es_v3_length(es_v3_sub(to, es_v3_scale(along, t)));
}

float es_region_influence(const es_resolved_region* r, uint32_t instance, const uint32_t corners[3], const float edges_squared[3], float u, float v, es_vec3 place)
{
    if (r->instance != ES_EVERY_INSTANCE && r->instance != instance) return 0;
    float distance;
    switch (r->type) {
    case ES_REGION_EUCLIDEAN: distance = es_v3_length(es_v3_sub(place, r->centre)); break;
    case ES_REGION_GEODESIC: {
        const float d[3] = {r->distances[corners[0]], r->distances[corners[1]], r->distances[corners[2]]};
        distance = es_geodesic_between(d, edges_squared, u, v);
        break;
    }
    default:
        distance = ES_WORLD_EXTENT;
        for (uint32_t i = 0; i < r->stroke_count; i++) {
            const es_resolved_stroke* s = &r->strokes[i];
            float d = distance_to_line(place, s->from, s->to);
            distance = s->erase ? es_maxf(distance, s->radius - d) : es_minf(distance, d - s->radius);
        }
        return falls(-r->border, 0, distance);
    }
    return falls(r->radius - r->border, r->radius, distance);
}
