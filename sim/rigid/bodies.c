/* Bodies: adding, asking, pushing. */
#include <stdio.h>
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/hands.h"
#include "sim/rigid/joints.h"
#include "sim/rigid/node_pose.h"
#include "sim/rigid/rigid.h"
#include "sim/recording.h"

es_body_desc es_default_body_desc(void)
{
    return (es_body_desc){.type = ES_BODY_DYNAMIC, .rotation = {0, 0, 0, 1}, .gravity_scale = 1};
}

es_rigid* es_rigid_of(es_world* world)
{
    if (world->rigid) return world->rigid;
    es_rigid* rigid = es_allocate_zero(world->context, sizeof *rigid);
    if (!rigid) return NULL;
    es_dynamic_tree_init(&rigid->tree, world->context);
    world->rigid = rigid;
    return rigid;
}

void es_body_free(es_world* world, es_body_object* body)
{
    for (uint32_t i = 0; i < body->shape_count; i++) es_rigid_shape_free(world->context, &body->shapes[i]);
    es_release(world->context, body->shapes, body->shape_count * sizeof *body->shapes);
    es_release(world->context, body->proxies, body->shape_count * sizeof *body->proxies);
    body->shapes = NULL;
    body->proxies = NULL;
    body->shape_count = 0;
}

static void free_contacts(es_context* context, es_contacts* contacts)
{
    es_release(context, contacts->list, contacts->capacity * sizeof *contacts->list);
    es_release(context, contacts->manifolds, contacts->manifold_capacity * sizeof *contacts->manifolds);
}

void es_rigid_free(es_world* world)
{
    es_context* context = world->context;
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_BODY].slot_count; slot++) {
        es_body_object* body = es_slots_at(&world->slots[ES_OBJECT_BODY], slot);
        if (body) es_body_free(world, body);
    }
    es_rigid* rigid = world->rigid;
    if (!rigid) return;
    es_dynamic_tree_free(&rigid->tree);
    free_contacts(context, &rigid->contacts);
    free_contacts(context, &rigid->next);
    free_contacts(context, &rigid->asleep);
    free_contacts(context, &rigid->next_asleep);
    es_release(context, rigid->parents, rigid->parent_capacity * sizeof *rigid->parents);
    es_release(context, rigid->stillness, rigid->stillness_capacity * sizeof *rigid->stillness);
    es_release(context, rigid->starts, rigid->start_capacity * sizeof *rigid->starts);
    es_release(context, rigid->moving, rigid->moving_capacity * sizeof *rigid->moving);
    es_release(context, rigid->events, rigid->event_capacity * sizeof *rigid->events);
    es_joint_solver_free(context, rigid);
    es_solver_free(context, rigid->solver);
    es_release(context, rigid, sizeof *rigid);
    world->rigid = NULL;
}

/* ---- places -------------------------------------------------------------------------------------------------------------- */

void es_body_position(const es_body_object* body, const double centre[3], es_quat rotation, double position[3])
{
    es_vec3 offset = es_quat_rotate(rotation, body->local_centre);
    position[0] = centre[0] - (double)offset.x;
    position[1] = centre[1] - (double)offset.y;
    position[2] = centre[2] - (double)offset.z;
}

es_pose es_body_pose(const es_body_object* body, const double origin[3])
{
    es_vec3 offset = body->local_centre;
    if (offset.x != 0 || offset.y != 0 || offset.z != 0) offset = es_quat_rotate(body->rotation, offset);
    return (es_pose){es_v3((float)(body->centre[0] - origin[0]) - offset.x, (float)(body->centre[1] - origin[1]) - offset.y,
                         (float)(body->centre[2] - origin[2]) - offset.z),
        body->rotation};
}

void es_body_place(es_body_object* body, const double position[3], es_quat rotation)
{
    es_vec3 offset = es_quat_rotate(rotation, body->local_centre);
    body->rotation = rotation;
    body->centre[0] = position[0] + (double)offset.x;
    body->centre[1] = position[1] + (double)offset.y;
    body->centre[2] = position[2] + (double)offset.z;
}

