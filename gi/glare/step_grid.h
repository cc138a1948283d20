/* The absolute grid of time on which what lives between frames moves on: steps of 1 / 240 s from the world's time 0.
 *
 * What was made at step k depends on k and on what was put in at the steps before, not on how time is cut into frames. A frame's time belongs to the
 * nearest step, so that sums of frame times which differ in their last bits come to the same. */
#ifndef EARTHSHINE_GI_GLARE_STEP_GRID_H
#define EARTHSHINE_GI_GLARE_STEP_GRID_H

#include <stdbool.h>
#include <stdint.h>

enum { ES_GRID_RATE = 240 /* steps a second */, ES_GRID_LONGEST = 10 * ES_GRID_RATE /* steps gone through one by one */ };

typedef struct es_step_grid { bool started; int64_t step; } es_step_grid;

/* Nearest step; times past ±1e13 s are those. NaN: 0. */
static inline int64_t es_grid_step(double time)
{
    if (!(time == time)) return 0;
    const double at = (time > 1e13 ? 1e13 : time < -1e13 ? -1e13 : time) * ES_GRID_RATE + 0.5;
    const int64_t whole = (int64_t)at;
    return whole - (at < (double)whole);
}

/* Seconds of the world at a step. */
static inline double es_grid_time(int64_t step) { return (double)step / ES_GRID_RATE; }

/* Steps that lead from where it stands to `to`; -1 where it is to begin anew: it never began, or time went back, or forward by more than ES_GRID_LONGEST. */
static inline int64_t es_grid_steps(const es_step_grid* grid, int64_t to)
{
    const int64_t steps = to - grid->step;
    return grid->started && steps >= 0 && steps <= ES_GRID_LONGEST ? steps : -1;
}

#endif
