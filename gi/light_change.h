/* How suddenly a light changed from one frame to the next: 1 where it doubled its light, or moved by a tenth of the scene's extent or 25 degrees;
 * what moves on by less a frame is on its way, and what was made of its light before is worth keeping. */
#ifndef EARTHSHINE_GI_LIGHT_CHANGE_H
#define EARTHSHINE_GI_LIGHT_CHANGE_H

#include "gi/gi.h"
#include "platform/maths.h"

/* Three quarters of that in one frame are a jump: the light is to be taken for a new one. */
#define ES_LIGHT_JUMP 0.75f

/* Of its place and shape; `shift` leads from the origin that `a` is relative to to that of `b`, `extent` is the scene's. */
static inline float es_light_movement(const es_light_state* a, const es_light_state* b, es_vec3 shift, float extent)
{
    const float moved = a->type == ES_LIGHT_DIRECTIONAL ? 0.0f : es_v3_length(es_v3_sub(es_v3_add(a->position, shift), b->position)) / extent;
    const float turned = a->type == ES_LIGHT_POINT ? 0.0f : 1.0f - es_v3_dot(a->direction, b->direction);
    const float opened = a->type == ES_LIGHT_SPOT ? es_maxf(es_absf(a->cos_inner - b->cos_inner), es_absf(a->cos_outer - b->cos_outer)) : 0.0f;
    return 10.0f * es_maxf(es_maxf(moved, turned), opened);
}

/* Of its power as well. */
static inline float es_light_change(const es_light_state* a, const es_light_state* b, es_vec3 shift, float extent)
{
    float difference = 0.0f, larger = 1e-30f;
    for (int k = 0; k < 3; k++) {
        difference += es_absf(a->radiant[k] - b->radiant[k]);
        larger += es_maxf(a->radiant[k], b->radiant[k]);
    }
    return es_maxf(2.0f * difference / larger, es_light_movement(a, b, shift, extent));
}

#endif
