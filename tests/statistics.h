/* What the tests of samplers and estimators share: chi-square, quadrature over the sphere, running means. */
#ifndef EARTHSHINE_TESTS_STATISTICS_H
#define EARTHSHINE_TESTS_STATISTICS_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

static const double pi = 3.14159265358979323846;

/* ---- means ------------------------------------------------------------------------------------------------------------------ */

typedef struct running_mean { double sum, squares; uint64_t count; } running_mean;

static inline void mean_add(running_mean* m, double x)
{
    m->sum += x;
    m->squares += x * x;
    m->count++;
}
static inline double mean_of(const running_mean* m) { return m->sum / (double)m->count; }
static inline double standard_error_of(const running_mean* m)
{
    double mean = mean_of(m), n = (double)m->count;
    return sqrt(fmax(m->squares / n - mean * mean, 0) / (n - 1));
}

/* ---- chi-square ---------------------------------------------------------------------------------------------------------------- */

static inline int chi_square_by_expectation(const void* a, const void* b)
{
    const double *x = a, *y = b;
    return (x[0] > y[0]) - (x[0] < y[0]);
}

/* Standard normal deviate of the statistic (Wilson and Hilferty 1931, good to 0.01 from 10 degrees of freedom on). cells are pairs
 * (expected, observed) and get sorted; those of the smallest expectations are merged until each has 5 or more. All of what was
 * drawn has to be in some cell, so there is one degree of freedom less than cells. *degrees may be NULL. */
static inline double chi_square_deviate(double (*cells)[2], int count, int* degrees)
{
    qsort(cells, (size_t)count, sizeof *cells, chi_square_by_expectation);
    double statistic = 0, expected = 0, observed = 0, left = 0;
    int used = 0;
    for (int i = 0; i < count; i++) left += cells[i][0];
    for (int i = 0; i < count; i++) {
        expected += cells[i][0];
        observed += cells[i][1];
        left -= cells[i][0];
        if (i + 1 < count && (expected < 5 || left < 5)) continue;
        statistic += (observed - expected) * (observed - expected) / fmax(expected, 1e-3);
        used++;
        expected = observed = 0;
    }
    double k = used - 1;
    if (degrees) *degrees = used - 1;
    if (used < 2) return INFINITY;
    return (cbrt(statistic / k) - (1 - 2 / (9 * k))) / sqrt(2 / (9 * k));
}

/* ---- quadrature ---------------------------------------------------------------------------------------------------------------- */

typedef double (*plane_function)(void* user, double x, double y);

static inline double midpoints(plane_function f, void* user, double x0, double x1, double y0, double y1, int n)
{
    double sum = 0, dx = (x1 - x0) / n, dy = (y1 - y0) / n;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) sum += f(user, x0 + (i + 0.5) * dx, y0 + (j + 0.5) * dy);
    return sum * dx * dy;
}

/* Midpoint rule, halved in both directions until two levels agree to `tolerance`, absolute, at most `depth` times. Where f jumps, two
 * levels may agree by chance: a caller whose f does cuts its domain into many. */
static inline double integrate(plane_function f, void* user, double x0, double x1, double y0, double y1, double tolerance, int depth)
{
    double coarse = midpoints(f, user, x0, x1, y0, y1, 4), fine = midpoints(f, user, x0, x1, y0, y1, 6);
    if (depth == 0 || fabs(fine - coarse) <= tolerance) return fine;
    double x = 0.5 * (x0 + x1), y = 0.5 * (y0 + y1);
    return integrate(f, user, x0, x, y0, y, 0.3 * tolerance, depth - 1) + integrate(f, user, x, x1, y0, y, 0.3 * tolerance, depth - 1) +
           integrate(f, user, x0, x, y, y1, 0.3 * tolerance, depth - 1) + integrate(f, user, x, x1, y, y1, 0.3 * tolerance, depth - 1);
}

#endif
