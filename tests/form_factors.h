/* Form factors known in closed form, in double precision. */
#ifndef EARTHSHINE_TESTS_FORM_FACTORS_H
#define EARTHSHINE_TESTS_FORM_FACTORS_H

#include "platform/maths.h"
#include "tests/statistics.h"

/* Share of the hemisphere over a point, by cosine, that a polygon fills (Lambert 1760): 1/2 pi of the angles its edges span times the cosines
 * between the normal and the planes through them. The polygon lies above the horizon. */
static inline double point_to_polygon(es_vec3 point, es_vec3 normal, const es_vec3* corners, int count)
{
    double sum = 0;
    for (int i = 0; i < count; i++) {
        es_vec3 a = corners[i], b = corners[(i + 1) % count];
        double p[3] = {(double)a.x - (double)point.x, (double)a.y - (double)point.y, (double)a.z - (double)point.z};
        double q[3] = {(double)b.x - (double)point.x, (double)b.y - (double)point.y, (double)b.z - (double)point.z};
        double c[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
        double length = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]), angle = atan2(length, p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
        if (length > 0) sum += angle * (c[0] * (double)normal.x + c[1] * (double)normal.y + c[2] * (double)normal.z) / length;
    }
    return fabs(sum) / (2 * pi);
}

/* Howell, A Catalog of Radiation Heat Transfer Configuration Factors, C-11: equal rectangles a × b face each other at distance c. */
static inline double opposed_rectangles(double a, double b, double c)
{
    double x = a / c, y = b / c, x1 = sqrt(1 + x * x), y1 = sqrt(1 + y * y);
    return 2 / (pi * x * y) * (log(x1 * y1 / sqrt(1 + x * x + y * y)) + x * y1 * atan(x / y1) + y * x1 * atan(y / x1) - x * atan(x) - y * atan(y));
}

/* C-14: from a rectangle w × l to one h × l that stands on their common edge l. */
static inline double adjacent_rectangles(double w, double h, double l)
{
    double W = w / l, H = h / l, w2 = W * W, h2 = H * H, all = 1 + w2 + h2;
    double logs = log((1 + w2) * (1 + h2) / all) + w2 * log(w2 * all / ((1 + w2) * (w2 + h2))) + h2 * log(h2 * all / ((1 + h2) * (h2 + w2)));
    return (W * atan(1 / W) + H * atan(1 / H) - sqrt(h2 + w2) * atan(1 / sqrt(h2 + w2)) + 0.25 * logs) / (pi * W);
}

/* A sphere of radius r, its centre at distance d from the point in a direction of zenith angle b: the share of the hemisphere, by
 * cosine, that it fills, wholly or partly above the horizon (Howell's B-9: a plane element to a sphere). */
static inline double point_to_sphere(double r, double d, double b)
{
    double s = r / d, c = cos(b), sine = sin(b);
    if (c >= s) return s * s * c;
    if (c <= -s) return 0;
    double x = sqrt(1 / (s * s) - 1), y = -x * c / sine, root = sine * sqrt(1 - y * y);
    return (s * s * (c * acos(y) - x * root) + atan(root / x)) / pi;
}

#endif
