#include "gi/glare/value_noise.h"

#include "platform/random.h"

static float one_octave(uint32_t seed, double x)
{
    int64_t whole = (int64_t)x;
    whole -= x < (double)whole;
    const float t = (float)(x - (double)whole), s = t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
    const float a = es_random_float(seed, (uint32_t)whole), b = es_random_float(seed, (uint32_t)(whole + 1));
    return 2.0f * (a + (b - a) * s) - 1.0f;
}

float es_value_noise(uint32_t seed, double x, uint32_t octaves)
{
    float sum = 0, amplitude = 1, whole = 0;
    for (uint32_t i = 0; i < octaves; i++) {
        sum += amplitude * one_octave(seed + 0x9e37u * i, x);
        whole += amplitude;
        amplitude *= 0.5f;
        x *= 2;
    }
    return sum / whole;
}
