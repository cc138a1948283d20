/* One fixed step of the rigid bodies, and how it is shown.
 *
 *     bodies that follow nodes are sent there     pairs whose boxes touch     manifolds, events, waking
 *     solver     poses and boxes     fast bodies stop at what they would pass     islands fall asleep
 *
 * When memory runs out the step fails before bodies have moved, and may be made again. */
#include "sim/dynamics.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/hands.h"
#include "sim/rigid/joints.h"
#include "sim/rigid/node_pose.h"

static es_quat conjugate(es_quat q) { return (es_quat){-q.x, -q.y, -q.z, q.w}; }

/* The angular velocity that turns `from` into `to` within h, the shorter way. */
static es_vec3 turning(es_quat from, es_quat to, float h)
{
    es_quat d = es_quat_mul(to, conjugate(from));
    if (d.w < 0) d = (es_quat){-d.x, -d.y, -d.z, -d.w};
    es_vec3 axis = es_v3(d.x, d.y, d.z);
    float sine = es_v3_length(axis);
    if (!(sine > 1e-12f)) return es_v3(0, 0, 0);
    return es_v3_scale(axis, 2.0f * es_atan2(sine, d.w) / (sine * h));
}

/* A kinematic body with a node goes where the node is, at the speed it takes; too far for one step, it is set down there. */
static void follow(es_world* world, es_body_object* body, float h)
{
    double position[3];
    es_quat rotation;
    es_node_get_pose(world, body->node, position, &rotation);
    es_body_object there = *body;
    es_body_place(&there, position, rotation);
    es_vec3 way = es_v3((float)(there.centre[0] - body->centre[0]), (float)(there.centre[1] - body->centre[1]), (float)(there.centre[2] - body->centre[2]));
    body->velocity = es_v3_scale(way, 1.0f / h);
    body->angular_velocity = turning(body->rotation, rotation, h);
    memcpy(body->centre, there.centre, sizeof body->centre);
    body->rotation = rotation;
    if (es_v3_length(body->velocity) < ES_MAX_SPEED) return;
    memcpy(body->previous_centre, body->centre, sizeof body->centre);
    body->previous_rotation = rotation;
    body->velocity = body->angular_velocity = es_v3(0, 0, 0);
}

static void follow_still(es_world* world, es_body_object* body)
{
    double position[3];
    es_quat rotation;
    es_node_get_pose(world, body->node, position, &rotation);
    if (memcmp(position, body->seen_position, sizeof position) == 0 && memcmp(&rotation, &body->seen_rotation, sizeof rotation) == 0) return;
    memcpy(body->seen_position, position, sizeof position);
    body->seen_rotation = rotation;
    es_body_wake_neighbours(world, body);
    es_body_place(body, position, rotation);
    es_body_refresh_tree(world, body, es_v3(0, 0, 0));
}

static void drift(es_body_object* body, float h)
{
    for (int k = 0; k < 3; k++) body->centre[k] += (double)((&body->velocity.x)[k] * h);
    es_vec3 w = es_v3_scale(body->angular_velocity, h);
    float angle = es_v3_length(w);
    if (angle > 1e-12f) body->rotation = es_quat_normalize(es_quat_mul(es_quat_from_axis_angle(es_v3_scale(w, 1.0f / angle), angle), body->rotation));
}

static bool is_zero(es_vec3 v) { return v.x == 0 && v.y == 0 && v.z == 0; }

/* Where kinematic and static bodies are at the end of the step is known before it. Contacts are looked for where they are when it begins. */
static bool begin(es_world* world, float h)
{
    es_rigid* rigid = world->rigid;
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    if (!es_grow(world->context, (void**)&rigid->moving, &rigid->moving_capacity, 0, slots->slot_count, sizeof *rigid->moving)) return false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* body = es_slots_at(slots, slot);
        if (!body || body->type == ES_BODY_DYNAMIC) continue;
        if (body->type == ES_BODY_STATIC) {
            if (body->node.id) follow_still(world, body);
            continue;
        }
        memcpy(body->previous_centre, body->centre, sizeof body->centre);
        body->previous_rotation = body->rotation;
        if (body->node.id) follow(world, body, h);
        else drift(body, h);
        bool moves = !is_zero(body->velocity) || !is_zero(body->angular_velocity), moved = body->index != UINT32_MAX;
        if (moves != moved) {
            body->index = moves ? 0 : UINT32_MAX;
            rigid->unsorted = true;
        }
    }
    return true;
}

static void list_moving(es_world* world)
{
    es_rigid* rigid = world->rigid;
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    uint32_t count = 0;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* body = es_slots_at(slots, slot);
        if (!body || body->type != ES_BODY_DYNAMIC) continue;
        body->index = UINT32_MAX;
        if (body->asleep) continue;
        body->index = count;
        rigid->moving[count++] = slot;
    }
    rigid->dynamic_count = count;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* body = es_slots_at(slots, slot);
        if (!body || body->type != ES_BODY_KINEMATIC || body->index == UINT32_MAX) continue;
        body->index = count;
        rigid->moving[count++] = slot;
    }
    rigid->kinematic_count = count - rigid->dynamic_count;
}

