#include "gi/scene_points.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "gi/rest_area.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"

/* ---- areas ------------------------------------------------------------------------------------------------------------------ */

static double root(double x) { return x > 0.0 ? __builtin_sqrt(x) : 0.0; }

typedef struct measuring { const es_raster_mesh* mesh; const double* gram; double *rest, *now; } measuring;

static void measure(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const measuring* job = user;
    const es_raster_mesh* mesh = job->mesh;
    for (uint32_t t = begin; t < end; t++) {
        job->rest[t] = es_area_by_gram(mesh->rest_positions ? mesh->rest_positions : mesh->positions, mesh->indices + 3 * (size_t)t, job->gram);
        if (mesh->rest_positions) job->now[t] = es_area_by_gram(mesh->positions, mesh->indices + 3 * (size_t)t, job->gram);
    }
}

/* What each triangle weighs: its area at rest, and of what it has changed beyond ES_POINTS_STRETCH the excess. `shares` has room for twice
 * as many numbers as there are triangles. */
static void weigh_triangles(es_context* context, const es_raster_mesh* mesh, es_point_source* source, double* shares)
{
    double rest_area = 0.0, area = 0.0, *areas = shares + mesh->triangle_count;
    measuring job = {mesh, source->gram, shares, areas};
    es_parallel_for(context, mesh->triangle_count, 2048, measure, &job);
    for (uint32_t t = 0; t < mesh->triangle_count; t++) rest_area += shares[t];
    source->strong = false;
    if (mesh->rest_positions) {
        for (uint32_t t = 0; t < mesh->triangle_count; t++) area += areas[t];
        const double scale = area > 0.0 && rest_area > 0.0 ? rest_area / area : 0.0;
        for (uint32_t t = 0; t < mesh->triangle_count && scale > 0.0; t++) {
            const double now = areas[t] * scale, least = shares[t] / ES_POINTS_STRETCH, most = shares[t] * ES_POINTS_STRETCH;
            if (now > most) shares[t] = now / ES_POINTS_STRETCH;
            else if (now < least) shares[t] = now * ES_POINTS_STRETCH;
            else continue;
            source->strong = true;
        }
        /* the whole: in steps of four, and not before it is beyond two */
        for (; area > 2.0 * rest_area && rest_area > 0.0; rest_area *= 4.0) {}
        for (; area < 0.5 * rest_area && area > 0.0; rest_area *= 0.25) {}
    }
    source->rest_area = rest_area;
    source->areas = es_hash_bytes(mesh->triangle_count, shares, mesh->triangle_count * sizeof *shares);
}

/* ---- shares of the objects ------------------------------------------------------------------------------------------------------- */

static double weight_of(const es_point_source* source, double largest, float detail)
{
    double weight = source->point_weight == 0.0f ? 1.0 : (double)source->point_weight;
    if (!(weight > 0.0) || !(source->rest_area > 0.0)) return 0.0;
    if (detail > 0.0f) weight *= (double)es_exp2(detail * es_log2((float)(largest / source->rest_area)));
    return weight;
}

/* Rank c holds densities around the largest over 2^c. */
static uint32_t rank_of(double weight, double densest)
{
    uint32_t rank = 0;
    for (double x = weight * 1.4142135623730951; x < densest && rank + 1 < ES_POINT_RANKS; x *= 2.0) rank++;
    return rank;
}

