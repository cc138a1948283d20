/* See piles.h. */
#include "piles.h"

#include <math.h>

static es_result add_box(es_world* world, es_body_type type, const double position[3], const double half[3], const double rotation[4], es_body* body)
{
    es_shape_desc shape = es_default_shape_desc();
    shape.type = ES_SHAPE_BOX;
    shape.half_extents = (es_vec3){(float)half[0], (float)half[1], (float)half[2]};
    shape.density = 1000;
    shape.friction = 0.6f;
    es_body_desc desc = es_default_body_desc();
    desc.type = type;
    desc.shapes = &shape;
    desc.shape_count = 1;
    for (int k = 0; k < 3; k++) desc.position[k] = position[k];
    desc.rotation = (es_quat){(float)rotation[0], (float)rotation[1], (float)rotation[2], (float)rotation[3]};
    return es_world_add_body(world, &desc, body);
}

static const double upright[4] = {0, 0, 0, 1};

static es_result add_floor(es_world* world)
{
    es_body floor;
    return add_box(world, ES_BODY_STATIC, (double[]){0, -1, 0}, (double[]){50, 1, 50}, upright, &floor);
}

es_result pile_make_pyramid(es_world* world, es_body bodies[PILE_PYRAMID])
{
    es_result result = add_floor(world);
    int n = 0;
    for (int row = 0; row < 20 && result == ES_OK; row++)
        for (int i = 0; i < 20 - row && result == ES_OK; i++)
            result = add_box(world, ES_BODY_DYNAMIC, (double[]){(i - (20 - row - 1) * 0.5) * 1.05, 0.5 + row, 0}, (double[]){0.5, 0.5, 0.5}, upright, &bodies[n++]);
    return result;
}

static double random_unit(uint32_t* state)
{
    uint32_t x = *state;
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    *state = x;
    return (double)(x >> 8) * 0x1p-24;
}

es_result pile_make_drop(es_world* world, es_body bodies[PILE_DROP])
{
    es_result result = add_floor(world);
    es_body wall;
    for (int side = -1; side <= 1 && result == ES_OK; side += 2) {
        result = add_box(world, ES_BODY_STATIC, (double[]){side * 8.0, 10, 0}, (double[]){1, 12, 9}, upright, &wall);
        if (result == ES_OK) result = add_box(world, ES_BODY_STATIC, (double[]){0, 10, side * 8.0}, (double[]){9, 12, 1}, upright, &wall);
    }
    uint32_t seed = 4242;
    int n = 0;
    for (int y = 0; y < 10; y++)
        for (int z = 0; z < 10; z++)
            for (int x = 0; x < 10 && result == ES_OK; x++) {
                double jitter[3], half[3], q[4], squared = 0;
                for (int k = 0; k < 3; k++) jitter[k] = 0.2 * (random_unit(&seed) - 0.5);
                for (int k = 0; k < 3; k++) half[k] = 0.25 + 0.2 * random_unit(&seed);
                for (int k = 0; k < 4; k++) {
                    q[k] = random_unit(&seed) - 0.5;
                    squared += q[k] * q[k];
                }
                for (int k = 0; k < 4; k++) q[k] /= sqrt(squared);
                result = add_box(world, ES_BODY_DYNAMIC, (double[]){(x - 4.5) * 1.3 + jitter[0], 1.2 + y * 1.3 + jitter[1], (z - 4.5) * 1.3 + jitter[2]}, half, q, &bodies[n++]);
            }
    return result;
}
