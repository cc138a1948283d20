#include "gi/screen/residual_pass.h"

#include <string.h>

#include "gi/indirect.h"
#include "gi/lit.h"
#include "gi/micro/pixels.h"
#include "gi/micro/upsample.h"
#include "gi/screen/passes.h"

const char* es_residual_nothing(const es_renderer_settings* s)
{
    if (!s->compensation_steps) return "compensation.steps is 0";
    if (s->method == ES_GI_NONE) return "gi is none";
    if (s->method == ES_GI_MICRO) return "gi is micro: nothing is bounded";
    if (s->traced_bias != ES_TRACED_BOUNDED) return "traced.bias is not bounded";
    if (s->near_distance > 0.0f) return "vpl.near finds it by rays";
    return NULL;
}

uint32_t es_residual_steps(const es_renderer* r) { return r->plan.valid[ES_PASS_RESIDUAL] ? r->frame.settings.compensation_steps : 0; }

void es_residual_buffers_free(es_context* context, es_residual_buffers* b)
{
    for (uint32_t i = 0; i < ES_RESIDUAL_LAYERS; i++) es_residual_free(context, &b->pyramids[i]);
    es_planes* const planes[] = {&b->sent, &b->sparse_irradiance, &b->sparse_specular, &b->irradiance, &b->specular};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) es_planes_free(context, planes[i]);
    for (uint32_t i = 0; i < ES_RESIDUAL_STEPS; i++) es_planes_free(context, &b->steps[i]);
}

/* Bounded light of the first bounce, reflected once more, is of the second. */
static bool sends_indirect(const es_renderer_settings* s) { return s->bounces > 1 && s->method != ES_GI_SECOND_ORDER; }

/* Direct and bounded indirect light, as it leaves surfaces towards the eye. */
static es_result compose_sent(es_renderer* r, es_planes* sent)
{
    es_result result = es_planes_resize(r->context, sent, &r->gbuffer);
    if (result) return result;
    es_compose_job job = es_renderer_compose_job(r);
    job.mirrors = NULL; /* what they see is found later, and sent to nobody */
    memset(job.finished, 0, sizeof job.finished);
    memset(job.further, 0, sizeof job.further);
    if (!sends_indirect(&r->settings)) {
        memset(job.irradiance, 0, sizeof job.irradiance);
        memset(job.specular, 0, sizeof job.specular);
    }
    for (int k = 0; k < 3; k++) job.reflected[k] = sent->at[k];
    es_compose(r->context, &job);
    return ES_OK;
}

static es_result reserve(es_renderer* r, es_gbuffer* sparse)
{
    const es_renderer_settings* s = &r->settings;
    es_residual_buffers* b = &r->residual;
    *sparse = (es_gbuffer){.width = es_micro_sparse(r->gbuffer.width, s->compensation_spacing), .height = es_micro_sparse(r->gbuffer.height, s->compensation_spacing)};
    sparse->stride = (sparse->width + 7) / 8 * 8;
    const bool whole = s->compensation_spacing == 1;
    es_result result = es_residual_reserve(r->context, &b->pyramids[0], r->gbuffer.width, r->gbuffer.height, s->compensation_levels);
    if (!result) result = es_planes_resize(r->context, &b->irradiance, &r->gbuffer);
    if (!result && r->has_specular) result = es_planes_resize(r->context, &b->specular, &r->gbuffer);
    if (!result && !whole) result = es_planes_resize(r->context, &b->sparse_irradiance, sparse);
    if (!result && !whole && r->has_specular) result = es_planes_resize(r->context, &b->sparse_specular, sparse);
    return result;
}

static void aim(es_residual_job* job, const es_planes* irradiance, const es_planes* specular, bool lobes)
{
    for (int k = 0; k < 3; k++) {
        job->irradiance[k] = irradiance->at[k];
        job->specular[k] = lobes ? specular->at[k] : NULL;
    }
}

static void upsample(es_renderer* r, const es_gbuffer* sparse, uint32_t kind, const es_planes* from, es_planes* to, uint8_t* listed)
{
    es_micro_upsample_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .kind = kind, .spacing = r->settings.compensation_spacing, .sparse_width = sparse->width, .sparse_height = sparse->height,
        .sparse_stride = sparse->stride, .lit = kind == ES_GATHER_LOBE ? to->lit : NULL, .listed = listed};
    for (int k = 0; k < 3; k++) {
        job.source[k] = from->at[k];
        job.result[k] = to->at[k];
    }
    es_micro_upsample(r->context, &job);
}

/* What the camera does not see of what is near what it sees sends the direct light that it has. */
static es_result add_layers(es_renderer* r, es_residual_job* job)
{
    const es_screen_view* view = &r->screen.stack.views[0];
    if (!r->plan.valid[ES_PASS_DIRECT]) return ES_OK;
    es_result result = view->layer_count > 1 ? es_screen_light_layers(r) : ES_OK;
    for (uint32_t i = 1; i < view->layer_count && i < ES_RESIDUAL_LAYERS && !result; i++) {
        const es_screen_layer* from = &r->screen.layers[0][i];
        es_residual_pyramid* pyramid = &r->residual.pyramids[i];
        result = es_residual_reserve(r->context, pyramid, r->gbuffer.width, r->gbuffer.height, r->settings.compensation_levels);
        job->layers[job->layer_count++] = (es_residual_layer){.gbuffer = &from->gbuffer, .rays = r->rays, .radiance = {from->direct.at[0], from->direct.at[1], from->direct.at[2]}, .back = i % 2 == 1, .pyramid = pyramid};
    }
    return result;
}

