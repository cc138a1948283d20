#include "gi/reference/refraction.h"

#include "platform/maths.h"
#include "raster/solid_share.h"

bool es_refract(es_vec3 d, es_vec3 n, float ratio, es_vec3* refracted)
{
    const float c = -es_v3_dot(n, d), rest = 1.0f - ratio * ratio * es_maxf(1.0f - c * c, 0.0f);
    if (!(rest > 0.0f)) return false;
    const es_vec3 out = es_v3_add(es_v3_scale(d, ratio), es_v3_scale(n, ratio * c - es_sqrt(rest)));
    *refracted = es_v3_normalize(out, d);
    return true;
}

float es_interface_share(const es_surface* s, float cosine)
{
    const float f90 = es_minf(25.0f * es_maxf(s->specular.x, es_maxf(s->specular.y, s->specular.z)), 1.0f), a = 1.0f - es_clampf(cosine, 0.0f, 1.0f), a2 = a * a;
    return 1.0f - f90 * (0.04f + 0.96f * (a2 * a2 * a));
}

static uint32_t instance_of(const es_trace_scene* scene, uint32_t primitive) { return es_bvh_primitives(scene->bvh)[primitive].instance; }

es_refraction es_trace_refraction(const es_trace_scene* scene, const es_trace_surface* surface, es_vec3 d)
{
    const uint32_t instance = instance_of(scene, surface->primitive);
    const float ior = es_ior_of(&scene->materials[scene->instances[instance].material]);
    es_refraction r = {.position = surface->position, .direction = d, .weight = es_v3(0, 0, 0)};
    /* a bent normal may face away from who sees the surface */
    es_vec3 n = es_v3_dot(surface->normal, d) < 0.0f ? surface->normal : surface->geometric, inside;
    if (!es_refract(d, n, 1.0f / ior, &inside)) return r;
    r.weight = es_v3_scale(surface->tint, es_interface_share(&surface->surface, -es_v3_dot(n, d)));
    es_vec3 origin = es_offset_origin(surface->position, es_v3_scale(surface->geometric, -1.0f));
    for (int i = 0; i < ES_REFRACTION_MOST; i++) {
        es_ray ray = {{origin.x, origin.y, origin.z}, 0.0f, {inside.x, inside.y, inside.z}, 3e38f};
        es_hit hit;
        r.rays++;
        r.position = origin;
        r.direction = inside;
        /* out of an open mesh, or something else inside: it is seen along the ray as it stands */
        if (!es_trace_closest(scene, ray, false, &hit) || instance_of(scene, hit.primitive) != instance) return r;
        es_trace_surface s;
        es_trace_surface_at(scene, &hit, es_v3_scale(inside, -1.0f), false, &s);
        n = es_v3_dot(s.normal, inside) < 0.0f ? s.normal : s.geometric;
        es_vec3 out;
        if (es_refract(inside, n, ior, &out)) {
            r.weight = es_v3_scale(r.weight, es_interface_share(&s.surface, -es_v3_dot(n, out)));
            r.position = es_offset_origin(s.position, es_v3_scale(s.geometric, -1.0f));
            r.direction = out;
            return r;
        }
        inside = es_v3_normalize(es_v3_add(inside, es_v3_scale(n, -2.0f * es_v3_dot(n, inside))), inside);
        if (es_v3_dot(inside, s.geometric) < 0.0f) inside = es_v3_normalize(es_v3_add(inside, es_v3_scale(s.geometric, -2.0f * es_v3_dot(s.geometric, inside))), inside);
        origin = es_offset_origin(s.position, s.geometric);
    }
    r.position = origin;
    r.direction = inside;
    return r;
}
