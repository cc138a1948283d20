/* The vitreous humour: particles in one body that turns with its own inertia when the eye jumps, and comes to rest by strong damping (Ritschel thesis §8.2.4).
 *
 * A viscoelastic gel that the eye's wall takes along (Zimmerman 1980): the body's angles against the eye are pulled back by a weak spring and
 * critically damped, and a saccade is a torque that fades. Integrator: semi-implicit Euler with implicit damping, one step to one of the grid; unlike the
 * thesis' forward Euler it never gains energy. Particles are drawn where they are seen along the axis, in the pupil's plane (single plane, figure 8.7). */
#ifndef EARTHSHINE_GI_GLARE_VITREOUS_H
#define EARTHSHINE_GI_GLARE_VITREOUS_H

#include "gi/glare/eye_shapes.h"

enum { ES_VITREOUS_PARTICLES = 540 };

#define ES_VITREOUS_RADIUS 8.0f /* mm */
#define ES_VITREOUS_PARTICLE 0.035f /* mm, radius of each */

typedef struct es_vitreous {
    es_vec3 particles[ES_VITREOUS_PARTICLES]; /* mm from the middle of the eye, at rest */
    float angle[3];            /* rotation vector against the eye, radians */
    float speed[3];            /* rad/s */
    float torque[3];           /* of saccades, rad/s² */
} es_vitreous;

/* Anatomy of that seed, at rest. */
void es_vitreous_begin(es_vitreous* vitreous, uint32_t seed);
/* One step of the grid, to step number `step`; saccades begin at steps that follow from the seed, `strength` times as strong as usual, 0: none do. */
void es_vitreous_step(es_vitreous* vitreous, uint32_t seed, int64_t step, float strength);
void es_vitreous_add_particles(const es_vitreous* vitreous, es_eye_shapes* shapes);

#endif
