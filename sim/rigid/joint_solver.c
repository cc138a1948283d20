/* Joints as constraints: what they do in each substep.
 *
 * Frames are taken to where the bodies are in every substep, so that wheels and pendulums stay exact. Points are held by a 3 × 3 block, turns
 * by another; axes, limits, motors and springs are rows of their own. One thread solves all joints, in slot order: there are few, and
 * chains converge best from one end to the other. */
#include <string.h>

#include "platform/maths.h"
#include "sim/rigid/hands.h"
#include "sim/rigid/joints.h"

#define JOINT_HERTZ 60.0f
#define JOINT_DAMPING 2.0f

typedef struct softness { float bias_rate, mass_scale, impulse_scale; } softness;
static const softness rigid_softness = {0, 1, 0};

typedef struct es_joint_rows {
    es_joint_object* joint;
    uint32_t a, b;                 /* records */
    es_vec3 apart;                 /* from a's centre of mass to b's when the step began, or from one frame to the other */
    es_quat q[2];                  /* of bodies that have no record of their own */
    bool fixed[2];
} es_joint_rows;

/* 2 atan2 of the twist about z of the relative rotation */
float es_joint_angle(es_quat a, es_quat b)
{
    es_quat d = es_quat_mul((es_quat){-a.x, -a.y, -a.z, a.w}, b);
    if (d.w < 0) d = (es_quat){-d.x, -d.y, -d.z, -d.w};
    return 2.0f * es_atan2(d.z, d.w);
}

/* ---- small algebra -------------------------------------------------------------------------------------------------------------- */

typedef struct mat3 { float m[3][3]; } mat3; /* rows */

static es_vec3 inertia_times(const float* mass, es_vec3 v)
{
    return es_v3(mass[0] * v.x + mass[3] * v.y + mass[4] * v.z, mass[3] * v.x + mass[1] * v.y + mass[5] * v.z, mass[4] * v.x + mass[5] * v.y + mass[2] * v.z);
}

/* Cramer in double; zero when singular. */
static es_vec3 solve3(const mat3* k, es_vec3 v)
{
    double a = k->m[0][0], b = k->m[0][1], c = k->m[0][2], d = k->m[1][0], e = k->m[1][1], f = k->m[1][2], g = k->m[2][0], h = k->m[2][1], i = k->m[2][2];
    double A = e * i - f * h, B = c * h - b * i, C = b * f - c * e, D = f * g - d * i, E = a * i - c * g, F = c * d - a * f, G = d * h - e * g, H = b * g - a * h, I = a * e - b * d;
    double det = a * A + b * D + c * G;
    if (!(det > 1e-300)) return es_v3(0, 0, 0);
    double x = v.x, y = v.y, z = v.z;
    return es_v3((float)((A * x + B * y + C * z) / det), (float)((D * x + E * y + F * z) / det), (float)((G * x + H * y + I * z) / det));
}

static void add_inertia(mat3* k, const float* mass)
{
    const float full[3][3] = {{mass[0], mass[3], mass[4]}, {mass[3], mass[1], mass[5]}, {mass[4], mass[5], mass[2]}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) k->m[i][j] += full[i][j];
}

/* m I - [r] I⁻¹ [r], what an impulse at r gives there */
static void add_point(mat3* k, const float* mass, es_vec3 r)
{
    const es_vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int j = 0; j < 3; j++) {
        es_vec3 v = es_v3_cross(inertia_times(mass, es_v3_cross(r, axes[j])), r);
        for (int i = 0; i < 3; i++) k->m[i][j] += (&v.x)[i] + (i == j ? mass[6] : 0.0f);
    }
}

/* ---- two bodies and how to push them -------------------------------------------------------------------------------------------------- */

typedef struct pair {
    const es_solver_job* job;
    uint32_t a, b;
    float *va, *vb;                /* velocity records */
    const float *ma, *mb;          /* mass records */
    es_vec3 ra, rb;                /* arms to the joint's frames */
    es_quat qa, qb;                /* the frames */
    es_vec3 gap;                   /* from a's frame to b's */
} pair;

