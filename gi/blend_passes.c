#include "gi/blend_passes.h"

#include <string.h>

#include "gi/blend.h"
#include "gi/direct.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/micro_passes.h"
#include "gi/second_order_pass.h"

enum { LAYER_PLANES = ES_GBUFFER_DEPTH | ES_GBUFFER_NORMAL | ES_GBUFFER_GEOMETRIC_NORMAL | ES_GBUFFER_ALBEDO | ES_GBUFFER_SURFACE | ES_GBUFFER_EMISSION | ES_GBUFFER_ALPHA };

static void free_depths(es_context* context, es_blend_layers* b)
{
    if (b->solid_depth) es_release(context, b->solid_depth, b->depth_floats * sizeof(float));
    b->solid_depth = NULL;
    for (int i = 0; i + 1 < ES_BLEND_MAX_LAYERS; i++) {
        if (b->drawn[i]) es_release(context, b->drawn[i], b->depth_floats * sizeof(float));
        b->drawn[i] = NULL;
    }
}

/* Planes of the rectangle. */
static void free_light(es_context* context, es_blend_layers* b)
{
    es_planes* const planes[] = {&b->light.irradiance, &b->light.specular, &b->light.filtered_irradiance, &b->light.filtered_specular, &b->light.sparse_irradiance, &b->light.sparse_specular, &b->part};
    for (size_t i = 0; i < sizeof planes / sizeof planes[0]; i++) es_planes_free(context, planes[i]);
}

void es_blend_layers_free(es_context* context, es_blend_layers* b)
{
    for (int i = 0; i < ES_BLEND_MAX_LAYERS; i++) es_gbuffer_destroy(context, &b->gbuffers[i]);
    free_depths(context, b);
    free_light(context, b);
    es_planes* const sums[] = {&b->transmittance, &b->emitted, &b->direct, &b->lamps, &b->bounded};
    for (size_t i = 0; i < sizeof sums / sizeof sums[0]; i++) es_planes_free(context, sums[i]);
    *b = (es_blend_layers){0};
}

/* ---- peeling ------------------------------------------------------------------------------------------------------------------ */

static es_result reserve_depth(es_renderer* r, float** depth)
{
    es_blend_layers* b = &r->blend;
    const size_t floats = (size_t)r->gbuffer.stride * r->gbuffer.height;
    if (b->depth_floats != floats) free_depths(r->context, b);
    b->depth_floats = floats;
    if (!*depth) *depth = es_allocate_zero(r->context, floats * sizeof(float));
    return *depth ? ES_OK : es_context_last_result(r->context);
}

es_result es_blend_behind(es_renderer* r, es_depth_range* range, const es_depth_range** wanted)
{
    es_result result = reserve_depth(r, &r->blend.solid_depth);
    if (result) return result;
    *range = (es_depth_range){.drawn = r->blend.solid_depth, .stride = r->gbuffer.stride};
    *wanted = range;
    return ES_OK;
}

/* Rows and columns in steps of this: where things move a little, planes of light keep their size. */
enum { RECTANGLE_STEP = 32 };

static uint32_t step_up(uint32_t at, uint32_t end)
{
    const uint32_t up = (at + RECTANGLE_STEP - 1) / RECTANGLE_STEP * RECTANGLE_STEP;
    return up < end ? up : end;
}

static es_layer_rectangle covered(const es_gbuffer* g)
{
    es_layer_rectangle c = {g->width, 0, g->height, 0};
    for (uint32_t y = 0; y < g->height; y++) {
        const float* depth = g->depth + (size_t)y * g->stride;
        uint32_t first = 0, last = g->width;
        while (first < last && !(depth[first] > 0.0f)) first++;
        if (first == last) continue;
        while (!(depth[last - 1] > 0.0f)) last--;
        c.column_begin = first < c.column_begin ? first : c.column_begin;
        c.column_end = last > c.column_end ? last : c.column_end;
        c.row_begin = y < c.row_begin ? y : c.row_begin;
        c.row_end = y + 1;
    }
    if (!c.row_end) return (es_layer_rectangle){0};
    return (es_layer_rectangle){c.column_begin / RECTANGLE_STEP * RECTANGLE_STEP, step_up(c.column_end, g->stride), c.row_begin / RECTANGLE_STEP * RECTANGLE_STEP, step_up(c.row_end, g->height)};
}

