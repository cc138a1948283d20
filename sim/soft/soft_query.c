/* What a cloth or soft body is like now, and which one a ray meets. */
#include "sim/soft/soft.h"

#include <string.h>

#include "platform/maths.h"
#include "sim/kernel_table.h"

static double volume_of(const es_soft_object* soft)
{
    const es_soft_layout* layout = &soft->layout;
    double volume = 0;
    const bool cloth = soft->tetrahedron_count == 0;
    const uint32_t count = cloth ? layout->triangle_count : soft->tetrahedron_count;
    for (uint32_t t = 0; t < count; t++) {
        const float* p[4];
        for (int i = 0; i < (cloth ? 3 : 4); i++) p[i] = soft->x + 4 * (size_t)(cloth ? layout->indices[3 * (size_t)t + i] : layout->slot_of[soft->tetrahedra[4 * (size_t)t + i]]);
        if (cloth) p[3] = soft->x;
        double e[3][3];
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) e[i][k] = cloth ? (double)p[i][k] - (double)p[3][k] : (double)p[i + 1][k] - (double)p[0][k];
        double v = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) + e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
        volume += cloth ? v / 6 : __builtin_fabs(v) / 6;
    }
    return volume;
}

es_result es_world_get_soft_state(const es_world* world, es_soft handle, es_soft_state* state)
{
    if (!world || !state) return ES_INVALID_ARGUMENT;
    es_soft_object* soft = es_world_object(world, ES_OBJECT_SOFT, handle.id);
    if (!soft) return ES_STALE_HANDLE;
    const es_soft_layout* layout = &soft->layout;
    es_fp_environment environment = es_fp_enter();
    *state = (es_soft_state){.particles = soft->particle_count, .attachments = soft->hold_count, .torn = soft->torn, .asleep = soft->asleep, .rest_volume = soft->rest_volume};
    state->triangles = soft->tetrahedron_count ? ((const es_mesh_object*)es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id))->raster.triangle_count : layout->triangle_count;
    es_sim_kernel_table(es_context_isa(world->context))->soft_stretch(soft->x, layout->links, layout->link_count, soft->ratio);
    for (size_t i = 0; i < 8 * (size_t)layout->link_count; i++)
        if (layout->edges[i]) state->largest_stretch = es_maxf(state->largest_stretch, soft->ratio[i]);
    state->volume = (float)volume_of(soft);
    double energy = 0, mass = 0, centre[3] = {0, 0, 0};
    for (uint32_t p = 0; p < soft->particle_count; p++) {
        const float *x = soft->x + 4 * (size_t)layout->slot_of[p], *v = soft->velocity + 4 * (size_t)layout->slot_of[p];
        const double m = (double)soft->mass[p];
        mass += m;
        for (int k = 0; k < 3; k++) {
            energy += 0.5 * m * (double)v[k] * (double)v[k];
            centre[k] += m * (double)x[k];
        }
    }
    state->kinetic_energy = (float)energy;
    for (int k = 0; k < 3; k++) state->centre[k] = soft->origin[k] + centre[k] / mass;
    es_fp_leave(environment);
    return ES_OK;
}

/* ---- picking ---------------------------------------------------------------------------------------------------------- */

