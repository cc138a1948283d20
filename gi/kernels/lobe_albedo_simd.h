/* gi/micro/lobe_albedo.h on eight lanes, the same operations. */
#ifndef EARTHSHINE_GI_LOBE_ALBEDO_SIMD_H
#define EARTHSHINE_GI_LOBE_ALBEDO_SIMD_H

#include "gi/kernels/surface_simd.h"
#include "gi/micro/lobe_albedo.h"

VINL vf es_lobe_between_v(const float* table, vi at, vf row, vf column)
{
    const vi below = at + vi_set1(ES_LOBE_COLUMNS), one = vi_set1(1);
    const vf a = vf_gather(table, at), b = vf_gather(table, at + one), c = vf_gather(table, below), d = vf_gather(table, below + one);
    const vf near = a + (b - a) * column, far = c + (d - c) * column;
    return near + (far - near) * row;
}

/* Directional albedo of the lobes at that cosine of the incident light, times 1; 0 of what is unlit. */
VINL void es_lobe_albedo_v(const es_lobe_albedo* table, const es_surface_v* s, vf cosine, vf albedo[3])
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), last = vf_set1((float)(ES_LOBE_ROWS - 1));
    const vm phong = vi_eq(s->model, vi_set1(ES_SURFACE_PHONG)), unlit = vi_eq(s->model, vi_set1(ES_SURFACE_UNLIT));
    vf row = last * vf_clamp(s->roughness, zero, one);
    if (vm_any(phong)) row = vf_select(phong, last * vf_sqrt(vf_clamp(s->roughness * vf_set1(1.0f / ES_LOBE_MAX_EXPONENT), zero, one)), row);
    vf column = vf_clamp(cosine, zero, one) * vf_set1((float)(ES_LOBE_COLUMNS - 1));
    const vi r = vi_truncate(vf_min(row, vf_set1((float)(ES_LOBE_ROWS - 2)))), c = vi_truncate(vf_min(column, vf_set1((float)(ES_LOBE_COLUMNS - 2))));
    row = row - vf_from_int(r);
    column = column - vf_from_int(c);
    const vi at = r * vi_set1(ES_LOBE_COLUMNS) + c;
    const vf f90 = vf_min(vf_set1(25.0f) * vf_max(s->specular[0], vf_max(s->specular[1], s->specular[2])), one);
    const vf low = es_lobe_between_v(table->low, at, row, column), high = f90 * es_lobe_between_v(table->high, at, row, column);
    for (int k = 0; k < 3; k++) albedo[k] = s->specular[k] * low + high;
    if (vm_any(phong)) {
        const vf share = es_lobe_between_v(table->phong, at, row, column);
        for (int k = 0; k < 3; k++) albedo[k] = vf_select(phong, s->specular[k] * share, albedo[k]);
    }
    for (int k = 0; k < 3; k++) albedo[k] = vf_and(~unlit, albedo[k]);
}

/* Share of light from everywhere that the whole surface reflects. */
VINL void es_surface_albedo_v(const es_lobe_albedo* table, const es_surface_v* s, vf albedo[3])
{
    const vf zero = vf_zero(), one = vf_set1(1.0f), last = vf_set1((float)(ES_LOBE_ROWS - 1));
    const vm phong = vi_eq(s->model, vi_set1(ES_SURFACE_PHONG)), unlit = vi_eq(s->model, vi_set1(ES_SURFACE_UNLIT));
    vf row = last * vf_clamp(s->roughness, zero, one);
    if (vm_any(phong)) row = vf_select(phong, last * vf_sqrt(vf_clamp(s->roughness * vf_set1(1.0f / ES_LOBE_MAX_EXPONENT), zero, one)), row);
    const vi r = vi_truncate(vf_min(row, vf_set1((float)(ES_LOBE_ROWS - 2)))), next = r + vi_set1(1);
    row = row - vf_from_int(r);
    const vf f90 = vf_min(vf_set1(25.0f) * vf_max(s->specular[0], vf_max(s->specular[1], s->specular[2])), one);
    const vf through = one - f90 * vf_set1(0.04f + 0.96f / 21.0f);
    vf low = vf_gather(table->mean_low, r), high = vf_gather(table->mean_high, r), share = vf_gather(table->mean_phong, r);
    low = low + (vf_gather(table->mean_low, next) - low) * row;
    high = f90 * (high + (vf_gather(table->mean_high, next) - high) * row);
    share = share + (vf_gather(table->mean_phong, next) - share) * row;
    for (int k = 0; k < 3; k++) {
        const vf metal = s->albedo[k] * (through * through) + s->specular[k] * low + high;
        albedo[k] = vf_and(~unlit, vf_select(phong, s->albedo[k] + s->specular[k] * share, metal));
    }
}

#endif
