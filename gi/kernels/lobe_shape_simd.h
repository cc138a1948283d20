/* Shapes of lobes (gi/micro/lobe_shape.h) of eight surfaces, each in light from one direction. */
#ifndef EARTHSHINE_GI_LOBE_SHAPE_SIMD_H
#define EARTHSHINE_GI_LOBE_SHAPE_SIMD_H

#include "gi/kernels/surface_simd.h"
#include "gi/micro/lobe_shape.h"

VINL vf es_lobe_shape_between_v(const float tables[2][ES_SHAPE_CELLS], vi at, vf row, vf column)
{
    const float* table = tables[0];
    const vi below = at + vi_set1(ES_SHAPE_COLUMNS), one = vi_set1(1);
    const vf a = vf_gather(table, at), b = vf_gather(table, at + one), c = vf_gather(table, below), d = vf_gather(table, below + one);
    const vf near = a + (b - a) * column, far = c + (d - c) * column;
    return near + (far - near) * row;
}

/* n, towards and axis are unit, cosine is n · towards, width is a. */
VINL void es_lobe_shape_v(const es_lobe_shapes* shapes, const es_surface_v* s, const vf n[3], const vf towards[3], vf cosine, vf axis[3], vf* width, vf* gain)
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), last = vf_set1((float)(ES_SHAPE_ROWS - 1));
    const vm phong = vi_eq(s->model, vi_set1(ES_SURFACE_PHONG));
    const vf exponent = vf_clamp(s->roughness, zero, vf_set1(ES_SHAPE_MAX_EXPONENT)), roughness = vf_clamp(s->roughness, zero, one), alpha = roughness * roughness;
    const vf row = last * vf_select(phong, vf_sqrt(exponent * vf_set1(1.0f / ES_SHAPE_MAX_EXPONENT)), roughness), column = vf_clamp(cosine, zero, one) * vf_set1((float)(ES_SHAPE_COLUMNS - 1));
    const vi r = vi_truncate(vf_min(row, vf_set1((float)(ES_SHAPE_ROWS - 2)))), c = vi_truncate(vf_min(column, vf_set1((float)(ES_SHAPE_COLUMNS - 2))));
    const vi at = r * vi_set1(ES_SHAPE_COLUMNS) + c + (phong & vi_set1(ES_SHAPE_CELLS));
    const vf fr = row - vf_from_int(r), fc = column - vf_from_int(c);
    const vf lean = es_lobe_shape_between_v(shapes->lean, at, fr, fc), lift = es_lobe_shape_between_v(shapes->lift, at, fr, fc), ratio = es_lobe_shape_between_v(shapes->width, at, fr, fc);
    const vf along = cosine + lift + lean * cosine;
    vf square = zero;
    for (int k = 0; k < 3; k++) {
        axis[k] = n[k] * along - towards[k] * lean;
        square = square + axis[k] * axis[k];
    }
    const vf scale = one / vf_sqrt(vf_max(square, vf_set1(1e-12f)));
    for (int k = 0; k < 3; k++) axis[k] = axis[k] * scale;
    const vf own = vf_select(phong, vf_set1(0.5f) / (exponent + one), vf_max(alpha * alpha, vf_set1(ES_LOBE_LEAST_WIDTH)));
    *width = vf_clamp(ratio * ratio * own, vf_set1(ES_LOBE_LEAST_WIDTH), one);
    *gain = es_lobe_shape_between_v(shapes->gain, at, fr, fc);
}

#endif
