/* Interleaved shading, the geometry-aware filter and the ways up from lower resolutions: every instruction set against scalar, bit for bit, on random G-buffers of odd
 * sizes with extreme values, with guards round what is written.
 *
 * check_gi --time prints milliseconds for 1024 x 768 pixels and 1024 lights of every kernel and instruction set instead. */
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
#include "gi/half_resolution.h"
#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "gi/micro/upsample.h"
#include "gi/shade.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "tests/guarded_planes.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(29, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

/* the pixels, not the padding of the rows; any two NaNs are equal */
static void check_equal(const es_gbuffer* g, plane a, plane b, const char* what)
{
    for (uint32_t y = 0; y < g->height; y++) {
        for (uint32_t x = 0; x < g->width; x++) {
            float p = at(a)[(size_t)y * g->stride + x], q = at(b)[(size_t)y * g->stride + x];
            if (memcmp(&p, &q, 4) && !(p != p && q != q)) fail_msg("%s at (%u, %u): scalar %.9g, here %.9g", what, x, y, (double)p, (double)q);
        }
    }
}

static es_gbuffer new_gbuffer(uint32_t width, uint32_t height)
{
    es_gbuffer g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8};
    size_t count = (size_t)g.stride * height;
    g.depth = malloc(count * 4);
    g.normal = malloc(count * 4);
    g.albedo_rg = malloc(count * 4);
    g.albedo_b = malloc(count * 4);
    g.surface = malloc(count * 4);
    for (size_t i = 0; i < count; i++) {
        uint32_t r = random_bits();
        g.depth[i] = r % 16 == 0 ? 0.0f : r % 16 == 1 ? uniform(0.1f, 1e6f) : 1.0f + 0.01f * (float)(r / 16 % 16);
        es_vec3 n = r % 3 ? es_v3(0.1f * uniform(-1, 1), 1, 0.1f * uniform(-1, 1)) : es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
        g.normal[i] = g.depth[i] > 0.0f ? r % 32 == 2 ? random_bits() : es_pack_normal(n) : 0;
        g.albedo_rg[i] = random_bits();
        g.albedo_b[i] = random_bits();
        g.surface[i] = (random_bits() & 0xffffffu) | random_bits() % 3 << 24;
    }
    return g;
}
static void free_gbuffer(es_gbuffer* g)
{
    free(g->depth);
    free(g->normal);
    free(g->albedo_rg);
    free(g->albedo_b);
    free(g->surface);
}

static es_shade_light random_light(bool glossy)
{
    es_shade_light light = {.roughness = uniform(0, 1), .model = random_bits() % 2, .glossy = glossy && random_bits() % 2};
    if (light.model == ES_SURFACE_PHONG) light.roughness = uniform(1, 50);
    es_vec3 n = es_v3_normalize(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), es_v3(0, 1, 0)), t, b;
    es_orthonormal_basis(n, &t, &b);
    es_vec3 i = es_v3_normalize(es_v3_add(n, es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1))), n);
    memcpy(light.normal, &n, sizeof n);
    memcpy(light.tangent, &t, sizeof t);
    memcpy(light.bitangent, &b, sizeof b);
    memcpy(light.incident, &i, sizeof i);
    for (int k = 0; k < 3; k++) {
        light.position[k] = uniform(-2, 2);
        light.color[k] = uniform(0, 10);
        light.power[k] = uniform(0, 10);
        light.specular_color[k] = uniform(0, 1);
    }
    if (random_bits() % 16 == 0) light.position[random_bits() % 3] = 1e15f;
    if (random_bits() % 4 == 0) light.glossy = !(light.parallel = true);
    return light;
}

static es_pixel_rays random_rays(bool orthographic, uint32_t width, uint32_t height)
{
    es_pixel_rays rays = {.base = {uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}, .orthographic = orthographic};
    rays.dir[2] = -1.0f;
    float* dx = orthographic ? rays.base_dx : rays.dir_dx;
    float* dy = orthographic ? rays.base_dy : rays.dir_dy;
    (orthographic ? rays.base : rays.dir)[0] -= 1.0f;
    (orthographic ? rays.base : rays.dir)[1] += 1.0f;
    dx[0] = 2.0f / (float)width;
    dy[1] = -2.0f / (float)height;
    return rays;
}

