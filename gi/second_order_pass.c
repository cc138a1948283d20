#include "gi/second_order_pass.h"

#include <string.h>

#include "gi/half_resolution.h"
#include "gi/indirect.h"

void es_second_order_free(es_context* context, es_second_order_buffers* b)
{
    es_gbuffer_destroy(context, &b->half);
    es_planes* const planes[] = {&b->half_positive, &b->half_negative, &b->taken, &b->negative};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) es_planes_free(context, planes[i]);
    es_release(context, b->lights, b->light_capacity * sizeof *b->lights);
    b->lights = NULL;
    b->light_capacity = 0;
}

/* At one pixel of 2 × 2. */
static es_result shade_half(es_renderer* r, const es_open_job* lights, es_planes* planes)
{
    es_second_order_buffers* b = &r->second_order;
    es_result result = es_planes_resize(r->context, planes, &b->half);
    if (result) return result;
    es_open_job job = *lights;
    job.gbuffer = &b->half;
    job.rays = es_pixel_rays_halve(&r->rays);
    for (int k = 0; k < 3; k++) job.irradiance[k] = planes->at[k];
    es_open_shade(r->context, &job);
    return ES_OK;
}

static void shade_listed(es_renderer* r, const es_open_job* lights, const uint8_t* listed, es_planes* planes)
{
    es_open_job job = *lights;
    job.gbuffer = &r->gbuffer;
    job.rays = r->rays;
    job.listed = listed;
    for (int k = 0; k < 3; k++) job.irradiance[k] = planes->at[k];
    es_open_shade(r->context, &job);
}

static uint64_t count_bits(const uint8_t* bytes, size_t count)
{
    uint64_t bits = 0;
    for (size_t i = 0; i < count; i++) bits += (uint64_t)__builtin_popcount(bytes[i]);
    return bits;
}

static es_result light(es_renderer* r, const es_frame_inputs* in, uint64_t* whole)
{
    const es_renderer_settings* s = &r->settings;
    es_second_order_buffers* b = &r->second_order;
    const es_gbuffer* g = &r->gbuffer;
    const size_t list_bytes = (size_t)((g->width + 7) / 8) * g->height;
    es_arena_reset(&r->arena);
    if (!es_grow(r->context, (void**)&b->lights, &b->light_capacity, 0, (size_t)r->vpl_count + s->second_negative + 1, sizeof *b->lights)) return es_context_last_result(r->context);
    es_open_light *const positive = b->lights, *const negative = positive + r->vpl_count;
    es_open_light* tries = es_arena_allocate(&r->arena, ((size_t)s->second_negative * ES_NEGATIVE_TRIES + 1) * sizeof *tries);
    uint8_t* listed = es_arena_allocate(&r->arena, list_bytes);
    if (!tries || !listed) return es_context_last_result(r->context);
    const float bound = es_geometry_bound(s, in), spread = es_vpl_spread(s);
    for (uint32_t i = 0; i < r->vpl_count; i++) positive[i] = es_open_light_of(&r->vpls[i], spread);
    const es_negative_job place = {.gbuffer = g, .rays = r->rays, .lights = positive, .light_count = r->vpl_count, .count = s->second_negative, .seed = s->seed, .bound = bound, .spread = spread};
    uint32_t negative_count = 0;
    b->positive_count = r->vpl_count;
    if (s->second_negative) es_negative_lights_place(r->context, &place, tries, negative, &negative_count);

    b->negative_count = negative_count;
    const es_open_job adds = {.lights = positive, .light_count = r->vpl_count, .bound = bound}, takes = {.lights = negative, .light_count = negative_count, .bound = bound};
    es_result result = es_gbuffer_halve(r->context, g, &b->half);
    if (!result) result = shade_half(r, &adds, &b->half_positive);
    if (!result) result = shade_half(r, &takes, &b->half_negative);
    if (!result) result = es_planes_resize(r->context, &r->irradiance, g);
    if (!result) result = es_planes_resize(r->context, &b->taken, g);
    if (!result) result = es_planes_resize(r->context, &b->negative, g);
    if (result) return result;
    es_open_upsample_job up = {.gbuffer = g, .rays = r->rays, .half_width = b->half.width, .half_height = b->half.height, .half_stride = b->half.stride, .threshold = s->second_threshold, .plane_count = 6, .listed = listed};
    for (int k = 0; k < 3; k++) {
        up.source[k] = b->half_positive.at[k];
        up.result[k] = r->irradiance.at[k];
        up.source[k + 3] = b->half_negative.at[k];
        up.result[k + 3] = b->taken.at[k];
    }
    es_open_upsample(r->context, &up);
    shade_listed(r, &adds, listed, &r->irradiance);
    shade_listed(r, &takes, listed, &b->taken);
    *whole = count_bits(listed, list_bytes);
    const float* const there[3] = {r->irradiance.at[0], r->irradiance.at[1], r->irradiance.at[2]};
    es_open_subtract(r->context, g, b->taken.at, there);
    es_compose_job reflect = {.gbuffer = g};
    for (int k = 0; k < 3; k++) {
        reflect.irradiance[k] = b->taken.at[k];
        reflect.bounded[k] = b->negative.at[k];
    }
    es_compose(r->context, &reflect);
    return ES_OK;
}

