/* The world floor's kernels: every instruction set against scalar, bit for bit, on random and extreme input, with guards round what
 * is written; and what they compute against doubles.
 *
 * check_sim --time prints milliseconds of every kernel and instruction set instead. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "platform/context.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "sim/kernel_table.h"
#include "sim/normals.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(41, counter++); }
static float uniform(float low, float high) { return low + (high - low) * es_unit_float(random_bits()); }

enum { GUARD = 32 };
typedef struct floats { float* memory; size_t count; } floats;

/* 16-byte aligned after the guard */
static floats new_floats(size_t count)
{
    floats f = {aligned_alloc(64, ((count + 2 * GUARD) * sizeof(float) + 63) / 64 * 64), count};
    assert_non_null(f.memory);
    memset(f.memory, 0xa5, (count + 2 * GUARD) * sizeof(float));
    return f;
}
static float* at(floats f) { return f.memory + GUARD; }
static void check_guards(floats f)
{
    uint8_t guard[GUARD * sizeof(float)];
    memset(guard, 0xa5, sizeof guard);
    assert_memory_equal(f.memory, guard, sizeof guard);
    assert_memory_equal(f.memory + GUARD + f.count, guard, sizeof guard);
}

static bool runs(int isa) { return es_isa_available_mask() >> isa & 1; }
static size_t padded(size_t vertices) { return (vertices + 7) / 8 * 8; }

/* ---- normals ------------------------------------------------------------------------------------------------------------------ */

typedef struct soup { uint32_t vertices, triangles; floats positions; uint32_t* indices; float size; } soup;

static soup random_soup(uint32_t vertices, uint32_t triangles, float size)
{
    soup s = {vertices, triangles, new_floats(padded(vertices) * 4), malloc((3 * (size_t)triangles + 1) * 4), size};
    for (size_t v = 0; v < padded(vertices); v++) {
        for (int k = 0; k < 3; k++) at(s.positions)[4 * v + k] = random_bits() % 16 ? uniform(-size, size) : random_bits() % 2 ? size : 0.0f;
        at(s.positions)[4 * v + 3] = 1;
    }
    for (size_t i = 0; i < 3 * (size_t)triangles; i++) s.indices[i] = random_bits() % vertices;
    s.indices[3 * (size_t)triangles] = 0;
    return s;
}

static void free_soup(soup s)
{
    free(s.positions.memory);
    free(s.indices);
}

