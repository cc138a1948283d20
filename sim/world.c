/* The world: its life, its steps, its objects by kind. */
#include "sim/world.h"

#include <string.h>

#include "platform/maths.h"
#include "platform/settings.h"
#include "sim/edits/edits.h"
#include "sim/rigid/rigid.h"
#include "sim/soft/soft.h"

/* ---- handles ------------------------------------------------------------------------------------------------------------ */

static const struct { const char* name; size_t size; uint32_t limit; } kinds[ES_OBJECT_KINDS] = {
    [ES_OBJECT_TEXTURE] = {"texture", sizeof(es_texture_object), ES_SLOT_LIMIT},
    [ES_OBJECT_MATERIAL] = {"material", sizeof(es_material_object), 65535},  /* indices below 65536, the default's included */
    [ES_OBJECT_MESH] = {"mesh", sizeof(es_mesh_object), ES_SLOT_LIMIT},
    [ES_OBJECT_NODE] = {"node", sizeof(es_node_object), ES_SLOT_LIMIT},
    [ES_OBJECT_INSTANCE] = {"instance", sizeof(es_instance_object), ES_SLOT_LIMIT},
    [ES_OBJECT_CAMERA] = {"camera", sizeof(es_camera_object), ES_SLOT_LIMIT},
    [ES_OBJECT_LIGHT] = {"light", sizeof(es_light_object), ES_SLOT_LIMIT},
    [ES_OBJECT_CLIP] = {"clip", sizeof(es_clip_object), ES_SLOT_LIMIT},
    [ES_OBJECT_MOVER] = {"mover", sizeof(es_mover_object), ES_SLOT_LIMIT},
    [ES_OBJECT_SKIN] = {"skin", sizeof(es_skin_object), ES_SLOT_LIMIT},
    [ES_OBJECT_BODY] = {"body", sizeof(es_body_object), ES_SLOT_LIMIT},
    [ES_OBJECT_SOFT] = {"soft body", sizeof(es_soft_object), ES_SLOT_LIMIT},
    [ES_OBJECT_JOINT] = {"joint", sizeof(es_joint_object), ES_SLOT_LIMIT},
    [ES_OBJECT_REGION] = {"region", sizeof(es_region_object), ES_EDIT_REGIONS},
    [ES_OBJECT_CONSTRAINT] = {"constraint", sizeof(es_constraint_object), ES_EDIT_CONSTRAINTS},
};

void* es_world_object(const es_world* world, es_object_kind kind, uint32_t id)
{
    void* object = es_slots_get(&world->slots[kind], id);
    if (!object) es_misuse(world->context, ES_STALE_HANDLE, "%s handle %08x is %s", kinds[kind].name, id, id ? "stale" : "null");
    return object;
}

void es_world_rereference(es_world* world, es_object_kind kind, uint32_t from, uint32_t to)
{
    es_object* old = es_slots_get(&world->slots[kind], from);
    es_object* new = es_slots_get(&world->slots[kind], to);
    if (new) new->references++;
    if (old) old->references--;
}

es_result es_world_enumerate(const es_world* world, es_object_kind kind, uint32_t* ids, size_t* count)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!count || (uint32_t)kind >= ES_OBJECT_KINDS) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_enumerate: a kind below %d and a count are needed", ES_OBJECT_KINDS);
    const es_slots* slots = &world->slots[kind];
    size_t capacity = *count, written = 0;
    *count = slots->live;
    if (!ids) return ES_OK;
    if (capacity < slots->live) return es_fail(world->context, ES_INVALID_ARGUMENT, "there are %u objects of kind %s, room was given for %zu", slots->live, kinds[kind].name, capacity);
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        const es_object* object = es_slots_at(slots, slot);
        if (object) ids[written++] = object->id;
    }
    return ES_OK;
}

const char* es_world_name(const es_world* world, es_object_kind kind, uint32_t id)
{
    if (!world || (uint32_t)kind >= ES_OBJECT_KINDS) return NULL;
    const es_object* object = es_world_object(world, kind, id);
    return object ? object->name ? object->name : "" : NULL;
}

