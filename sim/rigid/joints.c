/* Joints: making, asking, changing. What they do is in joint_solver.c. */
#include "sim/rigid/joints.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/recording.h"
#include "sim/rigid/rigid_state.h"

es_joint_desc es_default_joint_desc(void)
{
    return (es_joint_desc){.type = ES_JOINT_BALL, .rotation_a = {0, 0, 0, 1}, .rotation_b = {0, 0, 0, 1}, .length = -1};
}

static es_body_object* body_at(const es_world* world, es_body body) { return es_slots_get(&world->slots[ES_OBJECT_BODY], body.id); }

static es_quat unit(es_quat q) { return q.x == 0 && q.y == 0 && q.z == 0 && q.w == 0 ? es_quat_identity() : es_quat_normalize(q); }

/* ---- checking --------------------------------------------------------------------------------------------------------------- */

static es_result check(const es_world* world, const es_joint_desc* d, const char* name)
{
    es_context* context = world->context;
    const char* wrong = NULL;
    if ((uint32_t)d->type > ES_JOINT_MOTOR) wrong = "its type does not exist";
    else if (d->a.id == d->b.id) wrong = "it joins something to itself";
    else if (!es_all_within(&d->position_a.x, 3, ES_WORLD_EXTENT) || !es_all_within(&d->position_b.x, 3, ES_WORLD_EXTENT) || !es_all_within(&d->rotation_a.x, 4, ES_WORLD_EXTENT) ||
             !es_all_within(&d->rotation_b.x, 4, ES_WORLD_EXTENT))
        wrong = "its frames must be finite and within 1e9";
    else if (!es_within(d->length, -1e9f, 1e9f) || !es_within(d->speed, -1e3f, 1e3f) || !es_all_within(&d->velocity.x, 3, 1e3f) || !es_all_within(&d->angular_velocity.x, 3, 1e3f))
        wrong = "its length must be within 1e9, its speeds within 1000";
    else if (!es_within(d->hertz, 0, 1e4f) || !es_within(d->damping_ratio, 0, 1e3f)) wrong = "hertz must lie in 0 … 10000, the damping ratio in 0 … 1000";
    else if (!es_within(d->max_force, 0, 1e12f) || !es_within(d->max_torque, 0, 1e12f) || !es_within(d->break_force, 0, 1e12f) || !es_within(d->break_torque, 0, 1e12f))
        wrong = "forces and torques must lie in 0 … 1e12";
    else if (d->limit && !(d->lower <= d->upper)) wrong = "its lower limit must not be above the upper one";
    else if (d->limit && d->type == ES_JOINT_HINGE && !(d->lower >= -3.1f && d->upper <= 3.1f)) wrong = "a hinge's limits must lie in -3.1 … 3.1 radians";
    else if (d->limit && d->type == ES_JOINT_DISTANCE && !(d->lower >= 0 && d->upper <= 1e9f)) wrong = "limits of a distance must lie in 0 … 1e9 m";
    return wrong ? es_fail(context, ES_INVALID_ARGUMENT, "joint '%.64s': %s", name, wrong) : ES_OK;
}

/* The frame relative to the centre of mass; of the world as it is. */
static void set_frame(const es_world* world, es_body body, es_vec3 position, es_quat rotation, es_joint_frame* frame)
{
    const es_body_object* object = body_at(world, body);
    *frame = (es_joint_frame){.rotation = rotation};
    if (object) frame->arm = es_v3_sub(position, object->local_centre);
    else
        for (int k = 0; k < 3; k++) frame->place[k] = (&position.x)[k];
}

static void frame_in_world(const es_world* world, es_body body, const es_joint_frame* frame, double place[3], es_quat* rotation)
{
    const es_body_object* object = body_at(world, body);
    memcpy(place, frame->place, 3 * sizeof *place);
    *rotation = frame->rotation;
    if (!object) return;
    es_vec3 arm = es_quat_rotate(object->rotation, frame->arm);
    for (int k = 0; k < 3; k++) place[k] = object->centre[k] + (double)(&arm.x)[k];
    *rotation = es_quat_mul(object->rotation, frame->rotation);
}

