/* Direct light of the points of micro-buffers (gi/micro/light.h): the laws of distance and cosine, shadows, what lobes send, and the same bits on every
 * instruction set and any number of threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/micro/light.h"
#include "platform/random.h"
#include "tests/hand_forest.h"
#include "tests/lit_worlds.h"
#include "tests/same_bits.h"
#include "tests/surface_in_double.h"

static es_lobe_albedo lobes;

static es_point_light_job job_of(const lit_world* l)
{
    lobes = es_lobe_albedos;
    const es_renderer_settings s = es_default_renderer_settings();
    return (es_point_light_job){.views = l->views, .view_count = l->count, .shadow_filter = s.shadow_filter, .shadow_bias = s.shadow_bias, .shadow_slope_bias = s.shadow_slope_bias, .lobes = &lobes};
}

static es_light_desc light_of(es_light_type type, float intensity)
{
    es_light_desc d = es_default_light_desc();
    d.type = type;
    d.intensity = intensity;
    return d;
}

/* ---- known light -------------------------------------------------------------------------------------------------------------- */

enum { SIDE = 16 };

/* A floor of 4 m × 4 m, at y = 0, and leaves all over it. */
static es_point_forest floor_leaves(float albedo)
{
    const uint32_t counts[] = {4, 1, SIDE * SIDE - 8, 2, 1};
    es_point_forest f = hand_forest(counts, 5);
    for (uint32_t i = 0; i < SIDE * SIDE; i++)
        set_leaf(&f, i, es_v3(-1.9f + 3.8f * (float)(i % SIDE) / (SIDE - 1), 0, -1.9f + 3.8f * (float)(i / SIDE) / (SIDE - 1)), es_v3(0, 1, 0), ES_SURFACE_METALLIC_ROUGHNESS, albedo, 0, 1, 0);
    return f;
}

static void add_floor(small_world* w)
{
    const es_material_desc grey = lambert(0.5f, 0);
    add_rectangle(w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
}

static void test_laws(void** state)
{
    (void)state;
    for (int kind = 0; kind < 5; kind++) {
        lit_world l = {.w = small_world_create()};
        add_floor(&l.w);
        const es_vec3 at = es_v3(0.3f, 1.7f, -0.4f), direction = es_v3(0.2f, -1, 0.1f);
        es_light_desc d = light_of(kind < 2 ? ES_LIGHT_POINT : kind < 4 ? ES_LIGHT_SPOT : ES_LIGHT_DIRECTIONAL, 3);
        if (kind == 1) d.range = 2.5f;
        if (kind == 2 || kind == 3) {
            d.inner_cone = kind == 2 ? 0.2f : 1.0f;
            d.outer_cone = kind == 2 ? 0.6f : 1.5f;
        }
        add_light(&l.w, d, at, direction);
        draw_shadows(&l, 512);
        es_point_forest f = floor_leaves(0.8f);
        const es_point_light_job job = job_of(&l);
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        uint32_t lit = 0;
        for (size_t i = 0; i < f.leaf_count; i++) {
            const es_vec3 to = es_v3_sub(es_v3(f.x[i], f.y[i], f.z[i]), at), axis = es_v3_normalize(direction, to);
            const float distance = es_v3_length(to);
            const es_vec3 w = kind == 4 ? axis : es_v3_scale(to, 1 / distance);
            const double e = 3.0 * (double)es_light_falloff(&l.views[0].light, w, distance) * (double)-w.y / (kind == 4 ? 1 : (double)(distance * distance));
            const double expected = e * (double)es_unpack_unorm16(es_pack_unorm16(0.8f)) / pi;
            for (int k = 0; k < 3; k++)
                if (!(fabs((double)leaf_radiance(&f, i, k) - expected) <= 2e-6 * expected + 2e-7)) fail_msg("kind %d, leaf %zu: %g, expected %g", kind, i, (double)leaf_radiance(&f, i, k), expected);
            lit += expected > 0;
        }
        assert_true(lit >= SIDE * SIDE / 16); /* of 256, in the narrowest cone and the shortest range */
        hand_forest_free(&f);
        lit_world_destroy(&l);
    }
}

/* A square over the floor: its shadow is where lines to the light pass it; leaves nearer to its border than the filter reaches are left out. */
static void test_occluder(void** state)
{
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        lit_world l = {.w = small_world_create()};
        add_floor(&l.w);
        const es_material_desc grey = lambert(0.5f, 0);
        add_rectangle(&l.w, es_v3(-0.5f, 1, 0.5f), es_v3(1, 0, 0), es_v3(0, 0, -1), &grey);
        const es_vec3 at = es_v3(0.2f, 2, 0.1f);
        es_light_desc d = light_of((es_light_type[]){ES_LIGHT_POINT, ES_LIGHT_SPOT, ES_LIGHT_DIRECTIONAL}[kind], 1);
        d.outer_cone = 1.1f;
        add_light(&l.w, d, at, es_v3(0, -1, 0));
        draw_shadows(&l, 1024);
        es_point_forest f = floor_leaves(0.8f);
        const es_point_light_job job = job_of(&l);
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        uint32_t dark = 0, bright = 0;
        for (size_t i = 0; i < f.leaf_count; i++) {
            const float t = kind == 2 ? 0 : 0.5f, px = f.x[i] + t * (at.x - f.x[i]), pz = f.z[i] + t * (at.z - f.z[i]), inside = 0.5f - es_maxf(es_absf(px), es_absf(pz));
            if (es_absf(inside) < 0.03f) continue;
            const float found = leaf_radiance(&f, i, 0);
            if (inside > 0 && !(found == 0)) fail_msg("kind %d: light of %g leaks to (%g, %g)", kind, (double)found, (double)f.x[i], (double)f.z[i]);
            const float w = es_sqrt((f.x[i] - at.x) * (f.x[i] - at.x) + 4 + (f.z[i] - at.z) * (f.z[i] - at.z));
            if (kind == 1 && 2 / w < 0.5f) continue; /* beyond the cone */
            if (inside < 0 && !(found > 0)) fail_msg("kind %d: (%g, %g) is in a shadow that is not there", kind, (double)f.x[i], (double)f.z[i]);
            dark += inside > 0;
            bright += inside < 0;
        }
        assert_true(dark > 10 && bright > 40);
        hand_forest_free(&f);
        lit_world_destroy(&l);
    }
}

