/* Hands the blocks of the geometry-aware filter to the workers (gi/filter.h; the work is in kernels/filter.c). */
#include "gi/filter.h"

#include "gi/kernel_table.h"

typedef struct filter_loop {
    const es_filter_job* job;
    es_filter_scratch* scratch;  /* one a worker */
    const es_gi_kernels* kernels;
    uint32_t columns_of_blocks;
} filter_loop;

static void filter_blocks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const filter_loop* loop = user;
    for (uint32_t i = begin; i < end; i++)
        loop->kernels->filter(loop->job, i % loop->columns_of_blocks * ES_FILTER_COLUMNS, i / loop->columns_of_blocks * ES_FILTER_ROWS, &loop->scratch[worker]);
}

es_result es_filter_geometry_aware(es_context* context, es_arena* arena, const es_filter_job* job)
{
    es_filter_scratch* scratch = es_arena_allocate(arena, (size_t)es_context_workers(context) * sizeof *scratch);
    if (!scratch) return es_context_last_result(context);
    filter_loop loop = {.job = job, .scratch = scratch, .kernels = es_gi_kernel_table(es_context_isa(context))};
    loop.columns_of_blocks = (job->gbuffer->width + ES_FILTER_COLUMNS - 1) / ES_FILTER_COLUMNS;
    uint32_t rows_of_blocks = (job->gbuffer->height + ES_FILTER_ROWS - 1) / ES_FILTER_ROWS;
    es_parallel_for(context, loop.columns_of_blocks * rows_of_blocks, 1, filter_blocks, &loop);
    return ES_OK;
}
