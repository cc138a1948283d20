/* A polyhedron against a polyhedron or a segment, either of them rounded.
 *
 * Cores that are apart and rounded meet along the line of their nearest points (GJK). Cores that overlap, and those without rounding, are
 * asked for the axis that separates them best: faces of both, and those pairs of edges whose arcs cross on the sphere of normals
 * (Gregorius 2013). Where the normal is a face's, the other shape's most opposed face is clipped against it; else there is one point.
 * Everything is in the first body's frame. */
#include "sim/rigid/core.h"
#include "sim/rigid/distance.h"

es_core_axis es_core_best_face(const es_core* faces, const es_core* other, float limit)
{
    es_core_axis best = {-3e38f, 0, 0, {0, 0, 0}};
    for (uint32_t i = 0; i < faces->face_count; i++) {
        es_vec3 n = faces->planes[i].normal;
        float least = 3e38f;
        for (uint32_t k = 0; k < other->vertex_count; k++) least = es_minf(least, es_v3_dot(n, other->vertices[k]));
        float s = least - faces->planes[i].offset;
        if (s > best.separation) {
            best.separation = s;
            best.a = i;
            best.normal = n;
            if (s > limit) break;
        }
    }
    return best;
}

/* The arcs of two edges on the sphere of normals, b's turned round, cross exactly when the pair makes a face of the difference. A segment's arc
 * is a whole circle. */
static es_core_axis best_edges(const es_core* a, const es_core* b, float limit)
{
    es_core_axis best = {-3e38f, 0, 0, {0, 0, 0}};
    for (uint32_t j = 0; j < b->half_edge_count; j += 2) {
        es_vec3 q = b->vertices[b->half_edges[j].origin], eb = es_v3_sub(b->vertices[b->half_edges[j + 1].origin], q);
        float bb = es_v3_dot(eb, eb);
        for (uint32_t i = 0; i < a->half_edge_count; i += 2) {
            es_vec3 n1 = a->planes[a->half_edges[i].face].normal, n2 = a->planes[a->half_edges[i + 1].face].normal;
            float s1 = es_v3_dot(n1, eb), s2 = es_v3_dot(n2, eb);
            if (s1 * s2 >= 0) continue;
            es_vec3 p = a->vertices[a->half_edges[i].origin], ea = es_v3_sub(a->vertices[a->half_edges[i + 1].origin], p);
            if (b->face_count) {
                float r1 = es_v3_dot(b->planes[b->half_edges[j].face].normal, ea), r2 = es_v3_dot(b->planes[b->half_edges[j + 1].face].normal, ea);
                if (r1 * r2 >= 0 || r1 * s2 >= 0) continue;
            }
            es_vec3 n = es_v3_cross(ea, eb);
            float nn = es_v3_dot(n, n);
            if (nn < 1e-4f * es_v3_dot(ea, ea) * bb) continue; /* half a degree from parallel: a face is as good */
            n = es_v3_scale(n, 1 / es_sqrt(nn));
            if (es_v3_dot(n, es_v3_sub(p, a->centre)) < 0) n = es_v3_neg(n);
            float s = es_v3_dot(n, es_v3_sub(q, p));
            if (s > best.separation) {
                best = (es_core_axis){s, i, j, n};
                if (s > limit) return best;
            }
        }
    }
    return best;
}

uint32_t es_core_face_patch(const es_core* reference, const es_core* other, uint32_t face, bool flipped, float margin, es_manifold* manifold)
{
    es_clip_corner polygon[2][ES_CLIP_CORNERS];
    const es_plane* plane = &reference->planes[face];
    es_vec3 n = plane->normal;
    uint32_t at = 0, count = es_incident_polygon(other, n, polygon[0]), edge = reference->first[face];
    do {
        es_vec3 from = reference->vertices[reference->half_edges[edge].origin];
        uint32_t next = reference->half_edges[edge].next;
        es_vec3 side = es_v3_cross(es_v3_sub(reference->vertices[reference->half_edges[next].origin], from), n);
        count = es_clip_polygon(polygon[at], count, side, es_v3_dot(side, from), 512 + edge, polygon[at ^ 1]);
        at ^= 1;
        edge = next;
    } while (edge != reference->first[face] && count);
    es_contact_point points[ES_CLIP_CORNERS];
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        float w = es_v3_dot(n, polygon[at][i].p) - plane->offset, separation = w - reference->radius - other->radius;
        if (separation > margin) continue;
        uint32_t before = polygon[at][i ? i - 1 : count - 1].label;
        if (count == 2) before = 0; /* a segment's ends have their own labels */
        points[kept++] = (es_contact_point){es_v3_mad(polygon[at][i].p, n, 0.5f * (reference->radius - other->radius - w)), separation,
            (uint32_t)flipped << 30 | face << 20 | before << 10 | polygon[at][i].label};
    }
    manifold->normal = flipped ? es_v3_neg(n) : n;
    es_manifold_choose(manifold, points, kept);
    return kept > 0;
}

static uint32_t edge_point(const es_core* a, const es_core* b, const es_core_axis* edges, es_manifold* manifold)
{
    es_vec3 p0 = a->vertices[a->half_edges[edges->a].origin], p1 = a->vertices[a->half_edges[edges->a + 1].origin];
    es_vec3 q0 = b->vertices[b->half_edges[edges->b].origin], q1 = b->vertices[b->half_edges[edges->b + 1].origin];
    float s, t;
    es_nearest_of_segments(p0, p1, q0, q1, &s, &t);
    es_vec3 on_a = es_v3_mad(es_v3_mix(p0, p1, s), edges->normal, a->radius), on_b = es_v3_mad(es_v3_mix(q0, q1, t), edges->normal, -b->radius);
    return es_manifold_single(manifold, edges->normal, es_v3_scale(es_v3_add(on_a, on_b), 0.5f), edges->separation - a->radius - b->radius,
        1u << 31 | edges->a << 10 | edges->b);
}

