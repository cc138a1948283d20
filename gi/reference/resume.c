/* A reference as an EXR file: pictures to look at and to compare, and the sums themselves, so that it can go on. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gi/reference/reference.h"
#include "platform/context.h"

/* R, G, B are the radiance; other layers are named "LAYER.R" and so on. Layers of sums say in their names what they belong to, a float
 * channel having no place for it: "state-FINGERPRINT-SAMPLES-IMAGE-sum", "…-lost", and "…-square". */
enum { NAME_SIZE = ES_CHANNEL_NAME_SIZE };
static const char rgb[3] = {'R', 'G', 'B'};

static size_t value_count(const es_reference* r) { return (size_t)r->width * r->height * 3; }

static void name_layer(es_image* file, uint32_t layer, const char* name)
{
    for (int k = 0; k < 3; k++) {
        if (name[0]) snprintf(file->channel_names[layer * 3 + k], NAME_SIZE, "%.*s.%c", NAME_SIZE - 3, name, rgb[k]);
        else snprintf(file->channel_names[layer * 3 + k], NAME_SIZE, "%c", rgb[k]);
    }
}

static void state_name(const es_reference* r, uint64_t samples, const char* what, uint32_t image, char name[NAME_SIZE])
{
    snprintf(name, NAME_SIZE, "state-%016" PRIx64 "-%" PRIu64 "-%u-%s", r->fingerprint, samples, image, what);
}

static void put_layer(es_image* file, uint32_t layer, const float* values, size_t step)
{
    size_t pixels = (size_t)file->width * file->height;
    for (size_t i = 0; i < pixels; i++)
        for (int k = 0; k < 3; k++) file->pixels[i * file->channels + layer * 3 + k] = values[(i * 3 + k) * step];
}

static es_result put_image(es_reference* r, es_image* file, uint32_t layer, const char* image_name, const char* layer_name)
{
    es_image image;
    es_result result = es_reference_image(r, image_name, &image);
    if (result) return result;
    name_layer(file, layer, layer_name);
    put_layer(file, layer, image.pixels, 1);
    es_image_destroy(r->context, &image);
    return ES_OK;
}

static es_result fill(es_reference* r, es_image* file)
{
    static const char* const wanted[] = {"radiance", "radiance-error", "emission", "direct", "direct-error", "indirect", "indirect-error"};
    char name[NAME_SIZE];
    uint32_t layer = 0;
    es_result result = ES_OK;
    for (size_t i = 0; i < sizeof wanted / sizeof wanted[0] && !result; i++, layer++) result = put_image(r, file, layer, wanted[i], i ? wanted[i] : "");
    for (uint32_t b = 1; b <= r->bounces && !result; b++, layer++) {
        snprintf(name, sizeof name, "bounce-%u", b);
        result = put_image(r, file, layer, name, name);
    }
    if (result) return result;
    const size_t plane = value_count(r);
    for (uint32_t i = 0; i < es_reference_image_count(r); i++) {
        state_name(r, r->stats.samples, "sum", i, name);
        name_layer(file, layer, name);
        put_layer(file, layer++, &r->sums[i * plane].sum, sizeof *r->sums / sizeof(float));
        state_name(r, r->stats.samples, "lost", i, name);
        name_layer(file, layer, name);
        put_layer(file, layer++, &r->sums[i * plane].lost, sizeof *r->sums / sizeof(float));
    }
    for (uint32_t i = 0; i < es_reference_square_count(r); i++) {
        state_name(r, r->stats.samples, "square", i, name);
        name_layer(file, layer, name);
        put_layer(file, layer++, &r->squares[i * plane], 1);
    }
    return ES_OK;
}

es_result es_reference_save(es_reference* r, const char* path)
{
    if (!r->begun || !r->stats.samples) return es_misuse(r->context, ES_WRONG_STATE, "cannot write '%s': there are no samples yet", path);
    size_t length = strlen(path);
    if (length < 4 || strcmp(path + length - 4, ".exr"))
        return es_fail(r->context, ES_FILE_TYPE, "'%s' does not end in .exr, the only format that holds a reference with all its layers", path);
    uint32_t layers = 7 + r->bounces + 2 * es_reference_image_count(r) + es_reference_square_count(r);
    es_image file;
    es_result result = es_image_create(r->context, r->width, r->height, layers * 3, &file);
    if (result) return result;
    result = fill(r, &file);
    if (!result) result = es_image_save(r->context, &file, path, &(es_image_save_desc){.sample_type = ES_SAMPLE_FLOAT});
    es_image_destroy(r->context, &file);
    return result;
}

/* ---- going on ----------------------------------------------------------------------------------------------------------------------- */

