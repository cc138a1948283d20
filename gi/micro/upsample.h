/* Light from every second or fourth pixel in each dimension to all of them (Ritschel thesis §6.2.4), after Sloan et al. 2007.
 *
 * A pixel takes from the four gathered ones around it, each with its bilinear weight times how much its surface is like the pixel's:
 *     depth      (1 - t²)², t the distance of the other from the pixel's tangent plane over ES_MICRO_PLANE widths of the spacing there: a plane is itself at
 *                any angle, and has no bands where it is seen along
 *     normal     1 while 1 - n n' is below half of a limit, falling to 0 at it: ES_MICRO_TURN for diffuse light; for lobes alpha² / 2 (Phong: alpha² = 2 / (e + 2)),
 *                which is a turn by alpha, and ES_MICRO_LOBE_TURN at least
 *     material   diffuse: 1 - 4 |F90 - F90'|, for what the interface lets through; lobes: of one model, 1 - 4 |alpha - alpha'| / max(alpha, alpha')
 * and one that has no light of the kind counts nothing. Where the weights come to less than ES_MICRO_WEIGHT, of lobes
 * ES_MICRO_LOBE_WEIGHT, the pixel is listed, and is to be gathered at: a mirrored picture beyond its edge is worth less than irradiance.
 * What a lobe reflects is taken in relation to its reflectance R = F0 + (F90 - F0) (1 - NV)^5, Phong: F0, so that patterns of a metal stay sharp.
 *
 * A pixel that was gathered at keeps what was gathered, to the bit. */
#ifndef EARTHSHINE_GI_MICRO_UPSAMPLE_H
#define EARTHSHINE_GI_MICRO_UPSAMPLE_H

#include "gi/micro/micro.h"
#include "gi/pixel_rays.h"
#include "platform/context.h"

#define ES_MICRO_PLANE 1.0f
#define ES_MICRO_TURN 0.2f
#define ES_MICRO_LOBE_TURN 5e-4f
#define ES_MICRO_WEIGHT 0.25f
#define ES_MICRO_LOBE_WEIGHT 0.5f

typedef struct es_micro_upsample_job {
    const es_gbuffer* gbuffer;     /* depth, both normals, albedo, surface */
    es_pixel_rays rays;
    uint32_t kind;                 /* es_gather_kind */
    uint32_t spacing;              /* 2, 4 */
    uint32_t sparse_width, sparse_height, sparse_stride;
    const float* source[3];        /* of the smaller image (gi/micro/pixels.h) */
    /* out, rows of gbuffer->stride; 0 where there is no light of the kind and where it is to be gathered */
    float* result[3];
    uint8_t* lit;                  /* where these may be lit (gi/lit.h), what is listed included; NULL: not kept */
    uint8_t* listed;               /* bits, as es_micro_pixels has them */
} es_micro_upsample_job;

void es_micro_upsample(es_context* context, const es_micro_upsample_job* job);

#endif
