/* One frame, pass by pass, in the order of the frame plan (gi/plan.h). */
#include "gi/renderer.h"

#include <string.h>

#include "gi/blend_passes.h"
#include "gi/bounce_pass.h"
#include "gi/classic.h"
#include "gi/direct.h"
#include "gi/edit/edit_pass.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/lit.h"
#include "gi/micro_passes.h"
#include "gi/passes.h"
#include "gi/reflections/reflection_passes.h"
#include "gi/reflections/refracting.h"
#include "gi/screen/passes.h"
#include "gi/screen/residual_pass.h"
#include "gi/second_order_pass.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "platform/settings.h"

/* ---- planes ------------------------------------------------------------------------------------------------------------ */

/* Where screen space finds what bounding takes, no pair closer than its radius is left to the lights alone: without spread they would show as spots there. */
float es_geometry_bound(const es_renderer_settings* settings, const es_frame_inputs* in)
{
    const float radius = settings->screen_radius;
    const bool found = settings->screen_bounce || !es_residual_nothing(settings);
    const float bound = found ? es_minf(settings->geometry_bound, 1.0f / (radius * radius)) : settings->geometry_bound;
    return bound / (in->extent * in->extent);
}

es_result es_planes_resize(es_context* context, es_planes* planes, const es_gbuffer* gbuffer)
{
    /* Planes a multiple of 4096 bytes apart would fall into the same cache sets, and passes go through up to fifteen side by side. */
    size_t floats = ((size_t)gbuffer->stride * gbuffer->height + 15) / 16 * 16;
    const size_t lit_bytes = (size_t)es_lit_chunks(gbuffer->stride) * gbuffer->height, shift = (size_t)((uintptr_t)planes / sizeof *planes % 8) * 512;
    if (floats % 1024 < 64 || floats % 1024 > 1024 - 64) floats += 5 * 16 + 64;
    size_t bytes = 3 * floats * sizeof(float) + lit_bytes + 4096;
    if (planes->bytes == bytes) return ES_OK;
    es_planes_free(context, planes);
    planes->memory = es_allocate_zero(context, bytes); /* passes write pixels, vectors read the padding of rows as well */
    if (!planes->memory) return es_context_last_result(context);
    planes->bytes = bytes;
    for (int k = 0; k < 3; k++) planes->at[k] = (float*)((char*)planes->memory + shift) + (size_t)k * floats;
    planes->lit = (uint8_t*)planes->memory + shift + 3 * floats * sizeof(float);
    return ES_OK;
}

void es_planes_free(es_context* context, es_planes* planes)
{
    es_release(context, planes->memory, planes->bytes);
    *planes = (es_planes){0};
}

/* ---- life -------------------------------------------------------------------------------------------------------------- */

static bool power_of_two(uint32_t n) { return n && !(n & (n - 1)); }

static es_result check_settings(es_context* context, const es_renderer_settings* s)
{
    es_result result = es_settings_check(context, es_renderer_setting(0), es_renderer_setting_count(), s);
    if (result) return result;
    if (!power_of_two(s->light_size)) return es_fail(context, ES_SETTING_VALUE, "vpl.light-size is %u; a power of two from 8 to 2048 is accepted", s->light_size);
    if (!power_of_two(s->ism_size)) return es_fail(context, ES_SETTING_VALUE, "ism.size is %u; 32, 64, 128 and 256 are accepted", s->ism_size);
    if (!power_of_two(s->classic_size)) return es_fail(context, ES_SETTING_VALUE, "classic.size is %u; a power of two from 32 to 1024 is accepted", s->classic_size);
    if (!power_of_two(s->lamp_size)) return es_fail(context, ES_SETTING_VALUE, "lamps.size is %u; 32, 64, 128 and 256 are accepted", s->lamp_size);
    if (!power_of_two(s->reflection_size)) return es_fail(context, ES_SETTING_VALUE, "reflections.size is %u; a power of two from 16 to 1024 is accepted", s->reflection_size);
    if (s->shadow_size % 8) return es_fail(context, ES_SETTING_VALUE, "shadow.size is %u; a multiple of 8 from 16 to 8192 is accepted", s->shadow_size);
    if (s->bounce_points % 64) return es_fail(context, ES_SETTING_VALUE, "bounce.points is %u; a multiple of 64 from 64 to 65536 is accepted", s->bounce_points);
    if (s->ism_points % 64) return es_fail(context, ES_SETTING_VALUE, "ism.points is %u; a multiple of 64 from 64 to 65536 is accepted", s->ism_points);
    if (!power_of_two(s->glare_size)) return es_fail(context, ES_SETTING_VALUE, "glare.size is %u; a power of two from 64 to 4096 is accepted", s->glare_size);
    if (!power_of_two(s->glare_supersample)) return es_fail(context, ES_SETTING_VALUE, "glare.supersample is %u; 1, 2, 4 and 8 are accepted", s->glare_supersample);
    if (s->micro_size % 4) return es_fail(context, ES_SETTING_VALUE, "micro.size is %u; a multiple of 4 from 8 to 32 is accepted", s->micro_size);
    if (!power_of_two(s->compensation_spacing)) return es_fail(context, ES_SETTING_VALUE, "compensation.spacing is %u; 1, 2 and 4 are accepted", s->compensation_spacing);
    if (!power_of_two(s->micro_spacing)) return es_fail(context, ES_SETTING_VALUE, "micro.spacing is %u; 1, 2 and 4 are accepted", s->micro_spacing);
    return ES_OK;
}

