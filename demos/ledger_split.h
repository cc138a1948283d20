/* The total error of a picture, split into parts that sum to it.
 *
 * Let M be the picture of a method, R the reference, D = M - R the total error of each pixel and channel, and <a, b> the mean of the
 * products of two pictures. A cause i of error can be switched off: then its approximation is replaced by what it approximates, and
 * nothing else changes. P_S is the picture with the set S of causes switched off; P_{} = M.
 *
 * The parts. Along one order of the causes, i's part is what switching it off changes, P_S - P_{S and i}, S being the causes
 * before it. Parts along an order telescope: pixel by pixel they sum to P_{} - P_all. Where causes act on each other (more
 * lights also average the errors of their shadow maps), a part depends on the order; so it is averaged over all n! orders
 * (Shapley 1953), which keeps the sum:
 *
 *     d_i = sum over S without i of |S|! (n - |S| - 1)! / n! · (P_S - P_{S and i}),        sum over i of d_i = P_{} - P_all.
 *
 * Causes that do not act on others may follow in any order after these, and d_rest = D - (the sum of all parts) is what no cause
 * explains; with it the parts sum to D exactly.
 *
 * The shares. The mean squared error is <D, D> = sum over i of <d_i, D>: each part's projection on the total error. Shares sum to one by
 * construction, products of two causes are shared between them, and a share is negative where a cause hides a part of what the others
 * do wrong. Besides: a part's own size √<d_i, d_i>, whatever the others do; and what goes away when i alone is switched off,
 * <D, D> - <E, E> with E = P_{i} - R. Those gains need not sum to <D, D>: what is missing is error that only goes away when several
 * causes do.
 *
 * Noise. References and pictures with chance in them are held as two halves, two independent estimates with the same mean: <a, b> is
 * taken between the one half of a and the other half of b, both ways, so that no noise is multiplied with itself; it has no bias
 * left, and half the difference of the two ways says how much noise there still is. A picture without chance is its own second half. */
#ifndef EARTHSHINE_DEMO_LEDGER_SPLIT_H
#define EARTHSHINE_DEMO_LEDGER_SPLIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { LEDGER_MAX_CAUSES = 8, LEDGER_MAX_PARTS = 12 };

/* Two estimates of one picture, or of the difference of two; both the same array where there is no chance. NULL, NULL: there is none. */
typedef struct ledger_picture { const float* half[2]; } ledger_picture;

/* The d_i above: pictures[S] of 2^causes sets, bit i of S set when cause i is switched off. parts[i][h]: `floats` floats each. */
void ledger_average_orders(const ledger_picture* pictures, uint32_t causes, size_t floats, float* (*parts)[2]);

/* Of one part, in products summed over pixels and channels. */
typedef struct ledger_part_sums {
    double share[2]; /* its projection on the total error, both ways */
    double own;      /* its square */
    double alone;    /* the total error's square that is left when it alone is switched off; meaningless without `switched` */
    bool switched;
} ledger_part_sums;

/* Sums of one picture or of several: they add up. Products are weighted where ledger_add was given weights. */
typedef struct ledger_sums {
    size_t part_count; /* the last one is the rest */
    ledger_part_sums parts[LEDGER_MAX_PARTS];
    double total;      /* of the total error's square */
    double noise;      /* of the square of the reference's own noise, its two halves averaged */
    double reference;  /* of the reference's values */
    double values;     /* how many */
} ledger_sums;

/* Adds one picture. d[i] are the parts without the rest; lost[i] is what the method's picture loses when i alone is switched off,
 * P_{} - P_{i}, or none. Every sum has the same parts: part_count is part_count + 1 afterwards. weights: of each pixel and channel's
 * squared error; NULL: all are 1. */
void ledger_add(ledger_sums* sums, const ledger_picture* method, const ledger_picture* reference, const ledger_picture* d, const ledger_picture* lost, size_t part_count, const float* weights,
    size_t floats);

/* Weights by which errors count in proportion to how bright it is where they are: m² / (b² + m² / 10) for a channel whose reference
 * has the mean b over the 5 × 5 pixels around, and the picture the mean m. So smooth that noise in the reference hardly weighs itself. */
void ledger_relative_weights(const ledger_picture* reference, uint32_t width, uint32_t height, uint32_t channels, float* weights);

/* Results: shares of the squared error in percent; sizes as a share of the reference's mean. NaN where there is nothing to divide by. */
double ledger_total(const ledger_sums* sums);                   /* relRMSE, the reference's noise taken out */
double ledger_noise(const ledger_sums* sums);                   /* relRMSE of the reference, by its halves */
double ledger_share(const ledger_sums* sums, size_t part);
double ledger_share_noise(const ledger_sums* sums, size_t part); /* of the share, ± percent */
double ledger_own(const ledger_sums* sums, size_t part);        /* 0 when it is less than the noise */
double ledger_gain(const ledger_sums* sums, size_t part);       /* that goes away when it alone is switched off */
double ledger_gains_missing(const ledger_sums* sums);           /* 100 less all gains */
size_t ledger_costliest(const ledger_sums* sums);               /* the part with the largest share, the rest aside */

#endif
