/* The SIMD vocabulary's second half: sixteen lanes of uint16 (vh), for depths quantised to 16 bit.
 *
 * Integer operations only, so every body gives the same bits by construction. A mask is a vh whose lanes are 0 or 0xffff.
 */
#ifndef EARTHSHINE_PLATFORM_SIMD16_H
#define EARTHSHINE_PLATFORM_SIMD16_H

#include "platform/simd.h"

enum { VHW = 16 };

typedef uint16_t vh __attribute__((vector_size(32)));

typedef union vh_halves_ {
    vh v;
    uint16_t lane[16];
#if defined(ES_ISA_SSE4_BODY)
    __m128i m[2];
#elif defined(ES_ISA_NEON_BODY)
    uint16x8_t n[2];
#endif
} vh_halves_;

VINL vh vh_set1(uint16_t a) { return (vh){a, a, a, a, a, a, a, a, a, a, a, a, a, a, a, a}; }
VINL vh vh_load(const uint16_t* p) { vh a; memcpy(&a, p, sizeof a); return a; }
VINL void vh_store(uint16_t* p, vh a) { memcpy(p, &a, sizeof a); }
VINL vh vh_eq(vh a, vh b) { return (vh)(a == b); }
VINL vh vh_select(vh mask, vh yes, vh no)
{
#if defined(ES_SIMD_256)
    return (vh)_mm256_blendv_epi8((__m256i)no, (__m256i)yes, (__m256i)mask);
#else
    return (mask & yes) | (~mask & no);
#endif
}

