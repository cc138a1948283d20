/* Lobes of points, as the sum that prefilters them wants them: what a GGX or Phong lobe reflects of light from one direction, as the power that it sends
 * per area and solid angle,
 *     P(w) = C gain · p(mu · w) · c / max(c, d),   c = n · w,  d = ES_LOBE_HORIZON,
 * of radiance C gain · p(mu · w) / max(c, d): above the horizon all of the radiosity C, W/m², whatever the angle. p is one of two distributions on the sphere,
 *     GGX    p = 1 / (4 pi a) · (1 + b (1 - mu · w))^-2,   b = (1 - a) / (2 a)
 *     Phong  p = 7 b / (2 pi (1 - (1 + 2 b)^-7)) · (1 + b (1 - mu · w))^-8,   b = 1 / (14 a)
 * with a in place of alpha². The first is what GGX reflects of light along the normal if nothing is shadowed, exactly: with a = alpha² it is D / 4 as a function of
 * the reflected direction (a spherical Cauchy distribution, Kato and McCullagh 2020). Its tails fall with the fourth power of the angle, where those of a von
 * Mises–Fisher distribution end. The second is near enough to an exponential to stand for Phong's, by
 * multiplications alone.
 * At other angles mu, a and gain are what is nearest to the model in the mean square over directions, P and f cos each over its integral. What is left is
 * that GGX lobes at grazing angles are narrower across the plane of incidence than along it: tests/test_point_lobes.c states it.
 *
 * Both are as high at mu, 1 / (4 pi a), as a normal distribution whose variance is 2 a in each direction across mu. So when directions are spread by angles of variance s² in
 * each direction, a grows by s² / 2: by this nodes widen their lobes. */
#ifndef EARTHSHINE_GI_MICRO_LOBE_SHAPE_H
#define EARTHSHINE_GI_MICRO_LOBE_SHAPE_H

#include "gi/surface.h"
#include "platform/context.h"

/* Rows as in gi/micro/lobe_albedo.h; columns: cosines k / 16. Between, both are linear. */
enum { ES_SHAPE_ROWS = 17, ES_SHAPE_COLUMNS = 17, ES_SHAPE_CELLS = ES_SHAPE_ROWS * ES_SHAPE_COLUMNS };
#define ES_SHAPE_MAX_EXPONENT 51.0f
#define ES_LOBE_HORIZON 0.1f
/* Least a: of the model's sharpest lobe. */
#define ES_LOBE_LEAST_WIDTH ES_SURFACE_MIN_ALPHA2

/* Of GGX, of Phong. mu = n (c + lift) - (i - n c) lean, i being the unit vector towards the light and c = n · i; sqrt(a) is width times alpha, or times
 * 1 / √(2 (e + 1)) of Phong's exponent e. */
typedef struct es_lobe_shapes {
    bool filled;
    float lean[2][ES_SHAPE_CELLS], lift[2][ES_SHAPE_CELLS], width[2][ES_SHAPE_CELLS], gain[2][ES_SHAPE_CELLS];
} es_lobe_shapes;

/* Some ten milliseconds, once. */
void es_lobe_shapes_fill(es_context* context, es_lobe_shapes* shapes);

#endif
