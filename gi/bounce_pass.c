#include "gi/bounce_pass.h"

#include <string.h>

#include "gi/blend_passes.h"
#include "gi/bounces.h"
#include "gi/classic.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/micro_passes.h"
#include "gi/passes.h"

/* Sets of points for the senders, together about as many as Knecht's scenes have (§5.1: 32k). */
enum { POINT_SUBSETS = 128 };

/* Those that virtual point lights make: all, or all but the last, which micro-buffers gather. */
static uint32_t bounces_of(const es_renderer_settings* s) { return s->method == ES_GI_MICRO ? es_micro_vpl_bounces(s) : s->method == ES_GI_SECOND_ORDER ? s->bounces > 0 : s->bounces; }

static uint32_t further_vpls(const es_renderer_settings* s) { return bounces_of(s) > 1 ? (bounces_of(s) - 1) * s->bounce_vpls : 0; }

uint32_t es_bounce_capacity(const es_renderer_settings* s) { return (s->method == ES_GI_SECOND_ORDER ? s->second_lights : s->vpls) + (s->lamps != ES_LAMPS_NONE ? s->lamp_vpls : 0) + further_vpls(s); }

uint32_t es_bounce_room(const es_renderer* r) { return r->first_vpls + further_vpls(&r->settings); }

bool es_bounce_wants_points(const es_renderer_settings* s) { return bounces_of(s) > 1 && s->bounce_vpls && s->bounce_method == ES_BOUNCE_REFLECTIVE; }

bool es_bounce_wants_rays(const es_renderer_settings* s)
{
    return bounces_of(s) > 1 && s->bounce_vpls && s->bounce_method == ES_BOUNCE_ONE_PASS && s->bounce_rays && (es_draws_imperfect_maps(s) || s->method == ES_GI_CLASSIC);
}

uint32_t es_bounce_end(const es_renderer* r, uint32_t bounces)
{
    uint32_t end = 0;
    for (uint32_t b = 0; b < bounces && b < r->stats.bounce_count; b++) end += r->bounces[b].vpls;
    return end;
}

static es_result prepare_points(es_renderer* r, const es_frame_inputs* in, uint32_t method, const es_scene_points** points)
{
    const es_renderer_settings* s = &r->settings;
    *points = &r->points;
    if (method == ES_BOUNCE_ONE_PASS) {
        uint64_t moved;
        *points = &r->bounce_points;
        es_result result = es_scene_points_update(r->context, &r->bounce_points, in->list, &(es_point_request){.subset_size = s->bounce_points, .subset_count = POINT_SUBSETS}, &moved);
        if (result) return result;
    }
    return es_surfels_update(r->context, &r->surfels, *points, in->list, in->revisions.materials);
}

static es_result draw_maps(es_renderer* r, const es_frame_inputs* in, uint32_t first, uint32_t end)
{
    if (es_draws_imperfect_maps(&r->settings)) return es_draw_imperfect_maps(r, in, first, end, es_bounce_room(r));
    return r->settings.method == ES_GI_CLASSIC ? es_draw_classic_maps(r, in, first, end) : ES_OK;
}

/* ---- of lamps ------------------------------------------------------------------------------------------------------------------ */

static bool is_traced(const es_renderer_settings* s) { return s->method == ES_GI_VPL_TRACED || s->method == ES_GI_VPL_SAMPLED; }

bool es_lamps_bounce(const es_renderer* r, const es_frame_inputs* in) { return !in->no_vpls && es_lamps_are_there(r) && r->settings.lamp_vpls && bounces_of(&r->settings); }

/* Of one bounce, maps alone say what lamps see, unless there are none. */
bool es_lamps_bounce_wants_rays(const es_renderer* r, const es_frame_inputs* in)
{
    return es_lamps_bounce(r, in) && (!es_lamps_want_maps(r) || is_traced(&r->settings) || (bounces_of(&r->settings) > 1 && r->settings.bounce_rays));
}

