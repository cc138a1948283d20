#include "gi/micro_passes.h"

#include <string.h>

#include "gi/blend_passes.h"
#include "gi/bounce_pass.h"
#include "gi/edit/edit_pass.h"
#include "gi/indirect.h"
#include "gi/lamp_passes.h"
#include "gi/lit.h"
#include "gi/micro/light.h"
#include "gi/micro/photon_map.h"
#include "gi/micro/pixels.h"
#include "gi/micro/point_vpls.h"
#include "gi/micro/radiosity.h"
#include "gi/micro/upsample.h"
#include "platform/random.h"

static bool is_micro(const es_renderer* r) { return r->settings.method == ES_GI_MICRO; }

const char* es_micro_nothing(const es_frame_inputs* in, const es_renderer_settings* s)
{
    if (s->bounces == 0) return "bounces is 0";
    if (!in->has_geometry) return "nothing to light";
    if (in->light_count || in->may_have_lamps) return NULL;
    return !s->micro_emission ? "no light is on" : es_something_glows(in->list) ? NULL : "no light is on and nothing glows";
}

bool es_micro_wants_photons(const es_renderer_settings* s) { return s->method == ES_GI_MICRO && s->micro_light == ES_MICRO_LIGHT_PHOTONS && s->bounces > 1; }

uint32_t es_micro_vpl_bounces(const es_renderer_settings* s) { return s->method == ES_GI_MICRO && s->micro_light == ES_MICRO_LIGHT_VPLS && s->bounces > 1 ? s->bounces - 1 : 0; }

void es_micro_free_planes(es_context* context, es_micro_buffers* micro)
{
    es_planes_free(context, &micro->sparse_irradiance);
    es_planes_free(context, &micro->sparse_specular);
    es_planes_free(context, &micro->fresh_irradiance);
    es_planes_free(context, &micro->fresh_specular);
}

void es_micro_free(es_context* context, es_micro_buffers* micro)
{
    es_micro_free_planes(context, micro);
    es_forest_free(context, &micro->forest);
}

/* ---- points ------------------------------------------------------------------------------------------------------------------ */

es_micro_settings es_micro_settings_of(const es_renderer_settings* s)
{
    return (es_micro_settings){.size = s->micro_size, .cut = s->micro_cut, .cover = s->micro_cover, .share = s->micro_share, .ray_cast = s->micro_ray_cast, .warp = s->micro_warp, .quantised = s->micro_nodes == ES_MICRO_QUANTISED};
}

static es_result bring_forest(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_forest_request request = {.points = r->settings.micro_points, .rebuild = r->settings.micro_rebuild, .packed_only = r->settings.micro_nodes == ES_MICRO_QUANTISED};
    es_plan_begin(plan, ES_PASS_FOREST);
    es_plan_reads(plan, &in->revisions.geometry, sizeof in->revisions.geometry);
    es_plan_reads(plan, &in->revisions.materials, sizeof in->revisions.materials);
    es_plan_reads(plan, &request, sizeof request);
    if (!es_plan_run(plan, ES_PASS_FOREST)) return ES_OK;
    es_forest_update update = {0};
    es_result result = es_forest_bring(r->context, &r->micro.forest, in->list, in->revisions.materials, &request, &update);
    if (!result) es_plan_done(plan, ES_PASS_FOREST, update.points);
    return result;
}

/* That a picture of the points shows, if they are there; the lights are placed. */
static uint32_t bounces_of(const es_renderer* r)
{
    const es_renderer_settings* s = &r->frame.settings;
    switch ((es_micro_light)s->micro_light) {
    case ES_MICRO_LIGHT_VPLS: return 1 + (r->vpl_count ? (uint32_t)r->stats.bounce_count : 0);
    case ES_MICRO_LIGHT_RADIOSITY: return 1 + (s->micro_iterations ? s->micro_iterations : s->bounces - 1);
    case ES_MICRO_LIGHT_PHOTONS: return s->bounces;
    default: return 1;
    }
}

