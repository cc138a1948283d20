/* What a frame takes from the one before (gi/history.h), and the pass of temporal coherence. */
#include <string.h>

#include "gi/indirect.h"
#include "gi/light_change.h"
#include "gi/renderer.h"
#include "platform/maths.h"
#include "platform/random.h"

/* ---- going on ----------------------------------------------------------------------------------------------------------- */

uint64_t es_history_settings(const es_renderer_settings* settings)
{
    static const char* const others[] = {"skip", "exposure", "exposure.adapt", "exposure.key", "white", "tone-map"};
    uint64_t hash = 0;
    for (size_t i = 0; i < es_renderer_setting_count(); i++) {
        const es_setting* setting = es_renderer_setting(i);
        bool counts = true;
        counts &= strncmp(setting->name, "glare", 5) != 0; /* done to the finished picture */
        for (size_t k = 0; k < sizeof others / sizeof *others; k++) counts &= strcmp(setting->name, others[k]) != 0;
        const char* value = (const char*)settings + setting->offset;
        if (counts) hash = es_hash_bytes(hash, value, setting->type == ES_SETTING_BOOL ? sizeof(bool) : sizeof(uint32_t));
    }
    return hash;
}

/* Last frame's view, relative to this frame's origin. */
static es_mat4 moved_view(es_mat4 view, const double from[3], const double to[3])
{
    float* m = view.m;
    if (memcmp(from, to, 3 * sizeof *from) == 0) return view;
    for (int row = 0; row < 3; row++) {
        double t = (double)m[12 + row];
        for (int k = 0; k < 3; k++) t += (double)m[4 * k + row] * (to[k] - from[k]);
        m[12 + row] = (float)t;
    }
    return view;
}

static bool same_view(const es_raster_view* a, const es_mat4* view, const es_mat4* projection)
{
    return memcmp(&a->view, view, sizeof *view) == 0 && memcmp(&a->projection, projection, sizeof *projection) == 0;
}

/* How suddenly lights changed (gi/light_change.h); 1 where one came or went, and at most. */
static float light_change(const es_history* h, const es_frame_inputs* in, const double origin[3])
{
    if (h->light_count != in->light_count) return 1.0f;
    const es_vec3 shift = es_v3((float)(h->origin[0] - origin[0]), (float)(h->origin[1] - origin[1]), (float)(h->origin[2] - origin[2]));
    float most = 0.0f;
    for (uint32_t i = 0; i < in->light_count; i++) {
        const es_light_state *a = &h->lights[i], *b = &in->lights[i];
        if (a->handle.id != b->handle.id || a->type != b->type) return 1.0f;
        most = es_maxf(most, es_light_change(a, b, shift, in->extent));
    }
    return es_minf(most, 1.0f);
}

static es_result keep_lights(es_context* context, es_history* h, const es_frame_inputs* in)
{
    if (in->light_count > h->light_capacity) {
        es_release(context, h->lights, h->light_capacity * sizeof *h->lights);
        h->light_capacity = 0;
        h->lights = es_allocate_array(context, in->light_count, sizeof *h->lights);
        if (!h->lights) return es_context_last_result(context);
        h->light_capacity = in->light_count;
    }
    if (in->light_count) memcpy(h->lights, in->lights, in->light_count * sizeof *h->lights);
    h->light_count = in->light_count;
    return ES_OK;
}

es_result es_history_begin(es_renderer* r, const es_frame_inputs* in, const es_world* world)
{
    es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    const bool goes_on = h->complete;
    h->complete = h->continuous = h->settled = h->resting = false;
    h->moving = true;
    h->job.gbuffer = NULL;
    h->wanted = s->temporal || s->antialias != ES_ANTIALIAS_NONE;
    if (!h->wanted) {
        es_history_free(r->context, h);
        return ES_OK;
    }
    double origin[3];
    es_world_origin(world, origin);
    const uint32_t camera = es_world_active_camera(world).id;
    const uint64_t settings = es_history_settings(s);
    const es_world_revisions* now = &in->revisions;
    const uint64_t steps = now->steps - h->revisions.steps;
    const es_mat4 last_view = moved_view(h->view.view, h->origin, origin), last_projection = h->view.projection;
    const bool turned = !same_view(&r->view, &last_view, &last_projection), carried = now->moving && steps == 1;
    h->continuous = goes_on && camera == h->camera && settings == h->settings && (steps == 1 || (steps == 0 && now->geometry == h->revisions.geometry && !(now->moving && turned)));
    h->moving = turned || carried;

    uint64_t content = es_hash_bytes(settings, &r->view.view, sizeof r->view.view);
    content = es_hash_bytes(content, &r->view.projection, sizeof r->view.projection);
    const uint64_t words[] = {now->geometry, now->materials, now->lights, now->edits};
    content = es_hash_bytes(content, words, sizeof words);
    content = es_hash_bytes(content, &s->exposure, sizeof s->exposure);
    h->still = h->continuous && !h->moving && content == h->content ? h->still + (h->still < UINT32_MAX) : 0;
    const uint32_t settle = s->temporal || s->antialias == ES_ANTIALIAS_TEMPORAL ? s->temporal_settle : 0;
    h->settled = h->still >= settle;
    h->resting = h->still > settle;
    if (!h->continuous) h->planes = 0;
    h->alert = h->continuous ? es_maxf(light_change(h, in, origin), h->alert > 0.01f ? 0.5f * h->alert : 0.0f) : 0.0f;

    r->view.previous_view = h->continuous ? last_view : r->view.view;
    r->view.previous_projection = h->continuous ? last_projection : r->view.projection;
    h->view = r->view;
    memcpy(h->origin, origin, sizeof origin);
    h->revisions = *now;
    h->camera = camera;
    h->settings = settings;
    h->content = content;
    return keep_lights(r->context, h, in);
}

