/* What the light floor's kernels compute: imperfect shadow maps, interleaved shading, the geometry-aware filter, the surface model. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/filter.h"
#include "gi/ism.h"
#include "gi/shade.h"
#include "gi/surface.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/kernel_table.h"
#include "raster/pack.h"
#include "raster/points.h"

static uint32_t counter;
static float uniform(float low, float high) { return low + (high - low) * es_random_float(31, counter++); }

static es_context* context;
static es_arena arena;

static int set_up(void** state)
{
    (void)state;
    es_context_desc desc = {.threads = 3};
    if (es_context_create(&desc, &context)) return -1;
    es_arena_init(&arena, context, 1 << 20);
    return 0;
}
static int tear_down(void** state)
{
    (void)state;
    es_arena_free(&arena);
    size_t left = es_context_bytes(context);
    es_context_destroy(context);
    return left == 0 ? 0 : -1;
}
static const es_raster_kernels* kernels(void) { return es_raster_kernels_of(es_context_isa(context)); }

/* ---- splat ------------------------------------------------------------------------------------------------------------- */

enum { SIZE = 64 };
static const es_parabolic_map upright = {.tangent = {1, 0, 0}, .bitangent = {0, 0, -1}, .normal = {0, 1, 0}, .far_distance = 10, .near_distance = 0.01f, .splat_width = 0, .size = SIZE};

static uint16_t* splat(const es_parabolic_map* map, const float (*p)[3], uint32_t count)
{
    static uint16_t work[SIZE * SIZE + 3 * SIZE + 16];
    float x[16] = {0}, y[16] = {0}, z[16] = {0};
    for (uint32_t i = 0; i < count; i++) {
        x[i] = p[i][0];
        y[i] = p[i][1];
        z[i] = p[i][2];
    }
    memset(work, 0xff, sizeof work);
    es_point_set points = {x, y, z, count};
    kernels()->splat_parabolic_map(map, &points, work);
    return work;
}
static uint32_t drawn(const uint16_t* work)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < SIZE * SIZE; i++) count += work[i] != ES_PARABOLIC_EMPTY;
    return count;
}

static void test_splat_place(void** state)
{
    (void)state;
    for (int trial = 0; trial < 500; trial++) {
        float p[1][3] = {{uniform(-3, 3), uniform(0.05f, 3), uniform(-3, 3)}};
        double r = sqrt((double)p[0][0] * p[0][0] + (double)p[0][1] * p[0][1] + (double)p[0][2] * p[0][2]);
        double u = (p[0][0] / (r + p[0][1]) * 0.5 + 0.5) * SIZE, v = (-p[0][2] / (r + p[0][1]) * 0.5 + 0.5) * SIZE;
        const uint16_t* work = splat(&upright, p, 1);
        assert_int_equal(drawn(work), 1);
        if (fabs(u - floor(u + 0.5)) < 1e-3 || fabs(v - floor(v + 0.5)) < 1e-3) continue; /* on a texel's border */
        uint16_t depth = work[(int)v * SIZE + (int)u];
        assert_true(fabs(depth - r / 10 * ES_PARABOLIC_DEPTH_MAX) < 0.6);
    }
}

static void test_splat_nearest_wins(void** state)
{
    (void)state;
    const float p[4][3] = {{0.3f, 3, 0.3f}, {0.1f, 1, 0.1f}, {0.2f, 2, 0.2f}, {0.4f, 4, 0.4f}};
    const uint16_t* work = splat(&upright, p, 4);
    assert_int_equal(drawn(work), 1);
    for (int i = 0; i < SIZE * SIZE; i++)
        if (work[i] != ES_PARABOLIC_EMPTY) assert_true(fabs(work[i] - sqrt(1.02) / 10 * ES_PARABOLIC_DEPTH_MAX) < 0.6);
}

static void test_splat_leaves_out(void** state)
{
    (void)state;
    const float p[8][3] = {{0, -1, 0}, {1, 0, 0}, {0, 0, 0}, {0, 0.005f, 0}, {0, 11, 0}, {NAN, 1, 0}, {0, INFINITY, 0}, {1e30f, 1e30f, 1e30f}};
    assert_int_equal(drawn(splat(&upright, p, 8)), 0);
}

