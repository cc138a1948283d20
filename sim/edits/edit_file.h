/* Edits in glTF files: scene extras {"earthshine": {"edits": …}} (sim.h: es_world_load_edits). */
#ifndef EARTHSHINE_SIM_EDIT_FILE_H
#define EARTHSHINE_SIM_EDIT_FILE_H

#include "sim/edits/json.h"
#include "sim/sim.h"

#ifdef __cplusplus
extern "C" {
#endif

/* For the importer: edits that the text may have, into a world that has everything else of the file. OK when there are none. */
es_result es_edits_import(es_world* world, const char* path, const char* text, size_t size);

#ifdef __cplusplus
}
#endif

/* The scene that is shown and what is in it on the way to the edits; 0: absent. */
typedef struct es_edit_place { uint32_t scene, extras, earthshine, edits; } es_edit_place;
es_edit_place es_edits_find(const es_json* json);

#endif
