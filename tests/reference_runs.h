/* The reference over a small world, and means of its pictures with their standard errors. */
#ifndef EARTHSHINE_TESTS_REFERENCE_RUNS_H
#define EARTHSHINE_TESTS_REFERENCE_RUNS_H

#include "tests/small_worlds.h"
#include "tests/statistics.h"

/* A sanitizer makes a path many times slower. Errors grow by the square root of this, and bounds follow them; of so few samples single pixels
 * may have none that tells how they scatter, so that only means are looked at where light is found seldom. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { FEWER = 4 };
#else
enum { FEWER = 1 };
#endif

static inline es_reference_settings reference_settings(uint32_t width, uint32_t height, uint32_t bounces)
{
    es_reference_settings s = es_default_reference_settings();
    s.width = width;
    s.height = height;
    s.bounces = bounces;
    s.share = 1; /* independent pixels, for means over many of them */
    return s;
}

static inline es_reference* begin_reference(small_world* w, const es_reference_settings* s)
{
    es_reference* reference;
    assert_int_equal(es_reference_create(w->context, s, &reference), ES_OK);
    assert_int_equal(es_reference_begin(reference, w->world), ES_OK);
    return reference;
}

static inline es_reference* trace(small_world* w, const es_reference_settings* s, uint32_t samples)
{
    es_reference* reference = begin_reference(w, s);
    assert_int_equal(es_reference_add(reference, samples), ES_OK);
    return reference;
}

static inline es_image traced(es_reference* reference, const char* name)
{
    es_image image;
    assert_int_equal(es_reference_image(reference, name, &image), ES_OK);
    return image;
}

typedef struct measured { double value, error; } measured;

/* Red, over a block of pixels. Pixels draw their numbers apart from each other. */
static inline measured mean_of_block(const es_image* image, const es_image* error, uint32_t x, uint32_t y, uint32_t width, uint32_t height)
{
    measured m = {0, 0};
    for (uint32_t j = y; j < y + height; j++)
        for (uint32_t i = x; i < x + width; i++) {
            size_t at = 3 * ((size_t)j * image->width + i);
            m.value += (double)image->pixels[at];
            if (error) m.error += (double)error->pixels[at] * (double)error->pixels[at];
        }
    double count = (double)width * height;
    return (measured){m.value / count, sqrt(m.error) / count};
}

static inline measured mean_of_reference(small_world* w, es_reference* reference, const char* name)
{
    char error_name[64];
    snprintf(error_name, sizeof error_name, "%s-error", name);
    es_image image = traced(reference, name), error = traced(reference, error_name);
    measured m = mean_of_block(&image, &error, 0, 0, image.width, image.height);
    es_image_destroy(w->context, &image);
    es_image_destroy(w->context, &error);
    return m;
}

/* An orthographic camera `distance` before the point, seeing 2 half_height of it from the direction `towards_eye`. Looking down the axis
 * -y the picture's columns go along +x and its rows along +z; along -x, columns go along -z and rows along -y. */
static inline void look_straight(small_world* w, es_vec3 at, es_vec3 towards_eye, float distance, float half_height)
{
    es_camera_desc camera = es_default_camera_desc();
    camera.orthographic = true;
    camera.half_height = half_height;
    camera.near_plane = 1e-3f * distance;
    camera.far_plane = 2 * distance;
    look(w, camera, es_v3_add(at, es_v3_scale(towards_eye, distance)), at);
}

#endif
