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
    ES_GI_CLASSIC,  /* the same lights, an accurate shadow map each: the thesis' own reference; slow */
    ES_GI_VPL_TRACED, /* the same lights, visibility by rays, every light at every pixel unless traced_interleave: a judge; slower */
    ES_GI_VPL_SAMPLED, /* the same lights, interleaved; of its share of them each pixel chooses one by what it would send and tests it by a ray */
    ES_GI_MICRO,    /* without such lights, but for further bounces where asked for: at every pixel, or one of 4 or 16, light is gathered from a micro-buffer drawn of a hierarchy of points (Ritschel thesis §6) */
    ES_GI_SECOND_ORDER /* lights that nothing shadows, and negative lights for what would not have arrived, all in image space (Cochran and Steele 2007): fast, one matt bounce,
                        * and it leaks: only what the camera sees takes light away, at places that do not depend on what hides what */
} es_gi_method;

/* What the methods with virtual point lights make of the approximations of a pair's light: geometry_bound, spread and lobe_roughness. */
typedef enum es_traced_bias {
    ES_TRACED_BOUNDED,      /* the pair's light has them */
    ES_TRACED_UNBOUNDED,    /* none of them: right on average, spots of any brightness near the lights */
    ES_TRACED_COMPENSATED   /* all of them, and what they leave out found by rays (Kollig and Keller 2004): right on average, without spots */
} es_traced_bias;

/* Where the light of the last frame comes in. */
typedef enum es_temporal_stage {
    ES_TEMPORAL_AFTER_FILTER,  /* smooth light is compared with smooth light */
    ES_TEMPORAL_BEFORE_FILTER  /* as Knecht does (§3.4.1): history keeps the interleaved pattern, and is filtered with the rest */
} es_temporal_stage;

typedef enum es_antialias {
    ES_ANTIALIAS_NONE,        /* pixels are sampled at their centres */
    ES_ANTIALIAS_TEMPORAL,    /* at another place each frame, resolved over frames by motion; still pictures become the mean over all places */
    ES_ANTIALIAS_SUPERSAMPLE  /* the mean over antialias_samples whole pictures, each frame by itself: for stills and recordings */
} es_antialias;

/* Where the lights of a bounce after the first stand. Both have as many lights a bounce as asked for, each of which reflects a share of
 * the lights of the bounce before, and both choose at random, with a probability by what is received and reflected, the power divided by it. */
typedef enum es_bounce_method {
    ES_BOUNCE_ONE_PASS,   /* on one of a few points of the scene that the reflected light's own shadow map says it sees (Knecht §3.6, and what §6.1 asks for),
                           * and rays confirm (bounce_rays): without them, what leaks through imperfect maps grows with each bounce */
    ES_BOUNCE_REFLECTIVE  /* on a texel of an imperfect reflective shadow map drawn for the reflected light (Ritschel thesis §5.3.1); slower, needs no rays */
} es_bounce_method;

enum { ES_MAX_BOUNCES = 16, ES_MAX_COMPENSATION_STEPS = 4 };

/* Direct light of surfaces that glow and of the environment. */
typedef enum es_lamps_method {
    ES_LAMPS_NONE,        /* they light nothing */
    ES_LAMPS_MAPS,        /* by a set of lights with imperfect shadow maps (Ritschel thesis §5.4.3) */
    ES_LAMPS_TRACED,      /* by the same set, a ray for each pair of light and pixel that face each other */
    ES_LAMPS_SCREEN,     /* the environment by directional occlusion in screen space (Ritschel thesis §4.2.1), glowing surfaces as with MAPS */
    ES_LAMPS_AMBIENT      /* the environment by ambient occlusion in screen space: what directional occlusion is to beat; glowing surfaces as with MAPS */
} es_lamps_method;

/* With MICRO: nodes of the point hierarchy. */
typedef enum es_micro_nodes { ES_MICRO_QUANTISED /* 128 bits each (§6.3.1) */, ES_MICRO_FLOAT } es_micro_nodes;

/* With MICRO and several bounces: what lights the points besides the lights themselves. The last bounce is gathered. */
typedef enum es_micro_light {
    ES_MICRO_LIGHT_DIRECT,     /* nothing: one bounce, whatever es_renderer_settings.bounces says */
    ES_MICRO_LIGHT_VPLS,       /* virtual point lights of all bounces but the last (§6.4.2) */
    ES_MICRO_LIGHT_RADIOSITY,  /* gathering at an inner level of the hierarchy, several times (§6.4.3) */
    ES_MICRO_LIGHT_PHOTONS     /* photons from the lights, their density at the points (§6.4.4) */
} es_micro_light;

/* What mirrors and glossy things show of what is around them. */
typedef enum es_reflections_method {
    ES_REFLECTIONS_NONE,  /* lights alone: as highlights of spot, point and directional ones, and of lamps and indirect light through lobes widened to lamp_roughness and lobe_roughness */
    ES_REFLECTIONS_MAPS,  /* a picture: each reflecting thing has a prefiltered cube map of its surroundings (Ritschel thesis §7.5.3), looked up from where rays meet what it shows */
    ES_REFLECTIONS_TRACED /* a picture, found by rays: right where maps do not see, and noisy in lobes */
} es_reflections_method;

