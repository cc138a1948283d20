/* Lobes of the points of micro-buffers (gi/micro/lobe_shape.h, forest.h): their energy, how near they are to the surface model, nodes that stand for bent surfaces, a
 * caustic against a sum over all points with the model itself, and the same bits on every instruction set and any number of threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernels/node_lobe_simd.h"
#include "gi/micro/light.h"
#include "gi/micro/micro.h"
#include "platform/context.h"
#include "tests/hand_forest.h"
#include "tests/lit_worlds.h"
#include "tests/same_bits.h"
#include "tests/surface_in_double.h"

static es_lobe_albedo albedos;
static es_lobe_shapes shapes;

static es_point_light_job job_of(const lit_world* l, bool apart)
{
    albedos = es_lobe_albedos;
    es_lobe_shapes_fill(l->w.context, &shapes);
    const es_renderer_settings s = es_default_renderer_settings();
    return (es_point_light_job){.views = l->views, .view_count = l->count, .shadow_filter = s.shadow_filter, .shadow_bias = s.shadow_bias, .shadow_slope_bias = s.shadow_slope_bias, .lobes = &albedos,
        .shapes = apart ? &shapes : NULL};
}

/* W/(m² sr) of a node's lobe towards w */
static double sent(const es_point_lobe* lobes, size_t node, es_vec3 w)
{
    const vf to[3] = {vf_set1(w.x), vf_set1(w.y), vf_set1(w.z)};
    vf light[3] = {vf_zero(), vf_zero(), vf_zero()};
    es_node_lobe_add_v(lobes, vi_set1((int32_t)node), to, light);
    return (double)light[0][0];
}

/* ---- a leaf ------------------------------------------------------------------------------------------------------------------------- */

/* Energy: what the lobe sends is what it would if it were spread. Shape: root mean square difference of the power's distribution from the model's over
 * that of the model. The bounds are what is found, rounded up: GGX is exact along the normal, and at grazing angles narrower across the plane of incidence than
 * one width can be. */
