/* Distance of two shapes, and when they first come near each other on their ways. */
#include "sim/rigid/core.h"
#include "sim/rigid/distance.h"
#include "sim/rigid/shape_mesh.h"
#include "sim/rigid/shape_query.h"

es_pose es_sweep_pose(const es_sweep* s, float t)
{
    es_quat a = s->rotation_from, b = s->rotation_to;
    float sign = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w < 0 ? -1.0f : 1.0f, u = 1 - t, v = sign * t;
    es_quat q = es_quat_normalize((es_quat){u * a.x + v * b.x, u * a.y + v * b.y, u * a.z + v * b.z, u * a.w + v * b.w});
    es_vec3 centre = es_v3_mix(s->from, s->to, t);
    return (es_pose){es_v3_sub(centre, es_quat_rotate(q, s->local_centre)), q};
}

/* ---- distance ---------------------------------------------------------------------------------------------------------------- */

typedef struct found { float distance; es_vec3 on_a, on_b, normal; } found;

/* b's core within a's frame, a convex */
static found convex_distance(const es_core* a, const es_core* b)
{
    es_nearest nearest;
    es_nearest_points(a->vertices, a->vertex_count, b->vertices, b->vertex_count, &nearest);
    float distance = (float)nearest.distance - a->radius - b->radius;
    if (!(nearest.distance > 0) || distance <= 0) return (found){0, nearest.on_a, nearest.on_b, nearest.normal};
    return (found){distance, es_v3_mad(nearest.on_a, nearest.normal, a->radius), es_v3_mad(nearest.on_b, nearest.normal, -b->radius), nearest.normal};
}

static float box_gap(const es_mesh_node* node, es_vec3 low, es_vec3 high)
{
    es_vec3 zero = {0, 0, 0}, d = es_v3_max(es_v3_max(es_v3_sub(node->low, high), es_v3_sub(low, node->high)), zero);
    return es_v3_length(d);
}

static found mesh_distance(const es_shape_mesh* mesh, const es_core* b, float limit)
{
    es_vec3 low = b->vertices[0], high = low;
    for (uint32_t i = 1; i < b->vertex_count; i++) {
        low = es_v3_min(low, b->vertices[i]);
        high = es_v3_max(high, b->vertices[i]);
    }
    found best = {limit, {0, 0, 0}, {0, 0, 0}, {0, 1, 0}};
    uint32_t stack[ES_MESH_STACK], depth = 0;
    stack[depth++] = 0;
    while (depth) {
        uint32_t at = stack[--depth];
        const es_mesh_node* node = &mesh->nodes[at];
        if (box_gap(node, low, high) * 0.99999f - b->radius > best.distance) continue;
        if (node->count == 0) {
            uint32_t near_child = at + 1, far_child = node->first;
            if (box_gap(&mesh->nodes[far_child], low, high) < box_gap(&mesh->nodes[near_child], low, high)) near_child = node->first, far_child = at + 1;
            stack[depth++] = far_child;
            stack[depth++] = near_child;
            continue;
        }
        for (uint32_t i = node->first; i < node->first + node->count; i++) {
            const es_mesh_triangle* t = &mesh->triangles[i];
            es_vec3 v[3] = {mesh->vertices[t->vertex[0]], mesh->vertices[t->vertex[1]], mesh->vertices[t->vertex[2]]};
            es_nearest nearest;
            es_nearest_points(v, 3, b->vertices, b->vertex_count, &nearest);
            float distance = es_maxf((float)nearest.distance - b->radius, 0);
            if (!(distance < best.distance)) continue; /* of equals the first in the tree's order, which is the mesh's own */
            best = (found){distance, nearest.on_a, es_v3_mad(nearest.on_b, nearest.normal, -b->radius), nearest.normal};
            if (distance == 0) return best;
        }
    }
    return best;
}

static found distance_in_a(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float limit)
{
    es_core core_a, core_b;
    es_mat3 m;
    es_vec3 position;
    es_relative_pose(pose_a, pose_b, &m, &position);
    es_core_place(b, &m, position, &core_b);
    if (a->type == ES_SHAPE_MESH) return mesh_distance(a->mesh, &core_b, limit);
    es_core_of(a, &core_a);
    return convex_distance(&core_a, &core_b);
}

