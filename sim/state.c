/* Saving, restoring and hashing what moves.
 *
 * One function visits every piece of state in slot order; it counts, writes, hashes, checks or applies, so the five can
 * never disagree about the layout. A saved state carries a signature of the world's content (which objects exist, how
 * large their meshes are) and a hash of itself: another world's or a damaged buffer is refused before anything is touched. */
#include "sim/recording.h"
#include "sim/state_io.h"

#include "sim/edits/edit_state.h"
#include "sim/soft/soft_state.h"
#include "sim/rigid/rigid_state.h"

static void visit_node(es_world* world, state_io* io, es_node_object* node)
{
    es_transform transform = node->transform, resolved;
    es_mat4 previous = node->previous;
    double previous_position[3];
    memcpy(previous_position, node->previous_position, sizeof previous_position);
    visit_floats(io, &transform.translation.x, 3);
    visit_floats(io, &transform.rotation.x, 4);
    visit_floats(io, &transform.scale.x, 3);
    visit_floats(io, previous.m, 16);
    visit_position(io, previous_position);
    if (!reading(io) || !io->good) return;
    io->good = es_transform_resolve(&transform, &resolved);
    if (io->mode != APPLY) return;
    node->transform = transform;
    node->previous = previous;
    memcpy(node->previous_position, previous_position, sizeof previous_position);
    node->dirty = world->nodes_dirty = true;
}

static void visit_instance(es_world* world, state_io* io, es_instance_object* instance)
{
    es_instance_desc desc = instance->desc;
    visit_u32(io, &desc.node.id);
    visit_u32(io, &desc.mesh.id);
    visit_u32(io, &desc.material.id);
    visit_flag(io, &desc.hidden);
    if (!reading(io) || !io->good) return;
    io->good = es_slots_get(&world->slots[ES_OBJECT_MESH], desc.mesh.id) && (!desc.node.id || es_slots_get(&world->slots[ES_OBJECT_NODE], desc.node.id)) &&
               (!desc.material.id || es_slots_get(&world->slots[ES_OBJECT_MATERIAL], desc.material.id));
    if (io->good && io->mode == APPLY) es_world_set_instance(world, (es_instance){instance->object.id}, &desc);
}

static void visit_lens(es_world* world, state_io* io, es_camera_desc* desc)
{
    es_camera_desc now = *desc, resolved;
    visit_u32(io, &now.node.id);
    visit_flag(io, &now.orthographic);
    visit_floats(io, &now.fov_y, 1);
    visit_floats(io, &now.half_height, 1);
    visit_floats(io, &now.near_plane, 1);
    visit_floats(io, &now.far_plane, 1);
    if (!reading(io) || !io->good) return;
    io->good = es_camera_desc_resolve(world, &now, &resolved);
    if (io->good) *desc = now;
}

static void visit_camera(es_world* world, state_io* io, es_camera_object* camera)
{
    es_camera_desc desc = camera->desc, previous = camera->previous;
    es_mat4 previous_world = camera->previous_world;
    double previous_position[3];
    memcpy(previous_position, camera->previous_position, sizeof previous_position);
    visit_lens(world, io, &desc);
    previous.node = desc.node; /* last frame's node may be gone; its matrix is what counts */
    visit_lens(world, io, &previous);
    visit_floats(io, previous_world.m, 16);
    visit_position(io, previous_position);
    if (io->mode != APPLY || !io->good) return;
    es_world_set_camera(world, (es_camera){camera->object.id}, &desc);
    camera->previous = previous;
    camera->previous_world = previous_world;
    memcpy(camera->previous_position, previous_position, sizeof previous_position);
}