static es_vec3 linear_of(const float* record) { return es_v3(record[0], record[1], record[2]); }
static es_vec3 angular_of(const float* record) { return es_v3(record[4], record[5], record[6]); }

static void change(float* record, es_vec3 v, es_vec3 w)
{
    record[0] += v.x;
    record[1] += v.y;
    record[2] += v.z;
    record[4] += w.x;
    record[5] += w.y;
    record[6] += w.z;
}

static void push_at(const pair* p, es_vec3 impulse)
{
    if (p->a < p->job->bodies.dynamic) change(p->va, es_v3_scale(impulse, -p->ma[6]), es_v3_scale(inertia_times(p->ma, es_v3_cross(p->ra, impulse)), -1));
    if (p->b < p->job->bodies.dynamic) change(p->vb, es_v3_scale(impulse, p->mb[6]), inertia_times(p->mb, es_v3_cross(p->rb, impulse)));
}

static void turn_both(const pair* p, es_vec3 impulse)
{
    const es_vec3 none = {0, 0, 0};
    if (p->a < p->job->bodies.dynamic) change(p->va, none, es_v3_scale(inertia_times(p->ma, impulse), -1));
    if (p->b < p->job->bodies.dynamic) change(p->vb, none, inertia_times(p->mb, impulse));
}

static es_vec3 speed_between(const pair* p)
{
    return es_v3_sub(es_v3_add(linear_of(p->vb), es_v3_cross(angular_of(p->vb), p->rb)), es_v3_add(linear_of(p->va), es_v3_cross(angular_of(p->va), p->ra)));
}
static es_vec3 turn_between(const pair* p) { return es_v3_sub(angular_of(p->vb), angular_of(p->va)); }

static float inverse_or_zero(float x) { return x > 0 ? 1.0f / x : 0.0f; }

static float mass_along(const pair* p, es_vec3 n)
{
    es_vec3 ca = es_v3_cross(p->ra, n), cb = es_v3_cross(p->rb, n);
    return inverse_or_zero(p->ma[6] + p->mb[6] + es_v3_dot(inertia_times(p->ma, ca), ca) + es_v3_dot(inertia_times(p->mb, cb), cb));
}

static float mass_about(const pair* p, es_vec3 n) { return inverse_or_zero(es_v3_dot(inertia_times(p->ma, n), n) + es_v3_dot(inertia_times(p->mb, n), n)); }

static softness soften(float h, float hertz, float damping)
{
    float omega = 2.0f * ES_PI * hertz, a1 = 2.0f * damping + h * omega, a2 = h * omega * a1, a3 = 1.0f / (1.0f + a2);
    return (softness){omega / a1, a2 * a3, a3};
}

static es_vec3 limited(es_vec3 v, float limit)
{
    float length = es_v3_length(v);
    return length > limit ? es_v3_scale(v, limit / length) : v;
}

/* ---- constraints --------------------------------------------------------------------------------------------------------------- */

static void hold_point(const pair* p, softness soft, es_vec3 target_speed, float limit, es_vec3* impulse)
{
    mat3 k = {{{0}}};
    add_point(&k, p->ma, p->ra);
    add_point(&k, p->mb, p->rb);
    es_vec3 rate = es_v3_add(es_v3_sub(speed_between(p), target_speed), es_v3_scale(p->gap, soft.bias_rate));
    es_vec3 now = es_v3_sub(es_v3_scale(*impulse, 1.0f - soft.impulse_scale), es_v3_scale(solve3(&k, rate), soft.mass_scale));
    now = limited(now, limit);
    push_at(p, es_v3_sub(now, *impulse));
    *impulse = now;
}

