/* Contact points on their way into a manifold. */
#ifndef EARTHSHINE_SIM_RIGID_MANIFOLD_H
#define EARTHSHINE_SIM_RIGID_MANIFOLD_H

#include "sim/rigid/collision.h"
#include "sim/rigid/frame.h"

/* A point of contact before it is chosen. */
typedef struct es_contact_point { es_vec3 point; float separation; uint32_t id; } es_contact_point;

/* Keeps at most four of the candidates: the deepest, the one farthest from it, the one that makes the largest triangle with the two, and the one
 * that adds most area on the other side of it. They are written in the order of their ids, made different where they were equal. */
void es_manifold_choose(es_manifold* manifold, const es_contact_point* candidates, uint32_t count);

/* One manifold with one point. */
static inline uint32_t es_manifold_single(es_manifold* manifold, es_vec3 normal, es_vec3 point, float separation, uint32_t id)
{
    *manifold = (es_manifold){.normal = normal, .count = 1, .points = {{point, separation, id, 0, {0, 0}}}};
    return 1;
}

/* The pairs. Normals go from the first to the second; what they return is the number of manifolds, 0 or 1. Poses are matrices here,
 * already with the box's own rotation. */
typedef struct es_placed_box { es_mat3 axes; es_vec3 centre, half; } es_placed_box;
uint32_t es_collide_boxes(const es_placed_box* a, const es_placed_box* b, float margin, es_manifold* manifold);

/* A polyhedron (box, hull) against a polyhedron or capsule. */
uint32_t es_collide_cores(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float margin,
    es_manifold* manifold);
/* A mesh against a convex shape: up to `capacity` manifolds. */
uint32_t es_collide_mesh(const es_rigid_shape* mesh, const es_pose* pose_mesh, const es_rigid_shape* b, const es_pose* pose_b, float margin,
    es_manifold* manifolds, uint32_t capacity);

static inline es_placed_box es_place_box(const es_rigid_shape* shape, const es_pose* pose)
{
    es_placed_box box = {es_mat3_from_quat(pose->rotation), pose->position, shape->half_extents};
    if (shape->centre.x != 0 || shape->centre.y != 0 || shape->centre.z != 0) box.centre = es_v3_add(box.centre, es_mat3_mul(&box.axes, shape->centre));
    if (shape->rotation.w != 1) {
        es_mat3 own = es_mat3_from_quat(shape->rotation), whole = box.axes;
        box.axes = (es_mat3){es_mat3_mul(&whole, own.x), es_mat3_mul(&whole, own.y), es_mat3_mul(&whole, own.z)};
    }
    return box;
}

#endif
