#include "gi/indirect.h"

#include <string.h>

#include "gi/edit/edit_pass.h"
#include "gi/lit.h"
#include "gi/near_light.h"
#include "gi/screen/residual_pass.h"
#include "gi/surface.h"
#include "gi/vpl_visibility.h"

void es_indirect_planes_free(es_context* context, es_indirect_planes* planes)
{
    es_planes_free(context, &planes->irradiance);
    es_planes_free(context, &planes->specular);
}

/* Textures may make any roughness of it. */
static bool material_has_lobe(const es_material_desc* m)
{
    es_surface surface = es_surface_of(m->model, es_v3(1, 1, 1), m->metallic, m->model == ES_SURFACE_PHONG ? m->exponent : m->roughness, m->specular);
    return es_surface_has_lobe(&surface) || (m->model == ES_SURFACE_METALLIC_ROUGHNESS && m->metallic_roughness_texture.image);
}

bool es_surfaces_have_lobes(const es_draw_list* list)
{
    for (uint32_t i = 0; i < list->instance_count; i++)
        if (material_has_lobe(&list->materials[list->instances[i].material])) return true;
    return false;
}

bool es_frame_has_lobes(const es_renderer* renderer, const es_draw_list* list)
{
    for (uint32_t i = 0; i < renderer->vpl_count; i++)
        if (renderer->vpls[i].glossy) return true;
    return es_surfaces_have_lobes(list);
}

bool es_indirect_is_there(const es_renderer* r) { return r->plan.valid[ES_PASS_SHADING] || r->plan.valid[ES_PASS_MICRO] || r->plan.valid[ES_PASS_SECOND_ORDER]; }

void es_indirect_reads(es_plan* plan)
{
    es_plan_reads_pass(plan, ES_PASS_SHADING);
    es_plan_reads_pass(plan, ES_PASS_MICRO);
    es_plan_reads_pass(plan, ES_PASS_SECOND_ORDER);
    es_plan_reads_pass(plan, ES_PASS_MICRO_UPSAMPLE);
}

const char* es_indirect_nothing(const es_renderer* r, const es_frame_inputs* in)
{
    return in->no_indirect ? in->no_indirect : r->settings.method != ES_GI_MICRO && !r->vpl_count ? "the lights reach nothing" : NULL;
}

bool es_indirect_is_halved(const es_renderer_settings* s) { return s->half_resolution && s->method != ES_GI_MICRO && s->method != ES_GI_SECOND_ORDER; }

/* What the indirect light is shaded and filtered on. */
const es_gbuffer* es_indirect_gbuffer(const es_renderer* r) { return es_indirect_is_halved(&r->frame.settings) ? &r->half : &r->gbuffer; }

/* At every pixel, whatever the setting of the pattern. */
static bool every_light(const es_renderer_settings* s) { return s->method == ES_GI_VPL_TRACED && !s->traced_interleave; }
static uint32_t interleave_of(const es_renderer_settings* s) { return every_light(s) ? 1 : s->interleave; }
static float near_distance_of(const es_renderer* r) { return r->frame.settings.traced_bias == ES_TRACED_BOUNDED ? r->frame.settings.near_distance * r->frame.extent : 0.0f; }

float es_vpl_spread(const es_renderer_settings* s) { return !es_residual_nothing(s) || s->screen_bounce ? 0.0f : s->spread; }

/* ---- shading ---------------------------------------------------------------------------------------------------------------- */

