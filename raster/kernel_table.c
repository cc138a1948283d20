/* Picks the kernels of an instruction set. Compiled for the baseline, so it runs everywhere. */
#include "raster/kernel_table.h"

#if defined(ES_BUILT_SCALAR)
extern const es_raster_kernels es_raster_kernels_scalar;
#endif
#if defined(ES_BUILT_SSE4)
extern const es_raster_kernels es_raster_kernels_sse4;
#endif
#if defined(ES_BUILT_AVX2)
extern const es_raster_kernels es_raster_kernels_avx2;
#endif
#if defined(ES_BUILT_AVX512)
extern const es_raster_kernels es_raster_kernels_avx512;
#endif
#if defined(ES_BUILT_NEON)
extern const es_raster_kernels es_raster_kernels_neon;
#endif

const es_raster_kernels* es_raster_kernels_of(es_isa isa)
{
    switch (isa) {
#if defined(ES_BUILT_SCALAR)
    case ES_ISA_SCALAR: return &es_raster_kernels_scalar;
#endif
#if defined(ES_BUILT_SSE4)
    case ES_ISA_SSE4: return &es_raster_kernels_sse4;
#endif
#if defined(ES_BUILT_AVX2)
    case ES_ISA_AVX2: return &es_raster_kernels_avx2;
#endif
#if defined(ES_BUILT_AVX512)
    case ES_ISA_AVX512: return &es_raster_kernels_avx512;
#endif
#if defined(ES_BUILT_NEON)
    case ES_ISA_NEON: return &es_raster_kernels_neon;
#endif
    default: return NULL;
    }
}
