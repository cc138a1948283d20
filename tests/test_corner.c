/* Light between the two walls of a corner, bounce by bounce, against a radiosity solution made here: double precision, patches of one
 * radiosity each, and the exact form factors between them. */
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

enum { GRID = 8, FINEST = 48, BOUNCES = 6 };

/* A floor y = 0, 0 ≤ x ≤ 1 and a wall x = 0, 0 ≤ y ≤ 1, both 0 ≤ z ≤ 1, lit by a directional light. */
static const double floor_albedo = 0.8, wall_albedo = 0.9, floor_irradiance = 4, wall_irradiance = 1;

/* Howell's C-15, for rectangles in perpendicular planes: the sum of this over corners, their signs alternating; s² is x² + y². */
static double corner_term(double s2, double z)
{
    double s = sqrt(s2), k2 = s2 + z * z;
    return (z != 0 && s > 0 ? z * s * atan(z / s) : 0) - (k2 > 0 ? 0.25 * (s2 - z * z) * log(k2) : 0);
}

/* Area of a patch times its form factor to another, in n × n patches on each wall: by the row of one, the row of the other (from the
 * edge), and how far they are apart along the edge. */
static double exchange[FINEST][FINEST][FINEST];

/* Rows are finer towards the edge, where radiosity changes fastest: of 24 (or 48) ten (twenty) are in the first eighth. */
static double border(int i, int n)
{
    int first = n * 10 / 24, others = n * 2 / 24;
    return i <= first ? (double)i * i / ((double)first * first * GRID) : (1 + (i - first) / (double)others) / GRID;
}

static void find_exchange(int n)
{
    for (int a = 0; a < n; a++)
        for (int b = 0; b < n; b++)
            for (int d = 0; d < n; d++) {
                double sum = 0;
                for (int i = 0; i < 16; i++) {
                    double x = border(a + (i & 1), n), y = border(b + (i >> 1 & 1), n), z = (d + (i >> 2 & 1) - (i >> 3 & 1)) / (double)n;
                    sum += ((__builtin_popcount((unsigned)i) & 1) ? -1 : 1) * corner_term(x * x + y * y, z);
                }
                exchange[a][b][d] = fabs(sum) / (2 * pi);
            }
}

/* radiosity[bounce][wall 0 floor, 1 wall][row][along z], means over GRID × GRID pixels */
typedef struct solution { double radiosity[BOUNCES + 1][2][GRID][GRID]; } solution;

static void solve(int n, solution* out)
{
    static double now[2][FINEST][FINEST], next[2][FINEST][FINEST];
    static const double albedo[2] = {floor_albedo, wall_albedo}, irradiance[2] = {floor_irradiance, wall_irradiance};
    find_exchange(n);
    memset(out, 0, sizeof *out);
    for (int s = 0; s < 2; s++)
        for (int i = 0; i < n; i++)
            for (int z = 0; z < n; z++) now[s][i][z] = albedo[s] * irradiance[s];
    for (int b = 0; b <= BOUNCES; b++) {
        for (int s = 0; s < 2; s++)
            for (int i = 0; i < n; i++)
                for (int row = 0; row < GRID; row++) {
                    double share = fmin(border(i + 1, n) * GRID, row + 1) - fmax(border(i, n) * GRID, row);
                    for (int z = 0; z < n && share > 0; z++) out->radiosity[b][s][row][z * GRID / n] += now[s][i][z] * share * GRID / n;
                }
        for (int s = 0; s < 2; s++)
            for (int i = 0; i < n; i++)
                for (int z = 0; z < n; z++) {
                    double sum = 0;
                    for (int j = 0; j < n; j++) {
                        const double* e = s ? exchange[j][i] : exchange[i][j];
                        for (int k = 0; k < n; k++) sum += e[k > z ? k - z : z - k] * now[!s][j][k];
                    }
                    next[s][i][z] = albedo[s] * sum * n / (border(i + 1, n) - border(i, n));
                }
        memcpy(now, next, sizeof now);
    }
}

static solution coarse, fine;

static int find_solutions(void** state)
{
    solve(FINEST / 2, &coarse);
    solve(FINEST, &fine);
    return 0;
}