static float limited(double v) { return (float)(v > (double)ES_MAX_SPEED ? (double)ES_MAX_SPEED : v < -(double)ES_MAX_SPEED ? -(double)ES_MAX_SPEED : v); }

/* In double: whatever forces and masses are allowed, nothing overflows before it is limited. */
void es_body_push(es_body_object* body, es_vec3 impulse, es_vec3 angular_impulse)
{
    double m = body->inverse_mass;
    body->velocity.x = limited((double)body->velocity.x + m * (double)impulse.x);
    body->velocity.y = limited((double)body->velocity.y + m * (double)impulse.y);
    body->velocity.z = limited((double)body->velocity.z + m * (double)impulse.z);
    es_quat q = body->rotation, back = {-q.x, -q.y, -q.z, q.w};
    es_vec3 l = es_quat_rotate(back, angular_impulse);
    const float* i = body->inverse_inertia;
    double t[3] = {(double)i[0] * l.x + (double)i[3] * l.y + (double)i[4] * l.z, (double)i[3] * l.x + (double)i[1] * l.y + (double)i[5] * l.z,
        (double)i[4] * l.x + (double)i[5] * l.y + (double)i[2] * l.z};
    es_vec3 turn = es_quat_rotate(q, es_v3(limited(t[0]), limited(t[1]), limited(t[2])));
    body->angular_velocity.x = limited((double)body->angular_velocity.x + (double)turn.x);
    body->angular_velocity.y = limited((double)body->angular_velocity.y + (double)turn.y);
    body->angular_velocity.z = limited((double)body->angular_velocity.z + (double)turn.z);
}

static void forget_motion(es_body_object* body)
{
    memcpy(body->previous_centre, body->centre, sizeof body->centre);
    body->previous_rotation = body->rotation;
}

static bool good_place(const double position[3], const es_quat* rotation)
{
    bool good = es_all_within(&rotation->x, 4, ES_WORLD_EXTENT);
    for (int k = 0; k < 3; k++) good &= position[k] >= -(double)ES_WORLD_EXTENT && position[k] <= (double)ES_WORLD_EXTENT;
    return good;
}

static bool zero_rotation(es_quat q) { return q.x == 0 && q.y == 0 && q.z == 0 && q.w == 0; }

/* ---- life ---------------------------------------------------------------------------------------------------------------- */

static es_result check(es_world* world, const es_body_desc* desc, const char* name)
{
    es_context* context = world->context;
    if ((uint32_t)desc->type > ES_BODY_DYNAMIC) return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': its type does not exist", name);
    if (desc->shape_count > ES_SHAPES_PER_BODY || (desc->shape_count && !desc->shapes))
        return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': %u shapes; 0 … %d are possible, and must be given", name, desc->shape_count, ES_SHAPES_PER_BODY);
    if (!(desc->mass == 0 || es_within(desc->mass, 1e-6f, 1e9f)))
        return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': mass %g; it must be 0 (by density) or lie in 1e-6 … 1e9 kg", name, (double)desc->mass);
    if (!es_all_within(&desc->velocity.x, 3, ES_MAX_SPEED) || !es_all_within(&desc->angular_velocity.x, 3, ES_MAX_SPEED))
        return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': velocities must be finite and within %g", name, (double)ES_MAX_SPEED);
    if (!es_within(desc->linear_damping, 0, 1e6f) || !es_within(desc->angular_damping, 0, 1e6f) || !es_within(desc->gravity_scale, -1e3f, 1e3f))
        return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': dampings must lie in 0 … 1e6, the gravity scale in -1000 … 1000", name);
    if (!desc->node.id && !good_place(desc->position, &desc->rotation))
        return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': its place must be finite and within 1e9", name);
    for (uint32_t i = 0; i < desc->shape_count; i++)
        if (desc->type == ES_BODY_DYNAMIC && desc->shapes[i].type == ES_SHAPE_MESH)
            return es_fail(context, ES_INVALID_ARGUMENT, "body '%.64s': shape %u is a mesh; dynamic bodies take hulls", name, i);
    return ES_OK;
}

