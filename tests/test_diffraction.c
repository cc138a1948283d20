/* Power spectra of apertures against what is known of them, and their colours as pixels of a picture (gi/glare/diffraction.h). */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "gi/glare/diffraction.h"
#include "platform/context.h"
#include "platform/random.h"

#define PI 3.14159265358979323846

static es_context* context_of(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

static es_aperture aperture_of(uint32_t size, float width)
{
    es_aperture a = {size, width, calloc((size_t)size * size, sizeof(float))};
    assert_non_null(a.transmittance);
    return a;
}

/* A disc about the middle, `radius` in pixels, each pixel the share of it that is inside. */
static void draw_disc(es_aperture* a, double radius, float value)
{
    enum { SUB = 16 };
    for (uint32_t y = 0; y < a->size; y++)
        for (uint32_t x = 0; x < a->size; x++) {
            uint32_t inside = 0;
            for (int i = 0; i < SUB * SUB; i++) {
                const double u = x + (i % SUB + 0.5) / SUB - a->size / 2.0, v = y + (i / SUB + 0.5) / SUB - a->size / 2.0;
                inside += u * u + v * v < radius * radius;
            }
            a->transmittance[(size_t)y * a->size + x] += value * (float)inside / (SUB * SUB);
        }
}

static double power_at(const es_diffraction* d, int x, int y) { return (double)d->power[(size_t)((int)d->size / 2 + y) * d->stride + (size_t)((int)d->size / 2 + x)]; }

/* Airy: (2 J1(u) / u)², u = pi D theta / lambda: every sample near the middle, the first dark ring, the heights of two rings. */
static void test_airy(void** state)
{
    (void)state;
    enum { SIZE = 2048 };
    const double radius = 128, diameter = 2 * radius; /* pixels: the ring is 1.2197 · SIZE / diameter samples from the middle */
    es_context* context = context_of(2);
    es_aperture a = aperture_of(SIZE, 9e-3f);
    draw_disc(&a, radius, 1);
    es_diffraction d = {0};
    assert_int_equal(es_diffraction_update(context, &a, 0, &d), ES_OK);
    const double peak = power_at(&d, 0, 0);
    double most = 0;
    for (int y = -40; y <= 40; y++)
        for (int x = -40; x <= 40; x++) {
            const double u = PI * diameter * sqrt((double)(x * x + y * y)) / SIZE, airy = u > 0 ? 4 * j1(u) * j1(u) / (u * u) : 1;
            most = fmax(most, fabs(power_at(&d, x, y) / peak - airy));
        }
    if (!(most < 2e-4)) fail_msg("farthest from Airy's pattern: %g of its peak", most);
    /* The amplitude changes its sign at the ring: before or after the darkest sample, whichever makes it smoother. The parabola through three of them. */
    int k = 1;
    while (power_at(&d, k + 1, 0) < power_at(&d, k, 0)) k++;
    const double p = sqrt(power_at(&d, k - 1, 0)), r = -sqrt(power_at(&d, k + 1, 0)), darkest = sqrt(power_at(&d, k, 0));
    const double q = fabs(p + r - 2 * darkest) < fabs(p + r + 2 * darkest) ? darkest : -darkest;
    double best = k;
    for (int i = 0; i < 20; i++) { /* Newton */
        const double t = best - k;
        best -= (q + t * (r - p) / 2 + t * t * (p + r - 2 * q) / 2) / ((r - p) / 2 + t * (p + r - 2 * q));
    }
    const double theta = best / SIZE * diameter; /* in lambda / D */
    if (!(fabs(theta / 1.219669891 - 1) < 0.002)) fail_msg("first dark ring at %.5f lambda / D", theta);
    for (int ring = 0; ring < 2; ring++) {
        const double where = ring ? 2.679293 : 1.634719, height = ring ? 0.004158 : 0.017498; /* lambda / D */
        const double x = where * SIZE / diameter;
        double top = 0;
        for (int i = (int)x - 3; i <= (int)x + 3; i++) { /* the parabola's top, at the highest sample */
            const double p = power_at(&d, i - 1, 0), q = power_at(&d, i, 0), r = power_at(&d, i + 1, 0);
            if (q >= p && q >= r) top = q + (p - r) * (p - r) / (8 * (2 * q - p - r));
        }
        if (!(fabs(top / peak / height - 1) < 0.002)) fail_msg("ring %d is %.6f high", ring + 1, top / peak);
    }
    free(a.transmittance);
    es_diffraction_free(context, &d);
    es_context_destroy(context);
}

/* Bars of a spacing send light to lambda / spacing. */
static void test_grating(void** state)
{
    (void)state;
    enum { SIZE = 1024, SPACING = 12 };
    const float width = 9e-3f;
    es_context* context = context_of(2);
    es_aperture a = aperture_of(SIZE, width);
    draw_disc(&a, 200, 1);
    for (uint32_t y = 0; y < SIZE; y++)
        for (uint32_t x = 0; x < SIZE; x++)
            if (x % SPACING < 3) a.transmittance[(size_t)y * SIZE + x] *= 0.5f;
    es_diffraction d = {0};
    assert_int_equal(es_diffraction_update(context, &a, 0, &d), ES_OK);
    const double expected = (double)SIZE / SPACING; /* samples; in radians lambda / (SPACING · width / SIZE) */
    double sum = 0, weight = 0;
    for (int x = (int)expected - 4; x <= (int)expected + 5; x++)
        for (int y = -4; y <= 4; y++) {
            sum += x * power_at(&d, x, y);
            weight += power_at(&d, x, y);
        }
    if (!(fabs(sum / weight / expected - 1) < 0.001)) fail_msg("the first order is %.4f samples aside instead of %.4f", sum / weight, expected);
    assert_true(weight / d.total > 0.001);
    free(a.transmittance);
    es_diffraction_free(context, &d);
    es_context_destroy(context);
}

static void fill_with_anything(es_aperture* a)
{
    draw_disc(a, a->size / 3.0, 1);
    for (size_t i = 0; i < (size_t)a->size * a->size; i++) a->transmittance[i] *= es_unit_float(es_random_u32(3, (uint32_t)i));
}

/* All that comes through is in the spectrum, sharp or not, and what is not sharp becomes what is as the defocus goes to zero. */
static void test_parseval_and_limit(void** state)
{
    (void)state;
    static const uint32_t sizes[] = {64, 192, 512};
    es_context* context = context_of(2);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        const uint32_t size = sizes[i];
        es_aperture a = aperture_of(size, 9e-3f);
        fill_with_anything(&a);
        double through = 0;
        for (size_t k = 0; k < (size_t)size * size; k++) through += (double)a.transmittance[k] * (double)a.transmittance[k];
        es_diffraction sharp = {0}, other = {0};
        assert_int_equal(es_diffraction_update(context, &a, 0, &sharp), ES_OK);
        assert_true(fabs(sharp.total / (through * size * size) - 1) < 1e-5);
        double last = 1e30;
        for (float defocus = 0.5f; defocus > 1e-6f; defocus *= 0.1f) {
            assert_int_equal(es_diffraction_update(context, &a, defocus, &other), ES_OK);
            assert_true(fabs(other.total / (through * size * size) - 1) < 1e-5);
            double difference = 0;
            for (uint32_t y = 0; y < size; y++)
                for (uint32_t x = 0; x < size; x++) difference += fabs((double)sharp.power[y * sharp.stride + x] - (double)other.power[y * other.stride + x]);
            assert_true(difference < last);
            last = difference;
        }
        if (!(last / sharp.total < 1e-4)) fail_msg("%u pixels: %g of the light elsewhere at the least defocus", size, last / sharp.total);
        free(a.transmittance);
        es_diffraction_free(context, &sharp);
        es_diffraction_free(context, &other);
    }
    es_context_destroy(context);
}

