/* What the path tracer reads of a world: triangles to hit, surfaces to shade, light sources to sample. */
#ifndef EARTHSHINE_GI_REFERENCE_SCENE_H
#define EARTHSHINE_GI_REFERENCE_SCENE_H

#include "gi/reference/bvh.h"
#include "gi/surface.h"

typedef struct es_trace_scene {
    es_context* context;
    es_bvh* bvh;
    es_raster_instance* instances;     /* copies; their meshes, and the materials' textures, stay the world's */
    es_material_desc* materials;
    float (*normal_matrices)[9];       /* per instance */
    es_light_state* lights;
    uint32_t instance_count, material_count, light_count;
    bool has_glass;                    /* something lets light through; to all rays but the camera's it is solid */
    bool has_masks, has_blended;       /* blended surfaces are masks to all rays but the camera's */
    /* glowing triangles and the environment; `emitter_sums` runs up to 1 over the primitives by area × mean emission */
    uint32_t* emitters;
    float* emitter_sums;
    uint32_t emitter_count;
    double emitter_total;
    es_environment_desc environment;
    bool has_environment;
    float* environment_rows;           /* running sums of luminance × solid angle: height rows, then width × height columns within their row */
    float* environment_columns;
    uint32_t environment_height;       /* of those sums: the world's image may be another by the time they are freed */
    size_t environment_texels;
} es_trace_scene;

/* From nothing (all zero), or again: then the hierarchy is refit where that will do. The world must stay as it is while the scene is used. emission: whether glowing surfaces and the environment are gathered. */
es_result es_trace_scene_take(es_trace_scene* scene, es_world* world, bool emission);
void es_trace_scene_free(es_trace_scene* scene);

/* A surface seen from direction wo. */
typedef struct es_trace_surface {
    es_vec3 position;
    es_vec3 geometric, normal;         /* unit, geometric on the side of wo */
    es_vec3 emission;                  /* towards wo, W/(m² sr) */
    es_vec3 base;                      /* colour, of the diffuse part beside what goes through */
    es_vec3 tint;                      /* of what goes through: colour × share; 0: nothing does (gi/reference/refraction.h) */
    es_surface surface;
    float metallic, roughness, specular; /* what that was made of; Phong: roughness is the exponent */
    uint32_t primitive;
    bool reflects;                     /* not unlit; backs of single-sided surfaces reflect as their fronts, which is how a lamp sees them */
} es_trace_surface;

/* `quantised`: as the G-buffer would hold it. */
void es_trace_surface_at(const es_trace_scene* scene, const es_hit* hit, es_vec3 wo, bool quantised, es_trace_surface* surface);

/* The nearest surface that stops the ray, alpha masks applied. `camera`: backs of single-sided surfaces do not stop it. */
bool es_trace_closest(const es_trace_scene* scene, es_ray ray, bool camera, es_hit* hit);
bool es_trace_blocked(const es_trace_scene* scene, es_ray ray);
/* The same for a camera that sees through blended surfaces: each, from the nearest, stops the ray with probability alpha (as layers do: gi/blend_lists.h), by u in [0, 1).
 * So the mean over u is C = alpha C_surface + (1 - alpha) C_behind. */
bool es_trace_seen(const es_trace_scene* scene, es_ray ray, float u, es_hit* hit);
/* Is the alpha mask, or a blended surface, open there? */
bool es_trace_is_hole(const es_trace_scene* scene, const es_hit* hit);

/* At the finest level: a path's end has no pixel to be filtered for. `uvs`: both sets, as vertices have them. */
void es_trace_sample_texture(const es_texture_use* use, const float uvs[4], float rgba[4]);

/* Radiance of the environment from a direction (unit). */
es_vec3 es_trace_environment(const es_trace_scene* scene, es_vec3 direction);

/* ---- sampling of glowing surfaces and the environment --------------------------------------------------------------------------- */

typedef struct es_light_sample {
    es_vec3 direction;                 /* unit, from the point */
    float distance;                    /* to the source; infinite for the environment */
    es_vec3 radiance;
    float density;                     /* 1/sr */
} es_light_sample;

/* One direction towards glowing geometry or the environment, from three numbers in [0, 1). False when there is none from here. */
bool es_trace_sample_light(const es_trace_scene* scene, es_vec3 point, const float u[3], es_light_sample* sample);
/* The density with which the above finds the hit at `distance` along `direction`; hit NULL: the environment. */
float es_trace_light_density(const es_trace_scene* scene, es_vec3 direction, float distance, const es_trace_surface* hit);

#endif
