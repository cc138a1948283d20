/* Furnaces: where light of one radiance comes from everywhere, a surface shows its directional albedo, and a closed cavity that emits what
 * its walls absorb shows radiance 1.
 *
 * The reference is put into both, lit by an environment and by glowing walls. The real-time methods light nothing by glowing surfaces or
 * by the environment (gi.h: they leave them black), so they get the same uniform light in the forms they know: direct light from hundreds
 * of directional lights spread evenly over the hemisphere, and the one-bounce methods from the wall of an integrating sphere with a lamp
 * in its middle, whose first bounce has one radiance from every direction. (test_integrating_sphere.c has the wall itself.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reference_runs.h"
#include "tests/surface_in_double.h"

static const exact_surface surfaces[] = {
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 0.6, 0}, /* Lambert, white: everything comes back */
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.5, 0, 0.6, 0},
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 1, 1}, /* metals; roughness in 255ths, as a G-buffer holds it */
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 0.6, 1},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.8, 1, 0.4, 1},
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 0.2, 1},
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 0.6, 1}, /* white dielectrics */
    {ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 0.2, 1},
    {ES_SURFACE_METALLIC_ROUGHNESS, 0.6, 0.4, 0.4, 0.6}, /* in between */
    {ES_SURFACE_PHONG, 0, 0, 1, 1},
    {ES_SURFACE_PHONG, 0.4, 0, 5, 0.6},
    {ES_SURFACE_PHONG, 0, 0, 20, 1},
    {ES_SURFACE_PHONG, 0.2, 0, 50, 0.8},
    {ES_SURFACE_UNLIT, 1, 0, 0, 0},
};
enum { SURFACES = sizeof surfaces / sizeof surfaces[0] };
static const float cosines[] = {1, 0.7f, 0.2f};
enum { ANGLES = 3 };

static double albedos[SURFACES][ANGLES];

static int find_albedos(void** state)
{
    for (int s = 0; s < SURFACES; s++)
        for (int a = 0; a < ANGLES; a++) albedos[s][a] = exact_albedo(&surfaces[s], (double)cosines[a]);
    return 0;
}

/* What nobody can see in a picture: the model itself gives back at most what came, and white Lambert all of it. */
static void test_albedos(void** state)
{
    for (int s = 0; s < SURFACES; s++)
        for (int a = 0; a < ANGLES; a++)
            if (!(albedos[s][a] >= 0 && albedos[s][a] <= 1 + 1e-4)) fail_msg("surface %d reflects %g", s, albedos[s][a]);
    for (int a = 0; a < ANGLES; a++) assert_true(fabs(albedos[0][a] - 1) < 1e-5 && fabs(albedos[1][a] - 0.5) < 1e-5);
}

static es_material_desc material_of(const exact_surface* s)
{
    es_material_desc m = es_default_material_desc();
    m.model = (es_surface_model)s->model;
    for (int k = 0; k < 3; k++) m.base_color[k] = (float)s->base;
    m.metallic = (float)s->metallic;
    m.specular = (float)s->specular;
    if (s->model == ES_SURFACE_PHONG) m.exponent = (float)s->roughness;
    else m.roughness = (float)s->roughness;
    return m;
}

static es_vec3 towards_eye(int angle) { return es_v3(es_sqrt(1 - cosines[angle] * cosines[angle]), cosines[angle], 0); }

/* A patch in the xz plane about the point, facing up. */
static void add_patch(small_world* w, es_vec3 middle, float half, const exact_surface* s)
{
    es_material_desc m = material_of(s);
    add_rectangle(w, es_v3(middle.x - half, middle.y, middle.z + half), es_v3(2 * half, 0, 0), es_v3(0, 0, -2 * half), &m);
}

/* ---- the reference ---------------------------------------------------------------------------------------------------------------- */

