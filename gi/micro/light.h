/* Direct light of a forest's leaves, by the frame's shadow maps (Ritschel thesis §6.2.2, §6.4.1).
 *
 * A point sends the same radiance into all of its hemisphere. Of irradiance E from a direction whose cosine is c,
 *     radiance = E / pi · (albedo · (1 - Fd(c)) · mean(1 - Fd) + lobe(c)) + emission,
 * albedo, Fd as in gi/surface.h, the mean over directions by their cosine, lobe(c) the directional albedo of the lobe (gi/micro/lobe_albedo.h).
 * So a point sends as much power as its surface would; what is approximated is where to: the interface's shadow at grazing directions is spread over the
 * hemisphere, and so is the lobe. That is all there is to a lobe that is hardly one; one that es_surface_has_lobe says is worth evaluating is kept apart, if the job has shapes
 * for it: E lobe(c) is then the power that goes about the direction which gi/micro/lobe_shape.h has for it. A disc stands for a surface that bends within it; so
 * that few discs do not sparkle, four that are neighbours in the tree are widened by a third of what their axes are spread by among each other, which is how the variance of what is
 * even over each of four squares is to that of their middles, if no edge is between them. A point has one lobe: of several lights the mean direction by the
 * luminance of what each brings, and as wide as these lie apart.
 *
 * Of further bounces radiosity gathers these lobes, so that what they throw is reflected on; what virtual point lights, radiosity and photons add at the points is spread. */
#ifndef EARTHSHINE_GI_MICRO_LIGHT_H
#define EARTHSHINE_GI_MICRO_LIGHT_H

#include "gi/light_view.h"
#include "gi/micro/forest.h"
#include "gi/micro/lobe_albedo.h"
#include "gi/micro/lobe_shape.h"

typedef struct es_point_light_job {
    const es_light_view* views;    /* with their shadow maps drawn */
    uint32_t view_count;           /* 0: nothing is lit */
    uint32_t shadow_filter;        /* as es_direct_job has them */
    float shadow_bias, shadow_slope_bias;
    bool emission;                 /* adds what the surfaces glow with */
    const es_lobe_albedo* lobes;   /* filled */
    const es_lobe_shapes* shapes;  /* filled; NULL: lobes are spread over the hemisphere */
} es_point_light_job;

/* Sets the radiance of all leaves, not of inner nodes: es_forest_pull does. So it does lobes, which the forest then has where a tree is glossy and a light on. Leaves are split among the context's threads; what one has does not
 * depend on the others. Surfaces that are unlit only glow. */
es_result es_points_light_direct(es_context* context, es_point_forest* forest, const es_point_light_job* job);

/* ---- between light.c and its kernel ----------------------------------------------------------------------------------------------- */

/* Leaves [leaf, leaf + count) of the forest's, which are the nodes from `node` on, of that tree. */
typedef struct es_leaf_range { size_t leaf, node; uint32_t count, tree; } es_leaf_range;

/* Calls body for all leaves, in parallel, in pieces that do not cross trees: of up to 4096 leaves, or of a small tree's. */
typedef void (*es_leaf_body)(void* user, const es_leaf_range* range, uint32_t worker);
void es_forest_each_leaf(es_context* context, const es_point_forest* forest, es_leaf_body body, void* user);

#endif