static void check_normals(void** state)
{
    es_context* context = *state;
    static const uint32_t vertices[] = {1, 3, 8, 9, 100, 1000}, triangles[] = {0, 1, 7, 8, 9, 64, 1201};
    static const float sizes[] = {1, 1e9f, 1e-6f, 3e5f};
    for (uint32_t trial = 0; trial < 6 * 7; trial++) {
        soup s = random_soup(vertices[trial % 6], triangles[trial / 6], sizes[trial % 4]);
        uint32_t* welded = NULL;
        if (trial % 3 == 0) {
            welded = malloc(s.vertices * sizeof *welded);
            for (uint32_t v = 0; v < s.vertices; v++) welded[v] = v % 5 == 4 ? v - 3 : v;
        }
        es_vertex_fans fans;
        assert_true(es_vertex_fans_make(context, s.indices, s.triangles, s.vertices, welded, &fans));
        /* the definition, in double */
        double *sum = calloc(s.vertices, 3 * sizeof *sum), *area = calloc(s.vertices, sizeof *area);
        for (uint32_t t = 0; t < s.triangles; t++) {
            double p[3][3];
            for (int c = 0; c < 3; c++)
                for (int k = 0; k < 3; k++) p[c][k] = at(s.positions)[4 * (size_t)s.indices[3 * t + c] + k];
            double u[3], w[3];
            for (int k = 0; k < 3; k++) u[k] = p[1][k] - p[0][k], w[k] = p[2][k] - p[0][k];
            for (int c = 0; c < 3; c++) {
                uint32_t v = s.indices[3 * t + c];
                if (welded) v = welded[v];
                for (int k = 0; k < 3; k++) {
                    double product = u[(k + 1) % 3] * w[(k + 2) % 3] - u[(k + 2) % 3] * w[(k + 1) % 3];
                    sum[3 * v + k] += product;
                    area[v] += fabs(product);
                }
            }
        }
        floats faces = new_floats((s.triangles / 8 + 1) * 32), expected = new_floats(padded(s.vertices) * 4), result = new_floats(padded(s.vertices) * 4);
        floats first_faces = new_floats(faces.count);
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!runs(isa)) continue;
            const es_sim_kernels* kernels = es_sim_kernel_table((es_isa)isa);
            float scale = 0.25f / s.size;
            floats to = isa == ES_ISA_SCALAR ? expected : result;
            memset(at(faces), 0, faces.count * sizeof(float));
            uint32_t cut = s.triangles / 16 * 8;
            if (cut) kernels->face_normals(at(s.positions), s.indices, 0, cut, scale, at(faces));
            if (cut < s.triangles) kernels->face_normals(at(s.positions), s.indices, cut, s.triangles, scale, at(faces));
            kernels->vertex_normals(fans.first_row, fans.rows, at(faces), 0, (uint32_t)padded(s.vertices) / 8, at(to));
            check_guards(faces);
            check_guards(to);
            if (isa == ES_ISA_SCALAR) memcpy(at(first_faces), at(faces), faces.count * sizeof(float));
            assert_memory_equal(at(first_faces), at(faces), faces.count * sizeof(float));
            assert_memory_equal(at(expected), at(to), to.count * sizeof(float));
        }
        /* and the whole, on the context's threads */
        float size = s.size;
        es_normals_recompute(context, &fans, s.indices, at(s.positions), es_v3(-size, -size, -size), es_v3(size, size, size), at(result));
        check_guards(result);
        for (uint32_t v = 0; v < s.vertices; v++) {
            const double* n = sum + 3 * (welded ? welded[v] : v);
            double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
            const float* got = at(result) + 4 * v;
            assert_true(fabs(sqrt((double)got[0] * got[0] + (double)got[1] * got[1] + (double)got[2] * got[2]) - 1) < 1e-6);
            if (area[welded ? welded[v] : v] == 0) assert_true(got[0] == 0 && got[1] == 1 && got[2] == 0);
            /* sums of few triangles of all sizes and directions may nearly cancel */
            if (length < 1e-2 * size * size) continue;
            for (int k = 0; k < 3; k++)
                if (fabs(got[k] - n[k] / length) > 2e-4) fail_msg("vertex %u: %g, expected %g", v, (double)got[k], n[k] / length);
        }
        for (size_t v = s.vertices; v < padded(s.vertices); v++) assert_memory_equal(at(result) + 4 * v, at(result), 16);
        es_vertex_fans_free(context, &fans);
        free_soup(s);
        free(sum);
        free(area);
        free(welded);
        free(faces.memory);
        free(first_faces.memory);
        free(expected.memory);
        free(result.memory);
    }
}

/* A mesh has the same normals at every scale by powers of two, and for any number of threads. */
static void normals_scale(void** state)
{
    es_context* context = *state;
    soup s = random_soup(5000, 9000, 1);
    es_vertex_fans fans;
    assert_true(es_vertex_fans_make(context, s.indices, s.triangles, s.vertices, NULL, &fans));
    floats first = new_floats(padded(s.vertices) * 4), other = new_floats(padded(s.vertices) * 4);
    es_normals_recompute(context, &fans, s.indices, at(s.positions), es_v3(-1, -1, -1), es_v3(1, 1, 1), at(first));
    static const float scales[] = {0x1p-30f, 0x1p-9f, 0x1p29f};
    for (int i = 0; i < 3; i++) {
        floats scaled = new_floats(s.positions.count);
        for (size_t k = 0; k < s.positions.count; k++) at(scaled)[k] = at(s.positions)[k] * scales[i];
        float size = scales[i];
        es_context_desc desc = es_default_context_desc();
        desc.threads = 1 + (uint32_t)i;
        es_context* another;
        assert_int_equal(es_context_create(&desc, &another), ES_OK);
        es_normals_recompute(another, &fans, s.indices, at(scaled), es_v3(-size, -size, -size), es_v3(size, size, size), at(other));
        es_context_destroy(another);
        assert_memory_equal(at(first), at(other), first.count * sizeof(float));
        free(scaled.memory);
    }
    es_vertex_fans_free(context, &fans);
    free_soup(s);
    free(first.memory);
    free(other.memory);
}

/* ---- deformation ------------------------------------------------------------------------------------------------------------------ */

static float wild(float scale)
{
    static const float odd[] = {0.0f, -0.0f, 1e9f, -1e9f, 1e-30f, -1e-38f};
    uint32_t r = random_bits();
    return r % 16 == 0 ? odd[r / 16 % 6] : uniform(-scale, scale);
}