/* picture: what belongs to its pixels (edited reflections, repaired shadows) counts */
static es_result shade(es_renderer* r, const es_lit_surfaces* of, uint32_t lights, bool picture, es_planes* irradiance, es_planes* specular)
{
    const es_renderer_settings* s = &r->frame.settings;
    const float extent = r->frame.extent, near = near_distance_of(r);
    const bool sampled = s->method == ES_GI_VPL_SAMPLED, traced = sampled || s->method == ES_GI_VPL_TRACED;
    es_result result = es_planes_resize(r->context, irradiance, of->gbuffer);
    if (!result && of->lobes) result = es_planes_resize(r->context, specular, of->gbuffer);
    if (result) return result;
    es_shade_job job = {.gbuffer = of->gbuffer, .rays = of->rays, .sampled = sampled, .seed = s->seed, .vpls = r->vpls, .vpl_count = r->vpl_count, .dark_count = r->vpl_count - lights,
        .maps = r->maps.texels, .map_size = r->maps.size, .far_distance = r->maps.far_distance, .bias = s->ism_bias * extent, .slope_bias = s->ism_slope_bias * extent, .spread = es_vpl_spread(s), .lobe_roughness = s->lobe_roughness,
        .geometry_bound = es_geometry_bound(s, &(es_frame_inputs){.extent = extent}), .interleave = interleave_of(s)};
    for (int k = 0; k < 3; k++) {
        job.irradiance[k] = irradiance->at[k];
        job.specular[k] = of->lobes ? specular->at[k] : NULL;
    }
    job.lit = of->lobes ? specular->lit : NULL;
    if (picture) {
        es_edited_reflections(r, job.edited);
        job.edited_stride = r->gbuffer.stride;
        job.edited_spacing = s->half_resolution ? 2 : 1;
    }
    if (picture && s->screen_repair) {
        job.repair = &r->screen.stack.views[0];
        job.repair_samples = s->screen_repair;
        job.repair_most = s->screen_radius * extent;
    }
    es_arena_reset(&r->arena);
    es_vpl_visibility visibility;
    if (traced) {
        result = es_vpl_visibility_prepare(&r->arena, &r->trace_scene, r->vpls, r->vpl_count, extent, &visibility);
        job.visibility = &visibility.shade;
        job.maps = NULL;
    }
    es_near_light near_light;
    if (near > 0.0f) {
        near_light = es_near_light_of(&r->trace_scene, near, extent * ES_RAY_OFFSET_SHARE);
        job.near = &near_light.shade;
        job.geometry_bound = 1.0f / (near * near);
        job.spread = 0.0f;
    }
    if (s->traced_bias == ES_TRACED_UNBOUNDED) {
        job.geometry_bound = ES_UNBOUNDED;
        job.spread = job.lobe_roughness = 0.0f;
    }
    return result ? result : es_shade(r->context, &r->arena, &job);
}

static es_lit_surfaces picture_of(const es_renderer* r)
{
    return (es_lit_surfaces){es_indirect_gbuffer(r), r->frame.settings.half_resolution ? es_pixel_rays_halve(&r->rays) : r->rays, r->has_specular};
}

es_result es_indirect_shade(es_renderer* r, uint32_t lights, es_planes* irradiance, es_planes* specular)
{
    const es_lit_surfaces picture = picture_of(r);
    return shade(r, &picture, lights, true, irradiance, specular);
}

es_result es_pass_shading(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = es_indirect_nothing(r, in);
    if (!why && s->method == ES_GI_MICRO) why = "gi is micro";
    if (!why && s->method == ES_GI_SECOND_ORDER) why = "gi is second-order";
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SHADING, why);
        return ES_OK;
    }
    r->has_specular = es_frame_has_lobes(r, in->solid);
    es_plan_begin(plan, ES_PASS_SHADING);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_LAMP_BOUNCE);
    es_plan_reads_pass(plan, ES_PASS_ISM);
    es_plan_reads_pass(plan, ES_PASS_CLASSIC);
    es_plan_reads_pass(plan, ES_PASS_HIERARCHY);
    es_plan_reads_pass(plan, ES_PASS_BOUNCES);
    es_plan_reads_pass(plan, ES_PASS_EDITS);
    if (s->screen_repair) es_plan_reads_pass(plan, ES_PASS_SCREEN_VIEWS);
    const bool sampled = s->method == ES_GI_VPL_SAMPLED, unbounded = s->traced_bias == ES_TRACED_UNBOUNDED;
    const uint32_t interleave = interleave_of(s);
    float numbers[] = {s->ism_bias, s->ism_slope_bias, es_geometry_bound(s, in), es_vpl_spread(s), s->lobe_roughness, (float)interleave, in->extent, r->has_specular, unbounded, sampled, s->half_resolution, near_distance_of(r), (float)s->seed, (float)s->screen_repair, s->screen_radius};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_SHADING)) return ES_OK;
    es_result result = ES_OK;
    if (s->half_resolution && s->temporal && r->half.memory && !plan->stats[ES_PASS_VISIBILITY].skipped) result = es_history_keep(r->context, &r->half, &r->history.half);
    if (s->half_resolution && !result) result = es_gbuffer_halve(r->context, &r->gbuffer, &r->half);
    if (!result) result = es_indirect_shade(r, r->vpl_count, &r->irradiance, &r->specular);
    const es_gbuffer* shaded = es_indirect_gbuffer(r);
    if (!result) es_plan_done(plan, ES_PASS_SHADING, (uint64_t)shaded->width * shaded->height * r->vpl_count / (interleave * interleave));
    return result;
}

