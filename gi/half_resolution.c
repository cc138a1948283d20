/* Every second pixel, and back (gi/half_resolution.h; the work of the way back is in kernels/upsample.c). */
#include "gi/half_resolution.h"

#include "gi/kernel_table.h"
#include "platform/context.h"

typedef struct halve_loop { const es_gbuffer* whole; es_gbuffer* half; } halve_loop;

static void halve_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const halve_loop* loop = user;
    const es_gbuffer* from = loop->whole;
    es_gbuffer* to = loop->half;
    for (uint32_t y = begin; y < end; y++) {
        const size_t source = (size_t)(2 * y) * from->stride, row = (size_t)y * to->stride;
        for (uint32_t x = 0; x < to->stride; x++) {
            /* columns past the end are unseen pixels */
            const bool inside = x < to->width;
            const size_t at = source + (inside ? 2 * x : 0);
            to->depth[row + x] = inside ? from->depth[at] : 0.0f;
            to->normal[row + x] = from->normal[at];
            to->geometric_normal[row + x] = from->geometric_normal[at];
            to->albedo_rg[row + x] = from->albedo_rg[at];
            to->albedo_b[row + x] = from->albedo_b[at];
            to->surface[row + x] = from->surface[at];
            to->motion_x[row + x] = 0.5f * from->motion_x[at];
            to->motion_y[row + x] = 0.5f * from->motion_y[at];
        }
    }
}

es_result es_gbuffer_halve(es_context* context, const es_gbuffer* whole, es_gbuffer* half)
{
    const uint32_t width = (whole->width + 1) / 2, height = (whole->height + 1) / 2;
    if (!half->memory || half->width != width || half->height != height) {
        es_gbuffer_destroy(context, half);
        es_result result = es_gbuffer_create(context, width, height, ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_MOTION, half);
        if (result) return result;
    }
    halve_loop loop = {whole, half};
    es_parallel_for(context, height, 16, halve_rows, &loop);
    return ES_OK;
}

es_pixel_rays es_pixel_rays_halve(const es_pixel_rays* whole)
{
    es_pixel_rays half = *whole;
    for (int k = 0; k < 3; k++) {
        half.base_dx[k] *= 2.0f;
        half.base_dy[k] *= 2.0f;
        half.dir_dx[k] *= 2.0f;
        half.dir_dy[k] *= 2.0f;
    }
    return half;
}

typedef struct upsample_loop { const es_gi_kernels* kernels; const es_upsample_job* job; } upsample_loop;

static void upsample_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    upsample_loop* loop = user;
    loop->kernels->upsample(loop->job, begin, end);
}

void es_upsample(es_context* context, const es_upsample_job* job)
{
    upsample_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, upsample_rows, &loop);
}
