/* Skins, and the vertices of every mesh that a skin or morph targets drive.
 *
 * A joint's matrix takes a vertex from its bind pose to the axes of the skin's node. Where that node is an ancestor of the joint, it is the
 * product of the transforms between them: moving the whole creature then changes no matrix, and far from the world's zero nothing is lost. */
#include "sim/world.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/kernel_table.h"

/* Transforms multiplied from joint to node at most; a longer way goes through the world's axes. */
enum { LONGEST_WAY = 64 };
/* of a joint's matrix, its translation excepted: see sim/kernels/skin.c */
#define JOINT_EXTENT 1e8f

static const char* label(const char* name) { return name ? name : ""; }
static uint32_t blocks_of(uint32_t vertex_count) { return vertex_count ? (vertex_count + 7) / 8 : 1; }

/* ---- life ------------------------------------------------------------------------------------------------------------------------ */

static es_result check(es_world* world, const es_skin_desc* desc)
{
    es_context* context = world->context;
    const char* name = label(desc->name);
    const es_mesh_object* mesh = es_world_object(world, ES_OBJECT_MESH, desc->mesh.id);
    if (!mesh) return ES_STALE_HANDLE;
    if (desc->node.id && !es_world_object(world, ES_OBJECT_NODE, desc->node.id)) return ES_STALE_HANDLE;
    if (mesh->drive && mesh->drive->skin) return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': mesh '%.64s' has a skin already; each needs a mesh of its own", name, label(mesh->object.name));
    if (mesh->deformed) return es_fail(context, ES_WRONG_STATE, "skin '%.64s': the vertices of mesh '%.64s' were set", name, label(mesh->object.name));
    if (desc->joint_count < 1 || desc->joint_count > ES_SKIN_JOINTS || !desc->joints)
        return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': must have 1 … %d joints", name, ES_SKIN_JOINTS);
    if (desc->influences < 1 || desc->influences > ES_SKIN_INFLUENCES || (mesh->raster.vertex_count && (!desc->vertex_joints || !desc->vertex_weights)))
        return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': must have 1 … %d joints and weights per vertex", name, ES_SKIN_INFLUENCES);
    for (uint32_t j = 0; j < desc->joint_count; j++) {
        if (!es_world_object(world, ES_OBJECT_NODE, desc->joints[j].id)) return ES_STALE_HANDLE;
        if (desc->inverse_binds && !es_all_within(desc->inverse_binds[j].m, 16, ES_WORLD_EXTENT))
            return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': the inverse bind matrix of joint %u must be finite and within 1e9", name, j);
    }
    for (size_t i = 0; i < (size_t)mesh->raster.vertex_count * desc->influences; i++) {
        if (desc->vertex_weights[i] == 0) continue;
        if (!es_within(desc->vertex_weights[i], 0, 1e6f))
            return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': weights of vertex %zu must lie in 0 … 1e6", name, i / desc->influences);
        if (desc->vertex_joints[i] >= desc->joint_count)
            return es_fail(context, ES_INVALID_ARGUMENT, "skin '%.64s': vertex %zu names joint %u of %u", name, i / desc->influences, desc->vertex_joints[i], desc->joint_count);
    }
    return ES_OK;
}

