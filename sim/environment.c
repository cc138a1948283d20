/* The environment: light from everywhere, infinitely far away. Its image is an asset, like a texture; its factor and its rotation are
 * state, like a light's colour. */
#include "sim/world.h"

#include <string.h>

#include "platform/maths.h"

#define RADIANCE_LIMIT 1e12f /* a radiance times a texel of the same limit stays finite */

static const char* what_is_wrong(const es_environment_desc* d)
{
    const es_image* image = d->image;
    for (int c = 0; c < 3; c++)
        if (!es_within(d->radiance[c], 0, RADIANCE_LIMIT)) return "its radiance must lie in 0 … 1e12";
    if (!es_all_within(&d->rotation, 1, 1000)) return "its rotation must lie in -1000 … 1000 radians";
    if (!image) return NULL;
    if (!image->pixels || !image->width || !image->height || image->channels < 3) return "its image must have pixels and three channels or more";
    if (image->width > ES_IMAGE_MAX_SIZE || image->height > ES_IMAGE_MAX_SIZE) return "its image is larger than any image may be";
    return NULL;
}

/* R, G and B by name, or the first three */
static bool copy_image(es_world* world, const es_image* image, es_image* copy)
{
    if (es_image_create(world->context, image->width, image->height, 3, copy) != ES_OK) return false;
    int channel[3] = {0, 1, 2};
    if (image->channel_names) {
        int named[3] = {es_image_channel(image, "R"), es_image_channel(image, "G"), es_image_channel(image, "B")};
        if (named[0] >= 0 && named[1] >= 0 && named[2] >= 0) memcpy(channel, named, sizeof channel);
    }
    size_t count = (size_t)image->width * image->height;
    for (size_t i = 0; i < count; i++) {
        for (int c = 0; c < 3; c++) {
            float value = image->pixels[i * image->channels + (size_t)channel[c]];
            if (!es_within(value, 0, RADIANCE_LIMIT)) {
                es_fail(world->context, ES_INVALID_ARGUMENT, "environment: its image has %g at (%zu, %zu); radiance must lie in 0 … 1e12", (double)value,
                    i % image->width, i / image->width);
                es_image_destroy(world->context, copy);
                return false;
            }
            copy->pixels[3 * i + (size_t)c] = value;
        }
    }
    return true;
}

bool es_environment_numbers_valid(const float radiance[3], float rotation)
{
    es_environment_desc desc = {.radiance = {radiance[0], radiance[1], radiance[2]}, .rotation = rotation};
    return !what_is_wrong(&desc);
}

es_result es_world_set_environment(es_world* world, const es_environment_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_environment_desc d = desc ? *desc : (es_environment_desc){0};
    const char* wrong = what_is_wrong(&d);
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "environment: %s", wrong);
    bool same_image = d.image == &world->environment_image, differs = !same_image && (d.image || world->environment_image.pixels);
    if (!same_image) {
        es_image copy = {0};
        if (d.image && !copy_image(world, d.image, &copy)) return es_context_last_result(world->context);
        es_environment_free(world);
        world->environment_image = copy;
    }
    differs |= memcmp(world->environment_radiance, d.radiance, sizeof d.radiance) != 0 || memcmp(&world->environment_rotation, &d.rotation, sizeof d.rotation) != 0;
    memcpy(world->environment_radiance, d.radiance, sizeof d.radiance);
    world->environment_rotation = d.rotation;
    if (differs) {
        world->revisions.lights++;
        world->revisions.environment++;
    }
    return ES_OK;
}

bool es_world_get_environment(const es_world* world, es_environment_desc* desc)
{
    if (desc) *desc = (es_environment_desc){0};
    if (!world || !desc) return false;
    const float* r = world->environment_radiance;
    if (!(r[0] > 0 || r[1] > 0 || r[2] > 0)) return false;
    desc->image = world->environment_image.pixels ? &world->environment_image : NULL;
    memcpy(desc->radiance, r, sizeof desc->radiance);
    desc->rotation = world->environment_rotation;
    return true;
}

void es_environment_free(es_world* world) { es_image_destroy(world->context, &world->environment_image); }
