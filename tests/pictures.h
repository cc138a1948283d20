/* Renderers, their pictures and what they say of their passes, where all has to work. */
#ifndef EARTHSHINE_TESTS_PICTURES_H
#define EARTHSHINE_TESTS_PICTURES_H

#include <string.h>

#include "tests/small_worlds.h"

static inline es_renderer* renderer_of(es_context* context, const es_renderer_settings* settings)
{
    es_renderer* renderer;
    assert_int_equal(es_renderer_create(context, settings, &renderer), ES_OK);
    return renderer;
}

static inline void render(es_renderer* renderer, es_world* world) { assert_int_equal(es_renderer_render(renderer, world), ES_OK); }

static inline es_image picture(es_renderer* renderer, const char* name)
{
    es_image image;
    assert_int_equal(es_renderer_image(renderer, name, &image), ES_OK);
    return image;
}

/* Rendered by itself. */
static inline es_image picture_of(small_world* w, const es_renderer_settings* settings, const char* name)
{
    es_renderer* renderer = renderer_of(w->context, settings);
    render(renderer, w->world);
    es_image image = picture(renderer, name);
    es_renderer_destroy(renderer);
    return image;
}

static inline const es_pass_stats* pass_of(const es_renderer* renderer, const char* name)
{
    const es_frame_stats* stats = es_renderer_stats(renderer);
    for (size_t i = 0; i < stats->pass_count; i++)
        if (!strcmp(stats->passes[i].name, name)) return &stats->passes[i];
    fail_msg("there is no pass %s", name);
    return NULL;
}

#endif
