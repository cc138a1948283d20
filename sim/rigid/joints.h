/* Joints, as the rest of the rigid bodies sees them. */
#ifndef EARTHSHINE_SIM_RIGID_JOINTS_H
#define EARTHSHINE_SIM_RIGID_JOINTS_H

#include "sim/rigid/rigid.h"
#include "sim/rigid/solver.h"

/* Does a joint say that these two do not collide? */
bool es_joint_keeps_apart(const es_world* world, const es_body_object* a, const es_body_object* b);
/* Calls join(parents, index a, index b) for the dynamic bodies that joints hold together. */
void es_joints_unite(es_world* world, uint32_t* parents, void (*join)(uint32_t* parents, uint32_t a, uint32_t b));

/* Wakes what is joined to what is awake. */
void es_joints_wake(es_world* world);
/* By which b's frame is turned about z against a's, in (-pi, pi]. */
float es_joint_angle(es_quat frame_a, es_quat frame_b);

/* joint_solver.c: the stages, run by one thread each */
bool es_joints_reserve(es_world* world); /* lists what takes part; false after es_fail */
void es_joint_solver_free(es_context* context, es_rigid* rigid);
uint32_t es_joint_solver_count(const es_world* world);
void es_joints_prepare(es_world* world, const es_solver_job* job);
void es_joints_warm_start(es_world* world, const es_solver_job* job);
void es_joints_solve(es_world* world, const es_solver_job* job, bool push);
void es_joints_store(es_world* world, const es_solver_job* job); /* once at the end of a step */

#endif
