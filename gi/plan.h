/* The frame plan: which passes run, and why the others do not.
 *
 * Each pass has a signature: a hash of the settings it reads and of the versions of what it reads from (the world's revisions, the
 * outputs of earlier passes). A pass whose signature is that of its last run would write the same bits again and is skipped;
 * one that runs gets a new output version, which changes the signatures of those that read it. */
#ifndef EARTHSHINE_GI_PLAN_H
#define EARTHSHINE_GI_PLAN_H

#include "gi/gi.h"

#define ES_PASSES(X)                                                                                             \
    X(VISIBILITY, "visibility", "triangles")                                                                     \
    X(EDITS, "reflection edits", "pixels")                                                                       \
    X(BACKGROUND, "background", "pixels")                                                                        \
    X(ENVIRONMENT, "environment", "texels")                                                                      \
    X(SHADOW_MAPS, "shadow maps", "triangles")                                                                   \
    X(LIGHT_VIEWS, "light views", "triangles")                                                                   \
    X(VPLS, "vpls", "lights")                                                                                    \
    X(LAMPS, "lamps", "lights")                                                                                  \
    X(POINTS, "points", "points")                                                                                \
    X(ISM, "imperfect shadow maps", "points")                                                                    \
    X(CLASSIC, "classic shadow maps", "maps")                                                                    \
    X(HIERARCHY, "ray hierarchy", "triangles")                                                                   \
    X(LAMP_MAPS, "shadow maps of lamps", "points")                                                               \
    X(LAMP_BOUNCE, "bounce of lamps", "lights")                                                                  \
    X(BOUNCES, "bounces", "lights")                                                                              \
    X(FOREST, "point hierarchy", "points")                                                                       \
    X(POINT_LIGHT, "point light", "points")                                                                      \
    X(DIRECT, "direct", "lights")                                                                                \
    X(LAMP_LIGHT, "light of lamps", "samples")                                                                   \
    X(LAMP_FILTER, "filter of lamps' light", "pixels")                                                           \
    X(SHADING, "shading", "samples")                                                                             \
    X(SECOND_ORDER, "second-order light", "pixels at full resolution")                                           \
    X(MICRO, "micro-buffers", "samples")                                                                         \
    X(MICRO_UPSAMPLE, "micro-buffer upsampling", "pixels gathered afresh")                                       \
    X(COMPENSATION, "bias compensation", "samples")                                                              \
    X(FILTER, "filter", "pixels")                                                                                \
    X(TEMPORAL, "temporal coherence", "pixels")                                                                  \
    X(UPSAMPLE, "upsample", "pixels")                                                                            \
    X(SCREEN_VIEWS, "screen-space views", "triangles")                                                           \
    X(SCREEN_OCCLUSION, "screen-space occlusion", "samples")                                                     \
    X(SCREEN_BOUNCE, "screen-space bounce", "samples")                                                           \
    X(RESIDUAL, "screen-space compensation", "samples")                                                          \
    X(REFLECTING, "reflected directions", "pixels")                                                              \
    X(REFRACTING, "refracted directions", "pixels")                                                              \
    X(REFLECTION_MAPS, "reflection maps", "maps drawn")                                                          \
    X(REFLECTIONS, "reflections", "pixels")                                                                      \
    X(BLEND_LAYERS, "blended layers", "triangles")                                                               \
    X(BLEND_LIGHT, "light of blended layers", "pixels")                                                          \
    X(ANTIALIAS, "anti-aliasing", "pixels")                                                                      \
    X(RADIANCE, "radiance of the picture", "pixels")                                                             \
    X(METER, "light meter", "pixels")                                                                            \
    X(APERTURE, "aperture of the eye", "pixels")                                                                 \
    X(GLARE_SPECTRUM, "spectrum of glare", "pixels")                                                             \
    X(GLARE, "glare", "pixels, or billboards")                                                                   \
    X(COMPOSE, "compose", "pixels")

typedef enum es_pass {
#define ES_PASS_ENUM(id, name, unit) ES_PASS_##id,
    ES_PASSES(ES_PASS_ENUM)
#undef ES_PASS_ENUM
    ES_PASS_COUNT
} es_pass;

typedef struct es_plan {
    bool skip;                             /* may passes be skipped for unchanged inputs? */
    bool valid[ES_PASS_COUNT];             /* the pass has run and its output still stands */
    uint64_t signature[ES_PASS_COUNT];     /* of its last run */
    uint64_t version[ES_PASS_COUNT];       /* of its output */
    uint64_t pending;                      /* signature being put together */
    double started;
    es_pass_stats stats[ES_PASS_COUNT];
} es_plan;

/* Clears the statistics of the last frame. */
void es_plan_begin_frame(es_plan* plan, bool skip);
/* Forgets all outputs, as after a change of sizes. */
void es_plan_invalidate(es_plan* plan);

/* A pass: begin, add what it reads, then ask. es_plan_run is false when the output of the last run stands; the reason is written
 * down. After true, do the work and call es_plan_done. */
void es_plan_begin(es_plan* plan, es_pass pass);
void es_plan_reads(es_plan* plan, const void* bytes, size_t size);
void es_plan_reads_pass(es_plan* plan, es_pass other);
bool es_plan_run(es_plan* plan, es_pass pass);
void es_plan_done(es_plan* plan, es_pass pass, uint64_t count);
/* The frame has no use for the pass. Its output gets a new version if it had one. `why` is a literal. */
void es_plan_not_needed(es_plan* plan, es_pass pass, const char* why);

#endif
