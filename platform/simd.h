/* The SIMD vocabulary: eight lanes of float (vf) or 32-bit integer (vi), whatever the register width.
 *
 * Eight is the one logical width of the project: one AVX2 register, one 256-bit AVX-512VL register with mask registers and
 * 32 names, two SSE or NEON registers, a plain loop in the scalar body. Every body does the same IEEE operations on each
 * lane, and the one reduction has one tree, so results are equal bit for bit.
 *
 * + - * / on vf and + - * & | ^ << >> on vi are the compiler's vector operators (correctly rounded, never contracted:
 * the build sets -ffp-contract=off). Where instruction sets disagree, the meaning is fixed here:
 *   min(a, b) = a < b ? a : b and max(a, b) = a > b ? a : b: the second operand when either is NaN or both are zeros;
 *   vi_truncate, vi_round: INT32_MIN for NaN and for what does not fit; round is to nearest, ties to even;
 *   comparisons with NaN are false (vm_ne is true); denormals are kept.
 * A mask (vm) is a vi whose lanes are 0 or -1.
 */
#ifndef EARTHSHINE_PLATFORM_SIMD_H
#define EARTHSHINE_PLATFORM_SIMD_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "platform/kernel.h"

#if defined(ES_ISA_SSE4_BODY) || defined(ES_ISA_AVX2_BODY) || defined(ES_ISA_AVX512_BODY)
#include <immintrin.h>
#elif defined(ES_ISA_NEON_BODY)
#include <arm_neon.h>
#endif
#if defined(ES_ISA_AVX2_BODY) || defined(ES_ISA_AVX512_BODY)
#define ES_SIMD_256 1
#endif

enum { VW = 8 };  /* lanes; loops step by it and buffers are padded to it */

typedef float vf __attribute__((vector_size(32)));
typedef int32_t vi __attribute__((vector_size(32)));
typedef uint32_t vu __attribute__((vector_size(32)));
typedef vi vm;
typedef float vf4_ __attribute__((vector_size(16)));
typedef int32_t vi4_ __attribute__((vector_size(16)));

#define VINL static inline __attribute__((always_inline, unused))

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors cross only inlined calls */
#endif

/* two 128-bit halves, for the SSE and NEON bodies */
typedef union v_halves_ { vf f; vi i; vf4_ f4[2]; vi4_ i4[2];
#if defined(ES_ISA_SSE4_BODY)
    __m128 m[2]; __m128i mi[2];
#elif defined(ES_ISA_NEON_BODY)
    float32x4_t n[2]; int32x4_t ni[2]; uint32x4_t nu[2];
#endif
} v_halves_;

/* ---- making, loading, storing -------------------------------------------------------------------------------- */

VINL vf vf_set1(float a) { return (vf){a, a, a, a, a, a, a, a}; }
VINL vi vi_set1(int32_t a) { return (vi){a, a, a, a, a, a, a, a}; }
VINL vf vf_zero(void) { return (vf){0}; }
VINL vi vi_zero(void) { return (vi){0}; }
VINL vf vf_iota(void) { return (vf){0, 1, 2, 3, 4, 5, 6, 7}; }
VINL vi vi_iota(void) { return (vi){0, 1, 2, 3, 4, 5, 6, 7}; }
VINL vf vf_load(const float* p) { vf a; memcpy(&a, p, sizeof a); return a; }
VINL vi vi_load(const void* p) { vi a; memcpy(&a, p, sizeof a); return a; }
VINL void vf_store(float* p, vf a) { memcpy(p, &a, sizeof a); }
VINL void vi_store(void* p, vi a) { memcpy(p, &a, sizeof a); }
VINL vi vi_from_bits(vf a) { return (vi)a; }
VINL vf vf_from_bits(vi a) { return (vf)a; }

/* ---- masks ------------------------------------------------------------------------------------------------------ */

VINL vm vm_lt(vf a, vf b) { return a < b; }
VINL vm vm_le(vf a, vf b) { return a <= b; }
VINL vm vm_gt(vf a, vf b) { return a > b; }
VINL vm vm_ge(vf a, vf b) { return a >= b; }
VINL vm vm_eq(vf a, vf b) { return a == b; }
VINL vm vm_ne(vf a, vf b) { return a != b; }
VINL vm vi_lt(vi a, vi b) { return a < b; }
VINL vm vi_gt(vi a, vi b) { return a > b; }
VINL vm vi_eq(vi a, vi b) { return a == b; }
VINL vm vm_all_lanes(void) { return vi_set1(-1); }

