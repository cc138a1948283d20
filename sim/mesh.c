/* Meshes: streams of four floats as raster/raster.h wants them, smooth normals, deformation. */
#include "sim/world.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/normals.h"

/* 3 × triangle_count and 4 × vertex_count stay below 2^31, what 32-bit gathers can address */
enum { MAX_VERTICES = 1 << 28, MAX_TRIANGLES = 1 << 28, STREAM_PAD = 8 };

static size_t padded(uint32_t vertex_count)
{
    size_t count = ((size_t)vertex_count + STREAM_PAD - 1) / STREAM_PAD * STREAM_PAD;
    return count ? count : STREAM_PAD;
}
size_t es_mesh_stream_bytes(uint32_t vertex_count) { return padded(vertex_count) * 4 * sizeof(float); }
static size_t index_bytes(uint32_t triangle_count) { return ((size_t)triangle_count * 3 + 1) * sizeof(uint32_t); }

static const char* label(const char* name) { return name ? name : ""; }

/* A stream from `components` floats per vertex; missing components come from `fill`, padding vertices repeat vertex 0. */
static void write_stream(float* stream, const float* source, int components, const float fill[4], uint32_t vertex_count)
{
    size_t total = padded(vertex_count);
    for (size_t v = 0; v < total; v++) {
        size_t from = v < vertex_count ? v : 0;
        for (int c = 0; c < 4; c++) stream[4 * v + c] = c < components && vertex_count ? source[from * components + c] : fill[c];
    }
}

/* Normals smooth over the triangles that share a vertex index, weighted by area, summed in triangle order in double: the
 * cross product of differences up to 2e9 and its square fit easily. Vertices without area point up. */
static bool smooth_normals(es_context* context, const float* positions, const uint32_t* indices, uint32_t vertex_count, uint32_t triangle_count, float* normals)
{
    size_t bytes = (size_t)vertex_count * 3 * sizeof(double);
    double* sum = es_allocate_zero(context, bytes);
    if (!sum) return false;
    for (uint32_t t = 0; t < triangle_count; t++) {
        const float *a = positions + 4 * (size_t)indices[3 * t], *b = positions + 4 * (size_t)indices[3 * t + 1], *c = positions + 4 * (size_t)indices[3 * t + 2];
        double ux = (double)b[0] - a[0], uy = (double)b[1] - a[1], uz = (double)b[2] - a[2];
        double vx = (double)c[0] - a[0], vy = (double)c[1] - a[1], vz = (double)c[2] - a[2];
        double n[3] = {uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx};
        for (int corner = 0; corner < 3; corner++)
            for (int k = 0; k < 3; k++) sum[3 * (size_t)indices[3 * t + corner] + k] += n[k];
    }
    size_t total = padded(vertex_count);
    for (size_t v = 0; v < total; v++) {
        const double* n = sum + 3 * (v < vertex_count ? v : 0);
        double squared = vertex_count ? n[0] * n[0] + n[1] * n[1] + n[2] * n[2] : 0, length = __builtin_sqrt(squared);
        bool good = squared >= 1e-280;
        for (int k = 0; k < 3; k++) normals[4 * v + k] = good ? (float)(n[k] / length) : k == 1;
        normals[4 * v + 3] = 0;
    }
    es_release(context, sum, bytes);
    return true;
}

static bool direction_usable(const float* n)
{
    double squared = (double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2];
    return squared > 1e-12 && squared < 1e12;
}

static void box_of(const float* p, uint32_t count, es_vec3 box[2])
{
    box[0] = box[1] = count ? es_v3(p[0], p[1], p[2]) : es_v3(0, 0, 0);
    for (uint32_t v = 0; v < count; v++, p += 4) {
        box[0] = es_v3(es_minf(box[0].x, p[0]), es_minf(box[0].y, p[1]), es_minf(box[0].z, p[2]));
        box[1] = es_v3(es_maxf(box[1].x, p[0]), es_maxf(box[1].y, p[1]), es_maxf(box[1].z, p[2]));
    }
}

void es_mesh_join_boxes(es_mesh_object* mesh)
{
    es_vec3 low = mesh->box[0], high = mesh->box[1];
    if (mesh->raster.previous_positions) {
        const es_vec3* before = mesh->previous_box;
        low = es_v3(es_minf(low.x, before[0].x), es_minf(low.y, before[0].y), es_minf(low.z, before[0].z));
        high = es_v3(es_maxf(high.x, before[1].x), es_maxf(high.y, before[1].y), es_maxf(high.z, before[1].z));
    }
    mesh->raster.bounds_min = low;
    mesh->raster.bounds_max = high;
}

