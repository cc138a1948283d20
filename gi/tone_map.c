/* A picture of radiance from elsewhere, displayed as the renderer displays its own: by the same kernel, row by row, over a surface that
 * neither glows nor reflects. */
#include "gi/compose.h"
#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"

enum { PADDING = 64 }; /* floats past the row that a vector may read */

/* The planes the kernel reads, all of them zeros. */
static es_gbuffer nothing(uint32_t* zeros, uint32_t width)
{
    return (es_gbuffer){.width = width, .height = 1, .stride = width, .albedo_rg = zeros, .albedo_b = zeros, .surface = zeros, .emission = zeros, .depth = (float*)(void*)zeros};
}

es_result es_tone_map_image(es_context* context, const es_renderer_settings* settings, const es_image* radiance, uint32_t* xrgb)
{
    if (!context) return ES_INVALID_ARGUMENT;
    if (!settings || !radiance || !xrgb || !radiance->pixels || radiance->channels < 3)
        return es_misuse(context, ES_INVALID_ARGUMENT, "es_tone_map_image: settings, an image of three channels or more and room for its pixels are expected");
    size_t row = (size_t)radiance->width + PADDING, bytes = 4 * row * sizeof(float) + sizeof(es_srgb_table);
    float* memory = es_allocate_zero(context, bytes);
    if (!memory) return es_context_last_result(context);
    es_srgb_table* srgb = (es_srgb_table*)(void*)(memory + 4 * row);
    es_srgb_table_fill(srgb);
    es_fp_environment environment = es_fp_enter();
    es_gbuffer gbuffer = nothing((uint32_t*)(void*)(memory + 3 * row), radiance->width);
    es_compose_job job = {.gbuffer = &gbuffer, .exposure_scale = es_exp2(settings->exposure), .white = settings->white, .tone_map = settings->tone_map, .srgb = srgb};
    for (uint32_t c = 0; c < 3; c++) job.direct[c] = memory + c * row;
    const es_gi_kernels* kernels = es_gi_kernel_table(es_context_isa(context));
    for (uint32_t y = 0; y < radiance->height; y++) {
        const float* in = radiance->pixels + (size_t)y * radiance->width * radiance->channels;
        for (uint32_t x = 0; x < radiance->width; x++)
            for (uint32_t c = 0; c < 3; c++) memory[c * row + x] = in[(size_t)x * radiance->channels + c];
        job.xrgb = xrgb + (size_t)y * radiance->width;
        kernels->compose(&job, 0, 1);
    }
    es_fp_leave(environment);
    es_release(context, memory, bytes);
    return ES_OK;
}
