/* Final gathering by micro-rendering (Ritschel thesis §6.2.2): the light that arrives at a point, or is reflected there by a lobe, from a picture of a few
 * pixels a side whose every pixel is worth the same. */
#ifndef EARTHSHINE_GI_MICRO_MICRO_H
#define EARTHSHINE_GI_MICRO_MICRO_H

#include "gi/micro/forest.h"

enum { ES_MICRO_MIN_SIZE = 8, ES_MICRO_MAX_SIZE = 32 };

typedef enum es_gather_kind {
    ES_GATHER_DIFFUSE,     /* irradiance, what the interface does not let through left out (`pass` of gi/surface.h), W/m²: times albedo over pi it is what the diffuse part sends */
    ES_GATHER_LOBE         /* radiance that the surface's lobe reflects towards the eye */
} es_gather_kind;

/* Where light is gathered. Of structures, so that they may be sorted. */
typedef struct es_gather_point {
    float position[3];     /* world */
    float normal[3];       /* unit */
    float view[3];         /* unit, to the eye; where the kind or the surface does not need it anything finite */
    float f0[3];           /* es_surface.specular */
    float roughness;       /* es_surface.roughness */
    uint32_t model;        /* es_surface_model */
    uint32_t kind;         /* es_gather_kind */
    uint32_t seed;         /* of the frame's turn: any number, which should differ between neighbours */
} es_gather_point;

typedef struct es_micro_settings {
    uint32_t size;         /* of the micro-buffers, pixels a side, 8 … 32, a multiple of 4 */
    float cut;             /* a node is drawn, not opened, when its sphere's solid angle is at most this share of pi / size², or of a lobe's pixel there */
    float cover;           /* a node is drawn into the pixel whose ray is nearest to its centre, where a disc of so many times its area covers that ray, or, of lobes, is within a
                            * twentieth of a radian of it. Gaps are closed */
    float share;           /* what is further than this many radii of a cell of points is seen from the cell's middle, and looked up there; less than 1 is as 1; 0: each point sees for itself */
    bool ray_cast;         /* leaves larger than that are met by rays; off: they are drawn as others are, and leave holes */
    bool warp;             /* pixels are distributed as the lobe is; off: as the cosine, and weighted */
    bool quantised;        /* nodes of 128 bits; off: floats */
} es_micro_settings;

typedef struct es_micro_stats { uint64_t samples, drawn, cast; } es_micro_stats; /* pixels of micro-buffers; nodes of the cuts times points, and of what is shared once; leaves met by rays times points, where they are not shared */

/* What one pixel of a micro-buffer holds. */
typedef struct es_micro_pixel {
    uint32_t node;         /* place in the forest's nodes; UINT32_MAX: nothing is there */
    float distance;        /* metres, to 1/2048 of itself; 0 where nothing is */
    float radiance[3];     /* W/(m² sr) */
    float direction[3];    /* world, unit: of its middle, also where nothing is */
} es_micro_pixel;

/* The micro-buffer of one point, settings->size² pixels in rows. */
es_result es_micro_look(es_context* context, const es_point_forest* forest, const es_micro_settings* settings, const es_gather_point* point, es_micro_pixel* pixels);

/* result[k][i] of point i. Points are gathered in cells along a space-filling curve, in parallel. Those of a cell share what they see far away (settings->share),
 * and cuts, which are as fine as any of them wants, or coarser where one point alone would draw more than 65528 nodes: what a point gets depends a little on its
 * neighbours, but not on threads or instruction sets. stats may be NULL. */
es_result es_micro_gather(es_context* context, const es_point_forest* forest, const es_micro_settings* settings, const es_gather_point* points, size_t count, float* const result[3], es_micro_stats* stats);

#endif
