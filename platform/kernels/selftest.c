/* Every operation of the SIMD vocabulary, one row of results each, so that a test can compare instruction sets row by row.
 *
 * Integer operands are the bits of the floats, shifted where the plain operator would overflow: addition of 31-bit values,
 * products of 15-bit ones. */
#include "platform/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_platform_simd_operations)(const float* pa, const float* pb, const float* pc, uint32_t* result, size_t count)
{
#define ROW(name) (result + (size_t)ES_SIMD_##name * count + i)
#define PUT(name, value) do { vf v_ = (value); vf_store((float*)ROW(name), v_); } while (0)
#define PUT_INT(name, value) do { vi v_ = (value); vi_store(ROW(name), v_); } while (0)
    for (size_t i = 0; i < count; i += VW) {
        vf a = vf_load(pa + i), b = vf_load(pb + i), c = vf_load(pc + i);
        vi ia = vi_load(pa + i), ib = vi_load(pb + i), ic = vi_from_bits(c);
        vm m = vm_lt(a, b);

        PUT(vf_add, a + b);
        PUT(vf_subtract, a - b);
        PUT(vf_multiply, a * b);
        PUT(vf_divide, a / b);
        PUT_INT(vi_add, (ia >> 1) + (ib >> 1));
        PUT_INT(vi_subtract, (ia >> 1) - (ib >> 1));
        PUT_INT(vi_multiply, (ia >> 17) * (ib >> 17));
        PUT_INT(vi_and, ia & ib);
        PUT_INT(vi_or, ia | ib);
        PUT_INT(vi_xor, ia ^ ib);
        PUT_INT(vi_shift_left, vi_shift_right_logical(ia, 9) << 8);
        PUT_INT(vi_shift_right, ia >> 5);
        PUT_INT(vi_shift_right_logical, vi_shift_right_logical(ia, 5));

        PUT(vf_set1, vf_set1(pa[i]));
        PUT_INT(vi_set1, vi_set1(ia[1]));
        PUT(vf_iota, vf_iota());
        PUT_INT(vi_iota, vi_iota());
        PUT(vf_zero, vf_zero());
        PUT_INT(vi_zero, vi_zero());

        PUT_INT(vm_lt, vm_lt(a, b));
        PUT_INT(vm_le, vm_le(a, b));
        PUT_INT(vm_gt, vm_gt(a, b));
        PUT_INT(vm_ge, vm_ge(a, b));
        PUT_INT(vm_eq, vm_eq(a, b));
        PUT_INT(vm_ne, vm_ne(a, b));
        PUT_INT(vi_lt, vi_lt(ia, ib));
        PUT_INT(vi_gt, vi_gt(ia, ib));
        PUT_INT(vi_eq, vi_eq(ia, ib));
        PUT_INT(vm_all_lanes, vm_all_lanes());
        PUT_INT(vm_bits, vi_set1((int32_t)vm_bits(m)));
        PUT_INT(vm_any, vi_set1(vm_any(m)));
        PUT_INT(vm_all, vi_set1(vm_all(m)));
        PUT_INT(vm_first, vm_first((int32_t)(i / VW % 9)));

        PUT(vf_select, vf_select(m, a, c));
        PUT_INT(vi_select, vi_select(m, ia, ic));
        PUT(vf_and, vf_and(m, a));
        PUT(vf_min, vf_min(a, b));
        PUT(vf_max, vf_max(a, b));
        PUT(vf_clamp, vf_clamp(a, b, c));
        PUT(vf_abs, vf_abs(a));
        PUT(vf_neg, vf_neg(a));
        PUT(vf_copysign, vf_copysign(a, b));
        PUT_INT(vi_min, vi_min(ia, ib));
        PUT_INT(vi_max, vi_max(ia, ib));
        PUT(vf_sqrt, vf_sqrt(a));
        PUT(vf_from_int, vf_from_int(ia));
        PUT_INT(vi_truncate, vi_truncate(a));
        PUT_INT(vi_round, vi_round(a));
        PUT(vf_floor, vf_floor(a));
        PUT(vf_sum, vf_set1(vf_sum(a)));

        /* word indices below 16, and records of four words at them, stay within the 32 words promised */
        vi index = vi_shift_right_logical(ib, 3) & vi_set1(15);
        PUT(vf_gather, vf_gather(pa, index));
        PUT_INT(vi_gather, vi_gather(pa, index));
        vi w0, w1, w2, w3;
        vi_gather4(pa, 4, index, &w0, &w1, &w2, &w3);
        PUT_INT(vi_gather4_a, w0);
        PUT_INT(vi_gather4_b, w1);
        PUT_INT(vi_gather4_c, w2);
        PUT_INT(vi_gather4_d, w3);
        vf f0, f1, f2, f3;
        size_t at = i + 4 * VW <= count ? i : count - 4 * VW;
        vf_load4(pa + at, &f0, &f1, &f2, &f3);
        PUT(vf_load4_a, f0);
        PUT(vf_load4_b, f1);
        PUT(vf_load4_c, f2);
        PUT(vf_load4_d, f3);
        float stored[4 * VW];
        vf_store4(stored, a, b, c, vf_iota());
        PUT(vf_store4_0, vf_load(stored));
        PUT(vf_store4_1, vf_load(stored + VW));
        PUT(vf_store4_2, vf_load(stored + 2 * VW));
        PUT(vf_store4_3, vf_load(stored + 3 * VW));
        vf_store3(stored, b, c, a);
        PUT(vf_store3_0, vf_load(stored));
        PUT(vf_store3_1, vf_load(stored + VW));
        PUT(vf_store3_2, vf_load(stored + 2 * VW));
        PUT(vf_store3_3, vf_load(stored + 3 * VW));
        const uint32_t bits = vm_bits(vm_lt(a, b));
        vf_store(stored + VW, a);
        vf_store_packed(stored, c, v_packing_of(bits));
        for (int k = __builtin_popcount(bits); k < VW; k++) stored[k] = 0.0f;
        PUT(vf_store_packed, vf_load(stored));
        PUT(vf_store_packed_behind, vf_load(stored + VW));
    }
}
