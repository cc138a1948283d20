/* Passes of methods that trace rays: the hierarchy they go through, and what the bias of virtual point lights leaves out. */
#include "gi/bias_compensation.h"
#include "gi/bounce_pass.h"
#include "gi/lamp_passes.h"
#include "gi/micro_passes.h"
#include "gi/reflections/reflection_passes.h"
#include "gi/renderer.h"
#include "gi/vpl_visibility.h"

/* Lights are part of what the scene holds, but not of its hierarchy, which is kept while they change. */
es_result es_pass_hierarchy(es_renderer* r, const es_frame_inputs* in, es_world* world)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const bool photons = es_micro_wants_photons(s), lights = s->method != ES_GI_MICRO && (s->method == ES_GI_VPL_TRACED || s->method == ES_GI_VPL_SAMPLED || s->traced_bias == ES_TRACED_COMPENSATED ||
        (s->near_distance > 0.0f && s->traced_bias == ES_TRACED_BOUNDED));
    const char* why = es_reflections_want_rays(r) || es_lamps_want_rays(r) || es_lamps_bounce_wants_rays(r, in) ? NULL : photons ? in->no_indirect : !lights && !es_bounce_wants_rays(s) ? "nothing is found by rays" : in->no_vpls ? in->no_vpls : r->first_vpls ? NULL : "the lights reach nothing";
    if (why) {
        es_plan_not_needed(plan, ES_PASS_HIERARCHY, why);
        es_trace_scene_free(&r->trace_scene);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_HIERARCHY);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    es_plan_reads(plan, &in->revisions.lights, sizeof in->revisions.lights);
    const bool emission = photons && !in->no_indirect && s->micro_emission;
    es_plan_reads(plan, &emission, sizeof emission);
    if (!es_plan_run(plan, ES_PASS_HIERARCHY)) return ES_OK;
    es_result result = es_trace_scene_take(&r->trace_scene, world, emission);
    if (result) es_trace_scene_free(&r->trace_scene);
    else es_plan_done(plan, ES_PASS_HIERARCHY, es_bvh_primitive_count(r->trace_scene.bvh));
    return result;
}

es_result es_pass_compensation(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = s->method == ES_GI_MICRO ? "gi is micro" : s->method == ES_GI_SECOND_ORDER ? "gi is second-order" : in->no_vpls ? in->no_vpls : !r->first_vpls ? "the lights reach nothing" : !plan->valid[ES_PASS_HIERARCHY] ? plan->stats[ES_PASS_HIERARCHY].skipped : s->traced_bias != ES_TRACED_COMPENSATED ? "traced.bias is not compensated" : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_COMPENSATION, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_COMPENSATION);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_HIERARCHY);
    float numbers[] = {es_geometry_bound(s, in), s->spread, s->lobe_roughness, in->extent, r->has_specular, s->glossy_vpls};
    es_plan_reads(plan, numbers, sizeof numbers);
    uint32_t words[] = {s->traced_samples, s->seed, s->vpls};
    es_plan_reads(plan, words, sizeof words);
    if (!es_plan_run(plan, ES_PASS_COMPENSATION)) return ES_OK;
    es_result result = es_planes_resize(r->context, &r->compensation, &r->gbuffer);
    if (result) return result;
    es_compensation_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .scene = &r->trace_scene, .views = r->light_views, .importances = r->importances, .view_count = r->light_count,
        .vpls = s->vpls, .spread = s->spread, .geometry_bound = es_geometry_bound(s, in), .lobe_roughness = s->lobe_roughness, .glossy_vpls = s->glossy_vpls, .pixel_lobes = r->has_specular,
        .offset = in->extent * ES_RAY_OFFSET_SHARE, .samples = s->traced_samples, .seed = s->seed, .result = {r->compensation.at[0], r->compensation.at[1], r->compensation.at[2]}};
    es_arena_reset(&r->arena);
    result = es_compensate_bias(r->context, &r->arena, &job);
    if (!result) es_plan_done(plan, ES_PASS_COMPENSATION, (uint64_t)r->gbuffer.width * r->gbuffer.height * s->traced_samples);
    return result;
}
