/* The error of each pixel as an image. */
#include <string.h>

#include "gi/error/flip.h"
#include "platform/context.h"

typedef struct map_job {
    const es_image *a, *b;
    const es_channel_pairs* pairs;
    const uint8_t* mask;
    es_error_map map;
    float* values;
} map_job;

static double channel_error(es_error_map map, float a, float b)
{
    double d = es_difference(a, b);
    if (map == ES_ERROR_MAP_ABSOLUTE) return __builtin_fabs(d);
    if (map == ES_ERROR_MAP_SIGNED || d == 0) return d;
    return es_is_finite(b) ? d * d / ((double)b * (double)b + 0.01) : __builtin_inf();
}

static float pixel_error(const map_job* job, size_t pixel)
{
    const float *p = job->a->pixels + pixel * job->a->channels, *q = job->b->pixels + pixel * job->b->channels;
    double sum = 0;
    for (uint32_t k = 0; k < job->pairs->count; k++) {
        double error = channel_error(job->map, p[job->pairs->a[k]], q[job->pairs->b[k]]);
        bool opposite = sum + error != sum + error; /* infinities of both signs: the first stays */
        sum = opposite ? sum : sum + error;
    }
    return (float)(sum / job->pairs->count);
}

static void map_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const map_job* job = user;
    (void)worker;
    es_fp_environment environment = es_fp_enter_untrapped();
    for (size_t i = (size_t)begin * job->a->width; i < (size_t)end * job->a->width; i++)
        job->values[i] = !job->mask || job->mask[i] ? pixel_error(job, i) : 0;
    es_fp_leave(environment);
}

es_result es_image_error_map(es_context* context, const es_image* a, const es_image* b, es_error_map map, const es_error_desc* desc, es_image* result)
{
    if (!context || !result) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_error_map needs a context and a place for the map");
    memset(result, 0, sizeof *result);
    es_channel_pairs pairs;
    es_result code = es_pair_channels(context, a, b, &pairs);
    if (code) return code;
    bool flip = map == ES_ERROR_MAP_FLIP || map == ES_ERROR_MAP_HDR_FLIP;
    if (!flip && map > ES_ERROR_MAP_SIGNED) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_error_map: there is no map %d", (int)map);
    if (flip && !pairs.has_colour)
        return es_fail(context, ES_INVALID_ARGUMENT, "FLIP is defined for colours; %u channels were given to compare, three are expected", pairs.count);
    if (map == ES_ERROR_MAP_HDR_FLIP && desc && desc->display_referred)
        return es_fail(context, ES_INVALID_ARGUMENT, "HDR-FLIP is defined for radiance, and the pictures are said to be display-referred; take FLIP");
    code = es_image_create(context, a->width, a->height, 1, result);
    if (code) return code;
    es_fp_environment environment = es_fp_enter_untrapped();
    map_job job = {a, b, &pairs, desc ? desc->mask : NULL, map, result->pixels};
    if (flip) code = es_flip(context, a, b, &pairs, map == ES_ERROR_MAP_HDR_FLIP, desc, result->pixels);
    else es_parallel_for(context, a->height, 8, map_rows, &job);
    for (size_t i = 0; flip && job.mask && i < (size_t)a->width * a->height; i++)
        if (!job.mask[i]) result->pixels[i] = 0;
    es_fp_leave(environment);
    if (code) es_image_destroy(context, result);
    return code;
}
