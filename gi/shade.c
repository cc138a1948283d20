/* Splits interleaved shading into blocks for the workers (gi/shade.h; the work is in kernels/shade.c).
 *
 * A block is a rectangle of up to ES_SHADE_COLUMNS × rows pixels of each phase. Blocks of the same rectangle are handed out
 * one after another: its G-buffer lines serve all of them. */
#include "gi/shade.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/maths.h"

typedef struct shade_loop {
    const es_shade_job* job;
    const es_shade_light* lights;
    es_shade_batch* batches;   /* one a worker */
    const es_gi_kernels* kernels;
    uint32_t rows, columns_of_blocks;
} shade_loop;

static void shade_blocks(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const shade_loop* loop = user;
    const uint32_t n = loop->job->interleave;
    for (uint32_t i = begin; i < end; i++) {
        uint32_t rectangle = i / n;
        es_shade_block block = {
            .phase_y = i % n,
            .column = rectangle % loop->columns_of_blocks * ES_SHADE_COLUMNS,
            .row = rectangle / loop->columns_of_blocks * loop->rows,
            .rows = loop->rows,
        };
        loop->kernels->shade(loop->job, loop->lights, &block, &loop->batches[worker]);
    }
}

/* Phong's exponent with the width of a GGX lobe: alpha² = 2 / (e + 2) (Walter et al. 2007) */
static float widest_exponent(float roughness)
{
    float alpha = roughness * roughness;
    return 2.0f / es_maxf(alpha * alpha, 1e-6f) - 2.0f;
}

static float widened(uint32_t model, float roughness, float lobe_roughness)
{
    return model == ES_SURFACE_PHONG ? es_minf(roughness, es_maxf(widest_exponent(lobe_roughness), 1.0f)) : es_maxf(roughness, lobe_roughness);
}

es_surface es_widened_lobe(es_surface surface, float lobe_roughness)
{
    surface.roughness = widened(surface.model, surface.roughness, lobe_roughness);
    return surface;
}

static es_shade_light light_of(const es_vpl_record* vpl, float scale, float spread, float lobe_roughness)
{
    es_shade_light light = {.spread = vpl->area * (0.318309886f * spread), .model = vpl->model, .glossy = vpl->glossy, .parallel = vpl->parallel};
    light.roughness = widened(vpl->model, vpl->roughness, lobe_roughness);
    memcpy(light.position, vpl->position, sizeof light.position);
    memcpy(light.normal, vpl->normal, sizeof light.normal);
    memcpy(light.tangent, vpl->tangent, sizeof light.tangent);
    memcpy(light.bitangent, vpl->bitangent, sizeof light.bitangent);
    memcpy(light.incident, vpl->incident, sizeof light.incident);
    memcpy(light.specular_color, vpl->specular_color, sizeof light.specular_color);
    for (int k = 0; k < 3; k++) {
        light.color[k] = vpl->flux[k] * (0.318309886f * scale);
        light.power[k] = vpl->power[k] * scale;
    }
    return light;
}

/* ---- sampled: the order of a phase's lights ----------------------------------------------------------------------------- */

typedef struct placed_light { uint32_t place, record; } placed_light;

static uint32_t spread_bits(uint32_t a)
{
    a = (a | a << 16) & 0x030000ffu;
    a = (a | a << 8) & 0x0300f00fu;
    a = (a | a << 4) & 0x030c30c3u;
    return (a | a << 2) & 0x09249249u;
}

static bool before(placed_light a, placed_light b) { return a.place != b.place ? a.place < b.place : a.record < b.record; }

static void sift(placed_light* heap, uint32_t root, uint32_t count)
{
    const placed_light moved = heap[root];
    for (uint32_t child = 2 * root + 1; child < count; child = 2 * root + 1) {
        if (child + 1 < count && before(heap[child], heap[child + 1])) child++;
        if (!before(moved, heap[child])) break;
        heap[root] = heap[child];
        root = child;
    }
    heap[root] = moved;
}

/* A heap sort takes no memory; that of the C library may, past the context and its cap. */
static void sort_lights(placed_light* lights, uint32_t count)
{
    for (uint32_t i = count / 2; i-- > 0;) sift(lights, i, count);
    for (uint32_t last = count; last-- > 1;) {
        const placed_light greatest = lights[0];
        lights[0] = lights[last];
        lights[last] = greatest;
        sift(lights, 0, last);
    }
}

/* Along a Morton curve through the box of all lights, phase by phase. */
static void order_lights(const es_shade_job* job, placed_light* order, uint32_t step)
{
    float low[3], scale[3];
    for (int k = 0; k < 3; k++) {
        float high = low[k] = job->vpls[0].position[k];
        for (uint32_t v = 1; v < job->vpl_count; v++) {
            low[k] = es_minf(low[k], job->vpls[v].position[k]);
            high = es_maxf(high, job->vpls[v].position[k]);
        }
        scale[k] = high > low[k] ? 1023.0f / (high - low[k]) : 0.0f;
    }
    uint32_t at = 0;
    for (uint32_t phase = 0; phase < step; phase++) {
        uint32_t first = at;
        for (uint32_t v = phase; v < job->vpl_count; v += step) {
            uint32_t place = 0;
            for (int k = 0; k < 3; k++) place |= spread_bits((uint32_t)es_clampf((job->vpls[v].position[k] - low[k]) * scale[k], 0.0f, 1023.0f)) << k;
            order[at++] = (placed_light){place, v};
        }
        sort_lights(order + first, at - first);
    }
}

