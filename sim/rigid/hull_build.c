/* Convex hulls of points: quickhull, farthest point first, then triangles of one plane merged into faces.
 *
 * Everything is computed in double from the floats, with three lengths, in units of the points' extent: a point must reach out by `reach`
 * to be added; triangles that a new corner is less than `flat` below are replaced together with those it sees, so that a corner in the plane of
 * a face never makes a triangle without area; and triangles whose corners are all within `merge` of a plane become one face.
 * A corner that would break the surface's shape (rounding, in extremely thin hulls) is left out. */
#include "sim/rigid/hull.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/world.h"

enum { TRIANGLES = 2 * ES_HULL_VERTICES, MAX_POINTS = 1 << 24 };
static const double reach = 1e-5, flat = 1e-7, merge = 2e-5;

typedef struct triangle {
    double normal[3], offset;
    uint32_t v[3];       /* numbers of points; edge k goes from v[k] to v[k + 1] */
    uint32_t across[3];  /* the triangle on the other side of edge k */
    bool alive, seen;
} triangle;

typedef struct builder {
    const float* points;
    uint32_t count, stride;
    double scale[3];
    double extent;
    triangle triangles[TRIANGLES + ES_HULL_VERTICES + 8];
    uint32_t used;       /* of triangles */
    uint32_t corners;
    uint32_t* above;     /* per point: the triangle that it is above, or none */
    double* height;      /* and how far */
} builder;

static void point_of(const builder* b, uint32_t i, double p[3])
{
    for (int k = 0; k < 3; k++) p[k] = b->points[(size_t)i * b->stride + k] * b->scale[k];
}
static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void subtract(const double a[3], const double b[3], double c[3])
{
    for (int k = 0; k < 3; k++) c[k] = a[k] - b[k];
}
static void cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static bool set_plane(builder* b, triangle* t)
{
    double p[3][3], u[3], v[3];
    for (int k = 0; k < 3; k++) point_of(b, t->v[k], p[k]);
    subtract(p[1], p[0], u);
    subtract(p[2], p[0], v);
    cross(u, v, t->normal);
    double length = __builtin_sqrt(dot(t->normal, t->normal));
    if (!(length > 1e-14 * b->extent * b->extent)) return false;
    for (int k = 0; k < 3; k++) t->normal[k] /= length;
    t->offset = dot(t->normal, p[0]);
    return true;
}

/* Exactly equal values go to the point that is lexicographically larger, which is a corner of those it ties with. */
static bool larger(double value, const double p[3], double best, const double q[3])
{
    if (value != best) return value > best;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] > q[k];
    return false;
}

/* The four corners to begin with; false when all points are within `reach` of a plane. */
static bool first_corners(builder* b, uint32_t corner[4])
{
    double low[3], high[3], p[3], q[3], best = -1;
    point_of(b, 0, low);
    point_of(b, 0, high);
    for (uint32_t i = 0; i < b->count; i++) {
        point_of(b, i, p);
        for (int k = 0; k < 3; k++) {
            low[k] = p[k] < low[k] ? p[k] : low[k];
            high[k] = p[k] > high[k] ? p[k] : high[k];
        }
    }
    int longest = 0;
    for (int k = 1; k < 3; k++)
        if (high[k] - low[k] > high[longest] - low[longest]) longest = k;
    b->extent = high[longest] - low[longest];
    if (!(b->extent > 2e-4)) return false;

    /* the ends along the longest axis, then the point farthest from their line, then from their plane */
    corner[0] = corner[1] = 0;
    for (uint32_t i = 1; i < b->count; i++) {
        double a[3], c[3];
        point_of(b, i, p);
        point_of(b, corner[0], a);
        point_of(b, corner[1], c);
        if (larger(p[longest], p, a[longest], a)) corner[0] = i;
        double mirrored[3] = {-p[0], -p[1], -p[2]}, least[3] = {-c[0], -c[1], -c[2]};
        if (larger(-p[longest], mirrored, -c[longest], least)) corner[1] = i;
    }
    double a[3], line[3], far_point[3] = {0};
    point_of(b, corner[0], a);
    point_of(b, corner[1], q);
    subtract(q, a, line);
    double length = __builtin_sqrt(dot(line, line));
    for (uint32_t i = 0; i < b->count; i++) {
        double d[3], n[3];
        point_of(b, i, p);
        subtract(p, a, d);
        cross(line, d, n);
        double distance = __builtin_sqrt(dot(n, n)) / length;
        if (larger(distance, p, best, far_point)) {
            best = distance;
            corner[2] = i;
            memcpy(far_point, p, sizeof p);
        }
    }
    if (!(best > reach * b->extent)) return false;
    triangle base = {.v = {corner[0], corner[1], corner[2]}};
    if (!set_plane(b, &base)) return false;
    best = -1;
    for (uint32_t i = 0; i < b->count; i++) {
        point_of(b, i, p);
        double distance = __builtin_fabs(dot(base.normal, p) - base.offset);
        if (larger(distance, p, best, far_point)) {
            best = distance;
            corner[3] = i;
            memcpy(far_point, p, sizeof p);
        }
    }
    if (!(best > reach * b->extent)) return false;
    point_of(b, corner[3], p);
    if (dot(base.normal, p) > base.offset) { /* the base must look away from the apex */
        uint32_t swap = corner[1];
        corner[1] = corner[2];
        corner[2] = swap;
    }
    return true;
}

