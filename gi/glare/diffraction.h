/* What light becomes on its way through a plane that takes some of it away: the power spectrum of the aperture (Ritschel thesis §8.3, 8.4.2), and
 * its colours (§8.4.3).
 *
 * With the distance d to the image eq. 8.3 is the transform of P exp(i pi r² / (lambda d)). An eye that looks sharply takes that phase away with its
 * lens: what is left is its defocus D in dioptres, E = exp(i pi D r² / lambda), and with D = 0 Fraunhofer's diffraction, whose transform is that
 * of a real picture. E is a product of a factor for each column and one for each row. As in the thesis it is made for 575 nm alone, and other
 * wavelengths' spectra are this one's, scaled: pixel k from the middle is light of wavelength lambda that goes k lambda / width radians aside.
 *
 * Colours: wavelengths 380 … 770 nm of equal energy, by the colour-matching functions of Wyman, Sloan and Shirley 2013 (Simple Analytic Approximations
 * to the CIE XYZ Color Matching Functions, the multi-lobe fit of 1931's), to linear Rec.709. A wavelength's negative components are left out, so that
 * no pixel of a spectrum is negative, and each channel is scaled to sum to 1: white light stays white on the whole, and nothing gets brighter or darker. */
#ifndef EARTHSHINE_GI_GLARE_DIFFRACTION_H
#define EARTHSHINE_GI_GLARE_DIFFRACTION_H

#include "gi/fft.h"
#include "gi/glare/aperture.h"

#define ES_GLARE_WAVELENGTH 575e-9f /* m */
enum { ES_GLARE_MAX_WAVELENGTHS = 64, ES_GLARE_LEAST_SIZE = 64, ES_GLARE_MOST_SIZE = 4096 };

/* A power spectrum, |X|²: size × size, frequency (0, 0) at (size / 2, size / 2). Zero-initialised it is none yet. */
typedef struct es_diffraction {
    es_fft fft;
    uint32_t size;
    float width;               /* of the aperture's plane, m: a pixel is ES_GLARE_WAVELENGTH / width radians */
    float* power;
    size_t stride;             /* floats from row to row */
    bool symmetric;            /* as strong at (-k, -l) as at (k, l): without defocus */
    double total;              /* sum of it, more than 0 */
    double paired;             /* the same without row 0 and column 0, which have no partners on the other side; more than 0 */
    void* memory;
    size_t bytes;
} es_diffraction;

/* size of the aperture: a multiple of 64 without prime factors but 2, 3, 5, ES_GLARE_LEAST_SIZE … ES_GLARE_MOST_SIZE (INVALID_ARGUMENT). Without light all is
 * zero but frequency (0, 0), which is 1. `defocus` in dioptres; the phase turns by less than half a turn from pixel to pixel while
 * |defocus| < lambda size / (2 r width), r the pupil's radius: beyond, it folds over. The same bits for any number of threads. */
es_result es_diffraction_update(es_context* context, const es_aperture* aperture, float defocus, es_diffraction* diffraction);
/* Lets the spectrum fade away towards a circle round the middle, as wide as it is, from half of its radius on: the square that the aperture's pixels can tell of is nothing of
 * the eye's, and would show about bright lights. What is left is what colours are made of and sums to 1; `total` stays. */
void es_diffraction_fade(es_context* context, es_diffraction* diffraction);
void es_diffraction_free(es_context* context, es_diffraction* diffraction);

/* ---- colours ---------------------------------------------------------------------------------------------------------------------------- */

/* CIE 1931 colour-matching functions, nm. */
void es_colour_matching(float wavelength, float xyz[3]);
/* Linear Rec.709 of wavelength i of `count`, without its negative components; all of them sum to 1 in each channel. */
void es_spectral_weights(uint32_t count, float weights[][3]);
/* The wavelength in nm: the middle of the i-th of `count` equal parts of 380 … 770. */
float es_spectral_wavelength(uint32_t i, uint32_t count);

/* For one wavelength, which samples of a row or column of a power spectrum a pixel of the picture sums, by what weights: the area below samples joined by
 * straight lines. */
typedef struct es_spectral_band {
    float rgb[3];
    const uint32_t *first, *count; /* for pixels -reach … reach */
    const float* weights;          /* `most` for each */
    uint32_t most;
} es_spectral_band;

/* How a power spectrum becomes pixels of a picture; made anew only when sizes or angles change. Zero-initialised it is none yet. */
typedef struct es_chromatic_blur {
    uint32_t size, wavelengths, most_x, most_y; /* what it was made for */
    float pixels;                   /* of the power spectrum to a pixel of the picture, at ES_GLARE_WAVELENGTH */
    uint32_t reach, reach_x, reach_y;
    es_spectral_band bands[ES_GLARE_MAX_WAVELENGTHS];
    void* memory;
    size_t bytes;
} es_chromatic_blur;

/* A spectrum as the picture's pixels: planes of red, green and blue, (2 reach_x + 1) × (2 reach_y + 1), the middle being the light that goes straight on. Zero-initialised
 * it is none yet. What goes further than the reach is not there: a channel sums to 1 without it. */
typedef struct es_glare_spectrum {
    uint32_t reach_x, reach_y;
    float* at[3];
    size_t stride;             /* floats from row to row, a multiple of 16; zeros after the last column */
    void* memory;
    size_t bytes;
} es_glare_spectrum;

/* `pixel`: the angle of a pixel of the picture, radians. Of spectra that reach further than most_x, most_y pixels the rest is left out. */
es_result es_chromatic_blur_prepare(es_context* context, const es_diffraction* diffraction, float pixel, uint32_t wavelengths, uint32_t most_x, uint32_t most_y, es_chromatic_blur* blur);
void es_chromatic_blur_free(es_context* context, es_chromatic_blur* blur);
es_result es_glare_spectrum_update(es_context* context, const es_diffraction* diffraction, const es_chromatic_blur* blur, es_glare_spectrum* spectrum);
void es_glare_spectrum_free(es_context* context, es_glare_spectrum* spectrum);

/* ---- what the kernel does --------------------------------------------------------------------------------------------------------------- */

typedef struct es_chromatic_job {
    const float* power;
    size_t power_stride;
    float scale;                       /* of it */
    const es_chromatic_blur* blur;
    uint32_t column_begin, column_end; /* of the power spectrum that any pixel reads; multiples of eight */
    bool symmetric;                    /* to the middle: rows after its are made of those before it */
    float* to[3];
    size_t stride;
} es_chromatic_job;

typedef struct es_fade_job { float* power; size_t stride; uint32_t size; float* sums; /* of each row */ } es_fade_job;

/* Floats that it wants as scratch. */
static inline size_t es_chromatic_scratch(uint32_t size, size_t stride) { return 8 * (size + 3 * stride); }

#endif
