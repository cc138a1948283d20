/* Further bounces at the points of a forest, from virtual point lights (Ritschel thesis §6.4.2, after Keller 1997). */
#ifndef EARTHSHINE_GI_MICRO_POINT_VPLS_H
#define EARTHSHINE_GI_MICRO_POINT_VPLS_H

#include "gi/micro/point_level.h"
#include "gi/shade.h"

/* Adds to the radiance of all leaves what they reflect of the lights: found at a level of about 2^level samples, with the lights' shadow maps and with
 * geometry_bound and spread as for pixels, which keep spots near lights from being bright, and pushed down from there. Lights that stand where light
 * has met its n-th surface bring what a picture gathers as bounce n + 1. Of `lights` what es_shade_at_points takes is used. After es_points_light_direct,
 * before es_forest_pull. */
es_result es_points_light_vpls(es_context* context, es_arena* arena, es_point_forest* forest, const es_shade_job* lights, uint32_t level, const es_lobe_albedo* lobes);

#endif