/* a square of width w seen from distance d along the normal covers w / (2 d) · size / 2 texels per side */
static void test_splat_size(void** state)
{
    (void)state;
    for (uint32_t s = 1; s <= 4; s++) {
        es_parabolic_map map = upright;
        map.splat_width = (float)s * 4.0f / SIZE;
        const float p[1][3] = {{0, 1, 0}}, border[1][3] = {{2, 0.001f, 0}};
        assert_int_equal(drawn(splat(&map, p, 1)), s * s);
        assert_true(drawn(splat(&map, border, 1)) >= 1);
    }
    es_parabolic_map map = upright;
    map.splat_width = 100;
    const float p[1][3] = {{-5, 1e-4f, 5}};
    assert_int_equal(drawn(splat(&map, p, 1)), 16);
}

/* ---- pull-push --------------------------------------------------------------------------------------------------------------- */

static uint16_t work[SIZE * SIZE], filled[SIZE * SIZE];

static void fill(uint32_t levels, uint32_t pull, uint32_t push)
{
    uint16_t* scratch = malloc(es_pull_push_texels(SIZE) * 2);
    es_pull_push_parameters p = {SIZE, levels, pull, push};
    kernels()->pull_push(&p, work, scratch, filled);
    free(scratch);
}

static void test_pull_push_fills_holes(void** state)
{
    (void)state;
    for (int i = 0; i < SIZE * SIZE; i++) work[i] = uniform(0, 1) < 0.4f ? ES_PARABOLIC_EMPTY : (uint16_t)(20000 + i % SIZE * 10);
    fill(3, 1000, 1000);
    for (int i = 0; i < SIZE * SIZE; i++) {
        assert_true(filled[i] != ES_PARABOLIC_EMPTY);
        assert_true(abs(filled[i] - (20000 + i % SIZE * 10)) < 100);
        if (work[i] != ES_PARABOLIC_EMPTY) assert_int_equal(filled[i], work[i]);
    }
    /* nothing comes from nothing */
    memset(work, 0xff, sizeof work);
    fill(4, 3000, 3000);
    assert_memory_equal(work, filled, sizeof work);
}

static void test_pull_push_leaves_full_maps(void** state)
{
    (void)state;
    for (int i = 0; i < SIZE * SIZE; i++) work[i] = (uint16_t)(10000 + i % SIZE * 100 + i / SIZE * 50);
    fill(2, 2000, 2000);
    assert_memory_equal(work, filled, sizeof work);
}

static void test_pull_push_thresholds(void** state)
{
    (void)state;
    /* a far texel shining through a near surface is replaced when farther than the threshold, kept when not */
    for (int i = 0; i < SIZE * SIZE; i++) work[i] = 10000;
    work[10 * SIZE + 10] = 12500;
    fill(2, 500, 2000);
    assert_int_equal(filled[10 * SIZE + 10], 10000);
    fill(2, 500, 2600);
    assert_int_equal(filled[10 * SIZE + 10], 12500);
    /* a near texel before a far surface stays as it is */
    for (int i = 0; i < SIZE * SIZE; i++) work[i] = 30000;
    work[10 * SIZE + 10] = 10000;
    fill(2, 500, 16000);
    assert_int_equal(filled[10 * SIZE + 10], 10000);
    assert_int_equal(filled[10 * SIZE + 12], 30000);
    /* holes between two surfaces get one or the other, nothing in between */
    for (int i = 0; i < SIZE * SIZE; i++) work[i] = uniform(0, 1) < 0.5f ? ES_PARABOLIC_EMPTY : i % SIZE < 31 ? 10000 : 30000;
    fill(2, 1000, 16000);
    for (int i = 0; i < SIZE * SIZE; i++) assert_true(filled[i] == 10000 || filled[i] == 30000 || filled[i] == ES_PARABOLIC_EMPTY);
}

/* ---- imperfect shadow maps -------------------------------------------------------------------------------------------------- */

