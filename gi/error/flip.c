/* ꟻLIP over a picture: filters, exposures and tiles; what is done for each pixel is in kernels/flip.c. */
#include "gi/error/flip.h"

#include "gi/error/error.h"
#include "gi/kernel_table.h"
#include "platform/context.h"
#include "platform/maths.h"

/* ---- filters ------------------------------------------------------------------------------------------------------------------------ */

static uint32_t round_up(double x)
{
    uint32_t whole = (uint32_t)x;
    return whole + ((double)whole < x);
}

/* exp(-(pi k / ppd)² / b): a Gaussian of the contrast sensitivity, over k pixels, without its factor */
static double contrast_gauss(uint32_t k, double ppd, double b)
{
    const double pi = 3.14159265358979323846;
    double angle = (double)k / ppd;
    return (double)es_exp((float)(-pi * pi * angle * angle / b));
}

/* The weights of one Gaussian over both sides and the middle add up to one. */
static void fill_gauss(float* weights, uint32_t radius, double ppd, double b)
{
    double sum = 0;
    for (uint32_t k = 0; k <= radius; k++) sum += (k ? 2 : 1) * contrast_gauss(k, ppd, b);
    for (uint32_t k = 0; k <= radius; k++) weights[k] = (float)(contrast_gauss(k, ppd, b) / sum);
}

/* Of two Gaussians, as the square of one dimension's: their parts keep the ratio that they have in two. */
static void fill_blue_yellow(float (*weights)[ES_FLIP_MAX_RADIUS + 1], uint32_t radius, double ppd)
{
    static const double a[2] = {34.1, 13.5}, b[2] = {0.04, 0.025};
    double sum[2] = {0}, factor[2];
    for (int i = 0; i < 2; i++) {
        for (uint32_t k = 0; k <= radius; k++) sum[i] += (k ? 2 : 1) * contrast_gauss(k, ppd, b[i]);
        factor[i] = a[i] * __builtin_sqrt(1 / b[i]); /* both have sqrt(pi) as well */
    }
    double total = factor[0] * sum[0] * sum[0] + factor[1] * sum[1] * sum[1];
    for (int i = 0; i < 2; i++)
        for (uint32_t k = 0; k <= radius; k++) weights[i][k] = (float)(contrast_gauss(k, ppd, b[i]) * __builtin_sqrt(factor[i] / total));
}

/* A Gaussian as wide as the features and its derivatives: positive weights add up to 1, negative ones to -1. */
static void fill_features(es_flip_filters* f, double deviation, uint32_t radius)
{
    double gauss[ES_FLIP_MAX_RADIUS + 1] = {0}, edge[ES_FLIP_MAX_RADIUS + 1] = {0}, point[ES_FLIP_MAX_RADIUS + 1] = {0};
    double gauss_sum = 0, edge_sum = 0, above = 0, below = 0;
    for (uint32_t k = 0; k <= radius; k++) {
        double t = (double)k / deviation;
        int sides = k ? 2 : 1;
        gauss[k] = (double)es_exp((float)(-0.5 * t * t));
        edge[k] = (double)k * gauss[k];
        point[k] = (t * t - 1) * gauss[k];
        gauss_sum += sides * gauss[k];
        edge_sum += edge[k];
        *(point[k] > 0 ? &above : &below) += sides * point[k];
    }
    for (uint32_t k = 0; k <= f->radius; k++) {
        f->gauss[k] = (float)(gauss[k] / gauss_sum);
        f->edge[k] = (float)(edge[k] / edge_sum);
        f->point[k] = (float)(point[k] / (point[k] > 0 ? above : -below));
    }
}

static es_result fill_filters(es_context* context, double ppd, es_flip_filters* f)
{
    /* three standard deviations of the widest Gaussian; a feature is 0.082 degrees wide */
    const double pi = 3.14159265358979323846, deviation = 0.5 * 0.082 * ppd;
    double radius = 3 * __builtin_sqrt(0.04 / (2 * pi * pi)) * ppd;
    if (!(ppd >= 10 && ppd <= 450))
        return es_fail(context, ES_INVALID_ARGUMENT, "FLIP for %g pixels per degree was asked for; 10 to 450 are accepted", ppd);
    *f = (es_flip_filters){.radius = round_up(radius)};
    fill_gauss(f->achromatic, f->radius, ppd, 0.0047);
    fill_gauss(f->red_green, f->radius, ppd, 0.0053);
    fill_blue_yellow(f->blue_yellow, f->radius, ppd);
    fill_features(f, deviation, round_up(3 * deviation));
    return ES_OK;
}

/* ---- exposures of radiance (Andersson et al. 2021, section 4.1) --------------------------------------------------------------------- */

