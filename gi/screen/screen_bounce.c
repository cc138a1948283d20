#include "gi/screen/screen_bounce.h"

#include "gi/kernel_table.h"

es_result es_screen_bounce_prepare(es_arena* arena, es_screen_bounce_job* job)
{
    const uint32_t count = job->sets * job->samples;
    for (uint32_t v = 0; v < job->stack->view_count; v++) {
        const es_screen_view* view = &job->stack->views[v];
        es_bounce_sample* table = es_arena_allocate(arena, count * sizeof *table);
        if (!table) return es_context_last_result(arena->context);
        const float columns = job->radius / es_sqrt(view->xx), rows = job->radius / es_sqrt(view->yy);
        for (uint32_t y = 0; y < job->sets; y++)
            for (uint32_t i = 0; i < job->samples; i++)
                for (uint32_t x = 0; x < job->sets; x++) {
                    const es_screen_disc_sample s = es_screen_disc_sample_at(job->sets, job->samples, x, y, i);
                    es_bounce_sample* to = &table[y * job->samples + i];
                    for (uint32_t column = x; column < ES_SCREEN_MAX_SETS + 8; column += job->sets) {
                        to->step[0][column] = s.x * columns;
                        to->step[1][column] = s.y * rows;
                        to->distance2[column] = s.radius * s.radius * job->radius * job->radius;
                    }
                }
        job->table[v] = table;
    }
    return ES_OK;
}

typedef struct screen_loop { const es_gi_kernels* kernels; const void* job; } screen_loop;

static void bounce_blocks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const screen_loop* loop = user;
    const es_screen_bounce_job* job = loop->job;
    const es_screen_view* view = &job->stack->views[0];
    for (uint32_t i = begin; i < end; i++) {
        const es_screen_block block = es_screen_block_at(view->width, view->height, i);
        loop->kernels->screen_bounce(job, &block);
    }
}

static void light_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const screen_loop* loop = user;
    loop->kernels->screen_light(loop->job, begin, end);
}

static void reflect_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const screen_loop* loop = user;
    loop->kernels->screen_reflect(loop->job, begin, end);
}

static void run(es_context* context, const void* job, uint32_t count, uint32_t grain, es_loop_body body)
{
    screen_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, count, grain, body, &loop);
}

void es_screen_bounce(es_context* context, const es_screen_bounce_job* job)
{
    run(context, job, es_screen_block_count(job->stack->views[0].width, job->stack->views[0].height), 1, bounce_blocks);
}
void es_screen_light(es_context* context, const es_screen_light_job* job) { run(context, job, job->gbuffer->height, 16, light_rows); }
void es_screen_reflect(es_context* context, const es_screen_reflect_job* job) { run(context, job, job->gbuffer->height, 16, reflect_rows); }
