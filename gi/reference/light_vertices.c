#include "gi/reference/light_vertices.h"

#include <string.h>

#include "gi/light_view.h"
#include "gi/reference/light_choice.h"
#include "platform/context.h"
#include "platform/random.h"

/* Share of a soft spot's numbers that go evenly over its cone, so that no density is far below the falloff as it is evaluated. */
#define EVEN_SHARE 0.125f
/* A cone's edge as it is evaluated is off by the rounding of a cosine. */
#define EDGE 4e-7f
/* Smaller densities count as none: their inverses are near the end of float's range. */
#define LEAST_DENSITY 1e-30f
/* Next-event estimation takes what is nearer to a light than this share of a shadow ray for the light's own place. */
#define NEAR_SHARE 1e-5f

/* How a light's emission is drawn. Spot and point lights: directions of a cone, whose solid angle is 2 pi height: the light's own, or the one
 * that the scene's bounding sphere fills as seen from there, whichever is smaller. Directional lights: a rectangle that the scene's box casts. */
struct es_light_emission {
    es_vec3 axis, across, up;
    float height;             /* 1 - cosine of the cone's half angle */
    float inner, edge, norm;  /* soft spots: 1 - cos_inner, its distance to 1 - cos_outer, and both's integral; norm 0: not soft */
    float low_x, low_y, width, depth, start; /* directional: along across and up; where rays start along the axis */
    float share;              /* of the lights' flux, as the running sums have it */
};

static float luminance(const float c[3]) { return 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2]; }

/* ---- emission ------------------------------------------------------------------------------------------------------------------------ */

/* Returns the flux as W of luminance, over pi. */
static double set_cone(es_light_emission* e, const es_light_state* light, es_vec3 centre, float radius)
{
    double flux = 4.0;
    e->axis = es_v3(0, 1, 0);
    e->height = 2.0f;
    if (light->type == ES_LIGHT_SPOT) {
        float outer = 1.0f - light->cos_outer;
        e->axis = light->direction;
        e->height = es_minf(outer + EDGE, 2.0f);
        e->inner = 1.0f - light->cos_inner;
        e->edge = outer - e->inner;
        float norm = e->inner + e->edge * (1.0f / 3.0f);
        if (e->edge > 1e-3f * outer && e->edge > 1e-4f) e->norm = norm;
        flux = 2.0 * (double)norm;
    }
    es_vec3 towards = es_v3_sub(centre, light->position);
    float distance = es_v3_length(towards);
    if (!(distance > radius * 1.01f)) return flux;
    float sine = radius / distance, height = sine * sine / (1.0f + es_sqrt(es_maxf(1.0f - sine * sine, 0.0f)));
    if (!(height < e->height)) return flux;
    e->axis = es_v3_scale(towards, 1.0f / distance);
    e->height = height;
    e->norm = 0.0f;
    return es_minf(2.0f * height, (float)flux);
}

static double set_rectangle(es_light_emission* e, const es_light_state* light, es_vec3 low, es_vec3 high, float radius)
{
    float least[3] = {3e38f, 3e38f, 3e38f}, most[3] = {-3e38f, -3e38f, -3e38f}, margin = 1e-4f * radius;
    e->axis = light->direction;
    es_orthonormal_basis(e->axis, &e->across, &e->up);
    for (int i = 0; i < 8; i++) {
        es_vec3 corner = es_v3(i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z);
        const float along[3] = {es_v3_dot(corner, e->across), es_v3_dot(corner, e->up), es_v3_dot(corner, e->axis)};
        for (int k = 0; k < 3; k++) {
            least[k] = es_minf(least[k], along[k]);
            most[k] = es_maxf(most[k], along[k]);
        }
    }
    e->low_x = least[0] - margin;
    e->low_y = least[1] - margin;
    e->width = most[0] - least[0] + 2.0f * margin;
    e->depth = most[1] - least[1] + 2.0f * margin;
    e->start = least[2] - radius * 0.01f;
    return (double)e->width * (double)e->depth * 0.31830988618379067;
}

/* 1/sr of the direction from a spot or point light, 1/m² across a directional one's. */
static float emission_density(const es_light_emission* e, const es_light_state* light, es_vec3 direction)
{
    if (light->type == ES_LIGHT_DIRECTIONAL) return e->share / e->width / e->depth;
    float even = 0.159154943f * e->share / e->height;
    if (!(e->norm > 0.0f)) return even;
    return EVEN_SHARE * even + (1.0f - EVEN_SHARE) * 0.159154943f * e->share * es_light_cone(light, direction) / e->norm;
}

