#include "gi/micro/pixels.h"

#include <string.h>

#include "gi/edit/turn.h"
#include "gi/lit.h"
#include "gi/micro/gather.h"
#include "gi/surface.h"
#include "platform/random.h"
#include "raster/pack.h"

/* Points that are gathered at together, at the most but for one row more: their memory, about 100 bytes each, does not grow with the image. */
enum { BATCH = 1 << 18 };

typedef struct pixel_loop {
    const es_micro_pixels* pixels;
    uint32_t width;
    uint32_t* counts;           /* of all rows */
    uint32_t first_row;         /* of the batch; `before` is of its rows */
    const uint32_t* before;
    es_gather_point* points;
    uint32_t* columns;
    float* result[3];
} pixel_loop;

static bool wanted(const es_micro_pixels* p, const es_surface* s)
{
    return p->kind == ES_GATHER_LOBE ? es_surface_has_lobe(s) : es_maxf(s->albedo.x, es_maxf(s->albedo.y, s->albedo.z)) > 0.0f;
}

static bool surface_at(const es_micro_pixels* p, uint32_t x, uint32_t y, es_surface* s)
{
    const es_gbuffer* g = p->gbuffer;
    if (p->listed && !(p->listed[(size_t)y * es_micro_list_stride(g->width) + x / 8] >> x % 8 & 1)) return false;
    const size_t at = (size_t)y * p->spacing * g->stride + (size_t)x * p->spacing;
    if (!(g->depth[at] > 0.0f)) return false;
    *s = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    return wanted(p, s);
}

static void count_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pixel_loop* loop = user;
    es_surface s;
    for (uint32_t y = begin; y < end; y++) {
        uint32_t count = 0;
        for (uint32_t x = 0; x < loop->width; x++) count += surface_at(loop->pixels, x, y, &s);
        loop->counts[y] = count;
    }
}

static void put(float to[3], es_vec3 from)
{
    to[0] = from.x;
    to[1] = from.y;
    to[2] = from.z;
}

static void turn(es_gather_point* point, es_vec3 edited)
{
    if (!(es_v3_dot(edited, edited) > 0.0f)) return;
    const es_vec3 r = es_micro_mirror(point);
    put(point->normal, es_turned(es_v3(point->normal[0], point->normal[1], point->normal[2]), r, edited));
    put(point->view, es_turned(es_v3(point->view[0], point->view[1], point->view[2]), r, edited));
}

/* Pixel (x, y) of the whole image. */
static es_gather_point point_of(const es_micro_pixels* p, uint32_t x, uint32_t y, const es_surface* s)
{
    const es_gbuffer* g = p->gbuffer;
    const size_t at = (size_t)y * g->stride + x;
    es_gather_point point = {.roughness = s->roughness, .model = s->model, .kind = p->kind};
    const float fx = (float)x, fy = (float)y;
    const es_vec3 n = es_unpack_normal(g->normal[at]), d = es_pixel_rays_direction(&p->rays, fx, fy);
    es_vec3 v = es_v3_scale(d, -1.0f / es_sqrt(es_v3_dot(d, d)));
    /* as es_lift_to_horizon_v has it */
    v = es_v3_add(v, es_v3_scale(n, es_maxf(1e-3f - es_v3_dot(n, v), 0.0f)));
    v = es_v3_scale(v, 1.0f / es_sqrt(es_v3_dot(v, v)));
    put(point.position, es_pixel_rays_position(&p->rays, fx, fy, g->depth[at]));
    put(point.normal, n);
    put(point.view, v);
    if (p->kind == ES_GATHER_LOBE && p->edited[0]) turn(&point, es_v3(p->edited[0][at], p->edited[1][at], p->edited[2][at]));
    put(point.f0, s->specular);
    point.seed = es_random_u32(p->seed, 2 * (y * ES_RASTER_MAX_SIZE + x) + p->kind);
    return point;
}

