/* Shapes of rigid bodies and how they touch: the door between the solver (bodies, contacts, joints) and the geometry.
 *
 * A shape is made once from its description; what follows are functions of shapes and poses alone. Nothing here keeps anything
 * between calls, so results do not depend on what was asked before. Every function may be called from any thread.
 *
 * Places: both poses of a pair are given in one frame of the caller's choice with the world's axes (for precision far from zero: one
 * whose origin is near, such as body A's), and what comes out is in the same frame. A pose is the body's; where the shape sits in its
 * body is part of the shape.
 *
 * Every convex shape is a core (point, segment or polyhedron) and a radius around it. Numbers are metres; a shape reaches at most
 * ES_SHAPE_EXTENT from its body's origin.
 *
 *   shape.c          making: checks, bounds, support          mass.c      mass, centre, inertia
 *   hull.h           convex polyhedra                         hull_build.c  quickhull
 *   shape_mesh.h     static triangles with their tree
 *   collide*.c       manifolds                                distance.h  GJK
 *   time_of_impact.c conservative advancement                 shape_query.c  ray, closest point
 */
#ifndef EARTHSHINE_SIM_RIGID_COLLISION_H
#define EARTHSHINE_SIM_RIGID_COLLISION_H

#include "sim/rigid/hull.h"
#include "sim/world.h"

#define ES_SHAPE_EXTENT 1e5f   /* beyond, a float has no millimetres left */
#define ES_SHAPE_SMALLEST 1e-4f /* radius, half extent and the like at least */

typedef struct es_pose { es_vec3 position; es_quat rotation; } es_pose;

/* ---- shapes -------------------------------------------------------------------------------------------------------- */

typedef struct es_shape_mesh es_shape_mesh; /* sim/rigid/shape_mesh.h */

typedef struct es_rigid_shape {
    es_shape_type type;
    float radius;            /* around the core: the sphere's or capsule's, or a box's or hull's rounding */
    es_vec3 half_extents;    /* box: of the core, which is the box less its rounding */
    es_vec3 centre;          /* of the core, in the body's frame; mesh: of its bounds */
    es_quat rotation;        /* box: of its axes in the body's frame; identity otherwise (baked into what follows) */
    es_vec3 segment[2];      /* capsule: centres of its caps, in the body's frame */
    es_hull hull;            /* box, hull: the core, in the body's frame */
    es_shape_mesh* mesh;     /* mesh: in the body's frame */
    es_vec3 low, high;       /* bounds in the body's frame, radius included */
    float inner_radius;      /* of a sphere around `centre` that lies inside; mesh: 0 */
    float outer_radius;      /* of a sphere around the body's origin that holds all of it */
    float density, friction, restitution, rolling_resistance; /* resolved */
    bool sensor;
    uint32_t category, mask;
} es_rigid_shape;

/* The desc is copied and everything it points to is no longer needed. Failure (INVALID_ARGUMENT with what is wrong and what would be
 * accepted, STALE_HANDLE, OUT_OF_MEMORY) leaves a shape that may be freed. `what` names the owner in messages ("body 'crate'"). */
es_result es_rigid_shape_make(es_world* world, const es_shape_desc* desc, const char* what, es_rigid_shape* shape);
void es_rigid_shape_free(es_context* context, es_rigid_shape* shape); /* zeroed shapes allowed */

/* kg, m, kg m²: the mass in the body's frame, by the shape's density. Inertia is about the centre: xx yy zz xy xz yz, with
 * xx = integral of y² + z² and xy = minus the integral of x y. A box's or hull's rounding counts as if it were filled out to its bounds
 * in proportion (core scaled). Meshes have no mass: all zero. */
typedef struct es_mass { float mass; es_vec3 centre; float inertia[6]; } es_mass;
es_mass es_rigid_shape_mass(const es_rigid_shape* shape);
/* Of both together; the sum of none is all zero. */
es_mass es_mass_add(const es_mass* a, const es_mass* b);

/* Axis-aligned bounds at a pose, rounded outwards. */
void es_rigid_shape_bounds(const es_rigid_shape* shape, const es_pose* pose, es_vec3* low, es_vec3* high);

