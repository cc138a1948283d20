/* Recording and replay: what a user did between steps, and hashes of what came of it.
 *
 * A recording begins with a saved state, so it can begin at any time, and holds for each step its dt, the inputs before it, the world's
 * hash after it and a short hash of every object. Replaying applies the same inputs to the same state; the first hash that differs names
 * the step, and the short hashes the object. */
#include "sim/recording.h"

#include "sim/edits/edit_state.h"

/* What a difference is looked for in: causes before what they cause. */
static const es_object_kind compared[] = {ES_OBJECT_BODY, ES_OBJECT_JOINT, ES_OBJECT_SOFT, ES_OBJECT_CLIP, ES_OBJECT_MOVER, ES_OBJECT_NODE, ES_OBJECT_LIGHT, ES_OBJECT_CAMERA, ES_OBJECT_INSTANCE, ES_OBJECT_MESH, ES_OBJECT_REGION, ES_OBJECT_CONSTRAINT};
enum { COMPARED = sizeof compared / sizeof compared[0] };

/* ---- inputs ---------------------------------------------------------------------------------------------------------- */

static void visit_vector(state_io* io, es_vec3* v) { visit_floats(io, &v->x, 3); }
static void visit_rotation(state_io* io, es_quat* q) { visit_floats(io, &q->x, 4); }

static void visit_joint(state_io* io, es_joint_desc* d)
{
    uint32_t type = d->type;
    visit_u32(io, &type);
    d->type = (es_joint_type)(type <= ES_JOINT_MOTOR ? type : 0);
    if (reading(io)) io->good &= type <= ES_JOINT_MOTOR;
    visit_u32(io, &d->a.id);
    visit_u32(io, &d->b.id);
    visit_vector(io, &d->position_a);
    visit_vector(io, &d->position_b);
    visit_rotation(io, &d->rotation_a);
    visit_rotation(io, &d->rotation_b);
    visit_flag(io, &d->collide_connected);
    visit_flag(io, &d->limit);
    visit_floats(io, &d->lower, 1);
    visit_floats(io, &d->upper, 1);
    visit_flag(io, &d->motor);
    visit_floats(io, &d->speed, 1);
    visit_floats(io, &d->length, 1);
    visit_floats(io, &d->hertz, 1);
    visit_floats(io, &d->damping_ratio, 1);
    visit_vector(io, &d->velocity);
    visit_vector(io, &d->angular_velocity);
    visit_floats(io, &d->max_force, 1);
    visit_floats(io, &d->max_torque, 1);
    visit_floats(io, &d->break_force, 1);
    visit_floats(io, &d->break_torque, 1);
}

static void visit_light(state_io* io, es_light_desc* d)
{
    uint32_t type = d->type;
    visit_u32(io, &type);
    d->type = (es_light_type)(type <= ES_LIGHT_DIRECTIONAL ? type : 0);
    if (reading(io)) io->good &= type <= ES_LIGHT_DIRECTIONAL;
    visit_u32(io, &d->node.id);
    visit_floats(io, d->color, 3);
    visit_floats(io, &d->intensity, 1);
    visit_floats(io, &d->inner_cone, 1);
    visit_floats(io, &d->outer_cone, 1);
    visit_floats(io, &d->range, 1);
    visit_flag(io, &d->off);
}

static void visit_camera(state_io* io, es_camera_desc* d)
{
    visit_u32(io, &d->node.id);
    visit_flag(io, &d->orthographic);
    visit_floats(io, &d->fov_y, 1);
    visit_floats(io, &d->half_height, 1);
    visit_floats(io, &d->near_plane, 1);
    visit_floats(io, &d->far_plane, 1);
}