bool es_micro_pixel_point(const es_micro_pixels* pixels, uint32_t x, uint32_t y, es_gather_point* point)
{
    es_surface s;
    if (!surface_at(pixels, x, y, &s)) return false;
    *point = point_of(pixels, x * pixels->spacing, y * pixels->spacing, &s);
    return true;
}

static void make_points(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pixel_loop* loop = user;
    const es_micro_pixels* p = loop->pixels;
    es_surface s;
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t y = loop->first_row + i;
        uint32_t k = loop->before[i];
        for (uint32_t x = 0; x < loop->width && k < loop->before[i + 1]; x++)
            if (surface_at(p, x, y, &s)) {
                loop->columns[k] = x;
                loop->points[k++] = point_of(p, x * p->spacing, y * p->spacing, &s);
            }
    }
}

static void put_results(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pixel_loop* loop = user;
    const es_micro_pixels* p = loop->pixels;
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t y = loop->first_row + i;
        const size_t row = (size_t)y * p->stride;
        uint8_t* lit = p->lit ? p->lit + (size_t)y * es_lit_chunks(p->stride) : NULL;
        if (lit && !p->listed) memset(lit, 0, es_lit_chunks(p->stride));
        for (int c = 0; c < 3 && !p->listed; c++) memset(p->result[c] + row, 0, p->stride * sizeof(float));
        for (uint32_t k = loop->before[i]; k < loop->before[i + 1]; k++) {
            for (int c = 0; c < 3; c++) p->result[c][row + loop->columns[k]] = loop->result[c][k];
            if (lit) lit[loop->columns[k] / ES_LIT_COLUMNS] = 1;
        }
    }
}

es_result es_micro_gather_pixels(es_context* context, es_arena* arena, const es_point_forest* forest, const es_micro_settings* settings, const es_micro_pixels* p, es_micro_stats* stats, uint64_t* gathered)
{
    const es_gbuffer* g = p->gbuffer;
    const uint32_t width = es_micro_sparse(g->width, p->spacing), height = es_micro_sparse(g->height, p->spacing);
    pixel_loop loop = {.pixels = p, .width = width};
    uint32_t most = 0, *before = es_arena_allocate(arena, ((size_t)height + 1) * sizeof *before);
    loop.counts = before ? es_arena_allocate(arena, height * sizeof *loop.counts) : NULL;
    if (!loop.counts) return es_context_last_result(context);
    es_parallel_for(context, height, 8, count_rows, &loop);
    for (uint32_t y = 0, sum = 0; y < height; y++) { /* no batch is larger */
        sum = sum + loop.counts[y] > BATCH ? loop.counts[y] : sum + loop.counts[y];
        most = sum > most ? sum : most;
    }
    const size_t room = most ? most : 1;
    loop.points = es_arena_allocate(arena, room * sizeof *loop.points);
    loop.columns = loop.points ? es_arena_allocate(arena, room * sizeof *loop.columns) : NULL;
    for (int c = 0; c < 3 && loop.columns; c++)
        if (!(loop.result[c] = es_arena_allocate(arena, room * sizeof(float)))) loop.columns = NULL;
    if (!loop.columns) return es_context_last_result(context);
    loop.before = before;
    for (uint32_t y = 0, rows; y < height; y += rows) {
        before[0] = 0;
        for (rows = 0; y + rows < height && (!before[rows] || before[rows] + loop.counts[y + rows] <= BATCH); rows++) before[rows + 1] = before[rows] + loop.counts[y + rows];
        loop.first_row = y;
        const uint32_t count = before[rows];
        es_parallel_for(context, rows, 4, make_points, &loop);
        es_micro_stats batch = {0};
        es_result result = es_micro_gather(context, forest, settings, loop.points, count, loop.result, &batch);
        if (result) return result;
        es_parallel_for(context, rows, 8, put_results, &loop);
        stats->samples += batch.samples;
        stats->drawn += batch.drawn;
        stats->cast += batch.cast;
        *gathered += count;
    }
    return ES_OK;
}
