/* Random shapes and poses, and separations found by trying everything in double, for the tests of collision. */
#ifndef EARTHSHINE_TESTS_COLLISION_TOOLS_H
#define EARTHSHINE_TESTS_COLLISION_TOOLS_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sim/rigid/collision.h"
#include "sim/rigid/frame.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SLOWER = 8 };
#else
enum { SLOWER = 1 };
#endif

typedef struct fixture { es_context* context; es_world* world; } fixture;

static inline void collision_no_log(void* user, es_log_level level, es_result item, const char* message) {}

static inline int set_up(void** state)
{
    fixture* f = calloc(1, sizeof *f);
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.logger.log = collision_no_log;
    assert_int_equal(es_context_create(&desc, &f->context), ES_OK);
    assert_int_equal(es_world_create(f->context, NULL, &f->world), ES_OK);
    *state = f;
    return 0;
}
static inline int tear_down(void** state)
{
    fixture* f = *state;
    es_world_destroy(f->world);
    assert_int_equal(es_context_bytes(f->context), 0);
    es_context_destroy(f->context);
    free(f);
    return 0;
}

static inline uint32_t next_random(uint32_t* s)
{
    *s = *s * 1664525u + 1013904223u;
    return *s >> 8;
}
static inline float uniform(uint32_t* s, float low, float high) { return low + (high - low) * (float)next_random(s) / 16777216.0f; }
static inline es_vec3 random_vector(uint32_t* s, float size)
{
    float x = uniform(s, -size, size), y = uniform(s, -size, size), z = uniform(s, -size, size);
    return es_v3(x, y, z);
}
static inline es_quat random_rotation(uint32_t* s)
{
    float x = uniform(s, -1, 1), y = uniform(s, -1, 1), z = uniform(s, -1, 1), w = uniform(s, -1, 1);
    return es_quat_normalize((es_quat){x, y, z, w});
}
static inline es_pose pose_at(float x, float y, float z) { return (es_pose){{x, y, z}, {0, 0, 0, 1}}; }

static inline es_shape_desc sphere_desc(float radius)
{
    es_shape_desc d = es_default_shape_desc();
    d.type = ES_SHAPE_SPHERE;
    d.radius = radius;
    return d;
}
static inline es_shape_desc box_desc(float x, float y, float z)
{
    es_shape_desc d = es_default_shape_desc();
    d.half_extents = es_v3(x, y, z);
    return d;
}
static inline es_shape_desc capsule_desc(float radius, float half_height)
{
    es_shape_desc d = es_default_shape_desc();
    d.type = ES_SHAPE_CAPSULE;
    d.radius = radius;
    d.half_height = half_height;
    return d;
}
static inline es_shape_desc hull_desc(const float* points, uint32_t count)
{
    es_shape_desc d = es_default_shape_desc();
    d.type = ES_SHAPE_HULL;
    d.points = points;
    d.point_count = count;
    return d;
}
static inline es_rigid_shape make(fixture* f, es_shape_desc desc)
{
    es_rigid_shape shape;
    if (es_rigid_shape_make(f->world, &desc, "test", &shape) != ES_OK) fail_msg("%s", es_context_message(f->context));
    return shape;
}

/* kinds 0 … 3: sphere, box, capsule, hull; `placed`: off the body's origin; `rounded`: boxes and hulls get a rounding */
static inline es_shape_desc random_desc(uint32_t* s, int kind, float points[3 * 24], bool placed, bool rounded)
{
    es_shape_desc d;
    switch (kind) {
    case 0: d = sphere_desc(uniform(s, 0.2f, 1)); break;
    case 1: {
        float x = uniform(s, 0.2f, 1), y = uniform(s, 0.2f, 1), z = uniform(s, 0.2f, 1);
        d = box_desc(x, y, z);
        if (rounded) d.radius = 0.1f;
        break;
    }
    case 2: {
        float r = uniform(s, 0.1f, 0.5f), h = uniform(s, 0.0f, 1);
        d = capsule_desc(r, h);
        break;
    }
    default: {
        uint32_t count = 4 + next_random(s) % 20;
        for (uint32_t i = 0; i < count; i++) {
            es_vec3 v = es_v3_scale(es_v3_normalize(random_vector(s, 1), es_v3(0, 1, 0)), uniform(s, 0.6f, 1));
            memcpy(points + 3 * i, &v.x, sizeof v);
        }
        /* four that span a volume for sure */
        static const float base[12] = {0.5f, 0.5f, 0.5f, -0.5f, -0.5f, 0.5f, 0.5f, -0.5f, -0.5f, -0.5f, 0.5f, -0.5f};
        memcpy(points, base, sizeof base);
        d = hull_desc(points, count);
        if (rounded) d.radius = 0.1f;
        break;
    }
    }
    if (placed) {
        d.position = random_vector(s, 0.5f);
        d.rotation = random_rotation(s);
    }
    return d;
}

/* ---- cores in double ------------------------------------------------------------------------------------------------------------ */

typedef struct exact_core { double v[ES_HULL_VERTICES][3]; uint32_t count; double directions[ES_HULL_FACES + ES_HULL_EDGES][3]; uint32_t faces, edges; double radius; } exact_core;

