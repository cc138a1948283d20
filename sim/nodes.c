/* The node tree: local transforms to world matrices.
 *
 * A parent exists before its child and never changes, so the tree cannot close into a cycle. Matrices are computed in one
 * fixed order, by depth and then by slot, world = parent's world × local: the same bits whichever way the tree was filled. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

bool es_all_within(const float* values, size_t count, float limit)
{
    bool good = true;
    for (size_t i = 0; i < count; i++) good &= es_within(values[i], -limit, limit);
    return good;
}

es_transform es_identity_transform(void) { return (es_transform){{0, 0, 0}, {0, 0, 0, 1}, {1, 1, 1}}; }

bool es_transform_resolve(const es_transform* transform, es_transform* resolved)
{
    es_transform t = *transform;
    bool no_rotation = t.rotation.x == 0 && t.rotation.y == 0 && t.rotation.z == 0 && t.rotation.w == 0;
    if (no_rotation && t.scale.x == 0 && t.scale.y == 0 && t.scale.z == 0) t.scale = es_v3(1, 1, 1);
    if (!es_all_within(&t.translation.x, 3, ES_WORLD_EXTENT) || !es_all_within(&t.scale.x, 3, ES_WORLD_EXTENT) ||
        !es_all_within(&t.rotation.x, 4, ES_WORLD_EXTENT))
        return false;
    /* a rotation that is unit to rounding keeps its bits, so that what a getter returned can be set again without a change */
    double x = t.rotation.x, y = t.rotation.y, z = t.rotation.z, w = t.rotation.w, squared = x * x + y * y + z * z + w * w;
    if (!(squared > 1.0 - 1e-6 && squared < 1.0 + 1e-6)) t.rotation = es_quat_normalize(t.rotation);
    *resolved = t;
    return true;
}

static es_node_object* node_object(const es_world* world, es_node node) { return es_world_object(world, ES_OBJECT_NODE, node.id); }

es_result es_world_add_node(es_world* world, const es_node_desc* desc, es_node* node)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !node) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_node: desc and node must not be NULL");
    *node = (es_node){0};
    es_node_object* parent = NULL;
    if (desc->parent.id && !(parent = node_object(world, desc->parent))) return ES_STALE_HANDLE;
    es_transform transform;
    if (!es_transform_resolve(&desc->transform, &transform))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "node '%.64s': its transform must be finite and within 1e9", desc->name ? desc->name : "");
    size_t slots_needed = world->slots[ES_OBJECT_NODE].slot_count + (size_t)1;
    if (!es_grow(world->context, (void**)&world->order, &world->order_capacity, world->order_count, slots_needed, sizeof *world->order))
        return es_context_last_result(world->context);
    es_node_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_NODE], "node", desc->name);
    if (!object) return es_context_last_result(world->context);
    object->parent = desc->parent;
    object->transform = transform;
    object->depth = parent ? parent->depth + 1 : 0;
    object->dirty = object->fresh = true;
    object->world = object->previous = es_mat4_identity();
    if (parent) parent->object.references++;
    world->order_dirty = world->nodes_dirty = true;
    node->id = object->object.id;
    return ES_OK;
}

es_result es_world_destroy_node(es_world* world, es_node node)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_node_object* object = node_object(world, node);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "node '%.64s' cannot be destroyed: %u children, instances, cameras, lights, clip channels or movers use it",
            object->object.name ? object->object.name : "", object->object.references);
    es_world_rereference(world, ES_OBJECT_NODE, object->parent.id, 0);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_NODE], &object->object);
    world->order_dirty = world->nodes_dirty = true;
    world->pose_changes++;
    return ES_OK;
}

es_result es_world_set_node_transform(es_world* world, es_node node, const es_transform* transform)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_node_object* object = node_object(world, node);
    if (!object) return ES_STALE_HANDLE;
    es_transform resolved;
    if (!transform || !es_transform_resolve(transform, &resolved))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "node '%.64s': its transform must be finite and within 1e9", object->object.name ? object->object.name : "");
    if (memcmp(&resolved, &object->transform, sizeof resolved) == 0) return ES_OK;
    object->transform = resolved;
    object->dirty = world->nodes_dirty = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_NODE, .id = node.id, .transform = resolved});
    return ES_OK;
}

es_result es_world_get_node_transform(const es_world* world, es_node node, es_transform* transform)
{
    if (!world || !transform) return ES_INVALID_ARGUMENT;
    es_node_object* object = node_object(world, node);
    if (!object) return ES_STALE_HANDLE;
    *transform = object->transform;
    return ES_OK;
}

es_result es_world_get_node_matrix(const es_world* world, es_node node, es_mat4* to_world)
{
    if (!world || !to_world) return ES_INVALID_ARGUMENT;
    es_node_object* object = node_object(world, node);
    if (!object) return ES_STALE_HANDLE;
    /* the nodes alone: vertices that hang on them can wait for somebody who wants to see them */
    es_fp_environment environment = es_fp_enter();
    es_nodes_refresh((es_world*)world);
    es_fp_leave(environment);
    *to_world = object->world;
    return ES_OK;
}