uint32_t es_core_aligned_face(const es_core* core, es_vec3 n, float* cosine)
{
    uint32_t face = 0;
    *cosine = -1;
    for (uint32_t i = 0; i < core->face_count; i++) {
        float s = es_v3_dot(core->planes[i].normal, n);
        if (s > *cosine) *cosine = s, face = i;
    }
    return face;
}

static bool holds_depth(const es_manifold* manifold, float separation, float tolerance)
{
    float deepest = 3e38f;
    for (uint32_t i = 0; i < manifold->count; i++) deepest = es_minf(deepest, manifold->points[i].separation);
    return deepest <= separation + tolerance;
}

/* Rounded cores apart. Within 2.5° of a face's normal that face is what is touched, unless the nearest points lie beside it. */
static uint32_t collide_apart(const es_core* a, const es_core* b, const es_nearest* nearest, float margin, es_manifold* manifold)
{
    float cosine_a, cosine_b, separation = (float)nearest->distance - a->radius - b->radius, tolerance = 0.01f * (a->radius + b->radius);
    uint32_t face_a = es_core_aligned_face(a, nearest->normal, &cosine_a), face_b = es_core_aligned_face(b, es_v3_neg(nearest->normal), &cosine_b);
    if (cosine_a > 0.999f && cosine_a >= cosine_b && es_core_face_patch(a, b, face_a, false, margin, manifold) &&
        holds_depth(manifold, separation, tolerance))
        return 1;
    if (cosine_b > 0.999f && es_core_face_patch(b, a, face_b, true, margin, manifold) && holds_depth(manifold, separation, tolerance)) return 1;
    uint32_t id = 1u << 29 | (uint32_t)nearest->a[0] << 8 | nearest->b[0];
    return es_manifold_single(manifold, nearest->normal, es_v3_mad(nearest->on_a, nearest->normal, a->radius + 0.5f * separation), separation, id);
}

static uint32_t collide_deep(const es_core* a, const es_core* b, float margin, es_manifold* manifold)
{
    float limit = margin + a->radius + b->radius;
    es_core_axis face_a = es_core_best_face(a, b, limit);
    if (face_a.separation > limit) return 0;
    es_core_axis face_b = es_core_best_face(b, a, limit);
    if (face_b.separation > limit) return 0;
    es_core_axis edges = best_edges(a, b, limit);
    if (edges.separation > limit) return 0;
    /* as for boxes: faces before edges, the first's before the second's, unless clearly better */
    es_vec3 reach = es_v3_sub(a->vertices[0], a->centre);
    const float slack = 1e-3f * es_v3_length(reach);
    bool use_b = b->face_count && face_b.separation > face_a.separation + 0.05f * es_absf(face_a.separation) + slack;
    float best = use_b ? face_b.separation : face_a.separation;
    if (edges.separation > best + 0.05f * es_absf(best) + slack) return edge_point(a, b, &edges, manifold);
    const es_core *reference = use_b ? b : a, *other = use_b ? a : b;
    uint32_t face = use_b ? face_b.a : face_a.a, count = es_core_face_patch(reference, other, face, use_b, margin, manifold);
    float separation = best - a->radius - b->radius;
    if (best > 0 || (count && holds_depth(manifold, separation, slack - 0.05f * best))) return count;
    /* The deepest corner lies beside the face, because an edge's axis is a little better after all. */
    if (edges.separation >= best) return edge_point(a, b, &edges, manifold);
    es_vec3 n = reference->planes[face].normal;
    uint32_t corner = es_core_support(other, es_v3_neg(n));
    es_vec3 point = es_v3_mad(other->vertices[corner], n, -other->radius - 0.5f * separation);
    return es_manifold_single(manifold, use_b ? es_v3_neg(n) : n, point, separation, 1u << 28 | face << 8 | corner);
}

uint32_t es_collide_cores(const es_rigid_shape* shape_a, const es_pose* pose_a, const es_rigid_shape* shape_b, const es_pose* pose_b, float margin,
    es_manifold* manifold)
{
    es_core a, b;
    es_mat3 m;
    es_vec3 position;
    es_relative_pose(pose_a, pose_b, &m, &position);
    es_core_of(shape_a, &a);
    es_core_place(shape_b, &m, position, &b);
    uint32_t count;
    *manifold = (es_manifold){.key = 0};
    es_nearest nearest = {0};
    float rounding = a.radius + b.radius;
    if (rounding > 0) es_nearest_points(a.vertices, a.vertex_count, b.vertices, b.vertex_count, &nearest);
    if (nearest.distance > margin + rounding) return 0;
    if (nearest.distance > 1e-3f * rounding)
        count = collide_apart(&a, &b, &nearest, margin, manifold);
    else
        count = collide_deep(&a, &b, margin, manifold);
    if (!count) return 0;
    es_mat3 ma = es_mat3_from_quat(pose_a->rotation);
    manifold->normal = es_v3_normalize(es_mat3_mul(&ma, manifold->normal), es_v3(0, 1, 0));
    for (uint32_t i = 0; i < manifold->count; i++) manifold->points[i].point = es_v3_add(pose_a->position, es_mat3_mul(&ma, manifold->points[i].point));
    return 1;
}
