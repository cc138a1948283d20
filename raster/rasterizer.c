/* Draws a list of instances into a view: runs the stages of raster/stages.h one after another, each in parallel. */
#include <string.h>

#include "raster/rasterizer.h"

enum { ARENA_BLOCK = 4 << 20 };

static void free_worker(es_context* context, es_raster_worker* w)
{
    es_arena_free(&w->arena);
    es_release(context, w->large, sizeof *w->large * ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX);
    es_release(context, w->large_rects, sizeof *w->large_rects * ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX);
    es_release(context, w->small_rects, sizeof *w->small_rects * ES_CHUNK_TRIANGLES);
    es_release(context, w->key_count, sizeof *w->key_count * w->key_capacity);
    es_release(context, w->touched, sizeof *w->touched * (w->key_capacity + 1));
    es_release(context, w->tile_depth, sizeof *w->tile_depth * (ES_TILE_WORDS + 8));
    es_release(context, w->tile_ceiling, sizeof *w->tile_ceiling * (ES_TILE_WORDS + 8));
    es_release(context, w->tile_number, sizeof *w->tile_number * (ES_TILE_FRONT + ES_TILE_WORDS + 8));
    es_release(context, w->visible, sizeof *w->visible * ES_TILE_VISIBLE_MAX);
    es_release(context, w->slot_number, sizeof *w->slot_number * ES_TILE_VISIBLE_MAX);
    es_release(context, w->slot_pixel, sizeof *w->slot_pixel * ES_TILE_VISIBLE_MAX);
    es_release(context, w->triangle_ids, sizeof *w->triangle_ids * w->number_capacity);
    es_release(context, w->slot, sizeof *w->slot * w->number_capacity);
}

es_result es_rasterizer_create(es_context* context, es_rasterizer** rasterizer)
{
    *rasterizer = NULL;
    es_rasterizer* r = es_allocate_zero(context, sizeof *r);
    if (!r) return es_context_last_result(context);
    r->context = context;
    r->kernels = es_raster_kernels_of(es_context_isa(context));
    r->worker_count = es_context_workers(context);
    r->workers = es_allocate_zero(context, r->worker_count * sizeof *r->workers);
    bool fine = r->workers != NULL;
    es_context_count_object(context, 1);
    for (uint32_t i = 0; fine && i < r->worker_count; i++) {
        es_raster_worker* w = &r->workers[i];
        es_arena_init(&w->arena, context, ARENA_BLOCK);
        fine = (w->large = es_allocate_array(context, ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX, sizeof *w->large)) &&
               (w->large_rects = es_allocate_array(context, ES_CHUNK_TRIANGLES * ES_CLIP_PIECES_MAX, sizeof *w->large_rects)) &&
               (w->small_rects = es_allocate_array(context, ES_CHUNK_TRIANGLES, sizeof *w->small_rects)) &&
               /* eight more: a row that begins in the last column of the last row ends beyond it */
               (w->tile_depth = es_allocate_array(context, ES_TILE_WORDS + 8, sizeof *w->tile_depth)) &&
               (w->tile_ceiling = es_allocate_array(context, ES_TILE_WORDS + 8, sizeof *w->tile_ceiling)) &&
               (w->tile_number = es_allocate_zero(context, sizeof *w->tile_number * (ES_TILE_FRONT + ES_TILE_WORDS + 8))) &&
               (w->visible = es_allocate_zero(context, sizeof *w->visible * ES_TILE_VISIBLE_MAX)) &&
               (w->slot_number = es_allocate_array(context, ES_TILE_VISIBLE_MAX, sizeof *w->slot_number)) &&
               (w->slot_pixel = es_allocate_array(context, ES_TILE_VISIBLE_MAX, sizeof *w->slot_pixel));
    }
    if (!fine) {
        es_rasterizer_destroy(r);
        return es_context_last_result(context);
    }
    /* the record of pixels that see nothing: at a distance that can be divided by */
    for (uint32_t i = 0; i < r->worker_count; i++) r->workers[i].visible[0].distance_low = r->workers[i].visible[0].distance_high = 1.0f;
    *rasterizer = r;
    return ES_OK;
}

