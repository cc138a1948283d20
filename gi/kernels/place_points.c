/* World positions of points kept as triangle index and barycentric coordinates: p = M (a + u (b - a) + v (c - a)). */
#include "gi/kernel_table.h"
#include "platform/simd.h"

void ES_KERNEL(es_gi_place_points)(const es_raster_mesh* mesh, const es_mat4* transform, const uint32_t* triangle, const uint32_t* barycentric, uint32_t count, float* x, float* y, float* z)
{
    const float* m = transform->m;
    for (uint32_t i = 0; i < count; i += VW) {
        uint32_t n = count - i < VW ? count - i : VW;
        /* the last vector repeats lane 0's triangle in its unused lanes */
        uint32_t t[VW], uv[VW];
        for (uint32_t k = 0; k < VW; k++) {
            t[k] = triangle[i + (k < n ? k : 0)];
            uv[k] = barycentric[i + (k < n ? k : 0)];
        }
        vi packed = vi_load(uv), ia, ib, ic, unused;
        vf u = vf_from_int(packed & vi_set1(0xffff)) * vf_set1(1.0f / 65535.0f);
        vf v = vf_from_int(vi_shift_right_logical(packed, 16)) * vf_set1(1.0f / 65535.0f);
        vf ax, ay, az, bx, by, bz, cx, cy, cz, w;
        vi_gather4(mesh->indices, 12, vi_load(t), &ia, &ib, &ic, &unused);
        vf_gather4(mesh->positions, 16, ia, &ax, &ay, &az, &w);
        vf_gather4(mesh->positions, 16, ib, &bx, &by, &bz, &w);
        vf_gather4(mesh->positions, 16, ic, &cx, &cy, &cz, &w);
        vf px = ax + u * (bx - ax) + v * (cx - ax);
        vf py = ay + u * (by - ay) + v * (cy - ay);
        vf pz = az + u * (bz - az) + v * (cz - az);
        vf wx = px * vf_set1(m[0]) + py * vf_set1(m[4]) + pz * vf_set1(m[8]) + vf_set1(m[12]);
        vf wy = px * vf_set1(m[1]) + py * vf_set1(m[5]) + pz * vf_set1(m[9]) + vf_set1(m[13]);
        vf wz = px * vf_set1(m[2]) + py * vf_set1(m[6]) + pz * vf_set1(m[10]) + vf_set1(m[14]);
        if (n == VW) {
            vf_store(x + i, wx);
            vf_store(y + i, wy);
            vf_store(z + i, wz);
        } else {
            for (uint32_t k = 0; k < n; k++) {
                x[i + k] = wx[k];
                y[i + k] = wy[k];
                z[i + k] = wz[k];
            }
        }
    }
}
