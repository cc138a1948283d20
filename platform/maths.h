/* Elementary functions and small vector algebra with the same bits everywhere.
 *
 * libm may not reach a pixel or a pose (its last bits differ between systems); only the correctly rounded sqrt does.
 * Errors are over the stated ranges, in units in the last place; tests/check_platform.c samples them (--samples N). The vector
 * forms in simd_maths.h perform the same operations, so a lane equals the scalar result bit for bit.
 */
#ifndef EARTHSHINE_PLATFORM_MATHS_H
#define EARTHSHINE_PLATFORM_MATHS_H

#include "platform/platform.h"

#define ES_PI 3.14159265358979323846f

float es_sin(float x);   /* |x| <= 8192 radians, 0.95 ulp; NaN for NaN and infinities; beyond: the range reduction loses accuracy but stays in [-1, 1] */
float es_cos(float x);   /* the same */
void es_sincos(float x, float* sine, float* cosine); /* both for the price of one */
float es_tan(float x);   /* es_sin / es_cos, 2.5 ulp */
float es_exp2(float x);  /* 1.2 ulp, exact for whole x; 0 below -126 (no denormals), infinity from 128 */
float es_log2(float x);  /* 1.6 ulp, exact for powers of 2; -infinity at 0, NaN below; denormals as if 2^-126 */
float es_pow(float x, float y); /* x >= 0: exp2(y log2 x), 1.5 + 2 |y log2 x| ulp; x^0 = 1^y = 1; NaN for other x < 0 */
float es_exp(float x);   /* 0.51 ulp; 0 where the result would be a denormal */
float es_atan2(float y, float x); /* 0.51 ulp; atan2(0, 0) by the signs, as in C */
float es_acos(float x);  /* 0.51 ulp; clamped to [-1, 1] */
static inline float es_sqrt(float x) { return __builtin_sqrtf(x); }
static inline float es_absf(float x) { return __builtin_fabsf(x); }
static inline float es_minf(float a, float b) { return a < b ? a : b; }
static inline float es_maxf(float a, float b) { return a > b ? a : b; }
static inline float es_clampf(float x, float low, float high) { return es_minf(es_maxf(x, low), high); }
float es_floor(float x);

static inline es_vec3 es_v3(float x, float y, float z) { return (es_vec3){x, y, z}; }
static inline es_vec3 es_v3_add(es_vec3 a, es_vec3 b) { return es_v3(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline es_vec3 es_v3_sub(es_vec3 a, es_vec3 b) { return es_v3(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline es_vec3 es_v3_scale(es_vec3 a, float s) { return es_v3(a.x * s, a.y * s, a.z * s); }
static inline es_vec3 es_v3_mul(es_vec3 a, es_vec3 b) { return es_v3(a.x * b.x, a.y * b.y, a.z * b.z); }
static inline float es_v3_dot(es_vec3 a, es_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline es_vec3 es_v3_cross(es_vec3 a, es_vec3 b)
{
    return es_v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline float es_v3_length(es_vec3 a) { return es_sqrt(es_v3_dot(a, a)); }
/* `fallback` when a is zero, not finite, or too small to have a direction */
es_vec3 es_v3_normalize(es_vec3 a, es_vec3 fallback);
/* t and b complete n (unit) to a right-handed orthonormal frame t × b = n; branch-free but for the sign of n.z (Duff et al. 2017) */
void es_orthonormal_basis(es_vec3 n, es_vec3* t, es_vec3* b);

es_quat es_quat_identity(void);
es_quat es_quat_from_axis_angle(es_vec3 unit_axis, float angle);
es_quat es_quat_mul(es_quat a, es_quat b);      /* b first, then a */
es_quat es_quat_normalize(es_quat q);           /* identity when q has no direction */
es_quat es_quat_slerp(es_quat a, es_quat b, float t); /* shorter arc */
es_vec3 es_quat_rotate(es_quat q, es_vec3 v);

es_mat4 es_mat4_identity(void);
es_mat4 es_mat4_mul(es_mat4 a, es_mat4 b);
es_mat4 es_mat4_from_trs(es_vec3 translation, es_quat rotation, es_vec3 scale);
es_vec3 es_mat4_point(const es_mat4* m, es_vec3 p);     /* affine: w is not divided by */
es_vec3 es_mat4_direction(const es_mat4* m, es_vec3 d);
es_vec4 es_mat4_vec4(const es_mat4* m, es_vec4 v);
float es_mat4_determinant3(const es_mat4* m);           /* of the upper left 3 × 3; computed in double */
/* In double, rounded once; false and identity when singular. */
bool es_mat4_inverse(const es_mat4* m, es_mat4* inverse);
/* Transposed cofactors of the upper 3 × 3, column-major 3 × 3: transforms normals for any scale, zero and negative included
 * (result not normalised). */
void es_mat4_normal_matrix(const es_mat4* m, float normal_matrix[9]);
/* World to eye for an eye at `eye` looking along `direction`; `up` is replaced when parallel. */
es_mat4 es_mat4_look(es_vec3 eye, es_vec3 direction, es_vec3 up);
/* Reversed depth with the far plane at infinity: depth = near / distance; 1 at near, 0 at infinity. */
es_mat4 es_mat4_perspective(float fov_y, float aspect, float near_plane);
/* Reversed depth: 1 at near, 0 at far. */
es_mat4 es_mat4_orthographic(float half_width, float half_height, float near_plane, float far_plane);

#endif
