/* Virtual point lights that stay where they are from frame to frame (after Laine et al. 2007, "Incremental Instant Radiosity"; here for
 * surfaces and lights that move as they like).
 *
 * Each light of the set is a place on a triangle: it follows its instance and its mesh's vertices, with its normal turned as the
 * triangle turns. Every frame finds anew how much of its light's power it stands for and whether the light sees it (in the
 * light's G-buffer, four texels smoothed, so that it goes out over the width of a texel). With n places x_i of one light, I(x) the
 * importance that es_vpls_sample draws texels by (eq. 4.3, without a camera) and T its sum,
 *
 *     power_i = radiant · share(x_i) · T / I(x_i) · w_i,      w_i = (m_i s_i / d_i) / sum of all (m s / d)
 *
 * where s_i is what the light sees of it, m_i its presence (0 … 1: newcomers arrive over ES_VPL_ARRIVAL frames, and those that leave go
 * as slowly), and d_i how many more places there are around x_i than I asks for: both on a grid of about one cell a place, smoothed over
 * 3 × 3 cells. A set drawn by importance has d = 1 up to its noise and is es_vpls_sample's. What I stands for is sent whole whatever the
 * places (the w add up to 1); where it goes is blurred by a grid cell or two where places are missing.
 *
 * Moved elsewhere are, no more than `renew` of all in a frame: lights that send nothing any more; those of a light that has too many; and, in
 * frames in which anything changed, those that stand where there are over twice too many. Newcomers take of a few candidates of the
 * light's own Halton sequence the one where places are scarcest. When a light has lost half of its set, or is new, all of its missing
 * places are drawn at once; and all of them when it has jumped (gi/light_change.h): where its light fell before says nothing of where it
 * falls now, and a set that came over by and by would leave its light behind for as long. A place keeps its number, and with it its subset of pixels and of points. No camera has a say. */
#ifndef EARTHSHINE_GI_STABLE_VPLS_H
#define EARTHSHINE_GI_STABLE_VPLS_H

#include "gi/vpl_sampling.h"

enum { ES_VPL_ARRIVAL = 8, ES_VPL_CANDIDATES = 8 };

typedef struct es_stable_vpl {
    uint32_t light;            /* handle's id; 0: nobody's */
    uint32_t instance, triangle;
    float u, v;                /* weights of the triangle's second and third vertex */
    float normal[3];           /* shading normal: along the first edge, across it, along the triangle's normal */
    es_surface surface;
    float presence;
    bool leaving, placed;
    uint64_t materials;        /* revision that the surface was seen at */
} es_stable_vpl;

typedef struct es_stable_light {
    uint32_t light, drawn;
    es_light_state then;       /* at the last update */
} es_stable_light;

/* All that is kept; nothing else of the last frame is. */
typedef struct es_stable_vpls {
    es_stable_vpl* places;
    uint32_t count, subsets, seed;
    es_stable_light* lights;   /* those that have been seen, and how far their sequences are used up */
    uint32_t light_count;
    size_t light_capacity;
    double origin[3];          /* that the lights of the last update were relative to */
    uint64_t scene;            /* hash of what the last update saw */
    bool settled;              /* the next update with the same scene changes nothing */
    uint32_t moved;            /* by the last update */
} es_stable_vpls;

typedef struct es_stable_vpl_request {
    es_vpl_request sample;
    float renew;
    const es_draw_list* list;
    double origin[3];          /* that the views' lights are relative to */
    float extent;              /* of the scene */
    uint64_t scene, materials; /* equal numbers: nothing the lights see has changed; no material has */
} es_stable_vpl_request;

/* The views have instance and triangle planes; the importances know no camera. *count is request->sample.count, or 0 when nothing is lit. */
es_result es_stable_vpls_update(es_context* context, es_stable_vpls* stable, const es_light_view* views, uint32_t view_count, const es_importance* importances,
    const es_stable_vpl_request* request, es_vpl_record* records, uint32_t* count);
void es_stable_vpls_free(es_context* context, es_stable_vpls* stable);

#endif
