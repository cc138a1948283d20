/* Places on surfaces: where a triangle is now. */
#include "sim/edits/edits.h"

#include <string.h>

#include "platform/maths.h"

bool es_anchor_valid(const es_anchor* a)
{
    switch (a->kind) {
    case ES_ANCHOR_NONE: return true;
    case ES_ANCHOR_POINT: {
        bool good = true;
        for (int k = 0; k < 3; k++) good &= __builtin_isgreaterequal(a->point[k], -(double)ES_WORLD_EXTENT) && __builtin_islessequal(a->point[k], (double)ES_WORLD_EXTENT);
        return good;
    }
    case ES_ANCHOR_SURFACE: return es_within(a->u, 0, 1) && es_within(a->v, 0, 1) && a->u + a->v <= 1.0f + 0x1p-20f;
    default: return false;
    }
}

bool es_anchor_find(const es_world* world, const es_anchor* anchor, es_anchored* found)
{
    found->instance = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], anchor->instance.id);
    found->mesh = found->instance ? es_slots_get(&world->slots[ES_OBJECT_MESH], found->instance->desc.mesh.id) : NULL;
    return found->mesh && anchor->triangle < found->mesh->raster.triangle_count;
}

void es_anchor_local(const es_anchored* found, const es_anchor* anchor, float local[3])
{
    const es_raster_mesh* mesh = &found->mesh->raster;
    const uint32_t* corner = mesh->indices + 3 * (size_t)anchor->triangle;
    const float w = 1.0f - anchor->u - anchor->v;
    const float *a = mesh->positions + 4 * (size_t)corner[0], *b = mesh->positions + 4 * (size_t)corner[1], *c = mesh->positions + 4 * (size_t)corner[2];
    for (int k = 0; k < 3; k++) local[k] = w * a[k] + anchor->u * b[k] + anchor->v * c[k];
}

/* Vertices' normals, turned by the node; of a mesh without them, or where they cancel, the triangle's own. */
static es_vec3 normal_at(const es_world* world, const es_anchored* found, const es_anchor* anchor)
{
    const es_raster_mesh* mesh = &found->mesh->raster;
    const uint32_t* corner = mesh->indices + 3 * (size_t)anchor->triangle;
    const float w[3] = {1.0f - anchor->u - anchor->v, anchor->u, anchor->v};
    const float* p[3];
    for (int i = 0; i < 3; i++) p[i] = mesh->positions + 4 * (size_t)corner[i];
    double e[3], f[3];
    for (int k = 0; k < 3; k++) {
        e[k] = (double)p[1][k] - (double)p[0][k];
        f[k] = (double)p[2][k] - (double)p[0][k];
    }
    double own[3] = {e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]};
    double length = __builtin_sqrt(own[0] * own[0] + own[1] * own[1] + own[2] * own[2]);
    es_vec3 flat = length > 0 ? es_v3((float)(own[0] / length), (float)(own[1] / length), (float)(own[2] / length)) : es_v3(0, 1, 0), local = flat;
    if (mesh->normals) {
        es_vec3 sum = es_v3(0, 0, 0);
        for (int i = 0; i < 3; i++) {
            const float* n = mesh->normals + 4 * (size_t)corner[i];
            sum = es_v3_add(sum, es_v3_scale(es_v3_normalize(es_v3(n[0], n[1], n[2]), flat), w[i]));
        }
        local = es_v3_normalize(sum, flat);
    }
    float m[9];
    es_mat4_normal_matrix(es_node_world(world, found->instance->desc.node), m);
    es_vec3 turned = es_v3(m[0] * local.x + m[3] * local.y + m[6] * local.z, m[1] * local.x + m[4] * local.y + m[7] * local.z, m[2] * local.x + m[5] * local.y + m[8] * local.z);
    return es_v3_normalize(turned, local);
}

static void to_world(const es_world* world, es_node node, const double local[3], double position[3])
{
    const es_mat4* m = es_node_world(world, node);
    const double* origin = es_node_position(world, node);
    for (int k = 0; k < 3; k++) position[k] = origin[k] + ((double)m->m[k] * local[0] + (double)m->m[4 + k] * local[1] + (double)m->m[8 + k] * local[2]);
}

