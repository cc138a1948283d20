/* Interleaved shading by virtual point lights (Segovia et al. 2006; Knecht 2009 §3.4, §4.5).
 *
 * Pixel (x, y) is of phase (x mod n, y mod n); phase p = x mod n + n (y mod n) is lit by the lights p, p + n², p + 2n², … and
 * the result is multiplied by n², so that the mean over any n × n pixels has every light once. Per light, with d from light to
 * pixel, r = |d|:
 *
 *     G = min(cos_light · cos_pixel / (r² + spread · A / pi), geometry_bound)      Knecht eq. 4.7, the bound being 1 / d²min
 *     V = r <= map(d) + bias + slope_bias / cos_pixel
 *
 * A is the area the light stands for: with spread 1 a disc of that area sends what a point would send too much of close by
 * (the point-to-disc form factor of Wallace, Elmquist and Haines 1989). Where lights lie close together, as they do near their
 * source, little is softened. A map's depth holds for a patch as wide as a splat; on a pixel's surface tilted by the angle a
 * depths within it differ by width · tan a, which slope_bias allows for.
 *     irradiance += n² · flux / pi · G · V
 *
 * Sampled: of the lights of its phase each pixel takes one, l with probability w_l / W, w_l being what l would send if nothing stood between
 * (G · luminance) and W the sum over the phase, and only its shadow is found:
 *     irradiance += W / luminance · n² · flux / pi · V,
 * which is the sum over the phase on average, and the sum itself where all lights are seen and of one colour. The lights of a phase are put in
 * order along a curve through space, and the numbers that choose are spread evenly over each neighbourhood of pixels, so that it
 * takes its lights from everywhere.
 *
 * A parallel light (es_vpl_record.parallel) has G = cos_pixel and a map of its own projection (raster/points.h):
 *     V = depth along the light <= map + bias + slope_bias / cos_pixel
 *
 * The pixel's own diffuse reflectance, albedo · (1 - metallic) / pi, is applied after the filter. Lobes (gi/surface.h): a glossy light
 * sends power · f(incident, d) instead of flux / pi; a pixel with a lobe has a second sum, the radiance its lobe reflects to the
 * eye, and its irradiance is what passes to the diffuse part.
 */
#ifndef EARTHSHINE_GI_SHADE_H
#define EARTHSHINE_GI_SHADE_H

#include "gi/micro/lobe_albedo.h"
#include "gi/pixel_rays.h"
#include "gi/screen/view_stack.h"
#include "gi/surface.h"
#include "gi/vpl.h"
#include "platform/context.h"

enum { ES_INTERLEAVE_MAX = 16 };

/* 1/m², for es_shade_job.geometry_bound where there is to be none: finite, so that a light on a pixel's very point gives no infinity */
#define ES_UNBOUNDED 1e18f

typedef struct es_shade_batch es_shade_batch;
typedef struct es_shade_visibility es_shade_visibility;

/* Visibility found by the caller: `test` sets batch->visible, all bits or none, of those of the first `lanes` pixels that the light's front
 * and their own face; others are not looked at. Called by several workers at once. */
struct es_shade_visibility {
    void (*test)(const es_shade_visibility* visibility, uint32_t vpl, es_shade_batch* batch, uint32_t lanes);
    /* the same for sampled lights: pixel i and record batch->chosen[i], which is negative where there is nothing to test */
    void (*test_chosen)(const es_shade_visibility* visibility, es_shade_batch* batch, uint32_t lanes);
    float offset;                  /* metres from a pixel's surface at which its rays begin, besides 2^-17 of its largest coordinate */
};

/* Light that is not from the lights of the set: `add` adds it to the batch's sums, those of lobes included where `lobes`. Pixel i of the batch may
 * use the numbers batch->direction[0 … 1][i]. Called by several workers at once. */
typedef struct es_shade_near es_shade_near;
struct es_shade_near {
    void (*add)(const es_shade_near* near, es_shade_batch* batch, uint32_t lanes, bool lobes);
    float offset;                  /* as in es_shade_visibility */
};

typedef struct es_shade_job {
    const es_gbuffer* gbuffer;     /* depth and normal; with `specular` also albedo and surface; with `visibility` or `near` the geometric normal */
    es_pixel_rays rays;
    const es_vpl_record* vpls;
    uint32_t vpl_count;
    uint32_t dark_count;           /* the last so many records send nothing; where one is sampled they are chosen as if they did */
    const uint16_t* maps;          /* map v at maps + v · map_size²; NULL: everything sees everything */
    const es_shade_visibility* visibility; /* in place of maps; NULL: by the maps */
    const uint32_t* map_of;        /* each light's map; NULL: they are in order */
    uint32_t map_size;
    float far_distance;            /* of the maps */
    float bias, slope_bias;        /* metres */
    float spread;
    float geometry_bound;          /* 1/m² */
    float lobe_roughness;          /* lobes of lights and pixels are at least as wide as GGX of this roughness */
    /* with specular: eights of pixels of which none has a lobe worth evaluating (es_surface_has_lobe), all of them wide, reflect the irradiance as if it came evenly
     * from the hemisphere: by their directional albedo, seen from the eye, and the interface's means. NULL: every lobe is evaluated */
    const es_lobe_albedo* wide;
    uint32_t interleave;           /* n, 1 … ES_INTERLEAVE_MAX */
    bool sampled;                  /* with visibility: one light of its phase for each pixel */
    const es_shade_near* near;     /* NULL: none */
    /* what bias and slope_bias of the maps leave out of shadows, found in screen space (Ritschel thesis §4.5.2); with maps, at pixels alone */
    const es_screen_view* repair;  /* that shows the G-buffer's surfaces, at its resolution or another; NULL: nothing is */
    uint32_t repair_samples;       /* of a segment towards the light as long as the bias, and as repair_most, metres, at the most */
    float repair_most;
    uint32_t seed;                 /* of what is random with sampled and near */
    /* where pixels' lobes reflect, (0, 0, 0) where they do as the law says (gi/edit/edit.h); NULL: everywhere. Pixel (x, y) is that of edited_spacing times x and y. Light
     * found near is not edited */
    const float* edited[3];
    uint32_t edited_stride, edited_spacing;
    /* out, rows of gbuffer->stride; 0 where nothing is seen */
    float* irradiance[3];
    float* specular[3];            /* NULL: pixels have no lobes */
    uint8_t* lit;                  /* where these may be lit (gi/lit.h), in and out; NULL: not kept */
} es_shade_job;

