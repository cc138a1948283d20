/* Rays of a batch of pixels in runs, and what their hits reflect (gi/near_light.h). */
#include "gi/near_light.h"

#include "gi/bias_compensation.h"
#include "platform/maths.h"

enum { RUN = 256 };

/* Towards the pixel, of what the hit receives: π · its radiance · the share that bounding leaves out. */
static es_vec3 left_out(const es_near_light* near, const es_hit* found, es_vec3 wi, float pixel_cosine)
{
    const es_trace_scene* scene = near->scene;
    es_vec3 sum = es_v3(0, 0, 0), back = es_v3_scale(wi, -1.0f);
    es_trace_surface hit;
    es_trace_surface_at(scene, found, back, false, &hit);
    float hit_cosine = es_v3_dot(hit.normal, back), bounded = found->t * found->t;
    float geometry = pixel_cosine * hit_cosine * near->distance * near->distance;
    if (!(hit.reflects && geometry > bounded)) return sum;
    float share = ES_PI * (1.0f - bounded / geometry);
    for (uint32_t i = 0; i < scene->light_count; i++) {
        const es_light_state* light = &scene->lights[i];
        es_vec3 from_lamp;
        float strength;
        if (!es_lamp_reaches(scene, light, &hit, &from_lamp, &strength)) continue;
        float lamp_cosine = es_v3_dot(hit.normal, from_lamp);
        if (!(lamp_cosine > 0.0f)) continue;
        es_vec3 reflected = es_v3_scale(es_surface_evaluate(&hit.surface, hit.normal, from_lamp, back), share * lamp_cosine * strength);
        sum = es_v3_add(sum, es_v3_mul(reflected, es_v3(light->radiant[0], light->radiant[1], light->radiant[2])));
    }
    return sum;
}

static void receive(es_shade_batch* b, uint32_t i, es_vec3 wi, es_vec3 light, bool lobes)
{
    const float sent[3] = {light.x, light.y, light.z};
    float pass = 1.0f;
    if (lobes && b->lobed[i / 8]) {
        es_surface surface = {.specular = {b->f0[0][i], b->f0[1][i], b->f0[2][i]}, .roughness = b->roughness[i], .model = (uint32_t)b->model[i]};
        es_vec3 lobe;
        es_surface_parts(&surface, es_v3(b->nx[i], b->ny[i], b->nz[i]), wi, es_v3(b->vx[i], b->vy[i], b->vz[i]), &pass, &lobe);
        const float reflected[3] = {lobe.x, lobe.y, lobe.z};
        for (int k = 0; k < 3; k++) b->s[k][i] += sent[k] * reflected[k];
    }
    for (int k = 0; k < 3; k++) b->e[k][i] += sent[k] * pass;
}

static void add_run(const es_near_light* near, es_shade_batch* b, const es_ray* rays, const uint32_t* places, uint32_t count, bool lobes)
{
    es_hit hits[RUN];
    if (near->scene->has_masks)
        for (uint32_t k = 0; k < count; k++) es_trace_closest(near->scene, rays[k], false, &hits[k]);
    else
        es_bvh_closest(near->scene->bvh, ES_RAYS_SINGLE, rays, count, hits);
    for (uint32_t k = 0; k < count; k++) {
        if (hits[k].primitive == ES_NO_PRIMITIVE) continue;
        const uint32_t i = places[k];
        es_vec3 wi = es_v3(rays[k].direction[0], rays[k].direction[1], rays[k].direction[2]);
        es_vec3 light = left_out(near, &hits[k], wi, es_v3_dot(es_v3(b->nx[i], b->ny[i], b->nz[i]), wi));
        receive(b, i, wi, light, lobes);
    }
}

static void add(const es_shade_near* shade, es_shade_batch* b, uint32_t lanes, bool lobes)
{
    const es_near_light* near = (const es_near_light*)shade;
    es_ray rays[RUN];
    uint32_t places[RUN], count = 0;
    for (uint32_t i = 0; i < lanes; i++) {
        es_vec3 n = es_v3(b->nx[i], b->ny[i], b->nz[i]), t, s;
        if (!(es_v3_dot(n, n) > 0.0f)) continue;
        float sine, cosine, r = es_sqrt(b->direction[0][i]);
        es_orthonormal_basis(n, &t, &s);
        es_sincos(2.0f * ES_PI * b->direction[1][i], &sine, &cosine);
        es_vec3 wi = es_v3_add(es_v3_add(es_v3_scale(t, r * cosine), es_v3_scale(s, r * sine)), es_v3_scale(n, es_sqrt(1.0f - b->direction[0][i])));
        /* rays begin off the triangle, on its outside */
        es_vec3 origin = es_v3(b->ox[i], b->oy[i], b->oz[i]);
        if (!(es_v3_dot(es_v3_sub(origin, es_v3(b->px[i], b->py[i], b->pz[i])), wi) > 0.0f)) continue;
        rays[count] = (es_ray){{origin.x, origin.y, origin.z}, 0.0f, {wi.x, wi.y, wi.z}, near->distance};
        places[count++] = i;
        if (count < RUN) continue;
        add_run(near, b, rays, places, count, lobes);
        count = 0;
    }
    add_run(near, b, rays, places, count, lobes);
}

es_near_light es_near_light_of(const es_trace_scene* scene, float distance, float offset)
{
    return (es_near_light){.shade = {add, offset}, .scene = scene, .distance = distance};
}
