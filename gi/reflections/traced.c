#include "gi/reflections/traced.h"

#include <string.h>

#include "gi/edit/turn.h"
#include "gi/lit.h"
#include "gi/reflections/found_light.h"
#include "gi/reflections/map_faces.h"
#include "gi/vpl_visibility.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/pack.h"

enum { HIT_PLANES = ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_EMISSION | ES_GBUFFER_INSTANCE, RUN = 128, STEP = 32 };

/* Narrower lobes are one direction. */
#define MIRROR_ALPHA 4e-4f

void es_traced_level_free(es_context* context, es_traced_level* l)
{
    es_gbuffer_destroy(context, &l->hits);
    es_planes* const planes[] = {&l->found, &l->along, &l->background, &l->radiance, &l->second, &l->weight, &l->sum, &l->weights};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) es_planes_free(context, planes[i]);
    es_reflecting_buffers_free(context, &l->reflecting);
    es_found_light_free(context, &l->light);
}

static es_result resize(es_renderer* r, es_traced_level* l, uint32_t width, uint32_t height)
{
    if (l->hits.memory && l->hits.width == width && l->hits.height == height) return ES_OK;
    es_traced_level_free(r->context, l);
    es_result result = es_gbuffer_create(r->context, width, height, HIT_PLANES, &l->hits);
    es_planes* const planes[] = {&l->found, &l->along, &l->background, &l->radiance, &l->second, &l->weight, &l->sum, &l->weights};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0] && !result; i++) result = es_planes_resize(r->context, planes[i], &l->hits);
    if (!result) result = es_reflecting_buffers_resize(r->context, &l->reflecting, &l->hits);
    if (result) es_traced_level_free(r->context, l); /* a part of it would pass for the whole */
    return result;
}

es_layer_rectangle es_reflecting_rectangle(const es_gbuffer* g, const es_reflecting_planes* planes)
{
    const uint32_t chunks = es_lit_chunks(g->stride);
    es_layer_rectangle c = {g->width, 0, g->height, 0};
    for (uint32_t y = 0; y < g->height; y++)
        for (uint32_t i = 0; i < chunks; i++) {
            if (!(planes->any[(size_t)y * chunks + i] & 1)) continue;
            uint32_t first = i * ES_LIT_COLUMNS, last = first + ES_LIT_COLUMNS < g->width ? first + ES_LIT_COLUMNS : g->width;
            const uint32_t* map = planes->map + (size_t)y * g->stride;
            while (first < last && !map[first]) first++;
            while (last > first && !map[last - 1]) last--;
            if (first == last) continue;
            c.column_begin = first < c.column_begin ? first : c.column_begin;
            c.column_end = last > c.column_end ? last : c.column_end;
            c.row_begin = y < c.row_begin ? y : c.row_begin;
            c.row_end = y + 1;
        }
    if (!c.row_end) return (es_layer_rectangle){0};
    const uint32_t column_end = (c.column_end + STEP - 1) / STEP * STEP, row_end = (c.row_end + STEP - 1) / STEP * STEP;
    return (es_layer_rectangle){c.column_begin / STEP * STEP, column_end < g->width ? column_end : g->width, c.row_begin / STEP * STEP, row_end < g->height ? row_end : g->height};
}

/* ---- rays --------------------------------------------------------------------------------------------------------------------------- */

typedef struct ray_loop {
    const es_traced_source* source;
    const es_trace_scene* scene;
    es_traced_level* level;
    float offset;
    uint32_t sample, seed;
    uint8_t* wide;              /* has the row wide lobes? */
} ray_loop;

static es_vec3 load3(const float* const planes[3], size_t at) { return es_v3(planes[0][at], planes[1][at], planes[2][at]); }
static void store3(float* const planes[3], size_t at, es_vec3 v)
{
    planes[0][at] = v.x;
    planes[1][at] = v.y;
    planes[2][at] = v.z;
}

static es_vec3 edited_at(const es_traced_source* s, size_t at) { return s->edited[0] ? load3(s->edited, at) : es_v3(0, 0, 0); }
static bool is_edited(const es_traced_source* s, size_t at)
{
    const es_vec3 e = edited_at(s, at);
    return es_v3_dot(e, e) > 0.0f;
}