static inline void exact_point(const es_pose* pose, es_vec3 p, double out[3])
{
    double x = pose->rotation.x, y = pose->rotation.y, z = pose->rotation.z, w = pose->rotation.w;
    double tx = 2 * (y * p.z - z * p.y), ty = 2 * (z * p.x - x * p.z), tz = 2 * (x * p.y - y * p.x);
    out[0] = pose->position.x + p.x + w * tx + y * tz - z * ty;
    out[1] = pose->position.y + p.y + w * ty + z * tx - x * tz;
    out[2] = pose->position.z + p.z + w * tz + x * ty - y * tx;
}
static inline void exact_direction(const es_pose* pose, es_vec3 d, double out[3])
{
    es_pose turn = {{0, 0, 0}, pose->rotation};
    exact_point(&turn, d, out);
}
/* faces' normals first, then edges' directions */
static inline exact_core exact_core_of(const es_rigid_shape* shape, const es_pose* pose)
{
    exact_core c = {.radius = shape->radius};
    if (shape->type == ES_SHAPE_SPHERE) {
        c.count = 1;
        exact_point(pose, shape->centre, c.v[0]);
    } else if (shape->type == ES_SHAPE_CAPSULE) {
        c.count = 2;
        exact_point(pose, shape->segment[0], c.v[0]);
        exact_point(pose, shape->segment[1], c.v[1]);
        exact_direction(pose, es_v3_sub(shape->segment[1], shape->segment[0]), c.directions[0]);
        c.edges = 1;
    } else {
        const es_hull* h = &shape->hull;
        c.count = h->vertex_count;
        for (uint32_t i = 0; i < h->vertex_count; i++) exact_point(pose, h->vertices[i], c.v[i]);
        for (uint32_t i = 0; i < h->face_count; i++) exact_direction(pose, h->planes[i].normal, c.directions[c.faces++]);
        for (uint32_t i = 0; i < h->half_edge_count; i += 2)
            exact_direction(pose, es_v3_sub(h->vertices[h->half_edges[i].origin], h->vertices[h->half_edges[i + 1].origin]), c.directions[c.faces + c.edges++]);
    }
    return c;
}
/* how far apart along d (any length) the cores are, from a to b */
static inline double exact_gap(const exact_core* a, const exact_core* b, const double d[3])
{
    double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), most = -1e300, least = 1e300;
    if (!(length > 1e-9)) return -1e300;
    for (uint32_t i = 0; i < a->count; i++) most = fmax(most, (a->v[i][0] * d[0] + a->v[i][1] * d[1] + a->v[i][2] * d[2]) / length);
    for (uint32_t i = 0; i < b->count; i++) least = fmin(least, (b->v[i][0] * d[0] + b->v[i][1] * d[1] + b->v[i][2] * d[2]) / length);
    return least - most;
}
/* over every face of both and every pair of edges, both ways: for overlapping polyhedra the depth, negative */
static inline double exact_separation(const exact_core* a, const exact_core* b)
{
    double best = -1e300;
    for (int which = 0; which < 2; which++) {
        const exact_core* c = which ? b : a;
        for (uint32_t i = 0; i < c->faces; i++)
            for (int sign = -1; sign <= 1; sign += 2) {
                double d[3] = {sign * c->directions[i][0], sign * c->directions[i][1], sign * c->directions[i][2]};
                best = fmax(best, exact_gap(a, b, d));
            }
    }
    for (uint32_t i = 0; i < a->edges; i++)
        for (uint32_t k = 0; k < b->edges; k++) {
            const double *p = a->directions[a->faces + i], *q = b->directions[b->faces + k];
            double n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]}, m[3] = {-n[0], -n[1], -n[2]};
            double nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2], pp = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], qq = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
            if (nn < 1e-10 * pp * qq) continue; /* parallel */
            best = fmax(best, fmax(exact_gap(a, b, n), exact_gap(a, b, m)));
        }
    return best;
}

/* The largest gap over all directions, by climbing: a gap is concave along great circles near its top when the cores are apart. With those of
 * exact_separation to begin with it is the distance of disjoint cores. */
static inline double exact_distance(const exact_core* a, const exact_core* b)
{
    double best = -1e300, d[3] = {0};
    for (uint32_t i = 0; i < a->count; i++)
        for (uint32_t k = 0; k < b->count; k++) {
            double e[3] = {b->v[k][0] - a->v[i][0], b->v[k][1] - a->v[i][1], b->v[k][2] - a->v[i][2]}, gap = exact_gap(a, b, e);
            if (gap > best) {
                best = gap;
                memcpy(d, e, sizeof d);
            }
        }
    double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int k = 0; k < 3; k++) d[k] /= length;
    for (double step = 0.5; step > 1e-9;) {
        bool better = false;
        for (int i = 0; i < 26 && !better; i++) {
            int t = i < 13 ? i : i + 1;
            double e[3] = {d[0] + step * (t % 3 - 1), d[1] + step * (t / 3 % 3 - 1), d[2] + step * (t / 9 - 1)}, gap = exact_gap(a, b, e);
            if (gap > best) {
                best = gap;
                length = sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
                for (int k = 0; k < 3; k++) d[k] = e[k] / length;
                better = true;
            }
        }
        if (!better) step *= 0.5;
    }
    return best;
}

#endif