/* Sets mass, rank, begin and end of every source; false when there is nothing to stand for. */
static bool share_out(es_scene_points* points, const es_point_request* request)
{
    double largest = 0.0, densest = 0.0, total = 0.0, area = 0.0;
    for (uint32_t i = 0; i < points->source_count; i++) largest = points->sources[i].rest_area > largest ? points->sources[i].rest_area : largest;
    for (uint32_t i = 0; i < points->source_count; i++) {
        es_point_source* source = &points->sources[i];
        const double weight = weight_of(source, largest, request->detail);
        source->mass = weight * source->rest_area;
        densest = weight > densest ? weight : densest;
        total += source->mass;
        if (weight > 0.0) area += source->rest_area;
    }
    points->rank_count = 0;
    points->area = (float)area;
    if (!(total > 0.0)) return false;
    double before = 0.0;
    for (uint32_t rank = 0; rank < ES_POINT_RANKS; rank++) {
        double of_rank = 0.0, mass_before = before;
        for (uint32_t i = 0; i < points->source_count; i++) {
            es_point_source* source = &points->sources[i];
            if (source->mass > 0.0 ? rank_of(source->mass / source->rest_area, densest) != rank : rank > 0) continue;
            source->rank = rank;
            source->begin = before / total * request->subset_size;
            before += source->mass;
            source->end = before / total * request->subset_size;
            if (source->mass > 0.0) of_rank += source->rest_area;
        }
        if (!(before > mass_before)) continue;
        points->rank_end[points->rank_count] = before / total * request->subset_size;
        points->rank_width[points->rank_count++] = (float)root(of_rank * total / ((before - mass_before) * request->subset_size));
    }
    /* rounding must not leave a last point to nobody */
    for (uint32_t i = 0; i < points->source_count; i++)
        if (points->sources[i].end >= points->rank_end[points->rank_count - 1]) points->sources[i].end = request->subset_size;
    points->rank_end[points->rank_count - 1] = request->subset_size;
    return true;
}

/* Multiples of the two irrational steps of Roberts (2018), as fractions of 2^32: offsets of the subsets spread evenly. */
static double offset_of(uint32_t subset) { return (double)(subset * 3242174889u + 0x80000000u) * (1.0 / 4294967296.0); }

uint32_t es_scene_points_border(const es_scene_points* points, uint32_t subset, double place)
{
    if (place >= points->subset_size) return points->subset_size;
    const double x = place - offset_of(subset);
    if (!(x > 0.0)) return 0;
    const uint32_t whole = (uint32_t)x;
    return (double)whole < x ? whole + 1 : whole;
}

/* ---- places on an object -------------------------------------------------------------------------------------------------------- */

typedef struct spreading { es_scene_points* points; const es_point_source* source; const double* before; } spreading;

/* `before`: summed shares before each triangle; one more entry, the sum of all. */
static void spread_over_triangles(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const spreading* job = user;
    es_scene_points* points = job->points;
    const es_point_source* source = job->source;
    const uint32_t triangles = source->triangle_count;
    const double scale = job->before[triangles] / (source->end - source->begin);
    for (uint32_t s = begin; s < end; s++) {
        const uint32_t first = es_scene_points_border(points, s, source->begin), last = es_scene_points_border(points, s, source->end);
        uint32_t t = 0;
        for (uint32_t k = first; k < last; k++) {
            const double place = ((double)k + offset_of(s) - source->begin) * scale;
            /* steps grow until they lead too far, then shrink */
            uint32_t step = 1;
            while (step < triangles - t && job->before[t + step] <= place) {
                t += step;
                step *= 2;
            }
            for (; step; step /= 2)
                if (step < triangles - t && job->before[t + step] <= place) t += step;
            const double share = job->before[t + 1] - job->before[t];
            float u = share > 0.0 ? (float)((place - job->before[t]) / share) : 0.5f;
            float v = (float)((k * 2654435769u + s * 2447445414u) >> 8) * (1.0f / 16777216.0f);
            u = es_clampf(u, 0.0f, 1.0f);
            if (v > u) {
                u *= 0.5f;
                v -= u;
            } else {
                v *= 0.5f;
                u -= v;
            }
            const size_t at = (size_t)s * points->subset_size + k;
            points->triangle[at] = t;
            points->barycentric[at] = (uint32_t)(u * 65535.0f + 0.5f) | (uint32_t)(v * 65535.0f + 0.5f) << 16;
        }
    }
}

static es_result spread(es_context* context, es_scene_points* points, const es_raster_mesh* mesh, es_point_source* source, es_arena* scratch)
{
    es_arena_reset(scratch);
    double* before = es_arena_allocate(scratch, (2 * (size_t)mesh->triangle_count + 1) * sizeof *before);
    if (!before) return es_context_last_result(context);
    weigh_triangles(context, mesh, source, before);
    double sum = 0.0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const double share = before[t];
        before[t] = sum;
        sum += share;
    }
    before[mesh->triangle_count] = sum;
    spreading job = {points, source, before};
    es_parallel_for(context, points->subset_count, 1, spread_over_triangles, &job);
    return ES_OK;
}

