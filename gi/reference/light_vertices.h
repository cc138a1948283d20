/* Light vertices: where light of spot, point and directional lights first meets a surface, found from the lights' side.
 *
 * A path over a last surface y to a light can be found by a direction of the surface before that happens to meet y, or by a direction of the
 * light's emission that meets y and a connection. The first is good where y is near, the second where the light reaches little of what
 * there is to see; multiple importance sampling combines them (Veach 1997, chapter 10, paths with s = 2). */
#ifndef EARTHSHINE_GI_REFERENCE_LIGHT_VERTICES_H
#define EARTHSHINE_GI_REFERENCE_LIGHT_VERTICES_H

#include "gi/reference/scene.h"

typedef struct es_light_vertex {
    es_trace_surface surface;    /* as the light sees it */
    uint32_t light;
    es_vec3 towards_light;       /* unit */
    float strength;              /* irradiance of a surface that faces the light, over its radiant, × the lit places on the ray (mostly one) */
} es_light_vertex;

typedef struct es_light_emission es_light_emission;

typedef struct es_light_emissions {
    const es_trace_scene* scene; /* NULL: there are none */
    es_light_emission* of;       /* each light of the scene */
    float* sums;                 /* running up to 1 over the lights' flux */
    uint32_t light_count;
    float reach;                 /* surfaces are no further from a light in the scene */
} es_light_emissions;

/* The scene must outlive it. Nothing is kept for a scene without lights or surfaces. */
es_result es_light_emissions_create(es_light_emissions* all, const es_trace_scene* scene);
void es_light_emissions_free(es_light_emissions* all);
/* A vertex from two numbers in [0, 1) and random bits. False when the light meets nothing that reflects it. Adds to the rays traced. */
bool es_light_vertex_sample(const es_light_emissions* all, const float u[2], uint32_t bits, es_light_vertex* vertex, uint32_t* rays);
/* The density, 1/m², with which the above finds the point s, which sees `light` in direction `towards` (unit) at `distance`; 0 when it never does. */
float es_light_vertex_density(const es_light_emissions* all, uint32_t light, const es_trace_surface* s, es_vec3 towards, float distance);

#endif