static void update_bounds(es_mesh_object* mesh)
{
    box_of(mesh->positions, mesh->raster.vertex_count, mesh->box);
    if (mesh->raster.previous_positions) box_of(mesh->raster.previous_positions, mesh->raster.vertex_count, mesh->previous_box);
    es_mesh_join_boxes(mesh);
}

void es_mesh_object_free(es_world* world, es_mesh_object* mesh)
{
    size_t bytes = es_mesh_stream_bytes(mesh->raster.vertex_count);
    es_mesh_drive_free(world, mesh);
    if (mesh->fans) {
        es_vertex_fans_free(world->context, mesh->fans);
        es_release(world->context, mesh->fans, sizeof *mesh->fans);
    }
    float* streams[] = {mesh->positions, mesh->previous, mesh->rest, mesh->rest_normals, mesh->rest_tangents, mesh->normals, mesh->tangents, mesh->uvs, mesh->colors};
    for (size_t i = 0; i < sizeof streams / sizeof streams[0]; i++) es_release(world->context, streams[i], bytes);
    es_release(world->context, mesh->indices, index_bytes(mesh->raster.triangle_count));
}

static es_result check_desc(es_world* world, const es_mesh_desc* desc)
{
    es_context* context = world->context;
    const char* name = label(desc->name);
    if (desc->vertex_count > MAX_VERTICES || desc->triangle_count > MAX_TRIANGLES)
        return es_fail(context, ES_INVALID_ARGUMENT, "mesh '%.64s': %u vertices and %u triangles; at most 2^28 of each are accepted", name, desc->vertex_count, desc->triangle_count);
    if ((desc->vertex_count && !desc->positions) || (desc->triangle_count && !desc->indices))
        return es_misuse(context, ES_INVALID_ARGUMENT, "mesh '%.64s': positions and indices must not be NULL", name);
    for (size_t v = 0; v < desc->vertex_count; v++)
        if (!es_all_within(desc->positions + 3 * v, 3, ES_WORLD_EXTENT))
            return es_fail(context, ES_INVALID_ARGUMENT, "mesh '%.64s': vertex %zu must be finite and within 1e9", name, v);
    const struct { const float* data; int components; const char* what; } others[] = {
        {desc->normals, 3, "normal"}, {desc->tangents, 4, "tangent"}, {desc->uv0, 2, "uv0"}, {desc->uv1, 2, "uv1"}, {desc->colors, 4, "colour"}};
    for (size_t k = 0; k < sizeof others / sizeof others[0]; k++)
        for (size_t i = 0; others[k].data && i < (size_t)desc->vertex_count * others[k].components; i++)
            if (!es_within(others[k].data[i], -ES_WORLD_EXTENT, ES_WORLD_EXTENT))
                return es_fail(context, ES_INVALID_ARGUMENT, "mesh '%.64s': the %s of vertex %zu must be finite and within 1e9", name, others[k].what, i / others[k].components);
    for (size_t i = 0; i < (size_t)desc->triangle_count * 3; i++)
        if (desc->indices[i] >= desc->vertex_count)
            return es_fail(context, ES_INVALID_ARGUMENT, "mesh '%.64s': triangle %zu names vertex %u of %u", name, i / 3, desc->indices[i], desc->vertex_count);
    return es_morph_desc_check(world, desc);
}