/* error: rotation vector from a's frame to b's, world axes */
static void hold_turn(const pair* p, softness soft, es_vec3 error, es_vec3 target_speed, float limit, es_vec3* impulse)
{
    mat3 k = {{{0}}};
    add_inertia(&k, p->ma);
    add_inertia(&k, p->mb);
    es_vec3 rate = es_v3_add(es_v3_sub(turn_between(p), target_speed), es_v3_scale(error, soft.bias_rate));
    es_vec3 now = es_v3_sub(es_v3_scale(*impulse, 1.0f - soft.impulse_scale), es_v3_scale(solve3(&k, rate), soft.mass_scale));
    now = limited(now, limit);
    turn_both(p, es_v3_sub(now, *impulse));
    *impulse = now;
}

typedef struct row { es_vec3 n; bool angular; float mass; } row;
static row row_along(const pair* p, es_vec3 n) { return (row){n, false, mass_along(p, n)}; }
static row row_about(const pair* p, es_vec3 n) { return (row){n, true, mass_about(p, n)}; }

static void solve_row(const pair* p, const row* r, softness soft, float error, float target_speed, float low, float high, float* impulse)
{
    float speed = es_v3_dot(r->n, r->angular ? turn_between(p) : speed_between(p)) - target_speed;
    float now = *impulse - r->mass * soft.mass_scale * (speed + soft.bias_rate * error) - soft.impulse_scale * *impulse;
    now = es_clampf(now, low, high);
    es_vec3 push = es_v3_scale(r->n, now - *impulse);
    if (r->angular) turn_both(p, push);
    else push_at(p, push);
    *impulse = now;
}

/* One side of a limit: room is how far away it is, negative beyond. `sign` 1: the row's speed closes on the limit when negative. */
static void solve_limit(const pair* p, const row* r, softness soft, bool push, float room, float sign, float* impulse)
{
    row side = *r;
    side.n = es_v3_scale(r->n, sign);
    if (room > 0) solve_row(p, &side, rigid_softness, 0, -room * p->job->inverse_h, 0, 1e30f, impulse);
    else solve_row(p, &side, push ? soft : rigid_softness, push ? room : 0, 0, 0, 1e30f, impulse);
}

static es_vec3 axis_of(es_quat q, int k) { return es_quat_rotate(q, es_v3(k == 0, k == 1, k == 2)); }

static es_vec3 rotation_error(const pair* p)
{
    es_quat d = es_quat_mul(p->qb, (es_quat){-p->qa.x, -p->qa.y, -p->qa.z, p->qa.w});
    float sign = d.w < 0 ? -2.0f : 2.0f;
    return es_v3_scale(es_v3(d.x, d.y, d.z), sign);
}

