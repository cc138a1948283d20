/* The path tracer (Kajiya 1986) with next-event estimation, shared first bounces and multiple importance sampling (Veach 1997). */
#include "gi/reference/path.h"

#include "gi/reference/light_choice.h"
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
    /* Sobol's first two dimensions: the identity, and Pascal's triangle modulo 2, a product of five sparse matrices */
    uint32_t second = reverse_bits(index);
    second ^= second << 16;
    second ^= (second & 0x00ff00ffu) << 8;
    second ^= (second & 0x0f0f0f0fu) << 4;
    second ^= (second & 0x33333333u) << 2;
    second ^= (second & 0x55555555u) << 1;
    /* the first coordinate is the reversed index; its scrambling works on reversed bits, which are the index */
    u[0] = es_unit_float(reverse_bits(scramble_reversed(index, es_hash_u32(key ^ 0x68bc21ebu))));
    u[1] = es_unit_float(reverse_bits(scramble_reversed(reverse_bits(second), es_hash_u32(key ^ 0x02e5be93u))));
}

/* Pairs of dimensions used at each vertex. */
enum { PAIR_SURFACE, PAIR_SURFACE_CHOICE, PAIR_LIGHT, PAIR_LIGHT_CHOICE, PAIRS };
/* of a group's light vertices */
enum { PAIR_VERTICES = 0xfffeu };

/* ---- light at a surface ------------------------------------------------------------------------------------------------------------------- */

static bool black(es_vec3 c) { return !(c.x > 0.0f || c.y > 0.0f || c.z > 0.0f); }

static es_ray ray_from(const es_trace_surface* s, es_vec3 direction, float max)
{
    es_vec3 o = es_offset_origin(s->position, s->geometric);
    return (es_ray){{o.x, o.y, o.z}, 0.0f, {direction.x, direction.y, direction.z}, max};
}

/* What arrives at a surface from one spot, point or directional light, unless its shadow ray is blocked: W/m² of the surface. */
typedef struct lamp_light { es_vec3 towards, irradiance; float distance; es_ray shadow; } lamp_light;

static bool light_of(const es_light_state* light, const es_trace_surface* s, lamp_light* l)
{
    float strength;
    if (!es_trace_towards_light(light, s->position, &l->towards, &l->distance, &strength)) return false;
    float cosine = es_v3_dot(s->normal, l->towards);
    if (!(cosine > 0.0f && es_v3_dot(s->geometric, l->towards) > 0.0f && strength > 0.0f)) return false;
    l->irradiance = es_v3_scale(es_v3(light->radiant[0], light->radiant[1], light->radiant[2]), cosine * strength);
    l->shadow = es_trace_shadow_ray(light, s, l->towards);
    return true;
}

/* Light of one lamp, reflected towards wo; its shadow ray is traced only when there is any. */
static es_vec3 from_lamp(const es_trace_scene* scene, const es_light_state* light, const es_trace_surface* s, es_vec3 wo, uint32_t* rays)
{
    es_vec3 zero = es_v3(0, 0, 0);
    lamp_light l;
    if (!light_of(light, s, &l)) return zero;
    es_vec3 f = es_surface_evaluate(&s->surface, s->normal, l.towards, wo);
    if (black(f)) return zero;
    ++*rays;
    return es_trace_blocked(scene, l.shadow) ? zero : es_v3_mul(f, l.irradiance);
}

/* Veach's power heuristic, written so that densities near the ends of float's range do not overflow when squared. */
static float power_weight(float a, float b)
{
    if (!(a > 0.0f)) return 0.0f;
    float r = b / a;
    return 1.0f / (1.0f + r * r);
}

/* Light of a glowing surface or the environment at s, over its density and weighted against directions that s would reflect towards wo. False when
 * there is none. */
