/* es_renderer_micro_buffer, and the images made of it. */
#include "gi/micro_view.h"

#include "gi/micro/pixels.h"
#include "gi/micro/view.h"
#include "gi/micro_passes.h"
#include "platform/context.h"

static es_result one_black_pixel(es_context* context, es_image* radiance, es_image* distance)
{
    es_result result = radiance ? es_image_create(context, 1, 1, 3, radiance) : ES_OK;
    if (!result && distance) result = es_image_create(context, 1, 1, 1, distance);
    if (result && radiance) es_image_destroy(context, radiance);
    return result;
}

static es_result view_of(es_renderer* r, const es_gather_point* point, bool warped, es_image* radiance, es_image* distance)
{
    const es_micro_settings settings = es_micro_settings_of(&r->frame.settings);
    const size_t count = (size_t)settings.size * settings.size;
    es_micro_pixel* pixels = es_allocate_array(r->context, count, sizeof *pixels);
    if (!pixels) return es_context_last_result(r->context);
    es_result result = es_micro_look(r->context, &r->micro.forest, &settings, point, pixels);
    if (!result) result = es_micro_view(r->context, pixels, settings.size, point->normal, r->rays.dir_dx, !warped, radiance, distance);
    es_release(r->context, pixels, count * sizeof *pixels);
    return result;
}

es_result es_renderer_micro_buffer(es_renderer* renderer, uint32_t x, uint32_t y, bool lobe, bool warped, es_image* radiance, es_image* distance)
{
    if (!renderer) return ES_INVALID_ARGUMENT;
    es_context* context = renderer->context;
    if (radiance) *radiance = (es_image){0};
    if (distance) *distance = (es_image){0};
    if (!renderer->complete) return es_misuse(context, ES_WRONG_STATE, "es_renderer_micro_buffer: no frame has been rendered, or the last one failed");
    const es_gbuffer* g = &renderer->gbuffer;
    if (x >= g->width || y >= g->height) return es_misuse(context, ES_INVALID_ARGUMENT, "es_renderer_micro_buffer: pixel %u, %u of %u × %u", x, y, g->width, g->height);
    es_fp_environment environment = es_fp_enter();
    es_gather_point point;
    const bool some = renderer->frame.settings.method == ES_GI_MICRO && es_micro_point_of_frame(renderer, x, y, lobe ? ES_GATHER_LOBE : ES_GATHER_DIFFUSE, &point);
    es_result result = some ? view_of(renderer, &point, warped, radiance, distance) : one_black_pixel(context, radiance, distance);
    es_fp_leave(environment);
    return result;
}

es_result es_micro_image(es_renderer* renderer, bool warped, bool of_distance, es_image* image)
{
    const es_gbuffer* g = &renderer->gbuffer;
    const uint32_t x = g->width / 2, y = g->height / 2;
    es_gather_point point;
    const bool lobe = renderer->frame.settings.method == ES_GI_MICRO && es_micro_point_of_frame(renderer, x, y, ES_GATHER_LOBE, &point);
    return es_renderer_micro_buffer(renderer, x, y, lobe, warped, of_distance ? NULL : image, of_distance ? image : NULL);
}
