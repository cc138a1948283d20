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

typedef struct antialias_loop { const es_gi_kernels* kernels; const es_antialias_job* job; } antialias_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    antialias_loop* loop = user;
    loop->kernels->antialias(loop->job, begin, end);
}

void es_antialias_resolve(es_context* context, const es_antialias_job* job)
{
    antialias_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, rows, &loop);
}
