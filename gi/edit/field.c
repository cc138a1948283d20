#include "gi/edit/field.h"

#include <string.h>

#include "platform/maths.h"

static void put(float to[3], es_vec3 from)
{
    to[0] = from.x;
    to[1] = from.y;
    to[2] = from.z;
}

static bool mesh_of(const es_draw_list* list, uint32_t slot, es_edit_mesh* mesh)
{
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        if (instance->id != slot) continue;
        *mesh = (es_edit_mesh){slot + 1, instance->mesh->positions, instance->mesh->indices, instance->transform};
        return true;
    }
    return false;
}

/* Centre and squared radius of a ball round all strokes that add something. */
static void ball_of_strokes(const es_edit_stroke* strokes, uint32_t count, float ball[4])
{
    es_vec3 low = es_v3(1e30f, 1e30f, 1e30f), high = es_v3(-1e30f, -1e30f, -1e30f);
    for (uint32_t i = 0; i < count; i++) {
        const es_edit_stroke* s = &strokes[i];
        if (s->erases) continue;
        low = es_v3(es_minf(low.x, es_minf(s->from[0], s->to[0]) - s->radius), es_minf(low.y, es_minf(s->from[1], s->to[1]) - s->radius), es_minf(low.z, es_minf(s->from[2], s->to[2]) - s->radius));
        high = es_v3(es_maxf(high.x, es_maxf(s->from[0], s->to[0]) + s->radius), es_maxf(high.y, es_maxf(s->from[1], s->to[1]) + s->radius), es_maxf(high.z, es_maxf(s->from[2], s->to[2]) + s->radius));
    }
    if (low.x > high.x) {
        memset(ball, 0, 4 * sizeof *ball);
        ball[3] = -1.0f;
        return;
    }
    const es_vec3 half = es_v3_scale(es_v3_sub(high, low), 0.5f);
    put(ball, es_v3_add(low, half));
    ball[3] = es_v3_dot(half, half) * 1.0001f;
}

static es_result shape_of(es_context* context, es_arena* arena, const es_resolved_region* from, const es_draw_list* list, es_edit_region* to)
{
    *to = (es_edit_region){.shape = from->type == ES_REGION_GEODESIC ? ES_EDIT_GEODESIC : from->type == ES_REGION_FREE_FORM ? ES_EDIT_STROKES : ES_EDIT_BALL, .instance = from->instance == ES_EVERY_INSTANCE ? 0 : from->instance + 1,
        .radius = es_maxf(from->radius, 1e-6f), .border = from->border, .distances = from->distances};
    put(to->centre, from->centre);
    put(to->ball, from->centre);
    to->ball[3] = to->radius * to->radius * 1.0001f; /* distances over a surface are no shorter than through space, but for rounding */
    if (to->shape == ES_EDIT_GEODESIC && !mesh_of(list, from->instance, &to->mesh)) to->ball[3] = -1.0f;
    if (to->shape != ES_EDIT_STROKES) return ES_OK;
    es_edit_stroke* strokes = es_arena_allocate(arena, (from->stroke_count + 1) * sizeof *strokes);
    if (!strokes) return es_context_last_result(context);
    for (uint32_t i = 0; i < from->stroke_count; i++) {
        put(strokes[i].from, from->strokes[i].from);
        put(strokes[i].to, from->strokes[i].to);
        strokes[i].radius = from->strokes[i].radius;
        strokes[i].erases = from->strokes[i].erase;
    }
    to->strokes = strokes;
    to->stroke_count = from->stroke_count;
    ball_of_strokes(strokes, from->stroke_count, to->ball);
    /* weights count in its size, as in a ball's radius */
    to->radius = es_maxf(es_sqrt(es_maxf(to->ball[3], 0.0f)), 1e-6f);
    return ES_OK;
}

static bool reflected(const void* user, const es_resolved_constraint* c, es_vec3* direction)
{
    const es_vec3 seen = es_v3_sub(c->position, c->eye);
    if (!(es_v3_dot(seen, seen) > 0.0f)) return false;
    const es_vec3 i = es_v3_scale(seen, 1.0f / es_v3_length(seen));
    *direction = es_v3_normalize(es_v3_sub(i, es_v3_scale(c->normal, 2.0f * es_v3_dot(i, c->normal))), c->normal);
    return true;
}

typedef struct constraint_source { const es_edit_list* edits; bool refraction; es_edit_original original; const void* user; } constraint_source;

static es_result constraints_of(es_context* context, es_arena* arena, const constraint_source* source, const es_draw_list* list, es_edit_region* region)
{
    const es_edit_list* edits = source->edits;
    es_edit_constraint* constraints = es_arena_allocate(arena, (edits->constraint_count + 1) * sizeof *constraints);
    if (!constraints) return es_context_last_result(context);
    region->constraints = constraints;
    for (uint32_t i = 0; i < edits->constraint_count; i++) {
        const es_resolved_constraint* c = &edits->constraints[i];
        es_vec3 r;
        if (c->refraction != source->refraction || !(es_edit_influence(region, c->position, c->instance + 1, c->triangle) > 0.0f) || !source->original(source->user, c, &r)) continue;
        es_edit_constraint* to = &constraints[region->constraint_count++];
        *to = (es_edit_constraint){.position = {c->position.x, c->position.y, c->position.z}};
        es_edit_constraint_matrix(r, c->direction, to->matrix);
        /* the first one that measures along a surface says along which */
        if (c->distances && (region->mesh.positions || mesh_of(list, c->instance, &region->mesh)) && region->mesh.instance == c->instance + 1) to->distances = c->distances;
    }
    return ES_OK;
}

es_result es_edit_field_make(es_context* context, es_arena* arena, const es_edit_list* edits, const es_draw_list* list, bool refraction, es_edit_original original, const void* user, es_edit_field* field)
{
    *field = (es_edit_field){0};
    es_edit_region* regions = es_arena_allocate(arena, (edits->region_count + 1) * sizeof *regions);
    if (!regions) return es_context_last_result(context);
    field->regions = regions;
    const constraint_source source = {edits, refraction, original ? original : reflected, user};
    for (uint32_t i = 0; i < edits->region_count; i++) {
        es_edit_region* region = &regions[field->region_count];
        es_result result = shape_of(context, arena, &edits->regions[i], list, region);
        if (!result) result = constraints_of(context, arena, &source, list, region);
        if (result) return result;
        field->region_count += region->constraint_count > 0;
    }
    return ES_OK;
}
