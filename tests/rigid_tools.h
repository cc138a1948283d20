/* Worlds of bodies for tests. */
#ifndef EARTHSHINE_TESTS_RIGID_TOOLS_H
#define EARTHSHINE_TESTS_RIGID_TOOLS_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sim/sim.h"

typedef struct arena { es_context* context; es_world* world; } arena;

static inline void quiet_log(void* user, es_log_level level, es_result item, const char* message) {}

static inline arena make_arena(uint32_t thread_count, uint32_t isa_mask, bool sleep)
{
    arena a = {0};
    es_context_desc desc = es_default_context_desc();
    desc.threads = thread_count;
    desc.isa_mask = isa_mask;
    desc.logger.log = quiet_log;
    assert_int_equal(es_context_create(&desc, &a.context), ES_OK);
    es_world_settings settings = es_default_world_settings();
    settings.sleep = sleep;
    assert_int_equal(es_world_create(a.context, &settings, &a.world), ES_OK);
    return a;
}

static inline void free_arena(arena* a)
{
    es_world_destroy(a->world);
    assert_int_equal(es_context_bytes(a->context), 0);
    es_context_destroy(a->context);
}

static inline void set_gravity(arena* a, float x, float y, float z)
{
    es_world_settings settings = es_world_get_settings(a->world);
    settings.gravity = (es_vec3){x, y, z};
    assert_int_equal(es_world_configure(a->world, &settings), ES_OK);
}

static inline es_body add_body(arena* a, es_body_type type, const es_shape_desc* shape, double x, double y, double z, es_quat rotation)
{
    es_body_desc desc = es_default_body_desc();
    desc.type = type;
    desc.shapes = shape;
    desc.shape_count = 1;
    desc.position[0] = x;
    desc.position[1] = y;
    desc.position[2] = z;
    desc.rotation = rotation;
    es_body body;
    assert_int_equal(es_world_add_body(a->world, &desc, &body), ES_OK);
    return body;
}

static const es_quat no_turn = {0, 0, 0, 1};

static inline es_shape_desc box_shape(float x, float y, float z)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.half_extents = (es_vec3){x, y, z};
    return shape;
}

static inline es_shape_desc ball_shape(float radius)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_SPHERE;
    shape.radius = radius;
    return shape;
}

/* Its surface at y = 0. */
static inline es_body add_floor(arena* a)
{
    es_shape_desc shape = box_shape(50, 1, 50);
    return add_body(a, ES_BODY_STATIC, &shape, 0, -1, 0, no_turn);
}

static inline es_body add_box(arena* a, float half, double x, double y, double z)
{
    es_shape_desc shape = box_shape(half, half, half);
    return add_body(a, ES_BODY_DYNAMIC, &shape, x, y, z, no_turn);
}

static inline es_body_state state_of(const arena* a, es_body body)
{
    es_body_state state;
    assert_int_equal(es_world_get_body(a->world, body, &state), ES_OK);
    return state;
}

static inline void step(arena* a, int count)
{
    for (int i = 0; i < count; i++) assert_int_equal(es_world_step(a->world, 1.0f / 60.0f), ES_OK);
}

static inline double length_of(es_vec3 v) { return sqrt((double)v.x * v.x + (double)v.y * v.y + (double)v.z * v.z); }

#endif