static bool make_shapes(es_world* world, const es_body_desc* desc, const char* name, es_body_object* body)
{
    es_context* context = world->context;
    if (desc->shape_count == 0) return true;
    body->shapes = es_allocate_zero(context, desc->shape_count * sizeof *body->shapes);
    if (!body->shapes) return false;
    body->proxies = es_allocate_array(context, desc->shape_count, sizeof *body->proxies);
    if (!body->proxies) {
        es_release(context, body->shapes, desc->shape_count * sizeof *body->shapes);
        body->shapes = NULL;
        return false;
    }
    body->shape_count = desc->shape_count;
    for (uint32_t i = 0; i < desc->shape_count; i++) body->proxies[i] = ES_NO_PROXY;
    char what[80];
    snprintf(what, sizeof what, "body '%.64s'", name);
    for (uint32_t i = 0; i < desc->shape_count; i++)
        if (es_rigid_shape_make(world, &desc->shapes[i], what, &body->shapes[i]) != ES_OK) return false;
    return true;
}

es_result es_world_add_body(es_world* world, const es_body_desc* desc, es_body* body)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !body) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_body: desc and body must not be NULL");
    *body = (es_body){0};
    const char* name = desc->name ? desc->name : "";
    es_result result = check(world, desc, name);
    if (result != ES_OK) return result;
    if (desc->node.id && !es_world_object(world, ES_OBJECT_NODE, desc->node.id)) return ES_STALE_HANDLE;
    if (desc->node.id && desc->type == ES_BODY_DYNAMIC && es_node_is_below_scale(world, desc->node))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': its node is below a scaled or mirrored one; a dynamic body cannot drive it", name);
    es_rigid* rigid = es_rigid_of(world);
    if (!rigid) return es_context_last_result(world->context);
    bool first = world->slots[ES_OBJECT_BODY].live == 0;
    es_body_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_BODY], "body", desc->name);
    if (!object) return es_context_last_result(world->context);
    es_fp_environment environment = es_fp_enter();
    object->type = desc->type;
    bool good = make_shapes(world, desc, name, object) && es_body_set_mass(world, object, desc->mass, name);
    if (good) {
        double position[3] = {desc->position[0], desc->position[1], desc->position[2]};
        es_quat rotation = zero_rotation(desc->rotation) ? es_quat_identity() : es_quat_normalize(desc->rotation);
        if (desc->node.id) es_node_get_pose(world, desc->node, position, &rotation);
        es_body_place(object, position, rotation);
        forget_motion(object);
        memcpy(object->seen_position, position, sizeof position);
        object->seen_rotation = rotation;
        /* boxes far from zero keep their precision when zero is near; multiples of 1024 leave near ones exactly as they are */
        if (first)
            for (int k = 0; k < 3; k++) rigid->origin[k] = __builtin_fabs(position[k]) < 4096 ? 0 : 1024.0 * (double)(int64_t)(position[k] / 1024.0);
        object->node = desc->node;
        if (desc->type != ES_BODY_STATIC) {
            object->velocity = desc->velocity;
            object->angular_velocity = desc->angular_velocity;
        }
        object->linear_damping = desc->linear_damping;
        object->angular_damping = desc->angular_damping;
        object->gravity_scale = desc->gravity_scale;
        object->no_sleep = desc->no_sleep;
        object->continuous = desc->continuous;
        object->asleep = desc->type == ES_BODY_DYNAMIC && desc->asleep && !desc->no_sleep;
        object->island = es_slot_of(object->object.id);
        object->index = UINT32_MAX;
        good = es_body_enter_tree(world, object);
    }
    es_fp_leave(environment);
    if (!good) {
        result = es_context_last_result(world->context);
        es_body_leave_tree(world, object);
        es_body_free(world, object);
        es_slots_remove(world->context, &world->slots[ES_OBJECT_BODY], &object->object);
        return result;
    }
    es_world_rereference(world, ES_OBJECT_NODE, 0, desc->node.id);
    body->id = object->object.id;
    return ES_OK;
}

