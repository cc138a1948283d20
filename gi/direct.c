#include "gi/direct.h"

#include "gi/kernel_table.h"
#include "platform/context.h"

typedef struct direct_loop { const es_gi_kernels* kernels; const es_direct_job* job; } direct_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    direct_loop* loop = user;
    loop->kernels->direct(loop->job, begin, end);
}

void es_direct_light(es_context* context, const es_direct_job* job)
{
    direct_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, rows, &loop);
}
