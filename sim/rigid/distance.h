/* The nearest points of two convex sets of points: the iteration of Gilbert, Johnson and Keerthi (1988), in double. */
#ifndef EARTHSHINE_SIM_RIGID_DISTANCE_H
#define EARTHSHINE_SIM_RIGID_DISTANCE_H

#include "sim/rigid/frame.h"

typedef struct es_nearest {
    double distance;         /* 0: they overlap or touch, and the rest says nothing */
    es_vec3 on_a, on_b;
    es_vec3 normal;          /* unit, from a to b */
    uint32_t count;          /* corners that span the nearest points: 1 … 3 */
    uint8_t a[3], b[3];      /* which */
} es_nearest;

/* 1 … 255 points each, within 1e6 or so of zero. Distances below 1e-6 of the coordinates' size count as touching. */
void es_nearest_points(const es_vec3* a, uint32_t a_count, const es_vec3* b, uint32_t b_count, es_nearest* nearest);

#endif
