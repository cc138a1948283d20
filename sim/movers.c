/* Movers: motion by a formula instead of keys. Orbits and swings pose nodes, an aim turns them, a flicker dims lights.
 *
 * Everything is a function of the world's time alone, so a mover can be asked about any time and needs no state of its own. Orbits and
 * swings go first, in slot order; aims come after them, since they look at places that may just have moved. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/random.h"

static const float turn = 6.2831853f;

es_mover_desc es_default_mover_desc(void) { return (es_mover_desc){.axis = {0, 1, 0}, .period = 1, .rotation = {0, 0, 0, 1}}; }

static es_mover_object* mover_object(const es_world* world, es_mover mover) { return es_world_object(world, ES_OBJECT_MOVER, mover.id); }

/* What a saved state is asked too: everything but the handles. */
bool es_mover_numbers_valid(const es_mover_desc* d)
{
    return (uint32_t)d->type <= ES_MOVER_FLICKER && es_all_within(&d->centre.x, 3, ES_WORLD_EXTENT) && es_all_within(&d->arm.x, 3, ES_WORLD_EXTENT) &&
           es_all_within(&d->axis.x, 3, ES_WORLD_EXTENT) && es_all_within(&d->rotation.x, 4, ES_WORLD_EXTENT) && es_within(d->period, 1e-3f, 1e6f) &&
           es_within(d->phase, -1e6f, 1e6f) && es_within(d->amplitude, 0, d->type == ES_MOVER_FLICKER ? 1.0f : 1e3f);
}

static es_result resolve(es_world* world, const es_mover_desc* desc, es_mover_desc* resolved)
{
    es_mover_desc d = *desc;
    const char* name = desc->name ? desc->name : "";
    d.name = NULL;
    if (d.period == 0) d.period = 1;
    if (!es_mover_numbers_valid(&d))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mover '%.64s': it needs a type of es_mover_type, a period of 1e-3 … 1e6 seconds, an amplitude of 0 … 1 (flicker) or 0 … 1000 radians, and finite vectors within 1e9", name);
    es_fp_environment environment = es_fp_enter();
    d.axis = es_v3_normalize(d.axis, es_v3(0, 1, 0));
    d.rotation = es_quat_normalize(d.rotation);
    es_fp_leave(environment);
    if (d.type == ES_MOVER_FLICKER) {
        d.node = d.target = (es_node){0};
        if (!es_world_object(world, ES_OBJECT_LIGHT, d.light.id)) return ES_STALE_HANDLE;
    } else {
        d.light = (es_light){0};
        if (!es_world_object(world, ES_OBJECT_NODE, d.node.id)) return ES_STALE_HANDLE;
        if (d.target.id && !es_world_object(world, ES_OBJECT_NODE, d.target.id)) return ES_STALE_HANDLE;
    }
    *resolved = d;
    return ES_OK;
}

static void exchange_references(es_world* world, const es_mover_desc* from, const es_mover_desc* to)
{
    es_world_rereference(world, ES_OBJECT_NODE, from->node.id, to->node.id);
    es_world_rereference(world, ES_OBJECT_NODE, from->target.id, to->target.id);
    es_world_rereference(world, ES_OBJECT_LIGHT, from->light.id, to->light.id);
}

es_result es_world_add_mover(es_world* world, const es_mover_desc* desc, es_mover* mover)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !mover) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_mover: desc and mover must not be NULL");
    *mover = (es_mover){0};
    es_mover_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    es_mover_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_MOVER], "mover", desc->name);
    if (!object) return es_context_last_result(world->context);
    object->desc = resolved;
    exchange_references(world, &(es_mover_desc){0}, &resolved);
    mover->id = object->object.id;
    return ES_OK;
}

es_result es_world_set_mover(es_world* world, es_mover mover, const es_mover_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mover_object* object = mover_object(world, mover);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_mover: desc must not be NULL");
    es_mover_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    es_mover_put(world, object, &resolved);
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_MOVER, .id = mover.id, .mover = *desc});
    return ES_OK;
}

void es_mover_put(es_world* world, es_mover_object* mover, const es_mover_desc* resolved)
{
    exchange_references(world, &mover->desc, resolved);
    mover->desc = *resolved;
}

bool es_mover_is_resolved(const es_mover_desc* d)
{
    const es_quat q = d->rotation;
    return es_within(es_v3_dot(d->axis, d->axis), 0.99f, 1.01f) && es_within(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w, 0.99f, 1.01f);
}

es_result es_world_get_mover(const es_world* world, es_mover mover, es_mover_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_mover_object* object = mover_object(world, mover);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name ? object->object.name : "";
    return ES_OK;
}

