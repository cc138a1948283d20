/* Layers of blended surfaces peeled from the camera's view, and what lights them (gi/blend_passes.h). */
#ifndef EARTHSHINE_GI_LAYER_LIGHT_H
#define EARTHSHINE_GI_LAYER_LIGHT_H

#include "gi/history.h"
#include "gi/pixel_rays.h"

enum { ES_BLEND_MAX_LAYERS = 4 };

/* What is lit: the picture, or a part of a layer. */
typedef struct es_lit_surfaces {
    const es_gbuffer* gbuffer;
    es_pixel_rays rays;            /* of its pixels */
    bool lobes;                    /* may any of it have a lobe worth evaluating, or a light? */
} es_lit_surfaces;

/* Light that is on its way to a layer: planes that all layers and all kinds of light use in turn. */
typedef struct es_layer_light {
    es_planes irradiance, specular, filtered_irradiance, filtered_specular;
    es_planes sparse_irradiance, sparse_specular; /* of micro-buffers */
    bool filtered;                 /* the filtered planes hold it; … */
    bool filtered_lobes;           /* … of the lobes as well */
    bool lobes;                    /* there are planes of lobes */
} es_layer_light;

/* Columns are multiples of eight, but for the picture's own edge. */
typedef struct es_layer_rectangle { uint32_t column_begin, column_end, row_begin, row_end; } es_layer_rectangle;

typedef struct es_blend_layers {
    es_gbuffer gbuffers[ES_BLEND_MAX_LAYERS]; /* nearest first, of the whole picture */
    es_layer_rectangle rectangle;  /* outside of it nothing is covered by any */
    es_layer_rectangle lit;        /* that planes of light have the size of */
    uint32_t count;                /* that cover anything */
    float* solid_depth;            /* reversed depth of what is behind them, rows of the picture's stride, where screen space keeps none */
    float* drawn[ES_BLEND_MAX_LAYERS - 1];
    size_t depth_floats;
    bool lamp_lobes, lobes;
    es_layer_light light;
    es_planes part;                /* an image of a layer */
    /* premultiplied sums of the layers' images, and what is left of what is behind: within the rectangle */
    es_planes transmittance;       /* its first plane */
    es_planes emitted, direct, lamps, bounded;
} es_blend_layers;

#endif
