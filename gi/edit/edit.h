/* Interpolation of edited directions between an artist's constraints (Ritschel thesis §7.4).
 *
 * At a surface point q with the reflected (or leaving) direction r(q), for each region of influence a(q) > 0, over the constraints n in it:
 *     M = sum of w_n (e_n r_nᵀ + δ S_n),  w_n = 1 / d(p_n, q)²,  R = the rotation nearest to M                        (eq. 7.3, 7.5)
 *     X = the rotation nearest to  sum of a R + max(0, 1 - sum of a) r rᵀ,  e(q) = X r(q)                            (eq. 7.6, 7.7, several regions)
 * S_n is the rotation by the shortest arc from r_n to e_n. Without it M has rank 1 where there is one constraint, or several side by side, and any turn about e_n is as
 * near; with δ = 1/100 the one that turns no more than it must is chosen, and since S_n r_n = e_n nothing else changes where one constraint decides. Where r_n and e_n are
 * opposite the axis is a fixed one across r_n. Distances count in radii of the region and are kept from 0 by 1e-6 of it, so that weights stay below 1e12: at a constraint
 * the others are lost in rounding, and e = e_n there.
 * Each region and each constraint measures d in space or along the surface (sim/edits/). */
#ifndef EARTHSHINE_GI_EDIT_EDIT_H
#define EARTHSHINE_GI_EDIT_EDIT_H

#include "gi/pixel_rays.h"
#include "platform/context.h"

/* δ */
#define ES_EDIT_SHORTEST_ARC 0.01f

typedef enum es_edit_shape { ES_EDIT_BALL, ES_EDIT_GEODESIC, ES_EDIT_STROKES } es_edit_shape;

/* A thick line segment in space. */
typedef struct es_edit_stroke { float from[3], to[3], radius; bool erases; } es_edit_stroke;

/* What pixels of an instance lie on: distances belong to its vertices. */
typedef struct es_edit_mesh {
    uint32_t instance;             /* word of the G-buffer */
    const float* positions;        /* records of four floats */
    const uint32_t* indices;
    es_mat4 transform;
} es_edit_mesh;

typedef struct es_edit_constraint {
    float position[3];
    float matrix[9];               /* e rᵀ + δ S, row by row */
    const float* distances;        /* of the vertices of its region's mesh; elsewhere, and with NULL, distances are in space */
} es_edit_constraint;

typedef struct es_edit_region {
    es_edit_shape shape;
    uint32_t instance;             /* word of the G-buffer; 0: whatever there is */
    float centre[3], radius, border;
    float ball[4];                 /* centre and squared radius of what it cannot reach beyond */
    const es_edit_stroke* strokes;
    uint32_t stroke_count;
    const float* distances;        /* GEODESIC: of the vertices */
    es_edit_mesh mesh;             /* that distances belong to, the constraints' as well; all zero: there are none */
    const es_edit_constraint* constraints;
    uint32_t constraint_count;     /* 1 or more */
} es_edit_region;

typedef struct es_edit_job {
    const es_gbuffer* gbuffer;     /* depth, normal, instance, triangle */
    es_pixel_rays rays;
    const es_edit_region* regions;
    uint32_t region_count;
    bool frozen;                   /* reflected as `eye` would see it, everywhere (§7.2.3) */
    float eye[3];
    const float* original[3];      /* r, rows of the G-buffer's stride; (0, 0, 0) where there is none. NULL: reflected at the normal */
    float* edited[3];              /* e, unit; (0, 0, 0) where r stands as it is */
} es_edit_job;

/* The matrix of es_edit_constraint of two unit vectors. */
void es_edit_constraint_matrix(es_vec3 reflected, es_vec3 edited, float matrix[9]);
/* The region's influence a at a place on a triangle of an instance, by the latter's word of the G-buffer: 0 … 1. */
float es_edit_influence(const es_edit_region* region, es_vec3 place, uint32_t instance, uint32_t triangle);
/* Works on the context's threads. */
void es_edit_directions(es_context* context, const es_edit_job* job);

#endif
