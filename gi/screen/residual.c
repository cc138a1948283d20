/* Memory of the pyramids, and rows for the workers (gi/screen/residual.h; the work is in kernels/residual_pyramid.c and kernels/residual.c). */
#include "gi/screen/residual.h"

#include "gi/kernel_table.h"

es_result es_residual_reserve(es_context* context, es_residual_pyramid* p, uint32_t width, uint32_t height, uint32_t levels)
{
    if (p->memory && p->width[0] == width && p->height[0] == height && p->levels == levels) return ES_OK;
    es_residual_free(context, p);
    size_t nodes = 0, first[ES_RESIDUAL_LEVELS] = {0};
    p->levels = levels;
    for (uint32_t l = 0; l < levels; l++) {
        p->width[l] = l ? (p->width[l - 1] + 1) / 2 : width;
        p->height[l] = l ? (p->height[l - 1] + 1) / 2 : height;
        first[l] = nodes;
        if (l) nodes += (size_t)p->width[l] * p->height[l];
    }
    p->bytes = nodes * (sizeof(es_residual_node) + 4 * sizeof(float));
    p->memory = es_allocate(context, p->bytes);
    if (!p->memory) {
        *p = (es_residual_pyramid){0};
        return es_context_last_result(context);
    }
    float* sent = (float*)((es_residual_node*)p->memory + nodes);
    for (uint32_t l = 1; l < levels; l++) {
        p->nodes[l] = (es_residual_node*)p->memory + first[l];
        p->sent[l] = sent + 4 * first[l];
    }
    return ES_OK;
}

void es_residual_free(es_context* context, es_residual_pyramid* p)
{
    es_release(context, p->memory, p->bytes);
    *p = (es_residual_pyramid){0};
}

typedef struct build_loop { const es_gi_kernels* kernels; const es_residual_layer* layer; uint32_t level; } build_loop;

static void build_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const build_loop* loop = user;
    loop->kernels->residual_level(loop->layer, loop->level, begin, end);
}

void es_residual_build(es_context* context, const es_residual_layer* layer)
{
    build_loop loop = {.kernels = es_gi_kernel_table(es_context_isa(context)), .layer = layer};
    for (loop.level = 1; loop.level < layer->pyramid->levels; loop.level++) es_parallel_for(context, layer->pyramid->height[loop.level], 8, build_rows, &loop);
}

typedef struct gather_loop { const es_gi_kernels* kernels; const es_residual_job* job; } gather_loop;

static void gather_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const gather_loop* loop = user;
    loop->kernels->residual_gather(loop->job, begin, end);
}

void es_residual_gather(es_context* context, const es_residual_job* job)
{
    gather_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, (job->gbuffer->height + job->spacing - 1) / job->spacing, 4, gather_rows, &loop);
}
