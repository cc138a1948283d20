/* Virtual point lights of a further bounce, from those of the bounce before: the lights that are reflected, or senders.
 *
 * Of S senders and N lights to make, light j reflects the senders j, j + N, j + 2N, … where there are fewer lights than senders, and a
 * share of sender j mod S where there are more. So a light keeps its senders over the frames, and with senders that stay on their surfaces,
 * and numbers that do not change, it stays where it is.
 *
 * Places that it may take, of all its senders together, are numbered i; w_i is the luminance of what arrives there times what the surface
 * reflects. It takes one with probability p_i = w_i / W, W being the sum, and what arrives there over p_i becomes its power: right on average
 * whatever the weights, where Knecht (§3.6.1) takes the largest and loses the others (§6.1).
 *
 * ONE_PASS (Knecht §3.6): the places are points of the scene, each of which stands for an area a. A sender of intensity I(d), W/sr, gives one of them
 *     I(d) · cos / r² · a · V,      V by the sender's shadow map, as for a pixel, or by a ray.
 * A parallel sender of irradiance E (es_vpl_record.parallel) gives it E · cos · a · V. It is one of ONE_PASS alone.
 * Every sender has its own set of points, stratified over the scene. Maps of few texels let light through walls, and each bounce would pass
 * on what the one before lost that way. So maps only say where to look: a place they hide keeps a small share of its weight, some places are drawn by
 * these weights, q_i, rays find which of them are seen, and one of those is taken. It has
 *     f_i / q_i · seen / drawn,
 * which is right on average whatever the map says, and has a variance near that of exact weights: two stages, as in resampled importance sampling
 * (Talbot et al. 2005).
 *
 * REFLECTIVE (Ritschel thesis §5.3.1): the places are texels of a parabolic map about the sender into which points are drawn, keys of
 * depth and point, the nearest winning; holes and points that shine through are filled from coarser levels, by pull-push of the keys. A
 * texel receives I(d) times its solid angle,
 *     dΩ = 4 / (1 + u² + v²)² · (2 / size)²,
 * so that all light that leaves the sender and meets something is there, at the price of drawing what is mostly not taken. */
#ifndef EARTHSHINE_GI_BOUNCES_H
#define EARTHSHINE_GI_BOUNCES_H

#include "gi/ism.h"
#include "gi/surfels.h"
#include "gi/vpl_visibility.h"

enum { ES_BOUNCE_MAX_RAYS = 64 };

typedef struct es_bounce_job {
    uint32_t method;                    /* es_bounce_method */
    es_vpl_record* vpls;                /* lights from `first` on */
    const es_vpl_record* senders;       /* [first_sender, first_sender + sender_count); the same array, or another */
    uint32_t first_sender, sender_count;
    uint32_t first, count;              /* lights to make */
    uint32_t bounce, seed, subsets;     /* subsets: of the interleaved pattern, each of which shall be a good sample set */
    const es_scene_points* points;
    const es_surfels* surfels;
    const es_ism_maps* maps;            /* the senders', by their place among the lights; NULL: rays or, without a scene, everything is seen */
    const es_trace_scene* scene;        /* for rays; NULL: none */
    const es_vec3* ends;                /* with a scene: es_vpl_visibility.ends of the senders */
    float extent, near_distance, bias, slope_bias; /* metres */
    uint32_t rays;                      /* with maps and a scene: places tried by rays for each light */
    float lobe_roughness;
    bool glossy;                        /* lights send their surface's lobe too */
    /* REFLECTIVE */
    uint32_t size;                      /* of the maps, a multiple of 32 */
    uint32_t levels;                    /* of pull-push, 0 … 4 */
    float push_threshold;               /* share of the extent */
} es_bounce_job;

/* Fills records first … first + count; those that found no place send nothing. */
es_result es_bounce_lights(es_context* context, const es_bounce_job* job);

/* ---- between bounces.c and its kernels ---------------------------------------------------------------------------------- */

typedef struct es_bounce_sender {
    float position[3], normal[3], tangent[3], bitangent[3];
    float color[3];                     /* flux / pi, W/sr */
    float power[3], incident[3], specular_color[3], roughness; /* used when glossy */
    uint32_t model;
    bool glossy, parallel;
    const uint16_t* map;                /* NULL: everything is seen */
    float doubt;                        /* share of its weight that a place has which the map hides */
    uint32_t map_size;
    float far_distance, bias, slope_bias;
    float near_distance;                /* closer points count as so far, and are not drawn */
    bool backs;                         /* single-sided surfaces reflect behind, too */
} es_bounce_sender;

typedef struct es_reflective_map {
    uint32_t size, levels;
    uint32_t push;                      /* of the finest level, in units of depth (raster/points.h) */
    uint32_t* keys;                     /* size²; depth << 16 | point, all ones where nothing is */
    uint32_t* scratch;                  /* size² / 2 */
} es_reflective_map;

#endif