static es_result peel(es_renderer* r, const es_frame_inputs* in, uint64_t* triangles)
{
    es_blend_layers* b = &r->blend;
    const uint32_t layers = r->settings.blend_layers;
    const float* before = r->settings.screen_layers > 1 ? r->screen.drawn[0] : b->solid_depth;
    es_result result = ES_OK;
    b->count = 0;
    for (uint32_t i = 0; i < layers && !result; i++) {
        es_gbuffer* g = &b->gbuffers[i];
        es_raster_stats stats = {0};
        if (!g->memory) result = es_gbuffer_create(r->context, r->gbuffer.width, r->gbuffer.height, LAYER_PLANES, g);
        if (!result && i + 1 < layers) result = reserve_depth(r, &b->drawn[i]);
        if (result) return result;
        const es_depth_range range = {.behind = i ? b->drawn[i - 1] : NULL, .before = before, .drawn = i + 1 < layers ? b->drawn[i] : NULL, .stride = r->gbuffer.stride};
        result = es_draw_gbuffer_between(r->rasterizer, in->layers, &r->view, &range, g, &stats);
        *triangles += stats.triangles;
        if (!stats.pixels) break;
        b->count = i + 1;
    }
    if (!result && b->count) b->rectangle = covered(&b->gbuffers[0]); /* those behind it are nowhere else */
    return result;
}

static const char* no_layers(const es_renderer* r, const es_frame_inputs* in) { return in->layers->instance_count ? NULL : r->settings.blend_layers ? "nothing blends" : "blend.layers is 0"; }

es_result es_pass_blend_layers(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const char* why = no_layers(r, in);
    if (why) {
        es_plan_not_needed(plan, ES_PASS_BLEND_LAYERS, why);
        es_blend_layers_free(r->context, &r->blend);
        return ES_OK;
    }
    es_plan_begin(plan, ES_PASS_BLEND_LAYERS);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    es_plan_reads(plan, &r->settings.blend_layers, sizeof r->settings.blend_layers);
    if (!es_plan_run(plan, ES_PASS_BLEND_LAYERS)) return ES_OK;
    uint64_t triangles = 0;
    es_result result = peel(r, in, &triangles);
    if (!result) es_plan_done(plan, ES_PASS_BLEND_LAYERS, triangles);
    return result;
}

/* ---- light ---------------------------------------------------------------------------------------------------------------------- */

/* The rectangle as a G-buffer by itself: its planes are the layer's. */
static es_gbuffer window_of(const es_gbuffer* g, const es_layer_rectangle* at)
{
    es_gbuffer w = *g;
    const size_t first = (size_t)at->row_begin * g->stride + at->column_begin;
    w.width = (at->column_end < g->width ? at->column_end : g->width) - at->column_begin;
    w.height = at->row_end - at->row_begin;
    w.depth += first;
    w.alpha += first;
    uint32_t** const words[] = {&w.normal, &w.geometric_normal, &w.albedo_rg, &w.albedo_b, &w.surface, &w.emission};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++) *words[i] += first;
    w.memory = NULL;
    w.memory_bytes = 0;
    return w;
}

static es_pixel_rays rays_of(const es_pixel_rays* of, const es_layer_rectangle* at)
{
    es_pixel_rays rays = *of;
    const float x = (float)at->column_begin, y = (float)at->row_begin;
    for (int k = 0; k < 3; k++) {
        rays.base[k] += x * rays.base_dx[k] + y * rays.base_dy[k];
        rays.dir[k] += x * rays.dir_dx[k] + y * rays.dir_dy[k];
    }
    return rays;
}

/* Adds r->blend.part to a sum of the whole picture, or nothing; then goes on behind the layer, or not. */
static void add_part(es_renderer* r, const es_gbuffer* window, float* transmittance, const es_planes* sum, bool through)
{
    const es_blend_layers* b = &r->blend;
    const size_t first = (size_t)b->rectangle.row_begin * window->stride + b->rectangle.column_begin;
    es_blend_job job = {.alpha = window->alpha, .transmittance = transmittance + first, .through = through, .columns = (window->width + 7) / 8 * 8, .rows = window->height, .stride = window->stride};
    for (int k = 0; k < 3 && sum; k++) {
        job.layer[k] = b->part.at[k];
        job.sum[k] = sum->at[k] + first;
    }
    es_blend(r->context, &job);
}

static void light_to_compose(const es_layer_light* light, const float* irradiance[3], const float* specular[3], const uint8_t** lit)
{
    const es_planes *diffuse = light->filtered ? &light->filtered_irradiance : &light->irradiance, *lobes = light->filtered_lobes ? &light->filtered_specular : &light->specular;
    for (int k = 0; k < 3; k++) {
        irradiance[k] = diffuse->at[k];
        specular[k] = light->lobes ? lobes->at[k] : NULL;
    }
    *lit = light->lobes ? lobes->lit : NULL;
}

