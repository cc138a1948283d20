/* Lookups in the environment's maps (gi/environment.h), eight directions at a time. */
#ifndef EARTHSHINE_GI_KERNELS_ENVIRONMENT_SIMD_H
#define EARTHSHINE_GI_KERNELS_ENVIRONMENT_SIMD_H

#include "gi/environment.h"
#include "platform/simd.h"

/* Any length of 1e-30 … 1e30; the place is in [0, 1]² but for a rounding. */
VINL void es_octahedral_place_v(vf x, vf y, vf z, vf* u, vf* v)
{
    const vf half = vf_set1(0.5f), scale = half / vf_max(vf_abs(x) + vf_abs(y) + vf_abs(z), vf_set1(1e-30f));
    const vf a = x * scale, b = z * scale;
    const vm below = vm_lt(y, vf_zero());
    *u = half + vf_select(below, vf_copysign(half - vf_abs(b), a), a);
    *v = half + vf_select(below, vf_copysign(half - vf_abs(a), b), b);
}

/* Back, unit. */
VINL void es_octahedral_direction_v(vf u, vf v, vf* x, vf* y, vf* z)
{
    const vf one = vf_set1(1.0f), two = vf_set1(2.0f);
    vf a = u * two - one, b = v * two - one;
    const vf up = one - vf_abs(a) - vf_abs(b), fold = vf_max(vf_neg(up), vf_zero());
    a = a - vf_copysign(fold, a);
    b = b - vf_copysign(fold, b);
    const vf scale = one / vf_sqrt(a * a + b * b + up * up);
    *x = a * scale;
    *y = up * scale;
    *z = b * scale;
}

/* Between four texels of a level per lane, which must exist. */
VINL void es_environment_texel_v(const es_environment_pyramid* p, vf u, vf v, vi level, vf result[4])
{
    const vf size = vf_gather(p->size, level), half = vf_set1(0.5f), one = vf_set1(1.0f), end = size + half;
    const vf fu = vf_min(vf_max(u * size + half, vf_zero()), end), fv = vf_min(vf_max(v * size + half, vf_zero()), end); /* NaN: 0 */
    const vi iu = vi_truncate(fu), iv = vi_truncate(fv), stride = vi_truncate(size) + vi_set1(2);
    const vf right = fu - vf_from_int(iu), down = fv - vf_from_int(iv);
    const vi at = vi_gather(p->first, level) + iv * stride + iu;
    const vf weight[4] = {(one - right) * (one - down), right * (one - down), (one - right) * down, right * down};
    const vi place[4] = {at, at + vi_set1(1), at + stride, at + stride + vi_set1(1)};
    for (int i = 0; i < 4; i++) {
        vf texel[4];
        vf_gather4(p->texels, 16, place[i], &texel[0], &texel[1], &texel[2], &texel[3]);
        for (int k = 0; k < 4; k++) result[k] = i ? result[k] + weight[i] * texel[k] : weight[i] * texel[k];
    }
}

/* Between two levels, `level` 0 … levels - 1; others are brought there. */
VINL void es_environment_pyramid_v(const es_environment_pyramid* p, vf x, vf y, vf z, vf level, vf result[4])
{
    vf u, v, above[4];
    es_octahedral_place_v(x, y, z, &u, &v);
    const vf last = vf_set1((float)(p->levels - 1));
    level = vf_min(vf_max(level, vf_zero()), last);
    const vi low = vi_truncate(level);
    const vf share = level - vf_from_int(low);
    es_environment_texel_v(p, u, v, low, result);
    if (!vm_any(vm_gt(share, vf_zero()))) return;
    es_environment_texel_v(p, u, v, vi_min(low + vi_set1(1), vi_truncate(last)), above);
    for (int k = 0; k < 4; k++) result[k] = result[k] + share * (above[k] - result[k]);
}

/* The level of `lobes` for GGX's alpha, the square of roughness. Levels are powers of two from 1/16 on; between them it is straight in alpha. */
VINL vf es_environment_level_of_alpha_v(vf alpha)
{
    const vf x = vf_set1(16.0f) * vf_min(vf_max(alpha, vf_zero()), vf_set1(1.0f));
    const vf steps = vf_from_int(vi_from_bits(x) - vi_set1(0x3f800000)) * vf_set1(0x1p-23f);
    return vf_select(vm_lt(x, vf_set1(1.0f)), x, vf_set1(1.0f) + steps);
}

/* The same for a direction that stands for a solid angle, sr: the lobe p with (∫p)² / ∫p² of that much has alpha² = solid angle / 12 pi. */
VINL vf es_environment_level_of_solid_angle_v(vf solid_angle) { return es_environment_level_of_alpha_v(vf_sqrt(solid_angle * vf_set1(0.0265258238f))); }

/* Radiance from a direction, W/(m² sr), averaged over what the level says; any length of 1e-30 … 1e30. Black when there is no environment. */
VINL void es_environment_radiance_v(const es_environment_lookup* e, vf x, vf y, vf z, vf level, vf rgb[3])
{
    vf result[4] = {vf_zero(), vf_zero(), vf_zero(), vf_zero()};
    if (e->lobes.levels) es_environment_pyramid_v(&e->lobes, x, y, z, level, result);
    for (int k = 0; k < 3; k++) rgb[k] = result[k];
}

/* Of an unoccluded surface by its normal, W/m². */
VINL void es_environment_irradiance_v(const es_environment_lookup* e, vf x, vf y, vf z, vf rgb[3])
{
    vf result[4] = {vf_zero(), vf_zero(), vf_zero(), vf_zero()}, u, v;
    es_octahedral_place_v(x, y, z, &u, &v);
    if (e->irradiance.levels) es_environment_texel_v(&e->irradiance, u, v, vi_zero(), result);
    for (int k = 0; k < 3; k++) rgb[k] = result[k];
}

#endif
