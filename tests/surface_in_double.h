/* The surface model once more, from the formulas of its documentation alone (gi/surface.h), in double precision and in the frame of the
 * normal (z); and what it reflects of light that comes from everywhere, by quadrature. */
#ifndef EARTHSHINE_TESTS_SURFACE_IN_DOUBLE_H
#define EARTHSHINE_TESTS_SURFACE_IN_DOUBLE_H

#include "raster/raster.h"
#include "tests/statistics.h"

typedef struct exact_surface { uint32_t model; double base, metallic, roughness /* Phong: the exponent */, specular; } exact_surface;

static inline double fifth(double x) { return x * x * x * x * x; }

static inline double exact_brdf(const exact_surface* s, const double wi[3], const double wo[3])
{
    double nl = wi[2], nv = wo[2];
    if (s->model == ES_SURFACE_UNLIT || !(nl > 0 && nv > 0)) return 0;
    if (s->model == ES_SURFACE_PHONG) {
        double r = -wi[0] * wo[0] - wi[1] * wo[1] + wi[2] * wo[2]; /* wi mirrored at the normal, with wo */
        return s->base / pi + (r > 0 ? s->specular * (s->roughness + 2) / (2 * pi) * pow(r, s->roughness) : 0);
    }
    double h[3] = {wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]}, length = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    double nh = h[2] / length, vh = (wo[0] * h[0] + wo[1] * h[1] + wo[2] * h[2]) / length;
    double a = s->roughness * s->roughness, a2 = fmax(a * a, 6.25e-6), d = nh * nh * (a2 - 1) + 1;
    double distribution = a2 / (pi * d * d);
    double visibility = 0.5 / (nl * sqrt(nv * nv * (1 - a2) + a2) + nv * sqrt(nl * nl * (1 - a2) + a2));
    double f0 = s->base * s->metallic + 0.04 * s->specular * (1 - s->metallic), f90 = fmin(1, 25 * f0);
    double lobe = distribution * visibility * (f0 + (f90 - f0) * fifth(1 - vh));
    double in = 1 - f90 * (0.04 + 0.96 * fifth(1 - nl)), out = 1 - f90 * (0.04 + 0.96 * fifth(1 - nv));
    return s->base * (1 - s->metallic) / pi * in * out + lobe;
}

typedef struct albedo_quadrature { const exact_surface* s; double wo[3], axis[3], t[3], b[3]; } albedo_quadrature;

static inline double albedo_integrand(void* user, double theta, double phi)
{
    const albedo_quadrature* q = user;
    double wi[3], sine = sin(theta), x = sine * cos(phi), y = sine * sin(phi), z = cos(theta);
    for (int k = 0; k < 3; k++) wi[k] = x * q->t[k] + y * q->b[k] + z * q->axis[k];
    return wi[2] > 0 ? exact_brdf(q->s, wi, q->wo) * wi[2] * sine : 0;
}

/* Directional albedo, seen at the given cosine, to about 10^-4: polar coordinates about the mirror direction, rings that widen with the
 * angle, so that a lobe of any width covers several. */
static inline double exact_albedo(const exact_surface* s, double cosine)
{
    enum { RINGS = 24, SECTORS = 24 };
    double sine = sqrt(1 - cosine * cosine);
    albedo_quadrature q = {s, {sine, 0, cosine}, {-sine, 0, cosine}, {cosine, 0, sine}, {0, 1, 0}};
    double width = s->model == ES_SURFACE_PHONG ? 1 / sqrt(fmax(s->roughness, 1)) : s->roughness * s->roughness;
    double sum = 0, first = fmin(fmax(0.2 * width, 5e-4), 0.2), ring = 0;
    for (int i = 0; i < RINGS; i++) {
        double next = first * pow(pi / first, i / (double)(RINGS - 1));
        for (int j = 0; j < SECTORS; j++) sum += integrate(albedo_integrand, &q, ring, next, 2 * pi * j / SECTORS, 2 * pi * (j + 1) / SECTORS, 1e-7, 5);
        ring = next;
    }
    return sum;
}

#endif