static void test_leaf(void** state)
{
    (void)state;
    static const struct { exact_surface s; double bound[3]; } cases[] = {
        {{ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 51 / 255.0, 1}, {0.02, 0.12, 0.33}}, {{ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 76 / 255.0, 1}, {0.02, 0.12, 0.33}},
        {{ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 128 / 255.0, 1}, {0.03, 0.12, 0.3}}, {{ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, 204 / 255.0, 1}, {0.12, 0.2, 0.3}},
        {{ES_SURFACE_PHONG, 0, 0, 5, 1}, {0.1, 0.1, 0.12}}, {{ES_SURFACE_PHONG, 0, 0, 20, 1}, {0.07, 0.07, 0.08}}, {{ES_SURFACE_PHONG, 0, 0, 50, 1}, {0.06, 0.06, 0.06}}};
    enum { COSINES = 3, SURFACES = sizeof cases / sizeof cases[0], RINGS = 120, SECTORS = 48 };
    static const float cosines[COSINES] = {0.999f, 0.8f, 0.5f};
    lit_world l = {.w = small_world_create()};
    const es_material_desc grey = lambert(0.5f, 0);
    add_rectangle(&l.w, es_v3(-2, 0, 2), es_v3(4, 0, 0), es_v3(0, 0, -4), &grey);
    for (int c = 0; c < COSINES; c++) {
        es_light_desc d = es_default_light_desc();
        d.type = ES_LIGHT_DIRECTIONAL;
        d.intensity = 2;
        add_light(&l.w, d, es_v3(0, 1, 0), es_v3(es_sqrt(1 - cosines[c] * cosines[c]), -cosines[c], 0));
    }
    draw_shadows(&l, 64);
    /* four of each: neighbours widen each other by what they differ */
    es_point_forest f = hand_forest(&(uint32_t){32}, 1);
    f.trees[0].glossy = true;
    for (uint32_t i = 0, k = 0; i < SURFACES; i += ++k % 4 == 0)
        set_leaf(&f, k, es_v3(0.1f * (float)i, 0, 0), es_v3(0, 1, 0), cases[i].s.model, (float)cases[i].s.base, (float)cases[i].s.metallic, (float)cases[i].s.roughness, (float)cases[i].s.specular);
    for (int c = 0; c < COSINES; c++) {
        double power[SURFACES];
        es_point_light_job job = job_of(&l, false);
        job.views += c;
        job.view_count = 1;
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        assert_null(f.lobes);
        for (uint32_t i = 0; i < SURFACES; i++) power[i] = (double)leaf_radiance(&f, 4 * i, 0) * pi;
        job.shapes = &shapes;
        assert_int_equal(es_points_light_direct(l.w.context, &f, &job), ES_OK);
        assert_non_null(f.lobes);
        for (uint32_t i = 0; i < SURFACES; i++) {
            assert_true(leaf_radiance(&f, 4 * i, 0) == 0); /* nothing of these is spread */
            const double cosine = (double)cosines[c], sine = sqrt(1 - cosine * cosine), wi[3] = {-sine, 0, cosine};
            double energy = 0, model = 0, found_square = 0, model_square = 0, both = 0, ring = 0, next = 1e-3;
            for (int r = 0; r < RINGS; r++, ring = next, next = 1e-3 * pow(pi / 1e-3, r / (double)(RINGS - 1)))
                for (int k = 0; k < SECTORS; k++) {
                    const double theta = 0.5 * (ring + next), phi = 2 * pi * (k + 0.5) / SECTORS, x = sin(theta) * cos(phi), y = sin(theta) * sin(phi), z = cos(theta);
                    const double o[3] = {x * cosine + z * sine, y, z * cosine - x * sine}, area = (cos(ring) - cos(next)) * 2 * pi / SECTORS;
                    if (!(o[2] > 0)) continue;
                    const double p = sent(f.lobes, f.trees[0].leaf_count + 4 * i, es_v3((float)o[0], (float)o[2], (float)-o[1])) * o[2], q = exact_brdf(&cases[i].s, wi, o) * o[2];
                    energy += p * area;
                    model += q * area;
                    found_square += p * p * area;
                    model_square += q * q * area;
                    both += p * q * area;
                }
            const double square = found_square / (energy * energy) - 2 * both / (energy * model) + model_square / (model * model), error = sqrt(fmax(square, 0) / (model_square / (model * model)));
            printf("surface %u, cosine %.2f: energy %.4f, shape %.3f\n", i, cosine, energy / power[i], error);
            if (!(fabs(energy / power[i] - 1) < 0.01)) fail_msg("surface %u, cosine %.2f: sends %.4f of what it should", i, cosine, energy / power[i]);
            if (!(error < cases[i].bound[c])) fail_msg("surface %u, cosine %.2f: %.3f from the model's shape", i, cosine, error);
        }
    }
    es_forest_drop_lobes(l.w.context, &f);
    hand_forest_free(&f);
    lit_world_destroy(&l);
}

/* ---- a bent strip -------------------------------------------------------------------------------------------------------------------- */

typedef struct strip { lit_world l; es_point_forest forest; exact_surface surface; es_vec3 lamp; } strip;
enum { INTENSITY = 5 };

/* A gutter of metal about the z axis, half a metre in radius, open towards +y, lit by a lamp from above. */
static strip bent_strip(uint32_t points, float roughness)
{
    enum { COLUMNS = 48 };
    strip s = {.l = {.w = small_world_create()}, .surface = {ES_SURFACE_METALLIC_ROUGHNESS, 1, 1, (double)(float)es_pack_unorm8(roughness) / 255, 1}, .lamp = es_v3(0.15f, 1.2f, 0.1f)};
    es_vec3 positions[2 * (COLUMNS + 1)], normals[2 * (COLUMNS + 1)];
    uint32_t indices[6 * COLUMNS];
    for (uint32_t i = 0; i <= COLUMNS; i++) {
        const float a = 1.6f * ((float)i / COLUMNS - 0.5f), x = es_sin(a), y = es_cos(a);
        for (uint32_t k = 0; k < 2; k++) {
            positions[2 * i + k] = es_v3(0.5f * x, -0.5f * y, k ? 0.25f : -0.25f);
            normals[2 * i + k] = es_v3(-x, y, 0);
        }
        const uint32_t quad[6] = {2 * i, 2 * i + 1, 2 * i + 3, 2 * i, 2 * i + 3, 2 * i + 2};
        if (i < COLUMNS) memcpy(indices + 6 * i, quad, sizeof quad);
    }
    es_material_desc metal = es_default_material_desc();
    metal.metallic = 1;
    metal.roughness = roughness;
    for (int k = 0; k < 3; k++) metal.base_color[k] = 1;
    add_instance(&s.l.w, &(es_mesh_desc){.vertex_count = 2 * (COLUMNS + 1), .triangle_count = 2 * COLUMNS, .positions = &positions[0].x, .normals = &normals[0].x, .indices = indices}, &metal);
    es_light_desc d = es_default_light_desc();
    d.type = ES_LIGHT_POINT;
    d.intensity = INTENSITY;
    add_light(&s.l.w, d, s.lamp, es_v3(0, -1, 0));
    draw_shadows(&s.l, 512);
    const es_forest_request request = {.points = points, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(s.l.w.context, &s.forest, es_world_draw_list(s.l.w.world), es_world_get_revisions(s.l.w.world).materials, &request, &update), ES_OK);
    assert_int_equal(s.forest.tree_count, 1);
    assert_true(s.forest.trees[0].glossy && !s.forest.lobes);
    return s;
}

