/* What scenes edit their reflections with. As in scene_tools.h, nothing happens once a call has failed. */
#ifndef EARTHSHINE_SIM_EDIT_TOOLS_H
#define EARTHSHINE_SIM_EDIT_TOOLS_H

#include "sim/scenes/scene_tools.h"

/* About the place of the thing's surface that is nearest to `at`. */
void es_build_region(es_scene_builder* builder, const char* name, es_region_type type, es_instance thing, es_vec3 at, float radius, float border);
/* Who looks from `eye` to the place of the thing's surface that is nearest to `at` sees `target` there. */
void es_build_constraint(es_scene_builder* builder, const char* name, es_instance thing, es_vec3 at, es_vec3 target, es_vec3 eye);
/* The same of what refracts (§7.6.1): light goes on along `direction`, in the axes of the thing's node. */
void es_build_refraction(es_scene_builder* builder, const char* name, es_instance thing, es_vec3 at, es_vec3 direction, es_vec3 eye);

#endif