/* One application of the residual operator: into the buffers' irradiance and specular. `layers`: what is peeled sends too. */
static es_result apply(es_renderer* r, const es_frame_inputs* in, const es_planes* sent, bool layers, uint64_t* samples)
{
    const es_renderer_settings* s = &r->settings;
    es_residual_buffers* b = &r->residual;
    es_gbuffer sparse;
    es_result result = reserve(r, &sparse);
    if (result) return result;
    es_arena_reset(&r->arena);
    es_residual_job job = {.layer_count = 1, .bound = es_geometry_bound(s, in), .solid_angle = s->compensation_solid_angle, .discontinuity = s->compensation_discontinuity, .gbuffer = &r->gbuffer, .rays = r->rays,
        .lobe_roughness = s->lobe_roughness, .spacing = s->compensation_spacing, .stride = sparse.stride};
    job.layers[0] = (es_residual_layer){.gbuffer = &r->gbuffer, .rays = r->rays, .radiance = {sent->at[0], sent->at[1], sent->at[2]}, .pyramid = &b->pyramids[0]};
    if (layers) result = add_layers(r, &job);
    if (result) return result;
    const size_t list_bytes = (size_t)es_micro_list_stride(r->gbuffer.width) * r->gbuffer.height;
    job.samples = es_arena_allocate(&r->arena, r->gbuffer.height * sizeof *job.samples);
    uint8_t* listed = es_arena_allocate(&r->arena, 2 * list_bytes);
    if (!job.samples || !listed) return es_context_last_result(r->context);
    memset(job.samples, 0, r->gbuffer.height * sizeof *job.samples);
    for (uint32_t i = 0; i < job.layer_count; i++) es_residual_build(r->context, &job.layers[i]);
    if (s->compensation_spacing == 1) {
        job.stride = r->gbuffer.stride;
        aim(&job, &b->irradiance, &b->specular, r->has_specular);
        es_residual_gather(r->context, &job);
        if (r->has_specular) memset(b->specular.lit, 1, (size_t)es_lit_chunks(r->gbuffer.stride) * r->gbuffer.height);
    } else {
        aim(&job, &b->sparse_irradiance, &b->sparse_specular, r->has_specular);
        es_residual_gather(r->context, &job);
        /* full resolution where interpolation finds nothing to go by (§5) */
        upsample(r, &sparse, ES_GATHER_DIFFUSE, &b->sparse_irradiance, &b->irradiance, listed);
        if (r->has_specular) {
            upsample(r, &sparse, ES_GATHER_LOBE, &b->sparse_specular, &b->specular, listed + list_bytes);
            for (size_t i = 0; i < list_bytes; i++) listed[i] |= listed[list_bytes + i];
            memset(b->specular.lit, 1, (size_t)es_lit_chunks(r->gbuffer.stride) * r->gbuffer.height);
        }
        job.spacing = 1;
        job.stride = r->gbuffer.stride;
        job.listed = listed;
        aim(&job, &b->irradiance, &b->specular, r->has_specular);
        es_residual_gather(r->context, &job);
    }
    for (uint32_t y = 0; y < r->gbuffer.height; y++) *samples += job.samples[y];
    return ES_OK;
}

/* What surfaces make of the gathered light. */
static es_result reflect(es_renderer* r, es_planes* step)
{
    const es_residual_buffers* b = &r->residual;
    es_result result = es_planes_resize(r->context, step, &r->gbuffer);
    if (result) return result;
    es_compose_job job = {.gbuffer = &r->gbuffer};
    for (int k = 0; k < 3; k++) {
        job.irradiance[k] = b->irradiance.at[k];
        job.specular[k] = r->has_specular ? b->specular.at[k] : NULL;
        job.bounded[k] = step->at[k];
    }
    es_compose(r->context, &job);
    return ES_OK;
}

es_result es_pass_residual(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* setting = es_residual_nothing(s);
    const char* why = setting ? setting : es_indirect_nothing(r, in);
    if (why) {
        es_plan_not_needed(plan, ES_PASS_RESIDUAL, why);
        es_residual_buffers_free(r->context, &r->residual);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_RESIDUAL);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    const es_pass direct[] = {ES_PASS_DIRECT, ES_PASS_LAMP_LIGHT, ES_PASS_LAMP_FILTER, ES_PASS_SCREEN_OCCLUSION, ES_PASS_SCREEN_VIEWS, ES_PASS_SHADOW_MAPS};
    for (size_t i = 0; i < sizeof direct / sizeof direct[0]; i++) es_plan_reads_pass(plan, direct[i]);
    if (sends_indirect(s)) es_indirect_reads(plan);
    const es_pass indirect[] = {ES_PASS_FILTER, ES_PASS_TEMPORAL, ES_PASS_UPSAMPLE};
    for (size_t i = 0; i < sizeof indirect / sizeof indirect[0] && sends_indirect(s); i++) es_plan_reads_pass(plan, indirect[i]);
    float numbers[] = {es_geometry_bound(s, in), s->lobe_roughness, s->compensation_solid_angle, s->compensation_discontinuity, r->has_specular};
    es_plan_reads(plan, numbers, sizeof numbers);
    uint32_t words[] = {s->compensation_steps, sends_indirect(s), s->compensation_levels, s->compensation_spacing};
    es_plan_reads(plan, words, sizeof words);
    if (!es_plan_run(plan, ES_PASS_RESIDUAL)) return ES_OK;
    uint64_t samples = 0;
    es_result result = compose_sent(r, &r->residual.sent);
    for (uint32_t i = 0; i < s->compensation_steps && !result; i++) {
        result = apply(r, in, i ? &r->residual.steps[i - 1] : &r->residual.sent, i == 0, &samples);
        if (!result) result = reflect(r, &r->residual.steps[i]);
    }
    if (!result) es_plan_done(plan, ES_PASS_RESIDUAL, samples);
    return result;
}
