/* Second-order illumination by image-space lights (Cochran and Steele 2007): virtual point lights that nothing stands in the way of, and negative ones that take away
 * about what would not have arrived.
 *
 * Lights (§3.1): points of the Halton sequence on the sphere about a light source, those in its cone, stand where its view shows a surface; each for the same solid angle.
 * At a pixel (§3.2), all of them, V = 1:
 *     I_s = sum of flux / pi · min(cos cos d² / (d² + spread A / 2 pi)², bound),
 * A being the area that a light stands for, which the paper leaves out: without it, each light is a spot on the surface it stands on, and each negative one a hole.
 * Negative lights (§3.3) stand at points of the camera's picture, by the Halton sequence too. Where a surface faces away from lights, what they would send through it,
 *     E = sum of flux / pi · min(cos · -cos / d², bound),
 * goes on behind it: a light of E times the area that the point stands for, in the mean of the lights' directions weighted by what each sends. Their sum
 * I_n is subtracted, but no more than there is.
 *
 * Both are found for one pixel of 2 × 2 (§3.5) and interpolated, but where the surfaces of the four around a pixel differ from its own by a threshold or more:
 *     1 - n · n' + 10 |(p' - p) · n| / depth >= threshold,
 * there for the pixel itself; with 0 so everywhere.
 *
 * What is wrong with it by construction: only what the camera sees takes light away, at places that do not depend on what hides what; light passes through everything
 * else; surfaces reflect it as if they were matt; there is one bounce. */
#ifndef EARTHSHINE_GI_SECOND_ORDER_H
#define EARTHSHINE_GI_SECOND_ORDER_H

#include "gi/light_view.h"
#include "gi/vpl.h"
#include "platform/context.h"

/* Fills `count` records, shared out over the views by emitted power; those that hit nothing are left out: *placed says how many there are. */
es_result es_open_lights_place(es_context* context, const es_light_view* views, uint32_t view_count, uint32_t count, uint32_t seed, es_vpl_record* records, uint32_t* placed);

/* A light without a shadow. */
typedef struct es_open_light {
    float position[3], normal[3];
    float color[3];                /* flux / pi, W/sr */
    float softening;               /* m², added to d²: spread · A / 2 pi, A being what it stands for */
} es_open_light;
es_open_light es_open_light_of(const es_vpl_record* record, float spread);

/* Points of the camera's picture that are tried for each negative light that is wanted. */
enum { ES_NEGATIVE_TRIES = 4 };
typedef struct es_negative_job {
    const es_gbuffer* gbuffer;     /* depth, normal, surface */
    es_pixel_rays rays;
    const es_open_light* lights;
    uint32_t light_count;
    uint32_t count, seed;
    float bound, spread;
} es_negative_job;
/* At most job->count lights; `tries` has room for ES_NEGATIVE_TRIES times as many. */
void es_negative_lights_place(es_context* context, const es_negative_job* job, es_open_light* tries, es_open_light* lights, uint32_t* placed);

typedef struct es_open_job {
    const es_gbuffer* gbuffer;     /* depth, normal, surface */
    es_pixel_rays rays;
    const es_open_light* lights;
    uint32_t light_count;
    float bound;                   /* 1/m² */
    const uint8_t* listed;         /* only pixels whose bit is set, x % 8 of byte x / 8 of rows of (width + 7) / 8; NULL: all, others become 0 */
    float* irradiance[3];          /* rows of gbuffer->stride */
} es_open_job;
void es_open_shade(es_context* context, const es_open_job* job);

typedef struct es_open_upsample_job {
    const es_gbuffer* gbuffer;     /* depth, normal, surface */
    es_pixel_rays rays;
    uint32_t half_width, half_height, half_stride; /* of gi/half_resolution.h */
    float threshold;
    uint32_t plane_count;          /* 3, 6 */
    const float* source[6];
    float* result[6];              /* 0 where nothing is seen */
    uint8_t* listed;               /* the pixels that differ, as above */
} es_open_upsample_job;
void es_open_upsample(es_context* context, const es_open_upsample_job* job);

/* a becomes -min(a, b), both of them planes of a picture. */
void es_open_subtract(es_context* context, const es_gbuffer* gbuffer, float* const a[3], const float* const b[3]);

#endif
