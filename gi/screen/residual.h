/* Bias compensation in screen space (Novák, Engelhardt and Dachsbacher 2011): what bounding a pair's geometry term took from the light of virtual
 * point lights, found again among the pixels.
 *
 * With the residual operator T_r, which is transport with max(0, G - b) in place of G,
 *     L = L_e + T L_e + T_b L^ + T_r (L - L_e)                                                      §3.2
 * is iterated: step 1 applies T_r to direct and bounded indirect light, step k + 1 to what step k brought. T_r is linear, so steps add up to
 * Novák's eq. 3 after as many iterations, and each is an image of its own. With lights of a single bounce, what T_r makes of their bounded light
 * would be of a second one: step 1 is applied to direct light alone then.
 *
 * The integral over surfaces becomes a sum over the pixels' patches (§4.1), none of them tested for visibility,
 *     sum of L A max(0, G' - b),  G' = cos cos / (d² + A / 2 pi)²  ·  d²,
 * G' being G where a patch is small beside its distance, and bounded where it is not: A G' stays below pi. It is found on a pyramid of patches
 * (§4.2): level 0 are the pixels, each coarser node is four of the finer ones, with the sum of their areas and of L A, and mean position
 * and normal by area. From the coarsest level on, a node is opened where the projected solid angle A G' is above `solid_angle`, or above `discontinuity`
 * where the node spans an edge of depth or normal. Patches seen at more than 80 degrees count less, by the square of how much (§4.3).
 *
 * Where pixels are gathered is the caller's to say: all, every second of every second row, or those of a list of bits; each for itself, so that a
 * pixel's light is the same in any of them. */
#ifndef EARTHSHINE_GI_SCREEN_RESIDUAL_H
#define EARTHSHINE_GI_SCREEN_RESIDUAL_H

#include "gi/gi.h"
#include "gi/pixel_rays.h"
#include "platform/context.h"

enum { ES_RESIDUAL_LEVELS = 8, ES_RESIDUAL_LAYERS = 4, ES_RESIDUAL_STEPS = ES_MAX_COMPENSATION_STEPS };

/* A patch: four floats twice. */
typedef struct es_residual_node {
    float position[3], area;       /* metres, m²; area 0: nothing is there */
    float normal[3], radius;       /* mean of unit normals, made unit; metres: no part of it is further from `position`, negative where it spans an edge */
} es_residual_node;

/* Levels 1 … of one image of patches, row by row; level 0 is read from the G-buffer. */
typedef struct es_residual_pyramid {
    uint32_t levels;               /* that there are, level 0 among them */
    uint32_t width[ES_RESIDUAL_LEVELS], height[ES_RESIDUAL_LEVELS];
    es_residual_node* nodes[ES_RESIDUAL_LEVELS]; /* [0] is NULL */
    float* sent[ES_RESIDUAL_LEVELS];             /* L A, four floats a node, the last unused: W/sr */
    void* memory;
    size_t bytes;
} es_residual_pyramid;

/* What sends: an image of surfaces with the light that leaves them. */
typedef struct es_residual_layer {
    const es_gbuffer* gbuffer;     /* depth, normal */
    es_pixel_rays rays;
    const float* radiance[3];      /* rows of gbuffer->stride */
    bool back;                     /* it shows surfaces from behind: what they send goes to the side that normals point to, away from the eye */
    es_residual_pyramid* pyramid;
} es_residual_layer;

typedef struct es_residual_job {
    es_residual_layer layers[ES_RESIDUAL_LAYERS];
    uint32_t layer_count;
    float bound;                   /* b, 1/m², more than 0 */
    float solid_angle, discontinuity; /* sr */
    /* where light is gathered: pixels of the first layer */
    const es_gbuffer* gbuffer;     /* depth, normal; with `specular` also albedo and surface */
    es_pixel_rays rays;
    float lobe_roughness;          /* lobes are at least as wide as GGX of this roughness */
    uint32_t spacing;              /* 1, 2, 4: pixel (X, Y) of the result is (spacing X, spacing Y) */
    const uint8_t* listed;         /* as es_micro_pixels has them, with spacing 1; NULL: all */
    /* out: rows of `stride`; without a list all of them are written, 0 where nothing is seen */
    uint32_t stride;
    float* irradiance[3];          /* W/m² on the diffuse part */
    float* specular[3];            /* radiance that the lobe reflects; NULL: pixels have no lobes */
    uint64_t* samples;             /* per row of the result, of patches looked at, over its pixels */
} es_residual_job;

/* Levels: 1 … ES_RESIDUAL_LEVELS; fewer are made where the image is smaller. Memory is kept while sizes stay. */
es_result es_residual_reserve(es_context* context, es_residual_pyramid* pyramid, uint32_t width, uint32_t height, uint32_t levels);
void es_residual_free(es_context* context, es_residual_pyramid* pyramid);
/* The layer's patches, and what they send. */
void es_residual_build(es_context* context, const es_residual_layer* layer);
void es_residual_gather(es_context* context, const es_residual_job* job);

#endif
