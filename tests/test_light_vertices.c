/* The two ways to a first bounce, directions of surfaces and light vertices: each alone and both together find the same light; and pixels
 * that share their paths find the same as pixels by themselves. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/reference/reference.h"
#include "tests/reference_runs.h"
#include "tests/races.h"

enum { SIZE = 24, SPOT = 1, SOFT = 2, POINT = 4, FAR_POINT = 8, SUN = 16, RANGED = 32 };

static es_light_desc lamp(es_light_type type, float intensity)
{
    es_light_desc d = es_default_light_desc();
    d.type = type;
    d.intensity = intensity;
    return d;
}

static void add_lights(small_world* w, int which)
{
    if (which & SPOT) {
        es_light_desc d = lamp(ES_LIGHT_SPOT, 6);
        d.inner_cone = 0.3f;
        d.outer_cone = 0.3f;
        add_light(w, d, es_v3(-1, 3, 0.3f), es_v3(0.3f, -1, -0.1f));
    }
    if (which & SOFT) {
        es_light_desc d = lamp(ES_LIGHT_SPOT, 9);
        d.inner_cone = 0.1f;
        d.outer_cone = 0.7f;
        add_light(w, d, es_v3(1.2f, 3, 1), es_v3(-0.2f, -1, -0.3f));
    }
    if (which & POINT) add_light(w, lamp(ES_LIGHT_POINT, 3), es_v3(-0.5f, 2.5f, 1.5f), es_v3(0, -1, 0));
    if (which & RANGED) {
        es_light_desc d = lamp(ES_LIGHT_POINT, 5);
        d.range = 3.5f;
        add_light(w, d, es_v3(0.8f, 2, 0.2f), es_v3(0, -1, 0));
    }
    if (which & FAR_POINT) add_light(w, lamp(ES_LIGHT_POINT, 3000), es_v3(12, 25, 20), es_v3(0, -1, 0));
    if (which & SUN) add_light(w, lamp(ES_LIGHT_DIRECTIONAL, 2), es_v3(0, 9, 0), es_v3(-0.3f, -1, -0.4f));
}

/* A floor and a wall that are apart, so that light vertices alone have a finite variance, a screen between, seen from both of its sides, and a ball. */
static small_world room(int lights, es_material_desc receiver)
{
    small_world w = small_world_create();
    es_material_desc grey = lambert(0.7f, 0), screen = lambert(0.5f, 0);
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    add_rectangle(&w, es_v3(-2, 0.8f, -2.5f), es_v3(4, 0, 0), es_v3(0, 2.5f, 0), &receiver);
    add_rectangle(&w, es_v3(0.4f, 0.5f, -1.6f), es_v3(0.5f, 0, 0.8f), es_v3(0, 0.9f, 0), &screen);
    add_sphere(&w, es_v3(-1, 1.1f, -1), 0.4f, 8, false, &receiver);
    add_lights(&w, lights);
    look(&w, es_default_camera_desc(), es_v3(0, 2, 5), es_v3(0, 1.2f, -2));
    return w;
}

static es_reference* run(small_world* w, es_path_techniques techniques, uint32_t share, uint32_t bounces, uint32_t seed, uint32_t samples)
{
    es_reference_settings s = reference_settings(SIZE, SIZE, bounces);
    s.share = share;
    s.seed = seed;
    es_reference* r = begin_reference(w, &s);
    r->techniques = techniques;
    assert_int_equal(es_reference_add(r, samples), ES_OK);
    return r;
}

static measured whole_mean(es_reference* r, const char* name)
{
    char error_name[32];
    snprintf(error_name, sizeof error_name, "%s-error", name);
    es_image image = traced(r, name), error = traced(r, error_name);
    measured m = mean_of_block(&image, &error, 0, 0, SIZE, SIZE);
    es_context* context = r->context;
    es_image_destroy(context, &image);
    es_image_destroy(context, &error);
    return m;
}

static es_material_desc glossy(bool phong)
{
    es_material_desc d = lambert(0.4f, 0);
    d.specular = 1;
    d.metallic = phong ? 0 : 0.5f;
    d.roughness = 0.35f;
    if (phong) {
        d.model = ES_SURFACE_PHONG;
        d.exponent = 20;
        d.specular = 0.4f;
    }
    return d;
}

static void agree(const char* what, measured a, measured b)
{
    assert_true(a.value > 0 && b.value > 0);
    if (!(fabs(a.value - b.value) <= 4 * hypot(a.error, b.error))) fail_msg("%s: %g ± %g and %g ± %g", what, a.value, a.error, b.value, b.error);
}

static void test_each_alone(void** state)
{
    static const struct { const char* name; int lights; } cases[] = {
        {"spot", SPOT}, {"soft spot", SOFT}, {"point", POINT}, {"point with a range", RANGED}, {"point outside", FAR_POINT}, {"directional", SUN}, {"all", SPOT | SOFT | POINT | FAR_POINT | SUN | RANGED}};
    enum { SAMPLES = 128 / FEWER };
    for (int i = 0; i < (int)(sizeof cases / sizeof cases[0]); i++)
        for (int material = 0; material < 3; material++) {
            small_world w = room(cases[i].lights, material ? glossy(material == 2) : lambert(0.6f, 0));
            measured m[3];
            for (int t = 0; t < 3; t++) {
                es_reference* r = run(&w, (es_path_techniques)t, 1, 1, 7 + (uint32_t)t, SAMPLES);
                m[t] = whole_mean(r, "bounce-1");
                es_reference_destroy(r);
            }
            agree(cases[i].name, m[ES_PATH_COMBINED], m[ES_PATH_SURFACES]);
            agree(cases[i].name, m[ES_PATH_LIGHT_VERTICES], m[ES_PATH_SURFACES]);
            /* an estimate of low variance may lose a little by a second technique (Veach 1997, theorem 9.2); the errors of a sanitizer's fewer samples
             * are themselves too uncertain to tell */
            if (FEWER == 1 && !(m[ES_PATH_COMBINED].error < 1.4 * m[ES_PATH_SURFACES].error)) fail_msg("%s, material %d: error %g, of directions alone %g", cases[i].name, material, m[ES_PATH_COMBINED].error, m[ES_PATH_SURFACES].error);
            small_world_destroy(&w);
        }
}

