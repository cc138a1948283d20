/* Smooth normals (sim/normals.h), eight triangles and then eight vertices at a time.
 *
 * Ranges: differences of vertices are scaled to at most 1, so a cross product is at most 2 per component, a sum over 2^28 triangles at
 * most 2^29 and its square 2^60. Edges of a millionth of the mesh have a product of 1e-12 and a square of 1e-24; below 1e-30 there is no
 * direction left to speak of. */
#include "sim/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_sim_face_normals)(const float* positions, const uint32_t* indices, uint32_t begin, uint32_t end, float scale, float* faces)
{
    const vf s = vf_set1(scale);
    for (uint32_t t = begin; t < end; t += VW) {
        const vi lane = vi_set1((int32_t)t) + vi_iota();
        const vm inside = vi_lt(lane, vi_set1((int32_t)end));
        const vi corner = vi_min(lane, vi_set1((int32_t)end - 1)) * vi_set1(3);
        vf ax, ay, az, bx, by, bz, cx, cy, cz, w;
        vf_gather4(positions, 16, vi_gather(indices, corner), &ax, &ay, &az, &w);
        vf_gather4(positions, 16, vi_gather(indices, corner + vi_set1(1)), &bx, &by, &bz, &w);
        vf_gather4(positions, 16, vi_gather(indices, corner + vi_set1(2)), &cx, &cy, &cz, &w);
        vf ux = (bx - ax) * s, uy = (by - ay) * s, uz = (bz - az) * s;
        vf vx = (cx - ax) * s, vy = (cy - ay) * s, vz = (cz - az) * s;
        vf_store4(faces + 4 * (size_t)t, vf_and(inside, uy * vz - uz * vy), vf_and(inside, uz * vx - ux * vz), vf_and(inside, ux * vy - uy * vx), vf_zero());
    }
}

void ES_KERNEL(es_sim_vertex_normals)(const uint32_t* first_row, const uint32_t* rows, const float* faces, uint32_t begin, uint32_t end, float* normals)
{
    for (uint32_t block = begin; block < end; block++) {
        vf x = vf_zero(), y = vf_zero(), z = vf_zero();
        for (uint32_t row = first_row[block]; row < first_row[block + 1]; row++) {
            vf fx, fy, fz, w;
            vf_gather4(faces, 16, vi_load(rows + (size_t)row * VW), &fx, &fy, &fz, &w);
            x = x + fx;
            y = y + fy;
            z = z + fz;
        }
        vf squared = x * x + y * y + z * z;
        vm good = vm_ge(squared, vf_set1(1e-30f));
        vf inverse = vf_set1(1.0f) / vf_sqrt(vf_select(good, squared, vf_set1(1.0f)));
        vf_store4(normals + (size_t)block * 4 * VW, vf_and(good, x * inverse), vf_select(good, y * inverse, vf_set1(1.0f)), vf_and(good, z * inverse), vf_zero());
    }
}