static es_result place_lights(es_context* context, es_arena* arena, const es_shade_job* job, es_shade_light* lights)
{
    const uint32_t step = job->interleave * job->interleave;
    placed_light* order = es_arena_allocate(arena, ((size_t)job->vpl_count + 1) * sizeof *order);
    if (!order) return es_context_last_result(context);
    if (job->vpl_count) order_lights(job, order, step);
    uint32_t at = 0;
    for (uint32_t phase = 0; phase < step; phase++)
        for (uint32_t v = phase; v < job->vpl_count; v += step, at++) {
            es_shade_light* light = &lights[v];
            *light = light_of(&job->vpls[order[at].record], (float)step, job->spread, job->lobe_roughness);
            light->record = order[at].record;
            light->weight = 0.2126f * light->color[0] + 0.7152f * light->color[1] + 0.0722f * light->color[2];
            if (light->glossy)
                light->weight += 0.318309886f * (0.2126f * light->power[0] * light->specular_color[0] + 0.7152f * light->power[1] * light->specular_color[1] + 0.0722f * light->power[2] * light->specular_color[2]);
        }
    return ES_OK;
}

es_result es_shade(es_context* context, es_arena* arena, const es_shade_job* job)
{
    const uint32_t n = job->interleave, width = job->gbuffer->width, height = job->gbuffer->height;
    es_shade_light* lights = es_arena_allocate(arena, ((size_t)job->vpl_count + 1) * sizeof *lights);
    es_shade_batch* batches = lights ? es_arena_allocate(arena, (size_t)es_context_workers(context) * sizeof *batches) : NULL;
    if (!batches) return es_context_last_result(context);
    if (job->sampled) {
        es_result result = place_lights(context, arena, job, lights);
        if (result) return result;
    }
    for (uint32_t v = 0; v < job->vpl_count - job->dark_count && !job->sampled; v++) lights[v] = light_of(&job->vpls[v], (float)(n * n), job->spread, job->lobe_roughness);

    shade_loop loop = {.job = job, .lights = lights, .batches = batches, .kernels = es_gi_kernel_table(es_context_isa(context))};
    uint32_t columns = (width + n - 1) / n, rows = (height + n - 1) / n;
    loop.rows = ES_SHADE_LANES / ES_SHADE_COLUMNS;
    loop.columns_of_blocks = (columns + ES_SHADE_COLUMNS - 1) / ES_SHADE_COLUMNS;
    uint32_t rectangles = loop.columns_of_blocks * ((rows + loop.rows - 1) / loop.rows);
    for (uint32_t v = 0; v < job->vpl_count && job->sampled; v++)
        if (lights[v].record >= job->vpl_count - job->dark_count)
            for (int k = 0; k < 3; k++) lights[v].color[k] = lights[v].power[k] = 0.0f;
    es_parallel_for(context, rectangles * n, 1, shade_blocks, &loop);
    return ES_OK;
}

/* ---- points ------------------------------------------------------------------------------------------------------------------ */

typedef struct points_loop {
    const es_shade_job* job;
    const es_shade_light* lights;
    const es_shade_points* points;
    es_shade_batch* batches;   /* one a worker */
    const es_gi_kernels* kernels;
    uint32_t grain;
} points_loop;

static void shade_points(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const points_loop* loop = user;
    const es_shade_points* p = loop->points;
    es_shade_batch* batch = &loop->batches[worker];
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t first = i * loop->grain, count = p->count - first < loop->grain ? p->count - first : loop->grain, lanes = (count + 7) / 8 * 8;
        float* const to[] = {batch->px, batch->py, batch->pz, batch->nx, batch->ny, batch->nz};
        const float* const from[] = {p->x, p->y, p->z, p->nx, p->ny, p->nz};
        for (int k = 0; k < 6; k++) memcpy(to[k], from[k] + first, lanes * sizeof(float));
        for (int k = 0; k < 3; k++) {
            batch->e[k] = (float*)batch->words[k][0];
            memset(batch->e[k], 0, lanes * sizeof(float));
        }
        loop->kernels->shade_points(loop->job, loop->lights, 0, loop->job->vpl_count - loop->job->dark_count, batch, lanes);
        for (int k = 0; k < 3; k++) memcpy(p->irradiance[k] + first, batch->e[k], count * sizeof(float));
    }
}

es_result es_shade_at_points(es_context* context, es_arena* arena, const es_shade_job* job, const es_shade_points* points)
{
    const uint32_t workers = es_context_workers(context), lit = job->vpl_count - job->dark_count;
    es_shade_light* lights = es_arena_allocate(arena, ((size_t)lit + 1) * sizeof *lights);
    es_shade_batch* batches = lights ? es_arena_allocate(arena, (size_t)workers * sizeof *batches) : NULL;
    if (!batches) return es_context_last_result(context);
    for (uint32_t v = 0; v < lit; v++) lights[v] = light_of(&job->vpls[v], 1.0f, job->spread, job->lobe_roughness);
    /* each point adds up the lights in their order, whatever the batch: one for each worker where they hold that much, for lights' maps come from
     * memory for every batch */
    const uint32_t share = ((points->count + workers - 1) / workers + 7) / 8 * 8;
    points_loop loop = {job, lights, points, batches, es_gi_kernel_table(es_context_isa(context)), share < ES_SHADE_LANES ? share : ES_SHADE_LANES};
    if (points->count) es_parallel_for(context, (points->count + loop.grain - 1) / loop.grain, 1, shade_points, &loop);
    return ES_OK;
}
