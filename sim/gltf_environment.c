#include "sim/gltf_environment.h"

#include <stdio.h>

#include "platform/context.h"
#include "platform/image_files.h"
#include "platform/maths.h"
#include "sim/environment.h"

/* "extensions.EXT_lights_image_based.lights[2^64].specularImages[0][5]" fits */
enum { PLACE = 128 };

static es_result damaged(const es_gltf_environment* e, const char* where, const char* what) { return es_fail(e->context, ES_FILE_DAMAGED, "%s: %s: %s", e->path, where, what); }

static es_result out_of_range(const es_gltf_environment* e, const char* where, double value, double low, double high)
{
    return es_fail(e->context, ES_FILE_DAMAGED, "%s: %s: is %g, must lie in %g … %g", e->path, where, value, low, high);
}

static void place_of_light(const es_gltf_environment* e, const char* member, char place[PLACE]) { snprintf(place, PLACE, "extensions.EXT_lights_image_based.lights[%zu].%s", e->light, member); }

static void place_of_face(const es_gltf_environment* e, size_t face, char place[PLACE])
{
    snprintf(place, PLACE, "extensions.EXT_lights_image_based.lights[%zu].specularImages[0][%zu]", e->light, face);
}

/* `what` is the message for what is no whole number; a file may have 2^31 of anything at the most. */
static es_result read_index(const es_gltf_environment* e, const void* value, size_t count, const char* where, const char* what, size_t* index)
{
    double number;
    if (!e->values->number(value, &number) || !(number > -2147483649.0 && number < 2147483648.0) || number != (double)(int32_t)number) return damaged(e, where, what);
    if (number < 0 || number >= (double)count) return es_fail(e->context, ES_FILE_DAMAGED, "%s: %s: names number %d, there are %zu", e->path, where, (int32_t)number, count);
    *index = (size_t)number;
    return ES_OK;
}

static es_result read_images(es_gltf_environment* e, const void* light)
{
    const es_gltf_values* v = e->values;
    char place[PLACE];
    place_of_light(e, "specularImages", place);
    const void* levels = v->member(light, "specularImages");
    size_t count;
    if (!v->array_length(levels, &count) || count < 1) return damaged(e, place, "must be an array of levels");
    const void* first = v->element(levels, 0);
    place_of_light(e, "specularImages[0]", place);
    if (!v->array_length(first, &count) || count != 6) return damaged(e, place, "must be an array of six images");
    es_result result = ES_OK;
    for (size_t face = 0; face < 6 && !result; face++) {
        place_of_face(e, face, place);
        result = read_index(e, v->element(first, face), e->image_count, place, "must be the number of an image", &e->images[face]);
    }
    return result;
}

static es_result read_intensity(es_gltf_environment* e, const void* light)
{
    const void* value = e->values->member(light, "intensity");
    char place[PLACE];
    place_of_light(e, "intensity", place);
    double intensity = 1.0;
    if (value && !e->values->number(value, &intensity)) return damaged(e, place, "must be a number");
    if (!(intensity >= 0.0 && intensity <= 1e6)) return out_of_range(e, place, intensity, 0.0, 1e6);
    e->intensity = (float)intensity;
    return ES_OK;
}

static es_result read_rotation(es_gltf_environment* e, const void* light)
{
    const es_gltf_values* v = e->values;
    const void* value = v->member(light, "rotation");
    char place[PLACE];
    place_of_light(e, "rotation", place);
    float rotation[4] = {0, 0, 0, 1};
    size_t count;
    if (value && (!v->array_length(value, &count) || count != 4)) return damaged(e, place, "must be an array of 4 numbers");
    for (size_t i = 0; i < 4 && value; i++) {
        double number;
        if (!v->number(v->element(value, i), &number)) return damaged(e, place, "must be an array of 4 numbers");
        if (!(number >= -1.0001 && number <= 1.0001)) return out_of_range(e, place, number, -1.0001, 1.0001);
        rotation[i] = (float)number;
    }
    e->rotation = es_quat_normalize((es_quat){rotation[0], rotation[1], rotation[2], rotation[3]});
    return ES_OK;
}

es_result es_gltf_environment_read(es_gltf_environment* e)
{
    const es_gltf_values* v = e->values;
    char place[PLACE];
    snprintf(place, sizeof place, "scenes[%zu].extensions.EXT_lights_image_based.light", e->scene);
    const void* which = v->member(e->use, "light");
    double unused;
    if (!v->number(which, &unused)) return damaged(e, place, "must be a whole number");
    const void* lights = v->member(e->root, "lights");
    size_t count;
    if (!v->array_length(lights, &count)) return damaged(e, "extensions.EXT_lights_image_based.lights", "must be an array");
    es_result result = read_index(e, which, count, place, "must be a whole number", &e->light);
    if (result) return result;
    const void* light = v->element(lights, e->light);
    snprintf(place, sizeof place, "extensions.EXT_lights_image_based.lights[%zu]", e->light);
    if (!v->is_object(light)) return damaged(e, place, "must be an object");
    result = read_images(e, light);
    if (!result) result = read_intensity(e, light);
    return result ? result : read_rotation(e, light);
}

es_result es_gltf_environment_face(es_gltf_environment* e, size_t face, const es_gltf_image_header* header, const uint8_t* rgba)
{
    char place[PLACE];
    place_of_face(e, face, place);
    if (header->width != header->height)
        return es_fail(e->context, ES_FILE_DAMAGED, "%s: %s: its image is %u x %u pixels, a cube's face must be square", e->path, place, header->width, header->height);
    if (header->width > ES_ENVIRONMENT_MAX_WIDTH / 2)
        return es_fail(e->context, ES_IMAGE_SIZE, "%s: %s: its image is %u x %u pixels, at most %d are read", e->path, place, header->width, header->height, ES_ENVIRONMENT_MAX_WIDTH / 2);
    if (face && header->width != e->faces[0].width) return damaged(e, place, "is not as large as the cube's other faces");
    es_image* image = &e->faces[face];
    es_result result = es_image_create(e->context, header->width, header->height, 3, image);
    if (result) return result;
    float linear[256];
    for (int code = 0; code < 256; code++) linear[code] = (float)es_srgb_decode(code / 255.0);
    for (size_t p = 0; p < (size_t)header->width * header->height; p++) {
        const float alpha = (float)rgba[4 * p + 3] * (1.0f / 255.0f); /* what has none is opaque */
        for (size_t k = 0; k < 3; k++) image->pixels[3 * p + k] = alpha > 0.0f ? linear[rgba[4 * p + k]] / alpha : 0.0f;
    }
    return ES_OK;
}

es_result es_gltf_environment_set(const es_gltf_environment* e, es_world* world)
{
    es_image picture = {0};
    if (!es_environment_from_cube(e->context, e->faces, e->rotation, &picture)) return es_context_last_result(e->context);
    const es_environment_desc desc = {.image = &picture, .radiance = {e->intensity, e->intensity, e->intensity}};
    es_result result = es_world_set_environment(world, &desc);
    es_image_destroy(e->context, &picture);
    return result;
}

void es_gltf_environment_free(es_gltf_environment* e)
{
    for (int face = 0; face < 6; face++) es_image_destroy(e->context, &e->faces[face]);
}
