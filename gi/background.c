#include "gi/background.h"

#include <string.h>

#include "gi/kernel_table.h"

typedef struct background_loop { const es_gi_kernels* kernels; const es_background_job* job; } background_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const background_loop* loop = user;
    loop->kernels->background(loop->job, begin, end);
}

void es_background_fill(es_context* context, const es_background_job* job)
{
    background_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, rows, &loop);
}

void es_background_motion(const es_raster_view* view, es_background_job* job)
{
    const float *v = view->previous_view.m, *p = view->previous_projection.m;
    /* What is infinitely far away moves when the view turns or its projection changes; seen in parallel it is the same everywhere. */
    job->moving = p[15] != 1.0f && memcmp(&view->previous_projection, &view->projection, sizeof view->projection) != 0;
    for (int i = 0; i < 12; i++) job->moving |= p[15] != 1.0f && i % 4 < 3 && v[i] != view->view.m[i];
    const double half_width = 0.5 * view->width, half_height = 0.5 * view->height;
    for (int k = 0; k < 3; k++) {
        const double right = (double)v[4 * k], up = (double)v[4 * k + 1], forward = -(double)v[4 * k + 2];
        job->last_pixel[0][k] = (float)((right * (double)p[0] - forward * (double)p[8]) * half_width + forward * (half_width - 0.5));
        job->last_pixel[1][k] = (float)(forward * (half_height - 0.5) - (up * (double)p[5] - forward * (double)p[9]) * half_height);
        job->last_pixel[2][k] = (float)forward;
    }
}
