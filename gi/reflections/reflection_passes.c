#include "gi/reflections/reflection_passes.h"

#include <string.h>

#include "gi/edit/edit_pass.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/reflections/found_light.h"
#include "gi/reflections/map_faces.h"
#include "gi/reflections/refracting.h"
#include "gi/reflections/traced.h"
#include "platform/maths.h"
#include "platform/random.h"
#include "raster/solid_share.h"

/* ---- memory ---------------------------------------------------------------------------------------------------------------------- */

static void free_maps(es_context* context, es_reflections* f)
{
    for (uint32_t i = 0; i < f->map_count; i++) es_second_reflections_free(context, &f->maps[i].second);
    f->map_count = 0;
    es_release(context, f->texels, f->texel_maps * (size_t)f->layout.texels * 4 * sizeof(float));
    f->texels = NULL;
    f->texel_maps = 0;
    es_gbuffer_destroy(context, &f->face);
    es_planes_free(context, &f->background);
    es_planes_free(context, &f->radiance);
    es_found_light_free(context, &f->face_light);
    es_reflecting_buffers_free(context, &f->on_face);
    f->layout = (es_reflection_layout){0};
}

void es_reflections_free_planes(es_context* context, es_reflections* f)
{
    es_reflecting_buffers_free(context, &f->on_picture);
    es_planes_free(context, &f->light);
    es_reflecting_buffers_free(context, &f->on_glass);
    es_planes_free(context, &f->glass_position);
    es_planes_free(context, &f->glass_edited);
    es_planes_free(context, &f->glass_light);
    for (int i = 0; i < 2; i++) es_traced_level_free(context, &f->levels[i]);
}

void es_reflections_free(es_context* context, es_reflections* f)
{
    es_reflections_free_planes(context, f);
    free_maps(context, f);
    es_release(context, f->maps, f->map_capacity * sizeof *f->maps);
    es_release(context, f->map_of, f->map_of_capacity * sizeof *f->map_of);
    for (int k = 0; k < 3; k++) es_release(context, f->centre[k], f->centre_capacity[k] * sizeof(float));
    es_release(context, f->last_level, f->level_capacity * sizeof(float));
    es_release(context, f->any, f->any_capacity);
    es_release(context, f->instances, f->instance_capacity * sizeof *f->instances);
    *f = (es_reflections){0};
}

/* ---- what has a map ---------------------------------------------------------------------------------------------------------------- */

typedef struct candidate { uint32_t place, id; float size; es_vec3 centre; float radius, alpha; } candidate;

/* The widest lobe, as GGX's alpha, that any of the surface has and reflects with, or lets light through with; below 0: none. Textures may make anything of it. */
static float widest_lobe(const es_material_desc* m, float roughness)
{
    const float most = roughness * roughness;
    if (es_transmitted_share(m) > 0.0f) return es_minf(m->roughness * m->roughness, 1.0f);
    if (m->model == ES_SURFACE_UNLIT || (!(m->specular > 0.0f) && !(m->metallic > 0.0f))) return -1.0f;
    if (m->model == ES_SURFACE_PHONG) {
        const float alpha = es_sqrt(2.0f / (m->exponent + 2.0f));
        return alpha <= most ? alpha : -1.0f;
    }
    if (m->metallic_roughness_texture.image) return es_minf(most, m->roughness * m->roughness);
    /* as the G-buffer rounds it */
    const float rounded = es_floor(m->roughness * 255.0f + 0.5f) * (1.0f / 255.0f);
    return rounded * rounded <= most ? rounded * rounded : -1.0f;
}

static bool is_finite(float x) { return x - x == 0.0f; }

