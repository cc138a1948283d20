/* `bench fft`: Fourier transforms of pictures beside FFTW's and KissFFT's, for the choice that gi/fft.h tells of.
 *
 * FFTW plans with FFTW_MEASURE and two threads, KissFFT has one; what is compared is the faster of FFTW's transforms, in place or out of it, without its
 * planning. Ours reads and writes its own layout (gi/fft.h), which is what its callers have their pictures in. */
#include "bench.h"

#include <math.h>
#include <stdlib.h>

enum { SIZES = 3, FIGURES = 3 * SIZES, MAX_ROUNDS = 50, LEAST = 256 };
#define FFTW "FFTW 3.3, 2 threads"
static const bench_row table[FIGURES] = {
    {"fft-256", "complex, 256 × 256", "ms", FFTW, BENCH_RATIO_AT_LEAST, 1 / 3.0, 1 / 1.2},
    {"fft-512", "complex, 512 × 512", "ms", FFTW, BENCH_RATIO_AT_LEAST, 1 / 3.0, 1 / 1.2},
    {"fft-1024", "complex, 1024 × 1024", "ms", FFTW, BENCH_RATIO_AT_LEAST, 1 / 3.0, 1 / 1.2},
    {"fft-real-256", "real to half a complex picture, 256 × 256", "ms", FFTW, BENCH_NONE, 0, 0},
    {"fft-real-512", "real to half a complex picture, 512 × 512", "ms", FFTW, BENCH_NONE, 0, 0},
    {"fft-real-1024", "real to half a complex picture, 1024 × 1024", "ms", FFTW, BENCH_NONE, 0, 0},
    {"fft-kiss-256", "complex, 256 × 256, one thread", "ms", "KissFFT", BENCH_NONE, 0, 0},
    {"fft-kiss-512", "complex, 512 × 512, one thread", "ms", "KissFFT", BENCH_NONE, 0, 0},
    {"fft-kiss-1024", "complex, 1024 × 1024, one thread", "ms", "KissFFT", BENCH_NONE, 0, 0},
};

size_t bench_fft_rows(bench_row* rows, size_t capacity) { return bench_copy_rows(table, FIGURES, rows, capacity); }

static double time_transform(uint32_t n, uint32_t threads, bool real)
{
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = threads;
    es_context* context;
    double milliseconds = NAN;
    if (es_context_create(&desc, &context) != ES_OK) return NAN;
    if (es_fft_measure(context, n, n, real, n > 512 ? 15 : 64, &milliseconds) != ES_OK) milliseconds = NAN;
    es_context_destroy(context);
    return milliseconds;
}

static double peer_figure(bench_peer* peer, int figure)
{
    const int n = LEAST << figure % SIZES;
    char name[3][96];
    snprintf(name[0], sizeof name[0], "fftw c2c %d^2 out of place", n);
    snprintf(name[1], sizeof name[1], "fftw c2c %d^2 in place", n);
    if (figure < SIZES) return fmin(bench_peer_value(peer, name[0]), bench_peer_value(peer, name[1]));
    snprintf(name[2], sizeof name[2], figure < 2 * SIZES ? "fftw r2c %d^2" : "kissfft c2c %d^2", n);
    return bench_peer_value(peer, name[2]);
}

static bool run_peer(bench_peer* peer, uint32_t threads)
{
    char text[16];
    snprintf(text, sizeof text, "%u", threads);
    const char* arguments[] = {text, NULL};
    return bench_peer_run_program(peer, 0, arguments, NULL);
}

int bench_fft(const bench_options* options)
{
    bench_row rows[FIGURES];
    bench_fft_rows(rows, FIGURES);
    bench_peer* many = calloc(1, sizeof *many);
    bench_peer* one = calloc(1, sizeof *one);
    if (!many || !one) {
        free(many);
        free(one);
        return demo_refuse("out of memory");
    }
    static double values[FIGURES][MAX_ROUNDS];
    const bool with_peer = bench_peer_open(many, BENCH_FFT, !options->no_peer) && bench_peer_open(one, BENCH_FFT, true);
    if (!with_peer) fprintf(stderr, "earthshine: %s\n", many->why);
    for (uint32_t round = 0; round < options->runs; round++) {
        fprintf(stderr, "round %u of %u\n", round + 1, options->runs);
        for (int i = 0; i < FIGURES; i++)
            if (bench_wants(options, rows[i].id)) values[i][round] = time_transform(LEAST << i % SIZES, i < 2 * SIZES ? options->threads : 1, i / SIZES == 1);
        /* with one thread it prints KissFFT's figures as well, and FFTW's, which are not asked for here */
        if (with_peer && (!run_peer(many, options->threads) || !run_peer(one, 1))) fprintf(stderr, "earthshine: %s%s\n", many->why, one->why);
    }
    bench_row shown[FIGURES];
    size_t count = 0;
    for (int i = 0; i < FIGURES; i++) {
        if (!bench_wants(options, rows[i].id)) continue;
        rows[i].value = bench_median(values[i], options->runs);
        rows[i].peer_value = with_peer ? peer_figure(i < 2 * SIZES ? many : one, i) : NAN;
        rows[i].ratio = rows[i].peer_value / rows[i].value;
        if (!with_peer) snprintf(rows[i].note, sizeof rows[i].note, "%s", many->why);
        shown[count++] = rows[i];
    }
    bench_print(shown, count);
    bench_report report = {.name = "fft", .title = "Fourier transforms beside FFTW and KissFFT", .about = "Ours and theirs, turn by turn in one sitting; medians over the rounds. FFTW's planning is not counted."};
    es_context* context;
    es_context_desc desc = es_default_context_desc();
    desc.logger = demo_logger();
    desc.threads = options->threads;
    int code = es_context_create(&desc, &context) == ES_OK ? DEMO_OK : demo_refuse("out of memory");
    if (code == DEMO_OK) {
        code = bench_report_write(&report, options, shown, count, context);
        es_context_destroy(context);
    }
    bench_peer_close(many);
    bench_peer_close(one);
    free(many);
    free(one);
    return code;
}
