/* What the solver's kernels work on: bodies as records, contacts eight at a time.
 *
 * Soft Step (Catto, "Solver2D", 2024; Box2D v3), in three dimensions. A fixed step is cut into substeps; in each of them
 *
 *     velocities += forces; impulses of the last substep are applied; contacts are solved once, as stiff damped springs
 *     positions += velocities; contacts are solved once more without the springs' push, so that it leaves no speed behind
 *
 * and bounces come last, once; they give back no more energy than was there (sim/rigid/bounce_limit.h). Geometry is not computed anew between substeps: separations follow from how bodies moved since the step
 * began (es_solver.moved), to first order in rotations.
 *
 * Friction acts on the manifold as a whole: two directions at the middle of its points, and a twist about the normal.
 *
 * A contact that bears many times what its lighter body weighs (sixty times as much: from there to twice that) is damped more, and a body
 * under a heavier one acts on it with more mass than it has (sim/kernels/rigid_contacts.c): so 1000 : 1 stands.
 *
 * Contacts of one colour share no dynamic body, so that they may be solved at once: in the lanes of a vector and by several threads. */
#ifndef EARTHSHINE_SIM_RIGID_SOLVER_H
#define EARTHSHINE_SIM_RIGID_SOLVER_H

#include "sim/rigid/rigid.h"

enum { ES_LANES = 8, ES_COLOURS = 24 };

/* Records of eight floats per body, counts rounded up to whole vectors. The last record is the body that nothing moves. */
typedef struct es_solver_bodies {
    float* velocity;      /* v, 0, w, 0 */
    float* moved;         /* since the step began: p, 0, rotation vector, 0 */
    float* mass;          /* inverse inertia xx yy zz xy, xz yz, inverse mass, 0 */
    float* drive;         /* per substep: change of v, factor of v, change of w, factor of w */
    float* rotation;      /* four floats: quaternion */
    uint32_t dynamic;     /* records of what contacts may push: [0, dynamic) */
    uint32_t count;       /* kinematic bodies follow, then `still` */
    uint32_t still;       /* number of the record of what never moves */
} es_solver_bodies;

typedef struct es_lanes3 { float x[ES_LANES], y[ES_LANES], z[ES_LANES]; } es_lanes3;

typedef struct es_wide_point {
    es_lanes3 arm_a, arm_b;   /* r × n */
    es_lanes3 turn_a, turn_b; /* inverse inertia times that */
    float separation[ES_LANES]; /* when the step began */
    float mass[ES_LANES];     /* effective, 0 where there is no point */
    float impulse[ES_LANES], peak[ES_LANES]; /* now, and the largest of the step */
    float approach[ES_LANES]; /* relative speed along the normal before the step; negative: towards each other */
} es_wide_point;

typedef struct es_wide_contact {
    uint32_t a[ES_LANES], b[ES_LANES];     /* bodies; `still` in lanes that are not used */
    uint32_t manifold[ES_LANES];           /* which they are */
    uint32_t used, point_count, bouncy, rolls; /* lanes in use; most points of a lane; whether any does */
    es_lanes3 normal;
    float mass_a[ES_LANES], mass_b[ES_LANES];  /* inverse */
    float bias_rate[ES_LANES], mass_scale[ES_LANES], impulse_scale[ES_LANES]; /* the spring's */
    float friction[ES_LANES], restitution[ES_LANES], rolling[ES_LANES];
    es_lanes3 tangent[2], slide_arm_a[2], slide_arm_b[2], slide_turn_a[2], slide_turn_b[2];
    float slide_mass[3][ES_LANES];             /* inverse of the 2 × 2 matrix: xx, xy, yy */
    float slide[2][ES_LANES];                  /* impulses */
    es_lanes3 twist_turn_a, twist_turn_b;      /* inverse inertia times n */
    float twist_mass[ES_LANES], twist[ES_LANES];
    float twist_radius[ES_LANES];              /* mean distance of the points from their middle */
    es_lanes3 roll;                            /* impulse */
    float roll_mass[ES_LANES];
    es_wide_point points[ES_MANIFOLD_POINTS];
} es_wide_contact;

typedef struct es_solver_job {
    es_solver_bodies bodies;
    es_wide_contact* contacts;
    es_contact_manifold* manifolds;
    const es_contact* list;
    float h, inverse_h;       /* of a substep */
    float max_turn;           /* radians per substep */
    float up[3];              /* against gravity, unit; 0 without */
    float soft[4][3];         /* bias rate, mass scale, impulse scale: between dynamic bodies, against others; both under a burden */
    float burden_scale;       /* s/m: 1 / speed; burdens between that speed and twice it are damped more and more */
} es_solver_job;

#endif
