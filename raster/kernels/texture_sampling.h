/* Sampling a texture for eight pixels: wrap modes, nearest and linear filters, mip levels (glTF 2.0 §3.8.4). For kernel files.
 *
 * Texel coordinates stay below 2^24, so positions in a level are exact to 2^-9 texel at worst; coordinates that are not finite
 * sample texel 0. Weights have 24 bits, texels 16.
 */
#ifndef EARTHSHINE_RASTER_KERNELS_TEXTURE_SAMPLING_H
#define EARTHSHINE_RASTER_KERNELS_TEXTURE_SAMPLING_H

#include "platform/simd.h"
#include "raster/stages.h"

typedef struct es_uv { vf u, v, dudx, dvdx, dudy, dvdy; } es_uv;
typedef struct es_rgba { vf r, g, b, a; } es_rgba;

/* log2(x) for normal positive x, error below 5e-5: the mip level needs no more. Exponent plus a polynomial in the mantissa that is
 * exact at 1 and 2, so that it is continuous (the cubic interpolates at Chebyshev nodes). */
VINL vf es_mip_log2(vf x)
{
    vi bits = vi_from_bits(x);
    vf e = vf_from_int((vi_shift_right_logical(bits, 23) & vi_set1(255)) - vi_set1(127));
    vf m = vf_from_bits((bits & vi_set1(0x7fffff)) | vi_set1(0x3f800000)) - vf_set1(1.0f);
    vf one = vf_set1(1.0f);
    vf c = ((vf_set1(-0.04487396f) * m + vf_set1(0.1505332f)) * m + vf_set1(-0.2695780f)) * m + vf_set1(0.4424186f);
    return e + (m + m * (one - m) * c);
}

/* the texel that stands for i in a level of `size` texels */
VINL vi es_wrap_texel(vi i, int32_t size, uint32_t wrap)
{
    vi last = vi_set1(size - 1);
    if (wrap == ES_WRAP_CLAMP) return vi_min(vi_max(i, vi_zero()), last);
    /* repeat: after the fraction is taken, i is in [-1, size]; mirror: in [-1, 2 size] */
    if (wrap == ES_WRAP_REPEAT) {
        i = vi_select(vi_lt(i, vi_zero()), last, i);
        return vi_select(vi_gt(i, last), i - vi_set1(size), i);
    }
    i = vi_select(vi_lt(i, vi_zero()), vi_set1(-1) - i, i);
    i = vi_select(vi_gt(i, last), vi_set1(2 * size - 1) - i, i);
    return vi_max(i, vi_zero());
}

/* u brought to one period, so that texel coordinates are small: [0, 1) for repeat, [0, 2) for mirror, clamped otherwise */
VINL vf es_wrap_coordinate(vf u, uint32_t wrap)
{
    u = vf_select(vm_lt(vf_abs(u), vf_set1(1e9f)), u, vf_zero());
    if (wrap == ES_WRAP_REPEAT) return u - vf_floor(u);
    if (wrap == ES_WRAP_MIRROR) return u - vf_set1(2.0f) * vf_floor(u * vf_set1(0.5f));
    return vf_min(vf_max(u, vf_set1(-1.0f)), vf_set1(2.0f));
}

VINL void es_fetch_texel(const es_texture_image* image, vi offset, vf weight, es_rgba* sum)
{
    vi at = offset + offset;
    vi low = vi_gather(image->texels, at), high = vi_gather(image->texels, at + vi_set1(1));
    vi mask = vi_set1(0xffff);
    sum->r = sum->r + vf_from_int(low & mask) * weight;
    sum->g = sum->g + vf_from_int(vi_shift_right_logical(low, 16)) * weight;
    sum->b = sum->b + vf_from_int(high & mask) * weight;
    sum->a = sum->a + vf_from_int(vi_shift_right_logical(high, 16)) * weight;
}

