/* Inside of a renderer: the plan, the buffers each pass writes, and nothing hidden between frames. */
#ifndef EARTHSHINE_GI_RENDERER_H
#define EARTHSHINE_GI_RENDERER_H

#include "gi/blend_lists.h"
#include "gi/compose.h"
#include "gi/environment.h"
#include "gi/exposure.h"
#include "gi/filter.h"
#include "gi/glare/glare_pass.h"
#include "gi/half_resolution.h"
#include "gi/history.h"
#include "gi/ism.h"
#include "gi/lamps.h"
#include "gi/layer_light.h"
#include "gi/light_view.h"
#include "gi/meter.h"
#include "gi/micro/light.h"
#include "gi/micro/micro.h"
#include "gi/plan.h"
#include "gi/reference/scene.h"
#include "gi/reflections/reflections.h"
#include "gi/scene_points.h"
#include "gi/second_order.h"
#include "gi/screen/buffers.h"
#include "gi/shade.h"
#include "gi/stable_vpls.h"
#include "gi/surfels.h"
#include "gi/vpl_sampling.h"
#include "platform/context.h"

/* What the last frame was, or this one is being, rendered with: images are made of it after the settings have changed. */
typedef struct es_frame_settings { es_renderer_settings settings; float extent; } es_frame_settings;

/* What micro-buffers are drawn of, and planes of theirs besides the renderer's (gi/micro_passes.h). */
typedef struct es_micro_buffers {
    es_point_forest forest;
    es_lobe_shapes shapes;
    uint32_t spacing;          /* that the next two have pixels for */
    es_planes sparse_irradiance, sparse_specular;
    es_planes fresh_irradiance, fresh_specular;   /* of this frame alone, where the renderer's are means over several */
    es_micro_stats stats;      /* of this frame */
    uint32_t turn;             /* of its buffers */
} es_micro_buffers;

/* Direct light of glowing surfaces and of the environment (gi/lamp_passes.h). */
typedef struct es_lamp_light {
    es_lamps set;
    es_ism_maps maps;
    bool has_specular;         /* something in the frame has a lobe */
    bool filtered;
    es_planes irradiance, specular, filtered_irradiance, filtered_specular;
} es_lamp_light;

/* Second-order illumination (gi/second_order_pass.h): at half the resolution; what negative lights take, as irradiance and reflected, both not above 0. */
typedef struct es_second_order_buffers {
    es_gbuffer half;
    es_planes half_positive, half_negative;
    es_planes taken, negative;
    es_open_light* lights;     /* of this frame: the positive ones, then the negative ones */
    size_t light_capacity;
    uint32_t positive_count, negative_count;
} es_second_order_buffers;

/* What bias compensation in screen space gathers from, and what it found (gi/screen/residual_pass.h). */
typedef struct es_residual_buffers {
    es_residual_pyramid pyramids[ES_RESIDUAL_LAYERS]; /* of the picture, and of layers peeled from it */
    es_planes sent;            /* direct and bounded indirect light */
    es_planes sparse_irradiance, sparse_specular;
    es_planes irradiance, specular;
    es_planes steps[ES_RESIDUAL_STEPS]; /* reflected radiance */
} es_residual_buffers;

/* Where edited reflections go (gi/edit/edit_pass.h). */
typedef struct es_edit_buffers { es_planes directions; } es_edit_buffers;

struct es_renderer {
    es_context* context;
    es_renderer_settings settings;
    es_frame_settings frame;
    es_plan plan;
    es_frame_stats stats;
    uint64_t frames;
    bool complete;             /* the last frame was rendered to its end */

    es_rasterizer* rasterizer;
    es_raster_view view;
    es_pixel_rays rays;
    es_gbuffer gbuffer;

    es_light_view* light_views;
    es_importance* importances;
    uint32_t light_count, light_capacity;

    es_vpl_record* vpls;
    uint32_t vpl_count, vpl_capacity; /* of all bounces, one after another */
    uint32_t first_vpls;       /* of the first bounce, … */
    uint32_t punctual_vpls;    /* … of these those of lights without a size, which come before those of lamps */
    es_bounce_stats bounces[ES_MAX_BOUNCES];
    es_stable_vpls stable;     /* places of the lights, with vpl.stable: the only thing that frames leave to later ones but what they need not compute again */

    es_scene_points points;
    es_scene_points bounce_points; /* places of further bounces' lights, when they have points of their own */
    es_surfels surfels;        /* of these or of `points` */
    es_ism_maps maps;          /* imperfect or classic, whichever the method uses */

