/* What of a material's base colour is its diffuse part's, beside what goes through it (es_material_desc.transmission). */
#ifndef EARTHSHINE_RASTER_SOLID_SHARE_H
#define EARTHSHINE_RASTER_SOLID_SHARE_H

#include "raster/raster.h"

/* Of the model's own metallic, whatever its texture says; 0 … 1. */
static inline float es_transmitted_share(const es_material_desc* m)
{
    if (m->model != ES_SURFACE_METALLIC_ROUGHNESS || !(m->transmission > 0.0f)) return 0.0f;
    const float t = m->transmission < 1.0f ? m->transmission : 1.0f, metallic = m->metallic > 0.0f ? m->metallic < 1.0f ? m->metallic : 1.0f : 0.0f;
    return t * (1.0f - metallic);
}
static inline float es_solid_share(const es_material_desc* m) { return 1.0f - es_transmitted_share(m); }
static inline float es_ior_of(const es_material_desc* m) { return m->ior >= 1.0f ? m->ior : 1.5f; }

#endif
