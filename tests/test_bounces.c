/* Further bounces: their energy where it is known, what the random choice of places is right for, and that they are the same bits however they
 * are come by. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/small_worlds.h"
#include "tests/races.h"

#if defined(__SANITIZE_THREAD__)
enum { RACES = 1 }; /* is what is looked for: on several threads alone */
#else
enum { RACES = 0 };
#endif
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
enum { SEEDS = 1, FEW_SEEDS = 2, STATISTICS = 0 };
#else
enum { SEEDS = 3, FEW_SEEDS = 24, STATISTICS = 1 };
#endif
enum { BOUNCES = 4, WIDTH = 44, HEIGHT = 33, FRAMES = 7 };

static void add_box(small_world* w, const es_material_desc* walls, const es_material_desc* red)
{
    add_rectangle(w, es_v3(-1, 0, -1), es_v3(0, 0, 2), es_v3(2, 0, 0), walls);
    add_rectangle(w, es_v3(-1, 2, -1), es_v3(2, 0, 0), es_v3(0, 0, 2), walls);
    add_rectangle(w, es_v3(-1, 0, -1), es_v3(2, 0, 0), es_v3(0, 2, 0), walls);
    add_rectangle(w, es_v3(1, 0, 1), es_v3(-2, 0, 0), es_v3(0, 2, 0), walls);
    add_rectangle(w, es_v3(-1, 0, 1), es_v3(0, 0, -2), es_v3(0, 2, 0), red);
    add_rectangle(w, es_v3(1, 0, -1), es_v3(0, 0, 2), es_v3(0, 2, 0), walls);
}

/* A closed box that all of a lamp's light stays in; with `screen`, another surface in it. */
static small_world box(const es_material_desc* walls, bool screen)
{
    small_world w = small_world_create();
    es_material_desc red = *walls;
    if (screen) red.base_color[1] = red.base_color[2] = 0.1f;
    add_box(&w, walls, &red);
    if (screen) {
        es_material_desc both = lambert(0.6f, 0);
        both.double_sided = true;
        add_rectangle(&w, es_v3(-0.2f, 0, -0.6f), es_v3(0, 0, 1.2f), es_v3(0, 1.1f, 0), &both);
    }
    es_light_desc light = es_default_light_desc();
    light.type = ES_LIGHT_POINT;
    light.intensity = 10;
    add_light(&w, light, es_v3(0.3f, 1.2f, 0.1f), es_v3(0, -1, 0));
    es_camera_desc camera = es_default_camera_desc();
    camera.fov_y = 1.3f;
    look(&w, camera, es_v3(0.9f, 1.5f, 0.9f), es_v3(-1, -0.5f, -1));
    return w;
}

static es_renderer_settings settings_of(uint32_t method, uint32_t bounce_method)
{
    es_renderer_settings s = es_default_renderer_settings();
    s.method = method;
    s.bounce_method = bounce_method;
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 256;
    s.bounces = BOUNCES;
    s.bounce_vpls = 128;
    s.light_size = 64;
    s.shadow_size = 64;
    s.ism_size = 64;
    s.ism_points = 2048;
    s.ism_pool = 65536;
    s.interleave = 4;
    return s;
}

static const es_bounce_stats* render(es_renderer* renderer, small_world* w, const es_renderer_settings* s)
{
    assert_int_equal(es_renderer_configure(renderer, s), ES_OK);
    assert_int_equal(es_renderer_render(renderer, w->world), ES_OK);
    assert_int_equal(es_renderer_stats(renderer)->bounce_count, s->bounces);
    return es_renderer_stats(renderer)->bounces;
}

/* Power of each bounce and colour, mean over sets of lights. */
static void mean_powers(small_world* w, es_renderer_settings s, int seeds, double powers[BOUNCES][3])
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w->context, &s, &renderer), ES_OK);
    for (int b = 0; b < BOUNCES; b++) powers[b][0] = powers[b][1] = powers[b][2] = 0;
    for (int seed = 0; seed < seeds; seed++) {
        s.seed = 1000 * (uint32_t)seed;
        const es_bounce_stats* stats = render(renderer, w, &s);
        for (int b = 0; b < BOUNCES; b++)
            for (int k = 0; k < 3; k++) powers[b][k] += stats[b].power[k] / seeds;
    }
    es_renderer_destroy(renderer);
}

static void expect(double value, double wanted, double tolerance, const char* what, int bounce)
{
    if (STATISTICS && !(fabs(value - wanted) <= tolerance * wanted)) fail_msg("%s, bounce %d: %.5g, wanted %.5g", what, bounce, value, wanted);
    assert_true(value >= 0 && value < 1e6);
}

