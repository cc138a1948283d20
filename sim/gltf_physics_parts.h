/* Inside of sim/gltf_physics.c and its parts: the file's values, read and checked, and places of nodes. */
#ifndef EARTHSHINE_SIM_GLTF_PHYSICS_PARTS_H
#define EARTHSHINE_SIM_GLTF_PHYSICS_PARTS_H

#include "sim/gltf_physics.h"

#include "platform/context.h"
#include "platform/maths.h"

enum { ES_GLTF_SHAPES = 4096, ES_GLTF_SYSTEMS = 31, ES_GLTF_HULL_POINTS = 60 };

typedef struct es_gltf_loader {
    const es_gltf_physics* in;
    es_body* bodies;          /* by node number: made for its motion, colliders or extras, or null */
    int32_t* owner;           /* by node number: the nearest node, itself included, that has a body which moves; -1: none */
    const char* systems[ES_GLTF_SYSTEMS]; /* of collision filters, in the order they came up */
    uint32_t system_count;
    struct { uint32_t inertia, combine, drives, limits, joints; } left; /* out, of all nodes together */
} es_gltf_loader;

/* A node's place in the world taken apart; shear is left out. */
typedef struct es_gltf_place { double position[3]; es_quat rotation; es_vec3 scale; } es_gltf_place;

/* Shapes of one body: at most ES_GLTF_SHAPES. */
typedef struct es_gltf_shape_list {
    es_shape_desc* shapes;
    float* points;            /* ES_GLTF_HULL_POINTS × 3 per shape, for those that need them */
    uint32_t count;
} es_gltf_shape_list;

#define ES_GLTF_TRY(call)                              \
    do {                                               \
        es_result tried_ = (call);                     \
        if (tried_ != ES_OK) return tried_;            \
    } while (0)

/* Failures with the file's name; `where` is a path in it. */
es_result es_gltf_damaged(const es_gltf_loader* l, const char* where, const char* what);
es_result es_gltf_damaged_member(const es_gltf_loader* l, const char* where, const char* name, const char* what);
/* NULL: absent, also when there is no object. */
const void* es_gltf_member(const es_gltf_loader* l, const void* object, const char* name);
/* A number within [low, high] where there is one; *value keeps what it has where not. The others likewise. */
es_result es_gltf_number(const es_gltf_loader* l, const void* object, const char* name, double low, double high, const char* where, float* value);
es_result es_gltf_numbers(const es_gltf_loader* l, const void* object, const char* name, size_t count, double low, double high, const char* where, float* values);
es_result es_gltf_flag(const es_gltf_loader* l, const void* object, const char* name, const char* where, bool* value);
/* A whole number below `count`; -1 where there is none. */
es_result es_gltf_index(const es_gltf_loader* l, const void* object, const char* name, size_t count, const char* where, int32_t* index);
/* One of `words`, which end with NULL. */
es_result es_gltf_word(const es_gltf_loader* l, const void* object, const char* name, const char* const* words, const char* where, uint32_t* choice);
/* Element `index` of a list of the file's, which must be an object. */
es_result es_gltf_listed(const es_gltf_loader* l, const void* owner, const char* list, int32_t index, const char* where, const void** value);
/* The node's member in KHR_physics_rigid_bodies. */
const void* es_gltf_rigid_part(const es_gltf_loader* l, uint32_t n, const char* name);
/* The node's member in extras.earthshine; NULL where the node has the extension. */
const void* es_gltf_extras_part(const es_gltf_loader* l, uint32_t n, const char* name);

es_gltf_place es_gltf_place_of(const es_world* world, es_node node);
/* `what` seen from the axes of `from`, without scale. */
void es_gltf_seen_from(const es_gltf_place* from, const es_gltf_place* what, es_vec3* position, es_quat* rotation);

/* Shapes of a collider or trigger of node n, appended; `frame` is the body's. */
es_result es_gltf_add_collider(es_gltf_loader* l, uint32_t n, const void* collider, const char* where, bool sensor, const es_gltf_place* frame, bool moves, es_gltf_shape_list* list);
/* One shape of extras: sizes that are not given are those of the node's meshes. Lengths are in the node's axes and scale with it. */
es_result es_gltf_add_extras_shape(es_gltf_loader* l, uint32_t n, const void* from, const char* where, bool moves, const es_gltf_place* frame, es_gltf_shape_list* list);
/* Of all nodes; the bodies are there. */
es_result es_gltf_add_joints(es_gltf_loader* l);
es_result es_gltf_add_soft(es_gltf_loader* l);

#endif
