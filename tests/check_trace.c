/* Rays: every instruction set against scalar, the hierarchy against all triangles one by one, edges without holes, refitting. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/reference/bvh.h"
#include "platform/context.h"
#include "platform/random.h"
#include "sim/sim.h"

static es_context* make_context(uint32_t threads)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = threads;
    es_context* context = NULL;
    assert_int_equal(es_context_create(&desc, &context), ES_OK);
    return context;
}

/* ---- soups of triangles -------------------------------------------------------------------------------------------------------- */

enum { TRIANGLES = 600 };
typedef struct soup {
    float positions[TRIANGLES * 3 * 4 + 32];
    uint32_t indices[TRIANGLES * 3 + 4];
    es_raster_mesh mesh;
    es_raster_instance instance;
    es_draw_list list;
} soup;

typedef enum soup_kind { SCATTERED, TINY, NEEDLES, COINCIDENT, FLAT, FAR_AWAY, SOUP_KINDS } soup_kind;

static void fill_soup(soup* s, soup_kind kind, uint32_t seed)
{
    memset(s, 0, sizeof *s);
    uint32_t n = 0;
    for (uint32_t t = 0; t < TRIANGLES; t++) {
        float centre[3], size = kind == TINY ? 1e-6f : kind == NEEDLES ? 1.0f : 0.2f;
        for (int k = 0; k < 3; k++) centre[k] = es_random_float(seed, n++) * 2.0f - 1.0f;
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) {
                float p = centre[k] + size * (es_random_float(seed, n++) - 0.5f);
                if (kind == NEEDLES && k != (int)(t % 3)) p = centre[k] + 1e-4f * (es_random_float(seed, n++) - 0.5f);
                if (kind == FLAT && k == 1) p = 0.25f;
                if (kind == COINCIDENT) p = t ? s->positions[c * 4 + k] : p;
                if (kind == FAR_AWAY) p += 1e5f;
                s->positions[(t * 3 + (uint32_t)c) * 4 + (uint32_t)k] = p;
            }
    }
    for (uint32_t i = 0; i < TRIANGLES * 3; i++) {
        s->indices[i] = i;
        s->positions[i * 4 + 3] = 1.0f;
    }
    s->mesh = (es_raster_mesh){.positions = s->positions, .indices = s->indices, .vertex_count = TRIANGLES * 3, .triangle_count = TRIANGLES, .revision = seed + 1};
    s->instance = (es_raster_instance){.mesh = &s->mesh, .transform = es_mat4_identity(), .previous_transform = es_mat4_identity()};
    s->list = (es_draw_list){.instances = &s->instance, .instance_count = 1};
}

enum { RAYS = 400 };
static void fill_rays(es_ray* rays, const soup* s, uint32_t seed)
{
    for (uint32_t i = 0; i < RAYS; i++) {
        es_ray* r = &rays[i];
        uint32_t n = i * 16;
        /* towards a point of some triangle, so that many hit; some along an axis, some short, some that begin late */
        uint32_t t = es_random_u32(seed, n++) % TRIANGLES;
        const float* p = s->positions + (size_t)t * 12;
        for (int k = 0; k < 3; k++) {
            float target = 0.3f * p[k] + 0.3f * p[4 + k] + 0.4f * p[8 + k];
            r->direction[k] = es_random_float(seed, n++) * 2.0f - 1.0f;
            if (i % 7 == 0) r->direction[k] = k == (int)(i % 3) ? (i % 2 ? 1.0f : -1.0f) : 0.0f;
            r->origin[k] = target - r->direction[k] * 1.5f;
        }
        r->min = i % 5 == 0 ? 1.0f : 0.0f;
        r->max = i % 4 == 0 ? 2.0f : 1e30f;
    }
}