static void white_furnace(bool glowing_walls)
{
    for (int s = 0; s < SURFACES; s++)
        for (int a = 0; a < ANGLES; a++) {
            small_world w = small_world_create();
            if (glowing_walls) {
                es_material_desc wall = lambert(0, 1);
                add_sphere(&w, es_v3(0, 0, 0), 1, 12, true, &wall);
            } else {
                assert_int_equal(es_world_set_environment(w.world, &(es_environment_desc){.radiance = {1, 1, 1}}), ES_OK);
            }
            add_patch(&w, es_v3(0, 0, 0), 0.1f, &surfaces[s]);
            look_straight(&w, es_v3(0, 0, 0), towards_eye(a), 0.5f, 0.01f);
            es_reference_settings settings = reference_settings(8, 8, 0);
            es_reference* reference = trace(&w, &settings, (glowing_walls ? 64 : 256) / FEWER);
            measured m = mean_of_reference(&w, reference, "direct"), all = mean_of_reference(&w, reference, "radiance");
            /* 4 standard errors, and the error of the quadrature; mirror-like lobes add the rounding of 1 - NH² (1 - alpha²), which is
             * alpha² at its centre, in the share of samples that go to the light */
            double allowed = 4 * m.error + 1e-4 + (surfaces[s].model == ES_SURFACE_METALLIC_ROUGHNESS ? 1.2e-7 / pow(surfaces[s].roughness, 4) : 0);
            if (!(fabs(m.value - albedos[s][a]) <= allowed)) fail_msg("surface %d at cosine %g: %.5f ± %.5f, albedo %.5f", s, (double)cosines[a], m.value, m.error, albedos[s][a]);
            if (!(m.error <= 0.012 * sqrt(FEWER))) fail_msg("surface %d at cosine %g: a standard error of %g cannot tell", s, (double)cosines[a], m.error);
            /* an unlit surface takes no light and shows its colour */
            assert_true(fabs(all.value - (surfaces[s].model == ES_SURFACE_UNLIT ? surfaces[s].base : m.value)) < 1e-6);
            es_reference_destroy(reference);
            small_world_destroy(&w);
        }
}
static void test_white_furnace(void** state) { white_furnace(false); }
static void test_white_furnace_of_glowing_walls(void** state) { white_furnace(true); }

/* Walls of albedo a that emit 1 - a: the light after b bounces is (1 - a) a^(b + 1), and all of it together is 1. Bounces from the fourth
 * on are Russian roulette's: its mean has to be that of paths it leaves alone. Of smooth normals tilted by an angle d against their
 * triangles' (1 - cos d) / 2 of the hemisphere is below the triangle: at most h² / 8 where facets are h wide. */
static void furnace(float albedo, uint32_t bounces, uint32_t samples)
{
    enum { SEGMENTS = 24 };
    small_world w = small_world_create();
    es_material_desc wall = lambert(albedo, 1 - albedo);
    add_sphere(&w, es_v3(0, 0, 0), 1, SEGMENTS, true, &wall);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.6f;
    look(&w, camera, es_v3(0, 0.1f, 0.6f), es_v3(0, 0, -1));
    es_reference_settings s = reference_settings(16, 12, bounces);
    es_reference* reference = trace(&w, &s, samples / FEWER);
    const double tilt = (pi / SEGMENTS) * (pi / SEGMENTS) / 8;
    double left = (double)albedo;
    for (uint32_t b = 0; b <= bounces; b++, left *= (double)albedo) {
        char name[32] = "direct";
        if (b) snprintf(name, sizeof name, "bounce-%u", b);
        measured m = mean_of_reference(&w, reference, name);
        double expected = (1 - (double)albedo) * left;
        if (!(m.value - expected <= 4 * m.error && expected - m.value <= 4 * m.error + expected * tilt * (b + 1)))
            fail_msg("albedo %g, %s: %.6f ± %.6f, expected %.6f", (double)albedo, name, m.value, m.error, expected);
        /* roulette leaves few of the paths */
        assert_true(m.error < (b < 4 ? 0.005 : 0.15) * sqrt(FEWER) * expected);
    }
    measured all = mean_of_reference(&w, reference, "radiance");
    if (!(all.value - (1 - left) <= 4 * all.error && 1 - left - all.value <= 4 * all.error + tilt / (1 - (double)albedo)))
        fail_msg("albedo %g: radiance %.5f ± %.5f, expected %.5f", (double)albedo, all.value, all.error, 1 - left);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}
