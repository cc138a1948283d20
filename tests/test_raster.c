/* The raster floor against references that share nothing with it: signed coverage of closed surfaces, a ray caster in double
 * precision, closed forms. */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <pthread.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "raster/raster.h"
#include "tests/races.h"

/* ---- helpers --------------------------------------------------------------------------------------------------------- */

typedef struct log_record { int count; es_result last; char message[1100]; } log_record;

static pthread_mutex_t record_lock = PTHREAD_MUTEX_INITIALIZER;

static void record(void* user, es_log_level level, es_result item, const char* message)
{
    log_record* r = user;
    pthread_mutex_lock(&record_lock); /* workers log, too */
    r->count++;
    r->last = item;
    snprintf(r->message, sizeof r->message, "%s", message);
    pthread_mutex_unlock(&record_lock);
}

typedef struct bench { es_context* context; es_rasterizer* rasterizer; log_record log; } bench;

static bench* open_bench(uint32_t threads, uint32_t isa_mask)
{
    bench* b = calloc(1, sizeof *b);
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isa_mask;
    desc.logger = (es_logger){record, &b->log};
    assert_int_equal(es_context_create(&desc, &b->context), ES_OK);
    assert_int_equal(es_rasterizer_create(b->context, &b->rasterizer), ES_OK);
    return b;
}

static void close_bench(bench* b)
{
    es_rasterizer_destroy(b->rasterizer);
    assert_int_equal(es_context_bytes(b->context), 0);
    es_context_destroy(b->context);
    free(b);
}

static uint32_t seed_state = 1;
static uint32_t random_bits(void) { return es_random_u32(7, seed_state++); }
static double uniform(double low, double high) { return low + (high - low) * (random_bits() / 4294967296.0); }

typedef struct mesh {
    float *positions, *previous, *normals, *tangents, *uvs, *colors;
    uint32_t* indices;
    uint32_t vertex_count, triangle_count, vertex_capacity, triangle_capacity;
} mesh;

static void* four_floats(uint32_t n) { return calloc((n + 7) / 8 * 8 + 8, 16); }
static mesh new_mesh(uint32_t vertices, uint32_t triangles)
{
    mesh m = {.vertex_capacity = vertices, .triangle_capacity = triangles};
    m.positions = four_floats(vertices);
    m.previous = four_floats(vertices);
    m.normals = four_floats(vertices);
    m.tangents = four_floats(vertices);
    m.uvs = four_floats(vertices);
    m.colors = four_floats(vertices);
    m.indices = calloc(3 * (size_t)triangles + 1, 4);
    return m;
}
static void free_mesh(mesh* m)
{
    free(m->positions);
    free(m->previous);
    free(m->normals);
    free(m->tangents);
    free(m->uvs);
    free(m->colors);
    free(m->indices);
}
static uint32_t add_vertex(mesh* m, double x, double y, double z)
{
    assert_true(m->vertex_count < m->vertex_capacity);
    float* p = m->positions + 4 * m->vertex_count;
    p[0] = (float)x;
    p[1] = (float)y;
    p[2] = (float)z;
    p[3] = 1;
    return m->vertex_count++;
}
static void add_triangle(mesh* m, uint32_t a, uint32_t b, uint32_t c)
{
    assert_true(m->triangle_count < m->triangle_capacity);
    uint32_t* i = m->indices + 3 * m->triangle_count++;
    i[0] = a;
    i[1] = b;
    i[2] = c;
}
static es_raster_mesh raster_mesh(const mesh* m)
{
    es_raster_mesh r = {.positions = m->positions, .indices = m->indices, .vertex_count = m->vertex_count, .triangle_count = m->triangle_count};
    float low[3] = {1e30f, 1e30f, 1e30f}, high[3] = {-1e30f, -1e30f, -1e30f};
    for (uint32_t v = 0; v < m->vertex_count; v++)
        for (int k = 0; k < 3; k++) {
            low[k] = fminf(low[k], m->positions[4 * v + k]);
            high[k] = fmaxf(high[k], m->positions[4 * v + k]);
        }
    r.bounds_min = (es_vec3){low[0], low[1], low[2]};
    r.bounds_max = (es_vec3){high[0], high[1], high[2]};
    return r;
}
static es_raster_instance instance_of(const es_raster_mesh* m)
{
    return (es_raster_instance){.mesh = m, .transform = es_mat4_identity(), .previous_transform = es_mat4_identity()};
}
static void quad(mesh* m, const float c[4][3], const float uv[4][2])
{
    uint32_t first = m->vertex_count;
    for (int i = 0; i < 4; i++) {
        uint32_t v = add_vertex(m, c[i][0], c[i][1], c[i][2]);
        if (uv) m->uvs[4 * v] = uv[i][0], m->uvs[4 * v + 1] = uv[i][1];
    }
    add_triangle(m, first, first + 1, first + 2);
    add_triangle(m, first, first + 2, first + 3);
}
static uint64_t hash_gbuffer(const es_gbuffer* g)
{
    const void* planes[] = {g->depth, g->normal, g->geometric_normal, g->albedo_rg, g->albedo_b, g->surface, g->emission, g->instance, g->triangle, g->motion_x, g->motion_y};
    uint64_t h = 0;
    for (size_t i = 0; i < sizeof planes / sizeof *planes; i++)
        for (uint32_t y = 0; planes[i] && y < g->height; y++) h = es_hash_bytes(h, (const uint32_t*)planes[i] + (size_t)y * g->stride, 4 * g->width);
    return h;
}
static const es_vec3 origin = {0, 0, 0}, ahead = {0, 0, -1}, up = {0, 1, 0};

/* ---- every pixel exactly once ---------------------------------------------------------------------------------------------- */

/* Front faces minus back faces over every pixel, drawing each triangle alone: for a surface without holes that is seen once it is 1
 * everywhere, also where snapping turned a sliver round. Returns the number of pixels that differ. */
static uint32_t miscovered(bench* b, const mesh* m, es_raster_view view, int expected)
{
    uint32_t stride = (view.width + 7) / 8 * 8;
    float* depth = malloc(4 * (size_t)stride * view.height);
    int* count = calloc((size_t)stride * view.height, sizeof *count);
    es_material_desc material = es_default_material_desc();
    es_raster_mesh r = raster_mesh(m);
    r.triangle_count = 1;
    for (uint32_t t = 0; t < m->triangle_count; t++) {
        r.indices = m->indices + 3 * t;
        es_raster_instance instance = instance_of(&r);
        es_draw_list list = {&instance, &material, 1, 1};
        for (int side = 0; side < 2; side++) {
            view.cull = side ? ES_CULL_FRONT : ES_CULL_BACK;
            assert_int_equal(es_draw_depth(b->rasterizer, &list, &view, depth, stride, NULL), ES_OK);
            for (uint32_t y = 0; y < view.height; y++)
                for (uint32_t x = 0; x < view.width; x++) count[y * stride + x] += depth[y * stride + x] > 0 ? (side ? -1 : 1) : 0;
        }
    }
    uint32_t wrong = 0;
    for (uint32_t y = 0; y < view.height; y++)
        for (uint32_t x = 0; x < view.width; x++) wrong += count[y * stride + x] != expected;
    free(depth);
    free(count);
    return wrong;
}

/* a random point inside a random triangle splits it into three; now and then a point on an edge, which makes slivers and fans */
static void split_triangle(mesh* m, uint32_t t, double lift)
{
    uint32_t* i = m->indices + 3 * t;
    double a = uniform(0, 1), b = uniform(0, 1);
    if (a + b > 1) a = 1 - a, b = 1 - b;
    if (random_bits() % 4 == 0) a *= 1e-4;
    uint32_t p[3] = {i[0], i[1], i[2]};
    const float* v[3];
    for (int k = 0; k < 3; k++) v[k] = m->positions + 4 * p[k];
    double q[3];
    for (int k = 0; k < 3; k++) q[k] = v[0][k] + a * ((double)v[1][k] - v[0][k]) + b * ((double)v[2][k] - v[0][k]);
    double s = 1 + uniform(-lift, lift); /* along the line of sight: the picture of the surface keeps its edges */
    uint32_t n = add_vertex(m, q[0] * s, q[1] * s, q[2] * s);
    i[2] = n;
    add_triangle(m, p[1], p[2], n);
    add_triangle(m, p[2], p[0], n);
}

static void test_shared_edges(void** state)
{
    bench* b = open_bench(1, 0);
    for (int trial = 0; trial < 24; trial++) {
        /* a screen-filling pair of triangles, then random splits; sizes that are no multiple of a tile or a vector */
        uint32_t width = 20 + random_bits() % 120, height = 20 + random_bits() % 90;
        mesh m = new_mesh(4 + 200, 2 + 400);
        double e = trial % 3 == 0 ? 200 : 6; /* wider than the widest view here, or beyond the guard band */
        quad(&m, (float[4][3]){{(float)-e, (float)-e, -1}, {(float)e, (float)-e, -1}, {(float)e, (float)e, -1}, {(float)-e, (float)e, -1}}, NULL);
        for (int i = 0; i < 60; i++) split_triangle(&m, random_bits() % m.triangle_count, 0.2);
        es_raster_view view = es_perspective_view(width, height, origin, ahead, up, 1.2f, 0.05f);
        assert_int_equal(miscovered(b, &m, view, 1), 0);
        free_mesh(&m);
    }
    close_bench(b);
}