/* The watertight test of the kernels, one triangle at a time: the first hit, or the one after `passed`. */
static es_hit brute_force(const es_bvh* bvh, const es_ray* r, const es_hit* passed)
{
    es_hit best = {r->max, 0, 0, ES_NO_PRIMITIVE};
    float d[3] = {es_absf(r->direction[0]), es_absf(r->direction[1]), es_absf(r->direction[2])};
    int kz = d[0] > d[1] ? (d[0] > d[2] ? 0 : 2) : (d[1] > d[2] ? 1 : 2), kx = (kz + 1) % 3, ky = (kx + 1) % 3;
    float sz = 1.0f / r->direction[kz], sx = r->direction[kx] * sz, sy = r->direction[ky] * sz;
    for (uint32_t p = 0; p < es_bvh_primitive_count(bvh); p++) {
        es_vec3 corner[3];
        es_bvh_triangle(bvh, p, corner);
        float x[3], y[3], z[3];
        for (int c = 0; c < 3; c++) {
            float v[3] = {corner[c].x - r->origin[0], corner[c].y - r->origin[1], corner[c].z - r->origin[2]};
            z[c] = v[kz];
            x[c] = v[kx] - sx * v[kz];
            y[c] = v[ky] - sy * v[kz];
        }
        float u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
        if (u == 0.0f || v == 0.0f || w == 0.0f) {
            u = (float)((double)x[2] * y[1] - (double)y[2] * x[1]);
            v = (float)((double)x[0] * y[2] - (double)y[0] * x[2]);
            w = (float)((double)x[1] * y[0] - (double)y[1] * x[0]);
        }
        if (!((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0))) continue;
        float det = u + v + w;
        if (det == 0.0f) continue;
        float inverse = 1.0f / det, t = (u * z[0] + v * z[1] + w * z[2]) * sz * inverse;
        bool later = !passed || t > passed->t || (t == passed->t && p > passed->primitive);
        if (later && t > r->min && t < best.t) best = (es_hit){t, v * inverse, w * inverse, p};
    }
    return best;
}

static void test_against_all_triangles(void** state)
{
    es_context* context = make_context(2);
    soup* s = malloc(sizeof *s);
    es_ray* rays = malloc(RAYS * sizeof *rays);
    es_hit* hits = malloc(RAYS * sizeof *hits);
    uint8_t blocked[RAYS];
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    for (int kind = 0; kind < SOUP_KINDS; kind++) {
        fill_soup(s, (soup_kind)kind, (uint32_t)kind);
        assert_int_equal(es_bvh_build(bvh, &s->list), ES_OK);
        assert_int_equal(es_bvh_primitive_count(bvh), TRIANGLES);
        fill_rays(rays, s, 77u + (uint32_t)kind);
        uint32_t found = 0;
        for (int coherent = 0; coherent < 2; coherent++) {
            es_bvh_closest(bvh, (es_ray_kind)coherent, rays, RAYS, hits);
            es_bvh_any(bvh, (es_ray_kind)coherent, rays, RAYS, blocked);
            for (uint32_t i = 0; i < RAYS; i++) {
                es_hit expected = brute_force(bvh, &rays[i], NULL);
                /* of different triangles in one plane, which is nearest is a matter of rounding, and a box may be passed by for it */
                if (kind == FLAT && hits[i].primitive != expected.primitive) {
                    assert_true(es_absf(hits[i].t - expected.t) <= 4e-6f * expected.t);
                } else {
                    assert_memory_equal(&hits[i], &expected, sizeof expected);
                }
                assert_int_equal(blocked[i], expected.primitive != ES_NO_PRIMITIVE);
                found += blocked[i];
            }
        }
        assert_true(found > RAYS / 8);
    }
    es_bvh_destroy(bvh);
    free(hits);
    free(rays);
    free(s);
    es_context_destroy(context);
}

/* From hit to hit a ray meets every triangle that it meets at all, those in one plane too, on every instruction set. */
static void test_one_after_another(void** state)
{
    es_context* context = make_context(1);
    soup* s = malloc(sizeof *s);
    es_ray* rays = malloc(RAYS * sizeof *rays);
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    static const soup_kind kinds[] = {SCATTERED, COINCIDENT};
    for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
        fill_soup(s, kinds[k], 41u);
        assert_int_equal(es_bvh_build(bvh, &s->list), ES_OK);
        fill_rays(rays, s, 43u);
        uint32_t met = 0;
        for (uint32_t i = 0; i < (kinds[k] == COINCIDENT ? 8u : RAYS); i++) {
            es_hit hit;
            es_bvh_closest(bvh, ES_RAYS_SINGLE, &rays[i], 1, &hit);
            while (hit.primitive != ES_NO_PRIMITIVE) {
                const es_hit passed = hit, expected = brute_force(bvh, &rays[i], &passed);
                for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
                    if (!(es_isa_available_mask() >> isa & 1) || !es_gi_kernel_table((es_isa)isa)) continue;
                    es_gi_kernel_table((es_isa)isa)->trace_beyond(bvh, &rays[i], &passed, &hit);
                    assert_memory_equal(&hit, &expected, sizeof hit);
                }
                met++;
            }
        }
        assert_true(met > (kinds[k] == COINCIDENT ? TRIANGLES : RAYS / 4));
    }
    es_bvh_destroy(bvh);
    free(rays);
    free(s);
    es_context_destroy(context);
}

