/* The world's environment brought into octahedral maps: what kernels look up, and what sets of lights are drawn from.
 *
 * The square [0, 1]² of a map holds the directions (u, v) = 1/2 + (x, z) / (2 (|x| + |y| + |z|)) where y >= 0 and, below, the same folded outwards
 * over the diamond's edges; every level has a border of one texel that continues it across its edges, so that a lookup between four
 * texels has no seam. Everything is in the world's own directions: rotation and factor are in the texels.
 *
 * From the image to level 0 the overlap of texels is exact in elevation, and summed over many meridians in azimuth: a texel's
 * power, its radiance times its solid angle, is shared out and nothing of it is lost or made (relative error of sums in float). A level is the mean, weighted
 * by solid angle, of four texels of the one below it.
 *
 * For reflection by rough surfaces, levels of radiance averaged over GGX lobes as seen along the normal (N = V = R, weighted by the
 * cosine: Karis 2013, "Real Shading in Unreal Engine 4"), by samples whose width follows their density (Křivánek and Colbert 2008, "Real-time
 * Shading with Filtered Importance Sampling"); what sampling leaves of error in a level's mean over the sphere is divided out. With a sun of 200 times the sky's radiance,
 * 11 degrees wide, levels are off by 4 … 7 % RMS, and between two of them by 12 % (tests/test_environment_map.c).
 *
 * For irradiance a level of it by normal, 32 × 32: nine coefficients of spherical harmonics would be off by up to 9 % of the largest for a small bright
 * source and become negative (Ramamoorthi and Hanrahan 2001); this is off by less than 1 % of it. Its sources are the texels of a coarse level, each as the
 * sum of radiance × solid angle × direction, which is exact for every normal whose horizon does not cut the texel. */
#ifndef EARTHSHINE_GI_ENVIRONMENT_H
#define EARTHSHINE_GI_ENVIRONMENT_H

#include "platform/context.h"
#include "sim/sim.h"

enum {
    ES_ENVIRONMENT_LEVELS = 8,       /* at most, of a pyramid */
    ES_ENVIRONMENT_LOBES = 5,        /* levels of lobes: alpha 1/16, 1/8, 1/4, 1/2, 1 */
    ES_ENVIRONMENT_IRRADIANCE = 32   /* texels along a side */
};

/* Levels of size[level]² texels of four floats, with a border of one: r, g, b, W/(m² sr), and something else. */
typedef struct es_environment_pyramid {
    const float* texels;
    int32_t first[ES_ENVIRONMENT_LEVELS];  /* of a level, in texels, its border's corner */
    float size[ES_ENVIRONMENT_LEVELS];
    uint32_t levels;
} es_environment_pyramid;

/* For gi/kernels/environment_simd.h. */
typedef struct es_environment_lookup {
    es_environment_pyramid lobes;      /* level 0 is radiance, the fourth float its texel's solid angle; further levels see ES_ENVIRONMENT_LOBES */
    es_environment_pyramid irradiance; /* one level, W/m² */
} es_environment_lookup;

typedef struct es_environment_map {
    es_environment_lookup lookup;      /* zero: no environment */
    es_environment_pyramid means;      /* of radiance; the fourth float is the texel's solid angle */
    double power[3];                   /* radiance over the sphere, W/m²: the sum of radiance × solid angle */
    float* memory;
    size_t bytes;
} es_environment_map;

/* What es_world_get_environment gives, made into *map, whose memory is used again where it fits. Zero-initialise it before the first time.
 * OUT_OF_MEMORY, MEMORY_CAP: the map is empty then. */
es_result es_environment_map_build(es_context* context, const es_environment_desc* environment, es_environment_map* map);
void es_environment_map_free(es_context* context, es_environment_map* map);

/* One of a set of lights that stands for the environment: infinitely far away. */
typedef struct es_environment_light {
    es_vec3 direction;      /* unit, towards the light */
    float irradiance[3];    /* W/m² on a surface that faces it */
    float solid_angle;      /* of what it stands for, sr */
} es_environment_light;

/* Writes at most `count` lights and returns how many: none when the map is empty or black. Together they have all of the map's power, each channel by
 * itself (relative error of sums in float): the sphere is cut into connected cells of equal luminance × solid angle, in the order of a Hilbert curve
 * over the octahedral square, and a light stands for a cell, in the mean direction of its luminance. A texel with more than a light's share is one
 * light alone, and the others share the rest. `seed` shifts the cells along the curve: means over seeds see the environment as it is, but
 * for details smaller than a cell. */
uint32_t es_environment_sample(const es_environment_map* map, uint32_t count, uint32_t seed, es_environment_light* out);

/* ---- kernels ------------------------------------------------------------------------------------------------------- */

/* A lobe around +z by directions with a weight each, which add up to 1, and the level of `means` whose texels are as large as what a direction stands for. */
typedef struct es_environment_tap { float direction[3], level, weight; } es_environment_tap;

typedef struct es_environment_lobe_job {
    const es_environment_pyramid* means;
    const es_environment_tap* taps;
    uint32_t tap_count;
    uint32_t size;          /* of the level that is made, a multiple of 8 */
    float* texels;          /* its border's corner */
} es_environment_lobe_job;

/* Of a source: the sum of radiance × solid angle × direction of each channel. */
typedef struct es_environment_source { float moment[3][3]; } es_environment_source;

typedef struct es_environment_irradiance_job {
    const es_environment_source* sources;
    uint32_t source_count;
    uint32_t size;
    float* texels;
} es_environment_irradiance_job;

/* Lookups for whoever is no kernel: `count` directions, a multiple of 8, that need not be unit. */
typedef struct es_environment_question {
    const float *x, *y, *z;
    const float* roughness;     /* 0 … 1, its square is alpha */
    float* radiance[3];
    float* irradiance[3];       /* of a surface with that normal */
    uint32_t count;
} es_environment_question;
void es_environment_ask(const es_context* context, const es_environment_lookup* lookup, const es_environment_question* question);

#endif