es_result es_renderer_create(es_context* context, const es_renderer_settings* settings, es_renderer** out)
{
    *out = NULL;
    es_renderer_settings resolved = settings ? *settings : es_default_renderer_settings();
    es_result result = check_settings(context, &resolved);
    if (result) return result;
    es_renderer* renderer = es_allocate_zero(context, sizeof *renderer);
    if (!renderer) return es_context_last_result(context);
    renderer->context = context;
    renderer->settings = resolved;
    es_context_count_object(context, 1);
    es_arena_init(&renderer->arena, context, 1 << 16);
    es_srgb_table_fill(&renderer->srgb);
    result = es_rasterizer_create(context, &renderer->rasterizer);
    if (result) {
        es_renderer_destroy(renderer);
        return result;
    }
    *out = renderer;
    return ES_OK;
}

static void free_frame_buffers(es_renderer* renderer)
{
    es_context* context = renderer->context;
    if (renderer->display) es_release(context, renderer->display, (size_t)renderer->gbuffer.width * renderer->gbuffer.height * sizeof(uint32_t));
    renderer->display = NULL;
    es_gbuffer_destroy(context, &renderer->gbuffer);
    es_gbuffer_destroy(context, &renderer->half);
    es_planes_free(context, &renderer->upsampled_irradiance);
    es_planes_free(context, &renderer->upsampled_specular);
    es_planes_free(context, &renderer->background);
    es_planes_free(context, &renderer->direct);
    es_planes_free(context, &renderer->radiance);
    es_glare_free_planes(context, &renderer->glare);
    es_planes_free(context, &renderer->irradiance);
    es_planes_free(context, &renderer->specular);
    es_planes_free(context, &renderer->compensation);
    es_residual_buffers_free(context, &renderer->residual);
    es_second_order_free(context, &renderer->second_order);
    es_history_free(context, &renderer->history);
    es_edit_buffers_free(context, &renderer->edits);
    es_micro_free_planes(context, &renderer->micro);
    es_lamps_free_planes(context, &renderer->lamps);
    es_planes_free(context, &renderer->filtered_irradiance);
    es_planes_free(context, &renderer->filtered_specular);
    es_screen_buffers_free(context, &renderer->screen);
    es_blend_layers_free(context, &renderer->blend);
    es_reflections_free_planes(context, &renderer->reflections);
}

void es_renderer_destroy(es_renderer* renderer)
{
    if (!renderer) return;
    es_context* context = renderer->context;
    free_frame_buffers(renderer);
    for (uint32_t i = 0; i < renderer->light_capacity; i++) {
        es_light_view_free(context, &renderer->light_views[i]);
        es_importance_free(context, &renderer->importances[i]);
    }
    es_release(context, renderer->light_views, renderer->light_capacity * sizeof *renderer->light_views);
    es_release(context, renderer->importances, renderer->light_capacity * sizeof *renderer->importances);
    es_release(context, renderer->vpls, renderer->vpl_capacity * sizeof *renderer->vpls);
    es_scene_points_free(context, &renderer->points);
    es_stable_vpls_free(context, &renderer->stable);
    es_scene_points_free(context, &renderer->bounce_points);
    es_surfels_free(context, &renderer->surfels);
    es_ism_maps_free(context, &renderer->maps);
    es_lamp_light_free(context, &renderer->lamps);
    es_trace_scene_free(&renderer->trace_scene);
    es_micro_free(context, &renderer->micro);
    es_environment_map_free(context, &renderer->environment);
    es_reflections_free(context, &renderer->reflections);
    es_blend_lists_free(context, &renderer->lists);
    es_glare_free(context, &renderer->glare);
    es_arena_free(&renderer->arena);
    if (renderer->rasterizer) es_rasterizer_destroy(renderer->rasterizer);
    es_release(context, renderer, sizeof *renderer);
    es_context_count_object(context, -1);
}

es_result es_renderer_configure(es_renderer* renderer, const es_renderer_settings* settings)
{
    es_result result = check_settings(renderer->context, settings);
    if (result) return result;
    renderer->settings = *settings;
    return ES_OK;
}

es_renderer_settings es_renderer_get_settings(const es_renderer* renderer) { return renderer->settings; }

static es_result resize_frame(es_renderer* renderer)
{
    const es_renderer_settings* s = &renderer->settings;
    if (renderer->gbuffer.width == s->width && renderer->gbuffer.height == s->height && renderer->display && renderer->direct.memory) return ES_OK;
    es_context* context = renderer->context;
    free_frame_buffers(renderer);
    es_plan_invalidate(&renderer->plan);
    es_result result = es_gbuffer_create(context, s->width, s->height, ES_GBUFFER_ALL, &renderer->gbuffer);
    if (result) return result;
    renderer->display = es_allocate(context, (size_t)s->width * s->height * sizeof(uint32_t));
    return renderer->display ? es_planes_resize(context, &renderer->direct, &renderer->gbuffer) : es_context_last_result(context);
}

static es_result reserve_lights(es_renderer* renderer, uint32_t count)
{
    if (count <= renderer->light_capacity) return ES_OK;
    es_context* context = renderer->context;
    es_light_view* views = es_allocate_zero(context, count * sizeof *views);
    es_importance* importances = views ? es_allocate_zero(context, count * sizeof *importances) : NULL;
    if (!importances) {
        es_release(context, views, count * sizeof *views);
        return es_context_last_result(context);
    }
    if (renderer->light_capacity) {
        memcpy(views, renderer->light_views, renderer->light_capacity * sizeof *views);
        memcpy(importances, renderer->importances, renderer->light_capacity * sizeof *importances);
    }
    es_release(context, renderer->light_views, renderer->light_capacity * sizeof *views);
    es_release(context, renderer->importances, renderer->light_capacity * sizeof *importances);
    renderer->light_views = views;
    renderer->importances = importances;
    renderer->light_capacity = count;
    return ES_OK;
}