/* The share of the emission within a height of the cone: even, and for a soft spot mostly as its falloff, which is 1 and then the square of the way
 * to the edge. */
static float share_within(const es_light_emission* e, float height)
{
    float even = es_minf(height / e->height, 1.0f);
    if (!(e->norm > 0.0f)) return even;
    float left = es_clampf(1.0f - (height - e->inner) / e->edge, 0.0f, 1.0f);
    float soft = height < e->inner ? height : e->inner + e->edge * (1.0f / 3.0f) * (1.0f - left * left * left);
    return EVEN_SHARE * even + (1.0f - EVEN_SHARE) * es_minf(soft / e->norm, 1.0f);
}

static float height_of(const es_light_emission* e, float u)
{
    if (!(e->norm > 0.0f)) return u * e->height;
    float low = 0.0f, high = e->height;
    for (int i = 0; i < 26; i++) {
        float middle = 0.5f * (low + high);
        if (share_within(e, middle) < u) low = middle;
        else high = middle;
    }
    return 0.5f * (low + high);
}

static es_ray emit(const es_light_emission* e, const es_light_state* light, float u, float v)
{
    if (light->type == ES_LIGHT_DIRECTIONAL) {
        float x = e->low_x + u * e->width, y = e->low_y + v * e->depth;
        es_vec3 o = es_v3_add(es_v3_add(es_v3_scale(e->across, x), es_v3_scale(e->up, y)), es_v3_scale(e->axis, e->start));
        return (es_ray){{o.x, o.y, o.z}, 0.0f, {e->axis.x, e->axis.y, e->axis.z}, 3e38f};
    }
    float height = height_of(e, u);
    float sine, cosine, r = es_sqrt(es_maxf(height * (2.0f - height), 0.0f));
    es_sincos(2.0f * ES_PI * v, &sine, &cosine);
    es_vec3 d = es_v3_add(es_v3_scale(e->axis, 1.0f - height), es_v3_add(es_v3_scale(e->across, r * cosine), es_v3_scale(e->up, r * sine)));
    return (es_ray){{light->position.x, light->position.y, light->position.z}, 0.0f, {d.x, d.y, d.z}, 3e38f};
}

/* ---- life ------------------------------------------------------------------------------------------------------------------------------ */

static void set_emissions(es_light_emissions* all)
{
    const es_trace_scene* scene = all->scene;
    es_vec3 low, high;
    es_bvh_bounds(scene->bvh, &low, &high);
    es_vec3 centre = es_v3_add(es_v3_scale(low, 0.5f), es_v3_scale(high, 0.5f));
    float radius = 0.5f * es_v3_length(es_v3_sub(high, low)), largest = 0.0f;
    for (int k = 0; k < 3; k++) largest = es_maxf(largest, es_maxf(es_absf((&low.x)[k]), es_absf((&high.x)[k])));
    radius = radius * 1.0001f + largest * 1e-6f + 1e-18f;
    all->reach = 4.0f * radius;
    double total = 0.0, sum = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        float before = 0.0f;
        for (uint32_t i = 0; i < all->light_count; i++) {
            es_light_emission* e = &all->of[i];
            const es_light_state* light = &scene->lights[i];
            *e = (es_light_emission){0};
            double flux = light->type == ES_LIGHT_DIRECTIONAL ? set_rectangle(e, light, low, high, radius) : set_cone(e, light, centre, radius);
            if (light->type != ES_LIGHT_DIRECTIONAL) es_orthonormal_basis(e->axis, &e->across, &e->up);
            flux *= (double)luminance(light->radiant);
            if (!pass) {
                total += flux;
                continue;
            }
            sum += flux;
            all->sums[i] = i + 1 == all->light_count ? 1.0f : es_minf((float)(sum / total), 1.0f);
            e->share = all->sums[i] - before;
            before = all->sums[i];
        }
        if (!(total > 0.0)) return;
    }
}

