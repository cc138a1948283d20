/* `bench geodesic`: distances over meshes of 500,000 triangles, how long they take and how far they are from the surface's own.
 *
 * A sphere of radius 1 whose distances are arcs, and a plane of 1 m², its corners moved at random, whose distances are straight lines. The thesis (§7.6.2) has 139 ms
 * for the distances along the edges of a mesh of 525,000 triangles on a CPU of 2.4 GHz. */
#include "bench.h"

#include <earthshine/sim.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { SPHERE_FRONT, SPHERE_EDGES, SPHERE_FIRST, SPHERE_RADIUS, PLANE_FRONT, PLANE_EDGES, ERROR_SPHERE_FRONT, ERROR_SPHERE_EDGES, MOST_SPHERE_FRONT, ERROR_PLANE_FRONT, ERROR_PLANE_EDGES, COARSE_SPHERE_FRONT, COARSE_SPHERE_EDGES, FIGURES, MAX_ROUNDS = 50 };
#define THESIS "thesis §7.6.2: 139 ms, 525k triangles, along edges"
static const bench_row table[FIGURES] = {
    [SPHERE_FRONT] = {"geodesic-front", "distances over all of a sphere of 499,392 triangles, neighbourhood known", "ms", THESIS, BENCH_VALUE_AT_MOST, 139, 40},
    [SPHERE_EDGES] = {"geodesic-edges", "the same along edges (the thesis' method)", "ms", THESIS, BENCH_VALUE_AT_MOST, 139, 40},
    [SPHERE_FIRST] = {"geodesic-front-first", "the first field of a mesh, its neighbourhood found on the way", "ms", NULL, BENCH_NONE, 0, 0},
    [SPHERE_RADIUS] = {"geodesic-front-radius", "out to 0.3 of the sphere's radius", "ms", NULL, BENCH_NONE, 0, 0},
    [PLANE_FRONT] = {"geodesic-front-plane", "distances over a plane of 500,000 triangles of any shape", "ms", NULL, BENCH_VALUE_AT_MOST, 139, 40},
    [PLANE_EDGES] = {"geodesic-edges-plane", "the same along edges", "ms", NULL, BENCH_NONE, 0, 0},
    [ERROR_SPHERE_FRONT] = {"geodesic-front-error", "mean error over the sphere, over the mean distance", "%", NULL, BENCH_NONE, 0, 0},
    [ERROR_SPHERE_EDGES] = {"geodesic-edges-error", "the same along edges", "%", NULL, BENCH_NONE, 0, 0},
    [MOST_SPHERE_FRONT] = {"geodesic-front-error-most", "largest error over the sphere, over the mean distance", "%", NULL, BENCH_NONE, 0, 0},
    [ERROR_PLANE_FRONT] = {"geodesic-front-plane-error", "mean error over the plane, over the mean distance", "%", NULL, BENCH_NONE, 0, 0},
    [ERROR_PLANE_EDGES] = {"geodesic-edges-plane-error", "the same along edges", "%", NULL, BENCH_NONE, 0, 0},
    [COARSE_SPHERE_FRONT] = {"geodesic-front-coarse-error", "mean error over a sphere of 768 triangles, over the mean distance", "%", NULL, BENCH_NONE, 0, 0},
    [COARSE_SPHERE_EDGES] = {"geodesic-edges-coarse-error", "the same along edges", "%", NULL, BENCH_NONE, 0, 0},
};

size_t bench_geodesic_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, FIGURES, rows, capacity); }

typedef struct surface {
    uint32_t vertices, triangles, source;
    float* positions;
    uint32_t* indices;
    bool sphere;
} surface;

