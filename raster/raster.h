/* Earthshine, floor 1: pixels.
 *
 * Triangles in; visibility, depth and G-buffers out. A tile-binned, multithreaded rasterizer draws into a visibility buffer
 * (triangle id + reversed float depth), from which surface attributes are resolved once per visible pixel.
 *
 * Coordinates: world is right-handed, y up; the eye looks along -z; pixel (0, 0) is the top left, its centre at (0.5, 0.5).
 * Front faces are counter-clockwise seen from outside (the winding turns round with a mirroring transform, as in glTF).
 * Visibility is decided in 24.8 fixed point with the top-left rule: an edge shared by two triangles draws each pixel once.
 */
#ifndef EARTHSHINE_RASTER_H
#define EARTHSHINE_RASTER_H

#include <earthshine/platform.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A view is at most this wide and high: with the guard band at ±8192 pixels from its centre, 32-bit edge functions cannot
 * overflow inside a 64-pixel tile (the proof is in raster/limits.h). */
enum { ES_RASTER_MAX_SIZE = 8192, ES_TEXTURE_MAX_LEVELS = 15, ES_TEXTURE_MAX_SIZE = 16384 };

/* ---- textures --------------------------------------------------------------------------------------------------------------- */

typedef enum es_wrap { ES_WRAP_REPEAT, ES_WRAP_CLAMP, ES_WRAP_MIRROR } es_wrap;
typedef enum es_filter { ES_FILTER_LINEAR, ES_FILTER_NEAREST } es_filter;
typedef enum es_mip_filter { ES_MIP_LINEAR, ES_MIP_NEAREST, ES_MIP_NONE } es_mip_filter;

/* Linear RGBA, 16 bit per channel unsigned normalised (sRGB is decoded when the texture is made: 16 bits keep every 8-bit
 * sRGB step apart), with its mip chain: level l is max(1, size >> l), box-filtered in linear space. */
typedef struct es_texture_image {
    uint32_t width, height, level_count;
    uint32_t level_offset[ES_TEXTURE_MAX_LEVELS]; /* in texels from `texels` */
    uint16_t* texels;                             /* 4 per texel, 64-byte aligned */
    size_t bytes;
} es_texture_image;

/* rgba: 8-bit samples, top row first; `srgb` decodes R, G and B. */
ES_API es_result es_texture_image_create(es_context* context, uint32_t width, uint32_t height, const uint8_t* rgba, bool srgb, es_texture_image* image);
/* Linear values, clamped to [0, 1]; 1, 2, 3 or 4 channels. */
ES_API es_result es_texture_image_from_float(es_context* context, const es_image* source, es_texture_image* image);
ES_API void es_texture_image_destroy(es_context* context, es_texture_image* image);

/* How a material uses a texture; image NULL: not used (factor 1). uv' = matrix * (u, v) + offset (KHR_texture_transform). */
typedef struct es_texture_use {
    const es_texture_image* image;
    es_wrap wrap_u, wrap_v;
    es_filter magnify, minify;
    es_mip_filter mip;
    uint32_t uv_set;         /* 0 or 1 */
    float matrix[4];         /* m00 m01 m10 m11; all zero counts as the identity */
    float offset[2];
} es_texture_use;

/* ---- materials ----------------------------------------------------------------------------------------------------------------- */

typedef enum es_surface_model {
    ES_SURFACE_METALLIC_ROUGHNESS, /* Lambert + GGX (glTF 2.0) */
    ES_SURFACE_PHONG,              /* Lambert + normalised Phong lobe: `specular` is its albedo, `exponent` 1 … 50 */
    ES_SURFACE_UNLIT               /* shows its base colour, takes and gives no light (KHR_materials_unlit) */
} es_surface_model;

