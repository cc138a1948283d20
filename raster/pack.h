/* Packed words of the G-buffer, scalar and eight at a time with equal bits.
 *
 * Octahedral normals: Meyer et al. 2010, "On Floating-Point Normal Vectors"; two signed 16-bit values scaled by 32767, angular
 * error below 0.004 degrees. Encoding does not need a unit vector. RGB9E5: the shared-exponent format of
 * EXT_texture_shared_exponent (9-bit mantissas, bias 15), values clamped to [0, 65408], NaN to 0.
 */
#ifndef EARTHSHINE_RASTER_PACK_H
#define EARTHSHINE_RASTER_PACK_H

#include "platform/platform.h"
#include "platform/simd.h"

#define ES_RGB9E5_MAX 65408.0f

/* ---- eight at a time ------------------------------------------------------------------------------------------------- */

/* Any length with a finite sum of magnitudes of 1e-30 or more; below, some direction. */
VINL vi es_pack_normal_v(vf x, vf y, vf z)
{
    vf s = vf_set1(32767.0f) / vf_max(vf_abs(x) + vf_abs(y) + vf_abs(z), vf_set1(1e-30f));
    vf px = x * s, py = y * s;
    vf one = vf_set1(32767.0f);
    vm below = vm_lt(z, vf_zero());
    vf fx = vf_copysign(one - vf_abs(py), px), fy = vf_copysign(one - vf_abs(px), py);
    vi ix = vi_round(vf_select(below, fx, px)), iy = vi_round(vf_select(below, fy, py));
    return (ix & vi_set1(0xffff)) | (iy << 16);
}
/* unit */
VINL void es_unpack_normal_v(vi word, vf* x, vf* y, vf* z)
{
    vf scale = vf_set1(1.0f / 32767.0f);
    vf px = vf_from_int((word << 16) >> 16) * scale, py = vf_from_int(word >> 16) * scale;
    vf pz = vf_set1(1.0f) - vf_abs(px) - vf_abs(py);
    vf t = vf_max(vf_neg(pz), vf_zero());
    px = px - vf_copysign(t, px);
    py = py - vf_copysign(t, py);
    vf s = vf_set1(1.0f) / vf_sqrt(px * px + py * py + pz * pz);
    *x = px * s;
    *y = py * s;
    *z = pz * s;
}
/* clamped to [0, 1]; NaN gives 0 */
VINL vi es_pack_unorm16_v(vf a) { return vi_round(vf_min(vf_max(a, vf_zero()), vf_set1(1.0f)) * vf_set1(65535.0f)); }
VINL vf es_unpack_unorm16_v(vi a) { return vf_from_int(a & vi_set1(0xffff)) * vf_set1(1.0f / 65535.0f); }
VINL vi es_pack_unorm8_v(vf a) { return vi_round(vf_min(vf_max(a, vf_zero()), vf_set1(1.0f)) * vf_set1(255.0f)); }

VINL vi es_pack_rgb9e5_v(vf r, vf g, vf b)
{
    vf top = vf_set1(ES_RGB9E5_MAX);
    r = vf_min(vf_max(r, vf_zero()), top);
    g = vf_min(vf_max(g, vf_zero()), top);
    b = vf_min(vf_max(b, vf_zero()), top);
    vf m = vf_max(vf_max(r, g), b);
    /* shared exponent: floor(log2(m)) + 1 + 15, at least 0; the float's own exponent field is floor(log2(m)) + 127 */
    vi e = vi_max((vi_from_bits(m) >> 23) - vi_set1(127 - 16), vi_zero());
    /* 2^(e - 15 - 9) divides; where the largest rounds up to 512, the exponent is one more */
    vf scale = vf_from_bits((vi_set1(127 + 24) - e) << 23);
    vm carry = vi_gt(vi_round(m * scale), vi_set1(511));
    e = e - carry;
    scale = vf_from_bits((vi_set1(127 + 24) - e) << 23);
    return vi_round(r * scale) | (vi_round(g * scale) << 9) | (vi_round(b * scale) << 18) | (e << 27);
}
VINL void es_unpack_rgb9e5_v(vi word, vf* r, vf* g, vf* b)
{
    vi mask = vi_set1(511);
    vf scale = vf_from_bits((vi_shift_right_logical(word, 27) + vi_set1(127 - 24)) << 23);
    *r = vf_from_int(word & mask) * scale;
    *g = vf_from_int(vi_shift_right_logical(word, 9) & mask) * scale;
    *b = vf_from_int(vi_shift_right_logical(word, 18) & mask) * scale;
}

/* ---- one at a time: a lane of the above, for code outside kernels -------------------------------------------------------- */

static inline uint32_t es_pack_normal(es_vec3 n) { return (uint32_t)es_pack_normal_v(vf_set1(n.x), vf_set1(n.y), vf_set1(n.z))[0]; }
static inline es_vec3 es_unpack_normal(uint32_t word)
{
    vf x, y, z;
    es_unpack_normal_v(vi_set1((int32_t)word), &x, &y, &z);
    return (es_vec3){x[0], y[0], z[0]};
}
static inline uint32_t es_pack_unorm16(float a) { return (uint32_t)es_pack_unorm16_v(vf_set1(a))[0]; }
static inline float es_unpack_unorm16(uint32_t a) { return (float)(a & 0xffffu) * (1.0f / 65535.0f); }
static inline uint32_t es_pack_unorm8(float a) { return (uint32_t)es_pack_unorm8_v(vf_set1(a))[0]; }
static inline uint32_t es_pack_rgb9e5(es_vec3 c) { return (uint32_t)es_pack_rgb9e5_v(vf_set1(c.x), vf_set1(c.y), vf_set1(c.z))[0]; }
static inline es_vec3 es_unpack_rgb9e5(uint32_t word)
{
    vf r, g, b;
    es_unpack_rgb9e5_v(vi_set1((int32_t)word), &r, &g, &b);
    return (es_vec3){r[0], g[0], b[0]};
}

#endif