static void test_fans(void** state)
{
    bench* b = open_bench(1, 0);
    for (int trial = 0; trial < 12; trial++) {
        /* a fan of many slivers about a point, at a pixel centre, a pixel corner or anywhere; rim vertices on such places too */
        uint32_t n = 3 + random_bits() % 90, size = 96;
        mesh m = new_mesh(n + 1, n);
        double grid = trial % 3 == 0 ? 0.5 : trial % 3 == 1 ? 1.0 : 1e-9;
        double cx = floor(uniform(-20, 20)) + grid, cy = floor(uniform(-20, 20)) + grid;
        double scale = 1.0 / 48; /* view of 90 degrees: x = 1 is 48 pixels from the centre */
        add_vertex(&m, cx * scale, cy * scale, -1);
        for (uint32_t i = 0; i < n; i++) {
            double angle = 2 * 3.14159265358979 * i / n, r = trial % 2 ? 2000 : 400;
            add_vertex(&m, (trial % 3 == 2 ? cx + r * cos(angle) : floor(cx + r * cos(angle)) + grid) * scale, (trial % 3 == 2 ? cy + r * sin(angle) : floor(cy + r * sin(angle)) + grid) * scale, -1);
        }
        for (uint32_t i = 0; i < n; i++) add_triangle(&m, 0, 1 + i, 1 + (i + 1) % n);
        es_raster_view view = es_perspective_view(size, size, origin, ahead, up, ES_PI / 2, 0.05f);
        if (n >= 8) assert_int_equal(miscovered(b, &m, view, 1), 0);
        free_mesh(&m);
    }
    close_bench(b);
}

/* A grid of small triangles whose corners are pixel centres and pixel corners: pixel centres lie on edges and vertices everywhere. */
static void test_small_grid(void** state)
{
    bench* b = open_bench(1, 0);
    for (int trial = 0; trial < 6; trial++) {
        static const double steps[] = {0.5, 1, 1.5, 2, 6, 10};
        enum { N = 12 };
        mesh m = new_mesh((N + 1) * (N + 1), 2 * N * N);
        double step = steps[trial] * 0.0625; /* view of 90 degrees and 32 pixels: x = 1 is 16 pixels, exact in binary */
        for (int j = 0; j <= N; j++)
            for (int i = 0; i <= N; i++) add_vertex(&m, (i - N / 2) * step + 0.03125, (j - N / 2) * step + 0.03125, -1);
        for (uint32_t j = 0; j < N; j++)
            for (uint32_t i = 0; i < N; i++) {
                uint32_t a = j * (N + 1) + i, c = a + N + 1;
                bool other = random_bits() & 1;
                add_triangle(&m, a, a + 1, other ? c : c + 1);
                add_triangle(&m, other ? a + 1 : a, c + 1, c);
            }
        es_raster_view view = es_perspective_view(32, 32, origin, ahead, up, 1.5f, 0.05f);
        view.projection.m[0] = view.projection.m[5] = 1;
        /* pixels whose centre is inside, on the left or on the top border, counted by hand: N * step a side, or all */
        uint32_t side = (uint32_t)(N * steps[trial]);
        uint32_t inside = side < 32 ? side * side : 32 * 32;
        assert_int_equal(miscovered(b, &m, view, 1), 32 * 32 - inside);
        assert_int_equal(miscovered(b, &m, view, 0), inside); /* and nothing outside is drawn, or drawn twice */
        free_mesh(&m);
    }
    close_bench(b);
}

static void add_box(mesh* m, const double low[3], const double high[3])
{
    uint32_t v[8];
    for (int c = 0; c < 8; c++) v[c] = add_vertex(m, c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]);
    static const int faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}; /* clockwise from outside undone below */
    for (int f = 0; f < 6; f++) {
        add_triangle(m, v[faces[f][0]], v[faces[f][1]], v[faces[f][2]]);
        add_triangle(m, v[faces[f][0]], v[faces[f][2]], v[faces[f][3]]);
    }
}

/* The eye inside a closed, finely cut box, close to its walls and corners: triangles cross the near plane, the eye's plane and the
 * guard band on all sides. Seen from inside, the box covers each pixel once. */
static void test_inside_a_box(void** state)
{
    bench* b = open_bench(1, 0);
    for (int trial = 0; trial < 24; trial++) {
        mesh m = new_mesh(8 + 80, 12 + 160);
        const double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
        add_box(&m, low, high);
        for (int i = 0; i < 60; i++) split_triangle(&m, random_bits() % m.triangle_count, 0);
        double reach = trial % 2 ? 0.999 : 0.9;
        es_vec3 eye = {(float)uniform(-reach, reach), (float)uniform(-reach, reach), (float)uniform(-reach, reach)};
        es_vec3 d = {(float)uniform(-1, 1), (float)uniform(-1, 1), (float)uniform(-1, 1)};
        es_raster_view view = es_perspective_view(100, 70, eye, d, up, (float)uniform(0.3, 2.2), 1e-4f);
        uint32_t front = miscovered(b, &m, view, 1), back = miscovered(b, &m, view, -1);
        assert_int_equal(front < back ? front : back, 0);
        free_mesh(&m);
    }
    close_bench(b);
}

/* Closed surfaces in front of the eye: whatever the winding, each ray enters as often as it leaves. */
static void test_closed_soup(void** state)
{
    bench* b = open_bench(1, 0);
    for (int trial = 0; trial < 8; trial++) {
        mesh m = new_mesh(9 * 20, 12 * 20);
        for (int i = 0; i < 16; i++) {
            uint32_t first = m.vertex_count;
            add_box(&m, (double[3]){-1, -1, -1}, (double[3]){1, 1, 1});
            double c[3] = {uniform(-3, 3), uniform(-3, 3), uniform(-7, -5)}, s = pow(10, uniform(-3, 0)); /* some smaller than a pixel */
            for (uint32_t v = first; v < m.vertex_count; v++)
                for (int k = 0; k < 3; k++) m.positions[4 * v + k] = (float)(c[k] + s * (m.positions[4 * v + k] + uniform(-0.6, 0.6)));
        }
        es_raster_view view = es_perspective_view(130, 90, origin, ahead, up, 1.0f, 0.1f);
        assert_int_equal(miscovered(b, &m, view, 0), 0);
        free_mesh(&m);
    }
    close_bench(b);
}

/* The count must be able to notice a hole: the same check with a vertex of one triangle torn off. */
static void test_coverage_notices_a_tear(void** state)
{
    bench* b = open_bench(1, 0);
    mesh m = new_mesh(64, 128);
    quad(&m, (float[4][3]){{-3, -3, -1}, {3, -3, -1}, {3, 3, -1}, {-3, 3, -1}}, NULL);
    uint32_t v = add_vertex(&m, 0, 0, -1), torn = add_vertex(&m, 0.02, 0.02, -1);
    m.triangle_count = 0;
    add_triangle(&m, 0, 1, v);
    add_triangle(&m, 1, 2, v);
    add_triangle(&m, 2, 3, v);
    add_triangle(&m, 3, 0, torn);
    es_raster_view view = es_perspective_view(96, 96, origin, ahead, up, 1.2f, 0.05f);
    assert_true(miscovered(b, &m, view, 1) > 0);
    free_mesh(&m);
    close_bench(b);
}

/* ---- a random scene against a ray caster in double ----------------------------------------------------------------------------- */

enum { SCENE_MESHES = 3, SCENE_INSTANCES = 7 };
typedef struct scene {
    mesh meshes[SCENE_MESHES];
    es_raster_mesh raster[SCENE_MESHES];
    es_raster_instance instances[SCENE_INSTANCES];
    es_material_desc materials[3];
    es_draw_list list;
} scene;

static void sphere_mesh(mesh* m, int n)
{
    *m = new_mesh((uint32_t)((n + 1) * (2 * n + 1)), (uint32_t)(4 * n * n));
    for (int j = 0; j <= n; j++)
        for (int i = 0; i <= 2 * n; i++) {
            double theta = 3.14159265358979 * j / n, phi = 3.14159265358979 * i / n;
            double d[3] = {sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi)};
            uint32_t v = add_vertex(m, d[0], d[1], d[2]);
            for (int k = 0; k < 3; k++) {
                m->normals[4 * v + k] = (float)(d[k] * 2.5);
                m->colors[4 * v + k] = (float)(0.5 + 0.5 * d[k]);
                m->previous[4 * v + k] = (float)(d[k] * 0.97 + 0.01 * k);
            }
            m->previous[4 * v + 3] = m->colors[4 * v + 3] = 1;
        }
    for (int j = 0; j < n; j++)
        for (int i = 0; i < 2 * n; i++) {
            uint32_t a = (uint32_t)(j * (2 * n + 1) + i), c = a + (uint32_t)(2 * n + 1);
            add_triangle(m, a, a + 1, c + 1);
            add_triangle(m, a, c + 1, c);
        }
}

