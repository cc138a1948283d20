#include "gi/compose.h"

#include "gi/kernel_table.h"
#include "platform/context.h"

typedef struct compose_loop { const es_gi_kernels* kernels; const es_compose_job* job; } compose_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    compose_loop* loop = user;
    loop->kernels->compose(loop->job, begin, end);
}

void es_compose(es_context* context, const es_compose_job* job)
{
    compose_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, rows, &loop);
}