static void take_numbers(es_world* world, es_joint_object* joint, const es_joint_desc* desc)
{
    es_joint_desc* d = &joint->desc;
    es_joint_desc kept = *d;
    *d = *desc;
    d->name = NULL;
    if (joint->frame[0].rotation.w || joint->frame[0].rotation.x || joint->frame[0].rotation.y || joint->frame[0].rotation.z) {
        d->type = kept.type;
        d->a = kept.a;
        d->b = kept.b;
        d->collide_connected = kept.collide_connected;
    }
    d->rotation_a = unit(d->rotation_a);
    d->rotation_b = unit(d->rotation_b);
    set_frame(world, d->a, d->position_a, d->rotation_a, &joint->frame[0]);
    set_frame(world, d->b, d->position_b, d->rotation_b, &joint->frame[1]);
    if (d->type == ES_JOINT_DISTANCE && d->length < 0) {
        double p[2][3];
        es_quat q;
        frame_in_world(world, d->a, &joint->frame[0], p[0], &q);
        frame_in_world(world, d->b, &joint->frame[1], p[1], &q);
        es_vec3 way = es_v3((float)(p[1][0] - p[0][0]), (float)(p[1][1] - p[0][1]), (float)(p[1][2] - p[0][2]));
        d->length = es_v3_length(way);
    }
}

/* ---- public ------------------------------------------------------------------------------------------------------------------- */

es_result es_world_place_joint(const es_world* world, es_joint_desc* desc, const double point[3], es_quat rotation)
{
    if (!world) return ES_INVALID_ARGUMENT;
    bool good = desc && point && es_all_within(&rotation.x, 4, ES_WORLD_EXTENT);
    for (int k = 0; good && k < 3; k++) good = point[k] >= -(double)ES_WORLD_EXTENT && point[k] <= (double)ES_WORLD_EXTENT;
    if (!good) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_place_joint: a desc and a place that is finite and within 1e9 are needed");
    const es_body handles[2] = {desc->a, desc->b};
    es_vec3* positions[2] = {&desc->position_a, &desc->position_b};
    es_quat* rotations[2] = {&desc->rotation_a, &desc->rotation_b};
    es_quat q = unit(rotation);
    for (int side = 0; side < 2; side++) {
        if (!handles[side].id) {
            *positions[side] = es_v3((float)point[0], (float)point[1], (float)point[2]);
            *rotations[side] = q;
            continue;
        }
        const es_body_object* body = es_world_object(world, ES_OBJECT_BODY, handles[side].id);
        if (!body) return ES_STALE_HANDLE;
        double place[3];
        es_body_position(body, body->centre, body->rotation, place);
        es_quat back = {-body->rotation.x, -body->rotation.y, -body->rotation.z, body->rotation.w};
        *positions[side] = es_quat_rotate(back, es_v3((float)(point[0] - place[0]), (float)(point[1] - place[1]), (float)(point[2] - place[2])));
        *rotations[side] = es_quat_normalize(es_quat_mul(back, q));
    }
    return ES_OK;
}

/* Pairs of bodies that a joint keeps apart are asked for anew. */
static void touch_proxies(es_world* world, es_body body)
{
    const es_body_object* object = body_at(world, body);
    for (uint32_t i = 0; object && i < object->shape_count; i++) es_dynamic_tree_touch(&world->rigid->tree, object->proxies[i]);
}

static void wake(es_world* world, es_body body)
{
    es_body_object* object = body_at(world, body);
    if (object) es_body_wake(world, object);
}