static bool light_of_glow(const es_trace_scene* scene, const es_trace_surface* s, es_vec3 wo, const float u[3], es_vec3* towards, es_vec3* irradiance, uint32_t* rays)
{
    es_light_sample sample;
    if (!es_trace_sample_light(scene, s->position, u, &sample) || black(sample.radiance)) return false;
    float cosine = es_v3_dot(s->normal, sample.direction);
    if (!(cosine > 0.0f && es_v3_dot(s->geometric, sample.direction) > 0.0f)) return false;
    ++*rays;
    es_ray ray = ray_from(s, sample.direction, 3e38f);
    if (sample.distance < 3e38f) {
        es_vec3 target = es_v3_add(s->position, es_v3_scale(sample.direction, sample.distance));
        ray.direction[0] = target.x - ray.origin[0];
        ray.direction[1] = target.y - ray.origin[1];
        ray.direction[2] = target.z - ray.origin[2];
        ray.max = 0.9999f;
    }
    if (es_trace_blocked(scene, ray)) return false;
    float weight = power_weight(sample.density, es_surface_density(&s->surface, s->normal, sample.direction, wo));
    *towards = sample.direction;
    *irradiance = es_v3_scale(sample.radiance, cosine * weight / sample.density);
    return true;
}

static es_vec3 from_glowing(const es_trace_scene* scene, const es_trace_surface* s, es_vec3 wo, const float u[3], uint32_t* rays)
{
    es_vec3 towards, irradiance;
    if (!light_of_glow(scene, s, wo, u, &towards, &irradiance, rays)) return es_v3(0, 0, 0);
    return es_v3_mul(es_surface_evaluate(&s->surface, s->normal, towards, wo), irradiance);
}

static es_vec3 lift_to_horizon(es_vec3 n, es_vec3 wo)
{
    return es_v3_add(wo, es_v3_scale(n, es_maxf(1e-3f - es_v3_dot(n, wo), 0.0f)));
}

/* ---- from the camera ---------------------------------------------------------------------------------------------------------------------- */

es_ray es_path_ray(const es_pixel_rays* rays, float x, float y)
{
    es_vec3 d = es_pixel_rays_direction(rays, x, y), o = es_pixel_rays_position(rays, x, y, 0.0f);
    return (es_ray){{o.x, o.y, o.z}, rays->near_depth, {d.x, d.y, d.z}, rays->far_depth};
}

void es_path_begin(const es_trace_scene* scene, const es_ray* ray, const es_hit* hit, bool quantised, es_path_start* start)
{
    *start = (es_path_start){.seen = hit->primitive != ES_NO_PRIMITIVE, .weight = es_v3(1, 1, 1)};
    es_vec3 wo = es_v3_normalize(es_v3(-ray->direction[0], -ray->direction[1], -ray->direction[2]), es_v3(0, 0, 1));
    if (!start->seen) {
        start->emission = es_trace_environment(scene, es_v3_scale(wo, -1.0f));
        return;
    }
    es_trace_surface_at(scene, hit, wo, quantised, &start->surface);
    start->wo = lift_to_horizon(start->surface.normal, wo);
    bool unlit = start->surface.surface.model == ES_SURFACE_UNLIT;
    start->emission = unlit ? es_v3_add(start->surface.emission, start->surface.base) : start->surface.emission;
}

es_vec3 es_path_direct(const es_trace_scene* scene, const es_path_start* start, uint32_t* rays)
{
    es_vec3 sum = es_v3(0, 0, 0);
    for (uint32_t i = 0; i < scene->light_count && start->seen && start->surface.reflects; i++)
        sum = es_v3_add(sum, from_lamp(scene, &scene->lights[i], &start->surface, start->wo, rays));
    return sum;
}

/* ---- one path -------------------------------------------------------------------------------------------------------------------------- */

typedef struct path_numbers { uint32_t seed, sample; } path_numbers;

static bool glows(const es_trace_scene* scene) { return scene->emitter_count || scene->has_environment; }

static void numbers_of_glow(path_numbers n, uint32_t vertex, float v[3])
{
    float choice[2];
    es_path_numbers(n.seed, vertex * PAIRS + PAIR_LIGHT_CHOICE, n.sample, choice);
    v[0] = choice[1];
    es_path_numbers(n.seed, vertex * PAIRS + PAIR_LIGHT, n.sample, v + 1);
}

static bool choose_lamp(const es_trace_scene* scene, path_numbers n, uint32_t vertex, const es_trace_surface* s, uint32_t* which, float* probability)
{
    float u[2] = {0, 0};
    if (scene->light_count > 1) es_path_numbers(n.seed, vertex * PAIRS + PAIR_LIGHT_CHOICE, n.sample, u);
    return es_trace_choose_light(scene, s, u[0], which, probability);
}

