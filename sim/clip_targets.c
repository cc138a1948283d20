/* What clips move: nodes, morph weights, lights, cameras.
 *
 * All playing clips that move the same value are averaged by their weights: ((a ∘ b) ∘ c) …, in the clips' order, where each joins with its
 * share of the weights so far; rotations on the shorter arc. Weights that sum to less than one leave the rest to the value from before the
 * first clip for it was added. So a clip alone at weight one is taken exactly, and so is each end of a cross-fade. */
#include "sim/world.h"

#include <string.h>

#include "platform/maths.h"

typedef struct target { es_object_kind kind; uint32_t id; } target;

static target target_of(const es_clip_channel* channel)
{
    switch (channel->path) {
    case ES_CLIP_TRANSLATION:
    case ES_CLIP_ROTATION:
    case ES_CLIP_SCALE: return (target){ES_OBJECT_NODE, channel->node.id};
    case ES_CLIP_WEIGHTS: return (target){ES_OBJECT_MESH, channel->mesh.id};
    case ES_CLIP_LIGHT_COLOR:
    case ES_CLIP_LIGHT_INTENSITY:
    case ES_CLIP_LIGHT_INNER_CONE:
    case ES_CLIP_LIGHT_OUTER_CONE:
    case ES_CLIP_LIGHT_RANGE: return (target){ES_OBJECT_LIGHT, channel->light.id};
    default: return (target){ES_OBJECT_CAMERA, channel->camera.id};
    }
}

bool es_clip_target_exists(es_world* world, const es_clip_channel* channel)
{
    target t = target_of(channel);
    return es_world_object(world, t.kind, t.id) != NULL;
}

uint32_t es_clip_components(const es_world* world, const es_clip_channel* channel)
{
    if (channel->path == ES_CLIP_ROTATION) return 4;
    if (channel->path == ES_CLIP_TRANSLATION || channel->path == ES_CLIP_SCALE || channel->path == ES_CLIP_LIGHT_COLOR) return 3;
    if (channel->path != ES_CLIP_WEIGHTS) return 1;
    const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], channel->mesh.id);
    return mesh && mesh->drive ? mesh->drive->target_count : 0;
}

void es_clip_hold_target(es_world* world, const es_clip_channel* channel, bool hold)
{
    target t = target_of(channel);
    es_world_rereference(world, t.kind, hold ? 0 : t.id, hold ? t.id : 0);
    void* object = es_slots_get(&world->slots[t.kind], t.id);
    if (!hold || !object) return;
    if (t.kind == ES_OBJECT_NODE) {
        es_node_object* node = object;
        if (!node->clip_sums.kept) node->rest = node->transform;
        node->clip_sums.kept = true;
    } else if (t.kind == ES_OBJECT_LIGHT) {
        es_light_object* light = object;
        if (!light->clip_sums.kept) light->rest = light->desc;
        light->clip_sums.kept = true;
    } else if (t.kind == ES_OBJECT_CAMERA) {
        es_camera_object* camera = object;
        if (!camera->clip_sums.kept) camera->rest = camera->desc;
        camera->clip_sums.kept = true;
    }
}

uint32_t* es_clip_played_by(es_world* world, const es_clip_channel* channel)
{
    target t = target_of(channel);
    void* object = es_slots_get(&world->slots[t.kind], t.id);
    switch (t.kind) {
    case ES_OBJECT_NODE: return &((es_node_object*)object)->clip_sums.played_by;
    case ES_OBJECT_LIGHT: return &((es_light_object*)object)->clip_sums.played_by;
    case ES_OBJECT_CAMERA: return &((es_camera_object*)object)->clip_sums.played_by;
    default: return &((es_mesh_object*)object)->drive->played_by;
    }
}

/* ---- adding up ------------------------------------------------------------------------------------------------------------------- */

static float between(float a, float b, float t) { return (1.0f - t) * a + t * b; }

static void join(float* value, const float* other, size_t count, bool rotation, float t)
{
    if (rotation) {
        es_quat q = es_quat_slerp((es_quat){value[0], value[1], value[2], value[3]}, (es_quat){other[0], other[1], other[2], other[3]}, t);
        memcpy(value, &q, sizeof q);
    } else {
        for (size_t i = 0; i < count; i++) value[i] = between(value[i], other[i], t);
    }
}

static void add(es_clip_sum* sum, const float* value, size_t count, bool rotation, float weight)
{
    if (!sum->touched) sum->share = 0;
    sum->touched = true;
    if (weight <= 0) return;
    if (sum->share == 0) memcpy(sum->value, value, count * sizeof *value);
    sum->share += weight;
    if (sum->share > weight) join(sum->value, value, count, rotation, weight / sum->share);
}

static es_clip_sum* sum_of(es_world* world, const es_clip_channel* channel)
{
    target t = target_of(channel);
    void* object = es_slots_get(&world->slots[t.kind], t.id);
    switch (t.kind) {
    case ES_OBJECT_NODE: return &((es_node_object*)object)->clip_sums.sums[channel->path - ES_CLIP_TRANSLATION];
    case ES_OBJECT_LIGHT: return &((es_light_object*)object)->clip_sums.sums[channel->path - ES_CLIP_LIGHT_COLOR];
    default: return &((es_camera_object*)object)->clip_sums.sums[channel->path - ES_CLIP_CAMERA_FOV];
    }
}