static void run_shade(const es_gi_kernels* kernels, const es_shade_job* job, const es_shade_light* lights, es_shade_batch* batch)
{
    const uint32_t n = job->interleave, rows = ES_SHADE_LANES / ES_SHADE_COLUMNS;
    for (uint32_t row = 0; row < (job->gbuffer->height + n - 1) / n; row += rows)
        for (uint32_t column = 0; column < (job->gbuffer->width + n - 1) / n; column += ES_SHADE_COLUMNS)
            for (uint32_t phase_y = 0; phase_y < n; phase_y++) {
                es_shade_block block = {phase_y, column, row, rows};
                kernels->shade(job, lights, &block, batch);
            }
}

static void check_shade(void** state)
{
    (void)state;
    es_shade_batch* batch = malloc(sizeof *batch);
    for (uint32_t trial = 0; trial < 60; trial++) {
        uint32_t width = trial % 5 ? 1 + random_bits() % 90 : 1 + random_bits() % 400, height = 1 + random_bits() % 50, count = random_bits() % 60, size = trial % 2 ? 32 : 57;
        bool lobes = trial % 3 == 0, shadowed = trial % 4 != 3;
        es_gbuffer g = new_gbuffer(width, height);
        es_shade_light* lights = malloc((count + 1) * sizeof *lights);
        for (uint32_t v = 0; v < count; v++) lights[v] = random_light(trial % 2);
        uint16_t* maps = malloc((size_t)count * size * size * 2 + 2);
        for (size_t i = 0; i < (size_t)count * size * size; i++) maps[i] = random_bits() % 4 ? (uint16_t)(random_bits() % 49152) : 65535;
        uint32_t* map_of = malloc((count + 1) * sizeof *map_of);
        for (uint32_t v = 0; v < count; v++) map_of[v] = random_bits() % count;
        es_shade_job job = {.gbuffer = &g, .rays = random_rays(trial % 5 == 1, width, height), .vpl_count = count, .maps = shadowed ? maps : NULL, .map_of = trial % 7 ? NULL : map_of, .map_size = size,
            .far_distance = 6, .bias = 0.05f, .geometry_bound = uniform(0.1f, 50), .interleave = 1 + trial % 16};
        static es_lobe_albedo table;
        for (uint32_t i = 0; i < sizeof table.low / sizeof *table.low; i++) table.low[i] = uniform(0, 1), table.high[i] = uniform(0, 1), table.phong[i] = uniform(0, 1);
        job.wide = trial % 6 < 3 ? &table : NULL;
        plane expected[6], result[6];
        for (int k = 0; k < 6; k++) {
            expected[k] = new_plane((size_t)g.stride * height);
            result[k] = new_plane((size_t)g.stride * height);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 3; k++) {
                job.irradiance[k] = at(to[k]);
                job.specular[k] = lobes ? at(to[3 + k]) : NULL;
            }
            run_shade(es_gi_kernel_table((es_isa)isa), &job, lights, batch);
            for (int k = 0; k < (lobes ? 6 : 3); k++) {
                check_guards(to[k]);
                check_equal(&g, expected[k], to[k], k < 3 ? "irradiance" : "specular");
            }
        }
        for (int k = 0; k < 6; k++) {
            free(expected[k].memory);
            free(result[k].memory);
        }
        free(maps);
        free(map_of);
        free(lights);
        free_gbuffer(&g);
    }
    free(batch);
}

static void run_filter(const es_gi_kernels* kernels, const es_filter_job* job, es_filter_scratch* scratch)
{
    for (uint32_t y = 0; y < job->gbuffer->height; y += ES_FILTER_ROWS)
        for (uint32_t x = 0; x < job->gbuffer->width; x += ES_FILTER_COLUMNS) kernels->filter(job, x, y, scratch);
}

static void check_filter(void** state)
{
    (void)state;
    es_filter_scratch* scratch = malloc(sizeof *scratch);
    for (uint32_t trial = 0; trial < 64; trial++) {
        uint32_t width = 1 + random_bits() % (trial % 3 ? 40 : 300), height = 1 + random_bits() % (trial % 4 ? 40 : 150);
        es_gbuffer g = new_gbuffer(width, height);
        const size_t count = (size_t)g.stride * height;
        es_filter_job job = {.gbuffer = &g, .size = 1 + trial % 16, .passes = 1 + trial % 7 % 4, .depth_threshold = 0.05f, .normal_threshold = 0.8f, .plane_count = 1 + trial % 6};
        float* source[6];
        plane expected[6], result[6];
        for (int k = 0; k < 6; k++) {
            source[k] = malloc(count * 4);
            for (size_t i = 0; i < count; i++) source[k][i] = random_bits() % 50 ? uniform(0, 10) : uniform(0, 1e30f);
            job.source[k] = source[k];
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 6; k++) job.result[k] = at(to[k]);
            run_filter(es_gi_kernel_table((es_isa)isa), &job, scratch);
            for (uint32_t k = 0; k < job.plane_count; k++) {
                check_guards(to[k]);
                check_equal(&g, expected[k], to[k], "filtered");
            }
        }
        for (int k = 0; k < 6; k++) {
            free(source[k]);
            free(expected[k].memory);
            free(result[k].memory);
        }
        free_gbuffer(&g);
    }
    free(scratch);
}