/* Last frame's light has come in before the filter. */
static bool blended_first(const es_renderer* r) { return r->plan.valid[ES_PASS_TEMPORAL] && r->frame.settings.temporal_stage == ES_TEMPORAL_BEFORE_FILTER; }
static const es_planes* shaded_irradiance(const es_renderer* r) { return blended_first(r) ? &r->history.irradiance[r->history.current] : &r->irradiance; }
static const es_planes* shaded_specular(const es_renderer* r) { return blended_first(r) ? &r->history.specular[r->history.current] : &r->specular; }

/* ---- filter ------------------------------------------------------------------------------------------------------------------ */

/* Lobes that micro-buffers gathered are left as sharp as they are. */
static bool filters_lobes(const es_renderer* r, bool lobes) { return lobes && r->frame.settings.method != ES_GI_MICRO; }
static bool filters_specular(const es_renderer* r) { return filters_lobes(r, r->has_specular); }
static uint32_t filter_size(const es_renderer_settings* s) { return s->method == ES_GI_MICRO ? s->micro_filter : s->interleave; }

static es_result filter(es_renderer* r, const es_gbuffer* shaded, bool lobes, const es_planes* irradiance, const es_planes* specular, es_planes* filtered_irradiance, es_planes* filtered_specular)
{
    const es_renderer_settings* s = &r->frame.settings;
    es_result result = es_planes_resize(r->context, filtered_irradiance, shaded);
    if (!result && lobes) result = es_planes_resize(r->context, filtered_specular, shaded);
    if (result) return result;
    es_filter_job job = {.gbuffer = shaded, .size = filter_size(s), .passes = r->filter_passes, .depth_threshold = s->filter_depth, .normal_threshold = s->filter_normal, .plane_count = lobes ? 6 : 3,
        .source_lit = specular->lit, .result_lit = filtered_specular->lit};
    for (int k = 0; k < 3; k++) {
        job.source[k] = irradiance->at[k];
        job.result[k] = filtered_irradiance->at[k];
        job.source[k + 3] = specular->at[k];
        job.result[k + 3] = filtered_specular->at[k];
    }
    es_arena_reset(&r->arena);
    return es_filter_geometry_aware(r->context, &r->arena, &job);
}

es_result es_indirect_filter(es_renderer* r, const es_planes* irradiance, const es_planes* specular, es_planes* filtered_irradiance, es_planes* filtered_specular)
{
    return filter(r, es_indirect_gbuffer(r), filters_specular(r), irradiance, specular, filtered_irradiance, filtered_specular);
}

/* r->filter_passes is the picture's, and the same says whether a layer is filtered. */
es_result es_indirect_filter_layer(es_renderer* r, const es_lit_surfaces* of, es_layer_light* light)
{
    light->filtered = r->filter_passes != 0;
    light->filtered_lobes = light->filtered && filters_lobes(r, of->lobes);
    return light->filtered ? filter(r, of->gbuffer, light->filtered_lobes, &light->irradiance, &light->specular, &light->filtered_irradiance, &light->filtered_specular) : ES_OK;
}

es_result es_indirect_shade_layer(es_renderer* r, const es_lit_surfaces* of, uint32_t lights, es_layer_light* light)
{
    return shade(r, of, lights, false, &light->irradiance, &light->specular);
}

es_result es_pass_filter(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* nothing = es_indirect_nothing(r, in);
    const char* why = nothing ? nothing : s->method == ES_GI_SECOND_ORDER ? "gi is second-order: every pixel has every light" : s->method == ES_GI_MICRO && s->micro_spacing > 1 ? "micro.spacing is above 1: interpolation is smooth" : s->method == ES_GI_MICRO && s->micro_filter == 1 ? "micro.filter is 1" : !s->filter_passes ? "filter.passes is 0" : every_light(s) ? "gi is vpl-traced: every pixel has every light" : s->method != ES_GI_MICRO && s->interleave == 1 ? "interleave is 1: nothing to smooth" : NULL;
    r->filter_passes = why ? 0 : s->filter_passes;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_FILTER, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_FILTER);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_indirect_reads(plan);
    if (blended_first(r)) es_plan_reads_pass(plan, ES_PASS_TEMPORAL);
    float numbers[] = {s->filter_depth, s->filter_normal, (float)filter_size(s), r->has_specular, (float)s->filter_passes};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_FILTER)) return ES_OK;
    es_result result = es_indirect_filter(r, shaded_irradiance(r), shaded_specular(r), &r->filtered_irradiance, &r->filtered_specular);
    const es_gbuffer* shaded = es_indirect_gbuffer(r);
    if (!result) es_plan_done(plan, ES_PASS_FILTER, (uint64_t)shaded->width * shaded->height * s->filter_passes);
    return result;
}

