/* Procedural shapes: triangles collected in one array, then made a mesh.
 *
 * Every builder appends to the shape. Windings are counter-clockwise seen from the normals' side. Points that meet (seams,
 * poles, rims) are computed from the same numbers, so closed surfaces are closed bit for bit. */
#ifndef EARTHSHINE_SIM_SHAPES_H
#define EARTHSHINE_SIM_SHAPES_H

#include "sim/world.h"

typedef struct es_shape {
    es_context* context;
    float *positions, *normals;  /* 3 per vertex */
    uint32_t* indices;
    size_t vertex_count, triangle_count;
    size_t position_capacity, normal_capacity, index_capacity;
    bool keep_degenerate;        /* triangles with two equal corners (at poles) are left out unless this is set */
    bool failed;                 /* memory ran out; what follows does nothing */
    es_result* stop;             /* NULL, or what several shapes share: the first to fail writes its result there and stops all */
} es_shape;

es_shape es_shape_begin(es_context* context);
void es_shape_free(es_shape* shape);
/* Adds the shape as a mesh and frees it. */
es_result es_shape_add_mesh(es_shape* shape, es_world* world, const char* name, es_mesh* mesh);

uint32_t es_shape_vertex(es_shape* shape, es_vec3 position, es_vec3 normal);
/* Turned round when needed so that its front agrees with the vertices' normals. */
void es_shape_triangle(es_shape* shape, uint32_t a, uint32_t b, uint32_t c);
/* As it is, for surfaces whose normals are smoothed over edges so sharp that these cannot say which side is the front. */
void es_shape_wound_triangle(es_shape* shape, uint32_t a, uint32_t b, uint32_t c);
/* A flat quadrilateral with its own four vertices. */
void es_shape_quad(es_shape* shape, es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 d, es_vec3 normal);
/* A flat triangle with its own three vertices. */
void es_shape_facet(es_shape* shape, es_vec3 a, es_vec3 b, es_vec3 c, es_vec3 normal);

/* Position and normal at (u, v) in [0, 1]². */
typedef void (*es_shape_surface)(const void* parameters, float u, float v, es_vec3* position, es_vec3* normal);
/* nu × nv quadrilaterals; a closed direction evaluates 1 as 0. */
void es_shape_patch(es_shape* shape, es_shape_surface surface, const void* parameters, uint32_t nu, uint32_t nv, bool closed_u, bool closed_v);

void es_shape_box(es_shape* shape, es_vec3 low, es_vec3 high);
/* A grid of nu × nv quadrilaterals from `origin`. */
void es_shape_plane(es_shape* shape, es_vec3 origin, es_vec3 du, es_vec3 dv, es_vec3 normal, uint32_t nu, uint32_t nv);
void es_shape_sphere(es_shape* shape, es_vec3 centre, float radius, uint32_t nu, uint32_t nv);
/* Around the y axis turned by `tilt` about x. */
void es_shape_torus(es_shape* shape, es_vec3 centre, float radius, float tube, float tilt, uint32_t nu, uint32_t nv);
/* With its two caps; axis y. */
void es_shape_cylinder(es_shape* shape, es_vec3 base, float radius, float height, uint32_t n);
/* A (p, q) torus knot around the y axis: the curve r = radius (2 + cos qφ) / 3, y = radius sin qφ / 3 in a tube. */
void es_shape_torus_knot(es_shape* shape, es_vec3 centre, uint32_t p, uint32_t q, float radius, float tube, uint32_t along, uint32_t around);
/* A profile of (radius, height) turned about the y axis through `base`; each profile segment has its own flat-sided normals.
 * Going up the profile, outside is to the right. */
void es_shape_lathe(es_shape* shape, es_vec3 base, const es_vec2* profile, uint32_t count, uint32_t n);
/* The same with the profile's corners rounded by a spline of `between` steps from point to point (256 points in all at the most), and normals as smooth. */
void es_shape_smooth_lathe(es_shape* shape, es_vec3 base, const es_vec2* profile, uint32_t count, uint32_t between, uint32_t n);

#endif