/* The direction of a pixel's ray, unit, and its weight; false: none this time. */
static bool direction_of(const ray_loop* loop, size_t at, uint32_t x, uint32_t y, es_vec3 geometric, es_vec3* direction, es_vec3* weight)
{
    const es_traced_source* s = loop->source;
    const es_gbuffer* g = s->gbuffer;
    const es_vec3 mirrored = load3((const float* const*)s->planes->direction, at);
    const es_vec3 edited = edited_at(s, at);
    const bool turns = is_edited(s, at), wide = s->planes->alpha[at] > MIRROR_ALPHA;
    *direction = turns ? edited : mirrored;
    *weight = es_v3(1, 1, 1);
    if (!wide || s->rays_per_pixel == 1) return loop->sample == 0;
    es_surface surface = es_surface_of_gbuffer(g->albedo_rg[at], g->albedo_b[at], g->surface[at]);
    surface.albedo = es_v3(0, 0, 0);
    const es_vec3 n = es_unpack_normal(g->normal[at]), d = es_pixel_rays_direction(&s->rays, (float)x, (float)y);
    es_vec3 wo = es_v3_normalize(es_v3_scale(d, -1.0f), n);
    wo = es_v3_normalize(es_v3_add(wo, es_v3_scale(n, es_maxf(1e-3f - es_v3_dot(n, wo), 0.0f))), n);
    /* two irrational steps from a place of the pixel's own */
    const uint32_t pixel = es_hash_u32(y * ES_RASTER_MAX_SIZE + x + loop->seed);
    const float k = (float)loop->sample, u = es_unit_float(pixel) + k * 0.754877666f, v = es_unit_float(es_hash_u32(pixel)) + k * 0.569840291f, three[3] = {0.5f, u - es_floor(u), v - es_floor(v)};
    es_surface_sample chosen;
    if (!es_surface_sample_direction(&surface, n, wo, three, &chosen)) return false;
    if (!turns && !(es_v3_dot(geometric, chosen.wi) > 0.0f)) return false;
    *direction = turns ? es_turned(chosen.wi, mirrored, edited) : chosen.wi;
    *weight = chosen.weight;
    return true;
}

static void put_hit(const ray_loop* loop, size_t at, const es_ray* ray, const es_hit* hit)
{
    const es_trace_scene* scene = loop->scene;
    es_gbuffer* g = &loop->level->hits;
    const es_vec3 d = es_v3(ray->direction[0], ray->direction[1], ray->direction[2]);
    es_trace_surface s;
    es_trace_surface_at(scene, hit, es_v3_scale(d, -1.0f), false, &s);
    const es_raster_instance* instance = &scene->instances[es_bvh_primitives(scene->bvh)[hit->primitive].instance];
    g->depth[at] = es_maxf(hit->t, 1e-30f);
    g->normal[at] = es_pack_normal(s.normal);
    g->geometric_normal[at] = es_pack_normal(s.geometric);
    g->albedo_rg[at] = es_pack_unorm16(s.base.x) | es_pack_unorm16(s.base.y) << 16;
    g->albedo_b[at] = es_pack_unorm16(s.base.z) | instance->material << 16;
    const uint32_t second = s.surface.model == ES_SURFACE_PHONG ? es_pack_unorm8(s.roughness * (5.0f / 255.0f)) : es_pack_unorm8(s.roughness);
    g->surface[at] = es_pack_unorm8(s.metallic) | second << 8 | es_pack_unorm8(s.specular) << 16 | s.surface.model << 24;
    g->emission[at] = es_pack_rgb9e5(s.emission);
    g->instance[at] = instance->id + 1;
    store3(loop->level->found.at, at, s.position);
}

enum { MOST_PASSED = 64 };

static uint32_t instance_of(const es_trace_scene* scene, const es_hit* hit)
{
    return hit->primitive == ES_NO_PRIMITIVE ? 0 : scene->instances[es_bvh_primitives(scene->bvh)[hit->primitive].instance].id + 1;
}

/* An artist may ask for what lies behind the surface (Ritschel thesis §7.5.3): the thing itself, `own` by its word of the G-buffer, is not in the way, as it is in no map of its own. */
static void pass_own(const es_trace_scene* scene, es_ray ray, uint32_t own, es_hit* hit)
{
    for (int i = 0; i < MOST_PASSED && instance_of(scene, hit) == own; i++) {
        ray.min = hit->t * 1.00001f + 1e-6f;
        if (scene->has_masks) es_trace_closest(scene, ray, false, hit);
        else es_bvh_closest(scene->bvh, ES_RAYS_SINGLE, &ray, 1, hit);
    }
}

