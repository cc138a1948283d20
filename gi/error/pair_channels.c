/* Which channels of two images are compared with which. */
#include <string.h>

#include "gi/error/error.h"
#include "platform/context.h"

static bool is_alpha(const char* name)
{
    size_t length = strlen(name);
    return !strcmp(name, "A") || (length > 2 && !strcmp(name + length - 2, ".A"));
}

static void pair_by_name(const es_image* a, const es_image* b, bool alpha, es_channel_pairs* pairs)
{
    pairs->count = 0;
    for (uint32_t i = 0; i < a->channels; i++) {
        int j = es_image_channel(b, a->channel_names[i]);
        if (j < 0 || is_alpha(a->channel_names[i]) != alpha) continue;
        pairs->a[pairs->count] = i;
        pairs->b[pairs->count++] = (uint32_t)j;
    }
}

static void find_colour(const es_image* a, es_channel_pairs* pairs)
{
    static const char* const names[3] = {"R", "G", "B"};
    pairs->has_colour = pairs->count >= 3;
    uint32_t named[3] = {0}, found = 0;
    for (uint32_t k = 0; k < 3; k++)
        for (uint32_t i = 0; i < pairs->count; i++)
            if (!strcmp(a->channel_names[pairs->a[i]], names[k])) {
                named[k] = i;
                found++;
                break;
            }
    for (uint32_t k = 0; k < 3; k++) pairs->colour[k] = found == 3 ? named[k] : k;
}

es_result es_pair_channels(es_context* context, const es_image* a, const es_image* b, es_channel_pairs* pairs)
{
    if (!a || !b || !a->pixels || !b->pixels || !a->channel_names || !b->channel_names)
        return es_misuse(context, ES_INVALID_ARGUMENT, "two images with pixels and channel names are needed to compare them");
    if (a->width != b->width || a->height != b->height)
        return es_fail(context, ES_INVALID_ARGUMENT, "images of %u x %u and of %u x %u pixels cannot be compared; equal sizes are expected", a->width,
            a->height, b->width, b->height);
    pair_by_name(a, b, false, pairs);
    if (!pairs->count) pair_by_name(a, b, true, pairs);
    if (!pairs->count && a->channels == b->channels)
        for (uint32_t i = 0; i < a->channels; i++) {
            pairs->a[i] = pairs->b[i] = i;
            pairs->count = i + 1;
        }
    if (!pairs->count)
        return es_fail(context, ES_INVALID_ARGUMENT,
            "an image of %u channels (%s …) and one of %u (%s …) share no channel name; a shared name or equal numbers are expected", a->channels,
            a->channel_names[0], b->channels, b->channel_names[0]);
    find_colour(a, pairs);
    return ES_OK;
}

double es_relative_to_mean(double error, double mean) { return error == 0 ? 0 : error / __builtin_fabs(mean); }
