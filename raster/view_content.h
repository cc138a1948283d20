/* What a view shows, as a number: drawing is skipped while it stays. */
#ifndef EARTHSHINE_RASTER_VIEW_CONTENT_H
#define EARTHSHINE_RASTER_VIEW_CONTENT_H

#include "raster/raster.h"

/* Of a view's pose, sizes and culling, without what it was a frame before. */
uint64_t es_view_pose_hash(const es_raster_view* view);

/* Of all that drawing depends on but the pose and the materials' contents: the instances that es_draw_gbuffer and es_draw_depth would not cull,
 * in their order. It costs what culling them does. */
uint64_t es_view_content_hash(const es_draw_list* list, const es_raster_view* view);

#endif
