/* A bounding volume hierarchy over everything visible in a world, for rays.
 *
 * Eight children a node, built by the surface area heuristic, refit when only vertices or transforms moved. Triangles are stored in
 * world space; the test of a ray with a triangle is watertight (Woop, Benthin and Wald 2013): a ray through a shared edge or vertex
 * hits at least one of its triangles. Both faces are hit; what a back face means is for the caller.
 *
 * The same rays give the same hits, bit for bit, on every instruction set and for any number of threads. Where two triangles are hit
 * at the same distance the lower primitive wins; of overlapping triangles in one plane, whose distances differ by rounding only, always the
 * same one.
 */
#ifndef EARTHSHINE_GI_REFERENCE_BVH_H
#define EARTHSHINE_GI_REFERENCE_BVH_H

#include "gi/gi.h"
#include "platform/maths.h"

#define ES_NO_PRIMITIVE 0xffffffffu

/* Points origin + t direction with min < t < max. The direction need not be unit but must be finite and not zero; max may be infinite. */
typedef struct es_ray { float origin[3], min, direction[3], max; } es_ray;

/* primitive ES_NO_PRIMITIVE: nothing was hit and t is the ray's max. The point is (1 - u - v) a + u b + v c of the triangle. */
typedef struct es_hit { float t, u, v; uint32_t primitive; } es_hit;

typedef struct es_bvh_primitive { uint32_t instance, triangle; } es_bvh_primitive; /* index into the draw list; triangle of its mesh */

typedef struct es_bvh es_bvh; /* its inside is in gi/reference/bvh_nodes.h */

es_result es_bvh_create(es_context* context, es_bvh** bvh);
void es_bvh_destroy(es_bvh* bvh);
/* From nothing, or again. The list is not kept. An empty list gives a hierarchy that nothing hits. */
es_result es_bvh_build(es_bvh* bvh, const es_draw_list* list);
/* The same instances, meshes and triangles, moved. WRONG_STATE when the list has others. */
es_result es_bvh_refit(es_bvh* bvh, const es_draw_list* list);
/* Build when the list has other triangles than the hierarchy or when refitting has made it `es_bvh_cost` 1.5 times what it was
 * at the last build; else refit when something moved (by the meshes' revisions and the transforms); else nothing. */
es_result es_bvh_update(es_bvh* bvh, const es_draw_list* list);

uint32_t es_bvh_primitive_count(const es_bvh* bvh);
/* es_hit.primitive is an index here: the draw list's triangles in order, instance by instance */
const es_bvh_primitive* es_bvh_primitives(const es_bvh* bvh);
/* Corners in world space. */
void es_bvh_triangle(const es_bvh* bvh, uint32_t primitive, es_vec3 corners[3]);
/* Expected cost of a random ray that meets the root's box: sum over nodes of area, and of leaves of area × triangles, over the root's area. */
float es_bvh_cost(const es_bvh* bvh);
void es_bvh_bounds(const es_bvh* bvh, es_vec3* minimum, es_vec3* maximum); /* empty: minimum > maximum */

typedef enum es_ray_kind {
    ES_RAYS_SINGLE,     /* each by itself: what random directions want */
    ES_RAYS_COHERENT    /* runs of eight neighbours go together: from one pixel block, or towards one light */
} es_ray_kind;

/* On the calling thread, so that a task of es_parallel_for may use them. The results do not depend on `kind`. */
void es_bvh_closest(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, es_hit* hits);
/* blocked[i] is 1 when anything is hit, else 0. */
void es_bvh_any(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, uint8_t* blocked);

/* Where a ray leaves a surface: the point, moved along the geometric normal (unit, on the side the ray goes to) far enough that rounding
 * of the point and of the hit test cannot bring the surface itself back, and no further: a few units in the last place of the largest
 * coordinate (after Wächter and Binder 2019). So rays need no minimum that would depend on the scene's size. */
es_vec3 es_offset_origin(es_vec3 point, es_vec3 geometric_normal);

#endif
