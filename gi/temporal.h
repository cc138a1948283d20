/* Temporal coherence of indirect light (Knecht 2009 §3.5).
 *
 * A pixel at x, which was at x - m last frame (m from the G-buffer's movement planes, §3.5.1), takes the light that was found there then. The
 * four pixels around that place count with their bilinear weights when they show the same surface: their depth lies within
 * depth_threshold of the depth at which the point was to be expected, the camera's own movement allowed for, and their normal within
 * normal_threshold. Where none does, the point was not seen: there is no history, and the confidence is 0. Otherwise
 *
 *     Δpos    = |(m_x / width, m_y / height, (d - d_prev) / extent)| w_position                      eq. 3.1
 *     Δnormal = (1 - n · n_prev) w_normal                                                            eq. 3.2
 *     Δillumination = saturate(|I_new - I_prev|³) w_illumination                                     eq. 3.3
 *     confidence = base · saturate(1 - max(Δpos, Δnormal, Δillumination)) (1 - reset)                eq. 3.4, 3.5; reset as below
 *     I = I_prev confidence + I_new (1 - confidence)                                                 eq. 3.6
 *
 * What a lobe reflects stays where it is while the surface turns under it, so that its history is of another direction: the confidence in planes
 * 3 … 5 falls by (1 - n · n_prev) lobe_turn as well, to nothing where the surface has turned by a lobe's half width.
 *
 * I in eq. 3.3 is what a white surface would show at the frame's exposure: exposure (irradiance / pi + what the lobe reflects), over R, G, B.
 * With `clamp` I_prev is then brought into the range of I_new over 3 × 3 pixels, widened by that share.
 *
 * Reset: where the light itself changed, history would glow on (§5.4). The pixels of every eighth row are samples of last frame's
 * picture that this frame's lights have lit anew; over a tile of ES_TEMPORAL_TILE² pixels the sums of both are compared, as the gradients of
 * adaptive temporal filtering are (Schied, Peters and Dachsbacher 2018), here with the blended history, so that slow drift is noticed
 * too. reset rises from 0 to 1 as the difference goes from reset_low to reset_high of the larger sum; the largest of a tile's and
 * its neighbours' counts, and pixels interpolate between tiles. Virtual point lights that come and go change a tile's light as well, so both
 * thresholds are wide; but how much the lights themselves changed is known, and where it was suddenly they go down to a twentieth and a
 * tenth of that for this frame, and come back over the next.
 */
#ifndef EARTHSHINE_GI_TEMPORAL_H
#define EARTHSHINE_GI_TEMPORAL_H

#include "gi/gi.h"
#include "platform/context.h"

enum { ES_TEMPORAL_TILE = 32, ES_TEMPORAL_SAMPLE = 8 };

typedef struct es_temporal_job {
    const es_gbuffer* gbuffer;        /* depth and normal; motion where `moving` */
    const es_gbuffer* previous;       /* depth and normal of last frame, of the same size */
    bool moving;                      /* off: nothing moved, whatever the planes say */
    float depth_then[2][3];           /* what was at (x, y) and depth d had depth a·(1, x, y) + d b·(1, x, y) last frame: a, b */
    uint32_t plane_count;             /* of irradiance, then of specular radiance: 3 or 6 */
    uint32_t history_count;           /* of these with a history: 0, 3, 6 */
    const float* source[6];           /* this frame's, rows of the G-buffer's stride */
    const float* history[6];          /* last frame's result */
    float* result[6];                 /* neither of them; NULL with `confidence` alone */
    /* where planes 3 … 5 may be lit (gi/lit.h), the result's in and out; NULL: anywhere, and not kept; all three or none */
    const uint8_t *source_lit, *history_lit;
    uint8_t* result_lit;
    float* confidence;                /* NULL: not wanted */
    float base, position, normal, illumination;
    float lobe_turn;                  /* 2 / a², a the narrowest lobe's half width in radians (1 - cos t is t² / 2); 0: lobes are as the rest */
    float extent;                     /* metres */
    float exposure_scale;             /* 2^stops */
    float depth_threshold, normal_threshold;
    float clamp;                      /* 0: not */
    float reset_low, reset_high;
    float* reset;                     /* a tile each, in rows; NULL: tiles are not compared */
    uint32_t tile_columns, tile_rows;
} es_temporal_job;

/* From the views of the two frames: depth_then of a job whose pixels lie `step` pixels of the view apart (2 at half the resolution). */
void es_temporal_depth_then(const es_raster_view* now, const es_raster_view* then, uint32_t step, float depth_then[2][3]);

static inline uint32_t es_temporal_tiles(uint32_t pixels) { return (pixels + ES_TEMPORAL_TILE - 1) / ES_TEMPORAL_TILE; }

/* job->reset is made from `arena` where reset_high is above 0 and there is a history. */
es_result es_temporal_compare(es_context* context, es_arena* arena, es_temporal_job* job);
void es_temporal_blend(es_context* context, const es_temporal_job* job);

#endif
