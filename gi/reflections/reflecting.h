/* Which way pixels of reflecting surfaces look, and what they see there: the two kernels between which directions can be edited. */
#ifndef EARTHSHINE_GI_REFLECTIONS_REFLECTING_H
#define EARTHSHINE_GI_REFLECTIONS_REFLECTING_H

#include "gi/micro/lobe_albedo.h"
#include "gi/pixel_rays.h"
#include "gi/reflections/reflection_map.h"

/* Of the pixels that reflect; the others' are undefined. Rows of the G-buffer's stride. */
typedef struct es_reflecting_planes {
    uint32_t* map;              /* 0: does not reflect; else the map that shows what surrounds the surface, + 1: of every pixel */
    uint8_t* any;               /* per ES_LIT_COLUMNS pixels as in gi/lit.h: bit 0 where one reflects */
    float* direction[3];        /* unit: of the mirrored ray from the eye, or where it leaves the surface, which may be below the horizon of a bent normal */
    float* albedo[3];           /* share of light from there that the lobe sends to the eye: its directional albedo */
    float* alpha;               /* of GGX: how wide the lobe is */
} es_reflecting_planes;

/* Originals. */
typedef struct es_reflecting_job {
    const es_gbuffer* gbuffer;  /* depth, normal, albedo, surface, instance */
    es_pixel_rays rays;
    const uint32_t* map_of;     /* by the G-buffer's instance number (id + 1): 0 or the map + 1 */
    float roughness;            /* surfaces that are rougher do not reflect */
    const es_lobe_albedo* lobes;
    es_reflecting_planes out;
} es_reflecting_job;

void es_reflecting_find(es_context* context, const es_reflecting_job* job);

/* Radiance from the maps. */
typedef struct es_reflected_job {
    const es_gbuffer* gbuffer;  /* depth */
    es_pixel_rays rays;
    es_reflecting_planes planes;
    const float* edited[3];     /* directions to look along instead, unit or (0, 0, 0) where nothing is edited; NULL: none are */
    const es_reflection_atlas* atlas;
    float* out[3];              /* W/(m² sr); 0 where nothing reflects */
    uint8_t* lit;               /* where `out` may be lit (gi/lit.h), in and out */
} es_reflected_job;

void es_reflected_from_maps(es_context* context, const es_reflected_job* job);

#endif
