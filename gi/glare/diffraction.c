#include "gi/glare/diffraction.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"

/* ---- the power spectrum ----------------------------------------------------------------------------------------------------------------- */

void es_diffraction_free(es_context* context, es_diffraction* d)
{
    es_fft_free(&d->fft);
    es_release(context, d->memory, d->bytes);
    *d = (es_diffraction){0};
}

static es_result resize(es_context* context, uint32_t size, es_diffraction* d)
{
    if (d->size == size) return ES_OK;
    es_diffraction_free(context, d);
    const size_t stride = size + 16, room = es_fft_stride(size) * size, factors = 4 * (size_t)size;
    es_result result = es_fft_create(context, size, size, &d->fft);
    if (result) return result;
    d->bytes = (stride * size + room + factors) * sizeof(float);
    d->memory = es_allocate(context, d->bytes);
    if (!d->memory) {
        es_diffraction_free(context, d);
        return es_context_last_result(context);
    }
    d->size = size;
    d->stride = stride;
    d->power = d->memory;
    return ES_OK;
}

/* exp(i pi D x² / lambda) of the pixels' middles. */
static void phase_factors(uint32_t size, float width, float defocus, float* across, float* down)
{
    for (uint32_t i = 0; i < size; i++) {
        const double x = ((double)i + 0.5 - 0.5 * size) * (double)width / size;
        double turns = (double)defocus * x * x / (2 * (double)ES_GLARE_WAVELENGTH), c, s;
        turns -= (double)(int64_t)turns;
        es_fft_root((uint64_t)((turns < 0 ? turns + 1 : turns) * 4294967296.0) & 0xffffffffu, (uint64_t)1 << 32, &c, &s);
        across[es_fft_at(i)] = down[2 * i] = (float)c;
        across[es_fft_at(i) + ES_FFT_BLOCK] = down[2 * i + 1] = (float)s;
    }
}

es_result es_diffraction_update(es_context* context, const es_aperture* aperture, float defocus, es_diffraction* d)
{
    const uint32_t size = aperture->size;
    if (size < ES_GLARE_LEAST_SIZE || size > ES_GLARE_MOST_SIZE || es_fft_good_width(size) != size || !(aperture->width > 0) || !(es_absf(defocus) <= 100.0f))
        return es_misuse(context, ES_INVALID_ARGUMENT, "an aperture of %u pixels over %g m and %g dioptres: multiples of 64 from %d to %d without prime factors but 2, 3 and 5, more than 0 m and -100 … 100 dioptres are accepted", size, (double)aperture->width, (double)defocus, ES_GLARE_LEAST_SIZE, ES_GLARE_MOST_SIZE);
    es_result result = resize(context, size, d);
    if (result) return result;
    d->width = aperture->width;
    d->symmetric = defocus == 0;
    float* room = d->power + d->stride * size;
    float *across = room + es_fft_stride(size) * size, *down = across + 2 * (size_t)size;
    if (defocus != 0) phase_factors(size, aperture->width, defocus, across, down);
    es_fft_power(&d->fft, aperture->transmittance, size, defocus != 0 ? across : NULL, down, room, d->power, d->stride);
    double lone = 0;
    d->total = 0;
    for (uint32_t y = 0; y < size; y++) {
        float sums[8] = {0};
        const float* row = d->power + y * d->stride;
        for (uint32_t x = 0; x < size; x += 8)
            for (uint32_t k = 0; k < 8; k++) sums[k] += row[x + k];
        double sum = 0;
        for (uint32_t k = 0; k < 8; k++) sum += (double)sums[k];
        d->total += sum;
        lone += y ? (double)row[0] : sum;
    }
    d->paired = d->total - lone;
    if (d->paired > 0) return ES_OK;
    d->power[size / 2 * d->stride + size / 2] = 1.0f;
    d->total = d->paired = 1;
    return ES_OK;
}

typedef struct fade_loop { const es_gi_kernels* kernels; const es_fade_job* job; } fade_loop;

static void fade_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const fade_loop* loop = user;
    loop->kernels->fade(loop->job, begin, end);
}

void es_diffraction_fade(es_context* context, es_diffraction* d)
{
    float* sums = d->power + d->stride * d->size; /* the room of the transform */
    const es_fade_job job = {d->power, d->stride, d->size, sums};
    fade_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job};
    es_parallel_for(context, d->size, 16, fade_rows, &loop);
    d->paired = 0;
    for (uint32_t y = 1; y < d->size; y++) d->paired += (double)sums[y];
    if (d->paired > 0) return;
    d->power[d->size / 2 * d->stride + d->size / 2] = 1.0f;
    d->paired = 1;
}