static void check_upsample(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 64; trial++) {
        uint32_t width = 1 + random_bits() % 60, height = 1 + random_bits() % 20;
        es_gbuffer g = new_gbuffer(width, height), half = new_gbuffer((width + 1) / 2, (height + 1) / 2);
        const size_t count = (size_t)g.stride * height, few = (size_t)half.stride * half.height;
        es_upsample_job job = {.gbuffer = &g, .half = &half, .depth_threshold = trial % 5 ? 0.05f : 0.0f, .normal_threshold = trial % 7 ? 0.8f : 1.0f, .plane_count = 1 + trial % 6};
        plane source[6], expected[6], result[6];
        for (int k = 0; k < 6; k++) {
            source[k] = new_plane(few);
            for (size_t i = 0; i < few; i++) at(source[k])[i] = random_bits() % 50 ? uniform(0, 10) : uniform(0, 1e30f);
            job.source[k] = at(source[k]);
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 6; k++) job.result[k] = at(to[k]);
            es_gi_kernel_table((es_isa)isa)->upsample(&job, 0, height);
            for (uint32_t k = 0; k < job.plane_count; k++) {
                check_guards(to[k]);
                check_equal(&g, expected[k], to[k], "upsampled");
            }
        }
        for (int k = 0; k < 6; k++) {
            free(source[k].memory);
            free(expected[k].memory);
            free(result[k].memory);
        }
        free_gbuffer(&g);
        free_gbuffer(&half);
    }
}

/* Far pixels of which the smaller image holds some not at all and the others at another depth: what lies where nothing is seen is left alone,
 * however much nearer its depth of zero is. */
static void check_upsample_leaves_the_unseen(void** state)
{
    (void)state;
    enum { WIDTH = 8, HALF = WIDTH / 2, UNSEEN = 2 };
    es_gbuffer g = new_gbuffer(WIDTH, 1), half = new_gbuffer(HALF, 1);
    plane source = new_plane(half.stride), result = new_plane(g.stride);
    for (uint32_t x = 0; x < g.stride; x++) {
        g.depth[x] = 100.0f;
        g.normal[x] = es_pack_normal(es_v3(0, 0, 1));
    }
    for (uint32_t x = 0; x < half.stride; x++) {
        half.depth[x] = x < UNSEEN ? 0.0f : 1000.0f;
        half.normal[x] = es_pack_normal(es_v3(0, 0, 1));
        at(source)[x] = x < UNSEEN ? 7.0f : 3.0f;
    }
    es_upsample_job job = {.gbuffer = &g, .half = &half, .depth_threshold = 0.03f, .normal_threshold = 0.8f, .plane_count = 1, .source = {at(source)}, .result = {at(result)}};
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        job.depth_threshold = 0.03f;
        es_gi_kernel_table((es_isa)isa)->upsample(&job, 0, 1);
        for (uint32_t x = 2 * UNSEEN - 1; x < WIDTH; x++) assert_true(at(result)[x] == 3.0f);
        for (uint32_t x = 0; x < 2 * UNSEEN - 1; x++) assert_true(at(result)[x] == 0.0f);
        /* a threshold of the whole depth would let a depth of zero count */
        job.depth_threshold = 1.0f;
        es_gi_kernel_table((es_isa)isa)->upsample(&job, 0, 1);
        for (uint32_t x = 2 * UNSEEN - 1; x < WIDTH; x++) assert_true(at(result)[x] == 3.0f);
    }
    free(source.memory);
    free(result.memory);
    free_gbuffer(&g);
    free_gbuffer(&half);
}

/* ---- from gathered pixels (gi/micro/upsample.h) ---------------------------------------------------------------------------------------- */

