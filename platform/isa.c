/* Which instruction sets were built in and run here. Compiled for the baseline, so asking is safe on every processor. */
#include <string.h>

#include "platform/platform.h"

static const char* const isa_names[ES_ISA_COUNT] = {"scalar", "sse4", "avx2", "avx512", "neon"};

const char* es_isa_name(es_isa isa) { return (uint32_t)isa < ES_ISA_COUNT ? isa_names[isa] : "?"; }

bool es_isa_from_name(const char* name, es_isa* isa)
{
    for (int i = 0; name && i < ES_ISA_COUNT; i++) {
        if (strcmp(name, isa_names[i]) == 0) {
            *isa = (es_isa)i;
            return true;
        }
    }
    return false;
}

uint32_t es_isa_available_mask(void)
{
    uint32_t mask = 1u << ES_ISA_SCALAR;
#if defined(__x86_64__)
    /* the builtin also asks the system whether it saves the wider registers (XGETBV) */
    __builtin_cpu_init();
#if defined(ES_BUILT_SSE4)
    if (__builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("popcnt")) mask |= 1u << ES_ISA_SSE4;
#endif
#if defined(ES_BUILT_AVX2)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt")) mask |= 1u << ES_ISA_AVX2;
#endif
#if defined(ES_BUILT_AVX512)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt") && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
        mask |= 1u << ES_ISA_AVX512;
#endif
#elif defined(__aarch64__) && defined(ES_BUILT_NEON)
    mask |= 1u << ES_ISA_NEON; /* part of the architecture */
#endif
    return mask;
}
