#include "gi/scene_points.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"

static es_vec3 vertex(const es_raster_mesh* mesh, const es_mat4* transform, uint32_t index)
{
    const float* p = mesh->positions + 4 * (size_t)index;
    return es_mat4_point(transform, es_v3(p[0], p[1], p[2]));
}

/* ---- distribution: done when the set of triangles changes ------------------------------------------------------------------- */

typedef struct distribution {
    es_scene_points* points;
    const es_draw_list* list;
    const uint64_t* first_triangle;  /* of each instance in the sequence of all triangles; one more entry: the end */
    const double* area_before;       /* summed area before triangle i; one more entry: the total */
    uint32_t* instance_of_point;
} distribution;

static void areas_of_instance(const es_raster_instance* instance, double* area_before, double* sum)
{
    const es_raster_mesh* mesh = instance->mesh;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t* i = mesh->indices + 3 * (size_t)t;
        es_vec3 a = vertex(mesh, &instance->transform, i[0]), b = vertex(mesh, &instance->transform, i[1]), c = vertex(mesh, &instance->transform, i[2]);
        float area = 0.5f * es_v3_length(es_v3_cross(es_v3_sub(b, a), es_v3_sub(c, a)));
        area_before[t] = *sum;
        if (area > 0.0f && area < 1e30f) *sum += area;
    }
}

static void distribute_subsets(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    distribution* d = user;
    es_scene_points* points = d->points;
    uint64_t triangle_total = d->first_triangle[d->list->instance_count];
    double total = d->area_before[triangle_total], step = total / points->subset_size;
    for (uint32_t s = begin; s < end; s++) {
        uint64_t t = 0;
        uint32_t instance = 0;
        for (uint32_t k = 0; k < points->subset_size; k++) {
            size_t at = (size_t)s * points->subset_size + k;
            uint32_t counter = 2 * (uint32_t)at;
            double place = ((double)k + es_random_float(1, counter)) * step;
            while (t + 1 < triangle_total && d->area_before[t + 1] <= place) t++;
            while (t >= d->first_triangle[instance + 1]) instance++;
            /* uniform on the triangle: fold the unit square along its diagonal */
            uint32_t bits = es_random_u32(1, counter + 1);
            float u = ((float)(bits & 0xffff) + 0.5f) * (1.0f / 65536.0f), v = ((float)(bits >> 16) + 0.5f) * (1.0f / 65536.0f);
            if (u + v > 1.0f) {
                u = 1.0f - u;
                v = 1.0f - v;
            }
            points->triangle[at] = (uint32_t)(t - d->first_triangle[instance]);
            points->barycentric[at] = (uint32_t)(u * 65535.0f + 0.5f) | (uint32_t)(v * 65535.0f + 0.5f) << 16;
            d->instance_of_point[at] = instance;
        }
    }
}

/* Runs in the order of instances, so that what one moving instance changes lies together in the list. */
static es_result collect_runs(es_context* context, es_scene_points* points, const uint32_t* instance_of_point, uint32_t instance_count)
{
    size_t total = (size_t)points->subset_size * points->subset_count, run_count = 0;
    size_t* first = es_allocate_zero(context, ((size_t)instance_count + 1) * sizeof *first);
    if (!first) return es_context_last_result(context);
    for (size_t begin = 0; begin < total; begin += points->subset_size)
        for (size_t i = begin; i < begin + points->subset_size; i++)
            if (i == begin || instance_of_point[i] != instance_of_point[i - 1]) {
                first[instance_of_point[i] + 1]++;
                run_count++;
            }
    es_result result = ES_OK;
    if (run_count > points->run_capacity) {
        es_release(context, points->runs, points->run_capacity * sizeof *points->runs);
        points->runs = es_allocate_array(context, run_count, sizeof *points->runs);
        points->run_capacity = points->runs ? run_count : 0;
        if (!points->runs) result = es_context_last_result(context);
    }
    if (!result) {
        for (uint32_t i = 0; i < instance_count; i++) first[i + 1] += first[i];
        for (size_t i = 0, border = points->subset_size; i < total;) {
            uint32_t instance = instance_of_point[i];
            size_t end = i + 1;
            while (end < border && instance_of_point[end] == instance) end++;
            points->runs[first[instance]++] = (es_point_run){(uint32_t)i, (uint32_t)(end - i), instance};
            i = end;
            if (i == border) border += points->subset_size;
        }
        points->run_count = run_count;
    }
    es_release(context, first, ((size_t)instance_count + 1) * sizeof *first);
    return result;
}

static void free_places(es_context* context, es_scene_points* points)
{
    size_t total = (size_t)points->subset_size * points->subset_count;
    es_release(context, points->x, total * sizeof(float));
    es_release(context, points->y, total * sizeof(float));
    es_release(context, points->z, total * sizeof(float));
    es_release(context, points->triangle, total * sizeof(uint32_t));
    es_release(context, points->barycentric, total * sizeof(uint32_t));
    points->x = points->y = points->z = NULL;
    points->triangle = points->barycentric = NULL;
    points->subset_size = points->subset_count = 0;
    points->run_count = 0;
}

static es_result allocate_places(es_context* context, es_scene_points* points, uint32_t subset_size, uint32_t subset_count)
{
    if (points->subset_size == subset_size && points->subset_count == subset_count) return ES_OK;
    free_places(context, points);
    size_t total = (size_t)subset_size * subset_count;
    points->subset_size = subset_size;
    points->subset_count = subset_count;
    bool all = (points->x = es_allocate_array(context, total, sizeof(float))) && (points->y = es_allocate_array(context, total, sizeof(float))) &&
        (points->z = es_allocate_array(context, total, sizeof(float))) && (points->triangle = es_allocate_array(context, total, sizeof(uint32_t))) &&
        (points->barycentric = es_allocate_array(context, total, sizeof(uint32_t)));
    if (all) return ES_OK;
    free_places(context, points);
    return es_context_last_result(context);
}