static floats random_floats(size_t count, float scale)
{
    floats f = new_floats(count);
    for (size_t i = 0; i < count; i++) at(f)[i] = wild(scale);
    return f;
}

typedef struct random_skin { es_skin_weights weights; floats palette; uint32_t joints; } random_skin;

static random_skin make_skin(uint32_t blocks, uint32_t joints, float scale)
{
    random_skin s = {.joints = joints};
    s.weights.blocks = blocks;
    s.weights.first_row = malloc((blocks + 1) * sizeof(uint32_t));
    for (uint32_t b = 0; b <= blocks; b++) {
        s.weights.first_row[b] = (uint32_t)s.weights.row_count;
        s.weights.row_count += b < blocks ? 1 + random_bits() % 8 : 0;
    }
    s.weights.joints = malloc(s.weights.row_count * 8 * sizeof(uint32_t));
    s.weights.weights = malloc(s.weights.row_count * 8 * sizeof(float));
    for (size_t i = 0; i < s.weights.row_count * 8; i++) {
        s.weights.joints[i] = random_bits() % (joints + 1);
        s.weights.weights[i] = random_bits() % 4 ? uniform(0, 1) : 0.0f;
    }
    s.palette = random_floats((joints + 1) * (size_t)ES_JOINT_FLOATS, scale);
    return s;
}

static void free_skin(random_skin s)
{
    free(s.weights.first_row);
    free(s.weights.joints);
    free(s.weights.weights);
    free(s.palette.memory);
}

static void check_skin(void** state)
{
    static const uint32_t blocks[] = {1, 2, 3, 17, 64};
    static const float scales[] = {1, 1e4f, 1e8f, 1e-12f};
    for (uint32_t trial = 0; trial < 5 * 4 * 3; trial++) {
        uint32_t count = blocks[trial % 5];
        random_skin skin = make_skin(count, 1 + random_bits() % 70, scales[trial / 5 % 4]);
        floats from[ES_STREAMS], expected[ES_STREAMS], result[ES_STREAMS];
        for (int s = 0; s < ES_STREAMS; s++) {
            from[s] = random_floats(count * 32, s == 0 ? 100 : 1);
            expected[s] = new_floats(count * 32);
            result[s] = new_floats(count * 32);
        }
        uint32_t streams = 1 + trial / 20;
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!runs(isa)) continue;
            floats* to = isa == ES_ISA_SCALAR ? expected : result;
            es_skin_job job = {.weights = &skin.weights, .palette = at(skin.palette)};
            for (uint32_t s = 0; s < streams; s++) {
                job.from[s] = at(from[s]);
                job.to[s] = at(to[s]);
                if (trial % 2) { /* in place */
                    memcpy(at(to[s]), at(from[s]), count * 32 * sizeof(float));
                    job.from[s] = at(to[s]);
                }
            }
            es_sim_kernel_table((es_isa)isa)->skin(&job, 0, count);
            for (uint32_t s = 0; s < streams; s++) {
                check_guards(to[s]);
                check_guards(from[s]);
                assert_memory_equal(at(expected[s]), at(to[s]), count * 32 * sizeof(float));
                for (size_t i = 0; s > 0 && i < count * 8; i++) {
                    const float* n = at(to[s]) + 4 * i;
                    assert_true(isfinite(n[0]) && isfinite(n[1]) && isfinite(n[2]));
                    assert_memory_equal(n + 3, at(from[s]) + 4 * i + 3, sizeof(float));
                }
            }
        }
        for (int s = 0; s < ES_STREAMS; s++) {
            free(from[s].memory);
            free(expected[s].memory);
            free(result[s].memory);
        }
        free_skin(skin);
    }
}