static void light_strip(strip* s, bool apart)
{
    const es_point_light_job job = job_of(&s->l, apart);
    assert_int_equal(es_points_light_direct(s->l.w.context, &s->forest, &job), ES_OK);
    assert_true((s->forest.lobes != NULL) == apart);
    es_forest_pull(s->l.w.context, &s->forest);
}

static void close_strip(strip* s)
{
    es_forest_free(s->l.w.context, &s->forest);
    lit_world_destroy(&s->l);
}

/* Of every inner node, in many directions: what its leaves send together, each with its own lobe, over the area that they show. */
static void test_nodes(void** state)
{
    (void)state;
    enum { LEAVES = 1024, DIRECTIONS = 64 };
    strip s = bent_strip(LEAVES, 0.3f);
    light_strip(&s, true);
    const es_point_forest* f = &s.forest;
    const es_point_tree* tree = &f->trees[0];
    for (uint32_t level = LEAVES / 4; level >= 1; level /= 4) {
        double errors = 0, squares = 0, all = 0, expected_all = 0;
        for (uint32_t node = level; node < 2 * level; node++)
            for (uint32_t k = 0; k < DIRECTIONS; k++) {
                const double z = 1 - (k + 0.5) / DIRECTIONS, r = sqrt(1 - z * z), phi = k * 2.39996323;
                const es_vec3 w = es_v3((float)(r * cos(phi)), (float)z, (float)(r * sin(phi)));
                double sum = 0, shown = 0, area = 0;
                for (uint32_t i = node * (LEAVES / level); i < (node + 1) * (LEAVES / level); i++) {
                    const double a = (double)f->area[tree->first + i], c = fmax((double)es_v3_dot(es_unpack_normal(f->normal[tree->first_leaf + i - LEAVES]), w), 0);
                    sum += a * c * sent(f->lobes, tree->first + i, w);
                    shown += a * c;
                    area += a;
                }
                const double found = sent(f->lobes, tree->first + node, w) * shown / area, expected = sum / area;
                errors += (found - expected) * (found - expected);
                squares += expected * expected;
                all += found;
                expected_all += expected;
            }
        printf("%4u nodes: relative error %.3f, mean %.3f\n", level, sqrt(errors / squares), all / expected_all);
        /* the strip bends one way, by 92° of it, and a node's lobe is as wide all around: what is found, rounded up */
        const double bound = level == 256 ? 0.07 : level == 64 ? 0.22 : level == 16 ? 0.4 : level == 4 ? 0.65 : 0.8;
        if (!(sqrt(errors / squares) < bound) || !(fabs(all / expected_all - 1) < (level >= 16 ? 0.02 : 0.2))) fail_msg("%u nodes: relative error %.3f, mean %.3f", level, sqrt(errors / squares), all / expected_all);
    }
    close_strip(&s);
}

/* ---- a caustic ------------------------------------------------------------------------------------------------------------------------ */

enum { SIDE = 24, SCREEN = SIDE * SIDE };

