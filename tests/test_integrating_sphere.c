/* The real-time methods in an integrating sphere. Inside a closed sphere of radius R any two points see each other with
 * cos cos / d² = 1 / 4R², so the first bounce lights every point alike, wherever the light stands and however it shines:
 *     E = albedo · flux / 4 pi R²,   L = albedo E / pi.
 * Nothing but the flux that the virtual point lights carry, the geometry term, the visibility and the reflection enters. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/small_worlds.h"
#include "tests/statistics.h"

enum { WIDTH = 64, HEIGHT = 48, SEGMENTS = 48 };

typedef struct lamp { es_light_type type; float inner, outer; es_vec3 position, direction; } lamp;

static const lamp lamps[] = {
    {ES_LIGHT_POINT, 0, 0, {0, 0, 0}, {0, 0, -1}},
    {ES_LIGHT_POINT, 0, 0, {0.5f, 0.3f, -0.4f}, {0, 0, -1}},
    {ES_LIGHT_SPOT, 0.3f, 0.9f, {0.2f, -0.3f, 0.1f}, {1, 0.5f, 0.2f}},
};

enum { LAMPS = sizeof lamps / sizeof lamps[0] };

/* Flux per W/sr on the axis: a spot's falloff is ((cos a - cos outer) / (cos inner - cos outer))² between the cones. */
static double flux_per_intensity(const lamp* l)
{
    return l->type == ES_LIGHT_POINT ? 4 * pi : 2 * pi * (1 - cos((double)l->inner) + (cos((double)l->inner) - cos((double)l->outer)) / 3);
}

static void sphere(small_world* w, const lamp* l, float radius, float albedo, float intensity)
{
    *w = small_world_create();
    es_material_desc wall = lambert(albedo, 0);
    add_sphere(w, es_v3(0, 0, 0), radius, SEGMENTS, true, &wall);
    es_light_desc light = es_default_light_desc();
    light.type = l->type;
    light.intensity = intensity;
    if (l->type == ES_LIGHT_SPOT) {
        light.inner_cone = l->inner;
        light.outer_cone = l->outer;
    }
    add_light(w, light, es_v3_scale(l->position, radius), l->direction);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.6f;
    camera.near_plane = 0.01f * radius;
    look(w, camera, es_v3(0, 0.1f * radius, 0.6f * radius), es_v3(0, 0, -radius));
}

static es_renderer_settings settings_of(uint32_t method)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.method = method;
    s.vpls = 256;
    s.light_size = 128;
    s.ism_points = 4096;
    s.ism_pool = 65536;
    s.shadow_size = 256;
    s.classic_size = 64;
    s.interleave = 4;
    s.view_importance = false;
    s.spread = 0;
    s.geometry_bound = 1e8f;
    return s;
}

static es_renderer* render(small_world* w, const es_renderer_settings* s)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, s, &renderer), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    return renderer;
}

/* Chords lie inside the sphere: facets of angle h = pi / SEGMENTS are h² R / 8 too near in their middles along each of two directions,
 * 2/3 of that on average, and two points share it. All of it is below this, relative. */
#define TESSELLATION (0.5 * (pi / SEGMENTS) * (pi / SEGMENTS))

/* Relative to `expected`, the mean may differ by the tessellation and `mean_bound`, pixels by `pixel_bound`. */
static void check(es_renderer* renderer, es_context* context, const char* name, double expected, double mean_bound, double pixel_bound)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    double mean = 0, lowest = INFINITY, highest = -INFINITY;
    size_t pixels = (size_t)image.width * image.height;
    for (size_t i = 0; i < pixels; i++) {
        double value = (double)image.pixels[3 * i] / expected - 1;
        mean += value / (double)pixels;
        lowest = fmin(lowest, value);
        highest = fmax(highest, value);
    }
    es_image_destroy(context, &image);
    if (!(fabs(mean) < TESSELLATION + mean_bound && lowest > -pixel_bound && highest < pixel_bound))
        fail_msg("%s: mean %+.4f, pixels %+.4f to %+.4f, relative to the analytic value", name, mean, lowest, highest);
}

/* ---- the tests ------------------------------------------------------------------------------------------------------------------------ */