void es_history_end(es_history* h) { h->complete = h->wanted; }

void es_history_free(es_context* context, es_history* h)
{
    es_gbuffer_destroy(context, &h->gbuffer);
    es_gbuffer_destroy(context, &h->half);
    for (int i = 0; i < 2; i++) {
        es_planes_free(context, &h->irradiance[i]);
        es_planes_free(context, &h->specular[i]);
        es_planes_free(context, &h->picture[i]);
    }
    es_planes_free(context, &h->fresh);
    h->has_picture = false;
    es_release(context, h->lights, h->light_capacity * sizeof *h->lights);
    h->lights = NULL;
    h->light_count = h->light_capacity = 0;
    h->planes = 0;
    h->complete = false;
    h->job.gbuffer = NULL;
}

es_result es_history_keep(es_context* context, es_gbuffer* drawn, es_gbuffer* last)
{
    if (last->width != drawn->width || last->height != drawn->height || last->planes != drawn->planes || !last->memory) {
        es_gbuffer_destroy(context, last);
        es_result result = es_gbuffer_create(context, drawn->width, drawn->height, drawn->planes, last);
        if (result) return result;
    }
    es_gbuffer other = *last;
    *last = *drawn;
    *drawn = other;
    return ES_OK;
}

/* ---- the pass --------------------------------------------------------------------------------------------------------------- */

static es_result blend(es_renderer* r, const es_frame_inputs* in)
{
    const es_gbuffer* shaded = es_indirect_gbuffer(r);
    const es_planes *irradiance, *specular;
    es_indirect_unblended(r, &irradiance, &specular);
    es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    const uint32_t from = h->current, to = 1 - from;
    es_result result = es_planes_resize(r->context, &h->irradiance[to], shaded);
    if (!result && r->has_specular) result = es_planes_resize(r->context, &h->specular[to], shaded);
    if (result) return result;
    const bool redrawn = !r->plan.stats[ES_PASS_VISIBILITY].skipped, half = es_indirect_is_halved(s);
    es_temporal_job job = {.gbuffer = shaded, .previous = redrawn ? half ? &h->half : &h->gbuffer : shaded, .moving = h->moving, .plane_count = r->has_specular ? 6 : 3,
        .base = s->temporal_base, .position = s->temporal_position, .normal = s->temporal_normal, .illumination = s->temporal_illumination, .extent = in->extent, .exposure_scale = es_exp2(s->exposure),
        .depth_threshold = s->temporal_depth_threshold, .normal_threshold = s->temporal_normal_threshold, .clamp = s->temporal_clamp};
    const float width = es_maxf(s->lobe_roughness, 0.1f) * es_maxf(s->lobe_roughness, 0.1f);
    job.lobe_turn = 2.0f / (width * width);
    job.reset_low = s->temporal_reset_low * (1.0f - 0.95f * h->alert);
    job.reset_high = s->temporal_reset_high * (1.0f - 0.9f * h->alert);
    job.history_count = h->settled ? 0 : h->planes < job.plane_count ? h->planes : job.plane_count;
    const es_raster_view now = r->view;
    es_raster_view then = now;
    then.view = now.previous_view;
    es_temporal_depth_then(&now, &then, half ? 2 : 1, job.depth_then);
    for (int k = 0; k < 3; k++) {
        job.source[k] = irradiance->at[k];
        job.history[k] = h->irradiance[from].at[k];
        job.result[k] = h->irradiance[to].at[k];
        job.source[k + 3] = specular->at[k];
        job.history[k + 3] = h->specular[from].at[k];
        job.result[k + 3] = h->specular[to].at[k];
    }
    if (job.plane_count == 6) {
        job.source_lit = specular->lit;
        job.history_lit = h->specular[from].lit;
        job.result_lit = h->specular[to].lit;
    }
    es_arena_reset(&r->arena);
    result = es_temporal_compare(r->context, &r->arena, &job);
    if (result) return result;
    es_temporal_blend(r->context, &job);
    h->current = to;
    h->planes = job.plane_count;
    h->job = job;
    h->job.reset = NULL;
    return ES_OK;
}

es_result es_pass_temporal(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* nothing = es_indirect_nothing(r, in);
    const char* why = nothing ? nothing : !s->temporal ? "temporal is off" : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_TEMPORAL, why);
        r->history.planes = 0;
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_TEMPORAL);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_indirect_reads(plan);
    if (s->temporal_stage == ES_TEMPORAL_AFTER_FILTER) es_plan_reads_pass(plan, ES_PASS_FILTER);
    /* until it is settled, each frame's result is another */
    const uint64_t frame = r->history.settled ? 0 : r->frames + 1;
    es_plan_reads(plan, &frame, sizeof frame);
    if (!es_plan_run(plan, ES_PASS_TEMPORAL)) return ES_OK;
    es_result result = blend(r, in);
    const es_gbuffer* shaded = es_indirect_gbuffer(r);
    if (!result) es_plan_done(plan, ES_PASS_TEMPORAL, (uint64_t)shaded->width * shaded->height);
    return result;
}

es_result es_temporal_confidence(es_renderer* r, float* confidence)
{
    es_temporal_job job = r->history.job;
    if (!job.gbuffer) {
        memset(confidence, 0, (size_t)r->gbuffer.stride * r->gbuffer.height * sizeof *confidence);
        return ES_OK;
    }
    memset(job.result, 0, sizeof job.result);
    job.confidence = confidence;
    es_arena_reset(&r->arena);
    es_result result = es_temporal_compare(r->context, &r->arena, &job);
    if (!result) es_temporal_blend(r->context, &job);
    return result;
}
