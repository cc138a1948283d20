/* What scenes give their objects to fall with. As in scene_tools.h, nothing happens once a call has failed. */
#ifndef EARTHSHINE_SIM_BODY_TOOLS_H
#define EARTHSHINE_SIM_BODY_TOOLS_H

#include "sim/scenes/scene_tools.h"

es_shape_desc es_box_shape(es_vec3 half);
es_shape_desc es_sphere_shape(float radius);
es_shape_desc es_capsule_shape(float radius, float half_height);
/* The convex hull of a mesh's vertices. */
es_shape_desc es_hull_shape(es_mesh mesh);
/* A body of one shape on a node; desc NULL: es_default_body_desc. Its name is the node's. */
es_body es_build_body(es_scene_builder* builder, es_node node, es_body_type type, const es_shape_desc* shape, const es_body_desc* desc);
/* A wall that is not seen, from low to high. */
void es_build_hidden_wall(es_scene_builder* builder, es_vec3 low, es_vec3 high);
/* A box that is seen and stands still. */
void es_build_static_box(es_scene_builder* builder, const char* name, es_vec3 low, es_vec3 high, es_material material);
/* The same mesh's triangles as a static body. */
void es_build_static_mesh(es_scene_builder* builder, es_node node, es_mesh mesh);
void es_build_mover(es_scene_builder* builder, const es_mover_desc* desc);
es_node es_build_child(es_scene_builder* builder, const char* name, es_node parent, es_vec3 translation, es_quat rotation);
/* The light on `node`. */
es_light es_build_light(es_scene_builder* builder, const char* name, es_node node, const es_light_desc* desc);

#endif
