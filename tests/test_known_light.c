/* Light that is known in closed form: form factors of rectangles, a glowing sphere over a plane, the laws of distance and cosine of every
 * kind of light. The reference has glowing surfaces; for the real-time methods, whose surfaces do not light others by glowing, a rectangle
 * in the sun takes their place: a uniform Lambertian emitter of radiance albedo · irradiance / pi, seen through one bounce. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/form_factors.h"
#include "tests/reference_runs.h"

/* ---- the closed forms themselves ------------------------------------------------------------------------------------------------------- */

typedef struct two_rectangles { es_vec3 emitter[4]; es_vec3 normal; bool wall; float height; } two_rectangles;

static double over_receiver(void* user, double x, double y)
{
    const two_rectangles* r = user;
    es_vec3 p = r->wall ? es_v3(0, (float)x, (float)y) : es_v3((float)x, r->height, (float)y);
    return point_to_polygon(p, r->normal, r->emitter, 4);
}

static double cap(void* user, double theta, double phi)
{
    double b = *(const double*)user, c = cos(b) * cos(theta) + sin(b) * sin(theta) * cos(phi);
    return c > 0 ? c * sin(theta) / pi : 0;
}

static void test_closed_forms(void** state)
{
    two_rectangles across = {{{0, 0, 0}, {1.5f, 0, 0}, {1.5f, 0, 0.7f}, {0, 0, 0.7f}}, {0, -1, 0}, false, 0.8f};
    double mean = integrate(over_receiver, &across, 0, 1.5, 0, 0.7, 1e-6, 6) / (1.5 * 0.7);
    assert_true(fabs(mean - opposed_rectangles(1.5, 0.7, 0.8)) < 1e-5);
    two_rectangles adjacent = {{{0, 0, 0}, {1.5f, 0, 0}, {1.5f, 0, 0.7f}, {0, 0, 0.7f}}, {1, 0, 0}, true, 0};
    mean = integrate(over_receiver, &adjacent, 0, 0.4, 0, 0.7, 1e-5, 6) / (0.4 * 0.7);
    assert_true(fabs(mean - adjacent_rectangles(0.4, 1.5, 0.7)) < 1e-4);
    for (int i = 0; i < 12; i++) {
        double b = 0.1 + 0.16 * i, r = 0.3 + 0.05 * i, share = 0;
        for (int k = 0; k < 64; k++) share += integrate(cap, &b, asin(r) * (k / 8) / 8, asin(r) * (k / 8 + 1) / 8, pi / 4 * (k % 8), pi / 4 * (k % 8 + 1), 1e-8, 6);
        assert_true(fabs(share - point_to_sphere(r, 1, b)) < 1e-4); /* the quadrature's own, where the horizon cuts the sphere */
    }
}

/* ---- rectangles ---------------------------------------------------------------------------------------------------------------------------- */

enum { GRID = 16 };
static const float radiance = 3, receiver_albedo = 0.6f;

/* The picture is the receiver, edge to edge; rays over the pixels' areas make its mean that over the receiver's area. */
static void check_mean(small_world* w, uint32_t width, uint32_t height, double expected, const char* what)
{
    es_reference_settings s = reference_settings(width, height, 0);
    s.antialias = true;
    es_reference* reference = trace(w, &s, 256 / FEWER);
    measured m = mean_of_reference(w, reference, "direct");
    expected *= (double)radiance * (double)receiver_albedo;
    /* 4 standard errors; the edges' last rays may pass the receiver by a rounding: a millionth */
    if (!(fabs(m.value - expected) <= 4 * m.error + 1e-6 * expected)) fail_msg("%s: %.6f ± %.6f, expected %.6f", what, m.value, m.error, expected);
    if (!(m.error < 8e-3 * sqrt(FEWER) * expected)) fail_msg("%s: a standard error of %g cannot tell", what, m.error / expected);
    es_reference_destroy(reference);
}

static void test_opposed_rectangles(void** state)
{
    static const float distances[] = {0.25f, 1, 4};
    for (int i = 0; i < 3; i++) {
        small_world w = small_world_create();
        es_material_desc glowing = lambert(0, radiance), grey = lambert(receiver_albedo, 0);
        /* 2 × 1, facing down, and below it one that faces up; the camera looks through the upper one's back */
        add_rectangle(&w, es_v3(-1, distances[i], -0.5f), es_v3(2, 0, 0), es_v3(0, 0, 1), &glowing);
        add_rectangle(&w, es_v3(-1, 0, 0.5f), es_v3(2, 0, 0), es_v3(0, 0, -1), &grey);
        look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 6, 0.5f);
        check_mean(&w, 2 * GRID, GRID, opposed_rectangles(2, 1, (double)distances[i]), "opposed rectangles");
        small_world_destroy(&w);
    }
}