/* Russian roulette on what is left of a path, never surer than 0.95, from its fifth vertex on. */
static bool leave(path_numbers n, uint32_t vertex, const es_trace_surface* s, es_vec3 wo, es_vec3* through, es_surface_sample* next)
{
    float u[2], choice[2];
    es_path_numbers(n.seed, vertex * PAIRS + PAIR_SURFACE_CHOICE, n.sample, choice);
    if (vertex >= 4) {
        float keep = es_minf(es_maxf(through->x, es_maxf(through->y, through->z)), 0.95f);
        if (!(choice[1] < keep)) return false;
        *through = es_v3_scale(*through, 1.0f / keep);
    }
    es_path_numbers(n.seed, vertex * PAIRS + PAIR_SURFACE, n.sample, u);
    const float three[3] = {choice[0], u[0], u[1]};
    /* below the triangle: as for lights, nothing comes from there */
    return es_surface_sample_direction(&s->surface, s->normal, wo, three, next) && es_v3_dot(s->geometric, next->wi) > 0.0f;
}

/* What the direction itself sees: the environment, or the emission of the surface it meets; weighted against sampling that. */
static es_vec3 environment_seen(const es_trace_scene* scene, const es_surface_sample* by)
{
    if (!scene->has_environment) return es_v3(0, 0, 0);
    return es_v3_scale(es_trace_environment(scene, by->wi), power_weight(by->density, es_trace_light_density(scene, by->wi, 0.0f, NULL)));
}
static es_vec3 emission_seen(const es_trace_scene* scene, const es_surface_sample* by, es_vec3 from, const es_trace_surface* hit)
{
    if (!scene->emitter_count || black(hit->emission)) return es_v3(0, 0, 0);
    return es_v3_scale(hit->emission, power_weight(by->density, es_trace_light_density(scene, by->wi, es_v3_length(es_v3_sub(hit->position, from)), hit)));
}

/* The path goes on from s, the first bounce, by a direction of it. What comes from there, over the density and times the cosine but before s
 * reflects it, is sorted by bounces: light[b], b >= 1. */
static uint32_t go_on(const es_path_job* job, path_numbers n, es_trace_surface s, es_vec3 wo, es_vec3* towards, es_vec3* light)
{
    const es_trace_scene* scene = job->scene;
    uint32_t rays = 0;
    es_vec3 through = es_v3(1, 1, 1);
    for (uint32_t b = 1; b <= job->bounces; b++) {
        if (b > 1) {
            uint32_t which;
            float probability;
            if (choose_lamp(scene, n, b, &s, &which, &probability))
                light[b] = es_v3_add(light[b], es_v3_scale(es_v3_mul(through, from_lamp(scene, &scene->lights[which], &s, wo, &rays)), 1.0f / probability));
            if (glows(scene)) {
                float v[3];
                numbers_of_glow(n, b, v);
                light[b] = es_v3_add(light[b], es_v3_mul(through, from_glowing(scene, &s, wo, v, &rays)));
            }
        }
        if (b == job->bounces && !glows(scene)) break;
        es_surface_sample next;
        if (!leave(n, b, &s, wo, &through, &next)) break;
        if (b == 1) {
            *towards = next.wi;
            through = es_v3_scale(through, es_v3_dot(s.normal, next.wi) / next.density);
        } else {
            through = es_v3_mul(through, next.weight);
        }
        if (black(through)) break;
        es_hit hit;
        rays++;
        es_vec3 from = s.position;
        if (!es_trace_closest(scene, ray_from(&s, next.wi, 3e38f), false, &hit)) {
            light[b] = es_v3_add(light[b], es_v3_mul(through, environment_seen(scene, &next)));
            break;
        }
        wo = es_v3_scale(next.wi, -1.0f);
        es_trace_surface_at(scene, &hit, wo, false, &s);
        light[b] = es_v3_add(light[b], es_v3_mul(through, emission_seen(scene, &next, from, &s)));
        if (!s.reflects) break;
        wo = lift_to_horizon(s.normal, wo);
    }
    return rays;
}

/* ---- what a group shares ------------------------------------------------------------------------------------------------------------------ */

enum { NO_OWNER = 0xffffffffu };