es_result es_reserve_vpls(es_renderer* renderer, uint32_t count)
{
    if (count <= renderer->vpl_capacity) return ES_OK;
    es_context* context = renderer->context;
    es_release(context, renderer->vpls, renderer->vpl_capacity * sizeof *renderer->vpls);
    renderer->vpl_capacity = renderer->vpl_count = renderer->first_vpls = renderer->punctual_vpls = 0;
    renderer->vpls = es_allocate_array(context, count, sizeof *renderer->vpls);
    if (!renderer->vpls) return es_context_last_result(context);
    renderer->vpl_capacity = count;
    return ES_OK;
}

/* ---- passes -------------------------------------------------------------------------------------------------------------------- */

static es_result pass_visibility(es_renderer* r, const es_frame_inputs* in)
{
    es_plan_begin(&r->plan, ES_PASS_VISIBILITY);
    es_plan_reads(&r->plan, &r->view, sizeof r->view);
    es_plan_reads(&r->plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(&r->plan, &in->revisions.materials, sizeof in->revisions.materials);
    /* motion depends on last frame's pose as well: while anything moves, every step is new */
    uint64_t moving = in->revisions.moving ? in->revisions.steps : 0;
    es_plan_reads(&r->plan, &moving, sizeof moving);
    es_plan_reads(&r->plan, &in->has_environment, sizeof in->has_environment); /* which moves as well, see es_background_job */
    const bool blended = in->layers->instance_count > 0;
    es_plan_reads(&r->plan, &r->settings.screen_layers, sizeof r->settings.screen_layers); /* what layers are peeled behind is noted as it is drawn */
    if (blended) es_plan_reads(&r->plan, &blended, sizeof blended);
    /* without layers blended surfaces are masked ones */
    const bool masked = r->settings.blend_layers == 0;
    es_plan_reads(&r->plan, &masked, sizeof masked);
    if (!es_plan_run(&r->plan, ES_PASS_VISIBILITY)) return ES_OK;
    es_result result = r->settings.temporal ? es_history_keep(r->context, &r->gbuffer, &r->history.gbuffer) : ES_OK;
    es_depth_range range;
    const es_depth_range* wanted = NULL;
    if (!result) result = es_screen_first_layer(r, &range, &wanted);
    if (!result && blended && !wanted) result = es_blend_behind(r, &range, &wanted);
    if (!result) result = es_draw_gbuffer_between(r->rasterizer, in->solid, &r->view, wanted, &r->gbuffer, &r->stats.raster);
    if (!result) es_plan_done(&r->plan, ES_PASS_VISIBILITY, r->stats.raster.triangles);
    return result;
}

/* The light's pose without its colour: what its views depend on. */
static void reads_light_poses(es_plan* plan, const es_frame_inputs* in)
{
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    for (uint32_t i = 0; i < in->light_count; i++) {
        es_light_state pose = in->lights[i];
        memset(pose.radiant, 0, sizeof pose.radiant);
        es_plan_reads(plan, &pose, sizeof pose);
    }
}

static es_result draw_light_views(es_renderer* r, const es_frame_inputs* in, es_pass pass, es_light_drawing what)
{
    if (!es_plan_run(&r->plan, pass)) return ES_OK;
    es_light_drawn drawn = {0};
    es_result result = ES_OK;
    for (uint32_t i = 0; i < in->light_count && !result; i++)
        result = es_light_view_draw(r->rasterizer, in->list, in->revisions.materials, r->settings.skip, &r->light_views[i], what, &drawn);
    if (result) return result;
    es_plan_done(&r->plan, pass, drawn.triangles);
    if (!drawn.faces) r->plan.stats[pass].skipped = "nothing moved that the lights see";
    return ES_OK;
}

static es_result pass_light_views(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    r->light_count = in->light_count;
    if (!in->light_count || !in->has_geometry) {
        const char* why = in->light_count ? "nothing to light" : "no light is on";
        es_plan_not_needed(plan, ES_PASS_SHADOW_MAPS, why);
        es_plan_not_needed(plan, ES_PASS_LIGHT_VIEWS, why);
        r->light_count = 0;
        return ES_OK;
    }
    es_result result = reserve_lights(r, in->light_count);
    if (result) return result;
    es_light_view_sizes sizes = {r->settings.shadow_size, r->settings.light_size, in->no_vpls == NULL, r->settings.stable_vpls};
    for (uint32_t i = 0; i < in->light_count && !result; i++) result = es_light_view_prepare(r->context, &r->light_views[i], &in->lights[i], sizes, in->bounds_min, in->bounds_max);
    if (result) return result;

    es_plan_begin(plan, ES_PASS_SHADOW_MAPS);
    es_plan_reads(plan, &r->settings.shadow_size, sizeof r->settings.shadow_size);
    reads_light_poses(plan, in);
    result = draw_light_views(r, in, ES_PASS_SHADOW_MAPS, ES_LIGHT_SHADOW);
    if (result) return result;
    if (in->no_vpls) {
        es_plan_not_needed(plan, ES_PASS_LIGHT_VIEWS, in->no_vpls);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_LIGHT_VIEWS);
    uint32_t words[] = {r->settings.light_size, r->settings.stable_vpls};
    es_plan_reads(plan, words, sizeof words);
    reads_light_poses(plan, in);
    return draw_light_views(r, in, ES_PASS_LIGHT_VIEWS, ES_LIGHT_GBUFFER);
}

/* Of what the lights see. */
static uint64_t scene_hash(const es_frame_inputs* in)
{
    uint64_t hash = es_hash_bytes(in->revisions.materials, &in->revisions.geometry, sizeof in->revisions.geometry);
    return es_hash_bytes(hash, in->lights, in->light_count * sizeof *in->lights);
}

/* As Cochran and Steele place them: no camera and no brightness has a say in it. */
static es_result pass_open_lights(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    es_plan_begin(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_LIGHT_VIEWS);
    es_plan_reads(plan, in->lights, in->light_count * sizeof *in->lights);
    const uint32_t words[] = {s->method, s->second_lights, s->seed, es_bounce_capacity(s)};
    es_plan_reads(plan, words, sizeof words);
    if (!es_plan_run(plan, ES_PASS_VPLS)) return ES_OK;
    es_stable_vpls_free(r->context, &r->stable);
    es_result result = es_reserve_vpls(r, es_bounce_capacity(s));
    /* what the image of it shows */
    for (uint32_t i = 0; i < r->light_count && !result; i++) result = es_importance_build(r->context, &r->importances[i], &r->light_views[i], NULL);
    if (!result) result = es_open_lights_place(r->context, r->light_views, r->light_count, s->second_lights, s->seed, r->vpls, &r->punctual_vpls);
    r->first_vpls = r->punctual_vpls;
    if (!result) es_plan_done(plan, ES_PASS_VPLS, r->first_vpls);
    return result;
}

static es_result pass_vpls(es_renderer* r, const es_frame_inputs* in, const es_world* world, uint32_t picture)
{
    es_plan* plan = &r->plan;
    if (in->no_vpls || !r->light_count) {
        es_plan_not_needed(plan, ES_PASS_VPLS, in->no_vpls ? in->no_vpls : "no light is on");
        r->vpl_count = r->first_vpls = r->punctual_vpls = 0;
        return ES_OK;
    }
    r->first_vpls = r->punctual_vpls;
    if (r->settings.method == ES_GI_SECOND_ORDER) return pass_open_lights(r, in);
    /* an update of stable lights is a step in time: all pictures of a frame have the first one's, whether work is skipped or not */
    if (picture && r->settings.stable_vpls && plan->valid[ES_PASS_VPLS]) {
        plan->stats[ES_PASS_VPLS].skipped = "the lights are those of the frame's first picture";
        return ES_OK;
    }
    es_vpl_request request = {.count = r->settings.vpls, .seed = r->settings.seed, .subsets = r->settings.interleave * r->settings.interleave, .glossy = r->settings.glossy_vpls};
    es_plan_begin(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_LIGHT_VIEWS);
    es_plan_reads(plan, in->lights, in->light_count * sizeof *in->lights);
    const bool stable = r->settings.stable_vpls, by_view = r->settings.view_importance && !stable;
    uint32_t words[] = {request.count, request.seed, request.subsets, request.glossy, by_view, stable, es_bounce_capacity(&r->settings)};
    es_plan_reads(plan, words, sizeof words);
    if (by_view) es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads(plan, &r->settings.renew, sizeof r->settings.renew);
    /* until they have settled, stable lights go on from what they were */
    uint64_t unsettled = stable && !r->stable.settled ? r->frames + 1 : 0;
    es_plan_reads(plan, &unsettled, sizeof unsettled);
    if (!es_plan_run(plan, ES_PASS_VPLS)) return ES_OK;
    es_result result = es_reserve_vpls(r, es_bounce_capacity(&r->settings));
    es_arena_reset(&r->arena);
    es_receivers* receivers = by_view && !result ? es_arena_allocate(&r->arena, sizeof *receivers) : NULL;
    if (receivers) {
        /* about the squared distance between the grid's pixels on surfaces half the scene away */
        float softening = in->extent * 0.004f;
        es_receivers_collect(receivers, &r->gbuffer, &r->rays, softening * softening);
    } else if (by_view && !result) {
        result = es_context_last_result(r->context);
    }
    for (uint32_t i = 0; i < r->light_count && !result; i++) result = es_importance_build(r->context, &r->importances[i], &r->light_views[i], receivers);
    if (!result && stable) {
        es_stable_vpl_request of_stable = {.sample = request, .renew = r->settings.renew, .list = in->list, .extent = in->extent, .scene = scene_hash(in), .materials = in->revisions.materials};
        es_world_origin(world, of_stable.origin);
        result = es_stable_vpls_update(r->context, &r->stable, r->light_views, r->light_count, r->importances, &of_stable, r->vpls, &r->punctual_vpls);
    } else if (!result) es_stable_vpls_free(r->context, &r->stable);
    if (!result && !stable) result = es_vpls_sample(r->context, r->light_views, r->light_count, r->importances, &request, r->vpls, &r->punctual_vpls);
    r->first_vpls = r->punctual_vpls;
    if (!result) es_plan_done(plan, ES_PASS_VPLS, r->first_vpls);
    return result;
}

bool es_draws_imperfect_maps(const es_renderer_settings* s) { return s->method == ES_GI_ISM || es_micro_vpl_bounces(s); }

float es_near_distance(const es_frame_inputs* in) { return in->extent * 2e-3f; }

es_result es_draw_classic_maps(es_renderer* r, const es_frame_inputs* in, uint32_t first, uint32_t end)
{
    uint32_t size = r->settings.classic_size;
    size_t scratch_floats = es_classic_scratch_floats(size);
    float* scratch = es_allocate_array(r->context, scratch_floats, sizeof *scratch);
    if (!scratch) return es_context_last_result(r->context);
    es_result result = ES_OK;
    for (uint32_t i = first; i < end && !result; i++)
        result = es_classic_map_draw(r->rasterizer, in->list, &r->vpls[i], size, es_near_distance(in), in->extent, scratch, r->maps.texels + (size_t)i * size * size);
    r->maps.count = end;
    es_release(r->context, scratch, scratch_floats * sizeof *scratch);
    return result;
}

es_result es_draw_imperfect_maps(es_renderer* r, const es_frame_inputs* in, uint32_t first, uint32_t end, uint32_t room)
{
    const es_renderer_settings* s = &r->settings;
    es_ism_job job = {.vpls = r->vpls, .vpl_count = end, .first = first, .room = room, .points = &r->points, .size = s->ism_size, .far_distance = in->extent, .near_distance = es_near_distance(in),
        .pull_push = s->pull_push, .pull_threshold = s->pull_threshold, .push_threshold = s->push_threshold, .pull_push_levels = s->pull_push_levels, .keep = s->skip, .kept_bytes = (size_t)s->ism_kept << 20};
    return es_ism_maps_build(r->context, &r->maps, &job);
}

static uint32_t subset_count(const es_renderer_settings* s, bool lamps)
{
    uint32_t count = s->ism_pool / s->ism_points;
    uint32_t most = s->vpls ? s->vpls : 1;
    if (lamps && s->lamp_count > most) most = s->lamp_count;
    return count < 1 ? 1 : count > most ? most : count;
}

static const char* no_maps(const es_renderer* r, const es_frame_inputs* in) { return in->no_vpls ? in->no_vpls : r->first_vpls ? NULL : "the lights reach nothing"; }

/* Before lamps' bounce has placed its lights. */
static bool wants_points(const es_renderer* r, const es_frame_inputs* in)
{
    const es_renderer_settings* s = &r->settings;
    return !in->no_vpls && (r->first_vpls || es_lamps_bounce(r, in)) && (es_draws_imperfect_maps(s) || es_bounce_wants_points(s));
}

static es_result pass_scene_points(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* none = no_maps(r, in);
    const bool lamps = es_lamps_want_maps(r), points = lamps || wants_points(r, in);
    if (!points) {
        es_plan_not_needed(plan, ES_PASS_POINTS, none ? none : "gi is not ism");
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_POINTS);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_point_request request = {s->ism_points, subset_count(s, lamps), s->ism_detail};
    es_plan_reads(plan, &request, sizeof request);
    if (!es_plan_run(plan, ES_PASS_POINTS)) return ES_OK;
    uint64_t moved;
    es_result result = es_scene_points_update(r->context, &r->points, in->list, &request, &moved);
    if (!result) es_plan_done(plan, ES_PASS_POINTS, moved);
    return result;
}

static es_result pass_maps(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* none = no_maps(r, in);
    const bool imperfect = es_draws_imperfect_maps(s);
    if (none || !imperfect) es_plan_not_needed(plan, ES_PASS_ISM, none ? none : "gi is not ism");
    if (none || s->method != ES_GI_CLASSIC) es_plan_not_needed(plan, ES_PASS_CLASSIC, none ? none : "gi is not classic");
    if (none || (!imperfect && s->method != ES_GI_CLASSIC)) return ES_OK;

    /* room for all bounces: maps of later ones are added while these stand */
    const uint32_t capacity = es_bounce_room(r);
    const es_pass pass = imperfect ? ES_PASS_ISM : ES_PASS_CLASSIC;
    es_plan_begin(plan, pass);
    es_plan_reads_pass(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_LAMP_BOUNCE);
    if (imperfect) {
        es_plan_reads_pass(plan, ES_PASS_POINTS);
        float numbers[] = {(float)s->ism_size, s->pull_push, s->pull_threshold, s->push_threshold, (float)s->pull_push_levels, in->extent};
        es_plan_reads(plan, numbers, sizeof numbers);
    } else {
        es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
        es_plan_reads(plan, &s->classic_size, sizeof s->classic_size);
    }
    es_plan_reads(plan, &capacity, sizeof capacity);
    if (!es_plan_run(plan, pass)) return ES_OK;
    es_result result = imperfect ? es_draw_imperfect_maps(r, in, 0, r->first_vpls, capacity) : es_ism_maps_reserve(r->context, &r->maps, s->classic_size, capacity, in->extent);
    if (!result && !imperfect) result = es_draw_classic_maps(r, in, 0, r->first_vpls);
    if (!result) es_plan_done(plan, pass, imperfect ? r->maps.kept.splats : r->first_vpls);
    if (!result && imperfect && !r->maps.kept.splats && r->maps.kept.stood) plan->stats[pass].skipped = "neither a light nor a point moved";
    return result;
}

static es_result pass_direct(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    if (!r->light_count) {
        es_plan_not_needed(plan, ES_PASS_DIRECT, in->light_count ? "nothing to light" : "no light is on");
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_DIRECT);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_SHADOW_MAPS);
    if (r->settings.screen_repair) es_plan_reads_pass(plan, ES_PASS_SCREEN_VIEWS);
    es_plan_reads_pass(plan, ES_PASS_EDITS);
    es_plan_reads(plan, in->lights, in->light_count * sizeof *in->lights);
    float numbers[] = {(float)r->settings.shadow_filter, r->settings.shadow_bias, r->settings.shadow_slope_bias, (float)r->settings.screen_repair, r->settings.screen_repair_least * in->extent};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_DIRECT)) return ES_OK;
    for (uint32_t i = 0; i < r->light_count; i++) {
        es_direct_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .view = &r->light_views[i], .shadow_filter = r->settings.shadow_filter, .shadow_bias = r->settings.shadow_bias,
            .shadow_slope_bias = r->settings.shadow_slope_bias, .repair = r->settings.screen_repair ? &r->screen.stack.views[0] : NULL, .repair_samples = r->settings.screen_repair,
            .repair_least = r->settings.screen_repair_least * in->extent, .first = i == 0, .out = {r->direct.at[0], r->direct.at[1], r->direct.at[2]}};
        es_edited_reflections(r, job.edited);
        es_direct_light(r->context, &job);
    }
    es_plan_done(plan, ES_PASS_DIRECT, r->light_count);
    return ES_OK;
}

