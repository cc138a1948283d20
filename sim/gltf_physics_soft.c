/* Cloth and soft solids of extras, one for each mesh of the node. */
#include "sim/gltf_physics_parts.h"

#include <stdio.h>

#include "sim/world.h"

/* Vertices that are held: those listed, and all at or above a height in the node's axes. *count is how many. */
static es_result read_pins(es_gltf_loader* l, const void* cloth, const char* where, const es_raster_mesh* mesh, es_node holder, es_soft_attachment* pins, uint32_t* count)
{
    const void* list = es_gltf_member(l, cloth, "pins");
    float above = 0;
    size_t length = 0;
    if (list && !l->in->values->array_length(list, &length)) return es_gltf_damaged_member(l, where, "pins", "must be an array of vertex numbers");
    for (size_t i = 0; i < length; i++) {
        double vertex;
        if (!l->in->values->number(l->in->values->element(list, i), &vertex) || !(vertex >= 0 && vertex < mesh->vertex_count) || vertex != (double)(uint32_t)vertex)
            return es_fail(l->in->context, ES_FILE_DAMAGED, "%s: %s.pins[%zu]: must be a whole number below %u", l->in->path, where, i, mesh->vertex_count);
        if (pins && *count < mesh->vertex_count) pins[*count] = (es_soft_attachment){.vertex = (uint32_t)vertex, .node = holder, .in_place = true};
        *count += *count < mesh->vertex_count;
    }
    ES_GLTF_TRY(es_gltf_number(l, cloth, "pinsAbove", -1e9, 1e9, where, &above));
    for (uint32_t v = 0; es_gltf_member(l, cloth, "pinsAbove") && v < mesh->vertex_count && *count < mesh->vertex_count; v++) {
        if (!(mesh->positions[4 * (size_t)v + 1] >= above)) continue;
        pins[(*count)++] = (es_soft_attachment){.vertex = v, .node = holder, .in_place = true};
    }
    return ES_OK;
}

static es_result read_cloth(es_gltf_loader* l, const void* cloth, const char* where, es_soft_desc* desc, float* spacing)
{
    float substeps = 0;
    const struct { const char* name; double low, high; float* value; } numbers[] = {{"mass", 1e-6, 1e6, &desc->mass}, {"stretchCompliance", 0, 1e6, &desc->stretch_compliance},
        {"shearCompliance", 0, 1e6, &desc->shear_compliance}, {"bendCompliance", -1, 1e6, &desc->bend_compliance}, {"volumeCompliance", 0, 1e6, &desc->volume_compliance},
        {"damping", 0, 1e3, &desc->damping}, {"thickness", 0, 10, &desc->thickness}, {"friction", 0, 10, &desc->friction}, {"drag", 0, 1e3, &desc->drag}, {"pressure", -1e6, 1e6, &desc->pressure},
        {"gravityScale", -100, 100, &desc->gravity_scale}, {"tearStretch", 1.01, 1e3, &desc->tear_stretch}, {"substeps", 1, 1024, &substeps}, {"solid", 1e-4, 1e4, spacing}};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++) ES_GLTF_TRY(es_gltf_number(l, cloth, numbers[i].name, numbers[i].low, numbers[i].high, where, numbers[i].value));
    ES_GLTF_TRY(es_gltf_numbers(l, cloth, "wind", 3, -1e3, 1e3, where, &desc->wind.x));
    ES_GLTF_TRY(es_gltf_flag(l, cloth, "selfCollision", where, &desc->self_collision));
    desc->substeps = (uint32_t)substeps;
    return ES_OK;
}

static es_result add_soft(es_gltf_loader* l, uint32_t n, const void* cloth, const char* where, es_mesh mesh)
{
    const es_gltf_physics_node* node = &l->in->nodes[n];
    es_soft_desc desc = es_default_soft_desc();
    es_soft_solid solid = {0};
    es_soft soft;
    float spacing = 0;
    int32_t to;
    uint32_t count = 0;
    ES_GLTF_TRY(read_cloth(l, cloth, where, &desc, &spacing));
    ES_GLTF_TRY(es_gltf_index(l, cloth, "to", l->in->node_count, where, &to));
    if (to >= 0 && !l->in->nodes[to].node.id) return es_gltf_damaged_member(l, where, "to", "is not in the scene");
    if (spacing > 0 && (es_gltf_member(l, cloth, "pins") || es_gltf_member(l, cloth, "pinsAbove"))) return es_gltf_damaged_member(l, where, "solid", "has particles of its own, no vertices that pins could hold");
    const es_raster_mesh* raster = es_world_mesh(l->in->world, mesh);
    size_t bytes = (raster->vertex_count + (size_t)1) * sizeof(es_soft_attachment);
    es_soft_attachment* pins = es_allocate_zero(l->in->context, bytes);
    if (!pins) return es_context_last_result(l->in->context);
    es_result result = read_pins(l, cloth, where, raster, to < 0 ? (es_node){0} : l->in->nodes[to].node, pins, &count);
    if (result == ES_OK && spacing > 0) result = es_soft_fill(l->in->world, mesh, spacing, &solid);
    if (result == ES_OK) {
        desc.name = es_world_name(l->in->world, ES_OBJECT_NODE, node->node.id);
        desc.mesh = mesh;
        desc.node = node->node;
        desc.solid = spacing > 0 ? &solid : NULL;
        desc.attachments = pins;
        desc.attachment_count = count;
        result = es_world_add_soft(l->in->world, &desc, &soft);
    }
    es_soft_solid_free(l->in->world, &solid);
    es_release(l->in->context, pins, bytes);
    return result;
}

es_result es_gltf_add_soft(es_gltf_loader* l)
{
    for (uint32_t i = 0; i < l->in->order_count; i++) {
        uint32_t n = l->in->order[i];
        const void* cloth = es_gltf_extras_part(l, n, "cloth");
        char where[96];
        if (!cloth) continue;
        snprintf(where, sizeof where, "nodes[%u].extras.earthshine.cloth", n);
        if (!l->in->values->is_object(cloth)) return es_gltf_damaged(l, where, "must be an object");
        if (!l->in->nodes[n].mesh_count || l->in->nodes[n].skinned) return es_gltf_damaged(l, where, l->in->nodes[n].skinned ? "its mesh is skinned" : "needs a mesh of triangles on its node");
        for (uint32_t m = 0; m < l->in->nodes[n].mesh_count; m++) ES_GLTF_TRY(add_soft(l, n, cloth, where, l->in->nodes[n].meshes[m]));
    }
    return ES_OK;
}