static void check_micro_upsample(void** state)
{
    (void)state;
    for (uint32_t trial = 0; trial < 64; trial++) {
        const uint32_t width = 1 + random_bits() % 60, height = 1 + random_bits() % 20, spacing = trial % 2 ? 2 : 4, kind = trial / 2 % 2;
        const uint32_t sparse_width = (width + spacing - 1) / spacing, sparse_height = (height + spacing - 1) / spacing, sparse_stride = (sparse_width + 7) / 8 * 8;
        es_gbuffer g = new_gbuffer(width, height);
        const size_t count = (size_t)g.stride * height, few = (size_t)sparse_stride * sparse_height, bytes = (size_t)(width + 7) / 8 * height, chunks = es_lit_chunks(g.stride) * (size_t)height;
        /* most surfaces are alike: otherwise every pixel would be one to be gathered at */
        for (size_t i = 0; i < count; i++) {
            if (random_bits() % 4) g.surface[i] = 0x00ff8000u;
            if (trial % 4 == 3 && random_bits() % 2) g.surface[i] = (uint32_t)ES_SURFACE_PHONG << 24 | 0x00402000u;
        }
        g.geometric_normal = g.normal;
        es_micro_upsample_job job = {.gbuffer = &g, .rays = random_rays(trial % 5 == 1, width, height), .kind = kind, .spacing = spacing, .sparse_width = sparse_width, .sparse_height = sparse_height, .sparse_stride = sparse_stride};
        plane source[3], expected[3], result[3], lists[2] = {new_plane((bytes + 3) / 4), new_plane((bytes + 3) / 4)}, lit[2] = {new_plane((chunks + 3) / 4), new_plane((chunks + 3) / 4)};
        for (int k = 0; k < 3; k++) {
            source[k] = new_plane(few);
            for (size_t i = 0; i < few; i++) at(source[k])[i] = random_bits() % 50 ? uniform(0, 10) : uniform(0, 1e30f);
            job.source[k] = at(source[k]);
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            const int other = isa != ES_ISA_SCALAR;
            plane* to = other ? result : expected;
            for (int k = 0; k < 3; k++) job.result[k] = at(to[k]);
            job.listed = (uint8_t*)at(lists[other]);
            job.lit = trial % 3 ? (uint8_t*)at(lit[other]) : NULL;
            es_gi_kernel_table((es_isa)isa)->micro_upsample(&job, 0, height);
            for (int k = 0; k < 3; k++) {
                check_guards(to[k]);
                check_equal(&g, expected[k], to[k], "upsampled");
            }
            check_guards(lists[other]);
            check_guards(lit[other]);
            assert_memory_equal(at(lists[0]), at(lists[other]), bytes);
            if (job.lit) assert_memory_equal(at(lit[0]), at(lit[other]), chunks);
        }
        uint32_t kept = 0;
        for (uint32_t y = 0; y < height; y++)
            for (uint32_t x = 0; x < width; x++) {
                const size_t i = (size_t)y * g.stride + x;
                const es_surface s = es_surface_of_gbuffer(g.albedo_rg[i], g.albedo_b[i], g.surface[i]);
                const bool lit_by = g.depth[i] > 0.0f && (kind == ES_GATHER_LOBE ? es_surface_has_lobe(&s) : es_maxf(s.albedo.x, es_maxf(s.albedo.y, s.albedo.z)) > 0.0f);
                const bool listed = ((const uint8_t*)at(lists[0]))[(size_t)y * ((width + 7) / 8) + x / 8] >> x % 8 & 1, there = x % spacing == 0 && y % spacing == 0;
                if (!lit_by || listed) assert_true(at(expected[0])[i] == 0.0f && (lit_by || !listed));
                if (!lit_by || !there) continue;
                /* what was gathered stays what it is */
                assert_false(listed);
                for (int k = 0; k < 3; k++) assert_memory_equal(&at(expected[k])[i], &at(source[k])[y / spacing * sparse_stride + x / spacing], 4);
                kept++;
            }
        if (width * height > 200) assert_true(kept > 0);
        for (int k = 0; k < 3; k++) {
            free(source[k].memory);
            free(expected[k].memory);
            free(result[k].memory);
        }
        for (int k = 0; k < 2; k++) {
            free(lists[k].memory);
            free(lit[k].memory);
        }
        free_gbuffer(&g);
    }
}