/* Rows of weights by blocks; a vertex without weights is held by the identity. */
static bool fill_weights(es_context* context, es_skin_object* skin, const es_skin_desc* desc, uint32_t vertex_count)
{
    es_skin_weights* w = &skin->weights;
    const uint32_t n = desc->influences;
    w->blocks = blocks_of(vertex_count);
    w->first_row = es_allocate_array(context, w->blocks + (size_t)1, sizeof *w->first_row);
    if (!w->first_row) return false;
#define SOURCE(v) ((size_t)((v) < vertex_count ? (v) : 0) * n)
    size_t rows = 0;
    for (uint32_t b = 0; b < w->blocks; b++) {
        uint32_t most = 1;
        for (uint32_t v = 8 * b; vertex_count && v < 8 * b + 8; v++) {
            uint32_t used = 0;
            for (uint32_t i = 0; i < n; i++) used += desc->vertex_weights[SOURCE(v) + i] != 0;
            if (used > most) most = used;
        }
        w->first_row[b] = (uint32_t)rows; /* at most 2^25 blocks of 16 */
        rows += most;
    }
    w->first_row[w->blocks] = (uint32_t)rows;
    w->row_count = rows;
    w->joints = es_allocate_array(context, rows, 8 * sizeof *w->joints);
    w->weights = w->joints ? es_allocate_zero(context, rows * 8 * sizeof *w->weights) : NULL;
    if (!w->weights) return false;
    for (size_t i = 0; i < rows * 8; i++) w->joints[i] = desc->joint_count;
    for (uint32_t v = 0; v < 8 * w->blocks; v++) {
        size_t row = w->first_row[v / 8], lane = v % 8;
        double sum = 0;
        for (uint32_t i = 0; vertex_count && i < n; i++) sum += (double)desc->vertex_weights[SOURCE(v) + i];
        if (!(sum > 1e-30)) {
            w->weights[row * 8 + lane] = 1;
            continue;
        }
        for (uint32_t i = 0; i < n; i++) {
            float weight = desc->vertex_weights[SOURCE(v) + i];
            if (weight == 0) continue;
            w->joints[row * 8 + lane] = desc->vertex_joints[SOURCE(v) + i];
            w->weights[row * 8 + lane] = (float)((double)weight / sum);
            row++;
        }
    }
#undef SOURCE
    return true;
}

/* How many parents lie between a joint and the skin's node; LONGEST_WAY: too many, or the node is none of them. */
static uint32_t way_to(const es_world* world, es_node joint, es_node node)
{
    const es_slots* slots = &world->slots[ES_OBJECT_NODE];
    const es_node_object* each = es_slots_get(slots, joint.id);
    for (uint32_t steps = 0; node.id && each->parent.id && steps < LONGEST_WAY; steps++) {
        if (each->parent.id == node.id) return steps;
        each = es_slots_get(slots, each->parent.id);
    }
    return LONGEST_WAY;
}

static size_t palette_floats(const es_skin_object* skin) { return (skin->joint_count + (size_t)1) * ES_JOINT_FLOATS; }

void es_skin_object_free(es_world* world, es_skin_object* skin)
{
    es_context* context = world->context;
    es_release(context, skin->joints, skin->joint_count * sizeof *skin->joints);
    es_release(context, skin->ways, skin->joint_count * sizeof *skin->ways);
    es_release(context, skin->inverse_binds, skin->joint_count * sizeof *skin->inverse_binds);
    float* palettes[] = {skin->palette, skin->next_palette, skin->previous_palette};
    for (int i = 0; i < 3; i++) es_release(context, palettes[i], palette_floats(skin) * sizeof(float));
    es_release(context, skin->weights.first_row, (skin->weights.blocks + (size_t)1) * sizeof *skin->weights.first_row);
    es_release(context, skin->weights.joints, skin->weights.row_count * 8 * sizeof *skin->weights.joints);
    es_release(context, skin->weights.weights, skin->weights.row_count * 8 * sizeof *skin->weights.weights);
}

static bool fill(es_world* world, es_skin_object* skin, const es_skin_desc* desc, es_mesh_object* mesh)
{
    es_context* context = world->context;
    skin->mesh = desc->mesh;
    skin->node = desc->node;
    skin->joint_count = desc->joint_count;
    skin->joints = es_allocate_array(context, desc->joint_count, sizeof *skin->joints);
    if (!skin->joints) return false;
    memcpy(skin->joints, desc->joints, desc->joint_count * sizeof *skin->joints);
    skin->ways = es_allocate_array(context, desc->joint_count, sizeof *skin->ways);
    if (!skin->ways) return false;
    for (uint32_t j = 0; j < desc->joint_count; j++) skin->ways[j] = (uint8_t)way_to(world, desc->joints[j], desc->node);
    skin->inverse_binds = es_allocate_array(context, desc->joint_count, sizeof *skin->inverse_binds);
    if (!skin->inverse_binds) return false;
    for (uint32_t j = 0; j < desc->joint_count; j++) skin->inverse_binds[j] = desc->inverse_binds ? desc->inverse_binds[j] : es_mat4_identity();
    float** palettes[] = {&skin->palette, &skin->next_palette, &skin->previous_palette};
    for (int i = 0; i < 3; i++) {
        *palettes[i] = es_allocate_zero(context, palette_floats(skin) * sizeof(float));
        if (!*palettes[i]) return false;
        float* identity = *palettes[i] + (size_t)desc->joint_count * ES_JOINT_FLOATS;
        identity[0] = identity[5] = identity[10] = 1;
    }
    return fill_weights(context, skin, desc, mesh->raster.vertex_count) && es_mesh_make_driven(world, mesh);
}

