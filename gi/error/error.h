/* What the measures of error share: which channels belong together, when a pair of values is wrong, ordered sums. */
#ifndef EARTHSHINE_GI_ERROR_H
#define EARTHSHINE_GI_ERROR_H

#include "gi/gi.h"

/* Channels a[i] of A and b[i] of B belong together. */
typedef struct es_channel_pairs {
    uint32_t count, a[ES_IMAGE_MAX_CHANNELS], b[ES_IMAGE_MAX_CHANNELS];
    bool has_colour;
    uint32_t colour[3]; /* indices of the pairs that are red, green and blue: by name, else the first three */
} es_channel_pairs;

/* INVALID_ARGUMENT when the images' sizes differ or no channel of one belongs to one of the other. */
es_result es_pair_channels(es_context* context, const es_image* a, const es_image* b, es_channel_pairs* pairs);

static inline bool es_is_nan(float x) { return x != x; }
static inline bool es_is_finite(float x) { return __builtin_fabsf(x) <= 0x1.fffffep127f; }

/* Both are the same number, the same infinity, or both not a number. */
static inline bool es_same_value(float a, float b) { return a == b || (es_is_nan(a) && es_is_nan(b)); }

/* A - B; 0 for the same value, infinite when only that can be said, with the sign of the difference where there is one. */
static inline double es_difference(float a, float b)
{
    if (es_same_value(a, b)) return 0;
    if (es_is_finite(a) && es_is_finite(b)) return (double)a - (double)b;
    bool less = a < b; /* false when one is not a number */
    return less ? -__builtin_inf() : __builtin_inf();
}

/* A sum whose rounding errors are added up beside it (Neumaier 1974). Infinite terms make it infinite. */
typedef struct es_exact_sum {
    double sum, lost;
} es_exact_sum;
static inline void es_sum_add(es_exact_sum* s, double x)
{
    double total = s->sum + x;
    double lost = __builtin_fabs(s->sum) >= __builtin_fabs(x) ? (s->sum - total) + x : (x - total) + s->sum;
    s->lost += __builtin_fabs(total) <= 0x1.fffffffffffffp1023 ? lost : 0;
    s->sum = total;
}
static inline double es_sum_value(const es_exact_sum* s) { return s->sum + s->lost; }

/* A share of the reference's mean: 0 of nothing, infinite when there is an error and the mean is zero. */
double es_relative_to_mean(double error, double mean);

#endif
