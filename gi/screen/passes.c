#include "gi/screen/passes.h"

#include "gi/lamp_passes.h"
#include "gi/screen/screen_bounce.h"

void es_screen_buffers_free(es_context* context, es_screen_buffers* b)
{
    for (uint32_t v = 0; v < ES_SCREEN_MAX_VIEWS; v++)
        for (uint32_t i = 0; i < ES_SCREEN_MAX_LAYERS; i++) {
            es_screen_layer* layer = &b->layers[v][i];
            es_gbuffer_destroy(context, &layer->gbuffer);
            es_planes_free(context, &layer->direct);
            es_release(context, layer->light, layer->light_words * sizeof *layer->light);
        }
    es_planes_free(context, &b->irradiance);
    es_planes_free(context, &b->bounce);
    *b = (es_screen_buffers){0};
}

es_result es_pass_screen_views(es_renderer* r, const es_frame_inputs* in)
{
    r->screen.stack = (es_view_stack){.views = {es_screen_view_of(&r->view, &r->gbuffer)}, .view_count = 1};
    return ES_OK;
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

/* Smooths over the patterns of the sample sets. */
static es_result filter_patterns(es_renderer* r, uint32_t planes, const es_planes* source, const es_planes* result)
{
    const es_renderer_settings* s = &r->settings;
    es_filter_job job = {.gbuffer = &r->gbuffer, .size = s->screen_sets, .passes = 1, .depth_threshold = s->filter_depth, .normal_threshold = s->filter_normal, .plane_count = planes};
    for (uint32_t k = 0; k < planes; k++) {
        job.source[k] = source->at[k];
        job.result[k] = result->at[k];
    }
    return es_filter_geometry_aware(r->context, &r->arena, &job);
}

static es_result light_views(es_renderer* r)
{
    es_screen_buffers* b = &r->screen;
    es_screen_layer* layer = &b->layers[0][0];
    es_result result = reserve_light(r->context, layer, &r->gbuffer);
    if (result) return result;
    es_compose_job lit = {0};
    es_lamps_compose(r, &lit);
    es_screen_light_job job = {.gbuffer = &r->gbuffer, .light = layer->light};
    for (int k = 0; k < 3; k++) {
        if (r->plan.valid[ES_PASS_DIRECT]) job.direct[k] = r->direct.at[k];
        job.lamp_irradiance[k] = lit.lamp_irradiance[k];
    }
    es_screen_light(r->context, &job);
    b->stack.views[0].light[0] = layer->light;
    return ES_OK;
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
    es_screen_bounce_job job = {.stack = &b->stack, .sets = s->screen_sets, .samples = s->screen_samples, .radius = s->screen_radius * in->extent,
        .geometry_bound = s->method == ES_GI_NONE ? 0.0f : es_geometry_bound(s, in)};
    for (int k = 0; k < 3; k++) job.irradiance[k] = b->irradiance.at[k];
    result = es_screen_bounce_prepare(&r->arena, &job);
    if (result) return result;
    es_screen_bounce(r->context, &job);
    const bool filtered = s->screen_sets > 1;
    if (filtered) result = filter_patterns(r, 3, &b->irradiance, &b->bounce);
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
    const bool lit = plan->valid[ES_PASS_DIRECT] || plan->valid[ES_PASS_LAMP_LIGHT];
    const char* why = !s->screen_bounce ? "screen.bounce is off" : s->method == ES_GI_MICRO ? "gi is micro: it bounds nothing" : !in->has_geometry ? "nothing to light" : !lit ? plan->stats[ES_PASS_DIRECT].skipped : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SCREEN_BOUNCE, why);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_SCREEN_BOUNCE);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_DIRECT);
    es_plan_reads_pass(plan, ES_PASS_LAMP_LIGHT);
    es_plan_reads_pass(plan, ES_PASS_LAMP_FILTER);
    const float numbers[] = {(float)s->screen_samples, (float)s->screen_sets, s->screen_radius * in->extent, (float)s->method, es_geometry_bound(s, in), s->filter_depth, s->filter_normal};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_SCREEN_BOUNCE)) return ES_OK;
    es_result result = bounce(r, in);
    if (!result) es_plan_done(plan, ES_PASS_SCREEN_BOUNCE, (uint64_t)r->gbuffer.width * r->gbuffer.height * s->screen_samples);
    return result;
}