/* Known of Fresnel's diffraction: a chirped beam of Gaussian amplitude becomes Gaussian again, its variance that of the beam's own angles and that of the
 * chirp's slopes; on the axis of a disc is (sin(u) / u)² of what is there without defocus, u = pi D R² / (2 lambda). */
static void test_fresnel(void** state)
{
    (void)state;
    enum { SIZE = 512 };
    const float width = 9e-3f;
    const double pixel = (double)width / SIZE, lambda = (double)ES_GLARE_WAVELENGTH;
    es_context* context = context_of(2);
    es_aperture a = aperture_of(SIZE, width);
    es_diffraction d = {0};
    for (float defocus = -0.6f; defocus < 0.7f; defocus += 0.3f) {
        const double sigma = 0.6e-3, slope = (double)defocus / lambda; /* cycles per metre and metre */
        for (uint32_t y = 0; y < SIZE; y++)
            for (uint32_t x = 0; x < SIZE; x++) {
                const double u = (x + 0.5 - SIZE / 2.0) * pixel, v = (y + 0.5 - SIZE / 2.0) * pixel;
                a.transmittance[(size_t)y * SIZE + x] = (float)exp(-(u * u + v * v) / (2 * sigma * sigma));
            }
        assert_int_equal(es_diffraction_update(context, &a, defocus, &d), ES_OK);
        const double variance = (1 / (4 * PI * PI * sigma * sigma) + slope * slope * sigma * sigma) / 2 * (double)width * (double)width; /* in samples² of one axis */
        double sum = 0, weight = 0, worst = 0;
        for (int y = -SIZE / 2 + 1; y < SIZE / 2; y++)
            for (int x = -SIZE / 2 + 1; x < SIZE / 2; x++) {
                const double p = power_at(&d, x, y) / d.total, expected = exp(-(x * x + y * y) / (2 * variance)) / (2 * PI * variance);
                sum += x * x * p;
                weight += p;
                worst = fmax(worst, fabs(p - expected) * 2 * PI * variance);
            }
        if (!(fabs(sum / weight / variance - 1) < 1e-3 && worst < 1e-3)) fail_msg("defocus %g: variance %g instead of %g, farthest from a Gaussian %g", (double)defocus, sum / weight, variance, worst);
    }
    const double radius = 100 * pixel;
    memset(a.transmittance, 0, (size_t)SIZE * SIZE * sizeof(float));
    draw_disc(&a, 100, 1);
    assert_int_equal(es_diffraction_update(context, &a, 0, &d), ES_OK);
    const double sharp = power_at(&d, 0, 0);
    for (float defocus = 0.05f; defocus < 0.5f; defocus += 0.05f) {
        const double u = PI * (double)defocus * radius * radius / (2 * lambda), expected = sin(u) * sin(u) / (u * u);
        assert_int_equal(es_diffraction_update(context, &a, defocus, &d), ES_OK);
        if (!(fabs(power_at(&d, 0, 0) / sharp - expected) < 0.001)) fail_msg("%g dioptres: %g on the axis instead of %g", (double)defocus, power_at(&d, 0, 0) / sharp, expected);
    }
    free(a.transmittance);
    es_diffraction_free(context, &d);
    es_context_destroy(context);
}

