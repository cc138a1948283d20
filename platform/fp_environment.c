/* The floating-point environment results are computed in: round to nearest, denormals kept, no traps.
 *
 * It is one register on both machines: MXCSR on x86-64 (0x1f80: all exceptions masked, flush-to-zero and denormals-are-zero
 * off) and FPCR on AArch64 (0). Saving and restoring it costs a few cycles, so every task does. */
#include "platform/context.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

es_fp_environment es_fp_enter(void)
{
    es_fp_environment environment = {0};
#if defined(__x86_64__)
    environment.saved = _mm_getcsr();
    _mm_setcsr(0x1f80);
#elif defined(__aarch64__)
    __asm__ volatile("mrs %0, fpcr" : "=r"(environment.saved));
    __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)0) : "memory");
#endif
    return environment;
}

void es_fp_leave(es_fp_environment environment)
{
#if defined(__x86_64__)
    _mm_setcsr((unsigned)environment.saved);
#elif defined(__aarch64__)
    __asm__ volatile("msr fpcr, %0" : : "r"(environment.saved) : "memory");
#endif
}
