/* How a kernel file becomes one body per instruction set.
 *
 * Every file in a kernels/ folder is compiled once per ISA with ES_ISA_<NAME>_BODY defined and that ISA's flags; names
 * made with ES_KERNEL() get the ISA's suffix. A floor's table (e.g. raster/kernels/table.inl) lists them, and
 * <floor>/kernel_table.c, compiled for the baseline, picks the table of the context's ISA. Nothing else may call a body.
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

#endif
