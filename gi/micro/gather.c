/* Gather points in the order of a space-filling curve, in cells that share what is far and cuts (Ritschel thesis §6.3.1), to the kernel. */
#include "gi/micro/gather.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"

/* Shirley and Chiu 1997; (u, v) is not 0. */
static void disc_of(float u, float v, float* x, float* y)
{
    const bool wide = es_absf(u) >= es_absf(v);
    const float rho = wide ? u : v;
    float sine, cosine;
    es_sincos(0.25f * ES_PI * (wide ? v / u : u / v), &sine, &cosine);
    *x = rho * (wide ? cosine : sine);
    *y = rho * (wide ? sine : cosine);
}

static float middle(uint32_t i, uint32_t count) { return ((float)i + 0.5f) * (2.0f / (float)count) - 1.0f; }

static void fill_table(uint32_t size, es_micro_table* table)
{
    *table = (es_micro_table){.size = size, .stride = es_micro_stride(size)};
    for (uint32_t j = 0; j < ES_MICRO_JITTERS; j++) {
        es_micro_rays* rays = &table->rays[j];
        /* multiples of the two irrational steps of Roberts (2018) */
        for (int k = 0; k < 2; k++) rays->shift[k] = (float)((j + 1) * (k ? 2447445414u : 3242174889u) >> 8) * (0.96f / 16777216.0f) - 0.48f;
        for (uint32_t row = 0; row < size; row++)
            for (uint32_t column = 0; column < size; column++) {
                const uint32_t at = row * table->stride + column;
                disc_of(middle(column, size) + rays->shift[0] * (2.0f / (float)size), middle(row, size) + rays->shift[1] * (2.0f / (float)size), &rays->x[at], &rays->y[at]);
                rays->z[at] = es_sqrt(es_maxf(1.0f - rays->x[at] * rays->x[at] - rays->y[at] * rays->y[at], 0.0f));
                const float a = 1.0f - rays->z[at], a2 = a * a;
                rays->interface[at] = 0.04f + 0.96f * (a2 * a2 * a);
            }
    }
    for (uint32_t i = 0; i < ES_MICRO_GRID; i++)
        for (uint32_t j = 0; j < ES_MICRO_GRID; j++) {
            const uint32_t at = i * ES_MICRO_GRID + j, last = ES_MICRO_GRID - 1, side = i == 0 || j == 0 || i == last || j == last ? 2 : 1;
            table->grid[at].count = side * side;
            for (uint32_t k = 0; k < side * side; k++) disc_of(middle(i * side + k / side, ES_MICRO_GRID * side), middle(j * side + k % side, ES_MICRO_GRID * side), &table->grid[at].x[k], &table->grid[at].y[k]);
        }
}

/* ---- order -------------------------------------------------------------------------------------------------------------------- */

typedef struct keyed { uint32_t key, index; } keyed;

/* Every third bit from the lowest 10. */
static uint32_t spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

typedef struct keying { const es_gather_point* points; const es_micro_settings* settings; keyed* keys; float low[3], scale; } keying;

/* The mapping first, as a cell has one; then the side of a cube that the normal is nearest to, since points in a cell should look the same
 * way; then the place. */
static void make_keys(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const keying* job = user;
    for (uint32_t i = begin; i < end; i++) {
        const es_gather_point* p = &job->points[i];
        const float x = es_absf(p->normal[0]), y = es_absf(p->normal[1]), z = es_absf(p->normal[2]);
        const uint32_t axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2, side = axis * 2 + (p->normal[axis] < 0.0f), sort = (uint32_t)es_micro_mapping_of(p, job->settings);
        uint32_t code = 0;
        for (int k = 0; k < 3; k++) code |= spread((uint32_t)es_clampf((p->position[k] - job->low[k]) * job->scale, 0.0f, 511.0f)) << k;
        job->keys[i] = (keyed){sort << 30 | side << 27 | code, i};
    }
}

/* By the key, in order of index within it. */
static void sort_keys(keyed* keys, keyed* other, size_t count)
{
    enum { BITS = 11, BUCKETS = 1 << BITS };
    for (int shift = 0; shift < 33; shift += BITS) {
        uint32_t starts[BUCKETS] = {0}, sum = 0;
        for (size_t i = 0; i < count; i++) starts[keys[i].key >> shift & (BUCKETS - 1)]++;
        for (uint32_t b = 0; b < BUCKETS; b++) {
            const uint32_t here = starts[b];
            starts[b] = sum;
            sum += here;
        }
        for (size_t i = 0; i < count; i++) other[starts[keys[i].key >> shift & (BUCKETS - 1)]++] = keys[i];
        keyed* swapped = keys;
        keys = other;
        other = swapped;
    }
}