static void test_instruction_sets_agree(void** state)
{
    es_context* context = make_context(1);
    soup* s = malloc(sizeof *s);
    es_ray* rays = malloc(RAYS * sizeof *rays);
    es_hit *expected = calloc(RAYS, sizeof *expected), *hits = calloc(RAYS, sizeof *hits);
    uint8_t any[RAYS], expected_any[RAYS];
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    for (int kind = 0; kind < SOUP_KINDS; kind++) {
        fill_soup(s, (soup_kind)kind, 5u + (uint32_t)kind);
        assert_int_equal(es_bvh_build(bvh, &s->list), ES_OK);
        fill_rays(rays, s, (uint32_t)kind);
        es_gi_kernel_table(ES_ISA_SCALAR)->trace_closest(bvh, false, rays, RAYS, expected);
        es_gi_kernel_table(ES_ISA_SCALAR)->trace_any(bvh, false, rays, RAYS, expected_any);
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1) || !es_gi_kernel_table((es_isa)isa)) continue;
            for (int coherent = 0; coherent < 2; coherent++) {
                es_gi_kernel_table((es_isa)isa)->trace_closest(bvh, coherent, rays, RAYS, hits);
                es_gi_kernel_table((es_isa)isa)->trace_any(bvh, coherent, rays, RAYS, any);
                assert_memory_equal(hits, expected, RAYS * sizeof *hits);
                assert_memory_equal(any, expected_any, RAYS);
            }
        }
    }
    es_bvh_destroy(bvh);
    free(expected);
    free(hits);
    free(rays);
    free(s);
    es_context_destroy(context);
}

/* Rays from one point or towards one, eight of one octant or not, hit the same together as alone. */
static void test_together(void** state)
{
    es_context* context = make_context(1);
    soup* s = malloc(sizeof *s);
    es_ray* rays = malloc(RAYS * sizeof *rays);
    es_hit *alone = calloc(RAYS, sizeof *alone), *together = calloc(RAYS, sizeof *together);
    uint8_t any_alone[RAYS], any_together[RAYS];
    es_bvh* bvh;
    uint32_t found = 0;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    for (int kind = 0; kind < SOUP_KINDS; kind++)
        for (uint32_t shape = 0; shape < 4; shape++) {
            fill_soup(s, (soup_kind)kind, 31u + (uint32_t)kind);
            assert_int_equal(es_bvh_build(bvh, &s->list), ES_OK);
            for (uint32_t i = 0; i < RAYS; i++) {
                uint32_t group = i / 8, n = i * 8, t = es_random_u32(32, group) % TRIANGLES;
                es_ray* r = &rays[i];
                for (int k = 0; k < 3; k++) {
                    float target = s->positions[t * 12 + (uint32_t)k];
                    float aim = es_random_float(33, group * 4 + (uint32_t)k) * 2.0f - 1.0f, spread = shape < 2 ? 0.05f : 0.4f;
                    r->direction[k] = aim + spread * (es_random_float(34, n++) - 0.5f);
                    if (group % 5 == 0 && k == (int)(group % 3)) r->direction[k] = 0.0f;
                    /* from one point, or towards one */
                    r->origin[k] = target - (shape & 1 ? r->direction[k] : aim);
                }
                r->min = i % 5 == 0 ? 0.5f : 0.0f;
                r->max = i % 4 == 0 ? 1.5f : i % 16 == 1 ? 0.9f : 1e30f;
            }
#ifndef ES_TRAP_FP
            if (shape == 3) rays[17].direction[1] = rays[90].origin[0] = __builtin_nanf(""); /* harms none of its neighbours */
#endif
            es_bvh_closest(bvh, ES_RAYS_SINGLE, rays, RAYS, alone);
            es_bvh_closest(bvh, ES_RAYS_COHERENT, rays, RAYS, together);
            es_bvh_any(bvh, ES_RAYS_SINGLE, rays, RAYS, any_alone);
            es_bvh_any(bvh, ES_RAYS_COHERENT, rays, RAYS, any_together);
            assert_memory_equal(alone, together, RAYS * sizeof *alone);
            assert_memory_equal(any_alone, any_together, RAYS);
            for (uint32_t i = 0; i < RAYS; i++) found += any_alone[i];
            /* fewer than eight are left at the end */
            memset(together, 0, RAYS * sizeof *together);
            es_bvh_closest(bvh, ES_RAYS_COHERENT, rays, 21, together);
            assert_memory_equal(alone, together, 21 * sizeof *alone);
        }
    assert_true(found > RAYS * SOUP_KINDS);
    es_bvh_destroy(bvh);
    free(together);
    free(alone);
    free(rays);
    free(s);
    es_context_destroy(context);
}

