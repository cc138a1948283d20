/* What a spot, point or directional light brings to eight points if nothing stands between. */
#ifndef EARTHSHINE_GI_LIGHT_STRENGTH_SIMD_H
#define EARTHSHINE_GI_LIGHT_STRENGTH_SIMD_H

#include "gi/light_view.h"
#include "platform/simd.h"

typedef struct es_light_strength {
    es_light_state light;
    float nearest2;                /* m²; a light in a surface leaves its neighbourhood finite */
    float cone_scale;
} es_light_strength;

VINL es_light_strength es_light_strength_of(const es_light_view* view)
{
    const es_light_state* light = &view->light;
    /* a millionth of the scene's extent */
    const float nearest = view->near_plane * 1e-3f;
    const float width = light->cos_inner - light->cos_outer;
    return (es_light_strength){*light, nearest * nearest, 1.0f / (width > 1e-6f ? width : 1e-6f)};
}

/* Unit vectors towards the light, and the irradiance of a surface that faces it, over the light's radiant. */
VINL void es_light_strength_v(const es_light_strength* s, const vf p[3], vf towards[3], vf* strength)
{
    const es_light_state* light = &s->light;
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    const vf ax = vf_set1(light->direction.x), ay = vf_set1(light->direction.y), az = vf_set1(light->direction.z);
    if (light->type == ES_LIGHT_DIRECTIONAL) {
        towards[0] = vf_neg(ax);
        towards[1] = vf_neg(ay);
        towards[2] = vf_neg(az);
        *strength = one;
        return;
    }
    vf lx = vf_set1(light->position.x) - p[0], ly = vf_set1(light->position.y) - p[1], lz = vf_set1(light->position.z) - p[2];
    vf d2 = vf_max(lx * lx + ly * ly + lz * lz, vf_set1(s->nearest2));
    vf distance = vf_sqrt(d2), inverse = one / distance;
    towards[0] = lx = lx * inverse;
    towards[1] = ly = ly * inverse;
    towards[2] = lz = lz * inverse;
    *strength = inverse * inverse;
    if (light->type == ES_LIGHT_SPOT) {
        vf cosine = vf_neg(lx * ax + ly * ay + lz * az);
        vf t = vf_min(vf_max((cosine - vf_set1(light->cos_outer)) * vf_set1(s->cone_scale), zero), one);
        *strength = *strength * t * t;
    }
    if (light->range > 0.0f) {
        vf q = vf_min(distance * vf_set1(1.0f / light->range), vf_set1(2.0f)), q2 = q * q;
        *strength = *strength * vf_min(vf_max(one - q2 * q2, zero), one);
    }
}

#endif