static void test_adjacent_rectangles(void** state)
{
    static const float heights[] = {0.25f, 1, 3};
    for (int i = 0; i < 3; i++) {
        small_world w = small_world_create();
        es_material_desc glowing = lambert(0, radiance), grey = lambert(receiver_albedo, 0);
        /* a wall over the edge x = 0 of the floor 2 × 1 */
        add_rectangle(&w, es_v3(0, 0, 0.5f), es_v3(0, 0, -1), es_v3(0, heights[i], 0), &glowing);
        add_rectangle(&w, es_v3(0, 0, 0.5f), es_v3(2, 0, 0), es_v3(0, 0, -1), &grey);
        look_straight(&w, es_v3(1, 0, 0), es_v3(0, 1, 0), 6, 0.5f);
        check_mean(&w, 2 * GRID, GRID, adjacent_rectangles(2, (double)heights[i], 1), "adjacent rectangles");
        small_world_destroy(&w);
    }
}

/* Point by point, from a rectangle that stands askew, and far from it as from a point: L A cos cos / d². */
static void test_glowing_rectangle(void** state)
{
    static const float scales[] = {1, 0.25f, 0.05f};
    for (int i = 0; i < 3; i++) {
        small_world w = small_world_create();
        es_material_desc glowing = lambert(0, radiance), grey = lambert(receiver_albedo, 0);
        es_vec3 u = es_v3_scale(es_v3(0.8f, 0.3f, 0.1f), scales[i]), v = es_v3_scale(es_v3(-0.1f, -0.2f, 0.9f), scales[i]), middle = es_v3(0.2f, 1.1f, -0.3f);
        es_vec3 corner = es_v3_sub(middle, es_v3_scale(es_v3_add(u, v), 0.5f));
        add_rectangle(&w, corner, u, v, &glowing);
        add_rectangle(&w, es_v3(-1.5f, 0, 1.5f), es_v3(3, 0, 0), es_v3(0, 0, -3), &grey);
        look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 6, 1.4f);
        const es_vec3 corners[4] = {corner, es_v3_add(corner, u), es_v3_add(es_v3_add(corner, u), v), es_v3_add(corner, v)};
        es_reference_settings s = reference_settings(GRID, GRID, 0);
        es_reference* reference = trace(&w, &s, 512 / FEWER);
        es_image image = traced(reference, "direct"), error = traced(reference, "direct-error");
        running_mean deviations = {0}, squares = {0};
        es_vec3 area = es_v3_cross(u, v);
        for (uint32_t y = 0; y < GRID; y++)
            for (uint32_t x = 0; x < GRID; x++) {
                es_vec3 p = pixel_on_plane(&w, GRID, GRID, x, y, es_v3(0, 0, 0), es_v3(0, 1, 0)), d = es_v3_sub(middle, p);
                double value = (double)image.pixels[3 * (y * GRID + x)], e = (double)error.pixels[3 * (y * GRID + x)];
                double expected = point_to_polygon(p, es_v3(0, 1, 0), corners, 4) * (double)(radiance * receiver_albedo), z = (value - expected) / e;
                mean_add(&deviations, z);
                mean_add(&squares, z * z);
                /* 256 pixels: 5 standard errors are passed once in seven thousand runs */
                if (!(fabs(z) < 5)) fail_msg("scale %g, pixel %u %u: %.6f ± %.6f, expected %.6f", (double)scales[i], x, y, value, e, expected);
                double d2 = (double)es_v3_dot(d, d), far_field = (double)(radiance * receiver_albedo) / pi * (double)(d.y * -es_v3_dot(area, d)) / (d2 * d2);
                /* both cosines and 1 / d² change by the extent over the distance; the first order cancels over the rectangle */
                double extent2 = 3 * (double)(scales[i] * scales[i]) / d2;
                assert_true(fabs(expected - fabs(far_field)) <= extent2 * fabs(far_field));
            }
        /* the deviate of their mean; their variance: at most 1, for samples that are stratified vary less than counted */
        if (!(fabs(mean_of(&deviations)) < 4 / sqrt(GRID * GRID))) fail_msg("scale %g: the pixels are %.2f standard errors off on average", (double)scales[i], mean_of(&deviations));
        assert_true(mean_of(&squares) < 1 + 4 * sqrt(2.0 / (GRID * GRID)));
        es_image_destroy(w.context, &image);
        es_image_destroy(w.context, &error);
        es_reference_destroy(reference);
        small_world_destroy(&w);
    }
}

