#include "gi/screen/passes.h"

#include "gi/direct.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/screen/directional_occlusion.h"
#include "gi/screen/residual_pass.h"
#include "gi/screen/screen_bounce.h"

void es_screen_free_drawn(es_context* context, es_screen_buffers* b)
{
    for (uint32_t i = 0; i + 1 < ES_SCREEN_MAX_LAYERS; i++) {
        if (b->drawn[i]) es_release(context, b->drawn[i], b->drawn_floats * sizeof(float));
        b->drawn[i] = NULL;
    }
    b->drawn_floats = 0;
}

static void free_layer(es_context* context, es_screen_layer* layer)
{
    es_gbuffer_destroy(context, &layer->gbuffer);
    es_planes_free(context, &layer->direct);
    es_release(context, layer->light, layer->light_words * sizeof *layer->light);
    *layer = (es_screen_layer){0};
}

void es_screen_buffers_free(es_context* context, es_screen_buffers* b)
{
    for (uint32_t v = 0; v < ES_SCREEN_MAX_VIEWS; v++)
        for (uint32_t i = 0; i < ES_SCREEN_MAX_LAYERS; i++) free_layer(context, &b->layers[v][i]);
    es_screen_free_drawn(context, b);
    es_planes* const planes[] = {&b->share, &b->filtered_share, &b->arriving, &b->reflected, &b->irradiance, &b->bounce};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) es_planes_free(context, planes[i]);
    *b = (es_screen_buffers){0};
}

static es_result reserve_light(es_context* context, es_screen_layer* layer, const es_gbuffer* gbuffer)
{
    const size_t words = (size_t)gbuffer->stride * gbuffer->height;
    if (layer->light_words == words) return ES_OK;
    es_release(context, layer->light, layer->light_words * sizeof *layer->light);
    layer->light_words = 0;
    layer->light = es_allocate_array(context, words, sizeof *layer->light);
    if (!layer->light) return es_context_last_result(context);
    layer->light_words = words;
    return ES_OK;
}

/* Smooths over the patterns of the sample sets: once brings all of them together, twice hides the blocks that edges of what is looked at leave then. */
static es_result filter_patterns(es_renderer* r, uint32_t passes, uint32_t planes, const es_planes* source, const es_planes* result)
{
    const es_renderer_settings* s = &r->settings;
    es_filter_job job = {.gbuffer = &r->gbuffer, .size = s->screen_sets, .passes = passes, .depth_threshold = s->filter_depth, .normal_threshold = s->filter_normal, .plane_count = planes};
    for (uint32_t k = 0; k < planes; k++) {
        job.source[k] = source->at[k];
        job.result[k] = result->at[k];
    }
    return es_filter_geometry_aware(r->context, &r->arena, &job);
}

/* ---- light of the environment ---------------------------------------------------------------------------------------------------- */

static es_result occlude(es_renderer* r, const es_frame_inputs* in)
{
    const es_renderer_settings* s = &r->settings;
    es_screen_buffers* b = &r->screen;
    b->directional = s->lamps == ES_LAMPS_SCREEN;
    b->has_specular = es_surfaces_have_lobes(in->solid) || (r->plan.valid[ES_PASS_LAMP_LIGHT] && r->lamps.has_specular);
    es_planes* const planes[] = {&b->share, &b->filtered_share, &b->arriving, &b->reflected};
    es_result result = ES_OK;
    for (int i = 0; i < (b->has_specular ? 4 : 3) && !result; i++) result = es_planes_resize(r->context, planes[i], &r->gbuffer);
    if (result) return result;
    es_arena_reset(&r->arena);
    es_occlusion_job job = {.stack = &b->stack, .sets = s->screen_sets, .samples = s->screen_samples, .radius = s->screen_radius * in->extent, .directional = b->directional};
    for (int k = 0; k < 3; k++) job.share[k] = s->screen_sets > 1 ? b->share.at[k] : b->filtered_share.at[k];
    result = es_occlusion_prepare(&r->arena, b->directional ? &r->environment.lookup : NULL, &job);
    if (result) return result;
    es_occlusion(r->context, &job);
    if (s->screen_sets > 1) result = filter_patterns(r, 1, b->directional ? 3 : 1, &b->share, &b->filtered_share);
    if (result) return result;
    es_compose_job lamps = {0};
    es_lamps_compose(r, &lamps);
    es_arriving_job arriving = {.gbuffer = &r->gbuffer, .rays = r->rays, .environment = &r->environment.lookup, .lobes = &es_lobe_albedos, .lit = b->has_specular ? b->reflected.lit : NULL};
    for (int k = 0; k < 3; k++) {
        arriving.share[k] = b->filtered_share.at[b->directional ? k : 0];
        arriving.irradiance[k] = lamps.lamp_irradiance[k];
        arriving.specular[k] = lamps.lamp_specular[k];
        arriving.arriving[k] = b->arriving.at[k];
        arriving.reflected[k] = b->has_specular ? b->reflected.at[k] : NULL;
    }
    es_arriving_light(r->context, &arriving);
    return ES_OK;
}

