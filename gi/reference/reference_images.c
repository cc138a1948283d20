/* Images of what has been summed, by name. */
#include <stdlib.h>
#include <string.h>

#include "gi/reference/reference.h"
#include "platform/context.h"

/* Sums first … last are added; `square` belongs to their sum. */
typedef struct image_source { uint32_t first, last, square; bool error; } image_source;

static bool is(const char* name, size_t length, const char* other) { return strlen(other) == length && !strncmp(name, other, length); }

static bool find_source(uint32_t bounces, const char* name, image_source* source)
{
    static const char ending[] = "-error";
    size_t length = strlen(name), tail = sizeof ending - 1;
    bool error = length > tail && !strcmp(name + length - tail, ending);
    if (error) length -= tail;
    if (is(name, length, "radiance")) *source = (image_source){0, bounces + 1, bounces + 2, error};
    else if (is(name, length, "emission") && !error) *source = (image_source){0, 0, 0, false};
    else if (is(name, length, "direct")) *source = (image_source){1, 1, 0, error};
    else if (is(name, length, "indirect")) *source = (image_source){2, bounces + 1, bounces + 1, error};
    else if (length > 7 && length < 10 && !strncmp(name, "bounce-", 7) && name[7] >= '1' && name[7] <= '9') {
        char* end;
        unsigned long bounce = strtoul(name + 7, &end, 10);
        if (end != name + length || bounce > bounces) return false;
        *source = (image_source){(uint32_t)bounce + 1, (uint32_t)bounce + 1, (uint32_t)bounce, error};
    } else return false;
    return true;
}

bool es_reference_has_image(uint32_t bounces, const char* name)
{
    image_source source;
    return name && find_source(bounces, name, &source);
}

es_result es_reference_image(es_reference* r, const char* name, es_image* image)
{
    *image = (es_image){0};
    image_source source;
    if (!r->begun || !r->stats.samples) return es_misuse(r->context, ES_WRONG_STATE, "image \"%s\": there are no samples yet", name);
    if (!find_source(r->bounces, name, &source))
        return es_fail(r->context, ES_IMAGE_UNKNOWN, "there is no image \"%s\"; radiance, emission, direct, indirect and bounce-1 … bounce-%u are, all but emission also with -error", name,
            r->bounces);
    es_result result = es_image_create(r->context, r->width, r->height, 3, image);
    if (result) return result;
    es_fp_environment environment = es_fp_enter();
    for (size_t at = 0; at < (size_t)r->width * r->height * 3; at++) {
        float mean = 0.0f;
        for (uint32_t i = source.first; i <= source.last; i++) mean += es_reference_mean(r, i, at);
        image->pixels[at] = source.error ? (float)__builtin_sqrt(es_reference_variance(r, source.square, at, mean)) : mean;
    }
    es_fp_leave(environment);
    return ES_OK;
}
