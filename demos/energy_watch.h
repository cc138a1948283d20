/* Whether bodies gain energy that nothing gave them, in a world that is being stepped.
 *
 * Bodies and soft bodies that touch, or that joints hold together, share what energy they have: kinetic, and of height. A group of them into
 * which nothing from outside did work during a window of half a second must not have more at the window's end than at its beginning. Left out
 * of the judgement are groups in which, during the window, one
 *   - touched a body that is not dynamic and that moved;
 *   - was held by a joint with a motor or a spring, or by any joint to such a moving body;
 *   - was held by a hand;
 *   - is a soft body that is attached to anything, blown at or under pressure, or was near one of these.
 * Forces, impulses and velocities that the caller applies are not known here: what they add counts as gained.
 *
 * What a group gains is charged to its members by what each is allowed, and what it loses is taken off again, but never below nothing; so a small gain in
 * each window adds up, and trembling about a mean does not. A member that was driven begins anew. Contacts that give way a little store and
 * return energy that is not seen here, so each member is allowed that of ENERGY_HEIGHT m of height under 9.81 m/s² (soft bodies:
 * ENERGY_SOFT_HEIGHT). What the solver gains before bounces are limited, 2.2 J of 2900 J in 200 s of the scene `stress`, is not traced yet:
 * ENERGY_SHARE of the most kinetic energy it had since it was driven is allowed for it. */
#ifndef EARTHSHINE_DEMO_ENERGY_WATCH_H
#define EARTHSHINE_DEMO_ENERGY_WATCH_H

#include <earthshine/gi.h>

#define ENERGY_HEIGHT 0.005
#define ENERGY_SOFT_HEIGHT 0.02
#define ENERGY_SHARE 0.05

typedef struct energy_watch energy_watch;

typedef struct energy_gain {
    double joules, allowed;   /* of the member whose gain is, or was, the largest part of what it is allowed */
    double time;              /* of the world, s */
    es_object_kind kind;      /* ES_OBJECT_BODY or ES_OBJECT_SOFT */
    uint32_t id;              /* 0: none has been judged */
    uint64_t judged, driven;  /* members times windows that were, and were not */
} energy_gain;

/* Before the world's first step: it must see every contact begin. NULL: out of memory. Bodies, joints and soft bodies must stay the same ones. */
energy_watch* energy_watch_open(const es_world* world);
void energy_watch_close(energy_watch* watch);
/* After each step of one fixed step. False: out of memory. */
bool energy_watch_step(energy_watch* watch, es_world* world);
energy_gain energy_watch_worst(const energy_watch* watch);

#endif