/* Kinematic bodies stand at the end of their way already; contacts want the beginning. */
static void swap_kinematic(es_world* world)
{
    const es_rigid* rigid = world->rigid;
    for (uint32_t i = rigid->dynamic_count; i < rigid->dynamic_count + rigid->kinematic_count; i++) {
        es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], rigid->moving[i]);
        double centre[3];
        memcpy(centre, body->centre, sizeof centre);
        memcpy(body->centre, body->previous_centre, sizeof centre);
        memcpy(body->previous_centre, centre, sizeof centre);
        es_quat rotation = body->rotation;
        body->rotation = body->previous_rotation;
        body->previous_rotation = rotation;
    }
}

/* Whoever is touched by what moves wakes. */
static void wake_touched(es_world* world)
{
    const es_contacts* contacts = &world->rigid->contacts;
    for (size_t i = 0; i < contacts->count; i++) {
        const es_contact* contact = &contacts->list[i];
        if (contact->count == 0) continue;
        es_body_object *a = es_body_of_key(world, contact->a), *b = es_body_of_key(world, contact->b);
        if (a->asleep) es_body_wake(world, a);
        if (b->asleep) es_body_wake(world, b);
    }
    if (world->rigid->unsorted) es_joints_wake(world);
}

static bool touch(es_world* world)
{
    es_rigid* rigid = world->rigid;
    if (!es_find_contacts(world)) return false;
    /* of this step (es_report_pressed's too: each of next, and of those that wake, enters once at most), and of all that touches after it */
    if (!es_events_reserve(world, rigid->contacts.count + 2 * rigid->next.count + 2 * rigid->asleep.count)) return false;
    es_collide_contacts(world);
    es_report_contacts(world);
    es_contacts old = rigid->contacts;
    rigid->contacts = rigid->next;
    rigid->next = old;
    wake_touched(world);
    if (!rigid->unsorted) return true;
    if (!es_sort_contacts(world)) return false;
    swap_kinematic(world);
    list_moving(world);
    swap_kinematic(world);
    return true;
}

static void refresh_boxes(es_world* world, float h)
{
    const es_rigid* rigid = world->rigid;
    for (uint32_t i = 0; i < rigid->dynamic_count + rigid->kinematic_count; i++) {
        es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], rigid->moving[i]);
        es_body_refresh_tree(world, body, es_v3_scale(body->velocity, 2.0f * h));
    }
}

static void remember_poses(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_body_object* body = es_slots_at(slots, slot);
        if (!body || body->type != ES_BODY_DYNAMIC) continue;
        memcpy(body->previous_centre, body->centre, sizeof body->centre);
        body->previous_rotation = body->rotation;
    }
}

es_result es_rigid_step(es_world* world, float h, uint32_t substeps)
{
    es_rigid* rigid = world->rigid;
    if (!rigid || world->slots[ES_OBJECT_BODY].live == 0) return ES_OK;
    es_hands_wake(world);
    if (!begin(world, h)) return es_context_last_result(world->context);
    es_joints_wake(world);
    if (!es_sort_contacts(world)) return es_context_last_result(world->context);
    list_moving(world);
    remember_poses(world);
    if (rigid->dynamic_count + rigid->kinematic_count == 0) return ES_OK;
    swap_kinematic(world);
    bool good = touch(world) && es_islands_reserve(world) && es_solve(world, h, substeps);
    swap_kinematic(world);
    if (!good) return es_context_last_result(world->context);
    es_report_pressed(world);
    es_stop_fast_bodies(world);
    refresh_boxes(world, h);
    es_islands_sleep(world, h);
    return ES_OK;
}

void es_rigid_begin_frame(es_world* world)
{
    if (world->rigid) world->rigid->event_count = 0;
}

void es_rigid_pose(es_world* world, float alpha)
{
    const es_slots* slots = &world->slots[ES_OBJECT_BODY];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_body_object* body = es_slots_at(slots, slot);
        if (!body || body->type != ES_BODY_DYNAMIC || !body->node.id) continue;
        double centre[3], position[3];
        es_quat rotation = body->rotation;
        memcpy(centre, body->centre, sizeof centre);
        if (alpha < 1.0f) {
            for (int k = 0; k < 3; k++) centre[k] = body->previous_centre[k] + (body->centre[k] - body->previous_centre[k]) * (double)alpha;
            rotation = es_quat_slerp(body->previous_rotation, body->rotation, alpha);
        }
        es_body_position(body, centre, rotation, position);
        es_node_set_pose(world, body->node, position, rotation);
    }
}