/* How light spreads in the eye that looks at the picture. */
typedef enum es_glare_method {
    ES_GLARE_OFF,
    ES_GLARE_CONVOLUTION, /* the picture, convolved with the spectrum of the eye's aperture (Ritschel thesis §8.4.4) */
    ES_GLARE_BILLBOARDS   /* the spectrum, added about the brightest places (fig. 8.10): cheap, and needles of large lights are as sharp as those of points */
} es_glare_method;

typedef enum es_tone_map { ES_TONE_MAP_REINHARD, ES_TONE_MAP_PBR_NEUTRAL, ES_TONE_MAP_LINEAR } es_tone_map;

/* All of them by name through es_renderer_settings_set; `earthshine settings` prints names, ranges and defaults. */
typedef struct es_renderer_settings {
    uint32_t width, height;          /* pixels */
    uint32_t method;                 /* es_gi_method */
    bool skip;                       /* skip work whose result would be the same bits */
    /* direct light */
    uint32_t shadow_size;            /* texels of a shadow map's side */
    float shadow_bias;               /* constant part, texels */
    float shadow_slope_bias;         /* slope-scaled part, shares of the filter's half width */
    uint32_t shadow_filter;          /* percentage-closer filter: taps per side, 1 … 7 */
    /* virtual point lights */
    uint32_t vpls;                   /* per frame, over all lights */
    uint32_t light_size;             /* texels of the light G-buffer's side, a power of two */
    uint32_t seed;                   /* of the sample sets */
    float geometry_bound;            /* cos cos / d² of a pair is cut off here, d as a share of the scene's extent (Knecht eq. 4.7 with 1/bound = d²min) */
    float near_distance;             /* share of the scene's extent: what lights nearer than this would send too much of is found by a ray per pixel, in
                                      * place of geometry_bound and spread, which then do not apply; 0: by the lights alone, as far as those let it; with traced_bias BOUNDED */
    float spread;                    /* how far a light's own area softens it close by: 0 a point, 1 a disc of that area */
    bool view_importance;            /* more lights where they matter for what the camera sees; without effect on stable ones, which no camera moves */
    bool stable_vpls;                /* lights keep their places between frames and follow the surface they sit on (Laine et al. 2007, for anything that moves) */
    float renew;                     /* stable: share of the lights that may be moved elsewhere in one frame */
    float lobe_roughness;            /* lobes sharper than this GGX roughness are widened to it under virtual point lights */
    bool glossy_vpls;                /* VPLs emit their surface's glossy lobe too (Knecht §3.4.3) */
    /* imperfect shadow maps */
    uint32_t ism_size;               /* texels of a side: 32, 64, 128, 256 */
    uint32_t ism_points;             /* per map */
    uint32_t ism_pool;               /* points that represent the scene */
    float ism_detail;                /* 0: points per area are the same everywhere; 1: every object has as many points; es_instance_desc.point_weight comes on top */
    uint32_t ism_kept;               /* MiB for what is kept of the maps of lights that stay where they are, besides the maps; 0: nothing is */
    bool pull_push;
    float pull_threshold;            /* share of the scene's extent (thesis: 0.05) */
    float push_threshold;
    uint32_t pull_push_levels;       /* thesis: 2 */
    float ism_bias;                  /* share of the scene's extent */
    float ism_slope_bias;            /* share of the scene's extent, over the cosine at the pixel; about the width of a splat */
    uint32_t classic_size;           /* texels of a classic map's side */
    /* rays: what makes one approximation exact and leaves the others as they are */
    uint32_t traced_bias;            /* es_traced_bias; with every method that has virtual point lights */
    uint32_t traced_samples;         /* COMPENSATED: rays per pixel */
    bool traced_interleave;          /* VPL_TRACED: interleave and filter_passes apply as they do to the other methods; off: as if 1 and 0 */
    /* interleaved shading and filter */
    uint32_t interleave;             /* n of the n × n pattern, 1 … 16 */
    uint32_t filter_passes;          /* 0: none; 1: a box, in which single bright pixels leave n × n blocks; 2: a tent, which is smooth */
    float filter_depth;              /* largest relative depth difference (Knecht: 0.01) */
    float filter_normal;             /* smallest dot product of normals (Knecht: 0.8) */
    bool half_resolution;            /* but of MICRO: indirect light is shaded and filtered for one pixel of 2 × 2, and interpolated along surfaces for the others */
    /* screen space (Ritschel thesis §4) */
    uint32_t screen_samples;         /* places that each pixel looks at around it */
    uint32_t screen_sets;            /* n of n × n patterns of such places, which a filter of that size brings together */
    float screen_radius;             /* how far away they are at the most, share of the scene's extent */
    uint32_t screen_layers;          /* surfaces behind one another that each pixel knows of, 1 … 4: front faces at odd places, back faces at even ones (§4.3.2) */
    uint32_t screen_cameras;         /* additional ones, 0 … 4, about the camera, of half its resolution (§4.3.3) */
    uint32_t screen_repair;          /* places between a pixel and each light that its shadow map lets through, for what the map's depth bias leaves out (§4.5.1), and imperfect maps' (§4.5.2); 0: none */
    float screen_repair_least;       /* how far from the pixel those places reach at least, share of the scene's extent: point lights' shadows in screen space (fig. 4.6); 0: as far as the bias does; of lights of imperfect maps it is not asked */
    bool screen_bounce;              /* light that surfaces within the radius send each other: what geometry_bound leaves out, then with spread 0; with NONE all; not with MICRO */
    /* blended surfaces (es_material_desc.blend) */
    uint32_t blend_layers;           /* 0 … 4: so many of them in front of each pixel's solid surface are peeled (Everitt 2001), lit as it is by direct light, lamps and virtual
                                      * point lights or micro-buffers, and composited; of more than that the nearest count. 0: they are drawn as masked, as light meets them
                                      * with any setting. Of surfaces at the very same depth one is seen; the side turned to the eye is lit. What screen space and rays find
                                      * besides (screen_*, compensation_*, COMPENSATED) they are not lit by, and images of surfaces (depth, normal, motion …) show what is behind */
    /* reflections: at pixels that reflect they take the place of what lobes reflect of lamps and of indirect light; highlights of lights without a size stay */
    uint32_t reflections;            /* es_reflections_method */
    float reflection_roughness;      /* surfaces whose lobe is at most so wide reflect, 0 … 1 */
    uint32_t reflection_maps;        /* MAPS: things that have one, at most; those that look largest from the camera, by their bounds. Others reflect as with NONE */
    uint32_t reflection_size;        /* MAPS: texels of a face's side, a power of two */
    uint32_t reflection_rays;        /* TRACED: for each pixel whose lobe is no mirror's */
    bool reflection_edits;           /* the world's edits of reflections (es_world_edits) count, frozen ones among them; off: everything reflects as the law says */
    /* temporal coherence (gi/temporal.h; Knecht §3.5): indirect light is blended with last frame's, found again by its motion */
    bool temporal;
    uint32_t temporal_stage;         /* es_temporal_stage */
    float temporal_base;             /* eq. 3.4: confidence where nothing changes (§5.2: 0.9) */
    float temporal_position;         /* eq. 3.1: weight of movement, in shares of the picture and of the scene's extent */
    float temporal_normal;           /* eq. 3.2: weight of 1 - n · n_prev */
    float temporal_illumination;     /* eq. 3.3: weight of the cubed difference of the light a white surface would show at the exposure */
    float temporal_depth_threshold;  /* disocclusion: largest relative difference of depth from where the surface was */
    float temporal_normal_threshold; /* disocclusion: smallest dot product with last frame's normal */
    float temporal_clamp;            /* last frame's light is kept within the neighbours' of this one, widened by this share; 0: it is not clamped */
    float temporal_reset_low;        /* share by which the light of a tile may differ from its history's before the confidence falls … */
    float temporal_reset_high;       /* … and from which on history is not used; 0: tiles are not compared */
    uint32_t temporal_settle;        /* frames without a change after which a picture is settled: history is no longer used, and nothing is left to do */
    /* anti-aliasing */
    uint32_t antialias;              /* es_antialias */
    uint32_t antialias_samples;      /* places inside a pixel, over frames (TEMPORAL) or in each (SUPERSAMPLE) */
    float antialias_blend;           /* TEMPORAL: share of the new frame where things move */
    /* display */
    uint32_t tone_map;               /* es_tone_map */
    float exposure;                  /* stops */
    float white;                     /* REINHARD: radiance times exposure that is shown as white */
    float exposure_adapt;            /* s that the exposure takes to get used to a brighter picture, four times that to a darker one (gi/exposure.h); the first picture is what it is
                                      * used to. Goes by the world's time. 0: the exposure is what `exposure` says, otherwise that is added to it */
    float exposure_key;              /* exposure_adapt: radiance times exposure that the picture's logarithmic mean is shown as */
    /* glare: the eye that looks at the picture (Ritschel thesis §8.2, table 8.1; gi/glare/eye.h). Parts that are off scatter nothing, what has a strength of 0 stays still */
    uint32_t glare;                  /* es_glare_method; every channel's sum over the picture stays what it is (gi/glare/convolution.h) */
    uint32_t glare_size;             /* pixels of a side of the aperture and of its power spectrum, 64 … 4096, a power of two */
    float glare_width;               /* side of the plane that the aperture is drawn in, mm. Light goes up to 575 nm size / (2 width) aside; what is outside of the plane is dark */
    float glare_field;               /* angle of the eye's view that the picture's width spans, degrees (the thesis' study: 10) */
    uint32_t glare_wavelengths;      /* of 380 … 770 nm (§8.4.3: 32) */
    uint32_t glare_supersample;      /* 1, 2, 4, 8: places per pixel of the aperture and dimension (§8.4.1: 2) */
    float glare_defocus;             /* dioptres; 0: Fraunhofer's diffraction, otherwise Fresnel's (§8.4.2) */
    uint32_t glare_cycle;            /* spectra that are made once and shown over and over, 30 a second, there and back again (§8.4.4); 0: each frame has its own */
    float glare_threshold;           /* BILLBOARDS: radiance above which light spreads, W/(m² sr) */
    uint32_t glare_billboards;       /* BILLBOARDS: at most so many, each for a tile of 16 × 16 pixels */
    uint32_t glare_seed;             /* of the subject's anatomy, and of what moves it */
    float glare_pupil;               /* mean diameter, mm; below 0: by the field's luminance (eq. 8.2) */
    float glare_hippus;              /* amplitude of the noise by which it fluctuates (eq. 8.1) */
    bool glare_cornea;               /* large particles that do not move */
    bool glare_lens, glare_gratings; /* particles of the lens, and fibres of its cortex … */
    float glare_accommodation;       /* … which the muscle's fluctuations move, so many times as far as usual */
    bool glare_vitreous;             /* particles of the vitreous humour … */
    float glare_saccades;            /* … which the eye's jumps turn, likewise */
    bool glare_lids, glare_lashes;   /* lashes, blinking and squinting want lids */
    bool glare_blink;
    float glare_squint;              /* 1: as usual, from a field luminance of 300 cd/m² on; 0: not */
    /* several bounces */
    uint32_t bounces;                /* 0: none; 1: one indirect bounce; … ES_MAX_BOUNCES */
    uint32_t bounce_method;          /* es_bounce_method */
    uint32_t bounce_vpls;            /* lights of each bounce after the first */
    uint32_t bounce_points;          /* ONE_PASS: points tried for each light that is reflected */
    uint32_t bounce_rays;            /* ONE_PASS with shadow maps: rays for each light, to some of those points; 0: the maps alone say what is seen */
    /* micro-buffers: MICRO. What is above on virtual point lights, interleaving, half_resolution and rays has no effect on it but through the lights of
     * ES_MICRO_LIGHT_VPLS */
    uint32_t micro_size;             /* pixels of a micro-buffer's side, 8 … 32, a multiple of 4 (thesis: 24) */
    uint32_t micro_points;           /* of the whole scene, at most; each tree has a power of two */
    uint32_t micro_spacing;          /* 1, 2, 4: light is gathered at every so manieth pixel of every so manieth row, and interpolated along surfaces; what
                                      * lobes reflect at every second at least; pixels without neighbours on their surface have it gathered (§6.2.4) */
    float micro_cut;                 /* a node is drawn, not opened, when its sphere's solid angle is at most this share of that of a pixel above the surface,
                                      * pi / micro_size²; of a lobe's pixel, there; what is shared is as with 4 at the most */
    float micro_share;               /* what is further than so many radii of a cell of up to 64 gather points is drawn once, from the cell's middle, and looked up by each of
                                      * them: more is slower and nearer to the truth; less than 1 is as 1; 0: each point draws all that it sees */
    float micro_cover;               /* it is drawn where a disc of so many times its area covers the ray through the pixel: with 1 things are as wide as they are, but have
                                      * gaps; gaps between nodes are closed. Of a lobe also where it is within a twentieth of a radian */
    uint32_t micro_filter;           /* with micro_spacing 1: diffuse light goes through the geometry-aware filter of that size, filter_passes times: its noise is that of
                                      * places in pixels, and neighbours have others; 1: not */
    bool micro_ray_cast;             /* points larger than micro_cut allows are met by rays; off: they are drawn as others are, and leave holes */
    bool micro_warp;                 /* a pixel is a direction of the lobe's importance; off: of the cosine's, weighted by the lobe */
    bool micro_lobes;                /* what lobes of the points reflect of the lights goes where it goes, as a distribution of its own; off: evenly into their hemisphere */
    uint32_t micro_nodes;            /* es_micro_nodes */
    uint32_t micro_light;            /* es_micro_light */
    uint32_t micro_level;            /* VPLS, RADIOSITY: level of the hierarchy that light is found at, and pushed down from */
    uint32_t micro_iterations;       /* RADIOSITY: times that it is gathered; 0: bounces - 1 */
    uint32_t micro_photons;          /* PHOTONS: sent from all lights */
    float micro_rebuild;             /* how much worse than new a deforming mesh's tree may be before it is built anew */
    bool micro_emission;             /* glowing surfaces send light to micro-buffers where they do not light the picture as lamps */
    /* lamps: direct light of glowing surfaces and of the environment */
    uint32_t lamps;                  /* es_lamps_method */
    uint32_t lamp_count;             /* lights that stand for all of them */
    uint32_t lamp_size;              /* texels of a side of their imperfect maps: 32, 64, 128, 256; points and filling are those of the others */
    uint32_t lamp_interleave;        /* n of the n × n pattern, 1 … 16, and of its filter, which is applied filter_passes times */
    uint32_t lamp_vpls;              /* virtual point lights that the first bounce of their light makes; with every method that has such lights */
    float lamp_roughness;            /* lobes sharper than this GGX roughness are widened to it under lamps */
    float lamp_slope_bias;           /* of their maps, as ism_slope_bias */
    /* second-order illumination: SECOND_ORDER. geometry_bound and spread apply, seed shifts the sequences; what is above on virtual point lights does not besides */
    uint32_t second_lights;          /* lights (table 1: 300) */
    uint32_t second_negative;        /* negative ones (150) */
    float second_threshold;          /* gi/second_order.h: pixels whose neighbours at half the resolution differ by so much or more are lit at their own; 0: all */
    /* bias compensation in screen space (Novák et al. 2011), with the methods that have virtual point lights: what geometry_bound takes from their light is found
     * again among the pixels. Spread does not apply then, and geometry_bound is 1 / screen_radius² at the most, so that lights are no spots close by; with near_distance
     * or another traced_bias than BOUNDED there is nothing to be found. Of screen_layers behind the first the direct light is sent as well; bounded indirect light is
     * sent with two bounces or more, for what it lights is one bounce further */
    uint32_t compensation_steps;     /* 0: none; … ES_MAX_COMPENSATION_STEPS: times that the residual operator is applied; those after the first find light of further bounces */
    uint32_t compensation_levels;    /* of the pyramid of pixels, 1 … 8 (§6: 6) */
    float compensation_solid_angle;  /* projected, sr, above which a node of it is opened (§4.2: 0.08) … */
    float compensation_discontinuity;/* … and where it spans an edge (0.04) */
    uint32_t compensation_spacing;   /* 1, 2, 4: found at every so manieth pixel of every so manieth row, interpolated along surfaces, and found at those that have no such
                                      * neighbours (§5: 2) */
} es_renderer_settings;

