#include "gi/bounces.h"

#include <math.h>
#include <string.h>

#include "gi/kernel_table.h"
#include "gi/subsets.h"
#include "platform/context.h"
#include "platform/random.h"
#include "raster/pack.h"
#include "raster/points.h"

enum { RUN = 256, LANES = 8 };

/* Of a place that a map hides. Places found by it come with the inverse of it times the power of others, which shows where there are many such. */
#define DOUBT 0.125f

typedef struct bounce_loop {
    const es_bounce_job* job;
    const es_gi_kernels* kernels;
    float *weights, *sums;     /* a worker's: places and places / 8 */
    uint32_t *keys, *scratch;  /* REFLECTIVE */
    size_t places, key_words, scratch_words;
    uint32_t shift;            /* of the numbers that choose, a bounce's own */
} bounce_loop;

static es_vec3 vector_of(const float v[3]) { return es_v3(v[0], v[1], v[2]); }
static float luminance(es_vec3 c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

/* Maps say where to look, rays what is seen. */
static bool draws_rays(const es_bounce_job* job) { return job->method == ES_BOUNCE_ONE_PASS && job->maps && job->scene && job->rays; }

static es_bounce_sender sender_of(const es_bounce_job* job, uint32_t sender)
{
    const es_vpl_record* vpl = &job->senders[sender];
    es_bounce_sender s = {.model = vpl->model, .glossy = job->glossy && vpl->glossy, .parallel = vpl->parallel, .far_distance = job->extent, .bias = job->bias, .slope_bias = job->slope_bias, .near_distance = job->near_distance, .backs = job->scene != NULL};
    memcpy(s.position, vpl->position, sizeof s.position);
    memcpy(s.normal, vpl->normal, sizeof s.normal);
    memcpy(s.tangent, vpl->tangent, sizeof s.tangent);
    memcpy(s.bitangent, vpl->bitangent, sizeof s.bitangent);
    memcpy(s.power, vpl->power, sizeof s.power);
    memcpy(s.incident, vpl->incident, sizeof s.incident);
    memcpy(s.specular_color, vpl->specular_color, sizeof s.specular_color);
    es_surface lobe = es_widened_lobe((es_surface){.roughness = vpl->roughness, .model = vpl->model}, job->lobe_roughness);
    s.roughness = lobe.roughness;
    for (int k = 0; k < 3; k++) s.color[k] = vpl->flux[k] * 0.318309886f;
    if (job->maps) {
        s.map = job->maps->texels + (size_t)sender * job->maps->size * job->maps->size;
        s.map_size = job->maps->size;
        s.doubt = draws_rays(job) ? DOUBT : 0.0f;
        s.far_distance = job->maps->far_distance;
    }
    return s;
}

/* W/sr towards the unit direction d */
static es_vec3 intensity(const es_bounce_sender* s, es_vec3 d)
{
    es_vec3 n = vector_of(s->normal), sent = vector_of(s->color), lobe;
    float cosine = es_maxf(es_v3_dot(n, d), 0.0f), pass;
    if (s->glossy) {
        es_surface surface = {.specular = vector_of(s->specular_color), .roughness = s->roughness, .model = s->model};
        es_surface_parts(&surface, n, vector_of(s->incident), d, &pass, &lobe);
        sent = es_v3_add(es_v3_scale(sent, pass), es_v3_mul(vector_of(s->power), lobe));
    }
    return es_v3_scale(sent, cosine);
}

static es_vec3 point_of(const es_surfel_set* set, uint32_t i) { return es_v3(set->x[i], set->y[i], set->z[i]); }

/* ---- weights of a sender's places --------------------------------------------------------------------------------------- */

/* From the sender to the point, off both. */
static es_ray ray_to(const es_bounce_job* job, uint32_t sender, const es_surfel_set* set, uint32_t i)
{
    const es_vpl_record* vpl = &job->senders[sender];
    const es_vec3 from = vector_of(vpl->position), end = job->ends[sender - job->first_sender], sent = vector_of(vpl->normal);
    es_vec3 p = point_of(set, i), n = es_unpack_normal(set->normal[i]);
    if ((vpl->parallel ? -es_v3_dot(n, sent) : es_v3_dot(n, es_v3_sub(from, p))) < 0.0f) n = es_v3_scale(n, -1.0f);
    p = es_offset_origin(es_v3_add(p, es_v3_scale(n, job->extent * ES_RAY_OFFSET_SHARE)), n);
    if (vpl->parallel) return (es_ray){{p.x, p.y, p.z}, 0.0f, {-sent.x, -sent.y, -sent.z}, INFINITY};
    return (es_ray){{end.x, end.y, end.z}, 0.0f, {p.x - end.x, p.y - end.y, p.z - end.z}, 1.0f};
}

static void trace(const es_bounce_job* job, const es_ray* rays, uint32_t count, uint8_t* blocked)
{
    if (job->scene->has_masks)
        for (uint32_t i = 0; i < count; i++) blocked[i] = es_trace_blocked(job->scene, rays[i]);
    else
        es_bvh_any(job->scene->bvh, ES_RAYS_SINGLE, rays, count, blocked);
}

/* Points behind something send nothing on: a ray from each that would receive. */
static void remove_hidden(const es_bounce_job* job, uint32_t sender, const es_surfel_set* set, float* weights, float* sums)
{
    es_ray rays[RUN];
    uint8_t blocked[RUN];
    for (uint32_t begin = 0; begin < set->count; begin += RUN) {
        uint32_t places[RUN], count = 0;
        for (uint32_t i = begin; i < set->count && i < begin + RUN; i++) {
            if (!(weights[i] > 0.0f)) continue;
            rays[count] = ray_to(job, sender, set, i);
            places[count++] = i;
        }
        trace(job, rays, count, blocked);
        for (uint32_t i = 0; i < count; i++)
            if (blocked[i]) weights[places[i]] = 0.0f;
    }
    for (uint32_t i = 0; i < set->count; i += LANES) {
        float sum = 0.0f;
        for (uint32_t k = 0; k < LANES; k++) sum += weights[i + k];
        sums[i / LANES] = sum;
    }
}

static uint32_t subset_of(const bounce_loop* loop, uint32_t sender)
{
    const es_bounce_job* job = loop->job;
    return (sender - job->first_sender + (loop->shift >> 8)) % job->points->subset_count;
}

/* Weights and sums of the sender's places, and their number. */
static size_t weigh(const bounce_loop* loop, uint32_t sender, const es_bounce_sender* s, uint32_t worker)
{
    const es_bounce_job* job = loop->job;
    const es_surfel_set set = es_surfels_subset(job->surfels, job->points, subset_of(loop, sender));
    float *weights = loop->weights + worker * loop->places, *sums = loop->sums + worker * (loop->places / LANES);
    if (job->method == ES_BOUNCE_ONE_PASS) {
        loop->kernels->bounce_weights(s, &set, weights, sums);
        if (job->scene && !job->maps) remove_hidden(job, sender, &set, weights, sums);
        return set.count;
    }
    const es_reflective_map map = {.size = job->size, .levels = job->levels, .push = (uint32_t)(es_clampf(job->push_threshold, 0.0f, 1.0f) * (float)ES_PARABOLIC_DEPTH_MAX), .keys = loop->keys + worker * loop->key_words, .scratch = loop->scratch + worker * loop->scratch_words};
    loop->kernels->reflective_splat(s, &set, &map);
    loop->kernels->reflective_fill(&map);
    loop->kernels->reflective_weights(s, &set, &map, weights, sums);
    return loop->places;
}

/* ---- choosing ------------------------------------------------------------------------------------------------------------- */

/* The place where the running sum passes u times the total; there must be one with a positive weight. */
static size_t choose(const float* weights, const float* sums, size_t count, double total, float u)
{
    double threshold = (double)u * total, sum = 0.0;
    size_t eight = 0, found = 0;
    for (size_t k = 0; k < count / LANES; k++) {
        if (!(sums[k] > 0.0f)) continue;
        eight = k; /* rounding may lead past the last */
        if (sum + (double)sums[k] > threshold) break;
        sum += (double)sums[k];
    }
    for (size_t i = eight * LANES; i < (eight + 1) * LANES; i++) {
        if (!(weights[i] > 0.0f)) continue;
        found = i;
        sum += (double)weights[i];
        if (sum > threshold) break;
    }
    return found;
}

/* Draws places by their weights, evenly spread, and takes one of those that are seen, all of which are as likely; keeps its number and gives the share
 * of places that are seen. Each drawn one has a rank that stays from frame to frame, and the highest wins, so that the others may come and go. */
static double choose_seen(const bounce_loop* loop, uint32_t sender, const float* weights, const float* sums, double total, float u, uint32_t number, size_t* chosen)
{
    const es_bounce_job* job = loop->job;
    const es_surfel_set set = es_surfels_subset(job->surfels, job->points, subset_of(loop, sender));
    es_ray rays[ES_BOUNCE_MAX_RAYS];
    uint8_t blocked[ES_BOUNCE_MAX_RAYS];
    size_t drawn[ES_BOUNCE_MAX_RAYS];
    for (uint32_t i = 0; i < job->rays; i++) {
        drawn[i] = choose(weights, sums, loop->places, total, ((float)i + u) / (float)job->rays);
        rays[i] = ray_to(job, sender, &set, (uint32_t)drawn[i]);
    }
    trace(job, rays, job->rays, blocked);
    uint32_t seen = 0, highest = 0;
    for (uint32_t i = 0; i < job->rays; i++) {
        const uint32_t rank = es_random_u32(number, 0x80000000u + i);
        if (blocked[i]) continue;
        if (!seen++ || rank > highest) {
            *chosen = drawn[i];
            highest = rank;
        }
    }
    return (double)seen / (double)job->rays;
}

/* What a place chosen of a sender's receives, as if it were certain to be chosen. */
typedef struct place {
    es_vec3 position, normal, incident;
    es_vec3 received;          /* W */
    float area;                /* m² */
    es_surface surface;
} place;

static place place_at(const bounce_loop* loop, uint32_t sender, const es_bounce_sender* s, size_t chosen, uint32_t worker)
{
    const es_bounce_job* job = loop->job;
    const es_surfel_set set = es_surfels_subset(job->surfels, job->points, subset_of(loop, sender));
    const bool reflective = job->method == ES_BOUNCE_REFLECTIVE;
    const uint32_t i = reflective ? loop->keys[worker * loop->key_words + chosen] & 0xffff : (uint32_t)chosen;
    es_vec3 from = vector_of(s->position), to = es_v3_sub(point_of(&set, i), from);
    float distance = es_maxf(es_v3_length(to), s->near_distance);
    place p = {.position = point_of(&set, i), .normal = es_unpack_normal(set.normal[i]), .surface = es_surface_of_gbuffer(set.albedo_rg[i], set.albedo_b[i], set.surface[i])};
    p.incident = es_v3_scale(s->parallel ? vector_of(s->normal) : es_v3_normalize(to, vector_of(s->normal)), -1.0f);
    if (es_v3_dot(p.normal, p.incident) < 0.0f) p.normal = es_v3_scale(p.normal, -1.0f);
    float cosine = es_v3_dot(p.normal, p.incident);
    if (!reflective) {
        p.area = set.area[i];
        p.received = s->parallel ? es_v3_scale(vector_of(s->color), cosine * p.area) : es_v3_scale(intensity(s, es_v3_scale(to, 1.0f / distance)), cosine * p.area / (distance * distance));
        return p;
    }
    float step = 2.0f / (float)job->size, u = ((float)(chosen % job->size) + 0.5f) * step - 1.0f, v = ((float)(chosen / job->size) + 0.5f) * step - 1.0f;
    float inverse = 1.0f / (1.0f + (u * u + v * v)), solid_angle = 4.0f * step * step * inverse * inverse;
    es_vec3 d = es_v3_add(es_v3_add(es_v3_scale(vector_of(s->tangent), 2.0f * u * inverse), es_v3_scale(vector_of(s->bitangent), 2.0f * v * inverse)), es_v3_scale(vector_of(s->normal), (1.0f - u * u - v * v) * inverse));
    p.received = es_v3_scale(intensity(s, d), solid_angle);
    p.area = solid_angle * distance * distance / es_maxf(cosine, 0.05f);
    return p;
}

static es_vpl_record record_of(const bounce_loop* loop, const place* p, double inverse_probability, float share)
{
    const es_bounce_job* job = loop->job;
    es_vec3 tangent, bitangent;
    es_orthonormal_basis(p->normal, &tangent, &bitangent);
    es_vec3 power = es_v3_scale(p->received, (float)(inverse_probability * (double)share)), flux = es_v3_mul(power, p->surface.albedo);
    return (es_vpl_record){
        .position = {p->position.x, p->position.y, p->position.z},
        .normal = {p->normal.x, p->normal.y, p->normal.z},
        .tangent = {tangent.x, tangent.y, tangent.z},
        .bitangent = {bitangent.x, bitangent.y, bitangent.z},
        .flux = {flux.x, flux.y, flux.z},
        .power = {power.x, power.y, power.z},
        .incident = {p->incident.x, p->incident.y, p->incident.z},
        .specular_color = {p->surface.specular.x, p->surface.specular.y, p->surface.specular.z},
        /* all lights of the bounce together stand for every place: as dense as they come, one of them for the inverse of that */
        .area = (float)es_minf((float)((double)p->area * inverse_probability / (double)job->count), 1e30f),
        .roughness = p->surface.roughness,
        .model = p->surface.model,
        .glossy = job->glossy && es_surface_has_lobe(&p->surface),
    };
}

static es_vpl_record make_light(const bounce_loop* loop, uint32_t light, uint32_t worker)
{
    const es_bounce_job* job = loop->job;
    const uint32_t own = es_random_u32(job->seed ^ loop->shift, light);
    const float* weights = loop->weights + worker * loop->places;
    const float* sums = loop->sums + worker * (loop->places / LANES);
    float u = es_radical_inverse(2, es_place_in_sequence(light, job->count, job->subsets) + 1) + es_unit_float(loop->shift);
    if (u >= 1.0f) u -= 1.0f;

    double total = 0.0, weight = 0.0, seen = 1.0;
    place kept = {0};
    uint32_t first = job->sender_count ? light % job->sender_count : 0, number = 0;
    for (uint32_t k = first; k < job->sender_count; k += job->count, number++) {
        const uint32_t sender = job->first_sender + k;
        es_bounce_sender s = sender_of(job, sender);
        if (!(luminance(vector_of(s.color)) > 0.0f || s.glossy)) continue;
        size_t places = weigh(loop, sender, &s, worker);
        double sum = 0.0;
        for (size_t i = 0; i < places / LANES; i++) sum += (double)sums[i];
        if (!(sum > 0.0 && sum < 1e300)) continue;
        total += sum;
        /* of the senders so far this one is taken with its share, so each has its own in the end */
        if (number && !((double)es_random_float(own, number) * total < sum)) continue;
        size_t chosen = 0;
        if (draws_rays(job)) seen = choose_seen(loop, sender, weights, sums, sum, u, own, &chosen);
        else chosen = choose(weights, sums, places, sum, u);
        weight = seen > 0.0 ? (double)weights[chosen] : 0.0;
        if (!(weight > 0.0)) continue;
        kept = place_at(loop, sender, &s, chosen, worker);
    }
    if (!(weight > 0.0)) return (es_vpl_record){.normal = {0, 1, 0}, .tangent = {0, 0, 1}, .bitangent = {1, 0, 0}, .incident = {0, 1, 0}, .roughness = 1.0f, .model = ES_SURFACE_UNLIT};
    uint32_t sharing = job->count > job->sender_count ? (job->count - first + job->sender_count - 1) / job->sender_count : 1;
    return record_of(loop, &kept, total / weight * seen, 1.0f / (float)sharing);
}

static void make_lights(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const bounce_loop* loop = user;
    for (uint32_t i = begin; i < end; i++) loop->job->vpls[loop->job->first + i] = make_light(loop, i, worker);
}

es_result es_bounce_lights(es_context* context, const es_bounce_job* job)
{
    const bool reflective = job->method == ES_BOUNCE_REFLECTIVE, places = job->points->subset_count && job->points->subset_size;
    const uint32_t workers = es_context_workers(context);
    bounce_loop loop = {.job = job, .kernels = es_gi_kernel_table(es_context_isa(context)), .shift = es_random_u32(job->seed, 0x60000000u + job->bounce)};
    if (!places) {
        for (uint32_t i = 0; i < job->count; i++) job->vpls[job->first + i] = (es_vpl_record){.normal = {0, 1, 0}, .tangent = {0, 0, 1}, .bitangent = {1, 0, 0}, .incident = {0, 1, 0}, .roughness = 1.0f, .model = ES_SURFACE_UNLIT};
        return ES_OK;
    }
    loop.places = reflective ? (size_t)job->size * job->size : ((size_t)job->points->subset_size + LANES - 1) / LANES * LANES;
    loop.key_words = reflective ? (size_t)job->size * job->size : 0;
    loop.scratch_words = reflective ? (size_t)job->size * job->size / 2 : 0;
    es_arena scratch;
    es_arena_init(&scratch, context, 1 << 16);
    bool all = (loop.weights = es_arena_allocate(&scratch, workers * loop.places * sizeof(float))) && (loop.sums = es_arena_allocate(&scratch, workers * (loop.places / LANES) * sizeof(float)));
    if (all && reflective)
        all = (loop.keys = es_arena_allocate(&scratch, workers * loop.key_words * sizeof(uint32_t))) && (loop.scratch = es_arena_allocate(&scratch, workers * loop.scratch_words * sizeof(uint32_t)));
    if (all) es_parallel_for(context, job->count, 2, make_lights, &loop);
    es_arena_free(&scratch);
    return all ? ES_OK : es_context_last_result(context);
}
