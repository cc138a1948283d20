/* Which spot, point or directional light next-event estimation takes: by what each would send, were nothing in its way. */
#ifndef EARTHSHINE_GI_REFERENCE_LIGHT_CHOICE_H
#define EARTHSHINE_GI_REFERENCE_LIGHT_CHOICE_H

#include "gi/reference/scene.h"

/* Direction to the light (unit), its distance (infinite for directional ones), and what its radiant is multiplied by to give the irradiance of
 * a surface that faces it: 0 outside of its cone or range. False when the point is the light's own. */
bool es_trace_towards_light(const es_light_state* light, es_vec3 point, es_vec3* direction, float* distance, float* strength);
/* Towards a light on the geometric normal's side of s, from an origin off the surface; what is as near to the light as rounding is the light's own place. */
es_ray es_trace_shadow_ray(const es_light_state* light, const es_trace_surface* s, es_vec3 direction);

/* One light from a number in [0, 1), with its probability. False when no light shines on this side of s. */
bool es_trace_choose_light(const es_trace_scene* scene, const es_trace_surface* s, float u, uint32_t* light, float* probability);
/* The probability with which the above returns `light`. */
float es_trace_light_probability(const es_trace_scene* scene, const es_trace_surface* s, uint32_t light);

#endif
