/* Joints: from limits and drives by axis to the kinds the solver has. */
#include "sim/gltf_physics_parts.h"

#include <stdio.h>
#include <string.h>

#include "sim/world.h"

/* ---- joints ---------------------------------------------------------------------------------------------------------------------- */

static es_body body_of(const es_gltf_loader* l, int32_t n)
{
    if (n < 0) return (es_body){0};
    if (l->bodies[n].id) return l->bodies[n];
    return l->owner[n] < 0 ? (es_body){0} : l->bodies[l->owner[n]];
}

/* The joint's frame at node `at` (turned by `turn`), in the axes of a body or of the world. */
static es_result frame_in(const es_gltf_loader* l, es_body body, int32_t at, es_quat turn, es_vec3* position, es_quat* rotation)
{
    es_gltf_place frame = {.rotation = es_quat_identity(), .scale = es_v3(1, 1, 1)}, here = es_gltf_place_of(l->in->world, l->in->nodes[at].node);
    if (body.id) {
        es_body_state state;
        ES_GLTF_TRY(es_world_get_body(l->in->world, body, &state));
        memcpy(frame.position, state.position, sizeof frame.position);
        frame.rotation = state.rotation;
    }
    here.rotation = es_quat_mul(here.rotation, turn);
    es_gltf_seen_from(&frame, &here, position, rotation);
    return ES_OK;
}

static es_result finish_joint(es_gltf_loader* l, es_joint_desc* desc, const char* where, int32_t a_node, int32_t b_node, es_quat turn)
{
    if (desc->a.id == desc->b.id) return es_gltf_damaged(l, where, "connects a body with itself, or nothing that is a body");
    ES_GLTF_TRY(frame_in(l, desc->a, a_node, turn, &desc->position_a, &desc->rotation_a));
    ES_GLTF_TRY(frame_in(l, desc->b, b_node, turn, &desc->position_b, &desc->rotation_b));
    es_joint joint;
    return es_world_add_joint(l->in->world, desc, &joint);
}

/* What the limits of a joint take away, by axis. */
typedef struct freedom { bool linear_locked[3], angular_locked[3], distance, angle[3]; float low[3], high[3], near, far; bool other; } freedom;

static es_result read_limit(es_gltf_loader* l, const void* limit, const char* where, freedom* f)
{
    static const char* const names[] = {"linearAxes", "angularAxes"};
    bool any = false;
    float low = -1e9f, high = 1e9f;
    if (!l->in->values->is_object(limit)) return es_gltf_damaged(l, where, "must be an object");
    ES_GLTF_TRY(es_gltf_number(l, limit, "min", -1e9, 1e9, where, &low));
    ES_GLTF_TRY(es_gltf_number(l, limit, "max", -1e9, 1e9, where, &high));
    bool bounded_below = es_gltf_member(l, limit, "min") != NULL, locked = (low == 0 || !bounded_below) && high == 0 && es_gltf_member(l, limit, "max");
    for (int kind = 0; kind < 2; kind++) {
        const void* axes = es_gltf_member(l, limit, names[kind]);
        size_t length = 0;
        if (!axes) continue;
        any = true;
        if (!l->in->values->array_length(axes, &length) || length < 1 || length > 3) return es_gltf_damaged_member(l, where, names[kind], "must be an array of 1 … 3 axes");
        for (size_t i = 0; i < length; i++) {
            double axis;
            if (!l->in->values->number(l->in->values->element(axes, i), &axis) || (axis != 0 && axis != 1 && axis != 2)) return es_gltf_damaged_member(l, where, names[kind], "must hold 0, 1 or 2");
            int k = (int)axis;
            if (locked && kind == 0) f->linear_locked[k] = true;
            else if (locked) f->angular_locked[k] = true;
            else if (kind == 1 && length == 1) f->angle[k] = true, f->low[k] = low, f->high[k] = high;
            else if (kind == 0 && length == 3) f->distance = true, f->near = bounded_below ? es_maxf(low, 0) : 0, f->far = high;
            else f->other = true;
        }
    }
    return any ? ES_OK : es_gltf_damaged(l, where, "needs linearAxes or angularAxes");
}

