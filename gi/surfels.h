/* What the scene's points reflect (Ritschel thesis §5.2.1: their barycentric coordinates "also allow to retrieve the normal and reflectance
 * for each point, which will be required for secondary indirect light bounces"). */
#ifndef EARTHSHINE_GI_SURFELS_H
#define EARTHSHINE_GI_SURFELS_H

#include "gi/scene_points.h"

/* What is at a place on a mesh (triangle and barycentric as es_scene_points has them): words as a G-buffer has them, normal maps left out. Of a
 * hole that a mask cuts the model is UNLIT, which reflects nothing. */
typedef struct es_surfel_words {
    uint32_t albedo_rg, albedo_b, surface;
    bool hole;
} es_surfel_words;
es_surfel_words es_surfel_read(const es_raster_mesh* mesh, const es_material_desc* material, uint32_t triangle, uint32_t barycentric);
/* W/(m² sr), of the front */
es_vec3 es_surfel_emission(const es_raster_mesh* mesh, const es_material_desc* material, uint32_t triangle, uint32_t barycentric);

/* Words as a G-buffer has them (raster/raster.h), one for each point and up to the next multiple of eight; normal maps are left out. The
 * normal is the front's. The upper half of albedo_b says whether the material is double-sided. */
typedef struct es_surfels {
    uint32_t *normal, *albedo_rg, *albedo_b, *surface;
    float* area;                 /* m² that each stands for: an object's, at rest, over its points */
    size_t count;
    const es_scene_points* of;   /* the points they belong to; NULL: none are there */
    uint64_t time;               /* es_scene_points.time they are of */
    uint64_t materials;          /* es_world_revisions.materials they were read at */
} es_surfels;

/* Of all points when materials or their shares changed, else of those of instances whose points did. `list` is the one the points were updated
 * with. */
es_result es_surfels_update(es_context* context, es_surfels* surfels, const es_scene_points* points, const es_draw_list* list, uint64_t materials);
void es_surfels_free(es_context* context, es_surfels* surfels);

/* One subset of points with what they reflect, as the kernels read it. */
typedef struct es_surfel_set {
    const float *x, *y, *z;
    const uint32_t *normal, *albedo_rg, *albedo_b, *surface;
    const float* area;
    uint32_t count;              /* readable up to the next multiple of eight */
} es_surfel_set;
es_surfel_set es_surfels_subset(const es_surfels* surfels, const es_scene_points* points, uint32_t subset);

#endif
