/* How wrong a picture is against a truth that has noise of its own. */
#include "bench_error.h"

#include <math.h>

void error_truth_free(es_context* context, error_truth* truth)
{
    es_image_destroy(context, &truth->indirect);
    es_image_destroy(context, &truth->whole);
    for (int h = 0; h < 2; h++) es_image_destroy(context, &truth->halves[h]);
}

static size_t value_count(const es_image* image) { return (size_t)image->width * image->height * image->channels; }

static double mean_of(const es_image* image)
{
    double sum = 0;
    for (size_t i = 0; i < value_count(image); i++) sum += (double)image->pixels[i];
    return sum / (double)value_count(image);
}

bool error_join_halves(es_context* context, error_truth* truth)
{
    const es_image* halves = truth->halves;
    if (es_image_create(context, halves[0].width, halves[0].height, halves[0].channels, &truth->indirect) != ES_OK) return false;
    double squares = 0;
    for (size_t i = 0; i < value_count(&halves[0]); i++) {
        double difference = (double)halves[0].pixels[i] - (double)halves[1].pixels[i];
        truth->indirect.pixels[i] = (halves[0].pixels[i] + halves[1].pixels[i]) / 2;
        squares += difference * difference;
    }
    truth->noise_relrmse = sqrt(squares / (double)value_count(&halves[0])) / 2 / mean_of(&truth->indirect);
    return true;
}

/* Mean square of the error, plain and relative as relmse has it, by the two halves. */
static void error_squares(const es_image* image, const error_truth* truth, double* plain, double* relative)
{
    *plain = *relative = 0;
    for (size_t i = 0; i < value_count(image); i++) {
        double light = (double)truth->indirect.pixels[i];
        double square = ((double)image->pixels[i] - (double)truth->halves[0].pixels[i]) * ((double)image->pixels[i] - (double)truth->halves[1].pixels[i]);
        *plain += square;
        *relative += square / (light * light + 0.01);
    }
    *plain /= (double)value_count(image);
    *relative /= (double)value_count(image);
}

double error_flicker(const es_image* frames, const error_truth* truths, uint32_t count)
{
    double squares = 0, mean = 0, values = 0;
    for (uint32_t f = 0; f < count; f++) {
        if (!frames[f].pixels || !truths[f].halves[0].pixels || value_count(&frames[f]) != value_count(&truths[f].indirect)) return NAN;
        mean += mean_of(&truths[f].indirect) / count;
    }
    for (uint32_t f = 1; f < count; f++) {
        const error_truth *now = &truths[f], *last = &truths[f - 1];
        for (size_t i = 0; i < value_count(&frames[f]); i++) {
            double change = (double)frames[f].pixels[i] - (double)frames[f - 1].pixels[i];
            squares += (change - ((double)now->halves[0].pixels[i] - (double)last->halves[0].pixels[i])) *
                       (change - ((double)now->halves[1].pixels[i] - (double)last->halves[1].pixels[i]));
        }
        values += (double)value_count(&frames[f]);
    }
    return squares > 0 ? sqrt(squares / values) / mean : NAN;
}

static double mean_flip(es_context* context, const es_image* image, const es_image* truth)
{
    es_image map;
    if (!image->pixels || es_image_error_map(context, image, truth, ES_ERROR_MAP_FLIP, NULL, &map) != ES_OK) return NAN;
    double sum = 0;
    size_t pixels = (size_t)map.width * map.height;
    for (size_t i = 0; i < pixels; i++) sum += (double)map.pixels[i];
    es_image_destroy(context, &map);
    return sum / (double)pixels;
}

/* The truth's other light with this indirect light. */
static double flip_of_replaced(es_context* context, const es_image* indirect, const error_truth* truth)
{
    es_image whole;
    if (es_image_create(context, indirect->width, indirect->height, 3, &whole) != ES_OK) return NAN;
    for (size_t i = 0; i < (size_t)whole.width * whole.height * 3; i++) whole.pixels[i] = truth->whole.pixels[i] - truth->indirect.pixels[i] + indirect->pixels[i];
    double flip = mean_flip(context, &whole, &truth->whole);
    es_image_destroy(context, &whole);
    return flip;
}

error_measures error_measure(es_context* context, const es_image* indirect, const es_image* whole, const error_truth* truth)
{
    error_measures measures = {NAN, NAN, NAN, NAN, NAN};
    es_image_error error;
    if (!indirect->pixels || !truth->indirect.pixels || indirect->channels != 3 || es_image_compare(context, indirect, &truth->indirect, &(es_error_desc){0}, &error) != ES_OK)
        return measures;
    double plain = error.rmse * error.rmse, relative = error.relmse;
    if (truth->halves[0].pixels) error_squares(indirect, truth, &plain, &relative);
    measures.relrmse = plain > 0 ? sqrt(plain) / error.reference_mean : NAN;
    measures.relmse = relative > 0 ? relative : NAN;
    measures.rell1 = error.rell1;
    measures.flip = mean_flip(context, indirect, &truth->indirect);
    measures.flip_whole = whole ? mean_flip(context, whole, &truth->whole) : flip_of_replaced(context, indirect, truth);
    return measures;
}
