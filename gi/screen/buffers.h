/* What the screen-space methods keep of a frame. */
#ifndef EARTHSHINE_GI_SCREEN_BUFFERS_H
#define EARTHSHINE_GI_SCREEN_BUFFERS_H

#include "gi/history.h"
#include "gi/screen/view_stack.h"

/* Views besides the camera's first layer: G-buffers, and the light that each of their surfaces sends. */
typedef struct es_screen_layer {
    es_gbuffer gbuffer;            /* of layers behind the first and of cameras; the camera's first is the renderer's */
    es_planes direct;              /* reflected direct radiance, where it is wanted; likewise */
    uint32_t* light;               /* as gi/screen/screen_bounce.h packs it */
    size_t light_words;
} es_screen_layer;

typedef struct es_screen_buffers {
    es_screen_layer layers[ES_SCREEN_MAX_VIEWS][ES_SCREEN_MAX_LAYERS];
    es_raster_view cameras[ES_SCREEN_MAX_VIEWS];
    float* drawn[ES_SCREEN_MAX_LAYERS - 1]; /* reversed depth of the camera's layers that there are more behind: rows of its stride; NULL: there is one layer */
    size_t drawn_floats;
    es_view_stack stack;           /* of this frame */
    es_planes share, filtered_share; /* of the environment's light that arrives, each channel; ambient: the first alone */
    bool directional;              /* they hold three */
    es_planes arriving, reflected; /* light of lamps with it: irradiance, radiance of lobes */
    bool has_specular;
    es_planes irradiance, bounce;  /* that neighbours send: as it is found, filtered; the latter is reflected */
} es_screen_buffers;

#endif