/* What getting used to the picture makes of the exposure. */
static float exposure_adapted(const es_renderer* r) { return r->exposure.grid.started ? es_exposure_scale(&r->exposure, r->settings.exposure_key) : 1.0f; }

es_compose_job es_renderer_compose_job(const es_renderer* r)
{
    const es_renderer_settings* s = &r->settings;
    es_compose_job job = {.gbuffer = &r->gbuffer, .exposure_scale = es_exp2(s->exposure) * exposure_adapted(r), .white = s->white, .tone_map = s->tone_map};
    const es_planes* irradiance = es_indirect_irradiance(r);
    const es_planes* specular = es_indirect_specular(r);
    job.lit = specular->lit;
    es_lamps_compose(r, &job);
    es_screen_compose(r, &job);
    es_blend_compose(r, &job);
    es_reflections_compose(r, &job);
    for (int k = 0; k < 3; k++) {
        if (r->plan.valid[ES_PASS_BACKGROUND]) job.background[k] = r->background.at[k];
        if (r->plan.valid[ES_PASS_DIRECT]) job.direct[k] = r->direct.at[k];
        if (es_indirect_is_there(r)) job.irradiance[k] = irradiance->at[k];
        if (es_indirect_is_there(r) && r->has_specular) job.specular[k] = specular->at[k];
        if (r->plan.valid[ES_PASS_COMPENSATION]) job.further[ES_FURTHER_RAYS][k] = r->compensation.at[k];
        if (r->plan.valid[ES_PASS_SCREEN_BOUNCE]) job.further[ES_FURTHER_BOUNCE][k] = r->screen.bounce.at[k];
        if (r->plan.valid[ES_PASS_SECOND_ORDER]) job.further[ES_FURTHER_NEGATIVE][k] = r->second_order.negative.at[k];
        for (uint32_t i = 0; i < es_residual_steps(r); i++) job.further[ES_FURTHER_RESIDUAL + i][k] = r->residual.steps[i].at[k];
        if (r->plan.valid[ES_PASS_RADIANCE]) job.finished[k] = r->radiance.at[k];
        if (r->plan.valid[ES_PASS_ANTIALIAS]) job.finished[k] = r->history.picture[r->history.current_picture].at[k];
    }
    return job;
}