static const es_planes* filtered_irradiance(const es_renderer* r) { return r->filter_passes ? &r->filtered_irradiance : shaded_irradiance(r); }
static const es_planes* filtered_specular(const es_renderer* r) { return r->filter_passes && filters_specular(r) ? &r->filtered_specular : shaded_specular(r); }

void es_indirect_unblended(const es_renderer* r, const es_planes** irradiance, const es_planes** specular)
{
    const bool first = r->frame.settings.temporal_stage == ES_TEMPORAL_BEFORE_FILTER;
    *irradiance = first ? &r->irradiance : filtered_irradiance(r);
    *specular = first ? &r->specular : filtered_specular(r);
}

/* With last frame's, wherever that comes in. */
static bool blended_last(const es_renderer* r) { return r->plan.valid[ES_PASS_TEMPORAL] && !blended_first(r); }
static const es_planes* blended_irradiance(const es_renderer* r) { return blended_last(r) ? &r->history.irradiance[r->history.current] : filtered_irradiance(r); }
static const es_planes* blended_specular(const es_renderer* r) { return blended_last(r) ? &r->history.specular[r->history.current] : filtered_specular(r); }

/* ---- interpolation ------------------------------------------------------------------------------------------------------------ */

es_result es_indirect_upsample(es_renderer* r, const es_planes* irradiance, const es_planes* specular, es_planes* whole_irradiance, es_planes* whole_specular)
{
    const es_renderer_settings* s = &r->frame.settings;
    es_result result = es_planes_resize(r->context, whole_irradiance, &r->gbuffer);
    if (!result && r->has_specular) result = es_planes_resize(r->context, whole_specular, &r->gbuffer);
    if (result) return result;
    if (r->has_specular) memset(whole_specular->lit, 1, (size_t)es_lit_chunks(r->gbuffer.stride) * r->gbuffer.height);
    es_upsample_job job = {.gbuffer = &r->gbuffer, .half = &r->half, .depth_threshold = s->filter_depth, .normal_threshold = s->filter_normal, .plane_count = r->has_specular ? 6 : 3};
    for (int k = 0; k < 3; k++) {
        job.source[k] = irradiance->at[k];
        job.result[k] = whole_irradiance->at[k];
        job.source[k + 3] = specular->at[k];
        job.result[k + 3] = whole_specular->at[k];
    }
    es_upsample(r->context, &job);
    return ES_OK;
}

es_result es_pass_upsample(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* nothing = es_indirect_nothing(r, in);
    const char* why = nothing ? nothing : s->method == ES_GI_SECOND_ORDER ? "gi is second-order: second.threshold takes its place" : s->method == ES_GI_MICRO ? "gi is micro: micro.spacing takes its place" : !s->half_resolution ? "half-resolution is off" : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_UPSAMPLE, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_UPSAMPLE);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_SHADING);
    es_plan_reads_pass(plan, ES_PASS_FILTER);
    es_plan_reads_pass(plan, ES_PASS_TEMPORAL);
    float numbers[] = {s->filter_depth, s->filter_normal, r->has_specular};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_UPSAMPLE)) return ES_OK;
    es_result result = es_indirect_upsample(r, blended_irradiance(r), blended_specular(r), &r->upsampled_irradiance, &r->upsampled_specular);
    if (!result) es_plan_done(plan, ES_PASS_UPSAMPLE, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return result;
}

const es_planes* es_indirect_irradiance(const es_renderer* r) { return r->plan.valid[ES_PASS_UPSAMPLE] ? &r->upsampled_irradiance : blended_irradiance(r); }
const es_planes* es_indirect_specular(const es_renderer* r) { return r->plan.valid[ES_PASS_UPSAMPLE] ? &r->upsampled_specular : blended_specular(r); }
