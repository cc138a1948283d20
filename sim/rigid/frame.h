/* Rotations as matrices: what shapes are turned by once and points many times. */
#ifndef EARTHSHINE_SIM_RIGID_FRAME_H
#define EARTHSHINE_SIM_RIGID_FRAME_H

#include "platform/maths.h"

typedef struct es_mat3 { es_vec3 x, y, z; } es_mat3; /* columns: where the axes go */

static inline es_mat3 es_mat3_from_quat(es_quat q)
{
    float xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z, xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
    float wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
    return (es_mat3){{1 - 2 * (yy + zz), 2 * (xy + wz), 2 * (xz - wy)}, {2 * (xy - wz), 1 - 2 * (xx + zz), 2 * (yz + wx)},
        {2 * (xz + wy), 2 * (yz - wx), 1 - 2 * (xx + yy)}};
}
static inline es_vec3 es_mat3_mul(const es_mat3* m, es_vec3 v)
{
    return es_v3(m->x.x * v.x + m->y.x * v.y + m->z.x * v.z, m->x.y * v.x + m->y.y * v.y + m->z.y * v.z,
        m->x.z * v.x + m->y.z * v.y + m->z.z * v.z);
}
/* by the transpose: back into the frame */
static inline es_vec3 es_mat3_into(const es_mat3* m, es_vec3 v) { return es_v3(es_v3_dot(m->x, v), es_v3_dot(m->y, v), es_v3_dot(m->z, v)); }

static inline es_vec3 es_v3_min(es_vec3 a, es_vec3 b) { return es_v3(es_minf(a.x, b.x), es_minf(a.y, b.y), es_minf(a.z, b.z)); }
static inline es_vec3 es_v3_max(es_vec3 a, es_vec3 b) { return es_v3(es_maxf(a.x, b.x), es_maxf(a.y, b.y), es_maxf(a.z, b.z)); }
static inline es_vec3 es_v3_abs(es_vec3 a) { return es_v3(es_absf(a.x), es_absf(a.y), es_absf(a.z)); }
static inline es_vec3 es_v3_mad(es_vec3 a, es_vec3 b, float s) { return es_v3(a.x + b.x * s, a.y + b.y * s, a.z + b.z * s); }
static inline es_vec3 es_v3_neg(es_vec3 a) { return es_v3(-a.x, -a.y, -a.z); }
static inline es_vec3 es_v3_mix(es_vec3 a, es_vec3 b, float t) { return es_v3(a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t, a.z + (b.z - a.z) * t); }
static inline float es_v3_axis(es_vec3 a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }

#endif