/* By virtual point lights that stand where light has met up to `bounces` surfaces. */
static es_result add_vpls(es_renderer* r, uint32_t bounces)
{
    const es_renderer_settings* s = &r->frame.settings;
    const float extent = r->frame.extent;
    const es_shade_job lights = {.vpls = r->vpls, .vpl_count = r->vpl_count, .dark_count = r->vpl_count - es_bounce_end(r, bounces), .maps = r->maps.texels, .map_size = r->maps.size,
        .far_distance = r->maps.far_distance, .bias = s->ism_bias * extent, .slope_bias = s->ism_slope_bias * extent, .spread = s->spread, .lobe_roughness = s->lobe_roughness,
        .geometry_bound = s->geometry_bound / (extent * extent), .interleave = 1};
    return es_points_light_vpls(r->context, &r->arena, &r->micro.forest, &lights, s->micro_level, &es_lobe_albedos);
}

/* What the points send once light has met up to `bounces` surfaces, theirs the last, with the settings of the frame that is being, or was last, rendered. */
static es_result light_points(es_renderer* r, uint32_t bounces)
{
    const es_renderer_settings* s = &r->frame.settings;
    const bool lamps = es_lamps_are_there(r);
    bool glossy = false;
    for (uint32_t i = 0; i < r->micro.forest.tree_count && s->micro_lobes; i++) glossy = glossy || r->micro.forest.trees[i].glossy;
    if (glossy) es_lobe_shapes_fill(r->context, &r->micro.shapes);
    const es_point_light_job direct = {.views = r->light_views, .view_count = r->light_count, .shadow_filter = s->shadow_filter, .shadow_bias = s->shadow_bias,
        .shadow_slope_bias = s->shadow_slope_bias, .emission = s->micro_emission && !lamps, .lobes = &es_lobe_albedos,
        .shapes = glossy ? &r->micro.shapes : NULL};
    es_result result = es_points_light_direct(r->context, &r->micro.forest, &direct);
    es_arena_reset(&r->arena);
    /* photons that leave what glows bring its light to the points */
    if (!result && lamps && !(bounces > 1 && s->micro_light == ES_MICRO_LIGHT_PHOTONS && s->micro_emission)) {
        const es_shade_job set = es_lamps_at_points(r);
        result = es_points_light_vpls(r->context, &r->arena, &r->micro.forest, &set, s->micro_level, &es_lobe_albedos);
    }
    if (!result && bounces > 1) {
        const es_radiosity_job radiosity = {.level = s->micro_level, .iterations = bounces - 1, .micro = es_micro_settings_of(s), .seed = s->seed, .lobes = &es_lobe_albedos};
        const es_photon_job photons = {.scene = &r->trace_scene, .photons = s->micro_photons, .bounces = bounces - 1, .seed = s->seed, .emission = s->micro_emission, .lobes = &es_lobe_albedos};
        if (s->micro_light == ES_MICRO_LIGHT_VPLS) result = add_vpls(r, bounces - 1);
        if (s->micro_light == ES_MICRO_LIGHT_RADIOSITY) result = es_points_light_radiosity(r->context, &r->arena, &r->micro.forest, &radiosity, NULL);
        if (s->micro_light == ES_MICRO_LIGHT_PHOTONS) result = es_points_light_photons(r->context, &r->arena, &r->micro.forest, &photons, NULL);
    }
    if (!result) es_forest_pull(r->context, &r->micro.forest);
    return result;
}