static bool is_candidate(const es_renderer* r, const es_draw_list* list, uint32_t place, es_vec3 eye, candidate* c)
{
    const es_raster_instance* instance = &list->instances[place];
    const es_raster_mesh* mesh = instance->mesh;
    if (!mesh || !mesh->triangle_count) return false;
    const float alpha = widest_lobe(&list->materials[instance->material], r->settings.reflection_roughness);
    if (!(alpha >= 0.0f)) return false;
    es_vec3 low = es_v3(3e38f, 3e38f, 3e38f), high = es_v3(-3e38f, -3e38f, -3e38f);
    for (int i = 0; i < 8; i++) {
        const es_vec3 corner = es_v3(i & 1 ? mesh->bounds_max.x : mesh->bounds_min.x, i & 2 ? mesh->bounds_max.y : mesh->bounds_min.y, i & 4 ? mesh->bounds_max.z : mesh->bounds_min.z);
        const es_vec3 p = es_mat4_point(&instance->transform, corner);
        low = es_v3(es_minf(low.x, p.x), es_minf(low.y, p.y), es_minf(low.z, p.z));
        high = es_v3(es_maxf(high.x, p.x), es_maxf(high.y, p.y), es_maxf(high.z, p.z));
    }
    const es_vec3 centre = es_v3_scale(es_v3_add(low, high), 0.5f);
    const float radius = 0.5f * es_v3_length(es_v3_sub(high, low));
    if (!is_finite(centre.x) || !is_finite(centre.y) || !is_finite(centre.z) || !is_finite(radius) || !(radius > 0.0f)) return false;
    const float distance = es_v3_length(es_v3_sub(centre, eye));
    *c = (candidate){place, instance->id + 1, distance > radius ? radius / distance : 1.0f, centre, radius, alpha};
    return true;
}

/* Puts it among the largest, which are in order; of equals the lower id stays. */
static void keep_largest(candidate* list, uint32_t* count, uint32_t most, const candidate* c)
{
    uint32_t at = *count;
    while (at > 0 && (c->size > list[at - 1].size || (c->size == list[at - 1].size && c->id < list[at - 1].id))) at--;
    if (at >= most) return;
    if (*count < most) ++*count;
    for (uint32_t i = *count - 1; i > at; i--) list[i] = list[i - 1];
    list[at] = *c;
}

static es_result reserve_maps(es_renderer* r, uint32_t count)
{
    es_reflections* f = &r->reflections;
    es_context* context = r->context;
    if (f->layout.size != r->settings.reflection_size) {
        free_maps(context, f);
        f->layout = es_reflection_layout_of(r->settings.reflection_size);
    }
    bool all = es_grow(context, (void**)&f->maps, &f->map_capacity, f->map_count, count, sizeof *f->maps) && es_grow(context, (void**)&f->last_level, &f->level_capacity, f->map_count, count, sizeof(float));
    for (int k = 0; k < 3; k++) all = all && es_grow(context, (void**)&f->centre[k], &f->centre_capacity[k], f->map_count, count, sizeof(float));
    if (!all) return es_context_last_result(context);
    for (; f->map_count < count; f->map_count++) {
        f->maps[f->map_count] = (es_reflection_map){0};
        f->last_level[f->map_count] = 0.0f;
        for (int k = 0; k < 3; k++) f->centre[k][f->map_count] = 0.0f;
    }
    if (count <= f->texel_maps) return ES_OK;
    const size_t floats = 4 * (size_t)f->layout.texels;
    float* texels = es_allocate_zero(context, count * floats * sizeof *texels);
    if (!texels) return es_context_last_result(context);
    if (f->texels) memcpy(texels, f->texels, f->texel_maps * floats * sizeof *texels);
    es_release(context, f->texels, f->texel_maps * floats * sizeof *texels);
    f->texels = texels;
    f->texel_maps = count;
    return ES_OK;
}

static uint32_t slot_of(const es_reflections* f, uint32_t id)
{
    uint32_t free = f->map_count;
    for (uint32_t i = 0; i < f->map_count; i++) {
        if (f->maps[i].instance == id) return i;
        if (!f->maps[i].instance && free == f->map_count) free = i;
    }
    return free;
}

static es_vec3 eye_of(const es_pixel_rays* rays) { return es_v3(rays->base[0], rays->base[1], rays->base[2]); }

