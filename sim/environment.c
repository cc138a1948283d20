/* The environment: light from everywhere, infinitely far away. Its image is an asset, like a texture; its factor and its rotation are
 * state, like a light's colour. */
#include "sim/environment.h"

#include <string.h>

#include "platform/context.h"
#include "platform/maths.h"

static const char* what_is_wrong(const es_environment_desc* d)
{
    const es_image* image = d->image;
    for (int c = 0; c < 3; c++)
        if (!es_within(d->radiance[c], 0, ES_RADIANCE_LIMIT)) return "its radiance must lie in 0 … 1e12";
    if (!es_all_within(&d->rotation, 1, 1000)) return "its rotation must lie in -1000 … 1000 radians";
    if (!image) return NULL;
    if (!image->pixels || !image->width || !image->height || image->channels < 3) return "its image must have pixels and three channels or more";
    if (image->width > ES_IMAGE_MAX_SIZE || image->height > ES_IMAGE_MAX_SIZE) return "its image is larger than any image may be";
    return NULL;
}

bool es_environment_numbers_valid(const float radiance[3], float rotation)
{
    es_environment_desc desc = {.radiance = {radiance[0], radiance[1], radiance[2]}, .rotation = rotation};
    return !what_is_wrong(&desc);
}

static es_result set_environment(es_world* world, const char* label, const es_environment_desc* desc)
{
    es_environment_desc d = desc ? *desc : (es_environment_desc){0};
    const char* wrong = what_is_wrong(&d);
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "%s: %s", label, wrong);
    bool same_image = d.image == &world->environment_image, differs = !same_image && (d.image || world->environment_image.pixels);
    if (!same_image) {
        es_image copy = {0};
        if (d.image && !es_environment_copy(world->context, label, d.image, &copy)) return es_context_last_result(world->context);
        es_environment_free(world);
        world->environment_image = copy;
    }
    world->sky.on = false;
    differs |= memcmp(world->environment_radiance, d.radiance, sizeof d.radiance) != 0 || memcmp(&world->environment_rotation, &d.rotation, sizeof d.rotation) != 0;
    memcpy(world->environment_radiance, d.radiance, sizeof d.radiance);
    world->environment_rotation = d.rotation;
    if (differs) {
        world->revisions.lights++;
        world->revisions.environment++;
    }
    return ES_OK;
}

es_result es_world_set_environment(es_world* world, const es_environment_desc* desc) { return world ? set_environment(world, "environment", desc) : ES_INVALID_ARGUMENT; }

es_result es_world_load_environment(es_world* world, const char* path, const es_environment_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!path) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_load_environment: the path must not be NULL");
    es_image image;
    es_result result = es_image_load(world->context, path, &image);
    if (result) return result;
    es_environment_desc d = desc ? *desc : (es_environment_desc){.radiance = {1, 1, 1}};
    d.image = &image;
    if (image.height == 6 * image.width)
        result = es_fail(world->context, ES_FILE_UNSUPPORTED, "'%.200s': a cube map, %u × %u; a lat-long picture is expected, about twice as wide as high", path, image.width, image.height);
    else if (image.channels < 3)
        result = es_fail(world->context, ES_FILE_UNSUPPORTED, "'%.200s': has %u channel%s; an environment must have red, green and blue", path, image.channels, image.channels == 1 ? "" : "s");
    else
        result = set_environment(world, path, &d);
    es_image_destroy(world->context, &image);
    return result;
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
