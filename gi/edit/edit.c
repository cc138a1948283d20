#include "gi/edit/edit.h"

#include <string.h>

#include "gi/kernel_table.h"
#include "gi/kernels/edit_influence_simd.h"
#include "platform/maths.h"

/* Rows of S: the rotation about a = r × e / |r × e| by the angle between them, c + s [a]× + (1 - c) a aᵀ; about a fixed axis across r where e = -r. */
static void shortest_arc(es_vec3 r, es_vec3 e, float rotation[9])
{
    es_vec3 t, b;
    es_orthonormal_basis(r, &t, &b);
    const es_vec3 v = es_v3_cross(r, e);
    const float s = es_v3_length(v), c = es_v3_dot(r, e);
    const es_vec3 a = s > 1e-6f ? es_v3_scale(v, 1.0f / s) : t;
    const float x = a.x, y = a.y, z = a.z, m = 1.0f - c;
    const float rows[9] = {c + m * x * x, m * x * y - s * z, m * x * z + s * y, m * x * y + s * z, c + m * y * y, m * y * z - s * x, m * x * z - s * y, m * y * z + s * x, c + m * z * z};
    memcpy(rotation, rows, sizeof rows);
}

void es_edit_constraint_matrix(es_vec3 reflected, es_vec3 edited, float matrix[9])
{
    const float r[3] = {reflected.x, reflected.y, reflected.z}, e[3] = {edited.x, edited.y, edited.z};
    float s[9];
    shortest_arc(reflected, edited, s);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) matrix[3 * i + k] = e[i] * r[k] + ES_EDIT_SHORTEST_ARC * s[3 * i + k];
}

float es_edit_influence(const es_edit_region* region, es_vec3 at, uint32_t instance, uint32_t triangle)
{
    if (region->instance && region->instance != instance) return 0.0f;
    const vf p[3] = {vf_set1(at.x), vf_set1(at.y), vf_set1(at.z)};
    es_edit_place_v place = {.lanes = vi_zero()};
    if (region->mesh.positions && region->mesh.instance == instance) place = es_edit_place_of_v(&region->mesh, vm_all_lanes(), vi_set1((int32_t)triangle), p);
    return es_edit_influence_v(region, vm_all_lanes(), p, &place)[0];
}

typedef struct edit_loop { const es_gi_kernels* kernels; const es_edit_job* job; } edit_loop;

static void rows(void* user, uint32_t begin, uint32_t end, uint32_t worker)
{
    edit_loop* loop = user;
    loop->kernels->edit_directions(loop->job, begin, end);
}

void es_edit_directions(es_context* context, const es_edit_job* job)
{
    edit_loop loop = {es_gi_kernel_table(es_context_isa(context)), job};
    es_parallel_for(context, job->gbuffer->height, 4, rows, &loop);
}
