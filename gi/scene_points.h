/* The scene as points, for imperfect shadow maps (Ritschel thesis §5.2.1): each is a place on a triangle, kept as triangle index
 * and barycentric coordinates so that it follows moving and deforming geometry.
 *
 * The pool is cut into subsets of one map's size. Within a subset the points are stratified over the world's area and lie in
 * triangle order, hence in runs of one instance: only the runs of instances that moved are computed again. */
#ifndef EARTHSHINE_GI_SCENE_POINTS_H
#define EARTHSHINE_GI_SCENE_POINTS_H

#include "gi/gi.h"

typedef struct es_point_run { uint32_t first, count, instance; } es_point_run;

typedef struct es_scene_points {
    uint32_t subset_size, subset_count;
    float *x, *y, *z;            /* subset_size · subset_count world positions */
    uint32_t* triangle;
    uint32_t* barycentric;       /* two unsigned 16-bit weights, of the second and third vertex */
    es_point_run* runs;          /* all subsets', sorted by instance, then by place */
    size_t run_count, run_capacity;
    float area;                  /* world area when the points were distributed, m² */
    /* what the positions were computed from */
    struct es_point_source { const es_raster_mesh* mesh; uint32_t triangle_count; uint64_t revision; es_mat4 transform; float volume_scale; } * sources;
    uint32_t source_count;
} es_scene_points;

/* Distributes points anew when the set of triangles changed or an instance has grown or shrunk to twice or half the size it had when
 * they were distributed (until then points keep their places, so that light does not flicker), moves those of instances that moved; *moved says how many positions
 * were computed. An empty list or a list without area gives no points. */
es_result es_scene_points_update(es_context* context, es_scene_points* points, const es_draw_list* list, uint32_t subset_size, uint32_t subset_count, uint64_t* moved);
void es_scene_points_free(es_context* context, es_scene_points* points);

#endif
