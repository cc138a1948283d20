/* The surface model's sampler against its density, and the model against the laws: energy, reciprocity. Directions are binned in polar
 * coordinates about the mirror direction with rings that widen with the angle, so that a lobe of any width covers many bins. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/surface.h"
#include "platform/random.h"
#include "tests/statistics.h"
#include "tests/surface_in_double.h"

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_random_float(77, counter++); }

static es_vec3 random_direction(void)
{
    float z = uniform(-1, 1), phi = uniform(0, 6.2831853f), r = es_sqrt(es_maxf(1 - z * z, 0));
    return es_v3_normalize(es_v3(r * es_cos(phi), r * es_sin(phi), z), es_v3(0, 0, 1));
}
/* at the given cosine to n */
static es_vec3 direction_at(es_vec3 n, float cosine)
{
    es_vec3 t, b;
    es_orthonormal_basis(n, &t, &b);
    float phi = uniform(0, 6.2831853f), r = es_sqrt((1 - cosine) * (1 + cosine));
    es_vec3 d = es_v3_add(es_v3_scale(n, cosine), es_v3_add(es_v3_scale(t, r * es_cos(phi)), es_v3_scale(b, r * es_sin(phi))));
    return es_v3_normalize(d, n);
}

typedef struct surface_case { uint32_t model; float base, metallic, roughness, specular, cosine; } surface_case;

static const surface_case cases[] = {
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.8f, 0, 0.5f, 0, 1.0f}, /* Lambert */
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.8f, 0, 0.5f, 0, 0.05f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 1.0f, 1, 1.0f}, /* metal, rough to mirror-like, from above to grazing */
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 1.0f, 1, 0.1f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.5f, 1, 0.9f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.5f, 1, 0.3f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.5f, 1, 0.02f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.2f, 1, 0.7f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.2f, 1, 0.1f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.9f, 1, 0.1f, 1, 0.5f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.5f, 0, 0.5f, 1, 0.9f}, /* dielectric: both parts */
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.5f, 0, 0.3f, 1, 0.2f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.1f, 0, 0.2f, 1, 0.05f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.0f, 0, 0.6f, 1, 0.6f},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.6f, 0.5f, 0.4f, 0.5f, 0.5f},
    {ES_SURFACE_PHONG, 0.0f, 0, 1, 0.8f, 1.0f},
    {ES_SURFACE_PHONG, 0.0f, 0, 10, 0.8f, 0.4f},
    {ES_SURFACE_PHONG, 0.0f, 0, 50, 0.8f, 0.1f},
    {ES_SURFACE_PHONG, 0.5f, 0, 20, 0.3f, 0.8f},
    {ES_SURFACE_PHONG, 0.3f, 0, 50, 0.5f, 0.05f},
};
enum { CASES = sizeof cases / sizeof cases[0] };

static es_surface surface_of(const surface_case* c) { return es_surface_of(c->model, es_v3(c->base, 0.7f * c->base, c->base), c->metallic, c->roughness, c->specular); }

/* ---- the formulas ------------------------------------------------------------------------------------------------------------------ */

/* Every model, written once more in double precision from its documentation, over random surfaces and directions. Rounding of NH² (1 - alpha²)
 * against 1 comes into the lobe twice: (6 ulp / what is left)². */
