/* Instances, and the draw list made of them.
 *
 * The list is rebuilt when an instance, a mesh or a matrix may differ, and the geometry revision goes up only where an
 * entry really does. Its material table is the default material followed by the material slots, so that a material keeps
 * its index for life. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

static es_result check_desc(es_world* world, const es_instance_desc* desc)
{
    if (!(desc->point_weight <= 1e6f && desc->point_weight >= -1e30f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "an instance's point weight must be a number up to 1e6");
    if (!es_world_object(world, ES_OBJECT_MESH, desc->mesh.id)) return ES_STALE_HANDLE;
    if (desc->node.id && !es_world_object(world, ES_OBJECT_NODE, desc->node.id)) return ES_STALE_HANDLE;
    if (desc->material.id && !es_world_object(world, ES_OBJECT_MATERIAL, desc->material.id)) return ES_STALE_HANDLE;
    return ES_OK;
}

static void exchange_references(es_world* world, const es_instance_desc* from, const es_instance_desc* to)
{
    es_world_rereference(world, ES_OBJECT_MESH, from->mesh.id, to->mesh.id);
    es_world_rereference(world, ES_OBJECT_NODE, from->node.id, to->node.id);
    es_world_rereference(world, ES_OBJECT_MATERIAL, from->material.id, to->material.id);
}

es_result es_world_add_instance(es_world* world, const es_instance_desc* desc, es_instance* instance)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !instance) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_instance: desc and instance must not be NULL");
    *instance = (es_instance){0};
    es_result result = check_desc(world, desc);
    if (result != ES_OK) return result;
    size_t needed = world->slots[ES_OBJECT_INSTANCE].slot_count + (size_t)1;
    if (!es_grow(world->context, (void**)&world->drawn, &world->drawn_capacity, world->list.instance_count, needed, sizeof *world->drawn))
        return es_context_last_result(world->context);
    world->list.instances = world->drawn;
    es_instance_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_INSTANCE], "instance", NULL);
    if (!object) return es_context_last_result(world->context);
    object->desc = *desc;
    exchange_references(world, &(es_instance_desc){0}, desc);
    world->list_dirty = world->geometry_touched = true;
    instance->id = object->object.id;
    return ES_OK;
}

es_result es_world_set_instance(es_world* world, es_instance instance, const es_instance_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_instance_object* object = es_world_object(world, ES_OBJECT_INSTANCE, instance.id);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_instance: desc must not be NULL");
    es_result result = check_desc(world, desc);
    if (result != ES_OK) return result;
    es_instance_desc* now = &object->desc;
    if (now->node.id == desc->node.id && now->mesh.id == desc->mesh.id && now->material.id == desc->material.id && now->hidden == desc->hidden &&
        now->point_weight == desc->point_weight)
        return ES_OK;
    exchange_references(world, now, desc);
    *now = *desc;
    world->list_dirty = world->geometry_touched = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_INSTANCE, .id = instance.id, .instance = *desc});
    return ES_OK;
}

es_result es_world_get_instance(const es_world* world, es_instance instance, es_instance_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_instance_object* object = es_world_object(world, ES_OBJECT_INSTANCE, instance.id);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    return ES_OK;
}

es_result es_world_destroy_instance(es_world* world, es_instance instance)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_instance_object* object = es_world_object(world, ES_OBJECT_INSTANCE, instance.id);
    if (!object) return ES_STALE_HANDLE;
    exchange_references(world, &object->desc, &(es_instance_desc){0});
    es_slots_remove(world->context, &world->slots[ES_OBJECT_INSTANCE], &object->object);
    world->list_dirty = world->geometry_touched = true;
    return ES_OK;
}

/* Box of a transformed box by centre and half extent. */
static void transformed_box(const es_mat4* matrix, es_vec3 low, es_vec3 high, es_vec3* out_low, es_vec3* out_high)
{
    float centre[3] = {0.5f * low.x + 0.5f * high.x, 0.5f * low.y + 0.5f * high.y, 0.5f * low.z + 0.5f * high.z};
    float half[3] = {0.5f * high.x - 0.5f * low.x, 0.5f * high.y - 0.5f * low.y, 0.5f * high.z - 0.5f * low.z};
    float a[3], b[3];
    for (int row = 0; row < 3; row++) {
        float c = matrix->m[12 + row], h = 0;
        for (int k = 0; k < 3; k++) {
            c += matrix->m[4 * k + row] * centre[k];
            h += es_absf(matrix->m[4 * k + row]) * half[k];
        }
        a[row] = c - h;
        b[row] = c + h;
    }
    *out_low = es_v3(a[0], a[1], a[2]);
    *out_high = es_v3(b[0], b[1], b[2]);
}