static es_mat4 random_transform(int kind)
{
    es_vec3 axis = es_v3_normalize(es_v3((float)uniform(-1, 1), (float)uniform(-1, 1), (float)uniform(-1, 1)), up);
    float s = (float)uniform(0.4, 1.2);
    es_vec3 scale = kind == 1 ? es_v3(-s, 0.7f * s, s) : kind == 2 ? es_v3(s, 0.3f * s, 1.3f * s) : es_v3(s, s, s);
    return es_mat4_from_trs(es_v3((float)uniform(-2, 2), (float)uniform(-1.5, 1.5), (float)uniform(-6, -3)), es_quat_from_axis_angle(axis, (float)uniform(0, 6)), scale);
}

static scene* new_scene(void)
{
    scene* s = calloc(1, sizeof *s);
    sphere_mesh(&s->meshes[0], 6);
    sphere_mesh(&s->meshes[1], 9);
    s->meshes[2] = new_mesh(300, 100); /* triangles anywhere */
    for (int t = 0; t < 100; t++) {
        double c[3] = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)};
        for (int k = 0; k < 3; k++) {
            uint32_t v = add_vertex(&s->meshes[2], c[0] + uniform(-0.4, 0.4), c[1] + uniform(-0.4, 0.4), c[2] + uniform(-0.4, 0.4));
            for (int i = 0; i < 3; i++) s->meshes[2].colors[4 * v + i] = (float)uniform(0, 1);
        }
        add_triangle(&s->meshes[2], 3 * (uint32_t)t, 3 * (uint32_t)t + 1, 3 * (uint32_t)t + 2);
    }
    for (int i = 0; i < SCENE_MESHES; i++) {
        s->raster[i] = raster_mesh(&s->meshes[i]);
        s->raster[i].colors = s->meshes[i].colors;
        if (i < 2) s->raster[i].normals = s->meshes[i].normals;
    }
    s->raster[1].previous_positions = s->meshes[1].previous;
    for (int i = 0; i < 3; i++) s->materials[i] = es_default_material_desc();
    s->materials[1].base_color[1] = 0.5f;
    s->materials[1].roughness = 0.25f;
    s->materials[1].metallic = 0.75f;
    s->materials[1].emission[0] = 3;
    s->materials[2].double_sided = true;
    s->materials[2].model = ES_SURFACE_PHONG;
    for (int i = 0; i < SCENE_INSTANCES; i++) {
        es_raster_instance* instance = &s->instances[i];
        instance->mesh = &s->raster[i % SCENE_MESHES];
        instance->material = i % SCENE_MESHES == 2 ? 2 : (uint32_t)i & 1;
        instance->id = 100 + (uint32_t)i;
        instance->transform = instance->previous_transform = random_transform(i / 2 % 3);
        if (i % 2) instance->previous_transform.m[12] += 0.2f, instance->previous_transform.m[0] *= 1.1f;
    }
    s->list = (es_draw_list){s->instances, s->materials, SCENE_INSTANCES, 3};
    return s;
}
static void free_scene(scene* s)
{
    for (int i = 0; i < SCENE_MESHES; i++) free_mesh(&s->meshes[i]);
    free(s);
}

static void apply(const es_mat4* m, const double p[3], double w, double out[4])
{
    for (int r = 0; r < 4; r++) out[r] = (double)m->m[r] * p[0] + (double)m->m[4 + r] * p[1] + (double)m->m[8 + r] * p[2] + (double)m->m[12 + r] * w;
}
static void cross3(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}
static double dot3(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void unit3(double a[3])
{
    double l = sqrt(dot3(a, a));
    for (int k = 0; k < 3; k++) a[k] /= l;
}
static double angle_between(const double a[3], es_vec3 b)
{
    double c[3] = {b.x, b.y, b.z}, d[3];
    cross3(a, c, d);
    return atan2(sqrt(dot3(d, d)), dot3(a, c));
}

/* A ray: origin + s * direction, s = 1 at distance 1 along the view axis. */
typedef struct ray { double o[3], d[3]; } ray;
static ray pixel_ray(const es_raster_view* v, double px, double py)
{
    es_mat4 inverse;
    assert_true(es_mat4_inverse(&v->view, &inverse));
    double ex = ((px / v->width) * 2 - 1), ey = 1 - (py / v->height) * 2;
    bool ortho = v->projection.m[11] == 0;
    double e[3] = {ex / v->projection.m[0], ey / v->projection.m[5], ortho ? 0 : -1}, z[3] = {0, 0, -1}, zero[3] = {0, 0, 0}, r[4];
    ray out;
    apply(&inverse, ortho ? e : zero, 1, r);
    memcpy(out.o, r, sizeof out.o);
    apply(&inverse, ortho ? z : e, 0, r);
    memcpy(out.d, r, sizeof out.d);
    return out;
}

typedef struct hit { double s, u, v, determinant; uint32_t instance, triangle; } hit;

/* `slack` widens the triangle's barycentric bounds */
static bool hit_triangle(const scene* sc, uint32_t i, uint32_t t, const ray* r, double slack, bool cull, hit* h)
{
    const es_raster_instance* instance = &sc->instances[i];
    const uint32_t* index = instance->mesh->indices + 3 * t;
    double p[3][4];
    for (int k = 0; k < 3; k++) {
        const float* f = instance->mesh->positions + 4 * index[k];
        apply(&instance->transform, (double[3]){f[0], f[1], f[2]}, 1, p[k]);
    }
    double e1[3], e2[3], pv[3], tv[3], qv[3];
    for (int k = 0; k < 3; k++) e1[k] = p[1][k] - p[0][k], e2[k] = p[2][k] - p[0][k], tv[k] = r->o[k] - p[0][k];
    cross3(r->d, e2, pv);
    double det = dot3(e1, pv);
    if (det == 0) return false;
    bool mirrored = es_mat4_determinant3(&instance->transform) < 0;
    if (cull && !sc->materials[instance->material].double_sided && (det < 0) != mirrored) return false;
    double u = dot3(tv, pv) / det;
    cross3(tv, e1, qv);
    double v = dot3(r->d, qv) / det, s = dot3(e2, qv) / det;
    if (u < -slack || v < -slack || u + v > 1 + slack || s <= 0) return false;
    *h = (hit){s, u, v, mirrored ? -det : det, i, t};
    return true;
}

static void check_view(bench* b, scene* sc, es_raster_view view)
{
    es_gbuffer g;
    es_raster_stats stats;
    assert_int_equal(es_gbuffer_create(b->context, view.width, view.height, ES_GBUFFER_ALL, &g), ES_OK);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &sc->list, &view, &g, &stats), ES_OK);
    float* depth = malloc(4 * (size_t)g.stride * g.height);
    assert_int_equal(es_draw_depth(b->rasterizer, &sc->list, &view, depth, g.stride, NULL), ES_OK);
    uint64_t seen = 0, compared = 0, other = 0;
    double worst_depth = 0, worst_normal = 0, worst_geometric = 0, worst_albedo = 0, worst_motion = 0;
    for (uint32_t y = 0; y < g.height; y++)
        for (uint32_t x = 0; x < g.width; x++) {
            size_t at = (size_t)y * g.stride + x;
            ray r = pixel_ray(&view, x + 0.5, y + 0.5);
            hit best = {.s = 1e300}, h;
            for (uint32_t i = 0; i < sc->list.instance_count; i++)
                for (uint32_t t = 0; t < sc->instances[i].mesh->triangle_count; t++)
                    if (hit_triangle(sc, i, t, &r, 0, view.cull == ES_CULL_BACK, &h) && h.s < best.s) best = h;
            bool drawn = g.depth[at] > 0;
            seen += drawn;
            assert_true(drawn == (depth[at] > 0));
            if (!drawn) {
                assert_true(!g.normal[at] && !g.geometric_normal[at] && !g.albedo_rg[at] && !g.albedo_b[at] && !g.surface[at] && !g.emission[at] &&
                            g.motion_x[at] == 0 && g.motion_y[at] == 0 && !g.instance[at] && !g.triangle[at]);
                other += best.s < 1e300;
                continue;
            }
            if (best.s > 1e299 || g.instance[at] != sc->instances[best.instance].id + 1 || g.triangle[at] != best.triangle + 1) {
                other++;
                continue;
            }
            compared++;
            const es_raster_instance* instance = &sc->instances[best.instance];
            const es_material_desc* material = &sc->materials[instance->material];
            const uint32_t* index = instance->mesh->indices + 3 * best.triangle;
            double l[3] = {1 - best.u - best.v, best.u, best.v}, error;
            if ((error = fabs(g.depth[at] - best.s) / best.s) > worst_depth) worst_depth = error;
            bool back = best.determinant < 0;
            double p[3][4], n[3], e1[3], e2[3], here[3] = {0, 0, 0}, previous[3] = {0, 0, 0}, normal[3] = {0, 0, 0}, color[3] = {0, 0, 0};
            for (int k = 0; k < 3; k++) {
                const float* f = instance->mesh->positions + 4 * index[k];
                const float* q = (instance->mesh->previous_positions ? instance->mesh->previous_positions : instance->mesh->positions) + 4 * index[k];
                apply(&instance->transform, (double[3]){f[0], f[1], f[2]}, 1, p[k]);
                double pp[4];
                apply(&instance->previous_transform, (double[3]){q[0], q[1], q[2]}, 1, pp);
                for (int i = 0; i < 3; i++) {
                    here[i] += l[k] * p[k][i];
                    previous[i] += l[k] * pp[i];
                    if (instance->mesh->normals) normal[i] += l[k] * instance->mesh->normals[4 * index[k] + i];
                    color[i] += l[k] * instance->mesh->colors[4 * index[k] + i];
                }
            }
            for (int i = 0; i < 3; i++) e1[i] = p[1][i] - p[0][i], e2[i] = p[2][i] - p[0][i];
            cross3(e1, e2, n);
            unit3(n);
            if (dot3(n, r.d) > 0)
                for (int i = 0; i < 3; i++) n[i] = -n[i];
            if ((error = angle_between(n, es_unpack_normal(g.geometric_normal[at]))) > worst_geometric) worst_geometric = error;
            if (instance->mesh->normals) {
                es_mat4 inverse;
                double w[3];
                es_mat4_inverse(&instance->transform, &inverse);
                for (int i = 0; i < 3; i++) w[i] = inverse.m[4 * i] * normal[0] + inverse.m[4 * i + 1] * normal[1] + inverse.m[4 * i + 2] * normal[2];
                unit3(w);
                if (back)
                    for (int i = 0; i < 3; i++) w[i] = -w[i];
                error = angle_between(w, es_unpack_normal(g.normal[at]));
            } else {
                error = angle_between(n, es_unpack_normal(g.normal[at]));
            }
            if (error > worst_normal) worst_normal = error;
            double albedo[3] = {(g.albedo_rg[at] & 0xffff) / 65535.0, (g.albedo_rg[at] >> 16) / 65535.0, (g.albedo_b[at] & 0xffff) / 65535.0};
            for (int i = 0; i < 3; i++)
                if ((error = fabs(albedo[i] - material->base_color[i] * color[i])) > worst_albedo) worst_albedo = error;
            assert_int_equal(g.albedo_b[at] >> 16, instance->material);
            double before[4], clip[4];
            apply(&view.previous_view, previous, 1, before);
            apply(&view.previous_projection, before, 1, clip);
            double mx = (x + 0.5) - (clip[0] / clip[3] * 0.5 + 0.5) * view.width, my = (y + 0.5) - (0.5 - clip[1] / clip[3] * 0.5) * view.height;
            if ((error = hypot(mx - g.motion_x[at], my - g.motion_y[at])) > worst_motion) worst_motion = error;
            if (!instance->mesh->previous_positions && !memcmp(&instance->transform, &instance->previous_transform, sizeof instance->transform) &&
                !memcmp(&view.view, &view.previous_view, sizeof view.view))
                assert_true(g.motion_x[at] == 0 && g.motion_y[at] == 0);
            uint32_t surface = g.surface[at];
            assert_int_equal(surface >> 24, material->model);
            assert_int_equal(surface & 0xff, (int)(material->metallic * 255 + 0.5));
            assert_int_equal(surface >> 8 & 0xff, material->model == ES_SURFACE_PHONG ? (int)(material->exponent * 5) : (int)(material->roughness * 255 + 0.5));
            assert_float_equal(es_unpack_rgb9e5(g.emission[at]).x, material->emission[0], 1e-2);
        }
    assert_int_equal(stats.pixels, seen);
    print_message("    %ux%u: %lu pixels of one triangle, %lu of another; worst depth %.2g normal %.2g geometric %.2g albedo %.2g motion %.2g px\n", view.width, view.height,
        (unsigned long)compared, (unsigned long)other, worst_depth, worst_normal, worst_geometric, worst_albedo, worst_motion);
    assert_true(compared > (uint64_t)g.width * g.height / 8);
    assert_true(other * 50 < compared); /* where the ray passes within a 1/256 pixel of an edge, and interpenetrations */
    assert_true(worst_depth < 2e-3 && worst_normal < 2e-2 && worst_geometric < 1e-2 && worst_albedo < 5e-3 && worst_motion < 0.05);
    free(depth);
    es_gbuffer_destroy(b->context, &g);
}

