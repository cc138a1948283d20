/* Discrete Fourier transforms of pictures: complex, and real in one direction, of floats.
 *
 * Our own, not a library's. FFTW is the fastest one that is well kept, and it is out for three reasons: it is under the GPL; it chooses among its
 * algorithms by timing them (and with FFTW_ESTIMATE by a guess that differs between its builds and their instruction sets), so that the
 * last bits of a frame would depend on the machine, which the contract of this library forbids; and it would be a second thing to install.
 * KissFFT has a free licence and one algorithm, but has neither threads nor vectors. `earthshine bench fft` measures all three in one sitting: on two cores
 * of a Zen 5 VM, with AVX2 and two threads, 1024² complex took 0.87 ms, FFTW 3.3.10 after FFTW_MEASURE 1.26; with one thread 1.25, KissFFT 19.9.
 *
 * Transforms are X[k] = sum of x[j] exp(-2 pi i j k / n) (inverse: +), without a factor in either direction: there and back is n times as much.
 *
 * A complex picture is stored in blocks of eight pixels of a row: eight real parts, then eight imaginary parts, which is a cache line. Columns
 * are transformed eight side by side, by decimation in frequency in place, radices 8, 4, 2, 3 and 5; a row of n pixels is first transformed as
 * eight interleaved ones of n / 8, the lanes of its blocks, and then across these. A real picture goes as it is: columns 16 s + 0 … 7 are the real
 * parts of a strip whose imaginary parts are columns 16 s + 8 … 15, and what comes out is separated by its symmetry: rows 0 … height / 2
 * remain, the others being their mirror image.
 *
 * Twiddle factors are rounded from double precision, by operations of our own. The relative error (root of the mean square, of random numbers) is
 * below 2e-7 (tests/test_fft.c). Every strip and every row is one worker's, and lanes are vertical: the same bits for any number of
 * threads and any instruction set. */
#ifndef EARTHSHINE_GI_FFT_H
#define EARTHSHINE_GI_FFT_H

#include "gi/gi.h"

enum { ES_FFT_MAX_PASSES = 16, ES_FFT_MAX_LENGTH = 16384, ES_FFT_BLOCK = 8 };

/* One dimension: its passes, the first of which takes the whole length apart. */
typedef struct es_fft_axis {
    uint32_t length;                        /* of the transform of vectors; 1 … ES_FFT_MAX_LENGTH, no prime factors but 2, 3 and 5 */
    uint32_t pass_count;
    uint32_t radix[ES_FFT_MAX_PASSES];
    const float* twiddles[ES_FFT_MAX_PASSES]; /* cos and sin for j = 0 … L / R - 1, q = 1 … R - 1, of -2 pi j q / L; none for the last pass */
    const uint32_t* order;                  /* frequency of the first of what the last pass gives, for each of its runs of R; the others are length / R apart */
    const float* across;                    /* of rows: cos (8), sin (8) for k = 0 … length - 1, of -2 pi b k / (8 length), b the lane; NULL: of columns */
} es_fft_axis;

typedef struct es_fft {
    es_context* context;
    uint32_t width, height;                 /* pixels */
    es_fft_axis column, row;                /* row.length is width / 8 */
    void* memory;                           /* tables, and scratch for each worker */
    size_t bytes;
    float* scratch;
    size_t scratch_floats;                  /* of one worker */
} es_fft;

/* The next that can be transformed: a multiple of 64 for rows; beyond ES_FFT_MAX_LENGTH 0. */
uint32_t es_fft_good_width(uint32_t at_least);
uint32_t es_fft_good_height(uint32_t at_least);
/* INVALID_ARGUMENT for sizes that are not good; OUT_OF_MEMORY, MEMORY_CAP. One transform at a time through one es_fft. */
es_result es_fft_create(es_context* context, uint32_t width, uint32_t height, es_fft* fft);
void es_fft_free(es_fft* fft); /* of zeros, too */
/* cos and sin of 2 pi times part / whole, 0 <= part < whole, rounded from double. */
void es_fft_root(uint64_t part, uint64_t whole, double* cosine, double* sine);

