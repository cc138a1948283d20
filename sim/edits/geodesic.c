/* Distances over a mesh by a front of waves, and along its edges.
 *
 * The front is label-correcting: a point whose distance has fallen lets its neighbours be looked at again, nearest first, by steps of about an edge's length
 * (Meyer and Sanders' delta-stepping 2003), until nothing falls any more. All points of a step are computed from the distances before it, so that they
 * can be computed at once and the result does not depend on how many do. As nothing is ever settled, obtuse corners and edges of many triangles need no care: what
 * they let in late is corrected. On a plane every distance is the straight line's, up to rounding.
 *
 * Everything is in the node's axes, stretched so that lengths are the world's up to a power of two that brings the mesh to about 1. */
#include "sim/edits/geodesic.h"
#include "sim/edits/edits.h"
#include "sim/kernel_table.h"

#include <math.h>
#include <string.h>

#include "platform/maths.h"

/* ---- metric -------------------------------------------------------------------------------------------------------------- */

/* xx yy zz xy yz zx of the node's linear part, to 16 bits of the largest: a node that turns keeps its metric, but for the last bits of a float's
 * rounding, which this takes away. */
static void metric_of(const es_mat4* m, double metric[6])
{
    static const int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {2, 0}};
    double most = 0;
    for (int i = 0; i < 6; i++) {
        metric[i] = 0;
        for (int k = 0; k < 3; k++) metric[i] += (double)m->m[4 * pairs[i][0] + k] * (double)m->m[4 * pairs[i][1] + k];
        if (i < 3 && metric[i] > most) most = metric[i];
    }
    double unit = 1;
    if (!(most > 0)) return;
    while (unit > most * 0x1p-16) unit *= 0.5;
    while (unit <= most * 0x1p-17) unit *= 2;
    for (int i = 0; i < 6; i++) metric[i] = (double)(int64_t)(metric[i] / unit + (metric[i] < 0 ? -0.5 : 0.5)) * unit;
}

/* Upper triangular factor: |p|² by the metric = |factor p|². Axes without extent are left out. */
static void factor_of(const double g[6], double f[6])
{
    double most = g[0] > g[1] ? g[0] : g[1];
    most = most > g[2] ? most : g[2];
    const double least = most * 1e-12;
    memset(f, 0, 6 * sizeof *f); /* 00 01 02 11 12 22 */
    if (g[0] > least) {
        f[0] = __builtin_sqrt(g[0]);
        f[1] = g[3] / f[0];
        f[2] = g[5] / f[0];
    }
    double y = g[1] - f[1] * f[1];
    if (y > least) {
        f[3] = __builtin_sqrt(y);
        f[4] = (g[4] - f[1] * f[2]) / f[3];
    }
    double z = g[2] - f[2] * f[2] - f[4] * f[4];
    if (z > least) f[5] = __builtin_sqrt(z);
}

/* ---- what a computation works with ----------------------------------------------------------------------------------------- */

typedef struct geodesic {
    es_context* context;
    const es_surface* surface;
    float* points;            /* 4 per point: stretched place, distance */
    uint32_t *list, *pending; /* of points */
    uint32_t* reached;        /* those that the front has come to, in that order */
    uint32_t reached_count;
    float* results;
    uint8_t* marks;           /* per point */
    size_t bytes;
    void* memory;
    double factor[6], centre[3], unit; /* lengths here × unit = the world's */
    float mean;               /* length of edges */
} geodesic;

enum { PENDING = 1, LISTED = 2 };

static void stretch_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const geodesic* g = user;
    const double *f = g->factor, scale = 1.0 / g->unit;
    for (uint32_t i = begin; i < end; i++) {
        const float* p = g->surface->raster->positions + 4 * (size_t)g->surface->fans.vertex_of[i];
        const double x = (double)p[0] - g->centre[0], y = (double)p[1] - g->centre[1], z = (double)p[2] - g->centre[2];
        float* out = g->points + 4 * (size_t)i;
        out[0] = (float)((f[0] * x + f[1] * y + f[2] * z) * scale);
        out[1] = (float)((f[3] * y + f[4] * z) * scale);
        out[2] = (float)(f[5] * z * scale);
        out[3] = ES_GEODESIC_FAR;
    }
}