es_result es_pass_lamp_bounce(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    if (!es_lamps_bounce(r, in)) {
        es_plan_not_needed(plan, ES_PASS_LAMP_BOUNCE, in->no_vpls ? in->no_vpls : !es_lamps_are_there(r) ? plan->stats[ES_PASS_LAMPS].skipped ? plan->stats[ES_PASS_LAMPS].skipped : "no light comes from what glows" : "lamps.vpls is 0");
        return ES_OK;
    }
    es_result result = es_reserve_vpls(r, es_bounce_capacity(s));
    if (result) return result;
    const bool rays = es_lamps_bounce_wants_rays(r, in), maps = es_lamps_want_maps(r) && !is_traced(s);
    es_plan_begin(plan, ES_PASS_LAMP_BOUNCE);
    const es_pass read[] = {ES_PASS_VPLS, ES_PASS_LAMPS, ES_PASS_LAMP_MAPS, ES_PASS_HIERARCHY};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    const uint32_t words[] = {s->lamp_vpls, s->bounce_points, s->bounce_rays, s->seed, s->interleave, rays, maps, r->punctual_vpls, es_bounce_capacity(s) /* another one begins with empty room */};
    es_plan_reads(plan, words, sizeof words);
    const float numbers[] = {s->lamp_slope_bias, in->extent};
    es_plan_reads(plan, numbers, sizeof numbers);
    r->first_vpls = r->punctual_vpls + s->lamp_vpls;
    if (!es_plan_run(plan, ES_PASS_LAMP_BOUNCE)) return ES_OK;
    const es_lamps* set = &r->lamps.set;
    es_bounce_job job = {.method = ES_BOUNCE_ONE_PASS, .vpls = r->vpls, .senders = set->records, .sender_count = set->count, .first = r->punctual_vpls, .count = s->lamp_vpls, .bounce = 1, .seed = s->seed,
        .subsets = s->interleave * s->interleave, .surfels = &r->surfels, .maps = maps ? &r->lamps.maps : NULL, .extent = in->extent, .near_distance = es_near_distance(in), .slope_bias = s->lamp_slope_bias * in->extent,
        .rays = s->bounce_rays, .glossy = s->glossy_vpls};
    result = prepare_points(r, in, ES_BOUNCE_ONE_PASS, &job.points);
    es_vpl_visibility visibility;
    if (!result && rays) {
        es_arena_reset(&r->arena);
        result = es_vpl_visibility_prepare(&r->arena, &r->trace_scene, set->records, set->count, in->extent, &visibility);
        job.scene = &r->trace_scene;
        job.ends = visibility.ends;
    }
    if (!result) result = es_bounce_lights(r->context, &job);
    if (!result) es_plan_done(plan, ES_PASS_LAMP_BOUNCE, s->lamp_vpls);
    return result;
}

/* ---- further ones -------------------------------------------------------------------------------------------------------------- */

static es_result add_bounce(es_renderer* r, const es_frame_inputs* in, const es_scene_points* points, uint32_t bounce)
{
    const es_renderer_settings* s = &r->settings;
    const bool traced = is_traced(s);
    const es_bounce_stats* before = &r->bounces[bounce - 2];
    es_bounce_stats* stats = &r->bounces[bounce - 1];
    double start = es_seconds();
    es_bounce_job job = {.method = s->bounce_method, .vpls = r->vpls, .senders = r->vpls, .first_sender = r->vpl_count - before->vpls, .sender_count = before->vpls, .first = r->vpl_count, .count = s->bounce_vpls, .bounce = bounce,
        .seed = s->seed, .subsets = s->interleave * s->interleave, .points = points, .surfels = &r->surfels, .maps = traced ? NULL : &r->maps, .extent = in->extent, .near_distance = es_near_distance(in),
        .bias = s->ism_bias * in->extent, .slope_bias = s->ism_slope_bias * in->extent, .rays = s->bounce_rays, .lobe_roughness = s->traced_bias == ES_TRACED_UNBOUNDED ? 0.0f : s->lobe_roughness, .glossy = s->glossy_vpls,
        .size = s->ism_size, .levels = s->pull_push ? s->pull_push_levels : 0, .push_threshold = s->push_threshold};
    es_vpl_visibility visibility;
    es_result result = ES_OK;
    if ((traced && s->bounce_method == ES_BOUNCE_ONE_PASS) || es_bounce_wants_rays(s)) {
        es_arena_reset(&r->arena);
        result = es_vpl_visibility_prepare(&r->arena, &r->trace_scene, r->vpls + job.first_sender, job.sender_count, in->extent, &visibility);
        job.scene = &r->trace_scene;
        job.ends = visibility.ends;
    }
    if (!result) result = es_bounce_lights(r->context, &job);
    if (result) return result;
    stats->milliseconds = (es_seconds() - start) * 1e3;
    stats->vpls = s->bounce_vpls;
    r->vpl_count += s->bounce_vpls;
    start = es_seconds();
    result = draw_maps(r, in, job.first, r->vpl_count);
    stats->map_milliseconds = traced ? 0.0 : (es_seconds() - start) * 1e3;
    return result;
}

