#include "gi/screen/directional_occlusion.h"

#include <string.h>

#include "gi/kernel_table.h"

static void put_offset(const es_screen_view* view, es_vec3 v, uint32_t column, es_sample_offset* to)
{
    const float* const rows[3] = {view->to_x, view->to_y, view->to_depth};
    for (int k = 0; k < 3; k++) to->window[k][column] = rows[k][0] * v.x + rows[k][1] * v.y + rows[k][2] * v.z;
}

es_result es_occlusion_prepare(es_arena* arena, const es_surroundings* surroundings, es_occlusion_job* job)
{
    const uint32_t count = job->sets * job->samples;
    es_occlusion_sample* table = es_arena_allocate(arena, count * sizeof *table);
    es_sample_offset* offsets[ES_SCREEN_MAX_VIEWS];
    for (uint32_t v = 0; v < job->stack->view_count; v++) {
        offsets[v] = es_arena_allocate(arena, count * sizeof **offsets);
        if (!offsets[v]) return es_context_last_result(arena->context);
        job->offsets[v] = offsets[v];
    }
    if (!table) return es_context_last_result(arena->context);
    job->table = table;
    /* each direction stands for its share of what all patterns together look at */
    const float solid_angle = 2.0f * ES_PI / (float)(job->sets * count);
    for (uint32_t y = 0; y < job->sets; y++)
        for (uint32_t i = 0; i < job->samples; i++)
            for (uint32_t x = 0; x < job->sets; x++) {
                const es_screen_sample sample = es_screen_sample_at(job->sets, job->samples, x, y, i);
                const es_vec3 d = sample.direction, opposite = es_v3_scale(d, -1.0f);
                float light[2][3] = {{1, 1, 1}, {1, 1, 1}};
                if (surroundings) {
                    surroundings->radiance(surroundings->user, d, solid_angle, light[0]);
                    surroundings->radiance(surroundings->user, opposite, solid_angle, light[1]);
                }
                const uint32_t at = y * job->samples + i;
                const float direction[3] = {d.x, d.y, d.z};
                for (uint32_t column = x; column < ES_SCREEN_COLUMNS; column += job->sets) {
                    for (int k = 0; k < 3; k++) {
                        table[at].direction[k][column] = direction[k];
                        for (int s = 0; s < 2; s++) table[at].light[s][k][column] = light[s][k];
                    }
                    for (uint32_t v = 0; v < job->stack->view_count; v++) put_offset(&job->stack->views[v], es_v3_scale(d, sample.length * job->radius), column, &offsets[v][at]);
                }
            }
    return ES_OK;
}

typedef struct occlusion_loop { const es_gi_kernels* kernels; const es_occlusion_job* job; } occlusion_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const occlusion_loop* loop = user;
    loop->kernels->screen_occlusion(loop->job, begin, end);
}

void es_occlusion(es_context* context, const es_occlusion_job* job)
{
    occlusion_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->stack->views[0].height, 16, rows, &loop);
}