/* One definition per operation: the 256-bit name, the SSE name, the NEON name, and the lane's formula. */
#if defined(ES_SIMD_256)
#define ES_VH_BINARY_(name, intrinsic, neon, lane_formula) \
    VINL vh name(vh a, vh b) { return (vh)_mm256_##intrinsic((__m256i)a, (__m256i)b); }
#elif defined(ES_ISA_SSE4_BODY)
#define ES_VH_BINARY_(name, intrinsic, neon, lane_formula) \
    VINL vh name(vh a, vh b)                               \
    {                                                      \
        vh_halves_ x = {.v = a}, y = {.v = b};             \
        x.m[0] = _mm_##intrinsic(x.m[0], y.m[0]);          \
        x.m[1] = _mm_##intrinsic(x.m[1], y.m[1]);          \
        return x.v;                                        \
    }
#elif defined(ES_ISA_NEON_BODY)
#define ES_VH_BINARY_(name, intrinsic, neon, lane_formula) \
    VINL vh name(vh a, vh b)                               \
    {                                                      \
        vh_halves_ x = {.v = a}, y = {.v = b};             \
        x.n[0] = neon(x.n[0], y.n[0]);                     \
        x.n[1] = neon(x.n[1], y.n[1]);                     \
        return x.v;                                        \
    }
#else
#define ES_VH_BINARY_(name, intrinsic, neon, lane_formula)     \
    VINL vh name(vh a, vh b)                                   \
    {                                                          \
        vh_halves_ s = {.v = a}, t = {.v = b};                 \
        for (int i = 0; i < VHW; i++) {                        \
            uint32_t x = s.lane[i], y = t.lane[i];             \
            s.lane[i] = (uint16_t)(lane_formula);              \
        }                                                      \
        return s.v;                                            \
    }
#endif
#if defined(ES_ISA_NEON_BODY)
VINL uint16x8_t vh_neon_multiply_high_(uint16x8_t a, uint16x8_t b)
{
    uint32x4_t low = vmull_u16(vget_low_u16(a), vget_low_u16(b)), high = vmull_high_u16(a, b);
    return vuzp2q_u16(vreinterpretq_u16_u32(low), vreinterpretq_u16_u32(high));
}
#endif

ES_VH_BINARY_(vh_min, min_epu16, vminq_u16, x < y ? x : y)
ES_VH_BINARY_(vh_max, max_epu16, vmaxq_u16, x > y ? x : y)
ES_VH_BINARY_(vh_average, avg_epu16, vrhaddq_u16, (x + y + 1) >> 1)              /* (a + b + 1) / 2 */
ES_VH_BINARY_(vh_subtract_saturated, subs_epu16, vqsubq_u16, x > y ? x - y : 0)  /* max(a - b, 0) */
ES_VH_BINARY_(vh_multiply_high, mulhi_epu16, vh_neon_multiply_high_, x * y >> 16) /* a * b / 65536 */
#undef ES_VH_BINARY_

/* all ones where a <= b */
VINL vh vh_le(vh a, vh b) { return vh_eq(vh_subtract_saturated(a, b), vh_set1(0)); }

/* 32 lanes one after another, a then b, apart into those at even and those at odd places */
VINL void vh_split(vh a, vh b, vh* even, vh* odd)
{
#if defined(ES_SIMD_256)
    const __m256i low = _mm256_set1_epi32(0xffff);
    __m256i e = _mm256_packus_epi32(_mm256_and_si256((__m256i)a, low), _mm256_and_si256((__m256i)b, low));
    __m256i o = _mm256_packus_epi32(_mm256_srli_epi32((__m256i)a, 16), _mm256_srli_epi32((__m256i)b, 16));
    *even = (vh)_mm256_permute4x64_epi64(e, 0xd8);
    *odd = (vh)_mm256_permute4x64_epi64(o, 0xd8);
#elif defined(ES_ISA_SSE4_BODY)
    const __m128i low = _mm_set1_epi32(0xffff);
    vh_halves_ x = {.v = a}, y = {.v = b}, e, o;
    e.m[0] = _mm_packus_epi32(_mm_and_si128(x.m[0], low), _mm_and_si128(x.m[1], low));
    e.m[1] = _mm_packus_epi32(_mm_and_si128(y.m[0], low), _mm_and_si128(y.m[1], low));
    o.m[0] = _mm_packus_epi32(_mm_srli_epi32(x.m[0], 16), _mm_srli_epi32(x.m[1], 16));
    o.m[1] = _mm_packus_epi32(_mm_srli_epi32(y.m[0], 16), _mm_srli_epi32(y.m[1], 16));
    *even = e.v;
    *odd = o.v;
#elif defined(ES_ISA_NEON_BODY)
    vh_halves_ x = {.v = a}, y = {.v = b}, e, o;
    e.n[0] = vuzp1q_u16(x.n[0], x.n[1]); e.n[1] = vuzp1q_u16(y.n[0], y.n[1]);
    o.n[0] = vuzp2q_u16(x.n[0], x.n[1]); o.n[1] = vuzp2q_u16(y.n[0], y.n[1]);
    *even = e.v;
    *odd = o.v;
#else
    vh_halves_ x = {.v = a}, y = {.v = b}, e, o;
    for (int i = 0; i < 8; i++) {
        e.lane[i] = x.lane[2 * i]; e.lane[8 + i] = y.lane[2 * i];
        o.lane[i] = x.lane[2 * i + 1]; o.lane[8 + i] = y.lane[2 * i + 1];
    }
    *even = e.v;
    *odd = o.v;
#endif
}

/* the inverse of vh_split */
VINL void vh_join(vh even, vh odd, vh* a, vh* b)
{
#if defined(ES_SIMD_256)
    __m256i l = _mm256_unpacklo_epi16((__m256i)even, (__m256i)odd), h = _mm256_unpackhi_epi16((__m256i)even, (__m256i)odd);
    *a = (vh)_mm256_permute2x128_si256(l, h, 0x20);
    *b = (vh)_mm256_permute2x128_si256(l, h, 0x31);
#elif defined(ES_ISA_SSE4_BODY)
    vh_halves_ e = {.v = even}, o = {.v = odd}, x, y;
    x.m[0] = _mm_unpacklo_epi16(e.m[0], o.m[0]); x.m[1] = _mm_unpackhi_epi16(e.m[0], o.m[0]);
    y.m[0] = _mm_unpacklo_epi16(e.m[1], o.m[1]); y.m[1] = _mm_unpackhi_epi16(e.m[1], o.m[1]);
    *a = x.v;
    *b = y.v;
#elif defined(ES_ISA_NEON_BODY)
    vh_halves_ e = {.v = even}, o = {.v = odd}, x, y;
    x.n[0] = vzip1q_u16(e.n[0], o.n[0]); x.n[1] = vzip2q_u16(e.n[0], o.n[0]);
    y.n[0] = vzip1q_u16(e.n[1], o.n[1]); y.n[1] = vzip2q_u16(e.n[1], o.n[1]);
    *a = x.v;
    *b = y.v;
#else
    vh_halves_ e = {.v = even}, o = {.v = odd}, x, y;
    for (int i = 0; i < 8; i++) {
        x.lane[2 * i] = e.lane[i]; x.lane[2 * i + 1] = o.lane[i];
        y.lane[2 * i] = e.lane[8 + i]; y.lane[2 * i + 1] = o.lane[8 + i];
    }
    *a = x.v;
    *b = y.v;
#endif
}

/* ---- four texels of a row: load, minimum, store ------------------------------------------------------------------ */

#if defined(ES_SIMD_256) || defined(ES_ISA_SSE4_BODY)
typedef __m128i vh4;
VINL vh4 vh4_set1_or(uint16_t a, const uint16_t mask[4])
{
    return _mm_or_si128(_mm_set1_epi16((short)a), _mm_loadl_epi64((const __m128i*)mask));
}
VINL void vh4_store_min(uint16_t* p, vh4 a) { _mm_storel_epi64((__m128i*)p, _mm_min_epu16(_mm_loadl_epi64((const __m128i*)p), a)); }
#elif defined(ES_ISA_NEON_BODY)
typedef uint16x4_t vh4;
VINL vh4 vh4_set1_or(uint16_t a, const uint16_t mask[4]) { return vorr_u16(vdup_n_u16(a), vld1_u16(mask)); }
VINL void vh4_store_min(uint16_t* p, vh4 a) { vst1_u16(p, vmin_u16(vld1_u16(p), a)); }
#else
typedef struct vh4 { uint16_t lane[4]; } vh4;
VINL vh4 vh4_set1_or(uint16_t a, const uint16_t mask[4])
{
    return (vh4){{(uint16_t)(a | mask[0]), (uint16_t)(a | mask[1]), (uint16_t)(a | mask[2]), (uint16_t)(a | mask[3])}};
}
VINL void vh4_store_min(uint16_t* p, vh4 a)
{
    for (int i = 0; i < 4; i++) p[i] = p[i] < a.lane[i] ? p[i] : a.lane[i];
}
#endif

/* Texels base[at[0]] … base[at[7]], zero-extended. One load and insert per lane: no instruction set gathers 16 bits, and gathering
 * 32 would read past the last texel. The places come from memory because loading them is cheaper than taking a register apart. */
VINL vi vi_gather16_at(const uint16_t* base, const int32_t at[VW])
{
#if defined(ES_SIMD_256) || defined(ES_ISA_SSE4_BODY)
    __m128i low = _mm_cvtsi32_si128(base[at[0]]), high = _mm_cvtsi32_si128(base[at[4]]);
    low = _mm_insert_epi16(low, base[at[1]], 1);
    high = _mm_insert_epi16(high, base[at[5]], 1);
    low = _mm_insert_epi16(low, base[at[2]], 2);
    high = _mm_insert_epi16(high, base[at[6]], 2);
    low = _mm_insert_epi16(low, base[at[3]], 3);
    high = _mm_insert_epi16(high, base[at[7]], 3);
#if defined(ES_SIMD_256)
    return (vi)_mm256_cvtepu16_epi32(_mm_unpacklo_epi64(low, high));
#else
    v_halves_ h;
    h.mi[0] = _mm_cvtepu16_epi32(low);
    h.mi[1] = _mm_cvtepu16_epi32(high);
    return h.i;
#endif
#else
    return (vi){base[at[0]], base[at[1]], base[at[2]], base[at[3]], base[at[4]], base[at[5]], base[at[6]], base[at[7]]};
#endif
}
VINL vi vi_gather16(const uint16_t* base, vi index)
{
    int32_t at[VW];
    vi_store(at, index);
    return vi_gather16_at(base, at);
}

/* The lanes of `a` whose bit is set in `lanes` go to p[0], p[1], … in order; up to eight words from p on are written. Returns
 * how many were set. */
#if defined(ES_SIMD_256) && !defined(ES_ISA_AVX512_BODY)
/* byte k of entry m: the place of the k-th set bit of m */
#define ES_BITS_(m) (((m) & 1) + ((m) >> 1 & 1) + ((m) >> 2 & 1) + ((m) >> 3 & 1) + ((m) >> 4 & 1) + ((m) >> 5 & 1) + ((m) >> 6 & 1))
#define ES_PLACE_(m, i) ((uint64_t)(((m) >> (i) & 1) * (i)) << 8 * ES_BITS_((m) & ((1 << (i)) - 1)))
#define ES_ENTRY_(m) (ES_PLACE_(m, 1) | ES_PLACE_(m, 2) | ES_PLACE_(m, 3) | ES_PLACE_(m, 4) | ES_PLACE_(m, 5) | ES_PLACE_(m, 6) | ES_PLACE_(m, 7))
#define ES_ENTRY4_(m) ES_ENTRY_(m), ES_ENTRY_((m) + 1), ES_ENTRY_((m) + 2), ES_ENTRY_((m) + 3)
#define ES_ENTRY16_(m) ES_ENTRY4_(m), ES_ENTRY4_((m) + 4), ES_ENTRY4_((m) + 8), ES_ENTRY4_((m) + 12)
#define ES_ENTRY64_(m) ES_ENTRY16_(m), ES_ENTRY16_((m) + 16), ES_ENTRY16_((m) + 32), ES_ENTRY16_((m) + 48)
__attribute__((unused)) static const uint64_t v_compress_places_[256] = {ES_ENTRY64_(0), ES_ENTRY64_(64), ES_ENTRY64_(128), ES_ENTRY64_(192)};
#undef ES_ENTRY64_
#undef ES_ENTRY16_
#undef ES_ENTRY4_
#undef ES_ENTRY_
#undef ES_PLACE_
#undef ES_BITS_
#endif
VINL uint32_t vi_store_packed2(uint32_t* p, uint32_t* q, vi a, vi b, vm lanes)
{
    uint32_t bits = vm_bits(lanes);
#if defined(ES_ISA_AVX512_BODY)
    _mm256_storeu_si256((__m256i*)p, _mm256_maskz_compress_epi32((__mmask8)bits, (__m256i)a));
    _mm256_storeu_si256((__m256i*)q, _mm256_maskz_compress_epi32((__mmask8)bits, (__m256i)b));
#elif defined(ES_SIMD_256)
    __m256i places = _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i*)&v_compress_places_[bits]));
    _mm256_storeu_si256((__m256i*)p, _mm256_permutevar8x32_epi32((__m256i)a, places));
    _mm256_storeu_si256((__m256i*)q, _mm256_permutevar8x32_epi32((__m256i)b, places));
#else
    uint32_t used = 0;
    for (int i = 0; i < VW; i++) {
        p[used] = (uint32_t)a[i];
        q[used] = (uint32_t)b[i];
        used += bits >> i & 1;
    }
#endif
    return (uint32_t)__builtin_popcount(bits);
}

#endif