/* Fills `order`, and `ends` with where each sort ends. */
static es_result find_order(es_context* context, const es_micro_settings* settings, const es_gather_point* points, uint32_t count, uint32_t* order, uint32_t ends[3])
{
    keying job = {.points = points, .settings = settings, .scale = 1.0f};
    keyed* keys = es_allocate_array(context, 2 * (size_t)count, sizeof *keys);
    if (!keys) return es_context_last_result(context);
    float high[3] = {0}, extent = 0.0f;
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            const float x = points[i].position[k];
            job.low[k] = i ? es_minf(x, job.low[k]) : x;
            high[k] = i ? es_maxf(x, high[k]) : x;
        }
    for (int k = 0; k < 3; k++) extent = es_maxf(extent, high[k] - job.low[k]);
    if (extent > 0.0f) job.scale = 511.99f / extent;
    job.keys = keys;
    es_parallel_for(context, count, 4096, make_keys, &job);
    sort_keys(keys, keys + count, count); /* three turns: the result is in the second half */
    ends[0] = ends[1] = ends[2] = count;
    for (uint32_t i = count; i-- > 0;) {
        const keyed k = keys[count + i];
        order[i] = k.index;
        for (uint32_t sort = 0; sort < k.key >> 30; sort++) ends[sort] = i;
    }
    es_release(context, keys, 2 * (size_t)count * sizeof *keys);
    return ES_OK;
}

/* ---- groups --------------------------------------------------------------------------------------------------------------------- */

typedef struct gathering {
    es_micro_job job;
    const es_gi_kernels* kernels;
    es_micro_scratch* scratch;      /* one a worker */
    uint32_t ends[ES_MICRO_MAPPINGS], cells_before[ES_MICRO_MAPPINGS + 1];
} gathering;

static void gather_cells(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    gathering* g = user;
    for (uint32_t i = begin; i < end; i++) {
        uint32_t sort = 0;
        while (i >= g->cells_before[sort + 1]) sort++;
        const uint32_t first = (sort ? g->ends[sort - 1] : 0) + (i - g->cells_before[sort]) * ES_MICRO_CELL, left = g->ends[sort] - first;
        g->kernels->micro_gather(&g->job, first, left < ES_MICRO_CELL ? left : ES_MICRO_CELL, &g->scratch[worker]);
    }
}

static float extent_of(const es_point_forest* forest)
{
    return forest->tree_count ? es_maxf(2.0f * forest->radius, 1e-9f) : 1.0f;
}

static es_result gather(es_context* context, const es_point_forest* forest, const es_micro_settings* settings, const es_gather_point* points, uint32_t count, float* const result[3], es_micro_stats* stats, es_micro_pixel* picture)
{
    const uint32_t workers = es_context_workers(context);
    const size_t trees_all = (size_t)workers * forest->tree_count;
    es_micro_table* table = es_allocate(context, sizeof *table);
    uint32_t* order = table ? es_allocate_array(context, count, sizeof *order) : NULL; /* each failure is one message */
    es_micro_scratch* scratch = order ? es_allocate_array(context, workers, sizeof *scratch) : NULL;
    uint32_t* trees = scratch ? es_allocate_array(context, trees_all, sizeof *trees) : NULL;
    es_result made = table && order && scratch && trees ? ES_OK : es_context_last_result(context);
    gathering g = {.kernels = es_gi_kernel_table(es_context_isa(context)), .scratch = scratch};
    if (!made) made = find_order(context, settings, points, count, order, g.ends);
    if (!made) {
        const float extent = extent_of(forest);
        fill_table(settings->size, table);
        g.job = (es_micro_job){.forest = forest, .settings = *settings, .table = table, .points = points, .order = order, .inverse_square = 1.0f / (extent * extent), .result = {result[0], result[1], result[2]},
            .picture = picture};
        for (uint32_t i = 0; i < workers; i++) {
            scratch[i].stats = (es_micro_stats){0};
            scratch[i].trees = trees + (size_t)i * forest->tree_count;
        }
        for (int sort = 0; sort < ES_MICRO_MAPPINGS; sort++)
            g.cells_before[sort + 1] = g.cells_before[sort] + (g.ends[sort] - (sort ? g.ends[sort - 1] : 0) + ES_MICRO_CELL - 1) / ES_MICRO_CELL;
        es_parallel_for(context, g.cells_before[ES_MICRO_MAPPINGS], 1, gather_cells, &g);
        for (uint32_t i = 0; stats && i < workers; i++) {
            stats->samples += scratch[i].stats.samples;
            stats->drawn += scratch[i].stats.drawn;
            stats->cast += scratch[i].stats.cast;
        }
    }
    es_release(context, trees, trees_all * sizeof *trees);
    es_release(context, scratch, workers * sizeof *scratch);
    es_release(context, order, count * sizeof *order);
    es_release(context, table, sizeof *table);
    return made;
}

es_result es_micro_gather(es_context* context, const es_point_forest* forest, const es_micro_settings* settings, const es_gather_point* points, size_t count, float* const result[3], es_micro_stats* stats)
{
    if (count > 0x7fffffffu) return es_fail(context, ES_INVALID_ARGUMENT, "light is gathered at up to 2^31 - 1 points at once; these are %zu", count);
    if (stats) *stats = (es_micro_stats){0};
    if (!count) return ES_OK;
    if (forest->tree_count) return gather(context, forest, settings, points, (uint32_t)count, result, stats, NULL);
    for (int k = 0; k < 3; k++) memset(result[k], 0, count * sizeof(float));
    return ES_OK;
}

es_result es_micro_look(es_context* context, const es_point_forest* forest, const es_micro_settings* settings, const es_gather_point* point, es_micro_pixel* pixels)
{
    float sums[3];
    float* const result[3] = {&sums[0], &sums[1], &sums[2]};
    if (forest->tree_count) return gather(context, forest, settings, point, 1, result, NULL, pixels);
    for (uint32_t i = 0; i < settings->size * settings->size; i++) pixels[i] = (es_micro_pixel){.node = UINT32_MAX};
    return ES_OK;
}
