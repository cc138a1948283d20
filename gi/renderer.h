/* Inside of a renderer: the plan, the buffers each pass writes, and nothing hidden between frames. */
#ifndef EARTHSHINE_GI_RENDERER_H
#define EARTHSHINE_GI_RENDERER_H

#include "gi/compose.h"
#include "gi/filter.h"
#include "gi/ism.h"
#include "gi/light_view.h"
#include "gi/plan.h"
#include "gi/scene_points.h"
#include "gi/shade.h"
#include "gi/vpl_sampling.h"
#include "platform/context.h"

/* Three planes of floats, rows of the G-buffer's stride. */
typedef struct es_planes { float* at[3]; void* memory; size_t bytes; } es_planes;

struct es_renderer {
    es_context* context;
    es_renderer_settings settings;
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
    uint32_t vpl_count, vpl_capacity;

    es_scene_points points;
    es_ism_maps maps;          /* imperfect or classic, whichever the method uses */

    es_planes direct;          /* reflected direct radiance */
    es_planes irradiance, filtered_irradiance[2]; /* two to go back and forth between */
    es_planes specular, filtered_specular[2];     /* used when something in the frame has a lobe */
    bool has_specular;
    uint32_t filter_passes;    /* that this frame's indirect light went through */
    es_arena arena;            /* of the pass that runs */
    uint32_t* display;         /* 0x00RRGGBB */
    es_srgb_table srgb;
};

es_result es_planes_resize(es_context* context, es_planes* planes, const es_gbuffer* gbuffer);
void es_planes_free(es_context* context, es_planes* planes);
/* The job of the compose pass for the frame as it stands; outputs are for the caller to set. */
es_compose_job es_renderer_compose_job(const es_renderer* renderer);

#endif
