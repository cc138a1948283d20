/* The past of a world: saved states in a bounded ring, so that it can be wound back and go on from there. */
#ifndef EARTHSHINE_DEMO_PLAYER_HISTORY_H
#define EARTHSHINE_DEMO_PLAYER_HISTORY_H

#include <earthshine/sim.h>

enum { HISTORY_STATES = 3600 };

typedef struct history_state {
    double time;
    size_t size;
    void* bytes;
} history_state;

typedef struct player_history {
    history_state states[HISTORY_STATES]; /* a ring, oldest first from `first` */
    uint32_t first, count;
    uint32_t at;         /* of the state the world is in, counted from the oldest; count - 1 is the present */
    size_t bytes, limit; /* held, and at most; 0: 256 MiB */
} player_history;

/* Saves the world as it is now when its time is another than the newest state's. A world that was wound back goes on from there: what came
 * after is forgotten. The oldest states give way. Nothing is saved where memory is short. */
void history_add(player_history* history, const es_world* world);
/* Takes the world to the state `at`, counted from the oldest; what is beyond the last is the last. */
es_result history_go(player_history* history, es_world* world, uint32_t at);
double history_time(const player_history* history, uint32_t at);
void history_clear(player_history* history);

#endif
