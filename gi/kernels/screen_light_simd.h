/* Light of eight pixels in a word each (gi/screen/screen_bounce.h): mantissas of 8 bits, red lowest, and the exponent of the brightest, biased as a float's; 0 is dark. */
#ifndef EARTHSHINE_GI_SCREEN_LIGHT_SIMD_H
#define EARTHSHINE_GI_SCREEN_LIGHT_SIMD_H

#include "platform/simd.h"

VINL vi es_pack_light_v(const vf c[3])
{
    const vf zero = vf_zero(), top = vf_set1(1e30f), most_mantissa = vf_set1(255.0f);
    const vf r = vf_clamp(c[0], zero, top), g = vf_clamp(c[1], zero, top), b = vf_clamp(c[2], zero, top), most = vf_max(r, vf_max(g, b));
    const vm lit = vm_gt(most, vf_set1(1e-30f));
    const vi exponent = vi_shift_right_logical(vi_from_bits(vf_select(lit, most, vf_set1(1.0f))), 23);
    const vf scale = vf_from_bits((vi_set1(254 + 7) - exponent) << 23); /* the brightest becomes 128 … 255 */
    const vi word = vi_round(vf_min(r * scale, most_mantissa)) | vi_round(vf_min(g * scale, most_mantissa)) << 8 | vi_round(vf_min(b * scale, most_mantissa)) << 16 | exponent << 24;
    return lit & word;
}

VINL void es_unpack_light_v(vi word, vf c[3])
{
    const vi byte = vi_set1(0xff), exponent = vi_shift_right_logical(word, 24);
    /* dark words have the exponent 0, and no mantissa that its scale would count for */
    const vf scale = vf_from_bits(vi_max(exponent - vi_set1(7), vi_set1(1)) << 23);
    c[0] = vf_from_int(word & byte) * scale;
    c[1] = vf_from_int(vi_shift_right_logical(word, 8) & byte) * scale;
    c[2] = vf_from_int(vi_shift_right_logical(word, 16) & byte) * scale;
}

#endif
