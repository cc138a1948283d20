#include "gi/reflections/reflecting.h"

#include "gi/kernel_table.h"

typedef struct find_loop { const es_gi_kernels* kernels; const es_reflecting_job* job; } find_loop;

static void find_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const find_loop* loop = user;
    loop->kernels->reflecting(loop->job, begin, end);
}

void es_reflecting_find(es_context* context, const es_reflecting_job* job)
{
    find_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 8, find_rows, &loop);
}

typedef struct map_loop { const es_gi_kernels* kernels; const es_reflected_job* job; } map_loop;

static void map_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const map_loop* loop = user;
    loop->kernels->reflected(loop->job, begin, end);
}

void es_reflected_from_maps(es_context* context, const es_reflected_job* job)
{
    map_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 4, map_rows, &loop);
}