static void trace_run(const ray_loop* loop, const es_ray* rays, const size_t* places, const uint32_t* own, uint32_t count)
{
    es_hit hits[RUN];
    if (loop->scene->has_masks)
        for (uint32_t i = 0; i < count; i++) es_trace_closest(loop->scene, rays[i], false, &hits[i]);
    else
        es_bvh_closest(loop->scene->bvh, ES_RAYS_COHERENT, rays, count, hits);
    for (uint32_t i = 0; i < count; i++) {
        if (own[i]) pass_own(loop->scene, rays[i], own[i], &hits[i]);
        if (hits[i].primitive != ES_NO_PRIMITIVE) put_hit(loop, places[i], &rays[i], &hits[i]);
        else store3(loop->level->background.at, places[i], es_trace_environment(loop->scene, es_v3(rays[i].direction[0], rays[i].direction[1], rays[i].direction[2])));
    }
}

static void clear_row(es_traced_level* l, size_t row)
{
    es_gbuffer* g = &l->hits;
    uint32_t* const words[] = {(uint32_t*)g->depth, g->normal, g->geometric_normal, g->albedo_rg, g->albedo_b, g->surface, g->emission, g->instance};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) memset(words[i] + row, 0, g->stride * sizeof(uint32_t));
    es_planes* const planes[] = {&l->found, &l->along, &l->background, &l->weight};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++)
        for (int k = 0; k < 3; k++) memset(planes[i]->at[k] + row, 0, g->stride * sizeof(float));
}

static void ray_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const ray_loop* loop = user;
    const es_traced_source* s = loop->source;
    const es_gbuffer* g = s->gbuffer;
    es_ray rays[RUN];
    size_t places[RUN];
    uint32_t own[RUN], count = 0; /* own: of the ray's own surface where it is edited to go behind that, else 0 */
    for (uint32_t j = begin; j < end; j++) {
        const size_t row = (size_t)j * loop->level->hits.stride;
        const uint32_t y = s->rectangle.row_begin + j;
        clear_row(loop->level, row);
        for (uint32_t x = s->rectangle.column_begin; x < s->rectangle.column_end; x++) {
            const size_t at = (size_t)y * g->stride + x, to = row + x - s->rectangle.column_begin;
            if (!s->planes->map[at]) continue;
            loop->wide[j] |= s->planes->alpha[at] > MIRROR_ALPHA;
            es_vec3 geometric = es_unpack_normal(g->geometric_normal[at]), direction, weight;
            if (!direction_of(loop, at, x, y, geometric, &direction, &weight)) {
                /* where none of a lobe's directions was above the surface, its middle stands for them */
                const bool none = loop->sample + 1 == s->rays_per_pixel && s->rays_per_pixel > 1 && s->planes->alpha[at] > MIRROR_ALPHA && !(loop->level->weights.at[0][to] > 1e-20f);
                if (!none) continue;
                weight = es_v3(1, 1, 1);
            }
            store3(loop->level->along.at, to, direction);
            store3(loop->level->weight.at, to, weight);
            /* off the surface on the side that the ray goes to */
            own[count] = 0;
            if (es_v3_dot(geometric, direction) < 0.0f) {
                geometric = es_v3_scale(geometric, -1.0f);
                if (is_edited(s, at)) own[count] = g->instance[at];
            }
            const es_vec3 position = es_pixel_rays_position(&s->rays, (float)x, (float)y, g->depth[at]), o = es_offset_origin(es_v3_add(position, es_v3_scale(geometric, loop->offset)), geometric);
            rays[count] = (es_ray){{o.x, o.y, o.z}, 0.0f, {direction.x, direction.y, direction.z}, 3e38f};
            places[count++] = to;
            if (count < RUN) continue;
            trace_run(loop, rays, places, own, count);
            count = 0;
        }
    }
    trace_run(loop, rays, places, own, count);
}

/* ---- sums ----------------------------------------------------------------------------------------------------------------------------- */

typedef struct sum_loop { const es_traced_source* source; es_traced_level* level; float* const* out; bool first, second, last; } sum_loop;