ES_API es_renderer_settings es_default_renderer_settings(void);
ES_API size_t es_renderer_setting_count(void);
ES_API const es_setting* es_renderer_setting(size_t index);
ES_API es_result es_renderer_settings_set(es_context* context, es_renderer_settings* settings, const char* name, const char* value);

typedef struct es_renderer es_renderer;

/* settings NULL: defaults. SETTING_VALUE when one is outside its range. */
ES_API es_result es_renderer_create(es_context* context, const es_renderer_settings* settings, es_renderer** renderer);
ES_API void es_renderer_destroy(es_renderer* renderer);
/* Takes effect with the next frame, which reallocates what has another size. SETTING_VALUE when one is outside its range; nothing
 * is changed then. */
ES_API es_result es_renderer_configure(es_renderer* renderer, const es_renderer_settings* settings);
ES_API es_renderer_settings es_renderer_get_settings(const es_renderer* renderer);

/* Lights the world as its active camera sees it now. A world without a camera is refused (WRONG_STATE); without geometry or light it is black. */
ES_API es_result es_renderer_render(es_renderer* renderer, es_world* world);

/* ---- results ------------------------------------------------------------------------------------------------------------------- */

ES_API size_t es_image_name_count(void);
ES_API const char* es_image_name(size_t index);         /* "display" first: what a window shows */
ES_API const char* es_image_description(size_t index);
/* A copy of one image of the last frame as plain floats, made on request; the caller destroys it. IMAGE_UNKNOWN names the nearest.
 * "indirect-1" … "indirect-16" are single bounces, black beyond es_renderer_settings.bounces; their lights are shaded again for it. With `temporal`
 * they are of this frame's lights alone, and add up to what was blended with the light of frames before. */
