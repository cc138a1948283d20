/* Lobes whose reflection is edited (gi/edit/edit.h): the eye's mirror direction r shows what the edited direction e would have shown. So light from l counts in the lobe as if
 * it came from where the shortest arc from e to r takes l, while what the diffuse part receives, and every shadow, stay as they are (Ritschel thesis §7.6.1). */
#ifndef EARTHSHINE_GI_EDITED_LOBE_SIMD_H
#define EARTHSHINE_GI_EDITED_LOBE_SIMD_H

#include "gi/kernels/surface_simd.h"

/* x as the rotation by the shortest arc that takes `from` to `to` (unit both) takes it; with from = -to as their plane mirrors it. */
VINL void es_turn_v(const vf from[3], const vf to[3], vf x[3])
{
    const vf c = from[0] * to[0] + from[1] * to[1] + from[2] * to[2];
    const vf sum[3] = {from[0] + to[0], from[1] + to[1], from[2] + to[2]};
    const vf a = (sum[0] * x[0] + sum[1] * x[1] + sum[2] * x[2]) / vf_max(vf_set1(1.0f) + c, vf_set1(1e-4f));
    const vf b = vf_set1(2.0f) * (from[0] * x[0] + from[1] * x[1] + from[2] * x[2]);
    for (int k = 0; k < 3; k++) x[k] = x[k] - a * sum[k] + b * to[k];
}

/* In place of es_surface_parts_v's lobe where e is not (0, 0, 0). l: unit, to the light. The caller multiplies by the cosine at the true l: what is returned makes it
 * that of the turned one. */
static __attribute__((noinline, unused)) void es_edited_lobe_v(const es_surface_v* s, const vf n[3], const vf l[3], const vf v[3], const vf e[3], vf lobe[3])
{
    const vf nv = vf_set1(2.0f) * (n[0] * v[0] + n[1] * v[1] + n[2] * v[2]), zero = vf_zero();
    const vm edited = vm_gt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2], zero);
    vf r[3], turned[3], pass, moved[3];
    for (int k = 0; k < 3; k++) {
        r[k] = nv * n[k] - v[k];
        turned[k] = l[k];
    }
    es_turn_v(e, r, turned);
    es_surface_parts_v(s, n[0], n[1], n[2], turned[0], turned[1], turned[2], v[0], v[1], v[2], &pass, moved);
    const vf cosine = vf_max(n[0] * l[0] + n[1] * l[1] + n[2] * l[2], vf_set1(1e-3f)), now = vf_max(n[0] * turned[0] + n[1] * turned[1] + n[2] * turned[2], zero);
    for (int k = 0; k < 3; k++) lobe[k] = vf_select(edited, moved[k] * (now / cosine), lobe[k]);
}

#endif