/* Finds the triangle among [from, used) that the point is farthest above. */
static void assign(builder* b, uint32_t point, uint32_t from)
{
    double p[3];
    point_of(b, point, p);
    for (uint32_t t = from; t < b->used; t++) {
        if (!b->triangles[t].alive) continue;
        double height = dot(b->triangles[t].normal, p) - b->triangles[t].offset;
        if (height > b->height[point]) {
            b->height[point] = height;
            b->above[point] = t;
        }
    }
}
static void assign_anew(builder* b, uint32_t point, uint32_t from)
{
    b->above[point] = UINT32_MAX;
    b->height[point] = reach * b->extent;
    assign(b, point, from);
}

static bool begin(builder* b)
{
    uint32_t c[4];
    if (!first_corners(b, c)) return false;
    static const uint8_t v[4][3] = {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}}, across[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    for (int t = 0; t < 4; t++) {
        b->triangles[t] = (triangle){.alive = true};
        for (int k = 0; k < 3; k++) {
            b->triangles[t].v[k] = c[v[t][k]];
            b->triangles[t].across[k] = across[t][k];
        }
        if (!set_plane(b, &b->triangles[t])) return false;
    }
    b->used = 4;
    b->corners = 4;
    for (uint32_t i = 0; i < b->count; i++) assign_anew(b, i, 0);
    return true;
}

/* Marks what the corner sees, with what lies in its plane, starting from triangle t. */
static void see(builder* b, const double p[3], uint32_t t)
{
    uint32_t stack[TRIANGLES + ES_HULL_VERTICES + 8], depth = 0;
    stack[depth++] = t;
    b->triangles[t].seen = true;
    while (depth) {
        triangle* at = &b->triangles[stack[--depth]];
        for (int k = 0; k < 3; k++) {
            triangle* next = &b->triangles[at->across[k]];
            if (next->seen || dot(next->normal, p) - next->offset < -flat * b->extent) continue;
            next->seen = true;
            stack[depth++] = at->across[k];
        }
    }
}

/* The border of what is seen, as a loop of (triangle beyond, its edge); 0 when it is no single loop. */
static uint32_t horizon(const builder* b, uint32_t loop[][2])
{
    uint32_t count = 0, edges = 0, first = UINT32_MAX, first_edge = 0;
    for (uint32_t t = 0; t < b->used; t++)
        for (uint32_t k = 0; b->triangles[t].alive && b->triangles[t].seen && k < 3; k++)
            if (!b->triangles[b->triangles[t].across[k]].seen) {
                if (first == UINT32_MAX) first = t, first_edge = k;
                edges++;
            }
    if (first == UINT32_MAX || edges > ES_HULL_VERTICES) return 0;
    uint32_t t = first, k = first_edge;
    do {
        if (count == edges) return 0;
        uint32_t beyond = b->triangles[t].across[k], e = 0;
        /* two triangles may share two edges: the one with these ends */
        while (e < 3 && (b->triangles[beyond].across[e] != t || b->triangles[beyond].v[(e + 1) % 3] != b->triangles[t].v[k])) e++;
        if (e == 3) return 0;
        loop[count][0] = beyond;
        loop[count][1] = e;
        count++;
        /* turn about the edge's end through seen triangles */
        k = (k + 1) % 3;
        while (b->triangles[b->triangles[t].across[k]].seen) {
            uint32_t next = b->triangles[t].across[k], from = b->triangles[t].v[k];
            uint32_t n = 0;
            while (n < 3 && !(b->triangles[next].across[n] == t && b->triangles[next].v[(n + 1) % 3] == from)) n++;
            if (n == 3) return 0;
            t = next;
            k = (n + 1) % 3;
        }
    } while (t != first || k != first_edge);
    return count == edges ? count : 0;
}

