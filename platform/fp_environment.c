/* The floating-point environment results are computed in: round to nearest, denormals kept, no traps.
 *
 * It is one register on both machines: MXCSR on x86-64 (0x1f80: all exceptions masked, flush-to-zero and denormals-are-zero
 * off) and FPCR on AArch64 (0). Saving and restoring it costs a few cycles, so every task does.
 *
 * Built with EARTHSHINE_TRAP_FP, whatever makes a NaN or an infinity raises SIGFPE instead, in lanes that a mask will discard too:
 * invalid operations, divisions by zero and overflows are unmasked. Underflow and inexact results are no errors. AArch64 lets a
 * processor leave traps out, and most do: there the bits have no effect. */
#include "platform/context.h"

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

enum { X86_CONTROL = 0x1f80, X86_CONTROL_TRAPPING = 0x1900, ARM_CONTROL = 0, ARM_CONTROL_TRAPPING = 0x700 };

static es_fp_environment enter(bool trapping)
{
    es_fp_environment environment = {0};
#if defined(__x86_64__)
    environment.saved = _mm_getcsr();
    _mm_setcsr(trapping ? X86_CONTROL_TRAPPING : X86_CONTROL);
#elif defined(__aarch64__)
    __asm__ volatile("mrs %0, fpcr" : "=r"(environment.saved));
    __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)(trapping ? ARM_CONTROL_TRAPPING : ARM_CONTROL)) : "memory");
#endif
    return environment;
}

es_fp_environment es_fp_enter(void)
{
#if defined(ES_TRAP_FP)
    return enter(true);
#else
    return enter(false);
#endif
}

es_fp_environment es_fp_enter_untrapped(void) { return enter(false); }

void es_fp_leave(es_fp_environment environment)
{
#if defined(__x86_64__)
    _mm_setcsr((unsigned)environment.saved);
#elif defined(__aarch64__)
    __asm__ volatile("msr fpcr, %0" : : "r"(environment.saved) : "memory");
#endif
}
