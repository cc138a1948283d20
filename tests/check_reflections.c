/* Kernels of reflections: every instruction set against scalar, bit for bit, on random maps and G-buffers of odd sizes with extreme values, with guards round what is written.
 *
 * check_reflections --time prints milliseconds for 1024 × 768 pixels that all reflect, and for a map of 256² texels a face, of every instruction set instead. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/kernel_table.h"
#include "gi/lit.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "tests/guarded_planes.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(31, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

typedef struct maps { es_reflection_atlas atlas; float *texels, *centre[3], *last_level; uint32_t count; } maps;

/* Rooms of random walls, holes in them, and bright spots. */
static maps random_maps(uint32_t count, uint32_t size)
{
    maps m = {.count = count};
    m.atlas.layout = es_reflection_layout_of(size);
    const size_t floats = 4 * (size_t)m.atlas.layout.texels * count;
    m.texels = malloc(floats * sizeof(float));
    for (size_t i = 0; i < floats; i++) m.texels[i] = i % 4 == 3 ? random_bits() % 5 ? 1.0f / uniform(0.1f, 20) : random_bits() % 2 ? 0.0f : 1e9f : random_bits() % 9 ? uniform(0, 3) : 1e6f;
    m.last_level = malloc(count * sizeof(float));
    for (int k = 0; k < 3; k++) m.centre[k] = malloc(count * sizeof(float));
    for (uint32_t i = 0; i < count; i++) {
        m.last_level[i] = (float)(random_bits() % ES_REFLECTION_LEVELS);
        for (int k = 0; k < 3; k++) m.centre[k][i] = uniform(-3, 3);
    }
    m.atlas.texels = m.texels;
    m.atlas.last_level = m.last_level;
    for (int k = 0; k < 3; k++) m.atlas.centre[k] = m.centre[k];
    return m;
}

static void free_maps(maps* m)
{
    free(m->texels);
    free(m->last_level);
    for (int k = 0; k < 3; k++) free(m->centre[k]);
}

static es_vec3 random_direction(void)
{
    const uint32_t r = random_bits();
    if (r % 16 == 0) return r & 16 ? es_v3(r & 32 ? 1.0f : -1.0f, 0, 0) : r & 64 ? es_v3(0, r & 32 ? 1.0f : -1.0f, 0) : es_v3(0, 0, r & 32 ? 1.0f : -1.0f);
    if (r % 16 == 1) return es_v3_normalize(es_v3(r & 16 ? 1.0f : -1.0f, r & 32 ? 1.0f : -1.0f, r & 64 ? 1.0f : -1.0f), es_v3(1, 0, 0)); /* a corner of the cube */
    return es_v3_normalize(es_v3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), es_v3(1, 0, 0));
}

static void expect_equal(plane a, plane b, const char* what)
{
    for (size_t i = 0; i < a.count; i++) {
        const float p = at(a)[i], q = at(b)[i];
        if (memcmp(&p, &q, 4) && !(p != p && q != q)) fail_msg("%s at %zu: scalar %.9g, here %.9g", what, i, (double)p, (double)q);
    }
}

/* ---- maps ------------------------------------------------------------------------------------------------------------------------ */

static void check_ask(void** state)
{
    (void)state;
    for (int trial = 0; trial < 40; trial++) {
        maps m = random_maps(1 + random_bits() % 4, 16u << random_bits() % 3);
        const uint32_t count = 8 * (1 + random_bits() % 60);
        int32_t* map = malloc(count * sizeof *map);
        float* in[7];
        for (int k = 0; k < 7; k++) in[k] = malloc(count * sizeof(float));
        for (uint32_t i = 0; i < count; i++) {
            map[i] = random_bits() % 7 ? (int32_t)(random_bits() % m.count) : -1;
            const es_vec3 d = random_direction();
            const float values[7] = {uniform(-5, 5), uniform(-5, 5), uniform(-5, 5), d.x, d.y, d.z, random_bits() % 4 ? uniform(0, 1) : (float)(random_bits() % 2)};
            for (int k = 0; k < 7; k++) in[k][i] = values[k];
            if (random_bits() % 5 == 0 && map[i] >= 0)
                for (int k = 0; k < 3; k++) in[k][i] = m.centre[k][map[i]]; /* in the middle itself */
        }
        plane expected[6], result[6];
        for (int k = 0; k < 6; k++) {
            expected[k] = new_plane(count);
            result[k] = new_plane(count);
        }
        es_reflection_question q = {.map = map, .position = {in[0], in[1], in[2]}, .direction = {in[3], in[4], in[5]}, .alpha = in[6], .count = count};
        for (int isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            plane* to = isa == ES_ISA_SCALAR ? expected : result;
            for (int k = 0; k < 3; k++) {
                q.radiance[k] = at(to[k]);
                q.met[k] = at(to[3 + k]);
            }
            es_gi_kernel_table((es_isa)isa)->reflection_ask(&m.atlas, &q);
            for (int k = 0; k < 6; k++) {
                check_guards(to[k]);
                if (isa != ES_ISA_SCALAR) expect_equal(expected[k], to[k], "what is seen");
            }
        }
        for (uint32_t i = 0; i < count; i++)
            for (int k = 0; k < 3; k++) {
                const float r = at(expected[k])[i];
                assert_true(r >= 0.0f && r <= 1.0001e6f);
                if (map[i] < 0) assert_true(r == 0.0f);
            }
        for (int k = 0; k < 6; k++) {
            free(expected[k].memory);
            free(result[k].memory);
        }
        for (int k = 0; k < 7; k++) free(in[k]);
        free(map);
        free_maps(&m);
    }
}

