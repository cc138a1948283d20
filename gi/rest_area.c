#include "gi/rest_area.h"

#include <string.h>

#include "platform/maths.h"

/* 7 bits of mantissa, to nearest: rotating a thing leaves the rounded numbers as they are */
static double rounded(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits = (bits + 0x8000u) & 0xffff0000u;
    memcpy(&x, &bits, sizeof x);
    return (double)x;
}

void es_gram_of(const es_mat4* transform, double gram[6])
{
    const float* m = transform->m;
    const es_vec3 x = es_v3(m[0], m[1], m[2]), y = es_v3(m[4], m[5], m[6]), z = es_v3(m[8], m[9], m[10]);
    const float parts[6] = {es_v3_dot(x, x), es_v3_dot(y, y), es_v3_dot(z, z), es_v3_dot(x, y), es_v3_dot(x, z), es_v3_dot(y, z)};
    const float sum = parts[0] + parts[1] + parts[2];
    memset(gram, 0, 6 * sizeof *gram);
    if (!(sum > 1e-30f && sum < 1e30f)) return;
    for (int k = 0; k < 6; k++) gram[k] = (double)(int32_t)(parts[k] / sum * 3072.0f + (parts[k] < 0.0f ? -0.5f : 0.5f)) * (rounded(sum) / 3072.0);
}

static double dot(const double gram[6], const double a[3], const double b[3])
{
    return gram[0] * a[0] * b[0] + gram[1] * a[1] * b[1] + gram[2] * a[2] * b[2] + gram[3] * (a[0] * b[1] + a[1] * b[0]) + gram[4] * (a[0] * b[2] + a[2] * b[0]) +
        gram[5] * (a[1] * b[2] + a[2] * b[1]);
}

static double root(double x) { return x > 0.0 ? __builtin_sqrt(x) : 0.0; }

double es_area_by_gram(const float* positions, const uint32_t* index, const double gram[6])
{
    const float *a = positions + 4 * (size_t)index[0], *b = positions + 4 * (size_t)index[1], *c = positions + 4 * (size_t)index[2];
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = (double)b[k] - (double)a[k];
        v[k] = (double)c[k] - (double)a[k];
    }
    const double uv = dot(gram, u, v), area = 0.5 * root(dot(gram, u, u) * dot(gram, v, v) - uv * uv);
    return area < 1e30 ? area : 0.0;
}