static es_result pass_point_light(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    es_plan_begin(plan, ES_PASS_POINT_LIGHT);
    es_plan_reads(plan, &r->micro.forest.version, sizeof r->micro.forest.version);
    es_plan_reads_pass(plan, ES_PASS_SHADOW_MAPS);
    es_plan_reads(plan, in->lights, in->light_count * sizeof *in->lights);
    float numbers[] = {(float)s->shadow_filter, s->shadow_bias, s->shadow_slope_bias, s->micro_emission, s->micro_lobes, es_lamps_are_there(r)};
    es_plan_reads(plan, numbers, sizeof numbers);
    if (es_lamps_are_there(r)) {
        es_plan_reads_pass(plan, ES_PASS_LAMPS);
        es_plan_reads_pass(plan, ES_PASS_LAMP_MAPS);
        const float of_lamps[] = {s->lamp_slope_bias, in->extent, (float)s->micro_level};
        es_plan_reads(plan, of_lamps, sizeof of_lamps);
    }
    const uint32_t bounces = bounces_of(r);
    if (bounces > 1) {
        const es_pass read[] = {ES_PASS_VPLS, ES_PASS_ISM, ES_PASS_BOUNCES, ES_PASS_HIERARCHY};
        for (size_t i = 0; i < sizeof read / sizeof read[0]; i++) es_plan_reads_pass(plan, read[i]);
        uint32_t words[] = {bounces, s->micro_light, s->micro_level, s->micro_photons, s->seed, s->micro_size, s->micro_ray_cast, s->micro_warp, s->micro_nodes, r->vpl_count};
        es_plan_reads(plan, words, sizeof words);
        float of_light[] = {s->ism_bias, s->ism_slope_bias, s->spread, s->lobe_roughness, s->geometry_bound, in->extent, s->micro_cut, s->micro_cover, s->micro_share};
        es_plan_reads(plan, of_light, sizeof of_light);
    }
    if (!es_plan_run(plan, ES_PASS_POINT_LIGHT)) return ES_OK;
    es_result result = light_points(r, bounces);
    if (!result) es_plan_done(plan, ES_PASS_POINT_LIGHT, r->micro.forest.leaf_count);
    return result;
}

es_result es_pass_points(es_renderer* r, const es_frame_inputs* in)
{
    const char* why = !is_micro(r) ? "gi is not micro" : in->no_indirect;
    if (why) {
        es_plan_not_needed(&r->plan, ES_PASS_FOREST, why);
        es_plan_not_needed(&r->plan, ES_PASS_POINT_LIGHT, why);
        es_micro_free(r->context, &r->micro);
        return ES_OK;
    }
    es_result result = bring_forest(r, in);
    return result ? result : pass_point_light(r, in);
}

/* ---- gathering -------------------------------------------------------------------------------------------------------------------- */

/* Of what lobes reflect (gi/micro/upsample.h); the thesis' previews of glossy surfaces have it as well. */
static uint32_t lobe_spacing(const es_renderer_settings* s) { return s->micro_spacing < 2 ? s->micro_spacing : 2; }

static uint32_t turn_of(const es_renderer* r)
{
    const es_history* h = &r->history;
    const es_renderer_settings* s = &r->settings;
    if (s->antialias != ES_ANTIALIAS_NONE) return h->place;
    if (!s->temporal) return 0;
    return h->still ? h->still < s->temporal_settle ? h->still : s->temporal_settle : (uint32_t)r->frames;
}

static bool accumulates(const es_renderer* r) { return r->settings.temporal && r->settings.antialias == ES_ANTIALIAS_NONE && r->settings.temporal_settle > 1 && r->history.still > 1; }

static es_micro_pixels pixels_of(const es_renderer* r, uint32_t kind)
{
    es_micro_pixels pixels = {.gbuffer = &r->gbuffer, .rays = r->rays, .kind = kind, .spacing = 1, .seed = es_hash_u32(r->micro.turn) + r->frame.settings.seed};
    es_edited_reflections(r, pixels.edited);
    return pixels;
}

bool es_micro_point_of_frame(const es_renderer* renderer, uint32_t x, uint32_t y, uint32_t kind, es_gather_point* point)
{
    const es_micro_pixels pixels = pixels_of(renderer, kind);
    return es_micro_pixel_point(&pixels, x, y, point);
}

static es_result gather(es_renderer* r, es_micro_pixels* pixels, es_planes* planes, uint64_t* gathered)
{
    es_arena_reset(&r->arena);
    for (int k = 0; k < 3; k++) pixels->result[k] = planes->at[k];
    const es_micro_settings settings = es_micro_settings_of(&r->frame.settings);
    return es_micro_gather_pixels(r->context, &r->arena, &r->micro.forest, &settings, pixels, &r->micro.stats, gathered);
}