/* Floats from row to row of a complex picture so wide: a little more than it has, as rows a power of two apart would fall into the same sets of a cache. */
static inline size_t es_fft_stride(uint32_t width) { return 2 * (size_t)width + 16; }
/* Where pixel x of a row has its real part; its imaginary part is ES_FFT_BLOCK further. */
static inline size_t es_fft_at(uint32_t x) { return (size_t)(x / ES_FFT_BLOCK) * (2 * ES_FFT_BLOCK) + x % ES_FFT_BLOCK; }

/* Complex pictures have fft->height rows of es_fft_stride(fft->width) floats, 64-byte aligned; half of one rows 0 … height / 2 alone. */
void es_fft_complex(es_fft* fft, bool inverse, const float* from, float* to); /* may be the same */
/* A real picture of `rows` rows of `stride` floats, fft->width of which count; the rows below are zero. `dark`: NULL, or for each strip of 16 columns
 * whether all of it is zero. */
void es_fft_forward_real(es_fft* fft, const float* from, size_t stride, uint32_t rows, const uint8_t* dark, float* half);
/* The first `rows` rows of what comes out; `half` is lost. */
void es_fft_inverse_real(es_fft* fft, float* half, float* to, size_t stride, uint32_t rows);
/* As forward_real, a product by `kernel`, half a picture, and inverse_real; `half` is room for the former's. */
void es_fft_convolve(es_fft* fft, const float* from, size_t stride, uint32_t rows, const uint8_t* dark, const float* kernel, float* half, float* to, size_t to_stride, uint32_t to_rows);
/* |X|² of a real picture times a factor for each of its columns and rows (NULL: without): with factors, `across` has blocks of eight cosines and eight sines, `down`
 * a cosine and a sine for each row, and `room` is a complex picture; without, half of one. Frequency (0, 0) is at (width / 2, height / 2) of `power`, whose rows are `stride` floats. */
void es_fft_power(es_fft* fft, const float* from, size_t from_stride, const float* across, const float* down, float* room, float* power, size_t stride);

/* ---- what the kernels do ---------------------------------------------------------------------------------------------------------------- */

typedef enum es_fft_kind {
    ES_FFT_COMPLEX,
    ES_FFT_REAL,       /* columns: real to half a complex picture, or back */
    ES_FFT_FACTORS,    /* columns: real times a factor for each row, to complex; rows: complex times a factor for each column */
    ES_FFT_PRODUCT,    /* rows: forward, a product, and back */
} es_fft_kind;

typedef struct es_fft_columns_job {
    const es_fft_axis* axis;
    es_fft_kind kind;
    bool inverse;
    const float* from;
    size_t from_stride;
    uint32_t from_rows;     /* the others are zero */
    const uint8_t* dark;    /* for each strip; NULL: none is */
    const float* factors;
    float* to;
    size_t to_stride;
    uint32_t to_rows;       /* the others are not wanted */
} es_fft_columns_job;

typedef struct es_fft_rows_job {
    const es_fft_axis* axis;
    es_fft_kind kind;
    bool inverse;
    const float* from;
    float* to;
    size_t stride;          /* of both, and of `product` */
    const float* factors;
    const float* product;   /* picture */
    float* power;           /* in place of `to`: |X|², frequencies moved by half the width and height */
    size_t power_stride;
    uint32_t height;
    bool mirrored;          /* power: rows are half of a picture, whose other half they are mirrored into */
} es_fft_rows_job;

/* Floats that a kernel wants as scratch: columns, and rows. */
static inline size_t es_fft_column_scratch(const es_fft_axis* axis) { return 32 * (size_t)axis->length + 64; }
static inline size_t es_fft_row_scratch(const es_fft_axis* axis) { return 48 * (size_t)axis->length; }

#endif
