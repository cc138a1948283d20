/* Where pixels are sampled, and the rows of the resolve handed to the workers (gi/antialias.h; the work is in kernels/antialias.c). */
#include "gi/antialias.h"

#include "gi/kernel_table.h"
#include "platform/maths.h"

/* The digits of the index in a base, mirrored at the point; shifted by a half around the circle. */
static float halton(uint32_t index, uint32_t base)
{
    double value = 0, scale = 1;
    for (uint32_t i = index; i; i /= base) {
        scale /= base;
        value += scale * (i % base);
    }
    return (float)(value < 0.5 ? value : value - 1.0); /* 0 … 1 around the circle: -1/2 … 1/2 from the centre */
}

void es_antialias_place(uint32_t index, float place[2])
{
    place[0] = halton(index, 2);
    place[1] = halton(index, 3);
}

static void move_projection(es_mat4* projection, float x, float y)
{
    float* m = projection->m;
    if (m[15] == 1.0f) { /* orthographic */
        m[12] -= x;
        m[13] -= y;
    } else {
        m[8] += x;
        m[9] += y;
    }
}

void es_antialias_jitter(es_raster_view* view, const float place[2])
{
    const float x = 2.0f * place[0] / (float)view->width, y = -2.0f * place[1] / (float)view->height;
    move_projection(&view->projection, x, y);
    move_projection(&view->previous_projection, x, y);
}

/* A picture is composed and blended a few rows at a time, while they are near; where two bands meet, once both are composed. */
enum { BAND = 32, STEP = 8 };

typedef struct antialias_loop { const es_gi_kernels* kernels; const es_antialias_job* job; } antialias_loop;

static void bands(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const antialias_loop* loop = user;
    const uint32_t height = loop->job->gbuffer->height, last = end * BAND < height ? end * BAND : height;
    uint32_t blended = begin ? begin * BAND + 1 : 0;
    for (uint32_t y = begin * BAND; y < last; y += STEP) {
        const uint32_t composed = y + STEP < last ? y + STEP : last, whole = composed == height ? height : composed - 1;
        if (loop->job->compose) loop->kernels->compose(loop->job->compose, y, composed);
        if (whole > blended) loop->kernels->antialias(loop->job, blended, whole);
        blended = whole > blended ? whole : blended;
    }
}

/* The rows on both sides of where bands 1, 2 … begin. */
static void seams(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const antialias_loop* loop = user;
    for (uint32_t i = begin; i < end; i++) loop->kernels->antialias(loop->job, (i + 1) * BAND - 1, (i + 1) * BAND + 1);
}

void es_antialias_resolve(es_context* context, const es_antialias_job* job)
{
    antialias_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    const uint32_t count = (job->gbuffer->height + BAND - 1) / BAND;
    es_parallel_for(context, count, 1, bands, &loop);
    if (count > 1) es_parallel_for(context, count - 1, 4, seams, &loop);
}