/* Nothing that is lit at any angle may be shadowed by itself. */
static void test_no_acne(void** state)
{
    (void)state;
    enum { LEAVES = 4096 };
    for (int kind = 0; kind < 3; kind++) {
        lit_world l = {.w = small_world_create()};
        const es_material_desc grey = lambert(0.5f, 0);
        add_sphere(&l.w, es_v3(0, 0, 0), 1, 64, false, &grey);
        es_light_desc d = light_of((es_light_type[]){ES_LIGHT_POINT, ES_LIGHT_SPOT, ES_LIGHT_DIRECTIONAL}[kind], 1);
        const es_vec3 at = es_v3(1.3f, 1.9f, 1.1f);
        add_light(&l.w, d, at, es_v3_scale(at, -1));
        draw_shadows(&l, 512);
        const es_raster_instance* instance = es_world_draw_list(l.w.world)->instances;
        const es_raster_mesh* mesh = instance->mesh;
        es_point_forest f = hand_forest(&(uint32_t){LEAVES}, 1);
        for (uint32_t i = 0; i < LEAVES; i++) {
            const uint32_t* v = mesh->indices + 3 * (size_t)(es_random_u32(3, 3 * i) % mesh->triangle_count);
            float a = es_unit_float(es_random_u32(3, 3 * i + 1)), b = es_unit_float(es_random_u32(3, 3 * i + 2));
            if (a + b > 1) a = 1 - a, b = 1 - b;
            es_vec3 p[3];
            for (int k = 0; k < 3; k++) p[k] = es_v3(mesh->positions[4 * v[k]], mesh->positions[4 * v[k] + 1], mesh->positions[4 * v[k] + 2]);
            const es_vec3 q = es_v3_add(es_v3_scale(p[0], 1 - a - b), es_v3_add(es_v3_scale(p[1], a), es_v3_scale(p[2], b)));
            set_leaf(&f, i, q, es_v3_cross(es_v3_sub(p[1], p[0]), es_v3_sub(p[2], p[0])), ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 1, 0);
        }
        const es_point_light_job job = job_of(&l);
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        uint32_t acne = 0, facing = 0;
        for (uint32_t i = 0; i < LEAVES; i++) {
            const es_vec3 to = kind == 2 ? at : es_v3_sub(at, es_v3(f.x[i], f.y[i], f.z[i]));
            const float c = es_v3_dot(es_unpack_normal(f.normal[i]), es_v3_normalize(to, to)), e = kind == 2 ? c : c / es_v3_dot(to, to), d2 = es_light_cone(&l.views[0].light, es_v3_normalize(es_v3_scale(to, -1), to));
            if (c <= 0) assert_true(leaf_radiance(&f, i, 0) == 0);
            if (c < 0.1f || d2 <= 0) continue;
            facing++;
            acne += leaf_radiance(&f, i, 0) < 0.98f * e * d2 / ES_PI;
        }
        assert_true(facing > LEAVES / 8);
        if (acne) fail_msg("kind %d: %u of %u leaves shadow themselves", kind, acne, facing);
        hand_forest_free(&f);
        lit_world_destroy(&l);
    }
}