/* What a picture's radiance is made of. */
static void reads_picture(es_plan* plan, const es_compose_job* job)
{
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_BACKGROUND);
    es_plan_reads_pass(plan, ES_PASS_DIRECT);
    es_plan_reads_pass(plan, ES_PASS_LAMP_LIGHT);
    es_plan_reads_pass(plan, ES_PASS_LAMP_FILTER);
    es_indirect_reads(plan);
    es_plan_reads_pass(plan, ES_PASS_FILTER);
    es_plan_reads_pass(plan, ES_PASS_TEMPORAL);
    es_plan_reads_pass(plan, ES_PASS_UPSAMPLE);
    es_plan_reads_pass(plan, ES_PASS_COMPENSATION);
    es_screen_reads(plan);
    es_plan_reads_pass(plan, ES_PASS_RESIDUAL);
    es_plan_reads_pass(plan, ES_PASS_SECOND_ORDER);
    es_reflections_read(plan);
    es_plan_reads_pass(plan, ES_PASS_BLEND_LIGHT);
    es_plan_reads_pass(plan, ES_PASS_ANTIALIAS);
    const uint32_t parts[] = {job->direct[0] != NULL, job->irradiance[0] != NULL, job->specular[0] != NULL, job->lamp_irradiance[0] != NULL, job->lamp_specular[0] != NULL};
    es_plan_reads(plan, parts, sizeof parts);
}

