/* sin, cos, exp2, log2 and pow, written once for one float and for eight lanes.
 *
 * Included by maths.c (F = float, names es_…) and simd_maths.h (F = vf, names vf_…), which define the M_ vocabulary; the two
 * perform the same IEEE operations in the same order, so each lane is the scalar result bit for bit. Only + - * of floats,
 * comparisons, integer operations on the bits and conversions between small whole numbers are used.
 *
 * Polynomials are minimax in relative error (Remez, coefficients rounded to float one by one from the lowest, the rest fitted
 * again). Rounding to a whole number adds a half and truncates: the usual addition of 1.5 * 2^23 is shorter, but a build with
 * fast-math folds it away, and that build must stay usable for timing.
 *
 * A NaN result is always 0x7fc00000: x86 and ARM disagree on the sign of the one they make. */

static inline __attribute__((always_inline)) M_F M_NAME(quiet_)(M_MASK valid, M_F result)
{
    return M_SELECT(valid, result, M_FLOAT(M_UINT(0x7fc00000u)));
}

/* sin and cos of x.
 *
 * Reduction: with q = round(|x| * 2/pi), r = |x| - q pi/2 in [-pi/4, pi/4]. pi/2 = P1 + P2 + P3 + P4 (Cody and Waite 1980, ch. 8);
 * P1, P2 and P3 have 11 bits, q has 13 up to |x| = 8192, so their products are exact, and so are the first two differences,
 * whose last bit is no lower than 2^-24. r + tail keeps what rounding would lose: near the zeros of sin and cos all
 * of the result comes from there. Above 8192 r drifts, above 2^22 quarter turns it is noise; both are clamped. */
M_DECLARE void M_NAME(sincos)(M_F x, M_F* sine, M_F* cosine)
{
    M_F a = M_ABS(x);
    M_I n = M_TRUNCATE(M_MIN(a * 0x1.45f306p-1f, M_SET(4194304.0f)) + 0.5f); /* NaN gives 2^22 */
    M_F q = M_FROM_INT(n);
    M_U quadrant = M_UNSIGNED(n);

    M_F r2 = (a - q * 0x1.92p+0f) - q * 0x1.fbp-12f;
    M_F p3 = q * 0x1.51p-22f;
    M_F r3 = r2 - p3;
    M_F rest = ((r2 - r3) - p3) - q * 0x1.0b4612p-34f;
    M_F r = r3 + rest;
    M_F tail = rest - (r - r3);
    r = M_MIN(M_MAX(r, M_SET(-0.79f)), M_SET(0.79f));

    M_F z = r * r;
    /* sin r = r + r z P(z), error 2^-27.9 */
    M_F s = r + (tail + r * (z * (-0.166666552f + z * (0.00833218917f + z * -0.000195182904f))));
    /* cos r = 1 - z/2 + z^2 Q(z), error 2^-33; w + ((1 - w) - h) is 1 - h without its rounding error */
    M_F h = 0.5f * z;
    M_F w = 1.0f - h;
    M_F c = w + (((1.0f - w) - h) + (z * z * (0.0416666456f + z * (-0.00138873095f + z * 2.44323273e-05f)) - r * tail));
    s = M_MIN(M_MAX(s, M_SET(-1.0f)), M_SET(1.0f));
    c = M_MIN(M_MAX(c, M_SET(-1.0f)), M_SET(1.0f));

    M_MASK even = (quadrant & 1u) == M_UINT(0u);
    M_F s_swapped = M_SELECT(even, s, c), c_swapped = M_SELECT(even, c, s);
    M_U s_sign = ((quadrant & 2u) << 30) ^ (M_BITS(x) & 0x80000000u);
    M_U c_sign = ((quadrant + 1u) & 2u) << 30;
    M_MASK valid = a <= 0x1.fffffep127f;
    *sine = M_NAME(quiet_)(valid, M_FLOAT(M_BITS(s_swapped) ^ s_sign));
    *cosine = M_NAME(quiet_)(valid, M_FLOAT(M_BITS(c_swapped) ^ c_sign));
}

M_DECLARE M_F M_NAME(sin)(M_F x)
{
    M_F s, c;
    M_NAME(sincos)(x, &s, &c);
    return s;
}

M_DECLARE M_F M_NAME(cos)(M_F x)
{
    M_F s, c;
    M_NAME(sincos)(x, &s, &c);
    return c;
}

/* 2^x = 2^n 2^f with |f| <= 1/2 (and a rounding error); 2^f = 1 + f P(f), error 2^-27.5. n is added to the exponent bits, which
 * cannot leave the normal numbers: n = 128 comes with f < 0 or gives infinity, n = -126 with f >= 0. */
M_DECLARE M_F M_NAME(exp2)(M_F x)
{
    M_F c = M_MIN(M_MAX(x, M_SET(-127.0f)), M_SET(128.0f)); /* NaN gives -127 */
    M_I n = M_TRUNCATE(c + 192.5f) - 192;
    M_F f = c - M_FROM_INT(n);
    M_F p = 1.0f + f * (0.693147242f + f * (0.240226552f + f * (0.0555027239f + f * (0.00961706322f + f * (0.00134182139f +
        f * 0.00015820234f)))));
    M_F result = M_FLOAT(M_BITS(p) + (M_UNSIGNED(n) << 23));
    return M_NAME(quiet_)(x == x, M_SELECT(x < -126.0f, M_SET(0.0f), result));
}

/* log2(2^e (1 + f)) = e + log2(1 + f), 1 + f in [sqrt(1/2), sqrt(2)). ln(1 + f) = f + y, y = -f^2/2 + f^3 P(f), error 2^-27.1 of
 * the whole; then log2(1 + f) = (f + y)(1 + L), summed from the smallest term, as in Cephes' logf (S. Moshier). */
M_DECLARE M_F M_NAME(log2)(M_F x)
{
    M_U bits = M_BITS(M_MAX(x, M_SET(0x1p-126f))); /* zero, negative, denormal and NaN give 2^-126 */
    M_I e = M_SIGNED(bits - 0x3f3504f3u) >> 23;
    M_F f = M_FLOAT(bits - (M_UNSIGNED(e) << 23)) - 1.0f;
    M_F z = f * f;
    M_F p = 0.333333313f + f * (-0.250008225f + f * (0.200012609f + f * (-0.166233167f + f * (0.142009318f + f * (-0.131599307f +
        f * (0.127673432f + f * -0.0764153749f))))));
    M_F y = f * z * p - 0.5f * z;
    const float L = 0x1.c551dap-2f; /* log2(e) - 1 */
    M_F result = (((y * L + f * L) + y) + f) + M_FROM_INT(e);
    result = M_SELECT(x == 0.0f, M_SET(-__builtin_inff()), result);
    result = M_SELECT(x > 0x1.fffffep127f, M_SET(__builtin_inff()), result);
    return M_NAME(quiet_)(x >= 0.0f, result);
}

/* The error of log2 is magnified by the exponent: about |y log2 x| further ulp. Enough for lobes and tone curves, whose
 * results below 2^-20 vanish in a sum; a log2 in two floats would double the cost. */
M_DECLARE M_F M_NAME(pow)(M_F x, M_F y)
{
    M_MASK one = (y == 0.0f) | (x == 1.0f); /* their product would be 0 times infinity */
    M_F result = M_NAME(exp2)(M_SELECT(one, M_SET(1.0f), y) * M_NAME(log2)(x));
    return M_SELECT(one, M_SET(1.0f), result);
}
