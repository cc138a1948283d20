/* Cores in frames, polygons cut by planes, segments. */
#include "sim/rigid/core.h"

static const es_half_edge segment_edges[2] = {{0, 0, 1}, {1, 0, 0}};

void es_core_of(const es_rigid_shape* shape, es_core* core)
{
    core->radius = shape->radius;
    core->centre = shape->centre;
    core->face_count = core->half_edge_count = 0;
    core->half_edges = segment_edges;
    core->planes = core->own_planes;
    core->vertices = core->own_vertices;
    core->first = NULL;
    if (shape->type == ES_SHAPE_SPHERE) {
        core->vertex_count = 1;
        core->own_vertices[0] = shape->centre;
    } else if (shape->type == ES_SHAPE_CAPSULE) {
        core->vertex_count = core->half_edge_count = 2;
        core->own_vertices[0] = shape->segment[0];
        core->own_vertices[1] = shape->segment[1];
    } else {
        core->vertex_count = shape->hull.vertex_count;
        core->face_count = shape->hull.face_count;
        core->half_edge_count = shape->hull.half_edge_count;
        core->vertices = shape->hull.vertices;
        core->planes = shape->hull.planes;
        core->first = shape->hull.first;
        core->half_edges = shape->hull.half_edges;
    }
}

void es_core_place(const es_rigid_shape* shape, const es_mat3* m, es_vec3 position, es_core* core)
{
    es_core_of(shape, core);
    for (uint32_t i = 0; i < core->vertex_count; i++) core->own_vertices[i] = es_v3_add(position, es_mat3_mul(m, core->vertices[i]));
    for (uint32_t i = 0; i < core->face_count; i++) {
        es_vec3 n = es_mat3_mul(m, core->planes[i].normal);
        core->own_planes[i] = (es_plane){n, core->planes[i].offset + es_v3_dot(n, position)};
    }
    core->centre = es_v3_add(position, es_mat3_mul(m, core->centre));
    core->vertices = core->own_vertices;
    core->planes = core->own_planes;
}

void es_relative_pose(const es_pose* a, const es_pose* b, es_mat3* m, es_vec3* position)
{
    es_mat3 ma = es_mat3_from_quat(a->rotation), mb = es_mat3_from_quat(b->rotation);
    *m = (es_mat3){es_mat3_into(&ma, mb.x), es_mat3_into(&ma, mb.y), es_mat3_into(&ma, mb.z)};
    *position = es_mat3_into(&ma, es_v3_sub(b->position, a->position));
}

uint32_t es_clip_polygon(const es_clip_corner* in, uint32_t count, es_vec3 normal, float offset, uint32_t label, es_clip_corner* out)
{
    uint32_t kept = 0, sides = count == 2 ? 1 : count;
    for (uint32_t i = 0; i < count && kept + 2 <= ES_CLIP_CORNERS; i++) {
        const es_clip_corner *p = &in[i], *q = &in[i + 1 < count ? i + 1 : 0];
        float dp = es_v3_dot(normal, p->p) - offset, dq = es_v3_dot(normal, q->p) - offset;
        if (dp <= 0) out[kept++] = *p;
        if (i < sides && (dp <= 0) != (dq <= 0)) out[kept++] = (es_clip_corner){es_v3_mix(p->p, q->p, dp / (dp - dq)), dp <= 0 ? label : p->label};
    }
    return kept;
}

uint32_t es_incident_polygon(const es_core* core, es_vec3 n, es_clip_corner* out)
{
    if (core->face_count == 0) {
        for (uint32_t i = 0; i < core->vertex_count; i++) out[i] = (es_clip_corner){core->vertices[i], i};
        return core->vertex_count;
    }
    /* of the faces at the outermost corner, which must be on it */
    uint32_t corner = es_core_support(core, es_v3_neg(n)), face = 0, count = 0;
    float least = 2;
    for (uint32_t i = 0; i < core->half_edge_count; i++) {
        if (core->half_edges[i].origin != corner) continue;
        float s = es_v3_dot(core->planes[core->half_edges[i].face].normal, n);
        if (s < least) least = s, face = core->half_edges[i].face;
    }
    uint32_t edge = core->first[face];
    do {
        out[count++] = (es_clip_corner){core->vertices[core->half_edges[edge].origin], edge};
        edge = core->half_edges[edge].next;
    } while (edge != core->first[face]);
    return count;
}

void es_nearest_of_segments(es_vec3 p0, es_vec3 p1, es_vec3 q0, es_vec3 q1, float* s, float* t)
{
    es_vec3 d = es_v3_sub(p1, p0), e = es_v3_sub(q1, q0), r = es_v3_sub(p0, q0);
    float dd = es_v3_dot(d, d), ee = es_v3_dot(e, e), er = es_v3_dot(e, r), dr = es_v3_dot(d, r), de = es_v3_dot(d, e);
    float denominator = dd * ee - de * de;
    *s = denominator > 1e-6f * dd * ee && dd > 0 ? es_clampf((de * er - dr * ee) / denominator, 0, 1) : 0.0f;
    *t = ee > 0 ? (de * *s + er) / ee : 0;
    if (*t < 0 || *t > 1 || !(ee > 0)) {
        *t = es_clampf(*t, 0, 1);
        *s = dd > 0 ? es_clampf((de * *t - dr) / dd, 0, 1) : 0;
    }
}
