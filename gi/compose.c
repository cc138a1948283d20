#include "gi/compose.h"

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/image_files.h"

void es_srgb_table_fill(es_srgb_table* table)
{
    double thresholds[255];
    es_srgb_thresholds(thresholds);
    for (uint32_t i = 0; i < ES_SRGB_TABLE_SIZE; i++) {
        double root = (double)i / (ES_SRGB_TABLE_SIZE - 1);
        table->code[i] = es_srgb_encode8(thresholds, (float)(root * root));
    }
}

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