/* The patches themselves: a whole wall sees what C-14 says, and everything that leaves a patch is between 0 and 1. */
static void test_form_factors(void** state)
{
    static const int counts[] = {24, 48};
    for (int c = 0; c < 2; c++) {
        int n = counts[c];
        find_exchange(n);
        double sum = 0;
        for (int a = 0; a < n; a++)
            for (int b = 0; b < n; b++)
                for (int d = 1 - n; d < n; d++) sum += exchange[a][b][abs(d)] * (n - abs(d));
        assert_true(fabs(sum - adjacent_rectangles(1, 1, 1)) < 1e-9);
    }
}

static small_world corner(void)
{
    small_world w = small_world_create();
    es_material_desc floor_material = lambert((float)floor_albedo, 0), wall_material = lambert((float)wall_albedo, 0);
    add_rectangle(&w, es_v3(0, 0, 1), es_v3(1, 0, 0), es_v3(0, 0, -1), &floor_material);
    add_rectangle(&w, es_v3(0, 0, 1), es_v3(0, 0, -1), es_v3(0, 1, 0), &wall_material);
    es_light_desc sun = es_default_light_desc();
    sun.type = ES_LIGHT_DIRECTIONAL;
    sun.intensity = (float)hypot(floor_irradiance, wall_irradiance);
    add_light(&w, sun, es_v3(0, 0, 0), es_v3((float)-wall_irradiance, (float)-floor_irradiance, 0));
    return w;
}

static void look_at_wall(small_world* w, int s)
{
    look_straight(w, s ? es_v3(0, 0.5f, 0.5f) : es_v3(0.5f, 0, 0.5f), s ? es_v3(1, 0, 0) : es_v3(0, 1, 0), 6, 0.5f);
}

/* The patch a pixel shows: along the floor's picture x grows, down it z; along the wall's z falls, down it y falls. */
static void pixel_of_patch(int s, int row, int z, uint32_t* x, uint32_t* y)
{
    *x = (uint32_t)(s ? GRID - 1 - z : row);
    *y = (uint32_t)(s ? GRID - 1 - row : z);
}

static void test_reference(void** state)
{
    for (int s = 0; s < 2; s++) {
        small_world w = corner();
        look_at_wall(&w, s);
        es_reference_settings settings = reference_settings(GRID, GRID, BOUNCES);
        settings.antialias = true;
        es_reference* reference = trace(&w, &settings, 4096 / FEWER);
        double total = 0, total_expected = 0, total_slack = 0;
        for (int b = 0; b <= BOUNCES; b++) {
            char name[32] = "direct", error_name[40];
            if (b) snprintf(name, sizeof name, "bounce-%d", b);
            snprintf(error_name, sizeof error_name, "%s-error", name);
            es_image image = traced(reference, name), error = traced(reference, error_name);
            double mean = 0, expected_mean = 0, slack_mean = 0, variance = 0;
            for (int row = 0; row < GRID; row++)
                for (int z = 0; z < GRID; z++) {
                    uint32_t x, y;
                    pixel_of_patch(s, row, z, &x, &y);
                    double value = pi * (double)image.pixels[3 * (y * GRID + x)], e = pi * (double)error.pixels[3 * (y * GRID + x)], expected = fine.radiosity[b][s][row][z];
                    /* patches of half the size changed the solution by this; what is left is less */
                    double slack = fabs(expected - coarse.radiosity[b][s][row][z]) + 2e-6 * expected;
                    /* 2 walls × 3 images × 64 pixels: 5 standard errors are passed once in four thousand runs. Of later bounces roulette leaves
                     * a pixel too few samples to tell how they scatter, all pixels together enough. */
                    if (b <= (FEWER > 1 ? 1 : 2) && !(fabs(value - expected) <= 5 * e + slack)) fail_msg("%s of %s, patch %d %d: %.6f ± %.6f, radiosity %.6f", name, s ? "wall" : "floor", row, z, value, e, expected);
                    mean += value / (GRID * GRID);
                    expected_mean += expected / (GRID * GRID);
                    slack_mean += slack / (GRID * GRID);
                    variance += e * e / (GRID * GRID) / (GRID * GRID);
                }
            if (!(fabs(mean - expected_mean) <= 4 * sqrt(variance) + slack_mean))
                fail_msg("%s of %s: %.6f ± %.6f, radiosity %.6f ± %.6f", name, s ? "wall" : "floor", mean, sqrt(variance), expected_mean, slack_mean);
            if (!(sqrt(variance) < (b <= 2 ? 0.01 : 0.2) * sqrt(FEWER) * expected_mean && slack_mean < 0.015 * expected_mean)) fail_msg("%s: ± %g, ± %g cannot tell", name, sqrt(variance) / expected_mean, slack_mean / expected_mean);
            total += mean;
            total_expected += expected_mean;
            total_slack += slack_mean;
            es_image_destroy(w.context, &image);
            es_image_destroy(w.context, &error);
        }
        measured all = mean_of_reference(&w, reference, "radiance");
        if (!(fabs(pi * all.value - total_expected) <= 4 * pi * all.error + total_slack)) fail_msg("all of %s: %.6f ± %.6f, radiosity %.6f", s ? "wall" : "floor", pi * all.value, pi * all.error, total_expected);
        assert_true(fabs(pi * all.value - total) < 1e-5 * total);
        es_reference_destroy(reference);
        small_world_destroy(&w);
    }
}