static void test_against_rays(void** state)
{
    bench* b = open_bench(2, 0);
#if defined(__SANITIZE_ADDRESS__)
    const uint32_t part = 2; /* every ray tries every triangle */
#else
    const uint32_t part = 1;
#endif
    for (int trial = 0; trial < 3; trial++) {
        scene* s = new_scene();
        es_vec3 eye = {(float)uniform(-0.5, 0.5), (float)uniform(-0.5, 0.5), 0};
        es_raster_view view = es_perspective_view(149 / part, 101 / part, eye, (es_vec3){0.1f, -0.05f, -1}, up, 1.1f, 0.1f);
        view.cull = trial == 0 ? ES_CULL_NONE : ES_CULL_BACK;
        if (trial == 2) view.previous_view = es_mat4_look((es_vec3){eye.x + 0.1f, eye.y, 0.05f}, (es_vec3){0.15f, -0.05f, -1}, up);
        check_view(b, s, view);
        es_raster_view flat = es_orthographic_view(120 / part, 90 / part, (es_vec3){0.1f, 0.2f, 0}, (es_vec3){0.1f, 0.02f, -1}, up, 3, 2.25f, 0.1f, 20);
        flat.cull = view.cull;
        check_view(b, s, flat);
        free_scene(s);
    }
    close_bench(b);
}

/* Interpolation along a plane seen at a grazing angle, near and far in one triangle: colour must be linear on the plane. */
static void test_perspective_correct(void** state)
{
    bench* b = open_bench(1, 0);
    mesh m = new_mesh(3, 1);
    const double corners[3][3] = {{-50, -1, -100}, {50, -1, -100}, {0, -1, 2}};
    for (int k = 0; k < 3; k++) {
        uint32_t v = add_vertex(&m, corners[k][0], corners[k][1], corners[k][2]);
        m.colors[4 * v] = (float)((corners[k][2] + 100) / 102);
        m.colors[4 * v + 1] = (float)((corners[k][0] + 50) / 100);
    }
    add_triangle(&m, 2, 1, 0);
    es_raster_mesh r = raster_mesh(&m);
    r.colors = m.colors;
    es_raster_instance instance = instance_of(&r);
    es_material_desc material = es_default_material_desc();
    es_draw_list list = {&instance, &material, 1, 1};
    es_raster_view view = es_perspective_view(333, 201, origin, ahead, up, 1.4f, 0.01f);
    es_gbuffer g;
    es_gbuffer_create(b->context, 333, 201, ES_GBUFFER_DEPTH | ES_GBUFFER_ALBEDO, &g);
    assert_null(g.normal);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
    int seen = 0;
    for (uint32_t y = 0; y < 201; y++)
        for (uint32_t x = 0; x < 333; x++) {
            size_t at = (size_t)y * g.stride + x;
            if (!(g.depth[at] > 0)) continue;
            seen++;
            ray ray = pixel_ray(&view, x + 0.5, y + 0.5);
            double s = -1 / ray.d[1], z = s * ray.d[2], px = s * ray.d[0];
            if (z < -99.5 || z > 1.9 || fabs(px) > (2 - z) * 50 / 102 * 0.999) continue; /* within a 1/256 pixel of the border */
            assert_float_equal(g.depth[at], s, s * 1e-4);
            assert_float_equal((g.albedo_rg[at] & 0xffff) / 65535.0, (z + 100) / 102, 3e-5 + s * 1e-5);
            assert_float_equal((g.albedo_rg[at] >> 16) / 65535.0, (px + 50) / 100, 3e-5 + s * 1e-5);
        }
    assert_true(seen > 8000);
    es_gbuffer_destroy(b->context, &g);
    free_mesh(&m);
    close_bench(b);
}

/* ---- views ------------------------------------------------------------------------------------------------------------------------ */

