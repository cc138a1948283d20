/* Cameras: lenses on nodes, and their views of this frame and the last. */
#include "sim/recording.h"

#include <string.h>

#include "platform/maths.h"

es_camera_desc es_default_camera_desc(void)
{
    return (es_camera_desc){.fov_y = 0.8f, .half_height = 1.0f, .near_plane = 0.05f, .far_plane = 1000.0f};
}

static es_camera_object* camera_object(const es_world* world, es_camera camera) { return es_world_object(world, ES_OBJECT_CAMERA, camera.id); }

/* The desc with zeros replaced by defaults; a failure says what is out of range. */
static es_result resolve(es_world* world, const es_camera_desc* desc, es_camera_desc* resolved)
{
    es_camera_desc standard = es_default_camera_desc(), d = {0};
    d.node = desc->node;
    d.orthographic = desc->orthographic;
    d.fov_y = desc->fov_y == 0 ? standard.fov_y : desc->fov_y;
    d.half_height = desc->half_height == 0 ? standard.half_height : desc->half_height;
    d.near_plane = desc->near_plane == 0 && !d.orthographic ? standard.near_plane : desc->near_plane;
    d.far_plane = desc->far_plane == 0 ? standard.far_plane : desc->far_plane;
    if (d.node.id && !es_world_object(world, ES_OBJECT_NODE, d.node.id)) return ES_STALE_HANDLE;
    /* a field of view beyond 178.5° or below 0.06° leaves the projection without usable precision */
    const char* wrong = !es_within(d.fov_y, 0.001f, 3.115f)               ? "its field of view must lie in 0.001 … 3.115 radians"
                        : !es_within(d.half_height, 1e-6f, ES_WORLD_EXTENT) ? "its half height must lie in 1e-6 … 1e9 metres"
                        : !es_within(d.near_plane, d.orthographic ? 0.0f : 1e-6f, 1e6f) ? "its near plane must lie in 1e-6 … 1e6 metres"
                        : !es_within(d.far_plane, 1e-6f, ES_WORLD_EXTENT) || (d.orthographic && d.far_plane <= d.near_plane)
                            ? "its far plane must lie beyond the near plane, at most 1e9 metres away"
                            : NULL;
    if (wrong) return es_fail(world->context, ES_INVALID_ARGUMENT, "camera '%.64s': %s", desc->name ? desc->name : "", wrong);
    *resolved = d;
    return ES_OK;
}

bool es_camera_desc_resolve(es_world* world, const es_camera_desc* desc, es_camera_desc* resolved) { return resolve(world, desc, resolved) == ES_OK; }

es_result es_world_add_camera(es_world* world, const es_camera_desc* desc, es_camera* camera)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !camera) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_camera: desc and camera must not be NULL");
    *camera = (es_camera){0};
    es_camera_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    es_camera_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_CAMERA], "camera", desc->name);
    if (!object) return es_context_last_result(world->context);
    object->desc = resolved;
    object->fresh = true;
    es_world_rereference(world, ES_OBJECT_NODE, 0, resolved.node.id);
    camera->id = object->object.id;
    if (!world->active_camera.id) world->active_camera = *camera;
    world->camera_dirty = true;
    return ES_OK;
}

es_result es_world_set_camera(es_world* world, es_camera camera, const es_camera_desc* desc)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_camera_object* object = camera_object(world, camera);
    if (!object) return ES_STALE_HANDLE;
    if (!desc) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_set_camera: desc must not be NULL");
    es_camera_desc resolved;
    es_result result = resolve(world, desc, &resolved);
    if (result != ES_OK) return result;
    es_world_rereference(world, ES_OBJECT_NODE, object->desc.node.id, resolved.node.id);
    object->desc = resolved;
    world->camera_dirty = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_CAMERA, .id = camera.id, .camera = resolved});
    return ES_OK;
}

es_result es_world_get_camera(const es_world* world, es_camera camera, es_camera_desc* desc)
{
    if (!world || !desc) return ES_INVALID_ARGUMENT;
    es_camera_object* object = camera_object(world, camera);
    if (!object) return ES_STALE_HANDLE;
    *desc = object->desc;
    desc->name = object->object.name ? object->object.name : "";
    return ES_OK;
}

es_result es_world_destroy_camera(es_world* world, es_camera camera)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_camera_object* object = camera_object(world, camera);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "camera '%.64s' cannot be destroyed: %u things move it", object->object.name ? object->object.name : "", object->object.references);
    es_world_rereference(world, ES_OBJECT_NODE, object->desc.node.id, 0);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_CAMERA], &object->object);
    if (world->active_camera.id == camera.id) { /* the first that is left takes over */
        world->active_camera = (es_camera){0};
        const es_slots* slots = &world->slots[ES_OBJECT_CAMERA];
        for (uint32_t slot = 0; slot < slots->slot_count && !world->active_camera.id; slot++) {
            const es_object* other = es_slots_at(slots, slot);
            if (other) world->active_camera.id = other->id;
        }
        world->camera_dirty = true;
    }
    return ES_OK;
}

