/* Vectors, quaternions and matrices. Whatever needs sums of products that may cancel is computed in double and rounded once. */
#include "platform/maths.h"

/* Squares of floats neither overflow nor underflow in double; below 2^-126 a component has too few bits for a direction. */
es_vec3 es_v3_normalize(es_vec3 a, es_vec3 fallback)
{
    double x = a.x, y = a.y, z = a.z;
    double squared = x * x + y * y + z * z;
    if (!(squared >= 0x1p-252) || !(squared <= 0x1p260)) return fallback;
    double length = __builtin_sqrt(squared);
    return es_v3((float)(x / length), (float)(y / length), (float)(z / length));
}

/* Duff et al. 2017, "Building an Orthonormal Basis, Revisited", listing 3 */
void es_orthonormal_basis(es_vec3 n, es_vec3* t, es_vec3* b)
{
    float sign = __builtin_copysignf(1.0f, n.z);
    float p = -1.0f / (sign + n.z);
    float q = n.x * n.y * p;
    *t = es_v3(1.0f + sign * n.x * n.x * p, sign * q, -sign * n.x);
    *b = es_v3(q, sign + n.y * n.y * p, -n.y);
}

/* ---- quaternions ------------------------------------------------------------------------------------------------ */

es_quat es_quat_identity(void) { return (es_quat){0, 0, 0, 1}; }

es_quat es_quat_from_axis_angle(es_vec3 unit_axis, float angle)
{
    float s = es_sin(0.5f * angle);
    return (es_quat){unit_axis.x * s, unit_axis.y * s, unit_axis.z * s, es_cos(0.5f * angle)};
}

es_quat es_quat_mul(es_quat a, es_quat b)
{
    return (es_quat){
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    };
}

es_quat es_quat_normalize(es_quat q)
{
    double x = q.x, y = q.y, z = q.z, w = q.w;
    double squared = x * x + y * y + z * z + w * w;
    if (!(squared >= 0x1p-252) || !(squared <= 0x1p260)) return es_quat_identity();
    double length = __builtin_sqrt(squared);
    return (es_quat){(float)(x / length), (float)(y / length), (float)(z / length), (float)(w / length)};
}

es_quat es_quat_slerp(es_quat a, es_quat b, float t)
{
    float d = a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
    float wa = 1.0f - t, wb = t;
    float sign = d < 0.0f ? -1.0f : 1.0f;
    d = es_absf(d);
    if (d < 0.9995f) { /* nearer than 1.8 degrees the chord is the arc to 2^-24, and sin(angle) too small to divide by */
        float angle = es_acos(d), s = es_sin(angle);
        wa = es_sin(wa * angle) / s;
        wb = es_sin(wb * angle) / s;
    }
    wb *= sign;
    return es_quat_normalize((es_quat){wa * a.x + wb * b.x, wa * a.y + wb * b.y, wa * a.z + wb * b.z, wa * a.w + wb * b.w});
}

es_vec3 es_quat_rotate(es_quat q, es_vec3 v)
{
    es_vec3 u = es_v3(q.x, q.y, q.z);
    es_vec3 t = es_v3_scale(es_v3_cross(u, v), 2.0f);
    return es_v3_add(es_v3_add(v, es_v3_scale(t, q.w)), es_v3_cross(u, t));
}

/* ---- matrices ------------------------------------------------------------------------------------------------------ */

es_mat4 es_mat4_identity(void) { return (es_mat4){{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}; }

es_mat4 es_mat4_mul(es_mat4 a, es_mat4 b)
{
    es_mat4 c;
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 4; row++) {
            const float* v = &b.m[4 * column];
            c.m[4 * column + row] = (a.m[row] * v[0] + a.m[4 + row] * v[1]) + (a.m[8 + row] * v[2] + a.m[12 + row] * v[3]);
        }
    }
    return c;
}

es_mat4 es_mat4_from_trs(es_vec3 translation, es_quat q, es_vec3 scale)
{
    float xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
    float xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
    float wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
    return (es_mat4){{
        (1 - 2 * (yy + zz)) * scale.x, 2 * (xy + wz) * scale.x, 2 * (xz - wy) * scale.x, 0,
        2 * (xy - wz) * scale.y, (1 - 2 * (xx + zz)) * scale.y, 2 * (yz + wx) * scale.y, 0,
        2 * (xz + wy) * scale.z, 2 * (yz - wx) * scale.z, (1 - 2 * (xx + yy)) * scale.z, 0,
        translation.x, translation.y, translation.z, 1,
    }};
}

es_vec3 es_mat4_point(const es_mat4* m, es_vec3 p)
{
    const float* e = m->m;
    return es_v3((e[0] * p.x + e[4] * p.y) + (e[8] * p.z + e[12]), (e[1] * p.x + e[5] * p.y) + (e[9] * p.z + e[13]),
        (e[2] * p.x + e[6] * p.y) + (e[10] * p.z + e[14]));
}

es_vec3 es_mat4_direction(const es_mat4* m, es_vec3 d)
{
    const float* e = m->m;
    return es_v3(e[0] * d.x + e[4] * d.y + e[8] * d.z, e[1] * d.x + e[5] * d.y + e[9] * d.z, e[2] * d.x + e[6] * d.y + e[10] * d.z);
}

es_vec4 es_mat4_vec4(const es_mat4* m, es_vec4 v)
{
    float r[4];
    for (int i = 0; i < 4; i++) r[i] = (m->m[i] * v.x + m->m[4 + i] * v.y) + (m->m[8 + i] * v.z + m->m[12 + i] * v.w);
    return (es_vec4){r[0], r[1], r[2], r[3]};
}

