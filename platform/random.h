/* Random numbers that depend on a counter only, and low-discrepancy points. */
#ifndef EARTHSHINE_PLATFORM_RANDOM_H
#define EARTHSHINE_PLATFORM_RANDOM_H

#include <stddef.h>
#include <stdint.h>

/* 32 random bits for (seed, counter): two rounds of a full-avalanche hash
 * (C. Wellons' lowbias32 constants) over both words. Passes the chi-square and serial tests in tests/. */
static inline uint32_t es_hash_u32(uint32_t x)
{
    x ^= x >> 16; x *= 0x7feb352du;
    x ^= x >> 15; x *= 0x846ca68bu;
    x ^= x >> 16;
    return x;
}
static inline uint32_t es_random_u32(uint32_t seed, uint32_t counter) { return es_hash_u32(es_hash_u32(counter + 0x9e3779b9u) ^ (seed * 0x85ebca6bu + 0xc2b2ae35u)); }
/* [0, 1), multiples of 2^-24 */
static inline float es_unit_float(uint32_t bits) { return (float)(bits >> 8) * (1.0f / 16777216.0f); }
static inline float es_random_float(uint32_t seed, uint32_t counter) { return es_unit_float(es_random_u32(seed, counter)); }

/* Radical inverse of `index` in a prime base 2 … 251, in [0, 1); dimension d of the Halton sequence uses the d-th prime. */
float es_radical_inverse(uint32_t base, uint32_t index);
float es_halton(uint32_t dimension, uint32_t index);  /* dimension 0 … 15 */

/* 64-bit hash of bytes, equal on every machine (words are read little-endian); start with seed 0 and chain. */
uint64_t es_hash_bytes(uint64_t seed, const void* bytes, size_t size);

#endif
