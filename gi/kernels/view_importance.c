/* Root mean square over the receivers of weight · cos · cos / (d² + softening) (gi/view_importance.h). Most groups of eight
 * receivers, neighbours in the picture, lie behind a sender or turn away from it as one, and end at the branch. */
#include "gi/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_gi_view_importance)(const es_receivers* receivers, const es_sender* senders, uint32_t count, float* result)
{
    const vf zero = vf_zero(), softening = vf_set1(receivers->softening), tiny = vf_set1(receivers->softening * 0x1p-24f + 0x1p-100f);
    for (uint32_t i = 0; i < count; i++) {
        const es_sender* s = &senders[i];
        const vf ox = vf_set1(s->position[0]), oy = vf_set1(s->position[1]), oz = vf_set1(s->position[2]);
        const vf nx = vf_set1(s->normal[0]), ny = vf_set1(s->normal[1]), nz = vf_set1(s->normal[2]);
        vf sum = zero;
        for (uint32_t k = 0; k < receivers->count; k += VW) {
            vf dx = vf_load(receivers->x + k) - ox, dy = vf_load(receivers->y + k) - oy, dz = vf_load(receivers->z + k) - oz;
            vf sent = dx * nx + dy * ny + dz * nz;
            vf received = vf_neg(dx * vf_load(receivers->nx + k) + dy * vf_load(receivers->ny + k) + dz * vf_load(receivers->nz + k));
            vm lit = vm_gt(sent, zero) & vm_gt(received, zero);
            if (!vm_any(lit)) continue;
            vf d2 = dx * dx + dy * dy + dz * dz;
            vf c = vf_and(lit, vf_load(receivers->weight + k) * (sent * received) / (vf_max(d2, tiny) * (d2 + softening)));
            sum = sum + c * c;
        }
        result[i] = __builtin_sqrtf(vf_sum(sum) / (float)(receivers->count ? receivers->count : 1));
    }
}