static void check_faces_and_lobes(void** state)
{
    (void)state;
    for (int trial = 0; trial < 12; trial++) {
        maps m = random_maps(1, 16u << random_bits() % 4);
        const es_reflection_layout* l = &m.atlas.layout;
        const uint32_t level = 2 + random_bits() % (ES_REFLECTION_LEVELS - 2), size = (uint32_t)l->level_size[level];
        es_reflection_tap taps[ES_REFLECTION_TAPS];
        for (int i = 0; i < ES_REFLECTION_TAPS; i++) {
            const es_vec3 d = random_direction();
            taps[i] = (es_reflection_tap){{d.x, d.y, es_absf(d.z)}, uniform(0, (float)(l->means - 1)), uniform(0, 0.1f)};
        }
        const uint32_t face_size = l->size, stride = face_size + 8;
        float* planes[4];
        for (int k = 0; k < 4; k++) {
            planes[k] = malloc((size_t)stride * face_size * sizeof(float));
            for (size_t i = 0; i < (size_t)stride * face_size; i++) planes[k][i] = k == 3 ? random_bits() % 4 ? uniform(0.01f, 50) : 0.0f : random_bits() % 8 ? uniform(0, 5) : 1e-35f;
        }
        const size_t lobe_floats = 4 * (size_t)6 * (size + 2) * (size + 2), face_floats = 4 * (size_t)(face_size + 2) * (face_size + 2);
        plane lobes[2] = {new_plane(lobe_floats), new_plane(lobe_floats)}, faces[2] = {new_plane(face_floats), new_plane(face_floats)};
        for (int isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            const int to = isa != ES_ISA_SCALAR;
            memset(at(lobes[to]), 0, lobe_floats * sizeof(float));
            memset(at(faces[to]), 0, face_floats * sizeof(float));
            const es_reflection_lobe_job lobe = {.texels = m.texels, .layout = l, .taps = taps, .tap_count = ES_REFLECTION_TAPS, .level = level, .out = at(lobes[to])};
            const es_reflection_face_job face = {.radiance = {planes[0], planes[1], planes[2]}, .depth = planes[3], .size = face_size, .stride = stride, .out = at(faces[to])};
            es_gi_kernel_table((es_isa)isa)->reflection_lobe(&lobe, 0, 6 * size);
            es_gi_kernel_table((es_isa)isa)->reflection_face(&face, 0, face_size);
            check_guards(lobes[to]);
            check_guards(faces[to]);
            if (!to) continue;
            expect_equal(lobes[0], lobes[1], "lobe");
            expect_equal(faces[0], faces[1], "face");
        }
        for (int i = 0; i < 2; i++) {
            free(lobes[i].memory);
            free(faces[i].memory);
        }
        for (int k = 0; k < 4; k++) free(planes[k]);
        free_maps(&m);
    }
}

/* ---- pixels ---------------------------------------------------------------------------------------------------------------------------- */

enum { IDS = 6 };

static es_gbuffer random_gbuffer(uint32_t width, uint32_t height)
{
    es_gbuffer g = {.width = width, .height = height, .stride = (width + 7) / 8 * 8};
    const size_t count = (size_t)g.stride * height;
    uint32_t** const words[] = {&g.normal, &g.albedo_rg, &g.albedo_b, &g.surface, &g.instance};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) *words[i] = malloc(count * sizeof(uint32_t));
    g.depth = malloc(count * sizeof(float));
    for (size_t i = 0; i < count; i++) {
        const bool seen = i % g.stride < width && random_bits() % 6 != 0;
        g.depth[i] = seen ? uniform(0.1f, 20) : 0.0f;
        g.normal[i] = seen ? random_bits() % 4 ? es_pack_normal(random_direction()) : random_bits() : 0;
        g.albedo_rg[i] = seen ? random_bits() : 0;
        g.albedo_b[i] = seen ? random_bits() : 0;
        g.surface[i] = seen ? (random_bits() & 0xffffffu) | random_bits() % 3 << 24 : 0;
        g.instance[i] = seen ? random_bits() % IDS : i % g.stride < width ? 0 : random_bits(); /* what pads rows is anything */
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
    free(g->instance);
}

