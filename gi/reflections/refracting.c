#include "gi/reflections/refracting.h"

#include <string.h>

#include "gi/edit/edit_pass.h"
#include "gi/lit.h"
#include "gi/reference/path.h"
#include "gi/reference/refraction.h"
#include "gi/reflections/map_faces.h"
#include "gi/reflections/traced.h"
#include "platform/maths.h"
#include "raster/solid_share.h"

bool es_has_glass(const es_draw_list* list)
{
    for (uint32_t i = 0; i < list->instance_count; i++)
        if (es_transmitted_share(&list->materials[list->instances[i].material]) > 0.0f) return true;
    return false;
}

typedef struct glass_loop { es_renderer* r; const es_draw_list* list; } glass_loop;

static void put3(float* const to[3], size_t at, es_vec3 v)
{
    to[0][at] = v.x;
    to[1][at] = v.y;
    to[2][at] = v.z;
}

/* False: nothing goes through there. */
static bool refract_pixel(const glass_loop* loop, uint32_t x, uint32_t y, size_t at)
{
    es_renderer* r = loop->r;
    const es_gbuffer* g = &r->gbuffer;
    es_reflections* f = &r->reflections;
    const uint32_t material = g->albedo_b[at] >> 16, map = f->map_of[g->instance[at]];
    if (!map || material >= loop->list->material_count || !(es_transmitted_share(&loop->list->materials[material]) > 0.0f)) return false;
    const es_ray ray = es_path_ray(&r->rays, (float)x, (float)y);
    const es_vec3 d = es_v3_normalize(es_v3(ray.direction[0], ray.direction[1], ray.direction[2]), es_v3(0, 0, -1));
    es_hit hit;
    if (!es_trace_closest(&r->trace_scene, ray, true, &hit)) return false;
    es_trace_surface s;
    es_trace_surface_at(&r->trace_scene, &hit, es_v3_scale(d, -1.0f), false, &s);
    const es_refraction through = es_trace_refraction(&r->trace_scene, &s, d);
    if (!(es_maxf(through.weight.x, es_maxf(through.weight.y, through.weight.z)) > 0.0f)) return false;
    f->on_glass.planes.map[at] = map;
    /* as KHR_materials_transmission's sample renderer has it: glass of index 1 blurs nothing */
    f->on_glass.planes.alpha[at] = s.roughness * s.roughness * es_clampf(2.0f * es_ior_of(&loop->list->materials[material]) - 2.0f, 0.0f, 1.0f);
    put3(f->on_glass.planes.direction, at, through.direction);
    put3(f->on_glass.planes.albedo, at, through.weight);
    put3(f->glass_position.at, at, through.position);
    return true;
}

static void glass_rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const glass_loop* loop = user;
    const es_gbuffer* g = &loop->r->gbuffer;
    es_reflecting_buffers* b = &loop->r->reflections.on_glass;
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = begin; y < end; y++) {
        const size_t row = (size_t)y * g->stride;
        memset(b->planes.map + row, 0, g->stride * sizeof(uint32_t));
        memset(b->planes.any + (size_t)y * chunks, 0, chunks);
        for (int k = 0; k < 3; k++) memset(b->planes.direction[k] + row, 0, g->stride * sizeof(float));
        for (uint32_t x = 0; x < g->width; x++)
            if (g->instance[row + x] && refract_pixel(loop, x, y, row + x)) b->planes.any[(size_t)y * chunks + x / ES_LIT_COLUMNS] = 1;
    }
}

/* The leaving direction at a constraint's handle, seen from its eye. */
static bool original_at(const void* user, const es_resolved_constraint* c, es_vec3* direction)
{
    const es_renderer* r = user;
    const es_trace_scene* scene = &r->trace_scene;
    uint32_t primitive = 0, i = 0;
    for (; i < scene->instance_count && scene->instances[i].id != c->instance; i++) primitive += scene->instances[i].mesh ? scene->instances[i].mesh->triangle_count : 0;
    if (i == scene->instance_count || !scene->instances[i].mesh || c->triangle >= scene->instances[i].mesh->triangle_count) return false;
    const es_hit hit = {.u = c->u, .v = c->v, .primitive = primitive + c->triangle};
    const es_vec3 d = es_v3_normalize(es_v3_sub(c->position, c->eye), es_v3(0, 0, -1));
    es_trace_surface s;
    es_trace_surface_at(scene, &hit, es_v3_scale(d, -1.0f), false, &s);
    const es_refraction through = es_trace_refraction(scene, &s, d);
    if (!(es_maxf(through.weight.x, es_maxf(through.weight.y, through.weight.z)) > 0.0f)) return false;
    *direction = through.direction;
    return true;
}