ES_API es_result es_renderer_image(es_renderer* renderer, const char* name, es_image* image);
/* Of ES_GI_MICRO: the micro-buffer that light is gathered from at a pixel of the last frame, for what reflects in all directions (by the cosine) or for the `lobe`;
 * radiance in W/(m² sr), distance in metres, 0 where nothing is; either may be NULL. `warped`: as it is, micro_size² pixels, all of which are worth the same; its
 * axes are turned as the pixel's place in the picture says. Else laid out over the hemisphere in 128² pixels: the normal in the middle, the angle from it
 * growing evenly to a right one at the rim of the disc, as who looks out of the surface sees it with the camera's right to the right. Where nothing is gathered, and with other methods, one black pixel; gaps between nodes, which
 * the sum closes, show as nothing. It is
 * drawn by itself, with a cut of its own, and with the scene's points as they are now. The caller destroys the images. WRONG_STATE before the first frame,
 * INVALID_ARGUMENT outside the picture. */
ES_API es_result es_renderer_micro_buffer(es_renderer* renderer, uint32_t x, uint32_t y, bool lobe, bool warped, es_image* radiance, es_image* distance);
/* The displayed image as 0x00RRGGBB, width × height words, top row first; valid until the next call on the renderer. */
ES_API const uint32_t* es_renderer_display(es_renderer* renderer, uint32_t* width, uint32_t* height);