enum { MAX_EXPOSURES = 256 };

static float usable(float x) { return es_is_finite(x) && x > 0 ? x : 0; }

static float luminance(const es_image* b, const es_channel_pairs* pairs, size_t pixel)
{
    const float* p = b->pixels + pixel * b->channels;
    double light = 0.2126 * (double)usable(p[pairs->b[pairs->colour[0]]]) + 0.7152 * (double)usable(p[pairs->b[pairs->colour[1]]]) +
        0.0722 * (double)usable(p[pairs->b[pairs->colour[2]]]);
    return (float)light;
}

static uint32_t bits_of(float x)
{
    union { float f; uint32_t u; } bits = {x};
    return bits.u;
}

/* The value at place `rank` of the sorted luminances above `low`: floats that are not negative are ordered as their bits are, so a
 * histogram of eleven bits after the other finds it. */
static float luminance_of_rank(const es_image* b, const es_channel_pairs* pairs, bool lit_only, uint64_t rank)
{
    static const uint32_t shifts[3] = {21, 10, 0}, widths[3] = {11, 11, 10};
    uint32_t found = 0, known = 0;
    for (int pass = 0; pass < 3; pass++) {
        uint64_t histogram[1 << 11] = {0};
        for (size_t i = 0; i < (size_t)b->width * b->height; i++) {
            uint32_t bits = bits_of(luminance(b, pairs, i));
            if ((bits & known) == found && (bits || !lit_only)) histogram[bits >> shifts[pass] & ((1u << widths[pass]) - 1)]++;
        }
        uint32_t bin = 0;
        while (rank >= histogram[bin]) rank -= histogram[bin++];
        found |= bin << shifts[pass];
        known |= ((1u << widths[pass]) - 1) << shifts[pass];
    }
    union { uint32_t u; float f; } value = {found};
    return value.f;
}

/* Exposures, as factors, from where the brightest luminance of the reference to where the median is shown as 0.85 by the tone map; one
 * step is about one stop. Where more than half is black, the median is that of the rest; an all black reference is taken as it is. */
static uint32_t choose_exposures(const es_image* b, const es_channel_pairs* pairs, float scales[MAX_EXPOSURES])
{
    const double t = 0.85, p = 0.36 * 2.51 - t * 0.36 * 2.43, q = 0.6 * 0.03 - t * 0.6 * 0.59, r = -t * 0.14;
    const double bright = (-q + __builtin_sqrt(q * q - 4 * p * r)) / (2 * p);
    uint64_t pixels = (uint64_t)b->width * b->height, lit = 0;
    float highest = 0;
    for (size_t i = 0; i < pixels; i++) {
        float light = luminance(b, pairs, i);
        highest = light > highest ? light : highest;
        lit += light > 0;
    }
    if (!lit) {
        scales[0] = 1;
        return 1;
    }
    float middle = luminance_of_rank(b, pairs, false, pixels / 2);
    if (pixels % 2 == 0) middle = 0.5f * middle + 0.5f * luminance_of_rank(b, pairs, false, pixels / 2 - 1);
    if (!(middle > 0)) middle = luminance_of_rank(b, pairs, true, lit / 2);
    /* outside of 120 stops a product with a float would leave its range */
    double first = (double)es_clampf(es_log2((float)(bright / (double)highest)), -120, 120);
    double last = (double)es_clampf(es_log2((float)(bright / (double)middle)), -120, 120);
    uint32_t count = round_up(last - first > 0 ? last - first : 0);
    count = count < 2 ? 2 : count;
    for (uint32_t i = 0; i < count; i++) scales[i] = es_exp2((float)(first + (last - first) * (double)i / (double)(count - 1)));
    return count;
}

/* ---- tiles -------------------------------------------------------------------------------------------------------------------------- */

typedef struct flip_loop {
    es_flip_job job;
    const es_image *a, *b;
    const es_channel_pairs* pairs;
    const es_gi_kernels* kernels;
    uint32_t columns; /* of tiles */
    float* scratch;   /* one after the other for each worker */
    size_t scratch_floats;
} flip_loop;

static es_flip_scratch divide_scratch(const flip_loop* loop, uint32_t worker)
{
    uint32_t side = ES_FLIP_TILE + 2 * loop->job.filters->radius, stride = (side + 7) / 8 * 8 + 8;
    es_flip_scratch s = {.rows = side, .stride = stride};
    float* next = loop->scratch + worker * loop->scratch_floats;
    for (int c = 0; c < 3; c++) {
        s.row[c] = next;
        next += stride;
        for (int picture = 0; picture < 2; picture++) {
            s.rgb[picture][c] = next;
            next += (size_t)side * stride;
        }
    }
    for (int k = 0; k < 7; k++)
        for (int picture = 0; picture < 2; picture++) {
            s.filtered[picture][k] = next;
            next += (size_t)side * ES_FLIP_TILE;
        }
    return s;
}