es_node es_world_find_node(const es_world* world, const char* name)
{
    if (!world || !name || !*name) return (es_node){0};
    const es_slots* slots = &world->slots[ES_OBJECT_NODE];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_object* object = es_slots_at(slots, slot);
        if (object && object->name && strcmp(object->name, name) == 0) return (es_node){object->id};
    }
    return (es_node){0};
}

static const es_mat4 identity = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};

const es_mat4* es_node_world(const es_world* world, es_node node)
{
    const es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    return object ? &object->world : &identity;
}

const es_mat4* es_node_previous(const es_world* world, es_node node)
{
    const es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    return object ? &object->previous : &identity;
}

static const double nowhere[3] = {0, 0, 0};

const double* es_node_position(const es_world* world, es_node node)
{
    const es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    return object ? object->position : nowhere;
}

const double* es_node_previous_position(const es_world* world, es_node node)
{
    const es_node_object* object = es_slots_get(&world->slots[ES_OBJECT_NODE], node.id);
    return object ? object->previous_position : nowhere;
}

/* The translation is summed in double: far from the world's zero, floats cannot say where a node is within a scene. */
static void place(es_node_object* node, const es_node_object* parent)
{
    node->world = parent ? es_mat4_mul(parent->world, node->local) : node->local;
    for (int row = 0; row < 3; row++) {
        double sum = node->local.m[12 + row];
        if (parent) {
            sum = parent->position[row];
            for (int k = 0; k < 3; k++) sum += (double)parent->world.m[4 * k + row] * (double)node->local.m[12 + k];
        }
        node->position[row] = sum;
        node->world.m[12 + row] = (float)sum;
    }
}

/* Slots sorted by depth, in slot order within a depth: one pass per depth until all are placed. Trees are shallow, and a
 * chain of n nodes costs n passes only when the tree itself changes; deep chains go through the counting branch instead. */
static void rebuild_order(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_NODE];
    uint32_t placed = 0, deepest = 0;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_node_object* node = es_slots_at(slots, slot);
        if (node && node->depth > deepest) deepest = node->depth;
    }
    if (deepest < 64) {
        for (uint32_t depth = 0; depth <= deepest; depth++)
            for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
                const es_node_object* node = es_slots_at(slots, slot);
                if (node && node->depth == depth) world->order[placed++] = slot;
            }
    } else {
        /* heap sort by (depth, slot): no memory, n log n whatever the shape */
        for (uint32_t slot = 0; slot < slots->slot_count; slot++)
            if (es_slots_at(slots, slot)) world->order[placed++] = slot;
#define KEY(slot) ((uint64_t)((const es_node_object*)es_slots_at(slots, slot))->depth << 32 | (slot))
        for (uint32_t start = placed / 2, end = placed; end > 1;) {
            if (start > 0) {
                start--;
            } else {
                end--;
                uint32_t top = world->order[0];
                world->order[0] = world->order[end];
                world->order[end] = top;
            }
            uint32_t root = start, sinking = world->order[start];
            for (uint32_t child; (child = 2 * root + 1) < end; root = child) {
                if (child + 1 < end && KEY(world->order[child + 1]) > KEY(world->order[child])) child++;
                if (KEY(world->order[child]) <= KEY(sinking)) break;
                world->order[root] = world->order[child];
            }
            world->order[root] = sinking;
        }
#undef KEY
    }
    world->order_count = placed;
    world->order_dirty = false;
}

void es_node_settle(es_node_object* node)
{
    node->previous = node->world;
    memcpy(node->previous_position, node->position, sizeof node->position);
}

void es_nodes_refresh(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_NODE];
    if (world->order_dirty) rebuild_order(world);
    if (!world->nodes_dirty) return;
    world->nodes_dirty = false;
    bool any = false;
    for (size_t i = 0; i < world->order_count; i++) {
        es_node_object* node = es_slots_at(slots, world->order[i]);
        const es_node_object* parent = node->parent.id ? es_slots_at(slots, es_slot_of(node->parent.id)) : NULL;
        node->changed = false;
        if (node->dirty || (parent && parent->changed)) {
            if (node->dirty) node->local = es_mat4_from_trs(node->transform.translation, node->transform.rotation, node->transform.scale);
            node->dirty = false;
            es_mat4 old = node->world;
            double old_position[3];
            memcpy(old_position, node->position, sizeof old_position);
            place(node, parent);
            node->changed = node->fresh || memcmp(&old, &node->world, sizeof old) != 0 || memcmp(old_position, node->position, sizeof old_position) != 0;
            any |= node->changed;
        }
        if (node->fresh || !world->stepped) es_node_settle(node);
        node->fresh = false;
    }
    world->pose_changes += any;
    if (any) world->list_dirty = world->lights_dirty = world->camera_dirty = world->nodes_moving = world->poses_dirty = true;
}