static es_result distribute(es_context* context, es_scene_points* points, const es_draw_list* list, uint32_t subset_size, uint32_t subset_count)
{
    uint64_t triangle_total = 0;
    for (uint32_t i = 0; i < list->instance_count; i++) triangle_total += list->instances[i].mesh->triangle_count;
    es_arena scratch;
    es_arena_init(&scratch, context, 1 << 20);
    es_result result = ES_OK;
    uint64_t* first_triangle = es_arena_allocate(&scratch, ((size_t)list->instance_count + 1) * sizeof *first_triangle);
    double* area_before = first_triangle ? es_arena_allocate(&scratch, (triangle_total + 1) * sizeof *area_before) : NULL;
    uint32_t* instance_of_point = area_before ? es_arena_allocate(&scratch, (size_t)subset_size * subset_count * sizeof *instance_of_point) : NULL;
    if (!instance_of_point) result = es_context_last_result(context);
    if (!result) {
        double sum = 0.0;
        uint64_t first = 0;
        for (uint32_t i = 0; i < list->instance_count; i++) {
            first_triangle[i] = first;
            areas_of_instance(&list->instances[i], area_before + first, &sum);
            first += list->instances[i].mesh->triangle_count;
        }
        first_triangle[list->instance_count] = first;
        area_before[first] = sum;
        points->area = (float)sum;
        if (!(sum > 0.0)) {
            free_places(context, points);
        } else {
            result = allocate_places(context, points, subset_size, subset_count);
            if (!result) {
                distribution d = {points, list, first_triangle, area_before, instance_of_point};
                es_parallel_for(context, subset_count, 1, distribute_subsets, &d);
                result = collect_runs(context, points, instance_of_point, list->instance_count);
            }
        }
    }
    es_arena_free(&scratch);
    return result;
}

/* ---- placing: every frame, for what moved ---------------------------------------------------------------------------------------- */

typedef struct placing { es_context* context; es_scene_points* points; const es_draw_list* list; const uint8_t* stale; } placing;

static void place_runs(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    placing* p = user;
    const es_gi_kernels* kernels = es_gi_kernel_table(es_context_isa(p->context));
    for (uint32_t r = begin; r < end; r++) {
        const es_point_run* run = &p->points->runs[r];
        if (!p->stale[run->instance]) continue;
        const es_raster_instance* instance = &p->list->instances[run->instance];
        size_t at = run->first;
        kernels->place_points(instance->mesh, &instance->transform, p->points->triangle + at, p->points->barycentric + at, run->count, p->points->x + at, p->points->y + at, p->points->z + at);
    }
}

static float volume_scale(const es_raster_instance* instance) { return es_absf(es_mat4_determinant3(&instance->transform)); }

static bool same_triangles(const es_scene_points* points, const es_draw_list* list)
{
    if (points->source_count != list->instance_count) return false;
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const struct es_point_source* source = &points->sources[i];
        if (source->mesh != list->instances[i].mesh || source->triangle_count != list->instances[i].mesh->triangle_count) return false;
        float now = volume_scale(&list->instances[i]);
        if (now > 8.0f * source->volume_scale || source->volume_scale > 8.0f * now) return false;
    }
    return true;
}

es_result es_scene_points_update(es_context* context, es_scene_points* points, const es_draw_list* list, uint32_t subset_size, uint32_t subset_count, uint64_t* moved)
{
    *moved = 0;
    bool fresh = points->subset_size != subset_size || points->subset_count != subset_count || !same_triangles(points, list);
    if (fresh) {
        es_release(context, points->sources, points->source_count * sizeof *points->sources);
        points->source_count = 0;
        points->sources = es_allocate_zero(context, list->instance_count * sizeof *points->sources);
        if (!points->sources) return es_context_last_result(context);
        es_result result = distribute(context, points, list, subset_size, subset_count);
        if (result) {
            es_release(context, points->sources, list->instance_count * sizeof *points->sources);
            points->sources = NULL;
            return result;
        }
        points->source_count = list->instance_count;
    }
    if (!points->subset_count || !list->instance_count) return ES_OK;
    uint8_t* stale = es_allocate(context, list->instance_count);
    if (!stale) return es_context_last_result(context);
    for (uint32_t i = 0; i < list->instance_count; i++) {
        const es_raster_instance* instance = &list->instances[i];
        struct es_point_source source = {instance->mesh, instance->mesh->triangle_count, instance->mesh->revision, instance->transform, fresh ? volume_scale(instance) : points->sources[i].volume_scale};
        stale[i] = fresh || points->sources[i].revision != source.revision || memcmp(&points->sources[i].transform, &source.transform, sizeof source.transform) != 0;
        points->sources[i] = source;
    }
    for (size_t r = 0; r < points->run_count; r++)
        if (stale[points->runs[r].instance]) *moved += points->runs[r].count;
    if (*moved) {
        placing p = {context, points, list, stale};
        es_parallel_for(context, (uint32_t)points->run_count, 16, place_runs, &p);
    }
    es_release(context, stale, list->instance_count);
    return ES_OK;
}

void es_scene_points_free(es_context* context, es_scene_points* points)
{
    free_places(context, points);
    es_release(context, points->runs, points->run_capacity * sizeof *points->runs);
    es_release(context, points->sources, points->source_count * sizeof *points->sources);
    *points = (es_scene_points){0};
}
