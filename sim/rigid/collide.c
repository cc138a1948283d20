/* Which two shapes, and what meets them: the door of the narrow phase, and the pairs with a formula. */
#include "sim/rigid/collision.h"

#include "sim/rigid/core.h"
#include "sim/rigid/shape_query.h"

static es_vec3 placed(const es_pose* pose, es_vec3 p) { return es_v3_add(pose->position, es_quat_rotate(pose->rotation, p)); }

static void flip(es_manifold* manifolds, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) manifolds[i].normal = es_v3_neg(manifolds[i].normal);
}

static uint32_t collide_points(es_vec3 a, float radius_a, es_vec3 b, float radius_b, uint32_t id, float margin, es_manifold* manifold)
{
    es_vec3 d = es_v3_sub(b, a);
    float distance = es_v3_length(d), separation = distance - radius_a - radius_b;
    if (separation > margin) return 0;
    es_vec3 n = es_v3_normalize(d, es_v3(0, 1, 0));
    return es_manifold_single(manifold, n, es_v3_mad(a, n, radius_a + 0.5f * separation), separation, id);
}

/* A sphere against anything convex: the surface's nearest point to its centre. */
static uint32_t collide_with_sphere(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* sphere, const es_pose* pose_b, float margin,
    es_manifold* manifold)
{
    es_shape_hit hit;
    es_vec3 centre = placed(pose_b, sphere->centre);
    if (!es_rigid_shape_closest(a, pose_a, centre, margin + sphere->radius, &hit)) return 0;
    float separation = hit.distance - sphere->radius;
    return es_manifold_single(manifold, hit.normal, es_v3_mad(hit.point, hit.normal, 0.5f * separation), separation, 1);
}

/* Capsules side by side touch along a line: at both ends of where they overlap. */
static uint32_t collide_capsules(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float margin, es_manifold* manifold)
{
    es_vec3 p0 = placed(pose_a, a->segment[0]), p1 = placed(pose_a, a->segment[1]), q0 = placed(pose_b, b->segment[0]), q1 = placed(pose_b, b->segment[1]);
    es_vec3 d = es_v3_sub(p1, p0), e = es_v3_sub(q1, q0);
    float dd = es_v3_dot(d, d), ee = es_v3_dot(e, e), de = es_v3_dot(d, e);
    if (dd > 0 && ee > 0 && de * de > 0.9975f * dd * ee) { /* within three degrees */
        float from = es_v3_dot(es_v3_sub(q0, p0), d) / dd, to = es_v3_dot(es_v3_sub(q1, p0), d) / dd;
        float low = es_clampf(es_minf(from, to), 0, 1), high = es_clampf(es_maxf(from, to), 0, 1);
        if (high - low > 1e-3f) {
            es_vec3 on[2], over[2], across = {0, 0, 0};
            for (int k = 0; k < 2; k++) {
                float x = k ? high : low, y = (x - from) / (to - from);
                on[k] = es_v3_mad(p0, d, x);
                over[k] = es_v3_mad(q0, e, es_clampf(y, 0, 1));
                across = es_v3_add(across, es_v3_sub(over[k], on[k]));
            }
            /* perpendicular to the first one's axis */
            across = es_v3_mad(across, d, -es_v3_dot(across, d) / dd);
            es_vec3 u, v;
            es_orthonormal_basis(es_v3_normalize(d, es_v3(0, 1, 0)), &u, &v);
            es_vec3 n = es_v3_normalize(across, u);
            es_contact_point points[2];
            uint32_t count = 0;
            for (int k = 0; k < 2; k++) {
                float separation = es_v3_dot(es_v3_sub(over[k], on[k]), n) - a->radius - b->radius;
                uint32_t id = 2 + (uint32_t)k;
                if (separation <= margin) points[count++] = (es_contact_point){es_v3_mad(on[k], n, a->radius + 0.5f * separation), separation, id};
            }
            manifold->normal = n;
            manifold->key = 0;
            es_manifold_choose(manifold, points, count);
            return count > 0;
        }
    }
    float s, t;
    es_nearest_of_segments(p0, p1, q0, q1, &s, &t);
    es_vec3 on = es_v3_mad(p0, d, s), over = es_v3_mad(q0, e, t), across = es_v3_sub(over, on);
    if (es_v3_dot(across, across) < 1e-12f * (dd + ee)) { /* the axes cross: apart along their common perpendicular */
        es_vec3 n = es_v3_normalize(es_v3_cross(d, e), es_v3(0, 1, 0));
        float separation = -a->radius - b->radius;
        return es_manifold_single(manifold, n, es_v3_mad(on, n, a->radius + 0.5f * separation), separation, 1);
    }
    return collide_points(on, a->radius, over, b->radius, 1, margin, manifold);
}

uint32_t es_rigid_collide(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float margin,
    es_manifold* manifolds, uint32_t capacity)
{
    if (capacity == 0) return 0;
    if (a->type == ES_SHAPE_BOX && b->type == ES_SHAPE_BOX && a->radius + b->radius == 0) {
        /* too far apart for any rotation */
        es_vec3 d = es_v3_sub(pose_b->position, pose_a->position);
        float reach = a->outer_radius + b->outer_radius + margin;
        if (es_v3_dot(d, d) > reach * reach) return 0;
        es_placed_box box_a = es_place_box(a, pose_a), box_b = es_place_box(b, pose_b);
        return es_collide_boxes(&box_a, &box_b, margin, manifolds);
    }
    if (a->type == ES_SHAPE_MESH || b->type == ES_SHAPE_MESH) {
        if (a->type == b->type) return 0;
        if (a->type == ES_SHAPE_MESH) return es_collide_mesh(a, pose_a, b, pose_b, margin, manifolds, capacity);
        uint32_t count = es_collide_mesh(b, pose_b, a, pose_a, margin, manifolds, capacity);
        flip(manifolds, count);
        return count;
    }
    uint32_t count;
    if (a->type == ES_SHAPE_SPHERE && b->type == ES_SHAPE_SPHERE)
        return collide_points(placed(pose_a, a->centre), a->radius, placed(pose_b, b->centre), b->radius, 1, margin, manifolds);
    if (b->type == ES_SHAPE_SPHERE) return collide_with_sphere(a, pose_a, b, pose_b, margin, manifolds);
    if (a->type == ES_SHAPE_SPHERE) {
        count = collide_with_sphere(b, pose_b, a, pose_a, margin, manifolds);
        flip(manifolds, count);
        return count;
    }
    if (a->type == ES_SHAPE_CAPSULE && b->type == ES_SHAPE_CAPSULE) return collide_capsules(a, pose_a, b, pose_b, margin, manifolds);
    if (a->type == ES_SHAPE_CAPSULE) { /* the polyhedron first */
        count = es_collide_cores(b, pose_b, a, pose_a, margin, manifolds);
        flip(manifolds, count);
        return count;
    }
    return es_collide_cores(a, pose_a, b, pose_b, margin, manifolds);
}
