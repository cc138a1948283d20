/* Rows of the image, split into the n phases of interleaved shading and put together again (Segovia et al. 2006). Each pixel is read and
 * written once, with its neighbours; by strides of n, phase after phase, every line of the cache came and went n times, which took
 * more than half of the time of shading 256 lights. */
#ifndef EARTHSHINE_GI_PHASES_SIMD_H
#define EARTHSHINE_GI_PHASES_SIMD_H

#include <string.h>

#include "platform/simd.h"

/* Pixels [0, count) of a row: pixel i · n + p goes to phases[p · phase_stride + i], which is written in whole eights. Those past the row are 0. */
VINL void es_split_row(const void* words, uint32_t count, uint32_t n, void* phases, size_t phase_stride)
{
    const float* from = words;
    float* to = phases;
    const uint32_t columns = (count + n - 1) / n;
    for (uint32_t i = 0; i < columns; i += VW) {
        if (n == VW && i * n + VW * VW <= count) {
            vf v[VW];
            for (uint32_t k = 0; k < VW; k++) v[k] = vf_load(from + (i + k) * n);
            vf_transpose8(v);
            for (uint32_t k = 0; k < VW; k++) vf_store(to + k * phase_stride + i, v[k]);
            continue;
        }
        for (uint32_t p = 0; p < n; p++) {
            vf_store(to + p * phase_stride + i, vf_zero());
            for (uint32_t k = i; k < i + VW && k * n + p < count; k++) memcpy(to + p * phase_stride + k, from + k * n + p, sizeof *to);
        }
    }
}

/* The other way round. */
VINL void es_merge_row(const void* phases, size_t phase_stride, uint32_t count, uint32_t n, void* words)
{
    const float* from = phases;
    float* to = words;
    const uint32_t columns = (count + n - 1) / n;
    for (uint32_t i = 0; i < columns; i += VW) {
        if (n == VW && i * n + VW * VW <= count) {
            vf v[VW];
            for (uint32_t k = 0; k < VW; k++) v[k] = vf_load(from + k * phase_stride + i);
            vf_transpose8(v);
            for (uint32_t k = 0; k < VW; k++) vf_store(to + (i + k) * n, v[k]);
            continue;
        }
        for (uint32_t p = 0; p < n; p++)
            for (uint32_t k = i; k < i + VW && k * n + p < count; k++) memcpy(to + k * n + p, from + p * phase_stride + k, sizeof *to);
    }
}

#endif