es_result es_pass_screen_occlusion(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = s->lamps != ES_LAMPS_SCREEN && s->lamps != ES_LAMPS_AMBIENT ? "lamps is neither screen nor ambient" : !plan->valid[ES_PASS_ENVIRONMENT] ? plan->stats[ES_PASS_ENVIRONMENT].skipped : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SCREEN_OCCLUSION, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_SCREEN_OCCLUSION);
    const es_pass read[] = {ES_PASS_VISIBILITY, ES_PASS_SCREEN_VIEWS, ES_PASS_ENVIRONMENT, ES_PASS_LAMP_LIGHT, ES_PASS_LAMP_FILTER};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    const float numbers[] = {(float)s->screen_samples, (float)s->screen_sets, s->screen_radius * in->extent, (float)s->lamps, s->filter_depth, s->filter_normal};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_SCREEN_OCCLUSION)) return ES_OK;
    es_result result = occlude(r, in);
    if (!result) es_plan_done(plan, ES_PASS_SCREEN_OCCLUSION, (uint64_t)r->gbuffer.width * r->gbuffer.height * s->screen_samples);
    return result;
}

void es_screen_compose(const es_renderer* r, es_compose_job* job)
{
    if (!r->plan.valid[ES_PASS_SCREEN_OCCLUSION]) return;
    const es_screen_buffers* b = &r->screen;
    for (int k = 0; k < 3; k++) {
        job->lamp_irradiance[k] = b->arriving.at[k];
        job->lamp_specular[k] = b->has_specular ? b->reflected.at[k] : NULL;
    }
    job->lamp_lit = b->has_specular ? b->reflected.lit : NULL;
}

void es_screen_reads(es_plan* plan)
{
    es_plan_reads_pass(plan, ES_PASS_SCREEN_OCCLUSION);
    es_plan_reads_pass(plan, ES_PASS_SCREEN_BOUNCE);
}

void es_screen_occlusion_image(const es_renderer* r, float* pixels)
{
    const es_gbuffer* g = &r->gbuffer;
    const es_screen_buffers* b = &r->screen;
    const bool there = r->plan.valid[ES_PASS_SCREEN_OCCLUSION];
    for (uint32_t y = 0; y < g->height; y++)
        for (uint32_t x = 0; x < g->width; x++) {
            const size_t at = (size_t)y * g->stride + x;
            float share = 1.0f;
            if (there && g->depth[at] > 0.0f) share = b->directional ? (b->filtered_share.at[0][at] + b->filtered_share.at[1][at] + b->filtered_share.at[2][at]) * (1.0f / 3.0f) : b->filtered_share.at[0][at];
            pixels[(size_t)y * g->width + x] = 1.0f - share;
        }
}

/* ---- a bounce ------------------------------------------------------------------------------------------------------------------------ */

/* What a layer that is not the renderer's picture sends: direct light of the same lights with the same maps. */
static es_result light_layer(es_renderer* r, es_screen_layer* layer, es_screen_view* view, uint32_t which)
{
    es_result result = reserve_light(r->context, layer, &layer->gbuffer);
    if (!result) result = es_planes_resize(r->context, &layer->direct, &layer->gbuffer);
    if (result) return result;
    es_screen_light_job job = {.gbuffer = &layer->gbuffer, .light = layer->light};
    for (uint32_t i = 0; i < r->light_count && r->plan.valid[ES_PASS_DIRECT]; i++) {
        es_direct_job direct = {.gbuffer = &layer->gbuffer, .rays = view->rays, .view = &r->light_views[i], .shadow_filter = r->settings.shadow_filter, .shadow_bias = r->settings.shadow_bias,
            .shadow_slope_bias = r->settings.shadow_slope_bias, .first = i == 0};
        for (int k = 0; k < 3; k++) job.direct[k] = direct.out[k] = layer->direct.at[k];
        es_direct_light(r->context, &direct);
    }
    es_screen_light(r->context, &job);
    view->light[which] = layer->light;
    return ES_OK;
}

