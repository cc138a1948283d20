/* Anti-aliasing over frames and over pictures of one frame.
 *
 * Pixels are sampled at places of a fixed sequence: place 0 is the centre, place i the point i of the Halton sequence in bases 2 and 3, both
 * shifted so that point 0 is the centre. All of a picture's pixels take the same place, by moving the projection.
 *
 * TEMPORAL: the new picture is blended with last frame's, looked up where the pixel was (its centre's motion: the previous projection is
 * moved as well, so that what stands still has none) between four pixels, and brought into the range of the
 * new picture's 3 × 3 neighbours, so that what is new or newly lit leaves no trail (Karis 2014, "High-Quality Temporal Supersampling"). Moving
 * metal, whose reflections do not move with it, takes a larger share of the new picture.
 * While nothing changes, frame n of them weighs 1 / (1 / blend + n), and from the ES_ANTIALIAS_STILL-th on history is not clamped: the picture
 * becomes the mean over all places, and settles with the rest of the frame (gi/history.h).
 * SUPERSAMPLE: the mean over pictures at places 0 … samples - 1.
 *
 * Radiance is blended as what a display shows of it, c / (1 + luminance), so that an edge of a bright surface is as smooth as any.
 */
#ifndef EARTHSHINE_GI_ANTIALIAS_H
#define EARTHSHINE_GI_ANTIALIAS_H

#include "gi/compose.h"
#include "gi/gi.h"
#include "platform/context.h"

enum { ES_ANTIALIAS_STILL = 8 };

/* Place `index` inside a pixel, from its centre, in [-1/2, 1/2): x to the right, y down. */
void es_antialias_place(uint32_t index, float place[2]);
/* Moves the projections, this frame's and last frame's, so that pixels are sampled at the place. */
void es_antialias_jitter(es_raster_view* view, const float place[2]);

typedef struct es_antialias_job {
    const es_gbuffer* gbuffer;     /* motion and surface where `moving` */
    bool moving;
    bool clamp;
    float blend;                   /* share of the new picture: 1 where there is no history */
    float exposure_scale;          /* of the luminance above */
    const float* source[3];        /* the new picture, rows of the G-buffer's stride */
    const es_compose_job* compose; /* writes it, as its radiance; NULL: it is there */
    const float* history[3];       /* NULL: none */
    float* result[3];              /* none of the others unless there is no history */
} es_antialias_job;

void es_antialias_resolve(es_context* context, const es_antialias_job* job);

#endif