/* The things that have maps in this frame: those that look largest from the eye. What had one keeps its place. */
static es_result choose(es_renderer* r, const es_frame_inputs* in)
{
    es_reflections* f = &r->reflections;
    candidate chosen[ES_REFLECTION_MOST_MAPS];
    uint32_t count = 0, ids = 0;
    const es_vec3 eye = eye_of(&r->rays);
    const bool traced = r->settings.reflections == ES_REFLECTIONS_TRACED;
    f->wants_rays = false;
    f->has_glass = es_has_glass(in->list);
    for (uint32_t i = 0; i < in->list->instance_count; i++) {
        candidate c;
        if (is_candidate(r, in->list, i, eye, &c)) keep_largest(chosen, &count, r->settings.reflection_maps, &c);
        if (in->list->instances[i].id + 2 > ids) ids = in->list->instances[i].id + 2;
    }
    for (uint32_t i = 0; i < in->solid->instance_count; i++)
        if (in->solid->instances[i].id + 2 > ids) ids = in->solid->instances[i].id + 2;
    if (!es_grow(r->context, (void**)&f->map_of, &f->map_of_capacity, 0, ids + 1, sizeof *f->map_of)) return es_context_last_result(r->context);
    f->map_of_count = ids + 1;
    memset(f->map_of, 0, f->map_of_count * sizeof *f->map_of);
    if (traced) {
        free_maps(r->context, f);
        for (uint32_t i = 0; i < in->list->instance_count; i++) {
            candidate c;
            if (!is_candidate(r, in->list, i, eye, &c)) continue;
            f->map_of[c.id] = 1;
            f->wants_rays = true;
        }
        return ES_OK;
    }
    es_result result = reserve_maps(r, count);
    if (result) return result;
    for (uint32_t i = 0; i < f->map_count; i++) f->maps[i].wanted = false;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < f->map_count; k++) f->maps[k].wanted |= f->maps[k].instance == chosen[i].id;
    for (uint32_t i = 0; i < f->map_count; i++)
        if (!f->maps[i].wanted) f->maps[i].instance = 0;
    for (uint32_t i = 0; i < count; i++) {
        const candidate* c = &chosen[i];
        const uint32_t slot = slot_of(f, c->id);
        es_reflection_map* map = &f->maps[slot];
        if (map->instance != c->id) map->drawn = 0;
        map->instance = c->id;
        map->wanted = true;
        map->place = c->place;
        map->centre = c->centre;
        map->near_plane = es_maxf(c->radius * 1e-3f, 1e-9f);
        /* lobes widen as what they show comes closer than the middle is */
        const float last = es_reflection_level_of_alpha(es_minf(1.5f * c->alpha, 1.0f));
        map->last_level = last < 0.05f ? 0 : (uint32_t)last < last ? (uint32_t)last + 1 : (uint32_t)last;
        f->map_of[c->id] = slot + 1;
        f->last_level[slot] = (float)map->last_level;
        f->centre[0][slot] = c->centre.x;
        f->centre[1][slot] = c->centre.y;
        f->centre[2][slot] = c->centre.z;
    }
    return ES_OK;
}

/* ---- passes -------------------------------------------------------------------------------------------------------------------------- */

static const char* nothing(const es_renderer* r, const es_frame_inputs* in)
{
    return r->settings.reflections == ES_REFLECTIONS_NONE ? "reflections is none" : !in->has_geometry ? "nothing reflects" : NULL;
}

static bool any_wanted(const es_reflections* f)
{
    for (uint32_t i = 0; i < f->map_count; i++)
        if (f->maps[i].wanted) return true;
    return false;
}

es_result es_pass_reflecting(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    es_reflections* f = &r->reflections;
    const char* why = nothing(r, in);
    es_result result = why ? ES_OK : choose(r, in);
    if (result) return result;
    if (!why && !any_wanted(f) && !f->wants_rays) why = "nothing reflects";
    if (why) {
        es_plan_not_needed(plan, ES_PASS_REFLECTING, why);
        es_reflections_free(r->context, f);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_REFLECTING);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads(plan, f->map_of, f->map_of_count * sizeof *f->map_of);
    es_plan_reads(plan, &r->settings.reflection_roughness, sizeof r->settings.reflection_roughness);
    if (!es_plan_run(plan, ES_PASS_REFLECTING)) return ES_OK;
    result = es_reflecting_buffers_resize(r->context, &f->on_picture, &r->gbuffer);
    if (result) return result;
    const es_reflecting_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .map_of = f->map_of, .roughness = r->settings.reflection_roughness, .lobes = &es_lobe_albedos, .out = f->on_picture.planes};
    es_reflecting_find(r->context, &job);
    es_plan_done(plan, ES_PASS_REFLECTING, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return ES_OK;
}