/* The instance's box in the world's own coordinates; false when it leaves the world's extent. */
static bool world_box(const es_world* world, const es_instance_object* instance, const es_raster_mesh* mesh, double low[3], double high[3])
{
    es_mat4 turned = *es_node_world(world, instance->desc.node);
    const double* position = es_node_position(world, instance->desc.node);
    turned.m[12] = turned.m[13] = turned.m[14] = 0.0f;
    es_vec3 a, b;
    transformed_box(&turned, mesh->bounds_min, mesh->bounds_max, &a, &b);
    const float from[3] = {a.x, a.y, a.z}, to[3] = {b.x, b.y, b.z};
    bool good = true;
    for (int k = 0; k < 3; k++) {
        low[k] = position[k] + (double)from[k];
        high[k] = position[k] + (double)to[k];
        good &= low[k] >= -(double)ES_WORLD_EXTENT && high[k] <= (double)ES_WORLD_EXTENT;
    }
    return good;
}

static const es_mesh_object* drawn_mesh(const es_world* world, const es_instance_object* instance)
{
    if (!instance || instance->desc.hidden) return NULL;
    const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], instance->desc.mesh.id);
    return mesh->raster.triangle_count ? mesh : NULL;
}

/* ---- the origin ------------------------------------------------------------------------------------------------------------------------ */

es_mat4 es_relative_matrix(const es_world* world, const es_mat4* matrix, const double position[3])
{
    es_mat4 relative = *matrix;
    for (int k = 0; k < 3; k++) relative.m[12 + k] = (float)(position[k] - world->origin[k]);
    return relative;
}

/* 64 … 128 diagonals of the world's bounds, a power of two: a world seen from within 32 diagonals of zero keeps zero as its origin, and
 * the same world at another scale has its origin at the same place in it. */
static double cell_of(const es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_INSTANCE];
    double low[3], high[3], a[3], b[3], squared = 0, cell = 0x1p-16;
    bool any = false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_instance_object* object = es_slots_at(slots, slot);
        const es_mesh_object* mesh = drawn_mesh(world, object);
        if (!mesh || !world_box(world, object, &mesh->raster, a, b)) continue;
        for (int k = 0; k < 3; k++) {
            low[k] = any && low[k] < a[k] ? low[k] : a[k];
            high[k] = any && high[k] > b[k] ? high[k] : b[k];
        }
        any = true;
    }
    for (int k = 0; k < 3 && any; k++) squared += (high[k] - low[k]) * (high[k] - low[k]);
    if (!(squared > 0)) return 0;
    while (cell * cell < 4096.0 * squared) cell *= 2.0;
    return cell;
}

