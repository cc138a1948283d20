/* Convex polyhedra: vertices, faces with their planes, half edges.
 *
 * Faces are flat polygons: what lies in one plane was merged. Half edges run counter-clockwise around their face seen from outside; the twin
 * of half edge k is k ^ 1. Limits keep every index in a byte. */
#ifndef EARTHSHINE_SIM_RIGID_HULL_H
#define EARTHSHINE_SIM_RIGID_HULL_H

#include "platform/context.h"

enum { ES_HULL_VERTICES = 64, ES_HULL_EDGES = 3 * ES_HULL_VERTICES - 6, ES_HULL_FACES = 2 * ES_HULL_VERTICES - 4 };

typedef struct es_plane { es_vec3 normal; float offset; /* normal · x = offset on it */ } es_plane;
typedef struct es_half_edge { uint8_t origin, face; uint16_t next; } es_half_edge;

typedef struct es_hull {
    uint32_t vertex_count, face_count, half_edge_count;
    es_vec3* vertices;
    es_plane* planes;        /* per face, normals unit and outwards */
    uint16_t* first;         /* per face: one of its half edges */
    es_half_edge* half_edges;
    es_vec3 centre;          /* a point inside: the vertices' mean */
} es_hull;

/* The hull of points (3 floats each, `stride` floats apart), each times `scale`. Points that reach out less than the tolerance, 1e-5 of
 * the largest extent, are left out, so that faces are well shaped; points may repeat. Of hulls with more than ES_HULL_VERTICES
 * corners those that reach out farthest are kept. Points that span no volume (all within the tolerance of a plane, line or
 * point) are refused: INVALID_ARGUMENT, the message beginning with `what`. Quickhull: Barber, Dobkin, Huhdanpaa 1996; merging of
 * faces after Gregorius, "Implementing Quickhull", GDC 2014. */
es_result es_hull_build(es_context* context, const float* points, uint32_t count, uint32_t stride, es_vec3 scale, const char* what, es_hull* hull);
/* Zeroed memory of the right sizes; false after es_fail. */
bool es_hull_allocate(es_context* context, uint32_t vertices, uint32_t faces, uint32_t half_edges, es_hull* hull);
/* A box about `centre` with axes turned by `rotation`. */
es_result es_hull_box(es_context* context, es_vec3 centre, es_quat rotation, es_vec3 half_extents, es_hull* hull);
/* Moves it: rotation, then position. */
void es_hull_place(es_hull* hull, es_vec3 position, es_quat rotation);
void es_hull_free(es_context* context, es_hull* hull);

#endif