/* Is any of the light that surfaces get found by rays? Then the hierarchy is a part of it. */
static bool light_by_rays(const es_renderer* r)
{
    const es_renderer_settings* s = &r->settings;
    return es_lamps_want_rays(r) || s->method == ES_GI_VPL_TRACED || s->method == ES_GI_VPL_SAMPLED || s->near_distance > 0.0f;
}

/* Of everything that lights a map's faces, and of what has maps. */
static uint64_t light_hash(const es_renderer* r, const es_frame_inputs* in)
{
    static const es_pass read[] = {ES_PASS_SHADOW_MAPS, ES_PASS_ENVIRONMENT, ES_PASS_LAMPS, ES_PASS_LAMP_MAPS, ES_PASS_VPLS, ES_PASS_LAMP_BOUNCE, ES_PASS_ISM, ES_PASS_CLASSIC, ES_PASS_BOUNCES, ES_PASS_FOREST,
        ES_PASS_POINT_LIGHT, ES_PASS_SECOND_ORDER};
    const es_reflections* f = &r->reflections;
    uint64_t hash = es_history_settings(&r->settings);
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) hash = es_hash_bytes(hash, &r->plan.version[read[i]], sizeof r->plan.version[0]);
    if (light_by_rays(r)) hash = es_hash_bytes(hash, &r->plan.version[ES_PASS_HIERARCHY], sizeof r->plan.version[0]);
    hash = es_hash_bytes(hash, in->lights, in->light_count * sizeof *in->lights);
    const uint64_t words[] = {in->revisions.materials, in->revisions.environment, in->has_environment, es_indirect_is_there(r), es_lamps_are_there(r), r->light_count};
    hash = es_hash_bytes(hash, words, sizeof words);
    hash = es_hash_bytes(hash, &in->extent, sizeof in->extent);
    return es_hash_bytes(hash, f->map_of, f->map_of_count * sizeof *f->map_of);
}

es_result es_pass_reflection_maps(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    es_reflections* f = &r->reflections;
    if (!plan->valid[ES_PASS_REFLECTING]) {
        es_plan_not_needed(plan, ES_PASS_REFLECTION_MAPS, plan->stats[ES_PASS_REFLECTING].skipped);
        return ES_OK;
    }
    if (f->wants_rays) {
        es_plan_not_needed(plan, ES_PASS_REFLECTION_MAPS, "reflections is traced");
        return ES_OK;
    }
    const uint64_t light = light_hash(r, in);
    es_plan_begin(plan, ES_PASS_REFLECTION_MAPS);
    es_plan_reads(plan, &light, sizeof light);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    /* bounds hold last frame's vertices as well, so a middle comes to rest a frame after its thing */
    for (uint32_t i = 0; i < f->map_count; i++) {
        es_plan_reads(plan, &f->maps[i].centre, sizeof f->maps[i].centre);
        es_plan_reads(plan, &f->maps[i].near_plane, sizeof f->maps[i].near_plane);
    }
    if (!es_plan_run(plan, ES_PASS_REFLECTION_MAPS)) return ES_OK;
    uint64_t drawn = 0, triangles = 0;
    es_result result = ES_OK;
    for (uint32_t i = 0; i < f->map_count && !result; i++) {
        es_reflection_map* map = &f->maps[i];
        if (!map->wanted) continue;
        const uint64_t content = es_reflection_content(r, in, map);
        if (!content) return es_context_last_result(r->context);
        const uint64_t words[] = {content, light, map->last_level};
        const uint64_t hash = es_hash_bytes(0, words, sizeof words) | 1;
        if (r->settings.skip && map->drawn == hash) continue;
        result = es_reflection_draw(r, in, i, &triangles);
        if (!result) map->drawn = hash;
        drawn++;
    }
    if (!result && drawn) result = es_reflection_finish_all(r);
    if (result) {
        for (uint32_t i = 0; i < f->map_count; i++) f->maps[i].drawn = 0;
        return result;
    }
    es_plan_done(plan, ES_PASS_REFLECTION_MAPS, drawn);
    if (!drawn) plan->stats[ES_PASS_REFLECTION_MAPS].skipped = "nothing that the maps show has changed";
    return ES_OK;
}