static void solve_joint(const pair* p, es_joint_object* j, bool push)
{
    const es_joint_desc* d = &j->desc;
    float h = p->job->h;
    const softness stiff = push ? soften(h, es_minf(JOINT_HERTZ, 0.25f * p->job->inverse_h), JOINT_DAMPING) : rigid_softness;
    const softness spring = d->hertz > 0 ? soften(h, d->hertz, d->damping_ratio) : rigid_softness;
    const es_vec3 none = {0, 0, 0};
    switch (d->type) {
    case ES_JOINT_BALL: hold_point(p, d->hertz > 0 ? spring : stiff, none, 1e30f, &j->linear); break;
    case ES_JOINT_FIXED:
        hold_turn(p, d->hertz > 0 ? spring : stiff, rotation_error(p), none, 1e30f, &j->angular);
        hold_point(p, d->hertz > 0 ? spring : stiff, none, 1e30f, &j->linear);
        break;
    case ES_JOINT_MOTOR: {
        es_vec3 error = rotation_error(p), turn = es_quat_rotate(p->qa, d->angular_velocity), speed = es_quat_rotate(p->qa, d->velocity);
        hold_turn(p, spring, error, turn, d->max_torque * h, &j->angular);
        hold_point(p, spring, speed, d->max_force * h, &j->linear);
        break;
    }
    case ES_JOINT_HINGE: {
        es_vec3 axis = axis_of(p->qa, 2), other = axis_of(p->qb, 2);
        row about = row_about(p, axis);
        if (d->hertz > 0) solve_row(p, &about, spring, es_joint_angle(p->qa, p->qb), 0, -1e30f, 1e30f, &j->spring_impulse);
        if (d->motor) solve_row(p, &about, rigid_softness, 0, d->speed, -d->max_torque * h, d->max_torque * h, &j->motor_impulse);
        if (d->limit) {
            float angle = es_joint_angle(p->qa, p->qb);
            solve_limit(p, &about, stiff, push, angle - d->lower, 1, &j->lower_impulse);
            solve_limit(p, &about, stiff, push, d->upper - angle, -1, &j->upper_impulse);
        }
        for (int k = 0; k < 2; k++) { /* the other axis has no part along this one's x and y */
            es_vec3 side = axis_of(p->qa, k);
            row swing = row_about(p, es_v3_cross(other, side));
            solve_row(p, &swing, stiff, es_v3_dot(side, other), 0, -1e30f, 1e30f, k == 0 ? &j->angular.x : &j->angular.y);
        }
        hold_point(p, stiff, none, 1e30f, &j->linear);
        break;
    }
    case ES_JOINT_DISTANCE: {
        float length = es_v3_length(p->gap);
        row along = row_along(p, es_v3_normalize(p->gap, es_v3(0, 1, 0)));
        bool rod = !(d->hertz > 0) && !d->limit && !d->motor;
        if (d->hertz > 0 || rod) solve_row(p, &along, rod ? stiff : spring, length - d->length, 0, -1e30f, 1e30f, &j->spring_impulse);
        if (d->motor) solve_row(p, &along, rigid_softness, 0, d->speed, -d->max_force * h, d->max_force * h, &j->motor_impulse);
        if (d->limit) {
            solve_limit(p, &along, stiff, push, length - d->lower, 1, &j->lower_impulse);
            solve_limit(p, &along, stiff, push, d->upper - length, -1, &j->upper_impulse);
        }
        break;
    }
    }
}

/* The sums of all impulses, as force and as torque about the joint. */
static void sum_impulses(const pair* p, const es_joint_object* j, es_vec3* linear, es_vec3* angular)
{
    *linear = j->linear;
    *angular = j->angular;
    float along = j->spring_impulse + j->motor_impulse + j->lower_impulse - j->upper_impulse;
    if (j->desc.type == ES_JOINT_HINGE) {
        es_vec3 other = axis_of(p->qb, 2);
        *angular = es_v3_scale(axis_of(p->qa, 2), along);
        *angular = es_v3_add(*angular, es_v3_scale(es_v3_cross(other, axis_of(p->qa, 0)), j->angular.x));
        *angular = es_v3_add(*angular, es_v3_scale(es_v3_cross(other, axis_of(p->qa, 1)), j->angular.y));
    } else if (j->desc.type == ES_JOINT_DISTANCE) {
        *linear = es_v3_scale(es_v3_normalize(p->gap, es_v3(0, 1, 0)), along);
    }
}

/* ---- stages ------------------------------------------------------------------------------------------------------------------------ */

static pair pair_of(const es_joint_rows* rows, const es_solver_job* job)
{
    const es_solver_bodies* bodies = &job->bodies;
    const es_joint_object* joint = rows->joint;
    pair p = {.job = job, .a = rows->a, .b = rows->b};
    p.va = bodies->velocity + 8 * p.a;
    p.vb = bodies->velocity + 8 * p.b;
    p.ma = bodies->mass + 8 * p.a;
    p.mb = bodies->mass + 8 * p.b;
    es_quat qa = rows->q[0], qb = rows->q[1];
    if (!rows->fixed[0]) memcpy(&qa, bodies->rotation + 4 * p.a, sizeof qa);
    if (!rows->fixed[1]) memcpy(&qb, bodies->rotation + 4 * p.b, sizeof qb);
    p.ra = es_quat_rotate(qa, joint->frame[0].arm);
    p.rb = es_quat_rotate(qb, joint->frame[1].arm);
    p.qa = es_quat_mul(qa, joint->frame[0].rotation);
    p.qb = es_quat_mul(qb, joint->frame[1].rotation);
    const float *da = bodies->moved + 8 * p.a, *db = bodies->moved + 8 * p.b;
    es_vec3 moved = es_v3_sub(linear_of(db), linear_of(da));
    p.gap = es_v3_add(es_v3_add(rows->apart, moved), es_v3_sub(p.rb, p.ra));
    return p;
}

