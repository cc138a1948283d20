#include "gi/lamp_passes.h"

#include "gi/edit/edit_pass.h"
#include "gi/filter.h"
#include "gi/indirect.h"
#include "gi/passes.h"
#include "gi/vpl_visibility.h"

/* Close by, a light is a disc of the area that it stands for. */
#define LAMP_SPREAD 1.0f

/* The environment's light may be found in screen space (gi/screen/passes.h): its lights then make a bounce and light blended layers, but not the picture's pixels. */
static bool sky_in_screen_space(const es_renderer* r) { return r->settings.lamps == ES_LAMPS_SCREEN || r->settings.lamps == ES_LAMPS_AMBIENT; }
static bool environment_in_set(const es_renderer* r, const es_frame_inputs* in) { return r->plan.valid[ES_PASS_ENVIRONMENT] && !(sky_in_screen_space(r) && r->settings.method == ES_GI_NONE && !in->layers->instance_count); }

static const char* no_lamps(const es_renderer* r, const es_frame_inputs* in)
{
    return r->settings.lamps == ES_LAMPS_NONE ? "lamps is none" : !in->has_geometry ? "nothing to light" : es_something_glows(in->list) || environment_in_set(r, in) ? NULL : "nothing glows";
}

es_result es_pass_lamps(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = no_lamps(r, in);
    if (why) {
        es_plan_not_needed(plan, ES_PASS_LAMPS, why);
        es_lamps_free(r->context, &r->lamps.set);
        return ES_OK;
    }
    const es_environment_map* environment = environment_in_set(r, in) ? &r->environment : NULL;
    const es_lamp_request request = {.list = in->list, .materials = in->revisions.materials, .count = s->lamp_count, .subsets = s->lamp_interleave * s->lamp_interleave, .seed = s->seed,
        .environment = environment, .centre = es_v3_scale(es_v3_add(in->bounds_min, in->bounds_max), 0.5f), .extent = in->extent};
    es_plan_begin(plan, ES_PASS_LAMPS);
    es_plan_reads_pass(plan, ES_PASS_ENVIRONMENT);
    es_plan_reads(plan, &request.centre, sizeof request.centre);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    const uint32_t words[] = {request.count, request.subsets, request.seed, environment != NULL};
    es_plan_reads(plan, words, sizeof words);
    es_plan_reads(plan, &in->extent, sizeof in->extent);
    if (!es_plan_run(plan, ES_PASS_LAMPS)) return ES_OK;
    es_result result = es_lamps_update(r->context, &r->lamps.set, &request);
    if (!result) es_plan_done(plan, ES_PASS_LAMPS, r->lamps.set.count);
    return result;
}

/* Why there is no light of lamps, once they are placed. */
static const char* no_light(const es_renderer* r, const es_frame_inputs* in)
{
    const char* why = no_lamps(r, in);
    return why ? why : !r->lamps.set.count ? "no light comes from what glows" : NULL;
}

bool es_lamps_are_there(const es_renderer* r) { return r->plan.valid[ES_PASS_LAMPS] && r->lamps.set.count; }
bool es_lamps_want_rays(const es_renderer* r) { return r->settings.lamps == ES_LAMPS_TRACED && es_lamps_are_there(r); }

/* Points that micro-buffers see are lit by maps, whatever the pixels are. */
bool es_lamps_want_maps(const es_renderer* r) { return es_lamps_are_there(r) && (r->settings.lamps != ES_LAMPS_TRACED || r->settings.method == ES_GI_MICRO); }

es_result es_pass_lamp_maps(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = no_light(r, in);
    if (!why && !es_lamps_want_maps(r)) why = "lamps is traced";
    if (why) {
        es_plan_not_needed(plan, ES_PASS_LAMP_MAPS, why);
        es_ism_maps_free(r->context, &r->lamps.maps);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_LAMP_MAPS);
    es_plan_reads_pass(plan, ES_PASS_LAMPS);
    es_plan_reads_pass(plan, ES_PASS_POINTS);
    const float numbers[] = {(float)s->lamp_size, s->pull_push, s->pull_threshold, s->push_threshold, (float)s->pull_push_levels, in->extent};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_LAMP_MAPS)) return ES_OK;
    const es_lamps* set = &r->lamps.set;
    const es_ism_job job = {.vpls = set->records, .vpl_count = set->count, .room = set->count, .points = &r->points, .size = s->lamp_size, .far_distance = in->extent, .near_distance = es_near_distance(in),
        .pull_push = s->pull_push, .pull_threshold = s->pull_threshold, .push_threshold = s->push_threshold, .pull_push_levels = s->pull_push_levels, .keep = s->skip, .kept_bytes = (size_t)s->ism_kept << 20};
    es_result result = es_ism_maps_build(r->context, &r->lamps.maps, &job);
    if (!result) es_plan_done(plan, ES_PASS_LAMP_MAPS, r->lamps.maps.kept.splats);
    return result;
}