/* Does something look at the whole picture before it is shown? */
static bool wants_radiance(const es_renderer* r) { return r->settings.exposure_adapt > 0 || r->settings.glare != ES_GLARE_OFF; }

static es_result pass_radiance(es_renderer* r)
{
    es_plan* plan = &r->plan;
    if (!wants_radiance(r) || r->settings.antialias != ES_ANTIALIAS_NONE) {
        es_plan_not_needed(plan, ES_PASS_RADIANCE, wants_radiance(r) ? "anti-aliasing has made it" : "nothing reads it");
        es_planes_free(r->context, &r->radiance);
        return ES_OK;
    }
    es_compose_job job = es_renderer_compose_job(r);
    es_plan_begin(plan, ES_PASS_RADIANCE);
    reads_picture(plan, &job);
    if (!es_plan_run(plan, ES_PASS_RADIANCE)) return ES_OK;
    es_result result = es_planes_resize(r->context, &r->radiance, &r->gbuffer);
    if (result) return result;
    for (int k = 0; k < 3; k++) {
        job.finished[k] = NULL;
        job.radiance[k] = r->radiance.at[k];
    }
    es_compose(r->context, &job);
    es_plan_done(plan, ES_PASS_RADIANCE, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return ES_OK;
}

static es_result pass_meter(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    if (!wants_radiance(r)) {
        es_plan_not_needed(plan, ES_PASS_METER, "nothing reads it");
        r->exposure = (es_exposure){0};
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_METER);
    es_plan_reads_pass(plan, ES_PASS_RADIANCE);
    es_plan_reads_pass(plan, ES_PASS_ANTIALIAS);
    if (es_plan_run(plan, ES_PASS_METER)) {
        const es_compose_job job = es_renderer_compose_job(r);
        es_result result = es_meter_read(r->context, job.finished, r->gbuffer.width, r->gbuffer.height, r->gbuffer.stride, &r->metered);
        if (result) return result;
        es_plan_done(plan, ES_PASS_METER, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    }
    if (s->exposure_adapt > 0) es_exposure_advance(&r->exposure, s->exposure_adapt, in->time, r->metered.log_average);
    else r->exposure = (es_exposure){0};
    return ES_OK;
}

static void pass_compose(es_renderer* r)
{
    es_plan* plan = &r->plan;
    es_compose_job job = es_renderer_compose_job(r);
    es_glare_compose(r, &job);
    es_plan_begin(plan, ES_PASS_COMPOSE);
    reads_picture(plan, &job);
    es_plan_reads_pass(plan, ES_PASS_GLARE);
    const float numbers[] = {job.exposure_scale, job.white, (float)job.tone_map, job.finished[0] != NULL};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_COMPOSE)) return;
    job.xrgb = r->display;
    job.srgb = &r->srgb;
    es_compose(r->context, &job);
    es_plan_done(plan, ES_PASS_COMPOSE, (uint64_t)r->gbuffer.width * r->gbuffer.height);
}