/* What a leaf sends is what its surface reflects, as an integral over the model in double precision has it. */
static void test_lobes(void** state)
{
    (void)state;
    static const exact_surface surfaces[] = {{ES_SURFACE_METALLIC_ROUGHNESS, 0.6, 0, 153 / 255.0, 1}, {ES_SURFACE_METALLIC_ROUGHNESS, 0.9, 1, 51 / 255.0, 1}, {ES_SURFACE_METALLIC_ROUGHNESS, 0.5, 0, 26 / 255.0, 1},
        {ES_SURFACE_METALLIC_ROUGHNESS, 0.8, 1, 1, 1}, {ES_SURFACE_METALLIC_ROUGHNESS, 0.3, 0, 102 / 255.0, 102 / 255.0}, {ES_SURFACE_PHONG, 0.3, 0, 5, 153 / 255.0}, {ES_SURFACE_PHONG, 0.3, 0, 50, 153 / 255.0}};
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    enum { COSINES = 2, SURFACES = 2 };
#else
    enum { COSINES = 4, SURFACES = sizeof surfaces / sizeof surfaces[0] };
#endif
    lit_world l = {.w = small_world_create()};
    add_floor(&l.w);
    for (int c = 0; c < COSINES; c++) {
        const float cosine = ((float)c + 0.45f) / COSINES;
        add_light(&l.w, light_of(ES_LIGHT_DIRECTIONAL, 1), es_v3(0, 1, 0), es_v3(es_sqrt(1 - cosine * cosine), -cosine, 0));
    }
    draw_shadows(&l, 64);
    es_point_forest f = hand_forest(&(uint32_t){8}, 1);
    for (uint32_t i = 0; i < SURFACES; i++)
        set_leaf(&f, i, es_v3(0.1f * (float)i, 0, 0), es_v3(0, 1, 0), surfaces[i].model, (float)surfaces[i].base, (float)surfaces[i].metallic, (float)surfaces[i].roughness, (float)surfaces[i].specular);
    double worst = 0;
    for (int c = 0; c < COSINES; c++) {
        es_point_light_job job = job_of(&l);
        job.views += c;
        job.view_count = 1;
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        const double cosine = -(double)l.views[c].light.direction.y;
        for (uint32_t i = 0; i < SURFACES; i++) {
            const double found = (double)leaf_radiance(&f, i, 0) * pi / cosine, expected = exact_albedo(&surfaces[i], cosine);
            worst = fmax(worst, fabs(found - expected));
            /* a hundredth: what linear interpolation of the steepest curve leaves between columns of the table */
            if (!(fabs(found - expected) <= 0.01)) fail_msg("surface %u at cosine %.3f reflects %.4f, expected %.4f", i, cosine, found, expected);
            es_surface s = es_surface_of_gbuffer(f.albedo_rg[i], f.albedo_b[i], f.surface[i]);
            const es_vec3 lobe = es_lobe_albedo_at(&lobes, &s, (float)cosine);
            const float f90 = s.model == ES_SURFACE_PHONG ? 0 : es_minf(25 * s.specular.x, 1);
            const double alone = (double)(lobe.x + s.albedo.x * es_interface_mean(f90) * (1 - f90 * (0.04f + 0.96f * (float)fifth(1 - cosine))));
            assert_true(fabs(alone - found) < 1e-5);
        }
    }
    /* from everywhere: the mean of the above, 2 ∫ a(c) c dc */
    for (uint32_t i = 0; i < SURFACES; i++) {
        double mean = 0;
        enum { STEPS = 5 };
        for (int c = 0; c < STEPS; c++) mean += 2 * exact_albedo(&surfaces[i], (c + 0.5) / STEPS) * (c + 0.5) / STEPS / STEPS;
        const es_surface s = es_surface_of_gbuffer(f.albedo_rg[i], f.albedo_b[i], f.surface[i]);
        const es_vec3 albedo = es_surface_albedo(&lobes, &s);
        if (!(fabs((double)albedo.x - mean) <= 0.01)) fail_msg("surface %u reflects %.4f of light from everywhere, expected %.4f", i, (double)albedo.x, mean);
    }
    printf("largest error of a directional albedo: %.4f\n", worst);
    hand_forest_free(&f);
    lit_world_destroy(&l);
}

