/* Virtual point lights: what the passes between the light's G-buffer and the shaded pixel hand on. */
#ifndef EARTHSHINE_GI_VPL_H
#define EARTHSHINE_GI_VPL_H

#include "gi/gi.h"

/* One light of the set. It receives `power` from `incident` and sends power * f(incident, w) * cos into direction w,
 * f being the surface model at the point (gi/surface.h); for a Lambert surface that is flux / pi * cos. */
typedef struct es_vpl_record {
    float position[3];
    float normal[3], tangent[3], bitangent[3]; /* right-handed unit frame, tangent × bitangent = normal */
    float flux[3];       /* albedo × power: the diffuse part, W */
    float power[3];      /* incoming, W */
    float incident[3];   /* unit, from the point towards where the light came from */
    float specular_color[3]; /* Fresnel reflectance at normal incidence (GGX), lobe albedo (Phong) */
    float area;          /* m² of surface that the light stands for */
    float roughness;     /* GGX roughness; Phong: exponent */
    uint32_t model;      /* es_surface_model */
    bool glossy;         /* has a lobe besides the diffuse part worth evaluating */
    bool parallel;       /* infinitely far away: sends along the normal, flux / pi is its irradiance on what faces it, W/m²; the position is where depths of its map begin */
} es_vpl_record;

#endif
