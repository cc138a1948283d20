/* sin, cos, exp2, log2 and pow on eight lanes; each lane equals es_sin … of maths.h bit for bit, ranges and errors as there. */
#ifndef EARTHSHINE_PLATFORM_SIMD_MATHS_H
#define EARTHSHINE_PLATFORM_SIMD_MATHS_H

#include "platform/simd.h"

#define M_DECLARE VINL
#define M_NAME(name) vf_##name
#define M_F vf
#define M_I vi
#define M_U vu
#define M_MASK vm
#define M_SET(a) vf_set1(a)
#define M_UINT(a) ((vu)vi_set1((int32_t)(a)))
#define M_BITS(a) ((vu)(a))
#define M_FLOAT(a) ((vf)(a))
#define M_UNSIGNED(a) ((vu)(a))
#define M_SIGNED(a) ((vi)(a))
#define M_SELECT(m, yes, no) vf_select(m, yes, no)
#define M_MIN(a, b) vf_min(a, b)
#define M_MAX(a, b) vf_max(a, b)
#define M_ABS(a) vf_abs(a)
#define M_TRUNCATE(a) vi_truncate(a)
#define M_FROM_INT(a) vf_from_int(a)

#include "platform/maths_functions.inl"

#undef M_DECLARE
#undef M_NAME
#undef M_F
#undef M_I
#undef M_U
#undef M_MASK
#undef M_SET
#undef M_UINT
#undef M_BITS
#undef M_FLOAT
#undef M_UNSIGNED
#undef M_SIGNED
#undef M_SELECT
#undef M_MIN
#undef M_MAX
#undef M_ABS
#undef M_TRUNCATE
#undef M_FROM_INT

#endif