es_camera es_world_active_camera(const es_world* world) { return world ? world->active_camera : (es_camera){0}; }

es_result es_world_set_active_camera(es_world* world, es_camera camera)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!camera_object(world, camera)) return ES_STALE_HANDLE;
    world->camera_dirty |= world->active_camera.id != camera.id;
    world->active_camera = camera;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_ACTIVE_CAMERA, .id = camera.id});
    return ES_OK;
}

static es_camera_state state_of(uint32_t id, const es_camera_desc* desc, es_mat4 pose)
{
    return (es_camera_state){id, desc->orthographic, desc->fov_y, desc->half_height, desc->near_plane, desc->far_plane, pose};
}

static es_mat4 pose_of(const es_world* world, const es_camera_object* camera)
{
    return es_relative_matrix(world, es_node_world(world, camera->desc.node), es_node_position(world, camera->desc.node));
}

static es_mat4 previous_pose_of(const es_world* world, const es_camera_object* camera)
{
    return es_relative_matrix(world, &camera->previous_world, camera->previous_position);
}

void es_camera_refresh(es_world* world)
{
    if (!world->camera_dirty) return;
    world->camera_dirty = false;
    const es_slots* slots = &world->slots[ES_OBJECT_CAMERA];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_camera_object* object = es_slots_at(slots, slot);
        if (!object || !(object->fresh || !world->stepped)) continue;
        object->previous = object->desc;
        object->previous_world = *es_node_world(world, object->desc.node);
        memcpy(object->previous_position, es_node_position(world, object->desc.node), sizeof object->previous_position);
        object->fresh = false;
    }
    es_camera_state now, last;
    memset(&now, 0, sizeof now);
    last = now;
    const es_camera_object* active = es_slots_get(slots, world->active_camera.id);
    if (active) {
        now = state_of(active->object.id, &active->desc, pose_of(world, active));
        last = state_of(active->object.id, &active->previous, previous_pose_of(world, active));
    }
    if (memcmp(&now, &world->camera_state, sizeof now) != 0) world->revisions.camera++;
    world->camera_state = now;
    world->camera_moving = memcmp(&now, &last, sizeof now) != 0;
}

/* The camera looks along its node's -z whatever the node's scale; an axis that a zero scale took away falls back. */
static void matrices(const es_camera_desc* desc, const es_mat4* to_world, float aspect, es_mat4* view, es_mat4* projection)
{
    const float* m = to_world->m;
    es_vec3 direction = es_v3_normalize(es_v3(-m[8], -m[9], -m[10]), es_v3(0, 0, -1));
    es_vec3 up = es_v3_normalize(es_v3(m[4], m[5], m[6]), es_v3(0, 1, 0));
    es_vec3 eye = es_all_within(m + 12, 3, ES_WORLD_EXTENT) ? es_v3(m[12], m[13], m[14]) : es_v3(0, 0, 0);
    *view = es_mat4_look(eye, direction, up);
    if (desc->orthographic) *projection = es_mat4_orthographic(desc->half_height * aspect, desc->half_height, desc->near_plane, desc->far_plane);
    else *projection = es_mat4_perspective(desc->fov_y, aspect, desc->near_plane);
}

es_result es_world_camera_view(const es_world* world, es_camera camera, uint32_t width, uint32_t height, es_raster_view* view)
{
    if (!world || !view) return ES_INVALID_ARGUMENT;
    es_camera_object* object = camera_object(world, camera);
    if (!object) return ES_STALE_HANDLE;
    if (width < 1 || height < 1 || width > ES_RASTER_MAX_SIZE || height > ES_RASTER_MAX_SIZE)
        return es_fail(world->context, ES_IMAGE_SIZE, "a view of %u x %u pixels: each side must lie in 1 … %d", width, height, ES_RASTER_MAX_SIZE);
    es_world_refresh(world);
    es_fp_environment environment = es_fp_enter();
    float aspect = (float)width / (float)height;
    *view = (es_raster_view){.width = width, .height = height, .cull = ES_CULL_BACK};
    es_mat4 now = pose_of(world, object), last = previous_pose_of(world, object);
    matrices(&object->desc, &now, aspect, &view->view, &view->projection);
    matrices(&object->previous, &last, aspect, &view->previous_view, &view->previous_projection);
    es_fp_leave(environment);
    return ES_OK;
}
