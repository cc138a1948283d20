/* Fourier transforms: every instruction set against scalar, bit for bit, on lengths of every radix, with guards round what is written.
 *
 * check_fft --time prints milliseconds of each instruction set on one thread instead. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gi/fft.h"
#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/random.h"
#include "tests/guarded_planes.h"

static uint32_t counter;
static uint32_t random_bits(void) { return es_random_u32(37, counter++); }
/* some of them large, some of them zero, either zero */
static float value(void)
{
    const uint32_t kind = random_bits() % 64;
    return kind == 0 ? 0.0f : kind == 1 ? -0.0f : (es_unit_float(random_bits()) - 0.5f) * (kind == 2 ? 1e12f : 1.0f);
}

static plane filled(size_t count)
{
    plane p = new_plane(count);
    for (size_t i = 0; i < count; i++) at(p)[i] = value();
    return p;
}

static void same(plane a, plane b, const char* what)
{
    check_guards(a);
    check_guards(b);
    for (size_t i = 0; i < a.count; i++)
        if (a.memory[GUARD + i] != b.memory[GUARD + i]) fail_msg("%s, float %zu: scalar %.9g, here %.9g", what, i, (double)at(a)[i], (double)at(b)[i]);
}

static const uint32_t sizes[][2] = {{64, 1}, {64, 2}, {128, 3}, {192, 4}, {64, 5}, {320, 6}, {256, 8}, {64, 15}, {512, 16}, {384, 32}, {640, 40}, {960, 64}, {576, 90}};

static void check_columns(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        for (uint32_t kind = ES_FFT_COMPLEX; kind <= ES_FFT_FACTORS; kind++)
            for (uint32_t inverse = 0; inverse < (kind == ES_FFT_FACTORS ? 1 : 2); inverse++) {
                const uint32_t w = sizes[i][0], h = sizes[i][1], strips = kind == ES_FFT_REAL ? w / 16 : w / 8, half = h / 2 + 1;
                es_fft fft;
                assert_int_equal(es_fft_create(context, w, h, &fft), ES_OK);
                const size_t complex_stride = es_fft_stride(w), real_stride = w + 8;
                es_fft_columns_job job = {.axis = &fft.column, .kind = (es_fft_kind)kind, .inverse = inverse};
                const bool real_in = kind == ES_FFT_FACTORS || (kind == ES_FFT_REAL && !inverse), real_out = kind == ES_FFT_REAL && inverse;
                job.from_stride = real_in ? real_stride : complex_stride;
                job.to_stride = real_out ? real_stride : complex_stride;
                job.from_rows = kind == ES_FFT_REAL && inverse ? half : 1 + random_bits() % h;
                job.to_rows = kind == ES_FFT_REAL && !inverse ? half : kind == ES_FFT_FACTORS ? h : 1 + random_bits() % h;
                plane from = filled(job.from_stride * job.from_rows), factors = filled(2 * h), scratch = new_plane(es_fft_column_scratch(&fft.column));
                uint8_t dark[128];
                for (uint32_t s = 0; s < strips; s++) dark[s] = random_bits() % 4 == 0;
                job.from = at(from);
                job.factors = at(factors);
                job.dark = i % 2 ? dark : NULL;
                plane expected = new_plane(job.to_stride * job.to_rows);
                for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
                    if (!(es_isa_available_mask() >> isa & 1)) continue;
                    plane to = isa == ES_ISA_SCALAR ? expected : new_plane(job.to_stride * job.to_rows);
                    job.to = at(to);
                    es_gi_kernel_table((es_isa)isa)->fft_columns(&job, 0, strips, at(scratch));
                    check_guards(scratch);
                    same(expected, to, "columns");
                    if (isa != ES_ISA_SCALAR) free(to.memory);
                }
                free(expected.memory);
                free(from.memory);
                free(factors.memory);
                free(scratch.memory);
                es_fft_free(&fft);
            }
    es_context_destroy(context);
}

static void check_rows(void** state)
{
    (void)state;
    es_context* context;
    assert_int_equal(es_context_create(NULL, &context), ES_OK);
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++)
        for (uint32_t trial = 0; trial < 5; trial++) {
            const uint32_t w = sizes[i][0], h = sizes[i][1], rows = trial == 4 ? h / 2 + 1 : h;
            es_fft fft;
            assert_int_equal(es_fft_create(context, w, h, &fft), ES_OK);
            es_fft_rows_job job = {.axis = &fft.row, .kind = trial == 2 ? ES_FFT_FACTORS : trial == 3 ? ES_FFT_PRODUCT : ES_FFT_COMPLEX, .inverse = trial == 1, .stride = es_fft_stride(w), .height = h, .mirrored = trial == 4, .power_stride = w + 8};
            const size_t count = trial == 2 || trial == 4 ? job.power_stride * h : job.stride * rows;
            plane from = filled(job.stride * rows), factors = filled(2 * w), product = filled(job.stride * rows), scratch = new_plane(es_fft_row_scratch(&fft.row));
            if (trial == 2 || trial == 4) /* what is squared stays near one */
                for (size_t k = 0; k < from.count; k++) at(from)[k] = es_unit_float(random_bits());
            job.from = at(from);
            job.factors = at(factors);
            job.product = at(product);
            plane expected = new_plane(count);
            for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
                if (!(es_isa_available_mask() >> isa & 1)) continue;
                plane to = isa == ES_ISA_SCALAR ? expected : new_plane(count);
                if (trial == 2 || trial == 4) job.power = at(to);
                else job.to = at(to);
                es_gi_kernel_table((es_isa)isa)->fft_rows(&job, 0, rows, at(scratch));
                check_guards(scratch);
                same(expected, to, "rows");
                if (isa != ES_ISA_SCALAR) free(to.memory);
            }
            free(expected.memory);
            free(from.memory);
            free(factors.memory);
            free(product.memory);
            free(scratch.memory);
            es_fft_free(&fft);
        }
    es_context_destroy(context);
}

static void time_all(void)
{
    for (int isa = 0; isa < ES_ISA_COUNT; isa++) {
        if (!(es_isa_available_mask() >> isa & 1)) continue;
        es_context_desc desc = es_default_context_desc();
        desc.threads = 1;
        desc.isa_mask = 1u << isa;
        es_context* context;
        if (es_context_create(&desc, &context) != ES_OK) return;
        enum { N = 1024, TIMES = 9 };
        es_fft fft;
        if (es_fft_create(context, N, N, &fft) != ES_OK) return;
        plane p = filled(es_fft_stride(N) * N);
        for (size_t i = 0; i < p.count; i++) at(p)[i] = es_unit_float(random_bits());
        double best = INFINITY;
        for (int i = 0; i < TIMES; i++) {
            const double start = es_seconds();
            es_fft_complex(&fft, i % 2, at(p), at(p));
            best = fmin(best, es_seconds() - start);
            for (size_t k = 0; k < p.count && i % 2; k++) at(p)[k] *= 1.0f / (N * N);
        }
        printf("%-8s %d x %d complex %8.3f ms\n", es_isa_name((es_isa)isa), N, N, best * 1e3);
        free(p.memory);
        es_fft_free(&fft);
        es_context_destroy(context);
    }
}

int main(int argc, char** argv)
{
    if (argc > 1 && strcmp(argv[1], "--time") == 0) {
        time_all();
        return 0;
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(check_columns), cmocka_unit_test(check_rows)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
