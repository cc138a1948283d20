#include "gi/screen/directional_occlusion.h"

#include "gi/kernel_table.h"

static void put_offset(const es_screen_view* view, es_vec3 v, uint32_t column, es_sample_offset* to)
{
    const float* const rows[3] = {view->to_x, view->to_y, view->to_depth};
    for (int k = 0; k < 3; k++) to->window[k][column] = rows[k][0] * v.x + rows[k][1] * v.y + rows[k][2] * v.z;
}

/* Directions of all samples of all patterns and their opposites, in turns, and what comes from them: 3 numbers each. */
static float* look_up(es_arena* arena, const es_environment_lookup* environment, const es_occlusion_job* job)
{
    const uint32_t patterns = job->sets * job->sets, count = 2 * patterns * job->samples, room = (count + 7) / 8 * 8;
    float* memory = es_arena_allocate(arena, (size_t)room * 13 * sizeof *memory);
    if (!memory) return NULL;
    float *x = memory + 3 * (size_t)room, *y = x + room, *z = y + room, *roughness = z + room, *light[3] = {roughness + room, roughness + 2 * (size_t)room, roughness + 3 * (size_t)room}, *unused = memory + 10 * (size_t)room;
    /* each direction stands for its share of what all patterns together look at; a lobe of that solid angle has alpha² = solid angle / 12 pi */
    const float width = es_sqrt(es_sqrt(4.0f * ES_PI / (float)count / (12.0f * ES_PI)));
    for (uint32_t i = 0; i < room; i++) {
        const uint32_t pattern = i / 2 / job->samples % patterns;
        const es_screen_sample s = es_screen_sample_at(job->sets, job->samples, pattern % job->sets, pattern / job->sets, i / 2 % job->samples);
        const float sign = i % 2 ? -1.0f : 1.0f;
        x[i] = sign * s.direction.x;
        y[i] = sign * s.direction.y;
        z[i] = sign * s.direction.z;
        roughness[i] = width;
    }
    const es_environment_question question = {.x = x, .y = y, .z = z, .roughness = roughness, .radiance = {light[0], light[1], light[2]}, .irradiance = {unused, unused + room, unused + 2 * (size_t)room}, .count = room};
    es_environment_ask(arena->context, environment, &question);
    float most = 1e-30f;
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < count; i++) most = es_maxf(most, light[k][i]);
    for (int k = 0; k < 3; k++)
        for (uint32_t i = 0; i < count; i++) {
            const float share = light[k][i] / most;
            memory[3 * (size_t)i + (size_t)k] = share > 1e-10f ? share : 0.0f;
        }
    return memory;
}

es_result es_occlusion_prepare(es_arena* arena, const es_environment_lookup* environment, es_occlusion_job* job)
{
    const uint32_t count = job->sets * job->samples;
    es_occlusion_sample* table = es_arena_allocate(arena, count * sizeof *table);
    es_sample_offset* offsets[ES_SCREEN_MAX_VIEWS];
    for (uint32_t v = 0; v < job->stack->view_count; v++) {
        offsets[v] = es_arena_allocate(arena, count * sizeof **offsets);
        if (!offsets[v]) return es_context_last_result(arena->context);
        job->offsets[v] = offsets[v];
    }
    const float* light = table && environment ? look_up(arena, environment, job) : NULL;
    if (!table || (environment && !light)) return es_context_last_result(arena->context);
    job->table = table;
    for (uint32_t y = 0; y < job->sets; y++)
        for (uint32_t i = 0; i < job->samples; i++)
            for (uint32_t x = 0; x < job->sets; x++) {
                const es_screen_sample sample = es_screen_sample_at(job->sets, job->samples, x, y, i);
                const es_vec3 d = sample.direction;
                const uint32_t at = y * job->samples + i;
                const float direction[3] = {d.x, d.y, d.z};
                const float* from = light ? light + 6 * ((size_t)(y * job->sets + x) * job->samples + i) : NULL;
                for (uint32_t column = x; column < ES_SCREEN_COLUMNS; column += job->sets) {
                    for (int k = 0; k < 3; k++) {
                        table[at].direction[k][column] = direction[k];
                        for (int s = 0; s < 2; s++) table[at].light[s][k][column] = from ? from[3 * s + k] : 1.0f;
                    }
                    for (uint32_t v = 0; v < job->stack->view_count; v++) put_offset(&job->stack->views[v], es_v3_scale(d, sample.length * job->radius), column, &offsets[v][at]);
                }
            }
    return ES_OK;
}

typedef struct occlusion_loop { const es_gi_kernels* kernels; const es_occlusion_job* job; } occlusion_loop;

static void blocks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const occlusion_loop* loop = user;
    const es_screen_view* view = &loop->job->stack->views[0];
    for (uint32_t i = begin; i < end; i++) {
        const es_screen_block block = es_screen_block_at(view->width, view->height, i);
        loop->kernels->screen_occlusion(loop->job, &block);
    }
}

void es_occlusion(es_context* context, const es_occlusion_job* job)
{
    occlusion_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, es_screen_block_count(job->stack->views[0].width, job->stack->views[0].height), 1, blocks, &loop);
}

typedef struct arriving_loop { const es_gi_kernels* kernels; const es_arriving_job* job; } arriving_loop;

static void arriving_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const arriving_loop* loop = user;
    loop->kernels->arriving_light(loop->job, begin, end);
}

void es_arriving_light(es_context* context, const es_arriving_job* job)
{
    arriving_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 16, arriving_rows, &loop);
}
