/* What interpolation needs (gi/edit/edit.h) of a world's edits (es_world_edits): regions with the constraints that lie in them. */
#ifndef EARTHSHINE_GI_EDIT_FIELD_H
#define EARTHSHINE_GI_EDIT_FIELD_H

#include "gi/edit/edit.h"
#include "sim/sim.h"

typedef struct es_edit_field {
    const es_edit_region* regions; /* those with a constraint inside, in the world's order; they belong to the arena, distances to the world */
    uint32_t region_count;
} es_edit_field;

/* Where light that comes from the constraint's eye to its red handle would have gone by the law: unit; false: nowhere, and it is left out. */
typedef bool (*es_edit_original)(const void* user, const es_resolved_constraint* constraint, es_vec3* direction);

/* Of the reflecting constraints, or of the refracting ones. original NULL: reflected at the handle's normal (eq. 7.1). */
es_result es_edit_field_make(es_context* context, es_arena* arena, const es_edit_list* edits, const es_draw_list* list, bool refraction, es_edit_original original, const void* user, es_edit_field* field);

#endif
