/* Direct light of the surroundings with occlusion per direction, found in screen space (Ritschel thesis §4.2.1).
 *
 * Of N directions ω_i of a pixel's hemisphere, uniform by solid angle, the irradiance is
 *     E = 2 pi / N · Σ L(ω_i) V(ω_i) cos θ_i,
 * V being 0 where the point P + λ_i ω_i is below a surface that a view shows. As directions are the same for all pixels of a pattern (gi/screen/sample_sets.h),
 * so is L, looked up once a frame for each. What is kept of each pixel is the share of the light that arrives,
 *     S = Σ L(ω_i) V(ω_i) cos θ_i / Σ L(ω_i) cos θ_i   for each channel,
 * which the geometry-aware filter smooths; times the irradiance of the unoccluded hemisphere it is E, without N's error where nothing occludes.
 * The classic method, ambient occlusion, is the same with L = 1. */
#ifndef EARTHSHINE_GI_SCREEN_DIRECTIONAL_OCCLUSION_H
#define EARTHSHINE_GI_SCREEN_DIRECTIONAL_OCCLUSION_H

#include "gi/environment.h"
#include "gi/micro/lobe_albedo.h"
#include "gi/screen/sample_sets.h"
#include "gi/screen/view_stack.h"
#include "platform/context.h"

/* Rows of constants of a pattern's pixels, by column modulo `sets` and on, so that eight from any column can be loaded. */
enum { ES_SCREEN_COLUMNS = ES_SCREEN_MAX_SETS + 8 };
/* Sample i of row y of the patterns is record y · samples + i. */
typedef struct es_occlusion_sample {
    float direction[3][ES_SCREEN_COLUMNS];
    float light[2][3][ES_SCREEN_COLUMNS]; /* from the direction, and from its opposite: of the brightest, 1e-10 … 1 or 0 */
} es_occlusion_sample;
typedef struct es_sample_offset { float window[3][ES_SCREEN_COLUMNS]; } es_sample_offset; /* λω times the radius, by a view's to_x, to_y, to_depth */

typedef struct es_occlusion_job {
    const es_view_stack* stack;      /* the pixels of its first view, first layer: depth and both normals */
    uint32_t sets, samples;
    float radius;                    /* metres, more than 0 */
    bool directional;                /* otherwise ambient */
    const es_occlusion_sample* table;
    const es_sample_offset* offsets[ES_SCREEN_MAX_VIEWS];
    float* share[3];                 /* 0 … 1, rows of the layer's stride; ambient: the first alone; 1 where nothing is seen */
} es_occlusion_job;

/* Fills table and offsets in the arena. With an environment its light, as a share of the brightest direction's; NULL: ambient occlusion. */
es_result es_occlusion_prepare(es_arena* arena, const es_environment_lookup* environment, es_occlusion_job* job);
void es_occlusion(es_context* context, const es_occlusion_job* job);

/* The light that arrives: irradiance of the unoccluded surface, radiance of the lobe's directions times its directional albedo, each times the share, and other light. */
typedef struct es_arriving_job {
    const es_gbuffer* gbuffer;
    es_pixel_rays rays;
    const es_environment_lookup* environment;
    const es_lobe_albedo* lobes;
    const float* share[3];                  /* of each channel; may be the same */
    const float *irradiance[3], *specular[3]; /* other light, as what is written; NULL: none */
    float* arriving[3];                     /* irradiance that passes to the diffuse part, W/m², rows of the G-buffer's stride */
    float* reflected[3];                    /* radiance of the lobes; NULL: not wanted */
    uint8_t* lit;                           /* where that may be lit (gi/lit.h), all of it written; with reflected */
} es_arriving_job;
void es_arriving_light(es_context* context, const es_arriving_job* job);

#endif