es_result es_world_add_skin(es_world* world, const es_skin_desc* desc, es_skin* skin)
{
    if (!world) return ES_INVALID_ARGUMENT;
    if (!desc || !skin) return es_misuse(world->context, ES_INVALID_ARGUMENT, "es_world_add_skin: desc and skin must not be NULL");
    *skin = (es_skin){0};
    es_result result = check(world, desc);
    if (result != ES_OK) return result;
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], desc->mesh.id);
    es_skin_object* object = es_slots_add(world->context, &world->slots[ES_OBJECT_SKIN], "skin", desc->name);
    if (!object) return es_context_last_result(world->context);
    es_fp_environment environment = es_fp_enter();
    bool filled = fill(world, object, desc, mesh);
    es_fp_leave(environment);
    if (!filled) {
        es_skin_object_free(world, object);
        es_slots_remove(world->context, &world->slots[ES_OBJECT_SKIN], &object->object);
        return es_context_last_result(world->context);
    }
    mesh->drive->skin = object->object.id;
    mesh->drive->stale = world->poses_dirty = true;
    mesh->moving = false;
    es_world_rereference(world, ES_OBJECT_MESH, 0, desc->mesh.id);
    es_world_rereference(world, ES_OBJECT_NODE, 0, desc->node.id);
    for (uint32_t j = 0; j < desc->joint_count; j++) es_world_rereference(world, ES_OBJECT_NODE, 0, desc->joints[j].id);
    skin->id = object->object.id;
    return ES_OK;
}

es_result es_world_get_skin(const es_world* world, es_skin skin, es_skin_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    const es_skin_object* object = es_world_object(world, ES_OBJECT_SKIN, skin.id);
    if (!object) return ES_STALE_HANDLE;
    *state = (es_skin_state){object->mesh, object->node, object->joint_count, object->joints};
    return ES_OK;
}

es_result es_world_destroy_skin(es_world* world, es_skin skin)
{
    if (!world) return ES_INVALID_ARGUMENT;
    es_skin_object* object = es_world_object(world, ES_OBJECT_SKIN, skin.id);
    if (!object) return ES_STALE_HANDLE;
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], object->mesh.id);
    mesh->drive->skin = 0;
    mesh->drive->stale = world->poses_dirty = true;
    mesh->moving = false;
    es_world_rereference(world, ES_OBJECT_MESH, object->mesh.id, 0);
    es_world_rereference(world, ES_OBJECT_NODE, object->node.id, 0);
    for (uint32_t j = 0; j < object->joint_count; j++) es_world_rereference(world, ES_OBJECT_NODE, object->joints[j].id, 0);
    es_skin_object_free(world, object);
    es_slots_remove(world->context, &world->slots[ES_OBJECT_SKIN], &object->object);
    return ES_OK;
}

/* ---- matrices -------------------------------------------------------------------------------------------------------------------- */