/* Radiance that another renderer made, a reference say, as these settings' exposure and tone map display it: 0x00RRGGBB, width × height words. Of an
 * image "radiance" it makes the displayed picture. INVALID_ARGUMENT with fewer than three channels; R, G and B are the first three. */
ES_API es_result es_tone_map_image(es_context* context, const es_renderer_settings* settings, const es_image* radiance, uint32_t* xrgb);

typedef struct es_pass_stats {
    const char* name;
    double milliseconds;
    const char* skipped;      /* NULL: it ran; otherwise why it did not */
    uint64_t count;           /* what `unit` says, e.g. triangles, virtual point lights, points */
    const char* unit;
} es_pass_stats;
/* Of the virtual point lights that send the n-th bounce to the picture. */
typedef struct es_bounce_stats {
    uint32_t vpls;
    double power[3];          /* W that reach the surfaces they stand for, before those reflect any: red, green, blue */
    double milliseconds;      /* to place them, when the pass last ran; 0 for the first bounce, which is a pass of its own */
    double map_milliseconds;  /* to draw their shadow maps, likewise */
} es_bounce_stats;
typedef struct es_frame_stats {
    uint64_t frame;           /* frames rendered before this one */
    double milliseconds;
    const es_pass_stats* passes; /* valid until the next frame */
    size_t pass_count;
    es_raster_stats raster;   /* of the camera's G-buffer */
    const es_bounce_stats* bounces; /* of bounce 1, 2, …; valid until the next frame */
    size_t bounce_count;      /* 0 without indirect light */
} es_frame_stats;
ES_API const es_frame_stats* es_renderer_stats(const es_renderer* renderer);