es_shade_job es_lamps_at_points(const es_renderer* r)
{
    const es_renderer_settings* s = &r->frame.settings;
    const es_lamp_light* lamps = &r->lamps;
    return (es_shade_job){.vpls = lamps->set.records, .vpl_count = lamps->set.count, .maps = lamps->maps.texels, .map_size = lamps->maps.size, .far_distance = lamps->maps.far_distance,
        .slope_bias = s->lamp_slope_bias * r->frame.extent, .spread = LAMP_SPREAD, .geometry_bound = ES_UNBOUNDED, .lobe_roughness = s->lamp_roughness, .interleave = 1};
}

static uint32_t shaded_count(const es_renderer* r) { return sky_in_screen_space(r) ? r->lamps.set.glowing : r->lamps.set.shaded_count; }

/* picture: what belongs to its pixels (edited reflections, repaired shadows) counts */
static es_result shade(es_renderer* r, const es_lit_surfaces* of, uint32_t lights, bool picture, es_planes* irradiance, es_planes* specular)
{
    const es_renderer_settings* s = &r->frame.settings;
    const es_lamp_light* lamps = &r->lamps;
    es_result result = es_planes_resize(r->context, irradiance, of->gbuffer);
    if (!result && of->lobes) result = es_planes_resize(r->context, specular, of->gbuffer);
    if (result) return result;
    es_shade_job job = es_lamps_at_points(r);
    job.gbuffer = of->gbuffer;
    job.rays = of->rays;
    job.interleave = s->lamp_interleave;
    job.seed = s->seed;
    job.vpls = lamps->set.shaded;
    job.vpl_count = lights;
    job.map_of = lamps->set.map_of;
    job.wide = &es_lobe_albedos;
    for (int k = 0; k < 3; k++) {
        job.irradiance[k] = irradiance->at[k];
        job.specular[k] = of->lobes ? specular->at[k] : NULL;
    }
    job.lit = of->lobes ? specular->lit : NULL;
    if (picture) {
        es_edited_reflections(r, job.edited);
        job.edited_stride = r->gbuffer.stride;
        job.edited_spacing = 1;
    }
    if (picture && s->screen_repair) {
        job.repair = &r->screen.stack.views[0];
        job.repair_samples = s->screen_repair;
        job.repair_most = s->screen_radius * r->frame.extent;
    }
    es_arena_reset(&r->arena);
    es_vpl_visibility visibility;
    if (es_lamps_want_rays(r)) {
        result = es_vpl_visibility_prepare(&r->arena, &r->trace_scene, job.vpls, job.vpl_count, r->frame.extent, &visibility);
        job.visibility = &visibility.shade;
        job.maps = NULL;
    }
    return result ? result : es_shade(r->context, &r->arena, &job);
}

static es_result filter(es_renderer* r, const es_lit_surfaces* of, const es_planes* irradiance, const es_planes* specular, es_planes* filtered_irradiance, es_planes* filtered_specular)
{
    const es_renderer_settings* s = &r->frame.settings;
    es_result result = es_planes_resize(r->context, filtered_irradiance, of->gbuffer);
    if (!result && of->lobes) result = es_planes_resize(r->context, filtered_specular, of->gbuffer);
    if (result) return result;
    es_filter_job job = {.gbuffer = of->gbuffer, .size = s->lamp_interleave, .passes = s->filter_passes, .depth_threshold = s->filter_depth, .normal_threshold = s->filter_normal, .plane_count = of->lobes ? 6 : 3,
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

static const char* unfiltered(const es_renderer_settings* s) { return !s->filter_passes ? "filter.passes is 0" : s->lamp_interleave == 1 ? "lamps.interleave is 1: nothing to smooth" : NULL; }

static es_lit_surfaces picture_of(const es_renderer* r) { return (es_lit_surfaces){&r->gbuffer, r->rays, r->lamps.has_specular}; }

static es_result pass_filter(es_renderer* r, const char* nothing)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = nothing ? nothing : unfiltered(s);
    r->lamps.filtered = !why;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_LAMP_FILTER, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_LAMP_FILTER);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_LAMP_LIGHT);
    const float numbers[] = {s->filter_depth, s->filter_normal, (float)s->lamp_interleave, r->lamps.has_specular, (float)s->filter_passes};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_LAMP_FILTER)) return ES_OK;
    es_lamp_light* lamps = &r->lamps;
    const es_lit_surfaces picture = picture_of(r);
    es_result result = filter(r, &picture, &lamps->irradiance, &lamps->specular, &lamps->filtered_irradiance, &lamps->filtered_specular);
    if (!result) es_plan_done(plan, ES_PASS_LAMP_FILTER, (uint64_t)r->gbuffer.width * r->gbuffer.height * s->filter_passes);
    return result;
}

