/* A convex shape against the triangles of a mesh.
 *
 * Each triangle near the shape gives points with its own normal, or with an edge's or corner's where those stick out: at an edge, normals between
 * those of its two triangles; at a flat or hollow one none but the triangle's, so that nothing catches on edges inside of a floor
 * (Catto's and Jolt's "ghost collisions"). What belongs beyond a ridge is the neighbour's. Points of all triangles are then gathered by
 * normal, doubles thrown out by their ids, and each set becomes a manifold. Everything is in the mesh's frame. */
#include "sim/rigid/core.h"
#include "sim/rigid/distance.h"
#include "sim/rigid/shape_mesh.h"

#include <stdlib.h>

enum { CANDIDATES = 256 };

typedef struct candidate { es_vec3 normal; es_contact_point point; uint32_t key; } candidate;
typedef struct gather { candidate list[CANDIDATES]; uint32_t count; } gather;

/* A triangle seen from the side the shape's centre is on. */
typedef struct facing {
    es_core core;
    es_plane plane;
    uint32_t index, edge[3], corner[3];
    es_vec3 across[3];
    uint8_t kind[3];
    float size;
} facing;

static void add(gather* g, es_vec3 normal, es_vec3 point, float separation, uint32_t id, uint32_t key)
{
    uint32_t at = g->count;
    if (at == CANDIDATES) { /* full: the shallowest makes room */
        at = 0;
        for (uint32_t i = 1; i < CANDIDATES; i++)
            if (g->list[i].point.separation > g->list[at].point.separation) at = i;
        if (g->list[at].point.separation <= separation) return;
    } else
        g->count++;
    g->list[at] = (candidate){normal, {point, separation, id}, key};
}

static uint32_t mix(uint32_t a, uint32_t b)
{
    uint32_t h = a * 0x9e3779b1u ^ (b + 0x7f4a7c15u) * 0x85ebca6bu;
    return (h ^ h >> 15) >> 1 | 0x40000000u;
}

static void face_towards(const es_shape_mesh* mesh, uint32_t index, es_vec3 centre, facing* f)
{
    const es_mesh_triangle* t = &mesh->triangles[index];
    static const es_half_edge half_edges[6] = {{0, 0, 2}, {1, 1, 5}, {1, 0, 4}, {2, 1, 1}, {2, 0, 0}, {0, 1, 3}};
    static const uint16_t first[2] = {0, 1};
    bool back = es_v3_dot(t->normal, centre) < t->offset;
    f->index = index;
    f->plane = back ? (es_plane){es_v3_neg(t->normal), -t->offset} : (es_plane){t->normal, t->offset};
    for (uint32_t k = 0; k < 3; k++) { /* the other way round, edges too */
        uint32_t corner = back ? (3 - k) % 3 : k, edge = back ? 2 - k : k;
        f->corner[k] = t->vertex[corner];
        f->edge[k] = t->edge[edge];
        f->kind[k] = t->kind[edge];
        f->across[k] = t->across[edge];
        if (back) {
            f->across[k] = es_v3_neg(f->across[k]);
            if (f->kind[k] == ES_EDGE_RIDGE || f->kind[k] == ES_EDGE_VALLEY) f->kind[k] = f->kind[k] == ES_EDGE_RIDGE ? ES_EDGE_VALLEY : ES_EDGE_RIDGE;
        }
        f->core.own_vertices[k] = mesh->vertices[f->corner[k]];
    }
    es_core* c = &f->core;
    c->vertex_count = 3;
    c->face_count = 2;
    c->half_edge_count = 6;
    c->vertices = c->own_vertices;
    c->planes = c->own_planes;
    c->own_planes[0] = f->plane;
    c->own_planes[1] = (es_plane){es_v3_neg(f->plane.normal), -f->plane.offset};
    c->first = first;
    c->half_edges = half_edges;
    c->radius = 0;
    c->centre = es_v3_scale(es_v3_add(es_v3_add(c->vertices[0], c->vertices[1]), c->vertices[2]), 1.0f / 3);
    f->size = es_v3_length(es_v3_sub(c->vertices[1], c->vertices[0])) + es_v3_length(es_v3_sub(c->vertices[2], c->vertices[0]));
}

/* ---- which normals a triangle may give ----------------------------------------------------------------------------------------- */

typedef enum verdict { AS_IT_IS, FACE_NORMAL, NOT_OURS } verdict;