static es_vpl_record light_at(es_vec3 position, es_vec3 normal, float r, float g, float b)
{
    es_vpl_record v = {.position = {position.x, position.y, position.z}, .normal = {normal.x, normal.y, normal.z}, .flux = {r, g, b}};
    es_vec3 t, s;
    es_orthonormal_basis(normal, &t, &s);
    memcpy(v.tangent, &t, sizeof t);
    memcpy(v.bitangent, &s, sizeof s);
    memcpy(v.incident, &normal, sizeof normal);
    v.roughness = 1.0f;
    return v;
}

static void test_maps_of_a_ceiling(void** state)
{
    (void)state;
    enum { POINTS = 4000, SUBSETS = 3, LIGHTS = 8 };
    es_scene_points points = {.subset_size = POINTS, .subset_count = SUBSETS, .area = 16, .rank_count = 1, .rank_end = {POINTS}, .rank_width = {0.06324555f}};
    points.x = malloc(POINTS * SUBSETS * 4);
    points.y = malloc(POINTS * SUBSETS * 4);
    points.z = malloc(POINTS * SUBSETS * 4);
    for (int i = 0; i < POINTS * SUBSETS; i++) {
        points.x[i] = uniform(-2, 2);
        points.y[i] = 2;
        points.z[i] = uniform(-2, 2);
    }
    es_vpl_record lights[LIGHTS];
    for (int i = 0; i < LIGHTS; i++) lights[i] = light_at(es_v3(0.1f * (float)i, 0, 0), es_v3(0, 1, 0), 1, 1, 1);
    es_ism_job job = {.vpls = lights, .vpl_count = LIGHTS, .room = LIGHTS, .points = &points, .size = 128, .far_distance = 6, .near_distance = 0.02f, .pull_push = true, .pull_threshold = 0.05f, .push_threshold = 0.05f, .pull_push_levels = 2};
    es_ism_maps maps = {0};
    assert_int_equal(es_ism_maps_build(context, &maps, &job), ES_OK);
    assert_int_equal(maps.count, LIGHTS);
    for (int v = 0; v < LIGHTS; v++) {
        for (int y = 46; y < 82; y++) {
            for (int x = 46; x < 82; x++) {
                double a = (x + 0.5) / 64 - 1, b = (y + 0.5) / 64 - 1, c = (1 - a * a - b * b) / (1 + a * a + b * b);
                double found = maps.texels[(size_t)v * 16384 + (size_t)(y * 128 + x)] * 6.0 / ES_PARABOLIC_DEPTH_MAX;
                assert_true(fabs(found - 2 / c) < 0.2);
            }
        }
    }
    /* fewer lights use the same memory; no points, no shadows */
    uint16_t* texels = maps.texels;
    job.vpl_count = 2;
    job.points = &(es_scene_points){0};
    assert_int_equal(es_ism_maps_build(context, &maps, &job), ES_OK);
    assert_ptr_equal(maps.texels, texels);
    for (int i = 0; i < 2 * 128 * 128; i++) assert_int_equal(maps.texels[i], ES_PARABOLIC_EMPTY);
    job.vpl_count = 0;
    assert_int_equal(es_ism_maps_build(context, &maps, &job), ES_OK);
    es_ism_maps_free(context, &maps);
    free(points.x);
    free(points.y);
    free(points.z);
}

/* ---- shading ------------------------------------------------------------------------------------------------------------------ */

enum { WIDTH = 83, HEIGHT = 45, STRIDE = 88, PIXELS = STRIDE * HEIGHT };
static float depth[PIXELS];
static uint32_t normal[PIXELS], albedo_rg[PIXELS], albedo_b[PIXELS], surface[PIXELS];
static const es_gbuffer gbuffer = {.width = WIDTH, .height = HEIGHT, .stride = STRIDE, .depth = depth, .normal = normal, .albedo_rg = albedo_rg, .albedo_b = albedo_b, .surface = surface};
static float planes[4][3][PIXELS];

