/* The passes of the environment: what is seen of it, and the maps that light is looked up in. */
#include "gi/background.h"
#include "gi/renderer.h"

es_result es_pass_background(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    if (!in->has_environment) {
        es_plan_not_needed(plan, ES_PASS_BACKGROUND, "there is no environment");
        es_planes_free(r->context, &r->background);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_BACKGROUND);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads(plan, &in->revisions.environment, sizeof in->revisions.environment);
    if (!es_plan_run(plan, ES_PASS_BACKGROUND)) return ES_OK;
    es_result result = es_planes_resize(r->context, &r->background, &r->gbuffer);
    if (result) return result;
    es_background_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .environment = &in->environment, .out = {r->background.at[0], r->background.at[1], r->background.at[2]}};
    es_background_motion(&r->view, &job);
    es_background_fill(r->context, &job);
    es_plan_done(plan, ES_PASS_BACKGROUND, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return ES_OK;
}

es_result es_pass_environment(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    if (!in->has_environment || !in->has_geometry) {
        es_plan_not_needed(plan, ES_PASS_ENVIRONMENT, in->has_environment ? "nothing to light" : "there is no environment");
        es_environment_map_free(r->context, &r->environment);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_ENVIRONMENT);
    es_plan_reads(plan, &in->revisions.environment, sizeof in->revisions.environment);
    if (!es_plan_run(plan, ES_PASS_ENVIRONMENT)) return ES_OK;
    es_result result = es_environment_map_build(r->context, &in->environment, &r->environment);
    const float size = result ? 0.0f : r->environment.means.size[0];
    if (!result) es_plan_done(plan, ES_PASS_ENVIRONMENT, (uint64_t)(size * size));
    return result;
}