static const es_body_object* body_at(const es_world* world, es_body body) { return es_slots_get(&world->slots[ES_OBJECT_BODY], body.id); }

static bool takes_part(const es_world* world, const es_joint_object* joint)
{
    const es_body_object *a = body_at(world, joint->desc.a), *b = body_at(world, joint->desc.b);
    return !joint->broken && ((a && a->type == ES_BODY_DYNAMIC && !a->asleep) || (b && b->type == ES_BODY_DYNAMIC && !b->asleep));
}

bool es_joints_reserve(es_world* world)
{
    es_rigid* rigid = world->rigid;
    const es_slots* slots = &world->slots[ES_OBJECT_JOINT];
    rigid->joint_count = 0;
    if (!es_grow(world->context, (void**)&rigid->joints, &rigid->joint_capacity, 0, (size_t)slots->live + 1, sizeof *rigid->joints)) return false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_joint_object* joint = es_slots_at(slots, slot);
        if (joint && takes_part(world, joint)) rigid->joints[rigid->joint_count++].joint = joint;
    }
    return true;
}

void es_joint_solver_free(es_context* context, es_rigid* rigid) { es_release(context, rigid->joints, rigid->joint_capacity * sizeof *rigid->joints); }

uint32_t es_joint_solver_count(const es_world* world) { return (uint32_t)world->rigid->joint_count + es_hand_solver_count(world); }

void es_joints_prepare(es_world* world, const es_solver_job* job)
{
    const es_rigid* rigid = world->rigid;
    for (size_t i = 0; i < rigid->joint_count; i++) {
        es_joint_rows* rows = &rigid->joints[i];
        const es_joint_object* joint = rows->joint;
        double places[2][3];
        const es_body handles[2] = {joint->desc.a, joint->desc.b};
        for (int side = 0; side < 2; side++) {
            const es_body_object* body = body_at(world, handles[side]);
            uint32_t index = body && body->index != UINT32_MAX ? body->index : job->bodies.still;
            if (side == 0) rows->a = index;
            else rows->b = index;
            rows->fixed[side] = index == job->bodies.still;
            rows->q[side] = body ? body->rotation : es_quat_identity();
            memcpy(places[side], body ? body->centre : joint->frame[side].place, sizeof places[side]);
        }
        rows->apart = es_v3((float)(places[1][0] - places[0][0]), (float)(places[1][1] - places[0][1]), (float)(places[1][2] - places[0][2]));
    }
    es_hands_prepare(world, job);
}

void es_joints_warm_start(es_world* world, const es_solver_job* job)
{
    const es_rigid* rigid = world->rigid;
    for (size_t i = 0; i < rigid->joint_count; i++) {
        pair p = pair_of(&rigid->joints[i], job);
        es_vec3 linear, angular;
        sum_impulses(&p, rigid->joints[i].joint, &linear, &angular);
        push_at(&p, linear);
        turn_both(&p, angular);
    }
}

void es_joints_solve(es_world* world, const es_solver_job* job, bool push)
{
    const es_rigid* rigid = world->rigid;
    if (push) es_hands_solve(world, job);
    for (size_t i = 0; i < rigid->joint_count; i++) {
        pair p = pair_of(&rigid->joints[i], job);
        solve_joint(&p, rigid->joints[i].joint, push);
    }
}

