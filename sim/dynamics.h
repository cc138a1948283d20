/* The door between time and what bodies and cloth do in it: sim/stepping.c opens it once per fixed step and once per frame. */
#ifndef EARTHSHINE_SIM_DYNAMICS_H
#define EARTHSHINE_SIM_DYNAMICS_H

#include "sim/world.h"

/* Is there anything that steps? Without, time passes at no cost. */
bool es_dynamics_present(const es_world* world);
/* The share of the last fixed step that has passed at the world's time, 0 … 1; 1 at its end and without world.interpolate. */
float es_step_phase(const es_world* world);

/* Rigid bodies (sim/rigid/step.c). A step fails only for want of memory, and then may be made again. */
void es_rigid_begin_frame(es_world* world);  /* forgets the events of the frame before */
es_result es_rigid_step(es_world* world, float h, uint32_t substeps);
/* Puts the nodes of dynamic bodies between the last two steps: 0 … 1, 1 the last. */
void es_rigid_pose(es_world* world, float alpha);

/* Cloth and soft bodies (sim/soft/soft_step.c, soft_pose.c): after the rigid bodies, whose way within the step they meet and whose velocities
 * they change for the next one. */
es_result es_soft_step(es_world* world, float h, uint32_t substeps);
es_result es_soft_pose(es_world* world, float alpha);

#endif