void es_rasterizer_destroy(es_rasterizer* r)
{
    if (!r) return;
    es_context* context = r->context;
    for (uint32_t i = 0; r->workers && i < r->worker_count; i++) free_worker(context, &r->workers[i]);
    es_release(context, r->workers, r->worker_count * sizeof *r->workers);
    es_release(context, r->materials, r->material_capacity * sizeof *r->materials);
    es_release(context, r->instances, r->instance_capacity * sizeof *r->instances);
    es_release(context, r->chunk_instance, r->chunk_instance_capacity * sizeof *r->chunk_instance);
    es_release(context, r->chunks, r->chunk_capacity * sizeof *r->chunks);
    es_release(context, r->vertex_blocks, r->vertex_block_capacity * sizeof *r->vertex_blocks);
    es_release(context, r->snapped, r->snapped_capacity * sizeof *r->snapped);
    es_release(context, r->window, r->window_capacity * sizeof *r->window);
    es_release(context, r->deltas, r->delta_capacity * sizeof *r->deltas);
    es_release(context, r->segments, r->segment_capacity * sizeof *r->segments);
    es_release(context, r->key_first, r->key_first_capacity * sizeof *r->key_first);
    es_release(context, r, sizeof *r);
    es_context_count_object(context, -1);
}

typedef struct draw {
    es_rasterizer* rasterizer;
    const es_raster_view* view;
    es_resolve_job resolve;   /* G-buffer views */
    const es_depth_range* range; /* NULL: all */
    float* depth;             /* depth-only views */
    uint32_t stride;
} draw;

static void transform(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const draw* d = user;
    es_rasterizer* r = d->rasterizer;
    for (uint32_t b = begin; b < end; b++) {
        const es_vertex_block* block = &r->vertex_blocks[b];
        const es_prepared_instance* instance = &r->instances[block->instance];
        const es_raster_mesh* mesh = instance->mesh;
        const float* positions = mesh->positions + 4 * (size_t)block->first;
        size_t at = (size_t)instance->first_vertex + block->first;
        r->kernels->transform_vertices(positions, block->count, &instance->window, 0.5f * (float)d->view->width, 0.5f * (float)d->view->height, r->snapped + at,
            d->depth ? NULL : r->window + at);
        if (instance->has_deltas) {
            const float* previous = mesh->previous_positions ? mesh->previous_positions : mesh->positions;
            r->kernels->transform_deltas(positions, previous + 4 * (size_t)block->first, block->count, &instance->window, &instance->previous_window,
                r->deltas + instance->first_delta + block->first);
        }
    }
}

static void bin(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const draw* d = user;
    es_rasterizer* r = d->rasterizer;
    es_raster_worker* w = &r->workers[worker];
    for (uint32_t c = begin; c < end && !w->failed; c++) {
        es_chunk* chunk = &r->chunks[c];
        const es_prepared_instance* instance = &r->instances[chunk->instance];
        const size_t room = ES_CHUNK_TRIANGLES * sizeof(es_small_triangle);
        es_small_triangle* small = es_arena_allocate(&w->arena, room);
        if (!small) {
            w->failed = true;
            return;
        }
        es_bin_job job = {.vertices = r->snapped + instance->first_vertex, .indices = instance->mesh->indices + 3 * (size_t)chunk->first_triangle,
            .instance = instance, .count = chunk->triangle_count, .first_id = c << ES_CHUNK_BITS, .width = d->view->width, .height = d->view->height,
            .all_large = instance->material->alpha_mask, .small = small, .small_rects = w->small_rects, .large = w->large, .large_rects = w->large_rects};
        r->kernels->bin_triangles(&job);
        w->culled += job.culled;
        w->clipped += job.clipped;
        /* hand back what the last allocation did not need */
        w->arena.used -= room - (job.small_count * sizeof *small + 63) / 64 * 64;
        if (!es_list_chunk(r, w, &job, instance->material->alpha_mask, chunk)) w->failed = true;
    }
}

