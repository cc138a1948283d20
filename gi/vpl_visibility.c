/* Rays between pixels and virtual point lights.
 *
 * Both ends are moved off their triangles: from a pixel's triangle towards the eye, from a light's triangle towards where its light came
 * from. A segment to the other side of either triangle is then stopped by that triangle, so that interpolated normals let no light
 * through. */
#include "gi/vpl_visibility.h"

#include <math.h>

/* How far from a light's position its triangle is looked for, share of the extent: rasterized and traced depths differ where triangles
 * are seen at a slant. */
#define SEARCH_SHARE 1e-3f

enum { RUN = 256 };

static es_vec3 vector_of(const float v[3]) { return es_v3(v[0], v[1], v[2]); }

/* The triangle's own side, not the interpolated normal's. */
static es_vec3 end_of(const es_trace_scene* scene, const es_vpl_record* vpl, float extent)
{
    es_vec3 position = vector_of(vpl->position), incident = vector_of(vpl->incident), normal = vector_of(vpl->normal);
    float largest = es_maxf(es_absf(position.x), es_maxf(es_absf(position.y), es_absf(position.z)));
    float reach = extent * SEARCH_SHARE + largest * 6.1e-5f;
    es_vec3 from = es_v3_add(position, es_v3_scale(incident, reach));
    es_ray ray = {{from.x, from.y, from.z}, 0.0f, {-incident.x, -incident.y, -incident.z}, 2.0f * reach};
    es_hit hit;
    if (es_trace_closest(scene, ray, false, &hit)) {
        es_vec3 c[3];
        es_bvh_triangle(scene->bvh, hit.primitive, c);
        normal = es_v3_normalize(es_v3_cross(es_v3_sub(c[1], c[0]), es_v3_sub(c[2], c[0])), normal);
        if (es_v3_dot(normal, incident) < 0.0f) normal = es_v3_scale(normal, -1.0f);
        position = es_v3_sub(from, es_v3_scale(incident, hit.t));
    }
    return es_offset_origin(es_v3_add(position, es_v3_scale(normal, extent * ES_RAY_OFFSET_SHARE)), normal);
}

static void test_run(const es_trace_scene* scene, es_ray_kind kind, const es_ray* rays, const uint32_t* lanes, uint32_t count, int32_t* visible)
{
    uint8_t blocked[RUN];
    if (scene->has_masks)
        for (uint32_t i = 0; i < count; i++) blocked[i] = es_trace_blocked(scene, rays[i]);
    else
        es_bvh_any(scene->bvh, kind, rays, count, blocked);
    for (uint32_t i = 0; i < count; i++) visible[lanes[i]] = blocked[i] ? 0 : -1;
}

static void test(const es_shade_visibility* shade, uint32_t vpl, es_shade_batch* b, uint32_t lanes)
{
    const es_vpl_visibility* visibility = (const es_vpl_visibility*)shade;
    const es_vpl_record* light = &visibility->vpls[vpl];
    const es_vec3 end = visibility->ends[vpl], position = vector_of(light->position), normal = vector_of(light->normal);
    es_ray rays[RUN];
    uint32_t places[RUN], count = 0;
    for (uint32_t i = 0; i < lanes; i++) {
        float dx = b->px[i] - position.x, dy = b->py[i] - position.y, dz = b->pz[i] - position.z;
        float light_side = dx * normal.x + dy * normal.y + dz * normal.z, pixel_side = dx * b->nx[i] + dy * b->ny[i] + dz * b->nz[i];
        if (light->parallel) {
            light_side = 1.0f;
            pixel_side = normal.x * b->nx[i] + normal.y * b->ny[i] + normal.z * b->nz[i];
        }
        b->visible[i] = 0;
        if (!(light_side > 0.0f && pixel_side < 0.0f)) continue;
        /* from the light: neighbours then share their origin, or their direction */
        rays[count] = light->parallel ? (es_ray){{b->ox[i], b->oy[i], b->oz[i]}, 0.0f, {-normal.x, -normal.y, -normal.z}, INFINITY}
                                      : (es_ray){{end.x, end.y, end.z}, 0.0f, {b->ox[i] - end.x, b->oy[i] - end.y, b->oz[i] - end.z}, 1.0f};
        places[count++] = i;
        if (count < RUN) continue;
        test_run(visibility->scene, ES_RAYS_COHERENT, rays, places, count, b->visible);
        count = 0;
    }
    test_run(visibility->scene, ES_RAYS_COHERENT, rays, places, count, b->visible);
}

static void test_chosen(const es_shade_visibility* shade, es_shade_batch* b, uint32_t lanes)
{
    const es_vpl_visibility* visibility = (const es_vpl_visibility*)shade;
    es_ray rays[RUN];
    uint32_t places[RUN], count = 0;
    for (uint32_t i = 0; i < lanes; i++) {
        b->visible[i] = 0;
        if (b->chosen[i] < 0) continue;
        const es_vec3 end = visibility->ends[b->chosen[i]];
        /* from the pixel: those of a batch lie closer together than their lights */
        rays[count] = (es_ray){{b->ox[i], b->oy[i], b->oz[i]}, 0.0f, {end.x - b->ox[i], end.y - b->oy[i], end.z - b->oz[i]}, 1.0f};
        places[count++] = i;
        if (count < RUN) continue;
        test_run(visibility->scene, ES_RAYS_SINGLE, rays, places, count, b->visible);
        count = 0;
    }
    test_run(visibility->scene, ES_RAYS_SINGLE, rays, places, count, b->visible);
}

typedef struct ends_job { es_vpl_visibility* visibility; float extent; } ends_job;

static void find_ends(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    ends_job* job = user;
    for (uint32_t i = begin; i < end; i++)
        job->visibility->ends[i] = job->visibility->vpls[i].parallel ? es_v3(0, 0, 0) : end_of(job->visibility->scene, &job->visibility->vpls[i], job->extent);
}

es_result es_vpl_visibility_prepare(es_arena* arena, const es_trace_scene* scene, const es_vpl_record* vpls, uint32_t count, float extent, es_vpl_visibility* visibility)
{
    *visibility = (es_vpl_visibility){.shade = {test, test_chosen, extent * ES_RAY_OFFSET_SHARE}, .scene = scene, .vpls = vpls};
    visibility->ends = es_arena_allocate(arena, ((size_t)count + 1) * sizeof *visibility->ends);
    if (!visibility->ends) return es_context_last_result(scene->context);
    ends_job job = {visibility, extent};
    es_parallel_for(scene->context, count, 64, find_ends, &job);
    return ES_OK;
}
