/* Distances over a mesh (sim.h: es_world_geodesic), and fields of them that are kept. */
#ifndef EARTHSHINE_SIM_GEODESIC_H
#define EARTHSHINE_SIM_GEODESIC_H

#include "sim/edits/surface.h"

/* What a field was computed from. No padding: compared as bytes. */
typedef struct es_geodesic_key {
    uint64_t mesh_revision, rest_revision;
    double metric[6];         /* of the node's axes: lengths² are xx yy zz xy yz zx */
    uint32_t mesh, triangle;
    float u, v, max_distance;
    uint32_t method;
} es_geodesic_key;

typedef struct es_geodesic_field {
    float* distances;         /* per vertex */
    size_t capacity;
    bool valid;
    es_geodesic_key key;
} es_geodesic_field;

/* From a surface anchor that there is, out to `radius` and to every corner of the triangles that reach into that; 0: everywhere. *changed is set when it was computed anew;
 * false after es_fail. */
bool es_geodesic_field_refresh(es_world* world, es_surfaces* surfaces, es_geodesic_field* field, const es_anchor* anchor, float radius, bool* changed);
void es_geodesic_field_free(es_context* context, es_geodesic_field* field);

/* distances: per vertex of the surface's mesh; scratch comes from the context. max_distance: 0 or less: everywhere. whole_triangles, of the front: on to every corner of the
 * triangles that reach into that. False after es_fail. */
bool es_geodesic_compute(es_context* context, const es_surface* surface, const es_geodesic_key* key, bool whole_triangles, float* distances);

/* For the kernel: points [begin, end) of `list` get in `results` the least distance that the corners round them allow. Points are records of x y z and distance;
 * edges lie in 1e-12 … 4, distances in 0 … 1e6, or are ES_GEODESIC_FAR where there is none yet. */
#define ES_GEODESIC_FAR 1e9f
typedef struct es_geodesic_job {
    const float* points;
    const uint32_t *first_row, *rows;
    const uint32_t* list;
    float* results;
} es_geodesic_job;

#endif
