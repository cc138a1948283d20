/* Threads that go through a list of stages together.
 *
 * A stage is a range cut into blocks of a fixed size; its blocks may run at once, and a stage begins when the one before is done. The
 * solver has a hundred stages of a few microseconds in a step, too short to wake threads for each: here the threads stay, and a stage costs a
 * few cache lines. The first thread to come leads: it opens the stages and works along; the others take blocks while there are
 * any. Threads that never come, come late or come one after another (a user's own job system may do that) only leave more to the leader. */
#ifndef EARTHSHINE_SIM_RIGID_CREW_H
#define EARTHSHINE_SIM_RIGID_CREW_H

#include "platform/context.h"

typedef struct es_stage {
    uint32_t kind;           /* what to do, the caller's */
    uint32_t begin, end;     /* of what, the caller's */
    uint32_t grain;          /* block size */
} es_stage;

/* run(user, kind, begin, end): a block. Blocks' borders depend on the stage alone. */
typedef void (*es_crew_body)(void* user, uint32_t kind, uint32_t begin, uint32_t end);
void es_crew_run(es_context* context, const es_stage* stages, uint32_t count, es_crew_body body, void* user);

#endif
