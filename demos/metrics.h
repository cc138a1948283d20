/* Error of an image A against a reference B. */
#ifndef EARTHSHINE_DEMO_METRICS_H
#define EARTHSHINE_DEMO_METRICS_H

#include "demo.h"

/* Over all pixels and the compared channels, with d = A - B:
 *   rmse     sqrt(mean(d²))
 *   relrmse  rmse / mean(B): the error as a share of the reference's mean
 *   relmse   mean(d² / (B² + 0.01)): per pixel, as the field's papers use it (Rousselle et al. 2011, ε = 10^-2)
 *   max      largest |d|
 * Sums are in double. A pair that is not finite counts as infinite error unless both are the same infinity or both NaN. */
typedef struct demo_metrics {
    double rmse, relrmse, relmse, max, mean;
    uint64_t samples;
} demo_metrics;

/* Which channels of the two images belong together. */
typedef struct demo_channels {
    uint32_t count, a[ES_IMAGE_MAX_CHANNELS], b[ES_IMAGE_MAX_CHANNELS];
} demo_channels;

/* Channels of the same name that both have; alpha only when there is nothing else; by position when no name is shared and
 * the counts are equal. False when neither works. */
bool demo_match_channels(const es_image* a, const es_image* b, demo_channels* channels);
/* mask: one byte per pixel, zero leaves it out; NULL: all. */
demo_metrics demo_measure(const es_image* a, const es_image* b, const demo_channels* channels, const uint8_t* mask);

#endif