typedef struct es_vpl {
    es_vec3 position, normal;
    float flux[3];            /* radiant exitance × area share: intensity along the normal is flux / pi, W/sr */
    uint32_t bounce;          /* that it sends to the picture, from 1 */
} es_vpl;
/* Virtual point lights of the last frame, relative to es_world_origin, for overlays: writes the first of them, at most `capacity` lights, and
 * returns how many there are. */
ES_API size_t es_renderer_vpls(const es_renderer* renderer, es_vpl* vpls, size_t capacity);
/* Positions, relative to es_world_origin, of the points one imperfect shadow map is drawn from: writes the first of them, at most `capacity`
 * points, 3 floats each, and returns how many there are. */
ES_API size_t es_renderer_points(const es_renderer* renderer, uint32_t map, float* positions, size_t capacity);

/* ---- reference: a progressive path tracer over the same world ------------------------------------------------------------------- */

/* All of them by name through es_reference_settings_set. The camera sees through blended surfaces, any number of them: each stops a sample with probability alpha; to all
 * other rays they are masked (es_material_desc.blend). Every vertex of a path samples the lights and the surface, combined by multiple
 * importance sampling (Veach 1997), and neighbouring pixels share their paths (Bekaert et al. 2002). For the same settings samples are
 * a function of pixel and sample number alone: any number of threads, any instruction set and any split into calls or files give the
 * same bits. */
typedef struct es_reference_settings {
    uint32_t width, height;   /* pixels */
    uint32_t bounces;         /* indirect ones: 0 direct light only, 1 as ES_GI_ISM does, … */
    uint32_t seed;
    bool antialias;           /* rays over the pixel's area; off: through its centre, as the real-time methods sample */
    bool emission;            /* glowing surfaces and the environment light others; off: as the real-time methods, for which surfaces glow but
                               * light nothing and the environment is black */
    bool quantised;           /* the first hit's normal, colour and roughness are rounded as the G-buffer stores them */
    uint32_t share;           /* side of the tiles of pixels that share what their paths find, 1 … 8: less noise, but of tiles rather than of pixels, so
                               * that means over many pixels are no better; 1: pixels are independent of each other */
    uint32_t max_samples;     /* per pixel; 0: no limit */
    float max_seconds;        /* 0: no limit */
    float max_error;          /* relRMSE of the radiance by its own estimate; 0: no limit */
} es_reference_settings;

ES_API es_reference_settings es_default_reference_settings(void);
ES_API size_t es_reference_setting_count(void);
ES_API const es_setting* es_reference_setting(size_t index);
ES_API es_result es_reference_settings_set(es_context* context, es_reference_settings* settings, const char* name, const char* value);

typedef struct es_reference es_reference;
/* settings NULL: defaults. SETTING_VALUE when one is outside its range. */
ES_API es_result es_reference_create(es_context* context, const es_reference_settings* settings, es_reference** reference);
ES_API void es_reference_destroy(es_reference* reference);
/* Takes the world as its active camera sees it now and forgets all samples. The world must outlive the samples and stay as it is, but for
 * its camera: its meshes and textures are read, not copied. */
ES_API es_result es_reference_begin(es_reference* reference, es_world* world);
/* Adds `samples` samples per pixel, fewer when es_reference_settings.max_samples is reached and none when another limit is; the other limits
 * are looked at between calls, so calls should be short. WRONG_STATE when the world has changed since es_reference_begin, and past 2^26 samples. */
ES_API es_result es_reference_add(es_reference* reference, uint32_t samples);

typedef struct es_reference_stats {
    uint64_t samples;         /* per pixel, so far */
    uint64_t rays;            /* traced, so far */
    double seconds;           /* spent in es_reference_add since es_reference_begin or es_reference_resume */
    double build_seconds;     /* of the hierarchy */
    double error;             /* estimated relRMSE of the radiance; infinite before there is an estimate */
    double seconds_left;      /* to the first limit that will be reached, by the time per sample so far; infinite without one */
    bool done;                /* a limit is reached */
} es_reference_stats;
ES_API es_reference_stats es_reference_get_stats(const es_reference* reference);

/* "radiance" (everything), "emission" (seen directly), "direct", "indirect" (the sum of all bounces), "bounce-1" … "bounce-64", and with
 * "-error" appended the standard error of each, per pixel and channel; with `share` above 1 the errors of neighbours go together. The caller
 * destroys the image. */
ES_API es_result es_reference_image(es_reference* reference, const char* name, es_image* image);
ES_API bool es_reference_has_image(uint32_t bounces, const char* name);
/* Writes an EXR whose R, G, B are the radiance; further channels hold the other images and the accumulators. */
ES_API es_result es_reference_save(es_reference* reference, const char* path);
/* After es_reference_begin: goes on where the file stopped. FILE_UNSUPPORTED when it was made from another world, camera or settings,
 * FILE_DAMAGED when it lacks sums or they are no numbers; a file that is refused changes nothing. */
ES_API es_result es_reference_resume(es_reference* reference, const char* path);

