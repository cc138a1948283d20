#include "gi/glare/convolution.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "platform/context.h"

enum { LOAD_ROWS = 32 };

void es_glare_convolution_free(es_context* context, es_glare_convolution* c)
{
    es_fft_free(&c->fft);
    es_release(context, c->memory, c->bytes);
    *c = (es_glare_convolution){0};
}

static uint32_t chunks(const es_glare_convolution* c) { return (c->height + LOAD_ROWS - 1) / LOAD_ROWS; }

static es_result resize(es_context* context, uint32_t width, uint32_t height, uint32_t reach_x, uint32_t reach_y, es_glare_convolution* c)
{
    if (c->memory && c->width == width && c->height == height && c->reach_x == reach_x && c->reach_y == reach_y) return ES_OK;
    es_glare_convolution_free(context, c);
    const uint32_t w = es_fft_good_width(width + reach_x), h = es_fft_good_height(height + reach_y); /* no less than the spectrum, as that reaches no further than the picture */
    if (!w || !h || reach_x >= width || reach_y >= height)
        return es_fail(context, ES_INVALID_ARGUMENT, "glare of %u × %u pixels in a picture of %u × %u: together at most %d in each dimension are accepted, and no more than the picture's", reach_x, reach_y, width, height, ES_FFT_MAX_LENGTH);
    es_result result = es_fft_create(context, w, h, &c->fft);
    if (result) return result;
    c->width = width;
    c->height = height;
    c->reach_x = reach_x;
    c->reach_y = reach_y;
    const size_t half = (es_fft_stride(w) * (h / 2 + 1) + 15) / 16 * 16, light = (size_t)w * height, spread = ((size_t)w * (height + reach_y) + 15) / 16 * 16;
    const size_t prefix = (size_t)(2 * reach_x + 2) * (2 * reach_y + 2), strips = w / ES_GLARE_STRIP;
    const size_t bytes = (4 * half + light + spread) * sizeof(float) + 3 * prefix * sizeof(double) + strips * (2 + chunks(c));
    c->memory = es_allocate(context, bytes);
    if (!c->memory) {
        es_glare_convolution_free(context, c);
        return es_context_last_result(context);
    }
    c->bytes = bytes;
    float* at = c->memory;
    for (int k = 0; k < 3; k++, at += half) c->kernels[k] = at;
    c->half = at;
    c->light = c->half + half;
    c->spread = c->light + light;
    double* sums = (double*)(void*)(c->spread + spread);
    for (int k = 0; k < 3; k++) c->prefix[k] = sums + k * prefix;
    c->dark = (uint8_t*)(sums + 3 * prefix);
    return ES_OK;
}

es_result es_glare_convolution_take(es_context* context, const es_glare_spectrum* s, uint32_t width, uint32_t height, es_glare_convolution* c)
{
    es_result result = resize(context, width, height, s->reach_x, s->reach_y, c);
    if (result) return result;
    const uint32_t columns = 2 * s->reach_x + 1, rows = 2 * s->reach_y + 1, w = c->fft.width, strips = w / ES_GLARE_STRIP;
    uint8_t* dark = c->dark + strips;
    for (uint32_t i = 0; i < strips; i++) dark[i] = i * ES_GLARE_STRIP >= s->stride;
    const float scale = 1.0f / ((float)w * (float)c->fft.height);
    for (int k = 0; k < 3; k++) {
        /* The spectrum's first row and column become 0, so that the picture comes back moved by its reach. Its middle is left out: that light stays, and
         * the less is transformed the less rounding is spread. */
        float* scaled = c->spread;
        const size_t row_floats = s->stride < w ? s->stride : w;
        double* sums = c->prefix[k];
        memset(sums, 0, (columns + 1) * sizeof *sums);
        for (uint32_t y = 0; y < rows; y++) {
            const float* from = s->at[k] + y * s->stride;
            double row = 0, *above = sums + (size_t)y * (columns + 1), *below = above + columns + 1;
            below[0] = 0;
            for (uint32_t x = 0; x < columns; x++) {
                row += y == s->reach_y && x == s->reach_x ? 0 : (double)from[x];
                below[x + 1] = above[x + 1] + row;
            }
            for (size_t x = 0; x < row_floats; x++) scaled[(size_t)y * w + x] = from[x] * scale;
            if (y == s->reach_y) scaled[(size_t)y * w + s->reach_x] = 0;
        }
        es_fft_forward_real(&c->fft, scaled, w, rows, dark, c->kernels[k]);
    }
    return ES_OK;
}

typedef struct convolve_loop { const es_gi_kernels* kernels; const es_glare_load_job* load; const es_glare_finish_job* finish; uint8_t* dark; uint32_t strips, height; } convolve_loop;

static void load_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const convolve_loop* loop = user;
    for (uint32_t chunk = begin; chunk < end; chunk++) {
        const uint32_t last = (chunk + 1) * LOAD_ROWS;
        loop->kernels->glare_load(loop->load, chunk * LOAD_ROWS, last < loop->height ? last : loop->height, loop->dark + (size_t)chunk * loop->strips);
    }
}

static void finish_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const convolve_loop* loop = user;
    loop->kernels->glare_finish(loop->finish, begin, end);
}

void es_glare_convolve(es_context* context, es_glare_convolution* c, const float* const from[3], float* const to[3], uint32_t stride)
{
    const uint32_t w = c->fft.width, strips = w / ES_GLARE_STRIP;
    convolve_loop loop = {.kernels = es_gi_kernel_table(es_context_isa(context)), .dark = c->dark + 2 * (size_t)strips, .strips = strips, .height = c->height};
    for (int k = 0; k < 3; k++) {
        const es_glare_load_job load = {.from = from[k], .from_stride = stride, .width = c->width, .to = c->light, .to_width = w};
        loop.load = &load;
        es_parallel_for(context, chunks(c), 1, load_rows, &loop);
        for (uint32_t i = 0; i < strips; i++) {
            uint8_t dark = 1;
            for (uint32_t chunk = 0; chunk < chunks(c); chunk++) dark &= loop.dark[(size_t)chunk * strips + i];
            c->dark[i] = dark;
        }
        es_fft_convolve(&c->fft, c->light, w, c->height, c->dark, c->kernels[k], c->half, c->spread, w, c->height + c->reach_y);
        const es_glare_finish_job finish = {.from = from[k], .spread = c->spread + (size_t)c->reach_y * w + c->reach_x, .spread_stride = w, .to = to[k], .stride = stride, .width = c->width, .height = c->height, .reach_x = c->reach_x, .reach_y = c->reach_y, .prefix = c->prefix[k]};
        loop.finish = &finish;
        es_parallel_for(context, c->height, 16, finish_rows, &loop);
    }
}
