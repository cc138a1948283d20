/* A lat-long image resampled to the octahedral square so that no power is lost (gi/environment.h). */
#ifndef EARTHSHINE_GI_OCTAHEDRAL_H
#define EARTHSHINE_GI_OCTAHEDRAL_H

#include "gi/environment.h"

/* One of four directions of azimuth: the square's quarters are written apart. `size` texels along a side, a power of two of 4 or more; texels of
 * four floats with a border of one around them; of the quarter's own, the power of r, g and b and the solid angle are written. `rows`: the sine of the
 * elevation of the image's row borders, see es_elevation_sines. */
typedef struct es_octahedral_job {
    const es_environment_desc* environment;
    const double* rows;
    uint32_t size;
    float* texels;
} es_octahedral_job;

void es_octahedral_quarter(const es_octahedral_job* job, uint32_t quarter);

/* The direction of the middle of a texel, unit. */
es_vec3 es_octahedral_direction(uint32_t x, uint32_t y, uint32_t size);

#endif