static es_pixel_rays random_rays(uint32_t width, uint32_t height)
{
    es_pixel_rays r = {.far_depth = 3e38f};
    for (int k = 0; k < 3; k++) {
        r.base[k] = uniform(-1, 1);
        r.dir[k] = uniform(-1, 1);
        r.dir_dx[k] = uniform(-1, 1) / (float)width;
        r.dir_dy[k] = uniform(-1, 1) / (float)height;
    }
    return r;
}

typedef struct found { plane map, alpha, direction[3], albedo[3], out[3]; uint8_t *any, *lit; size_t chunks; } found;

static found new_found(const es_gbuffer* g)
{
    const size_t count = (size_t)g->stride * g->height;
    found f = {.chunks = (size_t)es_lit_chunks(g->stride) * g->height};
    f.map = new_plane(count);
    f.alpha = new_plane(count);
    memset(at(f.alpha), 0, count * 4);
    for (int k = 0; k < 3; k++) {
        f.direction[k] = new_plane(count);
        f.albedo[k] = new_plane(count);
        f.out[k] = new_plane(count);
        memset(at(f.direction[k]), 0, count * 4);
        memset(at(f.albedo[k]), 0, count * 4);
        memset(at(f.out[k]), 0, count * 4);
    }
    memset(at(f.map), 0, count * 4);
    f.any = calloc(f.chunks, 1);
    f.lit = calloc(f.chunks, 1);
    return f;
}

static void free_found(found* f)
{
    free(f->map.memory);
    free(f->alpha.memory);
    for (int k = 0; k < 3; k++) {
        free(f->direction[k].memory);
        free(f->albedo[k].memory);
        free(f->out[k].memory);
    }
    free(f->any);
    free(f->lit);
}

static es_reflecting_planes planes_of(found* f)
{
    es_reflecting_planes p = {.map = (uint32_t*)at(f->map), .any = f->any, .alpha = at(f->alpha)};
    for (int k = 0; k < 3; k++) {
        p.direction[k] = at(f->direction[k]);
        p.albedo[k] = at(f->albedo[k]);
    }
    return p;
}

static void check_pixels(void** state)
{
    es_lobe_albedo* lobes = *state;
    for (int trial = 0; trial < 40; trial++) {
        const uint32_t width = 1 + random_bits() % 300, height = 1 + random_bits() % 20;
        es_gbuffer g = random_gbuffer(width, height);
        maps m = random_maps(3, 16);
        uint32_t map_of[IDS];
        for (int i = 0; i < IDS; i++) map_of[i] = i ? random_bits() % 4 : 0;
        const es_pixel_rays rays = random_rays(width, height);
        const float roughness = trial % 3 ? uniform(0, 1) : 1.0f;
        /* (0, 0, 0) where nothing is edited */
        float* edited[3];
        const size_t count = (size_t)g.stride * height;
        for (int k = 0; k < 3; k++) edited[k] = calloc(count, sizeof(float));
        for (size_t i = 0; i < count; i++) {
            if (random_bits() % 2) continue;
            const es_vec3 d = random_direction();
            edited[0][i] = d.x, edited[1][i] = d.y, edited[2][i] = d.z;
        }
        found both[2] = {new_found(&g), new_found(&g)};
        for (int isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
            if (!(es_isa_available_mask() >> isa & 1)) continue;
            found* f = &both[isa != ES_ISA_SCALAR];
            const es_reflecting_job find = {.gbuffer = &g, .rays = rays, .map_of = map_of, .roughness = roughness, .lobes = lobes, .out = planes_of(f)};
            es_reflected_job see = {.gbuffer = &g, .rays = rays, .planes = planes_of(f), .atlas = &m.atlas, .out = {at(f->out[0]), at(f->out[1]), at(f->out[2])}, .lit = f->lit};
            for (int k = 0; k < 3 && trial % 2; k++) see.edited[k] = edited[k];
            es_gi_kernel_table((es_isa)isa)->reflecting(&find, 0, height);
            es_gi_kernel_table((es_isa)isa)->reflected(&see, 0, height);
            check_guards(f->map);
            check_guards(f->alpha);
            for (int k = 0; k < 3; k++) {
                check_guards(f->direction[k]);
                check_guards(f->albedo[k]);
                check_guards(f->out[k]);
            }
            if (isa == ES_ISA_SCALAR) continue;
            expect_equal(both[0].alpha, f->alpha, "alpha");
            for (int k = 0; k < 3; k++) {
                expect_equal(both[0].direction[k], f->direction[k], "direction");
                expect_equal(both[0].albedo[k], f->albedo[k], "albedo");
                expect_equal(both[0].out[k], f->out[k], "what is seen");
            }
            assert_memory_equal(at(both[0].map), at(f->map), count * 4);
            assert_memory_equal(both[0].any, f->any, f->chunks);
            assert_memory_equal(both[0].lit, f->lit, f->chunks);
        }
        /* what reflects, and what it reads */
        const es_reflecting_planes p = planes_of(&both[0]);
        for (uint32_t y = 0; y < height; y++)
            for (uint32_t x = 0; x < width; x++) {
                const size_t i = (size_t)y * g.stride + x;
                const es_surface s = es_surface_of_gbuffer(g.albedo_rg[i], g.albedo_b[i], g.surface[i]);
                const float alpha = s.model == ES_SURFACE_PHONG ? es_sqrt(2.0f / (s.roughness + 2.0f)) : s.roughness * s.roughness;
                const bool reflects = map_of[g.instance[i]] && s.model != ES_SURFACE_UNLIT && es_maxf(s.specular.x, es_maxf(s.specular.y, s.specular.z)) > 0.0f && alpha <= roughness * roughness;
                assert_int_equal(p.map[i], reflects ? map_of[g.instance[i]] : 0);
                if (!reflects) {
                    for (int k = 0; k < 3; k++) assert_true(at(both[0].out[k])[i] == 0.0f);
                    continue;
                }
                assert_true(p.any[(size_t)y * es_lit_chunks(g.stride) + x / ES_LIT_COLUMNS] & 1);
                const float d[3] = {p.direction[0][i], p.direction[1][i], p.direction[2][i]};
                assert_float_equal(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1.0f, 1e-5f);
                for (int k = 0; k < 3; k++) assert_true(p.albedo[k][i] >= 0.0f && p.albedo[k][i] <= 1.001f);
            }
        free_found(&both[0]);
        free_found(&both[1]);
        for (int k = 0; k < 3; k++) free(edited[k]);
        free_maps(&m);
        free_gbuffer(&g);
    }
}

