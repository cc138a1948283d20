/* What the player holds: soft springs from places to points of bodies. They are part of the state, not of the content, so that saving and
 * rewinding work while something is held. */
#ifndef EARTHSHINE_SIM_RIGID_HANDS_H
#define EARTHSHINE_SIM_RIGID_HANDS_H

#include "sim/rigid/solver.h"
#include "sim/state_io.h"

bool es_hand_holds_body(const es_world* world, uint32_t hand);
/* Lets go of a body or soft body that will be destroyed. */
void es_hands_forget(es_world* world, es_object_kind kind, uint32_t id);
void es_hands_wake(es_world* world);
void es_visit_hands(es_world* world, state_io* io);

/* joint_solver.c */
uint32_t es_hand_solver_count(const es_world* world);
void es_hands_prepare(es_world* world, const es_solver_job* job);
void es_hands_solve(es_world* world, const es_solver_job* job);

#endif