/* ---- memory ------------------------------------------------------------------------------------------------------------------------ */

/* A set of points may begin anywhere, and its last vector reads on past its end: coordinates are followed by zeros. */
enum { PADDING = 16 };

static float* allocate_coordinates(es_context* context, size_t total)
{
    float* values = es_allocate_array(context, total + PADDING, sizeof *values);
    if (values) memset(values + total, 0, PADDING * sizeof *values);
    return values;
}

static void free_places(es_context* context, es_scene_points* points)
{
    size_t total = (size_t)points->subset_size * points->subset_count;
    es_release(context, points->x, (total + PADDING) * sizeof(float));
    es_release(context, points->y, (total + PADDING) * sizeof(float));
    es_release(context, points->z, (total + PADDING) * sizeof(float));
    es_release(context, points->triangle, total * sizeof(uint32_t));
    es_release(context, points->barycentric, total * sizeof(uint32_t));
    points->x = points->y = points->z = NULL;
    points->triangle = points->barycentric = NULL;
    points->subset_size = points->subset_count = 0;
}

static es_result allocate_places(es_context* context, es_scene_points* points, uint32_t subset_size, uint32_t subset_count)
{
    if (points->subset_size == subset_size && points->subset_count == subset_count) return ES_OK;
    free_places(context, points);
    size_t total = (size_t)subset_size * subset_count;
    points->subset_size = subset_size;
    points->subset_count = subset_count;
    bool all = (points->x = allocate_coordinates(context, total)) && (points->y = allocate_coordinates(context, total)) &&
        (points->z = allocate_coordinates(context, total)) && (points->triangle = es_allocate_array(context, total, sizeof(uint32_t))) &&
        (points->barycentric = es_allocate_array(context, total, sizeof(uint32_t)));
    if (all) return ES_OK;
    free_places(context, points);
    return es_context_last_result(context);
}

static void free_sources(es_context* context, es_scene_points* points)
{
    es_release(context, points->sources, points->source_count * sizeof *points->sources);
    points->sources = NULL;
    points->source_count = 0;
}

void es_scene_points_free(es_context* context, es_scene_points* points)
{
    free_places(context, points);
    free_sources(context, points);
    *points = (es_scene_points){0};
}

/* ---- the update ---------------------------------------------------------------------------------------------------------------------- */

enum { AS_IT_WAS, MOVED, SPREAD };

/* What an instance needs, its source brought up to it; its points are not touched yet. */
static es_result examine(es_context* context, es_point_source* source, const es_raster_instance* instance, es_arena* scratch, uint8_t* need)
{
    const es_raster_mesh* mesh = instance->mesh;
    const bool same_mesh = source->mesh == mesh && source->triangle_count == mesh->triangle_count && source->revision == mesh->revision;
    *need = same_mesh && memcmp(&source->transform, &instance->transform, sizeof source->transform) == 0 ? AS_IT_WAS : MOVED;
    if (*need == AS_IT_WAS && source->point_weight == instance->point_weight) return ES_OK;
    double gram[6];
    es_gram_of(&instance->transform, gram);
    const bool same_areas = same_mesh && memcmp(gram, source->gram, sizeof gram) == 0;
    const uint64_t areas = source->areas;
    source->mesh = mesh;
    source->triangle_count = mesh->triangle_count;
    source->revision = mesh->revision;
    source->transform = instance->transform;
    source->point_weight = instance->point_weight;
    memcpy(source->gram, gram, sizeof gram);
    if (same_areas) return ES_OK;
    es_arena_reset(scratch);
    double* shares = es_arena_allocate(scratch, 2 * (size_t)mesh->triangle_count * sizeof *shares + 1);
    if (!shares) return es_context_last_result(context);
    weigh_triangles(context, mesh, source, shares);
    if (source->areas != areas) *need = SPREAD;
    return ES_OK;
}

typedef struct placing { es_context* context; es_scene_points* points; const es_draw_list* list; const uint32_t* stale; } placing;