static void sum_power(es_renderer* r)
{
    uint32_t v = 0;
    for (uint32_t b = 0; b < r->stats.bounce_count; b++) {
        es_bounce_stats* stats = &r->bounces[b];
        for (int k = 0; k < 3; k++) stats->power[k] = 0.0;
        for (uint32_t end = v + stats->vpls; v < end; v++)
            for (int k = 0; k < 3; k++) stats->power[k] += (double)r->vpls[v].power[k];
    }
}

es_result es_pass_bounces(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const uint32_t bounces = bounces_of(s);
    const char* why = in->no_vpls ? in->no_vpls : !r->first_vpls ? "the lights reach nothing" : bounces < 2 ? "bounces is 1" : !s->bounce_vpls ? "bounce.vpls is 0" : NULL;
    r->stats.bounces = r->bounces;
    r->stats.bounce_count = in->no_vpls ? 0 : bounces > 1 && !why ? bounces : 1;
    r->bounces[0].vpls = r->first_vpls;
    if (why) {
        r->vpl_count = r->first_vpls;
        es_plan_not_needed(plan, ES_PASS_BOUNCES, why);
        sum_power(r);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_BOUNCES);
    const es_pass read[] = {ES_PASS_VPLS, ES_PASS_LAMP_BOUNCE, ES_PASS_POINTS, ES_PASS_ISM, ES_PASS_CLASSIC, ES_PASS_HIERARCHY};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    uint32_t words[] = {bounces, s->bounce_method, s->bounce_vpls, s->bounce_points, s->bounce_rays, s->method, s->seed, s->interleave, s->glossy_vpls, s->traced_bias, s->ism_size, s->pull_push, s->pull_push_levels, r->first_vpls};
    es_plan_reads(plan, words, sizeof words);
    float numbers[] = {s->ism_bias, s->ism_slope_bias, s->lobe_roughness, s->push_threshold, in->extent};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (es_plan_run(plan, ES_PASS_BOUNCES)) {
        const es_scene_points* points;
        r->vpl_count = r->first_vpls;
        es_result result = prepare_points(r, in, s->bounce_method, &points);
        for (uint32_t b = 2; b <= bounces && !result; b++) result = add_bounce(r, in, points, b);
        if (result) return result;
        es_plan_done(plan, ES_PASS_BOUNCES, r->vpl_count - r->first_vpls);
    }
    r->vpl_count = r->first_vpls + (bounces - 1) * s->bounce_vpls;
    sum_power(r);
    return ES_OK;
}

/* ---- images of single bounces ------------------------------------------------------------------------------------------------- */