/* Fills an already referenced mesh object; false when memory ran out, to be freed by the caller. */
static bool fill(es_world* world, es_mesh_object* mesh, const es_mesh_desc* desc)
{
    static const float position[4] = {0, 0, 0, 1}, zero[4] = {0, 0, 0, 0}, white[4] = {1, 1, 1, 1};
    es_context* context = world->context;
    uint32_t count = desc->vertex_count;
    size_t bytes = es_mesh_stream_bytes(count);
    mesh->raster.vertex_count = count;
    mesh->raster.triangle_count = desc->triangle_count;
    mesh->raster.revision = mesh->raster.rest_revision = es_context_next_serial(world->context);
    mesh->positions = es_allocate(context, bytes);
    if (!mesh->positions) return false;
    mesh->indices = es_allocate(context, index_bytes(desc->triangle_count));
    if (!mesh->indices) return false;
    write_stream(mesh->positions, desc->positions, 3, position, count);
    if (desc->triangle_count) memcpy(mesh->indices, desc->indices, (size_t)desc->triangle_count * 3 * sizeof(uint32_t));
    mesh->indices[(size_t)desc->triangle_count * 3] = 0;

    if (desc->normals || !desc->flat_normals) {
        mesh->normals = es_allocate(context, bytes);
        if (!mesh->normals) return false;
        bool usable = desc->normals != NULL;
        for (uint32_t v = 0; usable && v < count; v++) usable = direction_usable(desc->normals + 3 * (size_t)v);
        if (!usable && !smooth_normals(context, mesh->positions, mesh->indices, count, desc->triangle_count, mesh->normals)) return false;
        /* a given normal without a direction is replaced by the computed one */
        if (usable) write_stream(mesh->normals, desc->normals, 3, zero, count);
        else if (desc->normals)
            for (uint32_t v = 0; v < count; v++)
                if (direction_usable(desc->normals + 3 * (size_t)v)) memcpy(mesh->normals + 4 * (size_t)v, desc->normals + 3 * (size_t)v, 3 * sizeof(float));
    }
    if (desc->tangents) {
        mesh->tangents = es_allocate(context, bytes);
        if (!mesh->tangents) return false;
        write_stream(mesh->tangents, desc->tangents, 4, zero, count);
        for (size_t v = 0; v < padded(count); v++) mesh->tangents[4 * v + 3] = mesh->tangents[4 * v + 3] < 0 ? -1.0f : 1.0f;
    }
    if (desc->uv0 || desc->uv1) {
        mesh->uvs = es_allocate_zero(context, bytes);
        if (!mesh->uvs) return false;
        for (size_t v = 0; v < count; v++) {
            if (desc->uv0) memcpy(mesh->uvs + 4 * v, desc->uv0 + 2 * v, 2 * sizeof(float));
            if (desc->uv1) memcpy(mesh->uvs + 4 * v + 2, desc->uv1 + 2 * v, 2 * sizeof(float));
        }
    }
    if (desc->colors) {
        mesh->colors = es_allocate(context, bytes);
        if (!mesh->colors) return false;
        write_stream(mesh->colors, desc->colors, 4, white, count);
    }
    es_raster_mesh* raster = &mesh->raster;
    raster->positions = mesh->positions;
    raster->normals = mesh->normals;
    raster->tangents = mesh->tangents;
    raster->uvs = mesh->uvs;
    raster->colors = mesh->colors;
    raster->indices = mesh->indices;
    update_bounds(mesh);
    return es_morphs_fill(world, mesh, desc);
}

es_result es_world_add_mesh(es_world* world, const es_mesh_desc* desc, es_mesh* mesh)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !mesh) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_mesh: desc and mesh must not be NULL");
    *mesh = (es_mesh){0};
    es_result result = check_desc(world, desc);
    es_fp_environment environment = es_fp_enter();
    if (result == ES_OK) {
        es_mesh_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_MESH], "mesh", desc->name);
        if (object && fill(world, object, desc)) {
            mesh->id = object->object.id;
        } else {
            result = es_context_last_result(world->context);
            if (object) {
                es_mesh_object_free(world, object);
                es_slots_remove(world->context, &world->slots[ES_OBJECT_MESH], &object->object);
            }
        }
    }
    es_fp_leave(environment);
    return result;
}

es_result es_world_destroy_mesh(es_world* world, es_mesh mesh)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mesh_object* object = es_world_object(world, ES_OBJECT_MESH, mesh.id);
    if (!object) return ES_STALE_HANDLE;
    if (object->object.references)
        return es_misuse(world->context, ES_WRONG_STATE, "mesh '%.64s' cannot be destroyed: %u instances or skins use it", label(object->object.name), object->object.references);
    es_mesh_object_free(world, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_MESH], &object->object);
    return ES_OK;
}

bool es_mesh_make_deformable(es_world* world, es_mesh_object* mesh)
{
    size_t bytes = es_mesh_stream_bytes(mesh->raster.vertex_count);
    if (!mesh->previous) {
        mesh->previous = es_allocate(world->context, bytes);
        if (!mesh->previous) return false;
    }
    if (!mesh->rest) {
        mesh->rest = es_allocate(world->context, bytes);
        if (!mesh->rest) return false;
        memcpy(mesh->rest, mesh->positions, bytes);
        mesh->raster.rest_positions = mesh->rest;
    }
    if (mesh->normals && !mesh->rest_normals) {
        mesh->rest_normals = es_allocate(world->context, bytes);
        if (!mesh->rest_normals) return false;
        memcpy(mesh->rest_normals, mesh->normals, bytes);
    }
    return true;
}