/* ---- the frame ------------------------------------------------------------------------------------------------------------------ */

static es_result draw_picture(es_renderer* r, const es_frame_inputs* in, es_world* world, uint32_t picture)
{
    es_antialias_aim(r, picture);
    r->rays = es_pixel_rays_of_view(&r->view);
    es_result result = pass_visibility(r, in);
    if (!result) result = es_pass_edits(r, in, world);
    if (!result) result = es_pass_background(r, in);
    if (!result) result = es_pass_environment(r, in);
    if (!result) result = es_pass_reflecting(r, in);
    if (!result) result = es_pass_screen_views(r, in);
    if (!result) result = pass_light_views(r, in);
    if (!result) result = pass_vpls(r, in, world, picture);
    if (!result) result = es_pass_lamps(r, in);
    if (!result) result = pass_scene_points(r, in);
    if (!result) result = es_pass_hierarchy(r, in, world);
    if (!result) result = es_pass_refracting(r, in, world);
    if (!result) result = es_pass_lamp_maps(r, in);
    if (!result) result = es_pass_lamp_bounce(r, in);
    if (!result) result = pass_maps(r, in);
    if (!result) result = es_pass_bounces(r, in);
    if (!result) result = es_pass_points(r, in);
    if (!result) result = pass_direct(r, in);
    if (!result) result = es_pass_lamp_light(r, in);
    if (!result) result = es_pass_shading(r, in);
    if (!result) result = es_pass_second_order(r, in);
    if (!result) result = es_pass_micro(r, in);
    if (!result) result = es_pass_compensation(r, in);
    const bool first = r->settings.temporal_stage == ES_TEMPORAL_BEFORE_FILTER;
    if (!result && first) result = es_pass_temporal(r, in);
    if (!result) result = es_pass_filter(r, in);
    if (!result && !first) result = es_pass_temporal(r, in);
    if (!result) result = es_pass_upsample(r, in);
    if (!result) result = es_pass_screen_occlusion(r, in);
    if (!result) result = es_pass_screen_bounce(r, in);
    if (!result) result = es_pass_residual(r, in);
    if (!result) result = es_pass_reflection_maps(r, in);
    if (!result) result = es_pass_reflections(r, in);
    if (!result) result = es_pass_blend_layers(r, in);
    if (!result) result = es_pass_blend_light(r, in);
    return result ? result : es_pass_antialias(r, picture);
}

static uint32_t vpls_of(const es_renderer_settings* s) { return s->method == ES_GI_SECOND_ORDER ? s->second_lights : s->vpls; }