static void bounce(uint32_t method, uint32_t bias, bool view_importance)
{
    for (size_t k = 0; k < LAMPS; k++) {
        const float radius = k == 1 ? 3.0f : 1.0f, albedo = 0.5f, intensity = 7.0f;
        small_world w;
        sphere(&w, &lamps[k], radius, albedo, intensity);
        es_renderer_settings s = settings_of(method);
        s.view_importance = view_importance;
        s.traced_bias = bias;
        if (bias != ES_TRACED_BOUNDED) {
            s.geometry_bound = es_default_renderer_settings().geometry_bound;
            s.spread = 2;
            s.traced_samples = 64;
        }
        es_renderer* renderer = render(&w, &s);
        double expected = (double)albedo * (double)albedo * (double)intensity * flux_per_intensity(&lamps[k]) / (4 * pi * pi * (double)(radius * radius));
        /* what of a pixel's 256 lights lies within a few texels of the horizon may be hidden */
        /* compensated, it has the noise of 64 rays a pixel: spread takes c / 4 ln(1 + 4 / c) = 5 % away (below), which they find by
         * chance, in single pixels from grazing directions */
        bool noisy = bias == ES_TRACED_COMPENSATED;
        check(renderer, w.context, "indirect", expected, noisy ? 4e-3 : 5e-4, noisy ? 1 : 0.03);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}
static void test_classic(void** state) { bounce(ES_GI_CLASSIC, 0, false); }
static void test_ism(void** state) { bounce(ES_GI_ISM, 0, false); }
static void test_vpl_traced(void** state) { bounce(ES_GI_VPL_TRACED, ES_TRACED_BOUNDED, false); }
static void test_vpl_traced_unbounded(void** state) { bounce(ES_GI_VPL_TRACED, ES_TRACED_UNBOUNDED, false); }
static void test_vpl_traced_compensated(void** state) { bounce(ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED, false); }
static void test_view_importance(void** state) { bounce(ES_GI_ISM, 0, true); }
/* All lights are seen and of one colour: the chosen one stands for its phase exactly. */
static void test_vpl_sampled(void** state) { bounce(ES_GI_VPL_SAMPLED, 0, false); }

/* With near light from as far as D, more than the diameter, the lights' 1 / 4R² is bounded by 1 / D², and the rays find the same 1 - 4R² / D² of
 * whatever they hit. */
static void test_near_light(void** state)
{
    small_world w;
    sphere(&w, &lamps[0], 1, 0.5f, 7);
    es_renderer_settings s = settings_of(ES_GI_VPL_SAMPLED);
    s.near_distance = 0.8f; /* D = 0.8 · 2 √3 R */
    es_renderer* renderer = render(&w, &s);
    check(renderer, w.context, "indirect", 0.25 * 7 / pi, 2e-3, 0.03);
    /* the lights' part alone */
    s.geometry_bound = 1 / (s.near_distance * s.near_distance);
    s.near_distance = 0;
    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
    check(renderer, w.context, "indirect", 0.25 * 7 / pi * 4 / (0.64 * 12), 2e-3, 0.03);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* A light of area a softened by spread: d² becomes d² + spread a / pi. In the sphere d² is spread evenly over 0 … 4R², so that
 * the mean of d² / (d² + c R²) is 1 - c / 4 ln(1 + 4 / c). */
static void test_spread(void** state)
{
    small_world w;
    sphere(&w, &lamps[0], 1, 0.5f, 7);
    es_renderer_settings s = settings_of(ES_GI_ISM);
    s.spread = 2;
    es_renderer* renderer = render(&w, &s);
    double c = (double)s.spread * 4 / s.vpls;
    check(renderer, w.context, "indirect", 0.25 * 7 / pi * (1 - c / 4 * log(1 + 4 / c)), 2e-3, 0.03);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* A lamp in the middle: everything faces it from one distance. */
static void test_direct(void** state)
{
    small_world w;
    sphere(&w, &lamps[0], 2, 0.5f, 7);
    es_renderer_settings s = settings_of(ES_GI_NONE);
    es_renderer* renderer = render(&w, &s);
    /* a pixel in fifty loses up to 5 % to the shadow map's finite resolution */
    check(renderer, w.context, "direct", 0.5 * 7 / (4 * pi), 5e-4, 0.06);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* The lights' flux is what the wall reflects, in each of 48 equal solid angles around the lamp up to the noise of counting lights. */
static void test_flux(void** state)
{
    for (size_t k = 0; k < LAMPS; k++) {
        small_world w;
        sphere(&w, &lamps[k], 1, 0.5f, 7);
        es_renderer_settings s = settings_of(ES_GI_ISM);
        s.vpls = 2048;
        s.ism_size = 32;
        s.ism_points = 64;
        es_renderer* renderer = render(&w, &s);
        static es_vpl vpls[2048];
        size_t count = es_renderer_vpls(renderer, vpls, 2048);
        double sum = 0, all = 0.5 * 7 * flux_per_intensity(&lamps[k]);
        static double cells[48][2];
        for (int i = 0; i < 48; i++) {
            cells[i][0] = (double)count / 48;
            cells[i][1] = 0;
        }
        for (size_t i = 0; i < count; i++) {
            double x = (double)vpls[i].position.x, y = (double)vpls[i].position.y, z = (double)vpls[i].position.z, r = sqrt(x * x + y * y + z * z);
            int band = (int)(4 * (y / r + 1)), sector = (int)(3 * (atan2(z, x) / pi + 1));
            cells[(band > 7 ? 7 : band) * 6 + (sector > 5 ? 5 : sector)][1] += (double)vpls[i].flux[0] / all * (double)count;
            sum += (double)vpls[i].flux[0];
        }
        assert_true(count > 1900);
        if (!(fabs(sum / all - 1) < 2e-3)) fail_msg("lamp %zu: the lights carry %+.4f of the flux too much", k, sum / all - 1);
        if (k == 0) assert_true(chi_square_deviate(cells, 48, NULL) < 2.5);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_classic),
        cmocka_unit_test(test_ism),
        cmocka_unit_test(test_vpl_traced),
        cmocka_unit_test(test_vpl_traced_unbounded),
        cmocka_unit_test(test_vpl_traced_compensated),
        cmocka_unit_test(test_vpl_sampled),
        cmocka_unit_test(test_near_light),
        cmocka_unit_test(test_view_importance),
        cmocka_unit_test(test_spread),
        cmocka_unit_test(test_direct),
        cmocka_unit_test(test_flux),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