es_result es_shade(es_context* context, es_arena* arena, const es_shade_job* job);

/* The same lights, all of them, at points that are not pixels: irradiance, W/m². Of the job what says what lights are and where they reach is used:
 * vpls, vpl_count, dark_count, maps and what belongs to them, spread, geometry_bound, lobe_roughness. Lights found visible by rays are not. */
typedef struct es_shade_points {
    const float *x, *y, *z, *nx, *ny, *nz; /* readable up to the next multiple of eight */
    uint32_t count;
    float* irradiance[3];
} es_shade_points;

es_result es_shade_at_points(es_context* context, es_arena* arena, const es_shade_job* job, const es_shade_points* points);

/* The surface with its lobe widened to `lobe_roughness`, as a light's surface and a pixel's are before shading. */
es_surface es_widened_lobe(es_surface surface, float lobe_roughness);

/* ---- between shade.c and its kernel -------------------------------------------------------------------------------------- */

typedef struct es_shade_light {
    float position[3], normal[3], tangent[3], bitangent[3];
    float color[3];                /* n² · flux / pi */
    float spread;                  /* spread · A / pi, m² */
    float power[3];                /* n² · power; what follows is used when glossy */
    float incident[3], specular_color[3], roughness;
    uint32_t model;
    bool glossy, parallel;
    /* sampled */
    float weight;                  /* luminance of what the light sends */
    uint32_t record;               /* place among es_shade_job.vpls: lights of a phase are in another order */
} es_shade_light;

/* Pixels of one phase inside a block of the image: so many that a light's map comes from memory few times a frame, so few that they
 * and two maps fit the second-level cache. Rows of up to ES_SHADE_COLUMNS lanes, a multiple of eight. */
enum { ES_SHADE_LANES = 4096, ES_SHADE_COLUMNS = 128,
    ES_SHADE_PHASE_STRIDE = ES_SHADE_LANES + 16 }; /* phases begin at different places of a way of the cache */

struct es_shade_batch {
    float px[ES_SHADE_LANES], py[ES_SHADE_LANES], pz[ES_SHADE_LANES];
    float nx[ES_SHADE_LANES], ny[ES_SHADE_LANES], nz[ES_SHADE_LANES]; /* 0 where nothing is seen */
    float* e[3];                                                       /* irradiance, of the phase among `words` */
    /* with lobes */
    float vx[ES_SHADE_LANES], vy[ES_SHADE_LANES], vz[ES_SHADE_LANES];  /* unit, to the eye */
    float f0[3][ES_SHADE_LANES], roughness[ES_SHADE_LANES];
    int32_t model[ES_SHADE_LANES];
    uint8_t lobed[ES_SHADE_LANES / 8];  /* per vector: does a pixel of it have a lobe? */
    uint8_t wide[ES_SHADE_LANES / 8];   /* per vector: have they es_shade_job.wide's? Then they are no lobed ones until all lights are added */
    uint8_t edited[ES_SHADE_LANES / 8]; /* per vector: is a lobed pixel's direction edited? Its directions are in turned */
    float turned[3][ES_SHADE_LANES];
    float s[3][ES_SHADE_LANES];
    /* with es_shade_visibility or es_shade_near */
    float ox[ES_SHADE_LANES], oy[ES_SHADE_LANES], oz[ES_SHADE_LANES]; /* where rays begin */
    int32_t visible[ES_SHADE_LANES];
    float direction[2][ES_SHADE_LANES]; /* [0, 1) */
    /* sampled */
    float choice[ES_SHADE_LANES];      /* [0, 1) */
    int32_t light[ES_SHADE_LANES];     /* the chosen one, -1: none sends anything */
    int32_t chosen[ES_SHADE_LANES];    /* its record, or -1 */
    float share[ES_SHADE_LANES];       /* W / luminance */
    /* with repair: the pixels as the view shows them */
    float screen[9][ES_SHADE_LANES];
    /* of each phase of the row: depth, normal and surface of the G-buffer until the phase is shaded, its irradiance then */
    uint32_t words[3][ES_INTERLEAVE_MAX][ES_SHADE_PHASE_STRIDE];
};

/* A block: columns [column, column + ES_SHADE_COLUMNS) and rows [row, row + rows) of each phase of phase row phase_y. */
typedef struct es_shade_block { uint32_t phase_y, column, row, rows; } es_shade_block;

#endif