static void copy_depth(const draw* d, const es_tile* tile, es_raster_worker* w)
{
    uint32_t columns = d->stride - (uint32_t)tile->x < ES_TILE_SIZE ? d->stride - (uint32_t)tile->x : ES_TILE_SIZE;
    uint32_t rows = tile->height - (uint32_t)tile->y < ES_TILE_SIZE ? tile->height - (uint32_t)tile->y : ES_TILE_SIZE;
    uint32_t seen_columns = tile->width - (uint32_t)tile->x < ES_TILE_SIZE ? tile->width - (uint32_t)tile->x : ES_TILE_SIZE;
    for (uint32_t y = 0; y < rows; y++) {
        const float* row = tile->depth + y * ES_TILE_PITCH;
        memcpy(d->depth + ((size_t)tile->y + y) * d->stride + (uint32_t)tile->x, row, columns * sizeof *row);
        for (uint32_t x = 0; x < seen_columns; x++) w->pixels += row[x] > 0;
    }
}

/* A plane's part over a tile, and back: nothing lies past the view's last row and column. */
static void tile_from_plane(const es_tile* tile, const float* plane, uint32_t stride, float* to)
{
    const uint32_t columns = tile->width - (uint32_t)tile->x < ES_TILE_SIZE ? tile->width - (uint32_t)tile->x : ES_TILE_SIZE;
    const uint32_t rows = tile->height - (uint32_t)tile->y < ES_TILE_SIZE ? tile->height - (uint32_t)tile->y : ES_TILE_SIZE;
    memset(to, 0, ES_TILE_WORDS * sizeof *to);
    for (uint32_t y = 0; y < rows; y++) memcpy(to + y * ES_TILE_PITCH, plane + ((size_t)tile->y + y) * stride + (uint32_t)tile->x, columns * sizeof *to);
}
static void drawn_from_tile(const es_tile* tile, const es_depth_range* range)
{
    const uint32_t columns = tile->width - (uint32_t)tile->x < ES_TILE_SIZE ? tile->width - (uint32_t)tile->x : ES_TILE_SIZE;
    const uint32_t rows = tile->height - (uint32_t)tile->y < ES_TILE_SIZE ? tile->height - (uint32_t)tile->y : ES_TILE_SIZE;
    for (uint32_t y = 0; y < rows; y++) {
        float* to = range->drawn + ((size_t)tile->y + y) * range->stride + (uint32_t)tile->x;
        for (uint32_t x = 0; x < columns; x++) to[x] = tile->number[y * ES_TILE_PITCH + x] ? tile->depth[y * ES_TILE_PITCH + x] : 0.0f;
    }
}

static void draw_tiles(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const draw* d = user;
    es_rasterizer* r = d->rasterizer;
    es_raster_worker* w = &r->workers[worker];
    for (uint32_t t = begin; t < end; t++) {
        es_tile tile = {.depth = w->tile_depth, .number = d->depth ? NULL : w->tile_number + ES_TILE_FRONT, .triangle_ids = w->triangle_ids, .next_number = 1, .block_minimum = w->block_minimum,
            .x = (int32_t)(t % r->tiles_x) * ES_TILE_SIZE, .y = (int32_t)(t / r->tiles_x) * ES_TILE_SIZE, .width = d->view->width, .height = d->view->height,
            .chunks = r->chunks, .instances = r->instances};
        if (d->range && d->range->before) tile_from_plane(&tile, d->range->before, d->range->stride, tile.depth);
        else memset(tile.depth, 0, ES_TILE_WORDS * sizeof *tile.depth);
        if (d->range && d->range->behind) {
            tile_from_plane(&tile, d->range->behind, d->range->stride, w->tile_ceiling);
            tile.ceiling = w->tile_ceiling;
        }
        if (tile.number) memset(tile.number, 0, ES_TILE_WORDS * sizeof *tile.number);
        memset(w->block_minimum, 0, sizeof w->block_minimum);
        const uint32_t* first = r->key_first + (size_t)t * ES_RECORD_KINDS;
        for (uint32_t i = first[ES_RECORDS_LARGE]; i < first[ES_RECORDS_LARGE + 1]; i++) r->kernels->draw_large(&tile, &r->segments[i]);
        for (uint32_t i = first[ES_RECORDS_SMALL]; i < first[ES_RECORDS_SMALL + 1]; i++) r->kernels->draw_small(&tile, &r->segments[i]);
        for (uint32_t i = first[ES_RECORDS_MASKED]; i < first[ES_RECORDS_MASKED + 1]; i++) r->kernels->draw_masked(&tile, &r->segments[i]);
        w->hidden += tile.hidden;
        if (d->depth) {
            copy_depth(d, &tile, w);
        } else {
            es_resolve_job job = d->resolve;
            job.visible = w->visible;
            job.slot = w->slot;
            job.slot_number = w->slot_number;
            job.slot_pixel = w->slot_pixel;
            if (d->range && d->range->drawn) drawn_from_tile(&tile, d->range);
            r->kernels->resolve_tile(&job, &tile);
            w->pixels += job.pixels;
        }
    }
}

