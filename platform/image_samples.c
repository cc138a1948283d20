/* Sample encodings of image files: half floats and the sRGB curve, from + - * / alone, so that the bits are the same on
 * every machine. Hardware conversions are avoided on purpose: some quiet signalling NaNs, some do not. */
#include "platform/image_files.h"

#include <string.h>

float es_half_to_float(uint16_t half)
{
    uint32_t sign = (uint32_t)(half & 0x8000u) << 16, exponent = (half >> 10) & 31u, mantissa = half & 1023u, bits;
    float value;
    if (exponent == 0) {
        value = (float)mantissa * 0x1p-24f;  /* denormal: an integer below 1024 times a power of two, exact */
        memcpy(&bits, &value, 4);
        bits |= sign;
    } else if (exponent == 31) {
        bits = sign | 0x7f800000u | mantissa << 13;
    } else {
        bits = sign | (exponent + 112u) << 23 | mantissa << 13;
    }
    memcpy(&value, &bits, 4);
    return value;
}

uint16_t es_float_to_half(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    uint32_t sign = bits >> 16 & 0x8000u, magnitude = bits & 0x7fffffffu;
    if (magnitude > 0x7f800000u) {  /* NaN: keep the upper payload, and never let it become infinity */
        uint32_t payload = magnitude >> 13 & 1023u;
        return (uint16_t)(sign | 0x7c00u | (payload ? payload : 0x200u));
    }
    if (magnitude >= 0x477ff000u) return (uint16_t)(sign | 0x7c00u);  /* 65520, halfway to 65536, and infinity */
    if (magnitude < 0x33000001u) return (uint16_t)sign;               /* at most 2^-25: ties to even zero */
    uint32_t exponent = magnitude >> 23, mantissa = (magnitude & 0x7fffffu) | 0x800000u, shift, base;
    if (exponent >= 113) {
        shift = 13;
        base = (exponent - 112u) << 10;
        mantissa &= 0x7fffffu;
    } else {  /* denormal half: 14 … 24 bits of the 24-bit mantissa are dropped */
        shift = 126u - exponent;
        base = 0;
    }
    uint32_t kept = mantissa >> shift, rest = mantissa & ((1u << shift) - 1u), half_way = 1u << (shift - 1u);
    kept += rest > half_way || (rest == half_way && (kept & 1u));
    return (uint16_t)(sign | (base + kept));  /* a carry out of the mantissa steps the exponent, as it should */
}

double es_srgb_decode(double encoded)
{
    if (encoded <= 0.04045) return encoded / 12.92;
    double y = (encoded + 0.055) / 1.055;
    /* y^2.4 = y^2 (y^(1/5))^2. Newton on t^5 = y from t = 1 falls monotonically; y >= 0.0904 here, so eight steps reach
     * the last bit and the rest change nothing. */
    double t = 1.0;
    for (int step = 0; step < 10; step++) {
        double t2 = t * t;
        t = (4.0 * t + y / (t2 * t2)) / 5.0;
    }
    return y * y * (t * t);
}

void es_srgb_thresholds(double thresholds[255])
{
    for (int k = 0; k < 255; k++) thresholds[k] = es_srgb_decode((k + 0.5) / 255.0);
}

uint8_t es_srgb_encode8(const double thresholds[255], float linear)
{
    uint32_t code = 0;  /* how many thresholds lie at or below the value; NaN compares false with all */
    for (uint32_t step = 128; step; step >>= 1) {
        if ((double)linear >= thresholds[code + step - 1]) code += step;
    }
    return (uint8_t)code;
}
