/* The eye's lens: particles in its nucleus, fibres of its cortex that are gratings, and how accommodation moves them (Ritschel thesis §8.2.3, figure 8.4).
 *
 * The lens is symmetric about its axis. A mass-spring system of 17 × 17 nodes over radius and thickness says where each place of that section goes; a
 * single node, the middle of the rim, is moved by the ciliary muscle. What lies inside is found by bilinear interpolation and turned round
 * the axis by its own angle.
 *
 * Springs are linear in the displacements along their direction at rest (small strains), masses are 1. Integrator: semi-implicit Euler with implicit drag,
 * four steps to one of the grid (1 / 960 s); the fastest oscillation's ω · dt is below 1, and it is stable below 2. */
#ifndef EARTHSHINE_GI_GLARE_LENS_H
#define EARTHSHINE_GI_GLARE_LENS_H

#include "gi/glare/eye_shapes.h"

enum { ES_LENS_GRID = 17, ES_LENS_PARTICLES = 750, ES_LENS_GRATINGS = 200, ES_GRATING_LINES = 4 };

#define ES_LENS_RADIUS 4.8f     /* mm */
#define ES_LENS_THICKNESS 4.0f  /* mm, on the axis */

/* Radius as a share of the lens', and place along the axis in 0 … 1. */
typedef struct es_lens_place { float u, v; } es_lens_place;
typedef struct es_lens_particle { es_lens_place place; float cosine, sine /* of the angle about the axis */, radius /* mm */; } es_lens_particle;
typedef struct es_lens_grating { es_lens_place inner, outer; float cosine, sine; } es_lens_grating;

typedef struct es_lens {
    float period;              /* mm between the lines of a grating */
    es_lens_particle particles[ES_LENS_PARTICLES];
    es_lens_grating gratings[ES_LENS_GRATINGS];
    float moved[ES_LENS_GRID][ES_LENS_GRID][2]; /* [along the radius][along the axis]: displacement in mm, radial and axial */
    float speed[ES_LENS_GRID][ES_LENS_GRID][2]; /* mm/s */
} es_lens;

/* Anatomy of that seed, at rest. */
void es_lens_begin(es_lens* lens, uint32_t seed);
/* What the muscle does to the node at the rim, mm, at a time in seconds, for a pupil of a mean diameter in mm: value noise of three octaves below 0.6 Hz, whose
 * power is in proportion to the diameter, and a narrow band between 1.3 and 2.1 Hz. */
float es_lens_accommodation(uint32_t seed, double time, float pupil);
/* One step of the grid (gi/glare/step_grid.h) with the node at the rim moved outwards by `drive` mm. */
void es_lens_step(es_lens* lens, float drive);
/* Energy of springs and masses, mm²/s² for a mass of 1. */
double es_lens_energy(const es_lens* lens);
/* Distance from the axis of what was at that place, mm. */
float es_lens_radius_at(const es_lens* lens, es_lens_place place);
void es_lens_add_particles(const es_lens* lens, es_eye_shapes* shapes);
void es_lens_add_gratings(const es_lens* lens, es_eye_shapes* shapes);

#endif
