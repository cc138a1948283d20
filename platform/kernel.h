/* How a kernel file becomes one body per instruction set.
 *
 * Every file in a kernels/ folder is compiled once per ISA with ES_ISA_<NAME>_BODY defined and that ISA's flags; names
 * made with ES_KERNEL() get the ISA's suffix. Nothing but the tables may name a body:
 *   <floor>/kernel_table.h     lists the floor's kernels once, as fields of struct es_<floor>_kernels;
 *   <floor>/kernels/table.c    fills one table per ISA;
 *   <floor>/kernel_table.c     ES_KERNEL_TABLE(es_<floor>): es_<floor>_kernel_table(isa), compiled for the baseline.
 */
#ifndef EARTHSHINE_PLATFORM_KERNEL_H
#define EARTHSHINE_PLATFORM_KERNEL_H

#define ES_KERNEL_JOIN_(a, b) a##_##b
#define ES_KERNEL_JOIN(a, b) ES_KERNEL_JOIN_(a, b)

#if defined(ES_ISA_SCALAR_BODY)
#define ES_KERNEL(name) ES_KERNEL_JOIN(name, scalar)
#elif defined(ES_ISA_SSE4_BODY)
#define ES_KERNEL(name) ES_KERNEL_JOIN(name, sse4)
#elif defined(ES_ISA_AVX2_BODY)
#define ES_KERNEL(name) ES_KERNEL_JOIN(name, avx2)
#elif defined(ES_ISA_AVX512_BODY)
#define ES_KERNEL(name) ES_KERNEL_JOIN(name, avx512)
#elif defined(ES_ISA_NEON_BODY)
#define ES_KERNEL(name) ES_KERNEL_JOIN(name, neon)
#endif

/* Outside the bodies the build defines ES_BUILT_<NAME> for every ISA it compiles. */
#if defined(ES_BUILT_SSE4)
#define ES_IF_SSE4_(...) __VA_ARGS__
#else
#define ES_IF_SSE4_(...)
#endif
#if defined(ES_BUILT_AVX2)
#define ES_IF_AVX2_(...) __VA_ARGS__
#else
#define ES_IF_AVX2_(...)
#endif
#if defined(ES_BUILT_AVX512)
#define ES_IF_AVX512_(...) __VA_ARGS__
#else
#define ES_IF_AVX512_(...)
#endif
#if defined(ES_BUILT_NEON)
#define ES_IF_NEON_(...) __VA_ARGS__
#else
#define ES_IF_NEON_(...)
#endif

/* Defines const struct <prefix>_kernels* <prefix>_kernel_table(es_isa isa): NULL when that ISA was not built. */
#define ES_KERNEL_TABLE(prefix)                                                                                  \
    extern const struct prefix##_kernels prefix##_kernels_scalar;                                                \
    ES_IF_SSE4_(extern const struct prefix##_kernels prefix##_kernels_sse4;)                                     \
    ES_IF_AVX2_(extern const struct prefix##_kernels prefix##_kernels_avx2;)                                     \
    ES_IF_AVX512_(extern const struct prefix##_kernels prefix##_kernels_avx512;)                                 \
    ES_IF_NEON_(extern const struct prefix##_kernels prefix##_kernels_neon;)                                     \
    const struct prefix##_kernels* prefix##_kernel_table(es_isa isa)                                             \
    {                                                                                                            \
        switch (isa) {                                                                                           \
        case ES_ISA_SCALAR: return &prefix##_kernels_scalar;                                                     \
        ES_IF_SSE4_(case ES_ISA_SSE4: return &prefix##_kernels_sse4;)                                            \
        ES_IF_AVX2_(case ES_ISA_AVX2: return &prefix##_kernels_avx2;)                                            \
        ES_IF_AVX512_(case ES_ISA_AVX512: return &prefix##_kernels_avx512;)                                      \
        ES_IF_NEON_(case ES_ISA_NEON: return &prefix##_kernels_neon;)                                            \
        default: return NULL;                                                                                    \
        }                                                                                                        \
    }

#endif