/* ---- the same bits ------------------------------------------------------------------------------------------------------------- */

static es_point_forest random_forest(void)
{
    const uint32_t counts[] = {1, 512, 2, 1024, 4, 8, 1, 16};
    es_point_forest f = hand_forest(counts, 8);
    uint32_t n = 0;
    for (size_t i = 0; i < f.leaf_count; i++) {
        float u[12];
        for (int k = 0; k < 12; k++) u[k] = es_unit_float(es_random_u32(11, n++));
        const es_vec3 p = es_v3(4 * u[0] - 2, u[1] < 0.5f ? 0 : 2 * u[2], 4 * u[3] - 2);
        set_leaf(&f, i, p, es_v3(u[4] - 0.5f, u[5], u[6] - 0.5f), (uint32_t)(3 * u[7]), u[8], u[9] < 0.5f ? 0 : u[9], u[10], u[11] < 0.5f ? 0 : u[11]);
    }
    for (size_t i = 0; i < f.node_count; i++) {
        es_vec3 glow;
        glow.x = es_unit_float(es_random_u32(11, n++));
        glow.y = glow.z = 0.5f * glow.x;
        f.emission[i] = es_pack_rgb9e5(glow);
    }
    return f;
}

static lit_world busy_world(void)
{
    lit_world l = {.w = small_world_create()};
    add_floor(&l.w);
    const es_material_desc grey = lambert(0.5f, 0);
    add_sphere(&l.w, es_v3(0.3f, 0.6f, 0), 0.5f, 12, false, &grey);
    add_light(&l.w, light_of(ES_LIGHT_POINT, 4), es_v3(-1, 1.5f, 1), es_v3(0, -1, 0));
    add_light(&l.w, light_of(ES_LIGHT_SPOT, 9), es_v3(1, 3, 1), es_v3(-0.2f, -1, -0.3f));
    add_light(&l.w, light_of(ES_LIGHT_DIRECTIONAL, 1), es_v3(0, 1, 0), es_v3(0.4f, -1, 0.2f));
    draw_shadows(&l, 256);
    return l;
}

static void test_same_bits(void** state)
{
    (void)state;
    lit_world l = busy_world();
    es_point_forest f = random_forest();
    es_point_light_job job = job_of(&l);
    for (uint32_t taps = 1; taps <= 4; taps++) {
        job.shadow_filter = taps;
        job.emission = taps != 2;
        same_bits same = {.most_threads = 3};
        for (es_context* context; (context = next_context(&same));) {
            const guarded_radiance guarded = guard_radiance(&f, -1);
            assert_int_equal(es_points_light_direct(context, &f, &job), ES_OK);
            size_t written = 0;
            for (size_t i = 0; i < f.node_count; i++) written += f.radiance[0][i] != -1;
            assert_int_equal(written, f.leaf_count); /* and no inner node */
            for (int k = 0; k < 3; k++) expect_same_bits(&same, f.radiance[k], f.node_count * sizeof(float));
            check_radiance_guards(&f, &guarded);
            es_context_destroy(context);
        }
    }
    hand_forest_free(&f);
    lit_world_destroy(&l);
}

/* ---- little to light ------------------------------------------------------------------------------------------------------------ */

