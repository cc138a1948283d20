/* Bodies, joints and cloth that a glTF file declares: by KHR_physics_rigid_bodies with KHR_implicit_shapes (drafts of the Khronos group), or by
 * extras of a node, as sim/sim.h describes at es_world_import_gltf. */
#ifndef EARTHSHINE_SIM_GLTF_PHYSICS_H
#define EARTHSHINE_SIM_GLTF_PHYSICS_H

#include "sim/gltf_values.h"
#include "sim/sim.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct es_gltf_physics_node {
    const void* rigid;        /* the node's KHR_physics_rigid_bodies */
    const void* extras;       /* its extras.earthshine */
    es_node node;             /* null: not in the scene */
    int32_t parent;           /* number; -1: none */
    bool animated;            /* by a clip, itself or an ancestor */
    bool skinned;             /* its mesh is: vertices are not in the node's axes */
    const es_mesh* meshes;    /* of its primitives */
    uint32_t mesh_count;
} es_gltf_physics_node;

typedef struct es_gltf_physics {
    es_context* context;
    es_world* world;
    const char* path;                  /* of the file, for messages */
    const es_gltf_values* values;
    const void *rigid, *shapes;        /* the file's KHR_physics_rigid_bodies and KHR_implicit_shapes */
    const es_gltf_physics_node* nodes; /* by number */
    uint32_t node_count;
    const uint32_t* order;             /* the scene's nodes, parents first */
    uint32_t order_count;
} es_gltf_physics;

/* Adds what the nodes declare. Failures have one line that names the place in the file; what is left out is warned of. */
es_result es_gltf_physics_add(const es_gltf_physics* physics);

#ifdef __cplusplus
}
#endif
#endif