static void test_inside_depth(void** state)
{
    bench* b = open_bench(1, 0);
    mesh m = new_mesh(8, 12);
    add_box(&m, (double[3]){-1, -1, -1}, (double[3]){1, 1, 1});
    es_raster_mesh r = raster_mesh(&m);
    es_raster_instance instance = instance_of(&r);
    es_material_desc material = es_default_material_desc();
    es_draw_list list = {&instance, &material, 1, 1};
    es_vec3 eye = {0.98f, -0.5f, 0.3f};
    es_raster_view faces[6];
    es_cube_views(64, eye, 0.001f, faces);
    es_gbuffer g;
    es_gbuffer_create(b->context, 64, 64, ES_GBUFFER_ALL, &g);
    for (int f = 0; f < 6; f++) {
        faces[f].cull = ES_CULL_NONE;
        assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &faces[f], &g, NULL), ES_OK);
        for (uint32_t y = 0; y < 64; y++)
            for (uint32_t x = 0; x < 64; x++) {
                ray ray = pixel_ray(&faces[f], x + 0.5, y + 0.5);
                double s = 1e9;
                int wall = 0;
                for (int k = 0; k < 3; k++) {
                    double t = ((ray.d[k] > 0 ? 1 : -1) - ray.o[k]) / ray.d[k];
                    if (ray.d[k] != 0 && t < s) s = t, wall = k;
                }
                assert_true(g.depth[y * g.stride + x] > 0);
                assert_float_equal(g.depth[y * g.stride + x], s, s * 0.02); /* either wall in a corner pixel */
                es_vec3 n = es_unpack_normal(g.geometric_normal[y * g.stride + x]);
                assert_true(n.x * ray.d[0] + n.y * ray.d[1] + n.z * ray.d[2] < 0);
                double axis[3] = {0, 0, 0};
                axis[wall] = ray.d[wall] > 0 ? -1 : 1;
                if (x % 9 == 4 && y % 9 == 4) assert_true(angle_between(axis, n) < 1e-3 || angle_between(axis, n) > 1.5);
            }
        /* +x -x +y -y +z -z: the middle of each looks along its axis */
        ray middle = pixel_ray(&faces[f], 32, 32);
        for (int k = 0; k < 3; k++) assert_float_equal(middle.d[k], k == f / 2 ? (f % 2 ? -1 : 1) : 0, 1e-6);
    }
    es_gbuffer_destroy(b->context, &g);
    free_mesh(&m);
    close_bench(b);
}

static uint64_t pixels_drawn(bench* b, const es_draw_list* list, es_raster_view view, es_cull cull, es_gbuffer* g)
{
    es_raster_stats stats;
    view.cull = cull;
    assert_int_equal(es_draw_gbuffer(b->rasterizer, list, &view, g, &stats), ES_OK);
    return stats.pixels;
}

static void test_culling(void** state)
{
    bench* b = open_bench(1, 0);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-1, -1, -3}, {1, -1, -3}, {1, 1, -3}, {-1, 1, -3}}, NULL); /* counter-clockwise to the eye */
    for (int i = 0; i < 4; i++) m.normals[4 * i + 2] = 1;
    es_raster_mesh r = raster_mesh(&m);
    r.normals = m.normals;
    es_raster_instance instance = instance_of(&r);
    es_material_desc material = es_default_material_desc();
    es_draw_list list = {&instance, &material, 1, 1};
    es_raster_view view = es_perspective_view(64, 64, origin, ahead, up, 1.5f, 0.1f);
    es_gbuffer g;
    es_gbuffer_create(b->context, 64, 64, ES_GBUFFER_ALL, &g);
    uint64_t all = pixels_drawn(b, &list, view, ES_CULL_NONE, &g);
    assert_true(all > 300);
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        instance.transform.m[0] = instance.previous_transform.m[0] = mirrored ? -1 : 1;
        assert_int_equal(pixels_drawn(b, &list, view, ES_CULL_BACK, &g), all);
        assert_int_equal(pixels_drawn(b, &list, view, ES_CULL_FRONT, &g), 0);
        assert_int_equal(pixels_drawn(b, &list, view, ES_CULL_NONE, &g), all);
        assert_float_equal(es_unpack_normal(g.normal[32 * g.stride + 32]).z, 1, 1e-4);
        /* from behind */
        es_raster_view behind = es_perspective_view(64, 64, (es_vec3){0, 0, -6}, (es_vec3){0, 0, 1}, up, 1.5f, 0.1f);
        assert_int_equal(pixels_drawn(b, &list, behind, ES_CULL_BACK, &g), 0);
        assert_int_equal(pixels_drawn(b, &list, behind, ES_CULL_FRONT, &g), all);
        assert_float_equal(es_unpack_normal(g.normal[32 * g.stride + 32]).z, -1, 1e-4);
        material.double_sided = true;
        assert_int_equal(pixels_drawn(b, &list, behind, ES_CULL_BACK, &g), all);
        assert_float_equal(es_unpack_normal(g.normal[32 * g.stride + 32]).z, -1, 1e-4);
        assert_int_equal(pixels_drawn(b, &list, view, ES_CULL_FRONT, &g), all);
        assert_float_equal(es_unpack_normal(g.normal[32 * g.stride + 32]).z, 1, 1e-4);
        material.double_sided = false;
    }
    /* outside the view: culled as a whole */
    instance.transform.m[12] = 100;
    es_raster_stats stats;
    es_draw_gbuffer(b->rasterizer, &list, &view, &g, &stats);
    assert_int_equal(stats.instances_culled, 1);
    assert_int_equal(stats.pixels, 0);
    es_gbuffer_destroy(b->context, &g);
    free_mesh(&m);
    close_bench(b);
}

/* ---- bad input ---------------------------------------------------------------------------------------------------------------------- */

static void test_bad_vertices(void** state)
{
#if defined(ES_TRAP_FP)
    skip(); /* the NaNs are the caller's here, and comparing them traps */
#endif
    bench* b = open_bench(2, 0);
    scene* s = new_scene();
    es_raster_view view = es_perspective_view(100, 80, origin, ahead, up, 1.1f, 0.1f);
    es_gbuffer clean, g;
    es_gbuffer_create(b->context, 100, 80, ES_GBUFFER_ALL, &clean);
    es_gbuffer_create(b->context, 100, 80, ES_GBUFFER_ALL, &g);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &s->list, &view, &clean, NULL), ES_OK);
    /* one more instance of nothing but bad triangles changes no pixel */
    const float bad[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, FLT_MAX, -FLT_MAX};
    mesh m = new_mesh(300, 400);
    for (int i = 0; i < 98; i++) {
        uint32_t a = add_vertex(&m, uniform(-1, 1), uniform(-1, 1), -2), c = add_vertex(&m, uniform(-1, 1), uniform(-1, 1), -2);
        uint32_t d = add_vertex(&m, uniform(-1, 1), uniform(-1, 1), -2);
        m.positions[4 * d + random_bits() % 3] = bad[i % 7];
        add_triangle(&m, a, c, d);
        add_triangle(&m, a, a, c);
        add_triangle(&m, c, c, c);
    }
    uint32_t p = add_vertex(&m, 0, 0, -2), q = add_vertex(&m, 0.25, 0.25, -2), o = add_vertex(&m, 0.5, 0.5, -2);
    add_triangle(&m, p, q, o); /* three points on a line */
    es_raster_mesh r = raster_mesh(&m);
    r.bounds_min = (es_vec3){-INFINITY, NAN, -INFINITY};
    r.bounds_max = (es_vec3){INFINITY, NAN, INFINITY};
    es_raster_mesh empty = {0};
    es_raster_instance instances[SCENE_INSTANCES + 3];
    memcpy(instances, s->instances, sizeof s->instances);
    instances[SCENE_INSTANCES] = instance_of(&r);
    instances[SCENE_INSTANCES + 1] = instance_of(&empty);
    instances[SCENE_INSTANCES + 2] = s->instances[0];
    instances[SCENE_INSTANCES + 2].transform.m[0] = NAN; /* all of it is dropped */
    es_draw_list list = {instances, s->materials, SCENE_INSTANCES + 3, 3};
    view.cull = ES_CULL_BACK;
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
    assert_true(hash_gbuffer(&g) == hash_gbuffer(&clean));
    /* zero scale in one axis or in all, huge and tiny scales: no crash, finite results */
    for (int i = 0; i < 6; i++) {
        es_raster_instance* instance = &instances[SCENE_INSTANCES + 2];
        *instance = s->instances[0];
        float factor = i < 3 ? 0.0f : i == 3 ? 1e18f : i == 4 ? 1e-18f : 1e-30f;
        for (int k = 0; k < 12; k++)
            if (i == 2 || i > 2 || k / 4 == i) instance->transform.m[k] *= factor;
        assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
        for (size_t at = 0; at < (size_t)g.stride * g.height; at++)
            if (at % g.stride < g.width) assert_true(isfinite(g.depth[at]) && isfinite(g.motion_x[at]) && isfinite(g.motion_y[at]));
    }
    /* nothing at all */
    es_draw_list none = {NULL, NULL, 0, 0};
    es_raster_stats stats;
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &none, &view, &g, &stats), ES_OK);
    assert_int_equal(stats.pixels, 0);
    for (size_t at = 0; at < (size_t)g.stride * g.height; at++)
        if (at % g.stride < g.width) assert_true(g.depth[at] == 0 && !g.normal[at] && !g.triangle[at]);
    /* garbage positions everywhere: whatever bits come, nothing may break (the sanitizers watch) */
    mesh wild = new_mesh(512, 2000);
    wild.vertex_count = 512;
    for (int i = 0; i < 2048; i++) {
        uint32_t bits = random_bits();
        if (i % 4 != 3) memcpy(&wild.positions[i], &bits, 4);
        if (i % 5 == 0) wild.positions[i] = (float)uniform(-3, 3);
    }
    for (int i = 0; i < 2000; i++) add_triangle(&wild, random_bits() % 512, random_bits() % 512, random_bits() % 512);
    es_raster_mesh w = raster_mesh(&wild);
    w.bounds_min.x = NAN;
    w.bounds_max.x = NAN;
    es_raster_instance garbage = instance_of(&w);
    view.cull = ES_CULL_NONE;
    garbage.previous_transform.m[13] = 1;
    es_draw_list wild_list = {&garbage, s->materials, 1, 3};
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &wild_list, &view, &g, NULL), ES_OK);
    free_mesh(&wild);
    free_mesh(&m);
    es_gbuffer_destroy(b->context, &g);
    es_gbuffer_destroy(b->context, &clean);
    free_scene(s);
    close_bench(b);
}