static es_result gather_sparsely(es_renderer* r, const es_micro_pixels* of, uint32_t spacing, es_planes* planes, uint64_t* gathered)
{
    const uint32_t width = es_micro_sparse(of->gbuffer->width, spacing), height = es_micro_sparse(of->gbuffer->height, spacing);
    const es_gbuffer size = {.width = width, .height = height, .stride = (width + 7) / 8 * 8};
    es_result result = es_planes_resize(r->context, planes, &size);
    if (result) return result;
    es_micro_pixels pixels = *of;
    pixels.spacing = spacing;
    pixels.stride = size.stride;
    return gather(r, &pixels, planes, gathered);
}

static es_result gather_fully(es_renderer* r, const es_micro_pixels* of, es_planes* planes, uint64_t* gathered)
{
    es_micro_pixels pixels = *of;
    pixels.stride = of->gbuffer->stride;
    pixels.lit = of->kind == ES_GATHER_LOBE ? planes->lit : NULL;
    return gather(r, &pixels, planes, gathered);
}

static es_result interpolate(es_renderer* r, const es_micro_pixels* of, uint32_t spacing, const es_planes* sparse, es_planes* planes, uint64_t* gathered)
{
    const es_gbuffer* g = of->gbuffer;
    const size_t bytes = (size_t)es_micro_list_stride(g->width) * g->height;
    uint8_t* listed = es_allocate(r->context, bytes);
    if (!listed) return es_context_last_result(r->context);
    const uint32_t width = es_micro_sparse(g->width, spacing);
    es_micro_upsample_job job = {.gbuffer = g, .rays = of->rays, .kind = of->kind, .spacing = spacing, .sparse_width = width, .sparse_height = es_micro_sparse(g->height, spacing), .sparse_stride = (width + 7) / 8 * 8,
        .lit = of->kind == ES_GATHER_LOBE ? planes->lit : NULL, .listed = listed};
    for (int k = 0; k < 3; k++) {
        job.source[k] = sparse->at[k];
        job.result[k] = planes->at[k];
    }
    es_micro_upsample(r->context, &job);
    es_micro_pixels pixels = *of;
    pixels.listed = listed;
    pixels.stride = g->stride;
    es_result result = gather(r, &pixels, planes, gathered);
    es_release(r->context, listed, bytes);
    return result;
}

typedef struct mean_loop { const es_planes* fresh; es_planes* mean; size_t floats; float share; } mean_loop;

enum { MEAN_GRAIN = 1 << 14 };

static void add_to_mean(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const mean_loop* loop = user;
    const size_t from = (size_t)begin * MEAN_GRAIN, all = (size_t)end * MEAN_GRAIN, to = all < loop->floats ? all : loop->floats;
    for (int k = 0; k < 3; k++) {
        const float* fresh = loop->fresh->at[k];
        float* mean = loop->mean->at[k];
        for (size_t i = from; i < to; i++) mean[i] += (fresh[i] - mean[i]) * loop->share;
    }
}

/* The mean over the still frames so far. A settled one is complete: what was gathered once more, as where no work is skipped, is in it. */
static void accumulate(es_renderer* r, const es_planes* fresh, es_planes* mean, bool lobes)
{
    if (r->history.resting) return;
    mean_loop loop = {fresh, mean, (size_t)r->gbuffer.stride * r->gbuffer.height, 1.0f / (float)r->history.still};
    es_parallel_for(r->context, (uint32_t)((loop.floats + MEAN_GRAIN - 1) / MEAN_GRAIN), 1, add_to_mean, &loop);
    const size_t chunks = (size_t)es_lit_chunks(r->gbuffer.stride) * r->gbuffer.height;
    for (size_t i = 0; i < chunks && lobes; i++) mean->lit[i] |= fresh->lit[i] & 1;
}

