/* From the lights' G-buffers to a set of virtual point lights (Knecht §3.3, §4.3, §4.4). */
#ifndef EARTHSHINE_GI_VPL_SAMPLING_H
#define EARTHSHINE_GI_VPL_SAMPLING_H

#include "gi/light_view.h"
#include "gi/surface.h"
#include "gi/view_importance.h"
#include "gi/vpl.h"

/* Sums of importance over a square of texels, one pyramid per face: level 0 is the finest, each coarser cell the sum of four. */
typedef struct es_importance {
    uint32_t size, level_count, face_count;
    size_t level_offset[16];
    size_t face_floats;
    float* sums;          /* face_count × face_floats */
} es_importance;

/* Eq. 4.3 of every texel of the light's G-buffer; with receivers, times what the camera's picture makes of it. */
es_result es_importance_build(es_context* context, es_importance* importance, const es_light_view* view, const es_receivers* receivers);
void es_importance_free(es_context* context, es_importance* importance);

/* Hierarchical warping (Clarberg et al. 2005, as Knecht §3.3 uses it) of a point of the unit square: the texel it falls on and
 * the probability of that texel. False when all importance is zero. */
bool es_importance_warp(const es_importance* importance, float u, float v, uint32_t* face, uint32_t* x, uint32_t* y, float* probability);

/* Eq. 4.3 of a texel whose es_light_texel_share is `share`; its sum over a light's texels. */
float es_importance_of(const es_light_view* view, const es_surface* surface, float share);
float es_importance_total(const es_importance* importance);

/* Texel coordinates (centres are whole numbers) and depth of a point; false when it lies outside the face. */
bool es_light_texel_of(const es_light_view* view, const es_light_face* face, es_vec3 position, float* x, float* y, float* depth);
/* Power that a texel there receives per unit of the light's intensity: solid angle (sr) or area (m², orthographic) times the falloff; and the
 * surface that it covers, m². */
float es_light_texel_share(const es_light_view* view, const es_light_face* face, float x, float y, float depth);
float es_light_texel_area(const es_light_view* view, const es_light_face* face, float x, float y, float depth, es_vec3 normal);

/* A light at a place; share and area: of its texel, over its probability times the number of lights. */
typedef struct es_vpl_place { es_vec3 position, normal, incident; float share, area; } es_vpl_place;
void es_vpl_make(const es_light_view* view, const es_vpl_place* place, const es_surface* surface, bool glossy, es_vpl_record* record);

/* How many of `count` lights each view gets: by emitted power, none where its importance is zero. */
void es_vpl_shares(const es_light_view* views, uint32_t view_count, const es_importance* importances, uint32_t count, uint32_t* shares);

/* es_vpl_record.area of a light at that place of a surface, if it were one of `share` of this view; infinite where there can be none. */
float es_vpl_area_at(const es_light_view* view, const es_importance* importance, uint32_t share, es_vec3 position, es_vec3 normal);

typedef struct es_vpl_request {
    uint32_t count;       /* over all lights, shared out by emitted power */
    uint32_t seed;        /* offset into the Halton sequence */
    uint32_t subsets;     /* n² of the interleaved pattern: record v belongs to subset v % subsets */
    bool glossy;
} es_vpl_request;

/* Fills at most request->count records; *count says how many. Consecutive Halton points share a subset (each run of them covers
 * the light's view evenly), so a subset is itself a good sample set. */
es_result es_vpls_sample(es_context* context, const es_light_view* views, uint32_t view_count, const es_importance* importances, const es_vpl_request* request,
    es_vpl_record* records, uint32_t* count);

#endif
