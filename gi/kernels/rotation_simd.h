/* The rotation R that is nearest to a 3 × 3 matrix M, i.e. that maximises tr(Rᵀ M): the rotational part of M's polar decomposition where det M > 0,
 * and the best proper rotation otherwise (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions", §4).
 *
 * As a quaternion R is the eigenvector of the largest eigenvalue λ of a symmetric, traceless 4 × 4 matrix N of M's sums and differences, whose
 * characteristic polynomial is known from M: with M scaled to Frobenius norm 1,
 *     p(λ) = λ⁴ - 2 λ² - 8 det M λ + 1 - 4 ‖cof M‖²
 * Its roots are real, so Newton's steps from √3 ≥ λ come down to the largest without passing it. The eigenvector is a column of adj(N - λ), which is
 * c q qᵀ: the one with the largest diagonal. λ is as exact as floats allow where the two largest roots are a gap g apart, the vector to about 1e-7 / g²;
 * one Newton step on the rotation itself, ω = (tr A - sym A)⁻¹ axial(A), A = M Rᵀ, brings that to 1e-7 / g.
 * Matrices of rank 1 have g = 0 and no single answer: who makes them adds what says which one (gi/edit/edit.h). Of a zero matrix the answer is the identity; every
 * answer is finite. M's elements: each 0 or between 1e-15 and 1e15. */
#ifndef EARTHSHINE_GI_ROTATION_SIMD_H
#define EARTHSHINE_GI_ROTATION_SIMD_H

#include "platform/simd.h"

/* Row by row. */
typedef struct es_matrix3_v { vf at[9]; } es_matrix3_v;

VINL void es_matrix3_apply_v(const es_matrix3_v* m, const vf a[3], vf to[3])
{
    for (int i = 0; i < 3; i++) to[i] = m->at[3 * i] * a[0] + m->at[3 * i + 1] * a[1] + m->at[3 * i + 2] * a[2];
}

VINL void es_cofactors_v(const vf m[9], vf c[9])
{
    c[0] = m[4] * m[8] - m[5] * m[7];
    c[1] = m[5] * m[6] - m[3] * m[8];
    c[2] = m[3] * m[7] - m[4] * m[6];
    c[3] = m[2] * m[7] - m[1] * m[8];
    c[4] = m[0] * m[8] - m[2] * m[6];
    c[5] = m[1] * m[6] - m[0] * m[7];
    c[6] = m[1] * m[5] - m[2] * m[4];
    c[7] = m[2] * m[3] - m[0] * m[5];
    c[8] = m[0] * m[4] - m[1] * m[3];
}

/* Of a unit quaternion (w, x, y, z). */
VINL es_matrix3_v es_matrix3_of_quaternion_v(vf w, vf x, vf y, vf z)
{
    const vf one = vf_set1(1.0f), two = vf_set1(2.0f);
    const vf xx = x * x, yy = y * y, zz = z * z, xy = x * y, xz = x * z, yz = y * z, wx = w * x, wy = w * y, wz = w * z;
    return (es_matrix3_v){{one - two * (yy + zz), two * (xy - wz), two * (xz + wy), two * (xy + wz), one - two * (xx + zz), two * (yz - wx), two * (xz - wy), two * (yz + wx), one - two * (xx + yy)}};
}

/* The largest root; m of norm 1, c its cofactors. */
VINL vf es_largest_root_v(const vf m[9], const vf c[9])
{
    vf of_cofactors = vf_zero();
    for (int i = 0; i < 9; i++) of_cofactors = of_cofactors + c[i] * c[i];
    const vf d8 = vf_set1(8.0f) * (m[0] * c[0] + m[1] * c[1] + m[2] * c[2]), c0 = vf_set1(1.0f) - vf_set1(4.0f) * of_cofactors, two = vf_set1(2.0f), four = vf_set1(4.0f);
    vf root = vf_set1(1.7320508f);
    /* a double root is come nearer to by halves: twelve steps end within the rounding of p where the gap is 0.02 or more */
    for (int i = 0; i < 12; i++) {
        const vf square = root * root;
        const vf p = ((square - two) * root - d8) * root + c0, slope = four * (square - vf_set1(1.0f)) * root - d8;
        root = root - vf_max(p, vf_zero()) / vf_max(slope, vf_set1(1e-4f));
    }
    return root;
}