static void visit_mover(state_io* io, es_mover_desc* d)
{
    uint32_t type = d->type;
    visit_u32(io, &type);
    d->type = (es_mover_type)(type <= ES_MOVER_FLICKER ? type : 0);
    if (reading(io)) io->good &= type <= ES_MOVER_FLICKER;
    visit_u32(io, &d->node.id);
    visit_u32(io, &d->target.id);
    visit_u32(io, &d->light.id);
    visit_vector(io, &d->centre);
    visit_vector(io, &d->arm);
    visit_vector(io, &d->axis);
    visit_rotation(io, &d->rotation);
    visit_flag(io, &d->keep_rotation);
    visit_floats(io, &d->period, 1);
    visit_floats(io, &d->phase, 1);
    visit_floats(io, &d->amplitude, 1);
    visit_u32(io, &d->seed);
    visit_flag(io, &d->off);
}

static void visit_transform(state_io* io, es_transform* t)
{
    visit_vector(io, &t->translation);
    visit_rotation(io, &t->rotation);
    visit_vector(io, &t->scale);
}

static void visit_settings(state_io* io, es_world_settings* s)
{
    visit_floats(io, &s->speed, 1);
    visit_floats(io, &s->step, 1);
    visit_u32(io, &s->substeps);
    visit_flag(io, &s->interpolate);
    visit_flag(io, &s->sleep);
    visit_vector(io, &s->gravity);
}

/* What es_world_set_soft takes, and what it looks at besides. */
static void visit_soft(state_io* io, es_soft_desc* d)
{
    visit_floats(io, &d->mass, 1);
    visit_floats(io, &d->stretch_compliance, 1);
    visit_floats(io, &d->shear_compliance, 1);
    visit_floats(io, &d->bend_compliance, 1);
    visit_floats(io, &d->volume_compliance, 1);
    visit_floats(io, &d->damping, 1);
    visit_floats(io, &d->thickness, 1);
    visit_floats(io, &d->friction, 1);
    visit_floats(io, &d->drag, 1);
    visit_vector(io, &d->wind);
    visit_floats(io, &d->pressure, 1);
    visit_floats(io, &d->gravity_scale, 1);
    visit_flag(io, &d->self_collision);
    visit_floats(io, &d->tear_stretch, 1);
    visit_flag(io, &d->tearable);
    visit_u32(io, &d->substeps);
}

/* Bytes of a state are not copied: written from where they are, read where they lie. */
static void visit_state(state_io* io, es_input* in)
{
    uint64_t size = in->state.size;
    transfer(io, &size, sizeof size);
    if (!reading(io)) {
        transfer(io, (void*)in->state.bytes, in->state.size);
    } else if (io->good && size <= io->size - io->at) {
        in->state.bytes = io->bytes + io->at;
        in->state.size = (size_t)size;
        io->at += (size_t)size;
    } else {
        io->good = false;
    }
}