/* Fingerprint and samples out of the names; false when the file has no sums. */
static bool read_origin(const es_image* file, uint64_t* fingerprint, uint64_t* samples)
{
    for (uint32_t c = 0; c < file->channels; c++) {
        const char* name = file->channel_names[c];
        if (strncmp(name, "state-", 6)) continue;
        char* end;
        *fingerprint = strtoull(name + 6, &end, 16);
        if (end != name + 22 || *end != '-' || end[1] < '1' || end[1] > '9') return false;
        *samples = strtoull(end + 1, &end, 10);
        return *end == '-' && *samples <= UINT32_MAX;
    }
    return false;
}

/* The channel of each value of a layer; false when one is missing. */
static bool find_layer(const es_image* file, const char* name, int channel[3])
{
    for (int k = 0; k < 3; k++) {
        char channel_name[NAME_SIZE];
        snprintf(channel_name, sizeof channel_name, "%.*s.%c", NAME_SIZE - 3, name, rgb[k]);
        channel[k] = es_image_channel(file, channel_name);
        if (channel[k] < 0) return false;
    }
    return true;
}

/* What is summed is never negative. Squares may be infinite, where one was beyond the largest float. */
static bool sums_valid(const es_image* file, const int sum[3], const int lost[3])
{
    const float* pixel = file->pixels;
    for (size_t i = 0; i < (size_t)file->width * file->height; i++, pixel += file->channels)
        for (int k = 0; k < 3; k++) {
            float s = pixel[sum[k]], all = s + pixel[lost[k]];
            if (!(s >= 0.0f && all >= 0.0f && all <= 0x1.fffffep127f && s <= 0x1.fffffep127f)) return false;
        }
    return true;
}

static bool squares_valid(const es_image* file, const int square[3])
{
    const float* pixel = file->pixels;
    for (size_t i = 0; i < (size_t)file->width * file->height; i++, pixel += file->channels)
        for (int k = 0; k < 3; k++)
            if (!(pixel[square[k]] >= 0.0f)) return false;
    return true;
}

static void get_layer(const es_image* file, const int channel[3], float* values, size_t step)
{
    size_t pixels = (size_t)file->width * file->height;
    for (size_t i = 0; i < pixels; i++)
        for (int k = 0; k < 3; k++) values[(i * 3 + (size_t)k) * step] = file->pixels[i * file->channels + (size_t)channel[k]];
}

/* What is wrong with the file's sums of so many samples, or NULL; with `keep` they become the reference's. */
static const char* visit_state(es_reference* r, const es_image* file, uint64_t samples, bool keep)
{
    static const char missing[] = "some of its sums are missing", wrong[] = "its sums are those of no samples";
    const size_t plane = value_count(r), step = sizeof *r->sums / sizeof(float);
    char name[NAME_SIZE];
    int sum[3], lost[3], square[3];
    for (uint32_t i = 0; i < es_reference_image_count(r); i++) {
        state_name(r, samples, "sum", i, name);
        if (!find_layer(file, name, sum)) return missing;
        state_name(r, samples, "lost", i, name);
        if (!find_layer(file, name, lost)) return missing;
        if (!sums_valid(file, sum, lost)) return wrong;
        if (!keep) continue;
        get_layer(file, sum, &r->sums[i * plane].sum, step);
        get_layer(file, lost, &r->sums[i * plane].lost, step);
    }
    for (uint32_t i = 0; i < es_reference_square_count(r); i++) {
        state_name(r, samples, "square", i, name);
        if (!find_layer(file, name, square)) return missing;
        if (!squares_valid(file, square)) return wrong;
        if (keep) get_layer(file, square, &r->squares[i * plane], 1);
    }
    return NULL;
}

static es_result take(es_reference* r, const es_image* file, const char* path)
{
    uint64_t fingerprint, samples;
    if (!read_origin(file, &fingerprint, &samples))
        return es_fail(r->context, ES_FILE_UNSUPPORTED, "'%s' cannot be resumed: it has no sums; a file written as a reference is expected", path);
    if (fingerprint != r->fingerprint || file->width != r->width || file->height != r->height)
        return es_fail(r->context, ES_FILE_UNSUPPORTED,
            "'%s' cannot be resumed: it was made of another world, camera or settings (size, bounces, seed, antialias, emission, quantised, share)", path);
    const char* wrong = visit_state(r, file, samples, false);
    if (wrong) return es_fail(r->context, ES_FILE_DAMAGED, "'%s' cannot be resumed: %s", path, wrong);
    es_reference_forget(r);
    visit_state(r, file, samples, true);
    r->stats.samples = r->resumed_samples = samples;
    es_reference_estimate(r);
    return ES_OK;
}

es_result es_reference_resume(es_reference* r, const char* path)
{
    if (!r->begun) return es_misuse(r->context, ES_WRONG_STATE, "es_reference_begin comes before es_reference_resume");
    es_image file;
    es_result result = es_image_load(r->context, path, &file);
    if (result) return result;
    es_fp_environment environment = es_fp_enter_untrapped(); /* the file's numbers may be anything */
    result = take(r, &file, path);
    es_fp_leave(environment);
    es_image_destroy(r->context, &file);
    return result;
}
