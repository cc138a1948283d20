/* Lat-long images of an environment: brought into a size the world keeps, and between rows of equal elevation. */
#ifndef EARTHSHINE_SIM_ENVIRONMENT_H
#define EARTHSHINE_SIM_ENVIRONMENT_H

#include "sim/world.h"

#ifdef __cplusplus
extern "C" {
#endif

#define ES_RADIANCE_LIMIT 1e12f /* a radiance times a texel of the same limit stays finite */

/* Sines of the elevations between which the rows lie: height + 1 from 1 to -1. */
void es_elevation_sines(uint32_t height, double* sines);

/* A copy with three channels, values that are no light 0 (said once), no larger than ES_ENVIRONMENT_MAX_WIDTH × _HEIGHT. `label` begins messages. False
 * after es_fail, with *copy zero. */
bool es_environment_copy(es_context* context, const char* label, const es_image* image, es_image* copy);

/* Six faces of a cube, +X, -X, +Y, -Y, +Z, -Z, as they are seen from its middle (EXT_lights_image_based; OpenGL's, left and right exchanged), to a lat-long image; the
 * cube is turned by `rotation`. The faces have one size and three channels or more. */
bool es_environment_from_cube(es_context* context, const es_image faces[6], es_quat rotation, es_image* image);

#ifdef __cplusplus
}
#endif

#endif
