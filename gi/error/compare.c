/* The plain measures of error. Each row has its own sums, in pixel order, and the rows' are added up in order: the same bits for any
 * number of threads. */
#include "gi/error/flip.h"
#include "platform/context.h"

typedef struct row_sums {
    es_exact_sum squares, relative, absolute, mean, reference_mean;
    double largest;
    uint64_t samples, finite, reference_finite;
} row_sums;

typedef struct compare_job {
    const es_image *a, *b;
    const es_channel_pairs* pairs;
    const uint8_t* mask;
    row_sums* rows;
} compare_job;

static void compare_pixel(const compare_job* job, size_t pixel, row_sums* sums)
{
    const float *p = job->a->pixels + pixel * job->a->channels, *q = job->b->pixels + pixel * job->b->channels;
    for (uint32_t k = 0; k < job->pairs->count; k++) {
        float a = p[job->pairs->a[k]], b = q[job->pairs->b[k]];
        double d = es_difference(a, b), square = d * d;
        es_sum_add(&sums->squares, square);
        es_sum_add(&sums->absolute, __builtin_fabs(d));
        if (d != 0) es_sum_add(&sums->relative, es_is_finite(b) ? square / ((double)b * (double)b + 0.01) : __builtin_inf());
        if (__builtin_fabs(d) > sums->largest) sums->largest = __builtin_fabs(d);
        if (es_is_finite(a)) {
            es_sum_add(&sums->mean, a);
            sums->finite++;
        }
        if (es_is_finite(b)) {
            es_sum_add(&sums->reference_mean, b);
            sums->reference_finite++;
        }
        sums->samples++;
    }
}

static void compare_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const compare_job* job = user;
    const size_t width = job->a->width;
    (void)worker;
    es_fp_environment environment = es_fp_enter_untrapped();
    for (uint32_t y = begin; y < end; y++) {
        row_sums sums = {0};
        for (size_t i = y * width; i < (y + 1) * width; i++)
            if (!job->mask || job->mask[i]) compare_pixel(job, i, &sums);
        job->rows[y] = sums;
    }
    es_fp_leave(environment);
}

static double ratio(const es_exact_sum* sum, uint64_t count) { return count ? es_sum_value(sum) / (double)count : 0; }

static void finish(const row_sums* rows, uint32_t count, es_image_error* error)
{
    row_sums all = {0};
    for (uint32_t y = 0; y < count; y++) {
        es_exact_sum* into[5] = {&all.squares, &all.relative, &all.absolute, &all.mean, &all.reference_mean};
        const es_exact_sum* from[5] = {&rows[y].squares, &rows[y].relative, &rows[y].absolute, &rows[y].mean, &rows[y].reference_mean};
        for (int k = 0; k < 5; k++) {
            es_sum_add(into[k], from[k]->sum);
            es_sum_add(into[k], from[k]->lost);
        }
        if (rows[y].largest > all.largest) all.largest = rows[y].largest;
        all.samples += rows[y].samples;
        all.finite += rows[y].finite;
        all.reference_finite += rows[y].reference_finite;
    }
    error->samples = all.samples;
    error->max = all.largest;
    error->mean = ratio(&all.mean, all.finite);
    error->reference_mean = ratio(&all.reference_mean, all.reference_finite);
    error->rmse = __builtin_sqrt(ratio(&all.squares, all.samples));
    error->relrmse = es_relative_to_mean(error->rmse, error->reference_mean);
    error->relmse = ratio(&all.relative, all.samples);
    error->rell1 = es_relative_to_mean(ratio(&all.absolute, all.samples), error->reference_mean);
}

static double mean_flip(const float* errors, uint32_t width, uint32_t height, const uint8_t* mask)
{
    double sum = 0;
    uint64_t count = 0;
    for (uint32_t y = 0; y < height; y++) {
        double row = 0;
        for (size_t i = (size_t)y * width; i < (size_t)(y + 1) * width; i++)
            if (!mask || mask[i]) {
                row += (double)errors[i];
                count++;
            }
        sum += row;
    }
    return count ? sum / (double)count : 0;
}

static es_result add_flip(es_context* context, const es_image* a, const es_image* b, const es_channel_pairs* pairs, const es_error_desc* desc, es_image_error* error)
{
    const size_t pixels = (size_t)a->width * a->height;
    float* errors = es_allocate_array(context, pixels, sizeof *errors);
    if (!errors) return es_context_last_result(context);
    es_result result = es_flip(context, a, b, pairs, false, desc, errors);
    if (!result) error->flip = mean_flip(errors, a->width, a->height, desc->mask);
    if (!result && !desc->display_referred) {
        result = es_flip(context, a, b, pairs, true, desc, errors);
        if (!result) error->hdr_flip = mean_flip(errors, a->width, a->height, desc->mask);
    }
    es_release(context, errors, pixels * sizeof *errors);
    return result;
}

es_result es_image_compare(es_context* context, const es_image* a, const es_image* b, const es_error_desc* desc, es_image_error* error)
{
    static const es_error_desc everything = {.flip = true};
    if (!context || !error) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_compare needs a context and a place for the error");
    if (!desc) desc = &everything;
    *error = (es_image_error){.flip = __builtin_nan(""), .hdr_flip = __builtin_nan("")};
    es_channel_pairs pairs;
    es_result result = es_pair_channels(context, a, b, &pairs);
    if (result) return result;
    row_sums* rows = es_allocate_array(context, a->height, sizeof *rows);
    if (!rows) return es_context_last_result(context);
    es_fp_environment environment = es_fp_enter_untrapped();
    compare_job job = {a, b, &pairs, desc->mask, rows};
    es_parallel_for(context, a->height, 8, compare_rows, &job);
    finish(rows, a->height, error);
    es_release(context, rows, a->height * sizeof *rows);
    if (desc->flip && pairs.has_colour) result = add_flip(context, a, b, &pairs, desc, error);
    es_fp_leave(environment);
    return result;
}
