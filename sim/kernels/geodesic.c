/* A wave front's step over a mesh (sim/edits/geodesic.h), eight corners of a point at a time.
 *
 * A corner (p, q, r) with distances at q and r has, unfolded, a point source at those distances from them on the other side of q r; where the line from it to p
 * passes between them, its length is a distance of p (Novotni and Klein 2002); that along either edge always is. With q = 0 and r = (L, 0):
 * source (sx, -sy), p (x, y), sx = (L + (dq - dr)(dq + dr) / L) / 2, sy² = (dq - sx)(dq + sx).
 *
 * Ranges (of the header): L in 1e-12 … 4 and |dq - dr| <= L where it counts, so |sx| <= 2 + 1e6, squares below 1e13; lanes that do not count calculate with
 * distances of 0. Products of three lengths stay below 1e8. */
#include "sim/kernel_table.h"
#include "platform/simd.h"

/* The least distance over each lane's corners. */
VINL vf corners_of(const es_geodesic_job* job, uint32_t point)
{
    const vf far = vf_set1(ES_GEODESIC_FAR), zero = vf_zero();
    const float* own = job->points + 4 * (size_t)point;
    const vf px = vf_set1(own[0]), py = vf_set1(own[1]), pz = vf_set1(own[2]);
    vf least = vf_set1(own[3]);
    for (uint32_t row = job->first_row[point]; row < job->first_row[point + 1]; row++) {
        const uint32_t* corners = job->rows + (size_t)row * 2 * VW;
        vf qx, qy, qz, dq, rx, ry, rz, dr;
        vf_gather4(job->points, 16, vi_load(corners), &qx, &qy, &qz, &dq);
        vf_gather4(job->points, 16, vi_load(corners + VW), &rx, &ry, &rz, &dr);
        const vf ax = px - qx, ay = py - qy, az = pz - qz, ex = rx - qx, ey = ry - qy, ez = rz - qz, bx = px - rx, by = py - ry, bz = pz - rz;
        const vf a2 = ax * ax + ay * ay + az * az, e2 = ex * ex + ey * ey + ez * ez, b2 = bx * bx + by * by + bz * bz;
        const vm q_known = vm_lt(dq, far), r_known = vm_lt(dr, far), wide = vm_gt(e2, vf_set1(1e-24f));
        const vf to_q = vf_select(q_known, dq, zero), to_r = vf_select(r_known, dr, zero);
        least = vf_min(least, vf_select(q_known, to_q + vf_sqrt(a2), far));
        least = vf_min(least, vf_select(r_known, to_r + vf_sqrt(b2), far));
        const vf length = vf_sqrt(vf_select(wide, e2, vf_set1(1.0f))), inverse = vf_set1(1.0f) / length;
        const vm counts = wide & q_known & r_known & vm_le(vf_abs(to_q - to_r), length);
        const vf cq = vf_and(counts, to_q), cr = vf_and(counts, to_r);
        const vf nx = ay * ez - az * ey, ny = az * ex - ax * ez, nz = ax * ey - ay * ex;
        const vf x = (ax * ex + ay * ey + az * ez) * inverse, y = vf_sqrt(nx * nx + ny * ny + nz * nz) * inverse;
        const vf sx = vf_set1(0.5f) * (length + (cq - cr) * (cq + cr) * inverse), sy2 = (cq - sx) * (cq + sx);
        const vf sy = vf_sqrt(vf_max(sy2, zero)), height = y + sy, across = sx * y + x * sy, along = x - sx;
        const vm passes = counts & vm_ge(sy2, vf_set1(-1e-5f) * e2) & vm_ge(across, zero) & vm_le(across, length * height);
        least = vf_min(least, vf_select(passes, vf_sqrt(along * along + height * height), far));
    }
    return least;
}

/* Eight points at once, so that what is least among lanes is found by lanes. */
void ES_KERNEL(es_sim_geodesic_front)(const es_geodesic_job* job, uint32_t begin, uint32_t end)
{
    for (uint32_t i = begin; i < end; i += VW) {
        const uint32_t count = end - i < VW ? end - i : VW;
        vf v[VW];
        for (uint32_t k = 0; k < VW; k++) v[k] = corners_of(job, job->list[i + (k < count ? k : 0)]);
        vf_transpose8(v);
        const vf least = vf_min(vf_min(vf_min(v[0], v[1]), vf_min(v[2], v[3])), vf_min(vf_min(v[4], v[5]), vf_min(v[6], v[7])));
        if (count == VW) {
            vf_store(job->results + i, least);
        } else {
            float lanes[VW];
            vf_store(lanes, least);
            for (uint32_t k = 0; k < count; k++) job->results[i + k] = lanes[k];
        }
    }
}