/* n leans out over edge k. */
static verdict judge_edge(const facing* f, int k, es_vec3 n)
{
    switch (f->kind[k]) {
    case ES_EDGE_BORDER: return AS_IT_IS;
    case ES_EDGE_RIDGE: {
        float between = es_v3_dot(f->plane.normal, f->across[k]);
        if (es_v3_dot(n, f->plane.normal) < between - 1e-3f) return NOT_OURS;
        return es_v3_dot(n, f->across[k]) < between - 1e-3f ? FACE_NORMAL : AS_IT_IS;
    }
    default: return FACE_NORMAL;
    }
}

/* By the corners that are outermost along n (towards the shape): three: the face; two: an edge; one: its two edges, of which one must allow it. */
static verdict judge(const facing* f, es_vec3 n)
{
    float s[3], most = -3e38f;
    for (int k = 0; k < 3; k++) {
        s[k] = es_v3_dot(n, f->core.vertices[k]);
        most = es_maxf(most, s[k]);
    }
    bool outer[3];
    int count = 0;
    for (int k = 0; k < 3; k++) count += outer[k] = s[k] >= most - 2e-3f * f->size;
    if (count == 3) return FACE_NORMAL;
    if (count == 2) return judge_edge(f, !outer[2] ? 0 : !outer[0] ? 1 : 2, n);
    int corner = outer[0] ? 0 : outer[1] ? 1 : 2;
    verdict a = judge_edge(f, corner, n), b = judge_edge(f, (corner + 2) % 3, n);
    if (a == AS_IT_IS || b == AS_IT_IS) return a == NOT_OURS || b == NOT_OURS ? NOT_OURS : AS_IT_IS;
    return a == NOT_OURS || b == NOT_OURS ? NOT_OURS : FACE_NORMAL;
}

/* ---- one triangle --------------------------------------------------------------------------------------------------------------- */

/* The shape's face, side or point over the triangle, with the triangle's normal. Ids: the shape's corner; or a crossing of its edge with a mesh
 * edge; or a mesh corner. Crossings with flat edges are no corners of what is touched. */
static void face_contact(const es_shape_mesh* mesh, const facing* f, const es_core* b, float margin, gather* g)
{
    es_clip_corner polygon[2][ES_CLIP_CORNERS];
    es_vec3 n = f->plane.normal;
    uint32_t count = es_incident_polygon(b, n, polygon[0]), at = 0;
    for (uint32_t k = 0; k < 3 && count; k++) {
        es_vec3 from = f->core.vertices[k], side = es_v3_normalize(es_v3_cross(es_v3_sub(f->core.vertices[(k + 1) % 3], from), n), n);
        count = es_clip_polygon(polygon[at], count, side, es_v3_dot(side, from) + 1e-5f * f->size, 512 + k, polygon[at ^ 1]);
        at ^= 1;
    }
    uint32_t key = 1 + 2 * mesh->triangles[f->index].facet;
    for (uint32_t i = 0; i < count; i++) {
        float w = es_v3_dot(n, polygon[at][i].p) - f->plane.offset, separation = w - b->radius;
        if (separation > margin) continue;
        uint32_t label = polygon[at][i].label, before = count > 2 ? polygon[at][i ? i - 1 : count - 1].label : label, id;
        if (label < 512 && before < 512)
            id = b->face_count ? b->half_edges[label].origin : label;
        else if (label >= 512 && before >= 512 && label != before) {
            uint32_t k = label - 512, k_before = before - 512;
            if (f->kind[k] == ES_EDGE_FLAT && f->kind[k_before] == ES_EDGE_FLAT) continue;
            id = 0x20000000u | f->corner[k]; /* where edge k begins */
        } else {
            uint32_t k = (label >= 512 ? label : before) - 512, other = label >= 512 ? before : label;
            if (f->kind[k] == ES_EDGE_FLAT) continue;
            id = mix(f->edge[k], other < 512 ? other >> 1 : other);
        }
        add(g, n, es_v3_mad(polygon[at][i].p, n, -0.5f * (b->radius + w)), separation, id, key);
    }
}