/* A joint's matrix to the axes of the skin's node; false when these have no inverse. */
static bool joint_matrix(const es_world* world, const es_skin_object* skin, uint32_t j, es_mat4* matrix)
{
    const es_slots* slots = &world->slots[ES_OBJECT_NODE];
    const es_node_object* joint = es_slots_get(slots, skin->joints[j].id);
    if (!skin->node.id) {
        *matrix = joint->world;
        return true;
    }
    if (skin->ways[j] < LONGEST_WAY) {
        *matrix = joint->local;
        for (uint32_t step = 0; step < skin->ways[j]; step++) {
            joint = es_slots_get(slots, joint->parent.id);
            *matrix = es_mat4_mul(joint->local, *matrix);
        }
        return true;
    }
    const es_node_object* node = es_slots_get(slots, skin->node.id);
    es_mat4 axes = node->world, inverse, from = joint->world;
    axes.m[12] = axes.m[13] = axes.m[14] = 0;
    if (!es_mat4_inverse(&axes, &inverse)) return false;
    for (int k = 0; k < 3; k++) from.m[12 + k] = (float)(joint->position[k] - node->position[k]);
    *matrix = es_mat4_mul(inverse, from);
    return true;
}

static void fill_palette(const es_world* world, const es_skin_object* skin, float* palette)
{
    for (uint32_t j = 0; j < skin->joint_count; j++, palette += ES_JOINT_FLOATS) {
        es_mat4 matrix;
        bool good = joint_matrix(world, skin, j, &matrix);
        if (good) matrix = es_mat4_mul(matrix, skin->inverse_binds[j]);
        for (int column = 0; good && column < 4; column++) good = es_all_within(matrix.m + 4 * column, 3, column < 3 ? JOINT_EXTENT : ES_WORLD_EXTENT);
        if (!good) matrix = es_mat4_identity(); /* what cannot be placed stays in its bind pose */
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 4; column++) palette[4 * row + column] = matrix.m[4 * column + row];
    }
}

/* ---- vertices -------------------------------------------------------------------------------------------------------------------- */

typedef struct pose_loop {
    const es_sim_kernels* kernels;
    const es_mesh_drive* drive;
    const float* weights;
    const es_skin_weights* skin;
    const float* palette;
    const float* rest[ES_STREAMS];
    float* to[ES_STREAMS];
} pose_loop;

static void pose_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pose_loop* loop = user;
    const es_mesh_drive* drive = loop->drive;
    es_skin_job job = {loop->skin, loop->palette, {loop->rest[0], loop->rest[1], loop->rest[2]}, {loop->to[0], loop->to[1], loop->to[2]}};
    for (int s = 0; s < ES_STREAMS; s++) {
        if (!loop->to[s] || (!drive->targets[s] && loop->skin)) continue;
        float* to = loop->to[s];
        memcpy(to + (size_t)begin * 32, loop->rest[s] + (size_t)begin * 32, (size_t)(end - begin) * 32 * sizeof(float));
        for (uint32_t t = 0; drive->targets[s] && t < drive->target_count; t++) {
            const es_morph_stream* stream = &drive->targets[s][t];
            uint32_t from = stream->begin / 8 > begin ? stream->begin / 8 : begin, until = stream->end / 8 < end ? stream->end / 8 : end;
            if (loop->weights[t] == 0 || from >= until) continue;
            loop->kernels->morph(to + (size_t)from * 32, stream->displacement + ((size_t)from * 8 - stream->begin) * 4, loop->weights[t], 0, until - from);
        }
        if (s != ES_STREAM_POSITIONS && drive->targets[s] && !loop->skin) loop->kernels->unit(to, loop->rest[s], begin, end);
        job.from[s] = to;
    }
    if (loop->skin) loop->kernels->skin(&job, begin, end);
    loop->kernels->bounds(loop->to[ES_STREAM_POSITIONS], begin, end, drive->chunk_bounds + begin / (ES_DEFORM_GRAIN / 8) * 8);
}

/* Vertices by weights and palette into the mesh's streams, positions into `positions`; their box. Where normals and tangents are not wanted
 * (last frame's vertices) `positions_only` leaves them alone. */
