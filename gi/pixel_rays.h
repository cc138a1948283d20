/* From a pixel and its linear depth back to a world position. */
#ifndef EARTHSHINE_GI_PIXEL_RAYS_H
#define EARTHSHINE_GI_PIXEL_RAYS_H

#include "raster/raster.h"

/* P = (base + X·base_dx + Y·base_dy) + depth · (dir + X·dir_dx + Y·dir_dy) for integer pixel indices X, Y from the top left;
 * the pixel centre is already included. Perspective: base is the eye and its derivatives are 0; orthographic: dir's are 0. */
typedef struct es_pixel_rays {
    float base[3], base_dx[3], base_dy[3];
    float dir[3], dir_dx[3], dir_dy[3];
    float near_depth, far_depth;   /* of what the view shows; perspective: to 3e38 */
    bool orthographic;
    /* what is not seen along such rays, but found by others: planes of rows of `stride` floats. NULL: it is as above */
    const float* found[3];         /* positions */
    const float* along[3];         /* unit: directions of the rays that found them */
    uint32_t stride;
} es_pixel_rays;

es_pixel_rays es_pixel_rays_of_view(const es_raster_view* view);

static inline es_vec3 es_pixel_rays_direction(const es_pixel_rays* r, float x, float y)
{
    if (r->found[0]) {
        const size_t at = (size_t)y * r->stride + (size_t)x;
        return (es_vec3){r->along[0][at], r->along[1][at], r->along[2][at]};
    }
    return (es_vec3){r->dir[0] + x * r->dir_dx[0] + y * r->dir_dy[0], r->dir[1] + x * r->dir_dx[1] + y * r->dir_dy[1], r->dir[2] + x * r->dir_dx[2] + y * r->dir_dy[2]};
}

static inline es_vec3 es_pixel_rays_position(const es_pixel_rays* r, float x, float y, float depth)
{
    if (r->found[0]) {
        const size_t at = (size_t)y * r->stride + (size_t)x;
        return (es_vec3){r->found[0][at], r->found[1][at], r->found[2][at]};
    }
    es_vec3 d = es_pixel_rays_direction(r, x, y);
    return (es_vec3){(r->base[0] + x * r->base_dx[0] + y * r->base_dy[0]) + depth * d.x, (r->base[1] + x * r->base_dx[1] + y * r->base_dy[1]) + depth * d.y,
        (r->base[2] + x * r->base_dx[2] + y * r->base_dy[2]) + depth * d.z};
}

#endif