static bool begin_geodesic(es_context* context, const es_surface* surface, const double metric[6], geodesic* g)
{
    const size_t count = surface->fans.point_count;
    *g = (geodesic){.context = context, .surface = surface, .unit = 1, .bytes = (count + 16) * (4 * sizeof(float) + 4 * sizeof(uint32_t) + 1)};
    g->memory = es_allocate(context, g->bytes);
    if (!g->memory) return false;
    g->points = g->memory;
    g->list = (uint32_t*)(g->points + 4 * (count + 16));
    g->pending = g->list + count + 16;
    g->results = (float*)(g->pending + count + 16);
    g->reached = (uint32_t*)(g->results + count + 16);
    g->marks = (uint8_t*)(g->reached + count + 16);
    memset(g->marks, 0, count);
    factor_of(metric, g->factor);
    const es_raster_mesh* mesh = surface->raster;
    const float *low = &mesh->bounds_min.x, *high = &mesh->bounds_max.x;
    double extent = 0;
    for (int k = 0; k < 3; k++) {
        g->centre[k] = 0.5 * ((double)low[k] + (double)high[k]);
        double size = ((double)high[k] - (double)low[k]) * __builtin_sqrt(metric[k]);
        extent = extent > size ? extent : size;
    }
    while (g->unit < extent) g->unit *= 2;
    while (extent > 0 && g->unit * 0.5 >= extent && g->unit > 0x1p-60) g->unit *= 0.5;
    es_parallel_for(context, (uint32_t)count, 4096, stretch_body, g);
    return true;
}

static void end_geodesic(geodesic* g) { es_release(g->context, g->memory, g->bytes); }

static float edge_length(const geodesic* g, uint32_t a, uint32_t b)
{
    const float *p = g->points + 4 * (size_t)a, *q = g->points + 4 * (size_t)b;
    const float x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return es_sqrt(x * x + y * y + z * z);
}

/* Of at most 4096 points, which is enough to step by. */
static float mean_edge(const geodesic* g)
{
    const es_surface_fans* f = &g->surface->fans;
    double sum = 0;
    uint32_t number = 0, step = f->point_count / 4096 + 1;
    for (uint32_t i = 0; i < f->point_count; i += step)
        for (uint32_t k = f->first_neighbour[i]; k < f->first_neighbour[i + 1]; k++, number++) sum += (double)edge_length(g, i, f->neighbours[k]);
    return number ? (float)(sum / (double)number) : 1;
}

/* Of the points that the front has come to within the limit. */
static float longest_edge(const geodesic* g, float limit)
{
    const es_surface_fans* f = &g->surface->fans;
    float longest = 0;
    for (uint32_t i = 0; i < g->reached_count; i++) {
        const uint32_t p = g->reached[i];
        if (g->points[4 * (size_t)p + 3] > limit) continue;
        for (uint32_t k = f->first_neighbour[p]; k < f->first_neighbour[p + 1]; k++) longest = es_maxf(longest, edge_length(g, p, f->neighbours[k]));
    }
    return longest;
}

/* ---- the front ---------------------------------------------------------------------------------------------------------------- */

static void front_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const geodesic* g = user;
    const es_surface_fans* f = &g->surface->fans;
    const es_geodesic_job job = {g->points, f->first_row, f->rows, g->list, g->results};
    es_sim_kernel_table(es_context_isa(g->context))->geodesic_front(&job, begin, end);
}

/* Until everything within the limit is settled. `pending` of those that have fallen and not been gone on from; returns how many there are now, to go on further. */
static uint32_t run_front(geodesic* g, uint32_t pending, float limit)
{
    const es_surface_fans* f = &g->surface->fans;
    float* points = g->points;
    const float width = g->mean * 1.5f;
    while (pending) {
        float nearest = ES_GEODESIC_FAR;
        for (uint32_t i = 0; i < pending; i++) nearest = es_minf(nearest, points[4 * (size_t)g->pending[i] + 3]);
        if (nearest > limit) break;
        const float until = nearest + width;
        uint32_t kept = 0, listed = 0;
        for (uint32_t i = 0; i < pending; i++) {
            const uint32_t p = g->pending[i];
            if (points[4 * (size_t)p + 3] > until) {
                g->pending[kept++] = p;
                continue;
            }
            g->marks[p] &= (uint8_t)~PENDING;
            for (uint32_t k = f->first_neighbour[p]; k < f->first_neighbour[p + 1]; k++) {
                const uint32_t n = f->neighbours[k];
                if (g->marks[n] & LISTED) continue;
                g->marks[n] |= LISTED;
                g->list[listed++] = n;
            }
        }
        pending = kept;
        es_parallel_for(g->context, listed, 128, front_body, g);
        for (uint32_t i = 0; i < listed; i++) {
            const uint32_t p = g->list[i];
            float* distance = &points[4 * (size_t)p + 3];
            g->marks[p] &= (uint8_t)~LISTED;
            /* what rounding takes away must not go round in circles */
            if (!(g->results[i] < *distance * (1.0f - 1e-6f))) continue;
            if (*distance == ES_GEODESIC_FAR) g->reached[g->reached_count++] = p;
            *distance = g->results[i];
            if (g->marks[p] & PENDING) continue;
            g->marks[p] |= PENDING;
            g->pending[pending++] = p;
        }
    }
    return pending;
}