static size_t scratch_floats(uint32_t radius)
{
    size_t side = ES_FLIP_TILE + 2 * radius, stride = (side + 7) / 8 * 8 + 8;
    return 3 * stride + 6 * side * stride + 14 * side * ES_FLIP_TILE;
}

/* The tile and its border; what lies outside of the picture is its nearest pixel. */
static void load_tile(const flip_loop* loop, uint32_t x, uint32_t y, const es_flip_scratch* s)
{
    const es_image* pictures[2] = {loop->a, loop->b};
    const uint32_t* channels[2] = {loop->pairs->a, loop->pairs->b};
    const int32_t radius = (int32_t)loop->job.filters->radius, right = (int32_t)loop->job.width - 1, bottom = (int32_t)loop->job.height - 1;
    for (int picture = 0; picture < 2; picture++)
        for (uint32_t row = 0; row < s->rows; row++) {
            int32_t from_y = (int32_t)(y + row) - radius;
            from_y = from_y < 0 ? 0 : from_y > bottom ? bottom : from_y;
            for (uint32_t column = 0; column < s->stride; column++) {
                int32_t from_x = (int32_t)(x + column) - radius;
                from_x = from_x < 0 ? 0 : from_x > right ? right : from_x;
                const float* p = pictures[picture]->pixels + ((size_t)from_y * loop->job.width + (size_t)from_x) * pictures[picture]->channels;
                for (int c = 0; c < 3; c++) s->rgb[picture][c][(size_t)row * s->stride + column] = usable(p[channels[picture][loop->pairs->colour[c]]]);
            }
        }
}

static void flip_tiles(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const flip_loop* loop = user;
    es_flip_scratch scratch = divide_scratch(loop, worker);
    for (uint32_t i = begin; i < end; i++) {
        uint32_t x = i % loop->columns * ES_FLIP_TILE, y = i / loop->columns * ES_FLIP_TILE;
        es_fp_environment environment = es_fp_enter_untrapped();
        load_tile(loop, x, y, &scratch);
        es_fp_leave(environment);
        loop->kernels->flip(&loop->job, x, y, &scratch);
    }
}

static void mark_not_finite(const flip_loop* loop)
{
    for (size_t i = 0; i < (size_t)loop->job.width * loop->job.height; i++)
        for (int c = 0; c < 3; c++) {
            float a = loop->a->pixels[i * loop->a->channels + loop->pairs->a[loop->pairs->colour[c]]];
            float b = loop->b->pixels[i * loop->b->channels + loop->pairs->b[loop->pairs->colour[c]]];
            if ((!es_is_finite(a) || !es_is_finite(b)) && !es_same_value(a, b)) loop->job.errors[i] = 1;
        }
}

es_result es_flip(es_context* context, const es_image* a, const es_image* b, const es_channel_pairs* pairs, bool hdr, const es_error_desc* desc, float* errors)
{
    es_flip_filters filters;
    float scales[MAX_EXPOSURES] = {1};
    /* pixels in the width of a screen seen from as far as it is wide, times degrees to radians */
    double ppd = desc && desc->pixels_per_degree != 0 ? (double)desc->pixels_per_degree : 3840 * 3.14159265358979323846 / 180;
    es_result result = fill_filters(context, ppd, &filters);
    if (result) return result;
    flip_loop loop = {.job = {&filters, a->width, a->height, .scales = scales, .scale_count = 1, .errors = errors}, .a = a, .b = b, .pairs = pairs};
    loop.job.tone = hdr ? ES_FLIP_ACES : desc && desc->display_referred ? ES_FLIP_LINEAR : ES_FLIP_REINHARD;
    loop.job.white = es_default_renderer_settings().white;
    if (hdr) loop.job.scale_count = choose_exposures(b, pairs, scales);
    loop.kernels = es_gi_kernel_table(es_context_isa(context));
    loop.columns = (a->width + ES_FLIP_TILE - 1) / ES_FLIP_TILE;
    loop.scratch_floats = scratch_floats(filters.radius);
    size_t workers = es_context_workers(context);
    loop.scratch = es_allocate_array(context, workers * loop.scratch_floats, sizeof(float));
    if (!loop.scratch) return es_context_last_result(context);
    es_parallel_for(context, loop.columns * ((a->height + ES_FLIP_TILE - 1) / ES_FLIP_TILE), 1, flip_tiles, &loop);
    mark_not_finite(&loop);
    es_release(context, loop.scratch, workers * loop.scratch_floats * sizeof(float));
    return ES_OK;
}