/* cofactor of element (row, column) of the upper left 3 × 3; cyclic indices carry the sign */
static double cofactor3(const float* m, int row, int column)
{
    int r1 = (row + 1) % 3, r2 = (row + 2) % 3, c1 = (column + 1) % 3, c2 = (column + 2) % 3;
    return (double)m[4 * c1 + r1] * m[4 * c2 + r2] - (double)m[4 * c2 + r1] * m[4 * c1 + r2];
}

float es_mat4_determinant3(const es_mat4* m)
{
    double d = 0;
    for (int row = 0; row < 3; row++) d += (double)m->m[row] * cofactor3(m->m, row, 0);
    return (float)d;
}

void es_mat4_normal_matrix(const es_mat4* m, float normal_matrix[9])
{
    for (int column = 0; column < 3; column++) {
        for (int row = 0; row < 3; row++) normal_matrix[3 * column + row] = (float)cofactor3(m->m, row, column);
    }
}

/* Cofactors from 2 × 2 minors of the first and the last two columns. Singular: the determinant is below 1e-13 of the product of
 * the column lengths (Hadamard's bound), where it is nothing but rounding error of the double products. */
bool es_mat4_inverse(const es_mat4* m, es_mat4* inverse)
{
    double a[16];
    double bound = 1;
    for (int column = 0; column < 4; column++) {
        double squared = 0;
        for (int row = 0; row < 4; row++) {
            double v = a[4 * column + row] = m->m[4 * column + row];
            squared += v * v;
        }
        bound *= __builtin_sqrt(squared);
    }
    double s0 = a[0] * a[5] - a[4] * a[1], s1 = a[0] * a[6] - a[4] * a[2], s2 = a[0] * a[7] - a[4] * a[3];
    double s3 = a[1] * a[6] - a[5] * a[2], s4 = a[1] * a[7] - a[5] * a[3], s5 = a[2] * a[7] - a[6] * a[3];
    double c0 = a[8] * a[13] - a[12] * a[9], c1 = a[8] * a[14] - a[12] * a[10], c2 = a[8] * a[15] - a[12] * a[11];
    double c3 = a[9] * a[14] - a[13] * a[10], c4 = a[9] * a[15] - a[13] * a[11], c5 = a[10] * a[15] - a[14] * a[11];
    double d = s0 * c5 - s1 * c4 + s2 * c3 + s3 * c2 - s4 * c1 + s5 * c0;
    const double adjugate[16] = {
        a[5] * c5 - a[6] * c4 + a[7] * c3, -a[1] * c5 + a[2] * c4 - a[3] * c3,
        a[13] * s5 - a[14] * s4 + a[15] * s3, -a[9] * s5 + a[10] * s4 - a[11] * s3,
        -a[4] * c5 + a[6] * c2 - a[7] * c1, a[0] * c5 - a[2] * c2 + a[3] * c1,
        -a[12] * s5 + a[14] * s2 - a[15] * s1, a[8] * s5 - a[10] * s2 + a[11] * s1,
        a[4] * c4 - a[5] * c2 + a[7] * c0, -a[0] * c4 + a[1] * c2 - a[3] * c0,
        a[12] * s4 - a[13] * s2 + a[15] * s0, -a[8] * s4 + a[9] * s2 - a[11] * s0,
        -a[4] * c3 + a[5] * c1 - a[6] * c0, a[0] * c3 - a[1] * c1 + a[2] * c0,
        -a[12] * s3 + a[13] * s1 - a[14] * s0, a[8] * s3 - a[9] * s1 + a[10] * s0,
    };
    *inverse = es_mat4_identity();
    if (!(__builtin_fabs(d) > 1e-13 * bound)) return false;
    es_mat4 result;
    for (int i = 0; i < 16; i++) {
        double v = adjugate[i] / d;
        if (!(__builtin_fabs(v) <= 0x1.fffffep127)) return false;
        result.m[i] = (float)v;
    }
    *inverse = result;
    return true;
}

es_mat4 es_mat4_look(es_vec3 eye, es_vec3 direction, es_vec3 up)
{
    es_vec3 forward = es_v3_normalize(direction, es_v3(0, 0, -1));
    es_vec3 unit_up = es_v3_normalize(up, es_v3(0, 1, 0));
    es_vec3 right = es_v3_cross(forward, unit_up);
    if (!(es_v3_dot(right, right) > 1e-10f)) { /* parallel to 1e-5 radians: y, or -z at the top of a view straight down */
        es_vec3 other = es_absf(forward.y) < 0.9f ? es_v3(0, 1, 0) : es_v3(0, 0, forward.y < 0.0f ? -1.0f : 1.0f);
        right = es_v3_cross(forward, other);
    }
    right = es_v3_normalize(right, es_v3(1, 0, 0));
    es_vec3 above = es_v3_cross(right, forward);
    return (es_mat4){{
        right.x, above.x, -forward.x, 0,
        right.y, above.y, -forward.y, 0,
        right.z, above.z, -forward.z, 0,
        -es_v3_dot(right, eye), -es_v3_dot(above, eye), es_v3_dot(forward, eye), 1,
    }};
}

es_mat4 es_mat4_perspective(float fov_y, float aspect, float near_plane)
{
    float t = es_tan(0.5f * fov_y);
    es_mat4 m = {{0}};
    m.m[0] = 1.0f / (aspect * t);
    m.m[5] = 1.0f / t;
    m.m[11] = -1.0f;
    m.m[14] = near_plane;
    return m;
}

es_mat4 es_mat4_orthographic(float half_width, float half_height, float near_plane, float far_plane)
{
    float depth = far_plane - near_plane;
    es_mat4 m = {{0}};
    m.m[0] = 1.0f / half_width;
    m.m[5] = 1.0f / half_height;
    m.m[10] = 1.0f / depth;
    m.m[14] = far_plane / depth;
    m.m[15] = 1.0f;
    return m;
}
