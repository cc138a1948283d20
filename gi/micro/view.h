/* A micro-buffer to look at: as it is, or laid out over the hemisphere it sees. */
#ifndef EARTHSHINE_GI_MICRO_VIEW_H
#define EARTHSHINE_GI_MICRO_VIEW_H

#include "gi/micro/micro.h"

enum { ES_MICRO_VIEW_SIZE = 128 }; /* pixels a side of the picture over the hemisphere */

/* Of size² pixels: radiance (three channels) and distance (one; 0: nothing is there), either may be NULL. As it is: a pixel for a pixel. Over the hemisphere: a disc, the normal in its
 * middle, directions at right angles to it along its rim, the angle between growing evenly towards it; `right` (not along the normal) points to the right.
 * Each of its pixels shows the buffer's pixel whose middle is nearest in direction; far from all of them, as beside a narrow lobe, it is black. The caller
 * destroys the images. */
es_result es_micro_view(es_context* context, const es_micro_pixel* pixels, uint32_t size, const float normal[3], const float right[3], bool over_hemisphere, es_image* radiance, es_image* distance);

#endif
