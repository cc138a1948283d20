/* The SIMD vocabulary's third part: eight lanes of complex numbers (vc), the real parts of all lanes before their imaginary parts.
 *
 * A body with registers of 512 bits holds one in a register, the others in two or four; every body does the same IEEE operations on each
 * part: the product's real part is re c - im s, its imaginary part im c + re s, each rounded three times.
 */
#ifndef EARTHSHINE_PLATFORM_SIMD_COMPLEX_H
#define EARTHSHINE_PLATFORM_SIMD_COMPLEX_H

#include "platform/simd.h"

#if defined(ES_ISA_AVX512_BODY)
typedef float vc __attribute__((vector_size(64)));

VINL vc vc_of(vf re, vf im) { return (vc)_mm512_insertf32x8(_mm512_castps256_ps512((__m256)re), (__m256)im, 1); }
VINL vf vc_re(vc a) { return (vf)_mm512_castps512_ps256((__m512)a); }
VINL vf vc_im(vc a) { return (vf)_mm512_extractf32x8_ps((__m512)a, 1); }
VINL vc vc_load(const float* p) { vc a; memcpy(&a, p, sizeof a); return a; }
VINL void vc_store(float* p, vc a) { memcpy(p, &a, sizeof a); }
VINL vc vc_add(vc a, vc b) { return a + b; }
VINL vc vc_sub(vc a, vc b) { return a - b; }
VINL vc vc_scale(vc a, float s) { return (vc)_mm512_mul_ps((__m512)a, _mm512_set1_ps(s)); }
/* real and imaginary parts change places */
VINL vc vc_swap(vc a) { return (vc)_mm512_shuffle_f32x4((__m512)a, (__m512)a, 0x4e); }
VINL vc vc_first_negated_(vc a) { return (vc)_mm512_mask_xor_ps((__m512)a, 0x00ff, (__m512)a, _mm512_set1_ps(-0.0f)); }
VINL vc vc_last_negated_(vc a) { return (vc)_mm512_mask_xor_ps((__m512)a, 0xff00, (__m512)a, _mm512_set1_ps(-0.0f)); }
VINL vc vc_times_minus_i(vc a) { return vc_last_negated_(vc_swap(a)); }
VINL vc vc_conjugate(vc a) { return vc_last_negated_(a); }
VINL vc vc_times_(vc a, __m512 c, __m512 s)
{
    return (vc)_mm512_add_ps(_mm512_mul_ps((__m512)a, c), _mm512_mul_ps((__m512)vc_swap(a), (__m512)vc_first_negated_((vc)s)));
}
/* a · (c + i s), the same in all lanes */
VINL vc vc_rotate(vc a, const float* c_and_s) { return vc_times_(a, _mm512_set1_ps(c_and_s[0]), _mm512_set1_ps(c_and_s[1])); }
/* a · b lane by lane, b = eight real parts and eight imaginary parts */
VINL vc vc_mul(vc a, const float* b) { return vc_times_(a, _mm512_broadcast_f32x8(_mm256_loadu_ps(b)), _mm512_broadcast_f32x8(_mm256_loadu_ps(b + 8))); }
/* Lane i of v[j] changes places with lane j of v[i]. */
VINL void vc_transpose8(vc v[8])
{
    __m512 t[8], u[8];
    for (int i = 0; i < 8; i += 2) {
        t[i] = _mm512_unpacklo_ps((__m512)v[i], (__m512)v[i + 1]);
        t[i + 1] = _mm512_unpackhi_ps((__m512)v[i], (__m512)v[i + 1]);
    }
    for (int i = 0; i < 8; i += 4)
        for (int j = 0; j < 2; j++) {
            u[i + 2 * j] = _mm512_shuffle_ps(t[i + j], t[i + j + 2], 0x44);
            u[i + 2 * j + 1] = _mm512_shuffle_ps(t[i + j], t[i + j + 2], 0xee);
        }
    const __m512i low = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13), high = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
    for (int i = 0; i < 4; i++) {
        v[i] = (vc)_mm512_permutex2var_pd((__m512d)u[i], low, (__m512d)u[i + 4]);
        v[i + 4] = (vc)_mm512_permutex2var_pd((__m512d)u[i], high, (__m512d)u[i + 4]);
    }
}
#else
typedef struct vc { vf re, im; } vc;

VINL vc vc_of(vf re, vf im) { return (vc){re, im}; }
VINL vf vc_re(vc a) { return a.re; }
VINL vf vc_im(vc a) { return a.im; }
VINL vc vc_load(const float* p) { return (vc){vf_load(p), vf_load(p + 8)}; }
VINL void vc_store(float* p, vc a)
{
    vf_store(p, a.re);
    vf_store(p + 8, a.im);
}
VINL vc vc_add(vc a, vc b) { return (vc){a.re + b.re, a.im + b.im}; }
VINL vc vc_sub(vc a, vc b) { return (vc){a.re - b.re, a.im - b.im}; }
VINL vc vc_scale(vc a, float s) { return (vc){a.re * vf_set1(s), a.im * vf_set1(s)}; }
VINL vc vc_swap(vc a) { return (vc){a.im, a.re}; }
VINL vc vc_times_minus_i(vc a) { return (vc){a.im, vf_neg(a.re)}; }
VINL vc vc_conjugate(vc a) { return (vc){a.re, vf_neg(a.im)}; }
VINL vc vc_times_(vc a, vf c, vf s) { return (vc){a.re * c - a.im * s, a.im * c + a.re * s}; }
VINL vc vc_rotate(vc a, const float* c_and_s) { return vc_times_(a, vf_set1(c_and_s[0]), vf_set1(c_and_s[1])); }
VINL vc vc_mul(vc a, const float* b) { return vc_times_(a, vf_load(b), vf_load(b + 8)); }
VINL void vc_transpose8(vc v[8])
{
    vf re[8], im[8];
    for (int i = 0; i < 8; i++) re[i] = v[i].re, im[i] = v[i].im;
    vf_transpose8(re);
    vf_transpose8(im);
    for (int i = 0; i < 8; i++) v[i] = (vc){re[i], im[i]};
}
#endif

#endif