/* bit i set where lane i is */
VINL uint32_t vm_bits(vm m)
{
#if defined(ES_SIMD_256)
    return (uint32_t)_mm256_movemask_ps((__m256)m);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ h = {.i = m};
    return (uint32_t)_mm_movemask_ps(h.m[0]) | (uint32_t)_mm_movemask_ps(h.m[1]) << 4;
#elif defined(ES_ISA_NEON_BODY)
    v_halves_ h = {.i = m};
    const uint32x4_t weight = {1, 2, 4, 8};
    return vaddvq_u32(vandq_u32(h.nu[0], weight)) | vaddvq_u32(vandq_u32(h.nu[1], weight)) << 4;
#else
    uint32_t bits = 0;
    for (int i = 0; i < VW; i++) bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
#endif
}
VINL bool vm_any(vm m) { return vm_bits(m) != 0; }
VINL bool vm_all(vm m) { return vm_bits(m) == 0xffu; }
/* lanes [0, n), n in 0 … 8 */
VINL vm vm_first(int32_t n) { return vi_iota() < vi_set1(n); }

VINL vf vf_select(vm m, vf yes, vf no)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_blendv_ps((__m256)no, (__m256)yes, (__m256)m);
#else
    return (vf)((m & (vi)yes) | (~m & (vi)no));
#endif
}
VINL vi vi_select(vm m, vi yes, vi no)
{
#if defined(ES_SIMD_256)
    return (vi)_mm256_blendv_epi8((__m256i)no, (__m256i)yes, (__m256i)m);
#else
    return (m & yes) | (~m & no);
#endif
}
VINL vf vf_and(vm m, vf a) { return (vf)(m & (vi)a); } /* a where m, else +0 */

/* ---- arithmetic beyond the operators -------------------------------------------------------------------------- */

VINL vf vf_min(vf a, vf b)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_min_ps((__m256)a, (__m256)b);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a}, y = {.f = b};
    x.m[0] = _mm_min_ps(x.m[0], y.m[0]);
    x.m[1] = _mm_min_ps(x.m[1], y.m[1]);
    return x.f;
#else
    return vf_select(a < b, a, b);
#endif
}
VINL vf vf_max(vf a, vf b)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_max_ps((__m256)a, (__m256)b);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a}, y = {.f = b};
    x.m[0] = _mm_max_ps(x.m[0], y.m[0]);
    x.m[1] = _mm_max_ps(x.m[1], y.m[1]);
    return x.f;
#else
    return vf_select(a > b, a, b);
#endif
}
VINL vf vf_clamp(vf a, vf low, vf high) { return vf_min(vf_max(a, low), high); }
VINL vf vf_abs(vf a) { return (vf)((vi)a & vi_set1(0x7fffffff)); }
VINL vf vf_neg(vf a) { return (vf)((vi)a ^ vi_set1((int32_t)0x80000000u)); }
/* magnitude of a, sign of s */
VINL vf vf_copysign(vf a, vf s) { return (vf)(((vi)a & vi_set1(0x7fffffff)) | ((vi)s & vi_set1((int32_t)0x80000000u))); }
VINL vi vi_min(vi a, vi b)
{
#if defined(ES_SIMD_256)
    return (vi)_mm256_min_epi32((__m256i)a, (__m256i)b);
#else
    return vi_select(a < b, a, b);
#endif
}
VINL vi vi_max(vi a, vi b)
{
#if defined(ES_SIMD_256)
    return (vi)_mm256_max_epi32((__m256i)a, (__m256i)b);
#else
    return vi_select(a > b, a, b);
#endif
}
VINL vi vi_shift_right_logical(vi a, int n) { return (vi)((vu)a >> n); }
VINL vf vf_sqrt(vf a)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_sqrt_ps((__m256)a);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a};
    x.m[0] = _mm_sqrt_ps(x.m[0]);
    x.m[1] = _mm_sqrt_ps(x.m[1]);
    return x.f;
#elif defined(ES_ISA_NEON_BODY)
    v_halves_ x = {.f = a};
    x.n[0] = vsqrtq_f32(x.n[0]);
    x.n[1] = vsqrtq_f32(x.n[1]);
    return x.f;
#else
    for (int i = 0; i < VW; i++) a[i] = __builtin_sqrtf(a[i]);
    return a;
#endif
}

/* ---- conversions ---------------------------------------------------------------------------------------------------- */