static void test_furnace(void** state)
{
    furnace(0.5f, 10, 192);
    furnace(0.9f, 12, 96);
}

/* What reflects everything cannot be seen in a furnace: no pixel tells the white ball from the wall behind. */
static void test_white_ball_is_invisible(void** state)
{
    small_world w = small_world_create();
    es_material_desc wall = lambert(0, 1), ball = lambert(1, 0);
    add_sphere(&w, es_v3(0, 0, 0), 2, 16, true, &wall);
    add_sphere(&w, es_v3(0, 0, 0), 0.5f, 48, false, &ball);
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 0.9f;
    look(&w, camera, es_v3(0, 0.1f, 1.6f), es_v3(0, 0, 0));
    es_reference_settings s = reference_settings(24, 18, 1);
    es_reference* reference = trace(&w, &s, 256 / FEWER);
    es_image image = traced(reference, "radiance"), error = traced(reference, "radiance-error"), emission = traced(reference, "emission");
    int ball_pixels = 0;
    for (size_t i = 0; i < (size_t)image.width * image.height; i++) {
        double value = (double)image.pixels[3 * i], e = (double)error.pixels[3 * i];
        ball_pixels += emission.pixels[3 * i] == 0;
        /* of 432 pixels one in four thousand runs; near the rim smooth normals reach below their triangles: tilt² / 4, h / 2 each way */
        if (!(fabs(value - 1) <= 5 * e + 1e-3)) fail_msg("pixel %zu: %g ± %g", i, value, e);
    }
    measured all = mean_of_block(&image, &error, 0, 0, image.width, image.height);
    assert_true(fabs(all.value - 1) < 4 * all.error + 1e-3 && all.error < 3e-3 * sqrt(FEWER));
    assert_true(ball_pixels > 80 && ball_pixels < 400);
    es_image_destroy(w.context, &image);
    es_image_destroy(w.context, &error);
    es_image_destroy(w.context, &emission);
    es_reference_destroy(reference);
    small_world_destroy(&w);
}

/* ---- direct light in real time ------------------------------------------------------------------------------------------------------ */

static es_renderer_settings settings_of(uint32_t method)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.width = s.height = 8;
    s.method = method;
    s.shadow_size = 16;
    return s;
}

static double mean_of_picture(small_world* w, es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    double mean = mean_of_block(&image, NULL, 0, 0, image.width, image.height).value;
    es_image_destroy(w->context, &image);
    return mean;
}

/* 12 × 32 directional lights, the middles of equal shares of cos² and of the azimuth: each brings pi / lights to a level surface and stands
 * for as much of the hemisphere as its cosine leaves. What each surface makes of these lights is known term by term. */