static es_result check(es_context* context, const es_draw_list* list, const es_raster_view* view)
{
    if (view->width < 1 || view->height < 1 || view->width > ES_RASTER_MAX_SIZE || view->height > ES_RASTER_MAX_SIZE)
        return es_misuse(context, ES_IMAGE_SIZE, "a view of %u x %u pixels; 1 to %d each way are supported", view->width, view->height, ES_RASTER_MAX_SIZE);
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        if (instance->material >= list->material_count || instance->material > 0xffff)
            return es_misuse(context, ES_INVALID_ARGUMENT, "instance %u of the draw list names material %u of %u (65536 at most)", i, instance->material, list->material_count);
        if (instance->mesh && instance->mesh->triangle_count && (!instance->mesh->positions || !instance->mesh->indices))
            return es_misuse(context, ES_INVALID_ARGUMENT, "instance %u of the draw list: its mesh has triangles but no positions or indices", i);
    }
    return ES_OK;
}

/* Room for every worker to number the records of the fullest tile. */
static bool reserve_numbers(es_rasterizer* r)
{
    es_context* context = r->context;
    const size_t needed = (size_t)r->tile_records_max + 16, room = needed + needed / 4; /* the next frame may need a little more */
    for (uint32_t i = 0; i < r->worker_count; i++) {
        es_raster_worker* w = &r->workers[i];
        if (w->number_capacity >= needed) continue;
        es_release(context, w->triangle_ids, sizeof *w->triangle_ids * w->number_capacity);
        es_release(context, w->slot, sizeof *w->slot * w->number_capacity);
        w->number_capacity = 0;
        w->slot = NULL;
        if (!(w->triangle_ids = es_allocate_zero(context, sizeof *w->triangle_ids * room))) return false;
        if (!(w->slot = es_allocate_zero(context, sizeof *w->slot * room))) {
            es_release(context, w->triangle_ids, sizeof *w->triangle_ids * room);
            w->triangle_ids = NULL;
            return false;
        }
        w->number_capacity = room;
    }
    return true;
}

