/* A pixel's patch of surface, for the sums of gi/screen/residual.h: its place, its normal, and how much of it counts. */
#ifndef EARTHSHINE_GI_RESIDUAL_PATCH_SIMD_H
#define EARTHSHINE_GI_RESIDUAL_PATCH_SIMD_H

#include "gi/pixel_rays.h"
#include "platform/maths.h"
#include "platform/simd.h"
#include "raster/pack.h"

/* The radius of a pixel's patch in its widths across the ray, over the cosine that it is seen at: more than half a diagonal. */
#define ES_PATCH_RADIUS 0.75f
/* cos 80 degrees */
#define ES_RESIDUAL_GRAZING 0.173648178f

typedef struct es_patch_v { vf x, y, z, nx, ny, nz, area, radius; } es_patch_v;

/* Area of a pixel that faces the eye at distance 1; orthographic: at any. */
VINL float es_pixel_area(const es_pixel_rays* r)
{
    const float *a = r->orthographic ? r->base_dx : r->dir_dx, *b = r->orthographic ? r->base_dy : r->dir_dy;
    const es_vec3 c = es_v3_cross(es_v3(a[0], a[1], a[2]), es_v3(b[0], b[1], b[2]));
    return es_sqrt(es_v3_dot(c, c));
}

/* Area is dA = depth² da / (n · -d), d being the pixel's ray with depth 1; times the falloff beyond 80 degrees. 0 where `seen` is not set and where the
 * interpolated normal faces away; `back`: towards. */
VINL es_patch_v es_patch_of_pixel_v(const es_pixel_rays* r, float pixel_area, bool back, vf column, vf row, vf depth, vi normal, vm seen)
{
    es_patch_v p;
    const vf dx = vf_set1(r->dir[0]) + column * vf_set1(r->dir_dx[0]) + row * vf_set1(r->dir_dy[0]);
    const vf dy = vf_set1(r->dir[1]) + column * vf_set1(r->dir_dx[1]) + row * vf_set1(r->dir_dy[1]);
    const vf dz = vf_set1(r->dir[2]) + column * vf_set1(r->dir_dx[2]) + row * vf_set1(r->dir_dy[2]);
    depth = vf_and(seen, depth);
    p.x = (vf_set1(r->base[0]) + column * vf_set1(r->base_dx[0]) + row * vf_set1(r->base_dy[0])) + depth * dx;
    p.y = (vf_set1(r->base[1]) + column * vf_set1(r->base_dx[1]) + row * vf_set1(r->base_dy[1])) + depth * dy;
    p.z = (vf_set1(r->base[2]) + column * vf_set1(r->base_dx[2]) + row * vf_set1(r->base_dy[2])) + depth * dz;
    es_unpack_normal_v(normal, &p.nx, &p.ny, &p.nz);
    const vf away = p.nx * dx + p.ny * dy + p.nz * dz, towards = back ? away : vf_neg(away), facing = vf_max(towards, vf_set1(1e-6f));
    const vf grazing = vf_min(facing / (vf_sqrt(dx * dx + dy * dy + dz * dz) * vf_set1(ES_RESIDUAL_GRAZING)), vf_set1(1.0f));
    vf area = vf_set1(pixel_area) / facing * (grazing * grazing);
    /* of a plane seen along its parts at half and at double the distance count at most */
    p.radius = vf_min(vf_set1(ES_PATCH_RADIUS * es_sqrt(pixel_area)) / facing, vf_set1(1.0f));
    if (!r->orthographic) area = area * depth * depth;
    p.radius = p.radius * (r->orthographic ? vf_max(depth, vf_set1(1.0f)) : depth * vf_sqrt(dx * dx + dy * dy + dz * dz));
    p.area = vf_and(seen & vm_gt(towards, vf_zero()), area);
    return p;
}

#endif
