#include "gi/glare/vitreous.h"

#include <string.h>

#include "gi/glare/step_grid.h"
#include "platform/maths.h"
#include "platform/random.h"

enum { SACCADE_SLOT = 7 * ES_GRID_RATE / 10 }; /* steps, one saccade somewhere in each */
/* Back to rest in about a second: a spring of 0.6 Hz, critically damped. */
static const float spring = 14.2f, damping = 7.6f, fading = 1.0f / 0.05f; /* 1/s², 1/s, 1/s */

void es_vitreous_begin(es_vitreous* v, uint32_t seed)
{
    memset(v, 0, sizeof *v);
    uint32_t counter = 0;
    for (uint32_t i = 0; i < ES_VITREOUS_PARTICLES; i++) {
        es_vec3 p;
        do {
            p.x = 2 * es_random_float(seed, counter++) - 1;
            p.y = 2 * es_random_float(seed, counter++) - 1;
            p.z = 2 * es_random_float(seed, counter++) - 1;
        } while (es_v3_dot(p, p) > 1);
        v->particles[i] = es_v3_scale(p, ES_VITREOUS_RADIUS);
    }
}

static float settled(float x) { return x < 1e-12f && x > -1e-12f ? 0 : x; }

/* Does a saccade begin at that step? Then its torque. */
static bool saccade(uint32_t seed, int64_t step, float torque[3])
{
    const int64_t slot = step >= 0 ? step / SACCADE_SLOT : -((-step + SACCADE_SLOT - 1) / SACCADE_SLOT);
    const uint32_t number = 8 * (uint32_t)slot;
    if (step - slot * SACCADE_SLOT != (int64_t)(es_random_float(seed, number) * SACCADE_SLOT)) return false;
    float sine, cosine;
    es_sincos(2 * ES_PI * es_random_float(seed, number + 1), &sine, &cosine);
    const float size = 12.0f * (0.3f + 0.7f * es_random_float(seed, number + 2));
    torque[0] = size * sine;
    torque[1] = size * cosine;
    torque[2] = 0.25f * size * (2 * es_random_float(seed, number + 3) - 1); /* eyes hardly roll */
    return true;
}

void es_vitreous_step(es_vitreous* v, uint32_t seed, int64_t step, float strength)
{
    const float dt = 1.0f / ES_GRID_RATE;
    float torque[3] = {0, 0, 0};
    const bool begins = strength > 0 && saccade(seed, step, torque);
    for (int k = 0; k < 3; k++) {
        v->torque[k] = settled(v->torque[k] / (1.0f + fading * dt));
        if (begins) v->torque[k] += strength * torque[k];
        v->speed[k] = settled((v->speed[k] + dt * (v->torque[k] - spring * v->angle[k])) / (1.0f + damping * dt));
        v->angle[k] = settled(v->angle[k] + dt * v->speed[k]);
    }
}

void es_vitreous_add_particles(const es_vitreous* v, es_eye_shapes* shapes)
{
    const es_vec3 axis = {v->angle[0], v->angle[1], v->angle[2]};
    const float angle = es_v3_length(axis);
    const es_quat turn = angle > 0 ? es_quat_from_axis_angle(es_v3_scale(axis, 1.0f / angle), angle) : es_quat_identity();
    for (uint32_t i = 0; i < ES_VITREOUS_PARTICLES; i++) {
        const es_vec3 p = es_quat_rotate(turn, v->particles[i]);
        es_eye_add_disc(shapes, p.x, p.y, ES_VITREOUS_PARTICLE);
    }
}