es_result es_diffraction_image(es_context* context, const es_image* transmittance, float width, float defocus, es_image* power)
{
    *power = (es_image){0};
    if (transmittance->channels != 1 || transmittance->width != transmittance->height)
        return es_misuse(context, ES_INVALID_ARGUMENT, "an aperture of %u × %u pixels and %u channels: a square one of one channel is accepted", transmittance->width, transmittance->height, transmittance->channels);
    const es_aperture aperture = {transmittance->width, width, transmittance->pixels};
    es_diffraction d = {0};
    const es_fp_environment environment = es_fp_enter();
    es_result result = es_diffraction_update(context, &aperture, defocus, &d);
    if (!result) result = es_image_create(context, d.size, d.size, 1, power);
    for (size_t i = 0; !result && i < (size_t)d.size * d.size; i++) power->pixels[i] = (float)((double)d.power[i / d.size * d.stride + i % d.size] / d.total);
    es_diffraction_free(context, &d);
    es_fp_leave(environment);
    return result;
}

/* ---- colours ---------------------------------------------------------------------------------------------------------------------------- */

static float lobe(float wavelength, float middle, float below, float above)
{
    const float t = (wavelength - middle) / (wavelength < middle ? below : above);
    return es_exp(-0.5f * t * t);
}

void es_colour_matching(float w, float xyz[3])
{
    xyz[0] = 1.056f * lobe(w, 599.8f, 37.9f, 31.0f) + 0.362f * lobe(w, 442.0f, 16.0f, 26.7f) - 0.065f * lobe(w, 501.1f, 20.4f, 26.2f);
    xyz[1] = 0.821f * lobe(w, 568.8f, 46.9f, 40.5f) + 0.286f * lobe(w, 530.9f, 16.3f, 31.1f);
    xyz[2] = 1.217f * lobe(w, 437.0f, 11.8f, 36.0f) + 0.681f * lobe(w, 459.0f, 26.0f, 13.8f);
}

float es_spectral_wavelength(uint32_t i, uint32_t count) { return 380.0f + 390.0f * ((float)i + 0.5f) / (float)count; }

void es_spectral_weights(uint32_t count, float weights[][3])
{
    static const float to_rgb[3][3] = {{3.2406f, -1.5372f, -0.4986f}, {-0.9689f, 1.8758f, 0.0415f}, {0.0557f, -0.2040f, 1.0570f}}; /* IEC 61966-2-1 */
    for (int k = 0; k < 3; k++) {
        float sum = 0;
        for (uint32_t i = 0; i < count; i++) {
            float xyz[3];
            es_colour_matching(es_spectral_wavelength(i, count), xyz);
            weights[i][k] = es_maxf(to_rgb[k][0] * xyz[0] + to_rgb[k][1] * xyz[1] + to_rgb[k][2] * xyz[2], 0.0f);
            sum += weights[i][k];
        }
        for (uint32_t i = 0; i < count; i++) weights[i][k] = sum > 0 ? weights[i][k] / sum : 1.0f / (float)count;
    }
}

/* Area below the tent of a sample, left of u. */
static double below_tent(double u)
{
    if (u <= -1) return 0;
    if (u >= 1) return 1;
    return u < 0 ? 0.5 * (1 + u) * (1 + u) : 1 - 0.5 * (1 - u) * (1 - u);
}

static int64_t whole_below(double a)
{
    const int64_t i = (int64_t)a;
    return (double)i > a ? i - 1 : i;
}

void es_chromatic_blur_free(es_context* context, es_chromatic_blur* blur)
{
    es_release(context, blur->memory, blur->bytes);
    *blur = (es_chromatic_blur){0};
}

