/* From places and rays to anchors. */
#include "sim/edits/edits.h"

#include "platform/maths.h"

/* Of a node's axes, about its own place; false when they have no inverse. */
static bool inverse_of(const es_world* world, es_node node, es_mat4* inverse)
{
    es_mat4 m = *es_node_world(world, node);
    m.m[12] = m.m[13] = m.m[14] = 0;
    return es_mat4_inverse(&m, inverse);
}

static void into(const es_mat4* inverse, const double v[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = (double)inverse->m[k] * v[0] + (double)inverse->m[4 + k] * v[1] + (double)inverse->m[8 + k] * v[2];
}

static bool finite_place(const double p[3]) { return es_anchor_valid(&(es_anchor){.kind = ES_ANCHOR_POINT, .point = {p[0], p[1], p[2]}}); }

es_result es_world_anchor_of_point(const es_world* world, es_instance instance, const double point[3], es_anchor* anchor)
{
    if (!world || !point || !anchor) return ES_INVALID_ARGUMENT;
    *anchor = (es_anchor){0};
    const es_instance_object* object = es_world_object(world, ES_OBJECT_INSTANCE, instance.id);
    if (!object) return ES_STALE_HANDLE;
    if (!finite_place(point)) return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_anchor_of_point: the point must be finite and within 1e9");
    es_edits* edits = es_edits_of((es_world*)world);
    if (!edits) return es_context_last_result(world->context);
    es_world_refresh(world);
    const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], object->desc.mesh.id);
    es_fp_environment environment = es_fp_enter();
    es_mat4 inverse;
    es_result result = ES_OK;
    if (inverse_of(world, object->desc.node, &inverse)) {
        const es_surface* surface = es_surface_of(world, &edits->surfaces, mesh, ES_SURFACE_TREE);
        const double* origin = es_node_position(world, object->desc.node);
        double relative[3], local[3];
        for (int k = 0; k < 3; k++) relative[k] = point[k] - origin[k];
        into(&inverse, relative, local);
        float place[3];
        for (int k = 0; k < 3; k++) place[k] = (float)(local[k] < -1e30 ? -1e30 : local[k] > 1e30 ? 1e30 : local[k]);
        es_anchor found = {.kind = ES_ANCHOR_SURFACE, .instance = instance};
        if (!surface) result = es_context_last_result(world->context);
        else if (es_surface_closest(surface, place, &found.triangle, &found.u, &found.v)) *anchor = found;
    }
    es_fp_leave(environment);
    return result;
}

es_result es_world_anchor_of_ray(const es_world* world, const double origin[3], es_vec3 direction, float max, es_anchor* anchor)
{
    if (!world || !origin || !anchor) return ES_INVALID_ARGUMENT;
    *anchor = (es_anchor){0};
    const double squared = (double)direction.x * (double)direction.x + (double)direction.y * (double)direction.y + (double)direction.z * (double)direction.z;
    if (!finite_place(origin) || !es_all_within(&direction.x, 3, ES_WORLD_EXTENT) || !(squared > 1e-30) || !es_within(max, 0, 3e38f))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_anchor_of_ray: a finite origin, a direction and a length of 0 or more are needed");
    es_edits* edits = es_edits_of((es_world*)world);
    if (!edits) return es_context_last_result(world->context);
    es_world_refresh(world);
    es_fp_environment environment = es_fp_enter();
    const double scale = 1.0 / __builtin_sqrt(squared), unit[3] = {(double)direction.x * scale, (double)direction.y * scale, (double)direction.z * scale};
    double nearest = (double)max;
    es_result result = ES_OK;
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_INSTANCE].slot_count && result == ES_OK; slot++) {
        const es_instance_object* object = es_slots_at(&world->slots[ES_OBJECT_INSTANCE], slot);
        es_mat4 inverse;
        if (!object || object->desc.hidden || !inverse_of(world, object->desc.node, &inverse)) continue;
        const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], object->desc.mesh.id);
        const double* place = es_node_position(world, object->desc.node);
        double relative[3], o[3], d[3], t = nearest;
        for (int k = 0; k < 3; k++) relative[k] = origin[k] - place[k];
        into(&inverse, relative, o);
        into(&inverse, unit, d); /* not unit: t stays the world's */
        if (!es_box_met(&mesh->raster.bounds_min, &mesh->raster.bounds_max, o, d, t)) continue;
        const es_surface* surface = es_surface_of(world, &edits->surfaces, mesh, ES_SURFACE_TREE);
        es_anchor found = {.kind = ES_ANCHOR_SURFACE, .instance = {object->object.id}};
        if (!surface) result = es_context_last_result(world->context);
        else if (es_surface_hit(surface, o, d, &t, &found.triangle, &found.u, &found.v) && t < nearest) {
            nearest = t;
            *anchor = found;
        }
    }
    es_fp_leave(environment);
    return result;
}
