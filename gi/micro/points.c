/* Where the points of an instance stand: on its triangles by their area, in the pose at rest. */
#include <string.h>

#include "gi/micro/forest_parts.h"
#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"

/* ---- poses --------------------------------------------------------------------------------------------------------------------- */

static double root(double x) { return x > 0.0 ? __builtin_sqrt(x) : 0.0; }
static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static double whole(double x) { return (double)(int64_t)(x < 0.0 ? x - 0.5 : x + 0.5); }

/* 2^floor(log2(x √2)): powers of two are not on a border */
static double binade(double x)
{
    const float y = (float)(x * 1.4142135623730951);
    uint32_t bits;
    memcpy(&bits, &y, sizeof bits);
    bits &= 0x7f800000u;
    float power;
    memcpy(&power, &bits, sizeof power);
    return (double)power;
}

/* To steps of a quarter in the logarithm; 0 for what is nothing against 1. */
static float coarse(double ratio)
{
    if (!(ratio > 1.0 / 1024.0)) return 0.0f;
    return es_exp2((float)whole(4.0 * (double)es_log2((float)ratio)) * 0.25f);
}

es_point_pose es_point_pose_of(const es_mat4* transform)
{
    es_point_pose pose = {.u = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .shape = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    double column[3][3], q[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, u[9] = {0}, norm[3], largest = 0.0;
    for (int j = 0; j < 3; j++) {
        for (int k = 0; k < 3; k++) column[j][k] = (double)transform->m[4 * j + k];
        norm[j] = root(dot(column[j], column[j]));
        largest = norm[j] > largest ? norm[j] : largest;
        pose.translation[j] = transform->m[12 + j];
    }
    if (!(largest > 1e-15 && largest < 1e9)) return pose;
    if (norm[0] > 1e-6 * largest) {
        u[0] = norm[0];
        for (int k = 0; k < 3; k++) q[0][k] = column[0][k] / norm[0];
    }
    u[3] = dot(q[0], column[1]);
    double rest[3];
    for (int k = 0; k < 3; k++) rest[k] = column[1][k] - u[3] * q[0][k];
    u[4] = root(dot(rest, rest));
    if (u[4] > 1e-6 * largest) {
        for (int k = 0; k < 3; k++) q[1][k] = rest[k] / u[4];
    } else {
        es_vec3 t, b;
        es_orthonormal_basis(es_v3((float)q[0][0], (float)q[0][1], (float)q[0][2]), &t, &b);
        const double across[3] = {(double)t.x, (double)t.y, (double)t.z};
        memcpy(q[1], across, sizeof across);
        u[4] = 0.0;
    }
    for (int k = 0; k < 3; k++) q[2][k] = q[0][(k + 1) % 3] * q[1][(k + 2) % 3] - q[0][(k + 2) % 3] * q[1][(k + 1) % 3];
    u[6] = dot(q[0], column[2]);
    u[7] = dot(q[1], column[2]);
    u[8] = dot(q[2], column[2]);
    if (u[8] < 0.0) { /* mirrored */
        u[8] = -u[8];
        for (int k = 0; k < 3; k++) q[2][k] = -q[2][k];
    }
    uint32_t bits;
    float scale = (float)largest;
    memcpy(&bits, &scale, sizeof bits);
    bits = (bits + 0x8000u) & 0xffff0000u;
    memcpy(&pose.scale, &bits, sizeof bits);
    for (int j = 0; j < 3; j++) {
        const double step = binade(norm[j]) * (1.0 / 65536.0);
        for (int i = 0; i < 3; i++) {
            pose.rotation[3 * j + i] = (float)q[j][i];
            pose.u[3 * j + i] = step > 0.0 ? (float)(whole(u[3 * j + i] / step) * step) : 0.0f;
            pose.shape[3 * j + i] = i == j ? coarse(u[4 * j] / largest) : (float)(whole(8.0 * u[3 * j + i] / largest) * 0.125);
        }
    }
    return pose;
}

/* ---- triangles at rest ----------------------------------------------------------------------------------------------------- */

static void shaped(const es_raster_mesh* mesh, const float s[9], uint32_t vertex, double p[3])
{
    const float* at = (mesh->rest_positions ? mesh->rest_positions : mesh->positions) + 4 * (size_t)vertex;
    double x[3];
    for (int k = 0; k < 3; k++) x[k] = (double)es_maxf(es_minf(at[k], ES_POINT_FARTHEST), -ES_POINT_FARTHEST); /* NaN: the latter */
    p[0] = (double)s[0] * x[0] + (double)s[3] * x[1] + (double)s[6] * x[2];
    p[1] = (double)s[4] * x[1] + (double)s[7] * x[2];
    p[2] = (double)s[8] * x[2];
}

/* a, and the edges from it */
static void corners(const es_raster_mesh* mesh, const float s[9], uint32_t triangle, double a[3], double u[3], double v[3])
{
    const uint32_t* index = mesh->indices + 3 * (size_t)triangle;
    shaped(mesh, s, index[0], a);
    shaped(mesh, s, index[1], u);
    shaped(mesh, s, index[2], v);
    for (int k = 0; k < 3; k++) {
        u[k] -= a[k];
        v[k] -= a[k];
    }
}

static double area_of(const double u[3], const double v[3])
{
    const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return 0.5 * root(x * x + y * y + z * z);
}

typedef struct measuring { const es_raster_mesh* mesh; const float* shape; double* areas; } measuring;

static void measure(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const measuring* m = user;
    double a[3], u[3], v[3];
    for (uint32_t t = begin; t < end; t++) {
        corners(m->mesh, m->shape, t, a, u, v);
        m->areas[t] = area_of(u, v);
    }
}

double es_point_areas(es_context* context, const es_raster_mesh* mesh, const float shape[9], double* before)
{
    measuring m = {mesh, shape, before};
    es_parallel_for(context, mesh->triangle_count, 2048, measure, &m);
    double sum = 0.0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const double area = before[t];
        before[t] = sum;
        sum += area;
    }
    before[mesh->triangle_count] = sum;
    return sum;
}

/* ---- places --------------------------------------------------------------------------------------------------------------------- */

/* Candidates, in the order of the triangles' areas: candidate k stands at k + 1/2 along the sequence of all areas; what is left of that place within a triangle and the
 * fraction of k times the golden ratio are mapped to the triangle, keeping areas (Heitz 2019, "A low-distortion map between triangle and square"). So
 * they are a lattice on each large triangle, and one in each equal share of area on small ones. */
typedef struct places { const es_raster_mesh* mesh; const float* shape; const double* before; double scale; } places;

static places places_of(const es_placing* p, uint32_t candidates)
{
    return (places){p->mesh, p->shape, p->before, p->before[p->mesh->triangle_count] / candidates};
}

static uint32_t triangle_of(const places* p, uint32_t k)
{
    const double where = (k + 0.5) * p->scale;
    uint32_t low = 0, high = p->mesh->triangle_count;
    while (high - low > 1) {
        const uint32_t middle = low + (high - low) / 2;
        if (p->before[middle] <= where) low = middle;
        else high = middle;
    }
    return low;
}

static uint32_t barycentric_of(const places* p, uint32_t k, uint32_t t)
{
    const double share = p->before[t + 1] - p->before[t];
    float u = es_clampf(share > 0.0 ? (float)(((k + 0.5) * p->scale - p->before[t]) / share) : 0.5f, 0.0f, 1.0f), v = es_unit_float(k * 2654435769u);
    if (v > u) {
        u *= 0.5f;
        v -= u;
    } else {
        v *= 0.5f;
        u -= v;
    }
    return (uint32_t)(u * 65535.0f + 0.5f) | (uint32_t)(v * 65535.0f + 0.5f) << 16;
}

typedef struct spreading { places places; es_split_point* points; } spreading;

static void spread(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const spreading* job = user;
    const places* p = &job->places;
    const uint32_t triangles = p->mesh->triangle_count;
    uint32_t t = triangle_of(p, begin), last = UINT32_MAX;
    double a[3] = {0}, u[3] = {0}, v[3] = {0};
    for (uint32_t k = begin; k < end; k++) {
        while (t + 1 < triangles && p->before[t + 1] <= (k + 0.5) * p->scale) t++;
        if (t != last) corners(p->mesh, p->shape, t, a, u, v);
        last = t;
        const uint32_t barycentric = barycentric_of(p, k, t);
        const double s = (double)(barycentric & 0xffff) / 65535.0, r = (double)(barycentric >> 16) / 65535.0;
        for (int c = 0; c < 3; c++) job->points[k].position[c] = (float)(a[c] + s * u[c] + r * v[c]);
        job->points[k].index = k;
    }
}

void es_point_candidates(es_context* context, const es_placing* placing, es_split_point* candidates)
{
    const uint32_t count = placing->count * placing->choice;
    spreading job = {places_of(placing, count), candidates};
    es_parallel_for(context, count, 8192, spread, &job);
}

typedef struct choosing { const es_placing* placing; places places; const es_split_point* points; double radius; } choosing;

static void choose(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const choosing* job = user;
    const es_placing* p = job->placing;
    for (uint32_t i = begin; i < end; i++) {
        const es_split_point* group = job->points + (size_t)i * p->choice;
        float middle[3] = {0, 0, 0}, least = 0.0f;
        uint32_t best = 0;
        for (uint32_t j = 0; j < p->choice; j++)
            for (int c = 0; c < 3; c++) middle[c] += group[j].position[c];
        for (uint32_t j = 0; j < p->choice; j++) {
            float square = 0.0f;
            for (int c = 0; c < 3; c++) {
                const float way = group[j].position[c] - middle[c] / (float)p->choice;
                square += way * way;
            }
            if (j && !(square < least || (square == least && group[j].index < group[best].index))) continue;
            least = square;
            best = j;
        }
        const uint32_t k = group[best].index, t = triangle_of(&job->places, k);
        double a[3], u[3], v[3];
        corners(p->mesh, p->shape, t, a, u, v);
        const double length = root(dot(u, u)), height = length > 0.0 ? 2.0 * area_of(u, v) / length : 0.0;
        p->triangle[i] = t;
        p->barycentric[i] = barycentric_of(&job->places, k, t);
        p->shapes.along[i] = length > 1e-9 * job->radius ? (float)(job->radius / length) : 0.0f;
        p->shapes.across[i] = height > 1e-9 * job->radius ? (float)(job->radius / height) : 0.0f;
        p->shapes.shear[i] = length > 0.0 ? es_clampf((float)(dot(u, v) / (length * length)), -ES_POINT_FARTHEST, ES_POINT_FARTHEST) : 0.0f;
    }
}

void es_point_choose(es_context* context, const es_placing* placing, const es_split_point* candidates)
{
    const double area = placing->before[placing->mesh->triangle_count];
    choosing job = {placing, places_of(placing, placing->count * placing->choice), candidates, (double)ES_POINT_OVERLAP * root(area / placing->count / 3.14159265358979)};
    es_parallel_for(context, placing->count, 4096, choose, &job);
}
