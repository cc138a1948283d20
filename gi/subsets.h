/* Which numbers of a low-discrepancy sequence the lights of an interleaved pattern have. */
#ifndef EARTHSHINE_GI_SUBSETS_H
#define EARTHSHINE_GI_SUBSETS_H

#include <stdint.h>

/* Light v is of subset v mod `subsets`. Lights of one subset have numbers that follow one another: each run of them is spread evenly. */
static inline uint32_t es_place_in_sequence(uint32_t light, uint32_t count, uint32_t subsets)
{
    const uint32_t subset = light % subsets, smaller = count / subsets, larger = count % subsets;
    return subset * smaller + (subset < larger ? subset : larger) + light / subsets;
}

#endif