/* ---- rays ---------------------------------------------------------------------------------------------------------------------------- */

/* What a ray meets in a draw list (es_world_draw_list, or one's own): for picking, lines of sight, sensors, and the tracers above.
 *
 * Eight children a node, built by the surface area heuristic, refit when only vertices or transforms moved. Triangles are kept in world
 * space. The test of a ray with a triangle is watertight (Woop, Benthin and Wald 2013): a ray through a shared edge or vertex hits at least one
 * of its triangles. Both faces are hit; what a back face means is for the caller.
 *
 * The same rays give the same hits, bit for bit, on every instruction set and for any number of threads. Where two triangles are hit
 * at the same distance the lower primitive wins; of overlapping triangles in one plane, whose distances differ by rounding only, always the
 * same one.
 *
 *     es_bvh* bvh;
 *     es_bvh_create(context, &bvh);
 *     es_bvh_update(bvh, es_world_draw_list(world));                         // after each step of the world
 *     es_ray ray = {{eye.x, eye.y, eye.z}, 0, {d.x, d.y, d.z}, INFINITY};
 *     es_hit hit;
 *     es_bvh_closest(bvh, ES_RAYS_SINGLE, &ray, 1, &hit);
 *     if (hit.primitive != ES_NO_PRIMITIVE) picked = es_bvh_primitives(bvh)[hit.primitive].instance;
 */
#define ES_NO_PRIMITIVE 0xffffffffu

/* Points origin + t direction with min < t < max. The direction need not be unit but must be finite and not zero; max may be infinite. Rays
 * that break this harm nothing and hit anything or nothing. */
typedef struct es_ray { float origin[3], min, direction[3], max; } es_ray;

/* primitive ES_NO_PRIMITIVE: nothing was hit and t is the ray's max. The point is (1 - u - v) a + u b + v c of the triangle. */
typedef struct es_hit { float t, u, v; uint32_t primitive; } es_hit;

typedef struct es_bvh_primitive { uint32_t instance, triangle; } es_bvh_primitive; /* index into the draw list; triangle of its mesh */

typedef struct es_bvh es_bvh;

/* Empty: nothing hits. One thread at a time changes a hierarchy; any number trace through it meanwhile unchanged. */
ES_API es_result es_bvh_create(es_context* context, es_bvh** bvh);
ES_API void es_bvh_destroy(es_bvh* bvh); /* NULL: nothing */
/* From nothing, or again. The list is not kept. An empty list gives a hierarchy that nothing hits. INVALID_ARGUMENT beyond 2^31 - 2 triangles
 * or vertices; after a failure the hierarchy is to be built or destroyed, and nothing else. */
ES_API es_result es_bvh_build(es_bvh* bvh, const es_draw_list* list);
/* The same instances, meshes and triangles, moved. WRONG_STATE when the list has others. */
ES_API es_result es_bvh_refit(es_bvh* bvh, const es_draw_list* list);
/* Build when the list has other triangles than the hierarchy or when refitting has made rays 1.5 times as expensive as they were at
 * the last build, by the surface area heuristic; else refit when something moved (by the meshes' revisions and the transforms); else nothing. */
ES_API es_result es_bvh_update(es_bvh* bvh, const es_draw_list* list);

ES_API uint32_t es_bvh_primitive_count(const es_bvh* bvh);
/* es_hit.primitive is an index here: the draw list's triangles in order, instance by instance. Valid until the next build. */
ES_API const es_bvh_primitive* es_bvh_primitives(const es_bvh* bvh);
/* Corners in world space. */
ES_API void es_bvh_triangle(const es_bvh* bvh, uint32_t primitive, es_vec3 corners[3]);
ES_API void es_bvh_bounds(const es_bvh* bvh, es_vec3* minimum, es_vec3* maximum); /* empty: minimum > maximum */

typedef enum es_ray_kind {
    ES_RAYS_SINGLE,     /* each by itself: what random directions want */
    ES_RAYS_COHERENT    /* runs of eight neighbours go together: from one pixel block, or towards one light */
} es_ray_kind;

/* On the calling thread, which may be any: one's own, or a task's of the context. The results do not depend on `kind`. */
ES_API void es_bvh_closest(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, es_hit* hits);
/* blocked[i] is 1 when anything is hit, else 0. */
ES_API void es_bvh_any(const es_bvh* bvh, es_ray_kind kind, const es_ray* rays, uint32_t count, uint8_t* blocked);

/* Where a ray leaves a surface: the point, moved along the geometric normal (unit, on the side the ray goes to) far enough that rounding
 * of the point and of the hit test cannot bring the surface itself back, and no further: a few units in the last place of the largest
 * coordinate (after Wächter and Binder 2019). So rays need no minimum that would depend on the scene's size. */
ES_API es_vec3 es_offset_origin(es_vec3 point, es_vec3 geometric_normal);

/* ---- Fourier transforms ---------------------------------------------------------------------------------------------------------------- */

/* Milliseconds of one transform as glare makes them, the median of `times` (1 … 64): of random numbers, complex, or real to half a complex picture.
 * For benchmarks. INVALID_ARGUMENT for sizes other than products of 2, 3 and 5 up to 16384, of the width multiples of 64. */
ES_API es_result es_fft_measure(es_context* context, uint32_t width, uint32_t height, bool real, uint32_t times, double* milliseconds);