/* A cube's faces of n × n, projected onto the sphere; vertices of edges are there once per face, with the same bits. */
static void make_sphere(surface* s, uint32_t n)
{
    uint32_t v = 0, t = 0;
    for (int face = 0; face < 6; face++) {
        const uint32_t first = v;
        for (uint32_t i = 0; i <= n; i++)
            for (uint32_t k = 0; k <= n; k++, v++) {
                const double quarter = 0.78539816339744831;
                double a = k == 0 ? -1 : k == n ? 1 : tan(quarter * (2.0 * k / n - 1)), b = i == 0 ? -1 : i == n ? 1 : tan(quarter * (2.0 * i / n - 1)), p[3];
                p[face / 2] = face & 1 ? -1 : 1;
                p[(face / 2 + 1) % 3] = face & 1 ? b : a;
                p[(face / 2 + 2) % 3] = face & 1 ? a : b;
                /* squares summed by their size: the same from either face */
                double q[3] = {p[0] * p[0], p[1] * p[1], p[2] * p[2]}, low = fmin(q[0], fmin(q[1], q[2])), high = fmax(q[0], fmax(q[1], q[2]));
                double length = sqrt(low + fmax(fmin(q[0], q[1]), fmin(fmax(q[0], q[1]), q[2])) + high);
                for (int c = 0; c < 3; c++) s->positions[3 * (size_t)v + c] = (float)(p[c] / length);
            }
        for (uint32_t i = 0; i < n; i++)
            for (uint32_t k = 0; k < n; k++, t += 2) {
                const uint32_t a = first + i * (n + 1) + k, corners[6] = {a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1};
                memcpy(s->indices + 3 * (size_t)t, corners, sizeof corners);
            }
    }
}

static float shift(uint32_t i)
{
    i = (i ^ i >> 16) * 0x7feb352du;
    i = (i ^ i >> 15) * 0x846ca68bu;
    return ((float)(i >> 8) * (1.0f / 16777216.0f) - 0.5f) * 0.5f;
}

static void make_plane(surface* s, uint32_t n)
{
    for (uint32_t i = 0; i <= n; i++)
        for (uint32_t k = 0; k <= n; k++) {
            const uint32_t v = i * (n + 1) + k;
            const bool inner = i > 0 && k > 0 && i < n && k < n;
            s->positions[3 * (size_t)v] = ((float)k + (inner ? shift(2 * v) : 0)) / (float)n;
            s->positions[3 * (size_t)v + 1] = 0;
            s->positions[3 * (size_t)v + 2] = ((float)i + (inner ? shift(2 * v + 1) : 0)) / (float)n;
        }
    uint32_t t = 0;
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = 0; k < n; k++, t += 2) {
            const uint32_t a = i * (n + 1) + k, b = a + 1, c = a + n + 1, d = c + 1;
            const uint32_t corners[2][6] = {{a, c, b, b, c, d}, {a, c, d, a, d, b}};
            memcpy(s->indices + 3 * (size_t)t, corners[shift(t) > 0], sizeof corners[0]);
        }
}

static bool make_surface(surface* s, bool sphere, uint32_t n)
{
    *s = (surface){.sphere = sphere, .vertices = sphere ? 6 * (n + 1) * (n + 1) : (n + 1) * (n + 1), .triangles = sphere ? 12 * n * n : 2 * n * n};
    s->source = sphere ? n * n / 2 : s->triangles / 2 + n;
    s->positions = calloc(s->vertices, 3 * sizeof(float));
    s->indices = calloc(s->triangles, 3 * sizeof(uint32_t));
    if (!s->positions || !s->indices) return false;
    if (sphere) make_sphere(s, n);
    else make_plane(s, n);
    return true;
}

static void free_surface(surface* s)
{
    free(s->positions);
    free(s->indices);
}

static double milliseconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}

static void errors_of(const surface* s, const float* distances, double* mean, double* most)
{
    double from[3] = {0, 0, 0}, length = 0, sum = 0, all = 0;
    const float w[3] = {1 - 0.3f - 0.3f, 0.3f, 0.3f};
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++) from[k] += (double)w[c] * (double)s->positions[3 * (size_t)s->indices[3 * (size_t)s->source + c] + k];
    for (int k = 0; k < 3; k++) length += from[k] * from[k];
    length = s->sphere ? sqrt(length) : 1;
    *most = 0;
    for (uint32_t v = 0; v < s->vertices; v++) {
        double squared = 0;
        for (int k = 0; k < 3; k++) squared += pow((double)s->positions[3 * (size_t)v + k] - from[k] / length, 2);
        const double exact = s->sphere ? 2 * asin(fmin(1, 0.5 * sqrt(squared))) : sqrt(squared), error = fabs((double)distances[v] - exact);
        sum += error;
        all += exact;
        *most = fmax(*most, error);
    }
    *mean = 100 * sum / all;
    *most *= 100 * s->vertices / all;
}

typedef struct measured { double first, all, radius, mean, most; } measured;