es_result es_second_order_light_layer(es_renderer* r, const es_lit_surfaces* of, es_layer_light* light)
{
    const es_renderer_settings* s = &r->frame.settings;
    const es_second_order_buffers* b = &r->second_order;
    const float bound = es_geometry_bound(s, &(es_frame_inputs){.extent = r->frame.extent});
    es_result result = es_planes_resize(r->context, &light->irradiance, of->gbuffer);
    if (!result) result = es_planes_resize(r->context, &light->sparse_irradiance, of->gbuffer);
    if (result) return result;
    es_open_job adds = {.gbuffer = of->gbuffer, .rays = of->rays, .lights = b->lights, .light_count = b->positive_count, .bound = bound}, takes = adds;
    takes.lights = b->lights + b->positive_count;
    takes.light_count = b->negative_count;
    for (int k = 0; k < 3; k++) {
        adds.irradiance[k] = light->irradiance.at[k];
        takes.irradiance[k] = light->sparse_irradiance.at[k];
    }
    es_open_shade(r->context, &adds);
    es_open_shade(r->context, &takes);
    const float* const there[3] = {light->irradiance.at[0], light->irradiance.at[1], light->irradiance.at[2]};
    es_open_subtract(r->context, of->gbuffer, light->sparse_irradiance.at, there);
    for (int k = 0; k < 3; k++)
        for (size_t y = 0; y < of->gbuffer->height; y++)
            for (size_t x = 0; x < of->gbuffer->width; x++) light->irradiance.at[k][y * of->gbuffer->stride + x] += light->sparse_irradiance.at[k][y * of->gbuffer->stride + x];
    return ES_OK;
}

es_result es_pass_second_order(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = s->method != ES_GI_SECOND_ORDER ? "gi is not second-order" : es_indirect_nothing(r, in);
    if (why) {
        es_plan_not_needed(plan, ES_PASS_SECOND_ORDER, why);
        es_second_order_free(r->context, &r->second_order);
        return ES_OK;
    }
    r->has_specular = false;
    es_plan_begin(plan, ES_PASS_SECOND_ORDER);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_VPLS);
    es_plan_reads_pass(plan, ES_PASS_LAMP_BOUNCE);
    const uint32_t words[] = {r->vpl_count, s->second_negative, s->seed};
    es_plan_reads(plan, words, sizeof words);
    const float numbers[] = {es_geometry_bound(s, in), es_vpl_spread(s), s->second_threshold};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_SECOND_ORDER)) return ES_OK;
    uint64_t whole = 0;
    es_result result = light(r, in, &whole);
    if (!result) es_plan_done(plan, ES_PASS_SECOND_ORDER, whole);
    return result;
}