typedef struct es_material_desc {
    es_surface_model model;
    float base_color[4];      /* linear; alpha is used by `alpha_mask` and `blend` only; default 1 1 1 1 */
    float metallic;           /* 0 … 1; default 0 */
    float roughness;          /* 0 … 1; default 1 */
    float specular;           /* METALLIC_ROUGHNESS: weight of the dielectric Fresnel term, 0 is Lambert; PHONG: lobe albedo; 0 … 1; default 1 */
    /* METALLIC_ROUGHNESS: share of what the diffuse part does not reflect but lets through, in the base colour, 0 … 1; metals do not. The light goes through the thing as through glass of
     * that index of refraction (KHR_materials_transmission, KHR_materials_ior). Only a renderer's camera sees so (es_renderer_settings.reflections), and the reference's; light that meets the
     * surface on its way takes it as solid, with what is left of its diffuse part, and its interface reflects as that of index 1.5 does, by `specular`. */
    float transmission;       /* default 0 */
    float ior;                /* 1 … 5; 0: 1.5, the default */
    float exponent;           /* PHONG only, 1 … 50; default 20 */
    float emission[3];        /* radiance, W/(m² sr) */
    float normal_scale;       /* default 1 */
    bool alpha_mask;          /* fragments with alpha < alpha_cutoff are not drawn */
    float alpha_cutoff;       /* default 0.5 */
    /* What is behind shows through: C = alpha · this + (1 - alpha) · behind, alpha being that of base colour × texture × vertex colour, cut to 0 … 1. Only a renderer's
     * camera and the reference's see it so (es_renderer_settings.blend_layers); whatever is drawn here, and light that meets the surface on its way, take it as
     * if it had alpha_mask: it casts shadows and sends light on where alpha is alpha_cutoff or more, and elsewhere is not there. */
    bool blend;
    bool double_sided;
    es_texture_use base_color_texture;          /* rgb * base_color, alpha for `alpha_mask` and `blend` */
    es_texture_use metallic_roughness_texture;  /* g roughness, b metallic */
    es_texture_use normal_texture;              /* tangent space, rgb * 2 - 1 */
    es_texture_use emission_texture;
    es_texture_use specular_texture;            /* a specular weight */
} es_material_desc;

ES_API es_material_desc es_default_material_desc(void);

/* ---- what is drawn ----------------------------------------------------------------------------------------------------------------- */

/* Vertex streams are records of four floats, 16-byte aligned, padded to a multiple of eight vertices. Not owned. */
typedef struct es_raster_mesh {
    const float* positions;           /* x y z 1 */
    const float* previous_positions;  /* last frame's, NULL: the same as positions */
    const float* rest_positions;      /* as the mesh was made, before anything deformed it; NULL: the same as positions. Not drawn */
    const float* normals;             /* x y z 0, need not be unit; NULL: geometric normals */
    const float* tangents;            /* x y z, w = ±1 handedness; NULL: derived from uv derivatives where a normal map needs them */
    const float* uvs;                 /* u0 v0 u1 v1; NULL: zero */
    const float* colors;              /* linear r g b a, multiplied into the base colour; NULL: white */
    const uint32_t* indices;          /* three per triangle, all < vertex_count; four more bytes must be readable past the end */
    uint32_t vertex_count, triangle_count;
    es_vec3 bounds_min, bounds_max;   /* of positions (and previous_positions) */
    uint64_t revision;                /* differs whenever positions differ, in this mesh or from another mesh */
    uint64_t rest_revision;           /* differs whenever the pose at rest or the triangles differ, likewise; 0: unknown, who needs it compares them. Not drawn */
} es_raster_mesh;

typedef struct es_raster_instance {
    const es_raster_mesh* mesh;
    uint32_t material;                /* index into es_draw_list.materials, < 65536 */
    uint32_t id;                      /* written to the G-buffer; below 2^32 - 1 */
    es_mat4 transform, previous_transform; /* object to world, affine */
    float point_weight;               /* how densely points stand for it where a scene becomes points, against others; 0: 1, negative: not at all. Not drawn */
} es_raster_instance;

typedef struct es_draw_list {
    const es_raster_instance* instances;
    const es_material_desc* materials;
    uint32_t instance_count, material_count;
} es_draw_list;

typedef enum es_cull { ES_CULL_BACK, ES_CULL_FRONT, ES_CULL_NONE } es_cull;

typedef struct es_raster_view {
    uint32_t width, height;                 /* 1 … ES_RASTER_MAX_SIZE */
    es_mat4 view, projection;               /* world to eye, eye to clip (reversed depth) */
    es_mat4 previous_view, previous_projection; /* for motion; equal to the above when nothing moved */
    es_cull cull;                           /* ES_CULL_BACK spares double-sided materials; FRONT draws them too */
} es_raster_view;

/* Perspective view with the far plane at infinity, or orthographic; both reversed depth. previous_* are set equal. */
ES_API es_raster_view es_perspective_view(uint32_t width, uint32_t height, es_vec3 eye, es_vec3 direction, es_vec3 up, float fov_y, float near_plane);
ES_API es_raster_view es_orthographic_view(uint32_t width, uint32_t height, es_vec3 eye, es_vec3 direction, es_vec3 up, float half_width, float half_height, float near_plane, float far_plane);
/* The six faces +x -x +y -y +z -z of a cube of size² pixels around `eye`, 90° each. */
ES_API void es_cube_views(uint32_t size, es_vec3 eye, float near_plane, es_raster_view faces[6]);

/* ---- G-buffer -------------------------------------------------------------------------------------------------------------------------- */

