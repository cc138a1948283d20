/* What flows from one stage of the rasterizer to the next.
 *
 *   instances.c   draw list, view        -> instances in view, their matrices; chunks of up to 1024 triangles
 *   vertex.c      positions              -> snapped and homogeneous vertices         (parallel over vertex blocks)
 *   bin.c         indices, snapped       -> triangle records, lists of them per tile (parallel over chunks; clip.c where needed)
 *   bins.c        lists per chunk        -> segments ordered by tile                 (serial, one entry per chunk and tile)
 *   tile.c        segments               -> depth and record number of one tile      (parallel over tiles)
 *   resolve.c     depth and number       -> G-buffer planes of the tile, while it is in cache
 *
 * A larger depth wins; among equal depths the record drawn first. The order in a tile is fixed: large, small, masked; then by chunk;
 * then as binned. It does not depend on the instruction set or on threads.
 */
#ifndef EARTHSHINE_RASTER_STAGES_H
#define EARTHSHINE_RASTER_STAGES_H

#include "raster/limits.h"
#include "raster/raster.h"

/* Window x * w and y * w in pixels from the view's centre, y down; z; w. */
typedef struct es_window_vertex { float xw, yw, z, w; } es_window_vertex;

/* x, y in 24.8 fixed point from the view's centre; valid only without NEAR, GUARD and BAD. */
typedef struct es_snapped_vertex { int32_t x, y; float depth; uint32_t flags; } es_snapped_vertex;

enum {
    ES_OUT_LEFT = 1, ES_OUT_RIGHT = 2, ES_OUT_TOP = 4, ES_OUT_BOTTOM = 8, ES_OUT_FAR = 16,
    ES_OUT_NEAR = 32,   /* z > w, or w not positive */
    ES_OUT_GUARD = 64,  /* outside the guard band */
    ES_OUT_BAD = 128,   /* not finite, or beyond ES_HOMOGENEOUS_MAX */
    ES_OUT_REJECT = ES_OUT_LEFT | ES_OUT_RIGHT | ES_OUT_TOP | ES_OUT_BOTTOM | ES_OUT_FAR | ES_OUT_NEAR, /* in all three: not visible */
    ES_OUT_CLIP = ES_OUT_NEAR | ES_OUT_GUARD
};

/* Object to window, row by row: row r is (m[4r] … m[4r+3]) · (x, y, z, 1). */
typedef struct es_window_matrix { float m[16]; } es_window_matrix;

typedef struct es_prepared_texture {
    const es_texture_image* image;  /* NULL: not used */
    float matrix[4], offset[2];
    uint32_t uv_set, wrap_u, wrap_v, magnify, minify, mip;
} es_prepared_texture;

enum { ES_TEXTURE_BASE_COLOR, ES_TEXTURE_METALLIC_ROUGHNESS, ES_TEXTURE_NORMAL, ES_TEXTURE_EMISSION, ES_TEXTURE_SPECULAR, ES_TEXTURE_COUNT };

typedef struct es_prepared_material {
    float base_color[4], metallic, roughness, specular, exponent, emission[3], normal_scale, alpha_cutoff;
    uint32_t model, surface_word, emission_word;  /* the packed planes when no texture changes them */
    bool any_texture, alpha_mask, double_sided;
    es_prepared_texture textures[ES_TEXTURE_COUNT];
} es_prepared_material;

typedef struct es_prepared_instance {
    const es_raster_mesh* mesh;
    const es_prepared_material* material;
    uint32_t material_index, instance_id, first_id, chunk_count;
    uint32_t first_vertex, first_delta;  /* in the view's vertex arrays */
    es_window_matrix window;             /* object to window */
    es_window_matrix previous_window;    /* last frame's, when deltas are stored */
    float motion[12];                    /* rows x, y, w of (previous window) * window^-1 - 1, for rigid motion */
    float normal_matrix[9];              /* row-major, to world; any scale */
    float world[12];                     /* rows of object to world */
    bool mirrored;
    bool moving;                         /* a transform changed */
    bool has_deltas;                     /* vertices move, or the transform is singular: per-vertex deltas are stored */
    bool cull_positive, cull_negative;   /* by the sign of the window area, y down */
} es_prepared_instance;

/* Drawn row by row. Coordinates relative to the centre of pixel (px, py), the first that may be covered; positive area. */
typedef struct es_small_triangle { int16_t x0, y0, x1, y1, x2, y2; uint16_t px, py; uint32_t id; float z0, z1, z2; } es_small_triangle;
/* Drawn block by block. Coordinates from the view's centre; positive area. */
typedef struct es_large_triangle { int32_t x0, y0, x1, y1, x2, y2; float z0, z1, z2; uint32_t id, unused[2]; } es_large_triangle;
_Static_assert(sizeof(es_small_triangle) == 32 && sizeof(es_large_triangle) == 48, "records are gathered 16 bytes at a time");

/* Tiles of a record: first and last column and row. */
typedef struct es_tile_rect { uint8_t x0, y0, x1, y1; } es_tile_rect;