static void check_morph(void** state)
{
    for (uint32_t trial = 0; trial < 24; trial++) {
        uint32_t blocks = 1 + random_bits() % 40, begin = random_bits() % blocks, end = begin + 1 + random_bits() % (blocks - begin);
        floats base = random_floats(blocks * 32, 3), moved = random_floats(blocks * 32, 3), results[2] = {new_floats(blocks * 32), new_floats(blocks * 32)}, bounds[2] = {new_floats(8), new_floats(8)};
        float weight = wild(2);
        for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
            if (!runs(isa)) continue;
            const es_sim_kernels* kernels = es_sim_kernel_table((es_isa)isa);
            floats to = results[isa != ES_ISA_SCALAR], box = bounds[isa != ES_ISA_SCALAR];
            memcpy(at(to), at(base), base.count * sizeof(float));
            kernels->morph(at(to), at(moved), weight, begin, end);
            for (size_t i = 0; i < base.count; i++) {
                float sum = at(base)[i] + weight * at(moved)[i];
                bool inside = i >= begin * 32 && i < end * 32;
                assert_memory_equal(inside ? &sum : at(base) + i, at(to) + i, sizeof sum);
            }
            kernels->unit(at(to), at(base), begin, end);
            check_guards(to);
            assert_memory_equal(at(results[0]), at(to), base.count * sizeof(float));
            kernels->bounds(at(base), begin, end, at(box));
            check_guards(box);
            for (int k = 0; k < 3; k++) {
                float low = at(base)[begin * 32 + (size_t)k], high = low;
                for (size_t v = begin * 8; v < end * 8; v++) {
                    low = fminf(low, at(base)[4 * v + (size_t)k]);
                    high = fmaxf(high, at(base)[4 * v + (size_t)k]);
                }
                assert_true(at(box)[k] == low && at(box)[4 + k] == high);
            }
            assert_memory_equal(at(bounds[0]), at(box), 8 * sizeof(float));
        }
        for (int i = 0; i < 2; i++) {
            free(results[i].memory);
            free(bounds[i].memory);
        }
        free(base.memory);
        free(moved.memory);
    }
}

/* ---- timing ---------------------------------------------------------------------------------------------------------------------- */

static void time_kernels(es_context* context)
{
    soup s = random_soup(100000, 200000, 1);
    for (uint32_t t = 0; t < s.triangles; t++) /* neighbours lie together, as in most meshes */
        for (uint32_t c = 0; c < 3; c++) s.indices[3 * t + c] = (t / 2 + random_bits() % 512) % s.vertices;
    es_vertex_fans fans;
    if (!es_vertex_fans_make(context, s.indices, s.triangles, s.vertices, NULL, &fans)) return;
    floats normals = new_floats(padded(s.vertices) * 4);
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!runs(isa)) continue;
        const es_sim_kernels* kernels = es_sim_kernel_table((es_isa)isa);
        double begin = es_seconds();
        for (int i = 0; i < 20; i++) kernels->face_normals(at(s.positions), s.indices, 0, s.triangles, 0.5f, fans.faces);
        double middle = es_seconds();
        for (int i = 0; i < 20; i++) kernels->vertex_normals(fans.first_row, fans.rows, fans.faces, 0, s.vertices / 8, at(normals));
        double end = es_seconds();
        printf("%-8s face_normals %.3f ms, vertex_normals %.3f ms (100,000 vertices, 200,000 triangles, 1 thread)\n", es_isa_name((es_isa)isa), (middle - begin) * 50, (end - middle) * 50);
    }
    random_skin skin = make_skin((uint32_t)padded(s.vertices) / 8, 60, 1);
    for (uint32_t b = 0; b <= skin.weights.blocks; b++) skin.weights.first_row[b] = b * 4 > skin.weights.row_count ? (uint32_t)skin.weights.row_count : b * 4;
    floats to = new_floats(padded(s.vertices) * 4);
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!runs(isa)) continue;
        const es_sim_kernels* kernels = es_sim_kernel_table((es_isa)isa);
        es_skin_job job = {&skin.weights, at(skin.palette), {at(s.positions), at(normals)}, {at(to), at(to)}};
        double begin = es_seconds();
        for (int i = 0; i < 20; i++) kernels->skin(&job, 0, skin.weights.blocks);
        double middle = es_seconds();
        for (int i = 0; i < 20; i++) kernels->morph(at(to), at(s.positions), 0.5f, 0, skin.weights.blocks);
        double end = es_seconds();
        printf("%-8s skin %.3f ms (4 joints a vertex, positions and normals), one morph target %.3f ms\n", es_isa_name((es_isa)isa), (middle - begin) * 50, (end - middle) * 50);
    }
    free_skin(skin);
    free(to.memory);
    es_vertex_fans_free(context, &fans);
    free_soup(s);
    free(normals.memory);
}

static int set_up(void** state)
{
    es_context_desc desc = es_default_context_desc();
    desc.threads = 2;
    return es_context_create(&desc, (es_context**)state) == ES_OK ? 0 : -1;
}

static int tear_down(void** state)
{
    es_context_destroy(*state);
    return 0;
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        void* context;
        if (set_up(&context)) return 1;
        time_kernels(context);
        return tear_down(&context);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_normals), cmocka_unit_test(normals_scale), cmocka_unit_test(check_skin), cmocka_unit_test(check_morph)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