static void test_bad_arguments(void** state)
{
    bench* b = open_bench(1, 0);
    es_gbuffer g;
    assert_int_equal(es_gbuffer_create(b->context, 0, 5, ES_GBUFFER_ALL, &g), ES_IMAGE_SIZE);
    assert_int_equal(es_gbuffer_create(b->context, 20000, 20000, ES_GBUFFER_ALL, &g), ES_IMAGE_SIZE);
    assert_int_equal(es_gbuffer_create(b->context, 8, 8, 0, &g), ES_INVALID_ARGUMENT);
    assert_null(g.memory);
    assert_int_equal(es_gbuffer_create(b->context, 8, 8, ES_GBUFFER_DEPTH, &g), ES_OK);
    es_draw_list none = {0};
    es_raster_view view = es_perspective_view(16, 8, origin, ahead, up, 1, 0.1f);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &none, &view, &g, NULL), ES_INVALID_ARGUMENT);
    float depth[64];
    assert_int_equal(es_draw_depth(b->rasterizer, &none, &view, depth, 12, NULL), ES_INVALID_ARGUMENT);
    view.width = 0;
    assert_int_equal(es_draw_depth(b->rasterizer, &none, &view, depth, 8, NULL), ES_IMAGE_SIZE);
    view.width = 8;
    es_raster_mesh m = {0};
    es_raster_instance instance = instance_of(&m);
    instance.material = 3;
    es_draw_list list = {&instance, NULL, 1, 0};
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_INVALID_ARGUMENT);
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, 0, 1, NULL, true, &image), ES_IMAGE_SIZE);
    assert_int_equal(es_texture_image_create(b->context, 20000, 1, NULL, true, &image), ES_IMAGE_SIZE);
    es_gbuffer_destroy(b->context, &g);
    close_bench(b);
}

/* Memory ends at every possible place: an error each time, no leak, and the rasterizer works afterwards. */
static void test_memory_cap(void** state)
{
    scene* s = new_scene();
    es_raster_view view = es_perspective_view(200, 150, origin, ahead, up, 1.1f, 0.1f);
    int failures = 0;
    for (size_t cap = 1 << 16; cap < (size_t)64 << 20; cap += cap / 3) {
        log_record log = {0};
        es_context_desc desc = es_default_context_desc();
        desc.threads = 2;
        desc.memory_cap = cap;
        desc.logger = (es_logger){record, &log};
        es_context* context;
        if (es_context_create(&desc, &context) != ES_OK) continue;
        es_rasterizer* rasterizer;
        es_gbuffer g = {0};
        if (es_rasterizer_create(context, &rasterizer) == ES_OK) {
            if (es_gbuffer_create(context, 200, 150, ES_GBUFFER_ALL, &g) == ES_OK) {
                es_result result = es_draw_gbuffer(rasterizer, &s->list, &view, &g, NULL);
                assert_true(result == ES_OK || result == ES_MEMORY_CAP);
                failures += result != ES_OK;
                es_draw_list none = {0};
                if (result != ES_OK) es_draw_gbuffer(rasterizer, &none, &view, &g, NULL);
                es_gbuffer_destroy(context, &g);
            } else failures++;
            es_rasterizer_destroy(rasterizer);
        } else failures++;
        assert_int_equal(es_context_bytes(context), 0);
        es_context_destroy(context);
    }
    assert_true(failures > 3);
    free_scene(s);
}

/* ---- textures ------------------------------------------------------------------------------------------------------------------------ */

static void test_texture_images(void** state)
{
    bench* b = open_bench(1, 0);
    uint8_t ramp[256 * 4];
    for (int i = 0; i < 256; i++) ramp[4 * i] = ramp[4 * i + 1] = ramp[4 * i + 2] = ramp[4 * i + 3] = (uint8_t)i;
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, 256, 1, ramp, true, &image), ES_OK);
    assert_int_equal(image.level_count, 9);
    for (int i = 0; i < 256; i++) {
        double c = i / 255.0, l = c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
        assert_int_equal(image.texels[4 * i], (int)floor(l * 65535 + 0.5));
        assert_int_equal(image.texels[4 * i + 3], i * 257);
        if (i) assert_true(image.texels[4 * i] > image.texels[4 * i - 4]);
    }
    es_texture_image_destroy(b->context, &image);
    /* every level keeps the mean, whatever the size */
    for (uint32_t w = 1; w < 24; w += 2 + w / 5)
        for (uint32_t h = 1; h < 20; h += 3) {
            uint8_t* texels = malloc(4 * w * h);
            double mean = 0;
            for (uint32_t i = 0; i < w * h; i++) {
                for (int c = 0; c < 4; c++) texels[4 * i + c] = (uint8_t)random_bits();
                mean += texels[4 * i] * 257.0 / (w * h);
            }
            assert_int_equal(es_texture_image_create(b->context, w, h, texels, false, &image), ES_OK);
            uint32_t last = image.level_count - 1, size = w > h ? w : h;
            assert_true(size >> last == 1);
            assert_float_equal(image.texels[4 * image.level_offset[last]], mean, 3);
            es_texture_image_destroy(b->context, &image);
            free(texels);
        }
    es_image source;
    assert_int_equal(es_image_create(b->context, 2, 1, 2, &source), ES_OK);
    source.pixels[0] = 0.25f, source.pixels[1] = NAN, source.pixels[2] = 7, source.pixels[3] = 1;
    assert_int_equal(es_texture_image_from_float(b->context, &source, &image), ES_OK);
    assert_int_equal(image.texels[0], 16384);
    assert_int_equal(image.texels[2], 16384);
    assert_int_equal(image.texels[3], 0);
    assert_int_equal(image.texels[4], 65535);
    es_texture_image_destroy(b->context, &image);
    es_image_destroy(b->context, &source);
    close_bench(b);
}

static int wrapped(int i, int n, es_wrap wrap)
{
    if (wrap == ES_WRAP_CLAMP) return i < 0 ? 0 : i >= n ? n - 1 : i;
    if (wrap == ES_WRAP_REPEAT) return ((i % n) + n) % n;
    int j = ((i % (2 * n)) + 2 * n) % (2 * n);
    return j < n ? j : 2 * n - 1 - j;
}

static void test_wrap_and_filter(void** state)
{
    bench* b = open_bench(1, 0);
    enum { TW = 5, TH = 3, SIZE = 128 };
    uint8_t texels[4 * TW * TH];
    for (int i = 0; i < 4 * TW * TH; i++) texels[i] = (uint8_t)random_bits();
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, TW, TH, texels, false, &image), ES_OK);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}}, (float[4][2]){{-1.5f, 2.5f}, {2.5f, 2.5f}, {2.5f, -1.5f}, {-1.5f, -1.5f}});
    es_raster_mesh r = raster_mesh(&m);
    r.uvs = m.uvs;
    es_raster_instance instance = instance_of(&r);
    es_raster_view view = es_perspective_view(SIZE, SIZE, origin, ahead, up, ES_PI / 2, 0.1f);
    es_gbuffer g;
    es_gbuffer_create(b->context, SIZE, SIZE, ES_GBUFFER_ALBEDO, &g);
    for (int wrap_u = 0; wrap_u < 3; wrap_u++)
        for (int wrap_v = 0; wrap_v < 3; wrap_v++)
            for (int filter = 0; filter < 2; filter++) {
                es_material_desc material = es_default_material_desc();
                material.base_color_texture = (es_texture_use){.image = &image, .wrap_u = (es_wrap)wrap_u, .wrap_v = (es_wrap)wrap_v, .magnify = (es_filter)filter,
                    .minify = (es_filter)filter, .mip = ES_MIP_LINEAR, .matrix = {0.5f, 0, 0, 1}, .offset = {0.25f, -0.125f}};
                es_draw_list list = {&instance, &material, 1, 1};
                assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
                for (int y = 0; y < SIZE; y++)
                    for (int x = 0; x < SIZE; x++) {
                        double u = 0.5 * (-1.5 + 4 * (x + 0.5) / SIZE) + 0.25, v = (-1.5 + 4 * (y + 0.5) / SIZE) - 0.125;
                        double tx = u * TW - (filter ? 0 : 0.5), ty = v * TH - (filter ? 0 : 0.5);
                        int ix = (int)floor(tx), iy = (int)floor(ty);
                        double fx = tx - ix, fy = ty - iy, value = 0;
                        if (filter && (fabs(fx - 0.5) > 0.499 || fabs(fy - 0.5) > 0.499)) continue; /* on a texel border */
                        for (int j = 0; j < 2; j++)
                            for (int i = 0; i < 2; i++) {
                                double weight = filter ? (i || j ? 0 : 1) : (i ? fx : 1 - fx) * (j ? fy : 1 - fy);
                                value += weight * texels[4 * (wrapped(iy + j, TH, (es_wrap)wrap_v) * TW + wrapped(ix + i, TW, (es_wrap)wrap_u))] / 255.0;
                            }
                        assert_float_equal((g.albedo_rg[y * (int)g.stride + x] & 0xffff) / 65535.0, value, 2e-4);
                    }
            }
    es_gbuffer_destroy(b->context, &g);
    es_texture_image_destroy(b->context, &image);
    free_mesh(&m);
    close_bench(b);
}

