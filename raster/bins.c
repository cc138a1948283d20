/* Which records fall into which tile: a counting sort per chunk, then one over all chunks' segments. */
#include "raster/rasterizer.h"

/* May the triangle touch the tile? False only when the whole tile lies outside one edge. Exact in 64 bits (raster/limits.h). */
static bool touches(const es_large_triangle* t, uint32_t tile_x, uint32_t tile_y, uint32_t width, uint32_t height)
{
    int64_t x0 = (int64_t)tile_x * ES_TILE_SIZE * ES_SUBPIXELS + ES_SUBPIXELS / 2 - (int64_t)width * (ES_SUBPIXELS / 2);
    int64_t y0 = (int64_t)tile_y * ES_TILE_SIZE * ES_SUBPIXELS + ES_SUBPIXELS / 2 - (int64_t)height * (ES_SUBPIXELS / 2);
    const int64_t extent = (ES_TILE_SIZE - 1) * ES_SUBPIXELS;
    const int64_t x[3] = {t->x0, t->x1, t->x2}, y[3] = {t->y0, t->y1, t->y2};
    for (int i = 0; i < 3; i++) {
        int j = i < 2 ? i + 1 : 0;
        int64_t a = y[i] - y[j], b = x[j] - x[i];
        int64_t e = a * ((a > 0 ? x0 + extent : x0) - x[i]) + b * ((b > 0 ? y0 + extent : y0) - y[i]);
        if (e < 0) return false;
    }
    return true;
}

typedef struct list_state { es_raster_worker* worker; uint32_t touched_count, pairs; } list_state;

/* without a branch: whether a tile is new to the chunk cannot be predicted */
static inline void count_key(list_state* s, uint32_t key)
{
    uint32_t count = s->worker->key_count[key];
    s->worker->touched[s->touched_count] = key;
    s->touched_count += count == 0;
    s->worker->key_count[key] = count + 1;
    s->pairs++;
}

static inline bool one_tile(es_tile_rect r) { return r.x0 == r.x1 && r.y0 == r.y1; }

bool es_list_chunk(es_rasterizer* rasterizer, es_raster_worker* worker, const es_bin_job* job, bool masked, es_chunk* chunk)
{
    const uint32_t tiles_x = rasterizer->tiles_x, large_kind = masked ? ES_RECORDS_MASKED : ES_RECORDS_LARGE;
    uint32_t* const key_count = worker->key_count;
    list_state s = {worker, 0, 0};
    chunk->segments = NULL;
    chunk->segment_count = 0;
    for (uint32_t i = 0; i < job->small_count; i++) {
        es_tile_rect r = job->small_rects[i];
        if (one_tile(r)) {
            count_key(&s, (r.y0 * tiles_x + r.x0) * ES_RECORD_KINDS + ES_RECORDS_SMALL);
            continue;
        }
        for (uint32_t y = r.y0; y <= r.y1; y++)
            for (uint32_t x = r.x0; x <= r.x1; x++) count_key(&s, (y * tiles_x + x) * ES_RECORD_KINDS + ES_RECORDS_SMALL);
    }
    for (uint32_t i = 0; i < job->large_count; i++) {
        es_tile_rect r = job->large_rects[i];
        bool one_way = r.x0 == r.x1 || r.y0 == r.y1;
        for (uint32_t y = r.y0; y <= r.y1; y++)
            for (uint32_t x = r.x0; x <= r.x1; x++)
                if (one_way || touches(&job->large[i], x, y, job->width, job->height)) count_key(&s, (y * tiles_x + x) * ES_RECORD_KINDS + large_kind);
    }
    if (!s.pairs) return true;

    /* eight words of padding: the tile stage loads lists eight entries at a time */
    uint32_t* list = es_arena_allocate(&worker->arena, ((size_t)s.pairs + 8) * sizeof *list);
    es_segment* segments = es_arena_allocate(&worker->arena, s.touched_count * sizeof *segments);
    es_large_triangle* large = job->large_count ? es_arena_allocate(&worker->arena, job->large_count * sizeof *large) : NULL;
    if (!list || !segments || (job->large_count && !large)) {
        for (uint32_t i = 0; i < s.touched_count; i++) worker->key_count[worker->touched[i]] = 0;
        return false;
    }
    for (uint32_t i = 0; i < job->large_count; i++) large[i] = job->large[i];
    for (uint32_t i = 0, first = 0; i < s.touched_count; i++) {
        uint32_t key = worker->touched[i], count = worker->key_count[key];
        segments[i] = (es_segment){list + first, key % ES_RECORD_KINDS == ES_RECORDS_SMALL ? (const void*)job->small : large, count, key};
        worker->key_count[key] = first;
        first += count;
    }
    for (uint32_t i = 0; i < job->small_count; i++) {
        es_tile_rect r = job->small_rects[i];
        if (one_tile(r)) {
            list[key_count[(r.y0 * tiles_x + r.x0) * ES_RECORD_KINDS + ES_RECORDS_SMALL]++] = i;
            continue;
        }
        for (uint32_t y = r.y0; y <= r.y1; y++)
            for (uint32_t x = r.x0; x <= r.x1; x++) list[worker->key_count[(y * tiles_x + x) * ES_RECORD_KINDS + ES_RECORDS_SMALL]++] = i;
    }
    for (uint32_t i = 0; i < job->large_count; i++) {
        es_tile_rect r = job->large_rects[i];
        bool one_way = r.x0 == r.x1 || r.y0 == r.y1;
        for (uint32_t y = r.y0; y <= r.y1; y++)
            for (uint32_t x = r.x0; x <= r.x1; x++)
                if (one_way || touches(&job->large[i], x, y, job->width, job->height)) list[worker->key_count[(y * tiles_x + x) * ES_RECORD_KINDS + large_kind]++] = i;
    }
    for (uint32_t i = 0; i < s.touched_count; i++) worker->key_count[worker->touched[i]] = 0;
    chunk->segments = segments;
    chunk->segment_count = s.touched_count;
    return true;
}

