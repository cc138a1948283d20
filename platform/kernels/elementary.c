/* sin, cos, exp2, log2 and pow over arrays of any length. */
#include "platform/kernel_table.h"
#include "platform/simd_maths.h"

/* the last, partial vector: read and written through a copy padded with 1, a value every function takes */
static inline vf load_first(const float* p, size_t n)
{
    float padded[VW] = {1, 1, 1, 1, 1, 1, 1, 1};
    memcpy(padded, p, n * sizeof *p);
    return vf_load(padded);
}
static inline void store_first(float* p, vf a, size_t n)
{
    float padded[VW];
    vf_store(padded, a);
    memcpy(p, padded, n * sizeof *p);
}

#define UNARY(name)                                                                                              \
    void ES_KERNEL(es_platform_##name)(const float* x, float* result, size_t count)                              \
    {                                                                                                            \
        size_t i = 0;                                                                                            \
        for (; i + VW <= count; i += VW) vf_store(result + i, vf_##name(vf_load(x + i)));                        \
        if (i < count) store_first(result + i, vf_##name(load_first(x + i, count - i)), count - i);              \
    }

UNARY(sin)
UNARY(cos)
UNARY(exp2)
UNARY(log2)

void ES_KERNEL(es_platform_pow)(const float* x, const float* y, float* result, size_t count)
{
    size_t i = 0;
    for (; i + VW <= count; i += VW) vf_store(result + i, vf_pow(vf_load(x + i), vf_load(y + i)));
    if (i < count) store_first(result + i, vf_pow(load_first(x + i, count - i), load_first(y + i, count - i)), count - i);
}
