/* Preparing a mesh: corners at one place become one, triangles are put into a tree that halves them along the longest axis, edges find
 * their two triangles, and triangles in one plane their facet. */
#include "sim/rigid/shape_mesh.h"

#include <stdlib.h>
#include <string.h>

#include "sim/rigid/frame.h"

enum { LEAF = 4 };
/* within about one degree two triangles count as one plane for what slides over their edge; a facet is stricter */
static const float flat_cosine = 0.99985f, facet_cosine = 0.999999f;

typedef struct corner { float p[3]; uint32_t index; } corner;
typedef struct edge_use { uint32_t a, b, triangle, side; } edge_use;

static int by_place(const void* x, const void* y)
{
    const corner *p = x, *q = y;
    for (int k = 0; k < 3; k++)
        if (p->p[k] != q->p[k]) return p->p[k] < q->p[k] ? -1 : 1;
    return p->index < q->index ? -1 : p->index > q->index;
}
static int by_ends(const void* x, const void* y)
{
    const edge_use *p = x, *q = y;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    if (p->b != q->b) return p->b < q->b ? -1 : 1;
    return p->triangle < q->triangle ? -1 : p->triangle > q->triangle;
}

/* Vertices in `mesh`, sorted by place and without doubles; number[i]: where vertex i of the source went. */
static bool weld(es_context* context, const es_raster_mesh* source, es_vec3 scale, es_vec3 position, es_quat rotation, es_shape_mesh* mesh, uint32_t* number)
{
    size_t bytes = source->vertex_count * sizeof(corner);
    corner* corners = es_allocate(context, bytes);
    mesh->vertex_bytes = source->vertex_count * sizeof(es_vec3);
    mesh->vertices = corners ? es_allocate(context, mesh->vertex_bytes) : NULL;
    if (!mesh->vertices) {
        es_release(context, corners, bytes);
        return false;
    }
    es_mat3 m = es_mat3_from_quat(rotation);
    for (uint32_t i = 0; i < source->vertex_count; i++) {
        const float* p = source->positions + 4 * (size_t)i;
        es_vec3 v = es_v3_add(position, es_mat3_mul(&m, es_v3(p[0] * scale.x, p[1] * scale.y, p[2] * scale.z)));
        corners[i] = (corner){{v.x + 0.0f, v.y + 0.0f, v.z + 0.0f}, i}; /* -0 becomes 0 */
    }
    qsort(corners, source->vertex_count, sizeof *corners, by_place);
    for (uint32_t i = 0; i < source->vertex_count; i++) {
        if (i == 0 || memcmp(corners[i].p, corners[i - 1].p, sizeof corners[i].p) != 0) mesh->vertices[mesh->vertex_count++] = es_v3(corners[i].p[0], corners[i].p[1], corners[i].p[2]);
        number[corners[i].index] = mesh->vertex_count - 1;
    }
    es_release(context, corners, bytes);
    return true;
}

static bool triangle_plane(const es_shape_mesh* mesh, es_mesh_triangle* t)
{
    const es_vec3 *a = &mesh->vertices[t->vertex[0]], *b = &mesh->vertices[t->vertex[1]], *c = &mesh->vertices[t->vertex[2]];
    double u[3] = {(double)b->x - a->x, (double)b->y - a->y, (double)b->z - a->z}, v[3] = {(double)c->x - a->x, (double)c->y - a->y, (double)c->z - a->z};
    double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    double nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2], uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], vv = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    double longest = uu > vv ? uu : vv;
    if (!(nn > 1e-12 * longest * longest)) return false; /* thinner than a millionth of its length */
    double length = __builtin_sqrt(nn);
    t->normal = es_v3((float)(n[0] / length), (float)(n[1] / length), (float)(n[2] / length));
    t->offset = (float)((n[0] * a->x + n[1] * a->y + n[2] * a->z) / length);
    return true;
}

/* ---- the tree ------------------------------------------------------------------------------------------------------------- */

static float middle_of(const es_shape_mesh* mesh, const es_mesh_triangle* t, int axis)
{
    float a = es_v3_axis(mesh->vertices[t->vertex[0]], axis), b = es_v3_axis(mesh->vertices[t->vertex[1]], axis), c = es_v3_axis(mesh->vertices[t->vertex[2]], axis);
    return es_minf(a, es_minf(b, c)) + es_maxf(a, es_maxf(b, c));
}
static bool lower(const es_shape_mesh* mesh, const es_mesh_triangle* s, const es_mesh_triangle* t, int axis)
{
    float a = middle_of(mesh, s, axis), b = middle_of(mesh, t, axis);
    return a != b ? a < b : s->source < t->source;
}

