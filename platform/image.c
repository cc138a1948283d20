/* Float images: making, freeing, finding a channel, hashing. Files are read and written in image_load_save.c. */
#include <stdio.h>
#include <string.h>

#include "platform/context.h"
#include "platform/random.h"

static size_t pixels_size(const es_image* image)
{
    return (size_t)image->width * image->height * image->channels * sizeof(float); /* at most 2^36: see the limits */
}

es_result es_image_create(es_context* context, uint32_t width, uint32_t height, uint32_t channels, es_image* image)
{
    if (!context || !image) return es_misuse(context, ES_INVALID_ARGUMENT, "es_image_create needs a context and an image");
    memset(image, 0, sizeof *image);
    if (width < 1 || width > ES_IMAGE_MAX_SIZE || height < 1 || height > ES_IMAGE_MAX_SIZE) {
        return es_fail(context, ES_IMAGE_SIZE, "an image of %u x %u pixels was asked for; each side may be 1 to %d", width,
            height, ES_IMAGE_MAX_SIZE);
    }
    if (channels < 1 || channels > ES_IMAGE_MAX_CHANNELS) {
        return es_fail(context, ES_IMAGE_SIZE, "an image of %u channels was asked for; 1 to %d are accepted", channels,
            ES_IMAGE_MAX_CHANNELS);
    }
    es_image made = {.width = width, .height = height, .channels = channels};
    made.pixels = es_allocate_zero(context, pixels_size(&made));
    if (made.pixels) made.channel_names = es_allocate_zero(context, channels * sizeof *made.channel_names);
    if (!made.pixels || !made.channel_names) {
        es_image_destroy(context, &made);
        return es_context_last_result(context);
    }
    static const char usual[4][5] = {"Y", "YA", "RGB", "RGBA"};
    for (uint32_t c = 0; c < channels; c++) {
        if (channels <= 4)
            made.channel_names[c][0] = usual[channels - 1][c];
        else
            snprintf(made.channel_names[c], ES_CHANNEL_NAME_SIZE, "C%u", c);
    }
    *image = made;
    return ES_OK;
}

void es_image_destroy(es_context* context, es_image* image)
{
    if (!context || !image) return;
    es_release(context, image->pixels, pixels_size(image));
    es_release(context, image->channel_names, image->channels * sizeof *image->channel_names);
    memset(image, 0, sizeof *image);
}

int es_image_channel(const es_image* image, const char* name)
{
    if (!image || !name || !image->channel_names) return -1;
    for (uint32_t c = 0; c < image->channels; c++) {
        if (strncmp(image->channel_names[c], name, ES_CHANNEL_NAME_SIZE) == 0) return (int)c;
    }
    return -1;
}

uint64_t es_image_hash(const es_image* image)
{
    if (!image || !image->pixels) return 0;
    const uint32_t size[3] = {image->width, image->height, image->channels};
    unsigned char bytes[12];
    for (int i = 0; i < 12; i++) bytes[i] = (unsigned char)(size[i / 4] >> 8 * (i % 4));
    return es_hash_bytes(es_hash_bytes(0, bytes, sizeof bytes), image->pixels, pixels_size(image));
}
