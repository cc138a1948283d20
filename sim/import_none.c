/* Stands for the glTF importer in builds without tinygltf. */
#ifndef ES_WITH_TINYGLTF
#include "platform/context.h"
#include "sim/sim.h"

es_result es_world_import_gltf(es_context* context, const char* path, const es_world_settings* settings, es_world** world)
{
    *world = NULL;
    return es_fail(context, ES_NOT_BUILT, "%s: this build has no glTF importer (EARTHSHINE_WITH_TINYGLTF)", path ? path : "glTF file");
}
#else
typedef int es_import_is_built; /* ISO C has no empty translation unit */
#endif