/* Before vertices are written: the first change since the step began makes what is there last frame's. */
static void begin_change(es_world* world, es_mesh_object* mesh)
{
    if (!mesh->moving && world->stepped) {
        memcpy(mesh->previous, mesh->positions, es_mesh_stream_bytes(mesh->raster.vertex_count));
        mesh->raster.previous_positions = mesh->previous;
        mesh->moving = true;
    }
    mesh->deformed = true;
}

static void end_change(es_world* world, es_mesh_object* mesh)
{
    mesh->raster.revision = es_context_next_serial(world->context);
    update_bounds(mesh);
    if (mesh->object.references) world->geometry_touched = world->list_dirty = true;
}

es_result es_world_deform_mesh(es_world* world, es_mesh mesh, const float* positions, const float* normals)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mesh_object* object = es_world_object(world, ES_OBJECT_MESH, mesh.id);
    if (!object) return ES_STALE_HANDLE;
    const char* name = label(object->object.name);
    size_t count = object->raster.vertex_count;
    if (!positions) return es_misuse(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': new positions must not be NULL", name);
    if (object->drive) return es_fail(world->context, ES_WRONG_STATE, "mesh '%.64s': its vertices follow its skin or morph targets", name);
    if (normals && !object->normals) return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s' stores no normals: pass NULL", name);
    if (!es_all_within(positions, 3 * count, ES_WORLD_EXTENT) || (normals && !es_all_within(normals, 3 * count, ES_WORLD_EXTENT)))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "mesh '%.64s': new vertices must be finite and within 1e9", name);
    if (!es_mesh_make_deformable(world, object)) return es_context_last_result(world->context);

    bool differs = false;
    for (size_t v = 0; v < count && !differs; v++)
        differs = memcmp(object->positions + 4 * v, positions + 3 * v, 3 * sizeof(float)) != 0 ||
                  (normals && memcmp(object->normals + 4 * v, normals + 3 * v, 3 * sizeof(float)) != 0);
    if (!differs) return ES_OK;
    begin_change(world, object);
    for (size_t v = 0, total = padded(object->raster.vertex_count); v < total; v++) {
        size_t from = v < count ? v : 0;
        memcpy(object->positions + 4 * v, positions + 3 * from, 3 * sizeof(float));
        if (normals && direction_usable(normals + 3 * from)) memcpy(object->normals + 4 * v, normals + 3 * from, 3 * sizeof(float));
    }
    end_change(world, object);
    return ES_OK;
}

bool es_mesh_take_positions(es_world* world, es_mesh_object* mesh, const float* positions, bool* changed)
{
    const size_t count = mesh->raster.vertex_count;
    *changed = false;
    if (!es_mesh_make_deformable(world, mesh)) return false;
    if (memcmp(mesh->positions, positions, count * 4 * sizeof(float)) == 0) return true;
    *changed = true;
    begin_change(world, mesh);
    memcpy(mesh->positions, positions, count * 4 * sizeof(float));
    for (size_t v = count, total = padded(mesh->raster.vertex_count); v < total; v++) memcpy(mesh->positions + 4 * v, positions, 4 * sizeof(float));
    end_change(world, mesh);
    return true;
}

void es_mesh_reindexed(es_world* world, es_mesh_object* mesh)
{
    if (mesh->fans) {
        es_vertex_fans_free(world->context, mesh->fans);
        es_release(world->context, mesh->fans, sizeof *mesh->fans);
        mesh->fans = NULL;
    }
    mesh->raster.revision = mesh->raster.rest_revision = es_context_next_serial(world->context);
    if (mesh->object.references) world->geometry_touched = world->list_dirty = true;
}

void es_mesh_copy_vertex(es_mesh_object* mesh, uint32_t to, uint32_t from)
{
    float* streams[] = {mesh->tangents, mesh->uvs, mesh->colors, mesh->rest, mesh->rest_normals};
    for (size_t i = 0; i < sizeof streams / sizeof streams[0]; i++)
        if (streams[i]) memcpy(streams[i] + 4 * (size_t)to, streams[i] + 4 * (size_t)from, 4 * sizeof(float));
}

