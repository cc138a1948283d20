/* The platform's kernels: elementary functions over arrays, and every operation of the SIMD vocabulary over arrays, by which
 * tests/check_platform.c proves that all instruction sets agree. */
#ifndef EARTHSHINE_PLATFORM_KERNEL_TABLE_H
#define EARTHSHINE_PLATFORM_KERNEL_TABLE_H

#include "platform/platform.h"

/* Operations of simd.h, in the order of the rows they write. Last: must the row be equal where it is NaN? Arithmetic may give
 * any NaN (x86 and ARM differ in its bits); what moves or compares bits may not. */
#define ES_SIMD_OPERATIONS(X)                                                                                    \
    X(vf_add, 0) X(vf_subtract, 0) X(vf_multiply, 0) X(vf_divide, 0)                                             \
    X(vi_add, 1) X(vi_subtract, 1) X(vi_multiply, 1) X(vi_and, 1) X(vi_or, 1) X(vi_xor, 1)                       \
    X(vi_shift_left, 1) X(vi_shift_right, 1) X(vi_shift_right_logical, 1)                                        \
    X(vf_set1, 1) X(vi_set1, 1) X(vf_iota, 1) X(vi_iota, 1) X(vf_zero, 1) X(vi_zero, 1)                          \
    X(vm_lt, 1) X(vm_le, 1) X(vm_gt, 1) X(vm_ge, 1) X(vm_eq, 1) X(vm_ne, 1) X(vi_lt, 1) X(vi_gt, 1) X(vi_eq, 1)  \
    X(vm_all_lanes, 1) X(vm_bits, 1) X(vm_any, 1) X(vm_all, 1) X(vm_first, 1)                                    \
    X(vf_select, 1) X(vi_select, 1) X(vf_and, 1)                                                                 \
    X(vf_min, 1) X(vf_max, 1) X(vf_clamp, 1) X(vf_abs, 1) X(vf_neg, 1) X(vf_copysign, 1) X(vi_min, 1) X(vi_max, 1) \
    X(vf_sqrt, 0) X(vf_from_int, 1) X(vi_truncate, 1) X(vi_round, 1) X(vf_floor, 0) X(vf_sum, 0)                 \
    X(vf_gather, 1) X(vi_gather, 1)                                                                              \
    X(vi_gather4_a, 1) X(vi_gather4_b, 1) X(vi_gather4_c, 1) X(vi_gather4_d, 1)                                  \
    X(vf_load4_a, 1) X(vf_load4_b, 1) X(vf_load4_c, 1) X(vf_load4_d, 1)                                          \
    X(vf_store4_0, 1) X(vf_store4_1, 1) X(vf_store4_2, 1) X(vf_store4_3, 1)                                      \
    X(vf_store3_0, 1) X(vf_store3_1, 1) X(vf_store3_2, 1) X(vf_store3_3, 1) X(vf_store_packed, 1) X(vf_store_packed_behind, 1)

enum {
#define ES_SIMD_OPERATION_ENUM(name, exact) ES_SIMD_##name,
    ES_SIMD_OPERATIONS(ES_SIMD_OPERATION_ENUM)
#undef ES_SIMD_OPERATION_ENUM
    ES_SIMD_OPERATION_COUNT
};

/* X(name, arguments). `count` is any number: the last partial vector is handled in a padded copy, nothing beyond is touched. */
#define ES_PLATFORM_KERNELS(X)                                                                                   \
    X(sin, (const float* x, float* result, size_t count))                                                        \
    X(cos, (const float* x, float* result, size_t count))                                                        \
    X(exp2, (const float* x, float* result, size_t count))                                                       \
    X(log2, (const float* x, float* result, size_t count))                                                       \
    X(pow, (const float* x, const float* y, float* result, size_t count))                                        \
    /* count a multiple of 8, at least 32; result[ES_SIMD_OPERATION_COUNT][count] */                             \
    X(simd_operations, (const float* a, const float* b, const float* c, uint32_t* result, size_t count))

struct es_platform_kernels {
#define ES_PLATFORM_KERNEL_FIELD(name, arguments) void (*name) arguments;
    ES_PLATFORM_KERNELS(ES_PLATFORM_KERNEL_FIELD)
#undef ES_PLATFORM_KERNEL_FIELD
};

/* NULL when the ISA was not built; whether it runs here is es_isa_available_mask()'s to say */
const struct es_platform_kernels* es_platform_kernel_table(es_isa isa);

#endif
