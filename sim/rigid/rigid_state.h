/* Visiting the rigid bodies' state (sim/state_io.h). */
#ifndef EARTHSHINE_SIM_RIGID_STATE_H
#define EARTHSHINE_SIM_RIGID_STATE_H

#include "sim/rigid/rigid.h"
#include "sim/state_io.h"

void es_visit_body(es_world* world, state_io* io, es_body_object* body);
void es_visit_joint(es_world* world, state_io* io, es_joint_object* joint);
/* Contacts with their impulses, the hands, and where zero is; after all bodies and joints. */
void es_visit_rigid(es_world* world, state_io* io);
/* What of a body or joint is content, not state: a few words for the signature. */
void es_body_signature(const es_body_object* body, uint32_t words[2]);
void es_joint_signature(const es_joint_object* joint, uint32_t words[2]);

#endif