static void visit_input(state_io* io, es_input* in)
{
    uint32_t type = in->type;
    visit_u32(io, &type);
    if (reading(io)) io->good &= type < ES_INPUT_TYPES;
    if (reading(io) && !io->good) return;
    in->type = (es_input_type)type;
    visit_u32(io, &in->id);
    switch (in->type) {
    case ES_INPUT_RESTORE: visit_state(io, in); break;
    case ES_INPUT_CONFIGURE: visit_settings(io, &in->settings); break;
    case ES_INPUT_NODE: visit_transform(io, &in->transform); break;
    case ES_INPUT_CAMERA: visit_camera(io, &in->camera); break;
    case ES_INPUT_LIGHT: visit_light(io, &in->light); break;
    case ES_INPUT_MOVER: visit_mover(io, &in->mover); break;
    case ES_INPUT_CLIP: visit_flag(io, &in->flag); break;
    case ES_INPUT_PLAY_CLIP:
        visit_floats(io, &in->clip.weight, 1);
        visit_floats(io, &in->clip.speed, 1);
        visit_floats(io, &in->clip.start, 1);
        visit_floats(io, &in->clip.fade, 1);
        visit_flag(io, &in->clip.once);
        break;
    case ES_INPUT_STOP_CLIP: visit_floats(io, &in->number, 1); break;
    case ES_INPUT_MORPH_WEIGHTS: visit_state(io, in); break;
    case ES_INPUT_INSTANCE:
        visit_u32(io, &in->instance.node.id);
        visit_u32(io, &in->instance.mesh.id);
        visit_u32(io, &in->instance.material.id);
        visit_flag(io, &in->instance.hidden);
        break;
    case ES_INPUT_BODY_POSE:
        visit_position(io, in->place);
        visit_rotation(io, &in->rotation);
        break;
    case ES_INPUT_BODY_VELOCITY:
        visit_vector(io, &in->a);
        visit_vector(io, &in->b);
        break;
    case ES_INPUT_IMPULSE:
    case ES_INPUT_FORCE:
        visit_vector(io, &in->a);
        visit_flag(io, &in->flag);
        visit_position(io, in->place);
        break;
    case ES_INPUT_JOINT: visit_joint(io, &in->joint); break;
    case ES_INPUT_GRAB_BODY:
        visit_u32(io, &in->other);
        visit_vector(io, &in->a);
        visit_position(io, in->place);
        visit_floats(io, &in->number, 1);
        break;
    case ES_INPUT_MOVE_HAND: visit_position(io, in->place); break;
    case ES_INPUT_SOFT: visit_soft(io, &in->soft); break;
    case ES_INPUT_SOFT_ATTACH:
        visit_u32(io, &in->attachment.vertex);
        visit_u32(io, &in->attachment.node.id);
        visit_u32(io, &in->attachment.body.id);
        visit_flag(io, &in->attachment.in_place);
        visit_vector(io, &in->attachment.local);
        break;
    case ES_INPUT_SOFT_DETACH: visit_u32(io, &in->vertex); break;
    case ES_INPUT_SOFT_TEAR:
        visit_position(io, in->place);
        visit_floats(io, &in->number, 1);
        break;
    case ES_INPUT_SOFT_IMPULSE:
        visit_u32(io, &in->vertex);
        visit_vector(io, &in->a);
        break;
    case ES_INPUT_SKY: es_visit_sky_desc(io, &in->sky); break;
    case ES_INPUT_REGION:
    case ES_INPUT_CONSTRAINT:
    case ES_INPUT_EDITS: visit_state(io, in); break;
    case ES_INPUT_PARAMETER:
        visit_floats(io, &in->number, 1);
        visit_state(io, in);
        break;
    case ES_INPUT_FREEZE:
        visit_flag(io, &in->flag);
        visit_position(io, in->place);
        break;
    case ES_INPUT_GRAB_SOFT:
        visit_u32(io, &in->other);
        visit_u32(io, &in->vertex);
        visit_position(io, in->place);
        break;
    default: break;
    }
}

bool es_input_read(const es_recording* recording, size_t* at, size_t end, es_input* input)
{
    memset(input, 0, sizeof *input);
    state_io io = {.mode = CHECK, .bytes = recording->inputs, .at = *at, .size = end, .good = true};
    visit_input(&io, input);
    *at = io.at;
    return io.good;
}

void es_note(es_world* world, const es_input* input)
{
    es_recording* recording = world->recording;
    if (!recording || world->in_step || recording->failed) return;
    es_input copy = *input;
    state_io io = {.mode = COUNT, .good = true};
    visit_input(&io, &copy);
    if (!es_grow(recording->context, (void**)&recording->inputs, &recording->input_capacity, recording->input_count, recording->input_count + io.at, 1)) {
        recording->failed = es_context_last_result(recording->context);
        return;
    }
    io = (state_io){.mode = WRITE, .bytes = recording->inputs + recording->input_count, .good = true};
    visit_input(&io, &copy);
    recording->input_count += io.at;
}

void es_recording_fail(es_world* world)
{
    if (world->recording && !world->recording->failed) world->recording->failed = es_context_last_result(world->context);
}

es_recording* es_recording_pause(es_world* world)
{
    es_recording* recording = world->recording;
    world->recording = NULL;
    return recording;
}