bool es_order_segments(es_rasterizer* rasterizer)
{
    es_context* context = rasterizer->context;
    size_t keys = (size_t)rasterizer->tiles_x * rasterizer->tiles_y * ES_RECORD_KINDS, total = 0;
    for (uint32_t c = 0; c < rasterizer->chunk_count; c++) total += rasterizer->chunks[c].segment_count;
    if (!es_grow(context, (void**)&rasterizer->key_first, &rasterizer->key_first_capacity, 0, keys + 2, sizeof *rasterizer->key_first) ||
        !es_grow(context, (void**)&rasterizer->segments, &rasterizer->segment_capacity, 0, total, sizeof *rasterizer->segments))
        return false;
    /* key_first[k + 2] counts, then key_first[k + 1] is where key k's next segment goes, and ends as where key k + 1 begins */
    uint32_t* first = rasterizer->key_first;
    for (size_t k = 0; k < keys + 2; k++) first[k] = 0;
    rasterizer->segment_pairs = 0;
    for (uint32_t c = 0; c < rasterizer->chunk_count; c++)
        for (uint32_t i = 0; i < rasterizer->chunks[c].segment_count; i++) first[rasterizer->chunks[c].segments[i].key + 2]++;
    for (size_t k = 2; k < keys + 2; k++) first[k] += first[k - 1];
    for (uint32_t c = 0; c < rasterizer->chunk_count; c++)
        for (uint32_t i = 0; i < rasterizer->chunks[c].segment_count; i++) {
            const es_segment* segment = &rasterizer->chunks[c].segments[i];
            rasterizer->segments[first[segment->key + 1]++] = *segment;
            rasterizer->segment_pairs += segment->count;
        }
    uint64_t most = 0;
    for (size_t tile = 0; tile < keys / ES_RECORD_KINDS; tile++) {
        uint64_t records = 0;
        for (uint32_t i = first[tile * ES_RECORD_KINDS]; i < first[(tile + 1) * ES_RECORD_KINDS]; i++) records += rasterizer->segments[i].count;
        if (records > most) most = records;
    }
    if (most > INT32_MAX - 16) {
        es_fail(context, ES_INVALID_ARGUMENT, "%llu triangles meet in one tile of 64 x 64 pixels; fewer than 2^31 are supported", (unsigned long long)most);
        return false;
    }
    rasterizer->tile_records_max = (uint32_t)most;
    return true;
}