/* Indirect light of the first `bounces` bounces, without that of frames before. */
static es_result first_bounces(es_renderer* r, uint32_t bounces, es_planes* result)
{
    es_result outcome = es_planes_resize(r->context, result, &r->gbuffer);
    const bool open = r->plan.valid[ES_PASS_SECOND_ORDER]; /* one bounce, which is all */
    if (outcome || !bounces || !(open || r->plan.valid[ES_PASS_SHADING])) return outcome;
    es_compose_job job = es_renderer_compose_job(r);
    es_indirect_planes shaded, whole, filtered;
    memset(&shaded, 0, sizeof shaded);
    memset(&whole, 0, sizeof whole);
    memset(&filtered, 0, sizeof filtered);
    es_planes layers = {0};
    if (!open && (bounces < r->stats.bounce_count || r->plan.valid[ES_PASS_TEMPORAL])) {
        outcome = es_indirect_shade(r, es_bounce_end(r, bounces), &shaded.irradiance, &shaded.specular);
        if (!outcome && r->filter_passes) outcome = es_indirect_filter(r, &shaded.irradiance, &shaded.specular, &filtered.irradiance, &filtered.specular);
        const es_indirect_planes* last = r->filter_passes ? &filtered : &shaded;
        if (!outcome && r->plan.valid[ES_PASS_UPSAMPLE]) {
            outcome = es_indirect_upsample(r, &last->irradiance, &last->specular, &whole.irradiance, &whole.specular);
            last = &whole;
        }
        for (int k = 0; k < 3; k++) {
            job.irradiance[k] = last->irradiance.at[k];
            job.specular[k] = r->has_specular ? last->specular.at[k] : NULL;
        }
    }
    if (!outcome && !open && bounces < r->stats.bounce_count) outcome = es_blend_bounded(r, es_bounce_end(r, bounces), &layers);
    for (int k = 0; k < 3; k++) {
        job.indirect[k] = result->at[k];
        if (layers.memory) job.layers.bounded[k] = layers.at[k];
    }
    if (!outcome) es_compose(r->context, &job);
    es_indirect_planes_free(r->context, &shaded);
    es_indirect_planes_free(r->context, &whole);
    es_indirect_planes_free(r->context, &filtered);
    es_planes_free(r->context, &layers);
    return outcome;
}

/* To a whole multiple of the last place of `whole`: differences of such numbers that are not above it are exact. */
static float on_grid_of(float whole, float a)
{
    uint32_t bits;
    memcpy(&bits, &whole, sizeof bits);
    const uint32_t exponent = bits >> 23 & 0xff;
    const uint64_t power_of_two = (uint64_t)(1023 - 150 + (exponent ? exponent : 1)) << 52;
    double grid;
    memcpy(&grid, &power_of_two, sizeof grid);
    const double magic = 0x1.8p52; /* pushes out the fraction */
    return (float)((((double)a / grid + magic) - magic) * grid);
}

es_result es_bounce_image(es_renderer* r, uint32_t bounce, es_image* image)
{
    const bool gathered = r->frame.settings.method == ES_GI_MICRO;
    const uint32_t bounces = gathered ? es_micro_bounces(r) : (uint32_t)r->stats.bounce_count;
    if (bounce > bounces) return ES_OK; /* black */
    es_result (*first)(es_renderer * r, uint32_t bounces, es_planes * result) = gathered ? es_micro_first_bounces : first_bounces;
    es_planes whole = {0}, sum = {0}, before = {0};
    es_result result = first(r, bounces, &whole);
    if (!result) result = first(r, bounce, &sum);
    if (!result) result = first(r, bounce - 1, &before);
    for (uint32_t y = 0; y < image->height && !result; y++)
        for (uint32_t x = 0; x < image->width; x++)
            for (int k = 0; k < 3; k++) {
                const size_t at = (size_t)y * r->gbuffer.stride + x;
                const float w = whole.at[k][at];
                image->pixels[((size_t)y * image->width + x) * 3 + (size_t)k] = on_grid_of(w, sum.at[k][at]) - on_grid_of(w, before.at[k][at]);
            }
    es_planes_free(r->context, &whole);
    es_planes_free(r->context, &sum);
    es_planes_free(r->context, &before);
    return result;
}