/* 1931's tables: peaks, and the ends. */
static void test_colours(void** state)
{
    (void)state;
    static const float known[][4] = {{450, 0.3362f, 0.0380f, 1.7721f}, {500, 0.0049f, 0.3230f, 0.2720f}, {550, 0.4334f, 0.9950f, 0.0087f}, {600, 1.0622f, 0.6310f, 0.0008f}, {650, 0.2835f, 0.1070f, 0.0f}};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        float xyz[3];
        es_colour_matching(known[i][0], xyz);
        for (int k = 0; k < 3; k++) assert_true(fabsf(xyz[k] - known[i][k + 1]) < 0.03f);
    }
    float weights[ES_GLARE_MAX_WAVELENGTHS][3];
    for (uint32_t n = 1; n <= ES_GLARE_MAX_WAVELENGTHS; n++) {
        es_spectral_weights(n, weights);
        for (int k = 0; k < 3; k++) {
            float sum = 0;
            for (uint32_t i = 0; i < n; i++) {
                assert_true(weights[i][k] >= 0);
                sum += weights[i][k];
            }
            assert_true(fabsf(sum - 1) < 1e-5f);
        }
    }
    /* blue before green before red */
    es_spectral_weights(32, weights);
    float means[3] = {0};
    for (uint32_t i = 0; i < 32; i++)
        for (int k = 0; k < 3; k++) means[k] += weights[i][k] * es_spectral_wavelength(i, 32);
    assert_true(means[2] > 430 && means[2] < 480 && means[1] > 520 && means[1] < 560 && means[0] > 580 && means[0] < 620);
}