/* Dead triangles make room. */
static void compact(builder* b)
{
    uint32_t to[TRIANGLES + ES_HULL_VERTICES + 8], kept = 0;
    for (uint32_t t = 0; t < b->used; t++)
        if (b->triangles[t].alive) {
            to[t] = kept;
            b->triangles[kept++] = b->triangles[t];
        }
        else
            to[t] = UINT32_MAX;
    for (uint32_t t = 0; t < kept; t++)
        for (int k = 0; k < 3; k++) b->triangles[t].across[k] = to[b->triangles[t].across[k]];
    for (uint32_t i = 0; i < b->count; i++)
        if (b->above[i] != UINT32_MAX) b->above[i] = to[b->above[i]];
    b->used = kept;
}

/* Adds the point; false, with nothing changed, when it does not fit. */
static bool add_corner(builder* b, uint32_t point)
{
    uint32_t loop[ES_HULL_VERTICES + 1][2], before = b->used;
    double p[3];
    point_of(b, point, p);
    for (uint32_t t = 0; t < b->used; t++) b->triangles[t].seen = false;
    see(b, p, b->above[point]);
    uint32_t count = horizon(b, loop);
    if (count < 3) return false;
    for (uint32_t i = 0; i < count; i++) {
        const triangle* beyond = &b->triangles[loop[i][0]];
        triangle* t = &b->triangles[before + i];
        *t = (triangle){.v = {beyond->v[(loop[i][1] + 1) % 3], beyond->v[loop[i][1]], point}, .alive = true};
        t->across[0] = loop[i][0];
        t->across[1] = before + (i + 1) % count;
        t->across[2] = before + (i + count - 1) % count;
        if (!set_plane(b, t)) return false;
    }
    b->used = before + count;
    for (uint32_t i = 0; i < count; i++) b->triangles[loop[i][0]].across[loop[i][1]] = before + i;
    for (uint32_t t = 0; t < before; t++)
        if (b->triangles[t].seen) b->triangles[t].alive = false;
    b->above[point] = UINT32_MAX;
    for (uint32_t i = 0; i < b->count; i++) {
        if (b->above[i] == UINT32_MAX || i == point) continue;
        if (!b->triangles[b->above[i]].alive)
            assign_anew(b, i, 0);
        else
            assign(b, i, before);
    }
    compact(b);
    b->corners++;
    return true;
}

/* ---- from triangles to faces ------------------------------------------------------------------------------------------- */

static double doubled_area(const builder* b, const triangle* t)
{
    double p[3][3], u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) point_of(b, t->v[k], p[k]);
    subtract(p[1], p[0], u);
    subtract(p[2], p[0], v);
    cross(u, v, n);
    return __builtin_sqrt(dot(n, n));
}

/* Largest triangles first gather their neighbours whose corners are all in their plane. */
static uint32_t group_faces(const builder* b, uint32_t group[])
{
    double area[TRIANGLES + ES_HULL_VERTICES + 8];
    for (uint32_t t = 0; t < b->used; t++) {
        group[t] = UINT32_MAX;
        area[t] = doubled_area(b, &b->triangles[t]);
    }
    uint32_t groups = 0;
    for (;;) {
        uint32_t seed = UINT32_MAX, stack[TRIANGLES + ES_HULL_VERTICES + 8], depth = 0;
        for (uint32_t t = 0; t < b->used; t++)
            if (group[t] == UINT32_MAX && (seed == UINT32_MAX || area[t] > area[seed])) seed = t;
        if (seed == UINT32_MAX) return groups;
        const triangle* plane = &b->triangles[seed];
        group[seed] = groups;
        stack[depth++] = seed;
        while (depth) {
            const triangle* at = &b->triangles[stack[--depth]];
            for (int k = 0; k < 3; k++) {
                uint32_t next = at->across[k];
                if (group[next] != UINT32_MAX || dot(b->triangles[next].normal, plane->normal) < 0.9) continue;
                bool in_plane = true;
                for (int c = 0; c < 3; c++) {
                    double p[3];
                    point_of(b, b->triangles[next].v[c], p);
                    in_plane &= __builtin_fabs(dot(plane->normal, p) - plane->offset) <= merge * b->extent;
                }
                if (!in_plane) continue;
                group[next] = groups;
                stack[depth++] = next;
            }
        }
        groups++;
    }
}

