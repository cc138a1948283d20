/* Turning by the shortest arc, one vector at a time; gi/kernels/edited_lobe_simd.h has the same on eight lanes. */
#ifndef EARTHSHINE_GI_EDIT_TURN_H
#define EARTHSHINE_GI_EDIT_TURN_H

#include "platform/maths.h"

/* v, unit, as the rotation by the shortest arc that takes `from` to `to`, unit both, takes it; with from = -to, where no arc is the shortest, mirrored across them, so that
 * `from` still becomes `to` and what is across it stays. Unit. */
static inline es_vec3 es_turned(es_vec3 v, es_vec3 from, es_vec3 to)
{
    const es_vec3 sum = es_v3_add(from, to);
    const float a = es_v3_dot(sum, v) / es_maxf(1.0f + es_v3_dot(from, to), 1e-4f), b = 2.0f * es_v3_dot(from, v);
    return es_v3_normalize(es_v3_add(es_v3_sub(v, es_v3_scale(sum, a)), es_v3_scale(to, b)), v);
}

#endif