/* The first bounce by virtual point lights with rays and with what their bound leaves out put back; at the middles of the pixels, where
 * the other wall, of one radiosity, is a polygon. */
static void test_compensated_lights(void** state)
{
    enum { SETS = 24 };
    static const es_vec3 floor_corners[4] = {{0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0}}, wall_corners[4] = {{0, 0, 1}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1}};
    for (int s = 0; s < 2; s++) {
        small_world w = corner();
        look_at_wall(&w, s);
        es_renderer_settings settings = es_default_renderer_settings();
        settings.method = ES_GI_VPL_TRACED;
        settings.traced_bias = ES_TRACED_COMPENSATED;
        settings.width = settings.height = GRID;
        settings.vpls = 256;
        settings.light_size = 256;
        settings.shadow_size = 64;
        settings.geometry_bound = 4;
        settings.traced_samples = 64;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &settings, &renderer), ES_OK);
        running_mean pixels[GRID * GRID] = {0}, means = {0};
        double expected[GRID * GRID], expected_mean = 0, compensated = 0;
        es_vec3 normal = s ? es_v3(1, 0, 0) : es_v3(0, 1, 0);
        for (uint32_t i = 0; i < GRID * GRID; i++) {
            es_vec3 p = pixel_on_plane(&w, GRID, GRID, i % GRID, i / GRID, es_v3(0, 0, 0), normal);
            double share = point_to_polygon(p, normal, s ? floor_corners : wall_corners, 4);
            expected[i] = share * (s ? floor_albedo * floor_irradiance : wall_albedo * wall_irradiance) * (s ? wall_albedo : floor_albedo) / pi;
            expected_mean += expected[i] / (GRID * GRID);
        }
        for (uint32_t set = 0; set < SETS; set++) {
            settings.seed = 977 * set;
            assert_int_equal(es_renderer_configure(renderer, &settings), ES_OK);
            assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
            es_image image, compensation;
            assert_int_equal(es_renderer_image(renderer, "indirect", &image), ES_OK);
            assert_int_equal(es_renderer_image(renderer, "compensation", &compensation), ES_OK);
            double mean = 0;
            for (int i = 0; i < GRID * GRID; i++) {
                mean_add(&pixels[i], (double)image.pixels[3 * i]);
                mean += (double)image.pixels[3 * i] / (GRID * GRID);
                compensated += (double)compensation.pixels[3 * i] / (GRID * GRID) / SETS;
            }
            mean_add(&means, mean);
            es_image_destroy(w.context, &image);
            es_image_destroy(w.context, &compensation);
        }
        /* 0.3 %: the texels of the light's picture of the walls; sets are runs of one sequence, so their scatter is an upper bound */
        for (int i = 0; i < GRID * GRID; i++)
            if (!(fabs(mean_of(&pixels[i]) - expected[i]) < 5 * standard_error_of(&pixels[i]) + 0.003 * expected[i]))
                fail_msg("%s, pixel %d: %.5f ± %.5f, expected %.5f", s ? "wall" : "floor", i, mean_of(&pixels[i]), standard_error_of(&pixels[i]), expected[i]);
        if (!(fabs(mean_of(&means) - expected_mean) < 4 * standard_error_of(&means) + 0.003 * expected_mean))
            fail_msg("%s: %.5f ± %.5f, expected %.5f", s ? "wall" : "floor", mean_of(&means), standard_error_of(&means), expected_mean);
        assert_true(standard_error_of(&means) < 0.02 * expected_mean && compensated > 0.02 * expected_mean);
        es_renderer_destroy(renderer);
        small_world_destroy(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_form_factors),
        cmocka_unit_test_setup(test_reference, find_solutions),
        cmocka_unit_test(test_compensated_lights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