typedef struct polygon { uint32_t v[ES_HULL_VERTICES + 1], count; } polygon;

/* The outline of a group; false when it is not one loop. */
static bool outline(const builder* b, const uint32_t group[], uint32_t which, polygon* out)
{
    uint32_t next[3 * TRIANGLES][2], edges = 0;
    for (uint32_t t = 0; t < b->used; t++)
        for (int k = 0; group[t] == which && k < 3; k++)
            if (group[b->triangles[t].across[k]] != which) {
                next[edges][0] = b->triangles[t].v[k];
                next[edges++][1] = b->triangles[t].v[(k + 1) % 3];
            }
    out->count = 0;
    if (edges < 3 || edges > ES_HULL_VERTICES) return false;
    uint32_t at = next[0][0];
    do {
        uint32_t e = 0;
        while (e < edges && next[e][0] != at) e++;
        if (e == edges || out->count == edges) return false;
        out->v[out->count++] = at;
        at = next[e][1];
    } while (at != next[0][0]);
    return out->count == edges;
}

static es_result broken(es_context* context, const char* what)
{
    return es_fail(context, ES_INVALID_ARGUMENT, "%s: the hull's points are too nearly in a plane", what);
}

/* Faces, half edges in pairs, planes from the whole outline. */
static es_result write_hull(es_context* context, const builder* b, const polygon* faces, uint32_t face_count, const char* what, es_hull* hull)
{
    uint32_t corner[ES_HULL_VERTICES], corners = 0, half_edges = 0;
    for (uint32_t f = 0; f < face_count; f++) {
        half_edges += faces[f].count;
        for (uint32_t i = 0; i < faces[f].count; i++) {
            uint32_t c = 0;
            while (c < corners && corner[c] != faces[f].v[i]) c++;
            if (c < corners) continue;
            if (corners == ES_HULL_VERTICES) return broken(context, what);
            corner[corners++] = faces[f].v[i];
        }
    }
    if (half_edges > 2 * ES_HULL_EDGES || face_count > ES_HULL_FACES || corners + face_count != half_edges / 2 + 2) return broken(context, what);
    if (!es_hull_allocate(context, corners, face_count, half_edges, hull)) return ES_OUT_OF_MEMORY;

    double sum[3] = {0};
    for (uint32_t c = 0; c < corners; c++) {
        double p[3];
        point_of(b, corner[c], p);
        hull->vertices[c] = es_v3((float)p[0], (float)p[1], (float)p[2]);
        for (int k = 0; k < 3; k++) sum[k] += p[k];
    }
    hull->centre = es_v3((float)(sum[0] / corners), (float)(sum[1] / corners), (float)(sum[2] / corners));

    static const uint16_t none = UINT16_MAX;
    uint16_t number[ES_HULL_VERTICES][ES_HULL_VERTICES];
    memset(number, 0xff, sizeof number);
    uint16_t used = 0;
    for (uint32_t pass = 0; pass < 2; pass++)
        for (uint32_t f = 0; f < face_count; f++)
            for (uint32_t i = 0; i < faces[f].count; i++) {
                uint8_t c[3];
                for (uint32_t k = 0; k < 3; k++) {
                    uint32_t v = faces[f].v[(i + k) % faces[f].count], at = 0;
                    while (corner[at] != v) at++;
                    c[k] = (uint8_t)at;
                }
                if (pass == 0) {
                    if (number[c[0]][c[1]] != none) continue;
                    number[c[0]][c[1]] = used;
                    number[c[1]][c[0]] = (uint16_t)(used + 1);
                    used = (uint16_t)(used + 2);
                    if (used > half_edges) goto failed;
                } else {
                    uint16_t next = number[c[1]][c[2]];
                    if (next == none) goto failed;
                    hull->half_edges[number[c[0]][c[1]]] = (es_half_edge){c[0], (uint8_t)f, next};
                    if (i == 0) hull->first[f] = number[c[0]][c[1]];
                }
            }
    for (uint32_t f = 0; f < face_count; f++) { /* Newell's normal, through the outermost corner */
        double n[3] = {0}, o[3], p[3], q[3], u[3];
        point_of(b, faces[f].v[0], o);
        for (uint32_t i = 1; i + 1 < faces[f].count; i++) {
            point_of(b, faces[f].v[i], p);
            point_of(b, faces[f].v[i + 1], q);
            subtract(p, o, p);
            subtract(q, o, q);
            cross(p, q, u);
            for (int k = 0; k < 3; k++) n[k] += u[k];
        }
        double length = __builtin_sqrt(dot(n, n));
        if (!(length > 0)) goto failed;
        es_plane* plane = &hull->planes[f];
        plane->normal = es_v3((float)(n[0] / length), (float)(n[1] / length), (float)(n[2] / length));
        plane->offset = -3e38f;
        for (uint32_t c = 0; c < corners; c++) plane->offset = es_maxf(plane->offset, es_v3_dot(plane->normal, hull->vertices[c]));
    }
    return ES_OK;
failed:
    es_hull_free(context, hull);
    return broken(context, what);
}