/* The layer's bounded indirect light, to r->blend.part. */
static es_result bounded_part(es_renderer* r, const es_gbuffer* window, uint32_t lights)
{
    es_blend_layers* b = &r->blend;
    const uint32_t method = r->frame.settings.method;
    const es_lit_surfaces surfaces = {window, rays_of(&r->rays, &b->rectangle), b->lobes};
    b->light.lobes = b->lobes && method != ES_GI_SECOND_ORDER;
    es_result result = method == ES_GI_MICRO ? es_micro_light_layer(r, &surfaces, &b->light)
                       : method == ES_GI_SECOND_ORDER ? es_second_order_light_layer(r, &surfaces, &b->light) : es_indirect_shade_layer(r, &surfaces, lights, &b->light);
    if (!result) result = es_indirect_filter_layer(r, &surfaces, &b->light);
    if (result) return result;
    es_compose_job job = {.gbuffer = window};
    light_to_compose(&b->light, job.irradiance, job.specular, &job.lit);
    for (int k = 0; k < 3; k++) job.bounded[k] = b->part.at[k];
    es_compose(r->context, &job);
    return ES_OK;
}

static void direct_part(es_renderer* r, const es_gbuffer* window)
{
    const es_renderer_settings* s = &r->settings;
    const es_planes* part = &r->blend.part;
    for (uint32_t i = 0; i < r->light_count; i++) {
        const es_direct_job job = {.gbuffer = window, .rays = rays_of(&r->rays, &r->blend.rectangle), .view = &r->light_views[i], .shadow_filter = s->shadow_filter, .shadow_bias = s->shadow_bias,
            .shadow_slope_bias = s->shadow_slope_bias, .first = i == 0, .out = {part->at[0], part->at[1], part->at[2]}};
        es_direct_light(r->context, &job);
    }
}

static es_result lamps_part(es_renderer* r, const es_gbuffer* window)
{
    es_blend_layers* b = &r->blend;
    const es_lit_surfaces surfaces = {window, rays_of(&r->rays, &b->rectangle), b->lamp_lobes};
    es_result result = es_lamps_light_layer(r, &surfaces, &b->light);
    if (result) return result;
    es_compose_job job = {.gbuffer = window};
    light_to_compose(&b->light, job.lamp_irradiance, job.lamp_specular, &job.lamp_lit);
    for (int k = 0; k < 3; k++) job.whole_direct[k] = b->part.at[k];
    es_compose(r->context, &job);
    return ES_OK;
}

static void emitted_part(es_renderer* r, const es_gbuffer* window)
{
    es_compose_job job = {.gbuffer = window};
    for (int k = 0; k < 3; k++) job.emitted[k] = r->blend.part.at[k];
    es_compose(r->context, &job);
}

/* Within the rectangle. */
static void fill(es_renderer* r, float* plane, float value)
{
    const es_layer_rectangle* at = &r->blend.rectangle;
    for (uint32_t y = at->row_begin; y < at->row_end; y++)
        for (uint32_t x = at->column_begin; x < at->column_end; x++) plane[(size_t)y * r->gbuffer.stride + x] = value;
}

static es_result begin_sum(es_renderer* r, es_planes* sum)
{
    es_result result = es_planes_resize(r->context, sum, &r->gbuffer);
    for (int k = 0; k < 3 && !result; k++) fill(r, sum->at[k], 0.0f);
    return result;
}

static bool has_lamps(const es_renderer* r) { return es_lamps_are_there(r) && r->lamps.set.shaded_count; }