/* a bumpy floor seen from above, with a hole */
static void make_gbuffer(void)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < STRIDE; x++) {
            int i = y * STRIDE + x;
            depth[i] = 3.0f + 0.2f * (float)((x / 9 + y / 7) % 2) + 0.01f * uniform(0, 1);
            normal[i] = es_pack_normal(es_v3(uniform(-0.2f, 0.2f), uniform(-0.2f, 0.2f), 1));
            if (x > 20 && x < 30 && y > 20 && y < 30) depth[i] = 0, normal[i] = 0;
            albedo_rg[i] = 0x8000c000;
            albedo_b[i] = 0x4000;
            surface[i] = 0xff8000; /* dielectric of roughness 0.5 */
        }
    }
}
static const es_pixel_rays rays = {.dir = {-1, 0.6f, -1}, .dir_dx = {2.0f / WIDTH, 0, 0}, .dir_dy = {0, -1.2f / HEIGHT, 0}, .base = {0, 0, 3}};

static es_vec3 vec(const float v[3]) { return es_v3(v[0], v[1], v[2]); }

/* one pixel, in double but for the surface model; returns whether it lies too close to an edge of the visibility test to compare */
static bool expected_pixel(const es_shade_job* job, int x, int y, double e[3], double s[3])
{
    const int i = y * STRIDE + x;
    const uint32_t n = job->interleave;
    bool doubtful = false;
    for (int k = 0; k < 3; k++) e[k] = s[k] = 0;
    if (!(depth[i] > 0)) return false;
    es_vec3 p = es_pixel_rays_position(&rays, (float)x, (float)y, depth[i]), normal_ = es_unpack_normal(normal[i]);
    es_surface receiver = es_surface_of_gbuffer(albedo_rg[i], albedo_b[i], surface[i]);
    es_vec3 view = es_v3_normalize(es_v3_sub(vec(rays.base), p), normal_);
    for (uint32_t v = (uint32_t)x % n + n * ((uint32_t)y % n); v < job->vpl_count; v += n * n) {
        const es_vpl_record* l = &job->vpls[v];
        double d[3] = {(double)p.x - l->position[0], (double)p.y - l->position[1], (double)p.z - l->position[2]}, q[3] = {0}, c = 0, r2 = 0;
        const float nn[3] = {normal_.x, normal_.y, normal_.z};
        for (int k = 0; k < 3; k++) {
            q[0] += d[k] * l->tangent[k];
            q[1] += d[k] * l->bitangent[k];
            q[2] += d[k] * l->normal[k];
            c -= d[k] * nn[k];
            r2 += d[k] * d[k];
        }
        if (fabs(c) < 1e-5 || fabs(q[2]) < 1e-5) doubtful = true;
        if (!(q[2] > 0 && c > 0)) continue;
        double r = sqrt(r2), g = q[2] * c / (r2 * r2);
        if (g > job->geometry_bound) g = job->geometry_bound;
        if (job->maps) {
            double u = (q[0] / (r + q[2]) * 0.5 + 0.5) * job->map_size, w = (q[1] / (r + q[2]) * 0.5 + 0.5) * job->map_size;
            if (fabs(u - floor(u + 0.5)) < 1e-3 || fabs(w - floor(w + 0.5)) < 1e-3) doubtful = true;
            int tx = u < job->map_size ? (int)u : (int)job->map_size - 1, ty = w < job->map_size ? (int)w : (int)job->map_size - 1;
            double seen = job->maps[((size_t)v * job->map_size + (size_t)ty) * job->map_size + (size_t)tx] * (double)job->far_distance / ES_PARABOLIC_DEPTH_MAX + job->bias;
            if (fabs(r - seen) < 1e-3) doubtful = true;
            if (r > seen) continue;
        }
        es_vec3 w = es_v3((float)(d[0] / r), (float)(d[1] / r), (float)(d[2] / r));
        double sent[3];
        for (int k = 0; k < 3; k++) sent[k] = l->flux[k] / 3.14159265358979;
        if (l->glossy) {
            es_surface sender = {.specular = vec(l->specular_color), .roughness = l->roughness, .model = l->model};
            float pass;
            es_vec3 lobe;
            es_surface_parts(&sender, vec(l->normal), vec(l->incident), w, &pass, &lobe);
            const float f[3] = {lobe.x, lobe.y, lobe.z};
            for (int k = 0; k < 3; k++) sent[k] = sent[k] * pass + l->power[k] * f[k];
        }
        float pass = 1;
        es_vec3 lobe = {0};
        if (job->specular[0]) es_surface_parts(&receiver, normal_, es_v3_scale(w, -1), view, &pass, &lobe);
        const float f[3] = {lobe.x, lobe.y, lobe.z};
        for (int k = 0; k < 3; k++) {
            e[k] += sent[k] * g * pass * n * n;
            s[k] += sent[k] * g * f[k] * n * n;
        }
    }
    return doubtful;
}