es_result es_world_destroy_body(es_world* world, es_body body)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "body '%.64s' cannot be destroyed: %u joints or attachments use it", object->object.name ? object->object.name : "",
            object->object.references);
    es_hands_forget(world, ES_OBJECT_BODY, body.id);
    es_body_wake_neighbours(world, object);
    es_body_drop_contacts(world, object);
    es_body_leave_tree(world, object);
    es_world_rereference(world, ES_OBJECT_NODE, object->node.id, 0);
    es_body_free(world, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_BODY], &object->object);
    return ES_OK;
}

/* ---- asking ---------------------------------------------------------------------------------------------------------------- */

/* 1/2 m v² + 1/2 ω·Iω, with ω in the body's axes, where I is kept. */
static float kinetic_energy(const es_body_object* object)
{
    if (object->type != ES_BODY_DYNAMIC) return 0;
    const es_vec3 v = object->velocity, w = es_quat_rotate((es_quat){-object->rotation.x, -object->rotation.y, -object->rotation.z, object->rotation.w}, object->angular_velocity);
    const float* i = object->inertia;
    const double x = (double)w.x, y = (double)w.y, z = (double)w.z;
    double twice = (double)object->mass * ((double)v.x * (double)v.x + (double)v.y * (double)v.y + (double)v.z * (double)v.z);
    twice += (double)i[0] * x * x + (double)i[1] * y * y + (double)i[2] * z * z + 2 * ((double)i[3] * x * y + (double)i[4] * x * z + (double)i[5] * y * z);
    return (float)(0.5 * twice);
}

es_result es_world_get_body(const es_world* world, es_body body, es_body_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    *state = (es_body_state){
        .type = object->type,
        .node = object->node,
        .rotation = object->rotation,
        .centre = {object->centre[0], object->centre[1], object->centre[2]},
        .local_centre = object->local_centre,
        .velocity = object->velocity,
        .angular_velocity = object->angular_velocity,
        .mass = object->mass,
        .kinetic_energy = kinetic_energy(object),
        .linear_damping = object->linear_damping,
        .angular_damping = object->angular_damping,
        .gravity_scale = object->gravity_scale,
        .shape_count = object->shape_count,
        .no_sleep = object->no_sleep,
        .asleep = object->asleep,
        .continuous = object->continuous,
    };
    es_body_position(object, object->centre, object->rotation, state->position);
    return ES_OK;
}

/* ---- pushing --------------------------------------------------------------------------------------------------------------- */

es_result es_world_set_body_pose(es_world* world, es_body body, const double position[3], es_quat rotation)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    if (!position || !good_place(position, &rotation))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': its place must be finite and within 1e9", object->object.name ? object->object.name : "");
    es_body_wake(world, object);
    es_body_wake_neighbours(world, object);
    es_fp_environment environment = es_fp_enter();
    es_body_place(object, position, zero_rotation(rotation) ? es_quat_identity() : es_quat_normalize(rotation));
    forget_motion(object);
    es_body_refresh_tree(world, object, es_v3(0, 0, 0));
    if (object->type == ES_BODY_DYNAMIC && object->node.id) es_node_set_pose(world, object->node, position, object->rotation);
    es_fp_leave(environment);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_BODY_POSE, .id = body.id, .place = {position[0], position[1], position[2]}, .rotation = rotation});
    return ES_OK;
}

es_result es_world_set_body_velocity(es_world* world, es_body body, es_vec3 velocity, es_vec3 angular_velocity)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    const char* name = object->object.name ? object->object.name : "";
    if (object->type == ES_BODY_STATIC) return es_fail(world->context, ES_WRONG_STATE, "body '%.64s' is static and has no velocity", name);
    if (!es_all_within(&velocity.x, 3, ES_MAX_SPEED) || !es_all_within(&angular_velocity.x, 3, ES_MAX_SPEED))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': velocities must be finite and within %g", name, (double)ES_MAX_SPEED);
    object->velocity = velocity;
    object->angular_velocity = angular_velocity;
    es_body_wake(world, object);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_BODY_VELOCITY, .id = body.id, .a = velocity, .b = angular_velocity});
    return ES_OK;
}