bool es_anchor_resolve(const es_world* world, const es_anchor* anchor, double position[3], es_vec3* normal)
{
    double local[3];
    es_node node = {0};
    es_vec3 up = {0, 0, 0};
    if (anchor->kind == ES_ANCHOR_POINT) {
        memcpy(local, anchor->point, sizeof local);
        if (anchor->instance.id) {
            const es_instance_object* instance = es_slots_get(&world->slots[ES_OBJECT_INSTANCE], anchor->instance.id);
            if (!instance) return false;
            node = instance->desc.node;
        }
    } else if (anchor->kind == ES_ANCHOR_SURFACE) {
        es_anchored found;
        float place[3];
        if (!es_anchor_find(world, anchor, &found)) return false;
        es_anchor_local(&found, anchor, place);
        for (int k = 0; k < 3; k++) local[k] = (double)place[k];
        node = found.instance->desc.node;
        if (normal) up = normal_at(world, &found, anchor);
    } else {
        return false;
    }
    if (position) to_world(world, node, local, position);
    if (normal) *normal = up;
    return true;
}

es_edit_effect es_anchor_effect(const es_world* world, const es_anchor* anchor)
{
    es_anchored found;
    if (anchor->kind == ES_ANCHOR_NONE) return ES_EDIT_UNPLACED;
    if (anchor->kind == ES_ANCHOR_SURFACE) return es_anchor_find(world, anchor, &found) ? ES_EDIT_ACTIVE : ES_EDIT_STALE;
    return !anchor->instance.id || es_slots_get(&world->slots[ES_OBJECT_INSTANCE], anchor->instance.id) ? ES_EDIT_ACTIVE : ES_EDIT_STALE;
}

void es_anchor_edges(const es_world* world, const es_anchored* found, uint32_t triangle, float edges_squared[3])
{
    const es_raster_mesh* mesh = &found->mesh->raster;
    const uint32_t* corner = mesh->indices + 3 * (size_t)triangle;
    const es_mat4* m = es_node_world(world, found->instance->desc.node);
    for (int i = 0; i < 3; i++) {
        const float *a = mesh->positions + 4 * (size_t)corner[i], *b = mesh->positions + 4 * (size_t)corner[(i + 1) % 3];
        double d[3], squared = 0;
        for (int k = 0; k < 3; k++) d[k] = (double)b[k] - (double)a[k];
        for (int k = 0; k < 3; k++) {
            double x = (double)m->m[k] * d[0] + (double)m->m[4 + k] * d[1] + (double)m->m[8 + k] * d[2];
            squared += x * x;
        }
        edges_squared[i] = (float)(squared < 1e30 ? squared : 1e30);
    }
}

/* ---- public ---------------------------------------------------------------------------------------------------------- */

bool es_world_resolve_anchor(const es_world* world, const es_anchor* anchor, double position[3], es_vec3* normal)
{
    if (!world || !anchor || !es_anchor_valid(anchor)) return false;
    es_world_refresh(world);
    es_fp_environment environment = es_fp_enter();
    bool there = es_anchor_resolve(world, anchor, position, normal);
    es_fp_leave(environment);
    return there;
}

es_result es_world_anchor_of_triangle(const es_world* world, es_instance instance, uint32_t triangle, float u, float v, es_anchor* anchor)
{
    if (!world || !anchor) return ES_INVALID_ARGUMENT;
    *anchor = (es_anchor){0};
    if (!es_world_object(world, ES_OBJECT_INSTANCE, instance.id)) return ES_STALE_HANDLE;
    if (!es_within(u, -1e30f, 1e30f) || !es_within(v, -1e30f, 1e30f)) return es_fail(world->context, ES_INVALID_ARGUMENT, "a place on a triangle must be given by finite numbers");
    es_anchor a = {.kind = ES_ANCHOR_SURFACE, .instance = instance, .triangle = triangle, .u = es_clampf(u, 0, 1), .v = es_clampf(v, 0, 1)};
    float over = a.u + a.v - 1.0f;
    if (over > 0) {
        a.u = es_clampf(a.u - 0.5f * over, 0, 1);
        a.v = 1.0f - a.u;
    }
    es_anchored found;
    if (!es_anchor_find(world, &a, &found))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "there is no triangle %u: the instance's mesh has %u", triangle, found.mesh ? found.mesh->raster.triangle_count : 0);
    *anchor = a;
    return ES_OK;
}
