/* The path tracer (Kajiya 1986) with next-event estimation and multiple importance sampling (Veach 1997, §9.2). */
#include "gi/reference/path.h"

#include "gi/light_view.h"
#include "platform/random.h"

/* ---- numbers -------------------------------------------------------------------------------------------------------------------------- */

static uint32_t reverse_bits(uint32_t x)
{
    x = x >> 16 | x << 16;
    x = (x & 0xff00ff00u) >> 8 | (x & 0x00ff00ffu) << 8;
    x = (x & 0xf0f0f0f0u) >> 4 | (x & 0x0f0f0f0fu) << 4;
    x = (x & 0xccccccccu) >> 2 | (x & 0x33333333u) << 2;
    return (x & 0xaaaaaaaau) >> 1 | (x & 0x55555555u) << 1;
}

/* Each bit depends on lower ones only: on reversed bits that is Owen's nested scrambling. */
static uint32_t scramble_reversed(uint32_t x, uint32_t seed)
{
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
}

void es_path_numbers(uint32_t seed, uint32_t pair, uint32_t sample, float u[2])
{
    uint32_t key = es_hash_u32(seed ^ es_hash_u32(pair + 0x51633e2du));
    uint32_t index = reverse_bits(scramble_reversed(reverse_bits(sample), key));
    /* Sobol's first two dimensions: the identity, and Pascal's triangle modulo 2 */
    uint32_t second = 0;
    for (uint32_t bits = index, column = 0x80000000u; bits; bits >>= 1, column ^= column >> 1)
        if (bits & 1) second ^= column;
    /* the first coordinate is the reversed index; its scrambling works on reversed bits, which are the index */
    u[0] = es_unit_float(reverse_bits(scramble_reversed(index, es_hash_u32(key ^ 0x68bc21ebu))));
    u[1] = es_unit_float(reverse_bits(scramble_reversed(reverse_bits(second), es_hash_u32(key ^ 0x02e5be93u))));
}

/* Pairs of dimensions used at each vertex. */
enum { PAIR_SURFACE, PAIR_SURFACE_CHOICE, PAIR_LIGHT, PAIR_LIGHT_CHOICE, PAIRS };

/* ---- light at a surface ------------------------------------------------------------------------------------------------------------------- */

static bool black(es_vec3 c) { return !(c.x > 0.0f || c.y > 0.0f || c.z > 0.0f); }

static es_ray ray_from(const es_trace_surface* s, es_vec3 direction, float max)
{
    es_vec3 side = es_v3_dot(s->geometric, direction) < 0.0f ? es_v3_scale(s->geometric, -1.0f) : s->geometric;
    es_vec3 o = es_offset_origin(s->position, side);
    return (es_ray){{o.x, o.y, o.z}, 0.0f, {direction.x, direction.y, direction.z}, max};
}

/* Light of one spot, point or directional light, reflected towards wo; its shadow ray is traced only when there is any. */
static es_vec3 from_point_light(const es_trace_scene* scene, const es_light_state* light, const es_trace_surface* s, es_vec3 wo, uint32_t* rays)
{
    es_vec3 direction, zero = es_v3(0, 0, 0);
    float strength = 1.0f, max = 3e38f;
    es_ray ray;
    if (light->type == ES_LIGHT_DIRECTIONAL) {
        direction = es_v3_scale(light->direction, -1.0f);
        ray = ray_from(s, direction, max);
    } else {
        es_vec3 d = es_v3_sub(light->position, s->position);
        float distance = es_v3_length(d);
        if (!(distance > 0.0f)) return zero;
        direction = es_v3_scale(d, 1.0f / distance);
        strength = es_light_falloff(light, es_v3_scale(direction, -1.0f), distance) / distance / distance;
        /* towards the light from the moved origin; what is as near to the light as rounding is the light's own place */
        ray = ray_from(s, direction, 0.99999f);
        ray.direction[0] = light->position.x - ray.origin[0];
        ray.direction[1] = light->position.y - ray.origin[1];
        ray.direction[2] = light->position.z - ray.origin[2];
    }
    float cosine = es_v3_dot(s->normal, direction);
    if (!(cosine > 0.0f && es_v3_dot(s->geometric, direction) > 0.0f && strength > 0.0f)) return zero;
    es_vec3 f = es_surface_evaluate(&s->surface, s->normal, direction, wo);
    if (black(f)) return zero;
    ++*rays;
    if (es_trace_blocked(scene, ray)) return zero;
    return es_v3_mul(es_v3_scale(f, cosine * strength), es_v3(light->radiant[0], light->radiant[1], light->radiant[2]));
}

/* Veach's power heuristic, written so that densities near the ends of float's range do not overflow when squared. */
static float power_weight(float a, float b)
{
    if (!(a > 0.0f)) return 0.0f;
    float r = b / a;
    return 1.0f / (1.0f + r * r);
}

static es_vec3 from_glowing(const es_trace_scene* scene, const es_trace_surface* s, es_vec3 wo, const float u[3], uint32_t* rays)
{
    es_light_sample sample;
    es_vec3 zero = es_v3(0, 0, 0);
    if (!es_trace_sample_light(scene, s->position, u, &sample) || black(sample.radiance)) return zero;
    float cosine = es_v3_dot(s->normal, sample.direction);
    if (!(cosine > 0.0f && es_v3_dot(s->geometric, sample.direction) > 0.0f)) return zero;
    es_vec3 f = es_surface_evaluate(&s->surface, s->normal, sample.direction, wo);
    if (black(f)) return zero;
    ++*rays;
    es_ray ray = ray_from(s, sample.direction, 3e38f);
    if (sample.distance < 3e38f) {
        es_vec3 target = es_v3_add(s->position, es_v3_scale(sample.direction, sample.distance));
        ray.direction[0] = target.x - ray.origin[0];
        ray.direction[1] = target.y - ray.origin[1];
        ray.direction[2] = target.z - ray.origin[2];
        ray.max = 0.9999f;
    }
    if (es_trace_blocked(scene, ray)) return zero;
    float weight = power_weight(sample.density, es_surface_density(&s->surface, s->normal, sample.direction, wo));
    return es_v3_mul(es_v3_scale(f, cosine * weight / sample.density), sample.radiance);
}