static es_result make_faces(es_context* context, const builder* b, polygon* faces, const char* what, es_hull* hull)
{
    uint32_t group[TRIANGLES + ES_HULL_VERTICES + 8], count = group_faces(b, group);
    bool merged = true;
    for (uint32_t f = 0; merged && f < count; f++) merged = outline(b, group, f, &faces[f]);
    if (!merged) { /* each triangle its own face */
        count = b->used;
        for (uint32_t t = 0; t < count; t++) {
            faces[t].count = 3;
            memcpy(faces[t].v, b->triangles[t].v, sizeof b->triangles[t].v);
        }
        return write_hull(context, b, faces, count, what, hull);
    }
    /* a corner of only two faces lies on an edge */
    for (uint32_t f = 0; f < count; f++)
        for (uint32_t i = 0; i < faces[f].count;) {
            uint32_t v = faces[f].v[i], others = 0, smallest = faces[f].count;
            for (uint32_t g = 0; g < count; g++)
                for (uint32_t k = 0; k < faces[g].count; k++)
                    if (faces[g].v[k] == v) {
                        others++;
                        if (faces[g].count < smallest) smallest = faces[g].count;
                    }
            if (others != 2 || smallest == 3) {
                i++;
                continue;
            }
            for (uint32_t g = 0; g < count; g++)
                for (uint32_t k = 0; k < faces[g].count; k++)
                    if (faces[g].v[k] == v) {
                        memmove(&faces[g].v[k], &faces[g].v[k + 1], (faces[g].count - k - 1) * sizeof v);
                        faces[g].count--;
                        break;
                    }
        }
    return write_hull(context, b, faces, count, what, hull);
}

es_result es_hull_build(es_context* context, const float* points, uint32_t count, uint32_t stride, es_vec3 scale, const char* what, es_hull* hull)
{
    *hull = (es_hull){0};
    if (count < 4 || count > MAX_POINTS)
        return es_fail(context, ES_INVALID_ARGUMENT, "%s: a hull needs at least four points that span a volume, at most 2^24, not %u", what, count);
    es_result result = ES_OUT_OF_MEMORY;
    size_t bytes = (size_t)count * (sizeof(double) + sizeof(uint32_t)), face_bytes = (TRIANGLES + ES_HULL_VERTICES + 8) * sizeof(polygon);
    builder* b = es_allocate_zero(context, sizeof *b);
    char* lists = b ? es_allocate(context, bytes) : NULL;
    polygon* faces = lists ? es_allocate(context, face_bytes) : NULL;
    if (faces) {
        *b = (builder){.points = points, .count = count, .stride = stride, .scale = {scale.x, scale.y, scale.z}};
        b->height = (double*)lists;
        b->above = (uint32_t*)(b->height + count);
        if (begin(b)) {
            while (b->corners < ES_HULL_VERTICES) {
                uint32_t farthest = UINT32_MAX;
                for (uint32_t i = 0; i < count; i++)
                    if (b->above[i] != UINT32_MAX && (farthest == UINT32_MAX || b->height[i] > b->height[farthest])) farthest = i;
                if (farthest == UINT32_MAX) break;
                if (!add_corner(b, farthest)) b->above[farthest] = UINT32_MAX;
            }
            result = make_faces(context, b, faces, what, hull);
        } else
            result = es_fail(context, ES_INVALID_ARGUMENT, "%s: the hull's points lie in a plane, on a line or in one place; they must span a volume", what);
    }
    es_release(context, faces, face_bytes);
    es_release(context, lists, bytes);
    es_release(context, b, sizeof *b);
    return result;
}
