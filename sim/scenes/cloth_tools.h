/* Sheets of cloth for scenes. */
#ifndef EARTHSHINE_SIM_CLOTH_TOOLS_H
#define EARTHSHINE_SIM_CLOTH_TOOLS_H

#include "sim/scenes/body_tools.h"

/* A sheet of nu × nv quadrilaterals from `origin`, seen from both sides, on a node at the world's zero; vertex i + (nu + 1) j lies at
 * origin + du i / nu + dv j / nv. */
es_mesh es_build_sheet(es_scene_builder* builder, const char* name, es_vec3 origin, es_vec3 du, es_vec3 dv, uint32_t nu, uint32_t nv, const es_material_desc* cloth, es_node* node);

#endif