/* ---- hands ------------------------------------------------------------------------------------------------------------------------- */

#define HAND_HERTZ 6.0f
#define HAND_DAMPING 1.0f
#define HAND_TWIST 0.001f /* torque against turning, per newton of a hand's force and metre of the body's reach */

uint32_t es_hand_solver_count(const es_world* world)
{
    uint32_t count = 0;
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) count += es_hand_holds_body(world, hand);
    return count;
}

static bool hand_pair(const es_world* world, const es_solver_job* job, uint32_t hand, pair* p, float* reach)
{
    const es_hand_state* state = &world->hands[hand];
    const es_body_object* body = body_at(world, state->body);
    if (!body || body->index >= job->bodies.dynamic) return false;
    const es_solver_bodies* bodies = &job->bodies;
    *p = (pair){.job = job, .a = bodies->still, .b = body->index};
    p->va = bodies->velocity + 8 * p->a;
    p->vb = bodies->velocity + 8 * p->b;
    p->ma = bodies->mass + 8 * p->a;
    p->mb = bodies->mass + 8 * p->b;
    es_quat q;
    memcpy(&q, bodies->rotation + 4 * p->b, sizeof q);
    p->rb = es_quat_rotate(q, es_v3_sub(state->local_point, body->local_centre));
    const float* moved = bodies->moved + 8 * p->b;
    for (int k = 0; k < 3; k++) (&p->gap.x)[k] = (float)(body->centre[k] - state->target[k]) + moved[k] + (&p->rb.x)[k];
    *reach = body->reach;
    return true;
}

void es_hands_prepare(es_world* world, const es_solver_job* job)
{
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) world->hands[hand].impulse = world->hands[hand].turn = es_v3(0, 0, 0);
}

/* A spring that is followed within the step only, so that what a hand lets go of keeps no impulse. */
void es_hands_solve(es_world* world, const es_solver_job* job)
{
    const softness soft = soften(job->h, HAND_HERTZ, HAND_DAMPING);
    const es_vec3 none = {0, 0, 0};
    for (uint32_t hand = 0; hand < ES_HANDS; hand++) {
        es_hand_state* state = &world->hands[hand];
        pair p;
        float reach;
        if (!hand_pair(world, job, hand, &p, &reach)) continue;
        push_at(&p, state->impulse);
        turn_both(&p, state->turn);
        hold_turn(&p, rigid_softness, none, none, state->max_force * HAND_TWIST * reach * job->h, &state->turn);
        hold_point(&p, soft, none, state->max_force * job->h, &state->impulse);
    }
}

/* ---- after the step -------------------------------------------------------------------------------------------------------------------- */

static bool finite3(es_vec3 v) { return es_all_within(&v.x, 3, 1e30f); }

void es_joints_store(es_world* world, const es_solver_job* job)
{
    const es_rigid* rigid = world->rigid;
    for (size_t i = 0; i < rigid->joint_count; i++) {
        es_joint_object* j = rigid->joints[i].joint;
        pair p = pair_of(&rigid->joints[i], job);
        es_vec3 linear, angular;
        sum_impulses(&p, j, &linear, &angular);
        if (!finite3(linear) || !finite3(angular) || !finite3(j->angular)) {
            j->linear = j->angular = linear = angular = es_v3(0, 0, 0);
            j->lower_impulse = j->upper_impulse = j->motor_impulse = j->spring_impulse = 0;
        }
        j->force = es_v3_scale(linear, job->inverse_h);
        j->torque = es_v3_scale(angular, job->inverse_h);
        bool snaps = (j->desc.break_force > 0 && es_v3_length(j->force) > j->desc.break_force) ||
                     (j->desc.break_torque > 0 && es_v3_length(j->torque) > j->desc.break_torque);
        if (!snaps) continue;
        j->broken = true;
        j->linear = j->angular = es_v3(0, 0, 0);
        j->lower_impulse = j->upper_impulse = j->motor_impulse = j->spring_impulse = 0;
    }
}
