/* Bit budgets of the fixed-point rasterizer, and the proofs that nothing overflows.
 *
 * Window coordinates are signed 24.8 fixed point relative to the centre of the view. Views are at most 8192 pixels wide, so
 * pixels lie within ±4096; vertices are clipped to the guard band of ±8192 pixels:
 *
 *   |x|, |y|                  <= 8192 * 256               = 2^21
 *   |A|, |B| (differences)    <= 2 * 2^21                 = 2^22
 *   A * (p - x)               <= 2^22 * 2^22              = 2^44   twice the area, edge constants: int64 or exact in double
 *
 * An edge function at pixel centres, E(px, py) = A * px * 256 + B * py * 256 + C, keeps its sign when it is divided by 256 and
 * floored: A * px + B * py + floor((C + bias) / 256) >= 0 exactly where E + bias >= 0, with bias 0 on top and left edges and
 * -1 on the others. Inside a 64-pixel tile the varying part is
 *
 *   |A * px + B * py|         <= 2^22 * (63 + 63)         < 2^29
 *
 * so the constant can be clamped to ±2^30 without changing any sign, and everything stays below 2^30 + 2^29 < 2^31.
 *
 * Small triangles (at most 32 by 64 pixels) are kept in 16 bits relative to the first pixel centre they may cover; that pixel
 * is moved into the view, by at most the triangle's own size:
 *
 *   |x| <= 32 * 256 + 255 < 2^14,  |y| <= 64 * 256 + 255 < 2^15;   |A| <= 2^14,  |B| <= 2^13
 *   |A * x + B * y|           <= 2^28 + 2^28              < 2^31
 */
#ifndef EARTHSHINE_RASTER_LIMITS_H
#define EARTHSHINE_RASTER_LIMITS_H

enum {
    ES_SUBPIXEL_BITS = 8,
    ES_SUBPIXELS = 1 << ES_SUBPIXEL_BITS,
    ES_GUARD_BAND = 8192,                      /* pixels either side of the view's centre */
    ES_SNAPPED_MAX = ES_GUARD_BAND * ES_SUBPIXELS,
    ES_EDGE_CONSTANT_MAX = 1 << 30,

    ES_TILE_BITS = 6,
    ES_TILE_SIZE = 1 << ES_TILE_BITS,
    ES_TILE_PITCH = ES_TILE_SIZE + 8,          /* a row of eight lanes may begin in the last column: what it writes past the tile is not read */
    ES_TILE_WORDS = ES_TILE_PITCH * ES_TILE_SIZE,
    ES_TILE_FRONT = 16,                        /* words readable before a tile's numbers */
    ES_TILE_VISIBLE_MAX = ES_TILE_SIZE * ES_TILE_SIZE + 8, /* as many triangles as pixels, slot 0 for none, eight at a time */

    ES_SMALL_WIDTH = 32 * ES_SUBPIXELS,        /* extents up to which a triangle is drawn in columns of eight pixels, row by row */
    ES_SMALL_HEIGHT = 64 * ES_SUBPIXELS,

    ES_CHUNK_BITS = 10,                        /* a triangle's id: chunk in the view << 10 | triangle in the chunk */
    ES_CHUNK_TRIANGLES = 1 << ES_CHUNK_BITS,
    ES_CHUNKS_MAX = 1 << (32 - ES_CHUNK_BITS),

    ES_CLIP_VERTICES_MAX = 3 + 5,              /* the near plane and four guard planes add at most one vertex each */
    ES_CLIP_PIECES_MAX = ES_CLIP_VERTICES_MAX - 2,
};

/* Homogeneous window coordinates beyond this drop their triangles: products of three of them still fit a float. */
#define ES_HOMOGENEOUS_MAX 1099511627776.0f /* 2^40 */

_Static_assert((long long)ES_SNAPPED_MAX * 2 * (2 * (ES_TILE_SIZE - 1)) < (1ll << 29), "varying part of an edge function");
_Static_assert((1ll << 29) <= ES_EDGE_CONSTANT_MAX && (1ll << 29) + ES_EDGE_CONSTANT_MAX < (1ll << 31), "edge functions fit 32 bits");
_Static_assert(ES_SMALL_HEIGHT + ES_SUBPIXELS <= 32767 && ES_SMALL_WIDTH + ES_SUBPIXELS <= 32767, "small triangles fit 16 bits");
_Static_assert(2ll * (ES_SMALL_HEIGHT + 255) * (ES_SMALL_WIDTH + 255) * 2 < (1ll << 31), "small triangles' edge constants fit 32 bits");

#endif