/* Nothing leaves the box, so each bounce has albedo times the power of the one before; the first has the lamp's 4 pi intensity, which the cube map
 * of 64² texels a face sums to within a thousandth. Six sets of 128 lights gave 1.003, 0.998 and 0.986 of it by rays in bounces 2 to 4; imperfect
 * maps 0.965, 0.916 and 0.874, for points of neighbouring walls hide what is near edges; reflective ones 0.980, 0.961 and 0.941, for some texels
 * near the horizon stay empty. Bounds, a bounce, are regression bounds about that. */
static void test_furnace(void** state)
{
    static const struct { uint32_t method, bounce; double tolerance; const char* name; } cases[] = {
        {ES_GI_VPL_TRACED, ES_BOUNCE_ONE_PASS, 0.06, "rays, one pass"},
        {ES_GI_ISM, ES_BOUNCE_ONE_PASS, 0.07, "imperfect maps, one pass"},
        {ES_GI_ISM, ES_BOUNCE_REFLECTIVE, 0.03, "reflective maps"},
        {ES_GI_VPL_SAMPLED, ES_BOUNCE_REFLECTIVE, 0.03, "sampled, reflective maps"},
        {ES_GI_CLASSIC, ES_BOUNCE_ONE_PASS, 0.08, "accurate maps, one pass"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        for (int albedo = 0; albedo < 2; albedo++) {
            const float a = albedo ? 1.0f : 0.5f;
            es_material_desc white = lambert(a, 0);
            small_world w = box(&white, false);
            es_renderer_settings s = settings_of(cases[i].method, cases[i].bounce);
            if (s.method == ES_GI_CLASSIC) s.vpls = s.bounce_vpls = 64, s.classic_size = 32;
            s.view_importance = false; /* without, each light of the first bounce has the same power, and that is exact */
            double powers[BOUNCES][3], wanted = 4 * 3.14159265 * 10;
            mean_powers(&w, s, SEEDS, powers);
            for (int b = 0; b < BOUNCES; b++, wanted *= (double)a)
                for (int k = 0; k < 3; k++) expect(powers[b][k], wanted, b ? cases[i].tolerance * b : 0.002, cases[i].name, b + 1);
            small_world_destroy(&w);
            if (!STATISTICS) break;
        }
}

/* The mean over sets does not depend on how many lights stand for a bounce: what few are right on average for is what many find at once. Were the
 * weak places lost, few lights would have the strong ones' power. */
static void test_selection(void** state)
{
    es_material_desc grey = lambert(0.7f, 0);
    small_world w = box(&grey, true);
    for (uint32_t bounce_method = 0; bounce_method < 2; bounce_method++) {
        es_renderer_settings s = settings_of(ES_GI_ISM, bounce_method);
        double sum = 0, difference = 0, squares = 0;
        s.vpls = 64;
        s.bounces = 2;
        es_renderer* renderer;
        assert_int_equal(es_renderer_create(w.context, &s, &renderer), ES_OK);
        for (int seed = 0; seed < FEW_SEEDS; seed++) {
            double power[2];
            s.seed = 500 * (uint32_t)seed;
            for (int size = 0; size < 2; size++) {
                s.bounce_vpls = size ? 512 : 16;
                power[size] = render(renderer, &w, &s)[1].power[0];
            }
            sum += power[1];
            difference += power[0] - power[1];
            squares += (power[0] - power[1]) * (power[0] - power[1]);
        }
        const double mean = sum / FEW_SEEDS, error = sqrt(squares / FEW_SEEDS / (FEW_SEEDS - 1));
        difference /= FEW_SEEDS;
        if (STATISTICS && !(fabs(difference) < 4 * error && error < 0.05 * mean)) fail_msg("bounce.method %u: few lights have %.3f of many's power, standard error %.3f", bounce_method, 1 + difference / mean, error / mean);
        es_renderer_destroy(renderer);
    }
    small_world_destroy(&w);
}

/* Both methods find the same light. */
static void test_agreement(void** state)
{
    es_material_desc grey = lambert(0.7f, 0), metal = lambert(0.9f, 0);
    metal.metallic = 1;
    metal.roughness = 0.6f;
    for (int glossy = 0; glossy < 2; glossy++) {
        small_world w = box(glossy ? &metal : &grey, true);
        double a[BOUNCES][3], b[BOUNCES][3];
        mean_powers(&w, settings_of(ES_GI_VPL_TRACED, ES_BOUNCE_ONE_PASS), SEEDS, a);
        mean_powers(&w, settings_of(ES_GI_ISM, ES_BOUNCE_REFLECTIVE), SEEDS, b);
        for (int n = 1; n < BOUNCES; n++)
            for (int k = 0; k < 3; k++) expect(b[n][k], a[n][k], 0.08 * n, glossy ? "glossy, reflective against one pass" : "reflective against one pass", n + 1);
        if (glossy && STATISTICS) { /* lobes carry light on: without them metal has none to send */
            assert_true(a[1][0] > 0.4 * a[0][0] && a[1][0] < a[0][0]);
            es_renderer_settings s = settings_of(ES_GI_VPL_TRACED, ES_BOUNCE_ONE_PASS);
            s.glossy_vpls = false;
            mean_powers(&w, s, 1, b);
            assert_true(b[1][0] < 0.5 * a[1][0]);
        }
        small_world_destroy(&w);
    }
}

/* ---- bits ------------------------------------------------------------------------------------------------------------------ */

static es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

static uint64_t hash_of(small_world* w, es_renderer* renderer, const char* name)
{
    es_image image = picture(renderer, name);
    uint64_t hash = es_image_hash(&image);
    es_image_destroy(w->context, &image);
    return hash;
}

static void test_sum(void** state)
{
    es_material_desc glossy = lambert(0.7f, 0);
    glossy.specular = 1;
    glossy.roughness = 0.4f;
    small_world w = box(&glossy, true);
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(w.context, NULL, &renderer), ES_OK);
    for (int kind = 0; kind < 5; kind++) {
        es_renderer_settings s = settings_of(kind == 1 ? ES_GI_VPL_SAMPLED : kind == 2 ? ES_GI_VPL_TRACED : ES_GI_ISM, kind % 2);
        s.half_resolution = kind == 3;
        s.bounces = kind == 4 ? 1 : 3;
        render(renderer, &w, &s);
        s.half_resolution = false; /* images are of the frame, not of what the next one will be */
        s.filter_passes = 0;
        assert_int_equal(es_renderer_configure(renderer, &s), ES_OK);
        es_image whole = picture(renderer, "indirect");
        size_t count = (size_t)whole.width * whole.height * 3;
        float* sum = calloc(count, sizeof *sum);
        double means[4] = {0};
        for (uint32_t b = 1; b <= 4; b++) {
            char name[16];
            snprintf(name, sizeof name, "indirect-%u", b);
            es_image part = picture(renderer, name);
            for (size_t i = 0; i < count; i++) {
                sum[i] += part.pixels[i];
                means[b - 1] += (double)part.pixels[i] / (double)count;
            }
            es_image_destroy(w.context, &part);
        }
        assert_memory_equal(sum, whole.pixels, count * sizeof *sum);
        for (uint32_t b = 0; b < 4; b++) {
            if (b >= s.bounces) assert_true(means[b] == 0);
            else assert_true(means[b] > 0 && (b == 0 || means[b] < means[b - 1]));
        }
        es_image_destroy(w.context, &whole);
        free(sum);
    }
    es_image image;
    assert_int_equal(es_renderer_image(renderer, "indirect-17", &image), ES_IMAGE_UNKNOWN);
    assert_int_equal(es_renderer_image(renderer, "indirect-01", &image), ES_IMAGE_UNKNOWN);
    es_renderer_destroy(renderer);
    small_world_destroy(&w);
}

/* A renderer that has seen other settings, threads and moved points renders what a new one does. */
static void test_skipping(void** state)
{
    es_material_desc grey = lambert(0.7f, 0);
    small_world w = box(&grey, true);
    for (uint32_t bounce_method = 0; bounce_method < 2; bounce_method++) {
        es_renderer_settings s = settings_of(ES_GI_ISM, bounce_method), once = s;
        once.skip = false;
        es_renderer *kept, *fresh;
        assert_int_equal(es_renderer_create(w.context, &once, &fresh), ES_OK);
        render(fresh, &w, &once);
        const uint64_t display = hash_of(&w, fresh, "indirect"), second = hash_of(&w, fresh, "indirect-2");
        es_renderer_destroy(fresh);
        assert_int_equal(es_renderer_create(w.context, &s, &kept), ES_OK);
        static const uint32_t counts[] = {4, 4, 1, 2, 6, 4};
        for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++) {
            s.bounces = counts[i];
            render(kept, &w, &s);
            const es_frame_stats* stats = es_renderer_stats(kept);
            for (size_t p = 0; p < stats->pass_count && i == 1; p++)
                if (!strcmp(stats->passes[p].name, "bounces") || !strcmp(stats->passes[p].name, "shading")) assert_non_null(stats->passes[p].skipped);
            if (counts[i] != 4) continue;
            assert_true(hash_of(&w, kept, "indirect") == display);
            assert_true(hash_of(&w, kept, "indirect-2") == second);
        }
        es_renderer_destroy(kept);
    }
    small_world_destroy(&w);
}