static void visit_light(es_world* world, state_io* io, es_light_object* light)
{
    es_light_desc desc = light->desc, resolved;
    uint32_t type = desc.type;
    visit_u32(io, &desc.node.id);
    visit_u32(io, &type);
    visit_floats(io, desc.color, 3);
    visit_floats(io, &desc.intensity, 1);
    visit_floats(io, &desc.inner_cone, 1);
    visit_floats(io, &desc.outer_cone, 1);
    visit_floats(io, &desc.range, 1);
    visit_flag(io, &desc.off);
    float dimmed = light->dimmed;
    visit_floats(io, &dimmed, 1);
    if (!reading(io) || !io->good) return;
    io->good = type <= ES_LIGHT_DIRECTIONAL && es_within(dimmed, 0, 1);
    desc.type = (es_light_type)type;
    io->good = io->good && es_light_desc_resolve(world, &desc, &resolved);
    if (io->good && io->mode == APPLY) {
        light->dimmed = dimmed;
        es_world_set_light(world, (es_light){light->object.id}, &desc);
    }
}

/* Checked one by one: what is there must not be touched before everything is known to be good. */
static void visit_numbers(state_io* io, float* numbers, size_t count, float limit)
{
    if (io->mode != CHECK) {
        visit_floats(io, numbers, count);
        return;
    }
    for (size_t i = 0; i < count && io->good; i++) {
        float number = 0;
        visit_floats(io, &number, 1);
        io->good &= es_within(number, -limit, limit);
    }
}

static void visit_stream(state_io* io, float* stream, size_t floats)
{
    if (io->mode != CHECK) {
        visit_floats(io, stream, floats);
        return;
    }
    float four[4];
    for (size_t i = 0; i < floats && io->good; i += 4) {
        visit_floats(io, four, 4);
        io->good &= es_all_within(four, 4, ES_WORLD_EXTENT);
    }
}

/* What decides where a driven mesh's vertices are and were; they themselves follow. */
static void visit_driven_mesh(es_world* world, state_io* io, es_mesh_object* mesh)
{
    es_mesh_drive* drive = mesh->drive;
    const es_skin_object* skin = es_slots_get(&world->slots[ES_OBJECT_SKIN], drive->skin);
    bool moving = mesh->moving;
    visit_flag(io, &moving);
    visit_numbers(io, drive->weights, drive->target_count, ES_MORPH_WEIGHT);
    if (moving) visit_numbers(io, drive->previous_weights, drive->target_count, ES_MORPH_WEIGHT);
    if (moving && skin) visit_numbers(io, skin->previous_palette, (size_t)skin->joint_count * ES_JOINT_FLOATS, ES_WORLD_EXTENT);
    if (io->mode != APPLY) return;
    mesh->moving = moving;
    es_mesh_restored(world, mesh);
}

static void visit_mesh(es_world* world, state_io* io, es_mesh_object* mesh)
{
    if (mesh->drive) {
        visit_driven_mesh(world, io, mesh);
        return;
    }
    bool deformed = mesh->deformed, moving = mesh->moving;
    size_t floats = 4 * (((size_t)mesh->raster.vertex_count + 7) / 8 * 8);
    if (floats == 0) floats = 32;
    visit_flag(io, &deformed);
    visit_flag(io, &moving);
    if (reading(io) && (!io->good || (moving && !deformed))) {
        io->good = false;
        return;
    }
    if (reading(io) && deformed && !es_mesh_make_deformable(world, mesh)) {
        io->good = false;
        io->no_memory = true;
        return;
    }
    if (io->mode == APPLY && mesh->deformed && !deformed) {
        memcpy(mesh->positions, mesh->rest, floats * sizeof(float));
        if (mesh->normals) memcpy(mesh->normals, mesh->rest_normals, floats * sizeof(float));
    }
    if (io->mode == APPLY && (mesh->deformed || deformed)) world->geometry_touched = world->list_dirty = true;
    if (deformed) {
        visit_stream(io, mesh->positions, floats);
        if (mesh->normals) visit_stream(io, mesh->normals, floats);
        if (moving) visit_stream(io, mesh->previous, floats);
    }
    if (io->mode != APPLY) return;
    mesh->deformed = deformed;
    mesh->moving = moving;
    es_mesh_restored(world, mesh);
}