/* A floor in the sun and a wall over its edge, which the light only grazes; or a ceiling above it that the sun passes below. */
static void sunlit_rectangle(bool wall)
{
    static const struct { uint32_t method, bias; bool loses; } methods[] = {
        {ES_GI_ISM, 0, false}, {ES_GI_CLASSIC, 0, false}, {ES_GI_VPL_TRACED, ES_TRACED_BOUNDED, true}, {ES_GI_VPL_TRACED, ES_TRACED_UNBOUNDED, false}, {ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED, false}};
    enum { SETS = 3 };
    small_world w = small_world_create();
    const float floor_albedo = 0.7f, irradiance = 5;
    es_material_desc bright = lambert(floor_albedo, 0), grey = lambert(receiver_albedo, 0);
    const es_vec3 corners[4] = {{0, 0, 0.5f}, {1, 0, 0.5f}, {1, 0, -0.5f}, {0, 0, -0.5f}};
    add_rectangle(&w, corners[0], es_v3(1, 0, 0), es_v3(0, 0, -1), &bright);
    es_light_desc sun = es_default_light_desc();
    sun.type = ES_LIGHT_DIRECTIONAL;
    es_vec3 middle, normal;
    if (wall) {
        add_rectangle(&w, es_v3(0, 0, 0.5f), es_v3(0, 0, -1), es_v3(0, 1, 0), &grey);
        middle = es_v3(0, 0.5f, 0);
        normal = es_v3(1, 0, 0);
        sun.intensity = irradiance;
        add_light(&w, sun, es_v3(0, 0, 0), es_v3(0, -1, 0));
    } else {
        add_rectangle(&w, es_v3(0, 1.2f, -0.5f), es_v3(1, 0, 0), es_v3(0, 0, 1), &grey);
        middle = es_v3(0.5f, 1.2f, 0);
        normal = es_v3(0, -1, 0);
        sun.intensity = irradiance * 1.41421356f;
        add_light(&w, sun, es_v3(0, 0, 0), es_v3(-1, -1, 0));
    }
    look_straight(&w, middle, normal, wall ? 6 : 1.1f, 0.5f);
    double expected[GRID * GRID], all = 0;
    for (uint32_t y = 0; y < GRID; y++)
        for (uint32_t x = 0; x < GRID; x++) {
            es_vec3 p = pixel_on_plane(&w, GRID, GRID, x, y, middle, normal);
            expected[y * GRID + x] = point_to_polygon(p, normal, corners, 4) * (double)(receiver_albedo * floor_albedo * irradiance) / pi;
            all += expected[y * GRID + x] / (GRID * GRID);
        }
    for (size_t m = 0; m < sizeof methods / sizeof methods[0]; m++) {
        es_renderer_settings s = es_default_renderer_settings();
        s.method = methods[m].method;
        s.traced_bias = methods[m].bias;
        s.width = s.height = GRID;
        s.vpls = 512;
        s.light_size = 256;
        s.shadow_size = 256;
        s.interleave = 1;
        s.filter_passes = 0;
        s.view_importance = false;
        s.ism_points = 2048;
        s.ism_pool = 32768;
        s.classic_size = 64;
        if (s.method != ES_GI_VPL_TRACED) {
            s.spread = 0;
            s.geometry_bound = 1e8f;
        }
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
        double found[GRID * GRID] = {0}, mean = 0, squares = 0;
        for (uint32_t set = 0; set < SETS; set++) {
            s.seed = 977 * set;
            assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
            assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
            es_image image;
            assert_int_equal(es_renderer_image(renderer, "indirect", &image), ES_OK);
            for (int i = 0; i < GRID * GRID; i++) found[i] += (double)image.pixels[3 * i] / SETS;
            es_image_destroy(w.context, &image);
        }
        es_renderer_destroy(renderer);
        for (int i = 0; i < GRID * GRID; i++) {
            mean += found[i] / (GRID * GRID);
            squares += (found[i] - expected[i]) * (found[i] - expected[i]) / (GRID * GRID);
        }
        /* The light's picture has some 130 texels along the floor's sides, so that its area is right to half a percent in each direction.
         * A light spread over 2 / 512 of the floor is softer than a point within 5 cm, which is at the wall's foot: a pixel's width there. */
        double low = methods[m].loses ? -0.06 : -0.01, rms = wall ? methods[m].loses ? 0.15 : 0.05 : 0.03;
        if (!(mean / all - 1 > low && mean / all - 1 < 0.01 && sqrt(squares) < rms * all)) fail_msg("method %zu: the mean is off by %+.4f, pixels by %.4f", m, mean / all - 1, sqrt(squares) / all);
    }
    small_world_destroy(&w);
}
static void test_sunlit_wall(void** state) { sunlit_rectangle(true); }
static void test_sunlit_ceiling(void** state) { sunlit_rectangle(false); }

