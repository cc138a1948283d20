/* Inside of reflection edits (sim.h): regions and constraints, and what they come to.
 *
 *   anchors.c      places on surfaces                          surface.c   a mesh's triangles by place and by neighbourhood, kept
 *   regions.c      regions                                     geodesic.c  distances over a surface
 *   constraints.c  constraints, their keys                     resolve.c   the list that the light reads
 *   parameters.c   numbers by name, frozen reflections         edit_state.c  saving, restoring, hashing, noting
 *   history.c      undo and redo                               edit_file.c, edit_text.c  glTF extras
 *
 * A world without edits has no es_edits at all and pays nothing. */
#ifndef EARTHSHINE_SIM_EDITS_H
#define EARTHSHINE_SIM_EDITS_H

#include "platform/context.h"
#include "sim/edits/geodesic.h"
#include "sim/world.h"

enum { ES_EDIT_REGIONS = 4096, ES_EDIT_CONSTRAINTS = 16384, ES_EDIT_STROKES = 4096, ES_EDIT_KEYS = 4096, ES_EDIT_PARAMETERS = 1024, ES_EDIT_NAME = 64 };

typedef struct es_region_object {
    es_object object;
    es_region_desc desc;           /* name NULL; strokes are the object's own */
    es_region_state state;         /* as of the last refresh */
    es_geodesic_field field;
} es_region_object;

typedef struct es_constraint_object {
    es_object object;
    es_constraint_desc desc;       /* name NULL; keys are the object's own, parameter.name is parameter_name or NULL */
    char parameter_name[ES_EDIT_NAME];
    es_constraint_state state;
    es_geodesic_field field;
} es_constraint_object;

typedef struct es_parameter { char name[ES_EDIT_NAME]; float value; } es_parameter;

/* What a resolved list was made of. No padding: compared as bytes. */
typedef struct es_edit_inputs { uint64_t edits, geometry, poses, camera; double time, origin[3]; } es_edit_inputs;

typedef struct es_resolved_edits {
    es_resolved_region* regions;
    es_resolved_constraint* constraints;
    es_resolved_stroke* strokes;
    size_t region_capacity, constraint_capacity, stroke_capacity, stroke_count;
} es_resolved_edits;

typedef struct es_edits {
    es_parameter* parameters;      /* by name */
    size_t parameter_count, parameter_capacity;
    bool frozen;
    double eye[3];
    uint64_t changes;              /* of anything above, of regions and of constraints */
    size_t strokes;                /* of all regions */
    es_surfaces surfaces;          /* kept for meshes that edits are on */
    es_resolved_edits made, making;
    es_edit_inputs inputs;         /* of `made` */
    es_edit_list list;
} es_edits;

/* The world's, made at the first call; NULL after es_fail. */
es_edits* es_edits_of(es_world* world);
void es_edits_free(es_world* world);
/* Room in `making` and `made` for what there is, and for so many more; false after es_fail. */
bool es_edits_reserve(es_world* world, size_t regions, size_t constraints, size_t strokes);
/* Brings list and states to the present. */
void es_edits_refresh(es_world* world);

/* A surface anchor's instance, mesh and triangle, or false. Driven meshes must be fresh. */
typedef struct es_anchored { const es_instance_object* instance; const es_mesh_object* mesh; } es_anchored;
bool es_anchor_find(const es_world* world, const es_anchor* anchor, es_anchored* found);
/* Its place in the mesh's axes. */
void es_anchor_local(const es_anchored* found, const es_anchor* anchor, float local[3]);
/* As es_world_resolve_anchor, without refreshing. */
bool es_anchor_resolve(const es_world* world, const es_anchor* anchor, double position[3], es_vec3* normal);
/* Finite, in range, of a kind that there is. What it names need not exist. */
bool es_anchor_valid(const es_anchor* anchor);
es_edit_effect es_anchor_effect(const es_world* world, const es_anchor* anchor);
/* Squares of the edges' lengths in the world, as es_geodesic_between takes them. */
void es_anchor_edges(const es_world* world, const es_anchored* found, uint32_t triangle, float edges_squared[3]);

void es_region_object_free(es_context* context, es_region_object* region);
void es_constraint_object_free(es_context* context, es_constraint_object* constraint);
/* NULL, or what is wrong: with the desc, or, where that is no UINT32_MAX, with the stroke or key of that number. */
const char* es_region_valid(const es_region_desc* desc, uint32_t* stroke);
const char* es_constraint_valid(const es_constraint_desc* desc, uint32_t* key);
/* Copies a checked desc into the object; false after es_fail, with the object as it was. */
bool es_region_put(es_context* context, es_region_object* region, const es_region_desc* desc);
bool es_constraint_put(es_context* context, es_constraint_object* constraint, const es_constraint_desc* desc);
/* Where it is by its keys now: reflecting, reflected's place (target) and direction, into the state; the rest of the state is left alone. */
es_edit_effect es_constraint_place(es_world* world, const es_constraint_object* constraint, es_constraint_state* state, es_vec3* direction);

/* Of a resolved region (places relative to the origin, as the light reads it) at a place of an instance. `corners`: vertices of its triangle. */
float es_region_influence(const es_resolved_region* region, uint32_t instance, const uint32_t corners[3], const float edges_squared[3], float u, float v, es_vec3 place);

#endif