static void test_shade(void** state)
{
    (void)state;
    enum { MAP = 16 };
    make_gbuffer();
    static const struct { uint32_t n, count; } cases[] = {{1, 5}, {1, 0}, {2, 3}, {3, 40}, {8, 100}, {16, 300}, {5, 1}};
    for (int trial = 0; trial < 7 * 4; trial++) {
        uint32_t n = cases[trial % 7].n, count = cases[trial % 7].count;
        bool shadowed = trial / 7 % 2, lobes = trial / 14 != 0;
        es_vpl_record* lights = calloc(count + 1, sizeof *lights);
        for (uint32_t v = 0; v < count; v++) {
            lights[v] = light_at(es_v3(uniform(-3, 3), uniform(-2, 2), uniform(0.2f, 3)), es_v3_normalize(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 0.2f)), es_v3(0, 0, -1)), uniform(0, 2), uniform(0, 2), uniform(0, 2));
            lights[v].glossy = lobes && v % 2;
            lights[v].model = v % 4 == 1 ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS;
            lights[v].roughness = v % 4 == 1 ? 20 : 0.4f;
            for (int k = 0; k < 3; k++) lights[v].power[k] = 1, lights[v].specular_color[k] = 0.5f;
        }
        uint16_t* maps = malloc(((size_t)count * MAP * MAP + 1) * 2);
        for (size_t i = 0; i < (size_t)count * MAP * MAP; i++) maps[i] = (uint16_t)uniform(0, 49151);
        es_shade_job job = {.gbuffer = &gbuffer, .rays = rays, .vpls = lights, .vpl_count = count, .maps = shadowed ? maps : NULL, .map_size = MAP, .far_distance = 8, .bias = 0.1f, .geometry_bound = 2, .interleave = n};
        for (int k = 0; k < 3; k++) {
            job.irradiance[k] = planes[0][k];
            job.specular[k] = lobes ? planes[1][k] : NULL;
        }
        memset(planes, 0xff, sizeof planes);
        es_arena_reset(&arena);
        assert_int_equal(es_shade(context, &arena, &job), ES_OK);
        int compared = 0;
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < WIDTH; x++) {
                double e[3], s[3];
                if (expected_pixel(&job, x, y, e, s)) continue;
                compared++;
                for (int k = 0; k < 3; k++) {
                    double found = planes[0][k][y * STRIDE + x];
                    if (!(fabs(found - e[k]) <= 2e-4 * e[k] + 1e-6)) fail_msg("n %u, %u lights, (%d, %d): expected %g, found %g", n, count, x, y, e[k], found);
                    if (!lobes) continue;
                    found = planes[1][k][y * STRIDE + x];
                    if (!(fabs(found - s[k]) <= 2e-3 * s[k] + 1e-6)) fail_msg("n %u, %u lights, (%d, %d): expected lobe %g, found %g", n, count, x, y, s[k], found);
                }
            }
        }
        assert_true(compared > WIDTH * HEIGHT / 3);
        free(lights);
        free(maps);
    }
}

