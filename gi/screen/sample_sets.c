#include "gi/screen/sample_sets.h"

#include "platform/random.h"

/* Sobol's sequence by its direction numbers (Joe and Kuo 2008): the first three dimensions, polynomials 1, x + 1 and x² + x + 1. */
static uint32_t sobol(uint32_t dimension, uint32_t index)
{
    uint32_t direction[32], bits = 0;
    for (uint32_t i = 0; i < 32; i++) direction[i] = 0x80000000u >> i;
    if (dimension == 1)
        for (uint32_t i = 1; i < 32; i++) direction[i] = direction[i - 1] ^ (direction[i - 1] >> 1);
    if (dimension == 2) {
        direction[1] = 3u << 30;
        for (uint32_t i = 2; i < 32; i++) direction[i] = direction[i - 2] ^ (direction[i - 2] >> 2) ^ direction[i - 1];
    }
    for (uint32_t i = 0; index; index >>= 1, i++) bits ^= index & 1 ? direction[i] : 0;
    return bits;
}

/* Shifted by half of a cell, so that no coordinate is 0: in [0, 1). */
static float coordinate(uint32_t dimension, uint32_t index) { return es_unit_float(sobol(dimension, index) + 0x00800000u); }

/* Place of a pattern along a Morton curve; row by row where sides are no power of two. */
static uint32_t pattern_of(uint32_t sets, uint32_t x, uint32_t y)
{
    if (sets & (sets - 1)) return y * sets + x;
    uint32_t at = 0;
    for (uint32_t i = 0; i < 4; i++) at |= (x >> i & 1) << 2 * i | (y >> i & 1) << (2 * i + 1);
    return at;
}

es_screen_sample es_screen_sample_at(uint32_t sets, uint32_t samples, uint32_t x, uint32_t y, uint32_t i)
{
    const uint32_t index = pattern_of(sets, x, y) * samples + i;
    const float z = coordinate(0, index), r = es_sqrt(es_maxf(1.0f - z * z, 0.0f));
    float sine, cosine;
    es_sincos(2.0f * ES_PI * coordinate(1, index), &sine, &cosine);
    return (es_screen_sample){es_v3(r * cosine, r * sine, z), es_sqrt(coordinate(2, index))};
}

es_screen_disc_sample es_screen_disc_sample_at(uint32_t sets, uint32_t samples, uint32_t x, uint32_t y, uint32_t i)
{
    const uint32_t index = pattern_of(sets, x, y) * samples + i;
    const float radius = es_exp2(-6.0f * coordinate(0, index));
    float sine, cosine;
    es_sincos(2.0f * ES_PI * coordinate(1, index), &sine, &cosine);
    return (es_screen_disc_sample){radius * cosine, radius * sine, radius};
}