static es_result gather_all(es_renderer* r, es_planes* irradiance, es_planes* specular)
{
    es_result result = es_planes_resize(r->context, irradiance, &r->gbuffer);
    if (!result && r->has_specular) result = es_planes_resize(r->context, specular, &r->gbuffer);
    uint64_t gathered = 0;
    const es_renderer_settings* s = &r->frame.settings;
    if (s->micro_spacing != r->micro.spacing) {
        es_planes_free(r->context, &r->micro.sparse_irradiance);
        es_planes_free(r->context, &r->micro.sparse_specular);
        r->micro.spacing = s->micro_spacing;
    }
    const es_micro_pixels diffuse = pixels_of(r, ES_GATHER_DIFFUSE), lobe = pixels_of(r, ES_GATHER_LOBE);
    if (s->micro_spacing == 1) {
        if (!result) result = gather_fully(r, &diffuse, irradiance, &gathered);
        if (!result && r->has_specular) result = gather_fully(r, &lobe, specular, &gathered);
        return result;
    }
    if (!result) result = gather_sparsely(r, &diffuse, s->micro_spacing, &r->micro.sparse_irradiance, &gathered);
    if (!result && r->has_specular) result = gather_sparsely(r, &lobe, lobe_spacing(s), &r->micro.sparse_specular, &gathered);
    return result;
}

static es_result fill(es_renderer* r, es_planes* irradiance, es_planes* specular, uint64_t* gathered)
{
    const es_renderer_settings* s = &r->frame.settings;
    const es_micro_pixels diffuse = pixels_of(r, ES_GATHER_DIFFUSE), lobe = pixels_of(r, ES_GATHER_LOBE);
    es_result result = interpolate(r, &diffuse, s->micro_spacing, &r->micro.sparse_irradiance, irradiance, gathered);
    if (!result && r->has_specular) result = interpolate(r, &lobe, lobe_spacing(s), &r->micro.sparse_specular, specular, gathered);
    return result;
}

es_result es_micro_light_layer(es_renderer* r, const es_lit_surfaces* of, es_layer_light* light)
{
    const es_renderer_settings* s = &r->frame.settings;
    uint64_t gathered = 0;
    es_result result = es_planes_resize(r->context, &light->irradiance, of->gbuffer);
    if (!result && of->lobes) result = es_planes_resize(r->context, &light->specular, of->gbuffer);
    for (uint32_t kind = 0; kind < 2 && !result; kind++) {
        const bool lobe = kind == 1;
        if (lobe && !of->lobes) continue;
        const es_micro_pixels pixels = {.gbuffer = of->gbuffer, .rays = of->rays, .kind = lobe ? ES_GATHER_LOBE : ES_GATHER_DIFFUSE, .spacing = 1, .seed = es_hash_u32(0) + s->seed};
        es_planes *sparse = lobe ? &light->sparse_specular : &light->sparse_irradiance, *planes = lobe ? &light->specular : &light->irradiance;
        const uint32_t spacing = of->rays.found[0] ? 1 : lobe ? lobe_spacing(s) : s->micro_spacing; /* what other rays found is no surface to interpolate along */
        if (spacing == 1) result = gather_fully(r, &pixels, planes, &gathered);
        else result = gather_sparsely(r, &pixels, spacing, sparse, &gathered);
        if (!result && spacing > 1) result = interpolate(r, &pixels, spacing, sparse, planes, &gathered);
    }
    return result;
}