es_result es_screen_light_layers(es_renderer* r)
{
    es_screen_buffers* b = &r->screen;
    es_result result = ES_OK;
    for (uint32_t i = 1; i < b->stack.views[0].layer_count && !result; i++) result = light_layer(r, &b->layers[0][i], &b->stack.views[0], i);
    return result;
}

static es_result light_views(es_renderer* r)
{
    es_screen_buffers* b = &r->screen;
    es_screen_layer* layer = &b->layers[0][0];
    es_result result = reserve_light(r->context, layer, &r->gbuffer);
    if (result) return result;
    es_compose_job lit = {0};
    es_lamps_compose(r, &lit);
    es_screen_compose(r, &lit);
    es_screen_light_job job = {.gbuffer = &r->gbuffer, .light = layer->light};
    for (int k = 0; k < 3; k++) {
        if (r->plan.valid[ES_PASS_DIRECT]) job.direct[k] = r->direct.at[k];
        job.lamp_irradiance[k] = lit.lamp_irradiance[k];
    }
    es_screen_light(r->context, &job);
    b->stack.views[0].light[0] = layer->light;
    for (uint32_t v = 0; v < b->stack.view_count; v++)
        for (uint32_t i = v ? 0 : 1; i < b->stack.views[v].layer_count && !result; i++) result = light_layer(r, &b->layers[v][i], &b->stack.views[v], i);
    return result;
}

static es_result bounce(es_renderer* r, const es_frame_inputs* in)
{
    const es_renderer_settings* s = &r->settings;
    es_screen_buffers* b = &r->screen;
    es_arena_reset(&r->arena);
    es_result result = light_views(r);
    if (!result) result = es_planes_resize(r->context, &b->irradiance, &r->gbuffer);
    if (!result) result = es_planes_resize(r->context, &b->bounce, &r->gbuffer);
    if (result) return result;
    es_screen_bounce_job job = {.stack = &b->stack, .sets = s->screen_sets, .samples = (s->screen_samples + 1) / 2, .radius = s->screen_radius * in->extent,
        .geometry_bound = s->method == ES_GI_NONE ? 0.0f : es_geometry_bound(s, in)};
    for (int k = 0; k < 3; k++) job.irradiance[k] = b->irradiance.at[k];
    result = es_screen_bounce_prepare(&r->arena, &job);
    if (result) return result;
    es_screen_bounce(r->context, &job);
    const bool filtered = s->screen_sets > 1;
    if (filtered) result = filter_patterns(r, 2, 3, &b->irradiance, &b->bounce);
    if (result) return result;
    es_screen_reflect_job reflect = {.gbuffer = &r->gbuffer};
    for (int k = 0; k < 3; k++) {
        reflect.irradiance[k] = filtered ? b->bounce.at[k] : b->irradiance.at[k];
        reflect.radiance[k] = b->bounce.at[k];
    }
    es_screen_reflect(r->context, &reflect);
    return ES_OK;
}

es_result es_pass_screen_bounce(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const bool lit = plan->valid[ES_PASS_DIRECT] || plan->valid[ES_PASS_LAMP_LIGHT] || plan->valid[ES_PASS_SCREEN_OCCLUSION];
    const char* why = !s->screen_bounce ? "screen.bounce is off" : s->method == ES_GI_MICRO ? "gi is micro: it bounds nothing" : s->method != ES_GI_NONE && (s->traced_bias != ES_TRACED_BOUNDED || s->near_distance > 0.0f) ? "what is near is found by rays" : !es_residual_nothing(s) ? "compensation.steps finds it" : !in->has_geometry ? "nothing to light" : !lit ? plan->stats[ES_PASS_DIRECT].skipped : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SCREEN_BOUNCE, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_SCREEN_BOUNCE);
    const es_pass read[] = {ES_PASS_VISIBILITY, ES_PASS_SCREEN_VIEWS, ES_PASS_DIRECT, ES_PASS_SHADOW_MAPS, ES_PASS_LAMP_LIGHT, ES_PASS_LAMP_FILTER, ES_PASS_SCREEN_OCCLUSION};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    const float numbers[] = {(float)s->screen_samples, (float)s->screen_sets, s->screen_radius * in->extent, (float)s->method, es_geometry_bound(s, in), s->filter_depth, s->filter_normal};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_SCREEN_BOUNCE)) return ES_OK;
    es_result result = bounce(r, in);
    if (!result) es_plan_done(plan, ES_PASS_SCREEN_BOUNCE, (uint64_t)r->gbuffer.width * r->gbuffer.height * (s->screen_samples + 1) / 2);
    return result;
}