/* ---- life ------------------------------------------------------------------------------------------------------------------ */

es_result es_world_create(es_context* context, const es_world_settings* settings, es_world** world)
{
    if (!context || !world) return ES_INVALID_ARGUMENT;
    *world = NULL;
    es_world_settings resolved;
    es_result result = es_world_settings_resolve(context, settings, &resolved);
    if (result != ES_OK) return result;
    es_world* w = es_allocate_zero(context, sizeof *w);
    if (!w) return es_context_last_result(context);
    w->context = context;
    w->settings = resolved;
    for (int kind = 0; kind < ES_OBJECT_KINDS; kind++) es_slots_init(&w->slots[kind], kinds[kind].size, kinds[kind].limit);
    if (!es_grow(context, (void**)&w->materials, &w->material_capacity, 0, 1, sizeof *w->materials)) {
        es_release(context, w, sizeof *w);
        return es_context_last_result(context);
    }
    w->materials[0] = es_default_material_desc();
    w->list.materials = w->materials;
    w->list.material_count = 1;
    /* counted from a number no other world of the context reaches, so that equal revisions mean the same world too */
    uint64_t first = es_context_next_serial(context) << 32;
    w->revisions = (es_world_revisions){first, first, first, first, first, first, first, false};
    es_context_count_object(context, 1);
    *world = w;
    return ES_OK;
}

void es_world_destroy(es_world* world)
{
    if (!world) return;
    es_context* context = world->context;
    if (world->in_step) {
        es_misuse(context, ES_WRONG_STATE, "es_world_destroy: called from a step function; the world is kept");
        return;
    }
    es_recording_end(world->recording);
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_TEXTURE].slot_count; slot++) {
        es_texture_object* texture = es_slots_at(&world->slots[ES_OBJECT_TEXTURE], slot);
        if (texture) es_texture_image_destroy(context, &texture->image);
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_SOFT].slot_count; slot++) {
        es_soft_object* soft = es_slots_at(&world->slots[ES_OBJECT_SOFT], slot);
        if (soft) es_soft_free(world, soft);
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_SKIN].slot_count; slot++) {
        es_skin_object* skin = es_slots_at(&world->slots[ES_OBJECT_SKIN], slot);
        if (skin) es_skin_object_free(world, skin);
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_MESH].slot_count; slot++) {
        es_mesh_object* mesh = es_slots_at(&world->slots[ES_OBJECT_MESH], slot);
        if (mesh) es_mesh_object_free(world, mesh);
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_CLIP].slot_count; slot++) {
        es_clip_object* clip = es_slots_at(&world->slots[ES_OBJECT_CLIP], slot);
        if (clip) es_world_destroy_clip(world, (es_clip){clip->object.id});
    }
    es_rigid_free(world);
    es_edits_free(world);
    for (int kind = 0; kind < ES_OBJECT_KINDS; kind++) es_slots_free(context, &world->slots[kind]);
    es_environment_free(world);
    es_release(context, world->order, world->order_capacity * sizeof *world->order);
    es_release(context, world->drawn, world->drawn_capacity * sizeof *world->drawn);
    es_release(context, world->materials, world->material_capacity * sizeof *world->materials);
    es_release(context, world->lights, world->light_capacity * sizeof *world->lights);
    es_release(context, world, sizeof *world);
    es_context_count_object(context, -1);
}

es_context* es_world_context(const es_world* world) { return world ? world->context : NULL; }
double es_world_time(const es_world* world) { return world ? world->time : 0; }

void es_world_set_step_function(es_world* world, es_world_step_function function, void* user)
{
    if (!world) return;
    world->step_function = function;
    world->step_user = user;
}

/* ---- refreshing ---------------------------------------------------------------------------------------------------------------- */