static es_vec3 lift_to_horizon(es_vec3 n, es_vec3 wo)
{
    return es_v3_add(wo, es_v3_scale(n, es_maxf(1e-3f - es_v3_dot(n, wo), 0.0f)));
}

/* ---- paths ------------------------------------------------------------------------------------------------------------------------------------ */

void es_path_begin(const es_trace_scene* scene, const es_pixel_rays* rays, float x, float y, bool quantised, es_path_start* start)
{
    es_vec3 d = es_pixel_rays_direction(rays, x, y), o = es_pixel_rays_position(rays, x, y, 0.0f);
    es_ray ray = {{o.x, o.y, o.z}, rays->near_depth, {d.x, d.y, d.z}, rays->far_depth};
    es_hit hit;
    *start = (es_path_start){0};
    es_vec3 wo = es_v3_normalize(es_v3_scale(d, -1.0f), es_v3(0, 0, 1));
    start->seen = es_trace_closest(scene, ray, true, &hit);
    if (!start->seen) {
        start->emission = es_trace_environment(scene, es_v3_scale(wo, -1.0f));
        return;
    }
    es_trace_surface_at(scene, &hit, wo, quantised, &start->surface);
    start->wo = lift_to_horizon(start->surface.normal, wo);
    bool unlit = start->surface.surface.model == ES_SURFACE_UNLIT;
    start->emission = unlit ? es_v3_add(start->surface.emission, start->surface.base) : start->surface.emission;
    uint32_t traced = 0;
    for (uint32_t i = 0; i < scene->light_count && start->surface.reflects; i++)
        start->direct = es_v3_add(start->direct, from_point_light(scene, &scene->lights[i], &start->surface, start->wo, &traced));
}

uint32_t es_path_trace(const es_trace_scene* scene, const es_path_start* start, uint32_t bounces, uint32_t seed, uint32_t sample, es_vec3* bounce)
{
    uint32_t rays = 0;
    for (uint32_t b = 0; b <= bounces; b++) bounce[b] = es_v3(0, 0, 0);
    if (!start->seen || !start->surface.reflects) return 0;
    bounce[0] = start->direct;
    const bool glowing = scene->emitter_count || scene->has_environment;
    es_trace_surface s = start->surface;
    es_vec3 wo = start->wo, through = es_v3(1, 1, 1);
    for (uint32_t b = 0; b <= bounces; b++) {
        float u[4], direction[4];
        es_path_numbers(seed, b * PAIRS + PAIR_LIGHT_CHOICE, sample, u);
        if (b && scene->light_count) {
            uint32_t which = (uint32_t)(u[0] * (float)scene->light_count);
            es_vec3 light = from_point_light(scene, &scene->lights[which], &s, wo, &rays);
            bounce[b] = es_v3_add(bounce[b], es_v3_mul(through, es_v3_scale(light, (float)scene->light_count)));
        }
        if (glowing) {
            float v[3] = {u[1], 0, 0};
            es_path_numbers(seed, b * PAIRS + PAIR_LIGHT, sample, v + 1);
            bounce[b] = es_v3_add(bounce[b], es_v3_mul(through, from_glowing(scene, &s, wo, v, &rays)));
        }
        if (b == bounces && !glowing) break;
        /* Russian roulette on what is left of the path, never surer than 0.95 */
        es_path_numbers(seed, b * PAIRS + PAIR_SURFACE_CHOICE, sample, direction);
        if (b >= 4) {
            float keep = es_minf(es_maxf(through.x, es_maxf(through.y, through.z)), 0.95f);
            if (!(direction[1] < keep)) break;
            through = es_v3_scale(through, 1.0f / keep);
        }
        es_path_numbers(seed, b * PAIRS + PAIR_SURFACE, sample, u);
        float choice[3] = {direction[0], u[0], u[1]};
        es_surface_sample next;
        if (!es_surface_sample_direction(&s.surface, s.normal, wo, choice, &next)) break;
        if (!(es_v3_dot(s.geometric, next.wi) > 0.0f)) break; /* below the triangle: as for lights, nothing comes from there */
        es_vec3 carried = es_v3_mul(through, next.weight);
        if (black(carried)) break;
        es_hit hit;
        rays++;
        es_vec3 from = s.position;
        if (!es_trace_closest(scene, ray_from(&s, next.wi, 3e38f), false, &hit)) {
            if (scene->has_environment) {
                float weight = power_weight(next.density, es_trace_light_density(scene, next.wi, 0.0f, NULL));
                bounce[b] = es_v3_add(bounce[b], es_v3_scale(es_v3_mul(carried, es_trace_environment(scene, next.wi)), weight));
            }
            break;
        }
        es_vec3 back = es_v3_scale(next.wi, -1.0f);
        es_trace_surface_at(scene, &hit, back, false, &s);
        if (scene->emitter_count && !black(s.emission)) {
            float weight = power_weight(next.density, es_trace_light_density(scene, next.wi, es_v3_length(es_v3_sub(s.position, from)), &s));
            bounce[b] = es_v3_add(bounce[b], es_v3_scale(es_v3_mul(carried, s.emission), weight));
        }
        if (b == bounces || !s.reflects) break;
        through = carried;
        wo = lift_to_horizon(s.normal, back);
    }
    return rays;
}