/* With a normal of an edge or corner: the shape's face if it has one there, else the nearest points. */
static void edge_contact(const es_shape_mesh* mesh, const facing* f, const es_core* b, es_vec3 n, es_vec3 on_triangle, es_vec3 on_b, float margin, gather* g)
{
    uint32_t key = 2 + 2 * mesh->triangles[f->index].facet;
    float cosine;
    uint32_t face = es_core_aligned_face(b, es_v3_neg(n), &cosine);
    es_manifold patch = {.count = 0};
    if (cosine > 0.999f && es_core_face_patch(b, &f->core, face, true, margin, &patch)) {
        for (uint32_t i = 0; i < patch.count; i++) add(g, patch.normal, patch.points[i].point, patch.points[i].separation, mix(patch.points[i].id, f->index), key);
        return;
    }
    float separation = es_v3_dot(n, es_v3_sub(on_b, on_triangle)) - b->radius;
    if (separation > margin) return;
    /* the same edge or corner reports the same from both of its triangles */
    float nearest = 3e38f;
    uint32_t id = 0;
    for (uint32_t k = 0; k < 3; k++) {
        es_vec3 d = es_v3_sub(f->core.vertices[k], on_triangle);
        if (es_v3_dot(d, d) < 1e-8f * f->size * f->size) id = 0x20000000u | f->corner[k];
    }
    for (uint32_t k = 0; k < 3 && !id; k++) {
        es_vec3 e = es_v3_sub(f->core.vertices[(k + 1) % 3], f->core.vertices[k]), c = es_v3_cross(e, es_v3_sub(on_triangle, f->core.vertices[k]));
        float away = es_v3_dot(c, c) / es_v3_dot(e, e);
        if (away < nearest) nearest = away;
    }
    for (uint32_t k = 0; k < 3 && !id; k++) {
        es_vec3 e = es_v3_sub(f->core.vertices[(k + 1) % 3], f->core.vertices[k]), c = es_v3_cross(e, es_v3_sub(on_triangle, f->core.vertices[k]));
        if (es_v3_dot(c, c) / es_v3_dot(e, e) <= nearest) id = mix(f->edge[k], 0xffff);
    }
    add(g, n, es_v3_mad(on_b, n, -b->radius - 0.5f * separation), separation, id, key);
}

/* Cores apart, and something round. */
static void collide_apart(const es_shape_mesh* mesh, const facing* f, const es_core* b, const es_nearest* nearest, float margin, gather* g)
{
    bool used[3] = {false, false, false};
    for (uint32_t i = 0; i < nearest->count; i++) used[nearest->a[i]] = true;
    int corners = used[0] + used[1] + used[2];
    verdict v = AS_IT_IS;
    if (corners == 3 || es_v3_dot(nearest->normal, f->plane.normal) > 0.9999f)
        v = FACE_NORMAL;
    else if (corners == 2)
        v = judge_edge(f, !used[2] ? 0 : !used[0] ? 1 : 2, nearest->normal);
    else {
        int corner = used[0] ? 0 : used[1] ? 1 : 2;
        verdict x = judge_edge(f, corner, nearest->normal), y = judge_edge(f, (corner + 2) % 3, nearest->normal);
        v = x == NOT_OURS || y == NOT_OURS ? NOT_OURS : x == AS_IT_IS || y == AS_IT_IS ? AS_IT_IS : FACE_NORMAL;
    }
    if (v == FACE_NORMAL) face_contact(mesh, f, b, margin, g);
    if (v == AS_IT_IS) edge_contact(mesh, f, b, nearest->normal, nearest->on_a, nearest->on_b, margin, g);
}

/* Of the triangle's edges with the shape's: the arc of a triangle's edge goes from its front over the outward side to its back. */
static es_core_axis best_edges(const facing* f, const es_core* b, float limit)
{
    es_core_axis best = {-3e38f, 0, 0, {0, 0, 0}};
    for (uint32_t k = 0; k < 3; k++) {
        es_vec3 p = f->core.vertices[k], ea = es_v3_sub(f->core.vertices[(k + 1) % 3], p), out = es_v3_cross(ea, f->plane.normal);
        float aa = es_v3_dot(ea, ea);
        for (uint32_t j = 0; j < b->half_edge_count; j += 2) {
            es_vec3 middle = out;
            if (b->face_count) {
                es_vec3 m1 = b->planes[b->half_edges[j].face].normal, m2 = b->planes[b->half_edges[j + 1].face].normal;
                if (es_v3_dot(m1, ea) * es_v3_dot(m2, ea) >= 0) continue;
                middle = es_v3_neg(es_v3_add(m1, m2));
            }
            es_vec3 q = b->vertices[b->half_edges[j].origin], eb = es_v3_sub(b->vertices[b->half_edges[j + 1].origin], q), n = es_v3_cross(ea, eb);
            float nn = es_v3_dot(n, n);
            if (nn < 1e-4f * aa * es_v3_dot(eb, eb)) continue;
            n = es_v3_scale(n, (es_v3_dot(n, middle) < 0 ? -1.0f : 1.0f) / es_sqrt(nn));
            if (es_v3_dot(n, out) < 0) continue;
            float s = es_v3_dot(n, es_v3_sub(q, p));
            if (s > best.separation) {
                best = (es_core_axis){s, k, j, n};
                if (s > limit) return best;
            }
        }
    }
    return best;
}