/* Direct light is that of the surface model, so a lobe counts however wide it is (es_shade_job.wide): its Fresnel term takes what it reflects from the diffuse part,
 * a quarter where a floor is seen at a slant. */
bool es_lamps_anything_specular(const es_draw_list* list)
{
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_material_desc* m = &list->materials[list->instances[i].material];
        if (m->model != ES_SURFACE_UNLIT && (m->specular > 0.0f || m->metallic > 0.0f)) return true;
    }
    return false;
}

es_result es_pass_lamp_light(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = no_light(r, in);
    if (!why && !shaded_count(r)) why = "the environment's light is found in screen space";
    if (why) {
        es_plan_not_needed(plan, ES_PASS_LAMP_LIGHT, why);
        es_lamps_free_planes(r->context, &r->lamps);
        return pass_filter(r, why);
    }
    r->lamps.has_specular = es_lamps_anything_specular(in->solid);
    es_plan_begin(plan, ES_PASS_LAMP_LIGHT);
    const es_pass read[] = {ES_PASS_VISIBILITY, ES_PASS_LAMPS, ES_PASS_LAMP_MAPS, ES_PASS_HIERARCHY, ES_PASS_EDITS};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    if (s->screen_repair) es_plan_reads_pass(plan, ES_PASS_SCREEN_VIEWS);
    const float numbers[] = {s->lamp_slope_bias, s->lamp_roughness, (float)s->lamp_interleave, in->extent, r->lamps.has_specular, (float)s->lamps, (float)s->screen_repair, s->screen_radius};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (es_plan_run(plan, ES_PASS_LAMP_LIGHT)) {
        const es_lit_surfaces picture = picture_of(r);
        es_result result = shade(r, &picture, shaded_count(r), true, &r->lamps.irradiance, &r->lamps.specular);
        if (result) return result;
        es_plan_done(plan, ES_PASS_LAMP_LIGHT, (uint64_t)r->gbuffer.width * r->gbuffer.height * shaded_count(r) / (s->lamp_interleave * s->lamp_interleave));
    }
    return pass_filter(r, NULL);
}

/* Screen space knows nothing of what stands before the picture: the environment's light comes from the set there, whatever lights the picture. */
es_result es_lamps_light_layer(es_renderer* r, const es_lit_surfaces* of, es_layer_light* light)
{
    es_result result = shade(r, of, r->lamps.set.shaded_count, false, &light->irradiance, &light->specular);
    light->lobes = of->lobes;
    light->filtered = !unfiltered(&r->frame.settings);
    light->filtered_lobes = light->filtered && of->lobes;
    if (!result && light->filtered) result = filter(r, of, &light->irradiance, &light->specular, &light->filtered_irradiance, &light->filtered_specular);
    return result;
}

void es_lamps_compose(const es_renderer* r, es_compose_job* job)
{
    if (!r->plan.valid[ES_PASS_LAMP_LIGHT]) return;
    const es_lamp_light* lamps = &r->lamps;
    const es_planes *irradiance = lamps->filtered ? &lamps->filtered_irradiance : &lamps->irradiance, *specular = lamps->filtered ? &lamps->filtered_specular : &lamps->specular;
    for (int k = 0; k < 3; k++) {
        job->lamp_irradiance[k] = irradiance->at[k];
        job->lamp_specular[k] = lamps->has_specular ? specular->at[k] : NULL;
    }
    job->lamp_lit = lamps->has_specular ? specular->lit : NULL;
}

void es_lamps_free_planes(es_context* context, es_lamp_light* lamps)
{
    es_planes_free(context, &lamps->irradiance);
    es_planes_free(context, &lamps->specular);
    es_planes_free(context, &lamps->filtered_irradiance);
    es_planes_free(context, &lamps->filtered_specular);
}

void es_lamp_light_free(es_context* context, es_lamp_light* lamps)
{
    es_lamps_free_planes(context, lamps);
    es_ism_maps_free(context, &lamps->maps);
    es_lamps_free(context, &lamps->set);
}