/* ---- diffraction ------------------------------------------------------------------------------------------------------------------------ */

/* Where light goes that passes an aperture, as the glare of pictures has it (`glare` of es_renderer_settings): `transmittance` is square, of one channel 0 … 1,
 * `width` metres wide, its size a multiple of 64 without prime factors but 2, 3 and 5, 64 … 4096. `power` has the same size and sums to 1; pixel
 * (size / 2 + k, size / 2 + l) is light of 575 nm that goes (k, l) · 575 nm / width radians aside. `defocus` in dioptres, 0: Fraunhofer's diffraction, otherwise
 * Fresnel's. The caller destroys `power`. INVALID_ARGUMENT otherwise. */
ES_API es_result es_diffraction_image(es_context* context, const es_image* transmittance, float width, float defocus, es_image* power);

/* ---- error: how far a picture is from the truth ------------------------------------------------------------------------------------ */

/* Of a picture A against a reference B, over all pixels and the channels compared, with d = A - B. Deterministic: own elementary
 * functions, compensated sums in double in pixel order. A pair that is not finite counts as infinite error unless both are the same. */
typedef struct es_image_error {
    double rmse;              /* sqrt(mean(d²)) */
    double relrmse;           /* rmse / mean(B) */
    double relmse;            /* mean(d² / (B² + 0.01)) (Rousselle et al. 2011) */
    double rell1;             /* mean(|d|) / mean(B) */
    double flip;              /* mean ꟻLIP 0 … 1 (Andersson et al. 2020), after the default tone map; NaN with fewer than three channels */
    double hdr_flip;          /* mean HDR-ꟻLIP (Andersson et al. 2021), over the exposures that B asks for, by its ACES curve; NaN likewise */
    double max;               /* largest |d| */
    double mean, reference_mean; /* of the finite values */
    uint64_t samples;         /* compared values */
} es_image_error;

typedef struct es_error_desc {
    bool flip;                /* compute flip and hdr_flip, which take longer than all the others; false: they are NaN */
    float pixels_per_degree;  /* of the viewer, 10 … 450; 0: 67.0206, a 0.7 m wide screen of 3840 pixels seen from 0.7 m */
    bool display_referred;    /* A and B are linear 0 … 1 (a PNG): flip takes them as they are and hdr_flip is NaN */
    const uint8_t* mask;      /* one byte per pixel, zero leaves it out; NULL: all. ꟻLIP filters over all pixels and averages over these */
} es_error_desc;

/* Channels of the same name are compared, alpha only when there is nothing else; by position when no name is shared and the counts
 * are equal. ꟻLIP takes R, G and B, or the first three where these names are missing; to its filters negative values and what is not finite
 * are black, and a pixel that is not finite in one picture and not the same in the other has error 1. INVALID_ARGUMENT when the sizes differ
 * or nothing can be compared. desc NULL: everything, no mask. */
ES_API es_result es_image_compare(es_context* context, const es_image* a, const es_image* b, const es_error_desc* desc, es_image_error* error);

typedef enum es_error_map { ES_ERROR_MAP_ABSOLUTE, ES_ERROR_MAP_RELATIVE, ES_ERROR_MAP_SIGNED, ES_ERROR_MAP_FLIP, ES_ERROR_MAP_HDR_FLIP } es_error_map;
/* The error of each pixel as one channel whose mean is the measure; pixels the mask leaves out are 0. ABSOLUTE: mean of |d| over channels,
 * RELATIVE: of d² / (B² + 0.01), SIGNED: of d. desc NULL: no mask. The caller destroys it. INVALID_ARGUMENT as es_image_compare, and for
 * the ꟻLIPs that would be NaN there. */
ES_API es_result es_image_error_map(es_context* context, const es_image* a, const es_image* b, es_error_map map, const es_error_desc* desc, es_image* result);
/* One channel to false colour, sRGB samples (save them with es_image_save_desc.already_srgb): 0 … scale by the map "magma", from black over
 * purple, red and orange to pale yellow, lightness rising evenly; is_signed: from light blue (-scale) over black to yellow (+scale), equally
 * light on both sides. NaN is green. */
ES_API es_result es_image_false_colour(es_context* context, const es_image* values, float scale, bool is_signed, es_image* result);

/* Flicker of a sequence: the error of the change from frame to frame. With dA = A(t) - A(t-1), dB likewise:
 *   flicker = sqrt(mean((dA - dB)²)) / mean(B), over all pixels, channels and pairs of frames. */
typedef struct es_flicker es_flicker;
ES_API es_result es_flicker_create(es_context* context, es_flicker** flicker);
ES_API void es_flicker_destroy(es_flicker* flicker);
/* The next frame of both; the images are not kept. */
ES_API es_result es_flicker_add(es_flicker* flicker, const es_image* a, const es_image* b);
typedef struct es_flicker_error {
    double flicker;           /* as above; NaN before there are two frames */
    double worst;             /* of one pair of frames */
    uint64_t worst_frame;     /* the later one of it, counted from 0 */
    double change;            /* sqrt(mean(dB²)) / mean(B): what the reference itself changes */
    uint64_t frames;
} es_flicker_error;
ES_API es_flicker_error es_flicker_result(const es_flicker* flicker);

#ifdef __cplusplus
}
#endif
#endif