/* Attributes of the visible surface per pixel, one plane each, rows of `stride` pixels (a multiple of eight, padding
 * undefined). 40 bytes a pixel with ALL planes. Where nothing is seen, depth is 0 and the other planes are 0. */
typedef enum es_gbuffer_plane {
    ES_GBUFFER_DEPTH = 1 << 0,            /* float: distance along the view axis, metres */
    ES_GBUFFER_NORMAL = 1 << 1,           /* world shading normal (normal map applied), octahedral, two signed 16-bit: x low */
    ES_GBUFFER_GEOMETRIC_NORMAL = 1 << 2, /* of the triangle, turned to the eye; same encoding */
    ES_GBUFFER_ALBEDO = 1 << 3,           /* albedo_rg: r low, g high; albedo_b: b low, material index high; unsigned 16-bit linear */
    ES_GBUFFER_SURFACE = 1 << 4,          /* metallic | roughness << 8 | specular << 16 | es_surface_model << 24; PHONG: byte 1 is exponent * 5 */
    ES_GBUFFER_EMISSION = 1 << 5,         /* shared-exponent RGB9E5 */
    ES_GBUFFER_MOTION = 1 << 6,           /* two floats: pixel position now minus last frame's (Knecht §3.5.1), x then y plane; 65536 each where it was behind the eye */
    ES_GBUFFER_INSTANCE = 1 << 7,         /* instance id + 1 */
    ES_GBUFFER_TRIANGLE = 1 << 8,         /* triangle index in its mesh + 1 */
    ES_GBUFFER_ALL = (1 << 9) - 1,
    ES_GBUFFER_ALPHA = 1 << 9             /* float: the material's alpha, 0 … 1, of blended surfaces or not; for layers of blended ones, not among ALL */
} es_gbuffer_plane;

typedef struct es_gbuffer {
    uint32_t width, height, stride;
    uint32_t planes;                       /* which exist; the others are NULL and not computed */
    float* depth;
    uint32_t *normal, *geometric_normal, *albedo_rg, *albedo_b, *surface, *emission, *instance, *triangle;
    float *motion_x, *motion_y, *alpha;
    void* memory;
    size_t memory_bytes;
} es_gbuffer;

ES_API es_result es_gbuffer_create(es_context* context, uint32_t width, uint32_t height, uint32_t planes, es_gbuffer* gbuffer);
ES_API void es_gbuffer_destroy(es_context* context, es_gbuffer* gbuffer);

/* ---- drawing ------------------------------------------------------------------------------------------------------------------------------ */

typedef struct es_raster_stats {
    uint64_t instances, instances_culled;     /* outside the view */
    uint64_t triangles;                       /* of the instances drawn */
    uint64_t triangles_culled;                /* facing away, zero area, outside, or between pixel centres */
    uint64_t triangles_clipped;               /* against the near plane or the guard band */
    uint64_t tile_triangles, tile_triangles_hidden; /* (triangle, tile) pairs binned; of these behind the tile's depth */
    uint64_t pixels;                          /* covered at the end */
} es_raster_stats;

/* Scratch memory of a drawing thread of control (transformed vertices, bins), reused between calls. */
typedef struct es_rasterizer es_rasterizer;
ES_API es_result es_rasterizer_create(es_context* context, es_rasterizer** rasterizer);
ES_API void es_rasterizer_destroy(es_rasterizer* rasterizer);

/* Draws everything in the list; gbuffer's size must equal the view's. Alpha masks are applied. stats may be NULL. */
ES_API es_result es_draw_gbuffer(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, es_gbuffer* gbuffer, es_raster_stats* stats);
/* What of a scene is drawn, pixel by pixel, by depth: rows of `stride` floats (a multiple of eight, >= width), reversed depth as es_draw_depth and `drawn` give it for
 * the same view. Depth peeling (Everitt 2001): the next layer is what is behind the `drawn` of the one before. */
typedef struct es_depth_range {
    const float* behind;      /* strictly farther than this: nothing where it is 0; NULL: anything */
    const float* before;      /* strictly nearer than this: anything where it is 0; NULL: anything */
    float* drawn;             /* out, none of the above: 0 where nothing was; NULL: not wanted */
    uint32_t stride;
} es_depth_range;
ES_API es_result es_draw_gbuffer_between(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, const es_depth_range* range, es_gbuffer* gbuffer, es_raster_stats* stats);
/* Depth only: reversed depth in [0, 1], 0 where nothing is, rows of `stride` floats (a multiple of eight, >= width). */
ES_API es_result es_draw_depth(es_rasterizer* rasterizer, const es_draw_list* list, const es_raster_view* view, float* depth, uint32_t stride, es_raster_stats* stats);

#ifdef __cplusplus
}
#endif
#endif
