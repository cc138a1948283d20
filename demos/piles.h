/* Piles of boxes that every physics engine is timed with: the initial states are those of the peers' programs (../shared/peers/rigid), number by
 * number. */
#ifndef EARTHSHINE_DEMOS_PILES_H
#define EARTHSHINE_DEMOS_PILES_H

#include <earthshine/sim.h>

enum { PILE_PYRAMID = 210, PILE_DROP = 1000 };

/* A pyramid of cubes of 1 m on a floor, 20 in the lowest row, 5 cm apart. */
es_result pile_make_pyramid(es_world* world, es_body bodies[PILE_PYRAMID]);
/* 1000 boxes of 0.5 … 0.9 m, turned any way, dropped between four walls 14 m apart. */
es_result pile_make_drop(es_world* world, es_body bodies[PILE_DROP]);

#endif