VINL vf vf_from_int(vi a) { return __builtin_convertvector(a, vf); }
VINL vi vi_truncate(vf a)
{
#if defined(ES_SIMD_256)
    return (vi)_mm256_cvttps_epi32((__m256)a);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a};
    x.mi[0] = _mm_cvttps_epi32(x.m[0]);
    x.mi[1] = _mm_cvttps_epi32(x.m[1]);
    return x.i;
#else
    vm fits = (a >= vf_set1(-2147483648.0f)) & (a < vf_set1(2147483648.0f));
    vf safe = vf_and(fits, a);
    return vi_select(fits, __builtin_convertvector(safe, vi), vi_set1(INT32_MIN));
#endif
}
/* 1.5 * 2^23 pushes the fraction out of a float below 2^22 with round-to-nearest-even; larger ones are already whole */
VINL vf vf_round_(vf a)
{
    vf magic = vf_set1(8388608.0f);
    vf r = vf_copysign((vf_abs(a) + magic) - magic, a);
    return vf_select(vf_abs(a) < magic, r, a);
}
VINL vi vi_round(vf a)
{
#if defined(ES_SIMD_256)
    return (vi)_mm256_cvtps_epi32((__m256)a);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a};
    x.mi[0] = _mm_cvtps_epi32(x.m[0]);
    x.mi[1] = _mm_cvtps_epi32(x.m[1]);
    return x.i;
#else
    return vi_truncate(vf_round_(a));
#endif
}
/* to whole numbers; |a| >= 2^23, infinities and NaN stay as they are; floor(-0) = -0 */
VINL vf vf_floor(vf a)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_floor_ps((__m256)a);
#elif defined(ES_ISA_SSE4_BODY)
    v_halves_ x = {.f = a};
    x.m[0] = _mm_floor_ps(x.m[0]);
    x.m[1] = _mm_floor_ps(x.m[1]);
    return x.f;
#else
    vf t = vf_from_int(vi_truncate(vf_select(vf_abs(a) < vf_set1(8388608.0f), a, vf_zero())));
    t = vf_copysign(t - vf_and(t > a, vf_set1(1.0f)), a);
    return vf_select(vf_abs(a) < vf_set1(8388608.0f), t, a);
#endif
}

/* ---- crossing lanes --------------------------------------------------------------------------------------------------- */

/* ((a0+a4) + (a2+a6)) + ((a1+a5) + (a3+a7)): the project's one reduction tree */
VINL float vf_sum(vf a)
{
    float s0 = a[0] + a[4], s1 = a[1] + a[5], s2 = a[2] + a[6], s3 = a[3] + a[7];
    return (s0 + s2) + (s1 + s3);
}

/* base[index] per lane; every index must be valid, masked lanes included */
VINL vf vf_gather(const float* base, vi index)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_i32gather_ps(base, (__m256i)index, 4);
#else
    return (vf){base[index[0]], base[index[1]], base[index[2]], base[index[3]],
                base[index[4]], base[index[5]], base[index[6]], base[index[7]]};
#endif
}
/* values[0], values[0], values[1], … : each 2 (shift 1) or 4 times (shift 2). Reads eight of them. */
VINL vf vf_repeat(const float* values, uint32_t shift)
{
#if defined(ES_SIMD_256)
    return (vf)_mm256_permutevar8x32_ps(_mm256_loadu_ps(values), _mm256_srlv_epi32(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), _mm256_set1_epi32((int)shift)));
#else
    return (vf){values[0], values[1 >> shift], values[2 >> shift], values[3 >> shift], values[4 >> shift], values[5 >> shift], values[6 >> shift], values[7 >> shift]};
#endif
}
VINL vi vi_gather(const void* base_address, vi index)
{
    const int32_t* base = base_address;
#if defined(ES_SIMD_256)
    return (vi)_mm256_i32gather_epi32(base, (__m256i)index, 4);
#else
    return (vi){base[index[0]], base[index[1]], base[index[2]], base[index[3]],
                base[index[4]], base[index[5]], base[index[6]], base[index[7]]};
#endif
}

/* The record of four 32-bit words at base + stride * index[lane] (stride in bytes, alignment 4), transposed to four vectors.
 * Eight 16-byte loads and shuffles instead of four hardware gathers, which load each lane's word by itself. */