/* Equal lights: each pixel of a phase sees its share; the mean over n × n neighbours on a flat surface is what all lights give. */
static void test_interleaved_and_filtered_is_whole(void** state)
{
    (void)state;
    for (int i = 0; i < PIXELS; i++) {
        depth[i] = 3;
        normal[i] = es_pack_normal(es_v3(0, 0, 1));
    }
    for (uint32_t n = 2; n <= 16; n++) {
        uint32_t count = n * n + n; /* not a multiple: some phases have two lights, most one */
        es_vpl_record* lights = malloc(count * sizeof *lights);
        for (uint32_t v = 0; v < count; v++) lights[v] = light_at(es_v3(0, 0, 1e4f), es_v3(0, 0, -1), 1e8f, 2e8f, 3e8f); /* far away: even light */
        es_shade_job job = {.gbuffer = &gbuffer, .rays = rays, .vpls = lights, .vpl_count = count, .geometry_bound = 1, .interleave = n};
        es_filter_job filter = {.gbuffer = &gbuffer, .size = n, .passes = 1, .depth_threshold = 0.01f, .normal_threshold = 0.8f, .plane_count = 3};
        for (int k = 0; k < 3; k++) {
            job.irradiance[k] = planes[0][k];
            filter.source[k] = planes[0][k];
            filter.result[k] = planes[1][k];
        }
        es_arena_reset(&arena);
        assert_int_equal(es_shade(context, &arena, &job), ES_OK);
        assert_int_equal(es_filter_geometry_aware(context, &arena, &filter), ES_OK);
        job.interleave = 1;
        for (int k = 0; k < 3; k++) job.irradiance[k] = planes[2][k];
        assert_int_equal(es_shade(context, &arena, &job), ES_OK);
        for (int k = 0; k < 3; k++)
            for (int y = 0; y < HEIGHT; y++)
                for (int x = 0; x < WIDTH; x++) {
                    double a = planes[1][k][y * STRIDE + x], b = planes[2][k][y * STRIDE + x];
                    if (!(b > 0 && fabs(a - b) < 1e-4 * b)) fail_msg("n %u at (%d, %d): filtered %g, whole %g", n, x, y, a, b);
                }
        free(lights);
    }
}

/* ---- filter ------------------------------------------------------------------------------------------------------------------ */

static void filter_planes(uint32_t n, uint32_t width, uint32_t height)
{
    es_gbuffer g = gbuffer;
    g.width = width;
    g.height = height;
    es_filter_job job = {.gbuffer = &g, .size = n, .passes = 1, .depth_threshold = 0.01f, .normal_threshold = 0.8f, .plane_count = 3};
    for (int k = 0; k < 3; k++) {
        job.source[k] = planes[0][k];
        job.result[k] = planes[1][k];
    }
    es_arena_reset(&arena);
    assert_int_equal(es_filter_geometry_aware(context, &arena, &job), ES_OK);
}

static void test_filter_keeps_constants(void** state)
{
    (void)state;
    make_gbuffer();
    for (int i = 0; i < PIXELS; i++) planes[0][0][i] = planes[0][1][i] = planes[0][2][i] = 2;
    for (uint32_t n = 1; n <= 16; n++) {
        filter_planes(n, WIDTH - n, HEIGHT - n);
        for (uint32_t y = 0; y < HEIGHT - n; y++)
            for (uint32_t x = 0; x < WIDTH - n; x++) assert_true(fabsf(planes[1][0][y * STRIDE + x] - 2) < 1e-6f);
    }
    for (int i = 0; i < PIXELS; i++) planes[0][0][i] = uniform(0, 1);
    filter_planes(1, WIDTH, HEIGHT);
    for (int y = 0; y < HEIGHT; y++) assert_memory_equal(&planes[0][0][y * STRIDE], &planes[1][0][y * STRIDE], WIDTH * sizeof(float));
}

static void test_filter_stops_at_edges(void** state)
{
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        for (int y = 0; y < HEIGHT; y++) {
            for (int x = 0; x < STRIDE; x++) {
                bool side = x + 2 * y > 90;
                depth[y * STRIDE + x] = kind == 0 && side ? 3.1f : 3.0f;
                normal[y * STRIDE + x] = es_pack_normal(kind == 1 && side ? es_v3(1, 0, 0.5f) : es_v3(0, 0, 1));
                for (int k = 0; k < 3; k++) planes[0][k][y * STRIDE + x] = side ? 1000.0f : 1.0f;
            }
        }
        for (uint32_t n = 1; n <= 16; n++) {
            filter_planes(n, WIDTH, HEIGHT);
            for (int y = 0; y < HEIGHT; y++)
                for (int x = 0; x < WIDTH; x++) assert_true(fabsf(planes[1][1][y * STRIDE + x] / planes[0][1][y * STRIDE + x] - 1) < 1e-6f);
        }
    }
}