static void visit_clip(state_io* io, es_clip_object* clip)
{
    bool playing = clip->playing;
    es_clip_playing play = clip->play;
    visit_flag(io, &playing);
    transfer(io, &play.start, sizeof play.start);
    transfer(io, &play.offset, sizeof play.offset);
    transfer(io, &play.fade_start, sizeof play.fade_start);
    visit_floats(io, &play.speed, 1);
    visit_floats(io, &play.from, 1);
    visit_floats(io, &play.to, 1);
    visit_floats(io, &play.fade, 1);
    visit_flag(io, &play.once);
    if (!reading(io) || !io->good) return;
    io->good = es_clip_playing_valid(&play);
    if (io->mode != APPLY) return;
    clip->playing = playing;
    clip->play = play;
}

static void visit_mover(es_world* world, state_io* io, es_mover_object* mover)
{
    es_mover_desc desc = mover->desc;
    uint32_t type = desc.type;
    visit_u32(io, &type);
    visit_u32(io, &desc.node.id);
    visit_u32(io, &desc.target.id);
    visit_u32(io, &desc.light.id);
    visit_floats(io, &desc.centre.x, 3);
    visit_floats(io, &desc.arm.x, 3);
    visit_floats(io, &desc.axis.x, 3);
    visit_floats(io, &desc.rotation.x, 4);
    visit_flag(io, &desc.keep_rotation);
    visit_floats(io, &desc.period, 1);
    visit_floats(io, &desc.phase, 1);
    visit_floats(io, &desc.amplitude, 1);
    visit_u32(io, &desc.seed);
    visit_flag(io, &desc.off);
    if (!reading(io) || !io->good) return;
    io->good = type <= ES_MOVER_FLICKER;
    desc.type = (es_mover_type)type;
    bool light = desc.type == ES_MOVER_FLICKER;
    io->good = io->good && es_mover_numbers_valid(&desc) && es_mover_is_resolved(&desc) && (es_slots_get(&world->slots[ES_OBJECT_LIGHT], desc.light.id) != NULL) == light &&
               (es_slots_get(&world->slots[ES_OBJECT_NODE], desc.node.id) != NULL) == !light && (!desc.target.id || es_slots_get(&world->slots[ES_OBJECT_NODE], desc.target.id));
    io->good = io->good && (light ? !desc.node.id && !desc.target.id : !desc.light.id);
    if (io->good && io->mode == APPLY) es_mover_put(world, mover, &desc); /* not es_world_set_mover: what is normalised again may change its last bits */
}

/* The image is an asset; its size is in the signature of the content. */
static void visit_environment(es_world* world, state_io* io)
{
    float radiance[3], rotation = world->environment_rotation;
    memcpy(radiance, world->environment_radiance, sizeof radiance);
    visit_floats(io, radiance, 3);
    visit_floats(io, &rotation, 1);
    es_visit_sky(world, io);
    if (!reading(io) || !io->good) return;
    io->good = es_environment_numbers_valid(radiance, rotation);
    if (!io->good || io->mode != APPLY || world->sky.on) return;
    const es_image* image = world->environment_image.pixels ? &world->environment_image : NULL;
    es_world_set_environment(world, &(es_environment_desc){.image = image, .radiance = {radiance[0], radiance[1], radiance[2]}, .rotation = rotation});
}

static void visit_object(es_world* world, state_io* io, es_object_kind kind, void* object)
{
    switch (kind) {
    case ES_OBJECT_NODE: visit_node(world, io, object); break;
    case ES_OBJECT_INSTANCE: visit_instance(world, io, object); break;
    case ES_OBJECT_CAMERA: visit_camera(world, io, object); break;
    case ES_OBJECT_LIGHT: visit_light(world, io, object); break;
    case ES_OBJECT_MOVER: visit_mover(world, io, object); break;
    case ES_OBJECT_CLIP: visit_clip(io, object); break;
    case ES_OBJECT_MESH: visit_mesh(world, io, object); break;
    case ES_OBJECT_BODY: es_visit_body(world, io, object); break;
    case ES_OBJECT_JOINT: es_visit_joint(world, io, object); break;
    case ES_OBJECT_SOFT: es_visit_soft(world, io, object); break;
    case ES_OBJECT_REGION: es_visit_region(io, object); break;
    case ES_OBJECT_CONSTRAINT: es_visit_constraint(io, object); break;
    default: break; /* assets: nothing of them moves */
    }
}