es_result es_world_add_joint(es_world* world, const es_joint_desc* desc, es_joint* joint)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !joint) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_joint: desc and joint must not be NULL");
    *joint = (es_joint){0};
    const char* name = desc->name ? desc->name : "";
    es_result result = check(world, desc, name);
    if (result != ES_OK) return result;
    const es_body handles[2] = {desc->a, desc->b};
    bool movable = false;
    for (int side = 0; side < 2; side++) {
        if (!handles[side].id) continue;
        const es_body_object* body = es_world_object(world, ES_OBJECT_BODY, handles[side].id);
        if (!body) return ES_STALE_HANDLE;
        movable |= body->type == ES_BODY_DYNAMIC;
    }
    if (!movable) return es_fail(world->context, ES_INVALID_ARGUMENT, "joint '%.64s': one of its bodies must be dynamic", name);
    es_joint_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_JOINT], "joint", desc->name);
    if (!object) return es_context_last_result(world->context);
    es_fp_environment environment = es_fp_enter();
    take_numbers(world, object, desc);
    es_fp_leave(environment);
    for (int side = 0; side < 2; side++) {
        es_world_rereference(world, ES_OBJECT_BODY, 0, handles[side].id);
        es_body_object* body = body_at(world, handles[side]);
        if (body) body->joints++;
        wake(world, handles[side]);
        touch_proxies(world, handles[side]);
    }
    joint->id = object->object.id;
    return ES_OK;
}

es_result es_world_set_joint(es_world* world, es_joint joint, const es_joint_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_joint_object* object = es_world_object(world, ES_OBJECT_JOINT, joint.id);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_joint: desc must not be NULL");
    es_joint_desc wanted = *desc;
    wanted.type = object->desc.type;
    wanted.a = object->desc.a;
    wanted.b = object->desc.b;
    es_result result = check(world, &wanted, object->object.name ? object->object.name : "");
    if (result != ES_OK) return result;
    es_fp_environment environment = es_fp_enter();
    take_numbers(world, object, &wanted);
    es_fp_leave(environment);
    wake(world, object->desc.a);
    wake(world, object->desc.b);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_JOINT, .id = joint.id, .joint = wanted});
    return ES_OK;
}

es_result es_world_get_joint(const es_world* world, es_joint joint, es_joint_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    const es_joint_object* object = es_world_object(world, ES_OBJECT_JOINT, joint.id);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name;
    return ES_OK;
}

es_result es_world_get_joint_state(const es_world* world, es_joint joint, es_joint_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_joint_object* object = es_world_object(world, ES_OBJECT_JOINT, joint.id);
    if (!object) return ES_STALE_HANDLE;
    double p[2][3];
    es_quat q[2];
    const es_body handles[2] = {object->desc.a, object->desc.b};
    es_fp_environment environment = es_fp_enter();
    for (int side = 0; side < 2; side++) frame_in_world(world, handles[side], &object->frame[side], p[side], &q[side]);
    es_vec3 way = es_v3((float)(p[1][0] - p[0][0]), (float)(p[1][1] - p[0][1]), (float)(p[1][2] - p[0][2]));
    *state = (es_joint_state){object->force, object->torque, object->desc.type == ES_JOINT_HINGE ? es_joint_angle(q[0], q[1]) : es_v3_length(way), object->broken};
    es_fp_leave(environment);
    return ES_OK;
}

es_result es_world_destroy_joint(es_world* world, es_joint joint)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_joint_object* object = es_world_object(world, ES_OBJECT_JOINT, joint.id);
    if (!object) return ES_STALE_HANDLE;
    const es_body handles[2] = {object->desc.a, object->desc.b};
    for (int side = 0; side < 2; side++) {
        wake(world, handles[side]);
        es_world_rereference(world, ES_OBJECT_BODY, handles[side].id, 0);
        es_body_object* body = body_at(world, handles[side]);
        if (body) body->joints--;
    }
    es_slots_remove(world->context, &world->slots[ES_OBJECT_JOINT], &object->object);
    for (int side = 0; side < 2; side++) touch_proxies(world, handles[side]);
    return ES_OK;
}

/* ---- for the others ------------------------------------------------------------------------------------------------------------ */

bool es_joint_keeps_apart(const es_world* world, const es_body_object* a, const es_body_object* b)
{
    if (!a->joints || !b->joints) return false;
    const es_slots* slots = &world->slots[ES_OBJECT_JOINT];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_joint_object* joint = es_slots_at(slots, slot);
        if (!joint || joint->desc.collide_connected) continue;
        uint32_t p = joint->desc.a.id, q = joint->desc.b.id;
        if ((p == a->object.id && q == b->object.id) || (p == b->object.id && q == a->object.id)) return true;
    }
    return false;
}