/* A point that sends light to the group. */
typedef struct shared_point {
    const es_trace_surface* surface;
    uint32_t owner;                /* the pixel whose path met it */
    es_vec3 lamp_towards, lamp;    /* one lamp's irradiance over the probability of taking it */
    float rival;                   /* 1/m²: expected number of light vertices there, over the same probability */
    es_vec3 glow_towards, glow;    /* sampled light of glowing surfaces and the environment: irradiance */
    es_vec3 next_towards;          /* what go_on found; NULL: nothing */
    const es_vec3* next;
} shared_point;

/* How a pixel of the group sees the point. */
typedef struct connection { uint32_t pixel; es_vec3 back; es_vec3 reflected; float density; } connection;

static bool matte(const es_surface* s) { return s->model == ES_SURFACE_METALLIC_ROUGHNESS && s->specular.x == 0.0f && s->specular.y == 0.0f && s->specular.z == 0.0f; }

/* The density of the point by the pixel's directions, per square metre there, and what the pixel reflects of each W/sr it sends. */
static bool connect(const es_path_start* start, const es_trace_surface* y, connection* c)
{
    const es_trace_surface* s = &start->surface;
    es_vec3 d = es_v3_sub(y->position, s->position);
    float distance2 = es_v3_dot(d, d);
    if (!(distance2 > 1e-30f)) return false;
    es_vec3 wi = es_v3_scale(d, 1.0f / es_sqrt(distance2));
    c->back = es_v3_scale(wi, -1.0f);
    float cosine = es_v3_dot(s->normal, wi), across = es_v3_dot(y->geometric, c->back);
    if (!(cosine > 0.0f && across > 0.0f && es_v3_dot(s->geometric, wi) > 0.0f)) return false;
    float density = es_surface_density(&s->surface, s->normal, wi, start->wo), scale = across / distance2;
    if (!(density > 0.0f)) return false;
    c->density = density * scale;
    c->reflected = es_v3_scale(matte(&s->surface) ? es_v3_scale(s->surface.albedo, 0.318309886f) : es_surface_evaluate(&s->surface, s->normal, wi, start->wo), cosine * scale);
    return c->density > 0.0f;
}

/* From the point's side, so that rays have their origin in common. */
static uint32_t keep_visible(const es_trace_scene* scene, const es_path_group* group, const shared_point* point, connection* connections, uint32_t count, uint32_t* rays)
{
    es_ray ray[ES_PATH_GROUP];
    uint8_t blocked[ES_PATH_GROUP];
    const es_trace_surface* y = point->surface;
    es_vec3 from = es_offset_origin(y->position, y->geometric);
    uint32_t traced = 0, kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (connections[i].pixel == point->owner) continue;
        const es_trace_surface* s = &group->starts[connections[i].pixel]->surface;
        es_vec3 to = es_v3_sub(es_offset_origin(s->position, s->geometric), from);
        ray[traced++] = (es_ray){{from.x, from.y, from.z}, 0.0f, {to.x, to.y, to.z}, 1.0f};
    }
    *rays += traced;
    if (scene->has_masks)
        for (uint32_t i = 0; i < traced; i++) blocked[i] = es_trace_blocked(scene, ray[i]);
    else
        es_bvh_any(scene->bvh, ES_RAYS_COHERENT, ray, traced, blocked);
    traced = 0;
    for (uint32_t i = 0; i < count; i++)
        if (connections[i].pixel == point->owner || !blocked[traced++]) connections[kept++] = connections[i];
    return kept;
}

static void add_sent(const es_path_job* job, const shared_point* point, es_vec3 wo, es_vec3 lamp_share, es_vec3 share, es_vec3* bounce)
{
    const es_trace_surface* y = point->surface;
    const es_surface* surface = &y->surface;
    wo = lift_to_horizon(y->normal, wo);
    if (!black(point->lamp)) {
        es_vec3 f = matte(surface) ? es_v3_scale(surface->albedo, 0.318309886f) : es_surface_evaluate(surface, y->normal, point->lamp_towards, wo);
        bounce[1] = es_v3_add(bounce[1], es_v3_mul(es_v3_mul(f, point->lamp), lamp_share));
    }
    if (!black(point->glow)) {
        es_vec3 f = es_surface_evaluate(surface, y->normal, point->glow_towards, wo);
        bounce[1] = es_v3_add(bounce[1], es_v3_mul(es_v3_mul(f, point->glow), share));
    }
    if (point->next) {
        es_vec3 f = es_v3_mul(es_surface_evaluate(surface, y->normal, point->next_towards, wo), share);
        for (uint32_t b = 1; b <= job->bounces; b++) bounce[b] = es_v3_add(bounce[b], es_v3_mul(f, point->next[b]));
    }
}