static void visit_world(es_world* world, state_io* io)
{
    double time = world->time, fixed_base = world->fixed_base;
    uint64_t fixed_count = world->fixed_count;
    es_world_settings settings = world->settings, resolved;
    bool stepped = world->stepped;
    es_camera active = world->active_camera;
    transfer(io, &time, sizeof time);
    transfer(io, &fixed_base, sizeof fixed_base);
    transfer(io, &fixed_count, sizeof fixed_count);
    visit_floats(io, &settings.speed, 1);
    visit_floats(io, &settings.step, 1);
    visit_u32(io, &settings.substeps);
    visit_flag(io, &settings.interpolate);
    visit_flag(io, &settings.sleep);
    visit_floats(io, &settings.gravity.x, 3);
    visit_flag(io, &stepped);
    visit_u32(io, &active.id);
    /* dynamics that lag by more than the longest step at the highest speed would have to catch up for ever */
    if (reading(io) && io->good) io->good = time >= 0 && time <= 1e12 && fixed_base >= 0 && fixed_base <= 1e12 && fixed_count <= 1ull << 53 && time - fixed_base - (double)fixed_count * (double)settings.step <= 1001 && es_world_settings_resolve(world->context, &settings, &resolved) == ES_OK && (!active.id || es_slots_get(&world->slots[ES_OBJECT_CAMERA], active.id));
    if (io->mode == APPLY && io->good) {
        world->time = time;
        world->fixed_base = fixed_base;
        world->fixed_count = fixed_count;
        world->settings = settings;
        world->stepped = stepped;
        world->active_camera = active;
        world->camera_dirty = world->nodes_moving = world->list_dirty = true;
    }
    visit_environment(world, io);
    static const es_object_kind kinds[] = {ES_OBJECT_NODE, ES_OBJECT_INSTANCE, ES_OBJECT_CAMERA, ES_OBJECT_LIGHT, ES_OBJECT_MOVER, ES_OBJECT_CLIP, ES_OBJECT_MESH, ES_OBJECT_BODY, ES_OBJECT_JOINT, ES_OBJECT_SOFT};
    for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++)
        for (uint32_t slot = 0; slot < world->slots[kinds[k]].slot_count && (io->good || !reading(io)); slot++) {
            void* object = es_slots_at(&world->slots[kinds[k]], slot);
            if (object) visit_object(world, io, kinds[k], object);
        }
    es_visit_rigid(world, io);
}

static uint64_t content_signature(const es_world* world)
{
    uint64_t hash = 0;
    for (int kind = 0; kind < ES_OBJECT_KINDS; kind++) {
        if (kind == ES_OBJECT_REGION || kind == ES_OBJECT_CONSTRAINT) continue; /* whole in the state */
        const es_slots* slots = &world->slots[kind];
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            const es_object* object = es_slots_at(slots, slot);
            uint32_t words[4] = {object ? object->id : 0, 0, 0, 0};
            if (object && kind == ES_OBJECT_MESH) {
                const es_raster_mesh* mesh = &((const es_mesh_object*)object)->raster;
                words[1] = mesh->vertex_count;
                words[2] = mesh->triangle_count;
                const es_mesh_drive* drive = ((const es_mesh_object*)object)->drive;
                words[3] = drive ? drive->target_count + 1 : 0;
            }
            if (object && kind == ES_OBJECT_SKIN) {
                words[1] = ((const es_skin_object*)object)->mesh.id;
                words[2] = ((const es_skin_object*)object)->joint_count;
            }
            if (object && kind == ES_OBJECT_BODY) es_body_signature((const es_body_object*)object, words + 1);
            if (object && kind == ES_OBJECT_SOFT) es_soft_signature((const es_soft_object*)object, words + 1);
            if (object && kind == ES_OBJECT_JOINT) es_joint_signature((const es_joint_object*)object, words + 1);
            hash = es_hash_bytes(hash, words, sizeof words);
        }
        hash = es_hash_bytes(hash, &kind, sizeof kind);
    }
    uint32_t environment[2] = {world->environment_image.width, world->environment_image.height};
    if (world->sky.on) hash++;
    return es_hash_bytes(hash, environment, sizeof environment);
}