static es_result look_into_maps(es_renderer* r, const es_reflection_atlas* atlas)
{
    es_reflections* f = &r->reflections;
    es_reflected_job job = {.gbuffer = &r->gbuffer, .rays = r->rays, .planes = f->on_picture.planes, .atlas = atlas, .lit = f->light.lit};
    es_edited_reflections(r, job.edited);
    for (int k = 0; k < 3; k++) job.out[k] = f->light.at[k];
    es_reflected_from_maps(r->context, &job);
    return ES_OK;
}

static es_result trace(es_renderer* r, const es_frame_inputs* in, uint64_t* rays)
{
    es_reflections* f = &r->reflections;
    es_traced_source source = {.gbuffer = &r->gbuffer, .rays = r->rays, .planes = &f->on_picture.planes, .rectangle = es_reflecting_rectangle(&r->gbuffer, &f->on_picture.planes), .rays_per_pixel = r->settings.reflection_rays};
    es_edited_reflections(r, source.edited);
    for (int k = 0; k < 3; k++) memset(f->light.at[k], 0, (size_t)r->gbuffer.stride * r->gbuffer.height * sizeof(float));
    return es_trace_reflections(r, in, &source, f->light.at, rays);
}

/* Where anything is seen, in mirrors or through glass. */
static es_result join_any(es_renderer* r)
{
    es_reflections* f = &r->reflections;
    const size_t chunks = f->on_picture.chunks;
    if (!es_grow(r->context, (void**)&f->any, &f->any_capacity, 0, chunks, 1)) return es_context_last_result(r->context);
    for (size_t i = 0; i < chunks; i++) f->any[i] = f->on_picture.planes.any[i] | (r->plan.valid[ES_PASS_REFRACTING] ? f->on_glass.planes.any[i] : 0);
    return ES_OK;
}

es_result es_pass_reflections(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    es_reflections* f = &r->reflections;
    if (!plan->valid[ES_PASS_REFLECTING]) {
        es_plan_not_needed(plan, ES_PASS_REFLECTIONS, plan->stats[ES_PASS_REFLECTING].skipped);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_REFLECTIONS);
    es_plan_reads_pass(plan, ES_PASS_REFLECTING);
    es_plan_reads_pass(plan, ES_PASS_REFLECTION_MAPS);
    es_plan_reads_pass(plan, ES_PASS_REFRACTING);
    es_plan_reads_pass(plan, ES_PASS_EDITS);
    if (f->wants_rays) {
        const uint64_t words[] = {light_hash(r, in), plan->version[ES_PASS_HIERARCHY], r->settings.reflection_rays};
        es_plan_reads(plan, words, sizeof words);
    }
    if (!es_plan_run(plan, ES_PASS_REFLECTIONS)) return ES_OK;
    uint64_t count = (uint64_t)r->gbuffer.width * r->gbuffer.height;
    es_result result = es_planes_resize(r->context, &f->light, &r->gbuffer);
    const es_reflection_atlas atlas = {f->texels, f->layout, {f->centre[0], f->centre[1], f->centre[2]}, f->last_level};
    if (!result) result = f->wants_rays ? trace(r, in, &count) : look_into_maps(r, &atlas);
    if (!result && plan->valid[ES_PASS_REFRACTING]) result = es_add_refractions(r, in, &atlas, &count);
    if (!result) result = join_any(r);
    if (!result) es_plan_done(plan, ES_PASS_REFLECTIONS, count);
    return result;
}

bool es_reflections_want_rays(const es_renderer* r) { return r->plan.valid[ES_PASS_REFLECTING] && (r->reflections.wants_rays || r->reflections.has_glass); }

void es_reflections_read(es_plan* plan) { es_plan_reads_pass(plan, ES_PASS_REFLECTIONS); }

void es_reflections_compose(const es_renderer* r, es_compose_job* job)
{
    if (!r->plan.valid[ES_PASS_REFLECTIONS]) return;
    const es_reflections* f = &r->reflections;
    for (int k = 0; k < 3; k++) job->mirrored[k] = f->light.at[k];
    job->mirrors = f->on_picture.planes.map;
    job->mirrors_any = f->any;
}
