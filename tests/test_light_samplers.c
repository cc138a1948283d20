/* The numbers and directions that paths are made of, against their densities: towards the environment and glowing triangles, the points of
 * the Sobol' sequence, the places of rays within a pixel. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/reference/path.h"
#include "platform/random.h"
#include "tests/reference_runs.h"

/* ---- directions towards light ----------------------------------------------------------------------------------------------------------- */

enum { WIDTH = 16, HEIGHT = 8, TEXELS = WIDTH * HEIGHT, PARTS = 4 /* of a triangle's sides: 16 cells */, SLOTS = 2 * PARTS * PARTS, MOST_TRIANGLES = 400 };

typedef enum sources { CONSTANT = 1, PICTURE = 2, GLOWING = 4 } sources;

static const float rotation = 0.7f;
static const es_vec3 point = {0.1f, 0.2f, -0.1f};

static void fill_picture(float* pixels)
{
    for (uint32_t i = 0; i < TEXELS; i++)
        for (uint32_t k = 0; k < 3; k++) {
            float value = es_random_float(3, 3 * i + k);
            pixels[3 * i + k] = i % 5 == 0 ? 0 : i == 37 ? 60 * value : value * value;
        }
}

/* A rectangle close by, a ball whose far side is dark from here, a rectangle that shows its back, and one that does not glow. */
static small_world lit_world(unsigned what)
{
    static float pixels[TEXELS * 3];
    small_world w = small_world_create();
    fill_picture(pixels);
    es_image image = {.width = WIDTH, .height = HEIGHT, .channels = 3, .pixels = pixels};
    es_environment_desc environment = {.image = what & PICTURE ? &image : NULL, .radiance = {2, 1, 0.5f}, .rotation = rotation};
    if (what & (CONSTANT | PICTURE)) assert_int_equal(es_world_set_environment(w.world, &environment), ES_OK);
    es_material_desc bright = lambert(0, 5), dim = lambert(0.5f, 0.2f), dark = lambert(0.5f, 0);
    bright.emission[1] = 1;
    add_rectangle(&w, es_v3(-3, -2, -3), es_v3(6, 0, 0), es_v3(0, 0, 6), &dark);
    if (what & GLOWING) {
        add_rectangle(&w, es_v3(-0.6f, -0.5f, -0.8f), es_v3(1, 0, 0.2f), es_v3(0, 0.8f, 0), &bright);
        add_sphere(&w, es_v3(1.5f, 0.4f, 0.5f), 0.7f, 6, false, &dim);
        add_rectangle(&w, es_v3(-1, -1, 2), es_v3(1, 0, 0), es_v3(0, 1, 0), &dim);
    }
    look(&w, es_default_camera_desc(), es_v3(0, 0, 5), es_v3(0, 0, 0));
    return w;
}

/* Column and row of the texel a direction looks at (sim.h: the middle column looks along -z, columns to the right turn towards +x, the
 * rotation is counter-clockwise seen from above). */
static int texel_of(es_vec3 d, bool picture)
{
    double u = (atan2((double)d.x, -(double)d.z) + (picture ? (double)rotation : 0)) / (2 * pi) + 0.5, v = acos(fmin(fmax((double)d.y, -1), 1)) / pi;
    int x = (int)((u - floor(u)) * WIDTH), y = (int)(v * HEIGHT);
    return (y >= HEIGHT ? HEIGHT - 1 : y) * WIDTH + (x >= WIDTH ? WIDTH - 1 : x);
}

static es_vec3 direction_in_texel(double x, double y, bool picture)
{
    double a = 2 * pi * (x / WIDTH - 0.5) - (picture ? (double)rotation : 0), b = pi * y / HEIGHT;
    return es_v3((float)(sin(b) * sin(a)), (float)cos(b), (float)(-sin(b) * cos(a)));
}

/* The cell of a triangle that barycentric coordinates (of its second and third corner) lie in. */
static int cell_of(double u, double v)
{
    int i = (int)(u * PARTS), j = (int)(v * PARTS);
    if (i >= PARTS) i = PARTS - 1;
    if (j >= PARTS) j = PARTS - 1;
    return 2 * (i * PARTS + j) + (u * PARTS - i + v * PARTS - j > 1);
}

typedef struct triangle { double corner[3][3], area; } triangle;

