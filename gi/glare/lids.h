/* Eyelids and lashes: how far they are shut, by blinking and squinting, and what they cover.
 *
 * A shut eye would show nothing for a tenth of a second. The viewer's own eye does that; lids of this one stop at a slit, which scatters as narrow
 * slits do. */
#ifndef EARTHSHINE_GI_GLARE_LIDS_H
#define EARTHSHINE_GI_GLARE_LIDS_H

#include "gi/glare/eye_shapes.h"

enum { ES_UPPER_LASHES = 26, ES_LOWER_LASHES = 16, ES_LASH_SEGMENTS = 6 };

/* A quadratic Bézier curve from its root on the lid's edge; what is not the root's is relative to it, mm, `y` away from the eye's opening being positive. */
typedef struct es_lash { float root, fan, sag, rise, width; } es_lash;

typedef struct es_lids {
    es_lash upper[ES_UPPER_LASHES], lower[ES_LOWER_LASHES];
    float shut;                /* 0: as wide as ever; 1: a slit */
} es_lids;

void es_lids_begin(es_lids* lids, uint32_t seed);
/* 0 … 1: how far a blink has shut the lids at that step of the grid. One in about five seconds; 83 ms shutting, 33 ms shut, 167 ms opening (of the order of
 * Caffier et al. 2003). */
float es_blink(uint32_t seed, int64_t step);
/* 0 … 0.8: how far a field luminance in cd/m² narrows the lids: from 300 on, with 10,000 all the way. */
float es_squint(float luminance);
/* Both together, or any others: each shuts that share of what the other leaves open. */
static inline float es_shut_both(float a, float b) { return 1.0f - (1.0f - a) * (1.0f - b); }
void es_lids_add(const es_lids* lids, bool lashes, es_eye_shapes* shapes);

#endif