/* Any transmittance and alpha, 0 and 1 among them; what the layer does not cover may hold anything and stays as it is. */
static void check_blend(void** state)
{
    (void)state;
    for (int trial = 0; trial < 60; trial++) {
        const uint32_t columns = 8 + 8 * (random_bits() % 9), rows = 1 + random_bits() % 40, stride = columns + 8 * (random_bits() % 3);
        const size_t floats = (size_t)stride * rows;
        plane alpha = new_plane(floats), layer[3], expected[4], result[4];
        for (size_t i = 0; i < floats; i++) at(alpha)[i] = random_bits() % 3 ? uniform(0, 1) : random_bits() % 2 ? 0.0f : 1.0f;
        for (int k = 0; k < 3; k++) {
            layer[k] = new_plane(floats);
            for (size_t i = 0; i < floats; i++) at(layer[k])[i] = at(alpha)[i] > 0 ? uniform(0, 1e6f) : NAN;
        }
        for (int k = 0; k < 4; k++) {
            expected[k] = new_plane(floats);
            result[k] = new_plane(floats);
            for (size_t i = 0; i < floats; i++) at(expected[k])[i] = uniform(0, 1);
        }
        es_blend_job job = {.alpha = at(alpha), .through = trial % 3 != 0, .columns = columns, .rows = rows, .stride = stride};
        for (int k = 0; k < 3 && trial % 5; k++) job.layer[k] = at(layer[k]);
        for (int isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            for (int k = 0; k < 4; k++) memcpy(at(result[k]), at(expected[k]), floats * sizeof(float));
            job.transmittance = at(result[3]);
            for (int k = 0; k < 3; k++) job.sum[k] = at(result[k]);
            es_gi_kernel_table((es_isa)isa)->blend(&job, 0, rows);
            for (uint32_t y = 0; y < rows; y++)
                for (uint32_t x = 0; x < stride; x++) {
                    const size_t i = (size_t)y * stride + x;
                    const float a = x < columns ? at(alpha)[i] : 0, t = at(expected[3])[i], weight = t * a;
                    const float through = job.through && a > 0 ? t * (1.0f - a) : t;
                    assert_memory_equal(&at(result[3])[i], &through, sizeof through);
                    for (int k = 0; k < 3; k++) {
                        const float before = at(expected[k])[i], added = weight * at(layer[k])[i], after = a > 0 && job.layer[0] ? before + added : before;
                        assert_memory_equal(&at(result[k])[i], &after, sizeof after);
                    }
                }
        }
        for (int k = 0; k < 4; k++) check_guards(result[k]);
        free(alpha.memory);
        for (int k = 0; k < 3; k++) free(layer[k].memory);
        for (int k = 0; k < 4; k++) {
            free(expected[k].memory);
            free(result[k].memory);
        }
    }
}

static void time_all(void)
{
    enum { COUNT = 1024, SIZE = 128, REPEAT = 3 };
    es_gbuffer g = new_gbuffer(1024, 768);
    es_shade_light* lights = malloc(COUNT * sizeof *lights);
    for (uint32_t v = 0; v < COUNT; v++) lights[v] = random_light(false);
    uint16_t* maps = malloc((size_t)COUNT * SIZE * SIZE * 2);
    for (size_t i = 0; i < (size_t)COUNT * SIZE * SIZE; i++) maps[i] = (uint16_t)(random_bits() % 49152);
    es_shade_batch* batch = malloc(sizeof *batch);
    es_filter_scratch* scratch = malloc(sizeof *scratch);
    plane planes[6];
    es_shade_job job = {.gbuffer = &g, .rays = random_rays(false, 1024, 768), .vpl_count = COUNT, .maps = maps, .map_size = SIZE, .far_distance = 6, .bias = 0.05f, .geometry_bound = 20, .interleave = 8};
    es_filter_job filter = {.gbuffer = &g, .size = 8, .passes = 2, .depth_threshold = 0.05f, .normal_threshold = 0.8f, .plane_count = 3};
    for (int k = 0; k < 6; k++) planes[k] = new_plane((size_t)g.stride * g.height);
    for (int k = 0; k < 3; k++) {
        job.irradiance[k] = at(planes[k]);
        filter.source[k] = at(planes[k]);
        filter.result[k] = at(planes[3 + k]);
    }
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        const es_gi_kernels* kernels = es_gi_kernel_table((es_isa)isa);
        double begin = es_seconds();
        for (int i = 0; i < REPEAT; i++) run_shade(kernels, &job, lights, batch);
        double middle = es_seconds();
        for (int i = 0; i < REPEAT; i++) run_filter(kernels, &filter, scratch);
        double end = es_seconds();
        printf("%-7s shade %8.2f ms   filter %8.2f ms, one thread\n", es_isa_name((es_isa)isa), (middle - begin) / REPEAT * 1e3, (end - middle) / REPEAT * 1e3);
    }
    for (int k = 0; k < 6; k++) free(planes[k].memory);
    free(batch);
    free(scratch);
    free(maps);
    free(lights);
    free_gbuffer(&g);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_shade),
        cmocka_unit_test(check_filter),
        cmocka_unit_test(check_upsample),
        cmocka_unit_test(check_upsample_leaves_the_unseen),
        cmocka_unit_test(check_micro_upsample),
        cmocka_unit_test(check_blend),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