/* Cores that overlap, or are near without being round. */
static void collide_deep(const es_shape_mesh* mesh, const facing* f, const es_core* b, float margin, gather* g)
{
    float limit = margin + b->radius, face_separation = 3e38f;
    for (uint32_t i = 0; i < b->vertex_count; i++) face_separation = es_minf(face_separation, es_v3_dot(f->plane.normal, b->vertices[i]) - f->plane.offset);
    if (face_separation > limit) return;
    es_core_axis own = es_core_best_face(b, &f->core, limit);
    if (own.separation > limit) return;
    es_core_axis edges = best_edges(f, b, limit);
    if (edges.separation > limit) return;
    float slack = 0.05f * es_absf(face_separation) + 1e-3f * es_v3_length(es_v3_sub(b->vertices[0], b->centre));
    bool use_edges = edges.separation > own.separation;
    float best = use_edges ? edges.separation : own.separation;
    if (!(best > face_separation + slack)) {
        face_contact(mesh, f, b, margin, g);
        return;
    }
    es_vec3 n = use_edges ? edges.normal : es_v3_neg(own.normal);
    verdict v = judge(f, n);
    if (v == NOT_OURS) return;
    if (v == FACE_NORMAL) {
        /* what is deep below this plane but only just beside the triangle is held by what lies there */
        if (-face_separation <= 4 * es_maxf(-best, 0) + 0.25f * es_v3_length(es_v3_sub(b->vertices[0], b->centre))) face_contact(mesh, f, b, margin, g);
        return;
    }
    es_vec3 on_a, on_b;
    if (use_edges) {
        float s, t;
        es_vec3 p0 = f->core.vertices[edges.a], p1 = f->core.vertices[(edges.a + 1) % 3];
        es_vec3 q0 = b->vertices[b->half_edges[edges.b].origin], q1 = b->vertices[b->half_edges[edges.b + 1].origin];
        es_nearest_of_segments(p0, p1, q0, q1, &s, &t);
        on_a = es_v3_mix(p0, p1, s);
        on_b = es_v3_mix(q0, q1, t);
    } else {
        on_a = f->core.vertices[es_core_support(&f->core, n)];
        on_b = es_v3_mad(on_a, n, own.separation);
    }
    edge_contact(mesh, f, b, n, on_a, on_b, margin, g);
}

/* ---- all of them ----------------------------------------------------------------------------------------------------------------- */

static int by_key(const void* x, const void* y)
{
    const candidate *p = x, *q = y;
    if (p->key != q->key) return p->key < q->key ? -1 : 1;
    if (p->point.id != q->point.id) return p->point.id < q->point.id ? -1 : 1;
    if (p->point.separation != q->point.separation) return p->point.separation < q->point.separation ? -1 : 1;
    for (int k = 0; k < 3; k++) {
        float a = (&p->point.point.x)[k], b = (&q->point.point.x)[k];
        if (a != b) return a < b ? -1 : 1;
    }
    return 0;
}