/* The noted bytes may lie anywhere. */
static es_result apply_weights(es_world* world, const es_input* in)
{
    float* weights = es_allocate(world->context, in->state.size);
    if (!weights) return es_context_last_result(world->context);
    memcpy(weights, in->state.bytes, in->state.size);
    es_result result = es_world_set_morph_weights(world, (es_mesh){in->id}, weights, (uint32_t)(in->state.size / sizeof *weights));
    es_release(world->context, weights, in->state.size);
    return result;
}

static es_result apply_parameter(es_world* world, const es_input* in)
{
    char name[ES_EDIT_NAME] = {0};
    memcpy(name, in->state.bytes, in->state.size < sizeof name ? in->state.size : sizeof name - 1);
    return es_world_set_parameter(world, name, in->number);
}

static es_result apply(es_world* world, const es_input* in)
{
    const double* place = in->flag ? in->place : NULL;
    switch (in->type) {
    case ES_INPUT_RESTORE: return es_world_restore(world, in->state.bytes, in->state.size);
    case ES_INPUT_CONFIGURE: {
        es_world_settings settings = es_world_get_settings(world), noted = in->settings;
        noted.triangles = settings.triangles;
        noted.camera = settings.camera;
        noted.clip = settings.clip;
        noted.default_light = settings.default_light;
        return es_world_configure(world, &noted);
    }
    case ES_INPUT_NODE: return es_world_set_node_transform(world, (es_node){in->id}, &in->transform);
    case ES_INPUT_CAMERA: return es_world_set_camera(world, (es_camera){in->id}, &in->camera);
    case ES_INPUT_ACTIVE_CAMERA: return es_world_set_active_camera(world, (es_camera){in->id});
    case ES_INPUT_LIGHT: return es_world_set_light(world, (es_light){in->id}, &in->light);
    case ES_INPUT_MOVER: return es_world_set_mover(world, (es_mover){in->id}, &in->mover);
    case ES_INPUT_CLIP: return es_world_play_clip(world, (es_clip){in->id}, in->flag);
    case ES_INPUT_PLAY_CLIP: return es_world_play_clip_with(world, (es_clip){in->id}, &in->clip);
    case ES_INPUT_STOP_CLIP: return es_world_stop_clip(world, (es_clip){in->id}, in->number);
    case ES_INPUT_MORPH_WEIGHTS: return apply_weights(world, in);
    case ES_INPUT_INSTANCE: return es_world_set_instance(world, (es_instance){in->id}, &in->instance);
    case ES_INPUT_BODY_POSE: return es_world_set_body_pose(world, (es_body){in->id}, in->place, in->rotation);
    case ES_INPUT_BODY_VELOCITY: return es_world_set_body_velocity(world, (es_body){in->id}, in->a, in->b);
    case ES_INPUT_IMPULSE: return es_world_apply_impulse(world, (es_body){in->id}, in->a, place);
    case ES_INPUT_FORCE: return es_world_apply_force(world, (es_body){in->id}, in->a, place);
    case ES_INPUT_WAKE: return es_world_wake_body(world, (es_body){in->id});
    case ES_INPUT_JOINT: return es_world_set_joint(world, (es_joint){in->id}, &in->joint);
    case ES_INPUT_GRAB_BODY: return es_world_grab_body(world, in->id, (es_body){in->other}, in->a, in->place, in->number);
    case ES_INPUT_MOVE_HAND: return es_world_move_hand(world, in->id, in->place);
    case ES_INPUT_SOFT: return es_world_set_soft(world, (es_soft){in->id}, &in->soft);
    case ES_INPUT_SOFT_ATTACH: return es_world_soft_attach(world, (es_soft){in->id}, &in->attachment);
    case ES_INPUT_SOFT_DETACH: return es_world_soft_detach(world, (es_soft){in->id}, in->vertex);
    case ES_INPUT_SOFT_TEAR: return es_world_soft_tear(world, (es_soft){in->id}, in->place, in->number);
    case ES_INPUT_SKY: return es_world_set_sky(world, &in->sky);
    case ES_INPUT_REGION: return es_edits_apply_note(world, ES_OBJECT_REGION, in->id, in->state.bytes, in->state.size);
    case ES_INPUT_CONSTRAINT: return es_edits_apply_note(world, ES_OBJECT_CONSTRAINT, in->id, in->state.bytes, in->state.size);
    case ES_INPUT_EDITS: return es_edits_apply_all(world, in->state.bytes, in->state.size);
    case ES_INPUT_PARAMETER: return apply_parameter(world, in);
    case ES_INPUT_FREEZE: return es_world_freeze_reflections(world, place);
    case ES_INPUT_SOFT_IMPULSE: return es_world_soft_impulse(world, (es_soft){in->id}, in->vertex, in->a);
    case ES_INPUT_SOFT_WAKE: return es_world_wake_soft(world, (es_soft){in->id});
    case ES_INPUT_GRAB_SOFT: return es_world_grab_soft(world, in->id, (es_soft){in->other}, in->vertex, in->place);
    default: return es_world_release(world, in->id);
    }
}