/* ---- a sphere -------------------------------------------------------------------------------------------------------------------------------- */

/* E = pi L (R / d)² cos where the whole sphere is above the horizon. The mesh is inscribed: all of it is between the sphere and one of
 * radius R cos²(h / 2), h being the angle between its vertices, and what a convex body fills of the sky grows with it. */
static void test_glowing_sphere(void** state)
{
    enum { SEGMENTS = 48 };
    static const struct { es_vec3 centre; float radius; } cases[] = {{{0.3f, 1.2f, -0.2f}, 0.4f}, {{0, 0.5f, 0}, 0.45f}, {{1.9f, 0.15f, 0.1f}, 0.5f}, {{-2, -0.2f, 0.4f}, 0.6f}};
    const double inner = cos(pi / SEGMENTS / 2) * cos(pi / SEGMENTS / 2);
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        small_world w = small_world_create();
        es_material_desc glowing = lambert(0, radiance), grey = lambert(receiver_albedo, 0);
        add_sphere(&w, cases[i].centre, cases[i].radius, SEGMENTS, false, &glowing);
        add_rectangle(&w, es_v3(-1.3f, 0, 1.3f), es_v3(2.6f, 0, 0), es_v3(0, 0, -2.6f), &grey);
        look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 6, 1.28f);
        es_reference_settings s = reference_settings(GRID, GRID, 0);
        es_reference* reference = trace(&w, &s, 512 / FEWER);
        es_image image = traced(reference, "direct"), error = traced(reference, "direct-error"), emission = traced(reference, "emission");
        running_mean deviations = {0};
        int seen = 0, cut = 0;
        for (uint32_t k = 0; k < GRID * GRID; k++) {
            if (emission.pixels[3 * k] > 0) continue; /* the sphere itself */
            es_vec3 p = pixel_on_plane(&w, GRID, GRID, k % GRID, k / GRID, es_v3(0, 0, 0), es_v3(0, 1, 0)), d = es_v3_sub(cases[i].centre, p);
            double distance = sqrt((double)es_v3_dot(d, d)), angle = acos((double)d.y / distance), r = (double)cases[i].radius;
            double high = point_to_sphere(r, distance, angle) * (double)(radiance * receiver_albedo), low = point_to_sphere(inner * r, distance, angle) * (double)(radiance * receiver_albedo);
            double value = (double)image.pixels[3 * k], e = (double)error.pixels[3 * k];
            if (FEWER == 1 && !(value > low - 5 * e && value < high + 5 * e)) fail_msg("sphere %zu, pixel %u: %.6f ± %.6f, expected %.6f to %.6f", i, k, value, e, low, high);
            seen++;
            cut += cos(angle) < r / distance;
            if (e > 0) mean_add(&deviations, (value - 0.5 * (low + high)) / hypot(e, 0.5 * (high - low)));
        }
        if (!(fabs(mean_of(&deviations)) < 4 / sqrt((double)seen) + 0.5)) fail_msg("sphere %zu: pixels are %+.2f deviations off on average", i, mean_of(&deviations));
        assert_true(seen > GRID * GRID / 2 && (i < 2 ? cut < seen : cut == seen));
        es_image_destroy(w.context, &image);
        es_image_destroy(w.context, &error);
        es_image_destroy(w.context, &emission);
        es_reference_destroy(reference);
        small_world_destroy(&w);
    }
}

/* ---- lights without extent ------------------------------------------------------------------------------------------------------------------ */

typedef struct lamp { es_light_type type; es_vec3 position, direction; float intensity, inner, outer, range, view; } lamp;

static const lamp lamps[] = {
    {ES_LIGHT_POINT, {0.3f, 1.2f, -0.2f}, {0, -1, 0}, 7, 0, 0, 0, 1.5f},
    {ES_LIGHT_POINT, {0.01f, 0.05f, 0.02f}, {0, -1, 0}, 7, 0, 0, 0, 0.1f},
    {ES_LIGHT_POINT, {-40, 300, 20}, {0, -1, 0}, 1e6f, 0, 0, 0, 1.5f},
    {ES_LIGHT_POINT, {0.3f, 1.2f, -0.2f}, {0, -1, 0}, 7, 0, 0, 2, 1.5f},
    {ES_LIGHT_SPOT, {0.3f, 1.2f, -0.2f}, {0.2f, -1, 0.1f}, 9, 0.3f, 0.7f, 0, 1.5f},
    {ES_LIGHT_SPOT, {-1, 0.8f, 1}, {1, -0.7f, -1}, 9, 0, 0.5f, 2.5f, 1.5f},
    {ES_LIGHT_SPOT, {0, 2, 0}, {0, -1, 0}, 9, 1.2f, 1.5f, 0, 1.5f}, /* drawn as a cube in real time */
    {ES_LIGHT_DIRECTIONAL, {0, 0, 0}, {0, -1, 0}, 2, 0, 0, 0, 1.5f},
    {ES_LIGHT_DIRECTIONAL, {0, 0, 0}, {3, -1, 1.5f}, 2, 0, 0, 0, 1.5f},
};
enum { LAMPS = sizeof lamps / sizeof lamps[0] };