static bool run_stages(draw* d, const es_draw_list* list, uint32_t planes, es_raster_stats* stats)
{
    es_rasterizer* r = d->rasterizer;
    es_context* context = r->context;
    const es_raster_view* view = d->view;
    r->tiles_x = (view->width + ES_TILE_SIZE - 1) / ES_TILE_SIZE;
    r->tiles_y = (view->height + ES_TILE_SIZE - 1) / ES_TILE_SIZE;
    size_t keys = (size_t)r->tiles_x * r->tiles_y * ES_RECORD_KINDS;
    for (uint32_t i = 0; i < r->worker_count; i++) {
        es_raster_worker* w = &r->workers[i];
        es_arena_reset(&w->arena);
        w->culled = w->clipped = w->hidden = w->pixels = 0;
        w->failed = false;
        if (w->key_capacity < keys) {
            es_release(context, w->key_count, sizeof *w->key_count * w->key_capacity);
            es_release(context, w->touched, sizeof *w->touched * (w->key_capacity + 1));
            w->key_capacity = 0;
            w->touched = NULL;
            if (!(w->key_count = es_allocate_zero(context, keys * sizeof *w->key_count))) return false;
            if (!(w->touched = es_allocate(context, (keys + 1) * sizeof *w->touched))) {
                es_release(context, w->key_count, keys * sizeof *w->key_count);
                w->key_count = NULL;
                return false;
            }
            w->key_capacity = keys;
        }
    }
    es_view_matrices matrices = es_view_matrices_of(view);
    if (!es_prepare_materials(r, list) || !es_prepare_instances(r, list, view, &matrices, planes)) return false;
    es_resolve_job* job = &d->resolve;
    job->instances = r->instances;
    job->chunk_instance = r->chunk_instance;
    job->vertices = r->window;
    job->deltas = r->deltas;
    job->orthographic = matrices.orthographic;
    for (int i = 0; i < 4; i++) {
        job->row_x[i] = (float)matrices.window[i];
        job->row_y[i] = (float)matrices.window[4 + i];
        job->row_z[i] = (float)matrices.window[8 + i];
        job->row_w[i] = (float)matrices.window[12 + i];
    }
    /* orthographic z = p[10] * eye z + p[14], distance = -eye z */
    double slope = view->projection.m[10] != 0 ? view->projection.m[10] : 1;
    job->distance_scale = (float)(-1.0 / slope);
    job->distance_offset = (float)(view->projection.m[14] / slope);
    job->z_scale = -view->projection.m[10];
    job->z_offset = view->projection.m[14];

    es_parallel_for(context, r->vertex_block_count, 4, transform, d);
    es_parallel_for(context, r->chunk_count, 1, bin, d);
    bool failed = false;
    for (uint32_t i = 0; i < r->worker_count; i++) failed |= r->workers[i].failed;
    if (failed || !es_order_segments(r)) return false;
    if (planes && !reserve_numbers(r)) return false;
    es_parallel_for(context, r->tiles_x * r->tiles_y, 1, draw_tiles, d);

    if (stats) {
        *stats = (es_raster_stats){.instances = r->instance_count, .instances_culled = r->instances_culled, .triangles = r->triangle_count, .tile_triangles = r->segment_pairs};
        for (uint32_t i = 0; i < r->worker_count; i++) {
            stats->triangles_culled += r->workers[i].culled;
            stats->triangles_clipped += r->workers[i].clipped;
            stats->tile_triangles_hidden += r->workers[i].hidden;
            stats->pixels += r->workers[i].pixels;
        }
    }
    return true;
}

es_result es_draw_gbuffer(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, es_gbuffer* gbuffer, es_raster_stats* stats)
{
    return es_draw_gbuffer_between(rasterizer, list, view, NULL, gbuffer, stats);
}

es_result es_draw_gbuffer_between(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, const es_depth_range* range, es_gbuffer* gbuffer, es_raster_stats* stats)
{
    es_context* context = rasterizer->context;
    es_result result = check(context, list, view);
    if (result != ES_OK) return result;
    if (gbuffer->width != view->width || gbuffer->height != view->height)
        return es_misuse(context, ES_INVALID_ARGUMENT, "a view of %u x %u pixels cannot be drawn into a G-buffer of %u x %u; the sizes must be equal", view->width,
            view->height, gbuffer->width, gbuffer->height);
    if (!gbuffer->planes || !gbuffer->memory) return es_misuse(context, ES_INVALID_ARGUMENT, "the G-buffer has no planes; create it with es_gbuffer_create");
    if (range && (range->stride < view->width || range->stride % 8))
        return es_misuse(context, ES_INVALID_ARGUMENT, "depth rows of %u floats for a view %u pixels wide; a multiple of 8, at least the width, is accepted", range->stride, view->width);
    es_fp_environment environment = es_fp_enter();
    draw d = {.rasterizer = rasterizer, .view = view, .range = range, .resolve.gbuffer = *gbuffer};
    bool drawn = run_stages(&d, list, gbuffer->planes, stats);
    es_fp_leave(environment);
    return drawn ? ES_OK : es_context_last_result(context);
}

es_result es_draw_depth(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, float* depth, uint32_t stride, es_raster_stats* stats)
{
    es_context* context = rasterizer->context;
    es_result result = check(context, list, view);
    if (result != ES_OK) return result;
    if (!depth || stride < view->width || stride % 8)
        return es_misuse(context, ES_INVALID_ARGUMENT, "depth rows of %u floats for a view %u pixels wide; a multiple of 8, at least the width, is accepted", stride, view->width);
    es_fp_environment environment = es_fp_enter();
    draw d = {.rasterizer = rasterizer, .view = view, .depth = depth, .stride = stride};
    bool drawn = run_stages(&d, list, 0, stats);
    es_fp_leave(environment);
    return drawn ? ES_OK : es_context_last_result(context);
}