static es_result light_layers(es_renderer* r)
{
    es_blend_layers* b = &r->blend;
    const bool direct = r->plan.valid[ES_PASS_DIRECT], lamps = has_lamps(r), indirect = es_indirect_is_there(r);
    es_planes* const sums[] = {&b->emitted, &b->direct, &b->lamps, &b->bounded};
    /* planes of lobes know which parts of them are dark (gi/lit.h), of one rectangle */
    if (memcmp(&b->lit, &b->rectangle, sizeof b->lit) != 0) free_light(r->context, b);
    b->lit = b->rectangle;
    es_result result = es_planes_resize(r->context, &b->transmittance, &r->gbuffer);
    for (int i = 0; i < 4 && !result; i++) result = begin_sum(r, sums[i]);
    if (result) return result;
    float* transmittance = b->transmittance.at[0];
    fill(r, transmittance, 1.0f);
    for (uint32_t i = 0; i < b->count && !result; i++) {
        const es_gbuffer window = window_of(&b->gbuffers[i], &b->rectangle);
        result = es_planes_resize(r->context, &b->part, &window);
        if (result) return result;
        emitted_part(r, &window);
        add_part(r, &window, transmittance, &b->emitted, false);
        if (direct) {
            direct_part(r, &window);
            add_part(r, &window, transmittance, &b->direct, false);
        }
        if (lamps) {
            result = lamps_part(r, &window);
            if (!result) add_part(r, &window, transmittance, &b->lamps, false);
        }
        if (!result && indirect) {
            result = bounded_part(r, &window, r->vpl_count);
            if (!result) add_part(r, &window, transmittance, &b->bounded, false);
        }
        if (!result) add_part(r, &window, transmittance, NULL, true);
    }
    return result;
}

es_result es_pass_blend_light(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    es_blend_layers* b = &r->blend;
    const char* nothing = no_layers(r, in);
    const char* why = nothing ? nothing : !b->count ? "no blended surface is in front of the picture" : NULL;
    if (why) {
        es_plan_not_needed(plan, ES_PASS_BLEND_LIGHT, why);
        return ES_OK;
    }
    b->lobes = es_frame_has_lobes(r, in->layers);
    b->lamp_lobes = es_lamps_anything_specular(in->layers);
    es_plan_begin(plan, ES_PASS_BLEND_LIGHT);
    const es_pass read[] = {ES_PASS_BLEND_LAYERS, ES_PASS_SHADOW_MAPS, ES_PASS_DIRECT, ES_PASS_LAMPS, ES_PASS_LAMP_MAPS, ES_PASS_HIERARCHY, ES_PASS_VPLS, ES_PASS_LAMP_BOUNCE, ES_PASS_ISM, ES_PASS_CLASSIC, ES_PASS_BOUNCES,
        ES_PASS_FOREST, ES_PASS_POINT_LIGHT, ES_PASS_SECOND_ORDER};
    for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
    es_plan_reads(plan, in->lights, in->light_count * sizeof *in->lights);
    /* of settings nearly all have their say in some method */
    const uint64_t settings = es_history_settings(&r->settings);
    es_plan_reads(plan, &settings, sizeof settings);
    const float numbers[] = {in->extent, b->lobes, b->lamp_lobes, es_indirect_is_there(r), has_lamps(r)};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (!es_plan_run(plan, ES_PASS_BLEND_LIGHT)) return ES_OK;
    es_result result = light_layers(r);
    const es_layer_rectangle* at = &b->rectangle;
    if (!result) es_plan_done(plan, ES_PASS_BLEND_LIGHT, (uint64_t)(at->column_end - at->column_begin) * (at->row_end - at->row_begin) * b->count);
    return result;
}

void es_blend_compose(const es_renderer* r, es_compose_job* job)
{
    if (!r->plan.valid[ES_PASS_BLEND_LIGHT]) return;
    const es_blend_layers* b = &r->blend;
    const es_layer_rectangle* at = &b->rectangle;
    es_compose_layers* l = &job->layers;
    *l = (es_compose_layers){.transmittance = b->transmittance.at[0], .column_begin = at->column_begin, .column_end = at->column_end, .row_begin = at->row_begin, .row_end = at->row_end};
    for (int k = 0; k < 3; k++) {
        l->emitted[k] = b->emitted.at[k];
        l->direct[k] = b->direct.at[k];
        l->lamps[k] = b->lamps.at[k];
        l->bounded[k] = b->bounded.at[k];
    }
}

es_result es_blend_bounded(es_renderer* r, uint32_t lights, es_planes* bounded)
{
    es_blend_layers* b = &r->blend;
    if (!r->plan.valid[ES_PASS_BLEND_LIGHT]) return ES_OK;
    es_planes transmittance = {0};
    es_result result = es_planes_resize(r->context, &transmittance, &r->gbuffer);
    if (!result) result = begin_sum(r, bounded);
    if (!result) fill(r, transmittance.at[0], 1.0f);
    for (uint32_t i = 0; i < b->count && !result; i++) {
        const es_gbuffer window = window_of(&b->gbuffers[i], &b->rectangle);
        result = bounded_part(r, &window, lights);
        if (!result) add_part(r, &window, transmittance.at[0], bounded, true);
    }
    es_planes_free(r->context, &transmittance);
    return result;
}