/* Getters are const to their callers; what they compute late is the same whenever it is computed. */
void es_world_refresh(const es_world* world)
{
    es_world* w = (es_world*)world;
    if (!(w->nodes_dirty || w->order_dirty || w->poses_dirty || w->list_dirty || w->lights_dirty || w->camera_dirty)) return;
    es_fp_environment environment = es_fp_enter();
    es_nodes_refresh(w);
    es_meshes_refresh(w);
    if (es_origin_refresh(w)) w->list_dirty = w->lights_dirty = w->camera_dirty = true;
    es_draw_list_refresh(w);
    es_lights_refresh(w);
    es_camera_refresh(w);
    es_fp_leave(environment);
}

void es_world_settle(es_world* world)
{
    es_world_refresh(world);
    es_meshes_settle(world);
    if (world->nodes_moving) {
        world->nodes_moving = false;
        world->list_dirty = world->camera_dirty = true;
        for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_NODE].slot_count; slot++) {
            es_node_object* node = es_slots_at(&world->slots[ES_OBJECT_NODE], slot);
            if (node) es_node_settle(node);
        }
    }
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_CAMERA].slot_count; slot++) {
        es_camera_object* camera = es_slots_at(&world->slots[ES_OBJECT_CAMERA], slot);
        if (!camera) continue;
        camera->previous = camera->desc;
        camera->previous_world = *es_node_world(world, camera->desc.node);
        memcpy(camera->previous_position, es_node_position(world, camera->desc.node), sizeof camera->previous_position);
        world->camera_dirty |= world->camera_moving;
    }
}

es_world_revisions es_world_get_revisions(const es_world* world)
{
    if (!world) return (es_world_revisions){0};
    if (world->edits) es_edits_refresh((es_world*)world);
    else es_world_refresh(world);
    es_world_revisions revisions = world->revisions;
    revisions.moving = world->instances_moving || world->camera_moving;
    return revisions;
}

/* ---- opening --------------------------------------------------------------------------------------------------------------------- */

static void choose_clips(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_CLIP];
    uint32_t number = 0;
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_clip_object* clip = es_slots_at(slots, slot);
        if (!clip) continue;
        number++;
        clip->playing = world->settings.clip == 0 || world->settings.clip == number;
        clip->play.start = clip->play.fade_start = world->time;
        for (uint32_t i = 0; i < clip->track_count && world->settings.clip == 0; i++) {
            uint32_t played_by = *es_clip_played_by(world, &clip->tracks[i].channel);
            if (played_by && played_by != clip->object.id) clip->playing = false;
        }
        for (uint32_t i = 0; i < clip->track_count && clip->playing; i++) *es_clip_played_by(world, &clip->tracks[i].channel) = clip->object.id;
    }
}

es_result es_world_finish_opening(es_world* world)
{
    uint32_t cameras = world->slots[ES_OBJECT_CAMERA].live, clips = world->slots[ES_OBJECT_CLIP].live;
    if (cameras == 1 && world->settings.camera > 0) return es_fail(world->context, ES_SETTING_VALUE, "setting world.camera: %u; there is camera 0 alone", world->settings.camera);
    if (cameras && world->settings.camera >= cameras)
        return es_fail(world->context, ES_SETTING_VALUE, "setting world.camera: %u; there are cameras 0 … %u", world->settings.camera, cameras - 1);
    if (world->settings.clip > clips)
        return es_fail(world->context, ES_SETTING_VALUE, "setting world.clip: %u; there %s %u clip%s", world->settings.clip, clips == 1 ? "is" : "are", clips, clips == 1 ? "" : "s");
    for (uint32_t slot = 0, number = 0; slot < world->slots[ES_OBJECT_CAMERA].slot_count; slot++) {
        const es_object* camera = es_slots_at(&world->slots[ES_OBJECT_CAMERA], slot);
        if (camera && number++ == world->settings.camera) es_world_set_active_camera(world, (es_camera){camera->id});
    }
    choose_clips(world);
    es_fp_environment environment = es_fp_enter();
    es_clips_play(world, world->time);
    es_movers_play(world, world->time);
    es_fp_leave(environment);
    es_world_settle(world);
    es_world_refresh(world);
    return ES_OK;
}