/* A 1 in one phase and 0 in the others gives 1 / n² everywhere, at the borders and in images smaller than the window alike. */
static void test_filter_counts_each_phase_once(void** state)
{
    (void)state;
    for (int i = 0; i < PIXELS; i++) {
        depth[i] = 3;
        normal[i] = es_pack_normal(es_v3(0, 0, 1));
    }
    for (uint32_t n = 1; n <= 16; n++) {
        for (int trial = 0; trial < 4; trial++) {
            uint32_t px = (uint32_t)uniform(0, (float)n), py = (uint32_t)uniform(0, (float)n);
            for (uint32_t y = 0; y < HEIGHT; y++)
                for (uint32_t x = 0; x < STRIDE; x++)
                    for (int k = 0; k < 3; k++) planes[0][k][y * STRIDE + x] = x % n == px && y % n == py;
            uint32_t width = n + (uint32_t)trial * 11, height = n + (uint32_t)trial * 7;
            filter_planes(n, width, height);
            for (uint32_t y = 0; y < height; y++)
                for (uint32_t x = 0; x < width; x++) assert_true(fabsf(planes[1][2][y * STRIDE + x] * (float)(n * n) - 1) < 1e-5f);
        }
    }
    filter_planes(16, 3, 2);
    for (int y = 0; y < 2; y++)
        for (int x = 0; x < 3; x++) assert_true(isfinite(planes[1][0][y * STRIDE + x]));
}

/* ---- surface model -------------------------------------------------------------------------------------------------------- */

static es_vec3 direction(double cosine, double phi)
{
    double s = sqrt(fmax(0, 1 - cosine * cosine));
    return es_v3((float)(s * cos(phi)), (float)(s * sin(phi)), (float)cosine);
}

static void test_surface_reciprocity(void** state)
{
    (void)state;
    for (int i = 0; i < 2000; i++) {
        uint32_t model = i % 2 ? ES_SURFACE_PHONG : ES_SURFACE_METALLIC_ROUGHNESS;
        es_surface s = es_surface_of(model, es_v3(uniform(0, 1), uniform(0, 1), uniform(0, 1)), uniform(0, 1), model == ES_SURFACE_PHONG ? uniform(1, 50) : uniform(0, 1), uniform(0, 1));
        es_vec3 a = direction(uniform(0.01f, 1), uniform(0, 6.2831f)), b = direction(uniform(0.01f, 1), uniform(0, 6.2831f)), n = es_v3(0, 0, 1);
        es_vec3 f = es_surface_evaluate(&s, n, a, b), g = es_surface_evaluate(&s, n, b, a);
        assert_true(fabsf(f.x - g.x) <= 1e-5f * f.x && fabsf(f.y - g.y) <= 1e-5f * f.y && fabsf(f.z - g.z) <= 1e-5f * f.z);
        assert_true(f.x >= 0 && f.y >= 0 && f.z >= 0);
        f = es_surface_evaluate(&s, n, a, es_v3(b.x, b.y, -b.z));
        assert_true(f.x == 0 && f.y == 0 && f.z == 0);
    }
}

/* share of light from wo that is sent back, by the midpoint rule: over the hemisphere for the diffuse part and over half vectors, where
 * narrow lobes are smooth, for the rest; wi = 2 (wo·h) h - wo, dwi = 4 (wo·h) dh */
static double reflectance(const es_surface* s, double cosine)
{
    enum { N = 256, M = 128 };
    es_vec3 n = es_v3(0, 0, 1), wo = direction(cosine, 0);
    double sum = 0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < M; j++) {
            double phi = (j + 0.5) / M * 2 * 3.14159265358979;
            float pass;
            es_vec3 lobe;
            double c = (i + 0.5) / N;
            es_surface_parts(s, n, direction(c, phi), wo, &pass, &lobe);
            sum += s->albedo.x * pass / 3.14159265358979 * c * (2 * 3.14159265358979 / (N * M));
            if (s->model == ES_SURFACE_PHONG) {
                sum += lobe.x * c * (2 * 3.14159265358979 / (N * M));
                continue;
            }
            /* t = tan theta_h is drawn so that tan² = alpha² u / (1 - u): uniform under GGX */
            double u = (i + 0.5) / N, a = fmax((double)s->roughness * s->roughness, sqrt((double)ES_SURFACE_MIN_ALPHA2)), t2 = a * a * u / (1 - u), ch = 1 / sqrt(1 + t2);
            es_vec3 h = direction(ch, phi);
            double oh = (double)es_v3_dot(wo, h);
            if (oh <= 0) continue;
            es_vec3 wi = es_v3_sub(es_v3_scale(h, (float)(2 * oh)), wo);
            if (wi.z <= 0) continue;
            wi = es_v3_normalize(wi, n);
            double q = ch * ch * (a * a - 1) + 1, density = a * a * ch / (3.14159265358979 * q * q); /* of h */
            es_surface_parts(s, n, wi, wo, &pass, &lobe);
            sum += lobe.x * wi.z * 4 * oh / density / (N * M);
        }
    }
    return sum;
}