/* Pixel by pixel and over several seeds, for the noise of neighbours is alike: deviations from pixels by themselves, in standard errors. */
static void test_shared(void** state)
{
    enum { SEEDS = 9, SAMPLES = 32, ALONE = 512 / FEWER * 2, BOUNCES = 2 };
    static const uint32_t sides[] = {2, 5, 8};
    for (int i = 0; i < 3; i++) {
        small_world w = room(SPOT | POINT, i == 1 ? glossy(false) : lambert(0.6f, 0));
        es_reference* alone = run(&w, ES_PATH_COMBINED, 1, BOUNCES, 1, ALONE);
        double squares[BOUNCES + 1] = {0}, ours[BOUNCES + 1] = {0}, theirs[BOUNCES + 1] = {0}, expected[BOUNCES + 1] = {0}, count[BOUNCES + 1] = {0};
        for (uint32_t seed = 0; seed < (FEWER > 1 ? 2 : SEEDS); seed++) {
            es_reference* shared = run(&w, ES_PATH_COMBINED, sides[i], BOUNCES, 2 + seed, SAMPLES);
            for (uint32_t b = 1; b <= BOUNCES; b++) {
                char name[16], error_name[32];
                snprintf(name, sizeof name, "bounce-%u", b);
                snprintf(error_name, sizeof error_name, "%s-error", name);
                es_image x = traced(alone, name), ex = traced(alone, error_name), y = traced(shared, name), ey = traced(shared, error_name);
                for (size_t p = 0; p < SIZE * SIZE * 3; p += 3) {
                    double e = hypot((double)ex.pixels[p], (double)ey.pixels[p]);
                    double d = (double)x.pixels[p] - (double)y.pixels[p];
                    if (!(e > 0)) continue;
                    squares[b] += d * d;
                    expected[b] += e * e;
                    ours[b] += (double)ey.pixels[p] * (double)ey.pixels[p] * SAMPLES;
                    theirs[b] += (double)ex.pixels[p] * (double)ex.pixels[p] * ALONE;
                    count[b]++;
                }
                es_image* images[] = {&x, &ex, &y, &ey};
                for (int k = 0; k < 4; k++) es_image_destroy(w.context, images[k]);
            }
            es_reference_destroy(shared);
        }
        for (uint32_t b = 1; b <= BOUNCES; b++) {
            assert_true(count[b] > SIZE * SIZE / 4);
            /* fewer seeds under a sanitizer: about 18 independent tiles in all */
            if (!(squares[b] / expected[b] < (FEWER > 1 ? 2.5 : 1.3))) fail_msg("side %u, bounce %u: mean square of deviations %.3f", sides[i], b, squares[b] / expected[b]);
            /* what sharing is for */
            if (!(ours[b] < 0.7 * theirs[b])) fail_msg("side %u, bounce %u: variance %g, alone %g", sides[i], b, ours[b], theirs[b]);
        }
        es_reference_destroy(alone);
        small_world_destroy(&w);
    }
}

static uint64_t hash_of(uint32_t isas, uint32_t threads, const uint32_t* calls)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    desc.isa_mask = isas;
    small_world w = {0};
    assert_int_equal(es_context_create(&desc, &w.context), ES_OK);
    assert_int_equal(es_world_create(w.context, NULL, &w.world), ES_OK);
    es_material_desc grey = lambert(0.7f, 0), shiny = glossy(false), glowing = lambert(0.5f, 1);
    add_rectangle(&w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    add_rectangle(&w, es_v3(-2, 0, -2), es_v3(4, 0, 0), es_v3(0, 2.5f, 0), &shiny);
    add_rectangle(&w, es_v3(-2, 1, 0), es_v3(0, 0, -1), es_v3(0, 1, 0), &glowing);
    add_lights(&w, SPOT | POINT | SUN);
    look(&w, es_default_camera_desc(), es_v3(0, 2, 5), es_v3(0, 1, -2));
    es_reference_settings s = es_default_reference_settings();
    s.width = 21;
    s.height = 13;
    s.bounces = 2;
    es_reference* r = begin_reference(&w, &s);
    for (; *calls; calls++) assert_int_equal(es_reference_add(r, *calls), ES_OK);
    es_image image = traced(r, "radiance"), error = traced(r, "radiance-error");
    uint64_t hash = es_image_hash(&image) ^ 3 * es_image_hash(&error);
    es_image_destroy(w.context, &image);
    es_image_destroy(w.context, &error);
    es_reference_destroy(r);
    small_world_destroy(&w);
    return hash;
}

static void test_same_bits(void** state)
{
    static const uint32_t whole[] = {9, 0}, split[] = {1, 2, 3, 3, 0};
    uint64_t expected = hash_of(1u << ES_ISA_SCALAR, 1, whole);
    assert_true(hash_of(0, 3, whole) == expected);
    assert_true(hash_of(0, 2, split) == expected);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_each_alone),
        unit_test_without_races(test_shared),
        cmocka_unit_test(test_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