static void test_formulas(void** state)
{
    (void)state;
    for (int trial = 0; trial < 60000; trial++) {
        exact_surface e = {.model = trial % 8 == 0 ? ES_SURFACE_UNLIT : trial % 3 ? ES_SURFACE_METALLIC_ROUGHNESS : ES_SURFACE_PHONG};
        float base = uniform(0, 1), metallic = trial % 4 ? uniform(0, 1) : (float)(trial / 4 % 2), specular = trial % 5 ? uniform(0, 1) : 0;
        float roughness = e.model == ES_SURFACE_PHONG ? uniform(1, 50) : uniform(0.02f, 1);
        e.base = (double)base;
        e.metallic = (double)metallic;
        e.roughness = (double)roughness;
        e.specular = (double)specular;
        es_surface s = es_surface_of(e.model, es_v3(base, base, base), metallic, roughness, specular);
        es_vec3 n = es_v3(0, 0, 1), wo = direction_at(n, uniform(0.01f, 1)), wi = direction_at(n, uniform(0.01f, 1));
        /* half of them near the mirror direction, where the lobe is */
        if (trial & 1) wi = es_v3_normalize(es_v3_add(es_v3(-wo.x, -wo.y, wo.z), es_v3_scale(random_direction(), uniform(0, 0.2f))), n);
        const double i[3] = {(double)wi.x, (double)wi.y, (double)wi.z}, o[3] = {(double)wo.x, (double)wo.y, (double)wo.z};
        double expected = exact_brdf(&e, i, o), found = (double)es_surface_evaluate(&s, n, wi, wo).x;
        double h[3] = {i[0] + o[0], i[1] + o[1], i[2] + o[2]}, nh2 = h[2] * h[2] / (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
        double a2 = fmax(pow(e.roughness, 4), 6.25e-6), rounding = e.model == ES_SURFACE_METALLIC_ROUGHNESS ? 2 * 3.6e-7 / (1 - nh2 * (1 - a2)) : 1e-5;
        if (!(fabs(found - expected) <= (2e-5 + rounding) * expected)) fail_msg("trial %d, model %d: %.8g, expected %.8g (roughness %g)", trial, (int)e.model, found, expected, e.roughness);
    }
}

/* ---- densities ------------------------------------------------------------------------------------------------------------------ */

typedef struct view { es_surface surface; es_vec3 n, wo, axis, t, b; double width; bool reflected; } view;

static view view_of(const surface_case* c)
{
    view v = {.surface = surface_of(c), .n = random_direction()};
    v.wo = direction_at(v.n, c->cosine);
    v.axis = es_v3_normalize(es_v3_sub(es_v3_scale(v.n, 2 * es_v3_dot(v.n, v.wo)), v.wo), v.n);
    es_orthonormal_basis(v.axis, &v.t, &v.b);
    v.width = c->model == ES_SURFACE_PHONG ? 1 / sqrt((double)c->roughness) : c->roughness * c->roughness;
    if (c->specular == 0) v.width = 1;
    return v;
}

/* integrand over theta and phi about the axis: the density, or what is reflected of a uniform light */
static double integrand(void* user, double theta, double phi)
{
    const view* v = user;
    double s = sin(theta), a = s * cos(phi), b = s * sin(phi), c = cos(theta);
    es_vec3 wi = es_v3((float)(v->t.x * a + v->b.x * b + v->axis.x * c), (float)(v->t.y * a + v->b.y * b + v->axis.y * c), (float)(v->t.z * a + v->b.z * b + v->axis.z * c));
    if (!v->reflected) return s * (double)es_surface_density(&v->surface, v->n, wi, v->wo);
    float nl = es_v3_dot(v->n, wi);
    return nl > 0 ? s * (double)(es_surface_evaluate(&v->surface, v->n, wi, v->wo).x * nl) : 0;
}

enum { RINGS = 16, SECTORS = 12, PARTS = 4 /* of a bin's sides, for the horizon, at which densities jump to 0 */ };

/* 0, then from a quarter of the lobe's width to the opposite pole in equal ratios */
static double ring_border(const view* v, int ring)
{
    double first = fmin(0.25 * v->width, 0.2);
    return ring == 0 ? 0 : first * pow(pi / first, (ring - 1) / (double)(RINGS - 1));
}
static double integral(view* v, double cells[RINGS][SECTORS])
{
    double sum = 0;
    for (int i = 0; i < RINGS; i++)
        for (int j = 0; j < SECTORS; j++) {
            double cell = 0, ring = ring_border(v, i), height = (ring_border(v, i + 1) - ring) / PARTS, width = 2 * pi / (SECTORS * PARTS);
            for (int p = 0; p < PARTS * PARTS; p++) {
                double x = ring + p / PARTS * height, y = (PARTS * j + p % PARTS) * width;
                cell += integrate(integrand, v, x, x + height, y, y + width, 1e-6, 6);
            }
            if (cells) cells[i][j] = cell;
            sum += cell;
        }
    return sum;
}

static void test_sampler_follows_density(void** state)
{
    (void)state;
    enum { SAMPLES = 60000 };
    for (int k = 0; k < CASES; k++) {
        view v = view_of(&cases[k]);
        static double expected[RINGS][SECTORS], cells[RINGS * SECTORS + 1][2];
        double total = integral(&v, expected);
        if (!(total > 0.3 && total < 1 + 1e-3)) fail_msg("case %d: the density integrates to %g", k, total);
        memset(cells, 0, sizeof cells);
        for (int i = 0; i < RINGS * SECTORS; i++) cells[i][0] = SAMPLES * expected[i / SECTORS][i % SECTORS];
        cells[RINGS * SECTORS][0] = SAMPLES * fmax(1 - total, 0);
        for (int i = 0; i < SAMPLES; i++) {
            float u[3] = {uniform(0, 1), uniform(0, 1), uniform(0, 1)};
            es_surface_sample sample;
            if (!es_surface_sample_direction(&v.surface, v.n, v.wo, u, &sample)) {
                cells[RINGS * SECTORS][1]++;
                continue;
            }
            double x = (double)es_v3_dot(sample.wi, v.t), y = (double)es_v3_dot(sample.wi, v.b), z = (double)es_v3_dot(sample.wi, v.axis);
            double theta = atan2(sqrt(x * x + y * y), z), phi = atan2(y, x);
            if (phi < 0) phi += 2 * pi;
            int ring = 0, sector = (int)(phi * (SECTORS / (2 * pi)));
            while (ring + 1 < RINGS && theta >= ring_border(&v, ring + 1)) ring++;
            cells[ring * SECTORS + (sector < SECTORS ? sector : SECTORS - 1)][1]++;
        }
        int degrees;
        double deviate = chi_square_deviate(cells, RINGS * SECTORS + 1, &degrees);
        /* 1 % over all cases: one-sided 5·10^-4 each */
        if (!(deviate < 3.3)) fail_msg("case %d: chi-square %.2f standard deviations too large, %d degrees of freedom", k, deviate, degrees);
        assert_true(degrees > 10);
    }
}

static void test_weights(void** state)
{
    (void)state;
    for (int trial = 0; trial < 40000; trial++) {
        surface_case c = cases[trial % CASES];
        if (trial & 1) c.roughness = c.model == ES_SURFACE_PHONG ? uniform(0, 50) : uniform(0, 1);
        es_surface s = surface_of(&c);
        es_vec3 n = random_direction(), wo = direction_at(n, trial % 3 ? uniform(0, 1) : es_exp2(uniform(-30, 0)));
        float u[3] = {uniform(0, 1), trial % 5 ? uniform(0, 1) : 0, trial % 7 ? uniform(0, 1) : 0};
        if (trial % 11 == 0) u[1] = 1 - 1.0f / 16777216;
        es_surface_sample sample;
        if (!es_surface_sample_direction(&s, n, wo, u, &sample)) continue;
        float nl = es_v3_dot(n, sample.wi), length = es_v3_dot(sample.wi, sample.wi);
        assert_true(nl > 0 && fabsf(length - 1) < 1e-5f);
        assert_true(sample.density == es_surface_density(&s, n, sample.wi, wo));
        es_vec3 f = es_surface_evaluate(&s, n, sample.wi, wo);
        assert_true(isfinite(sample.weight.x) && isfinite(sample.weight.y) && sample.density > 0 && isfinite(sample.density));
        assert_true(fabsf(sample.weight.x * sample.density - f.x * nl) <= 4e-6f * f.x * nl + 1e-30f);
        assert_true(fabsf(sample.weight.y * sample.density - f.y * nl) <= 4e-6f * f.y * nl + 1e-30f);
    }
}

static void test_nothing_to_sample(void** state)
{
    (void)state;
    es_vec3 n = es_v3(0, 0, 1);
    const float u[3] = {0.5f, 0.5f, 0.5f};
    es_surface_sample sample;
    es_surface unlit = es_surface_of(ES_SURFACE_UNLIT, es_v3(1, 1, 1), 0, 0.5f, 1), black = es_surface_of(ES_SURFACE_PHONG, es_v3(0, 0, 0), 0, 5, 0);
    es_surface white = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(1, 1, 1), 0, 0.5f, 1);
    assert_false(es_surface_sample_direction(&unlit, n, n, u, &sample));
    assert_false(es_surface_sample_direction(&black, n, n, u, &sample));
    assert_false(es_surface_sample_direction(&white, n, es_v3(0, 0.8f, -0.6f), u, &sample));
    assert_true(es_surface_sample_direction(&white, n, n, u, &sample));
    assert_true(es_surface_density(&unlit, n, n, n) == 0 && es_surface_density(&black, n, n, n) == 0);
    assert_true(es_surface_density(&white, n, es_v3(0, 0.8f, -0.6f), n) == 0 && es_surface_density(&white, n, n, es_v3(0, 0.8f, -0.6f)) == 0);
    assert_true(es_surface_density(&white, n, n, n) > 0);
}

