/* The scene as points, for imperfect shadow maps (Ritschel thesis §5.2.1): each is a place on a triangle, kept as triangle index
 * and barycentric coordinates so that it follows moving and deforming geometry.
 *
 * The pool is cut into subsets of one map's size. A subset gives each object (instance) a share of its points, in proportion to the
 * object's area times its weight (Knecht 2009, §5.1 and §6.1), and spreads it over the object's triangles by area: the points of subset s
 * stand at k + o(s), k = 0, 1, …, along the sequence of all areas; what is left of that place within a triangle and the fraction of
 * k times the golden ratio are mapped to the triangle, keeping areas (Heitz 2019, "A low-distortion map between triangle and square").
 * So points are a lattice on each large triangle and one in each equal share of area on small ones.
 *
 * The distribution is a function of the instances as they are now and of their meshes' rest poses, not of what was drawn before: a frame
 * has the same points alone and in a sequence. It does not change while things move rigidly, nor while triangles keep their areas to a
 * factor of ES_POINTS_STRETCH, relative to their object's, so that points stay on their places and light does not flicker. Where a mesh
 * deforms more strongly, its triangles have the excess added to or taken from their shares, which moves this object's points only. */
#ifndef EARTHSHINE_GI_SCENE_POINTS_H
#define EARTHSHINE_GI_SCENE_POINTS_H

#include "gi/gi.h"

/* Deformation that the points of rest do not follow: a triangle's area over its area at rest, relative to that of the whole object. */
#define ES_POINTS_STRETCH 2.0

enum { ES_POINT_RANKS = 8 };

typedef struct es_point_request {
    uint32_t subset_size, subset_count;
    float detail;                /* es_renderer_settings.ism_detail */
} es_point_request;

/* What an instance's points were made from. */
typedef struct es_point_source {
    const es_raster_mesh* mesh;
    uint32_t triangle_count;
    uint64_t revision;
    es_mat4 transform;
    float point_weight;
    double gram[6];              /* of the transform's axes: x·x, y·y, z·z, x·y, x·z, y·z, rounded to 7 bits */
    uint64_t areas;              /* hash of its triangles' shares */
    double rest_area, mass;      /* m²; times the weight */
    uint32_t rank;
    double begin, end;           /* its share of a subset's points: those whose place k + o(s) lies in it */
    uint64_t placed;             /* es_scene_points.time when its points last changed */
    bool strong;                 /* deforms beyond ES_POINTS_STRETCH */
} es_point_source;

typedef struct es_scene_points {
    uint32_t subset_size, subset_count;
    float *x, *y, *z;            /* subset_size · subset_count world positions */
    uint32_t* triangle;
    uint32_t* barycentric;       /* two unsigned 16-bit weights, of the second and third vertex */
    float area;                  /* m², of all objects that have points, at rest */
    /* Points of like density follow one another within a subset. */
    uint32_t rank_count;
    double rank_end[ES_POINT_RANKS];
    float rank_width[ES_POINT_RANKS]; /* metres: side of the square that one point stands for */
    es_point_source* sources;    /* one an instance of the draw list */
    uint32_t source_count;
    uint64_t time;               /* counts updates that changed anything */
    uint64_t layout;             /* time when shares last changed: points may be of other instances since */
    uint64_t redistributed;      /* by the last update: points that went to another place on their object, or to another object */
} es_scene_points;

/* Brings everything up to the draw list; *moved says how many positions were computed. An empty list or a list without area gives
 * no points. */
es_result es_scene_points_update(es_context* context, es_scene_points* points, const es_draw_list* list, const es_point_request* request, uint64_t* moved);
/* How many of subset s's points stand before `place`. Instance i's are those from the border of its begin to that of its end. */
uint32_t es_scene_points_border(const es_scene_points* points, uint32_t subset, double place);
void es_scene_points_free(es_context* context, es_scene_points* points);

#endif
