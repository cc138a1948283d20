/* Hands rows to the workers (gi/micro/upsample.h; the work is in kernels/micro_upsample.c). */
#include "gi/micro/upsample.h"

#include "gi/kernel_table.h"

typedef struct upsample_loop { const es_gi_kernels* kernels; const es_micro_upsample_job* job; } upsample_loop;

static void upsample_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const upsample_loop* loop = user;
    loop->kernels->micro_upsample(loop->job, begin, end);
}

void es_micro_upsample(es_context* context, const es_micro_upsample_job* job)
{
    upsample_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, upsample_rows, &loop);
}
