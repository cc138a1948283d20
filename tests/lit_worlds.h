/* Worlds with the shadow maps of their lights, as a frame has them. */
#ifndef EARTHSHINE_TESTS_LIT_WORLDS_H
#define EARTHSHINE_TESTS_LIT_WORLDS_H

#include "gi/light_view.h"
#include "tests/small_worlds.h"

typedef struct lit_world { small_world w; es_rasterizer* rasterizer; es_light_view* views; uint32_t count; } lit_world;

static inline void draw_shadows(lit_world* l, uint32_t size)
{
    assert_int_equal(es_world_step(l->w.world, 0), ES_OK);
    size_t count;
    const es_light_state* lights = es_world_lights(l->w.world, &count);
    es_vec3 low, high;
    assert_true(es_world_bounds(l->w.world, &low, &high));
    assert_int_equal(es_rasterizer_create(l->w.context, &l->rasterizer), ES_OK);
    l->views = calloc(count + 1, sizeof *l->views);
    l->count = (uint32_t)count;
    es_light_drawn drawn = {0};
    for (size_t i = 0; i < count; i++) {
        assert_int_equal(es_light_view_prepare(l->w.context, &l->views[i], &lights[i], (es_light_view_sizes){size, 0, false, false}, low, high), ES_OK);
        assert_int_equal(es_light_view_draw(l->rasterizer, es_world_draw_list(l->w.world), 0, false, &l->views[i], ES_LIGHT_SHADOW, &drawn), ES_OK);
    }
}

static inline void lit_world_destroy(lit_world* l)
{
    for (uint32_t i = 0; i < l->count; i++) es_light_view_free(l->w.context, &l->views[i]);
    free(l->views);
    es_rasterizer_destroy(l->rasterizer);
    small_world_destroy(&l->w);
}

#endif
