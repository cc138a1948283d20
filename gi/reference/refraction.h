/* Light's way through glass, backwards: in at the shading normal, through the thing, out (es_material_desc.transmission).
 *
 * Directions by Snell's law. What is not let through at an interface is reflected by
 *     F(c) = F90 (0.04 + 0.96 (1 - c)^5),  F90 = `specular`, c the cosine in air,
 * the surface model's interface (gi/surface.h), on both sides of it. Inside, where no light leaves by Snell's law, all is reflected; what is reflected besides is left out. */
#ifndef EARTHSHINE_GI_REFERENCE_REFRACTION_H
#define EARTHSHINE_GI_REFERENCE_REFRACTION_H

#include "gi/reference/scene.h"

enum { ES_REFRACTION_MOST = 8 };  /* surfaces of the thing that a ray comes to, but for the first */

typedef struct es_refraction {
    es_vec3 position, direction;      /* where it leaves, off the surface, and in which direction, unit */
    es_vec3 weight;                   /* share of the light from there that arrives, by the interfaces and the colour at the entry; 0 where no light goes in */
    uint32_t rays;                    /* traced */
} es_refraction;

/* Into `from` from the direction d, unit, by which it was met, with ratio = index before / index behind the surface; n unit, against d. False: all is reflected. */
bool es_refract(es_vec3 d, es_vec3 n, float ratio, es_vec3* refracted);
/* Share that an interface lets through at that cosine in air. */
float es_interface_share(const es_surface* surface, float cosine);
/* A ray of direction d, unit, that meets `surface` of a hit (es_trace_surface_at) whose material lets light through. */
es_refraction es_trace_refraction(const es_trace_scene* scene, const es_trace_surface* surface, es_vec3 d);

#endif