/* Sets of candidates whose normals agree within five degrees; each id once in a set, at its deepest. */
static uint32_t make_manifolds(gather* g, es_manifold* manifolds, uint32_t capacity)
{
    es_manifold all[CANDIDATES];
    es_contact_point points[CANDIDATES];
    uint32_t sets = 0;
    uint8_t taken[CANDIDATES] = {0};
    if (g->count > 1) qsort(g->list, g->count, sizeof *g->list, by_key);
    for (uint32_t i = 0; i < g->count; i++) {
        if (taken[i]) continue;
        uint32_t count = 0;
        es_vec3 n = g->list[i].normal;
        for (uint32_t k = i; k < g->count; k++) {
            const candidate* c = &g->list[k];
            if (taken[k] || es_v3_dot(c->normal, n) < 0.9962f) continue;
            taken[k] = 1;
            uint32_t same = 0;
            while (same < count && points[same].id != c->point.id) same++;
            if (same == count)
                points[count++] = c->point;
            else if (c->point.separation < points[same].separation)
                points[same] = c->point;
        }
        all[sets] = (es_manifold){.normal = n, .key = g->list[i].key};
        es_manifold_choose(&all[sets], points, count);
        sets++;
    }
    /* the deepest ones, in the order of their keys */
    if (capacity > ES_MESH_MANIFOLDS) capacity = ES_MESH_MANIFOLDS;
    while (sets > capacity) {
        uint32_t shallowest = 0;
        float most = -3e38f;
        for (uint32_t i = 0; i < sets; i++) {
            float least = 3e38f;
            for (uint32_t k = 0; k < all[i].count; k++) least = es_minf(least, all[i].points[k].separation);
            if (least >= most) most = least, shallowest = i;
        }
        for (uint32_t i = shallowest; i + 1 < sets; i++) all[i] = all[i + 1];
        sets--;
    }
    for (uint32_t i = 0; i < sets; i++) {
        manifolds[i] = all[i];
        if (i && manifolds[i].key <= manifolds[i - 1].key) manifolds[i].key = manifolds[i - 1].key + 1;
    }
    return sets;
}

uint32_t es_collide_mesh(const es_rigid_shape* shape_mesh, const es_pose* pose_mesh, const es_rigid_shape* shape_b, const es_pose* pose_b, float margin,
    es_manifold* manifolds, uint32_t capacity)
{
    const es_shape_mesh* mesh = shape_mesh->mesh;
    es_core b;
    es_mat3 m;
    es_vec3 position;
    es_relative_pose(pose_mesh, pose_b, &m, &position);
    es_core_place(shape_b, &m, position, &b);
    es_vec3 low = b.vertices[0], high = low;
    for (uint32_t i = 1; i < b.vertex_count; i++) {
        low = es_v3_min(low, b.vertices[i]);
        high = es_v3_max(high, b.vertices[i]);
    }
    float around = b.radius + margin, limit = margin + b.radius;
    low = es_v3_sub(low, es_v3(around, around, around));
    high = es_v3_add(high, es_v3(around, around, around));

    gather g;
    g.count = 0;
    facing f;
    uint32_t stack[ES_MESH_STACK], depth = 0;
    stack[depth++] = 0;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_mesh_node* node = &mesh->nodes[at];
        if (node->low.x > high.x || node->low.y > high.y || node->low.z > high.z || node->high.x < low.x || node->high.y < low.y || node->high.z < low.z) continue;
        if (node->count == 0) {
            stack[depth++] = node->first;
            stack[depth++] = at + 1;
            continue;
        }
        for (uint32_t i = node->first; i < node->first + node->count; i++) {
            const es_mesh_triangle* t = &mesh->triangles[i];
            const es_vec3 *p = &mesh->vertices[t->vertex[0]], *q = &mesh->vertices[t->vertex[1]], *r = &mesh->vertices[t->vertex[2]];
            es_vec3 least = es_v3_min(*p, es_v3_min(*q, *r)), most = es_v3_max(*p, es_v3_max(*q, *r));
            if (least.x > high.x || least.y > high.y || least.z > high.z || most.x < low.x || most.y < low.y || most.z < low.z) continue;
            face_towards(mesh, i, b.centre, &f);
            es_nearest nearest = {0};
            if (b.radius > 0) {
                es_nearest_points(f.core.vertices, 3, b.vertices, b.vertex_count, &nearest);
                if (nearest.distance > limit) continue;
            }
            if (nearest.distance > 1e-3f * b.radius)
                collide_apart(mesh, &f, &b, &nearest, margin, &g);
            else
                collide_deep(mesh, &f, &b, margin, &g);
        }
    }
    uint32_t count = make_manifolds(&g, manifolds, capacity);
    es_mat3 turn = es_mat3_from_quat(pose_mesh->rotation);
    for (uint32_t i = 0; i < count; i++) {
        manifolds[i].normal = es_v3_normalize(es_mat3_mul(&turn, manifolds[i].normal), es_v3(0, 1, 0));
        for (uint32_t k = 0; k < manifolds[i].count; k++)
            manifolds[i].points[k].point = es_v3_add(pose_mesh->position, es_mat3_mul(&turn, manifolds[i].points[k].point));
    }
    return count;
}
