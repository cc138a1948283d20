/* What the kernels of cloth and soft bodies work on: particles in slots, constraints in batches of eight.
 *
 * A particle is four floats: a place relative to the body's origin, and its inverse mass, 0 for what is held. The constraints of a batch share
 * no particle, so its lanes are independent; batches are solved one after another (Gauss-Seidel). */
#ifndef EARTHSHINE_SIM_SOFT_KERNELS_H
#define EARTHSHINE_SIM_SOFT_KERNELS_H

#include "platform/platform.h"

/* Distances: C = |a - b| - rest. Lanes from `count` on repeat lane 0 and are not written back. */
typedef struct es_soft_links {
    uint32_t a[8], b[8];     /* slots */
    float rest[8];           /* m */
    float compliance[8];     /* m/N */
    uint32_t count;
} es_soft_links;

/* Volumes: C = ((b - a) × (c - a)) · (d - a) / 6 - rest. */
typedef struct es_soft_volumes {
    uint32_t corner[4][8];
    float rest[8];           /* m³ */
    float floor[8];          /* of the sum of w |gradient|²: what a squashed tetrahedron loses of it would make its corners jump */
    uint32_t count;
} es_soft_volumes;

typedef struct es_soft_motion {
    float *x, *previous;     /* 4 per slot */
    float* velocity;
    const float* acceleration; /* 4 per slot, or NULL: gravity alone */
    es_vec3 gravity;
    float h, inverse_h;
    float keep;              /* share of the velocity that damping leaves */
    float limit;             /* of each of its components */
    bool first;              /* velocities are taken from `velocity`, not from what the last substep moved */
} es_soft_motion;

/* What keeps a particle within reach of held ones: at most `reach` from anchor `anchor`, per slot two each. */
typedef struct es_soft_reach {
    const uint32_t* anchor[2];
    const float* reach[2];
    const float *start, *end; /* places of anchors at the begin and the end of the step, 4 floats each */
    float share;             /* of the step that has passed */
} es_soft_reach;

/* A capsule (a sphere is one of no length) as it is in one substep. */
typedef struct es_soft_surface {
    es_vec3 a, along;        /* from one end to the other */
    float inverse_length2;   /* 1 / |along|², 0 for a sphere */
    float radius;            /* the cloth's thickness included */
    float friction;
    es_vec3 centre;          /* of mass of what it belongs to */
    es_vec3 moved, turned;   /* its way and its turn (a rotation vector) in this substep */
} es_soft_surface;

/* Pressure and drag as accelerations, for a whole step. */
typedef struct es_soft_air {
    const uint32_t *first_row, *rows; /* fans (sim/normals.h) over slots */
    const float* faces;      /* cross products of triangles */
    const float *x, *velocity;
    float* acceleration;     /* out, 4 per slot */
    es_vec3 wind;
    float pressure, drag_h;  /* drag times the step */
    float inverse_h;         /* of the step */
} es_soft_air;

#endif