/* Each level has a colour of its own, so the picture tells which level was chosen; the plane recedes, so all are. */
static void test_mip_selection(void** state)
{
    bench* b = open_bench(1, 0);
    enum { N = 256, W = 160, H = 120 };
    uint8_t* texels = calloc(N * N, 4);
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, N, N, texels, false, &image), ES_OK);
    assert_int_equal(image.level_count, 9);
    for (uint32_t l = 0; l < 9; l++)
        for (uint32_t i = 0; i < (uint32_t)(N >> l) * (N >> l); i++) image.texels[4 * (image.level_offset[l] + i)] = (uint16_t)(l * 8000);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-200, -1, 1}, {200, -1, 1}, {200, -1, -400}, {-200, -1, -400}}, (float[4][2]){{0, 0}, {400, 0}, {400, 401}, {0, 401}});
    es_raster_mesh r = raster_mesh(&m);
    r.uvs = m.uvs;
    es_raster_instance instance = instance_of(&r);
    es_raster_view view = es_perspective_view(W, H, origin, ahead, up, 1.0f, 0.1f);
    es_gbuffer g;
    es_gbuffer_create(b->context, W, H, ES_GBUFFER_ALBEDO | ES_GBUFFER_DEPTH, &g);
    int levels_seen = 0;
    for (int mode = 0; mode < 3; mode++) {
        es_material_desc material = es_default_material_desc();
        material.base_color_texture = (es_texture_use){.image = &image, .mip = (es_mip_filter)mode};
        es_draw_list list = {&instance, &material, 1, 1};
        assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
        for (int y = 0; y < H; y++)
            for (int x = 0; x < W; x++) {
                size_t at = (size_t)y * g.stride + (size_t)x;
                if (!(g.depth[at] > 0)) continue;
                double d[2][2], e = 1e-4;
                for (int k = 0; k < 2; k++) {
                    ray a = pixel_ray(&view, x + 0.5 + (k == 0) * e, y + 0.5 + (k == 1) * e), c = pixel_ray(&view, x + 0.5 - (k == 0) * e, y + 0.5 - (k == 1) * e);
                    for (int i = 0; i < 2; i++) d[k][i] = (a.d[2 * i] / -a.d[1] - c.d[2 * i] / -c.d[1]) / (2 * e) * N;
                }
                double lambda = 0.5 * log2(fmax(d[0][0] * d[0][0] + d[0][1] * d[0][1], d[1][0] * d[1][0] + d[1][1] * d[1][1]));
                double level = fmin(fmax(lambda, 0), 8), value = (g.albedo_rg[at] & 0xffff) / 8000.0;
                if (mode == ES_MIP_NONE) assert_float_equal(value, 0, 1e-6);
                else if (mode == ES_MIP_LINEAR) assert_float_equal(value, level, 0.01);
                else if (fabs(level - floor(level) - 0.5) > 0.01) assert_float_equal(value, floor(level + 0.5), 1e-3);
                if (mode == ES_MIP_NEAREST) levels_seen |= 1 << (int)(value + 0.5);
            }
    }
    assert_true(__builtin_popcount((unsigned)levels_seen) >= 5);
    es_gbuffer_destroy(b->context, &g);
    es_texture_image_destroy(b->context, &image);
    free(texels);
    free_mesh(&m);
    close_bench(b);
}

static void test_alpha_mask(void** state)
{
    bench* b = open_bench(1, 0);
    uint8_t texels[4 * 8 * 8];
    memset(texels, 255, sizeof texels);
    for (int i = 0; i < 64; i++) texels[4 * i + 3] = (i % 8 / 2 + i / 8 / 2) % 2 ? 255 : 0; /* a chessboard of 4x4 */
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, 8, 8, texels, true, &image), ES_OK);
    mesh m = new_mesh(8, 4), wall = new_mesh(4, 2);
    /* tilted, so that interpolation must be perspective-correct */
    quad(&m, (float[4][3]){{-2, -2, -2}, {2, -2, -4}, {2, 2, -4}, {-2, 2, -2}}, (float[4][2]){{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    quad(&wall, (float[4][3]){{-20, -20, -10}, {20, -20, -10}, {20, 20, -10}, {-20, 20, -10}}, NULL);
    es_raster_mesh r = raster_mesh(&m), w = raster_mesh(&wall);
    r.uvs = m.uvs;
    es_raster_instance instances[2] = {instance_of(&r), instance_of(&w)};
    instances[1].material = 1;
    instances[1].id = 1;
    es_material_desc materials[2] = {es_default_material_desc(), es_default_material_desc()};
    materials[0].alpha_mask = true;
    materials[0].base_color_texture = (es_texture_use){.image = &image, .magnify = ES_FILTER_NEAREST, .minify = ES_FILTER_NEAREST, .mip = ES_MIP_NONE};
    es_draw_list list = {instances, materials, 2, 2};
    es_raster_view view = es_perspective_view(140, 100, origin, ahead, up, 1.0f, 0.1f);
    es_gbuffer g;
    es_gbuffer_create(b->context, 140, 100, ES_GBUFFER_ALL, &g);
    float* depth = malloc(4 * (size_t)g.stride * 100);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
    assert_int_equal(es_draw_depth(b->rasterizer, &list, &view, depth, g.stride, NULL), ES_OK);
    int counts[3] = {0};
    for (uint32_t y = 0; y < 100; y++)
        for (uint32_t x = 0; x < 140; x++) {
            size_t at = (size_t)y * g.stride + x;
            ray ray = pixel_ray(&view, x + 0.5, y + 0.5);
            double s = 3 / (1 - 0.0 - (-0.5) * ray.d[0] * -1); /* plane z = -3 - x / 2 */
            s = 3 / (-ray.d[2] - 0.5 * ray.d[0]);
            double u = (s * ray.d[0] + 2) / 4, v = (2 - s * ray.d[1]) / 4;
            double edge = fmin(fabs(u * 4 - floor(u * 4 + 0.5)), fabs(v * 4 - floor(v * 4 + 0.5)));
            if (edge < 0.02) continue;
            bool on = s > 0 && u > 0 && u < 1 && v > 0 && v < 1 && ((int)(u * 4) + (int)(v * 4)) % 2;
            assert_int_equal(g.instance[at], on ? 1 : 2);
            assert_true((depth[at] > 0.1 / 9.9) == on);
            counts[on]++;
        }
    assert_true(counts[0] > 1000 && counts[1] > 1000);
    /* alpha below, at and above the cutoff without a texture */
    materials[0].base_color_texture.image = NULL;
    materials[0].alpha_cutoff = 0.5f;
    for (int i = 0; i < 3; i++) {
        materials[0].base_color[3] = 0.25f * (float)(i + 1);
        list.instance_count = 1;
        es_raster_stats stats;
        assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, &stats), ES_OK);
        assert_true((stats.pixels > 0) == (i > 0));
    }
    free(depth);
    es_gbuffer_destroy(b->context, &g);
    es_texture_image_destroy(b->context, &image);
    free_mesh(&m);
    free_mesh(&wall);
    close_bench(b);
}