/* By the definition, in double: the mean of straight lines between samples over each pixel, wavelength by wavelength. */
static double tent_area(double u) { return u <= -1 ? 0 : u >= 1 ? 1 : u < 0 ? (1 + u) * (1 + u) / 2 : 1 - (1 - u) * (1 - u) / 2; }

static void test_pixels(void** state)
{
    (void)state;
    enum { SIZE = 64, WAVES = 5 };
    es_context* context = context_of(3);
    es_aperture a = aperture_of(SIZE, 9e-3f);
    fill_with_anything(&a);
    es_diffraction d = {0};
    static const float scales[] = {0.31f, 1.0f, 2.7f, 40.0f, 1000.0f, 0.4f, 1.3f, 2.9f, 31.0f, 2000.0f};
    for (size_t i = 0; i < sizeof scales / sizeof scales[0]; i++) {
        assert_int_equal(es_diffraction_update(context, &a, i < 5 ? 0.1f : 0.0f, &d), ES_OK); /* the latter are symmetric */
        es_chromatic_blur blur = {0};
        es_glare_spectrum s = {0};
        const float pixel = scales[i] * ES_GLARE_WAVELENGTH / a.width;
        assert_int_equal(es_chromatic_blur_prepare(context, &d, pixel, WAVES, 1000, 1000, &blur), ES_OK);
        assert_int_equal(es_glare_spectrum_update(context, &d, &blur, &s), ES_OK);
        float weights[WAVES][3];
        es_spectral_weights(WAVES, weights);
        double sums[3] = {0};
        const int reach = (int)s.reach_x;
        for (int y = -reach; y <= reach; y++)
            for (int x = -reach; x <= reach; x++) {
                double expected[3] = {0};
                if (x % 7 == 0 && y % 5 == 0)
                    for (int w = 0; w < WAVES; w++) {
                        const double scale = (double)scales[i] * 575 / (double)es_spectral_wavelength((uint32_t)w, WAVES);
                        double sum = 0;
                        for (int v = -SIZE / 2 + 1; v < SIZE / 2; v++) {
                            const double b = tent_area((y + 0.5) * scale - v) - tent_area((y - 0.5) * scale - v);
                            if (b == 0) continue;
                            for (int u = -SIZE / 2 + 1; u < SIZE / 2; u++) sum += b * (tent_area((x + 0.5) * scale - u) - tent_area((x - 0.5) * scale - u)) * power_at(&d, u, v);
                        }
                        for (int k = 0; k < 3; k++) expected[k] += sum / d.paired * (double)weights[w][k];
                    }
                for (int k = 0; k < 3; k++) {
                    const double got = (double)s.at[k][(size_t)(y + reach) * s.stride + (size_t)(x + reach)];
                    assert_true(got >= 0);
                    sums[k] += got;
                    if (x % 7 == 0 && y % 5 == 0 && !(fabs(got - expected[k]) < 1e-6 + 1e-4 * expected[k])) fail_msg("scale %g, pixel (%d, %d): %g instead of %g", (double)scales[i], x, y, got, expected[k]);
                }
            }
        for (int k = 0; k < 3; k++)
            if (!(fabs(sums[k] - 1) < 2e-5)) fail_msg("scale %g: channel %d sums to %.8f", (double)scales[i], k, sums[k]);
        /* cut off, it is the same where it is */
        es_chromatic_blur less = {0};
        es_glare_spectrum part = {0};
        assert_int_equal(es_chromatic_blur_prepare(context, &d, pixel, WAVES, 5, 2, &less), ES_OK);
        assert_int_equal(es_glare_spectrum_update(context, &d, &less, &part), ES_OK);
        assert_true(part.reach_x <= 5 && part.reach_y <= 2);
        for (int y = -(int)part.reach_y; y <= (int)part.reach_y; y++)
            for (int x = -(int)part.reach_x; x <= (int)part.reach_x; x++)
                for (int k = 0; k < 3; k++) assert_true(part.at[k][(size_t)(y + (int)part.reach_y) * part.stride + (size_t)(x + (int)part.reach_x)] == s.at[k][(size_t)(y + reach) * s.stride + (size_t)(x + reach)]);
        es_chromatic_blur_free(context, &blur);
        es_chromatic_blur_free(context, &less);
        es_glare_spectrum_free(context, &s);
        es_glare_spectrum_free(context, &part);
    }
    free(a.transmittance);
    es_diffraction_free(context, &d);
    es_context_destroy(context);
}