es_result es_light_emissions_create(es_light_emissions* all, const es_trace_scene* scene)
{
    *all = (es_light_emissions){0};
    if (!scene->light_count || !es_bvh_primitive_count(scene->bvh)) return ES_OK;
    es_context* context = scene->context;
    all->scene = scene;
    all->light_count = scene->light_count;
    all->of = es_allocate_array(context, all->light_count, sizeof *all->of);
    if (all->of) all->sums = es_allocate_array(context, all->light_count, sizeof *all->sums);
    if (!all->sums) {
        es_result result = es_context_last_result(context);
        es_light_emissions_free(all);
        return result;
    }
    memset(all->sums, 0, all->light_count * sizeof *all->sums);
    set_emissions(all);
    return ES_OK;
}

void es_light_emissions_free(es_light_emissions* all)
{
    if (!all->scene) return;
    es_context* context = all->scene->context;
    es_release(context, all->of, all->light_count * sizeof *all->of);
    es_release(context, all->sums, all->light_count * sizeof *all->sums);
    *all = (es_light_emissions){0};
}

/* ---- vertices -------------------------------------------------------------------------------------------------------------------------- */

/* Per square metre of the surface at s. */
static float area_density(float emitted, const es_light_state* light, const es_trace_surface* s, es_vec3 towards, float distance)
{
    double density = (double)emitted * (double)es_v3_dot(s->geometric, towards);
    if (light->type != ES_LIGHT_DIRECTIONAL) density /= (double)distance * (double)distance;
    if (!(density > (double)LEAST_DENSITY)) return 0.0f;
    return density < 1e30 ? (float)density : 1e30f;
}

float es_light_vertex_density(const es_light_emissions* all, uint32_t which, const es_trace_surface* s, es_vec3 towards, float distance)
{
    const es_light_state* light = &all->scene->lights[which];
    return area_density(emission_density(&all->of[which], light, es_v3_scale(towards, -1.0f)), light, s, towards, distance);
}

/* The hits along a ray from a light that next-event estimation reaches: the first, and what lies behind surfaces that are so near to the
 * light that they do not count. Of several one is chosen; returns how many there were. */
static uint32_t meet(const es_light_emissions* all, es_ray ray, uint32_t bits, es_hit* hit, uint32_t* rays)
{
    const es_trace_scene* scene = all->scene;
    uint32_t lit = 0;
    float before = 0.0f;
    es_hit next;
    for (uint32_t i = 0; i < 8; i++) {
        ++*rays;
        if (!es_trace_closest(scene, ray, false, &next)) break;
        if (!i || before <= NEAR_SHARE * next.t) {
            lit++;
            if (lit == 1 || es_random_u32(bits, lit) % lit == 0) *hit = next;
        }
        before = ray.min = next.t;
        if (!(next.t <= NEAR_SHARE * all->reach)) break;
    }
    return lit;
}

bool es_light_vertex_sample(const es_light_emissions* all, const float numbers[2], uint32_t bits, es_light_vertex* vertex, uint32_t* rays)
{
    const es_trace_scene* scene = all->scene;
    uint32_t which = 0;
    float u = numbers[0];
    for (uint32_t high = all->light_count - 1; which < high;) {
        uint32_t middle = (which + high) / 2;
        if (u < all->sums[middle]) high = middle;
        else which = middle + 1;
    }
    const es_light_emission* e = &all->of[which];
    const es_light_state* light = &scene->lights[which];
    if (!(e->share > 0.0f)) return false;
    u = es_clampf((u - (which ? all->sums[which - 1] : 0.0f)) / e->share, 0.0f, 0.99999994f);
    es_ray ray = emit(e, light, u, numbers[1]);
    es_hit hit;
    uint32_t places;
    if (light->type == ES_LIGHT_DIRECTIONAL) {
        ++*rays;
        places = es_trace_closest(scene, ray, false, &hit);
    } else {
        places = meet(all, ray, bits, &hit, rays);
    }
    if (!places) return false;
    es_trace_surface* s = &vertex->surface;
    float distance;
    es_trace_surface_at(scene, &hit, es_v3(-ray.direction[0], -ray.direction[1], -ray.direction[2]), false, s);
    if (!s->reflects || !es_trace_towards_light(light, s->position, &vertex->towards_light, &distance, &vertex->strength)) return false;
    vertex->strength *= (float)places;
    vertex->light = which;
    return es_v3_dot(s->normal, vertex->towards_light) > 0.0f && es_v3_dot(s->geometric, vertex->towards_light) > 0.0f && vertex->strength > 0.0f &&
           es_light_vertex_density(all, which, s, vertex->towards_light, distance) > 0.0f;
}