/* Item i: subset i mod subset_count of the stale instance i / subset_count. */
static void place(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const placing* p = user;
    const es_gi_kernels* kernels = es_gi_kernel_table(es_context_isa(p->context));
    es_scene_points* points = p->points;
    for (uint32_t i = begin; i < end; i++) {
        const uint32_t index = p->stale[i / points->subset_count], s = i % points->subset_count;
        const es_raster_instance* instance = &p->list->instances[index];
        const uint32_t first = es_scene_points_border(points, s, points->sources[index].begin), last = es_scene_points_border(points, s, points->sources[index].end);
        if (last <= first) continue;
        const size_t at = (size_t)s * points->subset_size + first;
        kernels->place_points(instance->mesh, &instance->transform, points->triangle + at, points->barycentric + at, last - first, points->x + at, points->y + at, points->z + at);
    }
}

static uint64_t points_of(const es_scene_points* points, const es_point_source* source)
{
    uint64_t count = 0;
    for (uint32_t s = 0; s < points->subset_count; s++) count += es_scene_points_border(points, s, source->end) - es_scene_points_border(points, s, source->begin);
    return count;
}

static es_result update(es_context* context, es_scene_points* points, const es_draw_list* list, const es_point_request* request, es_arena* scratch, uint8_t* need, uint32_t* stale, uint64_t* moved)
{
    const bool fresh = points->subset_size != request->subset_size || points->subset_count != request->subset_count;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        es_result result = examine(context, &points->sources[i], &list->instances[i], scratch, &need[i]);
        if (result) return result;
    }
    double* ends = es_allocate_array(context, 2 * (size_t)list->instance_count, sizeof *ends);
    if (!ends) return es_context_last_result(context);
    for (uint32_t i = 0; i < list->instance_count; i++) {
        ends[2 * i] = points->sources[i].begin;
        ends[2 * i + 1] = points->sources[i].end;
    }
    const bool any = share_out(points, request);
    es_result result = ES_OK;
    bool shares_differ = fresh;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_point_source* source = &points->sources[i];
        if (!fresh && ends[2 * i] == source->begin && ends[2 * i + 1] == source->end) continue;
        need[i] = SPREAD;
        shares_differ = true;
    }
    es_release(context, ends, 2 * (size_t)list->instance_count * sizeof *ends);
    if (!any) {
        free_places(context, points);
        return ES_OK;
    }
    result = allocate_places(context, points, request->subset_size, request->subset_count);
    if (result) return result;

    uint32_t stale_count = 0;
    for (uint32_t i = 0; i < list->instance_count && !result; i++) {
        es_point_source* source = &points->sources[i];
        if (need[i] == AS_IT_WAS) continue;
        if (!stale_count) points->time++;
        source->placed = points->time;
        stale[stale_count++] = i;
        const uint64_t count = points_of(points, source);
        *moved += count;
        if (need[i] != SPREAD || !count) continue;
        points->redistributed += count;
        result = spread(context, points, list->instances[i].mesh, source, scratch);
    }
    if (result) return result;
    if (shares_differ) points->layout = points->time;
    placing p = {context, points, list, stale};
    es_parallel_for(context, stale_count * points->subset_count, 16, place, &p);
    return ES_OK;
}

es_result es_scene_points_update(es_context* context, es_scene_points* points, const es_draw_list* list, const es_point_request* request, uint64_t* moved)
{
    *moved = points->redistributed = 0;
    if (points->source_count != list->instance_count) {
        free_sources(context, points);
        points->rank_count = 0;
        points->sources = es_allocate_zero(context, list->instance_count * sizeof *points->sources);
        if (!points->sources) return es_context_last_result(context);
        points->source_count = list->instance_count;
    }
    es_arena scratch;
    es_arena_init(&scratch, context, 1 << 18);
    uint8_t* need = es_allocate(context, list->instance_count);
    uint32_t* stale = need ? es_allocate_array(context, list->instance_count, sizeof *stale) : NULL;
    es_result result = stale ? update(context, points, list, request, &scratch, need, stale, moved) : es_context_last_result(context);
    es_release(context, stale, list->instance_count * sizeof *stale);
    es_release(context, need, list->instance_count);
    es_arena_free(&scratch);
    if (result) { /* sources are ahead of their points: next time, all of them anew */
        free_places(context, points);
        free_sources(context, points);
    }
    return result;
}
