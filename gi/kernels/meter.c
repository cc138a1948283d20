/* Sums of a picture's rows for the light meter (gi/meter.h): radiance of any value in, finite sums out. */
#include "gi/kernel_table.h"
#include "platform/simd_maths.h"

/* 0 where `a` is no number, infinite or negative: asked of its bits, as comparing what is no number is an invalid operation */
VINL vf bounded(vf a)
{
    const vi bits = vi_from_bits(a);
    a = vf_and(vi_gt(bits, vi_zero()) & vi_lt(bits, vi_set1(0x7f800000)), a);
    return vf_min(a, vf_set1(ES_METER_MOST));
}

void ES_KERNEL(es_gi_meter)(const es_meter_job* job, uint32_t row_begin, uint32_t row_end)
{
    const vf least = vf_set1(ES_METER_LEAST);
    for (uint32_t y = row_begin; y < row_end; y++) {
        vf sum = vf_zero(), log_sum = vf_zero();
        for (uint32_t x = 0; x < job->width; x += VW) {
            const size_t at = (size_t)y * job->stride + x;
            vf l = vf_set1(0.2126f) * bounded(vf_load(job->radiance[0] + at)) + vf_set1(0.7152f) * bounded(vf_load(job->radiance[1] + at)) + vf_set1(0.0722f) * bounded(vf_load(job->radiance[2] + at));
            vf log_l = vf_log2(vf_max(l, least));
            if (x + VW > job->width) {
                const vm inside = vm_lt(vf_iota(), vf_set1((float)(job->width - x)));
                l = vf_and(inside, l);
                log_l = vf_and(inside, log_l);
            }
            sum = sum + l;
            log_sum = log_sum + log_l;
        }
        job->rows[y] = (es_meter_row){vf_sum(sum), vf_sum(log_sum)};
    }
}
