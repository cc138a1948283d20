/* Edits as bytes: in saved states, recordings and undo. */
#ifndef EARTHSHINE_SIM_EDIT_STATE_H
#define EARTHSHINE_SIM_EDIT_STATE_H

#include "sim/edits/edits.h"
#include "sim/state_io.h"

void es_visit_region(state_io* io, es_region_object* region);
void es_visit_constraint(state_io* io, es_constraint_object* constraint);

/* Regions and constraints, and with `values` parameters and frozen reflections before them; of a world without any of these nothing, but without `values` always two
 * counts. Returns the bytes; NULL: only that. */
size_t es_edits_write(const es_world* world, bool values, void* bytes);
/* The hash goes on with them; it stays as it is when there is nothing. */
uint64_t es_edits_hash(const es_world* world, uint64_t hash);

/* What was written, checked and made beside the world's; *stage NULL: nothing to do. FILE_DAMAGED without a message, or what memory says. The world has not changed. */
typedef struct es_edit_stage es_edit_stage;
es_result es_edits_stage(es_world* world, bool values, const void* bytes, size_t size, es_edit_stage** stage);
/* Puts it in their place, which cannot fail, and frees it. NULL: nothing. */
void es_edits_take(es_world* world, es_edit_stage* stage);
void es_edit_stage_free(es_world* world, es_edit_stage* stage); /* NULL: nothing */

/* An empty one to be filled, which keeps parameters and what is frozen as they are but for those it is given; NULL after es_fail. */
es_edit_stage* es_edit_stage_begin(es_world* world);
/* Valid descs; names are copied. False after es_fail. */
bool es_edit_stage_add_region(es_world* world, es_edit_stage* stage, const es_region_desc* desc);
bool es_edit_stage_add_constraint(es_world* world, es_edit_stage* stage, const es_constraint_desc* desc);
/* Beside those the world has. */
bool es_edit_stage_set_parameter(es_world* world, es_edit_stage* stage, const char* name, float value);
/* Room in the world for what it has: after the last, before es_edits_take. False after es_fail. */
bool es_edit_stage_reserve(es_world* world, const es_edit_stage* stage);

/* For recordings: the object as it is now, or that it is gone; all of them. */
void es_edits_note(es_world* world, es_object_kind kind, uint32_t id);
void es_edits_note_all(es_world* world);
void es_edits_note_parameters(es_world* world);
es_result es_edits_apply_note(es_world* world, es_object_kind kind, uint32_t id, const void* bytes, size_t size);
es_result es_edits_apply_all(es_world* world, const void* bytes, size_t size);

#endif