    es_edit_buffers edits;
    es_lamp_light lamps;
    es_trace_scene trace_scene; /* of traced methods */
    es_micro_buffers micro;

    es_planes background;      /* the environment where nothing is seen; kept while there is one */
    es_environment_map environment; /* valid when the pass is */
    es_screen_buffers screen;
    es_blend_lists lists;      /* of the frame that is being rendered */
    es_blend_layers blend;
    es_reflections reflections;

    es_planes direct;          /* reflected direct radiance */
    es_planes irradiance, filtered_irradiance;
    es_planes specular, filtered_specular;        /* used when something in the frame has a lobe */
    es_gbuffer half;           /* with half_resolution: what the indirect light is shaded and filtered on, and its planes */
    es_planes upsampled_irradiance, upsampled_specular;
    es_planes compensation;    /* of the lights' bias: reflected radiance, of either sign */
    es_residual_buffers residual;
    es_second_order_buffers second_order;
    bool has_specular;
    uint32_t filter_passes;    /* that this frame's indirect light went through */
    es_history history;
    es_planes radiance;        /* of the picture, where something reads it before it is shown and anti-aliasing has not made it */
    es_meter metered;          /* valid when the pass is */
    es_exposure exposure;
    es_glare glare;
    es_arena arena;            /* of the pass that runs */
    uint32_t* display;         /* 0x00RRGGBB */
    es_srgb_table srgb;
};

/* What a frame is made from, and why some of it is not. */
typedef struct es_frame_inputs {
    const es_draw_list *list, *solid, *layers; /* what light meets; what the camera sees, but for the last: blended surfaces (gi/blend_lists.h) */
    const es_light_state* lights;
    uint32_t light_count;
    es_world_revisions revisions;
    es_environment_desc environment;
    bool has_environment;
    double time;             /* es_world_time, s */
    es_vec3 bounds_min, bounds_max;
    float extent;            /* diagonal of the world's bounds, metres */
    bool has_geometry;
    const char* no_indirect; /* why there is no indirect light; NULL: there is */
    bool may_have_lamps;     /* something glows, or there is an environment, and lamps are wanted */
    const char* no_vpls;     /* why there are no virtual point lights; NULL: there are, if light reaches anything */
} es_frame_inputs;

/* es_renderer_settings.geometry_bound of this world, 1/m² */
float es_geometry_bound(const es_renderer_settings* settings, const es_frame_inputs* in);
es_result es_planes_resize(es_context* context, es_planes* planes, const es_gbuffer* gbuffer);
void es_planes_free(es_context* context, es_planes* planes);
/* The environment as background, and its maps for light (gi/environment_passes.c). */
es_result es_pass_background(es_renderer* renderer, const es_frame_inputs* in);
es_result es_pass_environment(es_renderer* renderer, const es_frame_inputs* in);
/* Passes of traced methods (gi/traced_passes.c). */
es_result es_pass_hierarchy(es_renderer* renderer, const es_frame_inputs* in, es_world* world);
es_result es_pass_compensation(es_renderer* renderer, const es_frame_inputs* in);
/* What a frame takes from the last one (gi/temporal_passes.c). Begin: before the first pass; sets the view's previous matrices. */
es_result es_history_begin(es_renderer* renderer, const es_frame_inputs* in, const es_world* world);
void es_history_end(es_history* history); /* the frame is complete */
void es_history_free(es_context* context, es_history* history);
/* Hash of all settings but what changes no result, or the display only. */
uint64_t es_history_settings(const es_renderer_settings* settings);
/* Before `drawn` is drawn anew: what it holds goes to `last`. */
es_result es_history_keep(es_context* context, es_gbuffer* drawn, es_gbuffer* last);
es_result es_pass_temporal(es_renderer* renderer, const es_frame_inputs* in);
/* Pictures that a frame is the mean of, and of each: sets the renderer's view; blends the picture (gi/antialias_pass.c). */
uint32_t es_antialias_pictures(const es_renderer_settings* settings);
void es_antialias_aim(es_renderer* renderer, uint32_t picture);
es_result es_pass_antialias(es_renderer* renderer, uint32_t picture);
/* Of the last frame, a plane as the ones that are blended; 0 where there was no history. */
es_result es_temporal_confidence(es_renderer* renderer, float* confidence);
/* The job of the compose pass for the frame as it stands; outputs are for the caller to set. */
es_compose_job es_renderer_compose_job(const es_renderer* renderer);

#endif