/* ---- along edges ---------------------------------------------------------------------------------------------------------------- */

/* A binary heap of points by distance; results[p] is where in it point p is. */
static void heap_up(geodesic* g, uint32_t at)
{
    uint32_t *heap = g->list, *places = (uint32_t*)g->results, p = heap[at];
    const float d = g->points[4 * (size_t)p + 3];
    while (at > 0) {
        uint32_t parent = (at - 1) / 2;
        if (g->points[4 * (size_t)heap[parent] + 3] <= d) break;
        heap[at] = heap[parent];
        places[heap[at]] = at;
        at = parent;
    }
    heap[at] = p;
    places[p] = at;
}

static void heap_down(geodesic* g, uint32_t count)
{
    uint32_t *heap = g->list, *places = (uint32_t*)g->results, at = 0, p = heap[0];
    const float d = g->points[4 * (size_t)p + 3];
    for (uint32_t child; (child = 2 * at + 1) < count; at = child) {
        if (child + 1 < count && g->points[4 * (size_t)heap[child + 1] + 3] < g->points[4 * (size_t)heap[child] + 3]) child++;
        if (g->points[4 * (size_t)heap[child] + 3] >= d) break;
        heap[at] = heap[child];
        places[heap[at]] = at;
    }
    heap[at] = p;
    places[p] = at;
}

static void run_edges(geodesic* g, uint32_t source, float limit)
{
    const es_surface_fans* f = &g->surface->fans;
    uint32_t count = 1;
    g->points[4 * (size_t)source + 3] = 0;
    g->list[0] = source;
    ((uint32_t*)g->results)[source] = 0;
    g->marks[source] = LISTED;
    while (count) {
        const uint32_t p = g->list[0];
        const float d = g->points[4 * (size_t)p + 3];
        if (d > limit) return;
        g->list[0] = g->list[--count];
        if (count) heap_down(g, count);
        g->marks[p] = PENDING; /* settled */
        for (uint32_t k = f->first_neighbour[p]; k < f->first_neighbour[p + 1]; k++) {
            const uint32_t n = f->neighbours[k];
            const float through = d + edge_length(g, p, n);
            float* distance = &g->points[4 * (size_t)n + 3];
            if (g->marks[n] == PENDING || !(through < *distance)) continue;
            *distance = through;
            if (g->marks[n] != LISTED) {
                g->marks[n] = LISTED;
                g->list[count] = n;
                heap_up(g, count++);
            } else {
                heap_up(g, ((uint32_t*)g->results)[n]);
            }
        }
    }
}

/* ---- from a place to fields -------------------------------------------------------------------------------------------------------- */

typedef struct spread_loop { const geodesic* g; float limit; float* distances; } spread_loop;

static void spread_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const spread_loop* loop = user;
    const geodesic* g = loop->g;
    for (uint32_t v = begin; v < end; v++) {
        const float d = g->points[4 * (size_t)g->surface->fans.point_of[v] + 3];
        loop->distances[v] = d > loop->limit ? INFINITY : (float)((double)d * g->unit);
    }
}

bool es_geodesic_compute(es_context* context, const es_surface* surface, const es_geodesic_key* key, bool whole_triangles, float* distances)
{
    geodesic g;
    if (!begin_geodesic(context, surface, key->metric, &g)) return false;
    float limit = 0.5f * ES_GEODESIC_FAR;
    const bool bounded = key->max_distance > 0;
    g.mean = mean_edge(&g);
    if (bounded && (double)key->max_distance / g.unit < 1e6) limit = (float)((double)key->max_distance / g.unit) * (1 + 1e-6f);
    const es_surface_fans* f = &surface->fans;
    const uint32_t* corner = surface->raster->indices + 3 * (size_t)key->triangle;
    const float w[3] = {1.0f - key->u - key->v, key->u, key->v};
    double source[3] = {0, 0, 0};
    uint32_t nearest = 0, pending = 0;
    float least = ES_GEODESIC_FAR, to[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) source[k] += (double)w[i] * (double)g.points[4 * (size_t)f->point_of[corner[i]] + k];
    for (int i = 0; i < 3; i++) {
        double squared = 0;
        for (int k = 0; k < 3; k++) {
            double x = source[k] - (double)g.points[4 * (size_t)f->point_of[corner[i]] + k];
            squared += x * x;
        }
        to[i] = (float)__builtin_sqrt(squared);
        if (to[i] < least) {
            least = to[i];
            nearest = f->point_of[corner[i]];
        }
    }
    if (key->method == ES_GEODESIC_EDGES) {
        run_edges(&g, nearest, limit);
    } else {
        for (int i = 0; i < 3; i++) {
            const uint32_t p = f->point_of[corner[i]];
            float* distance = &g.points[4 * (size_t)p + 3];
            *distance = es_minf(*distance, to[i]);
            if (g.marks[p] & PENDING) continue;
            g.marks[p] |= PENDING;
            g.pending[pending++] = p;
            g.reached[g.reached_count++] = p;
        }
        if (!(bounded && whole_triangles)) {
            run_front(&g, pending, limit);
        } else {
            /* A triangle that the field reaches into has its corners within its longest edge of that; its edges end at corners of the triangle through which
             * the way to it leads, and so on back to the source's. */
            const float radius = limit, own = es_maxf(to[0], es_maxf(to[1], to[2]));
            float next = es_maxf(radius, own);
            do {
                limit = next;
                pending = run_front(&g, pending, limit);
                next = radius + es_maxf(longest_edge(&g, limit), own);
            } while (next > limit);
        }
    }
    spread_loop loop = {&g, limit, distances};
    es_parallel_for(context, f->vertex_count, 8192, spread_body, &loop);
    end_geodesic(&g);
    return true;
}