es_result es_world_destroy_mover(es_world* world, es_mover mover)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mover_object* object = mover_object(world, mover);
    if (!object) return ES_STALE_HANDLE;
    exchange_references(world, &object->desc, &(es_mover_desc){0});
    es_slots_remove(world->context, &world->slots[ES_OBJECT_MOVER], &object->object);
    return ES_OK;
}

/* ---- motion ------------------------------------------------------------------------------------------------------------ */

/* Periods passed since time 0, without the whole ones: [0, 1). In double, so that an hour later the motion is as smooth. */
static float phase_at(const es_mover_desc* d, double time)
{
    double periods = time / (double)d->period + (double)d->phase;
    periods -= (double)(int64_t)periods;
    if (periods < 0) periods += 1;
    return (float)periods;
}

static void pose_node(es_world* world, const es_mover_desc* d, double time)
{
    es_transform transform;
    if (es_world_get_node_transform(world, d->node, &transform) != ES_OK) return;
    float angle = turn * phase_at(d, time);
    if (d->type == ES_MOVER_SWING) angle = d->amplitude * es_sin(angle);
    es_quat turned = es_quat_from_axis_angle(d->axis, angle);
    transform.translation = es_v3_add(d->centre, es_quat_rotate(turned, d->arm));
    if (!d->keep_rotation) transform.rotation = es_quat_normalize(es_quat_mul(turned, d->rotation));
    es_world_set_node_transform(world, d->node, &transform);
}

/* Turns the node's -z to the target, its x level in the world; in its parent's axes, of which the rotation alone counts. */
static void aim_node(es_world* world, const es_mover_desc* d)
{
    const es_node_object* node = es_slots_get(&world->slots[ES_OBJECT_NODE], d->node.id);
    es_transform transform = node->transform;
    float to[3];
    for (int k = 0; k < 3; k++) {
        double place = d->target.id ? es_node_position(world, d->target)[k] : (double)(&d->centre.x)[k];
        to[k] = (float)(place - node->position[k]);
    }
    float level = es_sqrt(to[0] * to[0] + to[2] * to[2]);
    if (!(level + es_absf(to[1]) > 0)) return;
    float yaw = level > 0 ? es_atan2(-to[0], -to[2]) : 0, pitch = es_atan2(to[1], level);
    es_quat wanted = es_quat_mul(es_quat_from_axis_angle(es_v3(0, 1, 0), yaw), es_quat_from_axis_angle(es_v3(1, 0, 0), pitch));
    es_quat parents = es_quat_identity();
    for (uint32_t id = node->parent.id; id;) {
        const es_node_object* parent = es_slots_get(&world->slots[ES_OBJECT_NODE], id);
        parents = es_quat_mul(parent->transform.rotation, parents);
        id = parent->parent.id;
    }
    es_quat back = {-parents.x, -parents.y, -parents.z, parents.w};
    transform.rotation = es_quat_normalize(es_quat_mul(back, wanted));
    es_world_set_node_transform(world, d->node, &transform);
}

/* Smooth noise, [0, 1): values of a hash at whole numbers, eased between, in three octaves. */
static float noise(uint32_t seed, double u)
{
    float sum = 0, weight = 4.0f / 7.0f;
    for (uint32_t octave = 0; octave < 3; octave++) {
        int64_t whole = (int64_t)u;
        if (u < (double)whole) whole--;
        float f = (float)(u - (double)whole), ease = f * f * (3 - 2 * f);
        float a = es_random_float(seed + octave, (uint32_t)whole), b = es_random_float(seed + octave, (uint32_t)whole + 1);
        sum += weight * ((1 - ease) * a + ease * b);
        weight *= 0.5f;
        u *= 2;
    }
    return sum;
}

static void flicker_light(es_world* world, const es_mover_desc* d, double time)
{
    es_light_object* light = es_slots_get(&world->slots[ES_OBJECT_LIGHT], d->light.id);
    float dimmed = d->off ? 0 : d->amplitude * noise(d->seed, time / (double)d->period + (double)d->phase);
    if (light->dimmed == dimmed) return;
    light->dimmed = dimmed;
    world->lights_dirty = true;
}

void es_movers_play(es_world* world, double time)
{
    const es_slots* slots = &world->slots[ES_OBJECT_MOVER];
    if (!slots->live) return;
    bool aims = false;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_mover_object* mover = es_slots_at(slots, slot);
        if (!mover) continue;
        if (mover->desc.type == ES_MOVER_FLICKER) flicker_light(world, &mover->desc, time);
        else if (mover->desc.off) continue;
        else if (mover->desc.type == ES_MOVER_AIM) aims = true;
        else pose_node(world, &mover->desc, time);
    }
    if (!aims) return;
    es_nodes_refresh(world);
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_mover_object* mover = es_slots_at(slots, slot);
        if (mover && mover->desc.type == ES_MOVER_AIM && !mover->desc.off) aim_node(world, &mover->desc);
    }
}