static void test_white_furnace_of_direct_light(void** state)
{
    enum { RINGS = 12, SECTORS = 32, LIGHTS = RINGS * SECTORS };
    small_world w = small_world_create();
    double directions[LIGHTS][3], weights[LIGHTS];
    es_light_desc sun = es_default_light_desc();
    sun.type = ES_LIGHT_DIRECTIONAL;
    for (int i = 0; i < LIGHTS; i++) {
        double c = sqrt((i / SECTORS + 0.5) / RINGS), sine = sqrt(1 - c * c), phi = 2 * pi * (i % SECTORS + 0.5) / SECTORS;
        directions[i][0] = sine * cos(phi);
        directions[i][1] = sine * sin(phi);
        directions[i][2] = c;
        weights[i] = pi / LIGHTS;
        sun.intensity = (float)(weights[i] / c);
        add_light(&w, sun, es_v3(0, 0, 0), es_v3((float)-directions[i][0], (float)-directions[i][2], (float)directions[i][1]));
    }
    es_mesh mesh;
    es_material material;
    es_instance instance;
    const float corners[] = {-0.1f, 0, 0.1f, 0.1f, 0, 0.1f, 0.1f, 0, -0.1f, -0.1f, 0, -0.1f};
    const uint32_t quad[] = {0, 1, 2, 0, 2, 3};
    es_mesh_desc patch = {.vertex_count = 4, .triangle_count = 2, .positions = corners, .indices = quad, .flat_normals = true};
    es_material_desc first = material_of(&surfaces[0]);
    assert_int_equal(es_world_add_mesh(w.world, &patch, &mesh), ES_OK);
    assert_int_equal(es_world_add_material(w.world, "", &first, &material), ES_OK);
    assert_int_equal(es_world_add_instance(w.world, &(es_instance_desc){.mesh = mesh, .material = material}, &instance), ES_OK);
    es_renderer_settings s = settings_of(ES_GI_NONE);
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
    for (int a = 0; a < ANGLES; a++) {
        look_straight(&w, es_v3(0, 0, 0), towards_eye(a), 0.5f, 0.01f);
        for (int k = 0; k < SURFACES; k++) {
            es_material_desc m = material_of(&surfaces[k]);
            assert_int_equal(es_world_set_material(w.world, material, &m), ES_OK);
            assert_int_equal(es_world_step(w.world, 0), ES_OK);
            assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
            double found = mean_of_picture(&w, renderer, "direct"), expected = 0;
            double wo[3] = {sqrt(1 - (double)cosines[a] * (double)cosines[a]), 0, (double)cosines[a]};
            for (int i = 0; i < LIGHTS; i++) expected += exact_brdf(&surfaces[k], directions[i], wo) * weights[i];
            /* the colour is rounded to 16 bits and the normal to a ten-thousandth of a radian, which moves a lobe of width alpha by that */
            double width = surfaces[k].model == ES_SURFACE_PHONG ? 1 / sqrt(surfaces[k].roughness) : surfaces[k].roughness * surfaces[k].roughness;
            double allowed = 1e-3 * fmax(1, 0.1 / fmax(width, 1e-3)) * expected;
            if (!(fabs(found - expected) <= allowed)) fail_msg("surface %d at cosine %g: %.5f by these lights, expected %.5f", k, (double)cosines[a], found, expected);
            /* a lobe that covers many lights reflects as it does the sky; the rings are 30° apart at the horizon, where Fresnel's rise is */
            if (width > 0.3 && !(fabs(found - albedos[k][a]) < 0.02)) fail_msg("surface %d at cosine %g: %.5f, albedo %.5f", k, (double)cosines[a], found, albedos[k][a]);
        }
    }
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* ---- one bounce in real time -------------------------------------------------------------------------------------------------------- */

/* A patch in an integrating sphere, facing the lamp in its middle: its shadow falls behind it, and the half of the wall it faces has the
 * radiance albedo · intensity / pi R². */
static void test_white_furnace_of_one_bounce(void** state)
{
    enum { SETS = FEWER > 1 ? 2 : 4, SEGMENTS = 32 };
    static const struct { uint32_t method, bias; } methods[] = {
        {ES_GI_ISM, 0}, {ES_GI_CLASSIC, 0}, {ES_GI_VPL_TRACED, ES_TRACED_BOUNDED}, {ES_GI_VPL_TRACED, ES_TRACED_UNBOUNDED}, {ES_GI_VPL_TRACED, ES_TRACED_COMPENSATED}};
    const float wall_albedo = 0.5f, intensity = 7;
    const double radiance = (double)wall_albedo * (double)intensity / pi;
    for (int k = 0; k < SURFACES; k++) {
        const exact_surface* surface = &surfaces[k];
        /* sharper lobes are widened under virtual point lights (vpl.roughness), and dull ones left out (es_surface_has_lobe) */
        bool widened = surface->specular > 0 && (surface->model == ES_SURFACE_PHONG ? surface->roughness > 20 : surface->roughness < 0.5);
        double f0 = surface->base * surface->metallic + 0.04 * surface->specular * (1 - surface->metallic);
        bool left_out = surface->model == ES_SURFACE_METALLIC_ROUGHNESS && f0 > 0 && f0 <= 0.4 * pow(surface->roughness, 4);
        if (widened || left_out) continue;
        for (int a = 0; a < ANGLES; a += 2) {
            small_world w = small_world_create();
            es_material_desc wall = lambert(wall_albedo, 0);
            add_sphere(&w, es_v3(0, 0, 0), 1, SEGMENTS, true, &wall);
            add_patch(&w, es_v3(0, -0.5f, 0), 0.05f, surface);
            es_light_desc lamp = es_default_light_desc();
            lamp.type = ES_LIGHT_POINT;
            lamp.intensity = intensity;
            add_light(&w, lamp, es_v3(0, 0, 0), es_v3(0, 0, -1));
            look_straight(&w, es_v3(0, -0.5f, 0), towards_eye(a), 0.3f, 0.02f * cosines[a]);
            es_renderer* renderer = NULL; /* one for all: the lamp's picture of the sphere takes the longest */
            for (size_t m = 0; m < sizeof methods / sizeof methods[0]; m++) {
                /* maps take much longer than rays: from above, the white wall and a rough metal */
                if (methods[m].method == ES_GI_CLASSIC && (FEWER > 1 || a || k != 0)) continue;
                if (methods[m].method == ES_GI_ISM && (FEWER > 1 || a || (k != 0 && k != 3))) continue;
                es_renderer_settings s = settings_of(methods[m].method);
                s.traced_bias = methods[m].bias;
                s.width = s.height = 4;
                s.vpls = methods[m].method == ES_GI_CLASSIC ? 64 : 1024;
                if (methods[m].method == ES_GI_CLASSIC) s.spread = 0; /* 64 lights' area would soften them by 8 % */
                s.light_size = 128;
                s.view_importance = false;
                s.interleave = 2;
                s.ism_points = 4096;
                s.ism_pool = 65536;
                s.classic_size = 32;
                if (!renderer) assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
                running_mean mean = {0};
                for (uint32_t set = 0; set < SETS; set++) {
                    s.seed = 977 * set;
                    assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
                    assert_int_equal(es_renderer_render(renderer, w.world), ES_OK);
                    mean_add(&mean, mean_of_picture(&w, renderer, "indirect") / radiance);
                }
                /* 4 standard errors; chords (h² / 2, test_integrating_sphere.c); the quadrature */
                double off = mean_of(&mean) - albedos[k][a], allowed = 4 * standard_error_of(&mean) + 0.5 * (pi / SEGMENTS) * (pi / SEGMENTS) * albedos[k][a] + 1e-4;
                if (!(fabs(off) < allowed)) fail_msg("surface %d at cosine %g, method %zu: %.4f ± %.4f, albedo %.4f", k, (double)cosines[a], m, mean_of(&mean), standard_error_of(&mean), albedos[k][a]);
                assert_true(standard_error_of(&mean) < 0.02 * sqrt(FEWER));
            }
            es_renderer_destroy(renderer);
            small_world_destroy(&w);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_albedos),
        cmocka_unit_test(test_white_furnace),
        cmocka_unit_test(test_white_furnace_of_glowing_walls),
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_white_ball_is_invisible),
        cmocka_unit_test(test_white_furnace_of_direct_light),
        cmocka_unit_test(test_white_furnace_of_one_bounce),
    };
    return cmocka_run_group_tests(tests, find_albedos, NULL);
}