static triangle triangle_of(const es_trace_scene* scene, uint32_t primitive)
{
    es_vec3 c[3];
    es_bvh_triangle(scene->bvh, primitive, c);
    es_vec3 n = es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0]));
    triangle t = {.area = 0.5 * sqrt((double)es_v3_dot(n, n))};
    for (int k = 0; k < 3; k++) {
        t.corner[k][0] = (double)c[k].x;
        t.corner[k][1] = (double)c[k].y;
        t.corner[k][2] = (double)c[k].z;
    }
    return t;
}

/* The glowing triangle a point lies on, and where; ES_NO_PRIMITIVE when there is none. */
static uint32_t triangle_at(const es_trace_scene* scene, es_vec3 at, double* u, double* v)
{
    double best = 1e-4;
    uint32_t found = ES_NO_PRIMITIVE;
    for (uint32_t p = 0; p < es_bvh_primitive_count(scene->bvh); p++) {
        triangle t = triangle_of(scene, p);
        double a[3], b[3], q[3], n[3];
        const double place[3] = {(double)at.x, (double)at.y, (double)at.z};
        for (int k = 0; k < 3; k++) {
            a[k] = t.corner[1][k] - t.corner[0][k];
            b[k] = t.corner[2][k] - t.corner[0][k];
            q[k] = place[k] - t.corner[0][k];
        }
        double aa = a[0] * a[0] + a[1] * a[1] + a[2] * a[2], ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2], bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
        double qa = q[0] * a[0] + q[1] * a[1] + q[2] * a[2], qb = q[0] * b[0] + q[1] * b[1] + q[2] * b[2], det = aa * bb - ab * ab;
        double pu = (bb * qa - ab * qb) / det, pv = (aa * qb - ab * qa) / det, off = fmax(fmax(-pu, -pv), fmax(pu + pv - 1, 0));
        for (int k = 0; k < 3; k++) n[k] = q[k] - pu * a[k] - pv * b[k];
        off += sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (off < best) {
            best = off;
            found = p;
            *u = fmin(fmax(pu, 0), 1);
            *v = fmin(fmax(pv, 0), 1 - *u);
        }
    }
    return found;
}

static es_trace_surface surface_at(const es_trace_scene* scene, uint32_t primitive, double u, double v, es_vec3* direction, double* distance)
{
    triangle t = triangle_of(scene, primitive);
    double d[3];
    const double from[3] = {(double)point.x, (double)point.y, (double)point.z};
    for (int k = 0; k < 3; k++) d[k] = (1 - u - v) * t.corner[0][k] + u * t.corner[1][k] + v * t.corner[2][k] - from[k];
    *distance = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    *direction = es_v3((float)(d[0] / *distance), (float)(d[1] / *distance), (float)(d[2] / *distance));
    es_hit hit = {(float)*distance, (float)u, (float)v, primitive};
    es_trace_surface s;
    es_trace_surface_at(scene, &hit, es_v3_scale(*direction, -1), false, &s);
    return s;
}

static bool is_black(es_vec3 c) { return c.x == 0 && c.y == 0 && c.z == 0; }

