/* One layer over those that are farther away (gi/blend.h). Alpha and transmittance are 0 … 1; pixels that the layer does not cover are left as they are, whatever
 * its images hold there. */
#include "gi/blend.h"
#include "gi/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_gi_blend)(const es_blend_job* job, uint32_t row_begin, uint32_t row_end)
{
    for (uint32_t y = row_begin; y < row_end; y++)
        for (uint32_t x = 0; x < job->columns; x += VW) {
            const size_t at = (size_t)y * job->stride + x;
            const vf alpha = vf_load(job->alpha + at);
            const vm covered = vm_gt(alpha, vf_zero());
            if (!vm_any(covered)) continue;
            const vf t = vf_load(job->transmittance + at), weight = t * alpha;
            for (int k = 0; k < 3 && job->layer[0]; k++) vf_store(job->sum[k] + at, vf_load(job->sum[k] + at) + vf_and(covered, weight * vf_load(job->layer[k] + at)));
            if (job->through) vf_store(job->transmittance + at, t * (vf_set1(1.0f) - vf_and(covered, alpha)));
        }
}
