/* Scalar elementary functions. What kernels share (sin, cos, exp2, log2, pow) is maths_functions.inl with one lane; the rest is
 * computed in double with + - * / and sqrt, which every machine rounds alike, and rounded to float once. */
#include <string.h>

#include "platform/maths.h"

static inline uint32_t float_bits(float a)
{
    uint32_t bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}
static inline float bits_float(uint32_t bits)
{
    float a;
    memcpy(&a, &bits, sizeof a);
    return a;
}

#define M_DECLARE
#define M_NAME(name) es_##name
#define M_F float
#define M_I int32_t
#define M_U uint32_t
#define M_MASK bool
#define M_SET(a) (a)
#define M_UINT(a) (a)
#define M_BITS(a) float_bits(a)
#define M_FLOAT(a) bits_float(a)
#define M_UNSIGNED(a) ((uint32_t)(a))
#define M_SIGNED(a) ((int32_t)(a))
#define M_SELECT(m, yes, no) ((m) ? (yes) : (no))
#define M_MIN(a, b) es_minf(a, b)
#define M_MAX(a, b) es_maxf(a, b)
#define M_ABS(a) es_absf(a)
#define M_TRUNCATE(a) ((int32_t)(a))
#define M_FROM_INT(a) ((float)(a))

#include "platform/maths_functions.inl"

float es_tan(float x)
{
    float s, c;
    es_sincos(x, &s, &c);
    return s / c; /* no float is a multiple of pi/2 but 0, so c is never 0 within the range */
}

/* e^x = 2^n 2^f, n + f = x / ln 2; 2^f by a minimax polynomial of degree 7, relative error 2^-34.5. */
float es_exp(float x)
{
    if (x != x) return es_quiet_(false, x);
    if (x > 89.0f) return __builtin_inff();
    if (x < -88.0f) return 0.0f;
    double t = (double)x * 1.4426950408889634;
    int32_t n = (int32_t)(t + 192.5) - 192;
    double f = t - (double)n;
    double p = 0.99999999996168842 + f * (0.69314718072843373 + f * (0.24022651198170034 + f * (0.05550410353466001 +
        f * (0.0096180272504812307 + f * (0.0013333922541673227 + f * (0.00015469292228075806 + f * 1.5201928657274308e-05))))));
    uint64_t scale_bits = (uint64_t)(1023 + n) << 52;
    double scale;
    memcpy(&scale, &scale_bits, sizeof scale);
    float result = (float)(p * scale);
    return result < 0x1p-126f ? 0.0f : result;
}

/* atan of t in [0, 1]: above tan(pi/8) by atan t = pi/4 + atan((t - 1) / (t + 1)); odd minimax polynomial, error 2^-35.5. */
static double atan_unit(double t)
{
    double base = 0;
    if (t > 0.41421356237309503) {
        base = 0.78539816339744828;
        t = (t - 1.0) / (t + 1.0);
    }
    double z = t * t;
    return base + t * (0.9999999999792708 + z * (-0.3333333213453924 + z * (0.19999886358723079 + z * (-0.14281650760788667 +
        z * (0.11041183763079478 + z * (-0.084597815507159072 + z * 0.047143047275166994))))));
}

/* y may be any sign, x too; atan2(0, 0) = 0 with the usual signs and quadrants */
static double atan2_double(double y, double x)
{
    double ay = __builtin_fabs(y), ax = __builtin_fabs(x);
    double angle;
    if (ay == ax) angle = ay == 0.0 ? 0.0 : 0.78539816339744828; /* both may be infinite */
    else if (ay < ax) angle = atan_unit(ay / ax);
    else angle = 1.5707963267948966 - atan_unit(ax / ay);
    if (__builtin_signbit(x)) angle = 3.1415926535897931 - angle;
    return __builtin_signbit(y) ? -angle : angle;
}

float es_atan2(float y, float x)
{
    if (x != x || y != y) return es_quiet_(false, x);
    return (float)atan2_double(y, x);
}

/* 2 atan(sqrt(1 - x) / sqrt(1 + x)): exact differences, no cancellation at either end */
float es_acos(float x)
{
    if (x != x) return es_quiet_(false, x);
    double c = es_clampf(x, -1.0f, 1.0f);
    return (float)(2.0 * atan2_double(__builtin_sqrt(1.0 - c), __builtin_sqrt(1.0 + c)));
}

float es_floor(float x)
{
    if (!(es_absf(x) < 8388608.0f)) return x; /* whole already, infinite or NaN */
    float t = (float)(int32_t)x;
    if (t > x) t -= 1.0f;
    return __builtin_copysignf(t, x);
}