/* Puts the lower half of [begin, end) before `middle`: quickselect about the median of three. */
static void split(es_shape_mesh* mesh, uint32_t begin, uint32_t end, uint32_t middle, int axis)
{
    es_mesh_triangle* t = mesh->triangles;
    while (end - begin > 1) {
        uint32_t a = begin, b = begin + (end - begin) / 2, c = end - 1, pivot;
        if (lower(mesh, &t[a], &t[b], axis))
            pivot = lower(mesh, &t[b], &t[c], axis) ? b : lower(mesh, &t[a], &t[c], axis) ? c : a;
        else
            pivot = lower(mesh, &t[a], &t[c], axis) ? a : lower(mesh, &t[b], &t[c], axis) ? c : b;
        es_mesh_triangle value = t[pivot];
        t[pivot] = t[end - 1];
        t[end - 1] = value;
        uint32_t kept = begin;
        for (uint32_t i = begin; i + 1 < end; i++)
            if (lower(mesh, &t[i], &value, axis)) {
                es_mesh_triangle swap = t[i];
                t[i] = t[kept];
                t[kept++] = swap;
            }
        t[end - 1] = t[kept];
        t[kept] = value;
        if (kept == middle) return;
        if (kept < middle)
            begin = kept + 1;
        else
            end = kept;
    }
}

static uint32_t build(es_shape_mesh* mesh, uint32_t begin, uint32_t end)
{
    uint32_t at = mesh->node_count++;
    es_mesh_node node = {{3e38f, 3e38f, 3e38f}, begin, {-3e38f, -3e38f, -3e38f}, end - begin};
    es_vec3 least = node.low, most = node.high;
    for (uint32_t i = begin; i < end; i++) {
        const es_mesh_triangle* t = &mesh->triangles[i];
        for (int k = 0; k < 3; k++) {
            node.low = es_v3_min(node.low, mesh->vertices[t->vertex[k]]);
            node.high = es_v3_max(node.high, mesh->vertices[t->vertex[k]]);
        }
        es_vec3 middle = es_v3(middle_of(mesh, t, 0), middle_of(mesh, t, 1), middle_of(mesh, t, 2));
        least = es_v3_min(least, middle);
        most = es_v3_max(most, middle);
    }
    if (end - begin > LEAF) {
        es_vec3 d = es_v3_sub(most, least);
        int axis = d.x >= d.y && d.x >= d.z ? 0 : d.y >= d.z ? 1 : 2;
        uint32_t middle = begin + (end - begin) / 2;
        split(mesh, begin, end, middle, axis);
        build(mesh, begin, middle); /* as deep as the logarithm of the triangles */
        node.first = build(mesh, middle, end);
        node.count = 0;
    }
    mesh->nodes[at] = node;
    return at;
}

/* ---- edges and facets ----------------------------------------------------------------------------------------------------------- */

static void meet(const es_shape_mesh* mesh, uint32_t t, uint32_t side, uint32_t other, uint32_t other_side)
{
    es_mesh_triangle *a = &mesh->triangles[t], *b = &mesh->triangles[other];
    bool same_way = a->vertex[side] == b->vertex[other_side]; /* consistent windings run along a shared edge in opposite ways */
    es_vec3 n = same_way ? es_v3_neg(b->normal) : b->normal;
    a->across[side] = n;
    float height = es_v3_dot(a->normal, mesh->vertices[b->vertex[(other_side + 2) % 3]]) - a->offset;
    a->kind[side] = es_v3_dot(a->normal, n) > flat_cosine ? ES_EDGE_FLAT : height > 0 ? ES_EDGE_VALLEY : ES_EDGE_RIDGE;
}