static void test_little(void** state)
{
    (void)state;
    lit_world l = busy_world();
    es_point_light_job job = job_of(&l);
    es_point_forest none = hand_forest(NULL, 0);
    assert_int_equal(es_points_light_direct(l.w.context, &none, &job), ES_OK);
    hand_forest_free(&none);
    es_point_forest f = random_forest();
    /* no light: what glows only */
    job.view_count = 0;
    for (int glow = 0; glow < 2; glow++) {
        job.emission = glow;
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        for (size_t i = 0; i < f.leaf_count; i++) {
            const es_vec3 e = es_unpack_rgb9e5(f.emission[node_of_leaf(&f, i)]);
            assert_true(leaf_radiance(&f, i, 0) == (glow ? e.x : 0));
            assert_true(leaf_radiance(&f, i, 2) == (glow ? e.z : 0));
        }
    }
    /* black and unlit surfaces send nothing; a light in a leaf's place leaves it finite */
    job = job_of(&l);
    for (size_t i = 0; i < f.leaf_count; i++) set_leaf(&f, i, es_v3(f.x[i], f.y[i], f.z[i]), es_v3(0, 1, 0), i % 2 ? ES_SURFACE_UNLIT : ES_SURFACE_METALLIC_ROUGHNESS, i % 2 ? 1 : 0, 0, 1, 0);
    assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
    for (size_t i = 0; i < f.leaf_count; i++) assert_true(leaf_radiance(&f, i, 1) == 0);
    for (size_t i = 0; i < f.leaf_count; i++) set_leaf(&f, i, l.views[i % 2].light.position, es_v3(0, 1, 0), i % 3 ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS, 1, 0, 1, 1);
    assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
    for (size_t i = 0; i < f.leaf_count; i++) assert_true(isfinite(leaf_radiance(&f, i, 1)) && leaf_radiance(&f, i, 1) >= 0);
    hand_forest_free(&f);
    lit_world_destroy(&l);
}

/* test_point_light --time: a million leaves, in the order of a curve over the floor, by one spot light. */
static void time_all(void)
{
    enum { COUNT = 1 << 20 };
    lit_world l = {.w = small_world_create()};
    add_floor(&l.w);
    const es_material_desc grey = lambert(0.5f, 0);
    add_sphere(&l.w, es_v3(0.3f, 0.6f, 0), 0.5f, 32, false, &grey);
    es_light_desc d = light_of(ES_LIGHT_SPOT, 9);
    d.outer_cone = 0.8f;
    add_light(&l.w, d, es_v3(1, 3, 1), es_v3(-0.3f, -1, -0.3f));
    draw_shadows(&l, 1024);
    es_point_forest f = hand_forest(&(uint32_t){COUNT}, 1);
    for (uint32_t i = 0; i < COUNT; i++) {
        uint32_t x = 0, z = 0;
        for (uint32_t b = 0; b < 10; b++) x |= (i >> 2 * b & 1) << b, z |= (i >> (2 * b + 1) & 1) << b;
        set_leaf(&f, i, es_v3(-1.9f + 3.8f * (float)x / 1023, 0, -1.9f + 3.8f * (float)z / 1023), es_v3(0, 1, 0), ES_SURFACE_METALLIC_ROUGHNESS, 0.5f, 0, 0.5f, i >> 19 ? 1 : 0);
    }
    const double before = es_seconds();
    const es_point_light_job job = job_of(&l);
    printf("table of lobes %8.2f ms\n", (es_seconds() - before) * 1e3);
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        es_context_desc desc = es_default_context_desc();
        desc.threads = 2;
        desc.isa_mask = 1u << isa;
        es_context* context;
        assert_int_equal(es_context_create(&desc, &context), ES_OK);
        double best = 1e9;
        for (int i = 0; i < 10; i++) {
            const double begin = es_seconds();
            es_points_light_direct(context, &f, &job);
            best = fmin(best, es_seconds() - begin);
        }
        printf("%-7s %8.2f ms for 2^20 leaves and one spot light, two threads\n", es_isa_name((es_isa)isa), best * 1e3);
        es_context_destroy(context);
    }
    hand_forest_free(&f);
    lit_world_destroy(&l);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_laws),
        cmocka_unit_test(test_occluder),
        cmocka_unit_test(test_no_acne),
        cmocka_unit_test(test_lobes),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