/* ---- recording ---------------------------------------------------------------------------------------------------------- */

static char* copy_text(es_context* context, const char* text, size_t size)
{
    char* copy = es_allocate(context, size + 1);
    if (!copy) return NULL;
    memcpy(copy, text, size);
    copy[size] = 0;
    return copy;
}

es_recording* es_recording_make(es_context* context, const char* scene, size_t scene_size, const char* settings, size_t settings_size)
{
    es_recording* recording = es_allocate_zero(context, sizeof *recording);
    if (!recording) return NULL;
    recording->context = context;
    es_context_count_object(context, 1);
    recording->scene = copy_text(context, scene, scene_size);
    if (recording->scene) recording->settings = copy_text(context, settings, settings_size);
    if (recording->settings) return recording;
    es_recording_destroy(recording);
    return NULL;
}

void es_recording_destroy(es_recording* recording)
{
    if (!recording) return;
    es_context* context = recording->context;
    if (recording->world) recording->world->recording = NULL;
    es_release(context, recording->scene, recording->scene ? strlen(recording->scene) + 1 : 0);
    es_release(context, recording->settings, recording->settings ? strlen(recording->settings) + 1 : 0);
    es_release(context, recording->first, recording->first_size);
    es_release(context, recording->steps, recording->step_capacity * sizeof *recording->steps);
    es_release(context, recording->inputs, recording->input_capacity);
    es_release(context, recording->hashes, recording->hash_capacity * sizeof *recording->hashes);
    es_release(context, recording, sizeof *recording);
    es_context_count_object(context, -1);
}

es_result es_recording_begin(es_world* world, const char* scene, const char* settings, es_recording** out)
{
    if (!world || !out) return ES_INVALID_ARGUMENT;
    es_context* context = world->context;
    *out = NULL;
    if (!scene) scene = "";
    if (!settings) settings = "";
    if (world->recording || world->in_step) return es_misuse(context, ES_WRONG_STATE, "es_recording_begin: the world is being recorded already, or in a step");
    es_recording* recording = es_recording_make(context, scene, strlen(scene), settings, strlen(settings));
    es_result result = recording ? es_world_save(world, NULL, &recording->first_size) : es_context_last_result(context);
    if (result == ES_OK) {
        recording->first = es_allocate(context, recording->first_size);
        size_t size = recording->first_size;
        result = recording->first ? es_world_save(world, recording->first, &size) : es_context_last_result(context);
    }
    if (result != ES_OK) {
        es_recording_destroy(recording);
        return result;
    }
    recording->first_hash = es_world_hash(world);
    recording->world = world;
    world->recording = recording;
    *out = recording;
    return ES_OK;
}

void es_recording_end(es_recording* recording)
{
    if (!recording || !recording->world) return;
    recording->world->recording = NULL;
    recording->world = NULL;
    recording->input_count = recording->noted; /* what came after the last step had no consequence */
}