/* A closed room seen from inside: rays through the corners and edges of its triangles do not get out. */
static void test_watertight(void** state)
{
    es_context* context = make_context(1);
    es_world_settings settings = es_default_world_settings();
    settings.triangles = 2000;
    es_world* world;
    assert_int_equal(es_world_create_scene(context, "room", &settings, &world), ES_OK);
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    assert_int_equal(es_bvh_update(bvh, es_world_draw_list(world)), ES_OK);
    uint32_t n = es_bvh_primitive_count(bvh), escaped = 0, shot = 0;
    for (uint32_t p = 0; p < n; p++) {
        es_vec3 c[3];
        es_bvh_triangle(bvh, p, c);
        es_vec3 eye = es_v3(0.0f + 0.01f * (es_random_float(3, p) - 0.5f), 0.1f, 1.95f);
        es_vec3 targets[4] = {c[0], es_v3_scale(es_v3_add(c[0], c[1]), 0.5f), es_v3_add(es_v3_scale(c[1], 0.25f), es_v3_scale(c[2], 0.75f)), c[2]};
        for (int k = 0; k < 4; k++) {
            es_vec3 d = es_v3_sub(targets[k], eye);
            es_ray ray = {{eye.x, eye.y, eye.z}, 0.0f, {d.x, d.y, d.z}, 1e30f};
            es_hit hit;
            es_bvh_closest(bvh, ES_RAYS_SINGLE, &ray, 1, &hit);
            escaped += hit.primitive == ES_NO_PRIMITIVE;
            shot++;
        }
    }
    assert_true(shot > 5000);
    assert_int_equal(escaped, 0);
    es_bvh_destroy(bvh);
    es_world_destroy(world);
    es_context_destroy(context);
}

/* Moved triangles are found where they are, after refitting as after building; a hierarchy gone bad is built anew. */
static void test_refit(void** state)
{
    es_context* context = make_context(2);
    soup* s = malloc(sizeof *s);
    fill_soup(s, SCATTERED, 11);
    es_ray* rays = malloc(RAYS * sizeof *rays);
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    assert_int_equal(es_bvh_update(bvh, &s->list), ES_OK);
    float cost = es_bvh_cost(bvh);
    for (uint32_t i = 0; i < TRIANGLES * 3; i++) s->positions[i * 4 + i % 3] += 0.05f * es_random_float(12, i);
    s->mesh.revision++;
    assert_int_equal(es_bvh_refit(bvh, &s->list), ES_OK);
    fill_rays(rays, s, 13);
    for (uint32_t i = 0; i < RAYS; i++) {
        es_hit expected = brute_force(bvh, &rays[i], NULL), hit;
        es_bvh_closest(bvh, ES_RAYS_SINGLE, &rays[i], 1, &hit);
        assert_memory_equal(&hit, &expected, sizeof hit);
    }
    /* triangles exchange their places: boxes as large as the scene */
    for (uint32_t i = 0; i < TRIANGLES * 3; i++)
        for (int k = 0; k < 3; k++) s->positions[i * 4 + (uint32_t)k] = es_random_float(14, i / 3 * 3 + (uint32_t)k) * 2.0f - 1.0f + 0.1f * es_random_float(15, i * 3 + (uint32_t)k);
    s->mesh.revision++;
    assert_int_equal(es_bvh_refit(bvh, &s->list), ES_OK);
    assert_true(es_bvh_cost(bvh) > 1.5f * cost);
    s->mesh.revision++;
    assert_int_equal(es_bvh_update(bvh, &s->list), ES_OK);
    assert_true(es_bvh_cost(bvh) < 1.5f * cost);
    es_vec3 low, high;
    es_bvh_bounds(bvh, &low, &high);
    assert_true(low.x >= -1.0f && high.x <= 1.1f && low.x < -0.9f && high.x > 0.9f);
    /* other triangles */
    s->mesh.triangle_count--;
    assert_int_equal(es_bvh_refit(bvh, &s->list), ES_WRONG_STATE);
    assert_int_equal(es_bvh_update(bvh, &s->list), ES_OK);
    assert_int_equal(es_bvh_primitive_count(bvh), TRIANGLES - 1);
    es_bvh_destroy(bvh);
    free(rays);
    free(s);
    es_context_destroy(context);
}