/* One field, of a world made for it; `first`, `all` and `radius` in ms. */
static bool measure(const surface* s, es_geodesic_method method, uint32_t threads, measured* m)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_context* context;
    es_world* world = NULL;
    es_mesh mesh;
    es_instance instance;
    float* distances = malloc(s->vertices * sizeof *distances);
    if (!distances || es_context_create(&desc, &context) != ES_OK) {
        free(distances);
        return false;
    }
    const es_mesh_desc shape = {.vertex_count = s->vertices, .triangle_count = s->triangles, .positions = s->positions, .indices = s->indices, .flat_normals = true};
    bool good = es_world_create(context, NULL, &world) == ES_OK && es_world_add_mesh(world, &shape, &mesh) == ES_OK && es_world_add_instance(world, &(es_instance_desc){.mesh = mesh}, &instance) == ES_OK;
    double times[2], begin = milliseconds();
    for (int i = 0; i < 2 && good; i++) {
        good = es_world_geodesic(world, instance, s->source, 0.3f, 0.3f, method, 0, distances) == ES_OK;
        times[i] = milliseconds() - begin;
        begin = milliseconds();
    }
    if (good) {
        errors_of(s, distances, &m->mean, &m->most);
        begin = milliseconds();
        good = es_world_geodesic(world, instance, s->source, 0.3f, 0.3f, method, 0.3f, distances) == ES_OK;
        m->radius = milliseconds() - begin;
        m->first = times[0];
        m->all = times[1];
    }
    es_world_destroy(world);
    es_context_destroy(context);
    free(distances);
    return good;
}

int bench_geodesic(const bench_options* options)
{
    static double values[FIGURES][MAX_ROUNDS];
    surface sphere = {0}, plane = {0}, coarse = {0};
    bool good = make_surface(&sphere, true, 204) && make_surface(&plane, false, 500) && make_surface(&coarse, true, 8);
    for (uint32_t round = 0; round < options->runs && good; round++) {
        measured m[6] = {{0}};
        fprintf(stderr, "round %u of %u\n", round + 1, options->runs);
        for (int method = 0; method < 2 && good; method++)
            good = measure(&sphere, (es_geodesic_method)method, options->threads, &m[method]) && measure(&plane, (es_geodesic_method)method, options->threads, &m[2 + method]) &&
                   measure(&coarse, (es_geodesic_method)method, options->threads, &m[4 + method]);
        const double figures[FIGURES] = {[SPHERE_FRONT] = m[0].all, [SPHERE_EDGES] = m[1].all, [SPHERE_FIRST] = m[0].first, [SPHERE_RADIUS] = m[0].radius, [PLANE_FRONT] = m[2].all, [PLANE_EDGES] = m[3].all,
            [ERROR_SPHERE_FRONT] = m[0].mean, [ERROR_SPHERE_EDGES] = m[1].mean, [MOST_SPHERE_FRONT] = m[0].most, [ERROR_PLANE_FRONT] = m[2].mean, [ERROR_PLANE_EDGES] = m[3].mean,
            [COARSE_SPHERE_FRONT] = m[4].mean, [COARSE_SPHERE_EDGES] = m[5].mean};
        for (int i = 0; i < FIGURES; i++) values[i][round] = figures[i];
    }
    free_surface(&sphere);
    free_surface(&plane);
    free_surface(&coarse);
    if (!good) return demo_refuse("bench geodesic: there is no memory for meshes of 500,000 triangles");
    bench_row rows[FIGURES], shown[FIGURES];
    bench_geodesic_rows(rows, FIGURES);
    size_t count = 0;
    for (int i = 0; i < FIGURES; i++) {
        if (!bench_wants(options, rows[i].id)) continue;
        rows[i].value = bench_median(values[i], options->runs);
        if (i == SPHERE_FRONT || i == SPHERE_EDGES) {
            rows[i].peer_value = 139;
            rows[i].ratio = 139 / rows[i].value;
        }
        shown[count++] = rows[i];
    }
    bench_print(shown, count);
    bench_report report = {.name = "geodesic", .title = "Distances over meshes", .about = "The front through unfolded triangles, and the thesis' way along edges; medians over the rounds."};
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    int code = es_context_create(&desc, &context) == ES_OK ? DEMO_OK : demo_refuse("out of memory");
    if (code != DEMO_OK) return code;
    code = bench_report_write(&report, options, shown, count, context);
    es_context_destroy(context);
    return code;
}