static void pose(es_world* world, es_mesh_object* mesh, const float* weights, const float* palette, float* positions, bool positions_only, es_vec3 box[2])
{
    es_mesh_drive* drive = mesh->drive;
    const es_skin_object* skin = es_slots_get(&world->slots[ES_OBJECT_SKIN], drive->skin);
    pose_loop loop = {
        .kernels = es_sim_kernel_table(es_context_isa(world->context)),
        .drive = drive,
        .weights = weights,
        .skin = skin ? &skin->weights : NULL,
        .palette = palette,
        .rest = {mesh->rest, mesh->rest_normals, mesh->rest_tangents},
        .to = {positions, positions_only ? NULL : mesh->normals, positions_only ? NULL : mesh->tangents},
    };
    uint32_t blocks = blocks_of(mesh->raster.vertex_count), grain = ES_DEFORM_GRAIN / 8;
    es_parallel_for(world->context, blocks, grain, pose_body, &loop);
    const float* b = drive->chunk_bounds;
    for (uint32_t chunk = 0; chunk < (blocks + grain - 1) / grain; chunk++, b += 8) {
        es_vec3 low = es_v3(b[0], b[1], b[2]), high = es_v3(b[4], b[5], b[6]);
        box[0] = chunk ? es_v3(es_minf(box[0].x, low.x), es_minf(box[0].y, low.y), es_minf(box[0].z, low.z)) : low;
        box[1] = chunk ? es_v3(es_maxf(box[1].x, high.x), es_maxf(box[1].y, high.y), es_maxf(box[1].z, high.z)) : high;
    }
}

static void refresh_mesh(es_world* world, es_mesh_object* mesh)
{
    es_mesh_drive* drive = mesh->drive;
    es_skin_object* skin = es_slots_get(&world->slots[ES_OBJECT_SKIN], drive->skin);
    bool differs = drive->stale || (drive->target_count && memcmp(drive->weights, drive->posed_weights, drive->target_count * sizeof(float)) != 0);
    if (skin) {
        fill_palette(world, skin, skin->next_palette);
        differs |= memcmp(skin->palette, skin->next_palette, palette_floats(skin) * sizeof(float)) != 0;
    }
    if (!differs) return;
    if (drive->stale) {
        /* it never had other vertices, or belongs to a restored state, which says where they were */
        if (mesh->moving) pose(world, mesh, drive->previous_weights, skin ? skin->previous_palette : NULL, mesh->previous, true, mesh->previous_box);
        mesh->raster.previous_positions = mesh->moving ? mesh->previous : NULL;
    } else if (!mesh->moving && world->stepped) { /* the first change since the step began: what is there now is last frame's */
        float* vertices = mesh->positions;
        mesh->positions = mesh->previous;
        mesh->previous = vertices;
        mesh->raster.positions = mesh->positions;
        mesh->raster.previous_positions = mesh->previous;
        memcpy(mesh->previous_box, mesh->box, sizeof mesh->box);
        if (drive->target_count) memcpy(drive->previous_weights, drive->posed_weights, drive->target_count * sizeof(float));
        if (skin) memcpy(skin->previous_palette, skin->palette, palette_floats(skin) * sizeof(float));
        mesh->moving = true;
    }
    drive->stale = false;
    if (skin) {
        float* palette = skin->palette;
        skin->palette = skin->next_palette;
        skin->next_palette = palette;
    }
    if (drive->target_count) memcpy(drive->posed_weights, drive->weights, drive->target_count * sizeof(float));
    pose(world, mesh, drive->weights, skin ? skin->palette : NULL, mesh->positions, false, mesh->box);
    mesh->raster.revision = es_context_next_serial(world->context);
    es_mesh_join_boxes(mesh);
    if (mesh->object.references) world->geometry_touched = world->list_dirty = true;
}

void es_meshes_refresh(es_world* world)
{
    if (!world->poses_dirty) return;
    world->poses_dirty = false;
    const es_slots* slots = &world->slots[ES_OBJECT_MESH];
    for (uint32_t slot = 0; world->driven_meshes && slot < slots->slot_count; slot++) {
        es_mesh_object* mesh = es_slots_at(slots, slot);
        if (mesh && mesh->drive) refresh_mesh(world, mesh);
    }
}