/* adds weight * the level's value at (u, v); level differs by lane */
VINL void es_sample_level(const es_prepared_texture* texture, vf u, vf v, vi level, vm linear, vf weight, es_rgba* sum)
{
    const es_texture_image* image = texture->image;
    vm todo = vm_all_lanes();
    /* lanes mostly agree on the level; sizes then are uniform */
    while (vm_any(todo)) {
        int32_t l = level[__builtin_ctz(vm_bits(todo))];
        vm here = todo & vi_eq(level, vi_set1(l));
        todo &= ~here;
        uint32_t width = image->width >> l ? image->width >> l : 1, height = image->height >> l ? image->height >> l : 1;
        vf w = vf_and(here, weight), half = vf_and(linear, vf_set1(0.5f));
        vf x = u * vf_set1((float)width) - half, y = v * vf_set1((float)height) - half;
        vf fx = vf_floor(x), fy = vf_floor(y);
        vf tx = vf_and(linear, x - fx), ty = vf_and(linear, y - fy);
        vi ix = vi_truncate(fx), iy = vi_truncate(fy);
        vi x0 = es_wrap_texel(ix, (int32_t)width, texture->wrap_u), y0 = es_wrap_texel(iy, (int32_t)height, texture->wrap_v);
        vi row = vi_set1((int32_t)width), base = vi_set1((int32_t)image->level_offset[l]);
        vf one = vf_set1(1.0f), sx = one - tx, sy = one - ty;
        es_fetch_texel(image, base + y0 * row + x0, w * (sx * sy), sum);
        if (vm_any(here & linear)) {
            vi x1 = es_wrap_texel(ix + vi_set1(1), (int32_t)width, texture->wrap_u), y1 = es_wrap_texel(iy + vi_set1(1), (int32_t)height, texture->wrap_v);
            es_fetch_texel(image, base + y0 * row + x1, w * (tx * sy), sum);
            es_fetch_texel(image, base + y1 * row + x0, w * (sx * ty), sum);
            es_fetch_texel(image, base + y1 * row + x1, w * (tx * ty), sum);
        }
    }
}

/* The texture's value, linear in [0, 1]. Only lanes in `active` matter; the others may hold anything. */
VINL es_rgba es_sample_texture(const es_prepared_texture* texture, const es_uv* uv, vm active)
{
    const es_texture_image* image = texture->image;
    const float* m = texture->matrix;
    vf m00 = vf_set1(m[0]), m01 = vf_set1(m[1]), m10 = vf_set1(m[2]), m11 = vf_set1(m[3]);
    vf u = (m00 * uv->u + m01 * uv->v) + vf_set1(texture->offset[0]), v = (m10 * uv->u + m11 * uv->v) + vf_set1(texture->offset[1]);
    u = es_wrap_coordinate(vf_and(active, u), texture->wrap_u);
    v = es_wrap_coordinate(vf_and(active, v), texture->wrap_v);

    /* rho^2: the longer axis of the pixel's footprint in texels of level 0 */
    vf w = vf_set1((float)image->width), h = vf_set1((float)image->height);
    vf ax = (m00 * uv->dudx + m01 * uv->dvdx) * w, ay = (m10 * uv->dudx + m11 * uv->dvdx) * h;
    vf bx = (m00 * uv->dudy + m01 * uv->dvdy) * w, by = (m10 * uv->dudy + m11 * uv->dvdy) * h;
    vf rho2 = vf_max(ax * ax + ay * ay, bx * bx + by * by);
    rho2 = vf_and(active, vf_min(vf_max(rho2, vf_set1(1e-20f)), vf_set1(1e20f))); /* NaN counts as the finest level */
    rho2 = vf_select(vm_gt(rho2, vf_zero()), rho2, vf_set1(1e-20f));
    vf lambda = es_mip_log2(rho2) * vf_set1(0.5f);
    vm magnified = vm_le(lambda, vf_zero());
    vm linear = vi_select(magnified, texture->magnify == ES_FILTER_LINEAR ? vm_all_lanes() : vi_zero(), texture->minify == ES_FILTER_LINEAR ? vm_all_lanes() : vi_zero());
    lambda = vf_min(vf_max(lambda, vf_zero()), vf_set1((float)(image->level_count - 1)));

    es_rgba sum = {vf_zero(), vf_zero(), vf_zero(), vf_zero()};
    vf scale = vf_set1(1.0f / 65535.0f), finer = scale, coarser = vf_zero(); /* weights of a level and the next */
    vi level = vi_zero();
    if (texture->mip == ES_MIP_NEAREST && image->level_count > 1) {
        level = vi_truncate(lambda + vf_set1(0.5f));
    } else if (texture->mip != ES_MIP_NONE && image->level_count > 1) {
        vf base = vf_floor(lambda), t = lambda - base;
        level = vi_truncate(base);
        finer = (vf_set1(1.0f) - t) * scale;
        coarser = t * scale;
    }
    es_sample_level(texture, u, v, level, linear, finer, &sum);
    if (vm_any(vm_gt(coarser, vf_zero()))) es_sample_level(texture, u, v, vi_min(level + vi_set1(1), vi_set1((int32_t)image->level_count - 1)), linear, coarser, &sum);
    return sum;
}

#endif
