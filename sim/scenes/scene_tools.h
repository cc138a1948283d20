/* What the built-in scenes are made with: each call does nothing once one has failed, so that a scene checks once at its end. */
#ifndef EARTHSHINE_SIM_SCENE_TOOLS_H
#define EARTHSHINE_SIM_SCENE_TOOLS_H

#include "sim/scenes/scenes.h"
#include "sim/shapes.h"

typedef struct es_scene_builder { es_world* world; es_result result; } es_scene_builder;

es_material es_build_material(es_scene_builder* builder, const char* name, const es_material_desc* desc);
/* Lambert: no specular term. */
es_material es_build_lambert(es_scene_builder* builder, const char* name, float r, float g, float b);
/* Lambert and GGX of that roughness, 0 … 1; specular 1. */
es_material es_build_gloss(es_scene_builder* builder, const char* name, float r, float g, float b, float metallic, float roughness);
/* For es_build_mesh or es_build_object; the builder fails with it. */
es_shape es_build_shape(es_scene_builder* builder);
/* Consumes the shape. */
es_mesh es_build_mesh(es_scene_builder* builder, const char* name, es_shape* shape);
es_node es_build_node(es_scene_builder* builder, const char* name, es_vec3 translation, es_quat rotation);
es_instance es_build_instance(es_scene_builder* builder, es_node node, es_mesh mesh, es_material material);
/* A mesh on its own node. */
es_node es_build_object(es_scene_builder* builder, const char* name, es_shape* shape, es_material material, es_vec3 translation);
/* A floor at y = 0 of slabs of two materials in turns, each of which is an object. */
void es_build_slabs(es_scene_builder* builder, es_vec3 low, es_vec3 high, int columns, int rows, es_material light, es_material dark);
void es_build_camera(es_scene_builder* builder, es_vec3 eye, es_vec3 direction, float fov_y, float near_plane);
es_node es_build_spot(es_scene_builder* builder, es_vec3 position, es_vec3 direction, const float color[3], float intensity, float inner_cone, float outer_cone);
/* Turns -z to `direction`, keeping x level. */
es_quat es_look_rotation(es_vec3 direction);

/* The pose of a node at phase 0 … 1 of the loop; translation and rotation are used. */
typedef struct es_motion { es_node node; void (*pose)(float phase, es_vec3* translation, es_quat* rotation); } es_motion;
/* One looping clip with `keys` cubic-spline keys per motion; tangents are central differences over the loop, so motion and
 * its speed are continuous across its end. */
void es_build_clip(es_scene_builder* builder, const char* name, float period, uint32_t keys, const es_motion* motions, uint32_t count);

#endif