/* ---- contact -------------------------------------------------------------------------------------------------------- */

enum { ES_MANIFOLD_POINTS = 4, ES_MESH_MANIFOLDS = 8 };

typedef struct es_manifold_point {
    es_vec3 point;           /* midway between the two surfaces */
    float separation;        /* along the normal; negative: depth */
    uint32_t id;             /* which features meet: equal ids in successive steps are the same contact; different within a manifold */
    float normal_impulse, tangent_impulse[2]; /* the solver's; zero as they come */
} es_manifold_point;

typedef struct es_manifold {
    es_vec3 normal;          /* unit, from A to B */
    uint32_t key;            /* 0 for convex pairs; mesh: 1 + the lowest facet that takes part; different within a pair */
    uint32_t count;          /* 1 … 4 */
    es_manifold_point points[ES_MANIFOLD_POINTS];
} es_manifold;

/* Contact of two shapes. Points up to `margin` (>= 0) apart are reported (speculative contact). A convex pair gives at most one manifold; a
 * convex shape against a mesh up to min(capacity, ES_MESH_MANIFOLDS), the deepest ones, in the order of their keys; mesh against mesh
 * none. Returns how many. Triangles are solid on both sides: a shape is pushed to the side its centre is on. Shapes whose
 * centres coincide are separated along a fixed axis. (b, a) gives the same contact turned round, up to rounding.
 * Sources: Gregorius, "The Separating Axis Test between Convex Polyhedra", GDC 2013; Ericson, "Real-Time Collision Detection", ch. 4, 5. */
uint32_t es_rigid_collide(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float margin,
    es_manifold* manifolds, uint32_t capacity);

/* Distance between two convex shapes' surfaces, 0 when they overlap, and the nearest points. With a mesh: to the nearest triangle, which has
 * no inside. At most `limit` is looked for: beyond, `limit` is returned and the points are meaningless. */
float es_rigid_distance(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float limit,
    es_vec3* on_a, es_vec3* on_b);
bool es_rigid_overlap(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b);

/* ---- motion ----------------------------------------------------------------------------------------------------------- */

/* A body's way within a step: its centre of mass on a straight line, its rotation by the normalised mix of the two (nlerp). */
typedef struct es_sweep {
    es_vec3 local_centre;    /* of mass, in the body's frame */
    es_vec3 from, to;        /* where it is */
    es_quat rotation_from, rotation_to; /* on the same half of the sphere or not: the shorter way is taken */
} es_sweep;
es_pose es_sweep_pose(const es_sweep* sweep, float t);

/* The share of the way, 0 … 1, at which the shapes come within `target` metres (> 0) of each other, or 1 when they do not. Never later than
 * the true one; earlier by what `target` / 4 makes. 0 when they begin within it; such pairs are the manifold's.
 * Conservative advancement (Mirtich 1996; Coumans 2005): the distance over a bound of the speed at which it may close. */
float es_rigid_time_of_impact(const es_rigid_shape* a, const es_sweep* sweep_a, const es_rigid_shape* b, const es_sweep* sweep_b, float target);

/* ---- queries against one shape -------------------------------------------------------------------------------------------- */

typedef struct es_shape_hit { float distance; es_vec3 point, normal; uint32_t triangle; /* mesh: which, else 0 */ } es_shape_hit;
/* The first surface that a ray (unit direction) meets within [0, max]. A ray that begins inside a convex shape hits at distance 0
 * with its own reversed direction as the normal. Triangles are hit from both sides, the normal towards the ray's origin. */
bool es_rigid_shape_ray(const es_rigid_shape* shape, const es_pose* pose, es_vec3 origin, es_vec3 direction, float max, es_shape_hit* hit);
/* The surface's nearest point within max_distance; hit->distance is signed, negative inside a convex shape (then of any depth), and the
 * normal points out of it there. A mesh has no inside: the normal points towards `point`. False when farther. */
bool es_rigid_shape_closest(const es_rigid_shape* shape, const es_pose* pose, es_vec3 point, float max_distance, es_shape_hit* hit);

#endif
