/* Further bounces at the points of a forest from a photon map (Ritschel thesis §6.4.4, after Jensen 1996).
 *
 * Photons leave the spot, point and directional lights, and with `emission` the glowing surfaces, and are traced through the triangles, scattered by
 * the surface model and ended by Russian roulette. Each place where one lands after having met a surface before is put down to the leaf nearest to it
 * of those that stand for that surface. The estimate of the density is that of a level's samples, as the push has it (gi/micro/point_level.h): the power
 * that fell near a sample over the area that its leaves stand for, both weighted by distance and normal. So surfaces are not darker
 * along their borders and in corners, as estimates over discs are. */
#ifndef EARTHSHINE_GI_MICRO_PHOTON_MAP_H
#define EARTHSHINE_GI_MICRO_PHOTON_MAP_H

#include "gi/micro/point_level.h"
#include "gi/reference/scene.h"

/* Of a level, samples are so many that each has about so many photons of the first bounce, if they fall evenly. */
enum { ES_PHOTONS_PER_SAMPLE = 32 };

typedef struct es_photon_job {
    const es_trace_scene* scene;   /* of the draw list that the forest stands for */
    uint32_t photons;              /* emitted: by the lights, and as many again by glowing surfaces where there are any; up to 2^24 */
    uint32_t bounces;              /* surfaces that a photon meets before the last place where it is put down; at least 1 */
    uint32_t seed;
    bool emission;                 /* the scene has been taken with it */
    const es_lobe_albedo* lobes;   /* filled */
} es_photon_job;

typedef struct es_photon_stats { uint64_t emitted, stored, rays; } es_photon_stats;

/* Adds to the radiance of all leaves what they reflect of light that has met 1 … bounces surfaces before. Light that comes from lights itself
 * is es_points_light_direct's; of glowing surfaces it is added here, with `emission`. It depends on the world and its lights alone, not on any view:
 * while they rest, so does the result. Of any number of threads it is the same. stats may be NULL. */
es_result es_points_light_photons(es_context* context, es_arena* arena, es_point_forest* forest, const es_photon_job* job, es_photon_stats* stats);

#endif
