/* Flicker: the error of what changes from frame to frame. A picture that is wrong in the same way in every frame has none. */
#include "gi/error/error.h"
#include "platform/context.h"

typedef struct row_sums {
    es_exact_sum error, change; /* squares */
    es_exact_sum reference;     /* of finite values */
    uint64_t finite;
} row_sums;

struct es_flicker {
    es_context* context;
    uint32_t width, height, channels; /* of the pictures, and how many are compared; 0 before the first */
    float* last[2];                   /* what is compared of the last frame of A and of B */
    size_t bytes;                     /* of each */
    row_sums* rows;
    uint64_t frames, worst_frame;
    double worst; /* mean square */
    row_sums total;
};

typedef struct frame_job {
    es_flicker* flicker;
    const es_image *a, *b;
    const es_channel_pairs* pairs;
} frame_job;

/* The change of A less the change of B. What is not finite is right only where both pictures agree in both frames. */
static double change_error(float a, float last_a, float b, float last_b)
{
    if (es_is_finite(a) && es_is_finite(last_a) && es_is_finite(b) && es_is_finite(last_b))
        return ((double)a - (double)last_a) - ((double)b - (double)last_b);
    return es_same_value(a, b) && es_same_value(last_a, last_b) ? 0 : __builtin_inf();
}

static void add_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const frame_job* job = user;
    es_flicker* f = job->flicker;
    (void)worker;
    es_fp_environment environment = es_fp_enter_untrapped();
    for (uint32_t y = begin; y < end; y++) {
        row_sums sums = {0};
        for (size_t i = (size_t)y * f->width; i < (size_t)(y + 1) * f->width; i++)
            for (uint32_t k = 0; k < f->channels; k++) {
                float a = job->a->pixels[i * job->a->channels + job->pairs->a[k]], b = job->b->pixels[i * job->b->channels + job->pairs->b[k]];
                float *last_a = f->last[0] + i * f->channels + k, *last_b = f->last[1] + i * f->channels + k;
                if (f->frames) {
                    double error = change_error(a, *last_a, b, *last_b), change = es_difference(b, *last_b);
                    es_sum_add(&sums.error, error * error);
                    es_sum_add(&sums.change, change * change);
                }
                if (es_is_finite(b)) {
                    es_sum_add(&sums.reference, b);
                    sums.finite++;
                }
                *last_a = a;
                *last_b = b;
            }
        f->rows[y] = sums;
    }
    es_fp_leave(environment);
}

static void add_sum(es_exact_sum* to, const es_exact_sum* sum)
{
    es_sum_add(to, sum->sum);
    es_sum_add(to, sum->lost);
}

es_result es_flicker_create(es_context* context, es_flicker** flicker)
{
    if (!context || !flicker) return es_misuse(context, ES_INVALID_ARGUMENT, "es_flicker_create needs a context and a place for the result");
    es_flicker* made = es_allocate_zero(context, sizeof *made);
    *flicker = made;
    if (!made) return es_context_last_result(context);
    made->context = context;
    es_context_count_object(context, 1);
    return ES_OK;
}

static void free_frames(es_flicker* f)
{
    for (int i = 0; i < 2; i++) {
        es_release(f->context, f->last[i], f->bytes);
        f->last[i] = NULL;
    }
    es_release(f->context, f->rows, f->height * sizeof *f->rows);
    f->rows = NULL;
}

void es_flicker_destroy(es_flicker* flicker)
{
    if (!flicker) return;
    es_context* context = flicker->context;
    free_frames(flicker);
    es_release(context, flicker, sizeof *flicker);
    es_context_count_object(context, -1);
}

static es_result begin(es_flicker* f, const es_image* a, uint32_t channels)
{
    f->height = a->height;
    f->bytes = (size_t)a->width * a->height * channels * sizeof(float);
    bool all = (f->last[0] = es_allocate(f->context, f->bytes)) && (f->last[1] = es_allocate(f->context, f->bytes)) &&
        (f->rows = es_allocate_array(f->context, a->height, sizeof *f->rows));
    if (!all) {
        free_frames(f);
        return es_context_last_result(f->context);
    }
    f->width = a->width;
    f->channels = channels;
    return ES_OK;
}

es_result es_flicker_add(es_flicker* flicker, const es_image* a, const es_image* b)
{
    if (!flicker) return ES_INVALID_ARGUMENT;
    es_flicker* f = flicker;
    es_channel_pairs pairs;
    es_result result = es_pair_channels(f->context, a, b, &pairs);
    if (result) return result;
    if (!f->rows && (result = begin(f, a, pairs.count)) != ES_OK) return result;
    if (a->width != f->width || a->height != f->height || pairs.count != f->channels)
        return es_fail(f->context, ES_INVALID_ARGUMENT, "frame %llu is %u x %u with %u channels to compare, those before it are %u x %u with %u",
            (unsigned long long)f->frames, a->width, a->height, pairs.count, f->width, f->height, f->channels);
    es_fp_environment environment = es_fp_enter_untrapped();
    frame_job job = {f, a, b, &pairs};
    es_parallel_for(f->context, f->height, 8, add_rows, &job);
    row_sums frame = {0};
    for (uint32_t y = 0; y < f->height; y++) {
        add_sum(&frame.error, &f->rows[y].error);
        add_sum(&frame.change, &f->rows[y].change);
        add_sum(&frame.reference, &f->rows[y].reference);
        frame.finite += f->rows[y].finite;
    }
    add_sum(&f->total.error, &frame.error);
    add_sum(&f->total.change, &frame.change);
    add_sum(&f->total.reference, &frame.reference);
    f->total.finite += frame.finite;
    double mean = es_sum_value(&frame.error) / ((double)f->width * f->height * f->channels);
    if (f->frames == 1 || (f->frames > 1 && mean > f->worst)) {
        f->worst = mean;
        f->worst_frame = f->frames;
    }
    f->frames++;
    es_fp_leave(environment);
    return ES_OK;
}

es_flicker_error es_flicker_result(const es_flicker* flicker)
{
    const double unknown = __builtin_nan("");
    es_flicker_error error = {.flicker = unknown, .worst = unknown, .change = unknown};
    if (!flicker) return error;
    const es_flicker* f = flicker;
    error.frames = f->frames;
    if (f->frames < 2) return error;
    es_fp_environment environment = es_fp_enter_untrapped();
    double values = (double)f->width * f->height * f->channels * (double)(f->frames - 1);
    double mean = f->total.finite ? es_sum_value(&f->total.reference) / (double)f->total.finite : 0;
    error.flicker = es_relative_to_mean(__builtin_sqrt(es_sum_value(&f->total.error) / values), mean);
    error.change = es_relative_to_mean(__builtin_sqrt(es_sum_value(&f->total.change) / values), mean);
    error.worst = es_relative_to_mean(__builtin_sqrt(f->worst), mean);
    error.worst_frame = f->worst_frame;
    es_fp_leave(environment);
    return error;
}
