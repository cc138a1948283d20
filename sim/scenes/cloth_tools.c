/* Sheets of cloth for scenes: see cloth_tools.h. */
#include "sim/scenes/cloth_tools.h"

#include "platform/maths.h"

es_mesh es_build_sheet(es_scene_builder* builder, const char* name, es_vec3 origin, es_vec3 du, es_vec3 dv, uint32_t nu, uint32_t nv, const es_material_desc* cloth, es_node* node)
{
    es_shape shape = es_build_shape(builder);
    es_vec3 normal = es_v3_normalize(es_v3_cross(du, dv), es_v3(0, 1, 0));
    es_shape_plane(&shape, origin, du, dv, normal, nu, nv);
    es_mesh mesh = es_build_mesh(builder, name, &shape);
    es_material_desc both = *cloth;
    both.double_sided = true;
    *node = es_build_node(builder, name, es_v3(0, 0, 0), es_quat_identity());
    es_build_instance(builder, *node, mesh, es_build_material(builder, name, &both));
    return mesh;
}
