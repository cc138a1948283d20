/* Linear-blend skinning (glTF 2.0 §3.7.3.3), morphing (§3.7.2.2) and bounds, eight vertices at a time.
 *
 * Ranges: the linear part of a joint's matrix is within 1e8, positions and translations within 1e9 before morphing and 1e15 after, so
 * positions stay below 1e25 and finite. A normal's length before it is made unit lies in 1e-30 … 1e37, or it counts as none. */
#include "platform/simd.h"
#include "sim/kernel_table.h"

typedef struct v3 { vf x, y, z; } v3;

/* a made unit, or `other` where it has no direction; scaled by its largest component first, so that squares neither overflow nor vanish */
static inline v3 unit_or(v3 a, v3 other)
{
    vf largest = vf_max(vf_abs(a.x), vf_max(vf_abs(a.y), vf_abs(a.z)));
    vm good = vm_ge(largest, vf_set1(1e-30f)) & vm_le(largest, vf_set1(1e37f));
    vf inverse = vf_set1(1.0f) / vf_select(good, largest, vf_set1(1.0f));
    vf x = vf_and(good, a.x) * inverse, y = vf_and(good, a.y) * inverse, z = vf_and(good, a.z) * inverse;
    vf length = vf_sqrt(vf_select(good, x * x + y * y + z * z, vf_set1(1.0f)));
    vf unit = vf_set1(1.0f) / length;
    return (v3){vf_select(good, x * unit, other.x), vf_select(good, y * unit, other.y), vf_select(good, z * unit, other.z)};
}

void ES_KERNEL(es_sim_skin)(const es_skin_job* job, uint32_t begin, uint32_t end)
{
    const es_skin_weights* weights = job->weights;
    for (uint32_t block = begin; block < end; block++) {
        vf m[ES_JOINT_FLOATS];
        for (int k = 0; k < ES_JOINT_FLOATS; k++) m[k] = vf_zero();
        for (size_t row = weights->first_row[block]; row < weights->first_row[block + 1]; row++) {
            vi joint = vi_load(weights->joints + row * VW);
            vf weight = vf_load(weights->weights + row * VW);
            for (int k = 0; k < ES_JOINT_FLOATS; k += 4) {
                vf a, b, c, d;
                vf_gather4(job->palette + k, ES_JOINT_FLOATS * sizeof(float), joint, &a, &b, &c, &d);
                m[k] = m[k] + weight * a;
                m[k + 1] = m[k + 1] + weight * b;
                m[k + 2] = m[k + 2] + weight * c;
                m[k + 3] = m[k + 3] + weight * d;
            }
        }
        const size_t at = (size_t)block * 4 * VW;
        v3 v;
        vf w;
        vf_load4(job->from[ES_STREAM_POSITIONS] + at, &v.x, &v.y, &v.z, &w);
        vf_store4(job->to[ES_STREAM_POSITIONS] + at, (m[0] * v.x + m[1] * v.y) + (m[2] * v.z + m[3]), (m[4] * v.x + m[5] * v.y) + (m[6] * v.z + m[7]),
            (m[8] * v.x + m[9] * v.y) + (m[10] * v.z + m[11]), w);
        if (job->to[ES_STREAM_NORMALS]) { /* by the cofactors: right for every scale, mirrored included */
            vf_load4(job->from[ES_STREAM_NORMALS] + at, &v.x, &v.y, &v.z, &w);
            vf x = ((m[5] * m[10] - m[6] * m[9]) * v.x + (m[6] * m[8] - m[4] * m[10]) * v.y) + (m[4] * m[9] - m[5] * m[8]) * v.z;
            vf y = ((m[2] * m[9] - m[1] * m[10]) * v.x + (m[0] * m[10] - m[2] * m[8]) * v.y) + (m[1] * m[8] - m[0] * m[9]) * v.z;
            vf z = ((m[1] * m[6] - m[2] * m[5]) * v.x + (m[2] * m[4] - m[0] * m[6]) * v.y) + (m[0] * m[5] - m[1] * m[4]) * v.z;
            v3 n = unit_or((v3){x, y, z}, v);
            vf_store4(job->to[ES_STREAM_NORMALS] + at, n.x, n.y, n.z, w);
        }
        if (job->to[ES_STREAM_TANGENTS]) {
            vf_load4(job->from[ES_STREAM_TANGENTS] + at, &v.x, &v.y, &v.z, &w);
            v3 t = unit_or((v3){(m[0] * v.x + m[1] * v.y) + m[2] * v.z, (m[4] * v.x + m[5] * v.y) + m[6] * v.z, (m[8] * v.x + m[9] * v.y) + m[10] * v.z}, v);
            vf_store4(job->to[ES_STREAM_TANGENTS] + at, t.x, t.y, t.z, w);
        }
    }
}

void ES_KERNEL(es_sim_morph)(float* vertices, const float* displacement, float weight, uint32_t begin, uint32_t end)
{
    const vf s = vf_set1(weight);
    for (size_t i = (size_t)begin * 4 * VW; i < (size_t)end * 4 * VW; i += VW) vf_store(vertices + i, vf_load(vertices + i) + s * vf_load(displacement + i));
}

void ES_KERNEL(es_sim_unit)(float* directions, const float* otherwise, uint32_t begin, uint32_t end)
{
    for (uint32_t block = begin; block < end; block++) {
        const size_t at = (size_t)block * 4 * VW;
        v3 a, b;
        vf w, ignored;
        vf_load4(otherwise + at, &b.x, &b.y, &b.z, &ignored);
        vf_load4(directions + at, &a.x, &a.y, &a.z, &w);
        v3 u = unit_or(a, b);
        vf_store4(directions + at, u.x, u.y, u.z, w);
    }
}

void ES_KERNEL(es_sim_bounds)(const float* positions, uint32_t begin, uint32_t end, float* bounds)
{
    vf low[3], high[3];
    for (uint32_t block = begin; block < end; block++) {
        vf p[3], w;
        vf_load4(positions + (size_t)block * 4 * VW, &p[0], &p[1], &p[2], &w);
        for (int k = 0; k < 3; k++) {
            low[k] = block == begin ? p[k] : vf_min(low[k], p[k]);
            high[k] = block == begin ? p[k] : vf_max(high[k], p[k]);
        }
    }
    for (int k = 0; k < 3; k++) {
        float least = low[k][0], most = high[k][0];
        for (int lane = 1; lane < VW; lane++) {
            least = low[k][lane] < least ? low[k][lane] : least;
            most = high[k][lane] > most ? high[k][lane] : most;
        }
        bounds[k] = least;
        bounds[4 + k] = most;
    }
}
