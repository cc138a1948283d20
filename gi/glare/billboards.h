/* Glare the cheap way (Ritschel thesis fig. 8.10, after Kakimoto et al. 2004): the spectrum is added round bright places alone.
 *
 * The picture is looked at in tiles of ES_GLARE_TILE² pixels. Of a pixel whose luminance is above the threshold, what is above it may spread: the share that the
 * spectrum sends to other pixels. The tiles with most of that have one spectrum each, about their brightest pixel, for what all of theirs give away; light that
 * would leave the picture stays at that pixel. So every channel's sum is kept. Large lights have no softer needles than small ones, which convolution gives them. Pixels
 * that are no number, infinite or negative are as with gi/glare/convolution.h. */
#ifndef EARTHSHINE_GI_GLARE_BILLBOARDS_H
#define EARTHSHINE_GI_GLARE_BILLBOARDS_H

#include "gi/glare/diffraction.h"

enum { ES_GLARE_TILE = 16, ES_GLARE_MAX_BILLBOARDS = 4096 };

/* What a tile would give away. */
typedef struct es_glare_tile {
    float light[3];            /* above the threshold, summed */
    float luminance;           /* of it */
    float brightest;           /* luminance of the pixel … */
    uint32_t x, y;             /* … which is here; the first of them */
    bool chosen;
} es_glare_tile;

/* Zero-initialised there are none. */
typedef struct es_glare_billboards {
    es_glare_tile* tiles;
    uint32_t* chosen;          /* indices of tiles, in their order */
    uint32_t tile_count, count;
    size_t tile_bytes, chosen_bytes;
} es_glare_billboards;

/* Of a picture of width × height pixels, rows of `stride` floats, at most `most` billboards (up to ES_GLARE_MAX_BILLBOARDS); `threshold` in W/(m² sr), not below 0.
 * from and to may be the same. OUT_OF_MEMORY, MEMORY_CAP. The same bits for any number of threads. */
es_result es_glare_add_billboards(es_context* context, const es_glare_spectrum* spectrum, float threshold, uint32_t most, const float* const from[3], float* const to[3], uint32_t width, uint32_t height, uint32_t stride, es_glare_billboards* billboards);
void es_glare_billboards_free(es_context* context, es_glare_billboards* billboards);

/* ---- what the kernels do ---------------------------------------------------------------------------------------------------------------- */

typedef struct es_glare_billboard {
    uint32_t x, y;
    float light[3];
    float stays[3];            /* what of it would leave the picture */
} es_glare_billboard;

typedef struct es_glare_billboard_job {
    const float* from[3];
    float* to[3];
    uint32_t width, height, stride;
    float threshold;
    es_glare_tile* tiles;
    uint32_t tile_columns;
    const es_glare_spectrum* spectrum;
    const es_glare_billboard* billboards;
    uint32_t count;
} es_glare_billboard_job;

#endif