static uint32_t object_count(const es_world* world)
{
    uint32_t count = 0;
    for (int k = 0; k < COMPARED; k++) count += world->slots[compared[k]].live;
    return count;
}

static uint32_t short_hash(const es_world* world, es_object_kind kind, uint32_t id)
{
    uint64_t hash = es_world_object_hash(world, kind, id);
    return (uint32_t)(hash ^ hash >> 32);
}

void es_recording_note_step(es_world* world, float dt)
{
    es_recording* recording = world->recording;
    if (!recording || recording->failed) return;
    uint32_t objects = object_count(world);
    es_context* context = recording->context;
    if (!es_grow(context, (void**)&recording->steps, &recording->step_capacity, recording->step_count, recording->step_count + 1, sizeof *recording->steps) ||
        !es_grow(context, (void**)&recording->hashes, &recording->hash_capacity, recording->hash_count, recording->hash_count + objects, sizeof *recording->hashes)) {
        recording->failed = es_context_last_result(context);
        return;
    }
    recording->steps[recording->step_count++] = (es_recorded_step){dt, objects, recording->noted, recording->input_count, recording->hash_count, es_world_hash(world)};
    recording->noted = recording->input_count;
    for (int k = 0; k < COMPARED; k++) {
        const es_slots* slots = &world->slots[compared[k]];
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            const es_object* object = es_slots_at(slots, slot);
            if (object) recording->hashes[recording->hash_count++] = short_hash(world, compared[k], object->id);
        }
    }
}

/* ---- replay --------------------------------------------------------------------------------------------------------------- */

uint32_t es_recording_steps(const es_recording* recording) { return recording ? (uint32_t)recording->step_count : 0; }
const char* es_recording_scene(const es_recording* recording) { return recording ? recording->scene : ""; }
const char* es_recording_settings(const es_recording* recording) { return recording ? recording->settings : ""; }
float es_recording_dt(const es_recording* recording, uint32_t step) { return recording && step < recording->step_count ? recording->steps[step].dt : 0; }

es_result es_recording_rewind(const es_recording* recording, es_world* world)
{
    if (!recording || !world) return ES_INVALID_ARGUMENT;
    return es_world_restore(world, recording->first, recording->first_size);
}

static void find_difference(const es_recording* recording, const es_recorded_step* step, const es_world* world, es_divergence* divergence)
{
    if (object_count(world) != step->objects) return; /* of other objects it cannot be said which one is meant */
    const uint32_t* hashes = recording->hashes + step->first_hash;
    for (int k = 0; k < COMPARED; k++) {
        const es_slots* slots = &world->slots[compared[k]];
        for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
            const es_object* object = es_slots_at(slots, slot);
            if (!object || short_hash(world, compared[k], object->id) == *hashes++) continue;
            divergence->kind = compared[k];
            divergence->id = object->id;
            return;
        }
    }
}

es_result es_recording_replay(const es_recording* recording, uint32_t number, es_world* world, es_divergence* divergence)
{
    if (!recording || !world || !divergence) return ES_INVALID_ARGUMENT;
    *divergence = (es_divergence){.kind = ES_OBJECT_KINDS};
    if (number >= recording->step_count) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_recording_replay: step %u of a recording of %zu", number, recording->step_count);
    const es_recorded_step* step = &recording->steps[number];
    es_result result = ES_OK;
    for (size_t at = (size_t)step->inputs; at < step->input_end && result == ES_OK;) {
        es_input input;
        if (!es_input_read(recording, &at, (size_t)step->input_end, &input)) return es_fail(world->context, ES_FILE_DAMAGED, "the recording is damaged before step %u", number);
        result = apply(world, &input);
    }
    if (result == ES_OK) result = es_world_step(world, step->dt);
    if (result != ES_OK) return result;
    divergence->differs = es_world_hash(world) != step->hash;
    divergence->step = number;
    if (divergence->differs) find_difference(recording, step, world, divergence);
    return ES_OK;
}
