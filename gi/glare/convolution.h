/* A picture as it is seen past what the spectrum of the eye's glare makes of each of its points (Ritschel thesis §8.4.4).
 *
 * Light that leaves the picture: what a point would send past the border stays at that point. So the sum of each channel over the picture is what it was, whatever
 * the spectrum, nothing comes back from the other side, and a picture that is the same everywhere stays so where the spectrum is symmetric.
 * What would come in from outside is not known, and is taken to be what goes out.
 *
 * Pixels that are no number, or infinite, count as black and stay what they are; negative ones count as black and become at least 0; above
 * ES_GLARE_MOST they count as that. Nothing finite becomes anything else. What a point keeps to itself is not transformed: rounding, which transforms spread over the
 * picture, is that of the light that does go elsewhere. */
#ifndef EARTHSHINE_GI_GLARE_CONVOLUTION_H
#define EARTHSHINE_GI_GLARE_CONVOLUTION_H

#include "gi/glare/diffraction.h"

#define ES_GLARE_MOST 1e9f /* W/(m² sr) */

/* What convolves pictures of one size by spectra of one reach; zero-initialised it is none yet. The transform of the spectrum is kept. */
typedef struct es_glare_convolution {
    es_fft fft;
    uint32_t width, height, reach_x, reach_y;
    float* kernels[3];         /* transforms of the spectrum, in each channel, divided by the size of the transform */
    float* half;               /* room for a channel's */
    float* light;              /* of a channel, rows of fft.width floats */
    float* spread;             /* and as it comes back: moved by reach_x and reach_y */
    uint8_t* dark;             /* strips of 16 columns: of the channel, of the spectrum, and of each chunk of rows */
    double* prefix[3];         /* sums of the spectrum but its middle left of and above each pixel, (2 reach_x + 2) × (2 reach_y + 2) */
    void* memory;
    size_t bytes;
} es_glare_convolution;

/* Takes a spectrum, for pictures of width × height pixels. Transforms need products of 2, 3 and 5 no smaller than the picture and the reach
 * together, up to ES_FFT_MAX_LENGTH (INVALID_ARGUMENT). OUT_OF_MEMORY, MEMORY_CAP: there is no convolution then. */
es_result es_glare_convolution_take(es_context* context, const es_glare_spectrum* spectrum, uint32_t width, uint32_t height, es_glare_convolution* convolution);
/* Rows of `stride` floats, a multiple of eight; from and to may be the same. The same bits for any number of threads. */
void es_glare_convolve(es_context* context, es_glare_convolution* convolution, const float* const from[3], float* const to[3], uint32_t stride);
void es_glare_convolution_free(es_context* context, es_glare_convolution* convolution);

/* ---- what the kernels do ---------------------------------------------------------------------------------------------------------------- */

enum { ES_GLARE_STRIP = 16 };

/* One channel's light: what counts of it, and which strips of columns have none. */
typedef struct es_glare_load_job {
    const float* from;
    uint32_t from_stride, width; /* readable up to the next multiple of eight after width */
    float* to;                 /* rows of to_width floats, a multiple of 16; zeros after the picture */
    uint32_t to_width;
} es_glare_load_job;

/* What a channel becomes: what spreads, and what stays. */
typedef struct es_glare_finish_job {
    const float* from;         /* may be `to` */
    const float* spread;       /* pixel (0, 0) */
    size_t spread_stride;
    float* to;
    uint32_t stride, width, height, reach_x, reach_y;
    const double* prefix;
} es_glare_finish_job;

#endif
