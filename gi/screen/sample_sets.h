/* Points that a surface's surroundings are tested at (Ritschel thesis §4.2.1 and §4.2.3): M = sets² patterns of N points, of which every pixel uses one
 * by its place in the picture, and a sets × sets filter brings all of them together.
 *
 * The M · N points are the first of a Sobol sequence, pattern after pattern in the order of a Morton curve: each pattern by itself, those of any 2 × 2
 * neighbours and all together are spread evenly, over directions as over lengths. */
#ifndef EARTHSHINE_GI_SCREEN_SAMPLE_SETS_H
#define EARTHSHINE_GI_SCREEN_SAMPLE_SETS_H

#include "platform/maths.h"

enum { ES_SCREEN_MAX_SETS = 8, ES_SCREEN_MAX_SAMPLES = 64 };

/* λω: a unit direction of the hemisphere about +z, uniform by solid angle, and a share of the radius, whose square is uniform: one at x of the radius is
 * found to occlude by 1 - x² of the samples towards it, if it is thick. Turned round where it lies below a surface, a
 * direction is one of the surface's own hemisphere, as evenly spread. */
typedef struct es_screen_sample { es_vec3 direction; float length; } es_screen_sample;

/* Point i < samples of the pattern of pixels whose column is x and whose row is y modulo `sets`. */
es_screen_sample es_screen_sample_at(uint32_t sets, uint32_t samples, uint32_t x, uint32_t y, uint32_t i);

/* A point of the unit disc at (x, y), whose density per area is 1 / (2 pi ln(1 / ES_SCREEN_DISC_INNER) radius²): as many points in each octave of
 * radii, none within the inner one. */
#define ES_SCREEN_DISC_INNER 0.015625f
#define ES_SCREEN_DISC_LOG 4.158883083f /* ln 64 */
typedef struct es_screen_disc_sample { float x, y, radius; } es_screen_disc_sample;
es_screen_disc_sample es_screen_disc_sample_at(uint32_t sets, uint32_t samples, uint32_t x, uint32_t y, uint32_t i);

#endif