/* Binning of one chunk; the kernel appends, the caller provides room for the worst case. */
typedef struct es_bin_job {
    const es_snapped_vertex* vertices;
    const uint32_t* indices;            /* of the chunk's first triangle */
    const es_prepared_instance* instance;
    uint32_t count, first_id;
    uint32_t width, height;
    bool all_large;                     /* alpha-masked materials have one kind of record */
    es_small_triangle* small;
    es_tile_rect* small_rects;
    uint32_t small_count;
    es_large_triangle* large;
    es_tile_rect* large_rects;
    uint32_t large_count;
    uint32_t culled, clipped;
} es_bin_job;

/* Opaque large triangles come first in a tile: they are what hides others. */
enum { ES_RECORDS_LARGE, ES_RECORDS_SMALL, ES_RECORDS_MASKED, ES_RECORD_KINDS };

/* Records of one chunk, kind and tile. */
typedef struct es_segment {
    const uint32_t* list;               /* indices of records */
    const void* records;
    uint32_t count;
    uint32_t key;                       /* tile * ES_RECORD_KINDS + kind */
} es_segment;

typedef struct es_chunk {
    uint32_t instance, first_triangle, triangle_count;
    const es_segment* segments;
    uint32_t segment_count;
} es_chunk;

/* One tile being drawn: depth 0 and number 0 where nothing is. Records are numbered from 1 as they are drawn. */
typedef struct es_tile {
    float* depth;                       /* ES_TILE_WORDS each */
    uint32_t* number;                   /* NULL: depth only; otherwise ES_TILE_FRONT words before it can be read */
    uint32_t* triangle_ids;             /* by number; eight words more than there are records */
    uint32_t next_number;
    const float* ceiling;               /* NULL: none; otherwise ES_TILE_WORDS: what is not strictly farther is not drawn */
    float* block_minimum;               /* of the 8x8 blocks' depth, or less: 64 */
    int32_t x, y;                       /* pixel of the tile's first column and row */
    uint32_t width, height;             /* of the view */
    uint64_t hidden;
    const es_chunk* chunks;             /* for alpha masks */
    const es_prepared_instance* instances;
} es_tile;

/* A visible triangle of a tile: planes over the pixel's offset (X, Y) from a pixel where the triangle is seen, each x * X + y * Y + c.
 * Perspective: `distance` is 1 / w and the others are divided by w too; orthographic: all are as they are. */
typedef struct es_plane { float x, y, c; } es_plane;
typedef struct es_visible_triangle {
    es_plane distance;   float pixel_x;      /* the pixel, from the view's centre */
    float distance_low, distance_high, pixel_y; uint32_t instance; /* index | ES_VISIBLE_… */
    es_plane normal_x;   uint32_t geometric_normal;
    es_plane normal_y;   uint32_t triangle;  /* + 1 */
    es_plane normal_z;   uint32_t instance_id; /* + 1 */
    es_plane red;        uint32_t surface;
    es_plane green;      uint32_t emission;
    es_plane blue;       uint32_t material;  /* << 16 */
} es_visible_triangle;
_Static_assert(sizeof(es_visible_triangle) == 128, "visible triangles are gathered 16 bytes at a time");
enum { ES_VISIBLE_COMPLEX = 1 << 31, ES_VISIBLE_MOVING = 1 << 30, ES_VISIBLE_INSTANCE = ES_VISIBLE_MOVING - 1 };

/* Motion of a surface that was not in front of last frame's eye: its place then lies outside any view. */
#define ES_MOTION_BEHIND 65536.0f

/* What resolving needs beside the tile. */
typedef struct es_resolve_job {
    const es_prepared_instance* instances;
    const uint32_t* chunk_instance;     /* per chunk */
    const es_window_vertex* vertices;
    const es_window_vertex* deltas;     /* last frame's minus this frame's; where has_deltas */
    bool orthographic;
    float row_x[4], row_y[4], row_z[4], row_w[4]; /* world to window */
    float distance_scale, distance_offset;        /* orthographic: distance = offset + scale * z */
    float z_scale, z_offset;                      /* z = offset + scale * distance */
    es_gbuffer gbuffer;
    es_visible_triangle* visible;                 /* ES_TILE_VISIBLE_MAX */
    uint32_t* slot;                               /* by number: 1 + index in `visible`, 0 between tiles */
    uint32_t* slot_number;                        /* ES_TILE_VISIBLE_MAX: the inverse, and the pixel where it was seen first */
    uint32_t* slot_pixel;
    uint64_t pixels;
} es_resolve_job;

/* Appends the visible pieces of a triangle that crosses the near plane or the guard band (clip.c). */
void es_clip_triangle(es_bin_job* job, uint32_t triangle);
/* The large record of a triangle given by snapped vertices, unless culled; false when culled. */
bool es_append_large(es_bin_job* job, const es_snapped_vertex* a, const es_snapped_vertex* b, const es_snapped_vertex* c, uint32_t id);

#endif
