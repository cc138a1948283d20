/* A dragon of the eastern kind, wound about a column: scales, spines and horns are geometry. */
#ifndef EARTHSHINE_SIM_DRAGON_H
#define EARTHSHINE_SIM_DRAGON_H

#include "sim/scenes/scene_tools.h"

typedef struct es_dragon_materials { es_material scales, ivory, eyes; } es_dragon_materials;

enum { ES_DRAGON_TRIANGLES = 571296 };

/* On `node`: about its y axis, whose column has the radius 0.36 m; the tail lies on y = 0 out to 1.2 m, the head looks along +z from a height of 3.1 m.
 * `scale` multiplies how finely it is cut, 1: ES_DRAGON_TRIANGLES, nine tenths of them in one mesh. */
void es_build_dragon(es_scene_builder* builder, es_node node, const es_dragon_materials* materials, float scale);

#endif
