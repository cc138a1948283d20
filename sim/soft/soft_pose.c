/* Cloth and soft bodies into their meshes, in the axes of their nodes, between the last two fixed steps. */
#include "sim/dynamics.h"
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"

typedef struct pose_job {
    const es_soft_object* soft;
    double inverse[9], shift[3];   /* world to node, column-major; the body's origin from the node's */
    float alpha;
    float* positions;              /* 4 per vertex */
} pose_job;

static void between(const es_soft_object* soft, uint32_t particle, float alpha, float p[3])
{
    const size_t at = 4 * (size_t)soft->layout.slot_of[particle];
    for (int k = 0; k < 3; k++) p[k] = alpha >= 1 ? soft->x[at + k] : soft->before[at + k] + (soft->x[at + k] - soft->before[at + k]) * alpha;
}

static void pose_body(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    const pose_job* job = user;
    const es_soft_object* soft = job->soft;
    for (uint32_t v = begin; v < end; v++) {
        float p[3] = {0, 0, 0}, q[3];
        if (soft->tetrahedron_count == 0) {
            between(soft, soft->particle_at[v], job->alpha, p);
        } else {
            const uint32_t* c = soft->tetrahedra + 4 * (size_t)soft->inside[v];
            for (int i = 0; i < 4; i++) {
                between(soft, c[i], job->alpha, q);
                for (int k = 0; k < 3; k++) p[k] += soft->weights[4 * (size_t)v + i] * q[k];
            }
        }
        double from[3];
        for (int k = 0; k < 3; k++) from[k] = (double)p[k] + job->shift[k];
        float* to = job->positions + 4 * (size_t)v;
        for (int k = 0; k < 3; k++)
            to[k] = es_clampf((float)(job->inverse[k] * from[0] + job->inverse[3 + k] * from[1] + job->inverse[6 + k] * from[2]), -ES_WORLD_EXTENT, ES_WORLD_EXTENT);
        to[3] = 1.0f;
    }
}

/* Of the upper left 3 × 3; false when it has none. */
static bool invert(const es_mat4* m, double inverse[9])
{
    double a[9], c[9];
    for (int k = 0; k < 3; k++)
        for (int r = 0; r < 3; r++) a[3 * k + r] = (double)m->m[4 * k + r];
    for (int k = 0; k < 3; k++)
        for (int r = 0; r < 3; r++) {
            int k1 = (k + 1) % 3, k2 = (k + 2) % 3, r1 = (r + 1) % 3, r2 = (r + 2) % 3;
            c[3 * k + r] = a[3 * k1 + r1] * a[3 * k2 + r2] - a[3 * k1 + r2] * a[3 * k2 + r1];
        }
    double determinant = a[0] * c[0] + a[1] * c[1] + a[2] * c[2];
    if (!(__builtin_fabs(determinant) > 1e-30)) return false;
    for (int k = 0; k < 3; k++)
        for (int r = 0; r < 3; r++) inverse[3 * r + k] = c[3 * k + r] / determinant;
    return true;
}

static es_result pose(es_world* world, es_soft_object* soft, float alpha)
{
    es_context* context = world->context;
    const es_mat4* matrix = es_node_world(world, soft->desc.node);
    const double* position = es_node_position(world, soft->desc.node);
    if (soft->posed && (soft->asleep || soft->posed_alpha == alpha) && memcmp(matrix, &soft->posed_matrix, sizeof *matrix) == 0 &&
        memcmp(position, soft->posed_position, sizeof soft->posed_position) == 0)
        return ES_OK;
    pose_job job = {.soft = soft, .alpha = alpha};
    if (!invert(matrix, job.inverse)) return ES_OK; /* squashed flat by its node: it has no vertices that could be shown */
    for (int k = 0; k < 3; k++) job.shift[k] = soft->origin[k] - position[k];
    if (!es_grow(context, (void**)&soft->shown, &soft->shown_capacity, 0, 4 * (((size_t)soft->vertex_count + 7) / 8 * 8), sizeof *soft->shown)) return es_context_last_result(context);
    job.positions = soft->shown;
    es_parallel_for(context, soft->vertex_count, 1024, pose_body, &job);
    es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id);
    bool changed;
    if (!es_mesh_take_positions(world, mesh, soft->shown, &changed)) return es_context_last_result(context);
    if (changed && mesh->normals)
        es_normals_recompute(context, &soft->mesh_fans, mesh->indices, mesh->positions, mesh->box[0], mesh->box[1], mesh->normals);
    soft->posed = true;
    soft->posed_alpha = alpha;
    soft->posed_matrix = *matrix;
    memcpy(soft->posed_position, position, sizeof soft->posed_position);
    return ES_OK;
}

es_result es_soft_pose(es_world* world, float alpha)
{
    const es_slots* slots = &world->slots[ES_OBJECT_SOFT];
    for (uint32_t slot = 0; slot < slots->slot_count; slot++) {
        es_soft_object* soft = es_slots_at(slots, slot);
        es_result result = soft ? pose(world, soft, alpha) : ES_OK;
        if (result != ES_OK) return result;
    }
    return ES_OK;
}