float es_geodesic_between(const float corners[3], const float edges_squared[3], float u, float v)
{
    if (!(corners[0] < 1e18f && corners[1] < 1e18f && corners[2] < 1e18f)) return INFINITY;
    const float w = 1.0f - u - v;
    const float squared = w * corners[0] * corners[0] + u * corners[1] * corners[1] + v * corners[2] * corners[2] - (w * u * edges_squared[0] + u * v * edges_squared[1] + v * w * edges_squared[2]);
    return squared > 0 ? es_sqrt(squared) : 0;
}

void es_geodesic_field_free(es_context* context, es_geodesic_field* field)
{
    es_release(context, field->distances, field->capacity * sizeof *field->distances);
    *field = (es_geodesic_field){0};
}

static es_geodesic_key key_of(const es_world* world, const es_anchored* on, const es_anchor* anchor, es_geodesic_method method, float max_distance)
{
    es_geodesic_key key;
    memset(&key, 0, sizeof key);
    key.mesh_revision = on->mesh->raster.revision;
    key.rest_revision = on->mesh->raster.rest_revision;
    key.mesh = on->mesh->object.id;
    key.triangle = anchor->triangle;
    key.u = anchor->u;
    key.v = anchor->v;
    key.max_distance = max_distance;
    key.method = (uint32_t)method;
    metric_of(es_node_world(world, on->instance->desc.node), key.metric);
    return key;
}

bool es_geodesic_field_refresh(es_world* world, es_surfaces* surfaces, es_geodesic_field* field, const es_anchor* anchor, float radius, bool* changed)
{
    es_anchored on;
    if (!es_anchor_find(world, anchor, &on)) return false;
    es_geodesic_key key = key_of(world, &on, anchor, ES_GEODESIC_FRONT, radius);
    if (field->valid && memcmp(&key, &field->key, sizeof key) == 0) return true;
    *changed = true;
    const size_t count = on.mesh->raster.vertex_count;
    field->valid = false;
    if (field->capacity != count) {
        es_geodesic_field_free(world->context, field);
        field->distances = es_allocate_array(world->context, count, sizeof *field->distances);
        if (!field->distances) return false;
        field->capacity = count;
    }
    const es_surface* surface = es_surface_of(world, surfaces, on.mesh, ES_SURFACE_FANS);
    if (!surface || !es_geodesic_compute(world->context, surface, &key, true, field->distances)) return false;
    field->key = key;
    field->valid = true;
    return true;
}

es_result es_world_geodesic(const es_world* world, es_instance instance, uint32_t triangle, float u, float v, es_geodesic_method method, float max_distance, float* distances)
{
    if (!world || !distances) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    es_anchor anchor;
    es_result result = es_world_anchor_of_triangle(world, instance, triangle, u, v, &anchor);
    if (result != ES_OK) return result;
    if ((uint32_t)method > ES_GEODESIC_EDGES || __builtin_isnan(max_distance)) return es_fail(context, ES_INVALID_ARGUMENT, "es_world_geodesic: a method of es_geodesic_method and a distance that is a number are needed");
    es_edits* edits = es_edits_of((es_world*)world);
    if (!edits) return es_context_last_result(context);
    es_world_refresh(world);
    es_fp_environment environment = es_fp_enter();
    es_anchored on;
    es_anchor_find(world, &anchor, &on);
    const es_geodesic_key key = key_of(world, &on, &anchor, method, max_distance > 0 && max_distance < 3e38f ? max_distance : 0);
    const es_surface* surface = es_surface_of(world, &edits->surfaces, on.mesh, ES_SURFACE_FANS);
    const bool good = surface && es_geodesic_compute(context, surface, &key, false, distances);
    es_fp_leave(environment);
    return good ? ES_OK : es_context_last_result(context);
}
