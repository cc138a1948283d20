#include "gi/edit/edit_pass.h"

static es_edit_job job_of(const es_renderer* r, const es_edit_field* field)
{
    return (es_edit_job){.gbuffer = &r->gbuffer, .rays = r->rays, .regions = field->regions, .region_count = field->region_count};
}

static const char* nothing(const es_renderer* r, const es_edit_list* edits)
{
    if (!r->settings.reflection_edits) return "reflections.edits is off";
    if (!edits->frozen && !(edits->region_count && edits->constraint_count)) return "no reflection is edited";
    return NULL;
}

es_result es_pass_edits(es_renderer* r, const es_frame_inputs* in, const es_world* world)
{
    es_plan* plan = &r->plan;
    const es_edit_list* edits = es_world_edits(world);
    const char* why = nothing(r, edits);
    if (why) {
        es_plan_not_needed(plan, ES_PASS_EDITS, why);
        es_edit_buffers_free(r->context, &r->edits);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_EDITS);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads(plan, &in->revisions.edits, sizeof in->revisions.edits);
    if (!es_plan_run(plan, ES_PASS_EDITS)) return ES_OK;
    es_result result = es_planes_resize(r->context, &r->edits.directions, &r->gbuffer);
    es_edit_field field;
    es_arena_reset(&r->arena);
    if (!result) result = es_edit_field_make(r->context, &r->arena, edits, in->list, false, NULL, NULL, &field);
    if (result) return result;
    es_edit_job job = job_of(r, &field);
    job.frozen = edits->frozen;
    const float eye[3] = {edits->eye.x, edits->eye.y, edits->eye.z};
    for (int k = 0; k < 3; k++) {
        job.eye[k] = eye[k];
        job.edited[k] = r->edits.directions.at[k];
    }
    es_edit_directions(r->context, &job);
    es_plan_done(plan, ES_PASS_EDITS, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return ES_OK;
}

void es_edited_reflections(const es_renderer* r, const float* edited[3])
{
    for (int k = 0; k < 3; k++) edited[k] = r->plan.valid[ES_PASS_EDITS] ? r->edits.directions.at[k] : NULL;
}

bool es_edits_refraction(const es_renderer* r, const es_world* world)
{
    const es_edit_list* edits = es_world_edits(world);
    bool any = false;
    for (uint32_t i = 0; i < edits->constraint_count; i++) any |= edits->constraints[i].refraction;
    return any && edits->region_count && r->settings.reflection_edits;
}

es_result es_edit_refraction(es_renderer* r, const es_frame_inputs* in, const es_world* world, es_edit_original original, const void* user, const float* const directions[3], float* const edited[3])
{
    es_edit_field field;
    es_arena_reset(&r->arena);
    const es_result result = es_edit_field_make(r->context, &r->arena, es_world_edits(world), in->list, true, original, user, &field);
    if (result) return result;
    es_edit_job job = job_of(r, &field);
    for (int k = 0; k < 3; k++) {
        job.original[k] = directions[k];
        job.edited[k] = edited[k];
    }
    es_edit_directions(r->context, &job);
    return ES_OK;
}

void es_edit_buffers_free(es_context* context, es_edit_buffers* buffers) { es_planes_free(context, &buffers->directions); }
