#include "gi/bias_compensation.h"

#include "gi/reference/light_choice.h"
#include "gi/reference/path.h"
#include "gi/shade.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

#define INV_PI 0.318309886f

typedef struct compensation_loop { const es_compensation_job* job; uint32_t* shares; } compensation_loop;

/* A pixel's surface, exact and as shading has it. */
typedef struct pixel {
    es_vec3 position, origin;          /* the second off the triangle, where rays begin */
    es_vec3 normal, geometric, wo;
    es_surface exact, shaded;
    bool lobed;                        /* shaded with its lobe */
    bool widened;                      /* the two differ */
} pixel;

static bool read_pixel(const es_compensation_job* job, uint32_t x, uint32_t y, pixel* p)
{
    const es_gbuffer* g = job->gbuffer;
    size_t at = (size_t)y * g->stride + x;
    if (!(g->depth[at] > 0.0f) || g->surface[at] >> 24 == ES_SURFACE_UNLIT) return false;
    p->position = es_pixel_rays_position(&job->rays, (float)x, (float)y, g->depth[at]);
    p->normal = es_unpack_normal(g->normal[at]);
    p->geometric = es_unpack_normal(g->geometric_normal[at]);
    p->origin = es_offset_origin(es_v3_add(p->position, es_v3_scale(p->geometric, job->offset)), p->geometric);
    es_vec3 towards = es_v3_scale(es_pixel_rays_direction(&job->rays, (float)x, (float)y), -1.0f);
    p->wo = es_v3_normalize(towards, p->normal);
    p->wo = es_v3_add(p->wo, es_v3_scale(p->normal, es_maxf(1e-3f - es_v3_dot(p->normal, p->wo), 0.0f)));
    p->exact = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    p->shaded = es_widened_lobe(p->exact, job->lobe_roughness);
    p->lobed = job->pixel_lobes;
    p->widened = p->lobed && p->shaded.roughness != p->exact.roughness;
    return true;
}

/* A lobe that is widened reflects where the exact one does not: both are sampled, by one estimator for their mixture. */
static bool sample_direction(const pixel* p, const float u[3], float choice, es_vec3* wi, float* density)
{
    es_surface_sample sample;
    if (!p->widened) {
        if (!es_surface_sample_direction(&p->exact, p->normal, p->wo, u, &sample)) return false;
        *density = sample.density;
    } else {
        bool wide = choice < 0.5f;
        if (!es_surface_sample_direction(wide ? &p->shaded : &p->exact, p->normal, p->wo, u, &sample)) return false;
        *density = 0.5f * (sample.density + es_surface_density(wide ? &p->exact : &p->shaded, p->normal, sample.wi, p->wo));
    }
    *wi = sample.wi;
    return *density > 0.0f;
}

bool es_lamp_reaches(const es_trace_scene* scene, const es_light_state* light, const es_trace_surface* s, es_vec3* direction, float* strength)
{
    float distance;
    if (!es_trace_towards_light(light, s->position, direction, &distance, strength)) return false;
    if (!(*strength > 0.0f && es_v3_dot(s->geometric, *direction) > 0.0f)) return false;
    return !es_trace_blocked(scene, es_trace_shadow_ray(light, s, *direction));
}

/* Of the light that goes from lamp over hit to pixel, per W/m² on the hit: the exact one less what lights are gathered with, over the
 * density of wi. */
