/* Micro-buffers to look at: es_renderer_micro_buffer (gi/gi.h), and the images of the picture's middle. */
#ifndef EARTHSHINE_GI_MICRO_VIEW_IMAGES_H
#define EARTHSHINE_GI_MICRO_VIEW_IMAGES_H

#include "gi/renderer.h"

/* Of the picture's middle pixel: its lobe's buffer where it has one. One black pixel where nothing is gathered. */
es_result es_micro_image(es_renderer* renderer, bool warped, bool of_distance, es_image* image);

#endif