static void test_darkness(void** state)
{
    (void)state;
    es_context* context = context_of(1);
    es_diffraction d = {0};
    es_aperture a = aperture_of(64, 9e-3f);
    assert_int_equal(es_diffraction_update(context, &a, 0, &d), ES_OK); /* lets nothing through */
    for (int y = -32; y < 32; y++)
        for (int x = -32; x < 32; x++) assert_true(power_at(&d, x, y) == (x == 0 && y == 0 ? 1.0 : 0.0));
    es_diffraction_free(context, &d);
    free(a.transmittance);
    es_context_destroy(context);
}

/* The same bits on every instruction set and for any number of threads. */
static void test_bits(void** state)
{
    (void)state;
    uint64_t expected = 0;
    for (int i = 0; i < 2 * ES_ISA_COUNT; i++) {
        if (!(es_isa_available_mask() >> i / 2 & 1)) continue;
        es_context_desc desc = es_default_context_desc();
        desc.threads = i % 2 ? 3 : 1;
        desc.isa_mask = 1u << i / 2;
        es_context* context;
        assert_int_equal(es_context_create(&desc, &context), ES_OK);
        es_aperture a = aperture_of(192, 9e-3f);
        fill_with_anything(&a);
        es_diffraction d = {0};
        es_chromatic_blur blur = {0};
        es_glare_spectrum s = {0};
        uint64_t hash = 0;
        for (int way = 0; way < 2; way++) {
            assert_int_equal(es_diffraction_update(context, &a, way ? 0.2f : 0.0f, &d), ES_OK);
            if (way) es_diffraction_fade(context, &d);
            assert_int_equal(es_chromatic_blur_prepare(context, &d, 2.3f * ES_GLARE_WAVELENGTH / a.width, 32, 100, 41, &blur), ES_OK);
            assert_int_equal(es_glare_spectrum_update(context, &d, &blur, &s), ES_OK);
            for (int k = 0; k < 3; k++) hash = es_hash_bytes(hash, s.at[k], s.stride * (2 * s.reach_y + 1) * sizeof(float));
        }
        if (i == 0) expected = hash;
        assert_int_equal(hash, expected);
        free(a.transmittance);
        es_diffraction_free(context, &d);
        es_chromatic_blur_free(context, &blur);
        es_glare_spectrum_free(context, &s);
        es_context_destroy(context);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_airy), cmocka_unit_test(test_grating), cmocka_unit_test(test_parseval_and_limit), cmocka_unit_test(test_fresnel), cmocka_unit_test(test_colours), cmocka_unit_test(test_pixels), cmocka_unit_test(test_darkness), cmocka_unit_test(test_bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