static es_vec3 difference(const compensation_loop* loop, uint32_t which, const pixel* p, const es_trace_surface* hit, es_vec3 wi, float distance, es_vec3 from_lamp)
{
    const es_compensation_job* job = loop->job;
    es_vec3 back = es_v3_scale(wi, -1.0f), result = es_v3(0, 0, 0);
    float pixel_cosine = es_v3_dot(p->normal, wi), lamp_cosine = es_v3_dot(hit->normal, from_lamp);
    if (lamp_cosine > 0.0f) {
        es_vec3 lifted = es_v3_add(back, es_v3_scale(hit->normal, es_maxf(1e-3f - es_v3_dot(hit->normal, back), 0.0f)));
        es_vec3 f = es_surface_evaluate(&hit->surface, hit->normal, from_lamp, lifted);
        result = es_v3_scale(es_v3_mul(es_surface_evaluate(&p->exact, p->normal, wi, p->wo), f), pixel_cosine * lamp_cosine);
    }

    float hit_cosine = es_v3_dot(hit->normal, back), true_cosine = es_v3_dot(hit->geometric, back);
    if (!(hit_cosine > 0.0f && true_cosine > 0.0f)) return result;
    float spread = 0.0f;
    if (job->spread > 0.0f) {
        float area = es_vpl_area_at(&job->views[which], &job->importances[which], loop->shares[which], hit->position, hit->normal);
        if (!(area < __builtin_inff())) return result;
        spread = area * (INV_PI * job->spread);
    }
    /* a light carries what its part of the triangle receives and stands for it at any slant */
    float d2 = distance * distance, area_per_solid_angle = d2 / true_cosine, received = es_v3_dot(hit->geometric, from_lamp);
    float geometry = es_minf(pixel_cosine * hit_cosine / (d2 + spread), job->geometry_bound) * area_per_solid_angle * received;
    es_vec3 sent = es_v3_scale(hit->surface.albedo, INV_PI), reflected = es_v3_scale(p->exact.albedo, INV_PI);
    if (job->glossy_vpls && es_surface_has_lobe(&hit->surface)) {
        es_surface widened = es_widened_lobe(hit->surface, job->lobe_roughness);
        sent = es_surface_evaluate(&widened, hit->normal, from_lamp, back);
    }
    if (p->lobed) reflected = es_surface_evaluate(&p->shaded, p->normal, wi, p->wo);
    return es_v3_sub(result, es_v3_scale(es_v3_mul(reflected, sent), geometry));
}

static es_vec3 sample_pixel(const compensation_loop* loop, const pixel* p, uint32_t seed, uint32_t sample)
{
    const es_trace_scene* scene = loop->job->scene;
    es_vec3 sum = es_v3(0, 0, 0), wi;
    float direction[2], choice[2], density;
    es_path_numbers(seed, 0, sample, direction);
    es_path_numbers(seed, 1, sample, choice);
    const float u[3] = {choice[0], direction[0], direction[1]};
    if (!sample_direction(p, u, choice[1], &wi, &density) || !(es_v3_dot(p->geometric, wi) > 0.0f)) return sum;
    es_hit found;
    es_ray ray = {{p->origin.x, p->origin.y, p->origin.z}, 0.0f, {wi.x, wi.y, wi.z}, 3e38f};
    if (!es_trace_closest(scene, ray, false, &found)) return sum;
    es_trace_surface hit;
    es_trace_surface_at(scene, &found, es_v3_scale(wi, -1.0f), false, &hit);
    if (!hit.reflects) return sum;
    float distance = es_v3_length(es_v3_sub(hit.position, p->position));
    for (uint32_t i = 0; i < loop->job->view_count; i++) {
        const es_light_state* light = &scene->lights[i];
        es_vec3 from_lamp;
        float strength;
        if (!es_lamp_reaches(scene, light, &hit, &from_lamp, &strength)) continue;
        es_vec3 reflected = es_v3_scale(difference(loop, i, p, &hit, wi, distance, from_lamp), strength / density);
        sum = es_v3_add(sum, es_v3_mul(reflected, es_v3(light->radiant[0], light->radiant[1], light->radiant[2])));
    }
    return sum;
}

static void compensate_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const compensation_loop* loop = user;
    const es_compensation_job* job = loop->job;
    const es_gbuffer* g = job->gbuffer;
    for (uint32_t y = begin; y < end; y++)
        for (uint32_t x = 0; x < g->stride; x++) {
            pixel p;
            es_vec3 sum = es_v3(0, 0, 0);
            if (x < g->width && read_pixel(job, x, y, &p)) {
                uint32_t seed = es_random_u32(job->seed, y * g->width + x);
                for (uint32_t i = 0; i < job->samples; i++) sum = es_v3_add(sum, sample_pixel(loop, &p, seed, i));
                sum = es_v3_scale(sum, 1.0f / (float)job->samples);
            }
            size_t at = (size_t)y * g->stride + x;
            job->result[0][at] = sum.x;
            job->result[1][at] = sum.y;
            job->result[2][at] = sum.z;
        }
}

es_result es_compensate_bias(es_context* context, es_arena* arena, const es_compensation_job* job)
{
    compensation_loop loop = {.job = job, .shares = es_arena_allocate(arena, ((size_t)job->view_count + 1) * sizeof *loop.shares)};
    if (!loop.shares) return es_context_last_result(context);
    es_vpl_shares(job->views, job->view_count, job->importances, job->vpls, loop.shares);
    es_parallel_for(context, job->gbuffer->height, 4, compensate_rows, &loop);
    return ES_OK;
}
