/* Views of the scene that points near its surfaces are tested in: the camera's picture, of which further layers may be peeled (Ritschel thesis
 * §4.3.2), and those of additional cameras (§4.3.3).
 *
 * Layers: the first is what the camera sees. With more, odd ones show front faces and even ones back faces, each the nearest behind the layer before:
 * of closed objects an odd layer is where a line of sight enters one and the next where it leaves it, so what lies between them is inside. Where an
 * even layer shows nothing, the object ends nowhere. */
#ifndef EARTHSHINE_GI_SCREEN_VIEW_STACK_H
#define EARTHSHINE_GI_SCREEN_VIEW_STACK_H

#include "gi/pixel_rays.h"

enum { ES_SCREEN_MAX_LAYERS = 4, ES_SCREEN_MAX_CAMERAS = 4, ES_SCREEN_MAX_VIEWS = 1 + ES_SCREEN_MAX_CAMERAS };

typedef struct es_screen_view {
    uint32_t width, height, stride;
    uint32_t layer_count;                          /* 1 … ES_SCREEN_MAX_LAYERS */
    const es_gbuffer* layers[ES_SCREEN_MAX_LAYERS]; /* all of one size and stride; depth, normals; for light also what es_direct_job reads */
    const uint32_t* light[ES_SCREEN_MAX_LAYERS];   /* radiance that each sends (gi/screen/screen_bounce.h), rows of stride; NULL: none */
    es_pixel_rays rays;
    /* of a world point p: depth = to_depth · (p, 1); perspective: to_x · (p, 1) is the column times the depth, orthographic: the column; rows likewise.
     * Whole columns and rows are pixels' centres, from the top left. */
    float to_x[4], to_y[4], to_depth[4];
    float xx, yy;                                  /* squared lengths of what a column and a row move a point by, at depth 1 (orthographic: at any) */
} es_screen_view;

typedef struct es_view_stack {
    es_screen_view views[ES_SCREEN_MAX_VIEWS];     /* the camera's first */
    uint32_t view_count;
} es_view_stack;

/* Pixels are gone through in blocks, so that what they look at around them stays in the second-level cache. */
enum { ES_SCREEN_BLOCK_COLUMNS = 128, ES_SCREEN_BLOCK_ROWS = 32 };
typedef struct es_screen_block { uint32_t x0, x1, y0, y1; } es_screen_block; /* x0: a multiple of eight */
uint32_t es_screen_block_count(uint32_t width, uint32_t height);
es_screen_block es_screen_block_at(uint32_t width, uint32_t height, uint32_t index);

/* A view of one layer. */
es_screen_view es_screen_view_of(const es_raster_view* view, const es_gbuffer* gbuffer);

#endif