/* A drive about the hinge's axis becomes its motor; others are left out. */
static es_result read_drive(es_gltf_loader* l, const void* drive, const char* where, int hinge_axis, es_joint_desc* desc)
{
    static const char *const types[] = {"linear", "angular", NULL}, *const modes[] = {"force", "acceleration", NULL};
    uint32_t type = 0, mode = 0;
    int32_t axis;
    float max_force = 1e12f, target = 0, speed = 0, stiffness = 0;
    if (!l->in->values->is_object(drive)) return es_gltf_damaged(l, where, "must be an object");
    ES_GLTF_TRY(es_gltf_word(l, drive, "type", types, where, &type));
    ES_GLTF_TRY(es_gltf_word(l, drive, "mode", modes, where, &mode));
    ES_GLTF_TRY(es_gltf_index(l, drive, "axis", 3, where, &axis));
    ES_GLTF_TRY(es_gltf_number(l, drive, "maxForce", 0, 1e12, where, &max_force));
    ES_GLTF_TRY(es_gltf_number(l, drive, "positionTarget", -1e9, 1e9, where, &target));
    ES_GLTF_TRY(es_gltf_number(l, drive, "velocityTarget", -1e3, 1e3, where, &speed));
    ES_GLTF_TRY(es_gltf_number(l, drive, "stiffness", 0, 1e12, where, &stiffness));
    if (type == 1 && axis >= 0 && axis == hinge_axis && stiffness == 0) {
        desc->motor = true;
        desc->speed = speed;
        desc->max_torque = max_force;
    } else {
        l->left.drives++;
    }
    return ES_OK;
}

static es_result each_of(es_gltf_loader* l, const void* joint, const char* list, const char* place, freedom* f, int hinge_axis, es_joint_desc* desc)
{
    const void* array = es_gltf_member(l, joint, list);
    size_t length = 0;
    if (array && !l->in->values->array_length(array, &length)) return es_gltf_damaged_member(l, place, list, "must be an array");
    for (size_t i = 0; i < length; i++) {
        char where[160];
        snprintf(where, sizeof where, "%s.%s[%zu]", place, list, i);
        const void* each = l->in->values->element(array, i);
        ES_GLTF_TRY(desc ? read_drive(l, each, where, hinge_axis, desc) : read_limit(l, each, where, f));
    }
    return ES_OK;
}

static es_result add_rigid_joint(es_gltf_loader* l, uint32_t n, const void* use)
{
    char where[96], place[96];
    int32_t connected, number;
    const void* joint;
    snprintf(where, sizeof where, "nodes[%u].extensions.KHR_physics_rigid_bodies.joint", n);
    if (!l->in->values->is_object(use)) return es_gltf_damaged(l, where, "must be an object");
    ES_GLTF_TRY(es_gltf_index(l, use, "connectedNode", l->in->node_count, where, &connected));
    ES_GLTF_TRY(es_gltf_index(l, use, "joint", INT32_MAX, where, &number));
    if (connected < 0 || number < 0) return es_gltf_damaged(l, where, "needs connectedNode and joint");
    ES_GLTF_TRY(es_gltf_listed(l, l->in->rigid, "physicsJoints", number, where, &joint));
    if (!l->in->nodes[connected].node.id) return es_gltf_damaged_member(l, where, "connectedNode", "is not in the scene");
    snprintf(place, sizeof place, "extensions.KHR_physics_rigid_bodies.physicsJoints[%d]", number);
    freedom f = {.far = 1e9f};
    ES_GLTF_TRY(each_of(l, joint, "limits", place, &f, -1, NULL));
    es_joint_desc desc = es_default_joint_desc();
    desc.a = body_of(l, (int32_t)n);
    desc.b = body_of(l, connected);
    ES_GLTF_TRY(es_gltf_flag(l, use, "enableCollision", where, &desc.collide_connected));
    bool together = f.linear_locked[0] && f.linear_locked[1] && f.linear_locked[2];
    int locked = f.angular_locked[0] + f.angular_locked[1] + f.angular_locked[2], hinge_axis = -1;
    es_quat turn = es_quat_identity();
    l->left.limits += f.other;
    if (together && locked == 3) {
        desc.type = ES_JOINT_FIXED;
    } else if (together && locked == 2) {
        static const es_quat turns[3] = {{0.5f, 0.5f, 0.5f, 0.5f}, {-0.5f, -0.5f, -0.5f, 0.5f}, {0, 0, 0, 1}}; /* z to that axis */
        hinge_axis = !f.angular_locked[0] ? 0 : !f.angular_locked[1] ? 1 : 2;
        turn = turns[hinge_axis];
        desc.type = ES_JOINT_HINGE;
        desc.limit = f.angle[hinge_axis];
        desc.lower = es_clampf(f.low[hinge_axis], -3.1f, 3.1f);
        desc.upper = es_clampf(f.high[hinge_axis], -3.1f, 3.1f);
        if (desc.limit && desc.lower > desc.upper) return es_gltf_damaged(l, place, "has a limit whose min is above its max");
    } else if (together) {
        desc.type = ES_JOINT_BALL;
        l->left.limits += locked > 0 || f.angle[0] || f.angle[1] || f.angle[2];
    } else if (f.distance && !locked) {
        desc.type = ES_JOINT_DISTANCE;
        desc.limit = true;
        desc.lower = f.near;
        desc.upper = es_minf(f.far, 1e5f);
        if (desc.lower > desc.upper) return es_gltf_damaged(l, place, "has a limit whose min is above its max");
    } else {
        l->left.joints++;
        return ES_OK;
    }
    ES_GLTF_TRY(each_of(l, joint, "drives", place, NULL, hinge_axis, &desc));
    return finish_joint(l, &desc, where, (int32_t)n, connected, turn);
}