static es_lobe_albedo table;
static es_context* context;
static int set_up(void** state)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 1;
    if (es_context_create(&desc, &context)) return 1;
    table = es_lobe_albedos;
    *state = &table;
    return 0;
}
static int tear_down(void** state)
{
    (void)state;
    es_context_destroy(context);
    return 0;
}

/* ---- time -------------------------------------------------------------------------------------------------------------------------------- */

static void time_all(void)
{
    void* state;
    if (set_up(&state)) return;
    enum { WIDTH = 1024, HEIGHT = 768 };
    es_gbuffer g = random_gbuffer(WIDTH, HEIGHT);
    const uint32_t map_of[IDS] = {1, 1, 1, 1, 1, 1};
    for (size_t i = 0; i < (size_t)g.stride * HEIGHT; i++) g.surface[i] = 255 | 10 << 8 | 255 << 16;
    maps m = random_maps(1, 256);
    m.last_level[0] = 4;
    for (size_t i = 3; i < 4 * (size_t)m.atlas.layout.texels; i += 4) m.texels[i] = 0.2f;
    for (int isa = ES_ISA_SCALAR; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        const es_gi_kernels* kernels = es_gi_kernel_table((es_isa)isa);
        found f = new_found(&g);
        const es_pixel_rays rays = random_rays(WIDTH, HEIGHT);
        const es_reflecting_job find = {.gbuffer = &g, .rays = rays, .map_of = map_of, .roughness = 1, .lobes = state, .out = planes_of(&f)};
        const es_reflected_job see = {.gbuffer = &g, .rays = rays, .planes = planes_of(&f), .atlas = &m.atlas, .out = {at(f.out[0]), at(f.out[1]), at(f.out[2])}, .lit = f.lit};
        double best[3] = {1e9, 1e9, 1e9};
        for (int turn = 0; turn < 5; turn++) {
            double start = es_seconds();
            kernels->reflecting(&find, 0, HEIGHT);
            best[0] = fmin(best[0], es_seconds() - start);
            start = es_seconds();
            kernels->reflected(&see, 0, HEIGHT);
            best[1] = fmin(best[1], es_seconds() - start);
            start = es_seconds();
            es_reflection_map_finish(context, &m.atlas.layout, m.texels, 4);
            best[2] = fmin(best[2], es_seconds() - start);
        }
        printf("%-8s reflecting %.2f ms, reflected %.2f ms, a map's levels %.2f ms (on the context's instruction set)\n", es_isa_name((es_isa)isa), best[0] * 1e3, best[1] * 1e3, best[2] * 1e3);
        free_found(&f);
    }
    free_maps(&m);
    free_gbuffer(&g);
    tear_down(&state);
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(check_ask),
        cmocka_unit_test(check_faces_and_lobes),
        cmocka_unit_test(check_pixels),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