/* A lobe so sharp that what was sampled for one direction to the group is no use for another. */
static bool is_sharp(const es_surface* s) { return es_surface_has_lobe(s) && !matte(s); }

static uint32_t share_point(const es_path_job* job, const es_path_group* group, const shared_point* point)
{
    connection connections[ES_PATH_GROUP];
    uint32_t count = 0, rays = 0;
    const uint32_t stride = job->bounces + 1;
    const bool sharp = is_sharp(&point->surface->surface);
    bool alone = sharp && black(point->lamp);
    for (uint32_t i = 0; i < group->count; i++) {
        if (alone && i != point->owner) continue;
        const es_path_start* start = group->starts[i];
        if (!start->seen || !start->surface.reflects || !connect(start, point->surface, &connections[count])) continue;
        connections[count++].pixel = i;
    }
    count = keep_visible(job->scene, group, point, connections, count, &rays);
    double sum = 0.0;
    for (uint32_t i = 0; i < count; i++) sum += (double)connections[i].density;
    double lamps = job->techniques == ES_PATH_LIGHT_VERTICES ? (double)point->rival : sum + (double)point->rival;
    for (uint32_t i = 0; i < count; i++) {
        const connection* c = &connections[i];
        bool own = c->pixel == point->owner;
        double others = sharp ? own ? 1.0 / (double)c->density : 0.0 : 1.0 / sum;
        add_sent(job, point, c->back, es_v3_scale(c->reflected, (float)(1.0 / lamps)), es_v3_scale(c->reflected, (float)others), group->bounce + c->pixel * stride);
    }
    return rays;
}

/* ---- a sample of a group -------------------------------------------------------------------------------------------------------------------- */

static path_numbers numbers_of(const es_path_group* group, uint32_t pixel, uint32_t sample)
{
    return (path_numbers){group->seeds[pixel], sample};
}

typedef struct first_bounces {
    uint32_t count;
    uint32_t pixel[ES_PATH_GROUP];
    es_surface_sample by[ES_PATH_GROUP];
    es_ray rays[ES_PATH_GROUP];
    es_hit hits[ES_PATH_GROUP];
} first_bounces;

/* Directions of all pixels, and what they meet. */
static uint32_t meet_first(const es_path_job* job, const es_path_group* group, uint32_t sample, first_bounces* first)
{
    const es_trace_scene* scene = job->scene;
    uint32_t rays = 0;
    first->count = 0;
    for (uint32_t i = 0; i < group->count; i++) {
        const es_path_start* start = group->starts[i];
        path_numbers n = numbers_of(group, i, sample);
        if (!start->seen || !start->surface.reflects) continue;
        if (glows(scene)) {
            float v[3];
            numbers_of_glow(n, 0, v);
            group->bounce[i * (job->bounces + 1)] = from_glowing(scene, &start->surface, start->wo, v, &rays);
        }
        uint32_t at = first->count;
        es_vec3 through = es_v3(1, 1, 1);
        if (!(job->bounces || glows(scene)) || !leave(n, 0, &start->surface, start->wo, &through, &first->by[at]) || black(first->by[at].weight)) continue;
        first->pixel[at] = i;
        first->rays[at] = ray_from(&start->surface, first->by[at].wi, 3e38f);
        first->count++;
    }
    if (scene->has_masks)
        for (uint32_t i = 0; i < first->count; i++) es_trace_closest(scene, first->rays[i], false, &first->hits[i]);
    else
        es_bvh_closest(scene->bvh, ES_RAYS_SINGLE, first->rays, first->count, first->hits);
    return rays + first->count;
}