/* The body to push and the lever from its centre; NULL when there is nothing to do, with what to return. */
static es_body_object* pushed(es_world* world, es_body body, const es_vec3* push, const double at[3], const char* what, es_vec3* lever, es_result* result)
{
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    *result = ES_STALE_HANDLE;
    if (!object) return NULL;
    const char* name = object->object.name ? object->object.name : "";
    bool good = es_all_within(&push->x, 3, 1e15f);
    for (int k = 0; at && k < 3; k++) good &= at[k] >= -(double)ES_WORLD_EXTENT && at[k] <= (double)ES_WORLD_EXTENT;
    if (!good) {
        *result = es_fail(world->context, ES_INVALID_ARGUMENT, "body '%.64s': the %s must be finite and within 1e15, its place within 1e9", name, what);
        return NULL;
    }
    if (object->type == ES_BODY_STATIC) {
        *result = es_fail(world->context, ES_WRONG_STATE, "body '%.64s' is static; no %s moves it", name, what);
        return NULL;
    }
    *result = ES_OK;
    *lever = at ? es_v3((float)(at[0] - object->centre[0]), (float)(at[1] - object->centre[1]), (float)(at[2] - object->centre[2])) : es_v3(0, 0, 0);
    return object->type == ES_BODY_DYNAMIC ? object : NULL;
}

static void note_push(es_world* world, es_input_type type, es_body body, es_vec3 push, const double at[3])
{
    if (!world->recording) return;
    es_input input = {.type = type, .id = body.id, .a = push, .flag = at != NULL};
    for (int k = 0; at && k < 3; k++) input.place[k] = at[k];
    es_note(world, &input);
}

es_result es_world_apply_impulse(es_world* world, es_body body, es_vec3 impulse, const double at[3])
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_result result;
    es_vec3 lever;
    es_fp_environment environment = es_fp_enter();
    es_body_object* object = pushed(world, body, &impulse, at, "impulse", &lever, &result);
    if (object) es_body_push(object, impulse, es_v3_cross(lever, impulse));
    es_fp_leave(environment);
    if (!object) return result;
    es_body_wake(world, object);
    note_push(world, ES_INPUT_IMPULSE, body, impulse, at);
    return ES_OK;
}

es_result es_world_apply_force(es_world* world, es_body body, es_vec3 force, const double at[3])
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_result result;
    es_vec3 lever;
    es_fp_environment environment = es_fp_enter();
    es_body_object* object = pushed(world, body, &force, at, "force", &lever, &result);
    if (object) {
        es_vec3 sum = es_v3_add(object->force, force), torque = es_v3_add(object->torque, es_v3_cross(lever, force));
        for (int k = 0; k < 3; k++) {
            (&object->force.x)[k] = es_clampf((&sum.x)[k], -1e18f, 1e18f);
            (&object->torque.x)[k] = es_clampf((&torque.x)[k], -1e24f, 1e24f);
        }
    }
    es_fp_leave(environment);
    if (!object) return result;
    es_body_wake(world, object);
    note_push(world, ES_INPUT_FORCE, body, force, at);
    return ES_OK;
}

es_result es_world_wake_body(es_world* world, es_body body)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_body_object* object = es_world_object(world, ES_OBJECT_BODY, body.id);
    if (!object) return ES_STALE_HANDLE;
    es_body_wake(world, object);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_WAKE, .id = body.id});
    return ES_OK;
}

const es_contact_event* es_world_contact_events(const es_world* world, size_t* count)
{
    const es_rigid* rigid = world ? world->rigid : NULL;
    if (count) *count = rigid ? rigid->event_count : 0;
    return rigid ? rigid->events : NULL;
}
