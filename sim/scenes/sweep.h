/* Closed tubes swept along a curve: bodies, limbs, horns. */
#ifndef EARTHSHINE_SIM_SWEEP_H
#define EARTHSHINE_SIM_SWEEP_H

#include "sim/shapes.h"

/* A place on the curve and the ellipse across it. */
typedef struct es_sweep_station {
    es_vec3 at;
    float wide, deep;         /* half axes, metres: `deep` towards `back`, `wide` at right angles to it */
    es_vec3 back;             /* where the angle is a quarter turn; its part along the curve does not count, so it need not be unit nor perpendicular */
} es_sweep_station;

typedef struct es_sweep {
    const es_sweep_station* stations; /* Catmull-Rom splines through them, at even steps of the parameter; the first and the last have axes of 0 */
    uint32_t count;           /* 2 or more */
    uint32_t along, around;   /* quadrilaterals, 3 or more */
    /* Metres by which the surface stands out; NULL: none. `lengths` is the way from the first station counted in local half axes, so that what
     * depends on it shrinks with the tube; `angle` is 0 … 2 pi, `radius` the mean half axis. */
    float (*relief)(const void* parameters, float lengths, float angle, float radius);
    const void* parameters;
} es_sweep;

/* Appends the tube: closed, with smooth normals, relief included. */
void es_shape_sweep(es_shape* shape, const es_sweep* sweep);

/* Of the curve at `share` 0 … 1 of its parameter: unit vectors along it, to its back and to its side, and the half axes there. */
typedef struct es_sweep_frame { es_vec3 at, along, back, side; float wide, deep; } es_sweep_frame;
es_sweep_frame es_sweep_at(const es_sweep* sweep, float share);

#endif