static void why_no_light(const es_renderer_settings* s, es_frame_inputs* in)
{
    in->may_have_lamps = s->lamps != ES_LAMPS_NONE && (in->has_environment || es_something_glows(in->list));
    const bool of_lamps = in->may_have_lamps && s->lamp_vpls;
    in->no_indirect = s->bounces == 0 ? "bounces is 0" : !vpls_of(s) && !of_lamps ? s->method == ES_GI_SECOND_ORDER ? "second.lights is 0" : "vpl.count is 0" : !in->light_count && !of_lamps ? "no light is on" : !in->has_geometry ? "nothing to light" : NULL;
    in->no_vpls = in->no_indirect;
    if (s->method == ES_GI_NONE) in->no_indirect = in->no_vpls = "gi is none";
    if (s->method != ES_GI_MICRO) return;
    if (!in->no_vpls && !es_micro_vpl_bounces(s)) in->no_vpls = "gi is micro";
    in->no_indirect = es_micro_nothing(in, s);
}

static es_result render(es_renderer* r, es_world* world)
{
    es_camera camera = es_world_active_camera(world);
    if (!camera.id) return es_misuse(r->context, ES_WRONG_STATE, "the world has no active camera; es_world_set_active_camera chooses one");
    es_result result = resize_frame(r);
    if (result) return result;
    result = es_world_camera_view(world, camera, r->settings.width, r->settings.height, &r->view);
    if (result) return result;
    result = es_blend_lists_make(r->context, &r->lists, es_world_draw_list(world), r->settings.blend_layers > 0);
    if (result) return result;
    es_frame_inputs in = {.list = &r->lists.light, .solid = &r->lists.solid, .layers = &r->lists.layers, .revisions = es_world_get_revisions(world)};
    size_t light_count;
    in.lights = es_world_lights(world, &light_count);
    in.light_count = (uint32_t)light_count;
    in.time = es_world_time(world);
    in.has_environment = es_world_get_environment(world, &in.environment);
    in.has_geometry = es_world_bounds(world, &in.bounds_min, &in.bounds_max);
    in.extent = in.has_geometry ? es_maxf(es_v3_length(es_v3_sub(in.bounds_max, in.bounds_min)), 1e-9f) : 1.0f;
    const es_renderer_settings* s = &r->settings;
    why_no_light(s, &in);

    r->frame = (es_frame_settings){*s, in.extent};
    result = es_history_begin(r, &in, world);
    if (result) return result;
    es_plan_begin_frame(&r->plan, s->skip);
    /* several pictures that are to come out as they did: there is nothing to do for any */
    const bool stands = s->skip && s->antialias == ES_ANTIALIAS_SUPERSAMPLE && r->history.resting && r->plan.valid[ES_PASS_ANTIALIAS];
    if (stands)
        for (int i = 0; i < ES_PASS_COUNT; i++) r->plan.stats[i].skipped = "the picture has settled";
    const uint32_t pictures = stands ? 0 : es_antialias_pictures(s);
    for (uint32_t i = 0; i < pictures && !result; i++) result = draw_picture(r, &in, world, i);
    if (!result) result = pass_radiance(r);
    if (!result) result = pass_meter(r, &in);
    if (!result) result = es_pass_glare(r, in.time);
    if (!result) pass_compose(r);
    if (!result) es_history_end(&r->history);
    return result;
}

es_result es_renderer_render(es_renderer* renderer, es_world* world)
{
    if (!world || es_world_context(world) != renderer->context) return es_misuse(renderer->context, ES_INVALID_ARGUMENT, "the renderer and the world must share one context");
    double start = es_seconds();
    es_fp_environment environment = es_fp_enter();
    es_result result = render(renderer, world);
    es_fp_leave(environment);
    if (result) {
        es_plan_invalidate(&renderer->plan); /* a pass may have stopped halfway */
        renderer->complete = false;
        renderer->vpl_count = renderer->first_vpls = renderer->punctual_vpls = renderer->light_count = 0;
        renderer->stats.bounce_count = 0;
        return result;
    }
    renderer->complete = true;
    renderer->stats.frame = renderer->frames++;
    renderer->stats.milliseconds = (es_seconds() - start) * 1e3;
    renderer->stats.passes = renderer->plan.stats;
    renderer->stats.pass_count = ES_PASS_COUNT;
    return ES_OK;
}

/* ---- results ------------------------------------------------------------------------------------------------------------------------ */

const uint32_t* es_renderer_display(es_renderer* renderer, uint32_t* width, uint32_t* height)
{
    *width = renderer->gbuffer.width;
    *height = renderer->gbuffer.height;
    return renderer->display;
}

const es_frame_stats* es_renderer_stats(const es_renderer* renderer) { return &renderer->stats; }

size_t es_renderer_vpls(const es_renderer* renderer, es_vpl* vpls, size_t capacity)
{
    uint32_t bounce = 1;
    for (size_t i = 0; i < renderer->vpl_count && i < capacity; i++) {
        while (i >= es_bounce_end(renderer, bounce)) bounce++;
        const es_vpl_record* v = &renderer->vpls[i];
        vpls[i] = (es_vpl){{v->position[0], v->position[1], v->position[2]}, {v->normal[0], v->normal[1], v->normal[2]}, {v->flux[0], v->flux[1], v->flux[2]}, bounce};
    }
    return renderer->vpl_count;
}

size_t es_renderer_points(const es_renderer* renderer, uint32_t map, float* positions, size_t capacity)
{
    const es_scene_points* points = &renderer->points;
    if (!points->subset_count || !renderer->plan.valid[ES_PASS_ISM]) return 0;
    size_t first = (size_t)(map % points->subset_count) * points->subset_size;
    for (size_t i = 0; i < points->subset_size && i < capacity; i++) {
        positions[3 * i] = points->x[first + i];
        positions[3 * i + 1] = points->y[first + i];
        positions[3 * i + 2] = points->z[first + i];
    }
    return points->subset_size;
}