bool es_mesh_reserve(es_world* world, es_mesh_object* mesh, uint32_t extra)
{
    es_context* context = world->context;
    const uint32_t before = mesh->raster.vertex_count, after = before + extra;
    float** streams[] = {&mesh->positions, &mesh->normals, &mesh->tangents, &mesh->uvs, &mesh->colors, &mesh->previous, &mesh->rest, &mesh->rest_normals, &mesh->rest_tangents};
    enum { STREAMS = sizeof streams / sizeof streams[0] };
    float* larger[STREAMS] = {0};
    bool good = after <= MAX_VERTICES;
    if (!good) es_fail(context, ES_INVALID_ARGUMENT, "mesh '%.64s': no room for %u more vertices", label(mesh->object.name), extra);
    for (size_t i = 0; i < STREAMS && good; i++)
        if (*streams[i]) good = (larger[i] = es_allocate(context, es_mesh_stream_bytes(after))) != NULL;
    for (size_t i = 0; i < STREAMS; i++) {
        if (!larger[i]) continue;
        if (!good) {
            es_release(context, larger[i], es_mesh_stream_bytes(after));
            continue;
        }
        memcpy(larger[i], *streams[i], (size_t)before * 4 * sizeof(float));
        for (size_t v = before, total = padded(after); v < total; v++) memcpy(larger[i] + 4 * v, *streams[i], 4 * sizeof(float));
        es_release(context, *streams[i], es_mesh_stream_bytes(before));
        *streams[i] = larger[i];
    }
    if (!good) return false;
    es_raster_mesh* raster = &mesh->raster;
    raster->vertex_count = after;
    raster->positions = mesh->positions;
    raster->normals = mesh->normals;
    raster->tangents = mesh->tangents;
    raster->uvs = mesh->uvs;
    raster->colors = mesh->colors;
    if (raster->previous_positions) raster->previous_positions = mesh->previous;
    if (raster->rest_positions) raster->rest_positions = mesh->rest;
    es_mesh_reindexed(world, mesh);
    return true;
}

es_result es_world_recompute_normals(es_world* world, es_mesh mesh)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_mesh_object* object = es_world_object(world, ES_OBJECT_MESH, mesh.id);
    if (!object) return ES_STALE_HANDLE;
    const char* name = label(object->object.name);
    if (!object->normals) return ES_OK; /* the triangles' own are used */
    if (object->drive) return es_fail(world->context, ES_WRONG_STATE, "mesh '%.64s': its vertices follow its skin or morph targets", name);
    if (!es_mesh_make_deformable(world, object)) return es_context_last_result(world->context);
    es_fp_environment environment = es_fp_enter();
    bool good = es_mesh_recompute_normals(world, object);
    es_fp_leave(environment);
    if (!good) return es_context_last_result(world->context);
    if (object->object.references) world->geometry_touched = world->list_dirty = true;
    return ES_OK;
}

bool es_mesh_recompute_normals(es_world* world, es_mesh_object* mesh)
{
    es_context* context = world->context;
    if (!mesh->fans) {
        es_vertex_fans* fans = es_allocate(context, sizeof *fans);
        size_t bytes = (mesh->raster.vertex_count + (size_t)1) * sizeof(uint32_t);
        uint32_t* welded = fans ? es_allocate(context, bytes) : NULL;
        bool good = welded && es_weld_vertices(context, mesh->rest, mesh->rest_normals, mesh->raster.vertex_count, welded) &&
                    es_vertex_fans_make(context, mesh->indices, mesh->raster.triangle_count, mesh->raster.vertex_count, welded, fans);
        es_release(context, welded, bytes);
        if (!good) {
            es_release(context, fans, sizeof *fans);
            return false;
        }
        mesh->fans = fans;
    }
    es_normals_recompute(context, mesh->fans, mesh->indices, mesh->positions, mesh->box[0], mesh->box[1], mesh->normals);
    mesh->deformed = true;
    mesh->raster.revision = es_context_next_serial(context);
    return true;
}

void es_meshes_settle(es_world* world)
{
    const es_slots* slots = &world->slots[ES_OBJECT_MESH];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_mesh_object* mesh = es_slots_at(slots, slot);
        if (!mesh || !mesh->moving) continue;
        mesh->moving = false;
        mesh->raster.previous_positions = NULL;
        es_mesh_join_boxes(mesh);
        world->list_dirty = true;
    }
}

void es_mesh_restored(es_world* world, es_mesh_object* mesh)
{
    if (mesh->drive) {
        mesh->drive->stale = world->poses_dirty = true;
        return;
    }
    mesh->raster.revision = es_context_next_serial(world->context);
    mesh->raster.previous_positions = mesh->moving ? mesh->previous : NULL;
    update_bounds(mesh);
}

const es_raster_mesh* es_world_mesh(const es_world* world, es_mesh mesh)
{
    es_mesh_object* object = world ? es_world_object(world, ES_OBJECT_MESH, mesh.id) : NULL;
    if (object && object->drive) es_world_refresh(world);
    return object ? &object->raster : NULL;
}
