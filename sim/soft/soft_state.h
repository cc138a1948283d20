/* State of cloth and soft bodies for sim/state.c. */
#ifndef EARTHSHINE_SIM_SOFT_STATE_H
#define EARTHSHINE_SIM_SOFT_STATE_H

#include "sim/soft/soft.h"
#include "sim/state_io.h"

void es_visit_soft(es_world* world, state_io* io, es_soft_object* soft);
/* What a saved state must agree about. */
void es_soft_signature(const es_soft_object* soft, uint32_t words[2]);

#endif