static void sum_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const sum_loop* loop = user;
    const es_traced_source* s = loop->source;
    es_traced_level* l = loop->level;
    for (uint32_t j = begin; j < end; j++) {
        const size_t row = (size_t)j * l->hits.stride, source = (size_t)(s->rectangle.row_begin + j) * s->gbuffer->stride + s->rectangle.column_begin;
        for (uint32_t i = 0; i < l->hits.width; i++) {
            const size_t at = row + i;
            for (int k = 0; k < 3; k++) {
                const float weight = l->weight.at[k][at], radiance = l->radiance.at[k][at] + (loop->second ? l->second.at[k][at] : 0.0f);
                l->sum.at[k][at] = (loop->first ? 0.0f : l->sum.at[k][at]) + weight * radiance;
                l->weights.at[k][at] = (loop->first ? 0.0f : l->weights.at[k][at]) + weight;
                if (!loop->last) continue;
                const float total = l->weights.at[k][at];
                loop->out[k][source + i] = s->planes->map[source + i] && total > 1e-20f ? s->planes->albedo[k][source + i] * (l->sum.at[k][at] / total) : 0.0f;
            }
        }
    }
}

/* What the level's hits reflect of others, by a ray each, to `second`. */
static es_result add_second(es_renderer* r, const es_frame_inputs* in, es_traced_level* l, const es_pixel_rays* hit_rays, bool* any, uint64_t* rays)
{
    es_reflections* f = &r->reflections;
    const es_reflecting_job find = {.gbuffer = &l->hits, .rays = *hit_rays, .map_of = f->map_of, .roughness = r->settings.reflection_roughness, .lobes = &es_lobe_albedos, .out = l->reflecting.planes};
    es_reflecting_find(r->context, &find);
    const es_traced_source source = {.gbuffer = &l->hits, .rays = *hit_rays, .planes = &l->reflecting.planes, .rectangle = es_reflecting_rectangle(&l->hits, &l->reflecting.planes), .level = 1, .rays_per_pixel = 1};
    *any = source.rectangle.row_end > 0;
    if (!*any) return ES_OK;
    for (int k = 0; k < 3; k++) memset(l->second.at[k], 0, (size_t)l->hits.stride * l->hits.height * sizeof(float));
    return es_trace_reflections(r, in, &source, l->second.at, rays);
}

es_result es_trace_reflections(es_renderer* r, const es_frame_inputs* in, const es_traced_source* source, float* const out[3], uint64_t* rays)
{
    es_traced_level* l = &r->reflections.levels[source->level];
    const es_layer_rectangle* at = &source->rectangle;
    if (!at->row_end) return ES_OK;
    es_result result = resize(r, l, at->column_end - at->column_begin, at->row_end - at->row_begin);
    if (result) return result;
    es_trace_scene scene = r->trace_scene; /* with the environment, which its owner takes along with lights' samples alone */
    scene.environment = in->environment;
    scene.has_environment = in->has_environment;
    const size_t row_bytes = l->hits.height;
    uint8_t* wide = es_allocate_zero(r->context, row_bytes);
    if (!wide) return es_context_last_result(r->context);
    es_pixel_rays hit_rays = {.far_depth = 3e38f, .stride = l->hits.stride};
    for (int k = 0; k < 3; k++) {
        hit_rays.found[k] = l->found.at[k];
        hit_rays.along[k] = l->along.at[k];
    }
    uint32_t samples = source->rays_per_pixel;
    for (uint32_t i = 0; i < samples && !result; i++) {
        ray_loop loop = {.source = source, .scene = &scene, .level = l, .offset = in->extent * ES_RAY_OFFSET_SHARE, .sample = i, .seed = r->settings.seed, .wide = wide};
        es_parallel_for(r->context, l->hits.height, 2, ray_rows, &loop);
        *rays += (uint64_t)l->hits.width * l->hits.height;
        if (i == 0) {
            bool any = false;
            for (size_t k = 0; k < row_bytes; k++) any |= wide[k];
            if (!any) samples = 1;
        }
        bool second = false;
        if (source->level == 0) result = add_second(r, in, l, &hit_rays, &second, rays);
        es_found_surfaces surfaces = {.gbuffer = &l->hits, .rays = hit_rays, .mirrors = second ? l->reflecting.planes.map : NULL};
        for (int k = 0; k < 3; k++) {
            surfaces.background[k] = l->background.at[k];
            surfaces.radiance[k] = l->radiance.at[k];
        }
        if (!result) result = es_light_found(r, in, &surfaces, &l->light);
        sum_loop sums = {source, l, out, i == 0, second, i + 1 == samples};
        if (!result) es_parallel_for(r->context, l->hits.height, 8, sum_rows, &sums);
    }
    es_release(r->context, wide, row_bytes);
    return result;
}
