/* What bounding leaves out of the light of virtual point lights, found by rays (Kollig and Keller 2004; Novák et al. 2011, §3.1).
 *
 * With T the transport operator, T_b the one that virtual point lights are gathered with and L^ the lights, one bounce is
 *     T T L_e = T_b L^ + (T - T_b) T L_e,
 * L_e being the lamps. The first term is shaded by es_shade. The second is estimated here: from each pixel rays go out by the density of
 * its surface; what they hit is lit by every lamp, and reflects to the pixel with
 *     f f' cos cos' / d² - f~ f~' min(cos cos' / (d² + spread · A / pi), bound),
 * f~ being the surfaces with their lobes widened, or without where shading does without. For Lambertian surfaces and no spread that is
 * the residual max(0, G - bound) of Kollig and Keller, which is zero beyond 1 / √bound; spread and widened lobes reach farther and the
 * difference may have either sign. What arrives at a hit is direct light and known, so their recursion, which would gather the
 * virtual point lights anew at each hit, ends at the first: only bounces beyond the first would need more.
 *
 * A is the area that a light at the hit would stand for, from the density with which lights are placed there (gi/vpl_sampling.h), so
 * that the sum of both terms is right on average over sets of lights, up to the resolution of the lamps' G-buffers. */
#ifndef EARTHSHINE_GI_BIAS_COMPENSATION_H
#define EARTHSHINE_GI_BIAS_COMPENSATION_H

#include "gi/pixel_rays.h"
#include "gi/reference/scene.h"
#include "gi/vpl_sampling.h"
#include "platform/context.h"

typedef struct es_compensation_job {
    const es_gbuffer* gbuffer;     /* depth, both normals, albedo, surface */
    es_pixel_rays rays;
    const es_trace_scene* scene;   /* its lights are those of the views, in the same order */
    const es_light_view* views;
    const es_importance* importances;
    uint32_t view_count;
    uint32_t vpls;                 /* asked for, over all views */
    float spread, geometry_bound, lobe_roughness;
    bool glossy_vpls;              /* lights send their surface's lobe */
    bool pixel_lobes;              /* pixels reflect by their lobe */
    float offset;                  /* as in es_shade_visibility */
    uint32_t samples, seed;
    float* result[3];              /* reflected radiance, W/(m² sr), of either sign; rows of gbuffer->stride */
} es_compensation_job;

/* What arrives from one lamp: direction towards it, W/m² on a surface that faces it. False when nothing does. */
bool es_lamp_reaches(const es_trace_scene* scene, const es_light_state* light, const es_trace_surface* surface, es_vec3* direction, float* strength);

es_result es_compensate_bias(es_context* context, es_arena* arena, const es_compensation_job* job);

#endif
