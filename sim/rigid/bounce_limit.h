/* Bounces that would give an island of bodies more energy than it had are shortened (sim/rigid/bounce_limit.c). */
#ifndef EARTHSHINE_SIM_RIGID_BOUNCE_LIMIT_H
#define EARTHSHINE_SIM_RIGID_BOUNCE_LIMIT_H

#include "sim/rigid/solver.h"

typedef struct es_bounce_island { /* by the number of its first body; twice the energies, J */
    double allowed, constant, linear, square; /* s of the bounces' changes leave it with constant + linear s + square s² */
    double share;                             /* that s */
    float frame[3];                           /* velocity of what is not dynamic and touches it */
    bool bounced, walled, driven;             /* walled: something does; driven: in more ways than that */
} es_bounce_island;

/* After the bounces, before anything is stored. contact_count: of job->contacts; before: the bodies' velocities when the bounces began, as
 * job->bodies.velocity; islands: room for one per dynamic body; h: of the step, s. Uses rigid->parents. */
void es_limit_bounces(es_world* world, const es_solver_job* job, uint32_t contact_count, const float* before, es_bounce_island* islands, float h);

#endif