VINL void vi_gather4(const void* base, uint32_t stride, vi index, vi* a, vi* b, vi* c, vi* d)
{
    const char* p = base;
#if defined(ES_SIMD_256)
    uint32_t at[VW];
    memcpy(at, &index, sizeof at);
#define ES_LOAD_PAIR_(i, j) \
    _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps((const float*)(p + (size_t)stride * at[i]))), _mm_loadu_ps((const float*)(p + (size_t)stride * at[j])), 1)
    __m256 r0 = ES_LOAD_PAIR_(0, 4), r1 = ES_LOAD_PAIR_(1, 5), r2 = ES_LOAD_PAIR_(2, 6), r3 = ES_LOAD_PAIR_(3, 7);
#undef ES_LOAD_PAIR_
    __m256 t0 = _mm256_unpacklo_ps(r0, r1), t1 = _mm256_unpackhi_ps(r0, r1);
    __m256 t2 = _mm256_unpacklo_ps(r2, r3), t3 = _mm256_unpackhi_ps(r2, r3);
    *a = (vi)_mm256_shuffle_ps(t0, t2, 0x44);
    *b = (vi)_mm256_shuffle_ps(t0, t2, 0xee);
    *c = (vi)_mm256_shuffle_ps(t1, t3, 0x44);
    *d = (vi)_mm256_shuffle_ps(t1, t3, 0xee);
#else
    vi r[4];
    for (int i = 0; i < VW; i++) {
        int32_t w[4];
        memcpy(w, p + (size_t)stride * (uint32_t)index[i], sizeof w);
        for (int k = 0; k < 4; k++) r[k][i] = w[k];
    }
    *a = r[0]; *b = r[1]; *c = r[2]; *d = r[3];