void es_clip_add_value(es_world* world, const es_clip_track* track, double time, float weight)
{
    const es_clip_channel* channel = &track->channel;
    es_clip_segment segment = es_clip_find(track, time);
    if (channel->path == ES_CLIP_WEIGHTS) {
        const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], channel->mesh.id);
        es_mesh_drive* drive = mesh->drive;
        if (!drive->blending) drive->blended_share = 0;
        drive->blending = true;
        if (weight <= 0) return;
        bool first = drive->blended_share == 0;
        drive->blended_share += weight;
        float t = weight / drive->blended_share;
        for (uint32_t c = 0; c < track->components; c++) {
            float value;
            es_clip_value(track, &segment, c, 1, &value);
            drive->blended[c] = first ? value : between(drive->blended[c], value, t);
        }
        return;
    }
    float value[4];
    es_clip_value(track, &segment, 0, track->components, value);
    bool rotation = channel->path == ES_CLIP_ROTATION;
    if (rotation) {
        es_quat q = es_quat_normalize((es_quat){value[0], value[1], value[2], value[3]});
        memcpy(value, &q, sizeof q);
    }
    add(sum_of(world, channel), value, track->components, rotation, weight);
}

/* ---- taking effect --------------------------------------------------------------------------------------------------------------- */

/* The sum where clips gave one, filled up with `value`, what it was without them; true when any clip touched it. */
static bool take(es_clip_sum* sum, const float* rest, size_t count, bool rotation, float* value)
{
    if (!sum->touched) return false;
    sum->touched = false;
    float taken[4];
    memcpy(taken, rest, count * sizeof *taken);
    if (sum->share >= 1) memcpy(taken, sum->value, count * sizeof *taken);
    else if (sum->share > 0) join(taken, sum->value, count, rotation, sum->share);
    memcpy(value, taken, count * sizeof *taken);
    return true;
}

static void apply_to_node(es_world* world, es_node_object* node)
{
    es_clip_sum* sums = node->clip_sums.sums;
    es_transform transform = node->transform;
    bool any = take(&sums[0], &node->rest.translation.x, 3, false, &transform.translation.x);
    any |= take(&sums[1], &node->rest.rotation.x, 4, true, &transform.rotation.x);
    any |= take(&sums[2], &node->rest.scale.x, 3, false, &transform.scale.x);
    if (any) es_world_set_node_transform(world, (es_node){node->object.id}, &transform);
}

/* Splines swing beyond their keys, so values are taken to the nearest that is allowed. */
static void apply_to_light(es_world* world, es_light_object* light)
{
    es_clip_sum* sums = light->clip_sums.sums;
    es_light_desc desc = light->desc;
    bool any = take(&sums[0], light->rest.color, 3, false, desc.color);
    any |= take(&sums[1], &light->rest.intensity, 1, false, &desc.intensity);
    any |= take(&sums[2], &light->rest.inner_cone, 1, false, &desc.inner_cone);
    any |= take(&sums[3], &light->rest.outer_cone, 1, false, &desc.outer_cone);
    any |= take(&sums[4], &light->rest.range, 1, false, &desc.range);
    if (!any) return;
    float brightest = 0;
    for (int c = 0; c < 3; c++) {
        desc.color[c] = es_clampf(desc.color[c], 0, 1e6f);
        brightest = es_maxf(brightest, desc.color[c]);
    }
    desc.intensity = es_clampf(desc.intensity, 0, brightest > 1 ? 0.999f * 1e20f / brightest : 1e20f);
    desc.range = es_clampf(desc.range, 0, 1e12f);
    if (desc.type == ES_LIGHT_SPOT) {
        desc.outer_cone = es_clampf(desc.outer_cone, 1e-4f, 0.5f * ES_PI);
        desc.inner_cone = es_clampf(desc.inner_cone, 0, desc.outer_cone);
    }
    desc.name = light->object.name;
    es_world_set_light(world, (es_light){light->object.id}, &desc);
}

static void apply_to_camera(es_world* world, es_camera_object* camera)
{
    es_clip_sum* sums = camera->clip_sums.sums;
    es_camera_desc desc = camera->desc;
    bool any = take(&sums[0], &camera->rest.fov_y, 1, false, &desc.fov_y);
    any |= take(&sums[1], &camera->rest.half_height, 1, false, &desc.half_height);
    any |= take(&sums[2], &camera->rest.near_plane, 1, false, &desc.near_plane);
    if (!any) return;
    desc.fov_y = es_clampf(desc.fov_y, 0.001f, 3.115f);
    desc.half_height = es_clampf(desc.half_height, 1e-6f, ES_WORLD_EXTENT);
    desc.near_plane = es_clampf(desc.near_plane, desc.orthographic ? 0 : 1e-6f, desc.orthographic ? es_minf(1e6f, 0.999f * desc.far_plane) : 1e6f);
    desc.name = camera->object.name;
    es_world_set_camera(world, (es_camera){camera->object.id}, &desc);
}

static void apply_to_mesh(es_world* world, es_mesh_object* mesh)
{
    es_mesh_drive* drive = mesh->drive;
    if (!drive->blending) return;
    drive->blending = false;
    for (uint32_t t = 0; t < drive->target_count; t++) {
        float rest = drive->default_weights[t], value = drive->blended_share > 0 ? drive->blended[t] : rest;
        if (drive->blended_share > 0 && drive->blended_share < 1) value = between(rest, value, drive->blended_share);
        drive->blended[t] = es_clampf(value, -ES_MORPH_WEIGHT, ES_MORPH_WEIGHT);
    }
    es_world_set_morph_weights(world, (es_mesh){mesh->object.id}, drive->blended, drive->target_count);
}

void es_clip_apply(es_world* world, const es_clip_channel* channel)
{
    target t = target_of(channel);
    void* object = es_slots_get(&world->slots[t.kind], t.id);
    switch (t.kind) {
    case ES_OBJECT_NODE: apply_to_node(world, object); break;
    case ES_OBJECT_LIGHT: apply_to_light(world, object); break;
    case ES_OBJECT_CAMERA: apply_to_camera(world, object); break;
    default: apply_to_mesh(world, object); break;
    }
}
