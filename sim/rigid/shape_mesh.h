/* Triangles of static geometry, prepared for contact: welded, with a tree, neighbours across edges, and facets.
 *
 * A facet is a connected set of triangles in one plane: contact is the same wherever on it, and its inner edges are not there. */
#ifndef EARTHSHINE_SIM_RIGID_SHAPE_MESH_H
#define EARTHSHINE_SIM_RIGID_SHAPE_MESH_H

#include "sim/world.h"

/* What lies across an edge, seen from the triangle's front. A back side turns ridges to valleys and the other way round. */
enum { ES_EDGE_BORDER, ES_EDGE_FLAT, ES_EDGE_RIDGE, ES_EDGE_VALLEY };

typedef struct es_mesh_triangle {
    uint32_t vertex[3];
    uint32_t edge[3];        /* numbers of the undirected edges from vertex[k] to vertex[k + 1] */
    es_vec3 normal;          /* unit, counter-clockwise */
    float offset;            /* normal · x = offset */
    es_vec3 across[3];       /* per edge: the neighbour's normal, turned to agree with this one's winding; zero at borders */
    uint8_t kind[3];         /* per edge */
    uint32_t facet;          /* the lowest triangle of it */
    uint32_t source;         /* its number in the mesh it came from */
} es_mesh_triangle;

/* Depth first: a leaf holds `count` > 0 triangles from `first` on; an inner node's near child follows it, its far one is `first`. */
typedef struct es_mesh_node { es_vec3 low; uint32_t first; es_vec3 high; uint32_t count; } es_mesh_node;

typedef struct es_shape_mesh {
    uint32_t vertex_count, triangle_count, node_count;
    es_vec3* vertices;
    es_mesh_triangle* triangles;
    es_mesh_node* nodes;
    size_t vertex_bytes, triangle_bytes, node_bytes;
} es_shape_mesh;

/* The mesh's triangles as they are now, scaled, turned and moved; those without area are left out. Refused when none is left. */
es_result es_shape_mesh_make(es_world* world, es_mesh mesh, es_vec3 scale, es_vec3 position, es_quat rotation, const char* what, es_shape_mesh** made);
void es_shape_mesh_free(es_context* context, es_shape_mesh* mesh); /* NULL allowed */

/* Depth of the tree: halves by count at the latest, so 2^26 triangles make 26 levels above their leaves. */
enum { ES_MESH_STACK = 64 };

#endif
