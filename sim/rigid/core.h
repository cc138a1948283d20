/* The core of a convex shape as points, faces and edges in some frame, and polygons cut by planes: what the general narrow phase works on. */
#ifndef EARTHSHINE_SIM_RIGID_CORE_H
#define EARTHSHINE_SIM_RIGID_CORE_H

#include "sim/rigid/manifold.h"

typedef struct es_core {
    uint32_t vertex_count, face_count, half_edge_count; /* a segment: two points, two half edges, no face; a point: one */
    const es_vec3* vertices;
    const es_plane* planes;
    const uint16_t* first;
    const es_half_edge* half_edges;
    es_vec3 centre;
    float radius;
    es_vec3 own_vertices[ES_HULL_VERTICES];
    es_plane own_planes[ES_HULL_FACES];
} es_core;

/* In the body's own frame: nothing is copied but a segment's or point's ends. */
void es_core_of(const es_rigid_shape* shape, es_core* core);
/* Turned by m, then moved. */
void es_core_place(const es_rigid_shape* shape, const es_mat3* m, es_vec3 position, es_core* core);
/* b's pose in a's frame. */
void es_relative_pose(const es_pose* a, const es_pose* b, es_mat3* m, es_vec3* position);

/* A polygon (or segment) being cut. `label` names the side that begins at the corner. */
typedef struct es_clip_corner { es_vec3 p; uint32_t label; } es_clip_corner;
enum { ES_CLIP_CORNERS = 2 * ES_HULL_VERTICES + 8 };
/* The part with normal · p <= offset; `label` for the new side. A segment (count 2) stays one. */
uint32_t es_clip_polygon(const es_clip_corner* in, uint32_t count, es_vec3 normal, float offset, uint32_t label, es_clip_corner* out);
/* The face of `core` that is outermost along -n and most opposed to n, as a polygon, labelled by its half edges, or the segment, or the point. */
uint32_t es_incident_polygon(const es_core* core, es_vec3 n, es_clip_corner* out);

static inline uint32_t es_core_support(const es_core* core, es_vec3 d)
{
    uint32_t best = 0;
    float most = es_v3_dot(core->vertices[0], d);
    for (uint32_t i = 1; i < core->vertex_count; i++) {
        float s = es_v3_dot(core->vertices[i], d);
        if (s > most) most = s, best = i;
    }
    return best;
}

/* An axis that separates two cores, or does so best; a, b: which face (a) or half edges. */
typedef struct es_core_axis { float separation; uint32_t a, b; es_vec3 normal; } es_core_axis;
/* Over the faces of one; stops at the first that separates by more than `limit`. -3e38 when it has none. */
es_core_axis es_core_best_face(const es_core* faces, const es_core* other, float limit);
/* The face whose normal is nearest to n. */
uint32_t es_core_aligned_face(const es_core* core, es_vec3 n, float* cosine);
/* The face of `reference` against the other's most opposed one. `flipped`: the reference is the second shape. */
uint32_t es_core_face_patch(const es_core* reference, const es_core* other, uint32_t face, bool flipped, float margin, es_manifold* manifold);

/* Shares of the ways p0 p1 and q0 q1 at which they are nearest to each other (Ericson 5.1.9). */
void es_nearest_of_segments(es_vec3 p0, es_vec3 p1, es_vec3 q0, es_vec3 q1, float* s, float* t);

#endif