typedef struct state_header { char magic[8]; uint64_t content, payload; } state_header;
static const char magic[8] = {'E', 'S', 'W', 'O', 'R', 'L', 'D', '4'};

es_result es_world_save(const es_world* world, void* buffer, size_t* size)
{
    if (!world || !size) return ES_INVALID_ARGUMENT;
    es_world_refresh(world);
    es_world* w = (es_world*)world; /* nothing is written to it in these modes */
    state_io io = {.mode = COUNT, .good = true};
    visit_world(w, &io);
    const size_t moving = io.at, edits = es_edits_write(world, true, NULL);
    size_t needed = sizeof(state_header) + moving + edits, capacity = *size;
    *size = needed;
    if (!buffer) return ES_OK;
    if (capacity < needed) return es_fail(world->context, ES_INVALID_ARGUMENT, "the world's state takes %zu bytes, room was given for %zu", needed, capacity);
    io = (state_io){.mode = WRITE, .bytes = (char*)buffer + sizeof(state_header), .good = true};
    visit_world(w, &io);
    if (edits) es_edits_write(world, true, io.bytes + moving);
    state_header header = {.content = content_signature(world), .payload = es_hash_bytes(0, io.bytes, moving + edits)};
    memcpy(header.magic, magic, sizeof magic);
    memcpy(buffer, &header, sizeof header);
    return ES_OK;
}

es_result es_world_restore(es_world* world, const void* buffer, size_t size)
{
    if (!world || !buffer) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    state_header header;
    if (size < sizeof header || memcmp(buffer, magic, sizeof magic) != 0) return es_fail(context, ES_FILE_TYPE, "restoring a world: the buffer is not a saved world state");
    memcpy(&header, buffer, sizeof header);
    es_world_refresh(world);
    if (header.content != content_signature(world)) return es_fail(context, ES_WRONG_STATE, "restoring a world: the state was saved from a world with other content");
    char* payload = (char*)buffer + sizeof header; /* only read */
    size_t payload_size = size - sizeof header;
    if (header.payload != es_hash_bytes(0, payload, payload_size)) return es_fail(context, ES_FILE_DAMAGED, "restoring a world: the saved state is damaged");
    state_io io = {.mode = CHECK, .bytes = payload, .size = payload_size, .good = true};
    visit_world(world, &io);
    if (io.no_memory) return es_context_last_result(context);
    es_edit_stage* edits = NULL;
    es_result staged = io.good ? es_edits_stage(world, true, payload + io.at, payload_size - io.at, &edits) : ES_FILE_DAMAGED;
    if (staged == ES_FILE_DAMAGED) return es_fail(context, staged, "restoring a world: the saved state is damaged");
    if (staged != ES_OK) return staged;
    io = (state_io){.mode = APPLY, .bytes = payload, .size = payload_size, .good = true};
    es_recording* recording = es_recording_pause(world); /* it is one input, not those it is made of */
    es_fp_environment environment = es_fp_enter();
    visit_world(world, &io);
    if (io.good) es_sky_refresh(world);
    es_edits_take(world, edits);
    es_fp_leave(environment);
    world->revisions.steps += 2;
    es_world_refresh(world);
    es_recording_resume(world, recording);
    if (!io.good) return es_context_last_result(context);
    if (recording) es_note(world, &(es_input){.type = ES_INPUT_RESTORE, .state = {buffer, size}});
    return ES_OK;
}

uint64_t es_world_hash(const es_world* world)
{
    if (!world) return 0;
    es_world_refresh(world);
    state_io io = {.mode = HASH, .hash = content_signature(world), .good = true};
    visit_world((es_world*)world, &io);
    return es_edits_hash(world, io.hash);
}

uint64_t es_world_object_hash(const es_world* world, es_object_kind kind, uint32_t id)
{
    if (!world || (uint32_t)kind >= ES_OBJECT_KINDS) return 0;
    void* object = es_world_object(world, kind, id);
    if (!object) return 0;
    es_world_refresh(world);
    state_io io = {.mode = HASH, .hash = id, .good = true};
    visit_object((es_world*)world, &io, kind, object);
    return io.hash;
}