static void check_directions(unsigned what)
{
    enum { SAMPLES = 100000 / FEWER, FINE = 4 /* points along a cell's sides */, CELLS = TEXELS + MOST_TRIANGLES * SLOTS + 1, REST = CELLS - 1 };
    static double cells[CELLS][2];
    small_world w = lit_world(what);
    es_trace_scene scene = {0};
    assert_int_equal(es_trace_scene_take(&scene, w.world, true), ES_OK);
    uint32_t triangles = es_bvh_primitive_count(scene.bvh);
    assert_true(triangles <= MOST_TRIANGLES);
    memset(cells, 0, sizeof cells);

    /* what the densities promise: the sky texel by texel, and what glows towards the point cell by cell */
    double promised = 0, power = 0;
    const bool sky = what & (CONSTANT | PICTURE), picture = what & PICTURE;
    for (int t = 0; t < TEXELS && sky; t++)
        for (int k = 0; k < 256; k++) {
            double x = t % WIDTH + (k % 16 + 0.5) / 16, y = t / WIDTH + (k / 16 + 0.5) / 16, h = pi / HEIGHT / 16;
            double solid = 2 * pi / WIDTH / 16 * (cos(pi * y / HEIGHT - h / 2) - cos(pi * y / HEIGHT + h / 2));
            es_vec3 d = direction_in_texel(x, y, picture), radiance = es_trace_environment(&scene, d);
            if (is_black(radiance)) continue;
            double share = (double)es_trace_light_density(&scene, d, 0, NULL) * solid;
            cells[t][0] += SAMPLES * share;
            promised += share;
            power += (double)radiance.y * solid;
        }
    for (uint32_t p = 0; p < triangles && what & GLOWING; p++) {
        triangle t = triangle_of(&scene, p);
        enum { N = PARTS * FINE };
        for (int i = 0; i < N; i++)
            for (int j = 0; i + j < N; j++)
                for (int upper = 0; upper <= (i + j < N - 1); upper++) {
                    double u = (i + (upper ? 2 : 1) / 3.0) / N, v = (j + (upper ? 2 : 1) / 3.0) / N, distance;
                    es_vec3 d;
                    es_trace_surface s = surface_at(&scene, p, u, v, &d, &distance);
                    if (is_black(s.emission)) continue;
                    double solid = t.area / (N * N) * -(double)es_v3_dot(s.geometric, d) / (distance * distance);
                    double share = (double)es_trace_light_density(&scene, d, (float)distance, &s) * solid;
                    cells[TEXELS + p * SLOTS + (uint32_t)cell_of(u, v)][0] += SAMPLES * share;
                    promised += share;
                    power += (double)s.emission.y * solid;
                }
    }
    assert_true(promised > 0.2 && promised < 1.001);
    cells[REST][0] = SAMPLES * fmax(1 - promised, 0);

    running_mean estimate = {0};
    for (uint32_t i = 0; i < SAMPLES; i++) {
        const float u[3] = {es_random_float(17, 3 * i), es_random_float(17, 3 * i + 1), es_random_float(17, 3 * i + 2)};
        es_light_sample sample;
        if (!es_trace_sample_light(&scene, point, u, &sample) || is_black(sample.radiance)) {
            cells[REST][1]++;
            mean_add(&estimate, 0);
            continue;
        }
        assert_true(sample.density > 0 && isfinite(sample.density) && fabsf(es_v3_length(sample.direction) - 1) < 1e-5f);
        mean_add(&estimate, (double)sample.radiance.y / (double)sample.density);
        double density, tolerance = 1e-4;
        if (isinf(sample.distance)) {
            cells[texel_of(sample.direction, picture)][1]++;
            density = (double)es_trace_light_density(&scene, sample.direction, 0, NULL);
            es_vec3 seen = es_trace_environment(&scene, sample.direction);
            if (picture) tolerance += 2.4e-7 / (1 - (double)sample.direction.y * (double)sample.direction.y + 1e-12); /* the sine at the poles is √(1 - y²) */
            /* at a texel's edge rounding may choose the neighbour */
            if (!(seen.x == sample.radiance.x && fabs(density - (double)sample.density) <= tolerance * density)) {
                double x = ((atan2((double)sample.direction.x, -(double)sample.direction.z) + (double)rotation) / (2 * pi) + 0.5) * WIDTH, y = acos((double)sample.direction.y) / pi * HEIGHT;
                if (!(fmin(fabs(x - round(x)), fabs(y - round(y))) < 1e-4)) fail_msg("density %g, sampled %g", density, (double)sample.density);
            }
        } else {
            double at_u, at_v, distance;
            es_vec3 d;
            uint32_t p = triangle_at(&scene, es_v3_add(point, es_v3_scale(sample.direction, sample.distance)), &at_u, &at_v);
            if (p == ES_NO_PRIMITIVE) fail_msg("sample %u is on no triangle", i);
            cells[TEXELS + p * SLOTS + (uint32_t)cell_of(at_u, at_v)][1]++;
            es_trace_surface s = surface_at(&scene, p, at_u, at_v, &d, &distance);
            density = (double)es_trace_light_density(&scene, sample.direction, sample.distance, &s);
            if (!(fabs(density - (double)sample.density) <= 1e-3 * density || at_u < 1e-3 || at_v < 1e-3 || at_u + at_v > 0.999)) fail_msg("density %g, sampled %g", density, (double)sample.density);
        }
    }
    int degrees;
    double deviate = chi_square_deviate(cells, CELLS, &degrees);
    /* 1 % over the five runs */
    if (!(deviate < 2.9)) fail_msg("sources %u: chi-square %.2f deviations too large, %d degrees of freedom", what, deviate, degrees);
    assert_true(degrees > 30);
    /* and so the mean of radiance / density is all the radiance there is: 4 standard errors, 10^-3 of the quadrature */
    if (!(fabs(mean_of(&estimate) - power) <= 4 * standard_error_of(&estimate) + 1e-3 * power))
        fail_msg("sources %u: %.5f ± %.5f, there is %.5f", what, mean_of(&estimate), standard_error_of(&estimate), power);
    es_trace_scene_free(&scene);
    small_world_destroy(&w);
}