/* ---- the model's laws ---------------------------------------------------------------------------------------------------------------- */

/* The mean weight is the directional albedo; so is the integral of f cos, which the sampler has no part in. */
static void test_mean_weight_is_albedo(void** state)
{
    (void)state;
    enum { SAMPLES = 20000 };
    for (int k = 0; k < CASES; k++) {
        view v = view_of(&cases[k]);
        v.reflected = true;
        double albedo = integral(&v, NULL);
        running_mean mean = {0};
        for (int i = 0; i < SAMPLES; i++) {
            float u[3] = {uniform(0, 1), uniform(0, 1), uniform(0, 1)};
            es_surface_sample sample;
            mean_add(&mean, es_surface_sample_direction(&v.surface, v.n, v.wo, u, &sample) ? (double)sample.weight.x : 0);
        }
        /* 3.7: 1 % over all cases, two-sided; 10^-4: the quadrature's own error; 2 ulp of the 1 in NH² (alpha² - 1) + 1, which is alpha²
         * at the lobe's centre, hit the integral alone: in the weights they cancel */
        double rounding = v.surface.model == ES_SURFACE_PHONG ? 0 : 1.2e-7 / fmax(pow((double)v.surface.roughness, 4), (double)ES_SURFACE_MIN_ALPHA2);
        double difference = mean_of(&mean) - albedo, allowed = 3.7 * standard_error_of(&mean) + 1e-4 + rounding;
        if (!(fabs(difference) < allowed)) fail_msg("case %d: mean weight %g, albedo %g, allowed %g", k, mean_of(&mean), albedo, allowed);
    }
}

