/* Imperfect shadow maps (Ritschel thesis §5.2): for each virtual point light a parabolic map of the hemisphere about its normal,
 * drawn from a subset of the scene's points and filled by pull-push. The format is raster/points.h's. */
#ifndef EARTHSHINE_GI_ISM_H
#define EARTHSHINE_GI_ISM_H

#include "gi/scene_points.h"
#include "gi/vpl.h"

/* What is kept between frames, so that only what moved is drawn again. A map whose light stays where it is has a layer: its points of the
 * objects that have been still, before holes are filled. Points of the others are drawn over a copy of it; the nearest wins whatever the
 * order, so the bits are those of a map drawn from nothing. Where nothing moved at all the map itself stands. */
typedef struct es_kept_map {
    float pose[12];            /* of the light: position, normal, tangent, bitangent */
    bool parallel;
    uint64_t drawn;            /* es_scene_points.time when the map was; 0: it does not stand */
    bool layered;              /* its layer stands */
    uint32_t splats;           /* points drawn by the last build */
} es_kept_map;

typedef struct es_ism_kept {
    uint64_t key;              /* hash of what all maps depend on besides lights and positions; 0: nothing stands */
    es_kept_map* maps;
    size_t map_capacity;
    uint16_t* layers;          /* of the first layer_count maps */
    size_t layer_capacity;     /* texels */
    uint32_t layer_count;
    uint8_t* still;            /* per es_scene_points.sources: its points are in the layers */
    size_t source_capacity;
    uint64_t time;             /* es_scene_points.time of the last build */
    uint64_t splats;           /* points drawn by the last build, whether of all maps or of the last */
    uint32_t stood;            /* maps that it left as they were */
} es_ism_kept;

/* Square maps one after another, map v at texels + v · size². Accurate ("classic") maps use the same store. */
typedef struct es_ism_maps {
    uint16_t* texels;
    uint32_t size, count;
    float far_distance;        /* metres; what the largest depth stands for */
    size_t capacity;           /* texels allocated */
    es_ism_kept kept;
} es_ism_maps;

typedef struct es_ism_job {
    const es_vpl_record* vpls;
    uint32_t vpl_count;
    uint32_t first;                 /* maps [first, vpl_count) are drawn; those before stand, drawn by a job like it from the same points */
    uint32_t room;                  /* maps that there will be in all; a job with `first` 0 reserves them */
    const es_scene_points* points;  /* map v is drawn from subset v mod subset_count */
    uint32_t size;                  /* a multiple of 32 with pull-push, else 4 … 1024 */
    float far_distance;             /* the scene's extent: no two points are farther apart */
    float near_distance;            /* points closer to a light than this are part of its own surface */
    bool pull_push;
    float pull_threshold, push_threshold; /* shares of far_distance */
    uint32_t pull_push_levels;      /* 1 … 4 */
    bool keep;                      /* use what stands of the last build; otherwise everything is drawn, to the same bits */
    size_t kept_bytes;              /* most that layers take */
} es_ism_job;

/* Makes room for `count` maps of size² (contents undefined) without giving memory back; sets size, count and far_distance. Nothing of the last
 * build stands after it. */
es_result es_ism_maps_reserve(es_context* context, es_ism_maps* maps, uint32_t size, uint32_t count, float far_distance);
/* Draws the maps of a frame, or the last of them. Without points every map is empty, so nothing is shadowed. */
es_result es_ism_maps_build(es_context* context, es_ism_maps* maps, const es_ism_job* job);
void es_ism_maps_free(es_context* context, es_ism_maps* maps);

#endif
