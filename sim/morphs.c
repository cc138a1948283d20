/* Morph targets: displacements of a mesh's streams and the weights they are taken with. */
#include "sim/recording.h"

#include <string.h>

static const char* label(const char* name) { return name ? name : ""; }
static size_t blocks_of(const es_mesh_object* mesh) { return mesh->raster.vertex_count ? ((size_t)mesh->raster.vertex_count + 7) / 8 : 1; }

es_result es_morph_desc_check(es_world* world, const es_mesh_desc* desc)
{
    const char* name = label(desc->name);
    if (desc->target_count > ES_MORPH_TARGETS)
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': has %u morph targets, at most %d are accepted", name, desc->target_count, ES_MORPH_TARGETS);
    if (desc->target_count && !desc->targets) return es_misuse(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': targets must not be NULL", name);
    for (uint32_t t = 0; t < desc->target_count; t++) {
        const float* streams[] = {desc->targets[t].positions, desc->targets[t].normals, desc->targets[t].tangents};
        for (int s = 0; s < ES_STREAMS; s++)
            if (streams[s] && !es_all_within(streams[s], 3 * (size_t)desc->vertex_count, ES_WORLD_EXTENT))
                return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': displacements of morph target %u must be finite and within 1e9", name, t);
    }
    if (desc->target_count && desc->weights && !es_all_within(desc->weights, desc->target_count, ES_MORPH_WEIGHT))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': morph weights must be finite and within 1e6", name);
    return ES_OK;
}

/* What a drive holds of a mesh: rest streams, a place for last frame's vertices, bounds of the tasks. False when memory ran out; what is there
 * already is freed with the mesh. */
bool es_mesh_make_driven(es_world* world, es_mesh_object* mesh)
{
    if (mesh->drive) return true;
    if (!es_mesh_make_deformable(world, mesh)) return false;
    size_t bytes = es_mesh_stream_bytes(mesh->raster.vertex_count);
    if (mesh->tangents && !mesh->rest_tangents) {
        mesh->rest_tangents = es_allocate(world->context, bytes);
        if (!mesh->rest_tangents) return false;
        memcpy(mesh->rest_tangents, mesh->tangents, bytes);
    }
    es_mesh_drive* drive = es_allocate_zero(world->context, sizeof *drive);
    if (!drive) return false;
    drive->chunk_bounds = es_allocate_zero(world->context, (blocks_of(mesh) * 8 / ES_DEFORM_GRAIN + 1) * 8 * sizeof(float));
    if (!drive->chunk_bounds) {
        es_release(world->context, drive, sizeof *drive);
        return false;
    }
    drive->stale = true;
    mesh->drive = drive;
    world->driven_meshes++;
    world->poses_dirty = true;
    return true;
}

void es_mesh_drive_free(es_world* world, es_mesh_object* mesh)
{
    es_mesh_drive* drive = mesh->drive;
    if (!drive) return;
    es_context* context = world->context;
    for (int s = 0; s < ES_STREAMS; s++) {
        for (uint32_t t = 0; drive->targets[s] && t < drive->target_count; t++) {
            const es_morph_stream* stream = &drive->targets[s][t];
            es_release(context, stream->displacement, (size_t)(stream->end - stream->begin) * 4 * sizeof(float));
        }
        es_release(context, drive->targets[s], drive->target_count * sizeof(es_morph_stream));
    }
    float* weights[] = {drive->weights, drive->posed_weights, drive->previous_weights, drive->default_weights, drive->blended};
    for (size_t i = 0; i < sizeof weights / sizeof weights[0]; i++) es_release(context, weights[i], drive->target_count * sizeof(float));
    es_release(context, drive->chunk_bounds, (blocks_of(mesh) * 8 / ES_DEFORM_GRAIN + 1) * 8 * sizeof(float));
    es_release(context, drive, sizeof *drive);
    mesh->drive = NULL;
    world->driven_meshes--;
}

/* Displacements between the first vertex that has one and the last; beyond the mesh's end they are vertex 0's, like its streams. */
static bool fill_stream(es_context* context, const float* from, uint32_t vertex_count, uint32_t padded_count, es_morph_stream* stream)
{
    uint32_t first = padded_count, last = 0;
    for (uint32_t v = 0; v < padded_count; v++) {
        const float* d = from + 3 * (size_t)(v < vertex_count ? v : 0);
        if (d[0] == 0 && d[1] == 0 && d[2] == 0) continue;
        if (v < first) first = v;
        last = v + 1;
    }
    if (last == 0) return true;
    first = first / 8 * 8;
    last = (last + 7) / 8 * 8;
    stream->displacement = es_allocate(context, (size_t)(last - first) * 4 * sizeof(float));
    if (!stream->displacement) return false;
    stream->begin = first;
    stream->end = last;
    for (uint32_t v = first; v < last; v++) {
        float* to = stream->displacement + 4 * (size_t)(v - first);
        memcpy(to, from + 3 * (size_t)(v < vertex_count ? v : 0), 3 * sizeof(float));
        to[3] = 0;
    }
    return true;
}

bool es_morphs_fill(es_world* world, es_mesh_object* mesh, const es_mesh_desc* desc)
{
    if (!desc->target_count || !desc->vertex_count) return true;
    if (!es_mesh_make_driven(world, mesh)) return false;
    es_context* context = world->context;
    es_mesh_drive* drive = mesh->drive;
    drive->target_count = desc->target_count;
    float** weights[] = {&drive->weights, &drive->posed_weights, &drive->previous_weights, &drive->default_weights, &drive->blended};
    for (size_t i = 0; i < sizeof weights / sizeof weights[0]; i++) {
        *weights[i] = es_allocate_zero(context, desc->target_count * sizeof(float));
        if (!*weights[i]) return false;
        if (desc->weights && i < 4) memcpy(*weights[i], desc->weights, desc->target_count * sizeof(float));
    }
    const float* present[] = {mesh->positions, mesh->normals, mesh->tangents};
    for (int s = 0; s < ES_STREAMS; s++) {
        if (!present[s]) continue;
        drive->targets[s] = es_allocate_zero(context, desc->target_count * sizeof(es_morph_stream));
        if (!drive->targets[s]) return false;
        for (uint32_t t = 0; t < desc->target_count; t++) {
            const es_morph_target* target = &desc->targets[t];
            const float* from = s == ES_STREAM_POSITIONS ? target->positions : s == ES_STREAM_NORMALS ? target->normals : target->tangents;
            if (from && !fill_stream(context, from, desc->vertex_count, (uint32_t)blocks_of(mesh) * 8, &drive->targets[s][t])) return false;
        }
    }
    return true;
}


es_result es_world_set_morph_weights(es_world* world, es_mesh mesh, const float* weights, uint32_t count)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mesh_object* object = es_world_object(world, ES_OBJECT_MESH, mesh.id);
    if (!object) return ES_STALE_HANDLE;
    uint32_t targets = object->drive ? object->drive->target_count : 0;
    if (count != targets || (count && !weights))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': has %u morph targets, %u weights were given", label(object->object.name), targets, weights ? count : 0);
    if (!es_all_within(weights, count, ES_MORPH_WEIGHT))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': morph weights must be finite and within 1e6", label(object->object.name));
    if (!count || memcmp(object->drive->weights, weights, count * sizeof *weights) == 0) return ES_OK;
    memcpy(object->drive->weights, weights, count * sizeof *weights);
    world->poses_dirty = true;
    if (world->recording) es_note(world, &(es_input){.type = ES_INPUT_MORPH_WEIGHTS, .id = mesh.id, .state = {weights, count * sizeof *weights}});
    return ES_OK;
}

es_result es_world_get_morph_weights(const es_world* world, es_mesh mesh, float* weights, uint32_t* count)
{
    if (!world || !count) return ES_INVALID_ARGUMENT;
    es_mesh_object* object = es_world_object(world, ES_OBJECT_MESH, mesh.id);
    if (!object) return ES_STALE_HANDLE;
    uint32_t capacity = *count, targets = object->drive ? object->drive->target_count : 0;
    *count = targets;
    if (!weights) return ES_OK;
    if (capacity < targets) return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': has %u morph targets, room was given for %u", label(object->object.name), targets, capacity);
    if (targets) memcpy(weights, object->drive->weights, targets * sizeof *weights);
    return ES_OK;
}