#endif
}
VINL void vf_gather4(const void* base, uint32_t stride, vi index, vf* a, vf* b, vf* c, vf* d)
{
    vi x, y, z, w;
    vi_gather4(base, stride, index, &x, &y, &z, &w);
    *a = (vf)x; *b = (vf)y; *c = (vf)z; *d = (vf)w;
}
/* Eight records of four floats one after another, transposed in and out. */
VINL void vf_load4(const float* p, vf* a, vf* b, vf* c, vf* d) { vf_gather4(p, 16, vi_iota(), a, b, c, d); }
/* Eight vectors: lane i of vector j changes places with lane j of vector i. */
VINL void vf_transpose8(vf v[8])
{
#if defined(ES_SIMD_256)
    __m256 t[8], u[8];
    for (int i = 0; i < 8; i += 2) {
        t[i] = _mm256_unpacklo_ps((__m256)v[i], (__m256)v[i + 1]);
        t[i + 1] = _mm256_unpackhi_ps((__m256)v[i], (__m256)v[i + 1]);
    }
    for (int i = 0; i < 8; i += 4)
        for (int j = 0; j < 2; j++) {
            u[i + 2 * j] = _mm256_shuffle_ps(t[i + j], t[i + j + 2], 0x44);
            u[i + 2 * j + 1] = _mm256_shuffle_ps(t[i + j], t[i + j + 2], 0xee);
        }
    for (int i = 0; i < 4; i++) {
        v[i] = (vf)_mm256_permute2f128_ps(u[i], u[i + 4], 0x20);
        v[i + 4] = (vf)_mm256_permute2f128_ps(u[i], u[i + 4], 0x31);
    }
#else
    for (int i = 0; i < VW; i++)
        for (int j = 0; j < i; j++) {
            const float a = v[i][j];
            v[i][j] = v[j][i];
            v[j][i] = a;
        }
#endif
}
/* How lanes come together: those of a mask's bits, in their order. */
typedef struct v_packing {
#if defined(ES_SIMD_256)
    vi places; /* within each half */
    uint32_t in_low;
#else
    uint32_t bits;
#endif
} v_packing;
VINL v_packing v_packing_of(uint32_t bits)
{
#if defined(ES_SIMD_256)
    static const int32_t places[16][4] = {{0}, {0}, {1}, {0, 1}, {2}, {0, 2}, {1, 2}, {0, 1, 2}, {3}, {0, 3}, {1, 3}, {0, 1, 3}, {2, 3}, {0, 2, 3}, {1, 2, 3}, {0, 1, 2, 3}};
    const uint32_t low = bits & 15, high = bits >> 4;
    return (v_packing){(vi)_mm256_loadu2_m128i((const __m128i*)places[high], (const __m128i*)places[low]), (uint32_t)__builtin_popcount(low)};
#else
    return (v_packing){bits};
#endif
}
/* The lanes at p, one after another; the rest of eight places there holds anything then. */
VINL void vf_store_packed(float* p, vf a, v_packing packing)
{
#if defined(ES_SIMD_256)
    const __m256 halves = _mm256_permutevar_ps((__m256)a, (__m256i)packing.places);
    _mm_storeu_ps(p, _mm256_castps256_ps128(halves));
    _mm_storeu_ps(p + packing.in_low, _mm256_extractf128_ps(halves, 1));
#else
    for (uint32_t bits = packing.bits; bits; bits &= bits - 1) *p++ = a[__builtin_ctz(bits)];
#endif
}
VINL void vi_store_packed(void* p, vi a, v_packing packing) { vf_store_packed(p, vf_from_bits(a), packing); }
/* Of the sixteen lanes of a and b, in order, those at even and those at odd places. */
VINL void vf_deinterleave(vf a, vf b, vf* even, vf* odd)
{
#if defined(ES_SIMD_256)
    const __m256 e = _mm256_shuffle_ps((__m256)a, (__m256)b, 0x88), o = _mm256_shuffle_ps((__m256)a, (__m256)b, 0xdd);
    *even = (vf)_mm256_permute4x64_epi64((__m256i)e, 0xd8);
    *odd = (vf)_mm256_permute4x64_epi64((__m256i)o, 0xd8);
#else
    *even = (vf){a[0], a[2], a[4], a[6], b[0], b[2], b[4], b[6]};
    *odd = (vf){a[1], a[3], a[5], a[7], b[1], b[3], b[5], b[7]};
#endif
}
VINL void vf_store4(float* p, vf a, vf b, vf c, vf d)
{
#if defined(ES_SIMD_256)
    __m256 t0 = _mm256_unpacklo_ps((__m256)a, (__m256)b), t1 = _mm256_unpackhi_ps((__m256)a, (__m256)b);
    __m256 t2 = _mm256_unpacklo_ps((__m256)c, (__m256)d), t3 = _mm256_unpackhi_ps((__m256)c, (__m256)d);
    __m256 r0 = _mm256_shuffle_ps(t0, t2, 0x44), r1 = _mm256_shuffle_ps(t0, t2, 0xee);
    __m256 r2 = _mm256_shuffle_ps(t1, t3, 0x44), r3 = _mm256_shuffle_ps(t1, t3, 0xee);
    _mm256_storeu_ps(p, _mm256_permute2f128_ps(r0, r1, 0x20));
    _mm256_storeu_ps(p + 8, _mm256_permute2f128_ps(r2, r3, 0x20));
    _mm256_storeu_ps(p + 16, _mm256_permute2f128_ps(r0, r1, 0x31));
    _mm256_storeu_ps(p + 24, _mm256_permute2f128_ps(r2, r3, 0x31));
#else
    for (int i = 0; i < VW; i++) {
        p[4 * i] = a[i]; p[4 * i + 1] = b[i]; p[4 * i + 2] = c[i]; p[4 * i + 3] = d[i];
    }
#endif
}
/* The first three of each record; the fourth stays as it is. */
VINL void vf_store3(float* p, vf a, vf b, vf c)
{
#if defined(ES_SIMD_256)
    __m256 t0 = _mm256_unpacklo_ps((__m256)a, (__m256)b), t1 = _mm256_unpackhi_ps((__m256)a, (__m256)b);
    __m256 t2 = _mm256_unpacklo_ps((__m256)c, (__m256)c), t3 = _mm256_unpackhi_ps((__m256)c, (__m256)c);
    __m256 r0 = _mm256_shuffle_ps(t0, t2, 0x44), r1 = _mm256_shuffle_ps(t0, t2, 0xee);
    __m256 r2 = _mm256_shuffle_ps(t1, t3, 0x44), r3 = _mm256_shuffle_ps(t1, t3, 0xee);
    _mm256_storeu_ps(p, _mm256_blend_ps(_mm256_permute2f128_ps(r0, r1, 0x20), _mm256_loadu_ps(p), 0x88));
    _mm256_storeu_ps(p + 8, _mm256_blend_ps(_mm256_permute2f128_ps(r2, r3, 0x20), _mm256_loadu_ps(p + 8), 0x88));
    _mm256_storeu_ps(p + 16, _mm256_blend_ps(_mm256_permute2f128_ps(r0, r1, 0x31), _mm256_loadu_ps(p + 16), 0x88));
    _mm256_storeu_ps(p + 24, _mm256_blend_ps(_mm256_permute2f128_ps(r2, r3, 0x31), _mm256_loadu_ps(p + 24), 0x88));
#else
    for (int i = 0; i < VW; i++) {
        p[4 * i] = a[i]; p[4 * i + 1] = b[i]; p[4 * i + 2] = c[i];
    }
#endif
}

#endif