static es_result add_extras_joint(es_gltf_loader* l, uint32_t n, const void* from)
{
    static const char* const types[] = {"ball", "hinge", "distance", "fixed", NULL};
    char where[96];
    uint32_t type = ES_JOINT_BALL;
    int32_t to;
    float limit[2] = {0, 0};
    es_joint_desc desc = es_default_joint_desc();
    snprintf(where, sizeof where, "nodes[%u].extras.earthshine.joint", n);
    if (!l->in->values->is_object(from)) return es_gltf_damaged(l, where, "must be an object");
    ES_GLTF_TRY(es_gltf_word(l, from, "type", types, where, &type));
    ES_GLTF_TRY(es_gltf_index(l, from, "to", l->in->node_count, where, &to));
    ES_GLTF_TRY(es_gltf_numbers(l, from, "limit", 2, -1e5, 1e5, where, limit));
    ES_GLTF_TRY(es_gltf_number(l, from, "speed", -1e3, 1e3, where, &desc.speed));
    ES_GLTF_TRY(es_gltf_number(l, from, "maxForce", 0, 1e12, where, &desc.max_force));
    ES_GLTF_TRY(es_gltf_number(l, from, "maxTorque", 0, 1e12, where, &desc.max_torque));
    ES_GLTF_TRY(es_gltf_number(l, from, "length", 0, 1e5, where, &desc.length));
    ES_GLTF_TRY(es_gltf_number(l, from, "hertz", 0, 1e3, where, &desc.hertz));
    ES_GLTF_TRY(es_gltf_number(l, from, "dampingRatio", 0, 1e3, where, &desc.damping_ratio));
    ES_GLTF_TRY(es_gltf_number(l, from, "breakForce", 0, 1e12, where, &desc.break_force));
    ES_GLTF_TRY(es_gltf_number(l, from, "breakTorque", 0, 1e12, where, &desc.break_torque));
    ES_GLTF_TRY(es_gltf_flag(l, from, "collideConnected", where, &desc.collide_connected));
    desc.type = (es_joint_type)type;
    desc.limit = es_gltf_member(l, from, "limit") != NULL;
    desc.lower = limit[0];
    desc.upper = limit[1];
    desc.motor = es_gltf_member(l, from, "speed") != NULL;
    if (to >= 0 && !l->in->nodes[to].node.id) return es_gltf_damaged_member(l, where, "to", "is not in the scene");
    desc.a = body_of(l, to);
    desc.b = body_of(l, (int32_t)n);
    if (to >= 0 && !desc.a.id) return es_gltf_damaged_member(l, where, "to", "names a node that is no body");
    /* at this node's place, except for a distance, which is between the two nodes */
    return finish_joint(l, &desc, where, type == ES_JOINT_DISTANCE && to >= 0 ? to : (int32_t)n, (int32_t)n, es_quat_identity());
}

es_result es_gltf_add_joints(es_gltf_loader* l)
{
    for (uint32_t i = 0; i < l->in->order_count; i++) {
        uint32_t n = l->in->order[i];
        const void *joint = es_gltf_rigid_part(l, n, "joint"), *extras = es_gltf_extras_part(l, n, "joint");
        if (joint) ES_GLTF_TRY(add_rigid_joint(l, n, joint));
        if (extras) ES_GLTF_TRY(add_extras_joint(l, n, extras));
    }
    return ES_OK;
}

