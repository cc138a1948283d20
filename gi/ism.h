/* Imperfect shadow maps (Ritschel thesis §5.2): for each virtual point light a parabolic map of the hemisphere about its normal,
 * drawn from a subset of the scene's points and filled by pull-push. The format is raster/points.h's. */
#ifndef EARTHSHINE_GI_ISM_H
#define EARTHSHINE_GI_ISM_H

#include "gi/scene_points.h"
#include "gi/vpl.h"

/* Square maps one after another, map v at texels + v · size². Accurate ("classic") maps use the same store. */
typedef struct es_ism_maps {
    uint16_t* texels;
    uint32_t size, count;
    float far_distance;        /* metres; what the largest depth stands for */
    size_t capacity;           /* texels allocated */
} es_ism_maps;

typedef struct es_ism_job {
    const es_vpl_record* vpls;
    uint32_t vpl_count;
    const es_scene_points* points;  /* map v is drawn from subset v mod subset_count */
    uint32_t size;                  /* a multiple of 32 with pull-push, else 4 … 1024 */
    float far_distance;             /* the scene's extent: no two points are farther apart */
    float near_distance;            /* points closer to a light than this are part of its own surface */
    bool pull_push;
    float pull_threshold, push_threshold; /* shares of far_distance */
    uint32_t pull_push_levels;      /* 1 … 4 */
} es_ism_job;

/* Makes room for `count` maps of size² (contents undefined) without giving memory back; sets size, count and far_distance. */
es_result es_ism_maps_reserve(es_context* context, es_ism_maps* maps, uint32_t size, uint32_t count, float far_distance);
/* Draws all maps of a frame. Without points every map is empty, so nothing is shadowed. */
es_result es_ism_maps_build(es_context* context, es_ism_maps* maps, const es_ism_job* job);
void es_ism_maps_free(es_context* context, es_ism_maps* maps);

#endif
