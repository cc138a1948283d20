/* Value noise: random values at whole places, smoothly joined (Ebert et al. 2003, Texturing and Modeling, ch. 2). */
#ifndef EARTHSHINE_GI_GLARE_VALUE_NOISE_H
#define EARTHSHINE_GI_GLARE_VALUE_NOISE_H

#include <stdint.h>

/* [-1, 1], mean 0; `octaves` of twice the frequency and half the amplitude each, 1 … 8. |x| below 1e15. Even in value, slope and curvature over
 * the whole line. */
float es_value_noise(uint32_t seed, double x, uint32_t octaves);

#endif
