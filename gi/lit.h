/* Which parts of three planes may hold anything but zeros. Few pixels have lobes, so what lobes reflect is dark nearly everywhere: those who
 * know it neither read nor write it again. A byte for each row of ES_LIT_COLUMNS pixels, in rows of es_lit_chunks(): bit 0 is set where a
 * value may differ from +0; the others belong to whoever writes the planes. Writers hand out whole chunks, so that no two share a byte.
 * NULL: everything may be lit. */
#ifndef EARTHSHINE_GI_LIT_H
#define EARTHSHINE_GI_LIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { ES_LIT_COLUMNS = 128 };

static inline uint32_t es_lit_chunks(uint32_t stride) { return (stride + ES_LIT_COLUMNS - 1) / ES_LIT_COLUMNS; }

/* May anything be lit in rows [y0, y1) and columns [x0, x1)? */
static inline bool es_lit_within(const uint8_t* lit, uint32_t chunks, uint32_t x0, uint32_t x1, uint32_t y0, uint32_t y1)
{
    if (!lit) return true;
    uint8_t bits = 0;
    for (uint32_t y = y0; y < y1; y++)
        for (uint32_t c = x0 / ES_LIT_COLUMNS; c < chunks && c * ES_LIT_COLUMNS < x1; c++) bits |= lit[(size_t)y * chunks + c];
    return bits & 1;
}

#endif