es_result es_pass_micro(es_renderer* r, const es_frame_inputs* in)
{
    es_plan* plan = &r->plan;
    const es_renderer_settings* s = &r->settings;
    const char* why = !is_micro(r) ? "gi is not micro" : in->no_indirect;
    if (why || s->micro_spacing == 1) es_plan_not_needed(plan, ES_PASS_MICRO_UPSAMPLE, why ? why : "micro.spacing is 1");
    if (why) {
        es_plan_not_needed(plan, ES_PASS_MICRO, why);
        return ES_OK;
    }
    r->has_specular = es_frame_has_lobes(r, in->solid);
    const bool several = accumulates(r);
    r->micro.turn = turn_of(r);
    es_planes *irradiance = several ? &r->micro.fresh_irradiance : &r->irradiance, *specular = several ? &r->micro.fresh_specular : &r->specular;

    es_plan_begin(plan, ES_PASS_MICRO);
    es_plan_reads_pass(plan, ES_PASS_VISIBILITY);
    es_plan_reads_pass(plan, ES_PASS_POINT_LIGHT);
    es_plan_reads_pass(plan, ES_PASS_EDITS);
    es_plan_reads(plan, &r->micro.forest.version, sizeof r->micro.forest.version);
    const uint32_t words[] = {s->micro_size, s->micro_spacing, s->micro_ray_cast, s->micro_warp, s->micro_nodes, r->has_specular, s->seed, r->micro.turn, several};
    es_plan_reads(plan, words, sizeof words);
    const float numbers[] = {s->micro_cut, s->micro_cover, s->micro_share};
    es_plan_reads(plan, numbers, sizeof numbers);
    bool gathered_now = es_plan_run(plan, ES_PASS_MICRO);
    if (gathered_now) {
        r->micro.stats = (es_micro_stats){0};
        es_result result = gather_all(r, irradiance, specular);
        if (result) return result;
        es_plan_done(plan, ES_PASS_MICRO, r->micro.stats.samples);
    }
    if (s->micro_spacing > 1) {
        es_plan_begin(plan, ES_PASS_MICRO_UPSAMPLE);
        es_plan_reads_pass(plan, ES_PASS_MICRO);
        gathered_now = es_plan_run(plan, ES_PASS_MICRO_UPSAMPLE);
        uint64_t afresh = 0;
        es_result result = gathered_now ? fill(r, irradiance, specular, &afresh) : ES_OK;
        if (result) return result;
        if (gathered_now) es_plan_done(plan, ES_PASS_MICRO_UPSAMPLE, afresh);
    }
    if (several && gathered_now) {
        accumulate(r, irradiance, &r->irradiance, false);
        if (r->has_specular) accumulate(r, specular, &r->specular, true);
    }
    return ES_OK;
}

/* ---- images of single bounces --------------------------------------------------------------------------------------------------- */

uint32_t es_micro_bounces(const es_renderer* r)
{
    return es_indirect_is_there(r) ? bounces_of(r) : 0;
}

es_result es_micro_first_bounces(es_renderer* r, uint32_t bounces, es_planes* indirect)
{
    es_result result = es_planes_resize(r->context, indirect, &r->gbuffer);
    if (result || !bounces) return result;
    es_compose_job job = es_renderer_compose_job(r);
    es_indirect_planes light;
    memset(&light, 0, sizeof light);
    const es_planes *irradiance = &r->irradiance, *specular = &r->specular;
    es_planes filtered = {0}, none = {0}, layers = {0};
    if (bounces < es_micro_bounces(r)) {
        result = light_points(r, bounces);
        if (!result) result = es_blend_bounded(r, 0, &layers);
        if (!result) result = gather_all(r, &light.irradiance, &light.specular);
        uint64_t afresh = 0;
        if (!result && r->frame.settings.micro_spacing > 1) result = fill(r, &light.irradiance, &light.specular, &afresh);
        const es_result restored = light_points(r, bounces_of(r));
        if (restored) es_plan_invalidate(&r->plan);
        if (!result) result = restored;
        irradiance = &light.irradiance;
        specular = &light.specular;
    }
    if (!result && r->filter_passes) {
        result = es_indirect_filter(r, irradiance, specular, &filtered, &none);
        irradiance = &filtered;
    }
    job.lit = specular->lit;
    for (int k = 0; k < 3; k++) {
        job.irradiance[k] = irradiance->at[k];
        job.specular[k] = r->has_specular ? specular->at[k] : NULL;
        job.indirect[k] = indirect->at[k];
        if (layers.memory) job.layers.bounded[k] = layers.at[k];
    }
    if (!result) es_compose(r->context, &job);
    es_indirect_planes_free(r->context, &light);
    es_planes_free(r->context, &filtered);
    es_planes_free(r->context, &layers);
    return result;
}
