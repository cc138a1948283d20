/* The surface model of gi/surface.h on eight lanes, the same operations in the same order. */
#ifndef EARTHSHINE_GI_SURFACE_SIMD_H
#define EARTHSHINE_GI_SURFACE_SIMD_H

#include "gi/surface.h"
#include "platform/simd.h"
#include "platform/simd_maths.h"
#include "raster/pack.h"

typedef struct es_surface_v {
    vf albedo[3], specular[3], roughness;
    vi model;
} es_surface_v;

VINL es_surface_v es_surface_of_gbuffer_v(vi albedo_rg, vi albedo_b, vi word)
{
    es_surface_v s;
    vf base[3] = {es_unpack_unorm16_v(albedo_rg), es_unpack_unorm16_v(vi_shift_right_logical(albedo_rg, 16)), es_unpack_unorm16_v(albedo_b)};
    const vf one = vf_set1(1.0f), u8 = vf_set1(1.0f / 255.0f);
    const vi byte = vi_set1(0xff);
    s.model = vi_shift_right_logical(word, 24);
    vm phong = vi_eq(s.model, vi_set1(ES_SURFACE_PHONG)), unlit = vi_eq(s.model, vi_set1(ES_SURFACE_UNLIT));
    vf metallic = vf_from_int(word & byte) * u8, second = vf_from_int((word >> 8) & byte), specular = vf_from_int((word >> 16) & byte) * u8;
    vf dielectric = vf_set1(0.04f) * specular * (one - metallic), diffuse = one - metallic;
    s.roughness = vf_select(unlit, one, vf_select(phong, second * vf_set1(0.2f), second * u8));
    for (int k = 0; k < 3; k++) {
        s.albedo[k] = vf_and(~unlit, vf_select(phong, base[k], base[k] * diffuse));
        s.specular[k] = vf_and(~unlit, vf_select(phong, specular, base[k] * metallic + dielectric));
    }
    return s;
}

/* Does a surface of this G-buffer word reflect nothing but what its albedo does, whatever its colour? */
VINL vm es_surface_word_is_diffuse_v(vi word) { return vi_eq(word & vi_set1(0x00ff00ff), vi_zero()); }

/* es_surface_has_lobe */
VINL vm es_surface_has_lobe_v(const es_surface_v* s)
{
    const vf f0 = vf_max(s->specular[0], vf_max(s->specular[1], s->specular[2])), alpha = s->roughness * s->roughness;
    const vm phong = vi_eq(s->model, vi_set1(ES_SURFACE_PHONG));
    return vm_gt(f0, vf_select(phong, vf_zero(), vf_set1(0.4f) * alpha * alpha)) & ~vi_eq(s->model, vi_set1(ES_SURFACE_UNLIT));
}

VINL void es_surface_parts_v(const es_surface_v* s, vf nx, vf ny, vf nz, vf ix, vf iy, vf iz, vf ox, vf oy, vf oz, vf* pass, vf lobe[3])
{
    const vf zero = vf_zero(), one = vf_set1(1.0f);
    vf nl = nx * ix + ny * iy + nz * iz, nv = nx * ox + ny * oy + nz * oz, c = ix * ox + iy * oy + iz * oz;
    vm above = vm_gt(nl, zero) & vm_gt(nv, zero);
    /* positive in lanes below the surface as well: what follows divides by them */
    nl = vf_clamp(nl, vf_set1(1e-20f), one);
    nv = vf_clamp(nv, vf_set1(1e-20f), one);
    vf f90 = vf_min(vf_set1(25.0f) * vf_max(s->specular[0], vf_max(s->specular[1], s->specular[2])), one);
    vf a = one - nl, b = one - nv;
    vf a2 = a * a, b2 = b * b;
    *pass = (one - f90 * (vf_set1(0.04f) + vf_set1(0.96f) * (a2 * a2 * a))) * (one - f90 * (vf_set1(0.04f) + vf_set1(0.96f) * (b2 * b2 * b)));
    vf hx = ix + ox, hy = iy + oy, hz = iz + oz;
    vf h = vf_sqrt(vf_max(hx * hx + hy * hy + hz * hz, vf_set1(1e-12f)));
    vf nh = vf_min((nl + nv) / h, one), m = vf_max(one - vf_set1(0.5f) * h, zero);
    vf alpha = s->roughness * s->roughness, alpha2 = vf_max(alpha * alpha, vf_set1(ES_SURFACE_MIN_ALPHA2)), rest = one - alpha2;
    vf d = one - nh * nh * rest;
    vf v = nl * vf_sqrt(nv * nv * rest + alpha2) + nv * vf_sqrt(nl * nl * rest + alpha2);
    vf dv = alpha2 * vf_set1(0.159154943f) / (d * d * v);
    vf m2 = m * m, fresnel = m2 * m2 * m;
    for (int k = 0; k < 3; k++) lobe[k] = dv * (s->specular[k] + (f90 - s->specular[k]) * fresnel);
    vm phong = vi_eq(s->model, vi_set1(ES_SURFACE_PHONG));
    if (vm_any(phong)) {
        vf r = vf_min(vf_max(vf_set1(2.0f) * nl * nv - c, zero), one);
        vf p = (s->roughness + vf_set1(2.0f)) * vf_set1(0.159154943f) * vf_pow(r, s->roughness);
        *pass = vf_select(phong, one, *pass);
        for (int k = 0; k < 3; k++) lobe[k] = vf_select(phong, s->specular[k] * p, lobe[k]);
    }
    *pass = vf_and(above, *pass);
    for (int k = 0; k < 3; k++) lobe[k] = vf_and(above, lobe[k]);
}

/* The eye may see a triangle from beyond the horizon of its interpolated normal, at every silhouette of a coarse mesh: the direction to
 * it is lifted to a grazing one, or the surface would have a black rim. */
VINL void es_lift_to_horizon_v(vf nx, vf ny, vf nz, vf* x, vf* y, vf* z)
{
    vf lift = vf_max(vf_set1(1e-3f) - (nx * *x + ny * *y + nz * *z), vf_zero());
    *x = *x + lift * nx;
    *y = *y + lift * ny;
    *z = *z + lift * nz;
}

/* f(wi, wo), 1/sr, of G-buffer words */
VINL void es_surface_reflect_gbuffer_v(vi albedo_rg, vi albedo_b, vi word, vf nx, vf ny, vf nz, vf ix, vf iy, vf iz, vf ox, vf oy, vf oz, vf* r, vf* g, vf* b)
{
    es_surface_v s = es_surface_of_gbuffer_v(albedo_rg, albedo_b, word);
    vf pass, lobe[3];
    es_surface_parts_v(&s, nx, ny, nz, ix, iy, iz, ox, oy, oz, &pass, lobe);
    pass = pass * vf_set1(0.318309886f);
    *r = s.albedo[0] * pass + lobe[0];
    *g = s.albedo[1] * pass + lobe[1];
    *b = s.albedo[2] * pass + lobe[2];
}

#endif