float es_rigid_distance(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b, float limit, es_vec3* on_a, es_vec3* on_b)
{
    bool swap = b->type == ES_SHAPE_MESH;
    if (swap && a->type == ES_SHAPE_MESH) return limit;
    const es_pose* frame = swap ? pose_b : pose_a;
    found f = swap ? distance_in_a(b, pose_b, a, pose_a, limit) : distance_in_a(a, pose_a, b, pose_b, limit);
    es_mat3 m = es_mat3_from_quat(frame->rotation);
    *on_a = es_v3_add(frame->position, es_mat3_mul(&m, swap ? f.on_b : f.on_a));
    *on_b = es_v3_add(frame->position, es_mat3_mul(&m, swap ? f.on_a : f.on_b));
    return es_minf(f.distance, limit);
}

bool es_rigid_overlap(const es_rigid_shape* a, const es_pose* pose_a, const es_rigid_shape* b, const es_pose* pose_b)
{
    es_vec3 on_a, on_b;
    return es_rigid_distance(a, pose_a, b, pose_b, 1e-3f, &on_a, &on_b) <= 0;
}

/* ---- time of impact ------------------------------------------------------------------------------------------------------------ */

/* How far a point of the shape is from the body's centre of mass at most. */
static float reach_of(const es_rigid_shape* shape, es_vec3 centre)
{
    es_vec3 far_corner = es_v3_max(es_v3_abs(es_v3_sub(shape->low, centre)), es_v3_abs(es_v3_sub(shape->high, centre)));
    return es_minf(es_v3_length(far_corner), shape->outer_radius + es_v3_length(centre));
}

/* The mix runs along the chord between the two quaternions, of length c: fastest in the middle, where it is sqrt(1 - c²/4) from zero. A rotation
 * turns by twice its quaternion's angle. */
static float fastest_turn(const es_sweep* s)
{
    const float *a = &s->rotation_from.x, *b = &s->rotation_to.x;
    double plus = 0, minus = 0;
    for (int k = 0; k < 4; k++) {
        plus += ((double)b[k] + a[k]) * ((double)b[k] + a[k]);
        minus += ((double)b[k] - a[k]) * ((double)b[k] - a[k]);
    }
    double c = plus < minus ? plus : minus, from_zero = 1 - c / 4;
    return (float)(2.001 * __builtin_sqrt(c / (from_zero > 0.25 ? from_zero : 0.25)));
}

float es_rigid_time_of_impact(const es_rigid_shape* a, const es_sweep* sweep_a, const es_rigid_shape* b, const es_sweep* sweep_b, float target)
{
    if (a->type == ES_SHAPE_MESH && b->type == ES_SHAPE_MESH) return 1;
    es_vec3 way = es_v3_sub(es_v3_sub(sweep_b->to, sweep_b->from), es_v3_sub(sweep_a->to, sweep_a->from));
    float turning = fastest_turn(sweep_a) * reach_of(a, sweep_a->local_centre) + fastest_turn(sweep_b) * reach_of(b, sweep_b->local_centre);
    float most = es_v3_length(way) * 1.000001f + turning;
    float t = 0;
    for (int i = 0; i < 256; i++) {
        es_pose pose_a = es_sweep_pose(sweep_a, t), pose_b = es_sweep_pose(sweep_b, t);
        es_vec3 on_a, on_b;
        float left = most * (1 - t), distance = es_rigid_distance(a, &pose_a, b, &pose_b, left + 2 * target, &on_a, &on_b);
        if (distance <= target * 1.25f) return t; /* the tolerance is on the near side: never late */
        if (distance - target > left) return 1;
        /* Convex shapes are kept apart by the plane between their nearest points: along its normal they close with `way`, and by turning. A mesh is
         * not behind one plane; there the whole speed counts. */
        float closing = most;
        if (a->type != ES_SHAPE_MESH && b->type != ES_SHAPE_MESH) {
            es_vec3 n = es_v3_scale(es_v3_sub(on_b, on_a), 1 / distance);
            closing = -es_v3_dot(way, n) * 1.00001f + 1e-5f * es_v3_length(way) + turning;
            if (!(closing > 0)) return 1;
        }
        t += (distance - target) / closing;
        if (!(t < 1)) return 1;
    }
    return t;
}