/* A screen that looks down on the gutter. */
static void screen_points(es_gather_point points[SCREEN])
{
    for (uint32_t i = 0; i < SCREEN; i++)
        points[i] = (es_gather_point){.position = {-0.3f + 0.6f * (float)(i % SIDE) / (SIDE - 1), -0.15f, -0.4f + 0.8f * (float)(i / SIDE) / (SIDE - 1)}, .normal = {0, -1, 0}, .view = {0, -1, 0}, .kind = ES_GATHER_DIFFUSE, .seed = i};
}

static void gather_screen(es_context* context, const es_point_forest* f, const es_gather_point points[SCREEN], float* result)
{
    const es_micro_settings settings = {.size = 24, .cut = 1, .cover = 1, .ray_cast = true, .warp = true, .quantised = true};
    float* const planes[3] = {result, result + SCREEN, result + 2 * SCREEN};
    assert_int_equal(es_micro_gather(context, f, &settings, points, SCREEN, planes, NULL), ES_OK);
}

static double caustic_error(const float* found, const double* expected, double* mean)
{
    double errors = 0, sum = 0, all = 0;
    for (uint32_t i = 0; i < SCREEN; i++) {
        errors += ((double)found[i] - expected[i]) * ((double)found[i] - expected[i]);
        sum += expected[i];
        all += (double)found[i];
    }
    *mean = all / sum;
    return sqrt(errors / SCREEN) / (sum / SCREEN);
}

static void test_caustic(void** state)
{
    (void)state;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    enum { LEAVES = 4096 };
    const double most = 0.25; /* of fewer points */
#else
    enum { LEAVES = 16384 };
    const double most = 0.2;
#endif
    strip s = bent_strip(LEAVES, 0.3f);
    const es_point_forest* f = &s.forest;
    const es_point_tree* tree = &f->trees[0];
    static es_gather_point points[SCREEN];
    static double expected[SCREEN];
    static float found[3 * SCREEN], own[SCREEN];
    screen_points(points);
    light_strip(&s, true);
    memset(expected, 0, sizeof expected);
    for (uint32_t k = 0; k < LEAVES; k++) {
        const size_t leaf = tree->first_leaf + k;
        const es_vec3 p = es_v3(f->x[leaf], f->y[leaf], f->z[leaf]), n = es_unpack_normal(f->normal[leaf]), to = es_v3_sub(s.lamp, p);
        const es_surface surface = es_surface_of_gbuffer(f->albedo_rg[leaf], f->albedo_b[leaf], f->surface[leaf]);
        const float d2 = es_v3_dot(to, to);
        const es_vec3 i = es_v3_scale(to, 1 / es_sqrt(d2));
        const double e = INTENSITY * fmax((double)es_v3_dot(n, i), 0) / (double)d2, area = (double)f->area[tree->first + LEAVES + k];
        for (uint32_t at = 0; at < SCREEN; at++) {
            const es_vec3 way = es_v3_sub(es_v3(points[at].position[0], points[at].position[1], points[at].position[2]), p);
            const float far2 = es_v3_dot(way, way);
            const es_vec3 w = es_v3_scale(way, 1 / es_sqrt(far2));
            own[at] += (float)(sent(f->lobes, tree->first + LEAVES + k, w) * area * fmax((double)es_v3_dot(n, w), 0) * fmax((double)w.y, 0) / (double)far2);
            expected[at] += e * (double)es_surface_evaluate(&surface, n, i, w).x * area * fmax((double)es_v3_dot(n, w), 0) * fmax((double)w.y, 0) / (double)far2;
        }
    }
    double mean, peak = 0, sum = 0;
    for (uint32_t i = 0; i < SCREEN; i++) {
        peak = fmax(peak, expected[i]);
        sum += expected[i] / SCREEN;
    }
    printf("caustic: peak %.2f of the mean\n", peak / sum);
    assert_true(peak > 2 * sum); /* there is a caustic to be found */
    const double by_lobes = caustic_error(own, expected, &mean);
    printf("caustic: sum of lobes: relative error %.3f, mean %.3f\n", by_lobes, mean);
    gather_screen(s.l.w.context, f, points, found);
    const double apart = caustic_error(found, expected, &mean);
    printf("caustic: relative error %.3f, mean %.3f\n", apart, mean);
    if (!(by_lobes < 0.03)) fail_msg("the leaves' own lobes: relative error %.3f", by_lobes);
    /* that the gutter is a little wider than it is, as pictures of points have it, is in the mean */
    if (!(apart < most && fabs(mean - 1) < 0.15)) fail_msg("caustic: relative error %.3f, mean %.3f", apart, mean);
    light_strip(&s, false);
    gather_screen(s.l.w.context, f, points, found);
    const double spread = caustic_error(found, expected, &mean);
    printf("spread: relative error %.3f, mean %.3f\n", spread, mean);
    assert_true(spread > 3 * apart); /* lobes make the difference */
    close_strip(&s);
}

