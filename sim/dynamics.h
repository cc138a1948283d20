/* The door between time and what bodies and cloth do in it: sim/stepping.c opens it once per fixed step and once per frame. */
#ifndef EARTHSHINE_SIM_DYNAMICS_H
#define EARTHSHINE_SIM_DYNAMICS_H

#include "sim/world.h"

/* Is there anything that steps? Without, time passes at no cost. */
bool es_dynamics_present(const es_world* world);
/* The share of the last fixed step that has passed at the world's time, 0 … 1; 1 at its end and without world.interpolate. */
float es_step_phase(const es_world* world);

#endif
