/* What a renderer keeps from its last frame, and whether this one goes on from it.
 *
 * A frame goes on from the last when that one was rendered to its end, of the same world through the same camera with the same settings, but for
 * those of the display, and the world has been stepped once since, or not at all and nothing but the camera was moved. Restoring a world, a second step,
 * another world, camera or size, or a changed setting begin a new history. A world that stands still while frames go on is to be stepped by 0
 * seconds: only then do the poses of last frame come up to those of this one.
 *
 * A frame is still when it goes on and nothing it is made from differs. After es_renderer_settings.temporal_settle still frames the picture is
 * settled: it is made from this frame alone, whether work is skipped or not, and all of its passes can be. */
#ifndef EARTHSHINE_GI_HISTORY_H
#define EARTHSHINE_GI_HISTORY_H

#include "gi/antialias.h"
#include "gi/gi.h"
#include "gi/temporal.h"

/* Three planes of floats, rows of the G-buffer's stride; `lit` (gi/lit.h) is kept for planes of specular radiance alone. */
typedef struct es_planes { float* at[3]; uint8_t* lit; void* memory; size_t bytes; } es_planes;

typedef struct es_history {
    bool complete;             /* the last frame was rendered to its end, with history */
    es_raster_view view;       /* of the last frame, not jittered */
    double origin[3];          /* that it is relative to */
    es_world_revisions revisions;
    uint32_t camera;
    uint64_t settings;         /* hash of those that a history is made with */
    es_light_state* lights;    /* of the last frame, relative to its origin */
    size_t light_count, light_capacity;
    float alert;               /* 0 … 1: how suddenly the lights changed of late */
    uint64_t content;          /* hash of all that the last frame was made from */

    /* of this frame, once es_history_begin has been called */
    bool wanted;               /* something uses history */
    bool continuous, moving;   /* it goes on from the last; something moved since */
    uint32_t still;            /* frames since the last change, 0 in one that differs */
    bool settled, resting;     /* it is made from this frame alone; the one before was so too */

    es_gbuffer gbuffer, half;  /* last frame's, where it was drawn anew this frame; otherwise the renderer's own are */
    es_planes irradiance[2], specular[2];
    uint32_t current;          /* which of them is the last result */
    uint32_t planes;           /* that it has: 0, 3, 6 */
    es_planes fresh, picture[2]; /* radiance of this picture alone, and of what anti-aliasing made of it and those before */
    uint32_t current_picture;
    bool has_picture;
    uint32_t place;            /* inside of pixels, of this picture */
    es_temporal_job job;       /* of the last result, for the image of its confidence; gbuffer NULL: none */
} es_history;

#endif