/* ---- the same bits ------------------------------------------------------------------------------------------------------------------- */

static void test_same_bits(void** state)
{
    (void)state;
    strip s = bent_strip(2048, 0.2f);
    es_point_forest* f = &s.forest;
    static es_gather_point points[SCREEN];
    static float found[3 * SCREEN];
    const es_point_light_job job = job_of(&s.l, true);
    screen_points(points);
    same_bits same = {.most_threads = 2};
    for (es_context* context; (context = next_context(&same));) {
        assert_int_equal(es_points_light_direct(context, f, &job), ES_OK);
        es_forest_pull(context, f);
        gather_screen(context, f, points, found);
        expect_same_bits(&same, f->lobes, f->node_count * sizeof *f->lobes);
        expect_same_bits(&same, found, sizeof found);
        es_forest_drop_lobes(context, f);
        es_context_destroy(context);
    }
    close_strip(&s);
}

/* ---- little --------------------------------------------------------------------------------------------------------------------------- */

/* No lobes where nothing is glossy, and none where nothing is lit; too little memory for them is an error, and leaves none. Light that comes and goes leaves what was. */
static void test_little(void** state)
{
    (void)state;
    strip s = bent_strip(2048, 0.2f);
    es_point_forest* f = &s.forest;
    es_context* context = s.l.w.context;
    es_point_light_job job = job_of(&s.l, true);
    job.view_count = 0;
    assert_int_equal(es_points_light_direct(context, f, &job), ES_OK);
    assert_null(f->lobes);
    light_strip(&s, true);
    assert_int_equal(es_points_light_direct(context, f, &job), ES_OK);
    assert_null(f->lobes);
    f->trees[0].glossy = false;
    job = job_of(&s.l, true);
    assert_int_equal(es_points_light_direct(context, f, &job), ES_OK);
    assert_null(f->lobes);
    f->trees[0].glossy = true;

    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    desc.memory_cap = 16 << 10;
    es_context* poor;
    assert_int_equal(es_context_create(&desc, &poor), ES_OK);
    assert_int_equal(es_points_light_direct(poor, f, &job), ES_MEMORY_CAP);
    assert_null(f->lobes);
    es_context_destroy(poor);

    /* the scene changes its mind: all gone and there again */
    light_strip(&s, true);
    const es_forest_request request = {.points = 512, .rebuild = 1.5f};
    es_forest_update update;
    assert_int_equal(es_forest_bring(context, f, es_world_draw_list(s.l.w.world), es_world_get_revisions(s.l.w.world).materials, &request, &update), ES_OK);
    assert_null(f->lobes);
    light_strip(&s, true);
    /* the whole sends what is its leaves' by area, and the tree of trees what its only tree does */
    double sum = 0, area = 0;
    const es_point_tree* tree = &f->trees[0];
    for (size_t i = tree->first + tree->leaf_count; i < tree->first + 2 * tree->leaf_count; i++) {
        sum += (double)es_unpack_rgb9e5(f->lobes[i].light).y * (double)f->area[i];
        area += (double)f->area[i];
    }
    const double root = (double)es_unpack_rgb9e5(f->lobes[tree->first + 1].light).y;
    assert_true(fabs(root - sum / area) < 0.01 * root && root > 0);
    assert_memory_equal(&f->lobes[tree->first + 1], &f->lobes[f->top.first + 1], sizeof *f->lobes);
    close_strip(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_leaf), cmocka_unit_test(test_nodes), cmocka_unit_test(test_caustic), cmocka_unit_test(test_same_bits), cmocka_unit_test(test_little)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
