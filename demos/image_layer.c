/* One image out of a file that holds several: channels "NAME.R" and so on, as `earthshine reference` and others write them. */
#include "demo.h"

#include <stdlib.h>
#include <string.h>

/* Length of the layer's name in a channel's: up to the last point; 0 for the file's main image. */
static size_t layer_length(const char* channel)
{
    const char* point = strrchr(channel, '.');
    return point ? (size_t)(point - channel) : 0;
}

/* Sums that `reference --resume` goes on from are no pictures. */
static bool is_state(const char* channel) { return !strncmp(channel, "state-", 6); }

static bool belongs(const char* channel, const char* layer)
{
    size_t length = layer_length(channel);
    return length == strlen(layer) && !strncmp(channel, layer, length);
}

/* Keeps the marked channels, under their names without the layer's. */
static int keep(es_context* context, es_image* image, const bool* kept, uint32_t count)
{
    es_image result;
    if (es_image_create(context, image->width, image->height, count, &result) != ES_OK) return demo_refuse_context(context);
    uint32_t at = 0;
    for (uint32_t c = 0; c < image->channels; c++) {
        if (!kept[c]) continue;
        size_t length = layer_length(image->channel_names[c]);
        snprintf(result.channel_names[at], ES_CHANNEL_NAME_SIZE, "%s", image->channel_names[c] + (length ? length + 1 : 0));
        for (size_t i = 0; i < (size_t)image->width * image->height; i++) result.pixels[i * count + at] = image->pixels[i * image->channels + c];
        at++;
    }
    es_image_destroy(context, image);
    *image = result;
    return DEMO_OK;
}

static int refuse_layer(const es_image* image, const char* path, const char* name)
{
    demo_text known = {0};
    for (uint32_t c = 0; c < image->channels; c++) {
        const char* channel = image->channel_names[c];
        size_t length = layer_length(channel);
        bool again = is_state(channel);
        for (uint32_t k = 0; k < c && !again; k++) again = layer_length(image->channel_names[k]) == length && !strncmp(image->channel_names[k], channel, length);
        if (!again) demo_text_add(&known, "%s%.*s", known.size ? ", " : "", length ? (int)length : 8, length ? channel : "radiance");
    }
    int code = demo_refuse("--image %s: %s has no such image; it has %s", name, path, known.bytes ? known.bytes : "none");
    demo_text_free(&known);
    return code;
}

int demo_select_layer(es_context* context, es_image* image, const char* path, const char* name)
{
    bool layered = false, plain = false;
    for (uint32_t c = 0; c < image->channels; c++) *(layer_length(image->channel_names[c]) ? &layered : &plain) = true;
    if (!layered || (!name && !plain)) return DEMO_OK;
    bool* kept = calloc(image->channels, sizeof *kept);
    if (!kept) return demo_refuse("out of memory");
    uint32_t count = 0;
    for (int attempt = 0; attempt < 2 && !count; attempt++) {
        /* the main image of a reference's file is the radiance */
        const char* layer = !name || (attempt && !strcmp(name, "radiance")) ? "" : name;
        for (uint32_t c = 0; c < image->channels; c++) {
            kept[c] = belongs(image->channel_names[c], layer);
            count += kept[c];
        }
    }
    int code = count ? keep(context, image, kept, count) : refuse_layer(image, path, name);
    free(kept);
    return code;
}
