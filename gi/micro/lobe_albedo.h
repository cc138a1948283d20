/* What a surface's lobe reflects of light from one direction, over all directions: its directional albedo, tabulated from the surface model.
 *
 * The GGX lobe of gi/surface.h is linear in F0 and F90, F0 being the three numbers and F90 one:
 *     albedo(c) = F0 · low(roughness, c) + F90 · high(roughness, c),   c the cosine of the incident light,
 * and Phong's in its `specular`: albedo(c) = specular · phong(exponent, c). */
#ifndef EARTHSHINE_GI_MICRO_LOBE_ALBEDO_H
#define EARTHSHINE_GI_MICRO_LOBE_ALBEDO_H

#include "gi/surface.h"

/* Rows: roughness k / 16, exponents 51 (k / 16)² (the G-buffer holds none above 51). Columns: cosines k / 32. Between, both are linear. */
enum { ES_LOBE_ROWS = 17, ES_LOBE_COLUMNS = 33 };
#define ES_LOBE_MAX_EXPONENT 51.0f

typedef struct es_lobe_albedo {
    float low[ES_LOBE_ROWS * ES_LOBE_COLUMNS], high[ES_LOBE_ROWS * ES_LOBE_COLUMNS], phong[ES_LOBE_ROWS * ES_LOBE_COLUMNS];
    float mean_low[ES_LOBE_ROWS], mean_high[ES_LOBE_ROWS], mean_phong[ES_LOBE_ROWS]; /* of light that comes evenly from the hemisphere */
} es_lobe_albedo;

/* gi/micro/lobe_albedo_values.c: made and checked by tests/check_lobe_albedo.c; making it takes some milliseconds, which every renderer would. */
extern const es_lobe_albedo es_lobe_albedos;

/* One at a time; gi/kernels/lobe_albedo_simd.h has the same. cosine in [0, 1]. */
es_vec3 es_lobe_albedo_at(const es_lobe_albedo* table, const es_surface* surface, float cosine);
/* Share of light from everywhere that the whole surface reflects, the diffuse part behind its interface included. */
es_vec3 es_surface_albedo(const es_lobe_albedo* table, const es_surface* surface);

/* Mean of 1 - Fd(c) over the hemisphere, by the cosine: the share of what the diffuse part sends that leaves through the interface. 2 ∫ c (1 - c)^5 dc = 1/21. */
static inline float es_interface_mean(float f90) { return 1.0f - f90 * (0.04f + 0.96f / 21.0f); }

#endif
