#include "gi/reflections/found_light.h"

#include "gi/direct.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/micro_passes.h"
#include "gi/second_order_pass.h"

void es_found_light_free(es_context* context, es_found_light* light)
{
    es_layer_light* const layers[] = {&light->lamps, &light->indirect};
    for (int i = 0; i < 2; i++) {
        es_planes* const planes[] = {&layers[i]->irradiance, &layers[i]->specular, &layers[i]->filtered_irradiance, &layers[i]->filtered_specular, &layers[i]->sparse_irradiance, &layers[i]->sparse_specular};
        for (size_t k = 0; k < sizeof planes / sizeof planes[0]; k++) es_planes_free(context, planes[k]);
    }
    es_planes_free(context, &light->direct);
    *light = (es_found_light){0};
}

static void add_light(const es_layer_light* light, const float* irradiance[3], const float* specular[3], const uint8_t** lit)
{
    const es_planes *diffuse = light->filtered ? &light->filtered_irradiance : &light->irradiance, *lobes = light->filtered_lobes ? &light->filtered_specular : &light->specular;
    for (int k = 0; k < 3; k++) {
        irradiance[k] = diffuse->at[k];
        specular[k] = light->lobes ? lobes->at[k] : NULL;
    }
    *lit = light->lobes ? lobes->lit : NULL;
}

static es_result light_indirectly(es_renderer* r, const es_frame_inputs* in, const es_found_surfaces* of, es_layer_light* light, es_compose_job* job)
{
    const uint32_t method = r->frame.settings.method;
    const es_lit_surfaces surfaces = {of->gbuffer, of->rays, es_frame_has_lobes(r, in->list)};
    light->lobes = surfaces.lobes && method != ES_GI_SECOND_ORDER;
    es_result result = method == ES_GI_MICRO ? es_micro_light_layer(r, &surfaces, light)
                       : method == ES_GI_SECOND_ORDER ? es_second_order_light_layer(r, &surfaces, light) : es_indirect_shade_layer(r, &surfaces, r->vpl_count, light);
    if (!result) result = es_indirect_filter_layer(r, &surfaces, light);
    if (!result) add_light(light, job->irradiance, job->specular, &job->lit);
    return result;
}

static es_result light_by_lamps(es_renderer* r, const es_frame_inputs* in, const es_found_surfaces* of, es_layer_light* light, es_compose_job* job)
{
    const es_lit_surfaces surfaces = {of->gbuffer, of->rays, es_lamps_anything_specular(in->list)};
    es_result result = es_lamps_light_layer(r, &surfaces, light);
    if (!result) add_light(light, job->lamp_irradiance, job->lamp_specular, &job->lamp_lit);
    return result;
}

static void light_directly(es_renderer* r, const es_found_surfaces* of, const es_planes* direct)
{
    const es_renderer_settings* s = &r->settings;
    for (uint32_t i = 0; i < r->light_count; i++) {
        const es_direct_job job = {.gbuffer = of->gbuffer, .rays = of->rays, .view = &r->light_views[i], .shadow_filter = s->shadow_filter, .shadow_bias = s->shadow_bias,
            .shadow_slope_bias = s->shadow_slope_bias, .first = i == 0, .out = {direct->at[0], direct->at[1], direct->at[2]}};
        es_direct_light(r->context, &job);
    }
}

es_result es_light_found(es_renderer* r, const es_frame_inputs* in, const es_found_surfaces* of, es_found_light* light)
{
    es_compose_job job = {.gbuffer = of->gbuffer, .mirrors = of->mirrors};
    const size_t pixels = (size_t)of->gbuffer->stride * of->gbuffer->height;
    /* planes of lobes know which parts of them are dark (gi/lit.h), of one size */
    if (light->pixels != pixels) es_found_light_free(r->context, light);
    light->pixels = pixels;
    es_result result = r->light_count ? es_planes_resize(r->context, &light->direct, of->gbuffer) : ES_OK;
    if (!result && es_indirect_is_there(r)) result = light_indirectly(r, in, of, &light->indirect, &job);
    if (!result && es_lamps_are_there(r) && r->lamps.set.shaded_count) result = light_by_lamps(r, in, of, &light->lamps, &job);
    if (result) return result;
    if (r->light_count) light_directly(r, of, &light->direct);
    for (int k = 0; k < 3; k++) {
        job.background[k] = of->background[k];
        if (r->light_count) job.direct[k] = light->direct.at[k];
        job.radiance[k] = of->radiance[k];
    }
    es_compose(r->context, &job);
    return ES_OK;
}