/* While things move: lights that stay on their surfaces, history and kept maps give what a renderer does that does all of it anew. */
static void test_moving(void** state)
{
    for (uint32_t bounce_method = 0; bounce_method < 2; bounce_method++) {
        es_context* context;
        es_world* worlds[2];
        es_renderer* renderers[2];
        assert_int_equal(es_context_create(NULL, &context), ES_OK);
        uint64_t last = 0, changes = 0;
        for (int i = 0; i < 2; i++) {
            es_renderer_settings s = settings_of(ES_GI_ISM, bounce_method);
            s.bounces = 3;
            s.vpls = s.bounce_vpls = 64;
            s.ism_points = 1024;
            s.stable_vpls = s.temporal = true;
            s.skip = i == 0;
            assert_int_equal(es_world_create_scene(context, "cornell-stack", NULL, &worlds[i]), ES_OK);
            assert_int_equal(es_renderer_create(context, &s, &renderers[i]), ES_OK);
        }
        for (int frame = 0; frame < FRAMES; frame++) {
            uint64_t hashes[2][3];
            for (int i = 0; i < 2; i++) {
                /* twice nothing moves */
                if (frame != 2 && frame != 3) assert_int_equal(es_world_step(worlds[i], 1.0f / 30), ES_OK);
                assert_int_equal(es_renderer_render(renderers[i], worlds[i]), ES_OK);
                static const char* const names[] = {"indirect", "indirect-3", "display"};
                for (int n = 0; n < 3; n++) {
                    es_image image = picture(renderers[i], names[n]);
                    hashes[i][n] = es_image_hash(&image);
                    es_image_destroy(context, &image);
                }
            }
            if (memcmp(hashes[0], hashes[1], sizeof hashes[0]) != 0) fail_msg("frame %d differs with bounce.method %u", frame, bounce_method);
            changes += hashes[0][1] != last;
            last = hashes[0][1];
        }
        assert_true(changes > 3);
        for (int i = 0; i < 2; i++) {
            es_renderer_destroy(renderers[i]);
            es_world_destroy(worlds[i]);
        }
        es_context_destroy(context);
    }
}

