/* Further bounces at the points of a forest by radiosity (Ritschel thesis §6.4.3). */
#ifndef EARTHSHINE_GI_MICRO_RADIOSITY_H
#define EARTHSHINE_GI_MICRO_RADIOSITY_H

#include "gi/micro/micro.h"
#include "gi/micro/point_level.h"

typedef struct es_radiosity_job {
    uint32_t level;                /* gathered at about 2^level leaves */
    uint32_t iterations;           /* each adds a bounce; 0: nothing changes */
    es_micro_settings micro;
    uint32_t seed;                 /* of the micro-buffers' turns */
    const es_lobe_albedo* lobes;   /* filled */
} es_radiosity_job;

/* Jacobi's iteration, from the radiance that the leaves have, L_0:
 *     L_i = L_0 + albedo / pi · E(L_{i-1}),
 * E(L) being the irradiance from all that sends L: gathered at a level by micro-buffers, and pushed down from there. After n iterations L_n holds
 * what has met up to n + 1 surfaces if L_0 is what es_points_light_direct sets; with more of them it comes to what never ends. It is a function of L_0
 * alone: as long as that stays, so may the result. Only leaves hold it; es_forest_pull is for the caller to call once more. stats: of all
 * iterations, may be NULL. */
es_result es_points_light_radiosity(es_context* context, es_arena* arena, es_point_forest* forest, const es_radiosity_job* job, es_micro_stats* stats);

#endif