static void test_empty_and_threads(void** state)
{
    es_context* contexts[2] = {make_context(1), make_context(3)};
    es_bvh* bvhs[2];
    es_ray ray = {{0, 0, 0}, 0, {0, 0, 1}, 1e30f};
    es_hit hit;
    uint8_t blocked;
    for (int i = 0; i < 2; i++) {
        assert_int_equal(es_bvh_create(contexts[i], &bvhs[i]), ES_OK);
        es_bvh_closest(bvhs[i], ES_RAYS_SINGLE, &ray, 1, &hit);
        es_bvh_any(bvhs[i], ES_RAYS_COHERENT, &ray, 1, &blocked);
        assert_int_equal(hit.primitive, ES_NO_PRIMITIVE);
        assert_int_equal(blocked, 0);
        es_world_settings settings = es_default_world_settings();
        settings.triangles = 20000;
        es_world* world;
        assert_int_equal(es_world_create_scene(contexts[i], "room", &settings, &world), ES_OK);
        assert_int_equal(es_bvh_build(bvhs[i], es_world_draw_list(world)), ES_OK);
        es_world_destroy(world);
    }
    float costs[2] = {es_bvh_cost(bvhs[0]), es_bvh_cost(bvhs[1])};
    assert_memory_equal(&costs[0], &costs[1], sizeof(float));
    for (int i = 0; i < 2; i++) {
        es_bvh_destroy(bvhs[i]);
        es_context_destroy(contexts[i]);
    }
}

/* A ray that leaves a surface does not meet it again, wherever the scene lies. */
static void test_offset_origin(void** state)
{
    es_context* context = make_context(1);
    es_bvh* bvh;
    assert_int_equal(es_bvh_create(context, &bvh), ES_OK);
    soup* s = malloc(sizeof *s);
    uint32_t met = 0;
    for (int kind = 0; kind < 2; kind++) {
        fill_soup(s, kind ? FAR_AWAY : SCATTERED, 21);
        for (uint32_t t = 0; t < TRIANGLES; t++) {
            s->mesh.triangle_count = 1;
            memcpy(s->indices, (uint32_t[]){t * 3, t * 3 + 1, t * 3 + 2}, 12);
            s->mesh.revision++;
            assert_int_equal(es_bvh_update(bvh, &s->list), ES_OK);
            es_vec3 c[3];
            es_bvh_triangle(bvh, 0, c);
            es_vec3 n = es_v3_normalize(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])), es_v3(0, 0, 1));
            float u = es_random_float(22, t) * 0.5f, v = es_random_float(23, t) * 0.5f;
            es_vec3 p = es_v3_add(es_v3_scale(c[0], 1.0f - u - v), es_v3_add(es_v3_scale(c[1], u), es_v3_scale(c[2], v)));
            p = es_offset_origin(p, n);
            for (uint32_t k = 0; k < 8; k++) {
                es_vec3 d = es_v3(es_random_float(24, t * 24 + k * 3) - 0.5f, es_random_float(24, t * 24 + k * 3 + 1) - 0.5f, es_random_float(24, t * 24 + k * 3 + 2) - 0.5f);
                if (es_v3_dot(d, n) < 0.0f) d = es_v3_scale(d, -1.0f);
                es_ray ray = {{p.x, p.y, p.z}, 0.0f, {d.x, d.y, d.z}, 1e30f};
                uint8_t blocked;
                es_bvh_any(bvh, ES_RAYS_SINGLE, &ray, 1, &blocked);
                met += blocked;
            }
        }
    }
    assert_int_equal(met, 0);
    free(s);
    es_bvh_destroy(bvh);
    es_context_destroy(context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_all_triangles),
        cmocka_unit_test(test_one_after_another),
        cmocka_unit_test(test_instruction_sets_agree),
        cmocka_unit_test(test_together),
        cmocka_unit_test(test_watertight),
        cmocka_unit_test(test_refit),
        cmocka_unit_test(test_empty_and_threads),
        cmocka_unit_test(test_offset_origin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