static void test_directions_to_light(void** state)
{
    check_directions(CONSTANT);
    check_directions(PICTURE);
    check_directions(GLOWING);
    check_directions(CONSTANT | GLOWING);
    check_directions(PICTURE | GLOWING);
}

/* Which way the picture is turned, through the reference: a floor, four walls and a ceiling facing out each get their irradiance. */
static void test_irradiance_of_environment(void** state)
{
    static const es_vec3 normals[] = {{0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}};
    static float pixels[TEXELS * 3];
    fill_picture(pixels);
    for (int f = 0; f < 6; f++) {
        small_world w = small_world_create();
        es_image image = {.width = WIDTH, .height = HEIGHT, .channels = 3, .pixels = pixels};
        assert_int_equal(es_world_set_environment(w.world, &(es_environment_desc){.image = &image, .radiance = {2, 1, 0.5f}, .rotation = rotation}), ES_OK);
        es_vec3 n = normals[f], u = es_absf(n.y) > 0.5f ? es_v3(1, 0, 0) : es_v3(0, 1, 0), v = es_v3_cross(n, u);
        es_material_desc white = lambert(1, 0);
        add_rectangle(&w, es_v3_scale(es_v3_add(u, v), -0.5f), u, v, &white);
        look_straight(&w, es_v3(0, 0, 0), n, 2, 0.1f);
        es_reference_settings s = reference_settings(8, 8, 0);
        es_reference* reference = trace(&w, &s, 512 / FEWER);
        measured m = mean_of_reference(&w, reference, "direct");
        double expected = 0;
        for (int i = 0; i < TEXELS * 256; i++) {
            double x = i % (16 * WIDTH) / 16.0 + 1 / 32.0, y = i / (16 * WIDTH) / 16.0 + 1 / 32.0;
            es_vec3 d = direction_in_texel(x, y, true);
            double solid = 2 * pi * pi / (TEXELS * 256) * sin(pi * y / HEIGHT), cosine = (double)es_v3_dot(d, n);
            if (cosine > 0) expected += 2 * (double)pixels[3 * ((int)y * WIDTH + (int)x)] * solid * cosine / pi;
        }
        if (!(fabs(m.value - expected) <= 4 * m.error + 1e-3 * expected)) fail_msg("side %d: %.5f ± %.5f, expected %.5f", f, m.value, m.error, expected);
        assert_true(m.error < 0.02 * sqrt(FEWER) * expected);
        es_reference_destroy(reference);
        small_world_destroy(&w);
    }
}

/* ---- the points of paths -------------------------------------------------------------------------------------------------------------------- */

/* 2^m samples that begin at a multiple of 2^m are a (0, m, 2)-net in base 2: every box of 2^-a × 2^-(m - a) holds one. */
static void test_nets(void** state)
{
    for (uint32_t seed = 0; seed < 40; seed++)
        for (uint32_t pair = 0; pair < 6; pair++)
            for (uint32_t m = 1; m <= 8; m++) {
                uint32_t count = 1u << m, first = es_random_u32(seed, 100 * pair + m) & ~(count - 1);
                if (seed & 1) first &= 0xffff;
                for (uint32_t a = 0; a <= m; a++) {
                    uint8_t hit[256] = {0};
                    for (uint32_t i = 0; i < count; i++) {
                        float u[2];
                        es_path_numbers(es_hash_u32(seed), pair == 5 ? 0xffff : pair, first + i, u);
                        assert_true(u[0] >= 0 && u[0] < 1 && u[1] >= 0 && u[1] < 1);
                        uint32_t x = (uint32_t)(u[0] * (float)(1u << a)), y = (uint32_t)(u[1] * (float)(count >> a));
                        if (hit[x * (count >> a) + y]++) fail_msg("seed %u, pair %u: two of %u samples from %u on in one box of %u × %u", seed, pair, count, first, 1u << a, count >> a);
                    }
                }
            }
}

