/* Pixels as gather points: every pixel of a G-buffer, every second or fourth in each dimension, or those of a list of bits.
 *
 * Pixel (X, Y) of the smaller image is pixel (spacing X, spacing Y) of the whole one. A pixel is gathered at for its diffuse part where that reflects
 * anything, and for its lobe where es_surface_has_lobe says so; unlit surfaces and the sky are not. What is gathered at a pixel depends on
 * nothing but that pixel, the kind and the seed. */
#ifndef EARTHSHINE_GI_MICRO_PIXELS_H
#define EARTHSHINE_GI_MICRO_PIXELS_H

#include "gi/micro/micro.h"
#include "gi/pixel_rays.h"
#include "platform/context.h"

typedef struct es_micro_pixels {
    const es_gbuffer* gbuffer;     /* depth, normal, albedo, surface */
    es_pixel_rays rays;            /* of the whole image */
    uint32_t kind;                 /* es_gather_kind */
    uint32_t spacing;              /* 1, 2, 4 */
    const uint8_t* listed;         /* with spacing 1: only pixels whose bit is set, x % 8 of byte x / 8 of rows of es_micro_list_stride(); NULL: all */
    uint32_t seed;
    const float* edited[3];        /* where lobes reflect, rows of gbuffer->stride, (0, 0, 0) where they do as the law says (gi/edit/edit.h): their micro-buffers are drawn
                                    * in a frame turned by as much (Ritschel thesis §9.2); NULL: everywhere */
    /* out: planes of the smaller image; 0 where nothing is gathered, and without `listed` all of them are written */
    float* result[3];
    uint32_t stride;
    uint8_t* lit;                  /* where these may be lit (gi/lit.h); NULL: not kept; with spacing 1 */
} es_micro_pixels;

static inline uint32_t es_micro_sparse(uint32_t pixels, uint32_t spacing) { return (pixels + spacing - 1) / spacing; }
static inline uint32_t es_micro_list_stride(uint32_t width) { return (width + 7) / 8; }

/* What pixel (x, y) of the smaller image is as a gather point; false when it is none. */
bool es_micro_pixel_point(const es_micro_pixels* pixels, uint32_t x, uint32_t y, es_gather_point* point);

/* *stats and *gathered (points) are added to. */
es_result es_micro_gather_pixels(es_context* context, es_arena* arena, const es_point_forest* forest, const es_micro_settings* settings, const es_micro_pixels* pixels, es_micro_stats* stats, uint64_t* gathered);

#endif