/* Irradiance of the plane y = 0: I cos / d², glTF's cone and window (KHR_lights_punctual). */
static double irradiance_of(const lamp* l, es_vec3 p)
{
    double axis[3] = {(double)l->direction.x, (double)l->direction.y, (double)l->direction.z}, length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    if (l->type == ES_LIGHT_DIRECTIONAL) return (double)l->intensity * -axis[1] / length;
    double d[3] = {(double)p.x - (double)l->position.x, (double)p.y - (double)l->position.y, (double)p.z - (double)l->position.z};
    double d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], distance = sqrt(d2), strength = (double)l->intensity;
    if (l->type == ES_LIGHT_SPOT) {
        double cosine = (d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]) / (distance * length), outer = cos((double)l->outer);
        double t = fmin(fmax((cosine - outer) / (cos((double)l->inner) - outer), 0), 1);
        strength *= t * t;
    }
    if (l->range > 0) strength *= fmin(fmax(1 - pow(distance / (double)l->range, 4), 0), 1);
    return strength * -d[1] / (d2 * distance);
}

static void check_lamp(const lamp* l, const small_world* w, const es_image* image, double relative, const char* what, size_t which)
{
    static const double color[3] = {1, 0.5, 0.25};
    double peak = 0;
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t i = 0; i < GRID * GRID; i++) {
            double e = irradiance_of(l, pixel_on_plane(w, GRID, GRID, i % GRID, i / GRID, es_v3(0, 0, 0), es_v3(0, 1, 0))) * (double)receiver_albedo / pi;
            peak = fmax(peak, e);
            for (int k = 0; k < 3 && pass; k++) {
                double found = (double)image->pixels[3 * i + (uint32_t)k], expected = e * color[k];
                if (!(fabs(found - expected) <= relative * (expected + 0.1 * peak * color[k]))) fail_msg("%s, lamp %zu, pixel %u: %.8g, expected %.8g", what, which, i, found, expected);
            }
        }
    assert_true(peak > 0);
}

static void test_laws(void** state)
{
    for (size_t i = 0; i < LAMPS; i++) {
        const lamp* l = &lamps[i];
        small_world w = small_world_create();
        es_material_desc grey = lambert(receiver_albedo, 0);
        add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
        es_light_desc light = es_default_light_desc();
        light.type = l->type;
        light.intensity = l->intensity;
        light.range = l->range;
        light.color[1] = 0.5f;
        light.color[2] = 0.25f;
        if (l->type == ES_LIGHT_SPOT) {
            light.inner_cone = l->inner;
            light.outer_cone = l->outer;
        }
        add_light(&w, light, l->position, l->direction);
        look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 3, l->view);
        es_reference_settings rs = reference_settings(GRID, GRID, 0);
        es_reference* reference = trace(&w, &rs, 1);
        es_image image = traced(reference, "direct");
        /* float's rounding, some ten times over; distances of 300 m and cosines between cones have more of it */
        check_lamp(l, &w, &image, 2e-5, "reference", i);
        es_image_destroy(w.context, &image);
        es_reference_destroy(reference);
        es_renderer_settings s = es_default_renderer_settings();
        s.method = ES_GI_NONE;
        s.width = s.height = GRID;
        s.shadow_size = 256;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
        assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
        assert_int_equal(es_renderer_image(renderer, "direct", &image), ES_OK);
        /* a colour of 16 bits, a normal of 10^-4 radians */
        check_lamp(l, &w, &image, 5e-4, "real time", i);
        es_image_destroy(w.context, &image);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms),
        cmocka_unit_test(test_opposed_rectangles),
        cmocka_unit_test(test_adjacent_rectangles),
        cmocka_unit_test(test_glowing_rectangle),
        cmocka_unit_test(test_sunlit_wall),
        cmocka_unit_test(test_sunlit_ceiling),
        cmocka_unit_test(test_glowing_sphere),
        cmocka_unit_test(test_laws),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