/* Over seeds a sample is anywhere alike; and what one pair of dimensions draws says nothing about another, nor one sample about the next. */
static void test_uniform_and_apart(void** state)
{
    enum { SEEDS = 60000 / (FEWER > 1 ? 4 : 1), SIDE = 16 };
    static double alone[SIDE * SIDE][2], pairs[SIDE * SIDE][2], samples[SIDE * SIDE][2], axes[SIDE * SIDE][2];
    static const uint32_t indices[] = {0, 1, 5, 1000};
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < SIDE * SIDE; i++) {
            alone[i][0] = pairs[i][0] = samples[i][0] = axes[i][0] = SEEDS / (double)(SIDE * SIDE);
            alone[i][1] = pairs[i][1] = samples[i][1] = axes[i][1] = 0;
        }
        for (uint32_t seed = 0; seed < SEEDS; seed++) {
            float u[2], v[2], next[2];
            uint32_t s = es_random_u32(9, seed);
            es_path_numbers(s, (uint32_t)k, indices[k], u);
            es_path_numbers(s, (uint32_t)k + 1, indices[k], v);
            es_path_numbers(s, (uint32_t)k + 1, indices[k] + 2, next); /* not of one pair of a net: those two are in opposite halves */
            alone[(int)(u[0] * SIDE) * SIDE + (int)(u[1] * SIDE)][1]++;
            pairs[(int)(u[0] * SIDE) * SIDE + (int)(v[0] * SIDE)][1]++;
            axes[(int)(u[1] * SIDE) * SIDE + (int)(v[0] * SIDE)][1]++;
            samples[(int)(u[0] * SIDE) * SIDE + (int)(next[1] * SIDE)][1]++;
        }
        double deviates[4] = {chi_square_deviate(alone, SIDE * SIDE, NULL), chi_square_deviate(pairs, SIDE * SIDE, NULL), chi_square_deviate(axes, SIDE * SIDE, NULL), chi_square_deviate(samples, SIDE * SIDE, NULL)};
        for (int i = 0; i < 4; i++)
            if (!(fabs(deviates[i]) < 3.5)) fail_msg("sample %u: table %d is off by %.2f deviations", indices[k], i, deviates[i]); /* 16 tables: 1 % two-sided */
    }
}

/* ---- the places of rays in a pixel ----------------------------------------------------------------------------------------------------------- */

/* A bright rectangle that covers parts of pixels: their means are the parts. Along each axis 256 samples lie one in each of 256 equal
 * intervals, so that an edge is off by one of them at most, a corner by two. */
static void test_pixel_coverage(void** state)
{
    enum { SIZE = 8, SAMPLES = 256 };
    small_world w = small_world_create();
    es_material_desc bright = es_default_material_desc();
    bright.model = ES_SURFACE_UNLIT;
    /* pixels are 0.25 wide about the origin */
    const double left = -0.68, right = 0.61, near_edge = 0.83, far_edge = -0.32;
    add_rectangle(&w, es_v3((float)left, 0, (float)near_edge), es_v3((float)(right - left), 0, 0), es_v3(0, 0, (float)(far_edge - near_edge)), &bright);
    look_straight(&w, es_v3(0, 0, 0), es_v3(0, 1, 0), 2, 1);
    es_reference_settings s = reference_settings(SIZE, SIZE, 0);
    for (int antialias = 0; antialias < 2; antialias++) {
        s.antialias = antialias;
        es_reference* reference = trace(&w, &s, SAMPLES);
        es_image image = traced(reference, "radiance");
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double x0 = -1 + 0.25 * x, z0 = -1 + 0.25 * y, found = (double)image.pixels[3 * (y * SIZE + x)];
                double across = fmax(fmin(x0 + 0.25, right) - fmax(x0, left), 0) * 4, down = fmax(fmin(z0 + 0.25, near_edge) - fmax(z0, far_edge), 0) * 4;
                bool inside = x0 + 0.125 > left && x0 + 0.125 < right && z0 + 0.125 > far_edge && z0 + 0.125 < near_edge;
                double expected = antialias ? across * down : inside, allowed = antialias ? 2.0 / SAMPLES + (across < 1 && across > 0 && down < 1 && down > 0 ? 0.02 : 0) + 1e-5 : 0;
                if (!(fabs(found - expected) <= allowed)) fail_msg("pixel %d %d: %.4f covered, expected %.4f", x, y, found, expected);
            }
        es_image_destroy(w.context, &image);
        es_reference_destroy(reference);
    }
    small_world_destroy(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_directions_to_light),
        cmocka_unit_test(test_irradiance_of_environment),
        cmocka_unit_test(test_nets),
        cmocka_unit_test(test_uniform_and_apart),
        cmocka_unit_test(test_pixel_coverage),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
