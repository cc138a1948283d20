/* What a light sees: its shadow map and its G-buffer (reflective shadow map, Knecht §4.3), one face for spot and directional
 * lights, six for point lights and for spots too wide for one. */
#ifndef EARTHSHINE_GI_LIGHT_VIEW_H
#define EARTHSHINE_GI_LIGHT_VIEW_H

#include "gi/gi.h"
#include "gi/pixel_rays.h"

/* A spot whose half angle is beyond this is drawn as a cube: 2·70° still maps to a square without wasting most of it. */
#define ES_SPOT_VIEW_MAX_ANGLE 1.2217305f /* 70° */

typedef enum es_light_drawing { ES_LIGHT_SHADOW, ES_LIGHT_GBUFFER, ES_LIGHT_DRAWINGS } es_light_drawing;

typedef struct es_light_face {
    es_raster_view shadow_view;    /* shadow_size² */
    es_mat4 world_to_clip;         /* projection * view of the shadow view */
    float* shadow_depth;           /* reversed depth, shadow_size rows of shadow_size */
    es_raster_view gbuffer_view;   /* light_size² */
    es_pixel_rays gbuffer_rays;
    es_gbuffer gbuffer;            /* depth, normal, albedo, surface; with `ids` instance and triangle */
    struct { uint64_t pose, content; bool has_content; } drawn[ES_LIGHT_DRAWINGS]; /* what they show; pose 0: nothing yet */
} es_light_face;

typedef struct es_light_view {
    es_light_state light;
    uint32_t face_count;
    float near_plane;
    float texel_slope;             /* shadow texel's width per metre of distance; orthographic: its width in metres */
    bool orthographic;
    es_light_face faces[6];
    float power;                   /* emitted, luminance-weighted, W; the share of virtual point lights follows it */
} es_light_view;

typedef struct es_light_view_sizes { uint32_t shadow_size, light_size; bool gbuffers, ids; } es_light_view_sizes;

/* Sets type, matrices and buffers for one light of a world with the given bounds; buffers are reallocated when sizes or the
 * number of faces change. */
es_result es_light_view_prepare(es_context* context, es_light_view* view, const es_light_state* light, es_light_view_sizes sizes, es_vec3 bounds_min, es_vec3 bounds_max);
/* Draws the shadow map or the G-buffer of each face; with `keep`, where a face that stays in its place would not come out as it did: something in it
 * moved, or `materials`, the revision of the list's, is another. Adds the triangles of the faces drawn, and their number. */
typedef struct es_light_drawn { uint64_t triangles; uint32_t faces; } es_light_drawn;
es_result es_light_view_draw(es_rasterizer* rasterizer, const es_draw_list* list, uint64_t materials, bool keep, es_light_view* view, es_light_drawing what, es_light_drawn* drawn);
void es_light_view_free(es_context* context, es_light_view* view);

/* Radiant intensity (W/sr) or irradiance (W/m², directional) factor of the light towards a point: 0 outside a cone; glTF's
 * smooth edge and range window included, 1 on the axis. */
float es_light_falloff(const es_light_state* light, es_vec3 towards_point, float distance);
/* The cone's part of it, 1 for other lights than spots. */
float es_light_cone(const es_light_state* light, es_vec3 towards_point);

#endif
