/* Inside of a reference: what has been summed so far. */
#ifndef EARTHSHINE_GI_REFERENCE_REFERENCE_H
#define EARTHSHINE_GI_REFERENCE_REFERENCE_H

#include "gi/reference/path.h"

/* Per pixel and channel. Sums are compensated (Neumaier 1974): a float alone would lose small samples of long runs, and two floats go
 * into a file as they are. */
typedef struct es_film_sum { float sum, lost; } es_film_sum;

/* What all samples of a pixel through its centre share. */
typedef struct es_first_hit { es_hit hit; float direct[3]; } es_first_hit;

/* Images: 0 emission, 1 direct, 2 … bounces + 1 the bounces; squares: the same without emission, then indirect, then radiance. */
struct es_reference {
    es_context* context;
    es_reference_settings settings;
    es_trace_scene scene;
    es_light_emissions emissions;
    es_path_techniques techniques;     /* for tests */
    es_world* world;
    es_world_revisions revisions;
    es_raster_view view;
    es_pixel_rays rays;
    uint32_t width, height, bounces;   /* of the film */
    es_film_sum* sums;                 /* [image][pixel][3] */
    float* squares;                    /* [image][pixel][3], of values over `unit` */
    float unit;                        /* of radiance, a power of two */
    es_first_hit* first_hits;          /* per pixel, while antialias is off and nothing blends: filled before the first sample */
    bool looked;
    uint64_t fingerprint;
    es_reference_stats stats;
    uint64_t resumed_samples;
    bool begun;
};

uint32_t es_reference_image_count(const es_reference* reference);   /* of sums */
uint32_t es_reference_square_count(const es_reference* reference);
/* Mean of an image at a value (pixel × 3 + channel). */
float es_reference_mean(const es_reference* reference, uint32_t image, size_t at);
/* Variance of that mean; infinite before the second sample. */
double es_reference_variance(const es_reference* reference, uint32_t square, size_t at, float mean);
/* As after es_reference_begin: no samples. */
void es_reference_forget(es_reference* reference);
/* Error, time left and whether a limit is reached, into the stats. */
void es_reference_estimate(es_reference* reference);
/* Changes when anything that the samples depend on does. */
uint64_t es_reference_fingerprint(const es_reference* reference);

#endif
