#include "gi/view_importance.h"

#include <string.h>

#include "gi/surface.h"
#include "raster/pack.h"

void es_receivers_collect(es_receivers* receivers, const es_gbuffer* gbuffer, const es_pixel_rays* rays, float softening)
{
    memset(receivers, 0, sizeof *receivers);
    receivers->softening = softening;
    uint32_t n = 0;
    for (uint32_t j = 0; j < ES_RECEIVER_GRID; j++)
        for (uint32_t i = 0; i < ES_RECEIVER_GRID; i++) {
            uint32_t x = (2 * i + 1) * gbuffer->width / (2 * ES_RECEIVER_GRID), y = (2 * j + 1) * gbuffer->height / (2 * ES_RECEIVER_GRID);
            size_t at = (size_t)y * gbuffer->stride + x;
            if (!(gbuffer->depth[at] > 0.0f)) continue;
            es_surface surface = es_surface_of_gbuffer(gbuffer->albedo_rg[at], gbuffer->albedo_b[at], gbuffer->surface[at]);
            es_vec3 reflected = es_v3_add(surface.albedo, surface.specular);
            es_vec3 position = es_pixel_rays_position(rays, (float)x, (float)y, gbuffer->depth[at]), normal = es_unpack_normal(gbuffer->normal[at]);
            receivers->x[n] = position.x;
            receivers->y[n] = position.y;
            receivers->z[n] = position.z;
            receivers->nx[n] = normal.x;
            receivers->ny[n] = normal.y;
            receivers->nz[n] = normal.z;
            receivers->weight[n++] = 0.2126f * reflected.x + 0.7152f * reflected.y + 0.0722f * reflected.z;
        }
    receivers->count = (n + 7) / 8 * 8;
}