/* One thread and every instruction set at hand. */
static void test_bits(void** state)
{
    es_material_desc glossy = lambert(0.7f, 0);
    glossy.specular = 1;
    glossy.roughness = 0.4f;
    for (uint32_t bounce_method = 0; bounce_method < 2; bounce_method++) {
        uint64_t first = 0;
        for (int isa = -1; isa < (RACES ? 0 : ES_ISA_COUNT); isa++) {
            if (isa >= 0 && !(es_isa_available_mask() >> isa & 1)) continue;
            es_context_desc desc = es_default_context_desc();
            desc.threads = isa < 0 ? 2 : 1;
            if (isa >= 0) desc.isa_mask = 1u << isa;
            small_world own = {0};
            assert_int_equal(es_context_create(&desc, &own.context), ES_OK);
            assert_int_equal(es_world_create(own.context, NULL, &own.world), ES_OK);
            es_material_desc red = glossy;
            add_box(&own, &glossy, &red);
            es_light_desc light = es_default_light_desc();
            add_light(&own, light, es_v3(0.3f, 1.2f, 0.1f), es_v3(0, -1, 0));
            look(&own, es_default_camera_desc(), es_v3(0.9f, 1.5f, 0.9f), es_v3(-1, -0.5f, -1));
            es_renderer* renderer;
            es_renderer_settings s = settings_of(ES_GI_ISM, bounce_method);
            assert_int_equal(es_renderer_create(own.context, &s, &renderer), ES_OK);
            render(renderer, &own, &s);
            uint64_t hash = hash_of(&own, renderer, "indirect");
            if (isa < 0) first = hash;
            if (hash != first) fail_msg("%s differs with bounce.method %u", es_isa_name((es_isa)isa), bounce_method);
            es_renderer_destroy(renderer);
            small_world_destroy(&own);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        unit_test_without_races(test_furnace), unit_test_without_races(test_selection), unit_test_without_races(test_agreement),
        unit_test_without_races(test_sum),     unit_test_without_races(test_skipping),  cmocka_unit_test(test_bits),
        cmocka_unit_test(test_moving),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
