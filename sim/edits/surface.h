/* A mesh's triangles as edits ask for them: which lie near a place, which meet at a point. Made when first asked for; what follows from the triangles
 * alone is kept while these stay, what follows from where vertices are while they do not move. */
#ifndef EARTHSHINE_SIM_EDIT_SURFACE_H
#define EARTHSHINE_SIM_EDIT_SURFACE_H

#include "sim/world.h"

enum { ES_SURFACE_FANS = 1, ES_SURFACE_TREE = 2, ES_SURFACES_KEPT = 16, ES_SURFACE_ROW = 8, ES_SURFACE_LEAF = 4 };

/* Points are vertices that were at one place when the mesh was made (which the seams of texture coordinates and hard edges part), or that are one particle of a cloth. The corners of the triangles
 * that meet at a point are in rows of eight, those after it in the triangle and those after these; what a row has fewer is the point itself. Triangles of
 * which two corners are one point are left out. */
typedef struct es_surface_fans {
    uint32_t vertex_count, point_count;
    uint32_t* point_of;       /* per vertex */
    uint32_t* vertex_of;      /* per point: the first of its vertices */
    uint32_t* first_row;      /* per point, and one more */
    uint32_t* rows;           /* 16 each */
    uint32_t* first_neighbour; /* per point, and one more */
    uint32_t* neighbours;     /* the points at the other ends of its edges, each once */
    size_t row_count, neighbour_count;
} es_surface_fans;

/* A perfect binary tree of boxes over triangles in Morton order, ES_SURFACE_LEAF to a leaf; node k has the children 2 k and 2 k + 1, the root is 1. */
typedef struct es_surface_tree {
    uint32_t triangle_count, leaf_count;
    uint32_t* order;          /* leaf_count × ES_SURFACE_LEAF, past the last triangle UINT32_MAX */
    float* boxes;             /* 6 per node: least and greatest x y z; of nothing: least above greatest */
    uint64_t revision;        /* of the vertices that the boxes are round */
} es_surface_tree;

typedef struct es_surface {
    uint32_t mesh;            /* handle */
    uint64_t rest_revision;   /* of the triangles */
    uint64_t used;            /* a count of calls: the least is given up first */
    uint32_t parts;           /* that have been made */
    const es_raster_mesh* raster;
    es_surface_fans fans;
    es_surface_tree tree;
} es_surface;

typedef struct es_surfaces { es_surface kept[ES_SURFACES_KEPT]; uint64_t calls; } es_surfaces;

/* With the parts asked for, present; valid until the next call, or until the world changes. NULL after es_fail. */
const es_surface* es_surface_of(const es_world* world, es_surfaces* surfaces, const es_mesh_object* mesh, uint32_t parts);
void es_surfaces_free(es_context* context, es_surfaces* surfaces);

/* The nearest place to one in the mesh's axes, of equally near ones that of the triangle with the lowest number; false when there are no triangles. */
bool es_surface_closest(const es_surface* surface, const float place[3], uint32_t* triangle, float* u, float* v);
/* The first triangle that origin + t direction meets for t in [0, *t], from either side; mesh's axes. *t becomes that of the hit. */
bool es_surface_hit(const es_surface* surface, const double origin[3], const double direction[3], double* t, uint32_t* triangle, float* u, float* v);
/* Does origin + t direction come into the box for a t in [0, t]? */
bool es_box_met(const es_vec3* low, const es_vec3* high, const double origin[3], const double direction[3], double t);

#endif