static uint32_t share_light_vertices(const es_path_job* job, const es_path_group* group, uint32_t sample)
{
    const es_light_emissions* emissions = job->emissions;
    uint32_t rays = 0, count = group->light_vertices;
    if (!emissions->scene || job->techniques == ES_PATH_SURFACES) return 0;
    for (uint32_t i = 0; i < count; i++) {
        float u[2];
        es_light_vertex vertex;
        es_path_numbers(group->seed, PAIR_VERTICES, sample * count + i, u);
        if (!es_light_vertex_sample(emissions, u, es_random_u32(group->seed, sample * count + i), &vertex, &rays)) continue;
        const es_light_state* light = &job->scene->lights[vertex.light];
        const es_trace_surface* s = &vertex.surface;
        float probability = es_trace_light_probability(job->scene, s, vertex.light), distance = es_v3_length(es_v3_sub(light->position, s->position));
        if (!(probability > 0.0f)) continue;
        shared_point point = {.surface = s, .owner = NO_OWNER, .lamp_towards = vertex.towards_light};
        point.lamp = es_v3_scale(es_v3(light->radiant[0], light->radiant[1], light->radiant[2]), vertex.strength * es_v3_dot(s->normal, vertex.towards_light) / probability);
        point.rival = (float)count * es_light_vertex_density(emissions, vertex.light, s, vertex.towards_light, distance) / probability;
        rays += share_point(job, group, &point);
    }
    return rays;
}

/* What arrives at the first bounce of a pixel's path. */
static uint32_t light_point(const es_path_job* job, const es_path_group* group, path_numbers n, es_vec3 wo, shared_point* point, es_vec3* next)
{
    const es_trace_scene* scene = job->scene;
    const es_trace_surface* s = point->surface;
    uint32_t which, rays = 0;
    float probability;
    lamp_light l;
    if (choose_lamp(scene, n, 1, s, &which, &probability) && light_of(&scene->lights[which], s, &l)) {
        rays++;
        if (!es_trace_blocked(scene, l.shadow)) {
            point->lamp_towards = l.towards;
            point->lamp = es_v3_scale(l.irradiance, 1.0f / probability);
            if (job->techniques == ES_PATH_COMBINED)
                point->rival = (float)group->light_vertices * es_light_vertex_density(job->emissions, which, s, l.towards, l.distance) / probability;
        }
    }
    if (glows(scene)) {
        float v[3];
        numbers_of_glow(n, 1, v);
        light_of_glow(scene, s, wo, v, &point->glow_towards, &point->glow, &rays);
    }
    if (job->bounces > 1 || glows(scene)) {
        for (uint32_t b = 0; b <= job->bounces; b++) next[b] = es_v3(0, 0, 0);
        rays += go_on(job, n, *s, wo, &point->next_towards, next);
        for (uint32_t b = 1; b <= job->bounces; b++)
            if (!black(next[b])) point->next = next;
    }
    return rays;
}

uint32_t es_path_trace(const es_path_job* job, const es_path_group* group, uint32_t sample)
{
    const es_trace_scene* scene = job->scene;
    const uint32_t stride = job->bounces + 1;
    for (uint32_t i = 0; i < group->count * stride; i++) group->bounce[i] = es_v3(0, 0, 0);
    uint32_t rays = 0;
    if (job->bounces) rays += share_light_vertices(job, group, sample);
    if (job->techniques == ES_PATH_LIGHT_VERTICES) return rays;
    first_bounces first;
    rays += meet_first(job, group, sample, &first);
    es_vec3 next[ES_PATH_MAX_BOUNCES + 1];
    for (uint32_t k = 0; k < first.count; k++) {
        const es_surface_sample* by = &first.by[k];
        const es_path_start* start = group->starts[first.pixel[k]];
        es_vec3* bounce = group->bounce + first.pixel[k] * stride;
        if (first.hits[k].primitive == ES_NO_PRIMITIVE) {
            bounce[0] = es_v3_add(bounce[0], es_v3_mul(by->weight, environment_seen(scene, by)));
            continue;
        }
        es_trace_surface y;
        es_vec3 back = es_v3_scale(by->wi, -1.0f);
        es_trace_surface_at(scene, &first.hits[k], back, false, &y);
        bounce[0] = es_v3_add(bounce[0], es_v3_mul(by->weight, emission_seen(scene, by, start->surface.position, &y)));
        if (!job->bounces || !y.reflects) continue;
        shared_point point = {.surface = &y, .owner = first.pixel[k]};
        path_numbers n = numbers_of(group, first.pixel[k], sample);
        rays += light_point(job, group, n, lift_to_horizon(y.normal, back), &point, next);
        if (!black(point.lamp) || !black(point.glow) || point.next) rays += share_point(job, group, &point);
    }
    return rays;
}
