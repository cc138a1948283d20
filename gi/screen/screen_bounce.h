/* One bounce of light between surfaces that are near each other, found in screen space (Ritschel thesis §4.2.2).
 *
 * Around each pixel N others are looked at, as many in each octave of distances up to the radius r: places of a disc of that radius about the pixel's surface,
 * parallel to the picture. What each shows is a patch that sends its direct light L (reflected and, where that is asked for, its own) to the pixel,
 *     E = 1 / N · Σ L cos θ_s cos θ_r A / d²,    A = 2 pi ln(1 / inner) (ρ r)² (d_z / D_z)² / |n · v|:
 * the area that the patch stands for is the reciprocal of the density with which places of its surface are chosen: the disc's (gi/screen/sample_sets.h), times what
 * one unit of the disc is of the surface, d_z and D_z being both surfaces' depths, n the patch's normal and v the ray through it per unit of depth. So the sum
 * is right on average for what the view shows. (The thesis takes the same area for all, controlled by hand.) Where patches are seen at less than 6 degrees the area stays
 * what it is there, and d is no less than (ρ r) d_z / D_z.
 *
 * What other methods send up to a bound of G = cos cos / d² is left to them: L counts by max(0, 1 - bound / G).
 * Senders of every layer count; of further cameras' those that no view before shows. */
#ifndef EARTHSHINE_GI_SCREEN_SCREEN_BOUNCE_H
#define EARTHSHINE_GI_SCREEN_SCREEN_BOUNCE_H

#include "gi/screen/sample_sets.h"
#include "gi/screen/view_stack.h"
#include "platform/context.h"

/* Light that surfaces of a G-buffer send, packed: three mantissas of 8 bits and an exponent, 1e-30 … 1e30. */
typedef struct es_screen_light_job {
    const es_gbuffer* gbuffer;
    const float* direct[3];          /* reflected radiance; NULL: none */
    const float* lamp_irradiance[3]; /* irradiance of the diffuse part; NULL: none */
    bool emission;                   /* what glows sends light too */
    uint32_t* light;                 /* rows of gbuffer->stride */
} es_screen_light_job;
void es_screen_light(es_context* context, const es_screen_light_job* job);

/* As es_sample_offset, of one view: steps along columns and rows, per depth (orthographic: as they are); and the square of the distance from the disc's middle, m². */
typedef struct es_bounce_sample { float step[2][ES_SCREEN_MAX_SETS + 8], distance2[ES_SCREEN_MAX_SETS + 8]; } es_bounce_sample;

typedef struct es_screen_bounce_job {
    const es_view_stack* stack;      /* with light; the pixels of its first view, first layer */
    uint32_t sets, samples;
    float radius;                    /* metres, more than 0 */
    float geometry_bound;            /* 1/m²; 0: everything counts */
    const es_bounce_sample* table[ES_SCREEN_MAX_VIEWS];
    float* irradiance[3];            /* W/m², rows of the layer's stride; 0 where nothing is seen */
} es_screen_bounce_job;

es_result es_screen_bounce_prepare(es_arena* arena, es_screen_bounce_job* job);
void es_screen_bounce(es_context* context, const es_screen_bounce_job* job);

/* What the diffuse part of the G-buffer's surfaces reflects of an irradiance. */
typedef struct es_screen_reflect_job {
    const es_gbuffer* gbuffer;
    const float* irradiance[3];
    float* radiance[3];              /* may be the same */
} es_screen_reflect_job;
void es_screen_reflect(es_context* context, const es_screen_reflect_job* job);

#endif