es_result es_chromatic_blur_prepare(es_context* context, const es_diffraction* d, float pixel, uint32_t wavelengths, uint32_t most_x, uint32_t most_y, es_chromatic_blur* blur)
{
    const float pixels = pixel * d->width / ES_GLARE_WAVELENGTH;
    if (wavelengths < 1 || wavelengths > ES_GLARE_MAX_WAVELENGTHS || !(pixels > 0) || !(pixels < 1e9f))
        return es_misuse(context, ES_INVALID_ARGUMENT, "%u wavelengths and a pixel of %g radians: 1 … %d and more than 0 are accepted", wavelengths, (double)pixel, ES_GLARE_MAX_WAVELENGTHS);
    if (blur->size == d->size && blur->wavelengths == wavelengths && blur->most_x == most_x && blur->most_y == most_y && blur->pixels == pixels) return ES_OK;
    es_chromatic_blur_free(context, blur);
    /* the sample without a partner on the other side is left out */
    const double furthest = d->size / 2;
    const double longest = (double)es_spectral_wavelength(wavelengths - 1, wavelengths) * 1e-9 / (double)ES_GLARE_WAVELENGTH;
    const double reach = furthest * longest / (double)pixels + 1.5;
    const uint32_t most = most_x > most_y ? most_x : most_y;
    *blur = (es_chromatic_blur){.size = d->size, .wavelengths = wavelengths, .most_x = most_x, .most_y = most_y, .pixels = pixels};
    blur->reach = reach < (double)most ? (uint32_t)reach : most;
    blur->reach_x = blur->reach < most_x ? blur->reach : most_x;
    blur->reach_y = blur->reach < most_y ? blur->reach : most_y;
    const uint32_t count = 2 * blur->reach + 1;
    size_t words = 0;
    for (uint32_t i = 0; i < wavelengths; i++) {
        const double scale = (double)pixels * (double)ES_GLARE_WAVELENGTH / ((double)es_spectral_wavelength(i, wavelengths) * 1e-9);
        blur->bands[i].most = scale + 3 < (double)d->size ? (uint32_t)(scale + 3) : d->size;
        words += (size_t)count * (2 + blur->bands[i].most);
    }
    blur->bytes = words * 4;
    blur->memory = es_allocate(context, blur->bytes);
    if (!blur->memory) {
        *blur = (es_chromatic_blur){0};
        return es_context_last_result(context);
    }
    float weights_of[ES_GLARE_MAX_WAVELENGTHS][3];
    es_spectral_weights(wavelengths, weights_of);
    uint32_t* at = blur->memory;
    const int64_t middle = d->size / 2, low = 1, high = d->size - 1;
    for (uint32_t i = 0; i < wavelengths; i++) {
        es_spectral_band* band = &blur->bands[i];
        memcpy(band->rgb, weights_of[i], sizeof band->rgb);
        const double scale = (double)pixels * (double)ES_GLARE_WAVELENGTH / ((double)es_spectral_wavelength(i, wavelengths) * 1e-9);
        uint32_t *first = at, *counts = first + count;
        float* weights = (float*)(void*)(counts + count);
        for (uint32_t o = 0; o < count; o++) {
            const double begin = ((double)o - (double)blur->reach - 0.5) * scale + (double)middle, end = begin + scale;
            int64_t from = whole_below(begin), to = whole_below(end) + 1; /* samples whose tents reach into it */
            if (from < low) from = low;
            if (to > high) to = high;
            uint32_t n = 0;
            for (int64_t k = from; k <= to && n < band->most; k++, n++) weights[(size_t)o * band->most + n] = (float)(below_tent(end - (double)k) - below_tent(begin - (double)k));
            first[o] = n ? (uint32_t)from : 0;
            counts[o] = n;
        }
        band->first = first;
        band->count = counts;
        band->weights = weights;
        at = counts + count + (size_t)count * band->most;
    }
    return ES_OK;
}

/* ---- the picture's spectrum ------------------------------------------------------------------------------------------------------------- */

void es_glare_spectrum_free(es_context* context, es_glare_spectrum* spectrum)
{
    es_release(context, spectrum->memory, spectrum->bytes);
    *spectrum = (es_glare_spectrum){0};
}

typedef struct blur_loop { const es_gi_kernels* kernels; const es_chromatic_job* job; float* scratch; size_t scratch_floats; } blur_loop;

static void groups(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const blur_loop* loop = user;
    loop->kernels->chromatic(loop->job, begin, end, loop->scratch + worker * loop->scratch_floats);
}

es_result es_glare_spectrum_update(es_context* context, const es_diffraction* d, const es_chromatic_blur* blur, es_glare_spectrum* spectrum)
{
    const uint32_t columns = 2 * blur->reach_x + 1, rows = 2 * blur->reach_y + 1, row_groups = ((d->symmetric ? blur->reach_y + 1 : rows) + 7) / 8;
    const size_t stride = (columns + 15) / 16 * 16, plane = stride * rows, bytes = 3 * plane * sizeof(float);
    if (spectrum->bytes != bytes || spectrum->stride != stride) {
        es_glare_spectrum_free(context, spectrum);
        spectrum->memory = es_allocate(context, bytes);
        if (!spectrum->memory) return es_context_last_result(context);
        spectrum->bytes = bytes;
        spectrum->stride = stride;
    }
    spectrum->reach_x = blur->reach_x;
    spectrum->reach_y = blur->reach_y;
    es_chromatic_job job = {.power = d->power, .power_stride = d->stride, .blur = blur, .stride = stride, .symmetric = d->symmetric, .scale = (float)(1 / d->paired), .column_begin = d->size};
    for (int k = 0; k < 3; k++) spectrum->at[k] = job.to[k] = (float*)spectrum->memory + k * plane;
    for (uint32_t i = 0; i < blur->wavelengths; i++)
        for (uint32_t x = blur->reach - blur->reach_x; x <= blur->reach + blur->reach_x; x++) {
            const uint32_t count = blur->bands[i].count[x], first = blur->bands[i].first[x];
            if (!count) continue;
            if (first < job.column_begin) job.column_begin = first;
            if (first + count > job.column_end) job.column_end = first + count;
        }
    job.column_begin = job.column_begin / 8 * 8;
    job.column_end = (job.column_end + 7) / 8 * 8;
    const size_t floats = es_chromatic_scratch(d->size, stride), workers = es_context_workers(context);
    float* scratch = es_allocate_array(context, floats * workers, sizeof *scratch);
    if (!scratch) return es_context_last_result(context);
    blur_loop loop = {es_gi_kernel_table(es_context_isa(context)), &job, scratch, floats};
    es_parallel_for(context, row_groups, 1, groups, &loop);
    es_release(context, scratch, floats * workers * sizeof *scratch);
    return ES_OK;
}
