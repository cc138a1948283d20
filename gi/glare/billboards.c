#include "gi/glare/billboards.h"

#include "gi/kernel_table.h"
#include "platform/context.h"

void es_glare_billboards_free(es_context* context, es_glare_billboards* b)
{
    es_release(context, b->tiles, b->tile_bytes);
    es_release(context, b->chosen, b->chosen_bytes);
    *b = (es_glare_billboards){0};
}

static es_result reserve(es_context* context, uint32_t tiles, es_glare_billboards* b)
{
    if (b->tiles && b->tile_count == tiles) return ES_OK;
    es_glare_billboards_free(context, b);
    b->tiles = es_allocate_array(context, tiles, sizeof *b->tiles);
    if (!b->tiles) return es_context_last_result(context);
    b->tile_bytes = tiles * sizeof *b->tiles;
    b->tile_count = tiles;
    b->chosen_bytes = ES_GLARE_MAX_BILLBOARDS * sizeof *b->chosen;
    b->chosen = es_allocate(context, b->chosen_bytes);
    if (b->chosen) return ES_OK;
    b->chosen_bytes = 0;
    es_glare_billboards_free(context, b);
    return es_context_last_result(context);
}

/* Does tile a give away less than b? Of two that give the same the later one gives less. */
static bool less(const es_glare_tile* tiles, uint32_t a, uint32_t b) { return tiles[a].luminance != tiles[b].luminance ? tiles[a].luminance < tiles[b].luminance : a > b; }

static void sink(const es_glare_tile* tiles, uint32_t* heap, uint32_t at, uint32_t count)
{
    for (;;) {
        uint32_t child = 2 * at + 1;
        if (child >= count) return;
        if (child + 1 < count && less(tiles, heap[child + 1], heap[child])) child++;
        if (!less(tiles, heap[child], heap[at])) return;
        const uint32_t other = heap[at];
        heap[at] = heap[child];
        heap[child] = other;
        at = child;
    }
}

/* The `most` of them that give most: a heap with the least of them on top. */
static void choose(es_glare_billboards* b, uint32_t most)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->tile_count && most; i++) {
        b->tiles[i].chosen = false;
        if (!(b->tiles[i].luminance > 0)) continue;
        if (count < most) {
            b->chosen[count++] = i;
            if (count == most)
                for (uint32_t k = count / 2; k-- > 0;) sink(b->tiles, b->chosen, k, count);
        } else if (less(b->tiles, b->chosen[0], i)) {
            b->chosen[0] = i;
            sink(b->tiles, b->chosen, 0, count);
        }
    }
    for (uint32_t k = 0; k < count; k++) b->tiles[b->chosen[k]].chosen = true;
    b->count = 0;
    for (uint32_t i = 0; i < b->tile_count && count; i++)
        if (b->tiles[i].chosen) b->chosen[b->count++] = i;
}

typedef struct billboard_loop { const es_gi_kernels* kernels; const es_glare_billboard_job* job; } billboard_loop;

static void tile_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const billboard_loop* loop = user;
    loop->kernels->billboard_tiles(loop->job, begin, end);
}

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const billboard_loop* loop = user;
    loop->kernels->billboard_rows(loop->job, begin, end);
}

/* Share of the spectrum that lands in the picture from (x, y). */
static double inside(const es_glare_spectrum* s, int channel, uint32_t x, uint32_t y, uint32_t width, uint32_t height)
{
    const uint32_t left = x < s->reach_x ? x : s->reach_x, right = width - 1 - x < s->reach_x ? width - 1 - x : s->reach_x;
    const uint32_t up = y < s->reach_y ? y : s->reach_y, down = height - 1 - y < s->reach_y ? height - 1 - y : s->reach_y;
    double sum = 0;
    for (uint32_t v = s->reach_y - up; v <= s->reach_y + down; v++) {
        float row = 0;
        for (uint32_t u = s->reach_x - left; u <= s->reach_x + right; u++) row += s->at[channel][v * s->stride + u];
        sum += (double)row;
    }
    return sum;
}

es_result es_glare_add_billboards(es_context* context, const es_glare_spectrum* spectrum, float threshold, uint32_t most, const float* const from[3], float* const to[3], uint32_t width, uint32_t height, uint32_t stride, es_glare_billboards* b)
{
    const uint32_t columns = (width + ES_GLARE_TILE - 1) / ES_GLARE_TILE, tile_lines = (height + ES_GLARE_TILE - 1) / ES_GLARE_TILE;
    es_result result = reserve(context, columns * tile_lines, b);
    if (result) return result;
    es_glare_billboard_job job = {.width = width, .height = height, .stride = stride, .threshold = threshold, .tiles = b->tiles, .tile_columns = columns, .spectrum = spectrum};
    for (int k = 0; k < 3; k++) {
        job.from[k] = from[k];
        job.to[k] = to[k];
    }
    billboard_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job};
    es_parallel_for(context, tile_lines, 1, tile_rows, &loop);
    choose(b, most < ES_GLARE_MAX_BILLBOARDS ? most : ES_GLARE_MAX_BILLBOARDS);
    es_glare_billboard* billboards = es_allocate_array(context, b->count, sizeof *billboards);
    if (!billboards) return es_context_last_result(context);
    double whole[3];
    for (int k = 0; k < 3; k++) whole[k] = inside(spectrum, k, spectrum->reach_x, spectrum->reach_y, 2 * spectrum->reach_x + 1, 2 * spectrum->reach_y + 1);
    for (uint32_t i = 0; i < b->count; i++) {
        const es_glare_tile* tile = &b->tiles[b->chosen[i]];
        const bool within = tile->x >= spectrum->reach_x && tile->x + spectrum->reach_x < width && tile->y >= spectrum->reach_y && tile->y + spectrum->reach_y < height;
        billboards[i] = (es_glare_billboard){.x = tile->x, .y = tile->y};
        for (int k = 0; k < 3; k++) {
            billboards[i].light[k] = tile->light[k];
            billboards[i].stays[k] = (float)((double)tile->light[k] * (1 - (within ? whole[k] : inside(spectrum, k, tile->x, tile->y, width, height))));
        }
    }
    job.billboards = billboards;
    job.count = b->count;
    es_parallel_for(context, height, 16, rows, &loop);
    es_release(context, billboards, b->count * sizeof *billboards);
    return ES_OK;
}
