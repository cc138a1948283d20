#include "gi/blend.h"

#include "gi/kernel_table.h"

typedef struct blend_loop { const es_gi_kernels* kernels; const es_blend_job* job; } blend_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const blend_loop* loop = user;
    loop->kernels->blend(loop->job, begin, end);
}

void es_blend(es_context* context, const es_blend_job* job)
{
    blend_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->rows, 16, rows, &loop);
}