void es_joints_unite(es_world* world, uint32_t* parents, void (*join)(uint32_t* parents, uint32_t a, uint32_t b))
{
    const es_slots* slots = &world->slots[ES_OBJECT_JOINT];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_joint_object* joint = es_slots_at(slots, slot);
        if (!joint || joint->broken) continue;
        const es_body_object *a = body_at(world, joint->desc.a), *b = body_at(world, joint->desc.b);
        if (a && b && a->type == ES_BODY_DYNAMIC && b->type == ES_BODY_DYNAMIC && !a->asleep && !b->asleep) join(parents, a->index, b->index);
    }
}

void es_joints_wake(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_JOINT];
    bool again = true;
    while (again) { /* chains of joints wake link by link */
        again = false;
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            const es_joint_object* joint = es_slots_at(slots, slot);
            if (!joint || joint->broken) continue;
            es_body_object *a = body_at(world, joint->desc.a), *b = body_at(world, joint->desc.b);
            if (!a || !b || a->asleep == b->asleep) continue;
            es_body_object *sleeper = a->asleep ? a : b, *other = a->asleep ? b : a;
            if (!es_body_is_awake(other)) continue;
            es_body_wake(world, sleeper);
            again = true;
        }
    }
}

/* ---- state ----------------------------------------------------------------------------------------------------------------------- */

static bool is_unit(es_quat q) { return es_within(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w, 0.99f, 1.01f); }

void es_visit_joint(es_world* world, state_io* io, es_joint_object* joint)
{
    es_joint_object now = *joint;
    es_joint_desc* d = &now.desc;
    visit_floats(io, &d->position_a.x, 3);
    visit_floats(io, &d->position_b.x, 3);
    visit_floats(io, &d->rotation_a.x, 4);
    visit_floats(io, &d->rotation_b.x, 4);
    visit_flag(io, &d->limit);
    visit_flag(io, &d->motor);
    float* numbers[] = {&d->lower, &d->upper, &d->speed, &d->length, &d->hertz, &d->damping_ratio, &d->max_force, &d->max_torque, &d->break_force, &d->break_torque};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) visit_floats(io, numbers[i], 1);
    visit_floats(io, &d->velocity.x, 3);
    visit_floats(io, &d->angular_velocity.x, 3);
    float* impulses[] = {&now.lower_impulse, &now.upper_impulse, &now.motor_impulse, &now.spring_impulse};
    for (size_t i = 0; i < sizeof impulses / sizeof impulses[0]; i++) {
        visit_floats(io, impulses[i], 1);
        if (reading(io)) io->good &= es_within(*impulses[i], -1e30f, 1e30f);
    }
    es_vec3* vectors[] = {&now.linear, &now.angular, &now.force, &now.torque};
    for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; i++) {
        visit_floats(io, &vectors[i]->x, 3);
        if (reading(io)) io->good &= es_all_within(&vectors[i]->x, 3, 1e30f);
    }
    visit_flag(io, &now.broken);
    if (!reading(io) || !io->good) return;
    io->good = check(world, d, joint->object.name ? joint->object.name : "") == ES_OK && (d->type != ES_JOINT_DISTANCE || d->length >= 0) && is_unit(d->rotation_a) && is_unit(d->rotation_b);
    if (io->mode != APPLY || !io->good) return;
    *joint = now;
    /* not take_numbers: a rotation that is normalised again may change its last bits */
    set_frame(world, d->a, d->position_a, d->rotation_a, &joint->frame[0]);
    set_frame(world, d->b, d->position_b, d->rotation_b, &joint->frame[1]);
}

void es_joint_signature(const es_joint_object* joint, uint32_t words[2])
{
    words[0] = (uint32_t)joint->desc.type | (uint32_t)joint->desc.collide_connected << 8 | joint->desc.a.id << 9;
    words[1] = joint->desc.b.id;
}