static void test_energy_over_random_surfaces(void** state)
{
    (void)state;
    enum { SAMPLES = 1500 };
    for (int trial = 0; trial < 600; trial++) {
        bool phong = trial % 3 == 0;
        float specular = uniform(0, 1);
        /* Phong's base and specular share what there is */
        es_surface s = phong ? es_surface_of(ES_SURFACE_PHONG, es_v3(1 - specular, 1 - specular, 1 - specular), 0, uniform(1, 50), specular)
                             : es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(1, 1, 1), trial % 2 ? uniform(0, 1) : 0, uniform(0, 1), specular);
        es_vec3 n = random_direction(), wo = direction_at(n, trial % 4 ? uniform(0.001f, 1) : uniform(0.001f, 0.1f));
        running_mean mean = {0};
        for (int i = 0; i < SAMPLES; i++) {
            float u[3] = {uniform(0, 1), uniform(0, 1), uniform(0, 1)};
            es_surface_sample sample;
            mean_add(&mean, es_surface_sample_direction(&s, n, wo, u, &sample) ? (double)sample.weight.x : 0);
        }
        /* 600 trials: 4.2 standard errors are exceeded once in a hundred runs; 0.005: rounding of mirror-like lobes */
        if (!(mean_of(&mean) <= 1.005 + 4.2 * standard_error_of(&mean)))
            fail_msg("trial %d: %g ± %g of the light comes back (roughness %g, specular %g)", trial, mean_of(&mean), standard_error_of(&mean), (double)s.roughness, (double)specular);
    }
}

static void test_reciprocity_over_random_directions(void** state)
{
    (void)state;
    for (int trial = 0; trial < 20000; trial++) {
        uint32_t model = trial & 1 ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS;
        es_surface s = es_surface_of(model, es_v3(uniform(0, 1), uniform(0, 1), uniform(0, 1)), uniform(0, 1), model == ES_SURFACE_PHONG ? uniform(0, 50) : uniform(0, 1), uniform(0, 1));
        es_vec3 n = random_direction(), a = direction_at(n, uniform(0, 1)), b = direction_at(n, uniform(0, 1));
        es_vec3 there = es_surface_evaluate(&s, n, a, b), back = es_surface_evaluate(&s, n, b, a);
        assert_true(there.x >= 0 && isfinite(there.x));
        assert_true(fabsf(there.x - back.x) <= 1e-5f * there.x && fabsf(there.y - back.y) <= 1e-5f * there.y && fabsf(there.z - back.z) <= 1e-5f * there.z);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_formulas),
        cmocka_unit_test(test_sampler_follows_density),
        cmocka_unit_test(test_weights),
        cmocka_unit_test(test_nothing_to_sample),
        cmocka_unit_test(test_mean_weight_is_albedo),
        cmocka_unit_test(test_energy_over_random_surfaces),
        cmocka_unit_test(test_reciprocity_over_random_directions),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
