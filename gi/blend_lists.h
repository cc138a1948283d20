/* A world's draw list taken apart by how its blended materials (es_material_desc.blend) are met. While nothing blends, all lists but the layers' are the world's own, and
 * nothing is copied. */
#ifndef EARTHSHINE_GI_BLEND_LISTS_H
#define EARTHSHINE_GI_BLEND_LISTS_H

#include "platform/context.h"
#include "raster/raster.h"

/* Of a blended surface, less than half a step of 8 bits is nothing to see, and less than that from 1 nothing to see through: there it is left out, and drawn as a
 * solid one, so that neither takes a layer from what is behind. */
#define ES_BLEND_LEAST (1.0f / 512.0f)
#define ES_BLEND_MOST (511.0f / 512.0f)

typedef struct es_blend_lists {
    es_draw_list light;    /* what light meets: as masked; what nowhere reaches alpha_cutoff is left out */
    es_draw_list solid;    /* what the camera sees apart from layers: blended surfaces where alpha is ES_BLEND_MOST or more; with layers 0 `light` */
    es_draw_list layers;   /* blended surfaces where alpha is ES_BLEND_LEAST or more; none with layers 0 */
    /* copies, where something blends */
    es_raster_instance* instances;
    es_material_desc* materials;
    size_t instance_capacity, material_capacity;
} es_blend_lists;

/* Good until `world` changes or the next call. */
es_result es_blend_lists_make(es_context* context, es_blend_lists* lists, const es_draw_list* world, bool layers);
void es_blend_lists_free(es_context* context, es_blend_lists* lists);

#endif