/* A constant normal map texel leans the normal by a known amount along u and against v, with tangents and without, mirrored too. */
static void test_normal_map(void** state)
{
    bench* b = open_bench(1, 0);
    uint8_t texel[4] = {(uint8_t)lrint((0.6 * 0.5 + 0.5) * 255), (uint8_t)lrint((0.3 * 0.5 + 0.5) * 255), 229, 255};
    double t[3] = {texel[0] / 127.5 - 1, texel[1] / 127.5 - 1, texel[2] / 127.5 - 1};
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, 1, 1, texel, false, &image), ES_OK);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-1, -1, -2}, {1, -1, -2}, {1, 1, -2}, {-1, 1, -2}}, (float[4][2]){{0, 1}, {1, 1}, {1, 0}, {0, 0}});
    for (int i = 0; i < 4; i++) m.normals[4 * i + 2] = 1, m.tangents[4 * i] = 1, m.tangents[4 * i + 3] = 1;
    es_raster_mesh r = raster_mesh(&m);
    r.uvs = m.uvs;
    es_material_desc material = es_default_material_desc();
    material.double_sided = true;
    material.normal_texture.image = &image;
    es_gbuffer g;
    es_gbuffer_create(b->context, 32, 32, ES_GBUFFER_ALL, &g);
    for (int variant = 0; variant < 16; variant++) {
        bool tangents = variant & 1, normals = variant & 2, mirrored = variant & 4, behind = variant & 8;
        r.tangents = tangents ? m.tangents : NULL;
        r.normals = normals ? m.normals : NULL;
        es_raster_instance instance = instance_of(&r);
        if (mirrored) instance.transform.m[0] = instance.previous_transform.m[0] = -1;
        es_draw_list list = {&instance, &material, 1, 1};
        es_raster_view view = behind ? es_perspective_view(32, 32, (es_vec3){0, 0, -4}, (es_vec3){0, 0, 1}, up, 1, 0.1f) : es_perspective_view(32, 32, origin, ahead, up, 1, 0.1f);
        assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
        double expected[3] = {mirrored ? -t[0] : t[0], t[1], t[2]};
        unit3(expected);
        if (behind)
            for (int k = 0; k < 3; k++) expected[k] = -expected[k];
        assert_true(angle_between(expected, es_unpack_normal(g.normal[16 * g.stride + 16])) < 2e-3);
        double geometric[3] = {0, 0, behind ? -1 : 1};
        assert_true(angle_between(geometric, es_unpack_normal(g.geometric_normal[16 * g.stride + 16])) < 1e-3);
    }
    es_gbuffer_destroy(b->context, &g);
    es_texture_image_destroy(b->context, &image);
    free_mesh(&m);
    close_bench(b);
}

static void test_material_textures(void** state)
{
    bench* b = open_bench(1, 0);
    uint8_t texel[4] = {255, 128, 64, 51};
    es_texture_image image;
    assert_int_equal(es_texture_image_create(b->context, 1, 1, texel, false, &image), ES_OK);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-9, -9, -2}, {9, -9, -2}, {9, 9, -2}, {-9, 9, -2}}, NULL);
    es_raster_mesh r = raster_mesh(&m);
    es_raster_instance instance = instance_of(&r);
    es_material_desc material = es_default_material_desc();
    material.metallic = 1;
    material.emission[0] = material.emission[1] = material.emission[2] = 10;
    material.metallic_roughness_texture.image = material.emission_texture.image = material.specular_texture.image = &image;
    es_draw_list list = {&instance, &material, 1, 1};
    es_raster_view view = es_perspective_view(8, 8, origin, ahead, up, 1, 0.1f);
    es_gbuffer g;
    es_gbuffer_create(b->context, 8, 8, ES_GBUFFER_ALL, &g);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &list, &view, &g, NULL), ES_OK);
    assert_int_equal(g.surface[9], 64 | 128 << 8 | 51 << 16);
    es_vec3 e = es_unpack_rgb9e5(g.emission[9]);
    assert_float_equal(e.x, 10, 0.02);
    assert_float_equal(e.y, 10 * 128 / 255.0, 0.02);
    assert_float_equal(e.z, 10 * 64 / 255.0, 0.02);
    es_gbuffer_destroy(b->context, &g);
    es_texture_image_destroy(b->context, &image);
    free_mesh(&m);
    close_bench(b);
}

/* ---- equal bits ---------------------------------------------------------------------------------------------------------------------- */

static void test_equal_bits(void** state)
{
    scene* s = new_scene();
    es_raster_view view = es_perspective_view(301, 203, origin, ahead, up, 1.1f, 0.1f);
    view.previous_view = es_mat4_look((es_vec3){0.1f, 0, 0.05f}, (es_vec3){0.15f, -0.05f, -1}, up);
    uint64_t first = 0, first_depth = 0;
    static const uint32_t threads[] = {1, 2, 3, 8};
    for (int isa = 0; isa < ES_ISA_COUNT; isa++)
        for (int t = 0; t < 4; t++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            bench* b = open_bench(threads[t], 1u << isa);
            es_gbuffer g;
            es_gbuffer_create(b->context, view.width, view.height, ES_GBUFFER_ALL, &g);
            float* depth = calloc((size_t)g.stride * view.height, 4);
            for (int again = 0; again < 2; again++) { /* scratch memory used before must not show */
                assert_int_equal(es_draw_gbuffer(b->rasterizer, &s->list, &view, &g, NULL), ES_OK);
                assert_int_equal(es_draw_depth(b->rasterizer, &s->list, &view, depth, g.stride, NULL), ES_OK);
                uint64_t hash = hash_gbuffer(&g), depth_hash = 0;
                for (uint32_t y = 0; y < view.height; y++) depth_hash = es_hash_bytes(depth_hash, depth + (size_t)y * g.stride, 4 * view.width);
                if (!first) first = hash, first_depth = depth_hash;
                assert_true(hash == first && depth_hash == first_depth);
            }
            free(depth);
            es_gbuffer_destroy(b->context, &g);
            close_bench(b);
        }
    /* a hash that never changes would prove nothing */
    bench* b = open_bench(1, 0);
    es_gbuffer g;
    es_gbuffer_create(b->context, view.width, view.height, ES_GBUFFER_ALL, &g);
    s->instances[1].transform.m[12] += 1e-5f;
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &s->list, &view, &g, NULL), ES_OK);
    assert_true(hash_gbuffer(&g) != first);
    /* planes that are left out do not change the others */
    es_gbuffer some;
    es_gbuffer_create(b->context, view.width, view.height, ES_GBUFFER_NORMAL | ES_GBUFFER_MOTION, &some);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &s->list, &view, &some, NULL), ES_OK);
    for (uint32_t y = 0; y < view.height; y++) {
        assert_memory_equal(some.normal + (size_t)y * g.stride, g.normal + (size_t)y * g.stride, 4 * view.width);
        assert_memory_equal(some.motion_x + (size_t)y * g.stride, g.motion_x + (size_t)y * g.stride, 4 * view.width);
    }
    es_gbuffer_destroy(b->context, &some);
    /* the order of instances changes which ids there are, not what is seen */
    for (int i = 0; i < SCENE_INSTANCES / 2; i++) {
        es_raster_instance swap = s->instances[i];
        s->instances[i] = s->instances[SCENE_INSTANCES - 1 - i];
        s->instances[SCENE_INSTANCES - 1 - i] = swap;
    }
    uint64_t before = hash_gbuffer(&g);
    assert_int_equal(es_draw_gbuffer(b->rasterizer, &s->list, &view, &g, NULL), ES_OK);
    assert_true(hash_gbuffer(&g) == before);
    es_gbuffer_destroy(b->context, &g);
    close_bench(b);
    free_scene(s);
}

/* A large view, its far corners included, and triangles that fill all of it. */
static void test_largest_view(void** state)
{
    bench* b = open_bench(2, 0);
    mesh m = new_mesh(4, 2);
    quad(&m, (float[4][3]){{-9, -9, -1}, {9, -9, -1}, {9, 9, -1}, {-9, 9, -1}}, NULL);
    es_raster_mesh r = raster_mesh(&m);
    es_raster_instance instance = instance_of(&r);
    es_material_desc material = es_default_material_desc();
    es_draw_list list = {&instance, &material, 1, 1};
    const uint32_t sizes[][2] = {{8192, 40}, {33, 8192}, {1, 1}, {7, 1}};
    for (int i = 0; i < 4; i++) {
        uint32_t w = sizes[i][0], h = sizes[i][1], stride = (w + 7) / 8 * 8;
        float* depth = malloc(4 * (size_t)stride * h);
        es_raster_view view = es_perspective_view(w, h, origin, ahead, up, 1, 0.1f);
        view.projection = es_mat4_perspective(1.0f, 1.0f, 0.1f);
        es_raster_stats stats;
        assert_int_equal(es_draw_depth(b->rasterizer, &list, &view, depth, stride, &stats), ES_OK);
        assert_int_equal(stats.pixels, (uint64_t)w * h);
        for (uint32_t y = 0; y < h; y++)
            for (uint32_t x = 0; x < w; x++) assert_float_equal(depth[(size_t)y * stride + x], 0.1f, 1e-6);
        free(depth);
    }
    free_mesh(&m);
    close_bench(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_shared_edges),
        unit_test_without_races(test_fans),
        unit_test_without_races(test_small_grid),
        unit_test_without_races(test_inside_a_box),
        unit_test_without_races(test_closed_soup),
        unit_test_without_races(test_coverage_notices_a_tear),
        unit_test_without_races(test_against_rays),
        unit_test_without_races(test_perspective_correct),
        unit_test_without_races(test_inside_depth),
        unit_test_without_races(test_culling),
        cmocka_unit_test(test_bad_vertices),
        unit_test_without_races(test_bad_arguments),
        cmocka_unit_test(test_memory_cap),
        unit_test_without_races(test_texture_images),
        unit_test_without_races(test_wrap_and_filter),
        unit_test_without_races(test_mip_selection),
        unit_test_without_races(test_alpha_mask),
        unit_test_without_races(test_normal_map),
        unit_test_without_races(test_material_textures),
        cmocka_unit_test(test_equal_bits),
        cmocka_unit_test(test_largest_view),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
