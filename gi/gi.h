/* Earthshine, floor 3: light.
 *
 * Lights one frame of a world: G-buffer, shadow maps, virtual point lights with imperfect shadow maps, interleaved shading,
 * geometry-aware filter, tone mapping. A frame plan decides which passes run and writes down why the others were skipped.
 */
#ifndef EARTHSHINE_GI_H
#define EARTHSHINE_GI_H

#include <earthshine/platform.h>
#include <earthshine/raster.h>
#include <earthshine/sim.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum es_gi_method {
    ES_GI_NONE,     /* direct light only */
    ES_GI_ISM,      /* virtual point lights, imperfect shadow maps (Ritschel thesis §5.2) */
    ES_GI_CLASSIC   /* the same lights, an accurate shadow map each: the thesis' own reference; slow */
} es_gi_method;

typedef enum es_tone_map { ES_TONE_MAP_REINHARD, ES_TONE_MAP_PBR_NEUTRAL, ES_TONE_MAP_LINEAR } es_tone_map;

/* All of them by name through es_renderer_settings_set; `earthshine settings` prints names, ranges and defaults. */
typedef struct es_renderer_settings {
    uint32_t width, height;          /* pixels */
    uint32_t method;                 /* es_gi_method */
    bool skip;                       /* skip work whose result would be the same bits */
    /* direct light */
    uint32_t shadow_size;            /* texels of a shadow map's side */
    float shadow_bias;               /* constant part, texels */
    float shadow_slope_bias;         /* slope-scaled part, texels */
    uint32_t shadow_filter;          /* percentage-closer filter: taps per side, 1 … 7 */
    /* virtual point lights */
    uint32_t vpls;                   /* per frame, over all lights */
    uint32_t light_size;             /* texels of the light G-buffer's side, a power of two */
    uint32_t seed;                   /* of the sample sets */
    float geometry_bound;            /* 1/m²: cos cos / d² of a pair is cut off here (Knecht eq. 4.7 with 1/bound = d²min) */
    float spread;                    /* how far a light's own area softens it close by: 0 a point, 1 a disc of that area */
    bool view_importance;            /* more lights where they matter for what the camera sees */
    float lobe_roughness;            /* lobes sharper than this GGX roughness are widened to it under virtual point lights */
    bool glossy_vpls;                /* VPLs emit their surface's glossy lobe too (Knecht §3.4.3) */
    /* imperfect shadow maps */
    uint32_t ism_size;               /* texels of a side: 32, 64, 128, 256 */
    uint32_t ism_points;             /* per map */
    uint32_t ism_pool;               /* points that represent the scene */
    bool pull_push;
    float pull_threshold;            /* share of the scene's extent (thesis: 0.05) */
    float push_threshold;
    uint32_t pull_push_levels;       /* thesis: 2 */
    float ism_bias;                  /* share of the scene's extent */
    float ism_slope_bias;            /* share of the scene's extent, over the cosine at the pixel; about the width of a splat */
    uint32_t classic_size;           /* texels of a classic map's side */
    /* interleaved shading and filter */
    uint32_t interleave;             /* n of the n × n pattern, 1 … 16 */
    uint32_t filter_passes;          /* 0: none; 1: a box, in which single bright pixels leave n × n blocks; 2: a tent, which is smooth */
    float filter_depth;              /* largest relative depth difference (Knecht: 0.01) */
    float filter_normal;             /* smallest dot product of normals (Knecht: 0.8) */
    /* display */
    uint32_t tone_map;               /* es_tone_map */
    float exposure;                  /* stops */
    float white;                     /* REINHARD: radiance times exposure that is shown as white */
    uint32_t bounces;                /* 0: none; 1: one indirect bounce */
} es_renderer_settings;

ES_API es_renderer_settings es_default_renderer_settings(void);
ES_API size_t es_renderer_setting_count(void);
ES_API const es_setting* es_renderer_setting(size_t index);
ES_API es_result es_renderer_settings_set(es_context* context, es_renderer_settings* settings, const char* name, const char* value);

typedef struct es_renderer es_renderer;

/* settings NULL: defaults. SETTING_VALUE when one is outside its range. */
ES_API es_result es_renderer_create(es_context* context, const es_renderer_settings* settings, es_renderer** renderer);
ES_API void es_renderer_destroy(es_renderer* renderer);
/* Takes effect with the next frame; changed sizes reallocate. */
ES_API es_result es_renderer_configure(es_renderer* renderer, const es_renderer_settings* settings);
ES_API es_renderer_settings es_renderer_get_settings(const es_renderer* renderer);

/* Lights the world as its active camera sees it now. A world without a camera is refused (WRONG_STATE); without geometry or light it is black. */
ES_API es_result es_renderer_render(es_renderer* renderer, es_world* world);

/* ---- results ------------------------------------------------------------------------------------------------------------------- */

ES_API size_t es_image_name_count(void);
ES_API const char* es_image_name(size_t index);         /* "display" first: what a window shows */
ES_API const char* es_image_description(size_t index);
/* A copy of one image of the last frame as plain floats, made on request; the caller destroys it. IMAGE_UNKNOWN names the nearest. */
ES_API es_result es_renderer_image(es_renderer* renderer, const char* name, es_image* image);
/* The displayed image as 0x00RRGGBB, width × height words, top row first; valid until the next call on the renderer. */
ES_API const uint32_t* es_renderer_display(es_renderer* renderer, uint32_t* width, uint32_t* height);

typedef struct es_pass_stats {
    const char* name;
    double milliseconds;
    const char* skipped;      /* NULL: it ran; otherwise why it did not */
    uint64_t count;           /* what `unit` says, e.g. triangles, virtual point lights, points */
    const char* unit;
} es_pass_stats;
typedef struct es_frame_stats {
    uint64_t frame;           /* frames rendered before this one */
    double milliseconds;
    const es_pass_stats* passes;
    size_t pass_count;
    es_raster_stats raster;   /* of the camera's G-buffer */
} es_frame_stats;
ES_API const es_frame_stats* es_renderer_stats(const es_renderer* renderer);

typedef struct es_vpl {
    es_vec3 position, normal;
    float flux[3];            /* radiant exitance × area share: intensity along the normal is flux / pi, W/sr */
} es_vpl;
/* Virtual point lights of the last frame, for overlays. */
ES_API size_t es_renderer_vpls(const es_renderer* renderer, es_vpl* vpls, size_t capacity);
/* World positions of the points one imperfect shadow map is drawn from, 3 floats each. */
ES_API size_t es_renderer_points(const es_renderer* renderer, uint32_t map, float* positions, size_t capacity);

#ifdef __cplusplus
}
#endif
#endif