static bool find_edges(es_context* context, es_shape_mesh* mesh)
{
    size_t count = (size_t)mesh->triangle_count * 3, bytes = count * sizeof(edge_use);
    edge_use* uses = es_allocate(context, bytes);
    if (!uses) return false;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (uint32_t k = 0; k < 3; k++) {
            uint32_t a = mesh->triangles[t].vertex[k], b = mesh->triangles[t].vertex[(k + 1) % 3];
            uses[3 * (size_t)t + k] = (edge_use){a < b ? a : b, a < b ? b : a, t, k};
        }
    qsort(uses, count, sizeof *uses, by_ends);
    uint32_t edges = 0;
    for (size_t i = 0; i < count;) {
        size_t end = i + 1;
        while (end < count && uses[end].a == uses[i].a && uses[end].b == uses[i].b) end++;
        if (end - i == 2) {
            meet(mesh, uses[i].triangle, uses[i].side, uses[i + 1].triangle, uses[i + 1].side);
            meet(mesh, uses[i + 1].triangle, uses[i + 1].side, uses[i].triangle, uses[i].side);
        }
        for (; i < end; i++) mesh->triangles[uses[i].triangle].edge[uses[i].side] = edges;
        edges++;
    }
    /* facets: triangles take over the lowest number of what lies flat beside them, until nothing changes */
    for (uint32_t t = 0; t < mesh->triangle_count; t++) mesh->triangles[t].facet = t;
    for (bool changed = true; changed;) {
        changed = false;
        for (size_t i = 0; i + 1 < count; i++) {
            if (uses[i].a != uses[i + 1].a || uses[i].b != uses[i + 1].b) continue;
            es_mesh_triangle *a = &mesh->triangles[uses[i].triangle], *b = &mesh->triangles[uses[i + 1].triangle];
            if (a->kind[uses[i].side] != ES_EDGE_FLAT || es_v3_dot(a->normal, a->across[uses[i].side]) < facet_cosine || a->facet == b->facet) continue;
            uint32_t x = a->facet, y = b->facet; /* join two sets by their roots */
            while (mesh->triangles[x].facet != x) x = mesh->triangles[x].facet;
            while (mesh->triangles[y].facet != y) y = mesh->triangles[y].facet;
            if (x == y) continue;
            mesh->triangles[x > y ? x : y].facet = x > y ? y : x;
            changed = true;
        }
        for (uint32_t t = 0; t < mesh->triangle_count; t++) { /* ascending: the root's own is final */
            uint32_t root = t;
            while (mesh->triangles[root].facet != root) root = mesh->triangles[root].facet;
            mesh->triangles[t].facet = root;
        }
    }
    es_release(context, uses, bytes);
    return true;
}

es_result es_shape_mesh_make(es_world* world, es_mesh handle, es_vec3 scale, es_vec3 position, es_quat rotation, const char* what, es_shape_mesh** made)
{
    es_context* context = world->context;
    *made = NULL;
    const es_raster_mesh* source = es_world_mesh(world, handle);
    if (!source) return ES_STALE_HANDLE;
    size_t number_bytes = (size_t)source->vertex_count * sizeof(uint32_t);
    es_shape_mesh* mesh = es_allocate_zero(context, sizeof *mesh);
    uint32_t* number = mesh ? es_allocate(context, number_bytes) : NULL;
    bool works = number && weld(context, source, scale, position, rotation, mesh, number);
    if (works) {
        mesh->triangle_bytes = (source->triangle_count + 1) * sizeof(es_mesh_triangle);
        mesh->triangles = es_allocate_zero(context, mesh->triangle_bytes);
        works = mesh->triangles != NULL;
    }
    for (uint32_t t = 0; works && t < source->triangle_count; t++) {
        const uint32_t* index = source->indices + 3 * (size_t)t;
        es_mesh_triangle triangle = {.vertex = {number[index[0]], number[index[1]], number[index[2]]}, .source = t};
        if (triangle_plane(mesh, &triangle)) mesh->triangles[mesh->triangle_count++] = triangle;
    }
    es_result result = works ? ES_OK : ES_OUT_OF_MEMORY;
    if (works && mesh->triangle_count == 0) result = es_fail(context, ES_INVALID_ARGUMENT, "%s: the mesh has no triangle with an area", what);
    if (result == ES_OK) {
        mesh->node_bytes = 2 * (size_t)mesh->triangle_count * sizeof(es_mesh_node);
        mesh->nodes = es_allocate(context, mesh->node_bytes);
        if (mesh->nodes) build(mesh, 0, mesh->triangle_count);
        if (!mesh->nodes || !find_edges(context, mesh)) result = ES_OUT_OF_MEMORY;
    }
    es_release(context, number, number_bytes);
    if (result == ES_OK)
        *made = mesh;
    else
        es_shape_mesh_free(context, mesh);
    return result;
}

void es_shape_mesh_free(es_context* context, es_shape_mesh* mesh)
{
    if (!mesh) return;
    es_release(context, mesh->vertices, mesh->vertex_bytes);
    es_release(context, mesh->triangles, mesh->triangle_bytes);
    es_release(context, mesh->nodes, mesh->node_bytes);
    es_release(context, mesh, sizeof *mesh);
}