static void test_surface_energy(void** state)
{
    (void)state;
    static const double cosines[] = {1, 0.8, 0.5, 0.25, 0.1, 0.03};
    for (int c = 0; c < 6; c++) {
        for (float roughness = 0.1f; roughness < 1.05f; roughness += 0.15f) {
            for (int m = 0; m <= 4; m++) {
                es_surface s = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(1, 1, 1), (float)m / 4, roughness, 1);
                double r = reflectance(&s, cosines[c]);
                if (!(r <= 1.005 && r > 0.1)) fail_msg("roughness %g, metallic %g, cos %g: %g", (double)roughness, m / 4.0, cosines[c], r);
            }
        }
        /* smooth metal: nothing is lost */
        es_surface mirror = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(1, 1, 1), 1, 0.1f, 1);
        if (cosines[c] > 0.2) assert_true(fabs(reflectance(&mirror, cosines[c]) - 1) < 0.02);
        for (int e = 1; e <= 50; e += 7) {
            es_surface phong = es_surface_of(ES_SURFACE_PHONG, es_v3(0, 0, 0), 0, (float)e, 1);
            double r = reflectance(&phong, cosines[c]);
            assert_true(r <= 1.01 && r > 0);
            if (c == 0) assert_true(fabs(r - 1) < 0.01);
        }
    }
}

static void test_surface_lambert(void** state)
{
    (void)state;
    es_surface white = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(1, 1, 1), 0, 0.3f, 0);
    assert_true(fabs(reflectance(&white, 0.3) - 1) < 1e-5);
    es_vec3 f = es_surface_evaluate(&white, es_v3(0, 0, 1), direction(0.2, 1), direction(0.9, 2));
    assert_true(fabsf(f.x - 0.318309886f) < 1e-7f && f.x == f.y && f.x == f.z);
    es_surface unlit = es_surface_of(ES_SURFACE_UNLIT, es_v3(1, 1, 1), 0, 0.3f, 1);
    f = es_surface_evaluate(&unlit, es_v3(0, 0, 1), direction(0.2, 1), direction(0.9, 2));
    assert_true(f.x == 0);
    /* F90 of a dielectric is its specular weight */
    es_surface half = es_surface_of(ES_SURFACE_METALLIC_ROUGHNESS, es_v3(0, 0, 0), 0, 0.3f, 0.5f);
    assert_true(fabsf(half.specular.x - 0.02f) < 1e-7f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_splat_place),
        cmocka_unit_test(test_splat_nearest_wins),
        cmocka_unit_test(test_splat_leaves_out),
        cmocka_unit_test(test_splat_size),
        cmocka_unit_test(test_pull_push_fills_holes),
        cmocka_unit_test(test_pull_push_leaves_full_maps),
        cmocka_unit_test(test_pull_push_thresholds),
        cmocka_unit_test(test_maps_of_a_ceiling),
        cmocka_unit_test(test_shade),
        cmocka_unit_test(test_interleaved_and_filtered_is_whole),
        cmocka_unit_test(test_filter_keeps_constants),
        cmocka_unit_test(test_filter_stops_at_edges),
        cmocka_unit_test(test_filter_counts_each_phase_once),
        cmocka_unit_test(test_surface_reciprocity),
        cmocka_unit_test(test_surface_energy),
        cmocka_unit_test(test_surface_lambert),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