/* The eigenvector q = (w, x, y, z) of N for the root: the longest column of adj(N - λ). */
VINL void es_eigenvector_v(const vf m[9], vf root, vf q[4])
{
    const vf a = m[0] + m[4] + m[8] - root, b = m[7] - m[5], c = m[2] - m[6], d = m[3] - m[1];
    const vf e = m[0] - m[4] - m[8] - root, f = m[1] + m[3], g = m[2] + m[6];
    const vf h = m[4] - m[0] - m[8] - root, i = m[5] + m[7], j = m[8] - m[0] - m[4] - root;
    /* rows: a b c d | b e f g | c f h i | d g i j; minors of the lower and of the upper two rows */
    const vf hj = h * j - i * i, fj = f * j - i * g, fi = f * i - h * g, cj = c * j - i * d, ci = c * i - h * d, cg = c * g - f * d;
    const vf ae = a * e - b * b, af = a * f - b * c, ag = a * g - b * d, bf = b * f - e * c, bg = b * g - e * d;
    vf col[4][4];
    col[0][0] = e * hj - f * fj + g * fi;
    col[0][1] = vf_neg(b * hj - f * cj + g * ci);
    col[0][2] = b * fj - e * cj + g * cg;
    col[0][3] = vf_neg(b * fi - e * ci + f * cg);
    col[1][1] = a * hj - c * cj + d * ci;
    col[1][2] = vf_neg(a * fj - b * cj + d * cg);
    col[1][3] = a * fi - b * ci + c * cg;
    col[2][2] = j * ae - g * ag + d * bg;
    col[2][3] = vf_neg(i * ae - g * af + d * bf);
    col[3][3] = h * ae - f * af + c * bf;
    col[1][0] = col[0][1];
    col[2][0] = col[0][2];
    col[2][1] = col[1][2];
    col[3][0] = col[0][3];
    col[3][1] = col[1][3];
    col[3][2] = col[2][3];
    vf longest = vf_abs(col[0][0]);
    for (int k = 0; k < 4; k++) q[k] = col[0][k];
    for (int n = 1; n < 4; n++) {
        const vf length = vf_abs(col[n][n]);
        const vm longer = vm_gt(length, longest);
        longest = vf_max(length, longest);
        for (int k = 0; k < 4; k++) q[k] = vf_select(longer, col[n][k], q[k]);
    }
}

VINL es_matrix3_v es_normalised_rotation_v(vf w, vf x, vf y, vf z)
{
    const vf square = w * w + x * x + y * y + z * z;
    const vm some = vm_gt(square, vf_set1(1e-30f));
    const vf inverse = vf_and(some, vf_set1(1.0f) / vf_sqrt(vf_max(square, vf_set1(1e-30f))));
    return es_matrix3_of_quaternion_v(vf_select(some, w * inverse, vf_set1(1.0f)), x * inverse, y * inverse, z * inverse);
}

VINL es_matrix3_v es_nearest_rotation_v(const es_matrix3_v* of)
{
    vf m[9], cofactors[9], square = vf_zero(), q[4];
    for (int i = 0; i < 9; i++) square = square + of->at[i] * of->at[i];
    const vf inverse = vf_and(vm_gt(square, vf_set1(1e-30f)), vf_set1(1.0f) / vf_sqrt(vf_max(square, vf_set1(1e-30f))));
    for (int i = 0; i < 9; i++) m[i] = of->at[i] * inverse;
    es_cofactors_v(m, cofactors);
    es_eigenvector_v(m, es_largest_root_v(m, cofactors), q);
    const es_matrix3_v r = es_normalised_rotation_v(q[0], q[1], q[2], q[3]);

    /* one step on the rotation: A = M Rᵀ */
    vf a[9];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) a[3 * i + k] = m[3 * i] * r.at[3 * k] + m[3 * i + 1] * r.at[3 * k + 1] + m[3 * i + 2] * r.at[3 * k + 2];
    const vf trace = a[0] + a[4] + a[8], half = vf_set1(0.5f);
    const vf g[3] = {a[7] - a[5], a[2] - a[6], a[3] - a[1]};
    const vf xy = half * (a[1] + a[3]), xz = half * (a[2] + a[6]), yz = half * (a[5] + a[7]);
    const vf h[9] = {trace - a[0], vf_neg(xy), vf_neg(xz), vf_neg(xy), trace - a[4], vf_neg(yz), vf_neg(xz), vf_neg(yz), trace - a[8]};
    vf c[9];
    es_cofactors_v(h, c);
    const vf determinant = h[0] * c[0] + h[1] * c[1] + h[2] * c[2];
    /* where nothing decides, or the step would be no small one, the eigenvector stands */
    const vf per = vf_and(vm_gt(determinant, vf_set1(1e-7f)), half / vf_max(determinant, vf_set1(1e-7f)));
    vf turn[3];
    for (int i = 0; i < 3; i++) turn[i] = (c[3 * i] * g[0] + c[3 * i + 1] * g[1] + c[3 * i + 2] * g[2]) * per;
    const vm small = vm_lt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2], vf_set1(0.01f));
    const es_matrix3_v step = es_normalised_rotation_v(vf_set1(1.0f), vf_and(small, turn[0]), vf_and(small, turn[1]), vf_and(small, turn[2]));
    es_matrix3_v result;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) result.at[3 * i + k] = step.at[3 * i] * r.at[k] + step.at[3 * i + 1] * r.at[3 + k] + step.at[3 * i + 2] * r.at[6 + k];
    return result;
}

#endif
