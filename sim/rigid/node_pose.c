/* Between nodes and bodies: where a node is, and how to set a node so that it is where a body is. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/node_pose.h"

/* Shepperd 1978: divides by the largest of the four. Columns are unit and orthogonal. */
static es_quat quat_from_columns(es_vec3 x, es_vec3 y, es_vec3 z)
{
    float trace = x.x + y.y + z.z;
    if (trace > 0) {
        float s = 2.0f * es_sqrt(trace + 1.0f);
        return es_quat_normalize((es_quat){(y.z - z.y) / s, (z.x - x.z) / s, (x.y - y.x) / s, 0.25f * s});
    }
    if (x.x >= y.y && x.x >= z.z) {
        float s = 2.0f * es_sqrt(1.0f + x.x - y.y - z.z);
        return es_quat_normalize((es_quat){0.25f * s, (y.x + x.y) / s, (z.x + x.z) / s, (y.z - z.y) / s});
    }
    if (y.y >= z.z) {
        float s = 2.0f * es_sqrt(1.0f + y.y - x.x - z.z);
        return es_quat_normalize((es_quat){(y.x + x.y) / s, 0.25f * s, (z.y + y.z) / s, (z.x - x.z) / s});
    }
    float s = 2.0f * es_sqrt(1.0f + z.z - x.x - y.y);
    return es_quat_normalize((es_quat){(z.x + x.z) / s, (z.y + y.z) / s, 0.25f * s, (x.y - y.x) / s});
}

/* The nearest rotation by Gram and Schmidt, x first; a mirroring is left out. */
static es_quat rotation_of(const es_mat4* m)
{
    es_vec3 x = es_v3_normalize(es_v3(m->m[0], m->m[1], m->m[2]), es_v3(1, 0, 0)), y = es_v3(m->m[4], m->m[5], m->m[6]);
    y = es_v3_sub(y, es_v3_scale(x, es_v3_dot(x, y)));
    es_vec3 t, b;
    es_orthonormal_basis(x, &t, &b);
    y = es_v3_normalize(y, t);
    return quat_from_columns(x, y, es_v3_cross(x, y));
}

void es_node_get_pose(const es_world* world, es_node node, double position[3], es_quat* rotation)
{
    es_world_refresh(world);
    memcpy(position, es_node_position(world, node), 3 * sizeof *position);
    *rotation = rotation_of(es_node_world(world, node));
}

static const es_node_object* parent_of(const es_world* world, es_node node)
{
    const es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    return object ? es_slots_get(&world->slots[ES_OBJECT_NODE], object->parent.id) : NULL;
}

bool es_node_is_below_scale(const es_world* world, es_node node)
{
    es_world_refresh(world);
    const es_node_object* parent = parent_of(world, node);
    if (!parent) return false;
    const float* m = parent->world.m;
    es_vec3 c[3] = {es_v3(m[0], m[1], m[2]), es_v3(m[4], m[5], m[6]), es_v3(m[8], m[9], m[10])};
    bool rigid = es_mat4_determinant3(&parent->world) > 0;
    for (int i = 0; i < 3; i++) rigid &= es_absf(es_v3_dot(c[i], c[i]) - 1.0f) < 1e-3f && es_absf(es_v3_dot(c[i], c[(i + 1) % 3])) < 1e-3f;
    return !rigid;
}

void es_node_set_pose(es_world* world, es_node node, const double position[3], es_quat rotation)
{
    es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    if (!object) return;
    es_transform transform = object->transform;
    const es_node_object* parent = parent_of(world, node);
    if (parent) {
        es_quat q = rotation_of(&parent->world);
        es_quat inverse = {-q.x, -q.y, -q.z, q.w};
        es_vec3 offset = es_v3((float)(position[0] - parent->position[0]), (float)(position[1] - parent->position[1]), (float)(position[2] - parent->position[2]));
        transform.translation = es_quat_rotate(inverse, offset);
        transform.rotation = es_quat_normalize(es_quat_mul(inverse, rotation));
    } else {
        transform.translation = es_v3((float)position[0], (float)position[1], (float)position[2]);
        transform.rotation = rotation;
    }
    if (memcmp(&transform, &object->transform, sizeof transform) == 0) return;
    object->transform = transform;
    object->dirty = world->nodes_dirty = true;
}