static void vertex_place(const es_soft_object* soft, uint32_t v, double p[3])
{
    if (soft->tetrahedron_count == 0) {
        const float* x = soft->x + 4 * (size_t)soft->layout.slot_of[soft->particle_at[v]];
        for (int k = 0; k < 3; k++) p[k] = (double)x[k];
        return;
    }
    p[0] = p[1] = p[2] = 0;
    for (int i = 0; i < 4; i++) {
        const float* x = soft->x + 4 * (size_t)soft->layout.slot_of[soft->tetrahedra[4 * (size_t)soft->inside[v] + i]];
        for (int k = 0; k < 3; k++) p[k] += (double)soft->weights[4 * (size_t)v + i] * (double)x[k];
    }
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double a[3], const double b[3], double c[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* Möller and Trumbore 1997; in double: this is for a mouse. */
static bool meets(const double p[3][3], const double o[3], const double d[3], double max, double* t, double weights[3], double normal[3])
{
    double e[3], f[3], h[3], s[3], q[3];
    for (int k = 0; k < 3; k++) {
        e[k] = p[1][k] - p[0][k];
        f[k] = p[2][k] - p[0][k];
        s[k] = o[k] - p[0][k];
    }
    cross(d, f, h);
    double a = dot(e, h);
    if (a == 0) return false;
    weights[1] = dot(s, h) / a;
    cross(s, e, q);
    weights[2] = dot(d, q) / a;
    weights[0] = 1 - weights[1] - weights[2];
    *t = dot(f, q) / a;
    cross(e, f, normal);
    return weights[0] >= 0 && weights[1] >= 0 && weights[2] >= 0 && *t >= 0 && *t < max;
}

/* The corner that is nearest; a solid's: the particle that carries most of it. */
static uint32_t nearest(const es_soft_object* soft, const uint32_t* v, const double weights[3])
{
    uint32_t best = v[weights[1] > weights[0] ? weights[2] > weights[1] ? 2 : 1 : weights[2] > weights[0] ? 2 : 0];
    if (soft->tetrahedron_count == 0) return soft->vertex_source[best];
    const float* w = soft->weights + 4 * (size_t)best;
    int most = 0;
    for (int i = 1; i < 4; i++) most = w[i] > w[most] ? i : most;
    return soft->tetrahedra[4 * (size_t)soft->inside[best] + most];
}

es_result es_world_soft_pick(const es_world* world, const double origin[3], es_vec3 direction, float max, es_soft_contact* contact)
{
    if (!world || !contact) return ES_INVALID_ARGUMENT;
    *contact = (es_soft_contact){0};
    const float length = es_v3_length(direction);
    if (!origin || !(length > 1e-12f) || !es_within(max, 0, 1e9f))
        return es_fail(world->context, ES_INVALID_ARGUMENT, "es_world_soft_pick: an origin, a direction and a distance of 0 … 1e9 m are needed");
    const double d[3] = {(double)direction.x / (double)length, (double)direction.y / (double)length, (double)direction.z / (double)length};
    double best = (double)max;
    es_fp_environment environment = es_fp_enter();
    for (uint32_t slot = 0; slot < world->slots[ES_OBJECT_SOFT].slot_count; slot++) {
        const es_soft_object* soft = es_slots_at(&world->slots[ES_OBJECT_SOFT], slot);
        if (!soft) continue;
        const es_mesh_object* mesh = es_slots_get(&world->slots[ES_OBJECT_MESH], soft->desc.mesh.id);
        double o[3], p[3][3], t, weights[3], normal[3];
        for (int k = 0; k < 3; k++) o[k] = origin[k] - soft->origin[k];
        for (uint32_t i = 0; i < mesh->raster.triangle_count; i++) {
            const uint32_t* v = mesh->indices + 3 * (size_t)i;
            for (int c = 0; c < 3; c++) vertex_place(soft, v[c], p[c]);
            if (!meets(p, o, d, best, &t, weights, normal)) continue;
            best = t;
            double size = __builtin_sqrt(dot(normal, normal)), sign = dot(normal, d) > 0 ? -1 : 1;
            if (!(size > 0)) size = 1;
            *contact = (es_soft_contact){.soft = {soft->object.id}, .vertex = nearest(soft, v, weights), .distance = (float)t,
                .normal = es_v3((float)(sign * normal[0] / size), (float)(sign * normal[1] / size), (float)(sign * normal[2] / size))};
            for (int k = 0; k < 3; k++) contact->point[k] = origin[k] + t * d[k];
        }
    }
    es_fp_leave(environment);
    return ES_OK;
}
