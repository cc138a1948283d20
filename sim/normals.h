/* Smooth normals of a mesh whose vertices moved.
 *
 * A vertex's normal is the sum of the area-weighted normals of the triangles that meet there, in the triangles' order, made
 * unit: first every triangle's cross product, then every vertex's sum, so that each number has one writer and the result
 * does not depend on the number of threads. */
#ifndef EARTHSHINE_SIM_NORMALS_H
#define EARTHSHINE_SIM_NORMALS_H

#include "platform/context.h"
#include "platform/platform.h"

/* Which triangles meet at which vertex: rows of eight triangle numbers, one per vertex of a block of eight. Block b has the
 * rows first_row[b] … first_row[b + 1] - 1; what a vertex has fewer of than its block is filled with the number
 * triangle_count, whose normal is zero. */
typedef struct es_vertex_fans {
    uint32_t vertex_count, triangle_count;
    uint32_t* first_row;   /* blocks + 1 */
    uint32_t* rows;        /* 8 each */
    float* faces;          /* scratch: 4 floats per triangle, and zeros after them */
    size_t row_count;
} es_vertex_fans;

/* `welded`: per vertex the first vertex of those that share its normal (itself, when none does); NULL: no two do. Indices are
 * below vertex_count, 3 × triangle_count and 4 × vertex_count below 2^31. False after es_fail. */
bool es_vertex_fans_make(es_context* context, const uint32_t* indices, uint32_t triangle_count, uint32_t vertex_count, const uint32_t* welded, es_vertex_fans* fans);
void es_vertex_fans_free(es_context* context, es_vertex_fans* fans);

/* For `welded`: two vertices share a normal when positions and normals (4 floats each) are equal bit for bit, as along the seams of texture
 * coordinates; not where the surface has a hard edge. False after es_fail. */
bool es_weld_vertices(es_context* context, const float* positions, const float* normals, uint32_t vertex_count, uint32_t* welded);

/* positions and normals: 4 floats per vertex, padded to a multiple of eight vertices as es_raster_mesh has them; `indices` are those the
 * fans were made of. Positions lie within ±1e9; low … high is a box round them: lengths are scaled by a power of two to its size, so that a
 * mesh has the same normals at every scale. A vertex at which no triangle has an area gets +y. Runs on the context's threads, and writes
 * fans->faces, so one call per mesh at a time. */
void es_normals_recompute(es_context* context, const es_vertex_fans* fans, const uint32_t* indices, const float* positions, es_vec3 low, es_vec3 high, float* normals);

#endif