bool es_origin_refresh(es_world* world)
{
    if (!world->list_dirty && !world->camera_dirty) return false;
    if (world->list_dirty) world->cell = cell_of(world);
    const es_camera_object* camera = es_slots_get(&world->slots[ES_OBJECT_CAMERA], world->active_camera.id);
    double origin[3] = {0, 0, 0};
    if (camera && world->cell > 0) {
        const double* eye = es_node_position(world, camera->desc.node);
        for (int k = 0; k < 3; k++) {
            double cells = eye[k] / world->cell + (eye[k] < 0 ? -0.5 : 0.5);
            if (eye[k] >= -(double)ES_WORLD_EXTENT && eye[k] <= (double)ES_WORLD_EXTENT) origin[k] = (double)(int64_t)cells * world->cell;
        }
    }
    if (origin[0] == world->origin[0] && origin[1] == world->origin[1] && origin[2] == world->origin[2]) return false;
    memcpy(world->origin, origin, sizeof origin);
    return true;
}

void es_world_origin(const es_world* world, double origin[3])
{
    origin[0] = origin[1] = origin[2] = 0;
    if (!world) return;
    es_world_refresh(world);
    memcpy(origin, world->origin, sizeof world->origin);
}

/* ---- the list -------------------------------------------------------------------------------------------------------------------------- */

void es_draw_list_refresh(es_world* world)
{
    if (!world->list_dirty) return;
    world->list_dirty = false;
    bool differs = world->geometry_touched;
    world->geometry_touched = false;
    const es_slots* slots = &world->slots[ES_OBJECT_INSTANCE];
    uint32_t count = 0;
    world->instances_moving = world->has_bounds = false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_instance_object* object = es_slots_at(slots, slot);
        const es_mesh_object* mesh = drawn_mesh(world, object);
        if (!mesh) continue;
        double world_low[3], world_high[3];
        if (!world_box(world, object, &mesh->raster, world_low, world_high)) {
            if (!object->warned)
                es_log(world->context, ES_LOG_WARNING, ES_ASSET_WARNING, "an instance of mesh '%.64s' is left out while it lies beyond 1e9 m",
                    mesh->object.name ? mesh->object.name : "");
            object->warned = true;
            continue;
        }
        es_mat4 now = es_relative_matrix(world, es_node_world(world, object->desc.node), es_node_position(world, object->desc.node));
        es_mat4 last = es_relative_matrix(world, es_node_previous(world, object->desc.node), es_node_previous_position(world, object->desc.node));
        es_vec3 low, high;
        transformed_box(&now, mesh->raster.bounds_min, mesh->raster.bounds_max, &low, &high);
        if (!es_all_within(last.m, 16, ES_WORLD_EXTENT)) last = now;
        uint32_t material = object->desc.material.id ? es_slot_of(object->desc.material.id) + 1 : 0;
        es_raster_instance* entry = &world->drawn[count];
        differs |= count >= world->list.instance_count || entry->id != slot || entry->mesh != &mesh->raster || entry->material != material || entry->point_weight != object->desc.point_weight ||
                   memcmp(&entry->transform, &now, sizeof now) != 0;
        *entry = (es_raster_instance){&mesh->raster, material, slot, now, last, object->desc.point_weight};
        world->instances_moving |= mesh->moving || memcmp(&now, &last, sizeof now) != 0;
        if (count++ == 0) {
            world->bounds_min = low;
            world->bounds_max = high;
            world->has_bounds = true;
        }
        es_vec3 *a = &world->bounds_min, *b = &world->bounds_max;
        *a = es_v3(es_minf(a->x, low.x), es_minf(a->y, low.y), es_minf(a->z, low.z));
        *b = es_v3(es_maxf(b->x, high.x), es_maxf(b->y, high.y), es_maxf(b->z, high.z));
    }
    differs |= count != world->list.instance_count;
    world->list.instance_count = count;
    if (differs) world->revisions.geometry++;
}

const es_draw_list* es_world_draw_list(const es_world* world)
{
    if (!world) return NULL;
    es_world_refresh(world);
    return &world->list;
}

bool es_world_bounds(const es_world* world, es_vec3* minimum, es_vec3* maximum)
{
    if (!world) return false;
    es_world_refresh(world);
    if (!world->has_bounds) return false;
    if (minimum) *minimum = world->bounds_min;
    if (maximum) *maximum = world->bounds_max;
    return true;
}