es_result es_pass_refracting(es_renderer* r, const es_frame_inputs* in, es_world* world)
{
    es_plan* plan = &r->plan;
    es_reflections* f = &r->reflections;
    const char* why = !plan->valid[ES_PASS_REFLECTING] ? plan->stats[ES_PASS_REFLECTING].skipped : !f->has_glass ? "nothing lets light through" : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_REFRACTING, why);
        return ES_OK;
    }
    const bool edited = es_edits_refraction(r, world);
    es_plan_begin(plan, ES_PASS_REFRACTING);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_HIERARCHY);
    es_plan_reads(plan, f->map_of, f->map_of_count * sizeof *f->map_of);
    es_plan_reads(plan, &edited, sizeof edited);
    if (edited) es_plan_reads(plan, &in->revisions.edits, sizeof in->revisions.edits);
    if (!es_plan_run(plan, ES_PASS_REFRACTING)) return ES_OK;
    es_result result = es_reflecting_buffers_resize(r->context, &f->on_glass, &r->gbuffer);
    if (!result) result = es_planes_resize(r->context, &f->glass_position, &r->gbuffer);
    if (!result) result = es_planes_resize(r->context, &f->glass_light, &r->gbuffer);
    if (!result && edited) result = es_planes_resize(r->context, &f->glass_edited, &r->gbuffer);
    if (result) return result;
    glass_loop loop = {r, in->list};
    es_parallel_for(r->context, r->gbuffer.height, 2, glass_rows, &loop);
    f->glass_is_edited = edited;
    if (edited) {
        const float* const directions[3] = {f->on_glass.planes.direction[0], f->on_glass.planes.direction[1], f->on_glass.planes.direction[2]};
        result = es_edit_refraction(r, in, world, original_at, r, directions, f->glass_edited.at);
    }
    if (!result) es_plan_done(plan, ES_PASS_REFRACTING, (uint64_t)r->gbuffer.width * r->gbuffer.height);
    return result;
}

es_result es_add_refractions(es_renderer* r, const es_frame_inputs* in, const es_reflection_atlas* atlas, uint64_t* rays)
{
    es_reflections* f = &r->reflections;
    const es_gbuffer* g = &r->gbuffer;
    es_pixel_rays leaving = {.far_depth = 3e38f, .stride = g->stride};
    const float* edited[3] = {NULL, NULL, NULL};
    for (int k = 0; k < 3; k++) {
        leaving.found[k] = f->glass_position.at[k];
        leaving.along[k] = f->on_glass.planes.direction[k];
        if (f->glass_is_edited) edited[k] = f->glass_edited.at[k];
    }
    float* const out[3] = {f->glass_light.at[0], f->glass_light.at[1], f->glass_light.at[2]};
    es_result result = ES_OK;
    if (f->wants_rays) {
        const es_traced_source source = {.gbuffer = g, .rays = leaving, .planes = &f->on_glass.planes, .edited = {edited[0], edited[1], edited[2]}, .rectangle = es_reflecting_rectangle(g, &f->on_glass.planes), .rays_per_pixel = 1};
        for (int k = 0; k < 3; k++) memset(out[k], 0, (size_t)g->stride * g->height * sizeof(float));
        result = es_trace_reflections(r, in, &source, out, rays);
    } else {
        const es_reflected_job job = {.gbuffer = g, .rays = leaving, .planes = f->on_glass.planes, .edited = {edited[0], edited[1], edited[2]}, .atlas = atlas, .out = {out[0], out[1], out[2]}, .lit = f->glass_light.lit};
        es_reflected_from_maps(r->context, &job);
    }
    const uint32_t chunks = es_lit_chunks(g->stride);
    for (uint32_t y = 0; y < g->height && !result; y++)
        for (uint32_t c = 0; c < chunks; c++) {
            const size_t chunk = (size_t)y * chunks + c;
            if (!(f->on_glass.planes.any[chunk] & 1)) continue;
            f->light.lit[chunk] = 1;
            for (uint32_t x = c * ES_LIT_COLUMNS; x < g->width && x < (c + 1) * ES_LIT_COLUMNS; x++)
                for (int k = 0; k < 3; k++) f->light.at[k][(size_t)y * g->stride + x] += out[k][(size_t)y * g->stride + x];
        }
    return result;
}
